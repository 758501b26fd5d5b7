"""The metric frame: what a unit of the plane measures where it is an angle, so that lengths and heights do not mix."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.outmesh import metres_of

# WGS 84: semi-major axis [m] and inverse flattening. With other ellipsoids in use a scale differs by less than 0.3 %.
WGS84 = (6378137.0, 298.257223563)
DEGREE = math.pi / 180
# No latitude is beyond; rasters may overlap the pole by half a sample.
LARGEST_LATITUDE = 90.01 * DEGREE
# The numbers of projected systems, but for some few in between. Of others the coordinates tell: projected ones are far
# from their origin, and there is no table of all systems at hand.
PROJECTED_NUMBERS = (range(2000, 3800), range(20000, 32768))
# From this ratio on of a degree of longitude at the southern to that at the northern edge, it is said.
WIDE = 1.1

_NUMBER = r"[-+]?[\d.]+(?:[eE][-+]?\d+)?"
_UNIT = re.compile(rf'\b(ANGLE|LENGTH|)UNIT\s*\[\s*"([^"]*)"\s*,\s*({_NUMBER})')
_ELLIPSOID = re.compile(rf'\b(?:SPHEROID|ELLIPSOID)\s*\[\s*"[^"]*"\s*,\s*({_NUMBER})\s*,\s*({_NUMBER})')
_VERTICAL = re.compile(r"\bVERT(?:_CS|CRS|ICALCRS)\s*\[")
_PROJECTED = re.compile(r"\bPROJ(?:CS|CRS|ECTEDCRS)\s*\[")
_GEOGRAPHIC = re.compile(r"\bGEOG(?:CS|CRS|RAPHICCRS)\s*\[|\bGEOD(?:ETIC)?CRS\s*\[.*\bCS\s*\[\s*ellipsoidal", re.DOTALL)

_PARAMETER = re.compile(rf'\bPARAMETER\s*\[\s*"[^"]*"\s*,\s*({_NUMBER})')
_REGISTERED = re.compile(r'(?:AUTHORITY\s*\[\s*"EPSG"\s*,\s*"?(\d+)"?\s*\]|ID\s*\[\s*"EPSG"\s*,\s*(\d+)\s*\])\s*\]\s*$')
_IS_COMPOUND = re.compile(r"\s*COMP(?:D_CS|OUNDCRS)\b")


def stated_system(text: str) -> dict[str, Any]:
    """Return the georeference that a text means which names a coordinate reference system; empty: none that is known.

    >>> stated_system("EPSG:25832"), stated_system("urn:ogc:def:crs:EPSG::25832"), stated_system("local")
    ({'epsg': 25832}, {'epsg': 25832}, {})
    """
    if number := re.fullmatch(r"(?:urn:ogc:def:crs:)?EPSG:[\w.]*?:?(\d{4,5})", text, re.IGNORECASE):
        return {"epsg": int(number[1])}
    if re.fullmatch(r"(?:urn:ogc:def:crs:)?OGC:(?:1\.3:)?:?CRS84", text, re.IGNORECASE):  # WGS 84, longitude first
        return {"epsg": 4326, "unit": "degree"}
    return {"crs": text} if "[" in text else {}


def spelled_system(georeference: Mapping[str, Any]) -> str:
    r"""Return a reference system as files name it: by its number in the EPSG register, else as WKT in one line.

    >>> spelled_system({"epsg": 25832, "crs": "PROJCS[...]"}), spelled_system({"crs": "LOCAL_CS[\n  ...]"})
    ('EPSG:25832', 'LOCAL_CS[ ...]')
    >>> spelled_system({})
    ''
    """
    if number := georeference.get("epsg"):
        return f"EPSG:{number}"
    return " ".join(str(georeference.get("crs") or "").split())


def systems_differ(first: Mapping[str, Any], second: Mapping[str, Any]) -> bool:
    """Tell whether two georeferences are known to be of different reference systems.

    Where both name their number in the EPSG register it decides; else whether they are projected, and the numbers that
    define the projections, whatever these are called.

    Examples
    --------
    >>> utm = 'PROJCS["WGS_1984_UTM_Zone_{}N",...,PARAMETER["Central_Meridian",{}],PARAMETER["Scale_Factor",0.9996]]'
    >>> systems_differ({"crs": utm.format(33, 15.0)}, {"crs": utm.format(33, 15)})
    False
    >>> systems_differ({"crs": utm.format(33, 15.0)}, {"crs": utm.format(32, 9)})
    True
    >>> systems_differ({"epsg": 32633}, {"epsg": 25833}), systems_differ({"epsg": 32633}, {})
    (True, False)
    """
    numbers = [epsg_number(georeference) for georeference in (first, second)]
    if all(numbers):
        return numbers[0] != numbers[1]
    texts = [str(georeference.get("crs") or "") for georeference in (first, second)]
    if not all(texts):
        return False
    kinds = [bool(_PROJECTED.search(text)) for text in texts]
    defined = [sorted(filter(None, map(float, _PARAMETER.findall(text)))) for text in texts]
    return kinds[0] != kinds[1] or defined[0] != defined[1]


def epsg_number(georeference: Mapping[str, Any]) -> int | None:
    """Return the number in the EPSG register of a reference system that is stated by it, or whose text says it.

    >>> epsg_number({"epsg": 25832}), epsg_number({"crs": 'PROJCS["UTM 32",...,AUTHORITY["EPSG","25832"]]'})
    (25832, 25832)
    """
    if georeference.get("epsg"):
        return int(georeference["epsg"])
    text = str(georeference.get("crs") or "")
    found = None if _IS_COMPOUND.match(text) else _REGISTERED.search(text)
    return int(found[1] or found[2]) if found else None


def metres_per_radian(latitude: float, ellipsoid: tuple[float, float] = WGS84) -> tuple[float, float]:
    """Return how many metres a radian of longitude and one of latitude measure on an ellipsoid.

    They are N cos(phi) and M, with the radii of curvature across and along the meridian [1]_.

    Parameters
    ----------
    latitude : float
        phi [radians].
    ellipsoid : (float, float)
        Its semi-major axis [m] and inverse flattening (0: a sphere).

    References
    ----------
    .. [1] J. P. Snyder, "Map Projections: A Working Manual", U.S. Geological Survey Professional Paper 1395, 1987,
       section 4.

    Examples
    --------
    A degree at the equator:

    >>> [round(DEGREE * length, 2) for length in metres_per_radian(0.0)]
    [111319.49, 110574.28]
    """
    axis, inverse = ellipsoid
    flattening = 1.0 / inverse if inverse else 0.0
    squared = flattening * (2.0 - flattening)
    rest = 1.0 - squared * math.sin(latitude) ** 2
    return axis / math.sqrt(rest) * math.cos(latitude), axis * (1.0 - squared) / rest**1.5


def in_metric_frame(
    georeference: Mapping[str, Any],
    low: FloatArray,
    high: FloatArray,
    *,
    scale: str | tuple[float, float] | None,
    name: str,
) -> dict[str, Any]:
    """Return a georeference with what units are, and the ``scale`` of the plane where it is not 1.

    Parameters
    ----------
    georeference : mapping
        See :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    low, high : (2,) or (3,) float arrays
        The lowest and the highest x and y of the model [file units].
    scale : "degrees", (float, float) or None
        As the user says it (see :class:`~meshsimp_pymoo.formats.options.Options`).
    name : str
        What messages call the model.

    Returns
    -------
    dict
        With ``unit``, of x and y, ``height_unit``, of z, where the system says so, and ``scale``, (metres to a unit of
        x, of y), unless that is 1: what was found out before stays.

    Raises
    ------
    ModelError
        If the user says degrees, and y is no latitude.

    Warns
    -----
    ModelWarning
        If its coordinates are degrees, with the scale that was found.
    """
    facts = dict(georeference)
    wkt = str(facts.get("crs") or "").partition("TARGETCRS")[0]
    vertical = _VERTICAL.search(wkt)
    plane, above = (wkt[: vertical.start()], wkt[vertical.start() :]) if vertical else (wkt, "")
    angle = _angular_unit(facts, plane, low, high)
    to_height = metres_of(facts.get("height_unit")) or 1.0
    if lengths := _UNIT.findall(above):
        _, facts["height_unit"], size = lengths[-1]
        to_height = float(size) or 1.0
    if isinstance(scale, tuple):
        facts.pop("scale", None)
        return facts if scale == (1.0, 1.0) else facts | {"scale": list(scale)}
    if scale is None and (angle is None or "scale" in facts):
        return facts
    if angle is None:
        angle, facts["unit"] = DEGREE, "degree"
    south, north = angle * float(low[1]), angle * float(high[1])
    if max(-south, north) > LARGEST_LATITUDE:
        said = f"{name}: its y reaches from {float(low[1]):g} to {float(high[1]):g}, which are no latitudes in degrees"
        if scale is not None:
            raise ModelError(f"{said}; give the scale as SX,SY, or leave it out")
        warn_of(
            f"{said} as its reference system has them: it is measured in the units of the file; correct the system, or "
            "say the scale (--scale SX,SY)"
        )
        return facts
    found = _ELLIPSOID.search(plane)
    ellipsoid = (float(found[1]), float(found[2])) if found else WGS84
    latitude = (south + north) / 2
    facts["scale"] = [angle * length / to_height for length in metres_per_radian(latitude, ellipsoid)]
    across = sorted(angle * metres_per_radian(edge, ellipsoid)[0] / to_height for edge in (south, north))
    wide = f" ({across[0]:.6g} and {across[1]:.6g} at its edges: project it for more)"
    unit, (x, y) = str(facts["unit"]), facts["scale"]
    height_unit = str(facts.get("height_unit", "metre"))
    taken = "" if "height_unit" in facts else f"heights are taken for {_plural(height_unit)}; "
    warn_of(
        f"{name}: its coordinates are {_plural(unit)}; lengths are measured in {_plural(height_unit)}, {x:.8g} to a "
        f"{unit} of longitude{wide * (across[1] > WIDE * across[0])} and {y:.8g} to one of latitude, as at latitude "
        f"{latitude / DEGREE:.6g}; {taken}files keep their {_plural(unit)} (--scale none measures in these)"
    )
    return facts


def _angular_unit(facts: dict[str, Any], plane: str, low: FloatArray, high: FloatArray) -> float | None:
    """Return the radians of a unit of x and y where it is an angle; write down what the unit is, if the system says."""
    if _PROJECTED.search(plane):
        if lengths := [unit for unit in _UNIT.findall(plane) if unit[0] != "ANGLE"]:
            facts.setdefault("unit", lengths[-1][1])
        return None
    if found := _GEOGRAPHIC.search(plane):
        units = _UNIT.findall(plane, found.start())
        # beside the axes in the later spelling, after the meridian in the earlier one
        angles = [unit for unit in units if unit[0] == "ANGLE"][-1:] or [unit for unit in units if not unit[0]][:1]
        _, facts["unit"], size = angles[0] if angles else ("", "degree", DEGREE)
        return float(size)
    if facts.get("unit") == "degree":
        return DEGREE
    number = facts.get("epsg")
    if plane or facts.get("unit") or not number or any(number in numbers for numbers in PROJECTED_NUMBERS):
        return None
    if max(-low[0], high[0]) > 360 or max(-low[1], high[1]) > 90:
        return None
    facts["unit"] = "degree"
    return DEGREE


def _plural(unit: str) -> str:
    return {"foot": "feet", "US survey foot": "US survey feet"}.get(unit, f"{unit}s")
