"""What many runs say about methods: merged fronts, tables, tests, chosen solutions, attainment.

Everything here is a pure function of fronts: ``runs[method][seed]`` is an (n, 2) array of (error, triangles),
both minimised, and belongs to one model. A method without chance has a single run, whatever its seed is
called. No files, no figures.

The order of a study:

1. `pseudo_optimal`: what a method found in all its runs, or what all methods found together;
2. `unary_scores`: hypervolume ratio, epsilon, coverage and cardinality of every run against that optimum;
   `epsilon_table`, `coverage_table`: every method's runs against every other's, the paper's Tables 2 and 1;
3. `dominance_rates`, to which the paper's Wilcoxon procedure comes down for a binary indicator; `corrected` for
   many comparisons; the tests themselves are in `meshsimp_pymoo.comparison.statistics`;
4. `selected_solutions`: the paper's three solutions per method, and the knees;
5. `attainment_surfaces`: where a share of a method's runs gets; `anytime`: how far they are at each moment.

Where the paper's text leaves something open, what was read into it is marked as a reading.

References
----------
.. [1] R. Campomanes-Álvarez, O. Cordón, S. Damas, Ó. Martín, "Evolutionary multi-objective optimization for
   mesh simplification of 3D open models", Integrated Computer-Aided Engineering 20(4), 2013.
.. [2] L. Sánchez and J. R. Villar, "Obtaining transparent models of chaotic systems with multi-objective
   simulated annealing algorithms", Information Sciences 178(4), 2008.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import moocore
import numpy as np
from numpy.typing import ArrayLike

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.comparison.statistics import ALPHA, Summary, holm, summarise
from meshsimp_pymoo.indicators import (
    cardinality,
    coverage,
    epsilon,
    hypervolume_ratio,
    merged_front,
    non_dominated,
)
from meshsimp_pymoo.reprs import brief

__all__ = [
    "COVERAGE_THRESHOLD",
    "Comparison",
    "OptimalFront",
    "PairTable",
    "Scores",
    "Solution",
    "anytime",
    "attainment_surfaces",
    "corrected",
    "coverage_table",
    "dominance_rates",
    "epsilon_table",
    "knees",
    "pseudo_optimal",
    "scale_factor",
    "selected_solutions",
    "trade_off",
    "unary_scores",
]

Runs = Mapping[str, Mapping[int, ArrayLike]]

# The coverage from which one run counts as dominating another (Section 4.6).
COVERAGE_THRESHOLD = 0.75

TRADE_OFFS = {"ranges": "trade_off", "paper": "trade_off_paper"}
"""The rules of `trade_off`, and the kind of `Solution` that each gives."""


@brief
@dataclass(frozen=True)
class OptimalFront:
    """The best solutions that all methods found together, and who found them.

    Attributes
    ----------
    front : (P, 2) float array
        The pseudo-optimal front, sorted by triangles.
    found_by : tuple of P tuples of (method, seed)
        The runs whose front holds the solution, in the order of the runs.
    """

    front: FloatArray
    found_by: tuple[tuple[tuple[str, int], ...], ...]

    def share(self, method: str) -> float:
        """Return the share of the front's solutions that a method found, alone or not."""
        return float(np.mean([any(name == method for name, _ in runs) for runs in self.found_by]))


@brief
@dataclass(frozen=True)
class PairTable:
    """A binary indicator between the runs of every two methods.

    Attributes
    ----------
    indicator : str
        Its name.
    methods : tuple of str
        Rows and columns.
    values : dict of (method, method) to (n, m) float array
        ``values[a, b][i, j]`` is the indicator of run i of a over run j of b.
    """

    indicator: str
    methods: tuple[str, ...]
    values: Mapping[tuple[str, str], FloatArray]

    def cell(self, a: str, b: str) -> Summary:
        """Return the mean and the standard deviation over all pairs of a run of ``a`` and a run of ``b``."""
        return summarise(self.values[a, b].ravel())


@brief
@dataclass(frozen=True)
class Scores:
    """The indicators of a method against the pseudo-optimal front.

    Attributes
    ----------
    seeds : (n,) int array
        The runs, in the order of all other arrays here.
    hvr, epsilon, coverage : (n,) float array
        Of each run's front against the pseudo-optimal one: hypervolume ratio, multiplicative epsilon, share
        of the pseudo-optimal front that the run weakly dominates, that is, found.
    cardinality : (n,) int array
        Number of non-dominated solutions of each run.
    merged_hvr, merged_epsilon, merged_coverage, merged_cardinality
        The same of the method's merged front.
    """

    seeds: IntArray
    hvr: FloatArray
    epsilon: FloatArray
    coverage: FloatArray
    cardinality: IntArray
    merged_hvr: float
    merged_epsilon: float
    merged_coverage: float
    merged_cardinality: int


