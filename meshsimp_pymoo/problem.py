"""The pymoo problem: which vertices to keep, so that error and size are both small."""

from __future__ import annotations

import difflib
import hashlib
import inspect
import os
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from pymoo.core.problem import ElementwiseProblem, Problem

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options, Window
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.surface.evaluate import (
    FOOTPRINTS,
    MEASURES,
    OUTSIDES,
    REGIONS,
    TRIANGLES,
    Quality,
    Simplified,
    as_quality,
    evaluate_subsets,
    simplify,
)
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.orient import Up

BoolArray = npt.NDArray[np.bool_]
FloatArray = npt.NDArray[np.float64]

# Chromosomes whose numbers are remembered; each takes about 200 bytes.
MEMO_SIZE = 100_000
# Regions in which the error may be kept with each solution and each chromosome remembered.
MOST_REGIONS = 4096
# Numbers of each solution that pymoo keeps beside its objectives.
REPORTED = ("error", "vertices", "mean_error", "rms_error", "max_error", "uncovered")
# A landmark given by position is the nearest vertex, but not one farther away than this share of the diagonal.
LANDMARK_REACH = 0.01


class ThreadRunner:
    """Evaluate a population of a :class:`MeshProblem` on several threads; the kernel runs without Python's lock.

    It holds no threads of its own, so it pickles and deep-copies as a number.

    Parameters
    ----------
    n_threads : int, optional
        Threads to use; all cores by default. The results do not depend on it.
    """

    def __init__(self, n_threads: int | None = None) -> None:
        if n_threads is not None and n_threads < 1:
            raise ValueError(f"n_threads={n_threads} is no number of threads; give 1 or more")
        self.n_threads = n_threads or os.cpu_count() or 1

    def __call__(self, f: Any, X: npt.NDArray[Any]) -> list[dict[str, Any]]:
        """Return what ``f`` gives for every row of X, the rows evaluated together."""
        problem: MeshProblem = f.problem
        table = problem.evaluate_subsets(X, n_threads=self.n_threads)
        return [problem.outcome(row) for row in table]


