"""Free meshes of all sizes: measured as any mesh is, never worse than what they replace, the same for the same seed."""

from __future__ import annotations

import copy
import dataclasses
import itertools
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict

import numpy as np
import pytest
from pymoo.optimize import minimize
from pymoo.termination.max_time import TimeBasedTermination
from samples import holey_grid, subset, surface

from meshsimp_pymoo import (
    Front,
    MeshProblem,
    Moves,
    memetic,
    nsga2_v1,
    nsga3,
    open_grid,
    targeted,
    thinning,
    tiled_front,
    workers,
)
from meshsimp_pymoo.errors import SearchWarning
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.front import Freeing
from meshsimp_pymoo.plane.faces import canonical_faces, is_canonical, used_rows
from meshsimp_pymoo.search import free as module
from meshsimp_pymoo.search.checkpoint import Checkpoints, read_checkpoint, restore
from meshsimp_pymoo.search.free import BETWEEN, FreeLadder, ladder_of, steps_between
from meshsimp_pymoo.surface.measures import OF_MESH, TRIANGLES, UNCOVERED
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES

RULES = list(itertools.product(FOOTPRINTS, OUTSIDES))


def found_on(own, sizes, moves=3_000, seed=1, kept=None, **how):
    """Return the free meshes of a surface on these rungs."""
    ladder = FreeLadder(**how)
    sizes = np.array(sizes)
    offered = steps_between(int(sizes[0]), int(sizes[-1]))
    ladder.begin(own, sizes, offered, np.random.default_rng(seed), moves=moves)
    start = thinning(own)

    def subset_of(rung):
        fits = np.flatnonzero((start.triangles > 0) & (start.triangles <= sizes[rung]))
        return start.kept(int(fits[-1])) if kept is None else kept

    while ladder.todo:
        ladder.go_on(own, subset_of)
    return ladder


def as_set(faces):
    return set(map(tuple, faces.tolist()))


def bytes_of(population):
    free = population.get("free", to_numpy=False)
    return [None if mesh is None else (mesh.kept.tobytes(), mesh.faces.tobytes(), mesh.quality) for mesh in free]


@pytest.fixture(scope="module")
def problem():
    return MeshProblem("face:200")


@pytest.fixture(scope="module")
def searched(problem):
    return minimize(problem, memetic(20, triangulation="free"), Moves(60_000), seed=3)


# ------------------------------------------------------------------------------------------------- one ladder's meshes


@pytest.mark.parametrize(("footprint", "outside"), RULES)
@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("model", ["face:200", "holey"])
def test_all_meshes_are_measured_as_their_faces_are(model, weighted, footprint, outside):
    own = surface(holey_grid() if model == "holey" else model, footprint=footprint, outside=outside)
    if weighted:
        weights = np.random.default_rng(2).random(99 if model == "holey" else own.n_vertices)  # rows of the file
        weights[::7] = 0.0
        own = surface(own.model.with_weights(weights), footprint=footprint, outside=outside)
    n_measured = 0
    for centroids in (True, False):
        ladder = found_on(own, [31, 40], centroids=centroids)
        for front in ladder.fronts.values():
            assert (np.diff(front.collapses) > 0).all()
            meshes = list(front.faces_of(range(len(front.table)), own.n_vertices))
            for row, faces in zip(front.table, meshes, strict=True):
                mesh = module._mesh(own, faces, row)
                assert is_canonical(faces)
                assert faces.dtype == np.int32
                said, numbers = asdict(mesh.quality), asdict(own.of_faces(faces).quality)
                if not centroids and np.isnan(said["surface_error"]):  # no sample says it
                    del said["surface_error"]
                assert said == pytest.approx({name: numbers[name] for name in said}, rel=1e-9, abs=1e-12, nan_ok=True)
                np.testing.assert_array_equal(
                    np.flatnonzero(mesh.kept & ~own.pinned),
                    np.setdiff1d(used_rows(faces)[0], np.flatnonzero(own.pinned)),
                )
                n_measured += 1
    assert n_measured > 10


