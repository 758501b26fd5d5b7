"""Finished runs are never lost, never done twice, and never depend on how they came about."""

from __future__ import annotations

import calendar
import json
import multiprocessing
import os
import random
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drawing import overlaps
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.population import Population
from pymoo.optimize import minimize
from samples import freed
from sketching import sketch_into

from meshsimp_pymoo.cli import main, terminal
from meshsimp_pymoo.comparison import analysis, baselines, report, runner
from meshsimp_pymoo.comparison.baselines import reductions
from meshsimp_pymoo.comparison.config import read_experiment_file
from meshsimp_pymoo.comparison.figures import meshes_figure
from meshsimp_pymoo.comparison.findings_page import reservations
from meshsimp_pymoo.comparison.meshlab import meshlab_available
from meshsimp_pymoo.comparison.report import write_report, write_tables
from meshsimp_pymoo.comparison.runner import perform, plan, run_experiment
from meshsimp_pymoo.comparison.store import FORMAT, RunStore, read_run
from meshsimp_pymoo.comparison.study import Study
from meshsimp_pymoo.comparison.trace import Trace
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ExperimentWarning, ResultError, ToolUnavailable
from meshsimp_pymoo.files import locked
from meshsimp_pymoo.formats.table import write_mesh
from meshsimp_pymoo.indicators import non_dominated
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.search.budgets import Moves
from meshsimp_pymoo.search.memetic import memetic
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.workers import DaskEngine

CONFIGS = Path(__file__).resolve().parents[2] / "configs"

CONFIG = """
title: tiny
problem: {footprint: hull, outside: ignore}
problems: [{name: Face, model: "face:90"}, {name: Peaks, model: "peaks:9"}]
algorithms:
  - {name: N1, preset: nsga2_v1, parameters: {pop_size: 12}}
  - {name: N2, preset: nsga2_v2, parameters: {pop_size: 12}}
  - {name: G1, preset: weighted_ga_v1, parameters: {pop_size: 12}, merged_over: {w: [0.0, 0.5, 1.0]}}
seeds: [1, 2, 3]
budgets: [{generations: 6}, {evaluations: 60}]
"""
RUNS = 2 * (1 + 1 + 3) * 3 * 2


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(CONFIG, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def reference(tmp_path_factory):
    """An experiment that nothing disturbed."""
    folder = tmp_path_factory.mktemp("reference")
    (folder / "tiny.yaml").write_text(CONFIG, encoding="utf-8")
    run_experiment(folder / "tiny.yaml", folder / "out")
    write_tables(Study(folder / "out"))
    return folder / "out"


@pytest.fixture
def stored(reference, tmp_path):
    """A copy of it to spoil."""
    import shutil

    shutil.copytree(reference, tmp_path / "out")
    return tmp_path / "out"


def results(out: Path) -> dict[str, bytes]:
    """Return everything that must be the same bytes for the same runs."""
    paths = [path for path in sorted(out.rglob("*")) if path.is_file() and path.suffix != ".png"]
    own = [path for path in paths if path.relative_to(out).parts[0] in ("tables", "findings.md")]
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in own}


def record_of(out: Path, **wanted: object) -> Path:
    for path in sorted((out / "runs").glob("*.json")):
        record = json.loads(path.read_text())
        if all(record[key] == value for key, value in wanted.items()):
            return path
    raise AssertionError(f"no run with {wanted}")


