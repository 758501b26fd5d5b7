"""The paper's findings, each with "holds", "does not hold" or "not decided here", computed from the runs.

A finding says that some methods are better than others, or that they do not differ, by an indicator and a procedure
(`study.PROCEDURES`), among the methods that start alike (`study.Start`), against their own pseudo-optimal front.
It is broken down to comparisons, one for each pair of methods and each model (merged fronts: each pair, over all
models), tested at the level of 0.05 after Holm's correction over the models; each pair is a question of its own:

* *better*: holds if the one method is significantly better in more than half of the comparisons and the
  other in none; does not hold if the other is significantly better in any; else it is not decided here.
* *no different*: holds if no comparison is significant, provided there are enough runs for one to be and the
  indicator tells any two runs apart in more than half of the comparisons; does not hold if any is.

Which test. Section 4.6 of the paper names Wilcoxon's signed-rank test, its section 5 the rank-sum test. *Run against
run* takes rank sums, because the seeds of two methods are no pairs: seed 1 of the one has nothing in common with seed 1
of the other (the tables have the signed-rank p beside, by seeds). A method without chance has one front, so each run of
the other method is either better or worse, and the sign test counts them. *Merged fronts* are one number for each
method and model, and the models are pairs: there it is the signed-rank test. How many comparisons are significant by
the raw p-value, as the paper counts, is always said too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.comparison.statistics import ALPHA, holm, rank_sum, signed_rank
from meshsimp_pymoo.comparison.study import BINARY, CLASSIC_NAMES, SMALLER_IS_BETTER, Case, Start, Study
from meshsimp_pymoo.formats.table import listed
from meshsimp_pymoo.search.presets import PRESETS

__all__ = [
    "CLAIMS",
    "DOES_NOT_HOLD",
    "HOLDS",
    "TIME_CLAIMS",
    "UNDECIDED",
    "UNLIKE",
    "Claim",
    "Comparisons",
    "Finding",
    "Outcome",
    "findings",
    "papers_cases",
    "times",
]

HOLDS, DOES_NOT_HOLD, UNDECIDED = "holds", "does not hold", "not decided here"

# Fronts that took so many times the evaluations of another are no equal work.
UNLIKE = 1.25

# The two classic methods of the paper; other baselines are no part of its findings.
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
    ahead, behind : int
        On how many models ``a`` is better and worse, where the comparison is over all of them.
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
    ahead: int = 0
    behind: int = 0


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

    def verdict(self, kind: str) -> str:
        """Return whether a claim of a kind, "better" or "no different", holds."""
        for_it, against = self.significant(1), self.significant(-1)
        if kind == "better":
            if against:
                return DOES_NOT_HOLD
            return HOLDS if 2 * len(for_it) > len(self.tested) else UNDECIDED
        if for_it or against:
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
    """A finding of the paper.

    Attributes
    ----------
    key : str
        A short name.
    section : str
        Where in the paper.
    text : str
        What is claimed.
    kind : str
        "better" or "no different".
    pairs : tuple of (str, str)
        Which methods: names of presets or of the paper's classic methods, or "classic" for both of those.
    indicators : tuple of str
        Keys of `study.INDICATORS`.
    procedures : tuple of str
        Keys of `study.PROCEDURES`.
    """

    key: str
    section: str
    text: str
    kind: str
    pairs: tuple[tuple[str, str], ...]
    indicators: tuple[str, ...]
    procedures: tuple[str, ...] = ("runs", "merged")


MULTI = ("nsga2_v1", "nsga2_v2", "moead")
SINGLE = ("weighted_ga_v1", "weighted_ga_v2")
FRONTS = ("hvr", "epsilon_optimal", "epsilon", "coverage")


def _each(first: Sequence[str], second: Sequence[str]) -> tuple[tuple[str, str], ...]:
    return tuple((a, b) for a in first for b in second)


CLAIMS = (
    Claim(
        "multi_over_single",
        "4.5, 4.6",
        "Multi-objective evolution beats the single-objective GA",
        "better",
        _each(MULTI, SINGLE),
        FRONTS,
    ),
    Claim(
        "best_over_v2",
        "4.5, 4.6",
        "NSGA-II v1 and MOEA/D beat the rest, NSGA-II v2 included",
        "better",
        _each(("nsga2_v1", "moead"), ("nsga2_v2",)),
        FRONTS,
    ),
    Claim(
        "nsga2_and_moead",
        "4.6",
        "NSGA-II v1 and MOEA/D do not differ",
        "no different",
        (("nsga2_v1", "moead"),),
        FRONTS,
    ),
    Claim(
        "multi_over_classic",
        "4.5, 4.6",
        "Multi-objective evolution beats the classic methods",
        "better",
        _each(MULTI, ("classic",)),
        FRONTS,
    ),
    Claim(
        "single_over_classic",
        "4.6",
        "The single-objective GA beats the classic methods",
        "better",
        _each(SINGLE, ("classic",)),
        FRONTS,
    ),
    Claim("ga_v2_over_v1", "4.6", "GA v2 beats GA v1", "better", (SINGLE[::-1],), FRONTS),
    Claim(
        "classic_alike",
        "4.6",
        "The two classic methods do not differ",
        "no different",
        (PAPER_CLASSIC,),
        FRONTS,
        ("merged",),
    ),
    Claim(
        "cardinality",
        "4.5",
        "NSGA-II has more solutions than MOEA/D",
        "better",
        _each(("nsga2_v1", "nsga2_v2"), ("moead",)),
        ("cardinality",),
    ),
    Claim(
        "extent",
        "4.5",
        "NSGA-II covers more of the space than the other methods",
        "better",
        _each(("nsga2_v1", "nsga2_v2"), ("moead", *SINGLE)),
        ("extent",),
    ),
    Claim(
        "selected",
        "4.7",
        "The selected solutions of multi-objective evolution beat the GA's",
        "better",
        _each(MULTI, SINGLE),
        ("least_error", "trade_off", "fewest_triangles"),
        ("merged",),
    ),
    Claim(
        "selected_best",
        "4.7",
        "The selected solutions of NSGA-II v1 and MOEA/D beat NSGA-II v2's",
        "better",
        _each(("nsga2_v1", "moead"), ("nsga2_v2",)),
        ("least_error", "trade_off", "fewest_triangles"),
        ("merged",),
    ),
)

TIME_CLAIMS = (
    Claim(
        "moead_fastest",
        "4.5",
        "MOEA/D takes the least time",
        "better",
        _each(("moead",), tuple(name for name, row in PRESETS.items() if row.is_the_papers and name != "moead")),
        (),
    ),
    Claim(
        "v2_slower",
        "4.5",
        "The versions v1 take less time than the versions v2",
        "better",
        (("nsga2_v1", "nsga2_v2"), SINGLE),
        (),
    ),
    Claim("v1_alike", "4.5", "NSGA-II v1 and GA v1 take the same time", "no different", (("nsga2_v1", SINGLE[0]),), ()),
    Claim(
        "classic_time",
        "4.5, 5",
        "The classic methods take the time of NSGA-II v1",
        "no different",
        (("nsga2_v1", "classic"),),
        (),
    ),
)


@dataclass(frozen=True)
class Finding:
    """A verdict on a claim by one indicator and procedure, at one budget and scoring, from one start.

    Attributes
    ----------
    claim : Claim
        What is claimed.
    indicator, procedure : str
        Keys of `study.INDICATORS` ("seconds" for times) and `study.PROCEDURES`.
    start : str
        Name of the first population.
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
    procedure: str
    start: str
    budget: str
    scoring: str
    verdict: str
    numbers: str
    reason: str
    background: str = ""


