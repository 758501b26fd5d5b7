"""Annealing as a mutation."""

from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.operators import Relocation


@pytest.fixture(scope="module", params=["jacksboro:24", "horseshoe:150"])
def problem(request):
    return MeshProblem(request.param)


def error(problem, X):
    return problem.surface.evaluate(X)[:, 0]


def triangles(problem, X):
    return problem.surface.evaluate(X)[:, 1]


@pytest.mark.parametrize("temperature", [0.0, 0.2, 2.0])
def test_relocation_keeps_to_the_triangles_and_never_adds_error(problem, temperature):
    front = thinning(problem.surface)
    X = np.array([front.kept(k) for k in (20, 40, 80)])
    Y = Relocation(50, temperature=temperature)._do(problem, X, random_state=np.random.default_rng(1))
    assert (triangles(problem, Y) <= triangles(problem, X)).all()
    assert (triangles(problem, Y) >= triangles(problem, X) - 2).all()
    assert Y[:, problem.pinned].all()
    assert (error(problem, Y) <= error(problem, X) * (1 + 1e-9)).all()
    if temperature < 1:
        assert (error(problem, Y) < error(problem, X) * 0.99).all()


def test_the_budget_of_all_rows_is_bounded():
    problem = MeshProblem("peaks:9")
    seen = []
    mutation = Relocation(100.0, max_moves=50)
    X = np.ones((4, problem.n_var), bool)

    def spy(problem, X, moves, *args, **kwargs):
        seen.append(moves.sum())
        return X

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meshsimp_pymoo.search.operators.relocation.relocate_all", spy)
        mutation._do(problem, X, random_state=np.random.default_rng(0))
    assert 40 <= seen[0] <= 50


@pytest.mark.parametrize("arguments", [{"moves_per_vertex": -1}, {"max_moves": -5}, {"temperature": float("nan")}])
def test_impossible_searches_are_refused(arguments):
    with pytest.raises(ValueError, match="is no number of at least 0"):
        Relocation(**arguments)
