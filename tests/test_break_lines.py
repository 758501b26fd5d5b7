"""What people see of break lines: in folders, in the shell, in pictures, on pages, in experiments."""

from __future__ import annotations

import csv
import dataclasses
import json
import pickle
import shutil

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from meshsimp_pymoo import Front, MeshProblem, plot_mesh, simplify_to, tiled_front
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.comparison.config import ConfigError, read_experiment_file
from meshsimp_pymoo.comparison.store import read_model, write_model
from meshsimp_pymoo.errors import InputError, ModelError, ResultError
from meshsimp_pymoo.formats.source.lines import SourceLines
from meshsimp_pymoo.formats.table import read_lines, write_lines
from meshsimp_pymoo.opening import open_grid
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.report.figures import BREAK_LINE
from meshsimp_pymoo.storage import FRONT_COLUMNS, LINES, read_front
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.measures import OF_LINES
from meshsimp_pymoo.surface.rules import FOOTPRINTS, Rules
from meshsimp_pymoo.surface.smallest import facts_of_lines, smallest_mesh, tolerance_for

# A line across the hill that winds: 21 vertices, of which some tolerance leaves few.
T = np.linspace(-0.9, 0.9, 21)
WINDING = np.column_stack([T, 0.3 * np.sin(4.0 * T)])
MODEL = "peaks:17"


@pytest.fixture(scope="module")
def problem():
    low, high = MeshProblem(MODEL).model.file_box
    middle, half = (low + high)[:2] / 2.0, (high - low)[:2] / 2.0
    return MeshProblem(MODEL, break_lines=[middle + half * WINDING], line_tolerance=0.05 * half.max(), n_threads=1)


@pytest.fixture(scope="module")
def front(problem):
    rng = np.random.default_rng(3)
    shares = np.linspace(0.1, 0.8, 5)[:, None]
    return Front.from_subsets(problem, rng.random((5, problem.n_var)) < shares, ends=True)


@pytest.fixture(scope="module")
def file(problem, tmp_path_factory):
    """The lines in a file beside which nothing else is."""
    path = tmp_path_factory.mktemp("lines") / "winding.geojson"
    write_lines(path, SourceLines("winding", tuple(map(np.array, problem.surface.rules.break_lines)), ("the line",)))
    return path


@pytest.fixture(scope="module")
def folder(problem, file, tmp_path_factory):
    """A front in a folder, whose lines are in a file."""
    tolerance = problem.surface.rules.line_tolerance
    lined = MeshProblem(MODEL, break_lines=file, line_tolerance=tolerance, n_threads=1)
    rng = np.random.default_rng(4)
    found = Front.from_subsets(lined, rng.random((3, lined.n_var)) < [[0.1], [0.3], [0.6]], ends=True)
    return found.save(tmp_path_factory.mktemp("front") / "out", chosen=1, mesh_format="obj", refit=True)


def edges_of(faces):
    return {tuple(edge) for edge in edge_table(np.asarray(faces)).ends.tolist()}


# -------------------------------------------------------------------------------------------------------------- folders


def test_every_mesh_has_its_lines_as_chains_of_edges(front):
    for solution in front:
        edges = edges_of(solution.faces)
        (chain,) = solution.lines
        assert all(tuple(sorted(pair)) in edges for pair in zip(chain[:-1].tolist(), chain[1:].tolist(), strict=True))
        mesh = solution.mesh
        (rows,) = mesh.metadata["break_lines"]
        np.testing.assert_array_equal(mesh.vertices[rows], front.model.file_points[chain])


