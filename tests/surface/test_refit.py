"""The best heights: against a linear programme, against their own bound, and by the package's own error."""

from __future__ import annotations

import importlib.util
import time

import numpy as np
import pytest
import trimesh
from samples import freed, holey_grid, subset, surface
from scipy import sparse
from scipy.optimize import linprog

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.surface.height import refit_heights
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.refit import TOLERANCE, least_error
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES
from meshsimp_pymoo.surface.score import mesh_deviation, mesh_samples

MODELS = {
    "terrain": lambda: load("jacksboro:20"),
    "holey": holey_grid,
    "face": lambda: load("face:300"),
    "horseshoe": lambda: load("horseshoe:200"),
}


@pytest.fixture(scope="module", params=MODELS)
def model(request):
    return build_model(MODELS[request.param](), up="z")


def by_linear_programme(model, kept, weights=None, faces=None):
    """Least error over all heights, where every vertex is covered or costs nothing: min w.(u + v), A h - u + v = z."""
    faces = surface(model, outside="ignore").simplify(kept).faces if faces is None else faces
    rows, compact = np.unique(faces, return_inverse=True)
    ground = surface(model, outside="ignore").ground()
    samples = mesh_samples(ground, model.points[rows], compact.reshape(-1, 3))
    counts = np.flatnonzero(samples.covered)
    n = len(counts)
    A = sparse.coo_matrix(
        (samples.shares[counts].ravel(), (np.repeat(np.arange(n), 3), samples.sites[counts].ravel())),
        shape=(n, len(rows)),
    )
    w = np.ones(n) if weights is None else weights[counts]
    found = linprog(
        np.r_[np.zeros(len(rows)), w, w],
        A_eq=sparse.hstack([A, -sparse.identity(n), sparse.identity(n)]).tocsc(),
        b_eq=model.points[counts, 2],
        bounds=[(None, None)] * len(rows) + [(0, None)] * (2 * n),
        method="highs",
    )
    assert found.status == 0
    return found.fun


@pytest.mark.parametrize("share", [0.05, 0.2, 0.6])
def test_the_error_is_the_optimum_of_the_linear_programme(model, share):
    kept = subset(model, share)
    least = by_linear_programme(model, kept)
    quick = refit_heights(surface(model, outside="ignore"), kept)
    assert least * (1 - 1e-9) <= quick.error <= least * (1 + TOLERANCE)
    assert quick.error * (1 - TOLERANCE) <= quick.bound * (1 + 1e-9) <= least * (1 + 2e-9)
    fine = refit_heights(surface(model, outside="ignore"), kept, tolerance=1e-7)
    assert fine.error == pytest.approx(least, rel=1e-6)


def test_the_heights_of_a_free_mesh_are_the_optimum_too_and_never_make_it_worse(model):
    kept = subset(model, 0.2)
    for outside in OUTSIDES:
        own = surface(model, outside=outside)
        free = freed(own, kept)
        fine = own.refit(own.of_faces(free.faces), tolerance=1e-7)
        assert fine.bound <= fine.error < fine.before == free.quality.error
        np.testing.assert_array_equal(fine.faces, free.faces)
        again = own.score(fine.vertices, np.searchsorted(fine.rows, fine.faces)).quality
        assert again.error == pytest.approx(fine.error, rel=1e-9)
        if outside == "ignore":
            assert fine.error == pytest.approx(by_linear_programme(model, kept, faces=free.faces), rel=1e-6)
        begun = own.refit(own.of_faces(free.faces), until=time.perf_counter())  # no time at all
        assert begun.error <= free.quality.error


def test_weights_count_in_the_optimum_too(model):
    weights = np.random.default_rng(1).uniform(0, 2, model.source_index.max() + 1)
    weighted = model.with_weights(weights)
    kept = subset(model, 0.2)
    least = by_linear_programme(weighted, kept, weighted.weights)
    refitted = refit_heights(surface(weighted, outside="ignore"), kept, tolerance=1e-6)
    assert refitted.error == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize("outside", OUTSIDES)
@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_heights_never_make_the_error_larger_and_it_is_that_of_the_mesh(model, footprint, outside):
    for share in (0.02, 0.15, 0.5, 0.95, 1.0):
        kept = subset(model, share, 5)
        plain = surface(model, footprint=footprint, outside=outside).simplify(kept)
        refitted = refit_heights(surface(model, footprint=footprint, outside=outside), kept)
        assert refitted.bound <= refitted.error <= refitted.before == plain.quality.error
        assert refitted.error <= refitted.bound * (1 + 2 * TOLERANCE)
        np.testing.assert_array_equal(refitted.faces, plain.faces)
        vertices = refitted.vertices
        faces = np.searchsorted(refitted.rows, refitted.faces)
        again = surface(model, outside=outside).score(vertices, faces).quality
        assert again.error == pytest.approx(refitted.error, rel=1e-9, abs=1e-12 * model.n_vertices * model.diagonal)
        np.testing.assert_array_equal(vertices[:, :2], model.file_points[refitted.rows, :2])
    assert refitted.error == 0.0
    np.testing.assert_array_equal(vertices, model.file_points[refitted.rows])