def test_the_meshes_on_the_way_are_what_is_left_of_the_first_after_each_collapse():
    own = surface("jacksboro:24")
    (front,) = found_on(own, [80]).fronts.values()
    assert len(front.collapses) == 1  # nothing smaller is wanted
    ladder = found_on(own, [30, 50, 80])
    front = ladder.fronts[2]
    assert len(front.collapses) > 5
    on = front.faces.tolist()
    for k in range(len(front.removed)):
        if k in front.collapses:
            row = front.collapses.tolist().index(k)
            (faces,) = front.faces_of([row], own.n_vertices)
            np.testing.assert_array_equal(faces, canonical_faces(np.array(on)))
            assert len(faces) == front.table[row, TRIANGLES]
        v, w = front.removed[k], front.onto[k]
        on = [[w if corner == v else corner for corner in face] for face in on]
        on = [face for face in on if len(set(face)) == 3]
    assert (np.diff(front.table[:, TRIANGLES]) < 0).all()


def test_every_size_between_two_rungs_is_reached_where_it_matters():
    """Collapses inside take two triangles away: of two neighbouring rungs one is odd, and both reach down as far."""
    own = surface("jacksboro:24")
    sizes = ladder_of(12, 60, 8)
    assert (np.diff(sizes % 2) != 0).all()
    ladder = found_on(own, sizes, moves=8_000)
    there = np.unique(np.concatenate([front.table[:, TRIANGLES] for front in ladder.fronts.values()]))
    assert np.diff(there).max() <= 2
    reached = np.isin(np.arange(12, sizes[-2] + 1), there)  # beyond that one rung is alone
    assert reached.mean() > 0.7


def test_moves_are_used_up_and_go_where_they_take_the_same_time():
    own = surface("face:200")
    ladder = found_on(own, [20, 40, 80], moves=12_345)
    assert ladder.moves == ladder.planned.sum() == 12_345
    assert (np.diff(ladder.planned) > 0).all()  # those of small meshes look at more
    few = found_on(own, [2, 80], moves=10**6)
    assert few.moves == module.MOST_MOVES * 2 + min(10**6 - module.MOST_MOVES * 2, module.MOST_MOVES * 80)


def test_the_edge_that_the_delaunay_rule_takes_is_turned_where_the_other_one_fits():
    """A kite of two triangles: its Delaunay edge joins two peaks over a valley, in which the other one lies."""
    points = np.array([[0.0, 0, 0], [2, 0, 4], [2.2, 2.2, 0], [0, 2, 4], [1, 1, 0]])
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [0, 4, 3]])
    own = surface(build_model(SourceMesh(points, faces, {}, "kite"), up="z"), pin=[0, 1, 2, 3])
    corners = own.pinned
    assert own.simplify(corners).quality.error == pytest.approx(4.0)
    (front,) = found_on(own, [2], kept=corners, moves=100).fronts.values()
    row = np.argsort(own.model.source_index)
    np.testing.assert_array_equal(front.faces, canonical_faces(row[np.array([[0, 1, 2], [0, 2, 3]])]))
    assert front.table[0, :2].tolist() == [0.0, 2.0]
    assert front.table[0, BETWEEN] == pytest.approx(0.0, abs=1e-12)


def test_no_triangle_that_comes_is_flatter_than_was_asked_for():
    own = surface("jacksboro:24")
    kept = subset(own.model, 0.3)
    delaunay = as_set(own.simplify(kept).faces)
    for least in (0.0, 0.3):
        (front,) = found_on(own, [200], moves=20_000, min_height=least, kept=kept).fronts.values()
        came = np.array(sorted(as_set(front.faces) - delaunay))
        assert len(came) > 20
        a, b, c = (own.places[came[:, k]] for k in range(3))
        sides = np.array([np.linalg.norm(u - v, axis=1) for u, v in ((a, b), (b, c), (c, a))])
        (ux, uy), (vx, vy) = (b - a).T, (c - a).T
        lowest = float((np.abs(ux * vy - uy * vx) / sides.max(axis=0) ** 2).min())
        assert (lowest >= 0.3) == (least == 0.3)


