"""The shell interface: what it writes, what it says, what it refuses."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import metadata
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting
from samples import freed

import meshsimp_pymoo
from meshsimp_pymoo import Front, MeshProblem, memetic
from meshsimp_pymoo.cli import main, searching, terminal
from meshsimp_pymoo.cli.commands.completion import SHELLS
from meshsimp_pymoo.cli.parser import make_parser
from meshsimp_pymoo.cli.requests import Wish
from meshsimp_pymoo.cli.results import _worth_picking
from meshsimp_pymoo.cli.terminal import described, front_in_words
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import all_formats, write_mesh, written_formats
from meshsimp_pymoo.front import FrontSolution
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.settings import plain
from meshsimp_pymoo.storage import MESHES_BY_DEFAULT, read_front
from meshsimp_pymoo.surface.measures import MEASURES, OBJECTIVES, OF_LINES, OF_MESH, Measure, Quality
from meshsimp_pymoo.surface.rules import Rules

# How pictures look is shown in tests/report.
pytestmark = pytest.mark.usefixtures("sketched")

PAPERS = ("--algorithm", "nsga2_v1")
# The default search takes several times as long: what is not about it is done with another.
DEFAULT = ("--generations", "2", "--population", "8")
QUICK = ("--generations", "3", "--population", "12", *PAPERS)
# The presets that the shell offers.
ALGORITHMS = [name for name, preset in PRESETS.items() if preset.whole_front]
COMMANDS = ("simplify", "pick", "levels", "quality", "score", "info", "run", "report", "warm", "completion")


@pytest.fixture
def roof_ply(tmp_path):
    roof = load("roof:5")
    write_mesh(tmp_path / "roof.ply", roof.points, roof.faces)
    return tmp_path / "roof.ply"


def run(*args):
    return main([str(arg) for arg in args])


def files(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def one_line(capsys):
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert err.startswith("meshsimp: ")
    return err


# -------------------------------------------------------------------------------------------------------- the main job


@pytest.mark.usefixtures("drawn")
def test_simplify_writes_a_front_that_reads_back_and_meshes_that_open(tmp_path, capsys):
    assert run("simplify", "face:200", "-o", tmp_path / "out", "--meshes", "all", *DEFAULT) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith("face:200: 200 vertices, ")
    stored = read_front(tmp_path / "out")
    assert (np.diff(stored.quality["triangles"]) > 0).all()
    assert (np.diff(stored.quality["error"]) < 0).all()
    for path, triangles in zip(stored.meshes, stored.quality["triangles"], strict=True):
        mesh = trimesh.load(tmp_path / "out" / path, process=False)
        assert len(mesh.faces) == triangles
        assert mesh.face_normals[:, 2].min() > 0
    assert (tmp_path / "out" / "front.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]


def test_the_front_is_what_a_pymoo_user_gets(tmp_path):
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--seed", 4, *DEFAULT) == 0
    problem = MeshProblem("roof:9")
    result = minimize(problem, memetic(8), ("n_gen", 2), seed=4)
    stored = read_front(tmp_path / "out")
    # Besides what the search found: all vertices, and the corners alone.
    ends = np.array([np.ones(problem.n_var, bool), problem.pinned])
    X, F = np.vstack([result.X, ends]), np.vstack([result.F, problem.evaluate(ends)])
    best = NonDominatedSorting().do(F, only_non_dominated_front=True)
    assert np.array_equal(stored.F, np.unique(F[best][:, ::-1], axis=0)[:, ::-1])
    chromosomes = {row.tobytes() for row in X}
    assert all(row.tobytes() in chromosomes for row in stored.kept)


@pytest.mark.parametrize(
    ("algorithm", "budget"),
    [
        ("memetic", ("--generations", "2")),
        ("memetic", ("--moves", "20000")),
        *zip(ALGORITHMS[1:], cycle([("--generations", "4"), ("--evaluations", "40")]), strict=False),
    ],
)
def test_one_seed_gives_the_same_bytes_with_one_and_two_threads(tmp_path, monkeypatch, algorithm, budget):
    written = []
    for name, threads in (("a", "1"), ("b", "2")):
        options = ("--population", "12", "--threads", threads, "--algorithm", algorithm, "--pick", "knee")
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        assert run("simplify", "face:150", "-o", "out", *options, *budget) == 0  # the page names its folder
        content = files(tmp_path / name / "out")
        del content["run.json"]  # it holds the time taken and the number of threads
        written.append(content)
    assert written[0] == written[1]
    assert {"front.csv", "front.npz", "front.png", "chosen.ply"} < set(written[0])


def test_another_seed_gives_another_front(tmp_path):
    for seed in (1, 2):
        assert run("simplify", "face:150", "-o", tmp_path / str(seed), "--seed", seed, *QUICK) == 0
    assert (tmp_path / "1" / "front.csv").read_bytes() != (tmp_path / "2" / "front.csv").read_bytes()


def test_the_record_of_the_run_holds_what_is_needed_to_repeat_it(tmp_path):
    options = ("--footprint", "hull", "--outside", "ignore", "--pin", "3,7")
    options += ("--evaluations", "30", "--population", "12", *PAPERS)
    assert run("simplify", "roof:5", "-o", tmp_path / "out", *options) == 0
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["options"] == plain(Options())
    assert record["rules"] == plain(Rules(footprint="hull", outside="ignore", pin=[3, 7]))
    assert record["objectives"] == ["error", "triangles"]
    expected = {
        "evaluations": 30,
        "time": None,
        "generations": None,
        "moves": None,
        "algorithm": "nsga2_v1",
        "population": 12,
        "threads": None,
        "free": False,
        "format": "ply",
        "meshes": 100,
        "refit": False,
    }
    assert record["settings"] == expected
    assert record["model"]["name"] == "roof:5"
    assert record["seed"] == 1
    assert record["generations"] == 3
    assert record["evaluations"] == 36
    assert record["seconds"] > 0
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", record["begun"])
    assert record["interrupted"] is False


def test_a_budget_in_moves_is_kept_and_recorded(tmp_path, capsys):
    options = ("-o", tmp_path / "out", "--moves", "5000", "--population", "12")
    assert run("simplify", "face:150", *options, "--json") == 0
    said = capsys.readouterr()
    assert "warning" not in said.err
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["settings"]["moves"] == record["moves"] == json.loads(said.out)["moves"] == 5000


def test_evaluations_of_the_memetic_search_are_taken_with_a_warning(tmp_path, capsys):
    options = ("-o", tmp_path / "out", "--evaluations", "20", "--population", "12")
    assert run("simplify", "roof:5", *options, "--quiet", "--no-page") == 0
    assert one_line(capsys) == (
        "meshsimp: warning: evaluations do not measure memetic, whose children cost any work; use --moves or --time\n"
    )


def test_the_budget_in_seconds_is_kept(tmp_path):
    run("simplify", "roof:5", "-o", tmp_path / "warm", *QUICK)  # compiles
    start = time.perf_counter()
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--time", "0.5s", "--population", "12", *PAPERS) == 0
    seconds = json.loads((tmp_path / "out" / "run.json").read_text())["seconds"]
    assert 0.3 <= seconds <= 2.0  # on a busy machine the last generation takes longer than those before
    assert time.perf_counter() - start < 8


def test_refitting_is_within_the_time_that_is_given_and_what_is_left_out_is_said(tmp_path, monkeypatch, capsys):
    def slowly(self, **how):
        time.sleep(0.05)
        return refit(self, **how)

    refit = FrontSolution.refit
    monkeypatch.setattr(FrontSolution, "refit", slowly)
    command = ("simplify", "jacksboro:20", "-o", tmp_path / "out", "--time", "1s", "--refit", "--triangles", 40)
    assert run(*command, "--population", 12, "--meshes", "all") == 0
    facts = json.loads((tmp_path / "out" / "run.json").read_text())
    assert facts["seconds"] <= 1.5
    assert facts["seconds"] + facts["refit_seconds"] <= 2.5
    rows = list(csv.DictReader((tmp_path / "out" / "front.csv").read_text().splitlines()))
    fitted = [row for row in rows if row["refitted_error"]]
    said = capsys.readouterr()
    written = len(list((tmp_path / "out" / "meshes").iterdir()))
    assert f"{len(fitted)} of {written} meshes are refitted in the time given" in said.err
    assert 1 <= len(fitted) < written
    assert len(list((tmp_path / "out" / "refitted").iterdir())) == len(fitted)
    assert rows[facts["chosen"]]["refitted_error"]  # first
    assert Front.load(tmp_path / "out")[facts["chosen"]].triangles <= 40


# ----------------------------------------------------------------------------------------------------- the mesh wanted


def chosen_row(folder, suffix="ply"):
    """Return the row of front.csv that chosen.ply is, and the whole front."""
    stored = read_front(folder)
    mesh = trimesh.load(folder / f"chosen.{suffix}", process=False)
    row = stored.run["chosen"]
    assert len(mesh.faces) == stored.quality["triangles"][row]
    return row, stored.quality


def test_triangles_picks_the_most_accurate_that_is_small_enough(tmp_path, capsys):
    assert run("simplify", "face:200", "-o", tmp_path / "out", "--triangles", 150, *QUICK) == 0
    row, quality = chosen_row(tmp_path / "out")
    assert quality["triangles"][row] <= 150
    assert quality["triangles"][row + 1] > 150
    said = rf"chosen: .*chosen\.ply \(solution {row}\): {quality['triangles'][row]} triangles"
    assert re.search(said, capsys.readouterr().out)


@pytest.mark.parametrize("column", ["max_error", "mean_error"])
def test_an_error_limit_picks_the_smallest_that_keeps_it(tmp_path, column):
    run("simplify", "face:200", "-o", tmp_path / "free", *QUICK)
    limit = float(np.median(read_front(tmp_path / "free").quality[column]))
    assert run("simplify", "face:200", "-o", tmp_path / "out", f"--{column.replace('_', '-')}", limit, *QUICK) == 0
    row, quality = chosen_row(tmp_path / "out")
    assert quality[column][row] <= limit
    assert (quality[column][:row] > limit).all()


def test_the_knee_lies_below_the_line_between_the_ends(tmp_path):
    assert run("simplify", "face:200", "-o", tmp_path / "out", "--pick", "knee", "--format", "obj", *QUICK) == 0
    row, quality = chosen_row(tmp_path / "out", "obj")
    e, t = (q / np.ptp(q) for q in (quality["error"], quality["triangles"].astype(float)))
    assert row == int(np.argmin(e + t))
    assert 0 < row < len(e) - 1


def test_a_front_of_one_solution_has_a_knee(tmp_path):
    options = ("--pick", "knee", "--generations", 30, "--population", 20)
    assert run("simplify", "plane:3", "-o", tmp_path / "out", *options) == 0
    stored = read_front(tmp_path / "out")
    assert stored.F.tolist() == [[0, 2]]
    assert stored.run["chosen"] == 0


def test_a_target_that_was_not_reached_says_so_and_leaves_the_front(tmp_path, capsys):
    # the upper of two vertices at one place is off the surface however many are kept
    roof = load("roof:5")
    points = np.vstack([roof.points, [-1, 1, 3]])
    faces = np.vstack([roof.faces, [0, 1, 25]])
    write_mesh(tmp_path / "twin.ply", points, faces)
    assert run("simplify", tmp_path / "twin.ply", "-o", tmp_path / "out", "--max-error", "0.5", *QUICK) == 1
    said = r"no chosen mesh: the least max error of a solution of .*twin\.ply is \d+.*, and 0\.5 was asked for; search"
    assert re.search(said, capsys.readouterr().err)
    assert (tmp_path / "out" / "front.csv").is_file()
    assert not (tmp_path / "out" / "chosen.ply").exists()


def test_both_ends_of_the_front_are_there_without_a_search_for_them(tmp_path):
    assert run("simplify", "jacksboro:20", "-o", tmp_path / "out", "--triangles", 3, *QUICK) == 0
    stored = read_front(tmp_path / "out")
    assert stored.F[0, 1] == 2
    assert stored.F[-1, 0] == 0


@pytest.mark.parametrize("limits", [{"triangles": 90}, {"max_error": 25.0}, {"mean_error": 9.0, "rms_error": 12.0}])
def test_a_wish_is_answered_first_and_then_searched(tmp_path, capsys, limits):
    options = [str(part) for name, most in limits.items() for part in (f"--{name.replace('_', '-')}", most)]
    command = ("simplify", "jacksboro:20", "-o", tmp_path / "out", *options, "--meshes", 2, "--moves", 3_000)
    assert run(*command) == 0
    out, err = capsys.readouterr()
    first = re.search(r"first answer: ([\d,]+) triangles, m", err.replace("RMS", "m"))
    front = Front.load(tmp_path / "out")
    chosen = front[front.run["chosen"]]
    assert chosen.triangles <= int(first[1].replace(",", ""))
    assert all(getattr(chosen, name) <= most for name, most in limits.items())
    assert front.run["wish"] == limits
    assert (front.run["settings"]["algorithm"], front.run["moves"]) == ("targeted", 3_000)
    searched = f"{next(iter(limits.values())):g}"
    assert re.search(rf"^searched: around .* {searched}", out, re.MULTILINE)
    assert "What was searched is the mesh with a" in (tmp_path / "out" / "report.html").read_text()
    assert out.count("chosen: ") == 1


def test_a_wish_that_even_all_vertices_miss_is_said_before_and_how_near_it_came(tmp_path, capsys):
    roof = load("roof:5")
    points = np.vstack([roof.points, [-1, 1, 3]])
    write_mesh(tmp_path / "twin.ply", points, np.vstack([roof.faces, [0, 1, 25]]))
    command = ("simplify", tmp_path / "twin.ply", "-o", tmp_path / "out", "--max-error", "0.5", "--moves", 200)
    assert run(*command) == 1
    said = capsys.readouterr().err
    assert re.search(r"even all 26 vertices together have max error \d.*; looking for what comes nearest", said)
    assert re.search(r"no chosen mesh: the least max error of a solution of .*, and 0\.5 was asked for", said)


def test_two_wishes_that_do_not_hold_at_once_say_what_each_takes(tmp_path, capsys):
    options = ("--triangles", 60, "--max-error", 20, "--moves", 2_000, "--meshes", "none", "--no-page")
    assert run("simplify", "jacksboro:20", "-o", tmp_path / "out", *options) == 1
    said = (
        r"holds all of what .*: max error \d\S* at \d+ triangles; with max error 20 the smallest found has \d+; search"
    )
    assert re.search(said, capsys.readouterr().err)
    assert not (tmp_path / "out" / "chosen.ply").exists()


def test_other_heights_do_not_raise_what_is_wished_for(tmp_path, capsys):
    options = ("--max-error", 25, "--moves", 2_000, "--meshes", 4, "--refit", "--no-page")
    assert run("simplify", "jacksboro:20", "-o", tmp_path / "out", *options) == 0
    stored = read_front(tmp_path / "out")
    model = load("jacksboro:20")
    fitted = list(enumerate(stored.refitted_meshes))
    raised = re.search(r"(\d) of (\d) meshes are not refitted: .* raise their max error", capsys.readouterr().err)
    assert int(raised[2]) - int(raised[1]) == sum(bool(name) for _, name in fitted)
    problem = MeshProblem(model)
    for row, name in fitted:
        if name:
            mesh = trimesh.load(tmp_path / "out" / name, process=False)
            found = problem.surface.score(mesh.vertices, mesh.faces).quality
            assert found.max_error <= stored.quality["max_error"][row] * (1 + 1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--triangles", 1), r"--triangles 1 is impossible: roof:9 has 2 to 128 triangles"),
        (
            ("--triangles", 5, "--footprint", "hull", "--pin", "hull"),
            r"--triangles 5 is impossible: roof:9 has 30 to 128",
        ),
        (("--triangles", 0), r"argument --triangles: '0' is not a whole number of at least 1"),
        (("--max-error", -1), r"--max-error.*"),
        (("--max-error", "nan"), r"argument --max-error: 'nan' is not a finite number"),
        (("--mean-error", "small"), r"argument --mean-error: 'small' is not a finite number"),
        (("--triangles", 9, "--pick", "knee"), r"--triangles does not go with --pick knee: each chooses a mesh"),
    ],
)
def test_impossible_targets_are_refused_with_what_is_possible(tmp_path, capsys, options, message):
    assert run("simplify", "roof:9", "-o", tmp_path / "out", *options) == 2
    assert re.search(message, one_line(capsys))
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------------------- options


@pytest.mark.parametrize("name", written_formats())
def test_meshes_are_written_in_the_wanted_format(tmp_path, name):
    kind = written_formats()[name]
    if kind.needs:
        pytest.importorskip(kind.needs)
    assert run("simplify", "roof:5", "-o", tmp_path / "out", "--format", name, *QUICK) == 0
    with (tmp_path / "out" / "front.csv").open(newline="") as file:
        meshes = [row["mesh"] for row in csv.DictReader(file)]
    assert all(mesh.endswith(kind.suffix) for mesh in meshes)
    assert all((tmp_path / "out" / mesh).is_file() for mesh in meshes)


def test_formats_may_be_written_in_upper_case():
    assert make_parser().parse_args(["simplify", "roof", "--format", "GLB"]).format == "glb"


def test_an_experiment_can_be_summed_up_in_json(tmp_path, capsys):
    (tmp_path / "tiny.yaml").write_text(
        "title: tiny\nproblems: [{name: Roof, model: 'roof:5'}]\nseeds: [1]\nbudgets: [{generations: 2}]\n"
        "algorithms: [{name: N1, preset: nsga2_v1, parameters: {pop_size: 8}}]\n"
    )
    again = ("run", tmp_path / "tiny.yaml", "-o", tmp_path / "out", "--jobs", 1)
    for call, finished in ((again, 1), (again, 0), (("report", tmp_path / "out"), None)):
        assert run(*call, "--json") == 0
        summary = json.loads(capsys.readouterr().out)
        assert (summary["folder"], summary["runs"], summary["missing"]) == (str(tmp_path / "out"), 1, 0)
        assert summary.get("finished") == finished


@pytest.mark.parametrize(("option", "count"), [("none", 0), ("2", 2), ("all", None)])
def test_as_many_meshes_are_written_as_asked(tmp_path, option, count):
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--meshes", option, *QUICK) == 0
    stored = read_front(tmp_path / "out")
    written = [mesh for mesh in stored.meshes if mesh]
    assert len(written) == (len(stored.meshes) if count is None else count)
    assert len(list(tmp_path.glob("out/meshes/*"))) == len(written)


def test_pinned_rows_of_the_file_stay_in_every_mesh(tmp_path, roof_ply):
    assert run("simplify", roof_ply, "-o", tmp_path / "out", "--pin", "7,12", *QUICK) == 0
    wanted = load("roof:5").points[[7, 12]].tolist()
    for path in (tmp_path / "out" / "meshes").iterdir():
        vertices = trimesh.load(path, process=False).vertices.tolist()
        assert all(point in vertices for point in wanted)


def test_a_height_grid_is_read_with_its_spacing_and_nodata(tmp_path):
    elevation = np.arange(30.0).reshape(5, 6) ** 1.5
    elevation[0, 0] = -9999
    np.save(tmp_path / "dem.npy", elevation)
    options = ("--spacing", "10,20", "--nodata", "-9999")
    assert run("simplify", tmp_path / "dem.npy", "-o", tmp_path / "out", *options, *QUICK) == 0
    stored = read_front(tmp_path / "out")
    assert stored.kept.shape[1] == 29
    vertices = np.concatenate([trimesh.load(tmp_path / "out" / m, process=False).vertices for m in stored.meshes])
    assert np.ptp(vertices[:, :2], axis=0).tolist() == [50, 80]


def test_a_model_that_stands_upright_is_found_so(tmp_path):
    roof = load("roof:5")
    write_mesh(tmp_path / "wall.ply", roof.points[:, [2, 0, 1]], roof.faces)
    assert run("simplify", tmp_path / "wall.ply", "-o", tmp_path / "out", *QUICK) == 0
    assert json.loads((tmp_path / "out" / "run.json").read_text())["model"]["up"] == [1, 0, 0]


def test_a_model_seen_edge_on_is_refused(tmp_path, capsys):
    roof = load("roof:5")
    write_mesh(tmp_path / "wall.ply", roof.points[:, [2, 0, 1]], roof.faces)
    assert run("simplify", tmp_path / "wall.ply", "-o", tmp_path / "out", "--up", "z", *QUICK) == 2
    assert re.search(r"wall\.ply: .*--up", one_line(capsys))


def test_the_front_of_a_closed_surface_is_cut_out_when_asked(tmp_path, capsys):
    ball = trimesh.creation.icosphere(subdivisions=3)
    write_mesh(tmp_path / "ball.ply", ball.vertices, ball.faces)
    assert run("simplify", tmp_path / "ball.ply", "-o", tmp_path / "no", "--up", "z") == 2
    both = "cut out the patch that faces the viewer with --patch front; or leave --up z out to have all of it"
    assert one_line(capsys).endswith(f"{both}, as a closed surface\n")
    assert run("info", tmp_path / "ball.ply") == 0
    assert "no height field it has no border\n" in capsys.readouterr().out
    assert run("simplify", tmp_path / "ball.ply", "-o", tmp_path / "out", "--up", "z", "--patch", "front", *QUICK) == 0
    mesh = trimesh.load(tmp_path / "out" / read_front(tmp_path / "out").meshes[-1], process=False)
    assert mesh.vertices[:, 2].min() > -0.2


def test_the_asked_number_of_threads_is_used(tmp_path, monkeypatch):
    made = []

    def remembered(*args, **kwargs):
        made.append(MeshProblem(*args, **kwargs))
        return made[-1]

    monkeypatch.setattr(searching, "MeshProblem", remembered)
    assert run("simplify", "roof:5", "-o", tmp_path / "out", "--quiet", "--threads", 3, *QUICK) == 0
    assert made[0].elementwise_runner.n_threads == 3


def test_results_are_replaced_only_when_asked(tmp_path, capsys):
    assert run("simplify", "roof:5", "-o", tmp_path / "out", "--quiet", *QUICK) == 0
    before = files(tmp_path / "out")
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--quiet", *QUICK) == 2
    assert "out: exists already" in one_line(capsys)
    assert files(tmp_path / "out") == before
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--overwrite", "--quiet", *QUICK) == 0
    assert read_front(tmp_path / "out").kept.shape[1] == 81


def test_json_tells_what_was_found(tmp_path, capsys):
    assert run("simplify", "roof:5", "-o", tmp_path / "out", "--json", "--pick", "knee", *QUICK) == 0
    summary = json.loads(capsys.readouterr().out)
    stored = read_front(tmp_path / "out")
    assert summary["solutions"] == len(stored.F)
    assert summary["smallest"]["triangles"] == stored.F[0, 1]
    assert summary["chosen"]["error"] == stored.quality["error"][stored.run["chosen"]]
    assert Path(summary["chosen"]["mesh"]).is_file()


def test_quiet_says_nothing(tmp_path, capsys):
    assert run("simplify", "roof:5", "-o", tmp_path / "out", "--quiet", *QUICK) == 0
    assert capsys.readouterr() == ("", "")


def test_a_warning_is_one_line_and_no_failure(tmp_path, capsys):
    roof = load("roof:5")
    write_mesh(tmp_path / "loose.ply", np.vstack([roof.points, [9, 9, 9]]), roof.faces)
    assert run("simplify", tmp_path / "loose.ply", "-o", tmp_path / "out", "--quiet", *QUICK) == 0
    assert re.fullmatch(r"meshsimp: warning: .*loose\.ply: 1 of 26 vertices .*\n", one_line(capsys))


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_sees_progress_in_short_lines(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("COLUMNS", "150")
    deep = tmp_path / "a_folder_with_a_long_name"
    deep.mkdir()
    roof = load("roof:9")
    write_mesh(deep / "roof.ply", roof.points, roof.faces)
    assert run("simplify", deep / "roof.ply", "-o", tmp_path / "out", *QUICK) == 0
    shown = re.sub(r"\x1b\[[0-9;]*m", "", sys.stderr.getvalue())
    lines = [line.strip() for line in re.split(r"\x1b|[\r\n]", shown) if "left" in line]
    assert re.fullmatch(r"\[2Kroof\.ply \S+ +\d+ % \d+ s left; drawing", lines[-1])
    assert "a_folder_with_a_long_name" not in shown


def test_a_stage_that_takes_longer_than_estimated_says_so(capsys, monkeypatch):
    monkeypatch.setattr(terminal, "LATE_SECONDS", 0.0)
    monkeypatch.setattr(terminal, "LINE_SECONDS", 0.25)
    with terminal.Stages(False, "compiling", {"compiling": 0.3}, lines=True) as shown:
        with shown.stage("compiling", "compiling once"):
            time.sleep(0.9)
    first, *_, last = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"meshsimp: compiling: \d+% after \d s; 0 s left; compiling once", first)
    assert re.fullmatch(r"meshsimp: compiling: after [1-9] s; longer than estimated; compiling once", last)


def test_the_front_so_far_is_said_at_a_few_sizes():
    problem = MeshProblem("roof:9")
    F = np.array([[4.0, 2], [3.0, 10], [1.25, 26], [0.0, 100]])
    assert front_in_words(problem.model, 36, F) == "error 4@2 4@6 3@13 1.25@26 after 36 evaluations"


@pytest.mark.parametrize("width", [40, 80])
def test_progress_is_cut_to_the_width_of_the_terminal(tmp_path, monkeypatch, width):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("COLUMNS", str(width))
    assert run("simplify", "jacksboro:40,seed=123456789012", "-o", tmp_path / "out", *QUICK) == 0
    lines = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\n", sys.stderr.getvalue()).splitlines()
    assert max(len(line.rstrip()) for line in lines) <= width
    assert sum("%" in line for line in lines) > 1


def test_without_a_terminal_there_is_no_progress(tmp_path, capsys):
    assert run("simplify", "roof:5", "-o", tmp_path / "out", *QUICK) == 0
    assert capsys.readouterr().err == ""


# -------------------------------------------------------------------------------------------------------------- Ctrl-C


def interrupt_after(monkeypatch, generations):
    from pymoo.algorithms.moo.nsga2 import NSGA2

    step, done = NSGA2.next, []

    def next_or_stop(self):
        if len(done) == generations:
            raise KeyboardInterrupt
        done.append(1)
        step(self)

    monkeypatch.setattr(NSGA2, "next", next_or_stop)


def test_an_interrupted_run_writes_the_front_so_far(tmp_path, monkeypatch, capsys):
    assert run("simplify", "roof:9", "-o", tmp_path / "whole", "--generations", 2, "--population", 12, *PAPERS) == 0
    capsys.readouterr()
    interrupt_after(monkeypatch, 2)
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--generations", 50, "--population", 12, *PAPERS) == 130
    assert "interrupted after 2 generations" in capsys.readouterr().err
    assert (tmp_path / "out" / "front.csv").read_bytes() == (tmp_path / "whole" / "front.csv").read_bytes()
    assert read_front(tmp_path / "out").run["interrupted"] is True


def test_who_interrupts_does_not_wait_for_what_only_meshes_say(tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    monkeypatch.setattr("meshsimp_pymoo.cli.searching.WHOLE_SHARE", -1e9)
    interrupt_after(monkeypatch, 2)
    assert run("simplify", "roof:9", "-o", out, "--generations", 50, "--population", 12, *PAPERS, "--json") == 130
    said = capsys.readouterr()
    front = Front.load(out)
    assert f"surface error and angles of {len(front)} of {len(front)} solutions are left out" in said.err
    assert json.loads(said.out)["smallest"]["surface_error"] is None
    with (out / "front.csv").open(newline="") as file:
        assert all(row[name] == "" for row in csv.DictReader(file) for name in OF_MESH)
    assert (out / "report.html").is_file()
    assert run("pick", out, "--knee", "--json", "-o", tmp_path / "knee.ply") == 0
    picked = json.loads(capsys.readouterr().out)
    assert [picked[name] for name in OF_MESH] == [None] * 3
    assert run("pick", out, "--knee") == 0
    assert "surface" not in capsys.readouterr().out
    assert run("score", "roof:9", tmp_path / "knee.ply", "--json") == 0
    scored = json.loads(capsys.readouterr().out)
    assert scored["surface_error"] == pytest.approx(front.knee().simplified.quality.surface_error, rel=1e-9)


def test_a_run_interrupted_before_its_first_generation_writes_nothing(tmp_path, monkeypatch, capsys):
    interrupt_after(monkeypatch, 0)
    assert run("simplify", "roof:9", "-o", tmp_path / "out", *QUICK) == 130
    assert "nothing is written" in one_line(capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["storage.write_npz", "report.figures.front_figure"])
def test_an_interruption_while_writing_leaves_nothing_half_written(tmp_path, monkeypatch, capsys, place):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(f"meshsimp_pymoo.{place}", interrupt)
        assert run("simplify", "roof:9", "-o", out, *QUICK) == 130
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    if "write" in place:
        assert "nothing is written" in said
        assert list(tmp_path.iterdir()) == []
        return
    assert f"interrupted while it was drawn; {out} holds the results: meshsimp report {out}" in said
    assert len(read_front(out).F) > 1
    assert not (out / "front.png").exists()
    assert run("simplify", "roof:9", "-o", out, *QUICK, "--seed", "3") == 2  # another search
    assert "exists already" in one_line(capsys)
    assert run("simplify", "roof:9", "-o", out, *QUICK) == 0
    assert "holds the results of this search; making the pictures that are missing" in capsys.readouterr().err
    assert {"front.png", "report.html"} < {path.name for path in out.iterdir()}


# ----------------------------------------------------------------------------------------------------------- bad input


ROOF = load("roof:5")
BINARY_HEADER = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 100\n"
    b"property float x\nproperty float y\nproperty float z\nend_header\n"
)


def text_ply(points, faces):
    lines = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, point)) for point in points]
    lines += ["3 " + " ".join(map(str, face)) for face in faces]
    return ("\n".join(lines) + "\n").encode()


def changed(row, value):
    points = ROOF.points.copy()
    points[row] = value
    return points


RING = trimesh.creation.annulus(1.0, 2.0, 1.0, sections=8)
BAD_FILES = {
    "empty": (b"", r"bad\.ply: is empty"),
    "text": (b"Dear reviewer,\n", r"bad\.ply: "),
    "truncated": (BINARY_HEADER + bytes(500), r"bad\.ply: "),
    "nan": (text_ply(changed(7, [0, float("nan"), 0]), ROOF.faces), r"bad\.ply: 1 of 25 vertices have NaN"),
    "infinite": (
        text_ply(changed(7, [0, float("inf"), 0]), ROOF.faces),
        r"bad\.ply: 1 of 25 vertices have NaN or infinite",
    ),
    "three vertices": (text_ply(ROOF.points[:3], [[0, 1, 2]]), r"bad\.ply: has 3 vertices; at least 4"),
    "collinear": (text_ply([[k, 2 * k, 3 * k] for k in range(4)], [[0, 1, 2], [1, 2, 3]]), r"bad\.ply: .* line"),
    "past the end": (text_ply(ROOF.points, [*ROOF.faces.tolist(), [0, 1, 25]]), r"bad\.ply: 1 of 33 faces name"),
    "closed": (text_ply(RING.vertices, RING.faces), r"bad\.ply: has genus 1 .*closed.*--patch front"),
    "non-manifold": (
        text_ply([*ROOF.points.tolist(), [0, 0, 9]], [*ROOF.faces.tolist(), [0, 6, 25], [6, 0, 25]]),
        r"bad\.ply: \d+ edges belong to more than two faces",
    ),
    "folded": (
        text_ply(RING.vertices, RING.faces[4:]),
        r"bad\.ply: .* folded over.*--patch front.*; as a closed surface it is refused too: it has genus 1",
    ),
}


@pytest.mark.parametrize("kind", BAD_FILES)
@pytest.mark.parametrize("command", ["simplify", "info"])
def test_a_bad_file_is_answered_with_its_name_the_cause_and_the_way_out(tmp_path, capsys, kind, command):
    content, message = BAD_FILES[kind]
    (tmp_path / "bad.ply").write_bytes(content)
    output = ("-o", tmp_path / "out") if command == "simplify" else ()
    assert run(command, tmp_path / "bad.ply", *output) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert re.search(message, err), err
    assert [p.name for p in tmp_path.iterdir()] == ["bad.ply"]


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("missing.ply", r"missing\.ply: no such file"),
        (
            "jaksboro:11",
            r"jaksboro:11: no such file, and no built-in model of that name \(did you mean 'jacksboro'\?\)",
        ),
        ("roof:4", r"roof:4: side is 4; it must be a power of two plus one"),
        ("face:10", r"face:10: vertices is 10; it must be 60 to"),
    ],
)
def test_a_model_that_does_not_exist_is_refused(tmp_path, capsys, model, message):
    assert run("simplify", model, "-o", tmp_path / "out") == 2
    assert re.search(message, one_line(capsys))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_refused_before_any_work(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert run("simplify", "no model at all", "-o", tmp_path / "file" / "out") == 2
    assert re.search(r"out: cannot be written in .*file \(Not a directory\); name another folder", one_line(capsys))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--time", "10parsecs"), r"'10parsecs' is not a duration; write 60s, 10min or 1h"),
        (("--time", "0s"), r"'0s' is not a duration"),
        (("--time", "1s", "--generations", "3"), r"not allowed with argument"),
        (("--moves", "1000", "--time", "1s"), r"not allowed with argument"),
        (("--moves", "0"), r"'0' is not a whole number of at least 1"),
        (
            ("--moves", "9", "--algorithm", "moead"),
            r"for --algorithm memetic, .* give moead --generations, --evalua",
        ),
        (("--evaluations", "many"), r"'many' is not a whole number of at least 1"),
        (("--population", "1"), r"'1' is not a whole number of at least 2"),
        (("--seed", "-1"), r"--seed"),
        (("--seed", "1.5"), r"'1.5' is not a whole number of at least 0"),
        (("--threads", "0"), r"'0' is not a whole number of at least 1"),
        (("--algorithm", "annealing"), r"invalid choice: 'annealing' \(choose from '?memetic"),
        (("--footprint", "box"), r"invalid choice: 'box'"),
        (("--up", "sideways"), r"'sideways' is no direction"),
        (("--pin", "0,here"), r"'here' is not a whole number of at least 0"),
        (("--pin", "25"), r"pin: row 25 of roof:5 is not among"),
        (("--spacing", "0"), r"'0' is not one or two positive numbers"),
        (("--spacing", "2"), r"roof:5: spacing is for files"),
        (("--nodata", "x"), r"'x' is not a finite number"),
        (("--pieces",), r"--pieces is for tiles, and this model is searched in one piece; leave it out"),
        (("--jobs", "2", "--tile", "none"), r"--jobs is for tiles"),
        (("--dask", "tcp://localhost:8786"), r"--dask is for tiles"),
        (("--max-edge", "1e301"), r"'1e301' is larger than 1e\+300"),
        (("--up", ""), r"argument --up: expected an axis such as z or -x"),
        (("--weights", ""), r"argument --weights: expected the name of an attribute"),
        (("--meshes", "some"), r"'some' is not a whole number of at least 0"),
        (("--format", "doc"), r"invalid choice: 'doc'"),
        (("--gen", "3"), r"unrecognized arguments: --gen 3; did you mean --generations\? \(see meshsimp simplify --h"),
        (("--triangels", "3"), r"unrecognized arguments: --triangels 3; did you mean --triangles\?"),
        (("--max_error", "3"), r"did you mean --max-error\?"),
        (("--algorithm", "nsga2v2"), r"did you mean nsga2_v2\? \(see meshsimp simplify --help\)"),
        (("--format", "plyy"), r"did you mean ply\?"),
        (("-x",), r"unrecognized arguments: -x \(see meshsimp simplify --help\)"),
    ],
)
def test_a_wrong_option_is_answered_in_one_line(tmp_path, capsys, options, message):
    assert run("simplify", "roof:5", "-o", tmp_path / "out", *options) == 2
    assert re.search(message, one_line(capsys))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), r"a command is missing: simplify, pick, .*completion \(see meshsimp --help\)"),
        (("simplify", "-o", "out"), r"required: MODEL"),
        (
            ("melt", "roof"),
            r"invalid choice: 'melt' \(choose from simplify, pick, levels, quality, .*\) \(see meshsimp --help\)",
        ),
        (("simplyfy", "roof"), r"invalid choice: 'simplyfy' .*; did you mean simplify\?"),
        (("scan.ply",), r"did you mean meshsimp simplify scan\.ply\?"),
        (("report",), r"required: OUT \(see meshsimp report --help\)"),
    ],
)
def test_a_wrong_command_is_answered_in_one_line(capsys, arguments, message):
    assert run(*arguments) == 2
    assert re.search(message, one_line(capsys))


def test_anything_unexpected_keeps_its_traceback(tmp_path, monkeypatch):
    def fail(*args, **kwargs):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("meshsimp_pymoo.storage.write_npz", fail)
    with pytest.raises(ZeroDivisionError, match="a bug"):
        run("simplify", "roof:5", "-o", tmp_path / "out", *QUICK)
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------------ pick and score


@pytest.fixture(scope="module")
def picked(tmp_path_factory):
    """Return the folder of a front of face:200, 5 of its meshes written."""
    folder = tmp_path_factory.mktemp("picked") / "out"
    assert run("simplify", "face:200", "-o", folder, "--meshes", 5, "--quiet", *QUICK) == 0
    return folder


@pytest.mark.parametrize(
    ("options", "limits"),
    [
        (("--triangles", 150), {"triangles": 150}),
        (("--max-error", 12.5), {"max_error": 12.5}),
        (("--mean-error", 2), {"mean_error": 2}),
    ],
)
def test_pick_takes_the_mesh_that_was_asked_for(picked, tmp_path, capsys, options, limits):
    expected = Front.load(picked).best(**limits)
    assert run("pick", picked, *options, "-o", tmp_path / "small.ply") == 0
    out = capsys.readouterr().out
    assert out.startswith(f"solution {expected.solution} of {picked}: {expected.triangles} triangles, error ")
    assert out.endswith(f"written: {tmp_path / 'small.ply'}\n")
    mesh = trimesh.load(tmp_path / "small.ply", process=False)
    assert np.array_equal(mesh.vertices, expected.mesh.vertices)
    assert np.array_equal(mesh.faces, expected.mesh.faces)


@pytest.mark.parametrize("suffix", [*(kind.name for kind in written_formats().values() if kind.read), "GLB", "Ply"])
def test_pick_writes_the_format_of_the_suffix(picked, tmp_path, suffix):
    path = tmp_path / f"knee.{suffix}"
    assert run("pick", picked, "--knee", "-o", path) == 0
    mesh = trimesh.load(path, file_type=suffix.lower(), force="mesh", process=False)
    assert len(mesh.faces) == Front.load(picked).knee().triangles


def test_pick_copies_what_is_stored_even_if_the_model_is_gone(tmp_path, roof_ply, capsys):
    assert run("simplify", roof_ply, "-o", tmp_path / "out", "--meshes", 1, "--quiet", *QUICK) == 0
    roof_ply.unlink()
    front = read_front(tmp_path / "out")
    stored = next(k for k, mesh in enumerate(front.meshes) if mesh)
    assert run("pick", tmp_path / "out", "--solution", stored, "-o", tmp_path / "a.ply") == 0
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "out" / front.meshes[stored]).read_bytes()
    capsys.readouterr()
    assert run("pick", tmp_path / "out", "--solution", stored, "-o", tmp_path / "a.obj") == 2
    assert re.search(r"out: its model cannot be read \(.*roof\.ply: no such file.*--model FILE", one_line(capsys))
    assert not (tmp_path / "a.obj").exists()


FREE = ("--free", "--moves", "20000", "--population", "16")


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("memetic", FREE),
        ("memetic for the vertices alone", (*FREE, "--no-centroids", "--free-height", "0", "--measure", "rms")),
        ("a wish", (*FREE, "--triangles", "61", "--refit")),
        ("two wishes", (*FREE, "--triangles", "80", "--max-error", "14")),
        ("a wish for an error", (*FREE, "--mean-error", "3")),
        ("the paper's", ("--free", "--time", "1s", "--population", "12", *PAPERS)),
    ],
)
def test_free_meshes_are_written_as_they_are_measured_and_judged_by_what_is_wished_for(tmp_path, capsys, kind, options):
    out = tmp_path / "out"
    assert run("simplify", "face:200", "-o", out, *options, "--no-page", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    record = json.loads((out / "run.json").read_text())
    assert record["settings"]["free"] is True
    front = Front.load(out)
    assert front.n_free > 0
    for solution in [*front][::5]:
        found = front.surface.of_faces(solution.faces).quality
        for name in set(MEASURES) - {*OF_LINES}:
            assert getattr(found, name) == pytest.approx(getattr(solution, name), rel=1e-9, abs=1e-9)
    finished = kind not in ("memetic", "memetic for the vertices alone")
    assert ("freeing" in record) == finished
    if finished and "--moves" in options:
        assert record["moves"] + record["freeing"]["moves"] <= 20_000
        assert record["freeing"]["moves"] > 10_000
    if "wish" in kind:
        limits = record["wish"]
        chosen = front[record["chosen"]]
        assert chosen.solution == front.best(**limits).solution
        assert all(getattr(chosen, name) <= most for name, most in limits.items())
        assert chosen.free is said["chosen"]["free"]
        assert chosen.free or "triangles" not in limits
        assert run("score", "face:200", out / "chosen.ply", "--json") == 0
        assert json.loads(capsys.readouterr().out)["error"] == pytest.approx(chosen.error, rel=1e-6)


@pytest.mark.parametrize("options", [QUICK, ("--moves", "20000", "--population", "16")], ids=["afterwards", "memetic"])
def test_interrupted_while_meshes_are_freed_the_front_has_those_finished(tmp_path, monkeypatch, capsys, options):
    real = searching.FreeLadder._found

    def interrupted(self, *given):
        if len(self.fronts) == 3:
            raise KeyboardInterrupt
        return real(self, *given)

    monkeypatch.setattr(searching.FreeLadder, "_found", interrupted)
    assert run("simplify", "face:200", "-o", tmp_path / "out", "--free", *options, "--no-page") == 130
    said = capsys.readouterr().err
    assert options != QUICK or re.search(r"\d+ of \d+ sizes are not annealed freely", said)
    front = Front.load(tmp_path / "out")
    assert 0 < front.n_free < len(front)
    assert front.run["interrupted"] is True


def test_interrupted_at_the_end_of_a_generation_free_meshes_are_those_of_the_front(tmp_path, monkeypatch):
    kind, done, taken = searching.MemeticSearch, [], []
    step, take = kind.next, kind.take_free

    def next_or_stop(self):
        step(self)
        done.append(self.opt)
        if self.free.fronts:
            raise KeyboardInterrupt

    monkeypatch.setattr(kind, "next", next_or_stop)
    monkeypatch.setattr(kind, "take_free", lambda self, *given, **how: taken.extend(given) or take(self, *given, **how))
    assert run("simplify", "face:200", "-o", tmp_path / "out", *FREE, "--no-page") == 130
    assert taken[0] is done[-2] is not done[-1]
    assert Front.load(tmp_path / "out").n_free > 0


@pytest.mark.parametrize("place", ["Front.from_population", "Freeing.__init__"])
def test_interrupted_between_the_search_and_freeing_nothing_is_freed(tmp_path, monkeypatch, capsys, place):
    of, name = place.split(".")
    owner = getattr(searching, of)
    real = getattr(owner, name)

    def interrupted(*given, **how):
        signal.raise_signal(signal.SIGINT)
        return real(*given, **how)

    monkeypatch.setattr(owner, name, interrupted)
    monkeypatch.setattr(searching.FreeLadder, "go_on", None)  # is not called
    assert run("simplify", "face:200", "-o", tmp_path / "out", "--free", *QUICK, "--no-page") == 130
    assert "interrupted before any size was annealed freely: all meshes are Delaunay" in capsys.readouterr().err
    front = Front.load(tmp_path / "out")
    assert front.n_free == 0
    assert front.run["interrupted"] is True


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--free-height", "0.2"), "--free-height does not go with Delaunay meshes: it is of free ones; leave it out"),
        (("--no-centroids",), "--no-centroids does not go with Delaunay meshes: it is of free ones"),
        (("--free", "--tile", "64"), "--free does not go with tiles, which do not know it; leave it out"),
        (("--free", "--free-height", "0.7"), "'0.7' is larger than 0.5"),
        (("--free", "--free-height", "-1"), "'-1' is below 0"),
        (("--free", "--moves", "100", *PAPERS), "--moves is for --algorithm memetic"),
    ],
)  # fmt: skip
def test_what_does_not_go_with_free_meshes_is_refused_in_one_line(tmp_path, capsys, options, message):
    assert run("simplify", "jacksboro:24", "-o", tmp_path / "out", *options) == 2
    assert message in one_line(capsys)
    assert not (tmp_path / "out").exists()


def test_free_meshes_of_a_search_are_written_picked_scored_and_reported_by_their_own_faces(
    tmp_path, capsys, monkeypatch
):
    """A search that has a free mesh beside its best compromise: from its front to every file."""
    with monkeypatch.context() as patch:
        set_optimum = NSGA2._set_optimum

        def with_free_meshes(self):
            set_optimum(self)
            if self.n_iter == 3:
                for one in self.opt[np.argsort(self.opt.get("F")[:, 1])[1:4]]:
                    one.set("free", freed(self.problem.surface, one.X))

        patch.setattr(NSGA2, "_set_optimum", with_free_meshes)
        out, found = tmp_path / "out", ("--format", "obj", "--refit", "--meshes", "none")
        assert run("simplify", "face:200", "-o", out, *found, "--triangles", 60, *QUICK) == 0
    said = capsys.readouterr().out
    front = Front.load(out)
    free = [solution for solution in front if solution.free]
    assert free
    assert f"front: {len(front)} solutions, {len(free)} of them free, " in said
    solution = free[-1]
    own, compact = solution.faces, used_rows(solution.faces)[1].tolist()
    assert own.tolist() != front.surface.triangles(solution.kept).tolist()
    for suffix in ("ply", "stl", "obj", "off", "glb", "xml"):
        path = tmp_path / f"free.{suffix}"
        assert run("pick", out, "--solution", solution.solution, "-o", path) == 0
        assert f"solution {solution.solution} of {out}, free: {solution.triangles} triangles" in capsys.readouterr().out
        if suffix in ("ply", "obj", "off", "glb"):
            assert trimesh.load(path, force="mesh", process=False).faces.tolist() == compact
        elif suffix == "xml":
            rows = re.findall(r"<F>(\d+) (\d+) (\d+)</F>", path.read_text())
            assert (np.array(rows, int) - 1).tolist() == compact
        else:
            corners = trimesh.load(path, process=False).triangles
            np.testing.assert_array_equal(corners, front.model.file_points[own].astype(np.float32))
    assert run("pick", out, "--solution", solution.solution, "--json") == 0
    assert json.loads(capsys.readouterr().out)["free"] is True
    assert run("score", "face:200", tmp_path / "free.ply", "--front", out, "--json") == 0
    scored = json.loads(capsys.readouterr().out)
    assert scored["error"] == pytest.approx(solution.error, rel=1e-9)
    assert (scored["front"]["solution"], scored["front"]["error_ratio"]) == (solution.solution, pytest.approx(1))
    chosen = front[front.run["chosen"]]
    assert trimesh.load(out / "chosen.obj", process=False).faces.tolist() == used_rows(chosen.faces)[1].tolist()
    pictures = {name: (out / name).read_bytes() for name in ("front.png", "report.html")}
    for name in pictures:
        (out / name).unlink()
    assert run("report", out) == 0
    assert {name: (out / name).read_bytes() for name in pictures} == pictures


def test_pick_refuses_a_model_that_changed(tmp_path, roof_ply, capsys):
    assert run("simplify", roof_ply, "-o", tmp_path / "out", "--meshes", "none", "--quiet", *QUICK) == 0
    roof_ply.rename(tmp_path / "moved.ply")
    roof = load("roof:5")
    write_mesh(roof_ply, roof.points * [1, 1, 3], roof.faces)
    assert run("pick", tmp_path / "out", "--knee", "-o", tmp_path / "a.ply") == 2
    assert re.search(r"out: is the front of another model than .*roof\.ply is now.*--model FILE", one_line(capsys))
    assert run("pick", tmp_path / "out", "--knee", "-o", tmp_path / "a.ply", "--model", tmp_path / "moved.ply") == 0
    assert (tmp_path / "a.ply").is_file()


@pytest.fixture(scope="module")
def around_100(tmp_path_factory):
    """Return a folder with the folder `out` of a front that was searched around 100 triangles of face:200."""
    folder = tmp_path_factory.mktemp("around")
    wish = ("--triangles", 100, "--moves", 5000, "--up", "z", "--meshes", "none", "--no-page")
    assert run("simplify", "face:200", "-o", folder / "out", *wish, "--quiet") == 0
    return folder


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--triangles", 100), ""),
        (("--triangles", 60), ""),  # within a factor of two
        (("--triangles", 30), "{around}; far from it the meshes are poor. For this wish: {way}--triangles 30{then}"),
        (
            ("--max-error", "1e-09", "--mean-error", 0.25),
            "this is the original itself; {around}. For this wish: {way}--mean-error 0.25 --max-error 1e-09{then}",
        ),
        (("--solution", 0), "{around}; far from it the meshes are poor. For this size: {way}--triangles {size}{then}"),
        (("--solution", "last"), "this is the original itself; {around}"),
    ],
)
def test_pick_says_that_a_mesh_is_far_from_what_was_searched(around_100, monkeypatch, capsys, options, said):
    monkeypatch.chdir(around_100)
    front = read_front("out")
    last = len(front.quality["triangles"]) - 1
    assert run("pick", "out", *(last if word == "last" else word for word in options)) == 0
    expected = said.format(
        around="out was searched around at most 100 triangles",
        way="meshsimp simplify face:200 ",
        then=", with the options of then",
        size=front.quality["triangles"][0],
    )
    assert capsys.readouterr().err == (f"meshsimp: note: {expected}\n" if said else "")


def test_what_a_missed_wish_leaves_is_picked_by_its_parts(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    quick = ("--moves", 2000, "--meshes", "none", "--no-page")
    assert run("simplify", "face:200", "-o", "out", "--triangles", 20, "--max-error", 2, *quick) == 1
    said = re.findall(r"(take one of them|or): meshsimp (.*)", capsys.readouterr().out)
    parts = ["pick out --triangles 20 -o small.ply", "pick out --max-error 2 -o close.ply"]
    assert said == list(zip(("take one of them", "or"), parts, strict=True))
    front = Front.load("out")
    for part, limit in zip(parts, ({"triangles": 20}, {"max_error": 2}), strict=True):
        assert run(*part.split()) == 0
        out, err = capsys.readouterr()
        assert out.startswith(f"solution {front.best(**limit).solution} of out: ")
        assert err == ""  # each was searched for
    assert _worth_picking(front, Wish({"triangles": 1})) == ["--solution 0"]  # nothing keeps it


def test_pick_overwrites_only_when_asked_and_leaves_nothing_behind(picked, tmp_path, capsys):
    path = tmp_path / "a.obj"
    path.write_text("mine")
    assert run("pick", picked, "--knee", "-o", path) == 2
    assert "a.obj: exists already; name another file or allow overwriting (--overwrite)" in one_line(capsys)
    assert path.read_text() == "mine"
    assert run("pick", picked, "--knee", "-o", path, "--overwrite", "--quiet") == 0
    assert path.read_text() != "mine"
    assert capsys.readouterr() == ("", "")
    assert [p.name for p in tmp_path.iterdir()] == ["a.obj"]


def test_pick_without_a_file_says_what_it_would_be(picked, capsys):
    assert run("pick", picked, "--knee") == 0
    assert capsys.readouterr().out.endswith("nothing is written; name a file with -o\n")
    assert run("pick", picked, "--knee", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    knee = Front.load(picked).knee()
    assert summary["mesh"] is None
    assert (summary["solution"], summary["error"], summary["triangles"]) == (knee.solution, knee.error, knee.triangles)


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (("--triangles", "1"), 1, r"no solution of face:200 has at most 1 triangles; the least is 2; nothing is w"),
        (("--solution", "9999"), 2, r"has the solutions 0 to \d+; --solution 9999 is none of them"),
        ((), 2, r"which solution is wanted\? say limits, such as --triangles 500, or --knee, or --solution K"),
        (("--triangles", "9", "--knee"), 2, r"--triangles does not go with --knee: each chooses a mesh; leave one of"),
        (("--knee", "-o", "a.doc"), 2, r"a\.doc: the suffix '\.doc' says no format that can be written; use one"),
    ],
)
def test_pick_says_what_is_impossible(picked, capsys, options, code, message):
    assert run("pick", picked, *options) == code
    assert re.search(message, one_line(capsys))


def test_pick_needs_a_front(tmp_path, monkeypatch, capsys):
    assert run("pick", tmp_path / "no", "--knee") == 2
    assert "no: no such folder" in one_line(capsys)
    monkeypatch.chdir(tmp_path)
    for command in (("pick", ".", "--knee"), ("score", "roof:3", "roof:3", "--front", ".")):
        assert run(*command) == 2
        said = ".: holds no front (front.csv is missing); name the folder that simplify -o made"
        assert one_line(capsys) == f"meshsimp: {said}\n"
    assert run("report", ".") == 2
    assert ".: holds neither a front (front.csv) nor an experiment (experiment.json); name" in one_line(capsys)


def test_a_mesh_of_the_front_scores_what_the_front_says(picked, tmp_path, capsys):
    knee = Front.load(picked).knee()
    knee.save(tmp_path / "knee.ply")
    assert run("score", "face:200", tmp_path / "knee.ply", "--front", picked, "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["error"] == pytest.approx(knee.error)
    assert (summary["triangles"], summary["uncovered"]) == (knee.triangles, knee.uncovered)
    assert summary["front"]["solution"] == knee.solution
    assert summary["front"]["error_ratio"] == pytest.approx(1)
    assert summary["front"]["triangles_for_this_error"] == knee.triangles


def test_score_places_a_worse_mesh_above_the_front(tmp_path, capsys):
    """Known answer: a roof without its ridge, but in 8 triangles, has the error 3; so has the front with 2."""
    roof = load("roof:3")
    write_mesh(tmp_path / "flat.ply", roof.points * [1, 1, 0], roof.faces)
    assert run("simplify", "roof:3", "-o", tmp_path / "out", "--generations", 10, "--population", 20, "--quiet") == 0
    assert run("score", "roof:3", tmp_path / "flat.ply", "--front", tmp_path / "out") == 0
    out = capsys.readouterr().out
    assert "flat.ply: 8 triangles, error 3, mean 0.3333, RMS 0.5774, max 1, uncovered 0" in out
    assert "solution 2, with 4 triangles, has the error 0; that is exact; for this error the front needs 2" in out


def test_score_draws_the_error(picked, tmp_path, capsys):
    mesh = picked / next(m for m in read_front(picked).meshes if m)
    assert run("score", "face:200", mesh, "-o", tmp_path / "error.png") == 0
    assert (tmp_path / "error.png").read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.endswith("error.png\n")
    assert run("score", "face:200", mesh, "-o", tmp_path / "error.png") == 2
    assert "error.png: exists already" in one_line(capsys)
    assert run("score", "face:200", mesh, "-o", tmp_path / "error.txt") == 2
    assert "use one of .png, .svg, .pdf" in one_line(capsys)
    assert [p.name for p in tmp_path.iterdir()] == ["error.png"]


def test_score_asks_whether_two_meshes_belong_together(tmp_path, capsys):
    near = load("roof:3")
    write_mesh(tmp_path / "far.ply", near.points + np.array([100.0, 0, 0]), near.faces)
    assert run("score", "roof:5", tmp_path / "far.ply") == 0
    assert "100% of the vertices of roof:5 are uncovered; are both in one frame and unit?" in capsys.readouterr().out
    assert run("score", "roof:5", tmp_path / "far.ply", "--outside", "ignore", "--json") == 0
    assert json.loads(capsys.readouterr().out)["error"] == 0


def test_score_refuses_a_front_of_another_model_or_reading(picked, tmp_path, capsys):
    mesh = picked / next(m for m in read_front(picked).meshes if m)
    assert run("score", "face:300", mesh, "--front", picked) == 2
    assert "is the front of another model than face:300" in one_line(capsys)
    assert run("score", "face:200", mesh, "--front", picked, "--outside", "ignore") == 2
    assert "was made with --outside nearest, and is compared as it was made; leave --outside out" in one_line(capsys)
    upright = load("roof:3").points[:, [0, 2, 1]]
    write_mesh(tmp_path / "wall.ply", upright * [1, 0, 1], load("roof:3").faces)
    assert run("score", "face:200", tmp_path / "wall.ply") == 2
    assert re.search(r"wall\.ply: cannot be measured against face:200: none of the 8 faces has", one_line(capsys))


@pytest.mark.parametrize(
    ("name", "instead"), [("out.ply", "out --format ply"), ("a b/out.XML", "'a b/out' --format landxml")]
)
def test_a_mesh_file_is_not_taken_for_the_folder_to_make(tmp_path, monkeypatch, capsys, name, instead):
    monkeypatch.chdir(tmp_path)
    assert run("simplify", "roof:5", "-o", name, *QUICK) == 2
    said = f"meshsimp: {name}: -o names a folder, for the front and the mesh you want; say -o {instead}\n"
    assert one_line(capsys) == said
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "out.ply").mkdir()
    assert run("simplify", "roof:5", "-o", "out.ply", "--quiet", *QUICK) == 0  # a folder of such a name is one


def test_a_format_goes_by_its_suffix_too(tmp_path, capsys):
    options = ("--format", "XML", "--pick", "knee", "--quiet", "--no-page", *QUICK)
    assert run("simplify", "roof:5", "-o", tmp_path / "out", *options) == 0
    assert (tmp_path / "out" / "chosen.xml").is_file()


def test_simplify_alone_names_its_folder_after_the_model(tmp_path, roof_ply, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("simplify", roof_ply, *QUICK) == 0
    assert "written: roof_front: " in capsys.readouterr().out
    assert run("simplify", "face:60,seed=2", *QUICK) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["face_60_seed_2_front", "roof.ply", "roof_front"]
    said = re.search(r"take one of them: meshsimp (pick .*)", capsys.readouterr().out)[1]
    assert run(*said.split()) == 0  # what it says can be done
    assert (tmp_path / "small.ply").is_file()


def test_a_grid_with_an_obvious_nodata_value_is_read_with_a_warning(tmp_path, capsys):
    elevation = np.arange(30.0).reshape(5, 6)
    elevation[:, 0] = -9999
    np.save(tmp_path / "dem.npy", elevation)
    assert run("info", tmp_path / "dem.npy") == 0
    said = r"warning: .*dem\.npy: 5 of 30 heights are -9999, far from all others \(1 to 29\); .*, say --nodata=-9999\n"
    assert re.search(said, capsys.readouterr().err)
    assert run("info", tmp_path / "dem.npy", "--nodata=-9999") == 0
    out, err = capsys.readouterr()
    assert (err, re.search(r"vertices +25", out) is not None) == ("", True)


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_prints_a_script_that_knows_the_options(capsys, shell):
    assert run("completion", shell) == 0
    script = capsys.readouterr().out
    assert all(word in script for word in (*COMMANDS, "triangles", "memetic"))


@pytest.mark.parametrize("command", [["info"], ["completion", "bash"]])
def test_a_reader_that_has_seen_enough_is_no_error(command):
    process = subprocess.Popen(
        [sys.executable, "-m", "meshsimp_pymoo", *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 0


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_a_command_an_option_and_a_choice(tmp_path, capsys):
    assert run("completion", "bash") == 0
    (tmp_path / "completion.sh").write_text(capsys.readouterr().out)
    ask = 'source ./completion.sh; COMP_WORDS=(meshsimp "$@"); COMP_CWORD=$#; '
    ask += '$(complete -p meshsimp | sed "s/.*-F //; s/ .*//")'
    for words, expected in (
        (["simp"], ["simplify"]),
        (["simplify", "--gen"], ["--generations"]),
        (["pick", "out", "--kn"], ["--knee"]),
        (["simplify", "roof", "--algorithm", "mem"], ["memetic"]),
    ):
        shown = f'{ask} meshsimp "${{@: -1}}"; printf "%s\\n" "${{COMPREPLY[@]}}"'
        done = subprocess.run(
            ["bash", "-c", shown, "bash", *words], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.stdout.split() == expected, done.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_every_command_has_examples_that_can_be_parsed(capsys, command):
    with pytest.raises(SystemExit) as done:
        run(command, "--help")
    assert done.value.code == 0
    examples = re.findall(r"^  meshsimp (.*)$", capsys.readouterr().out, flags=re.M)
    assert examples
    for example in examples:
        assert make_parser().parse_args(example.partition(" > ")[0].split()).command


# ------------------------------------------------------------------------------------------------------ info and start


def test_info_says_what_a_model_is(roof_ply, capsys):
    assert run("info", roof_ply) == 0
    out = capsys.readouterr().out
    for line in (
        r"vertices +25",
        r"triangles +32",
        r"extent +2 x 2 x 1 ",
        r"up +0, 0, 1",
        r"border +16 edges, 1 ",
        "usable",
    ):
        assert re.search(line, out), line


def test_info_in_json_can_be_read_by_programs(roof_ply, capsys):
    assert run("info", roof_ply, "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert (content["vertices"], content["triangles"], content["folds"], content["refusal"]) == (25, 32, 0, None)


def test_info_says_how_a_grid_is_sampled_and_what_its_verdict_rests_on(tmp_path, capsys):
    elevation = np.arange(30.0).reshape(5, 6)
    elevation[0, :2] = -9999
    np.savez(tmp_path / "dem.npz", z=elevation, x=[0, 1, 2, 3, 4, 9], y=[8, 6, 4, 2, 0])
    np.save(tmp_path / "dem.npy", elevation)
    assert run("info", tmp_path / "dem.npy", "--spacing", "30,25.5", "--nodata=-9999") == 0
    out, err = capsys.readouterr()
    assert "\n  grid            6 x 5 samples, 30 x 25.5 apart; 2 without data\n" in out
    assert err == ""
    assert run("info", tmp_path / "dem.npz") == 0
    out = capsys.readouterr().out
    assert "\n  grid            6 x 5 samples, ? x 2 apart; 0 without data\n" in out
    assert out.endswith("\n  verdict         usable, but see the warning: 2 heights of -9999\n")
    assert run("info", tmp_path / "dem.npz", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["grid"] == {"columns": 6, "rows": 5, "spacing": [None, 2.0], "without_data": 0}
    assert content["suspected_nodata"] == [-9999]


@pytest.mark.parametrize(
    ("unit", "said"), [("metre", "2 x 2 m"), ("US survey foot", "2 x 2 US survey foot"), ("degree", "2 x 2 degree")]
)
def test_info_says_the_unit_of_a_grid_s_plane(tmp_path, monkeypatch, capsys, unit, said):
    grid = replace(grid_source(np.eye(3), 2.0, 2.0), georeference={"unit": unit, "height_unit": "metre"})
    monkeypatch.setattr("meshsimp_pymoo.formats.table.read_source", lambda *_: grid)
    monkeypatch.setattr("meshsimp_pymoo.opening.read_source", lambda *_: grid)
    assert run("info", tmp_path / "a.tif") == 0
    assert f"\n  grid            3 x 3 samples, {said} apart; 0 without data\n" in capsys.readouterr().out


def test_info_says_the_area_in_plan_as_a_share_of_the_surface_s(capsys):
    assert run("info", "roof:3") == 0  # both of its slopes by hand: 1 x 2 in plan, 2 sqrt 2 in space
    assert "\n  area in plan    70.7% of the surface's (100%: flat)\n" in capsys.readouterr().out


def test_info_says_what_was_mended(tmp_path, capsys):
    faces = [*ROOF.faces.tolist(), ROOF.faces[0].tolist()]
    faces[3] = faces[3][::-1]
    (tmp_path / "scan.ply").write_bytes(text_ply(ROOF.points, faces))
    assert run("info", tmp_path / "scan.ply") == 0
    out, err = capsys.readouterr()
    told = "1 face listed twice and dropped, 1 face wound against the others turned"
    assert re.search(rf"^  mended +{told}$", out, re.MULTILINE)
    assert err == ""
    assert run("info", tmp_path / "scan.ply", "--json") == 0
    assert json.loads(capsys.readouterr().out)["mended"] == {"repeated": 1, "extra": 0, "turned": 1}
    assert run("info", tmp_path / "scan.ply", "--repair", "none") == 2
    assert "2 edges belong to more than two faces" in capsys.readouterr().err


def test_info_describes_even_what_would_be_refused(tmp_path, capsys):
    (tmp_path / "ring.ply").write_bytes(BAD_FILES["closed"][0])
    assert run("info", tmp_path / "ring.ply") == 2
    out, err = capsys.readouterr()
    assert re.search(rf"triangles +{len(RING.faces)}\n", out)
    assert re.search(r"verdict +refused", out)
    assert err.startswith(f"meshsimp: {tmp_path / 'ring.ply'}: ")


def test_a_mesh_is_described_by_every_measure_that_means_something(monkeypatch):
    quality = Quality(1234.56789, 12345, 6200, 0.123456, 0.234567, 3.456789, 1500)
    said = "12,345 triangles, error 1234.57, mean 0.1235, RMS 0.2346, max 3.457, uncovered 1500"
    assert described(quality) == said
    new = Measure(lambda table, weight: 0.0, label="median error", meaning="half deviate by less", unit="model units")
    with monkeypatch.context() as patch:
        patch.setitem(MEASURES, "median_error", new)
        assert described(SimpleNamespace(**vars(quality), median_error=0.5)) == f"{said}, median 0.5"
    whole = replace(quality, surface_error=0.123456, min_angle_median=31.4159, below_5_degrees=0.0123456)
    said = said.replace("1234.57", "1234.57 m").replace("0.1235", "0.1235 m").replace("0.2346", "0.2346 m")
    said = said.replace("3.457", "3.457 m")
    assert described(whole, "m") == f"{said}, surface 0.1235 m, least angle 31.42 degrees, thin triangles 1.2 %"
    for share, percent in ((0.0, "0"), (0.00023, "0.02 %"), (0.007458, "0.7 %"), (1.0, "100 %")):
        assert described(replace(whole, below_5_degrees=share)).endswith(f", thin triangles {percent}")


def test_a_share_of_the_triangles_is_resolved_when_the_original_is_known(tmp_path, capsys):
    out, wish = tmp_path / "out", ("--triangles", "29%")  # of 578: 167.62
    same = ("simplify", "peaks:18", "-o", out, *wish, "--moves", "20000", "--no-page")
    assert run(*same) == 0
    assert "searched: around at most 167 triangles;" in capsys.readouterr().out
    stored = json.loads((out / "run.json").read_text())
    assert (stored["settings"]["triangles"], stored["wish"], stored["model"]["triangles"]) == (
        167,
        {"triangles": 167},
        578,
    )
    assert run("pick", out, *wish) == 0
    assert f"solution {stored['chosen']} of" in capsys.readouterr().out
    (out / "front.png").unlink()
    assert run(*same) == 0  # which is known again
    assert "making the pictures that are missing" in capsys.readouterr().err
    np.save(tmp_path / "grid.npy", np.random.default_rng(1).random((70, 80)))
    tiled = ("simplify", tmp_path / "grid.npy", "--tile", "64", "-o", tmp_path / "tiles", "--triangles", "0.5%")
    assert run(*tiled, "--no-page", "--jobs", "1") == 0
    stored = json.loads((tmp_path / "tiles" / "run.json").read_text())
    assert stored["settings"]["triangles"] == 54  # of 2 x 69 x 79 = 10902
    capsys.readouterr()
    for share in ("0%", "101%", "%", "nan%", "-5%"):
        assert run("pick", out, f"--triangles={share}") == 2, share


def test_info_without_a_model_lists_the_built_in_ones(capsys):
    assert run("info") == 0
    out = capsys.readouterr().out
    assert "jacksboro:stride=1" in out
    assert "horseshoe:" in out


@pytest.mark.parametrize("arguments", [["--help"], *([command, "--help"] for command in COMMANDS)])
def test_help_is_quick_because_nothing_heavy_is_imported(arguments):
    code = (
        "import sys\nfrom meshsimp_pymoo.cli import main\n"
        f"try: main({arguments})\nexcept SystemExit as done: assert done.code == 0\n"
        "heavy = {'numpy', 'numba', 'pymoo', 'trimesh', 'matplotlib', 'scipy', 'rich'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "meshsimp" in done.stdout


def test_the_version_is_that_of_the_installed_package(capsys):
    try:
        installed = metadata.version("meshsimp-pymoo")
    except metadata.PackageNotFoundError:
        pytest.skip("the package is not installed, only importable")
    with pytest.raises(SystemExit) as done:
        main(["--version"])
    assert done.value.code == 0
    assert capsys.readouterr().out == f"meshsimp {installed}\n"
    assert meshsimp_pymoo.__version__ == installed


def test_help_says_which_grids_are_cut_into_tiles_and_what_each_measure_and_algorithm_is(capsys):
    with pytest.raises(SystemExit):
        run("simplify", "--help")
    said = " ".join(capsys.readouterr().out.split())
    counted = [suffix for kind in all_formats() if kind.count_samples for suffix in kind.suffixes]
    assert set(counted) >= {".npy", ".asc", ".tif", ".tiff"}
    assert (
        f"for {', '.join(counted[:-1])} and {counted[-1]} from 2 million samples on, where one piece does not fit"
        in said
    )
    assert all(f"{measure.minimised} ({measure.meaning})" in said for measure in OBJECTIVES.values())
    assert all(f"{name}: {PRESETS[name].about}" in said for name in ALGORITHMS)


def test_the_choices_offered_are_those_of_the_library():
    for name in written_formats():
        assert make_parser().parse_args(["simplify", "roof", "--format", name]).format == name
    assert ALGORITHMS == ["memetic", "nsga2_v1", "nsga2_v2", "moead"]
    assert make_parser().parse_args(["simplify", "roof", "-o", "x"]).meshes == MESHES_BY_DEFAULT


def test_every_public_name_can_be_imported_and_plotting_waits_until_it_is_needed():
    code = (
        "import sys, meshsimp_pymoo\n"
        "assert 'numpy' not in sys.modules\n"
        "for name in meshsimp_pymoo.__all__: assert getattr(meshsimp_pymoo, name) is not None\n"
        "heavy = {'pymeshlab', 'matplotlib', 'trimesh'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set(meshsimp_pymoo.__all__) <= set(dir(meshsimp_pymoo))
    with pytest.raises(AttributeError, match="has no attribute 'simplfy'"):
        _ = meshsimp_pymoo.simplfy


# ------------------------------------------------------------------------------- measures, weights, heights


@pytest.fixture
def weighted_ply(tmp_path):
    face = load("face:200")
    importance = (face.points[:, 0] > face.points[:, 0].mean()).astype(float)
    write_mesh(tmp_path / "face.ply", face.points, face.faces, {"importance": importance})
    return tmp_path / "face.ply"


@pytest.mark.parametrize("measure", ["rms", "max"])
def test_another_measure_makes_another_front_with_the_same_columns(tmp_path, capsys, measure):
    assert run("simplify", "face:200", "-o", tmp_path / "out", "--measure", measure, *DEFAULT) == 0
    stored = read_front(tmp_path / "out")
    assert (np.diff(stored.quality[f"{measure}_error"]) < 0).all()
    problem = MeshProblem("face:200")
    for kept, error in zip(stored.kept, stored.quality["error"], strict=True):
        assert problem.quality(kept).error == error
    assert stored.run["objectives"] == [f"{measure}_error", "triangles"]
    assert Front.load(tmp_path / "out").problem.objectives == (f"{measure}_error", "triangles")


def test_weights_name_an_attribute_of_the_file(tmp_path, capsys, weighted_ply):
    assert run("simplify", weighted_ply, "-o", tmp_path / "out", "--weights", "importance", *DEFAULT) == 0
    front = Front.load(tmp_path / "out")
    half = MeshProblem(weighted_ply, weights="importance")
    assert front[3].error == half.quality(front[3].kept).error < MeshProblem(weighted_ply).quality(front[3].kept).error
    mesh = tmp_path / "out" / read_front(tmp_path / "out").meshes[3]
    capsys.readouterr()
    assert run("score", weighted_ply, mesh, "--weights", "importance", "--json") == 0
    assert json.loads(capsys.readouterr().out)["error"] == pytest.approx(front[3].error)
    assert run("score", weighted_ply, mesh, "--front", tmp_path / "out", "--json") == 0
    assert json.loads(capsys.readouterr().out)["front"]["error_ratio"] == pytest.approx(1.0)


def test_refitted_meshes_stand_beside_the_others_and_the_referee_agrees(tmp_path, capsys, oracle, weighted_ply):
    out = tmp_path / "out"
    assert run("simplify", weighted_ply, "-o", out, "--refit", "--pick", "knee", "--meshes", "5", *QUICK) == 0
    assert "5 in meshes, 5 in refitted" in capsys.readouterr().out
    assert run("simplify", weighted_ply, "-o", tmp_path / "plain", "--pick", "knee", "--meshes", "5", *QUICK) == 0
    with (out / "front.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    with (tmp_path / "plain" / "front.csv").open(newline="") as file:
        assert [row[:-2] for row in rows] == list(csv.reader(file))
    stored = read_front(out)
    assert stored.refitted_error is not None
    gained = stored.quality["error"] - stored.refitted_error
    written = np.array([bool(mesh) for mesh in stored.refitted_meshes])
    assert written.sum() == 5
    assert (gained[written] >= 0).all()
    assert gained[written][0] > 0
    spec = importlib.util.spec_from_file_location("vertical_error", oracle)
    referee = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(referee)
    points, _ = referee._load(weighted_ply)
    for mesh, error in zip(stored.refitted_meshes, stored.refitted_error, strict=True):
        if mesh:
            found, _, _ = referee.vertical_error(points, *referee._load(out / mesh))
            assert error == pytest.approx(found, rel=1e-6, abs=1e-9)
    plain = trimesh.load(out / "chosen.ply", process=False)
    raised = trimesh.load(out / "chosen_refitted.ply", process=False)
    np.testing.assert_array_equal(plain.faces, raised.faces)
    np.testing.assert_array_equal(plain.vertices[:, :2], raised.vertices[:, :2])
    assert not np.array_equal(plain.vertices[:, 2], raised.vertices[:, 2])
    # The folder is known as ours.
    assert run("simplify", weighted_ply, "-o", out, "--overwrite", "--quiet", *QUICK) == 0
    assert read_front(out).refitted_error is None
    assert not (out / "refitted").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--measure", "l2"], "--measure: invalid choice: 'l2' (choose from l1, rms, max); did you mean l1?"),
        (
            ["--max-error", "1", "--measure", "rms"],
            "--max-error does not go with --measure rms: a wish for an error lowers that error, as --measure max does; "
            "leave --measure out, or take the mesh out of a front that was searched by it (meshsimp pick)",
        ),
        (
            ["--max-error", "1", "--mean-error", "1", "--measure", "rms"],
            "--mean-error and --max-error do not go with --measure rms: a wish for an error lowers that error, as "
            "--measure l1 or max does; leave",
        ),
        (["--weights", "sharpness"], "no per-vertex attribute 'sharpness' to weigh by; it has: none"),
    ],
)
def test_measures_and_weights_that_cannot_be_are_refused(tmp_path, capsys, options, message):
    assert run("simplify", "face:200", "-o", tmp_path / "out", *options) == 2
    assert message in one_line(capsys)
    assert not (tmp_path / "out").exists()
