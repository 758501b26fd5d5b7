"""Free meshes on a closed surface: edges chosen for the error, as vertices are, in the plane of the images.

A free mesh begins as the mesh of a subset and is changed by the moves that height surfaces have
(:mod:`~meshsimp_pymoo.surface.free`): an edge flips, a vertex moves to another original one inside its star, one vertex
collapses and another one comes. Each is a fan from one vertex in the place of a few triangles, made in the books that
subsets are searched with (`live`): what it changes is exact, the triangles beside it included. Beside the vertices
the centroids of the original faces may be samples.

It stays a triangulation of the plane, so that each part stays what it is: closed but for its holes. Triangles that are
not in the mesh never change, nor do edges and vertices at them: rims of holes stay where the subset's mesh has them.
Poles and forced edges stay, and vertices on break lines neither come nor go. No triangle comes that is flatter in space
than the least height that is asked for, that the rule for holes leaves out, or that is turned against the original: its
normal looks the way that those of the original at its corners do.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.draws import below, unit
from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.conflict import turn
from meshsimp_pymoo.plane.constraints import is_forced, is_on_line
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.hilbert import hilbert_keys
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.stars import triangles_around
from meshsimp_pymoo.plane.triangulation import INFINITE, LAST_INDEX, RECORD, TRIANGLE
from meshsimp_pymoo.surface import moves
from meshsimp_pymoo.surface.books import COVERED_ERROR as COST
from meshsimp_pymoo.surface.centroids import QUANTUM
from meshsimp_pymoo.surface.closed.books import (
    END,
    MOST_TOUCHED,
    N_CAME,
    N_FREE,
    N_GONE,
    N_IN_MESH,
    N_LOG,
    N_LOOKED_AT,
    ClosedLive,
    make_live,
)
from meshsimp_pymoo.surface.closed.distance import is_in_mesh
from meshsimp_pymoo.surface.closed.embedding import are_poles
from meshsimp_pymoo.surface.closed.evaluate import is_hole, is_outside
from meshsimp_pymoo.surface.closed.ground import ClosedGround, to_poles
from meshsimp_pymoo.surface.closed.live import (
    build,
    degree,
    deviation,
    enter,
    link,
    may_go,
    note_came,
    note_gone,
    retake,
    sites_around,
    total,
    tried,
    undo,
    write,
)
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.free import CENTROIDS, LARGE, TRIES, FreeTriangulation, drawn, stroll
from meshsimp_pymoo.surface.measures import (
    ERROR,
    MAXIMUM,
    REGIONS,
    SQUARES,
    TRIANGLES,
    UNCOVERED,
    VERTICES,
)
from meshsimp_pymoo.surface.moves import answers
from meshsimp_pymoo.surface.rules import USUAL_RATIO
from meshsimp_pymoo.workers import Reserve


class ClosedFreedom(NamedTuple):
    """What does not change while a free mesh is searched; N vertices."""

    ground: ClosedGround  # of the samples: the vertices, and maybe others behind them
    n_vertices: int
    normals: np.ndarray  # (3 N,) unit normals of the original at its vertices
    indptr: np.ndarray  # one-rings of the original mesh
    indices: np.ndarray
    ratio: float  # least height of triangles that come, as a share of their longest edge
    onto: np.ndarray  # (N,) the neighbour that each vertex would collapse onto, or did


# ------------------------------------------------------------------------------------------------- what goes and comes
# What goes is a polygon, ``ring``, with the halfedges beyond it, ``rim``; what comes is a fan from one vertex, which
# stands on some sides of the ring in turn, all of them where the vertex lies inside.


@inner(inline=True)
def _is_shown(g: ClosedGround, live: ClosedLive, t: int) -> bool:
    """Whether triangle t is in the mesh: no ghost, not between parts, and not in a hole."""
    mesh = live.mesh
    if (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX or not is_in_mesh(live.planes, t >> 3):
        return False
    return not is_outside(g.part, np.int64(mesh[t]), np.int64(mesh[t + 1]), np.int64(mesh[t + 2]))


@inner
def _take_star(g: ClosedGround, live: ClosedLive, v: int) -> int:
    """List the triangles at site v in ``cavity``; return their number, 0 where they are many or not all in the mesh."""
    if degree(live, v, MOST_TOUCHED) > MOST_TOUCHED:
        return 0
    m = triangles_around(live.mesh, np.int64(live.place[v]), v, live.cavity, live.rim, live.ring)
    for q in range(m):
        if not _is_shown(g, live, np.int64(live.cavity[q])):
            return 0
    return m


@inner
def _take_pair(live: ClosedLive, h: int) -> None:
    """List the two triangles at the edge of halfedge h; the ring starts at the corner across from it."""
    mesh = live.mesh
    twin = np.int64(mesh[h + 4])
    t, s = h & TRIANGLE, twin & TRIANGLE
    live.cavity[0] = t
    live.cavity[1] = s
    for j in range(4):
        side = t + ((h & 3) + 2 - (j == 3)) % 3 if j == 0 or j == 3 else s + ((twin & 3) + j) % 3
        live.ring[j] = mesh[side]
        live.rim[j] = mesh[side + 4]


@inner
def _take_triangle(live: ClosedLive, t: int) -> None:
    """List triangle t."""
    live.cavity[0] = t
    for j in range(3):
        live.ring[j] = live.mesh[t + j]
        live.rim[j] = live.mesh[t + j + 4]


@inner
def _fits(free: ClosedFreedom, a: int, b: int, c: int) -> bool:
    """Whether a triangle may come: counter-clockwise in the plane, and in space not flat and not turned around."""
    g = free.ground
    xyz = g.xyz
    normals = free.normals
    if turn(g.xy, a, b, c, g.exact_area) <= 0:
        return False
    ux, uy, uz = xyz[3 * b] - xyz[3 * a], xyz[3 * b + 1] - xyz[3 * a + 1], xyz[3 * b + 2] - xyz[3 * a + 2]
    vx, vy, vz = xyz[3 * c] - xyz[3 * a], xyz[3 * c + 1] - xyz[3 * a + 1], xyz[3 * c + 2] - xyz[3 * a + 2]
    wx, wy, wz = vx - ux, vy - uy, vz - uz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
    if not np.sqrt(nx * nx + ny * ny + nz * nz) >= free.ratio * longest:
        return False
    facing = nx * (normals[3 * a] + normals[3 * b] + normals[3 * c])
    facing += ny * (normals[3 * a + 1] + normals[3 * b + 1] + normals[3 * c + 1])
    facing += nz * (normals[3 * a + 2] + normals[3 * b + 2] + normals[3 * c + 2])
    return facing > 0.0 and not is_hole(g, a, b, c)


@inner
def _fan_fits(free: ClosedFreedom, live: ClosedLive, m: int, first: int, n: int, apex: int) -> bool:
    """Whether all n triangles of a fan on the ring of m, whose first stands on side ``first``, may come."""
    for k in range(n):
        a, b = np.int64(live.ring[(first + k) % m]), np.int64(live.ring[(first + k + 1) % m])
        if not _fits(free, a, b, apex):
            return False
    return True


@inner
def _begin(live: ClosedLive) -> None:
    live.tally[N_GONE] = 0
    live.tally[N_CAME] = 0
    live.tally[N_LOG] = 0


@inner
def _write_fan(live: ClosedLive, n_cavity: int, m: int, first: int, n: int, apex: int, logged: bool) -> None:
    """Put a fan of n triangles on the ring of m into the records, in the place of those of ``cavity``."""
    tally = live.tally
    cavity, ring, rim, came = live.cavity, live.ring, live.rim, live.came
    start = tally[N_CAME]
    for q in range(n_cavity):
        note_gone(live, np.int64(cavity[q]), logged)
    for k in range(n):
        if k < n_cavity:
            came[start + k] = cavity[k]
        elif tally[N_FREE] > 0:
            tally[N_FREE] -= 1
            came[start + k] = live.free[tally[N_FREE]]
        else:
            came[start + k] = tally[END]
            tally[END] += RECORD
    for q in range(n, n_cavity):
        t = np.int64(cavity[q])
        live.free[tally[N_FREE]] = t
        tally[N_FREE] += 1
        for e in range(3):  # to whoever scans the records an unused one is a ghost
            write(live, t + e, INFINITE, logged)
    for k in range(n):
        t = np.int64(came[start + k])
        write(live, t, np.int64(ring[(first + k) % m]), logged)
        write(live, t + 1, np.int64(ring[(first + k + 1) % m]), logged)
        write(live, t + 2, apex, logged)
        link(live, t, np.int64(rim[(first + k) % m]), logged)
        if k < n - 1 or n == m:
            link(live, t + 1, np.int64(came[start + (k + 1 if k < n - 1 else 0)]) + 2, logged)
        else:
            link(live, t + 1, np.int64(rim[(first + n) % m]), logged)
        if k == 0 and n < m:
            link(live, t + 2, np.int64(rim[(first + m - 1) % m]), logged)
    tally[N_CAME] += n


@inner
def _is_made(free: ClosedFreedom, live: ClosedLive, v: int, w: int, limit: float, n_free: int, end: int) -> bool:
    """Keep what is written, with a log, if it costs no more than the limit, else take it back."""
    g = free.ground
    note_came(g, live)
    if not tried(g, live, v, w, limit) <= limit:
        undo(live, n_free, end)
        return False
    enter(g, live, v, w)
    return True


@inner
def _replaces(
    free: ClosedFreedom,
    live: ClosedLive,
    n_cavity: int,
    m: int,
    first: int,
    n: int,
    apex: int,
    v: int,
    w: int,
    limit: float,
) -> bool:
    """Put a fan in the place of ``cavity``, so that site v goes and vertex w comes, if it may be and costs no more."""
    if not _fan_fits(free, live, m, first, n, apex):
        return False
    n_free, end = live.tally[N_FREE], live.tally[END]
    _begin(live)
    _write_fan(live, n_cavity, m, first, n, apex, True)
    return _is_made(free, live, v, w, limit, n_free, end)


# --------------------------------------------------------------------------------------------------------------- moves


@answers(moves.flip, ClosedFreedom)
@inner
def _flip(free: ClosedFreedom, live: ClosedLive, h: int, most: int, limit: float, state: np.ndarray) -> bool:
    g = free.ground
    mesh = live.mesh
    t = h & TRIANGLE
    if not _is_shown(g, live, t) or not _is_shown(g, live, np.int64(mesh[h + 4]) & TRIANGLE):
        return False
    if is_forced(g.lines, mesh[h], mesh[t + ((h & 3) + 1) % 3]):
        return False
    _take_pair(live, h)
    return _replaces(free, live, 2, 4, 1, 2, np.int64(live.ring[0]), -1, -1, limit)


@answers(moves.shift, ClosedFreedom)
@inner
def _shift(free: ClosedFreedom, live: ClosedLive, v: int, most: int, limit: float, state: np.ndarray) -> int:
    w = stroll(free.indptr, free.indices, v, 1 + below(state, 3), state)
    if live.site[w] or is_on_line(free.ground.lines, w):
        return -1
    m = _take_star(free.ground, live, v)
    if m == 0 or not _replaces(free, live, m, m, 0, m, w, v, w, limit):
        return -1
    return w


@inner
def _wanted_in(free: ClosedFreedom, live: ClosedLive, t: int, state: np.ndarray) -> int:
    """Draw a vertex of the list of triangle t, or take the one that deviates most; -1: there is none."""
    g = free.ground
    worst = unit(state) < 0.5
    found = np.int64(-1)
    n = 0
    most = -1.0
    i = np.int64(live.head[t >> 3])
    while i >= 0:
        if i < free.n_vertices and not is_on_line(g.lines, i):
            if worst:
                d = deviation(g, live, i, i)
                if d > most:
                    most = d
                    found = i
            else:
                n += 1
                if below(state, n) == 0:
                    found = i
        i = np.int64(live.following[i])
    return found


@answers(moves.swap, ClosedFreedom)
@inner
def _swap(
    free: ClosedFreedom,
    live: ClosedLive,
    v: int,
    most: int,
    limit: float,
    first: float,
    share: float,
    state: np.ndarray,
) -> int:
    g = free.ground
    tally = live.tally
    n_records = tally[END] >> 3
    t = np.int64(-1)
    for _ in range(TRIES):
        r = drawn(n_records, first, share, state)
        if _is_shown(g, live, r * RECORD) and (t < 0 or live.subtotal[r] > live.subtotal[t >> 3]):
            t = r * RECORD
    if t < 0:
        return -1
    w = _wanted_in(free, live, t, state)
    if w < 0:
        return -1
    _take_triangle(live, t)
    if tally[N_IN_MESH] + 2 <= most:
        return w if _replaces(free, live, 1, 3, 0, 3, w, -1, w, limit) else -1
    if not may_go(g, live, v, w) or not _fan_fits(free, live, 3, 0, 3, w):
        return -1
    m = _take_star(g, live, v)
    if m == 0:
        return -1
    for q in range(m):
        if live.cavity[q] == t:
            return -1
    r = below(state, m)
    apex = np.int64(live.ring[r])
    if not _fan_fits(free, live, m, r + 1, m - 2, apex):
        return -1
    n_free, end = tally[N_FREE], tally[END]
    _begin(live)
    # what goes frees records, which what comes takes; it may lie beside, so that its rim is known only then
    _write_fan(live, m, m, r + 1, m - 2, apex, True)
    _take_triangle(live, t)
    _write_fan(live, 1, 3, 0, 3, w, True)
    return w if _is_made(free, live, v, w, limit, n_free, end) else -1


@answers(moves.settle, ClosedFreedom)
@inner
def _settle(free: ClosedFreedom, live: ClosedLive) -> None:
    retake(free.ground, live)


@answers(moves.take_numbers, ClosedFreedom)
@inner
def _take_numbers(free: ClosedFreedom, live: ClosedLive, share: np.ndarray, row: np.ndarray) -> None:
    g = free.ground
    n = free.n_vertices
    for k in range(REGIONS + 1):
        row[k] = 0.0
    row[TRIANGLES] = live.tally[N_IN_MESH]
    for i in range(n + len(share)):
        is_site = i < n and live.site[i] != 0
        if is_site:
            is_there = len(live.uses) == 0 or live.uses[i] > 0
            d = 0.0 if is_there else g.far[i]
            row[VERTICES] += is_there
        else:
            is_there = is_in_mesh(live.planes, np.int64(live.place[i]) >> 3)
            d = deviation(g, live, i, i)
        if i >= n:
            row[REGIONS] += share[i - n] * d
            continue
        row[UNCOVERED] += not is_there
        w = g.weight[i]
        row[ERROR] += w * d
        row[SQUARES] += w * d * d
        if w > 0.0:
            row[MAXIMUM] = max(row[MAXIMUM], d)
    if len(share) == 0:
        row[REGIONS] = np.nan


# ------------------------------------------------------------------------------- thinning: answers to `surface.moves`


@answers(moves.total_cost, ClosedFreedom)
@inner(inline=True)
def _total_cost(free: ClosedFreedom, live: ClosedLive) -> float:
    return total(live)


@answers(moves.error_now, ClosedFreedom)
@inner(inline=True)
def _error_now(free: ClosedFreedom, live: ClosedLive) -> float:
    return total(live)


@answers(moves.ranked, ClosedFreedom)
@inner(inline=True)
def _ranked(free: ClosedFreedom, live: ClosedLive, change: float) -> tuple[float, float]:
    return change, 0.0


@answers(moves.n_triangles, ClosedFreedom)
@inner(inline=True)
def _n_triangles(free: ClosedFreedom, live: ClosedLive) -> int:
    return live.tally[N_IN_MESH]


@answers(moves.is_site, ClosedFreedom)
@inner(inline=True)
def _is_site(free: ClosedFreedom, live: ClosedLive, v: int) -> bool:
    return live.site[v] != 0


@answers(moves.effort, ClosedFreedom)
@inner(inline=True)
def _effort(free: ClosedFreedom, live: ClosedLive) -> int:
    return live.tally[N_LOOKED_AT]


@answers(moves.sites_around, ClosedFreedom)
@inner
def _sites_around(free: ClosedFreedom, live: ClosedLive, v: int, found: np.ndarray) -> int:
    return sites_around(free.ground, live, v, found)


@answers(moves.try_exchange, ClosedFreedom)
@inner
def _try_exchange(free: ClosedFreedom, live: ClosedLive, v: int, w: int, limit: float) -> tuple[float, int]:
    """Return the least change of cost by which site v collapses, and that of the number of triangles; ``w`` is -1.

    ``free.onto`` notes the neighbour.
    """
    g = free.ground
    tally = live.tally
    best = np.inf
    m = _take_star(g, live, v)
    tally[N_LOOKED_AT] = m
    if m == 0 or not may_go(g, live, v, -1):
        return best, 0
    for r in range(m):
        apex = np.int64(live.ring[r])
        if not _fan_fits(free, live, m, r + 1, m - 2, apex):
            continue
        n_free, end = tally[N_FREE], tally[END]
        _begin(live)
        _write_fan(live, m, m, r + 1, m - 2, apex, True)
        note_came(g, live)
        change = tried(g, live, v, -1, min(limit, best))
        undo(live, n_free, end)
        if change < best:
            best = change
            free.onto[v] = apex
    return best, -2 if best < np.inf else 0


@answers(moves.exchange, ClosedFreedom)
@inner
def _exchange(free: ClosedFreedom, live: ClosedLive, v: int, w: int) -> bool:
    """Let site v collapse onto ``free.onto[v]``; ``w`` is -1. Returns False, with nothing changed, where it cannot."""
    g = free.ground
    m = _take_star(g, live, v)
    if m == 0 or not may_go(g, live, v, -1):
        return False
    for r in range(m):
        if live.ring[r] == free.onto[v]:
            apex = np.int64(live.ring[r])
            if not _fan_fits(free, live, m, r + 1, m - 2, apex):
                return False
            _begin(live)
            _write_fan(live, m, m, r + 1, m - 2, apex, False)
            note_came(g, live)
            enter(g, live, v, -1)
            return True
    return False


# ------------------------------------------------------------------------------------------------------------ in Python


class ClosedFreeGround:
    """What the free meshes of one closed surface have in common; as `surface.free.FreeGround`.

    Parameters
    ----------
    model : ClosedModel
        The original mesh of N vertices.
    ground : ClosedGround
        Of this and the rules, whose measure is what is lowered.
    pinned : (N,) bool array
        Vertices that stay.
    centroids : bool
        Whether the centroids of the original faces are samples too, together of `CENTROIDS` of the weight of all
        vertices: each has the share of its face's area, and the weight of its corners.
    """

    def __init__(self, model: ClosedModel, ground: ClosedGround, pinned: BoolArray, *, centroids: bool) -> None:
        n = model.n_vertices
        weights = np.ones(n) if model.weights is None else model.weights
        xy, xyz, part = model.xy, model.points, model.part
        share = np.empty(0)
        if centroids:
            places, centres, share, rows = _centroids_of(model)
            weights = np.concatenate([weights, CENTROIDS * n * share * weights[model.faces[rows]].mean(axis=1)])
            xy, xyz = np.concatenate([xy, places]), np.concatenate([xyz, centres])
            part = np.concatenate([part, part[model.faces[rows, 0]]])
        n_samples = len(xy)
        indptr, indices = model.neighbours
        self.name = model.name
        self.pinned = pinned
        #: Vertices that stay where they are kept (N,): the pinned ones, and all on break lines.
        self.held = pinned | (ground.lines.at >= 0) if len(ground.lines.at) else pinned
        #: Share of each sample behind the vertices in the area (K,): those of the centroids, or none.
        self.share = share
        self._freedom = ClosedFreedom(
            ground=ground._replace(
                xy=np.ascontiguousarray(xy).ravel(),
                xyz=np.ascontiguousarray(xyz).ravel(),
                part=part.astype(np.int32) if len(ground.part) else ground.part,
                far=to_poles(xyz, model.poles, part) if len(ground.far) else ground.far,
                exact_area=min(exact_ranges(xy)[0], ground.exact_area),
                weight=weights,
                weighed=True,
                by_peak=False,
                own=1.0,
                bound=np.inf,
            ),
            n_vertices=n,
            normals=_normals_of(model).ravel(),
            indptr=indptr,
            indices=indices,
            ratio=0.0,
            onto=np.empty(0, np.int32),
        )
        make = partial(_make_room, n, n_samples, model.n_parts, has_holes=len(ground.far) > 0)
        self._rooms = Reserve(make, n_samples < LARGE)

    @contextmanager
    def triangulation(self, kept: BoolArray, *, min_height: float = USUAL_RATIO) -> Iterator[ClosedFreeTriangulation]:
        """Lend the mesh of a subset (N,), to be changed freely until the context ends."""
        with self._rooms.one() as (live, onto):
            freedom = self._freedom._replace(ratio=float(min_height), onto=onto)
            build(freedom.ground, live, np.flatnonzero(kept), self.name)
            yield ClosedFreeTriangulation(freedom, live, self.held)


def _make_room(n_vertices: int, n_samples: int, n_parts: int, *, has_holes: bool) -> tuple[ClosedLive, IntArray]:
    return make_live(n_samples, n_parts, has_holes=has_holes), np.empty(n_vertices, np.int32)


def _centroids_of(model: ClosedModel) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Return where the centroids of the original faces are, but for those of poles, which every mesh has.

    Returns
    -------
    xy : (K, 2) float array
        In the plane, along the curve of the vertices.
    xyz : (K, 3) float array
        In space [model units].
    share : (K,) float array
        Area of each face as a share of that of all.
    rows : (K,) int array
        The faces.
    """
    faces = model.faces
    a, b, c = (model.points[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rows = np.flatnonzero(~are_poles(faces, model.poles))
    place = np.rint(model.xy[faces[rows]].sum(axis=1) / (3.0 * QUANTUM)) * QUANTUM
    order = np.argsort(hilbert_keys(place), kind="stable")
    rows = rows[order]
    return place[order], (a + b + c)[rows] / 3.0, area[rows] / area.sum(), rows


def _normals_of(model: ClosedModel) -> FloatArray:
    """Return the unit normals (N, 3) of the original at its vertices: the mean of those of the faces there, by area."""
    a, b, c = (model.points[model.faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    normals = np.zeros((model.n_vertices, 3))
    for k in range(3):
        np.add.at(normals, model.faces[:, k], area)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=normals, where=length > 0.0)


class ClosedFreeTriangulation(FreeTriangulation):
    """A free closed mesh that is changed by moves; `ClosedFreeGround.triangulation` lends one."""

    def _may_move(self) -> BoolArray:
        there: BoolArray = np.zeros(self.freedom.n_vertices, np.bool_)
        corners, is_shown = self._corners()
        there[corners[is_shown]] = True
        there[corners[~is_shown]] = False
        return there

    def _corners(self) -> tuple[IntArray, BoolArray]:
        """Return the corners (M, 3) of all triangles but ghosts, and whether each is in the mesh, poles left out."""
        end = int(self.books.tally[END])
        corners = self.books.mesh[:end].reshape(-1, RECORD)[:, :3].astype(np.int64)
        is_shown = np.asarray(self.books.planes[: end // RECORD, 3] < np.inf)
        real = (corners <= LAST_INDEX).all(axis=1)
        corners, is_shown = corners[real], is_shown[real]
        if len(self.freedom.ground.part):
            part = self.freedom.ground.part[corners]
            is_shown &= (part == part[:, :1]).all(axis=1)
        return corners, is_shown

    @property
    def faces(self) -> IntArray:
        """The triangles (M, 3) as rows of the model's points, the least row first, sorted."""
        corners, is_shown = self._corners()
        return canonical_faces(np.concatenate([corners[is_shown], self.freedom.ground.poles.reshape(-1, 3)]))

    @property
    def triangles(self) -> int:
        """The number of triangles."""
        return int(self.books.tally[N_IN_MESH])

    @property
    def cost(self) -> float:
        """The sum of the costs of all samples, in the measure of the rules."""
        return max(float(self.books.amount[COST]), 0.0)
