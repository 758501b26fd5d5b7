"""What a change would do to the error, found without doing it.

The triangles that would go are listed, and those that would come; the vertices of the former are looked up among the
latter. At the outline more has to be known: which of the new triangles are emitted, which segments go and come, which
sites no triangle uses any more, and what all that means for the bare vertices.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.conflict import conflict, turn
from meshsimp_pymoo.plane.constraints import is_on_line
from meshsimp_pymoo.plane.stars import (
    MOST_EARS,
    along_line,
    cavity_of,
    fill,
    fill_large,
    fill_on_line,
    triangles_around,
)
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, TRIANGLE
from meshsimp_pymoo.surface.bare import (
    corners_of,
    farthest,
    is_segment,
    list_candidates,
    may_reach,
    middle_of,
    nearest_of,
    rank,
    rank_of,
    slot,
    squared_gap,
)
from meshsimp_pymoo.surface.books import (
    COVERED,
    EMITTED,
    HOUSED,
    LARGEST,
    MOST_TOUCHED,
    N_BARE,
    N_EMITTED,
    N_LOOKED_AT,
    N_SITES,
    N_THIN,
    NONE,
    PLAIN,
    RUN,
    SEGMENT,
    THIN,
    TRIED,
    Live,
)
from meshsimp_pymoo.surface.costs import bare_deviation, is_inside, is_thin, noted_cost
from meshsimp_pymoo.surface.ground import Ground

# Columns of ``forms``: three sides and the plane, three numbers each, and whether the triangle is emitted.
IS_SHOWN = 12
# A vertex this little outside of a triangle that would come lies in it (twice an area, in the unit square).
ROUNDED_AREA = 1e-15


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
def _holder(forms: np.ndarray, n: int, best: int, x: float, y: float) -> tuple[int, bool]:
    """Return the triangle of n that holds (x, y), or nearly, if there is one; ``best`` is tried first.

    How far inside a triangle it lies is twice the least area with a side; where one side says no, the others are not
    asked.
    """
    most = -2.0 * ROUNDED_AREA
    found = False
    for k in range(-1, n):
        q = best if k < 0 else k
        amount = forms[q, 0] * x + forms[q, 1] * y + forms[q, 2]
        if not amount > most:
            continue
        amount = min(amount, forms[q, 3] * x + forms[q, 4] * y + forms[q, 5])
        if not amount > most:
            continue
        amount = min(amount, forms[q, 6] * x + forms[q, 7] * y + forms[q, 8])
        if amount > most and amount >= -ROUNDED_AREA:
            most = amount
            best = q
            found = True
            if amount >= 0.0:
                break
    return best, found


@inner(inline=True)
def _replaced(live: Live, n_star: int, n_ears: int, v: int, w: int, g: Ground) -> tuple[int, int]:
    """List the triangles in conflict with w once the ears have replaced the star of v; as :func:`cavity_of`.

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
        on_line = v >= 0 and is_on_line(g.lines, v)
        for k in range(n_ears):
            t0 = gone[k]
            if on_line:  # one beyond the edge that comes may be in conflict, too
                if _holds(g.xy, mesh, t0, w, g.exact_area):
                    break
            elif conflict(g.xy, mesh[t0], mesh[t0 + 1], mesh[t0 + 2], w, g.exact_area, g.exact_lift):
                break
    n_cavity, n_rim = cavity_of(g.xy, mesh, t0, w, live.cavity, rim, live.stack, g.lines, g.exact_area, g.exact_lift)
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
def _holds(xy: np.ndarray, mesh: np.ndarray, t: int, w: int, exact_area: float) -> bool:
    """Whether vertex w lies in triangle t, or is seen from the edge of ghost t."""
    for e in range(3):
        a, b = mesh[t + e], mesh[t + (e + 1) % 3]
        if (a | b) <= LAST_INDEX:
            side = turn(xy, a, b, w, exact_area)
            if side < 0 or (side == 0 and mesh[t + (e + 2) % 3] > LAST_INDEX):
                return False
    return True


