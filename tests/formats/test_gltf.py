"""glTF: scenes, files beside it, Y up about a local origin, texture, and damage."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import struct
import time

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from PIL import Image
from pyramid import COLORS, FACES, POINTS, UV, picture, refusal, write
from samples import write_solutions

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelWarning, ResultError
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.source.scenes import from_trimesh
from meshsimp_pymoo.formats.table import format_to_write, read_source, write_mesh
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.storage import read_front, write_solution
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.surface import mesh_arrays

UTM = np.array([500_000.25, 5_400_000.5, 300.125])


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


def glb_tree(path):
    content = path.read_bytes()
    length = int.from_bytes(content[12:16], "little")
    assert content[:4] == b"glTF"
    assert int.from_bytes(content[8:12], "little") == len(content)
    assert length % 4 == 0
    return json.loads(content[20 : 20 + length])


def test_a_glb_far_from_the_origin_states_a_local_one_and_loses_nothing(tmp_path, solutions):
    source = load("face:200")
    points = np.round(source.points * 1024) / 1024 + UTM
    facts = {"epsg": 25832, "crs": "PROJCS[...]", "unit": "metre"}
    far = build_model(dataclasses.replace(source, points=points, georeference=facts))
    folder = write_solutions(tmp_path / "out", far, solutions, mesh_format="glb", chosen=3)
    (origin,) = {tuple(glb_tree(path)["nodes"][0]["extras"]["origin"]) for path in folder.glob("**/*.glb")}
    assert origin == tuple(np.floor(far.file_points.min(axis=0)))
    node = glb_tree(folder / "chosen.glb")["nodes"][0]
    assert node["translation"] == [origin[0], origin[2], -origin[1]]
    assert node["extras"] == facts | {
        "origin": list(origin), "axes": ["x", "z", "-y"], "metres_per_unit": [1, 1, 1]
    }  # fmt: skip
    assert read_front(folder).run["mesh_origin"] == list(origin)
    vertices, faces, _ = mesh_arrays(far, solutions[1][3].faces)
    mesh = trimesh.load(folder / "chosen.glb", process=False, force="mesh")  # as any viewer puts it
    assert np.array_equal(mesh.triangles, (vertices @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]))[faces])
    again = read_source(folder / "chosen.glb")
    assert again.georeference == facts
    assert np.array_equal(again.points[again.faces], vertices[faces])


def glb_points(path):
    """Return the coordinates in a GLB of ours as they are stored, (V, 3) float32."""
    tree, content = glb_tree(path), path.read_bytes()
    start = 28 + int.from_bytes(content[12:16], "little")
    return np.frombuffer(content, "<f4", 3 * tree["accessors"][0]["count"], start).reshape(-1, 3)


def stored(path):
    """Return its extras and translation."""
    node = glb_tree(path)["nodes"][0]
    return node["extras"], node["translation"]


@pytest.mark.parametrize("axis", ["x", "y", "z", "-x", "-y", "-z"])
def test_the_axis_next_to_the_height_is_y_and_reading_turns_it_back(tmp_path, axis):
    up = np.zeros(3)
    up["xyz".index(axis[-1])] = -1.0 if axis[0] == "-" else 1.0
    points = np.round(POINTS * 64) / 64 + [3000.0, -2000.0, 500.0]
    write_mesh(tmp_path / "a.glb", points, FACES, up=up + np.array([0.1, -0.2, 0.05]))
    found, (extras, translation) = glb_points(tmp_path / "a.glb"), stored(tmp_path / "a.glb")
    assert extras["origin"] == np.floor(points.min(axis=0)).tolist()
    placed = found + np.array(translation)
    assert np.array_equal(placed[:, 1], points @ up), "height is Y"
    sides = np.linalg.det(points[1:4] - points[0]), np.linalg.det(placed[1:4] - placed[0])
    assert sides[0] == pytest.approx(sides[1]), "turned, not mirrored"
    assert np.array_equal(read_source(tmp_path / "a.glb").points, points)
    assert np.abs(found).max() < 4, "distances from the origin, whatever the size"


@pytest.mark.parametrize(("unit", "metres"), [("US survey foot", 1200 / 3937), ("foot", 0.3048), ("kilometre", 1000.0)])
def test_a_known_unit_becomes_metres_and_comes_back(tmp_path, unit, metres):
    points = POINTS + np.array([1e6, 2e6, 300.0])
    write_mesh(tmp_path / "a.glb", points, FACES, georeference={"unit": unit})
    extras, translation = stored(tmp_path / "a.glb")
    assert extras["metres_per_unit"] == [metres] * 3
    assert translation == pytest.approx([1e6 * metres, 300 * metres, -2e6 * metres], rel=1e-12)
    np.testing.assert_allclose(
        np.ptp(glb_points(tmp_path / "a.glb"), axis=0)[[0, 2]], np.ptp(POINTS, axis=0)[:2] * metres, rtol=1e-6
    )
    again = read_source(tmp_path / "a.glb")
    np.testing.assert_allclose(again.points, points, atol=2e-7)
    assert again.georeference == {"unit": unit}


def test_degrees_are_scaled_as_told_and_lose_less_than_a_tenth_of_a_millimetre(tmp_path):
    east, north = np.meshgrid(24.5 + np.arange(12) / 7200, 60.14458333 + np.arange(9) / 7200)
    points = np.column_stack([east.ravel(), north.ravel(), 30 + np.arange(108.0) / 7])
    faces = [[k, k + 1, k + 13] for k in range(95) if k % 12 < 11]
    scale = [55_600.0, 111_400.0]
    for facts in ({"unit": "degree"}, {"unit": "degree", "scale": scale}):
        write_mesh(tmp_path / "a.glb", points, faces, georeference=facts)
        extras, _ = stored(tmp_path / "a.glb")
        assert extras["unit"] == "degree"
        assert extras["metres_per_unit"] == [*facts.get("scale", [1.0, 1.0]), 1.0]
        assert np.abs(glb_points(tmp_path / "a.glb")).max() < 250, "near the origin in degrees, too"
        again = read_source(tmp_path / "a.glb", Options(scale=None if "scale" in facts else "none"))
        assert again.georeference == facts
        moved = np.abs(again.points - points) * [*scale, 1.0]
        assert moved.max() < 2e-5, "[m]; single precision of the degrees themselves loses 0.15"


def test_an_unknown_unit_is_said_and_nothing_is_scaled(tmp_path):
    write_mesh(tmp_path / "a.glb", POINTS, FACES)
    extras, _ = stored(tmp_path / "a.glb")
    assert (extras["unit"], extras["metres_per_unit"]) == ("unknown", [1, 1, 1])
    assert read_source(tmp_path / "a.glb").georeference == {}


@given(
    width=st.floats(1e-6, 1e6),
    far=st.lists(st.floats(-1e7, 1e7), min_size=3, max_size=3),
    scale=st.lists(st.floats(1e-3, 1e6), min_size=2, max_size=2),
    axis=st.sampled_from(["x", "y", "z", "-x", "-y", "-z"]),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_single_precision_costs_a_share_of_the_width_wherever_a_model_lies(tmp_path, width, far, scale, axis):
    points = POINTS * width + far
    up = np.eye(3)["xyz".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0)
    write_mesh(tmp_path / "a.glb", points, FACES, up=up, georeference={"scale": scale})
    _, inverse = np.unique(points, axis=0, return_inverse=True)
    assume(len(set(inverse.ravel().tolist())) == 5)
    again = read_source(tmp_path / "a.glb").points
    assume(len(again) == 5)  # places closer than single precision are one
    limit = 4 * width * 2.0**-23 + 4 * np.spacing(1e7)
    assert np.abs(again - points).max() <= limit


def test_a_glb_of_another_program_is_read_as_it_lies_and_written_as_it_lay(tmp_path):
    for up in ("y", "z"):
        points = POINTS if up == "z" else POINTS[:, [0, 2, 1]] * [1, 1, -1]
        foreign = trimesh.Trimesh(points, FACES, process=False).export(file_type="glb")
        model = open_model(write(tmp_path, "foreign.glb", foreign), Options(up=up))
        points = points.astype(np.float32)
        assert sorted(model.file_points.tolist()) == sorted(points.tolist())
        write_solution(tmp_path / "again.glb", HeightSurface(model), model.faces)
        mesh = trimesh.load(tmp_path / "again.glb", process=False, force="mesh")
        np.testing.assert_allclose(sorted(mesh.vertices.tolist()), sorted(points.tolist()), atol=1e-6)
        assert stored(tmp_path / "again.glb")[0]["axes"] == ["x", "y", "z"]


def changed(path, change):
    """Rewrite a GLB with another JSON part."""
    content, tree = path.read_bytes(), glb_tree(path)
    rest = content[20 + int.from_bytes(content[12:16], "little") :]
    change(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON")
    path.write_bytes(head + text + rest)
    return path


def test_a_glb_of_ours_that_somebody_moved_is_read_where_it_lies_now(tmp_path):
    write_mesh(tmp_path / "a.glb", POINTS, FACES)
    before = read_source(tmp_path / "a.glb").points
    changed(tmp_path / "a.glb", lambda tree: tree["nodes"][0].update(translation=[2.0, 30.0, -400.0]))
    np.testing.assert_allclose(read_source(tmp_path / "a.glb").points, before + np.array([2, 400, 30]), atol=1e-12)


@pytest.mark.parametrize(
    "extras",
    [
        None,
        "ours",
        {"axes": ["x", "y", "-z"]},
        {"axes": ["x", "z", "-y"]},
        {"axes": [["x"], "z", "-y"], "metres_per_unit": [1, 1, 1]},
        {"axes": ["x", "z", "-y"], "metres_per_unit": [1, 0, 1]},
        {"axes": ["x", "z", "-y"], "metres_per_unit": ["a", True, 1]},
    ],
)
def test_extras_that_are_not_ours_change_nothing(tmp_path, extras):
    write_mesh(tmp_path / "a.glb", POINTS, FACES)
    changed(tmp_path / "a.glb", lambda tree: tree["nodes"][0].update(extras=extras))
    points = read_source(tmp_path / "a.glb").points
    np.testing.assert_allclose(points, POINTS[:, [0, 2, 1]] * [1, 1, -1], atol=1e-6)


@pytest.mark.parametrize("width", [1e-35, 1e35])
def test_a_model_beyond_single_precision_is_refused_before_any_search(width):
    model = build_model(build_source(POINTS * width, FACES, name="wide"))
    with pytest.raises(ResultError, match=r"single precision.*write another format"):
        format_to_write("glb").check(model)


# ------------------------------------------------------------------------------------------------------------ texture


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_a_texture_is_embedded_and_read_back(tmp_path, kind):
    material = Material("skin", (1.0, 0.5, 0.25, 0.75), picture(kind))
    write_mesh(tmp_path / "a.glb", POINTS, FACES, {"uv": UV, "color": COLORS}, material=material)
    tree = glb_tree(tmp_path / "a.glb")
    views = tree["bufferViews"]
    assert all(view["byteOffset"] % 4 == 0 for view in views)
    assert "target" not in views[tree["images"][0]["bufferView"]]
    source = read_source(tmp_path / "a.glb")
    assert source.material == material
    assert np.array_equal(source.attributes["uv"], UV)
    assert np.array_equal(source.attributes["color"], COLORS)
    look = trimesh.load(tmp_path / "a.glb", process=False, force="mesh").visual  # and in another program
    assert look.material.baseColorTexture.size == (2, 3)
    assert np.array_equal(look.uv, UV)


def test_texture_coordinates_without_a_material_are_read_back_too(tmp_path):
    write_mesh(tmp_path / "a.glb", POINTS, FACES, {"uv": UV})
    assert np.array_equal(read_source(tmp_path / "a.glb").attributes["uv"], UV)


def textured(points=POINTS, faces=FACES, uv=UV, color=(255, 255, 255, 255)):
    """Return a mesh as trimesh holds textured ones."""
    image = Image.open(io.BytesIO(picture()))
    material = trimesh.visual.material.PBRMaterial(name="skin", baseColorTexture=image, baseColorFactor=color)
    mesh = trimesh.Trimesh(points, faces, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return mesh


def test_a_texture_of_another_program_comes_along_and_from_memory_too(tmp_path):
    for kind in ("glb", "gltf"):
        content = textured().export(file_type=kind)
        for name, part in content.items() if kind == "gltf" else [("a.glb", content)]:
            write(tmp_path, name, part)
        source = read_source(tmp_path / ("model.gltf" if kind == "gltf" else "a.glb"))
        assert np.array_equal(source.attributes["uv"], UV)
        with Image.open(io.BytesIO(source.material.image)) as image:
            assert image.convert("RGB").getpixel((1, 2)) == (200, 100, 50)
        assert source.material.name == "skin"
    held = from_trimesh(textured(color=(255, 0, 51, 255)))
    assert np.array_equal(held.attributes["uv"], UV)
    assert held.material == Material("skin", (1.0, 0.0, 0.2, 1.0), held.material.image)
    with Image.open(io.BytesIO(held.material.image)) as image:
        assert image.convert("RGB").getpixel((0, 0)) == (200, 100, 50)


def test_at_seams_the_texture_stays_behind_and_other_attributes_are_those_of_the_first(tmp_path):
    points, uv = np.vstack([POINTS, POINTS[:2]]), np.vstack([UV, UV[:2] + 0.25])
    mesh = textured(points, [[0, 1, 4], [5, 6, 2], [2, 3, 4]], uv)
    with pytest.warns(ModelWarning, match="2 of 5 vertices lie on seams") as said:
        source = read_source(write(tmp_path, "a.glb", mesh.export(file_type="glb")))
    assert len(said) == 1
    assert "uv" not in source.attributes
    assert not source.material.image
    flat = textured(
        points, [[0, 1, 4], [5, 6, 2], [2, 3, 4]], np.vstack([UV, UV[:2]])
    )  # repeated for its normals alone
    source = read_source(write(tmp_path, "a.glb", flat.export(file_type="glb")))
    assert np.array_equal(source.attributes["uv"], UV.astype(np.float32))
    colours = np.vstack([COLORS, COLORS[[0, 0]]])
    mesh = trimesh.Trimesh(points, [[0, 1, 4], [5, 6, 2], [2, 3, 4]], vertex_colors=colours, process=False)
    with pytest.warns(ModelWarning, match="1 of 5 vertices have several values of 'color', of which the first stays"):
        source = read_source(write(tmp_path, "a.glb", mesh.export(file_type="glb")))
    assert np.array_equal(source.attributes["color"], COLORS)


def further(tree):
    tree["meshes"][0]["primitives"][0]["attributes"] |= {"TEXCOORD_1": 1, "JOINTS_0": 1}
    tree["materials"][0]["normalTexture"] = {"index": 0}


def second(tree):
    tree["meshes"][0]["primitives"].append(tree["meshes"][0]["primitives"][0] | {"material": 1})
    tree["materials"].append({"name": "other"})


def lines(tree):
    tree["meshes"][0]["primitives"].append(tree["meshes"][0]["primitives"][0] | {"mode": 1})


def moved(tree):
    place = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = place


def missing(tree):
    tree["images"][0] = {"uri": "none.png"}


@pytest.mark.parametrize(
    ("change", "said", "kept"),
    [
        (further, ["JOINTS_0 of 1 primitive(s), TEXCOORD_1 of 1 primitive(s) stay", "normalTexture stay"], True),
        (second, ["of 2 materials"], True),
        (lines, ["1 primitive(s) that are no triangles"], True),
        (moved, ["packed, or another set counts"], False),
        (missing, ["'none.png' cannot be read"], True),
    ],
)
def test_what_a_gltf_holds_beside_one_plain_material_is_said(tmp_path, change, said, kept):
    write_mesh(tmp_path / "a.glb", POINTS, FACES, {"uv": UV}, material=Material(image=picture()))
    with pytest.warns(ModelWarning) as warned:
        source = read_source(changed(tmp_path / "a.glb", change))
    assert len(warned) == len(said)
    for warning, words in zip(warned, said, strict=True):
        assert words in str(warning.message)
    assert ("uv" in source.attributes) is kept


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda tree: tree.update(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco_mesh_compression"),
        (lambda tree: tree["accessors"][0].update(sparse={"count": 1}), "sparse accessors"),
        (lambda tree: tree["accessors"][0].update(normalized=True), "normalized positions"),
    ],
)
def test_what_would_be_read_wrongly_is_refused(tmp_path, change, said):
    write_mesh(tmp_path / "a.glb", POINTS, FACES)
    assert f"needs {said}" in refusal(changed(tmp_path / "a.glb", change))


def test_a_damaged_glb_is_refused(tmp_path):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    glb = mesh.export(file_type="glb")
    at = 20 + int.from_bytes(glb[12:16], "little")
    forged = glb[:at] + (4_000_000_000).to_bytes(4, "little") + glb[at + 4 :]
    assert "a chunk declares 4000000000 bytes" in refusal(write(tmp_path, "forged.glb", forged))
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


def scene_of(path, nodes):
    """Write the pyramid as GLB with these nodes in place of its own; the first is the scene's."""
    parts = trimesh.exchange.gltf.export_gltf(trimesh.Trimesh(POINTS, FACES, process=False))
    tree = json.loads(parts["model.gltf"])
    tree |= {"nodes": nodes, "scenes": [{"nodes": [0]}], "scene": 0}
    for buffer in tree["buffers"]:
        content = base64.b64encode(parts[buffer["uri"]]).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{content}"
    path.write_text(json.dumps(tree))
    return path


