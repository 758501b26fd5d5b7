"""The smallest meshes of a grid: so few vertices that they can be moved about on the whole of it.

Thinning is greedy: below some hundred triangles it is a matter of luck where its vertices stand, whatever tiles there
were. So these meshes are searched one by one (:func:`~meshsimp_pymoo.search.local_search.relocate`), from the
thinned vertices, on every second, fourth, ... row and column of samples. What that takes does not grow with the grid.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.surface.grid import HeightGrid
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import Quality
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.nested import Nested
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.weld import measure, weld

#: The most triangles of a mesh whose vertices are moved.
SEARCHED = 300
# Samples that are looked at: 27 for each triangle at least, where the grid has them.
SAMPLES = 1 << 13
# For each vertex. On jacksboro half as many leave 2 % more error.
MOVES = 80
TEMPERATURE = 0.1


@brief
@dataclass(frozen=True, eq=False)
class Coarse:
    """What the search of one mesh needs to know.

    Attributes
    ----------
    points : (h * w, 3) float array
        The samples that are looked at, row by row from the north [model units].
    shape : (int, int)
        h and w.
    kept : (v,) int array
        Rows of ``points`` to begin with, the corners among them.
    triangles : int
        The most that the mesh may have.
    """

    points: FloatArray
    shape: tuple[int, int]
    kept: IntArray
    triangles: int


class CoarseGrid:
    """Every stride-th row and column of a grid, and the last ones.

    Parameters
    ----------
    grid : HeightGrid
        The grid.
    """

    def __init__(self, grid: HeightGrid) -> None:
        stride = 1
        while True:
            rows, columns = (strided(0, n - 1, stride) for n in grid.shape)
            if len(rows) * len(columns) <= SAMPLES:
                break
            stride += 1
        self.rows, self.columns = rows, columns
        self.samples = (rows[:, None] * grid.shape[1] + columns).ravel()
        self.n_columns = grid.shape[1]
        xy = np.column_stack([np.tile(grid.x[columns], len(rows)), np.repeat(grid.y[rows], len(columns))])
        self.points = np.column_stack([xy * grid.unit, grid.window(rows, columns).ravel()])

    def task(self, kept: IntArray, triangles: int) -> Coarse:
        """Return what is to be done: the mesh of these samples, or of those nearest to them, moved."""
        row, column = np.divmod(kept, self.n_columns)
        near = [
            np.abs(places[None, :] - wanted[:, None]).argmin(axis=1)
            for places, wanted in ((self.rows, row), (self.columns, column))
        ]
        h, w = len(self.rows), len(self.columns)
        return Coarse(self.points, (h, w), np.unique(near[0] * w + near[1]), triangles)


@lru_cache(maxsize=1)
def _surface(points: bytes, shape: tuple[int, int]) -> HeightSurface:
    """Return the surface of the samples that are looked at: the same for all meshes of a grid."""
    rows = np.frombuffer(points).reshape(-1, 3)
    faces = grid_source(rows[:, 2].reshape(shape)).faces
    model = build_model(SourceMesh(rows, faces, {}, "coarse grid", up="z"))
    return HeightSurface(model, Rules(footprint="hull", outside="ignore"))


def move(task: Coarse) -> IntArray:
    """Move the vertices of a mesh while that lowers its error; return its rows of ``task.points``, ascending."""
    surface = _surface(task.points.tobytes(), task.shape)
    model = surface.model
    moved = relocate(
        surface,
        np.isin(model.source_index, task.kept),
        moves=MOVES * len(task.kept),
        seed=task.triangles,
        triangles=task.triangles,
        temperature=TEMPERATURE,
    )
    return np.sort(model.source_index[moved])


def slope_of(surface: GridSurface, nested: Nested, triangles: int) -> float:
    """Return the least slope at which a nested front's thinned mesh has at most so many triangles.

    Raises
    ------
    ValueError
        If it is less than 2, the least there is.
    """
    grid = surface.model
    if triangles < 2:
        raise ValueError(f"a mesh of {grid.name} has at least 2 triangles, not {triangles}")
    order = np.argsort(-nested.level, kind="stable")
    count = np.cumsum(grid.triangles_of(grid.samples_of_rows(nested.rows[order]))) - 2
    level = nested.level[order]
    # all samples of one level go together
    last = np.flatnonzero(np.r_[level[1:] < level[:-1], True])
    most = last[np.flatnonzero(count[last] <= triangles)[-1]]
    return float(level[most + 1]) if most + 1 < len(level) else float(nested.slope[-1])


def of_size(
    surface: GridSurface, nested: Nested, slope: float, triangles: int, *, room: tuple[float, float]
) -> tuple[IntArray | None, Quality]:
    """Return the mesh of a nested front at a slope, its vertices moved if it is small and that is better.

    Parameters
    ----------
    surface : GridSurface
        The grid.
    nested : Nested
        The front.
    slope : float
        Of at most so many triangles; see :func:`slope_of`.
    triangles : int
        The most that the mesh may have.
    room : (float, float)
        The sizes of its neighbours in the front, between which that of a moved mesh has to lie.

    Returns
    -------
    moved : (v,) int array or None
        The rows of the file that it keeps, if they were moved.
    quality : Quality
        Measured over all samples.
    """
    grid, threads = surface.model, os.cpu_count() or 1
    kept = grid.samples_of_rows(nested.rows[nested.level > slope])
    quality = measure(grid, weld(grid, kept), n_threads=threads)
    if 2 < triangles <= SEARCHED:
        coarse = CoarseGrid(grid)
        samples = np.sort(coarse.samples[move(coarse.task(kept, triangles))])
        found = measure(grid, weld(grid, samples), n_threads=threads)
        if found.error < quality.error and room[0] < found.triangles < room[1]:
            return grid.source_index[samples], found
    return None, quality


def strided(first: int, last: int, stride: int) -> IntArray:
    """Return every stride-th number from first to last, and the last."""
    numbers = np.arange(first, last + 1, stride, dtype=np.int64)
    return numbers if numbers[-1] == last else np.append(numbers, last)