@brief
@dataclass(frozen=True)
class Comparison:
    """Two methods compared by one indicator on one model.

    Attributes
    ----------
    indicator, a, b, model : str
        What is compared, and where.
    sample_a, sample_b : (n,), (m,) float array
        The samples of the test, larger is better: an indicator of each run, or for a binary indicator the
        rate of the other method's runs that each run dominates.
    p : float
        Raw two-sided p-value, as in the paper.
    p_holm : float
        The same after Holm's correction for all comparisons made together.
    a12 : float
        Vargha-Delaney effect size, more than 0.5 in favour of ``a``.
    alpha : float
        Level of significance.
    note : str
        What to know before believing p.
    """

    indicator: str
    a: str
    b: str
    sample_a: FloatArray
    sample_b: FloatArray
    p: float
    p_holm: float
    a12: float
    alpha: float = ALPHA
    model: str = ""
    note: str = ""

    @property
    def winner(self) -> str:
        """The method that is better at the raw p-value, as the paper decides; empty if none is."""
        return self._winner(self.p)

    @property
    def winner_holm(self) -> str:
        """The method that is better after Holm's correction; empty if none is."""
        return self._winner(self.p_holm)

    def _winner(self, p: float) -> str:
        mean_a, mean_b = float(np.mean(self.sample_a)), float(np.mean(self.sample_b))
        if not p < self.alpha or mean_a == mean_b:
            return ""
        return self.a if mean_a > mean_b else self.b


@dataclass(frozen=True)
class Solution:
    """A solution picked from a method's merged front.

    Attributes
    ----------
    kind : str
        "least_error", "fewest_triangles", "trade_off", "trade_off_paper" or "knee".
    error : float
        [model units]
    triangles : int
        Number of triangles.
    seeds : tuple of int
        The runs that found it.
    """

    kind: str
    error: float
    triangles: int
    seeds: tuple[int, ...]


def pseudo_optimal(runs: Runs) -> OptimalFront:
    """Return the front of every method and run together, with the runs that found each of its solutions.

    Examples
    --------
    >>> optimal = pseudo_optimal({"a": {1: [[3.0, 2], [2.0, 6]]}, "b": {1: [[3.0, 2]], 2: [[1.0, 6]]}})
    >>> optimal.front
    array([[3., 2.],
           [1., 6.]])
    >>> optimal.found_by
    ((('a', 1), ('b', 1)), (('b', 2),))
    >>> optimal.share("a")
    0.5
    """
    fronts = _fronts(runs)
    front = non_dominated(np.vstack([F for seeds in fronts.values() for F in seeds.values()]))
    found: dict[bytes, list[tuple[str, int]]] = {row.tobytes(): [] for row in front}
    for method, seeds in fronts.items():
        for seed, F in seeds.items():
            for row in F:
                if row.tobytes() in found:
                    found[row.tobytes()].append((method, seed))
    return OptimalFront(front, tuple(tuple(found[row.tobytes()]) for row in front))


def unary_scores(
    runs: Runs, optimal: OptimalFront | ArrayLike | None = None, *, shift: ArrayLike = 0.0
) -> dict[str, Scores]:
    """Return the indicators of every run of every method against the pseudo-optimal front.

    Parameters
    ----------
    runs : mapping
        ``runs[method][seed]`` is an (n, 2) front.
    optimal : OptimalFront or (P, 2) array-like, optional
        The (pseudo-)optimal front; `pseudo_optimal` of the runs unless given.
    shift : float or (2,) array-like
        Added to the objectives for epsilon, see `indicators.epsilon`.
    """
    fronts = _fronts(runs)
    if optimal is None:
        optimal = pseudo_optimal(runs)
    best = optimal.front if isinstance(optimal, OptimalFront) else non_dominated(optimal, "the optimal front")
    scores = {}
    for method, seeds in fronts.items():
        merged = merged_front(seeds.values())
        scores[method] = Scores(
            seeds=np.array(list(seeds), dtype=np.int64),
            hvr=np.array([hypervolume_ratio(F, best) for F in seeds.values()]),
            epsilon=np.array([epsilon(F, best, shift=shift) for F in seeds.values()]),
            coverage=np.array([coverage(F, best) for F in seeds.values()]),
            cardinality=np.array([cardinality(F) for F in seeds.values()], dtype=np.int64),
            merged_hvr=hypervolume_ratio(merged, best),
            merged_epsilon=epsilon(merged, best, shift=shift),
            merged_coverage=coverage(merged, best),
            merged_cardinality=cardinality(merged),
        )
    return scores


