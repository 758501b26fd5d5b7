"""Free triangulations: meshes whose edges are chosen for the error, as their vertices are, not by the Delaunay rule.

A free mesh is a subset of the original vertices with a triangulation of its own. It begins as the Delaunay mesh of a
subset and is annealed at equal triangles by three moves, each of them a fan (`fans`) whose effect on the error is
exact: an edge flips, a vertex moves to another original one inside its star, one vertex collapses and another one
comes. Beside the vertices the centroids of the original faces may be samples, so that the mesh does not merely fit the
vertices.

The plane outside the mesh is triangulated too, out to four corners far away, so that the same moves change the outline:
a vertex on it goes to another one of the original's border, an edge of it flips, one collapses and another one comes.
Forced edges do not flip, and vertices on break lines neither come nor go, so that lines stay what they are at first.
What a triangle may be is said once: inside the footprint it is emitted and has the least height that is asked for,
outside it is not emitted and of any shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, IntArray
from meshsimp_pymoo.compiling.draws import below, unit
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.conflict import turn
from meshsimp_pymoo.plane.constraints import is_forced, is_on_line
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import INFINITE, LAST_INDEX, RECORD, TRIANGLE
from meshsimp_pymoo.surface import moves
from meshsimp_pymoo.surface.bare import corners_of
from meshsimp_pymoo.surface.books import (
    BARE_ERROR,
    COVERED,
    COVERED_ERROR,
    EMITTED,
    END,
    N_EMITTED,
    N_THIN,
    NONE,
    PLAIN,
    SEGMENT,
    Live,
    make_live,
)
from meshsimp_pymoo.surface.centroids import with_centroids
from meshsimp_pymoo.surface.costs import bare_deviation, deviation_in, is_hardly_bare
from meshsimp_pymoo.surface.fans import (
    N_CAVITY,
    N_RING,
    Fan,
    Freedom,
    at_least,
    cost_at,
    done,
    done_outside,
    fill_around,
    fill_from,
    has_shape,
    is_covered,
    is_inside_all,
    is_shown,
    make_fan,
    side_of,
    take_pair,
    take_star,
    take_triangle,
    tried,
    undone,
)
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.live import build, retake
from meshsimp_pymoo.surface.measures import (
    ERROR,
    MAXIMUM,
    REGIONS,
    SQUARES,
    TRIANGLES,
    UNCOVERED,
    VERTICES,
)
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.moves import answers, flip, settle, shift, swap
from meshsimp_pymoo.surface.rules import USUAL_RATIO, Rules
from meshsimp_pymoo.workers import Reserve

# How far the corners of the plane are from the unit square; their differences with all vertices are exact there.
FAR = 0.5
# No triangle that comes is lower than this in the unit square, whatever else is asked for: single precision holds it,
# in coordinates from a corner of the model.
LEAST_HEIGHT = 2.0**-21
# Triangles compared where a vertex comes.
TRIES = 4
# Of so many flips outside the mesh one is made: they cost nothing and change what can come next.
IDLE = 8
# Moves look at a window of so many triangles and the vertices there, which the processor's cache holds; after so many
# moves it goes on by half of that, along the curve that the records follow.
WINDOW = 2000
VISIT = 4000
# What the centroids weigh, all together, of what the vertices do. As much as these, and the error at the vertices is
# 1 % higher (3 % at a fifth of the vertices of a large model), that between them 2 % lower (5 %).
CENTROIDS = 0.5
# From so many samples on, books that are not used are given back: hundreds of bytes a sample each.
LARGE = 900_000


class FreeShares(NamedTuple):
    """How often each move is tried.

    Attributes
    ----------
    flip : float
        An edge flips.
    shift : float
        A vertex moves inside its star. In the other moves one collapses, and another one comes elsewhere.
    """

    flip: float = 0.45
    shift: float = 0.40


USUAL_SHARES = FreeShares()


# ------------------------------------------------------------------------------------------------------------- opening


@inner
def _quarter(dx: float, dy: float) -> int:
    """Return which far corner is seen from an edge of the hull in direction (dx, dy), the outside on its left."""
    if -dy >= 0.0:
        return 0 if dx >= 0.0 else 3
    return 1 if dx >= 0.0 else 2


@entry
def _open(freedom: Freedom, books: Live, n: int) -> None:
    """Put triangles to far corners, the samples n to n + 3, in place of the ghosts; slivers are as others are."""
    g = borrowed(freedom).ground
    live = borrowed(books)
    mesh = live.mesh
    kind = live.kind
    xy = g.xy
    end = live.tally[END]
    for t in range(0, end, RECORD):
        bits = kind[t >> 3]
        kind[t >> 3] = (PLAIN | (bits & ~(SEGMENT - 1))) if bits & EMITTED else 0
    live.tally[N_THIN] = 0
    first = np.int64(-1)
    strip = np.empty(end // RECORD + 5, np.int64)
    for t in range(0, end, RECORD):
        if (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX:
            first = t
            # a, b, the vertex at infinity, in this order
            k = 0 if mesh[t] > LAST_INDEX else (1 if mesh[t + 1] > LAST_INDEX else 2)
            a, b = mesh[t + (k + 1) % 3], mesh[t + (k + 2) % 3]
            across = mesh[t + (k + 1) % 3 + 4]
            after = np.int64(mesh[t + (k + 2) % 3 + 4]) & TRIANGLE
            mesh[t] = a
            mesh[t + 1] = b
            mesh[t + 4] = across
            mesh[across + 4] = t
            mesh[t + 7] = after  # the one that begins where this one ends
            mesh[t + 2] = n + _quarter(xy[2 * b] - xy[2 * a], xy[2 * b + 1] - xy[2 * a + 1])
    void = live.tally[END]
    live.tally[END] += RECORD
    for e in range(3):
        mesh[void + e] = INFINITE
        mesh[void + e + 4] = void + e
    kind[void >> 3] = 0
    live.head[void >> 3] = -1
    live.subtotal[void >> 3] = 0.0
    t = first
    n_strip = 0
    while True:
        after = np.int64(mesh[t + 7])
        strip[n_strip] = t
        n_strip += 1
        last = t + 1  # the halfedge from where it ends to its far corner
        corner = np.int64(mesh[t + 2]) - n
        while corner != np.int64(mesh[after + 2]) - n:
            s = live.tally[END]
            live.tally[END] += RECORD
            mesh[s] = mesh[t + 1]
            mesh[s + 1] = n + (corner + 3) % 4
            mesh[s + 2] = n + corner
            mesh[s + 5] = void
            mesh[s + 6] = last
            mesh[last + 4] = s + 2
            kind[s >> 3] = 0
            live.head[s >> 3] = -1
            live.subtotal[s >> 3] = 0.0
            strip[n_strip] = s
            n_strip += 1
            last = s
            corner = (corner + 3) % 4
        mesh[last + 4] = after + 2
        mesh[after + 6] = last
        t = after
        if t == first:
            break
    # What lies beyond the hull is on the strip, near the edge that it was entered at.
    for q in range(n_strip):
        t = strip[q]
        for e in range(3):
            live.place[mesh[t + e]] = t
    for q in range(n_strip):
        t = strip[q]
        i = np.int64(live.head[t >> 3])
        live.head[t >> 3] = -1
        while i >= 0:
            after = np.int64(live.following[i])
            live.pool[i] = q  # where the look begins
            live.following[i] = -1
            live.place[i] = t
            i = after
    for i in range(n):
        if live.site[i] or live.bare[i] == COVERED or kind[live.place[i] >> 3] != 0:
            continue
        t = np.int64(live.place[i])
        if max(mesh[t], max(mesh[t + 1], mesh[t + 2])) < n:
            continue
        q = np.int64(live.pool[i])
        for step in range(n_strip + 1):
            found = False
            for sign in (1, -1):
                s = strip[(q + sign * step) % n_strip]
                if (
                    turn(xy, mesh[s], mesh[s + 1], i, g.exact_area) >= 0
                    and turn(xy, mesh[s + 1], mesh[s + 2], i, g.exact_area) >= 0
                    and turn(xy, mesh[s + 2], mesh[s], i, g.exact_area) >= 0
                ):
                    t = s
                    found = True
                    break
            if found:
                break
        live.place[i] = t
        live.following[i] = live.head[t >> 3]
        live.head[t >> 3] = i


# --------------------------------------------------------------------------------------------------------------- moves


@inner
def _outside(free: Freedom, live: Live, fan: Fan, v: int, w: int, least: int, most: int, limit: float) -> float:
    """Change what is not all emitted; return the change of cost, inf where nothing is changed.

    There must be at least ``least`` more triangles after that, and at most ``most`` in all.
    """
    more = is_shown(free, live, fan)
    if more < least or live.tally[N_EMITTED] + more > most or not at_least(free, live, fan, v, w, limit) < np.inf:
        return np.inf
    return done_outside(free, live, fan, v, w, limit)


@inner
def _inside(free: Freedom, live: Live, fan: Fan, v: int, w: int, limit: float) -> float:
    """Change what is all emitted; return the change of cost, inf where nothing is changed."""
    if not has_shape(free, fan):
        return np.inf
    change = tried(free, live, fan, v, w, limit)
    if not change <= limit or not is_inside_all(free, fan):
        return np.inf
    done(free, live, fan, v, w)
    return change


@inner(inline=True)
def drawn(n: int, first: float, share: float, state: np.ndarray) -> int:
    """Draw one of n things in a window on them, which starts at a share of all and is of another."""
    k = int(first * n) + below(state, max(int(share * n), 1))
    return k if k < n else k - n


@answers(moves.flip, Freedom)
@inner
def _flip(free: Freedom, live: Live, h: int, most: int, limit: float, state: np.ndarray) -> bool:
    mesh = live.mesh
    t = h & TRIANGLE
    s = np.int64(mesh[h + 4]) & TRIANGLE
    if (mesh[t] | mesh[t + 1] | mesh[t + 2] | mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX:
        return False
    if is_forced(free.ground.lines, mesh[h], mesh[t + ((h & 3) + 1) % 3]):
        return False
    fan = free.fan
    take_pair(live, fan, h)
    fill_from(fan, 0)
    if live.kind[t >> 3] & live.kind[s >> 3] & EMITTED:
        return _inside(free, live, fan, -1, -1, limit) < np.inf
    if not free.moves_outline:
        return False
    if not (live.kind[t >> 3] | live.kind[s >> 3]) & EMITTED and below(state, IDLE) > 0:
        return False
    return _outside(free, live, fan, -1, -1, 0, most, limit) < np.inf


@answers(moves.shift, Freedom)
@inner
def _shift(free: Freedom, live: Live, v: int, most: int, limit: float, state: np.ndarray) -> int:
    if not take_star(live, free.fan, v):
        return -1
    inside = is_covered(live, free.fan)
    if not inside and not free.moves_outline:
        return -1
    if inside:
        w = stroll(free.indptr, free.indices, v, 1 + below(state, 3), state)
    else:
        w = stroll(free.border_indptr, free.border_indices, v, 1 + below(state, 3), state)
    if live.site[w]:
        return -1
    fill_around(free.fan, w)
    if inside:
        change = _inside(free, live, free.fan, v, w, limit)
    else:
        change = _outside(free, live, free.fan, v, w, 0, most, limit)
    return w if change < np.inf else -1


@inner
def stroll(indptr: np.ndarray, indices: np.ndarray, v: int, steps: int, state: np.ndarray) -> int:
    """Walk at random on a graph."""
    w = v
    for _ in range(steps):
        degree = indptr[w + 1] - indptr[w]
        if degree == 0:
            break
        w = np.int64(indices[indptr[w] + below(state, degree)])
    return w


@inner
def _take_around(g: Ground, live: Live, fan: Fan, t: int, w: int) -> bool:
    """Let the cavity be triangle t, or the two at its side on which vertex w lies, and w the apex.

    Returns False where w is at a corner.
    """
    mesh = live.mesh
    on = -1
    for e in range(3):
        if turn(g.xy, mesh[t + e], mesh[t + (e + 1) % 3], w, g.exact_area) == 0:
            if on >= 0:
                return False
            on = e
    if on < 0:
        take_triangle(live, fan, t)
    else:
        s = np.int64(mesh[t + on + 4]) & TRIANGLE
        if (mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX:
            return False
        take_pair(live, fan, t + on)
    fill_around(fan, w)
    return True


@inner
def _wanted_in(free: Freedom, live: Live, t: int, state: np.ndarray) -> int:
    """Draw a vertex of the list of emitted triangle t, or take the one that deviates most; -1: there is none."""
    g = free.ground
    mesh = live.mesh
    a, b, c = np.int64(mesh[t]), np.int64(mesh[t + 1]), np.int64(mesh[t + 2])
    worst = unit(state) < 0.5
    found = np.int64(-1)
    n = 0
    most = -1.0
    i = np.int64(live.head[t >> 3])
    while i >= 0:
        if i < free.n_vertices and not is_on_line(g.lines, i):
            if worst:
                d = deviation_in(g.xy, g.z, a, b, c, i)
                if d > most:
                    most = d
                    found = i
            else:
                n += 1
                if below(state, n) == 0:
                    found = i
        i = np.int64(live.following[i])
    return found


@inner
def _meet(one: Fan, two: Fan) -> bool:
    """Whether two cavities share a triangle."""
    for q in range(one.number[N_CAVITY]):
        for p in range(two.number[N_CAVITY]):
            if one.cavity[q] == two.cavity[p]:
                return True
    return False


@answers(moves.swap, Freedom)
@inner
def _swap(
    free: Freedom, live: Live, v: int, most: int, limit: float, first: float, share: float, state: np.ndarray
) -> int:
    if not take_star(live, free.fan, v):
        return -1
    if is_covered(live, free.fan):
        return _swap_inside(free, live, v, most, limit, first, share, state)
    return _swap_outline(free, live, v, most, limit, state) if free.moves_outline else -1


@inner
def _swap_inside(
    free: Freedom, live: Live, v: int, most: int, limit: float, first: float, share: float, state: np.ndarray
) -> int:
    """Let site v inside the mesh collapse and a vertex come where the cost is large; return that, -1: nothing changed.

    The cavity is the star of v, which stays where there is room for two triangles more.
    """
    fan = free.fan
    other = free.other
    n_records = live.tally[END] >> 3
    t = np.int64(-1)
    for _ in range(TRIES):
        r = drawn(n_records, first, share, state)
        if live.kind[r] & EMITTED and (t < 0 or live.subtotal[r] > live.subtotal[t >> 3]):
            t = r * RECORD
    if t < 0:
        return -1
    w = _wanted_in(free, live, t, state)
    if w < 0 or not _take_around(free.ground, live, other, t, w) or not is_covered(live, other):
        return -1
    if live.tally[N_EMITTED] + 2 <= most:
        return w if _inside(free, live, other, -1, w, limit) < np.inf else -1
    if _meet(fan, other) or not has_shape(free, other):
        return -1
    fill_from(fan, below(state, fan.number[N_RING]))
    if not has_shape(free, fan):
        return -1
    gain = tried(free, live, other, -1, w, np.inf)
    if not tried(free, live, fan, v, -1, limit - gain) < np.inf:
        return -1
    if not is_inside_all(free, fan) or not is_inside_all(free, other):
        return -1
    done(free, live, fan, v, -1)
    _take_around(free.ground, live, other, t, w)  # what lies beyond its rim may be the fan that came
    done(free, live, other, -1, w)
    return w


@inner
def _swap_outline(free: Freedom, live: Live, v: int, most: int, limit: float, state: np.ndarray) -> int:
    """Let site v of the outline collapse along it and another one of the original's border come; as `_swap_inside`."""
    g = free.ground
    fan = free.fan
    other = free.other
    mesh = live.mesh
    w = np.int64(-1)
    worst = -1.0
    for _ in range(TRIES):
        i = np.int64(free.border[below(state, len(free.border))])
        if live.site[i] or is_on_line(g.lines, i):
            continue
        amount = live.cost[i]
        if live.bare[i] == COVERED:
            t = np.int64(live.place[i])
            amount = cost_at(free, i, deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i))
        if amount > worst:
            worst = amount
            w = i
    if w < 0 or not _take_around(g, live, other, np.int64(live.place[w]), w):
        return -1
    room = most - live.tally[N_EMITTED]
    more = is_shown(free, live, other)
    if more <= 0 or more > room + 2:
        return -1
    if more <= room:
        return w if done_outside(free, live, other, -1, w, limit) < np.inf else -1
    r = _along_outline(live, fan, state)
    if r < 0 or fan.ring[r] >= free.n_vertices:
        return -1
    fill_from(fan, r)
    if is_shown(free, live, fan) != -more:
        return -1
    # What both can do at best is known sooner than what they do.
    least = at_least(free, live, other, -1, w, np.inf)
    if not _meet(fan, other) and not at_least(free, live, fan, v, -1, limit - least) < np.inf:
        return -1
    u = fan.ring[r]
    gain = done_outside(free, live, other, -1, w, np.inf)
    if take_star(live, fan, v):
        for q in range(fan.number[N_RING]):
            if fan.ring[q] == u:
                fill_from(fan, q)
                if _outside(free, live, fan, v, -1, -more, most, limit - gain) < np.inf:
                    return w
                break
    undone(free, live, other)
    return -1


