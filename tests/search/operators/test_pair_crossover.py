"""What crossovers have in common."""

from __future__ import annotations

from mating import call, evaluated_pairs
from numpy.testing import assert_array_equal
from stand_in_problem import GridProblem

from meshsimp_pymoo.search.operators import OAX, SubsetUniformCrossover


def test_with_one_child_it_is_the_first_of_the_two() -> None:
    problem = GridProblem(8)
    pairs = evaluated_pairs(problem, 10, seed=1)
    for operator in (OAX, SubsetUniformCrossover):
        two, _ = call(operator(prob=1.0), problem, pairs, seed=2)
        one, _ = call(operator(prob=1.0, n_offsprings=1), problem, pairs, seed=2)
        assert_array_equal(one[0], two[0])
