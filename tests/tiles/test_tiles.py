"""Tiles: what a tile may do, how tiles come together, and that a call goes on where it stopped."""

import itertools
import json

import numpy as np
import pytest
from cracks import find_cracks
from hypothesis import given
from hypothesis import strategies as st

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ResultError, SearchWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.opening import count_samples, open_grid, open_model
from meshsimp_pymoo.search.coarse import SEARCHED, CoarseGrid, move, slope_of
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.settings import LARGEST
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import MEASURES, quality_of
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.weld import measure, pieces, weld
from meshsimp_pymoo.tiles.front import Folder, InMemory, _Phases, cut_axis, identity, tiled_front
from meshsimp_pymoo.tiles.thin import hull_levels, start_tile, thin_tile
from meshsimp_pymoo.workers import Processes, Serial

MODEL = build_model(load("jacksboro:3"))
GRID = open_grid(MODEL)
SURFACE = HeightSurface(MODEL)
STRIP = open_grid(GRID.heights[:20])  # two tiles
SMALL = build_model(load("jacksboro:12"))
SMALL_GRID = open_grid(SMALL)


def subset(grid, share, seed):
    kept = np.random.default_rng(seed).random(grid.n_vertices) < share
    kept[grid.corners] = True
    return np.flatnonzero(kept)


def as_chromosome(grid, samples):
    kept = np.zeros(grid.n_vertices, bool)
    kept[grid.row_of[samples]] = True
    return kept


@pytest.fixture(scope="module")
def front():
    return tiled_front(GRID, tile=64)


@pytest.fixture(scope="module")
def strip_front():
    return tiled_front(STRIP, tile=64)


# --------------------------------------------------------------------------------------------------------- the grid


def test_a_grid_has_its_samples_where_the_model_of_the_same_heights_has_them(tmp_path):
    z = np.random.default_rng(1).normal(size=(23, 31)).astype(np.float32)
    np.save(tmp_path / "z.npy", z)
    grid = open_grid(tmp_path / "z.npy", spacing=(0.1, 0.7))
    assert isinstance(grid.heights, np.memmap)
    model = open_model(tmp_path / "z.npy", Options(spacing=(0.1, 0.7)))
    number = model.source_index
    assert np.array_equal(grid.xy_at(number), model.xy)
    assert np.array_equal(grid.file_points[number], model.file_points)
    again = open_grid(model)
    assert np.array_equal(again.row_of[number], np.arange(len(number)))
    assert np.array_equal(again.xy_at(number), model.xy)
    assert again.samples_of_rows(number).tolist() == number.tolist()
    assert count_samples(tmp_path / "z.npy") == 23 * 31


def test_the_size_of_an_ascii_grid_is_read_from_its_header(tmp_path):
    (tmp_path / "z.asc").write_text("NCOLS 4000\nNROWS 3000\nXLLCORNER 0\nYLLCORNER 0\nCELLSIZE 1\n")
    assert count_samples(tmp_path / "z.asc") == 12_000_000
    assert count_samples("jacksboro") is None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda z: np.where(z == z[5, 7], np.inf, z), r"the height at row 5, column 7 is infinite; set it to NaN"),
        (lambda z: np.where(z == z[5, 7], z, np.nan), r"only 1 of 713 samples have data and no cell has three"),
        (lambda z: z * np.nan, r"only 0 of 713 samples have data"),
        (lambda z: z[0], r"shape \(31,\); give a grid"),
        (lambda z: z.astype(complex), r"type complex128"),
    ],
)
def test_what_is_no_grid_is_refused(make, message):
    z = np.random.default_rng(1).normal(size=(23, 31))
    with pytest.raises(ModelError, match=message):
        tiled_front(open_grid(make(z)), tile=64)


def test_a_height_that_means_no_sample_is_none():
    z = np.arange(70.0, dtype=np.float32).reshape(7, 10)
    assert open_grid(z, nodata=34).n_vertices == 69
    assert open_grid(z, nodata=34).hash == open_grid(np.where(z == 34, np.nan, z)).hash != open_grid(z).hash
    assert open_grid(z, nodata=-LARGEST).hash == open_grid(z).hash  # beyond what its heights can be


