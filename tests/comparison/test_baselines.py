"""The methods without chance: what they make is what is scored, fronts are the passes' own, what is missing is said."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from meshsimp_pymoo.comparison import baselines
from meshsimp_pymoo.comparison.baselines import (
    BASELINES,
    MOST_ROWS,
    baseline_front,
    baseline_meshes,
    chosen_rows,
    largest_at_most,
    reductions,
)
from meshsimp_pymoo.comparison.config import read_experiment_file
from meshsimp_pymoo.comparison.figures import fronts_figure, meshes_figure
from meshsimp_pymoo.comparison.report import write_tables
from meshsimp_pymoo.comparison.runner import run_experiment
from meshsimp_pymoo.comparison.store import classic_mesh
from meshsimp_pymoo.comparison.study import Study
from meshsimp_pymoo.comparison.tables import baselines as baselines_table
from meshsimp_pymoo.errors import ExperimentWarning, ToolUnavailable
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.indicators import non_dominated
from meshsimp_pymoo.search.greedy import NestedFront, greedy_insertion, thinning
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import OF_MESH
from meshsimp_pymoo.surface.model import build_model

TOOLS = [name for name, known in BASELINES.items() if known.tool]
PASSES = {
    "thinning": thinning,
    "insertion_by_point": greedy_insertion,
    "insertion_by_triangle": lambda surface: greedy_insertion(surface, choose="triangle"),
}
PACKAGES = sorted({known.package for known in BASELINES.values() if known.package != "pymeshlab"} - {""})
# They cannot leave out an edge of the border, so their smallest mesh has all of it.
BORDER = {"quadric_collapse_boundary", "meshoptimizer_border", "fast_simplification_border", "pyfqmr_border"}
SIDE = 15


def grid(frame=lambda points: points, **georeference):
    """A grid of 225 heights, brought into another frame that must make no difference."""
    x, y = np.meshgrid(np.arange(SIDE, dtype=float), np.arange(SIDE, dtype=float))
    z = np.round(np.random.default_rng(3).uniform(size=x.shape) + 3 * np.sin(x / 3) * np.cos(y / 4), 6)
    row, column = np.divmod(np.arange((SIDE - 1) ** 2), SIDE - 1)
    a = row * SIDE + column
    faces = np.vstack([np.stack([a, a + 1, a + SIDE + 1], 1), np.stack([a, a + SIDE + 1, a + SIDE], 1)])
    points = frame(np.column_stack([x.ravel(), y.ravel(), z.ravel()]))
    return HeightSurface(build_model(SourceMesh(points, faces, {}, name="grid", georeference=georeference)))


GRID = grid()


def meshes(name, surface=GRID, asked=(196, 40)):
    """Let a tool work, or skip where it is not installed."""
    try:
        return baseline_meshes(surface, name, asked)
    except ToolUnavailable as reason:
        pytest.skip(str(reason))


# ------------------------------------------------------------------------------------------------------- tools


@pytest.mark.parametrize("name", TOOLS)
class TestEveryTool:
    def test_makes_meshes_of_at_most_so_many_triangles_that_are_scored_as_they_are(self, name):
        model = GRID.model
        places = {tuple(point) for point in model.file_points.tolist()}
        for mesh in meshes(name):
            assert mesh.quality == GRID.score(mesh.vertices, mesh.faces).quality
            assert mesh.triangles == mesh.quality.triangles > 0
            assert_array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))  # none is left over
            assert {tuple(point) for point in mesh.vertices.tolist()} <= places or not BASELINES[name].own_vertices
            assert mesh.seconds > 0
            if name in BORDER and mesh.asked == 40:
                assert mesh.note == f"{name} was asked for 40 triangles and gave {mesh.triangles}"
                assert mesh.triangles >= 4 * (SIDE - 1) - 2
            elif name == "vertex_clustering":  # the grid of its cells cannot give every number
                assert mesh.triangles == pytest.approx(mesh.asked, rel=0.25)
            else:
                assert mesh.note == ""
                assert 0.95 * mesh.asked <= mesh.triangles <= mesh.asked

    def test_asked_for_all_triangles_loses_nothing(self, name):
        (mesh,) = meshes(name, asked=[392])
        assert mesh.triangles == 392
        assert mesh.quality.error < 1e-4
        assert mesh.quality.uncovered == 0

    def test_refuses_impossible_numbers_before_it_does_anything(self, name):
        for number in (0, 393):
            with pytest.raises(ValueError, match=f"{number} triangles were asked for, but the model has 392"):
                baseline_meshes(GRID, name, [10, number])


# MeshLab's collapse in the file's own unit depends on that unit: see meshlab.py.
@pytest.mark.parametrize("name", [name for name in TOOLS if name != "quadric_collapse"])
def test_works_far_from_the_origin_in_any_unit_and_in_degrees(name):
    found = meshes(name)
    for moved in (
        grid(lambda points: points * 1024 + [5e9, -4e9, 0.0]),
        grid(lambda points: points / [1024, 1024, 1], scale=(1024.0, 1024.0)),
    ):
        for one, other in zip(found, meshes(name, moved), strict=True):
            assert_array_equal(other.faces, one.faces)
            assert_allclose(other.quality.rms_error, one.quality.rms_error * moved.diagonal / GRID.diagonal)


def test_only_surfaces_and_tools_will_do():
    with pytest.raises(TypeError, match="baseline_meshes: a OpenModel has no rules; give a surface"):
        baseline_meshes(GRID.model, "pyfqmr_free", [4])
    with pytest.raises(ValueError, match="there is no tool 'thinning': choose among quadric_collapse, "):
        baseline_meshes(GRID, "thinning", [100])


def test_the_largest_mesh_of_at_most_so_many_triangles_is_found():
    def tool(obtained):
        asked = []

        def simplify(number):
            asked.append(number)
            return np.empty((0, 3)), np.empty((obtained(number), 3), np.int64)

        return simplify, asked

    def found(obtained, size):
        simplify, asked = tool(obtained)
        (_, faces), _ = largest_at_most(simplify, size, 1000)
        assert len(asked) <= 16
        return len(faces)

    assert found(lambda number: number, 500) == 500
    assert found(lambda number: number + 7, 500) == 500  # what the miss suggests
    assert found(lambda number: 100 * (number // 100), 555) == 500
    assert found(lambda number: 100 + number, 90) == 101  # all are too large: the smallest
    assert found(lambda number: number if number > 3 else 0, 2) == 4  # too few to be a mesh
    assert found(lambda number: 2 * number, 900) == 900
    with pytest.raises(ValueError, match="no triangle is left, whatever number of them up to 1000 is asked for"):
        found(lambda number: 0, 500)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_tool_that_is_missing_or_broken_is_named_with_the_command_that_installs_it(package, monkeypatch):
    names = [name for name, known in BASELINES.items() if known.package == package]
    monkeypatch.setitem(sys.modules, package.replace("-", "_"), None)
    for name in names:
        with pytest.raises(
            ToolUnavailable, match=rf"^{package} is not installed; install it by pip install .*{package}"
        ):
            baseline_meshes(GRID, name, [100])

    def broken(module):
        raise ImportError("libstdc++.so.6: version\n`GLIBCXX_9' not found")

    monkeypatch.setattr(importlib, "import_module", broken)
    with pytest.raises(ToolUnavailable, match=rf"^{package} does not load \(libstdc\+\+.so.6: version `GLIBCXX_9' not"):
        baseline_meshes(GRID, names[0], [100])


def test_pydelatin_takes_full_grids_only():
    pytest.importorskip("pydelatin")
    points = GRID.model.file_points
    hole = build_model(SourceMesh(points, GRID.model.faces[:-1], {}, name="a face less"))
    assert baseline_meshes(HeightSurface(hole), "pydelatin", [100])[0].triangles <= 100  # all heights are there
    for moved in (points + [0.2, 0, 0] * (points[:, :1] == 7), points + [0, 0.01, 0] * (points[:, :1] == 7)):
        uneven = HeightSurface(build_model(SourceMesh(moved, GRID.model.faces, {}, name="uneven")))
        with pytest.raises(ToolUnavailable, match="pydelatin needs heights on a full regular grid"):
            baseline_meshes(uneven, "pydelatin", [100])


def test_what_a_tool_raises_is_a_mesh_that_is_missing(monkeypatch):
    def fails(model):
        def simplify(number):
            if number < 50:
                raise TypeError("out\nof triangles")
            return model.file_points[:3], np.array([[0, 1, 1]])

        return simplify

    monkeypatch.setitem(baselines.BASELINES, "pyfqmr_free", replace(BASELINES["pyfqmr_free"], tool=fails))
    flat, none = baseline_meshes(GRID, "pyfqmr_free", [100, 40])
    assert none.note == "no mesh: out of triangles"
    assert flat.note.startswith("no mesh: none of the 1 faces has an area")
    for mesh in (flat, none):
        assert (mesh.triangles, mesh.quality.triangles, mesh.quality.uncovered) == (0, 0, 225)
        assert mesh.quality.error == np.inf
        assert np.isnan(mesh.quality.surface_error)


class TestReductions:
    def test_are_the_papers_ten(self):
        assert reductions(200) == (190, 180, 170, 160, 150, 140, 130, 120, 110, 100)

    def test_go_on_down_to_a_given_size(self):
        series = reductions(1667, down_to=12)
        assert len(series) == 20
        assert series[:10] == reductions(1667)
        assert series[-1] == 12
        ratios = np.divide(series[10:], series[9:-1])
        assert_allclose(ratios, ratios[0], rtol=0.05)

    def test_never_repeat_a_number_and_never_ask_for_nothing(self):
        assert reductions(6, down_to=1) == (6, 5, 4, 3, 2, 1)
        assert reductions(1) == (1,)
        assert reductions(100, down_to=70) == reductions(100)

    @pytest.mark.parametrize("wrong", [{"triangles": 0}, {"triangles": 9, "down_to": 0}])
    def test_refuse_nonsense(self, wrong):
        with pytest.raises(ValueError, match="at least 1"):
            reductions(**wrong)


# ------------------------------------------------------------------------------------------------- whole fronts


def nested(error, triangles):
    n = len(error)
    return NestedFront(np.arange(3), np.arange(3, n + 2), np.array(error, float), np.array(triangles), n + 2)


def test_the_rows_of_a_small_front_are_all_that_nothing_dominates():
    front = nested([9, 8, 8, 5, 6, 0], [0, 2, 3, 4, 6, 9])  # no mesh, -, dominated, -, dominated, -
    answers, rows = chosen_rows(front, [100, 9, 8, 4, 3, 1])
    assert rows.tolist() == [1, 3, 5]
    assert answers.tolist() == [5, 5, 3, 3, 1, 1]  # of at most so many triangles; the smallest where all have more


def test_the_rows_of_a_large_front_are_spread_over_it_with_both_ends():
    sizes = np.arange(2, 20_000)
    front = nested(1.0 / sizes, sizes)
    _, rows = chosen_rows(front, [])
    assert 300 < len(rows) <= MOST_ROWS
    assert (rows[0], rows[-1]) == (0, len(front) - 1)
    ratios = front.triangles[rows[1:]] / front.triangles[rows[:-1]]
    assert ratios[60:].max() < 1.035
    assert_array_equal(np.diff(rows[:20]), 1)  # the small ones are all there
    assert_array_equal(chosen_rows(front, [])[1], rows)


def test_what_a_pass_cannot_do_is_said(monkeypatch):
    monkeypatch.setattr(HeightSurface, "ground", lambda _: None)
    for name in PASSES:
        with pytest.raises(ToolUnavailable, match="compiled moves, which a HeightSurface does not have"):
            baseline_front(GRID, name)


# ---------------------------------------------------------------------------------------------- in an experiment

CONFIG = """
problems:
  - {name: Face, model: "face:90", footprint: hull, outside: ignore, pin: hull}
  - {name: Peaks, model: "peaks:9", objectives: [rms_error, triangles], max_triangles: 60}