def coverage_table(runs: Runs) -> PairTable:
    """Return the coverage C between the runs of every two methods, as in the paper's Table 1.

    A reading: Section 4.5 prints means without saying of what. A merged front has one value and no deviation, which
    Table 2 has, so a cell averages over all pairs of a run of the one and a run of the other method.

    Examples
    --------
    >>> table = coverage_table({"a": {1: [[3, 2], [1, 6]]}, "b": {1: [[3, 2], [2, 6]]}})
    >>> table.cell("a", "b").mean, table.cell("b", "a").mean
    (1.0, 0.5)
    """
    return _pair_table("coverage", runs, coverage)


def epsilon_table(runs: Runs, *, shift: ArrayLike = 0.0) -> PairTable:
    """Return the multiplicative epsilon I between the runs of every two methods, as in the paper's Table 2.

    Its cells are read as those of `coverage_table`.
    """
    return _pair_table("epsilon", runs, lambda A, B: epsilon(A, B, shift=shift))


def dominance_rates(
    forth: ArrayLike, back: ArrayLike, indicator: str, *, threshold: float = COVERAGE_THRESHOLD
) -> FloatArray:
    """Return P_A(B): for each run of A the share of B's runs that it dominates by an indicator [2]_.

    Run i of A dominates run j of B

    * by "epsilon" if I(A_i, B_j) <= 1 < I(B_j, A_i), that is, if A_i is better than B_j;
    * by "coverage" if C(A_i, B_j) >= threshold > C(B_j, A_i).

    A reading: Section 4.6 has the procedure of [2]_ and the threshold of 0.75; that the reverse coverage must stay
    below it is added here, so that of two nearly equal runs neither dominates the other.

    Parameters
    ----------
    forth : (n, m) array-like
        The indicator of each run of A over each run of B.
    back : (m, n) array-like
        The indicator of each run of B over each run of A.
    indicator : {"epsilon", "coverage"}
        Which indicator it is.
    threshold : float
        For the coverage.

    Returns
    -------
    (n,) float array
        Between 0 and 1. The values share their opponents, so they are not independent, and p-values drawn
        from them are somewhat too small.

    References
    ----------
    .. [2] L. Sánchez and J. R. Villar, "Obtaining transparent models of chaotic systems with multi-objective
       simulated annealing algorithms", Information Sciences 178(4), 2008.

    Examples
    --------
    The first run covers all of one opponent and half of the other, the second run nothing:

    >>> dominance_rates([[1.0, 0.5], [0.0, 0.0]], [[0.2, 1.0], [0.3, 0.9]], "coverage")
    array([0.5, 0. ])
    """
    there, reverse = np.asarray(forth, dtype=float), np.asarray(back, dtype=float).T
    if there.shape != reverse.shape or there.ndim != 2:
        raise ValueError(f"the tables of A over B {there.shape} and of B over A {reverse.T.shape} do not match")
    if indicator == "epsilon":
        dominates = (there <= 1) & (reverse > 1)
    elif indicator == "coverage":
        dominates = (there >= threshold) & (reverse < threshold)
    else:
        raise ValueError(f"{indicator!r} is not a binary indicator: choose 'epsilon' or 'coverage'")
    return np.asarray(dominates.mean(axis=1), dtype=float)


def corrected(comparisons: Iterable[Comparison]) -> list[Comparison]:
    """Return comparisons with Holm's correction over all of them, e.g. of one indicator on all models."""
    family = list(comparisons)
    adjusted = holm([comparison.p for comparison in family])
    return [replace(comparison, p_holm=float(p)) for comparison, p in zip(family, adjusted, strict=True)]


