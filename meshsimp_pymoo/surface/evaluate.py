"""How far a simplified mesh is from the original one, and how many triangles it has: the two objectives.

The error of a mesh is the sum of d_p over all N original vertices p (Campomanes-Alvarez et al. 2013, Eqs. 2-4):

* p covered by an emitted triangle: d_p = |z_p - z~_p|, with z~ linear on that triangle;
* p not covered: its distance in space to the point of the mesh that is nearest to it in the plane
  (``outside="nearest"``), or 0 (``outside="ignore"``, the paper's reading).

Where the model has weights (see :class:`~meshsimp_pymoo.surface.model.OpenModel`) the error is the sum of w_p d_p,
its mean and its root mean square are weighted by w, and its maximum is that of d_p over all p with w_p > 0. Weights
of 1 are the same as none; other weights change numbers, never triangles.

One compiled call does it for one subset or for many: gather, triangulate, emit (slivers, footprint), measure. It
allocates nothing of the order of N; all it needs is in a workspace, which a thread has while it is at it.
"""

from __future__ import annotations

import itertools

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, require_bool
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.constraints import constrain, place_of
from meshsimp_pymoo.plane.emission import emit, outline
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.nearest import build_tree, nearest_segment
from meshsimp_pymoo.plane.triangulation import RECORD, height_on, locate, locate_at_random, triangulate
from meshsimp_pymoo.surface.centroids import Between
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.measures import ERROR, MAXIMUM, REGIONS, SQUARES, TRIANGLES, UNCOVERED, VERTICES
from meshsimp_pymoo.workers import Reserve, on_threads

# A vertex counts as covered up to this far outside a triangle, in barycentric coordinates: rounding of rotated borders.
COVER_TOLERANCE = 1e-9
# How far from the triangle that is at most, in the unit square: three tolerances of what a corner is from the centroid.
REACH = 3e-9

NO_SITE = 0xFFFFFFFF

# In place of the deviations and the cover of each vertex, where they are not asked for.
NO_DEVIATION = np.empty(0, np.float64)
NO_COVER = np.empty(0, np.bool_)


# Entries of subsets that are evaluated in one go: about a tenth of a second.
AT_ONCE = 2_000_000

Workspace = tuple[np.ndarray, ...]


