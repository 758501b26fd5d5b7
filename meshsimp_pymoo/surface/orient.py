"""Which way a model faces, and whether it is a surface that one can look at from there.

An open model is (nearly) a height field over the plane across its `up` direction. Here that direction is
found, the model is turned so that it points along z, everything that would contradict a height field is
counted (:func:`surface_facts`), judged (:func:`check_open_surface`), or cut away (:func:`front_patch`).
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source import SourceMesh

Up = str | Sequence[float] | FloatArray

# up="auto" prefers an axis that sees at least this share of the area the best direction sees (within 21.6
# degrees).
# Scans and terrain come axis-aligned, but their outline rarely lies level, and the best direction of an open
# surface
# depends on its outline alone: on aligned range maps it strays by up to 18.3 degrees (a share of 0.949).
AXIS_AGREEMENT = 0.93

# ... or, where the best direction folds the surface beyond FOLD_SHARE, an axis within 45 degrees that folds
# it less:
# busts whose outline follows neck and shoulders stray by 30 degrees.
AXIS_REACH = 0.7071

# Below this share of its area, a surface faces no way: closed, or closed but for pinholes. Open scans: 0.4 to
# 1.
NET_AREA_SHARE = 0.01

# A face that projects to less than this share of its area (steeper than 89.99994 degrees) counts as vertical:
# after a
# tilted model is turned, rounding of single-precision files decides the sign of anything steeper.
VERTICAL_SHARE = 1e-6

# Folded faces are tolerated with a warning up to this share of all faces: stray flips that scanners and hole
# filling
# leave are a few in a thousand, and one folded vertex in a hundred moves a sum over all vertices by about as
# much.
# A real overhang (a nose from below, an ear) takes more.
FOLD_SHARE = 0.01

# Two faces overlap when no line separates them within this share of the extent; so far may rounding push
# neighbours.
OVERLAP_TOLERANCE = 1e-9

# Vertices within a strip this narrow, relative to its length, span no surface; the same bound as for slivers.
WIDTH_SHARE = 1e-9

# Vertical rays, per side of a square lattice, that tell whether a front or a back is seen from above.
RAYS = 128

# Signed permutations, cyclic up to two signs, so rotations and free of rounding.
_AXES: dict[str, list[list[int]]] = {
    "x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
    "y": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
    "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-x": [[0, 1, 0], [0, 0, -1], [-1, 0, 0]],
    "-y": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
}


def up_direction(source: SourceMesh, up: Up = "auto") -> FloatArray:
    """Return the unit vector that points from the surface to its viewer.

    ``"auto"`` is the direction along which the net projected area is largest: the area-weighted sum of the
    face normals. An exact axis is preferred where it sees at least 93 % of that area without folding the
    surface, and within 45 degrees where the best direction folds the surface and the axis folds it less.
    Grids are always seen from +z.

    The sign follows the winding in the file (counter-clockwise as seen by the viewer), for nothing else is
    known. A file whose faces are all clockwise is so seen from behind, heights reversed; vertical errors stay
    the same, and written meshes keep the file's winding. Give the axis to see it from the front: where the
    net area along a *given* `up` is negative, all faces are taken as flipped.

    Parameters
    ----------
    source : SourceMesh
    up : {"auto", "x", "y", "z", "-x", "-y", "-z"}, "a,b,c" or (3,) floats

    Returns
    -------
    (3,) float64 array
        Of length 1; exact for axes.

    Raises
    ------
    ModelError
        If `up` is none of these, or "auto" finds that no direction is preferred (a closed surface).

    Examples
    --------
    >>> from meshsimp_pymoo.formats.source.heights import grid_source
    >>> up_direction(grid_source([[0.0, 1.0], [2.0, 5.0]]))
    array([0., 0., 1.])
    """
    if not (isinstance(up, str) and up.strip().lower() == "auto"):
        return _given_direction(up)
    if source.up is not None:
        return _given_direction(source.up)
    normals = _area_vectors(source.points, source.faces)
    areas = np.linalg.norm(normals, axis=1)
    total = normals.sum(axis=0)
    length = float(np.linalg.norm(total))
    extent = float(np.ptp(source.points, axis=0).max())
    if areas.sum() <= WIDTH_SHARE * extent**2:
        raise ModelError(
            f"{source.name}: all {len(source.points)} vertices lie on one line: the {len(source.faces)} faces have no "
            "area; give a mesh that spans a surface"
        )
    if length <= NET_AREA_SHARE * areas.sum():
        raise ModelError(
            f"{source.name}: faces all ways alike (net projected area "
            f"{length / max(areas.sum(), 1e-300):.2g} of the "
            "area), like a closed surface; "
            "name the viewing side with --up (up='z') and cut the patch that faces "
            f"it with --patch front (patch='front')"
        )
    best = total / length
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(best)))
    axis[k] = np.sign(best[k])
    agreement = abs(best[k])
    if agreement < AXIS_REACH:
        return best
    folds_along_axis, folds_along_best = (
        float(np.mean(normals @ direction < -VERTICAL_SHARE * areas)) for direction in (axis, best)
    )
    if agreement >= AXIS_AGREEMENT and folds_along_axis <= max(FOLD_SHARE, folds_along_best):
        return axis
    if folds_along_best > FOLD_SHARE and folds_along_axis < folds_along_best:
        return axis
    return best


def upright_rotation(up: Up) -> FloatArray:
    """Return the rotation R that turns `up` to +z: ``upright = points @ R.T``, and back ``upright @ R``.

    For axes R is a signed permutation, so nothing is rounded: x, y, z cycle (and two signs change for
    negative axes). For other directions R is orthonormal to rounding; it continues the nearest axis'
    rotation, so that a slightly tilted model is only slightly turned. Subtract a local origin first: rounding
    is relative to the coordinates.

    Parameters
    ----------
    up : axis name, "a,b,c" or (3,) floats
        Not "auto": see :func:`up_direction`.

    Returns
    -------
    (3, 3) float64 array
        With determinant +1.

    Examples
    --------
    >>> upright_rotation("x") @ [1.0, 0.0, 0.0]
    array([0., 0., 1.])
    """
    z = _given_direction(up)
    k = int(np.argmax(np.abs(z)))
    start = np.array(_AXES["-xyz"[0] * bool(z[k] < 0) + "xyz"[k]], dtype=np.float64)
    if np.count_nonzero(z) == 1:
        return start
    x = start[0] - (start[0] @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


@dataclass(frozen=True)
class SurfaceFacts:
    """What a surface is when seen from above.

    Parameters
    ----------
    name : str
        As in :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    n_vertices, n_faces : int
        Vertices that faces use, and faces.
    unused_vertices : int
        Vertices that no face uses.
    components : int
        Parts connected through edges of two faces.
    border_edges, border_loops : int
        Edges of one face, and the closed loops one walks along them, always beside the same fan of faces: two
        holes that touch in a vertex are one loop, two parts that touch in one have a loop each.
    pinch_vertices : int
        Border vertices in which two or more fans of faces meet. They are no fault.
    nonmanifold_edges : int
        Edges of more than two faces.
    nonmanifold_example : (int, int, int) or None
        One of them: its two vertices (file rows) and its number of faces.
    inconsistent_edges : int
        Edges whose two faces are wound in opposite senses.
    folds : int
        Faces that show their back.
    hidden : int
        Faces seen from the front that lie below another such face.
    fold_example : (int, int, int) or None
        Vertices (file rows) of one face counted in `folds` or `hidden`.
    vertical_faces : int
        Faces seen edge-on. They are no fault.
    flipped : bool
        Whether all faces were taken as flipped because their net projected area is negative.
    net_share : float
        Net projected area over the surface's area, 0 to 1: 1 is flat, about 0 is closed.
    width_share : float
        Width of the projected vertices over their length.
    """

    name: str
    n_vertices: int
    n_faces: int
    unused_vertices: int
    components: int
    border_edges: int
    border_loops: int
    pinch_vertices: int
    nonmanifold_edges: int
    nonmanifold_example: tuple[int, int, int] | None
    inconsistent_edges: int
    folds: int
    hidden: int
    fold_example: tuple[int, int, int] | None
    vertical_faces: int
    flipped: bool
    net_share: float
    width_share: float

    @property
    def fold_share(self) -> float:
        """Share of the faces that are folded over or hidden."""
        return (self.folds + self.hidden) / self.n_faces

    @property
    def refusal(self) -> str | None:
        """Why this cannot be used as an open model, with the way out; None if it can."""
        cut = "cut out the patch that faces the viewer with --patch front (patch='front')"
        if self.border_edges == 0 and self.nonmanifold_edges == 0:
            return f"{self.name}: the surface is closed (no border edge among {self.n_faces} faces); {cut}"
        if self.width_share <= WIDTH_SHARE:
            return (
                f"{self.name}: all {self.n_vertices} vertices lie on one line as seen from up (width "
                f"{self.width_share:.2g} of the length); choose another viewing side with --up"
            )
        if self.vertical_faces == self.n_faces:
            return (
                f"{self.name}: all {self.n_faces} faces are seen edge-on from up, so there is no height field; "
                "choose another viewing side with --up"
            )
        if self.nonmanifold_example is not None:
            a, b, count = self.nonmanifold_example
            return (
                f"{self.name}: {self.nonmanifold_edges} edges belong to more than two faces (first: vertices "
                f"{a} and "
                f"{b}, {count} faces); repair them in a mesh editor or {cut}"
            )
        if self.fold_share > FOLD_SHARE:
            rewind = (
                f"neighbouring faces disagree in winding on {self.inconsistent_edges} edges, so orient them alike, or "
                if self.inconsistent_edges
                else "choose another viewing side with --up, or "
            )
            return f"{self.name}: {self._folded}, more than {FOLD_SHARE:.0%}, so it is no height field; {rewind}{cut}"
        return None

    @property
    def remark(self) -> str | None:
        """What a user of this model should know although it can be used; None if nothing."""
        if self.folds + self.hidden == 0:
            return None
        return f"{self.name}: {self._folded}; heights there are ambiguous"

    @property
    def _folded(self) -> str:
        example = "" if self.fold_example is None else f"; first: vertices {self.fold_example}"
        return (
            f"seen from up, {self.folds + self.hidden} of {self.n_faces} faces "
            f"({self.fold_share:.2%}) "
            f"are folded over ({self.folds} show their back, {self.hidden} lie below others{example})"
        )


def surface_facts(source: SourceMesh, upright: FloatArray) -> SurfaceFacts:
    """Describe a surface as seen from above, without judging it.

    Fold-overs show in two ways. A face whose projected area is negative shows its back. Sheets that cross the
    line of sight twice without turning round (a spiral ramp) overlap with all signs positive; then the number
    of faces over a point is the winding number of the border around it, so where two faces overlap, some face
    at the border overlaps another. Those few are tested against all, and only if one is found, all against
    all.

    Parameters
    ----------
    source : SourceMesh
    upright : (V, 3) float array
        Its points turned so that the viewer is at +z, ``source.points @ upright_rotation(up).T``.

    Returns
    -------
    SurfaceFacts
    """
    used = np.unique(source.faces)
    faces = source.faces
    normals = _area_vectors(upright, faces)
    areas = np.linalg.norm(normals, axis=1)
    net = float(normals[:, 2].sum())
    flipped = net < 0
    if flipped:
        faces = faces[:, ::-1]
        normals = -normals
    vertical = np.abs(normals[:, 2]) <= VERTICAL_SHARE * areas
    folded = ~vertical & (normals[:, 2] < 0)
    facing = np.flatnonzero(~vertical & ~folded)
    hidden = np.zeros(len(faces), bool)
    hidden[facing[hidden_faces(upright, faces[facing])]] = True

    edges = _Edges.of(faces)
    nonmanifold = np.flatnonzero(edges.counts > 2)
    example = None
    if len(nonmanifold):
        a, b = edges.ends(faces, nonmanifold[:1])[0]
        example = (int(source.rows[a]), int(source.rows[b]), int(edges.counts[nonmanifold[0]]))
    first, second = edges.pairs()
    inconsistent = faces.ravel()[first] == faces.ravel()[second]
    doubtful = np.flatnonzero(folded | hidden)
    loops, pinches = _border_loops(faces, edges)
    return SurfaceFacts(
        name=source.name,
        n_vertices=len(used),
        n_faces=len(faces),
        unused_vertices=len(source.points) - len(used),
        components=int(_face_components(len(faces), first // 3, second // 3).max()) + 1,
        border_edges=int((edges.counts == 1).sum()),
        border_loops=loops,
        pinch_vertices=pinches,
        nonmanifold_edges=len(nonmanifold),
        nonmanifold_example=example,
        inconsistent_edges=int(inconsistent.sum()),
        folds=int(folded.sum()),
        hidden=int(hidden.sum()),
        fold_example=_file_rows(source, doubtful),
        vertical_faces=int(vertical.sum()),
        flipped=flipped,
        net_share=abs(net) / max(float(areas.sum()), 1e-300),
        width_share=_width_share(upright[used, :2]),
    )


def check_open_surface(source: SourceMesh, upright: FloatArray) -> tuple[IntArray, SurfaceFacts]:
    """Refuse what is no open surface over the (x, y) plane; see :class:`SurfaceFacts`.

    Vertices in which two fans of faces touch, vertical faces, several parts and unused vertices are no fault.

    Parameters
    ----------
    source : SourceMesh
    upright : (V, 3) float array
        Its points turned so that the viewer is at +z, ``source.points @ upright_rotation(up).T``.

    Returns
    -------
    faces : (F, 3) int64 array
        The faces counter-clockwise as seen from above: all flipped if the net projected area is negative.
    facts : SurfaceFacts

    Raises
    ------
    ModelError
        For a closed surface, vertices on one line, an edge of more than two faces, and more than 1 % of the
        faces folded over, with the way out.

    Warns
    -----
    ModelWarning
        If at most 1 % of the faces are folded over, with their number.
    """
    facts = surface_facts(source, upright)
    if facts.refusal is not None:
        raise ModelError(facts.refusal)
    if facts.remark is not None:
        warnings.warn(facts.remark, ModelWarning, stacklevel=2)
    return source.faces[:, ::-1] if facts.flipped else source.faces, facts


def front_patch(source: SourceMesh, up: Up = "auto") -> SourceMesh:
    """Cut out the largest connected patch that faces the viewer and does not overlap itself in projection.

    Of the faces that show their front, the largest edge-connected part by projected area stays; where it
    overlaps itself, faces below others go, and again the largest connected part stays. Faces seen edge-on
    face nobody and go too. Edges of more than two such faces do not connect, so the result is manifold;
    vertices in which two of its fans touch may remain.

    Which side of a face is its front is seen from above: if a lattice of rays meets more backs than fronts,
    the file's winding is taken as inverted.

    Parameters
    ----------
    source : SourceMesh
        May be closed, non-manifold or folded.
    up : "auto", axis name, "a,b,c" or (3,) floats
        For a closed surface "auto" cannot know and says so.

    Returns
    -------
    SourceMesh
        In the file's frame, with the vertices that the patch uses (`rows` tells which they were), faces
        counter-clockwise as seen from `up`, which "auto" stands for from now on (the patch alone might
        suggest another).

    Raises
    ------
    ModelError
        If nothing faces the viewer, or as :func:`up_direction`.
    """
    direction = up_direction(source, up)
    points = _local_points(source) @ upright_rotation(direction).T
    faces = source.faces
    normals = _area_vectors(points, faces)
    areas = np.linalg.norm(normals, axis=1)
    solid = np.flatnonzero(np.abs(normals[:, 2]) > VERTICAL_SHARE * areas)
    fronts, backs = _seen_sides(points[faces[solid]], normals[solid, 2] > 0, RAYS) if len(solid) else (0, 0)
    if backs > fronts or (backs == fronts and normals[:, 2].sum() < 0):
        faces = faces[:, ::-1]
        normals = -normals
    height = normals[:, 2]
    facing = np.flatnonzero(height > VERTICAL_SHARE * areas)
    if len(facing) == 0:
        raise ModelError(
            f"{source.name}: none of {len(faces)} faces looks towards {tuple(direction.round(3).tolist())}; "
            "choose "
            f"another viewing side with --up"
        )
    patch = _largest_part(faces, facing, height)
    hidden = hidden_faces(points, faces[patch])
    if len(hidden):
        patch = _largest_part(faces, np.delete(patch, hidden), height)
    used, renumbered = np.unique(faces[patch], return_inverse=True)
    if len(used) < 4:
        raise ModelError(
            f"{source.name}: the patch that faces {tuple(direction.round(3).tolist())} has only {len(used)} "
            "vertices; "
            f"choose another viewing side with --up"
        )
    return SourceMesh(
        points=source.points[used],
        faces=renumbered.reshape(-1, 3).astype(np.int64),
        attributes={key: values[used] for key, values in source.attributes.items()},
        name=f"{source.name} (front patch)",
        rows=source.rows[used],
        up=(float(direction[0]), float(direction[1]), float(direction[2])),
        georeference=source.georeference,
        repeats=source.repeats,
    )


# ------------------------------------------------------------ directions


def _given_direction(up: Up) -> FloatArray:
    if isinstance(up, str):
        text = up.strip().lower().removeprefix("+")
        if text in _AXES:
            axis = np.zeros(3)
            axis["xyz".index(text[-1])] = -1.0 if text[0] == "-" else 1.0
            return axis
        words: Sequence[Any] = re.split(r"[,\s]+", text.strip("()[] "))
    else:
        words = list(up)
    try:
        vector = np.array([float(word) for word in words])
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise ModelError(
            f"up={up!r} is no direction; give 'auto', an axis (x, y, z, -x, -y, -z) or a vector such as 0,0.5,1"
        )
    longest = np.abs(vector).max()
    if longest <= 1 and abs(vector @ vector - 1) <= 4 * np.finfo(float).eps:
        return vector  # a unit vector comes back as it is
    vector = vector / longest
    return vector / np.linalg.norm(vector)


def _local_points(source: SourceMesh) -> FloatArray:
    """Shift to the middle of the used vertices: rotations round relative to the coordinates."""
    used = source.points[np.unique(source.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    return source.points - (low + (high - low) / 2)


def _area_vectors(points: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
    return np.cross(b - a, c - a) / 2


def edge_on(points: FloatArray, faces: IntArray) -> npt.NDArray[np.bool_]:
    """Tell which faces (F, 3) of upright points (V, 3) are seen edge-on from above, to rounding: (F,)."""
    normals = _area_vectors(points, faces)
    return np.asarray(np.abs(normals[:, 2]) <= VERTICAL_SHARE * np.linalg.norm(normals, axis=1))


def _width_share(xy: FloatArray) -> float:
    """Return the width over the length of a point set, along its principal axes."""
    centred = xy - xy.mean(axis=0)
    scale = np.abs(centred).max()
    if scale == 0:
        return 0.0
    centred = centred / scale
    _, _, axes = np.linalg.svd(np.linalg.qr(centred, mode="r"))
    length, width = np.ptp(centred @ axes.T, axis=0)
    return float(width / length)


def _file_rows(source: SourceMesh, faces: npt.NDArray[np.intp]) -> tuple[int, int, int] | None:
    if len(faces) == 0:
        return None
    a, b, c = source.rows[source.faces[faces[0]]].tolist()
    return a, b, c


# ------------------------------------------------------------ edges and parts


@dataclass(frozen=True)
class _Edges:
    """Half-edges ``3 * face + i`` (corner i to i + 1), sorted so that those of one edge stand together."""

    order: IntArray
    starts: IntArray
    counts: IntArray

    @classmethod
    def of(cls, faces: IntArray) -> _Edges:
        a = faces.ravel()
        b = np.roll(faces, -1, axis=1).ravel()
        key = np.minimum(a, b) * (int(faces.max()) + 1) + np.maximum(a, b)
        order = np.argsort(key, kind="stable")
        ordered = key[order]
        starts = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
        return cls(order, starts, np.diff(np.append(starts, len(key))))

    def pairs(self) -> tuple[IntArray, IntArray]:
        """Return the two half-edges of every edge that has exactly two."""
        starts = self.starts[self.counts == 2]
        return self.order[starts], self.order[starts + 1]

    def border(self) -> IntArray:
        """Return the half-edges of the edges that have one face."""
        return self.order[self.starts[self.counts == 1]]

    def ends(self, faces: IntArray, edges: npt.NDArray[np.intp]) -> IntArray:
        """Return the two vertices of each edge."""
        half = self.order[self.starts[edges]]
        return np.column_stack([faces.ravel()[half], faces.ravel()[_next(half)]])


def _next(half: IntArray) -> IntArray:
    """Return the following half-edge, or corner, within the same face."""
    return half - half % 3 + (half + 1) % 3


def _face_components(n: int, first: IntArray, second: IntArray) -> IntArray:
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _border_loops(faces: IntArray, edges: _Edges) -> tuple[int, int]:
    """Count the border's closed loops, and its vertices in which several fans of faces meet."""
    border = edges.border()
    if len(border) == 0:
        return 0, 0
    flat = faces.ravel()
    at_border = np.zeros(int(faces.max()) + 1, bool)
    at_border[flat[border]] = True
    at_border[flat[_next(border)]] = True
    corners = np.flatnonzero(at_border[flat])
    number = np.full(faces.size, -1, np.int64)
    number[corners] = np.arange(len(corners))
    # two faces on one edge share the fans at both its ends
    first, second = edges.pairs()
    same = flat[first] == flat[second]
    links = [
        (first, np.where(same, second, _next(second))),
        (_next(first), np.where(same, _next(second), second)),
    ]
    left = np.concatenate([number[a] for a, _ in links])
    right = np.concatenate([number[b] for _, b in links])
    fan = _face_components(len(corners), left[left >= 0], right[left >= 0])
    fans_per_vertex = np.bincount(np.unique(np.column_stack([flat[corners], fan]), axis=0)[:, 0])
    start, end = fan[number[border]], fan[number[_next(border)]]
    loop = _face_components(int(fan.max()) + 1, start, end)
    return len(np.unique(loop[start])), int((fans_per_vertex > 1).sum())


