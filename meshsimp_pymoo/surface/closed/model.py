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
from meshsimp_pymoo.surface.closed.embedding import embed, faults
from meshsimp_pymoo.surface.edges import Edges, border_loops, components, next_corner
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.model import Mesh, checksum
from meshsimp_pymoo.surface.units import length_unit

# A mesh of fewer vertices is none.
LEAST_VERTICES = 4
LEAST_TRIANGLES = 2 * LEAST_VERTICES - 4
# Squared areas multiply four lengths: of sides near 1e-77 they leave the range of doubles, and weights and errors are
# wrong without a word. Sides may be 1e-17 of the box.
LEAST_EXTENT = 1e-60


@dataclass(frozen=True)
class Topology:
    """What a mesh is, whatever its shape.

    Attributes
    ----------
    components : int
        Parts that no edge connects.
    loops : int
        Closed rows of edges with one face only: the rims of holes.
    crowded : int
        Edges of more than two faces.
    touching : int
        Vertices in which more than one fan of faces meets.
    mismatched : int
        Edges whose two faces are wound against each other.
    genus : int or None
        Number of handles of all parts, once their holes are closed, if no edge has more than two faces, or two that
        are wound against each other; fans count as vertices of their own.
    """

    components: int
    loops: int
    crowded: int
    touching: int
    mismatched: int
    genus: int | None

    @property
    def is_sphere(self) -> bool:
        """Whether it is one surface without holes, of genus 0."""
        return self.refusal is None and self.components == 1 and self.loops == 0

    @property
    def refusal(self) -> str | None:
        """Why it is no closed surface even once its holes are closed, in a few words; None if it is."""
        if self.crowded:
            return f"is not manifold ({count(self.crowded, 'edge')} of more than two faces)"
        if self.touching:
            return f"is not manifold ({count(self.touching, 'vertex', 'vertices')} in which several fans of faces meet)"
        if self.mismatched:
            between = count(self.mismatched, "edge")
            return f"is not wound alike, or has one side only ({between} between faces wound against each other)"
        if self.genus:
            return f"has genus {self.genus} ({count(self.genus, 'handle')}, as a ring has one)"
        return None


