"""Indicators: slow twins written from the definitions, axioms, known answers, refusals."""

from __future__ import annotations

import itertools
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pymoo.core.indicator import Indicator

import meshsimp_pymoo
from meshsimp_pymoo import indicators
from meshsimp_pymoo.indicators import (
    REFERENCE,
    Cardinality,
    Coverage,
    HypervolumeRatio,
    MultiplicativeEpsilon,
    cardinality,
    coverage,
    epsilon,
    hypervolume_ratio,
    merged_front,
    non_dominated,
)

TWO_FRONT_FUNCTIONS = (hypervolume_ratio, epsilon, coverage)


def random_fronts(n_pairs, *, least=0, seed=0):
    """Pairs of point sets on a coarse lattice: ties, duplicates, dominated points, zeros if least=0."""
    rng = np.random.default_rng(seed)
    for k in range(n_pairs):
        sizes = rng.integers(1, 12, 2)
        top = (4, 9, 40)[k % 3]
        yield tuple(rng.integers(least, top, (size, 2)).astype(float) for size in sizes)


def naive_front(F):
    rows = [tuple(row) for row in F]
    return sorted(
        {a for a in rows if not any(b != a and all(x <= y for x, y in zip(b, a, strict=True)) for b in rows)},
        key=lambda row: (row[1], row[0]),
    )


def naive_epsilon(A, B):
    """The infimum in the definition, in exact fractions; the axiom's exception for all-zero solutions."""
    worst = 0
    for b in naive_front(B):
        factors = []
        for a in naive_front(A):
            if not any(a) and not any(b):
                factors.append(1)
                continue
            needed = [Fraction(0)]
            for x, y in zip(a, b, strict=True):
                if y:
                    needed.append(Fraction(x) / Fraction(y))
                elif x:
                    needed.append(math.inf)
            factors.append(max(needed))
        worst = max(worst, min(factors))
    return float(worst)


def naive_coverage(A, B):
    B = naive_front(B)
    return sum(any(a[0] <= b[0] and a[1] <= b[1] for a in A) for b in B) / len(B)


def naive_volume(F, low, scale):
    """Count the cells of the lattice of all coordinates that some point dominates."""
    points = [((x - low[0]) / scale[0], (y - low[1]) / scale[1]) for x, y in F]
    xs, ys = (sorted({p[i] for p in points if p[i] < REFERENCE} | {REFERENCE}) for i in (0, 1))
    return sum(
        (x1 - x0) * (y1 - y0)
        for (x0, x1), (y0, y1) in itertools.product(itertools.pairwise(xs), itertools.pairwise(ys))
        if any(p[0] <= x0 and p[1] <= y0 for p in points)
    )


def naive_ratio(F, optimal):
    low = optimal.min(axis=0)
    scale = [
        high - small if high > small else (abs(small) or 1.0)
        for small, high in zip(low, optimal.max(axis=0), strict=True)
    ]
    return naive_volume(F, low, scale) / naive_volume(optimal, low, scale)


def test_all_indicators_of_pymoos_kind_are_public_names():
    own = {name: kind for name, kind in vars(indicators).items() if isinstance(kind, type) and name[0] != "_"}
    own = {name: kind for name, kind in own.items() if issubclass(kind, Indicator) and kind is not Indicator}
    assert len(own) == 4
    assert {name: getattr(meshsimp_pymoo, name) for name in own if name in meshsimp_pymoo.__all__} == own


def test_a_thousand_random_fronts_agree_with_brute_force():
    for A, B in random_fronts(1000):
        assert_array_equal(non_dominated(A), naive_front(A))
        assert cardinality(A) == len(naive_front(A))
        assert coverage(A, B) == naive_coverage(A, B)
        assert_allclose(epsilon(A, B), naive_epsilon(A, B), rtol=1e-14)
        optimal = non_dominated(np.vstack([A, B]))
        # the bounds are those of the front, not of the dominated points around it
        assert_allclose(hypervolume_ratio(A, optimal), naive_ratio(A, optimal), rtol=1e-12, atol=1e-15)


def test_without_zeros_epsilon_is_brute_force_too():
    for A, B in random_fronts(300, least=1, seed=1):
        assert_allclose(epsilon(A, B), naive_epsilon(A, B), rtol=1e-14)


def test_the_formula_for_zeros_and_moocore_meet_at_tiny_values():
    for A, B in random_fronts(200, least=1, seed=2):
        with_zero = epsilon(np.vstack([A, [0.0, 50.0]]), np.vstack([B, [0.0, 50.0]]))
        almost = epsilon(np.vstack([A, [1e-9, 50.0]]), np.vstack([B, [1e-9, 50.0]]))
        # a shared solution of no error asks nothing of the error but the same triangles: a factor of 1
        assert_allclose(max(with_zero, 1.0), almost, rtol=1e-14)


