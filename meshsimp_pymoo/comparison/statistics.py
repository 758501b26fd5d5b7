"""Tests and summaries of samples: what numbers say, whatever they are of.

Everything here is a pure function of numbers. Which test is used where:

===================== ======================================================================================
`rank_sum`            two methods on one model, over their runs: independent samples, since runs are no pairs
`signed_rank`         two methods over several models: each model is a pair; also over runs where someone
                      made them pairs, by the same initial population for instance
`friedman`            more than two methods over several models, with Nemenyi's critical difference
`holm`                corrects the p-values of many of the first two
`performance_profile` no test: how often a method is within a factor of the best
===================== ======================================================================================

The paper names both of Wilcoxon's tests, the signed-rank test in its Section 4.6 and the rank-sum test in Section 5.
Its samples are runs with different seeds, so the second is the one that fits them, and what a study's verdicts
on single models rest on.

References
----------
.. [1] A. Vargha and H. D. Delaney, "A critique and improvement of the CL common language effect size
   statistics of McGraw and Wong", Journal of Educational and Behavioral Statistics 25(2), 2000.
.. [2] S. Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of Statistics
   6(2), 1979.
.. [3] D. S. Kerby, "The simple difference formula: an approach to teaching nonparametric correlation",
   Comprehensive Psychology 3, 2014.
.. [4] J. Demšar, "Statistical comparisons of classifiers over multiple data sets", Journal of Machine Learning
   Research 7, 2006.
.. [5] R. L. Iman and J. M. Davenport, "Approximations of the critical region of the Friedman statistic",
   Communications in Statistics A 9(6), 1980.
.. [6] E. D. Dolan and J. J. Moré, "Benchmarking optimization software with performance profiles", Mathematical
   Programming 91(2), 2002.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.reprs import brief

__all__ = [
    "ALPHA",
    "Friedman",
    "RankSum",
    "SignedRank",
    "Summary",
    "friedman",
    "holm",
    "least_cases",
    "magnitude",
    "performance_profile",
    "rank_sum",
    "signed_rank",
    "summarise",
    "vargha_delaney",
]

ALPHA = 0.05
"""The level of significance, the paper's."""


@dataclass(frozen=True)
class Summary:
    """Mean and standard deviation of some values.

    Attributes
    ----------
    mean, std : float
        The standard deviation is the sample's (n - 1); NaN where there is none, as `note` says.
    n : int
        Number of values.
    note : str
        Why a number is NaN or infinite; empty if none is.
    """

    mean: float
    std: float
    n: int
    note: str = ""


@dataclass(frozen=True)
class RankSum:
    """A Wilcoxon rank-sum test between two samples.

    Attributes
    ----------
    p : float
        Two-sided p-value.
    a12 : float
        Vargha-Delaney effect size: the probability that a value of the first sample is larger than one of the
        second, ties counted half; 0.5 is no effect.
    exact : bool
        Whether p is exact (no ties) or the normal approximation with corrections for ties and continuity.
    note : str
        What to know before believing p; mostly empty.
    """

    p: float
    a12: float
    exact: bool
    note: str = ""


@dataclass(frozen=True)
class SignedRank:
    """A Wilcoxon signed-rank test between the values of pairs.

    Attributes
    ----------
    p : float
        Two-sided p-value, exact.
    rank_biserial : float
        Effect size, the matched-pairs rank-biserial correlation [3]_: the share of the rank sum that the first
        sample's larger values have less that of the second's; from -1 to 1, 0 is no effect.
    note : str
        What to know before believing p; mostly empty.
    """

    p: float
    rank_biserial: float
    note: str = ""


@brief
@dataclass(frozen=True)
class Friedman:
    """Friedman's test between several methods over several cases, and Nemenyi's after it.

    Attributes
    ----------
    mean_ranks : (k,) float array
        The mean rank of each method over all cases; 1 is best.
    chi2 : float
        Friedman's statistic, corrected for ties; NaN where there is no test.
    f : float
        Iman and Davenport's statistic, made of it; infinite where all cases agree, NaN where there is no test.
    p : float
        That of `f`, exact for two methods and where all cases agree.
    critical_difference : float
        Nemenyi's: mean ranks at least so far apart differ significantly.
    groups : tuple of tuples of int
        The largest groups of methods (columns, the best first) that do not differ: all methods are one if p is
        not below the level of significance.
    note : str
        What to know before believing them; mostly empty.
    """

    mean_ranks: FloatArray
    chi2: float
    f: float
    p: float
    critical_difference: float
    groups: tuple[tuple[int, ...], ...]
    note: str = ""


