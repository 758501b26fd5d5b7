"""Segments in the plane: what of them lies in faces, which points lie on them, which of them meet, and what they pass.

All candidates come from trees of boxes (`plane.nearest`). What is exact is asked of the exact predicates, so points
have coordinates that are multiples of 2**-52 in [0, 1].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.hilbert import hilbert_keys
from meshsimp_pymoo.plane.nearest import DEEPEST, boxes_of_runs, next_leaf
from meshsimp_pymoo.plane.predicates import orient_sign

# Things in one leaf of a tree.
LEAF = 4


def _along_the_curve(corners: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return things with k corners each (n, k, 2) in the order of their middles, and the boxes of a tree over them."""
    order = np.argsort(hilbert_keys(np.ascontiguousarray(corners.mean(axis=1))), kind="stable")
    return order, boxes_of_runs(corners[order].reshape(-1, 2), LEAF * corners.shape[1])


def _found(fill: Callable[[IntArray], int], guess: int) -> IntArray:
    """Return the rows (n, 2) that ``fill`` writes and counts, whatever their number."""
    rows = np.empty((guess, 2), np.int64)
    n = fill(rows)
    if n > guess:
        rows = np.empty((n, 2), np.int64)
        fill(rows)
    return rows[:n]


# ------------------------------------------------------------------------------------------------------------- in faces


@inner
def _clip(segment: np.ndarray, face: np.ndarray, reach: float) -> tuple[float, float]:
    """Return from where to where a segment (4,) lies in a face (6,) or as near to it as ``reach``; 1, 0 if nowhere.

    Where it passes through a side properly, the crossing itself counts. Faces lower than ``reach`` hold nothing.
    """
    area = (face[2] - face[0]) * (face[5] - face[1]) - (face[3] - face[1]) * (face[4] - face[0])
    turn = 1.0 if area > 0.0 else -1.0
    low = 0.0
    high = 1.0
    for k in range(3):
        px = face[2 * k]
        py = face[2 * k + 1]
        ux = face[(2 * k + 2) % 6] - px
        uy = face[(2 * k + 3) % 6] - py
        length = np.sqrt(ux * ux + uy * uy)
        if abs(area) <= reach * length:
            return 1.0, 0.0
        f0 = turn * (ux * (segment[1] - py) - uy * (segment[0] - px)) / length
        f1 = turn * (ux * (segment[3] - py) - uy * (segment[2] - px)) / length
        if f0 < -reach and f1 < -reach:
            return 1.0, 0.0
        if f0 < -reach:
            low = max(low, (f0 if f1 >= 0.0 else f0 + reach) / (f0 - f1))
        elif f1 < -reach:
            high = min(high, (f0 if f0 >= 0.0 else f0 + reach) / (f0 - f1))
    return low, high


@entry
def _in_faces(
    segments: np.ndarray, faces: np.ndarray, boxes: np.ndarray, reach: float, pairs: np.ndarray, spans: np.ndarray
) -> int:
    """List which segments (S, 4) lie in which faces (F, 6), from where to where; return how many pairs there are."""
    stack = np.empty(DEEPEST, np.int64)
    n = 0
    for s in range(len(segments)):
        ax, ay, bx, by = segments[s, 0], segments[s, 1], segments[s, 2], segments[s, 3]
        stack[0] = 1
        leaf, depth = next_leaf(boxes, stack, 1, ax, ay, bx, by, reach)
        while leaf >= 0:
            first = leaf * LEAF
            for f in range(first, min(first + LEAF, len(faces))):
                low, high = _clip(segments[s], faces[f], reach)
                if low <= high:
                    if n < len(pairs):
                        pairs[n, 0] = s
                        pairs[n, 1] = f
                        spans[n, 0] = low
                        spans[n, 1] = high
                    n += 1
            leaf, depth = next_leaf(boxes, stack, depth, ax, ay, bx, by, reach)
    return n


