"""The findings of an experiment as pages for people: findings.md and times.md, and their table."""

from __future__ import annotations

from collections.abc import Sequence, Sized
from typing import Any

from meshsimp_pymoo.comparison.findings import CLAIMS, TIME_CLAIMS, UNLIKE, Claim, Finding, times
from meshsimp_pymoo.comparison.study import INDICATORS, PROCEDURES, SCORINGS, Study
from meshsimp_pymoo.comparison.tables import Table, markdown_text, ranking
from meshsimp_pymoo.formats.table import listed
from meshsimp_pymoo.surface.measures import MEASURES
from meshsimp_pymoo.surface.model import AREA

__all__ = ["findings_page", "reservations", "shown_claims", "table", "times_page", "what_was_run"]

HOW = (
    "How a verdict comes about: every pair of methods that start alike is compared at the level of 0.05. *Run "
    "against run* takes every run on every model (rank sums; signs against a method without chance), with Holm's "
    "correction over the models. *Merged fronts* are those of the paper's section 4.3: the runs of a method as "
    "one front, of the weighted-sum GA its eleven weights of one seed, so that at equal generations ten runs have"
    " made about as many evaluations; there is one number for each model, and the signed-rank test over the "
    "models. *Better* holds if it is so significantly in more than half of the comparisons and the reverse in "
    "none, and does not hold if the reverse is significant anywhere. *No different* holds if nothing is "
    "significant though it could be. All else is not decided here. The tables hold every comparison."
)
SCORED = (
    "*Error as searched* is the paper's reading: a vertex that no triangle covers costs nothing. Meshes of other tools "
    "are compared at the paper's reductions of 5 to 50 % only. *Error every vertex* charges an "
    "uncovered vertex its distance to the mesh, and compares their smaller meshes too; the "
    "evolutionary methods did not search by it, so it is a handicap to them."
)


def findings_page(study: Study, all_findings: Sequence[Finding]) -> str:
    """Return the page of findings in Markdown; the same bytes for the same runs."""
    lines = [f"# Findings: {study.title}", "", what_was_run(study), ""]
    known = reservations(study)
    if known:
        lines += ["**To know before reading on**", "", *(f"* {line}" for line in known), ""]
    lines += [f"{text}\n" for text in _other_errors(study)]
    if "searched" in study.scorings:
        lines += [SCORED, ""]
    settings = [(b, s) for b in study.budgets for s in study.scorings if study.compared(b, s)]
    lines += ["## The methods", ""]
    for budget, scoring in settings:
        lines += [ranking(study, budget, scoring).markdown(), ""]
    claims = shown_claims(CLAIMS, all_findings)
    if not claims:
        lines += [
            "## The paper's findings",
            "",
            "They are about NSGA-II, MOEA/D and the weighted-sum GA as the paper has them; this experiment compares no "
            "two of those.",
        ]
        return _joined(lines)
    lines += ["## The paper's findings", "", HOW, ""]
    for budget, scoring in settings:
        lines += [
            f"### In short: {budget}, error {SCORINGS[scoring]}",
            "",
            *_in_short(claims, all_findings, budget, scoring),
        ]
        lines += ["", "Times: see [times.md](times.md).", ""]
    for budget, scoring in settings:
        here = [f for f in all_findings if (f.budget, f.scoring) == (budget, scoring)]
        lines += [f"## In detail: {budget}, error {SCORINGS[scoring]}", ""]
        for claim in claims:
            lines += [f"### {claim.text} (Sec. {claim.section})", ""]
            seen = set()
            for f in (f for f in here if f.claim.key == claim.key):
                where = f"{f.start}, {PROCEDURES[f.procedure]}"
                if where not in seen:
                    seen.add(where)
                    lines += [f"*{where}.* {f.background}".rstrip(), ""]
                lines += [f"* {INDICATORS[f.indicator]}: **{f.verdict}**. {f.numbers} {f.reason}".rstrip(), ""]
    return _joined(lines)


