"""Height grids: two triangles per cell, or heights that are read by windows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray
from meshsimp_pymoo.errors import ModelError, NoFullGrid
from meshsimp_pymoo.formats.options import Options, Window
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.missing import is_nodata, warn_of_nodata


def grid_source(
    elevation: npt.ArrayLike,
    dx: float = 1.0,
    dy: float = 1.0,
    *,
    nodata: float | None = None,
    name: str = "grid",
    origin: tuple[float, float] = (0.0, 0.0),
    window: Window | None = None,
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
    window : (column, row, columns, rows), optional
        The part to take; positions and ``rows`` stay those of the whole grid.

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
    if isinstance(elevation, np.ma.MaskedArray):
        hidden = np.ma.getmaskarray(elevation)
        height = np.asarray(elevation.data)
    else:
        height = np.asarray(elevation)
        hidden = np.zeros(height.shape, bool)
    _check_heights(height, name)
    _check_steps(dx, dy, name)
    column, row, columns, rows = check_window(window, height.shape, name)
    part = np.s_[row : row + rows, column : column + columns]
    return grid_mesh(
        height[part],
        hidden[part],
        lambda i, j: (origin[0] + j * dx, origin[1] - i * dy),
        nodata=nodata,
        name=name,
        corner=(row, column),
        file_columns=height.shape[1],
    )


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
    return build_source(
        points, faces, {}, name, rows=numbers, up="z", georeference=georeference, sort="grid", repeats="none"
    )


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
        For anything but a grid of at least 2 x 2 real numbers with a positive spacing, and none of them masked.
    """
    if isinstance(heights, np.ma.MaskedArray):
        if np.ma.getmaskarray(heights).any():
            raise NoFullGrid(f"{name}: has masked samples; only a grid without gaps can be cut into tiles")
        heights = heights.data
    _check_heights(heights, name)
    dx, dy = options.steps or (1.0, 1.0)
    _check_steps(dx, dy, name)
    column, row, columns, rows = check_window(options.window, (heights.shape[0], heights.shape[1]), name)
    return PlacedHeights(
        heights[row : row + rows, column : column + columns],
        np.arange(column, column + columns, dtype=np.float64) * dx,
        0.0 - np.arange(row, row + rows, dtype=np.float64) * dy,
        options.nodata,
        (row, column),
        heights.shape[1],
    )


# -------------------------------------------------------------------------------------------------------------- checks


def _check_heights(heights: AnyArray, name: str) -> None:
    if heights.dtype.kind not in "iuf":
        raise ModelError(f"{name}: heights have the type {heights.dtype}; give real numbers")
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ModelError(f"{name}: heights have the shape {heights.shape}; give a grid of at least 2 x 2")


def _check_steps(dx: float, dy: float, name: str) -> None:
    for label, step in (("dx", dx), ("dy", dy)):
        if not (np.isfinite(step) and step > 0):
            raise ModelError(f"{name}: the spacing {label} is {step}; give a positive number")
