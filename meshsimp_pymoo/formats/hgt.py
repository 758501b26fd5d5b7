"""SRTM tiles: a degree by a degree of whole metres, named after the corner in the south-west."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import Grid, PlacedHeights

# The height where there is none.
VOID = -32768
# Steps in a degree of a tile that is no square: north of 50 degrees some have every other column.
HALF = 3600
NAME = re.compile(r"([NS])(\d\d)([EW])(\d{3})(?!\d)", re.IGNORECASE)


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    return _load(path, name, options).mesh(name, options.window)


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    return _load(path, name, options, by_windows=True).placed(name, options.window)


def _load(path: Path, name: str, options: Options, *, by_windows: bool = False) -> Grid:
    """Place a tile by its name, in degrees; with a spacing, from 0 and in whatever that is in."""
    import numpy as np

    from meshsimp_pymoo.formats.source.heights import Grid, check_room, even_grid, warn_of_degrees

    shape = _shape(path.stat().st_size, name)
    check_room(shape, 0, options, name, by_windows=by_windows)
    heights = np.memmap(path, ">i2", "r", shape=shape)
    nodata = VOID if options.nodata is None else options.nodata
    if options.steps is not None:
        return even_grid(heights, *options.steps, nodata=nodata, name=name)
    corner = NAME.match(path.name)
    if corner is None:
        raise ModelError(
            f"{name}: its name does not say where it lies; name it after its corner in the south-west, such as "
            "N47E011.hgt, or give the distance of its samples (--spacing 30)"
        )
    south, west = (
        float(number) * (-1 if half in "SWsw" else 1) for half, number in (corner.group(1, 2), corner.group(3, 4))
    )
    rows, columns = shape
    warn_of_degrees(name)
    return Grid(
        heights,
        west + np.arange(columns) / (columns - 1),
        south + np.arange(rows)[::-1] / (rows - 1),
        nodata,
        {"epsg": 4326, "unit": "degree"},
    )


def _shape(size: int, name: str) -> tuple[int, int]:
    """Return the rows and columns of a tile of so many bytes: whole seconds of arc or whole parts of one apart."""
    side = math.isqrt(size // 2)
    steps = side - 1
    if 2 * side * side == size and steps > 0 and (3600 % steps == 0 or steps % 3600 == 0):
        return side, side
    if size == 2 * (HALF + 1) * (HALF // 2 + 1):
        return HALF + 1, HALF // 2 + 1
    raise ModelError(
        f"{name}: its {size} bytes are no tile of 1201 x 1201 or 3601 x 3601 heights of 2 bytes; copy it again, or "
        "unpack it if it is packed"
    )


def _count_samples(path: Path, name: str) -> int:
    return path.stat().st_size // 2


register(
    Format("hgt", (".hgt",), "SRTM tile", "grid", read=_read, open_heights=_open_heights, count_samples=_count_samples)
)