@inner
def _along_outline(live: Live, fan: Fan, state: np.ndarray) -> int:
    """Draw a vertex of the ring of a site on the outline that follows it there; -1: the site is on none."""
    m = fan.number[N_RING]
    found = -1
    n = 0
    for r in range(m):
        mine = live.kind[fan.cavity[r] >> 3] & EMITTED
        theirs = live.kind[fan.cavity[r - 1 if r > 0 else m - 1] >> 3] & EMITTED
        if mine != theirs:
            n += 1
            if below(state, n) == 0:
                found = r
    return found


@entry
def anneal_freely(
    freedom: Freedom,
    books: Live,
    movable: np.ndarray,
    n_movable: np.ndarray,
    n_moves: int,
    hot: float,
    cold: float,
    most: int,
    shares: FreeShares,
    state: np.ndarray,
    stop: np.ndarray,
    visited: np.ndarray,
    accepted: np.ndarray,
) -> int:
    """Walk among free meshes of at most ``most`` triangles; return the number of moves that were tried.

    The temperature falls from ``hot`` to ``cold``; 0 accepts improvements only. ``movable[:n_movable[0]]`` are the
    sites that may go, ``visited`` the steps made so far, ``accepted`` counts flips, shifts and swaps.
    """
    free = borrowed(freedom)
    live = borrowed(books)
    state = borrowed(state)
    movable = borrowed(movable)
    temperature = hot
    n_records = live.tally[END] >> 3
    share = min(WINDOW / n_records, 1.0)
    first = 0.0
    for step in range(n_moves):
        if step % 64 == 0:
            if stop[0]:
                visited[0] += step
                return step
            n_records = live.tally[END] >> 3
            if share < 1.0:
                first = 0.5 * share * ((visited[0] + step) // VISIT)
                first -= int(first)
            temperature = hot * (cold / hot) ** (step / n_moves) if hot > 0.0 else 0.0
        # what costs nothing is refused in the end: it would go on for ever
        limit = -temperature * np.log(unit(state)) if hot > 0.0 else -1e-300
        what = unit(state)
        if what < shares.flip or n_movable[0] == 0:
            t = drawn(n_records, first, share, state) * RECORD
            accepted[0] += flip(free, live, t + below(state, 3), most, limit, state)
            continue
        q = drawn(n_movable[0], first, share, state)
        v = movable[q]
        if what < shares.flip + shares.shift:
            w = shift(free, live, v, most, limit, state)
            accepted[1] += w >= 0
        else:
            w = swap(free, live, v, most, limit, first, share, state)
            accepted[2] += w >= 0
        if w >= 0:
            if live.site[v]:  # there was room for one more
                q = n_movable[0]
                n_movable[0] += 1
            movable[q] = w
    settle(free, live)
    visited[0] += n_moves
    return n_moves


@answers(moves.settle, Freedom)
@inner
def _settle(free: Freedom, live: Live) -> None:
    retake(live, len(free.ground.z))


@answers(moves.take_numbers, Freedom)
@inner
def _take_numbers(free: Freedom, live: Live, share: np.ndarray, row: np.ndarray) -> None:
    g = free.ground
    mesh = live.mesh
    n = free.n_vertices
    for k in range(REGIONS + 1):
        row[k] = np.nan
    for k in (ERROR, VERTICES, SQUARES, MAXIMUM, UNCOVERED, REGIONS):
        row[k] = 0.0
    row[TRIANGLES] = live.tally[N_EMITTED]
    for i in range(n + len(share)):
        d = 0.0
        if live.bare[i] != COVERED:
            h = np.int64(live.bare_segment[i])
            is_bare = True
            if h != NONE:
                a, b, c = corners_of(mesh, h)
                d = bare_deviation(g, a, b, c, i, live.bare_gap[i])
                is_bare = not is_hardly_bare(g.xy, a, b, c, i, live.bare_gap[i])
            if i < n and is_bare:
                row[UNCOVERED] += 1.0
        elif i < n and live.site[i]:
            row[VERTICES] += 1.0
        else:
            t = np.int64(live.place[i])
            d = deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i)
        if i >= n:
            row[REGIONS] += share[i - n] * d
            continue
        w = free.points[i, 3]
        row[ERROR] += w * d
        row[SQUARES] += w * d * d
        if w > 0.0:
            row[MAXIMUM] = max(row[MAXIMUM], d)
    if len(share) == 0:
        row[REGIONS] = np.nan


