"""The error of subsets: against its definition, against known answers, and by the independent referee."""

from __future__ import annotations

import importlib.util
import pickle

import numpy as np
import pytest
from delaunay import faces_of
from hypothesis import assume, given
from hypothesis import strategies as st
from samples import BODIES, SMALL, stepped_model, subset, surface

from meshsimp_pymoo.datasets import load, names
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.surface.measures import ERROR, OBJECTIVES, TRIANGLES, UNCOVERED, measured
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES
from meshsimp_pymoo.surface.score import mesh_deviation

RULES = [(f, o) for f in FOOTPRINTS for o in OUTSIDES]


@pytest.fixture(scope="module", params=SMALL)
def model(request):
    return build_model(SMALL[request.param](), up="z")


# ------------------------------------------------------------------------------------------------ slow twin


def twin(model, kept, footprint, outside):
    """Error, triangles and uncovered vertices by the definition: every triangle looks at every vertex."""
    rows = np.flatnonzero(kept)
    xy, z = model.points[:, :2], model.points[:, 2]
    faces = peeled(xy, rows[faces_of(model.xy[rows])], 1e-9 * np.hypot(*np.ptp(xy, axis=0)))
    if footprint == "model":
        faces = [f for f in faces if inside_mesh(model, xy[f].mean(axis=0))]
    cost = np.full(len(xy), np.inf)
    for f in faces:
        w = weights(xy[f], xy)
        inside = w.min(axis=1) >= -1e-9
        cost[inside] = np.minimum(cost[inside], np.abs(w @ z[f] - z)[inside])
    bare = np.flatnonzero(np.isinf(cost))
    for p in bare:
        cost[p] = min(nearest(xy, z, f, p) for f in faces)[1] if outside == "nearest" else 0.0
    return cost.sum(), len(faces), len(bare)


def weights(triangle, points):
    """Barycentric coordinates (..., 3) of points (..., 2)."""
    a, b, c = triangle
    u, v, p = b - a, c - a, np.asarray(points) - a
    area = u[0] * v[1] - u[1] * v[0]
    wb = (p[..., 0] * v[1] - p[..., 1] * v[0]) / area
    wc = (u[0] * p[..., 1] - u[1] * p[..., 0]) / area
    return np.stack([1 - wb - wc, wb, wc], axis=-1)


def nearest(xy, z, face, p):
    """Squared distance in the plane (rounded, so that the order of faces decides ties), and distance in space."""
    best = (np.inf, np.inf)
    for a, b in ((face[0], face[1]), (face[1], face[2]), (face[2], face[0])):
        edge = xy[b] - xy[a]
        t = np.clip((xy[p] - xy[a]) @ edge / (edge @ edge), 0, 1)
        gap = ((xy[a] + t * edge - xy[p]) ** 2).sum()
        height = (1 - t) * z[a] + t * z[b]
        if gap < best[0] * (1 - 1e-12):
            best = (gap, np.hypot(np.sqrt(gap), height - z[p]))
    return best


def peeled(xy, faces, height):
    faces = [tuple(f) for f in faces]
    while True:
        edges = {(f[k], f[(k + 1) % 3]) for f in faces for k in range(3)}
        sliver = [
            f
            for f in faces
            if any((f[(k + 1) % 3], f[k]) not in edges for k in range(3)) and lowest_height(xy[list(f)]) < height
        ]
        if not sliver:
            return [np.array(f) for f in faces]
        faces = [f for f in faces if f not in sliver]


def lowest_height(t):
    area = abs(np.linalg.det([t[1] - t[0], t[2] - t[0]]))
    return area / max(np.linalg.norm(t[k] - t[k - 1]) for k in range(3))


def inside_mesh(model, point):
    return any(weights(model.points[f, :2], point).min() >= -1e-12 for f in model.faces)


@pytest.mark.parametrize(("footprint", "outside"), RULES)
@pytest.mark.parametrize("share", [0.05, 0.3, 0.8])
def test_the_kernel_equals_the_definition(model, footprint, outside, share):
    kept = subset(model, share)
    error, triangles, bare = twin(model, kept, footprint, outside)
    row = surface(model, footprint=footprint, outside=outside).evaluate(kept)[0]
    assert row[TRIANGLES] == triangles
    assert row[UNCOVERED] == bare
    # The twin breaks ties between nearest points its own way, up to rounding.
    assert row[ERROR] == pytest.approx(error, rel=1e-9)


