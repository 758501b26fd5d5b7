"""How far the closed mesh of a subset is from the original, from scratch.

The mesh is the Delaunay triangulation of the images that are kept, and the outside as one more triangle. What a vertex
p costs is d_p, its least distance in space to the triangle that holds its image and to those across its edges: the own
triangle alone is up to an eighth too far, since images slip along the surface, and further ones are hardly ever nearer,
so that d_p is at least the true distance, and as a rule hardly more. An image
on an edge belongs to the triangle on the left of the edge from its first to its second vertex, so that no walk decides.
"""

from __future__ import annotations

import itertools

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, require_bool
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.constraints import place_of
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.predicates import orient_sign
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD, TRIANGLE, locate, triangulate
from meshsimp_pymoo.surface.closed.distance import enter_plane, nearer, squared_distance
from meshsimp_pymoo.surface.closed.ground import ClosedGround
from meshsimp_pymoo.surface.closed.model import LEAST_VERTICES
from meshsimp_pymoo.surface.measures import ERROR, MAXIMUM, REGIONS, SQUARES, TRIANGLES, UNCOVERED, VERTICES
from meshsimp_pymoo.workers import Reserve, on_threads

# In place of the deviations of each vertex, where they are not asked for.
NO_DEVIATION = np.empty(0, np.float64)
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
def corners_in_space(mesh: np.ndarray, s: int, sites: np.ndarray, pole: np.ndarray) -> tuple[int, int, int]:
    """Return the vertices of triangle s of sites; those of the outside where it is a ghost."""
    if (mesh[s] | mesh[s + 1] | mesh[s + 2]) > LAST_INDEX:
        return np.int64(pole[0]), np.int64(pole[1]), np.int64(pole[2])
    return np.int64(sites[mesh[s]]), np.int64(sites[mesh[s + 1]]), np.int64(sites[mesh[s + 2]])


@inner
def _evaluate_one(
    ground: ClosedGround,
    workspace: tuple,  # type: ignore[type-arg]
    kept: np.ndarray,
    row: np.ndarray,
    deviation: np.ndarray,
) -> int:
    """Fill ``row`` with the numbers of one subset; return the end of the triangles' records in the workspace."""
    xy = ground.xy
    xyz = ground.xyz
    pole = ground.pole
    weight = ground.weight
    exact_area = ground.exact_area
    sites, site_xy, order, inserted, mesh, site_triangle, planes = workspace
    n_all = len(xy) // 2
    n = 0
    for i in range(n_all):
        sites[n] = i
        site_xy[2 * n] = xy[2 * i]
        site_xy[2 * n + 1] = xy[2 * i + 1]
        order[n] = n
        n += np.int64(kept[i])
    first = np.empty(3, np.int64)
    for k in range(3):
        first[k] = place_of(sites, n, pole[k])
    end = 0
    if n >= LEAST_VERTICES and min(first[0], min(first[1], first[2])) >= 0:
        end = triangulate(site_xy, n, first, order[:n], inserted, mesh, exact_area, ground.exact_lift)
    if end == 0:
        row[:] = np.inf
        row[TRIANGLES] = 0
        row[VERTICES] = 0
        row[UNCOVERED] = n_all
        return 0
    for t in range(0, end, RECORD):
        a, b, c = corners_in_space(mesh, t, sites, pole)
        enter_plane(xyz, a, b, c, planes, t // RECORD)
        if (mesh[t] | mesh[t + 1] | mesh[t + 2]) <= LAST_INDEX:
            site_triangle[mesh[t]] = t
            site_triangle[mesh[t + 1]] = t
            site_triangle[mesh[t + 2]] = t
    total = 0.0
    squares = 0.0
    maximum = 0.0
    t = np.int64(0)
    j = 0
    for i in range(n_all):
        if j < n and sites[j] == i:
            t = np.int64(site_triangle[j])
            j += 1
            if len(deviation) > 0:
                deviation[i] = 0.0
            continue
        x, y, z = xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]
        t = locate(site_xy, mesh, t, xy[2 * i], xy[2 * i + 1], exact_area)
        t = holder(site_xy, mesh, t, xy[2 * i], xy[2 * i + 1], exact_area)
        a, b, c = corners_in_space(mesh, t, sites, pole)
        least = squared_distance(xyz, a, b, c, x, y, z)
        for k in range(3):
            s = np.int64(mesh[t + k + 4]) & TRIANGLE
            a, b, c = corners_in_space(mesh, s, sites, pole)
            least = min(least, nearer(xyz, planes, s // RECORD, a, b, c, x, y, z, least))
        d = np.sqrt(least)
        w = weight[i] if len(weight) > 0 else 1.0
        total += w * d
        squares += w * least
        if w > 0.0:
            maximum = max(maximum, d)
        if len(deviation) > 0:
            deviation[i] = d
    row[ERROR] = total
    row[TRIANGLES] = 2 * n - 4
    row[VERTICES] = n
    row[SQUARES] = squares
    row[MAXIMUM] = maximum
    row[UNCOVERED] = 0
    return end


@entry
def _evaluate(
    ground: ClosedGround,
    workspace: tuple,  # type: ignore[type-arg]
    kept: np.ndarray,
    table: np.ndarray,
    deviation: np.ndarray,
) -> int:
    """Fill a row of ``table`` for each subset; return the end of the triangles' records of the last."""
    g = borrowed(ground)
    end = 0
    for k in range(len(kept)):
        end = _evaluate_one(g, workspace, kept[k], table[k], deviation)
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
            _evaluate(ground, workspace, rows[part], table[part], NO_DEVIATION)

    n_parts = min(max(1 if n_threads <= 1 else 4 * n_threads, -(-rows.size // AT_ONCE)), max(len(rows), 1))
    edges = np.linspace(0, len(rows), n_parts + 1).astype(int)
    on_threads(evaluate, [slice(a, b) for a, b in itertools.pairwise(edges)], n_threads=n_threads)
    return table


def triangulate_closed(
    ground: ClosedGround, workspaces: Reserve[Workspace], kept: BoolArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the triangles (M, 3) of one subset (N,), its row of numbers and d_p of all vertices (N,)."""
    row, deviation = np.empty((1, REGIONS)), np.empty(len(kept))
    with workspaces.one() as workspace:
        end = _evaluate(ground, workspace, kept[None], row, deviation)
        sites, mesh = workspace[0], workspace[4]
        if end == 0:
            return np.empty((0, 3), np.int32), row[0], deviation
        corners = mesh[:end].reshape(-1, RECORD)[:, :3]
        corners = sites[corners[(corners <= LAST_INDEX).all(axis=1)]]
    return canonical_faces(np.concatenate([corners, ground.pole[None]])).astype(np.int32), row[0], deviation