def make_workspace(n_vertices: int) -> Workspace:
    """Return the arrays that one thread needs to evaluate subsets of a model of N vertices; 135 N bytes."""
    n = n_vertices + 1
    return (
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


@inner(inline=True)
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


@inner(inline=True)
def beside_mesh(
    site_xy: np.ndarray,
    site_z: np.ndarray,
    ends: np.ndarray,
    key: np.ndarray,
    boxes: np.ndarray,
    stack: np.ndarray,
    unit: float,
    nearest: bool,
    x: float,
    y: float,
    z: float,
    guess: int,
) -> tuple[float, bool, int]:
    """Return d_p of a sample at (x, y, z) in no emitted triangle, whether one covers it all the same, and its segment.

    Where one covers it, d_p has a sign: negative for a sample below the mesh.
    The mesh's outline are the segments ``ends`` with their ranks ``key`` and ``boxes``; ``guess`` is any of them, and
    ``stack`` has room for 64 nodes.
    """
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
    is_near = d2 <= REACH * REACH
    is_covered = is_near and wa >= -COVER_TOLERANCE and wb >= -COVER_TOLERANCE and wc >= -COVER_TOLERANCE
    if is_covered:
        # Within rounding of the border, as on the sides of a turned rectangle.
        d = z - (wa * site_z[a] + wb * site_z[b] + wc * site_z[c])
    else:
        dz = (1.0 - t) * site_z[a] + t * site_z[b] - z
        d = np.sqrt(d2 * unit * unit + dz * dz) if nearest else 0.0
    return d, is_covered, guess


@inner
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
    ends, key = outline(mesh, end, emitted)
    boxes = build_tree(site_xy, ends, len(key))
    stack = np.empty(64, np.int64)
    n_regions = len(row) - REGIONS
    guess = 0
    for q in range(n_bare):
        i = bare[q]
        above, is_covered, guess = beside_mesh(
            site_xy, site_z, ends, key, boxes, stack, unit, nearest, xy[2 * i], xy[2 * i + 1], z[i], guess
        )
        d = abs(above)
        if not is_covered:
            row[UNCOVERED] += 1
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


@inner(inline=True)
def _measure_covered(
    ground: Ground,
    workspace: tuple,  # type: ignore[type-arg]
    n: int,
    row: np.ndarray,
    deviation: np.ndarray,
    covered: np.ndarray,
    lined: bool,
) -> tuple[float, float, float, int]:
    """Return sum, sum of squares and maximum of the costs of the dropped vertices in emitted triangles of n sites.

    The last is the number of the others, which are listed in the workspace.
    """
    xy = ground.xy
    z = ground.z
    exact_area = ground.exact_area
    weight = ground.weight
    _, dropped, site_xy, site_z, _, mesh, emitted, _, site_triangle = workspace
    n_all = len(z)
    weighted = len(weight) > 0
    n_regions = len(row) - REGIONS
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
        if lined:
            t = locate_at_random(site_xy, mesh, t, x, y, exact_area)
        else:
            t = locate(site_xy, mesh, t, x, y, exact_area)
        if emitted[t // RECORD] == 0:
            dropped[n_bare] = i
            n_bare += 1
            continue
        d = abs(height_on(site_xy, site_z, mesh, t, x, y) - z[i])
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
    return total, squares, maximum, n_bare


@inner
def _evaluate_one(
    ground: Ground,
    workspace: tuple,  # type: ignore[type-arg]
    kept: np.ndarray,
    row: np.ndarray,
    deviation: np.ndarray,
    covered: np.ndarray,
) -> int:
    """Fill ``row`` with the numbers of one subset; return the end of the triangles' records in the workspace."""
    xy = ground.xy
    z = ground.z
    corners = ground.corners
    exact_area = ground.exact_area
    weight = ground.weight
    sites, dropped, site_xy, site_z, inserted, mesh, emitted, stack, site_triangle = workspace
    n_all = len(z)
    n = _gather(xy, z, kept, ground.has_twins, sites, dropped, site_xy, site_z)
    first = np.empty(len(corners), np.int64)
    for k in range(len(corners)):
        first[k] = place_of(sites, n, corners[k])
    end = triangulate(site_xy, n, first, np.empty(0, np.int64), inserted, mesh, exact_area, ground.exact_lift)
    lined = len(ground.lines.at) > 0
    if end > 0 and lined:
        constrain(site_xy, mesh, end, ground.lines, sites, n, site_triangle, exact_area, ground.exact_lift)
    n_triangles = emit(
        site_xy,
        mesh,
        end,
        ground.min_height,
        xy,
        ground.footprint,
        ground.lines,
        sites,
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
    row[REGIONS:] = 0.0
    # One loop where edges are forced, one where none are: the walks differ, and to choose at each vertex takes longer.
    if lined:
        total, squares, maximum, n_bare = _measure_covered(ground, workspace, n, row, deviation, covered, True)
    else:
        total, squares, maximum, n_bare = _measure_covered(ground, workspace, n, row, deviation, covered, False)
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
            xy,
            z,
            dropped,
            n_bare,
            site_xy,
            site_z,
            ground.unit,
            mesh,
            end,
            emitted,
            ground.nearest,
            weight,
            row,
            deviation,
            covered,
        )
    return end


@entry
def _evaluate(
    ground: Ground,
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


@entry
def measure_between(
    between: Between,
    site_xy: np.ndarray,
    site_z: np.ndarray,
    mesh: np.ndarray,
    end: int,
    emitted: np.ndarray,
    unit: float,
    nearest: bool,
    lined: bool,
) -> float:
    """Return the mean deviation of a mesh at samples between the vertices, weighted by their shares.

    ``lined`` says whether some edges of the mesh are forced.
    """
    xy = between.xy
    z = between.z
    share = between.share
    bare = np.empty(len(z), np.int32)
    n_bare = 0
    total = 0.0
    t = 0
    for i in range(len(z)):
        x = xy[2 * i]
        y = xy[2 * i + 1]
        if lined:
            t = locate_at_random(site_xy, mesh, t, x, y, between.exact_area)
        else:
            t = locate(site_xy, mesh, t, x, y, between.exact_area)
        if emitted[t // RECORD] == 0:
            bare[n_bare] = i
            n_bare += 1
        else:
            total += share[i] * abs(height_on(site_xy, site_z, mesh, t, x, y) - z[i])
    row = np.zeros(REGIONS)
    if n_bare > 0:
        nothing, nowhere = np.empty(0), np.empty(0, np.bool_)
        _measure_bare(
            xy, z, bare, n_bare, site_xy, site_z, unit, mesh, end, emitted, nearest, share, row, nothing, nowhere
        )
    return total + row[ERROR]


def evaluate_subsets(
    ground: Ground, workspaces: Reserve[Workspace], kept: BoolArray, *, n_threads: int = 1, regions: int = 0
) -> FloatArray:
    """Evaluate many subsets; this is the call that a search spends its time in.

    Parameters
    ----------
    ground : Ground
        The model of N vertices and the rules.
    workspaces : Reserve
        Of :func:`make_workspace` for N vertices.
    kept : (P, N) bool array
        One subset a row, in vector order.
    n_threads : int
        Threads to share the rows among; the result is the same for any number.
    regions : int
        In how many runs of the vector the error is summed up separately too: vertex i is in region i * regions // N.

    Returns
    -------
    (P, REGIONS + regions) float array
        Columns ERROR, TRIANGLES, VERTICES, SQUARES (sum of w_p d_p squared, that is, w_p times the square of d_p),
        MAXIMUM, UNCOVERED, then the error of each region. A subset that emits no triangle has error, squares, maximum
        and regions inf.
    """
    n = len(ground.z)
    rows = np.ascontiguousarray(np.atleast_2d(kept))
    require_bool(rows, "subsets are bool arrays, one entry a vertex")
    if rows.shape[1] != n:
        raise ValueError(f"a subset of {n} vertices has as many entries, not {rows.shape[1]}")
    if not rows.flags.writeable:
        rows = rows.copy()
    table = np.empty((len(rows), REGIONS + regions))

    def evaluate(part: slice) -> None:
        with workspaces.one() as workspace:
            _evaluate(ground, workspace, rows[part], table[part], NO_DEVIATION, NO_COVER)

    if rows.size <= AT_ONCE and (n_threads <= 1 or len(rows) < 2 * n_threads):
        evaluate(slice(0, len(rows)))
        return table
    # Several parts a thread, since subsets differ in size; and no part so long that Ctrl-C is not heard.
    n_parts = min(max(4 * n_threads, -(-rows.size // AT_ONCE)), len(rows))
    cuts = np.linspace(0, len(rows), n_parts + 1).astype(int)
    on_threads(evaluate, [slice(a, b) for a, b in itertools.pairwise(cuts)], n_threads=max(n_threads, 1))
    return table


def triangulate_subset(
    ground: Ground, workspaces: Reserve[Workspace], kept: BoolArray, between: Between | None = None
) -> tuple[IntArray, FloatArray, FloatArray, BoolArray, float]:
    """Triangulate one subset (N,) and measure it everywhere.

    Parameters
    ----------
    ground, workspaces
        As in :func:`evaluate_subsets`.
    kept : (N,) bool array
        The subset, contiguous and writeable.
    between : Between, optional
        Where the mesh is measured too.

    Returns
    -------
    faces : (M, 3) int32 array
        The triangles as rows of the model, the least row first, sorted; none where no triangle is emitted.
    row : (REGIONS,) float array
        The subset's row of the table of :func:`evaluate_subsets`.
    deviation, covered : (N,) arrays
        d_p at every vertex [model units], and whether a triangle covers it.
    surface_error : float
        Mean of the deviations at ``between``; NaN where it is not asked for, or there is no triangle.
    """
    n = len(ground.z)
    row, deviation, covered = np.empty(REGIONS), np.zeros(n), np.zeros(n, np.bool_)
    with workspaces.one() as workspace:
        end = _evaluate(ground, workspace, kept[None], row[None], deviation, covered)
        sites, site_xy, site_z, mesh, emitted = (workspace[k] for k in (0, 2, 3, 5, 6))
        records = mesh[:end].reshape(-1, RECORD)[emitted[: end // RECORD] == 1, :3].astype(np.int64)
        faces = canonical_faces(records) if row[TRIANGLES] else records[:0]
        surface_error = np.nan
        if between is not None and row[TRIANGLES]:
            rules = ground.unit, ground.nearest, len(ground.lines.at) > 0
            surface_error = measure_between(between, site_xy, site_z, mesh, end, emitted, *rules)
        return sites[faces], row, deviation, covered, surface_error