# ------------------------------------------------------------------------------------------- known answers


def test_everything_kept_has_no_error(model):
    row = surface(model).evaluate(np.ones(model.n_vertices, bool))[0]
    assert row[UNCOVERED] == 0
    assert row[ERROR] == 0


@pytest.mark.parametrize("axes", [[0, 1], [1, 0]])
def test_a_bay_within_the_last_cells_of_the_unit_square_is_no_part_of_the_model(axes):
    xy = np.array([[0, 0], [1, 0], [0.95, 0.5], [1, 1], [0, 1]])[:, axes]
    faces = np.array([[0, 1, 2], [0, 2, 4], [2, 3, 4]])
    model = build_model(SourceMesh(np.column_stack([xy, np.zeros(5)]), faces, {}, "bay"), up="z")
    assert surface(model).evaluate(np.ones(5, bool))[0, TRIANGLES] == 3


def test_a_roof_of_four_triangles_is_exact_and_of_two_loses_its_ridge():
    roof = build_model(load("roof:17"))
    corners = np.isin(np.arange(roof.n_vertices), roof.corners)
    flat = surface(roof).evaluate(corners)[0]
    heights = roof.points[:, 2]
    assert (flat[TRIANGLES], flat[ERROR]) == (2, heights.sum())
    ridge = np.flatnonzero(heights == heights.max())
    ends = ridge[[np.argmin(roof.points[ridge, 1]), np.argmax(roof.points[ridge, 1])]]
    kept = corners.copy()
    kept[ends] = True
    folded = surface(roof).evaluate(kept)[0]
    assert (folded[TRIANGLES], folded[ERROR]) == (4, 0)


def test_a_dropped_corner_costs_its_distance_in_space():
    elevation = np.zeros((2, 2))
    elevation[0, 0] = 12.0
    square = build_model(grid_source(elevation, 5.0, 5.0), up="z")
    peak = int(np.argmax(square.points[:, 2]))
    kept = np.ones(4, bool)
    kept[peak] = False
    q = surface(square).simplify(kept).quality
    assert (q.triangles, q.uncovered) == (1, 1)
    # The nearest point of the remaining triangle is the middle of its long side.
    assert q.error == pytest.approx(np.hypot(5 / np.sqrt(2), 12))
    assert surface(square, outside="ignore").simplify(kept).quality.error == 0


def test_quality_numbers_are_those_of_the_deviation(model):
    result = surface(model).simplify(subset(model, 0.2))
    d, q = result.deviation, result.quality
    assert q.error == pytest.approx(d.sum())
    assert q.mean_error == pytest.approx(d.mean())
    assert q.rms_error == pytest.approx(np.sqrt((d**2).mean()))
    assert q.max_error == d.max()
    assert q.uncovered == (~result.covered).sum()
    assert (q.triangles, q.vertices) == (len(result.faces), len(np.unique(result.faces)))


@pytest.mark.parametrize("kept_rows", [[], [0], [0, 1]])
def test_fewer_than_three_vertices_are_no_mesh(kept_rows):
    plane = build_model(load("plane:5"))
    kept = np.zeros(plane.n_vertices, bool)
    kept[kept_rows] = True
    row = surface(plane).evaluate(kept)[0]
    assert (row[ERROR], row[TRIANGLES], row[UNCOVERED]) == (np.inf, 0, 25)
    with pytest.raises(ValueError, match="span no triangle"):
        surface(plane).simplify(kept)


def test_subsets_of_another_length_are_refused():
    plane = surface("plane:5")
    with pytest.raises(ValueError, match="25 vertices has as many entries, not 24"):
        plane.evaluate(np.ones((3, 24), bool))
    with pytest.raises(ValueError, match=r"has shape \(25,\)"):
        plane.simplify(np.ones(24, bool))


# ---------------------------------------------------------------------------------------------------- laws


