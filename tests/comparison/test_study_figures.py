"""Figures of an experiment and what they are drawn of: convergence and ranks by hand, nothing that overlaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drawing import overlaps
from handmade import BUDGET, store
from matplotlib.colors import to_hex
from numpy.testing import assert_allclose, assert_array_equal

from meshsimp_pymoo.comparison.analysis import anytime
from meshsimp_pymoo.comparison.figures import (
    box_figure,
    convergence_figure,
    critical_difference_figure,
    fronts_figure,
    method_look,
    profile_figure,
    profiled,
    selected_figure,
)
from meshsimp_pymoo.comparison.store import StoredRun
from meshsimp_pymoo.comparison.study import Case, Problem, Study, ranked
from meshsimp_pymoo.surface.rules import Rules

# Optimal together: (10, 20), (5, 40), (0, 60). Normalised by that front: error / 10, (triangles - 20) / 40.
FRONTS = {
    "N1": {1: [(10.0, 20), (5.0, 40), (0.0, 60)], 2: [(10.0, 20), (5.0, 40)]},
    "MD": {1: [(5.0, 40)], 2: [(10.0, 40), (0.0, 60)]},
}
NEAREST = "nearest"
OPTIMAL = np.array(FRONTS["N1"][1])
WHOLE = 1.1 * 0.1 + 0.6 * 0.5 + 0.1 * 0.5  # its hypervolume


def run_of(evaluations, seconds, fronts):
    """A stored run that kept fronts on its way."""
    rows = [np.array(F, dtype=float).reshape(-1, 2) for F in fronts]
    trace = {
        "trace_evaluations": np.array(evaluations),
        "trace_start": np.cumsum([0, *map(len, rows)]),
        "trace_F": np.concatenate(rows),
    }
    record = {"trace_seconds": list(seconds), "seconds": seconds[-1], "evaluations": evaluations[-1]}
    return StoredRun(Path("run.json"), record, trace)


# Nothing, one end, all of the optimum; and a run of half as many evaluations that has the other end from the first.
SLOW = run_of([100, 200, 400], [1.0, 3.0, 9.0], [[], [(10, 20)], OPTIMAL])
QUICK = run_of([50, 200], [1.0, 2.0], [[(0, 60)], [(0, 60)]])


def case_of(sources, *, outside="ignore", scoring="searched", name="M", **runs):
    problem = Problem(name, "", 9, 8, Rules(outside=outside), "", "", {}, unit="m", system="")
    fronts = {method: dict.fromkeys(seeds, OPTIMAL) for method, seeds in sources.items()} | runs
    return Case(problem, BUDGET, scoring, fronts, sources, ())


class TestProgress:
    def test_of_a_single_run_by_hand(self):
        case = case_of({"N1": {1: [SLOW]}})
        # nothing yet; (10, 20) alone has 0.1 * 1.1; at last all
        ((x, hvr),) = case.progress("N1", "evaluations")
        assert_array_equal(x, [100, 200, 400])
        assert_allclose(hvr, [0, 0.11 / WHOLE, 1])
        ((x, again),) = case.progress("N1", "seconds")
        assert_array_equal(x, [1, 3, 9])
        assert_array_equal(again, hvr)

    def test_of_merged_runs_counts_all_and_merges_at_the_same_share_of_the_way(self):
        case = case_of({"G1": {1: [SLOW, QUICK]}})
        # a quarter, half and all of 400 + 200 evaluations; (0, 60) has 1.1 * 0.1, with (10, 20) 0.11 + 1 * 0.1
        ((x, hvr),) = case.progress("G1", "evaluations")
        assert_array_equal(x, [150, 300, 600])
        assert_allclose(hvr, [0.11 / WHOLE, 0.21 / WHOLE, 1])
        # by time the slow run begins at 1 / 9 of its way and the quick one at half: at its moments 1 and 2 of 2 s,
        # of 11 s together, the slow one has its second front (3 / 9 <= 1 / 2) and its last
        ((x, hvr),) = case.progress("G1", "seconds")
        assert_allclose(x, [5.5, 11])
        assert_allclose(hvr, [0.21 / WHOLE, 1])

    def test_order_of_the_merged_runs_changes_nothing(self):
        there, back = (
            case_of({"G1": {1: runs}}).progress("G1", "evaluations") for runs in ([SLOW, QUICK], [QUICK, SLOW])
        )
        assert_allclose(there, back)

    def test_runs_that_kept_nothing_are_left_out(self):
        old = StoredRun(Path("old.json"), {"seconds": 1.0, "evaluations": 100}, {})
        case = case_of({"N1": {1: [old], 2: [SLOW]}, "G1": {1: [SLOW, old]}})
        assert len(case.progress("N1", "evaluations")) == 1
        assert case.progress("G1", "seconds") == []

    def test_only_under_the_scoring_that_was_searched_by(self):
        sources = {"N1": {1: [SLOW]}}
        assert case_of(sources, outside="ignore", scoring="nearest").progress("N1", "evaluations") == []
        assert len(case_of(sources, outside="nearest", scoring="nearest").progress("N1", "evaluations")) == 1

    def test_no_time_at_all_is_no_division_by_zero(self):
        at_once = run_of([10, 20], [0.0, 0.0], [[(10, 20)], OPTIMAL])
        with np.errstate(all="raise"):
            ((x, hvr),) = case_of({"N1": {1: [at_once]}}).progress("N1", "seconds")
            ((both, _),) = case_of({"N1": {1: [at_once, QUICK]}}).progress("N1", "seconds")
        assert_array_equal(x, [0, 0])
        assert hvr[-1] == 1
        assert_allclose(both, [1, 2])


class TestAnytime:
    def test_by_hand(self):
        curves = [([1, 10], [0.2, 0.6]), ([2, 20], [0.4, 0.8]), ([5], [1.0])]
        # at 0 nothing; at 1 only the first; at 5 the three have 0.2, 0.4, 1; at 30 they keep 0.6, 0.8, 1
        low, middle, high = anytime(curves, [0, 1, 5, 30])
        assert_allclose(middle, [0, 0, 0.4, 0.8])
        assert_allclose(low, [0, 0, 0.3, 0.7])
        assert_allclose(high, [0, 0.1, 0.7, 0.9])

    def test_nothing_is_guessed_between_two_moments(self):
        assert_array_equal(anytime([([1, 100], [0.5, 1.0])], [1, 99.9, 100])[1], [0.5, 0.5, 1])

    def test_refuses_nothing(self):
        with pytest.raises(ValueError, match="no curves"):
            anytime([], [1])


class TestRanked:
    def test_by_the_median_ratio_of_every_model(self, tmp_path):
        # N1 finds everything in two runs of three and one end in the third, MD the middle in each: better by the
        # median, worse by the worst run; the model C lacks MD, A and B lack X
        full, middle = FRONTS["N1"][1], FRONTS["MD"][1]
        both = {"N1": {1: full, 2: full, 3: full[:1]}, "MD": dict.fromkeys((1, 2, 3), middle)}
        fronts = {"A": both, "B": both, "C": {"N1": both["N1"], "X": both["MD"]}}
        study = Study(store(tmp_path / "out", fronts))
        cases = study.compared(BUDGET, NEAREST)
        methods, found = ranked(cases[:2])
        assert methods == ["N1", "MD"]
        assert_array_equal(found.mean_ranks, [1, 2])
        with pytest.raises(ValueError, match="a row for each case, a column for each method"):
            ranked(cases)

    def test_profiles_are_of_seeds_that_all_methods_have(self, tmp_path):
        classic = {"A": {"vertex_clustering": [(9.0, 30, True)]}}
        fronts = {"A": {"N1": FRONTS["N1"], "MD": {2: FRONTS["MD"][2]}}}
        (case,) = Study(store(tmp_path / "out", fronts, classic=classic)).compared(BUDGET, NEAREST)
        methods, values = profiled([case])
        assert methods == ["N1", "MD", "MeshLab clustering"]
        scores = case.scores
        assert_array_equal(values, [[scores["N1"].epsilon[1], scores["MD"].epsilon[0], scores[methods[2]].epsilon[0]]])
        fronts["A"]["MD"] = {3: FRONTS["MD"][2]}
        (case,) = Study(store(tmp_path / "other", fronts)).compared(BUDGET, NEAREST)
        assert profiled([case])[1].shape == (0, 2)


LONG = "An algorithm of the reader's own with a rather long name, number "


def study_of(folder, n_models, n_methods):
    """An experiment of many methods with long names, every one a little worse than the one before."""
    models = [f"M{m}, which has a rather long name too" for m in range(n_models)]
    fronts = {
        model: {
            f"{LONG}{k}": {seed: [(e + k + seed / 10, t) for e, t in FRONTS["N1"][1][:2]] for seed in (1, 2, 3)}
            for k in range(n_methods)
        }
        for model in models
    }
    return Study(store(folder, fronts))


SIZES = [(1, 2), (1, 26), pytest.param((6, 12), marks=pytest.mark.slow)]


@pytest.fixture(scope="module", params=SIZES, ids=lambda n: f"{n[0]} models, {n[1]} methods")
def crowd(request, tmp_path_factory):
    study = study_of(tmp_path_factory.mktemp("crowd") / "out", *request.param)
    cases = study.compared(BUDGET, NEAREST)
    for case in cases:
        for seeds in case.sources.values():
            for seed in seeds:
                seeds[seed] = [run_of([100, 200, 400], [0.01, 0.1, 1.0], [OPTIMAL[:1], OPTIMAL[:2], OPTIMAL])]
    return study, cases


DRAWINGS = {
    "fronts": lambda study, cases: fronts_figure(study, cases[0]),
    "hvr": lambda study, cases: box_figure(study, cases, "hvr"),
    "selected": selected_figure,
    "evaluations": lambda study, cases: convergence_figure(study, cases, "evaluations"),
    "seconds": lambda study, cases: convergence_figure(study, cases, "seconds"),
    "critical differences": critical_difference_figure,
    "profile": profile_figure,
}


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_titles_touch_nothing_and_nothing_sticks_out(crowd, drawing):
    figure = DRAWINGS[drawing](*crowd)
    assert overlaps(figure) == ([], [])
    assert BUDGET in figure._suptitle.get_text()
    texts = [text.get_text() for ax in figure.axes for text in ax.texts]
    names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    names += [text.get_text() for ax in figure.axes if ax.get_legend() for text in ax.get_legend().get_texts()]
    names += [label.get_text() for label in figure.axes[0].get_xticklabels()]
    for method in crowd[1][0].runs:
        short = f"{method[:22]}…{method[-14:]}"
        assert any(short == shown.split("  ")[0].strip() for shown in [*texts, *names])


def test_no_two_of_many_methods_look_the_same(tmp_path):
    study = study_of(tmp_path / "out", 1, 20)
    (case,) = study.compared(BUDGET, NEAREST)
    assert len({method_look(study, case, method) for method in case.runs}) == 20


def test_a_diagram_of_critical_differences_has_the_ranks_and_joins_what_is_not_told_apart(crowd):
    study, cases = crowd
    figure = critical_difference_figure(study, cases)
    (ax,) = figure.axes
    methods, found = ranked(cases)
    shown = " ".join(text.get_text() for text in ax.texts)
    for method, rank in zip(methods, found.mean_ranks, strict=True):
        assert f"{method[-14:]}  {rank:.2f} " in shown
    bars = [line for line in ax.get_lines() if line.get_linewidth() == 4]
    assert len(bars) == len(found.groups)
    for bar, group in zip(bars, found.groups, strict=True):
        left, right = bar.get_xdata()
        inside = {k for k, rank in enumerate(found.mean_ranks) if left < rank < right}
        assert inside == set(group)
    assert f"critical difference {found.critical_difference:.2f}" in shown
    if len(cases) == 1:
        assert ax.get_title() == "one case allows no test: p = 1"
        assert "(more than all ranks)" in shown
    else:
        assert "Nemenyi's test at 0.05" in ax.get_title()


def test_convergence_is_the_median_and_the_quartiles_of_the_runs(crowd):
    study, cases = crowd
    figure = convergence_figure(study, cases, "evaluations")
    panel = figure.axes[0]
    line = panel.get_lines()[0]
    assert_allclose(line.get_xdata()[[0, -1]], [100, 400])
    ((_, hvr), *_) = cases[0].progress(next(iter(cases[0].runs)), "evaluations")
    assert_allclose(line.get_ydata()[[0, -1]], hvr[[0, -1]])
    assert to_hex(line.get_color()) == method_look(study, cases[0], next(iter(cases[0].runs)))[0].lower()
    assert "no curve" not in figure._suptitle.get_text()


def test_methods_without_a_curve_are_counted(tmp_path):
    study = Study(store(tmp_path / "out", {"A": FRONTS}, classic={"A": {"vertex_clustering": [(9.0, 30, True)]}}))
    (case,) = study.compared(BUDGET, NEAREST)
    case.sources["N1"] = {1: [SLOW]}
    figure = convergence_figure(study, [case], "seconds")
    assert "1 methods have no curve" in figure._suptitle.get_text().replace("\n", " ")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["N1", "MeshLab clustering"]
    (point,) = (line for line in figure.axes[0].get_lines() if line.get_linestyle() == "None")
    assert_allclose(point.get_data(), [[0.5], case.scores["MeshLab clustering"].hvr])


def test_profiles_end_below_one_where_no_finite_factor_reaches_the_best(crowd, monkeypatch):
    study, cases = crowd
    methods, values = profiled(cases)
    values[::2, 1] = np.inf
    monkeypatch.setattr("meshsimp_pymoo.comparison.figures.profiled", lambda cases: (methods, values))
    lines = profile_figure(study, cases).axes[0].get_lines()
    assert lines[0].get_ydata()[-1] == 1
    assert lines[1].get_ydata()[-1] == np.mean(np.isfinite(values[:, 1])) < 1
    assert lines[1].get_xdata()[-1] > lines[1].get_xdata()[-2]  # drawn on beyond the last factor


def test_figures_show_every_method_and_every_model(tmp_path):
    fronts = {"A": FRONTS, "B": FRONTS}
    classic = {name: {"vertex_clustering": [(9.0, 30, True)]} for name in fronts}
    study = Study(store(tmp_path / "out", fronts, classic=classic))
    cases = study.compared(BUDGET, NEAREST)
    legend = [text.get_text() for text in fronts_figure(study, cases[0]).axes[0].get_legend().get_texts()]
    assert legend == ["pseudo-optimal", "N1", "MD", "MeshLab clustering"]
    for indicator in ("hvr", "cardinality"):
        panels = box_figure(study, cases, indicator).axes
        assert [panel.get_title(loc="left") for panel in panels] == ["A", "B"]
        assert [t.get_text() for t in panels[0].get_xticklabels()] == ["N1", "MD", "MeshLab clustering"]
    figure = selected_figure(study, cases)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["N1", "MD", "MeshLab clustering"]
    for panel in figure.axes:
        points = {(x, y) for line in panel.get_lines()[1:] for x, y in zip(*line.get_data(), strict=True)}
        assert {(20.0, 10.0), (60.0, 0.0), (40.0, 5.0), (30.0, 9.0)} <= points
