"""Pareto fronts of simplified open meshes, as a pymoo plugin.

The data flow, which is also the order in which one part may import another::

    geometry/      load -> orient -> model -> triangulation -> error     arrays in, arrays out; knows no pymoo
    datasets       built-in models by name
    problem        MeshProblem: which vertices are kept -> (error, triangles)
    operators/     sampling, crossover, mutation, repair, duplicates: how fronts are searched
    algorithms     the paper's algorithms, wired
    baselines/     other people's simplification, scored by the same error
    indicators     how good a front is
    analysis       many runs -> merged fronts, tables, choices
    results        what a run leaves on disk
    report/        pictures
    cli            the shell command ``meshsimp``

Public names are imported when they are first used, so that ``import meshsimp_pymoo`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshsimp_pymoo.algorithms import moead, nsga2_v1, nsga2_v2, weighted_ga_v1, weighted_ga_v2
    from meshsimp_pymoo.geometry.error import Quality
    from meshsimp_pymoo.geometry.load import ModelError, ModelWarning
    from meshsimp_pymoo.geometry.model import OpenModel
    from meshsimp_pymoo.operators import (
        OAX,
        NeighbourShift,
        PackedDuplicates,
        PinnedCorners,
        RandomSubset,
        SubsetUniformCrossover,
    )
    from meshsimp_pymoo.problem import MeshProblem
    from meshsimp_pymoo.results import ResultError, read_front, write_front

_HOMES = {
    "algorithms": ("moead", "nsga2_v1", "nsga2_v2", "weighted_ga_v1", "weighted_ga_v2"),
    "geometry.error": ("Quality",),
    "geometry.load": ("ModelError", "ModelWarning"),
    "geometry.model": ("OpenModel",),
    "operators": (
        "OAX",
        "NeighbourShift",
        "PackedDuplicates",
        "PinnedCorners",
        "RandomSubset",
        "SubsetUniformCrossover",
    ),
    "problem": ("MeshProblem",),
    "results": ("ResultError", "read_front", "write_front"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "OAX",
    "MeshProblem",
    "ModelError",
    "ModelWarning",
    "NeighbourShift",
    "OpenModel",
    "PackedDuplicates",
    "PinnedCorners",
    "Quality",
    "RandomSubset",
    "ResultError",
    "SubsetUniformCrossover",
    "moead",
    "nsga2_v1",
    "nsga2_v2",
    "read_front",
    "weighted_ga_v1",
    "weighted_ga_v2",
    "write_front",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("meshsimp-pymoo")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