def test_the_best_one_is_no_larger_and_nothing_that_counts_is_higher():
    own = surface("face:200")
    ladder = found_on(own, [20, 40])
    # error, triangles, vertices, squares, maximum, uncovered; surface error
    rows = [[5, 10, 8, 0, 9, 0, 1], [6, 10, 8, 0, 3, 0, 1], [7, 8, 8, 0, 3, 0, 2], [4, 12, 8, 0, 1, 0, 1]]
    ladder.fronts = {0: dataclasses.replace(ladder.fronts[1], table=np.array(rows, float))}

    def chosen(names, triangles, errors, between=None):
        found = ladder.best_of(
            own,
            names,
            np.array([triangles]),
            np.array([errors], float),
            None if between is None else np.array([between]),
        )
        return None if found[0] is None else found[0].quality.error

    assert chosen(["error"], 12, [9]) == 4
    assert chosen(["error"], 11, [9]) == 5
    assert chosen(["error", "max_error"], 11, [9, 4]) == 6
    assert chosen(["error", "max_error"], 11, [9, 2]) is None
    assert chosen(["error"], 11, [5]) is None
    assert chosen(["error"], 9, [9], 2.0) == 7
    assert chosen(["error"], 9, [9], 1.5) is None
    assert ladder.wished(own, "error", {"max_error": 3.0}).quality.triangles == 8
    assert ladder.wished(own, "error", {"max_error": 3.0, "triangles": 11}).quality.error == 6
    assert ladder.wished(own, "error", {"max_error": 0.5}) is None
    # what is not known is not compared; what counts beside may be what is uncovered
    assert chosen(["error"], 9, [9], np.nan) == 7
    ladder.fronts[0].table[2, UNCOVERED] = 2
    assert chosen(["error", "uncovered"], 9, [9, 2]) == 7
    assert chosen(["error", "uncovered"], 9, [9, 1]) is None
    assert ladder.wished(own, "error", {"max_error": 3.0}, uncovered=1).quality.triangles == 10
    # by what is left of the error: 4 of 40, 5 of 5.5; of the last one nothing is lower
    order = ladder.by_gain(own, ["error"], np.array([11, 12, 8]), np.array([[5.5], [40.0], [7.0]]))
    assert order.tolist() == [1, 0]


class Fake:
    """A mesh of which each move takes some time."""

    cost, movable = 1.0, 1

    def __init__(self, seconds):
        self.seconds, self.asked = seconds, []

    def anneal(self, n, state, **how):
        self.asked.append(n)
        time.sleep(n * self.seconds)
        return n


def test_with_a_deadline_few_moves_are_made_before_it_looks_at_the_clock():
    stop = np.zeros(2, bool)
    slow = Fake(1e-4)
    module._anneal(slow, 10, 1, 10**6, time.perf_counter() + 0.01, 0.1, stop)
    assert slow.asked[0] == 64
    few = Fake(0.0)
    assert module._anneal(few, 10, 1, 10, time.perf_counter() + 60.0, 0.1, stop) == 10
    assert few.asked == [10]


def test_rungs_share_the_time_of_the_threads_that_run(monkeypatch):
    own = surface("face:90")
    ladder, given = FreeLadder(), []
    ladder.begin(own, np.array([20, 30, 40]), np.array([20]), np.random.default_rng(1), shares=np.ones(3), timed=True)
    monkeypatch.setattr(FreeLadder, "compile_for", lambda *given: None)
    monkeypatch.setattr(FreeLadder, "_found", lambda self, *all_: given.append(all_[4]))

    def times(n_threads):
        given.clear()
        ladder.go_on(own, lambda rung: own.pinned, seconds=60.0, n_threads=n_threads)
        return sorted(given)

    assert times(1) == pytest.approx([20.0, 30.0, 60.0], rel=0.05)
    assert times(2) == pytest.approx([40.0, 60.0, 60.0], rel=0.05)
    (inside,) = workers.on_threads(times, [2])  # one after the other
    assert inside == pytest.approx([20.0, 30.0, 60.0], rel=0.05)


