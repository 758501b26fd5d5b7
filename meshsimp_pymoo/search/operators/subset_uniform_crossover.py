"""Every gene from either parent."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshsimp_pymoo.search.operators.pair_crossover import PairCrossover
from meshsimp_pymoo.search.operators.random_bits import random_bits


class SubsetUniformCrossover(PairCrossover):
    """Uniform crossover of bool vectors: every gene goes to the other child with probability 1/2.

    The distribution of pymoo's ``UniformCrossover``, made for long vectors: one random bit per gene instead
    of a 64-bit float, and the exchange is three bitwise operations.

    Parameters
    ----------
    prob : float
        The probability of a pair to cross (0.8 in the paper).
    n_offsprings : {2, 1}
        Children per pair. MOEA/D uses one.

    Raises
    ------
    ValueError
        If ``prob`` is not in [0, 1] or ``n_offsprings`` is neither 1 nor 2.
    TypeError
        When applied to chromosomes that are not bool.
    """

    def __init__(self, prob: float = 0.8, *, n_offsprings: int = 2) -> None:
        super().__init__(prob, n_offsprings)

    def _do(
        self, problem: Any, X: NDArray[np.bool_], *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        exchanged = random_bits(X.shape[1:], random_state)
        exchanged &= X[0] ^ X[1]
        return X[: self.n_offsprings] ^ exchanged
