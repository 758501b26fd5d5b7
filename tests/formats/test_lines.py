"""Lines in files: what each format gives back, what it leaves out, and what of a mesh's lines others find."""

from __future__ import annotations

import json
import struct
import sys
from collections import Counter
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal
from pyramid import FACES, POINTS, write

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source.features import _parts
from meshsimp_pymoo.formats.source.lines import SourceLines, build_lines
from meshsimp_pymoo.formats.table import (
    WAYS_OUT,
    all_formats,
    format_of_output,
    line_suffixes,
    read_lines,
    read_source,
    write_lines,
    write_mesh,
)
from meshsimp_pymoo.plane.chains import chains

# A hard line far from the origin with heights that no float32 holds, and a soft one.
HARD = np.array([[500_000.1, 5_400_000.2, 3.3], [500_001.7, 5_400_001.1, 4.25], [500_003.0, 5_400_002.0, 1 / 3]])
SOFT = np.array([[1.5, 2.5], [3.25, 4.125]])
RING = np.array([[0.0, 0, 1], [2, 0, 2], [2, 2, 3], [0, 0, 1]])


def wkb(line: np.ndarray) -> bytes:
    number = 2 if line.shape[1] == 2 else 0x80000002
    return struct.pack("<BII", 1, number, len(line)) + line.astype("<f8").tobytes()


def features(path: Path, *layers: tuple[str, list[np.ndarray]], driver: str, crs: str = "EPSG:25832") -> Path:
    raw = pytest.importorskip("pyogrio.raw")
    for number, (layer, lines) in enumerate(layers):
        kind = "LineString" if lines[0].shape[1] == 2 else "LineString Z"
        names = np.array([f"{layer} {k}" for k in range(len(lines))], object)
        geometry = np.array([*map(wkb, lines), None], object)[:-1]
        options = {"layer": layer, "append": number > 0} if driver == "GPKG" else {}
        raw.write(path, geometry, [names], ["Name"], geometry_type=kind, crs=crs, driver=driver, **options)
    return path


def geojson(*geometries: dict, **more: object) -> str:
    found = [{"type": "Feature", "properties": {"name": f"n{k}"}, "geometry": g} for k, g in enumerate(geometries)]
    return json.dumps({"type": "FeatureCollection", "features": found} | more)


def line_string(line: np.ndarray) -> dict:
    return {"type": "LineString", "coordinates": line.tolist()}


def landxml(body: str, namespace: str = "http://www.landxml.org/schema/LandXML-1.0") -> str:
    return (
        f'<?xml version="1.0"?><LandXML xmlns="{namespace}"><Units><Imperial linearUnit="USSurveyFoot"/></Units>'
        f'<CoordinateSystem epsgCode="25832"/><Surfaces><Surface name="s">{body}</Surface></Surfaces></LandXML>'
    )


def northing_first(line: np.ndarray) -> str:
    return " ".join(repr(x) for row in line.tolist() for x in (row[1], row[0], *row[2:]))


def in_geojson(folder: Path) -> Path:
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    return write(folder, "a.geojson", geojson(line_string(HARD), line_string(SOFT), line_string(RING), crs=crs))


def in_obj(folder: Path) -> Path:
    points = np.concatenate([HARD, RING[:3]])
    rows = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    return write(folder, "a.obj", rows + "f 1 2 3\nl 1/1 2/2 3/1\nl -3 -2 -1 4\n")


def in_ply(folder: Path, order: str = "ascii", kind: str = "int") -> Path:
    points, edges = np.concatenate([RING[:3], HARD]), [[4, 3], [5, 4], [0, 1], [2, 1], [0, 2]]
    name = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {name} 1.0\ncomment crs: EPSG:25832\nelement vertex 6\nproperty double x\nproperty double y\n"
        f"property double z\nelement edge 5\nproperty {kind} vertex1\nproperty {kind} vertex2\nproperty uchar red\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    if order == "ascii":
        rows = [*([repr(x) for x in row] for row in points.tolist()), *([*map(str, e), "7"] for e in edges)]
        return write(folder, "a.ply", head + "\n".join(map(" ".join, rows)) + "\n3 0 1 2\n")
    code = {"int": "i", "uint": "I"}[kind]
    body = points.astype(f"{order}f8").tobytes() + b"".join(struct.pack(f"{order}2{code}B", *e, 7) for e in edges)
    return write(folder, "a.ply", head.encode() + body + struct.pack(f"{order}B3i", 3, 0, 1, 2))


