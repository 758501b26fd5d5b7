"""The presets: what their rows say, and that they behave as pymoo algorithms should."""

from __future__ import annotations

import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pymoo.core.algorithm import Algorithm
from pymoo.optimize import minimize
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting
from stand_in_problem import GridProblem

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.cli.parser import make_parser
from meshsimp_pymoo.errors import UsageError
from meshsimp_pymoo.search.operators import NeighbourShift
from meshsimp_pymoo.search.presets import PRESETS


def preset(name: str, pop_size: int = 20, **kwargs: Any) -> Any:
    required = [] if PRESETS[name].whole_front else [0.2]  # a weight, or a size as a share
    return PRESETS[name].function(*required, pop_size=pop_size, **kwargs)


class CountedMesh(MeshProblem):
    """A real mesh problem that counts its evaluations, for presets that search on the mesh itself."""

    def __init__(self) -> None:
        self.calls = 0
        super().__init__("peaks:7")

    def evaluate_subsets(self, X: Any, *, n_threads: int = 1) -> Any:
        self.calls += len(X)
        return super().evaluate_subsets(X, n_threads=n_threads)


def problem_for(name: str) -> Any:
    # the others search on the live triangulation
    return GridProblem(7) if PRESETS[name].is_the_papers else CountedMesh()


def test_the_table_is_light() -> None:
    code = (
        "import sys, meshsimp_pymoo.search.presets\n"
        "heavy = {'numpy', 'numba', 'pymoo'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", PRESETS)
class TestEveryRow:
    def test_its_function_has_its_name_and_gives_an_algorithm(self, name: str) -> None:
        assert PRESETS[name].function.__name__ == name
        assert isinstance(preset(name), Algorithm)

    def test_it_says_in_a_line_what_it_is(self, name: str) -> None:
        assert 10 < len(PRESETS[name].about) < 80
        assert "\n" not in PRESETS[name].about

    def test_the_shell_offers_it_if_it_gives_a_whole_front(self, name: str) -> None:
        words = ["simplify", "roof", "--algorithm", name]
        if PRESETS[name].whole_front:
            assert make_parser().parse_args(words).algorithm == name
        else:
            with pytest.raises(UsageError, match=f"invalid choice: '{name}'"):
                make_parser().parse_args(words)

    def test_it_takes_the_maximum(self, name: str) -> None:
        problem = MeshProblem("peaks:7", objectives=("max_error", "triangles"))
        result = minimize(problem, preset(name), ("n_gen", 2), seed=1)
        for kept, (error, triangles) in zip(result.X, result.F, strict=True):
            quality = problem.quality(kept)
            assert (quality.max_error, quality.triangles) == (error, triangles)


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
        expected = 2 if PRESETS[name].sweeps else 50
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
        for steps in (1, 1, 3):
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
