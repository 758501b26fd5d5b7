"""How far a simplified mesh is from the original one, and how many triangles it has: the two objectives.

The error of a mesh is the sum of d_p over all N original vertices p (Campomanes-Alvarez et al. 2013, Eqs. 2-4):

* p covered by an emitted triangle: d_p = |z_p - z~_p|, with z~ linear on that triangle;
* p not covered: its distance in space to the point of the mesh that is nearest to it in the plane
  (``outside="nearest"``), or 0 (``outside="ignore"``, the paper's reading).

Where the model has weights (see :class:`~meshsimp_pymoo.surface.model.OpenModel`) the error is the sum of w_p d_p,
its mean and its root mean square are weighted by w, and its maximum is that of d_p over all p with w_p > 0. Weights
of 1 are the same as none; other weights change numbers, never triangles.

One compiled call does it for one subset or for many: gather, triangulate, emit (slivers, footprint), measure. It
allocates nothing of the order of N; all it needs is in a :class:`Workspace`, one for each thread.
"""

from __future__ import annotations

import itertools
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from meshsimp_pymoo.plane.footprint import inside
from meshsimp_pymoo.plane.hilbert import hilbert_keys
from meshsimp_pymoo.plane.nearest import build_tree, nearest_segment
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD, TRIANGLE, locate, triangulate
from meshsimp_pymoo.workers import thread_pool

if TYPE_CHECKING:
    from meshsimp_pymoo.surface.model import OpenModel

FOOTPRINTS = ("model", "hull")
OUTSIDES = ("nearest", "ignore")

# A vertex counts as covered up to this far outside a triangle, in barycentric coordinates: rounding of rotated borders.
COVER_TOLERANCE = 1e-9

# Columns of the table that evaluation fills, one row a subset.
ERROR, TRIANGLES, VERTICES, SQUARES, MAXIMUM, UNCOVERED = range(6)
# Columns from this one on, where asked for: the error by region, equal runs of the vector, which are patches in space.
REGIONS = 6
# What can be minimised besides the triangles, under the names that Quality gives them.
MEASURES = ("error", "rms_error", "max_error")
NO_SITE = 0xFFFFFFFF


@dataclass(frozen=True)
class Quality:
    """What is said of a simplified mesh.

    Attributes
    ----------
    error : float
        Sum of w_p d_p over all N original vertices; all w_p are 1 unless the model has weights [model units].
    triangles : int
        Number of triangles of the mesh.
    vertices : int
        Number of vertices its triangles use.
    mean_error, rms_error : float
        Mean and root mean square of d_p over all N original vertices, weighted by w [model units].
    max_error : float
        Maximum of d_p over the original vertices whose weight is not 0 [model units].
    uncovered : int
        Number of original vertices that no triangle covers.
    """

    error: float
    triangles: int
    vertices: int
    mean_error: float
    rms_error: float
    max_error: float
    uncovered: int


@dataclass(frozen=True)
class Simplified:
    """A simplified mesh in vector order, with its quality.

    Attributes
    ----------
    faces : (M, 3) int32 array
        Triangles as rows of ``model.points``, counter-clockwise from above, the smallest row first, sorted.
    quality : Quality
        Its numbers.
    deviation : (N,) float array
        d_p at every original vertex [model units].
    covered : (N,) bool array
        Whether a triangle covers it.
    """

    faces: np.ndarray
    quality: Quality
    deviation: np.ndarray
    covered: np.ndarray


class Workspace:
    """The arrays one thread needs to evaluate subsets of a model of N vertices; 135 N bytes, made once."""

    def __init__(self, n_vertices: int) -> None:
        n = n_vertices + 1
        self.arrays = (
            np.empty(n, np.int32),  # sites: rows of the kept vertices
            np.empty(n, np.int32),  # dropped: rows of the others
            np.empty(2 * n, np.float64),  # their coordinates, flat
            np.empty(n, np.float64),  # their heights
            np.empty(n, np.uint8),  # inserted
            np.empty(16 * n, np.uint32),  # the triangles' records
            np.empty(2 * n, np.uint8),  # emitted triangles
            np.empty(2 * n, np.uint32),  # stack
            np.empty(n, np.uint32),  # a triangle of each site
        )


