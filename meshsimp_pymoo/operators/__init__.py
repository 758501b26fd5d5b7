"""Operators for bool chromosomes over the vertices of a mesh, for use with any pymoo algorithm.

``OPERATORS[kind][name]`` is the table behind the names in configuration files:

========== =============== ======================== ==========================================
kind       name            class                    what it does
========== =============== ======================== ==========================================
sampling   random_subset   `RandomSubset`           a random size, then a random subset of it
crossover  uniform         `SubsetUniformCrossover` every gene from either parent
crossover  oax             `OAX`                    segments by main effects, orthogonal array
mutation   neighbour_shift `NeighbourShift`         kept vertices move to neighbours
repair     pinned_corners  `PinnedCorners`          pinned vertices are kept
duplicates packed          `PackedDuplicates`       exact duplicates out, by hashing
========== =============== ======================== ==========================================

All of them draw from pymoo's ``random_state`` alone, never change their input, and take from the problem only
``pinned``, ``model.neighbours`` and ``n_var``.
"""

from __future__ import annotations

from typing import Any

from meshsimp_pymoo.operators.crossover import OAX, SubsetUniformCrossover
from meshsimp_pymoo.operators.duplicates import PackedDuplicates
from meshsimp_pymoo.operators.mutation import NeighbourShift
from meshsimp_pymoo.operators.repair import PinnedCorners
from meshsimp_pymoo.operators.sampling import RandomSubset

OPERATORS: dict[str, dict[str, type[Any]]] = {
    "sampling": {"random_subset": RandomSubset},
    "crossover": {"uniform": SubsetUniformCrossover, "oax": OAX},
    "mutation": {"neighbour_shift": NeighbourShift},
    "repair": {"pinned_corners": PinnedCorners},
    "duplicates": {"packed": PackedDuplicates},
}

__all__ = [
    "OAX",
    "OPERATORS",
    "NeighbourShift",
    "PackedDuplicates",
    "PinnedCorners",
    "RandomSubset",
    "SubsetUniformCrossover",
]
