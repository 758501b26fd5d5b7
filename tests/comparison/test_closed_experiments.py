"""Experiments with closed surfaces: stored and read back, scored by true distance, reported."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scans import as_source, parts
from sketching import sketch_into
from true_distance import distances

from meshsimp_pymoo.comparison import report
from meshsimp_pymoo.comparison.baselines import BASELINES, baseline_meshes
from meshsimp_pymoo.comparison.config import ConfigError, read_experiment_file
from meshsimp_pymoo.comparison.figures import meshes_figure
from meshsimp_pymoo.comparison.report import write_report
from meshsimp_pymoo.comparison.runner import run_experiment
from meshsimp_pymoo.comparison.store import classic_mesh, read_model, write_model
from meshsimp_pymoo.comparison.study import Study
from meshsimp_pymoo.errors import ExperimentWarning, ResultError, ToolUnavailable
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.report import figures
from meshsimp_pymoo.surface.closed import embedding
from meshsimp_pymoo.surface.closed.model import ClosedModel, closed_model
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.measures import ERROR

BLOB = ClosedSurface(open_model("blob:250"))
PARTS = ClosedSurface(closed_model(as_source(parts(), "parts")))
TOOLS = [name for name, known in BASELINES.items() if known.tool and not known.at_borders and name != "pydelatin"]

CONFIG = """
problem: {surface: closed}
problems: [{name: Blob, model: "blob:120", weights: area}, {name: Corners, model: "icosahedron:3"}]
algorithms: [{name: N1, preset: nsga2_v1, parameters: {pop_size: 12}}]
seeds: [1]
budgets: [{generations: 3}]
baselines: {methods: [thinning, meshlab, meshlab_ends, fast_simplification, pyfqmr, pydelatin], steps: 3}
"""


def write(folder, text=CONFIG):
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return path


# ------------------------------------------------------------------------------------------------------- the model


@pytest.mark.parametrize(
    ("surface", "weights"), [(BLOB, None), (BLOB, "area"), (PARTS, "area")], ids=["alike", "by area", "holes and parts"]
)
def test_a_stored_model_is_the_same_with_its_images(tmp_path, surface, weights):
    (tmp_path / "models").mkdir()
    own = surface.model if weights is None else surface.model.with_weights(weights)
    where = write_model(tmp_path, own)
    again = read_model(tmp_path, where, own.hash)
    assert isinstance(again, ClosedModel)
    names = ("points", "faces", "xy", "poles", "source_index", "file_points", "rotation", "pivot", "weights", "copies")
    for name in (*names, "part", "rim"):
        ours, theirs = getattr(own, name), getattr(again, name)
        assert ours is theirs is None or (ours.dtype == theirs.dtype and np.array_equal(ours, theirs)), name
    kept = np.random.default_rng(1).random((3, own.n_vertices)) < 0.3
    kept |= surface.pinned
    assert_array_equal(ClosedSurface(again).evaluate(kept), ClosedSurface(own).evaluate(kept))
    assert write_model(tmp_path, own) == where
    with pytest.raises(ResultError, match="is not the model that was searched"):
        read_model(tmp_path, where, "0" * 64)


def test_an_experiment_goes_on_with_the_images_that_it_began_with(tmp_path, monkeypatch):
    """Runs of other versions of libraries would have another vector order than those that are there."""
    begun = """
        problems: [{name: Blob, model: "blob:120"}]
        algorithms: [{name: N1, preset: nsga2_v1, parameters: {pop_size: 12}}]
        seeds: [1]
        budgets: [{generations: 3}]
    """
    with monkeypatch.context() as patch:
        patch.setattr(embedding, "_trunk_face", lambda *_: 7)
        run_experiment(write(tmp_path, begun), tmp_path / "out")
    run_experiment(write(tmp_path, begun.replace("[1]", "[1, 2]")), tmp_path / "out")
    study = Study(tmp_path / "out")
    surface = study.surface(study.problems[0])
    assert len(study.all_runs) == 2
    for run in study.all_runs:
        kept = np.unpackbits(run.arrays["kept"], axis=1)[:, : surface.n_vertices].astype(bool)
        assert_array_equal(surface.evaluate(kept)[:, ERROR], run.arrays["F"][:, 0])


# ------------------------------------------------------------------------------------------------------- the tools


@pytest.mark.parametrize("name", TOOLS)
def test_a_tools_meshes_are_scored_by_true_distance(name):
    try:
        found = baseline_meshes(BLOB, name, [300, 100])
    except ToolUnavailable as reason:
        pytest.skip(str(reason))
    places = {tuple(point) for point in BLOB.model.file_points.tolist()}
    for mesh in found:
        expected = distances(BLOB.model.file_points, mesh.vertices, mesh.faces)
        assert mesh.quality.error == pytest.approx(expected.sum(), rel=1e-9)
        assert mesh.quality.max_error == pytest.approx(expected.max(), rel=1e-9)
        assert mesh.quality.uncovered == 0
        assert BASELINES[name].own_vertices == ({tuple(point) for point in mesh.vertices.tolist()} <= places)
        if name != "vertex_clustering":
            assert 0.95 * mesh.asked <= mesh.triangles <= mesh.asked


@pytest.mark.parametrize("name", [name for name, known in BASELINES.items() if known.at_borders])
def test_what_keeps_a_border_is_compared_on_what_has_holes(name):
    try:
        (mesh,) = baseline_meshes(PARTS, name, [200])
    except ToolUnavailable as reason:
        if "no border" in str(reason):
            raise
        pytest.skip(str(reason))
    assert mesh.triangles <= 200
    assert np.isfinite(mesh.quality.error)


@pytest.mark.parametrize("name", [name for name, known in BASELINES.items() if known.at_borders])
def test_what_keeps_a_border_is_left_out_with_a_word(name):
    with pytest.raises(ToolUnavailable, match="a surface without holes has no border that could be kept"):
        baseline_meshes(BLOB, name, [100])


def test_pydelatin_is_left_out_with_a_word():
    pytest.importorskip("pydelatin")
    with pytest.raises(ToolUnavailable, match="pydelatin needs heights on a full regular grid"):
        baseline_meshes(BLOB, "pydelatin", [100])


# -------------------------------------------------------------------------------------------------- the experiment


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """An experiment with closed surfaces, and what was said of the tools that were left out."""
    folder = tmp_path_factory.mktemp("closed")
    with pytest.warns(ExperimentWarning, match="skipped: ") as said:
        run_experiment(write(folder), folder / "out")
    return folder, [str(line.message) for line in said]


def test_tools_of_height_surfaces_are_left_out_with_a_line(done):
    _, said = done
    (borders,) = (line for line in said if "no border" in line)
    for name in ("quadric_collapse_boundary", "fast_simplification_border", "pyfqmr_border"):
        assert f"Blob / {name}, " in borders
        assert f"Corners / {name}" in borders
    assert any("Blob / pydelatin, Corners / pydelatin: pydelatin " in line for line in said)
    assert all(line.startswith("skipped: ") and "\n" not in line for line in said)


def test_nothing_is_done_again(done):
    folder, _ = done
    with pytest.warns(ExperimentWarning, match="skipped: "):
        again = run_experiment(folder / "study.yaml", folder / "out")
    assert again.finished == 0
    assert again.reused > 2


def test_stored_scores_are_those_of_the_stored_meshes_and_there_is_one_scoring(done):
    study = Study(done[0] / "out")
    assert study.scorings == ["nearest"]
    blob, corners = study.problems
    assert blob.rules.footprint is blob.rules.outside is None
    surface = study.surface(blob)
    assert isinstance(surface, ClosedSurface)
    assert surface.total_weight == pytest.approx(120)
    weights = surface.model.weights
    for (name, method), run in study.classic_runs.items():
        if name == "Blob" and BASELINES[method].tool:
            mesh = classic_mesh(run, 0)
            expected = (weights * distances(surface.model.file_points, *mesh)).sum()
            assert run.arrays["F"][0, 0] == pytest.approx(expected, rel=1e-9)
            assert_array_equal(run.arrays["error_nearest"], run.arrays["F"][:, 0])
    for problem, source in ((blob, "blob:120"), (corners, "icosahedron:3")):
        fresh = MeshProblem(source, weights=problem.rules.weights)
        for run in (run for run in study.all_runs if run.record["problem"] == problem.name):
            kept = np.unpackbits(run.arrays["kept"], axis=1)[:, : problem.vertices].astype(bool)
            assert_allclose(fresh.evaluate(kept), run.arrays["F"], rtol=1e-12)
            assert_array_equal(run.arrays["F"][:, 1], 2 * kept.sum(axis=1) - 4)
            assert_array_equal(run.arrays["error_nearest"], run.arrays["F"][:, 0])


def test_thinning_finds_the_corners(done):
    study = Study(done[0] / "out")
    F = study.classic_runs["Corners", "thinning"].arrays["F"]
    assert F[F[:, 1] <= 26, 0].min() < 1e-12  # the corners and the pole


def test_the_report_and_its_pictures_say_nothing_of_what_is_uncovered(done, monkeypatch):
    monkeypatch.setattr(figures, "BODY_PIXELS", 60)
    monkeypatch.setattr(report, "_save", lambda draw, path: sketch_into(draw(), path))
    out = done[0] / "out"
    study = write_report(out)
    said = (out / "findings.md").read_text(encoding="utf-8")
    assert "On Blob each vertex counts by a third of the area of the triangles around it." in said
    assert (out / "report.html").is_file()
    figure = meshes_figure(study, study.cases["Blob", "3 generations", "nearest"])
    titles = [axes.get_title() for axes in figure.axes]
    assert any(title.startswith("N1\n") for title in titles)
    assert not any("uncovered" in title for title in titles)
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert any("seen from the front\nand from the back" in text for text in texts)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("{surface: closed}", "{surface: closed, footprint: hull}", "footprint='hull'.*describes height surfaces"),
        ("{surface: closed}", "{surface: closed, up: z}", "describes height surfaces"),
        ('"icosahedron:3"', '"roof:5"', "is a grid, .* leave --surface closed"),
        ("{surface: closed}", "{surface: height}", "faces all ways alike"),
        ("{surface: closed}", "{surface: round}", "surface: 'round'"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path, old, new, says):
    assert old in CONFIG
    with pytest.raises(ConfigError, match=says) as caught:
        read_experiment_file(write(tmp_path, CONFIG.replace(old, new)))
    assert "\n" not in str(caught.value)
