"""Tournaments decide as pymoo's do, all at once."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pymoo.algorithms.moo.nsga2 import binary_tournament
from pymoo.core.population import Population
from stand_in_problem import GridProblem

from meshsimp_pymoo import nsga2_v1
from meshsimp_pymoo.search.selection import crowded_tournament


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
