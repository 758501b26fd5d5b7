"""The paper's findings, each with "holds", "does not hold" or "not decided here", computed from the runs.

A finding says that some methods are better than others, or that they do not differ, by an indicator. It is
broken down to comparisons: one for each pair of methods and each model, tested at the level of 0.05 after
Holm's correction over the models (each pair of methods is a question of its own):

* *better*: holds if the one method is significantly better in more than half of the comparisons and the
  other in none; does not hold if the other is significantly better in any; else it is not decided here.
* *no different*: holds if no comparison is significant, provided there are enough runs for one to be and the
  indicator tells any two runs apart in more than half of the comparisons; does not hold if any is.

Two methods with chance are compared by Wilcoxon's rank-sum test over their runs. A method without chance has
one front, so each run of the other method is either better or worse, and the sign test counts them. Two
methods without chance are compared over the models, by Wilcoxon's signed-rank test. How many comparisons are
significant by the raw p-value, as the paper counts, is always said too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence, Sized
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from meshsimp_pymoo.comparison.analysis import ALPHA, holm
from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.comparison.study import CLASSIC_NAMES, SCORINGS, Case, Study
from meshsimp_pymoo.comparison.tables import INDICATOR_NAMES, Table, markdown_text
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.surface.measures import MEASURES

__all__ = [
    "CLAIMS",
    "DOES_NOT_HOLD",
    "HOLDS",
    "UNDECIDED",
    "Claim",
    "Comparisons",
    "Finding",
    "findings",
    "page",
    "reservations",
    "times_page",
    "what_was_run",
]

HOLDS, DOES_NOT_HOLD, UNDECIDED = "holds", "does not hold", "not decided here"

# The two classic methods of the paper.
_first, _second = (name for name, baseline in BASELINES.items() if baseline.in_paper)
PAPER_CLASSIC = (_first, _second)


@dataclass(frozen=True)
class Outcome:
    """One comparison of a finding.

    Attributes
    ----------
    model, a, b : str
        Where, and between whom.
    p : float
        Raw two-sided p-value.
    least_p : float
        The smallest p-value that this many runs can give.
    direction : int
        1 if ``a`` is better on average, -1 if ``b`` is, 0 if neither.
    value_a, value_b : float
        Means of the indicator (as it is, not negated).
    informative : bool
        Whether the indicator tells any two runs apart.
    """

    model: str
    a: str
    b: str
    p: float
    least_p: float
    direction: int
    value_a: float
    value_b: float
    informative: bool = True


@dataclass(frozen=True)
class Comparisons:
    """All comparisons of a finding, and what they say.

    Attributes
    ----------
    tested : tuple of Outcome
        The comparisons.
    alpha : float
        Level of significance.
    """

    tested: tuple[Outcome, ...]
    alpha: float = ALPHA

    @property
    def corrected(self) -> list[float]:
        """The p-values after Holm's correction over the models, for each pair of methods."""
        adjusted = [0.0] * len(self.tested)
        for rows in self._families():
            for row, p in zip(rows, holm([self.tested[row].p for row in rows]), strict=True):
                adjusted[row] = float(p)
        return adjusted

    def significant(self, direction: int, *, raw: bool = False) -> list[Outcome]:
        """Return the comparisons that are significant in a direction."""
        p_values = [t.p for t in self.tested] if raw else self.corrected
        return [t for t, p in zip(self.tested, p_values, strict=True) if p < self.alpha and t.direction == direction]

    @property
    def can_decide(self) -> bool:
        """Whether there are runs enough for one comparison to be significant after the correction."""
        return any(self.tested[row].least_p * len(rows) < self.alpha for rows in self._families() for row in rows)

    def better(self) -> str:
        """Return whether "a is better than b" holds."""
        if self.significant(-1):
            return DOES_NOT_HOLD
        return HOLDS if 2 * len(self.significant(1)) > len(self.tested) else UNDECIDED

    def no_different(self) -> str:
        """Return whether "a and b do not differ" holds."""
        if self.significant(1) or self.significant(-1):
            return DOES_NOT_HOLD
        told_apart = sum(t.informative for t in self.tested)
        return HOLDS if self.can_decide and 2 * told_apart > len(self.tested) else UNDECIDED

    def _families(self) -> list[list[int]]:
        """Return the rows of the comparisons of each pair of methods."""
        families: dict[tuple[str, str], list[int]] = {}
        for row, t in enumerate(self.tested):
            families.setdefault((t.a, t.b), []).append(row)
        return list(families.values())


