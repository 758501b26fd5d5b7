"""Children of both sides of a line."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.operators import HalfPlaneCrossover
from meshsimp_pymoo.search.operators.half_plane_crossover import half_planes


@pytest.fixture(scope="module", params=["jacksboro:24", "horseshoe:150"])
def problem(request):
    return MeshProblem(request.param)


def test_half_planes_are_sides_of_lines():
    xy = np.random.default_rng(0).random((200, 2))
    for side in half_planes(xy, 30, np.random.default_rng(1)):
        assert 0.1 <= side.mean() + 0.005
        assert side.mean() <= 0.905
        # Some line has all of one side on its left and all of the other on its right: w x - b >= 1 and <= -1.
        sign = np.where(side, 1.0, -1.0)[:, None]
        line = linprog([0, 0, 0], -sign * np.c_[xy, -np.ones(len(xy))], -np.ones(len(xy)), bounds=(None, None))
        assert line.success


def test_half_plane_children_of_one_size(problem):
    front = thinning(problem.surface)
    pairs = np.stack([np.array([front.kept(30)] * 6), np.array([front.kept(50)] * 6)])
    children = HalfPlaneCrossover(keep_size=True)._do(problem, pairs, random_state=np.random.default_rng(2))
    np.testing.assert_array_equal(children[0].sum(axis=1), front.kept(30).sum())
    np.testing.assert_array_equal(children[1].sum(axis=1), front.kept(50).sum())
