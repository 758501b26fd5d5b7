from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest
from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem, memetic, nsga2_v1
from meshsimp_pymoo.arrays import spread
from meshsimp_pymoo.compiling import store
from meshsimp_pymoo.search.budgets import WholeGenerations, compiling_left_out, stopping
from meshsimp_pymoo.search.local_search import relocate_all
from meshsimp_pymoo.search.memetic import between_the_rungs


@pytest.mark.parametrize("n", [0, 1, 2, 7, 64, 100])
def test_numbers_are_spread_as_far_as_they_go(n):
    order = spread(n)
    assert sorted(order) == list(range(n))
    first = sorted(order[: n // 2])
    assert max(np.diff(first), default=0) <= 4


def compiled(seconds):
    """Tell the listeners that something was compiled just now, and return how long it took."""
    for told in list(store._listeners):
        told(None, None)
    begun = time.perf_counter()
    time.sleep(seconds)
    took = time.perf_counter() - begun
    for told in list(store._listeners):
        told(None, took)
    return took


def test_the_clock_of_a_search_does_not_count_compiling():
    algorithm = SimpleNamespace(start_time=100.0)
    with compiling_left_out(algorithm):
        took = compiled(0.01)
    assert algorithm.start_time == 100.0 + took
    compiled(0.01)
    assert algorithm.start_time == 100.0 + took


def test_moves_stop_after_their_time_without_that_of_compiling():
    stop, begun = np.zeros(1, bool), time.perf_counter()
    with stopping(stop, 0.1):
        compiled(0.2)
        assert not stop[0]
        while not stop[0]:
            assert time.perf_counter() - begun < 5
            time.sleep(0.005)
    assert 0.25 < time.perf_counter() - begun < 5.0


def test_without_a_limit_nothing_stops():
    stop = np.zeros(1, bool)
    with stopping(stop, None):
        time.sleep(0.02)
    assert not stop[0]


def test_annealing_of_any_number_of_moves_ends_in_time():
    surface = MeshProblem("jacksboro:20").surface
    X = np.random.default_rng(1).random((4, surface.n_vertices)) < 0.3
    moves = np.array([10**9] * 4)
    relocate_all(surface, X, np.ones(4, int), np.random.default_rng(1))  # compiles
    begun = time.perf_counter()
    found = relocate_all(surface, X, moves, np.random.default_rng(1), seconds=0.2)
    assert time.perf_counter() - begun < 3.0
    assert found.shape == X.shape


def test_a_generation_that_would_end_too_late_is_not_begun():
    termination = WholeGenerations(10.0)
    algorithm = SimpleNamespace(start_time=time.time(), has_terminated=False)
    shares = []
    for elapsed in (1.0, 4.0, 8.0):
        algorithm.start_time = time.time() - elapsed
        termination.update(algorithm)
        shares.append(termination.perc)
    assert shares[:2] == pytest.approx([0.1, 0.4], abs=0.01)
    assert shares[2] == 1.0


@pytest.mark.parametrize("algorithm", [memetic, nsga2_v1])
def test_searches_keep_their_time(algorithm):
    problem = MeshProblem("jacksboro:9")
    minimize(problem, algorithm(20), ("n_gen", 2), seed=1)
    limit = ("time", 0.6) if algorithm is memetic else WholeGenerations(0.6)
    begun = time.perf_counter()
    result = minimize(problem, algorithm(20), limit, seed=1)
    assert 0.3 < time.perf_counter() - begun < 5.0
    assert len(result.F) > 5


def test_gaps_of_a_front_are_filled_as_far_as_the_time_goes():
    problem = MeshProblem("jacksboro:9")
    result = minimize(problem, memetic(40, moves_per_vertex=20), ("n_gen", 3), seed=1)
    X, F = result.algorithm.pop.get("X", "F")
    most = F[:, 1].max()
    whole, some = (between_the_rungs(problem.surface, X, F, most=most, seconds=s) for s in (None, 0.0))
    assert len(some) < len(whole)
    assert len(between_the_rungs(problem.surface, X, F, most=most, seconds=1e6)) == len(whole)
