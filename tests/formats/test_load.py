"""What comes out of files: every format, every attribute, every kind of damage."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_array_equal

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.source.scenes import from_trimesh
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.tiles.grid import open_grid

# A pyramid without its base: five vertices, four faces, and coordinates that no float32 holds.
POINTS = np.array([[0.1, 0.2, 0.3], [1.1, 0, 0], [1, 1.7, 0], [0, 1, 0], [0.5, 0.5, 1 / 3]])
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
COLORS = np.array([[1, 2, 3], [9, 8, 7], [50, 60, 70], [255, 0, 255], [0, 9, 0]], np.uint8)
COLORS = np.column_stack([COLORS, np.full(5, 255, np.uint8)])

HEADER = """ply
format {} 1.0
comment made by hand
element vertex 5
property double x
property double y
property double z
property uchar red
property uchar green
property uchar blue
property float quality
property short label
element face 4
property list uchar int vertex_indices
end_header
"""
QUALITY = np.array([0.5, 1.5, -2.0, 3.25, 8.0], np.float32)
LABEL = np.array([-1, 2, -3, 4, 500], np.int16)


def ascii_ply() -> str:
    rows = [
        " ".join([*(repr(float(x)) for x in p), *map(str, c[:3]), str(q), str(label)])
        for p, c, q, label in zip(POINTS, COLORS, QUALITY, LABEL, strict=True)
    ]
    rows += ["3 " + " ".join(map(str, face)) for face in FACES]
    return HEADER.format("ascii") + "\n".join(rows) + "\n"


def binary_ply(order: str = "<") -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    body = b"".join(
        struct.pack(f"{order}3d3Bfh", *p, *map(int, c[:3]), q, label)
        for p, c, q, label in zip(POINTS, COLORS, QUALITY, LABEL, strict=True)
    )
    return HEADER.format(name).encode() + body + b"".join(struct.pack(f"{order}B3i", 3, *f) for f in FACES)


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refusal(path: Path, **kwargs: object) -> str:
    """Return the message with which a file is refused: one line that names the file."""
    with pytest.raises(ModelError) as caught:
        read_source(path, **kwargs)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    assert ";" in message, "the message names no way out"
    return message


# ------------------------------------------------------------ meshes


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
    source = read_source(write(tmp_path, "mixed.ply", data))
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


@pytest.mark.parametrize("suffix", ["ply", "obj", "off", "stl", "stl_ascii", "glb"])
def test_every_format_that_trimesh_writes_is_read_back(tmp_path, suffix):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    if suffix in ("ply", "obj", "glb"):
        mesh.visual.vertex_colors = COLORS
    path = write(tmp_path, f"mesh.{suffix}", mesh.export(file_type=suffix))
    if suffix == "stl_ascii":
        path = path.rename(tmp_path / "mesh_ascii.stl")
    source = read_source(path)
    tolerance = 1e-7 if suffix in ("stl", "glb", "ply") else 1e-8  # of single precision, or of printed digits
    assert len(source.points) == 5
    assert_array_equal(np.sort(source.points[source.faces], axis=1).shape, (4, 3, 3))
    np.testing.assert_allclose(source.points[source.faces], POINTS[FACES], atol=tolerance)
    if suffix in ("ply", "obj", "off", "glb"):
        np.testing.assert_allclose(source.points, POINTS, atol=tolerance)
        assert_array_equal(source.faces, FACES)
    if suffix in ("ply", "obj", "glb"):
        assert_array_equal(source.attributes["color"], COLORS)
    # the vertices of an STL are numbered as they first appear
    if suffix == "stl":
        assert_array_equal(source.rows, [0, 1, 2, 4, 7])


@given(
    points=hnp.arrays(np.float32, (6, 3), elements=st.floats(-1e6, 1e6, width=32), unique=True),
    faces=st.lists(st.permutations(range(6)), min_size=1, max_size=8),
)
@settings(max_examples=40, deadline=None)
def test_our_ply_and_trimesh_reader_agree(tmp_path_factory, points, faces):
    triangles = np.array([face[:3] for face in faces])
    mesh = trimesh.Trimesh(points, triangles, process=False)
    path = tmp_path_factory.mktemp("ply") / "a.ply"
    for encoding in ("binary", "ascii"):
        path.write_bytes(mesh.export(file_type="ply", encoding=encoding))
        ours, theirs = read_source(path), trimesh.load(path, process=False)
        assert_array_equal(ours.points, theirs.vertices)
        assert_array_equal(ours.faces, theirs.faces)


def test_an_obj_with_texture_seams_negative_indices_and_polygons_stays_whole(tmp_path):
    text = """# a comment