def test_the_search_has_the_threads_of_its_problem(monkeypatch):
    asked, real = set(), module.on_threads
    monkeypatch.setattr(module, "on_threads", lambda *given, **how: asked.add(how["n_threads"]) or real(*given, **how))
    monkeypatch.setattr(FreeLadder, "compile_for", lambda *given: None)
    result = minimize(MeshProblem("face:90", n_threads=1), memetic(8, triangulation="free"), Moves(2_000), seed=1)
    Front.from_result(result).free(moves=1_000)
    assert asked == {1}


# ------------------------------------------------------------------------------------------------------- in the search


def test_the_objectives_are_those_of_the_subsets_and_free_meshes_are_better(problem, searched):
    np.testing.assert_array_equal(problem.evaluate(searched.X), searched.F)
    meshes = searched.opt.get("free", to_numpy=False)
    n_free = 0
    for one, mesh in zip(searched.opt, meshes, strict=True):
        if mesh is None:
            continue
        own = problem.surface.simplify(one.X).quality
        assert mesh.quality.triangles <= own.triangles
        assert mesh.quality.error < own.error
        assert mesh.quality.surface_error <= own.surface_error
        n_free += 1
    assert n_free > len(meshes) / 4
    assert searched.algorithm.moves == 60_000


def test_at_no_size_is_the_front_worse_than_that_of_the_subsets(problem, searched):
    front = Front.from_result(searched)
    assert front.n_free > len(front) / 4
    ratios = []
    for error, triangles in searched.F:
        best = front.best(triangles=int(triangles))
        assert best.error <= error
        if error > 0:
            ratios.append(best.error / error)
    assert np.exp(np.mean(np.log(ratios))) < 0.99


def test_a_search_of_subsets_alone_has_no_free_meshes_and_is_what_it_was(problem):
    result = minimize(problem, memetic(20), Moves(18_000), seed=3)
    assert set(result.opt.get("free", to_numpy=False)) == {None}
    assert result.algorithm.moves == 18_000


def test_the_same_seed_and_moves_give_the_same_bytes_on_any_number_of_threads(monkeypatch, searched):
    for n_threads in (1, 3):
        monkeypatch.setattr(workers.os, "cpu_count", lambda n=n_threads: n)
        with ThreadPoolExecutor(n_threads) as pool:
            monkeypatch.setattr(workers, "thread_pool", lambda _, pool=pool: pool)
            result = minimize(MeshProblem("face:200"), memetic(20, triangulation="free"), Moves(60_000), seed=3)
        assert result.X.tobytes() == searched.X.tobytes()
        assert bytes_of(result.opt) == bytes_of(searched.opt)


@pytest.mark.parametrize("done", [1, 2])
def test_a_search_that_was_stopped_goes_on_with_the_rungs_that_are_left(monkeypatch, tmp_path, done):
    monkeypatch.setattr(module, "ABREAST", 8)
    monkeypatch.setattr(FreeLadder.go_on, "__kwdefaults__", FreeLadder.go_on.__kwdefaults__ | {"most": 8})

    def begun():
        return memetic(20, triangulation="free").setup(MeshProblem("face:90"), termination=Moves(20_000), seed=2)

    whole = begun()
    while whole.has_next():
        whole.next()
    first = begun()
    keeper = Checkpoints(tmp_path / "c.npz", first, {}, interval=0)
    while len(first.free.fronts) < 8 * done:
        first.next()
    keeper.save()
    second = begun()
    restore(read_checkpoint(tmp_path / "c.npz"), second)
    assert sorted(second.free.fronts) == sorted(first.free.fronts)
    made = []
    real = FreeLadder._found
    monkeypatch.setattr(FreeLadder, "_found", lambda self, *given: made.append(given[3]) or real(self, *given))
    while second.has_next():
        second.next()
    assert sorted([*made, *first.free.fronts]) == list(range(len(whole.free.sizes)))
    assert second.opt.get("X").tobytes() == whole.opt.get("X").tobytes()
    assert bytes_of(second.opt) == bytes_of(whole.opt)
    assert second.moves == whole.moves == 20_000


