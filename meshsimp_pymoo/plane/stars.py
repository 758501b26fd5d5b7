"""What an insertion takes away and a removal leaves open: cavities, stars, and the ears that fill a star.

A vertex that comes replaces the triangles whose circle holds it (Bowyer [1]_, Watson [2]_); where one goes, its star is
filled by Delaunay ears (Devillers [3]_), a large one by the triangulation of its ring alone.

References
----------
.. [1] A. Bowyer, "Computing Dirichlet tessellations", The Computer Journal 24, 1981.
.. [2] D. F. Watson, "Computing the n-dimensional Delaunay tessellation", The Computer Journal 24, 1981.
.. [3] O. Devillers, "On deletion in Delaunay triangulations", Int. J. Computational Geometry & Applications 12, 2002.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.predicates import circle_sign, orient_sign
from meshsimp_pymoo.plane.triangulation import INFINITE, LAST_INDEX, TRIANGLE, locate, triangulate

# Ears are looked for one by one up to this many triangles in a star, in a time that grows with its square.
MOST_EARS = 48


@inner(inline=True)
def turn(xy: np.ndarray, a: int, b: int, c: int, exact_area: float) -> int:
    """Sign of the area of vertices (a, b, c)."""
    x = xy[2 * c]
    y = xy[2 * c + 1]
    return orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, exact_area)


@inner
def _ghost_conflict(xy: np.ndarray, a: int, b: int, q: int, exact_area: float) -> bool:
    """Whether q lies beyond the hull edge with exterior left of a -> b, or inside that edge."""
    sign = turn(xy, a, b, q, exact_area)
    if sign != 0:
        return sign > 0
    k = 0 if xy[2 * a] != xy[2 * b] else 1
    low = min(xy[2 * a + k], xy[2 * b + k])
    high = max(xy[2 * a + k], xy[2 * b + k])
    return low < xy[2 * q + k] < high


@inner
def _tied_conflict(xy: np.ndarray, a: int, b: int, c: int, q: int, exact_area: float) -> bool:
    """Whether q of four cocircular points counts as inside the circle of (a, b, c): the largest index is cut off."""
    last = max(max(a, b), max(c, q))
    if last == q:
        return False
    if last == a:
        return turn(xy, q, b, c, exact_area) > 0
    if last == b:
        return turn(xy, a, q, c, exact_area) > 0
    return turn(xy, a, b, q, exact_area) > 0


@inner(inline=True)
def conflict(xy: np.ndarray, a: int, b: int, c: int, q: int, exact_area: float, exact_lift: float) -> bool:
    """Whether vertex q lies inside the circle of triangle (a, b, c), any of which may be the one at infinity."""
    if q > LAST_INDEX:
        return False
    if (a | b | c) > LAST_INDEX:
        if c > LAST_INDEX:
            return _ghost_conflict(xy, a, b, q, exact_area)
        if a > LAST_INDEX:
            return _ghost_conflict(xy, b, c, q, exact_area)
        return _ghost_conflict(xy, c, a, q, exact_area)
    x = xy[2 * q]
    y = xy[2 * q + 1]
    sign = circle_sign(
        xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, xy[2 * c] - x, xy[2 * c + 1] - y, exact_lift
    )
    if sign != 0:
        return sign > 0
    return _tied_conflict(xy, a, b, c, q, exact_area)


@inner
def cavity_of(
    xy: np.ndarray,
    mesh: np.ndarray,
    t0: int,
    p: int,
    cavity: np.ndarray,
    rim: np.ndarray,
    stack: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> tuple[int, int]:
    """List the triangles in conflict with p, from t0 that holds it, and the halfedges outside their rim, in order.

    Returns the numbers of both. Each rim entry is the twin (outside) of a cavity edge u -> v, counter-clockwise.
    """
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
        if conflict(xy, mesh[s], mesh[s + 1], mesh[s + 2], p, exact_area, exact_lift):
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
    edge: np.ndarray,
    ears: np.ndarray,
    ear_edges: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Triangulate the polygon ``ring`` (destroyed) by Delaunay ears; return their number, m - 2, or 0 if there is none.

    Side i of the polygon has the number i, the third side of ear k the number m + k; ``ear_edges`` says which sides an
    ear has, in the order of its vertices.
    """
    for i in range(m):
        edge[i] = i
    left = m
    n = 0
    i = 0
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
            i = after
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
        i = i if i < left else 0
    for k in range(3):
        ears[n, k] = ring[k]
        ear_edges[n, k] = edge[k]
    return n + 1


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