mtllib missing.mtl
v 0 0 0
v 1 0 0 # the second
v 1 1 0.5
v 0 1 \\
 0.25
vt 0 0
vt 1 0
vn 0 0 1
usemtl left
f 1/1/1 2/2/1 3/1/1
usemtl right
f 1//1 3//1 4//1
v 2 0 0
f -4/2 -1/1 -3/1 -2/2
"""
    source = read_source(write(tmp_path, "seams.obj", text))
    assert_array_equal(source.points, [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0.25], [2, 0, 0]])
    assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2], [1, 2, 3]])


@pytest.mark.parametrize(
    ("keyword", "extra"), [("COFF", "{0} {1} {2} 255"), ("CNOFF", "0 0 1 {0} {1} {2} 255"), ("OFF", "")]
)
def test_an_off_keeps_colours_and_skips_normals_and_face_colours(tmp_path, keyword, extra):
    positions = [" ".join(map(repr, point)) for point in POINTS.tolist()]
    rows = [f"{position} {extra.format(*color)}" for position, color in zip(positions, COLORS, strict=True)]
    rows += ["3 " + " ".join(map(str, face)) + " 200 100 0" for face in FACES]
    source = read_source(write(tmp_path, "a.off", f"{keyword}\n# counts\n5 4 0\n\n" + "\n".join(rows)))
    assert_array_equal(source.points, POINTS)
    assert_array_equal(source.faces, FACES)
    if extra:
        assert_array_equal(source.attributes["color"], COLORS)
    else:
        assert source.attributes == {}


def test_a_scene_of_several_meshes_is_one_mesh_where_its_nodes_put_them(tmp_path):
    scene = trimesh.Scene()
    first = trimesh.Trimesh(POINTS, FACES, process=False, vertex_colors=COLORS)
    scene.add_geometry(first, node_name="first")
    move = trimesh.transformations.translation_matrix([8, 0, 0])
    scene.add_geometry(first, node_name="second", transform=move)
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    scene.add_geometry(first, node_name="third", transform=mirror)
    source = read_source(write(tmp_path, "scene.glb", scene.export(file_type="glb")))
    assert source.points.shape == (14, 3), "vertex 3 lies on the mirror's plane, so it is shared"
    assert source.faces.shape == (12, 3)
    assert sorted({round(x) for x in source.points[:, 0]}) == [-1, 0, 1, 8, 9]
    assert source.attributes["color"].shape == (14, 4)
    a, b, c = (source.points[source.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all(), "mirroring must not turn faces over"


def test_a_colour_that_only_one_of_two_meshes_has_stays_behind_with_a_warning(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.Trimesh(POINTS, FACES, process=False, vertex_colors=COLORS))
    scene.add_geometry(trimesh.Trimesh(POINTS + 8.0, FACES, process=False))
    with pytest.warns(ModelWarning, match="color"):
        source = read_source(write(tmp_path, "half.glb", scene.export(file_type="glb")))
    assert source.attributes == {}


def test_a_trimesh_object_keeps_rows_colours_and_attributes_and_is_not_changed():
    mesh = trimesh.Trimesh(np.vstack([POINTS, POINTS]), FACES, process=False)
    mesh.visual.vertex_colors = np.vstack([COLORS, COLORS])
    mesh.vertex_attributes["age"] = np.arange(10)
    before = mesh.vertices.copy()
    source = from_trimesh(mesh, name="twice")
    assert_array_equal(source.points, before)
    assert_array_equal(source.attributes["color"][5:], COLORS)
    assert_array_equal(source.attributes["age"], np.arange(10))
    source.points[0] = 99
    assert_array_equal(mesh.vertices, before)
    assert "color" not in from_trimesh(trimesh.Trimesh(POINTS, FACES)).attributes


def test_merging_takes_equal_positions_alone_and_zero_has_no_sign(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0], [0, 1, 0], [-1, 0, 1e-30]])
    mesh = trimesh.Trimesh(points, [[0, 1, 2], [3, 4, 5]], process=False)
    source = read_source(write(tmp_path, "a.stl", mesh.export(file_type="stl")))
    assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3]])


def test_faces_that_name_a_vertex_twice_are_dropped_with_their_number():
    with pytest.warns(ModelWarning, match=r"^named: 2 of 6 faces name a vertex twice"):
        source = build_source(POINTS, [*FACES.tolist(), [0, 0, 1], [2, 3, 2]], name="named")
    assert_array_equal(source.faces, FACES)


def test_reading_is_silent(tmp_path):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    for suffix in ("ply", "obj", "off", "stl", "glb"):
        write(tmp_path, f"good.{suffix}", mesh.export(file_type=suffix))
        write(tmp_path, f"bad.{suffix}", b"\x00\xff nonsense; " * 9)
    # trimesh logs a normal that it cannot read, and reads on
    write(tmp_path, "odd.stl", mesh.export(file_type="stl_ascii").replace("normal", "normal x", 1))
    write(tmp_path, "seen.py", SILENT)
    # in a process of its own: pytest takes the logs away
    command = [sys.executable, "-W", "always", "seen.py"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (ran.stdout, ran.stderr, ran.returncode) == ("", "", 0)


SILENT = """
from pathlib import Path
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.table import read_source
for path in sorted(Path(".").glob("*.*")):
    try:
        read_source(path)
    except ModelError:
        continue
