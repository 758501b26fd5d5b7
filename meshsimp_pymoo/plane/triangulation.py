"""The Delaunay triangulation of a subset of the vertices: one function of the subset alone.

Points are inserted one by one in the order given, normally vector order (a Hilbert curve), so that each is found by a
short walk [1]_ from its predecessor and made Delaunay by Lawson's edge flips [2]_. The outside of the hull is covered
by ghost triangles that share a vertex at infinity, so a hull of any shape needs no special case.

Four cocircular points leave the diagonal open. Here the lifted coordinate x**2 + y**2 of the point with index i is
raised by an infinitesimal that grows with i (simulation of simplicity [3]_): of four cocircular points the one with the
largest index is cut off by the diagonal. All predicates are exact, so the result does not depend on the order of
insertion.

Data structure: a triangle is a record of eight integers in ``mesh``, and its name t is the index of the first: the
vertices ``mesh[t], mesh[t + 1], mesh[t + 2]`` counter-clockwise, one unused, and the twins ``mesh[t + 4], mesh[t + 5],
mesh[t + 6]`` of the halfedges t, t + 1, t + 2, where halfedge t + i leads from vertex i to the next. So ``mesh[h + 4]``
is the twin of halfedge h, ``h & TRIANGLE`` its triangle, and every halfedge has a twin. The vertex at infinity is
``INFINITE``.

References
----------
.. [1] O. Devillers, S. Pion, M. Teillaud, "Walking in a triangulation", Int. J. Foundations of Computer Science 13,
       2002.
.. [2] C. L. Lawson, "Software for C1 surface interpolation", Mathematical Software III, 1977.
.. [3] H. Edelsbrunner, E. P. Muecke, "Simulation of simplicity", ACM Transactions on Graphics 9, 1990.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.predicates import circle_sign, orient_sign

# In the unit square the two products of an orientation sum to at most 2 in magnitude: past this its sign is certain.
CERTAIN_AREA = 6.7e-16
# Indices are unsigned (uint32), which spares each access the test for Python's negative indices.
INFINITE = 0xFFFFFFFF
LAST_INDEX = 0x7FFFFFFF
TRIANGLE = ~7
RECORD = 8
SPARSE_ROUND_FROM = 5000
SPARSE_STEP = 8


@inner(inline=True)
def locate(xy: np.ndarray, mesh: np.ndarray, start: int, x: float, y: float, exact_area: float) -> int:
    """Walk from triangle ``start`` to the triangle that holds (x, y), or to the ghost beyond the hull edge it sees."""
    t = start
    if mesh[t] > LAST_INDEX:
        t = mesh[t + 5] & TRIANGLE
    elif mesh[t + 1] > LAST_INDEX:
        t = mesh[t + 6] & TRIANGLE
    elif mesh[t + 2] > LAST_INDEX:
        t = mesh[t + 4] & TRIANGLE
    while True:
        a = mesh[t]
        b = mesh[t + 1]
        c = mesh[t + 2]
        if (a | b | c) > LAST_INDEX:
            return t
        ax = xy[2 * a] - x
        ay = xy[2 * a + 1] - y
        bx = xy[2 * b] - x
        by = xy[2 * b + 1] - y
        cx = xy[2 * c] - x
        cy = xy[2 * c + 1] - y
        ab = ax * by - ay * bx
        bc = bx * cy - by * cx
        ca = cx * ay - cy * ax
        # Cross the edge that (x, y) is farthest behind, by area; chosen without branches, which a processor cannot
        # foresee.
        least = ab
        h = t
        h = t + 1 if bc < least else h
        least = bc if bc < least else least
        h = t + 2 if ca < least else h
        least = ca if ca < least else least
        if least >= CERTAIN_AREA:
            return t
        if least > -CERTAIN_AREA:
            if ab < CERTAIN_AREA and orient_sign(ax, ay, bx, by, exact_area) < 0:
                h = t
            elif bc < CERTAIN_AREA and orient_sign(bx, by, cx, cy, exact_area) < 0:
                h = t + 1
            elif ca < CERTAIN_AREA and orient_sign(cx, cy, ax, ay, exact_area) < 0:
                h = t + 2
            else:
                return t
        t = mesh[h + 4] & TRIANGLE


@inner
def locate_at_random(xy: np.ndarray, mesh: np.ndarray, start: int, x: float, y: float, exact_area: float) -> int:
    """Do what :func:`locate` does, in any triangulation: of the sides to be crossed it takes any.

    Where edges are forced the other walk may go in circles [1]_; this one ends with a probability of 1.
    """
    t = start
    for k in range(3):
        if mesh[t + k] > LAST_INDEX:
            t = np.int64(mesh[t + (k + 1) % 3 + 4]) & TRIANGLE
            break
    state = np.uint64(1)
    while (mesh[t] | mesh[t + 1] | mesh[t + 2]) <= LAST_INDEX:
        state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
        first = np.int64((state >> np.uint64(33)) % np.uint64(3))
        h = -1
        for k in range(first, first + 3):
            a = mesh[t + k % 3]
            b = mesh[t + (k + 1) % 3]
            if orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, exact_area) < 0:
                h = t + k % 3
                break
        if h < 0:
            break
        t = np.int64(mesh[h + 4]) & TRIANGLE
    return t


@inner(inline=True)
def height_on(xy: np.ndarray, z: np.ndarray, mesh: np.ndarray, t: int, x: float, y: float) -> float:
    """Return the height of triangle t at (x, y), of vertices at heights z."""
    a = mesh[t]
    b = mesh[t + 1]
    c = mesh[t + 2]
    ax = xy[2 * a] - x
    ay = xy[2 * a + 1] - y
    bx = xy[2 * b] - x
    by = xy[2 * b + 1] - y
    cx = xy[2 * c] - x
    cy = xy[2 * c + 1] - y
    wa = bx * cy - by * cx
    wb = cx * ay - cy * ax
    wc = ax * by - ay * bx
    return (wa * z[a] + wb * z[b] + wc * z[c]) / (wa + wb + wc)


@inner
def _ghost_in_conflict(xy: np.ndarray, u: int, v: int, d: int, x: float, y: float, exact_area: float) -> bool:
    if d > LAST_INDEX:
        # A hull edge with p on its inner side: in conflict only when p lies on the edge itself.
        a, b, wanted = u, v, 0
    elif v > LAST_INDEX:
        # p sees one hull edge; does it see the next one, from u to d, too?
        a, b, wanted = u, d, 1
    else:
        a, b, wanted = d, v, 1
    return orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, exact_area) == wanted


@inner(inline=True)
def insert(
    xy: np.ndarray,
    mesh: np.ndarray,
    t1: int,
    start: int,
    p: int,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Insert vertex ``p``, with the free records ``t1`` and the next one; return a triangle at p (its third vertex)."""
    x = xy[2 * p]
    y = xy[2 * p + 1]
    t0 = locate(xy, mesh, start, x, y, exact_area)
    # Split t0 = (a, b, c) into the star (a, b, p), (b, c, p), (c, a, p): p is always the third vertex.
    t2 = t1 + RECORD
    a = mesh[t0]
    b = mesh[t0 + 1]
    c = mesh[t0 + 2]
    twin_bc = mesh[t0 + 5]
    twin_ca = mesh[t0 + 6]
    mesh[t0 + 2] = p
    mesh[t1] = b
    mesh[t1 + 1] = c
    mesh[t1 + 2] = p
    mesh[t2] = c
    mesh[t2 + 1] = a
    mesh[t2 + 2] = p
    mesh[t1 + 4] = twin_bc
    mesh[twin_bc + 4] = t1
    mesh[t2 + 4] = twin_ca
    mesh[twin_ca + 4] = t2
    mesh[t0 + 5] = t1 + 2
    mesh[t1 + 6] = t0 + 1
    mesh[t1 + 5] = t2 + 2
    mesh[t2 + 6] = t1 + 1
    mesh[t2 + 5] = t0 + 2
    mesh[t0 + 6] = t2 + 1
    # Go once around p counter-clockwise; a flip keeps the first vertex u of the triangle and moves its second one on.
    t = t0
    while True:
        u = mesh[t]
        v = mesh[t + 1]
        ux = 0.0
        uy = 0.0
        if u <= LAST_INDEX:
            ux = xy[2 * u] - x
            uy = xy[2 * u + 1] - y
        while True:
            h = mesh[t + 4]
            s = h & TRIANGLE
            side = h & 3
            h_next = s if side == 2 else h + 1
            h_prev = s + 2 if side == 0 else h - 1
            d = mesh[h_prev]
            if (u | v | d) <= LAST_INDEX:
                sign = circle_sign(
                    xy[2 * v] - x, xy[2 * v + 1] - y, ux, uy, xy[2 * d] - x, xy[2 * d + 1] - y, exact_lift
                )
                if sign < 0 or (sign == 0 and max(u, v) < max(d, p)):
                    break
            elif not _ghost_in_conflict(xy, u, v, d, x, y, exact_area):
                break
            # (u, v, p), (v, u, d)  ->  (u, d, p), (d, v, p)
            twin_ud = mesh[h_next + 4]
            twin_dv = mesh[h_prev + 4]
            twin_vp = mesh[t + 5]
            mesh[t + 1] = d
            mesh[s] = d
            mesh[s + 1] = v
            mesh[s + 2] = p
            mesh[t + 4] = twin_ud
            mesh[twin_ud + 4] = t
            mesh[s + 4] = twin_dv
            mesh[twin_dv + 4] = s
            mesh[s + 5] = twin_vp
            mesh[twin_vp + 4] = s + 1
            mesh[t + 5] = s + 2
            mesh[s + 6] = t + 1
            v = d
        t = mesh[t + 5] & TRIANGLE
        if t == t0:
            return t0


