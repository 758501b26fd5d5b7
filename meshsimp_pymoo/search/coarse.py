"""The smallest meshes of a grid: so few vertices that they can be moved about on the whole of it.

Thinning is greedy: below some hundred triangles it is a matter of luck where its vertices stand, whatever tiles there
were. So these meshes are searched one by one (:func:`~meshsimp_pymoo.search.local_search.relocate`), from the
thinned vertices, on every second, fourth, ... row and column of samples. What that takes does not grow with the grid.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.plane.footprint import Footprint
from meshsimp_pymoo.plane.order import vector_order
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.surface.grid import HeightGrid
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import Quality
from meshsimp_pymoo.surface.model import build_model, placed_model
from meshsimp_pymoo.surface.nested import Nested
from meshsimp_pymoo.surface.rules import DEFAULT, Rules
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
        h and w; where the grid has gaps, 1 and their number.
    kept : (v,) int array
        Rows of ``points`` to begin with, the corners among them.
    triangles : int
        The most that the mesh may have.
    """

    points: FloatArray
    shape: tuple[int, int]
    kept: IntArray
    triangles: int


class CoarseGaps(NamedTuple):
    """What the search of all meshes of a grid with gaps needs to know beside.

    Attributes
    ----------
    xy : (n, 2) float array
        Where the samples that are looked at are in the unit square.
    unit : float
        Its side [model units].
    corners : (C,) int array
        Which of them are the grid's corners.
    faces : (T, 3) int array
        Their triangulation, over gaps too: along its edges vertices move.
    footprint : Footprint
        The faces of the whole grid.
    rules : Rules
        Which triangles are emitted, and what a sample costs that none covers.
    """

    xy: FloatArray
    unit: float
    corners: IntArray
    faces: IntArray
    footprint: Footprint
    rules: Rules


class CoarseGrid:
    """Every stride-th row and column of a grid, and the last ones; with gaps, the corners too.

    Parameters
    ----------
    grid : HeightGrid
        The grid.
    rules : Rules
        What counts.

    Attributes
    ----------
    samples : (n,) int array
        Numbers of the samples that are looked at, ascending.
    points : (n, 3) float array
        Where they are [model units].
    gaps : CoarseGaps or None
        Of a grid with gaps.
    """

    def __init__(self, grid: HeightGrid, rules: Rules = DEFAULT) -> None:
        stride = 1
        while True:
            rows, columns = (strided(0, n - 1, stride) for n in grid.shape)
            there = None if grid.lattice is None else grid.lattice.at(rows[:, None], columns)
            if (len(rows) * len(columns) if there is None else int(there.sum())) <= SAMPLES:
                break
            stride += 1
        self.rows, self.columns = rows, columns
        self.samples = (rows[:, None] * grid.shape[1] + columns).ravel()
        self.n_columns = grid.shape[1]
        self.gaps: CoarseGaps | None = None
        if there is not None and grid.lattice is not None:
            self.samples = np.union1d(self.samples[there.ravel()], grid.corners)
            xy, mesh = grid.xy_at(self.samples), weld(grid, self.samples, Rules(footprint="hull"))
            self.points = np.column_stack([xy * grid.unit, grid.height_at(self.samples)])
            self.gaps = CoarseGaps(
                xy,
                grid.unit,
                np.searchsorted(self.samples, grid.corners),
                np.searchsorted(self.samples, mesh.samples)[mesh.faces],
                grid.lattice.footprint(grid.x, grid.y),
                rules.of_heights,
            )
            return
        xy = np.column_stack([np.tile(grid.x[columns], len(rows)), np.repeat(grid.y[rows], len(columns))])
        self.points = np.column_stack([xy * grid.unit, grid.window(rows, columns).ravel()])

    def task(self, kept: IntArray, triangles: int) -> Coarse:
        """Return what is to be done: the mesh of these samples, or of those nearest to them, moved."""
        row, column = np.divmod(kept, self.n_columns)
        if self.gaps is not None:
            _, nearest = cKDTree(np.column_stack(np.divmod(self.samples, self.n_columns))).query(
                np.column_stack([row, column])
            )
            return Coarse(self.points, (1, len(self.points)), np.unique(nearest), triangles)
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


def _surface_with_gaps(points: FloatArray, gaps: CoarseGaps) -> HeightSurface:
    """Do what :func:`_surface` does: a model of these samples whose faces are those of the whole grid."""
    order = vector_order(gaps.xy, points[:, 2])
    row = np.argsort(order)
    model = placed_model(
        "coarse grid",
        points[order],
        row[gaps.faces],
        row[gaps.corners],
        xy=gaps.xy[order],
        unit=gaps.unit,
        source_index=order,
        footprint=gaps.footprint,
    )
    return HeightSurface(model, gaps.rules)


def move(task: Coarse, gaps: CoarseGaps | None = None) -> IntArray:
    """Move the vertices of a mesh while that lowers its error; return its rows of ``task.points``, ascending."""
    surface = _surface(task.points.tobytes(), task.shape) if gaps is None else _surface_with_gaps(task.points, gaps)
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
        If it is less than the least there is: 2, or with gaps what the smallest mesh has.
    """
    grid = surface.model
    if triangles < 2 and grid.lattice is None:
        raise ValueError(f"a mesh of {grid.name} has at least 2 triangles, not {triangles}")
    order = np.argsort(-nested.level, kind="stable")
    samples, level = grid.samples_of_rows(nested.rows[order]), nested.level[order]
    # all samples of one level go together
    last = np.flatnonzero(np.r_[level[1:] < level[:-1], True])
    if grid.lattice is None:
        count = np.cumsum(grid.triangles_of(samples)) - 2
        most = last[np.flatnonzero(count[last] <= triangles)[-1]]
    else:
        most = _last_of_at_most(surface, samples, last, triangles)
    return float(level[most + 1]) if most + 1 < len(level) else float(nested.slope[-1])


def _last_of_at_most(surface: GridSurface, samples: IntArray, last: IntArray, triangles: int) -> int:
    """Return the last of some places up to which samples have a mesh of at most so many triangles, about.

    With gaps the triangles come and go: found by halving, it is a place before which there is one that has more.
    """

    def count(place: int) -> int:
        return weld(surface.model, samples[: last[place] + 1], surface.rules).n_triangles

    low, high = 0, len(last)
    while low < len(last) and count(low) == 0:  # the first of them that is a mesh
        low += 1
    if low == len(last) or count(low) > triangles:
        raise ValueError(
            f"the smallest mesh of {surface.model.name} has {count(min(low, len(last) - 1))} triangles, not {triangles}"
        )
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if 0 < count(middle) <= triangles else (low, middle)
    return int(last[low])


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
    quality = measure(grid, weld(grid, kept, surface.rules), n_threads=threads)
    if 2 < triangles <= SEARCHED:
        coarse = CoarseGrid(grid, surface.rules)
        samples = np.sort(coarse.samples[move(coarse.task(kept, triangles), coarse.gaps)])
        found = measure(grid, weld(grid, samples, surface.rules), n_threads=threads)
        if found.error < quality.error and room[0] < found.triangles < room[1]:
            return grid.rows_of_samples(samples), found
    return None, quality


def strided(first: int, last: int, stride: int) -> IntArray:
    """Return every stride-th number from first to last, and the last."""
    numbers = np.arange(first, last + 1, stride, dtype=np.int64)
    return numbers if numbers[-1] == last else np.append(numbers, last)
