"""What README.md beside this file says in numbers and the report's own tables do not: made from stored runs.

meshsimp run configs/scans.yaml --models FOLDER -o results --jobs 2
python tests/comparison/reading.py results
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.comparison.findings import CLAIMS, DOES_NOT_HOLD, HOLDS, UNDECIDED, findings, papers_cases, times
from meshsimp_pymoo.comparison.study import PROCEDURES, Case, Start, Study
from meshsimp_pymoo.indicators import merged_front
from meshsimp_pymoo.search.greedy import thinning

FloatArray = npt.NDArray[np.float64]

BUDGET = "50 generations"
SEARCHED = "searched"

# The founding paper's Tables 1 and 2: NSGA-II v1 over MOEA/D, and the reverse, for its models M1 to M6.
PAPER_COVERAGE = ((0.57, 0.34), (0.38, 0.50), (0.59, 0.21), (0.42, 0.48), (0.28, 0.16), (0.37, 0.56))
PAPER_EPSILON = ((1.016, 1.019), (1.045, 0.991), (1.061, 1.104), (1.039, 1.256), (1.041, 1.051), (1.031, 1.053))

# (preset, triangles, error) of the solutions of M1 that the paper prints: the ends of two merged fronts.
PAPER_M1 = (("nsga2_v2", 387, 3829.92), ("nsga2_v2", 276, 4061.76), ("moead", 401, 3808), ("moead", 297, 4033))

# The tools in the tables, of each the variants that matter.
TOOLS = (
    "MeshLab quadric", "MeshLab quadric, unit size", "MeshLab quadric, border kept", "MeshLab clustering",
    "meshoptimizer, border locked", "fast-simplification, border kept",
)  # fmt: skip

SHORT = {
    "hvr": "HVR", "epsilon_optimal": "ε*", "epsilon": "ε", "coverage": "C", "cardinality": "", "extent": "",
    "least_error": "error", "trade_off": "trade-off", "fewest_triangles": "triangles",
}  # fmt: skip
SIGNS = {HOLDS: "holds", DOES_NOT_HOLD: "**not**", UNDECIDED: "open"}


def table(head: list[str], rows: list[list[str]], words: int = 1) -> Iterator[str]:
    """Yield the lines of a Markdown table; its first columns are text, the others are numbers."""
    yield f"| {' | '.join(head)} |"
    yield "|---" * words + "|---:" * (len(head) - words) + "|"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def pair(forth: float, back: float, digits: int = 2) -> str:
    return f"{forth:.{digits}f} / {back:.{digits}f}"


def verdicts(study: Study) -> Iterator[str]:
    """The findings in short: for each procedure and start the verdict by each indicator."""
    found = findings(study, BUDGET, SEARCHED)
    rows = []
    for claim in CLAIMS:
        for procedure in claim.procedures:
            row = [claim.text, claim.section, PROCEDURES[procedure]]
            for start in study.starts:
                here = [f for f in found if (f.claim, f.procedure, f.start) == (claim, procedure, start.name)]
                row.append("; ".join(_grouped({SHORT[f.indicator]: SIGNS[f.verdict] for f in here})))
            rows.append(row)
    yield from table(["the paper", "Sec.", "procedure", *(start.name for start in study.starts)], rows, words=5)
    yield ""
    for f in times(study, BUDGET):
        yield f"* {f.claim.text}, {f.start}: {f.verdict}. {f.reason}"


def _grouped(by_indicator: dict[str, str]) -> Iterator[str]:
    for verdict in SIGNS.values():
        names = [name for name, other in by_indicator.items() if other == verdict]
        if names:
            yield f"{verdict} {'by ' if any(names) else ''}{', '.join(names)}".strip()


def papers_tables(study: Study) -> Iterator[str]:
    """The paper's Tables 1 and 2 beside ours, mean over all pairs of runs, and of the merged fronts."""
    rows = []
    by_start = [papers_cases(study, start, BUDGET, SEARCHED) for start in study.starts]
    for k, problem in enumerate(study.problems):
        row = [problem.name, pair(*PAPER_COVERAGE[k])]
        shown: dict[str, list[str]] = {"C": [], "epsilon": []}
        for start, cases in zip(study.starts, by_start, strict=True):
            a, b = start.roles["nsga2_v1"], start.roles["moead"]
            for case in (cases[k], cases[k].merged):
                cover, literal = case.coverage.values, case.literal_epsilon.values
                shown["C"].append(pair(cover[a, b].mean(), cover[b, a].mean()))
                shown["epsilon"].append(pair(float(np.median(literal[a, b])), float(np.median(literal[b, a]))))
        rows.append([*row, *shown["C"], pair(*PAPER_EPSILON[k], 3), *shown["epsilon"]])
    columns = [
        f"{what} {start.name.removeprefix('start at ')}" for start in study.starts for what in ("runs", "merged")
    ]
    head = ["model", "C, paper", *(f"C, {name}" for name in columns), "ε, paper", *(f"ε, {name}" for name in columns)]
    yield from table(head, rows)


