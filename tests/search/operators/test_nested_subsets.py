"""Populations that start from thinning."""

from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.operators import NestedSubsets


@pytest.fixture(scope="module", params=["jacksboro:24", "horseshoe:150"])
def problem(request):
    return MeshProblem(request.param)


def test_nested_samples_are_thinned_subsets_within_the_wanted_triangles(problem):
    front = thinning(problem.surface)
    X = NestedSubsets((20, 60))._do(problem, 9, random_state=np.random.default_rng(0))
    table = problem.surface.evaluate(X)
    assert ((table[:, 1] >= 20) & (table[:, 1] <= 60)).all()
    for kept in X:
        np.testing.assert_array_equal(kept, front.kept(int(kept.sum()) - len(front.base)))
    assert len(np.unique(table[:, 1])) >= 7
    mixed = NestedSubsets(random_share=0.5)._do(problem, 10, random_state=np.random.default_rng(0))
    assert mixed.shape == (10, problem.n_var)
    with pytest.raises(ValueError, match="thinning has no mesh of 100000 to 200000"):
        NestedSubsets((100_000, 200_000))._do(problem, 5, random_state=np.random.default_rng(0))
    with pytest.raises(ValueError, match="is no range"):
        NestedSubsets((50, 20))
