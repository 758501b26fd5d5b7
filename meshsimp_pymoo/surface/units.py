"""The unit of a model's lengths and the system of its coordinates, in words: what people are told beside numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from meshsimp_pymoo.formats.outmesh import metres_of
from meshsimp_pymoo.surface.measures import LENGTH

ANGLES = ("degree", "grad", "gon", "radian")


def length_unit(georeference: Mapping[str, Any]) -> str:
    """Return the unit of errors: that of heights, of which the plane is scaled to be; LENGTH where nobody says.

    Examples
    --------
    >>> length_unit({"unit": "degree", "scale": [76056.3, 111173.5]}), length_unit({"unit": "US survey foot"})
    ('m', 'US survey foot')
    >>> length_unit({"unit": "degree"}), length_unit({})
    ('model units', 'model units')
    """
    unit = str(georeference.get("height_unit") or ("metre" if "scale" in georeference else georeference.get("unit")))
    if metres_of(unit) == 1.0:
        return "m"
    return LENGTH if unit in ("None", *ANGLES) else unit


def in_unit(unit: str) -> str:
    """Return what follows a number of this unit: nothing where it is not known.

    >>> f"0.3{in_unit('m')}", f"0.3{in_unit(LENGTH)}"
    ('0.3 m', '0.3')
    """
    return "" if unit == LENGTH else f" {unit}"


def metres_per_model_unit(georeference: Mapping[str, Any]) -> float:
    """Return what the unit of errors is in metres; 1 where nobody says.

    >>> metres_per_model_unit({"unit": "degree", "height_unit": "foot"}), metres_per_model_unit({})
    (0.3048, 1.0)
    """
    return metres_of(length_unit(georeference)) or 1.0


def system_name(georeference: Mapping[str, Any]) -> str:
    """Return what the reference system is called, as far as its text says.

    >>> system_name({"epsg": 32633, "crs": 'PROJCS["WGS 84 / UTM zone 33N",...]'}), system_name({"epsg": 4326})
    ('WGS 84 / UTM zone 33N', '')
    """
    return str(georeference.get("crs") or "").partition('"')[2].partition('"')[0]


def reference_system(georeference: Mapping[str, Any]) -> str:
    """Return what the coordinates are, and how the plane is scaled; empty where nobody says.

    Examples
    --------
    >>> reference_system({"epsg": 4326, "unit": "degree", "scale": [76056.321, 111173.456]})
    'EPSG:4326, 76056.321 x 111173.46 m to a degree'
    >>> reference_system({"crs": 'PROJCS["WGS 84 / UTM zone 33N",...]'}), reference_system({})
    ('WGS 84 / UTM zone 33N', '')
    """
    number = georeference.get("epsg")
    said = [f"EPSG:{number}" if number else system_name(georeference)]
    if "scale" in georeference:
        x, y = georeference["scale"]
        said.append(f"{x:.8g} x {y:.8g} {length_unit(georeference)} to a {georeference.get('unit') or 'unit'}")
    return ", ".join(filter(None, said))


def known_units(georeference: Mapping[str, Any]) -> dict[str, Any]:
    """Return the same as plain data, for summaries: ``epsg``, ``unit`` and ``scale``, as far as they are known."""
    unit = length_unit(georeference)
    found = {"epsg": georeference.get("epsg"), "unit": unit, "scale": georeference.get("scale")}
    return {name: fact for name, fact in found.items() if fact not in (None, LENGTH)}
