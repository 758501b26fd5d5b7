"""A triangulation that lives: insert a vertex, remove one, move one, and know the exact change of the error.

Every triangle keeps the list of the original vertices it covers and the sum of their costs. Inserting a vertex replaces
the triangles whose circle holds it by a fan (Bowyer [1]_, Watson [2]_); removing one fills its star by Delaunay ears
(Devillers [3]_). Only the vertices of the triangles replaced are looked at, so an operation, tried or done, costs what
it touches and not N. The triangulation of a subset is unique (see :mod:`~meshsimp_pymoo.plane.triangulation`), hence
after any sequence of operations triangles and error are those of :func:`~meshsimp_pymoo.surface.evaluate.simplify` from
scratch.

Where the outline is touched more has to be done: vertices that no triangle covers ("bare" ones) know the segment of the
outline that is nearest to them; those whose segment goes look for another, and all compare with the segments that come.

References
----------
.. [1] A. Bowyer, "Computing Dirichlet tessellations", The Computer Journal 24, 1981.
.. [2] D. F. Watson, "Computing the n-dimensional Delaunay tessellation", The Computer Journal 24, 1981.
.. [3] O. Devillers, "On deletion in Delaunay triangulations", Int. J. Computational Geometry & Applications 12, 2002.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.emission import is_sliver, sum_of_three
from meshsimp_pymoo.plane.footprint import inside
from meshsimp_pymoo.plane.predicates import circle_sign, orient_sign
from meshsimp_pymoo.plane.triangulation import INFINITE, LAST_INDEX, RECORD, TRIANGLE, locate, triangulate
from meshsimp_pymoo.surface import moves
from meshsimp_pymoo.surface.evaluate import COVER_TOLERANCE
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.moves import answers

NONE = 0xFFFFFFFF

# What a triangle is, as bits of ``kind``; a plain one is inside the footprint and emitted.
EMITTED, THIN, PEELED, INSIDE, VISITED = 1, 2, 4, 8, 16
PLAIN = EMITTED | INSIDE

# A tentative change that touches more triangles than this is done and undone instead.
MOST_TOUCHED = 48

# Entries of ``tally``.
(
    END,
    N_FREE,
    N_EMITTED,
    N_BARE,
    N_SEGMENTS,
    N_FREE_SEGMENTS,
    N_SEGMENTS_EVER,
    N_REGION,
    N_POOL,
    N_TOUCHED,
    N_DEAD,
    N_ADDED,
    N_SITES,
) = range(13)
# Entries of ``amount``: running sums, and the largest both together have been since they were last added up anew.
COVERED_ERROR, BARE_ERROR, PEAK = range(3)

# What large costs that came and went leave in a running sum is rounding of the largest: once the sums have fallen below
# this share of it, they are added up anew.
RETAKEN_BELOW = 2.0**-20


class Live(NamedTuple):
    """What changes; N vertices, at most 2 N triangles (records, see :mod:`~meshsimp_pymoo.plane.triangulation`)."""

    mesh: np.ndarray  # (16 N,) records of triangles
    kind: np.ndarray  # (2 N,) bits of each triangle
    head: np.ndarray  # (2 N,) first vertex in each triangle's list, -1: none
    subtotal: np.ndarray  # (2 N,) sum of the costs in each emitted triangle
    following: np.ndarray  # (N,) next vertex in the same list
    place: np.ndarray  # (N,) the triangle a dropped vertex lies in; some triangle of a site
    cost: np.ndarray  # (N,) cost of the bare vertices
    used: np.ndarray  # (N,) number of emitted triangles at each site
    site: np.ndarray  # (N,) whether the vertex is in the triangulation
    free: np.ndarray  # (2 N,) unused records
    bare_at: np.ndarray  # (N,) where in ``bare`` a vertex stands, -1: not there
    bare: np.ndarray  # (N,) vertices that no emitted triangle covers
    bare_segment: np.ndarray  # (N,) the outline segment nearest to each of them
    bare_gap: np.ndarray  # (N,) squared distance to it in the unit square
    segment_of: np.ndarray  # (6 N,) outline segment of a halfedge, -1: none
    segment: np.ndarray  # (6 N,) halfedge of each segment, NONE: dead
    segment_at: np.ndarray  # (6 N,) where in ``alive`` it stands
    alive: np.ndarray  # (6 N,) the segments that exist
    free_segment: np.ndarray  # (6 N,) numbers to use again
    region: np.ndarray  # (2 N,) triangles that an operation made
    pool: np.ndarray  # (N,) vertices to be placed
    touched: np.ndarray  # (12 N,) vertices whose triangles changed
    dead: np.ndarray  # (6 N,) segments that went
    added: np.ndarray  # (6 N,) segments that came
    cavity: np.ndarray  # scratch of the size of the triangles
    rim: np.ndarray
    ring: np.ndarray
    stack: np.ndarray
    edge: np.ndarray
    ears: np.ndarray  # (2 N, 3)
    ear_edges: np.ndarray  # (2 N, 3)
    gone: np.ndarray  # (2 MOST_TOUCHED,) triangles that a tentative change takes away
    forms: np.ndarray  # (2 MOST_TOUCHED, 12) sides and planes of those that would come, see _enter_form
    saved: np.ndarray  # (10 MOST_TOUCHED,) what the records held before
    tally: np.ndarray  # numbers of things, see the names above
    amount: np.ndarray  # errors, see the names above


@inner(inline=True)
def _turn(xy: np.ndarray, a: int, b: int, c: int, exact_area: float) -> int:
    """Sign of the area of vertices (a, b, c)."""
    x = xy[2 * c]
    y = xy[2 * c + 1]
    return orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, exact_area)


@inner
def _ghost_conflict(xy: np.ndarray, a: int, b: int, q: int, exact_area: float) -> bool:
    """Whether q lies beyond the hull edge with exterior left of a -> b, or inside that edge."""
    sign = _turn(xy, a, b, q, exact_area)
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
        return _turn(xy, q, b, c, exact_area) > 0
    if last == b:
        return _turn(xy, a, q, c, exact_area) > 0
    return _turn(xy, a, b, q, exact_area) > 0


@inner(inline=True)
def _conflict(xy: np.ndarray, a: int, b: int, c: int, q: int, exact_area: float, exact_lift: float) -> bool:
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
def _cavity(
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
        if _conflict(xy, mesh[s], mesh[s + 1], mesh[s + 2], p, exact_area, exact_lift):
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
def _fill(
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
            good = _turn(xy, a, b, c, exact_area) > 0
        if good:
            for q in range(left):
                if q != before and q != i and q != after:
                    if _conflict(xy, a, b, c, ring[q], exact_area, exact_lift):
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
def weighed_cost(g: Ground, d: float, i: int) -> float:
    """Return what vertex i adds to the total where d_p = d, if that is not d itself (``g.weighed``)."""
    if g.squared:
        d *= d
    return d * g.weight[i] if len(g.weight) > 0 else d


@inner(inline=True)
def deviation_in(xy: np.ndarray, z: np.ndarray, a: int, b: int, c: int, i: int) -> float:
    """d_p of vertex i on the plane of triangle (a, b, c)."""
    ax = xy[2 * a]
    ay = xy[2 * a + 1]
    ux = xy[2 * b] - ax
    uy = xy[2 * b + 1] - ay
    vx = xy[2 * c] - ax
    vy = xy[2 * c + 1] - ay
    dx = xy[2 * i] - ax
    dy = xy[2 * i + 1] - ay
    area = ux * vy - uy * vx
    wb = dx * vy - dy * vx
    wc = dy * ux - dx * uy
    return abs(((area - wb - wc) * z[a] + wb * z[b] + wc * z[c]) / area - z[i])


@inner(inline=True)
def _is_inside(g: Ground, a: int, b: int, c: int) -> bool:
    """Whether the footprint holds the centroid of (a, b, c)."""
    if g.side == 0:
        return True
    xy = g.xy
    x3 = sum_of_three(xy[2 * a], xy[2 * b], xy[2 * c])
    y3 = sum_of_three(xy[2 * a + 1], xy[2 * b + 1], xy[2 * c + 1])
    return inside(xy, g.side, g.state, g.start, g.items, g.faces, x3, y3)


@inner(inline=True)
def _is_thin(g: Ground, a: int, b: int, c: int) -> bool:
    xy = g.xy
    ux = xy[2 * b] - xy[2 * a]
    uy = xy[2 * b + 1] - xy[2 * a + 1]
    vx = xy[2 * c] - xy[2 * a]
    vy = xy[2 * c + 1] - xy[2 * a + 1]
    area = ux * vy - uy * vx
    # A generous first look; the exact rule, the same for all rotations, decides about those that are left.
    return area * area < 16.0 * g.min_height * g.min_height * (ux * ux + uy * uy + vx * vx + vy * vy)


# ------------------------------------------------------------------------------------------ the outline's books
#
# Each access to an array of ``live`` costs a counted reference, so what runs often takes the arrays it needs as locals.


@inner(inline=True)
def _slot(h: int) -> int:
    return (h >> 3) * 3 + (h & 3)


@inner
def _set_segment(live: Live, h: int, wanted: bool) -> None:
    """Make halfedge h an outline segment, or no longer one."""
    count = live.tally
    s = live.segment_of[_slot(h)]
    if wanted and s < 0:
        if count[N_FREE_SEGMENTS] > 0:
            count[N_FREE_SEGMENTS] -= 1
            s = live.free_segment[count[N_FREE_SEGMENTS]]
        else:
            s = count[N_SEGMENTS_EVER]
            count[N_SEGMENTS_EVER] += 1
        live.segment_of[_slot(h)] = s
        live.segment[s] = h
        live.segment_at[s] = count[N_SEGMENTS]
        live.alive[count[N_SEGMENTS]] = s
        count[N_SEGMENTS] += 1
        live.added[count[N_ADDED]] = s
        count[N_ADDED] += 1
    elif not wanted and s >= 0:
        live.segment_of[_slot(h)] = -1
        live.segment[s] = NONE
        count[N_SEGMENTS] -= 1
        moved = live.alive[count[N_SEGMENTS]]
        live.alive[live.segment_at[s]] = moved
        live.segment_at[moved] = live.segment_at[s]
        live.dead[count[N_DEAD]] = s
        count[N_DEAD] += 1


@inner
def _forget_bare(live: Live, i: int) -> None:
    at = live.bare_at[i]
    if at < 0:
        return
    live.tally[N_BARE] -= 1
    last = live.bare[live.tally[N_BARE]]
    live.bare[at] = last
    live.bare_at[last] = at
    live.bare_at[i] = -1
    live.amount[BARE_ERROR] -= live.cost[i]


@inner
def _note_bare(live: Live, i: int) -> None:
    if live.bare_at[i] >= 0:
        return
    live.bare_at[i] = live.tally[N_BARE]
    live.bare[live.tally[N_BARE]] = i
    live.tally[N_BARE] += 1
    live.bare_segment[i] = -1
    live.cost[i] = 0.0


@inner(inline=True)
def _gap(xy: np.ndarray, mesh: np.ndarray, h: int, x: float, y: float) -> float:
    """Squared distance in the plane from (x, y) to halfedge h."""
    a = mesh[h]
    b = mesh[(h & TRIANGLE) + ((h & 3) + 1) % 3]
    ax = xy[2 * a]
    ay = xy[2 * a + 1]
    ex = xy[2 * b] - ax
    ey = xy[2 * b + 1] - ay
    u = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
    u = min(max(u, 0.0), 1.0)
    dx = ax + u * ex - x
    dy = ay + u * ey - y
    return dx * dx + dy * dy


@inner
def _key(mesh: np.ndarray, h: int) -> int:
    """Rank of segment h among equally near ones: that of its triangle in the written mesh, then its side."""
    t = h & TRIANGLE
    least = 0
    if mesh[t + 1] < mesh[t]:
        least = 1
    if mesh[t + 2] < mesh[t + least]:
        least = 2
    a = np.int64(mesh[t + least])
    b = np.int64(mesh[t + (least + 1) % 3])
    return (a << 33) | (b << 2) | (((h & 3) - least + 3) % 3)


@inner
def _bare_cost(xy: np.ndarray, z: np.ndarray, mesh: np.ndarray, h: int, i: int, unit: float, nearest: bool) -> float:
    """d_p of a bare vertex i whose nearest segment is halfedge h."""
    t = h & TRIANGLE
    a = mesh[h]
    b = mesh[t + ((h & 3) + 1) % 3]
    c = mesh[t + ((h & 3) + 2) % 3]
    ux = xy[2 * b] - xy[2 * a]
    uy = xy[2 * b + 1] - xy[2 * a + 1]
    vx = xy[2 * c] - xy[2 * a]
    vy = xy[2 * c + 1] - xy[2 * a + 1]
    dx = xy[2 * i] - xy[2 * a]
    dy = xy[2 * i + 1] - xy[2 * a + 1]
    area = ux * vy - uy * vx
    wb = (dx * vy - dy * vx) / area
    wc = (dy * ux - dx * uy) / area
    wa = 1.0 - wb - wc
    if wa >= -COVER_TOLERANCE and wb >= -COVER_TOLERANCE and wc >= -COVER_TOLERANCE:
        return abs(wa * z[a] + wb * z[b] + wc * z[c] - z[i])
    if not nearest:
        return 0.0
    u = min(max((dx * ux + dy * uy) / (ux * ux + uy * uy), 0.0), 1.0)
    ex = u * ux - dx
    ey = u * uy - dy
    dz = (1.0 - u) * z[a] + u * z[b] - z[i]
    return np.sqrt((ex * ex + ey * ey) * unit * unit + dz * dz)


@inner
def _settle_bare(g: Ground, live: Live) -> None:
    """Give the bare vertices their nearest segment again, where segments came, went or a vertex is new."""
    xy = g.xy
    mesh = live.mesh
    segment = live.segment
    bare_segment = live.bare_segment
    bare_gap = live.bare_gap
    added = live.added
    alive = live.alive
    n_added = live.tally[N_ADDED]
    n_alive = live.tally[N_SEGMENTS]
    for n in range(live.tally[N_BARE]):
        i = live.bare[n]
        x = xy[2 * i]
        y = xy[2 * i + 1]
        before = bare_segment[i]
        best = before
        gap = bare_gap[i]
        if best < 0 or segment[best] == NONE:
            # Its segment went: look at all.
            best = -1
            gap = np.inf
            for q in range(n_alive):
                s = alive[q]
                d = _gap(xy, mesh, segment[s], x, y)
                if d < gap or (d == gap and best >= 0 and _key(mesh, segment[s]) < _key(mesh, segment[best])):
                    best = s
                    gap = d
        else:
            for q in range(n_added):
                s = added[q]
                if segment[s] != NONE:
                    d = _gap(xy, mesh, segment[s], x, y)
                    if d < gap or (d == gap and _key(mesh, segment[s]) < _key(mesh, segment[best])):
                        best = s
                        gap = d
        if best != before or before < 0:
            bare_segment[i] = best
            bare_gap[i] = gap
            cost = _bare_cost(xy, g.z, mesh, segment[best], i, g.unit, g.nearest) if best >= 0 else 0.0
            if g.weighed:
                cost = weighed_cost(g, cost, i)
            live.amount[BARE_ERROR] += cost - live.cost[i]
            live.cost[i] = cost


# ------------------------------------------------------------------------------------------------ operations


@inner
def _collect(live: Live, triangles: np.ndarray, n: int) -> None:
    """Take triangles out of the books: their vertices into the pool, their errors, their segments."""
    count = live.tally
    kind = live.kind
    head = live.head
    following = live.following
    pool = live.pool
    mesh = live.mesh
    used = live.used
    touched = live.touched
    segment_of = live.segment_of
    n_pool = count[N_POOL]
    n_touched = count[N_TOUCHED]
    for q in range(n):
        t = triangles[q]
        r = t >> 3
        emitted = (kind[r] & EMITTED) != 0
        i = head[r]
        while i >= 0:
            pool[n_pool] = i
            n_pool += 1
            if not emitted:
                _forget_bare(live, i)
            i = following[i]
        head[r] = -1
        kind[r] = 0
        if emitted:
            live.amount[COVERED_ERROR] -= live.subtotal[r]
            live.subtotal[r] = 0.0
            count[N_EMITTED] -= 1
            for k in range(3):
                v = mesh[t + k]
                used[v] -= 1
                touched[n_touched] = v
                n_touched += 1
                if segment_of[_slot(t + k)] >= 0:
                    _set_segment(live, t + k, False)
    count[N_POOL] = n_pool
    count[N_TOUCHED] = n_touched


@inner
def _settle_thin(live: Live, seed: int) -> None:
    """Decide for the chain of thin triangles around ``seed`` whether it is peeled: whether it reaches the outside."""
    mesh = live.mesh
    kind = live.kind
    if kind[seed >> 3] & VISITED:
        return
    n = 1
    live.stack[0] = seed
    kind[seed >> 3] |= VISITED
    reaches = False
    k = 0
    while k < n:
        t = live.stack[k]
        k += 1
        for e in range(3):
            s = mesh[t + 4 + e] & TRIANGLE
            if (mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX:
                reaches = True
            elif (kind[s >> 3] & (THIN | VISITED)) == THIN:
                kind[s >> 3] |= VISITED
                live.stack[n] = s
                n += 1
    for k in range(n):
        t = live.stack[k]
        bits = kind[t >> 3] & ~VISITED
        if ((bits & PEELED) != 0) != reaches:
            in_region = False
            for q in range(live.tally[N_REGION]):
                in_region = in_region or live.region[q] == t
            if not in_region:
                live.region[live.tally[N_REGION]] = t
                _collect(live, live.region[live.tally[N_REGION] :], 1)
                live.tally[N_REGION] += 1
            bits = (bits | PEELED) if reaches else (bits & ~PEELED)
        kind[t >> 3] = bits
    # Only now may the emitted bit follow: _collect has read it.
    for k in range(n):
        t = live.stack[k]
        bits = kind[t >> 3]
        kind[t >> 3] = (bits | EMITTED) if (bits & (INSIDE | PEELED)) == INSIDE else (bits & ~EMITTED)


@inner
def _settle(g: Ground, live: Live, half: bool) -> None:
    """Enter the triangles of the region into the books and place the pooled vertices.

    With ``half`` a second operation follows at once, which settles the bare vertices of both.
    """
    xy = g.xy
    z = g.z
    mesh = live.mesh
    kind = live.kind
    count = live.tally
    region = live.region
    head = live.head
    subtotal = live.subtotal
    place = live.place
    used = live.used
    touched = live.touched
    segment_of = live.segment_of
    pool = live.pool
    following = live.following
    amount = live.amount
    weighed = g.weighed
    any_thin = False
    for q in range(count[N_REGION]):
        t = region[q]
        a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
        if (a | b | c) > LAST_INDEX:
            kind[t >> 3] = 0
            continue
        bits = PLAIN if _is_inside(g, a, b, c) else 0
        if _is_thin(g, a, b, c) and is_sliver(xy, mesh, t, g.min_height):
            bits |= THIN
        kind[t >> 3] = bits
    for q in range(count[N_REGION]):
        t = region[q]
        any_thin = any_thin or (kind[t >> 3] & THIN) != 0
        for k in range(3):
            any_thin = any_thin or (kind[mesh[t + 4 + k] >> 3] & THIN) != 0
    if any_thin:
        n_first = count[N_REGION]
        for q in range(n_first):
            t = region[q]
            if kind[t >> 3] & THIN:
                _settle_thin(live, t)
            for k in range(3):
                s = mesh[t + 4 + k] & TRIANGLE
                if kind[s >> 3] & THIN:
                    _settle_thin(live, s)
    for q in range(count[N_REGION]):
        t = region[q]
        head[t >> 3] = -1
        subtotal[t >> 3] = 0.0
        emitted = (kind[t >> 3] & EMITTED) != 0
        for k in range(3):
            v = mesh[t + k]
            if v <= LAST_INDEX:
                place[v] = t
                if emitted:
                    used[v] += 1
                    touched[count[N_TOUCHED]] = v
                    count[N_TOUCHED] += 1
        if emitted:
            count[N_EMITTED] += 1
    for q in range(count[N_REGION]):
        t = region[q]
        mine = (kind[t >> 3] & EMITTED) != 0
        for k in range(3):
            h = mesh[t + 4 + k]
            theirs = (kind[h >> 3] & EMITTED) != 0
            if (segment_of[_slot(t + k)] >= 0) != (mine and not theirs):
                _set_segment(live, t + k, mine and not theirs)
            if (segment_of[_slot(h)] >= 0) != (theirs and not mine):
                _set_segment(live, h, theirs and not mine)
    # The pooled vertices, each to the triangle that holds it (exactly), else to a ghost that it sees.
    t = region[0] if count[N_REGION] > 0 else 0
    for n in range(count[N_POOL]):
        i = pool[n]
        found = False
        for q in range(-1, count[N_REGION]):
            s = t if q < 0 else region[q]
            a, b, c = mesh[s], mesh[s + 1], mesh[s + 2]
            if (a | b | c) > LAST_INDEX:
                continue
            if (
                _turn(xy, a, b, i, g.exact_area) >= 0
                and _turn(xy, b, c, i, g.exact_area) >= 0
                and _turn(xy, c, a, i, g.exact_area) >= 0
            ):
                t = s
                found = True
                break
        if not found:
            t = locate(xy, mesh, t, xy[2 * i], xy[2 * i + 1], g.exact_area)
        r = t >> 3
        place[i] = t
        following[i] = head[r]
        head[r] = i
        if kind[r] & EMITTED:
            d = deviation_in(xy, z, mesh[t], mesh[t + 1], mesh[t + 2], i)
            if weighed:
                d = weighed_cost(g, d, i)
            subtotal[r] += d
            amount[COVERED_ERROR] += d
        else:
            _note_bare(live, i)
    for n in range(count[N_TOUCHED]):
        v = touched[n]
        if live.site[v]:
            if used[v] == 0:
                _note_bare(live, v)
            else:
                _forget_bare(live, v)
    count[N_REGION] = 0
    count[N_POOL] = 0
    count[N_TOUCHED] = 0
    if half:
        return
    _settle_bare(g, live)
    for n in range(count[N_DEAD]):
        live.free_segment[count[N_FREE_SEGMENTS]] = live.dead[n]
        count[N_FREE_SEGMENTS] += 1
    count[N_DEAD] = 0
    count[N_ADDED] = 0
    whole = amount[COVERED_ERROR] + amount[BARE_ERROR]
    if whole > amount[PEAK]:
        amount[PEAK] = whole
    elif whole < RETAKEN_BELOW * amount[PEAK]:
        _retake(live)


@inner
def _retake(live: Live) -> None:
    """Add up the costs anew: of the emitted triangles, and of the bare vertices."""
    amount = live.amount
    amount[COVERED_ERROR] = 0.0
    amount[BARE_ERROR] = 0.0
    for r in range(live.tally[END] >> 3):
        if live.kind[r] & EMITTED:
            amount[COVERED_ERROR] += live.subtotal[r]
    for n in range(live.tally[N_BARE]):
        amount[BARE_ERROR] += live.cost[live.bare[n]]
    amount[PEAK] = amount[COVERED_ERROR] + amount[BARE_ERROR]


@inner(inline=True)
def _new_record(live: Live) -> int:
    count = live.tally
    if count[N_FREE] > 0:
        count[N_FREE] -= 1
        return live.free[count[N_FREE]]
    t = count[END]
    count[END] += RECORD
    return t


@inner
def _insert(g: Ground, live: Live, p: int, half: bool) -> None:
    """Insert vertex p; ``half`` as in :func:`_settle`."""
    mesh = live.mesh
    count = live.tally
    t0 = live.place[p]
    n_cavity, n_rim = _cavity(g.xy, mesh, t0, p, live.cavity, live.rim, live.stack, g.exact_area, g.exact_lift)
    _collect(live, live.cavity, n_cavity)
    # p itself leaves the pool: it is a site now.
    n = 0
    for q in range(count[N_POOL]):
        if live.pool[q] != p:
            live.pool[n] = live.pool[q]
            n += 1
    count[N_POOL] = n
    _forget_bare(live, p)
    live.site[p] = 1
    live.used[p] = 0
    count[N_SITES] += 1
    live.touched[count[N_TOUCHED]] = p
    count[N_TOUCHED] += 1
    for k in range(n_rim):
        live.region[k] = live.cavity[k] if k < n_cavity else _new_record(live)
    count[N_REGION] = n_rim
    # The rim's vertices are read before any record is written over.
    for k in range(n_rim):
        h = live.rim[k]
        live.ring[k] = mesh[(h & TRIANGLE) + ((h & 3) + 1) % 3]
    for k in range(n_rim):
        t = live.region[k]
        after = live.region[k + 1 if k + 1 < n_rim else 0]
        mesh[t] = live.ring[k]
        mesh[t + 1] = live.ring[k + 1 if k + 1 < n_rim else 0]
        mesh[t + 2] = p
        h = live.rim[k]
        mesh[t + 4] = h
        mesh[h + 4] = t
        mesh[t + 5] = after + 2
        mesh[after + 6] = t + 1
    _settle(g, live, half)


@inner
def _remove(g: Ground, live: Live, p: int, half: bool) -> bool:
    """Remove site p; ``half`` as in :func:`_settle`."""
    mesh = live.mesh
    count = live.tally
    m = triangles_around(mesh, live.place[p], p, live.cavity, live.rim, live.ring)
    n_ears = _fill(g.xy, live.ring, m, live.edge, live.ears, live.ear_edges, g.exact_area, g.exact_lift)
    if n_ears == 0 or count[N_SITES] <= 3:
        return False
    # All others on one line: neither the ears nor what lies beyond the ring is a triangle.
    solid = False
    for k in range(n_ears):
        solid = solid or (live.ears[k, 0] | live.ears[k, 1] | live.ears[k, 2]) <= LAST_INDEX
    for k in range(m):
        t = live.rim[k] & TRIANGLE
        solid = solid or (mesh[t] | mesh[t + 1] | mesh[t + 2]) <= LAST_INDEX
    if not solid:
        return False
    _collect(live, live.cavity, m)
    live.pool[count[N_POOL]] = p
    count[N_POOL] += 1
    _forget_bare(live, p)
    live.site[p] = 0
    count[N_SITES] -= 1
    for k in range(n_ears):
        live.region[k] = live.cavity[k]
    count[N_REGION] = n_ears
    for k in range(n_ears, m):
        live.free[count[N_FREE]] = live.cavity[k]
        count[N_FREE] += 1
        t = live.cavity[k]
        # An unused record is a ghost to whoever scans the records.
        mesh[t] = INFINITE
        mesh[t + 1] = INFINITE
        mesh[t + 2] = INFINITE
    for k in range(n_ears):
        t = live.region[k]
        for e in range(3):
            mesh[t + e] = live.ears[k, e]
            side = live.ear_edges[k, e]
            if side < m:
                h = live.rim[side]
                mesh[t + e + 4] = h
                mesh[h + 4] = t + e
            elif side < m + k:
                h = live.region[side - m] + 2
                mesh[t + e + 4] = h
                mesh[h + 4] = t + e
    _settle(g, live, half)
    return True


@inner(inline=True)
def _total(live: Live) -> float:
    if live.tally[N_EMITTED] == 0:
        return np.inf
    return live.amount[COVERED_ERROR] + live.amount[BARE_ERROR]


@answers(moves.exchange, Ground)
@inner(inline=True)
def exchange(g: Ground, live: Live, v: int, w: int) -> bool:
    """Remove site v and insert vertex w, either of them -1 for none; return False if v cannot go, with nothing changed.

    The position of w must be free. Cheaper than the two operations where vertices are bare.
    """
    if w < 0:  # a case of its own: thinning takes a fifth longer where the last argument below is not a constant
        return v < 0 or _remove(g, live, v, False)
    if v >= 0 and not _remove(g, live, v, True):
        return False
    _insert(g, live, w, False)
    return True


@inner
def _done_and_undone(g: Ground, live: Live, v: int, w: int) -> tuple[float, int]:
    before = _total(live)
    n = live.tally[N_EMITTED]
    amount = live.amount
    covered, bare, peak = amount[COVERED_ERROR], amount[BARE_ERROR], amount[PEAK]
    amount[PEAK] = 0.0  # nothing is added up anew for a mere trial
    if not exchange(g, live, v, w):
        amount[PEAK] = peak
        return np.inf, 0
    change = _total(live) - before
    n = live.tally[N_EMITTED] - n
    amount[PEAK] = 0.0
    exchange(g, live, w, v)
    # the sums are what they were, without the rounding of having come and gone
    amount[COVERED_ERROR] = covered
    amount[BARE_ERROR] = bare
    amount[PEAK] = peak
    return change, n


@answers(moves.try_exchange, Ground)
@inner(inline=True)
def try_exchange(g: Ground, live: Live, v: int, w: int, limit: float) -> tuple[float, int]:
    """Return the change of cost and of the number of triangles if site v went and vertex w came; -1 means none.

    Infinite where v cannot go, and where the change is found to exceed ``limit`` before it is known.
    """
    change, triangles = _try_inside(g, live, v, w, limit)
    if np.isnan(change):
        return _done_and_undone(g, live, v, w)
    return change, triangles


@inner
def _enter_form(
    xy: np.ndarray, z: np.ndarray, a: int, b: int, c: int, x0: float, y0: float, forms: np.ndarray, k: int
) -> None:
    """Write the sides of triangle (a, b, c), >= 0 inside, and its plane as linear forms in (x - x0, y - y0, 1)."""
    ax, ay = xy[2 * a] - x0, xy[2 * a + 1] - y0
    bx, by = xy[2 * b] - x0, xy[2 * b + 1] - y0
    cx, cy = xy[2 * c] - x0, xy[2 * c + 1] - y0
    forms[k, 0] = ay - by
    forms[k, 1] = bx - ax
    forms[k, 2] = ax * by - ay * bx
    forms[k, 3] = by - cy
    forms[k, 4] = cx - bx
    forms[k, 5] = bx * cy - by * cx
    forms[k, 6] = cy - ay
    forms[k, 7] = ax - cx
    forms[k, 8] = cx * ay - cy * ax
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    rise_b = (z[b] - z[a]) / area
    rise_c = (z[c] - z[a]) / area
    forms[k, 9] = forms[k, 6] * rise_b + forms[k, 0] * rise_c
    forms[k, 10] = forms[k, 7] * rise_b + forms[k, 1] * rise_c
    forms[k, 11] = z[a] + forms[k, 8] * rise_b + forms[k, 2] * rise_c


@inner(inline=True)
def _inward(forms: np.ndarray, k: int, x: float, y: float) -> float:
    """How far inside triangle k (x, y) lies, twice the least area with a side; negative outside."""
    return min(
        forms[k, 0] * x + forms[k, 1] * y + forms[k, 2],
        min(forms[k, 3] * x + forms[k, 4] * y + forms[k, 5], forms[k, 6] * x + forms[k, 7] * y + forms[k, 8]),
    )


@inner(inline=True)
def _may_go(mesh: np.ndarray, kind: np.ndarray, segment_of: np.ndarray, t: int, n_bare: int) -> int:
    """Say whether triangle t can be replaced without a look at the outline: 1 emitted, 0 a ghost, -1 no."""
    if n_bare > 0:
        for e in range(3):
            if segment_of[_slot(t + e)] >= 0:
                return -1
    if kind[t >> 3] == PLAIN:
        return 1
    return 0 if n_bare == 0 and (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX else -1


@inner(inline=True)
def _replaced(live: Live, n_star: int, n_ears: int, w: int, g: Ground) -> tuple[int, int]:
    """List the triangles in conflict with w once the ears have replaced the star; as :func:`_cavity`.

    The ears stand in the star's records (``gone``) only meanwhile. ``ring`` gets the rim's vertices.
    """
    mesh = live.mesh
    gone = live.gone
    rim = live.rim
    saved = live.saved
    ears = live.ears
    ear_edges = live.ear_edges
    t0 = np.int64(live.place[w])
    among = False
    for k in range(n_star):
        among = among or gone[k] == t0
        saved[8 * MOST_TOUCHED + k] = rim[k]
        saved[9 * MOST_TOUCHED + k] = mesh[rim[k] + 4]
        for e in range(8):
            saved[8 * k + e] = mesh[gone[k] + e]
    for k in range(n_ears):
        t = gone[k]
        for e in range(3):
            mesh[t + e] = ears[k, e]
            side = ear_edges[k, e]
            if side < n_star + k:
                h = np.int64(rim[side]) if side < n_star else gone[side - n_star] + 2
                mesh[t + e + 4] = h
                mesh[h + 4] = t + e
    if among:
        for k in range(n_ears):
            t0 = gone[k]
            if _conflict(g.xy, mesh[t0], mesh[t0 + 1], mesh[t0 + 2], w, g.exact_area, g.exact_lift):
                break
    n_cavity, n_rim = _cavity(g.xy, mesh, t0, w, live.cavity, rim, live.stack, g.exact_area, g.exact_lift)
    for k in range(n_rim):
        h = rim[k]
        live.ring[k] = mesh[(h & TRIANGLE) + ((h & 3) + 1) % 3]
    for k in range(n_star):
        for e in range(8):
            mesh[gone[k] + e] = saved[8 * k + e]
    for k in range(n_star):
        mesh[saved[8 * MOST_TOUCHED + k] + 4] = saved[9 * MOST_TOUCHED + k]
    return n_cavity, n_rim


@inner
def _try_inside(g: Ground, live: Live, v: int, w: int, limit: float) -> tuple[float, int]:
    """As :func:`try_exchange`, but nan where the outline is touched so that bare vertices may change."""
    unknown = (np.nan, 0)
    xy = g.xy
    z = g.z
    mesh = live.mesh
    kind = live.kind
    segment_of = live.segment_of
    cavity = live.cavity
    ears = live.ears
    ring = live.ring
    gone = live.gone
    subtotal = live.subtotal
    n_bare = live.tally[N_BARE]
    n_star = 0
    n_ears = 0
    n_emitted = 0
    change = 0.0
    if v >= 0:
        n_star = triangles_around(mesh, live.place[v], v, cavity, live.rim, ring)
        if n_star > MOST_TOUCHED:
            return unknown
        for k in range(n_star):
            t = np.int64(cavity[k])
            emitted = _may_go(mesh, kind, segment_of, t, n_bare)
            if emitted < 0:
                return unknown
            gone[k] = t
            if emitted:
                n_emitted += 1
                change -= subtotal[t >> 3]
        n_ears = _fill(xy, ring, n_star, live.edge, ears, live.ear_edges, g.exact_area, g.exact_lift)
        if n_ears == 0:
            return unknown
    n_gone = n_star
    n_cavity = 0
    n_rim = 0
    if w >= 0:
        n_cavity, n_rim = _replaced(live, n_star, n_ears, w, g)
        if n_star + n_cavity > 2 * MOST_TOUCHED or n_ears + n_rim > 2 * MOST_TOUCHED:
            return unknown
        for k in range(n_cavity):
            t = np.int64(cavity[k])
            ear = -1
            for q in range(n_star):
                if gone[q] == t:
                    ear = q
            if ear >= 0:
                # An ear that goes again; the mark is that two of its corners are one.
                ears[ear, 1] = ears[ear, 0]
                continue
            emitted = _may_go(mesh, kind, segment_of, t, n_bare)
            if emitted < 0:
                return unknown
            gone[n_gone] = t
            n_gone += 1
            if emitted:
                n_emitted += 1
                change -= subtotal[t >> 3]
    forms = live.forms
    x0 = xy[2 * max(v, w)]
    y0 = xy[2 * max(v, w) + 1]
    n = 0
    for k in range(n_rim + n_ears):
        if k < n_rim:
            a, b, c = np.int64(ring[k]), np.int64(ring[k + 1 if k + 1 < n_rim else 0]), np.int64(w)
        else:
            a, b, c = np.int64(ears[k - n_rim, 0]), np.int64(ears[k - n_rim, 1]), np.int64(ears[k - n_rim, 2])
        if a == b or (a | b | c) > LAST_INDEX:
            continue
        if _is_thin(g, a, b, c) or not _is_inside(g, a, b, c):
            return unknown
        _enter_form(xy, z, a, b, c, x0, y0, forms, n)
        n += 1
    if n == 0:
        return unknown
    head = live.head
    following = live.following
    weighed = g.weighed
    best = 0
    for k in range(-1, n_gone):
        # The vertices of the triangles that go, and v itself.
        i = np.int64(v) if k < 0 else np.int64(head[gone[k] >> 3])
        while i >= 0:
            if i != w:
                x = xy[2 * i] - x0
                y = xy[2 * i + 1] - y0
                most = _inward(forms, best, x, y)
                if most < 0.0:
                    for q in range(n):
                        amount = _inward(forms, q, x, y)
                        if amount > most:
                            most = amount
                            best = q
                            if most >= 0.0:
                                break
                    if most < -1e-15:
                        return unknown
                d = abs(forms[best, 9] * x + forms[best, 10] * y + forms[best, 11] - z[i])
                change += weighed_cost(g, d, i) if weighed else d
            i = np.int64(following[i]) if k >= 0 else np.int64(-1)
        if change > limit:
            return np.inf, 0
    return change, n - n_emitted


@entry
def _build(
    ground: Ground, books: Live, sites: np.ndarray, site_xy: np.ndarray, first: np.ndarray, inserted: np.ndarray
) -> bool:
    """Triangulate the sites from scratch and enter everything into the books."""
    g = borrowed(ground)
    live = borrowed(books)
    mesh = live.mesh
    count = live.tally
    end = triangulate(site_xy, len(sites), first, np.empty(0, np.int64), inserted, mesh, g.exact_area, g.exact_lift)
    if end == 0:
        return False
    count[:] = 0
    live.amount[:] = 0.0
    count[END] = end
    count[N_SITES] = len(sites)
    for t in range(0, end, RECORD):
        for k in range(3):
            if mesh[t + k] <= LAST_INDEX:
                mesh[t + k] = sites[mesh[t + k]]
        live.region[t >> 3] = t
    for i in range(len(g.z)):
        live.site[i] = 0
        live.used[i] = 0
        live.bare_at[i] = -1
    for k in range(len(sites)):
        live.site[sites[k]] = 1
    count[N_REGION] = end >> 3
    for s in range(len(live.segment_of)):
        live.segment_of[s] = -1
    live.kind[:] = 0
    # All triangles are the region; the vertices are placed by walking along the curve, faster than by looking at all.
    _settle(g, live, False)
    t = 0
    for i in range(len(g.z)):
        if live.site[i]:
            t = live.place[i]
            continue
        t = locate(g.xy, mesh, t, g.xy[2 * i], g.xy[2 * i + 1], g.exact_area)
        r = t >> 3
        live.place[i] = t
        live.following[i] = live.head[r]
        live.head[r] = i
        if live.kind[r] & EMITTED:
            d = deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i)
            if g.weighed:
                d = weighed_cost(g, d, i)
            live.subtotal[r] += d
            live.amount[COVERED_ERROR] += d
        else:
            _note_bare(live, i)
    for k in range(len(sites)):
        if live.used[sites[k]] == 0:
            _note_bare(live, sites[k])
    _settle_bare(g, live)
    live.amount[PEAK] = live.amount[COVERED_ERROR] + live.amount[BARE_ERROR]
    return True


# ------------------------------------------------------------------------------ answers to the questions of the search


@answers(moves.total_cost, Ground)
@inner(inline=True)
def total_cost(g: Ground, live: Live) -> float:
    """Sum of the costs; inf where there is no mesh."""
    return _total(live)


@answers(moves.n_triangles, Ground)
@inner(inline=True)
def _n_triangles(g: Ground, live: Live) -> int:
    return live.tally[N_EMITTED]


@answers(moves.n_sites, Ground)
@inner(inline=True)
def _n_sites(g: Ground, live: Live) -> int:
    return live.tally[N_SITES]


@answers(moves.is_site, Ground)
@inner(inline=True)
def _is_site(g: Ground, live: Live, v: int) -> bool:
    return live.site[v] != 0


@answers(moves.is_taken, Ground)
@inner
def _is_taken(g: Ground, live: Live, w: int) -> bool:
    """Whether some site has the position of vertex w; those at one position follow each other."""
    xy = g.xy
    site = live.site
    if site[w]:
        return True
    for step in (-1, 1):
        i = w + step
        while 0 <= i < len(g.z) and xy[2 * i] == xy[2 * w] and xy[2 * i + 1] == xy[2 * w + 1]:
            if site[i]:
                return True
            i += step
    return False


@answers(moves.urgency, Ground)
@inner(inline=True)
def _urgency(g: Ground, live: Live, v: int) -> float:
    return live.subtotal[live.place[v] >> 3] if live.bare_at[v] < 0 else live.cost[v]


@answers(moves.sites_around, Ground)
@inner
def _sites_around(g: Ground, live: Live, v: int, found: np.ndarray) -> int:
    m = triangles_around(live.mesh, live.place[v], v, live.cavity, live.rim, live.ring)
    n = 0
    for k in range(m):
        if live.ring[k] <= LAST_INDEX:
            found[n] = np.int64(live.ring[k])
            n += 1
    return n


@answers(moves.n_cells, Ground)
@inner(inline=True)
def _n_cells(g: Ground, live: Live) -> int:
    return live.tally[END] // RECORD


@answers(moves.cells_around, Ground)
@inner
def _cells_around(g: Ground, live: Live, v: int, found: np.ndarray) -> int:
    m = triangles_around(live.mesh, live.place[v], v, live.cavity, live.rim, live.ring)
    for k in range(m):
        found[k] = np.int64(live.cavity[k]) // RECORD
    return m


@inner
def _at_a_corner(xy: np.ndarray, mesh: np.ndarray, t: int, i: int) -> bool:
    """Whether vertex i has the position of a corner of triangle t, where there is no room for it."""
    for k in range(3):
        v = mesh[t + k]
        if v <= LAST_INDEX and xy[2 * v] == xy[2 * i] and xy[2 * v + 1] == xy[2 * i + 1]:
            return True
    return False


@answers(moves.worst_in, Ground)
@inner
def _worst_in(g: Ground, live: Live, cell: int) -> tuple[int, float, float]:
    mesh = live.mesh
    t = cell * RECORD
    worst = -1
    most = 0.0
    emitted = (live.kind[cell] & EMITTED) != 0
    whole = live.subtotal[cell] if emitted else 0.0
    i = live.head[cell]
    while i >= 0:
        if not emitted:
            whole += live.cost[i] if live.bare_segment[i] >= 0 else 1.0
        if _at_a_corner(g.xy, mesh, t, i):
            i = live.following[i]
            continue
        d = live.cost[i]
        if emitted:
            d = deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i)
            if g.weighed:
                d = weighed_cost(g, d, i)
        elif live.bare_segment[i] < 0:
            d = 1.0  # there is no mesh yet; any vertex will do
        if d > most or (d == most and worst >= 0 and i < worst):
            most = d
            worst = i
        i = live.following[i]
    return worst, most, whole


# the same for Python, vertex by vertex


@entry
def exchange_once(g: Ground, live: Live, v: int, w: int) -> bool:
    """Do what :func:`exchange` does, called from Python."""
    return exchange(borrowed(g), borrowed(live), v, w)


@entry
def try_exchange_once(g: Ground, live: Live, v: int, w: int) -> tuple[float, int]:
    """Do what :func:`try_exchange` does without a limit, called from Python."""
    return try_exchange(borrowed(g), borrowed(live), v, w, np.inf)


# ------------------------------------------------------------------------------------------------------------ the books


def make_live(n_vertices: int) -> Live:
    """Return empty books for a model of that size; about 500 N bytes, of which only what is used becomes resident."""
    n = n_vertices + 4
    return Live(
        mesh=np.empty(16 * n, np.uint32),
        kind=np.zeros(2 * n, np.uint8),
        head=np.empty(2 * n, np.int32),
        subtotal=np.empty(2 * n, np.float64),
        following=np.empty(n, np.int32),
        place=np.empty(n, np.uint32),
        cost=np.empty(n, np.float64),
        used=np.empty(n, np.int32),
        site=np.empty(n, np.uint8),
        free=np.empty(2 * n, np.uint32),
        bare_at=np.empty(n, np.int32),
        bare=np.empty(n, np.int32),
        bare_segment=np.empty(n, np.int32),
        bare_gap=np.empty(n, np.float64),
        segment_of=np.empty(6 * n, np.int32),
        segment=np.empty(6 * n, np.uint32),
        segment_at=np.empty(6 * n, np.int32),
        alive=np.empty(6 * n, np.int32),
        free_segment=np.empty(6 * n, np.int32),
        region=np.empty(2 * n, np.uint32),
        pool=np.empty(n, np.int32),
        touched=np.empty(12 * n, np.uint32),
        dead=np.empty(6 * n, np.int32),
        added=np.empty(6 * n, np.int32),
        cavity=np.empty(2 * n, np.uint32),
        rim=np.empty(2 * n, np.uint32),
        ring=np.empty(2 * n, np.uint32),
        stack=np.empty(2 * n + 8, np.uint32),
        edge=np.empty(2 * n, np.int32),
        ears=np.empty((2 * n, 3), np.uint32),
        ear_edges=np.empty((2 * n, 3), np.int32),
        gone=np.empty(2 * MOST_TOUCHED, np.int64),
        forms=np.empty((2 * MOST_TOUCHED, 12), np.float64),
        saved=np.empty(10 * MOST_TOUCHED, np.uint32),
        tally=np.zeros(13, np.int64),
        amount=np.zeros(3, np.float64),
    )


def build(ground: Ground, live: Live, sites: IntArray, name: str) -> None:
    """Fill the books with the triangulation of the sites (rows, ascending, at different positions).

    Raises
    ------
    ValueError
        If they span no triangle; ``name`` is what the message calls the model.
    """
    sites = np.ascontiguousarray(sites, np.int64)
    first = np.searchsorted(sites, ground.corners)
    first = np.where((first < len(sites)) & np.isin(ground.corners, sites), first, -1).astype(np.int64)
    site_xy = np.ascontiguousarray(ground.xy.reshape(-1, 2)[sites]).ravel()
    if len(sites) < 3 or not _build(ground, live, sites, site_xy, first, np.empty(len(sites), np.uint8)):
        raise ValueError(f"{len(sites)} kept vertices of {name} span no triangle; keep more, the corners first")
