"""Tournaments decide as pymoo's do, all at once."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pymoo.algorithms.moo.nsga2 import binary_tournament
from pymoo.algorithms.moo.nsga3 import comp_by_cv_then_random
from pymoo.core.population import Population
from pymoo.operators.selection.tournament import TournamentSelection
from pymoo.optimize import minimize
from stand_in_problem import GridProblem

from meshsimp_pymoo import MeshProblem, nsga2_v1, nsga3
from meshsimp_pymoo.search.selection import crowded_tournament, violation_tournament


@pytest.mark.parametrize("max_triangles", [None, 60])
def test_the_tournament_decides_as_pymoo_does(max_triangles: int | None) -> None:
    problem = GridProblem(7, max_triangles=max_triangles)
    algorithm = nsga2_v1(40)
    algorithm.setup(problem, termination=("n_gen", 9), seed=1)
    for _ in range(2):
        algorithm.next()
    P = np.random.default_rng(1).integers(40, size=(400, 2))
    sides = [P, P[:, ::-1]]
    ours = [crowded_tournament(algorithm.pop, p, random_state=np.random.default_rng(2))[:, 0] for p in sides]
    theirs = [binary_tournament(algorithm.pop, p, algorithm)[:, 0] for p in sides]
    decided = (ours[0] == ours[1]) & (theirs[0] == theirs[1])
    assert decided.sum() > 300
    assert_array_equal(ours[0][decided], theirs[0][decided])
    assert np.all((ours[0] == P[:, 0]) | (ours[0] == P[:, 1]))


def test_undecided_tournaments_are_drawn_by_lot() -> None:
    pop = Population.new("X", np.ones((2, 4), dtype=bool), "F", np.ones((2, 2)), "crowding", [np.inf, np.inf])
    P = np.repeat([[0, 1]], 2000, axis=0)
    winners = crowded_tournament(pop, P, random_state=np.random.default_rng(1))
    assert abs(winners.mean() - 0.5) < 4 * 0.5 / np.sqrt(2000)


def test_solutions_that_violate_equally_are_drawn_by_lot_whatever_their_objectives() -> None:
    F = np.array([[1.0, 1.0], [2.0, 2.0]])
    pop = Population.new("X", np.ones((2, 4), dtype=bool), "F", F, "CV", np.ones((2, 1)))
    P = np.repeat([[0, 1]], 2000, axis=0)
    winners = crowded_tournament(pop, P, random_state=np.random.default_rng(1))
    assert abs(winners.mean() - 0.5) < 4 * 0.5 / np.sqrt(2000)


@pytest.mark.parametrize("violation", [[0.0] * 6, [3.0, 0.0, 0.0, 1.0, 2.0, 0.0]])
def test_nsga3s_tournament_has_pymoos_winners_and_draws_the_same_numbers(violation: list[float]) -> None:
    pop = Population.new("X", np.ones((6, 4), dtype=bool), "CV", np.array(violation)[:, None])
    P = np.random.default_rng(1).permuted(np.tile(np.arange(6), (300, 1)), axis=1)[:, :2]
    ours, theirs = (np.random.default_rng(2) for _ in range(2))
    winners = comp_by_cv_then_random(pop, P, random_state=theirs)
    assert_array_equal(violation_tournament(pop, P, random_state=ours), winners)
    assert ours.bit_generator.state == theirs.bit_generator.state


def test_nsga3_finds_what_it_found_with_pymoos_tournament_and_its_result_can_be_pickled() -> None:
    problem = MeshProblem("roof:5", n_threads=1)
    theirs = TournamentSelection(func_comp=comp_by_cv_then_random)
    ours, before = (
        minimize(problem, nsga3(2, n_partitions=9, **selection), ("n_gen", 6), seed=4)
        for selection in ({}, {"selection": theirs})
    )
    assert_array_equal(ours.X, before.X)
    assert_array_equal(ours.F, before.F)
    again = pickle.loads(pickle.dumps(ours))
    assert_array_equal(again.X, ours.X)
    assert again.algorithm.random_state.bit_generator.state == before.algorithm.random_state.bit_generator.state