# ------------------------------------------------------------------------------- thinning: answers to `surface.moves`


@answers(moves.total_cost, Freedom)
@inner(inline=True)
def _total_cost(free: Freedom, live: Live) -> float:
    return live.amount[COVERED_ERROR] + live.amount[BARE_ERROR]


@answers(moves.error_now, Freedom)
@inner(inline=True)
def _error_now(free: Freedom, live: Live) -> float:
    return live.amount[COVERED_ERROR] + live.amount[BARE_ERROR]


@answers(moves.ranked, Freedom)
@inner(inline=True)
def _ranked(free: Freedom, live: Live, change: float) -> tuple[float, float]:
    return change, 0.0


@answers(moves.n_triangles, Freedom)
@inner(inline=True)
def _n_triangles(free: Freedom, live: Live) -> int:
    return live.tally[N_EMITTED]


@answers(moves.is_site, Freedom)
@inner(inline=True)
def _is_site(free: Freedom, live: Live, v: int) -> bool:
    return live.site[v] != 0 and live.used[v] > 0


@answers(moves.effort, Freedom)
@inner(inline=True)
def _effort(free: Freedom, live: Live) -> int:
    return free.fan.number[N_CAVITY]


@answers(moves.try_exchange, Freedom)
@inner
def _try_exchange(free: Freedom, live: Live, v: int, w: int, limit: float) -> tuple[float, int]:
    """Return the least change of cost by which site v collapses, and that of the number of triangles; ``w`` is -1.

    ``free.onto`` notes the neighbour. No other triangle comes or goes than the two at the edge, or the one at an edge
    of the outline.
    """
    fan = free.fan
    best = np.inf
    triangles = 0
    if not take_star(live, fan, v):
        return best, triangles
    inside = is_covered(live, fan)
    if not inside and not free.moves_outline:
        return best, triangles
    m = fan.number[N_RING]
    for r in range(m):
        if fan.ring[r] >= free.n_vertices or not _collapses(free, live, r, inside):
            continue
        if inside:
            change = tried(free, live, fan, v, -1, min(limit, best))
        elif at_least(free, live, fan, v, -1, min(limit, best)) < np.inf:
            change = done_outside(free, live, fan, v, -1, min(limit, best))
            if change < np.inf:
                undone(free, live, fan)
        else:
            change = np.inf
        if change < best:
            best = change
            free.onto[v] = fan.ring[r]
            triangles = -2 if inside else -1
    return best, triangles