def in_landxml(folder: Path) -> Path:
    lists = "".join(
        f'<Breakline name="b"><PntList{line.shape[1]}D>{northing_first(line)}</PntList{line.shape[1]}D></Breakline>'
        for line in (HARD, SOFT, RING)
    )
    return write(folder, "a.xml", landxml(f"<SourceData><Breaklines>{lists}</Breaklines></SourceData>"))


def in_shapefile(folder: Path) -> Path:
    return features(folder / "a.shp", ("a", [HARD, RING]), driver="ESRI Shapefile")


def in_geopackage(folder: Path) -> Path:
    return features(folder / "a.gpkg", ("ridges", [HARD, RING]), driver="GPKG")


def in_dxf(folder: Path, **options: str) -> Path:
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.new("R2000")
    space = drawing.modelspace()
    space.add_polyline3d(HARD.tolist(), dxfattribs={"layer": "ridge"})
    space.add_lwpolyline(SOFT.tolist())
    space.add_polyline3d(RING[:3].tolist(), close=True)
    drawing.saveas(folder / "a.dxf", **options)
    return folder / "a.dxf"


SYSTEM = {"epsg": 25832}
# What writes the lines above, which of them, and what of their reference system the file says.
KNOWN = {
    "geojson": (in_geojson, [HARD, SOFT, RING], SYSTEM),
    "obj": (in_obj, [HARD, RING], {}),
    "ply": (in_ply, [HARD, RING], SYSTEM),
    "ply, little-endian": (lambda folder: in_ply(folder, "<"), [HARD, RING], SYSTEM),
    "ply, big-endian": (lambda folder: in_ply(folder, ">", "uint"), [HARD, RING], SYSTEM),
    "landxml": (in_landxml, [HARD, SOFT, RING], SYSTEM | {"unit": "US survey foot"}),
    "shp": (in_shapefile, [HARD, RING], SYSTEM),
    "gpkg": (in_geopackage, [HARD, RING], SYSTEM),
    "dxf": (in_dxf, [HARD, SOFT, RING], {}),
    "dxf, binary": (lambda folder: in_dxf(folder, fmt="bin"), [HARD, SOFT, RING], {}),
}


def assert_same_lines(found: SourceLines, expected: list[np.ndarray]) -> None:
    assert len(found.lines) == len(found.names) == len(expected)
    for one, other in zip(found.lines, expected, strict=True):
        assert_array_equal(one, other)  # to the last bit


