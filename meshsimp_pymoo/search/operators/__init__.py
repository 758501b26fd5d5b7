"""Operators for bool chromosomes over the vertices of a mesh, for use with any pymoo algorithm.

``OPERATORS[kind][name]`` is the table behind the names in configuration files:

========== =============== ======================== ==========================================
kind       name            class                    what it does
========== =============== ======================== ==========================================
sampling   random_subset   `RandomSubset`           a random size, then a random subset of it
sampling   nested          `NestedSubsets`          thinned subsets of all sizes
crossover  uniform         `SubsetUniformCrossover` every gene from either parent
crossover  oax             `OAX`                    segments by main effects, orthogonal array
crossover  half_plane      `HalfPlaneCrossover`     the sides of a random line, exchanged
crossover  region          `RegionCrossover`        each region from the parent that does it for less
mutation   neighbour_shift `NeighbourShift`         kept vertices move to neighbours
mutation   relocation      `Relocation`             annealed moves of kept vertices
mutation   size_step       `SizeStep`               some more vertices, or some fewer
repair     pinned_corners  `PinnedCorners`          pinned vertices are kept
duplicates packed          `PackedDuplicates`       exact duplicates out, by hashing
========== =============== ======================== ==========================================

All of them draw from pymoo's ``random_state`` alone, never change their input, and take from the problem only
``pinned``, ``model`` and ``n_var`` (the thinning and annealing ones also its ``footprint`` and ``outside``).
"""

from __future__ import annotations

from typing import Any

from meshsimp_pymoo.search.operators.half_plane_crossover import HalfPlaneCrossover
from meshsimp_pymoo.search.operators.neighbour_shift import NeighbourShift
from meshsimp_pymoo.search.operators.nested_subsets import NestedSubsets
from meshsimp_pymoo.search.operators.oax import OAX
from meshsimp_pymoo.search.operators.packed_duplicates import PackedDuplicates
from meshsimp_pymoo.search.operators.pinned_corners import PinnedCorners
from meshsimp_pymoo.search.operators.random_subset import RandomSubset
from meshsimp_pymoo.search.operators.region_crossover import RegionCrossover
from meshsimp_pymoo.search.operators.relocation import Relocation
from meshsimp_pymoo.search.operators.size_step import SizeStep
from meshsimp_pymoo.search.operators.subset_uniform_crossover import SubsetUniformCrossover

OPERATORS: dict[str, dict[str, type[Any]]] = {
    "sampling": {"random_subset": RandomSubset, "nested": NestedSubsets},
    "crossover": {
        "uniform": SubsetUniformCrossover,
        "oax": OAX,
        "half_plane": HalfPlaneCrossover,
        "region": RegionCrossover,
    },
    "mutation": {"neighbour_shift": NeighbourShift, "relocation": Relocation, "size_step": SizeStep},
    "repair": {"pinned_corners": PinnedCorners},
    "duplicates": {"packed": PackedDuplicates},
}

__all__ = [
    "OAX",
    "OPERATORS",
    "HalfPlaneCrossover",
    "NeighbourShift",
    "NestedSubsets",
    "PackedDuplicates",
    "PinnedCorners",
    "RandomSubset",
    "RegionCrossover",
    "Relocation",
    "SizeStep",
    "SubsetUniformCrossover",
]
