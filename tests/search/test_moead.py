"""MOEA/D: what it finds, and that it is Zhang and Li's: step by step beside a slow twin."""

from __future__ import annotations

import pickle
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mating import CrossedWith
from numpy.testing import assert_allclose, assert_array_equal
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.optimize import minimize
from pymoo.util.archive import Archive, MultiObjectiveArchive
from stand_in_problem import GridProblem, front_of

from meshsimp_pymoo import MeshProblem, moead
from meshsimp_pymoo.search.operators import OAX, NeighbourShift, PinnedCorners, RandomSubset, SubsetUniformCrossover
from meshsimp_pymoo.search.paper import paper_operators
from meshsimp_pymoo.search.weighted import WeightedSum


def test_moead_finds_the_supported_front_of_a_small_model_when_normalised() -> None:
    problem = GridProblem(4)
    result = minimize(problem, moead(60, normalised=True), ("n_gen", 60), seed=1)
    truth = {tuple(row) for row in front_of(problem).tolist()}
    found = {tuple(row) for row in result.F.tolist()}
    assert len(found & truth) >= 10
    assert len(found - truth) <= 2


def slow_twin(
    problem: Any, seed: int, size: int, generations: int, *, width: int = 20, normalised: bool = False
) -> tuple[list[list[bool]], list[list[float]], int]:
    """Run MOEA/D in plain Python, loops and lists; return the chromosomes, their objectives, the replacements made.

    Only the random numbers come from NumPy, drawn in the order of the algorithm: for a whole generation, first the
    order of the sub-problems and their parents, then who takes which gene, who crosses, where vertices move.
    """
    rng = np.random.default_rng(seed)
    N, pinned = problem.n_var, problem.pinned.tolist()

    def values(kept: list[bool]) -> list[float]:
        return [float(f) for f in problem.evaluate(np.array(kept))]

    X = RandomSubset()._do(problem, size, random_state=rng).tolist()
    F = [values(kept) for kept in X]
    weights = [[i / (size - 1), 1 - i / (size - 1)] for i in range(size)]
    near = [sorted(range(size), key=lambda j: abs(i - j))[:width] for i in range(size)]
    z = [min(f[j] for f in F) for j in range(2)]
    replaced = 0
    for _ in range(generations - 1):
        order = rng.permutation(size).tolist()
        rng.random(size)  # who mates with neighbours: all
        one, other = rng.integers(np.full(size, width)).tolist(), rng.integers(np.full(size, width - 1)).tolist()
        scale = [max(f[j] for f in F) - z[j] or 1.0 for j in range(2)] if normalised else [1.0, 1.0]
        n_bytes = -(-N // 8)
        drawn = rng.bytes(size * n_bytes)
        genes = [[bool(drawn[k * n_bytes + i // 8] >> (7 - i % 8) & 1) for i in range(N)] for k in range(size)]
        stays = [u >= 0.8 for u in rng.random(size).tolist()]
        whole = iter(rng.integers(2, size=(sum(stays), 1), dtype=np.uint8).ravel().tolist())
        genes = [[bool(next(whole))] * N if s else g for s, g in zip(stays, genes, strict=True)]
        rate, places, at = 1 / N, [], -1
        count = int(size * N * rate + 4 * np.sqrt(size * N * rate)) + 8
        while at < size * N:
            for gap in rng.geometric(rate, size=count).tolist():
                at += gap
                places.append(at)
        places = [place for place in places if place < size * N]
        steps = [-1 if u < 0.5 else 1 for u in rng.random(len(places)).tolist()]
        rng.random(size)  # whether a child is mutated at all: with probability 1
        for k in range(size):
            i = order[k]
            a, b = near[i][one[k]], near[i][other[k] + (other[k] >= one[k])]
            child = [y if second else x for x, y, second in zip(X[a], X[b], genes[k], strict=True)]
            before, taken = list(child), set()
            for place, step in zip(places, steps, strict=True):
                row, vertex = divmod(place, N)
                target = vertex + step
                target = 1 if target < 0 else N - 2 if target == N else target
                if row == k and before[vertex] and not pinned[vertex] and not (before[target] or pinned[target]):
                    if target not in taken:
                        child[vertex], child[target] = False, True
                    taken.add(target)
            child = [c or p for c, p in zip(child, pinned, strict=True)]
            f = values(child)
            z = [min(z[j], f[j]) for j in range(2)]

            def g(f: list[float], i: int) -> float:
                return max(abs(f[j] - z[j]) * (weights[i][j] / scale[j]) for j in range(2))  # noqa: B023

            for j in near[i]:
                if g(f, j) <= g(F[j], j):
                    X[j], F[j] = child, f
                    replaced += 1
    return X, F, replaced


class TestItsTwin:
    @pytest.mark.parametrize("normalised", [False, True])
    @pytest.mark.parametrize(("model", "seed"), [("grid", 1), ("grid", 2), ("mesh", 3)])
    def test_a_run_is_that_of_a_slow_twin_to_the_last_bit(self, model: str, seed: int, normalised: bool) -> None:
        problem: Any = GridProblem(6) if model == "grid" else MeshProblem("peaks:7", n_threads=1)
        result = minimize(problem, moead(24, normalised=normalised), ("n_gen", 7), seed=seed)
        X, F, replaced = slow_twin(problem, seed, 24, 7, normalised=normalised)
        assert replaced > 200  # of 144 children's
        assert result.pop.get("X").tolist() == X
        assert result.pop.get("F").tolist() == F


class Shown(Evaluator):
    """An evaluator of somebody's own, which counts what it is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.shown = 0

    def eval(self, problem: Any, pop: Any, **kwargs: Any) -> Any:
        self.shown += 1 if isinstance(pop, Individual) else len(pop)
        return super().eval(problem, pop, **kwargs)


def asked_and_told(algorithm: Any) -> Any:
    while algorithm.has_next():
        one = algorithm.ask()
        algorithm.evaluator.eval(algorithm.problem, one, algorithm=algorithm)
        algorithm.tell(infills=one)
    return algorithm


def gone_through(algorithm: Any) -> Any:
    while algorithm.has_next():
        algorithm.next()
    return algorithm


def half_asked(algorithm: Any) -> Any:
    """Some children by hand, in the middle of a generation pickled, the rest by ``next``."""
    algorithm.next()
    for _ in range(20 + 7):
        one = algorithm.ask()
        algorithm.evaluator.eval(algorithm.problem, one, algorithm=algorithm)
        algorithm.tell(infills=one)
    return gone_through(pickle.loads(pickle.dumps(algorithm)))


class TestEveryWayToRunIt:
    @pytest.mark.parametrize(
        "arguments",
        [
            {},
            {"normalised": True, "prob_neighbor_mating": 0.5},
            {"mutation": NeighbourShift(0.1, along="mesh", prob=0.6)},
            {"crossover": SubsetUniformCrossover(0.8, n_offsprings=2)},  # asked child by child
            {"crossover": OAX(n_offsprings=1)},
        ],
        ids=lambda given: ", ".join(given) or "as it is",
    )
    def test_it_finds_the_same(self, arguments: dict[str, Any]) -> None:
        problem = GridProblem(6)

        def begun(**more: Any) -> Any:
            algorithm = moead(20, n_neighbors=6, **arguments, **more)
            return algorithm.setup(problem, termination=("n_gen", 5), seed=1)

        def found(algorithm: Any) -> Any:
            facts = [algorithm.pop.get(name).tolist() for name in ("X", "F", "n_gen", "n_iter", "vertices")]
            return facts, algorithm.n_gen, algorithm.evaluator.n_eval, algorithm.random_state.bit_generator.state

        expected = found(gone_through(begun()))
        assert found(asked_and_told(begun())) == expected
        assert found(half_asked(begun())) == expected
        seen: list[int] = []
        problem.calls = 0
        assert found(gone_through(begun(evaluator=Evaluator(callback=lambda pop: seen.append(len(pop)))))) == expected
        assert sum(seen) == expected[2] == problem.calls
        own = Shown()
        assert found(gone_through(begun(evaluator=own))) == expected
        assert own.shown == expected[2]
        assert found(gone_through(begun(archive=MultiObjectiveArchive()))) == expected

    def test_a_step_is_a_generation_and_a_callback_is_called_once_in_it(self) -> None:
        seen: list[tuple[int, int]] = []
        minimize(
            GridProblem(6),
            moead(20),
            ("n_gen", 4),
            seed=1,
            callback=lambda algorithm: seen.append((algorithm.n_gen, algorithm.evaluator.n_eval)),
        )
        assert seen == [(1, 20), (2, 40), (3, 60), (4, 80)]

    def test_every_child_is_shown_to_an_archive_and_knows_its_generation(self) -> None:
        shown: list[Any] = []

        class Everything(Archive):
            def add(self, sols: Any) -> Archive:
                shown.extend([sols] if isinstance(sols, Individual) else sols)
                return self

        minimize(GridProblem(6), moead(20, archive=Everything()), ("n_gen", 4), seed=1)
        assert [one.get("n_gen") for one in shown] == [n for n in (1, 2, 3, 4) for _ in range(20)]

    def test_children_have_the_pins_that_their_parents_lack(self) -> None:
        problem = GridProblem(6)
        X = (np.random.default_rng(3).random((20, 36)) < 0.5) & ~problem.pinned
        known = Evaluator().eval(problem, Population.new(X=X))  # evaluated, hence not repaired
        pop = minimize(problem, moead(20, sampling=known), ("n_gen", 8), seed=1).pop
        children = pop[pop.get("n_gen") > 1]
        assert len(children) > 10
        assert children.get("X")[:, problem.pinned].all()

    @pytest.mark.parametrize("kind", ["crossover", "mutation", "repair", "attached"])
    def test_an_operator_of_ones_own_is_asked(self, kind: str) -> None:
        asked = []

        class OwnCrossover(SubsetUniformCrossover):
            def _do(self, *args: Any, **kwargs: Any) -> Any:
                asked.append("crossover")
                return super()._do(*args, **kwargs)

        class OwnShift(NeighbourShift):
            def _do(self, *args: Any, **kwargs: Any) -> Any:
                asked.append("mutation")
                return super()._do(*args, **kwargs)

        class OwnRepair(PinnedCorners):
            def _do(self, *args: Any, **kwargs: Any) -> Any:
                asked.append(kind)
                return super()._do(*args, **kwargs)

        mutation = NeighbourShift()
        mutation.repair = OwnRepair()
        own: dict[str, Any] = {
            "crossover": {"crossover": OwnCrossover(1.0, n_offsprings=1)},
            "mutation": {"mutation": OwnShift()},
            "repair": {"repair": OwnRepair()},
            "attached": {"mutation": mutation},
        }[kind]
        minimize(GridProblem(6), moead(20, **own), ("n_gen", 3), seed=1)
        assert asked.count(kind) >= 40


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

    def test_the_scale_is_the_range_from_z_to_the_worst_of_the_population_anew_in_each_generation(self) -> None:
        problem = GridProblem(6)
        X = (np.random.default_rng(3).random((20, 36)) < 0.5) | problem.pinned
        algorithm = moead(20, normalised=True, sampling=X)
        algorithm.setup(problem, termination=("n_gen", 9), seed=1)
        algorithm.next()
        scales = []
        for _ in range(4):
            expected = algorithm.pop.get("F").max(axis=0) - algorithm.ideal
            algorithm.next()
            assert_array_equal(algorithm.scale, expected)
            scales.append(tuple(expected))
        assert scales[0] == tuple(np.ptp(problem.evaluate(X), axis=0))
        assert len(set(scales)) > 1

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
        assert 120 + 50 < n_eval < 120 + 300  # 100 children, at most 3 candidates each; some rows are known

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


@pytest.mark.slow
def test_its_time_is_at_most_1_3_times_that_of_nsga2_and_what_its_kernel_takes_longer() -> None:
    benchmark = runpy.run_path(str(Path(__file__).parents[1] / "benchmarks" / "moead.py"))
    found = benchmark["measured"]("face:922")
    assert found["ratio without the kernel's surplus"] <= benchmark["MOST"], found
