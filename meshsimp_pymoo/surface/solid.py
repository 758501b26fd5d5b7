"""A height surface as a solid that can be printed: closed by walls along its outline and holes, and by a flat base.

The surface stays as it is. Under each side of its outline stands a wall of two triangles; the base is the constrained
Delaunay triangulation of the outline's vertices, within the outline, which takes far fewer triangles than the surface
again. Where parts of the outline touch in a vertex, that vertex is there once for each part, and these are drawn apart
by a millionth of the mesh: every edge is in two triangles, one each way, also of a file such as STL, whose readers join
what is at one place.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.formats.table import Format
from meshsimp_pymoo.plane.constraints import make_constraints
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.plane.footprint import make_footprint
from meshsimp_pymoo.surface.evaluate import make_workspace, triangulate_subset
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.surface import Surface
from meshsimp_pymoo.workers import Reserve

# By how much parts are drawn apart, as a share of the diagonal: some eight steps of single precision.
APART = 2.0**-20
# The bounds of a thickness, as shares of the diagonal: beyond them rounding takes the base or the mesh away.
THINNEST, THICKEST = 1e-9, 1e6


class Solid(NamedTuple):
    """A closed mesh, its triangles counter-clockwise as seen from outside.

    Attributes
    ----------
    vertices : (W, 3) float array
        Its vertices in the frame of the model's file, first those of the surface [file units].
    faces : (F, 3) int array
        Its triangles, first those of the surface.
    source : (W,) int array
        Which vertex of the surface each one is, or stands below.
    volume : float
        What it encloses [file units cubed].
    parted : int
        How many of its vertices above are further ones where the outline touches itself; they, and those below, are by
        APART times the diagonal off their place.
    """

    vertices: FloatArray
    faces: IntArray
    source: IntArray
    volume: float
    parted: int

    @property
    def numbers(self) -> dict[str, Any]:
        """How large it is."""
        parted = {"parted": self.parted} if self.parted else {}
        return {"triangles": len(self.faces), "vertices": len(self.vertices), "volume": self.volume} | parted


def check_solid(surface: Surface, thickness: float, kind: Format | None = None) -> None:
    """Refuse a solid where it means nothing, or where the format that it is to be written in cannot hold it.

    Raises
    ------
    ValueError
        If the thickness is not positive.
    ResultError
        If the surface is closed already, is one of tiles, or has no lengths for coordinates, or the thickness is lost
        beside it, or it beside the thickness.
    """
    if not (np.isfinite(thickness) and thickness > 0.0):
        raise ValueError(f"a solid {thickness!r} thick is none; give how far its base is below the lowest point")
    name = surface.model.name
    if surface.view.is_closed:
        raise ResultError(f"{name}: is a closed surface, which has no outline for a base; leave the solid out")
    if not isinstance(surface, HeightSurface):
        raise ResultError(f"{name}: a solid is made of what is searched in one piece, not of tiles; leave it out")
    if not (surface.view.scale == 1.0).all():
        raise ResultError(
            f"{name}: a solid is for printing, with lengths alone, and this model is measured in other units than its "
            "file has, such as degrees; project it first (gdalwarp -t_srs)"
        )
    least, most = THINNEST * surface.diagonal, THICKEST * surface.diagonal
    if not least <= thickness <= most:
        raise ResultError(
            f"{name}: a base {thickness:g} below the lowest point does not go with a mesh that is "
            f"{surface.diagonal:.4g} across; give from {least:.4g} to {most:.4g}"
        )
    if kind is not None and kind.one_height:
        raise ResultError(
            f"{name}: {kind.title} holds surfaces with one height at each place, and a solid has two; write another "
            "format, such as stl"
        )


def as_solid(surface: Surface, faces: IntArray, thickness: float, vertices: FloatArray | None = None) -> Solid:
    """Close a mesh of a height surface by walls and a base.

    Parameters
    ----------
    surface : Surface
        The original mesh.
    faces : (M, 3) int array
        The mesh's triangles as rows of the surface's points, which do not overlap as seen from above.
    thickness : float
        How far the base is below the mesh's lowest point [file units].
    vertices : (V, 3) float array, optional
        Where the vertices are that the triangles use, ascending, as after a refit; by default those of the file.

    Raises
    ------
    ValueError, ResultError
        As :func:`check_solid`.

    Examples
    --------
    A plate of 2 x 2 units, its base 3 units below, has the triangles of a box:

    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.model import build_model
    >>> plate = HeightSurface(build_model(load("roof:3")))
    >>> found = as_solid(plate, plate.triangles(plate.pinned), 3.0)
    >>> len(found.faces), found.volume
    (12, 12.0)
    """
    check_solid(surface, thickness)
    assert isinstance(surface, HeightSurface)
    rows, compact = used_rows(np.asarray(faces))
    top = np.array(surface.model.file_points[rows] if vertices is None else vertices, np.float64)
    sides = _Sides.of(compact, len(rows))
    fans = sides.fans(np.zeros(len(sides.start), bool))
    _, first, fan = np.unique(fans, return_index=True, return_inverse=True)  # by the first corner of each
    upper_source, upper = _numbered(sides.start[first], len(rows))
    corner = upper[fan]

    border = np.flatnonzero(sides.twin < 0)
    base, chains, places = _base(surface, rows, np.column_stack([sides.start[border], sides.end[border]]))
    lower, lower_place = base.vertices
    lower_source, n_upper = places[lower_place], len(upper_source)
    # the side of the outline that each step of its walls stands under, and the base's side below it
    owner, step = chains
    a, b = corner[border], corner[sides.after(border)]
    before, after = n_upper + lower[step], n_upper + lower[base.sides.after(step)]
    first_step = np.flatnonzero(np.diff(owner, prepend=-1))
    walls = np.concatenate([np.column_stack([b, a, before[first_step]]), np.column_stack([b[owner], before, after])])
    below = n_upper + lower.reshape(-1, 3)[base.inside]

    up, shift = surface.view.rotation[2], np.zeros((n_upper + len(lower_source), 3))
    for k in range(len(rows), n_upper):
        middle = top[compact[np.flatnonzero(corner == k) // 3]].mean(axis=(0, 1)) - top[upper_source[k]]
        inwards = middle - (middle @ up) * up
        shift[k] = APART * np.linalg.norm(np.ptp(top, axis=0)) / np.linalg.norm(inwards) * inwards
    shift[before[first_step]] = shift[a]
    bottom = _flattened(top[lower_source], up, float((top @ up).min()) - thickness)
    solid_vertices = np.concatenate([top[upper_source], bottom]) + shift
    solid_faces = np.concatenate([corner.reshape(-1, 3), walls, below[:, ::-1]])
    corners = (solid_vertices - solid_vertices[-1])[solid_faces]
    volume = float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)
    source = np.concatenate([upper_source, lower_source])
    return Solid(solid_vertices, solid_faces, source, volume, n_upper - len(rows))


class _Sides(NamedTuple):
    """The sides of triangles (M, 3): side 3 t + k leads from corner k of triangle t to the next one."""

    start: IntArray
    end: IntArray
    twin: IntArray  # the side between the same vertices, the other way; -1: there is none
    by_key: tuple[IntArray, IntArray, int]

    @classmethod
    def of(cls, faces: IntArray, n: int) -> _Sides:
        """Return the sides of triangles of n vertices, which turn the same way."""
        start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
        key = start * n + end
        order = np.argsort(key)
        sides = cls(start, end, np.empty(0, np.int64), (key[order], order, n))
        return sides._replace(twin=sides.find(end, start))

    def find(self, start: IntArray, end: IntArray) -> IntArray:
        """Return the sides between vertices; -1 where there is none."""
        keys, order, n = self.by_key
        wanted = start * n + end
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[at] == wanted, order[at], -1)

    @staticmethod
    def after(side: IntArray) -> IntArray:
        """Return the next side of the same triangle; as a corner it is where a side ends."""
        return np.where(side % 3 == 2, side - 2, side + 1)

    def fans(self, is_wall: BoolArray) -> IntArray:
        """Return a label for the corner at the start of each side: corners joined by sides that are no walls share it.

        The labels are the first corner of each fan.
        """
        joined = np.flatnonzero((self.twin >= 0) & ~is_wall)
        return _joined(len(self.start), joined, self.after(self.twin[joined]))


def _joined(n: int, one: IntArray, other: IntArray) -> IntArray:
    """Return for each of n things the first that it is joined to, directly or not."""
    graph = coo_array((np.ones(len(one), np.int8), (one, other)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    return first[label]


def _numbered(vertex: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Return the vertex of each number that fans are given, and the number of each fan.

    The first fan at each of n vertices has the number of the vertex, further ones have numbers behind all of them.
    """
    _, first = np.unique(vertex, return_index=True)
    further = np.setdiff1d(np.arange(len(vertex)), first)
    number = vertex.copy()
    number[further] = n + np.arange(len(further))
    return np.concatenate([np.arange(n), vertex[further]]), number


