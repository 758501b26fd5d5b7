from __future__ import annotations

import importlib.util
import pickle

import numpy as np
import pytest
from delaunay import faces_of
from hypothesis import given, settings
from hypothesis import strategies as st
from samples import holey_grid, subset

from meshsimp_pymoo.datasets import load, names
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.surface.evaluate import evaluate_subsets, simplify
from meshsimp_pymoo.surface.measures import ERROR, TRIANGLES, UNCOVERED, measured
from meshsimp_pymoo.surface.measures import OBJECTIVES as MEASURES
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES
from meshsimp_pymoo.surface.score import mesh_deviation, mesh_quality, mesh_samples

RULES = [(f, o) for f in FOOTPRINTS for o in OUTSIDES]


MODELS = {
    "roof": lambda: load("roof:5"),
    "holey": holey_grid,
    "face": lambda: load("face:150"),
    "ring": lambda: load("ring:120"),
    "horseshoe": lambda: load("horseshoe:120"),
}


@pytest.fixture(scope="module", params=MODELS)
def model(request):
    return build_model(MODELS[request.param](), up="z")


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
    row = evaluate_subsets(model, kept, footprint=footprint, outside=outside)[0]
    assert row[TRIANGLES] == triangles
    assert row[UNCOVERED] == bare
    # The twin breaks ties between nearest points its own way, up to rounding.
    assert row[ERROR] == pytest.approx(error, rel=1e-9)


# ------------------------------------------------------------------------------------------- known answers


def test_everything_kept_has_no_error(model):
    row = evaluate_subsets(model, np.ones(model.n_vertices, bool))[0]
    assert row[UNCOVERED] == 0
    assert row[ERROR] == 0


def test_a_roof_of_four_triangles_is_exact_and_of_two_loses_its_ridge():
    roof = build_model(load("roof:17"))
    corners = np.isin(np.arange(roof.n_vertices), roof.corners)
    flat = evaluate_subsets(roof, corners)[0]
    heights = roof.points[:, 2]
    assert (flat[TRIANGLES], flat[ERROR]) == (2, heights.sum())
    ridge = np.flatnonzero(heights == heights.max())
    ends = ridge[[np.argmin(roof.points[ridge, 1]), np.argmax(roof.points[ridge, 1])]]
    kept = corners.copy()
    kept[ends] = True
    folded = evaluate_subsets(roof, kept)[0]
    assert (folded[TRIANGLES], folded[ERROR]) == (4, 0)


def test_a_dropped_corner_costs_its_distance_in_space():
    elevation = np.zeros((2, 2))
    elevation[0, 0] = 12.0
    square = build_model(grid_source(elevation, 5.0, 5.0), up="z")
    peak = int(np.argmax(square.points[:, 2]))
    kept = np.ones(4, bool)
    kept[peak] = False
    q = simplify(square, kept).quality
    assert (q.triangles, q.uncovered) == (1, 1)
    # The nearest point of the remaining triangle is the middle of its long side.
    assert q.error == pytest.approx(np.hypot(5 / np.sqrt(2), 12))
    assert simplify(square, kept, outside="ignore").quality.error == 0


def test_quality_numbers_are_those_of_the_deviation(model):
    result = simplify(model, subset(model, 0.2))
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
    row = evaluate_subsets(plane, kept)[0]
    assert (row[ERROR], row[TRIANGLES], row[UNCOVERED]) == (np.inf, 0, 25)
    with pytest.raises(ValueError, match="span no triangle"):
        simplify(plane, kept)


def test_unknown_rules_and_wrong_lengths_are_refused():
    plane = build_model(load("plane:5"))
    with pytest.raises(ValueError, match="footprint='bbox' is unknown"):
        evaluate_subsets(plane, np.ones(25, bool), footprint="bbox")
    with pytest.raises(ValueError, match="outside='drop' is unknown"):
        simplify(plane, np.ones(25, bool), outside="drop")
    with pytest.raises(ValueError, match="25 entries"):
        evaluate_subsets(plane, np.ones((3, 24), bool))


