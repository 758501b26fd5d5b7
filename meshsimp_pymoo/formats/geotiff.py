"""Heights out of a GeoTIFF, in the raster's own coordinates; needs rasterio (the extra ``geo``).

GDAL can open a great many things under one name, other files and addresses in a network among them. Here it may open
a TIFF and nothing else, and what the TIFF declares is compared with its size before anything is allocated.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import (
    LONGEST_REASON,
    ModelError,
    ModelWarning,
    NoHeightGrid,
    printable,
    raise_if_memory,
    reason_of,
)
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, guarded, register

if TYPE_CHECKING:
    import numpy as np

    from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray, IntArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import PlacedHeights

# What a small file may unpack to, whatever its packing: some packings shrink a constant raster to nearly nothing.
UNPACKED_FLOOR = 64 << 20
# Files beside the raster that GDAL knows by name (.tfw, .aux.xml) are used, but their folder is not listed.
GDAL_SETTINGS = {"GDAL_DISABLE_READDIR_ON_OPEN": "TRUE", "CPL_LOG_ERRORS": "OFF"}
# Megabytes of unpacked blocks that GDAL may keep while a raster is read by windows.
CACHE_MEGABYTES = 128
# Samples that scattered heights are read from together: some tens of megabytes.
BAND_SAMPLES = 2_000_000


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    """Read one band of a GeoTIFF as a triangle mesh.

    A sample lies at the middle of its pixel, at the place that the raster's transform says; rotated and mirrored
    rasters are read as they lie. Only the window is read. A scale and an offset of the band are applied, and samples
    without data (the declared value, or a mask in the file) are no vertices.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What messages call it.
    options : Options
        ``spacing`` is the distance between columns and rows in place of the transform's; the raster's north-west corner
        stays. ``nodata`` marks missing samples in place of what the file says, before scale and offset. ``window`` is
        the part to take, ``band`` the band; without, there must be only one beside those of transparency.

    Returns
    -------
    SourceMesh
        ``georeference`` holds ``crs`` (WKT), ``epsg``, ``unit``, ``transform`` (a, b, c, d, e, f: the corner of pixel
        (column, row) is (a column + b row + c, d column + e row + f)), ``size`` (columns, rows), ``window`` and
        ``nodata``.

    Raises
    ------
    ModelError
        If rasterio is not installed, the file is no GeoTIFF of real numbers, or it has several bands and it is not said
        which.
    """
    from meshsimp_pymoo.formats.source.heights import check_room, check_window, grid_mesh

    steps = options.steps
    with _opened(path, name) as raster:
        band, kind, shape = _checked_band(raster, options.band, name)
        column, row, columns, rows = check_window(options.window, shape, name)
        _check_size(raster, kind, (columns, rows), path.stat().st_size, name)
        check_room(shape, 0, options, name)
        place, mirrored = _placement(raster, steps, name)
        height, hidden, missing = _read_part(raster, band, (column, row, columns, rows), options.nodata)
        return grid_mesh(
            height,
            hidden,
            place,
            nodata=missing,
            name=name,
            corner=(row, column),
            file_columns=shape[1],
            mirrored=mirrored,
            georeference=_georeference(raster, band) | {"window": [column, row, columns, rows]},
        )


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    from meshsimp_pymoo.formats.source.heights import PlacedHeights

    found = RasterHeights(path, name, options)
    return PlacedHeights(found, found.x, found.y, None, found.corner, found.file_columns, found.georeference)


def _count_samples(path: Path, name: str) -> int:
    with _opened(path, name) as raster:
        return int(raster.width) * int(raster.height)


class RasterHeights:
    """The heights of a GeoTIFF, read by windows as they are asked for.

    It is indexed as an array of two dimensions, by slices or by arrays of rows and columns; what comes back is double
    precision, scale and offset applied, NaN where there is no sample. Threads may share it.

    Parameters
    ----------
    path, name, options
        As a format's ``open_heights`` has them.

    Attributes
    ----------
    shape : (int, int)
        Rows and columns of the part.
    dtype : numpy dtype
        float64.
    x, y : (columns,), (rows,) float arrays
        Where the columns and rows lie, as in the mesh that is made of the raster [file units].
    corner : (int, int)
        Row and column of the part in the raster.
    file_columns : int
        Columns of the whole raster.
    georeference : dict
        As that of the mesh.

    Raises
    ------
    ModelError
        If rasterio is not installed, the file is no GeoTIFF of real numbers, it has several bands and it is not said
        which, or its rows do not run from north to south along the axes. Later, if a part of it cannot be read.
    """

    ndim = 2

    def __init__(self, path: Path, name: str, options: Options) -> None:
        import threading

        import numpy as np

        from meshsimp_pymoo.formats.source.heights import check_window

        self.dtype = np.dtype(np.float64)
        steps = options.steps
        self.path, self.name = path, name
        self._lock = threading.Lock()
        with _opened(path, name, keep=True) as raster:
            band, kind, shape = _checked_band(raster, options.band, name)
            column, row, columns, rows = check_window(options.window, shape, name)
            _check_size(raster, kind, (columns, rows), path.stat().st_size, name, by_windows=True)
            place, mirrored = _placement(raster, steps, name)
            a, b, _, d = tuple(raster.transform)[:4]
            if mirrored or (b, d) != (0, 0) or a < 0:
                raise NoHeightGrid(
                    f"{name}: its transform turns or mirrors it, and tiles want rows from north to south; warp it "
                    "(gdalwarp), or leave the tiles out (--tile none)"
                )
            self.shape = (rows, columns)
            self.corner = (row, column)
            self.file_columns = shape[1]
            i, j = row + np.arange(rows, dtype=np.int64), column + np.arange(columns, dtype=np.int64)
            self.x: FloatArray = np.asarray(place(np.int64(row), j)[0], np.float64)
            self.y: FloatArray = np.asarray(place(i, np.int64(column))[1], np.float64)
            self.georeference = _georeference(raster, band) | {"window": [column, row, columns, rows]}
            self._raster, self._band, self._nodata = raster, band, options.nodata

    def __getitem__(self, key: Any) -> FloatArray:
        import numpy as np

        rows, columns = key if isinstance(key, tuple) else (key, slice(None))
        if isinstance(rows, slice) and isinstance(columns, slice):
            top, bottom, _ = rows.indices(self.shape[0])
            left, right, _ = columns.indices(self.shape[1])
            return self._read(top, bottom, left, right)
        return self._scattered(np.asarray(rows), np.asarray(columns))

    def _read(self, top: int, bottom: int, left: int, right: int) -> FloatArray:
        from meshsimp_pymoo.formats.source.missing import is_nodata

        part = (self.corner[1] + left, self.corner[0] + top, right - left, bottom - top)
        with self._lock, _guarded(self.name), _environment():
            height, hidden, missing = _read_part(self._raster, self._band, part, self._nodata)
        values: FloatArray = height.astype(self.dtype)
        if missing is not None:
            hidden |= is_nodata(height, missing)
        values[hidden] = math.nan
        return values

    def _scattered(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Return the heights at samples in any order, band by band."""
        import numpy as np

        values = np.empty(rows.shape)
        step = max(1, BAND_SAMPLES // self.shape[1])
        order = np.argsort(rows, kind="stable")
        band = rows[order] // step
        for group in np.split(order, np.flatnonzero(np.diff(band)) + 1):
            if len(group) == 0:
                continue
            i, j = rows[group], columns[group]
            top, left = int(i.min()), int(j.min())
            part = self._read(top, int(i.max()) + 1, left, int(j.max()) + 1)
            values[group] = part[i - top, j - left]
        return values


def _environment() -> Any:
    import rasterio

    return rasterio.Env(**GDAL_SETTINGS, GDAL_CACHEMAX=CACHE_MEGABYTES)


@contextlib.contextmanager
def _guarded(name: str, done: str = "read as a GeoTIFF", way_out: str = "export it again") -> Iterator[None]:
    """Say in one line what GDAL and rasterio say, and ignore their warnings."""
    import logging

    import rasterio  # noqa: F401 - its parts may have been imported where it is missing now
    from rasterio.errors import NotGeoreferencedWarning

    logger = logging.getLogger("rasterio")
    if not logger.handlers:  # it logs what GDAL says; without a handler Python would print that to stderr
        logger.addHandler(logging.NullHandler())
    try:
        with warnings.catch_warnings():
            for kind in (NotGeoreferencedWarning, DeprecationWarning, PendingDeprecationWarning):
                warnings.simplefilter("ignore", kind)
            yield
    except (ModelError, ModelWarning, MemoryError):
        raise
    except Exception as error:  # GDAL's own errors, and what its answers break in a damaged file
        raise_if_memory(error)
        raise ModelError(f"{name}: cannot be {done} ({reason_of(error)}); {way_out}") from error


@contextlib.contextmanager
def _opened(path: Path, name: str, *, keep: bool = False) -> Iterator[Any]:
    """Open a TIFF, and nothing else; with ``keep`` it stays open after the block unless that fails."""
    with _guarded(name), _environment():
        import rasterio

        raster = rasterio.open(str(path.resolve()), driver="GTiff")
        try:
            yield raster
        except BaseException:
            raster.close()
            raise
        if not keep:
            raster.close()


def _checked_band(raster: Any, band: int | None, name: str) -> tuple[int, np.dtype[Any], tuple[int, int]]:
    """Return the number of the band of heights, its type, and its rows and columns."""
    import numpy as np

    if band is None:
        found = sorted({*range(1, raster.count + 1)} - {*_alpha_bands(raster)})
        if raster.count > 1 and len(found) != 1:
            raise ModelError(
                f"{name}: has {raster.count} bands, and heights are one; say which, such as --band 1"
                f"{_band_titles(raster)}"
            )
        band = found[0] if found else 1
    if band > raster.count:
        raise ModelError(f"{name}: has {raster.count} bands, and no band {band}; leave the band out, or name another")
    kind = str(raster.dtypes[band - 1])
    if kind.startswith("complex") or np.dtype(kind).kind not in "iuf":  # NumPy knows no complex integers
        raise ModelError(f"{name}: heights have the type {kind}; give real numbers")
    return band, np.dtype(kind), (raster.height, raster.width)


def _alpha_bands(raster: Any) -> list[int]:
    """Return the numbers of the bands that say where there is something, if there are any."""
    from rasterio.enums import ColorInterp

    return [number for number, meant in enumerate(raster.colorinterp, start=1) if meant == ColorInterp.alpha]


def _band_titles(raster: Any) -> str:
    """Return what a raster says of its bands, for a message."""
    said = [f"{number} is {title!r}" for number, title in enumerate(raster.descriptions, start=1) if title]
    return printable(f" ({', '.join(said)}"[:LONGEST_REASON] + ")") if said else ""


def _read_part(
    raster: Any, band: int, part: tuple[int, int, int, int], nodata: float | None
) -> tuple[AnyArray, BoolArray, float | None]:
    """Read (column, row, columns, rows): heights, which are hidden, and the height that means "no sample" besides."""
    import numpy as np
    from rasterio.enums import MaskFlags
    from rasterio.windows import Window as Part

    from meshsimp_pymoo.formats.source.missing import is_nodata

    window = Part(*part)
    height = raster.read(band, window=window)
    flags = raster.mask_flag_enums[band - 1]
    hidden = np.zeros(height.shape, bool)
    if MaskFlags.all_valid not in flags and MaskFlags.nodata not in flags:
        hidden = raster.read_masks(band, window=window) == 0
    for alpha in set(_alpha_bands(raster)) - {band}:  # which GDAL makes a mask of only if it is of bytes
        hidden |= raster.read(alpha, window=window) == 0
    missing = raster.nodatavals[band - 1] if nodata is None else nodata
    if missing is not None and math.isnan(missing):
        missing = None  # NaN is missing anyway
    scale, offset = float(raster.scales[band - 1]), float(raster.offsets[band - 1])
    if (scale, offset) != (1.0, 0.0):
        if missing is not None:
            hidden |= is_nodata(height, missing)
            missing = None
        height = height * scale + offset
    return height, hidden, missing


def _check_size(
    raster: Any,
    kind: np.dtype[Any],
    part: tuple[int, int],
    file_size: int,
    name: str,
    *,
    by_windows: bool = False,
) -> None:
    """Refuse what no file of this size can hold, before anything is allocated; read by windows it may be larger."""
    from rasterio.enums import Interleaving

    from meshsimp_pymoo.files import DEFLATE_LIMIT, UNPACKED_LIMIT

    credible = max(UNPACKED_FLOOR, DEFLATE_LIMIT * file_size)
    blocks = [(raster.width, raster.height)] if raster.compression is None else []
    # a strip or tile is unpacked whole, however small the window is, and with all bands if they lie sample by sample
    together = raster.count if raster.interleaving is Interleaving.pixel else 1
    whole = [(width * together, height) for height, width in raster.block_shapes]
    for columns, rows in (part, *whole, *blocks):
        needed = columns * rows * kind.itemsize
        if needed > (credible if by_windows and (columns, rows) not in whole else min(credible, UNPACKED_LIMIT)):
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
        a, e = steps[0], -steps[1]

    def place(row: IntArray, column: IntArray) -> tuple[Any, Any]:
        i, j = row + 0.5, column + 0.5
        return c + (a * j + b * i), f + (d * j + e * i)

    return place, a * e - b * d > 0


def _georeference(raster: Any, band: int) -> dict[str, Any]:
    nodata = raster.nodatavals[band - 1]
    facts: dict[str, Any] = {
        "transform": [float(value) for value in tuple(raster.transform)[:6]],
        "size": [raster.width, raster.height],
        "nodata": None if nodata is None else repr(float(nodata)),
    }
    crs = raster.crs
    if crs:
        facts |= {"crs": crs.to_wkt(), "epsg": crs.to_epsg()}
        if crs.is_projected or crs.is_geographic:
            facts["unit"] = crs.linear_units if crs.is_projected else "degree"
    return facts


def write_raster(
    path: Path,
    bands: Iterable[tuple[int, FloatArray]],
    *,
    shape: tuple[int, int],
    transform: tuple[float, ...],
    crs: str | None,
    unit: str,
    title: str,
    tags: Mapping[str, str],
    name: str,
) -> None:
    """Write one band of single precision, NaN where there is nothing, as a GeoTIFF.

    Parameters
    ----------
    path : Path
        The file to write.
    bands : iterable of (int, (r, columns) array)
        First row and values of some rows, from the north; together all of them.
    shape : (int, int)
        Rows and columns.
    transform : (6,) floats
        As in `_read`.
    crs : str, optional
        The reference system, as WKT or by its number: ``"EPSG:25832"``.
    unit : str
        Unit of the values; empty where it is not known.
    title : str
        What they are.
    tags : mapping of str to str
        What else the file says of itself.
    name : str
        What messages call it.

    Raises
    ------
    ModelError
        If rasterio is not installed, or the file cannot be written.
    """
    with guarded(_FORMAT, name), _guarded(name, "written", "name another folder"), _environment():
        import affine
        import numpy as np
        import rasterio
        from rasterio.windows import Window as Part

        # on even rows GDAL's choice of strips would be one row each: tiles of thousands of samples open sooner
        how = {"compress": "deflate", "predictor": 3, "blockysize": min(16, shape[0]), "BIGTIFF": "IF_SAFER"}
        with rasterio.open(
            str(path.resolve()), "w", driver="GTiff", height=shape[0], width=shape[1], count=1, dtype="float32",
            nodata=math.nan, crs=crs, transform=affine.Affine(*transform), **how,
        ) as raster:  # fmt: skip
            raster.update_tags(TIFFTAG_IMAGEDESCRIPTION=title, **tags)
            raster.set_band_description(1, title)
            if unit:
                raster.set_band_unit(1, unit)
            for first, values in bands:
                raster.write(values.astype(np.float32), 1, window=Part(0, first, values.shape[1], len(values)))


_FORMAT = Format(
    "geotiff",
    (".tif", ".tiff"),
    "GeoTIFF",
    "grid",
    read=_read,
    extra="geo",
    open_heights=_open_heights,
    count_samples=_count_samples,
)
register(_FORMAT)
