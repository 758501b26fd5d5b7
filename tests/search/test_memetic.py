"""The memetic search finds the whole true front where that is known, and elsewhere more than thinning."""

from __future__ import annotations

import dataclasses
import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from enumerable_models import GENERATIONS, MOST_FREE, nondominated, random_problem, same_front, true_front
from pymoo.core.population import Population
from pymoo.optimize import minimize
from pymoo.termination.collection import TerminationCollection
from pymoo.termination.max_gen import MaximumGenerationTermination

from meshsimp_pymoo import MeshProblem, Moves, NestedSubsets, PackedDuplicates, memetic, nsga2_v1, thinning, workers
from meshsimp_pymoo.search import local_search
from meshsimp_pymoo.search import memetic as module
from meshsimp_pymoo.search.local_search import MoveShares
from meshsimp_pymoo.search.memetic import IDLE, DownTheLadder, SizeLadder

MODELS = range(20)


@pytest.fixture(scope="module", params=["jacksboro:24", "horseshoe:150"])
def problem(request):
    return MeshProblem(request.param)


@pytest.mark.parametrize("seed", MODELS)
def test_memetic_finds_the_whole_front_of_a_model_that_can_be_enumerated(seed):
    problem = random_problem(seed)
    known = true_front(problem)
    # A problem of its own, so that nothing which the enumeration left behind can help.
    result = minimize(MeshProblem(problem.model), memetic(), ("n_gen", GENERATIONS), seed=seed)
    np.testing.assert_allclose(nondominated(result.F), known, rtol=1e-12)
    np.testing.assert_array_equal(problem.evaluate(result.X), result.F)


def test_the_enumerated_front_agrees_with_its_definition():
    problem = random_problem(0)
    free = np.flatnonzero(~problem.pinned)
    rows = []
    for taken in itertools.chain.from_iterable(itertools.combinations(free, k) for k in range(len(free) + 1)):
        kept = problem.pinned.copy()
        kept[list(taken)] = True
        quality = problem.quality(kept)
        rows.append((quality.error, quality.triangles))
    assert len(rows) == 2 ** len(free)
    front = {(e, t) for e, t in rows if not any(a <= e and b <= t and (a, b) != (e, t) for a, b in rows)}
    assert {tuple(row) for row in true_front(problem).tolist()} == front


def test_the_models_differ_in_size_and_thinning_alone_misses_most_fronts():
    """So the search has something to find."""
    problems = [random_problem(seed) for seed in MODELS]
    assert {int((~problem.pinned).sum()) for problem in problems} == set(range(3, MOST_FREE + 1))
    missed = 0
    for problem in problems:
        nested = thinning(problem.surface)
        missed += not same_front(np.c_[nested.error, nested.triangles], true_front(problem), tolerance=1e-9)
    assert missed > len(problems) / 2


def test_the_search_ends_when_there_is_nothing_left_to_find():
    """However many evaluations it may still use."""
    problem = random_problem(2)
    result = minimize(MeshProblem(problem.model), memetic(), ("n_eval", 10**9), seed=1)
    assert result.algorithm.idle >= IDLE
    np.testing.assert_allclose(nondominated(result.F), true_front(problem), rtol=1e-12)


@pytest.mark.parametrize(
    "options", [{"inherit": False}, {"heat": 0.0}, {"shares": MoveShares(near=1.0, fill=0.0, drop=0.0)}], ids=str
)
def test_the_ways_of_making_children_can_be_chosen_and_none_is_worse_than_thinning(options):
    problem = MeshProblem("peaks:15")
    ladder = SizeLadder()
    mating = DownTheLadder(ladder, 20, eliminate_duplicates=PackedDuplicates(), **options)
    result = minimize(problem, memetic(30, survival=ladder, mating=mating), ("n_gen", 6), seed=1)
    usual = minimize(problem, memetic(30, moves_per_vertex=20), ("n_gen", 6), seed=1)
    thinned = thinning(problem.surface)
    assert not np.array_equal(result.F, usual.F)
    rungs = result.algorithm.survival.rungs
    assert len(rungs) > 20
    for rung in rungs:
        found, fitting = result.F[:, 1] <= rung, thinned.triangles <= rung
        # the mesh may be one of thinning's own, whose error was added up in another order
        assert result.F[found, 0].min() <= thinned.error[fitting].min() * (1 + 1e-9)


