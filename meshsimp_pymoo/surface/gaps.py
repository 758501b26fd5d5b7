"""The mesh of a kept subset of a height grid with gaps, and its error over all samples that there are.

A triangle is emitted, and a sample outside the mesh costs, as the rules of height surfaces say (see
:mod:`~meshsimp_pymoo.surface.evaluate`); what is different here is that the grid's faces are looked up in its bits, and
that its heights are read band by band.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.constraints import NO_CONSTRAINTS, Constraints
from meshsimp_pymoo.plane.emission import SLIVER_HEIGHT, emit, outline
from meshsimp_pymoo.plane.footprint import Footprint, is_there
from meshsimp_pymoo.plane.nearest import build_tree
from meshsimp_pymoo.plane.triangulation import RECORD, height_on, locate
from meshsimp_pymoo.surface.centroids import Between
from meshsimp_pymoo.surface.evaluate import beside_mesh, measure_between
from meshsimp_pymoo.surface.grid import Cells, HeightGrid
from meshsimp_pymoo.surface.measures import ERROR, MAXIMUM, REGIONS, SQUARES, TRIANGLES, UNCOVERED, VERTICES
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.workers import on_threads

# Columns of the table of rows: sum, sum of squares and maximum of the deviations, uncovered samples; and between the
# row and the next the sum of the deviations, the number of faces and that of those whose centroid is covered, each
# times the widths of cells.
_SUM, _SQUARES, _MAXIMUM, _UNCOVERED, _BETWEEN, _FACES, _COVERED = range(7)


def emitted_of(grid: HeightGrid, xy: FloatArray, records: IntArray, rules: Rules) -> BoolArray:
    """Return which records of the triangulation of kept samples (V, 2) are triangles of the mesh, under the rules."""
    lattice = grid.lattice
    assert lattice is not None
    footprint = lattice.footprint(grid.x, grid.y)
    if rules.footprint == "hull":
        footprint = footprint._replace(side=0)
    left, right, low, high = grid.domain
    emitted = np.zeros(len(records) // RECORD, np.uint8)
    _emit(xy.ravel(), records, SLIVER_HEIGHT * float(np.hypot(right - left, high - low)), footprint, NO_CONSTRAINTS,
          emitted)  # fmt: skip
    return emitted.astype(bool)


class _Laid(NamedTuple):
    """A mesh as the functions that pass over the grid take it.

    Attributes
    ----------
    xy, z, records : arrays
        Places, one after the other, and heights of its vertices, and its records.
    emitted : uint8 array
        Which of these are triangles of it.
    ends, key, boxes : arrays
        Its outline; see :func:`_outline`.
    """

    xy: FloatArray
    z: FloatArray
    records: IntArray
    emitted: IntArray
    ends: IntArray
    key: IntArray
    boxes: FloatArray

    @classmethod
    def of(cls, mesh: tuple[FloatArray, FloatArray, IntArray, BoolArray]) -> _Laid:
        """Find the outline of a mesh."""
        xy, z, records, shown = mesh
        flat, emitted = np.ascontiguousarray(xy).ravel(), shown.astype(np.uint8)
        return cls(flat, z, records, emitted, *_outline(flat, records, emitted))

    def starts(self, grid: HeightGrid, exact_area: float) -> IntArray:
        """Return a triangle near the beginning of each row.

        A row is measured from the same triangle whatever the bands and the threads: on an edge its neighbours differ by
        rounding.
        """
        rows, columns = grid.span
        found = np.zeros(grid.shape[0], np.int64)
        _find_starts(grid.x[columns.start], grid.y[rows], self.xy, self.records, exact_area, found[rows])
        return found


def tabulated_with_gaps(
    grid: HeightGrid,
    mesh: tuple[FloatArray, FloatArray, IntArray, BoolArray],
    nearest: bool,
    at: IntArray,
    *,
    between: bool,
    n_threads: int = 1,
) -> tuple[FloatArray, FloatArray, BoolArray, float]:
    """Do what :func:`~meshsimp_pymoo.surface.weld.tabulated` does.

    Parameters
    ----------
    grid : HeightGrid
        The grid.
    mesh : ((V, 2) float array, (V,) float array, uint32 array, bool array)
        Places and heights of its vertices, its records and which of them are emitted.
    nearest : bool
        Whether a sample outside the mesh costs its distance.
    at, between, n_threads
        As there.
    """
    _, z, records, shown = mesh
    row, deviation, covered = np.empty(REGIONS), np.zeros(len(at)), np.zeros(len(at), bool)
    if not shown.any():
        row[[ERROR, SQUARES, MAXIMUM]] = np.inf
        row[[TRIANGLES, VERTICES, UNCOVERED]] = 0, 0, grid.n_vertices
        return row, deviation, covered, np.nan
    n_columns, lattice = grid.shape[1], grid.lattice
    assert lattice is not None
    rows, _ = grid.span
    centroids = grid.between if between else None
    cells = centroids if isinstance(centroids, Cells) else None
    exact_area = grid.exact_ranges[0] if cells is None else cells.exact_area
    laid = _Laid.of(mesh)
    starts = laid.starts(grid, exact_area)
    table = np.zeros((grid.shape[0], _COVERED + 1))
    bounds = np.linspace(rows.start, rows.stop, n_threads + 1).astype(int)
    how = grid.unit, nearest, exact_area

    def do(part: int) -> None:
        above = np.empty((0, n_columns))
        # the cells north of its rows belong to a part
        for first, band in grid.bands(first=max(bounds[part] - 1, rows.start), end=bounds[part + 1]):
            end = first + len(band)
            if cells is not None:
                north = first - len(above)
                _measure_cells_with_gaps(
                    cells.x, cells.y[north:], cells.width, np.concatenate([above, band]), lattice.bits[north:end],
                    *laid, starts[north:end], *how, table[north:end],
                )  # fmt: skip
                above = band[-1:]
            if first < bounds[part]:
                first, band = first + 1, band[1:]
            low, high = np.searchsorted(at, [first * n_columns, end * n_columns])
            residuals = np.zeros(band.shape if high > low else (0, 0))
            covers = np.zeros(residuals.shape, np.bool_)
            _measure_rows_with_gaps(
                grid.x, grid.y[first:end], band, lattice.bits[first:end], *laid, starts[first:end], *how,
                table[first:end], residuals, covers,
            )  # fmt: skip
            deviation[low:high] = np.abs(residuals.ravel()[at[low:high] - first * n_columns])
            covered[low:high] = covers.ravel()[at[low:high] - first * n_columns]

    on_threads(do, range(n_threads), n_threads=n_threads)
    row[ERROR], row[SQUARES], row[MAXIMUM] = table[:, _SUM].sum(), table[:, _SQUARES].sum(), table[:, _MAXIMUM].max()
    row[TRIANGLES], row[UNCOVERED] = shown.sum(), table[:, _UNCOVERED].sum()
    used = np.zeros(len(z), bool)
    used[records.reshape(-1, RECORD)[shown, :3]] = True
    row[VERTICES] = used.sum()
    surface_error = np.nan
    if cells is not None:
        surface_error = float((cells.height @ table[:-1, _BETWEEN]) / (cells.height @ table[:-1, _FACES]))
    elif isinstance(centroids, Between):
        surface_error = measure_between(
            centroids, laid.xy, z, records, len(records), laid.emitted, grid.unit, nearest, False
        )
    return row, deviation, covered, surface_error


def residual_bands_with_gaps(
    grid: HeightGrid, mesh: tuple[FloatArray, FloatArray, IntArray, BoolArray], nearest: bool
) -> Iterator[tuple[int, FloatArray, BoolArray]]:
    """Do what :func:`~meshsimp_pymoo.surface.weld.residual_bands` does; the mesh is as in the function above."""
    lattice, exact_area = grid.lattice, grid.exact_ranges[0]
    assert lattice is not None
    laid = _Laid.of(mesh)
    starts = laid.starts(grid, exact_area)
    for first, band in grid.bands():
        end = first + len(band)
        residuals, covers = np.full(band.shape, np.nan), np.zeros(band.shape, np.bool_)
        table = np.zeros((len(band), _COVERED + 1))
        _measure_rows_with_gaps(
            grid.x, grid.y[first:end], band, lattice.bits[first:end], *laid, starts[first:end], grid.unit, nearest,
            exact_area, table, residuals, covers,
        )  # fmt: skip
        yield first, residuals, covers


def covered_share(grid: HeightGrid, mesh: tuple[FloatArray, FloatArray, IntArray, BoolArray], cells: Cells) -> float:
    """Return the share of the area of the faces of a grid with gaps whose centroids a mesh covers."""
    lattice, (rows, _) = grid.lattice, grid.span
    assert lattice is not None
    laid = _Laid.of(mesh)
    starts = laid.starts(grid, cells.exact_area)
    table, above = np.zeros((grid.shape[0], _COVERED + 1)), np.empty((0, grid.shape[1]))
    for first, band in grid.bands(first=rows.start, end=rows.stop):
        north, end = first - len(above), first + len(band)
        _measure_cells_with_gaps(
            cells.x, cells.y[north:], cells.width, np.concatenate([above, band]), lattice.bits[north:end],
            *laid, starts[north:end], grid.unit, False, cells.exact_area, table[north:end],
        )  # fmt: skip
        above = band[-1:]
    return float((cells.height @ table[:-1, _COVERED]) / (cells.height @ table[:-1, _FACES]))


@entry
def _emit(
    xy: np.ndarray,
    mesh: np.ndarray,
    min_height: float,
    footprint: Footprint,
    lines: Constraints,
    emitted: np.ndarray,
) -> None:
    """Mark the triangles of a mesh."""
    stack = np.empty(len(emitted) + 1, np.uint32)
    nobody = np.zeros(len(xy) // 2, np.int32)
    emit(xy, mesh, len(mesh), min_height, xy, borrowed(footprint), borrowed(lines), nobody, emitted, stack)


@entry
def _outline(xy: np.ndarray, mesh: np.ndarray, emitted: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the segments of a mesh's outline, their ranks and the boxes of a tree over them."""
    ends, key = outline(mesh, len(mesh), emitted)
    return ends, key, build_tree(xy, ends, len(key))


