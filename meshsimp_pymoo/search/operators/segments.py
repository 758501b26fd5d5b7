"""Runs of the vector, which are patches in space: where it is cut, and new vectors put together of two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def random_cuts(n_vertices: int, n_segments: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Cut 0 ... n_vertices into non-empty runs at places drawn uniformly without replacement.

    Returns
    -------
    (n_segments + 1,) int array
        Segment j is ``cuts[j]`` up to, not including, ``cuts[j + 1]``.
    """
    inner = 1 + rng.choice(n_vertices - 1, n_segments - 1, replace=False, shuffle=False)
    return np.concatenate([[0], np.sort(inner), [n_vertices]])


def combine(
    first: NDArray[np.bool_], second: NDArray[np.bool_], cuts: NDArray[np.integer], levels: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Take the segments with level True from the second parent, the others from the first."""
    combined = first.copy()
    for j in np.flatnonzero(levels):
        combined[cuts[j] : cuts[j + 1]] = second[cuts[j] : cuts[j + 1]]
    return combined
