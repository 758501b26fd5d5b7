"""Every gene from either parent."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.variable import get

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

    def draw(self, n_matings: int, n_vertices: int, random_state: np.random.Generator) -> NDArray[np.uint8]:
        """Draw which genes the only children of pairs take from the second parent, before the parents are known.

        For an algorithm that makes one child after the other, but draws for all of them at once; with `from_either` it
        is the crossover itself, the numbers only drawn in another order.

        Parameters
        ----------
        n_matings : int
            Number of pairs.
        n_vertices : int
            Length of the chromosomes.
        random_state : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        (n_matings, ceil(n_vertices / 8)) uint8 array
            Packed bits; of a pair that does not cross all or none, by chance.
        """
        width = (n_vertices + 7) // 8
        bits = np.frombuffer(random_state.bytes(n_matings * width), dtype=np.uint8).reshape(n_matings, width).copy()
        stays = random_state.random(n_matings) >= get(self.prob, size=n_matings)
        bits[stays] = 255 * random_state.integers(2, size=(np.count_nonzero(stays), 1), dtype=np.uint8)
        return bits


def from_either(first: NDArray[np.bool_], second: NDArray[np.bool_], bits: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return the child (N,) that takes from ``second`` where the packed bits are set, else from ``first``."""
    return np.where(np.unpackbits(bits, count=len(first)).view(np.bool_), second, first)
