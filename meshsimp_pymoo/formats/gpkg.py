"""GeoPackage: lines of all layers, with or without heights; no models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.formats.table import LINES, Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source.lines import SourceLines

MAGIC = b"SQLite format 3\0"


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read line strings and the rings of polygons."""
    from meshsimp_pymoo.formats.source.features import read_features

    return read_features(path, name, MAGIC, "export it again")


register(Format("gpkg", (".gpkg",), "GeoPackage", sort=LINES, extra="lines", read_lines=_read_lines))