def test_free_meshes_are_stored_beside_what_is_compared_and_that_is_said(tmp_path, monkeypatch):
    """F is what the problem says of X, with or without free meshes beside, and so is all that is made of it."""
    config = tmp_path / "one.yaml"
    config.write_text(
        "problems: [{name: Face, model: 'face:90'}]\n"
        "algorithms: [{name: N1, preset: nsga2_v1, parameters: {pop_size: 12}}]\n"
        "seeds: [1, 2]\nbudgets: [{generations: 4}]\n",
        encoding="utf-8",
    )
    run_experiment(config, tmp_path / "without")
    set_optimum = NSGA2._set_optimum

    def with_free_meshes(self):
        set_optimum(self)
        for one in self.opt[: len(self.opt) // 2] if self.n_iter == 4 else ():
            one.set("free", freed(self.problem.surface, one.X))

    monkeypatch.setattr(NSGA2, "_set_optimum", with_free_meshes)
    run_experiment(config, tmp_path / "with")
    studies = [Study(tmp_path / name) for name in ("without", "with")]
    n_meshes = 0
    for plain, run in zip(*(study.all_runs for study in studies), strict=True):
        assert not [name for name in plain.arrays if name.startswith("free")]
        for name, values in plain.arrays.items():
            np.testing.assert_array_equal(run.arrays[name], values)
        surface, F, start = (
            studies[1].surface(studies[1].problems[0]),
            run.arrays["free_F"],
            run.arrays["free_face_start"],
        )
        assert len(F) == len(start) - 1 > 0
        for (error, triangles), a, b in zip(F, start[:-1], start[1:], strict=True):
            quality = surface.of_faces(run.arrays["free_faces"][a:b]).quality
            assert (quality.error, quality.triangles) == (pytest.approx(error), triangles)
            assert not ((run.arrays["F"][:, 1] <= triangles) & (run.arrays["F"][:, 0] <= error)).any()  # none beats it
        n_meshes += len(F)
    said = f"{n_meshes} free meshes of N1 are stored beside the runs and not compared: all numbers here are those of"
    assert [any(said in line for line in reservations(study)) for study in studies] == [False, True]


def test_every_run_is_stored_and_none_is_done_again(config, stored, monkeypatch):
    assert len(list((stored / "runs").glob("*.json"))) == RUNS

    def never(*_):
        raise AssertionError("a finished run was done again")

    monkeypatch.setattr(runner, "perform", never)
    done = run_experiment(config, stored)
    assert (done.finished, done.reused) == (0, RUNS)


def test_a_stored_run_is_what_pymoo_finds_in_one_go(reference, config):
    experiment = read_experiment_file(config)
    (algorithm,) = [a for a in experiment.algorithms if a.name == "N1"]
    problem = MeshProblem("face:90", footprint="hull", outside="ignore")
    result = minimize(problem, algorithm.build(), ("n_gen", 6), seed=2)
    run = read_run(record_of(reference, problem="Face", algorithm="N1", seed=2, budget="6 generations"))
    np.testing.assert_array_equal(run.arrays["F"], non_dominated(result.F))
    assert run.record["evaluations"] == result.algorithm.evaluator.n_eval == 72
    assert set(run.record["environment"]) == {"platform", "processor", "cores", "jobs"}
    assert (run.record["environment"]["cores"], run.record["environment"]["jobs"]) == (os.cpu_count(), 1)
    assert 0 < run.record["cpu_seconds"]
    begun = calendar.timegm(time.strptime(run.record["begun"], "%Y-%m-%dT%H:%M:%SZ"))
    assert run.path.stat().st_mtime - 60 < begun <= run.path.stat().st_mtime
    kept = np.unpackbits(run.arrays["kept"], axis=1)[:, : problem.n_var].astype(bool)
    for row, q in enumerate(map(problem.quality, kept)):
        assert (q.error, q.triangles) == tuple(run.arrays["F"][row])
        assert q.max_error == run.arrays["max_error"][row]
        assert q.uncovered == run.arrays["uncovered"][row]
        assert q.surface_error == run.arrays["surface_error"][row] > 0
    charged = MeshProblem(problem.model, footprint="hull", outside="nearest")
    np.testing.assert_array_equal(run.arrays["error_nearest"], [charged.quality(row).error for row in kept])


def trace_of(run) -> list[np.ndarray]:
    """The fronts of a run's trace."""
    start = run.arrays["trace_start"]
    assert len(run.arrays["trace_F"]) == start[-1]
    return np.split(run.arrays["trace_F"], start[1:-1])


def test_a_run_holds_the_fronts_by_which_it_converged(reference, config):
    (algorithm,) = [a for a in read_experiment_file(config).algorithms if a.name == "N1"]
    fronts = []

    def note(search):
        fronts.append(non_dominated(search.opt.get("F")))

    problem = MeshProblem("face:90", footprint="hull", outside="ignore")
    minimize(problem, algorithm.build(), ("n_gen", 6), seed=2, callback=note)
    assert len({front.tobytes() for front in fronts}) == 6
    for budget, count in (("6 generations", 6), ("60 evaluations", 5)):
        run = read_run(record_of(reference, problem="Face", algorithm="N1", seed=2, budget=budget))
        assert run.arrays["trace_generations"].tolist() == list(range(1, count + 1))
        assert run.arrays["trace_evaluations"].tolist() == [12 * k for k in range(1, count + 1)]
        traced = trace_of(run)
        assert len(traced) == count
        for front, expected in zip(traced, fronts, strict=False):
            np.testing.assert_array_equal(front, expected)
        np.testing.assert_array_equal(traced[-1], run.arrays["F"])
        seconds = run.record["trace_seconds"]
        assert len(seconds) == count
        assert seconds == sorted(seconds)
        assert seconds[-1] == run.record["seconds"]


def test_a_trace_keeps_generations_that_are_spaced_geometrically_and_of_them_the_front_of_feasible_meshes():
    F = np.array([[3.0, 4], [np.inf, 0], [0.0, 2], [1.0, 9], [2.0, 9], [3.0, 4]])
    opt = Population.new("F", F)
    for one, feasible in zip(opt, [True, True, False, True, True, True], strict=True):
        one.CV = np.array([0.0 if feasible else 1.0])
        one.evaluated |= {"CV"}
    trace, search = Trace(), SimpleNamespace(opt=opt, evaluator=SimpleNamespace(n_eval=7))
    for generation in range(1, 51):
        trace.keep(search, generation, 0.1 * generation)
    search.opt = None
    run = Trace.from_plain(json.loads(json.dumps(trace.plain))).until(search, 50, 5.0)
    expected = [1, 2, 3, 4, 5, 7, 9, 12, 15, 19, 24, 30, 38, 48, 50]
    assert run.arrays["trace_generations"].tolist() == expected
    assert run.seconds == pytest.approx([0.1 * generation for generation in expected])
    assert run.arrays["trace_start"].tolist() == [*range(0, 30, 2), 28]
    np.testing.assert_array_equal(run.arrays["trace_F"], 14 * [[3.0, 4], [1.0, 9]])


def test_a_search_that_goes_on_from_its_checkpoint_has_the_trace_from_before(config, tmp_path, reference):
    task = next(t for t in plan(read_experiment_file(config)) if t.label == "Face / N1 / seed 2")
    problem = MeshProblem("face:90", footprint="hull", outside="ignore")
    short = [budget.kind for budget in task.budgets].index("evaluations")  # 60 of them come before 6 generations
    begun = perform(task, problem, checkpoint=tmp_path / "state.npz", interval=0.0)
    assert next(begun)[0] == short
    begun.close()  # as if killed: after the checkpoint of some generation
    assert (tmp_path / "state.npz").exists()
    rest = task.without([task.keys[short]])
    ((_, arrays, facts),) = perform(rest, problem, checkpoint=tmp_path / "state.npz")
    run = read_run(record_of(reference, problem="Face", algorithm="N1", seed=2, budget="6 generations"))
    assert set(arrays) == set(run.arrays)
    for name, values in arrays.items():
        np.testing.assert_array_equal(values, run.arrays[name])
    assert len(facts["trace_seconds"]) == 6


def test_a_budget_ends_with_the_generation_that_reaches_it(reference):
    run = read_run(record_of(reference, problem="Peaks", algorithm="N2", seed=1, budget="60 evaluations"))
    assert run.record["evaluations"] >= 60
    assert run.record["generations"] < 6
    assert (
        read_run(record_of(reference, problem="Peaks", algorithm="N1", budget="60 evaluations")).record["evaluations"]
        == 60
    )


def test_runs_are_the_same_however_budgets_and_processes_are_shared_out(config, reference, tmp_path):
    alone = CONFIG.replace("{generations: 6}, ", "").replace("seeds: [1, 2, 3]", "seeds: [2]")
    config.write_text(alone, encoding="utf-8")
    run_experiment(config, tmp_path / "out", jobs=2)
    made = sorted((tmp_path / "out" / "runs").glob("*.npz"))
    assert len(made) == RUNS // 6
    for path in made:
        assert path.read_bytes() == (reference / "runs" / path.name).read_bytes()


def test_an_algorithm_by_import_path_has_a_search_for_each_budget(config):
    spelled = CONFIG.replace("preset: nsga2_v1", "class: pymoo.algorithms.moo.spea2.SPEA2")
    config.write_text(spelled, encoding="utf-8")
    tasks = plan(read_experiment_file(config))
    assert {len(task.budgets) for task in tasks if task.algorithm.name == "N1"} == {1}
    assert {len(task.budgets) for task in tasks if task.algorithm.name == "N2"} == {2}
    keys = [key for task in tasks for key in task.keys]
    assert len(set(keys)) == len(keys) == RUNS


def test_an_algorithm_with_a_memory_in_its_defaults_repeats(config, tmp_path):
    # pymoo's SPEA2 keeps the bounds of earlier runs in an object that all instances share
    text = CONFIG.replace("preset: nsga2_v1", "class: pymoo.algorithms.moo.spea2.SPEA2").replace(
        "seeds: [1, 2, 3]", "seeds: [2]"
    )
    config.write_text(text, encoding="utf-8")
    run_experiment(config, tmp_path / "one")
    config.write_text(text.replace("seeds: [2]", "seeds: [1, 2]"), encoding="utf-8")
    run_experiment(config, tmp_path / "two")
    for path in (tmp_path / "one" / "runs").glob("*.npz"):
        assert path.read_bytes() == (tmp_path / "two" / "runs" / path.name).read_bytes()


def test_a_budget_in_seconds_ends(config, tmp_path):
    config.write_text(
        CONFIG.replace("{evaluations: 60}", "{seconds: 0.05}").replace("[1, 2, 3]", "[1]"), encoding="utf-8"
    )
    run_experiment(config, tmp_path / "out")
    run = read_run(record_of(tmp_path / "out", algorithm="N1", budget="0.05 seconds"))
    assert run.record["seconds"] >= 0.05
    assert len(run.arrays["F"])


def test_budgets_that_do_not_measure_an_algorithm_are_left_out_with_a_line(config, tmp_path):
    text = CONFIG.replace("seeds: [1, 2, 3]", "seeds: [1, 2]").replace(
        "{generations: 6}", "{moves: 30000}, {moves: 1000, name: Few}"
    )
    config.write_text(
        text.replace("  - {name: N2, preset: nsga2_v2,", "  - {name: N2, preset: memetic,"), encoding="utf-8"
    )
    kinds = "generations, evaluations or seconds"
    expected = (
        f"skipped: N1 under 30000 moves and Few: its work is measured by {kinds}",
        "skipped: N2 under 60 evaluations: its work is measured by moves or seconds",
        f"skipped: G1 under 30000 moves and Few: its work is measured by {kinds}",
    )
    with pytest.warns(ExperimentWarning, match="skipped: ") as caught:
        done = run_experiment(config, tmp_path / "out")
    assert done.skipped == expected == tuple(str(warning.message) for warning in caught)
    assert (done.finished, done.reused) == (2 * 2 * (1 + 2 + 3), 0)
    problem = MeshProblem("face:90", footprint="hull", outside="ignore")
    result = minimize(problem, memetic(12), Moves(30_000), seed=2)
    run = read_run(record_of(tmp_path / "out", problem="Face", algorithm="N2", seed=2, budget="30000 moves"))
    np.testing.assert_array_equal(run.arrays["F"], non_dominated(result.F))
    assert run.record["moves"] == 30_000
    assert run.arrays["trace_evaluations"][-1] == run.record["evaluations"] == result.algorithm.evaluator.n_eval
    assert read_run(record_of(tmp_path / "out", algorithm="N1")).record["moves"] is None
    write_tables(study := Study(tmp_path / "out"))
    assert set(study.cases["Face", "30000 moves", "searched"].runs) == {"N2"}
    assert set(study.cases["Face", "60 evaluations", "searched"].runs) == {"N1", "G1"}
    assert not study.missing
    said = (tmp_path / "out" / "findings.md").read_text(encoding="utf-8")
    assert all(line.removeprefix("skipped: ") in said for line in expected)


def test_a_shared_budget_is_divided_among_the_runs_that_make_one_front(config, tmp_path):
    spelled = "{evaluations: 24, name: each}, {evaluations: 74, shared: true}, {generations: 2, shared: true}"
    config.write_text(
        CONFIG.replace("{generations: 6}, {evaluations: 60}", spelled).replace("[1, 2, 3]", "[1]"), encoding="utf-8"
    )
    out = tmp_path / "out"
    tasks = plan(read_experiment_file(config))
    amounts = {task.algorithm.name: [budget.amount for budget in task.budgets] for task in tasks}
    assert amounts == {"N1": [24, 74, 2], "N2": [24, 74, 2], "G1": [24, 24, 1]}
    keys = {key for task in tasks for key in task.keys}
    assert len(keys) == 2 * (3 + 3 + 3 * 2)  # two of the budgets are one run of G1
    assert run_experiment(config, out).finished == len(keys) == len(list((out / "runs").glob("*.json")))
    assert run_experiment(config, out).reused == len(keys)
    study = Study(out)
    assert study.budgets == ["each", "74 evaluations, shared", "2 generations, shared"]
    case = study.cases["Face", "74 evaluations, shared", "searched"]
    assert case.evaluations("N1").tolist() == [84]  # the generation of 12 that reaches 74
    assert case.evaluations("G1").tolist() == [3 * 24]
    content = json.loads((out / "experiment.json").read_text())["budgets"]
    assert [budget.get("shared", False) for budget in content] == [False, True, True]


def test_seconds_are_shared_as_they_are(config):
    config.write_text(
        CONFIG.replace("{generations: 6}, {evaluations: 60}", "{seconds: 0.75, shared: true}"), encoding="utf-8"
    )
    tasks = plan(read_experiment_file(config))
    assert {(task.algorithm.name, task.budgets[0].amount) for task in tasks} == {
        ("N1", 0.75),
        ("N2", 0.75),
        ("G1", 0.25),
    }
    assert {task.budgets[0].name for task in tasks} == {"0.75 seconds, shared"}


def test_a_changed_configuration_does_what_is_new_and_names_what_is_stale(config, stored):
    first = read_run(record_of(stored, algorithm="N1", problem="Face"))
    config.write_text(
        CONFIG.replace("seeds: [1, 2, 3]", "seeds: [2, 3, 4]").replace("name: N1", "name: Other"), encoding="utf-8"
    )
    with pytest.warns(ExperimentWarning, match=r"not asked for .* not used"):
        done = run_experiment(config, stored)
    assert done.finished == RUNS // 3  # the new seed; a new name is no new run
    assert done.reused == 2 * RUNS // 3
    assert first.path.exists()
    write_tables(study := Study(stored))
    assert study.methods == ["Other", "N2", "G1"]
    for case in study.cases.values():
        assert set(case.runs["Other"]) == {2, 3, 4}


def test_another_setting_is_another_run(config, stored):
    config.write_text(CONFIG.replace("N1, preset: nsga2_v1, parameters: {pop_size: 12}",
        "N1, preset: nsga2_v1, parameters: {pop_size: 12}, operators: {mutation: {name: neighbour_shift, along: mesh}}"
    ), encoding="utf-8")  # fmt: skip
    with pytest.warns(ExperimentWarning, match=r"and 11 more: not asked for"):
        assert run_experiment(config, stored).finished == 12


def spoil_truncated(path: Path) -> Path:
    npz = path.with_suffix(".npz")
    npz.write_bytes(npz.read_bytes()[:-20])
    return npz


def spoil_record(path: Path) -> Path:
    path.write_text(path.read_text().replace('"seed": 2', '"seed": 3'))
    return path


def spoil_number(path: Path) -> Path:
    content = json.loads(path.read_text())
    content["evaluations"] += 1
    path.write_text(json.dumps(content))
    return path


def spoil_arrays(path: Path) -> Path:
    npz = path.with_suffix(".npz")
    content = bytearray(npz.read_bytes())
    content[len(content) // 2] ^= 1
    npz.write_bytes(bytes(content))
    return npz


def spoil_rewritten(path: Path) -> Path:
    """Change a number in a file that is whole otherwise."""
    npz = path.with_suffix(".npz")
    arrays = dict(np.load(npz))
    arrays["F"][0, 0] /= 2
    np.savez_compressed(npz, **arrays)
    return npz


def spoil_missing(path: Path) -> Path:
    npz = path.with_suffix(".npz")
    npz.unlink()
    return npz


def spoil_empty(path: Path) -> Path:
    path.write_text("")
    return path


def spoil_swapped(path: Path) -> Path:
    """Put another whole run's files in place of this one's."""
    other = next(p for p in sorted(path.parent.glob("*.json")) if p != path)
    for suffix in (".json", ".npz"):
        path.with_suffix(suffix).write_bytes(other.with_suffix(suffix).read_bytes())
    return path


SPOILS = (
    spoil_truncated, spoil_missing, spoil_swapped, spoil_record, spoil_number, spoil_arrays, spoil_rewritten,
    spoil_empty,
)  # fmt: skip


@pytest.mark.parametrize(
    "spoils",
    [
        {("N2", 3): spoil_swapped, ("N2", 2): spoil_truncated, ("N1", 2): spoil_missing},
        *(pytest.param({("N2", 2): one}, marks=pytest.mark.slow) for one in SPOILS),
    ],
)
def test_a_damaged_result_is_named_left_out_and_done_again(spoils, config, stored, reference):
    records = [
        record_of(stored, problem="Face", algorithm=name, seed=seed, budget="6 generations") for name, seed in spoils
    ]
    damaged = [spoil(record).name for spoil, record in zip(spoils.values(), records, strict=True)]
    with pytest.warns(ExperimentWarning, match="left out of the report") as caught:
        write_tables(study := Study(stored))
    first = min(f"Face / {method} / seed {seed}" for method, seed in spoils)
    more = f" and {len(spoils) - 1} more" if len(spoils) > 1 else ""
    assert any(f"missing: {first} / 6 generations{more}" in str(w.message) for w in caught)
    for (method, seed), file in zip(spoils, damaged, strict=True):
        assert any(file in line for line in study.damaged)
        assert seed not in study.cases["Face", "6 generations", "searched"].runs[method]
        assert seed in study.cases["Face", "60 evaluations", "searched"].runs[method]
    with pytest.warns(ExperimentWarning, match="computed again") as caught:
        done = run_experiment(config, stored)
    for file in damaged:
        assert any(re.search(f"{re.escape(file)}.*computed again", str(w.message)) for w in caught)
    assert done.finished == len(spoils)
    write_tables(Study(stored))
    assert results(stored) == results(reference)


def test_a_merged_front_that_lacks_a_run_is_left_out(stored):
    path = record_of(stored, problem="Face", algorithm="G1", seed=1, budget="6 generations")
    path.unlink()
    with pytest.warns(ExperimentWarning, match="missing: Face / G1"):
        write_tables(study := Study(stored))
    assert set(study.cases["Face", "6 generations", "searched"].runs["G1"]) == {2, 3}
    assert set(study.cases["Face", "6 generations", "searched"].runs["N1"]) == {1, 2, 3}


def test_runs_of_several_weights_make_one_front(reference):
    case = Study(reference).cases["Face", "6 generations", "searched"]
    for seed in (1, 2, 3):
        single = [run.arrays["F"] for run in case.sources["G1"][seed]]
        assert [len(F) for F in single] == [1, 1, 1]
        np.testing.assert_array_equal(case.runs["G1"][seed], non_dominated(np.vstack(single)))


def test_ctrl_c_leaves_the_finished_runs(config, tmp_path, reference):
    out = tmp_path / "out"

    def interrupt(done: float, total: float, text: str) -> None:
        if "Peaks" in text:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_experiment(config, out, progress=interrupt)
    finished = len(list((out / "runs").glob("*.json")))
    assert RUNS // 2 <= finished < RUNS
    assert run_experiment(config, out).reused == finished
    write_tables(Study(out))
    assert results(out) == results(reference)


# --------------------------------------------------------------------------------------------------- killed


def in_a_child(config: str, out: str, begun: str) -> None:
    """Do the whole experiment; what is killed, after it has said that it begins.

    Nothing is damaged by being killed, so that nothing has to be named.
    """
    warnings.simplefilter("error", ExperimentWarning)
    experiment = read_experiment_file(config)
    Path(begun).touch()
    run_experiment(experiment, out)
    write_tables(Study(out))


@pytest.mark.skipif("forkserver" not in multiprocessing.get_all_start_methods(), reason="needs a fork server")
@pytest.mark.slow
def test_killed_at_random_moments_and_resumed_the_tables_are_the_same_bytes(config, tmp_path, reference):
    most = 60
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["meshsimp_pymoo.comparison.runner", "meshsimp_pymoo.comparison.report"])
    rng = random.Random(5)
    wanted = results(reference)
    kills, rounds, moments = 0, 0, set()
    begun = tmp_path / "begun"
    while kills < most:
        rounds += 1
        out = tmp_path / f"out{rounds}"
        longest = 0.6
        while True:
            begun.unlink(missing_ok=True)
            child = context.Process(target=in_a_child, args=(str(config), str(out), str(begun)))
            child.start()
            while not begun.exists() and child.is_alive():
                time.sleep(0.002)
            child.join(rng.uniform(0.0, longest))
            longest += 0.1  # on a busy machine the end takes longer than this
            if child.exitcode is None:
                os.kill(child.pid, signal.SIGKILL)
                child.join()
            if child.exitcode == 0:
                break
            assert child.exitcode == -signal.SIGKILL
            kills += 1
            moments.add(len(list((out / "runs").glob("*.json"))))
        assert results(out) == wanted
        assert len(list((out / "runs").glob("*.json"))) == RUNS
        assert not list(out.glob("**/.*.partial"))
    assert len(moments) > most // 6  # not always in the same place


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is a POSIX signal")
@pytest.mark.slow
def test_killed_with_its_processes_at_work_it_leaves_none_behind_and_goes_on(config, tmp_path, reference):
    out = tmp_path / "out"
    call = [sys.executable, "-m", "meshsimp_pymoo", "run", str(config), "-o", str(out), "--jobs", "2", "--quiet"]
    config.write_text(CONFIG.replace("seeds: [1, 2, 3]", f"seeds: {list(range(1, 20))}"), encoding="utf-8")
    parent = subprocess.Popen(call, start_new_session=True)
    deadline = time.monotonic() + 60
    while len(list((out / "runs").glob("*.json"))) < 8:
        assert parent.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    parent.kill()
    parent.wait()
    while True:  # the processes of its session
        members = subprocess.run(["ps", "-o", "pid=", "-s", str(parent.pid)], capture_output=True, text=True)
        if not members.stdout.split():
            break
        assert time.monotonic() < deadline, "its processes live on"
        time.sleep(0.1)
    config.write_text(CONFIG, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentWarning)  # runs of the seeds that are not asked for any more
        assert run_experiment(config, out).reused > 0
    write_tables(Study(out))
    assert results(out) == results(reference)


@pytest.mark.slow
def test_a_dask_cluster_leaves_the_same_tables(config, tmp_path, reference):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as cluster,
        DaskEngine(cluster.scheduler_address) as engine,
    ):
        run_experiment(config, tmp_path / "out", engine=engine)
    write_tables(Study(tmp_path / "out"))
    assert results(tmp_path / "out") == results(reference)


