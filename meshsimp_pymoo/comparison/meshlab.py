"""What MeshLab makes of a mesh: quadric edge collapse and vertex clustering, the classic methods.

Both run through pymeshlab (GPL-3), which the extra ``[meshlab]`` installs and which is imported only when it is needed.
It needs two libraries of the system; where something is missing, `MeshLabUnavailable` names it and everything else
goes on working.

Four properties of MeshLab decide how its filters are called here:

* A parameter that is not passed keeps the value of the *previous* call in the process, not its default. So
  every parameter of every filter is passed, every time.
* The collapse computes with the coordinates as they are: 10 000 km from the origin (UTM northings) another
  mesh comes out. So the vertices are shifted to a local origin, and back.
* The collapse without a preserved border depends on the *unit* of the coordinates: the same bust in
  millimetres and in metres gives errors that differ by a factor of 2 to 4. So there are two methods, one in
  the file's unit, as a user of MeshLab gets it, and one scaled to a diagonal of 1 to 2, which was among the
  best scales on every model tried; the stronger of the two is the one to beat.
* The clustering lists its vertices and triangles in another order in every run. So both are sorted.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.errors import way_to_install
from meshsimp_pymoo.surface.surface import Surface, require_rules

if TYPE_CHECKING:
    from meshsimp_pymoo.surface.measures import Quality

__all__ = [
    "MESHLAB_METHODS",
    "REDUCTIONS",
    "BaselineMesh",
    "MeshLabUnavailable",
    "meshlab_available",
    "meshlab_front",
    "quadric_collapse",
    "reductions",
    "vertex_clustering",
]

Mesh = tuple[FloatArray, IntArray]

QUADRIC = "meshing_decimation_quadric_edge_collapse"
CLUSTERING = "meshing_decimation_clustering"

# The paper's series: the share of the triangles that is removed.
REDUCTIONS = tuple(percent / 100 for percent in range(5, 51, 5))

# A count this close to the one asked for is what was asked for (1 off as well: a collapse removes two).
TOLERANCE = 0.02

# Solving for the cell size: bisection steps, then sizes tried around the last one if that is not close
# enough. The count is not monotone in the size, so bisection need not meet the closest one.
BISECTIONS = 24
NEIGHBOURING_SIZES = 64


class MeshLabUnavailable(ImportError):
    """MeshLab's filters cannot be used on this machine; the message says what to install."""


@dataclass(frozen=True)
class BaselineMesh:
    """A mesh made by a classic method, with its score.

    Attributes
    ----------
    method : str
        A key of `MESHLAB_METHODS`.
    asked : int
        Number of triangles that was asked for.
    vertices : (V, 3) float array
        In the file's frame [model units].
    faces : (T, 3) int array
        Its triangles, T of them: the number really obtained.
    quality : Quality
        The error at all vertices of the model, as for every other mesh.
    seconds : float
        Time the method took, scoring left out.
    """

    method: str
    asked: int
    vertices: FloatArray
    faces: IntArray
    quality: Quality
    seconds: float

    @property
    def triangles(self) -> int:
        """Number of triangles obtained."""
        return len(self.faces)

    @property
    def note(self) -> str:
        """The difference to the number of triangles asked for; empty if within 2 % (or one triangle)."""
        if _close(self.triangles, self.asked):
            return ""
        return f"{self.method} was asked for {self.asked} triangles and gave {self.triangles}"


def meshlab_available() -> bool:
    """Return whether MeshLab's filters can be used on this machine, without printing anything."""
    try:
        _pymeshlab()
    except MeshLabUnavailable:
        return False
    return True


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


