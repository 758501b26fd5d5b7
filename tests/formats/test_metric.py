"""The metric frame: how long a degree is, which files have degrees, and what users say of it."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.source.metric import DEGREE, WGS84, in_metric_frame, metres_per_radian
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.formats.table import read_source, write_mesh

GEOGCS = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]]'
)
GEOGCRS = (
    'GEOGCRS["NTF (Paris)",DATUM["x",ELLIPSOID["Clarke 1880 (IGN)",6378249.2,293.466021293627,LENGTHUNIT["metre",1]]],'
    'PRIMEM["Paris",2.5969213,ANGLEUNIT["grad",0.0157079632679489]],CS[ellipsoidal,2],'
    'AXIS["lat",north,ANGLEUNIT["grad",0.0157079632679489]],AXIS["lon",east,ANGLEUNIT["grad",0.0157079632679489]]]'
)
GEODCRS = GEOGCRS.replace("GEOGCRS", "GEODCRS")
PROJCS = f'PROJCS["some zone",{GEOGCS},PROJECTION["Transverse_Mercator"],UNIT["US survey foot",0.304800609601219]]'
FEET = f'COMPD_CS["x",{GEOGCS},VERT_CS["NAVD88 height (ft)",VERT_DATUM["x",2005],UNIT["foot",0.3048]]]'
METRES = FEET.replace('UNIT["foot",0.3048]', 'UNIT["metre",1]')
BOUND = f"BOUNDCRS[SOURCECRS[{PROJCS}],TARGETCRS[{GEOGCRS}]]"

LOW, HIGH = np.array([11.0, 46.9]), np.array([11.2, 47.1])


def facts_of(georeference, low=LOW, high=HIGH, scale=None):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return in_metric_frame(georeference, low, high, scale=scale, name="x")


def arc(latitude, ellipsoid=WGS84):
    """Return a degree of longitude and of latitude by integrating along the meridian's ellipse itself."""
    a, b = ellipsoid[0], ellipsoid[0] * (1 - 1 / ellipsoid[1])
    # the parametric latitude t of a geodetic one, and the arc of the ellipse (a cos t, b sin t)
    at = [math.atan2(b * math.sin(phi), a * math.cos(phi)) for phi in np.radians([latitude - 0.5, latitude + 0.5])]
    along = quad(lambda t: math.hypot(a * math.sin(t), b * math.cos(t)), *at)[0]
    middle = math.atan2(b * math.sin(math.radians(latitude)), a * math.cos(math.radians(latitude)))
    return a * math.cos(middle) * DEGREE, along


@given(st.floats(-89, 89))
def test_a_degree_is_as_long_as_its_arc_of_the_ellipsoid(latitude):
    found = [DEGREE * length for length in metres_per_radian(math.radians(latitude))]
    assert found == pytest.approx(arc(latitude), rel=1e-6)


def test_known_degrees():
    # WGS 84 at the equator, at 45 degrees and at a pole, where the radius is a / sqrt(1 - e^2) = 6 399 593.626 m
    for latitude, east, north in ((0, 111_319.491, 110_574.276), (45, 78_846.835, 111_131.778), (90, 0, 111_693.980)):
        found = [DEGREE * length for length in metres_per_radian(math.radians(latitude))]
        assert found == pytest.approx((east, north), abs=2e-2)
    assert metres_per_radian(1.0, (1000.0, 0.0)) == pytest.approx((1000 * math.cos(1.0), 1000.0))


@pytest.mark.parametrize(
    ("georeference", "unit"),
    [
        ({"crs": GEOGCS}, "degree"),
        ({"crs": GEOGCRS}, "grad"),
        ({"crs": GEODCRS}, "grad"),
        ({"crs": METRES}, "degree"),
        ({"epsg": 4326}, "degree"),
        ({"epsg": 7844}, "degree"),  # GDA 2020, far from the numbers of old
        ({"unit": "degree"}, "degree"),
    ],
)
def test_geographic_systems_are_known(georeference, unit):
    facts = facts_of(georeference)
    assert facts["unit"] == unit
    if unit == "degree":
        assert facts["scale"] == pytest.approx([76_056.3, 111_173.5], abs=20)
    else:  # 47 grads are 42.3 degrees
        ellipsoid = (6378249.2, 293.466021293627)
        assert facts["scale"] == pytest.approx([0.9 * length for length in arc(42.3, ellipsoid)], rel=1e-6)


@pytest.mark.parametrize("georeference", [{}, {"crs": PROJCS}, {"crs": BOUND}, {"epsg": 25832}, {"epsg": 2056}])
def test_other_systems_are_left_alone(georeference):
    facts = facts_of(georeference)
    assert "scale" not in facts
    assert facts.get("unit") == ("US survey foot" if "crs" in georeference else None)
    assert "scale" not in facts_of({"epsg": 4647}, LOW * 1e5, HIGH * 1e5)  # a projected one among the geographic


def test_heights_in_feet_get_a_plane_in_feet():
    metres, feet = facts_of({"crs": METRES}), facts_of({"crs": FEET})
    assert (metres["height_unit"], feet["height_unit"]) == ("metre", "foot")
    assert feet["scale"] == pytest.approx(np.array(metres["scale"]) / 0.3048)