def scale_factor(front: ArrayLike, rule: str = "ranges") -> float | None:
    """Return alpha, which brings error and triangles to one scale, by a rule of `trade_off`.

    ========= ======================================================= =====================================
    rule      alpha                                                   unit
    ========= ======================================================= =====================================
    "ranges"  range of the errors / range of the triangles            errors per triangle; multiplies T
    "paper"   mean of triangles / error over all solutions (Eq. 10)   triangles per error; multiplies E
    ========= ======================================================= =====================================

    Parameters
    ----------
    front : (n, 2) array-like
        (error, triangles).
    rule : {"ranges", "paper"}
        Which.

    Returns
    -------
    float or None
        None where Eq. 10 is undefined: a solution without error would count infinitely much. By the ranges, 1
        where the front has no extent (a single solution).

    Examples
    --------
    >>> front = [[100.0, 2], [25.0, 52]]
    >>> scale_factor(front), scale_factor(front, "paper")
    (1.5, 1.05)
    >>> scale_factor([[100.0, 2], [0.0, 52]], "paper") is None
    True
    """
    F = non_dominated(front, "the front")
    if rule == "ranges":
        error, triangles = np.ptp(F, axis=0)
        return float(error / triangles) if error > 0 and triangles > 0 else 1.0
    if rule != "paper":
        raise ValueError(f"{rule!r} is no rule of the trade-off: choose {' or '.join(map(repr, TRADE_OFFS))}")
    with np.errstate(divide="ignore", over="ignore"):
        alpha = float(np.mean(F[:, 1] / F[:, 0]))
    return alpha if math.isfinite(alpha) else None


def trade_off(
    front: ArrayLike,
    *,
    rule: str = "ranges",
    alpha: float | None = None,
    n_weights: int | None = None,
    random_state: np.random.Generator | None = None,
) -> int | None:
    """Return the best trade-off of a front between error and triangles: the least weighted sum of both.

    ========= ==================================== ========================================================
    rule      value of a solution                  alpha, see `scale_factor`
    ========= ==================================== ========================================================
    "ranges"  mean of w E + (1 - w) alpha T        ratio of the ranges: as if both were scaled to [0, 1]
    "paper"   mean of alpha w E + (1 - w) T        Eq. 10: the mean of T / E over the method's own front
    ========= ==================================== ========================================================

    The mean is over weights w, uniform in [0, 1]; the paper draws 1000 (Section 4.7, Eqs. 9 and 11). It is linear
    in w, so that many weights say what their mean does, and the mean of all is 1/2. That is the default: the same
    choice every time. Where the values of neighbours are close, 1000 weights choose now one and now the other.

    The two differ widely where the front is long: the few solutions of the least error have nearly all of the mean of
    T / E, so that the paper's rule chooses larger meshes the closer a method came to no error, and none where one
    of its meshes has none.

    Parameters
    ----------
    front : (n, 2) array-like
        (error, triangles), non-dominated and sorted by triangles, as `indicators.non_dominated` gives it.
    rule : {"ranges", "paper"}
        Which.
    alpha : float, optional
        In place of the `scale_factor` of the front. By "ranges", give all methods the same, that of the
        pseudo-optimal front, to compare their choices.
    n_weights : int, optional
        How many random weights to take the mean of, in place of 1/2.
    random_state : numpy.random.Generator, optional
        Draws the weights; needed for them.

    Returns
    -------
    int or None
        Row of ``front``, of equal values the one with the fewest triangles. None where the paper's rule is undefined.

    Examples
    --------
    >>> trade_off([[10, 2], [1, 4], [0, 20]])
    1
    >>> trade_off([[10, 2], [1, 4], [0, 20]], rule="paper") is None
    True
    >>> trade_off([[10, 2], [1, 4]], rule="paper", n_weights=1000, random_state=np.random.default_rng(1))
    1
    """
    return _trade_off(_front(front), rule, alpha, _mean_weight(n_weights, random_state))


def _mean_weight(n_weights: int | None, random_state: np.random.Generator | None) -> float:
    """Return the mean of so many random weights; 1/2, that of all, unless they are asked for."""
    if (n_weights is None) != (random_state is None):
        raise ValueError("random weights need both their number, n_weights, and a random_state that draws them")
    if n_weights is None or random_state is None:
        return 0.5
    if n_weights < 1:
        raise ValueError(f"n_weights is {n_weights}: give at least 1")
    return float(random_state.uniform(size=n_weights).mean())


def _trade_off(F: FloatArray, rule: str, alpha: float | None, weight: float) -> int | None:
    """Return the row of the least value at the mean weight."""
    factor = scale_factor(F, rule) if alpha is None else float(alpha)
    if factor is None:
        return None
    if not (math.isfinite(factor) and factor > 0):
        raise ValueError(f"the scale factor alpha is {factor}: it must be positive")
    scales = (factor, 1.0) if rule == "paper" else (1.0, factor)
    value = F @ (np.array([weight, 1 - weight]) * scales)
    # equal but for rounding is equal, as are both ends of a front scaled by its own ranges
    return int(np.argmax(value <= value.min() * (1 + 1e-12)))


