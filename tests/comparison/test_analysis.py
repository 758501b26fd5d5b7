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
    knees,
    pseudo_optimal,
    scale_factor,
    selected_solutions,
    trade_off,
    unary_scores,
)
from meshsimp_pymoo.comparison.statistics import holm
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


class TestByHand:
    """Every indicator of two runs and of what both found."""

    A = ((8, 2), (4, 4), (1, 8), (8, 3), (4, 4))  # the last two are no part of its front
    B = ((6, 3), (4, 4), (1, 10))
    WORSE = ((9, 3), (5, 5))

    def test_pseudo_optimal(self):
        optimal = pseudo_optimal({"a": {1: self.A}, "b": {1: self.B}})
        assert optimal.front.tolist() == [[8, 2], [6, 3], [4, 4], [1, 8]]
        assert optimal.found_by == ((("a", 1),), (("b", 1),), (("a", 1), ("b", 1)), (("a", 1),))

    def test_against_the_optimum(self):
        scores = unary_scores({"a": {1: self.A}, "b": {1: self.B}})
        # bounds (1, 2) and (8, 8), so the reference point is (8.7, 8.6) and one unit is 1 / 42. Areas by the error:
        # optimum: [8, 8.7) 0.7 * 6.6 + [6, 8) 2 * 5.6 + [4, 6) 2 * 4.6 + [1, 4) 3 * 0.6 = 26.82
        # a:       [8, 8.7) 0.7 * 6.6 + [4, 8) 4 * 4.6                  + [1, 4) 3 * 0.6 = 24.82
        # b:       [6, 8.7) 2.7 * 5.6 + [4, 6) 2 * 4.6; 10 triangles are too many        = 24.32
        assert_allclose(scores["a"].hvr, [24.82 / 26.82])
        assert_allclose(scores["b"].hvr, [24.32 / 26.82])
        # a to reach (6, 3): from (8, 2) a factor of 8 / 6; b to reach (8, 2): from (6, 3) a factor of 3 / 2
        assert_allclose(scores["a"].epsilon, [4 / 3])
        assert_allclose(scores["b"].epsilon, [3 / 2])
        assert scores["a"].coverage == [3 / 4]
        assert scores["b"].coverage == [2 / 4]
        assert scores["a"].cardinality == scores["b"].cardinality == [3]

    def test_against_each_other(self):
        runs = {"a": {1: self.A}, "b": {1: self.B, 2: self.WORSE}}
        # (4, 4) and (1, 10) of b's first run, all of its second; of a's front only (4, 4), and nothing
        table = coverage_table(runs)
        assert_array_equal(table.values["a", "b"], [[2 / 3, 1]])
        assert_array_equal(table.values["b", "a"], [[1 / 3], [0]])
        assert dominance_rates(table.values["a", "b"], table.values["b", "a"], "coverage") == [1 / 2]
        assert dominance_rates(table.values["a", "b"], table.values["b", "a"], "coverage", threshold=0.6) == [1]
        # (6, 3) from (8, 2); (9, 3) from (8, 2). Back: (8, 2) from (6, 3), (1, 8) from (5, 5)
        table = epsilon_table(runs)
        assert_allclose(table.values["a", "b"], [[8 / 6, 8 / 9]])
        assert_allclose(table.values["b", "a"], [[3 / 2], [5]])
        assert dominance_rates(table.values["a", "b"], table.values["b", "a"], "epsilon") == [1 / 2]
        assert_array_equal(dominance_rates(table.values["b", "a"], table.values["a", "b"], "epsilon"), [0, 0])

    def test_no_error(self):
        # (0, 20) is reached by no factor; with 1 added to the errors, by (1, 8) with 2 / 1; by (0, 12) with 12 / 20,
        # and then (6, 3) is the farthest again
        zero = ((0, 20), *self.B)
        assert epsilon(self.A, zero) == math.inf
        assert epsilon(self.A, zero, shift=[1, 0]) == 2
        assert_allclose(epsilon(((0, 12), *self.A), zero), 4 / 3)
        assert_allclose(epsilon(((0, 12), *self.A), [[0, 20]]), 12 / 20)

    def test_attainment(self):
        # both have: at 3 triangles an error of 8, at 4 of 4, and 1 not before 10
        surfaces = attainment_surfaces({1: self.A, 2: self.B})
        assert surfaces[50].tolist() == [[8, 2], [6, 3], [4, 4], [1, 8]]
        assert surfaces[100].tolist() == [[8, 3], [4, 4], [1, 10]]


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
        selected = selected_solutions(runs)
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

    def test_trade_off_by_hand(self):
        front = [[8, 2], [4, 4], [1, 10]]
        # alpha = (8 - 1) / (10 - 2) = 0.875, and (E + alpha T) / 2 = 4.875, 3.75, 4.875
        assert scale_factor(front) == 0.875
        assert trade_off(front) == 1
        # Eq. 10: alpha = (2 / 8 + 4 / 4 + 10 / 1) / 3 = 3.75; Eq. 11 at w = 1/2: (alpha E + T) / 2 = 16, 9.5, 6.875
        assert scale_factor(front, "paper") == 3.75
        assert trade_off(front, rule="paper") == 2
        # without the third solution alpha = (0.25 + 1) / 2 = 0.625, and the values are 3.5 and 3.25
        assert scale_factor(front[:2], "paper") == 0.625
        assert trade_off(front[:2], rule="paper") == 1

    @pytest.mark.parametrize("rule", ["ranges", "paper"])
    def test_random_weights_are_the_papers_sums(self, rule):
        triangles = np.arange(200.0, 2, -1)[::-1]
        front = np.column_stack([1000 / triangles, triangles])
        choices = set()
        for seed in range(20):
            weights = np.random.default_rng(seed).uniform(size=9)
            if rule == "paper":
                alpha = sum(t / e for e, t in front) / len(front)
                values = [sum(alpha * w * e + (1 - w) * t for w in weights) / 9 for e, t in front]
            else:
                alpha = (front[0, 0] - front[-1, 0]) / (front[-1, 1] - front[0, 1])
                values = [sum(w * e + (1 - w) * alpha * t for w in weights) / 9 for e, t in front]
            chosen = trade_off(front, rule=rule, n_weights=9, random_state=np.random.default_rng(seed))
            assert chosen == np.argmin(values)
            choices.add(chosen)
        assert len(choices) > 1  # which is why the mean of all weights is the default
        assert min(choices) < trade_off(front, rule=rule) < max(choices)

    @pytest.mark.parametrize("rule", ["ranges", "paper"])
    def test_the_default_is_what_ever_more_weights_tend_to(self, rule):
        front = elbow()[:-1]
        many = trade_off(front, rule=rule, n_weights=10**6, random_state=np.random.default_rng(1))
        assert trade_off(front, rule=rule) == many

    def test_of_equal_values_the_fewest_triangles(self):
        # scaled by their own ranges the two ends are equal, whatever rounding makes of it
        rng = np.random.default_rng(2)
        for _ in range(100):
            (e1, e2), (t1, t2) = np.sort(rng.uniform(0, 1e5, 2)), np.sort(rng.choice(10**6, 2, replace=False) + 2)
            assert trade_off([[e2, t1], [e1, t2]]) == 0
        # alpha = (3 / 3 + 3 / 1) / 2 = 2 of the second and third alone; given, all three values are 6
        assert trade_off([[2.5, 1], [2, 2], [1, 4]], rule="paper", alpha=2) == 0

    def test_the_papers_rule_is_undefined_where_a_mesh_has_no_error(self):
        front = [[8, 2], [4, 4], [0, 10]]
        assert scale_factor(front, "paper") is None
        assert trade_off(front, rule="paper") is None
        assert trade_off(front) is not None
        assert trade_off([[1, 2], [5e-324, 10]], rule="paper") is None  # T / E is beyond all numbers
        kinds = [solution.kind for solution in selected_solutions({"a": {1: front}})["a"]]
        assert kinds == ["least_error", "fewest_triangles", "trade_off", "knee"]

    def test_the_papers_rule_has_the_scale_of_the_methods_own_front(self):
        runs = {"a": {1: [[8, 2], [4, 4], [1, 10]]}, "b": {1: [[8, 2], [4, 4]]}}
        chosen = {m: {s.kind: s.triangles for s in solutions} for m, solutions in selected_solutions(runs).items()}
        assert chosen["a"]["trade_off_paper"] == 10
        assert chosen["b"]["trade_off_paper"] == 4
        # by the ranges of the front of both, 7 / 8: 4.875 and 3.75
        assert chosen["a"]["trade_off"] == chosen["b"]["trade_off"] == 4

    def test_all_methods_are_judged_by_the_same_weights(self):
        twins = {name: {1: elbow()} for name in "abcdefgh"}
        draws = [
            set(selected_solutions(twins, n_weights=1, random_state=np.random.default_rng(seed)).values())
            for seed in range(5)
        ]
        assert all(len(choices) == 1 for choices in draws)
        assert len(set.union(*draws)) > 1  # the weights themselves differ from draw to draw

    def test_trade_off_does_not_depend_on_units(self):
        front = elbow()[:-1]
        for rule in ("ranges", "paper"):
            choices = {trade_off(front * [unit, 1], rule=rule) for unit in (1, 1e-6, 1e6)}
            assert len(choices) == 1
            assert 0 < choices.pop() < len(front) - 1 + (rule == "paper")

    def test_a_scale_factor_can_be_given(self):
        assert trade_off(elbow(), alpha=1e9) == 0  # triangles are all that counts
        assert trade_off(elbow(), alpha=1e-9) == len(elbow()) - 1
        assert trade_off(elbow(), rule="paper", alpha=1e-9) == 0  # of the error there

    def test_all_methods_get_the_scale_factor_of_the_optimal_front(self):
        runs = {"a": {1: elbow()}}
        steep = np.array([[1e12, 10.0], [0.0, 310.0]])
        (chosen,) = (s for s in selected_solutions(runs, optimal=steep)["a"] if s.kind == "trade_off")
        assert chosen.triangles == 10  # against that range of errors every error here is small
        assert scale_factor(steep) == 1e12 / 300

    def test_one_solution_is_every_choice_and_no_knee(self):
        selected = selected_solutions({"a": {3: [[5, 4]]}})
        assert selected["a"] == tuple(
            Solution(kind, 5.0, 4, (3,)) for kind in ("least_error", "fewest_triangles", "trade_off", "trade_off_paper")
        )
        assert scale_factor([[5, 4]]) == 1
        assert scale_factor([[5, 4]], "paper") == 0.8

    def test_a_knee_by_hand(self):
        # scaled to [0, 1]: (1, 0), (.8, .1), (.2, .2), (.1, .6), (0, 1); five solutions are neighbours of each
        # other. The least price of a gain: .2/.8, .1/.6, min(.8/.2, .6/.1, .4/.1, .8/.2), .1/.4, .1/.4
        # = .25, .167, 4, .25, .25; their mean is .983, their deviation 1.509: only the third is more than one off
        assert_array_equal(knees([[20, 1], [18, 2], [12, 3], [11, 7], [10, 11]]), [2])

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
        with pytest.raises(ValueError, match="not a front sorted by triangles"):
            trade_off(elbow()[::-1])
        with pytest.raises(ValueError, match="not a front sorted by triangles"):
            knees([[1, 2], [1, 2], [0, 4]])
        with pytest.raises(ValueError, match="alpha is 0"):
            trade_off(elbow(), alpha=0)
        with pytest.raises(ValueError, match="n_weights is 0"):
            trade_off(elbow(), n_weights=0, random_state=np.random.default_rng(1))
        with pytest.raises(ValueError, match="random weights need both"):
            trade_off(elbow(), n_weights=1000)
        with pytest.raises(ValueError, match="random weights need both"):
            selected_solutions({"a": {1: elbow()}}, random_state=np.random.default_rng(1))
        with pytest.raises(ValueError, match="'mean' is no rule of the trade-off: choose 'ranges' or 'paper'"):
            trade_off(elbow(), rule="mean")


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
        selected_solutions,
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
