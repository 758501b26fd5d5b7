"""The bare vertices of a live triangulation and the segments of its outline that are nearest to them.

Vertices lie along a curve that fills the plane, so a run of `RUN` of them is a patch, and a binary tree over these runs
has small boxes. Node 1 is its root, the children of k are 2 k and 2 k + 1, the last nodes are the leaves, one a run.
Each node knows

* the largest gap between a bare vertex of its runs and that vertex' segment (``reach``), which says where a segment
  that comes can be nearer;
* the box of the segments that start in its runs (``spans``), which says where the segment nearest to a vertex can be.

Each segment lists the bare vertices that are nearest to it, so that they are found when it goes. Of segments at equal
distances the one that comes first in the written mesh is nearest, as in :mod:`~meshsimp_pymoo.surface.evaluate`.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.nearest import ROUNDING, between_boxes, to_box
from meshsimp_pymoo.plane.triangulation import TRIANGLE
from meshsimp_pymoo.surface.books import (
    BARE_ERROR,
    COVERED,
    HOMELESS,
    HOUSED,
    N_ADDED,
    N_BARE,
    N_HOMELESS,
    N_STIRRED,
    NONE,
    RUN,
    SEGMENT,
    Live,
)
from meshsimp_pymoo.surface.costs import bare_deviation, counts, enter_peak, noted_cost
from meshsimp_pymoo.surface.evaluate import REACH
from meshsimp_pymoo.surface.ground import Ground

# From so many homeless vertices on, the segments that may be nearest to them are listed once for all.
FEW_TOGETHER = 32


@inner(inline=True)
def slot(h: int) -> int:
    """Return where halfedge h stands in an array of all of them."""
    return (h >> 3) * 3 + (h & 3)


@inner(inline=True)
def is_segment(kind: np.ndarray, h: int) -> bool:
    """Whether halfedge h is a segment of the outline."""
    return (kind[h >> 3] & (SEGMENT << (h & 3))) != 0


@inner(inline=True)
def corners_of(mesh: np.ndarray, h: int) -> tuple[int, int, int]:
    """Return where halfedge h starts and ends, and the third corner of its triangle."""
    t = h & TRIANGLE
    return np.int64(mesh[h]), np.int64(mesh[t + ((h & 3) + 1) % 3]), np.int64(mesh[t + ((h & 3) + 2) % 3])


@inner(inline=True)
def squared_gap(xy: np.ndarray, a: int, b: int, x: float, y: float) -> float:
    """Squared distance in the plane from (x, y) to the segment a-b."""
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
def rank(a: int, b: int, c: int) -> int:
    """Rank of side a-b of (a, b, c) among equally near ones: that of the triangle in the written mesh, then its."""
    if a < b and a < c:
        return (a << 33) | (b << 2)
    if c < b:
        return (c << 33) | (a << 2) | 1
    return (b << 33) | (c << 2) | 2


@inner
def rank_of(mesh: np.ndarray, h: int) -> int:
    """Rank of segment h."""
    a, b, c = corners_of(mesh, h)
    return rank(a, b, c)


@inner(inline=True)
def farthest(g: Ground) -> float:
    """Squared distance beyond which no segment matters to a bare vertex."""
    return np.inf if g.nearest else REACH * REACH


# ----------------------------------------------------------------------------------------------------------- the tree


@inner(inline=True)
def _stir(live: Live, i: int) -> None:
    """Note that what starts at vertex i, or itself, has changed."""
    leaf = i // RUN
    if live.is_stirred[leaf] == 0:
        live.is_stirred[leaf] = 1
        live.stirred[live.tally[N_STIRRED]] = leaf
        live.tally[N_STIRRED] += 1


@inner
def _look_at_leaf(xy: np.ndarray, live: Live, leaf: int) -> tuple[float, float, float, float, float]:
    """Return reach and span of one leaf."""
    reach = -1.0
    for i in range(leaf * RUN, min(leaf * RUN + RUN, len(xy) // 2)):
        if live.bare[i] == HOUSED:
            reach = max(reach, live.bare_gap[i])
    low_x = low_y = np.inf
    high_x = high_y = -np.inf
    h = np.int64(live.first_segment[leaf])
    while h != NONE:
        a, b, _ = corners_of(live.mesh, h)
        low_x = min(low_x, xy[2 * a], xy[2 * b])
        high_x = max(high_x, xy[2 * a], xy[2 * b])
        low_y = min(low_y, xy[2 * a + 1], xy[2 * b + 1])
        high_y = max(high_y, xy[2 * a + 1], xy[2 * b + 1])
        h = np.int64(live.segment_after[slot(h)])
    return reach, low_x, high_x, low_y, high_y


@inner
def _look_at_children(live: Live, node: int) -> tuple[float, float, float, float, float]:
    """Return reach and span of one node that is no leaf."""
    spans = live.spans
    one = 2 * node
    two = one + 1
    return (
        max(live.reach[one], live.reach[two]),
        min(spans[one, 0], spans[two, 0]),
        max(spans[one, 1], spans[two, 1]),
        min(spans[one, 2], spans[two, 2]),
        max(spans[one, 3], spans[two, 3]),
    )


@inner
def _enter(live: Live, node: int, reach: float, low_x: float, high_x: float, low_y: float, high_y: float) -> bool:
    """Write reach and span of a node; return whether something has changed."""
    spans = live.spans
    if (
        live.reach[node] == reach
        and spans[node, 0] == low_x
        and spans[node, 1] == high_x
        and spans[node, 2] == low_y
        and spans[node, 3] == high_y
    ):
        return False
    live.reach[node] = reach
    spans[node, 0] = low_x
    spans[node, 1] = high_x
    spans[node, 2] = low_y
    spans[node, 3] = high_y
    return True


@inner
def _refresh(g: Ground, live: Live) -> None:
    """Bring the tree up to date where leaves were stirred, each time up to where nothing changes."""
    n_leaves = len(live.first_segment)
    for k in range(live.tally[N_STIRRED]):
        leaf = live.stirred[k]
        live.is_stirred[leaf] = 0
        node = n_leaves + leaf
        reach, low_x, high_x, low_y, high_y = _look_at_leaf(g.xy, live, leaf)
        while _enter(live, node, reach, low_x, high_x, low_y, high_y) and node > 1:
            node >>= 1
            reach, low_x, high_x, low_y, high_y = _look_at_children(live, node)
    live.tally[N_STIRRED] = 0


@inner
def clear_bare(live: Live, n: int) -> None:
    """Begin with n vertices, no segment and nothing bare."""
    for i in range(n):
        live.bare[i] = COVERED
    for leaf in range(len(live.first_segment)):
        live.first_segment[leaf] = NONE
        live.is_stirred[leaf] = 0
    for node in range(len(live.reach)):
        live.reach[node] = -1.0
        live.spans[node, 0] = live.spans[node, 2] = np.inf
        live.spans[node, 1] = live.spans[node, 3] = -np.inf


@inner
def nearest(g: Ground, live: Live, x: float, y: float, guess: int, gap: float) -> tuple[int, float]:
    """Return the segment nearest to (x, y) and its squared distance; ``guess`` at ``gap`` where none is nearer.

    Either a segment and its gap, or NONE and how far to look.
    """
    xy = g.xy
    mesh = live.mesh
    kind = live.kind
    spans = live.spans
    nodes = live.nodes
    distances = live.distances
    n_leaves = len(live.first_segment)
    best = guess
    nodes[0] = 1
    distances[0] = to_box(spans, 1, x, y)
    depth = 1
    while depth > 0:
        depth -= 1
        if distances[depth] > gap:
            continue
        node = nodes[depth]
        # Down to a leaf by the nearer child; the other one waits, if it is near enough.
        while 0 < node < n_leaves:
            near = 2 * node
            far = near + 1
            to_near = to_box(spans, near, x, y)
            to_far = to_box(spans, far, x, y)
            if to_far < to_near:
                near, far = far, near
                to_near, to_far = to_far, to_near
            if to_far <= gap and to_far < np.inf:
                nodes[depth] = far
                distances[depth] = to_far
                depth += 1
            node = near if to_near <= gap and to_near < np.inf else 0
        if node == 0:
            continue
        h = np.int64(live.first_segment[node - n_leaves])
        while h != NONE:
            if is_segment(kind, h):
                a, b, c = corners_of(mesh, h)
                d = squared_gap(xy, a, b, x, y)
                if d < gap or (d == gap and (best == NONE or rank(a, b, c) < rank_of(mesh, best))):
                    best = h
                    gap = d
            h = np.int64(live.segment_after[slot(h)])
    return best, gap


@inner
def list_candidates(g: Ground, live: Live, who: np.ndarray, n: int, known: float) -> int:
    """List the segments that can be nearest to one of n vertices; return their number, -1 if it is not worth it.

    That is where the vertices are few, or the segments many. ``known`` is the squared distance to some other segment
    from the middle of the vertices' box, see `middle_of`.
    """
    if n < FEW_TOGETHER:
        return -1
    xy = g.xy
    kind = live.kind
    spans = live.spans
    nodes = live.nodes
    n_leaves = len(live.first_segment)
    x, y, radius = middle_of(xy, who, n)
    gap = known
    if g.nearest:
        _, gap = nearest(g, live, x, y, NONE, known)
    # A vertex is at most that far from its nearest segment, and the middle at most once more from it.
    bound = min(np.sqrt(gap) + 2.0 * radius, np.sqrt(farthest(g)) + radius) + 4.0 * ROUNDING
    bound *= bound * (1.0 + 1e-9)
    n_found = 0
    nodes[0] = 1
    depth = 1
    while depth > 0:
        depth -= 1
        node = nodes[depth]
        d = to_box(spans, node, x, y)
        if d > bound or d == np.inf:
            continue
        if node < n_leaves:
            nodes[depth] = 2 * node
            nodes[depth + 1] = 2 * node + 1
            depth += 2
            continue
        h = np.int64(live.first_segment[node - n_leaves])
        while h != NONE:
            if is_segment(kind, h):
                a, b, _ = corners_of(live.mesh, h)
                if squared_gap(xy, a, b, x, y) <= bound:
                    if n_found == len(live.candidates):
                        return -1
                    live.candidates[n_found] = h
                    n_found += 1
            h = np.int64(live.segment_after[slot(h)])
    return n_found


@inner
def middle_of(xy: np.ndarray, who: np.ndarray, n: int) -> tuple[float, float, float]:
    """Return the middle of the box of n vertices, and how far from it they are at most."""
    low_x = low_y = np.inf
    high_x = high_y = -np.inf
    for k in range(n):
        i = np.int64(who[k])
        low_x = min(low_x, xy[2 * i])
        high_x = max(high_x, xy[2 * i])
        low_y = min(low_y, xy[2 * i + 1])
        high_y = max(high_y, xy[2 * i + 1])
    x = 0.5 * (low_x + high_x)
    y = 0.5 * (low_y + high_y)
    return x, y, np.sqrt((high_x - x) * (high_x - x) + (high_y - y) * (high_y - y))


@inner
def nearest_of(
    g: Ground, live: Live, n_candidates: int, x: float, y: float, guess: int, gap: float
) -> tuple[int, float]:
    """As :func:`nearest`, among the candidates listed, if there are any."""
    if n_candidates < 0:
        return nearest(g, live, x, y, guess, gap)
    xy = g.xy
    mesh = live.mesh
    best = guess
    for k in range(n_candidates):
        h = np.int64(live.candidates[k])
        a, b, c = corners_of(mesh, h)
        d = squared_gap(xy, a, b, x, y)
        if d < gap or (d == gap and h != best and (best == NONE or rank(a, b, c) < rank_of(mesh, best))):
            best = h
            gap = d
    return best, gap


@inner(inline=True)
def may_reach(boxes: np.ndarray, reach: np.ndarray, node: int, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a vertex of a node may be nearer to the segment from (ax, ay) to (bx, by) than to its own."""
    gap = reach[node]
    if gap < 0.0:
        return False
    if between_boxes(boxes, node, min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)) > gap:
        return False
    # A long segment's box says little: how far is the node's from the line?
    ex = bx - ax
    ey = by - ay
    square = ex * ex + ey * ey
    x = 0.5 * (boxes[node, 0] + boxes[node, 1])
    y = 0.5 * (boxes[node, 2] + boxes[node, 3])
    half = 0.5 * ((boxes[node, 1] - boxes[node, 0]) * abs(ey) + (boxes[node, 3] - boxes[node, 2]) * abs(ex))
    away = max(abs((x - ax) * ey - (y - ay) * ex) - half - 2.0 * ROUNDING * (abs(ex) + abs(ey)), 0.0)
    return away * away * (1.0 - 1e-9) <= gap * square


