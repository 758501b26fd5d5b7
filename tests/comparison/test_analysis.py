"""Analysis: known answers, slow twins, planted differences that tests must find, honest degenerate cases."""

from __future__ import annotations

import itertools
import math
import warnings

import numpy as np
import pytest
from comparing import INDICATORS, compared
from numpy.testing import assert_allclose, assert_array_equal

from meshsimp_pymoo.comparison.analysis import (
    Comparison,
    Solution,
    attainment_surfaces,
    corrected,
    coverage_table,
    dominance_rates,
    epsilon_table,
    holm,
    knees,
    magnitude,
    pseudo_optimal,
    rank_sum,
    scale_factor,
    selected_solutions,
    summarise,
    trade_off,
    unary_scores,
    vargha_delaney,
)
from meshsimp_pymoo.indicators import coverage, epsilon, hypervolume_ratio, non_dominated


def front_of(rng, level, size=25):
    """A noisy run: triangles at random, errors of about level / triangles; some rows dominated or twice."""
    triangles = rng.integers(2, 60, size).astype(float)
    F = np.column_stack([level * 100 / triangles * rng.uniform(0.9, 1.1, size), triangles])
    return np.vstack([F, F[:2]])


@pytest.fixture
def runs():
    """Good, equally good, and bad: 8 runs each; and a method without chance."""
    rng = np.random.default_rng(0)
    study = {
        name: {seed: front_of(rng, level) for seed in range(1, 9)}
        for name, level in (("good", 1.0), ("alike", 1.0), ("bad", 3.0))
    }
    return {**study, "classic": {0: front_of(rng, 4.0)}}


class TestFronts:
    def test_pseudo_optimal_front_covers_every_run_and_says_who_found_what(self, runs):
        optimal = pseudo_optimal(runs)
        for method, seeds in runs.items():
            for seed, F in seeds.items():
                assert coverage(optimal.front, F) == 1
                rows = {tuple(row) for row in F}
                for point, found_by in zip(optimal.front, optimal.found_by, strict=True):
                    assert ((method, seed) in found_by) == (tuple(point) in rows)
        assert all(optimal.found_by)
        assert optimal.share("bad") < optimal.share("good")
        assert optimal.share("nobody") == 0

    def test_a_solution_found_twice_is_credited_twice(self):
        optimal = pseudo_optimal({"a": {2: [[1, 2]], 1: [[1, 2]]}, "b": {7: [[1.0, 2], [5, 5]]}})
        assert optimal.found_by == ((("a", 1), ("a", 2), ("b", 7)),)
        assert optimal.share("a") == optimal.share("b") == 1

    def test_runs_are_read_in_the_order_of_their_seeds(self):
        assert_array_equal(unary_scores({"a": {3: [[1, 2]], 1: [[1, 4]]}})["a"].seeds, [1, 3])


class TestScores:
    def test_are_the_indicators_of_each_run_against_the_pseudo_optimal_front(self, runs):
        best = pseudo_optimal(runs).front
        for given in (None, best, pseudo_optimal(runs)):
            scores = unary_scores(runs, given)
            for method, seeds in runs.items():
                for i, F in enumerate(seeds.values()):
                    assert scores[method].hvr[i] == hypervolume_ratio(F, best)
                    assert scores[method].epsilon[i] == epsilon(F, best)
                    assert scores[method].coverage[i] == coverage(F, best)
                    assert scores[method].cardinality[i] == len(non_dominated(F))
                merged = non_dominated(np.vstack(list(seeds.values())))
                assert scores[method].merged_hvr == hypervolume_ratio(merged, best)
                assert scores[method].merged_epsilon == epsilon(merged, best)
                assert scores[method].merged_coverage == coverage(merged, best)
                assert scores[method].merged_cardinality == len(merged)

    def test_another_reference_front_changes_them(self, runs):
        better = pseudo_optimal(runs).front * [0.5, 1]
        scores, against_better = unary_scores(runs), unary_scores(runs, better)
        assert (against_better["good"].hvr < scores["good"].hvr).all()
        assert (against_better["good"].epsilon >= scores["good"].epsilon).all()
        assert against_better["good"].epsilon.mean() > scores["good"].epsilon.mean()

    def test_the_share_of_a_method_is_its_merged_coverage(self, runs):
        optimal = pseudo_optimal(runs)
        for method, scores in unary_scores(runs, optimal).items():
            assert_allclose(scores.merged_coverage, optimal.share(method))