# ---------------------------------------------------------------------------------------------------- laws


@pytest.mark.parametrize("n_threads", [1, 2, 5])
def test_a_population_is_its_members_on_any_number_of_threads(model, n_threads):
    X = np.array([subset(model, share, seed) for seed, share in enumerate(np.linspace(0.02, 1, 23))])
    table = evaluate_subsets(model, X, n_threads=n_threads)
    for kept, row in zip(X, table, strict=True):
        np.testing.assert_array_equal(row, evaluate_subsets(model, kept)[0])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.02, 1.0), name=st.sampled_from(sorted(MODELS)))
def test_the_listing_of_the_vertices_does_not_matter(seed, share, name):
    source = MODELS[name]()
    order = np.random.default_rng(seed).permutation(len(source.points))
    place = np.argsort(order)
    shuffled = SourceMesh(source.points[order], place[source.faces], {}, "shuffled")
    one, other = build_model(source, up="z"), build_model(shuffled, up="z")
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.source_index, source.rows[order[other.source_index]])
    np.testing.assert_array_equal(one.corners, other.corners)
    kept = subset(one, share, seed)
    first, second = simplify(one, kept), simplify(other, kept)
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
        a = simplify(one, rows[one.source_index]).quality
        b = simplify(other, rows[other.source_index]).quality
        assert (a.triangles, a.vertices, a.uncovered) == (b.triangles, b.vertices, b.uncovered)
        assert b.error == pytest.approx(a.error * scale, rel=1e-6 if shift else 1e-9)


@pytest.mark.parametrize("angle", [0.1, 0.5, np.pi / 6])
def test_a_turned_grid_has_no_slivers_and_no_uncovered_border(angle):
    grid = grid_source(np.random.default_rng(0).random((12, 17)), 1.0, 1.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    model = build_model(SourceMesh(grid.points @ turn.T, grid.faces, {}, "turned"), up="z")
    for footprint in FOOTPRINTS:
        everything = simplify(model, np.ones(model.n_vertices, bool), footprint=footprint).quality
        assert (everything.triangles, everything.uncovered) == (2 * 11 * 16, 0)
    corners = simplify(model, np.isin(np.arange(model.n_vertices), model.corners), outside="ignore").quality
    assert (corners.triangles, corners.uncovered) == (2, 0)


@pytest.mark.parametrize("width", [1e-8, 1e-7, 1e-3])
def test_strips_that_are_nearly_a_line_are_triangulated(width):
    rng = np.random.default_rng(2)
    x = np.sort(rng.random(40))
    points = np.column_stack([np.r_[x, x], np.r_[np.zeros(40), np.full(40, width)], rng.random(80)])
    faces = [[i, i + 1, 40 + i] for i in range(39)] + [[i + 1, 41 + i, 40 + i] for i in range(39)]
    model = build_model(SourceMesh(points, np.array(faces), {}, "strip"), up="z")
    for share in (0.1, 0.5, 1.0):
        q = simplify(model, subset(model, share)).quality
        assert q.triangles >= 2
        assert np.isfinite(q.error)


def test_points_1e_15_apart_are_told_apart():
    base = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1.0], [0.5 + 1e-15, 0.5, 3.0]], float)
    faces = np.array([[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 3, 4], [2, 4, 5], [3, 0, 4]])
    model = build_model(SourceMesh(base, faces, {}, "close"), up="z")
    everything = simplify(model, np.ones(6, bool)).quality
    assert (everything.triangles, everything.vertices, everything.error) == (6, 6, 0)
    kept = np.ones(6, bool)
    kept[np.argmax(model.points[:, 2])] = False
    assert simplify(model, kept).quality.error == pytest.approx(2.0)