def quadric_collapse(
    vertices: ArrayLike,
    faces: ArrayLike,
    triangles: int,
    *,
    preserve_boundary: bool,
    unit_diagonal: bool = False,
) -> Mesh:
    """Simplify a mesh by MeshLab's quadric edge collapse.

    All other parameters have the values of MeshLab's dialogue: quality threshold 0.3, optimal placement of
    vertices, no preserved normals or topology, clean-up at the end. Vertices move, so they are not a subset
    of the given ones.

    Parameters
    ----------
    vertices : (V, 3) array-like
        In any frame [model units].
    faces : (F, 3) array-like
        Rows of ``vertices``.
    triangles : int
        Number of triangles to stop at, 1 to F.
    preserve_boundary : bool
        Whether border edges resist being collapsed. If they do, the result can have many more triangles than
        asked for (they are practically never collapsed); if not, the border shrinks inwards.
    unit_diagonal : bool
        Whether to scale the mesh (by a power of two, exactly) to a bounding box diagonal of 1 to 2 first. It
        matters mostly without ``preserve_boundary``, and there much: see the module's introduction.

    Returns
    -------
    vertices : (V', 3) float array
        In the given frame; all of them used.
    faces : (F', 3) int array
        F' is mostly ``triangles`` or one less.

    Raises
    ------
    MeshLabUnavailable
        If pymeshlab cannot be used here.
    ValueError
        If the mesh or the number of triangles is unusable.
    """
    points, corners = _checked_mesh(vertices, faces, triangles)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    scale = 2.0 ** -np.floor(np.log2(_diagonal(points))) if unit_diagonal else 1.0
    collapsed, remaining = _filtered(
        (points - centre) * scale,
        corners,
        QUADRIC,
        targetfacenum=int(triangles),
        targetperc=0.0,  # 0: the number counts
        qualitythr=0.3,
        preserveboundary=bool(preserve_boundary),
        boundaryweight=1.0,
        preservenormal=False,
        preservetopology=False,
        optimalplacement=True,
        planarquadric=False,
        planarweight=0.001,
        qualityweight=False,
        autoclean=True,
        selected=False,
    )
    return collapsed / scale + centre, remaining


def vertex_clustering(vertices: ArrayLike, faces: ArrayLike, triangles: int) -> Mesh:
    """Simplify a mesh by MeshLab's clustering decimation, with the cell size that gives the wanted count.

    The filter merges all vertices in a cell of a grid into their average and keeps the triangles whose
    corners lie in three cells; the size of the cell is its only parameter. It is found by bisection, and as
    the number of triangles does not fall evenly with it, by trying neighbouring sizes until the count is
    within 2 % of the wanted one; the closest is returned. Some counts cannot be reached: MeshLab fits a whole
    number of cells into the bounding box, so the count jumps (from 223 to 258 on a bust of 1667 triangles).

    The filter connects the merged vertices as the given mesh connects them, but has no option to protect the
    topology. Of triangles that fold back onto each other (same three vertices) one is kept, which changes the
    count in the method's favour, never the error.

    Parameters
    ----------
    vertices : (V, 3) array-like
        In any frame [model units].
    faces : (F, 3) array-like
        Rows of ``vertices``.
    triangles : int
        Number of triangles wanted, 1 to F.

    Returns
    -------
    vertices : (V', 3) float array
        In the given frame; all of them used.
    faces : (F', 3) int array
        F' is as close to ``triangles`` as any cell size tried comes; below some 10 triangles it cannot get.

    Raises
    ------
    MeshLabUnavailable
        If pymeshlab cannot be used here.
    ValueError
        If the mesh or the number of triangles is unusable.
    """
    points, corners = _checked_mesh(vertices, faces, triangles)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    diagonal = _diagonal(points)
    best: tuple[int, float, Mesh] | None = None

    def count(size: float) -> int:
        """Try a cell size and remember the mesh if it is the closest so far (the coarser one of equals)."""
        nonlocal best
        cell = _pymeshlab().PureValue(size * diagonal)
        mesh = _filtered(points - centre, corners, CLUSTERING, threshold=cell)
        obtained = len(mesh[1])
        if obtained and (best is None or (abs(obtained - triangles), -size) < best[:2]):
            best = abs(obtained - triangles), -size, mesh
        return obtained

    low, high = (
        -20.0,
        1.0,
    )  # cell size as a power of two of the diagonal: nothing merged, almost everything merged
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        obtained = count(2.0**middle)
        if obtained == triangles:
            break
        low, high = (middle, high) if obtained > triangles else (low, middle)
    if best is None or not _close(len(best[2][1]), triangles):
        for size in 2.0 ** (high + np.linspace(-0.5, 0.5, NEIGHBOURING_SIZES)):
            if _close(count(float(size)), triangles):
                break
    if best is None:
        raise ValueError(f"MeshLab's clustering leaves none of {len(corners)} triangles at any cell size")
    merged, remaining = best[2]
    return merged + centre, remaining


