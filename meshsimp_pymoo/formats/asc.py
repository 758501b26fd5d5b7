"""ESRI ASCII grids: a line per key, then the rows of heights from north to south."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import Grid, PlacedHeights

# The lines that say what it is are the first few hundred bytes.
HEADER_BYTES = 2000


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    return _load(path, name, options).mesh(name, options.window)


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    return _load(path, name, options, by_windows=True).placed(name, options.window)


def _load(path: Path, name: str, options: Options, *, by_windows: bool = False) -> Grid:
    """Read an ESRI ASCII grid: a line per key, then the rows of heights from north to south."""
    from meshsimp_pymoo.formats.source.esri import esri_header, header_lines
    from meshsimp_pymoo.formats.source.heights import check_room, even_grid
    from meshsimp_pymoo.formats.source.numbers import read_text

    text = read_text(path, name)
    lines, at = header_lines(text)
    if not lines.keys() & {"ncols", "nrows", "cellsize"}:
        first = text[:HEADER_BYTES].strip().partition("\n")[0]
        raise ModelError(
            f"{name}: begins with {first[:60]!r} where an ESRI grid has 'ncols'; if it holds a point cloud, x y z in "
            "every line, rename it to .xyz"
        )
    header = esri_header(lines, options, name)
    count = header.columns * header.rows
    if count * 2 - 1 > len(text) - at:
        raise ModelError(
            f"{name}: truncated: declares {header.columns} x {header.rows} heights, but {len(text) - at} bytes follow; "
            "copy it again"
        )
    check_room((header.rows, header.columns), 8, options, name, by_windows=by_windows)
    heights = _numbers(text[at:], count, header.nodata, name)
    if len(heights) != count:
        raise ModelError(
            f"{name}: declares {header.columns} x {header.rows} = {count} heights, but {len(heights)} follow; copy or "
            "write it again"
        )
    return even_grid(
        heights.reshape(header.rows, header.columns),
        header.dx,
        header.dy,
        nodata=header.nodata_value if options.nodata is None else options.nodata,
        name=name,
        origin=header.origin,
    )


def _numbers(text: str, count: int, nodata: float | str, name: str) -> FloatArray:
    """Return the heights; commas stand in them or between them, which their number tells."""
    from meshsimp_pymoo.formats.source.numbers import parse_numbers

    if isinstance(nodata, str):
        text = re.sub(rf"(?<!\S){re.escape(nodata)}(?!\S)", "nan", text, flags=re.IGNORECASE)
    if "," in text:
        text = text.replace(",", "." if len(text.split()) == count else " ")
    return parse_numbers(text, name)


def _count_samples(path: Path, name: str) -> int | None:
    from meshsimp_pymoo.formats.source.esri import header_lines
    from meshsimp_pymoo.formats.source.numbers import without_mark

    with path.open("rb") as file:
        lines, _ = header_lines(without_mark(file.read(HEADER_BYTES)).decode("utf-8", errors="replace"))
    sizes = [lines.get(key, "") for key in ("nrows", "ncols")]
    return int(sizes[0]) * int(sizes[1]) if all(size.isdecimal() for size in sizes) else None


register(
    Format(
        "asc",
        (".asc",),
        ".asc",
        "grid",
        read=_read,
        open_heights=_open_heights,
        count_samples=_count_samples,
    )
)
