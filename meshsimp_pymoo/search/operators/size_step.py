"""Some more kept vertices, or some fewer."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.mutation import Mutation

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.search.local_search import relocate_all
from meshsimp_pymoo.search.operators.mesh_mutation import require_mesh
from meshsimp_pymoo.search.requirements import require_probability


class SizeStep(Mutation):
    """Change the number of kept vertices by a controlled step: good insertions, or cheap removals.

    The wanted size is the old one times a factor drawn uniformly on the logarithm from 1 / (1 + step) to 1 + step.
    Vertices are then added or removed one at a time until it is reached, each the best of some drawn by the exact
    change of the error: candidates for insertion come from triangles with large errors.

    Parameters
    ----------
    step : float
        Largest relative change of the size; at least one vertex.
    prob : float
        The probability of an individual to keep the result.

    Raises
    ------
    ValueError
        If ``step`` is negative or ``prob`` not in [0, 1], and when the problem minimises the maximum.
    TypeError
        When applied to chromosomes that are not bool, or for a problem that is no ``MeshProblem``.
    """

    def __init__(self, step: float = 0.1, *, prob: float = 1.0) -> None:
        super().__init__(prob=require_probability("prob", prob))
        if not step >= 0:
            raise ValueError(f"step = {step} is no number of at least 0")
        self.step = step

    __repr__ = as_made

    def _do(
        self, problem: Any, X: NDArray[np.bool_], *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        pinned = require_mesh(problem, X, self)
        if self.step == 0:
            return X.copy()
        free = (X & ~pinned).sum(axis=1)
        draw = random_state.uniform(-1.0, 1.0, size=len(X))
        wanted = np.round(free * (1.0 + self.step) ** draw).astype(int)
        wanted = np.where(wanted == free, free + np.where(draw < 0.0, -1, 1), wanted)
        sizes = pinned.sum() + np.clip(wanted, 0, int((~pinned).sum()))
        return relocate_all(problem.surface, X, np.zeros(len(X), int), random_state, sizes=sizes)
