"""The original mesh of a closed surface, flattened and in vector order: what a chromosome is a chromosome of."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.footprint import Footprint, make_footprint, rim_footprint
from meshsimp_pymoo.plane.hilbert import HILBERT_BITS, hilbert_keys
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.closed.embedding import cell_of, embed, faults
from meshsimp_pymoo.surface.edges import Edges, border_loops, components, next_corner
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.model import Mesh, checksum
from meshsimp_pymoo.surface.units import length_unit

# A mesh of fewer vertices is none.
LEAST_VERTICES = 4
# Squared areas multiply four lengths: of sides near 1e-77 they leave the range of doubles, and weights and errors are
# wrong without a word. Sides may be 1e-17 of the box.
LEAST_EXTENT = 1e-60


@dataclass(frozen=True)
class Topology:
    """What a mesh is, whatever its shape. Fans of faces that meet in a vertex alone are not connected there.

    Attributes
    ----------
    components : int
        Parts that no edge connects.
    loops : int
        Closed rows of edges with one face only: the rims of holes.
    rim_edges : int
        Edges with one face only.
    crowded : int
        Edges of more than two faces.
    touching : int
        Vertices in which more than one fan of faces meets.
    mismatched : int
        Edges whose two faces are wound against each other.
    genus : int or None
        Number of handles of all parts, once their holes are closed, if no edge has more than two faces, or two that
        are wound against each other.
    with_handles : int
        Parts that have handles; 0 where the genus is not known.
    fault : int or None
        A vertex of the first edge of more than two faces, or whose faces are wound against each other, or of the first
        part with a handle.
    """

    components: int
    loops: int
    rim_edges: int
    crowded: int
    touching: int
    mismatched: int
    genus: int | None
    with_handles: int = 0
    fault: int | None = None

    @property
    def is_sphere(self) -> bool:
        """Whether it is one surface without holes, of genus 0."""
        return self.refusal is None and self.components == 1 and self.loops == 0

    @property
    def refusal(self) -> str | None:
        """Why it is no closed surface even once its holes are closed, in a few words; None if it is."""
        if self.crowded:
            return f"is not manifold ({count(self.crowded, 'edge')} of more than two faces)"
        if self.mismatched:
            between = count(self.mismatched, "edge")
            return f"is not wound alike, or has one side only ({between} between faces wound against each other)"
        if self.genus:
            of_parts = f" in {self.with_handles:,} of {self.components:,} parts" if self.components > 1 else ""
            return f"has genus {self.genus} ({count(self.genus, 'handle')}{of_parts}, as a ring has one)"
        return None


def topology(faces: IntArray) -> Topology:
    """Return what triangles (F, 3) of vertices are, those that no face uses left out.

    Examples
    --------
    >>> topology(np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])).is_sphere
    True
    """
    return _Fans.of(np.asarray(faces, np.int64)).topology


@brief
@dataclass(frozen=True)
class _Fans:
    """The corners of faces that meet along edges at one vertex: what would be a vertex if nothing met in points alone.

    Attributes
    ----------
    edges : Edges
        Of faces (F, 3).
    part : (F,) int array
        Which part of edges with two faces each face belongs to.
    fan : (3 F,) int array
        Which fan each corner belongs to.
    part_of : (V,) int array
        Which part each fan belongs to.
    """

    edges: Edges
    part: IntArray
    fan: IntArray
    part_of: IntArray

    @classmethod
    def of(cls, faces: IntArray) -> _Fans:
        edges = Edges.of(faces)
        first, second = edges.pairs
        part = components(len(faces), first // 3, second // 3)
        flat = faces.ravel()
        ends = [np.stack([half, next_corner(half)]) for half in (first, second)]
        alike = flat[first] == flat[second]  # wound against each other: start lies on start
        other = np.where(alike, ends[1], ends[1][::-1])
        fan = components(3 * len(faces), ends[0].ravel(), other.ravel())
        part_of = np.empty(int(fan.max()) + 1, np.int64)
        part_of[fan] = np.repeat(part, 3)
        return cls(edges, part, fan, part_of)

    @cached_property
    def topology(self) -> Topology:
        edges, part = self.edges, self.part
        flat = edges.faces.ravel()
        first, second = edges.pairs
        n_parts = int(part.max()) + 1
        against = first[flat[first] == flat[second]]
        border = edges.border
        rim, ends = np.unique(self.fan[np.concatenate([border, next_corner(border)])], return_inverse=True)
        of_loop = np.zeros(0, np.int64)  # its part
        if len(rim):
            loop = components(len(rim), ends[: len(border)], ends[len(border) :])
            of_loop = self.part_of[rim[np.unique(loop, return_index=True)[1]]]
        touching = len(self.part_of) - len(np.unique(flat)) if len(edges.crowded) == 0 else 0
        found = Topology(n_parts, len(of_loop), len(border), len(edges.crowded), touching, len(against), None)
        faults = edges.of_edges(edges.crowded[:1])[0] if len(edges.crowded) else against
        if len(faults):
            return replace(found, fault=int(flat[faults[0]]))
        sides = np.bincount(part[edges.order[edges.starts] // 3], minlength=n_parts)
        counted = np.bincount(self.part_of, minlength=n_parts) - sides + np.bincount(part)
        genus = (2 - counted - np.bincount(of_loop, minlength=n_parts)) // 2
        handles = np.flatnonzero(genus)
        fault = int(edges.faces[np.argmax(part == handles[0]), 0]) if len(handles) else None
        return replace(found, genus=int(genus.sum()), with_handles=len(handles), fault=fault)

    @property
    def is_small(self) -> BoolArray:
        """Which parts have too few vertices for a mesh."""
        return np.bincount(self.part_of) < LEAST_VERTICES


def _fans_apart(faces: IntArray, fan: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Give each fan of faces (F, 3) at a vertex one of its own.

    Which fan keeps the vertex depends on the numbers of the vertices around alone.

    Parameters
    ----------
    faces : (F, 3) int array
        Of n vertices.
    fan : (3 F,) int array
        Which fan each corner belongs to.
    n : int

    Returns
    -------
    faces : (F, 3) int array
        Of n + K vertices.
    copied : (K,) int array
        Which vertex each of those behind the first n is a copy of.
    """
    flat = faces.ravel()
    numbers, of_fan = np.unique(fan, return_inverse=True)
    vertex, least = np.empty(len(numbers), np.int64), np.full(len(numbers), n)
    vertex[of_fan] = flat
    np.minimum.at(least, of_fan, np.minimum(np.roll(faces, 1, axis=1), np.roll(faces, 2, axis=1)).ravel())
    order = np.lexsort((least, vertex))
    again = order[1:][np.diff(vertex[order]) == 0]
    copied = vertex[again]
    vertex[again] = n + np.arange(len(again))
    return vertex[of_fan].reshape(-1, 3), copied


