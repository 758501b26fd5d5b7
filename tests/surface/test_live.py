from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from samples import holey_grid, stepped_model, surface

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.search.greedy import greedy_insertion, thinning
from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
from meshsimp_pymoo.surface.measures import measured
from meshsimp_pymoo.surface.model import build_model, placed_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES


def turned_grid():
    """A grid turned by 10 degrees: its hull is full of slivers that must be peeled."""
    grid = grid_source(np.random.default_rng(0).random((6, 9)), 1.0, 1.0)
    c, s = np.cos(np.pi / 18), np.sin(np.pi / 18)
    return SourceMesh(grid.points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), grid.faces, {}, "turned")


def cliff():
    """Two vertices at one position, over a fan."""
    points = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 5.0], [1, 1, 9.0], [0.5, 1, 2], [1.5, 1, 3]]
    faces = [[0, 1, 4], [1, 7, 5], [7, 2, 5], [1, 2, 7], [2, 3, 5], [3, 6, 4], [6, 0, 4], [3, 0, 6]]
    return SourceMesh(np.array(points, float), np.array(faces), {}, "cliff")


SOURCES = {
    "grid": lambda: load("roof:9"),
    "terrain": lambda: load("jacksboro:30"),
    "holey": holey_grid,
    "turned": turned_grid,
    "face": lambda: load("face:150"),
    "horseshoe": lambda: load("horseshoe:120"),
}
MODELS = {name: build_model(make(), up="z") for name, make in SOURCES.items()} | {"cliff": stepped_model(cliff())}


def assert_as_from_scratch(live, footprint, outside, measure="error"):
    scratch = surface(live.model, footprint=footprint, outside=outside).simplify(live.kept)
    np.testing.assert_array_equal(live.faces, scratch.faces)
    assert live.triangles == scratch.quality.triangles
    scale = live.model.n_vertices * live.model.diagonal
    expected = getattr(scratch.quality, measure)
    # The root of a sum of squares is less exact near 0, by the root.
    tolerance = 1e-7 * live.model.diagonal if measure == "rms_error" else 1e-12 * scale
    assert live.error == pytest.approx(expected, rel=1e-9, abs=tolerance)


class LiveMachine(RuleBasedStateMachine):
    """Any sequence of operations ends where the from-scratch evaluation of the same subset is."""

    @initialize(
        name=st.sampled_from(sorted(MODELS)),
        footprint=st.sampled_from(FOOTPRINTS),
        outside=st.sampled_from(OUTSIDES),
        measure=st.sampled_from(["error", "max_error"]),
        share=st.floats(0, 1),
        seed=st.integers(0, 1000),
    )
    def start(self, name, footprint, outside, measure, share, seed):
        self.model = MODELS[name]
        self.rules = footprint, outside, measure
        kept = np.random.default_rng(seed).random(self.model.n_vertices) < share
        kept[self.model.corners] = True
        rated = surface(self.model, footprint=footprint, outside=outside, measure=measure)
        self.live = LiveTriangulation(rated, kept)

    def pick(self, choice, kept):
        rows = np.flatnonzero(self.live.kept == kept)
        rows = np.setdiff1d(rows, self.model.corners) if kept else rows
        return int(rows[choice % len(rows)]) if len(rows) else None

    def apply(self, tried, act):
        error, triangles = self.live.error, self.live.triangles
        expected = tried()
        scale = self.model.n_vertices * self.model.diagonal
        assert self.live.triangles == triangles
        act()
        if np.isfinite(error) and np.isfinite(self.live.error):
            assert expected[0] == pytest.approx(self.live.error - error, rel=1e-9, abs=1e-11 * scale)
            assert expected[1] == self.live.triangles - triangles

    @rule(choice=st.integers(0, 10**6))
    def insert(self, choice):
        v = self.pick(choice, kept=False)
        if v is not None:
            self.apply(lambda: self.live.try_insert(v), lambda: self.live.insert(v))

    @rule(choice=st.integers(0, 10**6))
    def remove(self, choice):
        v = self.pick(choice, kept=True)
        if v is not None:
            self.apply(lambda: self.live.try_remove(v), lambda: self.live.remove(v))

    @rule(one=st.integers(0, 10**6), other=st.integers(0, 10**6))
    def move(self, one, other):
        v, w = self.pick(one, kept=True), self.pick(other, kept=False)
        if v is not None and w is not None:
            self.apply(lambda: self.live.try_move(v, w), lambda: self.live.move(v, w))

    @precondition(lambda self: hasattr(self, "live"))
    @invariant()
    def equals_scratch(self):
        if self.live.triangles:
            assert_as_from_scratch(self.live, *self.rules)


