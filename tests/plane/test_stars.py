from __future__ import annotations

import numpy as np
import pytest
from counts import tried
from from_python import from_python

from meshsimp_pymoo.plane import stars
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import INFINITE, triangulate_once

triangles_around, fill, fill_large = map(from_python, (stars.triangles_around, stars.fill, stars.fill_large))


def points_of(kind, n, rng):
    """Distinct points of the unit square, in any order: anywhere, on a lattice, on its circle, or on a line but one."""
    if kind == "line":
        xy = np.r_[np.column_stack([np.arange(n) / 256, np.zeros(n)]), [[0.25, 0.5]]]
    elif kind == "circle":
        side = np.array([(0, 5), (3, 4), (4, 3), (5, 0), (4, -3), (3, -4)])
        xy = np.r_[side, -side, side[:, ::-1] * [1, -1], side[:, ::-1] * [-1, 1], [[0, 0], [1, 1], [7, 6]]]
        xy = np.unique(xy, axis=0) / 16 + 0.5
    else:
        xy = np.unique(rng.integers(0, 7, (n, 2)), axis=0) / 8 if kind == "lattice" else rng.random((n, 2))
    xy = np.round(xy * 2.0**52) / 2.0**52
    return xy[rng.permutation(len(xy))]


@tried("rounds", 3)
@pytest.mark.parametrize("kind", ["anywhere", "lattice", "circle", "line"])
def test_a_large_star_is_filled_as_by_ears_and_its_sides_are_linked(kind, rounds):
    rng = np.random.default_rng(1)
    for n in np.repeat([8, 20, 60], rounds):
        points = points_of(kind, n, rng)
        n, xy = len(points), points.ravel()
        ranges = exact_ranges(points)
        mesh, other = np.empty(16 * n, np.uint32), np.empty(16 * n, np.uint32)
        none, inserted = np.empty(0, np.int64), np.empty(n, np.uint8)
        end = triangulate_once(xy, n, none, none, inserted, mesh, *ranges)
        for p in range(n):
            t = 8 * int(np.flatnonzero((mesh[:end].reshape(-1, 8)[:, :3] == p).any(axis=1))[0])
            star, rim, ring = (np.empty(2 * n, np.uint32) for _ in range(3))
            m = triangles_around(mesh, t, p, star, rim, ring)
            around = ring[:m].astype(np.int64)
            ears, edges = np.empty((2 * n, 3), np.uint32), np.empty((2 * n, 3), np.int32)
            workspace = np.empty(n, np.int32), np.empty(n, np.int64), np.empty(2 * n + 8, np.uint32)
            count = fill_large(xy, p, ring, m, ears, edges, other, inserted, *workspace, *ranges)
            expected, its_edges = np.empty_like(ears), np.empty_like(edges)
            assert count == fill(xy, ring, m, 0, np.empty(2 * n, np.int32), expected, its_edges, *ranges) == m - 2
            found = ears[:count].astype(np.int64)
            np.testing.assert_array_equal(canonical_faces(found), canonical_faces(expected[:count].astype(np.int64)))
            sides = edges[:count].ravel()
            starts = found.ravel()
            np.testing.assert_array_equal(np.sort(sides[sides < m]), np.arange(m))
            np.testing.assert_array_equal(starts[sides < m], around[sides[sides < m]])
            for k in range(count - 1):  # the third side of each ear but the last is a later one's, the other way round
                here, there = np.flatnonzero(sides == m + k)
                assert here == 3 * k + 2 < there
                assert starts[there] == found[k, 0]
                assert np.roll(found[there // 3], -1)[there % 3] == found[k, 2]
        assert (mesh[:end] == INFINITE).any()
