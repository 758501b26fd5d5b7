"""Pareto fronts of simplified meshes, as a pymoo plugin.

The tree is the data flow. Bottom up; one part may import only parts above it in this list::

    errors, arrays, reprs          words that all share: one-line errors, types of arrays, what things call themselves
    settings, workers, indicators  what a user may set; threads, processes, Dask; dominance, knee, hypervolume
    memory         how much is free
    compiling/     functions that Python calls and functions inside them, their machine code on disk
    files          files and folders whole or not at all, locks, arrays without pickles
    plane/         predicates, triangulation, footprint, faces: arrays in, arrays out
    formats/       one file a format, in one table; ends in a SourceMesh
    surface/       what a chromosome means: rules and measures, the height surface, its moves, refit, score; big grids;
                   the closed surface (surface/closed/); which of both a model makes (surface/kinds);
                   how accurate one mesh is, in a surveyor's words (surface/accuracy)
    datasets       built-in models by name
    opening        the one way in: path, name or arrays, and Options -> model, or a grid read by windows
    problem        MeshProblem: which vertices are kept -> (error, triangles)
    search/        operators, thinning and insertion, annealing, memetic, presets, MOEA/D, GA, checkpoints
    storage        the folder of a front
    report/        pictures and the page of one front; the statement of quality of one mesh, the raster of its residuals
    front          Front: a sequence of solutions to choose from, whole models' or tiles'
    levels         a front as levels of detail: files, one glTF, 3D Tiles
    tiles/         height grids too big for one piece
    comparison/    the study: YAML files, the runs they ask for, tables, findings
    warming        what has to be compiled once on a machine
    cli/           the shell command ``meshsimp``

Public names are those of ``__init__.pyi``; each is imported when it is first used, so that ``import meshsimp_pymoo`` is
quick.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_HOME = {name.name: str(line.module) for line in _STUB.body if isinstance(line, ast.ImportFrom) for name in line.names}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("meshsimp-pymoo")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