LiveMachine.TestCase.settings = settings(stateful_step_count=30)
TestLive = LiveMachine.TestCase


@pytest.mark.parametrize("name", ["terrain", "turned", "holey", "face"])
def test_a_thousand_random_operations_do_not_drift(name):
    model = MODELS[name]
    rng = np.random.default_rng(1)
    kept = rng.random(model.n_vertices) < 0.3
    kept[model.corners] = True
    live = LiveTriangulation(surface(model), kept)
    free = np.setdiff1d(np.arange(model.n_vertices), model.corners)
    for _ in range(1000):
        v = int(rng.choice(free))
        (live.remove if live.kept[v] else live.insert)(v)
    assert_as_from_scratch(live, "model", "nearest")


@pytest.mark.parametrize("measure", ["error", "rms_error", "max_error"])
@pytest.mark.parametrize("name", ["terrain", "holey", "face", "cliff"])
def test_weights_and_squares_count_in_every_operation_tried_or_done(name, measure):
    rng = np.random.default_rng(2)
    n = MODELS[name].n_vertices
    model = MODELS[name].with_weights(rng.uniform(0, 3, MODELS[name].source_index.max() + 1) * 2.0)
    kept = rng.random(n) < 0.3
    kept[model.corners] = True
    live = LiveTriangulation(surface(model, measure=measure), kept)
    assert_as_from_scratch(live, "model", "nearest", measure)
    free = np.setdiff1d(np.arange(n), model.corners)
    scale = (model.total_weight if measure == "error" else 1.0) * model.diagonal
    for _ in range(80):
        v = int(rng.choice(free))
        before = live.error, live.triangles
        tried = (live.try_remove if live.kept[v] else live.try_insert)(v)
        done = (live.remove if live.kept[v] else live.insert)(v)
        assert tried[0] == pytest.approx(done, rel=1e-6, abs=1e-9 * scale)
        assert before[0] + done == pytest.approx(live.error, abs=1e-9 * scale)
        assert tried[1] == live.triangles - before[1]
        movable, places = free[live.kept[free]], free[~live.kept[free]]
        if len(movable) and len(places):
            v, w = int(rng.choice(movable)), int(rng.choice(places))
            assert live.try_move(v, w)[0] == pytest.approx(live.move(v, w), rel=1e-6, abs=1e-9 * scale)
    assert_as_from_scratch(live, "model", "nearest", measure)


@pytest.mark.parametrize("measure", ["error", "rms_error", "max_error"])
def test_spikes_that_come_and_go_leave_nothing_in_the_error(measure):
    source = SOURCES["terrain"]()
    rng = np.random.default_rng(3)
    spikes = rng.choice(len(source.points), 3, replace=False)
    points = source.points.copy()
    points[spikes, 2] += [1e9, -1e9, 1e9]
    near = np.unique(source.faces[np.isin(source.faces, spikes).any(axis=1)])
    model = build_model(dataclasses.replace(source, points=points), up="z")
    kept = rng.random(model.n_vertices) < 0.3
    kept[model.corners] = True
    kept[np.isin(model.source_index, near)] = True  # what a spike's triangles cover costs as much as a spike
    live = LiveTriangulation(surface(model, measure=measure), kept)
    for v in np.flatnonzero(np.isin(model.source_index, spikes)):
        assert live.remove(int(v)) > 1e6
        live.insert(int(v))
    expected = measured(surface(model).evaluate(kept[None]), measure, model.total_weight)[0]
    assert expected < 1e6
    assert live.error == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("measure", ["error", "rms_error", "max_error"])
@pytest.mark.parametrize("method", [thinning, greedy_insertion])
def test_the_classic_fronts_follow_the_measure_and_the_weights(method, measure):
    plain = MODELS["face"]
    model = plain.with_weights(np.linspace(0, 1, plain.source_index.max() + 1) ** 4)
    front = method(surface(model, measure=measure))
    table = surface(model).evaluate(np.array([front.kept(k) for k in range(0, len(front), 10)]))
    expected = measured(table, measure, model.total_weight)
    np.testing.assert_allclose(front.error[::10], expected, rtol=1e-9, atol=1e-6 * model.diagonal)
    # At most sizes it beats, in its own measure, the front that looked at another one.
    by_sum = method is greedy_insertion and measure == "max_error"  # by the worst point it looks at the maximum anyway
    other = method(surface(plain), choose="triangle") if by_sum else method(surface(plain))
    k = np.arange(5, min(len(front), len(other)), 5)
    rival = measured(surface(model).evaluate(np.array([other.kept(j) for j in k])), measure, model.total_weight)
    assert (front.error[k] < rival).mean() > 0.6