@dataclass(frozen=True)
class Claim:
    """A finding of the paper, or a question beside it.

    Attributes
    ----------
    key : str
        A short name.
    text : str
        What is claimed.
    kind : str
        "better" or "no different".
    pairs : tuple of (str, str)
        Which methods: names of presets, or "classic" for both of the paper's classic methods.
    indicators : tuple of str
        Keys of `INDICATOR_NAMES`.
    in_paper : bool
        Whether the paper claims it.
    """

    key: str
    text: str
    kind: str
    pairs: tuple[tuple[str, str], ...]
    indicators: tuple[str, ...]
    in_paper: bool = True


MULTI = ("nsga2_v1", "nsga2_v2", "moead")

CLAIMS = (
    Claim(
        "multi_over_single",
        "Multi-objective evolution beats the single-objective GA",
        "better",
        (("nsga2_v1", "weighted_ga_v1"), ("nsga2_v2", "weighted_ga_v2"), ("moead", "weighted_ga_v1")),
        ("hvr", "epsilon_optimal", "epsilon"),
    ),
    Claim(
        "multi_over_classic",
        "Multi-objective evolution beats the classic methods",
        "better",
        tuple((multi, "classic") for multi in MULTI),
        ("hvr", "epsilon_optimal", "epsilon"),
    ),
    Claim(
        "nsga2_and_moead",
        "NSGA-II v1 and MOEA/D do not differ significantly",
        "no different",
        (("nsga2_v1", "moead"),),
        ("hvr", "epsilon_optimal", "epsilon", "coverage"),
    ),
    Claim(
        "cardinality",
        "NSGA-II has the larger cardinality",
        "better",
        (("nsga2_v1", "moead"), ("nsga2_v2", "moead")),
        ("cardinality",),
    ),
    Claim(
        "ga_v2_over_v1",
        "GA v2 beats GA v1",
        "better",
        (("weighted_ga_v2", "weighted_ga_v1"),),
        ("hvr", "epsilon_optimal", "epsilon"),
    ),
    Claim(
        "classic_alike",
        "The two classic methods do not differ",
        "no different",
        (PAPER_CLASSIC,),
        ("hvr", "epsilon"),
    ),
    Claim(
        "nsga2_v2_over_v1",
        "NSGA-II v2 beats NSGA-II v1",
        "better",
        (("nsga2_v2", "nsga2_v1"),),
        ("hvr", "epsilon_optimal"),
        in_paper=False,
    ),
)


@dataclass(frozen=True)
class Finding:
    """A verdict on a claim by one indicator, at one budget and scoring.

    Attributes
    ----------
    claim : Claim
        What is claimed.
    indicator : str
        Key of `INDICATOR_NAMES`.
    budget, scoring : str
        Where it was looked at.
    verdict : str
        `HOLDS`, `DOES_NOT_HOLD` or `UNDECIDED`.
    numbers : str
        What the comparisons say, in numbers.
    reason : str
        Which methods on which models.
    background : str
        What in the data stands behind it; the same for all indicators of a claim.
    """

    claim: Claim
    indicator: str
    budget: str
    scoring: str
    verdict: str
    numbers: str
    reason: str
    background: str = ""


