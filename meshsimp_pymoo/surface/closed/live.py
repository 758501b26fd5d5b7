"""A closed mesh that lives: insert a vertex, remove one, move one, and know the exact change of the error.

The triangulation of the images changes as that of a height surface does (:mod:`~meshsimp_pymoo.plane.stars`), but
there is no outline: the corners of the hull are pinned, so all triangles are part of the mesh. What a vertex costs
depends on the triangles across the edges of its own too: those *beside* the changed ones are costed again, for the
sides that have changed alone.

Where there are holes, some triangles are no part of the mesh, and a site that no triangle of the mesh uses is in none:
it costs as a vertex does that lies in a hole (see `closed.evaluate`). What lies between parts never changes.

A change that is tried is made in the records of the triangles, every write into which is logged, and taken back; the
lists of the vertices are left as they are.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.conflict import conflict, turn
from meshsimp_pymoo.plane.constraints import constrain
from meshsimp_pymoo.plane.stars import cavity_of, triangles_around
from meshsimp_pymoo.plane.triangulation import (
    INFINITE,
    LAST_INDEX,
    RECORD,
    TRIANGLE,
    locate,
    locate_at_random,
    triangulate,
)
from meshsimp_pymoo.surface import moves
from meshsimp_pymoo.surface.books import COVERED_ERROR as COST
from meshsimp_pymoo.surface.books import LARGEST, PEAK
from meshsimp_pymoo.surface.closed.books import (
    BESIDE,
    CAME,
    END,
    GONE,
    IN_CAVITY,
    LOOKED_AT,
    MOST_TOUCHED,
    N_BESIDE,
    N_CAME,
    N_FREE,
    N_GONE,
    N_IN_MESH,
    N_LOG,
    N_LOOKED_AT,
    N_SHORT,
    N_SITES,
    UNUSED,
    ClosedLive,
)
from meshsimp_pymoo.surface.closed.distance import is_in_mesh, nearer, squared_distance
from meshsimp_pymoo.surface.closed.evaluate import enter_outside, enter_triangle, holder, is_outside, pole_of
from meshsimp_pymoo.surface.closed.ground import ClosedGround
from meshsimp_pymoo.surface.closed.model import LEAST_VERTICES
from meshsimp_pymoo.surface.costs import counts, enter_peak, noted_cost, weighed_cost
from meshsimp_pymoo.surface.live import RETAKEN_BELOW
from meshsimp_pymoo.surface.moves import answers
from meshsimp_pymoo.surface.trial import ears_of

# ----------------------------------------------------------------------------------------------------------- distances


@inner(inline=True)
def _corners(g: ClosedGround, mesh: np.ndarray, t: int, i: int) -> tuple[int, int, int]:
    """Return the vertices of triangle t, at vertex i or beside it; those of its pole where t is outside."""
    if (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX:
        return pole_of(g, i)
    a, b, c = np.int64(mesh[t]), np.int64(mesh[t + 1]), np.int64(mesh[t + 2])
    if is_outside(g.part, a, b, c):
        return pole_of(g, i)
    return a, b, c


@inner
def _enter_square(g: ClosedGround, live: ClosedLive, t: int, side: int, i: int, row: int) -> None:
    """Write how far vertex i of triangle t is from the triangle across a side into a row of ``squares``."""
    xyz = g.xyz
    s = np.int64(live.mesh[t + side + 4]) & TRIANGLE
    a, b, c = _corners(g, live.mesh, s, i)
    live.squares[row, side + 1] = nearer(
        xyz, live.planes, s >> 3, a, b, c, xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2], live.squares[row, 0]
    )


@inner
def _enter_squares(g: ClosedGround, live: ClosedLive, t: int, i: int, row: int) -> None:
    """Write how far vertex i is from triangle t, which holds it, and those across its sides."""
    xyz = g.xyz
    live.squares[row, 0] = np.inf
    if is_in_mesh(live.planes, t >> 3):
        a, b, c = _corners(g, live.mesh, t, i)
        live.squares[row, 0] = squared_distance(xyz, a, b, c, xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2])
    for side in range(3):
        _enter_square(g, live, t, side, i, row)


@inner(inline=True)
def deviation(g: ClosedGround, live: ClosedLive, i: int, row: int) -> float:
    """Return d_p of vertex i, which a row of ``squares`` is about."""
    squares = live.squares
    least = min(min(squares[row, 0], squares[row, 1]), min(squares[row, 2], squares[row, 3]))
    return np.sqrt(least) if least < np.inf or len(g.far) == 0 else g.far[i]


@inner
def _holds(g: ClosedGround, live: ClosedLive, t: int, i: int) -> bool:
    """Whether the image of vertex i belongs to triangle t; see `closed.evaluate` for those on edges."""
    mesh = live.mesh
    for k in range(3):
        a, b = mesh[t + k], mesh[t + (k + 1) % 3]
        side = turn(g.xy, a, b, i, g.exact_area)
        if side < 0:
            return False
        if side == 0 and a > b:
            s = np.int64(mesh[t + k + 4]) & TRIANGLE
            if (mesh[s] | mesh[s + 1] | mesh[s + 2]) <= LAST_INDEX:
                return False
    return True


@inner(inline=True)
def _holder_among_new(g: ClosedGround, live: ClosedLive, guess: int, i: int) -> int:
    """Return which of the triangles that came holds vertex i, its number in their list; ``guess`` is asked first."""
    came = live.came
    if _holds(g, live, np.int64(came[guess]), i):
        return guess
    for q in range(live.tally[N_CAME]):
        if q != guess and _holds(g, live, np.int64(came[q]), i):
            return q
    return -1


# -------------------------------------------------------------------------------------------------------- the triangles


@inner(inline=True)
def write(live: ClosedLive, at: int, value: int, logged: bool) -> None:
    """Write an entry of the records, and with a log what it was."""
    if logged:
        n = live.tally[N_LOG]
        live.log_at[n] = at
        live.log_value[n] = live.mesh[at]
        live.tally[N_LOG] = n + 1
    live.mesh[at] = value


@inner(inline=True)
def link(live: ClosedLive, h: int, twin: int, logged: bool) -> None:
    """Make two halfedges twins."""
    write(live, h + 4, twin, logged)
    write(live, twin + 4, h, logged)


@inner(inline=True)
def _count_use(live: ClosedLive, t: int, change: int) -> None:
    """Count a triangle of the mesh that comes, 1, or goes, -1, at its corners."""
    mesh = live.mesh
    live.tally[N_IN_MESH] += change
    if len(live.uses) > 0:
        for k in range(3):
            live.uses[mesh[t + k]] += change


@inner(inline=True)
def note_gone(live: ClosedLive, t: int, logged: bool) -> None:
    """List a triangle among those that go."""
    n = live.tally[N_GONE]
    if is_in_mesh(live.planes, t >> 3):
        _count_use(live, t, -1)
    live.gone[n] = t
    live.mark[t >> 3] |= GONE
    if logged:
        for k in range(4):
            live.saved[n, k] = live.planes[t >> 3, k]
    live.tally[N_GONE] = n + 1


@inner
def _replace(g: ClosedGround, live: ClosedLive, v: int, w: int, logged: bool) -> bool:
    """Make the triangles that are there once site v has gone and vertex w has come; -1 is none of either.

    What goes, what comes and what stays beside it is listed and marked. Return False, with nothing changed, where v
    cannot go.
    """
    mesh = live.mesh
    tally = live.tally
    cavity, rim, ring = live.cavity, live.rim, live.ring
    gone, came, mark = live.gone, live.came, live.mark
    tally[N_GONE] = 0
    tally[N_CAME] = 0
    tally[N_LOG] = 0
    n_ears = 0
    if v >= 0:
        m = triangles_around(mesh, np.int64(live.place[v]), v, cavity, rim, ring)
        n_ears = ears_of(g, live, v, m)
        if n_ears == 0:
            return False
        for k in range(m):
            note_gone(live, np.int64(cavity[k]), logged)
        for k in range(n_ears):
            t = np.int64(gone[k])
            for e in range(3):
                write(live, t + e, live.ears[k, e], logged)
                side = live.ear_edges[k, e]
                if side < m:
                    link(live, t + e, np.int64(rim[side]), logged)
                elif side < m + k:
                    link(live, t + e, np.int64(gone[side - m]) + 2, logged)
        for k in range(n_ears, m):
            t = np.int64(gone[k])
            live.free[tally[N_FREE]] = t
            tally[N_FREE] += 1
            for e in range(3):  # to whoever scans the records an unused one is a ghost
                write(live, t + e, INFINITE, logged)
    n_cavity = 0
    if w >= 0:
        t0 = np.int64(live.place[w])
        if mark[t0 >> 3] & GONE:
            lined = len(g.lines.at) > 0  # conflict is for those that w sees
            for k in range(n_ears):
                t0 = np.int64(gone[k])
                if (
                    _holds(g, live, t0, w)
                    if lined
                    else conflict(g.xy, mesh[t0], mesh[t0 + 1], mesh[t0 + 2], w, g.exact_area, g.exact_lift)
                ):
                    break
        n_cavity, n_rim = cavity_of(g.xy, mesh, t0, w, cavity, rim, live.stack, g.lines, g.exact_area, g.exact_lift)
        for k in range(n_cavity):
            t = np.int64(cavity[k])
            if not mark[t >> 3] & GONE:
                note_gone(live, t, logged)
            mark[t >> 3] |= IN_CAVITY
        for k in range(n_rim):  # read before any record is written over
            h = np.int64(rim[k])
            ring[k] = mesh[(h & TRIANGLE) + ((h & 3) + 1) % 3]
        for k in range(n_rim):
            if k >= n_cavity:
                if tally[N_FREE] > 0:
                    tally[N_FREE] -= 1
                    cavity[k] = live.free[tally[N_FREE]]
                else:
                    cavity[k] = tally[END]
                    tally[END] += RECORD
            came[k] = cavity[k]
        for k in range(n_rim):
            t = np.int64(came[k])
            after = np.int64(came[k + 1 if k + 1 < n_rim else 0])
            write(live, t, np.int64(ring[k]), logged)
            write(live, t + 1, np.int64(ring[k + 1 if k + 1 < n_rim else 0]), logged)
            write(live, t + 2, w, logged)
            link(live, t, np.int64(rim[k]), logged)
            link(live, t + 1, after + 2, logged)
        tally[N_CAME] = n_rim
    for k in range(n_ears):
        t = np.int64(gone[k])
        if not mark[t >> 3] & IN_CAVITY:
            came[tally[N_CAME]] = t
            tally[N_CAME] += 1
    for k in range(n_cavity):
        mark[np.int64(cavity[k]) >> 3] &= ~IN_CAVITY
    note_came(g, live)
    return True


@inner
def note_came(g: ClosedGround, live: ClosedLive) -> None:
    """Enter the planes of the triangles that came, whose records are written, and list those that stay beside them."""
    mesh, came, mark, tally = live.mesh, live.came, live.mark, live.tally
    tally[N_BESIDE] = 0
    for k in range(tally[N_CAME]):
        mark[np.int64(came[k]) >> 3] |= CAME
    for k in range(tally[N_CAME]):
        t = np.int64(came[k])
        if enter_triangle(g, live.planes, t >> 3, np.int64(mesh[t]), np.int64(mesh[t + 1]), np.int64(mesh[t + 2])):
            _count_use(live, t, 1)
        for e in range(3):
            h = np.int64(mesh[t + e + 4])
            s = h & TRIANGLE
            r = s >> 3
            if mark[r] & CAME or (mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX:
                continue
            if not mark[r] & BESIDE:
                mark[r] |= BESIDE
                live.beside[tally[N_BESIDE]] = s
                tally[N_BESIDE] += 1
                live.sides[r] = 0
            live.sides[r] |= 1 << (h & 3)


@inner
def _unmark(live: ClosedLive) -> None:
    tally = live.tally
    mark = live.mark
    for k in range(tally[N_GONE]):
        mark[np.int64(live.gone[k]) >> 3] = 0
    for k in range(tally[N_CAME]):
        mark[np.int64(live.came[k]) >> 3] = 0
    for k in range(tally[N_BESIDE]):
        mark[np.int64(live.beside[k]) >> 3] = 0


# ------------------------------------------------------------------------------------------------------------ the costs


@inner
def _cost_beside(g: ClosedGround, live: ClosedLive, s: int, i: int, row: int) -> float:
    """Write the row of vertex i of a triangle beside the changed ones anew; return d_p."""
    bits = live.sides[s >> 3]
    for k in range(3):
        if bits & (1 << k):
            _enter_square(g, live, s, k, i, row)
    return deviation(g, live, i, row)


@inner(inline=True)
def _idle_cost(g: ClosedGround, i: int) -> float:
    """Return the cost of a site that no triangle of the mesh uses."""
    d = g.far[i]
    return weighed_cost(g, d, i) if g.weighed else d


@inner
def _tried_idle(g: ClosedGround, live: ClosedLive, v: int) -> float:
    """Return by how much more the sites at the changed triangles cost that no triangle of the mesh uses."""
    idle, uses = live.idle, live.uses
    change = 0.0
    if v >= 0 and idle[v] & UNUSED:
        change -= _idle_cost(g, v)
    for k in range(live.tally[N_CAME]):
        t = np.int64(live.came[k])
        for e in range(3):
            i = np.int64(live.mesh[t + e])
            if idle[i] & LOOKED_AT:
                continue
            idle[i] |= LOOKED_AT
            was = live.site[i] != 0 and idle[i] & UNUSED != 0
            if uses[i] == 0:
                change += noted_cost(g, live, g.far[i], i)
            if was:
                change -= _idle_cost(g, i)
    for k in range(live.tally[N_CAME]):
        t = np.int64(live.came[k])
        for e in range(3):
            idle[np.int64(live.mesh[t + e])] &= UNUSED
    return change


@inner
def _enter_idle(g: ClosedGround, live: ClosedLive, i: int) -> None:
    """Enter whether any triangle of the mesh uses vertex i, if it is a site, and what it costs if none does."""
    idle = live.idle
    is_idle = live.site[i] != 0 and live.uses[i] == 0
    if idle[i] & UNUSED and not is_idle:
        live.amount[COST] -= _idle_cost(g, i)
    elif is_idle and not idle[i] & UNUSED:
        live.amount[COST] += noted_cost(g, live, g.far[i], i)
    idle[i] = UNUSED if is_idle else 0
    if len(live.peaks) > 0:
        enter_peak(live, len(live.head) + i, g.far[i] if is_idle and counts(g, i) else 0.0)


@inner
def tried(g: ClosedGround, live: ClosedLive, v: int, w: int, limit: float) -> float:
    """Return the change of cost by what was noted to go and come, or inf once it is known to exceed the limit."""
    tally = live.tally
    head, following = live.head, live.following
    scratch = len(live.squares) - 1
    change = 0.0
    for k in range(tally[N_GONE]):
        change -= live.subtotal[np.int64(live.gone[k]) >> 3]
    for k in range(tally[N_BESIDE]):
        change -= live.subtotal[np.int64(live.beside[k]) >> 3]
    if len(live.idle) > 0:
        change += _tried_idle(g, live, v)
    q = 0
    for k in range(-1, tally[N_GONE]):
        # the vertices of the triangles that go, and v itself
        i = np.int64(v) if k < 0 else np.int64(head[np.int64(live.gone[k]) >> 3])
        while i >= 0:
            if i != w:
                q = _holder_among_new(g, live, q, i)
                _enter_squares(g, live, np.int64(live.came[q]), i, scratch)
                change += noted_cost(g, live, deviation(g, live, i, scratch), i)
            i = np.int64(following[i]) if k >= 0 else np.int64(-1)
        if change > limit:
            return np.inf
    for k in range(tally[N_BESIDE]):
        s = np.int64(live.beside[k])
        i = np.int64(head[s >> 3])
        while i >= 0:
            for e in range(4):
                live.squares[scratch, e] = live.squares[i, e]
            change += noted_cost(g, live, _cost_beside(g, live, s, i, scratch), i)
            i = np.int64(following[i])
        if change > limit:
            return np.inf
    return change


@inner
def undo(live: ClosedLive, n_free: int, end: int) -> None:
    """Take back what was written into the records, with a log."""
    tally = live.tally
    for k in range(tally[N_CAME]):
        t = np.int64(live.came[k])
        if is_in_mesh(live.planes, t >> 3):
            _count_use(live, t, -1)
    for k in range(tally[N_LOG] - 1, -1, -1):
        live.mesh[live.log_at[k]] = live.log_value[k]
    for k in range(tally[N_GONE]):
        t = np.int64(live.gone[k])
        for e in range(4):
            live.planes[t >> 3, e] = live.saved[k, e]
        if is_in_mesh(live.planes, t >> 3):
            _count_use(live, t, 1)
    _unmark(live)
    tally[N_FREE] = n_free
    tally[END] = end


@inner
def enter(g: ClosedGround, live: ClosedLive, v: int, w: int) -> None:
    """Enter what was noted to go and come into the books."""
    tally = live.tally
    mesh, head, following, place, pool = live.mesh, live.head, live.following, live.place, live.pool
    subtotal, amount = live.subtotal, live.amount
    with_peaks = len(live.peaks) > 0
    n = 0
    if v >= 0:
        live.site[v] = 0
        tally[N_SITES] -= 1
        _count_site(g, live, v, -1)
        pool[n] = v
        n += 1
    for k in range(tally[N_GONE]):
        r = np.int64(live.gone[k]) >> 3
        i = np.int64(head[r])
        while i >= 0:
            if i != w:
                pool[n] = i
                n += 1
            i = np.int64(following[i])
        head[r] = -1
        amount[COST] -= subtotal[r]
        subtotal[r] = 0.0
        if with_peaks and not live.mark[r] & CAME:
            enter_peak(live, r, 0.0)
    if w >= 0:
        live.site[w] = 1
        tally[N_SITES] += 1
        _count_site(g, live, w, 1)
    for k in range(tally[N_CAME]):
        t = np.int64(live.came[k])
        head[t >> 3] = -1
        subtotal[t >> 3] = 0.0
        for e in range(3):
            place[mesh[t + e]] = t
    q = 0
    for k in range(n):
        i = np.int64(pool[k])
        q = _holder_among_new(g, live, q, i)
        t = np.int64(live.came[q])
        r = t >> 3
        _enter_squares(g, live, t, i, i)
        place[i] = t
        following[i] = head[r]
        head[r] = i
        d = noted_cost(g, live, deviation(g, live, i, i), i)
        subtotal[r] += d
        amount[COST] += d
    for k in range(tally[N_BESIDE]):
        s = np.int64(live.beside[k])
        r = s >> 3
        amount[COST] -= subtotal[r]
        subtotal[r] = 0.0
        i = np.int64(head[r])
        while i >= 0:
            subtotal[r] += noted_cost(g, live, _cost_beside(g, live, s, i, i), i)
            i = np.int64(following[i])
        amount[COST] += subtotal[r]
    if len(live.idle) > 0:
        if v >= 0:
            _enter_idle(g, live, v)
        for k in range(tally[N_CAME]):
            t = np.int64(live.came[k])
            for e in range(3):
                _enter_idle(g, live, np.int64(mesh[t + e]))
    if with_peaks:
        for k in range(tally[N_CAME]):
            r = np.int64(live.came[k]) >> 3
            enter_peak(live, r, _peak_in(g, live, r))
        for k in range(tally[N_BESIDE]):
            r = np.int64(live.beside[k]) >> 3
            enter_peak(live, r, _peak_in(g, live, r))
    _unmark(live)
    if amount[COST] > amount[PEAK]:
        amount[PEAK] = amount[COST]
    elif amount[COST] < RETAKEN_BELOW * amount[PEAK]:
        retake(g, live)


@inner
def retake(g: ClosedGround, live: ClosedLive) -> None:
    """Take the sum of the costs again."""
    amount = live.amount
    amount[COST] = 0.0
    for r in range(live.tally[END] >> 3):
        amount[COST] += live.subtotal[r]
    for i in range(len(live.idle)):
        if live.idle[i] & UNUSED:
            amount[COST] += _idle_cost(g, i)
    amount[PEAK] = amount[COST]


@inner(inline=True)
def _count_site(g: ClosedGround, live: ClosedLive, i: int, change: int) -> None:
    """Count a site of a part that comes, 1, or goes, -1."""
    part = np.int64(g.part[i]) if len(g.part) > 0 else np.int64(0)
    n = live.of_part[part] + change
    live.of_part[part] = n
    if n == LEAST_VERTICES - (change < 0):
        live.tally[N_SHORT] -= change


@inner(inline=True)
def may_go(g: ClosedGround, live: ClosedLive, v: int, w: int) -> bool:
    """Whether enough sites are left of the part of v, once it has gone and vertex w has come."""
    if len(g.part) == 0:
        return w >= 0 or live.tally[N_SITES] > LEAST_VERTICES
    return (w >= 0 and g.part[v] == g.part[w]) or live.of_part[g.part[v]] > LEAST_VERTICES


@inner
def _peak_in(g: ClosedGround, live: ClosedLive, r: int) -> float:
    """Return the largest deviation in a triangle, of vertices whose weight is not 0."""
    peak = 0.0
    i = np.int64(live.head[r])
    while i >= 0:
        if counts(g, i):
            peak = max(peak, deviation(g, live, i, i))
        i = np.int64(live.following[i])
    return peak


@inner(inline=True)
def degree(live: ClosedLive, v: int, most: int) -> int:
    """Return the number of triangles at site v, or ``most`` + 1 if there are more than that."""
    mesh = live.mesh
    first = np.int64(live.place[v])
    t = first
    m = 0
    while m <= most:
        k = 0 if mesh[t] == v else (1 if mesh[t + 1] == v else 2)
        t = np.int64(mesh[t + (k + 2) % 3 + 4]) & TRIANGLE
        m += 1
        if t == first:
            break
    return m


# ------------------------------------------------------------------------------ answers to the questions of the search


@inner(inline=True)
def total(live: ClosedLive) -> float:
    """Return the sum of the costs; infinite where a part has too few sites to be a mesh."""
    return live.amount[COST] if live.tally[N_SHORT] == 0 else np.inf


@answers(moves.exchange, ClosedGround)
@inner
def exchange(g: ClosedGround, live: ClosedLive, v: int, w: int) -> bool:
    """Remove site v and insert vertex w, either of them -1 for none; return False if v cannot go."""
    live.amount[LARGEST] = 0.0
    if v >= 0 and not may_go(g, live, v, w):
        return False
    if not _replace(g, live, v, w, False):
        return False
    enter(g, live, v, w)
    return True


@inner
def _done_and_undone(g: ClosedGround, live: ClosedLive, v: int, w: int) -> tuple[float, int]:
    amount = live.amount
    cost, peak, n_before = amount[COST], amount[PEAK], live.tally[N_IN_MESH]
    amount[PEAK] = 0.0  # nothing is added up anew for a mere trial
    if not exchange(g, live, v, w):
        amount[PEAK] = peak
        return np.inf, 0
    change, triangles = amount[COST] - cost, live.tally[N_IN_MESH] - n_before
    largest = amount[LARGEST]
    amount[PEAK] = 0.0
    exchange(g, live, w, v)
    # the sums are what they were, without the rounding of having come and gone
    amount[COST], amount[PEAK], amount[LARGEST] = cost, peak, largest
    return change, triangles


@answers(moves.try_exchange, ClosedGround)
@inner
def try_exchange(g: ClosedGround, live: ClosedLive, v: int, w: int, limit: float) -> tuple[float, int]:
    """Return the change of cost and of the number of triangles if site v went and vertex w came; -1 means none.

    Infinite where v cannot go, and where the change is found to exceed ``limit`` before it is known.
    """
    tally = live.tally
    n_before = tally[N_IN_MESH]
    live.amount[LARGEST] = 0.0
    tally[N_LOOKED_AT] = 0
    if v >= 0:
        if not may_go(g, live, v, w):
            return np.inf, 0
        tally[N_LOOKED_AT] = degree(live, v, MOST_TOUCHED)
        if tally[N_LOOKED_AT] > MOST_TOUCHED:
            tally[N_LOOKED_AT] = degree(live, v, len(live.site))
            return _done_and_undone(g, live, v, w)
    if w >= 0:
        # how many are in conflict with w is known by looking; the star of v makes at most so many more
        n_cavity, _ = cavity_of(
            g.xy,
            live.mesh,
            np.int64(live.place[w]),
            w,
            live.cavity,
            live.rim,
            live.stack,
            g.lines,
            g.exact_area,
            g.exact_lift,
        )
        if n_cavity > MOST_TOUCHED:
            return _done_and_undone(g, live, v, w)
    n_free, end = tally[N_FREE], tally[END]
    if not _replace(g, live, v, w, True):
        return np.inf, 0
    triangles = tally[N_IN_MESH] - n_before
    change = tried(g, live, v, w, limit)
    undo(live, n_free, end)
    return change, triangles


@answers(moves.total_cost, ClosedGround)
@inner(inline=True)
def total_cost(g: ClosedGround, live: ClosedLive) -> float:
    """Sum of the costs; inf where there is no mesh."""
    return total(live)


@answers(moves.error_now, ClosedGround)
@inner(inline=True)
def error_now(g: ClosedGround, live: ClosedLive) -> float:
    """Sum of the costs, or the largest deviation where the books know it; inf where there is no mesh."""
    return live.peaks[1] if len(live.peaks) > 0 and live.tally[N_SHORT] == 0 else total(live)


@answers(moves.ranked, ClosedGround)
@inner(inline=True)
def _ranked(g: ClosedGround, live: ClosedLive, change: float) -> tuple[float, float]:
    if len(live.peaks) > 0:
        return (live.amount[LARGEST], change) if change < np.inf else (change, 0.0)
    return change, live.amount[LARGEST] if g.bound < np.inf else 0.0


@answers(moves.n_triangles, ClosedGround)
@inner(inline=True)
def _n_triangles(g: ClosedGround, live: ClosedLive) -> int:
    return live.tally[N_IN_MESH] if live.tally[N_SHORT] == 0 else 0


@answers(moves.n_sites, ClosedGround)
@inner(inline=True)
def _n_sites(g: ClosedGround, live: ClosedLive) -> int:
    return live.tally[N_SITES]


@answers(moves.is_site, ClosedGround)
@inner(inline=True)
def _is_site(g: ClosedGround, live: ClosedLive, v: int) -> bool:
    return live.site[v] != 0


@answers(moves.is_taken, ClosedGround)
@inner(inline=True)
def _is_taken(g: ClosedGround, live: ClosedLive, w: int) -> bool:
    return live.site[w] != 0  # no two images coincide


@answers(moves.urgency, ClosedGround)
@inner(inline=True)
def _urgency(g: ClosedGround, live: ClosedLive, v: int) -> float:
    return live.subtotal[np.int64(live.place[v]) >> 3]


@answers(moves.sites_around, ClosedGround)
@inner
def sites_around(g: ClosedGround, live: ClosedLive, v: int, found: np.ndarray) -> int:
    """List the ring of v and the tips of the triangles outside it: their stars, or what is beside them, will change."""
    mesh = live.mesh
    m = triangles_around(mesh, np.int64(live.place[v]), v, live.cavity, live.rim, live.ring)
    for k in range(m):
        found[k] = np.int64(live.ring[k])
    n = m
    for k in range(m):
        h = np.int64(live.rim[k])
        tip = np.int64(mesh[(h & TRIANGLE) + ((h & 3) + 2) % 3])
        is_new = tip <= LAST_INDEX
        if m <= MOST_TOUCHED:
            for q in range(n):
                is_new = is_new and found[q] != tip
        if is_new:
            found[n] = tip
            n += 1
    return n


@answers(moves.n_cells, ClosedGround)
@inner(inline=True)
def _n_cells(g: ClosedGround, live: ClosedLive) -> int:
    return live.tally[END] // RECORD


@answers(moves.effort, ClosedGround)
@inner(inline=True)
def _effort(g: ClosedGround, live: ClosedLive) -> int:
    return live.tally[N_LOOKED_AT]


@answers(moves.cells_around, ClosedGround)
@inner
def _cells_around(g: ClosedGround, live: ClosedLive, v: int, found: np.ndarray) -> int:
    """List the triangles at v and those beside them, whose vertices have v's across an edge now."""
    m = triangles_around(live.mesh, np.int64(live.place[v]), v, live.cavity, live.rim, live.ring)
    n = m
    for k in range(m):
        found[k] = np.int64(live.cavity[k]) // RECORD
        s = np.int64(live.rim[k]) & TRIANGLE
        if (live.mesh[s] | live.mesh[s + 1] | live.mesh[s + 2]) <= LAST_INDEX:
            found[n] = s // RECORD
            n += 1
    return n