def test_no_small_change_of_heights_makes_it_better():
    """Uncovered vertices too, whose cost is a distance in space; 200 random directions and each vertex alone."""
    model = build_model(load("horseshoe:200"), up="z")
    kept = subset(model, 0.15)
    best = refit_heights(surface(model), kept, tolerance=1e-9)
    assert surface(model).simplify(kept).quality.uncovered > 10
    faces = np.searchsorted(best.rows, best.faces)
    rng = np.random.default_rng(0)
    n = len(best.rows)
    ground, heights = surface(model).ground(), model.to_local(best.vertices)[:, 2]
    for direction in np.vstack([rng.normal(size=(200, n)), np.eye(n), -np.eye(n)]):
        for size in (1e-4, 1e-2):
            moved = np.c_[model.points[best.rows, :2], heights + size * model.diagonal * direction]
            error = mesh_deviation(ground, moved, faces)[0].sum()
            assert error >= best.error * (1 - 1e-8)


def test_a_plane_is_refitted_exactly_from_vertices_that_stick_out():
    x, y = np.meshgrid(np.arange(13.0), np.arange(13.0))
    plane = 0.5 * x - 0.25 * y
    spiked = plane.copy()
    spiked[::6, ::6] += 3.0
    model = build_model(grid_source(spiked, 1.0, 1.0), up="z")
    kept = (model.points[:, :2] % 6 == 0).all(axis=1)
    refitted = refit_heights(surface(model), kept, tolerance=1e-9)
    assert refitted.before > 100
    assert refitted.error == pytest.approx(3.0 * kept.sum(), rel=1e-9)
    np.testing.assert_allclose(refitted.vertices, model.file_points[refitted.rows] - [0, 0, 3.0], atol=1e-6)
    # Where the spikes do not count at all, nothing is left of the error.
    weights = np.ones(169)
    weights[model.source_index[kept]] = 0.0
    weighted = surface(model.with_weights(weights))
    assert refit_heights(weighted, kept, tolerance=1e-9).error == pytest.approx(0.0, abs=1e-4)


def test_the_heights_of_vertices_that_do_not_count_do_not_matter():
    rng = np.random.default_rng(3)
    heights = rng.random((11, 11))
    kept = rng.random((11, 11)) < 0.2
    kept[::10, ::10] = True
    errors = []
    for shift in (0.0, rng.normal(0, 5, (11, 11))):
        model = build_model(grid_source(heights + shift * kept, 1.0, 1.0), up="z")
        model = model.with_weights(np.where(kept, 0.0, 1.0))
        errors.append(refit_heights(surface(model), kept.ravel()[model.source_index], tolerance=1e-6).error)
    assert errors[0] == pytest.approx(errors[1], rel=1e-5)


def test_a_tilted_model_moves_its_vertices_along_its_own_height():
    source = load("face:300")
    up = np.array([1.0, 2.0, 2.0]) / 3
    turn = trimesh.geometry.align_vectors([0, 0, 1], up)[:3, :3]
    model = build_model(SourceMesh(source.points @ turn.T + 1e5, source.faces, {}, "tilted"), up=tuple(up))
    kept = subset(model, 0.1)
    refitted = refit_heights(surface(model), kept)
    assert refitted.error < 0.95 * refitted.before
    rise = refitted.vertices - model.file_points[refitted.rows]
    np.testing.assert_allclose(rise, np.outer(rise @ up, up), atol=1e-9)
    local = model.to_local(refitted.vertices)
    np.testing.assert_allclose(local[:, :2], model.points[refitted.rows, :2], atol=1e-8)


def test_the_same_call_gives_the_same_bytes_and_thinning_gains_by_it():
    model = build_model(load("jacksboro:12"), up="z")
    front = thinning(surface(model))
    for k in (50, 200):
        one, two = (refit_heights(surface(model), front.kept(k)) for _ in range(2))
        assert one.vertices.tobytes() == two.vertices.tobytes()
        assert one.before == pytest.approx(front.error[k])
        assert one.error < 0.97 * one.before


def test_the_referee_agrees_with_the_refitted_error(oracle):
    spec = importlib.util.spec_from_file_location("vertical_error", oracle)
    referee = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(referee)
    for name in ("face:300", "horseshoe:200", "jacksboro:20"):
        model = build_model(load(name), up="z")
        for outside in OUTSIDES:
            refitted = refit_heights(surface(model, outside=outside), subset(model, 0.15))
            faces = np.searchsorted(refitted.rows, refitted.faces)
            error, _, _ = referee.vertical_error(model.file_points, refitted.vertices, faces, outside)
            assert refitted.error == pytest.approx(error, rel=1e-6)


def test_one_unknown_height_is_the_weighted_median():
    z = np.array([0.0, 1.0, 2.0, 10.0, 11.0])
    A = sparse.csr_matrix(np.ones((5, 1)))
    for w, median in ((np.ones(5), 2.0), (np.array([1.0, 1, 1, 4, 1]), 10.0)):
        heights, bound = least_error(A, z, w, np.zeros(5), np.zeros(1), tolerance=1e-9)
        assert heights[0] == pytest.approx(median, abs=1e-6)
        assert bound == pytest.approx((w * np.abs(z - median)).sum())


def test_impossible_calls_are_refused(model):
    with pytest.raises(ValueError, match="tolerance=0 is not positive"):
        refit_heights(surface(model), subset(model, 0.5), tolerance=0)
    with pytest.raises(TypeError, match=r"refit_heights: a OpenModel has no rules; give a surface, such as problem"):
        refit_heights(model, subset(model, 0.5))
    with pytest.raises(ValueError, match="span no triangle"):
        refit_heights(surface(model), np.zeros(model.n_vertices, bool))