def findings(study: Study, budget: str, scoring: str) -> list[Finding]:
    """Return a verdict on every claim, by every indicator it is about."""
    cases = study.compared(budget, scoring)
    found = []
    for claim in CLAIMS:
        pairs, absent = _methods(study, claim)
        for indicator in claim.indicators:
            if absent and not pairs:
                reason = f"There is no {_listed(absent)} in this experiment."
                found.append(Finding(claim, indicator, budget, scoring, UNDECIDED, "no comparison", reason))
                continue
            if claim.key == "classic_alike":
                comparisons = Comparisons(tuple(_over_models(cases, *pairs[0], indicator)))
            else:
                comparisons = Comparisons(tuple(_tested(study, budget, scoring, cases, pairs, indicator)))
            if not comparisons.tested:
                reason = "No model has at least two runs of the methods with chance and one of the others."
                found.append(Finding(claim, indicator, budget, scoring, UNDECIDED, "no comparison", reason))
                continue
            verdict = comparisons.better() if claim.kind == "better" else comparisons.no_different()
            numbers = _numbers(claim, comparisons)
            reason = _reason(claim, indicator, comparisons, pairs)
            if absent:
                reason += f" Without {_listed(absent)}, which this experiment lacks."
            background = " ".join(_background(claim, cases, pairs))
            found.append(Finding(claim, indicator, budget, scoring, verdict, numbers, reason, background))
    return found


def page(study: Study, all_findings: Sequence[Finding]) -> str:
    """Return the page of findings in Markdown; the same bytes for the same runs."""
    settings = list(dict.fromkeys((f.budget, f.scoring) for f in all_findings))
    lines = [f"# Findings: {study.title}", "", what_was_run(study), ""]
    known = reservations(study)
    if known:
        lines += ["**To know before reading on**", "", *(f"* {line}" for line in known), ""]
    lines += [
        "How a verdict comes about: every pair of methods is compared on every model at the level of 0.05, after "
        "Holm's correction over the models. *Better* holds if it is so significantly in more "
        "than half of the comparisons and the reverse in none, and does not hold if the reverse is significant "
        "anywhere. *No different* holds if nothing is significant though it could be. All else is not decided "
        "here. The tables hold every comparison.",
        "",
    ]
    lines += [f"{text}\n" for text in _other_errors(study)]
    if "searched" in study.scorings:
        lines += [
            "*Error as searched* is the paper's reading: a vertex that no triangle covers costs nothing. The "
            "tools' meshes, such as MeshLab's, are compared at the paper's reductions of 5 to 50 % only. *Error every "
            "vertex* charges an uncovered vertex its distance to the mesh, and compares their smaller meshes too; the "
            "evolutionary methods did not search by it, so it is a handicap to them.",
            "",
        ]
    lines += ["## In short", ""]
    headers = [f"{budget}, error {SCORINGS[scoring]}" for budget, scoring in settings]
    lines.append("| claim | by | " + " | ".join(headers) + " |")
    lines.append("|---|---|" + "---|" * len(settings))
    for claim in CLAIMS:
        for indicator in claim.indicators:
            verdicts = [
                f.verdict
                for setting in settings
                for f in all_findings
                if (f.budget, f.scoring) == setting and f.claim.key == claim.key and f.indicator == indicator
            ]
            name = claim.text + ("" if claim.in_paper else " (not in the paper)")
            lines.append(f"| {name} | {INDICATOR_NAMES[indicator]} | " + " | ".join(verdicts) + " |")
    lines.append(
        "| MOEA/D takes the least time | seconds | " + " | ".join(["see [times.md](times.md)"] * len(settings)) + " |"
    )
    for budget, scoring in settings:
        lines += ["", f"## At {budget}, error {SCORINGS[scoring]}", ""]
        for claim in CLAIMS:
            lines += [f"### {claim.text}" + ("" if claim.in_paper else " (not in the paper)"), ""]
            background = ""
            for f in all_findings:
                if (f.budget, f.scoring, f.claim.key) == (budget, scoring, claim.key):
                    lines += [f"* {INDICATOR_NAMES[f.indicator]}: **{f.verdict}**. {f.numbers} {f.reason}".rstrip()]
                    background = f.background
            lines += ["", background, ""] if background else [""]
    return _joined(lines)


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
    """Return what weights are: an attribute of the file, or numbers that stand in the configuration."""
    return f"its attribute *{weights}*" if isinstance(weights, str) else "a number of its own, from the configuration"