class TestTables:
    def test_cells_average_over_all_pairs_of_runs(self, runs):
        for table, indicator in ((coverage_table(runs), coverage), (epsilon_table(runs), epsilon)):
            assert table.methods == tuple(runs)
            for a, b in itertools.permutations(runs, 2):
                values = [indicator(A, B) for A in runs[a].values() for B in runs[b].values()]
                cell = table.cell(a, b)
                assert_allclose(cell.mean, np.mean(values))
                assert_allclose(cell.std, np.std(values, ddof=1))
                assert cell.n == len(values)

    def test_rows_of_a_cells_values_are_the_first_methods_runs(self):
        table = coverage_table({"a": {1: [[1, 1]], 2: [[9, 9]]}, "b": {1: [[5, 5]]}})
        assert_array_equal(table.values["a", "b"], [[1], [0]])
        assert_array_equal(table.values["b", "a"], [[0, 1]])

    def test_an_unreachable_zero_error_is_infinite_and_said_to_be(self):
        runs = {"a": {1: [[0, 9]], 2: [[1, 9]]}, "b": {1: [[1, 9]]}}
        cell = epsilon_table(runs).cell("b", "a")
        assert (cell.mean, cell.note) == (math.inf, "1 of 2 values are infinite")
        assert math.isnan(cell.std)
        assert epsilon_table(runs, shift=[1, 0]).cell("b", "a").mean == 1.5

    def test_one_run_has_no_standard_deviation_and_says_so(self):
        cell = coverage_table({"a": {1: [[1, 1]]}, "b": {1: [[1, 1]]}}).cell("a", "b")
        assert cell.mean == 1
        assert math.isnan(cell.std)
        assert "no standard deviation" in cell.note


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


class TestDominanceRates:
    def test_by_epsilon_a_run_must_be_better_not_only_as_good(self):
        fronts = {"a": {1: [[1, 2]], 2: [[5, 5]]}, "b": {1: [[1, 2]], 2: [[1, 3]], 3: [[0.5, 9]]}}
        table = epsilon_table(fronts)
        forth, back = table.values["a", "b"], table.values["b", "a"]
        assert_allclose(dominance_rates(forth, back, "epsilon"), [1 / 3, 0])
        assert_allclose(dominance_rates(back, forth, "epsilon"), [1 / 2, 1 / 2, 0])

    def test_by_coverage_the_threshold_counts_and_the_reverse_must_stay_below(self):
        forth, back = [[0.75, 0.74, 0.9]], [[0.1], [0.1], [0.75]]
        assert_allclose(dominance_rates(forth, back, "coverage"), [1 / 3])
        assert_allclose(dominance_rates(forth, back, "coverage", threshold=0.5), [2 / 3])

    def test_refuses_tables_that_do_not_match(self):
        with pytest.raises(ValueError, match="do not match"):
            dominance_rates([[1, 2]], [[1, 2]], "epsilon")
        with pytest.raises(ValueError, match="not a binary indicator"):
            dominance_rates([[1]], [[1]], "hvr")


class TestComparisons:
    @pytest.mark.parametrize("indicator", ["hvr", "epsilon", "coverage"])
    def test_find_the_planted_difference_and_no_other(self, runs, indicator):
        assert compared(runs, "good", "alike", indicator).winner == ""
        for better in ("good", "alike"):
            comparison = compared(runs, better, "bad", indicator)
            assert comparison.winner == comparison.winner_holm == better
            assert comparison.a12 > 0.9

    def test_the_order_of_the_methods_does_not_decide(self, runs):
        for indicator in INDICATORS:
            for a, b in itertools.combinations(runs, 2):
                assert compared(runs, a, b, indicator).winner == compared(runs, b, a, indicator).winner

    def test_the_larger_front_wins_by_cardinality(self):
        rng = np.random.default_rng(5)
        runs = {name: {seed: front_of(rng, 1, size) for seed in range(6)} for name, size in (("few", 4), ("many", 90))}
        comparison = compared(runs, "few", "many", "cardinality")
        assert comparison.winner == "many"
        assert comparison.sample_a.max() < comparison.sample_b.min()

    def test_a_method_against_itself_is_never_better(self, runs):
        for indicator in INDICATORS:
            comparison = compared({"a": runs["good"], "b": runs["good"]}, "a", "b", indicator)
            assert comparison.winner == comparison.winner_holm == ""
            assert comparison.p == 1
            assert comparison.a12 == 0.5

    @pytest.mark.parametrize("indicator", INDICATORS)
    def test_single_runs_decide_nothing_and_say_why(self, indicator):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            comparison = compared({"a": {1: [[1, 2]]}, "b": {1: [[5, 5], [4, 6]]}}, "a", "b", indicator)
        assert (comparison.winner, comparison.p) == ("", 1)
        assert comparison.note

    def test_a_family_over_several_models_is_corrected_together(self, runs):
        pairs = list(itertools.combinations(runs, 2))
        family = [compared(runs, a, b, indicator) for indicator in ("hvr", "coverage") for a, b in pairs]
        together = corrected(family)
        assert_allclose([c.p_holm for c in together], holm([c.p for c in family]))
        assert [c.p for c in together] == [c.p for c in family]
        assert all(one.p_holm >= other.p_holm for one, other in zip(together, family, strict=True))
        assert corrected([]) == []

    def test_correction_can_take_a_victory_away(self):
        samples = np.array([2.0, 3.0]), np.array([0.0, 1.0])
        family = [Comparison("hvr", "a", "b", *samples, p, p, 1.0) for p in (0.03, 0.6, 0.9)]
        first = corrected(family)[0]
        assert_allclose(first.p_holm, 0.09)
        assert (first.winner, first.winner_holm) == ("a", "")