def papers_cases(study: Study, start: Start, budget: str, scoring: str) -> list[Case]:
    """Return the cases of the paper's methods alone, from one start."""
    methods = [*start.roles.values(), *(CLASSIC_NAMES[name] for name in PAPER_CLASSIC)]
    cases = [case.only(methods) for case in study.compared(budget, scoring)]
    return [case for case in cases if case.runs]


def findings(study: Study, budget: str, scoring: str) -> list[Finding]:
    """Return a verdict on every claim of the paper, from every start, by every procedure and indicator."""
    found = []
    for start in study.starts:
        cases = papers_cases(study, start, budget, scoring)
        for claim in CLAIMS:
            for procedure in claim.procedures:
                seen = cases if procedure == "runs" else [case.merged for case in cases]
                background = " ".join(_background(claim, start, seen))
                for indicator in claim.indicators:
                    where = (claim, indicator, procedure, start.name, budget, scoring)
                    found.append(_finding(where, _compared(start, claim, procedure, indicator, seen), background))
    return found


def times(study: Study, budget: str) -> list[Finding]:
    """Return a verdict on what the paper says of times, by the measured seconds of a single search."""
    found = []
    scoring = study.scorings[0]
    for start in study.starts:
        cases = papers_cases(study, start, budget, scoring)
        for claim in TIME_CLAIMS:
            where = (claim, "seconds", "runs", start.name, budget, scoring)
            found.append(_finding(where, _compared(start, claim, "runs", "seconds", cases), ""))
    return found


