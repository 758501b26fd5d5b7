"""The paper's algorithms, and a better one, by name: what a configuration file and the shell can ask for.

A preset is a function that returns a pymoo algorithm. The paper's all start from random subsets of every size, cross
with probability 0.8, mutate by `NeighbourShift` with probability 1 / N, pin the corners and, except MOEA/D, eliminate
duplicates. The paper gives each 50 generations of 100; that is a termination which the caller passes
(``minimize(problem, nsga2_v1(), ("n_gen", 50), seed=1)``), and what the presets use when none is passed. Any other
argument of the pymoo algorithm can be given by keyword, an operator too:
``nsga2_v1(mutation=NeighbourShift(along="mesh"))``.

All of them give ``result.X`` (k, N) and ``result.F`` (k, 2): error and number of triangles, the error in the measure
of the problem (``MeshProblem(..., objectives=("rms_error", "triangles"))``). More than one measure takes
:func:`~meshsimp_pymoo.search.nsga.nsga3`, which therefore is no row here.

A new preset is its function and one row. Nothing heavy is imported here, because ``meshsimp --help`` reads the table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Preset:
    """A row of the table.

    Attributes
    ----------
    home : str
        Where its function is: module in this package, colon, name.
    about : str
        What it is, in one line.
    is_the_papers : bool
        Whether the paper has it.
    whole_front : bool
        Whether one run gives a whole front, and the function needs no other argument; the shell offers only those.
    sweeps : bool
        Whether it is done after one sweep of the sizes; the others go on for as long as one lets them.
    evaluations : float
        About how many evaluations a generation makes for each individual.
    measured_by : tuple of str
        The kinds of budget that measure its work; seconds fit all.
    frees : bool
        Whether it makes free meshes itself, ``triangulation="free"``; fronts of others can be freed.
    """

    home: str
    about: str
    is_the_papers: bool = True
    whole_front: bool = True
    sweeps: bool = False
    evaluations: float = 1.0
    measured_by: tuple[str, ...] = ("generations", "evaluations")
    frees: bool = False

    @property
    def function(self) -> Callable[..., Any]:
        """The function that returns the algorithm, imported when first asked for."""
        module, _, name = self.home.partition(":")
        function: Callable[..., Any] = getattr(import_module(f"meshsimp_pymoo.{module}"), name)
        return function


PRESETS: dict[str, Preset] = {
    "memetic": Preset(
        home="search.memetic:memetic",
        about="annealing down a ladder of sizes, from thinned subsets",
        is_the_papers=False,
        sweeps=True,
        measured_by=("moves",),
        frees=True,
    ),
    "nsga2_v1": Preset(home="search.nsga:nsga2_v1", about="NSGA-II, uniform crossover"),
    "nsga2_v2": Preset(home="search.nsga:nsga2_v2", about="NSGA-II, crossover OAX over L4", evaluations=2.1),
    "moead": Preset(
        home="search.moead:moead", about="MOEA/D, Tchebycheff (Eq. 7), neighbourhood 20, uniform crossover"
    ),
    "weighted_ga_v1": Preset(
        home="search.weighted:weighted_ga_v1",
        about="elitist GA on the weighted sum (Eq. 8), uniform crossover",
        whole_front=False,
    ),
    "weighted_ga_v2": Preset(
        home="search.weighted:weighted_ga_v2",
        about="elitist GA on the weighted sum (Eq. 8), crossover OAX over L4",
        whole_front=False,
        evaluations=2.1,
    ),
    "fujiwara_sawai": Preset(
        home="search.weighted:fujiwara_sawai",
        about="elitist GA on the error at one number of points, crossover in the plane",
        is_the_papers=False,
        whole_front=False,
    ),
    "huang_ho": Preset(
        home="search.weighted:huang_ho",
        about="elitist GA on the error at one number of points, crossover OAX over L4",
        is_the_papers=False,
        whole_front=False,
        evaluations=2.1,
    ),
}

# What the shell takes where nothing is said.
DEFAULT = "memetic"
# Generations of those that do not sweep, where nothing is said: four times the paper's budget, since its 50 generations
# take a second at its sizes and leave much to gain.
DEFAULT_GENERATIONS = 200
