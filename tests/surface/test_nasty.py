"""Whatever is inserted, removed and moved on models that are nasty: tried as done, done as from scratch."""

from __future__ import annotations

import importlib.util
import itertools

import numpy as np
import pytest
from counts import tried
from nasty import SOURCES, nasty_model
from samples import subset, surface

from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES

RULES = list(itertools.product(FOOTPRINTS, OUTSIDES))
# What is minimised: a measure, or the sum of what deviations exceed a bound by. Each model has each of them under other
# rules.
MEASURES = ["error", "max_error", "rms_error", "beyond"]
# Moves between two looks from scratch, and between two wished sizes.
LOOK, STRETCH = 20, 40


def walk(live, moves, rng):
    """Make random moves towards one size after another; yield after some of them what was tried and what came of it."""
    fixed = live.surface.pinned
    wished = 0.5
    for step in range(moves):
        if step % STRETCH == 0:
            wished = rng.random() ** 2
        kept = live.kept
        movable, places = np.flatnonzero(kept & ~fixed), np.flatnonzero(~kept)
        grow = rng.random() < (0.65 if kept.mean() < wished else 0.35)
        before = live.error, live.triangles
        if len(movable) and len(places) and rng.random() < 0.4:
            v, w = int(rng.choice(movable)), int(rng.choice(places))
            expected = live.try_move(v, w)
            live.move(v, w)
        elif (grow or not len(movable)) and len(places):
            v = int(rng.choice(places))
            expected = live.try_insert(v)
            live.insert(v)
        else:
            v = int(rng.choice(movable))
            expected = live.try_remove(v)
            live.remove(v)
        yield step, before, expected


@tried("moves", 90)
@pytest.mark.parametrize("name", sorted(SOURCES))
def test_what_is_tried_is_what_is_done_and_what_is_done_is_as_from_scratch(name, moves):
    model = nasty_model(name)
    weights = np.ones(model.n_vertices) if model.weights is None else model.weights
    # A height in a triangle as low as the slivers drawn is worth that many digits less.
    rounding = (1e-9 if name == "slivers" else 1e-11) * weights.sum() * model.diagonal
    for k, (footprint, outside) in enumerate(RULES):
        rng = np.random.default_rng(k)
        measure = MEASURES[(k + sorted(SOURCES).index(name)) % len(MEASURES)]
        rated = surface(model, footprint=footprint, outside=outside, measure=measure.replace("beyond", "error"))
        kept = rng.random(model.n_vertices) < rng.random()
        kept[model.corners] = True
        bound = float(np.median(rated.simplify(kept).deviation)) if measure == "beyond" and kept.sum() > 3 else 0.0
        live = LiveTriangulation(rated.bounded(bound) if measure == "beyond" else rated, kept)
        for step, (error, triangles), expected in walk(live, moves, rng):
            if triangles and live.triangles:
                assert expected[1] == live.triangles - triangles
                assert expected[0] == pytest.approx(live.error - error, rel=1e-9, abs=rounding)
            if step % LOOK == LOOK - 1 and live.triangles:
                scratch = rated.simplify(live.kept)
                np.testing.assert_array_equal(live.faces, scratch.faces)
                expected = np.maximum(scratch.deviation - bound, 0.0)[weights > 0.0].sum()
                if measure != "beyond":
                    expected = getattr(scratch.quality, measure)
                assert live.error == pytest.approx(expected, rel=1e-9, abs=rounding)


@pytest.mark.filterwarnings("ignore::meshsimp_pymoo.errors.ModelWarning")
def test_what_is_covered_no_longer_and_costs_nothing_leaves_nothing_in_the_maximum():
    """On a turned raster vertices lie a rounding beside the outline, where they count as covered."""
    side = 13
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    cells = np.array([[[0, 1, side + 1], [0, side + 1, side]]]) + corner[:, None, None]
    y, x = np.divmod(np.arange(side * side), side)
    c, s = np.cos(0.3), np.sin(0.3)
    for which, seed, moves in ((2, 0, 320), (7, 1, 370), (11, 1, 90)):
        rng = np.random.default_rng(which)
        faces = cells[rng.random(len(corner)) > 0.25].reshape(-1, 3)
        points = np.column_stack([c * x - s * y, s * x + c * y, rng.normal(size=side * side)])
        model = build_model(build_source(points, faces, name="turned"), up="z")
        rated = surface(model, outside="ignore", measure="max_error")
        rng = np.random.default_rng(seed)
        kept = rng.random(model.n_vertices) < rng.random()
        kept[model.corners] = True
        live = LiveTriangulation(rated, kept)
        for step, _, _ in walk(live, moves, rng):
            if step % 10 == 9 and live.triangles:
                expected = rated.simplify(live.kept).quality.max_error
                assert live.error == pytest.approx(expected, rel=1e-9, abs=1e-9 * model.diagonal)


def test_the_models_are_as_many_as_they_should_be_and_most_have_bare_vertices():
    assert len(SOURCES) == 28
    n_bare = 0
    for name in SOURCES:
        model = nasty_model(name)
        kept = np.zeros(model.n_vertices, bool)
        kept[model.corners] = kept[::4] = True
        n_bare += surface(model).simplify(kept).quality.uncovered > 0
    assert n_bare > 20


# On a lattice points of the outline tie, and the referee may take another one of them; twins, spikes and slivers are
# worth other digits to it.
UNTIED = ("flight strip, turned", "winding corridor", "spiral", "contour points", "pins", "scan with bays")
PLAIN = sorted(set(SOURCES) - {"twins", "spikes", "slivers", "weights of many sizes", "rings", "comb"})


@pytest.mark.parametrize(
    ("name", "outside"),
    [(name, "ignore") for name in PLAIN if name != "spiral"] + [(name, "nearest") for name in UNTIED],
)
def test_the_referee_agrees_where_a_walk_ends(name, outside, oracle):
    spec = importlib.util.spec_from_file_location("vertical_error", oracle)
    referee = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(referee)
    model = nasty_model(name).with_weights(np.ones(int(nasty_model(name).source_index.max()) + 1))
    live = LiveTriangulation(surface(model, outside=outside), subset(model, 0.5))
    for _ in walk(live, 60, np.random.default_rng(9)):
        pass
    error, _, _ = referee.vertical_error(model.points, model.points, live.faces, outside)
    assert live.error == pytest.approx(error, rel=1e-6, abs=1e-9 * model.diagonal)
