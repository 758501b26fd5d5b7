"""The weighted sum, as a search and as a problem."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from mating import CrossedWith
from numpy.testing import assert_allclose, assert_array_equal
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.callback import Callback
from pymoo.optimize import minimize
from stand_in_problem import GridProblem, front_of

from meshsimp_pymoo import MeshProblem, fujiwara_sawai, huang_ho, weighted_ga_v1, weighted_ga_v2
from meshsimp_pymoo.search import weighted
from meshsimp_pymoo.search.operators import OAX, OPERATORS, PackedDuplicates, SubsetUniformCrossover
from meshsimp_pymoo.search.paper import paper_operators
from meshsimp_pymoo.search.weighted import WeightedSum, weighted_sum

Make = Callable[..., Any]


@pytest.mark.parametrize("make", [weighted_ga_v1, weighted_ga_v2])
@pytest.mark.parametrize("w", [0.0, 0.004, 0.02, 1.0])
def test_the_weighted_ga_finds_the_best_weighted_sum(make: Make, w: float) -> None:
    problem = GridProblem(4)
    result = minimize(problem, make(w, pop_size=40), ("n_gen", 30), seed=1)
    assert_allclose(weighted_sum(result.F, w), [weighted_sum(front_of(problem), w).min()])


class EffectsOf(OAX):
    """Note what the main effects would be computed on."""

    seen: list[Any]

    def _do(self, problem: Any, X: np.ndarray, *args: Any, **kwargs: Any) -> np.ndarray:
        EffectsOf.seen.append((self.score or kwargs["score"])(np.array([[8.0, 2.0]])).tolist())
        return super()._do(problem, X, *args, **kwargs)


@pytest.mark.parametrize(
    ("effects", "value"), [({}, 5.0), ({"effects": "weighted_sum"}, 5.0), ({"effects": "error"}, 8.0)]
)
def test_main_effects_are_on_equation_8_or_by_the_text_on_equation_4(
    effects: dict[str, str], value: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    EffectsOf.seen = []
    monkeypatch.setattr(weighted, "OAX", EffectsOf)
    minimize(GridProblem(5), weighted_ga_v2(0.5, 10, **effects), ("n_gen", 3), seed=1)
    assert EffectsOf.seen == [[value]] * len(EffectsOf.seen)
    assert EffectsOf.seen


def test_effects_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match=r"effects = 'eq4' is unknown; choose one of weighted_sum, error"):
        weighted_ga_v2(0.5, effects="eq4")
    with pytest.raises(ValueError, match="is for the preset's own crossover; leave one of the two out"):
        weighted_ga_v2(0.5, effects="error", crossover=OAX())
    problem = WeightedSum(GridProblem(5), 0.5)
    with pytest.raises(ValueError, match="give the problem itself, not a WeightedSum of it"):
        minimize(problem, weighted_ga_v2(0.5, 10, effects="error"), ("n_gen", 3), seed=1)


@pytest.mark.parametrize("make", [fujiwara_sawai, huang_ho])
@pytest.mark.parametrize("size", [12, 0.25])
def test_at_one_size_everybody_keeps_it_and_the_error_falls(make: Make, size: float) -> None:
    problem = MeshProblem("peaks:7", n_threads=1)
    sizes: list[int] = []
    errors: list[float] = []

    def note(algorithm: Any) -> None:
        sizes.extend(algorithm.pop.get("X").sum(axis=1).tolist())
        errors.append(algorithm.opt.get("F")[0, 0])

    result = minimize(problem, make(size, 20), ("n_gen", 12), seed=1, callback=note)
    assert set(sizes) == {12}
    assert result.X.sum() == 12
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.8 * errors[0]
    assert errors[-1] == min(result.pop.get("F")[:, 0])


class BestSoFar(Callback):
    """Note the best weighted sum of each generation's population and of everything evaluated."""

    def __init__(self) -> None:
        super().__init__()
        self.best: list[float] = []
        self.new: list[int] = []

    def notify(self, algorithm: Any) -> None:
        self.best.append(algorithm.score(algorithm.pop).min())
        self.new.append(sum(individual.get("n_gen") == algorithm.n_gen for individual in algorithm.pop))
        assert algorithm.score(algorithm.opt)[0] == self.best[-1]


