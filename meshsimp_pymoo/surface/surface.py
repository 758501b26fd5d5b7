"""What a chromosome means: the protocol between a surface and all that searches, draws and stores its meshes.

A *surface* is a model with its rules. It knows which mesh a subset of the vertices has and what that mesh's error is;
the problem, the operators, thinning, insertion, annealing, refit, pictures, pages and folders know nothing else. The
height surface (`surface.height`) is one; a surface of another kind is a class with these attributes and methods, and,
if it shall be thinned and annealed too, answers to the questions of `surface.moves`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, BoolArray, Csr, FloatArray, IntArray, spread
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.plane.emission import SLIVER_HEIGHT
from meshsimp_pymoo.plane.faces import canonical_faces, edge_table, is_canonical, used_rows
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.measures import OBJECTIVES, OF_LINES, OF_MESH, Quality
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.workers import on_threads

# A relief flatter than the first share of its extent is drawn higher: terrain is, by kilometres of width to hundreds of
# metres. One deeper than the second is drawn lower: units of plane and height that are not the same make needles.
LEAST_RELIEF, MOST_RELIEF = 0.12, 1.0


@dataclass(frozen=True)
class Simplified:
    """A simplified mesh in vector order, with its quality.

    Attributes
    ----------
    faces : (M, 3) int32 array
        Triangles as rows of ``surface.points``, the smallest row first, sorted.
    quality : Quality
        Its numbers.
    deviation : (N,) float array
        d_p at every original vertex, or at those that were asked for [model units].
    covered : (N,) bool array
        Whether a triangle covers it.
    """

    faces: IntArray
    quality: Quality
    deviation: FloatArray
    covered: BoolArray

    def __repr__(self) -> str:
        return f"<Simplified: {self.quality.in_words}>"


@dataclass(frozen=True, eq=False)
class FreeMesh:
    """A mesh of a surface's own vertices whose edges are chosen for the error, not by the surface's rule.

    It is no function of a subset. A search keeps it beside the individual whose subset it began with, as
    ``individual.get("free")``; the objectives of the individual stay those of its subset.

    Attributes
    ----------
    kept : (N,) bool array
        The vertices that its triangles use, and the pinned ones.
    faces : (M, 3) int32 array
        Triangles as rows of ``surface.points``, the smallest row first, sorted.
    quality : Quality
        Its numbers, as ``surface.of_faces`` measures them.
    """

    kept: BoolArray
    faces: IntArray
    quality: Quality

    def __repr__(self) -> str:
        return f"<FreeMesh: {self.quality.in_words}>"


@dataclass(frozen=True)
class Scored:
    """What is said of a mesh that is no subset: any tool's.

    Attributes
    ----------
    quality : Quality
        Its numbers.
    deviation : (N,) float array
        d_p at every original vertex [model units].
    covered : (N,) bool array
        Whether a triangle covers it.
    """

    quality: Quality
    deviation: FloatArray
    covered: BoolArray

    def __repr__(self) -> str:
        return f"<Scored: {self.quality.in_words}>"


@dataclass(frozen=True)
class Refitted:
    """A simplified mesh whose vertices have moved to where the error of its triangles is least.

    Attributes
    ----------
    faces : (M, 3) int32 array
        Triangles as rows of the surface's points; those of the simplified mesh.
    rows : (V,) int array
        The rows that the triangles use, ascending.
    vertices : (V, 3) float array
        Where they are now, in the frame of the model's file; those that did not move are exactly its own.
    error : float
        Error of the mesh with the vertices there; never above ``before`` [model units].
    before : float
        Error with the original vertices [model units].
    bound : float
        No such mesh has an error below this, up to rounding [model units]; 0 where none is proved.
    """

    faces: IntArray
    rows: IntArray
    vertices: FloatArray
    error: float
    before: float
    bound: float

    def __repr__(self) -> str:
        proved = f", at least {self.bound:.6g}" if self.bound > 0.0 else ""
        return f"<Refitted: {len(self.faces):,} triangles, error {self.error:.6g}, {self.before:.6g} before{proved}>"


@brief
@dataclass(frozen=True)
class View:
    """How pictures and the page look at a surface, whose ``points`` they draw with z to the viewer.

    Attributes
    ----------
    extent : (3,) float array
        Width, depth and height of the box around the points [model units].
    rotation : (3, 3) float array
        Drawn directions are ``rotation @ (scale * direction)`` of the model's file.
    pivot : (3,) float array
        The point that the page turns about, scaled.
    scale : (3,) float array
        Model units to a unit of the file along its axes.
    is_closed : bool
        Whether it is seen from all sides alike: nothing is drawn higher.
    """

    extent: FloatArray
    rotation: FloatArray
    pivot: FloatArray
    scale: FloatArray = field(default_factory=lambda: np.ones(3))
    is_closed: bool = False

    @property
    def exaggeration(self) -> float:
        """Factor by which z is drawn: more for a relief too flat to show, less for one that would be a needle."""
        width, height = float(self.extent[:2].max()), float(self.extent[2])
        if not height > 0 or self.is_closed:
            return 1.0
        return min(max(1.0, LEAST_RELIEF * width / height), MOST_RELIEF * width / height)


class Original(Protocol):
    """The original mesh, as files and records know it; N vertices in vector order.

    Arrays of N or T rows may be `arrays.Rows`, which are made when they are asked for by number.
    """

    @property
    def name(self) -> str:
        """Where it came from."""
        ...

    @property
    def n_vertices(self) -> int:
        """Number N of its vertices."""
        ...

    @property
    def faces(self) -> IntArray:
        """Its triangles (T, 3)."""
        ...

    @property
    def file_points(self) -> FloatArray:
        """Its vertices (N, 3) exactly as in the file [file units]."""
        ...

    @property
    def file_box(self) -> FloatArray:
        """The lowest and the highest corner (2, 3) of the box around them [file units]."""
        ...

    @property
    def source_index(self) -> IntArray:
        """Row of each vertex in the file (N,)."""
        ...

    @property
    def attributes(self) -> dict[str, AnyArray]:
        """Colours and whatever else the file says of the vertices, each with N rows."""
        ...

    @property
    def georeference(self) -> dict[str, Any]:
        """Where on Earth it is, as far as the file says."""
        ...

    @property
    def found(self) -> dict[str, int]:
        """What was changed or left out when it was read, and how often."""
        ...

    @property
    def material(self) -> Material | None:
        """What all faces look like, as far as the file says."""
        ...

    @property
    def hash(self) -> str:
        """A checksum of all that decides results."""
        ...


class Surface(Protocol):
    """A model with its rules: what a chromosome (N,) means."""

    @property
    def model(self) -> Original:
        """The original mesh."""
        ...

    @property
    def rules(self) -> Rules:
        """What counts."""
        ...

    @property
    def n_vertices(self) -> int:
        """Number N of original vertices."""
        ...

    @property
    def points(self) -> FloatArray:
        """The original vertices (N, 3) [model units]."""
        ...

    @property
    def faces(self) -> IntArray:
        """The original triangles (T, 3)."""
        ...

    @property
    def pinned(self) -> BoolArray:
        """Vertices that every mesh keeps (N,)."""
        ...

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box: no mesh is farther away [model units]."""
        ...

    @property
    def total_weight(self) -> float:
        """Sum of the weights; N without any."""
        ...

    @property
    def neighbours(self) -> Csr:
        """Where each vertex may move: (indptr, indices); those of vertex i are ``indices[indptr[i]:indptr[i + 1]]``."""
        ...

    @property
    def border(self) -> IntArray:
        """Vertices that can come where there is room for one triangle only."""
        ...

    @property
    def places(self) -> FloatArray:
        """Where the vertices are, (N, 2) or (N, 3), for cuts through the surface [any unit]."""
        ...

    @property
    def view(self) -> View:
        """How pictures and the page look at it."""
        ...

    def selection(self, most: int) -> BoolArray:
        """Return about ``most`` vertices (N,), spread evenly, whose mesh stands for the original in pictures."""
        ...

    def triangles(self, kept: BoolArray) -> IntArray:
        """Return the triangles (M, 3) of one subset (N,) as rows of ``points``; a ValueError if it has none."""
        ...

    def evaluate(self, kept: BoolArray, *, threads: int = 1, regions: int = 0) -> FloatArray:
        """Return the table (P, 6 + regions) of numbers of subsets (P, N).

        Its columns are those of `meshsimp_pymoo.surface.measures`.
        """
        ...

    def simplify(self, kept: BoolArray, *, rows: IntArray | None = None) -> Simplified:
        """Return the mesh of one subset (N,), its deviation at all vertices or at those of ``rows``, ascending.

        A ValueError if it has no triangle.
        """
        ...

    def of_faces(self, faces: IntArray, *, rows: IntArray | None = None) -> Simplified:
        """Measure a mesh of the surface's own vertices with any edges: triangles (M, 3) as rows of ``points``.

        A ValueError if these are no triangles of the surface.
        """
        ...

    def score(self, points: FloatArray, faces: IntArray) -> Scored:
        """Measure any mesh in the frame of the model's file by the same error."""
        ...

    def refit(self, mesh: Simplified, *, until: float | None = None) -> Refitted:
        """Return a mesh of the surface with its vertices moved to where its error is least, or ended at ``until``."""
        ...

    def ground(self) -> Any | None:
        """Return the record on which `meshsimp_pymoo.surface.moves` is answered.

        None where meshes can be evaluated, but not moved.
        """
        ...

    def free_ground(self, *, centroids: bool) -> Any | None:
        """Return what free meshes have in common (see `meshsimp_pymoo.surface.free`); None where there are none."""
        ...

    def measuring(self, measure: str) -> Surface:
        """Return this surface with another measure of the error for moves, or itself where it is that one."""
        ...

    def bounded(self, most: float, *, own: float = 0.0) -> Surface:
        """Return this surface for moves that bring all deviations down to ``most`` [model units].

        Their cost is the sum of what the deviations exceed it by, of vertices whose weight is not 0, and ``own`` times
        what they cost by this surface's measure. All else is as here.
        """
        ...

    def spanning(self, kept: BoolArray) -> BoolArray:
        """Return a subset (N,) with what each of several parts needs for a mesh; the one given where nothing lacks."""
        ...

    def books(self, kept: BoolArray, *, fixed: BoolArray | None = None) -> AbstractContextManager[Any]:
        """Lend the record of the triangulation of a subset, to be changed by moves until the context ends.

        Of several kept vertices at one place, a fixed one is the site, else the first.
        """
        ...