@inner
def _collapses(free: Freedom, live: Live, r: int, inside: bool) -> bool:
    """Whether the site whose star is the cavity can collapse onto vertex r of the ring."""
    fan = free.fan
    fill_from(fan, r)
    if inside:
        return has_shape(free, fan) and is_inside_all(free, fan)
    if is_shown(free, live, fan) != -1:
        return False
    for k in range(fan.number[N_RING] - 2):
        # each triangle that stays, with another corner, is what it was
        if (live.kind[fan.cavity[side_of(fan, k)] >> 3] & EMITTED != 0) != (fan.shown[k] != 0):
            return False
    return True


@answers(moves.exchange, Freedom)
@inner
def _exchange(free: Freedom, live: Live, v: int, w: int) -> bool:
    """Let site v collapse onto ``free.onto[v]``; ``w`` is -1. Returns False, with nothing changed, where it cannot."""
    fan = free.fan
    if not take_star(live, fan, v):
        return False
    inside = is_covered(live, fan)
    for r in range(fan.number[N_RING]):
        if fan.ring[r] == free.onto[v]:
            if not _collapses(free, live, r, inside):
                return False
            if inside:
                tried(free, live, fan, v, -1, np.inf)
                done(free, live, fan, v, -1)
                return True
            return done_outside(free, live, fan, v, -1, np.inf) < np.inf
    return False


