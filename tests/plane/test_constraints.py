from __future__ import annotations

import numpy as np
import pytest
from counts import tried
from delaunay import orient
from from_python import from_python
from lining import (
    assert_constrained_delaunay,
    constrained_faces,
    random_segments,
    whole_numbers,
    with_segments,
)
from samples import surface
from scipy.spatial import Delaunay

from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.plane import triangulation
from meshsimp_pymoo.plane.constraints import make_constraints
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD
from meshsimp_pymoo.surface.books import END
from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
from meshsimp_pymoo.surface.model import build_model, placed_model

GRID = build_model(grid_source(np.zeros((3, 3))))


def row(x, y):
    """The vertex of the 3 x 3 grid at a place."""
    return int(np.flatnonzero((GRID.points[:, :2] == (x, y)).all(axis=1))[0])


def edges(faces):
    return {tuple(sorted((int(face[k]), int(face[k - 1])))) for face in faces for k in range(3)}


def flat(xy):
    """A model of distinct points (N, 2) in [0, 1], without a look at them, at heights of 0."""
    xy = np.round(np.asarray(xy, float) * 2.0**52) / 2.0**52
    n = len(xy)
    points, rows = np.column_stack([xy, np.zeros(n)]), np.arange(n)
    return placed_model("flat", points, Delaunay(xy).simplices, rows[:3], xy=xy, unit=1.0, source_index=rows)


def whole(model):
    return surface(model, footprint="hull", outside="ignore")


@pytest.mark.parametrize("cell", [(x, y) for x in (0, 1) for y in (0, 1)])
def test_a_diagonal_is_forced_against_the_tie_rule(cell):
    x, y = cell
    diagonals = [(row(x, y), row(x + 1, y + 1)), (row(x + 1, y), row(x, y + 1))]
    everything = np.ones(9, bool)
    usual = edges(whole(GRID).triangles(everything))
    other = next(pair for pair in diagonals if tuple(sorted(pair)) not in usual)
    found = edges(whole(with_segments(GRID, [other])).triangles(everything))
    assert tuple(sorted(other)) in found
    assert len(found ^ usual) == 2  # the one diagonal for the other, and nothing else


def test_a_line_through_collinear_vertices_is_the_chain_of_those_that_are_kept():
    model = with_segments(GRID, [(row(0, 0), row(2, 2))])
    middle = row(1, 1)
    kept = np.zeros(9, bool)
    kept[[row(0, 0), row(2, 2), row(0, 2), row(2, 0)]] = True
    ends = tuple(sorted((row(0, 0), row(2, 2))))
    assert ends in edges(whole(model).triangles(kept))
    kept[middle] = True
    found = edges(whole(model).triangles(kept))
    assert ends not in found
    assert {tuple(sorted((middle, end))) for end in ends} <= found


def test_constraints_list_all_vertices_on_each_segment_in_order():
    rng = np.random.default_rng(0)
    xy = np.unique(rng.integers(0, 9, (70, 2)), axis=0)[::-1] / 8.0
    segments = rng.choice(len(xy), (30, 2))
    segments = segments[segments[:, 0] != segments[:, 1]]
    lines = make_constraints(xy, segments)
    for s, (a, b) in enumerate(segments):
        step, off = xy[b] - xy[a], xy - xy[a]
        share = off @ step / (step @ step)
        on = np.flatnonzero((off[:, 0] * step[1] == off[:, 1] * step[0]) & (share >= 0) & (share <= 1))
        np.testing.assert_array_equal(lines.along[lines.start[s] : lines.start[s + 1]], on[np.argsort(share[on])])
        assert all(s in lines.listed[lines.at[v] + 1 :][: lines.listed[lines.at[v]]] for v in on)
    assert ((lines.at < 0) == ~np.isin(np.arange(len(xy)), lines.along)).all()


def drawn(rng):
    """Points anywhere, on a lattice, or on both, and how many segments to draw."""
    n = int(rng.integers(5, 22))
    kind = rng.integers(3)
    xy = rng.integers(0, 6, (n, 2)) / 8 if kind != 1 else rng.random((n, 2))
    if kind == 2:
        xy[: n // 2] = rng.random((n // 2, 2)) * 0.75
    xy = np.unique(xy, axis=0)
    return rng.permutation(xy), int(rng.integers(1, 9))


@tried("cases", 100)
def test_triangles_are_those_of_a_slow_twin_for_all_vertices_and_some(cases):
    rng = np.random.default_rng(cases)
    for _ in range(cases):
        xy, n_segments = drawn(rng)
        if np.linalg.matrix_rank(xy - xy[0]) < 2:
            continue
        model = flat(xy)
        segments, _ = random_segments(model.xy, rng, n_segments)
        if not segments:
            continue
        kept = rng.random(len(xy)) < rng.random()
        kept[np.unique(segments)] = True
        lined = whole(with_segments(model, segments))
        for some in (kept, np.ones(len(xy), bool)):
            sites = np.flatnonzero(some)
            expected = constrained_faces(model.xy, segments, sites.tolist())
            if len(expected) == 0:
                continue
            faces = lined.triangles(some)
            np.testing.assert_array_equal(faces, expected)
            assert_constrained_delaunay(model.xy, faces, segments, sites.tolist())


@tried("points", 40)
def test_walks_among_forced_edges_end_where_a_point_is(points):
    walk = from_python(triangulation.locate_at_random)
    rng = np.random.default_rng(2)
    for _ in range(5):
        model = flat(0.25 + 0.5 * rng.random((60, 2)))
        segments, _ = random_segments(model.xy, rng, 25)
        live = LiveTriangulation(whole(with_segments(model, segments)), np.ones(60, bool)).live
        for x, y in np.round(rng.random((points, 2)) * 2.0**52) / 2.0**52:
            start = RECORD * int(rng.integers(live.tally[END] // RECORD))
            t = walk(model.xy.ravel(), live.mesh, start, x, y, 0.0)
            corners = live.mesh[t : t + 3]
            sides = [
                orient(*whole_numbers([model.xy[a], model.xy[b], (x, y)]))
                for a, b in zip(corners, np.roll(corners, -1), strict=True)
                if max(a, b) <= LAST_INDEX
            ]
            if len(sides) == 3:
                assert min(sides) >= 0
            else:  # a ghost, whose hull edge the point sees
                assert len(sides) == 1
                assert sides[0] > 0
