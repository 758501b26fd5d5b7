"""The numbers of a statement of quality: known answers, laws, slow twins, and the referees beside the checkout."""

from __future__ import annotations

import dataclasses
import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
import true_distance
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scans import holed

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.opening import open_grid, open_model
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.surface import accuracy
from meshsimp_pymoo.surface.accuracy import accuracy_of, compare, compare_any, compare_subset, points_on, quantiles
from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.kinds import surface_of
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import Rules

# Lengths, of which each becomes twice as much in a model twice as large.
LENGTHS = ("mean_error", "rms_error", "max_error", "bias", "standard_deviation", "median", "nmad", "le90", "le95",
           "le90_normal", "le95_normal", "surface_error")  # fmt: skip
FEW = 2000
# Of a property of whole statements, which take some hundredths of a second each.
EXAMPLES = 8


def of_terrain(n=7, seed=1, *, at=(0.0, 0.0, 0.0), scale=1.0, order=None, rules=Rules()):  # noqa: B008
    """Return a terrain's surface whose vertices lie at no lattice."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.random((n * n, 2)) * 50.0, rng.random(n * n) * 8.0])
    source = cloud_source(points, name="terrain")
    moved = (source.points + np.array(at)) * scale
    order = np.arange(len(moved)) if order is None else order
    place = np.argsort(order)
    source = build_source(moved[order], place[source.faces], name="terrain")
    return HeightSurface(build_model(source, up="z"), rules)


def some_mesh(surface, seed=2, share=0.2):
    """Return the mesh of vertices that are chosen by their places in the file, whatever their order."""
    chosen = np.argsort(surface.model.file_points[:, 0] - surface.model.file_points[:, 0].min())
    rng = np.random.default_rng(seed)
    kept = surface.pinned.copy()
    kept[chosen[rng.random(len(chosen)) < share]] = True
    return surface.simplify(kept)


def numbers(surface, mesh, **how):
    return accuracy_of(compare(surface, mesh), **{"space_samples": FEW} | how)


def flat(low, high):
    """Return a square of two triangles."""
    return np.array([[low, low, 0], [high, low, 0], [high, high, 0], [low, high, 0.0]]), np.array(
        [[0, 1, 2], [0, 2, 3]]
    )


# -------------------------------------------------------------------------------------------------------- known answers


def test_residuals_of_0_to_n_have_the_percentiles_of_a_ruler():
    heights = np.random.default_rng(1).permutation(np.arange(121.0)).reshape(11, 11)
    surface = HeightSurface(build_model(grid_source(heights, origin=(100.0, 210.0)), up="z"))
    points, faces = flat(0.0, 10.0)
    found = accuracy_of(compare_any(surface, points + np.array([100.0, 200.0, 0.0]), faces))
    k = np.arange(121.0)
    assert (found.check_points, found.weightless, found.uncovered, found.coverage) == (121, 0, 0, 1.0)
    assert_allclose([found.le90, found.le95, found.percentiles[50], found.percentiles[99]], [108, 114, 60, 118.8])
    assert_allclose([found.mean_error, found.bias, found.median], 60.0)
    assert_allclose(found.rms_error, math.sqrt((k**2).mean()))
    assert_allclose(found.standard_deviation, math.sqrt((121**2 - 1) / 12))
    assert_allclose(found.nmad, 1.4826 * 30.0)
    assert_allclose([found.le90_normal, found.le95_normal], [1.6449 * found.rms_error, 1.96 * found.rms_error])
    assert_allclose(found.signed_percentiles[5], 6.0)
    row, column = np.argwhere(heights == 120.0)[0]
    assert (found.max_error, found.max_at) == (120.0, (100.0 + column, 210.0 - row, 120.0))
    assert sum(found.histogram.counts) == 121
    assert (found.triangles, found.original_triangles, found.reduction) == (2, 200, 0.99)
    assert_allclose(found.space.to_mesh.maximum, 120.0)
    assert found.angles.minimum == found.angles.percentiles[50] == pytest.approx(45.0)
    assert found.angles.below == {10.0: 0.0, 20.0: 0.0}
    assert dict(zip(found.angles.histogram.edges, found.angles.histogram.counts, strict=False))[44.0] == 2


def test_a_mesh_that_is_too_high_has_a_negative_bias_and_one_too_low_a_positive():
    surface = HeightSurface(build_model(grid_source(np.zeros((5, 5))), up="z"))
    points, faces = flat(0.0, 4.0)
    for raised in (0.5, -0.5):
        found = accuracy_of(compare_any(surface, points + np.array([0.0, -4.0, raised]), faces), space_samples=FEW)
        assert (found.bias, found.median, found.standard_deviation) == pytest.approx((-raised, -raised, 0.0))
        assert found.space.hausdorff == found.space.mean == found.space.rms == pytest.approx(0.5)


def test_an_exact_mesh_has_no_error_at_all():
    surface = of_terrain()
    found = numbers(surface, surface.simplify(np.ones(surface.n_vertices, bool)))
    assert all(getattr(found, name) == pytest.approx(0.0, abs=1e-12) for name in LENGTHS)
    assert found.space.hausdorff == pytest.approx(0.0, abs=1e-9)


def test_coverage_is_the_share_of_the_area_and_what_is_outside_counts_without_a_sign():
    surface = HeightSurface(build_model(grid_source(np.zeros((11, 11))), up="z"))
    half = np.array([[0, -10, 0], [5, -10, 0], [5, 0, 0], [0, 0, 0.0]])
    found = accuracy_of(compare_any(surface, half, flat(0, 1)[1]), space_samples=FEW)
    assert found.coverage == pytest.approx(0.5)
    assert (found.uncovered, found.max_error, found.bias) == (5 * 11, 5.0, 0.0)
    assert sum(found.histogram.counts) == 6 * 11  # those that have a sign
    ignoring = HeightSurface(surface.model, Rules(outside="ignore"))
    ignored = accuracy_of(compare_any(ignoring, half, flat(0, 1)[1]), space_samples=FEW)
    assert (ignored.outside, ignored.max_error, ignored.uncovered) == ("ignore", 0.0, 5 * 11)


def test_degrees_are_measured_in_metres():
    source = grid_source(np.zeros((5, 7)), 1 / 1200, 1 / 1200, origin=(11.0, 47.0))
    source = dataclasses.replace(source, georeference={"epsg": 4326, "unit": "degree"}).in_frame((76000.0, 111000.0))
    surface = HeightSurface(build_model(source, up="z"))
    points = source.points[[0, 6, 34, 28]] + [0, 0, 2.0]
    found = accuracy_of(compare_any(surface, points, flat(0, 1)[1][:, ::-1]), space_samples=FEW)
    assert (found.unit, found.system) == ("m", "EPSG:4326, 76000 x 111000 m to a degree")
    assert (found.bias, found.space.hausdorff) == pytest.approx((-2.0, 2.0))
    beside = accuracy_of(compare_any(surface, points + np.array([1 / 1200, 0, -2.0]), flat(0, 1)[1]), space_samples=FEW)
    assert beside.max_error == pytest.approx(76000 / 1200)


# ----------------------------------------------------------------------------------------------------------------- laws


@settings(max_examples=EXAMPLES)
@given(seed=st.integers(0, 2**16), raised=st.floats(-1e4, 1e4))
def test_moving_all_heights_changes_nothing(seed, raised):
    one, other = of_terrain(seed=seed), of_terrain(seed=seed, at=(0.0, 0.0, raised))
    before, after = (numbers(surface, some_mesh(surface), space_samples=0) for surface in (one, other))
    for name in LENGTHS:
        assert getattr(after, name) == pytest.approx(getattr(before, name), abs=1e-9)


@settings(max_examples=EXAMPLES)
@given(seed=st.integers(0, 2**16), power=st.integers(-8, 8))
def test_a_model_twice_as_large_has_twice_the_errors_and_the_same_shares(seed, power):
    scale = 2.0**power
    one, other = of_terrain(seed=seed), of_terrain(seed=seed, scale=scale)
    before, after = (numbers(surface, some_mesh(surface)) for surface in (one, other))
    for name in LENGTHS:
        assert getattr(after, name) == pytest.approx(scale * getattr(before, name), rel=1e-9, abs=1e-12 * scale)
    assert after.coverage == pytest.approx(before.coverage)
    assert after.angles.histogram == before.angles.histogram
    assert after.histogram.counts == before.histogram.counts
    assert after.space.hausdorff == pytest.approx(scale * before.space.hausdorff)


@settings(max_examples=EXAMPLES)
@given(seed=st.integers(0, 2**16))
def test_the_order_in_the_file_decides_nothing(seed):
    order = np.random.default_rng(seed).permutation(49)
    one, other = of_terrain(seed=seed), of_terrain(seed=seed, order=order)
    before, after = (numbers(surface, some_mesh(surface), space_samples=0) for surface in (one, other))
    assert before.plain == after.plain


@given(
    values=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40),
    shares=st.lists(st.floats(0, 1), min_size=1, max_size=5),
    weight=st.floats(1e-3, 1e3),
)
def test_percentiles_are_those_of_numpy_and_equal_weights_do_not_move_them(values, shares, weight):
    values = np.array(values)
    expected = np.quantile(values, shares)
    assert_allclose(quantiles(values, shares), expected)
    assert_allclose(quantiles(values, shares, np.full(len(values), weight)), expected, rtol=1e-9, atol=1e-3)


# ---------------------------------------------------------------------------------------- the same numbers as elsewhere


def meshes_of(surface, seed=1):
    """Return a mesh by a subset and the same with other edges and other heights."""
    mesh = some_mesh(surface, seed)
    yield mesh
    yield surface.of_faces(mesh.faces)
    yield surface.refit(mesh)


@pytest.mark.parametrize("kind", ["terrain", "weighted", "ignore", "holed"])
def test_mean_root_mean_square_and_maximum_are_those_of_front_csv(kind):
    if kind == "holed":
        surface = surface_of(open_model(holed(), Options(surface="closed")))
    else:
        weights = np.random.default_rng(1).integers(0, 3, 49).astype(float) if kind == "weighted" else None
        surface = of_terrain(rules=Rules(weights=weights, outside="ignore" if kind == "ignore" else None))
    for mesh in meshes_of(surface):
        found = numbers(surface, mesh)
        if hasattr(mesh, "quality"):
            quality = mesh.quality
        else:
            quality = surface.score(mesh.vertices, used_rows(mesh.faces)[1]).quality
        compared = compare(surface, mesh)
        (part,) = compared.parts()
        w = np.ones(surface.n_vertices) if compared.weights is None else compared.weights
        d = np.abs(part.values)
        assert found.mean_error == pytest.approx(np.average(d, weights=w), rel=1e-9)
        assert found.rms_error == pytest.approx(math.sqrt(np.average(d**2, weights=w)), rel=1e-9)
        assert found.max_error == d[w > 0].max()
        if kind != "weighted":
            assert (found.le90, found.percentiles[50]) == pytest.approx(tuple(np.quantile(d, [0.9, 0.5])))
        for name in ("mean_error", "rms_error", "max_error", "surface_error", "triangles", "vertices"):
            assert getattr(found, name) == getattr(quality, name)
        assert found.check_points == (w > 0).sum()
        assert found.weightless == (w == 0).sum()
        assert found.weighted == (kind == "weighted")
        assert found.closed == (kind == "holed")
        assert math.isnan(found.bias) == math.isnan(found.coverage) == (kind == "holed")
        at = np.flatnonzero((surface.model.file_points == found.max_at).all(axis=1))
        assert d[at].max() == found.max_error
        if not found.closed and kind != "ignore" and found.uncovered == 0:
            assert found.bias**2 + found.standard_deviation**2 == pytest.approx(found.rms_error**2)


def test_signs_are_those_of_a_slow_twin():
    surface = of_terrain(6, seed=3)
    mesh = some_mesh(surface, share=0.4)
    (part,) = compare(surface, mesh).parts()
    for row, (x, y, z) in enumerate(surface.points):
        heights = []
        for a, b, c in surface.points[mesh.faces]:
            shares = np.linalg.solve(np.column_stack([np.append(p[:2], 1.0) for p in (a, b, c)]), [x, y, 1.0])
            if shares.min() >= -1e-9:
                heights.append(shares @ [a[2], b[2], c[2]])
        assert part.covered[row] == bool(heights)
        if heights:
            assert part.values[row] == pytest.approx(min((z - h for h in heights), key=abs), abs=1e-9)
        else:
            assert part.values[row] == mesh.deviation[row] > 0.0


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("read", ["windows", "model"])
@pytest.mark.parametrize("fine", [False, True])
def test_a_grid_read_by_windows_has_the_numbers_of_the_whole(tmp_path, monkeypatch, gaps, read, fine):
    rng = np.random.default_rng(5)
    heights = rng.normal(size=(23, 31)) * 4.0
    if gaps:
        heights[rng.random(heights.shape) < 0.1] = np.nan
        heights[:6, :8] = np.nan
    np.save(tmp_path / "z.npy", heights)
    model = open_model(tmp_path / "z.npy")
    grid = open_grid(tmp_path / "z.npy") if read == "windows" else open_grid(model)
    surface, whole, row_of = GridSurface(grid), HeightSurface(model), np.argsort(model.source_index)
    kept = (rng.random(surface.n_vertices) < 0.2) | surface.pinned
    there = np.zeros_like(kept)
    there[row_of] = kept
    expected = numbers(whole, whole.simplify(there))
    if fine:
        monkeypatch.setattr(accuracy, "EXACT_POINTS", 0)
        monkeypatch.setattr("meshsimp_pymoo.surface.grid.BAND_SAMPLES", 100)
    found = accuracy_of(compare_subset(surface, kept), space_samples=FEW)
    assert found.resolution == (found.max_error / accuracy.FINE_BINS if fine else 0.0)
    for name in LENGTHS:
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-9 + 3.0 * found.resolution), name
    assert sum(found.histogram.counts) == sum(expected.histogram.counts)
    if not fine:
        assert found.histogram.counts == expected.histogram.counts
    for name in ("check_points", "uncovered", "triangles", "vertices", "original_triangles", "max_at"):
        assert getattr(found, name) == getattr(expected, name), name
    assert found.coverage == pytest.approx(expected.coverage)
    assert (found.coverage < 1.0) == gaps
    assert found.angles.minimum == pytest.approx(expected.angles.minimum)
    assert found.space.hausdorff == pytest.approx(expected.space.hausdorff, rel=0.05)
    rows = np.flatnonzero(kept)
    faces = np.searchsorted(rows, surface.triangles(kept))
    again = accuracy_of(compare_any(surface, np.asarray(grid.file_points[rows]), faces), space_samples=0)
    assert (again.bias, again.le95, again.coverage) == pytest.approx(
        (expected.bias, expected.le95, expected.coverage), abs=1e-9 + 3.0 * found.resolution
    )


# ------------------------------------------------------------------------------------------------------------- in space


def test_distances_in_space_are_those_of_a_slow_twin():
    surface = surface_of(open_model(holed(), Options(surface="closed")))
    mesh = some_mesh(surface, share=0.1)
    compared = compare(surface, mesh)
    found = accuracy_of(compared, space_samples=300).space
    original, faces = surface.points, surface.faces
    there = true_distance.distances(points_on(original, faces, 300), compared.vertices, compared.faces)
    back = true_distance.distances(points_on(compared.vertices, compared.faces, 300), original, faces)
    at_vertices = true_distance.distances(original[np.unique(faces)], compared.vertices, compared.faces)
    assert (found.to_mesh.mean, found.to_original.mean) == pytest.approx((there.mean(), back.mean()))
    assert found.to_mesh.maximum == pytest.approx(max(there.max(), at_vertices.max()))
    assert found.mean == pytest.approx((there.mean() + back.mean()) / 2)
    assert found.rms == pytest.approx(math.sqrt(((there**2).mean() + (back**2).mean()) / 2))
    assert found.hausdorff >= max(there.max(), back.max()) - 1e-12
    assert found.to_mesh.points == 300 + surface.n_vertices


@given(seed=st.integers(0, 2**16))
def test_points_lie_on_the_triangles_and_each_has_its_share(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = rng.random((6, 3)), np.array([[0, 1, 2], [3, 4, 5], [1, 1, 4]])
    points = points_on(vertices, faces, 1000)
    away, nearest = distances_to_mesh(points, vertices, faces[:2])
    assert away.max() < 1e-12
    area = trimesh.triangles.area(vertices[faces[:2]])
    expected = 1000 * area / area.sum()
    assert abs((nearest == 0).sum() - expected[0]) <= 1.5


def test_originals_that_are_too_large_have_no_distances_in_space(monkeypatch):
    monkeypatch.setattr(accuracy, "MOST_FACES", 10)
    surface = of_terrain()
    found = numbers(surface, some_mesh(surface))
    assert found.space is None
    assert found.plain["space"] is None


def test_plain_data_hold_every_number_and_null_where_there_is_none():
    surface = surface_of(open_model(load("sphere:200")))
    found = numbers(surface, some_mesh(surface))
    plain = found.plain
    assert {item.name for item in dataclasses.fields(found)} < plain.keys()
    assert plain["bias"] is plain["coverage"] is plain["line_max_error"] is None
    assert plain["le90"] == plain["percentiles"]["90"] == found.le90
    assert plain["space"]["hausdorff"] == found.space.hausdorff


# ------------------------------------------------------------------------------------------------------------- referees


def _referee(script: Path):
    if not script.is_file():
        pytest.skip(f"no referee: {script.name} is not beside this checkout")
    spec = importlib.util.spec_from_file_location(script.stem, script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "window", [(150, 150, 40, 40), pytest.param(None, marks=pytest.mark.slow)], ids=["part", "whole"]
)
def test_the_referees_agree_about_a_raster_of_a_mountain(shared_data, oracle, tmp_path, window):
    vertical, space = _referee(oracle), _referee(oracle.with_name("surface_distance.py"))
    surface = surface_of(open_model(shared_data / "dem_sthelens.npz", Options(window=window)))
    rng = np.random.default_rng(1)
    mesh = surface.simplify((rng.random(surface.n_vertices) < 0.05) | surface.pinned)
    compared = compare(surface, mesh)
    found = accuracy_of(compared, space_samples=200_000)
    points, n = surface.points, surface.n_vertices
    total, uncovered, costs = vertical.vertical_error(points, compared.vertices, compared.faces)
    assert (found.check_points, found.uncovered) == (n, uncovered)
    assert found.mean_error == pytest.approx(total / n, rel=1e-6)
    assert found.rms_error == pytest.approx(math.sqrt((costs**2).mean()), rel=1e-6)
    assert found.max_error == pytest.approx(costs.max(), rel=1e-6)
    assert (found.le90, found.le95) == pytest.approx(tuple(np.quantile(costs, [0.9, 0.95])), rel=1e-6)
    pytest.importorskip("pymeshlab")
    for name, of, faces in (("a", points, surface.faces), ("b", compared.vertices, compared.faces)):
        trimesh.Trimesh(of, faces, process=False).export(tmp_path / f"{name}.ply")
    said = space.measure(str(tmp_path / "a.ply"), str(tmp_path / "b.ply"), 200_000)
    assert found.space.mean == pytest.approx(said["smean"] * surface.diagonal, rel=0.01)
    assert found.space.rms == pytest.approx(said["srms"] * surface.diagonal, rel=0.02)
    # its largest is that of points drawn at random
    assert found.space.hausdorff == pytest.approx(said["haus"] * surface.diagonal, rel=0.1)
