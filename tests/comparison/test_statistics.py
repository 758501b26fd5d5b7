"""Statistics: known answers, slow twins, published examples, honest degenerate cases."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from meshsimp_pymoo.comparison.statistics import (
    friedman,
    holm,
    least_cases,
    magnitude,
    performance_profile,
    rank_sum,
    signed_rank,
    summarise,
    vargha_delaney,
)


def exact_p(x, y):
    """All ways to draw the first sample from the pooled values; two-sided by twice the smaller tail."""
    pooled = [*x, *y]

    def u(rows):
        others = [v for k, v in enumerate(pooled) if k not in rows]
        return sum(pooled[i] > other for i in rows for other in others)

    all_u = [u(rows) for rows in itertools.combinations(range(len(pooled)), len(x))]
    here = u(range(len(x)))
    smaller = min(sum(v <= here for v in all_u), sum(v >= here for v in all_u))
    return min(1.0, 2 * smaller / len(all_u))


class TestRankSum:
    def test_without_ties_p_is_exact(self):
        rng = np.random.default_rng(1)
        for n, m in ((1, 1), (1, 4), (3, 4), (5, 5), (4, 6)):
            for _ in range(10):
                pooled = rng.permutation(n + m).astype(float)
                test = rank_sum(pooled[:n], pooled[n:])
                assert test.exact
                assert_allclose(test.p, exact_p(pooled[:n], pooled[n:]))

    def test_with_ties_p_is_the_corrected_normal_approximation(self):
        x, y = [1, 1, 2, 2, 3], [2, 3, 3, 4, 4]
        test = rank_sum(x, y)
        assert not test.exact
        # by hand: U = 3 of 25, groups of equal values 2, 3, 3, 2
        variance = 25 / 12 * (11 - (2 * 6 + 2 * 24) / (10 * 9))
        z = (12.5 - 3 - 0.5) / math.sqrt(variance)
        assert_allclose(test.p, math.erfc(z / math.sqrt(2)))
        assert_allclose(test.a12, 3 / 25)

    def test_the_order_of_the_samples_turns_the_effect_only(self):
        rng = np.random.default_rng(2)
        for _ in range(30):
            x, y = rng.integers(0, 9, 6), rng.integers(2, 9, 9)
            there, back = rank_sum(x, y), rank_sum(y, x)
            assert_allclose(there.p, back.p)
            assert_allclose(there.a12, 1 - back.a12)

    def test_all_ties_are_no_difference_and_no_warning(self):
        assert rank_sum([0.5] * 8, [0.5] * 8).p == 1
        assert rank_sum([math.inf] * 3, [math.inf] * 2).p == 1
        assert "all values are equal" in rank_sum([1], [1]).note

    def test_identical_samples_are_no_difference(self):
        test = rank_sum([1, 2, 3, 4], [1, 2, 3, 4])
        assert test.p == 1
        assert test.a12 == 0.5

    def test_too_few_runs_say_that_nothing_can_be_significant(self):
        assert rank_sum([1], [2]).note == "with 1 and 1 values no p-value below 1 is possible"
        assert "1 and 10 values no p-value below 0.18" in rank_sum([0], range(1, 11)).note
        assert rank_sum(range(4), range(4, 8)).note == ""

    def test_infinite_values_have_a_rank(self):
        assert rank_sum([math.inf, math.inf, 9, 8], [1, 2, 3, 4]).a12 == 1

    def test_effect_size_is_the_probability_of_being_larger(self):
        rng = np.random.default_rng(3)
        for _ in range(50):
            x, y = rng.integers(0, 5, 4), rng.integers(0, 5, 7)
            pairs = [(a > b) + (a == b) / 2 for a in x for b in y]
            assert_allclose(vargha_delaney(x, y), np.mean(pairs))

    @pytest.mark.parametrize(
        ("a12", "word"),
        [
            (0.5, "negligible"),
            (0.56, "small"),
            (0.4, "small"),
            (0.64, "medium"),
            (0.71, "large"),
            (0, "large"),
        ],
    )
    def test_effect_sizes_have_the_words_of_vargha_and_delaney(self, a12, word):
        assert magnitude(a12) == word

    @pytest.mark.parametrize("bad", [[], [1, np.nan], [[1, 2]]])
    def test_refuses_no_samples(self, bad):
        with pytest.raises(ValueError, match="the second sample"):
            rank_sum([1, 2], bad)


class TestHolm:
    def test_known_answer(self):
        assert_allclose(holm([0.01, 0.02, 0.03, 0.005]), [0.03, 0.04, 0.04, 0.02])

    def test_rejects_what_the_step_down_procedure_rejects(self):
        rng = np.random.default_rng(4)
        for _ in range(200):
            p = rng.choice([0.001, 0.01, 0.012, 0.02, 0.04, 0.3, 1.0], rng.integers(1, 8))
            rejected = np.zeros(len(p), dtype=bool)
            for k, row in enumerate(np.argsort(p, kind="stable")):
                if p[row] * (len(p) - k) > 0.05:
                    break
                rejected[row] = True
            assert_array_equal(holm(p) <= 0.05, rejected)
            assert (holm(p) >= p).all()
            assert holm(p).max() <= 1

    def test_of_nothing_is_nothing_and_of_one_is_itself(self):
        assert len(holm([])) == 0
        assert holm([0.2]) == [0.2]

    def test_refuses_what_is_no_p_value(self):
        with pytest.raises(ValueError, match="from 0 to 1"):
            holm([0.5, np.nan])


def signs_p(difference):
    """All signs that the differences could have; two-sided by twice the smaller tail."""
    moved = [d for d in difference if d]
    sizes = sorted(map(abs, moved))
    rank = {size: sizes.index(size) + (sizes.count(size) + 1) / 2 for size in sizes}
    sums = [
        sum(rank[abs(d)] for d, sign in zip(moved, signs, strict=True) if sign)
        for signs in itertools.product((0, 1), repeat=len(moved))
    ]
    here = sum(rank[abs(d)] for d in moved if d > 0)
    return min(1.0, 2 * min(sum(s <= here for s in sums), sum(s >= here for s in sums)) / len(sums))


class TestSignedRank:
    def test_by_hand(self):
        # differences 1, -2, 3, 4, 5: negative rank sum 2 of 15; of 32 signs W = 0, 1, 2 have one each
        test = signed_rank([11, 10, 13, 14, 15], [10, 12, 10, 10, 10])
        assert test.p == 2 * 3 / 32
        assert_allclose(test.rank_biserial, (13 - 2) / 15)
        # with ties: differences 1, 1, -1 have the rank 2 each, 4 the rank 4, so the negative rank sum is 2; of 16
        # signs four have at most that: 0 once, 2 three times
        test = signed_rank([2, 2, 1, 5], [1, 1, 2, 1])
        assert test.p == 2 * 4 / 16
        assert_allclose(test.rank_biserial, (8 - 2) / 10)

    def test_p_is_exact_with_and_without_ties(self):
        rng = np.random.default_rng(6)
        for n in (1, 2, 5, 8):
            for _ in range(8):
                x, y = rng.integers(0, 6, n), rng.integers(0, 6, n)
                assert_allclose(signed_rank(x, y).p, signs_p((x - y).tolist()))
        for n in (7, 20, 50):
            x, y = rng.normal([[0.3], [0.0]], 1.0, (2, n))
            assert_allclose(signed_rank(x, y).p, stats.wilcoxon(x, y, method="exact").pvalue)

    def test_the_order_turns_the_effect_only(self):
        rng = np.random.default_rng(7)
        for _ in range(20):
            x, y = rng.integers(0, 9, 7), rng.integers(2, 9, 7)
            there, back = signed_rank(x, y), signed_rank(y, x)
            assert (there.p, there.rank_biserial) == (back.p, -back.rank_biserial)

    def test_infinite_values_are_the_largest_differences_and_equal_to_each_other(self):
        inf = math.inf
        with np.errstate(all="raise"):
            assert signed_rank([inf, 1, 2, 3, inf], [9, 2, 4, 6, inf]) == signed_rank([99, 1, 2, 3], [9, 2, 4, 6])
            assert signed_rank([inf, -inf], [inf, -inf]).note == "all pairs are equal"

    def test_what_can_decide_nothing_says_so(self):
        assert signed_rank([1, 2], [1, 2]).p == 1
        assert signed_rank([1, 2], [1, 2]).rank_biserial == 0
        # five models can be no surer than 2 / 32, and a sixth that is equal adds nothing
        test = signed_rank([2, 3, 4, 5, 6, 1], [1, 1, 1, 1, 1, 1])
        assert test.p == 1 / 16
        assert test.note == "with 5 pairs that differ no p-value below 0.062 is possible"
        assert signed_rank(range(6), range(1, 7)).note == ""

    def test_refuses_what_is_no_pairs(self):
        with pytest.raises(ValueError, match="2 and 3 values are no pairs: for independent samples use rank_sum"):
            signed_rank([1, 2], [1, 2, 3])
        with pytest.raises(ValueError, match="the first sample has 1 NaN among 2 values"):
            signed_rank([1, np.nan], [1, 2])


# The ranks of four variants of C4.5 (none, m, cf, both) on 14 data sets: Demšar 2006, Table 2.
DEMSAR = [
    [4, 3, 2, 1], [1, 2, 3, 4], [4, 1, 2, 3], [4, 1, 3, 2], [4, 2, 3, 1], [1, 2.5, 4, 2.5], [3, 2, 4, 1],
    [2.5, 2.5, 4, 1], [4, 3, 2, 1], [2.5, 2.5, 2.5, 2.5], [4, 2.5, 1, 2.5], [3, 2, 4, 1], [4, 1, 2, 3], [3, 1, 4, 2],
]  # fmt: skip


class TestFriedman:
    def test_the_published_example(self):
        found = friedman(-np.array(DEMSAR))
        assert_array_equal(found.mean_ranks.round(3), [3.143, 2.0, 2.893, 1.964])
        # Demšar has 9.28 without the correction for ties: one case has 2 equal ranks three times (6 each), one all
        # four (60), so the correction is 1 - 78 / (14 * 4 * 15)
        uncorrected = found.chi2 * (1 - 78 / 840)
        assert round(uncorrected, 2) == 9.28
        assert round(13 * uncorrected / (14 * 3 - uncorrected), 2) == 3.69
        assert_allclose(found.f, 13 * found.chi2 / (14 * 3 - found.chi2))
        assert_allclose(found.p, stats.f.sf(found.f, 3, 39))
        assert round(found.critical_difference, 2) == 1.25
        # at 0.05 Nemenyi's test finds nothing; at 0.10 the first is worse than the second and the fourth
        assert found.groups == ((3, 1, 2, 0),)
        looser = friedman(-np.array(DEMSAR), alpha=0.10)
        assert round(looser.critical_difference, 2) == 1.12
        assert looser.groups == ((3, 1, 2), (2, 0))

    def test_critical_differences_are_those_of_the_published_table(self):
        # Demšar 2006, Table 5(a): q at 0.05 for 2 to 10 classifiers; CD = q sqrt(k (k + 1) / (6 N))
        table = [1.960, 2.343, 2.569, 2.728, 2.850, 2.949, 3.031, 3.102, 3.164]
        for k, q in enumerate(table, start=2):
            found = friedman(np.arange(4 * k).reshape(4, k)).critical_difference
            assert abs(found / math.sqrt(k * (k + 1) / (6 * 4)) - q) < 0.001
        # by hand: five methods on six models, 2.728 * sqrt(5 * 6 / 36)
        assert round(friedman(np.arange(30).reshape(6, 5)).critical_difference, 2) == 2.49

    def test_is_scipys_and_an_analysis_of_variance_of_the_ranks(self):
        rng = np.random.default_rng(8)
        for high in (4, 1000):
            values = rng.integers(0, high, (8, 5)).astype(float) + np.arange(5) * high / 9
            found = friedman(values)
            assert_allclose(found.chi2, stats.friedmanchisquare(*values.T).statistic)
            ranks = np.array([stats.rankdata(-row) for row in values])
            between = 8 * ((ranks.mean(axis=0) - 3) ** 2).sum() / 4
            rest = (((ranks - ranks.mean(axis=0)) ** 2).sum()) / 28
            assert_allclose(found.f, between / rest)

    def test_larger_is_better_and_columns_keep_their_place(self):
        values = np.array([[1, 9, 5.0, 7]] * 9) + np.arange(9)[:, None]
        found = friedman(values)
        assert_array_equal(found.mean_ranks, [4, 1, 3, 2])
        # all agree: nine orders of 24, the first of them free
        assert found.f == math.inf
        assert_allclose(found.p, 24.0**-8)
        # q = 2.569, CD = 2.569 * sqrt(20 / 54) = 1.56: neighbours do not differ, others do
        assert found.groups == ((1, 3), (3, 2), (2, 0))
        mirrored = friedman(values[:, ::-1])
        assert_array_equal(mirrored.mean_ranks, [2, 3, 1, 4])
        assert mirrored.groups == ((2, 0), (0, 1), (1, 3))

    def test_agreement_with_ties_is_one_order_of_fewer(self):
        # one best and two equal ones: 3 such orders, so two further cases repeat the first with 1 / 9
        found = friedman([[3, 1, 1], [9, 2, 2], [5, 0, 0]])
        assert found.f == math.inf
        assert_allclose(found.p, 1 / 9)

    def test_methods_far_from_all_others_are_in_no_group(self):
        rng = np.random.default_rng(9)
        values = rng.uniform(size=(30, 4)) * [1, 1, 1, 0.1] - [-50, 0, 0, 50]
        found = friedman(values)
        assert len(found.groups) == 1
        assert set(found.groups[0]) == {1, 2}

    @pytest.mark.parametrize("k", [2, 3, 4, 10, 60])
    def test_the_least_cases_are_the_first_that_tell_apart_where_all_agree(self, k):
        n = least_cases(k)
        agreed = np.tile(np.arange(k), (n, 1))
        assert len(friedman(agreed).groups) != 1 or len(friedman(agreed).groups[0]) < k
        assert friedman(agreed[1:]).groups == (tuple(range(k))[::-1],)

    def test_infinite_values_have_a_rank(self):
        assert_array_equal(friedman([[-math.inf, 1, math.inf]] * 3).mean_ranks, [3, 2, 1])

    def test_two_methods_are_the_sign_test(self):
        # six wins of six: 2 / 64; ranks 1 apart, CD = 1.960 * sqrt(6 / 36)
        found = friedman([[2, 1]] * 6)
        assert_allclose(found.p, 1 / 32)
        assert found.chi2 == 6
        assert found.groups == ()
        assert "sign test" in found.note
        # four of four: 2 / 16 is no difference, though the ranks are further apart than CD = 0.98
        found = friedman([[2, 1]] * 4)
        assert_allclose(found.p, 1 / 8)
        assert found.critical_difference < 1
        assert found.groups == ((0, 1),)

    def test_what_can_decide_nothing_says_so(self):
        one = friedman([[3, 1, 2]])
        assert (one.p, one.note, one.groups) == (1, "one case allows no test", ((0, 2, 1),))
        equal = friedman([[1, 1, 1], [2, 2, 2]])
        assert (equal.p, equal.note) == (1, "all methods are equal in every case")
        assert math.isnan(equal.chi2)
        assert_array_equal(equal.mean_ranks, [2, 2, 2])
        undecided = friedman([[1, 2, 3], [3, 2, 1], [2, 3, 1]])
        assert undecided.groups == ((1, 0, 2),)
        assert undecided.note == "Friedman's test finds no difference"
        assert 0.05 < undecided.p < 1

    def test_refusals(self):
        for wrong in ([], [1, 2], [[1], [2]], np.zeros((0, 3))):
            with pytest.raises(ValueError, match="a row for each case, a column for each method"):
                friedman(wrong)
        with pytest.raises(ValueError, match="1 of 4 values are NaN"):
            friedman([[1, 2], [np.nan, 2]])


class TestPerformanceProfile:
    def test_by_hand(self):
        # factors of the best: (1, 2), (3, 1), (1, inf), (1, 1), and of the last nobody found anything
        inf = math.inf
        factors, shares = performance_profile([[2, 4], [6, 2], [5, inf], [7, 7], [inf, inf]])
        assert_array_equal(factors, [1, 2, 3])
        assert_allclose(shares, [[3 / 5, 2 / 5], [3 / 5, 3 / 5], [4 / 5, 3 / 5]])

    def test_zero_is_reached_by_zero_only(self):
        factors, shares = performance_profile([[0, 1], [0, 0]])
        assert_array_equal(factors, [1])
        assert_allclose(shares, [[1, 0.5]])

    def test_nobody_ever(self):
        factors, shares = performance_profile([[math.inf, math.inf]])
        assert_array_equal(factors, [1])
        assert_array_equal(shares, [[0, 0]])

    def test_laws(self):
        rng = np.random.default_rng(10)
        values = rng.uniform(1, 9, (20, 4))
        factors, shares = performance_profile(values)
        assert (np.diff(shares, axis=0) >= 0).all()
        assert_array_equal(shares[-1], 1)
        assert_allclose(shares[0], np.mean(values == values.min(axis=1, keepdims=True), axis=0))
        for factor, share in zip(factors[::7], shares[::7], strict=True):
            assert_array_equal(share, np.mean(values / values.min(axis=1, keepdims=True) <= factor, axis=0))
        scaled = performance_profile(values * 2.0 ** rng.integers(-9, 9, (20, 1)))  # units of a case do not matter
        assert_array_equal(scaled[0], factors)
        assert_array_equal(scaled[1], shares)

    def test_refusals(self):
        with pytest.raises(ValueError, match="a row for each case"):
            performance_profile([])
        with pytest.raises(ValueError, match="2 of 3 values are negative or NaN"):
            performance_profile([[1, -1, np.nan]])


def test_summaries():
    assert summarise([2.0, 4.0]).std == math.sqrt(2)
    assert summarise([1.0, -math.inf]).mean == -math.inf
    with pytest.raises(ValueError, match="1 NaN among 2"):
        summarise([1, np.nan])
    with pytest.raises(ValueError, match="at least one number"):
        summarise([])