def knees(front: ArrayLike) -> IntArray:
    """Return the knees of a front, where a little of one objective costs much of the other.

    By pymoo's decision making: `pymoo.mcdm.high_tradeoff.HighTradeoffPoints` on the front normalised to
    [0, 1], that is, the solutions whose least trade-off towards their neighbours is an outlier among all.

    Parameters
    ----------
    front : (n, 2) array-like
        (error, triangles), non-dominated and sorted by triangles, as `indicators.non_dominated` gives it.

    Returns
    -------
    (k,) int array
        Rows of ``front``; none for fewer than three solutions, and where no solution stands out.
    """
    F = _front(front)
    if len(F) < 3:
        return np.empty(0, dtype=np.int64)
    # pymoo imports from a deprecated place of SciPy, divides by zero on purpose, and changes the global
    # warning filters for good: all of that stays in here
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        from pymoo.mcdm.high_tradeoff import HighTradeoffPoints

        rows = HighTradeoffPoints(zero_to_one=True, ideal=F.min(axis=0), nadir=F.max(axis=0))(F)
    return np.empty(0, dtype=np.int64) if rows is None else np.sort(np.asarray(rows, dtype=np.int64))


def selected_solutions(
    runs: Runs,
    *,
    optimal: OptimalFront | ArrayLike | None = None,
    n_weights: int | None = None,
    random_state: np.random.Generator | None = None,
) -> dict[str, tuple[Solution, ...]]:
    """Return the paper's three solutions of every method (Section 4.7), and its knees.

    They come from the method's merged front: the least error, the fewest triangles, the best trade-off by both
    rules of `trade_off`, and any number of knees.

    Parameters
    ----------
    runs : mapping
        ``runs[method][seed]`` is an (n, 2) front.
    optimal : OptimalFront or (P, 2) array-like, optional
        Gives the scale factor of the rule "ranges"; `pseudo_optimal` of the runs unless given.
    n_weights, random_state
        As in `trade_off`; the weights are the same for all methods.

    Returns
    -------
    dict of str to tuple of Solution
        "least_error", "fewest_triangles", "trade_off", "trade_off_paper" where it is defined, then the knees from
        few triangles to many.

    Examples
    --------
    >>> runs = {"a": {1: [[9, 2], [1, 4]], 2: [[0.5, 30]]}}
    >>> for solution in selected_solutions(runs)["a"][:4]:
    ...     print(solution)
    Solution(kind='least_error', error=0.5, triangles=30, seeds=(2,))
    Solution(kind='fewest_triangles', error=9.0, triangles=2, seeds=(1,))
    Solution(kind='trade_off', error=1.0, triangles=4, seeds=(1,))
    Solution(kind='trade_off_paper', error=1.0, triangles=4, seeds=(1,))
    """
    fronts = _fronts(runs)
    if optimal is None:
        optimal = pseudo_optimal(runs)
    common = scale_factor(optimal.front if isinstance(optimal, OptimalFront) else optimal)
    weight = _mean_weight(n_weights, random_state)
    chosen = {}
    for method, seeds in fronts.items():
        found = pseudo_optimal({method: seeds})
        front = found.front
        rows: list[tuple[str, int | None]] = [("least_error", len(front) - 1), ("fewest_triangles", 0)]
        for rule, kind in TRADE_OFFS.items():
            rows.append((kind, _trade_off(front, rule, common if rule == "ranges" else None, weight)))
        rows += [("knee", int(row)) for row in knees(front)]
        chosen[method] = tuple(
            Solution(kind, float(front[row, 0]), int(front[row, 1]), tuple(seed for _, seed in found.found_by[row]))
            for kind, row in rows
            if row is not None
        )
    return chosen


