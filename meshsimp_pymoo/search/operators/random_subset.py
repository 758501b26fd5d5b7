"""The paper's first population: random subsets, of every size or of a given one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.sampling import Sampling

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.search.requirements import pinned_vertices

# A number of kept vertices, or a share of all of them.
Size = int | float

WAY_OUT = "give a whole number of kept vertices, a share of all in (0, 1], or a pair of them [low, high]"


class RandomSubset(Sampling):
    """Random subsets, the first population of the paper: of every size, of one size or of sizes within bounds.

    Each individual draws its own size, then a subset of that size, uniformly among those that hold all pinned
    vertices. "Randomly locating n points to each individual" (Sec. 3.6) leaves open whether n is the same for all,
    and the paper prints no n:

    * by default sizes are uniform from the number of pinned vertices to N (both included). The population then
      spreads over the whole range of triangle counts from the start; independent coin flips would put all of it
      at N / 2;
    * with ``size`` they are what is said. Fronts as narrow as those that the paper prints come from one n for all,
      near N / 5: ``RandomSubset(size=0.2)``.

    Parameters
    ----------
    size : int, float or pair of them, optional
        Kept vertices, the pinned ones included. A whole number: as many. A float in (0, 1]: that share of N, rounded
        to the nearest whole number (halves to the even one), so that 1 is one vertex and 1.0 all of them. A pair (low,
        high): uniform between, both included, each a number or a share.

    Raises
    ------
    ValueError
        If ``size`` is no such number; when sampling, if it is below the number of pinned vertices or above N.
    TypeError
        When sampling for a problem without ``pinned``.

    Examples
    --------
    >>> from meshsimp_pymoo import MeshProblem
    >>> problem = MeshProblem("roof:5")
    >>> RandomSubset(size=0.4)(problem, 3, random_state=np.random.default_rng(1)).get("X").sum(axis=1).tolist()
    [10, 10, 10]
    """

    def __init__(self, size: Size | Sequence[Size] | None = None) -> None:
        """Say how many vertices the subsets keep."""
        super().__init__()
        self.size = _checked(size)

    __repr__ = as_made

    def _do(
        self, problem: Any, n_samples: int, *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        pinned = pinned_vertices(problem, self)
        free = np.flatnonzero(~pinned)
        low, high = self._bounds(len(pinned), len(pinned) - len(free))
        # the pinned ones are in any case there
        sizes = random_state.integers(low, high, size=n_samples, endpoint=True)
        X = np.empty((n_samples, len(pinned)), dtype=bool)
        for kept, size in zip(X, sizes, strict=True):
            # Draw whichever of the two sides is smaller: kept or dropped vertices.
            draw_dropped = 2 * size > len(free)
            n_drawn = len(free) - size if draw_dropped else size
            drawn = free[random_state.choice(len(free), n_drawn, replace=False, shuffle=False)]
            kept[:] = draw_dropped
            kept[drawn] = not draw_dropped
            kept[pinned] = True
        return X

    def _bounds(self, n_vertices: int, n_pinned: int) -> tuple[int, int]:
        """Return the least and the most vertices to keep beside the pinned ones."""
        if self.size is None:
            return 0, n_vertices - n_pinned
        ends = self.size if isinstance(self.size, list) else [self.size] * 2
        low, high = (round(end * n_vertices) if isinstance(end, float) else end for end in ends)
        for end in (low, high):
            if not n_pinned <= end <= n_vertices:
                raise ValueError(
                    f"size={self.size} asks for {end} of {n_vertices} vertices, {n_pinned} of them pinned; "
                    f"give {n_pinned} to {n_vertices}, or a share that comes to as many"
                )
        if low > high:
            raise ValueError(
                f"size={self.size} is {low} to {high} of {n_vertices} vertices; give the smaller end first"
            )
        return low - n_pinned, high - n_pinned


def _checked(size: Any) -> Size | list[Size] | None:
    """Return what was given in plain numbers and lists, so that a configuration shows and stores it."""
    if size is None:
        return None
    if isinstance(size, Sequence) and not isinstance(size, str) and len(size) == 2:
        ends = [_end(end) for end in size]
        if None not in ends:
            # which of a number and a share is larger shows only where N is known
            if type(ends[0]) is type(ends[1]) and ends[0] > ends[1]:
                raise ValueError(f"size={ends} begins above its end; {WAY_OUT}")
            return ends
    elif (end := _end(size)) is not None:
        return end
    raise ValueError(f"size={size!r} is no size; {WAY_OUT}")


def _end(end: Any) -> Any:
    """Return a number of vertices as int, a share as float, and None for what is neither."""
    if isinstance(end, (int, np.integer)) and not isinstance(end, bool):
        return int(end) if end >= 1 else None
    return float(end) if isinstance(end, (float, np.floating)) and 0.0 < end <= 1.0 else None
