"""The benchmark of all methods runs, and compares what it says it compares."""

from __future__ import annotations

import csv
import dataclasses
import functools
import importlib
import importlib.util
import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, thinning
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
        assert float(row["max_ratio"]) == pytest.approx(float(row["max_error"]) / best.max_error)
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
    budgeted = [f"{method} {seconds} s" for method in ("memetic", "memetic free") for seconds in (0.2, 0.4)]
    for method in (*quality.TOOLS, *quality.PASSES, "NSGA-II v1", *budgeted):
        assert method in named or f"no {method}: " in printed
    text = tables.read_text()
    assert "| thinning, its error |" in text
    assert "| thinning, its surface error |" in text
    assert "Geometric means of surface error / thinning's" in text
    assert "Search / rival" in text
    assert "Free / Delaunay meshes of equal time" in text
    assert quality.main(["--models", "peaks:7", "--methods", "pyfqmr", "--append", "-o", str(rows_file)]) == 0
    scores = quality.read_csv(rows_file)
    assert [s.model for s in scores] == ["peaks:9"] * len(rows) + ["peaks:7"] * (len(scores) - len(rows))
    assert len(scores) > len(rows)
    assert [s.ratio for s in scores[: len(rows)]] == [float(row["ratio"]) for row in rows]
    assert quality.joined(scores, scores[:3]) == scores


def test_free_meshes_are_compared_at_the_sizes_of_thinning(quality):
    model = open_model("peaks:9")
    with quality.changed("free, no subsets before"):
        curve = quality.search_curve(model, quality.free_search(pop_size=20), Moves(20_000), 1)
    front = curve.front
    assert front.n_free > 0
    assert curve.note.endswith(f"{front.n_free} of {len(front)} meshes free")
    for solution in front:
        size = solution.triangles
        best = min((s.error, s.triangles) for s in front if 0 < s.triangles <= size) if size else None
        assert size == 0 or curve.value(size) == best[0]
        if solution.free:
            assert np.array_equal(curve.mesh(solution.solution).faces, solution.faces)
            assert curve.scored(solution.solution).surface_error == pytest.approx(solution.surface_error)
    free = next(s.solution for s in front if s.free)
    assert curve.refitted(free)[0].error <= front[free].error * (1 + 1e-9)


def one_score(quality, method, error, share=2.0, triangles=35, model="jacksboro:11", **more):
    """A score of a front where thinning has 1 for all errors."""
    given = dict.fromkeys((f.name for f in dataclasses.fields(quality.Score)), 1.0)
    given |= {"size_class": "small", "seed": 1, "uncovered": 0, "is_front": True, "wanted": triangles}
    given |= {"model": model, "method": method, "error": error, "share": share, "triangles": triangles}
    return quality.Score(**(given | more))


def test_free_searches_are_set_beside_the_delaunay_search_of_equal_time(quality):
    assert quality.delaunay_name("memetic free 10 s") == "memetic 10 s"
    assert quality.delaunay_name("memetic free, plain 0.5 s, refitted") == "memetic 0.5 s, refitted"
    assert quality.delaunay_name("memetic 10 s") is None
    score = functools.partial(one_score, quality)
    scores = [
        score("memetic 10 s", 0.8),
        score("memetic 10 s", 0.5, 5.0, surface_error=0.5),
        score("memetic free 10 s", 0.4),
        score("memetic free 10 s", 0.5, 5.0, surface_error=0.6),
        score("memetic free 60 s", 0.3),
    ]
    (sheet,) = [sheet for sheet in quality.summaries(scores, []) if sheet.title.startswith("Free")]
    (row,) = sheet.rows
    assert row[:4] == ["memetic free 10 s", "2", "0.707", "1.000 jacksboro:11 5 %"]
    assert row[4:6] == ["1.095", "1.200 jacksboro:11 5 %"]
    assert sheet.notes == ["memetic free 60 s: 1 of 1 meshes have no memetic 60 s beside them"]


def test_the_best_values_known_are_compared_with_and_can_be_replaced(quality, monkeypatch, tmp_path):
    best = tmp_path / "best.csv"
    best.write_text("model,triangles,delaunay,free\njacksboro:11,35,0.844,0.832\nface:1000,28,0.693,0.687\n")
    monkeypatch.setattr(quality, "BEST", best)
    options = type("Options", (), {"best": "compare"})
    scores = [
        one_score(quality, "memetic 10 s", 0.844 * 1.1),
        one_score(quality, "memetic 10 s", 0.693 * 1.2, triangles=28, model="face:1000"),
        one_score(quality, "memetic free, plain 10 s", 0.8316, seed=1),  # no better than rounding
        one_score(quality, "memetic free 60 s", 0.81234, seed=2),
        one_score(quality, "memetic free 60 s, refitted", 0.5),
        one_score(quality, "pyfqmr", 0.4),
    ]
    (sheet,) = quality.best_sheets(options, scores)
    assert sheet.columns == [
        *("model", "triangles", "best delaunay", "memetic 10 s", "best free"),
        *("memetic free, plain 10 s", "memetic free 60 s"),
    ]
    assert sheet.rows[0][2:6] == ["0.844", "0.928 (+10.0%)", "0.832", "0.832 (-0.0%)"]
    assert sheet.rows[-1][3] == f"{np.sqrt(1.1 * 1.2) - 1:+.1%}"
    assert len(sheet.notes) == 1
    assert sheet.notes[0].startswith("better: jacksboro:11, 35 triangles, free: 0.8123 by memetic free 60 s, seed 2")
    quality.write_best(scores)
    assert best.read_text().splitlines()[1:] == ["jacksboro:11,35,0.844,0.8123", "face:1000,28,0.693,0.687"]


