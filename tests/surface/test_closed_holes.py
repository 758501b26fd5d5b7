"""Closed surfaces with holes and of several parts: a slow twin, laws, moves, refit, images stored."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from scans import as_source, bowl, bumpy, holed, parts, without
from scipy.spatial import Delaunay
from test_closed_live import check_moves
from true_distance import distances

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.search.greedy import greedy_insertion, thinning
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.surface.closed import embedding
from meshsimp_pymoo.surface.closed.embedding import are_poles, discs_in_holes, embed
from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.measures import ERROR, MAXIMUM, SQUARES, TRIANGLES, UNCOVERED, VERTICES
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.smallest import smallest_mesh

MAKE = {"holed": holed, "bowl": bowl, "parts": parts}
CLOSED = Options(surface="closed")


@cache
def opened(name):
    return open_model(MAKE[name](), CLOSED)


@cache
def surface_of(name, measure="error", weights=None):
    return ClosedSurface(opened(name), Rules(measure=measure, weights=weights))


def subset(surface, share, seed):
    """Return a random subset with what is pinned and some of every part."""
    rng = np.random.default_rng(seed)
    kept = surface.pinned | (rng.random(surface.n_vertices) < share)
    for part in range(surface.model.n_parts):
        kept[rng.choice(np.flatnonzero(surface.model.part == part), 4, replace=False)] = True
    return kept


# --------------------------------------------------------------------------------------------------------------- a twin


def loops_of(model):
    """Return the rims of holes as polygons."""
    after = dict(model.rim.tolist())
    while after:
        start = min(after)
        loop = [start]
        while (vertex := after.pop(loop[-1])) != start:
            loop.append(vertex)
        yield loop


def winds_around(polygon, point):
    """Return how often a polygon goes around a point, by the angles at it."""
    u = polygon - point
    v = np.roll(u, -1, axis=0)
    angles = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))
    return round(angles.sum() / (2.0 * np.pi))


def is_over(loops, triangle):
    """Whether one of four points of a triangle lies in a hole."""
    centroid = triangle.mean(axis=0)
    asked = [centroid, *(0.5 * (centroid + corner) for corner in triangle)]
    return any(winds_around(loop, point) for loop in loops for point in asked)


def twin(surface, kept):
    """Return the faces and d_p of all vertices, by another Delaunay triangulation, angles and every triangle asked."""
    model = surface.model
    loops = [model.xy[loop] for loop in loops_of(model)]
    faces, deviation = [], np.full(surface.n_vertices, np.nan)
    for pole, part in zip(model.poles, range(model.n_parts), strict=True):
        own = np.flatnonzero(model.part == part)
        rows = own[kept[own]]
        plane = Delaunay(model.xy[rows])
        corners, beside = rows[plane.simplices], plane.neighbors
        shown = [not is_over(loops, model.xy[face]) for face in corners]
        corners = np.concatenate([corners, pole[None]])  # the last, which -1 means too
        shown = np.array([*shown, True])
        faces.append(corners[shown])
        for q in own:
            if kept[q]:
                deviation[q] = 0.0 if q in corners[shown] else np.inf
                continue
            t = int(plane.find_simplex(model.xy[q][None])[0])
            ask = [t, *beside[t]]
            seen = [corners[k] for k in ask if shown[k]]
            deviation[q] = distances(model.points[[q]], model.points, np.array(seen))[0] if seen else np.inf
        far = ~np.isfinite(deviation[own])
        deviation[own[far]] = distances(model.points[own[far]], model.points, pole[None]) if far.any() else 0.0
    return np.concatenate(faces), deviation


@pytest.mark.parametrize("name", MAKE)
@pytest.mark.parametrize(("share", "seed"), [(0.02, 1), (0.1, 2), (0.4, 3)])
def test_mesh_and_error_are_those_of_a_slow_twin(name, share, seed):
    surface = surface_of(name)
    kept = subset(surface, share, seed)
    mesh, (faces, deviation) = surface.simplify(kept), twin(surface, kept)
    # boxes have ties, which the twin breaks in its own way
    generic = surface.model.part != 2 if name == "parts" else np.ones(surface.n_vertices, bool)
    own = [{tuple(sorted(face)) for face in listed if generic[face[0]]} for listed in (mesh.faces.tolist(), faces)]
    assert own[0] == {tuple(map(int, face)) for face in own[1]}
    np.testing.assert_allclose(mesh.deviation[generic], deviation[generic], rtol=1e-9, atol=1e-12)
    row = surface.evaluate(kept)[0]
    numbers = [mesh.deviation.sum(), len(mesh.faces), len(np.unique(mesh.faces)), (mesh.deviation**2).sum()]
    np.testing.assert_allclose(row[[ERROR, TRIANGLES, VERTICES, SQUARES]], numbers, rtol=1e-9)
    assert row[MAXIMUM] == pytest.approx(mesh.deviation.max(), rel=1e-12)
    assert row[UNCOVERED] == mesh.quality.uncovered == (~mesh.covered).sum()
    assert not mesh.covered[kept & ~np.isin(np.arange(len(kept)), mesh.faces)].any()


# ----------------------------------------------------------------------------------------------------------------- laws


@pytest.mark.parametrize("name", MAKE)
def test_any_subset_is_a_manifold_of_the_parts_that_closes_no_more_than_the_holes(name):
    surface = surface_of(name)
    model = surface.model
    for seed, share in enumerate((0.0, 0.01, 0.05, 0.3, 0.8)):
        kept = subset(surface, share, seed)
        mesh = surface.simplify(kept)
        table = edge_table(mesh.faces)
        assert set(np.unique(table.n_triangles)) <= {1, 2}
        assert trimesh.Trimesh(surface.points, mesh.faces, process=False).is_winding_consistent
        assert (model.part[mesh.faces] == model.part[mesh.faces[:, :1]]).all()
        for part in range(model.n_parts):
            own = mesh.faces[model.part[mesh.faces[:, 0]] == part]
            n = int((kept & (model.part == part)).sum())
            has_holes = (model.part[model.border] == part).any()
            assert len(own) <= 2 * n - 4 if has_holes else len(own) == 2 * n - 4


@pytest.mark.parametrize("name", MAKE)
def test_the_error_is_at_least_the_true_distance(name):
    surface = surface_of(name)
    for seed, share in enumerate((0.02, 0.1, 0.4, 0.9)):
        mesh = surface.simplify(subset(surface, share, seed))
        true = distances(surface.points, surface.points, mesh.faces)
        assert (mesh.deviation >= true - 1e-12 * surface.diagonal).all()


@pytest.mark.parametrize("name", MAKE)
def test_of_thinned_meshes_the_error_is_hardly_more_than_the_true_distance(name):
    surface = surface_of(name)
    front = thinning(surface)
    for share in (0.1, 0.3):
        kept = front.kept(int(np.argmin(np.abs(np.asarray(front.triangles) - share * len(surface.faces)))))
        mesh = surface.simplify(kept)
        assert mesh.quality.error <= 1.05 * distances(surface.points, surface.points, mesh.faces).sum()


def test_parts_cost_together_what_they_cost_alone():
    """The images of a part are the same in a plane of its own, but for their scale."""
    small, box = bumpy(2), trimesh.creation.box().subdivide()
    box.vertices += [5.0, 1.0, 2.0]
    both = ClosedSurface(open_model(trimesh.util.concatenate([small, box]), CLOSED))
    alone = [ClosedSurface(open_model(mesh, CLOSED)) for mesh in (small, box)]
    rng = np.random.default_rng(4)
    in_file = rng.random(both.n_vertices) < 0.3
    n = len(small.vertices)
    chosen = [in_file[:n], in_file[n:]]
    for surface, own in zip(alone, chosen, strict=True):
        own[surface.model.source_index[surface.pinned]] = True
    pinned = both.model.source_index[both.pinned]
    assert in_file[pinned].all()  # the same poles
    mesh = both.simplify(in_file[both.model.source_index])
    meshes = [s.simplify(own[s.model.source_index]) for s, own in zip(alone, chosen, strict=True)]
    assert mesh.quality.error == pytest.approx(sum(one.quality.error for one in meshes), rel=1e-9)
    assert mesh.quality.triangles == sum(one.quality.triangles for one in meshes)
    assert mesh.quality.max_error == pytest.approx(max(one.quality.max_error for one in meshes), rel=1e-9)


def test_all_vertices_of_parts_without_holes_are_the_original():
    small = bumpy(2)
    other = small.copy()
    other.vertices += 5.0
    surface = ClosedSurface(open_model(trimesh.util.concatenate([small, other]), CLOSED))
    mesh = surface.simplify(np.ones(surface.n_vertices, bool))
    assert mesh.quality.error == 0.0
    assert mesh.quality.triangles == len(surface.faces)


def test_a_part_keeps_four_vertices_whatever_others_have():
    surface = surface_of("parts")
    kept = subset(surface, 0.2, 1)
    part = surface.model.part == 1
    kept[part & ~surface.pinned] = False
    assert surface.evaluate(kept)[0, TRIANGLES] == 0
    with pytest.raises(ValueError, match="keep at least 4 of each part"):
        surface.simplify(kept)
    front = thinning(surface)
    assert min((front.kept(0) & (surface.model.part == k)).sum() for k in range(3)) == 4
    grown = greedy_insertion(surface, most=60)
    assert np.isfinite(grown.error[-1])


# ---------------------------------------------------------------------------------------------------------------- moves


CASES = [
    *((name, "error", None) for name in MAKE),
    ("holed", "rms_error", "area"),
    ("bowl", "max_error", None),
    ("parts", "max_error", "area"),
]


@pytest.mark.parametrize(("name", "measure", "weights"), CASES)
def test_moves_change_what_they_were_tried_to_and_end_where_scratch_does(name, measure, weights):
    surface = surface_of(name, measure, weights)
    check_moves(surface, subset(surface, 0.06, 1), 800, 20)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "measure", "weights"), CASES)
def test_many_moves_change_what_they_were_tried_to_and_end_where_scratch_does(name, measure, weights):
    surface = surface_of(name, measure, weights)
    check_moves(surface, subset(surface, 0.06, 1), 16_000, 40)


def test_a_site_that_no_triangle_uses_costs_what_it_is_from_the_pole():
    """Else a search would keep vertices at rims that nobody sees, and call them met."""
    surface = ClosedSurface(open_model(without(bumpy(), [([1.0, 0.3, 0.1], 0.4), ([0.7, 0.85, 0.1], 0.4)]), CLOSED))
    ground = surface.ground()
    found = 0
    for seed in range(12):
        kept = subset(surface, 0.1, seed)
        kept[surface.border] = np.random.default_rng(seed).random(len(surface.border)) < 0.4
        kept |= surface.pinned
        mesh = surface.simplify(kept)
        idle = kept & ~np.isin(np.arange(len(kept)), mesh.faces)
        found += int(idle.sum())
        assert (mesh.deviation[idle] == ground.far[idle]).all()
        assert mesh.quality.vertices == kept.sum() - idle.sum()
    assert found


def test_relocation_lowers_the_error_of_a_mesh_with_holes_and_parts():
    surface = surface_of("parts")
    front = thinning(surface)
    kept = front.kept(int(np.searchsorted(front.triangles, 120, side="right")) - 1)
    size = surface.evaluate(kept)[0, TRIANGLES]
    moved = relocate(surface, kept, moves=5_000, seed=3)
    assert surface.evaluate(moved)[0, TRIANGLES] <= size
    assert surface.evaluate(moved)[0, ERROR] < 0.95 * surface.evaluate(kept)[0, ERROR]


# ---------------------------------------------------------------------------------------------------------------- refit


def to_rims(surface, faces, vertices):
    """Return the mean distance of the vertices of the original's rims from those of a mesh."""
    table = edge_table(faces)
    rim = table.ends[table.n_triangles == 1]
    return distances_to_mesh(surface.points[surface.border], vertices, rim[:, [0, 1, 1]])[0].mean()


