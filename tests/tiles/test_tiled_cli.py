"""``meshsimp simplify --tile``: what a person with a big height grid sees and gets."""

import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from cracks import find_cracks

from meshsimp_pymoo.cli import main
from meshsimp_pymoo.cli import tiling as tiled_command
from meshsimp_pymoo.cli.parser import make_parser
from meshsimp_pymoo.cli.requests import Search, request_of
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ResultError, UsageError
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import read_source, write_mesh
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.opening import open_grid
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.report import figures
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.tiles.front import TILE
from meshsimp_pymoo.tiles.thin import thin_tile

# How pictures look is shown in tests/report.
pytestmark = pytest.mark.usefixtures("sketched", "few_moves")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("grid") / "relief.npy"
    grid = open_grid(build_model(load("jacksboro:4")))
    np.save(path, grid.heights.astype(np.float32))
    return path


@pytest.fixture(scope="module")
def out(path, few_moves, sketched, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "front"
    call = ["simplify", str(path), "-o", str(out), "--tile", "64", "--triangles", "700", "--meshes", "4", "--jobs", "1"]
    assert main([*call, "--spacing", "30"]) == 0
    return out


def test_the_front_its_meshes_and_the_chosen_one_are_there(out, path):
    expected = {"front.csv", "front.png", "report.html", "front.npz", "meshes", "chosen.ply", "run.json"}
    expected |= {"quality.json", "quality.html"}
    assert {entry.name for entry in out.iterdir()} == expected
    assert (out / "front.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((out / "meshes").iterdir())) == 4
    chosen = read_source(out / "chosen.ply")
    assert 690 <= len(chosen.faces) <= 700
    assert find_cracks(chosen.points, chosen.faces) == 0
    record = json.loads((out / "run.json").read_text())
    assert set(record["settings"]) == {"triangles", "format", "meshes", "tile", "pieces"}  # nothing of a search
    assert record["model"]["vertices"] == np.load(path).size


def test_an_independent_referee_agrees_with_the_front_of_a_mesh_whose_vertices_are_a_grid(tmp_path, oracle):
    heights = open_grid(build_model(load("jacksboro:3"))).heights[:16, :130]  # two tiles
    source = grid_source(heights, 1.0, 1.0, name="relief")
    write_mesh(tmp_path / "relief.ply", source.points, source.faces)
    call = ["simplify", str(tmp_path / "relief.ply"), "-o", str(tmp_path / "out"), "--tile", "64", "--jobs", "1"]
    assert main([*call, "--meshes", "6", "--quiet", "--no-page"]) == 0
    table = tmp_path / "out" / "front.csv"
    command = [sys.executable, str(oracle), str(tmp_path / "relief.ply"), "--front", str(table)]
    judged = subprocess.run(command, capture_output=True, text=True)
    assert judged.returncode == 0, judged.stdout + judged.stderr


def test_the_meshes_are_those_of_the_untiled_problem(out, path):
    front = Front.load(out)
    problem = MeshProblem(path, spacing=30.0)
    row = front.run["chosen"]
    kept = front.kept[row][problem.model.source_index]
    whole = problem.simplify(kept)
    assert whole.quality.error == pytest.approx(front.quality[row].error, rel=1e-9)
    chosen = read_source(out / "chosen.ply")
    assert np.array_equal(
        chosen.points, problem.model.file_points[np.argsort(problem.model.source_index)][front.kept[row]]
    )
    assert len(chosen.faces) == whole.quality.triangles


def test_a_mesh_of_any_size_is_picked_from_the_folder(out, path, tmp_path, capsys):
    assert main(["pick", str(out), "--triangles", "555", "-o", str(tmp_path / "small.ply"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    mesh = read_source(tmp_path / "small.ply")
    assert 545 <= len(mesh.faces) == said["triangles"] <= 555
    assert said["solution"] is None
    assert main(["pick", str(out), "--triangles", "555"]) == 0
    assert capsys.readouterr().out.startswith("between two solutions of ")
    assert find_cracks(mesh.points, mesh.faces) == 0
    assert main(["pick", str(out), "--solution", "1", "-o", str(tmp_path / "one.obj")]) == 0
    assert main(["pick", str(out), "--max-error", "0", "-o", str(tmp_path / "none.ply")]) == 1
    assert "nothing is written" in capsys.readouterr().err
    np.save(tmp_path / "other.npy", np.load(path) + 1)
    assert main(["pick", str(out), "--knee", "--model", str(tmp_path / "other.npy")]) == 2
    assert "is the front of another model than" in capsys.readouterr().err


def test_an_error_is_wished_for_and_a_time_is_taken(path, tmp_path, capsys):
    call = ["simplify", str(path), "-o", str(tmp_path / "out"), "--tile", "64", "--meshes", "none", "--jobs", "1"]
    assert main([*call, "--no-page", "--max-error", "200", "--rms-error", "40", "--time", "2s"]) == 0
    front = Front.load(tmp_path / "out")
    chosen = front[front.run["chosen"]]
    assert chosen.max_error <= 200
    assert chosen.rms_error <= 40
    assert all(s.max_error > 200 or s.rms_error > 40 for s in front if s.triangles < chosen.triangles)
    assert front.run["settings"]["time"] == 2.0
    assert front.objectives == ("error", "triangles")


def test_a_tiled_front_is_scored_against_drawn_and_reported_as_any_other(out, path, tmp_path, capsys):
    front = Front.load(out)
    knee = front.knee()
    knee.save(tmp_path / "knee.ply")
    assert np.array_equal(read_source(tmp_path / "knee.ply").points, knee.mesh.vertices)
    assert main(["score", str(path), str(tmp_path / "knee.ply"), "--front", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["error"] == pytest.approx(knee.error, rel=1e-9)
    assert said["front"]["solution"] == knee.solution
    assert said["front"]["error_ratio"] == pytest.approx(1)
    for how in (["--spacing", "31"], ["--outside", "ignore"]):
        assert main(["score", str(path), str(tmp_path / "knee.ply"), "--front", str(out), *how]) == 2
        assert f"and is compared as it was made; leave {how[0]} out" in capsys.readouterr().err
    shutil.copytree(out, tmp_path / "out")
    model = ["--model", str(path)]
    for name in ("front.png", "report.html"):
        (tmp_path / "out" / name).unlink()
    assert main(["report", str(tmp_path / "out"), *model]) == 0
    assert "front.png, report.html" in capsys.readouterr().out
    assert (tmp_path / "out" / "front.png").read_bytes() == (out / "front.png").read_bytes()
    page = (tmp_path / "out" / "report.html").read_text()
    data = json.loads(page[page.index('id="data"') :].split(">", 1)[1].split("</script>")[0])
    assert data["columns"]["error"] == [q.error for q in front.quality]
    assert all(solution is not None for solution in data["solutions"])
    assert data["knee"] == knee.solution
    assert len(front.to_frame()) == len(front)
    ends = front[:: len(front) - 1]
    assert [solution.quality for solution in ends] == [front[0].quality, front[-1].quality]
    assert knee.plot_error().collections
    with pytest.raises(ModelError, match="not fitted"):
        knee.refit()
    with pytest.raises(ModelError, match=r"meshes of tiles are Delaunay, not free; simplify it in one piece"):
        front.surface.of_faces(knee.faces)
    assert front.problem.evaluate(front.kept[3]).tolist() == [front[3].error, front[3].triangles]


def test_pictures_of_a_big_grid_are_drawn_from_some_of_its_samples(path, out, monkeypatch):
    monkeypatch.setattr(figures, "DRAWN_VERTICES", 400)
    surface = Front.load(out).surface
    drawn, faces = figures.original_mesh(surface)
    rows, columns = surface.model.shape
    assert 200 < drawn.sum() <= 400
    assert drawn[surface.model.corners].all()
    assert len(faces) == 2 * (len(np.unique(np.flatnonzero(drawn) // columns)) - 1) * (
        len(np.unique(np.flatnonzero(drawn) % columns)) - 1
    )
    whole = surface.simplify(drawn)
    some = np.arange(3, rows * columns, 17)
    part = surface.simplify(drawn, rows=some)
    assert part.quality == whole.quality
    assert np.array_equal(part.deviation, whole.deviation[some])
    assert whole.deviation.sum() == pytest.approx(whole.quality.error)
    assert np.array_equal(part.faces, whole.faces)


def test_levels_have_the_sizes_between_two_solutions_too(out, tmp_path, capsys):
    front = Front.load(out)
    size = (front[-2].triangles + front[-1].triangles) // 2
    assert main(["levels", str(out), "-o", str(tmp_path / "levels"), "--triangles", str(size), "300", "--json"]) == 0
    first, second = json.loads(capsys.readouterr().out)["levels"]
    assert (first["solution"], first["free"]) == (None, False)
    assert 0.9 * size < first["triangles"] <= size
    assert second["triangles"] <= 300
    for level in (first, second):
        assert len(read_source(tmp_path / "levels" / level["file"]).faces) == level["triangles"]


@pytest.mark.usefixtures("all_moves")
def test_two_processes_write_the_same_bytes(path, tmp_path):
    np.save(tmp_path / "strip.npy", np.load(path)[:20])  # two tiles
    call = ["simplify", str(tmp_path / "strip.npy"), "--tile", "64", "--triangles", "300", "--meshes", "4"]
    for jobs in ("1", "2"):
        how = ["--jobs", jobs, "--threads", "1", "--spacing", "30", "--quiet", "--no-page"]
        assert main([*call, "-o", str(tmp_path / jobs), *how]) == 0
    for file in ("front.csv", "front.npz", "chosen.ply"):
        assert (tmp_path / "2" / file).read_bytes() == (tmp_path / "1" / file).read_bytes(), file


def test_pieces_are_written_one_for_each_tile(path, tmp_path, capsys):
    call = ["simplify", str(path), "-o", str(tmp_path / "out"), "--tile", "64", "--pieces", "--pick", "knee"]
    assert main([*call, "--meshes", "none", "--jobs", "1", "--no-page", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    parts = [read_source(file) for file in sorted((tmp_path / "out" / "chosen").iterdir())]
    assert len(parts) >= 4
    assert sum(len(part.faces) for part in parts) == summary["chosen"]["triangles"]
    points = np.concatenate([part.points for part in parts])
    start = np.cumsum([0] + [len(part.points) for part in parts])
    faces = np.concatenate([part.faces + first for part, first in zip(parts, start, strict=False)])
    welded, rows = np.unique(points, axis=0, return_inverse=True)
    assert find_cracks(welded, rows.ravel()[faces]) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--moves", "500"], "--moves does not go with tiles"),
        (["--algorithm", "nsga2_v1"], "--algorithm does not go with tiles"),
        (["--population", "50"], "--population does not go with tiles"),
        (["--max-edge", "5"], "--max-edge does not go with tiles"),
        (["--refit"], "--refit does not go with tiles"),
        (["--pin", "hull"], "--pin does not go with tiles"),
        (["--measure", "rms"], "--measure does not go with tiles"),
        (["--window", "0,0,5000,10"], "does not lie within"),
        (["--format", "landxml", "--up", "x"], "heights of a grid are along z"),
        (["--triangles", "1"], "at least 2 triangles"),
        (["--dask", "tcp://127.0.0.1:9"], "no Dask scheduler answers"),
    ],
)
def test_what_tiles_cannot_do_is_refused_in_one_line(path, tmp_path, capsys, options, message, monkeypatch):
    monkeypatch.setattr("meshsimp_pymoo.workers.CONNECT_SECONDS", 0.3)
    assert main(["simplify", str(path), "-o", str(tmp_path / "out"), "--tile", "64", *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not list(tmp_path.glob("out/*.csv"))


def test_each_part_of_a_request_is_known_to_tiles_or_refused(path, tmp_path, monkeypatch):
    request = request_of(make_parser().parse_args(["simplify", str(path), "--tile", "64"]))
    tiled_command._refuse_unknown(request)
    new = dataclasses.make_dataclass("Search", [("smoothing", int, 0)], bases=(Search,), frozen=True)
    monkeypatch.setitem(tiled_command.KNOWN, new, tiled_command.KNOWN[Search])
    tiled_command._refuse_unknown(dataclasses.replace(request, search=new()))
    with pytest.raises(UsageError, match="--smoothing does not go with tiles"):
        tiled_command._refuse_unknown(dataclasses.replace(request, search=new(smoothing=3)))


def test_the_help_says_how_large_tiles_are(capsys):
    with pytest.raises(SystemExit):
        main(["simplify", "--help"])
    assert f"one side of a tile (default: {TILE}, for" in " ".join(capsys.readouterr().out.split())


def test_a_scan_is_not_cut_into_tiles(tmp_path, capsys):
    assert main(["simplify", "face:300", "-o", str(tmp_path / "out"), "--tile", "64"]) == 2
    assert "only a height grid can be cut into tiles" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_big_grid_that_tiles_cannot_be_of_is_searched_in_one_piece_unless_they_are_asked_for(
    tmp_path, capsys, monkeypatch
):
    heights = np.add.outer(np.arange(20.0), np.arange(30.0) ** 2)
    np.savez(tmp_path / "north.npz", z=heights, x=np.arange(30.0), y=np.arange(20.0))
    monkeypatch.setattr("meshsimp_pymoo.cli.searching.wants_tiles", lambda request: True)
    command = ["simplify", str(tmp_path / "north.npz"), "-o", str(tmp_path / "out"), "--meshes", "none", "--up", "z"]
    assert main([*command, "--tile", "64"]) == 2
    assert "as tiles want them" in capsys.readouterr().err
    assert main([*command, "--evaluations", "150", "--algorithm", "nsga2_v1"]) == 2  # these options are not for tiles
    monkeypatch.setattr("meshsimp_pymoo.search.memetic.MOVES_PER_VERTEX", (1.0, 1.0))  # nor are those that shorten it
    assert main(command) == 0
    assert "columns to the east; so it is not cut into tiles but searched in one piece" in capsys.readouterr().err
    assert (tmp_path / "out" / "front.csv").exists()


def test_big_grids_are_cut_into_tiles_without_being_asked(path, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(tiled_command, "TILED_FROM", 5_000)
    asked = []
    monkeypatch.setattr(tiled_command, "fits_in_one_piece", lambda count: bool(asked.append(count)))
    assert (
        main(["simplify", str(path), "-o", str(tmp_path / "out"), "--meshes", "none", "--jobs", "1", "--no-page"]) == 0
    )
    assert "thinned tile by tile" in capsys.readouterr().out
    # where the memory allows, in one piece
    assert asked == [np.load(path).size]
    monkeypatch.setattr(tiled_command, "fits_in_one_piece", lambda count: True)
    call = ["simplify", str(path), "-o", str(tmp_path / "whole"), "--generations", "1", "--population", "4"]
    assert main([*call, "--meshes", "none"]) == 0
    assert (tmp_path / "whole" / "front.npz").exists()


def again(path, target):
    call = ["simplify", str(path), "-o", str(target), "--tile", "64", "--triangles", "700", "--meshes", "4"]
    return [*call, "--spacing", "30", "--jobs", "1", "--quiet", "--no-page"]


def test_killed_and_started_again_it_goes_on_and_ends_with_the_same_bytes(out, path, tmp_path, monkeypatch):
    target = tmp_path / "out"
    child = os.fork()
    if child == 0:
        os._exit(main(again(path, target)))
    deadline, ended = time.monotonic() + 120, 0
    while len(list((target / "tiles").glob("*.npz"))) < 3 and not ended:
        assert time.monotonic() < deadline
        time.sleep(0.002)
        ended, _ = os.waitpid(child, os.WNOHANG)
    if not ended:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    if not (target / "front.csv").exists():
        assert len(list((target / "tiles").glob("*.npz"))) >= 3
        assert main(again(path, target)) == 0
    for file in ("front.csv", "front.npz", "chosen.ply"):
        assert (target / file).read_bytes() == (out / file).read_bytes(), file
    assert not (target / "tiles").exists()


def test_interrupted_it_says_so_and_goes_on(out, path, tmp_path, monkeypatch, capsys):
    target, calls = tmp_path / "out", []

    def interrupted(tile):
        calls.append(tile.name)
        if len(calls) == 6:
            raise KeyboardInterrupt
        return thin_tile(tile)

    monkeypatch.setattr("meshsimp_pymoo.tiles.front.thin_tile", interrupted)
    assert main(again(path, target)) == 130
    assert "finished tiles are in" in capsys.readouterr().err
    assert len(list((target / "tiles").glob("*.npz"))) >= 2
    assert main(again(path, target)) == 0
    assert calls[5] == calls[6]
    assert (target / "front.csv").read_bytes() == (out / "front.csv").read_bytes()


def test_unfinished_tiles_of_other_settings_are_named_and_can_be_overwritten(path, tmp_path, capsys):
    out = tmp_path / "out"
    (out / "tiles").mkdir(parents=True)
    (out / "tiles" / "what.json").write_text("{}\n")
    call = ["simplify", str(path), "-o", str(out), "--tile", "64", "--meshes", "none", "--jobs", "1", "--no-page"]
    call += ["--triangles", "300", "--quiet"]
    assert main(call) == 2
    assert "unfinished tiles of another model or of other settings" in capsys.readouterr().err
    assert main([*call, "--overwrite"]) == 0
    assert main(call) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_front_of_another_grid_is_not_read(out, path):
    with pytest.raises(ResultError, match="is the front of another model"):
        Front.load(out, model=open_grid(path, spacing=(30.0, 31.0)))
    (out / "front.npz").rename(out / "gone.npz")
    try:
        with pytest.raises(ResultError, match=r"front\.npz: cannot be read"):
            Front.load(out)
    finally:
        (out / "gone.npz").rename(out / "front.npz")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"model": {"hash": "0", "file": None}}, "run.json: model.name is not what a front's record holds"),
        ({"model": {"name": "relief.npy", "hash": "0", "file": 3}}, "run.json: model.file is not"),
        ({"solutions": 3}, "run.json: is not the record of this front of"),
        ({"options": {"spacing": "wide"}}, "its record cannot be used: spacing is 'wide': expected a number"),
        ({"options": [1]}, "run.json: options is not"),
    ],
)
def test_a_damaged_record_is_answered_in_one_line(out, tmp_path, capsys, changed, message):
    shutil.copytree(out, tmp_path / "out")
    record = tmp_path / "out" / "run.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | changed))
    assert main(["pick", str(tmp_path / "out"), "--knee"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
