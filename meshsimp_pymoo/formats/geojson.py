"""GeoJSON: lines with or without heights, in and out; no models.

Of a file without a ``crs`` the format's later edition [1]_ says that it is WGS 84. Most files of surveys say nothing,
and are in the system of the model: none is taken to be stated then.

References
----------
.. [1] RFC 7946, "The GeoJSON Format", 2016; ``crs`` is of the edition of 2008, section 3, and GDAL still writes it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, reason_of
from meshsimp_pymoo.formats.table import LINES, Format, register

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
        for called, geometry in _features(tree):
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


def _features(tree: Any) -> Iterator[tuple[str, Any]]:
    """Yield what messages call each feature, and its geometry; a bare geometry is a feature."""
    from meshsimp_pymoo.formats.source.lines import spelled_name

    features = tree["features"] if tree["type"] == "FeatureCollection" else [tree]
    for number, feature in enumerate(features, start=1):
        if feature["type"] != "Feature":
            yield spelled_name("geometry", number), feature
            continue
        known = {str(key).lower(): value for key, value in (feature.get("properties") or {}).items()}
        known.setdefault("id", feature.get("id"))
        named = [known[key] for key in NAMES if isinstance(known.get(key), (str, int))]
        yield spelled_name("feature", number, *named[:1]), feature["geometry"]


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
    import json

    from meshsimp_pymoo.formats.source.lines import given_name
    from meshsimp_pymoo.formats.source.metric import epsg_number

    number = epsg_number(lines.georeference)
    named = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{number}"}}
    head = '{"type": "FeatureCollection",' + (f' "crs": {json.dumps(named)},' if number else "")
    features = [
        json.dumps(
            {
                "type": "Feature",
                "properties": {"name": given_name(called)},
                "geometry": {"type": "LineString", "coordinates": line.tolist()},
            },
            allow_nan=False,
        )
        for called, line in zip(lines.names, lines.lines, strict=True)
    ]
    path.write_bytes((head + ' "features": [\n' + ",\n".join(features) + "\n]}\n").encode("utf-8"))


register(
    Format(
        "geojson",
        (".geojson", ".json"),
        "GeoJSON",
        sort=LINES,
        read_lines=_read_lines,
        write_lines=_write_lines,
    )
)
