"""A height grid read by windows: a memory map, a GeoTIFF, an array, or a model in memory whose vertices are a grid.

A grid may have gaps. Its *samples* are numbered over all crossings of rows and columns; its *vertices* are those that
belong to a face, in the same order, and are numbered without gaps, as chromosomes want them.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, Rows
from meshsimp_pymoo.errors import ModelError, ResultError, warn_of
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.options import DEFAULT, Options
from meshsimp_pymoo.formats.source import COORDINATE_LIMIT
from meshsimp_pymoo.formats.source.heights import Heights
from meshsimp_pymoo.formats.source.missing import is_nodata
from meshsimp_pymoo.plane.lattice import Lattice, cells
from meshsimp_pymoo.plane.order import find_corners, vector_order
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.centroids import QUANTUM, Between, between_vertices
from meshsimp_pymoo.surface.model import OpenModel

# Samples that are looked at together where all are: some tens of megabytes.
BAND_SAMPLES = 2_000_000


@brief
@dataclass(frozen=True, eq=False)
class Cells:
    """Where the centroids of a grid's triangles can be: at either third of a cell's width and height.

    Attributes
    ----------
    x : (2, C - 1) float array
        A third and two thirds from the west of the cells of each column, in the unit square.
    y : (R - 1, 2) float array
        A third and two thirds from the south of those of each row.
    width : (C - 1,) float array
        Of the columns, as a share of all.
    height : (R - 1,) float array
        Of the rows.
    exact_area : float
        Up to where double precision is exact on these and the samples.
    """

    x: FloatArray
    y: FloatArray
    width: FloatArray
    height: FloatArray
    exact_area: float


@brief
@dataclass(frozen=True, eq=False)
class Scan:
    """What is known of a grid once all its samples were read.

    Attributes
    ----------
    hash : str
        SHA-256 of all samples and their places.
    heights_range : (float, float)
        The least and the greatest height of a vertex [file units].
    lattice : Lattice or None
        Which samples belong to a face; None: all.
    plan : (2, 2) float array
        Least and largest x and y of the samples that have data, in a face or not [file units].
    """

    hash: str
    heights_range: tuple[float, float]
    lattice: Lattice | None
    plan: FloatArray


@dataclass(frozen=True, eq=False)
class HeightGrid:
    """Heights at the crossings of rows and columns: N vertices, whose arrays are made row by row when asked for.

    A sample's number is ``row * columns + column``; that is the vector order, and without gaps the vertex' number too.
    Its place in the plane is the one that
    :func:`~meshsimp_pymoo.surface.model.build_model` would give it, so that triangulations are the same too.

    Attributes
    ----------
    name : str
        Where it came from, for messages.
    heights : (R, C) array, memory map or GeoTIFF of a real type
        Row 0 is the northernmost [file units].
    file_x : (C,) float array
        Where the columns are, ascending [file units].
    file_y : (R,) float array
        Where the rows are, descending [file units].
    model : OpenModel, optional
        The model that it was taken from; its rows are ``row_of``.
    row_of : (N,) int array, optional
        Row of each vertex in ``model.points``.
    nodata : float, optional
        Height that means "no sample", beside NaN.
    corner : (int, int)
        Row and column of the first sample in the file.
    file_columns : int, optional
        Columns of the file; None: those of the grid.
    georeference : dict
        Where on Earth it is, as far as the file says; see :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    scale : (float, float)
        Model units to a unit of x and y: 1, but metres to a degree where the file has degrees.
    options : Options
        How it was read.
    """

    name: str
    heights: Heights
    file_x: FloatArray
    file_y: FloatArray
    model: OpenModel | None = None
    row_of: IntArray | None = None
    nodata: float | None = None
    corner: tuple[int, int] = (0, 0)
    file_columns: int | None = None
    georeference: dict[str, Any] = field(default_factory=dict, repr=False)
    scale: tuple[float, float] = (1.0, 1.0)
    options: Options = field(default=DEFAULT, repr=False)

    def __repr__(self) -> str:
        rows, columns = self.shape
        return f"<HeightGrid {self.name}: {rows:,} rows of {columns:,} samples>"

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.heights.shape[0], self.heights.shape[1]

    @property
    def n_vertices(self) -> int:
        """Number N of samples that belong to a face, all of a grid without gaps: to know it all are read once."""
        return self.shape[0] * self.shape[1] if self.lattice is None else self.lattice.count

    @property
    def lattice(self) -> Lattice | None:
        """Which samples belong to a face, None: all; to know it all are read once."""
        return self._scanned.lattice

    def numbers(self, vertices: IntArray) -> IntArray:
        """Return the samples' numbers of vertices."""
        return vertices if self.lattice is None else self.lattice.numbers(vertices)

    def vertices(self, samples: IntArray) -> IntArray:
        """Return the vertices' numbers of samples; the inverse of :meth:`numbers`."""
        return samples if self.lattice is None else self.lattice.ranks(samples)

    @cached_property
    def span(self) -> tuple[slice, slice]:
        """The rows and the columns between the first and the last sample."""
        if self.lattice is None:
            return slice(0, self.shape[0]), slice(0, self.shape[1])
        rows, first, last = self.lattice.ends()
        return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(first.min()), int(last.max()) + 1)

    @cached_property
    def _frame(self) -> tuple[FloatArray, FloatArray, float]:
        """Where columns and rows are in the unit square of the samples, and its side [model units]."""
        rows, columns = self.span
        x, y = (values * scale for values, scale in zip((self.file_x, self.file_y), self.scale, strict=True))
        x, y = x - x[columns].min(), y - y[rows].min()
        unit = float(2.0 ** np.ceil(np.log2(max(np.ptp(x[columns]), np.ptp(y[rows])))))
        # rounded as the vertices of a model are
        return (x / unit + 1.0) - 1.0, (y / unit + 1.0) - 1.0, unit

    @property
    def x(self) -> FloatArray:
        """Where the columns (C,) are in the unit square, ascending."""
        return self._frame[0]

    @property
    def y(self) -> FloatArray:
        """Where the rows (R,) are in the unit square, descending."""
        return self._frame[1]

    @property
    def unit(self) -> float:
        """Side of the unit square, a power of two [model units]."""
        return self._frame[2]

    @property
    def domain(self) -> FloatArray:
        """Least and largest x, least and largest y of the samples in the unit square."""
        rows, columns = self.span
        x, y = self.x[columns], self.y[rows]
        return np.array([x[0], x[-1], y[-1], y[0]])

    @cached_property
    def corners(self) -> IntArray:
        """The samples at the four corners, ascending; with gaps those most extreme, as of a model in one piece."""
        rows, columns = self.shape
        if self.lattice is None:
            return np.array([0, columns - 1, (rows - 1) * columns, rows * columns - 1], np.int64)
        row, first, last = self.lattice.ends()
        samples = np.unique(np.concatenate([row * columns + first, row * columns + last]))
        xy = self.xy_at(samples)
        samples = samples[vector_order(xy, np.zeros(len(xy)))]
        return np.sort(samples[find_corners(self.xy_at(samples))])

    @property
    def found(self) -> dict[str, int]:
        """What was changed or left out when it was read, and how often: nothing where it is read by windows."""
        return {} if self.model is None else self.model.found

    @property
    def material(self) -> Material | None:
        """What all faces look like, as far as the file says."""
        return None if self.model is None else self.model.material

    @property
    def attributes(self) -> dict[str, Any]:
        """Colours and whatever else the file says of vertices, each with N rows."""
        if self.model is None:
            return {}
        return {name: self._rows_of(values) for name, values in self.model.attributes.items()}

    @property
    def faces(self) -> Any:
        """The triangles (T, 3), two a cell, or one beside a gap, cut as :func:`grid_source` does; or the model's."""
        if self.model is not None:
            return np.argsort(self.row_of)[self.model.faces]  # type: ignore[arg-type]
        if self.lattice is not None:
            return Rows(self._cut_with_gaps, int(self._faces_before[-1]))

        def cut(triangles: IntArray) -> IntArray:
            cell, second = np.divmod(triangles, 2)
            row, column = np.divmod(cell, self.shape[1] - 1)
            nw = row * self.shape[1] + column
            sw, se = nw + self.shape[1], nw + self.shape[1] + 1
            return np.column_stack([nw, np.where(second, se, sw), np.where(second, nw + 1, se)])

        return Rows(cut, 2 * (self.shape[0] - 1) * (self.shape[1] - 1))

    @cached_property
    def _faces_before(self) -> IntArray:
        """How many faces there are before each row of cells, and all."""
        counts = np.zeros(self.shape[0], np.int64)
        assert self.lattice is not None
        for first, end in self.lattice.bands(more=1):
            counts[first + 1 : end] = cells(self.lattice.rows(first, end)).sum(axis=1)
        return np.cumsum(counts)

    def _cut_with_gaps(self, triangles: IntArray) -> IntArray:
        """Return triangles by number, row of cells by row of cells."""
        lattice, columns = self.lattice, self.shape[1]
        assert lattice is not None
        triangles = np.asarray(triangles, np.int64)
        found = np.empty((len(triangles), 3), np.int64)
        rows = np.searchsorted(self._faces_before, triangles, side="right") - 1
        order = np.argsort(rows, kind="stable")
        for part in np.split(order, np.flatnonzero(np.diff(rows[order])) + 1):
            if not len(part):
                continue
            row = int(rows[part[0]])
            there = lattice.rows(row, row + 2)
            n_faces = cells(there)[0]
            column = np.repeat(np.arange(columns - 1), n_faces)
            second = np.r_[False, column[1:] == column[:-1]] if len(column) else np.zeros(0, bool)
            at = triangles[part] - self._faces_before[row]
            column, second = column[at], second[at]
            nw = row * columns + column
            corners = np.stack([nw, nw + columns, nw + columns + 1, nw + 1], axis=1)  # around the cell
            missing = ~np.stack(
                [there[0, column], there[1, column], there[1, column + 1], there[0, column + 1]], axis=1
            )
            left_out = np.where(missing.any(axis=1), missing.argmax(axis=1), np.where(second, 1, 3))
            kept = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])[left_out]
            found[part] = np.take_along_axis(corners, kept, axis=1)
        vertices: IntArray = lattice.ranks(found.ravel()).reshape(-1, 3)
        return vertices

    @cached_property
    def between(self) -> Between | Cells:
        """The centroids of :attr:`faces`: of a model all of them, else where they are by row and column."""
        if self.model is not None:
            return between_vertices(self.model)
        west, east, north, south = self.x[:-1], self.x[1:], self.y[:-1], self.y[1:]
        x = _thirds(np.stack([west + west + east, west + east + east]))
        y = _thirds(np.column_stack([north + south + south, north + south + north]))
        rows, columns = (slice(part.start, part.stop - 1) for part in self.span)
        places = np.concatenate([x[:, columns].ravel(), y[rows].ravel()])
        exact_area = min(self.exact_ranges[0], exact_ranges(places[:, None])[0])
        width, height = east - west, north - south
        return Cells(x, y, width / width.sum(), height / height.sum(), exact_area)

    @cached_property
    def exact_ranges(self) -> tuple[float, float]:
        """Up to where double precision is exact on these coordinates; see `meshsimp_pymoo.plane.predicates`."""
        rows, columns = self.span
        return exact_ranges(np.concatenate([self.x[columns], self.y[rows]])[:, None])

    @property
    def hash(self) -> str:
        """SHA-256 of all samples and their places."""
        return self._scanned.hash

    @property
    def heights_range(self) -> tuple[float, float]:
        """The least and the greatest height."""
        return self._scanned.heights_range

    @property
    def file_plan(self) -> FloatArray:
        """Least and largest x and y (2, 2) of the samples that have data, in a face or not [file units]."""
        return self._scanned.plan

    @property
    def file_box(self) -> FloatArray:
        """The lowest and the highest corner (2, 3) of the box around it [file units]."""
        if self.model is not None:
            return self.model.file_box
        low, high = self.heights_range
        rows, columns = self.span
        x, y = self.file_x[columns], self.file_y[rows]
        return np.array([[x[0], y[-1], low], [x[-1], y[0], high]])

    @cached_property
    def _scanned(self) -> Scan:
        """What is found by reading all samples once, band by band."""
        digest, low, high = hashlib.sha256(repr(self.shape).encode()), np.inf, -np.inf
        digest.update((self.file_x * self.scale[0]).tobytes())
        digest.update((self.file_y * self.scale[1]).tobytes())
        lattice = Lattice.empty(*self.shape)
        for first, band in self.bands():
            there = self._there(band, first)
            if not there.all():
                band = np.where(there, band, np.nan)
            digest.update(np.ascontiguousarray(band).tobytes())
            lattice.enter(first, there)
            low = min(low, float(band.min(initial=np.inf, where=there)))
            high = max(high, float(band.max(initial=-np.inf, where=there)))
        greatest = max(-low, high)
        if greatest > COORDINATE_LIMIT:
            raise ModelError(
                f"{self.name}: heights reach {greatest:g}; rescale the grid to below {COORDINATE_LIMIT:g}, or name "
                f"the height that means no sample (nodata, now {self.nodata})"
            )
        n_crossings = self.shape[0] * self.shape[1]
        if lattice.count == n_crossings:
            x, y = self.file_x, self.file_y
            return Scan(digest.hexdigest(), (low, high), None, np.array([[x[0], y[-1]], [x[-1], y[0]]]))
        solid = lattice.without_singles()
        n_singles = lattice.count - solid.count
        if solid.count == 0:
            raise ModelError(
                f"{self.name}: only {lattice.count} of {n_crossings} samples have data and no cell has three; check "
                f"nodata ({self.nodata})"
            )
        if n_singles:
            warn_of(f"{self.name}: {n_singles} of {lattice.count} vertices belong to no face and are left out")
            low, high = np.inf, -np.inf
            for first, band in self.bands():
                there = solid.rows(first, first + len(band))
                low = min(low, float(band.min(initial=np.inf, where=there)))
                high = max(high, float(band.max(initial=-np.inf, where=there)))
        rows, first, last = lattice.ends()
        x, y = self.file_x[[first.min(), last.max()]], self.file_y[rows[[-1, 0]]]
        return Scan(digest.hexdigest(), (low, high), solid, np.column_stack([x, y]))

    def bands(self, *, first: int = 0, end: int | None = None) -> Any:
        """Yield (first row, heights of some rows as float64), from north to south, a few megabytes each."""
        step = max(1, BAND_SAMPLES // self.shape[1])
        end = self.shape[0] if end is None else end
        for row in range(first, end, step):
            yield row, np.asarray(self.heights[row : min(row + step, end)], np.float64)

    def window(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Return the heights at these rows and columns (each ascending), float64; NaN where there is no vertex."""
        left, right = columns[0], columns[-1] + 1
        values = np.empty((len(rows), len(columns)))
        # every sixteenth row, say, of a whole file: what lies between is not to be held at once
        band = (rows - rows[0]) // max(1, BAND_SAMPLES // (right - left))
        for group in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(band)) + 1):
            top, bottom = rows[group[0]], rows[group[-1]] + 1
            part = self.heights[top:bottom, left:right]
            values[group] = part[np.ix_(rows[group] - top, columns - left)]
        if self.lattice is not None:
            values[~self.lattice.at(rows[:, None], columns)] = np.nan
        return values

    def triangles_of(self, samples: IntArray) -> IntArray:
        """Return how many triangles each sample is worth: V vertices, B of them on the sides, have 2 V - 2 - B.

        So the sum less 2 is the number of Delaunay triangles of a subset with the corners, where there are no gaps.
        """
        rows, columns = self.shape
        row, column = np.divmod(samples, columns)
        worth: IntArray = 1 + ((row > 0) & (row < rows - 1) & (column > 0) & (column < columns - 1))
        return worth

    def height_at(self, samples: IntArray) -> FloatArray:
        """Return the heights of samples by number."""
        rows, columns = np.divmod(samples, self.shape[1])
        return np.asarray(self.heights[rows, columns], np.float64)

    def xy_at(self, samples: IntArray) -> FloatArray:
        """Return the coordinates (n, 2) of samples in the unit square."""
        rows, columns = np.divmod(samples, self.shape[1])
        return np.column_stack([self.x[columns], self.y[rows]])

    @property
    def file_points(self) -> Any:
        """The vertices (N, 3) in the file's own frame, exactly as they are there."""
        if self.model is not None:
            return self._rows_of(self.model.file_points)

        def placed(vertices: IntArray) -> FloatArray:
            samples = self.numbers(vertices)
            rows, columns = np.divmod(samples, self.shape[1])
            return np.column_stack([self.file_x[columns], self.file_y[rows], self.height_at(samples)])

        return Rows(placed, self.n_vertices)

    @property
    def source_index(self) -> Any:
        """Row of each vertex (N,) in the file."""
        if self.model is not None:
            return self._rows_of(self.model.source_index)
        return Rows(lambda vertices: self.rows_of_samples(self.numbers(vertices)), self.n_vertices)

    def rows_of_samples(self, samples: IntArray) -> IntArray:
        """Return the rows of the file that samples are."""
        found: IntArray
        if self.model is not None:
            found = self.source_index[self.vertices(samples)]
            return found
        row, column = np.divmod(samples, self.shape[1])
        found = (row + self.corner[0]) * (self.file_columns or self.shape[1]) + column + self.corner[1]
        return found

    def samples_of_rows(self, rows: IntArray) -> IntArray:
        """Return the samples of rows of the file; the inverse of :meth:`rows_of_samples`.

        Raises
        ------
        ResultError
            If the grid has no such row: whoever names it is about another one.
        """
        if self.model is None or self.row_of is None:
            row, column = np.divmod(rows, self.file_columns or self.shape[1])
            samples = (row - self.corner[0]) * self.shape[1] + column - self.corner[1]
            samples = np.clip(samples, 0, self.shape[0] * self.shape[1] - 1)
        else:
            source = self.model.source_index[self.row_of]
            order = np.argsort(source)
            samples = self.numbers(order[np.minimum(np.searchsorted(source[order], rows), self.n_vertices - 1)])
        unknown = self.rows_of_samples(samples) != rows
        if self.lattice is not None:
            unknown |= ~self.lattice.at(*np.divmod(samples, self.shape[1]))
        wrong = np.flatnonzero(unknown)
        if len(wrong):
            raise ResultError(
                f"{self.name}: has no vertex of row {rows[wrong[0]]}, which the front keeps; its front.npz is damaged "
                "or of another model; simplify again"
            )
        return samples

    def _rows_of(self, values: Any) -> Rows:
        """Return an array of the model's vertices as one of the grid's."""
        row_of = self.row_of
        assert row_of is not None
        return Rows(lambda vertices: values[row_of[vertices]], self.n_vertices)

    def _there(self, values: FloatArray, first: int) -> BoolArray:
        """Return which of the heights of some rows, from ``first`` on, are samples."""
        there: BoolArray = ~np.isnan(values)
        if self.nodata is not None:
            there &= ~is_nodata(values.astype(self.heights.dtype), self.nodata)
        infinite = np.isinf(values) & there
        if infinite.any():
            i, j = np.argwhere(infinite)[0]
            raise ModelError(
                f"{self.name}: the height at row {self.corner[0] + first + i}, column {self.corner[1] + j} is "
                "infinite; set it to NaN or name the value with nodata"
            )
        return there


def _thirds(sums: FloatArray) -> FloatArray:
    """Return a third of sums of coordinates, rounded as those are."""
    thirds: FloatArray = np.rint(sums / (3.0 * QUANTUM)) * QUANTUM
    return thirds
