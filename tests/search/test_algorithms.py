"""The presets: what they find, what they cost, and that they behave as pymoo algorithms should."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2, binary_tournament
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.callback import Callback
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population
from pymoo.optimize import minimize
from pymoo.util.archive import MultiObjectiveArchive
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting
from stand_in_problem import GridProblem

from meshsimp_pymoo import MeshProblem, moead, nsga2_v1, nsga2_v2, weighted_ga_v1, weighted_ga_v2
from meshsimp_pymoo.search.operators import OAX, NeighbourShift, PackedDuplicates, PinnedCorners, RandomSubset
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.search.selection import crowded_tournament
from meshsimp_pymoo.search.weighted import WeightedSum, weighted_sum

Make = Callable[..., Any]
OPERATORS = {"sampling": RandomSubset(), "mutation": NeighbourShift(), "repair": PinnedCorners()}


def preset(name: str, pop_size: int = 20, **kwargs: Any) -> Any:
    weight = [0.1] if name.startswith("weighted") else []
    return PRESETS[name].function(*weight, pop_size=pop_size, **kwargs)


def front_of(problem: GridProblem) -> np.ndarray:
    """The true front: keep the heaviest vertices, any number of them."""
    weights = np.sort(problem.weights[~problem.pinned])
    n_dropped = np.arange(len(weights) + 1)
    error = np.concatenate([[0.0], np.cumsum(weights)])
    return np.column_stack([error, 2.0 * (problem.n_var - n_dropped) - 6])


class CountedMesh(MeshProblem):
    """A real mesh problem that counts its evaluations, for presets that search on the mesh itself."""

    def __init__(self) -> None:
        self.calls = 0
        super().__init__("peaks:7")

    def evaluate_subsets(self, X: Any, *, n_threads: int = 1) -> Any:
        self.calls += len(X)
        return super().evaluate_subsets(X, n_threads=n_threads)


def problem_for(name: str) -> Any:
    return CountedMesh() if name == "memetic" else GridProblem(7)


@pytest.mark.parametrize("name", PRESETS)
class TestEveryPreset:
    def test_results_are_solutions_of_the_problem_with_both_objectives(self, name: str) -> None:
        problem = problem_for(name)
        result = minimize(problem, preset(name), ("n_gen", 8), seed=1)
        assert result.X.dtype == bool
        assert result.X.shape == (len(result.F), 49)
        assert result.X[:, problem.pinned].all()
        assert_array_equal(problem.evaluate(result.X), result.F)
        assert len(np.unique(result.X, axis=0)) == len(result.X)
        assert len(NonDominatedSorting().do(result.F, only_non_dominated_front=True)) == len(result.F)

    def test_every_evaluation_is_counted(self, name: str) -> None:
        problem = problem_for(name)
        result = minimize(problem, preset(name), ("n_gen", 8), seed=1)
        assert result.algorithm.evaluator.n_eval == problem.calls

    def test_same_seed_same_bytes(self, name: str) -> None:
        runs = [minimize(problem_for(name), preset(name), ("n_gen", 6), seed=seed) for seed in (1, 1, 2)]
        pops = [run.pop.get("X").tobytes() for run in runs]
        assert runs[0].X.tobytes() == runs[1].X.tobytes()
        assert pops[0] == pops[1]
        assert pops[0] != pops[2]

    def test_without_a_termination_it_runs_the_fifty_generations_of_the_paper_or_one_sweep(self, name: str) -> None:
        expected = 2 if name == "memetic" else 50
        assert preset(name, pop_size=6).termination == ("n_gen", expected)
        result = minimize(problem_for(name), preset(name, pop_size=6), seed=1)
        assert result.algorithm.n_gen - 1 == expected
        assert preset(name, termination=("n_gen", 3)).termination == ("n_gen", 3)

    def test_ask_and_tell_gives_the_same_run(self, name: str) -> None:
        problem = problem_for(name)
        algorithm = preset(name)
        algorithm.setup(problem, termination=("n_gen", 5), seed=1)
        while algorithm.has_next():
            infills = algorithm.ask()
            algorithm.evaluator.eval(problem, infills)
            algorithm.tell(infills=infills)
        expected = minimize(problem, preset(name), ("n_gen", 5), seed=1)
        assert_array_equal(algorithm.result().X, expected.X)

    def test_a_run_pickled_at_any_time_goes_on_as_if_it_had_not_been(self, name: str) -> None:
        problem = problem_for(name)
        algorithm = preset(name)
        algorithm.setup(problem, termination=("n_gen", 5), seed=1)
        for steps in (1, 1, 3):  # MOEA/D: in the middle of a generation
            for _ in range(steps):
                if algorithm.has_next():
                    algorithm.next()
            algorithm = pickle.loads(pickle.dumps(algorithm))
        expected = minimize(problem, preset(name), ("n_gen", 5), seed=1)
        assert_array_equal(algorithm.run().X, expected.X)
        assert algorithm.evaluator.n_eval == expected.algorithm.evaluator.n_eval

    def test_history_and_printing_work(self, name: str, capsys: pytest.CaptureFixture[str]) -> None:
        result = minimize(problem_for(name), preset(name), ("n_gen", 4), seed=1, save_history=True, verbose=True)
        assert [entry.n_gen for entry in result.history] == [1, 2, 3, 4]
        assert result.history[0].pop[0] is not result.history[3].pop[0]
        assert "n_gen" in capsys.readouterr().out

    def test_the_preset_itself_stays_unused(self, name: str) -> None:
        algorithm = preset(name)
        before = pickle.dumps(algorithm)
        minimize(problem_for(name), algorithm, ("n_gen", 3), seed=1)
        assert pickle.dumps(algorithm) == before

    def test_operators_can_be_replaced_by_keyword(self, name: str) -> None:
        mutation = NeighbourShift(0.3, along="mesh")
        if name == "memetic":  # one step does what operators do elsewhere
            with pytest.raises(TypeError, match="give mating="):
                preset(name, mutation=mutation)
            return
        assert preset(name, mutation=mutation).mating.mutation is mutation

    def test_an_array_can_be_the_first_population(self, name: str) -> None:
        problem = problem_for(name)
        X = (np.random.default_rng(3).random((20, 49)) < 0.5) | problem.pinned
        algorithm = preset(name, sampling=X)
        algorithm.setup(problem, seed=1)
        assert_array_equal(algorithm.ask().get("X"), X)


@pytest.mark.parametrize("make", [nsga2_v1, nsga2_v2])
def test_nsga2_finds_the_whole_front_of_a_small_model(make: Make) -> None:
    problem = GridProblem(4)
    result = minimize(problem, make(pop_size=60), ("n_gen", 60), seed=1)
    expected = front_of(problem)
    assert_array_equal(np.unique(result.F, axis=0), np.unique(expected, axis=0))


def test_moead_finds_the_supported_front_of_a_small_model_when_normalised() -> None:
    problem = GridProblem(4)
    result = minimize(problem, moead(60, normalised=True), ("n_gen", 60), seed=1)
    truth = {tuple(row) for row in front_of(problem).tolist()}
    found = {tuple(row) for row in result.F.tolist()}
    assert len(found & truth) >= 10
    assert len(found - truth) <= 2


@pytest.mark.parametrize("make", [weighted_ga_v1, weighted_ga_v2])
@pytest.mark.parametrize("w", [0.0, 0.004, 0.02, 1.0])
def test_the_weighted_ga_finds_the_best_weighted_sum(make: Make, w: float) -> None:
    problem = GridProblem(4)
    result = minimize(problem, make(w, pop_size=40), ("n_gen", 60), seed=1)
    assert_allclose(weighted_sum(result.F, w), [weighted_sum(front_of(problem), w).min()])


class TestNSGA2:
    def test_v2_evaluates_three_candidates_for_each_crossing_pair(self) -> None:
        v1, v2 = (minimize(GridProblem(10), make(), ("n_gen", 11), seed=1) for make in (nsga2_v1, nsga2_v2))
        assert v1.algorithm.evaluator.n_eval == 1100
        extra = v2.algorithm.evaluator.n_eval - 1100
        assert (
            0.9 * 1200 < extra < 1.05 * 1200
        )  # 10 generations of 50 pairs, 0.8 of them crossing; some are twins

    def test_refilling_duplicates_does_not_exceed_a_budget_by_more_than_one_generation(self) -> None:
        problem = GridProblem(3)  # 32 solutions in all
        result = minimize(problem, NSGA2(20, crossover=OAX(prob=1.0), **OPERATORS), ("n_eval", 100), seed=1)
        assert result.algorithm.evaluator.n_eval == problem.calls
        assert problem.calls < 100 + 20 + 3 * 10

    @pytest.mark.parametrize("max_triangles", [None, 60])
    def test_the_tournament_decides_as_pymoo_does(self, max_triangles: int | None) -> None:
        problem = GridProblem(7, max_triangles=max_triangles)
        algorithm = nsga2_v1(40)
        algorithm.setup(problem, termination=("n_gen", 9), seed=1)
        for _ in range(2):
            algorithm.next()
        P = np.random.default_rng(1).integers(40, size=(400, 2))
        sides = [P, P[:, ::-1]]
        ours = [
            crowded_tournament(algorithm.pop, p, random_state=np.random.default_rng(2))[:, 0] for p in sides
        ]
        theirs = [binary_tournament(algorithm.pop, p, algorithm)[:, 0] for p in sides]
        decided = (ours[0] == ours[1]) & (theirs[0] == theirs[1])
        assert decided.sum() > 300
        assert_array_equal(ours[0][decided], theirs[0][decided])
        assert np.all((ours[0] == P[:, 0]) | (ours[0] == P[:, 1]))

    def test_undecided_tournaments_are_drawn_by_lot(self) -> None:
        pop = Population.new(
            "X", np.ones((2, 4), dtype=bool), "F", np.ones((2, 2)), "crowding", [np.inf, np.inf]
        )
        P = np.repeat([[0, 1]], 2000, axis=0)
        winners = crowded_tournament(pop, P, random_state=np.random.default_rng(1))
        assert abs(winners.mean() - 0.5) < 4 * 0.5 / np.sqrt(2000)

    def test_solutions_that_violate_equally_are_drawn_by_lot_whatever_their_objectives(self) -> None:
        F = np.array([[1.0, 1.0], [2.0, 2.0]])
        pop = Population.new("X", np.ones((2, 4), dtype=bool), "F", F, "CV", np.ones((2, 1)))
        P = np.repeat([[0, 1]], 2000, axis=0)
        winners = crowded_tournament(pop, P, random_state=np.random.default_rng(1))
        assert abs(winners.mean() - 0.5) < 4 * 0.5 / np.sqrt(2000)

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
                    max(
                        w * abs(f - z)
                        for w, f, z in zip(algorithm.ref_dirs[j], x.F, algorithm.ideal, strict=True)
                    )
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
                problem, MOEAD(directions, crossover=OAX(n_offsprings=1), **OPERATORS), ("n_gen", 3), seed=1
            )
        problem.calls = 0
        evaluator = Evaluator()
        crossover = OAX(n_offsprings=1, evaluator=evaluator)
        algorithm = MOEAD(directions, crossover=crossover, evaluator=evaluator, **OPERATORS)
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


class CrossedWith(OAX):
    """Note the score that the algorithm passes."""

    score_seen: Callable[[np.ndarray], np.ndarray]

    def _do(self, problem: Any, X: np.ndarray, *args: Any, **kwargs: Any) -> np.ndarray:
        CrossedWith.score_seen = staticmethod(kwargs["score"])
        return super()._do(problem, X, *args, **kwargs)


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
        algorithm = GA(20, crossover=OAX(), eliminate_duplicates=PackedDuplicates(), **OPERATORS)
        result = minimize(WeightedSum(problem, 0.004), algorithm, ("n_gen", 40), seed=1)
        assert result.algorithm.evaluator.n_eval == problem.calls
        assert_allclose(result.F, [weighted_sum(front_of(problem), 0.004).min()])

    def test_only_two_objectives_can_be_weighed(self) -> None:
        with pytest.raises(ValueError, match="two objectives, the problem has 1"):
            WeightedSum(WeightedSum(GridProblem(5), 0.5), 0.5)
        with pytest.raises(ValueError, match="w = 7 is not a probability"):
            WeightedSum(GridProblem(5), 7)
