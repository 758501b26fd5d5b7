"""Closed surfaces: known answers, laws, and an independent twin for the mesh and for the distance."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh
from samples import CLOSED
from scipy.spatial import ConvexHull
from true_distance import distances

from meshsimp_pymoo.arrays import BoolArray
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.surface.closed.model import ClosedModel, closed_model
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.surface import Simplified

# Models without two distances that are the same, small enough for a twin that asks every pair.
GENERIC = ("blob:900", "blob:700,seed=3,stretch=3", "ellipsoid:800", "ellipsoid:600,a=5,seed=4", "sphere:500")


def closed(name: str) -> ClosedSurface:
    return ClosedSurface(closed_model(load(name)))


def with_corners(surface: ClosedSurface) -> BoolArray:
    """Return the subset of the corners of a polyhedron, which are farthest from its centre, and of the pole."""
    away = np.linalg.norm(surface.model.file_points, axis=1)
    return surface.pinned | (away > (1 - 1e-9) * away.max())


def random_subset(surface: ClosedSurface, share: float, seed: int) -> BoolArray:
    return surface.pinned | (np.random.default_rng(seed).random(surface.n_vertices) < share)


# -------------------------------------------------------------------------------------------------------- known answers


@pytest.mark.parametrize(
    ("name", "triangles", "most"),
    [
        ("tetrahedron:5", 8, 1e-15), ("tetrahedron:17", 8, 1e-15), ("icosahedron:3", 24, 1e-15),
        ("icosahedron:9", 24, 1e-15), ("icosahedron:16", 24, 1e-15), ("cube:5", 16, 1e-15), ("cube:17", 16, 1e-3),
    ],
)  # fmt: skip
def test_the_corners_of_a_polyhedron_are_all_of_it(name, triangles, most):
    """The pole is at one of them, so two vertices more are kept. In a cube some look past the side that is nearest."""
    surface = closed(name)
    mesh = surface.simplify(with_corners(surface))
    assert mesh.quality.mean_error < most * surface.diagonal
    assert mesh.quality.triangles == triangles


def test_the_pole_is_at_the_trunk_where_no_corner_is_sharp_or_seen_from_it_things_get_too_small():
    smooth = closed("blob:500")
    centre = smooth.points.mean(axis=0)
    away = np.linalg.norm(smooth.points - centre, axis=1)
    assert away[smooth.model.poles].max() < np.median(away)
    spiked = tube(30.0)
    model = closed_model(spiked)
    assert np.abs(model.points[model.poles] - model.points.mean(axis=0)).max() < 5.0


@pytest.mark.parametrize(("name", "most"), [("tetrahedron:17", 8), ("cube:17", 34), ("icosahedron:9", 44)])
def test_thinning_leaves_hardly_more_of_a_polyhedron_than_its_corners(name, most):
    surface = closed(name)
    front = thinning(surface)
    exact = np.asarray(front.error) < 1e-9 * surface.diagonal
    assert np.asarray(front.triangles)[exact].min() <= most


def test_a_tetrahedron_in_a_ball_is_as_far_from_it_as_reckoned_by_hand():
    """Four points of the sphere: every other one is as far as the nearest face, edge or corner."""
    surface = closed("sphere:400")
    kept = surface.pinned.copy()
    kept[np.argmax(np.linalg.norm(surface.points - surface.points[surface.model.poles[0, 0]], axis=1))] = True
    mesh = surface.simplify(kept)
    assert len(mesh.faces) == 4
    expected = distances(surface.points, surface.points, mesh.faces)
    np.testing.assert_allclose(mesh.deviation, expected, atol=1e-12)  # of four triangles none is farther than across


@pytest.mark.parametrize("name", CLOSED)
def test_all_vertices_kept_are_the_original(name):
    surface = closed(name)
    mesh = surface.simplify(np.ones(surface.n_vertices, bool))
    assert mesh.quality.error == 0.0
    assert mesh.quality.triangles == len(surface.faces)
    assert mesh.quality.vertices == surface.n_vertices


# ----------------------------------------------------------------------------------------------------------------- laws


@pytest.mark.parametrize("name", CLOSED)
def test_any_subset_is_watertight_of_genus_0_and_uses_all_its_vertices(name):
    surface = closed(name)
    for seed, share in enumerate((0.0, 0.004, 0.02, 0.1, 0.5, 0.9)):
        kept = random_subset(surface, share, seed)
        kept[:: surface.n_vertices // 4] = True  # 4 at least
        mesh = surface.simplify(kept)
        n = int(kept.sum())
        assert len(mesh.faces) == mesh.quality.triangles == 2 * n - 4
        assert np.array_equal(np.unique(mesh.faces), np.flatnonzero(kept))
        solid = trimesh.Trimesh(surface.points, mesh.faces, process=False)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        assert solid.euler_number == 2
        assert np.array_equal(surface.triangles(kept), mesh.faces)


@pytest.mark.parametrize("name", GENERIC)
@pytest.mark.parametrize(("centre", "scale"), [((0.5, 0.5), 1.0), ((0.1, 0.7), 0.2), ((0.45, 0.3), 9.0)])
def test_the_mesh_is_the_convex_hull_of_the_images_on_a_sphere(name, centre, scale):
    surface = closed(name)
    flat = (surface.model.xy - centre) * scale
    square = (flat**2).sum(axis=1)
    on_sphere = np.column_stack([2 * flat, square - 1]) / (square + 1)[:, None]
    for seed, share in enumerate((0.02, 0.1, 0.5)):
        kept = random_subset(surface, share, seed)
        rows = np.flatnonzero(kept)
        hull = np.sort(rows[ConvexHull(on_sphere[rows]).simplices], axis=1)
        ours = np.sort(surface.triangles(kept), axis=1)
        assert set(map(tuple, ours.tolist())) == set(map(tuple, hull.tolist()))


@pytest.mark.parametrize("name", GENERIC[:3])
def test_a_model_turned_shifted_scaled_and_listed_otherwise_has_the_same_errors(name):
    source = load(name)
    rng = np.random.default_rng(8)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    listed = rng.permutation(len(source.points))
    place = np.argsort(listed)
    faces = np.array([np.roll(face, k) for k, face in enumerate(place[rng.permutation(source.faces)])])
    moved = dataclasses.replace(source, points=(7.5 * source.points @ turn.T + [3.0, -8.0, 20.0])[listed], faces=faces)
    one, other = (ClosedSurface(closed_model(mesh)) for mesh in (source, moved))
    for share in (0.02, 0.2, 0.6):
        in_file = rng.random(len(source.points)) < share
        in_file[one.model.source_index[one.model.poles[0]]] = True
        assert set(listed[other.model.source_index[other.model.poles[0]]]) <= set(np.flatnonzero(in_file))
        first = one.simplify(in_file[one.model.source_index])
        second = other.simplify(in_file[listed][other.model.source_index])
        assert second.quality.triangles == first.quality.triangles
        assert second.quality.error == pytest.approx(7.5 * first.quality.error, rel=1e-9)
        assert second.quality.max_error == pytest.approx(7.5 * first.quality.max_error, rel=1e-9)


def good_mesh(surface: ClosedSurface, share: float) -> Simplified:
    """Return the mesh of that share of the triangles which thinning leaves."""
    front = thinning(surface)
    row = int(np.argmin(np.abs(np.asarray(front.triangles) - share * len(surface.faces))))
    return surface.simplify(front.kept(row))


@pytest.mark.parametrize("name", ["blob:1500", "blob:1200,seed=3,stretch=2", *GENERIC[2:]])
@pytest.mark.parametrize("share", [0.05, 0.15])
def test_the_error_is_at_least_the_true_distance_and_hardly_more(name, share):
    surface = closed(name)
    mesh = good_mesh(surface, share)
    true = distances(surface.points, surface.points, mesh.faces)
    assert (mesh.deviation >= true - 1e-12 * surface.diagonal).all()
    assert mesh.quality.error <= 1.01 * true.sum()
    assert mesh.quality.rms_error == pytest.approx(np.sqrt((mesh.deviation**2).mean()), rel=1e-12)


@pytest.mark.parametrize(
    "name", ["c_spot", *(pytest.param(f"c_{n}", marks=pytest.mark.slow) for n in ("homer", "cheburashka", "fandisk"))]
)
def test_the_error_of_real_models_is_at_least_the_true_distance_and_hardly_more(name, shared_data):
    with pytest.warns(ModelWarning, match="is no height field but a closed surface, and is taken as one"):
        model = open_model(shared_data / f"{name}.ply")
    assert isinstance(model, ClosedModel)
    surface = ClosedSurface(model)
    for share in (0.05, 0.2):
        mesh = good_mesh(surface, share)
        true = surface.of_faces(mesh.faces)  # compared with the twin below
        assert (mesh.deviation >= true.deviation - 1e-9 * surface.diagonal).all()
        assert mesh.quality.error <= 1.01 * true.quality.error


@pytest.mark.parametrize("name", GENERIC[:3])
def test_a_score_is_the_true_distance_of_the_vertices(name):
    surface = closed(name)
    mesh = surface.simplify(random_subset(surface, 0.1, 1))
    rng = np.random.default_rng(1)
    moved = surface.model.file_points + rng.normal(0.0, 0.01, surface.points.shape)
    scored = surface.score(moved, mesh.faces)
    expected = distances(surface.model.file_points, moved, mesh.faces)
    np.testing.assert_allclose(scored.deviation, expected, atol=1e-12)
    assert scored.quality.error == pytest.approx(expected.sum(), rel=1e-12)
    assert scored.covered.all()


def test_a_refitted_mesh_lies_nearer_to_the_original_and_has_the_same_triangles():
    surface = closed("blob:900")
    mesh = surface.simplify(random_subset(surface, 0.1, 1))
    fitted = surface.refit(mesh)
    assert np.array_equal(fitted.faces, mesh.faces)
    points = surface.model.file_points.copy()
    points[fitted.rows] = fitted.vertices
    after = distances(surface.model.file_points, points, mesh.faces).sum()
    assert after == pytest.approx(fitted.error, rel=1e-9)
    assert after < 0.8 * mesh.quality.error


# ------------------------------------------------------------------------------------------------------------- refusals


def tube(radii: float) -> SourceMesh:
    """Return a closed tube of radius 1, so long, of squares cut in two."""
    around = 12
    n = round(2 * radii)
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    height = np.linspace(0.0, radii, n + 1)
    rings = (ring + np.array([0.0, 0.0, z]) for z in height)
    points = np.concatenate([*rings, [[0.0, 0.0, -0.5], [0.0, 0.0, radii + 0.5]]])
    k = np.arange(around)
    after = (k + 1) % around
    faces = [np.column_stack([np.full(around, len(points) - 2), after, k])]
    for low in around * np.arange(n):
        faces += [
            low + np.column_stack([k, after, after + around]),
            low + np.column_stack([k, after + around, k + around]),
        ]
    faces.append(np.column_stack([np.full(around, len(points) - 1), n * around + k, n * around + after]))
    return SourceMesh(points, np.concatenate(faces), {}, "tube")


def torus() -> SourceMesh:
    ring = trimesh.creation.torus(1.0, 0.3, major_sections=12, minor_sections=8)
    return SourceMesh(np.array(ring.vertices), np.array(ring.faces, np.int64), {}, "torus")


def finned() -> SourceMesh:
    one = load("sphere:60")
    a, b = one.faces[0][:2]
    points = np.concatenate([one.points, [[3.0, 0.0, 0.0]]])
    return SourceMesh(points, np.concatenate([one.faces, [[a, b, 60]]]), {}, "finned")


def wound_against(face: int) -> SourceMesh:
    """Return a sphere with one face turned over."""
    one = load("sphere:60")
    faces = one.faces.copy()
    faces[face] = faces[face, ::-1]
    return SourceMesh(one.points, faces, {}, "against")


def flattened() -> SourceMesh:
    rim = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]], float)
    points = np.column_stack([np.concatenate([rim, [[1.0, 1.0], [0.9, 1.1]]]), np.zeros(10)])
    k = np.arange(8)
    up = np.column_stack([np.full(8, 8), k, (k + 1) % 8])
    return SourceMesh(points, np.concatenate([up, np.where(up == 8, 9, up)[:, ::-1]]), {}, "flattened")


def smaller(by: float) -> SourceMesh:
    one = load("sphere:60")
    return SourceMesh(by * one.points, one.faces, {}, "smaller")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (torus, "torus: has genus 1"),
        (finned, r"finned: is not manifold \(1 edge of more than two faces\), first at \("),
        (lambda: tube(100), "tube: cannot be flattened: .* coincide and .* flipped"),
        (lambda: wound_against(3), "against: is not wound alike, or has one side only .3 edges between"),
        (lambda: dataclasses.replace(load("roof:3"), name="roof"), "roof: is a grid, which has one height .* leave"),
        (flattened, "flattened: all 10 vertices lie in one plane"),
        (lambda: smaller(1e-160), "smaller: extends over 1.97574e-160 only; rescale the model to above 1e-60"),
        (lambda: smaller(1e-310), "smaller: extends over 1.97574e-310 only"),
    ],
)
def test_what_is_no_closed_surface_of_genus_0_is_refused_in_one_line(make, says):
    with pytest.raises(ModelError, match=says) as caught:
        open_model(make(), Options(surface="closed", repair="none"))
    assert "\n" not in str(caught.value)


def test_a_ring_among_real_models_is_refused_in_one_line(shared_data):
    with pytest.raises(ModelError, match="has genus 1") as caught:
        open_model(shared_data / "c_rockerarm.ply", Options(surface="closed"))
    assert "\n" not in str(caught.value)


def test_a_fin_is_mended_and_said():
    with pytest.warns(ModelWarning) as told:
        model = open_model(finned(), Options(surface="closed"))
    assert model.n_vertices == 60
    assert any("1 face that stand on edges of two others" in str(warning.message) for warning in told)


def test_a_limb_of_60_radii_can_be_flattened_from_its_middle():
    surface = ClosedSurface(closed_model(tube(60)))
    mesh = surface.simplify(np.ones(surface.n_vertices, bool))
    assert mesh.quality.triangles == len(surface.faces)


def test_without_a_word_about_its_kind_it_is_refused_in_one_line_too():
    with pytest.raises(ModelError, match="closed surface") as caught:
        open_model(torus())
    assert "\n" not in str(caught.value)


def test_a_closed_built_in_is_no_height_field():
    with pytest.raises(ModelError, match="sphere:60: faces all ways alike"):
        open_model("sphere:60", Options(surface="height"))