def test_the_best_values_known_are_those_of_thinnings_sizes(quality):
    known = quality.read_best()
    _, sizes = quality.reference_of(open_model("jacksboro:11"), quality.SHARES)
    assert [triangles for model, triangles in known if model == "jacksboro:11"] == list(sizes.values())
    assert all(0.5 < best["free"] < best["delaunay"] < 1.0 for best in known.values())


def test_variants_leave_out_what_they_say(quality):
    surface = MeshProblem("peaks:9").surface
    front = thinning(surface)
    kept = front.kept(40 - len(front.base))

    def annealed():
        with surface.free_ground(centroids=True).triangulation(kept) as mesh:
            hot = mesh.cost / 40
            mesh.anneal(4000, np.array([1], np.uint64), hot=hot, cold=0.5 * hot, triangles=mesh.triangles)
            edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [0, 2]]]))
            edges, count = np.unique(edges, axis=0, return_counts=True)
            return mesh.accepted.copy(), set(map(tuple, edges[count == 1].tolist()))

    whole, _ = annealed()
    assert (whole > 0).all()
    for row, move in enumerate(("flips", "shifts", "swaps")):
        with quality.changed(f"free, no {move}"):
            counts, _ = annealed()
        assert [count == 0 for count in counts] == [row == k for k in range(3)]
    with quality.changed("free, no outline moves"):
        _, outline = annealed()
    triangles = np.sort(surface.triangles(kept))
    edges, count = np.unique(
        np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [0, 2])]), axis=0, return_counts=True
    )
    assert outline == set(map(tuple, edges[count == 1].tolist()))
    assert np.array_equal(annealed()[0], whole)
    with pytest.raises(LookupError, match="no constant NOTHING"):
        quality.constant("NOTHING", 1)


def test_variants_are_asked_for_by_name_or_by_kind(quality):
    assert list(quality.chosen_variants([])) == list(quality.VARIANTS)
    assert list(quality.chosen_variants(["free"])) == [*quality.FREE_VARIANTS, "memetic"]
    assert list(quality.chosen_variants(["MOEA/D", "free, no limit"])) == ["MOEA/D", "free, no limit"]
    assert set(quality.CHANGES) < set(quality.FREE_VARIANTS)
    with pytest.raises(SystemExit, match="no variant 'nothing'"):
        quality.chosen_variants(["nothing"])


REFEREE = """
import numpy as np

def vertical_error(points, vertices, faces):
    cost = np.full(len(points), np.inf)
    for corners in vertices[faces]:
        system = np.vstack([corners[:, :2].T, np.ones(3)])
        shares = np.linalg.solve(system, np.vstack([points[:, :2].T, np.ones(len(points))]))
        inside = (shares >= -1e-9).all(axis=0)
        cost[inside] = np.minimum(cost[inside], np.abs(shares.T[inside] @ corners[:, 2] - points[inside, 2]))
    return cost.sum() + EXTRA, 0, cost + EXTRA
"""


def test_a_referee_measures_the_stored_meshes(quality, tmp_path):
    stored_fronts = quality.beside("stored_fronts")
    problem = MeshProblem("roof:3")
    front = Front.from_subsets(problem, [np.array(bits, bool) for bits in itertools.product([False, True], repeat=9)])
    said = {}
    for extra in ("0.0", "0.25"):
        path = tmp_path / f"referee{extra}.py"
        path.write_text(REFEREE.replace("EXTRA", extra))
        said[extra] = stored_fronts.Referee(path).checked(front)
    assert (said["0.0"].meshes, said["0.0"].free, said["0.0"].left_out, said["0.0"].wrong) == (3, 0, 0, [])
    assert len(said["0.25"].wrong) == 3
    assert all("error" in text and "surface error" in text for text in said["0.25"].wrong)
    one = stored_fronts.Referee(path, 1).checked(front)
    assert (one.meshes, one.left_out, len(one.wrong)) == (1, 2, 1)


def test_meshes_that_are_no_surface_seen_from_above_are_told(quality):
    shape_faults = quality.beside("stored_fronts").shape_faults
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 3]])
    assert shape_faults(vertices, np.array([[0, 1, 2], [0, 2, 3]])) == []
    assert shape_faults(vertices, np.array([[0, 1, 2], [3, 2, 0]])) == [
        "1 edges twice in a turn",
        "1 faces are not counter-clockwise seen from above",
    ]
    three = shape_faults(vertices, np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 0, 4]]))
    assert "1 edges have more than two faces" in three
    assert shape_faults(vertices, np.array([[0, 1, 2], [0, 2, 4]]))[-1].startswith("1 faces are not")  # no area


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


@pytest.mark.slow
def test_every_free_variant_searches_and_they_differ(quality):
    found = {}
    for name, make in quality.FREE_VARIANTS.items():
        with quality.changed(name):
            curve = quality.search_curve(open_model("peaks:15"), make(pop_size=20), Moves(60_000), 1)
        assert curve.front.n_free > 3
        found[name] = tuple(curve.error)
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


def test_the_summary_is_made_of_the_tables_and_agrees_with_their_own_means(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent / "benchmarks")
    summary = importlib.import_module("summary")
    assert summary.SUMMARY.read_text(encoding="utf-8") == summary.summary(), "python tests/benchmarks/summary.py"
    for name in summary.CLASSES:
        text = (summary.QUALITY / f"{name}.md").read_text(encoding="utf-8")
        rows = summary.rows_of(text)
        models = list(dict.fromkeys(row.model for row in rows))
        means = summary.means_of(text, "error", models)
        assert len(means) > 8
        for method, mean in means.items():
            ours, _ = summary.mean_of(rows, "error", method, models)
            assert ours == pytest.approx(mean, abs=1.5e-3)
