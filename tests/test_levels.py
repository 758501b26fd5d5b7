"""Levels of detail: which meshes of a front they are, and what other programs make of the files."""

from __future__ import annotations

import dataclasses
import io
import itertools
import json
import math
import sys
from contextlib import nullcontext
from importlib.util import find_spec

import numpy as np
import pytest
import trimesh
from node import run_script
from PIL import Image
from scipy.spatial import cKDTree

from meshsimp_pymoo import Front, MeshProblem, Missed, save_levels
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning, ResultError
from meshsimp_pymoo.formats.earth import LEAST_RADIUS, earth_centred, sagitta
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import format_to_write, read_source, written_formats
from meshsimp_pymoo.levels import HEIGHT, LARGEST, PIXELS, WIDTH
from meshsimp_pymoo.storage import COMPRESSION_SHARE
from meshsimp_pymoo.surface.surface import mesh_arrays

SHARES = (0.02, 0.05, 0.1, 0.21, 0.4, 0.7, 1.0)
UTM = np.array([560_000.25, 5_115_000.5, 1_300.125])


def front_of(source, seed=2):
    """Return a front of random subsets of a model, each within the next larger one."""
    problem = MeshProblem(source)
    order = np.random.default_rng(seed).random(problem.n_var)
    return Front.from_subsets(problem, [(order < share) | problem.pinned for share in SHARES])


def far(**facts):
    """Return a model of some kilometres far from the origin, with a georeference."""
    source = load("face:400")
    return dataclasses.replace(source, points=np.round(source.points * 32) / 4 + UTM, georeference=facts)


@pytest.fixture(scope="module")
def front():
    return front_of("face:400")


@pytest.fixture(scope="module")
def folder(front, tmp_path_factory):
    """Return the folder of a stored front."""
    return front.save(tmp_path_factory.mktemp("levels") / "out", meshes=0, pictures=False)


def run(*args):
    return main([str(arg) for arg in args])


def said_of(path):
    return json.loads((path / "levels.json").read_text())


def corners_of(solution, vertices=None):
    """Return the corners of a solution's triangles (M, 3, 3) in the frame of the file."""
    own, faces, _ = mesh_arrays(solution.front.model, solution.faces)
    return (own if vertices is None else vertices)[faces]


def y_up(points):
    """Return points with z up as glTF has them."""
    return points[..., [0, 2, 1]] * [1, 1, -1]


def difference(found, expected):
    """Return the largest difference of a coordinate of triangles in the same order."""
    found = np.asarray(found, dtype=float).reshape(expected.shape)
    return np.abs(found - expected).max()


def difference_in_any_order(found, expected):
    """Return the longest way of a corner between triangles in any order, which may begin at any of their corners."""
    found = np.asarray(found, dtype=float).reshape(-1, 3, 3)
    assert len(found) == len(expected)
    turns = np.concatenate([np.roll(expected, k, axis=1) for k in range(3)]).reshape(-1, 9)
    _, row = cKDTree(turns).query(found.reshape(-1, 9))
    assert len(set(row % len(expected))) == len(expected), "each triangle once, wound as it was"
    return np.linalg.norm(found - turns[row].reshape(-1, 3, 3), axis=2).max()


# ------------------------------------------------------------------------------------------------------ which meshes


