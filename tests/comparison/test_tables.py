"""Tables say what the fronts say: fronts made by hand, numbers worked out by hand."""

from __future__ import annotations

import csv
import io
import math
import re

import numpy as np
import pytest
from comparing import INDICATORS, compared
from handmade import BUDGET, store

from meshsimp_pymoo.comparison import tables
from meshsimp_pymoo.comparison.report import write_tables
from meshsimp_pymoo.comparison.study import EPSILON_SHIFT, Study
from meshsimp_pymoo.comparison.study import INDICATORS as NAMES
from meshsimp_pymoo.comparison.tables import Table
from meshsimp_pymoo.errors import ExperimentWarning
from meshsimp_pymoo.report.document import slug

# Optimal together: (10, 20), (5, 40), (0, 60). Normalised by that front: error / 10, (triangles - 20) / 40.
FRONTS = {
    "M_1 & co": {
        "N1": {1: [(10.0, 20), (5.0, 40), (0.0, 60)], 2: [(10.0, 20), (5.0, 40)]},
        "MD": {1: [(5.0, 40)], 2: [(10.0, 40), (0.0, 60)]},
    }
}
NEAREST = "nearest"


@pytest.fixture
def study(tmp_path):
    return Study(store(tmp_path / "out", FRONTS))


def read(table: Table) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(table.csv())))


def test_scores_are_means_and_deviations_over_the_runs(study):
    rows = {row["method"]: row for row in read(tables.scores(study, BUDGET, NEAREST))}
    # all: 1.1 * 0.1 + 0.6 * 0.5 + 0.1 * 0.5 = 0.46; without the last point, 0.1 of width is lost in between
    whole = 0.1 * 0.5 + 0.6 * 0.5 + 1.1 * 0.1
    first, second = 1.0, (0.1 * 0.5 + 0.6 * 0.6) / whole
    assert float(rows["N1"]["hvr_mean"]) == pytest.approx((first + second) / 2)
    assert float(rows["N1"]["hvr_sd"]) == pytest.approx(abs(first - second) / math.sqrt(2))
    assert [rows["N1"][k] for k in ("runs", "cardinality_mean", "merged_cardinality")] == ["2", "2.5", "3"]
    assert float(rows["N1"]["merged_hvr"]) == pytest.approx(1.0)
    assert float(rows["N1"]["coverage_mean"]) == pytest.approx((1 + 2 / 3) / 2)
    assert float(rows["MD"]["coverage_mean"]) == pytest.approx((1 / 3 + 1 / 3) / 2)
    assert float(rows["MD"]["optimal_share"]) == pytest.approx(2 / 3)
    # the second run has no error of 0: its epsilon is (5 + s) / s, s being the shift; the first run has 1
    shift = EPSILON_SHIFT * 10
    assert float(rows["N1"]["epsilon_mean"]) == pytest.approx((1 + (5 + shift) / shift) / 2)
    assert rows["N1"]["evaluations_mean"] == "900.0"


def test_coverage_and_epsilon_are_over_all_pairs_of_runs(study):
    cells = {(row["a"], row["b"]): row for row in read(tables.coverage(study, BUDGET, NEAREST))}
    # N1 run 1 covers both runs of MD wholly, run 2 all of the first and half of the second
    assert float(cells["N1", "MD"]["mean"]) == pytest.approx((1 + 1 + 1 + 0.5) / 4)
    # MD's first run covers 1 of 3 and 1 of 2, its second 1 of 3 and none
    assert float(cells["MD", "N1"]["mean"]) == pytest.approx((1 / 3 + 1 / 2 + 1 / 3 + 0) / 4)
    assert cells["N1", "MD"]["pairs"] == "4"
    cells = {(row["a"], row["b"]): row for row in read(tables.epsilon(study, BUDGET, NEAREST))}
    assert cells["N1", "MD"]["mean_without_shift"] == "inf"
    assert math.isfinite(float(cells["N1", "MD"]["mean"]))
    assert float(cells["N1", "MD"]["median_without_shift"]) == 1.0
    markdown = tables.coverage(study, BUDGET, NEAREST).markdown().splitlines()
    assert markdown[2] == "| model |  | N1 | MD |"
    assert markdown[4] == "| M_1 & co | N1 |  | 0.875 (0.25) |"


