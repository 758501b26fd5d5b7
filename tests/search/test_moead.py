"""MOEA/D: what it finds, and that it is Zhang and Li's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mating import CrossedWith
from numpy.testing import assert_allclose, assert_array_equal
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.core.evaluator import Evaluator
from pymoo.optimize import minimize
from stand_in_problem import GridProblem, front_of

from meshsimp_pymoo import moead
from meshsimp_pymoo.search.operators import OAX
from meshsimp_pymoo.search.paper import paper_operators
from meshsimp_pymoo.search.weighted import WeightedSum


def test_moead_finds_the_supported_front_of_a_small_model_when_normalised() -> None:
    problem = GridProblem(4)
    result = minimize(problem, moead(60, normalised=True), ("n_gen", 60), seed=1)
    truth = {tuple(row) for row in front_of(problem).tolist()}
    found = {tuple(row) for row in result.F.tolist()}
    assert len(found & truth) >= 10
    assert len(found - truth) <= 2


class TestMOEAD:
    def test_weights_and_neighbours_are_those_of_zhang_and_li(self) -> None:
        algorithm = moead(5, n_neighbors=3)
        algorithm.setup(GridProblem(5), seed=1)
        assert_allclose(algorithm.ref_dirs, [[0, 1], [0.25, 0.75], [0.5, 0.5], [0.75, 0.25], [1, 0]])
        neighbours = [sorted(row) for row in algorithm.neighbors.tolist()]
        assert neighbours == [[0, 1, 2], [0, 1, 2], [1, 2, 3], [2, 3, 4], [2, 3, 4]]

    def test_parents_are_two_different_neighbours_and_every_subproblem_is_served_once(self) -> None:
        algorithm = moead(30, n_neighbors=5)
        algorithm.setup(GridProblem(5), seed=1)
        algorithm.next()
        algorithm.next()
        assert_array_equal(np.sort(algorithm.order), np.arange(30))
        assert np.all(algorithm.parents[:, 0] != algorithm.parents[:, 1])
        for k, pair in zip(algorithm.order, algorithm.parents, strict=True):
            assert set(pair) <= set(algorithm.neighbors[k])

    def test_parents_come_from_everywhere_when_asked(self) -> None:
        algorithm = moead(30, n_neighbors=2, prob_neighbor_mating=0.0)
        algorithm.setup(GridProblem(5), seed=1)
        algorithm.next()
        algorithm.next()
        assert len(np.unique(algorithm.parents)) > 20

    def test_a_child_replaces_exactly_what_it_is_not_worse_than(self) -> None:
        problem = GridProblem(6)
        algorithm = moead(20, n_neighbors=7)
        algorithm.setup(problem, termination=("n_gen", 9), seed=1)
        for _ in range(60):
            before = algorithm.pop.copy() if algorithm.is_initialized else None
            child = algorithm.ask()
            algorithm.evaluator.eval(problem, child)
            position = algorithm.position
            algorithm.tell(infills=child)
            if before is None:
                continue
            k = algorithm.order[position]
            for j in range(20):
                g = [
                    max(w * abs(f - z) for w, f, z in zip(algorithm.ref_dirs[j], x.F, algorithm.ideal, strict=True))
                    for x in (before[j], child)
                ]
                replaced = j in algorithm.neighbors[k] and g[1] <= g[0]
                assert algorithm.pop[j] is (child if replaced else before[j])

    def test_z_is_the_best_value_of_each_objective_ever_seen(self) -> None:
        seen: list[np.ndarray] = []

        class Watched(GridProblem):
            def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
                super()._evaluate(x, out)
                seen.append(np.array(out["F"]))

        result = minimize(Watched(6), moead(20), ("n_gen", 5), seed=1)
        assert len(seen) == 100
        assert_array_equal(result.algorithm.ideal, np.min(seen, axis=0))

    @pytest.mark.parametrize("normalised", [True, False])
    def test_only_normalised_runs_are_indifferent_to_the_unit_of_the_error(self, normalised: bool) -> None:
        fine, coarse = GridProblem(6), GridProblem(6)
        coarse.weights = fine.weights / 1024  # a power of two: no rounding
        a, b = (minimize(p, moead(20, normalised=normalised), ("n_gen", 10), seed=1) for p in (fine, coarse))
        assert np.array_equal(a.pop.get("X"), b.pop.get("X")) is normalised

    def test_the_scale_is_the_range_of_the_initial_population(self) -> None:
        problem = GridProblem(6)
        X = (np.random.default_rng(3).random((20, 36)) < 0.5) | problem.pinned
        result = minimize(problem, moead(20, normalised=True, sampling=X), ("n_gen", 4), seed=1)
        assert_array_equal(result.algorithm.scale, np.ptp(problem.evaluate(X), axis=0))

    def test_an_objective_that_does_not_vary_is_left_unscaled(self) -> None:
        problem = GridProblem(5)
        problem.weights[:] = 0.0
        result = minimize(problem, moead(20, normalised=True), ("n_gen", 10), seed=1)
        assert_array_equal(result.F, [[0.0, 2.0]])

    @pytest.mark.parametrize("n_offsprings", [1, 2])
    def test_the_evaluating_crossover_works_and_is_counted(self, n_offsprings: int) -> None:
        problem = GridProblem(6)
        algorithm = moead(20, n_neighbors=4, normalised=True, crossover=OAX(n_offsprings=n_offsprings))
        result = minimize(problem, algorithm, ("n_gen", 6), seed=1, save_history=True)
        n_eval = result.algorithm.evaluator.n_eval
        assert n_eval == problem.calls
        assert 120 + 60 < n_eval < 120 + 300  # 100 children, at most 3 candidates each; some rows are known

    def test_the_evaluating_crossover_works_on_the_value_for_the_subproblem(self) -> None:
        problem = GridProblem(6)
        algorithm = moead(20, crossover=CrossedWith(prob=1.0, n_offsprings=1), normalised=True)
        algorithm.setup(problem, termination=("n_gen", 9), seed=1)
        for _ in range(12):
            algorithm.next()
        child = algorithm.ask()
        k, F = algorithm.order[algorithm.position], np.array([[5000.0, 30.0], [100.0, 60.0]])
        expected = np.max(algorithm.ref_dirs[k] * np.abs(F - algorithm.ideal) / algorithm.scale, axis=1)
        assert_allclose(CrossedWith.score_seen(F), expected)
        assert child.X.shape == (36,)

    def test_pymoos_own_moead_says_what_it_lacks_and_works_with_a_shared_evaluator(self) -> None:
        problem = GridProblem(6)
        directions = moead(20).ref_dirs
        with pytest.raises(RuntimeError, match="MOEAD does not"):
            minimize(
                problem, MOEAD(directions, crossover=OAX(n_offsprings=1), **paper_operators()), ("n_gen", 3), seed=1
            )
        problem.calls = 0
        evaluator = Evaluator()
        crossover = OAX(n_offsprings=1, evaluator=evaluator)
        algorithm = MOEAD(directions, crossover=crossover, evaluator=evaluator, **paper_operators())
        result = minimize(problem, algorithm, ("n_gen", 3), seed=1)
        assert result.algorithm.evaluator.n_eval == problem.calls > 60 + 5

    def test_what_it_cannot_do_is_refused(self) -> None:
        with pytest.raises(ValueError, match="takes no constraints; drop max_triangles="):
            minimize(GridProblem(5, max_triangles=20), moead(10), ("n_gen", 2), seed=1)
        with pytest.raises(ValueError, match="two objectives, the problem has 1"):
            minimize(WeightedSum(GridProblem(5), 0.5), moead(10), ("n_gen", 2), seed=1)
        with pytest.raises(ValueError, match="5 individuals for 10 sub-problems"):
            minimize(GridProblem(5), moead(10, sampling=np.ones((5, 25), dtype=bool)), ("n_gen", 2), seed=1)
        with pytest.raises(ValueError, match="pop_size = 1"):
            moead(1)
        with pytest.raises(ValueError, match="n_neighbors = 1"):
            moead(10, n_neighbors=1)
        with pytest.raises(ValueError, match=r"prob_neighbor_mating = 1\.5"):
            moead(10, prob_neighbor_mating=1.5)
