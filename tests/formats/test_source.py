"""What any file becomes: checked arrays, or one line that says what is wrong with them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal
from pyramid import COLORS, FACES, POINTS, ascii_ply, refusal, write

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.formats.source.scenes import from_trimesh
from meshsimp_pymoo.formats.table import read_source


def test_a_trimesh_object_keeps_rows_colours_and_attributes_and_is_not_changed():
    mesh = trimesh.Trimesh(np.vstack([POINTS, POINTS + 9.0]), FACES, process=False)
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


def soup(faces=FACES):
    """Every corner a vertex of its own."""
    corners = np.asarray(faces).ravel()
    return np.asarray(POINTS, float)[corners], np.arange(len(corners)).reshape(-1, 3), corners


def test_vertices_that_repeat_a_position_are_merged_with_their_number():
    points, faces, corners = soup()
    n, n_places = len(points), len(np.unique(corners))
    with pytest.warns(ModelWarning, match=rf"^soup: {n - n_places} of {n} vertices repeat the position of another one"):
        source = build_source(points, faces, {"age": corners}, name="soup")
    assert len(source.points) == n_places
    assert_array_equal(source.attributes["age"][source.faces], FACES)
    assert_array_equal(source.points[source.faces], np.asarray(POINTS, float)[FACES])
    assert_array_equal(source.rows, np.sort(np.unique(corners, return_index=True)[1]))
    assert sorted([*source.rows, *source.repeats[:, 0]]) == list(range(n))
    assert_array_equal(points[source.repeats[:, 0]], points[source.repeats[:, 1]])


def test_of_attributes_that_differ_the_first_ones_stay_with_their_number():
    points, faces, corners = soup()
    values = np.arange(len(points), dtype=float)
    values[corners == 0] = np.nan  # no number is like no number
    several = sum(np.count_nonzero(corners == k) > 1 for k in range(1, len(POINTS)))
    told = f"{several} of {len(np.unique(corners))} vertices have several values of 'age', of which the first stays"
    with pytest.warns(ModelWarning, match="repeat the position"), pytest.warns(ModelWarning, match=told):
        source = build_source(points, faces, {"age": values, "same": points}, name="soup")
    assert_array_equal(source.attributes["age"], values[source.rows])


def test_minus_zero_is_zero_and_fewer_than_four_positions_are_no_mesh():
    points = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-0.0, 0, 0]]
    with pytest.warns(ModelWarning, match="1 of 5 vertices"):
        assert len(build_source(points, [[0, 1, 2], [4, 2, 3]]).points) == 4
    with pytest.warns(ModelWarning), pytest.raises(ModelError, match="only 3 different positions among 4 vertices"):
        build_source([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0]], [[0, 1, 2]])


def test_colours_of_faces_stay_behind_with_their_number():
    mesh = trimesh.Trimesh(POINTS, FACES, face_colors=COLORS[:4], process=False)
    with pytest.warns(ModelWarning, match="colours of 4 faces stay behind"):
        assert from_trimesh(mesh).attributes == {}


def test_faces_that_name_a_vertex_twice_are_dropped_with_their_number():
    with pytest.warns(ModelWarning, match=r"^named: 2 of 6 faces name a vertex twice"):
        source = build_source(POINTS, [*FACES.tolist(), [0, 0, 1], [2, 3, 2]], name="named")
    assert_array_equal(source.faces, FACES)


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
    with pytest.raises(ModelError, match="mesh: has 5 vertices but no faces"):
        build_source(POINTS, np.empty((0, 3), np.int64))
    with pytest.raises(ModelError, match="all 1 faces"):
        build_source(POINTS, [[1, 1, 1]])


FACE_LINES = "element face 4\nproperty list uchar int vertex_indices\n"
ROWS = [(*map(str, point), *color[:3]) for point, color in zip(POINTS.tolist(), COLORS.tolist(), strict=True)]
CLOUDS = {
    "cloud.obj": "".join(f"v {x} {y} {z} {r / 255} {g / 255} {b / 255}\n" for x, y, z, r, g, b in ROWS),
    "cloud.off": "COFF\n5 0 0\n" + "".join(f"{x} {y} {z} {r} {g} {b} 255\n" for x, y, z, r, g, b in ROWS),
    "no_faces.ply": ascii_ply().replace("element face 4", "element face 0").split("3 0 1 4")[0],
    "no_element.ply": ascii_ply().replace(FACE_LINES, "").split("3 0 1 4")[0],
}


@pytest.mark.parametrize("name", CLOUDS)
def test_points_without_faces_are_a_cloud_whatever_file_holds_them(tmp_path, name):
    path = write(tmp_path, name, CLOUDS[name])
    with pytest.warns(ModelWarning, match="has 5 vertices and no faces, so it is read as a point cloud") as caught:
        source = read_source(path, Options(max_edge=1e3, nodata=-9999))
    assert len(caught) == 1
    expected = cloud_source(POINTS)
    assert_array_equal(source.points, expected.points)
    assert_array_equal(source.faces, expected.faces)
    assert_array_equal(source.attributes["color"][:, :3], COLORS[:, :3])
    assert (source.sort, source.up) == ("cloud", "z")
    with pytest.warns(ModelWarning), pytest.raises(ModelError, match=r"an edge longer than 0\.001 .*--max-edge"):
        read_source(path, Options(max_edge=1e-3))
    with pytest.raises(ModelError, match="window describe height grids"):
        read_source(path, Options(window=(0, 0, 2, 2)))


def test_vertices_without_a_place_that_no_face_names_are_dropped_with_their_count(tmp_path):
    points = np.insert(POINTS, [0, 3], np.nan, axis=0)
    number = np.flatnonzero(~np.isnan(points[:, 0]))
    with pytest.warns(ModelWarning, match="mesh: 2 of 7 vertices have NaN coordinates and no faces, and were dropped"):
        source = build_source(points, number[FACES], {"tag": np.arange(7)})
    assert_array_equal(source.points, POINTS)
    assert_array_equal(source.faces, FACES)
    assert_array_equal(source.rows, number)
    assert_array_equal(source.attributes["tag"], number)
    with pytest.raises(ModelError, match="2 of 7 vertices have NaN or infinite"):
        build_source(points, np.arange(6).reshape(2, 3))


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
