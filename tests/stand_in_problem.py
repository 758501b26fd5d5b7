"""A cheap problem with a known structure that has all that the operators ask of a mesh problem."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population
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


def evaluated_pairs(problem: GridProblem, n_matings: int, seed: int, equal_genes: float = 0.0) -> Population:
    """Evaluated random pairs; a share of the genes is the same in both parents of a pair."""
    rng = np.random.default_rng(seed)
    parents = rng.random((n_matings, 2, problem.n_var)) < 0.5
    same = rng.random((n_matings, problem.n_var)) < equal_genes
    parents[:, 1][same] = parents[:, 0][same]
    parents |= problem.pinned
    pop = Population.new("X", parents.reshape(-1, problem.n_var))
    return Evaluator().eval(problem, pop).reshape(n_matings, 2)


def opposite_pairs(problem: GridProblem, n_matings: int, seed: int) -> Population:
    """Evaluated pairs that differ in every gene, nothing being pinned: no segment on which they agree."""
    problem.pinned = np.zeros(problem.n_var, dtype=bool)
    first = np.random.default_rng(seed).random((n_matings, problem.n_var)) < 0.5
    pop = Population.new("X", np.stack([first, ~first], axis=1).reshape(-1, problem.n_var))
    return Evaluator().eval(problem, pop).reshape(n_matings, 2)


def call(
    crossover: Any, problem: GridProblem, pairs: Any, seed: int, **algorithm: Any
) -> tuple[np.ndarray, int]:
    """Children (n_offsprings, n_matings, N) and the number of evaluations that were counted."""
    caller = SimpleNamespace(
        **({"evaluator": Evaluator(), "data": {}, "n_iter": 2, "archive": None} | algorithm)
    )
    before, calls = caller.evaluator.n_eval, problem.calls
    children = crossover(problem, pairs, random_state=np.random.default_rng(seed), algorithm=caller).get("X")
    assert caller.evaluator.n_eval - before == problem.calls - calls
    return children.reshape(crossover.n_offsprings, len(pairs), -1), problem.calls - calls
