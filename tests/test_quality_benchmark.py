"""The benchmark of all methods runs, and compares what it says it compares."""

from __future__ import annotations

import csv
import functools
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem, thinning
from meshsimp_pymoo.opening import open_model


@pytest.fixture(scope="module")
def quality():
    path = Path(__file__).parent / "benchmarks" / "quality.py"
    spec = importlib.util.spec_from_file_location("quality_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def test_it_scores_every_method_at_the_sizes_of_thinning(quality, tmp_path, capsys):
    rows_file, tables = tmp_path / "quality.csv", tmp_path / "quality.md"
    options = ["--models", "peaks:9", "--shares", "20", "50", "--budgets", "0.2", "0.4", "--refit"]
    assert quality.main([*options, "-o", str(rows_file), "-o", str(tables)]) == 0
    with rows_file.open(newline="") as file:
        rows = list(csv.DictReader(file))
    problem = MeshProblem("peaks:9")
    front = thinning(problem.surface)
    for row in rows:
        wanted = front.triangles[round(float(row["share"]) / 100 * 81) - len(front.base)]
        assert int(row["wanted"]) == wanted
        size = wanted if row["is_front"] == "True" else int(row["triangles"])
        least = front.error[front.triangles <= size].min()
        assert float(row["ratio"]) == pytest.approx(float(row["error"]) / least)
        fitting = np.flatnonzero(front.triangles <= size)
        best = problem.quality(front.kept(fitting[np.lexsort((front.triangles[fitting], front.error[fitting]))[0]]))
        assert float(row["surface_ratio"]) == pytest.approx(float(row["surface_error"]) / best.surface_error)
        if row["method"] == "thinning":
            angles = (float(row["min_angle_median"]), float(row["below_5_degrees"]))
            assert angles == (best.min_angle_median, best.below_5_degrees)
        if row["method"] in ("thinning", "memetic 0.2 s", "memetic 0.4 s", "worst point", "NSGA-II v1"):
            assert int(row["triangles"]) <= wanted
    ratios = {(row["method"], row["share"]): float(row["ratio"]) for row in rows}
    assert ratios["thinning", "20.0"] == pytest.approx(1.0)
    for share in ("20.0", "50.0"):
        assert ratios["memetic 0.4 s, refitted", share] <= ratios["memetic 0.4 s", share]
    assert ratios["worst point", "20.0"] >= ratios["memetic 0.4 s", "20.0"]
    printed = capsys.readouterr().out
    named = {row["method"] for row in rows}
    for method in (*quality.TOOLS, *quality.PASSES, "NSGA-II v1", "memetic 0.2 s", "memetic 0.4 s"):
        assert method in named or f"no {method}: " in printed
    text = tables.read_text()
    assert "| thinning, its error |" in text
    assert "| thinning, its surface error |" in text
    assert "Geometric means of surface error / thinning's" in text
    assert "Search / rival" in text


@pytest.mark.slow
def test_variants_are_compared_with_the_first_one(quality, monkeypatch, capsys, tmp_path):
    few = functools.partial(quality.ladder_search, 5)
    monkeypatch.setattr(quality, "VARIANTS", {"full": quality.ladder_search, "few": few})
    results = tmp_path / "variants.csv"
    options = ["--ablation", "--models", "peaks:9", "--budgets", "0.6", "--seeds", "1", "2", "--shares", "20"]
    assert quality.main([*options, "-o", str(results)]) == 0
    with results.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["variant"], row["seed"]) for row in rows] == [("full", "1"), ("full", "2"), ("few", "1"), ("few", "2")]
    full, few = (np.log([float(r["ratio"]) for r in rows if r["variant"] == name]) for name in ("full", "few"))
    assert full.mean() < -0.1
    lines = [line.replace("┃", "│").split("│") for line in capsys.readouterr().out.splitlines()]
    heading = next(cells for cells in lines if any("variant" in cell for cell in cells[1:2]))
    column = next(k for k, cell in enumerate(heading) if "all / full" in cell)
    line = next(cells for cells in lines if len(cells) > 2 and cells[1].strip() == "few")
    assert float(line[column]) == pytest.approx(np.exp(few.mean() - full.mean()), abs=6e-4)


@pytest.mark.slow
def test_every_variant_searches_and_they_differ(quality):
    problem = MeshProblem("peaks:9", regions=quality.REGIONS)
    found = {}
    for name, make in quality.VARIANTS.items():
        result = minimize(problem, make(), ("n_gen", 3), seed=1)
        assert len(result.F) > 3
        found[name] = result.algorithm.evaluator.n_eval, np.sort(result.F[:, 0]).sum()
    assert len(set(found.values())) == len(found)


def test_the_enumerated_models_are_reported(quality, capsys):
    quality.main(["--enumerable", "1"])
    assert "of 1 models" in capsys.readouterr().out


def test_a_front_gives_the_least_error_among_meshes_that_are_small_enough(quality):
    curve = quality.Curve(None, np.array([5.0, 1.0, 3.0, 3.0]), np.array([2, 9, 6, 4]), lambda k: k, 0.0)
    assert [curve.best(size) for size in (1, 2, 5, 8, 9)] == [None, 0, 3, 3, 1]
    assert curve.value(1) == np.inf


def test_a_mesh_that_is_not_what_its_front_says_is_an_error(quality):
    model = open_model("peaks:7")
    curve = quality.nested_curve(model, thinning)
    curve.scored(10)
    curve.error[10] *= 1.01
    with pytest.raises(RuntimeError, match="a front says"):
        curve.scored(10)
