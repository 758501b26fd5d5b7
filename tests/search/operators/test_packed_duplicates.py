"""Hashing finds the duplicates that comparing all pairs finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.duplicate import DefaultDuplicateElimination
from pymoo.core.population import Population

from meshsimp_pymoo.search.operators import PackedDuplicates
from meshsimp_pymoo.search.operators import packed_duplicates as module


def random_population(rng: np.random.Generator, n: int, n_var: int) -> Population:
    return Population.new("X", rng.random((n, n_var)) < 0.5) if n else Population()


@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.tuples(st.integers(0, 12), st.integers(0, 12), st.integers(0, 12)),
    n_var=st.integers(1, 17),
)
def test_the_same_individuals_stay_as_with_the_default(seed: int, sizes: tuple[int, int, int], n_var: int) -> None:
    rng = np.random.default_rng(seed)
    n_var = min(n_var, 17)
    populations = [random_population(rng, n, n_var) for n in sizes]
    ours = PackedDuplicates().do(*populations)
    default = DefaultDuplicateElimination().do(*populations)
    assert [id(individual) for individual in ours] == [id(individual) for individual in default]


def test_few_variables_give_many_duplicates_and_the_first_ones_stay() -> None:
    pop = Population.new("X", np.array([[1, 0], [0, 1], [1, 0], [1, 1], [0, 1]], dtype=bool))
    known = Population.new("X", np.array([[1, 1]], dtype=bool))
    kept, is_new, is_duplicate = PackedDuplicates().do(pop, known, return_indices=True)
    assert [id(individual) for individual in kept] == [id(pop[0]), id(pop[1])]
    assert (is_new, is_duplicate) == ([0, 1], [2, 3, 4])


def test_chromosomes_that_differ_in_padding_length_or_last_bit_are_different() -> None:
    X = np.zeros((2, 9), dtype=bool)
    X[1, 8] = True
    assert len(PackedDuplicates().do(Population.new("X", X))) == 2


def test_packing_in_blocks_gives_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    pop = random_population(np.random.default_rng(1), 20, 50)
    whole = module.packed(pop)
    monkeypatch.setattr(module, "GENES_PER_BLOCK", 120)
    assert module.packed(pop) == whole
    assert len(set(whole)) == 20