def table(all_findings: Sequence[Finding]) -> Table:
    """Return the verdicts as a table."""
    rows = tuple(
        (
            f.claim.text, "yes" if f.claim.in_paper else "no", INDICATOR_NAMES[f.indicator], f.budget,
            SCORINGS[f.scoring], f.verdict, f.numbers, f.reason, f.background,
        )
        for f in all_findings
    )  # fmt: skip
    columns = ("claim", "in_paper", "indicator", "budget", "scoring", "verdict", "numbers", "reason", "background")
    shown = Table("findings", "Findings", columns[:6], tuple(row[:6] for row in rows))
    return Table("findings", "Findings", columns, rows, shown)


def times_page(study: Study) -> str:
    """Return what the measured seconds say about the paper's finding on time, in Markdown.

    Apart from `page`, because seconds are never the same twice.
    """
    lines = [
        "# Times: does MOEA/D take the least time?",
        "",
        "Seconds of a single search, measured while other searches ran beside it; the weighted GAs need one search "
        "for each weight. The paper: 6 to 8 minutes for MOEA/D, 10 to 15 for NSGA-II v1 and the GA, 20 to 25 for "
        "the versions v2.",
        "",
    ]
    for budget in study.budgets:
        cases = study.compared(budget, study.scorings[0])
        moead = study.role("moead")
        rivals = [name for name in map(study.role, RIVALS_IN_TIME) if name]
        lines += [f"## {budget}", ""]
        if moead is None or not rivals:
            lines += [f"**{UNDECIDED}**: the experiment lacks MOEA/D or all methods to compare it with.", ""]
            continue
        headers = " | ".join(map(markdown_text, study.methods))
        lines += [f"| model | {headers} |", "|---|" + "---:|" * len(study.methods)]
        for case in cases:
            cells = [f"{case.seconds(m).mean():.2f}" if m in case.runs else "" for m in study.methods]
            lines.append(f"| {markdown_text(case.problem.name)} | " + " | ".join(cells) + " |")
        tested = []
        for case in cases:
            for rival in rivals:
                if moead in case.runs and rival in case.runs:
                    x, y = case.seconds(moead), case.seconds(rival)
                    if min(len(x), len(y)) > 1:
                        means = float(x.mean()), float(y.mean())
                        tested.append(_rank_sum(case.problem.name, moead, rival, -x, -y, *means))
        lines.append("")
        if tested:
            comparisons = Comparisons(tuple(tested))
            numbers = _numbers(_TIME, comparisons)
            lines += [f"**{comparisons.better()}**. {numbers} {_time_reason(cases, moead, rivals)}", ""]
        else:
            lines += [f"**{UNDECIDED}**: no method has two runs.", ""]
    return _joined(lines)


RIVALS_IN_TIME = tuple(name for name, preset in PRESETS.items() if preset.is_the_papers and name != "moead")
_TIME = Claim("time", "MOEA/D takes the least time", "better", (), ())


# ----------------------------------------------------------------------------------------------- comparisons


