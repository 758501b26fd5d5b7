"""Operators for bool chromosomes over the vertices of a mesh, for use with any pymoo algorithm.

``OPERATORS[kind][name]`` is the table behind the names in configuration files. An operator is one file, its row here,
and its name where names are spelled out for type checkers: in ``__all__`` here and, since all operators are public, in
``meshsimp_pymoo/__init__.pyi``.

All of them draw from pymoo's ``random_state`` alone, never change their input, and take from the problem only
``n_var``, ``pinned`` and ``surface``; `RegionCrossover` also takes ``regions``, and `OAX` has the problem evaluate what
it tries.
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