class MeshProblem(ElementwiseProblem):
    """Choose the vertices of an open mesh to keep: minimise (error, triangles), or other measures of the error.

    A solution is a bool vector over the vertices in vector order (see :class:`OpenModel`); its mesh is the Delaunay
    triangulation of the kept vertices in the plane. Pinned vertices belong to every mesh, whether or not the chromosome
    says so; with ``repair=PinnedCorners()`` it does, which keeps duplicates recognisable.

    Parameters
    ----------
    model : path, built-in name, trimesh.Trimesh, SourceMesh or OpenModel
        The original mesh.
    footprint : {"model", "hull"}
        Emit only the triangles whose centroid lies inside the original mesh's projection, or all of them (the paper).
    outside : {"nearest", "ignore"}
        What a vertex costs that no triangle covers: its distance to the nearest point of the mesh, or nothing (the
        paper).
    up : "auto", an axis such as "z" or "-x", or a vector
        Direction of the height.
    patch : "front", optional
        Cut out the front-facing patch of a mesh that is no height field.
    spacing : (dx, dy), optional
        Sample distances of a height grid [units].
    nodata : float, optional
        Height that means "no sample" in a height grid.
    window : (column, row, columns, rows), optional
        The part of a height grid to take.
    max_edge : float, optional
        Longest edge in the plane of a triangle of a point cloud [units].
    pin : "corners", "hull", file rows, positions, or a list of these
        Vertices that every mesh keeps, besides the four corners: ``"hull"`` for all on the convex hull, whole numbers
        for rows of the file, or an array of positions (K, 2) in the upright plane or (K, 3) in the file's frame.
    objectives : tuple of str
        What is minimised: one or more of "error" (the sum of w_p d_p), "rms_error" and "max_error" (see
        :class:`~meshsimp_pymoo.surface.evaluate.Quality`), then "triangles". All come from the same evaluation.
    weights : str or array, optional
        How much each vertex counts in the error: one number for each row of the file, or the name of one of its
        per-vertex attributes; see :meth:`~meshsimp_pymoo.surface.model.OpenModel.with_weights`. 1 by default.
    max_triangles : int, optional
        Largest number of triangles, as a pymoo constraint.
    max_error : float, optional
        Largest value of the first objective, as a pymoo constraint [model units].
    n_threads : int, optional
        Threads of the default runner; all cores by default.
    memo : int
        Number of chromosomes whose numbers are remembered, so that they are not triangulated again; 0: none.
    regions : int
        In how many regions, runs of the vector of equal length, the error is kept with each solution as well, for
        :class:`~meshsimp_pymoo.search.operators.RegionCrossover`; none by default.
    elementwise_runner : callable, optional
        Any pymoo runner in place of the threads.
    **kwargs
        Passed on to pymoo's ``ElementwiseProblem``.

    Attributes
    ----------
    model : OpenModel
        The original mesh; it holds the weights.
    objectives : tuple of str
        Names of the columns of F.
    regions : int
        In how many regions the error is known; at most N.
    pinned : (N,) bool array
        Vertices that every mesh keeps.
    settings : dict
        The arguments that decide what a chromosome's mesh and numbers are; with the same model they make the problem
        again.

    Notes
    -----
    ``out`` also holds ``error``, ``vertices``, ``mean_error``, ``rms_error``, ``max_error`` and ``uncovered``, whatever
    the objectives, so that ``result.opt.get("max_error")`` works; with ``regions`` also their errors,
    ``region_error``. A subset that emits no triangle is no mesh; it gets the worst objectives, N times the diagonal and
    2 N triangles, which any mesh dominates.

    Examples
    --------
    >>> problem = MeshProblem("roof:3")
    >>> problem.evaluate(problem.pinned)             # the four corners alone: the ridge falls by 1 at three vertices
    array([3., 2.])
    """

    def __init__(
        self,
        model: str | Path | trimesh.Trimesh | SourceMesh | OpenModel,
        *,
        footprint: str = "model",
        outside: str = "nearest",
        up: Up = "auto",
        patch: str | None = None,
        spacing: tuple[float, float] | None = None,
        nodata: float | None = None,
        window: Window | None = None,
        max_edge: float | None = None,
        pin: str | Sequence[Any] | npt.NDArray[Any] | None = None,
        objectives: Sequence[str] = ("error", "triangles"),
        weights: str | npt.ArrayLike | None = None,
        max_triangles: int | None = None,
        max_error: float | None = None,
        n_threads: int | None = None,
        memo: int = MEMO_SIZE,
        regions: int = 0,
        elementwise_runner: Callable[..., Any] | None = None,
        **kwargs: Any,
    ) -> None:
        unknown = sorted(set(kwargs) - set(inspect.signature(Problem).parameters))
        if unknown:
            names = [inspect.signature(kind).parameters for kind in (MeshProblem, Problem)]
            near = difflib.get_close_matches(unknown[0], [*names[0], *names[1]], 1)
            raise TypeError(
                f"MeshProblem has no argument {unknown[0]!r}" + (f"; did you mean {near[0]!r}?" if near else "")
            )
        if footprint not in FOOTPRINTS or outside not in OUTSIDES:
            wrong, known = (footprint, FOOTPRINTS) if footprint not in FOOTPRINTS else (outside, OUTSIDES)
            raise ValueError(f"{wrong!r} is unknown; choose one of {', '.join(map(repr, known))}")
        if max_triangles is not None and max_triangles < 1:
            raise ValueError(f"max_triangles={max_triangles} leaves no mesh; give 1 or more")
        if max_error is not None and not max_error >= 0:
            raise ValueError(f"max_error={max_error} is no error; give 0 or more")
        if not 0 <= regions <= MOST_REGIONS:
            raise ValueError(f"regions={regions} is no number of regions; give 0 to {MOST_REGIONS}")
        self.objectives = _checked_objectives(objectives)
        self.settings: dict[str, Any] = {
            "up": up,
            "patch": patch,
            "spacing": spacing,
            "nodata": nodata,
            "window": window,
            "max_edge": max_edge,
            "footprint": footprint,
            "outside": outside,
            "pin": pin,
            "objectives": self.objectives,
            "weights": weights,
        }
        options = Options(up=up, patch=patch, spacing=spacing, nodata=nodata, window=window, max_edge=max_edge)
        self.model = open_model(model, options)
        if weights is not None:
            self.model = self.model.with_weights(weights)
        self.footprint = footprint
        self.outside = outside
        self.pinned = pinned_vertices(self.model, pin)
        self.max_triangles = max_triangles
        self.max_error = max_error
        self._memo: OrderedDict[bytes, FloatArray] = OrderedDict()
        self._memo_size = memo
        self.regions = min(regions, self.model.n_vertices)
        super().__init__(
            n_var=self.model.n_vertices,
            n_obj=len(self.objectives),
            n_ieq_constr=(max_triangles is not None) + (max_error is not None),
            xl=0,
            xu=1,
            vtype=bool,
            elementwise_runner=elementwise_runner if elementwise_runner is not None else ThreadRunner(n_threads),
            **kwargs,
        )

    def evaluate(self, X: npt.NDArray[Any], *args: Any, **kwargs: Any) -> Any:
        """Evaluate one chromosome (N,) or many (P, N) as any pymoo problem does; float genomes are refused."""
        _require_bool(X)
        return super().evaluate(X, *args, **kwargs)

    def _evaluate(self, x: BoolArray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out.update(self.outcome(self.evaluate_subsets(x[None, :], n_threads=1)[0]))

    def evaluate_subsets(self, X: npt.NDArray[Any], *, n_threads: int = 1) -> FloatArray:
        """Evaluate chromosomes (P, N) together, each different one once; return the table (P, 6 + regions).

        See :func:`meshsimp_pymoo.surface.evaluate.evaluate_subsets` for its columns. Pinned vertices are added first.
        """
        _require_bool(X)
        X = np.asarray(X) | self.pinned
        if not self._memo_size:
            return self._kernel(X, n_threads)
        packed = np.packbits(X, axis=1)
        keys = [hashlib.blake2b(row, digest_size=16).digest() for row in packed]
        memo = self._memo
        found: dict[bytes, FloatArray] = {}
        missing: dict[bytes, int] = {}
        for i, key in enumerate(keys):
            row = memo.get(key)
            if row is None:
                missing.setdefault(key, i)
            else:
                found[key] = row
                memo.move_to_end(key)
        if missing:
            rows = list(missing.values())
            fresh = self._kernel(X if len(rows) == len(X) else X[rows], n_threads)
            for key, row in zip(missing, fresh, strict=True):
                found[key] = memo[key] = row
            while len(memo) > self._memo_size:
                memo.popitem(last=False)
        return np.array([found[key] for key in keys])

    def _kernel(self, X: BoolArray, n_threads: int) -> FloatArray:
        return evaluate_subsets(
            self.model,
            X,
            footprint=self.footprint,
            outside=self.outside,
            n_threads=n_threads,
            regions=self.regions,
        )

    def outcome(self, row: FloatArray) -> dict[str, Any]:
        """Turn one row of :meth:`evaluate_subsets` into pymoo's ``out``."""
        if row[TRIANGLES] == 0:
            n = self.model.n_vertices
            worst = self.model.diagonal
            quality = Quality(self.model.total_weight * worst, 2 * n, 0, worst, worst, worst, n)
        else:
            quality = self.as_quality(row)
        out: dict[str, Any] = {name: getattr(quality, name) for name in REPORTED}
        F = [float(getattr(quality, name)) for name in self.objectives]
        out["F"] = F
        if self.n_ieq_constr:
            out["G"] = []
            if self.max_triangles is not None:
                out["G"].append(F[-1] - self.max_triangles)
            if self.max_error is not None:
                out["G"].append(F[0] - self.max_error)
        if self.regions:
            # No mesh: its error, that of the worst one, is spread evenly.
            known = np.isfinite(row[REGIONS:])
            out["region_error"] = np.where(known, row[REGIONS:], quality.error / self.regions)
        return out

    def as_quality(self, row: FloatArray) -> Quality:
        """Name the columns of one row of :meth:`evaluate_subsets`."""
        return as_quality(row, self.model.total_weight)

    @property
    def worst(self) -> tuple[float, ...]:
        """Objectives that every mesh dominates, given to subsets that emit no triangle.

        By default (N times the diagonal, 2 N); the mean and the maximum of the error are at worst the diagonal.
        """
        nothing = np.zeros(6)
        return tuple(self.outcome(nothing)["F"])

    def simplify(self, kept: npt.NDArray[Any]) -> Simplified:
        """Return the triangles, the quality and the deviation at every vertex of one chromosome (N,)."""
        _require_bool(kept)
        if np.shape(kept) != (self.n_var,):
            raise ValueError(f"a subset has shape ({self.n_var},), one entry a vertex, not {np.shape(kept)}")
        return simplify(self.model, np.asarray(kept) | self.pinned, footprint=self.footprint, outside=self.outside)

    def quality(self, kept: npt.NDArray[Any]) -> Quality:
        """Return all quality numbers of one chromosome (N,)."""
        return self.simplify(kept).quality

    def mesh(self, kept: npt.NDArray[Any]) -> trimesh.Trimesh:
        """Return the simplified mesh of one chromosome (N,) in the frame of the file, with its colours and attributes.

        Its vertices are original ones, in double precision, in vector order; none is without a face.
        """
        faces = self.simplify(kept).faces
        used, inverse = np.unique(faces, return_inverse=True)
        mesh = trimesh.Trimesh(
            vertices=self.model.file_points[used], faces=inverse.reshape(-1, 3), process=False, validate=False
        )
        for name, values in self.model.attributes.items():
            if name == "color":
                mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=values[used])
            else:
                mesh.vertex_attributes[name] = values[used]
        return mesh

    def name(self) -> str:
        """Return the model's name."""
        return f"MeshProblem({self.model.name})"

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_memo": OrderedDict()}

    def __deepcopy__(self, memo: dict[int, Any]) -> MeshProblem:
        # Nothing of it changes during a run but what it remembers, so copies may share it (save_history makes many).
        return self


