"""The height surface: an open model z = f(x, y), where a subset means its Delaunay triangulation in the plane."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy import sparse

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, require_bool
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.surface.books import Live, make_live, with_peaks
from meshsimp_pymoo.surface.centroids import Between, between_vertices
from meshsimp_pymoo.surface.evaluate import evaluate_subsets, make_workspace, triangulate_subset
from meshsimp_pymoo.surface.free import FreeGround
from meshsimp_pymoo.surface.ground import Ground, make_ground
from meshsimp_pymoo.surface.lining import lined_model
from meshsimp_pymoo.surface.live import build
from meshsimp_pymoo.surface.measures import TRIANGLES, as_quality
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.pins import pinned_vertices
from meshsimp_pymoo.surface.refit import TOLERANCE, least_error
from meshsimp_pymoo.surface.rules import DEFAULT, Rules
from meshsimp_pymoo.surface.score import line_errors, measured_angles, mesh_deviation, mesh_quality, mesh_samples
from meshsimp_pymoo.surface.surface import (
    ModelSurface,
    Refitted,
    Scored,
    Simplified,
    View,
    checked_faces,
    require_rules,
)
from meshsimp_pymoo.workers import Reserve

# A kept vertex of weight 0 counts this share of the mean all the same, so that its refitted height has a value.
LEAST_WEIGHT = 1e-9
# From so many vertices on, books and workspaces that are not used are given back: hundreds of bytes a vertex each.
LARGE = 300_000


class HeightSurface(ModelSurface):
    """An open model and the rules for it; see `Surface` for what its attributes are.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices. Its weights are replaced by those of the rules, if they name some.
    rules : Rules
        What counts.

    Raises
    ------
    ModelError
        If the pins or weights of the rules do not fit the model.

    Examples
    --------
    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.model import build_model
    >>> roof = HeightSurface(build_model(load("roof:3")))
    >>> roof.simplify(roof.pinned).quality.error        # the ridge of 3 vertices falls from height 1 to the ground
    3.0
    """

    def __init__(self, model: OpenModel, rules: Rules = DEFAULT) -> None:
        self.model = model if rules.weights is None else model.with_weights(rules.weights)
        if rules.break_lines is not None:
            self.model = lined_model(self.model.without_lines(), rules.break_lines, rules.line_tolerance)
        self.rules = rules.of_heights
        self.pinned: BoolArray = pinned_vertices(self.model, rules.pin)
        is_small = self.n_vertices < LARGE
        self._workspaces = Reserve(partial(make_workspace, self.n_vertices), is_small)
        self._books = Reserve(partial(make_live, self.n_vertices), is_small)
        self._free: dict[bool, FreeGround] = {}

    def __repr__(self) -> str:
        rules = self.rules
        return (
            f"<HeightSurface of {self.model.name}: {self.n_vertices:,} vertices, {int(self.pinned.sum()):,} pinned, "
            f"{rules.measure} measured; {rules.in_words}>"
        )

    @property
    def border(self) -> IntArray:
        """Vertices at edges of one original face only."""
        return self.model.border

    @property
    def places(self) -> FloatArray:
        """The vertices (N, 2) in the unit square."""
        return self.model.xy

    @cached_property
    def view(self) -> View:
        """The model upright, a flat relief drawn higher."""
        return View(np.ptp(self.points, axis=0), self.model.rotation, self.model.pivot, self.model.scale)

    @cached_property
    def _ground(self) -> Ground:
        return make_ground(self.model, self.rules)

    def ground(self) -> Ground:
        """Return the model's arrays and the rules for compiled functions."""
        return self._ground

    @cached_property
    def between(self) -> Between:
        """Where meshes are measured between the vertices: the centroids of the original faces."""
        return between_vertices(self.model)

    def bounded(self, most: float, *, own: float = 0.0) -> HeightSurface:
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

    def measuring(self, measure: str) -> HeightSurface:
        """Return this surface with another measure of the error, or itself."""
        if measure == self.rules.measure:
            return self
        other = copy.copy(self)
        other.rules = replace(self.rules, measure=measure)
        other.__dict__.pop("_ground", None)
        other._free = {}
        return other

    def free_ground(self, *, centroids: bool = True) -> FreeGround:
        """Return what the free meshes of this surface have in common; see :mod:`~meshsimp_pymoo.surface.free`."""
        if centroids not in self._free:
            self._free[centroids] = FreeGround(
                self.model, self.rules, self._ground, self.pinned, self.sites, centroids=centroids
            )
        return self._free[centroids]

    @contextmanager
    def books(self, kept: BoolArray, *, fixed: BoolArray | None = None) -> Iterator[Live]:
        """Lend the live triangulation of a subset; of several kept vertices at one place, a fixed one is the site."""
        with self._books.one() as lent:
            ground = self._ground
            live = with_peaks(lent) if ground.by_peak else lent
            build(ground, live, self.sites(kept, fixed), self.model.name)
            yield live

    def sites(self, kept: BoolArray, fixed: BoolArray | None = None) -> IntArray:
        """Return the rows of the kept vertices, one for each place: a fixed one where there is one, else the first."""
        rows = np.flatnonzero(kept)
        if not self._ground.has_twins:
            return rows
        xy = self.model.xy
        group = np.cumsum(np.r_[True, (xy[1:] != xy[:-1]).any(axis=1)])[rows]
        order = np.arange(len(rows)) if fixed is None else np.lexsort((~fixed[rows], group))
        first = np.r_[True, group[order][1:] != group[order][:-1]][: len(rows)]
        return np.sort(rows[order[first]])

    def line_chains(self, kept: BoolArray) -> tuple[IntArray, ...]:
        """Return each break line as the chain of edges that it is in the mesh of a subset (N,): rows, in order.

        Beside the vertices that thinning left these are the kept ones that lie exactly on the line.
        """
        lines = self.model.lines
        if lines is None:
            return ()
        is_site = np.zeros(self.n_vertices, bool)
        is_site[self.sites(kept | self.pinned, self.pinned)] = True
        return lines.chains_through(self._ground.lines, is_site)

    def triangles(self, kept: BoolArray) -> IntArray:
        """Return the triangles (M, 3) of one subset (N,)."""
        return self._triangulated(kept)[0]

    def evaluate(self, kept: BoolArray, *, threads: int = 1, regions: int = 0) -> FloatArray:
        """Return the table (P, 6 + regions) of numbers of subsets (P, N); see :func:`evaluate_subsets`."""
        return evaluate_subsets(self._ground, self._workspaces, kept, n_threads=threads, regions=regions)

    def simplify(self, kept: BoolArray, *, rows: IntArray | None = None) -> Simplified:
        """Triangulate the kept vertices and measure the result: the phenotype of one chromosome (N,).

        Raises
        ------
        ValueError
            If no triangle is emitted: fewer than 3 vertices, all on one line, or all triangles outside the footprint.
        """
        faces, numbers, deviation, covered, between = self._triangulated(kept, self.between)
        of_mesh = measured_angles(self.points[:, :2], faces)
        of_mesh |= line_errors(self._ground, self.model.lines, self.points, faces, planar=True)
        quality = as_quality(numbers, self.total_weight, surface_error=between, **of_mesh)
        at = slice(None) if rows is None else rows
        return Simplified(faces, quality, deviation[at], covered[at])

    def _triangulated(self, kept: BoolArray, between: Between | None = None) -> Any:
        """Return what :func:`triangulate_subset` does of a subset that spans a triangle."""
        row = self._checked(kept)
        found = triangulate_subset(self._ground, self._workspaces, row, between)
        if found[1][TRIANGLES] == 0:
            raise ValueError(
                f"{int(row.sum())} kept vertices of {self.model.name} span no triangle of the mesh; "
                "keep more of them, the corners first"
            )
        return found

    def of_faces(self, faces: IntArray, *, rows: IntArray | None = None) -> Simplified:
        """Measure a mesh of the model's own vertices with any edges: a free one.

        The rule is that of :meth:`simplify`; :meth:`score` says the same but for rounding, and but for vertices outside
        to which several places of the outline are equally near. A vertex of the mesh that it covers does not deviate.

        Parameters
        ----------
        faces : (M, 3) int array
            Triangles as rows of :attr:`points`; no two of them should overlap in the plane.
        rows : (K,) int array, optional
            The vertices whose deviation is wanted, ascending; by default all.

        Raises
        ------
        ValueError
            If these are no triangles of the model, or none has an area in the plane.
        """
        faces = checked_faces(faces, self.n_vertices)
        found = self._scored(self.points, faces, own=used_rows(faces)[0])
        at = slice(None) if rows is None else rows
        return Simplified(faces, found.quality, found.deviation[at], found.covered[at])

    def score(self, points: FloatArray, faces: IntArray) -> Scored:
        """Measure any mesh by the same error: decimated, folded, with vertices of its own.

        Parameters
        ----------
        points : (V, 3) float array
            Vertices in the frame of the model's file [file units].
        faces : (M, 3) int array
            Triangles. Where several of them cover a point, the smallest of the differences counts.

        Raises
        ------
        ValueError
            If there is no face with an area in the plane, or the arrays do not fit together.
        """
        points = np.asarray(points, float)
        local = self.model.to_local(points) if points.ndim == 2 and points.shape[1:] == (3,) else points
        return self._scored(local, faces)

    def _scored(self, vertices: FloatArray, faces: IntArray, own: IntArray | None = None) -> Scored:
        """Measure a mesh whose vertices (V, 3) are in the frame of the model's points.

        Those of the model's that are ``own`` vertices of the mesh do not deviate where it covers them.
        """
        ground, between, n = self._ground, self.between, self.n_vertices
        both = ground._replace(xy=np.r_[ground.xy, between.xy], z=np.r_[ground.z, between.z])
        deviation, covered = mesh_deviation(both, vertices, faces, planar=own is not None)
        of_mesh = {"surface_error": float((between.share * deviation[n:]).sum())}
        of_mesh |= measured_angles(np.asarray(vertices, float)[:, :2], np.asarray(faces))
        of_mesh |= line_errors(ground, self.model.lines, vertices, faces, planar=own is not None)
        deviation, covered = deviation[:n], covered[:n]
        if own is not None:
            deviation[own[covered[own]]] = 0.0
        weights, total = self.model.weights, self.total_weight
        return Scored(
            mesh_quality(deviation, covered, np.asarray(faces), weights, total, **of_mesh), deviation, covered
        )

    def refit(self, mesh: Simplified, *, tolerance: float = TOLERANCE, until: float | None = None) -> Refitted:
        """Move a mesh's vertices up or down to where the sum of the deviations is least; see :func:`refit_heights`.

        Those on break lines stay.
        """
        if not tolerance > 0:
            raise ValueError(
                f"tolerance={tolerance} is not positive; give a small share of the error such as {TOLERANCE}"
            )
        model = self.model
        rows, compact = used_rows(mesh.faces)
        before = mesh.quality.error
        own = model.file_points[rows]
        if before == 0.0:
            return Refitted(mesh.faces, rows, own, before, before, before)
        samples = mesh_samples(self._ground, model.points[rows], compact)
        weights = np.ones(self.n_vertices) if model.weights is None else model.weights.copy()
        if not weights.all():
            weights[rows] = np.maximum(weights[rows], LEAST_WEIGHT * weights.mean())
        counts = np.flatnonzero((weights > 0) & samples.shares.any(axis=1))
        n = len(counts)
        A = sparse.csr_matrix(
            (samples.shares[counts].ravel(), samples.sites[counts].ravel(), np.arange(0, 3 * n + 1, 3)),
            shape=(n, len(rows)),
        )
        A.sum_duplicates()
        original = model.points[rows, 2]
        on_line = self._ground.lines.at
        heights, bound = least_error(
            A,
            model.points[counts, 2],
            weights[counts],
            samples.gap[counts],
            original,
            tolerance=tolerance,
            until=until,
            held=on_line[rows] >= 0 if len(on_line) else None,
        )
        raised = own + (heights - original)[:, None] * (model.rotation[2] / model.scale)
        error = self.score(raised, compact).quality.error
        if error >= before:
            raised, error = own, before
        return Refitted(mesh.faces, rows, raised, error, before, min(bound, error))

    def _checked(self, kept: Any) -> BoolArray:
        row = np.array(require_bool(kept, "a subset is a bool array, one entry a vertex"), order="C")
        if row.shape != (self.n_vertices,):
            raise ValueError(
                f"a subset of {self.model.name} has shape ({self.n_vertices},), one entry a vertex, not {row.shape}"
            )
        return row

    def __deepcopy__(self, memo: dict[int, Any]) -> HeightSurface:
        return self

    def __getstate__(self) -> dict[str, Any]:
        unstored = ("_ground", "between", "view")
        return {name: value for name, value in self.__dict__.items() if name not in unstored} | {"_free": {}}