@answers(moves.sites_around, Freedom)
@inner
def _sites_around(free: Freedom, live: Live, v: int, found: np.ndarray) -> int:
    fan = free.fan
    if not take_star(live, fan, v):
        return 0
    n = 0
    for r in range(fan.number[N_RING]):
        if fan.ring[r] < free.n_vertices:
            found[n] = fan.ring[r]
            n += 1
    return n


# ------------------------------------------------------------------------------------------------------------ in Python


class FreeGround:
    """What the free meshes of one surface have in common.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices.
    rules : Rules
        What counts; their measure is what is lowered.
    ground : Ground
        Of these.
    pinned : (N,) bool array
        Vertices that stay.
    sites : callable
        Returns the rows of kept vertices (N,), one for each place: one of those that stay where there is one.
    centroids : bool
        Whether the centroids of the original faces are samples too, together of `CENTROIDS` of the weight of all
        vertices: each has the share of its face's area, and the weight of its corners.
    """

    def __init__(
        self,
        model: OpenModel,
        rules: Rules,
        ground: Ground,
        pinned: BoolArray,
        sites: Callable[[BoolArray, BoolArray], IntArray],
        *,
        centroids: bool,
    ) -> None:
        n = model.n_vertices
        weights = np.ones(n) if model.weights is None else model.weights
        share = np.empty(0)
        if centroids:
            ground, share, rows = with_centroids(ground, model)
            weights = np.concatenate([weights, CENTROIDS * n * share * weights[model.faces[rows]].mean(axis=1)])
        n_samples = len(ground.z)
        low, high = -FAR, 1.0 + FAR
        xy = np.vstack([ground.xy.reshape(-1, 2), [[high, high], [low, high], [low, low], [high, low]]])
        points = np.zeros((n_samples + 4, 4))
        points[:, :2] = xy
        points[:n_samples, 2] = ground.z
        points[:n_samples, 3] = weights
        indptr, indices = model.neighbours
        start = np.repeat(np.arange(n), np.diff(indptr))
        on_border = np.zeros(n, np.bool_)
        on_border[model.border] = True
        both = on_border[start] & on_border[indices]
        self.name = model.name
        self.pinned = pinned
        #: Vertices that stay where they are kept (N,): the pinned ones, and all on break lines.
        self.held = pinned | (ground.lines.at >= 0) if len(ground.lines.at) else pinned
        #: Share of each sample behind the vertices in the area (K,): those of the centroids, or none.
        self.share = share
        self._sites = sites
        self._freedom = Freedom(
            ground=ground._replace(
                xy=xy.ravel(),
                exact_area=exact_ranges(xy)[0],
                weight=weights,
                weighed=True,
                by_peak=False,
                own=1.0,
                bound=np.inf,
            ),
            points=points,
            n_vertices=n,
            border=np.flatnonzero(on_border),
            indptr=indptr,
            indices=indices,
            border_indptr=np.concatenate([[0], np.cumsum(np.bincount(start[both], minlength=n))]).astype(indptr.dtype),
            border_indices=indices[both],
            moves_outline=rules.footprint == "model",
            ratio=0.0,
            height=LEAST_HEIGHT,
            onto=np.empty(0, np.int32),
            fan=make_fan(0),
            other=make_fan(0),
        )
        self._rooms = Reserve(partial(_make_room, n, n_samples), n_samples < LARGE)

    @contextmanager
    def triangulation(self, kept: BoolArray, *, min_height: float = USUAL_RATIO) -> Iterator[FreeTriangulation]:
        """Lend the mesh of a subset (N,), to be changed freely until the context ends; see `FreeTriangulation`."""
        with self._rooms.one() as (live, fan, other, onto):
            freedom = self._freedom._replace(ratio=float(min_height), onto=onto, fan=fan, other=other)
            build(freedom.ground, live, self._sites(kept, self.pinned), self.name)
            _open(freedom, live, len(freedom.ground.z))
            yield FreeTriangulation(freedom, live, self.held)


