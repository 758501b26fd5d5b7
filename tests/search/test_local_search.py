from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.search.operators import (
    HalfPlaneCrossover,
    NestedSubsets,
    PackedDuplicates,
    PinnedCorners,
    Relocation,
)
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model


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


def test_the_unit_of_a_model_makes_no_difference_to_its_annealing():
    """By a power of two, so that nothing is rounded otherwise."""
    source = load("jacksboro:24")
    large, small = (
        HeightSurface(build_model(replace(source, points=source.points * scale), up="z")) for scale in (1.0, 2.0**-30)
    )
    kept = thinning(large).kept(40)
    walked = [relocate(surface, kept, moves=300, seed=1) for surface in (large, small)]
    assert (walked[0] != kept).any()
    np.testing.assert_array_equal(*walked)


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