def test_where_all_vertices_are_not_the_best_mesh_the_front_still_ends_with_the_best_of_thinning(shared_data):
    """Where a scan's outline is not covered, the whole mesh's error is not the least."""
    problem = MeshProblem(shared_data / "m4_skull.ply")
    thinned = thinning(problem.surface)
    whole = problem.evaluate(np.ones(problem.n_var, bool))
    assert thinned.error.min() < whole[0]
    result = minimize(problem, memetic(20, moves_per_vertex=0), ("n_gen", 2), seed=1)
    assert result.F[:, 0].min() <= thinned.error.min() * (1 + 1e-9)
    assert result.F[:, 0].min() < result.algorithm.pop.get("F")[:, 0].min()  # the last rungs have none of it


def test_a_rung_on_which_no_individual_fits_has_none():
    problem = MeshProblem("roof:5")
    pop = Population.new("F", np.array([[5.0, 9], [0.5, 12], [5.0, 8], [0.5, 14]]))
    ladder = SizeLadder()
    ladder.rungs = np.array([7, 8, 11, 20])
    assert ladder.best(problem, pop).tolist() == [-1, 2, 2, 1]


def test_what_is_filled_in_between_two_rungs_fits_into_memory(monkeypatch):
    problem = MeshProblem("face:200")
    X = np.array([thinning(problem.surface).kept(k) for k in (60, 0)])
    F = problem.evaluate(X)
    n_rows = []
    for most in (1, 2, 1000):
        monkeypatch.setattr(module, "ENTRIES", most * X.size)
        n_rows.append(len(module.between_the_rungs(problem.surface, X, F, most=0)))
    assert n_rows == [1, 2, module.BETWEEN]


def test_beyond_the_last_rung_come_meshes_of_thinning_up_to_its_best_one(monkeypatch):
    surface = MeshProblem("face:200").surface
    front = thinning(surface)
    best = 100  # as if larger meshes were worse, as where an outline is not covered
    error = np.where(np.arange(len(front)) > best, front.error[best] + 1, front.error)
    monkeypatch.setattr(module, "at_hand", lambda *_: dataclasses.replace(front, error=error))
    X = front.kept(20)[None]
    found = module.between_the_rungs(surface, X, np.array([[front.error[20], front.triangles[20]]]), most=np.inf)
    assert len(found) == module.BETWEEN
    assert (np.diff(found.sum(axis=1)) > 0).all()
    np.testing.assert_array_equal(found[-1], front.kept(best))


def test_an_exact_rung_below_a_huge_error_is_no_more_than_a_better_one(recwarn):
    problem = MeshProblem("face:200")
    X = np.array([thinning(problem.surface).kept(k) for k in (60, 0)])
    F = problem.evaluate(X)
    F[:, 0] = [0.0, 1e13]  # the larger mesh comes first
    assert len(module.between_the_rungs(problem.surface, X, F, most=0)) == module.BETWEEN
    assert not recwarn.list


def test_between_rungs_of_one_error_there_is_nothing_to_find():
    roof = MeshProblem("roof:5")
    front = thinning(roof.surface)
    X = np.array([front.kept(k) for k in (np.flatnonzero(front.error == 0)[0], len(front) - 1)])
    assert len(module.between_the_rungs(roof.surface, X, roof.evaluate(X), most=0)) == 0


def test_the_memetic_front_is_never_worse_than_thinning_and_soon_better(problem):
    front = thinning(problem.surface)
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
    runs = [
        minimize(problem, memetic(12, triangles=(20, 90), moves_per_vertex=20), ("n_gen", 3), seed=4) for _ in range(2)
    ]
    assert runs[0].X.tobytes() == runs[1].X.tobytes()
    assert runs[0].F[:, 1].max() <= 90
    np.testing.assert_allclose(runs[0].F[:, 0], problem.surface.evaluate(runs[0].X)[:, 0])


@pytest.mark.parametrize("moves", [1, 7, 100, 5_000, 123_457])
@pytest.mark.parametrize("model", ["face:200", "horseshoe:150"])
def test_a_budget_in_moves_is_used_up_and_never_exceeded(model, moves, monkeypatch):
    made, relocate = [], local_search.relocate

    def noted(*given, **options):
        found = relocate(*given, **options)
        made.append(int(options["made"][0]))
        return found

    monkeypatch.setattr(local_search, "relocate", noted)
    algorithm = minimize(MeshProblem(model), memetic(20), Moves(moves), seed=2).algorithm
    assert sum(made) == algorithm.moves == moves
    assert algorithm.mating.sweep <= 2


