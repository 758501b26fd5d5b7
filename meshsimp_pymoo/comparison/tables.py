"""The tables of an experiment: the same numbers as CSV, Markdown and LaTeX, the same bytes for the same runs.

========== =====================================================================================
table      content
========== =====================================================================================
ranking    all methods by the mean rank of their HVR over the models, and which the ranks tell apart
scores     every method against the pseudo-optimal front: HVR, epsilon, coverage, cardinality
coverage   C between the runs of every two methods (the paper's Table 1)
epsilon    multiplicative epsilon between the runs of every two methods (the paper's Table 2)
wilcoxon   every two methods with chance, by rank sums: raw and corrected p, effect size, who is better; and
           the p of the signed-rank test, by seeds
selected   least error, fewest triangles, best trade-off (by the ranges, and by the paper's Eq. 11) and knees of
           every method
baselines  the meshes of the methods without chance, with the vertices that they leave uncovered
runs       every run: solutions, generations, evaluations
========== =====================================================================================

Measured seconds are in none of them: `times` makes a table of its own, times.csv beside the folder of tables.
CSV has all digits; Markdown and LaTeX are rounded to four.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from meshsimp_pymoo.comparison.analysis import PairTable, selected_solutions
from meshsimp_pymoo.comparison.statistics import Summary, least_cases, magnitude, signed_rank, summarise
from meshsimp_pymoo.comparison.study import (
    CLASSIC_NAMES,
    EPSILON_SHIFT,
    INDICATORS,
    SCORINGS,
    Case,
    Study,
    on_all_models,
    ranked,
)
from meshsimp_pymoo.surface.measures import MEASURES, OF_LINES, OF_MESH

__all__ = [
    "COMPARISONS",
    "Table",
    "baselines",
    "coverage",
    "epsilon",
    "ranking",
    "runs",
    "scores",
    "selected",
    "times",
    "wilcoxon",
    "write_table",
]

Cell = str | int | float | None

DIGITS = 4
# The columns of what is measured of a mesh beside the error that was minimised, by their heading.
AS_SEARCHED = {
    f"{name.removesuffix('_error')}_as_searched" if measure.of else name: name
    for name, measure in MEASURES.items()
    if name in OF_MESH or (measure.is_error and name not in ("error", *OF_LINES))
}


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    name : str
        Name of its files.
    title : str
        One line.
    columns : tuple of str
        Headers.
    rows : tuple of tuples
        Text, whole numbers, floats, or None for an empty cell.
    shown : Table, optional
        The table to show to people, where it is laid out differently from the one for programs.
    note : str
        A sentence below it, for people; mostly empty.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    shown: Table | None = None
    note: str = ""

    def part(self, headings: Mapping[str, str], rows: Sequence[tuple[Cell, ...]]) -> Table:
        """Return some of its columns, by their headings for people, of some of its rows."""
        places = [self.columns.index(column) for column in headings]
        shown = tuple(tuple(row[place] for place in places) for row in rows)
        return Table(self.name, self.title, tuple(headings.values()), shown, note=self.note)

    def csv(self) -> str:
        """Return the table for programs, floats with all their digits."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([[_inert(cell) for cell in row] for row in self.rows])
        return text.getvalue()

    def markdown(self) -> str:
        """Return the table for people, in GitHub's Markdown."""
        if self.shown is not None:
            return self.shown.markdown()
        lines = [f"**{markdown_text(self.title)}**", "", _piped(self.columns)]
        lines.append("|" + "|".join("---:" if right else "---" for right in self.right_aligned) + "|")
        lines += [_piped(row) for row in self.rounded_rows]
        lines += ["", markdown_text(self.note)] if self.note else []
        return "\n".join(lines) + "\n"

    def latex(self) -> str:
        """Return the table for papers; needs the package booktabs."""
        if self.shown is not None:
            return self.shown.latex()
        alignment = "".join("r" if right else "l" for right in self.right_aligned)
        lines = [
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{_escaped(self.title)}}}",
            rf"\label{{tab:{self.name}}}",
            rf"\begin{{tabular}}{{{alignment}}}",
            r"\toprule",
            " & ".join(_escaped(header) for header in self.columns) + r" \\",
            r"\midrule",
        ]
        lines += [" & ".join(_escaped(cell) for cell in row) + r" \\" for row in self.rounded_rows]
        lines += [r"\bottomrule", r"\end{tabular}"]
        lines += [rf"\par {_escaped(self.note)}"] if self.note else []
        lines += [r"\end{table}"]
        return "\n".join(lines) + "\n"

    @property
    def rounded_rows(self) -> list[list[str]]:
        """The cells as people read them."""
        return [[_rounded(cell) for cell in row] for row in self.rows]

    @property
    def right_aligned(self) -> list[bool]:
        """Which columns are right-aligned: those without a word."""
        return [
            all(not isinstance(row[k], str) or row[k][:1].isdigit() for row in self.rows)  # type: ignore[index]
            for k in range(len(self.columns))
        ]


