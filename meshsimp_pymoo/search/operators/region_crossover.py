"""Each region from the parent that does it for less, by the errors that the parents are known to have there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.individual import Individual

from meshsimp_pymoo.search.operators.pair_crossover import PairCrossover
from meshsimp_pymoo.search.operators.segments import combine, random_cuts
from meshsimp_pymoo.search.requirements import pinned_vertices

# Free vertices kept by both parents together in a region that is judged as one: with fewer, chance decides.
KEPT_PER_REGION = 16
# The price of a triangle is drawn up to this factor above or below that of the parents.
PRICE_FACTOR = 2.0


class RegionCrossover(PairCrossover):
    """Take each region from the parent that buys its accuracy there with fewer triangles, by errors already known.

    Both objectives add up over regions of the plane, nearly, since Delaunay triangulations are local. So the parents
    can be compared region by region: one has the error e_a there with t_a triangles, the other e_b with t_b, and the
    region comes from the one with the smaller e + price * t (marginal analysis). What a triangle is worth is the
    parents' error per triangle: where the error falls as c / t, one more triangle saves c / t^2, and between two such
    parents, c / (t_a t_b), their geometric mean. The first child's price is drawn from half to twice of that, the
    second one's is as far on the other side.

    The errors are those that the parents' evaluation has left with them: nothing is evaluated here. It needs
    ``MeshProblem(..., regions=256)``, say. Regions are runs of the vector, which are patches in space; they are joined
    to random larger ones where the parents have few vertices. Triangles are counted as two for each kept vertex.

    A child that would be a copy of a parent takes the region where that costs least from the other one.

    Parameters
    ----------
    prob : float
        The probability of a pair to cross.
    n_offsprings : {2, 1}
        Children per pair.

    Raises
    ------
    ValueError
        If ``prob`` is not in [0, 1] or ``n_offsprings`` is neither 1 nor 2, and when applied to a problem without
        regions or to parents without known errors.
    TypeError
        When applied to chromosomes that are not bool, or for a problem without a mesh model.
    """

    def __init__(self, prob: float = 0.9, *, n_offsprings: int = 2) -> None:
        super().__init__(prob, n_offsprings)

    def _do(
        self,
        problem: Any,
        X: NDArray[np.bool_],
        *args: Any,
        random_state: np.random.Generator,
        mates: Sequence[Sequence[Individual]],
        **kwargs: Any,
    ) -> NDArray[np.bool_]:
        pinned = pinned_vertices(problem, self)
        n_known = getattr(problem, "regions", 0)
        if not n_known:
            raise ValueError(
                f"{type(self).__name__} compares errors by region, and the problem keeps none; "
                "make it with MeshProblem(..., regions=256)"
            )
        starts = region_starts(n_known, X.shape[2])
        children = np.empty((self.n_offsprings, *X.shape[1:]), dtype=bool)
        for k, pair in enumerate(mates):
            error = np.array([_known_errors(parent, n_known, self) for parent in pair])
            kept = np.add.reduceat(X[:, k] & ~pinned, starts, axis=1, dtype=np.int64)
            n_runs = int(np.clip(kept.sum() // KEPT_PER_REGION, 2, n_known))
            runs = random_cuts(n_known, n_runs, random_state)[:-1] if n_known > 1 else np.zeros(1, int)
            more_error = np.add.reduceat(error[0] - error[1], runs)
            more_triangles = np.add.reduceat(2 * (kept[0] - kept[1]), runs)
            worth = price_of_a_triangle(error.sum(axis=1), 2 * kept.sum(axis=1))
            differs = np.logical_or.reduceat(X[0, k] ^ X[1, k], starts[runs])
            exponent = random_state.uniform(-1.0, 1.0)
            for child, sign in zip(children[:, k], (1.0, -1.0), strict=False):
                price = worth * PRICE_FACTOR ** (sign * exponent)
                second = cheaper_parent(more_error + price * more_triangles, differs)
                child[:] = combine(X[0, k], X[1, k], np.append(starts[runs], X.shape[2]), second)
        return children


def region_starts(n_regions: int, n_vertices: int) -> NDArray[np.int64]:
    """Return the first vertex of each region, (n_regions,): vertex i is in region i * n_regions // n_vertices.

    Examples
    --------
    >>> region_starts(3, 10).tolist()
    [0, 4, 7]
    """
    return -(-np.arange(n_regions) * n_vertices // n_regions)


def price_of_a_triangle(error: NDArray[np.float64], triangles: NDArray[np.integer]) -> float:
    """Return the error [model units] that a triangle is worth: the geometric mean of two parents' error per triangle.

    Parameters
    ----------
    error : (2,) float array
        Summed error of each parent [model units].
    triangles : (2,) int array
        Triangles of each; 0 counts as 1.

    Examples
    --------
    >>> price_of_a_triangle(np.array([12.0, 3.0]), np.array([10, 40]))
    0.3
    """
    return float(np.sqrt(np.prod(error / np.maximum(triangles, 1))))


def cheaper_parent(excess: NDArray[np.float64], differs: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return for each region whether to take it from the second parent; never the same parent for all that differ.

    Parameters
    ----------
    excess : (n,) float array
        What the first parent costs more [model units].
    differs : (n,) bool array
        Where the parents differ; with fewer than two such regions there are only copies.

    Returns
    -------
    (n,) bool array
        True where the second parent costs less. Where that would be one parent's copy, the region in which the choice
        matters least is the other one's.
    """
    second = excess > 0.0
    rows = np.flatnonzero(differs)
    if len(rows) > 1 and second[rows].all() == second[rows].any():
        row = rows[np.argmin(np.abs(excess[rows]))]
        second[row] = not second[row]
    return second


def _known_errors(parent: Individual, n_regions: int, operator: object) -> NDArray[np.float64]:
    known = parent.get("region_error")
    if known is None or len(known) != n_regions:
        raise ValueError(
            f"{type(operator).__name__} needs parents evaluated by the problem itself, with their errors in "
            f"{n_regions} regions; this one has {'none' if known is None else len(known)}"
        )
    return np.asarray(known, float)