@entry
def _sweep(
    starts: np.ndarray,
    spans: np.ndarray,
    heights: np.ndarray,
    close: np.ndarray,
    segment: np.ndarray,
    at: np.ndarray,
    height: np.ndarray,
    goes_on: np.ndarray,
) -> int:
    """Go along each segment over the faces that hold it, ``spans`` (P, 2) ascending; return the number of stops."""
    n = 0
    for s in range(len(starts) - 1):
        first, end = starts[s], starts[s + 1]
        stops = np.sort(spans[first:end].ravel())
        active = np.empty(end - first, np.int64)
        n_active = 0
        p = first
        last = -np.inf
        for k in range(len(stops)):
            t = stops[k]
            if t - last <= close[s]:
                continue
            last = t
            while p < end and spans[p, 0] <= t + close[s]:
                active[n_active] = p
                n_active += 1
                p += 1
            m = 0
            z = -np.inf
            reaches = -np.inf
            for q in range(n_active):
                i = active[q]
                low, high = spans[i, 0], spans[i, 1]
                if high < t - close[s]:
                    continue
                active[m] = i
                m += 1
                share = min(max((t - low) / (high - low), 0.0), 1.0) if high > low else 0.0
                z = max(z, (1.0 - share) * heights[i, 0] + share * heights[i, 1])
                reaches = max(reaches, high)
            n_active = m
            segment[n] = s
            at[n] = t
            height[n] = z
            goes_on[n] = reaches > t + close[s]
            n += 1
    return n


def along_faces(
    segments: FloatArray, xy: FloatArray, z: FloatArray, faces: IntArray, reach: float
) -> tuple[IntArray, FloatArray, FloatArray, BoolArray]:
    """Go along segments and say where they enter, cross and leave the projection of faces, and how high these are.

    Parameters
    ----------
    segments : (S, 4) float array
        x and y of both ends, which are more than ``reach`` apart.
    xy, z : (N, 2) and (N,) float arrays
        Vertices of the faces, and their heights.
    faces : (T, 3) int array
    reach : float
        What is so near to a face lies in it; faces lower than that are none. Stops so near to each other are one.

    Returns
    -------
    segment : (M,) int array
        Of each stop, ascending.
    at : (M,) float array
        Where on the segment it is, ascending from 0 to 1.
    height : (M,) float array
        Of the highest face there.
    goes_on : (M,) bool array
        Whether faces hold the segment from here to the next stop.

    Examples
    --------
    >>> xy, z = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), np.array([0.0, 1, 1, 1])
    >>> segment = np.array([[0.25, 0.5, 2.0, 0.5]])
    >>> stops = along_faces(segment, xy, z, np.array([[0, 1, 2], [0, 2, 3]]), 1e-9)
    >>> [values.round(3).tolist() for values in stops[1:3]], stops[3].tolist()
    ([[0.0, 0.143, 0.429], [0.5, 0.5, 1.0]], [True, True, False])
    """
    corners = xy[faces]
    order, boxes = _along_the_curve(corners)
    flat = np.ascontiguousarray(corners[order].reshape(-1, 6))
    segments = np.ascontiguousarray(segments)
    spans = np.empty((0, 2))

    def fill(rows: IntArray) -> int:
        nonlocal spans
        spans = np.empty((len(rows), 2))
        return _in_faces(segments, flat, boxes, reach, rows, spans)

    pairs = _found(fill, 8 * len(segments) + 64)
    spans = spans[: len(pairs)]
    sorting = np.lexsort((spans[:, 1], spans[:, 0], pairs[:, 0]))
    pairs, spans = pairs[sorting], spans[sorting]
    held = faces[order[pairs[:, 1]]]
    ends = segments[pairs[:, 0]]
    heights = np.column_stack(
        [_height_in(xy[held], z[held], ends[:, :2] + (ends[:, 2:] - ends[:, :2]) * t[:, None]) for t in spans.T]
    )
    starts = np.searchsorted(pairs[:, 0], np.arange(len(segments) + 1))
    # the ends of a segment are two stops, however short it is
    close = np.minimum(2.0 * reach / np.hypot(*(segments[:, 2:] - segments[:, :2]).T), 0.25)
    most = 2 * len(pairs)
    segment, at, height = np.empty(most, np.int64), np.empty(most), np.empty(most)
    goes_on = np.empty(most, np.bool_)
    n = _sweep(starts, spans, heights, close, segment, at, height, goes_on)
    segment, at = segment[:n], at[:n]
    at = np.where(at <= close[segment], 0.0, np.where(at >= 1.0 - close[segment], 1.0, at))
    return segment, at, height[:n], goes_on[:n]


