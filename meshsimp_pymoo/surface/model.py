"""The original mesh, turned upright and put in vector order: what a chromosome is a chromosome of."""

from __future__ import annotations

import dataclasses
import hashlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, Csr, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, ModelWarning, warn_of
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.source import RasterPart, SourceMesh
from meshsimp_pymoo.plane.faces import border_vertices, one_rings
from meshsimp_pymoo.plane.footprint import Footprint, make_footprint
from meshsimp_pymoo.plane.order import find_corners, unit_square, vector_order
from meshsimp_pymoo.plane.outline import is_convex, on_hull, outline_edges
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.orient import SurfaceFacts, Up, open_faces, seen_upright, upright_rotation
from meshsimp_pymoo.surface.places import below_others, feet, highest, warn_of_places
from meshsimp_pymoo.surface.units import length_unit

# What weights by area are called.
AREA = "area"
# What weights may add up to: their products with squares of deviations are numbers then.
MOST_WEIGHT = 1e100

AnyMesh = TypeVar("AnyMesh", bound="Mesh")


def checksum(*parts: AnyArray | bytes | None) -> str:
    """Return the SHA-256 of arrays and bytes; None is nothing."""
    digest = hashlib.sha256()
    for part in parts:
        if part is not None:
            digest.update(part if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


class Mesh:
    """What the original meshes of all surfaces share: N vertices in vector order, T triangles, and where they are from.

    A class of it is a frozen dataclass with the attributes below; see there for what they are.
    """

    name: str
    points: FloatArray
    faces: npt.NDArray[np.int32]
    source_index: IntArray
    file_points: FloatArray
    attributes: dict[str, npt.NDArray[Any]]
    rotation: FloatArray
    pivot: FloatArray
    offset: FloatArray
    xy: FloatArray
    weights: FloatArray | None
    georeference: dict[str, Any]
    repeats: IntArray
    scale: FloatArray
    # rows (C, 2) that no file has, of vertices at the place of another one, and the rows of those
    copies: IntArray = np.empty((0, 2), np.int64)

    @property
    def n_vertices(self) -> int:
        """Number N of original vertices."""
        return len(self.points)

    @property
    def file_box(self) -> FloatArray:
        """The lowest and the highest corner (2, 3) of the box around the vertices [file units]."""
        return np.array([self.file_points.min(axis=0), self.file_points.max(axis=0)])

    @property
    def total_weight(self) -> float:
        """Sum of the weights; N without any."""
        return float(self.n_vertices if self.weights is None else self.weights.sum())

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box in space [model units]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @cached_property
    def neighbours(self) -> Csr:
        """Mesh one-rings in CSR form: those of vertex i are ``indices[indptr[i]:indptr[i + 1]]``, ascending."""
        return one_rings(self.faces, self.n_vertices)

    @property
    def weightless(self) -> IntArray:
        """Vertices that count in no error, whatever their weight."""
        return np.empty(0, np.int64)

    @property
    def file_rows(self) -> IntArray:
        """Row (N,) in the file of each vertex, or of the one that it is a copy of."""
        rows = self.source_index.copy()
        copied = np.flatnonzero(np.isin(rows, self.copies[:, 0]))
        if len(copied):  # their rows are numbered one by one
            rows[copied] = self.copies[rows[copied] - self.copies[0, 0], 1]
        return rows

    @property
    def area_shares(self) -> FloatArray:
        """A third of the area of the faces around each vertex (N,), scaled so that they add up to N."""
        a, b, c = (self.points[self.faces[:, k]] for k in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        around = np.bincount(self.faces.ravel(), np.repeat(area, 3), minlength=self.n_vertices)
        return np.asarray(around * (self.n_vertices / around.sum()))

    def with_weights(self: AnyMesh, weights: str | npt.ArrayLike) -> AnyMesh:
        """Return the same model with another weight for each vertex: its share in the error.

        Parameters
        ----------
        weights : str or array
            ``"area"`` for a third of the area in space of the faces around each vertex, scaled to add up to N; the name
            of a numeric per-vertex attribute of the file; or one number for each row of the file (a grid's
            rows and columns are accepted too): finite, at least 0, not all of them 0. A weight of 0 means that a vertex
            does not count; it may be kept all the same. Feet of vertical faces never count; of rows that repeat a
            vertex the first one's weight does.

        Raises
        ------
        ModelError
            If there is no such attribute, or the numbers cannot be weights.

        Examples
        --------
        >>> from meshsimp_pymoo.datasets import load
        >>> roof = build_model(load("roof:3"))
        >>> roof.with_weights(np.full(9, 2.0)).total_weight
        18.0
        """
        if isinstance(weights, str) and weights == AREA:
            if AREA in self.attributes:
                raise ModelError(
                    f"{self.name}: weights {AREA!r} may mean the area around each vertex or the file's own attribute "
                    "of that name; give the array of either, or rename the attribute"
                )
            label, values = f"weights {AREA!r}", self.area_shares
        elif isinstance(weights, str):
            if weights not in self.attributes:
                known = ", ".join(sorted(self.attributes)) or "none"
                raise ModelError(f"{self.name}: has no per-vertex attribute {weights!r} to weigh by; it has: {known}")
            label, values = f"weights {weights!r}", np.asarray(self.attributes[weights])
            if values.ndim != 1 or values.dtype.kind not in "biuf":
                raise ModelError(
                    f"{self.name}: {label} are of type {values.dtype} and shape {values.shape}; a weight is one number"
                )
        else:
            label, values = "weights", np.asarray(weights)
            if values.dtype.kind not in "biuf":
                raise ModelError(f"{self.name}: {label} are of type {values.dtype}; give one number for each vertex")
            values = values.ravel()
            of_vertex = self.file_rows
            n_rows = int(max(of_vertex.max(), self.repeats.max(initial=0))) + 1
            if len(values) < n_rows:
                raise ModelError(
                    f"{self.name}: there are {len(values)} {label} for {n_rows} rows of the file; give one for each row"
                )
            n_others = int((values[self.repeats[:, 0]] != values[self.repeats[:, 1]]).sum())
            if n_others:
                warn_of(
                    f"{self.name}: {n_others} {label} of rows that repeat another vertex differ from its own, "
                    "which counts"
                )
            values = values[of_vertex]
        values = np.ascontiguousarray(values, float)
        wrong = np.flatnonzero(~(np.isfinite(values) & (values >= 0)))
        if len(wrong):
            raise ModelError(
                f"{self.name}: {len(wrong)} of {len(values)} {label} are negative or not finite (first: row "
                f"{self.source_index[wrong[0]]}, {values[wrong[0]]}); give finite numbers of at least 0"
            )
        values[self.weightless] = 0.0
        if not values.any():
            raise ModelError(f"{self.name}: all {len(values)} {label} are 0; nothing would count")
        with np.errstate(over="ignore"):
            total = values.sum()
        if not total <= MOST_WEIGHT:
            raise ModelError(
                f"{self.name}: the {len(values)} {label} add up to {total:g}, beyond {MOST_WEIGHT:g}; "
                "divide them all by one number"
            )
        return cast("AnyMesh", dataclasses.replace(cast("Any", self), weights=values))

    def to_local(self, points: npt.ArrayLike) -> FloatArray:
        """Turn points (M, 3) of the file's frame into this model's upright local frame [model units]."""
        return (np.asarray(points, float) * self.scale - self.pivot) @ self.rotation.T - self.offset

    def to_file(self, points: npt.ArrayLike) -> FloatArray:
        """Turn points (M, 3) of this model's frame back into the file's [file units]."""
        return ((np.asarray(points, float) + self.offset) @ self.rotation + self.pivot) / self.scale

    def __len__(self) -> int:
        return self.n_vertices

    def __deepcopy__(self: AnyMesh, memo: dict[int, Any]) -> AnyMesh:
        return self

    def __getstate__(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in dataclasses.fields(cast("Any", self))}


@dataclass(frozen=True, eq=False)
class OpenModel(Mesh):
    """An open mesh that is nearly a height field z = f(x, y), in vector order.

    The vertices are stored along a Hilbert curve over (x, y), so that a neighbour on the vector is a neighbour in
    space, a contiguous segment is a patch, and triangulating needs no sorting. The order is a function of the positions
    alone: listing the same vertices otherwise in the file gives the same model but for ``source_index``.

    Vertices that share one (x, y) stay apart: each has a place in the chromosome and a share in the error, but for the
    feet of vertical faces, which are no samples of what is seen from above. Where several of them are kept, the first
    in vector order (the highest) carries the surface.

    Attributes
    ----------
    name : str
        Where it came from, for messages.
    points : (N, 3) float array
        Vertices, upright (height along z), from a local origin [model units].
    faces : (T, 3) int32 array
        Triangles of the original mesh, counter-clockwise from above, as rows of ``points``.
    corners : (4,) int array
        The vertices extreme in the directions (+-1, +-1) after scaling the bounding box to a square, ascending; fewer
        where one vertex is extreme in several directions.
    source_index : (N,) int array
        Row of each vertex in the file.
    file_points : (N, 3) float array
        The vertices exactly as in the file, in vector order [file units].
    attributes : dict of str to (N, ...) array
        Colours and other per-vertex attributes of the file, in vector order.
    up : (3,) float array
        Unit vector of the file's frame that points to +z here.
    rotation : (3, 3) float array
        Upright coordinates are ``(scale * file_points - pivot) @ rotation.T - offset``.
    pivot, offset : (3,) float arrays
        What is subtracted before and after turning, so that far-off coordinates lose nothing [model units].
    xy : (N, 2) float array
        ``points[:, :2] / unit``, rounded to multiples of 2**-52: the coordinates all predicates work on.
    unit : float
        Side of the unit square, a power of two [model units].
    facts : dict
        What was found while checking the surface (see :class:`~meshsimp_pymoo.surface.orient.SurfaceFacts`).
    weights : (N,) float array, optional
        How much each vertex counts in the error, in vector order; None: all the same, 1. See :meth:`with_weights`.
    feet : (K,) int array
        Vertices below another one at their place that vertical faces alone hold, ascending; their weight is 0.
    repeats : (R, 2) int array
        Rows of the file that repeat another one, and the rows that they were merged into.
    found : dict of str to int
        How many vertices were merged, lie below others, and are feet, and how many faces were mended, as far as there
        are any; for run.json.
    georeference : dict
        Where on Earth it is and how it was read, as far as the file says (see
        :class:`~meshsimp_pymoo.formats.source.SourceMesh`).
    scale : (3,) float array
        Model units to a unit of the file along its axes: 1, but metres to a degree of x and y where the file has
        degrees.
    material : Material, optional
        What all faces look like, as far as the file says.
    lines : ModelLines, optional
        Break lines, whose vertices are among the points; see :func:`~meshsimp_pymoo.surface.lining.lined_model`.
    raster : RasterPart, optional
        Of a height grid: which samples ``source_index`` counts.
    """

    name: str
    points: FloatArray
    faces: npt.NDArray[np.int32]
    corners: IntArray
    source_index: IntArray
    file_points: FloatArray
    attributes: dict[str, npt.NDArray[Any]]
    up: FloatArray
    rotation: FloatArray
    pivot: FloatArray
    offset: FloatArray
    xy: FloatArray
    unit: float
    facts: Any = field(default=None, repr=False)
    weights: FloatArray | None = None
    georeference: dict[str, Any] = field(default_factory=dict, repr=False)
    feet: IntArray = field(default_factory=lambda: np.empty(0, np.int64), repr=False)
    repeats: IntArray = field(default_factory=lambda: np.empty((0, 2), np.int64), repr=False)
    found: dict[str, int] = field(default_factory=dict, repr=False)
    scale: FloatArray = field(default_factory=lambda: np.ones(3))
    material: Material | None = field(default=None, repr=False)
    lines: ModelLines | None = field(default=None, repr=False)
    raster: RasterPart | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        weighted = "" if self.weights is None else ", weighted"
        size = " x ".join(f"{side:.4g}" for side in np.ptp(self.points, axis=0))
        return (
            f"<OpenModel {self.name}: {self.n_vertices:,} vertices, {len(self.faces):,} triangles{weighted}, "
            f"{size} {length_unit(self.georeference)}>"
        )

    @property
    def origin(self) -> FloatArray:
        """The local origin in the upright frame [model units]."""
        return self.pivot @ self.rotation.T + self.offset

    @property
    def weightless(self) -> IntArray:
        """Feet of vertical faces."""
        return self.feet

    @cached_property
    def hash(self) -> str:
        """SHA-256 of geometry, weights and lines: the same for the same vertices and faces in the same file order."""
        lines = () if self.lines is None else (self.lines.hash.encode(),)
        return checksum(self.points, self.faces, self.source_index, self.weights, *lines)

    @cached_property
    def hull(self) -> IntArray:
        """Vertices on the convex hull in the plane, those inside its edges included, ascending."""
        return on_hull(self.xy)

    @cached_property
    def border(self) -> IntArray:
        """Vertices on the outline and around holes as seen from above, ascending; the highest where they share a place.

        Ends of edges of one face, once vertices at one place are taken for the highest.
        """
        faces = highest(self.xy)[self.faces]
        whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        return border_vertices(faces[whole])

    @cached_property
    def footprint(self) -> Footprint:
        """The projection of the original faces, for ``footprint="model"``."""
        outline = outline_edges(self.xy, self.faces)
        return make_footprint(self.xy, self.faces, outline, convex=is_convex(self.xy, outline))

    def without_lines(self) -> OpenModel:
        """Return the model as it was before it had break lines: without them and the vertices that they brought."""
        if self.lines is None:
            return self
        own = np.ones(self.n_vertices, bool)
        own[self.lines.added] = False
        place = np.cumsum(own) - 1
        weights = None if self.weights is None else self.weights[own]
        if weights is not None and (weights == 1.0).all():
            weights = None
        return dataclasses.replace(
            self,
            points=self.points[own],
            faces=place[self.faces].astype(self.faces.dtype),
            # the vertex that a line's covers comes right after it
            corners=place[self.corners] + ~own[self.corners],
            source_index=self.source_index[own],
            file_points=self.file_points[own],
            attributes={name: values[own] for name, values in self.attributes.items()},
            xy=self.xy[own],
            weights=weights,
            feet=place[self.feet],
            lines=None,
        )


def placed_model(
    name: str,
    points: FloatArray,
    faces: IntArray,
    corners: IntArray,
    *,
    xy: FloatArray,
    unit: float,
    source_index: IntArray,
    weights: FloatArray | None = None,
    footprint: Footprint | None = None,
) -> OpenModel:
    """Return a model of arrays that are upright and in vector order already, without a look at them.

    Parameters
    ----------
    name : str
        For messages.
    points : (N, 3) float array
        The vertices [model units].
    faces : (T, 3) int array
        The triangles, counter-clockwise.
    corners : (C,) int array
        Rows of the corners.
    xy : (N, 2) float array
        The vertices in the unit square.
    unit : float
        Side of the unit square [model units].
    source_index : (N,) int array
        Row of each vertex in whatever they come from.
    weights : (N,) float array, optional
        See :class:`OpenModel`.
    footprint : Footprint, optional
        Where its faces are, if ``faces`` do not say so.
    """
    model = OpenModel(
        name=name,
        points=points,
        faces=faces.astype(np.int32),
        corners=np.sort(corners).astype(np.int64),
        source_index=source_index,
        file_points=points,
        attributes={},
        up=np.array([0.0, 0.0, 1.0]),
        rotation=np.eye(3),
        pivot=np.zeros(3),
        offset=np.zeros(3),
        xy=np.ascontiguousarray(xy),
        unit=unit,
        weights=weights,
    )
    if footprint is not None:
        vars(model)["footprint"] = footprint
    return model


def build_model(
    source: SourceMesh, *, up: Up = "auto", seen: tuple[FloatArray, SurfaceFacts] | None = None
) -> OpenModel:
    """Turn a source mesh upright, check that it is an open height field and put it in vector order.

    ``seen`` is what :func:`~meshsimp_pymoo.surface.orient.seen_upright` said of it in the metric frame, if that was
    asked already.
    """
    used = np.zeros(len(source.points), bool)
    used[source.faces] = True
    n_unused = len(used) - int(used.sum())
    if n_unused:
        warnings.warn(
            f"{source.name}: {n_unused} of {len(used)} vertices belong to no face and are left out",
            ModelWarning,
            stacklevel=3,
        )
    file_points, georeference, scale, source = source.points, source.georeference, source.scale, source.measured
    direction, facts = seen_upright(source, up) if seen is None else seen
    rotation = upright_rotation(direction)
    pivot = source.points[used].min(axis=0)
    upright = (source.points - pivot) @ rotation.T
    faces = open_faces(source, facts)
    rows = np.flatnonzero(used)
    upright = upright[rows]
    offset = upright.min(axis=0)
    points = upright - offset
    unit, xy = unit_square(points)
    order = vector_order(xy, -points[:, 2])  # the highest of a place first
    rows = rows[order]
    place = np.full(len(used), -1, np.int32)
    place[rows] = np.arange(len(rows), dtype=np.int32)
    xy = np.ascontiguousarray(xy[order])
    points = np.ascontiguousarray(points[order])
    faces = np.ascontiguousarray(place[faces])
    below = below_others(xy)
    ignored = feet(points, faces, below)
    if below.any():
        warn_of_places(source.name, file_points[rows], xy, unit, int(below.sum()), len(ignored))
    weights = None
    if len(ignored):
        weights = np.ones(len(rows))
        weights[ignored] = 0.0
    found = {"merged": len(source.repeats), "below_others": int(below.sum()), "feet": len(ignored)}
    return OpenModel(
        name=source.name,
        points=points,
        faces=faces.astype(np.int32, copy=False),
        corners=find_corners(xy),
        source_index=source.rows[rows],
        file_points=file_points[rows],
        attributes=_take(source.attributes, rows),
        up=direction,
        rotation=rotation,
        pivot=pivot,
        offset=offset,
        xy=xy,
        unit=unit,
        facts=facts,
        weights=weights,
        georeference=georeference,
        feet=ignored,
        repeats=source.repeats,
        found={what: n for what, n in found.items() if n},
        scale=scale,
        material=source.material,
        raster=source.raster,
    )


def _take(attributes: Mapping[str, npt.NDArray[Any]], rows: IntArray) -> dict[str, npt.NDArray[Any]]:
    return {name: values[rows] for name, values in attributes.items()}