def test_a_scan_a_weighted_model_and_a_broken_file_are_refused(tmp_path):
    with pytest.raises(ModelError, match="are not those of a height grid"):
        open_grid(build_model(load("face:200")))
    with pytest.raises(ModelError, match="has weights"):
        open_grid(SMALL.with_weights(np.full(SMALL.n_vertices, 2.0)))
    (tmp_path / "z.npy").write_bytes(b"\x93NUMPY nonsense")
    with pytest.raises(ModelError, match="is not a NumPy array file"):
        open_grid(tmp_path / "z.npy")


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"patch": "front"}, "all of a grid faces up; leave patch='front' out"),
        ({"up": "-z"}, "heights of a grid are along z; leave up='-z' out"),
        ({"max_edge": 3.0}, "max_edge and classes describe point clouds"),
    ],
)
def test_what_says_nothing_of_a_grid_is_refused(tmp_path, how, message):
    heights = np.random.default_rng(1).random((5, 6))
    np.save(tmp_path / "z.npy", heights)
    for grid in (heights, tmp_path / "z.npy"):
        with pytest.raises(ModelError, match=message):
            open_grid(grid, **how)


@pytest.mark.parametrize("how", [{"spacing": 2.0}, {"up": "z"}, {"nodata": -9999.0}])
def test_a_grid_or_a_model_that_is_open_already_is_not_read_in_another_way(how):
    with pytest.raises(ModelError, match="is a grid that is open already"):
        open_grid(SMALL_GRID, **how)
    with pytest.raises(ModelError, match="is a model that was read already"):
        open_grid(SMALL, **how)


# --------------------------------------------------------------------------------------------------------- the mesh


@given(share=st.sampled_from([0.0, 0.01, 0.1, 0.5, 1.0]), seed=st.integers(0, 2**32))
def test_a_welded_mesh_is_the_triangulation_of_the_whole_with_its_error(share, seed):
    samples = subset(SMALL_GRID, share, seed)
    mesh = weld(SMALL_GRID, samples)
    whole = HeightSurface(SMALL).simplify(as_chromosome(SMALL_GRID, samples))
    assert np.array_equal(SMALL_GRID.row_of[mesh.samples][mesh.faces], whole.faces)
    quality = measure(SMALL_GRID, mesh, n_threads=1 + seed % 3)
    for name in ("error", "triangles", "vertices", "mean_error", "rms_error", "max_error"):
        assert getattr(quality, name) == pytest.approx(getattr(whole.quality, name), rel=1e-9, abs=1e-9)
    assert find_cracks(mesh.xy, mesh.faces) == 0


def test_the_number_of_threads_does_not_change_a_bit_of_the_error():
    mesh = weld(GRID, subset(GRID, 0.02, 1))
    assert len({measure(GRID, mesh, n_threads=n) for n in (1, 2, 5)}) == 1


def test_pieces_are_the_mesh_and_meet_without_cracks():
    mesh = weld(GRID, subset(GRID, 0.05, 2))
    parts = list(pieces(GRID, mesh.samples[mesh.faces], 40))
    assert len({name for name, _ in parts}) == len(parts) >= 9
    faces = np.concatenate([faces for _, faces in parts])
    assert sorted(map(tuple, faces.tolist())) == sorted(map(tuple, mesh.samples[mesh.faces].tolist()))
    assert find_cracks(GRID.xy_at(np.arange(GRID.n_vertices)), faces) == 0