# ------------------------------------------------------------------------------------------- segments and bare vertices


@inner
def set_segment(live: Live, h: int, wanted: bool) -> None:
    """Make halfedge h a segment, or no longer one."""
    if is_segment(live.kind, h) == wanted:
        return
    at = slot(h)
    i = np.int64(live.mesh[h])
    leaf = i // RUN
    _stir(live, i)
    if wanted:
        live.kind[h >> 3] |= SEGMENT << (h & 3)
        live.first_bare[at] = -1
        after = np.int64(live.first_segment[leaf])
        live.segment_before[at] = NONE
        live.segment_after[at] = after
        live.first_segment[leaf] = h
        if after != NONE:
            live.segment_before[slot(after)] = h
        live.added[live.tally[N_ADDED]] = h
        live.tally[N_ADDED] += 1
        return
    live.kind[h >> 3] &= ~(SEGMENT << (h & 3))
    before = np.int64(live.segment_before[at])
    after = np.int64(live.segment_after[at])
    if before != NONE:
        live.segment_after[slot(before)] = after
    else:
        live.first_segment[leaf] = after
    if after != NONE:
        live.segment_before[slot(after)] = before
    i = np.int64(live.first_bare[at])
    while i >= 0:
        live.bare_segment[i] = NONE
        _make_homeless(live, i)
        i = np.int64(live.bare_after[i])


