"""Pareto fronts of simplified open meshes, as a pymoo plugin.

The tree is the data flow. Bottom up; one part may import only parts above it in this list::

    errors, arrays                 words that all share: one-line errors, types of arrays
    settings, workers, indicators  what a user may set; threads, processes, Dask; dominance, knee, hypervolume
    memory         how much is free
    compiling/     functions that Python calls and functions inside them, their machine code on disk
    files          files and folders whole or not at all, locks, arrays without pickles
    plane/         predicates, triangulation, footprint, faces: arrays in, arrays out
    formats/       one file a format, in one table; ends in a SourceMesh
    surface/       what a chromosome means: rules and measures, the height surface, its moves, refit, score; big grids
    datasets       built-in models by name
    opening        the one way in: path, name or arrays, and Options -> model, or a grid read by windows
    problem        MeshProblem: which vertices are kept -> (error, triangles)
    search/        operators, thinning and insertion, annealing, memetic, presets, MOEA/D, GA, checkpoints
    storage        the folder of a front
    report/        pictures and the page of one front
    front          Front: a sequence of solutions to choose from, whole models' or tiles'
    tiles/         height grids too big for one piece
    comparison/    the study: YAML files, the runs they ask for, tables, findings
    warming        what has to be compiled once on a machine
    cli/           the shell command ``meshsimp``

Public names are imported when they are first used, so that ``import meshsimp_pymoo`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshsimp_pymoo.errors import ModelError, ModelWarning, ResultError
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.front import Front, FrontSolution
    from meshsimp_pymoo.opening import open_grid
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
    from meshsimp_pymoo.surface.height import HeightSurface, refit_heights
    from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
    from meshsimp_pymoo.surface.measures import Quality
    from meshsimp_pymoo.surface.model import OpenModel
    from meshsimp_pymoo.surface.rules import Rules
    from meshsimp_pymoo.surface.surface import Refitted
    from meshsimp_pymoo.tiles.front import tiled_front
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
    "opening": ("open_grid",),
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
    "HeightSurface",
    "LiveTriangulation",
    "MeshProblem",
    "ModelError",
    "ModelWarning",
    "NeighbourShift",
    "NestedSubsets",
    "OpenModel",
    "Options",
    "PackedDuplicates",
    "PinnedCorners",
    "Processes",
    "Quality",
    "RandomSubset",
    "Refitted",
    "RegionCrossover",
    "Relocation",
    "ResultError",
    "Rules",
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