def test_a_crack_and_a_vertex_on_an_edge_are_found():
    mesh = weld(SMALL_GRID, subset(SMALL_GRID, 0.1, 3))
    assert find_cracks(mesh.xy, mesh.faces) == 0
    assert find_cracks(mesh.xy, np.delete(mesh.faces, len(mesh.faces) // 2, axis=0)) >= 1
    torn = mesh.faces.copy()
    inside = np.flatnonzero(((mesh.xy[torn] > 0.05) & (mesh.xy[torn] < 0.7)).all(axis=(1, 2)))[0]
    torn[inside, 0] = len(mesh.xy)  # the same corner, but a vertex of its own
    assert find_cracks(np.vstack([mesh.xy, mesh.xy[mesh.faces[inside, 0]]]), torn) == 4


def test_a_mesh_without_a_corner_is_refused():
    with pytest.raises(ValueError, match="lack a corner"):
        weld(SMALL_GRID, np.arange(1, 50))


# --------------------------------------------------------------------------------------------------------- a tile


@given(
    share=st.sampled_from([0.03, 0.2, 0.6, 1.0]),
    seed=st.integers(0, 2**32),
    limit=st.sampled_from([5.0, 60.0, np.inf]),
    side=st.sampled_from([(30, 90), (0, 60), (60, 114)]),
)
def test_what_tiles_remove_changes_the_error_of_the_whole_by_what_they_say(share, seed, limit, side):
    """Several tiles at once, each for itself: the sum of their levels is the change of the whole."""
    kept = subset(GRID, share, seed)
    work = _Phases(GRID, 64, Serial(), InMemory(), lambda *_: None)
    change, removed = 0.0, []
    low, high = side
    for left, right in itertools.pairwise([0, 50, 100, GRID.shape[1] - 1]):
        gone, level = thin_tile(work.task((low, high, left, right), 1, limit, kept))
        row, column = np.divmod(gone, GRID.shape[1])
        on_side = (row == 0) | (row == GRID.shape[0] - 1) | (column == 0) | (column == GRID.shape[1] - 1)
        assert (np.diff(level) >= 0).all()
        assert (level <= limit).all()
        assert ((row > low) | (low == 0)).all()
        change += float(np.sum(level * np.where(on_side, 1, 2)))
        removed.append(gone)
    removed = np.concatenate(removed)
    assert len(np.unique(removed)) == len(removed)
    assert np.isin(removed, kept).all()
    rest = np.setdiff1d(kept, removed)
    table = SURFACE.evaluate(np.array([as_chromosome(GRID, kept), as_chromosome(GRID, rest)]))
    assert table[1, 0] - table[0, 0] == pytest.approx(change, rel=1e-6, abs=1e-6 * table[1, 0])
    if share >= 0.2 and limit == np.inf:
        assert len(removed) > 0.4 * share * GRID.shape[1] * (high - low)


@pytest.mark.parametrize("inserted", [0.2, 1.0])
def test_tiles_that_begin_are_thinned_as_parts_of_the_whole(inserted):
    """Along borders that have all their samples: the sum of the levels up to a slope is the change of the whole."""
    work = _Phases(GRID, 64, Serial(), InMemory(), lambda *_: None)
    found = [
        start_tile(work.task((top, bottom, left, right), 1, np.inf, None, inserted))
        for top, bottom in itertools.pairwise([0, 57, GRID.shape[0] - 1])
        for left, right in itertools.pairwise([0, 50, 100, GRID.shape[1] - 1])
    ]
    samples, level = (np.concatenate(column) for column in zip(*found, strict=True))
    candidates = np.unique(samples)
    assert len(candidates) == GRID.n_vertices if inserted == 1.0 else len(candidates) < 0.21 * GRID.n_vertices
    assert np.isinf(level[np.isin(samples, samples[np.isinf(level)])]).all()  # fixed in one tile, fixed in all
    for slope in (3.0, 40.0):
        gone = level <= slope
        rest = np.setdiff1d(candidates, samples[gone])
        assert len(rest) < len(candidates)
        table = SURFACE.evaluate(np.array([as_chromosome(GRID, candidates), as_chromosome(GRID, rest)]))
        change = 2.0 * float(level[gone].sum())
        assert table[1, 0] - table[0, 0] == pytest.approx(change, rel=1e-6, abs=1e-6 * table[1, 0])


def test_a_tile_that_holds_all_is_thinned_as_the_whole():
    work = _Phases(SMALL_GRID, 512, Serial(), InMemory(), lambda *_: None)
    box = (0, SMALL_GRID.shape[0] - 1, 0, SMALL_GRID.shape[1] - 1)
    gone, _ = thin_tile(work.task(box, 1, np.inf, np.arange(SMALL_GRID.n_vertices)))
    assert SMALL_GRID.row_of[gone].tolist() == thinning(HeightSurface(SMALL)).order[::-1].tolist()


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=30), st.floats(-6, 6))
def test_a_hull_cut_at_a_slope_is_the_best_point_of_the_front_for_it(steps, slope):
    error = np.concatenate([[0.0], np.cumsum(steps)])
    level = hull_levels(np.arange(len(error)), error)
    at = int(np.searchsorted(level, slope, side="right"))
    lagrangian = error - slope * np.arange(len(error))
    assert lagrangian[at] <= lagrangian.min() + 1e-9


