"""The page of an experiment: comparison, fronts, pictures, tables, findings and configuration in one file.

The fronts are drawn by the page itself; the other figures are those of the folder ``figures``, made smaller.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.comparison import findings_page, tables
from meshsimp_pymoo.comparison.analysis import attainment_surfaces
from meshsimp_pymoo.comparison.figures import method_look
from meshsimp_pymoo.comparison.findings import CLAIMS, DOES_NOT_HOLD, HOLDS, UNDECIDED, Finding
from meshsimp_pymoo.comparison.study import INDICATORS, PROCEDURES, SCORINGS, Case, Study
from meshsimp_pymoo.indicators import merged_front
from meshsimp_pymoo.report.document import html_document, slug
from meshsimp_pymoo.surface.measures import MEASURES

__all__ = ["experiment_page"]


SCRIPTS = ("vendor/d3.min.js", "chart.js", "experiment.js")
# Pictures are as wide as they can be shown on a screen of twice the usual density, and no wider.
PICTURE_WIDTH, PICTURE_QUALITY = 1600, 82
VERDICT_CLASSES = {HOLDS: "holds", DOES_NOT_HOLD: "fails", UNDECIDED: "open"}
# The page's marks by matplotlib's names.
MARKS = {
    "o": "circle", "s": "square", "^": "up", "D": "diamond", "v": "down", "P": "plus", "X": "cross", "<": "left",
    "+": "plus", "x": "cross", "1": "down", "2": "up", "3": "left", "4": "diamond", "*": "star",
}  # fmt: skip
# Parts of experiment.json that the page shows as the configuration.
CONFIGURATION = ("title", "problems", "algorithms", "seeds", "budgets", "baselines")


def experiment_page(study: Study, found: Sequence[Finding]) -> str:
    """Return the page of an experiment whose tables and figures are written already.

    Parameters
    ----------
    study : Study
        The experiment.
    found : sequence of Finding
        All its findings.

    Returns
    -------
    str
        The page. It has the measured seconds in it, which are never the same twice.
    """
    settings = [(b, s) for b in study.budgets for s in study.scorings if study.compared(b, s)]
    charts: dict[str, Any] = {}
    sections = [_section(study, budget, scoring, found, charts) for budget, scoring in settings]
    return html_document(
        "experiment.html",
        SCRIPTS,
        {"charts": charts},
        title=study.title,
        overview=findings_page.what_was_run(study),
        warnings=findings_page.reservations(study),
        verdict_class=VERDICT_CLASSES,
        rankings=[_ranking(study, budget, scoring) for budget, scoring in settings],
        how=findings_page.HOW.replace("*", ""),
        columns=[f"{_setting(f.budget, f.scoring)}, {f.start}" for f in _columns(found)],
        claims=list(_claims(found)),
        own_first=any(study.kind(method) in ("own", "pymoo") for method in study.methods),
        sections=sections,
        models=list(_models(study)),
        baselines=[table for budget in study.budgets if (table := tables.baselines(study, budget)) is not None],
        times=[_times(study, budget) for budget in study.budgets],
        configuration=_configuration(study),
        versions=study.versions,
        libraries="parts of D3 (ISC licence)",
    )


def _setting(budget: str, scoring: str) -> str:
    return f"{budget}, error {SCORINGS[scoring]}"


def _ranking(study: Study, budget: str, scoring: str) -> dict[str, Any]:
    """Return the comparison of all methods at one budget and scoring, as a table and as a diagram."""
    path = study.out / "figures" / slug(budget) / slug(scoring) / "critical_difference.png"
    alt = f"mean ranks of the methods, bars over those that are not told apart ({_setting(budget, scoring)})"
    return {"table": tables.ranking(study, budget, scoring), "picture": _picture(path, alt)}


def _columns(found: Sequence[Finding]) -> list[Finding]:
    """Return a finding of each budget, scoring and start."""
    return list({(f.budget, f.scoring, f.start): f for f in reversed(found)}.values())[::-1]


def _claims(found: Sequence[Finding]) -> Iterator[dict[str, Any]]:
    """Yield the verdicts on each claim, one row for each procedure and indicator."""
    places = [(f.budget, f.scoring, f.start) for f in _columns(found)]
    by_place = {(f.claim.key, f.procedure, f.indicator, (f.budget, f.scoring, f.start)): f for f in found}
    for claim in findings_page.shown_claims(CLAIMS, found):
        rows = [
            (
                f"{PROCEDURES[procedure]}, {INDICATORS[key]}",
                [by_place[claim.key, procedure, key, place] for place in places],
            )
            for procedure in claim.procedures
            for key in claim.indicators
        ]
        yield {"text": f"{claim.text} (Sec. {claim.section})", "rows": rows}


def _section(
    study: Study, budget: str, scoring: str, found: Sequence[Finding], charts: dict[str, Any]
) -> dict[str, Any]:
    """Return what the page says of one budget and scoring; its charts are added to ``charts`` by their id."""
    place = f"{slug(budget)}/{slug(scoring)}"
    figures = study.out / "figures" / place
    cases = study.compared(budget, scoring)
    models = []
    for case in cases:
        key = f"chart-{len(charts)}"
        measure = MEASURES[case.problem.rules.measure]
        label = f"{measure.label}, {measure.meaning} [{case.problem.unit}]"
        charts[key] = {"name": f"Fronts of {case.problem.name}", "label": label, "series": list(_series(study, case))}
        alt = f"{case.problem.name}: the original and the best trade-offs of some methods, and their error"
        models.append(
            {
                "name": case.problem.name,
                "chart": key,
                "meshes": _picture(figures / f"meshes_{slug(case.problem.name)}.png", alt),
            }
        )
    alts = {
        "hvr": "hypervolume ratio of every run",
        "cardinality": "cardinality of every run",
        "selected": "fewest triangles, best trade-off and least error of every method",
        "convergence_evaluations": "hypervolume ratio over evaluations",
        "convergence_seconds": "hypervolume ratio over seconds",
        "critical_difference": "mean ranks of every method over the models",
        "profile": "performance profiles of every method by epsilon",
    }
    pictures = [_picture(figures / f"{name}.png", f"{alt} ({_setting(budget, scoring)})") for name, alt in alts.items()]
    shown = {claim.key for claim in findings_page.shown_claims(CLAIMS, found)}
    reasons = [f for f in found if (f.budget, f.scoring) == (budget, scoring) and f.claim.key in shown]
    return {
        "id": f"at-{slug(budget)}-{slug(scoring)}",
        "title": _setting(budget, scoring),
        "models": models,
        "pictures": [picture for picture in pictures if picture],
        "tables": [make(study, budget, scoring) for make in tables.COMPARISONS if make is not tables.ranking],
        "reasons": [(f, f"{INDICATORS[f.indicator]}, {PROCEDURES[f.procedure]}, {f.start}") for f in reasons],
    }


def _series(study: Study, case: Case) -> Iterator[dict[str, Any]]:
    """Yield the pseudo-optimal front, then every method's merged front and how far half of its runs get."""
    yield {"name": "pseudo-optimal", "line": "thick", **_xy(case.optimal.front)}
    for method, runs in case.runs.items():
        colour, mark = method_look(study, case, method)
        classic = method in case.classic
        half = attainment_surfaces(runs, [50])[50] if len(runs) > 1 else None
        yield {
            "name": method,
            "colour": None if classic else colour,
            "mark": MARKS[mark],
            "half": None if half is None else _xy(half),
            **_xy(merged_front(runs.values())),
        }