def _height_in(corners: FloatArray, z: FloatArray, places: FloatArray) -> FloatArray:
    """Return the heights of triangles (n, 3, 2) with these heights (n, 3) at places (n, 2) in them."""
    a, b, c = (corners[:, k] for k in range(3))
    (ux, uy), (vx, vy), (px, py) = (b - a).T, (c - a).T, (places - a).T
    area = ux * vy - uy * vx
    shares = np.column_stack([np.zeros(len(z)), (px * vy - py * vx) / area, (ux * py - uy * px) / area])
    shares[:, 0] = 1.0 - shares[:, 1] - shares[:, 2]
    shares = np.clip(shares, 0.0, 1.0)
    return np.asarray((shares * z).sum(axis=1) / shares.sum(axis=1))


# ----------------------------------------------------------------------------------------------------- points, segments


@entry
def _near(xy: np.ndarray, ends: np.ndarray, boxes: np.ndarray, reach: float, pairs: np.ndarray) -> int:
    stack = np.empty(DEEPEST, np.int64)
    n = 0
    for i in range(len(xy)):
        x = xy[i, 0]
        y = xy[i, 1]
        stack[0] = 1
        leaf, depth = next_leaf(boxes, stack, 1, x, y, x, y, reach)
        while leaf >= 0:
            first = leaf * LEAF
            for s in range(first, min(first + LEAF, len(ends))):
                a, b = ends[s, 0], ends[s, 1]
                if i == a or i == b:
                    continue
                ux = xy[b, 0] - xy[a, 0]
                uy = xy[b, 1] - xy[a, 1]
                length = ux * ux + uy * uy
                t = ((x - xy[a, 0]) * ux + (y - xy[a, 1]) * uy) / length
                if t <= 0.0 or t >= 1.0:
                    continue
                away = (x - xy[a, 0]) * uy - (y - xy[a, 1]) * ux
                if away * away <= reach * reach * length:
                    if n < len(pairs):
                        pairs[n, 0] = i
                        pairs[n, 1] = s
                    n += 1
            leaf, depth = next_leaf(boxes, stack, depth, x, y, x, y, reach)
    return n


def points_on(xy: FloatArray, ends: IntArray, reach: float) -> IntArray:
    """Return which points (N, 2) lie inside which segments (S, 2) between two of them, or as near as ``reach``: (M, 2).

    Examples
    --------
    >>> points_on(np.array([[0.0, 0], [1, 0], [0.5, 0], [0.5, 0.5]]), np.array([[0, 1]]), 1e-9).tolist()
    [[2, 0]]
    """
    order, boxes = _along_the_curve(xy[ends])
    flat = np.ascontiguousarray(ends[order])
    pairs = _found(lambda rows: _near(np.ascontiguousarray(xy), flat, boxes, reach, rows), 64)
    return np.column_stack([pairs[:, 0], order[pairs[:, 1]]])


@inner
def _turn(xy: np.ndarray, a: int, b: int, p: int) -> int:
    """On which side of the line from a to b p lies: 1 left, -1 right, 0 on it."""
    x = xy[p, 0]
    y = xy[p, 1]
    return orient_sign(xy[a, 0] - x, xy[a, 1] - y, xy[b, 0] - x, xy[b, 1] - y, 0.0)


@inner
def _is_between(xy: np.ndarray, a: int, b: int, p: int) -> bool:
    """Whether p, on the line through a and b, lies between them."""
    x, y = xy[p, 0], xy[p, 1]
    within_x = min(xy[a, 0], xy[b, 0]) <= x <= max(xy[a, 0], xy[b, 0])
    return within_x and min(xy[a, 1], xy[b, 1]) <= y <= max(xy[a, 1], xy[b, 1])


@inner
def _meet(xy: np.ndarray, a: int, b: int, c: int, d: int) -> bool:
    """Whether two segments have more in common than an end of both."""
    if c == b or d == b:
        a, b = b, a
    if d == a:
        c, d = d, c
    if a == c:
        if b == d:
            return True
        return _turn(xy, a, b, d) == 0 and (_is_between(xy, a, b, d) or _is_between(xy, a, d, b))
    of_c, of_d = _turn(xy, a, b, c), _turn(xy, a, b, d)
    if (of_c == 0 and _is_between(xy, a, b, c)) or (of_d == 0 and _is_between(xy, a, b, d)):
        return True
    of_a, of_b = _turn(xy, c, d, a), _turn(xy, c, d, b)
    if (of_a == 0 and _is_between(xy, c, d, a)) or (of_b == 0 and _is_between(xy, c, d, b)):
        return True
    return of_c * of_d < 0 and of_a * of_b < 0


