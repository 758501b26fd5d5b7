"""ESRI's binary grids: single-precision heights from north to south, with the header in a .hdr beside."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.esri import EsriHeader
    from meshsimp_pymoo.formats.source.heights import Grid, PlacedHeights

ORDERS = {"": "<f4", "lsbfirst": "<f4", "i": "<f4", "msbfirst": ">f4", "m": ">f4"}


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    return _load(path, name, options).mesh(name, options.window)


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    return _load(path, name, options, by_windows=True).placed(name, options.window)


def _load(path: Path, name: str, options: Options, *, by_windows: bool = False) -> Grid:
    import numpy as np

    from meshsimp_pymoo.formats.source.heights import check_room, even_grid

    header = _header(path, name, options)
    shape, size = (header.rows, header.columns), path.stat().st_size
    if 4 * header.rows * header.columns != size:
        raise ModelError(
            f"{name}: its header declares {header.columns} x {header.rows} heights of 4 bytes, but it has {size} bytes "
            "in all; copy both files again"
        )
    if header.byteorder not in ORDERS:
        raise ModelError(f"{name}: the byteorder {header.byteorder[:20]!r} is neither LSBFIRST nor MSBFIRST; mend it")
    check_room(shape, 0, options, name, by_windows=by_windows)
    return even_grid(
        np.memmap(path, ORDERS[header.byteorder], "r", shape=shape),
        header.dx,
        header.dy,
        nodata=header.nodata_value if options.nodata is None else options.nodata,
        name=name,
        origin=header.origin,
    )


def _header(path: Path, name: str, options: Options) -> EsriHeader:
    from meshsimp_pymoo.formats.source.esri import esri_header, header_lines
    from meshsimp_pymoo.formats.source.numbers import read_text

    for beside in (path.with_suffix(".hdr"), path.with_suffix(".HDR")):
        if beside.is_file():
            lines, _ = header_lines(read_text(beside, str(beside)))
            return esri_header(lines, options, str(beside))
    raise ModelError(f"{name}: there is no header {path.with_suffix('.hdr').name} beside it; copy both files")


def _count_samples(path: Path, name: str) -> int:
    return path.stat().st_size // 4


register(
    Format(
        "flt", (".flt",), ".flt with .hdr", "grid", read=_read, open_heights=_open_heights, count_samples=_count_samples
    )
)
