"""A triangulation that lives: insert a vertex, remove one, move one, and know the exact change of the error.

Every triangle keeps the list of the original vertices it covers and the sum of their costs. Inserting a vertex replaces
the triangles whose circle holds it by a fan; removing one fills its star (:mod:`~meshsimp_pymoo.plane.stars`). Only the
vertices of the triangles replaced are looked at, so an operation, tried (`trial`) or done, costs what it touches and
not N. The triangulation of a subset is unique (see :mod:`~meshsimp_pymoo.plane.triangulation`), hence after any
sequence of operations triangles and error are those of :func:`~meshsimp_pymoo.surface.evaluate.simplify` from scratch.

Where the outline is touched more has to be done: vertices that no triangle covers ("bare" ones) know the segment of the
outline that is nearest to them (`bare`).
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.conflict import turn
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
from meshsimp_pymoo.surface.bare import clear_bare, forget_bare, is_segment, note_bare, set_segment, settle_bare
from meshsimp_pymoo.surface.books import (
    BARE_ERROR,
    COVERED,
    COVERED_ERROR,
    EMITTED,
    END,
    IN_REGION,
    INSIDE,
    LARGEST,
    N_EMITTED,
    N_FREE,
    N_LOOKED_AT,
    N_POOL,
    N_REGION,
    N_SITES,
    N_THIN,
    N_TOUCHED,
    PEAK,
    PEELED,
    PLAIN,
    SEGMENT,
    THIN,
    VISITED,
    Live,
)
from meshsimp_pymoo.surface.costs import counts, deviation_in, enter_peak, is_inside, is_thin, noted_cost, weighed_cost
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.moves import answers
from meshsimp_pymoo.surface.trial import ears_of, is_solid, tried

# Where an operation makes more triangles than this, the vertices to be placed walk to theirs.
MOST_LOOKED_THROUGH = 48

# What large costs that came and went leave in a running sum is rounding of the largest: once the sums have fallen below
# this share of it, they are added up anew.
RETAKEN_BELOW = 2.0**-20


# ------------------------------------------------------------------------------------------------ operations


@inner
def collect(live: Live, triangles: np.ndarray, n: int) -> None:
    """Take triangles out of the books: their vertices into the pool, their errors, their segments."""
    count = live.tally
    kind = live.kind
    head = live.head
    following = live.following
    pool = live.pool
    mesh = live.mesh
    used = live.used
    touched = live.touched
    n_pool = count[N_POOL]
    n_touched = count[N_TOUCHED]
    for q in range(n):
        t = triangles[q]
        r = t >> 3
        bits = kind[r]
        emitted = (bits & EMITTED) != 0
        i = head[r]
        while i >= 0:
            pool[n_pool] = i
            n_pool += 1
            if not emitted:
                forget_bare(live, i)
            i = following[i]
        head[r] = -1
        if bits != PLAIN and bits != 0:
            if bits & THIN:
                count[N_THIN] -= 1
            for k in range(3):
                set_segment(live, t + k, False)
        kind[r] = 0
        if emitted:
            live.amount[COVERED_ERROR] -= live.subtotal[r]
            live.subtotal[r] = 0.0
            if len(live.peaks) > 0:
                enter_peak(live, r, 0.0)
            count[N_EMITTED] -= 1
            for k in range(3):
                v = mesh[t + k]
                used[v] -= 1
                if used[v] == 0:
                    touched[n_touched] = v
                    n_touched += 1
    count[N_POOL] = n_pool
    count[N_TOUCHED] = n_touched


@inner
def _turn_thin(live: Live, t: int) -> None:
    """Peel a sliver, or put it back; it joins the region."""
    count = live.tally
    bits = live.kind[t >> 3]
    if not bits & IN_REGION:
        live.region[count[N_REGION]] = t
        collect(live, live.region[count[N_REGION] :], 1)
        count[N_REGION] += 1
        count[N_THIN] += 1
    # The outline's segments have gone with the collecting.
    bits = ((bits & (SEGMENT - 1)) | IN_REGION) ^ PEELED
    live.kind[t >> 3] = (bits | EMITTED) if (bits & (INSIDE | PEELED)) == INSIDE else (bits & ~EMITTED)


@inner
def _settle_thin(live: Live, seed: int) -> None:
    """Decide for the chain of slivers around ``seed`` whether it is peeled: whether it reaches the outside.

    Before the operation each chain was peeled or not as a whole. What is left of it after, and touches the region, has
    a seed there each: so the walk ends at the first ghost, and where the chain is peeled, what is so already stays.
    """
    mesh = live.mesh
    kind = live.kind
    stack = live.stack
    n = 1
    stack[0] = seed
    kind[seed >> 3] |= VISITED
    reaches = False
    k = 0
    while k < n and not reaches:
        t = stack[k]
        k += 1
        for e in range(3):
            s = mesh[t + 4 + e] & TRIANGLE
            if (mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX:
                reaches = True
            elif (kind[s >> 3] & (THIN | VISITED)) == THIN:
                kind[s >> 3] |= VISITED
                stack[n] = s
                n += 1
    for k in range(n):
        t = stack[k]
        kind[t >> 3] &= ~VISITED
        if not reaches and kind[t >> 3] & PEELED:
            _turn_thin(live, t)
    if reaches and not kind[seed >> 3] & PEELED:
        stack[0] = seed
        _turn_thin(live, seed)
        n = 1
        while n > 0:
            n -= 1
            t = stack[n]
            for e in range(3):
                s = mesh[t + 4 + e] & TRIANGLE
                if (kind[s >> 3] & (THIN | PEELED)) == THIN:
                    _turn_thin(live, s)
                    stack[n] = s
                    n += 1


@inner
def _settle(g: Ground, live: Live, half: bool) -> None:
    """Enter the triangles of the region into the books and place the pooled vertices.

    With ``half`` a second operation follows at once, which settles the bare vertices of both.
    """
    mesh = live.mesh
    kind = live.kind
    count = live.tally
    region = live.region
    for q in range(count[N_REGION]):
        t = region[q]
        a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
        if (a | b | c) > LAST_INDEX:
            kind[t >> 3] = 0
            continue
        bits = PLAIN if is_inside(g, a, b, c) else 0
        if is_thin(g, a, b, c):
            bits |= THIN
            count[N_THIN] += 1
        kind[t >> 3] = bits
    any_thin = False
    if count[N_THIN] > 0:
        for q in range(count[N_REGION]):
            t = region[q]
            any_thin = any_thin or (kind[t >> 3] & THIN) != 0
            for k in range(3):
                any_thin = any_thin or (kind[mesh[t + 4 + k] >> 3] & THIN) != 0
    if any_thin:
        n_first = count[N_REGION]
        for q in range(n_first):
            kind[region[q] >> 3] |= IN_REGION
        for q in range(n_first):
            t = region[q]
            if kind[t >> 3] & THIN:
                _settle_thin(live, t)
            for k in range(3):
                s = mesh[t + 4 + k] & TRIANGLE
                if kind[s >> 3] & THIN:
                    _settle_thin(live, s)
        for q in range(count[N_REGION]):
            kind[region[q] >> 3] &= ~IN_REGION
    enter_region(g, live, half, False)


@inner
def enter_region(g: Ground, live: Live, half: bool, closed: bool) -> None:
    """Enter the triangles of the region, whose kind is known, into the books and place the pooled vertices.

    With ``closed`` these lie in the region, which has no ghost and at most `MOST_LOOKED_THROUGH` triangles: one that by
    rounding lies in none of them is in the one that it is least outside of. (Walks may go on for ever where
    triangulations are not Delaunay.)
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
    pool = live.pool
    following = live.following
    amount = live.amount
    weighed = g.weighed
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
                    if used[v] == 1:
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
            if mine != theirs or is_segment(kind, h):
                set_segment(live, t + k, mine and not theirs)
                set_segment(live, h, theirs and not mine)
    # The pooled vertices, each to the triangle that holds it (exactly), else to a ghost that it sees.
    t = region[0] if count[N_REGION] > 0 else 0
    lined = len(g.lines.at) > 0
    n_looked_through = count[N_REGION] if count[N_REGION] <= MOST_LOOKED_THROUGH else 0
    for n in range(count[N_POOL]):
        i = pool[n]
        found = False
        for q in range(-1, n_looked_through):
            s = t if q < 0 else region[q]
            a, b, c = mesh[s], mesh[s + 1], mesh[s + 2]
            if (a | b | c) > LAST_INDEX:
                continue
            if (
                turn(xy, a, b, i, g.exact_area) >= 0
                and turn(xy, b, c, i, g.exact_area) >= 0
                and turn(xy, c, a, i, g.exact_area) >= 0
            ):
                t = s
                found = True
                break
        if not found and closed:
            t = _least_outside(xy, mesh, region, count[N_REGION], i)
        elif not found and lined:
            t = locate_at_random(xy, mesh, t, xy[2 * i], xy[2 * i + 1], g.exact_area)
        elif not found:
            t = locate(xy, mesh, t, xy[2 * i], xy[2 * i + 1], g.exact_area)
        r = t >> 3
        place[i] = t
        following[i] = head[r]
        head[r] = i
        if kind[r] & EMITTED:
            d = deviation_in(xy, z, mesh[t], mesh[t + 1], mesh[t + 2], i)
            if weighed:
                d = noted_cost(g, live, d, i)
            subtotal[r] += d
            amount[COVERED_ERROR] += d
        else:
            note_bare(live, i)
    for n in range(count[N_TOUCHED]):
        v = touched[n]
        if live.site[v]:
            if used[v] == 0:
                note_bare(live, v)
            else:
                forget_bare(live, v)
    if len(live.peaks) > 0:
        for q in range(count[N_REGION]):
            enter_peak(live, region[q] >> 3, peak_in(g, live, region[q]))
    count[N_REGION] = 0
    count[N_POOL] = 0
    count[N_TOUCHED] = 0
    if half:
        return
    settle_bare(g, live)
    whole = amount[COVERED_ERROR] + amount[BARE_ERROR]
    if whole > amount[PEAK]:
        amount[PEAK] = whole
    elif whole < RETAKEN_BELOW * amount[PEAK]:
        retake(live, len(g.z))


