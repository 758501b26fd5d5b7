"""Insertion into a grid by scanning its triangles, against a slow twin that looks at every triangle each time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshsimp_pymoo.opening import open_grid
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD, triangulate_once
from meshsimp_pymoo.search.raster import raster_insertion
from meshsimp_pymoo.surface.weld import measured, weld


def inserted(grid, heights, most):
    return raster_insertion(grid.x, grid.y, heights, grid.corners, most)


def deviations(x, y, heights, samples):
    """Return how far each sample (N,) is from each triangle (M, N) of a mesh; 0 where it is not in it."""
    row, column = np.divmod(np.arange(heights.size), heights.shape[1])
    xy = np.column_stack([x[column], y[row]])
    flat, none = xy[samples].ravel(), np.empty(0, np.int64)
    records = np.empty(16 * len(samples), np.uint32)
    scratch = np.empty(len(samples), np.uint8)
    end = triangulate_once(flat, len(samples), none, none, scratch, records, *exact_ranges(xy[samples]))
    corners = records[:end].reshape(-1, RECORD)[:, :3]
    faces = samples[corners[corners.max(axis=1) <= LAST_INDEX].astype(np.int64)]
    a, b, c = (xy[faces[:, k]][:, None] for k in range(3))
    cross = lambda p, q: p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]  # noqa: E731
    weights = np.stack([cross(c - b, xy - b), cross(a - c, xy - c), cross(b - a, xy - a)])
    z = heights.ravel()
    on_it = np.einsum("kmn,mk->mn", weights / weights.sum(axis=0), z[faces])
    return np.where(weights.min(axis=0) >= -1e-15, np.abs(on_it - z), 0.0)


@settings(max_examples=6)
@given(seed=st.integers(0, 2**32), shape=st.sampled_from([(6, 8), (9, 5), (3, 3)]))
def test_the_next_sample_is_the_worst_of_the_triangle_with_the_largest_sum(seed, shape):
    rng = np.random.default_rng(seed)
    heights = rng.normal(size=shape)
    # uneven rows and columns, too
    x, y = (np.cumsum(rng.integers(1, 4, size=n)) / 64 for n in (shape[1], shape[0]))
    y = y[::-1].copy()
    corners = np.array([0, shape[1] - 1, heights.size - shape[1], heights.size - 1])
    found = raster_insertion(x, y, heights, corners, heights.size)
    assert found[:4].tolist() == corners.tolist()
    assert sorted(found.tolist()) == list(range(heights.size))  # noise: all deviate until they are in
    for n in range(4, len(found)):
        deviation = deviations(x, y, heights, found[:n])
        sums = deviation.sum(axis=1)
        its_own = np.flatnonzero(deviation[:, found[n]] > 0.0)
        best = its_own[np.argmax(sums[its_own])]
        assert sums[best] == pytest.approx(sums.max(), rel=1e-9)
        assert deviation[best, found[n]] == pytest.approx(deviation[best].max(), rel=1e-9)


def test_insertion_ends_where_nothing_deviates():
    y, x = np.mgrid[:20, :30]
    plane = open_grid(2.0 * x - y)
    assert inserted(plane, 2.0 * x - y, 600).tolist() == plane.corners.tolist()
    roof = np.minimum(x, 29 - x) * 1.0
    found = inserted(open_grid(roof), roof, 600)
    assert len(found) < 30
    assert measured(open_grid(roof), weld(open_grid(roof), found), np.empty(0, np.int64))[0].error < 1e-9


def test_what_is_no_number_is_no_sample():
    heights = np.random.default_rng(1).normal(size=(12, 15))
    heights[3:6, 4:9] = np.nan
    found = inserted(open_grid(np.zeros((12, 15))), heights, 180)
    assert sorted(found.tolist()) == np.flatnonzero(np.isfinite(heights.ravel())).tolist()


def test_samples_on_one_line_are_no_beginning():
    grid = open_grid(np.zeros((5, 6)))
    with pytest.raises(ValueError, match="the 3 samples to begin with lie on one line; begin with some that do not"):
        raster_insertion(grid.x, grid.y, np.zeros((5, 6)), np.array([0, 7, 14]), 10)