def summarise(values: ArrayLike) -> Summary:
    """Return mean and standard deviation, and say why if one of them is not a number.

    Examples
    --------
    >>> summarise([1.0, 2.0, 3.0])
    Summary(mean=2.0, std=1.0, n=3, note='')
    >>> summarise([1.5]).note
    'one value has no standard deviation'
    """
    array = _sample(values, "the values")
    n = len(array)
    infinite = int(np.isinf(array).sum())
    if infinite:
        mean = math.inf if array.max() == math.inf else -math.inf
        return Summary(mean, math.nan, n, f"{infinite} of {n} values are infinite")
    mean = float(array.mean())
    if n == 1:
        return Summary(mean, math.nan, n, "one value has no standard deviation")
    return Summary(mean, float(array.std(ddof=1)), n)


def vargha_delaney(x: ArrayLike, y: ArrayLike) -> float:
    """Return A12, the probability that a value of x is larger than one of y, ties counted half [1]_.

    References
    ----------
    .. [1] A. Vargha and H. D. Delaney, "A critique and improvement of the CL common language effect size
       statistics of McGraw and Wong", Journal of Educational and Behavioral Statistics 25(2), 2000.

    Examples
    --------
    >>> vargha_delaney([2, 3], [1, 3])
    0.625
    """
    a, b = _sample(x, "the first sample")[:, None], _sample(y, "the second sample")[None, :]
    return float((a > b).mean() + (a == b).mean() / 2)


def magnitude(a12: float) -> str:
    """Return Vargha and Delaney's word for an effect size: negligible, small, medium or large.

    Examples
    --------
    >>> magnitude(0.5), magnitude(0.3), magnitude(1.0)
    ('negligible', 'medium', 'large')
    """
    distance = abs(a12 - 0.5)
    words = ((0.06, "negligible"), (0.14, "small"), (0.21, "medium"))
    return next((word for limit, word in words if distance < limit - 1e-12), "large")


def rank_sum(x: ArrayLike, y: ArrayLike, *, alpha: float = ALPHA) -> RankSum:
    """Test by Wilcoxon's rank sums whether two samples come from the same distribution.

    For the runs of two methods on one model: run 3 of the one has nothing in common with run 3 of the other but a
    number, so they are no pairs. p is exact where no two values are equal, and the normal approximation with
    corrections for ties and continuity where some are. Samples that cannot differ get p = 1 and a note, not a
    warning.

    Parameters
    ----------
    x, y : (n,), (m,) array-like
        The samples; infinite values have a rank like any other, NaN is refused.
    alpha : float
        Level of significance that the note speaks of.

    Examples
    --------
    >>> rank_sum([1, 2, 3, 4], [5, 6, 7, 8])
    RankSum(p=0.02857142857142857, a12=0.0, exact=True, note='')
    >>> rank_sum([1, 1], [1]).note
    'all values are equal'
    """
    a, b = _sample(x, "the first sample"), _sample(y, "the second sample")
    pooled = np.concatenate([a, b])
    a12 = vargha_delaney(a, b)
    if (pooled == pooled[0]).all():
        return RankSum(1.0, a12, True, "all values are equal")
    exact = len(np.unique(pooled)) == len(pooled)
    p = float(stats.mannwhitneyu(a, b, method="exact" if exact else "asymptotic").pvalue)
    least = 2 / math.comb(len(pooled), len(a))
    note = ""
    if least >= alpha:
        note = f"with {len(a)} and {len(b)} values no p-value below {min(1.0, least):.2g} is possible"
    return RankSum(min(1.0, p), a12, exact, note)


def signed_rank(x: ArrayLike, y: ArrayLike, *, alpha: float = ALPHA) -> SignedRank:
    """Test by Wilcoxon's signed ranks whether the values of pairs differ.

    For two methods over several models. Pairs of equal values are left out, as Wilcoxon did; p is exact over all
    signs that the differences could have, with ties too.

    Parameters
    ----------
    x, y : (n,) array-like
        Value i of both is of the same case. An infinite value differs from any finite one by more than finite
        ones do from each other, and not from another infinite one of its sign; NaN is refused.
    alpha : float
        Level of significance that the note speaks of.

    References
    ----------
    .. [3] D. S. Kerby, "The simple difference formula: an approach to teaching nonparametric correlation",
       Comprehensive Psychology 3, 2014.

    Examples
    --------
    The second sample is larger in the pair that differs least. Of the 64 ways to give signs to the ranks 1 to 6, two
    have a negative rank sum of at most 1, and two a positive one:

    >>> signed_rank([12, 14, 18, 21, 25, 28], [13, 12, 15, 17, 20, 22])
    SignedRank(p=0.0625, rank_biserial=0.9047619047619048, note='')
    >>> signed_rank([1, 2], [1, 2]).note
    'all pairs are equal'
    """
    a, b = _sample(x, "the first sample"), _sample(y, "the second sample")
    if len(a) != len(b):
        raise ValueError(f"{len(a)} and {len(b)} values are no pairs: for independent samples use rank_sum")
    differ = a != b  # two infinite values are equal; their difference would be NaN
    difference = a[differ] - b[differ]
    n = len(difference)
    if not n:
        return SignedRank(1.0, 0.0, "all pairs are equal")
    # twice the ranks, so that those of ties are whole
    ranks = np.rint(2 * stats.rankdata(np.abs(difference))).astype(np.int64)
    plus, minus = int(ranks[difference > 0].sum()), int(ranks[difference < 0].sum())
    chance = np.ones(1)  # of each rank sum, were every sign a coin flip
    for rank in ranks:
        chance = (np.pad(chance, (0, rank)) + np.pad(chance, (rank, 0))) / 2
    p = 2 * float(chance[: min(plus, minus) + 1].sum())
    least = 2.0 ** (1 - n)
    note = f"with {n} pairs that differ no p-value below {least:.2g} is possible" if least >= alpha else ""
    return SignedRank(min(1.0, p), (plus - minus) / (plus + minus), note)


