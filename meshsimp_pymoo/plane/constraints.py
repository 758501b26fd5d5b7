"""Edges that every triangulation has: the constrained Delaunay triangulation of a subset, one function of it alone.

*Segments* between vertices are edges of every triangulation of vertices among which both ends are; vertices that lie
exactly on one and are in it, too, cut it into a chain of edges. Which edges are forced is therefore no property of a
triangulation: an edge is, where one segment goes through both its ends (:func:`is_forced`).

From scratch: what a missing edge crosses is taken away, and the two polygons beside it are filled by triangles whose
circle holds none of the polygon's vertices on their side (Anglada [1]_). All other triangles stay: the
result is the constrained Delaunay triangulation (Chew [2]_; Lee, Lin [3]_), in which each edge that is not forced is
locally Delaunay. With ties broken by position there is one such triangulation.

References
----------
.. [1] M. V. Anglada, "An improved incremental algorithm for constructing restricted Delaunay triangulations",
       Computers & Graphics 21, 1997.
.. [2] L. P. Chew, "Constrained Delaunay triangulations", Algorithmica 4, 1989.
.. [3] D. T. Lee, A. K. Lin, "Generalized Delaunay triangulation for planar graphs", Discrete & Computational Geometry
       1, 1986.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.conflict import conflict, turn
from meshsimp_pymoo.plane.footprint import Footprint, inside
from meshsimp_pymoo.plane.nearest import DEEPEST, boxes_of_runs, next_leaf
from meshsimp_pymoo.plane.predicates import exact_ranges, orient_sign
from meshsimp_pymoo.plane.triangulation import RECORD, TRIANGLE

# Vertices in one leaf of the tree that those on segments are looked for in.
RUN = 8
# Where it is asked on which side of a segment more of the original lies: so many places along it, at distances from
# half its length down, each half the one before.
ALONG, DEPTHS = 8, 10
# Marks a twin that is a side of the polygons to be filled, of that number, while they are.
MARK = 0x80000000


class Constraints(NamedTuple):
    """Segments among N vertices: S of them; all arrays are empty where there are none."""

    at: np.ndarray  # (N,) where each vertex's segments are in ``listed``, -1: on none
    listed: np.ndarray  # their number, then which they are, vertex by vertex
    start: np.ndarray  # (S + 1,) where each segment's vertices are in ``along``
    along: np.ndarray  # the vertices on it, both ends included, from one end to the other
    left: np.ndarray  # (S,) whether the triangles on its left, as ``along`` lists it, hold it, else those on its right


NO_CONSTRAINTS = Constraints(*(np.empty(0, np.int32) for _ in range(5)))


@inner(inline=True)
def is_on_line(lines: Constraints, v: int) -> bool:
    """Whether vertex v lies on a segment or ends one."""
    at = lines.at
    return v < len(at) and at[v] >= 0


@inner(inline=True)
def is_forced(lines: Constraints, a: int, b: int) -> bool:
    """Whether the edge between vertices a and b is forced; either may be one at infinity."""
    at = lines.at
    if not (a < len(at) and b < len(at)):
        return False
    k = at[a]
    if k < 0 or at[b] < 0:
        return False
    return _share(lines, k, at[b]) >= 0


@inner
def _share(lines: Constraints, k: int, m: int) -> int:
    """Return the first segment in two lists; -1 if there is none."""
    listed = lines.listed
    for i in range(k + 1, k + 1 + listed[k]):
        for j in range(m + 1, m + 1 + listed[m]):
            if listed[i] == listed[j]:
                return int(listed[i])
    return -1


@inner
def holds_line(xy: np.ndarray, lines: Constraints, a: int, b: int, c: int) -> bool:
    """Whether a counter-clockwise triangle is in the mesh for the sake of a side that is forced, wherever it lies.

    Both triangles beside a forced edge may be outside the footprint; that on the side where more of the original lies
    is in the mesh all the same, or the mesh would not have the edge.
    """
    at = lines.at
    if len(at) == 0:
        return False
    for _ in range(3):
        k, m = at[a], at[b]
        if k >= 0 and m >= 0:
            s = _share(lines, k, m)
            if s >= 0:
                p, q = lines.along[lines.start[s]], lines.along[lines.start[s + 1] - 1]
                ahead = (xy[2 * q] - xy[2 * p]) * (xy[2 * b] - xy[2 * a]) + (xy[2 * q + 1] - xy[2 * p + 1]) * (
                    xy[2 * b + 1] - xy[2 * a + 1]
                )
                if (ahead > 0.0) == (lines.left[s] != 0):
                    return True
        a, b, c = b, c, a
    return False


@inner(inline=True)
def is_wall(xy: np.ndarray, mesh: np.ndarray, lines: Constraints, h: int, p: int, exact_area: float) -> bool:
    """Whether the edge of halfedge h hides from vertex p what lies beyond: whether it is forced, and p not on it."""
    a = mesh[h]
    b = mesh[(h & TRIANGLE) + ((h & 3) + 1) % 3]
    return is_forced(lines, a, b) and turn(xy, a, b, p, exact_area) != 0


@inner
def place_of(sites: np.ndarray, n: int, vertex: int) -> int:
    """Return where a vertex stands among the first n sites, which ascend; -1 if it is none of them."""
    low = 0
    high = n
    while low < high:
        middle = (low + high) >> 1
        if sites[middle] < vertex:
            low = middle + 1
        else:
            high = middle
    return low if low < n and sites[low] == vertex else -1


@inner
def constrain(
    xy: np.ndarray,
    mesh: np.ndarray,
    end: int,
    lines: Constraints,
    sites: np.ndarray,
    n: int,
    triangle: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> None:
    """Let a Delaunay triangulation of sites have all forced edges.

    Parameters
    ----------
    xy : (2 n,) float array
        Coordinates of the sites.
    mesh : uint32 array
        The triangles' records, up to ``end``; vertices are numbers of sites.
    lines : Constraints
        Among all vertices.
    sites : (n,) int array
        Which of the vertices the sites are, ascending.
    triangle : (n,) array
        Workspace.
    exact_area, exact_lift : float
        See :func:`meshsimp_pymoo.plane.predicates.exact_ranges`.
    """
    for t in range(0, end, RECORD):
        for k in range(3):
            if mesh[t + k] < n:
                triangle[mesh[t + k]] = t
    for s in range(len(lines.start) - 1):
        a = -1
        for i in range(lines.start[s], lines.start[s + 1]):
            b = place_of(sites, n, lines.along[i])
            if b < 0:
                continue
            if a >= 0:
                _force(xy, mesh, a, b, n, triangle, exact_area, exact_lift)
            a = b


@inner
def _force(
    xy: np.ndarray,
    mesh: np.ndarray,
    a: int,
    b: int,
    n: int,
    triangle: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> None:
    """Let there be an edge between sites a and b, between which no other site lies."""
    # The triangle at a through which the way to b goes, unless the edge is there.
    t = np.int64(triangle[a])
    while True:
        k = 0 if mesh[t] == a else (1 if mesh[t + 1] == a else 2)
        u = np.int64(mesh[t + (k + 1) % 3])
        v = np.int64(mesh[t + (k + 2) % 3])
        if u == b or v == b:
            return
        if u < n and v < n and turn(xy, a, u, b, exact_area) > 0 and turn(xy, a, v, b, exact_area) < 0:
            break
        t = np.int64(mesh[t + (k + 2) % 3 + 4]) & TRIANGLE
    # How many sites lie along the way on either side.
    n_left = 1
    n_right = 1
    h = t + (k + 1) % 3
    while True:
        h = np.int64(mesh[h + 4])
        s = h & TRIANGLE
        e = h & 3
        w = np.int64(mesh[s + (e + 2) % 3])
        if w == b:
            break
        if turn(xy, a, b, w, exact_area) > 0:
            n_left += 1
            h = s + (e + 1) % 3
        else:
            n_right += 1
            h = s + (e + 2) % 3
    # The polygons on the left of the edge from a to b and of that from b to a, each listed from the first of these
    # vertices to the second. Side i leads from vertex i to the next; ``within`` are the halfedges there that go.
    left = np.empty(n_left + 2, np.int64)
    right = np.empty(n_right + 2, np.int64)
    within = np.empty(n_left + n_right + 2, np.int64)
    cavity = np.empty(n_left + n_right, np.int64)
    left[0], left[1], left[n_left + 1] = a, v, b
    right[0], right[n_right], right[n_right + 1] = b, u, a
    within[0] = t + (k + 2) % 3
    last = n_left + n_right + 1
    within[last] = t + k
    cavity[0] = t
    i = 1
    j = 1
    h = t + (k + 1) % 3
    while True:
        h = np.int64(mesh[h + 4])
        s = h & TRIANGLE
        e = h & 3
        w = np.int64(mesh[s + (e + 2) % 3])
        cavity[i + j - 1] = s
        on_left, on_right = s + (e + 2) % 3, s + (e + 1) % 3
        if w == b:
            within[i] = on_left
            within[last - j] = on_right
            break
        if turn(xy, a, b, w, exact_area) > 0:
            within[i] = on_left
            i += 1
            left[i] = w
            h = on_right
        else:
            within[last - j] = on_right
            j += 1
            right[n_right + 1 - j] = w
            h = on_left
    # What lies beyond each side: a halfedge that stays, or another side, where an edge reaches into the polygon.
    n_sides = last + 1
    beyond = np.empty(n_sides, np.int64)
    for i in range(n_sides):
        beyond[i] = mesh[within[i] + 4]
    for i in range(n_sides):
        mesh[within[i] + 4] = MARK | i
    for i in range(n_sides):
        beyond[i] = -1 - (np.int64(mesh[beyond[i] + 4]) & ~MARK) if mesh[beyond[i] + 4] & MARK else beyond[i]
    _fill(xy, mesh, left, cavity, 0, within, 0, triangle, exact_area, exact_lift)
    _fill(xy, mesh, right, cavity, n_left, within, n_left + 1, triangle, exact_area, exact_lift)
    for i in range(n_sides):
        h = beyond[i] if beyond[i] >= 0 else within[-1 - beyond[i]]
        mesh[within[i] + 4] = h
        mesh[h + 4] = within[i]
    mesh[cavity[0] + 4] = cavity[n_left]
    mesh[cavity[n_left] + 4] = cavity[0]


@inner
def _fill(
    xy: np.ndarray,
    mesh: np.ndarray,
    polygon: np.ndarray,
    records: np.ndarray,
    first_record: int,
    within: np.ndarray,
    first_side: int,
    triangle: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> None:
    """Triangulate the polygon on the left of the edge from its first vertex to its last one, into these records.

    The first record has that edge as its first side. ``within`` gets the halfedge at each side of the polygon.
    """
    m = len(polygon)
    stack = np.empty((m, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, m - 1, -1
    depth = 1
    n = first_record
    while depth > 0:
        depth -= 1
        i, j, outside = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        a = polygon[i]
        b = polygon[j]
        c = i + 1
        for q in range(i + 2, j):
            if conflict(xy, a, b, polygon[c], polygon[q], exact_area, exact_lift):
                c = q
        t = records[n]
        n += 1
        mesh[t] = a
        mesh[t + 1] = b
        mesh[t + 2] = polygon[c]
        triangle[a] = t
        triangle[b] = t
        triangle[polygon[c]] = t
        if outside >= 0:
            mesh[t + 4] = outside
            mesh[outside + 4] = t
        if j == c + 1:
            within[first_side + c] = t + 1
        else:
            stack[depth, 0], stack[depth, 1], stack[depth, 2] = c, j, t + 1
            depth += 1
        if c == i + 1:
            within[first_side + i] = t + 2
        else:
            stack[depth, 0], stack[depth, 1], stack[depth, 2] = i, c, t + 2
            depth += 1


# ------------------------------------------------------------------------------------------------------- their making


@entry
def _vertices_on(xy: np.ndarray, segments: np.ndarray, boxes: np.ndarray, exact_area: float, found: np.ndarray) -> int:
    """List (segment, vertex) pairs of the vertices on each segment, its ends included, as far as there is room.

    Returns their number.
    """
    n = len(xy) // 2
    stack = np.empty(DEEPEST, np.int64)
    m = 0
    for s in range(len(segments)):
        a, b = segments[s, 0], segments[s, 1]
        ax, ay, bx, by = xy[2 * a], xy[2 * a + 1], xy[2 * b], xy[2 * b + 1]
        low_x, high_x = min(ax, bx), max(ax, bx)
        low_y, high_y = min(ay, by), max(ay, by)
        stack[0] = 1
        leaf, depth = next_leaf(boxes, stack, 1, ax, ay, bx, by, 0.0)
        while leaf >= 0:
            for v in range(leaf * RUN, min((leaf + 1) * RUN, n)):
                x, y = xy[2 * v], xy[2 * v + 1]
                if not (low_x <= x <= high_x and low_y <= y <= high_y):
                    continue
                if orient_sign(ax - x, ay - y, bx - x, by - y, exact_area) == 0:
                    if m < len(found):
                        found[m, 0] = s
                        found[m, 1] = v
                    m += 1
            leaf, depth = next_leaf(boxes, stack, depth, ax, ay, bx, by, 0.0)
    return m


@entry
def _lean_left(
    xy: np.ndarray,
    segments: np.ndarray,
    footprint: Footprint,
    left: np.ndarray,
) -> None:
    """Mark the segments on whose left there is at least as much of the original as on their right."""
    side = footprint.side
    columns = footprint.columns
    n_rows = len(footprint.state) // max(columns, 1)
    for s in range(len(segments) if side > 0 else 0):  # else all of the hull is inside, and nobody asks
        a, b = segments[s, 0], segments[s, 1]
        ax, ay = xy[2 * a], xy[2 * a + 1]
        ux, uy = xy[2 * b] - ax, xy[2 * b + 1] - ay
        more = 0
        depth = 0.5
        for _ in range(DEPTHS):
            for k in range(ALONG):
                t = (k + 0.5) / ALONG
                for sign in (1, -1):
                    x = ax + t * ux - sign * depth * uy
                    y = ay + t * uy + sign * depth * ux
                    # in the box of the model, which the cells cover
                    if 0.0 <= x < (columns - 1) / side and 0.0 <= y < (n_rows - 1) / side:
                        if inside(xy, footprint, 3.0 * x, 3.0 * y):
                            more += sign
            depth *= 0.5
        left[s] = more >= 0


def make_constraints(xy: FloatArray, segments: IntArray, footprint: Footprint | None = None) -> Constraints:
    """Return segments between vertices as the compiled functions want them.

    Parameters
    ----------
    xy : (N, 2) float array
        The vertices along a curve: multiples of 2**-52 in [0, 1].
    segments : (S, 2) int array
        Their ends, at different places. They may meet, and lie on each other, but must not cross.
    footprint : Footprint, optional
        That of the original, where it decides which triangles are in a mesh.

    Examples
    --------
    Of three vertices on a line the one in the middle lies on the segment between the others:

    >>> lines = make_constraints(np.array([[0.0, 0.0], [0.5, 0.5], [1.0, 0.5], [1.0, 1.0]]), np.array([[3, 0]]))
    >>> lines.along.tolist(), lines.at.tolist()
    ([3, 1, 0], [0, 2, -1, 4])
    """
    if len(segments) == 0:
        return NO_CONSTRAINTS
    segments = np.ascontiguousarray(segments, np.int64)
    flat, boxes = np.ascontiguousarray(xy, float).ravel(), boxes_of_runs(xy, RUN)
    found = np.empty((4 * len(segments), 2), np.int32)
    while (n := _vertices_on(flat, segments, boxes, exact_ranges(xy)[0], found)) > len(found):
        found = np.empty((n, 2), np.int32)
    segment, vertex = found[:n].T
    # along each segment, by the coordinate in which it is longer; those at one place by row
    start, step = xy[segments[:, 0]], xy[segments[:, 1]] - xy[segments[:, 0]]
    longer = np.abs(step).argmax(axis=1)
    axis = longer[segment]
    away = np.abs(xy[vertex, axis] - start[segment, axis])
    order = np.lexsort((vertex, away, segment))
    by_segment = np.concatenate([[0], np.cumsum(np.bincount(segment, minlength=len(segments)))])
    along = vertex[order]
    order = np.lexsort((segment, vertex))
    on, first, count = np.unique(vertex[order], return_index=True, return_counts=True)
    at = np.full(len(xy), -1, np.int32)
    at[on] = first + np.arange(len(on))
    listed = np.insert(segment[order], first, count)
    left = np.ones(len(segments), np.int32)
    if footprint is not None:
        _lean_left(flat, segments, footprint, left)
    return Constraints(at, listed.astype(np.int32), by_segment.astype(np.int32), along.astype(np.int32), left)