@pytest.mark.parametrize("n_threads", [1, 2, 5])
def test_a_population_is_its_members_on_any_number_of_threads(model, n_threads):
    X = np.array([subset(model, share, seed) for seed, share in enumerate(np.linspace(0.02, 1, 23))])
    table = surface(model).evaluate(X, threads=n_threads)
    for kept, row in zip(X, table, strict=True):
        np.testing.assert_array_equal(row, surface(model).evaluate(kept)[0])


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.02, 1.0), name=st.sampled_from(sorted(SMALL)))
def test_the_listing_of_the_vertices_does_not_matter(seed, share, name):
    source = SMALL[name]()
    order = np.random.default_rng(seed).permutation(len(source.points))
    place = np.argsort(order)
    shuffled = SourceMesh(source.points[order], place[source.faces], {}, "shuffled")
    one, other = build_model(source, up="z"), build_model(shuffled, up="z")
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.source_index, source.rows[order[other.source_index]])
    np.testing.assert_array_equal(one.corners, other.corners)
    kept = subset(one, share, seed)
    assume(np.isfinite(surface(one).evaluate(kept)[0, 0]))  # so few that they span nothing
    first, second = surface(one).simplify(kept), surface(other).simplify(kept)
    np.testing.assert_array_equal(first.faces, second.faces)
    assert first.quality == second.quality


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0])
@pytest.mark.parametrize(("scale", "shift"), [(1.0, 1e7), (1e-6, 0.0), (1e6, -1e9), (1.0, 0.0)])
def test_shifted_scaled_and_turned_models_have_the_same_objectives(scale, shift, angle):
    source = load("face:500")
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    moved = SourceMesh(source.points @ turn.T * scale + shift * np.array([1, -1, 0]), source.faces, {}, "moved")
    one, other = build_model(source, up="z"), build_model(moved, up="z")
    rng = np.random.default_rng(1)
    for share in (0.05, 0.3, 0.9):
        rows = rng.random(len(source.points)) < share
        rows[one.source_index[one.corners]] = True
        rows[other.source_index[other.corners]] = True
        a = surface(one).simplify(rows[one.source_index]).quality
        b = surface(other).simplify(rows[other.source_index]).quality
        assert (a.triangles, a.vertices, a.uncovered) == (b.triangles, b.vertices, b.uncovered)
        assert b.error == pytest.approx(a.error * scale, rel=1e-6 if shift else 1e-9)


@pytest.mark.parametrize("angle", [0.1, 0.5, np.pi / 6])
def test_a_turned_grid_has_no_slivers_and_no_uncovered_border(angle):
    grid = grid_source(np.random.default_rng(0).random((12, 17)), 1.0, 1.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    model = build_model(SourceMesh(grid.points @ turn.T, grid.faces, {}, "turned"), up="z")
    for footprint in FOOTPRINTS:
        everything = surface(model, footprint=footprint).simplify(np.ones(model.n_vertices, bool)).quality
        assert (everything.triangles, everything.uncovered) == (2 * 11 * 16, 0)
    corners = surface(model, outside="ignore").simplify(np.isin(np.arange(model.n_vertices), model.corners)).quality
    assert (corners.triangles, corners.uncovered) == (2, 0)


@pytest.mark.parametrize("width", [1e-8, 1e-7, 1e-3])
def test_strips_that_are_nearly_a_line_are_triangulated(width):
    rng = np.random.default_rng(2)
    x = np.sort(rng.random(40))
    points = np.column_stack([np.r_[x, x], np.r_[np.zeros(40), np.full(40, width)], rng.random(80)])
    faces = [[i, i + 1, 40 + i] for i in range(39)] + [[i + 1, 41 + i, 40 + i] for i in range(39)]
    model = build_model(SourceMesh(points, np.array(faces), {}, "strip"), up="z")
    for share in (0.1, 0.5, 1.0):
        q = surface(model).simplify(subset(model, share)).quality
        assert q.triangles >= 2
        assert np.isfinite(q.error)


def test_points_1e_15_apart_are_told_apart():
    base = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1.0], [0.5 + 1e-15, 0.5, 3.0]], float)
    faces = np.array([[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 3, 4], [2, 4, 5], [3, 0, 4]])
    model = build_model(SourceMesh(base, faces, {}, "close"), up="z")
    everything = surface(model).simplify(np.ones(6, bool)).quality
    assert (everything.triangles, everything.vertices, everything.error) == (6, 6, 0)
    kept = np.ones(6, bool)
    kept[np.argmax(model.points[:, 2])] = False
    assert surface(model).simplify(kept).quality.error == pytest.approx(2.0)


