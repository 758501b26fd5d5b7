"""The whole report of an experiment, made anew from its stored results alone.

::

    OUT/findings.md                              all methods compared, and the paper's claims with verdicts and numbers
    OUT/tables/BUDGET/SCORING/NAME.csv|md|tex    see `meshsimp_pymoo.comparison.tables`
    OUT/tables/runs.csv, findings.csv            all runs, all verdicts
    OUT/figures/BUDGET/SCORING/*.png             fronts_MODEL, hvr, cardinality, selected, meshes_MODEL, profile,
                                                 critical_difference, convergence_evaluations, convergence_seconds
    OUT/times.csv, times.md                      measured seconds, kept apart: never the same twice
    OUT/report.html                              all of it on one page that needs no other file

Tables and findings are the same bytes for the same runs, and so are figures but for convergence_seconds.png. Each
folder is made complete beside the old one, and then takes its place.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.comparison import findings_page, tables
from meshsimp_pymoo.comparison.findings import Finding, findings
from meshsimp_pymoo.comparison.page import experiment_page
from meshsimp_pymoo.comparison.study import Study
from meshsimp_pymoo.errors import ExperimentWarning
from meshsimp_pymoo.files import draw_into, locked, new_folder, put_back, put_text
from meshsimp_pymoo.report.document import slug

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["write_report", "write_tables"]


def write_report(out: str | os.PathLike[str], *, progress: Callable[[float, float, str], None] | None = None) -> Study:
    """Write all tables, figures and findings of an experiment, and its page.

    Parameters
    ----------
    out : path
        The experiment's folder.
    progress : callable, optional
        Told (done, all, what is being done).

    Returns
    -------
    Study
        What the report is about.

    Raises
    ------
    ResultError
        If there is no experiment, none of its runs is finished, or another process is at work there.

    Warns
    -----
    PictureWarning
        If a figure or the page cannot be made.
    """
    study = Study(out)
    with locked(study.out, inside=True):
        found = write_tables(study)
        _write_figures(study, progress)
        draw_into(study.out, {"report.html": lambda path: put_text(path, experiment_page(study, found))})
    return study


def write_tables(study: Study) -> list[Finding]:
    """Write the tables, findings and times of an experiment, without its figures and its page; return the findings.

    Warns
    -----
    ExperimentWarning
        If runs are missing, damaged or without a mesh.
    """
    for what, items in (("missing", study.missing), ("damaged", study.damaged), ("without a mesh", study.empty)):
        if items:
            more = f" and {len(items) - 1} more" if len(items) > 1 else ""
            warnings.warn(f"left out of the report, {what}: {items[0]}{more}", ExperimentWarning, stacklevel=3)
    found: list[Finding] = []
    put_back(study.out / "tables")
    with new_folder(study.out / "tables", replace=True, flush=False) as folder:
        for budget in study.budgets:
            for scoring in study.scorings:
                if not study.compared(budget, scoring):
                    continue
                place = folder / slug(budget) / slug(scoring)
                for make in tables.COMPARISONS:
                    tables.write_table(place, make(study, budget, scoring))
                found += findings(study, budget, scoring)
            baselines = tables.baselines(study, budget)
            if baselines is not None:
                tables.write_table(folder / slug(budget), baselines)
        tables.write_table(folder, findings_page.table(found))
        (folder / "runs.csv").write_text(tables.runs(study).csv(), encoding="utf-8")
    put_text(study.out / "findings.md", findings_page.findings_page(study, found))
    put_text(study.out / "times.csv", tables.times(study).csv())
    put_text(study.out / "times.md", findings_page.times_page(study))
    return found


def _write_figures(study: Study, progress: Callable[[float, float, str], None] | None) -> None:
    from meshsimp_pymoo.comparison import figures as figures

    drawings: list[tuple[str, Callable[[], Figure]]] = []
    for place, budget in enumerate(study.budgets):
        for scoring in study.scorings:
            cases = study.compared(budget, scoring)
            if not cases:
                continue
            where = f"{slug(budget)}/{slug(scoring)}"
            for case in cases:
                name = slug(case.problem.name)
                drawings.append((f"{where}/fronts_{name}.png", partial(figures.fronts_figure, study, case)))
                if place == 0:  # meshes look much the same at every budget
                    drawings.append((f"{where}/meshes_{name}.png", partial(figures.meshes_figure, study, case)))
            for indicator in ("hvr", "cardinality"):
                drawings.append((f"{where}/{indicator}.png", partial(figures.box_figure, study, cases, indicator)))
            drawings.append((f"{where}/selected.png", partial(figures.selected_figure, study, cases)))
            for over in ("evaluations", "seconds"):
                if any(case.progress(method, over) for case in cases for method in case.evolutionary):
                    name = f"{where}/convergence_{over}.png"
                    drawings.append((name, partial(figures.convergence_figure, study, cases, over)))
            methods, values = figures.profiled(cases)
            if len(methods) > 1 and len(cases) > 1:
                name = f"{where}/critical_difference.png"
                drawings.append((name, partial(figures.critical_difference_figure, study, cases)))
            if len(methods) > 1 and len(values):
                drawings.append((f"{where}/profile.png", partial(figures.profile_figure, study, cases)))
    put_back(study.out / "figures")
    with new_folder(study.out / "figures", replace=True, flush=False) as folder:
        for done, (path, draw) in enumerate(drawings):
            if progress is not None:
                progress(done, len(drawings), path)
            draw_into(folder, {path: partial(_save, draw)})


def _save(draw: Callable[[], Figure], path: Path) -> None:
    draw().savefig(path)