def test_by_default_each_level_is_the_best_of_a_quarter_of_the_triangles_of_the_one_before(front):
    levels = front.levels()
    assert levels[0] == front[-1]
    for finer, coarser in itertools.pairwise(levels):
        assert coarser == front.best(triangles=finer.triangles // 4)
    assert levels[-1].triangles // 4 < 32 or levels[-1] == front[0]
    assert front.levels(2) == levels[:2]


def test_a_number_of_levels_goes_on_to_the_smallest_mesh(front):
    assert front.levels(100)[-1].triangles < 2 * front[0].triangles
    assert len(front.levels(100)) < 100


def test_limits_choose_a_level_each_in_any_order_and_each_mesh_once(front):
    sizes = [30, 400, 100, 31]
    expected = {front.best(triangles=n) for n in sizes}
    levels = front.levels(triangles=sizes)
    assert set(levels) == expected
    assert [level.triangles for level in levels] == sorted({level.triangles for level in expected}, reverse=True)
    middle = front[3]
    assert front.levels(max_error=[1e9, middle.max_error])[-1] == front[0]


def test_a_front_that_was_searched_for_something_begins_there(front):
    around = front[:]
    around.run = front.run | {"wish": {"triangles": 150}}
    assert around.levels()[0].triangles == front.best(triangles=150).triangles
    around.run = front.run | {"wish": {"triangles": 150, "max_error": 1e-9}}
    assert around.levels()[0].triangles <= 150, "what comes nearest"


@pytest.mark.parametrize(
    ("limits", "problem", "message"),
    [
        ({"count": 0}, ValueError, "count is 0"),
        ({"count": 2, "triangles": [3]}, TypeError, "count does not go with triangles"),
        ({"triangles": [500, 1]}, Missed, "no solution"),
        ({"max_error": [1.0, -1.0]}, Missed, "was asked for"),
    ],
)
def test_what_no_ladder_is_made_of_is_refused(front, limits, problem, message):
    with pytest.raises(problem, match=message):
        front.levels(**limits)


# ------------------------------------------------------------------------------------------------- errors and the rule


def test_a_geometric_error_is_the_largest_of_a_level_and_all_finer_ones(front, tmp_path):
    solutions = list(front)
    record = save_levels(front, tmp_path / "all", solutions)
    assert record == said_of(tmp_path / "all")
    assert [level["solution"] for level in record["levels"]] == list(range(len(front)))[::-1]
    for k, level in enumerate(record["levels"]):
        assert level["geometric_error"] == max(front[-1 - j].max_error for j in range(k + 1))
        assert level["max_error"] == front[-1 - k].max_error
    assert record["geometric_error"].startswith(LARGEST[False])


def test_no_level_is_said_to_be_better_than_a_finer_one(front, tmp_path):
    odd = front[:]
    odd.quality = (*front.quality[:-2], dataclasses.replace(front[-2].quality, max_error=1e3), front[-1].quality)
    for form in ("ply", "3d-tiles"):
        levels = save_levels(odd, tmp_path / form, list(odd), form=form)["levels"]
        assert [level["geometric_error"] for level in levels] == [0.0, *([1e3] * (len(odd) - 1))]
        assert levels[2]["max_error"] == front[-3].max_error < 1e3


def test_at_its_screen_height_the_error_of_a_level_is_a_pixel(front, tmp_path):
    record = save_levels(front, tmp_path / "levels.glb")
    diameter = np.linalg.norm(np.ptp(front.model.file_points, axis=0))
    coverage = [level["coverage"] for level in record["levels"]]
    for k, level in enumerate(record["levels"]):
        if level["geometric_error"] == 0.0:
            assert level["screen_height"] is None
            continue
        pixels = level["screen_height"] * HEIGHT  # as large as the diameter is seen
        assert level["geometric_error"] * pixels / diameter == pytest.approx(PIXELS)
        disc = math.pi * (pixels / 2) ** 2 / (WIDTH * HEIGHT)
        assert coverage[k - 1] == pytest.approx(min(disc, 1.0)), "the level before is shown down to there"
    assert coverage[-1] == 0.0
    assert coverage == sorted(coverage, reverse=True)


def test_a_flat_triangle_lies_below_the_earth_by_no_more_than_its_sagitta():
    rng = np.random.default_rng(3)
    for _ in range(40):
        corners = rng.normal(size=(3, 3)) * [2e4, 2e4, 0] + [0, 0, LEAST_RADIUS]
        corners *= LEAST_RADIUS / np.linalg.norm(corners, axis=1)[:, None]
        share = rng.dirichlet(np.ones(3), 4000)
        below = LEAST_RADIUS - np.linalg.norm(share @ corners, axis=1).min()
        stated = sagitta(corners, np.array([[0, 1, 2]]))
        assert below <= stated * (1 + 1e-4) + 1e-6
        assert below >= 0.8 * stated, "and hardly less"


# ------------------------------------------------------------------------------------------------------------ files


@pytest.mark.parametrize("form", [name for name, kind in written_formats().items() if not kind.needs])
def test_a_folder_has_a_file_for_each_level_in_any_format(front, tmp_path, form):
    record = save_levels(front, tmp_path / "levels", form=form)
    levels = front.levels()
    assert len(record["levels"]) == len(levels) > 2
    for level, solution in zip(record["levels"], levels, strict=True):
        assert level["triangles"] == solution.triangles
        path = tmp_path / "levels" / level["file"]
        assert path.suffix == written_formats()[form].suffix
        if written_formats()[form].read is not None:
            assert len(read_source(path).faces) == solution.triangles
    assert {path.name for path in (tmp_path / "levels").iterdir()} == {
        "levels.json",
        *(level["file"] for level in record["levels"]),
    }


@pytest.mark.parametrize("form", ["ply", "glb", "3d-tiles"])
def test_the_same_front_leaves_the_same_bytes(front, tmp_path, form):
    for name in ("one", "two"):
        save_levels(front, tmp_path / name, form=form)
        save_levels(front, tmp_path / f"{name}.glb")
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
    assert (tmp_path / "one.glb").read_bytes() == (tmp_path / "two.glb").read_bytes()


def test_our_reader_takes_the_finest_level_and_says_that_there_are_others(tmp_path):
    source = far(epsg=32610, unit="metre")
    front = front_of(source)
    save_levels(front, tmp_path / "levels.glb")
    with pytest.warns(ModelWarning, match=r"2 coarser level\(s\) of detail stay behind"):
        again = read_source(tmp_path / "levels.glb")
    assert again.georeference == {"epsg": 32610, "unit": "metre"}
    assert np.array_equal(again.points[again.faces], corners_of(front.levels()[0]))


def test_levels_in_glb_have_normals_as_long_as_one_that_look_out(tmp_path):
    front = front_of(far(epsg=32610, unit="metre"))
    save_levels(front, tmp_path / "levels", form="glb")
    path = tmp_path / "levels" / "level-1.glb"
    mesh = trimesh.load(path, force="mesh", process=False)
    content = path.read_bytes()
    length = int.from_bytes(content[12:16], "little")
    tree = json.loads(content[20 : 20 + length])
    (primitive,) = tree["meshes"][0]["primitives"]
    view = tree["bufferViews"][tree["accessors"][primitive["attributes"]["NORMAL"]]["bufferView"]]
    stored = np.frombuffer(content, "<f4", view["byteLength"] // 4, 28 + length + view["byteOffset"]).reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(stored, axis=1), 1.0, atol=1e-6)
    expected = np.zeros_like(mesh.vertices)
    for face, normal, area in zip(mesh.faces, mesh.face_normals, mesh.area_faces, strict=True):
        expected[face] += normal * area
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    np.testing.assert_allclose(stored, expected, atol=1e-5)
    assert (stored[:, 1] > 0).all(), "up is Y"


# --------------------------------------------------------------------------------------------------- other programs

BABYLON = ("@babylonjs/core", "@babylonjs/loaders")
TILES = ("3d-tiles-renderer", "three")
DRACO = ("@gltf-transform/core", "@gltf-transform/extensions", "draco3dgltf")
VALIDATOR = ("gltf-validator",)
# Of what only the extension names; and the validator does not know these extensions.
KNOWN = {"UNUSED_OBJECT", "UNSUPPORTED_EXTENSION"}


def test_babylon_loads_all_levels_of_a_glb_where_they_are_with_the_one_image_that_they_share(tmp_path):
    stream = io.BytesIO()
    Image.new("RGB", (8, 8), (200, 30, 30)).save(stream, format="PNG")
    source = far(epsg=32610, unit="metre")
    uv = (source.points[:, :2] - source.points[:, :2].min(axis=0)) / np.ptp(source.points[:, :2], axis=0)
    front = front_of(
        dataclasses.replace(source, attributes={"uv": uv}, material=Material("skin", image=stream.getvalue()))
    )
    save_levels(front, tmp_path / "levels.glb")
    assert (tmp_path / "levels.glb").read_bytes().count(stream.getvalue()) == 1
    levels = front.levels()
    found = json.loads(run_script("babylon.mjs", tmp_path / "levels.glb", str(len(levels)), needs=BABYLON))
    assert [len(level["corners"]) // 3 for level in found] == [level.triangles for level in levels[::-1]]
    for level, solution in zip(found[::-1], levels, strict=True):
        assert difference(level["corners"], y_up(corners_of(solution))) < 1e-6
        _, faces, attributes = mesh_arrays(front.model, solution.faces)
        flipped = attributes["uv"] * [1, -1] + [0, 1]  # from the upper left corner
        np.testing.assert_allclose(np.reshape(level["uv"], (-1, 3, 2)), flipped[faces], atol=1e-6)


def test_the_validator_of_khronos_finds_nothing_wrong(front, tmp_path):
    save_levels(front, tmp_path / "levels.glb")
    save_levels(front, tmp_path / "tiles", form="3d-tiles")
    paths = [tmp_path / "levels.glb", *sorted((tmp_path / "tiles").glob("*.glb"))]
    if find_spec("DracoPy") is not None:
        save_levels(front, tmp_path / "packed.glb", compress=True)
        paths.append(tmp_path / "packed.glb")
    for path, report in zip(paths, json.loads(run_script("validated.mjs", *paths, needs=VALIDATOR)), strict=True):
        worse = [issue for issue in report["issues"] if issue["severity"] < 2]
        assert worse == []
        found = {issue["code"] for issue in report["issues"]}
        assert found <= (KNOWN if path.parent == tmp_path else set())


def test_tiles_are_shown_from_coarse_to_fine_as_the_camera_comes_near(front, tmp_path):
    record = save_levels(front, tmp_path / "tiles", form="3d-tiles")
    far_to_near = [3e5, 5e3, 1e3, 4e2, 2e2]
    said = json.loads(run_script("tiled.mjs", tmp_path / "tiles" / "tileset.json", *map(str, far_to_near), needs=TILES))
    shown = [int(view[0].removeprefix("level-").removesuffix(".glb")) for view in said["views"]]
    assert all(len(view) == 1 for view in said["views"]), "a finer tile takes the place of the coarser one"
    last = len(record["levels"]) - 1
    assert (shown[0], shown[-1]) == (last, 0)
    assert shown == sorted(shown, reverse=True)
    for level, solution in zip(record["levels"], front.levels(), strict=True):
        assert difference(said["corners"][level["file"]], corners_of(solution)) < 1e-4  # of some hundred


@pytest.mark.parametrize("compress", [False, True])
def test_the_box_of_a_tileset_holds_all_of_a_flat_model(tmp_path, compress):
    if compress:
        pytest.importorskip("DracoPy", reason="no DracoPy: pip install DracoPy")
    front = front_of(grid_source(np.zeros((12, 9)) + 7.0, 0.1, 0.1, name="flat"))
    record = save_levels(front, tmp_path / "tiles", list(front), form="3d-tiles", compress=compress)
    root = json.loads((tmp_path / "tiles" / "tileset.json").read_text())["root"]
    box = np.array(root["boundingVolume"]["box"])
    half = np.diag(box[3:].reshape(3, 3))
    assert (half > 0).all()
    for level in record["levels"]:
        if compress:
            assert level["bits"] == 24, "it is exact"
        else:
            points = trimesh.load(tmp_path / "tiles" / level["file"], force="mesh", process=False).vertices
            assert (np.abs(points @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]] - box[:3]) <= half).all()


def test_a_tileset_is_a_chain_that_ends_in_the_finest_level(front, tmp_path):
    record = save_levels(front, tmp_path / "tiles", form="3d-tiles")
    tileset = json.loads((tmp_path / "tiles" / "tileset.json").read_text())
    assert tileset["asset"] == {"version": "1.1"}
    assert tileset["root"]["refine"] == "REPLACE"
    chain = [tileset["root"]]
    while children := chain[-1].get("children"):
        (child,) = children
        chain.append(child)
    assert [tile["content"]["uri"] for tile in chain] == [level["file"] for level in record["levels"]][::-1]
    errors = [tileset["geometricError"], *(tile["geometricError"] for tile in chain)]
    assert errors == sorted(errors, reverse=True)
    assert errors[1:] == [level["geometric_error"] for level in record["levels"]][::-1], "a metre is a unit here"


@pytest.mark.parametrize("system", ["utm", "degrees"])
def test_tiles_stand_on_earth_where_the_reference_system_says(tmp_path, system):
    warp = pytest.importorskip("rasterio.warp", reason="no rasterio: pip install rasterio")
    if system == "utm":
        source, epsg = far(epsg=32610, unit="metre"), 32610
    else:
        source, epsg = load("face:400"), 4326
        points = source.points * [1e-4, 1e-4, 2.0] + [-122.2, 46.2, 900.0]
        source = dataclasses.replace(source, points=points, georeference={"epsg": 4326, "unit": "degree"})
    with pytest.warns(ModelWarning, match="are degrees") if system == "degrees" else nullcontext():
        front = front_of(source)
    record = save_levels(front, tmp_path / "tiles", form="3d-tiles")
    assert record["frame"]["system"] == "EPSG:4978"
    said = json.loads(run_script("tiled.mjs", tmp_path / "tiles" / "tileset.json", "1e6", "10", needs=TILES))
    for level, solution in zip(record["levels"], front.levels(), strict=True):
        corners = corners_of(solution).reshape(-1, 3)
        x, y = warp.transform(f"EPSG:{epsg}", "EPSG:4326", *corners[:, :2].T.tolist())
        expected = warp.transform("EPSG:4979", "EPSG:4978", x, y, corners[:, 2].tolist())
        assert difference(said["corners"][level["file"]], np.column_stack(expected)) < 2e-3
        assert level["tile_error_m"] >= level["max_error"] + level["below_the_bent_earth_m"] - 1e-9
    assert record["levels"][-1]["below_the_bent_earth_m"] > 0.0


def test_feet_become_metres_on_earth(tmp_path):
    pytest.importorskip("rasterio", reason="no rasterio: pip install rasterio")
    source = far(epsg=2286, unit="US survey foot")
    source = dataclasses.replace(source, points=source.points + np.array([600_000.0, -5_000_000.0, 0.0]))
    front = front_of(source)
    record = save_levels(front, tmp_path / "tiles", list(front)[1:3], form="3d-tiles")
    foot = 1200 / 3937
    for level in record["levels"]:
        assert level["tile_error_m"] == pytest.approx(level["max_error"] * foot + level["below_the_bent_earth_m"])
    box = np.array(json.loads((tmp_path / "tiles" / "tileset.json").read_text())["root"]["boundingVolume"]["box"])
    corners = np.concatenate([corners_of(solution).reshape(-1, 3) for solution in list(front)[1:3]])
    sides = np.ptp(corners, axis=0)
    assert np.diag(box[3:].reshape(3, 3)) == pytest.approx(sides * foot / 2, rel=0.05), "turned by less than a degree"
    assert record["frame"]["height"] == pytest.approx(front.model.file_box.mean(axis=0)[2] * foot)


def test_the_earth_is_an_ellipsoid():
    poles = earth_centred(np.array([[7.0, 90.0, 0.0], [7.0, -90.0, 0.0], [90.0, 0.0, 10.0]]))
    np.testing.assert_allclose(poles, [[0, 0, 6356752.314245], [0, 0, -6356752.314245], [0, 6378147, 0]], atol=1e-6)


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({}, None),
        ({"unit": "metre"}, None),
        ({"crs": 'LOCAL_CS["site",UNIT["metre",1]]'}, "leads to no place on Earth"),
    ],
)
def test_tiles_without_a_known_place_stand_in_local_coordinates(tmp_path, facts, said):
    if said is not None:
        pytest.importorskip("rasterio", reason="no rasterio: pip install rasterio")
    front = front_of(far(**facts))
    with pytest.warns(ModelWarning, match=said) if said else nullcontext():
        record = save_levels(front, tmp_path / "tiles", form="3d-tiles")
    assert record["frame"] == {"system": None}
    root = json.loads((tmp_path / "tiles" / "tileset.json").read_text())["root"]
    at = root["transform"][12:15]
    assert at == np.floor(front.model.file_points.min(axis=0)).tolist(), "one origin for all levels"


