"""PLY: every row, number and attribute, and every kind of damage."""

from __future__ import annotations

import dataclasses
import struct
import tracemalloc

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_array_equal
from pyramid import COLORS, FACES, HEADER, LABEL, POINTS, QUALITY, UV, ascii_ply, binary_ply, picture, refusal, write
from samples import coloured, write_solutions

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.table import read_source, write_mesh
from meshsimp_pymoo.storage import read_front
from meshsimp_pymoo.surface.model import build_model


@pytest.mark.parametrize("kind", ["ascii", "<", ">"])
def test_a_ply_keeps_rows_doubles_colours_and_other_properties(tmp_path, kind):
    source = read_source(write(tmp_path, "a.ply", ascii_ply() if kind == "ascii" else binary_ply(kind)))
    assert_array_equal(source.points, POINTS)
    assert_array_equal(source.faces, FACES)
    assert source.points.dtype == np.float64
    assert source.faces.dtype == np.int64
    assert sorted(source.attributes) == ["color", "label", "quality"]
    assert_array_equal(source.attributes["color"], COLORS)
    assert_array_equal(source.attributes["quality"], QUALITY)
    assert_array_equal(source.attributes["label"], LABEL)
    assert source.attributes["quality"].dtype == np.dtype("=f4")
    assert_array_equal(source.rows, np.arange(5))
    assert source.name.endswith("a.ply")


def test_windows_line_ends_and_a_body_that_begins_like_a_line_end_are_read(tmp_path):
    text = ascii_ply().replace("\n", "\r\n")
    assert_array_equal(read_source(write(tmp_path, "crlf.ply", text)).points, POINTS)
    header = HEADER.split("property uchar red")[0].replace("double", "float").format("binary_little_endian")
    header += "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    points = POINTS.astype("<f4")
    points[0, 0] = np.frombuffer(b"\n\r\n=", "<f4")[0]
    body = points.tobytes() + b"".join(struct.pack("<B3i", 3, *f) for f in FACES)
    source = read_source(write(tmp_path, "lf.ply", header.encode() + body))
    assert_array_equal(source.points, points.astype(float))


@pytest.mark.parametrize("order", ["ascii", "<", ">"])
def test_mixed_polygons_with_further_face_properties_become_fans_in_their_order(tmp_path, order):
    polygons = [[0, 1, 2, 3], [0, 1, 4], [0, 1, 2, 3, 4], [1, 2]]
    name = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {name} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 4\nproperty uchar flags\nproperty list ushort uint vertex_index\n"
        "property list uchar float texcoord\nproperty double weight\nend_header\n"
    ).encode()
    if order == "ascii":
        rows = [" ".join(map(str, p)) for p in POINTS]
        rows += [f"7 {len(p)} {' '.join(map(str, p))} 2 0.5 0.5 1.25" for p in polygons]
        data = head + "\n".join(rows).encode()
    else:
        data = head + POINTS.astype(f"{order}f4").tobytes()
        for p in polygons:
            data += struct.pack(f"{order}BH{len(p)}IB2fd", 7, len(p), *p, 2, 0.5, 0.5, 1.25)
    with pytest.warns(ModelWarning) as said:
        source = read_source(write(tmp_path, "mixed.ply", data))
    messages = sorted(str(warning.message).split("mixed.ply: ")[1] for warning in said)
    assert messages[0] == "'flags' of 4 faces, 'weight' of 4 faces are not read and stay behind"
    assert "not two a corner" in messages[1]
    fans = [[0, 1, 2], [0, 2, 3], [0, 1, 4], [0, 1, 2], [0, 2, 3], [0, 3, 4]]
    assert_array_equal(source.faces, fans)


def test_vectors_per_vertex_travel_as_trimesh_writes_them(tmp_path):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    mesh.vertex_attributes["normal_noise"] = np.arange(10.0).reshape(5, 2)
    mesh.vertex_attributes["confidence"] = np.arange(5, dtype=np.int32)
    for encoding in ("binary", "ascii"):
        path = write(tmp_path, f"{encoding}.ply", mesh.export(file_type="ply", encoding=encoding))
        attributes = read_source(path).attributes
        assert_array_equal(attributes["normal_noise"], np.arange(10.0).reshape(5, 2))
        assert_array_equal(attributes["confidence"], np.arange(5))


