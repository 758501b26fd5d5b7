"""ESRI ASCII grids: a line per key, then the rows of heights from north to south."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source import SourceMesh

# The lines that say what it is are the first few hundred bytes.
HEADER_BYTES = 2000


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    """Read an ESRI ASCII grid: a line per key, then the rows of heights from north to south."""
    from meshsimp_pymoo.formats.source.heights import grid_source
    from meshsimp_pymoo.formats.source.numbers import parse_numbers

    steps = options.steps
    text = path.read_bytes().decode("utf-8", errors="replace")
    header: dict[str, float] = {}
    at = 0
    for match in re.finditer(r"[ \t]*([A-Za-z_]+)[ \t]+(\S+)[ \t]*(?:\r\n|\r|\n|$)", text):
        if match.start() != at or match[1].lower() in ("nan", "inf"):
            break
        try:
            header[match[1].lower()] = float(match[2])
        except ValueError:
            raise ModelError(
                f"{name}: the header line {match[0].strip()[:60]!r} has no number; write it again"
            ) from None
        at = match.end()
    missing = [key for key in ("ncols", "nrows") if key not in header]
    if steps is None and "cellsize" not in header and not {"dx", "dy"} <= header.keys():
        missing.append("cellsize")
    if missing:
        raise ModelError(
            f"{name}: its header lacks {', '.join(missing)}, so it is no ESRI ASCII grid; check the suffix"
        )
    columns, rows = header["ncols"], header["nrows"]
    if not (columns >= 2 and rows >= 2 and columns % 1 == 0 and rows % 1 == 0):
        raise ModelError(f"{name}: declares {columns:g} columns and {rows:g} rows; give at least 2 of each")
    if columns * rows * 2 - 1 > len(text) - at:
        raise ModelError(
            f"{name}: truncated: declares {columns:g} x {rows:g} heights, but {len(text) - at} bytes follow; "
            "copy it again"
        )
    heights = parse_numbers(text[at:], name)
    if len(heights) != columns * rows:
        raise ModelError(
            f"{name}: declares {columns:g} x {rows:g} = {columns * rows:g} heights, but {len(heights)} "
            "follow; copy or write it again"
        )
    cell = header.get("cellsize", 1.0)
    dx, dy = steps or (header.get("dx", cell), header.get("dy", cell))
    west = header.get("xllcenter", header.get("xllcorner", 0.0) + (dx / 2 if "xllcorner" in header else 0.0))
    south = header.get("yllcenter", header.get("yllcorner", 0.0) + (dy / 2 if "yllcorner" in header else 0.0))
    return grid_source(
        heights.reshape(int(rows), int(columns)),
        dx,
        dy,
        nodata=header.get("nodata_value", -9999.0) if options.nodata is None else options.nodata,  # ESRI's default
        name=name,
        origin=(west, south + (rows - 1) * dy),
        window=options.window,
    )


def _count_samples(path: Path, name: str) -> int | None:
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES).decode("utf-8", errors="replace").lower()
    sizes = [re.search(rf"^[ \t]*{key}[ \t]+(\d+)", header, re.MULTILINE) for key in ("nrows", "ncols")]
    return int(sizes[0][1]) * int(sizes[1][1]) if sizes[0] and sizes[1] else None


register(Format("asc", (".asc",), ".asc", "grid", read=_read, count_samples=_count_samples))
