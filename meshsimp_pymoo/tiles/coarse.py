"""The smallest meshes of a grid: so few vertices that they can be moved about on the whole of it.

Thinning is greedy: below some hundred triangles it is a matter of luck where its vertices stand, whatever tiles there
were. So these meshes are searched one by one (:func:`~meshsimp_pymoo.search.local_search.relocate`), from the
thinned vertices, on every second, fourth, ... row and column of samples. What that takes does not grow with the grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.tiles.grid import HeightGrid

#: The most triangles of a mesh whose vertices are moved.
SEARCHED = 300
# Samples that are looked at: 27 for each triangle at least, where the grid has them.
SAMPLES = 1 << 13
# For each vertex. On jacksboro half as many leave 2 % more error.
MOVES = 80
TEMPERATURE = 0.1


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


def move(task: Coarse) -> IntArray:
    """Move the vertices of a mesh while that lowers its error; return its rows of ``task.points``, ascending."""
    faces = grid_source(task.points[:, 2].reshape(task.shape)).faces
    model = build_model(SourceMesh(task.points, faces, {}, "coarse grid", up="z"))
    moved = relocate(
        HeightSurface(model, Rules(footprint="hull", outside="ignore")),
        np.isin(model.source_index, task.kept),
        moves=MOVES * len(task.kept),
        seed=task.triangles,
        triangles=task.triangles,
        temperature=TEMPERATURE,
    )
    return np.sort(model.source_index[moved])


def strided(first: int, last: int, stride: int) -> IntArray:
    """Return every stride-th number from first to last, and the last."""
    numbers = np.arange(first, last + 1, stride, dtype=np.int64)
    return numbers if numbers[-1] == last else np.append(numbers, last)
