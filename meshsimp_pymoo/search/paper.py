"""What the paper gives all of its algorithms: sizes, probabilities and operators."""

from __future__ import annotations

from typing import Any

from meshsimp_pymoo.search.operators import NeighbourShift, PinnedCorners, RandomSubset

POP_SIZE = 100
CROSSOVER_PROBABILITY = 0.8
GENERATIONS = 50


def paper_operators() -> dict[str, Any]:
    """Return the operators that all of the paper's algorithms have, made anew, as arguments of a pymoo algorithm."""
    return {"sampling": RandomSubset(), "mutation": NeighbourShift(), "repair": PinnedCorners()}
