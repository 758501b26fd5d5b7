"""Whatever is inserted, removed and moved beside lines: tried as done, done as from scratch."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from counts import tried
from lining import random_segments, with_segments
from nasty import nasty_model
from samples import surface
from test_nasty import walk

from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES

# Lattices, where vertices lie on lines, clouds, where none do; hubs, gaps, twins, slivers at the hull.
MODELS = [
    "checkerboard", "rings", "double comb", "straight fan", "wheel", "flat",
    "slivers", "twins", "spiral", "bow ties", "pins", "long and thin",
]  # fmt: skip
MEASURES = ["error", "max_error", "rms_error"]
LOOK = 10


@tried("moves", 210)
@pytest.mark.parametrize("name", MODELS)
def test_what_is_tried_beside_lines_is_what_is_done_and_as_from_scratch(name, moves):
    model = nasty_model(name)
    for k, (footprint, outside) in enumerate(itertools.product(FOOTPRINTS, OUTSIDES)):
        rounding = (1e-9 if name == "slivers" else 1e-11) * model.n_vertices * model.diagonal
        rng = np.random.default_rng(k)
        highest = np.flatnonzero(np.r_[True, (model.xy[1:] != model.xy[:-1]).any(axis=1)])
        segments, _ = random_segments(model.xy, rng, 3 + 6 * k, among=highest)
        lined = surface(
            with_segments(model, segments), footprint=footprint, outside=outside, measure=MEASURES[k % len(MEASURES)]
        )
        if lined.rules.measure == "rms_error":  # the root of a sum of squares is less exact near 0, by the root
            rounding = max(rounding, 1e-7 * model.diagonal)
        kept = lined.pinned | (rng.random(model.n_vertices) < rng.random())
        live = LiveTriangulation(lined, kept)
        for step, (error, triangles), expected in walk(live, moves, rng):
            if triangles and live.triangles:
                assert expected[1] == live.triangles - triangles
                assert expected[0] == pytest.approx(live.error - error, rel=1e-9, abs=rounding)
            if step % LOOK == LOOK - 1 and live.triangles:
                scratch = lined.simplify(live.kept)
                np.testing.assert_array_equal(live.faces, scratch.faces)
                wanted = getattr(scratch.quality, lined.rules.measure)
                assert live.error == pytest.approx(wanted, rel=1e-9, abs=rounding)
