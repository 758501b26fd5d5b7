"""How far the closed mesh of a subset is from the original, from scratch.

The mesh is the Delaunay triangulation of the images that are kept, and the outside of each part, its pole, as one more
triangle. What a vertex p costs is d_p, its least distance in space to the triangle that holds its image and to those
across its edges: the own triangle alone is up to an eighth too far, since images slip along the surface, and further
ones are hardly ever nearer, so that d_p is at least the true distance, and as a rule hardly more. An image on an edge
belongs to the triangle on the left of the edge from its first to its second vertex, so that no walk decides.

Where there are several parts, the edges of their poles are forced, and what lies between them is outside. Where there
are holes, a triangle is no part of the mesh if its centroid lies in one, or a point halfway from there to a corner: no
vertex is where a triangle hangs over a hole, so that it costs nothing, and by the centroid alone half of it would. What
holds a forced edge is in the mesh all the same (see `plane.constraints.holds_line`). If none of the four triangles is
part of the mesh, d_p is the distance to the pole, which every mesh has; and so it is for a kept vertex that no triangle
of the mesh uses.
"""

from __future__ import annotations

import itertools

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, require_bool
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.constraints import constrain, holds_line, place_of
from meshsimp_pymoo.plane.emission import is_in_faces
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.footprint import inside
from meshsimp_pymoo.plane.predicates import orient_sign
from meshsimp_pymoo.plane.triangulation import (
    LAST_INDEX,
    RECORD,
    TRIANGLE,
    locate,
    locate_at_random,
    triangulate,
)
from meshsimp_pymoo.surface.closed.distance import (
    enter_hole,
    enter_no_plane,
    enter_plane,
    is_in_mesh,
    nearer,
    squared_distance,
)
from meshsimp_pymoo.surface.closed.ground import ClosedGround
from meshsimp_pymoo.surface.closed.model import LEAST_VERTICES
from meshsimp_pymoo.surface.measures import ERROR, MAXIMUM, REGIONS, SQUARES, TRIANGLES, UNCOVERED, VERTICES
from meshsimp_pymoo.workers import Reserve, on_threads

# In place of the deviations of each vertex, where they are not asked for.
NO_DEVIATION = np.empty(0, np.float64)
NO_COVER = np.empty(0, np.bool_)
# Entries of subsets that are evaluated in one go: some tenths of a second.
AT_ONCE = 1_000_000

Workspace = tuple[np.ndarray, ...]


def make_workspace(n_vertices: int) -> Workspace:
    """Return the arrays that one thread needs to evaluate subsets of a model of N vertices; 200 N bytes."""
    n = n_vertices + 1
    return (
        np.empty(n, np.int32),  # sites: rows of the kept vertices
        np.empty(2 * n, np.float64),  # their images, flat
        np.empty(n, np.int64),  # the order in which they are inserted: as they are
        np.empty(n, np.uint8),  # inserted
        np.empty(16 * n, np.uint32),  # the triangles' records
        np.empty(n, np.uint32),  # a triangle of each site
        np.empty((2 * n, 4), np.float64),  # planes of the triangles
        np.empty(n, np.uint8),  # whether a triangle of the mesh uses a site
    )