class _Base(NamedTuple):
    """A triangulation of the places of an outline, and which of its triangles are within."""

    faces: IntArray
    sides: _Sides
    inside: BoolArray
    is_wall: BoolArray

    @property
    def vertices(self) -> tuple[IntArray, IntArray]:
        """The vertex of each corner, one for each fan of what is inside, and the place of each vertex."""
        fans = self.sides.fans(self.is_wall)
        within = np.repeat(self.inside, 3)
        first, number = np.unique(fans[within], return_inverse=True)
        vertex = np.full(len(fans), -1)
        vertex[within] = number
        return vertex, self.sides.start[first]


def _base(
    surface: HeightSurface, rows: IntArray, outline: IntArray
) -> tuple[_Base, tuple[IntArray, IntArray], IntArray]:
    """Triangulate what is on the left of an outline.

    Parameters
    ----------
    surface : HeightSurface
        The original mesh.
    rows : (V,) int array
        The vertices of a mesh as rows of its points.
    outline : (E, 2) int array
        The outline's sides: what of ``rows`` each leads from and to.

    Returns
    -------
    base : _Base
        The triangulation.
    chains : (K,) int arrays
        Which side of the outline, in order, each side of the base is below, and that side. There are several below one
        where the outline touches it from outside.
    places : (P,) int array
        Which of ``rows`` is at each place.
    """
    used, ends = np.unique(outline, return_inverse=True)
    xy = surface.model.xy[rows[used]]
    _, first, at = np.unique(xy, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # along the curve again
    place = np.argsort(order)[at.ravel()]
    places = used[first[order]]
    xy = np.ascontiguousarray(surface.model.xy[rows[places]])
    segments = place[ends.reshape(-1, 2)]

    n, lines = len(xy), make_constraints(xy, segments)
    nothing = np.empty(0, np.int64)
    ground = surface.ground()._replace(
        xy=xy.ravel(),
        z=np.zeros(n),
        corners=nothing,
        has_twins=False,
        min_height=0.0,
        footprint=make_footprint(xy, np.empty((0, 3), np.int32), np.empty((0, 2)), convex=True),
        lines=lines,
        weight=np.empty(0),
        weighed=False,
    )
    faces = triangulate_subset(ground, Reserve(partial(make_workspace, n)), np.ones(n, bool))[0].astype(np.int64)

    last = np.zeros(len(lines.along), bool)
    last[lines.start[1:] - 1] = True
    owner = np.repeat(np.arange(len(segments)), np.diff(lines.start))[~last]
    sides = _Sides.of(faces, n)
    step = sides.find(lines.along[~last].astype(np.int64), np.roll(lines.along, -1)[~last].astype(np.int64))
    if (step < 0).any():
        raise ValueError(f"{surface.model.name}: the outline of a mesh crosses itself; its triangles overlap")
    is_wall = np.zeros(len(sides.start), bool)
    is_wall[step] = True
    is_wall[sides.twin[step][sides.twin[step] >= 0]] = True
    across = np.flatnonzero((sides.twin >= 0) & ~is_wall)
    region = _joined(len(faces), across // 3, sides.twin[across] // 3)
    inside = np.isin(region, region[step // 3])
    return _Base(faces, sides, inside, is_wall), (owner, step), places


def _flattened(points: FloatArray, up: FloatArray, height: float) -> FloatArray:
    """Return points (n, 3) moved along a direction of length 1 to a height along it: exactly, along an axis."""
    moved = points - (points @ up - height)[:, None] * up
    axis = int(np.abs(up).argmax())
    if abs(up[axis]) == 1.0:
        moved = points.copy()
        moved[:, axis] = up[axis] * height
    return moved
