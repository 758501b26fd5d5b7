"""A model in degrees from one end to the other: measured in metres, written in degrees."""

from __future__ import annotations

import csv
import json
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from meshsimp_pymoo import Front, MeshProblem
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.formats.table import read_source, write_mesh
from meshsimp_pymoo.opening import open_grid, open_model
from meshsimp_pymoo.surface.height import HeightSurface, refit_heights
from meshsimp_pymoo.surface.rules import Rules

QUICK = ("--algorithm", "nsga2_v1", "--generations", "3", "--population", "12", "--threads", "1")
WEST, SOUTH = 11.0, 46.9
STEPS = (1 / 1200, 1 / 1800)


def terrain(rows=34, columns=27, seed=3):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:rows, :columns]
    return np.round(900 + 300 * np.sin(x / 5) * np.cos(y / 6) + rng.normal(size=(rows, columns)) * 9, 2)


def lattice(heights):
    """Return the samples (rows * columns, 3) of a raster in degrees, row by row from the north."""
    rows, columns = heights.shape
    x = WEST + STEPS[0] * (np.arange(columns) + 0.5)
    y = SOUTH + STEPS[1] * (rows - np.arange(rows) - 0.5)
    return np.column_stack([np.tile(x, rows), np.repeat(y, columns), heights.ravel()])