@dataclass(frozen=True)
class Method:
    """A classic method: ``method(vertices, faces, triangles) -> (vertices, faces)``.

    Attributes
    ----------
    label : str
        What tables call it.
    simplify : callable
        The function that does it.
    """

    label: str
    simplify: Callable[[ArrayLike, ArrayLike, int], Mesh]

    def __call__(self, vertices: ArrayLike, faces: ArrayLike, triangles: int) -> Mesh:
        """Simplify a mesh to about so many triangles."""
        return self.simplify(vertices, faces, triangles)


MESHLAB_METHODS = {
    "quadric_collapse": Method(
        "MeshLab quadric", partial(quadric_collapse, preserve_boundary=False, unit_diagonal=False)
    ),
    "quadric_collapse_unit": Method(
        "MeshLab quadric, unit size", partial(quadric_collapse, preserve_boundary=False, unit_diagonal=True)
    ),
    "quadric_collapse_boundary": Method(
        "MeshLab quadric, border kept", partial(quadric_collapse, preserve_boundary=True, unit_diagonal=True)
    ),
    "vertex_clustering": Method("MeshLab clustering", vertex_clustering),
}
"""The methods by name."""


def meshlab_front(
    surface: Surface, triangles: Iterable[int], *, methods: Sequence[str] = tuple(MESHLAB_METHODS)
) -> list[BaselineMesh]:
    """Simplify a model by every method to every number of triangles, and score the meshes.

    MeshLab gets the model as the file has it, not turned upright, as a user of MeshLab would give it.

    Parameters
    ----------
    surface : Surface
        The model and its rules, by which the meshes are scored.
    triangles : iterable of int
        Numbers of triangles, e.g. from `reductions`; none may exceed the model's own.
    methods : sequence of str
        Keys of `MESHLAB_METHODS`.

    Returns
    -------
    list of BaselineMesh
        Method by method, in the order of ``triangles``; as they come, dominated ones included.

    Raises
    ------
    MeshLabUnavailable
        If pymeshlab cannot be used here.
    ValueError
        If a method is unknown or a number of triangles impossible; nothing is computed then.
    """
    require_rules(surface, "meshlab_front")
    model, scale = surface.model, surface.view.scale
    measured = model.file_points * scale
    numbers = [int(number) for number in triangles]
    for name in methods:
        if name not in MESHLAB_METHODS:
            raise ValueError(f"unknown MeshLab method {name!r}: choose among {', '.join(MESHLAB_METHODS)}")
    for number in numbers:
        _checked_mesh(measured, model.faces, number)
    _pymeshlab()
    meshes = []
    for name in methods:
        for number in numbers:
            start = time.perf_counter()
            vertices, faces = MESHLAB_METHODS[name](measured, model.faces, number)
            vertices = vertices / scale
            seconds = time.perf_counter() - start
            quality = surface.score(vertices, faces).quality
            meshes.append(BaselineMesh(name, number, vertices, faces, quality, seconds))
    return meshes


@cache
def _pymeshlab() -> ModuleType:
    """Import pymeshlab, quietly, and make sure that the filters are there."""
    try:
        with _quiet():
            import pymeshlab

            # without libOpenGL the import succeeds, but the plug-in that holds the filters is left out
            filters = set(pymeshlab.filter_list())
    except ModuleNotFoundError as error:
        way = way_to_install("meshlab")
        raise MeshLabUnavailable(f"MeshLab's methods need pymeshlab; install it by {way}") from error
    except ImportError as error:
        raise MeshLabUnavailable(_unavailable(str(error))) from error
    missing = {QUADRIC, CLUSTERING} - filters
    if missing:
        raise MeshLabUnavailable(_unavailable(f"it lacks {' and '.join(sorted(missing))}"))
    return pymeshlab