def _checked_objectives(objectives: Sequence[str]) -> tuple[str, ...]:
    """Return the objectives as a tuple, or raise a ValueError that says what they must be."""
    names = (objectives,) if isinstance(objectives, str) else tuple(objectives)
    measures = names[:-1]
    if names[-1:] != ("triangles",) or not measures or set(measures) - set(MEASURES) or len(set(names)) < len(names):
        raise ValueError(
            f"objectives={names!r} cannot be minimised; name one or more of {', '.join(map(repr, MEASURES))}, each "
            "once, and 'triangles' last, as in ('error', 'triangles')"
        )
    return names


def pinned_vertices(model: OpenModel, pin: str | Sequence[Any] | npt.NDArray[Any] | None = None) -> BoolArray:
    """Return which vertices every mesh keeps: the corners, and what ``pin`` names (see :class:`MeshProblem`).

    Raises
    ------
    ModelError
        If a file row does not exist or is not part of the model, or a position has no vertex near.
    """
    pinned = np.zeros(model.n_vertices, bool)
    pinned[model.corners] = True
    for part in _pin_parts(pin):
        if isinstance(part, str):
            if part not in ("corners", "hull"):
                raise ModelError(f"pin={part!r} is unknown; use 'corners', 'hull', file rows or positions")
            if part == "hull":
                pinned[model.hull] = True
        elif part.ndim == 1:
            pinned[_rows_of_file(model, part)] = True
        else:
            pinned[_vertices_near(model, part)] = True
    return pinned


