"""Kept vertices move to better places, by annealing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.mutation import Mutation

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.search.local_search import relocate_all
from meshsimp_pymoo.search.operators.mesh_mutation import require_mesh
from meshsimp_pymoo.search.requirements import require_probability


class Relocation(Mutation):
    """Move kept vertices to better places by annealing on the live triangulation; the size stays.

    A local search with a bounded effort whose result is inherited (Lamarckian): the child never has a larger
    error than it came with. See :func:`~meshsimp_pymoo.search.local_search.relocate` for a single move.

    Parameters
    ----------
    moves_per_vertex : float
        Moves to try for each kept vertex that is not pinned.
    max_moves : int
        Moves of all rows together; where there would be more, all rows get fewer. A move takes some
        microseconds.
    temperature : float
        Initial temperature, in units of the error per kept vertex; 0 accepts improvements only.
    prob : float
        The probability of an individual to keep the result.

    Raises
    ------
    ValueError
        If one of the numbers is negative or ``prob`` not in [0, 1], and when the problem minimises the maximum.
    TypeError
        When applied to chromosomes that are not bool, or for a problem that is no ``MeshProblem``.
    """

    def __init__(
        self,
        moves_per_vertex: float = 30.0,
        *,
        max_moves: int = 300_000,
        temperature: float = 0.2,
        prob: float = 1.0,
    ) -> None:
        super().__init__(prob=require_probability("prob", prob))
        given = {"moves_per_vertex": moves_per_vertex, "max_moves": max_moves, "temperature": temperature}
        for name, value in given.items():
            if not value >= 0:
                raise ValueError(f"{name} = {value} is no number of at least 0")
        self.moves_per_vertex = moves_per_vertex
        self.max_moves = max_moves
        self.temperature = temperature

    __repr__ = as_made

    def _do(
        self, problem: Any, X: NDArray[np.bool_], *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        pinned = require_mesh(problem, X, self)
        moves = self.moves_per_vertex * (X & ~pinned).sum(axis=1)
        total = moves.sum()
        if total > self.max_moves:
            moves = moves * (self.max_moves / total)
        return relocate_all(problem.surface, X, moves.astype(int), random_state, temperature=self.temperature)
