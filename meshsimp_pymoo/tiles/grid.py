"""A height grid read by windows: a memory map, a GeoTIFF, an array, or a model in memory whose vertices are a grid."""

from __future__ import annotations

import hashlib
import os
import re
import warnings
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.datasets import find_source
from meshsimp_pymoo.errors import ModelError, NoFullGrid
from meshsimp_pymoo.formats.load import RASTER_SUFFIXES, Window, check_window
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.surface.model import OpenModel, build_model

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Samples that are looked at together where all are: some tens of megabytes.
BAND_SAMPLES = 2_000_000
# The lines of an ESRI ASCII grid that say what it is are the first few hundred bytes.
HEADER_BYTES = 2000


class Heights(Protocol):
    """An array of two dimensions, or what is read like one: by slices, or by arrays of rows and columns."""

    @property
    def shape(self) -> Any:
        """Rows and columns."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the heights."""

    def __getitem__(self, key: Any) -> Any: ...


@dataclass(frozen=True, eq=False)
class HeightGrid:
    """Heights at the crossings of rows and columns.

    A sample's number is ``row * columns + column``. Its place in the plane is the one that
    :func:`~meshsimp_pymoo.surface.model.load_model` would give it, so that triangulations are the same too.

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
        Where on Earth it is, as far as the file says; see :class:`~meshsimp_pymoo.formats.load.SourceMesh`.
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

    def attributes_at(self, samples: IntArray) -> dict[str, npt.NDArray[Any]]:
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
    *,
    spacing: float | tuple[float, float] | None = None,
    nodata: float | None = None,
    window: Window | None = None,
    up: Any = "auto",
) -> HeightGrid:
    """Open a height grid for work by tiles.

    Parameters
    ----------
    model : path, built-in name, (R, C) array, OpenModel or HeightGrid
        A ``.npy`` file is mapped into memory and a GeoTIFF opened, and both are read by windows only; any other file is
        read whole first. A model's vertices must be all the crossings of rows and columns, and nothing else.
    spacing : float or (dx, dy), optional
        Distances of the samples; those of the file, or 1, by default [units].
    nodata : float, optional
        Height that means "no sample"; where there is one, the grid is refused.
    window : (column, row, columns, rows), optional
        The part to take; places and rows stay those of the whole file.
    up : optional
        Direction of the height, for meshes; see :func:`~meshsimp_pymoo.surface.model.load_model`.

    Raises
    ------
    ModelError
        If it cannot be read or is no such grid.
    """
    if isinstance(model, HeightGrid):
        return model
    if isinstance(model, OpenModel):
        return _grid_of_model(model)
    if not isinstance(model, (str, os.PathLike)):
        return _grid_of_array(np.asanyarray(model), "grid", spacing, nodata, window)
    path = Path(model)
    by_windows = path.suffix.lower() in (".npy", *RASTER_SUFFIXES) and path.is_file()
    if by_windows and up not in ("auto", "z", "+z"):
        raise ModelError(f"{path}: heights of a grid are along z; leave up={up!r} out")
    if by_windows and path.suffix.lower() == ".npy":
        return _grid_of_array(_map_array(path), str(path), spacing, nodata, window)
    if by_windows:
        return _grid_of_raster(path, spacing, nodata, window)
    return _grid_of_model(build_model(find_source(model, spacing=spacing, nodata=nodata, window=window), up=up))


def count_samples(model: str | os.PathLike[str], *, window: Window | None = None) -> int | None:
    """Return the number of samples of a grid file, or of a part of it, from its header alone; None for anything else.

    Parameters
    ----------
    model : path
        A ``.npy``, ``.asc``, ``.tif`` or ``.tiff`` file.
    window : (column, row, columns, rows), optional
        The part.
    """
    path = Path(model)
    suffix = path.suffix.lower()
    if suffix not in (".npy", ".asc", *RASTER_SUFFIXES) or not path.is_file():
        return None
    if window is not None:
        return int(window[2]) * int(window[3])
    if suffix == ".npy":
        return int(_map_array(path).size)
    if suffix in RASTER_SUFFIXES:
        from meshsimp_pymoo.formats.geotiff import count_raster_samples

        return count_raster_samples(path, str(path))
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES).decode("utf-8", errors="replace").lower()
    sizes = [re.search(rf"^[ \t]*{key}[ \t]+(\d+)", header, re.MULTILINE) for key in ("nrows", "ncols")]
    return int(sizes[0][1]) * int(sizes[1][1]) if sizes[0] and sizes[1] else None


def _map_array(path: Path) -> npt.NDArray[Any]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about the header's spelling
            heights = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as problem:  # its header is Python text: anything may break
        reason = str(problem).strip().splitlines()
        raise ModelError(
            f"{path}: is not a whole NumPy array file ({reason[0] if reason else type(problem).__name__}); "
            "save or copy it again"
        ) from None
    if not isinstance(heights, np.ndarray):
        raise ModelError(f"{path}: holds several arrays; save the heights alone with numpy.save")
    return heights


def _grid_of_array(
    heights: npt.NDArray[Any],
    name: str,
    spacing: float | tuple[float, float] | None,
    nodata: float | None,
    window: Window | None = None,
) -> HeightGrid:
    if isinstance(heights, np.ma.MaskedArray):
        if np.ma.getmaskarray(heights).any():
            raise NoFullGrid(f"{name}: has masked samples; only a grid without gaps can be cut into tiles")
        heights = heights.data
    if heights.dtype.kind not in "iuf":
        raise ModelError(f"{name}: heights have the type {heights.dtype}; give real numbers")
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ModelError(f"{name}: heights have the shape {heights.shape}; give a grid of at least 2 x 2")
    dx, dy = _steps(name, spacing) or (1.0, 1.0)
    for label, step in (("dx", dx), ("dy", dy)):
        if not (np.isfinite(step) and step > 0):
            raise ModelError(f"{name}: the spacing {label} is {step}; give a positive number")
    column, row, columns, rows = check_window(window, heights.shape, name)
    return HeightGrid(
        name,
        heights[row : row + rows, column : column + columns],
        np.arange(column, column + columns, dtype=np.float64) * dx,
        0.0 - np.arange(row, row + rows, dtype=np.float64) * dy,
        nodata=nodata,
        corner=(row, column),
        file_columns=heights.shape[1],
    )


def _grid_of_raster(
    path: Path, spacing: float | tuple[float, float] | None, nodata: float | None, window: Window | None
) -> HeightGrid:
    from meshsimp_pymoo.formats.geotiff import RasterHeights

    heights = RasterHeights(path, str(path), _steps(str(path), spacing), nodata, window)
    return HeightGrid(
        str(path),
        heights,
        heights.x,
        heights.y,
        corner=heights.corner,
        file_columns=heights.file_columns,
        georeference=heights.georeference,
    )


def _steps(name: str, spacing: float | tuple[float, float] | None) -> tuple[float, float] | None:
    """Return the distances of columns and rows."""
    if spacing is None:
        return None
    try:
        dx, dy = np.broadcast_to(np.asarray(spacing, np.float64), 2).tolist()
    except ValueError:
        raise ModelError(f"{name}: the spacing is {spacing!r}; give one number or (dx, dy)") from None
    return dx, dy


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