def test_a_budget_in_moves_makes_a_quick_sweep_and_a_slow_one(monkeypatch):
    asked = []
    monkeypatch.setattr(
        module, "relocate_all", lambda _, X, moves, *__, **___: (asked.append(int(moves.sum())), X.copy())[1]
    )
    algorithm = minimize(MeshProblem("face:200"), memetic(40), Moves(10_000), seed=1).algorithm
    per_sweep = [sum(asked[:3]), sum(asked[3:])]  # 40 rungs in 16 chains: three generations
    assert len(asked) == 6
    assert per_sweep == [1_200, 8_800]
    # beyond the most moves a kept vertex they go on in further sweeps
    asked.clear()
    monkeypatch.setattr(module, "SLOWEST", 1.0)
    monkeypatch.setattr(module, "IDLE", 100)
    again = minimize(MeshProblem("face:200"), memetic(40), Moves(10_000), seed=1).algorithm
    assert again.mating.sweep > 3
    assert again.moves == sum(asked) == 10_000
    assert algorithm.mating.sweep == 2


def test_a_large_model_has_no_quick_sweep_where_there_are_few_moves(monkeypatch):
    monkeypatch.setattr(module, "WINDOWED_FROM", 0)
    asked = []
    monkeypatch.setattr(
        module, "relocate_all", lambda _, X, moves, *__, **___: (asked.append(int(moves.sum())), X.copy())[1]
    )
    for most, n_generations in ((10_000, 3), (1_000_000, 6)):
        asked.clear()
        minimize(MeshProblem("face:200"), memetic(40), Moves(most), seed=1)
        assert len(asked) == n_generations
        assert sum(asked) == most


def test_with_a_deadline_rungs_of_a_large_model_that_would_hardly_be_moved_are_left_as_they_are(monkeypatch):
    monkeypatch.setattr(module, "WINDOWED_FROM", 0)
    asked = []
    monkeypatch.setattr(module, "relocate_all", lambda _, X, moves, *__, **___: (asked.append(moves), X.copy())[1])
    problem = MeshProblem("face:200")
    for seconds in (1e-9, 1e3):
        monkeypatch.setattr(module, "time_limit", lambda *_, left=seconds: (left, left, 0.0))
        algorithm = memetic(16)
        algorithm.setup(problem, termination=("n_gen", 2), seed=1)
        algorithm.next()
        algorithm.next()
    n_kept = [np.count_nonzero(one.X & ~problem.pinned) for one in algorithm.pop]
    assert max(n_kept) > module.FULL_SHARE * problem.n_var
    assert len(asked[0]) < len(asked[1]) == len(algorithm.survival.rungs)
    assert (asked[0] <= module.BEGINNING * module.FULL_SHARE * problem.n_var).all()


def test_where_all_rungs_of_a_large_model_would_hardly_be_moved_all_are_moved_a_little(monkeypatch):
    monkeypatch.setattr(module, "WINDOWED_FROM", 0)
    monkeypatch.setattr(module, "time_limit", lambda *_: (1e-9, 1e-9, 0.0))
    asked = []
    monkeypatch.setattr(module, "relocate_all", lambda _, X, moves, *__, **___: (asked.append(moves), X.copy())[1])
    problem = MeshProblem("face:200")
    algorithm = memetic(16, triangles=(300, 380))
    algorithm.setup(problem, termination=("n_gen", 2), seed=1)
    algorithm.next()
    algorithm.next()
    n_kept = [np.count_nonzero(one.X & ~problem.pinned) for one in algorithm.pop]
    assert min(n_kept) > module.FULL_SHARE * problem.n_var
    assert len(asked[0]) == len(algorithm.survival.rungs)
    assert (asked[0] > 0).all()


def test_a_generation_of_which_no_rung_is_moved_has_no_children(monkeypatch):
    monkeypatch.setattr(module, "WINDOWED_FROM", 0)
    monkeypatch.setattr(module, "time_limit", lambda *_: (1e-9, 1e-9, 0.0))
    problem = MeshProblem("face:200")
    algorithm = memetic(4, triangles=(40, 380))
    algorithm.mating.n_chains = 1
    algorithm.setup(problem, termination=("n_gen", 9), seed=1)
    algorithm.next()
    before = algorithm.pop.get("X")
    algorithm.next()
    assert algorithm.mating.moves_done == 0
    np.testing.assert_array_equal(algorithm.pop.get("X"), before)
    algorithm.next()
    algorithm.next()
    assert algorithm.mating.moves_done > 0