def refused(path: Path) -> str:
    with pytest.raises(ModelError) as caught:
        read_lines(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    return message


def test_every_format_that_is_read_has_a_known_answer():
    assert {name.partition(",")[0] for name in KNOWN} == {kind.name for kind in all_formats() if kind.read_lines}


@pytest.mark.filterwarnings("ignore:.*height 0 throughout")
@pytest.mark.parametrize("name", KNOWN)
def test_the_lines_of_a_file_are_read_to_the_last_bit(tmp_path, name):
    make, expected, facts = KNOWN[name]
    found = read_lines(make(tmp_path))
    assert_same_lines(found, expected)
    assert found.georeference == facts


@pytest.mark.parametrize("suffix", line_suffixes())
def test_nonsense_is_refused_in_one_line(tmp_path, suffix):
    refused(write(tmp_path, f"a{suffix}", b"\x00\xff nonsense; " * 9))
    refused(write(tmp_path, f"b{suffix}", b""))
    refused(tmp_path / f"missing{suffix}")


def test_of_another_suffix_it_is_said_which_are_known(tmp_path):
    message = refused(write(tmp_path, "a.kml", "<kml/>"))
    assert "'.kml'" in message
    assert all(suffix in message for suffix in line_suffixes())
    assert ".kml" in " ".join(suffixes for suffixes, _ in WAYS_OUT)


@pytest.mark.parametrize(("suffix", "module"), [("shp", "pyogrio"), ("gpkg", "pyogrio"), ("dxf", "ezdxf")])
def test_a_missing_library_is_named_with_the_way_to_install_it(tmp_path, monkeypatch, suffix, module):
    monkeypatch.setitem(sys.modules, module, None)
    assert f"needs {module}; install it by pip install" in refused(write(tmp_path, f"a.{suffix}", b"1"))


def test_lines_must_be_finite_and_more_than_one_place():
    with pytest.warns(ModelWarning, match=r"a: 2 lines that are one place, 3 points are left out"):
        found = build_lines("a", [SOFT, SOFT[:1], SOFT[[0, 0]]], ["x", "y", "z"], others={"points": 3, "curves": 0})
    assert found.names == ("x",)
    for bad in (np.nan, np.inf, 1e76):
        with pytest.raises(ModelError, match=r"a: x has 1 of 2 vertices that are NaN.*first: vertex 1 at"):
            build_lines("a", [[[0, 0], [1, bad]]], ["x"])
    with pytest.raises(ModelError, match=r"a: holds no lines \(but 1 points\)"):
        build_lines("a", [], [], others={"points": 1})


def test_chains_part_at_junctions_whatever_the_order_of_the_edges():
    edges = np.array([[0, 1], [1, 2], [1, 3], [3, 4], [5, 6], [6, 7], [7, 5], [2, 2], [1, 0]])
    expected = [chain.tolist() for chain in chains(edges)]
    assert expected == [[0, 1], [1, 2], [1, 3, 4], [5, 6, 7, 5]]
    rng = np.random.default_rng(1)
    for _ in range(20):
        mixed = np.where(rng.random((len(edges), 1)) < 0.5, edges, edges[:, ::-1])[rng.permutation(len(edges))]
        assert [chain.tolist() for chain in chains(mixed)] == expected
    edges = rng.integers(0, 40, (60, 2))
    steps = [np.sort(np.column_stack([chain[:-1], chain[1:]]), axis=1) for chain in chains(edges)]
    wanted = np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1)
    assert_array_equal(np.unique(wanted, axis=0), sorted(np.concatenate(steps).tolist()))  # each edge once


# ------------------------------------------------------------------------------------------------------------ GeoJSON


def test_geojson_of_any_depth_gives_lines_and_rings_and_counts_the_points(tmp_path):
    several = {"type": "MultiLineString", "coordinates": [HARD.tolist(), RING.tolist()]}
    area = {"type": "MultiPolygon", "coordinates": [[RING.tolist(), (RING[:3] + 1).tolist()]]}
    dots = {"type": "MultiPoint", "coordinates": SOFT.tolist()}
    nested = {"type": "GeometryCollection", "geometries": [line_string(SOFT), dots, several]}
    path = write(tmp_path, "a.json", "\ufeff" + geojson(nested, area, {"type": "Point", "coordinates": [1, 2]}, None))
    with pytest.warns(ModelWarning, match=r"a\.json: 1 features without a geometry, 3 points are left out"):
        found = read_lines(path)
    assert_same_lines(found, [SOFT, HARD, RING, RING, (RING[:3] + 1)[[0, 1, 2, 0]]])
    assert found.names[0] == "feature 1 (n0), part 1"
    assert found.names[-1] == "feature 2 (n1), part 2"
    assert found.georeference == {}
    assert_same_lines(read_lines(write(tmp_path, "b.json", json.dumps(line_string(SOFT)))), [SOFT])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            geojson({"type": "LineString", "coordinates": [[0, 0, 1], [1, 1], [2, 2, 2]]}),
            r"1 of 3 positions of feature 1 \(n0\) have no height \(first: position 1\)",
        ),
        (geojson({"type": "LineString", "coordinates": [[0], [1]]}), "has fewer than two numbers"),
        (geojson({"type": "LineString", "coordinates": [[0, "1"], [1, 2]]}), "stands where a number should"),
        (geojson({"type": "LineString", "coordinates": [[0, True], [1, 2]]}), "stands where a number should"),
        (geojson({"type": "LineString", "coordinates": [[0, float("nan")], [1, 2]]}), "NaN is no number of JSON"),
        (geojson({"type": "LineString", "coordinates": [[0, 10**400], [1, 2]]}), "cannot be read as GeoJSON"),
        (geojson({"type": "Topology"}), "'Topology' is no geometry of GeoJSON"),
        (geojson({"type": "Point", "coordinates": [0, 0]}), r"holds no lines \(but 1 points\)"),
        ("[" * 200_000, "cannot be read as GeoJSON"),
        ("[]", "cannot be read as GeoJSON"),
    ],
)
def test_geojson_that_is_no_lines_is_refused(tmp_path, content, said):
    with pytest.raises(ModelError, match=said):
        read_lines(write(tmp_path, "a.json", content))


