"""Which triangles of a triangulation are the mesh: no ghosts, no slivers at the hull, none outside the footprint."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.constraints import Constraints, holds_line
from meshsimp_pymoo.plane.footprint import Footprint, inside
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD, TRIANGLE

# A hull triangle lower than this, in diagonals of the model's bounding box in the plane, is an artefact of rounding.
SLIVER_HEIGHT = 1e-9


@inner
def is_sliver(xy: np.ndarray, a: int, b: int, c: int, min_height: float) -> bool:
    """Whether a triangle is lower than ``min_height`` over its longest edge; the same for all its rotations."""
    while a > b or a > c:
        a, b, c = b, c, a
    ux = xy[2 * b] - xy[2 * a]
    uy = xy[2 * b + 1] - xy[2 * a + 1]
    vx = xy[2 * c] - xy[2 * a]
    vy = xy[2 * c + 1] - xy[2 * a + 1]
    wx = vx - ux
    wy = vy - uy
    area = ux * vy - uy * vx
    longest = max(ux * ux + uy * uy, vx * vx + vy * vy, wx * wx + wy * wy)
    return area <= 0.0 or area * area < min_height * min_height * longest


@inner(inline=True)
def sum_of_three(a: float, b: float, c: float) -> float:
    """Their sum, rounded the same way in whatever order they come."""
    low = a if a < b else b
    high = b if a < b else a
    middle = c if c > low else low
    lowest = c if c < low else low
    highest = middle if middle > high else high
    middle = high if middle > high else middle
    return lowest + middle + highest


@inner(inline=True)
def is_in_faces(model_xy: np.ndarray, footprint: Footprint, xy: np.ndarray, a: int, b: int, c: int) -> bool:
    """Whether the footprint of the model, whose side is not 0, holds the centroid of (a, b, c)."""
    x3 = sum_of_three(xy[2 * a], xy[2 * b], xy[2 * c])
    y3 = sum_of_three(xy[2 * a + 1], xy[2 * b + 1], xy[2 * c + 1])
    return inside(model_xy, footprint, x3, y3)


@inner(inline=True)
def emit(
    xy: np.ndarray,
    mesh: np.ndarray,
    end: int,
    min_height: float,
    model_xy: np.ndarray,
    footprint: Footprint,
    lines: Constraints,
    sites: np.ndarray,
    emitted: np.ndarray,
    stack: np.ndarray,
) -> int:
    """Mark the mesh's triangles: no ghosts, no slivers at the hull, none outside the footprint; return their number.

    What holds a forced edge in the mesh counts as inside. ``sites`` are the vertices of the model that ``xy`` lists.
    """
    for t in range(0, end, RECORD):
        emitted[t // RECORD] = 0 if (mesh[t] | mesh[t + 1] | mesh[t + 2]) > LAST_INDEX else 1
    for ghost in range(0, end, RECORD):
        if emitted[ghost // RECORD] == 1:
            continue
        if (mesh[ghost] | mesh[ghost + 1] | mesh[ghost + 2]) <= LAST_INDEX:
            continue
        # Peel from the outside in: a sliver that goes exposes its neighbours.
        depth = 0
        stack[0] = ghost
        depth = 1
        while depth > 0:
            depth -= 1
            outer = stack[depth]
            for k in range(3):
                t = mesh[outer + 4 + k] & TRIANGLE
                if emitted[t // RECORD] == 1 and is_sliver(xy, mesh[t], mesh[t + 1], mesh[t + 2], min_height):
                    emitted[t // RECORD] = 0
                    stack[depth] = t
                    depth += 1
    n_triangles = 0
    for t in range(0, end, RECORD):
        if emitted[t // RECORD] == 0:
            continue
        if footprint.side > 0:
            a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
            if not is_in_faces(model_xy, footprint, xy, a, b, c) and not holds_line(
                model_xy, lines, sites[a], sites[b], sites[c]
            ):
                emitted[t // RECORD] = 0
                continue
        n_triangles += 1
    return n_triangles


@inner
def outline(mesh: np.ndarray, end: int, emitted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List halfedges between an emitted triangle and another, as (start, end, third) sites, with their rank.

    The order is that of the written mesh: triangle by triangle (least vertex first), edge by edge.
    """
    m = 0
    for t in range(0, end, RECORD):
        if emitted[t // RECORD] == 1:
            for k in range(3):
                m += emitted[(mesh[t + 4 + k] & TRIANGLE) // RECORD] == 0
    ends = np.empty((m, 3), np.int32)
    key = np.empty(m, np.int64)
    m = 0
    for t in range(0, end, RECORD):
        if emitted[t // RECORD] == 1:
            least = 0
            if mesh[t + 1] < mesh[t]:
                least = 1
            if mesh[t + 2] < mesh[t + least]:
                least = 2
            a = np.int64(mesh[t + least])
            b = np.int64(mesh[t + (least + 1) % 3])
            for k in range(3):
                if emitted[(mesh[t + 4 + k] & TRIANGLE) // RECORD] == 0:
                    ends[m, 0] = mesh[t + k]
                    ends[m, 1] = mesh[t + (k + 1) % 3]
                    ends[m, 2] = mesh[t + (k + 2) % 3]
                    key[m] = (a << 33) | (b << 2) | ((k - least + 3) % 3)
                    m += 1
    return ends, key
