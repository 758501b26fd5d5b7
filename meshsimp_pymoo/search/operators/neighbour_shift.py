"""The paper's mutation: kept vertices move to neighbouring positions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.mutation import Mutation
from pymoo.core.variable import get

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.search.requirements import pinned_vertices, require_bool, require_probability, surface_of

# Rows are mutated in blocks of about this many genes, so that even high rates need little memory beside X.
GENES_PER_BLOCK = 1 << 24


class NeighbourShift(Mutation):
    """Move kept vertices to neighbouring positions; the number of kept vertices never changes.

    Each kept, unpinned vertex tries to move with probability ``prob_var``, independently of the others, to
    one position drawn uniformly from its neighbours. In the paper this exchanges two neighbouring genes, so a
    move is possible only where the position is free:

    * the neighbour is kept already: exchanging two equal genes changes nothing, the vertex stays;
    * the neighbour is pinned: it counts as kept, the vertex stays;
    * two vertices choose the same free position: the first in vector order gets it, the other stays;
    * at either end of the vector there is only one neighbour, which is then chosen;
    * a vertex without neighbours in the mesh stays.

    "Kept already" refers to the solution before the mutation: a position that another move frees counts as
    taken.

    Parameters
    ----------
    prob_var : float, optional
        The paper's p_m: the probability of one vertex to move. 1 / N by default.
    along : {"vector", "mesh"}
        ``"vector"``: to index - 1 or index + 1, as in the paper (neighbours on the vector are close in space,
        because the vertices are in Hilbert order). ``"mesh"``: to a vertex of the one-ring in the original
        mesh.
    prob : float
        The probability of an individual to be mutated at all.

    Raises
    ------
    ValueError
        If ``along`` is unknown or a probability is not in [0, 1].
    TypeError
        When applied to a problem without ``pinned`` (or ``surface.neighbours``, along the mesh), or to
        chromosomes that are not bool.
    """

    def __init__(self, prob_var: float | None = None, *, along: str = "vector", prob: float = 1.0) -> None:
        if along not in ("vector", "mesh"):
            raise ValueError(f"along = {along!r} is unknown; choose 'vector' (as in the paper) or 'mesh'")
        if prob_var is not None:
            require_probability("prob_var", prob_var)
        super().__init__(prob=require_probability("prob", prob), prob_var=prob_var)
        self.along = along

    __repr__ = as_made

    def _do(
        self, problem: Any, X: NDArray[np.bool_], *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        require_bool(X, self)
        pinned = pinned_vertices(problem, self)
        neighbours = surface_of(problem, self).neighbours if self.along == "mesh" else None
        rate = float(self.get_prob_var(problem))
        shifted = X.copy()
        rows = max(1, GENES_PER_BLOCK // X.shape[1])
        for start in range(0, len(X), rows):
            shift_kept(shifted[start : start + rows], pinned, rate, neighbours, random_state)
        return shifted

    def draw(self, problem: Any, n: int, random_state: np.random.Generator) -> tuple[NDArray[np.int64], ...]:
        """Draw the moves that vertices of n solutions will try, before it is known which vertices they keep.

        For an algorithm that makes one child after the other, but draws for all of them at once; with `shift_drawn`
        it is the mutation itself, the numbers only drawn in another order.

        Parameters
        ----------
        problem : MeshProblem
            The problem being solved.
        n : int
            Number of solutions.
        random_state : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        starts : (n + 1,) int array
            Where the moves of each solution begin; at last, where they end.
        vertex, target : (k,) int arrays
            From where to where, in ascending order of the vertex within a solution; neither is pinned.
        """
        pinned = pinned_vertices(problem, self)
        neighbours = surface_of(problem, self).neighbours if self.along == "mesh" else None
        rate = float(self.get_prob_var(problem))
        row, vertex = np.divmod(bernoulli_positions(n * len(pinned), rate, random_state), len(pinned))
        target = drawn_targets(vertex, len(pinned), neighbours, random_state)
        is_mutated = random_state.random(n) <= get(self.prob, size=n)
        possible = is_mutated[row] & ~pinned[vertex] & ~pinned[target]
        return np.searchsorted(row[possible], np.arange(n + 1)), vertex[possible], target[possible]


def shift_kept(
    X: NDArray[np.bool_],
    pinned: NDArray[np.bool_],
    rate: float,
    neighbours: tuple[NDArray[np.integer], NDArray[np.integer]] | None,
    rng: np.random.Generator,
) -> None:
    """Move kept vertices of all rows in place, by the rules of `NeighbourShift`.

    Parameters
    ----------
    X : (n, N) bool array
        Chromosomes; changed in place.
    pinned : (N,) bool array
        Vertices that neither move nor give way.
    rate : float
        The probability of each kept, unpinned vertex to try a move.
    neighbours : (indptr, indices) or None
        CSR one-rings, or None for the positions before and after on the vector.
    rng : numpy.random.Generator
        Source of randomness.
    """
    n_vertices = X.shape[1]
    # Every gene of the block is drawn with the rate; those that are not a kept, free-to-move vertex drop out.
    row, vertex = np.divmod(bernoulli_positions(X.size, rate, rng), n_vertices)
    movable = X[row, vertex] & ~pinned[vertex]
    if not movable.any():
        return
    row, vertex = row[movable], vertex[movable]
    target = drawn_targets(vertex, n_vertices, neighbours, rng)
    free = ~(X[row, target] | pinned[target])
    row, vertex, target = row[free], vertex[free], target[free]
    if len(row) > 1:
        first = np.unique(row * n_vertices + target, return_index=True)[1]
        row, vertex, target = row[first], vertex[first], target[first]
    X[row, vertex] = False
    X[row, target] = True


def shift_drawn(kept: NDArray[np.bool_], vertex: NDArray[np.int64], target: NDArray[np.int64]) -> None:
    """Make the moves that `NeighbourShift.draw` has drawn for a solution (N,), in place, by the rules of the class."""
    possible = kept[vertex] & ~kept[target]
    if possible.any():
        # the first to choose a position gets it
        target, first = np.unique(target[possible], return_index=True)
        kept[vertex[possible][first]] = False
        kept[target] = True


def drawn_targets(
    vertex: NDArray[np.int64],
    n_vertices: int,
    neighbours: tuple[NDArray[np.integer], NDArray[np.integer]] | None,
    rng: np.random.Generator,
) -> NDArray[np.int64]:
    """Draw a neighbour of each vertex, (k,), uniformly; a vertex without any gets itself."""
    if neighbours is None:
        target = vertex + np.where(rng.random(len(vertex)) < 0.5, -1, 1)
        target[target < 0] = 1
        target[target == n_vertices] = n_vertices - 2
        return target
    indptr, indices = neighbours
    degree = indptr[vertex + 1] - indptr[vertex]
    chosen = (rng.random(len(vertex)) * degree).astype(np.int64)
    target, connected = vertex.copy(), degree > 0
    target[connected] = indices[indptr[vertex[connected]] + chosen[connected]]
    return target


def bernoulli_positions(n: int, rate: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return the positions of the successes among ``n`` independent trials, ascending.

    Draws the gaps between successes (geometric), hence time and memory of the order of the successes, not of
    ``n``.

    Parameters
    ----------
    n : int
        Number of trials.
    rate : float
        Probability of success of each.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (k,) int array
        Positions in 0 ... n - 1, k being binomially distributed.

    Examples
    --------
    >>> bernoulli_positions(5, 1.0, np.random.default_rng(0)).tolist()
    [0, 1, 2, 3, 4]
    """
    if rate <= 0.0:
        return np.empty(0, dtype=np.int64)
    expected = n * rate
    size = int(expected + 4.0 * np.sqrt(expected)) + 8
    parts: list[NDArray[np.int64]] = []
    last = -1
    while last < n:
        # A gap beyond the end ends the draw; cut it, or very small rates would overflow the sum.
        gaps = np.minimum(rng.geometric(rate, size=size), n + 1)
        parts.append(last + np.cumsum(gaps))
        last = int(parts[-1][-1])
    positions = parts[0] if len(parts) == 1 else np.concatenate(parts)
    return positions[: np.searchsorted(positions, n)]