@inner(inline=True)
def ears_of(g: Any, live: Any, p: int, m: int) -> int:
    """Fill the star of p, whose m triangles, rim and ring are listed, by ears; return their number, or 0: none do."""
    if is_on_line(g.lines, p):
        low, high = along_line(g.xy, g.lines, p, live.ring, m, g.exact_area)
        if low >= 0:
            scratch = live.stack, live.edge, live.ears, live.ear_edges
            return fill_on_line(g.xy, live.ring, m, low, high, *scratch, g.exact_area, g.exact_lift)
    if m <= MOST_EARS:
        return fill(g.xy, live.ring, m, 0, live.edge, live.ears, live.ear_edges, g.exact_area, g.exact_lift)
    return fill_large(
        g.xy,
        p,
        live.ring,
        m,
        live.ears,
        live.ear_edges,
        live.star_mesh,
        live.star_inserted,
        live.star_side,
        live.star_order,
        live.stack,
        g.exact_area,
        g.exact_lift,
    )


@inner(inline=True)
def _comer(live: Live, k: int, n_rim: int, w: int) -> tuple[int, int, int]:
    """Return the corners of triangle k of those that would come: first the fan around w, then the ears.

    Of an ear that goes again two corners are one.
    """
    if k < n_rim:
        return np.int64(live.ring[k]), np.int64(live.ring[k + 1 if k + 1 < n_rim else 0]), np.int64(w)
    ears = live.ears
    return np.int64(ears[k - n_rim, 0]), np.int64(ears[k - n_rim, 1]), np.int64(ears[k - n_rim, 2])


@inner
def tried(g: Ground, live: Live, v: int, w: int, limit: float) -> tuple[float, int]:
    """Return the change of cost and of the number of triangles if site v went and vertex w came; -1 means none.

    Infinite where v cannot go, and where the change is found to exceed ``limit`` before it is known; nan where it must
    be done to be known: where many triangles or slivers are touched.
    """
    unknown = (np.nan, 0)
    xy = g.xy
    z = g.z
    mesh = live.mesh
    kind = live.kind
    cavity = live.cavity
    ears = live.ears
    gone = live.gone
    subtotal = live.subtotal
    n_star = 0
    n_ears = 0
    n_emitted = 0
    change = 0.0
    at_outline = False
    live.tally[N_LOOKED_AT] = 0
    live.amount[LARGEST] = 0.0
    if v >= 0:
        n_star = triangles_around(mesh, live.place[v], v, cavity, live.rim, live.ring)
        live.tally[N_LOOKED_AT] = n_star
        if n_star > MOST_TOUCHED:
            return unknown
        for k in range(n_star):
            t = np.int64(cavity[k])
            gone[k] = t
            bits = kind[t >> 3]
            if bits != PLAIN:
                if bits & THIN:
                    return unknown
                at_outline = True
            n_emitted += bits & EMITTED
            change -= subtotal[t >> 3]
        n_ears = ears_of(g, live, v, n_star)
        if n_ears == 0:
            return unknown
        if at_outline and (live.tally[N_SITES] <= 3 or not is_solid(mesh, ears, n_ears, live.rim, n_star)):
            return np.inf, 0
    n_gone = n_star
    n_cavity = 0
    n_rim = 0
    if w >= 0:
        n_cavity, n_rim = _replaced(live, n_star, n_ears, v, w, g)
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
            bits = kind[t >> 3]
            if bits != PLAIN:
                if bits & THIN:
                    return unknown
                at_outline = True
            gone[n_gone] = t
            n_gone += 1
            n_emitted += bits & EMITTED
            change -= subtotal[t >> 3]
    forms = live.forms
    shown = live.shown
    x0 = xy[2 * max(v, w)]
    y0 = xy[2 * max(v, w) + 1]
    n = 0
    n_shown = 0
    for k in range(n_rim + n_ears):
        a, b, c = _comer(live, k, n_rim, w)
        shown[k] = 0
        if a == b or (a | b | c) > LAST_INDEX:
            continue
        if is_thin(g, a, b, c):
            return unknown
        inside = is_inside(g, a, b, c)
        at_outline = at_outline or not inside
        shown[k] = inside
        n_shown += inside
        _enter_form(xy, z, a, b, c, x0, y0, forms, n)
        forms[n, IS_SHOWN] = inside
        n += 1
    if n == 0 or live.tally[N_EMITTED] == 0 or live.tally[N_EMITTED] + n_shown == n_emitted:
        return unknown
    gone_change = change
    # Where all triangles are emitted, at the hull as well, no vertex is bare that lies in one that comes.
    if at_outline and (g.footprint.side > 0 or live.tally[N_BARE] > 0 or live.tally[N_THIN] > 0):
        change = _at_outline(g, live, v, w, limit, gone_change, n_gone, n_star, n_ears, n_rim, n)
        return change, n_shown - n_emitted
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
                best, found = _holder(forms, n, best, x, y)
                if not found:
                    if not at_outline:
                        return unknown
                    change = _at_outline(g, live, v, w, limit, gone_change, n_gone, n_star, n_ears, n_rim, n)
                    return change, n_shown - n_emitted
                d = abs(forms[best, 9] * x + forms[best, 10] * y + forms[best, 11] - z[i])
                change += noted_cost(g, live, d, i) if weighed else d
            i = np.int64(following[i]) if k >= 0 else np.int64(-1)
        if change > limit:
            return np.inf, 0
    return change, n_shown - n_emitted


