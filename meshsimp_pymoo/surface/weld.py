"""The mesh of a kept subset of a height grid, and its error over all samples.

The mesh is the Delaunay triangulation of the kept samples, the same triangles that
:meth:`~meshsimp_pymoo.surface.height.HeightSurface.simplify` gives for the same subset of the same grid in memory. Its
error is added up over all samples, band by band, so that memory holds the mesh and a few rows of heights. Where the
grid has gaps, a triangle may lie outside its faces and a sample outside the mesh: see `meshsimp_pymoo.surface.gaps`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.order import vector_order
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD, height_on, locate, triangulate_once
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.centroids import Between
from meshsimp_pymoo.surface.evaluate import measure_between
from meshsimp_pymoo.surface.gaps import covered_share, emitted_of, residual_bands_with_gaps, tabulated_with_gaps
from meshsimp_pymoo.surface.grid import Cells, HeightGrid
from meshsimp_pymoo.surface.ground import make_ground
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
from meshsimp_pymoo.surface.rules import DEFAULT, Rules
from meshsimp_pymoo.surface.score import measured_angles, mesh_deviation
from meshsimp_pymoo.workers import on_threads


@brief
@dataclass(frozen=True, eq=False)
class WeldedMesh:
    """A triangulated subset of a grid.

    Attributes
    ----------
    samples : (V,) int array
        Numbers of its vertices' samples, in vector order.
    xy, z : (V, 2), (V,) float arrays
        Their coordinates in the unit square and heights [file units].
    records : uint32 array
        The triangles with their neighbours; see :mod:`meshsimp_pymoo.plane.triangulation`.
    emitted : bool array
        Which of the records are triangles of the mesh: not the ghosts beyond the hull, nor what the rules leave out.
    nearest : bool
        Whether a sample outside the mesh costs its distance.
    """

    samples: IntArray
    xy: FloatArray
    z: FloatArray
    records: npt.NDArray[np.uint32]
    emitted: BoolArray
    nearest: bool

    @property
    def faces(self) -> IntArray:
        """The triangles (M, 3) as rows of ``samples``, counter-clockwise from above, the least row first, sorted."""
        return canonical_faces(self.unsorted_faces)

    @property
    def unsorted_faces(self) -> IntArray:
        """The triangles (M, 3) in no order."""
        return self.records.reshape(-1, RECORD)[self.emitted, :3].astype(np.int64)

    @property
    def n_triangles(self) -> int:
        """Number of triangles."""
        return int(self.emitted.sum())


def weld(grid: HeightGrid, kept: IntArray, rules: Rules = DEFAULT) -> WeldedMesh:
    """Triangulate kept samples.

    Parameters
    ----------
    grid : HeightGrid
        The grid.
    kept : (V,) int array
        Numbers of the samples, the corners among them.
    rules : Rules
        Which triangles are emitted, and what a sample costs that none of them covers, where the grid has gaps.

    Raises
    ------
    ValueError
        If a corner is missing: the mesh would not cover the grid.
    """
    kept = np.sort(np.asarray(kept, np.int64))
    if not np.isin(grid.corners, kept).all():
        raise ValueError(f"the {len(kept)} samples lack a corner of {grid.name}; keep all of them")
    xy, z = grid.xy_at(kept), grid.height_at(kept)
    order = vector_order(xy, z)
    samples, xy, z = kept[order], np.ascontiguousarray(xy[order]), z[order]
    first = np.flatnonzero(np.isin(samples, grid.corners)).astype(np.int64)
    records = np.empty(16 * len(samples), np.uint32)
    end = triangulate_once(
        xy.ravel(), len(samples), first, np.empty(0, np.int64), np.empty(len(samples), np.uint8), records,
        *grid.exact_ranges,
    )  # fmt: skip
    records, rules = records[:end], rules.of_heights
    if grid.lattice is None:
        emitted = records.reshape(-1, RECORD)[:, :3].max(axis=1) <= LAST_INDEX
    else:
        emitted = emitted_of(grid, xy, records, rules)
    return WeldedMesh(samples, xy, z, records, emitted, rules.outside == "nearest")


def measure(grid: HeightGrid, mesh: WeldedMesh, *, n_threads: int = 1) -> Quality:
    """Measure a mesh over all samples of the grid."""
    return measured(grid, mesh, np.empty(0, np.int64), n_threads=n_threads)[0]


def measured(
    grid: HeightGrid, mesh: WeldedMesh, at: IntArray, *, n_threads: int = 1
) -> tuple[Quality, FloatArray, BoolArray]:
    """Measure a mesh over all samples of the grid; return its deviation at some too, ascending, and its cover there."""
    row, deviation, covered, between = tabulated(grid, mesh, at, between=True, n_threads=n_threads)
    angles = measured_angles(mesh.xy, mesh.unsorted_faces)
    return as_quality(row, grid.n_vertices, surface_error=between, **angles), deviation, covered


def tabulated(
    grid: HeightGrid, mesh: WeldedMesh, at: IntArray, *, between: bool, n_threads: int = 1
) -> tuple[FloatArray, FloatArray, BoolArray, float]:
    """Add up the error of a mesh over all samples.

    Returns
    -------
    row : (6,) float array
        Its numbers; see :mod:`~meshsimp_pymoo.surface.measures`.
    deviation : (n,) float array
        At the samples ``at``, ascending [file units].
    covered : (n,) bool array
        Whether it covers these.
    surface_error : float
        Its mean between the samples, if wanted, else NaN [file units].

    The sums are taken row by row and then over the rows, so they do not depend on the number of threads.
    """
    if grid.lattice is not None:
        arrays = mesh.xy, mesh.z, mesh.records, mesh.emitted
        return tabulated_with_gaps(grid, arrays, mesh.nearest, at, between=between, n_threads=n_threads)
    n_rows, n_columns = grid.shape
    table = np.zeros((n_rows, 4))
    centroids = grid.between if between else None
    cells = centroids if isinstance(centroids, Cells) else None
    deviation = np.empty(len(at))
    flat = np.ascontiguousarray(mesh.xy).ravel()
    bounds = np.linspace(0, n_rows, n_threads + 1).astype(int)

    def do(part: int) -> None:
        t = t_between = 0
        above = np.empty((0, n_columns))
        # the cells north of its rows belong to a part
        for row, band in grid.bands(first=max(bounds[part] - 1, 0), end=bounds[part + 1]):
            if cells is not None:
                north = row - len(above)
                t_between = _measure_cells(
                    cells.x, cells.y[north:], cells.width, np.concatenate([above, band]), flat, mesh.z, mesh.records,
                    t_between, cells.exact_area, table[north:, 3],
                )  # fmt: skip
                above = band[-1:]
            if row < bounds[part]:
                row, band = row + 1, band[1:]
            rows = slice(row, row + len(band))
            low, high = np.searchsorted(at, [row * n_columns, (row + len(band)) * n_columns])
            residuals = np.empty(band.shape if high > low else (0, 0))
            t = _measure_rows(
                grid.x, grid.y[rows], band, flat, mesh.z, mesh.records, t, grid.exact_ranges[0], table[rows], residuals
            )
            deviation[low:high] = np.abs(residuals.ravel()[at[low:high] - row * n_columns])

    on_threads(do, range(n_threads), n_threads=n_threads)
    row = np.full(REGIONS, np.nan)
    row[ERROR], row[SQUARES], row[MAXIMUM] = table[:, 0].sum(), table[:, 1].sum(), table[:, 2].max()
    row[TRIANGLES], row[VERTICES], row[UNCOVERED] = mesh.n_triangles, len(mesh.samples), 0
    surface_error = np.nan
    if cells is not None:
        surface_error = float((cells.height * table[:-1, 3]).sum())
    elif isinstance(centroids, Between):
        emitted = mesh.emitted.astype(np.uint8)
        surface_error = measure_between(
            centroids, flat, mesh.z, mesh.records, len(mesh.records), emitted, grid.unit, True, False
        )
    return row, deviation, np.ones(len(at), bool), surface_error


def residual_bands(grid: HeightGrid, mesh: WeldedMesh) -> Iterator[tuple[int, FloatArray, BoolArray]]:
    """Measure a mesh at all samples again, band by band from the north.

    Yields
    ------
    first : int
        The first row of the band.
    residuals : (r, C) float array
        By how much each sample lies above the mesh; where no triangle covers it, what it costs, as a deviation; NaN
        where there is no sample [file units].
    covered : (r, C) bool array
        Whether a triangle covers it.
    """
    if grid.lattice is not None:
        yield from residual_bands_with_gaps(grid, (mesh.xy, mesh.z, mesh.records, mesh.emitted), mesh.nearest)
        return
    flat, t = np.ascontiguousarray(mesh.xy).ravel(), 0
    for first, band in grid.bands():
        rows = slice(first, first + len(band))
        residuals, table = np.empty(band.shape), np.empty((len(band), 4))
        t = _measure_rows(
            grid.x, grid.y[rows], band, flat, mesh.z, mesh.records, t, grid.exact_ranges[0], table, residuals
        )
        yield first, residuals, np.ones(band.shape, bool)


def coverage(grid: HeightGrid, mesh: WeldedMesh) -> float:
    """Return the share of the area of the grid's faces whose centroids a mesh covers: 1 where it has no gaps."""
    if grid.lattice is None:
        return 1.0
    between = grid.between
    if isinstance(between, Cells):
        return covered_share(grid, (mesh.xy, mesh.z, mesh.records, mesh.emitted), between)
    assert grid.model is not None
    ground = make_ground(grid.model, Rules())._replace(xy=between.xy, z=between.z, nearest=False)
    vertices = np.column_stack([mesh.xy * grid.unit, mesh.z])
    _, covered = mesh_deviation(ground, vertices, mesh.unsorted_faces)
    return float(between.share[covered].sum())