def shown_claims(claims: Sequence[Claim], all_findings: Sequence[Finding]) -> list[Claim]:
    """Return the claims that this experiment has methods for."""
    there = {f.claim.key for f in all_findings if f.numbers != "no comparison"}
    return [claim for claim in claims if claim.key in there]


def _in_short(claims: Sequence[Claim], all_findings: Sequence[Finding], budget: str, scoring: str) -> list[str]:
    """Return the table of verdicts: a row for each claim, procedure and indicator, a column for each start."""
    by_place = {
        (f.claim.key, f.procedure, f.indicator, f.start): f
        for f in all_findings
        if (f.budget, f.scoring) == (budget, scoring)
    }
    starts = list(dict.fromkeys(start for *_, start in by_place))
    lines = [
        f"| the paper says | Sec. | procedure | by | {' | '.join(starts)} |",
        "|---|---|---|---|" + "---|" * len(starts),
    ]
    for claim in claims:
        for procedure in claim.procedures:
            for indicator in claim.indicators:
                verdicts = [by_place[claim.key, procedure, indicator, start].verdict for start in starts]
                lines.append(
                    f"| {claim.text} | {claim.section} | {PROCEDURES[procedure]} | {INDICATORS[indicator]} | "
                    f"{' | '.join(verdicts)} |"
                )
    return lines


def table(all_findings: Sequence[Finding]) -> Table:
    """Return the verdicts as a table."""
    rows = tuple(
        (
            f.claim.text, f.claim.section, PROCEDURES[f.procedure], INDICATORS[f.indicator], f.start, f.budget,
            SCORINGS[f.scoring], f.verdict, f.numbers, f.reason, f.background,
        )
        for f in all_findings
    )  # fmt: skip
    columns = (
        "claim", "section", "procedure", "indicator", "start", "budget", "scoring", "verdict", "numbers", "reason",
        "background",
    )  # fmt: skip
    shown = Table("findings", "Findings", columns[:8], tuple(row[:8] for row in rows))
    return Table("findings", "Findings", columns, rows, shown)


def times_page(study: Study) -> str:
    """Return what the measured seconds say about the paper's findings on time, in Markdown.

    Apart from `findings_page`, because seconds are never the same twice.
    """
    lines = [
        "# Times",
        "",
        "Seconds of a single search, measured while other searches ran beside it; the weighted GAs need one search "
        "for each weight, a classic method's are for all its meshes. The paper (Sec. 4.5): 6 to 8 minutes for MOEA/D, "
        "10 to 15 for the versions v1 and the classic methods, 20 for the versions v2.",
        "",
    ]
    for budget in study.budgets:
        cases = study.compared(budget, study.scorings[0])
        methods = [m for m in study.methods if any(m in case.runs for case in cases)]
        if not methods:
            continue
        headers = " | ".join(map(markdown_text, methods))
        lines += [f"## {budget}", "", f"| model | {headers} |", "|---|" + "---:|" * len(methods)]
        for case in cases:
            cells = [f"{case.seconds(m).mean():.2f}" if m in case.runs else "" for m in methods]
            lines.append(f"| {markdown_text(case.problem.name)} | " + " | ".join(cells) + " |")
        per_evaluation = []
        for m in methods:
            seconds = sum(float(case.seconds(m).sum()) for case in cases if m in case.runs)
            evaluations = sum(float(case.evaluations(m).sum()) for case in cases if m in case.runs)
            per_evaluation.append(f"{m} {1000 * seconds / evaluations:.3f}")
        lines += ["", f"Milliseconds for each evaluation, all included: {', '.join(per_evaluation)}.", ""]
        found = times(study, budget)
        for claim in shown_claims(TIME_CLAIMS, found):
            for f in (f for f in found if f.claim.key == claim.key):
                lines += [f"* {claim.text} ({f.start}): **{f.verdict}**. {f.numbers} {f.reason}".rstrip()]
        lines.append("")
    return _joined(lines)


def what_was_run(study: Study) -> str:
    """Return the size of the experiment in one line."""
    content = study.content
    return (
        f"{_counted(study.problems, 'model')}, {_counted(study.methods, 'algorithm')} ({', '.join(study.methods)}), "
        f"{_counted(content['seeds'], 'seed')}, budgets: {', '.join(study.budgets)}; {_counted(study.all_runs, 'run')}."
    )


