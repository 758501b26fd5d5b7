"""The stored runs of an experiment, sorted for comparison: one `Case` for each model, budget and scoring.

Where the search did not charge for uncovered vertices (``outside: ignore``, the paper's reading), every mesh
is scored in two ways:

as searched
    by the error that the algorithms saw. Of the tools' meshes only the paper's series, reductions of 5 to
    50 %, is compared: the smaller ones abandon nearly all of the model, and score well by that. Whole fronts
    (thinning, insertion) are made under the problem's rules, so all of their meshes are compared.
every vertex
    by the error with ``outside: nearest``, where an uncovered vertex costs its distance to the mesh. All
    meshes are compared.

Where the search charged for them already, there is the second scoring alone.

Methods are compared in two ways, the `PROCEDURES`:

run against run
    every run of the one with every run of the other;
merged fronts
    as in section 4.3 of the paper: the runs of a method merged to one front. A method whose every run is merged of
    several already (the weighted-sum GA, of its eleven weights) keeps them apart: one of its fronts costs 11 searches,
    one merged of ten runs of another method 10.

Methods whose first population is drawn in the same way make up a `Start`; the paper's findings are looked at in each of
them, among its methods alone.

**Epsilon** compares errors by their ratio, and random subsets of every size include the whole mesh now and
then, whose error is 0: one lucky draw would make the epsilon of everything else infinite. So `EPSILON_SHIFT`
of the largest error of the pseudo-optimal front is added to every error first. That changes no verdict of who
covers whom (I <= 1 holds with the shift exactly if it holds without).
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.comparison.analysis import (
    Comparison,
    OptimalFront,
    PairTable,
    Scores,
    corrected,
    coverage_table,
    dominance_rates,
    epsilon_table,
    pseudo_optimal,
    scale_factor,
    trade_off,
    unary_scores,
)
from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.comparison.config import KNOWN_HOMES
from meshsimp_pymoo.comparison.statistics import Friedman, friedman, rank_sum
from meshsimp_pymoo.comparison.store import EXPERIMENT_FILE, RunStore, StoredRun, read_experiment, read_model
from meshsimp_pymoo.errors import ResultError, reason_of
from meshsimp_pymoo.indicators import hypervolume_ratio, merged_front, non_dominated
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.settings import read_back
from meshsimp_pymoo.surface.kinds import OfModel, surface_of
from meshsimp_pymoo.surface.measures import LENGTH
from meshsimp_pymoo.surface.rules import Rules

__all__ = [
    "BINARY",
    "CLASSIC_NAMES",
    "EPSILON_SHIFT",
    "INDICATORS",
    "PROCEDURES",
    "SCORINGS",
    "SMALLER_IS_BETTER",
    "Case",
    "Picked",
    "Problem",
    "Start",
    "Study",
    "ranked",
]


SCORINGS = {"searched": "as searched", "nearest": "every vertex"}
"""The scorings by key: what they are called."""

PROCEDURES = {"runs": "run against run", "merged": "merged fronts (Sec. 4.3)"}
"""How methods are compared, by key: what it is called."""

EPSILON_SHIFT = 0.01
"""Share of the pseudo-optimal front's largest error that is added to every error before epsilon."""

INDICATORS = {
    "hvr": "HVR",
    "cardinality": "cardinality",
    "epsilon": "epsilon, each over the other",
    "coverage": "coverage, each over the other",
    "epsilon_optimal": "epsilon to the pseudo-optimal front",
    "extent": "extent in triangles",
    "least_error": "error of the least-error solution",
    "fewest_triangles": "triangles of the smallest solution",
    "trade_off": "value of the best trade-off",
}
"""What methods are compared by, by key: what it is called. The last three are of the solutions of section 4.7."""

# Indicators between two fronts, and those of one front that are better when smaller.
BINARY = ("epsilon", "coverage")
SMALLER_IS_BETTER = ("epsilon", "epsilon_optimal", "least_error", "fewest_triangles", "trade_off")

# A method without chance has one run, under this name.
NO_SEED = 0

# What tables call the methods without chance.
CLASSIC_NAMES = {name: baseline.label for name, baseline in BASELINES.items()}