def test_what_is_finished_when_the_search_is_interrupted_is_kept(monkeypatch):
    problem, real = MeshProblem("face:90"), FreeLadder._found
    algorithm = memetic(20, triangulation="free").setup(problem, termination=Moves(20_000), seed=2)

    def interrupted(self, *given):
        if len(self.fronts) == 5:
            raise KeyboardInterrupt
        return real(self, *given)

    monkeypatch.setattr(FreeLadder, "_found", interrupted)
    with pytest.raises(KeyboardInterrupt):
        algorithm.run()
    assert 5 <= len(algorithm.free.fronts) < len(algorithm.free.sizes)
    algorithm.take_free(algorithm.opt)
    front = Front.from_population(problem, algorithm.opt)
    assert 0 < front.n_free < len(front)


def test_without_time_to_compare_them_free_meshes_are_taken_and_how_many_is_said(monkeypatch, searched):
    """The few that are compared all the same are those that gain most; the others are taken for their error alone."""
    monkeypatch.setattr(module, "LEAST_COMPARED", 3)
    algorithm, population = searched.algorithm, copy.deepcopy(searched.opt)
    own, F = algorithm.problem.surface, population.get("F")
    order = algorithm.free.by_gain(own, ["error"], F[:, 1], F[:, :1])
    n = len(order)
    with pytest.warns(SearchWarning, match=f"{n - 3} of {n} free meshes are taken without a comparison"):
        algorithm.take_free(population, until=0.0)
    alone = algorithm.free.best_of(own, ["error"], F[:, 1], F[:, :1])
    compared = bytes_of(searched.opt)
    found = bytes_of(population)
    for place, mesh in enumerate(alone):
        mesh = None if mesh is None else (mesh.kept.tobytes(), mesh.faces.tobytes(), mesh.quality)
        assert found[place] == (compared[place] if place in order[:3] else mesh)
    assert sum(mesh is not None for mesh in found) >= n - 3 > 10
    assert found != compared


def test_of_a_front_too_free_meshes_are_taken_without_time_to_compare_them(monkeypatch, plain_front):
    monkeypatch.setattr(module, "LEAST_COMPARED", 3)
    unknown = [dataclasses.replace(q, **dict.fromkeys(OF_MESH, np.nan)) for q in plain_front.quality]
    front = Front(unknown, np.asarray(plain_front.kept), problem=plain_front.problem)
    freeing = Freeing(front, FreeLadder(), moves=20_000)
    told = []
    while freeing.go_on(finished=lambda: told.append(len(freeing.ladder.fronts))):
        pass
    assert len(told) == max(told) == len(freeing.ladder.sizes)
    with pytest.warns(SearchWarning, match=r"\d+ of \d+ free meshes are taken without a comparison"):
        assert freeing.front(until=0.0).n_free > len(front) / 4


def test_where_uncovered_vertices_cost_nothing_no_more_are_uncovered():
    own = surface(holey_grid(), outside="ignore")
    problem = MeshProblem(own)
    result = minimize(problem, memetic(20, triangulation="free"), Moves(20_000), seed=1)
    table = problem.evaluate_subsets(result.opt.get("X"))
    meshes = result.opt.get("free", to_numpy=False)
    pairs = [(mesh.quality.uncovered, row[UNCOVERED]) for mesh, row in zip(meshes, table, strict=True) if mesh]
    assert len(pairs) > 3
    assert all(after <= before for after, before in pairs)
    front = Front.from_subsets(problem, result.X)
    freed = front.free(moves=20_000)
    assert freed.n_free > 3
    not_worse(front, freed, ("error", "uncovered"))


def test_seconds_are_learnt_with_a_deadline_only(searched):
    assert searched.algorithm.free.thought == searched.algorithm.free.took == 0.0