def elbow(n=30, sharpness=4):
    triangles = np.linspace(10, 310, n)
    return np.column_stack([1000 * (1 - np.linspace(0, 1, n)) ** sharpness, triangles])


class TestSelection:
    def test_extremes_are_the_extremes(self, runs):
        selected = selected_solutions(runs, random_state=np.random.default_rng(1))
        for method, seeds in runs.items():
            rows = np.vstack(list(seeds.values()))
            error, triangles, middle = selected[method][:3]
            assert [s.kind for s in (error, triangles, middle)] == [
                "least_error",
                "fewest_triangles",
                "trade_off",
            ]
            assert error.error == rows[:, 0].min()
            assert triangles.triangles == rows[:, 1].min()
            assert error.error <= middle.error <= triangles.error
            assert triangles.triangles <= middle.triangles <= error.triangles
            for solution in selected[method]:
                found_in = tuple(
                    seed for seed, F in seeds.items() if (F == [solution.error, solution.triangles]).all(axis=1).any()
                )
                assert solution.seeds == found_in
                assert found_in

    def test_same_generator_same_choice(self, runs):
        first, second = (selected_solutions(runs, random_state=np.random.default_rng(7)) for _ in "ab")
        assert first == second

    def test_all_methods_are_judged_by_the_same_weights(self):
        twins = {name: {1: elbow()} for name in "abcdefgh"}
        draws = [
            set(selected_solutions(twins, random_state=np.random.default_rng(seed), n_weights=1).values())
            for seed in range(5)
        ]
        assert all(len(choices) == 1 for choices in draws)
        assert len(set.union(*draws)) > 1  # the weights themselves differ from draw to draw

    def test_trade_off_is_what_the_weights_say(self):
        front = elbow()
        weights = np.random.default_rng(3).uniform(size=1000)
        alpha = 1000 / 300
        values = [[w * e + (1 - w) * alpha * t for e, t in front] for w in weights]
        expected = np.argmin(np.sum(values, axis=0))
        assert trade_off(front, random_state=np.random.default_rng(3)) == expected

    def test_trade_off_does_not_depend_on_units(self):
        front = elbow()
        choices = {trade_off(front * [unit, 1], random_state=np.random.default_rng(1)) for unit in (1, 1e-6, 1e6)}
        assert len(choices) == 1
        assert 0 < choices.pop() < len(front) - 1

    def test_a_scale_factor_can_be_given(self):
        rng = np.random.default_rng
        assert trade_off(elbow(), random_state=rng(1), alpha=1e9) == 0  # triangles are all that counts
        assert trade_off(elbow(), random_state=rng(1), alpha=1e-9) == len(elbow()) - 1

    def test_all_methods_get_the_scale_factor_of_the_optimal_front(self):
        runs = {"a": {1: elbow()}}
        steep = np.array([[1e12, 10.0], [0.0, 310.0]])
        (chosen,) = (
            s
            for s in selected_solutions(runs, random_state=np.random.default_rng(1), optimal=steep)["a"]
            if s.kind == "trade_off"
        )
        assert chosen.triangles == 10  # against that range of errors every error here is small
        assert scale_factor(steep) == 1e12 / 300

    def test_one_solution_is_every_choice_and_no_knee(self):
        selected = selected_solutions({"a": {3: [[5, 4]]}}, random_state=np.random.default_rng(1))
        assert selected["a"] == tuple(
            Solution(kind, 5.0, 4, (3,)) for kind in ("least_error", "fewest_triangles", "trade_off")
        )
        assert scale_factor([[5, 4]]) == 1

    def test_the_knee_of_a_bent_front_is_its_bend(self):
        straight = np.column_stack([np.linspace(100, 90, 11), np.linspace(0, 5, 11)])
        steep = np.column_stack([np.linspace(90, 10, 9)[1:], np.linspace(5, 6, 9)[1:]])
        flat = np.column_stack([np.linspace(10, 0, 11)[1:], np.linspace(6, 100, 11)[1:]])
        front = np.vstack([straight, steep, flat])
        corner = len(straight) + len(steep) - 1
        assert corner in knees(front)
        assert_array_equal(knees(front * [1e6, 1]), knees(front))
        assert knees(front).dtype == np.int64

    def test_few_solutions_have_no_knee(self):
        assert len(knees([[1, 2]])) == len(knees([[1, 2], [0, 4]])) == 0

    def test_knees_do_not_change_the_warnings_of_the_process(self):
        before = list(warnings.filters)
        knees(elbow())
        assert warnings.filters == before

    def test_refusals(self):
        rng = np.random.default_rng(1)
        with pytest.raises(ValueError, match="not a front sorted by triangles"):
            trade_off(elbow()[::-1], random_state=rng)
        with pytest.raises(ValueError, match="not a front sorted by triangles"):
            knees([[1, 2], [1, 2], [0, 4]])
        with pytest.raises(ValueError, match="alpha is 0"):
            trade_off(elbow(), random_state=rng, alpha=0)
        with pytest.raises(ValueError, match="n_weights is 0"):
            trade_off(elbow(), random_state=rng, n_weights=0)


