from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from pymoo.optimize import minimize
from samples import surface

from meshsimp_pymoo import MeshProblem, RandomSubset, memetic
from meshsimp_pymoo.errors import SearchWarning
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.search import starting
from meshsimp_pymoo.search.budgets import seconds_given
from meshsimp_pymoo.search.greedy import NestedFront, can_insert, greedy_insertion, thinning
from meshsimp_pymoo.search.starting import Start, at_hand, begun, thinned


def rough(side, seed=1):
    """Return the surface of random heights on a full grid: thinning it is real work."""
    return surface(open_model(grid_source(np.random.default_rng(seed).random((side, side)))))


def scattered(side, seed=1):
    """Return the surface of as many random heights anywhere."""
    x, y, z = np.random.default_rng(seed).random((3, side * side))
    corners = [[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]]
    return surface(open_model(cloud_source(np.vstack([corners, np.column_stack([x, y, z])[4:]]))))


each_kind = pytest.mark.parametrize("make", [rough, scattered])


def nested(base, order, triangles, n=9):
    error = np.linspace(1.0, 0.0, len(triangles))
    return NestedFront(np.array(base), np.array(order, int), error, np.array(triangles), n)


def same_meshes(front, start, of_start):
    """Check that rows of a start are meshes whose numbers are those of the surface itself."""
    X = np.array([start.kept(int(k)) for k in of_start])
    table = front.evaluate(X)
    np.testing.assert_array_equal(table[:, 1], start.triangles[of_start])
    np.testing.assert_allclose(table[:, 0], start.error[of_start], rtol=1e-9, atol=1e-9)


def test_fronts_one_above_the_other_lose_what_the_next_one_has():
    small = nested([0, 1, 2], [3, 4, 5], [1, 2, 4, 6])
    middle = nested([0, 1, 2, 4], [5, 6], [4, 5, 7])
    large = nested([0, 1, 2, 3, 4, 5, 6], [7, 8], [8, 9, 10])
    start = Start.of(small, middle, large)
    assert start.triangles.tolist() == [1, 2, 4, 5, 7, 8, 9, 10]
    assert len(start) == len(start.error) == 8
    kept = [np.flatnonzero(start.kept(k)).tolist() for k in (1, 2, 4, 7)]
    assert kept == [[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 4, 5, 6], list(range(9))]
    assert str(start) == "meshes of 1 to 2, 4 to 7, 8 to 10 triangles"
    assert not start.is_whole
    assert Start.of(large, small).triangles.tolist() == [1, 2, 4, 6]  # what begins larger than the next one is gone
    with pytest.raises(ValueError, match="no subset 8; there are 8"):
        start.kept(8)


def test_without_a_limit_it_is_the_thinning_once_for_a_surface(monkeypatch):
    model = rough(12)
    start, whole = thinned(model), thinning(model)
    assert start.is_whole
    assert start.parts[0].order.tobytes() == whole.order.tobytes()
    assert start.error.tobytes() == whole.error.tobytes()
    monkeypatch.setattr(starting, "thinning", None)
    assert thinned(model) is start
    assert thinned(model, 1e-9) is start


@each_kind
def test_where_thinning_takes_too_long_what_insertion_finds_is_thinned(monkeypatch, make):
    model = make(60)
    monkeypatch.setattr(starting, "SECONDS_A_REMOVAL", 1.0)
    with pytest.warns(SearchWarning, match=r"0.6 s are too short to thin all 3,600 vertices; .* from meshes of \d"):
        start = thinned(model, 0.6)
    assert not start.is_whole
    assert begun(model) is start
    assert thinned(model, 0.6) is start  # what there is
    assert thinned(model, 0.5) is start
    assert (np.diff(start.triangles) >= 0).all()
    same_meshes(model, start, np.unique(np.linspace(0, len(start) - 1, 20).astype(int)))
    # for a longer search it is not enough, and that is said again
    with pytest.warns(SearchWarning, match=r"0.7 s are too short"):
        longer = thinned(model, 0.7)
    assert longer is not start
    assert at_hand(model, 3600.0) is longer is begun(model)  # the end of a search takes what there is
    # without a limit neither
    again = thinned(model)
    assert again.is_whole
    assert again.error.tobytes() == thinning(model).error.tobytes()


