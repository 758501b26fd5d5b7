"""Fans: every change of a free triangulation takes some triangles away and fills the place by a fan from one vertex.

What is taken away (the *cavity*) is a polygon, its *ring*; the fan's *apex* is a vertex inside it or one of the ring:

* an edge flips: the two triangles at it go, the apex is one of the corners across it;
* a vertex moves: its star goes, the apex is where it moves to, inside the star;
* a vertex collapses: its star goes, the apex is a neighbour;
* a vertex comes: the triangle that holds it goes, or the two at the edge that does, and it is the apex.

Where all that goes and comes is emitted, the region of the mesh stays and only the samples of the cavity cost something
else: `tried` finds the exact change, `done` makes it. Where the outline is touched, `done_outside` changes the books as
a live triangulation does, with all that it means for bare vertices, and `undone` takes it back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.conflict import turn
from meshsimp_pymoo.plane.triangulation import INFINITE, LAST_INDEX, RECORD, TRIANGLE
from meshsimp_pymoo.surface.bare import forget_bare, is_segment, set_segment, settle_bare, slot
from meshsimp_pymoo.surface.books import (
    BARE_ERROR,
    COVERED_ERROR,
    EMITTED,
    N_EMITTED,
    N_FREE,
    N_POOL,
    N_REGION,
    N_SITES,
    N_TOUCHED,
    PEAK,
    PLAIN,
    Live,
)
from meshsimp_pymoo.surface.costs import is_inside
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.live import MOST_LOOKED_THROUGH, collect, enter_region, new_record

# Vertices with more triangles around stay where they are; the most in searches are some 20.
MOST_AROUND = MOST_LOOKED_THROUGH

# Entries of ``number``: triangles that go, vertices of the ring, the side of the ring that the fan's first triangle
# stands on, the fan's triangles, its apex, and the samples that were looked at.
N_CAVITY, N_RING, FIRST, N_FAN, APEX, N_SAMPLES = range(6)

# What is said of a fan that cannot be.
NOT = 1 << 30


class Fan(NamedTuple):
    """One change: what goes and what comes. Sides of the ring are counted counter-clockwise."""

    number: np.ndarray  # (6,) see the names above
    cavity: np.ndarray  # (MOST_AROUND,) triangles that go
    ring: np.ndarray  # (MOST_AROUND,) where each side of the ring starts
    rim: np.ndarray  # (MOST_AROUND,) the halfedge beyond it
    record: np.ndarray  # (MOST_AROUND,) the fan's triangles, once they are there
    ray: np.ndarray  # (MOST_AROUND + 1, 2) from the apex to the ring
    rise: np.ndarray  # (MOST_AROUND, 2) of the plane of each triangle
    cost: np.ndarray  # (MOST_AROUND,) of each triangle
    sample: np.ndarray  # (S,) those looked at
    owner: np.ndarray  # (S,) the triangle of the fan in which each lies
    shown: np.ndarray  # (MOST_AROUND,) whether each triangle of the fan is emitted
    saved: np.ndarray  # (MOST_AROUND, 8) records of the cavity, to take a change back
    was: np.ndarray  # (MOST_AROUND,) their kinds
    inside: np.ndarray  # (MOST_AROUND,) the halfedges on this side of the rim, before
    sums: np.ndarray  # (3,) the sums before
    moved: np.ndarray  # (2,) the site that went and the vertex that came, -1: none


class Freedom(NamedTuple):
    """What does not change while a free mesh is searched, but for the room of two changes; N vertices, S samples."""

    ground: Ground  # of the samples: the vertices, and maybe others behind them, then the four far corners
    points: np.ndarray  # (S + 4, 4) place in the unit square, height and weight of each
    n_vertices: int
    border: np.ndarray  # (B,) vertices of the original's border
    indptr: np.ndarray  # one-rings of the original mesh
    indices: np.ndarray
    border_indptr: np.ndarray  # the same from border to border
    border_indices: np.ndarray
    moves_outline: bool  # whether the outline may change
    ratio: float  # least height of triangles that come, as a share of their longest edge
    height: float  # least height of these in the unit square
    onto: np.ndarray  # (N,) the neighbour that each vertex would collapse onto, or did
    fan: Fan
    other: Fan


def make_fan(n_samples: int) -> Fan:
    """Return room for one change among so many samples."""
    most = MOST_AROUND
    return Fan(
        number=np.zeros(6, np.int64),
        cavity=np.zeros(most, np.uint32),
        ring=np.zeros(most, np.uint32),
        rim=np.zeros(most, np.uint32),
        record=np.zeros(most + 2, np.uint32),
        ray=np.zeros((most + 1, 2)),
        rise=np.zeros((most, 2)),
        cost=np.zeros(most),
        sample=np.empty(n_samples + 1, np.int32),
        owner=np.empty(n_samples + 1, np.int16),
        shown=np.zeros(most, np.uint8),
        saved=np.zeros((most, RECORD), np.uint32),
        was=np.zeros(most, np.uint16),
        inside=np.zeros(most, np.uint32),
        sums=np.zeros(3),
        moved=np.zeros(2, np.int64),
    )


# ------------------------------------------------------------------------------------------------------- what would go


@inner
def take_star(live: Live, fan: Fan, v: int) -> bool:
    """Let the cavity be the star of site v; False where it is too large."""
    mesh = live.mesh
    first = np.int64(live.place[v])
    t = first
    m = 0
    while True:
        if m == MOST_AROUND:
            return False
        k = 0 if mesh[t] == v else (1 if mesh[t + 1] == v else 2)
        opposite = t + (k + 1) % 3
        fan.cavity[m] = t
        fan.ring[m] = mesh[opposite]
        fan.rim[m] = mesh[opposite + 4]
        m += 1
        t = np.int64(mesh[t + (k + 2) % 3 + 4]) & TRIANGLE
        if t == first:
            break
    fan.number[N_CAVITY] = m
    fan.number[N_RING] = m
    return True


@inner
def take_pair(live: Live, fan: Fan, h: int) -> None:
    """Let the cavity be the two triangles at the edge of halfedge h; the ring starts at the corner across from it."""
    mesh = live.mesh
    twin = np.int64(mesh[h + 4])
    t, s = h & TRIANGLE, twin & TRIANGLE
    fan.cavity[0] = t
    fan.cavity[1] = s
    for j in range(4):
        side = t + ((h & 3) + 2 - (j == 3)) % 3 if j == 0 or j == 3 else s + ((twin & 3) + j) % 3
        fan.ring[j] = mesh[side]
        fan.rim[j] = mesh[side + 4]
    fan.number[N_CAVITY] = 2
    fan.number[N_RING] = 4


@inner
def take_triangle(live: Live, fan: Fan, t: int) -> None:
    """Let the cavity be one triangle."""
    mesh = live.mesh
    fan.cavity[0] = t
    for j in range(3):
        fan.ring[j] = mesh[t + j]
        fan.rim[j] = mesh[t + j + 4]
    fan.number[N_CAVITY] = 1
    fan.number[N_RING] = 3


@inner
def fill_around(fan: Fan, w: int) -> None:
    """Let vertex w, inside the ring, be the apex."""
    fan.number[FIRST] = 0
    fan.number[N_FAN] = fan.number[N_RING]
    fan.number[APEX] = w


@inner
def fill_from(fan: Fan, r: int) -> None:
    """Let vertex r of the ring be the apex."""
    m = fan.number[N_RING]
    fan.number[FIRST] = r + 1 if r + 1 < m else 0
    fan.number[N_FAN] = m - 2
    fan.number[APEX] = fan.ring[r]


@inner(inline=True)
def side_of(fan: Fan, k: int) -> int:
    """Return the side of the ring on which triangle k of the fan stands."""
    j = fan.number[FIRST] + k
    return j if j < fan.number[N_RING] else j - fan.number[N_RING]


@inner
def is_covered(live: Live, fan: Fan) -> bool:
    """Whether all triangles that go are emitted."""
    for q in range(fan.number[N_CAVITY]):
        if not live.kind[fan.cavity[q] >> 3] & EMITTED:
            return False
    return True


# ------------------------------------------------------------------------------------------- where the region stays


@inner(inline=True)
def _is_high(free: Freedom, ux: float, uy: float, vx: float, vy: float) -> bool:
    """Whether a triangle with these two edges from one corner, counter-clockwise, is as high as it must be."""
    wx = vx - ux
    wy = vy - uy
    area = ux * vy - uy * vx
    longest = max(ux * ux + uy * uy, vx * vx + vy * vy, wx * wx + wy * wy)
    return area >= free.ratio * longest and area >= free.height * np.sqrt(longest)


@inner
def has_shape(free: Freedom, fan: Fan) -> bool:
    """Whether all triangles of the fan are as they must be; fill their rays and planes."""
    points = free.points
    ray = fan.ray
    rise = fan.rise
    apex = fan.number[APEX]
    n = fan.number[N_FAN]
    x0, y0, z0 = points[apex, 0], points[apex, 1], points[apex, 2]
    i = np.int64(fan.ring[side_of(fan, 0)])
    ux, uy, uz = points[i, 0] - x0, points[i, 1] - y0, points[i, 2] - z0
    ray[0, 0] = ux
    ray[0, 1] = uy
    for k in range(n):
        i = np.int64(fan.ring[side_of(fan, k + 1)])
        vx, vy, vz = points[i, 0] - x0, points[i, 1] - y0, points[i, 2] - z0
        area = ux * vy - uy * vx
        if not _is_high(free, ux, uy, vx, vy):
            return False
        ray[k + 1, 0] = vx
        ray[k + 1, 1] = vy
        rise[k, 0] = (uz * vy - uy * vz) / area
        rise[k, 1] = (ux * vz - uz * vx) / area
        ux, uy, uz = vx, vy, vz
    return True


@inner(inline=True)
def cost_at(free: Freedom, i: int, d: float) -> float:
    """Return what sample i costs where d_p = d: as `costs.weighed_cost`, its weight beside its place."""
    power = free.ground.power
    if power > 1:
        d *= free.ground.scale
        d *= d
        if power == 8:
            d *= d
            d *= d
    return free.points[i, 3] * d


@inner(inline=True)
def _sector(ray: np.ndarray, n: int, k: int, dx: float, dy: float) -> int:
    """Return which triangle of a fan of n holds what is at (dx, dy) from the apex; ``k`` is looked at first.

    They are sectors of less than half a turn each, of more than that together.
    """
    step = 0
    for _ in range(n):
        if ray[k, 0] * dy - ray[k, 1] * dx < 0.0:
            step = -1 if step == 0 else step
        elif ray[k + 1, 0] * dy - ray[k + 1, 1] * dx > 0.0:
            step = 1 if step == 0 else step
        else:
            return k
        k += step
        k = k if k < n else 0
        k = k if k >= 0 else n - 1
    # by rounding in none: the one that it is least outside of
    most = -np.inf
    for q in range(n):
        least = min(ray[q, 0] * dy - ray[q, 1] * dx, ray[q + 1, 1] * dx - ray[q + 1, 0] * dy)
        if least > most:
            most = least
            k = q
    return k


@inner
def tried(free: Freedom, live: Live, fan: Fan, v: int, w: int, limit: float) -> float:
    """Return the change of cost where the fan takes the place of the cavity; infinite where it exceeds ``limit``.

    Site v would go and vertex w would come, -1: none. Rays and planes are known (`has_shape`).
    """
    points = free.points
    ray = fan.ray
    rise = fan.rise
    cost = fan.cost
    sample = fan.sample
    owner = fan.owner
    following = live.following
    n = fan.number[N_FAN]
    first = fan.number[FIRST]
    m = fan.number[N_RING]
    apex = fan.number[APEX]
    x0, y0, z0 = points[apex, 0], points[apex, 1], points[apex, 2]
    n_cavity = fan.number[N_CAVITY]
    before = 0.0
    for q in range(n_cavity):
        before += live.subtotal[fan.cavity[q] >> 3]
    for k in range(n):
        cost[k] = 0.0
    most = before + limit
    whole = 0.0
    n_samples = 0
    for q in range(-1, n_cavity):
        i = np.int64(v) if q < 0 else np.int64(live.head[fan.cavity[q] >> 3])
        # the triangle of the fan on the same side of the ring, where there is one
        k = q - first if q >= first else q - first + m
        k = min(max(k, 0), n - 1)
        while i >= 0:
            if i != w:
                dx = points[i, 0] - x0
                dy = points[i, 1] - y0
                k = _sector(ray, n, k, dx, dy)
                d = cost_at(free, i, abs(z0 + rise[k, 0] * dx + rise[k, 1] * dy - points[i, 2]))
                cost[k] += d
                whole += d
                if whole > most:
                    return np.inf
                sample[n_samples] = i
                owner[n_samples] = k
                n_samples += 1
            i = np.int64(following[i]) if q >= 0 else np.int64(-1)
    fan.number[N_SAMPLES] = n_samples
    return whole - before


@inner
def is_inside_all(free: Freedom, fan: Fan) -> bool:
    """Whether the footprint holds all triangles of the fan."""
    g = free.ground
    if g.footprint.side == 0:
        return True
    for k in range(fan.number[N_FAN]):
        a, b = np.int64(fan.ring[side_of(fan, k)]), np.int64(fan.ring[side_of(fan, k + 1)])
        if not is_inside(g, a, b, fan.number[APEX]):
            return False
    return True


@inner
def _write(live: Live, fan: Fan) -> None:
    """Write the records of the fan, and free those that are left or take new ones."""
    mesh = live.mesh
    record = fan.record
    n = fan.number[N_FAN]
    n_cavity = fan.number[N_CAVITY]
    for k in range(n):
        record[k] = fan.cavity[k] if k < n_cavity else new_record(live)
    for q in range(n, n_cavity):
        t = fan.cavity[q]
        live.free[live.tally[N_FREE]] = t
        live.tally[N_FREE] += 1
        live.kind[t >> 3] = 0
        live.head[t >> 3] = -1
        live.subtotal[t >> 3] = 0.0
        # An unused record is a ghost to whoever scans the records.
        mesh[t] = INFINITE
        mesh[t + 1] = INFINITE
        mesh[t + 2] = INFINITE
    is_closed = n == fan.number[N_RING]
    for k in range(n):
        t = record[k]
        h = fan.rim[side_of(fan, k)]
        mesh[t] = fan.ring[side_of(fan, k)]
        mesh[t + 1] = fan.ring[side_of(fan, k + 1)]
        mesh[t + 2] = fan.number[APEX]
        mesh[t + 4] = h
        mesh[h + 4] = t
        if k < n - 1 or is_closed:
            after = record[k + 1 if k < n - 1 else 0]
            mesh[t + 5] = after + 2
            mesh[after + 6] = t + 1
    if not is_closed:
        # the sides of the ring at the apex
        for e in (1, 2):
            t = record[n - 1 if e == 1 else 0]
            j = side_of(fan, n) if e == 1 else (fan.number[FIRST] + fan.number[N_RING] - 1) % fan.number[N_RING]
            h = fan.rim[j]
            mesh[t + e + 4] = h
            mesh[h + 4] = t + e


@inner
def done(free: Freedom, live: Live, fan: Fan, v: int, w: int) -> None:
    """Make the change that `tried` has looked at last with this fan."""
    mesh = live.mesh
    kind = live.kind
    used = live.used
    place = live.place
    head = live.head
    following = live.following
    n = fan.number[N_FAN]
    n_cavity = fan.number[N_CAVITY]
    at_outline = False
    for q in range(n_cavity):
        t = fan.cavity[q]
        live.amount[COVERED_ERROR] -= live.subtotal[t >> 3]
        for k in range(3):
            used[mesh[t + k]] -= 1
        if kind[t >> 3] != PLAIN:
            at_outline = True
            for k in range(3):
                set_segment(live, t + k, False)
    live.tally[N_EMITTED] += n - n_cavity
    if v >= 0:
        live.site[v] = 0
        live.tally[N_SITES] -= 1
    if w >= 0:
        live.site[w] = 1
        live.used[w] = 0
        live.tally[N_SITES] += 1
    _write(live, fan)
    for k in range(n):
        t = fan.record[k]
        kind[t >> 3] = PLAIN
        live.subtotal[t >> 3] = fan.cost[k]
        live.amount[COVERED_ERROR] += fan.cost[k]
        head[t >> 3] = -1
        for e in range(3):
            i = mesh[t + e]
            used[i] += 1
            place[i] = t
    for q in range(fan.number[N_SAMPLES]):
        i = fan.sample[q]
        t = fan.record[fan.owner[q]]
        place[i] = t
        following[i] = head[t >> 3]
        head[t >> 3] = i
    if at_outline:
        for k in range(n):
            t = fan.record[k]
            for e in range(3):
                if not kind[mesh[t + e + 4] >> 3] & EMITTED:
                    set_segment(live, t + e, True)
        settle_bare(free.ground, live)


# ------------------------------------------------------------------------------------------- where the region changes


@inner
def is_shown(free: Freedom, live: Live, fan: Fan) -> int:
    """Find which triangles of the fan would be emitted; return how many more than go, NOT where it is no fan.

    A triangle is emitted where the footprint holds it, and must then have the shape.
    """
    g = free.ground
    points = free.points
    mesh = live.mesh
    apex = fan.number[APEX]
    more = 0
    for q in range(fan.number[N_CAVITY]):
        t = fan.cavity[q]
        if (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX:
            return NOT
        more -= (live.kind[t >> 3] & EMITTED) != 0
    for k in range(fan.number[N_FAN]):
        a, b = np.int64(fan.ring[side_of(fan, k)]), np.int64(fan.ring[side_of(fan, k + 1)])
        if turn(g.xy, a, b, apex, g.exact_area) <= 0:
            return NOT
        fan.shown[k] = 0
        if max(a, b, apex) < free.n_vertices and is_inside(g, a, b, apex):
            x0, y0 = points[apex, 0], points[apex, 1]
            if not _is_high(free, points[a, 0] - x0, points[a, 1] - y0, points[b, 0] - x0, points[b, 1] - y0):
                return NOT
            fan.shown[k] = 1
            more += 1
    return more if live.tally[N_EMITTED] + more > 0 else NOT


@inner
def at_least(free: Freedom, live: Live, fan: Fan, v: int, w: int, limit: float) -> float:
    """Return a change of cost that is hardly undercut: bare vertices cost nothing then; inf where it exceeds a limit.

    Which triangles would be emitted is known (`is_shown`). Only vertices that are nearer to a new segment of the
    outline than to theirs may lower it more.
    """
    points = free.points
    n = fan.number[N_FAN]
    n_cavity = fan.number[N_CAVITY]
    apex = fan.number[APEX]
    mesh = live.mesh
    x0, y0, z0 = points[apex, 0], points[apex, 1], points[apex, 2]
    change = 0.0
    for q in range(n_cavity):
        t = fan.cavity[q]
        if live.kind[t >> 3] & EMITTED:
            change -= live.subtotal[t >> 3]
            for e in range(3):
                if is_segment(live.kind, t + e):
                    change -= _cost_on(live, t + e)
        else:
            for e in range(3):
                h = mesh[t + e + 4]
                if is_segment(live.kind, h) and not _goes(fan, h & TRIANGLE):
                    change -= _cost_on(live, h)
    ray = fan.ray
    rise = fan.rise
    for k in range(n + 1):
        i = np.int64(fan.ring[side_of(fan, k)])
        ray[k, 0] = points[i, 0] - x0
        ray[k, 1] = points[i, 1] - y0
    for k in range(n):
        if fan.shown[k]:
            i, j = np.int64(fan.ring[side_of(fan, k)]), np.int64(fan.ring[side_of(fan, k + 1)])
            uz, vz = points[i, 2] - z0, points[j, 2] - z0
            area = ray[k, 0] * ray[k + 1, 1] - ray[k, 1] * ray[k + 1, 0]
            rise[k, 0] = (uz * ray[k + 1, 1] - ray[k, 1] * vz) / area
            rise[k, 1] = (ray[k, 0] * vz - uz * ray[k + 1, 0]) / area
    for q in range(-1, n_cavity):
        i = np.int64(v) if q < 0 else np.int64(live.head[fan.cavity[q] >> 3])
        k = 0
        while i >= 0:
            if i != w:
                dx = points[i, 0] - x0
                dy = points[i, 1] - y0
                k = _sector(ray, n, k, dx, dy)
                if fan.shown[k]:
                    change += cost_at(free, i, abs(z0 + rise[k, 0] * dx + rise[k, 1] * dy - points[i, 2]))
            i = np.int64(live.following[i]) if q >= 0 else np.int64(-1)
        if change > limit:
            return np.inf
    return change


@inner
def _goes(fan: Fan, t: int) -> bool:
    for q in range(fan.number[N_CAVITY]):
        if fan.cavity[q] == t:
            return True
    return False


@inner
def _cost_on(live: Live, h: int) -> float:
    """Return what the bare vertices nearest to a segment cost."""
    cost = 0.0
    i = np.int64(live.first_bare[slot(h)])
    while i >= 0:
        cost += live.cost[i]
        i = np.int64(live.bare_after[i])
    return cost


@inner
def done_outside(free: Freedom, live: Live, fan: Fan, v: int, w: int, limit: float) -> float:
    """Let the fan take the place of a cavity that is not all emitted; return the change of cost.

    Where it exceeds ``limit`` nothing is left changed, and inf is returned. Which triangles are emitted is known
    (`is_shown`).
    """
    mesh = live.mesh
    kind = live.kind
    n = fan.number[N_FAN]
    n_cavity = fan.number[N_CAVITY]
    for q in range(n_cavity):
        t = fan.cavity[q]
        fan.was[q] = kind[t >> 3] & PLAIN
        for e in range(RECORD):
            fan.saved[q, e] = mesh[t + e]
    for j in range(fan.number[N_RING]):
        fan.inside[j] = mesh[fan.rim[j] + 4]
    amount = live.amount
    fan.sums[0] = amount[COVERED_ERROR]
    fan.sums[1] = amount[BARE_ERROR]
    fan.sums[2] = amount[PEAK]
    amount[PEAK] = 0.0  # nothing is added up anew for what may be taken back
    fan.moved[0] = v
    fan.moved[1] = w
    before = amount[COVERED_ERROR] + amount[BARE_ERROR]
    collect(live, fan.cavity, n_cavity)
    _replace_site(live, v, w)
    _write(live, fan)
    for k in range(n):
        t = fan.record[k]
        kind[t >> 3] = PLAIN if fan.shown[k] else 0
        live.region[k] = t
    live.tally[N_REGION] = n
    enter_region(free.ground, live, False, True)
    change = amount[COVERED_ERROR] + amount[BARE_ERROR] - before
    if not change <= limit:
        undone(free, live, fan)
        return np.inf
    return change


@inner
def undone(free: Freedom, live: Live, fan: Fan) -> None:
    """Take back what `done_outside` did last with this fan; nothing else may have changed since."""
    mesh = live.mesh
    n = fan.number[N_FAN]
    n_cavity = fan.number[N_CAVITY]
    collect(live, fan.record, n)
    _replace_site(live, fan.moved[1], fan.moved[0])
    for k in range(n - 1, n_cavity - 1, -1):
        t = fan.record[k]
        live.free[live.tally[N_FREE]] = t
        live.tally[N_FREE] += 1
        mesh[t] = INFINITE
        mesh[t + 1] = INFINITE
        mesh[t + 2] = INFINITE
    if n < n_cavity:
        live.tally[N_FREE] -= n_cavity - n
    for q in range(n_cavity):
        t = fan.cavity[q]
        for e in range(RECORD):
            mesh[t + e] = fan.saved[q, e]
        live.kind[t >> 3] = fan.was[q]
        live.region[q] = t
    for j in range(fan.number[N_RING]):
        mesh[fan.rim[j] + 4] = fan.inside[j]
    live.tally[N_REGION] = n_cavity
    enter_region(free.ground, live, False, True)
    # the sums are what they were, without the rounding of having come and gone
    live.amount[COVERED_ERROR] = fan.sums[0]
    live.amount[BARE_ERROR] = fan.sums[1]
    live.amount[PEAK] = fan.sums[2]


@inner
def _replace_site(live: Live, v: int, w: int) -> None:
    """Let v be a sample again and w be a site, where their triangles are collected."""
    count = live.tally
    pool = live.pool
    if v >= 0:
        forget_bare(live, v)
        live.site[v] = 0
        count[N_SITES] -= 1
        pool[count[N_POOL]] = v
        count[N_POOL] += 1
    if w >= 0:
        n = 0
        for q in range(count[N_POOL]):
            if pool[q] != w:
                pool[n] = pool[q]
                n += 1
        count[N_POOL] = n
        forget_bare(live, w)
        live.site[w] = 1
        live.used[w] = 0
        count[N_SITES] += 1
        live.touched[count[N_TOUCHED]] = w
        count[N_TOUCHED] += 1
