"""NSGA-II as the paper has it, in two versions, and NSGA-III for more than two objectives."""

from __future__ import annotations

from typing import Any

from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3 as PymooNSGA3
from pymoo.operators.selection.tournament import TournamentSelection
from pymoo.util.ref_dirs import get_reference_directions

from meshsimp_pymoo.reprs import of_algorithm
from meshsimp_pymoo.search.operators import OAX, PackedDuplicates, SubsetUniformCrossover
from meshsimp_pymoo.search.paper import CROSSOVER_PROBABILITY, GENERATIONS, POP_SIZE, paper_operators
from meshsimp_pymoo.search.selection import crowded_tournament, violation_tournament


class NSGA2(PymooNSGA2):
    """pymoo's NSGA-II, which says what it is made of."""

    def __repr__(self) -> str:
        return of_algorithm(self, f"{self.pop_size:,} individuals")


class NSGA3(PymooNSGA3):
    """pymoo's NSGA-III, which says what it is made of."""

    def __repr__(self) -> str:
        return of_algorithm(self, f"{self.pop_size:,} individuals", f"{len(self.ref_dirs):,} directions")


def nsga2_v1(pop_size: int = POP_SIZE, **kwargs: Any) -> NSGA2:
    """NSGA-II with uniform crossover, the paper's first version.

    Parameters
    ----------
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of ``pymoo.algorithms.moo.nsga2.NSGA2``; they replace the preset's own.
    """
    return _nsga2(pop_size, {"crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY)} | kwargs)


def nsga2_v2(pop_size: int = POP_SIZE, **kwargs: Any) -> NSGA2:
    """NSGA-II with the orthogonal-array crossover over L4, the paper's second version.

    A generation costs about 2.2 times the evaluations of `nsga2_v1` (3 per crossing pair more, see `OAX`):
    compare the two at equal evaluations as well as at equal generations.

    Parameters
    ----------
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of ``pymoo.algorithms.moo.nsga2.NSGA2``; they replace the preset's own.
    """
    return _nsga2(pop_size, {"crossover": OAX("L4", prob=CROSSOVER_PROBABILITY)} | kwargs)


def nsga3(n_objectives: int = 3, *, n_partitions: int = 12, pop_size: int | None = None, **kwargs: Any) -> NSGA3:
    """NSGA-III (Deb and Jain 2014) with uniform crossover, for more than one measure of the error at once.

    Parameters
    ----------
    n_objectives : int
        Number of objectives of the problem.
    n_partitions : int
        Gaps along each edge of the simplex of reference directions (Das and Dennis 1998): 12 make 91 directions for
        three objectives.
    pop_size : int, optional
        Individuals in the population; by default as many as there are directions.
    **kwargs
        Further arguments of ``pymoo.algorithms.moo.nsga3.NSGA3``; they replace the preset's own.

    Examples
    --------
    The sum of the deviations, their maximum and the number of triangles, all from one evaluation:

    >>> from pymoo.optimize import minimize
    >>> from meshsimp_pymoo import MeshProblem
    >>> problem = MeshProblem("roof:5", objectives=("error", "max_error", "triangles"))
    >>> result = minimize(problem, nsga3(), ("n_gen", 20), seed=1)
    >>> result.F[result.F[:, 2].argmin()].tolist()     # one end of the front: two triangles over the corners
    [10.0, 1.0, 2.0]
    """
    directions = get_reference_directions("das-dennis", n_objectives, n_partitions=n_partitions)
    defaults = paper_operators() | {
        "crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY),
        "selection": TournamentSelection(func_comp=violation_tournament),
        "eliminate_duplicates": PackedDuplicates(),
    }
    algorithm = NSGA3(directions, pop_size, **(defaults | kwargs))
    algorithm.termination = kwargs.get("termination", ("n_gen", GENERATIONS))
    return algorithm


def _nsga2(pop_size: int, arguments: dict[str, Any]) -> NSGA2:
    defaults = paper_operators() | {
        "selection": TournamentSelection(func_comp=crowded_tournament),
        "eliminate_duplicates": PackedDuplicates(),
    }
    algorithm = NSGA2(pop_size, **(defaults | arguments))
    # pymoo's constructor puts its default here whatever is passed; that default cannot compare bool vectors.
    algorithm.termination = arguments.get("termination", ("n_gen", GENERATIONS))
    return algorithm
