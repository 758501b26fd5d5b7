"""The unit square, and the order of vertices along the curve through it."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.plane.hilbert import hilbert_keys


def unit_square(points: FloatArray) -> tuple[float, FloatArray]:
    """Scale by a power of two into the unit square and round to multiples of 2**-52, so that differences are exact."""
    extent = float(np.ptp(points[:, :2], axis=0).max())
    unit = float(2.0 ** np.ceil(np.log2(extent)))
    xy = points[:, :2] / unit
    return unit, (xy + 1.0) - 1.0


def vector_order(xy: FloatArray, z: FloatArray) -> IntArray:
    """Return the order of vertices along a Hilbert curve, ties by x, y, z: a function of the positions alone.

    Parameters
    ----------
    xy : (N, 2) float array
        Coordinates in the unit square.
    z : (N,) float array
        Heights; decide between vertices at one (x, y).

    Returns
    -------
    (N,) int array
        Rows in vector order.

    References
    ----------
    D. Hilbert, "Ueber die stetige Abbildung einer Linie auf ein Flaechenstueck", Mathematische Annalen 38, 1891.
    """
    key = hilbert_keys(np.ascontiguousarray(xy, float))
    order = np.argsort(key, kind="stable")
    key = key[order]
    tied = np.zeros(len(key), bool)
    same = key[1:] == key[:-1]
    tied[1:] |= same
    tied[:-1] |= same
    if tied.any():
        rows = order[tied]
        order[tied] = rows[np.lexsort((z[rows], xy[rows, 1], xy[rows, 0], key[tied]))]
    return order


def find_corners(xy: FloatArray) -> IntArray:
    """Return the vertices extreme in the directions (+-1, +-1) after scaling the bounding box to a square, ascending.

    Of equally extreme vertices the one furthest clockwise counts, so that the four corners of a diamond are found too.
    If they all lie on one line, the vertex farthest from that line joins them: corners always span a triangle.

    Examples
    --------
    >>> find_corners(np.array([[0.0, 0], [0, 1], [0.5, 0.5], [1, 0], [1, 1]]))
    array([0, 1, 3, 4])
    """
    low = xy.min(axis=0)
    span = np.ptp(xy, axis=0)
    square = (xy - low) / np.where(span > 0, span, 1.0)
    x, y = square[:, 0], square[:, 1]
    chosen: set[int] = set()
    for sx, sy, second in ((1, 1, x), (-1, 1, y), (-1, -1, -x), (1, -1, -y)):
        score = sx * x + sy * y
        best = np.flatnonzero(score == score.max())
        best = best[second[best] == second[best].max()]
        chosen.add(int(best[0]))
    corners = np.array(sorted(chosen))
    base = xy[corners[0]]
    ends = xy[corners] - base
    far = ends[np.argmax((ends**2).sum(axis=1))]
    if np.all(far[0] * ends[:, 1] == far[1] * ends[:, 0]):
        away = np.abs(far[0] * (xy[:, 1] - base[1]) - far[1] * (xy[:, 0] - base[0]))
        corners = np.unique(np.append(corners, int(np.argmax(away))))
    return corners.astype(np.int64)
