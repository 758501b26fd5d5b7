"""LandXML 1.2: a TIN surface for survey and GIS programs; written only."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.formats.outmesh import OutMesh, metres_of
from meshsimp_pymoo.formats.table import Format, Held, register

NAMESPACE = "http://www.landxml.org/schema/LandXML-1.2"
# LandXML demands a date and a time; one that never changes keeps equal meshes equal.
DATE = {"date": "1980-01-01", "time": "00:00:00"}
# LandXML's system of units and its name for one of so many metres.
UNITS = {
    1.0: ("Metric", "meter"),
    1000.0: ("Metric", "kilometer"),
    0.3048: ("Imperial", "foot"),
    1200 / 3937: ("Imperial", "USSurveyFoot"),
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
    """Refuse coordinates that are no lengths, and a mesh with faces that do not look up along the z of its file."""
    from meshsimp_pymoo.arrays import Rows

    unit = model.georeference.get("unit")
    if unit and metres_of(unit) is None:
        raise ResultError(
            f"{model.name}: a LandXML surface has lengths for coordinates, and the unit of these is {unit!r}; write "
            "another format, such as ply, or project the model first (gdalwarp -t_srs)"
        )
    if isinstance(model.faces, Rows):  # of a grid that is read by windows, where all look up
        return
    a, b, c = (model.file_points[model.faces[:, k], :2] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    if (area < 0).any() or not (area > 0).any():
        wrong = int((area < 0).sum()) or len(area)
        raise ResultError(
            f"{model.name}: a LandXML surface has its heights along z, and {wrong:,} of {len(area):,} faces of this "
            "one do not look up along it; write another format, such as ply"
        )


def _write(path: Path, mesh: OutMesh) -> None:
    """Write a surface: points as "northing easting elevation", faces counter-clockwise."""
    from xml.sax.saxutils import quoteattr

    import numpy as np

    system, unit = UNITS[metres_of(mesh.georeference.get("unit")) or 1.0]  # metres where nothing is known
    measures = {"linearUnit": unit} | MEASURES[system]
    crs = {"epsgCode": str(mesh.georeference.get("epsg") or ""), "ogcWktCode": str(mesh.georeference.get("crs") or "")}
    z = mesh.vertices[:, 2]
    points = [
        f'<P id="{k}">{y!r} {x!r} {height!r}</P>' for k, (x, y, height) in enumerate(mesh.vertices.tolist(), start=1)
    ]
    triangles = [f"<F>{a} {b} {c}</F>" for a, b, c in (np.asarray(mesh.faces, dtype=np.int64) + 1).tolist()]

    def spelled(attributes: Mapping[str, str]) -> str:
        return "".join(f" {key}={quoteattr(_printable(value))}" for key, value in attributes.items() if value)

    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<LandXML xmlns="{NAMESPACE}" version="1.2" readOnly="false"{spelled(DATE)}>',
        f"<Units><{system}{spelled(measures)}/></Units>",
        *([f"<CoordinateSystem{spelled(crs)}/>"] if any(crs.values()) else []),
        '<Application name="meshsimp_pymoo"/>',
        f"<Surfaces><Surface{spelled({'name': mesh.name})}>",
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


def _printable(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return "".join(character if character.isprintable() else "?" for character in text)


# A LandXML file is called .xml everywhere; the name of the format is understood too.
register(Format("landxml", (".xml", ".landxml"), "LandXML", write=_write, refuse=_refuse))