_local = threading.local()


def _workspace(n_vertices: int) -> Workspace:
    """Return this thread's workspace, made anew when the model's size changes."""
    kept = getattr(_local, "workspace", None)
    if kept is None or kept[0] != n_vertices:
        kept = (n_vertices, Workspace(n_vertices))
        _local.workspace = kept
    return kept[1]


@njit(cache=True, nogil=True, forceinline=True)
def _gather(
    xy: np.ndarray,
    z: np.ndarray,
    kept: np.ndarray,
    has_twins: bool,
    sites: np.ndarray,
    dropped: np.ndarray,
    site_xy: np.ndarray,
    site_z: np.ndarray,
) -> int:
    """Copy the kept vertices together; of several at one (x, y) only the first becomes a site. Return their number."""
    n = 0
    m = 0
    for i in range(len(z)):
        x = xy[2 * i]
        y = xy[2 * i + 1]
        take = np.int64(kept[i])
        if has_twins and take and n > 0 and site_xy[2 * n - 2] == x and site_xy[2 * n - 1] == y:
            take = 0
        sites[n] = i
        site_xy[2 * n] = x
        site_xy[2 * n + 1] = y
        site_z[n] = z[i]
        dropped[m] = i
        n += take
        m += 1 - take
    return n


@njit(cache=True, nogil=True)
def is_sliver(xy: np.ndarray, mesh: np.ndarray, t: int, min_height: float) -> bool:
    """Whether a triangle is lower than ``min_height`` over its longest edge; the same for all its rotations."""
    a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
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


@njit(cache=True, nogil=True, forceinline=True)
def sum_of_three(a: float, b: float, c: float) -> float:
    """Their sum, rounded the same way in whatever order they come."""
    low = a if a < b else b
    high = b if a < b else a
    middle = c if c > low else low
    lowest = c if c < low else low
    highest = middle if middle > high else high
    middle = high if middle > high else middle
    return lowest + middle + highest