def test_vertices_at_one_position_all_count_and_the_first_kept_carries_the_surface():
    base = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 5.0], [1, 1, 9.0]], float)
    faces = np.array([[0, 1, 4], [1, 2, 5], [2, 3, 5], [3, 0, 4]])
    model = stepped_model(SourceMesh(base, faces, {}, "cliff"))
    low, high = (int(np.flatnonzero(model.points[:, 2] == h)[0]) for h in (5.0, 9.0))
    assert low == high + 1, "the highest of a place comes first"
    kept = np.ones(6, bool)
    assert surface(model).simplify(kept).quality.error == 4.0
    np.testing.assert_array_equal(surface(model).simplify(kept).deviation[[low, high]], [4, 0])
    kept[high] = False
    np.testing.assert_array_equal(surface(model).simplify(kept).deviation[[low, high]], [0, 4])
    kept[low] = False
    assert surface(model).simplify(kept).quality.error == 14.0


@pytest.mark.parametrize("name", ["ring", "horseshoe", "holey"])
def test_the_default_footprint_bridges_no_hole_and_no_bay(name):
    model = build_model(SMALL[name](), up="z")
    xy = model.points[:, :2]
    for share in (0.1, 0.5, 1.0):
        kept = subset(model, share)
        for face in surface(model).simplify(kept).faces:
            assert inside_mesh(model, xy[face].mean(axis=0))
        whole = surface(model, footprint="hull").simplify(kept).quality
        assert whole.triangles > surface(model).simplify(kept).quality.triangles


def test_a_model_pickles_without_its_caches():
    model = build_model(load("face:300"))
    kept = subset(model, 0.3)
    before = surface(model).simplify(kept)
    small = pickle.dumps(build_model(load("face:300")))
    again = pickle.dumps(model)
    assert len(again) == len(small)
    np.testing.assert_array_equal(surface(pickle.loads(again)).simplify(kept).faces, before.faces)


# ------------------------------------------------------------------------------------------------- weights


def weights_of(model, seed=3):
    """One weight for each row of the file, a fifth of them 0."""
    rng = np.random.default_rng(seed)
    n_rows = model.source_index.max() + 1
    return rng.uniform(0.1, 3.0, n_rows) * (rng.random(n_rows) < 0.8)


@pytest.mark.parametrize(("footprint", "outside"), RULES)
def test_weighted_numbers_are_the_weighted_sum_means_and_maximum_of_the_deviation(model, footprint, outside):
    weighted = model.with_weights(weights_of(model))
    w = weights_of(model)[model.source_index]
    kept = subset(model, 0.2)
    plain = surface(model, footprint=footprint, outside=outside).simplify(kept)
    d = plain.deviation
    result = surface(weighted, footprint=footprint, outside=outside).simplify(kept)
    np.testing.assert_array_equal(result.faces, plain.faces)
    np.testing.assert_array_equal(result.deviation, d)
    q = result.quality
    assert q.error == pytest.approx((w * d).sum())
    assert q.mean_error == pytest.approx(np.average(d, weights=w))
    assert q.rms_error == pytest.approx(np.sqrt(np.average(d**2, weights=w)))
    assert q.max_error == d[w > 0].max()
    assert q.uncovered == plain.quality.uncovered
    row = surface(weighted, footprint=footprint, outside=outside).evaluate(kept)[0]
    for name in OBJECTIVES:
        assert measured(row, name, weighted.total_weight) == getattr(q, name)
    if footprint == "model":
        again = surface(weighted, outside=outside).score(model.file_points, result.faces).quality
        assert again.error == pytest.approx(q.error)
        assert again.rms_error == pytest.approx(q.rms_error)
        assert again.max_error == pytest.approx(q.max_error)


def test_weights_of_one_change_nothing_and_twice_the_weight_is_twice_the_error(model):
    X = np.array([subset(model, share) for share in (0.05, 0.3, 0.8)])
    table = surface(model).evaluate(X)
    n_rows = model.source_index.max() + 1
    np.testing.assert_array_equal(surface(model.with_weights(np.ones(n_rows))).evaluate(X), table)
    np.testing.assert_array_equal(surface(model.with_weights(np.ones(n_rows, int))).evaluate(X), table)
    double = surface(model.with_weights(np.full(n_rows, 2.0))).evaluate(X)
    np.testing.assert_array_equal(double, table * np.array([2, 1, 1, 2, 1, 1]))


# ------------------------------------------------------------------------------------- the independent referee