def test_a_grid_is_scanned_as_far_as_there_is_time_to_thin_what_is_found(monkeypatch):
    model = surface(open_model("jacksboro:4"))
    monkeypatch.setattr(starting, "SECONDS_A_REMOVAL", 0.01)
    monkeypatch.setattr(starting, "greedy_insertion", None)
    with pytest.warns(SearchWarning, match=r"from meshes of 2 to [34],\d\d\d triangles"):
        start = thinned(model, 170.0)  # of 85 s 42.5 are for thinning: 1 700 of 8 686 vertices
    assert len(start.parts) == 1
    same_meshes(model, start, np.unique(np.linspace(0, len(start) - 1, 30).astype(int)))
    whole = thinning(model)
    for share in (0.01, 0.02, 0.05, 0.1):
        most = 2 * share * model.n_vertices
        best = [front.error[front.triangles <= most].min() for front in (whole, start)]
        assert best[1] < 1.06 * best[0]


def test_a_grid_with_gaps_is_scanned_with_its_outline(monkeypatch):
    heights = np.random.default_rng(1).random((40, 50)).cumsum(axis=0)
    heights[10:20, 15:30] = np.nan
    heights[:8, :9] = np.nan
    model = surface(open_model(grid_source(heights)))
    monkeypatch.setattr(starting, "SECONDS_A_REMOVAL", 0.02)  # 1 s of time for each vertex thinned
    monkeypatch.setattr(starting, "greedy_insertion", None)
    with pytest.warns(SearchWarning, match="too short"):
        start = thinned(model, 60.0)
    same_meshes(model, start, np.unique(np.linspace(0, len(start) - 1, 30).astype(int)))
    order, n_first = starting._inserted_by_scanning(model, 0.3, np.zeros(2, bool))
    assert n_first == np.count_nonzero(model.pinned | np.isin(np.arange(model.n_vertices), model.border))
    assert len(order) == int(0.3 * model.n_vertices)
    assert np.isin(model.border, order[:n_first]).all()


def test_what_is_no_grid_or_does_not_count_the_sum_is_not_scanned():
    how = 0.5, np.zeros(2, bool)
    assert starting._inserted_by_scanning(scattered(9), *how) is None
    assert starting._inserted_by_scanning(rough(9).measuring("max_error"), *how) is None
    assert starting._inserted_by_scanning(rough(9).measuring("rms_error"), *how) is not None


def test_scanning_is_ended_by_a_flag_and_the_start_has_small_meshes_even_so():
    model = rough(150)
    whole, n_first = starting._inserted_by_scanning(model, 1.0, np.zeros(2, bool))
    order, _ = starting._inserted_by_scanning(model, 1.0, np.ones(2, bool))
    assert n_first <= len(order) < len(whole)
    assert np.array_equal(order, whole[: len(order)])
    start = starting._begin(model, np.ones(2, bool), np.inf)
    assert start.triangles[0] == 2
    assert sum(2 < size < 6_000 for size in start.triangles) > 100  # though Ctrl-C came before


def test_some_subsets_of_an_order_are_a_front_of_some_sizes():
    model = rough(12)
    order, _ = starting._inserted_by_scanning(model, 1.0, np.zeros(2, bool))
    front = starting._some(model, order, 10, 100)
    assert front.count[0] == 10
    assert front.count[-1] == 100
    assert front.kept(0).sum() == 10
    part = front.smallest(4)
    assert len(part) == 4
    np.testing.assert_array_equal(part.kept(3), front.kept(3))


def test_insertion_thinned_back_is_near_thinning():
    model = surface(open_model("jacksboro:8"))
    whole = thinning(model)
    inserted = greedy_insertion(model, choose="triangle", most=int(0.3 * model.n_vertices))
    back = thinning(model, kept=inserted.kept(len(inserted) - 1))
    for share in (0.01, 0.02, 0.05):
        most = 2 * share * model.n_vertices
        best = [front.error[front.triangles <= most].min() for front in (whole, back)]
        assert best[1] < 1.06 * best[0]


@each_kind
def test_the_clock_ends_thinning_and_the_small_meshes_come_from_insertion(monkeypatch, make):
    model = make(70)
    monkeypatch.setattr(starting, "SECONDS_A_REMOVAL", 1e-9)  # thought to be in time
    real = starting.thinning

    def slow(surface, *, stop, kept=None):
        if kept is not None:
            return real(surface, kept=kept, stop=stop)
        while not stop[0]:
            time.sleep(0.001)
        return real(surface, least=6_000)

    monkeypatch.setattr(starting, "thinning", slow)
    with pytest.warns(SearchWarning, match="too short"):
        start = thinned(model, 0.4)
    large = real(model, least=6_000)
    assert start.parts[-1].order.tobytes() == large.order.tobytes()
    assert start.triangles[0] == 2
    same_meshes(model, start, np.unique(np.geomspace(1, len(start), 20).astype(int) - 1))


