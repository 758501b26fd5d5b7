"""Greedy insertion into a grid of heights by scanning: each new triangle is run over, row by row.

The same choice as :func:`~meshsimp_pymoo.search.greedy.greedy_insertion` by triangle makes: the worst sample of the
triangle with the largest sum of deviations comes next. But nothing is kept for the samples; only the triangles around
the vertex that came are looked at again [1]_, at a nanosecond a sample. So it takes a fraction of a microsecond for
each sample of the grid where a tenth of them is inserted, and some of a hundred for each vertex beside its triangle.
What a triangle costs is not exact: samples on an edge count on both sides of it.

References
----------
.. [1] M. Garland, P. S. Heckbert, "Fast polygonal approximation of terrains and height fields", CMU-CS-95-181, 1995.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD, TRIANGLE, insert, triangulate
from meshsimp_pymoo.search.heap import sift_down, sift_up
from meshsimp_pymoo.surface.surface import Surface

# Rows times columns, at most, for each vertex of a raster: so it has at most one gap for each.
MOST_CROSSINGS = 2


class Raster(NamedTuple):
    """Vertices at crossings of rows and columns.

    Attributes
    ----------
    x, y : (w,), (h,) float arrays
        Where the columns and rows are in the unit square: x ascending, y descending.
    heights : (h, w) float array
        Their heights [model units]; NaN where there is no vertex.
    vertex : (h * w,) int array
        The vertex at each crossing, -1: none.
    crossing : (N,) int array
        The crossing of each vertex, ``row * w + column``.
    """

    x: FloatArray
    y: FloatArray
    heights: FloatArray
    vertex: IntArray
    crossing: IntArray


def raster_of(surface: Surface) -> Raster | None:
    """Return the vertices of a height surface as a raster; None: they are none."""
    places = np.asarray(surface.places)
    if surface.view.is_closed:
        return None
    x, column = np.unique(places[:, 0], return_inverse=True)
    y, row = np.unique(places[:, 1], return_inverse=True)
    n = surface.n_vertices
    if len(x) * len(y) > MOST_CROSSINGS * n or min(len(x), len(y)) < 2:
        return None
    crossing = (len(y) - 1 - row) * len(x) + column
    vertex = np.full(len(x) * len(y), -1, np.int64)
    vertex[crossing] = np.arange(n)
    if np.count_nonzero(vertex >= 0) < n:  # several at one place
        return None
    heights = np.full(len(vertex), np.nan)
    heights[crossing] = np.asarray(surface.points)[:, 2]
    return Raster(x, y[::-1].copy(), heights.reshape(len(y), len(x)), vertex, crossing)


def raster_insertion(
    x: FloatArray,
    y: FloatArray,
    heights: FloatArray,
    first: IntArray,
    most: int,
    *,
    stop: BoolArray | None = None,
) -> IntArray:
    """Insert the worst samples of a grid one by one.

    Parameters
    ----------
    x, y : (w,), (h,) float arrays
        Where the columns and rows are in the unit square: x ascending, y descending.
    heights : (h, w) float array
        Their heights [model units]; what is no number is no sample.
    first : (m,) int array
        Samples, ``row * w + column``, to begin with, best along a curve; they span a triangle, and what lies outside
        their hull is not looked at.
    most : int
        How many samples there may be in the end, these included.
    stop : (1,) bool array, optional
        Another thread that sets it ends the insertion soon after, with the samples so far.

    Returns
    -------
    (n,) int array
        The first samples and those inserted, in this order; fewer than ``most`` where nothing deviates any more.

    Raises
    ------
    ValueError
        If the first samples lie on one line.
    """
    samples = np.empty(max(most, len(first)), np.int64)
    samples[: len(first)] = first
    ranges = exact_ranges(np.concatenate([x, y])[:, None])
    n = _insert_worst(
        np.ascontiguousarray(x), np.ascontiguousarray(y), np.ascontiguousarray(heights, np.float64), samples,
        len(first), *ranges, np.zeros(1, np.bool_) if stop is None else stop,
    )  # fmt: skip
    if n == 0:
        raise ValueError(f"the {len(first)} samples to begin with lie on one line; begin with some that do not")
    return samples[:n]


@inner
def _scan(
    x: np.ndarray,
    y: np.ndarray,
    heights: np.ndarray,
    per_column: float,
    samples: np.ndarray,
    a: int,
    b: int,
    c: int,
) -> tuple[int, float]:
    """Return the worst sample of a triangle, and the sum of the deviations in it; -1 where nothing deviates."""
    w = heights.shape[1]
    # from north to south
    if samples[b] < samples[a]:
        a, b = b, a
    if samples[c] < samples[a]:
        a, c = c, a
    if samples[c] < samples[b]:
        b, c = c, b
    ra, rb, rc = samples[a] // w, samples[b] // w, samples[c] // w
    ca, cb, cc = samples[a] - ra * w, samples[b] - rb * w, samples[c] - rc * w
    ax, ay, az = x[ca], y[ra], heights[ra, ca]
    bx, by, bz = x[cb] - ax, y[rb] - ay, heights[rb, cb] - az
    cx, cy, cz = x[cc] - ax, y[rc] - ay, heights[rc, cc] - az
    area = bx * cy - cx * by
    to_x = (bz * cy - cz * by) / area
    to_y = (cz * bx - bz * cx) / area
    best = np.int64(-1)
    worst = 0.0
    total = 0.0
    for r in range(ra, rc + 1):
        py = y[r] - ay
        # where the long side is, and the short one of this row
        one = ax + (cx * (py / cy) if cy != 0.0 else cx)
        if r < rb:
            other = ax + bx * (py / by)
        elif rc > rb:
            other = ax + bx + (cx - bx) * ((py - by) / (cy - by))
        else:
            other = ax + bx
            if ra == rb:  # in one row, which no triangle of the mesh is
                one = ax
        left = min(one, other)
        right = max(one, other)
        column = min(max(np.int64((left - x[0]) * per_column), 0), w - 1)
        while column > 0 and x[column - 1] >= left:
            column -= 1
        while column < w and x[column] < left:
            column += 1
        height = az + to_y * py - to_x * ax
        row = heights[r]
        while column < w and x[column] <= right:
            d = abs(height + to_x * x[column] - row[column])
            if d > 0.0:
                total += d
                if d > worst:
                    worst = d
                    best = r * w + column
            column += 1
    return best, total


@entry
def _insert_worst(
    x: np.ndarray,
    y: np.ndarray,
    heights: np.ndarray,
    samples: np.ndarray,
    n: int,
    exact_area: float,
    exact_lift: float,
    stop: np.ndarray,
) -> int:
    """Insert samples after the first n until ``samples`` is full or nothing deviates; return how many there are."""
    h, w = heights.shape
    most = len(samples)
    xy = np.empty(2 * most)
    is_vertex = np.zeros(h * w, np.bool_)
    for k in range(n):
        r = samples[k] // w
        xy[2 * k] = x[samples[k] - r * w]
        xy[2 * k + 1] = y[r]
        is_vertex[samples[k]] = True
    mesh = np.empty(2 * RECORD * most, np.uint32)
    none = np.empty(0, np.int64)
    end = triangulate(xy, n, none, none, np.empty(most, np.uint8), mesh, exact_area, exact_lift)
    if end == 0:
        return 0
    per_column = (w - 1) / (x[w - 1] - x[0]) if w > 1 else 0.0
    key = np.zeros(4 * most)  # minus the sum of a triangle, and 0
    best = np.empty(2 * most, np.int64)
    heap = np.empty(2 * most, np.int32)
    at = np.full(2 * most, -1, np.int32)
    n_heap = 0
    for t in range(0, end, RECORD):
        n_heap = _weigh(x, y, heights, per_column, samples, is_vertex, mesh, t, key, best, heap, at, n_heap)
    while n < most and n_heap > 0 and key[2 * heap[0]] < 0.0 and not stop[0]:
        v = best[heap[0]]
        start = np.int64(heap[0]) * RECORD
        r = v // w
        samples[n] = v
        xy[2 * n] = x[v - r * w]
        xy[2 * n + 1] = y[r]
        is_vertex[v] = True
        t = first = np.int64(insert(xy, mesh, end, start, n, exact_area, exact_lift))
        end += 2 * RECORD
        n += 1
        # all triangles that are new have it for their third vertex
        while True:
            n_heap = _weigh(x, y, heights, per_column, samples, is_vertex, mesh, t, key, best, heap, at, n_heap)
            t = np.int64(mesh[t + 5]) & TRIANGLE
            if t == first:
                break
    return n


@inner
def _weigh(
    x: np.ndarray,
    y: np.ndarray,
    heights: np.ndarray,
    per_column: float,
    samples: np.ndarray,
    is_vertex: np.ndarray,
    mesh: np.ndarray,
    t: int,
    key: np.ndarray,
    best: np.ndarray,
    heap: np.ndarray,
    at: np.ndarray,
    n_heap: int,
) -> int:
    """Scan a triangle and put it where it belongs in the heap; return how many are in that."""
    k = t // RECORD
    a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
    total = 0.0
    if (a | b | c) <= LAST_INDEX:
        best[k], total = _scan(x, y, heights, per_column, samples, np.int64(a), np.int64(b), np.int64(c))
        if best[k] < 0 or is_vertex[best[k]]:  # what deviates is rounding
            total = 0.0
    key[2 * k] = -total
    if at[k] < 0:
        if total == 0.0:
            return n_heap
        heap[n_heap] = k
        at[k] = n_heap
        n_heap += 1
    sift_up(heap, at, key, at[k])
    sift_down(heap, at, key, at[k], n_heap)
    return n_heap