def test_a_front_with_lines_has_two_columns_more_and_reads_back(front, tmp_path):
    stored = front.save(tmp_path / "out", chosen=2, pictures=False)
    with (stored / "front.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert tuple(rows[0]) == FRONT_COLUMNS + OF_LINES
    assert all(0.0 < float(row["line_mean_error"]) <= float(row["line_max_error"]) for row in rows)
    again = Front.load(stored)
    assert again.quality == front.quality
    assert again.has_lines
    assert [one.tolist() for one in again[2].lines] == [one.tolist() for one in front[2].lines]
    thinned = read_lines(stored / LINES)
    np.testing.assert_array_equal(thinned.lines[0], front.model.file_points[front.model.lines.chains[0]])
    facts = again.run["model"]["lines"]
    assert (facts["lines"], facts["vertices"]) == (1, len(WINDING)) < (2, len(front.model.lines.originals[0]))  # draped
    assert facts["forced_edges"] == len(front.model.lines.segments) == facts["thinned"] - 1
    assert facts["smallest"] == front[0].triangles == smallest_mesh(front.surface)
    assert "line_max_error" in again.to_frame()


def test_without_lines_nothing_is_said_of_any(tmp_path):
    problem = MeshProblem("roof:5", n_threads=1)
    front = Front.from_subsets(problem, np.ones((1, problem.n_var), bool), ends=True)
    stored = front.save(tmp_path / "out", pictures=False)
    assert (stored / "front.csv").read_text().splitlines()[0] == ",".join(FRONT_COLUMNS)
    assert not (stored / LINES).exists()
    assert "lines" not in read_front(stored).run["model"]
    assert not {*OF_LINES} & {*read_front(stored).quality, *Front.load(stored).to_frame()}
    assert front[0].lines == ()
    assert "break_lines" not in front[0].mesh.metadata
    with pytest.raises(LookupError, match="line max error of the solutions of roof:5 was not measured"):
        front.best(line_max_error=1.0)


def test_numbers_of_lines_that_are_not_known_are_equal_in_another_process():
    quality = MeshProblem("roof:3").quality(np.ones(9, bool))
    assert np.isnan(quality.line_max_error)
    assert pickle.loads(pickle.dumps(quality)) == quality


def test_meshes_are_written_with_their_lines_refitted_ones_too(folder):
    for path in (*folder.glob("meshes/*.obj"), *folder.glob("refitted/*.obj"), folder / "chosen.obj"):
        (line,) = read_lines(path).lines
        vertices = trimesh.load(path, process=False).vertices
        assert (np.abs(vertices[:, None] - line).max(axis=2).min(axis=0) == 0.0).all()
    solution = Front.load(folder)[0]
    (line,) = read_lines(solution.save(folder.parent / "one.ply")).lines
    np.testing.assert_array_equal(line, solution.front.model.file_points[solution.lines[0]])


def test_a_folder_and_its_lines_can_move_together(folder, file, tmp_path):
    new = tmp_path / "elsewhere"
    shutil.copytree(folder, new / folder.relative_to(folder.parent.parent))
    (new / file.parent.name).mkdir()
    shutil.copy(file, new / file.parent.name)
    moved = Front.load(new / folder.parent.name / folder.name)
    assert moved.surface.rules.break_lines == str((new / file.parent.name / file.name).resolve())
    assert Front.load(folder, model=moved.surface)[0].lines[0].tolist() == moved[0].lines[0].tolist()


def test_a_model_that_has_its_lines_already_is_taken_as_the_original(folder):
    front = Front.load(folder)
    again = Front.load(folder, model=front.model)
    assert again.surface.model.hash == front.surface.model.hash
    assert front.model.without_lines().hash == MeshProblem(MODEL).model.hash


def test_other_rules_line_a_model_anew(problem):
    rules = dataclasses.replace(problem.surface.rules, line_tolerance=3.0 * problem.surface.rules.line_tolerance)
    anew, fresh = MeshProblem(problem.model, rules=rules).model, MeshProblem(MODEL, rules=rules).model
    assert anew.n_vertices < problem.model.n_vertices
    assert anew.hash == fresh.hash


def test_originals_that_thinning_leaves_alone_are_told_apart(problem):
    lines = problem.model.lines
    other = dataclasses.replace(lines, originals=tuple(line + 1e-9 for line in lines.originals))
    assert other.hash != lines.hash == dataclasses.replace(lines, names=("another",)).hash


@pytest.mark.parametrize("change", ["gone", "other", "nearly the same"])
def test_lines_that_vanished_or_changed_are_refused_in_one_line(folder, file, change, capsys):
    content = file.read_text()
    try:
        file.unlink()
        if change != "gone":
            lines = read_back(content)
            lines[0][3] = lines[0][3] + (0.3 if change == "other" else 1e-4)
            write_lines(file, SourceLines("winding", tuple(lines), ("the line",)))
        message = (
            r"put them back" if change == "gone" else r"with the break lines of .* is now \(a file has changed since"
        )
        with pytest.raises(ResultError, match=message) as refused:
            Front.load(folder).surface  # noqa: B018
        assert "\n" not in str(refused.value)
        assert main(["pick", str(folder), "--solution", "1", "-o", str(folder.parent / "x.stl")]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    finally:
        file.write_text(content)


def read_back(content):
    return [np.array(f["geometry"]["coordinates"], float) for f in json.loads(content)["features"]]


# ---------------------------------------------------------------------------------------------------- the smallest mesh


def test_the_tolerance_that_is_named_allows_the_wish_and_a_little_less_does_not(problem):
    rules = problem.surface.rules
    wanted = smallest_mesh(problem.surface) - 1
    tolerance = tolerance_for(problem.surface, wanted)

    def smallest(at):
        return smallest_mesh(MeshProblem(MODEL, rules=dataclasses.replace(rules, line_tolerance=at)).surface)

    assert tolerance > rules.line_tolerance
    assert smallest(tolerance) <= wanted < smallest(0.8 * tolerance)
    assert tolerance_for(problem.surface, 2) is None


# ------------------------------------------------------------------------------------------------------------ the shell


def test_the_shell_says_what_lines_are_and_what_they_ask_of_every_mesh(problem, file, tmp_path, capsys):
    given = ["--break-lines", str(file), "--line-tolerance", f"{problem.surface.rules.line_tolerance!r}"]
    assert main(["info", MODEL, *given, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)["lines"]
    assert (facts["lines"], facts["forced_edges"]) == (1, len(problem.model.lines.segments))
    most = facts["smallest"] + 20
    how = ["--moves", "2000", "--no-page", "--meshes", "1"]
    out = tmp_path / "out"
    assert main(["simplify", MODEL, "-o", str(out), *given, "--triangles", str(most), *how]) == 0
    said = capsys.readouterr().out
    assert f"break lines: 1 line, 21 vertices thinned to {facts['thinned']} within " in said
    assert (
        f"every mesh keeps their {facts['forced_edges']} edges, the smallest has {facts['smallest']} triangles" in said
    )
    assert ", line max " in said
    assert main(["score", MODEL, str(out / "chosen.ply"), "--front", str(out), "--json"]) == 0
    scored = json.loads(capsys.readouterr().out)
    chosen = Front.load(out)
    best = chosen[chosen.run["chosen"]]
    assert scored["line_max_error"] == pytest.approx(best.line_max_error, abs=1e-9)
    assert main(["score", MODEL, str(out / "chosen.ply"), *given, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["line_mean_error"] == pytest.approx(best.line_mean_error, abs=1e-9)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_a_wish_below_what_lines_allow_is_told_which_tolerance_would(problem, file, tmp_path, capsys, footprint):
    given = ["--break-lines", str(file), "--line-tolerance", f"{problem.surface.rules.line_tolerance!r}"]
    smallest = smallest_mesh(problem.surface)
    out = tmp_path / "out"
    footprint = ["--footprint", footprint]
    assert main(["simplify", MODEL, "-o", str(out), *given, "--triangles", str(smallest - 1), "-q", *footprint]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"the smallest mesh of {MODEL} has {smallest} triangles; --line-tolerance " in line
    assert line.endswith(f"would allow {smallest - 1}")
    assert not out.exists()
    assert main(["simplify", MODEL, "-o", str(out), *given, "--triangles", "2", "-q"]) == 2
    assert "no tolerance allows 2: leave some of the lines out" in capsys.readouterr().err
    for options in (["--triangles", "1"], ["--triangles", str(smallest - 1), "--footprint", "hull"]):
        assert main(["simplify", MODEL, "-o", str(out), *given, *options, "-q"]) == 2
        assert f"the smallest mesh of {MODEL} has {smallest} triangles; " in capsys.readouterr().err
    how = ["--moves", "1000", "--no-page", "--meshes", "none", "-q"]
    assert main(["simplify", MODEL, "-o", str(out), *given, "--triangles", str(smallest), *how]) == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["--break-lines", "outlin", "--line-tolerance", "1"],
            "outlin: no such file of break lines (did you mean 'out",
        ),
        (["--break-lines", "nowhere.shp", "--line-tolerance", "1"], "nowhere.shp: no such file; check the path"),
        (["--break-lines", "a.geojson"], "break lines need --line-tolerance L: how far they may move"),
        (["--line-tolerance", "1"], "--line-tolerance 1 is for break lines, and there are none; name them by --break-"),
        (["--break-line", "a"], "did you mean --break-lines?"),
        (
            ["--break-lines", "outline", "--tile", "64"],
            "--break-lines does not go with tiles, which do not know them; ",
        ),
        (["--break-lines", "sharp:x"], "give degrees between 0 and 180"),
    ],
)
def test_what_does_not_go_is_refused_in_one_line_before_any_search(words, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["simplify", MODEL, "-o", "out", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert list(tmp_path.iterdir()) == []


def test_big_grids_say_that_tiles_do_not_know_lines(tmp_path, monkeypatch, capsys):
    np.save(tmp_path / "big.npy", np.random.default_rng(1).random((80, 90)))
    monkeypatch.setattr("meshsimp_pymoo.cli.tiling.TILED_FROM", 100)
    monkeypatch.setattr("meshsimp_pymoo.cli.tiling.fits_in_one_piece", lambda count: False)
    assert main(["simplify", str(tmp_path / "big.npy"), "-o", str(tmp_path / "o"), "--break-lines", "outline"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "big.npy does not fit into the memory in one piece; take a part of it (--window" in line
    with pytest.raises(ModelError, match=r"break_lines='outline' is not for a grid read by windows; leave it out, or"):
        tiled_front(open_grid(tmp_path / "big.npy"), rules=Rules(break_lines="outline"))


# ------------------------------------------------------------------------------------------------ pictures and the page


def test_plots_show_the_lines(front):
    def drawn(ax):
        colour = tuple(int(BREAK_LINE[k : k + 2], 16) / 255 for k in (1, 3, 5))
        found = [c for c in ax.collections if hasattr(c, "get_segments")]
        assert all(tuple(c.get_colors()[0][:3]) == pytest.approx(colour) for c in found)
        return [segment.tolist() for c in found for segment in c.get_segments()]

    solution = front[1]
    on_mesh = [front.surface.points[chain][:, :2].tolist() for chain in solution.lines]
    assert drawn(solution.plot(Figure().subplots())) == on_mesh
    assert drawn(plot_mesh(front.problem, Figure().subplots(), kept=solution.kept)) == on_mesh
    given = [line[:, :2].tolist() for line in front.model.lines.originals]
    assert drawn(plot_mesh(front.problem, Figure().subplots())) == given
    assert drawn(solution.plot_error(Figure().subplots(), bar=False)) == given
    assert drawn(solution.plot(Figure().subplots(), lines=False)) == []
    assert drawn(plot_mesh(MeshProblem("roof:5"), Figure().subplots())) == []


# -------------------------------------------------------------------------------------------------- python, experiments


def test_an_experiments_file_lies_in_the_folder_of_the_models_and_is_told_by_its_content(file, tmp_path):
    shutil.copy(file, tmp_path / "winding.geojson")
    spelled = "break_lines: winding.geojson, line_tolerance: 0.1"
    config = tmp_path / "config.yaml"
    config.write_text(
        f"title: A\nproblems:\n  - {{name: P, model: '{MODEL}', {spelled}}}\n"
        "algorithms:\n  - {preset: nsga2_v1, parameters: {pop_size: 8}}\nseeds: [1]\nbudgets:\n  - {generations: 1}\n"
    )
    (entry,) = read_experiment_file(config).problems
    assert entry.rules.break_lines == "winding.geojson"
    built = entry.build()
    assert built.model.lines is not None
    assert built.surface.rules.break_lines is None
    (tmp_path / "models").mkdir()
    relative = write_model(tmp_path, entry.model)
    again = read_model(tmp_path, relative, entry.model.hash)
    for one, other in zip(again.lines.arrays().values(), entry.model.lines.arrays().values(), strict=True):
        np.testing.assert_array_equal(one, other)
    surface = HeightSurface(again)
    assert facts_of_lines(surface, again.lines)["vertices"] == sum(map(len, again.lines.originals))
    config.write_text(config.read_text().replace("winding", "../winding"))
    with pytest.raises(ConfigError, match="leads out of the folder"):
        read_experiment_file(config)
    config.write_text(config.read_text().replace("../winding", "winter"))
    with pytest.raises(ConfigError, match=r"there is no file .*winter.geojson \(did you mean 'winding.geojson'\?\)"):
        read_experiment_file(config)


def test_stored_lines_that_do_not_fit_together_are_refused(problem):
    arrays = problem.model.lines.arrays()
    with pytest.raises(ValueError, match="are not cut into lines of two or more"):
        ModelLines.of_arrays(arrays | {"chain_start": np.array([0, 1])})
    with pytest.raises(ValueError, match="1 lines have 1 chains and 2 names"):
        ModelLines.of_arrays(arrays | {"names": np.array(["a", "b"])})


def test_free_meshes_keep_their_lines_and_know_their_errors(front):
    freed = front.free(moves=20_000)
    assert freed.n_free > 0
    for solution in freed:
        edges, (chain,) = edges_of(solution.faces), solution.lines
        assert all(tuple(sorted(pair)) in edges for pair in zip(chain[:-1].tolist(), chain[1:].tolist(), strict=True))
        found = freed.surface.of_faces(solution.faces).quality
        assert solution.line_max_error == pytest.approx(found.line_max_error, abs=1e-12)


def test_lines_go_with_wishes_and_problems_say_them(problem):
    most = smallest_mesh(problem.surface) + 10
    found = simplify_to(problem, triangles=most, moves=2000)
    assert found.triangles <= most
    assert set(problem.model.lines.vertices) <= set(np.flatnonzero(found.kept))
    assert "break lines within " in problem.surface.__repr__()
    with pytest.raises(InputError, match="need line_tolerance=L"):
        MeshProblem(MODEL, break_lines=[[[0, 0], [1, 1]]])