def _methods(study: Study, claim: Claim) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the methods of a claim as this experiment names them, and what it lacks."""
    classic = {
        name: CLASSIC_NAMES[name] for name in PAPER_CLASSIC if any(method == name for _, method in study.classic_runs)
    }
    pairs, absent = [], []

    def named(role: str) -> list[str]:
        if role == "classic":
            return list(classic.values())
        found = classic.get(role) if role in PAPER_CLASSIC else study.role(role)
        return [found] if found else []

    for first, second in claim.pairs:
        left, right = named(first), named(second)
        pairs += [(a, b) for a in left for b in right]
        absent += [role for role, there in ((first, left), (second, right)) if not there and role not in absent]
    return pairs, absent


def _tested(
    study: Study, budget: str, scoring: str, cases: Sequence[Case], pairs: Iterable[tuple[str, str]], indicator: str
) -> list[Outcome]:
    """Return the comparisons of pairs of methods, of which the second may be without chance."""
    with_chance = {
        (c.model, c.a, c.b): c for c in study.comparisons(budget, scoring, indicator)
    }  # rank sums, in the order of the methods
    tested = []
    for case in cases:
        for a, b in pairs:
            if a not in case.runs or b not in case.runs:
                continue
            model = case.problem.name
            if b in case.classic:
                tested.append(_by_signs(case, a, b, indicator))
                continue
            c = with_chance.get((model, a, b)) or with_chance.get((model, b, a))
            if c is None:
                continue
            x, y = (c.sample_a, c.sample_b) if c.a == a else (c.sample_b, c.sample_a)
            direction = _direction(float(np.mean(x)), float(np.mean(y)), x, y)
            n, m = len(x), len(y)
            shown = _values(case, a, b, indicator)
            apart = len(np.unique(np.concatenate([x, y]))) > 1
            tested.append(Outcome(model, a, b, c.p, 2 / math.comb(n + m, n), direction, *shown, informative=apart))
    return tested


def _rank_sum(model: str, a: str, b: str, x: np.ndarray, y: np.ndarray, value_a: float, value_b: float) -> Outcome:
    from meshsimp_pymoo.comparison.analysis import rank_sum

    least = 2 / math.comb(len(x) + len(y), len(x))
    return Outcome(model, a, b, rank_sum(x, y).p, least, _direction(x.mean(), y.mean(), x, y), value_a, value_b)


def _direction(mean_x: float, mean_y: float, x: np.ndarray, y: np.ndarray) -> int:
    """Return who is better; where both means are infinite, by the medians' ranks."""
    if math.isfinite(mean_x) or math.isfinite(mean_y):
        return int(mean_x > mean_y) - int(mean_x < mean_y)
    larger, smaller = (x[:, None] > y[None, :]).sum(), (x[:, None] < y[None, :]).sum()
    return int(larger > smaller) - int(larger < smaller)


def _by_signs(case: Case, a: str, b: str, indicator: str) -> Outcome:
    """Compare the runs of a method with the one front of a method without chance."""
    if indicator == "epsilon":
        forth, back = case.literal_epsilon.values[a, b][:, 0], case.literal_epsilon.values[b, a][0]
        wins, losses = int(((forth <= 1) & (back > 1)).sum()), int(((back <= 1) & (forth > 1)).sum())
    else:
        x, y = case.samples(a, b, indicator)
        wins, losses = int((x > y[0]).sum()), int((x < y[0]).sum())
    n_runs = len(case.runs[a])
    p = float(stats.binomtest(wins, wins + losses).pvalue) if wins + losses else 1.0
    direction = int(wins > losses) - int(wins < losses)
    values = _values(case, a, b, indicator)
    least_p = 2.0 ** (1 - n_runs)
    return Outcome(case.problem.name, a, b, p, least_p, direction, *values, informative=wins + losses > 0)


def _over_models(cases: Sequence[Case], a: str, b: str, indicator: str) -> list[Outcome]:
    """Compare two methods without chance by their values on all models."""
    both = [case for case in cases if a in case.runs and b in case.runs]
    if not both:
        return []
    values = np.array([_values(case, a, b, indicator) for case in both])
    difference = values[:, 0] - values[:, 1] if indicator == "hvr" else values[:, 1] - values[:, 0]
    n = int(np.count_nonzero(difference))
    p = float(stats.wilcoxon(difference, method="exact" if n == len(difference) else "auto").pvalue) if n else 1.0
    direction = int(np.sign(np.median(difference)))
    return [Outcome("all models", a, b, p, 2.0 ** (1 - len(both)), direction, *values.mean(axis=0).tolist())]