@answers(moves.worst_in, ClosedGround)
@inner
def _worst_in(g: ClosedGround, live: ClosedLive, cell: int) -> tuple[int, float, float]:
    worst = -1
    most = 0.0
    i = np.int64(live.head[cell])
    while i >= 0:
        d = deviation(g, live, i, i)
        if len(live.peaks) > 0:
            d = d if counts(g, i) else 0.0
        elif g.weighed:
            d = weighed_cost(g, d, i)
        if d > most or (d == most and worst >= 0 and i < worst):
            most = d
            worst = i
        i = np.int64(live.following[i])
    return worst, most, live.subtotal[cell]


# ------------------------------------------------------------------------------------------------------------ the books


@entry
def _build_closed(
    ground: ClosedGround,
    books: ClosedLive,
    sites: np.ndarray,
    site_xy: np.ndarray,
    first: np.ndarray,
    order: np.ndarray,
    inserted: np.ndarray,
) -> bool:
    """Triangulate the sites from scratch and enter everything into the books."""
    g = borrowed(ground)
    live = borrowed(books)
    mesh = live.mesh
    tally = live.tally
    end = triangulate(site_xy, len(sites), first, order, inserted, mesh, g.exact_area, g.exact_lift)
    if end == 0:
        return False
    lined = len(g.lines.at) > 0
    if lined:
        n = len(sites)
        constrain(site_xy, mesh, end, g.lines, sites, n, live.place, g.exact_area, g.exact_lift)
    tally[:] = 0
    live.amount[:] = 0.0
    live.peaks[:] = 0.0
    live.mark[:] = 0
    tally[END] = end
    tally[N_SITES] = len(sites)
    n_all = len(g.xy) // 2
    for i in range(n_all):
        live.site[i] = 0
    live.of_part[:] = 0
    tally[N_SHORT] = len(live.of_part)
    for k in range(len(sites)):
        live.site[sites[k]] = 1
        _count_site(g, live, sites[k], 1)
    live.uses[:] = 0
    live.idle[:] = 0
    tally[N_IN_MESH] = len(live.of_part)
    for k in range(len(g.poles) if len(live.uses) > 0 else 0):
        live.uses[g.poles[k]] = 1
    for t in range(0, end, RECORD):
        for k in range(3):
            if mesh[t + k] <= LAST_INDEX:
                mesh[t + k] = sites[mesh[t + k]]
        live.head[t >> 3] = -1
        live.subtotal[t >> 3] = 0.0
        if (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX:
            enter_outside(g, live.planes, t >> 3)
            continue
        for k in range(3):
            live.place[mesh[t + k]] = t
        if enter_triangle(g, live.planes, t >> 3, np.int64(mesh[t]), np.int64(mesh[t + 1]), np.int64(mesh[t + 2])):
            _count_use(live, t, 1)
    t = np.int64(live.place[sites[0]])
    for i in range(n_all):
        if live.site[i]:
            t = np.int64(live.place[i])
            continue
        if lined:
            t = locate_at_random(g.xy, mesh, t, g.xy[2 * i], g.xy[2 * i + 1], g.exact_area)
        else:
            t = locate(g.xy, mesh, t, g.xy[2 * i], g.xy[2 * i + 1], g.exact_area)
        t = holder(g.xy, mesh, t, g.xy[2 * i], g.xy[2 * i + 1], g.exact_area)
        r = t >> 3
        live.place[i] = t
        live.following[i] = live.head[r]
        live.head[r] = i
        _enter_squares(g, live, t, i, i)
        d = noted_cost(g, live, deviation(g, live, i, i), i)
        live.subtotal[r] += d
        live.amount[COST] += d
    if len(live.peaks) > 0:
        for r in range(end >> 3):
            enter_peak(live, r, _peak_in(g, live, r))
    for k in range(len(sites) if len(live.idle) > 0 else 0):
        _enter_idle(g, live, np.int64(sites[k]))
    live.amount[PEAK] = live.amount[COST]
    return True


def build(ground: ClosedGround, live: ClosedLive, sites: IntArray, name: str) -> None:
    """Fill the books with the mesh of the sites (rows, ascending), those of the pole among them.

    Raises
    ------
    ValueError
        If the pole's are not; ``name`` is what the message calls the model.
    """
    sites = np.ascontiguousarray(sites, np.int64)
    first = np.searchsorted(sites, ground.poles[:3])
    n = len(sites)
    is_there = np.isin(ground.poles, sites).all()
    site_xy = np.ascontiguousarray(ground.xy.reshape(-1, 2)[sites]).ravel()
    order, inserted = np.arange(n), np.empty(n, np.uint8)
    if not is_there or not _build_closed(ground, live, sites, site_xy, first.astype(np.int64), order, inserted):
        raise ValueError(f"{n} kept vertices of {name} lack some of those that are pinned; keep these first")
