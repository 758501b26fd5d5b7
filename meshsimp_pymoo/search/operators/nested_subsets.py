"""Where a seeded search starts: the subsets of a greedy pass, thinning."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.sampling import Sampling

from meshsimp_pymoo.arrays import IntArray
from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.search.budgets import seconds_given
from meshsimp_pymoo.search.operators.random_subset import RandomSubset
from meshsimp_pymoo.search.requirements import pinned_vertices, require_probability, surface_of
from meshsimp_pymoo.search.starting import Start, thinned


class NestedSubsets(Sampling):
    """Subsets of adaptive thinning at sizes spread evenly over the logarithm, mixed with random ones.

    Thinning runs once and gives a subset of every size (see :func:`~meshsimp_pymoo.search.greedy.thinning`). Where a
    termination by time leaves too little for that, a warning says what it starts from instead.

    Parameters
    ----------
    triangles : (int, int), optional
        Smallest and largest number of triangles to sample; all by default.
    random_share : float
        Share of the population that are random subsets instead.

    Raises
    ------
    ValueError
        If the range or the share makes no sense.
    TypeError
        When sampling for a problem that is no ``MeshProblem``.
    """

    def __init__(self, triangles: tuple[int, int] | None = None, random_share: float = 0.0) -> None:
        """Say which sizes are sampled."""
        super().__init__()
        if triangles is not None and not 1 <= triangles[0] <= triangles[1]:
            raise ValueError(f"triangles={triangles} is no range; give (lowest, highest), from 1 upwards")
        self.triangles = triangles
        self.random_share = require_probability("random_share", random_share)

    __repr__ = as_made

    def _do(
        self, problem: Any, n_samples: int, *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        pinned = pinned_vertices(problem, self)
        n_random = int(self.random_share * n_samples)
        start = thinned(surface_of(problem, self), seconds_given(kwargs.get("algorithm")))
        X = np.empty((n_samples, len(pinned)), dtype=bool)
        for kept, k in zip(X, self.rows(start, n_samples - n_random), strict=False):
            kept[:] = start.kept(int(k))
        if n_random:
            X[n_samples - n_random :] = RandomSubset()._do(problem, n_random, random_state=random_state)
        return X

    def rows(self, start: Start, n: int) -> IntArray:
        """Return which n meshes of a start are sampled, spread evenly over the logarithm of their size."""
        rows = np.flatnonzero(start.triangles > 0)
        if self.triangles is not None:
            low, high = self.triangles
            inside = rows[(start.triangles[rows] >= low) & (start.triangles[rows] <= high)]
            if not len(inside):
                raise ValueError(
                    f"thinning has no mesh of {low} to {high} triangles; it goes from {start.triangles[rows].min()} to "
                    f"{start.triangles[rows].max()}"
                )
            rows = inside
        wanted = np.geomspace(rows[0] + 1, rows[-1] + 1, n) - 1
        return np.clip(np.round(wanted).astype(int), rows[0], rows[-1])