def test_pinned_vertices_that_span_nothing_leave_thinning_alone(monkeypatch, recwarn):
    model, other = rough(20), scattered(20)
    model.pinned[:] = False
    assert [can_insert(model), can_insert(other)] == [False, True]
    monkeypatch.setattr(starting, "SECONDS_A_REMOVAL", 1.0)
    start = thinned(model, 20.0)  # it is done long before
    assert start.is_whole
    assert not recwarn
    assert start.error.tobytes() == thinning(model).error.tobytes()
    # another fault is none of those vertices': it is not taken for one

    def broken(*_, **__):
        raise ValueError("something else")

    monkeypatch.setattr(starting, "greedy_insertion", broken)
    with pytest.raises(ValueError, match="something else"):
        thinned(other, 20.0)


@each_kind
def test_ctrl_c_before_the_first_removal_is_not_lost(make):
    start = starting._begin(make(20), np.ones(2, bool), np.inf)
    assert not start.is_whole
    assert len(start.parts[-1]) == 1  # all vertices, and what insertion finds
    assert start.triangles[0] == 2


@each_kind
def test_what_ctrl_c_has_left_is_for_no_later_search(monkeypatch, make):
    model = make(20)
    real = starting.thinning

    def interrupted(surface, *, stop, kept=None):
        stop[:] = True  # as `on_threads` does
        return real(surface, kept=kept, stop=stop)

    with monkeypatch.context() as patch:
        patch.setattr(starting, "thinning", interrupted)
        left = starting._made(model, 3600.0)
    assert begun(model) is left
    assert not left.is_whole
    assert at_hand(model, 1.0) is left
    assert thinned(model, 3600.0).is_whole


def test_a_search_by_time_begins_with_fewer_meshes_where_time_is_short(monkeypatch):
    from meshsimp_pymoo.search import memetic as module

    problem = MeshProblem("face:400")
    monkeypatch.setattr(module, "SECONDS_A_VERTEX", problem.elementwise_runner.n_threads * 0.001 / problem.n_var)
    monkeypatch.setattr(starting, "SECONDS_A_REMOVAL", 1.0)
    seen = []
    real = module.MemeticSearch._initialize_infill
    monkeypatch.setattr(module.MemeticSearch, "_initialize_infill", lambda self: seen.append(real(self)) or seen[-1])
    with pytest.warns(SearchWarning, match="too short"):
        result = minimize(problem, memetic(100), ("time", 0.3), seed=1)
    assert 8 <= len(seen[0]) <= 45  # each takes a thousandth second: 45 in 15 % of the time
    assert seconds_given(result.algorithm) == 0.3
    assert result.F[:, 1].min() >= 1
    assert seconds_given(minimize(problem, memetic(10), ("n_gen", 1), seed=1).algorithm) is None


def test_a_search_by_time_that_began_otherwise_makes_in_the_end_what_its_end_has_time_for(monkeypatch, recwarn):
    problem, given = MeshProblem("face:400"), []
    real = starting._begin
    monkeypatch.setattr(starting, "SECONDS_A_REMOVAL", 1.0)
    monkeypatch.setattr(starting, "_begin", lambda *how: given.append(how[-1]) or real(*how))
    minimize(problem, memetic(12, sampling=RandomSubset()), ("time", 0.4), seed=1)
    assert len(given) == 1
    assert given[0] < 0.2  # seconds that are left
    assert not recwarn  # nothing starts from it


@pytest.mark.parametrize("method", [thinning, greedy_insertion])
def test_a_flag_that_is_set_ends_them_at_once_and_later_they_are_the_beginning_of_the_whole(method):
    model = rough(90)
    set_before = method(model, stop=np.ones(1, bool))
    assert (len(set_before), len(set_before.order)) == (1, 0)
    stop = np.zeros(1, bool)
    timer = threading.Timer(0.01, lambda: stop.__setitem__(0, True))
    timer.start()
    part, whole = method(model, stop=stop), method(model)
    timer.join()
    assert len(part) < len(whole)
    own = slice(len(whole) - len(part), None) if method is thinning else slice(len(part))
    assert part.error.tobytes() == whole.error[own].tobytes()
    assert part.triangles.tobytes() == whole.triangles[own].tobytes()
    for k in (0, len(part) // 2, len(part) - 1):
        other = k + (own.start or 0)
        np.testing.assert_array_equal(part.kept(k), whole.kept(other))