@pytest.mark.parametrize(
    ("spelled", "facts"),
    [
        ("EPSG:25832", {"epsg": 25832}),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", {"epsg": 4326, "unit": "degree"}),
        ("local", {}),
    ],
)
def test_a_crs_member_is_read(tmp_path, spelled, facts):
    crs = {"type": "name", "properties": {"name": spelled}}
    path = write(tmp_path, "a.json", geojson(line_string(SOFT), crs=crs))
    assert read_lines(path).georeference == facts


def test_a_number_that_only_the_text_of_a_reference_system_says_is_written_too(tmp_path):
    """Without it GDAL takes a GeoJSON for degrees."""
    text = 'PROJCS["ETRS89 / UTM zone 32N",PARAMETER["central_meridian",9],AUTHORITY["EPSG","25832"]]'
    write_lines(tmp_path / "a.geojson", SourceLines("a", (HARD,), ("line 1",), {"crs": text}))
    assert read_lines(tmp_path / "a.geojson").georeference == {"epsg": 25832}


@pytest.mark.parametrize("suffix", ["geojson", "xml"])
def test_names_of_lines_do_not_grow_from_file_to_file(tmp_path, suffix):
    def written(path, lines):
        if suffix == "geojson":
            write_lines(path, lines)
        else:
            write_mesh(path, POINTS, FACES, lines=CHAINS, line_names=lines.names)
        return read_lines(path)

    first = SourceLines("a", (HARD, SOFT), ("feature 7 (kerb (left))", "polyline #2F (layer toes)"))
    again = written(tmp_path / f"a.{suffix}", first)
    kind = {"geojson": "feature", "xml": "break line"}[suffix]
    assert again.names == (f"{kind} 1 (kerb (left))", f"{kind} 2 (layer toes)")
    assert written(tmp_path / f"b.{suffix}", again).names == again.names
    assert b"break line 1" not in (tmp_path / f"b.{suffix}").read_bytes()


def test_geojson_is_written_and_read_back_by_gdal_and_here(tmp_path):
    lines = SourceLines("a", (HARD, SOFT), ("line 1", 'M\u00fchle "a"'), SYSTEM)
    write_lines(tmp_path / "a.geojson", lines)
    found = read_lines(tmp_path / "a.geojson")
    assert_same_lines(found, [HARD, SOFT])
    assert found.names == ("feature 1 (line 1)", 'feature 2 (M\u00fchle "a")')
    assert found.georeference == SYSTEM
    with pytest.raises(ValueError, match=r"no lines are written in such a file; write one of \.geojson, \.json"):
        write_lines(tmp_path / "a.shp", lines)
    pyogrio = pytest.importorskip("pyogrio")
    facts, _, geometry, fields = pyogrio.raw.read(tmp_path / "a.geojson")
    assert facts["crs"] == "EPSG:25832"
    assert [bytes(found) for found in geometry] == [wkb(HARD), wkb(SOFT)]
    assert fields[0].tolist() == [*lines.names]


# --------------------------------------------------------------------------------------------------- OBJ, PLY, LandXML

CHAINS = (np.array([0, 4, 2]), np.array([4, 1]))


# What is read of the lines of a mesh: their names, and what is said to be left out.
LINES_READ = {
    "obj": (("line 1", "line 2"), None),
    "xml": (("break line 1 (<a & b>)", "break line 2 (c)"), None),
    "dxf": (("POLYLINE #31 (layer BREAKLINES)", "POLYLINE #36 (layer BREAKLINES)"), "4 entities 3DFACE are left out"),
    "geojson": (("feature 5 (<a & b>)", "feature 6 (c)"), "4 triangles are left out"),
    "gpkg": (("break_lines feature 1 (<a & b>)", "break_lines feature 2 (c)"), "4 triangles are left out"),
}


