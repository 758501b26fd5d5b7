from __future__ import annotations

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize
from scipy.optimize import linprog

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.search.memetic import memetic
from meshsimp_pymoo.search.operators import (
    HalfPlaneCrossover,
    NestedSubsets,
    PackedDuplicates,
    PinnedCorners,
    Relocation,
)
from meshsimp_pymoo.search.operators.half_plane_crossover import half_planes
from meshsimp_pymoo.surface.evaluate import evaluate_subsets


@pytest.fixture(scope="module", params=["jacksboro:24", "horseshoe:150"])
def problem(request):
    return MeshProblem(request.param)


def error(problem, X):
    return evaluate_subsets(problem.model, X, footprint=problem.footprint, outside=problem.outside)[:, 0]


def triangles(problem, X):
    return evaluate_subsets(problem.model, X, footprint=problem.footprint, outside=problem.outside)[:, 1]


@pytest.mark.parametrize("temperature", [0.0, 0.2, 2.0])
def test_relocation_keeps_to_the_triangles_and_never_adds_error(problem, temperature):
    front = thinning(problem.model)
    X = np.array([front.kept(k) for k in (20, 40, 80)])
    Y = Relocation(50, temperature=temperature)._do(problem, X, random_state=np.random.default_rng(1))
    assert (triangles(problem, Y) <= triangles(problem, X)).all()
    assert (triangles(problem, Y) >= triangles(problem, X) - 2).all()
    assert Y[:, problem.pinned].all()
    assert (error(problem, Y) <= error(problem, X) * (1 + 1e-9)).all()
    if temperature < 1:
        assert (error(problem, Y) < error(problem, X) * 0.99).all()


def test_a_wanted_size_is_reached_from_both_sides(problem):
    front = thinning(problem.model)
    for start in (15, 60):
        kept = relocate(problem.model, front.kept(start), problem.pinned, moves=0, seed=1, size=40)
        assert kept.sum() == 40
        assert kept[problem.pinned].all()


def test_a_wanted_number_of_triangles_is_reached_from_both_sides(problem):
    front = thinning(problem.model)
    for start in (15, 60):
        kept = relocate(problem.model, front.kept(start), problem.pinned, moves=0, seed=1, triangles=50)
        assert 48 <= triangles(problem, kept[None])[0] <= 50
        assert kept[problem.pinned].all()


def test_the_budget_of_all_rows_is_bounded():
    problem = MeshProblem("peaks:9")
    seen = []
    mutation = Relocation(100.0, max_moves=50)
    X = np.ones((4, problem.n_var), bool)

    def spy(problem, X, moves, *args, **kwargs):
        seen.append(moves.sum())
        return X

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meshsimp_pymoo.search.operators.relocation.relocate_all", spy)
        mutation._do(problem, X, random_state=np.random.default_rng(0))
    assert 40 <= seen[0] <= 50


def test_half_planes_are_sides_of_lines():
    xy = np.random.default_rng(0).random((200, 2))
    for side in half_planes(xy, 30, np.random.default_rng(1)):
        assert 0.1 <= side.mean() + 0.005
        assert side.mean() <= 0.905
        # Some line has all of one side on its left and all of the other on its right: w x - b >= 1 and <= -1.
        sign = np.where(side, 1.0, -1.0)[:, None]
        line = linprog([0, 0, 0], -sign * np.c_[xy, -np.ones(len(xy))], -np.ones(len(xy)), bounds=(None, None))
        assert line.success


def test_half_plane_children_of_one_size(problem):
    front = thinning(problem.model)
    pairs = np.stack([np.array([front.kept(30)] * 6), np.array([front.kept(50)] * 6)])
    children = HalfPlaneCrossover(keep_size=True)._do(problem, pairs, random_state=np.random.default_rng(2))
    np.testing.assert_array_equal(children[0].sum(axis=1), front.kept(30).sum())
    np.testing.assert_array_equal(children[1].sum(axis=1), front.kept(50).sum())


def test_nested_samples_are_thinned_subsets_within_the_wanted_triangles(problem):
    front = thinning(problem.model)
    X = NestedSubsets((20, 60))._do(problem, 9, random_state=np.random.default_rng(0))
    table = evaluate_subsets(problem.model, X)
    assert ((table[:, 1] >= 20) & (table[:, 1] <= 60)).all()
    for kept in X:
        np.testing.assert_array_equal(kept, front.kept(int(kept.sum()) - len(front.base)))
    assert len(np.unique(table[:, 1])) >= 7
    mixed = NestedSubsets(random_share=0.5)._do(problem, 10, random_state=np.random.default_rng(0))
    assert mixed.shape == (10, problem.n_var)
    with pytest.raises(ValueError, match="thinning has no mesh of 100000 to 200000"):
        NestedSubsets((100_000, 200_000))._do(problem, 5, random_state=np.random.default_rng(0))
    with pytest.raises(ValueError, match="is no range"):
        NestedSubsets((50, 20))


@pytest.mark.parametrize("arguments", [{"moves_per_vertex": -1}, {"max_moves": -5}, {"temperature": float("nan")}])
def test_impossible_searches_are_refused(arguments):
    with pytest.raises(ValueError, match="is no number of at least 0"):
        Relocation(**arguments)


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


def test_the_memetic_front_is_never_worse_than_thinning_and_soon_better(problem):
    front = thinning(problem.model)
    result = minimize(problem, memetic(24, moves_per_vertex=200), ("n_gen", 5), seed=1)
    sampled = NestedSubsets()._do(problem, 24, random_state=np.random.default_rng(0))
    ratios = []
    for e, t in problem.evaluate(sampled):
        best = result.F[result.F[:, 1] <= t, 0].min()
        assert best <= e * (1 + 1e-9)
        if e > 1e-6 * front.error.max():
            ratios.append(best / e)
    assert np.exp(np.mean(np.log(ratios))) < 0.97


def test_the_memetic_search_repeats_and_stays_in_its_range():
    problem = MeshProblem("face:200")
    runs = [minimize(problem, memetic(12, triangles=(20, 90)), ("n_gen", 3), seed=4) for _ in range(2)]
    assert runs[0].X.tobytes() == runs[1].X.tobytes()
    assert runs[0].F[:, 1].max() <= 90
    np.testing.assert_allclose(runs[0].F[:, 0], error(problem, runs[0].X))


def test_the_memetic_search_finds_the_true_front_of_a_roof():
    result = minimize(MeshProblem("roof:9"), memetic(20, triangles=(2, 20)), ("n_gen", 5), seed=1)
    found = {(round(float(e), 9), int(t)) for e, t in result.F}
    assert (0.0, 4) in found
    assert min(t for _, t in found) == 2