@entry
def _meeting(xy: np.ndarray, ends: np.ndarray, boxes: np.ndarray, pairs: np.ndarray) -> int:
    stack = np.empty(DEEPEST, np.int64)
    n = 0
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        stack[0] = 1
        leaf, depth = next_leaf(boxes, stack, 1, xy[a, 0], xy[a, 1], xy[b, 0], xy[b, 1], 0.0)
        while leaf >= 0:
            first = leaf * LEAF
            for j in range(max(first, i + 1), min(first + LEAF, len(ends))):
                if _meet(xy, a, b, ends[j, 0], ends[j, 1]):
                    if n < len(pairs):
                        pairs[n, 0] = i
                        pairs[n, 1] = j
                    n += 1
            leaf, depth = next_leaf(boxes, stack, depth, xy[a, 0], xy[a, 1], xy[b, 0], xy[b, 1], 0.0)
    return n


def meeting_segments(xy: FloatArray, ends: IntArray) -> IntArray:
    """Return the pairs of segments (S, 2) between points (N, 2) that have more in common than an end of both: (M, 2).

    They cross, overlap, are the same, or an end of one lies inside the other; the answer is exact. The points are at
    different places. The lesser segment comes first; sorted.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    >>> meeting_segments(square, np.array([[0, 2], [0, 1], [1, 3]])).tolist()
    [[0, 2]]
    """
    if len(ends) < 2:
        return np.empty((0, 2), np.int64)
    order, boxes = _along_the_curve(xy[ends])
    flat = np.ascontiguousarray(ends[order])
    found = order[_found(lambda rows: _meeting(np.ascontiguousarray(xy), flat, boxes, rows), 64)]
    found.sort(axis=1)
    return found[np.lexsort((found[:, 1], found[:, 0]))]


@entry
def _enclosed(
    xy: np.ndarray,
    points: np.ndarray,
    starts: np.ndarray,
    around: np.ndarray,
    boxes: np.ndarray,
    pairs: np.ndarray,
) -> int:
    stack = np.empty(DEEPEST, np.int64)
    n = 0
    for q in range(len(points)):
        p = points[q]
        x = xy[p, 0]
        y = xy[p, 1]
        stack[0] = 1
        leaf, depth = next_leaf(boxes, stack, 1, x, y, x, y, 0.0)
        while leaf >= 0:
            first = leaf * LEAF
            for k in range(first, min(first + LEAF, len(starts) - 1)):
                is_inside = False
                last = around[starts[k + 1] - 1]
                for m in range(starts[k], starts[k + 1]):
                    here = around[m]
                    if here == p:
                        is_inside = False
                        break
                    if (xy[last, 1] > y) != (xy[here, 1] > y):
                        upward = xy[here, 1] > xy[last, 1]
                        turn = _turn(xy, last, here, p)
                        is_inside ^= turn > 0 if upward else turn < 0
                    last = here
                if is_inside:
                    if n < len(pairs):
                        pairs[n, 0] = p
                        pairs[n, 1] = k
                    n += 1
            leaf, depth = next_leaf(boxes, stack, depth, x, y, x, y, 0.0)
    return n


def enclosed_points(xy: FloatArray, points: IntArray, rings: list[IntArray]) -> IntArray:
    """Return which of some points lie inside which rings of others, by parity: (M, 2) of points and rings.

    Parameters
    ----------
    xy : (N, 2) float array
    points : (K,) int array
        Rows of those that are asked about.
    rings : list of (n,) int arrays
        Polygons as rows; a point that is a corner of one is not inside.

    Examples
    --------
    >>> xy = np.array([[0.0, 0], [1, 0], [1, 1], [0.75, 0.25]])
    >>> enclosed_points(xy, np.array([0, 3]), [np.array([0, 1, 2])]).tolist()
    [[3, 0]]
    """
    if not rings or len(points) == 0:
        return np.empty((0, 2), np.int64)
    lengths = [len(ring) for ring in rings]
    first = np.cumsum([0, *lengths[:-1]])
    places = xy[np.concatenate(rings)]
    lows, highs = (extreme.reduceat(places, first) for extreme in (np.minimum, np.maximum))
    order, boxes = _along_the_curve(np.stack([lows, highs], axis=1))
    sizes: Any = np.array(lengths)[order]
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    around = np.concatenate([rings[k] for k in order]).astype(np.int64)
    whole, asked = np.ascontiguousarray(xy), np.ascontiguousarray(points, np.int64)
    pairs = _found(lambda rows: _enclosed(whole, asked, starts, around, boxes, rows), 64)
    return np.column_stack([pairs[:, 0], order[pairs[:, 1]]])