@entry
def _find_starts(
    x: float, y: np.ndarray, xy: np.ndarray, mesh: np.ndarray, exact_area: float, starts: np.ndarray
) -> None:
    """Fill in a triangle near the beginning of each row."""
    t = 0
    for r in range(len(y)):
        t = locate(xy, mesh, t, x, y[r], exact_area)
        starts[r] = t


@entry
def _measure_rows_with_gaps(
    x: np.ndarray,
    y: np.ndarray,
    heights: np.ndarray,
    bits: np.ndarray,
    xy: np.ndarray,
    z: np.ndarray,
    mesh: np.ndarray,
    emitted: np.ndarray,
    ends: np.ndarray,
    key: np.ndarray,
    boxes: np.ndarray,
    starts: np.ndarray,
    unit: float,
    nearest: bool,
    exact_area: float,
    table: np.ndarray,
    residuals: np.ndarray,
    covers: np.ndarray,
) -> None:
    """Fill the table's first columns for each row; and all residuals and what is covered, if there is room.

    A residual is by how much a sample lies above the mesh; of one that no triangle covers what it costs.
    """
    stack = np.empty(64, np.int64)
    wanted = len(residuals) > 0
    guess = 0
    flat_bits = bits.ravel()
    n_bytes = bits.shape[1]
    for r in range(len(y)):
        t = starts[r]
        py = y[r]
        total = 0.0
        squares = 0.0
        maximum = 0.0
        uncovered = 0
        for c in range(len(x)):
            if not is_there(flat_bits, n_bytes, r, c):
                continue
            px = x[c]
            t = locate(xy, mesh, t, px, py, exact_area)
            if emitted[t // RECORD] != 0:
                above = heights[r, c] - height_on(xy, z, mesh, t, px, py)
                is_covered = True
            else:
                above, is_covered, guess = beside_mesh(
                    xy, z, ends, key, boxes, stack, unit, nearest, px, py, heights[r, c], guess
                )
                uncovered += not is_covered
            d = abs(above)
            if wanted:
                residuals[r, c] = above
                covers[r, c] = is_covered
            total += d
            squares += d * d
            maximum = max(maximum, d)
        table[r, _SUM] = total
        table[r, _SQUARES] = squares
        table[r, _MAXIMUM] = maximum
        table[r, _UNCOVERED] = uncovered


@entry
def _measure_cells_with_gaps(
    x: np.ndarray,
    y: np.ndarray,
    width: np.ndarray,
    heights: np.ndarray,
    bits: np.ndarray,
    xy: np.ndarray,
    z: np.ndarray,
    mesh: np.ndarray,
    emitted: np.ndarray,
    ends: np.ndarray,
    key: np.ndarray,
    boxes: np.ndarray,
    starts: np.ndarray,
    unit: float,
    nearest: bool,
    exact_area: float,
    table: np.ndarray,
) -> None:
    """Fill the table's last columns for each row and the next: the faces of cells of four samples, or of three."""
    stack = np.empty(64, np.int64)
    guess = 0
    flat_bits = bits.ravel()
    n_bytes = bits.shape[1]
    for r in range(len(heights) - 1):
        t = starts[r]
        total = 0.0
        faces = 0.0
        covered = 0.0
        for c in range(len(width)):
            nw = is_there(flat_bits, n_bytes, r, c)
            ne = is_there(flat_bits, n_bytes, r, c + 1)
            sw = is_there(flat_bits, n_bytes, r + 1, c)
            se = is_there(flat_bits, n_bytes, r + 1, c + 1)
            if nw + ne + sw + se < 3:
                continue
            # the corner that a face leaves out, west to east, from the north
            for k in range(4):
                if k == 0:
                    is_face = not nw
                elif k == 1:
                    is_face = nw and sw and se
                elif k == 2:
                    is_face = nw and ne and se
                else:
                    is_face = not se
                if not is_face:
                    continue
                px = x[1 - (k & 1), c]
                py = y[r, k >> 1]
                middle = 0.0
                middle += heights[r, c] if k != 0 else 0.0
                middle += heights[r, c + 1] if k != 1 else 0.0
                middle += heights[r + 1, c] if k != 2 else 0.0
                middle += heights[r + 1, c + 1] if k != 3 else 0.0
                middle /= 3.0
                t = locate(xy, mesh, t, px, py, exact_area)
                if emitted[t // RECORD] != 0:
                    d = abs(height_on(xy, z, mesh, t, px, py) - middle)
                    is_covered = True
                else:
                    d, is_covered, guess = beside_mesh(
                        xy, z, ends, key, boxes, stack, unit, nearest, px, py, middle, guess
                    )
                total += width[c] * abs(d)
                faces += width[c]
                covered += width[c] if is_covered else 0.0
        table[r, _BETWEEN] = total
        table[r, _FACES] = faces
        table[r, _COVERED] = covered