def test_a_process_that_dies_is_answered_in_one_line(config, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "_work_on", die)
    monkeypatch.setattr("meshsimp_pymoo.workers.TRIES", 1)  # each starts two processes
    with pytest.raises(ResultError, match=r"a process ended unexpectedly .* the same command does the rest"):
        run_experiment(config, tmp_path / "out", jobs=2)


def die(task: object, shared: object) -> None:
    os._exit(9)


WRONG = """
from pymoo.core.mutation import Mutation


class OwnError(Exception):
    def __init__(self, one, two):  # which no pickle brings to another process
        super().__init__(one + two)


class Wrong(Mutation):
    def _do(self, problem, X, **kwargs):
        if problem.n_var != 81:
            raise OwnError("only on\\n", "the real model")
        return X
"""


@pytest.fixture
def failing(tmp_path, monkeypatch):
    """An experiment with an operator that fails on one of its models, and not in the trial."""
    (tmp_path / "readers_late.py").write_text(WRONG, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    text = CONFIG.replace("N1, preset: nsga2_v1", "Own, preset: nsga2_v1, operators: {mutation: readers_late.Wrong}")
    text = re.sub(r"  - \{name: (N2|G1).*\n", "", text).replace("[1, 2, 3]", "[1, 2]")
    config = tmp_path / "late.yaml"
    config.write_text(text, encoding="utf-8")
    yield config
    sys.modules.pop("readers_late", None)


def check_what_is_said_and_left(out: Path, said: str) -> None:
    assert said == (
        "the run 'Own' on Face, seed 1, failed, as did 1 more of 4: OwnError: only on the real model "
        f"(readers_late.py, line 13); finished runs are kept in {out}: mend it and give the same command "
        f"(traceback: {out / 'failed.txt'})"
    )
    store = RunStore(out)
    assert sorted(store.get(key).record["problem"] for key in store.paths) == ["Peaks"] * 4
    log = (out / "failed.txt").read_text()
    assert log.count("Traceback") == 2
    assert log.count("OwnError: only on") == 2
    assert "the run 'Own' on Face, seed 2\n\nTraceback" in log


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_an_operator_raises_on_the_real_model_is_said_in_a_line_once_all_other_runs_are_done(
    failing, jobs, capsys
):
    out = failing.parent / "out"
    assert main(["run", str(failing), "-o", str(out), "--jobs", str(jobs), "-q"]) == 2
    _, first, last = capsys.readouterr().err.splitlines()  # before: that its state cannot be saved
    assert re.search(
        r"the run 'Own' on Face, seed [12], failed: OwnError: .* line 13\); the other runs are done", first
    )
    check_what_is_said_and_left(out, last.removeprefix("meshsimp: "))
    module = failing.parent / "readers_late.py"
    if jobs == 1:  # mended, it is done again: all of it, for the operator is another one now
        module.write_text(WRONG.replace("!= 81", "< 0"), encoding="utf-8")
        sys.modules.pop("readers_late")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ExperimentWarning)
            assert run_experiment(failing, out).finished == 8
        assert "not asked for" in str(caught[-1].message)
        assert not (out / "failed.txt").exists()


