"""A height grid read by windows: a memory map, a GeoTIFF, an array, or a model in memory whose vertices are a grid."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, NoFullGrid
from meshsimp_pymoo.formats.options import Options, Window
from meshsimp_pymoo.formats.source.heights import Heights, PlacedHeights, placed_heights
from meshsimp_pymoo.formats.table import format_of_input, guarded, refuse_foreign
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.settings import settings_of, taken
from meshsimp_pymoo.surface.model import OpenModel

# Samples that are looked at together where all are: some tens of megabytes.
BAND_SAMPLES = 2_000_000


@dataclass(frozen=True, eq=False)
class HeightGrid:
    """Heights at the crossings of rows and columns.

    A sample's number is ``row * columns + column``. Its place in the plane is the one that
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
    x: FloatArray = field(init=False, repr=False)
    y: FloatArray = field(init=False, repr=False)
    unit: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        x = self.file_x - self.file_x.min()
        y = self.file_y - self.file_y.min()
        unit = float(2.0 ** np.ceil(np.log2(max(np.ptp(x), np.ptp(y)))))
        # rounded as the vertices of a model are
        for name, values in (("x", (x / unit + 1.0) - 1.0), ("y", (y / unit + 1.0) - 1.0)):
            object.__setattr__(self, name, values)
        object.__setattr__(self, "unit", unit)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.heights.shape[0], self.heights.shape[1]

    @property
    def n_samples(self) -> int:
        """Number N of samples."""
        return self.shape[0] * self.shape[1]

    @property
    def corners(self) -> IntArray:
        """The four corner samples, ascending."""
        rows, columns = self.shape
        return np.array([0, columns - 1, (rows - 1) * columns, rows * columns - 1], np.int64)

    @property
    def n_triangles(self) -> int:
        """Number of triangles of the full grid."""
        return 2 * (self.shape[0] - 1) * (self.shape[1] - 1)

    @cached_property
    def exact_ranges(self) -> tuple[float, float]:
        """Up to where double precision is exact on these coordinates; see `meshsimp_pymoo.plane.predicates`."""
        return exact_ranges(np.concatenate([self.x, self.y])[:, None])

    @cached_property
    def hash(self) -> str:
        """SHA-256 of all samples and their places: read once, band by band."""
        digest = hashlib.sha256(repr(self.shape).encode())
        digest.update(self.file_x.tobytes())
        digest.update(self.file_y.tobytes())
        for first, band in self.bands():
            digest.update(np.ascontiguousarray(band).tobytes())
            self._check(band, first, 0)
        return digest.hexdigest()

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

    def height_at(self, samples: IntArray) -> FloatArray:
        """Return the heights of samples by number."""
        rows, columns = np.divmod(samples, self.shape[1])
        return np.asarray(self.heights[rows, columns], np.float64)

    def xy_at(self, samples: IntArray) -> FloatArray:
        """Return the coordinates (n, 2) of samples in the unit square."""
        rows, columns = np.divmod(samples, self.shape[1])
        return np.column_stack([self.x[columns], self.y[rows]])

    def file_points(self, samples: IntArray) -> FloatArray:
        """Return samples (n, 3) in the file's own frame, exactly as they are there."""
        if self.model is not None and self.row_of is not None:
            return self.model.file_points[self.row_of[samples]]
        rows, columns = np.divmod(samples, self.shape[1])
        return np.column_stack([self.file_x[columns], self.file_y[rows], self.height_at(samples)])

    def attributes_at(self, samples: IntArray) -> dict[str, AnyArray]:
        """Return colours and whatever else the file says of samples."""
        if self.model is None or self.row_of is None:
            return {}
        return {name: values[self.row_of[samples]] for name, values in self.model.attributes.items()}

    def source_rows(self, samples: IntArray) -> IntArray:
        """Return the row of each sample in the file."""
        if self.model is not None and self.row_of is not None:
            return self.model.source_index[self.row_of[samples]]
        row, column = np.divmod(samples, self.shape[1])
        found: IntArray = (row + self.corner[0]) * (self.file_columns or self.shape[1]) + column + self.corner[1]
        return found

    def samples_of_rows(self, rows: IntArray) -> IntArray:
        """Return the samples of rows of the file; the inverse of :meth:`source_rows`."""
        if self.model is None or self.row_of is None:
            row, column = np.divmod(rows, self.file_columns or self.shape[1])
            return (row - self.corner[0]) * self.shape[1] + column - self.corner[1]
        source = self.model.source_index[self.row_of]
        order = np.argsort(source)
        return order[np.searchsorted(source[order], rows)]

    def _check(self, values: FloatArray, rows: Any, columns: Any) -> None:
        missing = ~np.isfinite(values)
        if self.nodata is not None:
            # in the grid's own precision: -3.4028235e38 must match its float32 neighbour
            own = self.heights.dtype
            with np.errstate(over="ignore"):
                missing |= values == (float(own.type(self.nodata)) if own.kind == "f" else self.nodata)
        if missing.any():
            i, j = np.argwhere(missing)[0]
            row = int(rows[i]) if np.ndim(rows) else rows + int(i)
            column = int(columns[j]) if np.ndim(columns) else columns + int(j)
            raise NoFullGrid(
                f"{self.name}: has no height at row {row + self.corner[0]}, column {column + self.corner[1]}; only a "
                "grid without gaps can be cut into tiles: fill them, take a part without (--window), or leave the "
                "tiles out (--tile none)"
            )


