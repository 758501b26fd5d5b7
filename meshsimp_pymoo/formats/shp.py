"""Shapefile: lines with or without heights; no models. The files beside it (.shx, .dbf, .prj) belong to it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.formats.table import LINES, Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source.lines import SourceLines

# The number of the format, big-endian.
MAGIC = (9994).to_bytes(4, "big")


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read polylines and the rings of polygons."""
    from meshsimp_pymoo.formats.source.features import read_features

    return read_features(path, name, MAGIC, "copy it again with the files beside it (.shx, .dbf, .prj)")


register(Format("shp", (".shp",), "Shapefile", sort=LINES, extra="lines", read_lines=_read_lines))
