"""What is said of a mesh as a whole: how far it is from the surface between the vertices, and its least angles."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from counts import tried
from nasty import SOURCES, nasty_model
from samples import SMALL, subset, surface

from meshsimp_pymoo import Front, MeshProblem
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.plane.faces import least_angles
from meshsimp_pymoo.surface.centroids import centroids_of, with_centroids
from meshsimp_pymoo.surface.evaluate import make_workspace, triangulate_subset
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import OF_MESH, TRIANGLES
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES
from meshsimp_pymoo.surface.surface import measured_meshes
from meshsimp_pymoo.workers import Reserve

RULES = list(itertools.product(FOOTPRINTS, OUTSIDES))


@pytest.fixture(scope="module", params=SMALL)
def model(request):
    return build_model(SMALL[request.param](), up="z")


def of_mesh(quality):
    return np.array([getattr(quality, name) for name in OF_MESH])


def twin(model, vertices, faces, outside):
    """The mean deviation at the centroids of the original faces, by its definition, triangle by triangle."""
    corners = model.points[model.faces]
    (ux, uy), (vx, vy) = ((corners[:, k, :2] - corners[:, 0, :2]).T for k in (1, 2))
    area = np.abs(ux * vy - uy * vx)
    samples = corners.mean(axis=1)[area > 0]
    d, covered = np.full(len(samples), np.inf), np.zeros(len(samples), bool)
    near, at_near = np.full(len(samples), np.inf), np.zeros(len(samples))
    for a, b, c in vertices[faces]:
        whole = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(whole) <= 1e-14 * np.ptp(model.points[:, :2], axis=0).max() ** 2:
            continue
        p = samples[:, :2] - a[:2]
        wb = (p[:, 0] * (c[1] - a[1]) - p[:, 1] * (c[0] - a[0])) / whole
        wc = (p[:, 1] * (b[0] - a[0]) - p[:, 0] * (b[1] - a[1])) / whole
        inside = np.minimum(np.minimum(wb, wc), 1 - wb - wc) >= -1e-9
        covered |= inside
        here = np.abs(a[2] + wb * (b[2] - a[2]) + wc * (c[2] - a[2]) - samples[:, 2])
        d[inside] = np.minimum(d[inside], here[inside])
        for u, v in ((a, b), (b, c), (c, a)):
            along = v[:2] - u[:2]
            t = np.clip((samples[:, :2] - u[:2]) @ along / (along @ along), 0, 1)
            away = np.linalg.norm(samples[:, :2] - u[:2] - t[:, None] * along, axis=1)
            closer = away < near
            near[closer] = away[closer]
            at_near[closer] = np.hypot(away, u[2] + t * (v[2] - u[2]) - samples[:, 2])[closer]
    d[~covered] = at_near[~covered] if outside == "nearest" else 0.0
    return np.average(d, weights=area[area > 0]), covered


def test_a_roof_without_its_ridge_is_half_its_height_away():
    """The centroids lie at a third and at two thirds of it, as many at one as at the other."""
    rated = surface("roof:3")
    flat = rated.simplify(rated.pinned).quality
    assert flat.triangles == 2
    assert flat.surface_error == pytest.approx(0.5, rel=1e-12)
    width, depth = np.ptp(rated.points[:, :2], axis=0)
    assert flat.min_angle_median == pytest.approx(np.degrees(np.arctan2(*sorted([width, depth]))), rel=1e-12)
    assert flat.below_5_degrees == 0.0
    assert rated.simplify(np.ones(9, bool)).quality.surface_error == pytest.approx(0.0, abs=1e-15)


def test_each_face_counts_by_its_area():
    """Over a flat floor of two faces and a ramp, a third as wide, that rises by 3: to 1 and to 2 at its centroids."""
    points = np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0], [4, 0, 3], [4, 2, 3]])
    faces = np.array([[0, 1, 3], [1, 2, 3], [1, 4, 2], [4, 5, 2]])
    rated = surface(build_source(points, faces, name="floor"))
    sheet = np.array([[0.0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]])
    quality = rated.score(sheet, [[0, 1, 2], [0, 2, 3]]).quality
    assert quality.surface_error == pytest.approx((1 * 1.0 + 1 * 2.0) / 8)  # areas 3, 3, 1, 1; heights 0, 0, 1, 2
    assert quality.error == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("triangle", "degrees"),
    [
        ([(0, 0), (1, 0), (0.5, np.sqrt(0.75))], 60),
        ([(0, 0), (0, 7), (7, 0)], 45),
        ([(0, 0), (np.sqrt(3), 0), (0, 1)], 30),
        ([(0, 0), (1, 0), (np.cos(np.radians(4)), np.sin(np.radians(4)))], 4),
        ([(0, 0), (1e6, 0), (5e5, 1e-3)], np.degrees(2e-9)),
        ([(0, 0), (1, 1), (3, 3)], 0),
        ([(2, 2), (2, 2), (3, 3)], 0),
    ],
)
def test_the_least_angle_of_a_triangle_is_known_however_it_lies(triangle, degrees):
    corners = np.array(triangle, float)
    for turn in itertools.permutations(range(3)):
        assert least_angles(corners, np.array([turn]))[0] == pytest.approx(degrees, rel=1e-9)
    c, s = np.cos(0.7), np.sin(0.7)
    moved = 3.0 * corners @ np.array([[c, s], [-s, c]])
    assert least_angles(moved, np.array([[0, 1, 2]]))[0] == pytest.approx(degrees, rel=1e-6, abs=1e-12)


def test_the_median_and_the_share_of_thin_ones_are_over_the_triangles():
    rated = surface("plane:5")
    points = np.array([[0.0, 0, 0], [1, 0, 0], [np.cos(0.05), np.sin(0.05), 0], [0, 1, 0], [-1, 0, 0]])
    low, extent = rated.model.file_points.min(axis=0), np.ptp(rated.model.file_points[:, :2], axis=0).min()
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4]]  # 0.05 rad; the rest of a right angle, isosceles; 45 degrees
    angles = np.degrees([0.05, (np.pi - (np.pi / 2 - 0.05)) / 2, np.pi / 4])
    angles[1] = min(angles[1], np.degrees(np.pi / 2 - 0.05))
    quality = rated.score(low + extent * points, faces).quality
    assert quality.min_angle_median == pytest.approx(np.median(angles), rel=1e-9)
    assert quality.below_5_degrees == pytest.approx(1 / 3)
    quality = rated.score(low + extent * points, faces[:2]).quality
    assert quality.min_angle_median == pytest.approx(angles[:2].mean(), rel=1e-9)


def test_the_original_mesh_is_the_surface(model):
    for footprint, outside in RULES:
        scored = surface(model, footprint=footprint, outside=outside).score(model.file_points, model.faces).quality
        assert scored.surface_error <= 1e-12 * model.diagonal
        assert scored.error <= 1e-12 * model.diagonal * model.n_vertices


def test_it_is_what_its_slow_twin_says(model):
    for (footprint, outside), share in zip(RULES, (0.05, 0.2, 0.4, 0.1), strict=True):
        rated = surface(model, footprint=footprint, outside=outside)
        mesh = rated.simplify(subset(model, share))
        expected, covered = twin(model, model.points, mesh.faces, outside)
        assert mesh.quality.surface_error == pytest.approx(expected, rel=1e-9)
        angles = least_angles(model.points[:, :2], mesh.faces)
        assert mesh.quality.min_angle_median == np.median(angles)
        assert mesh.quality.below_5_degrees == np.count_nonzero(angles < 5) / len(angles)
    # folded, beside the model, upright: each as it comes
    rng = np.random.default_rng(1)
    vertices = model.points[rng.integers(model.n_vertices, size=12)] + rng.normal(0, 0.1, (12, 3))
    faces = rng.integers(12, size=(9, 3))
    for outside in OUTSIDES:
        rated = surface(model, outside=outside)
        in_file = vertices @ model.rotation / model.scale + (model.file_points - model.points @ model.rotation)[0]
        expected, covered = twin(model, vertices, faces, outside)
        assert not covered.all()
        assert rated.score(in_file, faces).quality.surface_error == pytest.approx(expected, rel=1e-6)


@tried("subsets", 2)
@pytest.mark.parametrize("name", sorted(SOURCES))
def test_a_subset_and_its_mesh_from_a_file_say_the_same_on_nasty_models(name, subsets):
    model = nasty_model(name)
    for k, (footprint, outside) in itertools.product(range(subsets), RULES):
        rated = surface(model, footprint=footprint, outside=outside)
        kept = subset(model, np.random.default_rng(k).random(), seed=k)
        if rated.evaluate(kept)[0, TRIANGLES] == 0:
            kept = np.ones_like(kept)
        mesh = rated.simplify(kept)
        scored = rated.score(model.file_points, mesh.faces).quality
        # a height in a triangle as low as the slivers drawn is worth that many digits less
        rounding = (1e-9 if name == "slivers" else 1e-12) * model.diagonal
        assert scored.surface_error == pytest.approx(mesh.quality.surface_error, rel=1e-9, abs=rounding)
        assert scored.min_angle_median == pytest.approx(mesh.quality.min_angle_median, rel=1e-9)
        assert scored.below_5_degrees == mesh.quality.below_5_degrees


def test_centroids_as_further_samples_are_measured_the_same(model):
    for (footprint, outside), share in itertools.product(RULES, (0.1, 0.5)):
        rated, kept = surface(model, footprint=footprint, outside=outside), subset(model, share)
        both, area, _ = with_centroids(rated.ground(), model)
        n = len(both.z)
        beside = np.r_[kept, np.zeros(n - model.n_vertices, bool)]
        both = both._replace(weight=np.empty(0))
        deviation = triangulate_subset(both, Reserve(lambda n=n: make_workspace(n)), beside)[2]
        expected = (area * deviation[model.n_vertices :]).sum()
        assert rated.simplify(kept).quality.surface_error == pytest.approx(expected, rel=1e-12)
    assert len(area) == len(centroids_of(model)[1])
    assert area.sum() == pytest.approx(1.0)


def test_weights_do_not_matter(model):
    rng = np.random.default_rng(3)
    weights = rng.random(model.n_vertices) * (rng.random(model.n_vertices) < 0.7) * 9
    weights[model.corners] = 1.0
    kept = subset(model, 0.2)
    plain, weighed = HeightSurface(model), HeightSurface(replace(model, weights=weights))
    faces = plain.triangles(kept)
    for make in (lambda rated: rated.simplify(kept), lambda rated: rated.score(model.file_points, faces)):
        assert of_mesh(make(plain).quality).tolist() == of_mesh(make(weighed).quality).tolist()
        assert make(plain).quality.error != make(weighed).quality.error


def test_searches_do_not_pay_for_it_and_fronts_know_it():
    problem = MeshProblem("peaks:9")
    X = np.array([subset(problem.model, share, seed) for seed, share in enumerate(np.linspace(0.05, 0.9, 20))])
    for out in problem.evaluate(X, return_as_dictionary=True)["uncovered"], problem.outcome(np.ones(6)):
        assert not {*OF_MESH} & {*(out if isinstance(out, dict) else ())}
    front = Front.from_subsets(problem, X)
    for solution in front:
        assert solution.quality == problem.quality(solution.kept)
        assert np.isfinite(of_mesh(solution)).all()
    late = Front.from_subsets(problem, X, until=0.0)
    assert np.isnan([of_mesh(solution) for solution in late]).all()
    assert late.F.tolist() == front.F.tolist()
    for n_threads in (1, 2, 5):
        assert measured_meshes(problem.surface, front.kept, late.quality, n_threads=n_threads) == list(front.quality)


def test_a_subset_without_a_triangle_is_no_mesh_to_measure():
    problem = MeshProblem("peaks:9")
    nothing = np.zeros((1, problem.n_var), bool)
    quality = [problem.as_quality(row) for row in problem.surface.evaluate(nothing)]
    assert measured_meshes(problem.surface, nothing, quality) == quality