def test_what_lacks_the_library_of_reference_systems_is_told_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio.errors", None)
    with pytest.raises(ResultError, match=r"needs rasterio, .* install it by pip install 'rasterio"):
        save_levels(front_of(far(epsg=32610)), tmp_path / "tiles", form="3d-tiles")
    assert list(tmp_path.iterdir()) == []


# --------------------------------------------------------------------------------------------------------- compressed


@pytest.fixture
def draco():
    pytest.importorskip("DracoPy", reason="no DracoPy: pip install DracoPy")


@pytest.mark.usefixtures("draco")
def test_the_reader_of_google_unpacks_what_was_compressed_as_near_as_it_is_stated(tmp_path):
    source = load("face:400")
    rgba = np.random.default_rng(1).integers(0, 255, (len(source.points), 4), dtype=np.uint8)
    front = front_of(dataclasses.replace(source, attributes={"color": rgba}))
    record = save_levels(front, tmp_path / "levels", form="glb", compress=True)
    plain = save_levels(front, tmp_path / "plain", form="glb")
    paths = [tmp_path / "levels" / level["file"] for level in record["levels"]]
    found = json.loads(run_script("unpacked.mjs", *paths, needs=DRACO))
    for level, (mesh,), solution in zip(record["levels"], found, front.levels(), strict=True):
        expected = y_up(corners_of(solution))
        off = difference_in_any_order(mesh["position"], expected)
        rounding = 5e-5  # of single precision, of some hundred metres
        assert off <= level["moved_by_at_most_m"] + rounding
        assert level["moved_by_at_most_m"] <= COMPRESSION_SHARE * solution.mean_error + rounding
        _, faces, attributes = mesh_arrays(front.model, solution.faces)
        tree = cKDTree(expected.reshape(-1, 3))
        _, corner = tree.query(np.reshape(mesh["position"], (-1, 3)))
        stored = np.rint(np.array(mesh["color"]) * 255)
        assert np.array_equal(stored, attributes["color"][faces.ravel()[corner]]), "colours lose nothing"
    sizes = [(tmp_path / name / "level-0.glb").stat().st_size for name in ("levels", "plain")]
    assert sizes[0] < 0.5 * sizes[1]
    assert [level["triangles"] for level in record["levels"]] == [level["triangles"] for level in plain["levels"]]