@pytest.mark.filterwarnings("ignore::meshsimp_pymoo.errors.SearchWarning")  # on a busy machine there is less
def test_time_ends_it():
    problem = MeshProblem("face:200")
    begun = time.perf_counter()
    result = minimize(problem, memetic(20, triangulation="free"), TimeBasedTermination(0.6), seed=1)
    assert time.perf_counter() - begun < 6.0
    assert Front.from_result(result).n_free > 0
    begun = time.perf_counter()
    assert Front.from_result(result)[::4].free(time=0.8).n_free > 0
    assert time.perf_counter() - begun < 4.0


def test_what_is_left_out_is_said(monkeypatch, problem):
    with pytest.warns(SearchWarning, match="ended before any size was annealed freely: all meshes are Delaunay"):
        minimize(problem, memetic(20, triangulation="free"), ("n_eval", 20), seed=1)
    real = FreeLadder._found
    monkeypatch.setattr(FreeLadder, "_found", lambda self, *given: None if given[3] == 3 else real(self, *given))
    with pytest.warns(SearchWarning, match=r"ended before 1 of \d+ sizes were annealed freely"):
        minimize(problem, memetic(20, triangulation="free"), Moves(5_000), seed=1)


def test_large_models_are_only_thinned_before(monkeypatch):
    monkeypatch.setattr("meshsimp_pymoo.search.memetic.LARGE", 100)
    result = minimize(MeshProblem("face:200"), memetic(20, triangulation="free"), Moves(20_000), seed=1)
    assert result.algorithm.mating.moves_done == 0
    assert result.algorithm.free.moves == result.algorithm.moves == 20_000


def test_without_a_budget_a_sweep_comes_first_and_then_a_fixed_number_of_moves(monkeypatch):
    monkeypatch.setattr(module, "TOTAL_MOVES", 20_000)
    monkeypatch.setattr(module, "LEAST_MOVES", 1)
    for termination in (None, ("n_eval", 10**6)):
        algorithm = minimize(
            MeshProblem("face:90"), memetic(20, triangulation="free", moves_per_vertex=1), termination, seed=1
        ).algorithm
        assert algorithm.mating.sweep == 1
        assert not algorithm.free.todo
        assert algorithm.free.moves == algorithm.free.planned.sum() >= 20_000


def test_a_model_that_any_mesh_fits_has_no_free_meshes():
    result = minimize(MeshProblem("plane:5"), memetic(10, triangulation="free"), Moves(2_000), seed=1)
    assert Front.from_result(result).n_free == 0
    assert result.F.tolist() == [[0.0, 2.0]]


@pytest.mark.parametrize("measure", ["rms_error", "max_error"])
def test_other_measures_are_lowered_and_constraints_hold(measure):
    problem = MeshProblem("face:200", objectives=(measure, "triangles"), max_triangles=90, max_objective=20.0)
    result = minimize(problem, memetic(20, triangulation="free"), Moves(60_000), seed=1)
    front = Front.from_result(result)
    assert front.n_free > 0
    for solution in front:
        assert solution.triangles <= 90
        assert getattr(solution, measure) <= 20.0
    for value, triangles in result.F:
        if triangles <= 90 and value <= 20.0:
            assert getattr(front.best(triangles=int(triangles)), measure) <= value


# ------------------------------------------------------------------------------------------------------- on any front


@pytest.fixture(scope="module")
def plain_front(problem):
    return Front.from_result(minimize(problem, nsga2_v1(20), ("n_gen", 8), seed=1))


def not_worse(before, after, names):
    for old in before:
        new = after.best(triangles=old.triangles)
        assert all(getattr(new, name) <= getattr(old, name) for name in names[:1])
        assert any(
            all(getattr(q, name) <= getattr(old.quality, name) for name in (*names, "triangles")) for q in after.quality
        )


