"""LandXML: a TIN surface for survey and GIS programs, which is written only, and its break lines, in and out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, ResultError, reason_of
from meshsimp_pymoo.formats.outmesh import OutMesh, metres_of
from meshsimp_pymoo.formats.table import Format, Held, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray
    from meshsimp_pymoo.formats.source.lines import SourceLines

NAMESPACE = "http://www.landxml.org/schema/LandXML-1.2"
# The elements that list points, and how many numbers each point has there.
POINT_LISTS = {"PntList2D": 2, "PntList3D": 3}
# What a byte of a list takes at most: as pieces of text, as text, as numbers.
LIST_BYTES = 16
# Bytes of a file that are parsed at once.
PIECE = 1 << 20
# LandXML demands a date and a time; one that never changes keeps equal meshes equal.
DATE = {"date": "1980-01-01", "time": "00:00:00"}
# LandXML's system of units and its name for one of so many metres, and ours.
UNITS = {
    1.0: ("Metric", "meter", "metre"),
    1000.0: ("Metric", "kilometer", "kilometre"),
    0.3048: ("Imperial", "foot", "foot"),
    1200 / 3937: ("Imperial", "USSurveyFoot", "US survey foot"),
}
MEASURES = {
    "Metric": {
        "areaUnit": "squareMeter", "volumeUnit": "cubicMeter",
        "temperatureUnit": "celsius", "pressureUnit": "milliBars",
    },
    "Imperial": {
        "areaUnit": "squareFoot", "volumeUnit": "cubicFeet",
        "temperatureUnit": "fahrenheit", "pressureUnit": "inchHG",
    },
}  # fmt: skip


def _refuse(model: Held) -> None:
    """Refuse coordinates that are no lengths."""
    unit = model.georeference.get("unit")
    if unit and metres_of(unit) is None:
        raise ResultError(
            f"{model.name}: a LandXML surface has lengths for coordinates, and the unit of these is {unit!r}; write "
            "another format, such as ply, or project the model first (gdalwarp -t_srs)"
        )


def _write(path: Path, mesh: OutMesh) -> None:
    """Write a surface: points as "northing easting elevation", faces counter-clockwise."""
    from xml.sax.saxutils import quoteattr

    import numpy as np

    from meshsimp_pymoo.formats.source.lines import given_name

    system, unit, _ = UNITS[metres_of(mesh.georeference.get("unit")) or 1.0]  # metres where nothing is known
    measures = {"linearUnit": unit} | MEASURES[system]
    crs = {"epsgCode": str(mesh.georeference.get("epsg") or ""), "ogcWktCode": str(mesh.georeference.get("crs") or "")}
    z = mesh.vertices[:, 2]
    points = [
        f'<P id="{k}">{y!r} {x!r} {height!r}</P>' for k, (x, y, height) in enumerate(mesh.vertices.tolist(), start=1)
    ]
    triangles = [f"<F>{a} {b} {c}</F>" for a, b, c in (np.asarray(mesh.faces, dtype=np.int64) + 1).tolist()]

    def spelled(attributes: Mapping[str, str]) -> str:
        return "".join(f" {key}={quoteattr(_printable(value))}" for key, value in attributes.items() if value)

    places = mesh.vertices[:, [1, 0, 2]].tolist()
    names = mesh.line_names or [""] * len(mesh.lines)
    breaklines = [
        f"<Breakline{spelled({'brkType': 'standard', 'name': given_name(called)})}><PntList3D>"
        + " ".join(repr(value) for row in line.tolist() for value in places[row])
        + "</PntList3D></Breakline>"
        for line, called in zip(mesh.lines, names, strict=True)
    ]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<LandXML xmlns="{NAMESPACE}" version="1.2" readOnly="false"{spelled(DATE)}>',
        f"<Units><{system}{spelled(measures)}/></Units>",
        *([f"<CoordinateSystem{spelled(crs)}/>"] if any(crs.values()) else []),
        '<Application name="meshsimp_pymoo"/>',
        f"<Surfaces><Surface{spelled({'name': mesh.name})}>",
        *(["<SourceData><Breaklines>", *breaklines, "</Breaklines></SourceData>"] if breaklines else []),
        f'<Definition surfType="TIN" elevMin="{float(z.min())!r}" elevMax="{float(z.max())!r}">',
        "<Pnts>",
        *points,
        "</Pnts>",
        "<Faces>",
        *triangles,
        "</Faces>",
        "</Definition></Surface></Surfaces>",
        "</LandXML>",
    ]
    path.write_bytes(("\n".join(lines) + "\n").encode("utf-8"))


class _Breaklines:
    """What a parser of XML finds of break lines: of elements of any namespace, without the tree of the others."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.lines: list[FloatArray] = []
        self.names: list[str] = []
        self.facts: dict[str, Any] = {}
        self.others: Counter[str] = Counter()
        self.is_landxml = False
        self._outer: list[str] = []
        self._number = 0
        self._called = ""
        self._text: list[str] = []

    def doctype(self, *_: object) -> None:
        """Refuse what may define words that stand for others, without end."""
        raise ModelError(f"{self.name}: declares a document type, which no LandXML has; export it again")

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Take note of an element that begins."""
        from meshsimp_pymoo.formats.source.lines import spelled_name
        from meshsimp_pymoo.formats.source.metric import stated_system

        kind = tag.rpartition("}")[2]
        if not self._outer:
            self.is_landxml = kind == "LandXML"
        self._outer.append(kind)
        if kind == "Breakline":
            self._number += 1
            self._called = spelled_name("break line", self._number, attributes.get("name") or attributes.get("desc"))
        elif kind in ("Metric", "Imperial"):
            known = {theirs: ours for _, theirs, ours in UNITS.values()}
            self.facts |= {"unit": known[unit]} if (unit := attributes.get("linearUnit", "")) in known else {}
        elif kind == "CoordinateSystem":
            number, wkt = attributes.get("epsgCode", "").strip(), attributes.get("ogcWktCode", "")
            self.facts |= stated_system(f"EPSG:{number}" if number.isdigit() else number) | stated_system(wkt)
        self._text = []

    def data(self, text: str) -> None:
        """Keep the numbers of a list of points."""
        if self._outer[-1] in POINT_LISTS:
            self._text.append(text)

    def end(self, tag: str) -> None:
        """Take the line that ends."""
        from meshsimp_pymoo.formats.source.numbers import parse_numbers

        kind = self._outer.pop()
        if kind not in POINT_LISTS or "Breakline" not in self._outer:
            self.others["contours"] += kind == "Contour"
            return
        width = POINT_LISTS[kind]
        numbers = parse_numbers("".join(self._text), self.name)
        if len(numbers) % width:
            raise ModelError(
                f"{self.name}: {self._called} has {len(numbers)} numbers, which are no {width} a point; export it again"
            )
        points = numbers.reshape(-1, width)
        points[:, :2] = points[:, [1, 0]]  # northing, easting
        self.lines.append(points)
        self.names.append(self._called)

    def close(self) -> None:
        """Take note that the file has ended."""


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read the break lines of all surfaces, of any edition, whatever sort they are of."""
    from xml.etree.ElementTree import ParseError, XMLParser

    from meshsimp_pymoo.formats.source.lines import build_lines
    from meshsimp_pymoo.memory import check_free

    size = path.stat().st_size
    check_free(LIST_BYTES * size, f"{name}: its {size} bytes of XML", "take a part of it")
    found = _Breaklines(name)
    parser = XMLParser(target=found)
    try:
        with path.open("rb") as stream:
            while piece := stream.read(PIECE):
                parser.feed(piece)
        parser.close()
    except ModelError:
        raise
    except (ParseError, ValueError, LookupError) as error:
        raise ModelError(f"{name}: cannot be read as XML ({reason_of(error)}); export it again") from error
    if not found.is_landxml:
        raise ModelError(f"{name}: is XML, but no LandXML; export the lines as LandXML or GeoJSON")
    return build_lines(name, found.lines, found.names, found.facts, others=found.others)


def _printable(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return "".join(character if character.isprintable() else "?" for character in text)


# A LandXML file is called .xml everywhere; the name of the format is understood too.
register(
    Format(
        "landxml",
        (".xml", ".landxml"),
        "LandXML",
        write=_write,
        refuse=_refuse,
        one_height=True,
        read_lines=_read_lines,
        holds_lines=True,
    )
)
