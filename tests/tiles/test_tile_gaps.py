"""Tiles of grids with gaps: scattered samples that are missing, islands, a void over many tiles."""

import itertools
import json
from dataclasses import asdict

import numpy as np
import pytest

from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.opening import open_grid, open_model
from meshsimp_pymoo.search import coarse
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.tiles import front as front_module
from meshsimp_pymoo.tiles.front import InMemory, _Phases, identity, tiled_front
from meshsimp_pymoo.tiles.gaps import _samples, blocks_of, thin_with_gaps
from meshsimp_pymoo.tiles.thin import hull_levels
from meshsimp_pymoo.workers import Serial

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*belong to no face"),
    pytest.mark.usefixtures("sketched", "few_moves"),
]

HEIGHTS = open_grid(build_model(load("jacksboro:3"))).heights
Y, X = np.mgrid[: HEIGHTS.shape[0], : HEIGHTS.shape[1]]


def _without(gone):
    return np.where(gone, np.nan, HEIGHTS)


KINDS = {
    "scattered": _without(np.random.default_rng(1).random(X.shape) < 0.2),
    # nine tiles, of which none is whole; nothing but a ring is left
    "a void": _without((abs(X - 67) < 48) & (abs(Y - 57) < 38)),
    "islands": _without(np.sin(X / 11.0) * np.sin(Y / 9.0) < 0.2),
}


SLOW = pytest.mark.slow


@pytest.fixture(
    scope="module", params=["scattered", pytest.param("a void", marks=SLOW), pytest.param("islands", marks=SLOW)]
)
def found(request):
    """Return the heights, the tiled front and the surface of the same grid in one piece."""
    z = KINDS[request.param]
    return z, tiled_front(open_grid(z), tile=64), HeightSurface(build_model(grid_source(z), up="z"))


def test_every_row_has_the_numbers_that_its_mesh_has_in_one_piece(found):
    _, front, whole = found
    row_of = np.argsort(whole.model.source_index)
    assert (np.diff(front.F[:, 1]) > 0).all()
    assert (np.diff(front.F[:, 0]) < 0).all()
    assert front.F[0, 1] <= 4
    assert front.F[-1, 1] == pytest.approx(0.1 * len(whole.faces), rel=0.15)
    rows = range(0, len(front), 4)
    kept = np.zeros((len(rows), whole.n_vertices), bool)
    for k, row in enumerate(rows):
        kept[k, row_of] = front.kept[row]
    for row, known in zip(rows, whole.evaluate(kept), strict=True):
        assert front.quality[row].error == pytest.approx(known[0], rel=1e-11)
        assert (front.quality[row].triangles, front.quality[row].vertices) == (known[1], known[2])
        assert front.quality[row].uncovered == known[5]
    nested = front._kept
    thinned = [nested.subset(row) for row in range(len(front)) if nested.moved[row] is None]
    assert len(thinned) > 10
    for few, more in itertools.pairwise(thinned):
        assert len(few) < len(more)
        assert np.isin(few, more).all()


def test_above_some_hundred_triangles_it_is_as_good_as_thinning_in_one_piece(found):
    _, front, whole = found
    thinned = thinning(whole)
    order = np.argsort(thinned.triangles, kind="stable")
    triangles, error = thinned.triangles[order], np.minimum.accumulate(thinned.error[order])
    large = front.F[:, 1] > 300
    excess = front.F[large, 0] / error[np.searchsorted(triangles, front.F[large, 1], side="right") - 1] - 1
    assert large.sum() >= 5
    assert excess.max() < 0.05
    assert excess.mean() < 0.02


def test_a_mesh_of_nearly_any_size_is_made(found):
    _, front, _ = found
    for wanted, least in ((40, 30), (333, 320), (700, 690)):
        solution = front.best(triangles=wanted)
        assert least <= solution.triangles <= wanted
        assert len(solution.mesh.faces) == solution.triangles
    with pytest.raises(LookupError, match="has at most 0 triangles; the least is"):
        front.best(triangles=0)