def test_a_front_of_nsga2_is_freed_and_nowhere_worse(plain_front, tmp_path):
    freed = plain_front.free(moves=60_000)
    assert freed.n_free > len(freed) / 2
    not_worse(plain_front, freed, ("error", "surface_error"))
    assert np.mean([freed.best(triangles=s.triangles).error / s.error for s in plain_front if s.error > 0]) < 0.9
    assert freed.run["freeing"] == {"seed": 1, "moves": 60_000, "min_height": 0.1, "centroids": True}
    again = plain_front.free(moves=60_000)
    assert again.quality == freed.quality
    assert all(np.array_equal(a, b) for a, b in zip(again.faces, freed.faces, strict=True))
    assert plain_front.free(moves=60_000, seed=2).quality != freed.quality
    plain_front.save(tmp_path / "out", page=False, pictures=False)
    loaded = Front.load(tmp_path / "out")
    assert loaded.free(moves=60_000).quality == freed.quality
    part = loaded[3:9].free(moves=20_000)
    assert part.n_free > 0
    not_worse(loaded[3:9], part, ("error", "surface_error"))
    twice = freed.free(moves=20_000)
    not_worse(freed, twice, ("error", "surface_error"))


def test_for_the_vertices_alone_all_numbers_are_known_all_the_same(plain_front):
    freed = plain_front.free(moves=60_000, centroids=False, min_height=0)
    assert freed.n_free > 0
    not_worse(plain_front, freed, ("error",))
    assert not any(np.isnan(getattr(q, name)) for q in freed.quality for name in OF_MESH)


def test_of_three_objectives_none_rises():
    problem = MeshProblem("face:200", objectives=("error", "max_error", "triangles"))
    front = Front.from_result(minimize(problem, nsga3(n_partitions=5), ("n_gen", 6), seed=1))
    freed = front.free(moves=60_000)
    assert freed.n_free > 0
    not_worse(front, freed, ("error", "max_error", "surface_error"))


WISHES = [{"triangles": 50}, {"mean_error": 2.5}, {"max_error": 12.0}, {"triangles": 60, "max_error": 14.0}]


@pytest.mark.parametrize("wish", WISHES, ids=str)
def test_what_was_wished_for_is_better_afterwards_and_its_limits_hold(wish):
    measure = "max_error" if "max_error" in wish and "triangles" not in wish else "error"
    problem = MeshProblem("face:200", objectives=(measure, "triangles"))
    front = Front.from_result(minimize(problem, targeted(**wish), Moves(5_000), seed=1))
    freed = front.free(moves=100_000)
    before, after = front.best(**wish), freed.best(**wish)
    assert all(getattr(after, name) <= most for name, most in wish.items())
    assert (after.triangles, getattr(after, measure)) <= (before.triangles, getattr(before, measure))
    if "max_error" not in wish:
        assert after.free


# ------------------------------------------------------------------------------------------------------------ refusals


REFUSED = {
    "an unknown word": (
        lambda: memetic(triangulation="fre"),
        "triangulation='fre' is unknown; use one of 'delaunay', 'free'",
    ),
    "a height alone": (lambda: memetic(min_height=0.2), "for free meshes; give triangulation='free' too"),
    "no centroids alone": (lambda: memetic(centroids=False), "for free meshes; give triangulation='free' too"),
    "too high": (lambda: memetic(triangulation="free", min_height=0.6), "min_height=0.6 is no share of"),
    "no number": (lambda: FreeLadder(min_height="0.1"), "min_height='0.1' is no share of"),
    "no moves": (lambda: Front.free(None, moves=0), r"Moves\(0\): expected a whole number of at least 1"),
    "no time": (lambda: Front.free(None, time=-1.0), "time=-1.0 is no time to search for"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_makes_no_sense_is_refused_in_one_line(kind):
    ask, message = REFUSED[kind]
    with pytest.raises(ValueError, match=message) as refused:
        ask()
    assert "\n" not in str(refused.value)


def test_both_budgets_at_once_are_refused_and_so_are_tiles(plain_front):
    with pytest.raises(TypeError, match="time=1 does not go with moves=5"):
        plain_front.free(time=1, moves=5)
    heights = np.add.outer(np.arange(130.0), np.arange(130.0) ** 2 % 7)
    with pytest.raises(ValueError, match="made by moves of edges, which a GridSurface does not have"):
        tiled_front(open_grid(heights), tile=64).free()