def sheet(seed=0, n=150):
    """Return a mesh in degrees whose places are no lattice, so that no tie depends on rounding."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.random((n, 2)) * [0.3, 0.2] + [WEST, SOUTH], rng.random(n) * 400])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return cloud_source(points, georeference={"epsg": 4326}, max_edge=6000)


@pytest.fixture
def raster(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    heights = terrain().astype(np.float32)
    rows, columns = heights.shape
    place = rasterio.Affine(STEPS[0], 0, WEST, 0, -STEPS[1], SOUTH + STEPS[1] * rows)
    look = {"driver": "GTiff", "count": 1, "dtype": "float32", "crs": "EPSG:4326", "transform": place}
    with rasterio.open(tmp_path / "dem.tif", "w", height=rows, width=columns, **look) as file:
        file.write(heights, 1)
    return tmp_path / "dem.tif"


def referee(points, vertices, faces, scale):
    """Return the error of a mesh by the definition alone, everything scaled: slow, and of nobody's kernels."""
    points, vertices = np.asarray(points) * [*scale, 1], np.asarray(vertices) * [*scale, 1]
    cost = np.full(len(points), np.inf)
    corners = vertices[faces]
    for a, b, c in corners:
        d = np.cross(b[:2] - a[:2], c[:2] - a[:2])
        wb = np.cross(points[:, :2] - a[:2], c[:2] - a[:2]) / d
        wc = np.cross(b[:2] - a[:2], points[:, :2] - a[:2]) / d
        inside = (1 - wb - wc >= -1e-9) & (wb >= -1e-9) & (wc >= -1e-9)
        off = np.abs(a[2] + wb * (b[2] - a[2]) + wc * (c[2] - a[2]) - points[:, 2])
        cost[inside] = np.minimum(cost[inside], off[inside])
    a, b = (np.roll(corners, shift, axis=1).reshape(-1, 3) for shift in (0, -1))
    for p in np.flatnonzero(np.isinf(cost)):
        along = (b - a)[:, :2]
        t = np.clip(((points[p, :2] - a[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
        near = a + t[:, None] * (b - a)
        gap = np.linalg.norm(near[:, :2] - points[p, :2], axis=1)
        cost[p] = np.hypot(gap.min(), near[gap.argmin(), 2] - points[p, 2])
    return cost.sum()


pytestmark = [
    pytest.mark.usefixtures("sketched"),  # how pictures look is shown in tests/report
    pytest.mark.filterwarnings("ignore:.*its coordinates are degrees:meshsimp_pymoo.errors.ModelWarning"),
    pytest.mark.filterwarnings("ignore::PendingDeprecationWarning"),  # rasterio multiplies transforms in an old way
    pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors:DeprecationWarning"),
]


def test_errors_are_those_of_the_referee_in_metres_and_files_keep_their_degrees(raster, tmp_path):
    out = tmp_path / "out"
    call = ["simplify", str(raster), "-o", str(out), *QUICK, "--refit"]
    assert main([*call, "--meshes", "6", "--triangles", "40", "--quiet"]) == 0
    record = json.loads((out / "run.json").read_text())
    scale = record["model"]["georeference"]["scale"]
    assert scale == pytest.approx([76_184, 111_169], abs=1)
    original = read_source(raster).points
    np.testing.assert_allclose(original, lattice(terrain().astype(np.float32)), rtol=1e-14)
    checked = 0
    with (out / "front.csv").open(newline="") as table:
        for row in csv.DictReader(table):
            for column, name in (("error", "mesh"), ("refitted_error", "refitted_mesh")):
                if row[name]:
                    mesh = read_source(out / row[name])
                    found = referee(original, mesh.points, mesh.faces, scale)
                    assert found == pytest.approx(float(row[column]), rel=1e-9, abs=1e-6)
                    own = {tuple(xy) for xy in original[:, :2].tolist()}
                    assert {tuple(xy) for xy in mesh.points[:, :2].tolist()} <= own
                    checked += 1
    assert checked >= 10


def test_the_scale_is_stated_wherever_numbers_are(raster, tmp_path, capsys):
    out = tmp_path / "out"
    call = ["simplify", str(raster), "-o", str(out), *QUICK, "--meshes", "4"]
    assert main([*call, "--triangles", "40", "--json"]) == 0
    said = capsys.readouterr()
    summary = json.loads(said.out)["model"]
    assert said.err.count("its coordinates are degrees") == 1
    x, y = summary["scale"]
    stated = f"{x:.8g} x {y:.8g} m to a degree"
    assert (summary["epsg"], summary["unit"]) == (4326, "m")
    page = (out / "report.html").read_text()
    assert f"in m. Coordinates: EPSG:4326, {stated}." in page
    assert main(["info", str(raster)]) == 0
    lines = capsys.readouterr().out
    assert f"EPSG:4326, {stated}" in lines
    width, depth = 26 * STEPS[0] * x, 33 * STEPS[1] * y
    assert f"measured        {width:.6g} x {depth:.6g} x " in lines
    assert "[degree, degree, m]" in lines
    front = Front.load(out)
    assert front.unit == "m"
    assert front.plot().get_ylabel() == "error [m], log scale"
    assert main(["pick", str(out), "--triangles", "40", "-o", str(tmp_path / "a.ply")]) == 0
    assert " m, mean " in capsys.readouterr().out
    assert main(["report", str(out), "--quiet"]) == 0
    assert (out / "report.html").read_text() == page
    capsys.readouterr()
    assert main(["score", str(raster), str(tmp_path / "a.ply"), "--front", str(out), "--json"]) == 0
    said = capsys.readouterr()
    assert said.err.count("its coordinates are degrees") == 1  # the other mesh has no frame of its own
    scored = json.loads(said.out)
    assert scored["error"] == pytest.approx(front.best(triangles=40).error, rel=1e-9)
    assert (scored["front"]["error_ratio"], scored["scale"]) == (pytest.approx(1.0), [x, y])


def test_twins_in_metres_and_in_degrees_have_the_same_front():
    degrees = sheet()
    metres = degrees.measured
    problems = [MeshProblem(source, pin=[3], outside="nearest") for source in (degrees, metres)]
    models = [problem.model for problem in problems]
    np.testing.assert_array_equal(models[0].points, models[1].points)
    assert models[0].hash == models[1].hash  # so the same kept sets and the same errors, whatever searches
    np.testing.assert_array_equal(models[0].file_points, degrees.points[models[0].source_index])
    subsets = np.random.default_rng(1).random((20, models[0].n_vertices)) < 0.4
    fronts = [Front.from_subsets(problem, subsets) for problem in problems]
    np.testing.assert_array_equal(fronts[0].kept, fronts[1].kept)
    np.testing.assert_array_equal(fronts[0].F, fronts[1].F)
    # divided by the scale and multiplied again, rounding remains
    twin = build_source(metres.points / degrees.scale, metres.faces, georeference=degrees.georeference, name="twin")
    third = MeshProblem(twin, pin=[3])
    np.testing.assert_allclose(third.evaluate_subsets(subsets), problems[0].evaluate_subsets(subsets), rtol=1e-9)


def test_a_grid_in_metres_and_its_twin_in_degrees(tmp_path):
    heights = terrain()
    np.savez(tmp_path / "metres.npz", elevation=heights, dx=64.0, dy=128.0)
    np.savez(tmp_path / "degrees.npz", elevation=heights, dx=64.0 / 2**16, dy=128.0 / 2**17)
    calls = [[str(tmp_path / "metres.npz")], [str(tmp_path / "degrees.npz"), "--scale", f"{2**16},{2**17}"]]
    outs = [tmp_path / "a", tmp_path / "b"]
    for call, out in zip(calls, outs, strict=True):
        more = ["-o", str(out), *QUICK, "--meshes", "2", "--no-page", "--quiet"]
        assert main(["simplify", *call, *more]) == 0
    for name in ("front.csv", "front.npz"):
        assert (outs[0] / name).read_bytes() == (outs[1] / name).read_bytes()
    one, other = (np.array(read_source(next((out / "meshes").iterdir())).points) for out in outs)
    np.testing.assert_array_equal(one, other * [2**16, 2**17, 1])


def test_a_direction_and_a_patch_are_found_in_metres():
    degrees = sheet()
    steep = build_source(degrees.points * [1, 1, 3], degrees.faces, georeference=degrees.georeference)
    model = open_model(steep)  # heights of a thousand, places of a third: a wall in degrees
    np.testing.assert_array_equal(model.up, [0, 0, 1])
    np.testing.assert_array_equal(open_model(steep, Options(patch="front")).up, [0, 0, 1])
    patch = open_model(trimesh.Trimesh(degrees.points, degrees.faces, process=False), Options(patch="front", up="z"))
    assert patch.scale.tolist() == [1, 1, 1]
    scaled = open_model(degrees, Options(patch="front", up="z"))
    assert scaled.scale.tolist() == [*degrees.georeference["scale"], 1]
    np.testing.assert_array_equal(scaled.file_points, degrees.points[scaled.source_index])
    said = open_model(trimesh.Trimesh(degrees.points, degrees.faces, process=False), Options(scale="degrees"))
    assert said.scale.tolist() == scaled.scale.tolist()


def test_pins_scores_and_refitted_heights_come_from_and_go_to_degrees():
    degrees = sheet()
    row = 7
    near = degrees.points[row] + [1e-4, -1e-4, 0]  # ten metres beside it
    for position in (near, near[:2]):
        surface = HeightSurface(open_model(degrees), Rules(pin=[position]))
        assert surface.pinned[np.flatnonzero(surface.model.source_index == row)].all()
    with pytest.raises(ModelError, match="away, more than 1% of the diagonal"):
        HeightSurface(open_model(degrees), Rules(pin=[[WEST - 0.01, SOUTH, 0]]))  # 760 m beside 30 km
    model = surface.model
    kept = np.random.default_rng(2).random(model.n_vertices) < 0.5
    mesh = surface.simplify(kept | surface.pinned)
    assert surface.score(model.file_points, mesh.faces).quality.error == pytest.approx(mesh.quality.error, rel=1e-9)
    assert mesh.quality.uncovered > 0
    fitted = refit_heights(surface, kept | surface.pinned)
    np.testing.assert_array_equal(fitted.vertices[:, :2], model.file_points[fitted.rows, :2])
    compact = np.searchsorted(fitted.rows, fitted.faces)
    scale = degrees.georeference["scale"]
    assert referee(model.file_points, fitted.vertices, compact, scale) == pytest.approx(fitted.error, rel=1e-9)


def test_heights_of_a_tilted_model_are_refitted_along_its_own_direction():
    surface = HeightSurface(open_model(sheet(), Options(up=(0.02, -0.03, 1))))
    fitted = refit_heights(surface, (np.random.default_rng(2).random(surface.n_vertices) < 0.5) | surface.pinned)
    assert fitted.bound <= fitted.error <= 1.001 * fitted.bound < 0.98 * fitted.before


def test_single_precision_is_judged_in_metres(tmp_path):
    degrees = sheet()
    surface = HeightSurface(open_model(degrees))
    solution = Front.from_subsets(MeshProblem(surface), np.ones((1, surface.n_vertices), bool))[0]
    with pytest.warns(ModelWarning, match=r"stl holds single precision, which moves vertices by up to 0\.[12]"):
        solution.save(tmp_path / "a.stl")


def test_tiles_have_the_frame_of_the_whole(raster, tmp_path, capsys):
    grid, model = open_grid(raster), open_model(raster)
    np.testing.assert_array_equal(grid.scale, model.scale[:2])
    order = np.argsort(model.source_index)
    np.testing.assert_array_equal(grid.xy_at(np.arange(grid.n_vertices)), model.xy[order])
    assert (grid.unit, grid.georeference) == (model.unit, model.georeference)
    assert grid.hash != open_grid(raster, scale="none").hash
    out = tmp_path / "tiled"
    call = ["simplify", str(raster), "-o", str(out), "--tile", "64", "--triangles", "60", "--meshes", "2"]
    assert main([*call, "--jobs", "1"]) == 0
    said = capsys.readouterr().out
    assert "EPSG:4326, " in said
    assert " m to a degree" in said
    assert json.loads((out / "run.json").read_text())["model"]["georeference"]["scale"] == list(grid.scale)
    front = Front.load(out)
    problem = MeshProblem(raster, footprint="hull")
    for row in range(0, len(front), 7):
        kept = np.zeros(model.n_vertices, bool)
        kept[order[np.flatnonzero(front.kept[row])]] = True
        whole = problem.quality(kept)
        assert front.quality[row].error == pytest.approx(whole.error, rel=1e-9)
        assert front.quality[row].triangles == whole.triangles == len(front[row].faces)
    # of a model that was read whole, rows and columns are found again
    again = open_grid(model)
    np.testing.assert_allclose(again.xy_at(np.arange(again.n_vertices)), model.xy[order], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(again.file_points[np.arange(5)], grid.file_points[np.arange(5)])
    assert main(["pick", str(out), "--max-error", "100", "-o", str(tmp_path / "b.ply")]) == 0
    assert " m, mean " in capsys.readouterr().out
    picked = read_source(tmp_path / "b.ply")
    assert picked.georeference["epsg"] == 4326
    assert main(["score", str(raster), str(tmp_path / "b.ply"), "--json"]) == 0
    scored = json.loads(capsys.readouterr().out)
    expected = referee(grid.file_points[np.arange(grid.n_vertices)], picked.points, picked.faces, grid.scale)
    assert scored["error"] == pytest.approx(expected, rel=1e-9)


def test_whoever_wants_degrees_gets_them(raster, tmp_path, recwarn):
    model = open_model(raster, Options(scale="none"))
    assert not [warning for warning in recwarn if "degrees" in str(warning.message)]
    assert model.scale.tolist() == [1, 1, 1]
    assert np.ptp(model.points, axis=0)[:2] == pytest.approx([26 * STEPS[0], 33 * STEPS[1]])
    assert "scale" not in model.georeference


def test_the_user_s_scale_goes_before_the_one_that_a_glb_states(tmp_path):
    source = sheet()
    write_mesh(tmp_path / "a.glb", source.points, source.faces, georeference=source.georeference)
    stated = read_source(tmp_path / "a.glb")
    assert stated.scale[:2].tolist() == source.georeference["scale"]
    assert read_source(tmp_path / "a.glb", Options(scale="none")).scale.tolist() == [1, 1, 1]
    assert read_source(tmp_path / "a.glb", Options(scale=(2.0, 3.0))).scale.tolist() == [2, 3, 1]


def test_a_stored_front_needs_its_scale_again(raster, tmp_path):
    out = tmp_path / "out"
    write_mesh(tmp_path / "mesh.obj", (degrees := sheet()).points, degrees.faces)
    problem = MeshProblem(tmp_path / "mesh.obj", scale="degrees")
    subsets = np.random.default_rng(1).random((5, problem.n_var)) < 0.4
    Front.from_subsets(problem, subsets).save(out, page=False, meshes=0)
    front = Front.load(out)
    assert front.run["options"]["scale"] == "degrees"
    assert front.unit == "m"
    assert front.problem.model.hash == problem.model.hash
    assert Path(front[0].save(tmp_path / "c.ply")).exists()