@pytest.mark.parametrize("m", [1, 2, 3])
def test_axioms_for_a_front_and_itself(m):
    rng = np.random.default_rng(3)
    for low in (0, 1):
        for _ in range(50):
            A = rng.integers(low, 6, (8, m)).astype(float)
            assert coverage(A, A) == 1
            assert epsilon(A, A) == 1
            assert hypervolume_ratio(A, A) == 1


def test_weak_dominance_is_what_epsilon_and_coverage_say_it_is():
    for A, B in random_fronts(1000, seed=4):
        dominates = naive_coverage(A, B) == 1
        assert (epsilon(A, B) <= 1) == dominates
        assert (coverage(A, B) == 1) == dominates


def test_improving_a_front_never_lowers_its_hypervolume_ratio():
    rng = np.random.default_rng(5)
    for A, B in random_fronts(500, seed=5):
        optimal = np.vstack([A, B])
        worse = A + rng.integers(0, 3, A.shape)
        assert hypervolume_ratio(worse, optimal) <= hypervolume_ratio(A, optimal)
        assert hypervolume_ratio(A[:1], optimal) <= hypervolume_ratio(A, optimal) <= 1 + 1e-15


def test_a_strictly_better_front_inside_the_box_has_a_larger_ratio():
    optimal = [[0, 30], [1, 20], [5, 10]]
    assert hypervolume_ratio([[2, 20]], optimal) < hypervolume_ratio([[1, 20]], optimal)


def test_epsilon_obeys_the_triangle_inequality():
    rng = np.random.default_rng(6)
    for _ in range(200):
        A, B, C = rng.integers(1, 20, (3, 6, 2)).astype(float)
        assert epsilon(A, C) <= epsilon(A, B) * epsilon(B, C) * (1 + 1e-14)


def test_units_do_not_matter():
    for A, B in random_fronts(100, least=1, seed=7):
        units = np.array([0.125, 1024.0])
        assert_allclose(epsilon(A * units, B * units), epsilon(A, B))
        assert coverage(A * units, B * units) == coverage(A, B)
        both = np.vstack([A, B])
        assert_allclose(hypervolume_ratio(A * units, both * units), hypervolume_ratio(A, both))


def test_duplicates_dominated_solutions_and_order_change_nothing():
    rng = np.random.default_rng(8)
    for A, B in random_fronts(100, seed=8):
        padded = np.vstack([A, A + 1, A])
        rng.shuffle(padded)
        for function in TWO_FRONT_FUNCTIONS:
            assert function(padded, B) == function(A, B)
            assert function(B, padded) == function(B, A)
        assert cardinality(padded) == cardinality(A)


def test_known_answers():
    optimal = np.array([[0.0, 20], [1, 15], [2, 10]])
    whole = 1.1 * 0.1 + (1.1 - 0.5) * 0.5 + 0.1 * 0.5
    assert_allclose(hypervolume_ratio([[1, 15]], optimal), 0.6**2 / whole)
    assert hypervolume_ratio([[2.2, 10]], optimal) == 0  # beyond the reference point in the error
    assert hypervolume_ratio([[-1, 10]], optimal) > 1  # better than the "optimal" front
    assert epsilon([[3, 4], [1, 8]], [[2, 4], [2, 8]]) == 1.5
    assert epsilon([[2, 4], [2, 8]], [[3, 4], [1, 8]]) == 2
    assert coverage([[1, 15], [5, 5]], optimal) == 1 / 3


def test_a_zero_error_is_reached_by_a_zero_error_only():
    assert epsilon([[0, 10]], [[0, 5]]) == 2
    assert epsilon([[0, 5]], [[0, 10]]) == 0.5  # the error asks nothing of a mesh that has none
    assert epsilon([[1e-300, 5]], [[0, 5]]) == math.inf
    assert epsilon([[0, 5]], [[1e-300, 5]]) == 1
    assert epsilon([[1, 5]], [[0, 5]], shift=[1, 0]) == 2
    assert epsilon([[1, 5]], [[0, 5]], shift=1) == 2


def test_an_optimal_front_of_one_point_still_has_a_ratio():
    assert hypervolume_ratio([[10, 4]], [[10, 4]]) == 1
    assert_allclose(hypervolume_ratio([[10.5, 4]], [[10, 4]]), (1.1 - 0.05) / 1.1)
    assert hypervolume_ratio([[0, 4]], [[0, 4]]) == 1
    assert_allclose(hypervolume_ratio([[0.5, 4]], [[0, 4]]), 0.6 / 1.1)


def test_given_bounds_fix_the_normalisation():
    optimal = [[0, 20], [2, 10]]
    assert_allclose(
        hypervolume_ratio([[2, 20]], optimal, ideal=[0, 0], nadir=[4, 40]),
        0.6**2 / (1.1 * 0.6 + 0.6 * 0.25),
    )