def refit_heights(surface: HeightSurface, kept: BoolArray, *, tolerance: float = TOLERANCE) -> Refitted:
    """Move the kept vertices up or down so that the error of their mesh is least; (x, y) and triangles stay.

    What is minimised is the package's error itself: the sum of w_p d_p over all original vertices, the uncovered ones
    included (their distance in space to the nearest point of the outline depends on its height too), whatever other
    measure a search minimised. Pinned vertices stay in place but may change their height, too. The result is no subset
    of the original vertices any more. ``surface.refit(mesh)`` does the same for any mesh of the surface, free ones too.

    Parameters
    ----------
    surface : HeightSurface
        A model of N vertices and its rules; ``problem.surface``.
    kept : (N,) bool array
        The vertices that stay, in vector order.
    tolerance : float
        The search ends where the error is at most this share above the proved bound.

    Returns
    -------
    Refitted

    Raises
    ------
    TypeError
        If this is no surface but a model, which has no rules, or a surface of another kind.
    ValueError
        If the subset spans no triangle, or the tolerance is not positive.

    Examples
    --------
    Two triangles over a roof cannot have a ridge, but they can lie higher; three vertices on the ridge and six at the
    eaves, at a height of 1 and 0, are then all the same as before:

    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.model import build_model
    >>> roof = HeightSurface(build_model(load("roof:3")))
    >>> refit_heights(roof, roof.pinned).error
    3.0
    """
    require_rules(surface, "refit_heights")
    if not isinstance(surface, HeightSurface):
        raise TypeError(
            f"refit_heights: a {type(surface).__name__} has no heights; call refit of the surface with the mesh itself"
        )
    return surface.refit(surface.simplify(kept), tolerance=tolerance)
