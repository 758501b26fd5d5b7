"""The maximum as what a search lowers: thinning by it, insertion down to it, moves that keep below a bound."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.optimize import minimize
from samples import holey_grid, surface

from meshsimp_pymoo import LiveTriangulation, MeshProblem, Moves, greedy_insertion, memetic, thinning
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.surface.model import build_model

MODELS = {
    "terrain": build_model(load("jacksboro:40"), up="z"),
    "holey": build_model(holey_grid(), up="z"),
    "face": build_model(load("face:70"), up="z"),
    "ring": build_model(load("ring:80"), up="z"),
}


def rank_of_a_removal(rated, kept, v):
    """The largest deviation among the vertices whose triangle or place outside is another one, and the powers' sum."""
    without = kept.copy()
    without[v] = False
    before, after = rated.simplify(kept), rated.simplify(without)
    changed = after.deviation != before.deviation
    changed[v] = True
    eighth = ((after.deviation / rated.diagonal) ** 8).sum() - ((before.deviation / rated.diagonal) ** 8).sum()
    return after.deviation[changed].max(), eighth


@pytest.mark.parametrize("name", MODELS)
def test_thinning_by_the_maximum_removes_what_leaves_the_least_maximum_around_it(name):
    """A slow twin looks at each removal there is; what a triangle keeps unchanged may be in its maximum, or not."""
    rated = surface(MODELS[name], measure="max_error")
    front = thinning(rated)
    for k in range(len(front) - 1, 0, -max(len(front) // 9, 1)):
        kept, removed = front.kept(k), front.order[k - 1]
        found = {}
        for v in np.flatnonzero(kept & ~rated.pinned):
            try:
                found[int(v)] = rank_of_a_removal(rated, kept, v)[0]
            except ValueError:  # nothing is left of the mesh
                continue
        assert found[int(removed)] <= front.error[k - 1] * (1 + 1e-12)
        # what is removed leaves no greater maximum than the old one, or one that all others leave too
        least = min(max(peak, front.error[k]) for peak in found.values())
        assert front.error[k - 1] <= least * (1 + 1e-9)


@pytest.mark.parametrize("method", [thinning, greedy_insertion])
@pytest.mark.parametrize("name", MODELS)
def test_the_error_of_each_nested_subset_is_its_maximum(method, name):
    rated = surface(MODELS[name], measure="max_error")
    front = method(rated)
    there = np.flatnonzero(front.triangles > 0)  # the ring's corners alone are no mesh
    expected = [rated.simplify(front.kept(k)).quality.max_error for k in there]
    assert np.isinf(np.delete(front.error, there)).all()
    np.testing.assert_allclose(front.error[there], expected, rtol=1e-9, atol=1e-12 * rated.diagonal)


@pytest.mark.parametrize("measure", ["error", "rms_error", "max_error"])
@pytest.mark.parametrize("name", MODELS)
def test_insertion_ends_at_an_error_and_thinning_before_it_is_exceeded(name, measure):
    rated = surface(MODELS[name], measure=measure)
    whole = greedy_insertion(rated)
    wished = float(np.median(whole.error))
    grown = greedy_insertion(rated, least_error=wished)
    k = int(np.flatnonzero(whole.error <= wished)[0])
    assert len(grown) == k + 1
    np.testing.assert_array_equal(grown.order, whole.order[:k])
    back = thinning(rated, kept=grown.kept(k), most_error=wished * (1 + 1e-9))
    assert back.error.max() <= wished * (1 + 1e-9)
    whole_back = thinning(rated, kept=grown.kept(k))
    assert len(whole_back) == len(back) or whole_back.error[-len(back) - 1] > wished
    np.testing.assert_array_equal(back.error, whole_back.error[-len(back) :])


def test_moves_bring_all_deviations_below_a_bound_where_the_sum_of_moves_does_not():
    rated = surface(MODELS["terrain"], measure="max_error")
    grown = greedy_insertion(rated)
    k = len(grown) // 3
    kept, bound, size = grown.kept(k), float(grown.error[k]), int(grown.triangles[k] * 0.9)
    found = relocate(rated.bounded(bound), kept, moves=30_000, seed=1, triangles=size)
    quality = rated.simplify(found).quality
    assert quality.max_error <= bound
    assert quality.triangles <= size
    by_sum = relocate(surface(MODELS["terrain"]), kept, moves=30_000, seed=1, triangles=size)
    assert rated.simplify(by_sum).quality.max_error > bound


def test_a_share_of_the_own_cost_lowers_the_sum_below_the_bound_too():
    plain = surface(MODELS["terrain"])
    grown = greedy_insertion(surface(MODELS["terrain"], measure="max_error"))
    k = len(grown) // 2
    kept, bound, size = grown.kept(k), float(grown.error[k]), int(grown.triangles[k])
    both, alone = (
        plain.simplify(relocate(rated, kept, moves=20_000, seed=1, triangles=size, cooling=1e-3)).quality
        for rated in (plain.bounded(bound, own=0.1), plain.bounded(bound))
    )
    assert both.max_error <= bound
    assert both.error < 0.9 * alone.error


def test_what_is_no_bound_no_error_and_no_flag_is_refused():
    rated = surface(MODELS["face"])
    for bound in ({"most": -1}, {"most": 1, "own": np.nan}, {"most": "5"}):
        with pytest.raises(ValueError, match="is no number of at least 0"):
            rated.bounded(**bound)
    for value in (-1.0, np.nan, "5"):
        with pytest.raises(ValueError, match=f"most_error={value!r} is no error; give 0 or more"):
            thinning(rated, most_error=value)
        with pytest.raises(ValueError, match=f"least_error={value!r} is no error; give 0 or more"):
            greedy_insertion(rated, least_error=value)
    with pytest.raises(TypeError, match="stop is a flag that another thread sets, not int64"):
        thinning(rated, stop=np.zeros(1, int))
    with pytest.raises(ValueError, match=r"stop has shape \(0,\)"):
        greedy_insertion(rated, stop=np.zeros(0, bool))


def test_the_memetic_search_lowers_the_maximum_below_that_of_thinning():
    problem = MeshProblem("jacksboro:30", objectives=("max_error", "triangles"))
    result = minimize(problem, memetic(12), Moves(60_000), seed=1)
    by_thinning = thinning(problem.surface)
    for error, triangles in result.F:
        fitting = (by_thinning.triangles > 0) & (by_thinning.triangles <= triangles)
        assert error <= by_thinning.error[fitting].min() * (1 + 1e-9) or triangles > result.F[:, 1].max() / 2
    at = [(result.F[result.F[:, 1] <= size, 0].min(), size) for size in (20, 40, 80)]
    thin = [by_thinning.error[(by_thinning.triangles > 0) & (by_thinning.triangles <= size)].min() for _, size in at]
    assert np.mean([error / other for (error, _), other in zip(at, thin, strict=True)]) < 0.95


@pytest.mark.parametrize("measure", ["error", "rms_error", "max_error"])
def test_a_bounded_surface_s_error_is_what_exceeds_the_bound_whatever_the_measure(measure):
    rated = surface(MODELS["terrain"], measure=measure)
    kept = rated.pinned.copy()
    kept[::5] = True
    deviation = rated.simplify(kept).deviation
    bound = float(np.median(deviation))
    front = thinning(rated.bounded(bound), kept=kept)
    assert front.error[-1] == pytest.approx(np.maximum(deviation - bound, 0.0).sum())
    live = LiveTriangulation(rated.bounded(bound), kept)
    assert live.error == pytest.approx(front.error[-1])
    v = int(np.flatnonzero(kept & ~rated.pinned)[0])
    tried = live.try_remove(v)[0]
    assert tried == pytest.approx(live.remove(v))


@pytest.mark.parametrize("measure", ["error", "rms_error", "max_error"])
def test_what_begins_a_mesh_is_tried_as_it_is_done(measure):
    model = build_model(load("horseshoe:120"), up="z")
    live = LiveTriangulation(surface(model, measure=measure), surface(model).pinned)
    assert (live.triangles, live.error) == (0, np.inf)
    begins = [v for v in np.flatnonzero(~live.kept) if live.try_insert(int(v))[1] > 0]
    assert live.try_insert(int(begins[0])) == (-np.inf, 1)
    assert live.insert(int(begins[0])) == -np.inf
    assert np.isfinite(live.error)


@pytest.mark.filterwarnings("ignore:.* belong to no face")
@pytest.mark.parametrize("measure", ["error", "max_error"])
def test_where_thinning_ends_before_an_error_no_removal_holds_it_though_outlines_change_what_others_cost(measure):
    rng = np.random.default_rng(3)
    heights = rng.normal(size=(20, 20)).cumsum(0).cumsum(1) * 0.03
    heights[rng.random(heights.shape) < 0.2] = np.nan
    rated = surface(build_model(grid_source(heights, 1.0, 1.0), up="z"), measure=measure)
    most = 0.3 if measure == "max_error" else 10.0
    front = thinning(rated, most_error=most)
    live = LiveTriangulation(rated, front.kept(0))
    assert live.error <= most
    left = [live.try_remove(int(v))[0] for v in np.flatnonzero(live.kept & ~rated.pinned)]
    assert live.error + min(left) > most
    assert live.triangles < len(rated.faces) / 2
