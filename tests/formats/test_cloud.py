"""Points without faces: what is read, which triangles they get, what is refused."""

from __future__ import annotations

import struct
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.spatial import Delaunay

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.formats.table import read_source

UTM = np.array([412_345.125, 5_654_321.5, 120.0])


def scattered(n=400, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.random((n, 2)) * 50, rng.random(n) * 4]) + UTM


def as_sets(faces):
    return {frozenset(face) for face in np.asarray(faces).tolist()}


def areas(source):
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def test_the_triangles_are_delaunays_and_face_up():
    points = scattered()
    source = cloud_source(points)
    assert as_sets(source.faces) == as_sets(Delaunay(points[:, :2] - UTM[:2]).simplices)
    assert (areas(source) > 0).all()
    assert source.up == "z"
    assert_array_equal(source.points, points)


def test_keeping_all_points_gives_the_very_original():
    problem = MeshProblem(cloud_source(scattered()))
    error, triangles = problem.evaluate(np.ones(problem.n_var, dtype=bool))
    assert (error, triangles) == (0.0, len(problem.model.faces))


def test_a_grid_of_points_has_no_holes_and_no_slivers_whatever_its_place_and_angle():
    x, y = np.meshgrid(np.arange(12.0), np.arange(9.0))
    for angle in (0.0, 0.3):
        turned = np.column_stack([x.ravel() * np.cos(angle) - y.ravel() * np.sin(angle),
                                  x.ravel() * np.sin(angle) + y.ravel() * np.cos(angle)])  # fmt: skip
        source = cloud_source(np.column_stack([turned + UTM[:2], np.zeros(108)]))
        assert len(source.faces) == 2 * 11 * 8
        assert areas(source).sum() == pytest.approx(88)
        np.testing.assert_allclose(areas(source), 0.5, rtol=1e-6)


def test_of_points_at_one_place_the_lowest_stays_and_the_rest_is_counted():
    points = np.array([[0, 0, 5], [4, 0, 1], [4, 4, 1], [0, 4, 1], [0, 0, 2], [2, 2, 3], [0, 0, 9], [2, 2, 3.0]])
    with pytest.warns(ModelWarning, match=r"a: 3 of 8 points share their \(x, y\)") as caught:
        source = cloud_source(points, name="a", attributes={"tag": np.arange(8)})
    assert len(caught) == 1
    assert source.rows.tolist() in ([1, 2, 3, 4, 5], [1, 2, 3, 4, 7])
    assert_array_equal(source.points, points[source.rows])
    assert_array_equal(source.attributes["tag"], source.rows)
    assert len(source.faces) == 4
    assert source.georeference["same_place"] == 3


def test_long_edges_bridge_bays_and_holes_only_without_a_limit():
    for name in ("horseshoe:900", "ring:900"):
        outline = load(name)
        bridged = cloud_source(outline.points)
        assert areas(bridged).sum() > 1.1 * areas(outline).sum()
        a, b, c = (outline.points[outline.faces[:, k], :2] for k in range(3))
        usual = np.median(np.linalg.norm(np.concatenate([a - b, b - c, c - a]), axis=1))
        open_one = cloud_source(outline.points, max_edge=3 * usual)
        assert areas(open_one).sum() == pytest.approx(areas(outline).sum(), rel=0.03)
        a, b, c = (open_one.points[open_one.faces[:, k], :2] for k in range(3))
        assert np.linalg.norm(np.concatenate([a - b, b - c, c - a]), axis=1).max() <= 3 * usual
        assert as_sets(open_one.faces) < as_sets(bridged.faces)


def test_clouds_that_span_no_surface_are_refused():
    line = np.column_stack([np.arange(6.0), 2 * np.arange(6.0), np.arange(6.0) ** 2])
    for points, options, match in [
        (line, {}, "6 different places lie on one line"),
        (np.tile([1.0, 2.0, 3.0], (5, 1)), {}, "share one"),
        (scattered(3), {}, "at least 4"),
        (scattered(9) * [1, 1, np.nan], {}, "NaN"),
        (scattered(), {"max_edge": 1e-3}, "longer than 0.001 .*--max-edge"),
        (scattered(), {"max_edge": 0.0}, "positive"),
        (scattered(), {"max_edge": float("nan")}, "positive"),
    ]:
        with pytest.raises(ModelError, match=match):
            cloud_source(points, **options)


