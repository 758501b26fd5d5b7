"""A cheap problem with a known structure that has all that the operators ask of a mesh problem."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import ElementwiseProblem


class GridProblem(ElementwiseProblem):
    """A side x side grid; its four corners are pinned, its edges are the mesh.

    The error is additive: every vertex that is not kept costs its weight. So the better segment of two
    parents can be read off, and the best n vertices to keep are the heaviest ones.
    """

    def __init__(self, side: int = 5, max_triangles: int | None = None, **kwargs: Any) -> None:
        n = side * side
        vertex = np.arange(n).reshape(side, side)
        self.pinned = np.zeros(n, dtype=bool)
        self.pinned[vertex[[0, 0, -1, -1], [0, -1, 0, -1]]] = True
        self.surface = SimpleNamespace(neighbours=grid_neighbours(side))
        self.weights = np.random.default_rng(5).integers(1, 1000, size=n).astype(float)
        self.max_triangles = max_triangles
        self.calls = 0
        super().__init__(
            n_var=n, n_obj=2, n_ieq_constr=int(max_triangles is not None), vtype=bool, xl=0, xu=1, **kwargs
        )

    def _evaluate(self, x: NDArray[np.bool_], out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        self.calls += 1
        kept = x | self.pinned
        out["F"] = [self.weights[~kept].sum(), 2.0 * kept.sum() - 6]
        out["vertices"] = int(kept.sum())
        if self.max_triangles is not None:
            out["G"] = [out["F"][1] - self.max_triangles]


def grid_neighbours(side: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """CSR one-rings of a grid without diagonals, each ring ascending."""
    rings = []
    for i in range(side):
        for j in range(side):
            around = [(i - 1, j), (i, j - 1), (i, j + 1), (i + 1, j)]
            rings.append([a * side + b for a, b in around if 0 <= a < side and 0 <= b < side])
    indptr = np.concatenate([[0], np.cumsum([len(ring) for ring in rings])])
    return indptr, np.concatenate(rings)


def front_of(problem: GridProblem) -> NDArray[np.float64]:
    """The true front: keep the heaviest vertices, any number of them."""
    weights = np.sort(problem.weights[~problem.pinned])
    n_dropped = np.arange(len(weights) + 1)
    error = np.concatenate([[0.0], np.cumsum(weights)])
    return np.column_stack([error, 2.0 * (problem.n_var - n_dropped) - 6])