def reservations(study: Study) -> list[str]:
    """Return what is to be known before reading on: what was skipped, is missing, damaged, mixed or unlike."""
    lines = list(study.skipped)
    for what, items in (("missing", study.missing), ("damaged, left out", study.damaged), ("empty", study.empty)):
        if items:
            more = f" and {len(items) - 1} more" if len(items) > 1 else ""
            lines.append(f"{what}: {items[0]}{more}")
    if len(study.versions) > 1:
        differing = sorted({k for v in study.versions for k in v if any(v.get(k) != o.get(k) for o in study.versions)})
        lines.append(f"the runs were made with different versions of {listed(differing)}")
    free: dict[str, int] = {}
    for run in study.all_runs:
        if "free_F" in run.arrays:
            method = run.record["algorithm"]
            free[method] = free.get(method, 0) + len(run.arrays["free_F"])
    if free:
        lines.append(
            f"{sum(free.values()):,} free meshes of {listed(free)} are stored beside the runs and not compared: all "
            "numbers here are those of the Delaunay meshes of the same searches"
        )
    return lines + _unlike(study)


def _unlike(study: Study) -> list[str]:
    """Return where evaluations compare unlike things."""
    lines = []
    for budget in study.budgets:
        cases = study.compared(budget, study.scorings[0])
        cost: dict[str, list[float]] = {}
        for case in cases:
            for method in case.evolutionary:
                cost.setdefault(method, []).append(float(case.evaluations(method).mean()))
        mean = {method: sum(values) / len(values) for method, values in cost.items()}
        movers = [method for method in mean if any(case.moves(method) for case in cases if method in case.runs)]
        if movers:
            verb = "moves" if len(movers) == 1 else "move"
            lines.append(
                f"at {budget} evaluations do not measure {listed(movers)}, which {verb} vertices of a mesh one at a "
                "time; compare by seconds"
            )
        mean = {method: value for method, value in mean.items() if method not in movers}
        if not mean:
            continue
        least, most = min(mean, key=lambda m: mean[m]), max(mean, key=lambda m: mean[m])
        if mean[most] > UNLIKE * mean[least]:
            lines.append(
                f"at {budget} a front takes {mean[least]:,.0f} ({least}) to {mean[most]:,.0f} evaluations ({most}), so "
                "run against run compares unlike work there"
            )
    return lines


def _joined(lines: Sequence[str]) -> str:
    """Return the lines as a page on which no name, whatever is in it, is a tag or a link."""
    text = "\n".join(lines).rstrip() + "\n"
    # an entity is shown as its sign, but is no syntax
    return text.replace("<", "&lt;").replace("](", "]&#40;").replace("[times.md]&#40;", "[times.md](")


def _other_errors(study: Study) -> list[str]:
    """Return what *error* means where it is not the sum of the deviations."""
    said = []
    measures = dict.fromkeys(problem.rules.measure for problem in study.problems)
    for measure in (name for name in measures if name != "error"):
        models = ", ".join(problem.name for problem in study.problems if problem.rules.measure == measure)
        row = MEASURES[measure]
        said.append(f"On {models} the *error* is the {row.label} ({row.meaning}), not the sum of the deviations.")
    weighed: dict[str, list[str]] = {}
    for problem in study.problems:
        if problem.rules.weights is not None:
            weighed.setdefault(_weighed_by(problem.rules.weights), []).append(problem.name)
    return said + [f"On {', '.join(models)} each vertex counts by {what}." for what, models in weighed.items()]


def _weighed_by(weights: Any) -> str:
    """Return what weights are: areas, an attribute of the file, or numbers that stand in the configuration."""
    if isinstance(weights, str) and weights == AREA:
        return "a third of the area of the triangles around it"
    return f"its attribute *{weights}*" if isinstance(weights, str) else "a number of its own, from the configuration"


def _counted(items: Sized, what: str) -> str:
    return f"{len(items):,} {what}{'s' * (len(items) != 1)}"