def test_a_deep_chain_of_nodes_is_read_in_linear_time(tmp_path):
    chain = [{"translation": [1.0, 0.0, 0.5], "children": [k + 1]} for k in range(2000)]
    path = scene_of(tmp_path / "chain.gltf", [*chain, {"mesh": 0}])
    start = time.process_time()
    source = read_source(path)
    assert time.process_time() - start < 3.0
    assert np.array_equal(source.points, POINTS.astype(np.float32) + np.array([2000.0, 0.0, 1000.0]))


@pytest.mark.parametrize(
    "nodes",
    [
        [{"mesh": 0, "children": [1]}, {"mesh": 0, "children": [0]}],
        [{"children": [1, 1]}, {"mesh": 0}],
        [{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}],
        [{"mesh": 0}, {"mesh": 0, "children": [2]}, {"children": [1]}],
    ],
)
def test_nodes_that_are_no_tree_are_refused(tmp_path, nodes):
    assert "nodes are no tree" in refusal(scene_of(tmp_path / "circle.gltf", nodes))


def test_what_nodes_repeat_is_counted_before_it_is_unfolded(tmp_path, monkeypatch):
    nodes = [{"children": list(range(1, 1001))}, *[{"mesh": 0}] * 1000]
    path = scene_of(tmp_path / "many.gltf", nodes)
    monkeypatch.setattr("meshsimp_pymoo.memory.free_memory", lambda: (1 << 20, 1 << 20))
    monkeypatch.setattr(trimesh, "load", None)
    line = refusal(path)
    assert f"{1000 * len(POINTS)} vertices and {1000 * len(FACES)} faces" in line
    assert "1 MiB are free" in line