@inner
def holder(xy: np.ndarray, mesh: np.ndarray, t: int, x: float, y: float, exact_area: float) -> int:
    """Return the triangle that an image belongs to which triangle t holds, on its border perhaps."""
    for k in range(3):
        a = mesh[t + k]
        b = mesh[t + (k + 1) % 3]
        if a > b and orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, exact_area) == 0:
            s = np.int64(mesh[t + k + 4]) & TRIANGLE
            return t if (mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX else s
    return t


@inner(inline=True)
def is_outside(part: np.ndarray, a: int, b: int, c: int) -> bool:
    """Whether a triangle, no ghost, lies between the parts."""
    return len(part) > 0 and (part[a] != part[b] or part[a] != part[c])


@inner
def _is_over_hole(ground: ClosedGround, a: int, b: int, c: int) -> bool:
    """Whether the centroid of (a, b, c), or a point halfway from there to a corner, lies in a hole."""
    xy = ground.xy
    if not is_in_faces(xy, ground.footprint, xy, a, b, c):
        return True
    for _ in range(3):
        x3 = 0.5 * (4.0 * xy[2 * a] + (xy[2 * b] + xy[2 * c]))
        y3 = 0.5 * (4.0 * xy[2 * a + 1] + (xy[2 * b + 1] + xy[2 * c + 1]))
        if not inside(xy, ground.footprint, x3, y3):
            return True
        a, b, c = b, c, a
    return False


@inner(inline=True)
def is_hole(ground: ClosedGround, a: int, b: int, c: int) -> bool:
    """Whether triangle (a, b, c) of vertices of one part lies over a hole, and holds no break line in the mesh."""
    if ground.footprint.side == 0:
        return False
    return _is_over_hole(ground, a, b, c) and not holds_line(ground.xy, ground.lines, a, b, c)


@inner(inline=True)
def enter_outside(ground: ClosedGround, planes: np.ndarray, k: int) -> None:
    """Write row k of ``planes`` for a triangle outside: of the pole, if there is one part."""
    if len(ground.part) > 0:
        enter_no_plane(planes, k)
    else:
        enter_plane(ground.xyz, ground.poles[0], ground.poles[1], ground.poles[2], planes, k)


@inner(inline=True)
def enter_triangle(ground: ClosedGround, planes: np.ndarray, k: int, a: int, b: int, c: int) -> bool:
    """Write row k of ``planes`` for a triangle, no ghost; return whether it is in the mesh."""
    if is_outside(ground.part, a, b, c):
        enter_outside(ground, planes, k)
        return False
    if is_hole(ground, a, b, c):
        enter_hole(planes, k)
        return False
    enter_plane(ground.xyz, a, b, c, planes, k)
    return True


@inner(inline=True)
def pole_of(ground: ClosedGround, i: int) -> tuple[int, int, int]:
    """Return the vertices of the pole of the part that vertex i belongs to."""
    poles = ground.poles
    k = 3 * np.int64(ground.part[i]) if len(ground.part) > 0 else 0
    return poles[k], poles[k + 1], poles[k + 2]


@inner(inline=True)
def _corners_beside(ground: ClosedGround, mesh: np.ndarray, s: int, sites: np.ndarray, i: int) -> tuple[int, int, int]:
    """Return the vertices of triangle s of sites beside that of vertex i; those of its pole where s is outside."""
    if (mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX:
        return pole_of(ground, i)
    a, b, c = np.int64(sites[mesh[s]]), np.int64(sites[mesh[s + 1]]), np.int64(sites[mesh[s + 2]])
    if is_outside(ground.part, a, b, c):
        return pole_of(ground, i)
    return a, b, c


@inner
def are_whole(ground: ClosedGround, sites: np.ndarray, n: int) -> bool:
    """Whether each part has its pole and one site more, or more."""
    poles = ground.poles
    for k in range(len(poles)):
        if place_of(sites, n, poles[k]) < 0:
            return False
    if len(ground.part) == 0:
        return n >= LEAST_VERTICES
    counts = np.zeros(len(poles) // 3, np.int64)
    for j in range(n):
        counts[ground.part[sites[j]]] += 1
    return counts.min() >= LEAST_VERTICES


@inner
def _evaluate_one(
    ground: ClosedGround,
    workspace: tuple,  # type: ignore[type-arg]
    kept: np.ndarray,
    row: np.ndarray,
    deviation: np.ndarray,
    covered: np.ndarray,
) -> int:
    """Fill ``row`` with the numbers of one subset; return the end of the triangles' records in the workspace."""
    xy = ground.xy
    xyz = ground.xyz
    weight = ground.weight
    exact_area = ground.exact_area
    sites, site_xy, order, inserted, mesh, site_triangle, planes, used = workspace
    n_all = len(xy) // 2
    n = 0
    for i in range(n_all):
        sites[n] = i
        site_xy[2 * n] = xy[2 * i]
        site_xy[2 * n + 1] = xy[2 * i + 1]
        order[n] = n
        n += np.int64(kept[i])
    end = 0
    if are_whole(ground, sites, n):
        first = np.empty(3, np.int64)
        for k in range(3):
            first[k] = place_of(sites, n, ground.poles[k])
        end = triangulate(site_xy, n, first, order[:n], inserted, mesh, exact_area, ground.exact_lift)
    if end == 0:
        row[:] = np.inf
        row[TRIANGLES] = 0
        row[VERTICES] = 0
        row[UNCOVERED] = n_all
        return 0
    lined = len(ground.lines.at) > 0
    if lined:
        constrain(site_xy, mesh, end, ground.lines, sites, n, site_triangle, exact_area, ground.exact_lift)
    n_triangles = len(ground.poles) // 3
    has_holes = len(ground.far) > 0
    for j in range(n if has_holes else 0):
        used[j] = 0
    for k in range(len(ground.poles) if has_holes else 0):
        used[place_of(sites, n, ground.poles[k])] = 1
    for t in range(0, end, RECORD):
        if (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX:
            enter_outside(ground, planes, t // RECORD)
            continue
        for k in range(3):
            site_triangle[mesh[t + k]] = t
        a, b, c = np.int64(sites[mesh[t]]), np.int64(sites[mesh[t + 1]]), np.int64(sites[mesh[t + 2]])
        if enter_triangle(ground, planes, t // RECORD, a, b, c):
            n_triangles += 1
            for k in range(3 if has_holes else 0):
                used[mesh[t + k]] = 1
    total = 0.0
    squares = 0.0
    maximum = 0.0
    n_uncovered = 0
    n_used = n
    t = np.int64(0)
    j = 0
    for i in range(n_all):
        in_mesh = True
        least = np.inf
        if j < n and sites[j] == i:
            t = np.int64(site_triangle[j])
            in_mesh = not has_holes or used[j] != 0
            n_used -= not in_mesh
            least = 0.0 if in_mesh else np.inf
            j += 1
        else:
            x, y, z = xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]
            if lined:
                t = locate_at_random(site_xy, mesh, t, xy[2 * i], xy[2 * i + 1], exact_area)
            else:
                t = locate(site_xy, mesh, t, xy[2 * i], xy[2 * i + 1], exact_area)
            t = holder(site_xy, mesh, t, xy[2 * i], xy[2 * i + 1], exact_area)
            in_mesh = is_in_mesh(planes, t // RECORD)
            if in_mesh:
                a, b, c = _corners_beside(ground, mesh, t, sites, i)
                least = squared_distance(xyz, a, b, c, x, y, z)
            for k in range(3):
                s = np.int64(mesh[t + k + 4]) & TRIANGLE
                a, b, c = _corners_beside(ground, mesh, s, sites, i)
                least = min(least, nearer(xyz, planes, s // RECORD, a, b, c, x, y, z, least))
        d = np.sqrt(least) if least < np.inf or not has_holes else ground.far[i]
        n_uncovered += not in_mesh
        w = weight[i] if len(weight) > 0 else 1.0
        total += w * d
        squares += w * (d * d if least == np.inf else least)
        if w > 0.0:
            maximum = max(maximum, d)
        if len(deviation) > 0:
            deviation[i] = d
            covered[i] = in_mesh
    row[ERROR] = total
    row[TRIANGLES] = n_triangles
    row[VERTICES] = n_used
    row[SQUARES] = squares
    row[MAXIMUM] = maximum
    row[UNCOVERED] = n_uncovered
    return end


@entry
def _evaluate(
    ground: ClosedGround,
    workspace: tuple,  # type: ignore[type-arg]
    kept: np.ndarray,
    table: np.ndarray,
    deviation: np.ndarray,
    covered: np.ndarray,
) -> int:
    """Fill a row of ``table`` for each subset; return the end of the triangles' records of the last."""
    g = borrowed(ground)
    end = 0
    for k in range(len(kept)):
        end = _evaluate_one(g, workspace, kept[k], table[k], deviation, covered)
    return end


def evaluate_closed(
    ground: ClosedGround, workspaces: Reserve[Workspace], kept: BoolArray, *, n_threads: int = 1
) -> FloatArray:
    """Return the table (P, REGIONS) of numbers of subsets (P, N); see `surface.evaluate.evaluate_subsets`."""
    n = len(ground.xy) // 2
    rows = np.ascontiguousarray(np.atleast_2d(kept))
    require_bool(rows, "subsets are bool arrays, one entry a vertex")
    if rows.shape[1] != n:
        raise ValueError(f"a subset of {n} vertices has as many entries, not {rows.shape[1]}")
    if not rows.flags.writeable:
        rows = rows.copy()
    table = np.empty((len(rows), REGIONS))

    def evaluate(part: slice) -> None:
        with workspaces.one() as workspace:
            _evaluate(ground, workspace, rows[part], table[part], NO_DEVIATION, NO_COVER)

    n_parts = min(max(1 if n_threads <= 1 else 4 * n_threads, -(-rows.size // AT_ONCE)), max(len(rows), 1))
    edges = np.linspace(0, len(rows), n_parts + 1).astype(int)
    on_threads(evaluate, [slice(a, b) for a, b in itertools.pairwise(edges)], n_threads=n_threads)
    return table


def triangulate_closed(
    ground: ClosedGround, workspaces: Reserve[Workspace], kept: BoolArray
) -> tuple[IntArray, FloatArray, FloatArray, BoolArray]:
    """Return the triangles (M, 3) of one subset (N,), its row of numbers, and of all vertices (N,) d_p and cover."""
    row, deviation, covered = np.empty((1, REGIONS)), np.empty(len(kept)), np.ones(len(kept), bool)
    with workspaces.one() as workspace:
        end = _evaluate(ground, workspace, kept[None], row, deviation, covered)
        sites, mesh, planes = workspace[0], workspace[4], workspace[6]
        if end == 0:
            return np.empty((0, 3), np.int32), row[0], deviation, covered
        corners = mesh[:end].reshape(-1, RECORD)[:, :3]
        emitted = (corners <= LAST_INDEX).all(axis=1) & (planes[: end // RECORD, 3] < np.inf)
        corners = sites[corners[emitted]]
    if len(ground.part):
        part = ground.part[corners]
        corners = corners[(part == part[:, :1]).all(axis=1)]
    whole = np.concatenate([corners, ground.poles.reshape(-1, 3)])
    return canonical_faces(whole).astype(np.int32), row[0], deviation, covered
