"""The sides of a random line, exchanged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshsimp_pymoo.search.operators.pair_crossover import PairCrossover, of_the_parents_sizes
from meshsimp_pymoo.search.requirements import surface_of


class HalfPlaneCrossover(PairCrossover):
    """Exchange the vertices on one side of a random line in the plane.

    Delaunay triangulations are local: away from the line each side keeps the triangles of the parent it comes
    from, so whole patches that have proved themselves travel together.

    Parameters
    ----------
    prob : float
        The probability of a pair to cross.
    n_offsprings : {2, 1}
        Children per pair.
    keep_size : bool
        Add or drop vertices, good ones of a few drawn, until each child has as many as its first parent (the
        second child: as the second). Otherwise children have whatever falls to them.

    Raises
    ------
    ValueError
        If ``prob`` is not in [0, 1] or ``n_offsprings`` is neither 1 nor 2.
    TypeError
        When applied to chromosomes that are not bool, or for a problem without a mesh model.
    """

    def __init__(self, prob: float = 0.9, *, n_offsprings: int = 2, keep_size: bool = False) -> None:
        super().__init__(prob, n_offsprings)
        self.keep_size = keep_size

    def _do(
        self, problem: Any, X: NDArray[np.bool_], *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        surface = surface_of(problem, self)
        exchanged = half_planes(surface.places, X.shape[1], random_state)
        exchanged &= X[0] ^ X[1]
        children = X[: self.n_offsprings] ^ exchanged
        return of_the_parents_sizes(problem, self, children, X, random_state) if self.keep_size else children


def half_planes(places: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Draw ``n`` random lines (in space: planes); return which vertices lie on one side of each, as (n, N) bool.

    Each has a uniform direction and leaves a uniform share of the vertices, 10 to 90 %, on that side.

    Parameters
    ----------
    places : (N, 2) or (N, 3) float array
        Positions of the vertices.
    n : int
        Number of lines.
    rng : numpy.random.Generator
        Source of randomness.
    """
    if places.shape[1] == 2:
        angle = rng.uniform(0.0, 2.0 * np.pi, size=n)
        normals = np.column_stack([-np.sin(angle), np.cos(angle)])
    else:
        normals = rng.normal(size=(n, 3))
    n_left = np.clip((rng.uniform(0.1, 0.9, size=n) * len(places)).astype(int), 1, len(places) - 1)
    sides = np.empty((n, len(places)), dtype=bool)
    for side, normal, k in zip(sides, normals, n_left, strict=True):
        offset = places @ normal
        np.less(offset, np.partition(offset, k)[k], out=side)
    return sides