def starts(study: Study) -> Iterator[str]:
    """What the first population does to HVR, cardinality and the span of triangles of a run."""
    rows = []
    for role in ("nsga2_v1", "nsga2_v2", "moead", "weighted_ga_v1", "weighted_ga_v2"):
        for start in study.starts:
            cases = papers_cases(study, start, BUDGET, SEARCHED)
            method = start.roles[role]
            row = [method, start.name]
            for case in cases:
                merged = merged_front(case.runs[method].values())
                count = case.unary(method, "cardinality").mean()
                row.append(f"{merged[:, 1].min():.0f}-{merged[:, 1].max():.0f}, {count:.0f}")
            rows.append(row)
    yield from table(["method", "start", *(problem.name for problem in study.problems)], rows, words=2)


def equal_evaluations(study: Study, start: Start) -> Iterator[str]:
    rows = []
    roles = ("nsga2_v1", "nsga2_v2", "moead", "weighted_ga_v1", "weighted_ga_v2")
    for case in papers_cases(study, start, BUDGET, SEARCHED):
        merged = case.merged
        row = [case.problem.name]
        for role in roles:
            method = start.roles[role]
            values = [merged.unary(method, indicator).mean() for indicator in ("hvr", "epsilon_optimal")]
            row.append(f"{values[0]:.3f}, {values[1]:.2f}")
        rows.append(row)
    yield from table(["model", *(start.roles[role] for role in roles)], rows)


def over_classic(case: Case, rival: str, front: FloatArray) -> list[float]:
    """Return a front's least error over that of each of a method's meshes, at its size: 5 to 50 % fewer triangles."""
    (classic,) = case.runs[rival].values()
    papers = classic[classic[:, 1] >= 0.49 * case.problem.triangles]
    return [front[front[:, 1] <= triangles, 0].min() / error for error, triangles in papers if error > 0]


def against_others(study: Study) -> Iterator[str]:
    """Error of NSGA-II v1 over that of tools' meshes of as many triangles; and of thinning by the charged error."""
    rows = []
    for problem in study.problems:
        searched, nearest = (study.cases[problem.name, BUDGET, scoring] for scoring in (SEARCHED, "nearest"))
        row = [problem.name]
        for rival in TOOLS:
            shown = [
                float(np.median([over_classic(case, rival, front) for front in case.runs["NSGA-II v1"].values()]))
                for case in (searched, nearest)
            ]
            row.append(pair(*shown))
        thinned = thinning(study.surface(problem, "nearest"))
        front = np.column_stack([thinned.error, thinned.triangles])
        row.append(f"{np.median(over_classic(nearest, 'MeshLab quadric, unit size', front)):.2f}")
        rows.append(row)
    yield from table(["model", *TOOLS, "thinning() over quadric, unit size"], rows)


def abandoned(study: Study) -> Iterator[str]:
    methods = ("NSGA-II v1", "NSGA-II v2", "MOEA/D", "GA v1", *TOOLS, "adaptive thinning")
    rows = []
    for problem in study.problems:
        case = study.cases[problem.name, BUDGET, "nearest"]
        row = [problem.name]
        for method in methods:
            runs = [run for sources in case.sources[method].values() for run in sources]
            uncovered = [run.arrays["uncovered"][run.arrays["F"][:, 1] >= 0.49 * problem.triangles] for run in runs]
            row.append(f"{100 * np.concatenate(uncovered).mean() / problem.vertices:.1f}")
        rows.append(row)
    yield from table(["model", *methods], rows)


def papers_solutions(study: Study) -> Iterator[str]:
    rows = []
    for role, triangles, error in PAPER_M1:
        row = [f"{role}, at most {triangles} triangles", f"{error:.0f}"]
        for start in study.starts:
            case = papers_cases(study, start, BUDGET, SEARCHED)[0]
            front = merged_front(case.runs[start.roles[role]].values())
            fitting = front[front[:, 1] <= triangles]
            best = fitting[fitting[:, 0].argmin()] if len(fitting) else None
            row.append("none" if best is None else f"{best[0]:.0f} at {best[1]:.0f}")
        rows.append(row)
    yield from table(["M1", "error, paper", *(start.name for start in study.starts)], rows)


def main(folder: str) -> None:
    study = Study(Path(folder))
    parts = {
        "Findings": verdicts(study),
        "C and epsilon, NSGA-II v1 over MOEA/D / the reverse (C: mean, epsilon: median, over the pairs of runs)":
            papers_tables(study),
        "Triangles of the merged front, solutions of a run": starts(study),
        **{
            f"Merged fronts, {start.name}: HVR, epsilon to the pseudo-optimal front": equal_evaluations(study, start)
            for start in study.starts
        },
        "Error of NSGA-II v1 over that of other tools at as many triangles, reductions of 5 to 50 % (median; as "
        "searched / every vertex)": against_others(study),
        "Vertices that a mesh of half of the triangles or more leaves uncovered (mean, in %)": abandoned(study),
        "The paper's solutions of M1": papers_solutions(study),
    }  # fmt: skip
    for title, lines in parts.items():
        sys.stdout.write("\n".join(["", title, "", *lines, ""]))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tests/comparison/reading.py RESULTS")
    main(sys.argv[1])
