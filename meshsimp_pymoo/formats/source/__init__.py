"""What a file becomes: a :class:`SourceMesh`, checked before anything trusts it.

Each way in ends in :func:`build_source`, so a :class:`SourceMesh` always has finite vertices and faces that exist. What
several formats need to get there stands beside it, by topic: ``numbers`` (text), ``rows`` (of a PLY), ``heights``
(grids), ``points`` (clouds), ``scenes`` (through trimesh), ``metric`` (degrees), ``texture`` (images and where vertices
lie on them) and ``precision`` (of what is written).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.source.metric import in_metric_frame
from meshsimp_pymoo.formats.source.texture import merged
from meshsimp_pymoo.memory import check_free

# Areas and in-circle tests multiply up to four coordinates; beyond 1e75 those products overflow.
COORDINATE_LIMIT = 1e75
# What a vertex and a face take while a model is made of a mesh: measured, rounded down.
VERTEX_BYTES, FACE_BYTES = 150, 300

# Fewer vertices leave nothing to simplify.
LEAST_VERTICES = 4


class RasterPart(NamedTuple):
    """Which part of a raster was read: its rows and columns, where it begins in the file, and how wide the file is."""

    rows: int
    columns: int
    row: int
    column: int
    file_columns: int


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
        Per-vertex data under the file's names; ``"color"`` is (V, 4) uint8, red green blue alpha, and ``"uv"`` (V, 2)
        where on the image of `material` the vertex lies.
    name : str
        What messages call it: the path, or a built-in's name.
    rows : (V,) int64 array, optional
        Row of each vertex in the file (of a grid: ``row * columns + column``); default 0, 1, 2, ...
    up : str or (float, float, float), optional
        What ``up="auto"`` stands for: ``"z"`` for grids, whose heights are known to be heights, and the
        viewing direction for a patch cut out along it. None: to be found out.
    georeference : dict
        Where on Earth it is and how it was read, as far as the file says: ``crs`` (WKT), ``epsg``, ``unit``,
        ``transform``, ``window`` ..., and ``scale`` (see `metric`); plain data for run.json.
    sort : str
        What it was made of: "mesh", "grid" or "cloud".
    repeats : (R, 2) int64 array, optional
        Rows of the file whose vertex repeats another one exactly, and the rows of those that they were merged into:
        whoever names the former means the latter. Default none.
    material : Material, optional
        What all faces look like.
    grid : (int, int, float, float), optional
        Of a height grid: columns, rows, and how far both are apart; NaN where that is uneven [file units].
    is_closed : bool
        Whether it is known to be a closed surface, as built-in ones are, so that nobody need be told.
    raster : RasterPart, optional
        Of a height grid: which samples `rows` counts.
    """

    points: FloatArray
    faces: IntArray
    attributes: dict[str, AnyArray]
    name: str
    rows: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    up: str | tuple[float, float, float] | None = None
    georeference: dict[str, Any] = field(default_factory=dict)
    sort: str = "mesh"
    repeats: IntArray = field(default_factory=lambda: np.empty((0, 2), np.int64))
    material: Material | None = None
    grid: tuple[int, int, float, float] | None = None
    is_closed: bool = False
    raster: RasterPart | None = None

    def __post_init__(self) -> None:
        if len(self.rows) != len(self.points):
            if len(self.rows):
                raise ValueError(f"rows has {len(self.rows)} entries for {len(self.points)} points")
            object.__setattr__(self, "rows", np.arange(len(self.points)))

    def __repr__(self) -> str:
        return f"<SourceMesh {self.name}: {self.sort} of {len(self.points):,} vertices, {len(self.faces):,} faces>"

    @property
    def scale(self) -> FloatArray:
        """What the coordinates are multiplied by before anything is measured, (3,): 1 unless they are degrees."""
        return np.array([*self.georeference.get("scale", (1.0, 1.0)), 1.0])

    @property
    def measured(self) -> SourceMesh:
        """The same mesh in the metric frame, nowhere on Earth, in which lengths, areas and directions are taken."""
        if "scale" not in self.georeference:
            return self
        return dataclasses.replace(self, points=self.points * self.scale, georeference={})

    def in_frame(self, scale: str | tuple[float, float] | None) -> SourceMesh:
        """Return the mesh with the scale that the user or the reference system says; see :func:`in_metric_frame`."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        facts = in_metric_frame(self.georeference, low, high, scale=scale, name=self.name)
        return self if facts == self.georeference else dataclasses.replace(self, georeference=facts)


def build_source(
    points: npt.ArrayLike,
    faces: npt.ArrayLike,
    attributes: Mapping[str, npt.ArrayLike] | None = None,
    name: str = "mesh",
    *,
    rows: IntArray | None = None,
    up: str | tuple[float, float, float] | None = None,
    georeference: dict[str, Any] | None = None,
    sort: str = "mesh",
    repeats: str = "said",
    material: Material | None = None,
) -> SourceMesh:
    """Check arrays and make a :class:`SourceMesh` of them, whose fields the parameters are.

    Vertices at exactly the same position are one: the first stays, with its attributes. A material whose image no
    texture coordinates place is left out.

    Parameters
    ----------
    repeats : {"said", "usual", "none"}
        Whether a warning says how many vertices repeat another one, or that is usual (a format that lists the corners
        of each face, or two vertices wherever two looks meet), or there are none and they are not looked for.

    Raises
    ------
    ModelError
        For fewer than 4 vertices, coordinates that are NaN, infinite or beyond 1e75, no faces, faces that
        index past the end, arrays of another shape, and more than fits into the memory.

    Warns
    -----
    ModelWarning
        If vertices were merged, and if faces that then name a vertex twice, which have no area, were dropped. If
        vertices with a NaN that no face names were dropped, as scanners write them where they saw nothing.
    """
    points, faces, attributes, rows = _without_unseen(points, faces, attributes or {}, rows, name)
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
    kept_attributes = {}
    for key, values in (attributes or {}).items():
        array = np.array(values)
        if array.ndim == 0 or len(array) != count:
            raise ModelError(f"{name}: the attribute {key!r} has the shape {array.shape}; give {count} rows")
        kept_attributes[key] = array
    found = np.empty((0, 2), np.int64)
    if repeats != "none":
        leader = _leaders(xyz)
        again = np.flatnonzero(leader != np.arange(count))
        if len(again):
            if repeats == "said":
                repeat = f"{len(again)} of {count} vertices repeat the position of another one"
                warn_of(f"{name}: {repeat} and were merged with it")
            own = np.flatnonzero(leader == np.arange(count))
            place = np.empty(count, np.int64)
            place[own] = np.arange(len(own))
            place = place[leader]
            found = np.column_stack([rows[again], rows[leader[again]]])
            triangles = place[triangles]
            xyz, rows = xyz[own], rows[own]
            kept_attributes = merged(kept_attributes, own, place, name)
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    if flat.all():
        raise ModelError(
            f"{name}: all {len(triangles)} faces name a vertex twice; the file is damaged, export it again"
        )
    if flat.any():
        warn_of(f"{name}: {flat.sum()} of {len(triangles)} faces name a vertex twice and were dropped")
        triangles = triangles[~flat]
    if len(xyz) < LEAST_VERTICES:
        raise ModelError(
            f"{name}: has only {len(xyz)} different positions among {count} vertices; at least {LEAST_VERTICES} are "
            "needed"
        )
    if material is not None and material.image and "uv" not in kept_attributes:
        material = None
    facts = dict(georeference or {})
    return SourceMesh(xyz, triangles, kept_attributes, name, rows, up, facts, sort, found, material)


def _without_unseen(
    points: npt.ArrayLike,
    faces: npt.ArrayLike,
    attributes: Mapping[str, npt.ArrayLike],
    rows: IntArray | None,
    name: str,
) -> tuple[npt.ArrayLike, npt.ArrayLike, Mapping[str, npt.ArrayLike], IntArray | None]:
    """Drop vertices with a NaN that no face names, if arrays have the right shapes."""
    xyz, triangles = np.asarray(points, dtype=np.float64), np.asarray(faces)
    missing = np.asarray(np.isnan(xyz).any(axis=-1))
    if xyz.ndim != 2 or not missing.any() or triangles.dtype.kind not in "iu":
        return points, faces, attributes, rows
    if not triangles.size or triangles.min() < 0 or triangles.max() >= len(xyz) or missing[triangles].any():
        return points, faces, attributes, rows
    warn_of(f"{name}: {missing.sum()} of {len(xyz)} vertices have NaN coordinates and no faces, and were dropped")
    seen = ~missing
    number = np.cumsum(seen) - 1
    values = {key: np.asarray(value)[seen] for key, value in attributes.items()}
    return xyz[seen], number[triangles], values, np.flatnonzero(seen) if rows is None else rows[seen]


def _leaders(points: FloatArray) -> IntArray:
    """Return, for each point (V, 3), the first row at exactly its position."""
    tidy = points + 0.0  # -0.0 and 0.0 are one position
    order = np.lexsort(tidy.T)  # stable: within a group the rows ascend
    ordered = tidy[order]
    starts = np.ones(len(points), bool)
    starts[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    leader = np.empty(len(points), np.int64)
    leader[order] = order[starts][np.cumsum(starts) - 1]
    return leader


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
    if count < LEAST_VERTICES:
        raise ModelError(f"{name}: has {count} vertices; at least {LEAST_VERTICES} are needed")
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
