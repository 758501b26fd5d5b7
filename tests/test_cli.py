"""The shell interface: what it writes, what it says, what it refuses."""

from __future__ import annotations

import csv
import io
import json
import re
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pymoo.optimize import minimize
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

import meshsimp_pymoo
from meshsimp_pymoo import MeshProblem, cli, nsga2_v1
from meshsimp_pymoo.algorithms import PRESETS
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.results import MESH_FORMATS, MESHES_BY_DEFAULT, read_front, write_mesh

QUICK = ("--generations", "3", "--population", "12")


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


def test_simplify_writes_a_front_that_reads_back_and_meshes_that_open(tmp_path, capsys):
    assert run("simplify", "face:200", "-o", tmp_path / "out", *QUICK) == 0
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
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--seed", 4, *QUICK) == 0
    problem = MeshProblem("roof:9")
    result = minimize(problem, nsga2_v1(pop_size=12), ("n_gen", 3), seed=4)
    stored = read_front(tmp_path / "out")
    # Besides what the search found: all vertices, and the corners alone.
    ends = np.array([np.ones(problem.n_var, bool), problem.pinned])
    X, F = np.vstack([result.X, ends]), np.vstack([result.F, problem.evaluate(ends)])
    best = NonDominatedSorting().do(F, only_non_dominated_front=True)
    assert np.array_equal(stored.F, np.unique(F[best][:, ::-1], axis=0)[:, ::-1])
    chromosomes = {row.tobytes() for row in X}
    assert all(row.tobytes() in chromosomes for row in stored.kept)


@pytest.mark.parametrize("budget", [("--generations", "4"), ("--evaluations", "40")])
@pytest.mark.parametrize("algorithm", ["nsga2_v1", "nsga2_v2", "moead"])
def test_one_seed_gives_the_same_bytes_with_one_and_two_threads(tmp_path, algorithm, budget):
    written = []
    for name, threads in (("a", "1"), ("b", "2"), ("c", "1")):
        options = ("--population", "12", "--threads", threads, "--algorithm", algorithm, "--pick", "knee")
        assert run("simplify", "face:150", "-o", tmp_path / name, *options, *budget) == 0
        content = files(tmp_path / name)
        del content["run.json"]  # it holds the time taken and the number of threads
        written.append(content)
    assert written[0] == written[1] == written[2]
    assert {"front.csv", "front.npz", "front.png", "chosen.ply"} < set(written[0])


def test_another_seed_gives_another_front(tmp_path):
    for seed in (1, 2):
        assert run("simplify", "face:150", "-o", tmp_path / str(seed), "--seed", seed, *QUICK) == 0
    assert (tmp_path / "1" / "front.csv").read_bytes() != (tmp_path / "2" / "front.csv").read_bytes()


def test_the_record_of_the_run_holds_what_is_needed_to_repeat_it(tmp_path):
    options = ("--footprint", "hull", "--outside", "ignore", "--pin", "3,7")
    options += ("--evaluations", "30", "--population", "12")
    assert run("simplify", "roof:5", "-o", tmp_path / "out", *options) == 0
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["settings"] == {
        "triangles": None,
        "max_error": None,
        "mean_error": None,
        "pick": None,
        "time": None,
        "evaluations": 30,
        "generations": None,
        "algorithm": "nsga2_v1",
        "population": 12,
        "threads": None,
        "up": "auto",
        "patch": None,
        "spacing": None,
        "nodata": None,
        "footprint": "hull",
        "outside": "ignore",
        "pin": [3, 7],
        "format": "ply",
        "meshes": 100,
    }
    assert record["model"]["name"] == "roof:5"
    assert record["seed"] == 1
    assert record["generations"] == 3
    assert record["evaluations"] == 36
    assert record["seconds"] > 0
    assert record["interrupted"] is False


def test_the_budget_in_seconds_is_kept(tmp_path):
    run("simplify", "roof:5", "-o", tmp_path / "warm", *QUICK)  # compiles
    start = time.perf_counter()
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--time", "0.5s", "--population", "12") == 0
    seconds = json.loads((tmp_path / "out" / "run.json").read_text())["seconds"]
    assert 0.5 <= seconds < 2
    assert time.perf_counter() - start < 8


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
    assert "and at most 0.5 was asked for; search longer" in capsys.readouterr().err
    assert (tmp_path / "out" / "front.csv").is_file()
    assert not (tmp_path / "out" / "chosen.ply").exists()