@njit(cache=True, nogil=True, forceinline=True)
def _emit(
    xy: np.ndarray,
    mesh: np.ndarray,
    end: int,
    min_height: float,
    model_xy: np.ndarray,
    side: int,
    state: np.ndarray,
    start: np.ndarray,
    items: np.ndarray,
    faces: np.ndarray,
    emitted: np.ndarray,
    stack: np.ndarray,
) -> int:
    """Mark the mesh's triangles: no ghosts, no slivers at the hull, none outside the footprint; return their number."""
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
                if emitted[t // RECORD] == 1 and is_sliver(xy, mesh, t, min_height):
                    emitted[t // RECORD] = 0
                    stack[depth] = t
                    depth += 1
    n_triangles = 0
    for t in range(0, end, RECORD):
        if emitted[t // RECORD] == 0:
            continue
        if side > 0:
            a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
            x3 = sum_of_three(xy[2 * a], xy[2 * b], xy[2 * c])
            y3 = sum_of_three(xy[2 * a + 1], xy[2 * b + 1], xy[2 * c + 1])
            if not inside(model_xy, side, state, start, items, faces, x3, y3):
                emitted[t // RECORD] = 0
                continue
        n_triangles += 1
    return n_triangles


@njit(cache=True, nogil=True)
def _outline(mesh: np.ndarray, end: int, emitted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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


@njit(cache=True, nogil=True)
def _measure_bare(
    xy: np.ndarray,
    z: np.ndarray,
    bare: np.ndarray,
    n_bare: int,
    site_xy: np.ndarray,
    site_z: np.ndarray,
    unit: float,
    mesh: np.ndarray,
    end: int,
    emitted: np.ndarray,
    nearest: bool,
    weight: np.ndarray,
    row: np.ndarray,
    deviation: np.ndarray,
    covered: np.ndarray,
) -> None:
    """Add the cost of the vertices that lie in no emitted triangle, by the nearest point of the mesh's outline."""
    ends, key = _outline(mesh, end, emitted)
    boxes = build_tree(site_xy, ends, len(key))
    stack = np.empty(64, np.int64)
    n_regions = len(row) - REGIONS
    guess = 0
    for q in range(n_bare):
        i = bare[q]
        x = xy[2 * i]
        y = xy[2 * i + 1]
        guess, t, d2 = nearest_segment(site_xy, ends, key, len(key), boxes, stack, x, y, guess)
        a, b, c = ends[guess, 0], ends[guess, 1], ends[guess, 2]
        ux = site_xy[2 * b] - site_xy[2 * a]
        uy = site_xy[2 * b + 1] - site_xy[2 * a + 1]
        vx = site_xy[2 * c] - site_xy[2 * a]
        vy = site_xy[2 * c + 1] - site_xy[2 * a + 1]
        px = x - site_xy[2 * a]
        py = y - site_xy[2 * a + 1]
        area = ux * vy - uy * vx
        wb = (px * vy - py * vx) / area
        wc = (py * ux - px * uy) / area
        wa = 1.0 - wb - wc
        is_covered = wa >= -COVER_TOLERANCE and wb >= -COVER_TOLERANCE and wc >= -COVER_TOLERANCE
        if is_covered:
            # Within rounding of the border, as on the sides of a turned rectangle.
            d = abs(wa * site_z[a] + wb * site_z[b] + wc * site_z[c] - z[i])
        else:
            row[UNCOVERED] += 1
            dz = (1.0 - t) * site_z[a] + t * site_z[b] - z[i]
            d = np.sqrt(d2 * unit * unit + dz * dz) if nearest else 0.0
        w = weight[i] if len(weight) > 0 else 1.0
        row[ERROR] += w * d
        row[SQUARES] += w * d * d
        if w > 0.0:
            row[MAXIMUM] = max(row[MAXIMUM], d)
        if n_regions > 0:
            row[REGIONS + i * n_regions // len(z)] += w * d
        if len(deviation) > 0:
            deviation[i] = d
            covered[i] = is_covered


@njit(cache=True, nogil=True)
def _evaluate_one(
    model: tuple,  # type: ignore[type-arg]
    workspace: tuple,  # type: ignore[type-arg]
    kept: np.ndarray,
    use_footprint: bool,
    nearest: bool,
    row: np.ndarray,
    deviation: np.ndarray,
    covered: np.ndarray,
) -> int:
    """Fill ``row`` with the numbers of one subset; return the end of the triangles' records in the workspace."""
    xy, z, corners, has_twins, unit, min_height, exact_area, exact_lift = model[:8]
    side, state, start, items, faces, weight = model[8:]
    sites, dropped, site_xy, site_z, inserted, mesh, emitted, stack, site_triangle = workspace
    n_all = len(z)
    n = _gather(xy, z, kept, has_twins, sites, dropped, site_xy, site_z)
    first = np.empty(len(corners), np.int64)
    for k in range(len(corners)):
        q = np.searchsorted(sites[:n], corners[k])
        first[k] = q if q < n and sites[q] == corners[k] else -1
    end = triangulate(site_xy, n, first, np.empty(0, np.int64), inserted, mesh, exact_area, exact_lift)
    n_triangles = _emit(
        site_xy,
        mesh,
        end,
        min_height,
        xy,
        side if use_footprint else 0,
        state,
        start,
        items,
        faces,
        emitted,
        stack,
    )
    if n_triangles == 0:
        row[ERROR] = np.inf
        row[TRIANGLES] = 0
        row[VERTICES] = 0
        row[SQUARES] = np.inf
        row[MAXIMUM] = np.inf
        row[UNCOVERED] = n_all
        row[REGIONS:] = np.inf
        return end
    for j in range(n):
        site_triangle[j] = NO_SITE
    for t in range(0, end, RECORD):
        if emitted[t // RECORD] == 1:
            site_triangle[mesh[t]] = t
            site_triangle[mesh[t + 1]] = t
            site_triangle[mesh[t + 2]] = t
    weighted = len(weight) > 0
    n_regions = len(row) - REGIONS
    row[REGIONS:] = 0.0
    total = 0.0
    squares = 0.0
    maximum = 0.0
    # Vertices in no emitted triangle are listed for later; the list takes the place of the dropped ones already seen.
    n_bare = 0
    t = 0
    last = -1
    for q in range(n_all - n):
        i = dropped[q]
        # The site before this vertex on the curve is close to it, and so is any triangle of that site.
        j = i - q - 1
        if j != last and j >= 0:
            last = j
            if site_triangle[j] != NO_SITE:
                t = site_triangle[j]
        x = xy[2 * i]
        y = xy[2 * i + 1]
        t = locate(site_xy, mesh, t, x, y, exact_area)
        if emitted[t // RECORD] == 0:
            dropped[n_bare] = i
            n_bare += 1
            continue
        a = mesh[t]
        b = mesh[t + 1]
        c = mesh[t + 2]
        ax = site_xy[2 * a] - x
        ay = site_xy[2 * a + 1] - y
        bx = site_xy[2 * b] - x
        by = site_xy[2 * b + 1] - y
        cx = site_xy[2 * c] - x
        cy = site_xy[2 * c + 1] - y
        wa = bx * cy - by * cx
        wb = cx * ay - cy * ax
        wc = ax * by - ay * bx
        d = abs((wa * site_z[a] + wb * site_z[b] + wc * site_z[c]) / (wa + wb + wc) - z[i])
        if weighted:
            w = weight[i]
            total += w * d
            squares += w * d * d
            maximum = max(maximum, d) if w > 0.0 else maximum
        else:
            w = 1.0
            total += d
            squares += d * d
            maximum = max(maximum, d)
        if n_regions > 0:
            row[REGIONS + i * n_regions // n_all] += w * d
        if len(deviation) > 0:
            deviation[i] = d
            covered[i] = True
    n_used = 0
    for j in range(n):
        i = sites[j]
        if site_triangle[j] == NO_SITE:
            dropped[n_bare] = i
            n_bare += 1
            continue
        n_used += 1
        if len(deviation) > 0:
            deviation[i] = 0.0
            covered[i] = True
    row[ERROR] = total
    row[TRIANGLES] = n_triangles
    row[VERTICES] = n_used
    row[SQUARES] = squares
    row[MAXIMUM] = maximum
    row[UNCOVERED] = 0
    if n_bare > 0:
        _measure_bare(
            xy, z, dropped, n_bare, site_xy, site_z, unit, mesh, end, emitted, nearest, weight, row, deviation, covered
        )
    return end


@njit(cache=True, nogil=True)
def _evaluate_many(
    model: tuple,  # type: ignore[type-arg]
    workspace: tuple,  # type: ignore[type-arg]
    kept: np.ndarray,
    use_footprint: bool,
    nearest: bool,
    table: np.ndarray,
) -> None:
    no_deviation = np.empty(0, np.float64)
    no_cover = np.empty(0, np.bool_)
    for k in range(len(kept)):
        _evaluate_one(model, workspace, kept[k], use_footprint, nearest, table[k], no_deviation, no_cover)


def evaluate_subsets(
    model: OpenModel,
    kept: np.ndarray,
    *,
    footprint: str = "model",
    outside: str = "nearest",
    n_threads: int = 1,
    regions: int = 0,
) -> np.ndarray:
    """Evaluate many subsets; this is the call that a search spends its time in.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices.
    kept : (P, N) bool array
        One subset a row, in vector order.
    footprint : {"model", "hull"}
        Which triangles are emitted.
    outside : {"nearest", "ignore"}
        What an uncovered vertex costs.
    n_threads : int
        Threads to share the rows among; the result is the same for any number.
    regions : int
        In how many runs of the vector the error is summed up separately too: vertex i is in region i * regions // N.

    Returns
    -------
    (P, 6 + regions) float array
        Columns ERROR, TRIANGLES, VERTICES, SQUARES (sum of w_p d_p squared, that is, w_p times the square of d_p),
        MAXIMUM, UNCOVERED, then the error of each region. A subset that emits no triangle has error, squares, maximum
        and regions inf.
    """
    use_footprint, nearest = checked_rules(footprint, outside)
    rows = np.ascontiguousarray(np.atleast_2d(kept))
    if rows.dtype != np.bool_:
        raise TypeError(f"subsets are bool arrays, one entry a vertex, not {rows.dtype}")
    if rows.shape[1] != model.n_vertices:
        raise ValueError(f"a subset of {model.name} has {model.n_vertices} entries, one a vertex, not {rows.shape[1]}")
    if not rows.flags.writeable:
        rows = rows.copy()
    arguments = model.kernel_arguments
    table = np.empty((len(rows), REGIONS + regions))

    def evaluate(part: slice) -> None:
        workspace = _workspace(model.n_vertices)
        _evaluate_many(arguments, workspace.arrays, rows[part], use_footprint, nearest, table[part])

    if n_threads <= 1 or len(rows) < 2 * n_threads:
        evaluate(slice(0, len(rows)))
        return table
    # Several parts a thread, since subsets differ in size.
    cuts = np.linspace(0, len(rows), min(4 * n_threads, len(rows)) + 1).astype(int)
    list(thread_pool(n_threads).map(evaluate, [slice(a, b) for a, b in itertools.pairwise(cuts)]))
    return table


def simplify(model: OpenModel, kept: np.ndarray, *, footprint: str = "model", outside: str = "nearest") -> Simplified:
    """Triangulate the kept vertices and measure the result: the phenotype of one chromosome.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices.
    kept : (N,) bool array
        The vertices that stay, in vector order.
    footprint, outside : str
        As in :func:`evaluate_subsets`.

    Returns
    -------
    Simplified

    Raises
    ------
    ValueError
        If no triangle is emitted: fewer than 3 vertices, all on one line, or all triangles outside the footprint.

    Examples
    --------
    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.model import build_model
    >>> roof = build_model(load("roof:3"))
    >>> corners = np.isin(np.arange(roof.n_vertices), roof.corners)
    >>> simplify(roof, corners).quality.error        # the ridge of 3 vertices falls from height 1 to the ground
    3.0
    """
    use_footprint, nearest = checked_rules(footprint, outside)
    row = np.array(kept, order="C")
    if row.dtype != np.bool_:
        raise TypeError(f"a subset is a bool array, one entry a vertex, not {row.dtype}")
    if row.shape != (model.n_vertices,):
        raise ValueError(
            f"a subset of {model.name} has shape ({model.n_vertices},), one entry a vertex, not {row.shape}"
        )
    workspace = _workspace(model.n_vertices)
    numbers = np.empty(6)
    deviation = np.zeros(model.n_vertices)
    covered = np.zeros(model.n_vertices, np.bool_)
    end = _evaluate_one(
        model.kernel_arguments, workspace.arrays, row, use_footprint, nearest, numbers, deviation, covered
    )
    if numbers[TRIANGLES] == 0:
        raise ValueError(
            f"{int(row.sum())} kept vertices of {model.name} span no triangle of the mesh; "
            "keep more of them, the corners first"
        )
    sites, mesh, emitted = workspace.arrays[0], workspace.arrays[5], workspace.arrays[6]
    records = mesh[:end].reshape(-1, RECORD)[emitted[: end // RECORD] == 1, :3].astype(np.int64)
    turn = records.argmin(axis=1)
    faces = np.stack([records[np.arange(len(records)), (turn + k) % 3] for k in range(3)], axis=1)
    faces = faces[np.lexsort((faces[:, 2], faces[:, 1], faces[:, 0]))]
    return Simplified(sites[faces], as_quality(numbers, model.total_weight), deviation, covered)


def as_quality(row: np.ndarray, total_weight: float) -> Quality:
    """Name the columns of one row of :func:`evaluate_subsets`; ``total_weight`` is that of the model, N without any."""
    return Quality(
        error=float(row[ERROR]),
        triangles=int(row[TRIANGLES]),
        vertices=int(row[VERTICES]),
        mean_error=float(row[ERROR] / total_weight),
        rms_error=float(np.sqrt(row[SQUARES] / total_weight)),
        max_error=float(row[MAXIMUM]),
        uncovered=int(row[UNCOVERED]),
    )


def measured(table: np.ndarray, measure: str, total_weight: float) -> np.ndarray:
    """Return one of MEASURES for each row (..., 6) of :func:`evaluate_subsets`; the numbers of :func:`as_quality`.

    Examples
    --------
    >>> measured(np.array([[6.0, 2, 4, 20, 4, 0]]), "rms_error", 5.0)
    array([2.])
    """
    require_measure(measure)
    if measure == "error":
        return table[..., ERROR]
    return np.sqrt(table[..., SQUARES] / total_weight) if measure == "rms_error" else table[..., MAXIMUM]


def require_measure(measure: str) -> None:
    """Raise a ValueError that names the measures if this is none of them."""
    if measure not in MEASURES:
        raise ValueError(f"measure={measure!r} is unknown; choose one of {', '.join(map(repr, MEASURES))}")


def checked_rules(footprint: str, outside: str) -> tuple[bool, bool]:
    """Return whether the footprint is the model's and whether uncovered vertices cost something; refuse other words."""
    if footprint not in FOOTPRINTS:
        raise ValueError(f"footprint={footprint!r} is unknown; choose one of {', '.join(map(repr, FOOTPRINTS))}")
    if outside not in OUTSIDES:
        raise ValueError(f"outside={outside!r} is unknown; choose one of {', '.join(map(repr, OUTSIDES))}")
    return footprint == "model", outside == "nearest"


def mesh_quality(
    model: OpenModel,
    vertices: np.ndarray,
    faces: np.ndarray,
    *,
    outside: str = "nearest",
    frame: str = "file",
) -> Quality:
    """Measure any mesh against the model by the same error: decimated, folded, with vertices of its own.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices.
    vertices : (V, 3) float array
        Vertices [model units].
    faces : (M, 3) int array
        Triangles. Where several of them cover a point, the smallest of the differences counts.
    outside : {"nearest", "ignore"}
        What an uncovered vertex costs.
    frame : {"file", "local"}
        Whether ``vertices`` are in the frame of the model's file or in that of ``model.points``.

    Returns
    -------
    Quality

    Raises
    ------
    ValueError
        If there is no face with an area in the plane, or the arrays do not fit together.
    """
    deviation, covered, n_used = mesh_deviation(model, vertices, faces, outside=outside, frame=frame)
    n = model.n_vertices
    weights = np.ones(n) if model.weights is None else model.weights
    row = np.empty(6)
    row[ERROR] = (weights * deviation).sum()
    row[TRIANGLES] = len(faces)
    row[VERTICES] = n_used
    row[SQUARES] = (weights * deviation**2).sum()
    row[MAXIMUM] = deviation[weights > 0].max()
    row[UNCOVERED] = n - covered.sum()
    return as_quality(row, model.total_weight)


def mesh_deviation(
    model: OpenModel,
    vertices: np.ndarray,
    faces: np.ndarray,
    *,
    outside: str = "nearest",
    frame: str = "file",
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return d_p (N,), covered (N,) and the number of vertices used, for any mesh; see :func:`mesh_quality`."""
    deviation, covered, _ = _look_at_mesh(model, vertices, faces, outside, frame, n_recorded=0)
    return deviation, covered, len(np.unique(faces))


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


def mesh_samples(
    model: OpenModel,
    vertices: np.ndarray,
    faces: np.ndarray,
    *,
    outside: str = "nearest",
    frame: str = "file",
) -> MeshSamples:
    """Return which vertices of a mesh decide about the deviation at each original vertex; see :func:`mesh_quality`."""
    _, covered, recorded = _look_at_mesh(model, vertices, faces, outside, frame, n_recorded=model.n_vertices)
    return MeshSamples(*recorded, covered)


def _look_at_mesh(
    model: OpenModel, vertices: np.ndarray, faces: np.ndarray, outside: str, frame: str, n_recorded: int
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Check a mesh and return d_p, covered, and as many rows of sites, shares and gaps as are to be recorded."""
    _, nearest = checked_rules("model", outside)
    if frame not in ("file", "local"):
        raise ValueError(f"frame={frame!r} is unknown; choose 'file' or 'local'")
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
    local = model.to_local(vertices) if frame == "file" else vertices
    xy = np.ascontiguousarray(local[:, :2] / model.unit).ravel()
    height = np.ascontiguousarray(local[:, 2])
    samples, z = model.kernel_arguments[:2]
    extent = float(np.ptp(model.xy, axis=0).max())
    deviation = np.empty(model.n_vertices)
    covered = np.empty(model.n_vertices, np.bool_)
    recorded = np.zeros((n_recorded, 3), np.int64), np.zeros((n_recorded, 3)), np.zeros(n_recorded)
    if not _mesh_deviation(samples, z, xy, height, faces, model.unit, extent, nearest, deviation, covered, *recorded):
        raise ValueError(f"none of the {len(faces)} faces has an area in the plane")
    return deviation, covered, recorded


# Faces thinner than this (area over the squared extent of the model) cover nothing: they stand upright or are
# degenerate.
SOLID_AREA = 1e-14


@njit(cache=True, nogil=True)
def _mesh_deviation(
    samples: np.ndarray,
    z: np.ndarray,
    xy: np.ndarray,
    height: np.ndarray,
    faces: np.ndarray,
    unit: float,
    extent: float,
    nearest: bool,
    deviation: np.ndarray,
    covered: np.ndarray,
    sites: np.ndarray,
    shares: np.ndarray,
    gap: np.ndarray,
) -> bool:
    """Fill d_p, its coverage and, if they have rows, what decides it for any mesh; False if no face is solid."""
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
    ends = np.empty((3 * len(faces), 2), np.int64)
    key = np.empty(3 * len(faces), np.int64)
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
                            if len(gap) > 0:
                                sites[i, 0], sites[i, 1], sites[i, 2] = a, b, c
                                shares[i, 0], shares[i, 1], shares[i, 2] = wa, wb, wc
                        covered[i] = True
    if m == 0:
        return False
    boxes = np.empty((0, 4))
    stack = np.empty(64, np.int64)
    guess = 0
    for i in range(n):
        if covered[i]:
            continue
        if not nearest:
            deviation[i] = 0.0
            continue
        if len(boxes) == 0:
            # Along the curve, so that the tree's boxes are small whatever the order of the faces.
            middle = np.empty((m, 2))
            for k in range(m):
                for axis in range(2):
                    middle[k, axis] = (xy[2 * ends[k, 0] + axis] + xy[2 * ends[k, 1] + axis]) / 2.0
            order = np.argsort(hilbert_keys(middle))
            ends[:m] = ends[order]
            key[:m] = key[order]
            boxes = build_tree(xy, ends, m)
        guess, t, d = nearest_segment(xy, ends, key, m, boxes, stack, samples[2 * i], samples[2 * i + 1], guess)
        dz = (1.0 - t) * height[ends[guess, 0]] + t * height[ends[guess, 1]] - z[i]
        deviation[i] = np.sqrt(d * unit * unit + dz * dz)
        if len(gap) > 0:
            sites[i, 0], sites[i, 1], sites[i, 2] = ends[guess, 0], ends[guess, 1], ends[guess, 1]
            shares[i, 0], shares[i, 1] = 1.0 - t, t
            gap[i] = np.sqrt(d) * unit
    return True
