from __future__ import annotations

import numpy as np
import pytest
from from_python import from_python
from hypothesis import given
from hypothesis import strategies as st

from meshsimp_pymoo.plane import nearest

build_tree, nearest_segment = map(from_python, (nearest.build_tree, nearest.nearest_segment))


def search(points, ends, key, x, y, guess):
    xy = np.ascontiguousarray(points, float).ravel()
    boxes = build_tree(xy, ends, len(ends))
    return nearest_segment(xy, ends, key, len(ends), boxes, np.empty(64, np.int64), x, y, guess)


@pytest.mark.parametrize("guess", [0, 1])
@pytest.mark.parametrize(("key", "expected"), [([3, 8], 0), ([8, 3], 1)])
def test_of_two_segments_at_one_distance_the_one_of_least_key_is_taken(key, expected, guess):
    points = [[0, 1], [4, 1], [0, -1], [4, -1]]
    found, t, d = search(points, np.array([[0, 1], [2, 3]]), np.array(key), 1.0, 0.0, guess)
    assert (found, t, d) == (expected, 0.25, 1.0)


@given(seed=st.integers(0, 2**32 - 1), m=st.integers(1, 60), grid=st.booleans())
def test_the_tree_finds_what_looking_at_all_segments_finds(seed, m, grid):
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 5, (2 * m, 2)) / 4 if grid else rng.random((2 * m, 2))
    ends = np.arange(2 * m).reshape(m, 2)
    key = rng.permutation(m)
    for x, y in rng.random((10, 2)) * 2 - 0.5 if not grid else rng.integers(-2, 7, (10, 2)) / 4:
        a, edge = points[ends[:, 0]], points[ends[:, 1]] - points[ends[:, 0]]
        length = (edge**2).sum(axis=1)
        t = np.divide(((np.array([x, y]) - a) * edge).sum(axis=1), length, out=np.zeros(m), where=length > 0)
        away = a + np.clip(t, 0, 1)[:, None] * edge - [x, y]
        gap = (away**2).sum(axis=1)
        found, _, d = search(points, ends, key, x, y, int(rng.integers(m)))
        assert d == pytest.approx(gap.min(), rel=1e-12, abs=1e-15)
        if grid:
            tied = np.flatnonzero(np.abs(gap - gap.min()) < 1e-12)
            exact = [k for k in tied if gap[k] == gap.min()]
            assert found in tied
            if len(exact) == len(tied):
                assert key[found] == key[exact].min()
