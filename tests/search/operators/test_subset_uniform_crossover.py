"""Genes exchanged at random, one by one."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal
from stand_in_problem import GridProblem, call, evaluated_pairs

from meshsimp_pymoo.search.operators import OAX, SubsetUniformCrossover


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
    per_gene = ((children[0] != first) & differ).sum(axis=0)[~problem.pinned] / differ.sum(axis=0)[
        ~problem.pinned
    ]
    assert abs(per_gene - 0.5).max() < 4.5 * np.sqrt(0.25 / 35)


def test_with_one_child_it_is_the_first_of_the_two() -> None:
    problem = GridProblem(8)
    pairs = evaluated_pairs(problem, 10, seed=1)
    for operator in (OAX, SubsetUniformCrossover):
        two, _ = call(operator(prob=1.0), problem, pairs, seed=2)
        one, _ = call(operator(prob=1.0, n_offsprings=1), problem, pairs, seed=2)
        assert_array_equal(one[0], two[0])