def _values(case: Case, a: str, b: str, indicator: str) -> tuple[float, float]:
    """Return the means of an indicator as it is reported."""
    if indicator in ("epsilon", "coverage"):
        pairs = case.epsilon if indicator == "epsilon" else case.coverage
        return pairs.cell(a, b).mean, pairs.cell(b, a).mean
    sign = -1 if indicator == "epsilon_optimal" else 1
    x, y = case.samples(a, b, indicator)
    return float(sign * x.mean()), float(sign * y.mean())


# --------------------------------------------------------------------------------------------------- sentences


def _numbers(claim: Claim, comparisons: Comparisons) -> str:
    """Say what the comparisons of a finding gave."""
    n = len(comparisons.tested)
    if claim.key == "classic_alike":
        (t,) = comparisons.tested
        return f"Over the models {t.a} has a mean of {t.value_a:.4g} and {t.b} of {t.value_b:.4g}, p = {t.p:.3g}."
    ahead, behind = len(comparisons.significant(1)), len(comparisons.significant(-1))
    raw = f"{len(comparisons.significant(1, raw=True))} and {len(comparisons.significant(-1, raw=True))}"
    return f"Of {n} comparisons {ahead} are significant for the first method, {behind} against it (raw p: {raw})."


def _reason(
    claim: Claim,
    indicator: str,
    comparisons: Comparisons,
    pairs: Sequence[tuple[str, str]],
) -> str:
    """Say what decided, from the data."""
    parts = []
    if not comparisons.can_decide:
        parts.append(
            "So few runs or models cannot decide: their smallest possible p-value, times the comparisons that "
            f"it is corrected for, is not below {comparisons.alpha:g}."
        )
    if claim.key != "classic_alike":
        parts += _by_pair(claim, indicator, comparisons, pairs)
    against = comparisons.significant(-1)
    if claim.kind == "better" and against and comparisons.significant(1):
        where = _listed(sorted({t.model for t in against}))
        parts.append(f"It is contradicted on {where}.")
    told_apart = sum(t.informative for t in comparisons.tested)
    if indicator in ("epsilon", "coverage") and 2 * told_apart <= len(comparisons.tested):
        parts.append(
            f"In {len(comparisons.tested) - told_apart} of {len(comparisons.tested)} comparisons no run dominates one "
            "of the other method, so this procedure has nothing to count."
        )
    return " ".join(parts)


def _by_pair(claim: Claim, indicator: str, comparisons: Comparisons, pairs: Sequence[tuple[str, str]]) -> list[str]:
    said = []
    for a, b in pairs:
        of_pair = [t for t in comparisons.tested if (t.a, t.b) == (a, b)]
        if not of_pair:
            continue
        mine = [t for t in comparisons.significant(1) if (t.a, t.b) == (a, b)]
        theirs = [t for t in comparisons.significant(-1) if (t.a, t.b) == (a, b)]
        values = f"{_mean(t.value_a for t in of_pair)} against {_mean(t.value_b for t in of_pair)} on average"
        if indicator in ("epsilon", "coverage"):
            values = f"{values}, over each other"
        said.append(f"{a} and {b}: {values}, better on {len(mine)} and {len(theirs)} of {len(of_pair)} models.")
    return said