def test_per_vertex_lists_of_different_lengths_stay_behind_with_a_warning(tmp_path):
    head = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "property list uchar int seen_by\nelement face 1\nproperty list uchar int "
        "vertex_indices\nend_header\n"
    )
    rows = "0 0 0 1 5\n1 0 0 2 5 6\n0 1 0 0\n1 1 0 1 4\n3 0 1 2\n"
    with pytest.warns(ModelWarning, match="seen_by"):
        source = read_source(write(tmp_path, "lists.ply", head + rows))
    assert source.attributes == {}
    assert_array_equal(source.points[:, 0], [0, 1, 0, 1])


def test_normals_stay_behind_and_fractions_become_byte_colours(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 4\n"
    head += "".join(f"property float {name}\n" for name in "x y z nx ny nz red green blue".split())
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    rows = "0 0 0 0 0 1 0 0.5 1\n1 0 0 0 0 1 1 1 1\n0 1 0 0 0 1 0 0 0\n1 1 0 0 0 1 0.2 0 0\n3 0 1 2\n"
    source = read_source(write(tmp_path, "fractions.ply", head + rows))
    assert list(source.attributes) == ["color"]
    assert_array_equal(source.attributes["color"][:2], [[0, 128, 255, 255], [255, 255, 255, 255]])


@given(
    points=hnp.arrays(np.float32, (6, 3), elements=st.floats(-1e6, 1e6, width=32), unique=True),
    faces=st.lists(st.permutations(range(6)), min_size=1, max_size=8),
)
def test_our_ply_and_trimesh_reader_agree(tmp_path_factory, points, faces):
    triangles = np.array([face[:3] for face in faces])
    mesh = trimesh.Trimesh(points, triangles, process=False)
    path = tmp_path_factory.mktemp("ply") / "a.ply"
    for encoding in ("binary", "ascii"):
        path.write_bytes(mesh.export(file_type="ply", encoding=encoding))
        ours, theirs = read_source(path), trimesh.load(path, process=False)
        assert_array_equal(ours.points, theirs.vertices)
        assert_array_equal(ours.faces, theirs.faces)


def test_all_shared_meshes_are_read_as_trimesh_reads_them(shared_data):
    paths = sorted(shared_data.glob("*.ply"))
    assert len(paths) >= 13
    for path in paths:
        ours, theirs = read_source(path), trimesh.load(path, process=False)
        assert_array_equal(ours.points, theirs.vertices)
        assert_array_equal(ours.faces, theirs.faces)


def test_a_text_named_ply_is_refused(tmp_path):
    assert "'Dear reader'" in refusal(write(tmp_path, "letter.ply", "Dear reader\nhow are you?\n"))
    assert "end_header" in refusal(write(tmp_path, "header.ply", ascii_ply()[:120]))


@pytest.mark.parametrize(
    ("line", "instead"),
    [
        ("element vertex 5", "element vertex five"),
        ("element vertex 5", "element vertex -5"),
        ("element vertex 5", "element"),
        ("property double x", "property quadruple x"),
        ("property list uchar int", "property list float int"),
        ("property short label", "property short x"),
        ("format {}", "format morse {}"),
        ("comment made by hand\n", "format\n"),
        ("element face 4", "element vertex 4"),
        ("element vertex 5", "element point 5"),
        ("property double x", "property double a"),
        ("format {} 1.0\n", ""),
    ],
)
def test_a_header_that_makes_no_sense_is_refused(tmp_path, line, instead):
    assert line in HEADER
    header = HEADER.replace(line, instead).format("ascii")
    refusal(write(tmp_path, "a.ply", header + ascii_ply().split("end_header\n")[1]))


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_binary_ply_cut_anywhere_is_refused(tmp_path, order):
    whole = binary_ply(order)
    for size in range(1, len(whole)):
        message = refusal(write(tmp_path, "cut.ply", whole[:size]))
        assert any(word in message for word in ("truncated", "not a PLY")), message


def test_an_ascii_ply_cut_between_its_numbers_is_refused(tmp_path):
    words = ascii_ply().split("end_header\n")[1].split()
    header = ascii_ply().split("end_header\n")[0] + "end_header\n"
    for count in range(len(words)):
        message = refusal(write(tmp_path, "cut.ply", header + " ".join(words[:count])))
        assert "truncated" in message


def test_a_ply_with_polygons_of_many_sizes_cut_anywhere_is_refused(tmp_path):
    head = (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty double x\nproperty double y\n"
        b"property double z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    )
    body = POINTS.astype("<f8").tobytes() + struct.pack("<B4iB3i", 4, 0, 1, 2, 3, 3, 0, 1, 4)
    assert len(read_source(write(tmp_path, "whole.ply", head + body)).faces) == 3
    for size in range(len(body)):
        assert "truncated" in refusal(write(tmp_path, "cut.ply", head + body[:size]))


@pytest.mark.parametrize("declared", [4_000_000_000, 10**30])
@pytest.mark.parametrize("name", ["ascii", "binary_little_endian"])
def test_a_header_that_declares_more_than_the_file_can_hold_allocates_nothing(tmp_path, declared, name):
    header = HEADER.replace("vertex 5", f"vertex {declared}").format(name)
    path = write(tmp_path, "hostile.ply", header + "\n" * 20)
    tracemalloc.start()
    message = refusal(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert str(declared) in message
    assert peak < 10_000_000


def test_a_list_that_claims_four_billion_entries_is_refused(tmp_path):
    head = HEADER.replace("list uchar int", "list uint int").format("binary_little_endian").encode()
    body = binary_ply().split(b"end_header\n")[1][: -4 * 13]
    path = write(tmp_path, "list.ply", head + body + struct.pack("<I3i", 0xFFFFFFFF, 0, 1, 2) * 4)
    assert "truncated" in refusal(path)


def test_values_outside_their_declared_type_are_refused(tmp_path):
    assert "'label'" in refusal(write(tmp_path, "a.ply", ascii_ply().replace(" 500\n", " 50000\n")))


@given(data=st.data())
def test_a_ply_with_bytes_changed_is_read_or_refused_but_never_breaks(tmp_path_factory, data):
    whole = bytearray(data.draw(st.sampled_from([binary_ply("<"), binary_ply(">"), ascii_ply().encode()])))
    for place in data.draw(st.lists(st.integers(0, len(whole) - 1), min_size=1, max_size=4)):
        whole[place] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("fuzz") / "a.ply"
    path.write_bytes(bytes(whole))
    try:
        source = read_source(path)
    except (ModelError, ModelWarning) as error:
        message = str(error)
    else:
        message = ""
        assert np.isfinite(source.points).all()
        assert source.faces.max() < len(source.points)
    assert "\n" not in message


def test_colours_and_attributes_travel_to_the_simplified_mesh(tmp_path, solutions):
    source = coloured(load("face:200"))
    folder = write_solutions(tmp_path / "out", build_model(source), solutions, chosen=1)
    back = read_source(folder / "chosen.ply")
    row = {tuple(point): k for k, point in enumerate(source.points.tolist())}
    came_from = [row[tuple(point)] for point in back.points.tolist()]
    for name in ("color", "quality", "label", "seen"):
        assert np.array_equal(back.attributes[name], source.attributes[name][came_from]), name
    assert np.array_equal(back.attributes["two_words"], source.attributes["two words"][came_from])
    assert np.array_equal(back.attributes["pair_1"], source.attributes["pair"][came_from, 1])
    assert back.attributes["quality"].dtype == np.float32


def test_double_precision_survives_far_from_the_origin(tmp_path, solutions):
    source = load("face:200")
    far = dataclasses.replace(source, points=source.points + np.array([5e6, 4e6, 0]))
    folder = write_solutions(tmp_path / "out", build_model(far), solutions, chosen=1)
    written = {tuple(point) for point in read_source(folder / "chosen.ply").points.tolist()}
    assert written <= {tuple(point) for point in far.points.tolist()}


def test_the_reference_system_stands_in_the_record_and_in_the_ply(tmp_path, solutions):
    source = load("face:200")
    facts = {"epsg": 25832, "transform": [1.0, 0.0, 2.0, 0.0, -1.0, 5.0]}
    model = build_model(dataclasses.replace(source, georeference=facts))
    folder = write_solutions(tmp_path / "a", model, solutions, chosen=1)
    assert read_front(folder).run["model"]["georeference"] == facts
    assert b"\ncomment crs: EPSG:25832\n" in (folder / "chosen.ply").read_bytes()
    wkt = {"crs": 'LOCAL_CS["Höhe\n\n2",  UNIT["metre",1]]'}
    model = build_model(dataclasses.replace(source, georeference=wkt))
    folder = write_solutions(tmp_path / "b", model, solutions, chosen=1)
    assert '\ncomment crs: LOCAL_CS["Höhe 2", UNIT["metre",1]]\n'.encode() in (folder / "chosen.ply").read_bytes()
    assert len(read_source(folder / "chosen.ply").faces) == solutions[1][1].quality.triangles


@pytest.mark.parametrize("words", ["crs: EPSG:25832", "crs EPSG:25832", "CRS:\turn:ogc:def:crs:EPSG::25832"])
def test_the_reference_system_is_read_with_and_without_the_colon(tmp_path, words):
    text = ascii_ply().replace("comment made by hand", f"comment {words}")
    assert read_source(write(tmp_path, "a.ply", text)).georeference["epsg"] == 25832


# ------------------------------------------------------------------------------------------------------------ texture


@pytest.mark.parametrize("names", [("s", "t"), ("texture_u", "texture_v")])
def test_texture_coordinates_of_vertices_are_an_attribute_and_the_image_comes_along(tmp_path, names):
    write(tmp_path, "skin.png", picture())
    text = ascii_ply().replace("property float quality\nproperty short label", "property float {}\nproperty float {}")
    text = text.format(*names).replace("comment made by hand", "comment TextureFile skin.png")
    lines = text.splitlines()
    start = lines.index("end_header") + 1
    for k, (u, v) in enumerate(UV):
        lines[start + k] = " ".join([*lines[start + k].split()[:6], str(u), str(v)])
    source = read_source(write(tmp_path, "a.ply", "\n".join(lines)))
    assert_array_equal(source.attributes["uv"], UV)
    assert source.material.image == picture()
    write_mesh(tmp_path / "b.ply", source.points, source.faces, source.attributes, material=source.material)
    again = read_source(tmp_path / "b.ply")
    assert again.material == source.material
    assert_array_equal(again.attributes["uv"], UV)
    assert b"property float s\nproperty float t\n" in (tmp_path / "b.ply").read_bytes()


def wedges(images, seam):
    """Return the pyramid as MeshLab writes textured ones: with coordinates for the corners of faces."""
    head = "\n".join(["ply", "format ascii 1.0", *(f"comment TextureFile {name}" for name in images)])
    head += "\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\nelement face 4\n"
    head += "property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n"
    rows = [" ".join(map(str, point)) for point in POINTS.tolist()]
    for number, face in enumerate(FACES.tolist()):
        places = UV[face] + seam * (number == 3)
        rows.append(f"3 {' '.join(map(str, face))} 6 {' '.join(map(str, places.ravel()))} {number % len(images)}")
    return head + "end_header\n" + "\n".join(rows) + "\n"


def test_texture_coordinates_of_corners_are_those_of_vertices_without_seams(tmp_path):
    write(tmp_path, "skin.png", picture())
    source = read_source(write(tmp_path, "a.ply", wedges(["skin.png"], 0.0)))
    assert_array_equal(source.attributes["uv"], UV)
    assert source.material == Material(image=picture())
    with pytest.warns(ModelWarning, match="3 of 5 vertices lie on seams") as said:
        source = read_source(write(tmp_path, "a.ply", wedges(["skin.png"], 0.25)))
    assert len(said) == 1
    assert source.material is None
    with pytest.warns(ModelWarning, match="are of 2 images"):
        source = read_source(write(tmp_path, "a.ply", wedges(["skin.png", "other.png"], 0.0)))
    assert source.attributes == {}


# ------------------------------------------------------------------------------------------- what connects vertices


def connected(tmp_path, points, element, rows, order="ascii", info=()):
    """Write a PLY whose vertices an element of this name connects by lists."""
    name = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = ["ply", f"format {name} 1.0", *(f"obj_info {line}" for line in info), f"element vertex {len(points)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element {element} {len(rows)}", "property list int int vertex_indices", "end_header\n"]
    if order == "ascii":
        body = "".join(
            " ".join(map(str, row)) + "\n" for row in [*np.asarray(points).tolist(), *([len(r), *r] for r in rows)]
        )
        return write(tmp_path, f"{element}.ply", "\n".join(head) + body)
    lists = b"".join(struct.pack(f"{order}{1 + len(row)}i", len(row), *row) for row in rows)
    return write(
        tmp_path, f"{element}.ply", "\n".join(head).encode() + np.asarray(points, f"{order}f4").tobytes() + lists
    )


def up_and_down(columns=5):
    """Return a band of two rows of vertices, and the strip over it."""
    points = [(x, y, x * y) for x in range(columns) for y in (0, 1)]
    return np.array(points, float), list(range(2 * columns))


@pytest.mark.parametrize("order", ["ascii", "<", ">"])
def test_triangle_strips_alternate_their_winding_and_end_at_minus_one(tmp_path, order):
    points, strip = up_and_down()
    expected = [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5], [4, 5, 6], [6, 5, 7], [6, 7, 8], [8, 7, 9]]
    for rows in (
        [strip],
        [[*strip, -1]],
        [[*strip[:6], -1, *strip[4:]]],
        [strip[:6], [-1, *strip[4:], -1, -1]],
        expected,  # a row ends a strip, too
        [[*strip[:6], 5, 5, 4, 4, *strip[4:]]],  # joined by faces without an area
    ):
        source = read_source(connected(tmp_path, points, "tristrips", rows, order))
        assert_array_equal(source.points, points)
        turned = {tuple(np.roll(face, -int(np.argmin(face)))) for face in source.faces.tolist()}
        assert turned == {tuple(np.roll(face, -int(np.argmin(face)))) for face in expected}


def test_a_strip_that_names_no_vertex_is_refused(tmp_path):
    points, strip = up_and_down()
    assert "name vertices that do not exist" in refusal(connected(tmp_path, points, "tristrips", [[*strip, 10]]))
    assert "name vertices that do not exist" in refusal(connected(tmp_path, points, "tristrips", [[*strip, -2]]))


@pytest.mark.parametrize("order", ["ascii", "<", ">"])
def test_a_range_scan_becomes_triangles_between_its_cells(tmp_path, order):
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    z = np.where((x == 1) & (y == 1), 5.0, 0.0)  # a peak: diagonals avoid it
    seen = np.arange(12) != 3  # but for a corner, whose cell becomes one triangle
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])[seen]
    number = np.cumsum(seen) - 1
    cells = [[int(number[k])] if seen[k] else [] for k in range(12)]
    info = ["is_mesh 0", "num_cols 4", "num_rows 3"]
    source = read_source(connected(tmp_path, points, "range_grid", cells, order, info))
    assert_array_equal(source.points, points)
    found = {frozenset(face) for face in source.faces.tolist()}
    assert {frozenset(int(number[k]) for k in face) for face in [(0, 1, 4), (1, 2, 6), (4, 8, 9), (6, 9, 10)]} <= found
    assert len(source.faces) == 11
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert_array_equal(areas, 0.5)