def topology(faces: IntArray) -> Topology:
    """Return what triangles (F, 3) of vertices are, those that no face uses left out.

    Examples
    --------
    >>> topology(np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])).is_sphere
    True
    """
    faces = np.asarray(faces, np.int64)
    edges = Edges.of(faces)
    first, second = edges.pairs
    part = components(len(faces), first // 3, second // 3)
    flat = faces.ravel()
    mismatched = int((flat[first] == flat[second]).sum())
    # corners of faces that meet along an edge at a vertex are one fan
    fans = _fans(faces, first, second)
    used = len(np.unique(flat))
    n_parts = int(part.max()) + 1
    n_crowded = len(edges.crowded)
    touching = int(fans - used) if n_crowded == 0 else 0
    n_loops = border_loops(edges)[0]
    genus = None
    if not n_crowded and not mismatched:
        genus = (2 * n_parts - (fans - len(edges.counts) + len(faces) + n_loops)) // 2
    return Topology(n_parts, n_loops, n_crowded, touching, mismatched, genus)


def _fans(faces: IntArray, first: IntArray, second: IntArray) -> int:
    """Return the number of fans of faces around vertices: corners joined across edges."""
    flat = faces.ravel()
    ends = [np.stack([half, next_corner(half)]) for half in (first, second)]
    alike = flat[first] == flat[second]  # wound against each other: start lies on start
    other = np.where(alike, ends[1], ends[1][::-1])
    return int(components(3 * len(faces), ends[0].ravel(), other.ravel()).max()) + 1


def count(n: int, what: str, many: str | None = None) -> str:
    """Return a number of things in words: "1 hole", "2 holes"."""
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
    found : dict of str to int
        How many vertices were merged and how many faces were mended, as far as there are any; for run.json.
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
            f"<ClosedModel {self.name}: {self.n_vertices:,} vertices, {len(self.faces):,} triangles{weighted}, "
            f"{size} {length_unit(self.georeference)}>"
        )

    @property
    def offset(self) -> FloatArray:  # type: ignore[override]
        """What is subtracted after turning: nothing."""
        return np.zeros(3)

    @property
    def n_parts(self) -> int:
        """Number P of parts that no edge connects."""
        return len(self.poles)

    @cached_property
    def part(self) -> IntArray:
        """Which part each vertex belongs to (N,): 0, 1, ... in the order of the poles."""
        return _parts(self.faces, self.poles, self.n_vertices)

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
        """Return the model as it was before it had break lines."""
        return self if self.lines is None else replace(self, lines=None)

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
        Of vertices that belong to no face, and of parts too small to have a mesh.
    """
    if source.sort != "mesh":
        raise ModelError(
            f"{source.name}: is a {source.sort}, which has one height at each place, and no closed surface; leave "
            "--surface closed (surface='closed') out"
        )
    used = np.zeros(len(source.points), bool)
    used[source.faces] = True
    n_unused = len(used) - int(used.sum())
    if n_unused:
        warn_of(f"{source.name}: {n_unused} of {len(used)} vertices belong to no face and are left out")
    what = topology(source.faces).refusal
    if what is not None:
        raise ModelError(
            f"{source.name}: {what}; a closed surface is made of parts like spheres, with holes or without: split or "
            "mend it in a mesh program, or cut out one side as a height surface with --patch front (patch='front')"
        )
    kept, n_small = _without_small_parts(source.faces, used)
    if n_small:
        if not kept.any():
            raise ModelError(
                f"{source.name}: all of its {count(n_small, 'part')} have fewer than {LEAST_VERTICES} vertices; a "
                "closed surface has more"
            )
        warn_of(
            f"{source.name}: {count(n_small, 'part')} of fewer than {LEAST_VERTICES} vertices "
            f"({count(int(used.sum() - kept.sum()), 'vertex', 'vertices')}) cannot be simplified and are left out"
        )
    measured = source.measured.points
    rows = np.flatnonzero(kept)
    rows = rows[np.lexsort(source.points[rows].T[::-1])]
    place = np.full(len(used), -1, np.int64)
    place[rows] = np.arange(len(rows))
    faces = canonical_faces(place[source.faces[kept[source.faces[:, 0]]]])
    pivot = measured[rows].min(axis=0)
    local = measured[rows] - pivot
    if not local.any(axis=0).all() or np.linalg.matrix_rank(local - local.mean(axis=0)) < 3:
        raise ModelError(f"{source.name}: all {len(rows)} vertices lie in one plane; a closed surface has a volume")
    if local.max() < LEAST_EXTENT:
        raise ModelError(
            f"{source.name}: extends over {local.max():g} only; rescale the model to above {LEAST_EXTENT:g}"
        )
    part = components(len(rows), faces[:, :2].ravel(), faces[:, 1:].ravel())
    found = embed(local, faces, part)
    _refuse_faults(source.name, len(faces), found.n_flipped, found.n_coinciding)
    rotation = _shown_side(local)
    changed = {"merged": len(source.repeats), "small_parts_left_out": n_small}
    model = ClosedModel(
        name=source.name,
        points=local @ rotation.T,
        faces=faces.astype(np.int32),
        xy=found.xy,
        poles=found.poles,
        source_index=source.rows[rows],
        file_points=source.points[rows],
        attributes={name: values[rows] for name, values in source.attributes.items()},
        rotation=rotation,
        pivot=pivot,
        repeats=source.repeats,
        found={name: n for name, n in changed.items() if n},
        georeference=source.georeference,
        scale=source.scale,
        material=source.material,
    )
    order = _vector_order(found.xy)
    return model._reordered(order, np.ascontiguousarray(found.xy[order]))


def _without_small_parts(faces: IntArray, used: BoolArray) -> tuple[BoolArray, int]:
    """Return which of the used vertices belong to parts that have enough of them, and how many parts have not."""
    part = components(len(used), faces[:, :2].ravel(), faces[:, 1:].ravel())
    sizes = np.bincount(part[used], minlength=int(part.max()) + 1)
    return used & (sizes[part] >= LEAST_VERTICES), int(((sizes > 0) & (sizes < LEAST_VERTICES)).sum())


def _vector_order(xy: FloatArray) -> IntArray:
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
