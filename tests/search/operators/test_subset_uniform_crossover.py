"""Half of the genes go to the other child."""

from __future__ import annotations

import numpy as np
from mating import call, evaluated_pairs
from numpy.testing import assert_array_equal
from stand_in_problem import GridProblem

from meshsimp_pymoo.search.operators import SubsetUniformCrossover


def test_uniform_crossover_exchanges_half_of_the_genes_and_loses_none() -> None:
    problem = GridProblem(20)
    pairs = evaluated_pairs(problem, 100, seed=1)
    children, n_eval = call(SubsetUniformCrossover(1.0), problem, pairs, seed=2)
    first, second = (np.array([pair[i].X for pair in pairs]) for i in (0, 1))
    assert n_eval == 0
    assert_array_equal(children[0] ^ children[1], first ^ second)
    assert_array_equal(children.sum(axis=0), first.astype(int) + second)
    differ = first ^ second
    exchanged = (children[0] != first)[differ].mean()
    assert abs(exchanged - 0.5) < 4 * np.sqrt(0.25 / differ.sum())
    per_gene = ((children[0] != first) & differ).sum(axis=0)[~problem.pinned] / differ.sum(axis=0)[~problem.pinned]
    assert abs(per_gene - 0.5).max() < 4.5 * np.sqrt(0.25 / 35)
