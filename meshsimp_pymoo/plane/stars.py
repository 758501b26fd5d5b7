"""What an insertion takes away and a removal leaves open: cavities, stars, and the ears that fill a star.

A vertex that comes replaces the triangles whose circle holds it (Bowyer [1]_, Watson [2]_); where one goes, its star is
filled by Delaunay ears (Devillers [3]_), a large one by the triangulation of its ring alone.

Where edges are forced (:mod:`~meshsimp_pymoo.plane.constraints`) a vertex that comes replaces what it sees. A star is
filled as ever: the circle of a triangle that fills it holds the vertex p that went. If it held a vertex q of the ring
that is hidden from the triangle, what hides it would end at a vertex of the ring between the two as p sees them. That
one lies between p, q and a point of the triangle, so inside the circle as these do: it would be no corner of the
triangle, and either seen from it or hidden by a nearer one. So circles that are empty of what is seen are empty of all.
Only where p lies on a segment, whose edge comes, each side of it is a star of its own.

References
----------
.. [1] A. Bowyer, "Computing Dirichlet tessellations", The Computer Journal 24, 1981.
.. [2] D. F. Watson, "Computing the n-dimensional Delaunay tessellation", The Computer Journal 24, 1981.
.. [3] O. Devillers, "On deletion in Delaunay triangulations", Int. J. Computational Geometry & Applications 12, 2002.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.conflict import conflict, turn
from meshsimp_pymoo.plane.constraints import Constraints, is_forced, is_wall
from meshsimp_pymoo.plane.triangulation import INFINITE, LAST_INDEX, TRIANGLE, locate, triangulate

# Ears are looked for one by one up to this many triangles in a star, in a time that grows with its square.
MOST_EARS = 48


@inner
def cavity_of(
    xy: np.ndarray,
    mesh: np.ndarray,
    t0: int,
    p: int,
    cavity: np.ndarray,
    rim: np.ndarray,
    stack: np.ndarray,
    lines: Constraints,
    exact_area: float,
    exact_lift: float,
) -> tuple[int, int]:
    """List the triangles in conflict with p, from t0 that holds it, and the halfedges outside their rim, in order.

    Returns the numbers of both. Each rim entry is the twin (outside) of a cavity edge u -> v, counter-clockwise. What
    forced edges hide from p is in no conflict with it.
    """
    lined = len(lines.at) > 0
    n_cavity = 1
    n_rim = 0
    cavity[0] = t0
    stack[0] = t0 + 2
    stack[1] = t0 + 1
    stack[2] = t0
    depth = 3
    while depth > 0:
        depth -= 1
        h = mesh[stack[depth] + 4]
        s = h & TRIANGLE
        if conflict(xy, mesh[s], mesh[s + 1], mesh[s + 2], p, exact_area, exact_lift) and not (
            lined and is_wall(xy, mesh, lines, h, p, exact_area)
        ):
            cavity[n_cavity] = s
            n_cavity += 1
            k = h & 3
            stack[depth] = s + (k + 2) % 3
            stack[depth + 1] = s + (k + 1) % 3
            depth += 2
        else:
            rim[n_rim] = h
            n_rim += 1
    return n_cavity, n_rim


@inner
def triangles_around(mesh: np.ndarray, t: int, p: int, star: np.ndarray, rim: np.ndarray, ring: np.ndarray) -> int:
    """List the triangles around p counter-clockwise, the halfedges outside its ring and the ring's vertices."""
    first = t
    m = 0
    while True:
        k = 0 if mesh[t] == p else (1 if mesh[t + 1] == p else 2)
        opposite = t + (k + 1) % 3
        star[m] = t
        rim[m] = mesh[opposite + 4]
        ring[m] = mesh[opposite]
        m += 1
        t = mesh[t + (k + 2) % 3 + 4] & TRIANGLE
        if t == first:
            return m


