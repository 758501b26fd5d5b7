"""GeoJSON: lines with or without heights, in and out, and surfaces with their break lines; models are not read.

A surface is written as a feature for each triangle, a polygon with heights; break lines are features behind them.

Of a file without a ``crs`` the format's later edition [1]_ says that it is WGS 84. Most files of surveys say nothing,
and are in the system of the model: none is taken to be stated then.

References
----------
.. [1] RFC 7946, "The GeoJSON Format", 2016; ``crs`` is of the edition of 2008, section 3, and GDAL still writes it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, reason_of
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source.lines import SourceLines

# What a byte of JSON takes at most as objects: that of an empty list and a comma.
JSON_BYTES = 30
# Of the geometries that are no lines: what they are called.
POINTS = {"Point": "points", "MultiPoint": "points"}
# How far into their coordinates the lines are.
DEPTHS = {"LineString": 0, "MultiLineString": 1, "Polygon": 1, "MultiPolygon": 2}
# The properties that may name a feature.
NAMES = ("name", "id")


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read line strings and the rings of polygons, of features and geometries as deep as they lie."""
    import json

    from meshsimp_pymoo.formats.source.lines import build_lines, part_names
    from meshsimp_pymoo.formats.source.numbers import read_text
    from meshsimp_pymoo.memory import check_free

    size = path.stat().st_size
    check_free(JSON_BYTES * size, f"{name}: its {size} bytes of JSON", "take a part of it")
    try:
        tree = json.loads(read_text(path, name), parse_constant=_refuse_constant)
        lines, names, others = [], [], Counter[str]()
        for called, geometry, is_triangle in _features(tree):
            if is_triangle:
                others["triangles"] += 1
                continue
            parts = list(_parts(geometry, others))
            for part, of_part in zip(parts, part_names(called, len(parts)), strict=True):
                names.append(of_part)
                lines.append(_positions(part, name, of_part))
        facts = _system(tree)
    except ModelError:
        raise
    except (ValueError, AttributeError, TypeError, LookupError, OverflowError, RecursionError) as error:
        raise ModelError(f"{name}: cannot be read as GeoJSON ({reason_of(error)}); export the file again") from error
    return build_lines(name, lines, names, facts, others=others)


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is no number of JSON")


def _features(tree: Any) -> Iterator[tuple[str, Any, bool]]:
    """Yield what messages call each feature, its geometry, and whether it is a triangle of a surface that was written.

    A bare geometry is a feature.
    """
    from meshsimp_pymoo.formats.source.lines import spelled_name
    from meshsimp_pymoo.formats.source.triangles import TRIANGLE

    features = tree["features"] if tree["type"] == "FeatureCollection" else [tree]
    for number, feature in enumerate(features, start=1):
        if feature["type"] != "Feature":
            yield spelled_name("geometry", number), feature, False
            continue
        known = {str(key).lower(): value for key, value in (feature.get("properties") or {}).items()}
        known.setdefault("id", feature.get("id"))
        named = [known[key] for key in NAMES if isinstance(known.get(key), (str, int))]
        yield spelled_name("feature", number, *named[:1]), feature["geometry"], TRIANGLE in known


def _parts(geometry: Any, others: Counter[str]) -> Iterator[list[Any]]:
    """Yield the positions of each line and ring of a geometry; count what is neither."""
    waiting = [geometry]
    while waiting:
        found = waiting.pop()
        kind = "nothing" if found is None else found["type"]
        if kind == "GeometryCollection":
            waiting += found["geometries"][::-1]
        elif kind in DEPTHS:
            parts = [found["coordinates"]]
            for _ in range(DEPTHS[kind]):
                parts = [part for whole in parts for part in whole]
            for part in filter(None, parts):
                yield part + part[:1] if "Polygon" in kind and part[0] != part[-1] else part
        elif kind in POINTS:
            others[POINTS[kind]] += 1 if kind == "Point" else len(found["coordinates"])
        elif kind == "nothing":
            others["features without a geometry"] += 1
        else:
            raise ValueError(f"{kind!r:.40} is no geometry of GeoJSON")


def _positions(part: list[Any], name: str, called: str) -> list[list[float]]:
    """Return the positions of a line, all with a height or all without."""
    positions = [[float(_number(x)) for x in position[:3]] for position in part]  # what is behind them means nothing
    lengths = [len(position) for position in positions]
    if min(lengths) < 2:
        raise ModelError(f"{name}: a position of {called} has fewer than two numbers; export the file again")
    if min(lengths) < max(lengths):
        raise ModelError(
            f"{name}: {lengths.count(2)} of {len(lengths)} positions of {called} have no height (first: position "
            f"{lengths.index(2)}); give all of them one, or none"
        )
    return positions


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"{value!r:.40} stands where a number should")
    return value


def _system(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the coordinate reference system that a file names."""
    from meshsimp_pymoo.formats.source.metric import stated_system

    stated = tree.get("crs") or {}
    return stated_system(str((stated.get("properties") or {}).get("name") or ""))


def _write_lines(path: Path, lines: SourceLines) -> None:
    """Write a feature for each line, one in a row of the file, with its name."""
    places = [line.tolist() for line in lines.lines]
    _put(path, _line_features(places, lines.names), lines.georeference)


def _write(path: Path, mesh: OutMesh) -> None:
    """Write a feature for each triangle, its ring counter-clockwise as seen from above, and one for each line."""
    import numpy as np

    from meshsimp_pymoo.formats.source.triangles import properties

    places = mesh.vertices.tolist()
    named = [f"[{x!r}, {y!r}, {z!r}]" for x, y, z in places]
    said = properties(mesh)
    values = zip(*(column.tolist() for column in said.values()), strict=True)
    form = ", ".join(f'"{name}": {{!r}}' for name in said)
    features = [
        f'{{"type": "Feature", "properties": {{{form.format(*own)}}}, "geometry": {{"type": "Polygon", '
        f'"coordinates": [[{named[a]}, {named[b]}, {named[c]}, {named[a]}]]}}}}'
        for own, (a, b, c) in zip(values, np.asarray(mesh.faces).tolist(), strict=True)
    ]
    lines = [[places[row] for row in line.tolist()] for line in mesh.lines]
    features += _line_features(lines, mesh.line_names or [""] * len(lines))
    _put(path, features, mesh.georeference)


def _line_features(lines: Iterable[list[list[float]]], names: Iterable[str]) -> list[str]:
    import json

    from meshsimp_pymoo.formats.source.lines import given_name

    return [
        json.dumps(
            {
                "type": "Feature",
                "properties": {"name": given_name(called)},
                "geometry": {"type": "LineString", "coordinates": line},
            },
            allow_nan=False,
        )
        for called, line in zip(names, lines, strict=True)
    ]


def _put(path: Path, features: list[str], georeference: Mapping[str, Any]) -> None:
    """Write features, one in a row, and the reference system, where its number is known."""
    import json

    from meshsimp_pymoo.formats.source.metric import epsg_number

    number = epsg_number(georeference)
    named = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{number}"}}
    head = '{"type": "FeatureCollection",' + (f' "crs": {json.dumps(named)},' if number else "")
    path.write_bytes((head + ' "features": [\n' + ",\n".join(features) + "\n]}\n").encode("utf-8"))


register(
    Format(
        "geojson",
        (".geojson", ".json"),
        "GeoJSON",
        write=_write,
        one_height=True,
        read_lines=_read_lines,
        write_lines=_write_lines,
        holds_lines=True,
    )
)
