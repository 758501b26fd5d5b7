"""Methods without chance that fronts are compared with: the paper's, the tools of today, classic fronts in one pass.

`BASELINES` is the table of them. They are of two kinds:

* A *tool* makes one mesh of about so many triangles; its meshes have triangles, and mostly vertices, of their own.
  It is another package, imported only when it is needed. MeshLab's are asked for a size once, as in the paper; of the
  others the largest mesh of at most so many triangles is searched for by `largest_at_most`, for most of them have but
  a parameter that is near it.
* A *pass* gives nested subsets of every size under the problem's own rules, so it is a whole front: thinning and
  greedy insertion, see `meshsimp_pymoo.search.greedy`.

What is missing on this machine, or takes no such model, is a `ToolUnavailable`: one line that says why.

References
----------
meshoptimizer, fast-simplification and pyfqmr collapse edges by quadrics: M. Garland, P. S. Heckbert, "Surface
simplification using quadric error metrics", SIGGRAPH 1997. pydelatin inserts the worst pixel: M. Garland, P. S.
Heckbert, "Fast polygonal approximation of terrains and height fields", CMU-CS-95-181, 1995.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.comparison.meshlab import (
    is_close,
    load_pymeshlab,
    local_frame,
    quadric_collapse,
    vertex_clustering,
)
from meshsimp_pymoo.errors import ToolUnavailable, raise_if_memory, reason_of, way_to_install
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.greedy import NestedFront, greedy_insertion, thinning
from meshsimp_pymoo.surface.kinds import Model
from meshsimp_pymoo.surface.measures import COUNTED, MEASURES, Quality, quality_of
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.surface import Surface, require_rules

__all__ = [
    "BASELINES",
    "REDUCTIONS",
    "Baseline",
    "BaselineMesh",
    "baseline_front",
    "baseline_meshes",
    "chosen_rows",
    "largest_at_most",
    "reductions",
    "size_note",
]

Mesh = tuple[FloatArray, IntArray]
# From a number of triangles to a mesh of about so many, its vertices in the frame of the model's file.
Simplify = Callable[[int], Mesh]

# The paper's series: the share of the triangles that is removed.
REDUCTIONS = tuple(percent / 100 for percent in range(5, 51, 5))

# A tool's mesh this close below the wanted size is not searched further: triangles, or this share of them.
NEAR, NEAR_SHARE = 2, 0.002
# Meshes that a tool makes at most for one size.
TRIES = 16

# Of a whole front so many meshes are stored at most, and the sizes that were asked for. From each to the next the
# triangles grow by the same share, by which an epsilon can be too large: 2 % where the largest mesh has 20 000 times
# the triangles of the smallest.
MOST_ROWS = 500


@dataclass(frozen=True)
class Baseline:
    """A method without chance.

    Attributes
    ----------
    label : str
        What tables call it.
    group : str
        What chooses it together with its variants in a configuration.
    tool : callable, optional
        From a model to what simplifies it; raises `ToolUnavailable`.
    front : callable, optional
        From a surface to a whole front. Either this or ``tool`` is given.
    package : str
        The package that it needs, as pip calls it; its module is called the same. Empty: none but this one.
    extra : str
        The extra of this package that brings it; empty: none does.
    asked_once : bool
        Whether a tool's first answer is taken, whatever its size.
    own_vertices : bool
        Whether it chooses among the model's vertices, as the searches do, and moves none.
    in_paper : bool
        Whether the paper compares with it.
    at_borders : bool
        Whether it is another method at the border only, so that there is nothing of its own on surfaces without one.
    """

    label: str
    group: str
    tool: Callable[[Model], Simplify] | None = None
    front: Callable[[Surface], NestedFront] | None = None
    package: str = ""
    extra: str = ""
    asked_once: bool = False
    own_vertices: bool = False
    in_paper: bool = False
    at_borders: bool = False


@brief
@dataclass(frozen=True)
class BaselineMesh:
    """A mesh made by a tool, with its score.

    Attributes
    ----------
    method : str
        A key of `BASELINES`.
    asked : int
        Number of triangles that was asked for.
    vertices : (V, 3) float array
        In the file's frame [model units].
    faces : (T, 3) int array
        Its triangles, T of them: the number really obtained; none if there is no mesh.
    quality : Quality
        The error at all vertices of the model, as for every other mesh; infinite if there is no mesh.
    seconds : float
        Time the tool took for it, scoring and what it tried before left out.
    missing : str
        Why there is no mesh; empty if there is one.
    """

    method: str
    asked: int
    vertices: FloatArray
    faces: IntArray
    quality: Quality
    seconds: float
    missing: str = ""

    @property
    def triangles(self) -> int:
        """Number of triangles obtained."""
        return len(self.faces)

    @property
    def note(self) -> str:
        """What there is to say of it: why there is none, or how far off its size is; mostly empty."""
        return f"no mesh: {self.missing}" if self.missing else size_note(self.method, self.asked, self.triangles)


def size_note(method: str, asked: int, obtained: int) -> str:
    """Return the difference to the number of triangles asked for; empty if within 2 % (or one triangle)."""
    return "" if is_close(obtained, asked) else f"{method} was asked for {asked} triangles and gave {obtained}"


def reductions(triangles: int, *, down_to: int | None = None, steps: int = 10) -> tuple[int, ...]:
    """Return the numbers of triangles to simplify a mesh to, largest first.

    Parameters
    ----------
    triangles : int
        Number of triangles of the mesh.
    down_to : int, optional
        Add a second series of ``steps`` numbers from the end of the first one down to this number, each the
        same fraction of the one before: the sizes that evolutionary fronts reach lie mostly below half.
    steps : int
        Length of the second series.

    Returns
    -------
    tuple of int
        95 %, 90 %, ..., 50 % of ``triangles``, then the second series; no number twice.

    Examples
    --------
    >>> reductions(1000)
    (950, 900, 850, 800, 750, 700, 650, 600, 550, 500)
    >>> reductions(1000, down_to=4, steps=3)[10:]
    (100, 20, 4)
    """
    if triangles < 1 or steps < 1 or (down_to is not None and down_to < 1):
        raise ValueError(
            f"triangles={triangles}, down_to={down_to}, steps={steps}: every one of them must be at least 1"
        )
    series = [round(triangles * (1 - share)) for share in REDUCTIONS]
    if down_to is not None and down_to < series[-1]:
        series += np.geomspace(series[-1], down_to, steps + 1)[1:].round().astype(int).tolist()
    return tuple(sorted({max(1, number) for number in series}, reverse=True))


# ------------------------------------------------------------------------------------------------------- tools


def baseline_meshes(surface: Surface, method: str, triangles: Iterable[int]) -> list[BaselineMesh]:
    """Let a tool simplify a model to every number of triangles, and score the meshes.

    The tool gets the model as the file has it, not turned upright, as a user would give it (but degrees in metres).

    Parameters
    ----------
    surface : Surface
        The model and its rules, by which the meshes are scored.
    method : str
        A key of `BASELINES` that is a tool.
    triangles : iterable of int
        Numbers of triangles, e.g. from `reductions`; none may exceed the model's own.

    Returns
    -------
    list of BaselineMesh
        In the order of ``triangles``; as they come, dominated ones included. Where a tool fails there is no mesh.

    Raises
    ------
    ToolUnavailable
        If it cannot be used on this machine, or on such a model.
    ValueError
        If the method is no tool or a number of triangles impossible; nothing is computed then.
    """
    require_rules(surface, "baseline_meshes")
    tools = [name for name, known in BASELINES.items() if known.tool is not None]
    if method not in tools:
        raise ValueError(f"there is no tool {method!r}: choose among {', '.join(tools)}")
    numbers, most = [int(number) for number in triangles], len(surface.model.faces)
    for number in numbers:
        if not 1 <= number <= most:
            raise ValueError(f"{number} triangles were asked for, but the model has {most}: ask for 1 to {most}")
    known = BASELINES[method]
    if known.at_borders and surface.view.is_closed and not len(surface.border):
        raise ToolUnavailable("a surface without holes has no border that could be kept; what keeps none is compared")
    tool: Any = known.tool
    simplify = tool(surface.model)
    none = quality_of((name, 0 if name in COUNTED else np.inf) for name, row in MEASURES.items() if row.of is not None)
    none = replace(none, uncovered=surface.n_vertices)
    meshes = []
    for number in numbers:
        try:
            made = _timed(simplify, number) if known.asked_once else largest_at_most(simplify, number, most)
            (vertices, faces), seconds = made
            quality = surface.score(vertices, faces).quality
        except Exception as problem:  # whatever another package raises; too few triangles to have an area, say
            raise_if_memory(problem)
            nothing = np.empty((0, 3)), np.empty((0, 3), np.int64)
            meshes.append(BaselineMesh(method, number, *nothing, none, 0.0, reason_of(problem)))
            continue
        meshes.append(BaselineMesh(method, number, vertices, faces, quality, seconds))
    return meshes


def largest_at_most(simplify: Simplify, size: int, most: int) -> tuple[Mesh, float]:
    """Return the largest mesh of at most ``size`` triangles that a tool gives for some parameter, and its seconds.

    Parameters
    ----------
    simplify : callable
        From a number of triangles, about so many of which come out, to (vertices, faces).
    size : int
        Triangles that the mesh may have; if all have more, it is the smallest mesh found.
    most : int
        Largest parameter.

    Raises
    ------
    ValueError
        If no parameter tried gives any triangle.

    Examples
    --------
    Of a tool that gives the next multiple of 10:

    >>> def tool(number):
    ...     return np.empty((0, 3)), np.empty((-(-number // 10) * 10, 3), int)
    >>> len(largest_at_most(tool, 57, 100)[0][1]), len(largest_at_most(tool, 7, 100)[0][1])
    (50, 10)
    """
    fitting = smallest = None
    low, high = 0, most + 1  # a parameter that gives too few triangles, and one that gives too many
    target = min(size, most)
    for attempt in range(TRIES):
        mesh, seconds = _timed(simplify, target)
        count = len(mesh[1])
        if 0 < count <= size and (fitting is None or count > len(fitting[0][1])):
            fitting = mesh, seconds
        if count > 0 and (smallest is None or count < len(smallest[0][1])):
            smallest = mesh, seconds
        if count > 0 and 0 <= size - count <= max(NEAR, NEAR_SHARE * size):
            break
        if count > size:
            high = target
        else:
            low = target
        if high - low <= 1:
            break
        middle = (low + high) // 2
        # First what the miss suggests, then whether any mesh is small enough at all, then halves.
        if attempt == 0:
            target = min(max(target + size - count, low + 1), high - 1)
        else:
            target = low + 1 if attempt == 1 and low == 0 else middle
    best = fitting or smallest
    if best is None:
        raise ValueError(f"no triangle is left, whatever number of them up to {most} is asked for")
    return best


def _timed(simplify: Simplify, number: int) -> tuple[Mesh, float]:
    start = time.perf_counter()
    mesh = simplify(number)
    return mesh, time.perf_counter() - start


def _by_meshlab(simplify: Callable[[ArrayLike, ArrayLike, int], Mesh], model: Model) -> Simplify:
    load_pymeshlab()
    points = model.file_points * model.scale

    def make(triangles: int) -> Mesh:
        vertices, faces = simplify(points, model.faces, triangles)
        return vertices / model.scale, faces

    return make


def _by_meshoptimizer(model: Model, *, lock_border: bool) -> Simplify:
    """Collapse edges onto one of their ends. With its border locked the smallest mesh has all of the border."""
    meshoptimizer = _needed("meshoptimizer")
    points, _ = local_frame(model.file_points * model.scale, unit_diagonal=True)
    points = np.ascontiguousarray(points, np.float32)
    corners = np.ascontiguousarray(model.faces, np.uint32).ravel()

    def make(triangles: int) -> Mesh:
        left = np.zeros(len(corners), np.uint32)
        count = meshoptimizer.simplify(
            left,
            corners,
            points,
            target_index_count=3 * triangles,
            target_error=1e10,  # the count decides
            options=meshoptimizer.SIMPLIFY_LOCK_BORDER if lock_border else 0,
        )
        return _of_vertices(model, left[:count].reshape(-1, 3))

    return make


def _by_fast_simplification(model: Model, *, preserve_border: bool) -> Simplify:
    simplify = _needed("fast-simplification").simplify
    points, back = local_frame(model.file_points * model.scale, unit_diagonal=True)
    corners = np.ascontiguousarray(model.faces, np.int32)

    def make(triangles: int) -> Mesh:
        vertices, faces = simplify(points, corners, target_count=triangles, preserve_border=preserve_border)
        return back(vertices) / model.scale, np.asarray(faces, np.int64).reshape(-1, 3)

    return make


def _by_pyfqmr(model: Model, *, preserve_border: bool) -> Simplify:
    simplifier = _needed("pyfqmr").Simplify
    points, back = local_frame(model.file_points * model.scale, unit_diagonal=True)
    corners = np.ascontiguousarray(model.faces, np.int32)

    def make(triangles: int) -> Mesh:
        tool = simplifier()
        tool.setMesh(points, corners)
        tool.simplify_mesh(target_count=triangles, preserve_border=preserve_border, verbose=False)
        vertices, faces, _ = tool.getMesh()
        return back(vertices) / model.scale, np.asarray(faces, np.int64).reshape(-1, 3)

    return make


def _by_pydelatin(model: Model) -> Simplify:
    """Insert the worst pixel of a grid into a Delaunay mesh of pixels; vertices get their true places and heights."""
    delatin = _needed("pydelatin").Delatin
    rows = grid_rows(model) if isinstance(model, OpenModel) else None
    if rows is None:
        raise ToolUnavailable("pydelatin needs heights on a full regular grid, one for every pixel, and this is none")
    heights = model.points[rows, 2]

    def make(triangles: int) -> Mesh:
        mesh = delatin(heights, max_error=0.0, max_triangles=triangles)
        column, up = np.round(mesh.vertices[:, :2]).astype(int).T
        places = rows[len(rows) - 1 - up, column]
        if not np.allclose(model.points[places, 2], mesh.vertices[:, 2], rtol=1e-4, atol=1e-4 * np.ptp(heights)):
            raise RuntimeError("pydelatin's vertices are not where its heights are")
        return _of_vertices(model, places[np.asarray(mesh.triangles, np.int64)])

    return make


def _of_vertices(model: Model, faces: IntArray) -> Mesh:
    """Return triangles of some of the model's vertices as a mesh of these alone."""
    used, corners = used_rows(faces)
    return model.file_points[used], corners


def grid_rows(model: OpenModel) -> IntArray | None:
    """Return the rows of the model's vertices as an array over a regular grid, up and right; None if it is no such."""
    x, column = np.unique(model.points[:, 0], return_inverse=True)
    y, row = np.unique(model.points[:, 1], return_inverse=True)
    regular = all(len(s) > 1 and np.ptp(np.diff(s)) <= 1e-3 * np.diff(s).mean() for s in (x, y))
    if len(x) * len(y) != model.n_vertices or not regular:
        return None
    rows = np.full((len(y), len(x)), -1)
    rows[row, column] = np.arange(model.n_vertices)
    return rows if (rows >= 0).all() else None


def _needed(package: str) -> ModuleType:
    """Import a tool, or say that it is not there."""
    try:
        return importlib.import_module(package.replace("-", "_"))
    except ImportError as problem:
        extra = next(known.extra for known in BASELINES.values() if known.package == package)
        way = way_to_install(extra, package) if extra else f"pip install --pre {package} (which needs a C++ compiler)"
        is_there = not isinstance(problem, ModuleNotFoundError)
        what = f"does not load ({reason_of(problem)})" if is_there else "is not installed"
        raise ToolUnavailable(f"{package} {what}; install it by {way}") from problem


# ------------------------------------------------------------------------------------------------- whole fronts


def baseline_front(surface: Surface, method: str) -> NestedFront:
    """Return the whole front of a pass.

    Parameters
    ----------
    surface : Surface
        The model and its rules.
    method : str
        A key of `BASELINES` that is a pass.

    Raises
    ------
    ToolUnavailable
        If it cannot be had under these rules.
    """
    front: Any = BASELINES[method].front
    try:
        return front(surface)
    except ValueError as reason:  # a surface without moves, say
        raise ToolUnavailable(str(reason)) from reason


def chosen_rows(front: NestedFront, asked: Iterable[int]) -> tuple[IntArray, IntArray]:
    """Return which subsets of a whole front are stored.

    Parameters
    ----------
    front : NestedFront
        Subsets of every size.
    asked : iterable of int
        Numbers of triangles.

    Returns
    -------
    answers : (A,) int array
        For each number the subset of least error of at most so many triangles; the smallest mesh where all have more.
    spread : (S,) int array
        Of the subsets that no other one dominates the two ends, and between them those nearest above `MOST_ROWS`
        numbers of triangles, each the same fraction of the next; all of them if they are so few.
    """
    rows = np.flatnonzero(front.triangles > 0)
    rows = rows[np.lexsort((front.error[rows], front.triangles[rows]))]
    lowest = np.minimum.accumulate(front.error[rows])
    rows = rows[np.concatenate([[True], lowest[1:] < lowest[:-1]])]  # the front, by triangles
    sizes = front.triangles[rows]
    answers = rows[np.maximum(np.searchsorted(sizes, list(asked), side="right") - 1, 0)]
    if len(rows) <= MOST_ROWS:
        return answers, rows
    wanted = np.geomspace(sizes[0], sizes[-1], MOST_ROWS)[1:-1]
    return answers, rows[np.unique([0, *np.searchsorted(sizes, wanted), len(rows) - 1])]


# --------------------------------------------------------------------------------------------------- the table

_MESHLAB: dict[str, Any] = {"group": "meshlab", "package": "pymeshlab", "extra": "meshlab", "asked_once": True}
# There are no wheels of it, and nothing but pre-releases: no extra has it.
_MESHOPTIMIZER: dict[str, Any] = {"group": "meshoptimizer", "package": "meshoptimizer", "own_vertices": True}
_FAST: dict[str, Any] = {
    "group": "fast_simplification",
    "package": "fast-simplification",
    "extra": "baselines",
}
_PYFQMR: dict[str, Any] = {"group": "pyfqmr", "package": "pyfqmr", "extra": "baselines"}

BASELINES = {
    # MeshLab's collapse depends on the unit of the coordinates: see `meshsimp_pymoo.comparison.meshlab`.
    "quadric_collapse": Baseline(
        "MeshLab quadric",
        tool=partial(_by_meshlab, partial(quadric_collapse, preserve_boundary=False, unit_diagonal=False)),
        in_paper=True,
        **_MESHLAB,
    ),
    "quadric_collapse_unit": Baseline(
        "MeshLab quadric, unit size",
        tool=partial(_by_meshlab, partial(quadric_collapse, preserve_boundary=False, unit_diagonal=True)),
        **_MESHLAB,
    ),
    "quadric_collapse_boundary": Baseline(
        "MeshLab quadric, border kept",
        tool=partial(_by_meshlab, partial(quadric_collapse, preserve_boundary=True, unit_diagonal=True)),
        at_borders=True,
        **_MESHLAB,
    ),
    "vertex_clustering": Baseline(
        "MeshLab clustering", tool=partial(_by_meshlab, vertex_clustering), in_paper=True, **_MESHLAB
    ),
    "thinning": Baseline("adaptive thinning", "thinning", front=thinning, own_vertices=True),
    "insertion_by_point": Baseline(
        "greedy insertion, worst point", "insertion", front=greedy_insertion, own_vertices=True
    ),
    "insertion_by_triangle": Baseline(
        "greedy insertion, worst triangle",
        "insertion",
        front=partial(greedy_insertion, choose="triangle"),
        own_vertices=True,
    ),
    "meshoptimizer_free": Baseline(
        "meshoptimizer", tool=partial(_by_meshoptimizer, lock_border=False), **_MESHOPTIMIZER
    ),
    "meshoptimizer_border": Baseline(
        "meshoptimizer, border locked",
        tool=partial(_by_meshoptimizer, lock_border=True),
        at_borders=True,
        **_MESHOPTIMIZER,
    ),
    "fast_simplification_free": Baseline(
        "fast-simplification", tool=partial(_by_fast_simplification, preserve_border=False), **_FAST
    ),
    "fast_simplification_border": Baseline(
        "fast-simplification, border kept",
        tool=partial(_by_fast_simplification, preserve_border=True),
        at_borders=True,
        **_FAST,
    ),
    "pyfqmr_free": Baseline("pyfqmr", tool=partial(_by_pyfqmr, preserve_border=False), **_PYFQMR),
    "pyfqmr_border": Baseline(
        "pyfqmr, border kept", tool=partial(_by_pyfqmr, preserve_border=True), at_borders=True, **_PYFQMR
    ),
    "pydelatin": Baseline(
        "pydelatin", "pydelatin", tool=_by_pydelatin, package="pydelatin", extra="baselines", own_vertices=True
    ),
    # in a group of its own, so that [meshlab] is what it was; among closed surfaces the rival of subsets
    "quadric_collapse_ends": Baseline(
        "MeshLab quadric, onto ends",
        tool=partial(
            _by_meshlab,
            partial(quadric_collapse, preserve_boundary=False, unit_diagonal=True, optimal_placement=False),
        ),
        own_vertices=True,
        **_MESHLAB | {"group": "meshlab_ends"},
    ),
}
"""The methods by what configurations call them."""