@pytest.mark.parametrize("footprint", ["model", pytest.param("hull", marks=SLOW)])
def test_the_rules_of_the_front_are_those_asked_for(footprint):
    z, rules = KINDS["a void"][:, :70], Rules(footprint=footprint, outside="ignore")
    front = tiled_front(open_grid(z), tile=64, rules=rules)
    whole = HeightSurface(build_model(grid_source(z), up="z"), rules)
    row_of = np.argsort(whole.model.source_index)
    for row in {len(front) // 2, len(front) - 1}:  # what nothing covers costs nothing, so there may be few
        kept = np.zeros(whole.n_vertices, bool)
        kept[row_of] = front.kept[row]
        assert asdict(front.quality[row]) == pytest.approx(asdict(whole.simplify(kept).quality), rel=1e-9, nan_ok=True)


def test_rules_belong_to_what_stored_tiles_are_of_where_there_are_gaps():
    hull = Rules(footprint="hull")
    assert identity(open_grid(KINDS["a void"])) != identity(open_grid(KINDS["a void"]), rules=hull)
    assert identity(open_grid(HEIGHTS)) == identity(open_grid(HEIGHTS), rules=hull)


# ------------------------------------------------------------------------------------------------------------ a tile


def test_a_tile_of_all_is_thinned_as_the_whole_in_one_piece():
    model = build_model(grid_source(KINDS["scattered"][:30, :40]), up="z")
    grid = open_grid(model)  # whose heights count from the least: rounding decides ties
    gone, level = thin_with_gaps(_phases(grid).task((0, 29, 0, 39), 1, np.inf, None))
    whole = thinning(HeightSurface(model))
    wanted = model.source_index[whole.order[::-1]]
    # behind the last point of the hull nothing is saved
    assert grid.rows_of_samples(gone).tolist() == wanted[: len(gone)].tolist()
    assert len(gone) > 0.95 * len(wanted)
    assert whole.triangles[: len(whole.order) - len(gone) + 1].min() == whole.triangles[len(whole.order) - len(gone)]
    assert np.isfinite(level).all()


def test_what_tiles_share_stays_and_empty_ones_are_left_out():
    grid = open_grid(KINDS["islands"])
    work = _phases(grid)
    kept = np.flatnonzero(np.isfinite(KINDS["islands"].ravel()))
    kept = kept[grid.lattice.at(*np.divmod(kept, grid.shape[1]))]
    for box in work.boxes(0.0, 1):
        top, bottom, left, right = box
        gone, _ = thin_with_gaps(work.task(box, 1, np.inf, kept))
        row, column = np.divmod(gone, grid.shape[1])
        assert np.isin(gone, kept).all()
        assert ((row > top) | (top == 0)).all()
        assert ((row < bottom) | (bottom == grid.shape[0] - 1)).all()
        assert ((column > left) | (left == 0)).all()
        assert ((column < right) | (right == grid.shape[1] - 1)).all()
    alone = np.full((200, 200), np.nan)
    alone[:40, :40], alone[170:, 150:] = 1.0, 2.0
    assert len(_phases(open_grid(alone)).boxes(0.0, 1)) == 2
    assert tiled_front(open_grid(alone), tile=64)[0].triangles <= 4


def test_a_sample_on_a_shared_side_stays_though_all_its_faces_are_in_the_other_tile():
    z = np.random.default_rng(1).normal(size=(64, 128))
    z[:, 65:80] = np.nan
    grid = open_grid(z)
    gone, _ = thin_with_gaps(_phases(grid).task((0, 63, 64, 127), 1, np.inf, np.flatnonzero(np.isfinite(z.ravel()))))
    assert len(gone) > 1500
    assert (np.divmod(gone, 128)[1] > 64).all()


def test_the_first_and_the_last_sample_of_a_shared_side_are_sites_that_others_have():
    z = np.zeros((64, 128))
    z[:9, 60:70] = np.nan
    grid = open_grid(z)
    kept = np.union1d(grid.corners, [20 * 128 + 30, 40 * 128 + 90, 9 * 128 + 64])
    number, *_, is_site, is_ours = _samples(_phases(grid).task((0, 63, 64, 127), 1, np.inf, kept))
    sites = dict(zip(number[is_site].tolist(), is_ours[is_site].tolist(), strict=True))
    assert sites == {127: True, 9 * 128 + 64: True, 40 * 128 + 90: True, 63 * 128 + 64: False, 63 * 128 + 127: True}


def test_vertices_along_a_void_that_tiles_do_not_see_across_may_go():
    """Beside a void circles are large; what they hold of it beyond the tile is known to be empty."""
    z = np.random.default_rng(1).normal(size=(128, 128))
    z[:, 40:110] = np.nan
    grid = open_grid(z)
    there = (np.random.default_rng(2).random(z.shape) < 0.02) & (np.arange(128) < 40)
    there[::12, 39] = True
    there.ravel()[grid.corners] = True
    gone, _ = thin_with_gaps(_phases(grid).task((32, 96, 0, 41), 1, np.inf, np.flatnonzero(there)))
    assert np.isin([48 * 128 + 39, 60 * 128 + 39, 72 * 128 + 39], gone).all()


def test_blocks_know_where_samples_are():
    z = KINDS["islands"]
    found = blocks_of(open_grid(z))
    assert found.before[:, -1].sum() == np.diff(found.before, axis=1).sum()
    some = np.array([[np.isfinite(z[i : i + 8, j : j + 8]).any() for j in range(0, z.shape[1], 8)]
                     for i in range(0, z.shape[0], 8)])  # fmt: skip
    np.testing.assert_array_equal(np.diff(found.before, axis=1), some)
    assert blocks_of(open_grid(HEIGHTS)) is None


def _phases(grid):
    return _Phases(grid, 64, Serial(), InMemory(), lambda *_: None)


def test_levels_of_a_front_whose_triangles_come_and_go():
    # the first step makes a triangle and is good; the third saves none, but costs less than nothing
    levels = hull_levels(np.array([0, -1, 2, 2, 3, 3]), np.array([5.0, 3.0, 5.0, 4.0, 6.0, 7.0]))
    np.testing.assert_allclose(levels, [-0.5, -0.5, -0.5, 2.0, np.inf])
    np.testing.assert_allclose(hull_levels(np.array([0, 0, 1]), np.array([5.0, 4.0, 6.0])), [0.0, 2.0])
    assert hull_levels(np.array([0, -1]), np.array([5.0, 6.0])).tolist() == [np.inf]


# ---------------------------------------------------------------------------------------- that it comes to its end


def test_where_nothing_may_go_tiles_grow_until_there_is_one(monkeypatch):
    monkeypatch.setattr(front_module, "thin_with_gaps", _nothing_in_many(thin_with_gaps))
    front = tiled_front(open_grid(KINDS["a void"][:40, :100]), tile=64)
    assert front[0].triangles <= 4
    assert len(front) > 10


def _nothing_in_many(thin):
    def work(tile):
        gone, level = thin(tile)
        is_all = tile.columns[-1] == 99 and tile.columns[0] == 0
        return (gone, level) if tile.sites is None or is_all else (gone[:0], level[:0])

    return work


# ------------------------------------------------------------------------------------------------------ from the shell


def command(path, out, *more):
    call = ["simplify", str(path), "-o", str(out), "--tile", "64", "--triangles", "300", "--meshes", "2"]
    return [*call, "--threads", "1", "--quiet", "--no-page", "--spacing", "30,20", *more]


@pytest.mark.slow  # as test_a_call_that_was_stopped_writes_the_same_bytes, and with processes
def test_two_processes_write_the_same_bytes(tmp_path, all_moves):
    path = tmp_path / "gaps.npy"
    np.save(path, KINDS["scattered"][:20])
    for jobs in ("1", "2"):
        assert main(command(path, tmp_path / jobs, "--jobs", jobs)) == 0
    same_bytes(tmp_path / "1", tmp_path / "2")


def same_bytes(one, other):
    for file in ("front.csv", "front.npz", "chosen.ply"):
        assert (one / file).read_bytes() == (other / file).read_bytes(), file


def test_a_call_that_was_stopped_writes_the_same_bytes_and_its_folder_is_read_again(tmp_path, monkeypatch):
    path = tmp_path / "gaps.npy"
    np.save(path, np.where(np.isnan(KINDS["scattered"]), -9999.0, KINDS["scattered"])[:20].astype(np.float32))
    assert main(command(path, tmp_path / "1", "--jobs", "1", "--nodata=-9999")) == 0
    done = []

    def stop(tile):
        done.append(tile)
        if len(done) == 5:
            raise KeyboardInterrupt
        return thin_with_gaps(tile)

    monkeypatch.setattr(front_module, "thin_with_gaps", stop)
    assert main(command(path, tmp_path / "2", "--jobs", "1", "--nodata=-9999")) == 130
    assert main(command(path, tmp_path / "2", "--jobs", "1", "--nodata=-9999")) == 0
    same_bytes(tmp_path / "1", tmp_path / "2")
    record = json.loads((tmp_path / "1" / "run.json").read_text())["model"]
    model = open_model(path, open_grid(path, spacing=(30, 20), nodata=-9999).options)
    assert (record["vertices"], record["triangles"]) == (model.n_vertices, len(model.faces))
    again = Front.load(tmp_path / "1")
    assert again[-1].kept.sum() == again.quality[-1].vertices
    scored = again.surface.score(np.asarray(again[5].mesh.vertices), np.asarray(again[5].mesh.faces))
    assert scored.quality.error == pytest.approx(again.quality[5].error, rel=1e-6)


def test_who_asks_for_fewer_triangles_than_there_can_be_is_told_the_least(tmp_path, capsys):
    np.save(tmp_path / "corner.npy", np.where((X < 30) & (Y < 20), HEIGHTS, np.nan)[:40, :50])
    call = [*command(tmp_path / "corner.npy", tmp_path / "out", "--jobs", "1"), "--triangles", "1"]
    assert main(call) == 1
    assert "the least is 2; ask for 2 or more (--triangles N)" in capsys.readouterr().err


@pytest.mark.slow
def test_pieces_of_a_grid_with_gaps_and_its_page_are_written(tmp_path, capsys):
    np.save(tmp_path / "gaps.npy", KINDS["islands"])
    call = ["simplify", str(tmp_path / "gaps.npy"), "-o", str(tmp_path / "out"), "--tile", "64", "--pieces"]
    assert main([*call, "--pick", "knee", "--meshes", "2", "--jobs", "1", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert len(list((tmp_path / "out" / "chosen").iterdir())) > 3
    assert (tmp_path / "out" / "report.html").exists()
    assert summary["model"]["vertices"] == open_grid(KINDS["islands"]).n_vertices
    assert main(["score", str(tmp_path / "gaps.npy"), str(next((tmp_path / "out" / "meshes").iterdir()))]) == 0


@pytest.mark.slow
def test_the_smallest_meshes_are_moved_over_gaps(monkeypatch):
    monkeypatch.setattr(coarse, "MOVES", 40)
    front = tiled_front(open_grid(KINDS["a void"]), tile=64, most=400)
    moved = [row for row, new in enumerate(front._kept.moved) if new is not None]
    assert len(moved) > 10
    whole = HeightSurface(build_model(grid_source(KINDS["a void"]), up="z"))
    thinned = thinning(whole)
    excess = [
        front.F[row, 0] / thinned.error[thinned.triangles <= front.F[row, 1]].min() - 1
        for row in moved
        if front.F[row, 1] > 20
    ]
    assert np.mean(excess) < -0.05
