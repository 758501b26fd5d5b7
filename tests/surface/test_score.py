"""The error of any mesh: of subsets as they are written, of folded ones, and of what is no mesh at all."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from samples import SMALL, freed, subset, surface

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.surface.measures import OF_MESH
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import OUTSIDES
from meshsimp_pymoo.surface.score import mesh_deviation, mesh_samples


@pytest.fixture(scope="module", params=SMALL)
def model(request):
    return build_model(SMALL[request.param](), up="z")


@pytest.mark.parametrize("outside", OUTSIDES)
def test_the_error_of_a_written_mesh_is_that_of_its_subset(model, outside):
    for share in (0.05, 0.4):
        result = surface(model, outside=outside).simplify(subset(model, share))
        other = surface(model, outside=outside).score(model.file_points, result.faces).quality
        assert other.error == pytest.approx(result.quality.error, rel=1e-9)
        assert (other.triangles, other.vertices) == (result.quality.triangles, result.quality.vertices)
        assert other.uncovered == result.quality.uncovered
        for name in OF_MESH:
            assert getattr(other, name) == pytest.approx(getattr(result.quality, name), rel=1e-9)


@pytest.mark.parametrize("outside", OUTSIDES)
def test_a_mesh_of_the_model_s_own_vertices_is_measured_as_any_tool_s_mesh(model, outside):
    weighted = model.with_weights(np.random.default_rng(3).random(model.source_index.max() + 1))
    for own in (surface(model, outside=outside), surface(weighted, outside=outside)):
        kept = subset(model, 0.3)
        delaunay, free = own.simplify(kept), freed(own, kept, better=False)
        assert free.faces.tolist() != delaunay.faces.tolist()
        assert free.quality.triangles == delaunay.quality.triangles
        numbers = {"rel": 1e-9, "abs": 1e-9 * model.diagonal, "nan_ok": True}  # no lines
        for faces, said in ((delaunay.faces, delaunay.quality), (free.faces, free.quality)):
            found, scored = own.of_faces(faces), own.score(model.file_points, faces)
            assert asdict(found.quality) == pytest.approx(asdict(said), **numbers)
            assert asdict(scored.quality) == pytest.approx(asdict(said), **numbers)
            np.testing.assert_allclose(found.deviation, scored.deviation, atol=1e-12 * model.diagonal)
            np.testing.assert_array_equal(found.covered, scored.covered)
            assert (found.deviation[np.unique(faces)] == 0.0).all()
        rows = np.arange(0, model.n_vertices, 3)
        part = own.of_faces(free.faces, rows=rows)
        np.testing.assert_array_equal(part.deviation, found.deviation[rows])
        np.testing.assert_array_equal(part.covered, found.covered[rows])
        turned = own.of_faces(np.roll(free.faces, 1, axis=1)[::-1].astype(np.int64))  # any spelling
        np.testing.assert_array_equal(turned.faces, free.faces)
        assert (turned.faces.dtype, turned.quality) == (np.int32, found.quality)


def test_the_other_diagonal_of_a_square_has_the_error_that_is_worked_out_by_hand():
    """A corner is 4 high, the middle 1/2; of the diagonals through the middle one is 2 high there, the other 0."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 4], [0, 2, 0], [1, 1, 0.5]])
    around = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [0, 4, 3]]
    own = surface(build_model(SourceMesh(points, np.array(around), {}, "square"), up="z"))
    row = np.argsort(own.model.source_index)
    for faces, error in (([[0, 1, 2], [0, 2, 3]], 1.5), ([[0, 1, 3], [1, 2, 3]], 0.5), (around, 0.0)):
        quality = own.of_faces(row[np.array(faces)]).quality
        assert (quality.error, quality.max_error) == (error, error)
        assert (quality.triangles, quality.vertices, quality.uncovered) == (len(faces), len(np.unique(faces)), 0)