@inner
def triangulate(
    xy: np.ndarray,
    n: int,
    first: np.ndarray,
    order: np.ndarray,
    inserted: np.ndarray,
    mesh: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Triangulate the first ``n`` points or those listed; return the end of the triangles' records (0: there are none).

    Parameters
    ----------
    xy : (2 n,) float array
        Coordinates x0, y0, x1, ... of distinct points, multiples of 2**-52 in [0, 1]; ties go by position in this
        array.
    n : int
        Number of points.
    first : (m,) int array
        Points to insert before the others (negative: none), such as corners, which spare the others the hull.
    order : (n,) or (0,) int array
        Order of insertion; empty: as stored. The result is the same triangulation, only slower to find. The points may
        be some of those in ``xy``: then only the rows listed here are triangulated.
    inserted : uint8 array
        Workspace, an entry for each row of ``xy``.
    mesh : (16 n,) uint32 array
        Receives the triangles' records, ghosts included; see the module's text.
    exact_area, exact_lift : float
        See :func:`meshsimp_pymoo.plane.predicates.exact_ranges`.

    Returns
    -------
    int
        8 (2 n - 2): the end of the records in ``mesh``; 0 where all points lie on one line.
    """
    n_first = len(first)
    natural = len(order) == 0
    for i in range(n):
        inserted[i if natural else order[i]] = 0
    # The first triangle: the first two points and the first one that is not on their line.
    a = -1
    b = -1
    c = -1
    c_sign = 0
    for i in range(n_first + n):
        if i < n_first:
            p = first[i]
        elif natural:
            p = i - n_first
        else:
            p = order[i - n_first]
        if p < 0 or p == a or p == b:
            continue
        if a < 0:
            a = p
        elif b < 0:
            b = p
        else:
            x = xy[2 * p]
            y = xy[2 * p + 1]
            c_sign = orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, exact_area)
            if c_sign != 0:
                c = p
                break
    if c < 0:
        return 0
    if c_sign < 0:
        a, b = b, a
    inserted[a] = 1
    inserted[b] = 1
    inserted[c] = 1
    # The first triangle and its three ghosts (v, u, infinity), one for each hull edge u -> v.
    mesh[0] = a
    mesh[1] = b
    mesh[2] = c
    for k in range(3):
        t = RECORD * (k + 1)
        mesh[t] = mesh[(k + 1) % 3]
        mesh[t + 1] = mesh[k]
        mesh[t + 2] = INFINITE
        mesh[t + 4] = k
        mesh[k + 4] = t
        mesh[t + 5] = RECORD * ((k + 2) % 3 + 1) + 2
        mesh[t + 6] = RECORD * ((k + 1) % 3 + 1) + 1
    end = 4 * RECORD
    t = 0
    for i in range(n_first):
        p = first[i]
        if p >= 0 and inserted[p] == 0:
            inserted[p] = 1
            t = insert(xy, mesh, end, t, p, exact_area, exact_lift)
            end += 2 * RECORD
    # Past a few thousand points a sparse round goes first: points that meet a rough triangulation of the whole need
    # fewer flips than points at the ragged end of a space-filling curve (a biased order of two rounds).
    n_rounds = 2 if natural and n >= SPARSE_ROUND_FROM else 1
    for k in range(n_rounds):
        for i in range(0, n, SPARSE_STEP if k < n_rounds - 1 else 1):
            p = i if natural else order[i]
            if inserted[p] == 0:
                inserted[p] = 1
                t = insert(xy, mesh, end, t, p, exact_area, exact_lift)
                end += 2 * RECORD
    return end


@entry
def triangulate_once(
    xy: np.ndarray,
    n: int,
    first: np.ndarray,
    order: np.ndarray,
    inserted: np.ndarray,
    mesh: np.ndarray,
    exact_area: float,
    exact_lift: float,
) -> int:
    """Do what :func:`triangulate` does, called from Python."""
    return triangulate(xy, n, first, order, inserted, mesh, exact_area, exact_lift)
