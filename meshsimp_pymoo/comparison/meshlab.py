"""What MeshLab makes of a mesh: quadric edge collapse and vertex clustering, the paper's classic methods.

Both run through pymeshlab (GPL-3), which the extra ``[meshlab]`` installs and which is imported only when it is needed.
It needs two libraries of the system; where something is missing, a `ToolUnavailable` names it and everything else
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
from collections.abc import Callable, Iterator
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.errors import ToolUnavailable, way_to_install

__all__ = ["is_close", "load_pymeshlab", "local_frame", "meshlab_available", "quadric_collapse", "vertex_clustering"]

Mesh = tuple[FloatArray, IntArray]

QUADRIC = "meshing_decimation_quadric_edge_collapse"
CLUSTERING = "meshing_decimation_clustering"

# A count this close to the one asked for is what was asked for (1 off as well: a collapse removes two).
TOLERANCE = 0.02

# Solving for the cell size: bisection steps, then sizes tried around the last one if that is not close
# enough. The count is not monotone in the size, so bisection need not meet the closest one.
BISECTIONS = 24
NEIGHBOURING_SIZES = 64


def meshlab_available() -> bool:
    """Return whether MeshLab's filters can be used on this machine, without printing anything."""
    try:
        load_pymeshlab()
    except ToolUnavailable:
        return False
    return True


def quadric_collapse(
    vertices: ArrayLike,
    faces: ArrayLike,
    triangles: int,
    *,
    preserve_boundary: bool,
    unit_diagonal: bool = False,
    optimal_placement: bool = True,
) -> Mesh:
    """Simplify a mesh by MeshLab's quadric edge collapse.

    All other parameters have the values of MeshLab's dialogue: quality threshold 0.3, no preserved normals or
    topology, clean-up at the end.

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
    optimal_placement : bool
        Whether vertices move to where the quadrics are least, as in the dialogue; otherwise an edge is collapsed onto
        one of its ends, so that the vertices are a subset of the given ones.

    Returns
    -------
    vertices : (V', 3) float array
        In the given frame; all of them used.
    faces : (F', 3) int array
        F' is mostly ``triangles`` or one less.

    Raises
    ------
    ToolUnavailable
        If pymeshlab cannot be used here.
    ValueError
        If the mesh or the number of triangles is unusable.
    """
    points, corners = _checked_mesh(vertices, faces, triangles)
    local, back = local_frame(points, unit_diagonal=unit_diagonal)
    collapsed, remaining = _filtered(
        local,
        corners,
        QUADRIC,
        targetfacenum=int(triangles),
        targetperc=0.0,  # 0: the number counts
        qualitythr=0.3,
        preserveboundary=bool(preserve_boundary),
        boundaryweight=1.0,
        preservenormal=False,
        preservetopology=False,
        optimalplacement=bool(optimal_placement),
        planarquadric=False,
        planarweight=0.001,
        qualityweight=False,
        autoclean=True,
        selected=False,
    )
    if not optimal_placement:  # they are given ones exactly: to the local frame and back is not
        from scipy.spatial import cKDTree

        away, nearest = cKDTree(local).query(collapsed)
        if away.max(initial=0.0) > 1e-12 * _diagonal(local):
            raise RuntimeError("MeshLab's vertices are not among those given")
        return points[nearest], remaining
    return back(collapsed), remaining


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
    ToolUnavailable
        If pymeshlab cannot be used here.
    ValueError
        If the mesh or the number of triangles is unusable.
    """
    points, corners = _checked_mesh(vertices, faces, triangles)
    local, back = local_frame(points, unit_diagonal=False)
    diagonal = _diagonal(points)
    best: tuple[int, float, Mesh] | None = None

    def count(size: float) -> int:
        """Try a cell size and remember the mesh if it is the closest so far (the coarser one of equals)."""
        nonlocal best
        cell = load_pymeshlab().PureValue(size * diagonal)
        mesh = _filtered(local, corners, CLUSTERING, threshold=cell)
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
    if best is None or not is_close(len(best[2][1]), triangles):
        for size in 2.0 ** (high + np.linspace(-0.5, 0.5, NEIGHBOURING_SIZES)):
            if is_close(count(float(size)), triangles):
                break
    if best is None:
        raise ValueError(f"MeshLab's clustering leaves none of {len(corners)} triangles at any cell size")
    merged, remaining = best[2]
    return back(merged), remaining


def local_frame(points: FloatArray, *, unit_diagonal: bool) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
    """Return the points around their middle, and what brings others back to where they came from.

    With ``unit_diagonal`` they are scaled, by a power of two, to a bounding box diagonal of 1 to 2, which the
    thresholds of quadric methods suppose.

    >>> local, back = local_frame(np.array([[10.0, 0, 0], [18, 0, 0]]), unit_diagonal=True)
    >>> local[:, 0], back(local)[:, 0]
    (array([-0.5,  0.5]), array([10., 18.]))
    """
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    scale = 2.0 ** -np.floor(np.log2(_diagonal(points))) if unit_diagonal else 1.0
    return (points - centre) * scale, lambda moved: np.asarray(moved, float) / scale + centre


@cache
def load_pymeshlab() -> ModuleType:
    """Import pymeshlab, quietly, and make sure that the filters are there; a `ToolUnavailable` says what is missing."""
    try:
        with _quiet():
            import pymeshlab

            # without libOpenGL the import succeeds, but the plug-in that holds the filters is left out
            filters = set(pymeshlab.filter_list())
    except ModuleNotFoundError as error:
        way = way_to_install("meshlab")
        raise ToolUnavailable(f"MeshLab's methods need pymeshlab; install it by {way}") from error
    except ImportError as error:
        raise ToolUnavailable(_unavailable(str(error))) from error
    missing = {QUADRIC, CLUSTERING} - filters
    if missing:
        raise ToolUnavailable(_unavailable(f"it lacks {' and '.join(sorted(missing))}"))
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
    pymeshlab = load_pymeshlab()
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


def is_close(obtained: int, asked: int) -> bool:
    """Return whether a number of triangles is what was asked for, to 2 % or one triangle."""
    return abs(obtained - asked) <= max(1.0, TOLERANCE * asked)