@pytest.fixture(scope="module")
def referee(oracle):
    spec = importlib.util.spec_from_file_location("vertical_error", oracle)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.vertical_error


def assert_referee_agrees(referee, model, shares, rules=RULES):
    """Compare in the frame where heights are along z."""
    points = model.points
    for footprint, outside in rules:
        for share in shares:
            result = surface(model, footprint=footprint, outside=outside).simplify(subset(model, share, 7))
            error, bare, cost = referee(points, points, result.faces, outside)
            assert result.quality.error == pytest.approx(error, rel=1e-6)
            assert result.quality.uncovered == bare
            again, covered = mesh_deviation(surface(model, outside=outside).ground(), points, result.faces)
            np.testing.assert_allclose(again, cost, rtol=1e-6, atol=1e-9 * model.diagonal)
            assert (~covered).sum() == bare


@pytest.mark.parametrize("name", [n for n in names() if n not in ("jacksboro", "topobathy", *BODIES)])
def test_the_referee_agrees_on_built_in_models(referee, name):
    assert_referee_agrees(referee, build_model(load(name)), [0.03, 0.5])


@pytest.mark.parametrize("name", ["jacksboro:11", "topobathy:24"])
def test_the_referee_agrees_on_terrain(referee, name):
    assert_referee_agrees(referee, build_model(load(name)), [0.03, 0.5])


@pytest.mark.parametrize(
    "name",
    [
        *"m1_laurana m2_demosthenes m3_nefertiti m4_skull m5_celticskull m6_igea t_matteo500 f_humface".split(),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("f_maxplanck", "f_mask_holes", "l_laurana_front")),
    ],
)
def test_the_referee_agrees_on_real_scans(referee, shared_data, name):
    assert_referee_agrees(referee, build_model(read_source(shared_data / f"{name}.ply")), [0.05, 0.4])


def test_the_referee_agrees_on_a_terrain_with_nodata(referee, shared_data):
    with np.load(shared_data / "dem_sthelens.npz", allow_pickle=False) as stored:
        source = grid_source(stored["elevation"][::6, ::6], float(stored["dx"]) * 6, float(stored["dy"]) * 6)
    assert_referee_agrees(referee, build_model(source), [0.03, 0.3])


def test_a_hole_is_seen_although_an_overlap_makes_up_for_its_area():
    grid = grid_source(np.zeros((12, 12)), 1.0, 1.0)
    corner = grid.points[grid.faces].mean(axis=1)[:, :2] - grid.points[:, :2].min(axis=0)
    hole = (np.floor(corner) == [6, 6]).all(axis=1)
    double = grid.faces[(np.floor(corner) == [2, 2]).all(axis=1)]
    rows, inverse = np.unique(double, return_inverse=True)
    copy = len(grid.points) + inverse.reshape(-1, 3)
    points = np.vstack([grid.points, grid.points[rows] + [0, 0, 1]])
    patched = SourceMesh(points, np.vstack([grid.faces[~hole], copy]), {}, "patched")
    with pytest.warns(ModelWarning, match="folded over"):
        model = stepped_model(patched)
    everything = surface(model).simplify(np.ones(model.n_vertices, bool)).quality
    assert everything.triangles == 2 * 11 * 11 - 2


def test_vertices_far_from_a_long_outline_are_found_at_once():
    """A comb with everything kept in one corner: most vertices are bare and their nearest segment is far away."""
    side = 60
    elevation = np.zeros((side, side))
    elevation[2:, 2::3] = np.nan
    model = build_model(grid_source(elevation, 1.0, 1.0), up="z")
    kept = (model.points[:, :2] < side / 4).all(axis=1)
    kept[model.corners] = True
    row = surface(model, footprint="hull").evaluate(kept)[0]
    faces = surface(model, footprint="hull").simplify(kept).faces
    again = surface(model).score(model.file_points, faces)
    assert row[ERROR] == pytest.approx(again.quality.error)


@pytest.mark.parametrize("dtype", [float, int, object])
def test_subsets_that_are_not_bool_are_refused(dtype):
    plane = build_model(load("plane:5"))
    with pytest.raises(TypeError, match="bool array"):
        surface(plane).evaluate(np.ones((2, 25), dtype))
    with pytest.raises(TypeError, match="bool array"):
        surface(plane).simplify(np.ones(25, dtype))
