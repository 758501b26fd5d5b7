"""What an insertion takes away and a removal leaves open: cavities, stars, and the ears that fill a star.

A vertex that comes replaces the triangles whose circle holds it (Bowyer [1]_, Watson [2]_); where one goes, its star is
filled by Delaunay ears (Devillers [3]_), a large one by the triangulation of its ring alone. Where edges are forced
(:mod:`~meshsimp_pymoo.plane.constraints`) only what a vertex sees counts.

References
----------
.. [1] A. Bowyer, "Computing Dirichlet tessellations", The Computer Journal 24, 1981.
.. [2] D. F. Watson, "Computing the n-dimensional Delaunay tessellation", The Computer Journal 24, 1981.
.. [3] O. Devillers, "On deletion in Delaunay triangulations", Int. J. Computational Geometry & Applications 12, 2002.
.. [4] M. Heller, "Triangulation algorithms for adaptive terrain modeling", Proc. 4th Int. Symposium on Spatial Data
       Handling, 1990.
.. [5] C. L. Lawson, "Software for C1 surface interpolation", Mathematical Software III, 1977.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.conflict import conflict, turn
from meshsimp_pymoo.plane.constraints import Constraints, is_forced, is_wall
from meshsimp_pymoo.plane.triangulation import INFINITE, LAST_INDEX, RECORD, TRIANGLE, locate, triangulate

# Ears are looked for one by one up to this many triangles in a star, in a time that grows with its square.
MOST_EARS = 48
# Beyond an ear a side of the ring is this and its number.
OUTSIDE = 1 << 30


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
def fill_beside_lines(
    xy: np.ndarray,
    p: int,
    ring: np.ndarray,
    m: int,
    edge: np.ndarray,
    ears: np.ndarray,
    ear_edges: np.ndarray,
    mesh: np.ndarray,
    stack: np.ndarray,
    lines: Constraints,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Do what :func:`fill` does for the star of p, where forced edges hide vertices of its ring from others.

    Where p lies on a segment, the edge between its neighbours there is forced. First the spokes flip [4]_ one by
    one until none is left, which makes ears of the ring whatever their circles hold; then edges that are not forced
    flip until all are locally Delaunay [5]_.

    Parameters
    ----------
    mesh : (16 m,) uint32 array
        Workspace, and ``stack`` for m entries.
    """
    # The neighbours of p on the segment that it lies on, and whether it is at the hull: then it may lie on an edge that
    # comes.
    low = -1
    high = -1
    may_touch = False
    for i in range(m):
        may_touch = may_touch or ring[i] > LAST_INDEX
        if is_forced(lines, p, ring[i]):
            for k in range(i):
                if is_forced(lines, p, ring[k]) and turn(xy, ring[k], ring[i], p, exact_area) == 0:
                    low, high = np.int64(ring[k]), np.int64(ring[i])
                    may_touch = True
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
        good = b != low and b != high
        if good and (a | b | c) <= LAST_INDEX:
            good = turn(xy, a, b, c, exact_area) > 0
            if good:
                seen = turn(xy, a, c, p, exact_area)
                good = seen > 0 or (seen == 0 and (may_touch or left == 4))
        elif good:
            good = b <= LAST_INDEX and failures >= left  # hull edges are what is left in the end
        if not good:
            failures += 1
            if failures > 2 * left:
                return 0
            i = after
            continue
        failures = 0
        _enter_ear(mesh, n, m, a, b, c, edge[before], edge[i])
        edge[before] = m + n
        n += 1
        left -= 1
        for k in range(i, left):
            ring[k] = ring[k + 1]
            edge[k] = edge[k + 1]
        i = i if i < left else 0
    _enter_ear(mesh, n, m, ring[0], ring[1], ring[2], edge[0], edge[1])
    _join(mesh, RECORD * n + 2, m, edge[2])
    n += 1
    # Lawson's flips; a triangle is looked at again where one of its edges is new.
    for k in range(n):
        stack[k] = k
        mesh[RECORD * k + 3] = 1
    depth = n
    while depth > 0:
        depth -= 1
        t = RECORD * np.int64(stack[depth])
        mesh[t + 3] = 0
        for e in range(3):
            h = t + e
            twin = np.int64(mesh[h + 4])
            if twin >= OUTSIDE:
                continue
            s = twin & TRIANGLE
            before = t + (e + 2) % 3
            after = t + (e + 1) % 3
            twin_before = s + ((twin & 3) + 2) % 3
            twin_after = s + ((twin & 3) + 1) % 3
            a, b, c, d = mesh[h], mesh[after], mesh[before], mesh[twin_before]
            if (a | b | c | d) > LAST_INDEX or is_forced(lines, a, b):
                continue
            if not conflict(xy, a, b, c, d, exact_area, exact_lift):
                continue
            # (a, b, c), (b, a, d)  ->  (d, b, c), (d, c, a), in the places of a -> b and b -> a
            beyond_ca, beyond_bc = np.int64(mesh[before + 4]), np.int64(mesh[after + 4])
            beyond_ad, beyond_db = np.int64(mesh[twin_after + 4]), np.int64(mesh[twin_before + 4])
            mesh[t], mesh[t + 1], mesh[t + 2] = d, b, c
            mesh[s], mesh[s + 1], mesh[s + 2] = d, c, a
            _link(mesh, t, beyond_db)
            _link(mesh, t + 1, beyond_bc)
            _link(mesh, t + 2, s)
            _link(mesh, s + 1, beyond_ca)
            _link(mesh, s + 2, beyond_ad)
            for changed in (t, s):
                if mesh[changed + 3] == 0:
                    mesh[changed + 3] = 1
                    stack[depth] = changed // RECORD
                    depth += 1
            break
    # They make a tree, which is told from its root as ``fill_large`` does.
    stack[0] = 0
    told = 1
    k = 0
    while k < told:
        t = np.int64(stack[k]) & TRIANGLE
        first = 0 if k == 0 else ((np.int64(stack[k]) & 3) + 1) % 3
        ear = m - 3 - k
        for e in range(3):
            h = t + (first + e) % 3
            ears[ear, e] = mesh[h]
            twin = np.int64(mesh[h + 4])
            if twin >= OUTSIDE:
                ear_edges[ear, e] = twin - OUTSIDE
            elif k > 0 and e == 2:
                ear_edges[ear, e] = m + ear
            else:
                stack[told] = twin
                ear_edges[ear, e] = m + m - 3 - told
                told += 1
        k += 1
    return n


@inner(inline=True)
def _link(mesh: np.ndarray, h: int, beyond: int) -> None:
    """Let halfedge h of an ear have this one beyond, which may be a side of the ring."""
    mesh[h + 4] = beyond
    if beyond < OUTSIDE:
        mesh[beyond + 4] = h


@inner(inline=True)
def _join(mesh: np.ndarray, h: int, m: int, side: int) -> None:
    """Let halfedge h of an ear have beyond it what `fill` calls this side: one of the ring, or the third of an ear."""
    _link(mesh, h, OUTSIDE + side if side < m else RECORD * (side - m) + 2)


@inner
def _enter_ear(mesh: np.ndarray, n: int, m: int, a: int, b: int, c: int, side_ab: int, side_bc: int) -> None:
    """Write ear n into its record, the first two sides linked."""
    t = RECORD * n
    mesh[t] = a
    mesh[t + 1] = b
    mesh[t + 2] = c
    _join(mesh, t, m, side_ab)
    _join(mesh, t + 1, m, side_bc)


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