def test_a_scale_is_said_in_one_line_with_what_was_taken_for_granted():
    with pytest.warns(ModelWarning) as caught:
        in_metric_frame({"epsg": 4326}, LOW, HIGH, scale=None, name="dem.tif")
    assert [str(warning.message) for warning in caught] == [
        "dem.tif: its coordinates are degrees; lengths are measured in metres, 76055.998 to a degree of longitude and "
        "111170.84 to one of latitude, as at latitude 47; heights are taken for metres; files keep their degrees "
        "(--scale none measures in these)"
    ]
    with pytest.warns(ModelWarning, match=r"longitude \(.* and .* at its edges: project it for more\) and"):
        in_metric_frame({"epsg": 4326}, np.array([0.0, 30]), np.array([20.0, 60]), scale=None, name="x")
    with pytest.warns(ModelWarning) as caught:
        in_metric_frame({"crs": METRES}, LOW, HIGH, scale=None, name="x")
    assert "taken for" not in str(caught[0].message)


def test_coordinates_that_are_no_latitudes_are_not_scaled():
    with pytest.warns(ModelWarning, match=r"y reaches from 4.69e\+06 to 4.71e\+06, which are no latitudes"):
        facts = in_metric_frame({"crs": GEOGCS}, LOW * 1e5, HIGH * 1e5, scale=None, name="x")
    assert "scale" not in facts
    with pytest.raises(ModelError, match="no latitudes in degrees; give the scale as SX,SY"):
        facts_of({}, LOW * 1e5, HIGH * 1e5, scale="degrees")


def test_the_user_is_right():
    assert facts_of({"crs": GEOGCS}, scale=(2.0, 3.0))["scale"] == [2.0, 3.0]
    assert "scale" not in facts_of({"crs": GEOGCS, "scale": [5, 5]}, scale=Options(scale="none").scale)
    assert facts_of({}, scale="degrees") == facts_of({"unit": "degree"})
    assert facts_of({"unit": "degree", "scale": [5, 5]})["scale"] == [5, 5]  # found out before, of a whole of this part


# ------------------------------------------------------------------------------------------------------ formats


def sheet(seed=0, n=60):
    rng = np.random.default_rng(seed)
    return np.column_stack([LOW + rng.random((n, 2)) * (HIGH - LOW), 300 * rng.random(n)])


def test_a_ply_s_comment_says_the_system_and_is_read_back(tmp_path):
    points = sheet()
    faces = cloud_source(points).faces
    for georeference in ({"epsg": 4326}, {"crs": GEOGCS}):
        write_mesh(tmp_path / "a.ply", points, faces, georeference=georeference)
        with pytest.warns(ModelWarning, match="its coordinates are degrees"):
            source = read_source(tmp_path / "a.ply")
        assert source.georeference.items() >= georeference.items()
        np.testing.assert_array_equal(source.points, points)
        np.testing.assert_array_equal(source.measured.points, points * [*source.georeference["scale"], 1])
    write_mesh(tmp_path / "b.ply", points, faces, georeference={"epsg": 25832})
    assert read_source(tmp_path / "b.ply").georeference == {"epsg": 25832}
    write_mesh(tmp_path / "c.ply", points, faces)
    assert read_source(tmp_path / "c.ply").georeference == {}


def test_a_cloud_is_triangulated_in_metres_and_its_longest_edge_is_one(tmp_path):
    points = sheet(n=200)
    points[:, 0] = LOW[0] + (points[:, 0] - LOW[0]) * 3  # long where a degree is short
    with pytest.warns(ModelWarning, match="degrees"):
        source = cloud_source(points, georeference={"epsg": 4258}, max_edge=4000)
    twin = cloud_source(source.measured.points, max_edge=4000)
    assert {frozenset(face) for face in source.faces.tolist()} == {frozenset(face) for face in twin.faces.tolist()}
    assert len(source.faces) > 150
    np.savetxt(tmp_path / "a.xyz", points, fmt="%.17g")
    with pytest.warns(ModelWarning) as caught:
        said = read_source(tmp_path / "a.xyz", Options(scale="degrees", max_edge=4000))
    assert len(caught) == 1
    np.testing.assert_array_equal(said.faces, source.faces)
    np.testing.assert_array_equal(said.points, points)


@pytest.mark.parametrize("kind", ["wkt", "keys"])
def test_las_in_degrees(tmp_path, kind):
    laspy = pytest.importorskip("laspy")
    points = np.round(sheet(), 7)
    header = laspy.LasHeader(point_format=6 if kind == "wkt" else 3, version="1.4" if kind == "wkt" else "1.2")
    header.scales, header.offsets = [1e-7, 1e-7, 1e-3], np.floor(points.min(axis=0))
    if kind == "wkt":
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(GEOGCS))
    else:
        keys = laspy.vlrs.known.GeoKeyDirectoryVlr()
        keys.parse_record_data(
            np.array([1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 4326, 4099, 0, 1, 9002], "<u2").tobytes()
        )
        header.vlrs.append(keys)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(tmp_path / "a.las")
    with pytest.warns(ModelWarning, match="its coordinates are degrees"):
        source = read_source(tmp_path / "a.las")
    assert source.georeference["unit"] == "degree"
    foot = 1 if kind == "wkt" else 0.3048
    assert np.array(source.georeference["scale"]) * foot == pytest.approx([76_056, 111_171], abs=150)
    assert source.georeference.get("height_unit") == (None if kind == "wkt" else "foot")


def test_a_mesh_in_memory_is_scaled_where_it_says_so():
    points = sheet()
    source = build_source(points, cloud_source(points).faces, georeference={"unit": "degree"})
    with pytest.warns(ModelWarning, match="degrees"):
        measured = source.in_frame(None).measured
    assert np.ptp(measured.points, axis=0)[:2] == pytest.approx([15_000, 22_000], rel=0.1)
    assert source.measured is source.in_frame((1.0, 1.0)) is source