@pytest.mark.slow
def test_what_an_operator_raises_on_a_cluster_is_said_in_a_line(failing):
    distributed = pytest.importorskip("distributed")
    out = failing.parent / "out"
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0", silence_logs=50
        ) as cluster,
        DaskEngine(cluster.scheduler_address) as engine,
        pytest.warns(ExperimentWarning, match="failed"),
        pytest.raises(ResultError) as caught,
    ):
        run_experiment(failing, out, engine=engine)
    check_what_is_said_and_left(out, str(caught.value))


# ------------------------------------------------------------------------------------------------------ baselines


def test_without_pymeshlab_everything_else_is_done_and_the_rows_are_named_as_skipped(
    config, stored, monkeypatch, reference
):
    def unavailable() -> None:
        raise ToolUnavailable("it needs the packages libgl1 and libopengl0")

    there = meshlab_available()
    monkeypatch.setattr(baselines, "load_pymeshlab", unavailable)
    config.write_text(CONFIG + "baselines: meshlab\n", encoding="utf-8")
    out = stored
    record_of(out, problem="Peaks", algorithm="N2", seed=3).unlink()
    with pytest.warns(ExperimentWarning, match=r"skipped: Face / quadric_collapse.*Peaks / .*libgl1 and libopengl0"):
        done = run_experiment(config, out)
    assert (done.finished, done.reused) == (1, RUNS - 1)
    assert "libopengl0" in done.skipped[0]
    write_tables(Study(out))
    assert "libopengl0" in (out / "findings.md").read_text()
    same = {name: content for name, content in results(out).items() if "findings" not in name}
    assert same == {name: content for name, content in results(reference).items() if "findings" not in name}
    versions = [run.record["versions"] for run in Study(out).all_runs]
    assert versions
    assert not any("pymeshlab" in version for version in versions)
    if there:  # installed since: the same call adds what was left out, and does nothing again
        monkeypatch.undo()
        added = run_experiment(config, out)
        assert (added.finished, added.reused, added.skipped) == (2 * 4, RUNS, ())
        assert all("pymeshlab" in run.record["versions"] for run in Study(out).classic_runs.values())


