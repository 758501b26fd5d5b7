from __future__ import annotations

import copy

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.plane.order import find_corners, vector_order
from meshsimp_pymoo.surface.model import build_model, placed_model

SIDE = 16


@pytest.fixture(scope="module")
def face():
    return build_model(load("face:400"))


def test_vector_order_is_a_hilbert_curve():
    cells = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), -1).reshape(-1, 2)
    order = vector_order((cells + 0.5) / SIDE, np.zeros(len(cells)))
    steps = np.abs(np.diff(cells[order], axis=0)).sum(axis=1)
    np.testing.assert_array_equal(steps, 1)


@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 2)), min_size=4, max_size=30),
    st.randoms(use_true_random=False),
)
def test_vector_order_depends_on_the_positions_alone(rows, random):
    points = np.array(rows, float) / 4
    shuffled = points[random.sample(range(len(points)), len(points))]
    np.testing.assert_array_equal(
        points[vector_order(points[:, :2], points[:, 2])], shuffled[vector_order(shuffled[:, :2], shuffled[:, 2])]
    )


@pytest.mark.parametrize(
    ("xy", "expected"),
    [
        ([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]], [0, 1, 2, 3]),
        ([[0, 0.5], [0.5, 0], [1, 0.5], [0.5, 1], [0.5, 0.5]], [0, 1, 2, 3]),
        ([[0, 0], [1, 0], [1, 0.01], [0, 0.01], [0.3, 0.004]], [0, 1, 2, 3]),
        ([[0, 0], [1, 0], [0.5, 1], [0.5, 0.5]], [0, 1, 2]),
        ([[0, 0], [0.25, 0.25], [0.5, 0.5 + 2**-50], [1, 1]], [0, 2, 3]),
    ],
    ids=["square", "diamond", "strip", "triangle", "nearly a line"],
)
def test_corners_are_extreme_in_the_four_diagonal_directions(xy, expected):
    np.testing.assert_array_equal(find_corners(np.array(xy, float)), expected)


def test_points_are_the_file_s_points_upright_from_a_local_origin(face):
    np.testing.assert_allclose(face.to_local(face.file_points), face.points, atol=1e-12 * face.diagonal)
    np.testing.assert_array_equal(face.points.min(axis=0), 0)
    np.testing.assert_array_equal(face.file_points, load("face:400").points[face.source_index])
    np.testing.assert_allclose(face.xy * face.unit, face.points[:, :2], atol=2**-52 * face.unit)
    assert (np.ldexp(face.xy, 52) % 1 == 0).all()
    assert face.xy.max() > 0.5


def test_faces_are_counter_clockwise_from_above(face):
    a, b, c = (face.points[face.faces[:, k], :2] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    assert (area > 0).mean() > 0.99


def test_one_rings_are_those_of_the_mesh(face):
    indptr, indices = face.neighbours
    mesh = trimesh.Trimesh(face.points, face.faces, process=False)
    for i, ring in enumerate(mesh.vertex_neighbors):
        np.testing.assert_array_equal(indices[indptr[i] : indptr[i + 1]], sorted(ring))


def test_the_hull_of_a_grid_is_its_whole_border():
    grid = build_model(grid_source(np.random.default_rng(0).random((5, 7)), 2.0, 3.0), up="z")
    x, y = grid.points[:, 0], grid.points[:, 1]
    border = (x == 0) | (x == x.max()) | (y == 0) | (y == y.max())
    np.testing.assert_array_equal(grid.hull, np.flatnonzero(border))


def test_unused_vertices_are_left_out_with_a_count():
    source = load("plane:3")
    more = SourceMesh(np.vstack([[[50.0, 50, 50]], source.points]), source.faces + 1, {}, "more")
    with pytest.warns(ModelWarning, match="1 of 10 vertices belong to no face"):
        model = build_model(more, up="z")
    assert model.n_vertices == 9
    assert 0 not in model.source_index


def test_attributes_follow_their_vertices():
    source = load("plane:3")
    label = np.arange(len(source.points))
    model = build_model(SourceMesh(source.points, source.faces, {"label": label}, "labelled"))
    np.testing.assert_array_equal(model.attributes["label"], model.source_index)


@pytest.mark.parametrize("up", ["x", "y", "z", "-z", (1.0, 2.0, 3.0)])
def test_a_model_turned_any_way_is_the_same_model(up):
    source = load("face:300")
    base = build_model(source, up="z")
    axis = (
        np.eye(3)[["x", "y", "z"].index(up[-1])] * (-1 if up[0] == "-" else 1) if isinstance(up, str) else np.array(up)
    )
    turn = trimesh.geometry.align_vectors([0, 0, 1], axis / np.linalg.norm(axis))[:3, :3]
    turned = build_model(SourceMesh(source.points @ turn.T, source.faces, {}, "turned"), up=up)
    np.testing.assert_allclose(turned.up, axis / np.linalg.norm(axis), atol=1e-12)
    place = np.argsort(turned.source_index)[base.source_index]
    np.testing.assert_allclose(np.sort(turned.points[place, 2]), np.sort(base.points[:, 2]), atol=1e-9 * base.diagonal)
    np.testing.assert_allclose(
        np.linalg.norm(turned.points[place][1:] - turned.points[place][:-1], axis=1),
        np.linalg.norm(np.diff(base.points, axis=0), axis=1),
        atol=1e-9 * base.diagonal,
    )


def test_copies_share_the_model_and_the_hash_follows_the_geometry(face):
    assert copy.deepcopy(face) is face
    assert build_model(load("face:400")).hash == face.hash
    assert build_model(load("face:400,seed=2")).hash != face.hash
    assert len(face) == face.n_vertices == 400


def test_a_model_put_together_from_arrays_is_in_the_frame_of_its_file(face):
    model = placed_model(
        "placed", face.points, face.faces, face.corners, xy=face.xy, unit=face.unit, source_index=face.source_index
    )
    np.testing.assert_array_equal(model.to_local(model.file_points), face.points)


# ------------------------------------------------------------------------------------------------- weights


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
    for of_weighted, of_plain in zip(model.neighbours, build_model(named, up="z").neighbours, strict=True):
        np.testing.assert_array_equal(of_weighted, of_plain)


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