WRONG = {
    "a row": (np.array([0, 1, 2]), r"faces are int64 of shape \(3,\); give whole numbers of shape \(M, 3\)"),
    "fractions": (np.array([[0.0, 1, 2]]), "faces are float64 of shape"),
    "none": (np.empty((0, 3), int), "needs at least one triangle"),
    "beyond": (np.array([[0, 1, 25]]), "faces index rows 0 to 25 of 25 vertices"),
    "below": (np.array([[0, 1, -1]]), "faces index rows -1 to 1 of 25 vertices"),
    "a corner twice": (np.array([[0, 1, 2], [3, 4, 3]]), "a vertex twice in one triangle, or one triangle twice"),
    "twice": (np.array([[0, 1, 2], [1, 2, 0]]), "a vertex twice in one triangle, or one triangle twice"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_no_mesh_of_the_model_is_refused(kind):
    faces, message = WRONG[kind]
    with pytest.raises(ValueError, match=message):
        surface("plane:5").of_faces(faces)


def test_of_folded_triangles_the_closest_counts_and_vertices_may_lie_anywhere():
    plane = build_model(load("plane:5"))
    low = plane.file_points.min(axis=0) - [1, 1, 0]
    high = plane.file_points.max(axis=0) + np.array([1, 1, 0])
    sheet = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    heights = surface(plane).simplify(np.ones(25, bool))  # the plane itself, to know its own heights
    assert heights.quality.error == 0
    z = np.linalg.lstsq(np.c_[plane.file_points[:, :2], np.ones(25)], plane.file_points[:, 2], rcond=None)[0]
    on = np.c_[sheet, np.c_[sheet, np.ones(4)] @ z]
    two_sheets = np.vstack([on + np.array([0, 0, 7.0]), on + np.array([0, 0, -2.0])])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
    q = surface(plane).score(two_sheets, faces).quality
    assert q.error == pytest.approx(2.0 * 25)
    assert (q.uncovered, q.triangles, q.vertices) == (0, 4, 8)


def test_meshes_without_area_or_with_wrong_indices_are_refused():
    plane = build_model(load("plane:5"))
    with pytest.raises(ValueError, match="at least one triangle"):
        surface(plane).score(np.zeros((3, 3)), np.zeros((0, 3), int))
    with pytest.raises(ValueError, match="area in the plane"):
        surface(plane).score([[0, 0, 0], [0, 0, 1], [0, 0, 2]], [[0, 1, 2]])
    with pytest.raises(ValueError, match="of 3 vertices"):
        surface(plane).score(np.zeros((3, 3)), [[0, 1, 3]])
    with pytest.raises(ValueError, match="not finite"):
        surface(plane).score([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def test_each_vertex_s_deviation_follows_from_the_heights_that_carry_it(model):
    """Any heights of the mesh's vertices: d_p = hypot(gap, shares . heights - z), covered or not."""
    for outside in OUTSIDES:
        faces = surface(model, outside=outside).simplify(subset(model, 0.15)).faces
        moved = model.points + np.random.default_rng(0).normal(0, 5, (model.n_vertices, 1)) * [0, 0, 1]
        ground = surface(model, outside=outside).ground()
        samples = mesh_samples(ground, moved, faces)
        height = (samples.shares * moved[samples.sites, 2]).sum(axis=1)
        deviation, covered = mesh_deviation(ground, moved, faces)
        charged = samples.shares.any(axis=1)
        np.testing.assert_array_equal(samples.covered, covered)
        np.testing.assert_array_equal(charged, covered | (outside == "nearest"))
        np.testing.assert_allclose(
            np.where(charged, np.hypot(samples.gap, height - model.points[:, 2]), 0.0), deviation, atol=1e-9
        )
        np.testing.assert_allclose(samples.shares[charged].sum(axis=1), 1.0)


def test_quads_and_fractional_faces_are_refused():
    plane = build_model(load("plane:5"))
    with pytest.raises(ValueError, match=r"faces have shape \(1, 4\)"):
        surface(plane).score(plane.file_points, [[0, 1, 2, 3]])
    with pytest.raises(ValueError, match="faces are float64"):
        surface(plane).score(plane.file_points, [[0.0, 1.0, 2.5]])