def write_table(folder: Path, table: Table) -> None:
    """Write a table as NAME.csv, NAME.md and NAME.tex."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{table.name}.csv").write_text(table.csv(), encoding="utf-8")
    (folder / f"{table.name}.md").write_text(table.markdown(), encoding="utf-8")
    (folder / f"{table.name}.tex").write_text(table.latex(), encoding="utf-8")


def scores(study: Study, budget: str, scoring: str) -> Table:
    """Return every method's indicators against the pseudo-optimal front of its model, mean and deviation."""
    columns = (
        "model", "method", "runs", "hvr_mean", "hvr_sd", "epsilon_mean", "epsilon_sd", "coverage_mean",
        "coverage_sd", "cardinality_mean", "cardinality_sd", "merged_hvr", "merged_epsilon",
        "merged_coverage", "merged_cardinality", "optimal_share", "evaluations_mean", "measured_by", "note",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    shown: list[tuple[Cell, ...]] = []
    for case in study.compared(budget, scoring):
        for method, values in case.scores.items():
            hvr, eps = summarise(values.hvr), summarise(values.epsilon)
            cover, count = summarise(values.coverage), summarise(values.cardinality)
            evaluations = None if method in case.classic else float(case.evaluations(method).mean())
            rows.append(
                (
                    case.problem.name, method, len(values.seeds), hvr.mean, hvr.std, eps.mean, eps.std,
                    cover.mean, cover.std, count.mean, count.std, values.merged_hvr, values.merged_epsilon,
                    values.merged_coverage, values.merged_cardinality, case.optimal.share(method),
                    evaluations, _measured_by(case, method), eps.note if math.isinf(eps.mean) else "",
                )
            )  # fmt: skip
            shown.append(
                (
                    case.problem.name, method, len(values.seeds), _spread(hvr), _spread(eps), _spread(cover),
                    _spread(count), values.merged_hvr, values.merged_cardinality,
                    None if evaluations is None else round(evaluations), _measured_by(case, method),
                )
            )  # fmt: skip
    title = f"Scores against the pseudo-optimal front ({_setting(budget, scoring)}; mean (sd) over runs)"
    headers = (
        "model", "method", "runs", "HVR", "epsilon", "coverage", "cardinality", "HVR merged",
        "cardinality merged", "evaluations", "measured by",
    )  # fmt: skip
    return Table("scores", title, columns, tuple(rows), Table("scores", title, headers, tuple(shown)))


def _measured_by(case: Case, method: str) -> str:
    """Return what a method's work is counted in; of a method without chance, nothing is."""
    if method in case.classic:
        return ""
    return "moves" if case.moves(method) else "evaluations"


def ranking(study: Study, budget: str, scoring: str) -> Table:
    """Return the comparison of all methods in one table: the mean rank of their median HVR over the models."""
    cases = study.compared(budget, scoring)
    medians = [{method: float(np.median(scores.hvr)) for method, scores in case.scores.items()} for case in cases]
    ranks: dict[str, float] = {}
    alike: set[str] = set()
    said, note = "no two methods on all models", ""
    if len(on_all_models(cases)) > 1:
        methods, found = ranked(cases)
        ranks = dict(zip(methods, map(float, found.mean_ranks), strict=True))
        best = int(np.argmin(found.mean_ranks))
        alike = {methods[k] for group in found.groups if best in group for k in group} | {methods[best]}
        said = f"Friedman p = {found.p:.2g}, critical difference {found.critical_difference:.3g}"
        if len(cases) < (least := least_cases(len(methods))):
            models = "1 model" if len(cases) == 1 else f"{len(cases)} models"
            note = f"With {models} Nemenyi's test cannot tell {len(methods)} methods apart, however they rank; "
            note += f"at least {least} models are needed."
    columns = (
        "method", "kind", "mean_rank", "hvr_median", "best_on", "models", "evaluations_mean", "measured_by",
        "not_told_apart_from_best",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for method in dict.fromkeys(method for case in cases for method in case.runs):
        there = [(case, values) for case, values in zip(cases, medians, strict=True) if method in values]
        chance = [case for case, _ in there if method not in case.classic]
        rows.append(
            (
                method, study.kind(method), ranks.get(method), float(np.mean([values[method] for _, values in there])),
                sum(values[method] == max(values.values()) for _, values in there), len(there),
                float(np.mean([case.evaluations(method).mean() for case in chance])) if chance else None,
                _measured_by(there[0][0], method), "yes" if method in alike else "",
            )
        )  # fmt: skip
    rows.sort(key=lambda row: (ranks.get(str(row[0]), math.inf), str(row[0])))
    title = f"All methods, by the mean rank of their HVR over the models ({_setting(budget, scoring)}; {said})"
    names = {
        "method": "method", "kind": "kind", "mean_rank": "mean rank", "hvr_median": "HVR", "best_on": "best on",
        "models": "of models", "evaluations_mean": "evaluations a front", "measured_by": "measured by",
        "not_told_apart_from_best": "not told apart from the best",
    }  # fmt: skip
    table = Table("ranking", title, columns, tuple(rows), note=note)
    return replace(table, shown=table.part(names, [(*row[:6], _round_or_none(row[6]), *row[7:]) for row in rows]))


def coverage(study: Study, budget: str, scoring: str) -> Table:
    """Return the coverage between the runs of every two methods, as in the paper's Table 1."""
    title = f"Coverage C of the column's runs by the row's ({_setting(budget, scoring)}; mean (sd) over pairs)"
    return _pairs("coverage", title, study.compared(budget, scoring), lambda case: case.coverage)


def epsilon(study: Study, budget: str, scoring: str) -> Table:
    """Return the multiplicative epsilon between the runs of every two methods, as in the paper's Table 2."""
    title = (
        f"Epsilon I(row, column), {EPSILON_SHIFT:.0%} of the largest error added to every error; 1 or less: the row "
        f"covers the column ({_setting(budget, scoring)}; mean (sd) over pairs)"
    )
    cases = study.compared(budget, scoring)
    table = _pairs("epsilon", title, cases, lambda case: case.epsilon)
    literal = _pairs("epsilon", title, cases, lambda case: case.literal_epsilon)
    columns = (*table.columns[:-1], "mean_without_shift", "median_without_shift", "note")
    rows = tuple((*row[:-1], other[3], other[5], other[7]) for row, other in zip(table.rows, literal.rows, strict=True))
    return Table("epsilon", title, columns, rows, table.shown)


def wilcoxon(study: Study, budget: str, scoring: str) -> Table:
    """Return all rank-sum tests; each indicator is a family of its own for Holm's correction."""
    columns = (
        "model", "indicator", "a", "b", "mean_a", "mean_b", "p", "p_holm", "a12", "effect", "better",
        "better_holm", "p_signed_rank", "note",
    )  # fmt: skip
    rows = [
        (
            c.model, INDICATORS[indicator], c.a, c.b, float(np.mean(c.sample_a)),
            float(np.mean(c.sample_b)), c.p, c.p_holm, c.a12, magnitude(c.a12), c.winner, c.winner_holm,
            signed_rank(c.sample_a, c.sample_b).p if len(c.sample_a) == len(c.sample_b) else None, c.note,
        )
        for indicator in INDICATORS
        for c in study.comparisons(budget, scoring, indicator)
    ]  # fmt: skip
    title = f"Wilcoxon rank-sum tests ({_setting(budget, scoring)}); samples so that larger is better"
    return Table("wilcoxon", title, columns, tuple(rows))


def selected(study: Study, budget: str, scoring: str) -> Table:
    """Return the paper's three solutions of every method, and its knees."""
    columns = (
        "model", "method", "solution", "error", "triangles", "vertices", "uncovered", "error_as_searched",
        *AS_SEARCHED, "error_every_vertex", "seed", "found_in_runs",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    undefined = 0
    for case in study.compared(budget, scoring):
        chosen = selected_solutions(case.runs, optimal=case.optimal)
        for method, solutions in chosen.items():
            undefined += all(solution.kind != "trade_off_paper" for solution in solutions)
            for solution in solutions:
                found = case.find(method, solution.error, solution.triangles)
                rows.append(
                    (
                        case.problem.name, method, solution.kind.replace("_", " "), solution.error,
                        solution.triangles, int(found.number("vertices")), int(found.number("uncovered")),
                        float(found.run.arrays["F"][found.row, 0]), *map(found.number, AS_SEARCHED.values()),
                        found.number("error_nearest"), None if method in case.classic else found.seed,
                        len(solution.seeds),
                    )
                )  # fmt: skip
    title = f"Selected solutions of the merged fronts ({_setting(budget, scoring)})"
    if undefined:
        title += f"; the paper's trade-off is undefined for {undefined}, which hold a mesh without error"
    shown_columns = {
        "model": "model", "method": "method", "solution": "solution", "triangles": "triangles",
        "error_as_searched": "error as searched", "error_every_vertex": "error, every vertex",
        "uncovered": "uncovered", "seed": "seed",
    }  # fmt: skip
    table = Table("selected", title, columns, tuple(rows))
    return replace(table, shown=table.part(shown_columns, [row for row in rows if row[2] != "knee"]))


COMPARISONS: tuple[Callable[[Study, str, str], Table], ...] = (ranking, scores, coverage, epsilon, wilcoxon, selected)
"""The tables of one budget and scoring."""


def baselines(study: Study, budget: str) -> Table | None:
    """Return the baselines' meshes of the sizes asked for, and the least error of an evolutionary one no larger.

    None if there is no such mesh. The last columns compare by the error of every vertex.
    """
    columns = (
        "model", "method", "series", "asked", "triangles", "vertices", "error_as_searched", "error_every_vertex",
        *AS_SEARCHED, "uncovered", "uncovered_share",
        "evolution_error_every_vertex", "evolution_method", "note",
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for problem in study.problems:
        case = study.cases.get((problem.name, budget, "nearest"))
        for (name, method), run in study.classic_runs.items():
            if name != problem.name:
                continue
            for k, asked in enumerate(run.arrays["asked"].tolist()):
                if not asked:  # of a whole front, between the sizes that all are asked for
                    continue
                a, (error, triangles) = run.arrays, run.arrays["F"][k]
                label, note = CLASSIC_NAMES[method], run.record["notes"][k]
                series = "paper" if a["paper"][k] else "down to the fronts"
                if not triangles:
                    rows.append((name, label, series, asked, 0, *[None] * (len(columns) - 6), note))
                    continue
                best, by = _best_up_to(case, triangles)
                rows.append(
                    (
                        name, label, series, asked, int(triangles), int(a["vertices"][k]), float(error),
                        float(a["error_nearest"][k]), *(float(a[measure][k]) for measure in AS_SEARCHED.values()),
                        int(a["uncovered"][k]),
                        float(a["uncovered"][k] / problem.vertices), best, by, note,
                    )
                )  # fmt: skip
    if not rows:
        return None
    title = f"Meshes of the baselines, and the best evolutionary one of at most as many triangles ({budget})"
    shown_columns = {
        "model": "model", "method": "method", "asked": "asked", "triangles": "triangles",
        "error_as_searched": "error as searched", "error_every_vertex": "error, every vertex",
        "uncovered": "uncovered", "evolution_error_every_vertex": "evolution, every vertex", "evolution_method": "by",
    }  # fmt: skip
    table = Table("baselines", title, columns, tuple(rows))
    return replace(table, shown=table.part(shown_columns, rows))


def runs(study: Study) -> Table:
    """Return all evolutionary runs."""
    columns = (
        "model", "method", "merged_value", "seed", "budget", "solutions", "generations", "evaluations", "key",
    )  # fmt: skip
    rows = []
    for run in study.all_runs:
        record, merged = run.record, run.record["description"]["algorithm"].get("merged", {})
        rows.append(
            (
                record["problem"], record["algorithm"], next(iter(merged.values()), None), record["seed"],
                record["budget"], len(run.arrays["F"]), record["generations"], record["evaluations"],
                run.path.stem.rpartition(".")[2],
            )
        )  # fmt: skip
    return Table("runs", "All runs", columns, tuple(rows))


def times(study: Study) -> Table:
    """Return the measured seconds of every run; unlike all other tables, these are never the same twice."""
    columns = ("model", "method", "merged_value", "seed", "budget", "evaluations", "seconds")
    rows: list[tuple[Cell, ...]] = []
    for run in study.all_runs:
        record, merged = run.record, run.record["description"]["algorithm"].get("merged", {})
        rows.append(
            (
                record["problem"], record["algorithm"], next(iter(merged.values()), None), record["seed"],
                record["budget"], record["evaluations"], record["seconds"],
            )
        )  # fmt: skip
    for (problem, method), run in study.classic_runs.items():
        rows.append((problem, CLASSIC_NAMES[method], None, None, None, None, run.record["seconds"]))
    return Table("times", "Measured seconds", columns, tuple(rows))


def _pairs(name: str, title: str, cases: Sequence[Case], table_of: Callable[[Case], PairTable]) -> Table:
    """Return a binary indicator: one row for each pair, shown as one square for each model."""
    rows: list[tuple[Cell, ...]] = []
    shown: list[tuple[Cell, ...]] = []
    methods = list(dict.fromkeys(method for case in cases for method in case.runs))
    for case in cases:
        table = table_of(case)
        for a in table.methods:
            square: list[Cell] = []
            for b in methods:
                if a == b or b not in table.methods:
                    square.append(None)
                    continue
                cell = table.cell(a, b)
                values = table.values[a, b]
                rows.append((case.problem.name, a, b, cell.mean, cell.std, float(np.median(values)), cell.n, cell.note))
                square.append(_spread(cell))
            shown.append((case.problem.name, a, *square))
    columns = ("model", "a", "b", "mean", "sd", "median", "pairs", "note")
    return Table(name, title, columns, tuple(rows), Table(name, title, ("model", "", *methods), tuple(shown)))


def _best_up_to(case: Case | None, triangles: float) -> tuple[float | None, str | None]:
    """Return the least error of an evolutionary solution with at most so many triangles, and whose it is."""
    best: tuple[float | None, str | None] = (None, None)
    for method, seeds in case.evolutionary.items() if case is not None else ():
        for F in seeds.values():
            errors = F[F[:, 1] <= triangles, 0]
            if len(errors) and (best[0] is None or errors.min() < best[0]):
                best = float(errors.min()), method
    return best


def _round_or_none(cell: Cell) -> Cell:
    return round(cell) if isinstance(cell, float) else cell


def _setting(budget: str, scoring: str) -> str:
    return f"{budget}, error {SCORINGS[scoring]}"


def _spread(summary: Summary) -> str:
    mean = _rounded(summary.mean)
    return mean if math.isnan(summary.std) else f"{mean} ({summary.std:.2g})"


# What a spreadsheet takes for the beginning of a formula.
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def _inert(cell: Cell) -> str:
    """Return a cell that no spreadsheet takes for a formula: a name that begins like one is quoted by an apostrophe."""
    text = "" if cell is None else _full(cell)
    return f"'{text}" if isinstance(cell, str) and text[:1] in FORMULA else text


def _full(cell: str | int | float) -> str:
    """Return a cell with all its digits; NaN, where there is no number, as nothing."""
    if isinstance(cell, float):
        return "" if math.isnan(cell) else repr(float(cell))
    return str(cell)


def _rounded(cell: Cell) -> str:
    if cell is None:
        return ""
    if not isinstance(cell, float):
        return str(cell)
    if math.isnan(cell):
        return ""
    return f"{cell:.0f}" if 10 ** (DIGITS - 1) <= abs(cell) < 1e7 else f"{cell:.{DIGITS}g}"


def _piped(cells: Sequence[str]) -> str:
    return "| " + " | ".join(markdown_text(cell) for cell in cells) + " |"


def markdown_text(text: str) -> str:
    r"""Return a text in which nothing is a tag, a link or the end of a cell to Markdown.

    >>> markdown_text("<b> [a](javascript:b) | c_d 5 < 6")
    '&lt;b> \\[a\\](javascript:b) \\| c_d 5 &lt; 6'
    """
    spelled = " ".join(text.split()).replace("<", "&lt;").replace("\\", "\\\\")
    for sign in "|[]`":
        spelled = spelled.replace(sign, f"\\{sign}")
    return spelled


def _escaped(text: str) -> str:
    r"""Return a text in which no character means anything to LaTeX.

    >>> print(_escaped("5 % of M_1"))
    5 \% of M\_1
    """
    special = {
        "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{",
        "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    }  # fmt: skip
    return "".join(special.get(c, c) for c in text)
