"""Vertices of large solutions moved tile by tile."""

from __future__ import annotations

import time
import warnings
from dataclasses import asdict

import numpy as np
import pytest

from meshsimp_pymoo import open_grid, tiled_front
from meshsimp_pymoo.errors import SearchWarning
from meshsimp_pymoo.surface.weld import measure, weld
from meshsimp_pymoo.tiles import front as fronts
from meshsimp_pymoo.tiles import moving
from meshsimp_pymoo.tiles.front import InMemory, _nearest_first, _Phases
from meshsimp_pymoo.tiles.moving import Moving, _beside, _to_move, move_sites
from meshsimp_pymoo.tiles.thin import setting_of
from meshsimp_pymoo.workers import Serial

GRID = open_grid("jacksboro:3")


@pytest.fixture(scope="module")
def front():
    return tiled_front(GRID, tile=64)


@pytest.fixture(scope="module")
def work():
    return _Phases(GRID, 64, Serial(), InMemory(), lambda *_: None)


def kept_of(front, triangles):
    return np.flatnonzero(front.best(triangles=triangles).kept)


def test_a_tile_moves_its_free_sites_alone_and_the_whole_gains_what_it_says(front, work):
    kept = kept_of(front, 1200)
    box = work.boxes(1 / 3, 1)[2]
    tile = work.task(box, 1, np.inf, kept)
    gone, come = move_sites(Moving(tile, 1))
    assert len(gone) > 10
    assert len(come) > 10
    assert np.isin(gone, kept).all()
    assert not np.isin(come, kept).any()
    top, bottom, left, right = box
    for samples in (gone, come):
        row, column = np.divmod(samples, GRID.shape[1])
        assert ((row >= top) & (row <= bottom) & (column >= left) & (column <= right)).all()
        on_shared_side = ((row == top) & (top > 0)) | ((row == bottom) & (bottom < GRID.shape[0] - 1))
        assert not on_shared_side.any()
    moved = np.union1d(np.setdiff1d(kept, gone), come)
    before, after = (measure(GRID, weld(GRID, samples)) for samples in (kept, moved))
    assert after.triangles <= before.triangles
    setting = _to_move(setting_of(tile))
    was = setting.is_site
    now = (was & ~np.isin(setting.number, gone)) | np.isin(setting.number, come)
    change = np.diff(setting.surface.evaluate(np.array([was, now]))[:, 0])[0]
    assert change < 0.0
    # what happens beyond the tile, or on its sides, where it does not look, is little
    assert after.error - before.error == pytest.approx(change, rel=0.1)
    same = move_sites(Moving(tile, 1))
    assert np.array_equal(same[0], gone)
    assert np.array_equal(same[1], come)


def test_all_tiles_together_lower_the_error_by_a_tenth_at_no_more_triangles(front, work):
    kept = kept_of(front, 1500)
    moved = work.moved_by_tiles(kept, 1, np.inf)
    before, after = (measure(GRID, weld(GRID, samples)) for samples in (kept, moved))
    assert after.triangles <= before.triangles
    assert after.error < 0.9 * before.error
    assert np.isin(GRID.corners, moved).all()
    assert work.moved_by_tiles(kept, 1, time.perf_counter()) is None


@pytest.mark.parametrize("stride", [1, 2])
def test_samples_beside_one_are_those_around_it(work, stride):
    kept = np.sort(np.r_[GRID.corners, np.random.default_rng(1).choice(GRID.n_vertices, 300, replace=False)])
    tile = work.task(work.boxes(0.0, stride)[0], stride, np.inf, np.unique(kept))
    setting = setting_of(tile)
    start, beside = _beside(tile, setting.number)
    assert np.array_equal(start, 8 * np.arange(len(setting.number) + 1))
    row, column = np.divmod(setting.number, GRID.shape[1])
    for k in range(len(setting.number)):
        near = beside[start[k] : start[k + 1]]
        distance = np.maximum(np.abs(row[near] - row[k]), np.abs(column[near] - column[k]))
        assert distance.max() <= stride
        inner = tile.rows[0] < row[k] < tile.rows[-1] and tile.columns[0] < column[k] < tile.columns[-1]
        counts = row[k] % stride == 0 and column[k] % stride == 0
        if inner and counts:
            assert len(np.unique(near)) == 8
            assert k not in near


def test_what_is_near_to_the_wish_is_moved_first(front):
    sizes = [q.triangles for q in front.quality]
    assert _nearest_first(front.quality, {}) == list(range(len(front)))
    order = _nearest_first(front.quality, {"triangles": sizes[7]})
    assert order[:3] == [7, 6, 8]
    assert sorted(order) == list(range(len(front)))
    order = _nearest_first(front.quality, {"mean_error": front.quality[5].mean_error})
    assert order[0] == 5
    assert _nearest_first(front.quality, {"max_error": 0.0})[0] == len(front) - 1
    assert _nearest_first(front.quality[::-1], {"triangles": sizes[-3]})[:2] == [2, 3]


def test_a_front_with_time_has_moved_vertices_and_the_size_that_is_wished_for(front, few_moves, monkeypatch, recwarn):
    monkeypatch.setattr(fronts, "MOST_SWEEPS", 1)
    monkeypatch.setattr(moving, "MOVES", 6)
    store, how = InMemory(), {"tile": 64, "wish": {"triangles": 1111}}
    found = tiled_front(GRID, until=time.perf_counter() + 1000.0, store=store, **how)
    assert not recwarn  # all had their turn
    best = found.best(triangles=1111)
    assert 1111 - best.triangles <= 3
    assert best.error < 0.97 * front.best(triangles=1111).error
    # what is moved is kept for a call that goes on
    with pytest.warns(SearchWarning, match="0 of"):
        again = tiled_front(GRID, until=0.0, store=store, **how)
    assert again.F.tobytes() == found.F.tobytes()
    again = measure(GRID, weld(GRID, np.flatnonzero(best.kept)))
    assert asdict(best.quality)["error"] == pytest.approx(again.error, rel=1e-12)


def test_solutions_without_error_are_not_moved():
    begun = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("error", SearchWarning)
        front = tiled_front(open_grid(np.ones((130, 140))), tile=64, until=begun + 600.0)
    assert front.F.tolist() == [[0.0, 2.0]]
    assert time.perf_counter() - begun < 300.0
