"""The closed surface: parts of genus 0, with holes or without, where a subset means the convex hulls of its images."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, require_bool
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.surface.closed.books import ClosedLive, make_live, with_peaks
from meshsimp_pymoo.surface.closed.evaluate import evaluate_closed, make_workspace, triangulate_closed
from meshsimp_pymoo.surface.closed.free import ClosedFreeGround
from meshsimp_pymoo.surface.closed.ground import ClosedGround, make_ground
from meshsimp_pymoo.surface.closed.lining import lined_closed_model
from meshsimp_pymoo.surface.closed.live import build
from meshsimp_pymoo.surface.closed.model import LEAST_VERTICES, ClosedModel
from meshsimp_pymoo.surface.closed.nearest import distances_to_line, distances_to_mesh
from meshsimp_pymoo.surface.closed.refit import Held, Samples, rounds_of_refit
from meshsimp_pymoo.surface.measures import TRIANGLES, as_quality
from meshsimp_pymoo.surface.pins import named_vertices
from meshsimp_pymoo.surface.rules import DEFAULT, OF_HEIGHTS, Rules
from meshsimp_pymoo.surface.score import measured_angles, mesh_quality
from meshsimp_pymoo.surface.surface import ModelSurface, Refitted, Scored, Simplified, View, checked_faces
from meshsimp_pymoo.workers import Reserve

# What a sample of a rim counts where vertices are moved, as a share of what a vertex does.
RIM_WEIGHT = 0.1
# From so many vertices on, books and workspaces that are not used are given back: hundreds of bytes a vertex each.
LARGE = 300_000


class ClosedSurface(ModelSurface):
    """A closed model and the rules for it; see `Surface` for what its attributes are.

    The mesh of a subset is the Delaunay triangulation of its images and the outside of each part as one more triangle,
    without what lies in holes. Without holes each part is watertight, of genus 0, uses all n vertices and has 2 n - 4
    triangles. The deviation d_p of a vertex is its distance in space to the triangle that holds its image and to those
    across its edges, as far as they are in the mesh.

    Parameters
    ----------
    model : ClosedModel
        The original mesh of N vertices. Its weights are replaced by those of the rules, if they name some.
    rules : Rules
        What counts; what describes height surfaces is refused.

    Raises
    ------
    ModelError
        If the rules do not fit the model, or a closed surface.
    """

    def __init__(self, model: ClosedModel, rules: Rules = DEFAULT) -> None:
        _refuse_rules(model.name, rules)
        bare = model if rules.break_lines is None else model.without_lines()
        self.model = bare if rules.weights is None else bare.with_weights(rules.weights)
        if rules.break_lines is not None:
            self.model = lined_closed_model(self.model, rules.break_lines, rules.line_tolerance)
        self.rules = rules
        self.pinned: BoolArray = named_vertices(self.model, rules.pin)
        self.pinned[self.model.poles] = True
        if self.model.lines is not None:
            self.pinned[self.model.lines.vertices] = True
        self._free: dict[bool, ClosedFreeGround] = {}
        is_small = self.n_vertices < LARGE
        self._workspaces = Reserve(partial(make_workspace, self.n_vertices), is_small)
        has_holes = len(self.model.rim) > 0
        self._books = Reserve(partial(make_live, self.n_vertices, self.model.n_parts, has_holes=has_holes), is_small)

    def __repr__(self) -> str:
        return (
            f"<ClosedSurface of {self.model.name}: {self.n_vertices:,} vertices, {int(self.pinned.sum()):,} pinned, "
            f"{self.rules.measure} measured>"
        )

    @property
    def border(self) -> IntArray:
        """The vertices at the rims of holes."""
        return self.model.border

    @property
    def least_triangles(self) -> int:
        """No mesh has fewer triangles: each part has its pole, and without holes two for each vertex but four.

        With holes more vertices can be fewer triangles.
        """
        if len(self.model.rim):
            return self.model.n_parts
        pinned = np.bincount(self.model.part[self.pinned], minlength=self.model.n_parts)
        return int((2 * np.maximum(pinned, LEAST_VERTICES) - 4).sum())

    def spanning(self, kept: BoolArray) -> BoolArray:
        """Return a subset (N,) with what is pinned and, of several parts, a fourth vertex of each that has three.

        It is the one farthest from the middle of the part's pole.
        """
        model = self.model
        found = kept | self.pinned
        short = np.flatnonzero(np.bincount(model.part[found], minlength=model.n_parts) < LEAST_VERTICES)
        if model.n_parts == 1 or len(short) == 0:
            return kept
        middle = self.points[model.poles].mean(axis=1)[model.part]
        rows = np.flatnonzero(np.isin(model.part, short) & ~found)
        away = np.linalg.norm(self.points[rows] - middle[rows], axis=1)
        order = np.lexsort((-away, model.part[rows]))
        first = np.unique(model.part[rows][order], return_index=True)[1]
        found[rows[order[first]]] = True
        return found

    @property
    def places(self) -> FloatArray:
        """The vertices (N, 3), for cuts through the surface."""
        return self.points

    @cached_property
    def view(self) -> View:
        """The model from the side on which it is thinnest."""
        model = self.model
        return View(np.ptp(self.points, axis=0), model.rotation, model.pivot, model.scale, is_closed=True)

    @cached_property
    def _ground(self) -> ClosedGround:
        return make_ground(self.model, self.rules)

    @cached_property
    def _between(self) -> tuple[FloatArray, FloatArray]:
        """Centroids of the original faces (T, 3) and the area of each as a share of all."""
        a, b, c = (self.points[self.faces[:, k]] for k in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return (a + b + c) / 3.0, area / area.sum()

    def ground(self) -> ClosedGround:
        """Return the model's arrays and the rules for compiled functions."""
        return self._ground

    def free_ground(self, *, centroids: bool = True) -> ClosedFreeGround:
        """Return what the free meshes of this surface have in common; see `closed.free`."""
        if centroids not in self._free:
            self._free[centroids] = ClosedFreeGround(self.model, self._ground, self.pinned, centroids=centroids)
        return self._free[centroids]

    def measuring(self, measure: str) -> ClosedSurface:
        """Return this surface with another measure of the error, or itself."""
        if measure == self.rules.measure:
            return self
        other = copy.copy(self)
        other.rules = replace(self.rules, measure=measure)
        other.__dict__.pop("_ground", None)
        other._free = {}
        return other

    def bounded(self, most: float, *, own: float = 0.0) -> ClosedSurface:
        """Return this surface with another cost of moves: what exceeds ``most``, and ``own`` times its own.

        See `Surface.bounded`.

        Raises
        ------
        ValueError
            If ``most`` or ``own`` is negative or no number.
        """
        numbers: dict[str, Any] = {"most": most, "own": own}
        for name, value in numbers.items():
            if not isinstance(value, (int, float, np.number)) or not value >= 0:
                raise ValueError(f"{name} = {value!r} is no number of at least 0")
        other = copy.copy(self)
        other.rules = replace(self.rules, measure="error")  # the sum of these costs
        other._free = {}
        other._ground = self._ground._replace(bound=float(most), own=float(own), weighed=True, by_peak=False)
        return other

    @contextmanager
    def books(self, kept: BoolArray, *, fixed: BoolArray | None = None) -> Iterator[ClosedLive]:
        """Lend the live mesh of a subset; no two images coincide, so ``fixed`` decides nothing."""
        with self._books.one() as lent:
            ground = self._ground
            live = with_peaks(lent) if ground.by_peak else lent
            build(ground, live, np.flatnonzero(kept), self.model.name)
            yield live

    def line_chains(self, kept: BoolArray) -> tuple[IntArray, ...]:
        """Return each break line as the chain of edges that it is in the mesh of a subset (N,): rows, in order.

        Beside the vertices that thinning left these are the kept ones whose images lie exactly on the line.
        """
        lines = self.model.lines
        return () if lines is None else lines.chains_through(self._ground.lines, kept | self.pinned)

    def triangles(self, kept: BoolArray) -> IntArray:
        """Return the triangles (M, 3) of one subset (N,)."""
        return self._triangulated(kept)[0]

    def evaluate(self, kept: BoolArray, *, threads: int = 1, regions: int = 0) -> FloatArray:
        """Return the table (P, 6) of numbers of subsets (P, N); a closed surface knows no ``regions``."""
        self.refuse_regions(regions)
        return evaluate_closed(self._ground, self._workspaces, kept, n_threads=threads)

    def refuse_regions(self, regions: int) -> None:
        """Raise a ValueError if errors by region are asked for."""
        if regions:
            raise ValueError(
                f"regions={regions}: errors by region are for height surfaces, and {self.model.name} is a closed one; "
                "leave regions (and what is made of them, such as RegionCrossover) out"
            )

    def simplify(self, kept: BoolArray, *, rows: IntArray | None = None) -> Simplified:
        """Return the mesh of the kept vertices and its measures: the phenotype of one chromosome (N,).

        Raises
        ------
        ValueError
            If there are fewer than 4 of a part, or its pole is not among them.
        """
        faces, numbers, deviation, covered = self._triangulated(kept)
        quality = as_quality(numbers, self.total_weight, **self._of_mesh(self.points, faces))
        at = slice(None) if rows is None else rows
        return Simplified(faces, quality, deviation[at], covered[at])

    def _triangulated(self, kept: Any) -> tuple[IntArray, FloatArray, FloatArray, BoolArray]:
        row = np.array(require_bool(kept, "a subset is a bool array, one entry a vertex"), order="C")
        if row.shape != (self.n_vertices,):
            raise ValueError(
                f"a subset of {self.model.name} has shape ({self.n_vertices},), one entry a vertex, not {row.shape}"
            )
        found = triangulate_closed(self._ground, self._workspaces, row)
        if found[1][TRIANGLES] == 0:
            raise ValueError(
                f"{int(row.sum())} kept vertices of {self.model.name} are no closed mesh; keep at least 4 of each "
                "part, those that are pinned among them"
            )
        return found

    def _of_mesh(self, vertices: FloatArray, faces: IntArray) -> dict[str, float]:
        """Return what is said of a mesh of vertices (V, 3) in the frame of the points beside the deviations."""
        centres, share = self._between
        away, _ = distances_to_mesh(centres, vertices, faces)
        said = {"surface_error": float((share * away).sum())} | measured_angles(vertices, faces)
        lines = self.model.lines
        if lines is not None:
            away, _ = distances_to_mesh(np.concatenate(lines.originals), vertices, faces)
            said |= lines.errors(away)
        return said

    def of_faces(self, faces: IntArray, *, rows: IntArray | None = None) -> Simplified:
        """Measure a mesh of the model's own vertices with any edges, by true distance; see :meth:`score`."""
        faces = checked_faces(faces, self.n_vertices)
        found = self._scored(self.points, faces)
        used, _ = used_rows(faces)
        found.deviation[used] = 0.0
        at = slice(None) if rows is None else rows
        return Simplified(faces, found.quality, found.deviation[at], found.covered[at])

    def score(self, points: FloatArray, faces: IntArray) -> Scored:
        """Measure any mesh by true distance in space: that of each original vertex to the nearest point of the mesh.

        What is said of a subset is at least that, and as a rule hardly more: its d_p are distances to four triangles.

        Parameters
        ----------
        points : (V, 3) float array
            Vertices in the frame of the model's file [file units].
        faces : (M, 3) int array

        Raises
        ------
        ValueError
            If there is no face, or the arrays do not fit together.
        """
        points, faces = np.asarray(points, float), np.asarray(faces)
        if points.ndim != 2 or points.shape[1:] != (3,) or faces.ndim != 2 or faces.shape[1:] != (3,):
            raise ValueError(
                f"a mesh has vertices (V, 3) and faces (M, 3), not arrays of shape {points.shape} and {faces.shape}"
            )
        if not len(faces):
            raise ValueError("a mesh without faces has no error; it needs at least one triangle")
        if faces.min() < 0 or faces.max() >= len(points):
            raise ValueError(f"faces index rows {faces.min()} to {faces.max()} of {len(points)} vertices")
        if not np.isfinite(points[faces]).all():
            raise ValueError("vertices of faces are not finite")
        return self._scored(self.model.to_local(points), faces)

    def _scored(self, vertices: FloatArray, faces: IntArray) -> Scored:
        deviation, _ = distances_to_mesh(self.points, vertices, faces)
        covered = np.ones(len(deviation), bool)
        quality = mesh_quality(
            deviation, covered, faces, self.model.weights, self.total_weight, **self._of_mesh(vertices, faces)
        )
        return Scored(quality, deviation, covered)

    def refit(self, mesh: Simplified, *, until: float | None = None) -> Refitted:
        """Move a mesh's vertices to where it fits the vertices and face centres of the original best.

        See :mod:`~meshsimp_pymoo.surface.closed.refit`. The measure is the true distance of the vertices, as
        :meth:`score` has it; the mesh of the least error of all rounds is returned, or the one given where none has
        less. Where there are holes, what it is off their rims counts in that choice, at `RIM_WEIGHT`, but no mesh of a
        greater error is taken. There is no proved bound: it is 0.
        """
        rows, compact = used_rows(mesh.faces)
        n, before = self.n_vertices, mesh.quality.error
        if before == 0.0:
            return Refitted(mesh.faces, rows, self.model.file_points[rows], before, before, before)
        weights = np.ones(n) if self.model.weights is None else self.model.weights
        best, least, error = self.points[rows], np.inf, before
        samples = self._samples(weights)
        for vertices, away, beside in rounds_of_refit(best, compact, samples, held=self._held(rows), until=until):
            there = float((weights * away[:n]).sum())
            # where there are rims they decide too, but the error is never above what it was
            rated = there + float((samples.rim_weights * beside).sum())
            if rated < least and there <= before:
                best, least, error = vertices, rated, there
        moved = (best != self.points[rows]).any(axis=1)
        found = np.where(moved[:, None], self.model.to_file(best), self.model.file_points[rows])
        return Refitted(mesh.faces, rows, found, error, before, 0.0)

    def _samples(self, weights: FloatArray) -> Samples:
        """Return the vertices, the centres of the faces, and on rims their vertices and the middles of their edges."""
        centres, share = self._between
        ends = self.model.rim
        rim = np.concatenate([self.points[self.model.border], self.points[ends].mean(axis=1)])
        of_rim = np.full(len(rim), RIM_WEIGHT * weights.mean())
        points = np.concatenate([self.points, centres])
        return Samples(points, np.concatenate([weights, share * weights.sum()]), rim, of_rim)

    def _held(self, rows: IntArray) -> Held | None:
        """Return what break lines ask of the vertices of a mesh, rows of the model, that are moved."""
        lines = self.model.lines
        if lines is None:
            return None
        kept = np.zeros(self.n_vertices, bool)
        kept[rows] = True
        ends = []
        for line, chain in zip(lines.originals, self.line_chains(kept), strict=True):
            _, nearest = distances_to_line(line, self.points[chain])
            at = np.searchsorted(rows, chain)
            ends.append(np.column_stack([at[nearest], at[nearest + 1]]))
        return Held(np.concatenate(lines.originals), np.concatenate(ends), lines.tolerance)

    def __deepcopy__(self, memo: dict[int, Any]) -> ClosedSurface:
        return self

    def __getstate__(self) -> dict[str, Any]:
        unstored = ("_ground", "_between", "view")
        return {name: value for name, value in self.__dict__.items() if name not in unstored} | {"_free": {}}


def _refuse_rules(name: str, rules: Rules) -> None:
    """Refuse what describes height surfaces."""
    for what in OF_HEIGHTS:
        if (value := getattr(rules, what)) is not None:
            raise ModelError(
                f"{name}: {what}={value!r} (--{what} {value}) describes height surfaces, and this is a closed one, "
                "whose holes stay open and whose uncovered vertices cost their distance; leave it out"
            )
