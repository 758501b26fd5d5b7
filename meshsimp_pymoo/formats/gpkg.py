"""GeoPackage: lines of all layers, with or without heights, and surfaces with their break lines; models are not read.

A surface is written as a layer of triangles, each a polygon with heights: the standard has no triangulated surfaces,
and QGIS and GDAL show, colour and query polygons one by one, in the map and in space. Break lines are another layer.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source.lines import SourceLines

MAGIC = b"SQLite format 3\0"
# That of 2018, which programs of some years ago open without a murmur.
EDITION = "1.2"
SURFACE_LAYER, LINE_LAYER = "tin", "break_lines"


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read line strings and the rings of polygons."""
    from meshsimp_pymoo.formats.source.features import read_features

    return read_features(path, name, MAGIC, "export it again")


def _write(path: Path, mesh: OutMesh) -> None:
    import numpy as np

    from meshsimp_pymoo.formats.source.features import Layer, line_strings, polygons, write_layers
    from meshsimp_pymoo.formats.source.lines import given_name
    from meshsimp_pymoo.formats.source.triangles import properties

    layers = [Layer(SURFACE_LAYER, "Polygon Z", polygons(mesh.vertices[mesh.faces]), properties(mesh))]
    if mesh.lines:
        names = np.array([given_name(called) for called in mesh.line_names or [""] * len(mesh.lines)], object)
        places = line_strings([mesh.vertices[line] for line in mesh.lines])
        layers.append(Layer(LINE_LAYER, "LineString Z", places, {"name": names}))
    write_layers(path, "GPKG", layers, mesh.georeference, VERSION=EDITION)


register(
    Format(
        "gpkg",
        (".gpkg",),
        "GeoPackage",
        extra="lines",
        write=_write,
        needs="pyogrio",
        read_lines=_read_lines,
        holds_lines=True,
    )
)
