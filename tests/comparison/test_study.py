"""Cases of a study: what every indicator is, worked out by hand, and fronts merged as in section 4.3."""

from __future__ import annotations

import numpy as np
import pytest
from handmade import BUDGET, store

from meshsimp_pymoo.comparison.study import BINARY, INDICATORS, SMALLER_IS_BETTER, Study

# Optimal together: (8, 10), (4, 20), (2, 30). Ranges: 6 of error, 20 triangles; alpha = 6 / 20 = 0.3.
FRONTS = {"M": {"A": {1: [(8.0, 10), (4.0, 20)], 2: [(2.0, 30)]}, "B": {1: [(6.0, 20), (4.0, 30)]}}}

# What each run of A is, and B's only one.
BY_HAND = {
    # normalised by the optimum, to 1.1: (1, 0), (1/3, 1/2), (0, 1), together 0.1 * 0.5 + 23/30 * 0.5 + 1.1 * 0.1
    "hvr": ([(0.1 * 0.5 + 23 / 30 * 0.6) / 0.543333333333, 0.11 / 0.543333333333], [None]),
    "cardinality": ([2, 1], [2]),
    # with 1 % of 8 added to the errors: A's first run has 4.08 where 2.08 is; its second 30 triangles where 10 are
    "epsilon_optimal": ([4.08 / 2.08, 3.0], [2.0]),
    "extent": ([0.5, 0.0], [0.5]),
    "least_error": ([4, 2], [4]),
    "fewest_triangles": ([10, 30], [20]),
    # (8 + 0.3 * 10) / 2, (4 + 0.3 * 20) / 2, (2 + 0.3 * 30) / 2; B: (6 + 6) / 2, (4 + 9) / 2
    "trade_off": ([5.0, 5.5], [6.0]),
}


@pytest.fixture
def case(tmp_path):
    return Study(store(tmp_path / "out", FRONTS)).cases["M", BUDGET, "nearest"]


def test_every_indicator_by_hand(case):
    assert case.optimal.front.tolist() == [[8, 10], [4, 20], [2, 30]]
    assert set(BY_HAND) | set(BINARY) == set(INDICATORS)
    for indicator, (of_a, of_b) in BY_HAND.items():
        assert case.unary("A", indicator).tolist() == pytest.approx(of_a), indicator
        sign = -1 if indicator in SMALLER_IS_BETTER else 1
        assert case.samples("A", "B", indicator)[0].tolist() == pytest.approx([sign * value for value in of_a])
        if of_b != [None]:
            assert case.unary("B", indicator).tolist() == pytest.approx(of_b), indicator
            assert case.values("A", "B", indicator) == pytest.approx((np.mean(of_a), np.mean(of_b)))


def test_binary_indicators_by_hand(case):
    # A's first run covers all of B, its second the mesh of 30 triangles; B covers nothing of the first, nor the second
    assert case.values("A", "B", "coverage") == (0.75, 0.0)
    # shifted by 0.08: B's smallest mesh has twice the triangles of A's run 1; its least error 4.08 where run 2 has 2.08
    assert case.values("A", "B", "epsilon")[1] == pytest.approx(np.mean([2.0, 4.08 / 2.08]))
    # run 1 is better than B in all; run 2 has 30 triangles where B has 20
    assert case.values("A", "B", "epsilon")[0] == pytest.approx(np.mean([1.0, 30 / 20]))
    assert case.samples("A", "B", "coverage")[0].tolist() == [1.0, 0.0]  # 1 >= 0.75 > 0, and 0.5 < 0.75
    assert case.samples("A", "B", "epsilon")[0].tolist() == [1.0, 0.0]


def test_merged_runs_are_one_front_and_merged_weights_stay_apart(tmp_path):
    case = Study(store(tmp_path / "out", FRONTS, merged=("B",))).cases["M", BUDGET, "nearest"]
    merged = case.merged
    assert {seed: front.tolist() for seed, front in merged.runs["A"].items()} == {0: [[8, 10], [4, 20], [2, 30]]}
    assert list(merged.runs["B"]) == [1]
    assert merged.evaluations("A").tolist() == [1800.0]
    assert merged.evaluations("B").tolist() == [1800.0]  # of two weights
    assert merged.optimal.front.tolist() == case.optimal.front.tolist()
    assert merged.unary("A", "hvr").tolist() == [1.0]


def test_a_part_of_the_methods_has_an_optimum_of_its_own(case):
    part = case.only(["B"])
    assert list(part.runs) == ["B"]
    assert part.optimal.front.tolist() == [[6, 20], [4, 30]]
    assert part is case.only(["B", "nobody"])
    assert case.only(case.runs).optimal.front.tolist() == case.optimal.front.tolist()
