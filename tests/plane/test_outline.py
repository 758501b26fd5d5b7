from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo.plane.outline import is_convex, outline_edges

# A unit square with a vertex in the middle of its lower side, cut from the centre (5).
XY = np.array([[0, 0], [0.5, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
FACES = np.array([[0, 1, 5], [1, 2, 5], [2, 3, 5], [3, 4, 5], [4, 0, 5]])


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_only_a_mesh_that_fills_its_hull_is_convex(turn):
    xy = XY @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    assert is_convex(xy, outline_edges(xy, FACES))
    for missing in range(len(FACES)):
        assert not is_convex(xy, outline_edges(xy, np.delete(FACES, missing, axis=0)))


def test_the_outline_of_a_fold_is_its_fold_too():
    folded = np.array([[0, 1, 5], [1, 0, 3]])  # both on one side of the edge 0-1
    assert sorted(map(sorted, outline_edges(XY, folded).tolist())) == [[0, 1], [0, 3], [0, 5], [1, 3], [1, 5]]