def test_meshlabs_meshes_are_stored_scored_and_taken_down_to_the_smallest_evolutionary_one(config, tmp_path):
    if not meshlab_available():
        pytest.skip("pymeshlab cannot be loaded here: it needs the packages libgl1 and libopengl0")
    config.write_text(
        CONFIG.replace("seeds: [1, 2, 3]", "seeds: [1]")
        + "baselines: {methods: [quadric_collapse, vertex_clustering], steps: 3}\n",
        encoding="utf-8",
    )
    out = tmp_path / "out"
    run_experiment(config, out)
    write_tables(study := Study(out))
    problem = study.problems[0]
    run = study.classic_runs["Face", "quadric_collapse"]
    smallest = min(r.arrays["F"][:, 1].min() for r in study.all_runs if r.record["problem"] == "Face")
    assert run.arrays["asked"].tolist() == list(reductions(problem.triangles, down_to=int(smallest), steps=3))
    assert run.arrays["paper"].sum() == 10
    model = study.surface(problem).model
    from meshsimp_pymoo.comparison.store import classic_mesh

    for row in range(len(run.arrays["asked"])):
        vertices, faces = classic_mesh(run, row)
        assert len(faces) == run.arrays["F"][row, 1]
        for outside, error in (("ignore", run.arrays["F"][row, 0]), ("nearest", run.arrays["error_nearest"][row])):
            found = HeightSurface(model, Rules(outside=outside)).score(vertices, faces)
            assert found.quality.error == pytest.approx(error, rel=1e-12)
    # under the paper's reading only its own series is compared, else all of it
    searched = study.cases["Face", "6 generations", "searched"].runs["MeshLab quadric"][0]
    nearest = study.cases["Face", "6 generations", "nearest"].runs["MeshLab quadric"][0]
    assert searched[:, 1].min() >= problem.triangles * 0.49
    assert nearest[:, 1].min() < problem.triangles * 0.49
    # nothing is done again
    before = results(out)
    assert run_experiment(config, out).finished == 0
    # but what is damaged
    damaged = spoil_truncated(run.path)
    with pytest.warns(ExperimentWarning, match=f"{damaged.name}.*computed again"):
        assert run_experiment(config, out).finished == 1
    write_tables(Study(out))
    assert results(out) == before