class TestAttainment:
    @pytest.mark.parametrize("n_runs", [1, 2, 5])
    def test_surfaces_are_what_brute_force_counts(self, n_runs):
        rng = np.random.default_rng(n_runs)
        runs = {seed: rng.integers(0, 9, (4, 2)).astype(float) for seed in range(n_runs)}
        grid = np.array(list(itertools.product(np.arange(10.0), repeat=2)))
        attained = np.mean([(F[None] <= grid[:, None]).all(axis=2).any(axis=1) for F in runs.values()], axis=0)
        for percentage, surface in attainment_surfaces(runs, (20, 40, 50, 70, 100)).items():
            beyond = (surface[None] <= grid[:, None]).all(axis=2).any(axis=1)
            assert_array_equal(beyond, attained >= percentage / 100 - 1e-12)

    def test_by_default_best_middle_and_worst(self, runs):
        surfaces = attainment_surfaces(runs["good"])
        assert list(surfaces) == [12.5, 50, 100]
        assert_array_equal(surfaces[12.5], non_dominated(np.vstack(list(runs["good"].values()))))
        assert coverage(surfaces[12.5], surfaces[50]) == coverage(surfaces[50], surfaces[100]) == 1

    def test_one_run_attains_itself(self):
        F = [[3, 2], [1, 6], [9, 9]]
        assert {level: surface.tolist() for level, surface in attainment_surfaces({1: F}).items()} == {
            100: [[3, 2], [1, 6]],
            50: [[3, 2], [1, 6]],
        }

    @pytest.mark.parametrize("level", [0, -1, 101, np.nan])
    def test_refuses_impossible_percentages(self, level):
        with pytest.raises(ValueError, match="percentage"):
            attainment_surfaces({1: [[1, 2]]}, [level])


@pytest.mark.parametrize(
    "function",
    [
        pseudo_optimal,
        unary_scores,
        coverage_table,
        epsilon_table,
        lambda runs: selected_solutions(runs, random_state=np.random.default_rng(1)),
    ],
)
class TestUnusableRuns:
    def test_are_refused_with_method_and_seed(self, function):
        with pytest.raises(ValueError, match="method 'b' with seed 2 is empty"):
            function({"a": {1: [[1, 2]]}, "b": {1: [[1, 2]], 2: []}})
        with pytest.raises(ValueError, match="method 'a' with seed 1 has 1 of 1 solutions with NaN"):
            function({"a": {1: [[np.nan, 2]]}})
        with pytest.raises(ValueError, match="3 columns"):
            function({"a": {1: [[1, 2, 3]]}})
        with pytest.raises(ValueError, match="method 'a' has no runs"):
            function({"a": {}})
        with pytest.raises(ValueError, match="no runs to analyse"):
            function({})

    def test_good_ones_are_left_alone(self, function, runs):
        for seeds in runs.values():
            for F in seeds.values():
                F.setflags(write=False)
        function(runs)


def test_summaries():
    assert summarise([2.0, 4.0]).std == math.sqrt(2)
    assert summarise([1.0, -math.inf]).mean == -math.inf
    with pytest.raises(ValueError, match="1 NaN among 2"):
        summarise([1, np.nan])
    with pytest.raises(ValueError, match="at least one number"):
        summarise([])