def test_refit_moves_rims_to_where_those_of_the_original_are():
    surface = surface_of("bowl")
    front = thinning(surface)
    kept = front.kept(int(np.searchsorted(front.triangles, 60, side="right")) - 1)
    mesh = surface.simplify(kept)
    fitted = surface.refit(mesh)
    assert fitted.error < 0.9 * mesh.quality.error
    points = surface.points.copy()
    points[fitted.rows] = surface.model.to_local(fitted.vertices)
    assert to_rims(surface, mesh.faces, points) < 0.8 * to_rims(surface, mesh.faces, surface.points)
    assert distances(surface.points, points, mesh.faces).sum() == pytest.approx(fitted.error, rel=1e-9)


# ----------------------------------------------------------------------------------------------------------- flattening


@pytest.mark.parametrize("make", [holed, bowl, lambda: without(bumpy(1), [([0.9, 0.3, 0.1], 0.7)])])
def test_holes_are_closed_by_discs_whose_circumference_is_the_rim(make):
    mesh = make()
    points, faces = np.array(mesh.vertices), np.array(mesh.faces, np.int64)
    discs = discs_in_holes(points, faces)
    whole = trimesh.Trimesh(
        np.zeros((len(points) + len(discs.rim_vertex), 3)), np.concatenate([faces, discs.faces]), process=False
    )
    assert whole.is_watertight
    assert whole.is_winding_consistent
    assert whole.euler_number == 2
    assert np.array_equal(
        np.unique(discs.faces[discs.faces >= len(points)]), len(points) + np.arange(len(discs.rim_vertex))
    )
    a, b, c = (discs.corners[:, k] for k in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2.0
    assert (areas > 0.0).all()
    assert areas.sum() < len(set(discs.rim_vertex.tolist())) * np.pi  # round ones of radius 1
    # the shapes around a hole stay in the plane what they are, as they would not with one vertex amid it
    model = open_model(mesh, CLOSED)
    assert np.median(stretches(model)) < (1.35 if model.n_vertices > 100 else 2.0)


def stretches(model):
    """Return how many times longer each face of a model of one part has become along one direction than across."""
    faces = model.faces[~are_poles(model.faces, model.poles)]
    flat, solid = model.xy[faces], model.points[faces]
    found = []
    for p, q in zip(flat, solid, strict=True):
        u, v = q[1] - q[0], q[2] - q[0]
        x = u / np.linalg.norm(u)
        y = v - (v @ x) * x
        y /= np.linalg.norm(y)
        in_plane = np.array([[u @ x, u @ y], [v @ x, v @ y]])
        values = np.linalg.svd(np.linalg.solve(in_plane, np.array([p[1] - p[0], p[2] - p[0]])), compute_uv=False)
        found.append(values[0] / values[1])
    return found


def test_a_plane_in_which_all_is_sheared_is_mended_by_a_robust_mean():
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(300, 3, 3)) * [1.0, 1.0, 0.0]
    images = corners[:, :, :2] @ np.array([[900.0, 0.0], [0.0, 1.0]])
    turned = np.linalg.det(images[:, 1:] - images[:, :1]) < 0
    corners, images = corners[~turned], images[~turned]
    values = np.linalg.svd(np.diag([900.0, 1.0]) @ embedding._unsheared(corners, images), compute_uv=False)
    assert values[0] / values[1] == pytest.approx(1.0, abs=1e-6)