def holm(p: ArrayLike) -> FloatArray:
    """Return p-values corrected for being many, by Holm's step-down procedure [2]_.

    Parameters
    ----------
    p : (n,) array-like
        Raw p-values of all comparisons made together.

    Returns
    -------
    (n,) float array
        In the same order; each is to be compared with the level of significance itself.

    References
    ----------
    .. [2] S. Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of
       Statistics 6(2), 1979.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03])
    array([0.03, 0.06, 0.06])
    """
    raw = np.asarray(p, dtype=float)
    if raw.ndim != 1 or not np.all((raw >= 0) & (raw <= 1)):
        raise ValueError(f"p-values are a list of numbers from 0 to 1, not {raw}")
    order = np.argsort(raw, kind="stable")
    steps = np.maximum.accumulate(raw[order] * np.arange(len(raw), 0, -1))
    adjusted = np.empty_like(raw)
    adjusted[order] = np.minimum(steps, 1.0)
    return adjusted


def friedman(values: ArrayLike, *, alpha: float = ALPHA) -> Friedman:
    """Test by the ranks in every case whether methods differ, and which of them [4]_.

    Friedman's statistic has the correction for ties; p is that of Iman and Davenport's F made from it [5]_, since the
    chi-square approximation is too careful for the few cases of a study. If p is below the level of
    significance, two methods differ whose mean ranks are at least Nemenyi's critical difference apart.

    Parameters
    ----------
    values : (n, k) array-like
        A row for each case (a model), a column for each method; larger is better. Infinite values have a rank
        like any other, NaN is refused.
    alpha : float
        Level of significance.

    Raises
    ------
    ValueError
        If there are fewer than two methods, no case, or NaN.

    References
    ----------
    .. [4] J. Demšar, "Statistical comparisons of classifiers over multiple data sets", Journal of Machine Learning
       Research 7, 2006.
    .. [5] R. L. Iman and J. M. Davenport, "Approximations of the critical region of the Friedman statistic",
       Communications in Statistics A 9(6), 1980.

    Examples
    --------
    Four models, on all of which the methods have the same order:

    >>> found = friedman([[0.9, 0.8, 0.5], [0.7, 0.6, 0.2], [0.8, 0.7, 0.6], [0.9, 0.8, 0.7]])
    >>> found.mean_ranks, found.chi2, round(found.critical_difference, 3)
    (array([1., 2., 3.]), 8.0, 1.657)
    >>> found.groups
    ((0, 1), (1, 2))
    """
    table = np.asarray(values, dtype=float)
    if table.ndim != 2 or table.shape[0] < 1 or table.shape[1] < 2:
        raise ValueError(f"values of the shape {table.shape}: give a row for each case, a column for each method")
    if np.isnan(table).any():
        raise ValueError(
            f"{np.count_nonzero(np.isnan(table))} of {table.size} values are NaN: leave out such cases or methods"
        )
    n, k = table.shape
    ranks = stats.rankdata(-table, axis=1)
    mean_ranks = ranks.mean(axis=0)
    difference = _critical_difference(n, k, alpha)
    chi2, f, p, note = _friedman_test(ranks)
    order = [int(column) for column in np.argsort(mean_ranks, kind="stable")]
    if not p < alpha:
        note = note or "Friedman's test finds no difference"
        return Friedman(mean_ranks, chi2, f, p, difference, (tuple(order),), note)
    # from each method down to the last one that is too near to differ; what a longer group holds is none of its own
    groups: list[tuple[int, ...]] = []
    end = 0
    for place, best in enumerate(order):
        near = [column for column in order[place:] if mean_ranks[column] - mean_ranks[best] < difference]
        if len(near) > 1 and place + len(near) > end:
            groups.append(tuple(near))
            end = place + len(near)
    return Friedman(mean_ranks, chi2, f, p, difference, tuple(groups), note)


