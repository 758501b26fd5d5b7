"""The residuals of a mesh as a raster: original minus mesh at every sample, where the sample is in its file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, NoHeightGrid
from meshsimp_pymoo.formats.geotiff import write_raster
from meshsimp_pymoo.formats.source import RasterPart
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.accuracy import Compared
from meshsimp_pymoo.surface.grid import HeightGrid
from meshsimp_pymoo.surface.measures import LENGTH
from meshsimp_pymoo.surface.units import length_unit

TITLE = "residuals: original minus mesh"
# Vertices whose place is compared with what a transform says of it, and by what share of a pixel they may be beside it.
CHECKED, BESIDE = 1000, 1e-2


@brief
@dataclass(frozen=True, eq=False)
class Raster:
    """Where the samples of a model are in a raster.

    Attributes
    ----------
    shape : (int, int)
        Its rows and columns.
    transform : (6,) floats
        a, b, c, d, e, f: the corner of pixel (column, row) is (a column + b row + c, d column + e row + f) in the
        coordinates of the file.
    number : callable
        Of vertices (n,) of the model returns ``row * columns + column`` of each, and -1 of one that is no sample.
    """

    shape: tuple[int, int]
    transform: tuple[float, ...]
    number: Callable[[IntArray], IntArray]


def raster_of(model: Any) -> Raster:
    """Return the raster that a model was read from: the part of it that was taken.

    Raises
    ------
    NoHeightGrid
        If it is none.
    ModelError
        If its rows or columns are not evenly spaced, so that no transform says where they are.
    """
    if isinstance(model, HeightGrid) and model.model is None:
        part: Any = RasterPart(*model.shape, *model.corner, model.file_columns or model.shape[1])
    else:
        part = getattr(model.model if isinstance(model, HeightGrid) else model, "raster", None)
    if part is None:
        raise NoHeightGrid(f"{model.name}: is no raster of heights, so there is none of its residuals")

    lines = getattr(model, "lines", None)
    added = np.empty(0, np.int64) if lines is None else lines.added

    def number(vertices: IntArray) -> IntArray:
        row, column = np.divmod(np.asarray(model.source_index[vertices]), part.file_columns)
        row, column = row - part.row, column - part.column
        inside = ~np.isin(vertices, added) & (row >= 0) & (row < part.rows) & (column >= 0) & (column < part.columns)
        return np.where(inside, row * part.columns + column, -1)

    some = np.unique(np.linspace(0, model.n_vertices - 1, CHECKED).astype(np.int64))
    at = number(some)
    row, column = np.divmod(at[at >= 0], part.columns)
    places = np.asarray(model.file_points[some[at >= 0]])[:, :2]
    facts = model.georeference
    if "transform" in facts:
        a, b, c, d, e, f = map(float, facts["transform"])
        left, top = part.column, part.row
        stated = (a, b, c + a * left + b * top, d, e, f + d * left + e * top)
        if _fits(stated, row, column, places):  # not where another spacing was given
            return Raster((part.rows, part.columns), stated, number)
    dx, dy = _step(column, places[:, 0]), _step(row, places[:, 1])
    x, y = (places[0] - [dx * (column[0] + 0.5), dy * (row[0] + 0.5)]).tolist()
    found = (dx, 0.0, x, 0.0, dy, y)
    if not _fits(found, row, column, places):
        raise ModelError(
            f"{model.name}: its rows or columns are not evenly spaced, so no raster holds its residuals where they are"
        )
    return Raster((part.rows, part.columns), found, number)


def _step(number: IntArray, places: FloatArray) -> float:
    """Return how far rows or columns are apart, by the first and the last of some."""
    low, high = int(np.argmin(number)), int(np.argmax(number))
    return float((places[high] - places[low]) / max(number[high] - number[low], 1))


def _fits(transform: tuple[float, ...], row: IntArray, column: IntArray, places: FloatArray) -> bool:
    """Tell whether a transform says where the middles of pixels are."""
    a, b, c, d, e, f = transform
    said = np.column_stack([a * (column + 0.5) + b * (row + 0.5) + c, d * (column + 0.5) + e * (row + 0.5) + f])
    return bool(np.abs(said - places).max(initial=0.0) <= BESIDE * min(math.hypot(a, d), math.hypot(b, e)))


def residual_rows(compared: Compared, raster: Raster) -> Iterator[tuple[int, FloatArray]]:
    """Yield first row and residuals of some rows (r, columns), from the north, all of them: NaN where there is none.

    That is where the raster has no sample, and where no triangle covers it.
    """
    columns, done = raster.shape[1], 0
    for part in compared.parts():
        number = raster.number(part.vertices)
        shown: BoolArray = part.covered & (number >= 0)
        number, values = number[shown], part.values[shown]
        if not len(number):
            continue
        end = int(number.max()) // columns + 1
        band = np.full((end - done, columns), np.nan)
        band.ravel()[number - done * columns] = values
        yield done, band
        done = end
    if done < raster.shape[0]:
        yield done, np.full((raster.shape[0] - done, columns), np.nan)


def write_residuals(path: Path, compared: Compared) -> None:
    """Write the residuals of a mesh as a GeoTIFF, in the raster that its original was read from.

    Raises
    ------
    NoHeightGrid
        If the original is no raster.
    ModelError
        If its rows or columns are not even, or rasterio is not installed or cannot write it.
    """
    model = compared.surface.model
    raster, facts = raster_of(model), model.georeference
    unit = length_unit(facts)
    crs = facts.get("crs") or (f"EPSG:{facts['epsg']}" if facts.get("epsg") else None)
    write_raster(
        path,
        residual_rows(compared, raster),
        shape=raster.shape,
        transform=raster.transform,
        crs=crs,
        unit="" if unit == LENGTH else unit,
        title=f"{TITLE} [{unit}], positive where the original is above the mesh",
        tags={"ORIGINAL_SHA256": model.hash, "TRIANGLES": str(compared.quality.triangles)},
        name=str(path),
    )