@inner
def _least_outside(xy: np.ndarray, mesh: np.ndarray, region: np.ndarray, n: int, i: int) -> int:
    """Return the triangle of the region that vertex i is least outside of, by twice the area with a side."""
    best = np.int64(region[0])
    most = -np.inf
    for q in range(n):
        t = np.int64(region[q])
        least = np.inf
        for k in range(3):
            a, b = np.int64(mesh[t + k]), np.int64(mesh[t + (k + 1) % 3])
            ux, uy = xy[2 * b] - xy[2 * a], xy[2 * b + 1] - xy[2 * a + 1]
            least = min(least, ux * (xy[2 * i + 1] - xy[2 * a + 1]) - uy * (xy[2 * i] - xy[2 * a]))
        if least > most:
            most = least
            best = t
    return best


@inner
def peak_in(g: Ground, live: Live, t: int) -> float:
    """Return the largest deviation in an emitted triangle, of vertices whose weight is not 0; 0 in others."""
    mesh = live.mesh
    peak = 0.0
    i = live.head[t >> 3] if live.kind[t >> 3] & EMITTED else -1
    while i >= 0:
        if counts(g, i):
            peak = max(peak, deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i))
        i = live.following[i]
    return peak


@inner
def retake(live: Live, n: int) -> None:
    """Add up the costs anew: of the emitted triangles, and of the bare ones among n vertices."""
    amount = live.amount
    amount[COVERED_ERROR] = 0.0
    amount[BARE_ERROR] = 0.0
    for r in range(live.tally[END] >> 3):
        if live.kind[r] & EMITTED:
            amount[COVERED_ERROR] += live.subtotal[r]
    for i in range(n):
        if live.bare[i] != COVERED:
            amount[BARE_ERROR] += live.cost[i]
    amount[PEAK] = amount[COVERED_ERROR] + amount[BARE_ERROR]