# --------------------------------------------------------------------------------------------------------- the front


def kept_samples(front, row):
    return np.flatnonzero(front.kept[row])


def test_every_solution_but_the_smallest_is_a_subset_of_the_finer_one_and_all_have_the_error_that_is_said(front):
    triangles = front.F[:, 1]
    assert (np.diff(triangles) > 0).all()
    assert (np.diff(front.F[:, 0]) < 0).all()
    assert triangles[-1] > 0.08 * len(GRID.faces)
    assert triangles[0] == 2
    moved = [new is not None for new in front._kept.moved]
    assert moved == ((triangles <= SEARCHED) & (triangles > 2)).tolist()
    for row in range(len(front) - 1):
        if not moved[row]:
            assert np.isin(kept_samples(front, row), kept_samples(front, row + 1)).all() or triangles[row] == 2
    rows = range(0, len(front), 5)
    table = SURFACE.evaluate(np.array([as_chromosome(GRID, kept_samples(front, row)) for row in rows]))
    for row, found in zip(rows, table, strict=True):
        assert found[0] == pytest.approx(front.quality[row].error, rel=1e-9)
        assert found[1] == front.quality[row].triangles


def test_tiles_lose_at_most_three_percent_against_thinning_in_one_piece():
    """Below some hundred triangles, where thinning is a matter of luck, moved vertices are better by far."""
    model = build_model(load("jacksboro:2"))
    front, whole = tiled_front(open_grid(model), tile=64), thinning(HeightSurface(model))
    excess = front.F[:, 0] / np.interp(front.F[:, 1], whole.triangles, whole.error) - 1
    assert excess.max() < 0.03
    assert excess[(front.F[:, 1] > 2) & (front.F[:, 1] <= SEARCHED)].mean() < -0.05
    assert excess[front.F[:, 1] > 3000].max() < 0.01
    assert excess.mean() < 0.01


@pytest.mark.parametrize("wanted", [2, 3, 100, 275, 1234, 2900])
def test_any_size_can_be_taken_out_of_the_front(front, wanted):
    found = front.best(triangles=wanted)
    assert 0.9 * wanted - 2 <= found.triangles <= wanted
    assert (np.diff(found.front.F[:, 1]) > 0).all()
    nested = found.front._kept
    thinned = nested.rows[nested.level > nested.slope[found.solution]]
    assert found.error <= measure(GRID, weld(GRID, GRID.samples_of_rows(thinned))).error
    again = found.front.best(triangles=wanted)
    assert again.front is found.front
    assert again.solution == found.solution
    kept = as_chromosome(GRID, np.flatnonzero(found.kept))
    assert SURFACE.evaluate(kept[None])[0, 0] == pytest.approx(found.error, rel=1e-9)
    assert len(found.mesh.faces) == found.triangles