def test_both_ends_of_the_front_are_there_without_a_search_for_them(tmp_path):
    assert run("simplify", "jacksboro:20", "-o", tmp_path / "out", "--triangles", 3, *QUICK) == 0
    stored = read_front(tmp_path / "out")
    assert stored.F[0, 1] == 2
    assert stored.F[-1, 0] == 0


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
        (("--triangles", 9, "--pick", "knee"), r"not allowed with argument"),
    ],
)
def test_impossible_targets_are_refused_with_what_is_possible(tmp_path, capsys, options, message):
    assert run("simplify", "roof:9", "-o", tmp_path / "out", *options) == 2
    assert re.search(message, one_line(capsys))
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------------------- options


@pytest.mark.parametrize("suffix", cli.FORMATS)
def test_meshes_are_written_in_the_wanted_format(tmp_path, suffix):
    assert run("simplify", "roof:5", "-o", tmp_path / "out", "--format", suffix, *QUICK) == 0
    with (tmp_path / "out" / "front.csv").open(newline="") as file:
        meshes = [row["mesh"] for row in csv.DictReader(file)]
    assert all(mesh.endswith(f".{suffix}") for mesh in meshes)
    assert all((tmp_path / "out" / mesh).is_file() for mesh in meshes)


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
    assert "--patch front" in one_line(capsys)
    assert run("simplify", tmp_path / "ball.ply", "-o", tmp_path / "out", "--up", "z", "--patch", "front", *QUICK) == 0
    mesh = trimesh.load(tmp_path / "out" / read_front(tmp_path / "out").meshes[-1], process=False)
    assert mesh.vertices[:, 2].min() > -0.2


def test_the_asked_number_of_threads_is_used():
    args = cli._parser().parse_args(["simplify", "roof:5", "-o", "x", "--threads", "3"])
    assert cli._mesh_problem(args).elementwise_runner.n_threads == 3


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


def test_a_terminal_sees_progress(tmp_path, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stderr", Terminal())
    assert run("simplify", "roof:5", "-o", tmp_path / "out", *QUICK) == 0
    assert "roof:5" in sys.stderr.getvalue()
    assert "36 evaluations" in sys.stderr.getvalue()


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
    assert run("simplify", "roof:9", "-o", tmp_path / "whole", "--generations", 2, "--population", 12) == 0
    capsys.readouterr()
    interrupt_after(monkeypatch, 2)
    assert run("simplify", "roof:9", "-o", tmp_path / "out", "--generations", 50, "--population", 12) == 130
    assert "interrupted after 2 generations" in capsys.readouterr().err
    assert (tmp_path / "out" / "front.csv").read_bytes() == (tmp_path / "whole" / "front.csv").read_bytes()
    assert read_front(tmp_path / "out").run["interrupted"] is True


def test_a_run_interrupted_before_its_first_generation_writes_nothing(tmp_path, monkeypatch, capsys):
    interrupt_after(monkeypatch, 0)
    assert run("simplify", "roof:9", "-o", tmp_path / "out", *QUICK) == 130
    assert "nothing is written" in one_line(capsys)
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_while_writing_leaves_nothing_half_written(tmp_path, monkeypatch, capsys):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("meshsimp_pymoo.report.figures.front_figure", interrupt)
    assert run("simplify", "roof:9", "-o", tmp_path / "out", *QUICK) == 130
    assert "nothing is written" in one_line(capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process")
def test_ctrl_c_in_a_real_shell_keeps_the_front(tmp_path):
    command = [sys.executable, "-m", "meshsimp_pymoo.cli", "simplify", "face:2000", "--time", "10min"]
    command += ["-o", str(tmp_path / "out")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        time.sleep(6)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert len(read_front(tmp_path / "out").F) > 10


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


def folded():
    points = ROOF.points.copy()
    points[6, :2] = points[18, :2]
    return points


BOX = trimesh.creation.box()
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
    "closed": (text_ply(BOX.vertices, BOX.faces), r"bad\.ply: .*closed.*--patch front"),
    "non-manifold": (
        text_ply([*ROOF.points.tolist(), [0, 0, 9]], [*ROOF.faces.tolist(), [0, 6, 25], [6, 0, 25]]),
        r"bad\.ply: \d+ edges belong to more than two faces",
    ),
    "folded": (text_ply(folded(), ROOF.faces), r"bad\.ply: .* folded over.*--patch front"),
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
        (("--evaluations", "many"), r"'many' is not a whole number of at least 1"),
        (("--population", "1"), r"'1' is not a whole number of at least 2"),
        (("--seed", "-1"), r"--seed"),
        (("--seed", "1.5"), r"'1.5' is not a whole number of at least 0"),
        (("--threads", "0"), r"'0' is not a whole number of at least 1"),
        (("--algorithm", "annealing"), r"invalid choice: 'annealing' \(choose from '?nsga2_v1"),
        (("--footprint", "box"), r"invalid choice: 'box'"),
        (("--up", "sideways"), r"'sideways' is no direction"),
        (("--pin", "0,here"), r"'here' is not a whole number of at least 0"),
        (("--pin", "25"), r"pin: row 25 of roof:5 is not among"),
        (("--spacing", "0"), r"'0' is not one or two positive numbers"),
        (("--spacing", "2"), r"roof:5: spacing and nodata describe height grids"),
        (("--nodata", "x"), r"'x' is not a finite number"),
        (("--meshes", "some"), r"'some' is not a whole number of at least 0"),
        (("--format", "doc"), r"invalid choice: 'doc'"),
        (("--gen", "3"), r"unrecognized arguments: --gen 3"),
        (("--triangels", "3"), r"unrecognized arguments: --triangels 3"),
    ],
)
def test_a_wrong_option_is_answered_in_one_line(tmp_path, capsys, options, message):
    assert run("simplify", "roof:5", "-o", tmp_path / "out", *options) == 2
    assert re.search(message, one_line(capsys))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), r"required: COMMAND"),
        (("simplify", "roof"), r"required: -o/--output"),
        (("simplify", "-o", "out"), r"required: MODEL"),
        (("melt", "roof"), r"invalid choice: 'melt'"),
    ],
)
def test_a_wrong_command_is_answered_in_one_line(capsys, arguments, message):
    assert run(*arguments) == 2
    assert re.search(message, one_line(capsys))