"""


def test_all_shared_meshes_are_read_as_trimesh_reads_them(shared_data):
    paths = sorted(shared_data.glob("*.ply"))
    assert len(paths) >= 13
    for path in paths:
        ours, theirs = read_source(path), trimesh.load(path, process=False)
        assert_array_equal(ours.points, theirs.vertices)
        assert_array_equal(ours.faces, theirs.faces)


def test_all_shared_grids_are_read(shared_data):
    for path in sorted(shared_data.glob("*.npz")):
        with np.load(path) as arrays:
            elevation, dx, dy = (arrays[key] for key in ("elevation", "dx", "dy"))
        source = read_source(path)
        row, col = np.divmod(source.rows, elevation.shape[1])
        assert len(source.points) == np.isfinite(elevation).sum()
        np.testing.assert_allclose(source.points, np.column_stack([col * dx, -row * dy, elevation[row, col]]))


# ------------------------------------------------------------ damaged meshes


def test_what_is_not_a_readable_file_is_refused(tmp_path, monkeypatch):
    assert "no such file" in refusal(tmp_path / "missing.ply")
    folder = tmp_path / "folder.ply"
    folder.mkdir()
    assert "is a folder" in refusal(folder)
    assert "empty (0 bytes)" in refusal(write(tmp_path, "empty.ply", b""))
    message = refusal(write(tmp_path, "a.xyzzy", "1"))
    assert "'.xyzzy'" in message
    for suffix in (".ply", ".obj", ".stl", ".off", ".glb", ".npy", ".npz", ".asc"):
        assert suffix in message

    def denied(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    path = write(tmp_path, "locked.ply", binary_ply())
    monkeypatch.setattr(Path, "read_bytes", denied)
    assert "Permission denied" in refusal(path)


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
        ("comment made", "what is made"),
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


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_coordinates_that_are_no_numbers_are_counted_and_the_first_is_named(tmp_path, value):
    lines = ascii_ply().splitlines()
    start = lines.index("end_header") + 1
    for row in (2, 3):
        lines[start + row] = " ".join([value, *lines[start + row].split()[1:]])
    message = refusal(write(tmp_path, "a.ply", "\n".join(lines)))
    assert "2 of 5 vertices" in message
    assert "vertex 2" in message
    obj = "\n".join(f"v {value} 0 0" if k == 1 else f"v {k} 0 1" for k in range(4)) + "\nf 1 2 3\n"
    assert "1 of 4 vertices" in refusal(write(tmp_path, "a.obj", obj))


def test_words_among_the_numbers_are_named(tmp_path):
    assert "'banana'" in refusal(
        write(tmp_path, "a.ply", ascii_ply().replace("0.25", "banana", 1).replace("3 0 1 4", "3 0 banana 4"))
    )
    assert "'banana'" in refusal(write(tmp_path, "a.obj", "v 0 0 banana\nv 0 1 0\nf 1 2 3\n"))
    assert "whole number" in refusal(write(tmp_path, "b.ply", ascii_ply().replace("3 0 1 4", "3 0 1.5 4")))


def test_values_outside_their_declared_type_are_refused(tmp_path):
    assert "'label'" in refusal(write(tmp_path, "a.ply", ascii_ply().replace(" 500\n", " 50000\n")))


@pytest.mark.parametrize(("index", "where"), [("5", "5"), ("-1", "-1"), ("4000000", "4000000")])
def test_faces_that_name_missing_vertices_are_refused(tmp_path, index, where):
    text = ascii_ply().replace("3 1 2 4", f"3 1 2 {index}")
    message = refusal(write(tmp_path, "a.ply", text))
    assert f"face 1, (1, 2, {where}), of 5 vertices" in message
    obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"
    assert "do not exist" in refusal(write(tmp_path, "a.obj", obj + "f 1 2 5\n"))
    assert "do not exist" in refusal(write(tmp_path, "b.obj", obj + "f 1 2 -5\n"))
    assert "vertex 0" in refusal(write(tmp_path, "c.obj", obj + "f 0 1 2\n"))


def test_too_few_vertices_and_no_faces_are_refused(tmp_path):
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert "3 vertices" in refusal(write(tmp_path, "three.obj", triangle))
    assert "no faces" in refusal(write(tmp_path, "cloud.obj", "v 0 0 0\n" * 5))
    assert "no faces" in refusal(write(tmp_path, "cloud.off", "OFF\n5 0 0\n" + "0 0 0\n" * 5))
    cloud = ascii_ply().replace("element face 4", "element face 0").split("3 0 1 4")[0]
    assert "no faces" in refusal(write(tmp_path, "cloud.ply", cloud))
    head, rest = ascii_ply().split("element face 4\nproperty list uchar int vertex_indices\n")
    assert "no faces" in refusal(write(tmp_path, "faceless.ply", head + rest.split("3 0 1 4")[0]))
    with pytest.raises(ModelError, match="all 1 faces"):
        build_source(POINTS, [[1, 1, 1]])


def test_arrays_of_another_shape_or_size_are_refused():
    for points, faces, attributes in [
        (POINTS[:, :2], FACES, {}),
        (POINTS, FACES[:, :2], {}),
        (POINTS, FACES.astype(float), {}),
        (POINTS, FACES, {"age": np.arange(4)}),
        (POINTS * 1e90, FACES, {}),
    ]:
        with pytest.raises(ModelError, match=r"^mesh: .*; "):
            build_source(points, faces, attributes)
    with pytest.raises(ValueError, match="rows has 4 entries"):
        SourceMesh(POINTS, FACES, {}, "mesh", rows=np.arange(4))


def test_damaged_off_stl_and_glb_files_are_refused(tmp_path):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    off = mesh.export(file_type="off")
    lines = off.splitlines()
    for count in range(1, len(lines)):
        refusal(write(tmp_path, "cut.off", "\n".join(lines[:count])))
    assert "4000000000" in refusal(write(tmp_path, "hostile.off", "OFF\n4000000000 1 0\n0 0 0\n"))
    assert "too few indices" in refusal(write(tmp_path, "short.off", off.replace("3 0 1 4", "3 0 1")))
    assert "fewer than 3" in refusal(write(tmp_path, "flat.off", "OFF\n2 1 0\n0 0 0\n0 1\n3 0 1 1\n"))
    stl = mesh.export(file_type="stl")
    for size in range(1, len(stl), 7):
        refusal(write(tmp_path, "cut.stl", stl[:size]))
    hostile = stl[:80] + struct.pack("<I", 4_000_000_000) + stl[84:]
    assert "4000000000 triangles" in refusal(write(tmp_path, "hostile.stl", hostile))
    text = mesh.export(file_type="stl_ascii")
    for size in range(1, len(text) - 9, 97):
        refusal(write(tmp_path, "cut.stl", text[:size]))
    glb = mesh.export(file_type="glb")
    for size in range(1, len(glb), 37):
        refusal(write(tmp_path, "cut.glb", glb[:size]))


def test_a_glb_whose_data_are_declared_but_not_there_is_refused(tmp_path):
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": 4_000_000_000, "type": "VEC3"}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON")
    assert "4000000000" in refusal(write(tmp_path, "hostile.glb", head + text))


@given(data=st.data())
@settings(max_examples=150, deadline=None)
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


# ------------------------------------------------------------ grids


def test_a_grid_runs_east_and_south_and_faces_up():
    elevation = np.arange(12.0).reshape(3, 4)
    source = grid_source(elevation, 2.0, 5.0)
    assert source.up == "z"
    assert len(source.faces) == 2 * 2 * 3
    assert_array_equal(source.points[1], [2, 0, 1])
    assert_array_equal(source.points[4], [0, -5, 4])
    a, b, c = (source.points[source.faces[:, k]] for k in range(3))
    assert_array_equal(np.cross(b - a, c - a)[:, 2], np.full(12, 10.0))


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_a_cell_without_one_corner_is_one_triangle_facing_up(corner):
    elevation = np.zeros((2, 2))
    elevation[corner] = np.nan
    with pytest.raises(ModelError, match="has 3 vertices"):
        grid_source(elevation)
    beside = np.zeros((2, 1))
    source = grid_source(np.hstack([beside, elevation] if corner[1] else [elevation, beside]))
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (area > 0).all()
    assert area.sum() / 2 == 1.5


@given(
    hidden=hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=7)),
    nodata=st.sampled_from([None, -9999.0, 0.0]),
)
@settings(max_examples=60, deadline=None)
def test_the_area_of_a_grid_is_that_of_its_cells_with_data(hidden, nodata):
    elevation = np.where(hidden, np.nan if nodata is None else nodata, 7.0)
    corners = sum((~hidden[i : i + hidden.shape[0] - 1, j : j + hidden.shape[1] - 1]).astype(int)
                  for i in (0, 1) for j in (0, 1))  # fmt: skip
    expected = (corners == 4).sum() + (corners == 3).sum() / 2
    if expected == 0 or (~hidden).sum() < 4:
        with pytest.raises(ModelError):
            grid_source(elevation, nodata=nodata)
        return
    source = grid_source(elevation, nodata=nodata)
    assert_array_equal(source.rows, np.flatnonzero(~hidden))
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert area.sum() / 2 == expected
    assert (area == 1).all()


def test_missing_samples_are_known_in_the_grids_own_precision_and_by_masks():
    lowest = float(np.float32(-3.4028234663852886e38))
    elevation = np.zeros((3, 3), np.float32)
    elevation[0, 0] = lowest
    assert len(grid_source(elevation, nodata=-3.4028235e38).points) == 8
    whole = np.arange(9, dtype=np.int16).reshape(3, 3)
    assert len(grid_source(whole, nodata=8).points) == 8
    assert len(grid_source(np.ma.masked_equal(whole, 4)).points) == 8


def test_grids_that_are_none_are_refused():
    good = np.zeros((3, 3))
    for elevation, dx, match in [
        (np.zeros(9), 1, "shape"),
        (np.zeros((1, 9)), 1, "shape"),
        (np.zeros((3, 3), complex), 1, "type complex"),
        (np.full((3, 3), "a"), 1, "type"),
        (good, 0, "dx is 0"),
        (good, float("nan"), "dx is nan"),
        (np.full((3, 3), np.inf), 1, r"9 of 9 heights are infinite \(first: row 0, column 0"),
        (np.full((3, 3), np.nan), 1, "no cell"),
    ]:
        with pytest.raises(ModelError, match=match):
            grid_source(elevation, dx)


@pytest.mark.parametrize("load", [read_source, open_grid])
def test_the_spelling_of_a_numpy_header_is_no_concern_of_the_user(tmp_path, load):
    """A header of Python 2, which NumPy reads and warns of."""
    np.save(tmp_path / "new.npy", np.arange(12.0).reshape(3, 4))
    content = (tmp_path / "new.npy").read_bytes()
    assert b"(3, 4), }  " in content
    (tmp_path / "old.npy").write_bytes(content.replace(b"(3, 4), }  ", b"(3L, 4L), }"))
    load(tmp_path / "old.npy")


def test_npy_and_npz_carry_heights_and_spacing(tmp_path):
    elevation = np.arange(12.0).reshape(3, 4)
    np.save(tmp_path / "a.npy", elevation)
    np.savez(tmp_path / "a.npz", elevation=elevation, dx=3.0, dy=[4.0], other=np.zeros((2, 2)))
    np.savez_compressed(tmp_path / "b.npz", heights=elevation, note=np.arange(3))
    assert_array_equal(read_source(tmp_path / "a.npy").points[5], [1, -1, 5])
    assert_array_equal(read_source(tmp_path / "a.npy", spacing=10).points[5], [10, -10, 5])
    assert_array_equal(read_source(tmp_path / "a.npz").points[5], [3, -4, 5])
    assert_array_equal(read_source(tmp_path / "a.npz", spacing=(2, 5)).points[5], [2, -5, 5])
    assert_array_equal(read_source(tmp_path / "b.npz").points[5], [1, -1, 5])
    assert len(read_source(tmp_path / "b.npz", nodata=11).points) == 11


def test_bad_arrays_files_are_refused_and_never_unpickled(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[print, 1], [2, 3]], dtype=object))
    assert "unpickled" in refusal(tmp_path / "a.npy")
    np.savez(tmp_path / "two.npz", a=np.zeros((3, 3)), b=np.zeros((3, 3)))
    assert "elevation" in refusal(tmp_path / "two.npz")
    np.savez(tmp_path / "dx.npz", elevation=np.zeros((3, 3)), dx=np.zeros(2))
    assert "'dx'" in refusal(tmp_path / "dx.npz")
    np.save(tmp_path / "whole.npy", np.zeros((30, 30)))
    np.savez(tmp_path / "whole.npz", elevation=np.zeros((30, 30)))
    for name in ("whole.npy", "whole.npz"):
        data = (tmp_path / name).read_bytes()
        for size in range(1, len(data) - 1, 211):
            refusal(write(tmp_path, f"cut{Path(name).suffix}", data[:size]))
    refusal(write(tmp_path, "text.npz", "no archive"))
    refusal(write(tmp_path, "open.npy", (tmp_path / "whole.npy").read_bytes().replace(b"), }", b"(( {")))
    np.savez_compressed(tmp_path / "packed.npz", elevation=np.arange(900.0).reshape(30, 30))
    packed = (tmp_path / "packed.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "packed.npz") as archive:
        packed_size = archive.infolist()[0].compress_size
    for place in range(80, packed_size, 40):
        refusal(write(tmp_path, "changed.npz", packed[:place] + b"\xff\x00\xff" + packed[place + 3 :]))
    with zipfile.ZipFile(tmp_path / "none.npz", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    assert "no arrays" in refusal(tmp_path / "none.npz")
    refusal(write(tmp_path, "b.npz", (tmp_path / "dx.npz").read_bytes()), spacing=(1, 2, 3))


def test_an_array_that_declares_more_than_its_file_holds_allocates_nothing(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    header += b" " * (118 - len(header) - 1) + b"\n"
    hostile = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + b"\0" * 50
    assert "(1000000, 1000000)" in refusal(write(tmp_path, "a.npy", hostile))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("elevation.npy", hostile)
    with pytest.raises(ModelError, match=r"elevation.npy: truncated"):
        read_source(tmp_path / "a.npz")


ASC = "ncols 4\nnrows 3\nxllcorner 100.5\nyllcorner 200\ncellsize 10\nNODATA_value -1\n"
ASC += "0 1 2 3\n4 5 6 7\n8 9 10 {}\n"


def test_an_esri_grid_lies_where_its_header_says(tmp_path):
    source = read_source(write(tmp_path, "a.asc", ASC.format(-1)))
    assert len(source.points) == 11
    assert_array_equal(source.points[0], [105.5, 225, 0])
    assert_array_equal(source.points[-1], [125.5, 205, 10])
    centred = ASC.format(11).replace("corner", "center").replace("NODATA_value -1\n", "").upper()
    source = read_source(write(tmp_path, "b.asc", centred))
    assert_array_equal(source.points[-1], [130.5, 200, 11])
    assert len(read_source(tmp_path / "b.asc", nodata=5).points) == 11
    assert_array_equal(read_source(tmp_path / "b.asc", spacing=(1, 2)).points[0], [100.5, 204, 0])
    assert len(read_source(write(tmp_path, "c.asc", ASC.format("nan"))).points) == 11


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ("ncols 4", "ncols 5", "5 x 3"),
        ("0 1 2 3", "0 1 2 3 4", "4 x 3 = 12 heights, but 13"),
        ("ncols 4", "ncols 4000000000", "truncated"),
        ("ncols 4\n", "", "lacks ncols"),
        ("ncols 4", "ncols four", "no number"),
        ("cellsize 10\n", "", "lacks cellsize"),
        ("cellsize 10", "cellsize -10", "positive"),
        ("nrows 3", "nrows 1", "at least 2"),
        ("4 5 6", "4 x 6", "'x'"),
        ("8 9 10 11\n", "", "truncated|but 8"),
    ],
)
def test_a_damaged_esri_grid_is_refused(tmp_path, old, new, cause):
    text = ASC.format(11)
    assert old in text
    path = write(tmp_path, "a.asc", text.replace(old, new))
    refusal(path)
    with pytest.raises(ModelError, match=cause):
        read_source(path)


def test_spacing_and_nodata_of_a_mesh_are_refused(tmp_path):
    path = write(tmp_path, "a.ply", binary_ply())
    assert "grids" in refusal(path, spacing=2.0)
    assert "grids" in refusal(path, nodata=0.0)


@pytest.mark.parametrize(
    ("value", "dtype"),
    [(-9999, np.float64), (-32768, np.int16), (-3.4028234663852886e38, np.float32), (65535, np.int32), (1e31, float)],
)
def test_an_obvious_nodata_value_is_warned_of_and_the_advice_helps(tmp_path, value, dtype):
    heights = np.arange(1, 31).reshape(5, 6).astype(dtype)
    heights[0, :] = value
    np.save(tmp_path / "dem.npy", heights)
    with pytest.warns(ModelWarning, match=r"dem\.npy: 6 of 30 heights are \S+, far from .* \(7 to 30\)") as caught:
        source = read_source(tmp_path / "dem.npy")
    assert len(source.points) == 30  # a warning, no more
    advice = str(caught[0].message).partition("(--nodata=")[2].rstrip(")")
    assert len(read_source(tmp_path / "dem.npy", nodata=float(advice)).points) == 24


@pytest.mark.parametrize(
    "heights",
    [
        [[0, 0], [-9999, -20000]],  # not far from the others
        [[0, 1], [2, -12345]],  # no value that means anything
        [[-9999, -9999], [-9999, -9999]],  # there are no others
        [[0, 1, 2], [2, float("nan"), 4]],
    ],
)
def test_heights_that_may_be_meant_are_not_warned_of(heights):
    grid_source(np.array(heights, float))


@pytest.mark.parametrize("suffix", [".zip", ".3mf", ".zae", ".pcd"])
def test_archives_are_not_unpacked(tmp_path, suffix):
    assert f"unknown suffix '{suffix}'" in refusal(write(tmp_path, f"a{suffix}", binary_ply()))


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/secret.bin", "file:///etc/passwd", "http://a/b", "a\\b"])
def test_a_gltf_reads_no_file_outside_its_folder(tmp_path, uri):
    inside = tmp_path / "in"
    inside.mkdir()
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    parts = trimesh.exchange.gltf.export_gltf(mesh)
    for name, content in parts.items():
        (inside / name).write_bytes(content)
    assert len(read_source(inside / "model.gltf").faces) == 4
    tree = json.loads(parts["model.gltf"])
    (tmp_path / "secret.bin").write_bytes(parts[tree["buffers"][0]["uri"]])
    tree["buffers"][0]["uri"] = uri
    said = refusal(write(inside, "b.gltf", json.dumps(tree)))
    assert repr(uri) in said
    assert "outside its folder" in said