def test_a_pole_keeps_away_from_holes():
    mesh = bowl()
    surface = ClosedSurface(open_model(mesh, CLOSED))
    low = mesh.vertices[:, 2].min()
    assert surface.model.file_points[surface.model.poles[0], 2].max() < 0.4 * low


def test_parts_lie_beside_each_other_and_are_numbered_by_their_poles():
    model = opened("parts")
    boxes = [model.xy[model.part == k] for k in range(3)]
    for k, one in enumerate(boxes):
        for other in boxes[k + 1 :]:
            apart = (one.max(axis=0) < other.min(axis=0)) | (other.max(axis=0) < one.min(axis=0))
            assert apart.any()
    assert model.part[model.poles].tolist() == [[0] * 3, [1] * 3, [2] * 3]


def test_images_of_parts_that_were_stored_are_taken_with_their_poles():
    model = opened("parts")
    order = np.random.default_rng(1).permutation(model.n_vertices)
    other = model.with_images(model.xy[order], model.source_index[order])
    assert other.hash == model.hash
    kept = subset(surface_of("parts"), 0.1, 1)
    there, here = ClosedSurface(other).simplify(kept[order]), ClosedSurface(model).simplify(kept)
    assert there.quality.error == pytest.approx(here.quality.error, rel=1e-9)
    rows = [set(map(tuple, np.sort(m.source_index[m.poles], axis=1).tolist())) for m in (model, other)]
    assert rows[0] == rows[1]