def _background(claim: Claim, cases: Sequence[Case], pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Say what in the data stands behind a finding."""
    if claim.key in ("multi_over_single", "ga_v2_over_v1", "nsga2_v2_over_v1"):
        methods = list(dict.fromkeys(m for pair in pairs for m in pair))
        costs = []
        for m in methods:
            there = [case for case in cases if m in case.runs]
            if there:
                evaluations = np.mean([case.evaluations(m).mean() for case in there])
                sizes = np.mean([case.scores[m].cardinality.mean() for case in there])
                costs.append(f"{m} {evaluations:,.0f} evaluations for {sizes:.3g} solutions")
        return [f"For each seed: {', '.join(costs)}."] if costs else []
    if claim.key == "multi_over_classic":
        shares = []
        for case in cases:
            for method in [CLASSIC_NAMES[name] for name in PAPER_CLASSIC if CLASSIC_NAMES[name] in case.classic]:
                for run in case.sources[method][0]:
                    used = run.arrays["F"][:, 1] > 0
                    if case.scoring == "searched":
                        used &= run.arrays["paper"].astype(bool)
                    shares.append((method, float(run.arrays["uncovered"][used].max()) / case.problem.vertices))
        worst = max(shares, key=lambda pair: pair[1], default=None)
        if worst is None:
            return []
        price = "at no cost here" if cases[0].scoring == "searched" else "which costs here"
        reach = (
            "Their meshes end at half of the triangles, so they cannot reach what lies below."
            if cases[0].scoring == "searched"
            else "Their vertices may move, while evolution chooses among the model's."
        )
        return [f"{worst[0]} leaves up to {worst[1]:.0%} of a model's vertices uncovered, {price}. {reach}"]
    if claim.key == "nsga2_and_moead":
        ratios = []
        for case in cases:
            extent = np.ptp(case.optimal.front, axis=0)
            if extent.min() > 0:
                ratios.append((case.problem.name, float(extent[0] / extent[1])))
        if not ratios:
            return []
        low, high = min(ratios, key=lambda r: r[1]), max(ratios, key=lambda r: r[1])
        return [
            "MOEA/D weighs the raw objectives against each other: the error, in the file's unit, spans "
            f"{low[1]:.3g} (on {low[0]}) to {high[1]:.3g} times (on {high[0]}) what the triangles span, and that "
            "ratio shifts all of its weights."
        ]
    if claim.key == "cardinality":
        return ["Several scalar problems of MOEA/D may share a solution; NSGA-II fills its population with the front."]
    return []


def _time_reason(cases: Sequence[Case], moead: str, rivals: Sequence[str]) -> str:
    """Say what a search spends its time on."""
    per_evaluation = []
    for method in [moead, *rivals]:
        there = [case for case in cases if method in case.runs]
        if there:
            seconds = sum(float(case.seconds(method).sum()) for case in there)
            evaluations = sum(float(case.evaluations(method).sum()) for case in there)
            per_evaluation.append(f"{method} {1000 * seconds / evaluations:.3f}")
    return (
        f"Milliseconds for each evaluation, all included: {', '.join(per_evaluation)}. Evaluating a mesh takes so "
        "little here that the bookkeeping of an algorithm counts; where it takes long, the number of evaluations and "
        "the sizes of the meshes decide."
    )


def what_was_run(study: Study) -> str:
    """Return the size of the experiment in one line."""
    content = study.content
    return (
        f"{_counted(study.problems, 'model')}, {_counted(study.methods, 'algorithm')} ({', '.join(study.methods)}), "
        f"{_counted(content['seeds'], 'seed')}, budgets: {', '.join(study.budgets)}; {_counted(study.all_runs, 'run')}."
    )


def reservations(study: Study) -> list[str]:
    """Return what is to be known before reading on: what was skipped, is missing, damaged or mixed."""
    lines = list(study.skipped)
    for what, items in (("missing", study.missing), ("damaged, left out", study.damaged), ("empty", study.empty)):
        if items:
            more = f" and {len(items) - 1} more" if len(items) > 1 else ""
            lines.append(f"{what}: {items[0]}{more}")
    if len(study.versions) > 1:
        differing = sorted({k for v in study.versions for k in v if any(v.get(k) != o.get(k) for o in study.versions)})
        lines.append(f"the runs were made with different versions of {_listed(differing)}")
    return lines


def _mean(values: Iterable[float]) -> str:
    array = np.array(list(values), dtype=float)
    return f"{array.mean():.4g}" if np.isfinite(array).all() else "infinity"


def _counted(items: Sized, what: str) -> str:
    return f"{len(items):,} {what}{'s' * (len(items) != 1)}"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]
