"""Children of both sides of a line."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population
from scipy.optimize import linprog

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.operators import OAX, HalfPlaneCrossover
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


@pytest.mark.parametrize("crossover", [HalfPlaneCrossover, OAX])
def test_children_have_the_sizes_of_their_parents_when_asked(problem, crossover):
    front = thinning(problem.surface)
    pairs = Population.new(X=np.array([front.kept(30), front.kept(50)] * 6)).reshape(6, 2)
    evaluator = Evaluator()
    sizes = {}
    for keep_size in (True, False):
        children = crossover(prob=1.0, keep_size=keep_size)(
            problem, pairs, random_state=np.random.default_rng(2), evaluator=evaluator
        )
        sizes[keep_size] = children.get("X").sum(axis=1).reshape(2, 6)
    np.testing.assert_array_equal(sizes[True], np.repeat([[front.kept(30).sum()], [front.kept(50).sum()]], 6, axis=1))
    assert (sizes[False] != sizes[True]).any()