def _pin_parts(pin: Any) -> list[Any]:
    """Sort what the user gave into names, an array of file rows and an array of positions."""
    if pin is None:
        return []
    if isinstance(pin, str):
        return [pin]
    if isinstance(pin, np.ndarray):
        pin = [pin] if pin.ndim == 2 else list(pin)
    elif not isinstance(pin, Iterable):
        pin = [pin]
    parts: list[Any] = []
    rows = []
    for item in pin:
        if isinstance(item, str):
            parts.append(item)
        elif np.ndim(item) == 0:
            rows.append(item)
        else:
            positions = np.atleast_2d(np.asarray(item))
            if positions.ndim != 2 or positions.shape[1] not in (2, 3):
                raise ModelError(
                    f"pin holds an array of shape {np.shape(item)}; positions have shape (K, 2) or (K, 3), "
                    "file rows are single whole numbers"
                )
            parts.append(positions.astype(float))
    if rows:
        parts.append(np.asarray(rows))
    return parts


def _rows_of_file(model: OpenModel, rows: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    if not np.issubdtype(rows.dtype, np.integer):
        raise ModelError(
            f"pin holds {rows[0]!r}, which is no row of the file; give whole numbers, or positions as [x, y, z]"
        )
    order = np.argsort(model.source_index, kind="stable")
    place = np.searchsorted(model.source_index[order], rows)
    found = place < model.n_vertices
    found[found] = model.source_index[order[place[found]]] == rows[found]
    if not found.all():
        raise ModelError(
            f"pin: row {int(rows[~found][0])} of {model.name} is not among the model's {model.n_vertices} vertices; "
            "rows count from 0, and vertices that no face uses are left out"
        )
    return order[place]


def _vertices_near(model: OpenModel, positions: FloatArray) -> npt.NDArray[np.int64]:
    from scipy.spatial import cKDTree

    if positions.shape[1] == 3:
        wanted, vertices = positions, model.file_points
    else:
        wanted, vertices = positions - model.origin[:2], model.points[:, :2]
    distance, nearest = cKDTree(vertices).query(wanted)
    far = np.flatnonzero(distance > LANDMARK_REACH * model.diagonal)
    if len(far):
        k = far[0]
        raise ModelError(
            f"pin: the vertex of {model.name} nearest to {positions[k].tolist()} is {distance[k]:.6g} away, more than "
            f"{LANDMARK_REACH:.0%} of the diagonal {model.diagonal:.6g}; give positions on the mesh"
        )
    return np.asarray(nearest, np.int64)


def _require_bool(X: Any) -> None:
    kind = np.asarray(X).dtype
    if kind != np.bool_:
        raise TypeError(
            f"chromosomes are bool vectors, one entry a vertex, but these are {kind}; pass sampling=RandomSubset(), "
            "crossover=SubsetUniformCrossover() or OAX(), mutation=NeighbourShift() and repair=PinnedCorners() "
            "to the algorithm, since pymoo's defaults make real numbers"
        )