def _largest_part(faces: IntArray, chosen: IntArray, weight: FloatArray) -> IntArray:
    """Return the edge-connected part of the chosen faces with the largest weight, manifold and wound alike.

    Where two of its faces lie on the same side of an edge (slivers that the overlap test let pass), the
    heavier stays.
    """
    while True:
        first, second = _Edges.of(faces[chosen]).pairs()
        label = _face_components(len(chosen), first // 3, second // 3)
        best = int(np.argmax(np.bincount(label, weights=weight[chosen])))
        part = chosen[label == best]
        directed = faces[part].ravel() * (int(faces.max()) + 1) + np.roll(faces[part], -1, axis=1).ravel()
        order = np.lexsort([-np.repeat(weight[part], 3), directed])
        repeated = directed[order][1:] == directed[order][:-1]
        if not repeated.any():
            return part
        chosen = np.delete(part, np.unique(order[1:][repeated] // 3))


# ------------------------------------------------------------ what lies above what


def hidden_faces(points: FloatArray, faces: IntArray) -> IntArray:
    """Return the faces below others, of faces that all show their front (rows of `faces`, ascending)."""
    if len(faces) == 0:
        return np.empty(0, np.int64)
    edges = _Edges.of(faces)
    first, second = edges.pairs()
    inner = faces.ravel()[first] != faces.ravel()[second]
    at_border = np.ones(faces.size, bool)
    at_border[first[inner]] = False
    at_border[second[inner]] = False
    triangles = points[faces]
    some = np.flatnonzero(at_border.reshape(-1, 3).any(axis=1))
    if len(_overlaps(triangles, some)) == 0:
        return np.empty(0, np.int64)
    pairs = _overlaps(triangles, np.arange(len(faces)))
    return np.unique(_lower_ones(triangles, pairs))


def _overlaps(triangles: FloatArray, members: IntArray) -> IntArray:
    """Return the pairs (member, other) of triangles (F, 3, 3) that overlap in the plane."""
    xy = np.ascontiguousarray(triangles[:, :, :2])
    low, high = xy.min(axis=1), xy.max(axis=1)
    origin = low.min(axis=0)
    size = high.max(axis=0) - origin
    extent = float(size.max())
    # cells about as large as the members, so that each lies in a few
    typical = float(np.sqrt(np.mean(np.prod(high[members] - low[members], axis=1))))
    cell = max(typical, extent / max(2.0 * np.sqrt(len(members)), 1.0), 1e-300)
    shape = np.maximum(np.ceil(size / cell).astype(np.int64), 1)
    cells_low = np.clip(((low - origin) / cell).astype(np.int64), 0, shape - 1)
    cells_high = np.clip(((high - origin) / cell).astype(np.int64), 0, shape - 1)
    return _overlapping_pairs(xy, members, cells_low, cells_high, shape, OVERLAP_TOLERANCE * extent)


@entry
def _overlapping_pairs(
    xy: np.ndarray,
    members: np.ndarray,
    cells_low: np.ndarray,
    cells_high: np.ndarray,
    shape: np.ndarray,
    tolerance: float,
) -> np.ndarray:
    columns, rows = shape[0], shape[1]
    start = np.zeros(columns * rows + 1, np.int64)
    for m in members:
        for i in range(cells_low[m, 0], cells_high[m, 0] + 1):
            for j in range(cells_low[m, 1], cells_high[m, 1] + 1):
                start[i * rows + j + 1] += 1
    # plain loops: NumPy's sums and slices take Numba two seconds to compile
    fill = np.empty(columns * rows, np.int64)
    for cell in range(columns * rows):
        fill[cell] = start[cell]
        start[cell + 1] += start[cell]
    content = np.empty(start[columns * rows], np.int64)
    is_member = np.zeros(len(xy), np.bool_)
    for m in members:
        is_member[m] = True
        for i in range(cells_low[m, 0], cells_high[m, 0] + 1):
            for j in range(cells_low[m, 1], cells_high[m, 1] + 1):
                content[fill[i * rows + j]] = m
                fill[i * rows + j] += 1
    found = np.empty((64, 2), np.int64)
    n = 0
    for f in range(len(xy)):
        for i in range(cells_low[f, 0], cells_high[f, 0] + 1):
            for j in range(cells_low[f, 1], cells_high[f, 1] + 1):
                for k in range(start[i * rows + j], start[i * rows + j + 1]):
                    m = content[k]
                    if m == f or (is_member[f] and m < f):
                        continue
                    # each pair once: in the lowest cell that both reach
                    if i != max(cells_low[f, 0], cells_low[m, 0]):
                        continue
                    if j != max(cells_low[f, 1], cells_low[m, 1]):
                        continue
                    if _separated(xy[f], xy[m], tolerance) or _separated(xy[m], xy[f], tolerance):
                        continue
                    if n == len(found):
                        longer = np.empty((2 * n, 2), np.int64)
                        for q in range(n):
                            longer[q, 0] = found[q, 0]
                            longer[q, 1] = found[q, 1]
                        found = longer
                    found[n, 0] = m
                    found[n, 1] = f
                    n += 1
    return found[:n]


@inner(inline=True)
def _separated(a: np.ndarray, b: np.ndarray, tolerance: float) -> bool:
    """Tell whether an edge of the counter-clockwise triangle `a` has all of `b` on its outer side."""
    for i in range(3):
        px, py = a[i, 0], a[i, 1]
        dx, dy = a[(i + 1) % 3, 0] - px, a[(i + 1) % 3, 1] - py
        slack = tolerance * np.sqrt(dx * dx + dy * dy)
        outside = True
        for j in range(3):
            if dx * (b[j, 1] - py) - dy * (b[j, 0] - px) > slack:
                outside = False
                break
        if outside:
            return True
    return False


@entry
def _lower_ones(triangles: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return, of each pair, the triangle lower at the centre of the overlap (in a tie the later)."""
    lower = np.empty(len(pairs), np.int64)
    polygon = np.empty((16, 2))
    clipped = np.empty((16, 2))
    for k in range(len(pairs)):
        a, b = triangles[pairs[k, 0]], triangles[pairs[k, 1]]
        n = 3
        for j in range(3):
            polygon[j, 0], polygon[j, 1] = b[j, 0], b[j, 1]
        for i in range(3):  # Sutherland and Hodgman: cut b by each edge of a
            px, py = a[i, 0], a[i, 1]
            dx, dy = a[(i + 1) % 3, 0] - px, a[(i + 1) % 3, 1] - py
            m = 0
            for j in range(n):
                qx, qy = polygon[j, 0], polygon[j, 1]
                rx, ry = polygon[(j + 1) % n, 0], polygon[(j + 1) % n, 1]
                side_q = dx * (qy - py) - dy * (qx - px)
                side_r = dx * (ry - py) - dy * (rx - px)
                if side_q >= 0:
                    clipped[m, 0], clipped[m, 1] = qx, qy
                    m += 1
                if (side_q > 0 and side_r < 0) or (side_q < 0 and side_r > 0):
                    t = side_q / (side_q - side_r)
                    clipped[m, 0], clipped[m, 1] = qx + t * (rx - qx), qy + t * (ry - qy)
                    m += 1
            polygon, clipped = clipped, polygon
            n = m
            if n == 0:
                break
        x = y = 0.0
        if n > 0:
            for j in range(n):
                x += polygon[j, 0] / n
                y += polygon[j, 1] / n
        else:  # a rounding case: they hardly touch
            for j in range(3):
                x += (a[j, 0] + b[j, 0]) / 6
                y += (a[j, 1] + b[j, 1]) / 6
        above = _height(a, x, y) - _height(b, x, y)
        if above == 0:
            lower[k] = max(pairs[k, 0], pairs[k, 1])
        else:
            lower[k] = pairs[k, 1] if above > 0 else pairs[k, 0]
    return lower


@inner
def _height(t: np.ndarray, x: float, y: float) -> float:
    """Return the height of a triangle's plane over (x, y)."""
    bx, by, bz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    cx, cy, cz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    x, y = x - t[0, 0], y - t[0, 1]
    area = bx * cy - by * cx
    return t[0, 2] + ((x * cy - y * cx) * bz + (bx * y - by * x) * cz) / area


@entry
def _seen_sides(triangles: np.ndarray, is_front: np.ndarray, rays: int) -> tuple[int, int]:
    """Count the vertical rays of a lattice that meet first, from above, a front and a back."""
    x_low, y_low = triangles[:, :, 0].min(), triangles[:, :, 1].min()
    x_step = (triangles[:, :, 0].max() - x_low) / rays
    y_step = (triangles[:, :, 1].max() - y_low) / rays
    top = np.full((rays, rays), -np.inf)
    seen = np.zeros((rays, rays), np.int8)
    offset = 0.381966  # off the centre, for edges of regular grids run through centres and corners
    for f in range(len(triangles)):
        t = triangles[f]
        i_low = max(int((t[:, 0].min() - x_low) / x_step), 0)
        i_high = min(int((t[:, 0].max() - x_low) / x_step), rays - 1)
        j_low = max(int((t[:, 1].min() - y_low) / y_step), 0)
        j_high = min(int((t[:, 1].max() - y_low) / y_step), rays - 1)
        turn = 1.0 if is_front[f] else -1.0
        for i in range(i_low, i_high + 1):
            x = x_low + (i + offset) * x_step
            for j in range(j_low, j_high + 1):
                y = y_low + (j + offset) * y_step
                inside = True
                for k in range(3):
                    px, py = t[k, 0], t[k, 1]
                    qx, qy = t[(k + 1) % 3, 0], t[(k + 1) % 3, 1]
                    if turn * ((qx - px) * (y - py) - (qy - py) * (x - px)) < 0:
                        inside = False
                        break
                if inside:
                    z = _height(t, x, y)
                    if z > top[i, j]:
                        top[i, j] = z
                        seen[i, j] = 1 if is_front[f] else -1
    return (seen > 0).sum(), (seen < 0).sum()