def test_merging_fronts_is_reducing_all_of_their_solutions():
    for A, B in random_fronts(50, seed=10):
        assert_array_equal(merged_front([A, B, A]), naive_front(np.vstack([A, B])))
    with pytest.raises(ValueError, match="front 1 is empty"):
        merged_front([[[1.0, 2]], []])


def test_solutions_infinitely_far_beyond_the_reference_point_count_nothing():
    optimal = [[0, 2], [1e-300, 1]]
    assert hypervolume_ratio([[1e308, 1], [0, 2]], optimal) == hypervolume_ratio([[0, 2]], optimal)
    assert hypervolume_ratio([[30]], [[10]]) == 0


def test_arguments_are_left_alone():
    A, B = np.array([[3.0, 1], [-0.0, 4]]), np.array([[1.0, 3], [2, 2]])
    for array in (A, B):
        array.setflags(write=False)
    for function in TWO_FRONT_FUNCTIONS:
        function(A, B)


INDICATORS = (
    HypervolumeRatio([[0, 20], [2, 10]]),
    MultiplicativeEpsilon([[0, 20], [2, 10]]),
    Coverage([[0, 20], [2, 10]]),
    Cardinality(),
)


@pytest.mark.parametrize("indicator", INDICATORS, ids=lambda indicator: type(indicator).__name__)
class TestEveryPymooIndicator:
    def test_is_one_and_returns_a_float(self, indicator):
        assert isinstance(indicator, Indicator)
        value = indicator(np.array([[0.0, 30], [3, 12]]))
        assert type(value) is float
        assert value == indicator.do(np.array([[3.0, 12], [0, 30], [3, 30]]))

    def test_takes_a_single_solution_as_pymoo_does(self, indicator):
        assert indicator(np.array([2.0, 10])) == indicator(np.array([[2.0, 10]]))

    def test_refuses_an_empty_front_instead_of_a_perfect_score(self, indicator):
        for empty in (np.empty((0, 2)), np.array([])):
            with pytest.raises(ValueError, match="is empty"):
                indicator(empty)

    def test_refuses_nan_and_says_where(self, indicator):
        with pytest.raises(ValueError, match=r"1 of 2 solutions with NaN or infinite .*row 1, \[nan, 4\.0\]"):
            indicator(np.array([[1, 2], [np.nan, 4]]))

    def test_survives_pickling(self, indicator):
        F = np.array([[1.0, 12]])
        assert pickle.loads(pickle.dumps(indicator))(F) == indicator(F)


def test_indicators_say_what_their_functions_say():
    for A, B in random_fronts(50, seed=9):
        assert HypervolumeRatio(B)(A) == hypervolume_ratio(A, B)
        assert MultiplicativeEpsilon(B)(A) == epsilon(A, B)
        assert MultiplicativeEpsilon(B, shift=2)(A) == epsilon(A, B, shift=2)
        assert Coverage(B)(A) == coverage(A, B)
        assert Cardinality()(A) == cardinality(A)


@pytest.mark.parametrize("function", TWO_FRONT_FUNCTIONS)
@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ([], "is empty"),
        (np.empty((0, 2)), "is empty"),
        ([[1, np.inf]], "NaN or infinite"),
        ([1, 2], r"shape \(2,\)"),
        ([["a", 1]], "not an array of numbers"),
        ([[1, 2, 3]], "cannot be compared"),
    ],
)
def test_unusable_fronts_are_refused_on_either_side(function, bad, words):
    with pytest.raises(ValueError, match=words):
        function(bad, [[1, 2]])
    with pytest.raises(ValueError, match=words):
        function([[1, 2]], bad)


def test_other_refusals():
    with pytest.raises(ValueError, match="negative objectives"):
        epsilon([[-1, 2]], [[1, 2]])
    with pytest.raises(ValueError, match="the shift is -1"):
        epsilon([[1, 2]], [[1, 2]], shift=-1)
    with pytest.raises(ValueError, match="the shift is"):
        epsilon([[1, 2]], [[1, 2]], shift=[1, 2, 3])
    with pytest.raises(ValueError, match="more than 1"):
        hypervolume_ratio([[1, 2]], [[1, 2]], reference=1)
    with pytest.raises(ValueError, match="were they swapped"):
        HypervolumeRatio([[1, 2]], ideal=[5, 5], nadir=[0, 0])
    with pytest.raises(ValueError, match="dominates the reference point"):
        HypervolumeRatio([[10, 20]], ideal=[0, 0], nadir=[5, 5])
    with pytest.raises(ValueError, match="give 2 finite numbers"):
        HypervolumeRatio([[10, 20]], ideal=[0, np.nan])
