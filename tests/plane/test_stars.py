from __future__ import annotations

import numpy as np
import pytest
from counts import tried
from delaunay import orient
from from_python import from_python
from lining import apexes, locally_delaunay, whole_numbers

from meshsimp_pymoo.plane import stars
from meshsimp_pymoo.plane.constraints import make_constraints
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import INFINITE, triangulate_once

triangles_around, fill, fill_large, fill_beside_lines = map(
    from_python, (stars.triangles_around, stars.fill, stars.fill_large, stars.fill_beside_lines)
)


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
            assert count == fill(xy, ring, m, np.empty(2 * n, np.int32), expected, its_edges, *ranges) == m - 2
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


def spiky_ring(rng, on_line):
    """The first vertex, and a ring around it with spikes; with ``on_line`` it is between two vertices of the ring."""
    m = int(rng.integers(4, 14))
    turn = np.sort(rng.random(m)) * 2 * np.pi
    if np.diff(turn, append=turn[0] + 2 * np.pi).max() > 0.9 * np.pi:
        return spiky_ring(rng, on_line)
    radius = np.where(rng.random(m) < 0.5, 0.4, 0.08) * (0.7 + 0.3 * rng.random(m))
    scale = 64 if rng.random() < 0.5 else 2**40
    ring = np.round(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]) * scale) / scale
    if on_line:
        at = int(np.flatnonzero(turn > turn[0] + np.pi)[0]) if (turn > turn[0] + np.pi).any() else m
        ring = np.insert(ring, at, -ring[0] * float(rng.choice([0.25, 0.5, 1.0])), axis=0)
    xy = np.r_[[(0.0, 0.0)], ring] + 0.5
    points = whole_numbers(xy)
    m = len(ring)
    if any(orient(points[0], points[1 + k], points[1 + (k + 1) % m]) <= 0 for k in range(m)):
        return spiky_ring(rng, on_line)
    return xy


@tried("rounds", 100)
@pytest.mark.parametrize("on_line", [False, True])
def test_a_star_within_forced_edges_is_filled_by_what_is_seen_in_it(on_line, rounds):
    rng = np.random.default_rng(3)
    for _ in range(rounds):
        xy = spiky_ring(rng, on_line)
        m = len(xy) - 1
        ring = np.arange(1, m + 1)
        sides = np.column_stack([ring, np.roll(ring, -1)])
        across = [(1, int(k)) for k in ring if on_line and (xy[k] - 0.5) @ (xy[1] - 0.5) < 0 and _opposite(xy, k)]
        lines = make_constraints(xy, np.concatenate([sides, across]) if across else sides)
        ears, edges = np.empty((2 * m, 3), np.uint32), np.empty((2 * m, 3), np.int32)
        workspace = np.empty(16 * m, np.uint32), np.empty(2 * m, np.uint32)
        around = ring.astype(np.uint32)
        ranges = exact_ranges(xy)
        count = fill_beside_lines(
            xy.ravel(), 0, around, m, np.empty(2 * m, np.int32), ears, edges, *workspace, lines, *ranges
        )
        assert count == m - 2
        faces, points = ears[:count].astype(np.int64), whole_numbers(xy)
        area = sum(orient(points[0], points[a], points[b]) for a, b in sides.tolist())
        found = [orient(*(points[i] for i in face)) for face in faces.tolist()]
        assert min(found) > 0
        assert sum(found) == area
        apex = apexes(faces)
        assert {tuple(side) for side in sides.tolist()} <= set(apex)
        assert all((a, b) in apex and (b, a) in apex for a, b in across)
        assert locally_delaunay(points, apex, {tuple(sorted(pair)) for pair in across})
        sides_of_ears, starts = edges[:count].ravel(), faces.ravel()
        np.testing.assert_array_equal(starts[sides_of_ears < m], ring[sides_of_ears[sides_of_ears < m]])
        for k in range(count - 1):
            here, there = np.flatnonzero(sides_of_ears == m + k)
            assert here == 3 * k + 2 < there
            assert starts[there] == faces[k, 0]


def _opposite(xy, k):
    """Whether vertex 0 lies on the segment between vertices 1 and k."""
    points = whole_numbers(xy)
    return orient(points[1], points[k], points[0]) == 0