def test_the_tests_are_the_analysis_own(study):
    rows = read(tables.wilcoxon(study, BUDGET, NEAREST))
    case = study.cases["M_1 & co", BUDGET, NEAREST]
    for indicator in INDICATORS:
        expected = compared(case.runs, "N1", "MD", indicator, case.optimal)
        (row,) = [r for r in rows if r["indicator"] == NAMES[indicator]]
        assert (row["a"], row["b"]) == ("N1", "MD")
        assert float(row["p"]) == expected.p
        assert float(row["a12"]) == expected.a12
        assert float(row["mean_a"]) == pytest.approx(expected.sample_a.mean())
    assert len(rows) == len(NAMES) == 9
    assert {row["p_signed_rank"] for row in rows if row["indicator"] == "HVR"} == {"0.5"}  # two pairs: 2 / 2 ** 2
    (row,) = [r for r in rows if r["indicator"] == "epsilon to the pseudo-optimal front"]
    assert float(row["mean_a"]) > float(row["mean_b"])  # negated: larger is better


@pytest.mark.parametrize(("n_models", "n_methods", "least"), [(1, 2, 6), (2, 3, 3), (2, 5, 3), (5, 2, 6)])
def test_where_the_ranks_of_so_few_models_can_tell_nothing_apart_that_is_said_below(
    tmp_path, n_models, n_methods, least
):
    fronts = {f"m{n}": {f"N{k}": {1: [(1 + k / 10, 20)]} for k in range(n_methods)} for n in range(n_models)}
    table = tables.ranking(Study(store(tmp_path / "few", fronts)), BUDGET, NEAREST)
    models = "1 model" if n_models == 1 else f"{n_models} models"
    said = f"With {models} Nemenyi's test cannot tell {n_methods} methods apart, however they rank; at least {least} "
    assert table.markdown().endswith(f"|\n\n{said}models are needed.\n")
    assert f"\\par {said}" in table.latex()
    assert said not in table.csv()
    enough = {f"m{n}": fronts["m0"] for n in range(least)}
    table = tables.ranking(Study(store(tmp_path / "enough", enough)), BUDGET, NEAREST)
    assert table.note == ""
    assert [row["not_told_apart_from_best"] for row in read(table)][-1] == ""  # where all agree, the last is told apart


def test_of_a_large_table_people_are_shown_some_columns_by_names_of_their_own():
    table = Table("t", "A title", ("a", "b", "c"), ((1, 2.0, "x"), (3, 4.0, "y")))
    part = table.part({"c": "third", "a": "first"}, table.rows[1:])
    assert (part.title, part.columns, part.rows) == ("A title", ("third", "first"), (("y", 3),))


def test_selected_solutions_come_with_their_numbers_and_the_run_that_found_them(study):
    rows = {(r["method"], r["solution"]): r for r in read(tables.selected(study, BUDGET, NEAREST))}
    least, fewest = rows["MD", "least error"], rows["N1", "fewest triangles"]
    assert (least["error"], least["triangles"], least["seed"], least["uncovered"]) == ("0.0", "60", "2", "3")
    assert (fewest["error"], fewest["triangles"], fewest["found_in_runs"]) == ("10.0", "20", "2")
    assert rows["N1", "trade off"]["triangles"] in ("20", "40", "60")
    # alpha weighs the triangles by 10 / 40: sums of halves are 7.5, 7.5, 7.5 ... all alike, so the fewest triangles
    assert rows["N1", "trade off"]["triangles"] == "20"
    # both merged fronts hold a mesh without error
    assert tables.selected(study, BUDGET, NEAREST).title.endswith("undefined for 2, which hold a mesh without error")


def test_the_papers_trade_off_is_beside_ours_where_it_is_defined(tmp_path):
    fronts = {"M": {"N1": {1: [(8.0, 2), (4.0, 4), (1.0, 10)]}, "MD": {1: [(8.0, 2), (0.0, 20)]}}}
    table = tables.selected(Study(store(tmp_path / "out", fronts)), BUDGET, NEAREST)
    rows = {(r["method"], r["solution"]): r for r in read(table)}
    # by Eq. 10 alpha = (2 / 8 + 4 / 4 + 10 / 1) / 3 = 3.75; by the ranges of all, 8 / 18, (E + alpha T) = 8.9, 5.8, 5.4
    assert rows["N1", "trade off paper"]["triangles"] == "10"
    assert rows["N1", "trade off"]["triangles"] == "10"
    assert ("MD", "trade off paper") not in rows
    assert table.title.endswith("the paper's trade-off is undefined for 1, which hold a mesh without error")


