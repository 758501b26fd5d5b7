"""The paper's first population: random subsets of every size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.sampling import Sampling

from meshsimp_pymoo.search.requirements import pinned_vertices


class RandomSubset(Sampling):
    """Random subsets of every size: the first population of the paper.

    Each individual draws its own size, uniformly from the number of pinned vertices to N (both included),
    then a subset of that size, uniformly among those that hold all pinned vertices. The population therefore
    spreads over the whole range of triangle counts from the start; independent coin flips would put all of it
    at N / 2.

    Raises
    ------
    TypeError
        When sampling for a problem without ``pinned``.
    """

    def _do(
        self, problem: Any, n_samples: int, *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        pinned = pinned_vertices(problem, self)
        free = np.flatnonzero(~pinned)
        sizes = random_state.integers(0, len(free), size=n_samples, endpoint=True)
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
