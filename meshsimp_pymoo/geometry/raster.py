"""Heights out of a GeoTIFF, in the raster's own coordinates; needs rasterio (the extra ``geo``).

GDAL can open a great many things under one name, other files and addresses in a network among them. Here it may open
a TIFF and nothing else, and what the TIFF declares is compared with its size before anything is allocated.
"""

from __future__ import annotations

import logging
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.geometry.load import (
    DEFLATE_LIMIT,
    UNPACKED_LIMIT,
    ModelError,
    ModelWarning,
    SourceMesh,
    Window,
    _reason,
    _warn,
    check_window,
    grid_mesh,
)

__all__ = ["read_raster"]

# rasterio logs what GDAL says; without a handler Python would print that to stderr.
logging.getLogger("rasterio").addHandler(logging.NullHandler())

# What a small file may unpack to, whatever its packing: some packings shrink a constant raster to nearly nothing.
UNPACKED_FLOOR = 64 << 20
# Files beside the raster that GDAL knows by name (.tfw, .aux.xml) are used, but their folder is not listed.
GDAL_SETTINGS = {"GDAL_DISABLE_READDIR_ON_OPEN": "TRUE", "CPL_LOG_ERRORS": "OFF"}


def read_raster(
    path: Path,
    name: str,
    steps: tuple[float, float] | None,
    nodata: float | None,
    window: Window | None,
) -> SourceMesh:
    """Read the one band of a GeoTIFF as a triangle mesh.

    A sample lies at the middle of its pixel, at the place that the raster's transform says; rotated and mirrored
    rasters are read as they lie. Only the window is read. A scale and an offset of the band are applied, and samples
    without data (the declared value, or a mask in the file) are no vertices.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What messages call it.
    steps : (dx, dy), optional
        Distance between columns and rows in place of the transform's; the raster's north-west corner stays.
    nodata : float, optional
        Height that marks missing samples in place of what the file says, before scale and offset.
    window : (column, row, columns, rows), optional
        The part to take.

    Returns
    -------
    SourceMesh
        ``georeference`` holds ``crs`` (WKT), ``epsg``, ``unit``, ``transform`` (a, b, c, d, e, f: the corner of pixel
        (column, row) is (a column + b row + c, d column + e row + f)), ``size`` (columns, rows), ``window`` and
        ``nodata``.

    Raises
    ------
    ModelError
        If rasterio is not installed, or the file is no GeoTIFF of one band of real numbers.

    Warns
    -----
    ModelWarning
        If its coordinates are degrees.
    """
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning
    except ImportError:
        raise ModelError(f"{name}: GeoTIFF needs rasterio; install it by pip install 'meshsimp-pymoo[geo]'") from None
    import warnings

    try:
        with warnings.catch_warnings(), rasterio.Env(**GDAL_SETTINGS):
            for kind in (NotGeoreferencedWarning, DeprecationWarning, PendingDeprecationWarning):
                warnings.simplefilter("ignore", kind)
            with rasterio.open(str(path.resolve()), driver="GTiff") as raster:
                return _band_mesh(raster, path.stat().st_size, name, steps, nodata, window)
    except (ModelError, ModelWarning, MemoryError):
        raise
    except Exception as error:  # GDAL's own errors, and what its answers break in a damaged file
        raise ModelError(f"{name}: cannot be read as a GeoTIFF ({_reason(error)}); export it again") from error