def has_border(faces: IntArray) -> bool:
    """Tell whether some edge of triangles (F, 3) has one face only."""
    return len(Edges.of(np.asarray(faces, np.int64)).border) > 0


def count(n: int, what: str, many: str | None = None) -> str:
    """Return a number of things in words: "1 part", "2 parts"."""
    return f"{n:,} {what if n == 1 else many or what + 's'}"


@dataclass(frozen=True, eq=False)
class ClosedModel(Mesh):
    """A closed mesh in vector order: parts of genus 0 once their holes are closed.

    The vertices are stored along a Hilbert curve over their images in the plane, so that neighbours on the vector are
    neighbours on the surface. Order and images are a function of the positions and faces alone, whatever order the file
    lists them in.

    Attributes
    ----------
    name : str
        Where it came from, for messages.
    points : (N, 3) float array
        Vertices as they are drawn, z to the viewer, from a local origin [model units].
    faces : (T, 3) int32 array
        Triangles of the original mesh, wound alike, as rows of ``points``.
    xy : (N, 2) float array
        Their images in the plane, multiples of 2**-52 in the unit square; see
        :mod:`~meshsimp_pymoo.surface.closed.embedding`.
    poles : (P, 3) int array
        For each of P parts the vertices of the face that is the outside of its images, clockwise there. Every mesh has
        it.
    source_index : (N,) int array
        Row of each vertex in the file.
    file_points : (N, 3) float array
        The vertices exactly as in the file, in vector order [file units].
    attributes : dict of str to (N, ...) array
        Colours and other per-vertex attributes of the file, in vector order.
    rotation : (3, 3) float array
        ``points`` are ``(scale * file_points - pivot) @ rotation.T``; axes are exchanged, nothing is rounded.
    pivot : (3,) float array
        The lowest corner of the box [model units].
    weights : (N,) float array, optional
        How much each vertex counts in the error, in vector order; None: all the same, 1. See :meth:`with_weights`.
    repeats : (R, 2) int array
        Rows of the file that repeat another one, and the rows that they were merged into.
    copies : (C, 2) int array
        Rows behind the last of the file for further fans of faces at a vertex, and the row of that vertex, whose place
        they have. They count in no error.
    found : dict of str to int
        How many vertices were merged or copied, how many small parts were left out, and how many faces were mended, as
        far as there are any; for run.json.
    georeference : dict
        Where on Earth it is and how it was read, as far as the file says.
    scale : (3,) float array
        Model units to a unit of the file along its axes.
    material : Material, optional
        What all faces look like, as far as the file says.
    lines : ModelLines, optional
        Polylines that are chains of edges of every mesh.
    """

    name: str
    points: FloatArray
    faces: npt.NDArray[np.int32]
    xy: FloatArray
    poles: IntArray
    source_index: IntArray
    file_points: FloatArray
    attributes: dict[str, npt.NDArray[Any]]
    rotation: FloatArray
    pivot: FloatArray
    weights: FloatArray | None = None
    repeats: IntArray = field(default_factory=lambda: np.empty((0, 2), np.int64), repr=False)
    copies: IntArray = field(default_factory=lambda: np.empty((0, 2), np.int64), repr=False)
    found: dict[str, int] = field(default_factory=dict, repr=False)
    georeference: dict[str, Any] = field(default_factory=dict, repr=False)
    scale: FloatArray = field(default_factory=lambda: np.ones(3))
    material: Material | None = field(default=None, repr=False)
    lines: ModelLines | None = None

    def __repr__(self) -> str:
        weighted = "" if self.weights is None else ", weighted"
        weighted += "" if self.lines is None else f", {count(len(self.lines.chains), 'break line')}"
        size = " x ".join(f"{side:.4g}" for side in np.ptp(self.points, axis=0))
        return (
            f"<ClosedModel {self.name}: {self.n_vertices:,} vertices, {len(self.faces):,} triangles"
            f"{self.parts_and_holes}{weighted}, {size} {length_unit(self.georeference)}>"
        )

    @property
    def offset(self) -> FloatArray:  # type: ignore[override]
        """What is subtracted after turning: nothing."""
        return np.zeros(3)

    @property
    def weightless(self) -> IntArray:
        """Copies of vertices."""
        return np.flatnonzero(np.isin(self.source_index, self.copies[:, 0]))

    @property
    def area_shares(self) -> FloatArray:
        """A third of the area of the faces around each vertex (N,), those of its copies too; they add up to N."""
        _, place = np.unique(self.file_rows, return_inverse=True)
        shares = np.asarray(np.bincount(place, super().area_shares)[place], float)
        shares[self.weightless] = 0.0
        return shares

    @property
    def n_parts(self) -> int:
        """Number P of parts that no edge connects."""
        return len(self.poles)

    @cached_property
    def part(self) -> IntArray:
        """Which part each vertex belongs to (N,): 0, 1, ... in the order of the poles."""
        found = _parts(self.faces, self.poles, self.n_vertices)
        if self.lines is not None and len(self.lines.added):  # which are in the cell of their part, and in no face
            own = cell_of(self.xy, self.n_parts)
            part_in = np.empty(int(own.max()) + 1, np.int64)
            part_in[own[self.poles[:, 0]]] = np.arange(self.n_parts)
            found[self.lines.added] = part_in[own[self.lines.added]]
        return found

    @cached_property
    def rim(self) -> IntArray:
        """The edges (E, 2) of the rims of holes, the face on their left in the plane, by their lesser vertex."""
        edges = Edges.of(self.faces.astype(np.int64))
        ends = edges.ends(edges.border)
        return ends[np.lexsort((ends.max(axis=1), ends.min(axis=1)))]

    @cached_property
    def border(self) -> IntArray:
        """The vertices at the rims of holes, ascending."""
        return np.unique(self.rim)

    @cached_property
    def n_holes(self) -> int:
        """Number of holes."""
        return border_loops(Edges.of(self.faces.astype(np.int64)))[0]

    @property
    def parts_and_holes(self) -> str:
        """What it is made of if it is not one part without a hole, in words: `` of 2 parts with 1 hole (...)``."""
        parts = f" of {count(self.n_parts, 'part')}" if self.n_parts > 1 else ""
        rims = f" with {count(self.n_holes, 'hole')} ({count(len(self.rim), 'edge')} at rims)" if len(self.rim) else ""
        return parts + rims

    @cached_property
    def footprint(self) -> Footprint:
        """Where in the plane the surface is: within no hole."""
        if len(self.rim) == 0:
            return make_footprint(self.xy, self.faces, np.empty((0, 2)), convex=True)
        return rim_footprint(self.xy, self.rim)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of geometry and weights: the same for the same vertices and faces in the same file order.

        The images are left out: their last bits depend on the versions of libraries.
        """
        order = np.argsort(self.source_index, kind="stable")
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        weights = None if self.weights is None else self.weights[order]
        lines = None if self.lines is None else self.lines.with_rows(place).hash.encode()
        parts = self.points[order], canonical_faces(place[self.faces]), self.source_index[order], weights, lines
        return checksum(*parts)

    def without_lines(self) -> ClosedModel:
        """Return the model as it was before it had break lines: without them and the vertices that they brought."""
        if self.lines is None or len(self.lines.added) == 0:
            return self if self.lines is None else replace(self, lines=None)
        own = np.ones(self.n_vertices, bool)
        own[self.lines.added] = False
        place = np.cumsum(own) - 1
        weights = None if self.weights is None else self.weights[own]
        return replace(
            self,
            points=self.points[own],
            faces=place[self.faces].astype(self.faces.dtype),
            xy=self.xy[own],
            poles=place[self.poles],
            source_index=self.source_index[own],
            file_points=self.file_points[own],
            attributes={name: values[own] for name, values in self.attributes.items()},
            weights=None if weights is None or (weights == 1.0).all() else weights,
            lines=None,
        )

    def with_images(self, xy: FloatArray, source_index: IntArray) -> ClosedModel:
        """Return the model with images (N, 2) that were stored, and in the vector order of the rows stored with them.

        Raises
        ------
        ModelError
            If these are other rows, or no images of this mesh.
        """
        xy = np.ascontiguousarray(xy, float)
        if xy.shape != (self.n_vertices, 2) or not (np.floor(xy * 2.0**52) == xy * 2.0**52).all() or not _fit(xy):
            raise ModelError(f"{self.name}: what was stored are no images of {self.n_vertices:,} vertices in a plane")
        here, there = np.argsort(self.source_index), np.argsort(source_index)
        if not np.array_equal(self.source_index[here], np.asarray(source_index)[there]):
            raise ModelError(f"{self.name}: has other vertices than those whose images were stored")
        order = np.empty_like(here)
        order[there] = here
        moved = self._reordered(order, xy)
        # which face the outside is may hang on last bits too; it is the one of each part that is turned over
        a, b, c = (xy[moved.faces[:, k]] for k in range(3))
        turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        order = np.lexsort((turned, moved.part[moved.faces[:, 0]]))
        first = np.searchsorted(moved.part[moved.faces[order, 0]], np.arange(moved.n_parts))
        moved = replace(moved, poles=moved.faces[order[first]].astype(np.int64))
        _refuse_faults(moved.name, len(moved.faces), *faults(moved.xy, moved.faces, moved.poles))
        return moved

    def _reordered(self, order: IntArray, xy: FloatArray) -> ClosedModel:
        place = np.empty(len(order), np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        return replace(
            self,
            points=self.points[order],
            faces=place[self.faces],
            xy=xy,
            poles=place[self.poles].astype(np.int64),
            source_index=self.source_index[order],
            file_points=self.file_points[order],
            attributes={name: values[order] for name, values in self.attributes.items()},
            weights=None if self.weights is None else self.weights[order],
            lines=None if self.lines is None else self.lines.with_rows(place),
        )


def _parts(faces: IntArray, poles: IntArray, n: int) -> IntArray:
    """Return which part each of n vertices belongs to, 0, 1, ... in the order of the poles; -1 without a face."""
    found = components(n, faces[:, :2].ravel(), faces[:, 1:].ravel())
    number = np.full(int(found.max()) + 1, -1)
    number[found[poles[:, 0]]] = np.arange(len(poles))
    return number[found]


def closed_model(source: SourceMesh) -> ClosedModel:
    """Check that a source mesh is one or more surfaces of genus 0, flatten it and put it in vector order.

    Holes are allowed: the surface is taken as if they were closed, and no mesh has the triangles that close them.

    Raises
    ------
    ModelError
        If it is something else, or too long and thin to be flattened; the message says what.

    Warns
    -----
    ModelWarning
        Of vertices that belong to no face, of parts too small to have a mesh, and of vertices in which several fans of
        faces meet.
    """
    if source.sort != "mesh":
        raise ModelError(
            f"{source.name}: is a {source.sort}, which has one height at each place, and no closed surface; leave "
            "--surface closed (surface='closed') out"
        )
    n_rows = len(source.points)
    used = np.zeros(n_rows, bool)
    used[source.faces] = True
    if not used.all():
        warn_of(f"{source.name}: {n_rows - int(used.sum())} of {n_rows} vertices belong to no face and are left out")
    fans = _Fans.of(source.faces)
    what = fans.topology
    if what.refusal is not None:
        at = ", ".join(f"{value:.6g}" for value in source.points[what.fault])
        raise ModelError(
            f"{source.name}: {what.refusal}, first at ({at}); a closed surface is made of parts like spheres, with "
            "holes or without: split or mend it in a mesh program, or cut out one side as a height surface with "
            "--patch front (patch='front')"
        )
    faces, fan, n_small = _without_small_parts(source, fans)
    rows = np.unique(faces)
    rows = rows[np.lexsort(source.points[rows].T[::-1])]
    place = np.full(n_rows, -1, np.int64)
    place[rows] = np.arange(len(rows))
    faces = place[faces]
    source_index = source.rows[rows]
    copies = np.empty((0, 2), np.int64)
    if what.touching:
        faces, copied = _fans_apart(faces, fan, len(rows))
        last = int(max(source.rows.max(), source.repeats.max(initial=0)))
        copies = np.column_stack([last + 1 + np.arange(len(copied)), source_index[copied]])
        rows, source_index = np.concatenate([rows, rows[copied]]), np.concatenate([source_index, copies[:, 0]])
        warn_of(
            f"{source.name}: several fans of faces meet in {count(len(np.unique(copied)), 'vertex', 'vertices')}; each "
            f"gets one of its own ({count(len(copied), 'copy', 'copies')})"
        )
    faces = canonical_faces(faces)
    measured = source.measured.points
    pivot = measured[rows].min(axis=0)
    local = measured[rows] - pivot
    _refuse_shape(source.name, local)
    part = components(len(rows), faces[:, :2].ravel(), faces[:, 1:].ravel())
    found = embed(local, faces, part)
    _refuse_faults(source.name, len(faces), found.n_flipped, found.n_coinciding)
    rotation = _shown_side(local)
    changed = {"merged": len(source.repeats), "copied": len(copies), "small_parts_left_out": n_small}
    weights = None
    if len(copies):
        weights = np.ones(len(rows))
        weights[-len(copies) :] = 0.0
    model = ClosedModel(
        name=source.name,
        points=local @ rotation.T,
        faces=faces.astype(np.int32),
        xy=found.xy,
        poles=found.poles,
        source_index=source_index,
        file_points=source.points[rows],
        attributes={name: values[rows] for name, values in source.attributes.items()},
        rotation=rotation,
        pivot=pivot,
        weights=weights,
        repeats=source.repeats,
        copies=copies,
        found={name: n for name, n in changed.items() if n},
        georeference=source.georeference,
        scale=source.scale,
        material=source.material,
    )
    order = vector_order(found.xy)
    return model._reordered(order, np.ascontiguousarray(found.xy[order]))


def _without_small_parts(source: SourceMesh, fans: _Fans) -> tuple[IntArray, IntArray, int]:
    """Return the faces (F, 3), and the fan of each of their corners (3 F,), without parts too small, and how many."""
    is_small = fans.is_small
    n_small = int(is_small.sum())
    if n_small == 0:
        return source.faces, fans.fan, 0
    if is_small.all():
        raise ModelError(
            f"{source.name}: all of its {count(n_small, 'part')} have fewer than {LEAST_VERTICES} vertices, and a "
            "closed surface has more; merge vertices at one place in a mesh program"
        )
    large = ~is_small[fans.part]
    warn_of(
        f"{source.name}: left out what is too small to be simplified: {count(n_small, 'part')} of fewer than "
        f"{LEAST_VERTICES} vertices ({count(int((~large).sum()), 'face')})"
    )
    return source.faces[large], fans.fan[np.repeat(large, 3)], n_small


def _refuse_shape(name: str, local: FloatArray) -> None:
    """Refuse vertices (N, 3), from the lowest corner of their box, that are flat or too small for double precision."""
    if not local.any(axis=0).all() or np.linalg.matrix_rank(local - local.mean(axis=0)) < 3:
        raise ModelError(
            f"{name}: all {len(local)} vertices lie in one plane, so that it is no closed surface but a height field; "
            "leave --surface closed (surface='closed') out"
        )
    if local.max() < LEAST_EXTENT:
        raise ModelError(f"{name}: extends over {local.max():g} only; rescale the model to above {LEAST_EXTENT:g}")


def vector_order(xy: FloatArray) -> IntArray:
    """Return the order of images along a Hilbert curve, and within its cells along others: limbs are tiny there."""
    cells = np.floor(xy * 2.0**HILBERT_BITS)
    within = np.ascontiguousarray(xy * 2.0**HILBERT_BITS - cells)
    return np.lexsort((hilbert_keys(within), hilbert_keys(np.ascontiguousarray(xy))))


def _fit(xy: FloatArray) -> bool:
    """Tell whether images lie in the unit square."""
    return bool((xy >= 0.0).all() and (xy <= 1.0).all())


def _refuse_faults(name: str, n_faces: int, flipped: int, coinciding: int) -> None:
    if flipped or coinciding:
        raise ModelError(
            f"{name}: cannot be flattened: {count(coinciding, 'image coincides', 'images coincide')} and "
            f"{count(flipped, 'face is', 'faces are')} flipped of {n_faces:,}, since limbs longer than some 28 of "
            "their radii shrink below what double precision tells apart; cut them off, or cut out one side as a height "
            "surface with --patch front (patch='front')"
        )


def _shown_side(local: FloatArray) -> FloatArray:
    """Return the rotation that has the viewer look along the thinnest side of the box, y upwards, or z if that is y."""
    thinnest = int(np.argmin(np.ptp(local, axis=0)))
    return np.array(
        [
            [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
            [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        ][thinnest]
    )