@inner
def _make_homeless(live: Live, i: int) -> None:
    live.bare[i] = HOMELESS
    live.homeless[live.tally[N_HOMELESS]] = i
    live.tally[N_HOMELESS] += 1
    _stir(live, i)


@inner
def _leave(live: Live, i: int) -> None:
    """Take bare vertex i off its segment's list."""
    h = np.int64(live.bare_segment[i])
    if h == NONE:
        return
    before = live.bare_before[i]
    after = live.bare_after[i]
    if before >= 0:
        live.bare_after[before] = after
    else:
        live.first_bare[slot(h)] = after
    if after >= 0:
        live.bare_before[after] = before
    live.bare_segment[i] = NONE


@inner
def forget_bare(live: Live, i: int) -> None:
    """Note that vertex i is covered, or about to be placed anew."""
    if live.bare[i] == COVERED:
        return
    _leave(live, i)
    live.bare[i] = COVERED
    live.tally[N_BARE] -= 1
    live.amount[BARE_ERROR] -= live.cost[i]
    if len(live.peaks) > 0:
        enter_peak(live, len(live.kind) + i, 0.0)
    _stir(live, i)


@inner
def note_bare(live: Live, i: int) -> None:
    """Note that vertex i is bare; `settle_bare` finds its segment."""
    if live.bare[i] != COVERED:
        return
    live.tally[N_BARE] += 1
    live.bare_segment[i] = NONE
    live.cost[i] = 0.0
    _make_homeless(live, i)