class ModelSurface:
    """What the surfaces of this package hand on from their model; see `Surface` for what it is."""

    model: Any
    pinned: BoolArray

    @property
    def n_vertices(self) -> int:
        """Number N of original vertices."""
        return int(self.model.n_vertices)

    def spanning(self, kept: BoolArray) -> BoolArray:
        """Return the subset: it has no parts that would need vertices of their own."""
        return kept

    @property
    def points(self) -> FloatArray:
        """The original vertices (N, 3) in the frame of the model, z to the viewer [model units]."""
        return np.asarray(self.model.points)

    @property
    def faces(self) -> IntArray:
        """The original triangles (T, 3), wound alike: counter-clockwise from above, if there is an above."""
        return np.asarray(self.model.faces)

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box in space [model units]."""
        return float(self.model.diagonal)

    @property
    def total_weight(self) -> float:
        """Sum of the weights; N without any."""
        return float(self.model.total_weight)

    @property
    def neighbours(self) -> Csr:
        """One-rings of the original, (indptr, indices): those of vertex i are ``indices[indptr[i]:indptr[i + 1]]``."""
        rings: Csr = self.model.neighbours
        return rings

    def selection(self, most: int) -> BoolArray:
        """Return about ``most`` vertices (N,): they lie along a curve over the surface, so every k-th."""
        selected = self.pinned.copy()
        selected[:: -(-self.n_vertices // most)] = True
        return selected


def checked_faces(faces: Any, n_vertices: int) -> IntArray:
    """Return triangles (M, 3) of N vertices in their one spelling, int32.

    Raises
    ------
    ValueError
        If they are none: of another shape or type, out of range, with a corner twice, or one of them twice.
    """
    found = np.asarray(faces)
    if found.ndim != 2 or found.shape[1] != 3 or not np.issubdtype(found.dtype, np.integer):
        raise ValueError(
            f"faces are {found.dtype} of shape {found.shape}; give whole numbers of shape (M, 3), rows of the vertices"
        )
    if len(found) == 0:
        raise ValueError("a mesh without faces has no error; it needs at least one triangle")
    if found.min() < 0 or found.max() >= n_vertices:
        raise ValueError(f"faces index rows {found.min()} to {found.max()} of {n_vertices} vertices")
    if not is_canonical(found):
        found = canonical_faces(found)
        if not is_canonical(found):
            raise ValueError("faces name a vertex twice in one triangle, or one triangle twice")
    return np.ascontiguousarray(found, np.int32)


def free_faces(faces: Any, kept: BoolArray, *, triangles: int, vertices: int) -> IntArray:
    """Return the triangles (M, 3) of a free mesh as :func:`checked_faces` does, if they fit what is said of it.

    Raises
    ------
    ValueError
        If they are no triangles, not so many, or use not so many vertices or other ones than are kept.
    """
    found = checked_faces(faces, len(kept))
    used, _ = used_rows(found)
    if len(found) != triangles or len(used) != vertices:
        raise ValueError(
            f"its faces are {len(found)} triangles of {len(used)} vertices, and it is said to have {triangles} of "
            f"{vertices}"
        )
    if not kept[used].all():
        raise ValueError(f"its faces use vertex {used[~kept[used]][0]}, which it does not keep")
    return found


def measured_meshes(
    surface: Surface,
    kept: BoolArray,
    quality: Sequence[Quality],
    *,
    faces: Sequence[IntArray | None] = (),
    n_threads: int | None = None,
    until: float | None = None,
) -> list[Quality]:
    """Return these qualities of subsets (S, N), as evaluation knows them, with what only their meshes say.

    ``faces`` are the triangles of those that are free meshes, None of others. Ctrl-C is heard between two meshes. Those
    not begun by ``perf_counter() = until`` stay as they are; the others are spread over all. What is known is not
    measured again. A subset without a triangle is no mesh.
    """
    found = list(quality)
    own = tuple(faces) or (None,) * len(found)
    has_lines = getattr(surface.model, "lines", None) is not None  # which a surface of another kind need not have
    wanted = OF_MESH + OF_LINES * has_lines

    def measure(row: int) -> None:
        is_known = not any(math.isnan(getattr(found[row], name)) for name in wanted)
        if found[row].triangles and not is_known and (until is None or time.perf_counter() < until):
            triangles = own[row]
            whole = (surface.simplify(kept[row]) if triangles is None else surface.of_faces(triangles)).quality
            found[row] = replace(found[row], **{name: getattr(whole, name) for name in wanted})

    on_threads(measure, spread(len(found)), n_threads=n_threads)
    return found


def mesh_arrays(model: Original, faces: IntArray) -> tuple[FloatArray, IntArray, dict[str, AnyArray]]:
    """Return a simplified mesh in the file's own frame.

    Parameters
    ----------
    model : Original
        The original mesh.
    faces : (M, 3) int array
        Triangles as indices of the model's vertices in vector order.

    Returns
    -------
    vertices : (V, 3) float array
        The vertices that the triangles use, with the very coordinates of the file.
    faces : (M, 3) int array
        The triangles as indices of those.
    attributes : dict of str to (V, ...) array
        Colours and whatever else the file says of those vertices.
    """
    used, compact = used_rows(np.asarray(faces))
    attributes = {name: values[used] for name, values in model.attributes.items()}
    return model.file_points[used], compact, attributes


def mesh_lines(surface: Surface, faces: IntArray) -> tuple[tuple[IntArray, ...], tuple[str, ...]]:
    """Return the break lines of a simplified mesh: chains of its edges, and what each is called.

    Parameters
    ----------
    surface : Surface
        The original mesh and its rules.
    faces : (M, 3) int array
        The mesh's triangles as rows of the surface's points.

    Returns
    -------
    chains : tuple of (m,) int array
        The vertices of each line in order, as rows of the surface's points. Along the hull, where slivers are left out,
        they go through what lies on the line but for rounding; where edges are missing all the same, parts are left, or
        none. Empty without break lines.
    names : tuple of str
        What messages call each of them.
    """
    lines = getattr(surface.model, "lines", None)  # which a surface of another kind need not have
    if lines is None:
        return (), ()
    n = surface.n_vertices
    used = np.zeros(n, bool)
    used[np.asarray(faces)] = True
    sides = edge_table(np.asarray(faces)).ends
    known = np.sort(sides[:, 0] * n + sides[:, 1])
    parts, names = [], []
    for line, name in zip(surface.line_chains(used), lines.names, strict=True):  # type: ignore[attr-defined]
        chain = line
        is_there = _are_edges(chain, known, n)
        for k in np.flatnonzero(~is_there)[::-1]:
            chain = np.insert(chain, k + 1, _beside(surface.points[:, :2], used, *line[k : k + 2]))
        is_there = _are_edges(chain, known, n)
        ends = np.flatnonzero(np.diff(is_there, prepend=False, append=False))
        for first, last in zip(ends[::2], ends[1::2], strict=True):
            parts.append(chain[first : last + 1])
            names.append(name)
    return tuple(parts), tuple(names)


def _are_edges(chain: IntArray, known: IntArray, n: int) -> BoolArray:
    """Tell which steps of a chain of m of n vertices are among the edges with these numbers, ascending: (m - 1,)."""
    low, high = np.sort(np.column_stack([chain[:-1], chain[1:]]), axis=1).T
    key = low * n + high
    return known[np.minimum(np.searchsorted(known, key), len(known) - 1)] == key


def _beside(xy: FloatArray, used: BoolArray, a: int, b: int) -> IntArray:
    """Return the vertices used that lie on the segment between two of them (N, 2), but for rounding, in order."""
    rows = np.setdiff1d(np.flatnonzero(used), (a, b))
    u, v = xy[b] - xy[a], xy[rows] - xy[a]
    length = float(np.hypot(*u))
    t, away = v @ u / length**2, np.abs(v[:, 0] * u[1] - v[:, 1] * u[0]) / length
    # a sliver that goes exposes the next one, so several may lie one on the other
    near = (away <= 4.0 * SLIVER_HEIGHT * float(np.hypot(*np.ptp(xy, axis=0)))) & (t > 0.0) & (t < 1.0)
    return rows[near][np.argsort(t[near], kind="stable")]


def require_rules(surface: Any, who: str) -> None:
    """Raise a TypeError if somebody who needs a surface gets a model, which has no rules."""
    if not hasattr(surface, "rules"):
        raise TypeError(
            f"{who}: a {type(surface).__name__} has no rules; give a surface, such as problem.surface or "
            "HeightSurface(model)"
        )


def movable_ground(surface: Surface, who: str) -> Any:
    """Return a surface's ground for somebody who moves vertices.

    Raises
    ------
    TypeError
        If this is no surface but a model, which has no rules.
    ValueError
        If it has no ground.
    """
    require_rules(surface, who)
    ground = surface.ground()
    if ground is None:
        raise ValueError(
            f"{who} move vertices by compiled moves, which a {type(surface).__name__} does not have; use an algorithm "
            "that only evaluates, such as nsga2_v1()"
        )
    return ground


def freedom_of(surface: Surface, who: str, *, centroids: bool) -> Any:
    """Return what the free meshes of a surface have in common, for somebody who makes some.

    Raises
    ------
    TypeError
        If this is no surface but a model, which has no rules.
    ValueError
        If it has none.
    """
    require_rules(surface, who)
    ask = getattr(surface, "free_ground", None)  # a surface of another kind need not know of them
    ground = None if ask is None else ask(centroids=centroids)
    if ground is None:
        raise ValueError(
            f"{who} are made by moves of edges, which a {type(surface).__name__} does not have; its meshes follow from "
            "their vertices alone"
        )
    return ground


def error_of(surface: Surface, cost: Any) -> Any:
    """Return the error for what `surface.moves.error_now` says: the root of the weighted mean where it adds squares."""
    # Sums that live can end a little below 0, where nothing deviates.
    cost = np.maximum(cost, 0.0)
    return np.sqrt(cost / surface.total_weight) if OBJECTIVES[surface.rules.measure].power == 2 else cost


def cost_of(surface: Surface, error: float) -> float:
    """Return what `surface.moves.error_now` says where the error is this."""
    return error * error * surface.total_weight if OBJECTIVES[surface.rules.measure].power == 2 else error