# ----------------------------------------------------------------------------------------------- comparisons


@dataclass(frozen=True)
class _Compared:
    """What a claim comes down to: pairs of methods, the roles that nobody plays, and the comparisons."""

    pairs: Sequence[tuple[str, str]]
    absent: Sequence[str]
    comparisons: Comparisons


def _compared(start: Start, claim: Claim, procedure: str, indicator: str, cases: Sequence[Case]) -> _Compared:
    pairs, absent = _methods(start, claim, cases)
    tested: list[Outcome] = []
    for a, b in pairs:
        both = [case for case in cases if a in case.runs and b in case.runs]
        if procedure == "merged":
            tested += _over_models(both, a, b, indicator)
        else:
            tested += [outcome for case in both for outcome in _on_model(case, a, b, indicator)]
    return _Compared(pairs, absent, Comparisons(tuple(tested)))


def _methods(start: Start, claim: Claim, cases: Sequence[Case]) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the methods of a claim as this experiment names them, and what it lacks."""
    there = {method for case in cases for method in case.runs}

    def named(role: str) -> list[str]:
        roles = PAPER_CLASSIC if role == "classic" else (role,)
        names = [CLASSIC_NAMES.get(one, start.roles.get(one, "")) for one in roles]
        return [name for name in names if name in there]

    pairs, absent = [], []
    for first, second in claim.pairs:
        left, right = named(first), named(second)
        pairs += [(a, b) for a in left for b in right]
        absent += [role for role, found in ((first, left), (second, right)) if not found and role not in absent]
    return pairs, absent


def _samples(case: Case, a: str, b: str, indicator: str) -> tuple[FloatArray, FloatArray]:
    if indicator == "seconds":
        return -case.seconds(a), -case.seconds(b)
    return case.samples(a, b, indicator)


def _values(case: Case, a: str, b: str, indicator: str) -> tuple[float, float]:
    if indicator == "seconds":
        return float(case.seconds(a).mean()), float(case.seconds(b).mean())
    return case.values(a, b, indicator)


def _on_model(case: Case, a: str, b: str, indicator: str) -> Iterator[Outcome]:
    """Compare the runs of two methods, of which the second may be without chance."""
    name, shown = case.problem.name, _values(case, a, b, indicator)
    if b in case.classic:
        wins, losses = _wins(case, a, b, indicator)
        p = float(stats.binomtest(wins, wins + losses).pvalue) if wins + losses else 1.0
        least_p = 2.0 ** (1 - len(case.runs[a]))
        yield Outcome(name, a, b, p, least_p, _sign(wins - losses), *shown, informative=wins + losses > 0)
    elif min(len(case.runs[a]), len(case.runs[b])) > 1:
        x, y = _samples(case, a, b, indicator)
        apart = len(np.unique(np.concatenate([x, y]))) > 1
        least_p = 2 / math.comb(len(x) + len(y), len(x))
        yield Outcome(name, a, b, rank_sum(x, y).p, least_p, _direction(x, y), *shown, informative=apart)


def _wins(case: Case, a: str, b: str, indicator: str) -> tuple[int, int]:
    """Return how many runs of a method are better and worse than the one front of a method without chance."""
    if indicator == "epsilon":
        forth, back = case.literal_epsilon.values[a, b][:, 0], case.literal_epsilon.values[b, a][0]
        return int(((forth <= 1) & (back > 1)).sum()), int(((back <= 1) & (forth > 1)).sum())
    x, y = _samples(case, a, b, indicator)
    return int((x > y[0]).sum()), int((x < y[0]).sum())


def _direction(x: FloatArray, y: FloatArray) -> int:
    """Return who is better; where both means are infinite, by the medians' ranks."""
    mean_x, mean_y = float(x.mean()), float(y.mean())
    if math.isfinite(mean_x) or math.isfinite(mean_y):
        return _sign(mean_x - mean_y)
    return _sign(int((x[:, None] > y[None, :]).sum()) - int((x[:, None] < y[None, :]).sum()))