def pieces(grid: HeightGrid, faces: IntArray, size: int) -> Iterator[tuple[str, IntArray]]:
    """Cut a mesh into tiles along its own edges: every triangle goes to the tile that its centroid lies in.

    Neighbouring pieces share the vertices and edges between them, so they meet without cracks and without vertices in
    the middle of an edge.

    Parameters
    ----------
    grid : HeightGrid
        The grid.
    faces : (M, 3) int array
        The mesh, its corners by vertex of the grid.
    size : int
        Samples along one side of a tile.

    Yields
    ------
    (str, (m, 3) int array)
        Row and column of the tile, from the north-west, as a name; its triangles. Tiles without a triangle are left
        out.
    """
    row, column = np.divmod(grid.numbers(faces.ravel()).reshape(-1, 3), grid.shape[1])
    tile_row, tile_column = row.sum(axis=1) // (3 * size), column.sum(axis=1) // (3 * size)
    number = tile_row * (grid.shape[1] // size + 1) + tile_column
    order = np.argsort(number, kind="stable")
    starts = np.flatnonzero(np.r_[True, np.diff(number[order]) > 0])
    for group in np.split(order, starts[1:]):
        yield f"{tile_row[group[0]]:03}_{tile_column[group[0]]:03}", faces[group]


@entry
def _measure_rows(
    x: np.ndarray,
    y: np.ndarray,
    heights: np.ndarray,
    xy: np.ndarray,
    z: np.ndarray,
    mesh: np.ndarray,
    start: int,
    exact_area: float,
    table: np.ndarray,
    residuals: np.ndarray,
) -> int:
    """Fill sum, sum of squares and maximum of the deviations of each row; return a triangle near the last row's begin.

    If there is room for them in ``residuals``, by how much each sample lies above the mesh too.

    In each row the surface is linear along x within a triangle, but it is worked out at every sample from the
    triangle's corners, as everywhere.
    """
    begin = start
    wanted = len(residuals) > 0
    for r in range(len(y)):
        t = begin
        py = y[r]
        total = 0.0
        squares = 0.0
        maximum = 0.0
        for c in range(len(x)):
            px = x[c]
            t = locate(xy, mesh, t, px, py, exact_area)
            if c == 0:
                begin = t
            above = heights[r, c] - height_on(xy, z, mesh, t, px, py)
            if wanted:
                residuals[r, c] = above
            d = abs(above)
            total += d
            squares += d * d
            maximum = max(maximum, d)
        table[r, 0] = total
        table[r, 1] = squares
        table[r, 2] = maximum
    return begin


@entry
def _measure_cells(
    x: np.ndarray,
    y: np.ndarray,
    width: np.ndarray,
    heights: np.ndarray,
    xy: np.ndarray,
    z: np.ndarray,
    mesh: np.ndarray,
    start: int,
    exact_area: float,
    table: np.ndarray,
) -> int:
    """Fill the mean deviation at the centroids between each row and the next; return a triangle near the last's begin.

    The original surface between four samples is two triangles, which meet on the line from north-west to south-east.
    """
    begin = start
    for r in range(len(heights) - 1):
        t = begin
        total = 0.0
        for c in range(len(width)):
            ends = heights[r, c] + heights[r + 1, c + 1]
            for k in range(2):
                px = x[k, c]
                py = y[r, k]
                t = locate(xy, mesh, t, px, py, exact_area)
                if c == 0:
                    begin = t
                middle = (ends + (heights[r + 1, c] if k == 0 else heights[r, c + 1])) / 3.0
                total += width[c] * abs(height_on(xy, z, mesh, t, px, py) - middle)
        table[r] = total / 2.0
    return begin
