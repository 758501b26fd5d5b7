"""For every pixel the nearest triangle is the one that a ray through its middle meets first."""

from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo.report import depth as depth_module
from meshsimp_pymoo.report.depth import seen

WIDTH, HEIGHT = 23, 17


def scene(rng, count):
    """Return triangles of all sizes, some of them partly or wholly outside the picture, some seen along their plane."""
    middle = rng.uniform(-4, [WIDTH + 4, HEIGHT + 4, 30], (count, 1, 3))
    corners = middle + rng.normal(scale=np.geomspace(0.2, 30, count)[:, None, None], size=(count, 3, 3))
    corners[::9, 2] = 0.5 * (corners[::9, 0] + corners[::9, 1])
    return corners


def met_first(corners, x, y):
    """Return the triangle that the ray at (x, y) meets first, and the shares of its corners there."""
    found, nearest, shares = -1, -np.inf, np.zeros(3)
    for k, triangle in enumerate(corners):
        flat = np.vstack([triangle[:, :2].T, np.ones(3)])
        if abs(np.linalg.det(flat)) < 1e-9:
            continue
        share = np.linalg.solve(flat, [x, y, 1.0])
        z = share @ triangle[:, 2]
        if share.min() >= 0 and z > nearest:
            found, nearest, shares = k, z, share
    return found, shares


@pytest.mark.parametrize("most", [40, depth_module.MOST_ROWS])
def test_each_pixel_shows_what_a_ray_meets_first(monkeypatch, most):
    monkeypatch.setattr(depth_module, "MOST_ROWS", most)
    corners = scene(np.random.default_rng(4), 60)
    triangle, shares = seen(corners, WIDTH, HEIGHT)
    assert triangle.shape == (HEIGHT, WIDTH)
    assert len(np.unique(triangle)) > 6
    for y in range(HEIGHT):
        for x in range(WIDTH):
            expected, share = met_first(corners, x + 0.5, y + 0.5)
            assert triangle[y, x] == expected
            np.testing.assert_allclose(shares[y, x], share, atol=1e-9)


def test_the_order_and_the_turn_of_the_triangles_change_nothing():
    corners = scene(np.random.default_rng(5), 40)
    order = np.random.default_rng(6).permutation(len(corners))
    triangle, _ = seen(corners, WIDTH, HEIGHT)
    other, _ = seen(corners[order][:, ::-1], WIDTH, HEIGHT)
    assert (np.where(other >= 0, order[other], -1) == triangle).all()


def test_a_square_of_two_triangles_has_neither_a_gap_nor_an_overlap_that_matters():
    square = np.array([[[2.0, 2, 1], [8, 2, 1], [8, 8, 1]], [[2.0, 2, 1], [8, 8, 1], [2, 8, 1]]])
    triangle, shares = seen(square, 10, 10)
    assert ((triangle >= 0) == np.pad(np.ones((6, 6), bool), 2)).all()
    np.testing.assert_allclose(shares.sum(axis=2), triangle >= 0, atol=1e-12)


def test_nothing_at_all_is_seen_of_nothing():
    triangle, shares = seen(np.empty((0, 3, 3)), 3, 2)
    assert (triangle == -1).all()
    assert not shares.any()