@inner
def fill(
    xy: np.ndarray,
    ring: np.ndarray,
    m: int,
    spared: int,
    edge: np.ndarray,
    ears: np.ndarray,
    ear_edges: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Triangulate the polygon ``ring`` (destroyed) by Delaunay ears; return their number, m - 2, or 0 if there is none.

    Side i of the polygon has the number i, the third side of ear k the number m + k; ``ear_edges`` says which sides an
    ear has, in the order of its vertices. With ``spared`` 1 instead of 0 the first and last vertex are no tips of ears,
    so the last ear has the side between them for its third.
    """
    for i in range(m):
        edge[i] = i
    left = m
    n = 0
    i = spared
    failures = 0
    while left > 3:
        before = i - 1 if i > 0 else left - 1
        after = i + 1 if i < left - 1 else 0
        a = ring[before]
        b = ring[i]
        c = ring[after]
        good = True
        if (a | b | c) <= LAST_INDEX:
            good = turn(xy, a, b, c, exact_area) > 0
        if good:
            for q in range(left):
                if q != before and q != i and q != after:
                    if conflict(xy, a, b, c, ring[q], exact_area, exact_lift):
                        good = False
                        break
        if not good:
            failures += 1
            if failures > left:
                return 0
            i = i + 1 if i < left - 1 - spared else spared
            continue
        failures = 0
        ears[n, 0] = a
        ears[n, 1] = b
        ears[n, 2] = c
        ear_edges[n, 0] = edge[before]
        ear_edges[n, 1] = edge[i]
        ear_edges[n, 2] = m + n
        edge[before] = m + n
        n += 1
        left -= 1
        for k in range(i, left):
            ring[k] = ring[k + 1]
            edge[k] = edge[k + 1]
        i = i if i < left - spared else spared
    for k in range(3):
        ears[n, k] = ring[k]
        ear_edges[n, k] = edge[k]
    return n + 1


@inner
def along_line(
    xy: np.ndarray, lines: Constraints, p: int, ring: np.ndarray, m: int, exact_area: float
) -> tuple[int, int]:
    """Return which two vertices of the ring of p are its neighbours on the segment that it lies on; -1: it ends all."""
    for i in range(m):
        if is_forced(lines, p, ring[i]):
            for k in range(i):
                if is_forced(lines, p, ring[k]) and turn(xy, ring[k], ring[i], p, exact_area) == 0:
                    return k, i
    return -1, -1


@inner
def fill_on_line(
    xy: np.ndarray,
    ring: np.ndarray,
    m: int,
    low: int,
    high: int,
    half: np.ndarray,
    edge: np.ndarray,
    ears: np.ndarray,
    ear_edges: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Do what :func:`fill` does for the star of a vertex between two of its ring on a segment, these of it.

    The edge between them is forced then, so either side of it is filled alone. ``half`` has room for m vertices.
    """
    n = 0
    for first, last in ((low, high), (high, low)):
        count = (last - first + m) % m + 1
        for i in range(count):
            half[i] = ring[(first + i) % m]
        more = fill(xy, half, count, 1, edge, ears[n:], ear_edges[n:], exact_area, exact_lift)
        if more == 0:
            return 0
        for k in range(n, n + more):
            for e in range(3):
                side = ear_edges[k, e]
                if side < count - 1:
                    ear_edges[k, e] = (first + side) % m
                elif side == count - 1:  # the edge between both halves, the third of the first one's last ear
                    ear_edges[k, e] = m + (n if n > 0 else more) - 1
                else:
                    ear_edges[k, e] = m + n + side - count
        n += more
    return n


@inner
def fill_large(
    xy: np.ndarray,
    p: int,
    ring: np.ndarray,
    m: int,
    ears: np.ndarray,
    ear_edges: np.ndarray,
    mesh: np.ndarray,
    inserted: np.ndarray,
    side_of: np.ndarray,
    order: np.ndarray,
    stack: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Do what :func:`fill` does for the star of p, in a time near m log m.

    It takes what of the ring's own triangulation is in conflict with p.

    Any triangle that fills the star has an empty circle among the ring's vertices, and p in it; so it is the same.

    Parameters
    ----------
    mesh : (16 m,) uint32 array
        Workspace, and ``stack``, ``order`` for m entries.
    inserted, side_of : (N,) arrays
        Workspace by vertex.
    """
    n = 0
    side_at_infinity = -1
    # From coarse to fine, each time around the ring: as good as a random order, and each is found near the one before.
    step = 1
    while 2 * step < m:
        step *= 2
    coarsest = step
    while step > 0:
        for i in range(0, m, step):
            if step < coarsest and i % (2 * step) == 0:
                continue
            if ring[i] <= LAST_INDEX:
                side_of[ring[i]] = i
                order[n] = ring[i]
                n += 1
            else:
                side_at_infinity = i
        step >>= 1
    end = triangulate(xy, n, np.empty(0, np.int64), order, inserted, mesh, exact_area, exact_lift)
    if end == 0:
        return _fill_straight(ring, m, side_at_infinity, ears, ear_edges)
    # The triangles in conflict with p make a tree; ear m - 3 is its root, and each other ear's third side leads to its
    # parent, which has a higher number. ``stack`` holds each triangle with its side towards the parent.
    root = locate(xy, mesh, 0, xy[2 * p], xy[2 * p + 1], exact_area)
    stack[0] = root
    n = 1
    k = 0
    while k < n:
        t = stack[k] & TRIANGLE
        first = 0 if k == 0 else ((stack[k] & 3) + 1) % 3
        for e in range(3):
            h = t + (first + e) % 3
            ears[m - 3 - k, e] = mesh[h]
            if k > 0 and e == 2:
                ear_edges[m - 3 - k, e] = m + m - 3 - k
                continue
            twin = mesh[h + 4]
            s = twin & TRIANGLE
            if conflict(xy, mesh[s], mesh[s + 1], mesh[s + 2], p, exact_area, exact_lift):
                if n == m - 2:
                    return 0
                stack[n] = twin
                ear_edges[m - 3 - k, e] = m + m - 3 - n
                n += 1
            else:
                ear_edges[m - 3 - k, e] = side_of[mesh[h]] if mesh[h] <= LAST_INDEX else side_at_infinity
        k += 1
    return n if n == m - 2 else 0


@inner
def _fill_straight(ring: np.ndarray, m: int, at: int, ears: np.ndarray, ear_edges: np.ndarray) -> int:
    """Fill a star whose ring is a straight row and, at position ``at``, the vertex at infinity: by ghosts."""
    if at < 0:
        return 0
    side = at
    for k in range(m - 2):
        here = (at + 1 + k) % m
        ears[k, 0] = INFINITE
        ears[k, 1] = ring[here]
        ears[k, 2] = ring[(here + 1) % m]
        ear_edges[k, 0] = side
        ear_edges[k, 1] = here
        ear_edges[k, 2] = m + k if k < m - 3 else (at - 1 + m) % m
        side = m + k
    return m - 2
