"""Pareto fronts of simplified open meshes, as a pymoo plugin.

The data flow, which is also the order in which one part may import another::

    geometry/      load -> orient -> model -> triangulation -> error -> live     arrays in, arrays out; knows no pymoo
    datasets       built-in models by name
    problem        MeshProblem: which vertices are kept -> (error, triangles)
    operators/     sampling, crossover, mutation, repair, duplicates: how fronts are searched
    memetic_search the seeded search
    algorithms     the paper's algorithms, wired
    baselines/     other ways to simplify, scored by the same error
    indicators     how good a front is
    analysis       many runs -> merged fronts, tables, choices
    results, runs  what a run leaves on disk
    checkpoint     what a killed search goes on from
    display        what a search shows of itself
    tiles/         height grids too big for one piece
    report/        pictures, tables, findings
    experiment/    YAML files and the runs they ask for
    front          Front: a sequence of solutions to choose from
    cli            the shell command ``meshsimp``
    engines        where work is done: here, in processes, on a Dask cluster

Public names are imported when they are first used, so that ``import meshsimp_pymoo`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshsimp_pymoo.algorithms import moead, nsga2_v1, nsga2_v2, nsga3, weighted_ga_v1, weighted_ga_v2
    from meshsimp_pymoo.baselines.greedy import greedy_insertion, thinning
    from meshsimp_pymoo.display import FrontOutput
    from meshsimp_pymoo.engines import DaskEngine, Processes
    from meshsimp_pymoo.front import Front, FrontSolution
    from meshsimp_pymoo.geometry.error import Quality
    from meshsimp_pymoo.geometry.live import LiveTriangulation
    from meshsimp_pymoo.geometry.load import ModelError, ModelWarning
    from meshsimp_pymoo.geometry.model import OpenModel
    from meshsimp_pymoo.geometry.refit import Refitted, refit_heights
    from meshsimp_pymoo.memetic_search import memetic
    from meshsimp_pymoo.operators import (
        OAX,
        HalfPlaneCrossover,
        NeighbourShift,
        NestedSubsets,
        PackedDuplicates,
        PinnedCorners,
        RandomSubset,
        RegionCrossover,
        Relocation,
        SizeStep,
        SubsetUniformCrossover,
    )
    from meshsimp_pymoo.problem import MeshProblem
    from meshsimp_pymoo.report.figures import plot_error, plot_front, plot_mesh
    from meshsimp_pymoo.results import ResultError, read_front, write_front
    from meshsimp_pymoo.tiles.front import tiled_front
    from meshsimp_pymoo.tiles.grid import open_grid

_HOMES = {
    "memetic_search": ("memetic",),
    "algorithms": ("moead", "nsga2_v1", "nsga2_v2", "nsga3", "weighted_ga_v1", "weighted_ga_v2"),
    "geometry.error": ("Quality",),
    "geometry.load": ("ModelError", "ModelWarning"),
    "geometry.model": ("OpenModel",),
    "geometry.live": ("LiveTriangulation",),
    "geometry.refit": ("Refitted", "refit_heights"),
    "baselines.greedy": ("greedy_insertion", "thinning"),
    "operators": (
        "OAX",
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
    ),
    "problem": ("MeshProblem",),
    "display": ("FrontOutput",),
    "front": ("Front", "FrontSolution"),
    "report.figures": ("plot_error", "plot_front", "plot_mesh"),
    "results": ("ResultError", "read_front", "write_front"),
    "tiles.front": ("tiled_front",),
    "tiles.grid": ("open_grid",),
    "engines": ("DaskEngine", "Processes"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "OAX",
    "DaskEngine",
    "Front",
    "FrontOutput",
    "FrontSolution",
    "HalfPlaneCrossover",
    "LiveTriangulation",
    "MeshProblem",
    "ModelError",
    "ModelWarning",
    "NeighbourShift",
    "NestedSubsets",
    "OpenModel",
    "PackedDuplicates",
    "PinnedCorners",
    "Processes",
    "Quality",
    "RandomSubset",
    "Refitted",
    "RegionCrossover",
    "Relocation",
    "ResultError",
    "SizeStep",
    "SubsetUniformCrossover",
    "greedy_insertion",
    "memetic",
    "moead",
    "nsga2_v1",
    "nsga2_v2",
    "nsga3",
    "open_grid",
    "plot_error",
    "plot_front",
    "plot_mesh",
    "read_front",
    "refit_heights",
    "thinning",
    "tiled_front",
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
    return sorted({*globals(), *__all__})