def _band_mesh(
    raster: Any,
    file_size: int,
    name: str,
    steps: tuple[float, float] | None,
    nodata: float | None,
    window: Window | None,
) -> SourceMesh:
    from rasterio.enums import MaskFlags
    from rasterio.windows import Window as Part

    if raster.count != 1:
        raise ModelError(
            f"{name}: has {raster.count} bands; heights are one band: take it out (gdal_translate -b 1, say)"
        )
    kind = np.dtype(raster.dtypes[0])
    if kind.kind not in "iuf":
        raise ModelError(f"{name}: heights have the type {kind}; give real numbers")
    shape = (raster.height, raster.width)
    column, row, columns, rows = check_window(window, shape, name)
    _check_size(raster, kind, (columns, rows), file_size, name)
    place, mirrored = _placement(raster, steps, name)
    part = Part(column, row, columns, rows)
    height = raster.read(1, window=part)
    flags = raster.mask_flag_enums[0]
    hidden = np.zeros(height.shape, bool)
    if MaskFlags.all_valid not in flags and MaskFlags.nodata not in flags:
        hidden = raster.read_masks(1, window=part) == 0
    declared = raster.nodata
    missing = declared if nodata is None else nodata
    if missing is not None and math.isnan(missing):
        missing = None  # NaN is missing anyway
    scale, offset = float(raster.scales[0]), float(raster.offsets[0])
    if (scale, offset) != (1.0, 0.0):
        if missing is not None:
            hidden |= height == (kind.type(missing) if kind.kind == "f" else missing)
            missing = None
        height = height * scale + offset
    return grid_mesh(
        height,
        hidden,
        place,
        nodata=missing,
        name=name,
        corner=(row, column),
        file_columns=shape[1],
        mirrored=mirrored,
        georeference=_georeference(raster, name) | {"window": [column, row, columns, rows]},
    )


def _check_size(raster: Any, kind: np.dtype[Any], part: tuple[int, int], file_size: int, name: str) -> None:
    """Refuse what no file of this size can hold, before anything is allocated."""
    most = min(max(UNPACKED_FLOOR, DEFLATE_LIMIT * file_size), UNPACKED_LIMIT)
    blocks = [(raster.width, raster.height)] if raster.compression is None else []
    # a strip or tile is unpacked whole, however small the window is
    for columns, rows in (part, *((width, height) for height, width in raster.block_shapes), *blocks):
        needed = columns * rows * kind.itemsize
        if needed > most:
            raise ModelError(
                f"{name}: declares {raster.width} x {raster.height} samples, of which {columns} x {rows} in one piece "
                f"({needed} bytes), in a file of {file_size} bytes; export it again, or take a part of it with --window"
            )


def _placement(raster: Any, steps: tuple[float, float] | None, name: str) -> tuple[Any, bool]:
    """Return where rows and columns lie, and whether the raster is mirrored."""
    a, b, c, d, e, f = tuple(raster.transform)[:6]
    if raster.transform.is_identity:
        if raster.gcps[0]:
            raise ModelError(f"{name}: is placed by ground control points alone; rectify it (gdalwarp) first")
        a, b, c, d, e, f = 1.0, 0.0, -0.5, 0.0, -1.0, 0.5  # as any other grid: north at the top, from 0, 1 apart
    if not all(map(math.isfinite, (a, b, c, d, e, f))) or a * e - b * d == 0:
        raise ModelError(f"{name}: its transform {(a, b, c, d, e, f)} is none; export it again")
    if steps is not None:
        if (b, d) != (0, 0) or a <= 0 or e >= 0:
            raise ModelError(f"{name}: its transform turns or mirrors it, so one spacing cannot say it; leave it out")
        if not all(math.isfinite(step) and step > 0 for step in steps):
            raise ModelError(f"{name}: the spacing is {steps}; give positive numbers")
        a, e = steps[0], -steps[1]

    def place(row: npt.NDArray[np.int64], column: npt.NDArray[np.int64]) -> tuple[Any, Any]:
        i, j = row + 0.5, column + 0.5
        return c + (a * j + b * i), f + (d * j + e * i)

    return place, a * e - b * d > 0


def _georeference(raster: Any, name: str) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "transform": [float(value) for value in tuple(raster.transform)[:6]],
        "size": [raster.width, raster.height],
        "nodata": None if raster.nodata is None else repr(float(raster.nodata)),
    }
    crs = raster.crs
    if crs:
        facts |= {"crs": crs.to_wkt(), "epsg": crs.to_epsg()}
        facts["unit"] = crs.linear_units if crs.is_projected else "degree"
        if crs.is_geographic:
            _warn(
                f"{name}: its coordinates are degrees, its heights are not; triangles are shaped in degrees: for "
                "shapes in metres project it first (gdalwarp -t_srs)"
            )
    return facts
