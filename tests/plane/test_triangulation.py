from __future__ import annotations

import numpy as np
import pytest
from delaunay import assert_delaunay, canonical, faces_of
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from meshsimp_pymoo.plane.order import vector_order

SCALE = 2**52


def distinct(rows):
    return np.array(sorted(set(rows)), float) / SCALE


grid_points = st.lists(
    st.tuples(st.integers(0, 5), st.integers(0, 5)).map(lambda p: (p[0] * SCALE // 8, p[1] * SCALE // 8)),
    min_size=3,
    max_size=24,
).map(distinct)
free_points = st.lists(st.tuples(st.integers(0, SCALE), st.integers(0, SCALE)), min_size=3, max_size=24).map(distinct)
# Points 1e-15 apart, and others far away.
huddled_points = st.lists(
    st.tuples(st.integers(-3, 3), st.integers(-3, 3)).map(lambda p: (SCALE // 2 + 4 * p[0], SCALE // 2 + 4 * p[1])),
    min_size=3,
    max_size=12,
).map(lambda rows: distinct([*rows, (0, 0), (SCALE, 0), (SCALE, SCALE), (0, SCALE)]))
# Close to one line: y = x with at most two quanta of noise.
nearly_collinear = st.lists(
    st.tuples(st.integers(0, 1000), st.integers(-2, 2)).map(
        lambda p: (p[0] * (SCALE // 1024), max(p[0] * (SCALE // 1024) + p[1], 0))
    ),
    min_size=3,
    max_size=16,
).map(distinct)
point_sets = st.one_of(grid_points, free_points, huddled_points, nearly_collinear)


@given(point_sets, st.randoms(use_true_random=False))
def test_any_order_of_insertion_gives_the_one_delaunay_triangulation(xy, random):
    faces = faces_of(xy)
    assert_delaunay(xy, faces)
    order = list(range(len(xy)))
    random.shuffle(order)
    np.testing.assert_array_equal(faces_of(xy, order=order), faces)
    np.testing.assert_array_equal(faces_of(xy, order=order, exact=False), faces)
    np.testing.assert_array_equal(faces_of(xy, first=random.sample(order, min(4, len(order)))), faces)


@pytest.mark.parametrize("n", [4, 5, 30, 1000, 6000])
def test_random_points_agree_with_qhull(n):
    xy = (np.random.default_rng(n).random((n, 2)) + 1.0) - 1.0
    xy = xy[vector_order(xy, np.zeros(n))]
    ours = {tuple(sorted(face)) for face in faces_of(xy).tolist()}
    theirs = {tuple(sorted(face)) for face in Delaunay(xy).simplices.tolist()}
    assert ours == theirs


def test_a_full_grid_of_six_thousand_points_takes_the_sparse_round_and_the_same_ties():
    side = 80
    xy = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2) / 128
    xy = xy[vector_order(xy, np.zeros(len(xy)))]
    faces = faces_of(xy)
    assert len(faces) == 2 * (side - 1) ** 2
    order = np.random.default_rng(0).permutation(len(xy))
    np.testing.assert_array_equal(faces_of(xy, order=order), faces)


def test_of_four_cocircular_points_the_last_one_is_cut_off():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    np.testing.assert_array_equal(faces_of(square), canonical([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_array_equal(faces_of(np.roll(square, -1, axis=0)), canonical([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_array_equal(faces_of(square[[0, 1, 3, 2]]), canonical([[0, 1, 2], [1, 3, 2]]))


def test_points_on_one_line_have_no_triangle():
    assert len(faces_of(np.array([[0.0, 0], [0.25, 0.25], [0.5, 0.5], [1, 1]]))) == 0


def test_points_on_one_line_and_one_beside_it_make_a_fan():
    xy = np.array([[0.0, 0], [0.25, 0], [0.5, 0], [0.75, 0], [1, 0], [0.5, 0.5]])
    faces = faces_of(xy)
    assert len(faces) == 4
    assert (faces == 5).any(axis=1).all()
