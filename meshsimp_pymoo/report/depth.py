"""What is seen of triangles in space: for every pixel the one that is nearest to the viewer, and where on it.

Drawing back to front cannot tell which of two triangles of a body hides the other one where both reach far; a depth
for every pixel can. It needs no graphics hardware and no display.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray, IntArray

# Rows of pixels of triangles that are looked at together: what bounds the memory.
MOST_ROWS = 1_000_000


class Seen(NamedTuple):
    """A picture's pixels, row 0 the lowest.

    Attributes
    ----------
    triangle : (height, width) int array
        The nearest triangle at the middle of each pixel, -1 where there is none.
    shares : (height, width, 3) float array
        What each corner of it counts there, 1 together; 0 where there is none.
    """

    triangle: IntArray
    shares: FloatArray


def seen(corners: FloatArray, width: int, height: int) -> Seen:
    """Return which of some triangles is seen at each pixel, whichever side it shows.

    Parameters
    ----------
    corners : (M, 3, 3) float array
        x to the right and y up, both in pixels from the lower left corner of the picture, z to the viewer. Triangles
        seen along their plane are not seen.
    width, height : int
        Of the picture [pixels].

    Examples
    --------
    A small triangle in front of a large one:

    >>> large, small = [[0, 0, 0], [8, 0, 0], [0, 8, 0]], [[0, 0, 1], [4, 0, 1], [0, 4, 1]]
    >>> seen(np.array([large, small], float), 4, 2).triangle.tolist()
    [[1, 1, 1, 1], [1, 1, 1, 0]]
    """
    corners = np.asarray(corners, float)
    depth = np.full(width * height, -np.inf)
    triangle = np.full(width * height, -1)
    planes, is_solid = _planes(corners[:, :, :2])
    low, high = corners[:, :, 1].min(axis=1), corners[:, :, 1].max(axis=1)
    first = np.clip(np.ceil(low - 0.5), 0, height).astype(np.int64)
    n_rows = np.where(is_solid, np.clip(np.floor(high - 0.5) + 1, 0, height).astype(np.int64) - first, 0)
    n_rows = np.maximum(n_rows, 0)
    ends = np.cumsum(n_rows)
    begin = 0
    while begin < len(corners):
        done = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, done + MOST_ROWS, side="right")))
        at, y = _runs(first[begin:end], n_rows[begin:end])
        at += begin
        start, stop = _span(planes[at], y + 0.5, width)
        which, x = _runs(start, np.maximum(stop - start, 0))
        at, pixel = at[which], y[which] * width + x
        z = (_shares(planes[at], x + 0.5, y[which] + 0.5) * corners[at, :, 2]).sum(axis=1)
        np.maximum.at(depth, pixel, z)
        nearest = z == depth[pixel]
        triangle[pixel[nearest]] = at[nearest]
        begin = end
    shares = np.zeros((width * height, 3))
    hit = np.flatnonzero(triangle >= 0)
    shares[hit] = _shares(planes[triangle[hit]], hit % width + 0.5, hit // width + 0.5)
    return Seen(triangle.reshape(height, width), shares.reshape(height, width, 3))


def _planes(corners: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (a, b, c) for each corner (M, 3, 2), whose share is a x + b y + c, and whether there is an area (M,)."""
    following, last = corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]
    a, b = following[:, :, 1] - last[:, :, 1], last[:, :, 0] - following[:, :, 0]
    c = -(a * last[:, :, 0] + b * last[:, :, 1])
    area = (corners[:, 0] * np.stack([a[:, 0], b[:, 0]], axis=1)).sum(axis=1) + c[:, 0]
    is_solid = area != 0.0
    return np.stack([a, b, c], axis=2) / np.where(is_solid, area, 1.0)[:, None, None], is_solid


def _shares(planes: FloatArray, x: AnyArray, y: AnyArray) -> FloatArray:
    """Return the shares (K, 3) of the corners of triangles (K, 3, 3) at points."""
    return planes[:, :, 0] * x[:, None] + planes[:, :, 1] * y[:, None] + planes[:, :, 2]


def _span(planes: FloatArray, y: AnyArray, width: int) -> tuple[IntArray, IntArray]:
    """Return the first pixel of a row whose middle is in a triangle (K, 3, 3), and the one after the last."""
    slope, rest = planes[:, :, 0], planes[:, :, 1] * y[:, None] + planes[:, :, 2]
    zero = -rest / np.where(slope == 0.0, 1.0, slope)
    low = np.where(slope > 0.0, zero, -np.inf).max(axis=1)
    high = np.where(slope < 0.0, zero, np.inf).min(axis=1)
    high[((slope == 0.0) & (rest < 0.0)).any(axis=1)] = -np.inf
    start = np.clip(np.ceil(low - 0.5), 0, width).astype(np.int64)
    stop = np.clip(np.floor(high - 0.5) + 1, 0, width).astype(np.int64)
    return start, stop


def _runs(start: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Return for each number of the runs start, start + 1, ... which run it is of, and the number.

    >>> [part.tolist() for part in _runs(np.array([5, 0, 7]), np.array([2, 0, 1]))]
    [[0, 0, 2], [5, 6, 7]]
    """
    which = np.repeat(np.arange(len(start)), count)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(start, count)
