"""Exact duplicates out, by hashing: in linear time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.duplicate import DuplicateElimination

from meshsimp_pymoo.reprs import as_made

# Chromosomes are packed in blocks of about this many genes, so that long ones are not all stacked at once.
GENES_PER_BLOCK = 1 << 24


def packed(pop: Any) -> list[bytes]:
    """Return each chromosome as bytes, eight vertices a byte: equal bytes, equal chromosomes.

    Parameters
    ----------
    pop : (n,) Population
        Individuals with bool chromosomes of one length.

    Returns
    -------
    n times bytes
        In the order of the population.
    """
    chromosomes = [individual.X for individual in pop]
    keys: list[bytes] = []
    rows = max(1, GENES_PER_BLOCK // len(chromosomes[0])) if chromosomes else 1
    for start in range(0, len(chromosomes), rows):
        bits = np.packbits(np.array(chromosomes[start : start + rows]), axis=1)
        keys += bits.view(f"V{bits.shape[1]}").ravel().tolist()
    return keys


class PackedDuplicates(DuplicateElimination):
    """Eliminate solutions whose chromosome is already there, by a set of packed chromosomes.

    Of several equal solutions the first stays, as with pymoo's default, which compares all pairs as floats
    and so costs most of pymoo's own time once N is large. Nothing but exact equality is a duplicate.
    """

    def __init__(self) -> None:
        super().__init__()

    __repr__ = as_made

    def _do(self, pop: Any, other: Any, is_duplicate: NDArray[np.bool_]) -> NDArray[np.bool_]:
        if other is not None:
            seen = set(packed(other))
            is_duplicate[:] = [key in seen for key in packed(pop)]
            return is_duplicate
        first: dict[bytes, int] = {}
        for i, key in enumerate(packed(pop)):
            is_duplicate[i] = first.setdefault(key, i) != i
        return is_duplicate