def test_anything_unexpected_keeps_its_traceback(tmp_path, monkeypatch):
    def fail(*args, **kwargs):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("meshsimp_pymoo.report.figures.front_figure", fail)
    with pytest.raises(ZeroDivisionError, match="a bug"):
        run("simplify", "roof:5", "-o", tmp_path / "out", *QUICK)
    assert list(tmp_path.iterdir()) == []


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


def test_info_describes_even_what_would_be_refused(tmp_path, capsys):
    (tmp_path / "box.ply").write_bytes(BAD_FILES["closed"][0])
    assert run("info", tmp_path / "box.ply") == 2
    out, err = capsys.readouterr()
    assert re.search(r"triangles +12\n", out)
    assert re.search(r"verdict +refused", out)
    assert err.startswith(f"meshsimp: {tmp_path / 'box.ply'}: ")


def test_info_without_a_model_lists_the_built_in_ones(capsys):
    assert run("info") == 0
    out = capsys.readouterr().out
    assert "jacksboro:stride=1" in out
    assert "horseshoe:" in out


@pytest.mark.parametrize("arguments", [["--help"], ["simplify", "--help"], ["info", "--help"]])
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


def test_the_choices_offered_are_those_of_the_library():
    assert cli.FORMATS == MESH_FORMATS
    assert set(cli.ALGORITHMS) < set(PRESETS)
    assert cli._parser().parse_args(["simplify", "roof", "-o", "x"]).meshes == MESHES_BY_DEFAULT


def test_every_public_name_can_be_imported_and_plotting_waits_until_it_is_needed():
    code = (
        "import sys, meshsimp_pymoo\n"
        "assert 'numpy' not in sys.modules\n"
        "for name in meshsimp_pymoo.__all__: assert getattr(meshsimp_pymoo, name) is not None\n"
        "heavy = {'pymeshlab', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert set(meshsimp_pymoo.__all__) <= set(dir(meshsimp_pymoo))
    with pytest.raises(AttributeError, match="has no attribute 'simplfy'"):
        _ = meshsimp_pymoo.simplfy