@pytest.mark.parametrize("name", ["mean_error", "rms_error", "max_error"])
def test_the_smallest_within_an_error_lies_between_two_solutions(front, name):
    values = np.array([getattr(solution, name) for solution in front])
    # the first solution after the middle that is better than all before it
    row = next(k for k in range(len(front) // 2, len(front)) if values[k] < values[:k].min())
    limit = 0.5 * (values[row] + values[:row].min())
    smaller, larger = front[row - 1], front[row]
    found = front.best(**{name: limit})
    assert getattr(found, name) <= limit
    assert smaller.triangles < found.triangles <= larger.triangles
    assert name == "max_error" or found.triangles < larger.triangles
    both = front.best(triangles=larger.triangles, **{name: limit})
    assert (getattr(both, name) <= limit, both.triangles <= larger.triangles) == (True, True)


def test_moving_the_vertices_lowers_the_error_and_keeps_the_corners_and_the_size(front):
    coarse = CoarseGrid(GRID)
    assert len(coarse.samples) <= 1 << 13
    assert np.isin(GRID.corners, coarse.samples).all()
    row = front.best(triangles=900).solution
    task = coarse.task(kept_samples(front, row), 200)
    rows = move(task)
    assert np.array_equal(move(task), rows)
    moved = weld(GRID, coarse.samples[rows])
    assert 198 <= moved.n_triangles <= 200
    whole = thinning(SURFACE)
    assert measure(GRID, moved).error < 0.97 * np.interp(200, whole.triangles, whole.error)


def test_vertices_are_moved_on_the_grid_that_they_are_of():
    hills = np.random.default_rng(1).normal(size=(2, 9, 30))
    one, other = (CoarseGrid(grid).task(subset(grid, 0.1, 1), 30) for grid in map(open_grid, hills))
    assert one.kept.tolist() == other.kept.tolist()
    moved = move(one)
    assert not np.array_equal(move(other), moved)
    assert np.array_equal(move(one), moved)


def test_vertices_are_moved_only_as_far_as_the_time_goes(front):
    store = InMemory()
    with pytest.warns(SearchWarning) as said:
        late = tiled_front(GRID, tile=64, until=0.0, store=store)
    sizes = {
        name.removeprefix("quality_"): quality_of(zip(MEASURES, piece["numbers"], strict=True)).triangles
        for name, piece in store.pieces.items()
        if name.startswith("quality")
    }
    small = [name for name, size in sizes.items() if 2 < size <= SEARCHED]
    n_large = len(sizes) - len(small) - 1
    assert [str(one.message).partition(": ")[2].partition(", which")[0] for one in said] == [
        f"the time was up before the vertices of {len(small)} of {len(small)} small solutions were moved",
        f"in the time given the vertices of 0 of {n_large} solutions of more than 300 triangles were moved",
    ]
    store.put(f"moved_{small[0]}", samples=GRID.corners)
    with pytest.warns(SearchWarning) as said:
        tiled_front(GRID, tile=64, until=0.0, store=store)
    assert f" {len(small) - 1} of {len(small)} small solutions " in str(said[0].message)
    assert all(moved is None for moved in late._kept.moved)
    assert any(moved is not None for moved in front._kept.moved)
    assert late[0].triangles == front[0].triangles == 2


def test_a_grid_that_is_small_is_looked_at_in_whole_and_a_narrow_one_ends():
    assert np.array_equal(CoarseGrid(SMALL_GRID).samples, np.arange(SMALL_GRID.n_vertices))
    narrow = open_grid(np.random.default_rng(1).normal(size=(2, 30_000)))
    assert len(CoarseGrid(narrow).samples) <= 1 << 13


def test_a_front_that_begins_with_small_meshes_is_thinned_from_finer_ones(front):
    small = tiled_front(GRID, tile=64, most=300)
    assert 200 < small[-1].triangles <= 340
    assert small[-1].triangles == pytest.approx(2 * len(small._kept.rows), rel=0.2)
    whole = thinning(SURFACE)
    assert small[-1].error < 1.03 * np.interp(small[-1].triangles, whole.triangles, whole.error)


def test_a_mesh_of_one_triangle_is_refused_and_none_is_finer_than_the_finest(front):
    with pytest.raises(LookupError, match="no solution of jacksboro:3 has at most 1 triangles; the least is 2"):
        front.best(triangles=1)
    with pytest.raises(ValueError, match="at least 2 triangles, not 1"):
        slope_of(front.surface, front._kept, 1)
    assert front.best(triangles=10**6) == front[-1]


def test_a_plane_is_two_triangles_and_a_roof_four():
    x = np.arange(140.0)
    plane = tiled_front(open_grid(x[:20, None] + 2 * x), tile=64)
    assert [(round(q.error, 6), q.triangles) for q in plane.quality] == [(0.0, 2)]
    roof = tiled_front(open_grid(np.tile(-np.abs(np.arange(129.0) - 64), (20, 1))), tile=64)
    assert (roof[-1].triangles, round(roof[-1].error, 6)) == (4, 0.0)


def test_cliffs_end(front):
    z = np.random.default_rng(1).integers(0, 2, (150, 150)) * 1e9
    blocks = tiled_front(open_grid(np.kron(z[:5, :10], np.ones((15, 15)))), tile=64)
    assert blocks[0].triangles == 2
    assert (np.diff(blocks.F[:, 0]) < 0).all()


def test_tiles_cover_the_axis_and_their_cuts_are_apart():
    for n, tile, shift, stride in itertools.product((5, 64, 97, 200, 1000), (64, 100), (0, 1 / 3, 2 / 3), (1, 2, 4)):
        cuts = cut_axis(n, tile, shift, stride)
        assert (cuts[0], cuts[-1]) == (0, n - 1)
        assert (cuts[1:-1] % stride == 0).all()
        if len(cuts) > 2:
            assert np.diff(cuts).min() >= 0.3 * tile * stride
            assert np.diff(cuts).max() <= 2.3 * tile * stride


@pytest.mark.parametrize(
    ("given_", "message"), [({"tile": 10}, "tile is 10; .* at least 64"), ({"most": 1}, "most is 1; .* 2 triangles")]
)
def test_impossible_settings_are_refused(given_, message):
    with pytest.raises(ValueError, match=message):
        tiled_front(SMALL_GRID, **given_)


# ------------------------------------------------------------------------------------------- engines and going on


class Backwards:
    """Finishes tasks in the wrong order, and stops after some of them if asked to."""

    jobs, shares_files = 3, True

    def __init__(self, most=None):
        self.left = most
        self.done = 0

    def each(self, work, tasks, shared=None):
        for place, task in reversed(list(enumerate(tasks))):
            if self.left is not None and self.done == self.left:
                raise KeyboardInterrupt
            self.done += 1
            yield place, work(task, shared)


def same(a, b):
    one, other = a._kept.arrays(), b._kept.arrays()
    return a.quality == b.quality and all(np.array_equal(one[name], other[name]) for name in one)


def test_the_front_depends_neither_on_the_order_nor_on_the_threads(strip_front):
    assert same(tiled_front(STRIP, tile=64, engine=Backwards(), threads=3), strip_front)


@pytest.mark.slow  # as test_two_processes_write_the_same_bytes
def test_processes_find_the_same_front(strip_front):
    with Processes(2) as engine:
        assert same(tiled_front(STRIP, tile=64, engine=engine), strip_front)


@pytest.mark.slow
def test_a_dask_cluster_finds_the_same_front(strip_front):
    distributed = pytest.importorskip("distributed")
    from meshsimp_pymoo.workers import DaskEngine

    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as cluster,
        DaskEngine(cluster.scheduler_address) as engine,
    ):
        assert same(tiled_front(STRIP, tile=64, engine=engine), strip_front)


def test_a_call_that_was_stopped_goes_on_and_ends_with_the_same_front(strip_front, tmp_path):
    what = identity(STRIP, tile=64)
    total = Backwards()
    tiled_front(STRIP, tile=64, engine=total)
    done = 0
    for most in (3, 7, 20, None):
        engine = Backwards(most)
        try:
            found = tiled_front(STRIP, tile=64, engine=engine, store=Folder(tmp_path / "tiles", what))
        except KeyboardInterrupt:
            assert most is not None
            assert not list((tmp_path / "tiles").glob(".*"))
        done += engine.done
    assert same(found, strip_front)
    assert done <= total.done + 3  # what was in work when it was stopped


def test_damaged_pieces_are_done_again(strip_front, tmp_path):
    what = identity(STRIP, tile=64)
    with pytest.raises(KeyboardInterrupt):
        tiled_front(STRIP, tile=64, engine=Backwards(20), store=Folder(tmp_path, what))
    stored = sorted(tmp_path.glob("*.npz"))
    assert len(stored) >= 3
    for k, path in enumerate(stored):
        data = bytearray(path.read_bytes())
        if k % 2:
            data[len(data) // 2] ^= 0x10
        path.write_bytes(data[: len(data) // 2] if k % 2 == 0 else data)
    assert same(tiled_front(STRIP, tile=64, store=Folder(tmp_path, what)), strip_front)


def test_pieces_of_something_else_are_not_used(tmp_path):
    Folder(tmp_path, identity(GRID, tile=64))
    with pytest.raises(ResultError, match="of another model or of other settings"):
        Folder(tmp_path, identity(GRID, tile=65))
    with pytest.raises(ResultError, match="of another model or of other settings"):
        Folder(tmp_path, identity(SMALL_GRID, tile=64))
    assert json.loads((tmp_path / "what.json").read_text())["tile"] == 64
