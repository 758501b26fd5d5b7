"""NSGA-II: what it finds, and what it costs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.evaluator import Evaluator
from pymoo.optimize import minimize
from pymoo.util.archive import MultiObjectiveArchive
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting
from stand_in_problem import GridProblem, front_of

from meshsimp_pymoo import nsga2_v1, nsga2_v2
from meshsimp_pymoo.search.operators import OAX, PackedDuplicates
from meshsimp_pymoo.search.paper import paper_operators

Make = Callable[..., Any]


@pytest.mark.parametrize("make", [nsga2_v1, nsga2_v2])
def test_nsga2_finds_the_whole_front_of_a_small_model(make: Make) -> None:
    problem = GridProblem(4)
    result = minimize(problem, make(pop_size=60), ("n_gen", 60), seed=1)
    expected = front_of(problem)
    assert_array_equal(np.unique(result.F, axis=0), np.unique(expected, axis=0))


class TestNSGA2:
    def test_v2_evaluates_three_candidates_for_each_crossing_pair(self) -> None:
        v1, v2 = (minimize(GridProblem(10), make(), ("n_gen", 11), seed=1) for make in (nsga2_v1, nsga2_v2))
        assert v1.algorithm.evaluator.n_eval == 1100
        extra = v2.algorithm.evaluator.n_eval - 1100
        assert 0.9 * 1200 < extra < 1.05 * 1200  # 10 generations of 50 pairs, 0.8 of them crossing; some are twins

    def test_refilling_duplicates_does_not_exceed_a_budget_by_more_than_one_generation(self) -> None:
        problem = GridProblem(3)  # 32 solutions in all
        result = minimize(problem, NSGA2(20, crossover=OAX(prob=1.0), **paper_operators()), ("n_eval", 100), seed=1)
        assert result.algorithm.evaluator.n_eval == problem.calls
        assert problem.calls < 100 + 20 + 3 * 10

    def test_constraints_are_met(self) -> None:
        result = minimize(GridProblem(7, max_triangles=30), nsga2_v1(20), ("n_gen", 15), seed=1)
        assert result.F[:, 1].max() <= 30

    def test_an_archive_receives_the_candidates_of_the_crossover_too(self) -> None:
        problem = GridProblem(5)
        algorithm = nsga2_v2(20, archive=MultiObjectiveArchive(duplicate_elimination=PackedDuplicates()))
        seen: list[np.ndarray] = []
        evaluator = Evaluator(callback=lambda pop: seen.append(pop.get("F")))
        result = minimize(problem, algorithm, ("n_gen", 6), seed=1, evaluator=evaluator)
        best = NonDominatedSorting().do(np.concatenate(seen), only_non_dominated_front=True)
        every = {tuple(row) for row in np.concatenate(seen)[best].tolist()}
        assert {tuple(row) for row in result.archive.get("F").tolist()} == every
