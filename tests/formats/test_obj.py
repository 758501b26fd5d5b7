"""OBJ: seams, negative indices and polygons; texture and what is beside it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_array_equal
from pyramid import FACES, POINTS, UV, picture, write
from samples import random_solutions, write_solutions

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.table import read_source, write_mesh
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.surface.model import build_model


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
    with pytest.warns(ModelWarning, match="of 2 materials"):
        source = read_source(write(tmp_path, "seams.obj", text))
    assert_array_equal(source.points, [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0.25], [2, 0, 0]])
    assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2], [1, 2, 3]])
    # each vertex has one place on the image wherever it has any
    assert_array_equal(source.attributes["uv"], [[0, 0], [1, 0], [0, 0], [1, 0], [0, 0]])


# ------------------------------------------------------------------------------------------------------------ texture

MTL = "newmtl other\nKd 0 0 0\nnewmtl rock # grey\nKa 1 1 1\nKd 0.5 0.25 1\nd 0.75\nmap_Kd skin.png\n"


def textured(corner="{0}/{0}", library="looks.mtl", extra=""):
    """Return the pyramid as an OBJ with texture coordinates."""
    lines = [f"mtllib {library}", *(f"v {x!r} {y!r} {z!r}" for x, y, z in POINTS.tolist())]
    lines += [f"vt {u!r} {v!r}" for u, v in UV.tolist()] + ["usemtl rock"]
    lines += [" ".join(["f", *(corner.format(k + 1, k - 5) for k in face)]) for face in FACES.tolist()]
    return "\n".join(lines) + "\n" + extra


@pytest.fixture
def textures(tmp_path):
    (tmp_path / "looks.mtl").write_text(MTL)
    (tmp_path / "skin.png").write_bytes(picture())
    return tmp_path


@pytest.mark.parametrize("corner", ["{0}/{0}", "{0}/{1}/7", "{1}/{0}"])
def test_texture_coordinates_and_the_material_come_along_where_each_vertex_has_one(textures, corner):
    source = read_source(write(textures, "a.obj", textured(corner)))
    assert_array_equal(source.attributes["uv"], UV)
    assert source.material == Material("rock", (0.5, 0.25, 1.0, 0.75), picture())


def test_equal_texture_coordinates_under_several_numbers_are_no_seam(textures):
    text = textured(extra=f"vt {UV[0, 0]} {UV[0, 1]}\nf 1/6 2/2 3/3\n")
    assert_array_equal(read_source(write(textures, "a.obj", text)).attributes["uv"], UV)


def test_at_seams_the_texture_stays_behind_with_their_number_and_the_rest_is_read(textures):
    text = textured(extra="vt 0.3 0.3\nf 1/6 2/6 3/3\n")
    with pytest.warns(
        ModelWarning, match="2 of 5 vertices lie on seams.*its texture stays behind .*With a texture"
    ) as said:
        source = read_source(write(textures, "a.obj", text))
    assert len(said) == 1
    assert "uv" not in source.attributes
    assert source.material == Material("rock", (0.5, 0.25, 1.0, 0.75)), "the colour has no seams"
    assert len(source.faces) == 5


def test_vertices_without_a_place_on_the_image_are_counted(textures):
    text = textured(extra="v 2 2 2\nf 1 2 6\n")
    with pytest.warns(ModelWarning, match="1 of 6 vertices have no place on it; its texture stays behind$"):
        assert "uv" not in read_source(write(textures, "a.obj", text)).attributes


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ("missing.png", "cannot be read"),
        ("notes.txt", "neither PNG nor JPEG"),
        ("-s 2 2 2 skin.png", "placed by options"),
        ("../skin.png", "outside its folder"),
        ("..\\skin.png", "outside its folder"),
        ("/elsewhere/skin.png", "outside its folder"),
        ("C:\\pictures\\skin.png", "outside its folder"),
        ("link.png", "outside its folder"),
    ],
)
def test_an_image_that_is_not_there_or_elsewhere_is_a_warning(tmp_path, named, said):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "skin.png").write_bytes(picture())
    (folder / "skin.png").write_bytes(picture())
    (folder / "notes.txt").write_text("secret")
    (folder / "link.png").symlink_to(tmp_path / "skin.png")
    (folder / "looks.mtl").write_text(MTL.replace("skin.png", named))
    with pytest.warns(ModelWarning, match=said) as warned:
        source = read_source(write(folder, "a.obj", textured()))
    assert len(warned) == 1
    assert source.material == Material("rock", (0.5, 0.25, 1.0, 0.75))
    assert_array_equal(source.attributes["uv"], UV)


def test_a_library_that_is_not_there_or_elsewhere_is_a_warning(textures):
    for library, said in (("none.mtl", "material library 'none.mtl' cannot be read"), ("../a.mtl", "outside")):
        with pytest.warns(ModelWarning, match=said):
            source = read_source(write(textures, "a.obj", textured(library=library)))
        assert source.material is None
        assert_array_equal(source.attributes["uv"], UV)


def test_an_image_in_a_folder_below_is_found_with_either_slash(textures):
    (textures / "deep").mkdir()
    (textures / "skin.png").rename(textures / "deep" / "skin.png")
    for slash in "/\\":
        (textures / "looks.mtl").write_text(MTL.replace("skin.png", f"deep{slash}skin.png"))
        assert read_source(write(textures, "a.obj", textured())).material.image == picture()


def test_what_an_obj_holds_beside_the_surface_is_said_with_its_number(textures):
    (textures / "looks.mtl").write_text(MTL + "map_Bump a.png\nmap_Ks b.png\n")
    with pytest.warns(ModelWarning) as said:
        read_source(write(textures, "a.obj", textured(extra="l 1 2\nl 2 3\np 1\nusemtl rock\n")))
    words = [str(warning.message).partition("a.obj: ")[2] for warning in said]
    assert words == [
        "its 2 lines are no faces and stay behind; --break-lines takes them",
        "its 1 points are no faces and stay behind",
        "2 further images of its material stay behind (map_bump, map_ks)",
    ]


def test_texture_coordinates_that_do_not_exist_are_a_warning_with_their_number(textures):
    with pytest.warns(ModelWarning, match=r"2 corners .* do not exist \(first: 9, of 5\)"):
        assert "uv" not in read_source(write(textures, "a.obj", textured(extra="f 1/9 2/2 3/-8\n"))).attributes


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb"])
def test_a_front_carries_the_texture_and_puts_it_beside_its_meshes_once(textures, suffix):
    points, faces = grid = np.array([[x, y, x * y] for y in range(4) for x in range(4)], float), []
    faces += [[k, k + 1, k + 5] for k in range(11) if k % 4 < 3] + [[k, k + 5, k + 4] for k in range(11) if k % 4 < 3]
    own = {"uv": points[:, :2] / 4, "color": np.full((16, 4), 255, np.uint8)}
    material = Material("rock", (0.5, 0.25, 1.0, 0.75), picture("JPEG"))
    model = build_model(build_source(*grid, own, "hill.obj", material=material))
    solutions = random_solutions(model)
    folder = write_solutions(textures / "out", model, solutions, mesh_format=suffix, meshes=3, chosen=1)
    beside = {"obj": [".jpg", ".mtl"], "ply": [".jpg"], "glb": []}[suffix]
    for place in (folder, folder / "meshes"):
        assert sorted(p.suffix for p in place.iterdir() if p.name.startswith(("material", "texture"))) == beside
    for path in folder.glob(f"**/*.{suffix}"):
        again = read_source(path)
        assert_array_equal(again.attributes["uv"], again.points[:, :2] / 4)
        assert again.material.image == picture("JPEG")
        assert again.material.color == ((1, 1, 1, 1) if suffix == "ply" else material.color)
    twice = write_solutions(textures / "two", model, solutions, mesh_format=suffix, meshes=3, chosen=1)
    for path in (path for path in folder.glob("**/*") if path.is_file() and path.name != "run.json"):
        assert path.read_bytes() == (twice / path.relative_to(folder)).read_bytes()


def test_a_mesh_taken_from_a_folder_brings_its_texture_and_replaces_no_file_of_the_user(textures):
    write(textures, "a.obj", textured())
    for name in ("texture.png", "material.mtl", "rock.png", "a.mtl", "b.mtl"):
        write(textures, name, "the user's")
    problem = MeshProblem(textures / "a.obj", n_threads=1)
    assert problem.mesh(np.ones(5, bool)).visual.material.baseColorTexture.size == (2, 3)
    front = Front.from_subsets(problem, np.ones((1, 5), bool), ends=False)
    front.save(textures / "out", mesh_format="obj")
    before = {path.name: path.read_bytes() for path in textures.iterdir() if path.is_file()}
    Front.load(textures / "out")[0].save(textures / "b.obj")
    assert {name: (textures / name).read_bytes() for name in before} == before
    assert read_source(textures / "b.obj").material == problem.model.material
    assert_array_equal(read_source(textures / "b.obj").attributes["uv"], UV[problem.model.source_index])


@given(points=hnp.arrays(float, (5, 3), elements=st.floats(-1e60, 1e60)))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_coordinates_of_any_size_read_back_equal(tmp_path, points):
    assume(len(np.unique(points + 0.0, axis=0)) == 5)
    write_mesh(tmp_path / "a.obj", points, FACES, {"uv": points[:, :2]})
    source = read_source(tmp_path / "a.obj")
    assert_array_equal(source.points, points)
    assert_array_equal(source.attributes["uv"], points[:, :2])