def test_progress_ends_where_the_runs_do(reference):
    study = Study(reference)
    for budget in study.budgets:
        case = study.cases["Face", budget, "searched"]
        for method in ("N1", "N2", "G1"):
            for over in ("evaluations", "seconds"):
                curves = case.progress(method, over)
                np.testing.assert_allclose([hvr[-1] for _, hvr in curves], case.scores[method].hvr)
                assert all((np.diff(x) > 0).all() for x, _ in curves)
            np.testing.assert_allclose(
                [x[-1] for x, _ in case.progress(method, "evaluations")], case.evaluations(method)
            )
            assert study.cases["Face", budget, "nearest"].progress(method, "evaluations") == []


def test_pictures_say_of_every_mesh_how_much_of_the_model_it_abandons(reference):
    study = Study(reference)
    case = study.cases["Face", "6 generations", "searched"]
    figure = meshes_figure(study, case)
    assert overlaps(figure) == ([], [])
    titles = [axes.get_title() for axes in figure.axes]
    # the paper's Figure 10 first, then by hypervolume
    best = sorted(("N1", "G1"), key=lambda method: -case.scores[method].merged_hvr)
    assert [title.split("\n")[0] for title in titles if title][:4] == ["original", "N2", *best]
    chosen = analysis.selected_solutions(case.runs, optimal=case.optimal)
    for method in ("N1", "N2", "G1"):
        (solution,) = (s for s in chosen[method] if s.kind == "trade_off")
        found = case.find(method, solution.error, solution.triangles)
        size, mean = f"{solution.triangles:,.0f} triangles", f"mean {found.number('mean_error'):.3g}"
        assert f"{method}\n{size}, {mean}\n{found.number('uncovered'):.0f} vertices uncovered" in titles


# ------------------------------------------------------------------------------------------------ folders and shell