@pytest.mark.parametrize("n_rungs", [1, 15, 16, 40, 48, 49, 100, 333])
def test_each_rung_has_one_turn_a_sweep_after_the_one_above_in_its_chain(n_rungs):
    sweep = module.turns(n_rungs)
    assert sorted(np.concatenate([rungs for rungs, _ in sweep]).tolist()) == list(range(n_rungs))
    assert len(sweep) == -(-n_rungs // module.CHAINS)
    before = set()
    for rungs, is_first in sweep:
        assert len(rungs) <= module.CHAINS
        assert (np.diff(rungs) < 0).all()  # the longest task first
        assert is_first or before.issuperset((rungs + 1).tolist())
        before |= set(rungs.tolist())


def test_a_generation_of_the_largest_rungs_has_many_that_are_alike():
    """If the moves grow with the rungs' sizes, up to a quarter of all, no core waits long for the largest one."""
    work = np.minimum(np.geomspace(2, 138_000, 100), 138_000 / 4)
    for rungs, _ in module.turns(100)[: module.TOP_GENERATIONS]:
        assert work[rungs].sum() > 5 * work[rungs].max()


@pytest.mark.parametrize(
    "termination", [Moves(20_000), TerminationCollection(MaximumGenerationTermination(50), Moves(20_000))]
)
def test_a_budget_in_moves_gives_the_same_bytes_on_any_number_of_threads(monkeypatch, termination):
    found = []
    for n_threads in (1, 3):
        with ThreadPoolExecutor(n_threads) as pool:
            monkeypatch.setattr(workers, "thread_pool", lambda _, pool=pool: pool)
            result = minimize(MeshProblem("face:200", n_threads=n_threads), memetic(20), termination, seed=3)
        found.append((result.X.tobytes(), result.F.tobytes(), result.algorithm.moves))
    assert found[0] == found[1]
    assert found[0][2] == 20_000


def test_moves_that_time_has_stopped_are_not_counted():
    problem = MeshProblem("face:200")
    made = np.zeros(3, np.int64)
    X = np.array([thinning(problem.surface).kept(60)] * 3)
    local_search.relocate_all(
        problem.surface, X, np.array([5, 10**10, 10**10]), np.random.default_rng(1), seconds=0.05, made=made
    )
    assert made[0] == 5
    assert (made[1:] % 64 == 0).all()
    assert (made[1:] < 10**8).all()


@pytest.mark.parametrize(("asked", "most"), [(80, 96), (200, 216), (300, 316)])
def test_a_budget_of_evaluations_holds_with_what_is_filled_in(asked, most):
    """Of the last generation only is more evaluated."""
    algorithm = minimize(MeshProblem("face:200"), memetic(60, moves_per_vertex=1), ("n_eval", asked), seed=1).algorithm
    assert asked <= algorithm.evaluator.n_eval < most


def test_the_filling_of_a_search_that_ends_before_takes_no_more_evaluations_than_are_left(monkeypatch):
    monkeypatch.setattr(module, "IDLE", 0)
    monkeypatch.setattr(module, "relocate_all", lambda _, X, *__, **___: X.copy())
    counts = [
        minimize(MeshProblem("face:200"), memetic(20), ("n_eval", n), seed=1).algorithm.evaluator.n_eval
        for n in (25, 50, 10**9)
    ]
    assert counts[:2] == [25, 50]
    assert counts[2] > 100


@pytest.mark.parametrize("wrong", [0, -1, 2.5, True, "many", None])
def test_a_number_of_moves_that_is_none_is_refused(wrong):
    with pytest.raises(ValueError, match=r"Moves\(.*: expected a whole number of at least 1"):
        Moves(wrong)


def test_moves_for_an_algorithm_that_makes_none_are_refused():
    with pytest.raises(TypeError, match=r"Moves\(5\) is for memetic\(\) and targeted\(\), and NSGA2 makes no moves"):
        minimize(MeshProblem("roof:5"), nsga2_v1(10), Moves(5), seed=1)


def test_the_memetic_search_finds_the_true_front_of_a_roof():
    result = minimize(MeshProblem("roof:9"), memetic(20, triangles=(2, 20)), ("n_gen", 5), seed=1)
    found = {(round(float(e), 9), int(t)) for e, t in result.F}
    assert (0.0, 4) in found
    assert min(t for _, t in found) == 2