def _unavailable(reason: str) -> str:
    """Say what to do where pymeshlab cannot be used."""
    return (
        f"MeshLab's methods cannot be used here: pymeshlab does not load ({' '.join(reason.split())}); it "
        "needs the system's libGL.so.1 and libOpenGL.so.0, on Debian and Ubuntu the packages libgl1 and libopengl0"
    )


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Send whatever is written to the standard streams, by C++ code too, to nowhere for a while."""
    sys.stdout.flush()
    sys.stderr.flush()
    with contextlib.ExitStack() as stack:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        stack.callback(os.close, nowhere)
        for stream in (1, 2):
            with contextlib.suppress(OSError):  # a process may run without standard streams
                saved = os.dup(stream)
                stack.callback(os.close, saved)
                stack.callback(os.dup2, saved, stream)
                os.dup2(nowhere, stream)
        yield


def _filtered(vertices: FloatArray, faces: IntArray, name: str, **parameters: Any) -> Mesh:
    """Apply a MeshLab filter to a mesh; return its result in the order of `_canonical`."""
    pymeshlab = _pymeshlab()
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=vertices, face_matrix=faces))
    meshes.apply_filter(name, **parameters)
    result = meshes.current_mesh()
    points = np.array(result.vertex_matrix(), dtype=np.float64)
    corners = np.array(result.face_matrix(), dtype=np.int64).reshape(-1, 3)
    return _canonical(points, corners)


def _canonical(points: FloatArray, corners: IntArray) -> Mesh:
    """Drop degenerate and duplicate triangles and unused vertices, and put the rest into an order of its own.

    MeshLab's clustering lists vertices and triangles in the order of memory addresses, that is, differently
    in every run. Here vertices are sorted by coordinates, triangles start with their first vertex (which
    keeps their orientation) and are sorted too; of two triangles on the same vertices the first one stays.
    """
    ordered = np.sort(corners, axis=1)
    corners = corners[(ordered[:, 0] < ordered[:, 1]) & (ordered[:, 1] < ordered[:, 2])]
    used, corners = np.unique(corners, return_inverse=True)
    points = points[used]
    by_position = np.lexsort(points.T[::-1])
    rank = np.empty(len(points), dtype=np.int64)
    rank[by_position] = np.arange(len(points))
    corners = rank[corners.reshape(-1, 3)]
    first = corners.argmin(axis=1)[:, None]
    corners = np.take_along_axis(corners, (first + np.arange(3)) % 3, axis=1)
    corners = corners[np.lexsort(corners.T[::-1])]
    _, kept = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    return points[by_position], corners[np.sort(kept)]


def _checked_mesh(vertices: ArrayLike, faces: ArrayLike, triangles: int) -> Mesh:
    """Return the mesh as arrays that MeshLab takes, or say what is wrong with it or with the wanted count."""
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    corners = np.ascontiguousarray(faces, dtype=np.int64)
    if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3:
        raise ValueError(
            f"the mesh has vertices of the shape {points.shape} and faces of the shape {corners.shape}: "
            "both must have three columns"
        )
    if not np.isfinite(points).all():
        raise ValueError(f"{int((~np.isfinite(points)).sum())} coordinates of the mesh are NaN or infinite")
    if len(corners) and not (0 <= corners.min() and corners.max() < len(points)):
        raise ValueError(f"the faces use vertices {corners.min()} to {corners.max()}, of {len(points)}")
    if len(points) and not np.ptp(points, axis=0).any():
        raise ValueError("all vertices of the mesh are the same point")
    if not 1 <= triangles <= len(corners):
        raise ValueError(
            f"{triangles} triangles were asked for, but the mesh has {len(corners)}: ask for at least 1 and "
            "for no more than it has"
        )
    return points, corners


def _diagonal(points: FloatArray) -> float:
    """Return the diagonal of the bounding box."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _close(obtained: int, asked: int) -> bool:
    """Return whether a number of triangles is what was asked for, to 2 % or one triangle."""
    return abs(obtained - asked) <= max(1.0, TOLERANCE * asked)
