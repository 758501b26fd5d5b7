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
    from meshsimp_pymoo.errors import ModelError, ModelWarning, ResultError
    from meshsimp_pymoo.front import Front, FrontSolution
    from meshsimp_pymoo.problem import MeshProblem
    from meshsimp_pymoo.report.figures import plot_error, plot_front, plot_mesh
    from meshsimp_pymoo.search.display import FrontOutput
    from meshsimp_pymoo.search.greedy import greedy_insertion, thinning
    from meshsimp_pymoo.search.memetic import memetic
    from meshsimp_pymoo.search.moead import moead
    from meshsimp_pymoo.search.nsga import nsga2_v1, nsga2_v2, nsga3
    from meshsimp_pymoo.search.operators import (
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
    from meshsimp_pymoo.search.weighted import weighted_ga_v1, weighted_ga_v2
    from meshsimp_pymoo.storage import read_front, write_front
    from meshsimp_pymoo.surface.height import refit_heights
    from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
    from meshsimp_pymoo.surface.measures import Quality
    from meshsimp_pymoo.surface.model import OpenModel
    from meshsimp_pymoo.surface.surface import Refitted
    from meshsimp_pymoo.tiles.front import tiled_front
    from meshsimp_pymoo.tiles.grid import open_grid
    from meshsimp_pymoo.workers import DaskEngine, Processes

_HOMES = {
    "search.memetic": ("memetic",),
    "search.nsga": ("nsga2_v1", "nsga2_v2", "nsga3"),
    "search.moead": ("moead",),
    "search.weighted": ("weighted_ga_v1", "weighted_ga_v2"),
    "surface.measures": ("Quality",),
    "errors": ("ModelError", "ModelWarning", "ResultError"),
    "surface.model": ("OpenModel",),
    "surface.live_triangulation": ("LiveTriangulation",),
    "surface.height": ("HeightSurface", "refit_heights"),
    "surface.rules": ("Rules",),
    "surface.surface": ("Refitted",),
    "formats.options": ("Options",),
    "search.greedy": ("greedy_insertion", "thinning"),
    "search.operators": (
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
    "search.display": ("FrontOutput",),
    "front": ("Front", "FrontSolution"),
    "report.figures": ("plot_error", "plot_front", "plot_mesh"),
    "storage": ("read_front", "write_front"),
    "tiles.front": ("tiled_front",),
    "tiles.grid": ("open_grid",),
    "workers": ("DaskEngine", "Processes"),
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
