"""A height grid read by windows: a memory map, a GeoTIFF, an array, or a model in memory whose vertices are a grid."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray, Rows
from meshsimp_pymoo.errors import NoFullGrid, ResultError
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.options import DEFAULT, Options
from meshsimp_pymoo.formats.source.heights import Heights
from meshsimp_pymoo.formats.source.missing import is_nodata
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.centroids import QUANTUM, Between, between_vertices
from meshsimp_pymoo.surface.model import OpenModel

# Samples that are looked at together where all are: some tens of megabytes.
BAND_SAMPLES = 2_000_000


@brief
@dataclass(frozen=True, eq=False)
class Cells:
    """Where the centroids of a grid's triangles are, two a cell, south-west and north-east of its diagonal.

    Attributes
    ----------
    x : (2, C - 1) float array
        Of the lower and the upper triangle of the cells of each column, in the unit square.
    y : (R - 1, 2) float array
        The same for each row.
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


@dataclass(frozen=True, eq=False)
class HeightGrid:
    """Heights at the crossings of rows and columns: N vertices, whose arrays are made row by row when asked for.

    A sample's number is ``row * columns + column``; that is the vector order. Its place in the plane is the one that
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
        Row of each sample in ``model.points``.
    nodata : float, optional
        Height that means "no sample"; a grid that has any cannot be tiled.
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
    x: FloatArray = field(init=False, repr=False)
    y: FloatArray = field(init=False, repr=False)
    unit: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        x, y = (values * scale for values, scale in zip((self.file_x, self.file_y), self.scale, strict=True))
        x, y = x - x.min(), y - y.min()
        unit = float(2.0 ** np.ceil(np.log2(max(np.ptp(x), np.ptp(y)))))
        # rounded as the vertices of a model are
        for name, values in (("x", (x / unit + 1.0) - 1.0), ("y", (y / unit + 1.0) - 1.0)):
            object.__setattr__(self, name, values)
        object.__setattr__(self, "unit", unit)

    def __repr__(self) -> str:
        rows, columns = self.shape
        return f"<HeightGrid {self.name}: {rows:,} rows of {columns:,} samples>"

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.heights.shape[0], self.heights.shape[1]

    @property
    def n_vertices(self) -> int:
        """Number N of samples."""
        return self.shape[0] * self.shape[1]

    @property
    def corners(self) -> IntArray:
        """The four corner samples, ascending."""
        rows, columns = self.shape
        return np.array([0, columns - 1, (rows - 1) * columns, rows * columns - 1], np.int64)

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
        """Colours and whatever else the file says of samples, each with N rows."""
        if self.model is None:
            return {}
        return {name: self._rows_of(values) for name, values in self.model.attributes.items()}

    @property
    def faces(self) -> Any:
        """The triangles (T, 3) of the full grid, two a cell, cut as :func:`grid_source` does; or those of the model."""
        if self.model is not None:
            return np.argsort(self.row_of)[self.model.faces]  # type: ignore[arg-type]

        def cut(triangles: IntArray) -> IntArray:
            cell, second = np.divmod(triangles, 2)
            row, column = np.divmod(cell, self.shape[1] - 1)
            nw = row * self.shape[1] + column
            sw, se = nw + self.shape[1], nw + self.shape[1] + 1
            return np.column_stack([nw, np.where(second, se, sw), np.where(second, nw + 1, se)])

        return Rows(cut, 2 * (self.shape[0] - 1) * (self.shape[1] - 1))

    @cached_property
    def between(self) -> Between | Cells:
        """The centroids of :attr:`faces`: of a model all of them, else where they are by row and column."""
        if self.model is not None:
            return between_vertices(self.model)
        west, east, north, south = self.x[:-1], self.x[1:], self.y[:-1], self.y[1:]
        x = _thirds(np.stack([west + west + east, west + east + east]))
        y = _thirds(np.column_stack([north + south + south, north + south + north]))
        exact_area = min(self.exact_ranges[0], exact_ranges(np.concatenate([x.ravel(), y.ravel()])[:, None])[0])
        width, height = east - west, north - south
        return Cells(x, y, width / width.sum(), height / height.sum(), exact_area)

    @cached_property
    def exact_ranges(self) -> tuple[float, float]:
        """Up to where double precision is exact on these coordinates; see `meshsimp_pymoo.plane.predicates`."""
        return exact_ranges(np.concatenate([self.x, self.y])[:, None])

    @property
    def hash(self) -> str:
        """SHA-256 of all samples and their places."""
        return self._scanned[0]

    @property
    def heights_range(self) -> tuple[float, float]:
        """The least and the greatest height."""
        return self._scanned[1:]

    @property
    def file_box(self) -> FloatArray:
        """The lowest and the highest corner (2, 3) of the box around it [file units]."""
        if self.model is not None:
            return self.model.file_box
        low, high = self.heights_range
        return np.array([[self.file_x[0], self.file_y[-1], low], [self.file_x[-1], self.file_y[0], high]])

    @cached_property
    def _scanned(self) -> tuple[str, float, float]:
        """The hash and the range of the heights: all samples are read once, band by band."""
        digest, low, high = hashlib.sha256(repr(self.shape).encode()), np.inf, -np.inf
        digest.update((self.file_x * self.scale[0]).tobytes())
        digest.update((self.file_y * self.scale[1]).tobytes())
        for first, band in self.bands():
            digest.update(np.ascontiguousarray(band).tobytes())
            self._check(band, first, 0)
            low, high = min(low, float(band.min())), max(high, float(band.max()))
        return digest.hexdigest(), low, high

    def bands(self, *, first: int = 0, end: int | None = None) -> Any:
        """Yield (first row, heights of some rows as float64), from north to south, a few megabytes each."""
        step = max(1, BAND_SAMPLES // self.shape[1])
        end = self.shape[0] if end is None else end
        for row in range(first, end, step):
            yield row, np.asarray(self.heights[row : min(row + step, end)], np.float64)

    def window(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Return the heights at these rows and columns (each ascending), float64.

        Raises
        ------
        ModelError
            If one of them is no number: a grid with gaps cannot be cut into tiles.
        """
        left, right = columns[0], columns[-1] + 1
        values = np.empty((len(rows), len(columns)))
        # every sixteenth row, say, of a whole file: what lies between is not to be held at once
        band = (rows - rows[0]) // max(1, BAND_SAMPLES // (right - left))
        for group in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(band)) + 1):
            top, bottom = rows[group[0]], rows[group[-1]] + 1
            part = self.heights[top:bottom, left:right]
            values[group] = part[np.ix_(rows[group] - top, columns - left)]
        self._check(values, rows, columns)
        return values

    def triangles_of(self, samples: IntArray) -> IntArray:
        """Return how many triangles each sample is worth: V vertices, B of them on the sides, have 2 V - 2 - B.

        So the sum less 2 is the number of Delaunay triangles of a subset with the corners.
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
        """The samples (N, 3) in the file's own frame, exactly as they are there."""
        if self.model is not None:
            return self._rows_of(self.model.file_points)

        def placed(samples: IntArray) -> FloatArray:
            rows, columns = np.divmod(samples, self.shape[1])
            return np.column_stack([self.file_x[columns], self.file_y[rows], self.height_at(samples)])

        return Rows(placed, self.n_vertices)

    @property
    def source_index(self) -> Any:
        """Row of each sample (N,) in the file."""
        if self.model is not None:
            return self._rows_of(self.model.source_index)

        def numbered(samples: IntArray) -> IntArray:
            row, column = np.divmod(samples, self.shape[1])
            found: IntArray = (row + self.corner[0]) * (self.file_columns or self.shape[1]) + column + self.corner[1]
            return found

        return Rows(numbered, self.n_vertices)

    def samples_of_rows(self, rows: IntArray) -> IntArray:
        """Return the samples of rows of the file; the inverse of ``source_index``.

        Raises
        ------
        ResultError
            If the grid has no such row: whoever names it is about another one.
        """
        if self.model is None or self.row_of is None:
            row, column = np.divmod(rows, self.file_columns or self.shape[1])
            samples = (row - self.corner[0]) * self.shape[1] + column - self.corner[1]
        else:
            source = self.model.source_index[self.row_of]
            order = np.argsort(source)
            samples = order[np.minimum(np.searchsorted(source[order], rows), self.n_vertices - 1)]
        samples = np.clip(samples, 0, self.n_vertices - 1)
        wrong = np.flatnonzero(self.source_index[samples] != rows)
        if len(wrong):
            raise ResultError(
                f"{self.name}: has no vertex of row {rows[wrong[0]]}, which the front keeps; its front.npz is damaged "
                "or of another model; simplify again"
            )
        return samples

    def _rows_of(self, values: Any) -> Rows:
        """Return an array of the model's vertices as one of the samples."""
        row_of = self.row_of
        assert row_of is not None
        return Rows(lambda samples: values[row_of[samples]], self.n_vertices)

    def _check(self, values: FloatArray, rows: Any, columns: Any) -> None:
        missing = ~np.isfinite(values)
        if self.nodata is not None:
            missing |= is_nodata(values.astype(self.heights.dtype), self.nodata)
        if missing.any():
            i, j = np.argwhere(missing)[0]
            row = int(rows[i]) if np.ndim(rows) else rows + int(i)
            column = int(columns[j]) if np.ndim(columns) else columns + int(j)
            raise NoFullGrid(
                f"{self.name}: has no height at row {row + self.corner[0]}, column {column + self.corner[1]}; only a "
                "grid without gaps can be cut into tiles: fill them, take a part without (--window), or leave the "
                "tiles out (--tile none)"
            )


def _thirds(sums: FloatArray) -> FloatArray:
    """Return a third of sums of coordinates, rounded as those are."""
    thirds: FloatArray = np.rint(sums / (3.0 * QUANTUM)) * QUANTUM
    return thirds