@inner
def _house(g: Ground, live: Live, i: int, h: int, gap: float) -> None:
    """Give bare vertex i its nearest segment, if there is one, and its cost."""
    _leave(live, i)
    live.bare[i] = HOUSED
    live.bare_gap[i] = gap
    _stir(live, i)
    d = 0.0
    cost = 0.0
    if h != NONE:
        at = slot(h)
        live.bare_segment[i] = h
        after = live.first_bare[at]
        live.bare_before[i] = -1
        live.bare_after[i] = after
        live.first_bare[at] = i
        if after >= 0:
            live.bare_before[after] = i
        a, b, c = corners_of(live.mesh, h)
        d = bare_deviation(g, a, b, c, i, gap)
        cost = noted_cost(g, live, d, i)
    if len(live.peaks) > 0:
        enter_peak(live, len(live.kind) + i, d if counts(g, i) else 0.0)
    live.amount[BARE_ERROR] += cost - live.cost[i]
    live.cost[i] = cost


@inner
def _draw_near(g: Ground, live: Live, h: int) -> None:
    """Give a segment that came the housed vertices that are nearer to it than to theirs."""
    xy = g.xy
    mesh = live.mesh
    nodes = live.nodes
    n_leaves = len(live.first_segment)
    reach = live.reach
    boxes = g.boxes
    a, b, c = corners_of(mesh, h)
    ax, ay, bx, by = xy[2 * a], xy[2 * a + 1], xy[2 * b], xy[2 * b + 1]
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
                d = squared_gap(xy, a, b, xy[2 * i], xy[2 * i + 1])
                gap = live.bare_gap[i]
                own = np.int64(live.bare_segment[i])
                if d < gap or (d == gap and (own == NONE or rank(a, b, c) < rank_of(mesh, own))):
                    _house(g, live, i, h, d)


@inner
def settle_bare(g: Ground, live: Live) -> None:
    """Give the bare vertices their nearest segment again, where segments came, went or a vertex is new."""
    count = live.tally
    _refresh(g, live)
    if count[N_BARE] > 0:
        for k in range(count[N_ADDED]):
            h = np.int64(live.added[k])
            if is_segment(live.kind, h):
                _draw_near(g, live, h)
        h = np.int64(NONE)
        n_candidates = list_candidates(g, live, live.homeless, count[N_HOMELESS], np.inf)
        for k in range(count[N_HOMELESS]):
            i = np.int64(live.homeless[k])
            if live.bare[i] == HOMELESS:
                x = g.xy[2 * i]
                y = g.xy[2 * i + 1]
                gap = farthest(g)
                if h != NONE:
                    # The segment of the one before is a good guess.
                    a, b, _ = corners_of(live.mesh, h)
                    d = squared_gap(g.xy, a, b, x, y)
                    if d <= gap:
                        gap = d
                    else:
                        h = np.int64(NONE)
                h, gap = nearest_of(g, live, n_candidates, x, y, h, gap)
                _house(g, live, i, h, gap)
        _refresh(g, live)
    count[N_ADDED] = 0
    count[N_HOMELESS] = 0