@pytest.mark.parametrize("suffix", LINES_READ)
def test_lines_of_a_mesh_are_read_back(tmp_path, suffix):
    if needed := format_of_output(f"a.{suffix}").needs:
        pytest.importorskip(needed)
    write_mesh(tmp_path / f"a.{suffix}", POINTS, FACES, lines=CHAINS, line_names=["<a & b>", "c"])
    names, said = LINES_READ[suffix]
    with pytest.warns(ModelWarning, match=said) if said else nullcontext():
        found = read_lines(tmp_path / f"a.{suffix}")
    assert_same_lines(found, [POINTS[chain] for chain in CHAINS])
    assert found.names == names


def test_lines_of_a_ply_are_read_back_parted_at_their_junction(tmp_path):
    write_mesh(tmp_path / "a.ply", POINTS, FACES, lines=CHAINS)
    found = read_lines(tmp_path / "a.ply")
    assert_same_lines(found, [POINTS[[0, 4]], POINTS[[1, 4]], POINTS[[2, 4]]])


@pytest.mark.parametrize("kind", [kind for kind in all_formats() if kind.write], ids=lambda kind: kind.name)
def test_lines_change_the_bytes_of_the_formats_that_hold_them_alone(tmp_path, kind):
    for name, lines in (("a", CHAINS), ("b", ())):
        write_mesh(tmp_path / f"{name}{kind.suffix}", POINTS, FACES, lines=lines)
    with_lines, without = ((tmp_path / f"{name}{kind.suffix}").read_bytes() for name in "ab")
    assert (with_lines != without) == kind.holds_lines
    assert b"edge" not in without
    assert b"\nl " not in without
    assert b"Breakline" not in without


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_mesh_programs_open_a_mesh_with_lines(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    write_mesh(path, POINTS, FACES, lines=CHAINS)
    with pytest.warns(ModelWarning, match=r"stay behind; --break-lines takes"):
        assert_array_equal(read_source(path).faces, FACES)
    mesh = trimesh.load(path, process=False, force="mesh")
    assert_array_equal(mesh.faces, FACES)
    assert_array_equal(mesh.vertices, POINTS)
    pymeshlab = pytest.importorskip("pymeshlab", exc_type=ImportError)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    assert meshes.current_mesh().face_number() == len(FACES)
    if suffix == "ply":
        assert meshes.current_mesh().edge_number() == 3


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.obj", "v 0 0 0\nv 1 1 1\nl 1 3\n", r"line 1 names the vertex 3, which does not exist \(of 2, from 1\)"),
        ("a.obj", "v 0 0 0\nv 1 1 1\nl 0 1\n", "line 1 names the vertex 0"),
        ("a.obj", "v 0 0 0\nv 1 1 1\nl -3 1\n", "line 1 names the vertex -3"),
        ("a.obj", "v 0 0 0\nv 1 1 1\nf 1 2 1\n", "has no line 'l' of an OBJ"),
        ("a.xml", "<a/>", "is XML, but no LandXML"),
        ("a.xml", landxml("<Breakline><PntList3D>1 2 3 4</PntList3D></Breakline>"), "has 4 numbers, which are no 3"),
        ("a.xml", landxml("<Contour><PntList2D>1 2 3 4</PntList2D></Contour>"), r"no lines \(but 1 contours\)"),
        ("a.xml", '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares a document type"),
        ("a.shp", "SQLite", "is no .shp file"),
    ],
)
def test_what_is_no_line_is_refused(tmp_path, name, content, said):
    pytest.importorskip("pyogrio")
    with pytest.raises(ModelError, match=said):
        read_lines(write(tmp_path, name, content))


def test_an_edge_of_a_ply_that_names_no_vertex_is_refused(tmp_path):
    path = in_ply(tmp_path)
    path.write_text(path.read_text().replace("\n2 1 7", "\n2 6 7"))
    assert "1 of 5 edges name vertices that do not exist (first: edge 3, (2, 6), of 6 vertices)" in refused(path)
    write_mesh(tmp_path / "b.ply", POINTS, FACES)
    assert "has no element 'edge' with vertex1 and vertex2 (but ['face', 'vertex'])" in refused(tmp_path / "b.ply")