def test_vertices_at_one_position_all_count_and_the_first_kept_carries_the_surface():
    base = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 5.0], [1, 1, 9.0]], float)
    faces = np.array([[0, 1, 4], [1, 2, 5], [2, 3, 5], [3, 0, 4]])
    model = build_model(SourceMesh(base, faces, {}, "cliff"), up="z")
    low, high = (int(np.flatnonzero(model.points[:, 2] == h)[0]) for h in (5.0, 9.0))
    assert high == low + 1
    kept = np.ones(6, bool)
    assert simplify(model, kept).quality.error == 4.0
    np.testing.assert_array_equal(simplify(model, kept).deviation[[low, high]], [0, 4])
    kept[low] = False
    np.testing.assert_array_equal(simplify(model, kept).deviation[[low, high]], [4, 0])
    kept[high] = False
    assert simplify(model, kept).quality.error == 14.0


@pytest.mark.parametrize("name", ["ring", "horseshoe", "holey"])
def test_the_default_footprint_bridges_no_hole_and_no_bay(name):
    model = build_model(MODELS[name](), up="z")
    xy = model.points[:, :2]
    for share in (0.1, 0.5, 1.0):
        kept = subset(model, share)
        for face in simplify(model, kept).faces:
            assert inside_mesh(model, xy[face].mean(axis=0))
        assert simplify(model, kept, footprint="hull").quality.triangles > simplify(model, kept).quality.triangles


def test_a_model_pickles_without_its_caches():
    model = build_model(load("face:300"))
    kept = subset(model, 0.3)
    before = simplify(model, kept)
    small = pickle.dumps(build_model(load("face:300")))
    again = pickle.dumps(model)
    assert len(again) == len(small)
    np.testing.assert_array_equal(simplify(pickle.loads(again), kept).faces, before.faces)


# --------------------------------------------------------------------------------------------- other meshes


@pytest.mark.parametrize("outside", OUTSIDES)
def test_the_error_of_a_written_mesh_is_that_of_its_subset(model, outside):
    for share in (0.05, 0.4):
        result = simplify(model, subset(model, share), outside=outside)
        other = mesh_quality(model, model.file_points, result.faces, outside=outside)
        assert other.error == pytest.approx(result.quality.error, rel=1e-9)
        assert (other.triangles, other.vertices) == (result.quality.triangles, result.quality.vertices)
        assert other.uncovered == result.quality.uncovered


def test_of_folded_triangles_the_closest_counts_and_vertices_may_lie_anywhere():
    plane = build_model(load("plane:5"))
    low = plane.file_points.min(axis=0) - [1, 1, 0]
    high = plane.file_points.max(axis=0) + np.array([1, 1, 0])
    sheet = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    heights = simplify(plane, np.ones(25, bool))  # the plane itself, to know its own heights
    assert heights.quality.error == 0
    z = np.linalg.lstsq(np.c_[plane.file_points[:, :2], np.ones(25)], plane.file_points[:, 2], rcond=None)[0]
    on = np.c_[sheet, np.c_[sheet, np.ones(4)] @ z]
    two_sheets = np.vstack([on + np.array([0, 0, 7.0]), on + np.array([0, 0, -2.0])])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
    q = mesh_quality(plane, two_sheets, faces)
    assert q.error == pytest.approx(2.0 * 25)
    assert (q.uncovered, q.triangles, q.vertices) == (0, 4, 8)


