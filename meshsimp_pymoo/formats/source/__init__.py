"""What a file becomes: a :class:`SourceMesh`, checked before anything trusts it.

Each way in ends in :func:`build_source`, so a :class:`SourceMesh` always has finite vertices and faces that exist. What
several formats need to get there stands beside it, by topic: ``numbers`` (text), ``rows`` (of a PLY), ``heights``
(grids), ``points`` (clouds), ``scenes`` (through trimesh) and ``precision`` (of what is written).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.memory import check_free

# Areas and in-circle tests multiply up to four coordinates; beyond 1e75 those products overflow.
COORDINATE_LIMIT = 1e75
# What a vertex and a face take while a model is made of a mesh: measured, rounded down.
VERTEX_BYTES, FACE_BYTES = 150, 300


@dataclass(frozen=True, eq=False)
class SourceMesh:
    """A triangle mesh as its file has it: nothing turned, shifted or reordered.

    Parameters
    ----------
    points : (V, 3) float64 array
        Vertices in the file's own frame and units.
    faces : (F, 3) int64 array
        Rows of `points`; three different ones each.
    attributes : dict of arrays, each with V rows
        Per-vertex data under the file's names; ``"color"`` is (V, 4) uint8, red green blue alpha.
    name : str
        What messages call it: the path, or a built-in's name.
    rows : (V,) int64 array, optional
        Row of each vertex in the file (of a grid: ``row * columns + column``); default 0, 1, 2, ...
    up : str or (float, float, float), optional
        What ``up="auto"`` stands for: ``"z"`` for grids, whose heights are known to be heights, and the
        viewing direction for a patch cut out along it. None: to be found out.
    georeference : dict
        Where on Earth it is and how it was read, as far as the file says: ``crs`` (WKT), ``epsg``, ``transform``,
        ``window`` ...; plain data for run.json.
    """

    points: FloatArray
    faces: IntArray
    attributes: dict[str, AnyArray]
    name: str
    rows: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    up: str | tuple[float, float, float] | None = None
    georeference: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.rows) != len(self.points):
            if len(self.rows):
                raise ValueError(f"rows has {len(self.rows)} entries for {len(self.points)} points")
            object.__setattr__(self, "rows", np.arange(len(self.points)))


def build_source(
    points: npt.ArrayLike,
    faces: npt.ArrayLike,
    attributes: Mapping[str, npt.ArrayLike] | None = None,
    name: str = "mesh",
    *,
    rows: IntArray | None = None,
    up: str | tuple[float, float, float] | None = None,
    georeference: dict[str, Any] | None = None,
) -> SourceMesh:
    """Check arrays and make a :class:`SourceMesh` of them, whose fields the parameters are.

    Raises
    ------
    ModelError
        For fewer than 4 vertices, coordinates that are NaN, infinite or beyond 1e75, no faces, faces that
        index past the end, arrays of another shape, and more than fits into the memory.

    Warns
    -----
    ModelWarning
        If faces that name a vertex twice were dropped; they have no area.
    """
    xyz = check_points(points, name, rows)
    count = len(xyz)
    rows = np.arange(count) if rows is None else np.asarray(rows, dtype=np.int64)
    triangles = np.asarray(faces)
    if triangles.size == 0:
        raise ModelError(
            f"{name}: has {count} vertices but no faces; triangulate the points first, or save them as .xyz"
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise ModelError(f"{name}: faces are {triangles.dtype} of the shape {triangles.shape}; give integers (F, 3)")
    check_fits(count, len(triangles), name)
    wrong = ((triangles < 0) | (triangles >= count)).any(axis=1)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise ModelError(
            f"{name}: {wrong.sum()} of {len(triangles)} faces name vertices that do not exist (first: face {first}, "
            f"{tuple(triangles[first].tolist())}, of {count} vertices); the file is damaged, export it again"
        )
    triangles = triangles.astype(np.int64)
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    if flat.all():
        raise ModelError(
            f"{name}: all {len(triangles)} faces name a vertex twice; the file is damaged, export it again"
        )
    if flat.any():
        warn_of(f"{name}: {flat.sum()} of {len(triangles)} faces name a vertex twice and were dropped")
        triangles = triangles[~flat]
    kept_attributes = {}
    for key, values in (attributes or {}).items():
        array = np.array(values)
        if array.ndim == 0 or len(array) != count:
            raise ModelError(f"{name}: the attribute {key!r} has the shape {array.shape}; give {count} rows")
        kept_attributes[key] = array
    return SourceMesh(xyz, triangles, kept_attributes, name, rows, up, dict(georeference or {}))


def check_fits(vertices: int, faces: int, name: str) -> None:
    """Refuse a mesh of which no model can be made in the memory that is free, before it is unfolded in it.

    Raises
    ------
    ModelError
        With the numbers and both sizes.
    """
    check_free(
        VERTEX_BYTES * vertices + FACE_BYTES * faces,
        f"{name}: its {vertices} vertices and {faces} faces, each as often as it is placed,",
        "take a part of it",
    )


def check_points(points: npt.ArrayLike, name: str, rows: IntArray | None = None) -> FloatArray:
    """Return vertices (V, 3) as an array of their own, or raise what :func:`build_source` says of them."""
    xyz = np.array(points, dtype=np.float64)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise ModelError(f"{name}: vertices have the shape {xyz.shape}; give (V, 3)")
    count = len(xyz)
    if count < 4:
        raise ModelError(f"{name}: has {count} vertices; at least 4 are needed")
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        where = ", ".join(f"{value:g}" for value in xyz[first])
        raise ModelError(
            f"{name}: {count - finite.sum()} of {count} vertices have NaN or infinite coordinates (first: "
            f"vertex {first if rows is None else rows[first]} at {where}); delete them in a mesh editor"
        )
    if np.abs(xyz).max() > COORDINATE_LIMIT:
        raise ModelError(
            f"{name}: coordinates reach {np.abs(xyz).max():g}; rescale the model to below {COORDINATE_LIMIT:g}"
        )
    return xyz