def _make_room(n_vertices: int, n_samples: int) -> tuple[Live, Fan, Fan, IntArray]:
    live = make_live(n_samples)
    live.bare[:] = COVERED
    return live, make_fan(n_samples), make_fan(n_samples), np.empty(n_vertices, np.int32)


class FreeTriangulation:
    """A free mesh that is changed by moves; `FreeGround.triangulation` lends one.

    Attributes
    ----------
    freedom, books : records
        What the compiled functions work on: of height surfaces, or of another kind in a class that says what differs.
    held : (N,) bool array
        Vertices that neither move nor collapse.
    accepted : (3,) int array
        How many flips, shifts and swaps were made.
    """

    def __init__(self, freedom: Any, books: Any, held: BoolArray) -> None:
        self.freedom = freedom
        self.books = books
        self.held = held
        n = freedom.n_vertices
        rows = np.flatnonzero((books.site[:n] == 1) & self._may_move() & ~held)
        self._movable = np.empty(n, np.int64)
        self._movable[: len(rows)] = rows
        self._n_movable = np.array([len(rows)])
        self._visited = np.zeros(1, np.int64)
        self.accepted = np.zeros(3, np.int64)

    def _may_move(self) -> BoolArray:
        """Return which vertices (N,) may move where they are sites and not held."""
        return np.asarray(self.books.used[: self.freedom.n_vertices] > 0)

    @property
    def faces(self) -> IntArray:
        """The triangles (M, 3) as rows of the model's points, the least row first, sorted."""
        end = int(self.books.tally[END])
        records = self.books.mesh[:end].reshape(-1, RECORD)[:, :3].astype(np.int64)
        return canonical_faces(records[(self.books.kind[: end // RECORD] & EMITTED) != 0])

    @property
    def triangles(self) -> int:
        """The number of triangles."""
        return int(self.books.tally[N_EMITTED])

    @property
    def cost(self) -> float:
        """The sum of the costs of all samples, in the measure of the rules."""
        return max(float(self.books.amount[[COVERED_ERROR, BARE_ERROR]].sum()), 0.0)

    @property
    def movable(self) -> int:
        """The number of vertices that may move."""
        return int(self._n_movable[0])

    def anneal(
        self,
        moves: int,
        state: np.ndarray,
        *,
        hot: float,
        cold: float,
        triangles: int,
        shares: FreeShares = USUAL_SHARES,
        stop: BoolArray | None = None,
    ) -> int:
        """Try so many moves, the temperature falling from ``hot`` to ``cold``; return how many were tried.

        Parameters
        ----------
        moves : int
            How many.
        state : (1,) uint64 array
            Of the random numbers, not 0; it goes on.
        hot, cold : float
            Temperatures, in the unit of the costs; 0 accepts improvements only.
        triangles : int
            The most triangles.
        shares : FreeShares
            How often each move is tried.
        stop : (1,) bool array, optional
            Ends it where another thread sets it.
        """
        return int(
            anneal_freely(
                self.freedom,
                self.books,
                self._movable,
                self._n_movable,
                moves,
                hot,
                cold,
                triangles,
                shares,
                state,
                np.zeros(1, np.bool_) if stop is None else stop,
                self._visited,
                self.accepted,
            )
        )
