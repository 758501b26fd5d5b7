"""LandXML: what survey programs find in it, and what it cannot hold."""

from __future__ import annotations

import dataclasses
from xml.etree import ElementTree

import numpy as np
import pytest
from samples import write_solutions

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.storage import read_front, write_front
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.surface import mesh_arrays

UTM = np.array([500_000.25, 5_400_000.5, 300.125])

LAND = "{http://www.landxml.org/schema/LandXML-1.2}"


@pytest.mark.parametrize(
    ("unit", "system", "linear"),
    [(None, "Metric", "meter"), ("metre", "Metric", "meter"), ("US survey foot", "Imperial", "USSurveyFoot")],
)
def test_landxml_is_a_tin_of_northing_easting_and_elevation_in_double_precision(
    tmp_path, solutions, unit, system, linear
):
    source = load("face:200")
    facts = {"epsg": 25832, "crs": 'PROJCS["a & b"]', "unit": unit}
    far = build_model(dataclasses.replace(source, points=source.points + UTM, georeference=facts, name='<a & "b">.tif'))
    folder = write_solutions(tmp_path / "out", far, solutions, mesh_format="landxml", chosen=3, meshes=1)
    assert read_front(folder).meshes[0].endswith(".xml")
    root = ElementTree.parse(folder / "chosen.xml").getroot()
    assert root.tag == f"{LAND}LandXML"
    assert {"version", "date", "time"} <= set(root.attrib)
    (units,) = root.find(f"{LAND}Units")
    assert units.tag == LAND + system
    assert units.get("linearUnit") == linear
    assert {"areaUnit", "linearUnit", "volumeUnit", "temperatureUnit", "pressureUnit"} == set(units.attrib)
    coordinates = root.find(f"{LAND}CoordinateSystem")
    assert (coordinates.get("epsgCode"), coordinates.get("ogcWktCode")) == ("25832", 'PROJCS["a & b"]')
    surface = root.find(f"{LAND}Surfaces/{LAND}Surface")
    assert surface.get("name") == '<a & "b">'
    definition = surface.find(f"{LAND}Definition")
    assert definition.get("surfType") == "TIN"
    points = {int(p.get("id")): [float(word) for word in p.text.split()] for p in definition.find(f"{LAND}Pnts")}
    assert sorted(points) == list(range(1, len(points) + 1))
    vertices, faces, _ = mesh_arrays(far, solutions[1][3].faces)
    back = np.array([points[k + 1] for k in range(len(points))])[:, [1, 0, 2]]
    assert np.array_equal(back, vertices)  # to the last bit
    triangles = np.array([f.text.split() for f in definition.find(f"{LAND}Faces")], dtype=int)
    assert np.array_equal(triangles - 1, faces)
    assert float(definition.get("elevMax")) == vertices[:, 2].max()


def test_landxml_is_refused_where_the_height_is_not_z(tmp_path):
    roof = load("roof:5")
    model = build_model(SourceMesh(roof.points[:, [2, 0, 1]], roof.faces, {}, "turned"), up="x")
    surface, kept = HeightSurface(model), np.ones((1, model.n_vertices), dtype=bool)
    quality = [surface.simplify(kept[0]).quality]
    with pytest.raises(ResultError, match=r"turned: a LandXML surface has its heights along z, .* do not look up"):
        write_front(tmp_path / "out", surface, quality, kept, meshes=0, mesh_format="landxml")


def test_degrees_are_no_lengths_and_are_refused(tmp_path, model, solutions):
    there = dataclasses.replace(model, georeference={"unit": "degree", "scale": [71_000.0, 111_000.0]})
    with pytest.raises(ResultError, match=r"the unit of these is 'degree'; write another format, such as ply"):
        write_solutions(tmp_path / "out", there, solutions, mesh_format="landxml")
