"""How far any mesh is from the original one, by the same error: decimated, folded, with vertices of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry
from meshsimp_pymoo.plane.faces import least_angles
from meshsimp_pymoo.plane.hilbert import hilbert_keys
from meshsimp_pymoo.plane.nearest import build_tree, nearest_segment
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.evaluate import COVER_TOLERANCE
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.measures import (
    ERROR,
    MAXIMUM,
    REGIONS,
    SQUARES,
    TRIANGLES,
    UNCOVERED,
    VERTICES,
    Quality,
    as_quality,
)

# A least angle below this is thin: the measure ``below_5_degrees``.
THIN_DEGREES = 5.0


def mesh_quality(
    deviation: FloatArray,
    covered: BoolArray,
    faces: IntArray,
    weights: FloatArray | None,
    total_weight: float,
    **of_mesh: float,
) -> Quality:
    """Return what is said of a mesh with these deviations (N,), cover (N,) and triangles (M, 3)."""
    w = np.ones(len(deviation)) if weights is None else weights
    row = np.full(REGIONS, np.nan)
    row[ERROR], row[SQUARES], row[MAXIMUM] = (w * deviation).sum(), (w * deviation**2).sum(), deviation[w > 0].max()
    row[TRIANGLES], row[VERTICES], row[UNCOVERED] = len(faces), len(np.unique(faces)), len(covered) - covered.sum()
    return as_quality(row, total_weight, **of_mesh)


def measured_angles(xy: FloatArray, faces: IntArray) -> dict[str, float]:
    """Return what is said of the least angles of triangles (M, 3) of vertices in the plane (V, 2) or space (V, 3)."""
    angles = least_angles(xy, faces)
    return {"min_angle_median": float(np.median(angles)), "below_5_degrees": float((angles < THIN_DEGREES).mean())}


def mesh_deviation(
    ground: Ground, vertices: FloatArray, faces: IntArray, *, planar: bool = False
) -> tuple[FloatArray, BoolArray]:
    """Return d_p (N,) and covered (N,) for any mesh.

    Parameters
    ----------
    ground : Ground
        The model of N vertices and the rules, of which only what an uncovered vertex costs is asked.
    vertices : (V, 3) float array
        Vertices in the frame of the model's points [model units].
    faces : (M, 3) int array
        Triangles. Where several of them cover a point, the smallest of the differences counts.
    planar : bool
        Whether no two of them overlap in the plane: then what is nearest to an uncovered point is sought on the outline
        alone, and of several places as near that of the first edge of the outline counts, as for subsets; else that of
        the first edge of all, which any mesh has.

    Raises
    ------
    ValueError
        If there is no face with an area in the plane, or the arrays do not fit together.
    """
    deviation, covered, _ = _look_at_mesh(ground, vertices, faces, n_recorded=0, planar=planar)
    return deviation, covered


@brief
@dataclass(frozen=True)
class MeshSamples:
    """What a mesh's heights do to the d_p of each original vertex, with the mesh fixed in the plane.

    With heights h of the mesh's vertices, d_p = sqrt(gap_p^2 + (h[sites_p] . shares_p - z_p)^2).

    Attributes
    ----------
    sites : (N, 3) int array
        The mesh's vertices that carry the surface at each original vertex, or at the point nearest to it.
    shares : (N, 3) float array
        Their shares in the height there, which add up to 1; all 0 where a vertex is not covered and costs nothing.
    gap : (N,) float array
        Distance in the plane to the mesh [model units]; 0 where it covers the vertex.
    covered : (N,) bool array
        Whether a triangle covers it.
    """

    sites: np.ndarray
    shares: np.ndarray
    gap: np.ndarray
    covered: np.ndarray


def mesh_samples(ground: Ground, vertices: FloatArray, faces: IntArray) -> MeshSamples:
    """Return which vertices of a mesh decide about the deviation at each original one; see :func:`mesh_deviation`."""
    _, covered, recorded = _look_at_mesh(ground, vertices, faces, n_recorded=len(ground.z))
    return MeshSamples(*recorded, covered)


def _look_at_mesh(
    ground: Ground, vertices: FloatArray, faces: IntArray, n_recorded: int, planar: bool = False
) -> tuple[FloatArray, BoolArray, tuple[IntArray, FloatArray, FloatArray]]:
    """Check a mesh and return d_p, covered, and as many rows of sites, shares and gaps as are to be recorded."""
    vertices = np.asarray(vertices, float)
    faces = np.asarray(faces)
    for name, array in (("vertices", vertices), ("faces", faces)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f"{name} have shape {array.shape}; give (rows, 3), as of a triangle mesh")
    if len(faces) and not np.issubdtype(faces.dtype, np.integer):
        raise ValueError(f"faces are {faces.dtype}; give whole numbers, rows of the vertices")
    faces = np.ascontiguousarray(faces, np.int64)
    if len(faces) == 0:
        raise ValueError("a mesh without faces has no error; it needs at least one triangle")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"faces index rows {faces.min()} to {faces.max()} of {len(vertices)} vertices")
    if not np.isfinite(vertices).all():
        raise ValueError(
            f"{int((~np.isfinite(vertices)).any(axis=1).sum())} of {len(vertices)} vertices are not finite"
        )
    unit, samples, z = ground.unit, ground.xy, ground.z
    xy = np.ascontiguousarray(vertices[:, :2] / unit).ravel()
    height = np.ascontiguousarray(vertices[:, 2])
    extent = float(np.ptp(samples.reshape(-1, 2), axis=0).max())
    deviation = np.empty(len(z))
    covered = np.empty(len(z), np.bool_)
    recorded = np.zeros((n_recorded, 3), np.int64), np.zeros((n_recorded, 3)), np.zeros(n_recorded)
    ends, key = np.empty((3 * len(faces), 2), np.int64), np.empty(3 * len(faces), np.int64)
    m = _cover(samples, z, xy, height, faces, extent, deviation, covered, *recorded[:2], ends, key)
    if m == 0:
        raise ValueError(f"none of the {len(faces)} faces has an area in the plane")
    bare = np.flatnonzero(~covered)
    if len(bare) and ground.nearest:
        ends, key = ends[:m], key[:m]
        if planar:
            low, high = np.sort(ends, axis=1).T
            _, first, times = np.unique(low * len(vertices) + high, return_index=True, return_counts=True)
            alone = np.sort(first[times == 1])
            ends, key = ends[alone], key[alone]
        # along the curve, so that the tree's boxes are small whatever the order of the faces
        place = xy.reshape(-1, 2)
        order = np.argsort(hilbert_keys((place[ends[:, 0]] + place[ends[:, 1]]) / 2.0), kind="stable")
        _measure_outside(bare, samples, z, xy, height, ends[order], key[order], unit, deviation, *recorded)
    else:
        deviation[bare] = 0.0
    return deviation, covered, recorded


def line_errors(
    ground: Ground, lines: ModelLines | None, vertices: FloatArray, faces: IntArray, *, planar: bool = False
) -> dict[str, float]:
    """Return how far any mesh is from break lines as they were given; nothing without lines.

    At each of their vertices: the deviation, as of a vertex of the model there. The mean is weighted by the length of
    line that each stands for, half of both pieces beside it, in space.

    Parameters
    ----------
    ground, vertices, faces, planar
        As in :func:`mesh_deviation`.
    lines : ModelLines, optional
        Of the model.
    """
    if lines is None:
        return {}
    places = np.concatenate(lines.originals)
    samples = ground._replace(xy=np.ascontiguousarray(places[:, :2] / ground.unit).ravel(), z=places[:, 2].copy())
    deviation, _ = mesh_deviation(samples, vertices, faces, planar=planar)
    return lines.errors(deviation)


# Faces thinner than this (area over the squared extent of the model) cover nothing: they stand upright or are
# degenerate.
SOLID_AREA = 1e-14


@entry
def _cover(
    samples: np.ndarray,
    z: np.ndarray,
    xy: np.ndarray,
    height: np.ndarray,
    faces: np.ndarray,
    extent: float,
    deviation: np.ndarray,
    covered: np.ndarray,
    sites: np.ndarray,
    shares: np.ndarray,
    ends: np.ndarray,
    key: np.ndarray,
) -> int:
    """Fill d_p of what the mesh covers, what decides it, if ``sites`` has rows, and the edges of all solid faces.

    Returns the number of edges, with their rank in ``key``; 0 if no face is solid.
    """
    n = len(z)
    # Samples by cell of the unit square, about two in each.
    side = max(int(np.sqrt(n / 2)), 1)
    start = np.zeros(side * side + 2, np.int64)
    for i in range(n):
        column = min(int(samples[2 * i] * side), side - 1)
        row = min(int(samples[2 * i + 1] * side), side - 1)
        start[row * side + column + 2] += 1
    for k in range(2, side * side + 2):
        start[k] += start[k - 1]
    items = np.empty(n, np.int64)
    for i in range(n):
        column = min(int(samples[2 * i] * side), side - 1)
        row = min(int(samples[2 * i + 1] * side), side - 1)
        items[start[row * side + column + 1]] = i
        start[row * side + column + 1] += 1
    for i in range(n):
        deviation[i] = np.inf
        covered[i] = False
    m = 0
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, bx, by, cx, cy = xy[2 * a], xy[2 * a + 1], xy[2 * b], xy[2 * b + 1], xy[2 * c], xy[2 * c + 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(area) <= SOLID_AREA * extent * extent:
            continue
        for k in range(3):
            ends[m, 0] = faces[f, k]
            ends[m, 1] = faces[f, (k + 1) % 3]
            key[m] = 3 * f + k
            m += 1
        low_x, high_x = min(ax, bx, cx), max(ax, bx, cx)
        low_y, high_y = min(ay, by, cy), max(ay, by, cy)
        margin = 1e-9 * (high_x - low_x + high_y - low_y)
        first_column = max(int((low_x - margin) * side), 0)
        last_column = min(int((high_x + margin) * side), side - 1) if high_x + margin >= 0.0 else -1
        first_row = max(int((low_y - margin) * side), 0)
        last_row = min(int((high_y + margin) * side), side - 1) if high_y + margin >= 0.0 else -1
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                cell = row * side + column
                for q in range(start[cell], start[cell + 1]):
                    i = items[q]
                    px = samples[2 * i]
                    py = samples[2 * i + 1]
                    wb = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) / area
                    wc = ((py - ay) * (bx - ax) - (px - ax) * (by - ay)) / area
                    wa = 1.0 - wb - wc
                    if wa >= -COVER_TOLERANCE and wb >= -COVER_TOLERANCE and wc >= -COVER_TOLERANCE:
                        d = abs(wa * height[a] + wb * height[b] + wc * height[c] - z[i])
                        if d < deviation[i]:
                            deviation[i] = d
                            if len(sites) > 0:
                                sites[i, 0], sites[i, 1], sites[i, 2] = a, b, c
                                shares[i, 0], shares[i, 1], shares[i, 2] = wa, wb, wc
                        covered[i] = True
    return m


@entry
def _measure_outside(
    bare: np.ndarray,
    samples: np.ndarray,
    z: np.ndarray,
    xy: np.ndarray,
    height: np.ndarray,
    ends: np.ndarray,
    key: np.ndarray,
    unit: float,
    deviation: np.ndarray,
    sites: np.ndarray,
    shares: np.ndarray,
    gap: np.ndarray,
) -> None:
    """Fill d_p of vertices that no face covers, by the nearest edge, and what decides it, if ``gap`` has rows."""
    m = len(ends)
    boxes = build_tree(xy, ends, m)
    stack = np.empty(64, np.int64)
    guess = 0
    for q in range(len(bare)):
        i = bare[q]
        guess, t, d = nearest_segment(xy, ends, key, m, boxes, stack, samples[2 * i], samples[2 * i + 1], guess)
        dz = (1.0 - t) * height[ends[guess, 0]] + t * height[ends[guess, 1]] - z[i]
        deviation[i] = np.sqrt(d * unit * unit + dz * dz)
        if len(gap) > 0:
            sites[i, 0], sites[i, 1], sites[i, 2] = ends[guess, 0], ends[guess, 1], ends[guess, 1]
            shares[i, 0], shares[i, 1] = 1.0 - t, t
            gap[i] = np.sqrt(d) * unit
