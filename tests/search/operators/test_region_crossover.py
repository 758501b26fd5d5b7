"""Regions come from the parent that does them for less."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population

from meshsimp_pymoo import MeshProblem, thinning
from meshsimp_pymoo.search.operators import RegionCrossover, SubsetUniformCrossover
from meshsimp_pymoo.search.operators.region_crossover import cheaper_parent, price_of_a_triangle, region_starts


def region_pairs(problem: MeshProblem, X: np.ndarray) -> Population:
    """Evaluated pairs (n_matings, 2) of chromosomes (n_matings, 2, N)."""
    pop = Evaluator().eval(problem, Population.new("X", X.reshape(-1, problem.n_var)))
    return pop.reshape(-1, 2)


@pytest.mark.parametrize(("footprint", "outside"), [("model", "nearest"), ("hull", "ignore")])
def test_errors_by_region_are_those_of_the_vertices_in_it(footprint: str, outside: str) -> None:
    problem = MeshProblem("ring:300", footprint=footprint, outside=outside, regions=7)
    X = (np.random.default_rng(1).random((20, problem.n_var)) < 0.1) | problem.pinned
    found = Evaluator().eval(problem, Population.new("X", X)).get("region_error")
    region = np.arange(problem.n_var) * 7 // problem.n_var
    assert_array_equal(np.flatnonzero(np.diff(region, prepend=-1)), region_starts(7, problem.n_var))
    for kept, errors in zip(X, found, strict=True):
        deviation = problem.simplify(kept).deviation
        np.testing.assert_allclose(errors, np.bincount(region, deviation, minlength=7), rtol=1e-12, atol=1e-12)


def test_a_child_takes_each_half_from_the_parent_that_is_good_there() -> None:
    problem = MeshProblem("peaks:21", regions=2)
    half = np.arange(problem.n_var) * 2 // problem.n_var == 0
    rng = np.random.default_rng(3)
    good = thinning(problem.surface).kept(40)
    poor = problem.pinned.copy()
    for side in (half, ~half):
        rows = np.flatnonzero(side & ~problem.pinned)
        poor[rng.choice(rows, (good & side & ~problem.pinned).sum(), replace=False)] = True
    parents = np.array([[np.where(half, good, poor), np.where(half, poor, good)]])
    pairs = region_pairs(problem, parents)
    children = RegionCrossover(prob=1.0)(problem, pairs, random_state=rng).get("X")
    assert_array_equal(children, [good, good])
    assert problem.evaluate(good)[0] < 0.7 * min(parent.F[0] for parent in pairs[0])


def test_at_the_price_of_the_parents_no_region_is_taken_that_costs_more_than_the_other_parents() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        excess = rng.normal(size=6)
        differs = rng.random(6) < 0.8
        second = cheaper_parent(excess, differs)
        wrong = second != (excess > 0)
        assert wrong.sum() <= 1
        if differs.sum() > 1:
            assert 0 < second[differs].sum() < differs.sum()
        if wrong.any():
            assert np.abs(excess[wrong]) == np.abs(excess[differs]).min()


def test_a_triangle_is_worth_the_slope_between_parents_whose_error_falls_with_their_size() -> None:
    triangles = np.array([20, 50])
    error = 300.0 / triangles
    slope = -np.diff(error)[0] / np.diff(triangles)[0]
    assert price_of_a_triangle(error, triangles) == pytest.approx(slope)
    assert price_of_a_triangle(np.array([1.0, 1.0]), np.array([0, 4])) == 0.5


def test_region_crossover_evaluates_nothing() -> None:
    problem = MeshProblem("peaks:12", regions=16, memo=0)
    X = (np.random.default_rng(2).random((4, 2, problem.n_var)) < 0.3) | problem.pinned
    pairs = region_pairs(problem, X)
    problem.evaluate_subsets = None  # type: ignore[assignment, method-assign]
    children = RegionCrossover(prob=1.0)(problem, pairs, random_state=np.random.default_rng(0))
    assert len(children) == 8


def test_without_known_errors_the_message_says_how_to_get_them() -> None:
    X = np.random.default_rng(2).random((1, 2, 144)) < 0.5
    without = MeshProblem("peaks:12")
    with pytest.raises(ValueError, match=r"make it with MeshProblem\(\.\.\., regions=256\)"):
        RegionCrossover(prob=1.0)(without, region_pairs(without, X), random_state=np.random.default_rng(0))
    other = MeshProblem("peaks:12", regions=5)
    with pytest.raises(ValueError, match=r"in 5 regions; this one has none"):
        RegionCrossover(prob=1.0)(other, region_pairs(without, X), random_state=np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"regions=5000 is no number of regions; give 0 to 4096"):
        MeshProblem("peaks:12", regions=5000)


def test_region_crossover_finds_better_children_than_exchanging_at_random() -> None:
    """On the same parents, at equal numbers of triangles or fewer; measured by the sum of both objectives, scaled."""
    problem = MeshProblem("peaks:31", regions=64)
    rng = np.random.default_rng(5)
    X = (rng.random((40, 2, problem.n_var)) < rng.uniform(0.05, 0.3, (40, 2, 1))) | problem.pinned
    pairs = region_pairs(problem, X)
    means = []
    for crossover in (RegionCrossover(prob=1.0), SubsetUniformCrossover(prob=1.0)):
        F = problem.evaluate(crossover(problem, pairs, random_state=np.random.default_rng(6)).get("X"))
        parents = np.array([[p.F for p in pair] for pair in pairs])
        price = np.abs(np.diff(parents[:, :, 0])[:, 0] / np.diff(parents[:, :, 1])[:, 0])
        cost = (F[:, 0] + np.tile(price, 2) * F[:, 1]) / np.tile((parents @ [1.0, 0.0]).mean(axis=1), 2)
        means.append(np.median(cost))
    assert means[0] < 0.97 * means[1]