def test_many_parts_are_flattened_one_by_one():
    ball = trimesh.creation.icosphere(subdivisions=1)
    many = []
    for k in range(40):
        one = ball.copy()
        one.vertices += 3.0 * np.array([k % 7, k // 7 % 5, k // 35])
        many.append(one)
    surface = ClosedSurface(open_model(trimesh.util.concatenate(many), CLOSED))
    assert surface.model.n_parts == 40
    kept = subset(surface, 0.2, 1)
    assert surface.evaluate(kept)[0, TRIANGLES] == 2 * kept.sum() - 4 * 40
    everything = surface.simplify(np.ones(surface.n_vertices, bool))
    assert everything.quality.error == 0.0


def test_parts_too_small_to_have_a_mesh_are_left_out_and_said():
    mesh = trimesh.util.concatenate([bumpy(2), trimesh.Trimesh([[9.0, 0, 0], [9, 1, 0], [9, 0, 1]], [[0, 1, 2]])])
    with pytest.warns(ModelWarning, match=r"1 part of fewer than 4 vertices \(1 face\)"):
        model = open_model(as_source(mesh, "bits"), CLOSED)
    assert model.n_vertices == len(mesh.vertices) - 3
    assert model.found["small_parts_left_out"] == 1
    lone = trimesh.Trimesh([[9.0, 0, 0], [9, 1, 0], [9, 0, 1]], [[0, 1, 2]])
    with pytest.raises(ModelError, match="all of its 1 part have fewer than 4 vertices"):
        open_model(as_source(lone, "bit"), CLOSED)


@pytest.mark.parametrize("name", MAKE)
def test_flattening_turns_no_face_over_and_depends_on_no_order(name):
    mesh = MAKE[name]()
    rng = np.random.default_rng(2)
    listed = rng.permutation(len(mesh.vertices))
    place = np.argsort(listed)
    other = open_model(
        trimesh.Trimesh(mesh.vertices[listed], place[rng.permutation(mesh.faces)], process=False), CLOSED
    )
    model = opened(name)
    assert np.array_equal(other.xy, model.xy)
    assert np.array_equal(other.file_points, model.file_points)
    found = embed(model.points, model.faces.astype(np.int64), model.part)
    assert (found.n_flipped, found.n_coinciding) == (0, 0)


def test_a_hole_within_a_hole_is_another_part():
    """An island in a hole of another part."""
    mesh = bumpy()
    island = without(mesh, [([-1.2, 0.0, 0.0], 2.05)])
    island.vertices *= 1.001
    rest = without(mesh, [([0.9, 0.0, 0.0], 0.5)])
    model = open_model(trimesh.util.concatenate([rest, island]), CLOSED)
    assert model.n_parts == 2
    sizes = np.bincount(model.part)
    assert sizes.tolist() in ([len(rest.vertices), len(island.vertices)], [len(island.vertices), len(rest.vertices)])


def test_rims_are_listed_with_the_face_on_their_left():
    model = opened("holed")
    halves = {(a, b) for face in model.faces.tolist() for a, b in pairwise([*face, face[0]])}
    assert all((a, b) in halves and (b, a) not in halves for a, b in model.rim.tolist())


def test_insertion_gives_every_part_a_mesh_however_little_it_counts():
    part = trimesh.creation.icosphere(subdivisions=2)
    crumb = trimesh.creation.icosphere(subdivisions=1, radius=1e-3)
    crumb.apply_translation([3.0, 0.0, 0.0])
    model = open_model(trimesh.util.concatenate([part, crumb]), Options(surface="closed"))
    weights = np.where(model.points[:, 0] > model.points[:, 0].max() - 0.1, 0.0, 1.0)[np.argsort(model.source_index)]
    surface = ClosedSurface(model, Rules(weights=weights))
    front = greedy_insertion(surface, most=20)
    assert np.isfinite(front.error).all()
    assert front.error[0] == pytest.approx(surface.evaluate(front.kept(0))[0, ERROR], rel=1e-9)
    assert front.triangles[0] == 2 * surface.spanning(surface.pinned).sum() - 8
    kept = np.ones(surface.n_vertices, bool)
    assert surface.spanning(kept) is kept


def test_the_smallest_mesh_with_lines_has_four_vertices_of_each_part():
    rims = ClosedSurface(opened("parts"), Rules(break_lines="outline"))
    assert smallest_mesh(rims) == rims.evaluate(rims.spanning(rims.pinned))[0, TRIANGLES] > 0