def test_uncovered_vertices_cost_under_one_scoring_and_not_under_the_other(tmp_path):
    classic = {"M_1 & co": {"quadric_collapse": [(1.0, 50, True), (0.5, 2, False)]}}
    study = Study(store(tmp_path / "out", FRONTS, outside="ignore", nearest=3.0, classic=classic))
    assert study.scorings == ["searched", "nearest"]
    searched = study.cases["M_1 & co", BUDGET, "searched"]
    nearest = study.cases["M_1 & co", BUDGET, "nearest"]
    assert searched.runs["N1"][2][:, 0].tolist() == [10.0, 5.0]
    assert nearest.runs["N1"][2][:, 0].tolist() == [30.0, 15.0]
    # the mesh of 2 triangles, which abandons the model, is compared only where that costs
    assert searched.runs["MeshLab quadric"][0].tolist() == [[1.0, 50.0]]
    assert nearest.runs["MeshLab quadric"][0].tolist() == [[1.5, 2.0]]
    row = read(tables.baselines(study, BUDGET))[0]
    assert (row["asked"], row["triangles"], row["series"], row["uncovered"]) == ("50", "50", "paper", "3")
    assert (row["error_as_searched"], row["error_every_vertex"]) == ("1.0", "3.0")
    assert float(row["uncovered_share"]) == pytest.approx(3 / 9)
    assert (row["evolution_error_every_vertex"], row["evolution_method"]) == ("15.0", "N1")
    assert read(tables.baselines(study, BUDGET))[1]["evolution_method"] == ""


def test_every_method_keeps_its_row_in_every_table(tmp_path):
    classic = {"M_1 & co": {"vertex_clustering": [(9.0, 30, True)]}}
    study = Study(store(tmp_path / "out", FRONTS, classic=classic))
    for make in (tables.scores, tables.coverage, tables.epsilon, tables.selected):
        column = "a" if make in (tables.coverage, tables.epsilon) else "method"
        assert {row[column] for row in read(make(study, BUDGET, NEAREST))} == {"N1", "MD", "MeshLab clustering"}


def test_times_are_in_no_other_table(study):
    assert "seconds" in read(tables.times(study))[0]
    for table in (tables.runs(study), tables.scores(study, BUDGET, NEAREST)):
        assert "seconds" not in table.columns
    assert [row["seconds"] for row in read(tables.times(study))][:2] == ["1.01", "1.02"]


def test_the_three_formats_hold_the_same_and_latex_is_escaped():
    rows = (("M_1 & 5 %", 1 / 3, 2, None), ("b|c", math.inf, 30, "x"), ("d", math.nan, 4, "y"))
    table = Table("t_1", "100 % of #1", ("model", "value", "n", "note"), rows)
    assert table.csv().splitlines()[1:] == ["M_1 & 5 %,0.3333333333333333,2,", "b|c,inf,30,x", "d,,4,y"]
    markdown = table.markdown().splitlines()
    assert markdown[3] == "|---|---:|---:|---|"
    assert markdown[4:] == ["| M_1 & 5 % | 0.3333 | 2 |  |", r"| b\|c | inf | 30 | x |", "| d |  | 4 | y |"]
    latex = table.latex()
    assert r"M\_1 \& 5 \% & 0.3333 & 2 &  \\" in latex
    assert r"\caption{100 \% of \#1}" in latex
    assert r"\begin{tabular}{lrrl}" in latex
    assert not re.search(r"(?<!\\)[%#_]", latex.replace(r"\label{tab:t_1}", ""))


def test_numbers_are_rounded_for_people_only():
    table = Table("t", "t", ("x",), ((12345.678,), (0.00012345678,), (1e9,), (float(np.float64(2.0)),)))
    assert [line.strip("| ") for line in table.markdown().splitlines()[4:]] == ["12346", "0.0001235", "1e+09", "2"]
    assert table.csv().split() == ["x", "12345.678", "0.00012345678", "1000000000.0", "2.0"]


def test_a_run_without_a_mesh_is_named_and_left_out(tmp_path):
    fronts = {"A": {"N1": {1: [(1.0, 2)], 2: []}}}
    out = store(tmp_path / "out", fronts)
    with pytest.warns(ExperimentWarning, match="without a mesh: A / N1 / seed 2"):
        write_tables(study := Study(out))
    assert set(study.cases["A", BUDGET, NEAREST].runs["N1"]) == {1}


def test_one_run_of_one_method_is_report_enough(tmp_path):
    out = store(tmp_path / "out", {"A": {"X": {7: [(1.0, 2)]}}})
    (out / ".tables.0123abcd.old").mkdir()  # of reports that were killed
    (out / ".tables.4567abcd.partial").mkdir()
    write_tables(Study(out))
    assert not list(out.glob(".tables.*"))
    scores = (out / "tables" / slug(BUDGET) / NEAREST / "scores.csv").read_text()
    assert scores.splitlines()[1].startswith("A,X,1,1.0,,1.0,,1.0,,1.0,,1.0,")
    assert "| X | own |" in (out / "findings.md").read_text()