algorithms: [{name: N1, preset: nsga2_v1, parameters: {pop_size: 12}}]
seeds: [1]
budgets: [{generations: 3}]
baselines: {methods: METHODS, steps: 3}
"""


def experiment(folder: Path, methods: str) -> Path:
    path = folder / "study.yaml"
    path.write_text(CONFIG.replace("METHODS", methods), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """An experiment with every baseline that is installed, and what was said of the others."""
    folder = tmp_path_factory.mktemp("everything")
    config = experiment(folder, "true")
    with pytest.warns(ExperimentWarning, match="skipped: ") as said:  # a tool that is not installed, too
        run_experiment(config, folder / "out")
    return config, folder / "out", [str(line.message) for line in said]


def test_a_configuration_with_all_of_them_runs_and_is_reported(everything):
    _, out, said = everything
    study = Study(out)
    write_tables(study)
    there = {method for _, method in study.classic_runs}
    assert {*PASSES} <= there
    assert any("Face / pydelatin" in line for line in said)
    for line in said:
        assert "\n" not in line
        assert line.startswith("skipped: ")
    missing = {name for name in BASELINES if name not in there}
    assert all(any(f" / {name}" in line for line in said) for name in missing)
    assert study.skipped == said
    rows = baselines_table(study, "3 generations").rows
    asked = {
        (problem, method): int((run.arrays["asked"] > 0).sum()) for (problem, method), run in study.classic_runs.items()
    }
    assert len(rows) == sum(asked.values())  # a whole front at the sizes of the others
    assert len(set(asked.values())) <= 2  # those of the one problem and of the other
    figure = fronts_figure(study, study.cases["Peaks", "3 generations", "nearest"])
    labels = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert {"adaptive thinning", "greedy insertion, worst point", "greedy insertion, worst triangle"} <= labels


def test_stored_scores_are_those_of_the_stored_meshes(everything):
    study = Study(everything[1])
    for (name, method), run in study.classic_runs.items():
        problem = next(problem for problem in study.problems if problem.name == name)
        arrays, measure = run.arrays, problem.rules.measure
        assert (arrays["F"][:, 1] > 0).all()
        if name == "Peaks":
            assert measure == "rms_error"
        for scoring, errors in (("searched", arrays["F"][:, 0]), ("nearest", arrays["error_nearest"])):
            surface = study.surface(problem, scoring)
            for row in range(0, len(errors), 7):
                if BASELINES[method].tool:
                    quality = surface.score(*classic_mesh(run, row)).quality
                else:
                    quality = surface.simplify(np.unpackbits(arrays["kept"][row])[: problem.vertices] == 1).quality
                assert getattr(quality, measure) == pytest.approx(errors[row], rel=1e-12)
                assert quality.triangles == arrays["F"][row, 1]
                assert quality.uncovered == arrays["uncovered"][row]
                if scoring == "searched":
                    assert [getattr(quality, name) for name in OF_MESH] == [arrays[name][row] for name in OF_MESH]


def test_a_whole_front_is_what_its_pass_gives_under_the_problems_rules(everything):
    config, out, _ = everything
    study = Study(out)
    for problem in read_experiment_file(config).problems:
        surface = problem.build().surface
        for method, make in PASSES.items():
            arrays, front = study.classic_runs[problem.name, method].arrays, make(surface)
            kept = np.unpackbits(arrays["kept"], axis=1)[:, : surface.n_vertices].astype(bool)
            assert (kept & surface.pinned == surface.pinned).all()
            sizes = kept.sum(axis=1) - len(front.base)
            assert_array_equal(kept, [front.kept(k) for k in sizes])
            assert_allclose(arrays["F"], front.F[sizes], rtol=1e-9, atol=1e-9)
            n = int((arrays["asked"] > 0).sum())
            for asked, (error, triangles) in zip(arrays["asked"][:n].tolist(), arrays["F"][:n].tolist(), strict=True):
                fitting = front.error[(front.triangles <= asked) & (front.triangles > 0)]
                assert triangles <= asked or not len(fitting)
                assert error == pytest.approx(fitting.min() if len(fitting) else front.error[0], rel=1e-9)
            assert_allclose(non_dominated(arrays["F"][n:]), non_dominated(front.F[front.triangles > 0]), atol=1e-9)


def test_whole_fronts_are_compared_whole_and_within_the_limits_of_the_search(everything):
    study = Study(everything[1])
    faces = next(problem.triangles for problem in study.problems if problem.name == "Face")
    for scoring in ("searched", "nearest"):
        face = study.cases["Face", "3 generations", scoring].runs
        whole = study.classic_runs["Face", "thinning"].arrays["F"]
        assert face["adaptive thinning"][0][:, 1].min() == whole[:, 1].min() < faces / 2
        if "pyfqmr" in face:  # of a tool the paper's series alone where it may abandon vertices for nothing
            assert (face["pyfqmr"][0][:, 1].min() < 0.49 * faces) == (scoring == "nearest")
        for (front,) in (runs.values() for runs in study.cases["Peaks", "3 generations", scoring].runs.values()):
            assert front[:, 1].max() <= 60
    whole = study.classic_runs["Peaks", "thinning"].arrays["F"]
    assert whole[:, 1].max() == 128  # though all of it is stored


def test_a_figure_of_meshes_shows_a_baseline_of_either_kind(tmp_path):
    out = tmp_path / "out"
    run_experiment(experiment(tmp_path, "insertion"), out)
    study = Study(out)
    figure = meshes_figure(study, study.cases["Peaks", "3 generations", "nearest"])
    titles = [ax.get_title() for ax in figure.axes if ax.get_title()]
    assert [title.partition("\n")[0] for title in titles] == ["original", "N1", "greedy insertion, worst point"]


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_what_was_interrupted_goes_on_in_any_number_of_processes(tmp_path, jobs):
    out = tmp_path / "out"
    config = experiment(tmp_path, "[thinning, insertion]")
    run_experiment(config, out)
    runs = Study(out).classic_runs
    lost = [runs["Face", "thinning"], runs["Peaks", "insertion_by_point"]]
    for run in lost:
        run.path.unlink()
    told = []
    done = run_experiment(config, out, jobs=jobs, progress=lambda done, total, text: told.append((done / total, text)))
    assert (done.finished, done.reused) == (2, 6)
    assert told[-1][0] == pytest.approx(1)
    assert {text for _, text in told} >= {"Face / thinning", "Peaks / insertion_by_point"}
    for run in lost:
        again = Study(out).classic_runs[run.record["problem"], run.record["algorithm"]]
        assert again.record["arrays_sha256"] == run.record["arrays_sha256"]
