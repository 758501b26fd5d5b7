from __future__ import annotations

import time

import numpy as np
import pytest
from growing import KINDS
from samples import stepped_model, surface

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.search.greedy import greedy_insertion, thinning

METHODS = {
    "thinning": thinning,
    "worst point": greedy_insertion,
    "worst triangle": lambda surface, *a, **k: greedy_insertion(surface, *a, choose="triangle", **k),
}


def corners_of(model):
    return np.isin(np.arange(model.n_vertices), model.corners)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["jacksboro:30", "face:200", "horseshoe:150", "pyramid:9"])
def test_every_subset_has_the_error_and_the_triangles_that_are_said(method, name):
    model = open_model(name)
    front = METHODS[method](surface(model))
    rows = np.unique(np.linspace(0, len(front) - 1, 25).astype(int))
    table = surface(model).evaluate(np.array([front.kept(k) for k in rows]))
    np.testing.assert_array_equal(table[:, 1], front.triangles[rows])
    np.testing.assert_allclose(table[:, 0], front.error[rows], rtol=1e-9, atol=1e-9 * model.diagonal)
    assert front.kept(0)[model.corners].all()
    for k in rows[1:]:
        assert (front.kept(k) & ~front.kept(k - 1)).sum() == 1


def test_thinning_equals_its_slow_twin():
    """Remove, by full evaluation of every candidate, the vertex that adds least; ties by the lower index."""
    model = open_model("face:60")
    pinned = corners_of(model)
    kept = np.ones(model.n_vertices, bool)
    order = []
    while (kept & ~pinned).any():
        rows = np.flatnonzero(kept & ~pinned)
        X = np.tile(kept, (len(rows), 1))
        X[np.arange(len(rows)), rows] = False
        now = surface(model).evaluate(kept)[0, 0]
        added = np.round(surface(model).evaluate(X)[:, 0] - now, 9)
        best = rows[np.argmin(added)]
        kept[best] = False
        order.append(best)
    assert thinning(surface(model)).order[::-1].tolist() == order


def test_worst_point_insertion_equals_its_slow_twin():
    model = open_model("face:60")
    kept = corners_of(model)
    order = []
    while len(order) < 40:
        deviation = surface(model).simplify(kept).deviation.copy()
        deviation[kept] = -1
        best = int(np.argmax(deviation))
        kept[best] = True
        order.append(best)
    assert greedy_insertion(surface(model), most=40).order.tolist() == order


def test_thinning_beats_insertion_on_a_terrain():
    model = open_model("jacksboro:20")
    thin, grow = thinning(surface(model)), greedy_insertion(surface(model))
    for triangles in (50, 100, 200):
        assert thin.error[thin.triangles <= triangles].min() < grow.error[grow.triangles <= triangles].min()


@pytest.mark.parametrize("method", METHODS)
def test_pinned_vertices_are_in_every_subset(method):
    model = open_model("face:150")
    pinned = corners_of(model)
    pinned[[3, 70, 99]] = True
    front = METHODS[method](surface(model), pinned)
    assert front.kept(0)[pinned].all()
    np.testing.assert_array_equal(front.base, np.flatnonzero(pinned))


def test_insertion_stops_where_the_error_is_zero():
    roof = open_model("roof:9")
    front = greedy_insertion(surface(roof))
    assert front.error[-1] == 0
    assert front.triangles[-1] <= 8
    assert len(greedy_insertion(surface(roof), most=1)) == 2


def test_other_starts_and_wrong_arguments():
    model = open_model("face:150")
    some = np.random.default_rng(0).random(150) < 0.5
    front = thinning(surface(model), kept=some)
    np.testing.assert_array_equal(front.kept(len(front) - 1), some | corners_of(model))
    with pytest.raises(ValueError, match="choose='line' is unknown"):
        greedy_insertion(surface(model), choose="line")
    with pytest.raises(ValueError, match="the subsets 0 to"):
        front.kept(len(front))
    scored = surface(model).score(model.file_points, surface(model).simplify(front.kept(5)).faces)
    assert front.error[5] == pytest.approx(scored.deviation.sum())


def test_insertion_leaves_out_vertices_whose_position_is_taken():
    points = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 0], [2, 2, 9.0], [2, 2, 5]]
    source = SourceMesh(np.array(points), np.array([[0, 1, 4], [1, 2, 5], [2, 3, 4], [3, 0, 6]]), {}, "step")
    model = stepped_model(source)
    for method in METHODS.values():
        front = method(surface(model))
        table = surface(model).evaluate(np.array([front.kept(k) for k in range(len(front))]))
        np.testing.assert_allclose(table[:, 0], front.error)
        np.testing.assert_array_equal(table[:, 1], front.triangles)


def test_pins_and_counts_that_are_none_are_refused():
    model = open_model("face:150")
    with pytest.raises(ValueError, match=r"pinned has shape \(150,\), not \(4,\)"):
        thinning(surface(model), np.ones(4, bool))
    with pytest.raises(TypeError, match="pinned is a bool array, not int64; give True where one is"):
        thinning(surface(model), np.arange(150))
    with pytest.raises(ValueError, match="most=-1"):
        greedy_insertion(surface(model), most=-1)


def test_passes_over_a_problem_s_surface_follow_its_rules_and_a_model_has_none():
    problem = MeshProblem("horseshoe:150", footprint="hull", outside="ignore", pin="hull")
    front = thinning(problem.surface)
    assert front.F.shape == (108, 2)
    assert front.F[np.argmin(front.triangles)] == pytest.approx([6.430010872, 41])
    assert front.kept(0)[problem.pinned].all()
    np.testing.assert_allclose(front.F, problem.evaluate(np.array([front.kept(k) for k in range(108)])), atol=1e-12)
    for method in METHODS.values():
        with pytest.raises(TypeError, match=r"a OpenModel has no rules; give a surface, such as problem\.surface"):
            method(problem.model)


@pytest.mark.filterwarnings("ignore:.*belong to no face")
@pytest.mark.parametrize("name", KINDS)
def test_thinning_is_exact_where_outline_gaps_and_hubs_grow(name):
    """A hub may go later than it could, but what is said of each subset is so, and each removal was costed exactly."""
    kind = KINDS[name]
    rated = surface(kind.make(400), up="z", **kind.rules)
    front = thinning(rated)
    rows = np.unique(np.linspace(0, len(front) - 1, 12).astype(int))
    table = rated.evaluate(np.array([front.kept(k) for k in rows]))
    np.testing.assert_array_equal(table[:, 1], front.triangles[rows])
    np.testing.assert_allclose(table[:, 0], front.error[rows], rtol=1e-9, atol=1e-9 * rated.diagonal)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*belong to no face")
@pytest.mark.parametrize("name", KINDS)
def test_the_time_of_thinning_does_not_grow_with_the_square(name):
    """Of four times as many vertices it takes sixteen times as long where it does; `benchmarks/growth.py` says more."""
    kind, took = KINDS[name], []
    for n in (3_000, 12_000):
        rated = surface(kind.make(n), up="z", **kind.rules)
        thinning(rated, least=n)
        least = np.inf
        for _ in range(3):
            start = time.process_time()
            thinning(rated)
            least = min(least, time.process_time() - start)
        took.append(least)
    assert took[1] < 4**1.7 * took[0]
