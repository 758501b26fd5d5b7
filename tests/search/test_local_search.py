from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem, workers
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.local_search import USUAL_MOVES, WINDOWED_FROM, anneal, relocate, relocate_all
from meshsimp_pymoo.search.operators import (
    HalfPlaneCrossover,
    NestedSubsets,
    PackedDuplicates,
    PinnedCorners,
    Relocation,
)
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.moves import snapshot


@pytest.fixture(scope="module", params=["jacksboro:24", "horseshoe:150"])
def problem(request):
    return MeshProblem(request.param)


def error(problem, X):
    return problem.surface.evaluate(X)[:, 0]


def triangles(problem, X):
    return problem.surface.evaluate(X)[:, 1]


def test_a_wanted_size_is_reached_from_both_sides(problem):
    front = thinning(problem.surface)
    for start in (15, 60):
        kept = relocate(problem.surface, front.kept(start), moves=0, seed=1, size=40)
        assert kept.sum() == 40
        assert kept[problem.pinned].all()


def test_a_wanted_number_of_triangles_is_reached_from_both_sides(problem):
    front = thinning(problem.surface)
    for start in (15, 60):
        kept = relocate(problem.surface, front.kept(start), moves=0, seed=1, triangles=50)
        assert 48 <= triangles(problem, kept[None])[0] <= 50
        assert kept[problem.pinned].all()


def test_the_unit_of_a_model_makes_no_difference_to_its_annealing():
    """By a power of two, so that nothing is rounded otherwise."""
    source = load("jacksboro:24")
    large, small = (
        HeightSurface(build_model(replace(source, points=source.points * scale), up="z")) for scale in (1.0, 2.0**-30)
    )
    kept = thinning(large).kept(40)
    walked = [relocate(surface, kept, moves=300, seed=1) for surface in (large, small)]
    assert (walked[0] != kept).any()
    np.testing.assert_array_equal(*walked)


@pytest.fixture(scope="module")
def large():
    """A model on which moves look at a window, and a subset of it."""
    problem = MeshProblem("peaks:230")
    assert problem.n_var >= WINDOWED_FROM
    return problem, problem.pinned | (np.random.default_rng(3).random(problem.n_var) < 0.02)


def test_moves_in_a_window_lower_the_error_in_all_parts_of_the_vector(large):
    problem, kept = large
    found = relocate(problem.surface, kept, moves=30_000, seed=1, cooling=0.01)
    (before, most), (after, triangles) = problem.surface.evaluate(np.array([kept, found]))[:, [0, 1]]
    assert after < 0.9 * before
    assert triangles <= most
    moved = [(part != other).mean() for part, other in zip(np.split(kept, 10), np.split(found, 10), strict=True)]
    assert min(moved) > 0.3 * np.mean(moved)
    np.testing.assert_array_equal(found & problem.pinned, problem.pinned)


def test_what_moves_in_a_window_have_found_does_not_depend_on_the_threads(large, monkeypatch):
    problem, kept = large
    found = []
    for n_threads in (1, 3):
        with ThreadPoolExecutor(n_threads) as pool:
            monkeypatch.setattr(workers, "thread_pool", lambda _, pool=pool: pool)
            X = relocate_all(problem.surface, np.array([kept] * 3), np.full(3, 5_000), np.random.default_rng(1))
        found.append(X.tobytes())
    assert found[0] == found[1]
    assert (X[0] != X[1]).any()


def walk(surface, kept, moves, temperature, room):
    """Anneal a subset; return the last and the best one, and the cost of the last by the books."""
    ground, differs = surface.ground(), np.zeros(len(kept), bool)
    with surface.books(kept) as books:
        kept, cost, most = snapshot(ground, books, len(kept))
        n, graph, rooms = len(kept), (surface.border, *surface.neighbours), [np.empty(k, np.int64) for k in (1, room)]
        hot, state, shares = temperature * cost / kept.sum(), np.array([5], np.uint64), tuple(map(float, USUAL_MOVES))
        listed, stop = np.empty(n, np.int64), np.zeros(1, bool)
        how = (moves, hot, 1.0, int(most), shares, state, stop, rooms[0], differs, rooms[1])
        anneal(ground, books, n, surface.pinned, listed, *graph, *how)
        last, cost, _ = snapshot(ground, books, n)
    return last, last ^ differs, cost


@pytest.mark.parametrize("room", [3, 1000])
def test_the_best_subset_is_known_by_what_differs_from_the_last_one(problem, room):
    kept = thinning(problem.surface).kept(30)
    last, best, cost = walk(problem.surface, kept, 3_000, 50.0, room)
    np.testing.assert_array_equal(best, kept)  # so hot that nothing better was met
    assert (last != kept).sum() > 10
    assert cost == pytest.approx(error(problem, last[None])[0])
    # and where it is met on the way, it is at least as good as the first and the last
    last, best, cost = walk(problem.surface, kept, 3_000, 0.2, room)
    errors = error(problem, np.array([best, last, kept]))
    assert errors[0] < errors[2]
    assert errors[0] <= errors[1] * (1 + 1e-12)


def test_the_books_of_moves_in_a_window_hold_the_error_of_evaluation(large):
    problem, kept = large
    last, best, cost = walk(problem.surface, kept, 5_000, 0.0, 10)
    np.testing.assert_array_equal(last, best)
    assert cost == pytest.approx(error(problem, best[None])[0], rel=1e-9)


def test_the_operators_work_in_pymoo_s_nsga2(problem):
    algorithm = NSGA2(
        pop_size=16,
        sampling=NestedSubsets(random_share=0.25),
        crossover=HalfPlaneCrossover(),
        mutation=Relocation(5),
        repair=PinnedCorners(),
        eliminate_duplicates=PackedDuplicates(),
    )
    result = minimize(problem, algorithm, ("n_gen", 4), seed=1)
    np.testing.assert_allclose(result.F[:, 0], error(problem, result.X))