@inner
def is_solid(mesh: np.ndarray, ears: np.ndarray, n_ears: int, rim: np.ndarray, m: int) -> bool:
    """Whether some ear or what lies beyond the ring is a triangle; else all other sites are on one line."""
    for k in range(n_ears):
        if (ears[k, 0] | ears[k, 1] | ears[k, 2]) <= LAST_INDEX:
            return True
    for k in range(m):
        t = rim[k] & TRIANGLE
        if (mesh[t] | mesh[t + 1] | mesh[t + 2]) <= LAST_INDEX:
            return True
    return False


# ------------------------------------------------------------------------------------------------------ at the outline


@inner(inline=True)
def _is_ghost(mesh: np.ndarray, t: int) -> bool:
    """Whether the vertex at infinity is a corner of triangle t."""
    return (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX


@inner
def _lie_beside(live: Live, n_star: int, n_ears: int, n_rim: int, w: int) -> bool:
    """Fill ``beside``: across each side of those that would come, a halfedge that stays, or ~k for triangle k of them.

    Returns whether a sliver is among those that stay.
    """
    beside = live.beside
    gone = live.gone
    rim = live.rim
    for k in range(n_ears):
        for e in range(3):
            side = live.ear_edges[k, e]
            if side < n_star:
                beside[n_rim + k, e] = live.saved[8 * MOST_TOUCHED + side] if w >= 0 else rim[side]
            elif side < n_star + k:
                beside[n_rim + k, e] = ~np.int64(n_rim + side - n_star)
                beside[n_rim + side - n_star, 2] = ~np.int64(n_rim + k)
    for k in range(n_rim):
        h = np.int64(rim[k])
        beside[k, 0] = h
        beside[k, 1] = ~np.int64(k + 1 if k + 1 < n_rim else 0)
        beside[k, 2] = ~np.int64(k - 1 if k > 0 else n_rim - 1)
        for q in range(n_ears):
            if gone[q] == h & TRIANGLE:
                # An ear that stays; it stood in that record.
                beside[k, 0] = ~np.int64(n_rim + q)
                beside[n_rim + q, h & 3] = ~np.int64(k)
    for k in range(n_rim + n_ears):
        a, b, _ = _comer(live, k, n_rim, w)
        if a != b:
            for e in range(3):
                if beside[k, e] >= 0 and live.kind[beside[k, e] >> 3] & THIN:
                    return True
    return False


@inner
def _come_and_go(live: Live, n_gone: int, n_comers: int, n_rim: int, w: int) -> tuple[int, int]:
    """List the segments that would go and those that would come; return their numbers.

    Those that go are taken for no segments until the trial ends.
    """
    mesh = live.mesh
    kind = live.kind
    going = live.going
    coming = live.coming
    shown = live.shown
    n_going = 0
    n_coming = 0
    for k in range(n_gone):
        t = live.gone[k]
        if kind[t >> 3] >= SEGMENT:
            for e in range(3):
                if is_segment(kind, t + e):
                    going[n_going] = t + e
                    n_going += 1
    for k in range(n_comers):
        corner = _comer(live, k, n_rim, w)
        if corner[0] == corner[1]:
            continue
        for e in range(3):
            h = live.beside[k, e]
            if shown[k]:
                theirs = shown[~h] != 0 if h < 0 else (kind[h >> 3] & EMITTED) != 0
                if not theirs:
                    a, b, c = corner[0], corner[1], corner[2]
                    if e == 1:
                        a, b, c = b, c, a
                    elif e == 2:
                        a, b, c = c, a, b
                    coming[n_coming, 0], coming[n_coming, 1], coming[n_coming, 2] = a, b, c
                    n_coming += 1
                elif h >= 0 and is_segment(kind, h):
                    going[n_going] = h
                    n_going += 1
            elif h >= 0 and kind[h >> 3] & EMITTED and not is_segment(kind, h):
                a, b, c = corners_of(mesh, h)
                coming[n_coming, 0], coming[n_coming, 1], coming[n_coming, 2] = a, b, c
                n_coming += 1
    for k in range(n_going):
        kind[going[k] >> 3] &= ~(SEGMENT << (going[k] & 3))
    return n_going, n_coming


@inner
def _nearest_coming(g: Ground, live: Live, n_coming: int, i: int, own: int, gap: float) -> tuple[int, float]:
    """Return which of the segments that come is nearer to vertex i than ``own`` at ``gap``, and its gap; -1: none."""
    coming = live.coming
    best = -1
    for k in range(n_coming):
        d = squared_gap(g.xy, coming[k, 0], coming[k, 1], g.xy[2 * i], g.xy[2 * i + 1])
        if d > gap:
            continue
        if d == gap:
            mine = rank(coming[k, 0], coming[k, 1], coming[k, 2])
            if best >= 0:
                if rank(coming[best, 0], coming[best, 1], coming[best, 2]) < mine:
                    continue
            elif own != NONE and rank_of(live.mesh, own) < mine:
                continue
        best = k
        gap = d
    return best, gap


@inner
def _cost_if_homeless(g: Ground, live: Live, n_coming: int, n_candidates: int, i: int, guess: int) -> tuple[float, int]:
    """Return the cost of bare vertex i by the nearest of the segments that stay or come, and the nearest that stays.

    ``guess`` is one that stays, or NONE.
    """
    coming = live.coming
    if live.bare[i] == TRIED:
        own = np.int64(live.bare_segment[i])
        if own == NONE or is_segment(live.kind, own):
            # What was nearest of those that there are still is.
            near, gap = _nearest_coming(g, live, n_coming, i, own, live.bare_gap[i])
            if near >= 0:
                d = bare_deviation(g, coming[near, 0], coming[near, 1], coming[near, 2], i, gap)
            elif own == NONE:
                return 0.0, guess
            else:
                a, b, c = corners_of(live.mesh, own)
                d = bare_deviation(g, a, b, c, i, gap)
            return noted_cost(g, live, d, i), guess
    x = g.xy[2 * i]
    y = g.xy[2 * i + 1]
    near, gap = _nearest_coming(g, live, n_coming, i, NONE, farthest(g))
    h = np.int64(NONE)
    if guess != NONE:
        a, b, _ = corners_of(live.mesh, guess)
        d = squared_gap(g.xy, a, b, x, y)
        if d < gap:
            h = guess
            gap = d
    bound = gap
    h, gap = nearest_of(g, live, n_candidates, x, y, h, gap)
    if h != NONE and near >= 0 and gap == bound:
        # As near as one that comes, unless it is nearer.
        d = squared_gap(g.xy, coming[near, 0], coming[near, 1], x, y)
        if d == gap and rank(coming[near, 0], coming[near, 1], coming[near, 2]) < rank_of(live.mesh, h):
            d = bare_deviation(g, coming[near, 0], coming[near, 1], coming[near, 2], i, gap)
            return noted_cost(g, live, d, i), h
    if h != NONE:
        a, b, c = corners_of(live.mesh, h)
        return noted_cost(g, live, bare_deviation(g, a, b, c, i, gap), i), h
    if near >= 0:
        d = bare_deviation(g, coming[near, 0], coming[near, 1], coming[near, 2], i, gap)
        return noted_cost(g, live, d, i), h
    return 0.0, h


@inner(inline=True)
def _count_out(live: Live, i: int, change: float, n_tried: int) -> tuple[float, int]:
    """Take what vertex i costs, if it is bare, from the change, once; return both as they are then."""
    if live.bare[i] != HOUSED:
        return change, n_tried
    live.bare[i] = TRIED
    live.pool[n_tried] = i
    return change - live.cost[i], n_tried + 1


@inner
def _housed(g: Ground, live: Live, n_homeless: int, n_coming: int, change: float, limit: float) -> float:
    """Add what the homeless vertices would cost to the change, as long as it is no more than the limit; return it."""
    known = np.inf
    x, y, _ = middle_of(g.xy, live.homeless, n_homeless)
    for k in range(n_coming):
        known = min(known, squared_gap(g.xy, live.coming[k, 0], live.coming[k, 1], x, y))
    n_candidates = list_candidates(g, live, live.homeless, n_homeless, known)
    guess = np.int64(NONE)
    for k in range(n_homeless):
        d, guess = _cost_if_homeless(g, live, n_coming, n_candidates, live.homeless[k], guess)
        change += d
        if change > limit:
            break
    return change


@inner
def _drawn_near(g: Ground, live: Live, n_coming: int, change: float, n_tried: int) -> tuple[float, int]:
    """Add to the change what housed vertices would cost that are nearer to a segment that comes; count them out."""
    xy = g.xy
    nodes = live.nodes
    coming = live.coming
    n_leaves = len(live.first_segment)
    reach = live.reach
    boxes = g.boxes
    for k in range(n_coming):
        ax, ay = xy[2 * coming[k, 0]], xy[2 * coming[k, 0] + 1]
        bx, by = xy[2 * coming[k, 1]], xy[2 * coming[k, 1] + 1]
        nodes[0] = 1
        depth = 1
        while depth > 0:
            depth -= 1
            node = nodes[depth]
            if not may_reach(boxes, reach, node, ax, ay, bx, by):
                continue
            if node < n_leaves:
                nodes[depth] = 2 * node
                nodes[depth + 1] = 2 * node + 1
                depth += 2
                continue
            first = (node - n_leaves) * RUN
            for i in range(first, min(first + RUN, len(g.z))):
                if live.bare[i] == HOUSED:
                    gap = live.bare_gap[i]
                    if squared_gap(xy, coming[k, 0], coming[k, 1], xy[2 * i], xy[2 * i + 1]) <= gap:
                        best, gap = _nearest_coming(g, live, n_coming, i, live.bare_segment[i], gap)
                        if best >= 0:
                            a, b, c = coming[best, 0], coming[best, 1], coming[best, 2]
                            change += noted_cost(g, live, bare_deviation(g, a, b, c, i, gap), i)
                            change, n_tried = _count_out(live, i, change, n_tried)
    return change, n_tried


@inner
def _at_outline(
    g: Ground,
    live: Live,
    v: int,
    w: int,
    limit: float,
    change: float,
    n_gone: int,
    n_star: int,
    n_ears: int,
    n_rim: int,
    n_forms: int,
) -> float:
    """Go on with :func:`tried` where the outline is touched: return the change of cost.

    ``change`` is what the triangles that go are worth.
    """
    xy = g.xy
    z = g.z
    mesh = live.mesh
    kind = live.kind
    bare = live.bare
    used = live.used
    homeless = live.homeless
    seen = live.pool
    shown = live.shown
    forms = live.forms
    touched = live.touched
    n_comers = n_rim + n_ears
    if _lie_beside(live, n_star, n_ears, n_rim, w):
        return np.nan
    # Sites that come to be used or unused.
    n_touched = 0
    for k in range(n_gone):
        t = live.gone[k]
        if kind[t >> 3] & EMITTED:
            for e in range(3):
                i = mesh[t + e]
                used[i] -= 1
                if used[i] == 0:
                    touched[n_touched] = i
                    n_touched += 1
    for k in range(n_comers):
        if shown[k]:
            a, b, c = _comer(live, k, n_rim, w)
            for i in (a, b, c):
                used[i] += 1
                if used[i] == 1:
                    touched[n_touched] = i
                    n_touched += 1
    n_homeless = 0
    n_tried = 0
    if w >= 0 and used[w] == 0:
        homeless[n_homeless] = w
        n_homeless += 1
    for k in range(n_touched):
        i = np.int64(touched[k])
        if i != v and i != w:
            if used[i] == 0 and bare[i] == COVERED:
                homeless[n_homeless] = i
                n_homeless += 1
            elif used[i] > 0:
                change, n_tried = _count_out(live, i, change, n_tried)
    for k in range(n_gone):
        t = live.gone[k]
        if kind[t >> 3] & EMITTED:
            for e in range(3):
                used[mesh[t + e]] += 1
    for k in range(n_comers):
        if shown[k]:
            a, b, c = _comer(live, k, n_rim, w)
            used[a] -= 1
            used[b] -= 1
            used[c] -= 1
    # What lies beyond the hull stays there unless a vertex comes there: the hull does not grow.
    grows = w >= 0 and _is_ghost(mesh, np.int64(live.place[w]))
    # First all that may lower the cost: bare vertices that are placed anew, lose their segment or find a nearer one.
    n_going = 0
    n_coming = 0
    if live.tally[N_BARE] > 0:
        if v >= 0:
            change, n_tried = _count_out(live, v, change, n_tried)
        for k in range(n_gone):
            if not kind[live.gone[k] >> 3] & EMITTED:
                i = np.int64(live.head[live.gone[k] >> 3])
                while i >= 0:
                    change, n_tried = _count_out(live, i, change, n_tried)
                    i = np.int64(live.following[i])
        n_going, n_coming = _come_and_go(live, n_gone, n_comers, n_rim, w)
        for k in range(n_going):
            i = np.int64(live.first_bare[slot(np.int64(live.going[k]))])
            while i >= 0:
                if bare[i] == HOUSED:
                    change, n_tried = _count_out(live, i, change, n_tried)
                    homeless[n_homeless] = i
                    n_homeless += 1
                i = np.int64(live.bare_after[i])
        change, n_tried = _drawn_near(g, live, n_coming, change, n_tried)
    # The vertices of the triangles that go, and v itself.
    x0 = xy[2 * max(v, w)]
    y0 = xy[2 * max(v, w) + 1]
    best = 0
    for k in range(-1, n_gone):
        i = np.int64(v) if k < 0 else np.int64(live.head[live.gone[k] >> 3])
        is_beyond = k >= 0 and not grows and _is_ghost(mesh, live.gone[k])
        while i >= 0:
            if i != w:
                x = xy[2 * i] - x0
                y = xy[2 * i + 1] - y0
                found = False
                if not is_beyond:
                    best, found = _holder(forms, n_forms, best, x, y)
                if found and forms[best, IS_SHOWN] != 0.0:
                    d = abs(forms[best, 9] * x + forms[best, 10] * y + forms[best, 11] - z[i])
                    change += noted_cost(g, live, d, i)
                else:
                    homeless[n_homeless] = i
                    n_homeless += 1
            i = np.int64(live.following[i]) if k >= 0 else np.int64(-1)
        if change > limit:
            break
    if n_homeless > 0 and change <= limit:
        if live.tally[N_BARE] == 0:
            n_going, n_coming = _come_and_go(live, n_gone, n_comers, n_rim, w)
        change = _housed(g, live, n_homeless, n_coming, change, limit)
    for k in range(n_going):
        kind[live.going[k] >> 3] |= SEGMENT << (live.going[k] & 3)
    for k in range(n_tried):
        bare[seen[k]] = HOUSED
    return change if change <= limit else np.inf