def test_a_folder_with_other_things_in_it_is_refused(config, tmp_path):
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(ResultError, match=r"thesis\.txt|tiny\.yaml"):
        run_experiment(config, tmp_path)
    assert not (tmp_path / "runs").exists()


class Unsaved(NSGA2):
    """NSGA-II of somebody's own, of whose state a checkpoint knows nothing."""


def test_algorithms_whose_state_cannot_be_saved_are_named_once_before_their_searches(tmp_path):
    text = CONFIG.replace("{name: N1, preset: nsga2_v1", "{name: U1, class: test_runner.Unsaved")
    second = "{name: U2, class: test_runner.Unsaved, parameters: {pop_size: 10"
    text = text.replace("{name: N2, preset: nsga2_v2, parameters: {pop_size: 12", second)
    (tmp_path / "u.yaml").write_text(text.replace("[1, 2, 3]", "[1, 2]"), encoding="utf-8")
    with pytest.warns(ExperimentWarning) as caught:
        run_experiment(tmp_path / "u.yaml", tmp_path / "out", checkpoint=0.0)
    assert [str(warning.message) for warning in caught] == [
        "U1 and U2: searches that are cut off begin anew, for their state cannot be saved: algorithm is a "
        "test_runner.Unsaved, which a checkpoint cannot carry"
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error", ExperimentWarning)
        run_experiment(tmp_path / "u.yaml", tmp_path / "out", checkpoint=0.0)  # nothing is left to do, or to say


@pytest.mark.parametrize(
    "path",
    ["moo.moead.MOEAD", "moo.ctaea.CTAEA", "moo.spea2.SPEA2", pytest.param("moo.age.AGEMOEA", marks=pytest.mark.slow)],
)
def test_a_search_of_pymoos_that_was_cut_off_goes_on_to_the_same_run(tmp_path, path):
    size = "ref_dirs" if path in ("moo.moead.MOEAD", "moo.ctaea.CTAEA") else "pop_size"
    algorithms = f"[{{name: A, class: pymoo.algorithms.{path}, parameters: {{{size}: 12}}}}]"
    text = (
        CONFIG[: CONFIG.index("algorithms")] + f"algorithms: {algorithms}\nseeds: [1]\nbudgets: [{{generations: 6}}]\n"
    )
    (tmp_path / "p.yaml").write_text(text, encoding="utf-8")
    experiment = read_experiment_file(tmp_path / "p.yaml")
    task, problem, saved = plan(experiment)[0], experiment.problems[0].build(), tmp_path / "c.npz"
    ((_, whole, _),) = runner.perform(task, problem)
    save, kept = runner.Checkpoints.save, []

    def cut_off(self: Any, **facts: Any) -> None:
        save(self, **facts)
        kept.append(facts["generations"])
        if len(kept) == 3:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner.Checkpoints, "save", cut_off)
        patch.setattr(runner.Checkpoints, "due", lambda _: True)
        with pytest.raises(KeyboardInterrupt):
            list(runner.perform(task, problem, checkpoint=saved, interval=0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ExperimentWarning)
        ((_, again, facts),) = runner.perform(task, problem, checkpoint=saved)
    assert facts["generations"] == 6
    assert {name: array.tolist() for name, array in again.items()} == {k: a.tolist() for k, a in whole.items()}


def test_a_folder_that_a_killed_process_had_only_begun_is_continued(config, tmp_path, reference):
    import shutil

    out = tmp_path / "out"
    (out / "runs").mkdir(parents=True)
    shutil.copytree(reference / "models", out / "models")
    (out / "models" / ".half.npz.00000000.partial").write_text("half")
    assert run_experiment(config, out).finished == RUNS
    (tmp_path / "other" / "models").mkdir(parents=True)
    (tmp_path / "other" / "models" / "face.ply").write_text("precious")
    with pytest.raises(ResultError, match=r"models.face\.ply"):
        run_experiment(config, tmp_path / "other")


def test_two_calls_do_not_work_in_one_folder(config, stored):
    with locked(stored, inside=True), pytest.raises(ResultError, match="another process"):
        run_experiment(config, stored)


def test_nothing_is_written_for_a_configuration_that_is_wrong_anywhere(config, tmp_path, capsys):
    config.write_text(CONFIG.replace("peaks:9", "peak:9"), encoding="utf-8")
    assert main(["run", str(config), "-o", str(tmp_path / "out")]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert "problems[1].model" in said.err
    assert "'peaks'" in said.err
    assert not (tmp_path / "out").exists()


def test_the_shell_runs_the_quick_configuration_shortened_and_reports_it_again(tmp_path, capsys, monkeypatch):
    text = (CONFIGS / "quick.yaml").read_text(encoding="utf-8")
    for long, short in (
        ("seeds: [1, 2, 3, 4, 5, 6, 7, 8]", "seeds: [1, 2]"),
        ("{generations: 25}", "{generations: 3}"),
        ("  - {evaluations: 1000}\n", ""),
        ("[0.0, 0.25, 0.5, 0.75, 1.0]", "[0.0, 1.0]"),
        ('  - {name: Terrain, model: "jacksboro:vertices=400"}\n', ""),
        ('  - {name: Horseshoe, model: "horseshoe:350"}\n', ""),
    ):
        assert long in text
        text = text.replace(long, short)
    (tmp_path / "quick.yaml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    # each figure is made; how they look on paper is shown in test_study_figures.py
    monkeypatch.setattr(report, "_save", lambda draw, path: sketch_into(draw(), path))
    assert main(["run", "quick.yaml", "--jobs", "1"]) == 0
    out = tmp_path / "quick_results"
    said = capsys.readouterr()
    assert "runs done" in said.out
    if meshlab_available():
        lines = said.err.splitlines()
        assert [line for line in lines if not re.match(r"meshsimp: (runs|report|compiling): ", line)] == []
    for scoring in ("searched", "nearest"):
        figures = {path.name for path in (out / "figures" / "3-generations" / scoring).iterdir()}
        expected = {"hvr.png", "cardinality.png", "selected.png", "fronts_Face.png", "meshes_Face.png", "profile.png"}
        if scoring == "searched":  # what a run kept on its way is as it searched
            expected |= {"convergence_evaluations.png", "convergence_seconds.png"}
        assert figures == expected
        assert (out / "tables" / "3-generations" / scoring / "scores.tex").stat().st_size > 500
    before = results(out)
    assert (out / "times.csv").read_text().startswith("model,method,")
    for name in ("tables", "figures"):
        import shutil

        shutil.rmtree(out / name)
    (out / "findings.md").unlink()
    monkeypatch.setattr(report, "_write_figures", lambda study, progress: None)  # drawn once above
    assert main(["report", str(out)]) == 0
    assert results(out) == before
    assert "missing" not in capsys.readouterr().out


def test_where_there_is_no_terminal_a_line_now_and_then_says_how_far_it_is(capsys, monkeypatch):
    monkeypatch.setattr(terminal, "LINE_SECONDS", 0.02)
    for quiet in (False, True):
        with terminal.bar(quiet, "runs") as show:
            show(0.25, "Face / N1")
            time.sleep(0.3)
            show(1.0, "")
            time.sleep(0.3)
        lines = capsys.readouterr().err.splitlines()
        assert bool(lines) is not quiet
        said = {re.sub(r"after \d+ s", "after", line) for line in lines}
        assert quiet or said == {"meshsimp: runs: 25% after; Face / N1", "meshsimp: runs: 99% after"}


def test_a_report_of_nothing_is_refused(tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert "holds neither a front" in capsys.readouterr().err


def test_a_leftover_of_a_killed_process_is_removed(config, stored):
    leftover = stored / "runs" / ".x.json.00000000.partial"
    leftover.write_text("half")
    run_experiment(config, stored)
    assert not leftover.exists()


def test_no_result_holds_a_pickle(reference):
    for path in (reference / "runs").glob("*.npz"):
        with np.load(path, allow_pickle=False) as file:
            assert all(file[name].dtype.kind in "fiub" for name in file.files)
    assert RunStore(reference).paths


def test_runs_follow_the_measure_and_the_weights_of_their_problem_and_the_findings_say_so(tmp_path):
    face = load("face:90")
    write_mesh(tmp_path / "face.ply", face.points, face.faces, {"importance": np.linspace(0, 1, 90)})
    (tmp_path / "study.yaml").write_text(
        "problem: {objectives: [rms_error, triangles], weights: importance, outside: ignore}\n"
        "problems: [face.ply]\nalgorithms: [{preset: nsga2_v1, parameters: {pop_size: 12}}]\n"
        "seeds: [1]\nbudgets: [{generations: 3}]\n",
        encoding="utf-8",
    )
    assert run_experiment(tmp_path / "study.yaml", tmp_path / "out", jobs=1).finished == 1
    again = run_experiment(tmp_path / "study.yaml", tmp_path / "out", jobs=1)
    assert (again.finished, again.reused) == (0, 1)
    (path,) = RunStore(tmp_path / "out").paths.values()
    arrays = read_run(path).arrays
    rules = {"objectives": ("rms_error", "triangles"), "weights": "importance"}
    by_ignoring, by_nearest = (MeshProblem(tmp_path / "face.ply", outside=o, **rules) for o in ("ignore", "nearest"))
    kept = np.unpackbits(arrays["kept"], axis=1)[:, :90].astype(bool)
    np.testing.assert_array_equal(by_ignoring.evaluate(kept), arrays["F"])
    np.testing.assert_array_equal(by_nearest.evaluate(kept)[:, 0], arrays["error_nearest"])
    np.testing.assert_array_equal(arrays["rms_error"], arrays["F"][:, 0])
    study = Study(tmp_path / "out")
    assert study.surface(study.problems[0]).total_weight == pytest.approx(45.0)
    write_tables(Study(tmp_path / "out"))
    said = (tmp_path / "out" / "findings.md").read_text(encoding="utf-8")
    assert "On face the *error* is the RMS error (root mean square), not the sum of the deviations." in said
    assert "attribute *importance*" in said


def test_weights_may_be_numbers_in_the_configuration_and_the_findings_say_so(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "_save", sketch_into)
    numbers = [round(0.1 * row, 1) for row in range(25)]
    (tmp_path / "study.yaml").write_text(
        f"problems: [{{model: 'roof:5', weights: {numbers}}}, {{name: square, model: 'roof:5', weights: "
        f"{[numbers[row : row + 5] for row in range(0, 25, 5)]}}}, 'roof:3']\n"
        "algorithms: [{preset: nsga2_v1, parameters: {pop_size: 12}}]\nseeds: [1]\nbudgets: [{generations: 2}]\n",
        encoding="utf-8",
    )
    assert run_experiment(tmp_path / "study.yaml", tmp_path / "out", jobs=1).finished == 3
    study = write_report(tmp_path / "out")
    assert [problem.rules.weights for problem in study.problems[::2]] == [numbers, None]
    assert study.surface(study.problems[0]).total_weight == pytest.approx(sum(numbers))
    said = (tmp_path / "out" / "findings.md").read_text(encoding="utf-8")
    assert "On roof:5, square each vertex counts by a number of its own, from the configuration." in said
    assert said.count("each vertex counts") == 1


def test_an_experiment_of_an_earlier_version_or_a_damaged_one_is_answered_in_one_line(stored, capsys):
    record = stored / "experiment.json"
    content = json.loads(record.read_text(encoding="utf-8"))
    assert content["format"] == FORMAT == 5

    def told(**changed):
        record.write_text(json.dumps(content | changed), encoding="utf-8")
        assert main(["report", str(stored)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    without_rules = [{key: item[key] for key in item if key != "rules"} for item in content["problems"]]
    assert "experiment.json: is not of the format 5 that this version reads; run it again" in told(
        format=1, problems=without_rules
    )
    assert "experiment.json: is damaged ('rules' is missing); `meshsimp run` writes it anew" in told(
        problems=without_rules
    )
    assert "experiment.json: is damaged (footprint is 3: expected one of model, hull)" in told(
        problems=[problem | {"rules": {"footprint": 3}} for problem in content["problems"]]
    )
    assert "experiment.json: is damaged (" in told(runs=[None])
    unknown = [{"key": "0", "problem": content["problems"][0]["name"], "method": "melting"}]
    assert "experiment.json: is damaged (the method 'melting' is none of quadric_collapse, " in told(classic=unknown)