def _over_models(cases: Sequence[Case], a: str, b: str, indicator: str) -> list[Outcome]:
    """Compare two methods by one value each for every model, which are pairs: Wilcoxon's signed-rank test."""
    if not cases:
        return []
    values = np.array([_values(case, a, b, indicator) for case in cases])
    sign = -1.0 if indicator in SMALLER_IS_BETTER else 1.0
    difference = sign * (values[:, 0] - values[:, 1])
    test = signed_rank(values[:, 0], values[:, 1])
    ahead, behind = int((difference > 0).sum()), int((difference < 0).sum())
    direction = _sign(float(np.median(difference))) or _sign(ahead - behind)
    value_a, value_b = values.mean(axis=0).tolist()
    return [
        Outcome(
            "all models",
            a,
            b,
            test.p,
            2.0 ** (1 - len(cases)),
            direction,
            value_a,
            value_b,
            informative=ahead + behind > 0,
            ahead=ahead,
            behind=behind,
        )
    ]


def _sign(number: float) -> int:
    return int(number > 0) - int(number < 0)


# --------------------------------------------------------------------------------------------------- sentences


def _finding(where: tuple[Claim, str, str, str, str, str], compared: _Compared, background: str) -> Finding:
    claim, indicator, procedure = where[:3]
    comparisons = compared.comparisons
    if not compared.pairs:
        return Finding(*where, UNDECIDED, "no comparison", f"There is no {listed(compared.absent)} from this start.")
    if not comparisons.tested:
        reason = "No model has at least two runs of the methods with chance and one of the others."
        return Finding(*where, UNDECIDED, "no comparison", reason)
    reason = " ".join(_reasons(claim, indicator, procedure, compared))
    if compared.absent:
        reason += f" Without {listed(compared.absent)}, which there is not from this start."
    return Finding(*where, comparisons.verdict(claim.kind), _numbers(procedure, comparisons), reason, background)


def _numbers(procedure: str, comparisons: Comparisons) -> str:
    """Say what the comparisons of a finding gave."""
    n = len(comparisons.tested)
    ahead, behind = len(comparisons.significant(1)), len(comparisons.significant(-1))
    if procedure == "merged":
        return f"Of {n} pair{'s' * (n > 1)} over all models {ahead} significant for the first method, {behind} against."
    raw = f"{len(comparisons.significant(1, raw=True))} and {len(comparisons.significant(-1, raw=True))}"
    return f"Of {n} comparisons {ahead} are significant for the first method, {behind} against it (raw p: {raw})."