def test_a_range_scan_whose_cells_do_not_fit_is_refused(tmp_path):
    points = up_and_down(3)[0]
    cells = [[k] for k in range(6)]
    info = ["num_cols 2", "num_rows 3"]
    assert len(read_source(connected(tmp_path, points, "range_grid", cells, info=info)).faces) == 4
    assert "has 6 cells, but its header says num_cols 2 and num_rows 0" in refusal(
        connected(tmp_path, points, "range_grid", cells, info=info[:1])
    )
    for wrong in ([6], [-1], [0, 1]):
        said = refusal(connected(tmp_path, points, "range_grid", [*cells[:-1], wrong], info=info))
        assert "names more than one vertex, or one that does not exist (of 6)" in said


def test_elements_that_are_not_read_are_named(tmp_path):
    head, rest = ascii_ply().split("end_header\n")
    edges = "element edge 2\nproperty int vertex1\nproperty int vertex2\n"
    text = f"{head}{edges}element nothing 0\nproperty int x\nend_header\n{rest}0 1\n1 2\n"
    with pytest.warns(
        ModelWarning, match=r"a\.ply: 2 of 'edge' are not read and stay behind; --break-lines takes edges$"
    ):
        assert_array_equal(read_source(write(tmp_path, "a.ply", text)).faces, FACES)


def test_a_line_without_meaning_before_the_elements_is_left_out_with_a_word(tmp_path):
    text = ascii_ply().replace("element vertex", "Created by hand\nelement vertex")
    with pytest.warns(ModelWarning, match="mean nothing were left out: 1 "):
        assert_array_equal(read_source(write(tmp_path, "a.ply", text)).faces, FACES)
    text = ascii_ply().replace("element face", "Created by hand\nelement face")
    assert "cannot read the header line 'Created by hand'" in refusal(write(tmp_path, "a.ply", text))
