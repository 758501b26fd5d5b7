"""The stored runs of an experiment, sorted for comparison: one `Case` for each model, budget and scoring.

Where the search did not charge for uncovered vertices (``outside: ignore``, the paper's reading), every mesh
is scored in two ways:

as searched
    by the error that the algorithms saw. Of MeshLab's meshes only the paper's series, reductions of 5 to
    50 %, is compared: the smaller ones abandon nearly all of the model, and score well by that.
every vertex
    by the error with ``outside: nearest``, where an uncovered vertex costs its distance to the mesh. All of
    MeshLab's meshes are compared.

Where the search charged for them already, there is the second scoring alone.

**Epsilon** compares errors by their ratio, and random subsets of every size include the whole mesh now and
then, whose error is 0: one lucky draw would make the epsilon of everything else infinite. So `EPSILON_SHIFT`
of the largest error of the pseudo-optimal front is added to every error first. That changes no verdict of who
covers whom (I <= 1 holds with the shift exactly if it holds without).
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

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
    unary_scores,
)
from meshsimp_pymoo.comparison.meshlab import MESHLAB_METHODS
from meshsimp_pymoo.comparison.statistics import Friedman, friedman, rank_sum
from meshsimp_pymoo.comparison.store import EXPERIMENT_FILE, RunStore, StoredRun, read_experiment, read_model
from meshsimp_pymoo.errors import ResultError, reason_of
from meshsimp_pymoo.indicators import hypervolume_ratio, non_dominated
from meshsimp_pymoo.settings import read_back
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.rules import Rules

__all__ = [
    "CLASSIC_NAMES",
    "EPSILON_SHIFT",
    "SCORINGS",
    "Case",
    "Picked",
    "Problem",
    "Study",
    "ranked",
]


SCORINGS = {"searched": "as searched", "nearest": "every vertex"}
"""The scorings by key: what they are called."""

EPSILON_SHIFT = 0.01
"""Share of the pseudo-optimal front's largest error that is added to every error before epsilon."""

# A method without chance has one run, under this name.
NO_SEED = 0

# What tables call the methods without chance.
CLASSIC_NAMES = {name: method.label for name, method in MESHLAB_METHODS.items()}


@dataclass(frozen=True)
class Problem:
    """A problem as the record of the experiment describes it."""

    name: str
    source: str
    vertices: int
    triangles: int
    rules: Rules
    stored: str
    hash: str


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
        indicator : {"hvr", "cardinality", "epsilon_optimal", "epsilon", "coverage"}
            An indicator of each run (the epsilon to the pseudo-optimal front, which is better when smaller, is
            negated), or for "epsilon" and "coverage" the rates of the other method's runs that each run
            dominates, see `analysis.dominance_rates`.
        """
        if indicator in ("epsilon", "coverage"):
            table = self.literal_epsilon if indicator == "epsilon" else self.coverage
            forth, back = table.values[a, b], table.values[b, a]
            return dominance_rates(forth, back, indicator), dominance_rates(back, forth, indicator)
        x, y = self.scores[a], self.scores[b]
        if indicator == "epsilon_optimal":
            return -x.epsilon, -y.epsilon
        return getattr(x, indicator).astype(float), getattr(y, indicator).astype(float)

    def evaluations(self, method: str) -> FloatArray:
        """Return the evaluations that each run of a method took, all its merged runs together."""
        return np.array(
            [sum(run.record["evaluations"] for run in runs) for runs in self.sources[method].values()], dtype=float
        )

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
        if self.scoring != "searched" and self.problem.rules.outside != "nearest":
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
        # the moments of the run that begins last: by then all others have a front
        last = int(np.argmax([share[0] for share in shares]))
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
                stored=item["stored"],
                hash=item["hash"],
            )
            for item in self.content["problems"]
        ]
        self.budgets: list[str] = [item["name"] for item in self.content["budgets"]]
        self.methods: list[str] = [item["name"] for item in self.content["algorithms"]]
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
        charged = all(problem.rules.outside == "nearest" for problem in self.problems)
        return ["nearest"] if charged else ["searched", "nearest"]

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

    def surface(self, problem: Problem, scoring: str = "searched") -> HeightSurface:
        """Return the stored model of a problem with its rules, or with those of a scoring."""
        outside = "nearest" if scoring == "nearest" else problem.rules.outside
        model = read_model(self.out, problem.stored, problem.hash)
        # the model holds the weights; pins are in every subset that was stored
        return HeightSurface(model, replace(problem.rules, outside=outside, weights=None, pin=None))

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

    def role(self, preset: str) -> str | None:
        """Return the method that stands for a preset of the paper: the first with its own settings."""
        found = [item for item in self.content["algorithms"] if item["preset"] == preset]
        found.sort(key=lambda item: bool(item["description"]["parameters"].get("normalised")))
        return found[0]["name"] if found else None

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
            usable = np.isfinite(F[:, 0]) & (F[:, 1] > 0)
            if scoring == "searched":
                usable &= run.arrays["paper"].astype(bool)
            if usable.any():
                label = CLASSIC_NAMES[method]
                classic.append(label)
                runs[label] = {NO_SEED: non_dominated(F[usable])}
                sources[label] = {NO_SEED: [run]}
        return Case(problem, budget, scoring, runs, sources, tuple(classic))


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
    methods = [method for method in cases[0].runs if all(method in case.runs for case in cases)]
    medians = np.array([[np.median(case.scores[method].hvr) for method in methods] for case in cases])
    return methods, friedman(medians)


def scored(run: StoredRun, scoring: str) -> FloatArray:
    """Return the objectives (n, 2) of a run under a scoring."""
    F = np.asarray(run.arrays["F"], dtype=float)
    if scoring == "searched":
        return F
    return np.column_stack([run.arrays["error_nearest"], F[:, 1]]) if len(F) else F.reshape(0, 2)
