from __future__ import annotations

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.search.operators import (
    HalfPlaneCrossover,
    NestedSubsets,
    PackedDuplicates,
    PinnedCorners,
    Relocation,
)


@pytest.fixture(scope="module", params=["jacksboro:24", "horseshoe:150"])
def problem(request):
    return MeshProblem(request.param)


def error(problem, X):
    return problem.surface.evaluate(X)[:, 0]


def triangles(problem, X):
    return problem.surface.evaluate(X)[:, 1]


def test_a_wanted_size_is_reached_from_both_sides(problem):
    front = thinning(problem.surface)
    for start in (15, 60):
        kept = relocate(problem.surface, front.kept(start), moves=0, seed=1, size=40)
        assert kept.sum() == 40
        assert kept[problem.pinned].all()


def test_a_wanted_number_of_triangles_is_reached_from_both_sides(problem):
    front = thinning(problem.surface)
    for start in (15, 60):
        kept = relocate(problem.surface, front.kept(start), moves=0, seed=1, triangles=50)
        assert 48 <= triangles(problem, kept[None])[0] <= 50
        assert kept[problem.pinned].all()


def test_the_operators_work_in_pymoo_s_nsga2(problem):
    algorithm = NSGA2(
        pop_size=16,
        sampling=NestedSubsets(random_share=0.25),
        crossover=HalfPlaneCrossover(),
        mutation=Relocation(5),
        repair=PinnedCorners(),
        eliminate_duplicates=PackedDuplicates(),
    )
    result = minimize(problem, algorithm, ("n_gen", 4), seed=1)
    np.testing.assert_allclose(result.F[:, 0], error(problem, result.X))