def test_meshes_without_area_or_with_wrong_indices_are_refused():
    plane = build_model(load("plane:5"))
    with pytest.raises(ValueError, match="at least one triangle"):
        mesh_quality(plane, np.zeros((3, 3)), np.zeros((0, 3), int))
    with pytest.raises(ValueError, match="area in the plane"):
        mesh_quality(plane, [[0, 0, 0], [0, 0, 1], [0, 0, 2]], [[0, 1, 2]])
    with pytest.raises(ValueError, match="of 3 vertices"):
        mesh_quality(plane, np.zeros((3, 3)), [[0, 1, 3]])
    with pytest.raises(ValueError, match="not finite"):
        mesh_quality(plane, [[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def test_each_vertex_s_deviation_follows_from_the_heights_that_carry_it(model):
    """Any heights of the mesh's vertices: d_p = hypot(gap, shares . heights - z), covered or not."""
    for outside in OUTSIDES:
        faces = simplify(model, subset(model, 0.15), outside=outside).faces
        moved = model.points + np.random.default_rng(0).normal(0, 5, (model.n_vertices, 1)) * [0, 0, 1]
        samples = mesh_samples(model, moved, faces, outside=outside, frame="local")
        height = (samples.shares * moved[samples.sites, 2]).sum(axis=1)
        deviation, covered, _ = mesh_deviation(model, moved, faces, outside=outside, frame="local")
        charged = samples.shares.any(axis=1)
        np.testing.assert_array_equal(samples.covered, covered)
        np.testing.assert_array_equal(charged, covered | (outside == "nearest"))
        np.testing.assert_allclose(
            np.where(charged, np.hypot(samples.gap, height - model.points[:, 2]), 0.0), deviation, atol=1e-9
        )
        np.testing.assert_allclose(samples.shares[charged].sum(axis=1), 1.0)


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
    plain = simplify(model, kept, footprint=footprint, outside=outside)
    d = plain.deviation
    result = simplify(weighted, kept, footprint=footprint, outside=outside)
    np.testing.assert_array_equal(result.faces, plain.faces)
    np.testing.assert_array_equal(result.deviation, d)
    q = result.quality
    assert q.error == pytest.approx((w * d).sum())
    assert q.mean_error == pytest.approx(np.average(d, weights=w))
    assert q.rms_error == pytest.approx(np.sqrt(np.average(d**2, weights=w)))
    assert q.max_error == d[w > 0].max()
    assert q.uncovered == plain.quality.uncovered
    row = evaluate_subsets(weighted, kept, footprint=footprint, outside=outside)[0]
    for name in MEASURES:
        assert measured(row, name, weighted.total_weight) == getattr(q, name)
    if footprint == "model":
        again = mesh_quality(weighted, model.file_points, result.faces, outside=outside)
        assert again.error == pytest.approx(q.error)
        assert again.rms_error == pytest.approx(q.rms_error)
        assert again.max_error == pytest.approx(q.max_error)


def test_weights_of_one_change_nothing_and_twice_the_weight_is_twice_the_error(model):
    X = np.array([subset(model, share) for share in (0.05, 0.3, 0.8)])
    table = evaluate_subsets(model, X)
    n_rows = model.source_index.max() + 1
    np.testing.assert_array_equal(evaluate_subsets(model.with_weights(np.ones(n_rows)), X), table)
    np.testing.assert_array_equal(evaluate_subsets(model.with_weights(np.ones(n_rows, int)), X), table)
    double = evaluate_subsets(model.with_weights(np.full(n_rows, 2.0)), X)
    np.testing.assert_array_equal(double, table * np.array([2, 1, 1, 2, 1, 1]))


def test_weights_follow_the_rows_of_the_file_or_come_from_it():
    grid = np.arange(12.0).reshape(3, 4)
    elevation = np.random.default_rng(0).random((3, 4))
    elevation[0, 3] = np.nan
    plain = build_model(grid_source(elevation, 1.0, 1.0), up="z")
    model = plain.with_weights(grid)
    np.testing.assert_array_equal(model.weights, plain.source_index)
    source = load("face:150")
    named = SourceMesh(source.points, source.faces, {"importance": np.arange(150, dtype=np.uint16)}, "named")
    model = build_model(named, up="z").with_weights("importance")
    np.testing.assert_array_equal(model.weights, model.source_index)
    assert model.hash != build_model(named, up="z").hash
    assert model.neighbours is not None


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (np.ones(149), "149 weights for 150 rows"),
        (np.full(150, -1.0), r"150 of 150 weights are negative or not finite \(first: row"),
        (np.r_[np.ones(149), np.nan], "row 149, nan"),
        (np.zeros(150), "all 150 weights are 0"),
        (np.array(["x"] * 150), "give one number"),
        ("colour", "no per-vertex attribute 'colour' to weigh by; it has: color, label"),
        ("color", "a weight is one number"),
        ("label", "a weight is one number"),
    ],
)
def test_what_cannot_be_weights_is_refused(weights, message):
    source = load("face:150")
    attributes = {"color": np.zeros((150, 4), np.uint8), "label": np.array(["a"] * 150)}
    model = build_model(SourceMesh(source.points, source.faces, attributes, "labelled"), up="z")
    with pytest.raises(ModelError, match=message):
        model.with_weights(weights)


def test_an_unknown_measure_is_refused():
    with pytest.raises(ValueError, match="measure='mean' is unknown; choose one of 'error'"):
        measured(np.zeros(6), "mean", 1.0)


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
            result = simplify(model, subset(model, share, 7), footprint=footprint, outside=outside)
            error, bare, cost = referee(points, points, result.faces, outside)
            assert result.quality.error == pytest.approx(error, rel=1e-6)
            assert result.quality.uncovered == bare
            again, covered, _ = mesh_deviation(model, points, result.faces, outside=outside, frame="local")
            np.testing.assert_allclose(again, cost, rtol=1e-6, atol=1e-9 * model.diagonal)
            assert (~covered).sum() == bare


@pytest.mark.parametrize("name", [n for n in names() if n not in ("jacksboro", "topobathy")])
def test_the_referee_agrees_on_built_in_models(referee, name):
    assert_referee_agrees(referee, build_model(load(name)), [0.03, 0.5])


@pytest.mark.parametrize("name", ["jacksboro:11", "topobathy:24"])
def test_the_referee_agrees_on_terrain(referee, name):
    assert_referee_agrees(referee, build_model(load(name)), [0.03, 0.5])


@pytest.mark.parametrize(
    "name",
    "m1_laurana m2_demosthenes m3_nefertiti m4_skull m5_celticskull m6_igea t_matteo500 f_humface f_maxplanck "
    "f_mask_holes l_laurana_front".split(),
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
        model = build_model(patched, up="z")
    everything = simplify(model, np.ones(model.n_vertices, bool)).quality
    assert everything.triangles == 2 * 11 * 11 - 2


def test_vertices_far_from_a_long_outline_are_found_at_once():
    """A comb with everything kept in one corner: most vertices are bare and their nearest segment is far away."""
    side = 60
    elevation = np.zeros((side, side))
    elevation[2:, 2::3] = np.nan
    model = build_model(grid_source(elevation, 1.0, 1.0), up="z")
    kept = (model.points[:, :2] < side / 4).all(axis=1)
    kept[model.corners] = True
    row = evaluate_subsets(model, kept, footprint="hull")[0]
    again = mesh_quality(model, model.file_points, simplify(model, kept, footprint="hull").faces)
    assert row[ERROR] == pytest.approx(again.error)


@pytest.mark.parametrize("dtype", [float, int, object])
def test_subsets_that_are_not_bool_are_refused(dtype):
    plane = build_model(load("plane:5"))
    with pytest.raises(TypeError, match="bool array"):
        evaluate_subsets(plane, np.ones((2, 25), dtype))
    with pytest.raises(TypeError, match="bool array"):
        simplify(plane, np.ones(25, dtype))


def test_quads_and_fractional_faces_are_refused():
    plane = build_model(load("plane:5"))
    with pytest.raises(ValueError, match=r"faces have shape \(1, 4\)"):
        mesh_quality(plane, plane.file_points, [[0, 1, 2, 3]])
    with pytest.raises(ValueError, match="faces are float64"):
        mesh_quality(plane, plane.file_points, [[0.0, 1.0, 2.5]])
