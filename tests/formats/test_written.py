"""What formats that are written alone say beside the triangles: lines, layers, units, systems, attributes."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import qgis
from pyramid import COLORS, FACES, POINTS

from meshsimp_pymoo.errors import ModelWarning, ResultError
from meshsimp_pymoo.formats.table import write_mesh, written_formats
from meshsimp_pymoo.opening import open_model

SYSTEM = {"epsg": 25832, "unit": "metre"}
LONG = np.array([0, 1, 2, 3, 0, 4, 1, 0, 3, 2, 4, 3])
CHAINS, NAMES = (LONG, np.array([4, 1])), ("feature 1 (Mühle <a & b>)", "line 2")
CALLED = ["Mühle <a & b>", "line 2"]
ATTRIBUTES = {
    "color": COLORS,
    "uv": np.arange(10.0).reshape(5, 2),
    "seen": np.array([True, False, True, True, False]),
    "half": np.arange(5, dtype=np.float16),
    "big": np.arange(5) * 10**9,
    "two words": np.arange(5, dtype=np.uint16),
}


def written(folder: Path, suffix: str, lines: bool = True, **more: Any) -> Path:
    """Return a file of the pyramid."""
    kind = next(kind for kind in written_formats().values() if suffix in kind.suffixes)
    if kind.needs:
        pytest.importorskip(kind.needs)
    path = folder / f"a{suffix}"
    look = {"georeference": SYSTEM, "name": 'a "hill"'} | more
    write_mesh(path, POINTS, FACES, **({"lines": CHAINS, "line_names": NAMES} if lines else {}), **look)
    return path


# ------------------------------------------------------------------------------------------------------------- 2DM


def test_a_2dm_is_cards_that_number_from_one(tmp_path):
    cards = [line.split() for line in written(tmp_path, ".2dm").read_text(encoding="utf-8").splitlines()]
    assert cards[0] == ["MESH2D"]
    assert cards[1] == ["MESHNAME", '"a', "'hill'\""]
    assert [[float(x) for x in card[2:]] for card in cards if card[0] == "ND"] == POINTS.tolist()
    assert [[int(k) for k in card[1:]] for card in cards if card[0] == "E3T"] == [
        [number, *(face + 1).tolist(), 1] for number, face in enumerate(FACES, start=1)
    ]
    strings = [[int(k) for k in card[1:]] for card in cards if card[0] == "NS"]
    assert [len(numbers) for numbers in strings] == [10, 2, 2]
    assert [number for numbers in strings for number in numbers] == [*(LONG[:-1] + 1).tolist(), -4, 5, -2]


def test_qgis_opens_what_has_lines_too(tmp_path):
    paths = {suffix: written(tmp_path, suffix) for suffix in (".2dm", ".geojson", ".gpkg", ".dxf")}
    lines = f"{paths['.gpkg']}|layername=break_lines"
    found = qgis.opened(
        ("mesh", paths[".2dm"]),
        *(("features", paths[name]) for name in (".geojson", ".gpkg", ".dxf")),
        ("features", lines),
    )
    assert np.array_equal(np.array(found[str(paths[".2dm"])]["points"]), POINTS)
    assert found[str(paths[".2dm"])]["faces"] == FACES.tolist()
    for suffix in (".geojson", ".dxf"):
        assert found[str(paths[suffix])]["sorts"] == ["PolygonZ"] * 4 + ["LineStringZ"] * 2
        assert found[str(paths[suffix])]["points"][4] == POINTS[LONG].tolist()
    assert found[str(paths[".gpkg"])]["sorts"] == ["PolygonZ"] * 4
    assert found[lines]["points"] == [POINTS[chain].tolist() for chain in CHAINS]
    assert [found[lines]["crs"], [values[1] for values in found[lines]["values"]]] == ["EPSG:25832", CALLED]


# ------------------------------------------------------------------------------------------------------------- DXF


@pytest.mark.parametrize(
    ("facts", "units"),
    [
        ({"unit": "metre"}, 6),
        ({"unit": "kilometre"}, 7),
        ({"unit": "foot"}, 2),
        ({"unit": "US survey foot"}, 21),
        ({"unit": "degree"}, 0),
        ({}, 0),
    ],
)
def test_a_drawing_says_its_units_and_has_its_lines_in_a_layer_of_their_own(tmp_path, facts, units):
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.readfile(written(tmp_path, ".dxf", georeference=facts))
    assert (drawing.dxfversion, drawing.units) == ("AC1015", units)
    space = drawing.modelspace()
    assert [entity.dxf.layer for entity in space.query("3DFACE")] == ["TIN"] * 4
    lines = space.query("POLYLINE")
    assert [entity.dxf.layer for entity in lines] == ["BREAKLINES"] * 2
    assert all(line.is_3d_polyline for line in lines)
    assert [[tuple(place) for place in line.points()] for line in lines] == [
        [tuple(place) for place in POINTS[chain].tolist()] for chain in CHAINS
    ]
    assert {"TIN", "BREAKLINES"} <= {layer.dxf.name for layer in drawing.layers}
    handles = [entity.dxf.handle for entity in drawing.entitydb.values()]
    assert len({*handles}) == len(handles)
    assert max(int(handle, 16) for handle in handles) < int(drawing.header["$HANDSEED"], 16)
    assert [*drawing.header["$EXTMIN"], *drawing.header["$EXTMAX"]] == [*POINTS.min(axis=0), *POINTS.max(axis=0)]


def test_a_drawing_without_lines_has_no_layer_for_them_and_what_users_set_stays(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.readfile(written(tmp_path, ".dxf", lines=False))
    assert "BREAKLINES" not in {layer.dxf.name for layer in drawing.layers}
    assert not ezdxf.options.write_fixed_meta_data_for_testing


# ------------------------------------------------------------------------------------------- GeoPackage and GeoJSON


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
@pytest.mark.parametrize(
    ("facts", "system", "scale"),
    [
        (SYSTEM, "EPSG:25832", (1.0, 1.0)),
        ({}, None, (1.0, 1.0)),
        ({"epsg": 4326, "unit": "degree", "scale": [0.5, 3.0]}, "EPSG:4326", (0.5, 3.0)),
    ],
)
def test_features_say_number_height_slope_and_the_reference_system(tmp_path, suffix, facts, system, scale):
    raw = pytest.importorskip("pyogrio.raw")
    path = written(tmp_path, suffix, lines=False, georeference=facts)
    about, _, _, columns = raw.read(path)
    if system is None and suffix == ".geojson":  # then it is WGS 84 to GDAL, as the format's later edition has it
        assert about["crs"] in ("EPSG:4326", "EPSG:4979")
    else:
        assert about["crs"] == system
    said = dict(zip(about["fields"], columns, strict=True))
    assert [*said] == ["triangle", "height", "slope"]
    assert said["triangle"].tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(said["height"], POINTS[FACES][:, :, 2].mean(axis=1), rtol=1e-15)
    for face, slope in zip(FACES, said["slope"], strict=True):
        x, y, z = (POINTS[face] * [*scale, 1.0]).T
        a, b, _ = np.linalg.solve(np.column_stack([x, y, np.ones(3)]), z)  # z = a x + b y + c
        assert slope == pytest.approx(np.degrees(np.arctan(np.hypot(a, b))), rel=1e-10)
    if suffix == ".geojson":
        assert ("crs" in json.loads(path.read_text(encoding="utf-8"))) == (system is not None)


def test_a_geojson_winds_its_rings_as_the_format_wants_and_names_its_lines(tmp_path):
    features = json.loads(written(tmp_path, ".geojson").read_text(encoding="utf-8"))["features"]
    for feature, face in zip(features, FACES, strict=False):
        (ring,) = feature["geometry"]["coordinates"]
        assert ring == POINTS[[*face, face[0]]].tolist()
    assert [feature["properties"] for feature in features[4:]] == [{"name": name} for name in CALLED]


def test_a_geopackage_has_a_layer_of_lines_with_their_names_in_the_same_system(tmp_path):
    raw = pytest.importorskip("pyogrio.raw")
    path = written(tmp_path, ".gpkg")
    about, _, geometries, (names,) = raw.read(path, layer="break_lines")
    assert (about["crs"], about["geometry_type"], names.tolist()) == ("EPSG:25832", "LineString Z", CALLED)
    assert [np.frombuffer(line, "<f8", offset=9).reshape(-1, 3).tolist() for line in geometries] == [
        POINTS[chain].tolist() for chain in CHAINS
    ]


def test_a_system_that_gdal_does_not_know_is_left_out_and_said(tmp_path):
    pyogrio = pytest.importorskip("pyogrio")
    with pytest.warns(ModelWarning, match=r"a\.gpkg: holds no reference system, as GDAL does not know it \(.*a & b"):
        path = written(tmp_path, ".gpkg", georeference={"crs": 'PROJCS["a & b"]'})
    assert pyogrio.read_info(path, layer="tin")["crs"] is None
    assert pyogrio.read_info(path, layer="break_lines")["features"] == 2


@pytest.mark.parametrize("date", [None, "2001-02-03T04:05:06Z"])
def test_the_date_that_a_user_told_gdal_stays(tmp_path, date):
    pyogrio = pytest.importorskip("pyogrio")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": date})
    try:
        written(tmp_path, ".gpkg")
        assert pyogrio.get_gdal_config_option("OGR_CURRENT_DATE") == date
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})


def test_a_system_of_text_alone_is_written_to_a_geopackage(tmp_path):
    pyogrio = pytest.importorskip("pyogrio")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        text = pyogrio.read_info(written(tmp_path, ".gpkg"), layer="tin")["crs"]
        assert text == "EPSG:25832"
    local = 'LOCAL_CS["quarry",UNIT["metre",1]]'
    found = pyogrio.read_info(written(tmp_path, ".gpkg", georeference={"crs": local}), layer="tin")["crs"]
    assert "quarry" in found


# ------------------------------------------------------------------------------------------------------- VTU and VTK


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_paraview_finds_lines_attributes_and_what_is_known_of_the_coordinates(tmp_path, suffix):
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.read(written(tmp_path, suffix, attributes=ATTRIBUTES))
    assert grid.points.dtype == np.float64
    assert [grid.get_cell(k).point_ids for k in range(4)] == FACES.tolist()
    edges = [pair for chain in CHAINS for pair in zip(chain[:-1].tolist(), chain[1:].tolist(), strict=True)]
    assert [tuple(grid.get_cell(k).point_ids) for k in range(4, grid.n_cells)] == edges
    assert grid.cell_data["break_line"].tolist() == [0] * 4 + [1] * 11 + [2]
    for name, values in ATTRIBUTES.items():
        found = grid.point_data[name.replace(" ", "_")]
        assert found.shape == values.shape
        np.testing.assert_array_equal(found, values)
    assert grid.point_data["color"].dtype == np.uint8
    assert (grid.field_data["epsg"].tolist(), grid.field_data["metres_per_unit"].tolist()) == ([25832], [1.0])
    if suffix == ".vtu":  # drawn in its colours at once
        assert grid.GetPointData().GetScalars().GetName() == "color"
        assert grid.GetPointData().GetTCoords().GetName() == "uv"


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_meshio_finds_lines_and_attributes(tmp_path, suffix):
    meshio = pytest.importorskip("meshio")
    mesh = meshio.read(written(tmp_path, suffix, attributes=ATTRIBUTES))
    assert [(block.type, len(block)) for block in mesh.cells] == [("triangle", 4), ("line", 12)]
    assert np.array_equal(mesh.points, POINTS)
    for name, values in ATTRIBUTES.items():
        np.testing.assert_array_equal(mesh.point_data[name.replace(" ", "_")].reshape(values.shape), values)
    assert [part.tolist() for part in mesh.cell_data["break_line"]] == [[0] * 4, [1] * 11 + [2]]


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_nothing_is_said_that_is_not_known(tmp_path, suffix):
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.read(written(tmp_path, suffix, lines=False, georeference={}))
    assert (grid.n_cells, [*grid.point_data], [*grid.cell_data], [*grid.field_data]) == (4, [], [], [])


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_what_is_no_number_does_not_fit(tmp_path, suffix):
    with pytest.raises(ValueError, match=r"attribute 'word' of type <U1 .* is nothing for VTK"):
        written(tmp_path, suffix, attributes={"word": np.array([*"abcde"])})


# --------------------------------------------------------------------------------------------- what cannot be written


@pytest.mark.parametrize("name", [kind.name for kind in written_formats().values() if kind.one_height])
def test_a_surface_that_turns_over_is_refused_where_each_place_has_one_height(name):
    kind = written_formats()[name]
    with pytest.raises(ResultError, match=rf"blob:200: a {kind.title} surface has its heights along z, and \d+ of 396"):
        kind.check(open_model("blob:200"))
    kind.check(open_model("roof:5"))