@pytest.mark.usefixtures("draco")
def test_draco_says_what_it_drops_and_what_its_bits_turn_over(tmp_path):
    points = np.array([[0.0, 0, 0], [100, 0, 0], [100, 100, 0], [50, 50 + 1e-3, 0], [0, 100, 0], [0, 100, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [3, 2, 4]])
    pack = format_to_write("glb").pack
    with pytest.warns(ModelWarning, match=r"Draco's 8 bits turn over or flatten 1 of 4 triangles"):
        packed = pack(OutMesh(points[:5], faces, {}, name="thin"), 1.0).packed
    assert packed.bits == 8
    assert packed.shift <= 100 / 255
    assert packed.shift >= np.abs(np.rint(points[:5] / 100 * 255) * 100 / 255 - points[:5]).max()
    with pytest.warns(ModelWarning, match=r"1 triangle\(s\) without area stay behind"):
        assert len(pack(OutMesh(points, np.vstack([faces, [[3, 3, 4]]]), {}), 1e-5).packed.faces) == 4


@pytest.mark.usefixtures("draco")
def test_bits_are_as_few_as_the_error_lets_them():
    rng = np.random.default_rng(5)
    points = rng.random((60, 3)) * [900.0, 700.0, 100.0]
    faces = rng.permutation(60).reshape(-1, 3)
    pack = format_to_write("glb").pack
    for most in (1.0, 0.1, 0.01, 1e-3):
        packed = pack(OutMesh(points, faces, {}), most).packed
        assert packed.shift <= most
        step = 2.0 ** -(packed.bits - 1) * np.ptp(points, axis=0).max()
        assert packed.bits == 8 or step * math.sqrt(3) / 2 > most, "one bit less is too few"
    assert pack(OutMesh(points, faces, {}), 0.0).packed.bits == 24


@pytest.mark.usefixtures("draco")
def test_our_reader_refuses_a_compressed_file_in_one_line(front, tmp_path):
    front[2].save_compressed(tmp_path / "small.glb")
    with pytest.raises(ModelError, match=r"needs KHR_draco_mesh_compression, which is not read; export it without"):
        read_source(tmp_path / "small.glb")


def test_compression_without_its_library_says_what_to_install(front, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(ResultError, match=r"compressing GLB needs DracoPy; install it by pip install"):
        front[2].save_compressed(tmp_path / "small.glb")
    with pytest.raises(ResultError, match=r"compressing GLB needs DracoPy"):
        save_levels(front, tmp_path / "levels.glb", compress=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("form", ["ply", "obj"])
def test_only_glb_is_compressed(front, tmp_path, form):
    with pytest.raises(ResultError, match=f"{form} is not compressed; write glb"):
        save_levels(front, tmp_path / "levels", form=form, compress=True)
    assert list(tmp_path.iterdir()) == []


# ----------------------------------------------------------------------------------------------------- kinds of fronts


def test_levels_may_be_refitted_and_say_the_errors_of_that(front, tmp_path):
    record = save_levels(front, tmp_path / "levels", refit=True)
    for level, solution in zip(record["levels"], front.levels(), strict=True):
        assert level["refitted"]
        assert level["mean_error"] <= solution.mean_error + 1e-12
        mesh = read_source(tmp_path / "levels" / level["file"])
        assert level["max_error"] == pytest.approx(front.surface.score(mesh.points, mesh.faces).quality.max_error)
    assert record["levels"][-1]["mean_error"] < front.levels()[-1].mean_error


# -------------------------------------------------------------------------------------------------------- the command


def test_the_command_writes_levels_and_says_their_errors(folder, tmp_path, capsys):
    assert run("levels", folder, "-o", tmp_path / "levels") == 0
    said, record = capsys.readouterr().out, said_of(tmp_path / "levels")
    for level in record["levels"]:
        assert f"level {level['level']}: {level['triangles']} triangles" in said
        assert f"geometric error {level['geometric_error']:.4g}" in said
    assert said.endswith(f"written: {tmp_path / 'levels'}\n")
    assert run("levels", folder, "-o", tmp_path / "levels.glb", "--json", "--levels", "2") == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["form"], len(record["levels"])) == ("MSFT_lod", 2)


def test_the_command_takes_limits_and_shares(folder, front, tmp_path, capsys):
    assert run("levels", folder, "-o", tmp_path / "a", "--triangles", "100%", "20%", "60", "61", "--json") == 0
    heard = capsys.readouterr()
    levels = json.loads(heard.out)["levels"]
    whole = len(front.model.faces)
    assert [level["triangles"] for level in levels] == [
        front.best(triangles=n).triangles for n in (whole, whole // 5, 60)
    ]
    assert "1 of 4 levels are the same meshes as others" in heard.err
    assert run("levels", folder, "-o", tmp_path / "b", "--max-error", "1e-9", "1e9", "-q") == 0
    assert [level["solution"] for level in said_of(tmp_path / "b")["levels"]] == [len(front) - 1, 0]


def test_a_limit_that_no_mesh_meets_ends_in_1_with_nothing_written(folder, tmp_path, capsys):
    assert run("levels", folder, "-o", tmp_path / "a", "--triangles", "100", "1") == 1
    assert "nothing is written" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-o", "a", "--levels", 0), "0"),
        (("-o", "a", "--levels", 2, "--triangles", 9), "not allowed with"),
        (("-o", "a", "--format", "dae"), "--format dae is unknown"),
        (("-o", "a", "--format", "3d-tile"), "did you mean '3d-tiles'"),
        (("-o", "a.ply"), "one file holds levels as glb alone"),
        (("-o", "a.glb", "--format", "ply"), "--format ply does not go with the file a.glb"),
        (("-o", "a", "--compress"), "ply is not compressed; write glb"),
        ((), "-o/--output"),
    ],
)
def test_what_the_command_cannot_do_is_said_in_a_line(folder, tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.chdir(tmp_path)
    assert run("levels", folder, *options) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_levels_are_replaced_only_when_asked_and_nothing_else_ever_is(folder, tmp_path, capsys):
    out = tmp_path / "levels"
    assert run("levels", folder, "-o", out, "-q") == 0
    assert run("levels", folder, "-o", out, "-q") == 2
    assert "exists already" in capsys.readouterr().err
    assert run("levels", folder, "-o", out, "-q", "--overwrite", "--format", "3d-tiles") == 0
    assert not list(out.glob("*.ply"))
    (out / "mine.txt").write_text("x")
    assert run("levels", folder, "-o", out, "-q", "--overwrite") == 2
    assert "holds mine.txt, which is no part of levels of detail" in capsys.readouterr().err
    assert run("levels", folder, "-o", folder, "-q", "--overwrite") == 2, "never the front itself"
    assert (folder / "front.csv").exists()


@pytest.mark.usefixtures("draco")
def test_pick_compresses_a_glb_and_says_by_how_much(folder, tmp_path, capsys):
    assert run("pick", folder, "--triangles", 100, "-o", tmp_path / "a.glb", "--compress") == 0
    assert "compressed; vertices moved by at most" in capsys.readouterr().out
    assert run("pick", folder, "--triangles", 100, "-o", tmp_path / "b.glb", "--compress", "--json") == 0
    assert json.loads(capsys.readouterr().out)["moved_by_at_most_m"] > 0.0
    assert run("pick", folder, "--triangles", 100, "--compress") == 2
    assert "name its file" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.usefixtures("draco")
def test_levels_of_a_mountain_are_where_it_stands_in_every_program(shared_data, tmp_path):
    warp = pytest.importorskip("rasterio.warp", reason="no rasterio: pip install rasterio")
    source = grid_source(np.load(shared_data / "dem_sthelens.npz")["elevation"], 30.0, 30.0, name="sthelens")
    points = source.points + np.array([558_000.0, 5_107_000.0, 0.0])
    source = dataclasses.replace(source, points=points, georeference={"epsg": 32610, "unit": "metre"})
    front = front_of(source)[:-2]
    levels = front.levels()
    assert levels[0].triangles > 50_000
    save_levels(front, tmp_path / "levels.glb", levels)
    found = json.loads(run_script("babylon.mjs", tmp_path / "levels.glb", str(len(levels)), needs=BABYLON))
    for level, solution in zip(found[::-1], levels, strict=True):
        assert difference(level["corners"], y_up(corners_of(solution))) < 1e-3
    record = save_levels(front, tmp_path / "tiles", levels, form="3d-tiles")
    views = [f"{times * record['diameter']:.0f}" for times in (400, 4, 1, 0.25, 0.05)]
    said = json.loads(run_script("tiled.mjs", tmp_path / "tiles" / "tileset.json", *views, needs=TILES))
    for level, solution in zip(record["levels"], levels, strict=True):
        corners = corners_of(solution).reshape(-1, 3)
        x, y = warp.transform("EPSG:32610", "EPSG:4326", *corners[:, :2].T.tolist())
        expected = warp.transform("EPSG:4979", "EPSG:4978", x, y, corners[:, 2].tolist())
        assert difference(said["corners"][level["file"]], np.column_stack(expected)) < 1e-3
    packed = save_levels(front, tmp_path / "packed", levels, form="glb", compress=True)["levels"]
    unpacked = json.loads(run_script("unpacked.mjs", *(tmp_path / "packed" / p["file"] for p in packed), needs=DRACO))
    for level, (mesh,), solution in zip(packed, unpacked, levels, strict=True):
        off = difference_in_any_order(mesh["position"], y_up(corners_of(solution)))
        assert off <= level["moved_by_at_most_m"] * (1 + 1e-6)
        assert off <= COMPRESSION_SHARE * solution.mean_error