def _reasons(claim: Claim, indicator: str, procedure: str, compared: _Compared) -> Iterator[str]:
    """Say what decided, from the data."""
    comparisons = compared.comparisons
    if not comparisons.can_decide:
        yield (
            "So few runs or models cannot decide: their smallest possible p-value, times the comparisons that "
            f"it is corrected for, is not below {comparisons.alpha:g}."
        )
    for a, b in compared.pairs:
        of_pair = [t for t in comparisons.tested if (t.a, t.b) == (a, b)]
        if not of_pair:
            continue
        values = f"{_mean(t.value_a for t in of_pair)} against {_mean(t.value_b for t in of_pair)} on average"
        if indicator in BINARY:
            values = f"{values}, over each other"
        if procedure == "merged":
            (t,) = of_pair
            yield f"{a} and {b}: {values}, ahead on {t.ahead} and behind on {t.behind} models, p = {t.p:.3g}."
            continue
        mine = [t for t in comparisons.significant(1) if (t.a, t.b) == (a, b)]
        theirs = [t for t in comparisons.significant(-1) if (t.a, t.b) == (a, b)]
        yield f"{a} and {b}: {values}, better on {len(mine)} and {len(theirs)} of {len(of_pair)} models."
    if procedure == "merged":
        return
    against = comparisons.significant(-1)
    if claim.kind == "better" and against and comparisons.significant(1):
        yield f"It is contradicted on {listed(sorted({t.model for t in against}))}."
    told_apart = sum(t.informative for t in comparisons.tested)
    if indicator in BINARY and 2 * told_apart <= len(comparisons.tested):
        yield (
            f"In {len(comparisons.tested) - told_apart} of {len(comparisons.tested)} comparisons no run dominates one "
            "of the other method, so this procedure has nothing to count."
        )


def _background(claim: Claim, start: Start, cases: Sequence[Case]) -> Iterator[str]:
    """Say what in the data stands behind a finding."""
    pairs, _ = _methods(start, claim, cases)
    methods = [m for m in dict.fromkeys(m for pair in pairs for m in pair) if m in start.roles.values()]
    costs, work = [], []
    for m in methods:
        there = [case for case in cases if m in case.runs]
        evaluations = np.mean([case.evaluations(m).mean() for case in there])
        sizes = np.mean([case.scores[m].cardinality.mean() for case in there])
        work.append(evaluations)
        costs.append(f"{m} {evaluations:,.0f} evaluations for {sizes:.3g} solutions")
    if costs:
        unlike = "; no equal work" if max(work) > UNLIKE * min(work) else ""
        yield f"A front: {', '.join(costs)}{unlike}."
    if claim.key in ("multi_over_classic", "single_over_classic"):
        yield from _uncovered(cases)
    if claim.key == "nsga2_and_moead":
        ratios = []
        for case in cases:
            extent = np.ptp(case.optimal.front, axis=0)
            if extent.min() > 0:
                ratios.append((case.problem.name, float(extent[0] / extent[1])))
        if ratios:
            low, high = min(ratios, key=lambda r: r[1]), max(ratios, key=lambda r: r[1])
            yield (
                "MOEA/D weighs the raw objectives against each other: the error, in the file's unit, spans "
                f"{low[1]:.3g} (on {low[0]}) to {high[1]:.3g} times (on {high[0]}) what the triangles span, and that "
                "ratio shifts all of its weights."
            )
    if claim.key == "cardinality":
        yield "Several scalar problems of MOEA/D may share a solution; NSGA-II fills its population with the front."


def _uncovered(cases: Sequence[Case]) -> Iterator[str]:
    """Say what the classic methods leave uncovered, and what that does."""
    shares = []
    for case in cases:
        for method in case.classic:
            for run in case.sources[method][0]:
                used = run.arrays["F"][:, 1] > 0
                if case.scoring == "searched":
                    used &= run.arrays["paper"].astype(bool)
                shares.append((method, float(run.arrays["uncovered"][used].max()) / case.problem.vertices))
    if not shares:
        return
    method, share = max(shares, key=lambda pair: pair[1])
    searched = cases[0].scoring == "searched"
    price = "at no cost here" if searched else "which costs here"
    reach = (
        "Their meshes end at half of the triangles, so they cannot reach what lies below."
        if searched
        else "Their vertices may move, while evolution chooses among the model's."
    )
    yield f"{method} leaves up to {share:.0%} of a model's vertices uncovered, {price}. {reach}"


def _mean(values: Iterable[float]) -> str:
    array = np.array(list(values), dtype=float)
    return f"{array.mean():.4g}" if np.isfinite(array).all() else "infinity"
