"""The sizes and members of random subsets are uniform."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import chisquare
from stand_in_problem import GridProblem

from meshsimp_pymoo.search.operators import RandomSubset


def test_all_sizes_from_the_pinned_vertices_to_all_are_equally_likely() -> None:
    problem = GridProblem(5)
    X = RandomSubset()._do(problem, 22_000, random_state=np.random.default_rng(1))
    counts = np.bincount(X.sum(axis=1), minlength=26)
    assert counts[:4].sum() == 0
    assert chisquare(counts[4:]).pvalue > 0.01


def test_all_free_vertices_are_equally_likely_at_every_size() -> None:
    problem = GridProblem(5)
    X = RandomSubset()._do(problem, 22_000, random_state=np.random.default_rng(2))
    for size in (6, 14, 15, 22):  # few are drawn by what is kept, many by what is dropped
        of_size = X[X.sum(axis=1) == size]
        assert chisquare(of_size[:, ~problem.pinned].sum(axis=0)).pvalue > 0.01


def test_with_everything_pinned_there_is_one_subset() -> None:
    problem = GridProblem(2)
    assert RandomSubset()._do(problem, 3, random_state=np.random.default_rng(3)).all()


@pytest.mark.parametrize(
    ("size", "low", "high"),
    [
        (12, 12, 12),
        (4, 4, 4),  # the pinned ones alone
        (25, 25, 25),
        (0.5, 12, 12),  # 12.5: halves to the even number
        (0.54, 14, 14),  # 13.5
        (1.0, 25, 25),  # a share
        ((6, 9), 6, 9),
        ([6, 0.5], 6, 12),
        ((0.2, 0.4), 5, 10),
        ((7, 7), 7, 7),
        ((np.int64(6), np.float64(0.4)), 6, 10),
    ],
)
def test_sizes_are_those_that_were_asked_for_the_pinned_vertices_included(size: Any, low: int, high: int) -> None:
    problem = GridProblem(5)
    X = RandomSubset(size)._do(problem, 4000, random_state=np.random.default_rng(4))
    assert X[:, problem.pinned].all()
    counts = np.bincount(X.sum(axis=1), minlength=high + 1)
    assert counts[:low].sum() == counts[high + 1 :].sum() == 0
    if low < high:
        assert chisquare(counts[low : high + 1]).pvalue > 0.01
    if high < 25 and low > 4:
        for n in {low, high}:
            assert chisquare(X[X.sum(axis=1) == n][:, ~problem.pinned].sum(axis=0)).pvalue > 0.01


def test_without_a_size_nothing_has_changed() -> None:
    problem = GridProblem(6)
    rng = np.random.default_rng(5)
    sizes = rng.integers(0, 32, size=50, endpoint=True)  # the first draw: free vertices to keep
    X = RandomSubset()._do(problem, 50, random_state=np.random.default_rng(5))
    assert (X.sum(axis=1) == sizes + 4).all()
    every_size = RandomSubset((4, 36))._do(problem, 50, random_state=np.random.default_rng(5))
    assert (X == every_size).all()


@pytest.mark.parametrize(
    "size", [0, -3, True, False, 1.5, 2.0, 0.0, -0.1, float("nan"), float("inf"), "0.2", (), (5,), (5, 6, 7), (5, "6"),
             (5, True), {5: 6}, np.array([5, 6])]
)  # fmt: skip
def test_what_is_no_size_is_refused_when_made(size: Any) -> None:
    with pytest.raises(ValueError, match=r"^size=.*is no size; give a whole number of kept vertices, a share") as said:
        RandomSubset(size)
    assert "\n" not in str(said.value)


@pytest.mark.parametrize("size", [(6, 5), (0.5, 0.4)])
def test_bounds_in_the_wrong_order_are_refused_when_made(size: Any) -> None:
    with pytest.raises(ValueError, match="begins above its end"):
        RandomSubset(size)


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (3, "size=3 asks for 3 of 25 vertices, 4 of them pinned; give 4 to 25, or a share"),
        (26, "size=26 asks for 26 of 25 vertices"),
        (0.1, r"size=0\.1 asks for 2 of 25 vertices, 4 of them pinned"),
        ((4, 26), r"size=\[4, 26\] asks for 26 of 25"),
        ((0.1, 10), r"size=\[0\.1, 10\] asks for 2 of 25"),
        ((0.5, 10), r"size=\[0\.5, 10\] is 12 to 10 of 25 vertices; give the smaller end first"),
    ],
)
def test_sizes_that_a_model_has_not_are_refused_when_sampling(size: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        RandomSubset(size)._do(GridProblem(5), 3, random_state=np.random.default_rng(1))