XYZ = [[0.5, 1.0, 2.0], [4.25, 0.0, 1.0], [4.0, 4.5, -1.0], [0.0, 4.0, 1e-3], [2.0, 2.0, 3.0]]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.xyz", "0.5 1 2\n4.25 0 1\n4 4.5 -1\n0 4 1e-3\n2 2 3\n"),
        ("a.XYZ", "\n\n  0.5\t1   2\r\n4.25 0 1\r\n\r\n4 4.5 -1\r\n0 4 1e-3\r\n2 2 3"),
        ("b.txt", "# made by hand\n0.5, 1, 2\n4.25,0 ,1\n4,4.5,-1 // high\n0,4,1e-3\n2,2,3\n"),
        ("c.csv", "0.5;1;2\n4.25;0;1\n4;4.5;-1\n0;4;1e-3\n2;2;3\n"),
        ("d.csv", "0,5;1;2\n4,25;0;1\n4;4,5;-1\n0;4;1e-3\n2;2;3\n"),
        ("e.txt", "0,5 1,0 2,0\n4,25 0 1\n4 4,5 -1\n0 4 1e-3\n2 2 3\n"),
        ("f.csv", "X,Y,Z\n0.5,1,2\n4.25,0,1\n4,4.5,-1\n0,4,1e-3\n2,2,3\n"),
        ("g.csv", '"id","z","x","y"\n7,2,0.5,1\n8,1,4.25,0\n9,-1,4,4.5\n10,1e-3,0,4\n11,3,2,2\n'),
        ("h.pts", "5\n0.5 1 2 7 1 2 3\n4.25 0 1 7 1 2 3\n4 4.5 -1 7 1 2 3\n0 4 1e-3 7 1 2 3\n2 2 3 7 1 2 3\n"),
        ("i.xyz", "\ufeff0.5 1 2\n4.25 0 1\n4 4.5 -1\n0 4 1e-3\n2 2 3\n"),
    ],
)
def test_text_is_read_whatever_stands_between_its_numbers(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text.encode())
    source = read_source(path)
    assert_array_equal(source.points, XYZ)
    assert len(source.faces) == 4


def test_colours_behind_the_coordinates_are_kept(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("\n".join(f"{x} {y} {z} {k} 200 255" for k, (x, y, z) in enumerate(XYZ)))
    assert_array_equal(read_source(path).attributes["color"][:, :3], [[k, 200, 255] for k in range(5)])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0 0 0\n1 0 0\n1 1 0\n0 1\n2 2 2\n", "the 4. line of numbers has 2, where the first has 3"),
        ("0 0\n1 0\n1 1\n0 1\n", "has 2, where 3 are needed"),
        ("0 0 0\n1 0 0\n1 x 0\n0 1 0\n", "'x' stands where a number should"),
        ("easting northing\n0 0\n", "neither holds numbers nor names"),
        ("0 0 0\n1 0 0\n1 1 0\n", "3 vertices"),
        ("# nothing\n", "0 vertices"),
        ("0 0 0\n1 0 inf\n1 1 0\n0 1 0\n", "1 of 4 vertices"),
        ("\0\0\0", "zero bytes"),
    ],
)
def test_text_that_is_no_cloud_is_refused_in_one_line(tmp_path, text, said):
    (tmp_path / "a.xyz").write_text(text)
    with pytest.raises(ModelError, match=said) as caught:
        read_source(tmp_path / "a.xyz")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "a.xyz"))


def test_a_pts_with_fewer_points_than_it_says_is_refused(tmp_path):
    (tmp_path / "a.pts").write_text("6\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 2\n")
    with pytest.raises(ModelError, match="declares 6 points, but 5 follow"):
        read_source(tmp_path / "a.pts")


def test_lines_are_compared_across_the_pieces_that_are_read_at_once(tmp_path, monkeypatch):
    from meshsimp_pymoo.formats import cloud

    points = scattered(300)
    lines = [" ".join(map(repr, row)) for row in points.tolist()]
    (tmp_path / "a.xyz").write_text("\n".join(lines))
    lines[271] += " 7"
    (tmp_path / "b.xyz").write_text("\n".join(lines))
    for size in (7, 100, 4096):
        monkeypatch.setattr(cloud, "CHUNK_BYTES", size)
        assert_array_equal(read_source(tmp_path / "a.xyz").points, points)
        with pytest.raises(ModelError, match=r"the 272\. line of numbers has 4, where the first has 3"):
            read_source(tmp_path / "b.xyz")


# ------------------------------------------------------------ LAS and LAZ


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
    source = read_source(las(name, points, kind=kind, version=version, fields=fields))
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


@pytest.mark.parametrize(("suffix", "module", "extra"), [("las", "laspy", "las"), ("tif", "rasterio", "geo")])
def test_a_missing_library_is_named_with_the_way_to_install_it(tmp_path, monkeypatch, suffix, module, extra):
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / f"a.{suffix}").write_bytes(b"LASF" + bytes(400))
    with pytest.raises(ModelError, match=rf"needs {module}; install it by pip install 'meshsimp-pymoo\[{extra}\]'"):
        read_source(tmp_path / f"a.{suffix}")


def test_the_limit_on_edges_is_for_clouds_alone(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((3, 3)))
    with pytest.raises(ModelError, match="max_edge is for point clouds"):
        read_source(tmp_path / "a.npy", max_edge=2.0)
    (tmp_path / "a.xyz").write_text("0 0 0\n1 0 0\n0 1 0\n1 1 1\n")
    with pytest.raises(ModelError, match="describe height grids"):
        read_source(tmp_path / "a.xyz", window=(0, 0, 2, 2))
