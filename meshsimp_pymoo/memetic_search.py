"""Evolution that starts from the greedy pass, crosses patches and searches locally: the front to beat.

The population is a ladder of sizes: every rung is a number of triangles and holds the best mesh found of at most that
many. Parents are neighbours on the ladder, so that their patches have a similar density; a child takes one side of a
random line from each, is brought to the size of its first parent, and is annealed (Ho, Shu, Chen 2004 call the passing
on of solutions between neighbouring sizes inheritance). The error on a rung never grows, so at these sizes the front is
never worse than the thinning it started from.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.population import Population
from pymoo.core.selection import Selection
from pymoo.core.survival import Survival
from pymoo.util.display.multi import MultiObjectiveOutput

from meshsimp_pymoo.operators import (
    HalfPlaneCrossover,
    NestedSubsets,
    PackedDuplicates,
    PinnedCorners,
    Relocation,
)

# Partners are at most this many rungs apart.
REACH = 3
# Matings a generation that find nothing new before the run ends.
REPEATS = 20
# Generations where the caller gives no termination.
GENERATIONS = 50


class SizeNeighbours(Selection):
    """Pairs of parents that are close in their number of triangles; every individual is a first parent in turn."""

    def _do(
        self,
        problem: Any,
        pop: Population,
        n_select: int,
        n_parents: int,
        *args: Any,
        random_state: np.random.Generator,
        **kwargs: Any,
    ) -> NDArray[np.int64]:
        order = np.argsort(pop.get("F")[:, 1], kind="stable")
        turns = -(-n_select // len(pop))
        first = np.concatenate([random_state.permutation(len(pop)) for _ in range(turns)])[:n_select]
        parents = np.empty((n_select, n_parents), dtype=int)
        parents[:, 0] = first
        for k in range(1, n_parents):
            step = random_state.integers(1, REACH, size=n_select, endpoint=True)
            step *= random_state.choice([-1, 1], n_select)
            partner = first + step
            # At the ends of the ladder the step goes the other way.
            partner = np.where((partner < 0) | (partner >= len(pop)), first - step, partner)
            parents[:, k] = np.clip(partner, 0, len(pop) - 1)
        return order[parents]


class SizeLadder(Survival):
    """On every rung the individual of least error among those of at most so many triangles.

    The rungs are the numbers of triangles of the first population. Rungs that share their best individual leave places,
    which go to the individuals that come closest to their rung's best.
    """

    def __init__(self) -> None:
        super().__init__(filter_infeasible=False)
        self.rungs: NDArray[np.float64] | None = None

    def _do(self, problem: Any, pop: Population, *args: Any, n_survive: int | None = None, **kwargs: Any) -> Population:
        F = pop.get("F")
        if F.shape[1] != 2:
            raise ValueError(
                f"the ladder of sizes has two objectives, a measure of the error and the triangles, the problem has "
                f"{F.shape[1]}; leave one measure, or use nsga3()"
            )
        violation = pop.get("CV").ravel() if problem.has_constraints() else np.zeros(len(pop))
        if self.rungs is None:
            self.rungs = np.unique(F[:, 1])
        n_survive = len(pop) if n_survive is None else min(n_survive, len(pop))
        # By violation, then error, then triangles: the first of those small enough is a rung's best.
        order = np.lexsort((F[:, 1], F[:, 0], violation))
        winners: list[int] = []
        least = np.full(len(pop), np.inf)
        for rung in self.rungs[::-1]:
            fitting = order[F[order, 1] <= rung]
            if len(fitting):
                winners.append(int(fitting[0]))
        for k in range(len(pop)):
            rung = self.rungs[min(int(np.searchsorted(self.rungs, F[k, 1])), len(self.rungs) - 1)]
            best = [w for w in winners if F[w, 1] <= rung]
            least[k] = F[best, 0].min() if best else F[k, 0]
        unique = list(dict.fromkeys(winners))
        if len(unique) < n_survive:
            excess = np.divide(F[:, 0], least, out=np.full(len(pop), np.inf), where=least > 0) + 1e9 * violation
            excess[unique] = np.inf
            unique += [int(k) for k in np.argsort(excess, kind="stable")[: n_survive - len(unique)]]
        return pop[np.sort(unique[:n_survive])]


def memetic(
    pop_size: int = 100,
    *,
    triangles: tuple[int, int] | None = None,
    moves_per_vertex: float = 60.0,
    max_moves: int = 1_000_000,
    **kwargs: Any,
) -> GeneticAlgorithm:
    """Return the seeded memetic algorithm: thinning, half-plane crossover, annealed relocation, a ladder of sizes.

    It lowers the problem's measure of the error, which must be a sum over the vertices ("error" or "rms_error").

    Parameters
    ----------
    pop_size : int
        Rungs of the ladder.
    triangles : (int, int), optional
        Smallest and largest number of triangles to look at; all by default.
    moves_per_vertex : float
        Moves of the local search for each kept vertex and child; see :class:`~meshsimp_pymoo.operators.Relocation`.
    max_moves : int
        Moves of a whole generation, some microseconds each.
    **kwargs
        Further arguments of pymoo's ``GeneticAlgorithm``; they replace those set here.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from meshsimp_pymoo import MeshProblem
    >>> problem = MeshProblem("roof:9")
    >>> result = minimize(problem, memetic(20, triangles=(2, 20)), ("n_gen", 4), seed=1)
    >>> sorted({(float(e), int(t)) for e, t in result.F}, key=lambda row: row[1])[-1]
    (0.0, 4)
    """
    defaults: dict[str, Any] = {
        "sampling": NestedSubsets(triangles),
        "selection": SizeNeighbours(),
        "crossover": HalfPlaneCrossover(prob=0.5, n_offsprings=1, keep_size=True),
        "mutation": Relocation(moves_per_vertex, max_moves=max_moves),
        "survival": SizeLadder(),
        "repair": PinnedCorners(),
        "eliminate_duplicates": PackedDuplicates(),
        "output": MultiObjectiveOutput(),
        "advance_after_initial_infill": True,
        "n_offsprings": max(pop_size // 4, 1),
    }
    algorithm = GeneticAlgorithm(pop_size, **(defaults | kwargs))
    # Searches repeated for children that turn out to be known; if all fail the run ends, with nothing left to find.
    algorithm.mating.n_max_iterations = REPEATS
    # What pymoo's constructor would put here cannot compare bool vectors.
    algorithm.termination = kwargs.get("termination", ("n_gen", GENERATIONS))
    return algorithm