def attainment_surfaces(
    runs: Mapping[int, ArrayLike], percentages: Sequence[float] | None = None
) -> dict[float, FloatArray]:
    """Return how far at least a given share of a method's runs gets: surfaces of the empirical attainment.

    Every point on or beyond the surface for p % is weakly dominated by a solution of at least p % of runs.

    Parameters
    ----------
    runs : mapping of seed to (n, 2) array-like
        The fronts of one method.
    percentages : sequence of float, optional
        Each more than 0 and at most 100; by default one run (the best surface), half, all (the worst).

    Returns
    -------
    dict of float to (k, 2) float array
        For each percentage the corners of its surface, sorted by triangles.

    References
    ----------
    .. [1] V. Grunert da Fonseca, C. M. Fonseca and A. O. Hall, "Inferential performance assessment of
       stochastic optimisers and the attainment function", EMO 2001.

    Examples
    --------
    What both runs reach, though neither has such a solution:

    >>> attainment_surfaces({1: [[3, 2], [1, 6]], 2: [[2, 4]]}, [100])[100]
    array([[3., 4.],
           [2., 6.]])
    """
    fronts = _fronts({"method": runs})["method"]
    levels = [100 / len(fronts), 50.0, 100.0] if percentages is None else list(percentages)
    for level in levels:
        if not 0 < level <= 100:
            raise ValueError(f"the percentage {level} is not more than 0 and at most 100")
    points = np.vstack(list(fronts.values()))
    sets = np.repeat(np.arange(len(fronts)), [len(F) for F in fronts.values()])
    surfaces = {}
    for level in levels:
        # a percentage that ends between two numbers of runs means the next one
        n_runs = math.ceil(level * len(fronts) / 100 - 1e-9)
        surface = moocore.eaf(points, sets, percentiles=[100 * n_runs / len(fronts)])[:, :2]
        surfaces[level] = non_dominated(surface)
    return surfaces


def anytime(curves: Sequence[tuple[ArrayLike, ArrayLike]], moments: ArrayLike) -> FloatArray:
    """Return the quartiles over runs of what each had reached at given moments.

    What a run has is what it had at its last known moment: nothing before the first, nothing is guessed in between,
    and what an ended run has, it keeps.

    Parameters
    ----------
    curves : sequence of (x, y)
        For each run its moments (K,), in order, and what it had then (K,), such as of `Case.progress`.
    moments : (t,) array-like
        When to look.

    Returns
    -------
    (3, t) float array
        Lower quartile, median and upper quartile.

    Examples
    --------
    >>> anytime([([1, 10], [0.2, 0.6]), ([2, 20], [0.4, 0.8])], [1, 2, 10, 100])
    array([[0.05, 0.25, 0.45, 0.65],
           [0.1 , 0.3 , 0.5 , 0.7 ],
           [0.15, 0.35, 0.55, 0.75]])
    """
    if not curves:
        raise ValueError("there are no curves; was anything traced?")
    when = np.asarray(moments, dtype=float)
    reached = []
    for x, y in curves:
        last = np.searchsorted(np.asarray(x, dtype=float), when, side="right") - 1
        reached.append(np.where(last < 0, 0.0, np.asarray(y, dtype=float)[last]))
    return np.asarray(np.quantile(reached, [0.25, 0.5, 0.75], axis=0), dtype=float)


def _fronts(runs: Runs) -> dict[str, dict[int, FloatArray]]:
    """Return the front of every run, seeds in order, or say which run is unusable."""
    if not runs:
        raise ValueError("there are no runs to analyse; was anything finished?")
    fronts: dict[str, dict[int, FloatArray]] = {}
    for method, seeds in runs.items():
        if not seeds:
            raise ValueError(f"the method {method!r} has no runs; leave it out or finish it")
        fronts[method] = {}
        for seed in sorted(seeds):
            name = f"the front of the method {method!r} with seed {seed}"
            fronts[method][seed] = non_dominated(seeds[seed], name)
            if fronts[method][seed].shape[1] != 2:
                raise ValueError(f"{name} has {fronts[method][seed].shape[1]} columns: give (error, triangles)")
    return fronts


def _front(front: ArrayLike) -> FloatArray:
    """Return a front whose rows mean the same to the caller, or say that it is none."""
    F = np.asarray(front, dtype=float)
    reduced = non_dominated(F, "the front")
    if F.shape != reduced.shape or not np.array_equal(F, reduced):
        raise ValueError(
            f"these {len(F)} solutions are not a front sorted by triangles, so rows would be ambiguous; "
            "pass them through indicators.non_dominated first"
        )
    return F


def _pair_table(name: str, runs: Runs, indicator: Callable[[FloatArray, FloatArray], float]) -> PairTable:
    """Return an indicator between the runs of every two different methods."""
    fronts = _fronts(runs)
    values = {
        (a, b): np.array([[indicator(A, B) for B in fronts[b].values()] for A in fronts[a].values()])
        for a, b in itertools.permutations(fronts, 2)
    }
    return PairTable(name, tuple(fronts), values)
