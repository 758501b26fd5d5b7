"""LAS and LAZ: coordinates, classes, colours, reference systems, and forgeries."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from clouds import as_sets, scattered
from numpy.testing import assert_array_equal

from meshsimp_pymoo.cli import main
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.formats.table import read_source


@pytest.fixture
def las(tmp_path):
    laspy = pytest.importorskip("laspy")

    def write(name, points, **options):
        header = laspy.LasHeader(point_format=options.get("kind", 3), version=options.get("version", "1.2"))
        header.scales, header.offsets = [0.001] * 3, np.floor(points.min(axis=0))
        for record in options.get("records", ()):
            header.vlrs.append(record)
        cloud = laspy.LasData(header)
        cloud.x, cloud.y, cloud.z = points.T
        for key, values in options.get("fields", {}).items():
            cloud[key] = values
        cloud.write(tmp_path / name)
        return tmp_path / name

    return write


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
@pytest.mark.parametrize(("kind", "version"), [(3, "1.2"), (7, "1.4")])
def test_las_and_laz_keep_coordinates_classes_and_colours(las, name, kind, version):
    points = np.round(scattered(), 3)
    n = len(points)
    fields = {"classification": np.arange(n) % 9, "intensity": np.arange(n), "red": np.arange(n) * 100}
    path = las(name, points, kind=kind, version=version, fields=fields)
    with pytest.warns(ModelWarning, match="45 of its points are ground"):
        source = read_source(path)
    np.testing.assert_allclose(source.points, points, rtol=0, atol=1e-9)
    assert_array_equal(source.attributes["classification"], fields["classification"])
    assert_array_equal(source.attributes["intensity"], fields["intensity"])
    assert_array_equal(source.attributes["color"][:, 0], fields["red"] >> 8)
    assert as_sets(source.faces) == as_sets(cloud_source(source.points).faces)
    assert source.georeference["scales"] == [0.001] * 3


def test_points_marked_as_withheld_are_left_out_and_counted(las):
    points = np.round(scattered(50), 3)
    withheld = np.arange(50) % 10 == 0
    path = las("a.las", points, fields={"withheld": withheld})
    with pytest.warns(ModelWarning, match="5 points are marked as withheld"):
        assert len(read_source(path).points) == 45


def test_the_reference_system_of_a_las_is_kept(las):
    from laspy.vlrs.known import GeoKeyDirectoryVlr, WktCoordinateSystemVlr

    path = las("a.las", scattered(9), kind=7, version="1.4", records=[WktCoordinateSystemVlr('PROJCS["x"]')])
    assert read_source(path).georeference["crs"] == 'PROJCS["x"]'
    keys = GeoKeyDirectoryVlr()
    keys.parse_record_data(struct.pack("<8H", 1, 1, 0, 1, 3072, 0, 1, 25832))
    assert read_source(las("b.las", scattered(9), records=[keys])).georeference["epsg"] == 25832


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_of_a_laser_scan_the_ground_is_taken_by_its_class(las, monkeypatch, name):
    from meshsimp_pymoo.formats import las as reader
    from meshsimp_pymoo.formats.source import points as clouds

    points = np.round(scattered(100), 3)
    ground = np.arange(100) % 4 == 0
    points[~ground, 2] += 20
    fields = {"classification": np.where(ground, 2, 5), "withheld": np.arange(100) == 8}
    path = las(name, points, fields=fields)
    monkeypatch.setattr(reader, "CHUNK_POINTS", 33)
    expected = np.flatnonzero(ground & (np.arange(100) != 8))
    with pytest.warns(ModelWarning, match="1 points are marked as withheld") as caught:
        source = read_source(path, Options(classes=[2]))
    assert len(caught) == 1
    np.testing.assert_allclose(source.points, points[expected], rtol=0, atol=1e-9)
    assert_array_equal(source.rows, expected)
    assert source.georeference["classes"] == {"2": 24, "5": 75}
    held = []
    with monkeypatch.context() as patch:
        patch.setattr(clouds, "read_cloud", lambda found, *_, **facts: held.append(len(found)) or source)
        with pytest.warns(ModelWarning, match="withheld"):
            read_source(path, Options(classes=[2]))
    assert held == [24]  # the others were never held together
    absent = r"has no points of class 9, but of 2 ground \(24\), 5 high vegetation \(75\); take some of these classes"
    with pytest.warns(ModelWarning), pytest.raises(ModelError, match=absent):
        read_source(path, Options(classes=9))


def test_info_says_which_classes_a_laser_scan_has(las, capsys):
    points = scattered(1300)
    path = las("a.las", points, fields={"classification": np.repeat([2, 9], [1200, 100])})
    assert main(["info", str(path), "--classes", "2"]) == 0
    assert "classes         2 ground (1,200), 9 water (100)\n" in capsys.readouterr().out
    assert main(["info", str(path), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["classes"] == {"2": 1200, "9": 100}
    assert "1,200 of its points are ground, others 9 water (100); all of them become surface" in said.err


@pytest.mark.parametrize(
    ("keys", "facts"),
    [
        ({1024: 2, 2048: 4326}, {"epsg": 4326, "unit": "degree"}),
        ({1024: 1, 2048: 4269, 3072: 2994, 3076: 9002}, {"epsg": 2994, "unit": "foot"}),
        ({1024: 1, 2048: 4326, 3072: 32767, 3076: 9001}, {"unit": "metre"}),  # its ellipsoid is no system of it
        ({1024: 3, 2048: 4326}, {}),
        ({2048: 4326}, {"epsg": 4326}),
    ],
)
@pytest.mark.filterwarnings("ignore:.*no latitudes in degrees")
def test_the_reference_system_of_a_las_says_its_unit(las, keys, facts):
    from laspy.vlrs.known import GeoKeyDirectoryVlr

    record = GeoKeyDirectoryVlr()
    entries = [part for key, value in keys.items() for part in (key, 0, 1, value)]
    record.parse_record_data(struct.pack(f"<{4 + len(entries)}H", 1, 1, 0, len(keys), *entries))
    found = read_source(las("a.las", scattered(9), records=[record])).georeference
    assert {key: found[key] for key in ("epsg", "unit") if key in found} == facts


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_a_las_that_declares_what_it_cannot_hold_is_refused_at_once(las, tmp_path, name):
    content = bytearray(las(name, scattered(40)).read_bytes())
    for place, value, said in [
        (107, 4_000_000_000, "declares 4000000000 points"),
        (96, 2_000_000_000, "from byte 2000000000 on"),
        (100, 4_000_000_000, "declares 4000000000 and 0 records"),
        (0, 0, "does not begin with 'LASF'"),
    ]:
        changed = content.copy()
        changed[place : place + 4] = struct.pack("<I", value)
        (tmp_path / name).write_bytes(changed)
        with pytest.raises(ModelError, match=said):
            read_source(tmp_path / name)
    for size in range(0, len(content), 23):
        (tmp_path / name).write_bytes(content[: size + 1])
        with pytest.raises(ModelError):
            read_source(tmp_path / name)


def test_a_laz_without_chunks_is_told_apart_from_a_damaged_one(las, tmp_path):
    content = las("a.laz", scattered(40)).read_bytes()
    at = content.index(b"laszip encoded") - 2 + 54
    (tmp_path / "b.laz").write_bytes(content[:at] + b"\1\0" + content[at + 2 :])
    with pytest.raises(ModelError, match="is packed in LASzip's first way, without chunks"):
        read_source(tmp_path / "b.laz")


def test_a_laz_whose_table_of_chunks_is_a_forgery_is_refused_before_it_is_allocated(las, tmp_path):
    content = bytearray(las("a.laz", scattered(40)).read_bytes())
    start = struct.unpack_from("<I", content, 96)[0]
    table = struct.unpack_from("<q", content, start)[0]
    content[table + 4 : table + 8] = struct.pack("<I", 0xF0000000)
    (tmp_path / "b.laz").write_bytes(content)
    with pytest.raises(ModelError, match="declares 4026531840 chunks"):
        read_source(tmp_path / "b.laz")
    content[start : start + 8] = struct.pack("<q", 1 << 40)
    (tmp_path / "b.laz").write_bytes(content)
    with pytest.raises(ModelError, match="table of its chunks at byte 1099511627776"):
        read_source(tmp_path / "b.laz")