@dataclass(frozen=True)
class Problem:
    """A problem as the record of the experiment describes it."""

    name: str
    source: str
    vertices: int
    triangles: int
    rules: Rules
    limits: dict[str, float]
    stored: str
    hash: str
    unit: str
    system: str

    def meets_limits(self, F: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which solutions (n, 2), by the error that was searched, a search of this problem could find."""
        most = [self.limits.get(name, np.inf) for name in ("max_objective", "max_triangles")]
        return np.all(np.less_equal(F, most), axis=1)


@dataclass(frozen=True)
class Start:
    """Methods whose first population is drawn in the same way, and what they are in the paper.

    Attributes
    ----------
    name : str
        How it is drawn, in words.
    roles : dict of str to str
        The method that stands for a preset of the paper: the first one with the paper's settings.
    """

    name: str
    roles: Mapping[str, str]


@dataclass(frozen=True)
class Picked:
    """Where a solution of a front comes from.

    Attributes
    ----------
    run : StoredRun
        A run that found it.
    row : int
        Its row in that run.
    seed : int
        The run's seed.
    """

    run: StoredRun
    row: int
    seed: int

    def number(self, column: str) -> float:
        """Return one of the numbers stored with the solution."""
        return float(self.run.arrays[column][self.row])


@brief
@dataclass(eq=False)
class Case:
    """All runs on one model at one budget under one scoring.

    Attributes
    ----------
    problem : Problem
        The model.
    budget : str
        Name of the budget.
    scoring : str
        A key of `SCORINGS`.
    runs : dict
        ``runs[method][seed]`` is an (n, 2) front.
    sources : dict
        ``sources[method][seed]``: the stored runs that it is made of.
    classic : tuple of str
        The methods without chance among them.
    """

    problem: Problem
    budget: str
    scoring: str
    runs: dict[str, dict[int, FloatArray]]
    sources: dict[str, dict[int, list[StoredRun]]]
    classic: tuple[str, ...]
    _parts: dict[frozenset[str], Case] = field(default_factory=dict, init=False, repr=False)

    def only(self, methods: Collection[str]) -> Case:
        """Return the case of some of the methods: compared with each other, by a pseudo-optimal front of their own."""
        wanted = frozenset(methods) & frozenset(self.runs)
        if wanted not in self._parts:
            self._parts[wanted] = replace(
                self,
                runs={method: runs for method, runs in self.runs.items() if method in wanted},
                sources={method: runs for method, runs in self.sources.items() if method in wanted},
                classic=tuple(method for method in self.classic if method in wanted),
            )
        return self._parts[wanted]

    @cached_property
    def merged(self) -> Case:
        """The fronts of section 4.3: of each method its runs merged to one, unless each is merged already."""
        runs, sources = dict(self.runs), dict(self.sources)
        for method, found in self.sources.items():
            if all(len(made_of) == 1 for made_of in found.values()):
                runs[method] = {NO_SEED: merged_front(self.runs[method].values())}
                sources[method] = {NO_SEED: [run for made_of in found.values() for run in made_of]}
        return replace(self, runs=runs, sources=sources)

    @cached_property
    def optimal(self) -> OptimalFront:
        """The pseudo-optimal front: of all methods and runs."""
        return pseudo_optimal(self.runs)

    @cached_property
    def scores(self) -> dict[str, Scores]:
        """The indicators of every method against the pseudo-optimal front."""
        return unary_scores(self.runs, self.optimal, shift=self.shift)

    @property
    def shift(self) -> tuple[float, float]:
        """What is added to error and triangles before epsilon."""
        return EPSILON_SHIFT * float(self.optimal.front[:, 0].max()), 0.0

    @cached_property
    def coverage(self) -> PairTable:
        """Coverage between the runs of every two methods."""
        return coverage_table(self.runs)

    @cached_property
    def epsilon(self) -> PairTable:
        """Multiplicative epsilon, with the shift, between the runs of every two methods."""
        return epsilon_table(self.runs, shift=self.shift)

    @cached_property
    def literal_epsilon(self) -> PairTable:
        """Multiplicative epsilon, without any shift, between the runs of every two methods."""
        return epsilon_table(self.runs)

    @property
    def evolutionary(self) -> dict[str, dict[int, FloatArray]]:
        """The runs of the methods with chance."""
        return {method: runs for method, runs in self.runs.items() if method not in self.classic}

    def samples(self, a: str, b: str, indicator: str) -> tuple[FloatArray, FloatArray]:
        """Return what the runs of two methods are compared by, so that larger is better.

        Parameters
        ----------
        a, b : str
            The methods.
        indicator : str
            A key of `INDICATORS`: a number of each run (negated where smaller is better), or for "epsilon" and
            "coverage" the rates of the other method's runs that each run dominates, see `analysis.dominance_rates`.
        """
        if indicator in BINARY:
            table = self.literal_epsilon if indicator == "epsilon" else self.coverage
            forth, back = table.values[a, b], table.values[b, a]
            return dominance_rates(forth, back, indicator), dominance_rates(back, forth, indicator)
        sign = -1.0 if indicator in SMALLER_IS_BETTER else 1.0
        return sign * self.unary(a, indicator), sign * self.unary(b, indicator)

    def unary(self, method: str, indicator: str) -> FloatArray:
        """Return an indicator of every run of a method, as it is reported."""
        if indicator in ("hvr", "cardinality", "epsilon_optimal"):
            values = getattr(self.scores[method], indicator.removesuffix("_optimal"))
            return np.asarray(values, dtype=float)
        fronts = list(self.runs[method].values())
        if indicator == "extent":
            whole = float(np.ptp(self.optimal.front[:, 1]))
            return np.array([float(np.ptp(F[:, 1])) / whole if whole else 1.0 for F in fronts])
        if indicator == "trade_off":
            # by the common scale, for a method's own (Eq. 10) compares nothing between methods
            alpha = scale_factor(self.optimal.front)
            chosen = [F[trade_off(F, alpha=alpha)] for F in fronts]
            return np.array([(error + alpha * triangles) / 2 for error, triangles in chosen])
        return np.array([F[:, ("least_error", "fewest_triangles").index(indicator)].min() for F in fronts])

    def values(self, a: str, b: str, indicator: str) -> tuple[float, float]:
        """Return the means of an indicator of two methods as it is reported."""
        if indicator in BINARY:
            pairs = self.epsilon if indicator == "epsilon" else self.coverage
            return pairs.cell(a, b).mean, pairs.cell(b, a).mean
        return float(self.unary(a, indicator).mean()), float(self.unary(b, indicator).mean())

    def evaluations(self, method: str) -> FloatArray:
        """Return the evaluations that each run of a method took, all its merged runs together."""
        return np.array(
            [sum(run.record["evaluations"] for run in runs) for runs in self.sources[method].values()], dtype=float
        )

    def moves(self, method: str) -> int:
        """Return the moves of vertices that the runs of a method made; 0 for a method that makes none."""
        return sum(run.record.get("moves") or 0 for runs in self.sources[method].values() for run in runs)

    def seconds(self, method: str) -> FloatArray:
        """Return the seconds that every single search of a method took."""
        return np.array([run.record["seconds"] for runs in self.sources[method].values() for run in runs])

    def progress(self, method: str, over: str) -> list[tuple[FloatArray, FloatArray]]:
        """Return how the hypervolume ratio of each run of a method grew, from the fronts that it kept on its way.

        The ratio is against the pseudo-optimal front of all runs. Runs that are merged to one front are taken as if
        they had advanced together: at each moment their fronts at the same share of their way are merged, and what
        they had spent by then is summed.

        Parameters
        ----------
        method : str
            The method.
        over : {"evaluations", "seconds"}
            What is counted.

        Returns
        -------
        list of (x, hvr)
            For each seed the moments (K,) and the ratio at each, 0 before anything was found. Seeds with a run
            that kept no fronts are left out; so are all if this scoring is not the one that was searched by.
        """
        if self.scoring != "searched" and self.problem.rules.spares_uncovered:
            return []
        kept = [runs for runs in self.sources[method].values() if all("trace_F" in run.arrays for run in runs)]
        return [self._progress(runs, over) for runs in kept]

    def _progress(self, runs: list[StoredRun], over: str) -> tuple[FloatArray, FloatArray]:
        """Return the progress of one seed."""
        spent = [
            np.asarray(run.arrays["trace_evaluations"] if over == "evaluations" else run.record["trace_seconds"], float)
            for run in runs
        ]
        shares = [moments / (moments[-1] or 1.0) for moments in spent]
        # the moments of the run that begins last: by then all others have a front; of several, of the most moments
        last = max(range(len(runs)), key=lambda k: (shares[k][0], len(shares[k])))
        hvr = []
        for share in shares[last]:
            fronts = []
            for run, own in zip(runs, shares, strict=True):
                k = np.searchsorted(own, share, side="right") - 1
                start, end = run.arrays["trace_start"][k : k + 2]
                fronts.append(run.arrays["trace_F"][start:end])
            F = np.concatenate(fronts)
            hvr.append(hypervolume_ratio(F, self.optimal.front) if len(F) else 0.0)
        return spent[last] * (sum(moments[-1] for moments in spent) / (spent[last][-1] or 1.0)), np.array(hvr)

    def find(self, method: str, error: float, triangles: float) -> Picked:
        """Return where a solution of a method's front comes from."""
        for seed, runs in self.sources[method].items():
            for run in runs:
                F = scored(run, self.scoring)
                rows = np.flatnonzero((F[:, 0] == error) & (F[:, 1] == triangles))
                if len(rows):
                    return Picked(run, int(rows[0]), seed)
        raise KeyError(f"{method} has no solution of error {error} and {triangles} triangles")


class Study:
    """An experiment's stored results.

    Parameters
    ----------
    out : path
        The experiment's folder.

    Attributes
    ----------
    missing : list of str
        Runs that the experiment asks for and that are not there.
    damaged : list of str
        What is wrong with damaged runs; they count as missing.
    skipped : list of str
        What could not be done on the machine of the experiment.
    empty : list of str
        Runs that found no usable mesh; they are left out.

    Raises
    ------
    ResultError
        If there is no experiment, or none of its runs is finished.
    """

    def __init__(self, out: str | os.PathLike[str]) -> None:
        self.out = Path(out)
        self.content = read_experiment(self.out)
        store = RunStore(self.out)
        try:
            self._take(store)
        except (AttributeError, KeyError, TypeError, ValueError) as problem:
            what = f"{problem} is missing" if isinstance(problem, KeyError) else reason_of(problem)
            raise ResultError(
                f"{self.out / EXPERIMENT_FILE}: is damaged ({what}); `meshsimp run` writes it anew"
            ) from None
        self.damaged = store.damaged
        if not self._runs:
            raise ResultError(f"{self.out}: none of its runs is finished; `meshsimp run` does them")

    def _take(self, store: RunStore) -> None:
        """Take over what the record says, and the runs that it names."""
        self.title: str = self.content["title"]
        self.skipped: list[str] = list(self.content["skipped"])
        self.missing: list[str] = []
        self.empty: list[str] = []
        self.problems = [
            Problem(
                name=item["name"],
                source=item["source"],
                vertices=item["vertices"],
                triangles=item["triangles"],
                rules=read_back(Rules, item["rules"]),
                limits=item["limits"],
                stored=item["stored"],
                hash=item["hash"],
                unit=item.get("unit", LENGTH),  # which records of before do not have
                system=item.get("system", ""),
            )
            for item in self.content["problems"]
        ]
        self.budgets: list[str] = [item["name"] for item in self.content["budgets"]]
        # what the reader added comes first: it is what the experiment is about
        self.methods: list[str] = sorted(
            (item["name"] for item in self.content["algorithms"]),
            key=lambda name: ("own", "pymoo", "preset", "paper").index(self.kind(name)),
        )
        self._runs: dict[tuple[str, str, str, int], list[StoredRun]] = {}
        self._expected = {item["name"]: len(item["merged_values"]) for item in self.content["algorithms"]}
        self._fill(store)
        self._classic = self._read_classic(store)

    def _fill(self, store: RunStore) -> None:
        for item in self.content["runs"]:
            where = (item["problem"], item["budget"], item["algorithm"], int(item["seed"]))
            run = store.get(item["key"])
            value = "" if item["merged_value"] is None else f" / {item['merged_value']}"
            label = f"{item['problem']} / {item['algorithm']}{value} / seed {item['seed']} / {item['budget']}"
            if run is None:
                self.missing.append(label)
                continue
            if not len(run.arrays["F"]):
                self.empty.append(label)
            self._runs.setdefault(where, []).append(run)
        for where in [w for w, runs in self._runs.items() if len(runs) < self._expected[w[2]]]:
            # a merged front that lacks some of its runs would be worse than the method is
            del self._runs[where]

    def _read_classic(self, store: RunStore) -> dict[tuple[str, str], StoredRun]:
        found = {}
        for item in self.content["classic"]:
            if item["method"] not in CLASSIC_NAMES:
                raise ValueError(f"the method {item['method']!r} is none of {', '.join(CLASSIC_NAMES)}")
            run = store.get(item["key"])
            if run is None:
                self.missing.append(f"{item['problem']} / {item['method']}")
            else:
                found[item["problem"], item["method"]] = run
        return found

    @property
    def scorings(self) -> list[str]:
        """Keys of `SCORINGS` that this study needs."""
        spared = any(problem.rules.spares_uncovered for problem in self.problems)
        return ["searched", "nearest"] if spared else ["nearest"]

    @cached_property
    def all_runs(self) -> list[StoredRun]:
        """All evolutionary runs that are compared."""
        return [run for runs in self._runs.values() for run in runs]

    @cached_property
    def classic_runs(self) -> dict[tuple[str, str], StoredRun]:
        """The meshes of the classic methods by problem and method."""
        return dict(self._classic)

    @cached_property
    def cases(self) -> dict[tuple[str, str, str], Case]:
        """All cases by problem, budget and scoring; models without a finished run are left out."""
        found = {}
        for problem in self.problems:
            for budget in self.budgets:
                for scoring in self.scorings:
                    case = self._case(problem, budget, scoring)
                    if case is not None:
                        found[problem.name, budget, scoring] = case
        return found

    def compared(self, budget: str, scoring: str) -> list[Case]:
        """Return the cases of one budget and scoring, in the order of the problems."""
        wanted = [(problem.name, budget, scoring) for problem in self.problems]
        return [self.cases[key] for key in wanted if key in self.cases]

    def surface(self, problem: Problem, scoring: str = "searched") -> OfModel:
        """Return the stored model of a problem with its rules, or with those of a scoring."""
        rules = problem.rules.of_the_model
        if scoring == "nearest" and rules.spares_uncovered:
            rules = replace(rules, outside="nearest")
        # pins are in every subset that was stored
        return surface_of(read_model(self.out, problem.stored, problem.hash), replace(rules, pin=None))

    def comparisons(self, budget: str, scoring: str, indicator: str) -> list[Comparison]:
        """Compare every two methods with chance on all models; Holm's correction is over all of these."""
        key = (budget, scoring, indicator)
        if key not in self._comparisons:
            family: list[Comparison] = []
            for case in self.compared(budget, scoring):
                several = {m: runs for m, runs in case.evolutionary.items() if len(runs) > 1}
                if len(several) < 2:
                    continue
                for a, b in itertools.combinations(several, 2):
                    x, y = case.samples(a, b, indicator)
                    test = rank_sum(x, y)
                    family.append(
                        Comparison(
                            indicator, a, b, x, y, test.p, test.p, test.a12, model=case.problem.name, note=test.note
                        )
                    )
            self._comparisons[key] = corrected(family) if family else []
        return self._comparisons[key]

    @cached_property
    def _comparisons(self) -> dict[tuple[str, str, str], list[Comparison]]:
        return {}

    @cached_property
    def starts(self) -> list[Start]:
        """The first populations from which methods of the paper start, in the order of the methods."""
        found: dict[str, dict[str, str]] = {}
        for own_settings in (True, False):  # those with other settings stand for a preset where no other does
            for item in self.content["algorithms"]:
                if self.kind(item["name"]) != "paper":
                    continue
                description = item["description"]
                roles = found.setdefault(_start(description.get("settings", {}).get("sampling", {})), {})
                if own_settings != bool(description["parameters"].get("normalised")):
                    roles.setdefault(item["preset"], item["name"])
        return [Start(name, roles) for name, roles in found.items()]

    def kind(self, method: str) -> str:
        """Return what a method is: "own" (or a part of it), "pymoo" (by import path), "preset", "paper", "baseline"."""
        item = next((item for item in self.content["algorithms"] if item["name"] == method), None)
        if item is None:
            return "baseline"
        parts = [operator["name"] for operator in item["description"].get("operators", {}).values()]
        paths = [*([] if item["preset"] else [item["class"]]), *(name for name in parts if "." in name)]
        if not all(path.startswith(KNOWN_HOMES) for path in paths):
            return "own"
        if not item["preset"]:
            return "pymoo"
        return "paper" if PRESETS[item["preset"]].is_the_papers else "preset"

    @cached_property
    def versions(self) -> list[dict[str, str]]:
        """The different sets of package versions that the runs were made with."""
        different: list[dict[str, str]] = []
        for run in self.all_runs:
            if run.record["versions"] not in different:
                different.append(run.record["versions"])
        return different

    def _case(self, problem: Problem, budget: str, scoring: str) -> Case | None:
        runs: dict[str, dict[int, FloatArray]] = {}
        sources: dict[str, dict[int, list[StoredRun]]] = {}
        for method in self.methods:
            for seed in self.content["seeds"]:
                stored = self._runs.get((problem.name, budget, method, int(seed)))
                if not stored:
                    continue
                F = np.concatenate([scored(run, scoring) for run in stored])
                if len(F):
                    runs.setdefault(method, {})[int(seed)] = non_dominated(F)
                    sources.setdefault(method, {})[int(seed)] = stored
        if not runs:
            return None
        classic = []
        for (name, method), run in self._classic.items():
            if name != problem.name:
                continue
            F = scored(run, scoring)
            usable = np.isfinite(F[:, 0]) & (F[:, 1] > 0) & problem.meets_limits(run.arrays["F"])
            if scoring == "searched" and BASELINES[method].tool:
                usable &= run.arrays["paper"].astype(bool)
            if usable.any():
                label = CLASSIC_NAMES[method]
                classic.append(label)
                runs[label] = {NO_SEED: non_dominated(F[usable])}
                sources[label] = {NO_SEED: [run]}
        return Case(problem, budget, scoring, runs, sources, tuple(classic))


def on_all_models(cases: Sequence[Case]) -> list[str]:
    """Return the methods that have runs on every model, in their order."""
    return [method for method in cases[0].runs if all(method in case.runs for case in cases)]


def ranked(cases: Sequence[Case]) -> tuple[list[str], Friedman]:
    """Rank methods on every model by the median hypervolume ratio of their runs; Friedman's test over the models.

    Parameters
    ----------
    cases : sequence of Case
        The models at one budget and scoring.

    Returns
    -------
    methods : list of str
        Those that have runs on all models; the others cannot be ranked.
    found : Friedman
        Their ranks, in the same order.

    Raises
    ------
    ValueError
        If they are fewer than two.
    """
    methods = on_all_models(cases)
    medians = np.array([[np.median(case.scores[method].hvr) for method in methods] for case in cases])
    return methods, friedman(medians)


def scored(run: StoredRun, scoring: str) -> FloatArray:
    """Return the objectives (n, 2) of a run under a scoring."""
    F = np.asarray(run.arrays["F"], dtype=float)
    if scoring == "searched":
        return F
    return np.column_stack([run.arrays["error_nearest"], F[:, 1]]) if len(F) else F.reshape(0, 2)


def _start(sampling: Mapping[str, Any]) -> str:
    """Return in words how a first population is drawn.

    >>> _start({"class": "meshsimp_pymoo.RandomSubset", "size": 0.2}), _start({"class": "meshsimp_pymoo.RandomSubset"})
    ('start at n = 0.2 N', 'start at all sizes')
    >>> _start({"class": "meshsimp_pymoo.RandomSubset", "size": [150, 220]}), _start({"class": "pymoo.X.LHS"})
    ('start at n = 150 to 220', 'start by LHS')
    """
    name = str(sampling.get("class", "")).rpartition(".")[2]
    if name not in ("", "RandomSubset"):
        return f"start by {name}"
    size = sampling.get("size")
    if size is None:
        return "start at all sizes"
    ends = size if isinstance(size, (list, tuple)) else [size]
    return "start at n = " + " to ".join(f"{end:g} N" if isinstance(end, float) else f"{end}" for end in ends)
