"""The sizes and members of random subsets are uniform."""

from __future__ import annotations

import numpy as np
from scipy.stats import chisquare
from stand_in_problem import GridProblem

from meshsimp_pymoo.search.operators import RandomSubset


def test_all_sizes_from_the_pinned_vertices_to_all_are_equally_likely() -> None:
    problem = GridProblem(5)
    X = RandomSubset()._do(problem, 22_000, random_state=np.random.default_rng(1))
    counts = np.bincount(X.sum(axis=1), minlength=26)
    assert counts[:4].sum() == 0
    assert chisquare(counts[4:]).pvalue > 0.01


def test_all_free_vertices_are_equally_likely_at_every_size() -> None:
    problem = GridProblem(5)
    X = RandomSubset()._do(problem, 22_000, random_state=np.random.default_rng(2))
    for size in (6, 14, 15, 22):  # few are drawn by what is kept, many by what is dropped
        of_size = X[X.sum(axis=1) == size]
        assert chisquare(of_size[:, ~problem.pinned].sum(axis=0)).pvalue > 0.01


def test_with_everything_pinned_there_is_one_subset() -> None:
    problem = GridProblem(2)
    assert RandomSubset()._do(problem, 3, random_state=np.random.default_rng(3)).all()