def least_cases(k: int, *, alpha: float = ALPHA) -> int:
    """Return from how many cases on `friedman` can tell any two of k methods apart: where all cases agree.

    With fewer, Nemenyi's critical difference is more than the first mean rank and the last can differ by, or not even
    cases that all agree bring Friedman's p below the level of significance.

    Examples
    --------
    >>> least_cases(2), least_cases(5)
    (6, 3)
    """
    n = 2
    while (
        _critical_difference(n, k, alpha) > k - 1 or _friedman_test(np.tile(np.arange(1.0, k + 1), (n, 1)))[2] >= alpha
    ):
        n += 1
    return n


def _critical_difference(n: int, k: int, alpha: float) -> float:
    """Return Nemenyi's critical difference of the mean ranks of k methods over n cases."""
    spread = stats.studentized_range.ppf(1 - alpha, k, np.inf) / math.sqrt(2)
    return float(spread * math.sqrt(k * (k + 1) / (6 * n)))


def _friedman_test(ranks: FloatArray) -> tuple[float, float, float, str]:
    """Return Friedman's chi-square, Iman and Davenport's F, p, and a note."""
    n, k = ranks.shape
    if n == 1:
        return math.nan, math.nan, 1.0, "one case allows no test"
    if (ranks == ranks[:, :1]).all():
        return math.nan, math.nan, 1.0, "all methods are equal in every case"
    note = ""
    if k == 2:  # which SciPy leaves out
        wins, losses = int((ranks[:, 0] < ranks[:, 1]).sum()), int((ranks[:, 0] > ranks[:, 1]).sum())
        chi2 = (wins - losses) ** 2 / (wins + losses)
        note = "between two methods Friedman's test is the sign test"
    else:
        chi2 = float(stats.friedmanchisquare(*ranks.T).statistic)
    left = n * (k - 1) - chi2
    agreed = left < 1e-9 * n
    f = math.inf if agreed else (n - 1) * chi2 / left
    if k == 2:
        p = float(stats.binomtest(wins, wins + losses).pvalue)
    elif agreed:
        # all further cases repeat the order of the first, one of so many
        _, ties = np.unique(ranks[0], return_counts=True)
        p = float(math.factorial(k) / math.prod(map(math.factorial, ties.tolist()))) ** (1 - n)
    else:
        p = float(stats.f.sf(f, k - 1, (k - 1) * (n - 1)))
    return chi2, f, p, note


def performance_profile(values: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return how often each method is within a factor of the best: performance profiles [6]_.

    Parameters
    ----------
    values : (n, k) array-like
        A row for each case, a column for each method; smaller is better, none negative. Infinite where a method
        found nothing: that is within no factor, and where nobody found anything, nobody is within any.

    Returns
    -------
    factors : (t,) float array
        All finite factors that occur, from 1 up.
    shares : (t, k) float array
        ``shares[i, j]`` is the share of cases where method j is at most ``factors[i]`` times the best. It stays
        so up to the next factor, and the last row is what no finite factor changes.

    Raises
    ------
    ValueError
        If there is no case or no method, or a value is negative or NaN.

    References
    ----------
    .. [6] E. D. Dolan and J. J. Moré, "Benchmarking optimization software with performance profiles", Mathematical
       Programming 91(2), 2002.

    Examples
    --------
    >>> factors, shares = performance_profile([[1.0, 2.0], [3.0, 1.5], [1.0, np.inf], [4.0, 4.0]])
    >>> factors, shares.tolist()
    (array([1., 2.]), [[0.75, 0.5], [1.0, 0.75]])
    """
    table = np.asarray(values, dtype=float)
    if table.ndim != 2 or not table.size:
        raise ValueError(f"values of the shape {table.shape}: give a row for each case, a column for each method")
    wrong = int((~(table >= 0)).sum())
    if wrong:
        raise ValueError(f"{wrong} of {table.size} values are negative or NaN, and no factor compares those")
    best = table.min(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(table == best, 1.0, table / best)
    factor[np.isinf(table)] = np.inf
    factors = np.unique(np.append(factor[np.isfinite(factor)], 1.0))
    shares = (factor[None] <= factors[:, None, None]).mean(axis=1)
    return factors, np.asarray(shares, dtype=float)


def _sample(values: ArrayLike, name: str) -> FloatArray:
    """Return a sample as an array, or say what is wrong with it."""
    sample = np.asarray(values, dtype=float)
    if sample.ndim != 1 or not len(sample):
        raise ValueError(f"{name} must be a list of at least one number, not an array of shape {sample.shape}")
    if np.isnan(sample).any():
        raise ValueError(f"{name} has {int(np.isnan(sample).sum())} NaN among {len(sample)} values")
    return sample