def open_grid(
    model: str | os.PathLike[str] | npt.ArrayLike | OpenModel | HeightGrid,
    options: Options | None = None,
    **kwargs: Any,
) -> HeightGrid:
    """Open a height grid for work by tiles.

    Parameters
    ----------
    model : path, built-in name, (R, C) array, OpenModel or HeightGrid
        A ``.npy`` file is mapped into memory and a GeoTIFF opened, and both are read by windows only; any other file is
        read whole first. A model's vertices must be all the crossings of rows and columns, and nothing else.
    options : Options, optional
        How it is read; a grid with samples of the height ``nodata`` is refused, as is what cannot apply.
    **kwargs
        Settings of :class:`~meshsimp_pymoo.formats.options.Options` that differ from those, such as ``spacing``.

    Raises
    ------
    ModelError
        If it cannot be read or is no such grid.
    """
    options = taken(Options, options, kwargs)
    if kwargs:
        raise TypeError(f"open_grid has no argument {next(iter(kwargs))!r}; it takes {', '.join(settings_of(Options))}")
    if isinstance(model, HeightGrid):
        if options != Options():
            raise ModelError(f"{model.name}: is a grid that is open already; say how it is read where it is opened")
        return model
    if isinstance(model, OpenModel):
        return _grid_of_model(open_model(model, options))
    if not isinstance(model, (str, os.PathLike)):
        _refuse_other_sides("grid", options)
        return _grid_of_heights("grid", placed_heights(np.asanyarray(model), "grid", options))
    path = Path(model)
    kind = format_of_input(path)
    if kind is None or kind.open_heights is None or not path.is_file():
        return _grid_of_model(open_model(model, options))
    name = str(path)
    _refuse_other_sides(name, options, kind.name)
    with guarded(kind, name):
        return _grid_of_heights(name, kind.open_heights(path, name, options))


def count_samples(model: str | os.PathLike[str], *, window: Window | None = None) -> int | None:
    """Return the number of samples of a grid file, or of a part of it, from its header alone; None for anything else.

    Parameters
    ----------
    model : path
        A file whose format knows how to count them, such as ``.npy`` or ``.tif``.
    window : (column, row, columns, rows), optional
        The part.
    """
    path = Path(model)
    kind = format_of_input(path)
    if kind is None or kind.count_samples is None or not path.is_file():
        return None
    if window is not None:
        return int(window[2]) * int(window[3])
    with guarded(kind, str(path)):
        return kind.count_samples(path, str(path))


def _refuse_other_sides(name: str, options: Options, *formats: str) -> None:
    """Refuse what says nothing of heights over rows and columns."""
    refuse_foreign(name, options, "grid", *formats)
    if options.up not in ("auto", "z", "+z"):
        raise ModelError(f"{name}: heights of a grid are along z; leave up={options.up!r} out")
    if options.patch is not None:
        raise ModelError(f"{name}: all of a grid faces up; leave patch={options.patch!r} out")


def _grid_of_heights(name: str, found: PlacedHeights) -> HeightGrid:
    return HeightGrid(
        name,
        found.heights,
        found.x,
        found.y,
        nodata=found.nodata,
        corner=found.corner,
        file_columns=found.file_columns,
        georeference=found.georeference,
    )


def _grid_of_model(model: OpenModel) -> HeightGrid:
    """Find the rows and columns of a model's vertices."""
    x, column = np.unique(model.xy[:, 0], return_inverse=True)
    y, row = np.unique(model.xy[:, 1], return_inverse=True)
    number = (len(y) - 1 - row) * len(x) + column
    n_cells = 2 * (len(x) - 1) * (len(y) - 1)
    if model.n_vertices != len(x) * len(y) or len(np.unique(number)) != len(number) or len(model.faces) != n_cells:
        raise NoFullGrid(
            f"{model.name}: its {model.n_vertices} vertices are not all crossings of {len(y)} rows and {len(x)} "
            "columns; only a height grid without gaps can be cut into tiles: leave the tiles out"
        )
    if model.weights is not None:
        raise ModelError(f"{model.name}: has weights, which tiles do not know; leave the weights or the tiles out")
    row_of = np.empty(model.n_vertices, np.int64)
    row_of[number] = np.arange(model.n_vertices)
    heights = model.points[row_of, 2].reshape(len(y), len(x))
    return HeightGrid(
        model.name,
        heights,
        x * model.unit,
        y[::-1] * model.unit,
        model=model,
        row_of=row_of,
        georeference=model.georeference,
    )