@inner(inline=True)
def new_record(live: Live) -> int:
    """Return an unused record."""
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
    n_cavity, n_rim = cavity_of(
        g.xy, mesh, t0, p, live.cavity, live.rim, live.stack, g.lines, g.exact_area, g.exact_lift
    )
    collect(live, live.cavity, n_cavity)
    # p itself leaves the pool: it is a site now.
    n = 0
    for q in range(count[N_POOL]):
        if live.pool[q] != p:
            live.pool[n] = live.pool[q]
            n += 1
    count[N_POOL] = n
    forget_bare(live, p)
    live.site[p] = 1
    live.used[p] = 0
    count[N_SITES] += 1
    live.touched[count[N_TOUCHED]] = p
    count[N_TOUCHED] += 1
    for k in range(n_rim):
        live.region[k] = live.cavity[k] if k < n_cavity else new_record(live)
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
    if count[N_SITES] <= 3:
        return False
    n_ears = ears_of(g, live, p, m)
    if n_ears == 0 or not is_solid(mesh, live.ears, n_ears, live.rim, m):
        return False
    collect(live, live.cavity, m)
    live.pool[count[N_POOL]] = p
    count[N_POOL] += 1
    forget_bare(live, p)
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
    live.amount[LARGEST] = 0.0
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
    largest = amount[LARGEST]
    amount[PEAK] = 0.0
    exchange(g, live, w, v)
    amount[LARGEST] = largest
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
    change, triangles = tried(g, live, v, w, limit)
    if np.isnan(change):
        return _done_and_undone(g, live, v, w)
    return change, triangles


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
    lined = len(g.lines.at) > 0
    if lined:
        constrain(site_xy, mesh, end, g.lines, sites, len(sites), live.rim, g.exact_area, g.exact_lift)
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
    for k in range(len(sites)):
        live.site[sites[k]] = 1
    count[N_REGION] = end >> 3
    live.kind[:] = 0
    clear_bare(live, len(g.z))
    live.peaks[:] = 0.0
    # All triangles are the region; the vertices are placed by walking along the curve, faster than by looking at all.
    _settle(g, live, True)
    t = 0
    for i in range(len(g.z)):
        if live.site[i]:
            t = live.place[i]
            continue
        if lined:
            t = locate_at_random(g.xy, mesh, t, g.xy[2 * i], g.xy[2 * i + 1], g.exact_area)
        else:
            t = locate(g.xy, mesh, t, g.xy[2 * i], g.xy[2 * i + 1], g.exact_area)
        r = t >> 3
        live.place[i] = t
        live.following[i] = live.head[r]
        live.head[r] = i
        if live.kind[r] & EMITTED:
            d = noted_cost(g, live, deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i), i)
            live.subtotal[r] += d
            live.amount[COVERED_ERROR] += d
        else:
            note_bare(live, i)
    for k in range(len(sites)):
        if live.used[sites[k]] == 0:
            note_bare(live, sites[k])
    settle_bare(g, live)
    if len(live.peaks) > 0:
        for r in range(end >> 3):
            enter_peak(live, r, peak_in(g, live, r * RECORD))
    live.amount[PEAK] = live.amount[COVERED_ERROR] + live.amount[BARE_ERROR]
    return True


