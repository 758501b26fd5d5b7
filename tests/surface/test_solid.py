"""Solids to print: a mesh of a height surface closed by walls and a base, watertight whatever its outline is."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given
from hypothesis import strategies as st
from samples import freed, holey_grid, subset, surface

from meshsimp_pymoo import Front, MeshProblem
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.table import read_source, written_formats
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.faces import edge_table, used_rows
from meshsimp_pymoo.storage import write_solution
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.kinds import surface_of
from meshsimp_pymoo.surface.measures import TRIANGLES
from meshsimp_pymoo.surface.solid import Solid, _flattened, as_solid


def check(found: Solid, on: HeightSurface, faces: np.ndarray, thickness: float) -> None:
    """See that a solid is closed and turns outwards, holds what is below the surface, and has it as it was."""
    steps = np.concatenate([found.faces[:, [0, 1]], found.faces[:, [1, 2]], found.faces[:, [2, 0]]])
    assert len(np.unique(steps, axis=0)) == len(steps)  # each edge once a way
    assert {*map(tuple, steps.tolist())} == {*map(tuple, steps[:, ::-1].tolist())}  # and both ways
    assert np.array_equal(np.unique(found.faces), np.arange(len(found.vertices)))
    a, b, c = (on.points[faces[:, k]] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    rows, compact = used_rows(faces)
    lowest = on.points[rows, 2].min()
    expected = (area * ((a + b + c)[:, 2] / 3 - lowest + thickness)).sum()
    exact = 1e-5 if found.parted else 1e-9
    assert found.volume == pytest.approx(expected, rel=exact)
    assert trimesh.Trimesh(found.vertices, found.faces, process=False).volume == pytest.approx(found.volume, rel=1e-9)
    joined = trimesh.Trimesh(found.vertices.astype(np.float32), found.faces)  # what is at one place, as of an STL
    assert joined.is_watertight
    assert joined.is_winding_consistent
    top = found.faces[: len(faces)]
    assert np.array_equal(found.source[top], compact)
    off = found.vertices[top] - on.model.file_points[faces]
    assert np.count_nonzero(np.bincount(top[off.any(axis=2)], minlength=1)) == found.parted
    assert np.linalg.norm(off, axis=2).max() <= 1.01e-6 * np.linalg.norm(np.ptp(on.model.file_points[rows], axis=0))
    is_below = np.isin(np.arange(len(found.vertices)), top, invert=True)
    up = on.view.rotation[2]
    heights = found.vertices @ up
    scale = np.abs(found.vertices).max()
    assert np.ptp(heights[is_below]) <= (0.0 if np.abs(up).max() == 1.0 else 2e-15 * scale)
    assert heights[~is_below].min() - heights[is_below].max() == pytest.approx(thickness, abs=1e-14 * scale)
    # straight below the vertex that it is said to be of
    down = on.model.file_points[rows][found.source[is_below]] - found.vertices[is_below]
    assert np.abs(down - (down @ up)[:, None] * up).max() <= (1e-5 if found.parted else 1e-14) * scale


def plates(*parts: np.ndarray, heights: float = 0.0) -> SourceMesh:
    """Return triangle fans as one mesh, the same places as one vertex."""
    corners = np.concatenate(
        [np.stack([[part[0], *part[k : k + 2]] for k in range(1, len(part) - 1)]) for part in parts]
    )
    places, faces = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    z = heights * places[:, 0]
    return build_source(np.column_stack([places, z]), faces.reshape(-1, 3), name="plates")


# ------------------------------------------------------------------------------------------------------ known answers


def test_a_pyramid_is_a_house_of_fourteen_triangles():
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 3]])
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    pyramid = surface(build_source(points, faces, name="pyramid"))
    own = pyramid.triangles(np.ones(5, bool))
    found = as_solid(pyramid, own, 1.0)
    assert (len(found.faces), len(found.vertices)) == (4 + 8 + 2, 9)
    assert found.volume == pytest.approx(4 * 1 + 4 * 3 / 3, rel=1e-14)
    assert found.numbers == {"triangles": 14, "vertices": 9, "volume": found.volume}
    check(found, pyramid, own, 1.0)


def test_a_hole_goes_through_the_base():
    y, x = np.mgrid[:4, :4].astype(float)
    cells = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    faces = [(4 * i + j + a, 4 * i + j + b, 4 * i + j + c) for i, j in cells for a, b, c in ((0, 1, 5), (0, 5, 4))]
    frame = surface(build_source(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), np.array(faces), name="frame"))
    own = frame.triangles(np.ones(16, bool))
    found = as_solid(frame, own, 0.5)
    assert found.volume == pytest.approx(8 * 0.5, rel=1e-14)
    # 16 sides of walls, and a base that needs none of the vertices within
    assert len(found.faces) == 16 + 2 * 16 + 16
    assert trimesh.Trimesh(found.vertices, found.faces, process=False).euler_number == 0  # a ring
    check(found, frame, own, 0.5)


SQUARE = np.array([[0.0, 0], [2, 0], [2, 2], [0, 2]])
TOUCHING = {
    "two squares that meet in a corner": (plates(SQUARE, SQUARE + 2.0, heights=0.5), 2, 1),
    "a triangle whose tip is on a side": (plates(SQUARE, np.array([[2.0, 1], [3, 0], [3, 2]])), 2, 0),
    "two tips on a side": (
        plates(SQUARE, np.array([[2.0, 0.5], [3, 0], [3, 1]]), np.array([[2.0, 1.5], [3, 1], [3, 2]])), 3, 1,
    ),
    "four squares around a corner and none beside": (
        plates(SQUARE, SQUARE + 2.0, SQUARE + np.array([0, 4]), SQUARE + np.array([-2, 2])), 4, 4,
    ),
    "a long side beside a corner": (
        plates(SQUARE * [5.0, 0.5], np.array([[0.0, 2.1], [0, 1.1], [5, 1.1], [10, 1.1], [10, 2.1]])), 2, 0,
    ),
    "two that are apart": (plates(SQUARE, SQUARE + 3.0, heights=1.0), 2, 0),
}  # fmt: skip


@pytest.mark.parametrize("name", TOUCHING)
def test_outlines_that_touch_are_watertight(name):
    source, n_bodies, n_parted = TOUCHING[name]
    on = HeightSurface(open_model(source))
    faces = on.model.faces.astype(np.int64)
    found = as_solid(on, faces, 1.5)
    check(found, on, faces, 1.5)
    bodies = trimesh.graph.connected_components(trimesh.Trimesh(found.vertices, found.faces, process=False).edges)
    assert len(bodies) == n_bodies
    assert found.parted == n_parted
    assert ("parted" in found.numbers) == (n_parted > 0)


def test_a_hole_that_touches_the_outline_is_one_body():
    around = [[0.0, 0], [4, 0], [4, 4], [0, 4]]
    hole = [[4.0, 2], [3, 1], [2, 2], [3, 3]]  # a corner of it on the outline's right side
    fans = [
        [around[0], around[1], hole[1]], [around[1], hole[0], hole[1]], [hole[0], around[2], hole[3]],
        [around[2], around[3], hole[3]], [around[3], around[0], hole[2]], [around[0], hole[1], hole[2]],
        [around[3], hole[2], hole[3]],
    ]  # fmt: skip
    on = HeightSurface(open_model(plates(*map(np.array, fans), heights=0.25)))
    faces = on.model.faces.astype(np.int64)
    found = as_solid(on, faces, 1.0)
    check(found, on, faces, 1.0)
    assert len(found.vertices) == 2 * (len(on.points) + 1)  # the corner is there twice, above and below


# ---------------------------------------------------------------------------------------------------------------- laws

MODELS = ("holey", "ring:90", "horseshoe:90", "face:80", "jacksboro:40")
UPS = ("z", "-z", "x", (0.3, -0.2, 0.9))


def model_of(name: str, up: object = "z") -> HeightSurface:
    source = holey_grid() if name == "holey" else load(name)
    if up == "z":
        return surface(source)
    # turned so that its heights are along this direction of its file
    to = {"-z": (0, 0, -1.0), "x": (1.0, 0, 0)}.get(up, up) if isinstance(up, str) else up
    turn = trimesh.geometry.align_vectors([0, 0, 1.0], to)[:3, :3]
    return surface(replace(source, points=source.points @ turn.T), up=up)


SURFACES = {name: model_of(name) for name in MODELS}


@given(st.sampled_from(MODELS), st.floats(0.05, 0.9), st.integers(0, 2**31), st.floats(1e-3, 1e3))
def test_any_mesh_is_closed_and_holds_what_is_below_it(name, share, seed, thickness):
    on = SURFACES[name]
    kept = subset(on.model, share, seed) | on.pinned
    assume(on.evaluate(kept[None])[0, TRIANGLES])  # else its bays and holes leave nothing
    faces = on.triangles(kept)
    check(as_solid(on, faces, thickness), on, faces, thickness)


@pytest.mark.parametrize("name", MODELS)
def test_free_meshes_are_closed_too_and_the_base_takes_what_its_outline_needs(name):
    on = SURFACES[name]
    faces = freed(on, subset(on.model, 0.4), better=False).faces
    found = as_solid(on, faces, 2.0)
    check(found, on, faces, 2.0)
    table = edge_table(found.faces[: len(faces)])
    border = table.ends[table.n_triangles == 1]
    sides, vertices = len(border), len(np.unique(found.faces[: len(faces)]))
    holes = 1 - (vertices - len(table.ends) + len(faces))  # of one piece, by Euler's formula
    assert len(found.faces) == len(faces) + 2 * sides + sides - 2 + 2 * holes


@pytest.mark.parametrize("up", UPS, ids=str)
def test_the_base_is_below_whatever_up_is(up):
    on = model_of("face:80", up)
    faces = on.triangles(subset(on.model, 0.5) | on.pinned)
    found = as_solid(on, faces, 37.123)
    check(found, on, faces, 37.123)


@pytest.mark.parametrize("up", [*np.eye(3), *-np.eye(3)], ids=str)
def test_along_an_axis_the_base_is_flat_to_the_last_bit(up):
    points = np.random.default_rng(1).uniform(-60, 60, (99, 3))
    assert {*(_flattened(points, up, -73.123) @ up).tolist()} == {-73.123}


def test_a_refitted_mesh_is_closed_with_its_heights():
    on = SURFACES["face:80"]
    mesh = on.simplify(subset(on.model, 0.4) | on.pinned)
    refitted = on.refit(mesh)
    found = as_solid(on, mesh.faces, 3.0, refitted.vertices)
    assert np.array_equal(found.vertices[: len(refitted.vertices)], refitted.vertices)
    assert trimesh.Trimesh(found.vertices, found.faces, process=False).is_watertight


# --------------------------------------------------------------------------------------------------- files, refusals


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "glb", "off"])
def test_a_solid_is_watertight_in_the_programs_that_open_it(tmp_path, suffix):
    front = Front.from_subsets(MeshProblem("horseshoe:90"), np.ones((1, 90), bool))
    path = front[0].save(tmp_path / f"solid.{suffix}", solid=0.25)
    mesh = trimesh.load(path, force="mesh")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(front[0].solid(0.25).volume, rel=1e-5)
    pymeshlab = pytest.importorskip("pymeshlab", exc_type=ImportError)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    measured = meshes.get_topological_measures()
    assert (measured["boundary_edges"], measured["non_two_manifold_edges"], measured["number_holes"]) == (0, 0, 0)


def test_what_is_below_has_the_colours_of_what_it_is_below(tmp_path):
    source = load("face:80")
    colours = np.random.default_rng(1).integers(0, 256, (80, 4), np.uint8)
    on = surface(replace(source, attributes={"color": colours, "tag": np.arange(80)}))
    faces = on.triangles(np.ones(on.n_vertices, bool))
    write_solution(tmp_path / "a.ply", on, faces, solid=1.0)
    found = read_source(tmp_path / "a.ply")
    upper = {tuple(point[:2]): tag for point, tag in zip(source.points.tolist(), range(80), strict=True)}
    assert [upper[tuple(point[:2])] for point in found.points.tolist()] == found.attributes["tag"].tolist()
    np.testing.assert_array_equal(found.attributes["color"], colours[found.attributes["tag"].astype(int)])


@pytest.mark.parametrize("thickness", [0.0, -1.0, np.nan, np.inf])
def test_a_solid_has_a_thickness(thickness):
    with pytest.raises(ValueError, match="thick is none; give how far its base is below"):
        as_solid(SURFACES["holey"], SURFACES["holey"].model.faces, thickness)


@pytest.mark.parametrize("thickness", [1e-300, 1e300])
def test_a_base_that_rounding_takes_away_is_refused_with_what_is_held(thickness):
    with pytest.raises(ResultError, match=r"holey: a base 1e[-+]300 below the lowest point .*; give from .* to "):
        as_solid(SURFACES["holey"], SURFACES["holey"].model.faces, thickness)


def test_what_has_no_base_is_refused_in_one_line(tmp_path):
    ball = surface_of(open_model("blob:200"))
    with pytest.raises(ResultError, match=r"blob:200: is a closed surface, which has no outline for a base"):
        as_solid(ball, ball.model.faces, 1.0)
    degrees = replace(holey_grid(), georeference={"unit": "degree", "scale": [70_000.0, 111_000.0]})
    on = surface(degrees)
    with pytest.raises(ResultError, match=r"holey: a solid is for printing, with lengths alone"):
        as_solid(on, on.model.faces, 1.0)
    on = SURFACES["holey"]
    for kind in written_formats().values():
        if kind.one_height:
            with pytest.raises(ResultError, match=rf"{kind.title} holds surfaces with one height .*such as stl"):
                write_solution(tmp_path / f"a{kind.suffix}", on, on.model.faces, solid=1.0)


# ------------------------------------------------------------------------------------------------------------ the shell


@pytest.mark.usefixtures("sketched")
def test_the_chosen_mesh_is_solid_and_all_others_are_surfaces(tmp_path, capsys):
    out = tmp_path / "out"
    words = ["--triangles", "40", "--moves", "2000", "--refit", "--no-page", "--format", "stl", "--meshes", "2"]
    assert main(["simplify", "horseshoe:90", "-o", str(out), *words, "--solid", "0.5"]) == 0
    said = capsys.readouterr().out
    run = json.loads((out / "run.json").read_text())
    front = Front.load(out)
    solution = front[run["chosen"]]
    assert run["settings"]["solid"] == 0.5
    assert run["solid"] == {"thickness": 0.5, **solution.solid(0.5).numbers}
    assert f"below the lowest point the file has {run['solid']['triangles']} triangles, volume" in said
    for path in out.rglob("*.stl"):
        assert trimesh.load(path).is_watertight == (path.parent == out), path
    assert len([*out.glob("chosen*.stl")]) == 2
    raised = as_solid(front.surface, solution.faces, 0.5, solution.refitted.vertices).volume
    assert abs(raised - run["solid"]["volume"]) > 1e-3 * raised
    assert trimesh.load(out / "chosen_refitted.stl").volume == pytest.approx(raised, rel=1e-6)
    # what is picked is a surface, unless it is to be solid
    picked = ["pick", str(out), "--solution", str(solution.solution), "-o"]
    assert main([*picked, str(tmp_path / "a.stl")]) == 0
    assert not trimesh.load(tmp_path / "a.stl").is_watertight
    assert main([*picked, str(tmp_path / "b.stl"), "--solid", "0.5", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.split("\n", 2)[2])["solid"] == run["solid"]
    assert (tmp_path / "b.stl").read_bytes() == (out / "chosen.stl").read_bytes()


REFUSED = {
    ("--solid", "0", "--pick", "knee"): "argument --solid: '0' is not positive",
    ("--solid", "1"): "--solid does not go with a front alone: it is for the chosen mesh; say which is wanted",
    ("--solid", "1", "--pick", "knee", "--format", "2dm"): "--solid does not go with --format 2dm: 2DM holds surfaces",
    ("--solid", "1", "--pick", "knee", "--surface", "closed"): "--solid does not go with a closed surface",
    ("--solid", "1", "--pick", "knee", "--tile", "64"): "--solid does not go with tiles",
}


@pytest.mark.parametrize("options", REFUSED, ids=" ".join)
def test_what_cannot_be_solid_is_refused_before_any_search(tmp_path, capsys, options):
    assert main(["simplify", "jacksboro:40", "-o", str(tmp_path / "out"), "--quiet", *options]) == 2
    assert REFUSED[options] in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_degrees_are_refused_before_any_search(tmp_path, capsys):
    np.save(tmp_path / "a.npy", np.arange(20.0).reshape(4, 5))
    out = ["-o", str(tmp_path / "out"), "--quiet", "--pick", "knee"]
    assert main(["simplify", str(tmp_path / "a.npy"), *out, "--scale", "70000,111000", "--solid", "5"]) == 2
    assert "a solid is for printing, with lengths alone" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_solid_that_is_written_nowhere_is_refused(tmp_path, capsys):
    assert main(["pick", str(tmp_path), "--knee", "--solid", "1"]) == 2
    assert "--solid is of a file that is written; name it (-o FILE)" in capsys.readouterr().err
