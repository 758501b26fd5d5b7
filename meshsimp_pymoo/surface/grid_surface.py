"""The surface of a height grid that is read by windows: a subset means what it means on a height surface.

Its arrays of N rows are made when they are asked for; what pictures, pages and files take of a mesh is bounded by the
mesh. All that asks for a whole array (``points``, ``faces`` and ``places`` by :func:`numpy.asarray`, ``score``) takes
as much memory as a model in one piece.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, Csr, FloatArray, IntArray, Rows, require_bool
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.source.heights import MESH_SAMPLE_BYTES, grid_mesh
from meshsimp_pymoo.memory import check_free
from meshsimp_pymoo.plane.faces import border_vertices, canonical_faces, one_rings
from meshsimp_pymoo.reprs import brief, in_short
from meshsimp_pymoo.surface.grid import HeightGrid
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import REGIONS, Quality
from meshsimp_pymoo.surface.model import OpenModel, build_model
from meshsimp_pymoo.surface.rules import DEFAULT, Rules
from meshsimp_pymoo.surface.surface import Refitted, Scored, Simplified, Surface, View
from meshsimp_pymoo.surface.weld import WeldedMesh, coverage, measured, residual_bands, tabulated, weld

#: Rules that may be anything. The others are as they are where nothing is said.
FREE_RULES = ("footprint", "outside")


@brief
@dataclass(frozen=True, eq=False)
class Banded:
    """The mesh of a subset, of whose original not all samples are held at once.

    Attributes
    ----------
    faces : (M, 3) int array
        Its triangles as vertices of the grid.
    quality : Quality
        Its numbers.
    coverage : float
        Share of the area of the grid's faces whose centroids it covers.
    bands : callable
        Yields, from north to south, vertices (n,), by how much each lies above the mesh (n,), or its deviation where no
        triangle covers it, and whether one does (n,).
    """

    faces: IntArray
    quality: Quality
    coverage: float
    bands: Callable[[], Iterator[tuple[IntArray, FloatArray, BoolArray]]]


class GridSurface:
    """A height grid and the rules for it; see `Surface` for what its attributes are.

    Parameters
    ----------
    grid : HeightGrid
        The grid of N vertices.
    rules : Rules
        What counts.

    Raises
    ------
    ModelError
        If the rules name what a grid read by windows does not know: another measure, weights, pins.
    """

    def __init__(self, grid: HeightGrid, rules: Rules = DEFAULT) -> None:
        for name, value in vars(rules).items():
            if name not in FREE_RULES and value != getattr(DEFAULT, name):
                raise ModelError(
                    f"{grid.name}: {name}={in_short(value)} is not for a grid read by windows; leave it out, or take "
                    "the grid in one piece (MeshProblem), or a part of it (window=)"
                )
        self.model = grid
        self.rules = rules.of_heights

    def __repr__(self) -> str:
        return f"<GridSurface of {self.model.name}: {self.n_vertices:,} samples; {self.rules.in_words}>"

    @property
    def n_vertices(self) -> int:
        """Number N of samples that belong to a face."""
        return self.model.n_vertices

    @property
    def points(self) -> Any:
        """The vertices (N, 3) from a local origin [model units]."""
        grid = self.model
        if grid.model is not None:
            row_of, points = grid.row_of, grid.model.points
            return Rows(lambda vertices: points[row_of[vertices]], self.n_vertices)  # type: ignore[index]
        return Rows(lambda vertices: grid.file_points[vertices] * self.view.scale - self.view.pivot, self.n_vertices)

    @property
    def faces(self) -> Any:
        """The original triangles (T, 3)."""
        return self.model.faces

    @cached_property
    def pinned(self) -> BoolArray:
        """The corners."""
        pinned = np.zeros(self.n_vertices, bool)
        pinned[self.model.vertices(self.model.corners)] = True
        return pinned

    @property
    def total_weight(self) -> float:
        """All vertices count alike."""
        return float(self.n_vertices)

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the bounding box in space [model units]."""
        return float(np.linalg.norm(self.view.extent))

    @cached_property
    def neighbours(self) -> Csr:
        """The one-rings of the original mesh."""
        return one_rings(np.asarray(self.faces), self.n_vertices)

    @property
    def border(self) -> IntArray:
        """The vertices of the first and last rows and columns; with gaps those at edges of one original face."""
        if self.model.lattice is not None:
            return border_vertices(np.asarray(self.faces))
        rows, columns = self.model.shape
        inside = np.zeros((rows, columns), bool)
        inside[1:-1, 1:-1] = True
        return np.flatnonzero(~inside)

    @property
    def places(self) -> Any:
        """The vertices (N, 2) in the unit square."""
        grid = self.model
        return Rows(lambda vertices: grid.xy_at(grid.numbers(vertices)), self.n_vertices)

    @cached_property
    def view(self) -> View:
        """The grid from above, a flat relief drawn higher."""
        grid = self.model
        if grid.model is not None:
            model = grid.model
            return View(np.ptp(model.points, axis=0), model.rotation, model.pivot, model.scale)
        scale = np.array([*grid.scale, 1.0])
        low, high = grid.file_box * scale
        return View(high - low, np.eye(3), low, scale)

    def selection(self, most: int) -> BoolArray:
        """Return at most so many vertices (N,), spread evenly, the corners among them."""
        grid = self.model
        (rows, columns), stride = grid.shape, 1
        selected = np.zeros(self.n_vertices, bool)
        if grid.lattice is not None:
            # as many crossings as leave so many vertices, if they are spread evenly over all
            most = max(most - len(grid.corners), 4)
            share = self.n_vertices / (rows * columns)
            while True:
                n_crossings = (-(-(rows - 1) // stride) + 1) * (-(-(columns - 1) // stride) + 1)
                if share * n_crossings <= most:
                    row, column = (np.r_[0 : n - 1 : stride, n - 1] for n in (rows, columns))
                    at = np.flatnonzero(grid.lattice.at(row[:, None], column))
                    if len(at) <= most:
                        break
                stride += 1
            i, j = np.divmod(at, len(column))
            selected[grid.vertices(np.concatenate([row[i] * columns + column[j], grid.corners]))] = True
            return selected
        while (-(-(rows - 1) // stride) + 1) * (-(-(columns - 1) // stride) + 1) > most:
            stride += 1
        every = selected.reshape(rows, columns)
        every[np.ix_(*(np.r_[0 : n - 1 : stride, n - 1] for n in (rows, columns)))] = True
        return selected

    def triangles(self, kept: BoolArray) -> IntArray:
        """Return the triangles (M, 3) of one subset (N,)."""
        return self._faces_of(self._welded(kept))

    def _welded(self, kept: BoolArray, *, may_be_none: bool = False) -> WeldedMesh:
        """Return the mesh of one subset (N,)."""
        grid = self.model
        mesh = weld(grid, grid.numbers(np.flatnonzero(self._checked(kept))), self.rules)
        if not may_be_none and mesh.n_triangles == 0:
            raise ValueError(
                f"{int(np.sum(kept))} kept vertices of {grid.name} span no triangle of the mesh; keep more of them, "
                "the corners first"
            )
        return mesh

    def _faces_of(self, mesh: WeldedMesh) -> IntArray:
        """Return the triangles (M, 3) of a mesh as vertices."""
        return canonical_faces(self.model.vertices(mesh.samples)[mesh.faces])

    def evaluate(self, kept: BoolArray, *, threads: int = 1, regions: int = 0) -> FloatArray:
        """Return the table (P, 6) of numbers of subsets (P, N)."""
        if regions:
            raise ValueError(f"{self.model.name}: a grid read by windows has no errors of regions; leave regions out")
        none = np.empty(0, np.int64)
        found = [
            tabulated(
                self.model,
                self._welded(row, may_be_none=True),
                none,
                between=False,
                n_threads=threads,
            )[0]
            for row in np.atleast_2d(kept)
        ]
        return np.array(found).reshape(-1, REGIONS)

    def simplify(self, kept: BoolArray, *, rows: IntArray | None = None) -> Simplified:
        """Return the mesh of one subset (N,), and its deviation at all vertices or at those of ``rows``, ascending.

        Raises
        ------
        ValueError
            If no triangle is emitted, as all lie in gaps.
        """
        grid, mesh = self.model, self._welded(kept)
        at = grid.numbers(np.arange(self.n_vertices) if rows is None else rows)
        quality, deviation, covered = measured(grid, mesh, at, n_threads=os.cpu_count() or 1)
        return Simplified(self._faces_of(mesh), quality, deviation, covered)

    def banded(self, kept: BoolArray) -> Banded:
        """Return the mesh of one subset (N,), and its residuals band by band, in bounded memory.

        Raises
        ------
        ValueError
            If no triangle is emitted, as all lie in gaps.
        """
        grid, mesh = self.model, self._welded(kept)
        quality, *_ = measured(grid, mesh, np.empty(0, np.int64), n_threads=os.cpu_count() or 1)

        def bands() -> Iterator[tuple[IntArray, FloatArray, BoolArray]]:
            columns = grid.shape[1]
            for first, residuals, covered in residual_bands(grid, mesh):
                there = ~np.isnan(residuals)
                samples = first * columns + np.flatnonzero(there)
                yield grid.vertices(samples), residuals[there], covered[there]

        return Banded(self._faces_of(mesh), quality, coverage(grid, mesh), bands)

    def of_faces(self, faces: IntArray, *, rows: IntArray | None = None) -> Simplified:
        """Refuse: free meshes are made and measured with a model in one piece."""
        raise ModelError(f"{self.model.name}: meshes of tiles are Delaunay, not free; simplify it in one piece")

    def score(self, points: FloatArray, faces: IntArray) -> Scored:
        """Measure any mesh in the frame of the file by the same error, with the grid as a model in one piece."""
        whole, row_of = self.whole
        found = whole.score(points, faces)
        return Scored(found.quality, found.deviation[row_of], found.covered[row_of])

    @cached_property
    def whole(self) -> tuple[HeightSurface, IntArray]:
        """The surface of the grid as a model in one piece, and the row of each vertex in it."""
        model, row_of = self._in_one_piece()
        return HeightSurface(model, self.rules), row_of

    def _in_one_piece(self) -> tuple[OpenModel, IntArray]:
        grid = self.model
        if grid.model is not None and grid.row_of is not None:
            return grid.model, grid.row_of
        check_free(
            self.n_vertices * MESH_SAMPLE_BYTES,
            f"{grid.name}: {grid.shape[1]} x {grid.shape[0]} samples in one piece",
            "measure against a part of it (--window)",
        )
        source = grid_mesh(
            np.asarray(grid.heights[:, :]),
            np.zeros(grid.shape, bool) if grid.lattice is None else ~grid.lattice.rows(0, grid.shape[0]),
            lambda i, j: (grid.file_x[j], grid.file_y[i]),
            nodata=None,
            name=grid.name,
            corner=(0, 0),
            file_columns=grid.shape[1],
            georeference=grid.georeference,
        )
        model = build_model(source, up="z")
        return model, np.argsort(model.source_index)

    def refit(self, mesh: Simplified, *, until: float | None = None) -> Refitted:
        """Refuse: the heights of a mesh are fitted with a model in one piece."""
        raise ModelError(f"{self.model.name}: the heights of meshes of tiles are not fitted; simplify it in one piece")

    def ground(self) -> None:
        """Return that meshes are evaluated here, but not moved."""

    def free_ground(self, *, centroids: bool) -> None:
        """Return that meshes of tiles are Delaunay."""

    def measuring(self, measure: str) -> Surface:
        """Refuse, as :meth:`ground` says."""
        raise self._no_moves()

    def bounded(self, most: float, *, own: float = 0.0) -> Surface:
        """Refuse, as :meth:`ground` says."""
        raise self._no_moves()

    def spanning(self, kept: BoolArray) -> BoolArray:
        """Return the subset: there are no parts."""
        return kept

    def books(self, kept: BoolArray, *, fixed: BoolArray | None = None) -> AbstractContextManager[Any]:
        """Refuse, as :meth:`ground` says."""
        raise self._no_moves()

    def _no_moves(self) -> ModelError:
        return ModelError(f"{self.model.name}: a grid read by windows has no moves; open it in one piece")

    def _checked(self, kept: BoolArray) -> BoolArray:
        require_bool(kept, f"a subset of {self.model.name} is a bool array, one entry a sample")
        if kept.shape != (self.n_vertices,):
            raise ValueError(
                f"a subset of {self.model.name} has shape ({self.n_vertices},), one entry a sample, not {kept.shape}"
            )
        return kept