# ------------------------------------------------------------------------------ answers to the questions of the search


@answers(moves.total_cost, Ground)
@inner(inline=True)
def total_cost(g: Ground, live: Live) -> float:
    """Sum of the costs; inf where there is no mesh."""
    return _total(live)


@answers(moves.error_now, Ground)
@inner(inline=True)
def error_now(g: Ground, live: Live) -> float:
    """Sum of the costs, or the largest deviation where the books know it; inf where there is no mesh."""
    return live.peaks[1] if len(live.peaks) > 0 and live.tally[N_EMITTED] > 0 else _total(live)


@answers(moves.ranked, Ground)
@inner(inline=True)
def _ranked(g: Ground, live: Live, change: float) -> tuple[float, float]:
    if len(live.peaks) > 0:
        return (live.amount[LARGEST], change) if change < np.inf else (change, 0.0)
    return change, live.amount[LARGEST] if g.bound < np.inf else 0.0


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
    return live.subtotal[live.place[v] >> 3] if live.bare[v] == COVERED else live.cost[v]


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


@answers(moves.effort, Ground)
@inner(inline=True)
def _effort(g: Ground, live: Live) -> int:
    return live.tally[N_LOOKED_AT]


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
            whole += live.cost[i] if live.tally[N_EMITTED] > 0 else 1.0
        if _at_a_corner(g.xy, mesh, t, i):
            i = live.following[i]
            continue
        d = live.cost[i] if len(live.peaks) == 0 else live.peaks[len(live.peaks) // 2 + len(live.kind) + i]
        if emitted:
            d = deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i)
            if len(live.peaks) > 0:
                d = d if counts(g, i) else 0.0
            elif g.weighed:
                d = weighed_cost(g, d, i)
        elif live.tally[N_EMITTED] == 0:
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
