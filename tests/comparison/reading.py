"""What README.md beside this file says in numbers and the report's own tables do not: made from stored runs.

meshsimp run configs/scans.yaml --models FOLDER -o results --jobs 2
python tests/comparison/reading.py results
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.comparison.study import Case, Study
from meshsimp_pymoo.indicators import epsilon, non_dominated
from meshsimp_pymoo.search.greedy import thinning

FloatArray = npt.NDArray[np.float64]

BUDGET = "50 generations"
MESHLAB = tuple(baseline.label for baseline in BASELINES.values() if baseline.group == "meshlab")

# The founding paper's Tables 1 and 2: NSGA-II v1 over MOEA/D, and the reverse, for its models M1 to M6.
PAPER_COVERAGE = ((0.57, 0.34), (0.38, 0.50), (0.59, 0.21), (0.42, 0.48), (0.28, 0.16), (0.37, 0.56))
PAPER_EPSILON = ((1.016, 1.019), (1.045, 0.991), (1.061, 1.104), (1.039, 1.256), (1.041, 1.051), (1.031, 1.053))

# (method, triangles, error) of the solutions of M1 that the paper prints.
PAPER_M1 = (("NSGA-II v2", 387, 3829.92), ("NSGA-II v2", 276, 4061.76), ("MOEA/D", 401, 3808), ("MOEA/D", 297, 4033))


def table(head: str, *rows: list[str]) -> Iterator[str]:
    """Yield the lines of a Markdown table; its first column is text, the others are numbers."""
    columns = head.split(" | ")
    yield f"| {head} |"
    yield "|---" + "|---:" * (len(columns) - 1) + "|"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def pair(forth: float, back: float) -> str:
    return f"{forth:.2f} / {back:.2f}"


def between(case: Case, a: str, b: str, value: Callable[[FloatArray, FloatArray], float]) -> float:
    """Return the median of a number over all pairs of runs of two methods, those left out that have none (NaN)."""
    return float(np.nanmedian([value(A, B) for A in case.runs[a].values() for B in case.runs[b].values()]))


def within_reach(A: FloatArray, B: FloatArray) -> float:
    """Epsilon of B by A, of that part of B alone that is neither smaller nor more accurate than all of A."""
    reached = B[(B >= A.min(axis=0)).all(axis=1)]
    return epsilon(A, reached) if len(reached) else math.nan


def papers_tables(cases: list[Case]) -> Iterator[str]:
    a, b = "NSGA-II v1", "MOEA/D"
    rows = []
    for case, of_coverage, of_epsilon in zip(cases, PAPER_COVERAGE, PAPER_EPSILON, strict=True):
        cover, literal = case.coverage.values, case.literal_epsilon.values
        rows.append(
            [
                case.problem.name,
                pair(*of_coverage),
                pair(cover[a, b].mean(), cover[b, a].mean()),
                " / ".join(f"{value:.3f}" for value in of_epsilon),
                pair(np.median(literal[a, b]), np.median(literal[b, a])),
                pair(between(case, a, b, within_reach), between(case, b, a, within_reach)),
            ]
        )
    yield from table("model | C, paper | C, here | epsilon, paper | epsilon, here | epsilon within reach, here", *rows)


def reach(cases: list[Case]) -> Iterator[str]:
    methods = ("NSGA-II v1", "MOEA/D", "MOEA/D normalised", "GA v1", "MeshLab quadric")
    rows = []
    for case in cases:
        row = [case.problem.name, f"{case.optimal.front[:, 1].min():.0f}"]
        for method in methods:
            smallest = np.median([front[:, 1].min() for front in case.runs[method].values()])
            row.append(f"{smallest:.0f}, {np.median(case.scores[method].epsilon):.1f}")
        rows.append(row)
    yield from table("model | pseudo-optimal | " + " | ".join(methods), *rows)


def equal_evaluations(cases: list[Case]) -> Iterator[str]:
    rows = []
    for case in cases:
        ga = case.scores["GA v1"].hvr
        merged = [case.scores[name].merged_hvr for name in ("NSGA-II v1", "MOEA/D")]
        rows.append([case.problem.name, *(f"{value:.3f}" for value in (*merged, ga.mean(), ga.max()))])
    yield from table("model | ten runs, NSGA-II v1 | ten runs, MOEA/D | one run, GA v1 | best run, GA v1", *rows)


def over_meshlab(case: Case, method: str, front: FloatArray) -> list[float]:
    """Return a front's least error over that of each of a method's meshes, at its size: 5 to 50 % fewer triangles."""
    (classic,) = case.runs[method].values()
    papers = classic[classic[:, 1] >= 0.49 * case.problem.triangles]
    return [front[front[:, 1] <= triangles, 0].min() / error for error, triangles in papers]


def against_meshlab(study: Study, names: list[str]) -> Iterator[str]:
    methods = list(MESHLAB)
    rows = []
    for name in names:
        searched, nearest = (study.cases[name, BUDGET, scoring] for scoring in ("searched", "nearest"))
        row = [name]
        for method in methods:
            forth, back = (
                np.median([over_meshlab(case, method, front) for front in case.runs["NSGA-II v1"].values()])
                for case in (searched, nearest)
            )
            row.append(pair(forth, back))
        thinned = thinning(study.surface(nearest.problem, "nearest"))
        front = np.column_stack([thinned.error, thinned.triangles])
        row.append(f"{np.median(over_meshlab(nearest, methods[1], front)):.2f}")
        rows.append(row)
    yield from table("model | " + " | ".join(methods) + " | thinning() over quadric, unit size", *rows)


def abandoned(cases: list[Case]) -> Iterator[str]:
    methods = ("NSGA-II v1", "NSGA-II v2", "MOEA/D", "GA v1", *MESHLAB)
    rows = []
    for case in cases:
        row = [case.problem.name]
        for method in methods:
            uncovered = [
                run.arrays["uncovered"][run.arrays["F"][:, 1] >= 0.49 * case.problem.triangles]
                for runs in case.sources[method].values()
                for run in runs
            ]
            row.append(f"{100 * np.concatenate(uncovered).mean() / case.problem.vertices:.1f}")
        rows.append(row)
    yield from table("model | " + " | ".join(methods), *rows)


def papers_solutions(case: Case) -> Iterator[str]:
    rows = []
    for method, triangles, error in PAPER_M1:
        front = non_dominated(np.vstack(list(case.runs[method].values())))
        best = front[front[:, 1] <= triangles]
        row = best[best[:, 0].argmin()]
        rows.append([f"{method}, at most {triangles} triangles", f"{error:.0f}", f"{row[0]:.0f} at {row[1]:.0f}"])
    yield from table("M1 | error, paper | error, here", *rows)


def main(folder: str) -> None:
    study = Study(Path(folder))
    names = [problem.name for problem in study.problems]
    cases = [study.cases[name, BUDGET, "searched"] for name in names]
    parts = {
        "C and epsilon, NSGA-II v1 over MOEA/D / reverse (C: mean; epsilon: median over the pairs of runs)":
            papers_tables(cases),
        "Triangles of a run's smallest mesh, epsilon to the pseudo-optimal front (medians over the runs)": reach(cases),
        "HVR at about equal evaluations: 50 000 and 55 000": equal_evaluations(cases),
        "Error of NSGA-II v1 over that of MeshLab's mesh of as many triangles, reductions of 5 to 50 % (median; "
        "as searched / every vertex; thinning: every vertex)": against_meshlab(study, names),
        "Vertices that a mesh of half of the triangles or more leaves uncovered (mean, in %)": abandoned(cases),
        "The paper's solutions of M1": papers_solutions(cases[0]),
    }  # fmt: skip
    for title, lines in parts.items():
        sys.stdout.write("\n".join(["", title, "", *lines, ""]))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tests/comparison/reading.py RESULTS")
    main(sys.argv[1])