class TestWeightedGA:
    @pytest.mark.parametrize("make", [weighted_ga_v1, weighted_ga_v2])
    def test_the_best_survives_and_the_others_make_room(self, make: Make) -> None:
        seen = BestSoFar()
        minimize(GridProblem(8), make(0.1, 30), ("n_gen", 15), seed=1, callback=seen)
        assert_array_equal(seen.best, np.minimum.accumulate(seen.best))
        assert seen.best[-1] < seen.best[0]
        assert min(seen.new) >= 29

    def test_with_a_full_elite_it_is_plus_selection(self) -> None:
        seen = BestSoFar()
        minimize(GridProblem(8), weighted_ga_v1(0.1, 30, n_elite=30), ("n_gen", 15), seed=1, callback=seen)
        assert min(seen.new) < 20

    def test_a_wrapped_problem_gives_the_same_run(self) -> None:
        problem = GridProblem(6)
        for make in (weighted_ga_v1, weighted_ga_v2):
            plain = minimize(problem, make(0.3, 20), ("n_gen", 8), seed=1)
            wrapped = minimize(WeightedSum(problem, 0.3), make(0.3, 20), ("n_gen", 8), seed=1)
            assert_array_equal(wrapped.X, plain.X[0])
            assert_allclose(wrapped.F, weighted_sum(plain.F, 0.3))
            assert_array_equal(np.column_stack(wrapped.opt.get("error", "triangles")), plain.F)

    def test_the_evaluating_crossover_works_on_the_weighted_sum(self) -> None:
        # With all weight on the triangles, the first child takes the emptier parent's segment everywhere.
        crossover = CrossedWith("L4", prob=1.0)
        minimize(GridProblem(8), weighted_ga_v1(0.0, 20, crossover=crossover), ("n_gen", 2), seed=1)
        assert_array_equal(CrossedWith.score_seen(np.array([[8.0, 4.0]])), [4.0])
        minimize(GridProblem(8), weighted_ga_v2(0.25, 20, crossover=crossover), ("n_gen", 2), seed=1)
        assert_array_equal(CrossedWith.score_seen(np.array([[8.0, 4.0]])), [5.0])

    def test_solutions_that_violate_a_constraint_come_last(self) -> None:
        result = minimize(GridProblem(7, max_triangles=30), weighted_ga_v1(1.0, 20), ("n_gen", 20), seed=1)
        assert result.F[0, 1] <= 30

    def test_what_it_cannot_do_is_refused(self) -> None:
        with pytest.raises(ValueError, match=r"w = 1\.1 is not a probability"):
            weighted_ga_v1(1.1)
        with pytest.raises(ValueError, match=r"n_elite = 0 is not in 1 \.\.\. pop_size = 10"):
            weighted_ga_v1(0.5, 10, n_elite=0)
        with pytest.raises(ValueError, match=r"weighted by w = 0\.2, the algorithm by w = 0\.5"):
            minimize(WeightedSum(GridProblem(5), 0.2), weighted_ga_v1(0.5), ("n_gen", 2), seed=1)


class TestWeightedSum:
    def test_it_weighs_and_keeps_both_objectives_and_all_other_numbers(self) -> None:
        problem = GridProblem(5, max_triangles=30)
        X = np.random.default_rng(1).random((6, 25)) < 0.5
        out = WeightedSum(problem, 0.3).evaluate(X, return_values_of=["F", "G"], return_as_dictionary=True)
        inner = problem.evaluate(X, return_values_of=["F", "G"], return_as_dictionary=True)
        assert_allclose(out["F"][:, 0], 0.3 * inner["F"][:, 0] + 0.7 * inner["F"][:, 1])
        assert_array_equal(np.column_stack([out["error"], out["triangles"]]), inner["F"])
        assert_array_equal(out["G"], inner["G"])
        assert_array_equal(out["vertices"], (X | problem.pinned).sum(axis=1))

    def test_it_can_be_pickled_and_copied(self) -> None:
        wrapped = WeightedSum(GridProblem(5), 0.3)
        X = np.random.default_rng(1).random((6, 25)) < 0.5
        for copied in (pickle.loads(pickle.dumps(wrapped)), copy.deepcopy(wrapped)):
            assert_array_equal(copied.evaluate(X), wrapped.evaluate(X))

    def test_pymoos_own_ga_works_on_it_with_the_evaluating_crossover(self) -> None:
        problem = GridProblem(4)
        algorithm = GA(20, crossover=OAX(), eliminate_duplicates=PackedDuplicates(), **paper_operators())
        result = minimize(WeightedSum(problem, 0.004), algorithm, ("n_gen", 40), seed=1)
        assert result.algorithm.evaluator.n_eval == problem.calls
        assert_allclose(result.F, [weighted_sum(front_of(problem), 0.004).min()])

    @pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, names in OPERATORS.items() for name in names])
    def test_every_operator_works_in_a_ga_on_it_as_on_the_problem(self, kind: str, name: str) -> None:
        problem = MeshProblem("face:60", regions=4, n_threads=1)
        argument = {"duplicates": "eliminate_duplicates"}.get(kind, kind)
        usual = {"crossover": SubsetUniformCrossover(), "eliminate_duplicates": PackedDuplicates()} | paper_operators()
        found = [
            minimize(searched, make(8, **(usual | {argument: OPERATORS[kind][name]()})), ("n_gen", 3), seed=1)
            for searched, make in [(WeightedSum(problem, 0.01), GA), (problem, partial(weighted_ga_v1, 0.01))]
        ]
        assert found[0].X.dtype == bool
        for result in found:
            assert result.algorithm.evaluator.n_eval >= 16
        assert_allclose(found[0].F, weighted_sum(problem.evaluate(found[0].X[None]), 0.01))

    def test_all_attributes_of_the_inner_problem_are_its_own(self) -> None:
        problem = MeshProblem("roof:5", regions=3, n_threads=1)
        wrapped = WeightedSum(problem, 0.5)
        for copied in (wrapped, copy.deepcopy(wrapped), pickle.loads(pickle.dumps(wrapped))):
            assert (copied.n_obj, copied.regions, copied.objectives) == (1, 3, ("error", "triangles"))
            assert_array_equal(copied.pinned, problem.pinned)
            assert copied.mesh(copied.pinned).faces.shape == (2, 3)
        assert wrapped.surface is problem.surface
        assert wrapped.model is problem.model
        for name in ("no_such_thing", "_memo", "__len__"):
            with pytest.raises(AttributeError, match=f"object has no attribute '{name}'"):
                getattr(wrapped, name)
        assert not hasattr(WeightedSum.__new__(WeightedSum), "surface")

    def test_only_two_objectives_can_be_weighed(self) -> None:
        with pytest.raises(ValueError, match="two objectives, the problem has 1"):
            WeightedSum(WeightedSum(GridProblem(5), 0.5), 0.5)
        with pytest.raises(ValueError, match="w = 7 is not a probability"):
            WeightedSum(GridProblem(5), 7)
