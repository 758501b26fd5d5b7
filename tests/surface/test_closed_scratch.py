"""Closed surfaces from scratch: evaluation against a slow twin, true distances, refit, images, weights."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.measures import MEASURES, TRIANGLES
from meshsimp_pymoo.surface.rules import Rules


@cache
def bumpy():
    """Return a ball with bumps, of no symmetry."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = mesh.vertices.T
    mesh.vertices *= (1.0 + 0.2 * np.sin(5.0 * x + 1.0) * np.cos(4.0 * y + z))[:, None]
    return open_model(mesh, Options(surface="closed"))


def subset(surface, share, seed):
    rng = np.random.default_rng(seed)
    return surface.pinned | (rng.random(surface.n_vertices) < share)


def to_triangle(p, a, b, c):
    """Return the distance of a point to a triangle: to its plane above it, else to its sides."""
    u, v, w = b - a, c - a, p - a
    (s, t), *_ = np.linalg.lstsq(np.column_stack([u, v]), w, rcond=None)
    if s >= 0 and t >= 0 and s + t <= 1:
        return np.linalg.norm(w - s * u - t * v)
    sides = []
    for start, end in ((a, b), (b, c), (c, a)):
        along = np.clip((p - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
        sides.append(np.linalg.norm(p - start - along * (end - start)))
    return min(sides)


def holder(xy, faces, pole, q):
    """Return the triangle that holds an image, in whole numbers: at an edge the one left of it from the lower row."""
    place = [[int(value) for value in row] for row in np.ldexp(xy, 52)]
    x, y = place[q]
    for k, face in enumerate(faces):
        if set(face) == set(pole):
            continue
        is_in = True
        for i in range(3):
            a, b = face[i], face[(i + 1) % 3]
            (ax, ay), (bx, by) = place[a], place[b]
            area = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            is_in = is_in and (area > 0 or (area == 0 and (a < b or {a, b} <= set(pole))))
        if is_in:
            return k
    raise AssertionError(f"vertex {q} lies in no triangle")


@pytest.mark.parametrize(("share", "seed"), [(0.02, 1), (0.2, 2)])
def test_the_error_is_that_of_a_slow_twin(share, seed):
    surface = ClosedSurface(bumpy())
    model, kept = surface.model, subset(surface, share, seed)
    mesh = surface.simplify(kept)
    faces = mesh.faces.tolist()
    deviation = np.zeros(surface.n_vertices)
    for q in np.flatnonzero(~kept).tolist():
        own = set(faces[holder(model.xy, faces, model.poles[0].tolist(), q)])
        around = [face for face in faces if len(own & set(face)) >= 2]
        deviation[q] = min(to_triangle(model.points[q], *model.points[face]) for face in around)
    np.testing.assert_allclose(mesh.deviation, deviation, rtol=1e-9, atol=1e-12)
    row = surface.evaluate(kept)[0]
    numbers = [deviation.sum(), 2 * kept.sum() - 4, kept.sum(), (deviation**2).sum(), deviation.max(), 0.0]
    np.testing.assert_allclose(row, numbers, rtol=1e-9)
    assert mesh.quality.error == row[0]


def test_many_subsets_are_evaluated_as_one_by_one_on_any_number_of_threads():
    surface = ClosedSurface(bumpy())
    X = np.array([subset(surface, 0.1, seed) for seed in range(9)])
    table = surface.evaluate(X, threads=2)
    assert np.array_equal(table, np.concatenate([surface.evaluate(row) for row in X]))


def test_fewer_than_four_vertices_or_no_pole_are_no_mesh():
    surface = ClosedSurface(bumpy())
    alone = surface.pinned.copy()
    assert surface.evaluate(alone)[0, TRIANGLES] == 0
    with pytest.raises(ValueError, match=r"^3 kept vertices of .* are no closed mesh; keep at least 4 of each"):
        surface.simplify(alone)
    alone[np.flatnonzero(~alone)[0]] = True
    assert surface.evaluate(alone)[0, TRIANGLES] == 4
    assert surface.evaluate(~surface.pinned)[0, TRIANGLES] == 0


def test_true_distances_are_those_to_the_nearest_of_all_triangles():
    rng = np.random.default_rng(1)
    vertices, points = rng.random((40, 3)), rng.normal(0.5, 1.0, (200, 3))
    faces = np.array([rng.choice(40, 3, replace=False) for _ in range(60)])
    said, nearest = distances_to_mesh(points, vertices, faces)
    each = np.array([[to_triangle(p, *vertices[face]) for face in faces] for p in points])
    np.testing.assert_allclose(said, each.min(axis=1), rtol=1e-9)
    np.testing.assert_allclose(each[np.arange(200), nearest], said, rtol=1e-9)
    again, _ = distances_to_mesh(points, vertices, faces, rng.integers(0, 60, 200))
    assert np.array_equal(again, said)


@pytest.mark.parametrize("face", [[0, 1, 1], [0, 0, 1], [1, 0, 1], [0, 1, 2], [2, 0, 1], [1, 2, 0]])
def test_a_triangle_of_no_area_is_a_segment_and_one_of_no_length_a_point(face):
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    points = np.array([[0.25, 0.0, 2.0], [3.0, 0.0, 0.0], [-3.0, 4.0, 0.0]])
    assert distances_to_mesh(points, line, np.array([face]))[0].tolist() == pytest.approx([2.0, 2.0, 5.0])
    assert distances_to_mesh(points, line, np.array([[0, 0, 0]]))[0][1:].tolist() == [3.0, 5.0]


def test_a_score_is_the_true_distance_in_the_frame_of_the_file():
    surface = ClosedSurface(bumpy())
    model = surface.model
    bigger = model.file_points * 1.01
    found = surface.score(bigger, model.faces)
    some = np.arange(0, model.n_vertices, 20)
    twin = [min(to_triangle(p, *bigger[face]) for face in model.faces) for p in model.file_points[some]]
    np.testing.assert_allclose(found.deviation[some], twin, rtol=1e-9)
    assert surface.score(model.file_points, model.faces).quality.error == 0.0
    whole = surface.of_faces(model.faces)
    assert whole.quality.error == 0.0
    assert whole.quality.surface_error < 1e-15


def test_refit_lowers_the_error_and_says_what_a_score_says():
    surface = ClosedSurface(bumpy())
    mesh = surface.simplify(subset(surface, 0.1, 3))
    found = surface.refit(mesh)
    rows, compact = used_rows(mesh.faces)
    assert np.array_equal(found.rows, rows)
    assert found.error < 0.75 * found.before == 0.75 * mesh.quality.error
    assert surface.score(found.vertices, compact).quality.error == pytest.approx(found.error, rel=1e-9)
    moved = trimesh.Trimesh(found.vertices, compact, process=False)
    assert moved.is_watertight
    # what lies inside of a convex body comes out of it
    assert moved.volume > trimesh.Trimesh(surface.model.file_points[rows], compact, process=False).volume


def test_refit_leaves_what_is_exact_to_the_bit():
    surface = ClosedSurface(bumpy())
    found = surface.refit(surface.simplify(np.ones(surface.n_vertices, bool)))
    assert found.error == found.before == 0.0
    assert np.array_equal(found.vertices, surface.model.file_points)


def test_refit_turns_no_triangle_over():
    """A plate as thin as a leaf, whose sides would swap places."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = mesh.vertices.T
    mesh.vertices = np.column_stack(
        [x, 0.8 * y + 0.1 * np.sin(3 * x), 0.004 * z + 0.05 * np.sin(4 * x) * np.cos(3 * y)]
    )
    surface = ClosedSurface(open_model(mesh, Options(surface="closed")))
    for seed in range(3):
        found = surface.refit(surface.simplify(subset(surface, 0.06, seed)))
        assert found.error < found.before
        rows, compact = used_rows(found.faces)
        corners = [points[compact] for points in (surface.model.file_points[rows], found.vertices)]
        before, after = (np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in corners)
        assert ((before * after).sum(axis=1) >= 0.0).all()


def test_refit_out_of_time_is_the_mesh_itself():
    surface = ClosedSurface(bumpy())
    mesh = surface.simplify(subset(surface, 0.1, 3))
    found = surface.refit(mesh, until=0.0)
    assert np.array_equal(found.vertices, surface.model.file_points[found.rows])
    assert found.error <= found.before


def test_weights_by_area_are_a_third_of_what_is_around_and_count():
    weighted = ClosedSurface(bumpy(), Rules(weights="area"))
    model = weighted.model
    faces = trimesh.Trimesh(model.points, model.faces, process=False)
    around = np.bincount(model.faces.ravel(), np.repeat(faces.area_faces, 3))
    np.testing.assert_allclose(model.weights, around * model.n_vertices / around.sum(), rtol=1e-12)
    kept = subset(weighted, 0.1, 4)
    plain = ClosedSurface(bumpy()).simplify(kept)
    assert weighted.evaluate(kept)[0, 0] == pytest.approx((model.weights * plain.deviation).sum(), rel=1e-12)
    named = open_model(trimesh.creation.box(), Options(surface="closed"))
    named.attributes["area"] = np.ones(8)
    with pytest.raises(ModelError, match=r"weights 'area' may mean the area around each vertex or the file's own"):
        ClosedSurface(named, Rules(weights="area"))


def test_weights_of_an_open_model_may_be_areas_too():
    model = open_model("roof:5").with_weights("area")
    assert model.total_weight == pytest.approx(25.0, rel=1e-12)
    assert model.weights.min() < 0.5 < 1.5 < model.weights.max()


def test_rows_and_positions_are_pinned():
    model = bumpy()
    surface = ClosedSurface(model, Rules(pin=[5, 17]))
    assert surface.pinned[np.isin(model.source_index, [5, 17])].all()
    near = ClosedSurface(model, Rules(pin=model.file_points[[100]]))
    assert near.pinned[100]
    assert near.pinned.sum() == 4
    with pytest.raises(ModelError, match="pin='hull' describes height surfaces, and this is a closed one; name file"):
        ClosedSurface(model, Rules(pin="hull"))
    with pytest.raises(ModelError, match=r"pin holds positions \[x, y\] on a closed surface; give \[x, y, z\]"):
        ClosedSurface(model, Rules(pin=[[0.0, 1.0]]))


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        (Rules(footprint="hull"), r"footprint='hull' \(--footprint hull\) describes height surfaces"),
        (Rules(outside="ignore"), r"outside='ignore' \(--outside ignore\) describes height surfaces"),
    ],
)
def test_what_describes_height_surfaces_is_refused(rules, said):
    with pytest.raises(ModelError, match=said):
        ClosedSurface(bumpy(), rules)


def test_images_that_were_stored_are_taken_with_their_order():
    model = bumpy()
    order = np.random.default_rng(1).permutation(model.n_vertices)
    xy, rows = model.xy[order], model.source_index[order]
    other = model.with_images(xy, rows)
    assert np.array_equal(other.source_index, rows)
    assert np.array_equal(other.file_points, model.file_points[order])
    assert other.hash == model.hash
    kept = subset(ClosedSurface(model), 0.1, 1)
    there, here = ClosedSurface(other).simplify(kept[order]), ClosedSurface(model).simplify(kept)
    assert there.quality.error == pytest.approx(here.quality.error, rel=1e-12)
    with pytest.raises(ModelError, match="has other vertices than those whose images were stored"):
        model.with_images(xy, rows + 1)
    with pytest.raises(ModelError, match="cannot be flattened"):
        model.with_images(np.zeros_like(xy), rows)


def test_every_measure_of_a_mesh_is_known():
    surface = ClosedSurface(bumpy())
    quality = surface.simplify(subset(surface, 0.1, 5)).quality
    known = [name for name, measure in MEASURES.items() if not measure.of_lines]
    assert np.isfinite([getattr(quality, name) for name in known]).all()
    assert quality.uncovered == 0
