"""Random numbers inside compiled functions: a xorshift64* generator (Vigna 2016), whose state is one number."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner


@inner(inline=True)
def draw(state: np.ndarray) -> int:
    """Advance the generator; 63 bits."""
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    return np.int64((x * np.uint64(2685821657736338717)) >> np.uint64(1))


@inner(inline=True)
def below(state: np.ndarray, n: int) -> int:
    """Draw a whole number of at least 0 and less than n."""
    return draw(state) % n


@inner(inline=True)
def unit(state: np.ndarray) -> float:
    """Draw a number above 0, at most 1."""
    return ((draw(state) >> 10) + 1) * 2.0**-53