def test_what_was_tried_before_leaves_nothing_behind_in_what_is_tried_next():
    """Not even where a site of three triangles goes, so that one triangle takes all its vertices."""
    model = MODELS["terrain"]
    rng = np.random.default_rng(1)
    n_found = 0
    for _ in range(12):
        kept = rng.random(model.n_vertices) < 0.1
        kept[model.corners] = True
        live = LiveTriangulation(surface(model, footprint="hull"), kept)
        free = np.setdiff1d(np.flatnonzero(kept), model.corners).tolist()
        for v in (v for v in free if (live.faces == v).any(axis=1).sum() == 3):
            expected = live.remove(v)
            live.insert(v)
            for w in free:
                live.try_remove(w)
                assert live.try_remove(v)[0] == pytest.approx(expected, rel=1e-9)
            n_found += 1
    assert n_found > 5


def test_a_sliver_far_from_what_changes_is_peeled_and_drawn_as_it_comes_to_reach_the_outside_or_not():
    """Sliver (1, 3, 2) lies on sliver (1, 4, 3), and that on the hull; site 0 is in the circle of the latter alone."""
    xy = np.array([[0.4, 0], [0.3, 0.95], [0.300025, 0.95 + 1.35e-9], [0.30005, 0.95 + 0.9e-9], [0.5, 0.95],
                   [0, 1], [1, 1], [0.4, 1]])  # fmt: skip
    xy = np.round(xy * 2.0**52) / 2.0**52
    points, rows = np.column_stack([xy, np.arange(8.0) ** 2]), np.arange(8)
    model = placed_model(
        "slivers", points, np.array([[0, 6, 5]]), np.array([0, 5, 6]), xy=xy, unit=1.0, source_index=rows
    )
    live = LiveTriangulation(surface(model, footprint="hull"), rows > 0)
    for change in (live.insert, live.remove, live.insert):
        assert [1, 3, 2] not in live.faces.tolist() or live.kept[0]
        change(0)
        assert_as_from_scratch(live, "hull", "nearest")
    assert [1, 3, 2] in live.faces.tolist()


def test_removing_everything_but_the_corners_and_putting_it_back_restores_the_mesh():
    model = MODELS["grid"]
    live = LiveTriangulation(surface(model), np.ones(model.n_vertices, bool))
    before = live.faces
    free = np.setdiff1d(np.arange(model.n_vertices), model.corners)
    for v in free:
        live.remove(int(v))
    assert live.triangles == 2
    for v in np.random.default_rng(0).permutation(free):
        live.insert(int(v))
    np.testing.assert_array_equal(live.faces, before)
    assert live.error == pytest.approx(0, abs=1e-9)


def test_wrong_operations_are_refused_and_change_nothing():
    model = MODELS["grid"]
    live = LiveTriangulation(surface(model), np.isin(np.arange(model.n_vertices), model.corners))
    kept, dropped = int(model.corners[0]), int(np.setdiff1d(np.arange(81), model.corners)[0])
    with pytest.raises(ValueError, match="kept already"):
        live.insert(kept)
    with pytest.raises(ValueError, match="is not kept"):
        live.remove(dropped)
    with pytest.raises(ValueError, match="vertex 81 is none of the 81"):
        live.try_insert(81)
    live.remove(kept)
    with pytest.raises(ValueError, match="span no triangle"):
        live.remove(int(model.corners[1]))
    assert live.triangles == 1
    with pytest.raises(ValueError, match=r"has shape \(81,\), not \(80,\)"):
        LiveTriangulation(surface(model), np.ones(80, bool))
    with pytest.raises(ValueError, match="span no triangle"):
        LiveTriangulation(surface(model), np.zeros(81, bool))


def test_a_site_without_which_all_lie_on_a_line_cannot_go():
    model = MODELS["grid"]
    on_a_line = np.flatnonzero(model.points[:, 1] == 0)[:3]
    apex = int(np.flatnonzero(model.points[:, 1] > 0)[0])
    kept = np.zeros(model.n_vertices, bool)
    kept[on_a_line] = kept[apex] = True
    live = LiveTriangulation(surface(model, footprint="hull"), kept)
    before = live.triangles, live.error, live.faces
    assert live.try_remove(apex) == (np.inf, 0)
    with pytest.raises(ValueError, match="span no triangle"):
        live.remove(apex)
    assert (live.triangles, live.error) == before[:2]
    np.testing.assert_array_equal(live.faces, before[2])