# ------------------------------------------------------------------------------------------- Shapefile, GeoPackage, DXF


def test_the_layers_of_a_geopackage_are_taken_together_and_said(tmp_path):
    layers = ("ridges", [HARD]), ("rivers", [SOFT])
    path = features(tmp_path / "a.gpkg", *layers, driver="GPKG")
    with pytest.warns(ModelWarning, match=r"lines of 2 layers are taken together: 1 of 'ridges', 1 of 'rivers'"):
        found = read_lines(path)
    assert_same_lines(found, [HARD, SOFT])
    assert found.names == ("ridges feature 1 (ridges 0)", "rivers feature 1 (rivers 0)")


@pytest.mark.parametrize("number", [1002, 0x80000002])
def test_heights_in_well_known_binary_are_found_in_both_spellings(number):
    pieces = struct.pack(">BII", 0, number, len(HARD)) + HARD.astype(">f8").tobytes()
    point = struct.pack("<BI3d", 1, number - 1, 1, 2, 3)
    others: Counter[str] = Counter()
    found = list(_parts(struct.pack("<BII", 1, number + 5, 2) + point + pieces, others))
    assert_same_lines(SourceLines("a", tuple(found), ("x",)), [HARD])
    assert others == {"points": 1}


def test_layers_in_two_reference_systems_are_refused(tmp_path):
    raw = pytest.importorskip("pyogrio.raw")
    path = features(tmp_path / "a.gpkg", ("ridges", [SOFT]), driver="GPKG")
    more = {"geometry_type": "LineString", "driver": "GPKG", "layer": "rivers", "append": True}
    raw.write(path, np.array([wkb(SOFT), None], object)[:1], [], [], crs="EPSG:31467", **more)
    assert "different reference systems (ridges: EPSG:25832, rivers: EPSG:31467)" in refused(path)


def test_a_shapefile_without_what_belongs_to_it_says_what_is_missing(tmp_path):
    path = in_shapefile(tmp_path)
    path.with_suffix(".shx").unlink()
    assert "copy it again with the files beside it (.shx, .dbf, .prj)" in refused(path)


def test_of_a_drawing_lines_with_their_elevation_are_read_and_the_rest_is_counted(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.new("R2000")
    space = drawing.modelspace()
    space.add_line((1, 2, 3), (4, 5, 6), dxfattribs={"layer": "kerb"})
    space.add_lwpolyline(SOFT.tolist(), dxfattribs={"elevation": 7})
    space.add_polyline2d([(0, 0), (1, 0), (1, 1)], close=True, dxfattribs={"elevation": (0, 0, 4)})
    space.add_lwpolyline([(0, 0, 1), (2, 0, 0)], format="xyb")  # half a circle about (1, 0)
    drawing.blocks.new("tree").add_line((0, 0), (1, 1))
    space.add_blockref("tree", (5, 5, 5))
    space.add_circle((0, 0, 0), 1)
    drawing.saveas(tmp_path / "a.dxf")
    with pytest.warns(ModelWarning) as caught:
        found = read_lines(tmp_path / "a.dxf")
    said = [str(warning.message).removeprefix(f"{tmp_path / 'a.dxf'}: ") for warning in caught]
    assert said == [
        "1 entities CIRCLE, 1 placed blocks are left out",
        "1 of 4 lines have height 0 throughout and are taken without heights: they take the surface's",
    ]
    assert found.names[0].startswith("LINE #")
    assert found.names[0].endswith("(layer kerb)")
    *straight, arc = found.lines
    assert straight[0].tolist() == [[1, 2, 3], [4, 5, 6]]
    assert straight[1].tolist() == [[*place, 7] for place in SOFT.tolist()]
    assert straight[2].tolist() == [[0, 0, 4], [1, 0, 4], [1, 1, 4], [0, 0, 4]]
    assert arc.shape[1] == 2
    middles = (arc[:-1] + arc[1:]) / 2
    assert np.abs(np.hypot(*(arc - [1, 0]).T) - 1).max() < 1e-3
    assert np.abs(np.hypot(*(middles - [1, 0]).T) - 1).max() < 1e-3
    assert arc[:, 1].min() < -0.99
