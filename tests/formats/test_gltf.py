"""glTF: scenes, files beside it, a local origin, and damage."""

from __future__ import annotations

import base64
import dataclasses
import json
import struct
import time

import numpy as np
import pytest
import trimesh
from pyramid import COLORS, FACES, POINTS, refusal, write
from samples import write_solutions

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.storage import mesh_arrays, read_front
from meshsimp_pymoo.surface.model import build_model

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
    far = build_model(dataclasses.replace(source, points=points, georeference={"epsg": 25832, "crs": "PROJCS[...]"}))
    folder = write_solutions(tmp_path / "out", far, solutions, mesh_format="glb", chosen=3)
    (origin,) = {tuple(glb_tree(path)["nodes"][0]["extras"]["origin"]) for path in folder.glob("**/*.glb")}
    assert origin == tuple(np.floor(far.file_points.min(axis=0)))
    node = glb_tree(folder / "chosen.glb")["nodes"][0]
    assert node["translation"] == list(origin)
    assert (node["extras"]["epsg"], node["extras"]["crs"]) == (25832, "PROJCS[...]")
    assert read_front(folder).run["mesh_origin"] == list(origin)
    vertices, faces, _ = mesh_arrays(far, solutions[1][3].faces)
    for path in (folder / "chosen.glb", folder / "meshes" / "000.glb"):
        if not path.exists():
            continue
        mesh = trimesh.load(path, process=False, force="mesh")  # puts it where the node says, in double precision
        assert np.array_equal(mesh.triangles, vertices[faces])
    again = read_source(folder / "chosen.glb")
    assert {tuple(p) for p in again.points.tolist()} == {tuple(p) for p in vertices.tolist()}


def test_a_glb_near_the_origin_has_its_coordinates_as_they_are(tmp_path, model, solutions):
    folder = write_solutions(tmp_path / "out", model, solutions, mesh_format="glb", meshes=1)
    (path,) = folder.glob("meshes/*.glb")
    assert glb_tree(path)["nodes"] == [{"mesh": 0}]
    assert "mesh_origin" not in read_front(folder).run


def test_a_damaged_glb_is_refused(tmp_path):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
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
