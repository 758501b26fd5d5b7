"""Height grids: two triangles per cell, or heights that are read by windows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray
from meshsimp_pymoo.errors import ModelError, NoHeightGrid
from meshsimp_pymoo.formats.options import Options, Window
from meshsimp_pymoo.formats.source import RasterPart, SourceMesh, build_source
from meshsimp_pymoo.formats.source.missing import is_nodata, warn_of_nodata
from meshsimp_pymoo.memory import check_free
from meshsimp_pymoo.reprs import brief

# What a sample takes while a mesh is made of it: measured, rounded down.
MESH_SAMPLE_BYTES = 300
# By which share of it the spacing of an even grid may differ, as coordinates are rounded.
EVEN = 1e-3


@brief
@dataclass(frozen=True, eq=False)
class Grid:
    """A whole height grid in memory, and where its rows and columns lie.

    Attributes
    ----------
    heights : (R, C) array, masked array or memory map of a real type
        [file units].
    x : (C,) float array
        Where the columns are, ascending or descending, evenly or not [file units].
    y : (R,) float array
        Where the rows are, likewise [file units].
    nodata : float, optional
        Height that marks missing samples, beside NaN and masked ones.
    georeference : dict
        See :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    """

    heights: AnyArray
    x: FloatArray
    y: FloatArray
    nodata: float | None = None
    georeference: dict[str, Any] = field(default_factory=dict)

    def mesh(self, name: str, window: Window | None = None) -> SourceMesh:
        """Make a mesh of the grid, or of a part of it; see :func:`grid_source`."""
        column, row, columns, rows = check_window(window, self.shape, name)
        part = np.s_[row : row + rows, column : column + columns]
        return grid_mesh(
            np.asarray(np.ma.getdata(self.heights))[part],
            np.ma.getmaskarray(self.heights)[part],
            lambda i, j: (self.x[j], self.y[i]),
            nodata=self.nodata,
            name=name,
            corner=(row, column),
            file_columns=self.shape[1],
            mirrored=bool((self.x[1] > self.x[0]) == (self.y[1] > self.y[0])),
            georeference=self.georeference,
        )

    def placed(self, name: str, window: Window | None = None) -> PlacedHeights:
        """Return the grid, or a part of it, for work by tiles, without looking at its heights.

        Raises
        ------
        NoHeightGrid
            If its rows do not run from north to south and its columns from west to east, each at a place of its own.
        """
        if not ((np.diff(self.x) > 0).all() and (np.diff(self.y) < 0).all()):
            raise NoHeightGrid(
                f"{name}: its rows do not run to the south and its columns to the east, as tiles want them; turn it, "
                "with its axes (numpy.flipud, numpy.fliplr), or leave the tiles out (--tile none)"
            )
        column, row, columns, rows = check_window(window, self.shape, name)
        heights = self.heights[row : row + rows, column : column + columns]
        if np.ma.getmask(heights).any():
            heights = np.ma.filled(heights.astype(np.float64), np.nan)
        return PlacedHeights(
            np.ma.getdata(heights),
            self.x[column : column + columns],
            self.y[row : row + rows],
            self.nodata,
            (row, column),
            self.shape[1],
            self.georeference,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.heights.shape[0], self.heights.shape[1]


def even_grid(
    heights: npt.ArrayLike,
    dx: float = 1.0,
    dy: float = 1.0,
    *,
    nodata: float | None = None,
    name: str = "grid",
    origin: tuple[float, float] = (0.0, 0.0),
    georeference: dict[str, Any] | None = None,
) -> Grid:
    """Place heights whose rows run from north to south, columns and rows as far apart as said; see :func:`grid_source`.

    Raises
    ------
    ModelError
        For anything but a grid of at least 2 x 2 real numbers with a positive spacing.
    """
    array = np.asanyarray(heights)
    check_heights(array.shape, array.dtype, name)
    for label, step in (("dx", dx), ("dy", dy)):
        if not (np.isfinite(step) and step > 0):
            raise ModelError(f"{name}: the spacing {label} is {step}; give a positive number")
    rows, columns = array.shape
    x: FloatArray = origin[0] + np.arange(columns, dtype=np.float64) * dx
    y: FloatArray = origin[1] - np.arange(rows, dtype=np.float64) * dy
    return Grid(array, x, y, nodata, georeference or {})


def check_heights(shape: tuple[int, ...], kind: np.dtype[Any], name: str) -> None:
    """Refuse anything but a grid of at least 2 x 2 real numbers."""
    if kind.names:
        names = ", ".join(map(str, kind.names))
        raise ModelError(f"{name}: holds a table of {names[:200]}, not a grid; save its points as .ply or .xyz")
    if kind.kind not in "iuf":
        raise ModelError(f"{name}: heights have the type {kind}; give real numbers")
    if len(shape) != 2 or min(shape) < 2:
        raise ModelError(f"{name}: heights have the shape {shape}; give a grid of at least 2 x 2")


def check_room(
    shape: tuple[int, ...], sample_bytes: int, options: Options, name: str, *, by_windows: bool = False
) -> None:
    """Refuse a grid whose declared size does not fit into memory, before anything is allocated.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns that the file declares.
    sample_bytes : int
        What a sample of the file takes once it is read.
    options : Options
        The window.
    name : str
        What messages call it.
    by_windows : bool
        Whether it is to be cut into tiles, instead of being made one mesh.
    """
    _, _, columns, rows = check_window(options.window, (shape[0], shape[1]), name)
    needed = shape[0] * shape[1] * sample_bytes + (0 if by_windows else columns * rows * MESH_SAMPLE_BYTES)
    check_free(
        needed,
        f"{name}: {shape[1]} x {shape[0]} samples",
        "take a part of it (--window)" + ("" if by_windows else ", or tiles (--tile)"),
    )


def grid_source(
    elevation: npt.ArrayLike,
    dx: float = 1.0,
    dy: float = 1.0,
    *,
    nodata: float | None = None,
    name: str = "grid",
    origin: tuple[float, float] = (0.0, 0.0),
) -> SourceMesh:
    """Turn a height grid into a triangle mesh, two counter-clockwise triangles per cell.

    Row 0 is the northernmost, as in ESRI grids and GeoTIFF: sample (row, col) lies at ``x = origin[0] + col *
    dx`` (east), ``y = origin[1] - row * dy`` (north is +y), ``z = elevation[row, col]``. A cell is cut from
    its north-west to its south-east corner; where just one of the four corners has no data, the other three
    make one triangle.

    Parameters
    ----------
    elevation : (rows, columns) array of a real type
        Heights; NaN (or masked) where there is no data.
    dx, dy : float
        Distance between columns and between rows, > 0.
    nodata : float, optional
        Height that also marks missing samples.
    name : str
        What messages call it.
    origin : (float, float)
        Position of sample (0, 0).

    Returns
    -------
    SourceMesh
        Samples without data are no vertices; ``rows`` holds ``row * columns + col`` of the others.

    Raises
    ------
    ModelError
        For anything but a grid of at least 2 x 2 finite heights with a positive spacing.

    Examples
    --------
    A full cell is two triangles, one that lacks a corner is one:

    >>> grid_source([[0.0, 1.0, 4.0], [2.0, 3.0, float("nan")]]).faces.tolist()
    [[0, 3, 4], [0, 4, 1], [1, 4, 2]]
    """
    return even_grid(elevation, dx, dy, nodata=nodata, name=name, origin=origin).mesh(name)


def check_window(window: Window | None, shape: tuple[int, int], name: str) -> tuple[int, int, int, int]:
    """Return (column, row, columns, rows) of the part of a grid of this shape to take; None: all of it."""
    if window is None:
        return 0, 0, shape[1], shape[0]
    column, row, columns, rows = (int(value) for value in window)
    if min(column, row) < 0 or min(columns, rows) < 2 or column + columns > shape[1] or row + rows > shape[0]:
        raise ModelError(
            f"{name}: the window {column},{row},{columns},{rows} (column, row, columns, rows) does not lie within its "
            f"{shape[1]} columns and {shape[0]} rows, or is smaller than 2 x 2"
        )
    return column, row, columns, rows


def grid_mesh(
    height: AnyArray,
    hidden: BoolArray,
    place: Callable[[Any, Any], tuple[Any, Any]],
    *,
    nodata: float | None,
    name: str,
    corner: tuple[int, int],
    file_columns: int,
    mirrored: bool = False,
    georeference: dict[str, Any] | None = None,
) -> SourceMesh:
    """Turn a checked part of a height grid into a triangle mesh; see :func:`grid_source`.

    Parameters
    ----------
    height : (rows, columns) real array
        The part's heights.
    hidden : (rows, columns) bool array
        Samples known to be missing, beside NaN and ``nodata``.
    place : callable
        Position (x, y) of the samples in these rows and columns of the whole grid.
    nodata, name
        As there.
    corner : (int, int)
        Row and column of the part in the whole grid.
    file_columns : int
        Columns of the whole grid.
    mirrored : bool
        Rows run north, or columns west: then triangles are listed the other way round.
    georeference : dict, optional
        See :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    """
    if nodata is not None:
        hidden = hidden | is_nodata(height, nodata)
    hidden = hidden | np.isnan(height)
    with np.errstate(invalid="ignore"):  # some kinds of NaN complain
        z = height.astype(np.float64)
    if (infinite := np.isinf(z) & ~hidden).any():
        row, col = np.argwhere(infinite)[0]
        raise ModelError(
            f"{name}: {infinite.sum()} of {z.size} heights are infinite (first: row {corner[0] + row}, column "
            f"{corner[1] + col}); set them to NaN or name the value with nodata"
        )
    warn_of_nodata(z[~hidden], name)
    rows = np.flatnonzero(~hidden)
    vertex = np.full(z.shape, -1, np.int64)
    vertex.flat[rows] = np.arange(len(rows))
    nw, ne, sw, se = vertex[:-1, :-1], vertex[:-1, 1:], vertex[1:, :-1], vertex[1:, 1:]
    triangles = np.empty((*nw.shape, 2, 3), np.int64)
    triangles[:, :, 0] = np.stack([nw, sw, se], axis=-1)
    triangles[:, :, 1] = np.stack([nw, se, ne], axis=-1)
    triangles[:, :, 0][nw < 0] = np.stack([sw, se, ne], axis=-1)[nw < 0]
    triangles[:, :, 1][se < 0] = np.stack([nw, sw, ne], axis=-1)[se < 0]
    faces = triangles.reshape(-1, 3)
    faces = faces[(faces >= 0).all(axis=1)]
    if mirrored:
        faces = faces[:, ::-1]
    i, j = (start + at for start, at in zip(corner, np.divmod(rows, z.shape[1]), strict=True))
    east, north = place(i, j)
    points = np.column_stack([east, north, z.flat[rows]])
    if len(faces) == 0:
        raise ModelError(
            f"{name}: only {len(rows)} of {z.size} samples have data and no cell has three; check nodata ({nodata})"
        )
    numbers = i * file_columns + j
    source = build_source(
        points, faces, {}, name, rows=numbers, up="z", georeference=georeference, sort="grid", repeats="none"
    )
    (n_rows, n_columns), (row, column) = z.shape, corner
    across = _spacing(*place(np.full(n_columns, row), column + np.arange(n_columns)))
    down = _spacing(*place(row + np.arange(n_rows), np.full(n_rows, column)))
    part = RasterPart(n_rows, n_columns, row, column, file_columns)
    return replace(source, grid=(n_columns, n_rows, across, down), raster=part)


def _spacing(x: FloatArray, y: FloatArray) -> float:
    """Return how far the samples of a line are apart; NaN where that differs by more than rounding."""
    steps = np.hypot(np.diff(x), np.diff(y))
    return float(steps.mean()) if np.ptp(steps) <= EVEN * steps.mean() else float("nan")


# ---------------------------------------------------------------------------------------------------------- by windows


class Heights(Protocol):
    """An array of two dimensions, or what is read like one: by slices, or by arrays of rows and columns."""

    @property
    def shape(self) -> Any:
        """Rows and columns."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the heights."""

    def __getitem__(self, key: Any) -> Any: ...


@brief
@dataclass(frozen=True, eq=False)
class PlacedHeights:
    """A part of a height grid that is read by windows, and where it lies.

    Attributes
    ----------
    heights : (R, C) array, memory map or what is read like one
        Row 0 is the northernmost [file units].
    x : (C,) float array
        Where the columns are, ascending [file units].
    y : (R,) float array
        Where the rows are, descending [file units].
    nodata : float, optional
        Height that means "no sample".
    corner : (int, int)
        Row and column of the first sample in the file.
    file_columns : int
        Columns of the file.
    georeference : dict
        See :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    """

    heights: Heights
    x: FloatArray
    y: FloatArray
    nodata: float | None
    corner: tuple[int, int]
    file_columns: int
    georeference: dict[str, Any] = field(default_factory=dict)


def placed_heights(heights: AnyArray, name: str, options: Options) -> PlacedHeights:
    """Place an array or a memory map as :func:`grid_source` does, without looking at its heights.

    Raises
    ------
    ModelError
        For anything but a grid of at least 2 x 2 real numbers with a positive spacing.
    """
    return even_grid(heights, *(options.steps or ()), nodata=options.nodata, name=name).placed(name, options.window)
