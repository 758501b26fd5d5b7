"""Fair random bits, for long vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def random_bits(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return fair random bits as a bool array, eight from each random byte."""
    count = int(np.prod(shape))
    drawn = np.frombuffer(rng.bytes((count + 7) // 8), dtype=np.uint8)
    return np.unpackbits(drawn, count=count).view(np.bool_).reshape(shape)