def _xy(F: FloatArray) -> dict[str, list[float]]:
    F = F[np.lexsort((F[:, 0], F[:, 1]))]
    return {"x": F[:, 1].tolist(), "y": F[:, 0].tolist()}


def _models(study: Study) -> Iterator[tuple[str, ...]]:
    for problem in study.problems:
        yield (
            problem.name,
            problem.source,
            f"{problem.vertices:,}",
            f"{problem.triangles:,}",
            problem.unit,
            problem.system,
        )


def _picture(path: Path, alt: str) -> dict[str, Any] | None:
    """Return a figure as a data URL with its size; None if the report has no such figure."""
    if not path.is_file():
        return None
    from PIL import Image

    with Image.open(path) as image:
        small = image.convert("RGB")
    small.thumbnail((PICTURE_WIDTH, 4 * PICTURE_WIDTH))
    content = io.BytesIO()
    small.save(content, "WEBP", quality=PICTURE_QUALITY, method=4)
    url = f"data:image/webp;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"
    return {"url": url, "alt": alt, "width": small.width, "height": small.height}


def _times(study: Study, budget: str) -> tables.Table:
    """Return the mean seconds of a single search."""
    cases = study.compared(budget, study.scorings[0])
    rows = tuple(
        (case.problem.name, *(float(case.seconds(m).mean()) if m in case.runs else None for m in study.methods))
        for case in cases
    )
    return tables.Table("times", f"Mean seconds of a single search ({budget})", ("model", *study.methods), rows)


def _configuration(study: Study) -> str:
    import yaml

    content = {key: study.content[key] for key in CONFIGURATION if key in study.content}
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110)
