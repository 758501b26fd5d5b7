"""Which way a model faces, and whether it is a surface that one can look at from there.

An open model is (nearly) a height field over the plane across its `up` direction. Here that direction is
found, the model is turned so that it points along z, everything that would contradict a height field is
counted (:func:`surface_facts`), judged (:func:`open_faces`), or cut away (:func:`front_patch`).
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry
from meshsimp_pymoo.errors import FacesAllWays, ModelError, ModelWarning, warn_of
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.surface.edges import (
    Edges,
    border_loops,
    components,
    next_corner,
    seams,
    single_precision,
    used_vertices,
)
from meshsimp_pymoo.surface.overlap import height_at, hidden_faces

Up = str | Sequence[float] | FloatArray

# up="auto" takes an axis that sees at least this share of the area the best direction sees (within 21.6 degrees) as
# soon as the model passes along it; one further off only if it folds the model no more than that direction does.
# Scans and terrain come axis-aligned, but their outline rarely lies level, and the net normal of an open surface
# depends on its outline alone: on aligned range maps it strays by up to 18.3 degrees (a share of 0.949).
AXIS_AGREEMENT = 0.93

# Below this share of its area, a surface faces no way: closed, or closed but for pinholes. Open scans: 0.4 to
# 1.
NET_AREA_SHARE = 0.01

# A face that projects to less than this share of its area (steeper than 89.99994 degrees), and to no more width than
# single precision tells, counts as vertical: rounding decides on which side it is seen. Heights may be large against
# the extent (metres over degrees), so steepness alone says nothing.
VERTICAL_SHARE = 1e-6

# Folded faces are tolerated with a warning up to this share of all faces: stray flips that scanners and hole
# filling
# leave are a few in a thousand, and one folded vertex in a hundred moves a sum over all vertices by about as
# much.
# A real overhang (a nose from below, an ear) takes more.
FOLD_SHARE = 0.01

# Vertices within a strip this narrow, relative to its length, span no surface; the same bound as for slivers.
WIDTH_SHARE = 1e-9

# The way out that is always there.
CUT = "cut out the patch that faces the viewer with --patch front (patch='front')"

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
    """Return the unit vector that points from the surface to its viewer, height field from there or not.

    Parameters
    ----------
    source, up
        As in :func:`seen_upright`, which says what "auto" is.

    Returns
    -------
    (3,) float64 array
        Of length 1; exact for axes.

    Raises
    ------
    ModelError
        If `up` is no direction, or "auto" finds that no direction is preferred (a closed surface).

    Examples
    --------
    >>> from meshsimp_pymoo.formats.source.heights import grid_source
    >>> up_direction(grid_source([[0.0, 1.0], [2.0, 5.0]]))
    array([0., 0., 1.])
    """
    given = source.up if _is_auto(up) else up
    return seen_upright(source)[0] if given is None else _given_direction(given)


def seen_upright(source: SourceMesh, up: Up = "auto") -> tuple[FloatArray, SurfaceFacts]:
    """Return the direction to look from, and what the surface is from there as far as that takes to judge it.

    ``"auto"`` tries the file's z, y and x axis and then the net normal (the area-weighted sum of the face normals),
    and takes the first along which the surface passes as a height field: by the test that would refuse it. An axis
    that sees less than 93 % of the area that the net normal sees must also fold the surface no more than that does.
    If none passes, it is the one that folds it least. Grids are always seen from +z.

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
    direction : (3,) float64 array
        Of length 1; exact for axes.
    facts : SurfaceFacts
        Its `refusal` says whether the surface can be used. Folds are counted until it is known.

    Raises
    ------
    ModelError
        If `up` is no direction, or "auto" finds that no direction is preferred (a closed surface).
    """
    sheet = _Sheet(source)
    points = _local_points(source)

    def seen_from(direction: FloatArray) -> SurfaceFacts:
        rotation = upright_rotation(direction)
        # grids and clouds were triangulated in the plane that is seen then: no face lies below another
        is_plane = source.sort != "mesh" and abs(float(direction[2])) == 1.0
        blur = _blur(source, source.points @ rotation.T)
        return sheet.seen(points @ rotation.T, FOLD_SHARE, blur, is_plane=is_plane)

    given = source.up if _is_auto(up) else up
    if given is not None:
        direction = _given_direction(given)
        return direction, seen_from(direction)
    normals = area_vectors(points, source.faces)
    areas = np.linalg.norm(normals, axis=1)
    area = float(areas.sum())
    total = normals.sum(axis=0)
    length = float(np.linalg.norm(total))
    corners = points[source.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    if (areas <= WIDTH_SHARE * longest**2).all():
        raise ModelError(
            f"{source.name}: all {len(source.points)} vertices lie on one line: the {len(source.faces)} faces have no "
            "area; give a mesh that spans a surface"
        )
    faces_a_way = length > NET_AREA_SHARE * area

    @cache
    def net() -> tuple[FloatArray, SurfaceFacts] | None:
        return (total / length, seen_from(total / length)) if faces_a_way else None

    def is_as_good(facts: SurfaceFacts, k: int) -> bool:
        if (faces_a_way and abs(total[k]) >= AXIS_AGREEMENT * length) or facts.n_folded == 0:
            return True
        best = net()
        return best is None or best[1].refusal_from_there is not None or facts.n_folded <= best[1].n_folded

    tried = []
    if faces_a_way or not sheet.is_closed:
        for k in (2, 1, 0):
            axis = np.zeros(3)
            axis[k] = -1.0 if total[k] < 0 else 1.0
            facts = seen_from(axis)
            if facts.refusal_from_there is None and is_as_good(facts, k):
                return axis, facts
            tried.append((axis, facts))
    best = net()
    if best is None:
        raise FacesAllWays(
            f"{source.name}: faces all ways alike (net projected area {length / max(area, 1e-300):.2g} of the area), "
            "like a closed surface; name the viewing side with --up z (up='z') and cut the patch that faces it with "
            "--patch front (patch='front')"
        )
    if best[1].refusal_from_there is None:
        return best
    direction, facts = min([*tried, best], key=lambda seen: seen[1].n_folded or seen[1].n_faces)
    found = ",".join(f"{value:.6g}" for value in direction)
    return direction, replace(facts, seen_from=f"{found} (the best direction that --up auto found)")


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
    complete : bool
        Whether all of `hidden` were counted, or only until it was clear that they are too many.
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
    seen_from : str
        How messages call the direction.
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
    complete: bool
    fold_example: tuple[int, int, int] | None
    vertical_faces: int
    flipped: bool
    net_share: float
    width_share: float
    seen_from: str = "up"

    @property
    def n_folded(self) -> int:
        """Number of faces that are folded over or hidden, as far as they were counted."""
        return self.folds + self.hidden

    @property
    def fold_share(self) -> float:
        """Share of the faces that are folded over or hidden, as far as they were counted."""
        return self.n_folded / self.n_faces

    @property
    def refusal(self) -> str | None:
        """Why this cannot be used as an open model, with the way out; None if it can."""
        return None if (fault := self._fault or self._fault_from_there) is None else f"{self.name}: {fault[1]}"

    @property
    def refusal_from_there(self) -> str | None:
        """Why this is no height field as seen from there; None if it is."""
        return None if self._fault_from_there is None else f"{self.name}: {self._fault_from_there[1]}"

    @property
    def fault(self) -> str | None:
        """Why this is no height field, in few words that continue "since it"; None if it is."""
        return None if (fault := self._fault or self._fault_from_there) is None else fault[0]

    @property
    def _fault(self) -> tuple[str, str] | None:
        """What is wrong wherever it is seen from: in few words, and with the way out."""
        if self.border_edges == 0 and self.nonmanifold_edges == 0:
            return "has no border", f"the surface is closed (no border edge among {self.n_faces} faces); {CUT}"
        if self.nonmanifold_example is not None and self.width_share > WIDTH_SHARE:
            a, b, count = self.nonmanifold_example
            return "has edges of more than two faces", (
                f"{self.nonmanifold_edges} edges belong to more than two faces (first: vertices "
                f"{a} and {b}, {count} faces); repair them in a mesh editor or {CUT}"
            )
        return None

    @property
    def _fault_from_there(self) -> tuple[str, str] | None:
        if self.width_share <= WIDTH_SHARE:
            return "is a line as seen from there", (
                f"all {self.n_vertices} vertices lie on one line as seen from {self.seen_from} (width "
                f"{self.width_share:.2g} of the length); choose another viewing side with --up"
            )
        if self.vertical_faces == self.n_faces:
            return "is seen edge-on from there", (
                f"all {self.n_faces} faces are seen edge-on from {self.seen_from}, so there is no height "
                "field; choose another viewing side with --up"
            )
        if self.fold_share > FOLD_SHARE:
            rewind = (
                f"neighbouring faces disagree in winding on {self.inconsistent_edges} edges, so orient them alike, or "
                if self.inconsistent_edges
                else "choose another viewing side with --up, or "
            )
            at_least = "" if self.complete else "at least "
            return f"has {at_least}{self.fold_share:.2%} of its faces folded over from any side tried", (
                f"{self._folded}, more than {FOLD_SHARE:.0%}, so it is no height field; {rewind}{CUT}"
            )
        return None

    @property
    def remark(self) -> str | None:
        """What a user of this model should know although it can be used; None if nothing."""
        if self.n_folded == 0:
            return None
        return f"{self.name}: {self._folded}; heights there are ambiguous"

    @property
    def _folded(self) -> str:
        example = "" if self.fold_example is None else f"; first: vertices {self.fold_example}"
        at_least = "" if self.complete else "at least "
        hidden = "" if self.hidden == 0 and not self.complete else f", {at_least}{self.hidden} lie below others"
        return (
            f"seen from {self.seen_from}, {at_least}{self.n_folded} of {self.n_faces} faces ({self.fold_share:.2%}) "
            f"are folded over ({self.folds} show their back{hidden}{example})"
        )


def surface_facts(source: SourceMesh, upright: FloatArray, *, until: float = 1.0) -> SurfaceFacts:
    """Describe a surface as seen from above, without judging it.

    Fold-overs show in two ways. A face whose projected area is negative shows its back. Sheets that cross the
    line of sight twice without turning round (a spiral ramp) overlap with all signs positive, which
    :func:`~meshsimp_pymoo.surface.overlap.hidden_faces` finds.

    Parameters
    ----------
    source : SourceMesh
    upright : (V, 3) float array
        Its points turned so that the viewer is at +z, ``source.points @ upright_rotation(up).T``.
    until : float
        Stop counting folds when they are known to be more than this share of the faces.

    Returns
    -------
    SurfaceFacts
    """
    return _Sheet(source).seen(upright, until, _blur(source, upright))


def open_faces(source: SourceMesh, facts: SurfaceFacts) -> IntArray:
    """Return the faces (F, 3) counter-clockwise as seen from above, or refuse them.

    Vertices in which two fans of faces touch, vertical faces, several parts and unused vertices are no fault.

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
    if facts.refusal is not None:
        raise ModelError(facts.refusal)
    if facts.remark is not None:
        warnings.warn(facts.remark, ModelWarning, stacklevel=3)
    return source.faces[:, ::-1] if facts.flipped else source.faces


def front_patch(source: SourceMesh, up: Up = "auto") -> SourceMesh:
    """Cut out the largest connected patch that faces the viewer and does not overlap itself in projection.

    Of the faces that show their front, the largest edge-connected part by projected area stays; where it
    overlaps itself, faces below others go, and again the largest connected part stays. Faces seen edge-on
    face nobody and go too. Borders that touch within single precision connect, so that two tiles of a survey
    are one part. Edges of more than two such faces do not connect, so the result is manifold; vertices in which two
    of its fans touch may remain.

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

    Warns
    -----
    ModelWarning
        How many faces are left out, with their share of the area and the number of connected pieces they are.
    """
    direction = up_direction(source, up)
    rotation = upright_rotation(direction)
    blur = _blur(source, source.points @ rotation.T)
    points = _local_points(source) @ rotation.T
    faces = source.faces
    normals = area_vectors(points, faces)
    areas = np.linalg.norm(normals, axis=1)
    vertical = _vertical(points, faces, normals, blur)
    solid = np.flatnonzero(~vertical)
    fronts, backs = _seen_sides(points[faces[solid]], normals[solid, 2] > 0, RAYS) if len(solid) else (0, 0)
    if backs > fronts or (backs == fronts and normals[:, 2].sum() < 0):
        faces = faces[:, ::-1]
        normals = -normals
    height = normals[:, 2]
    facing = np.flatnonzero(~vertical & (height > 0))
    if len(facing) == 0:
        raise ModelError(
            f"{source.name}: none of {len(faces)} faces looks towards {tuple(direction.round(3).tolist())}; choose "
            "another viewing side with --up"
        )
    patch = _largest_part(points[:, :2], faces, facing, height, blur)
    hidden = hidden_faces(points, faces[patch], tolerance=blur, name=source.name)
    if len(hidden):
        patch = _largest_part(points[:, :2], faces, np.delete(patch, hidden), height, blur)
    used, renumbered = np.unique(faces[patch], return_inverse=True)
    if len(used) < 4:
        raise ModelError(
            f"{source.name}: the patch that faces {tuple(direction.round(3).tolist())} has only {len(used)} vertices; "
            "choose another viewing side with --up"
        )
    left_out = np.delete(np.arange(len(faces)), patch)
    if len(left_out):
        first, second = Edges.of(faces[left_out]).pairs
        pieces = int(components(len(left_out), first // 3, second // 3).max()) + 1
        warn_of(
            f"{source.name}: {len(left_out)} of {len(faces)} faces ({areas[left_out].sum() / areas.sum():.2%} of the "
            f"area) are left out of the front patch, in {pieces} {'piece' if pieces == 1 else 'pieces'}"
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
        material=source.material,
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


def _is_auto(up: Up) -> bool:
    return isinstance(up, str) and up.strip().lower() == "auto"


def _local_points(source: SourceMesh) -> FloatArray:
    """Shift to the middle of the used vertices: rotations round relative to the coordinates."""
    used = source.points[used_vertices(source.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    return source.points - (low + (high - low) / 2)


def area_vectors(points: FloatArray, faces: IntArray) -> FloatArray:
    """Return the normals (F, 3) of faces, as long as their areas."""
    a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
    return np.cross(b - a, c - a) / 2


def edge_on(normals: FloatArray) -> BoolArray:
    """Tell which faces are so steep, by their :func:`area_vectors`, that rounding decides on which side one sees."""
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


@dataclass(frozen=True)
class _Sheet:
    """A surface, with what is known of it from whatever side it is seen."""

    source: SourceMesh

    @cached_property
    def edges(self) -> Edges:
        return Edges.of(self.source.faces)

    @cached_property
    def used(self) -> IntArray:
        return used_vertices(self.source.faces)

    @property
    def is_closed(self) -> bool:
        return len(self.edges.border) == len(self.edges.crowded) == 0

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Return what :class:`SurfaceFacts` says that does not depend on the side."""
        source, edges = self.source, self.edges
        first, second = edges.pairs
        flat = source.faces.ravel()
        example = None
        if len(edges.crowded):
            a, b = source.rows[edges.ends(edges.of_edges(edges.crowded[:1])[0][:1])[0]]
            example = (int(a), int(b), int(edges.counts[edges.crowded[0]]))
        loops, pinches = border_loops(edges)
        return {
            "name": source.name,
            "n_vertices": len(self.used),
            "n_faces": len(source.faces),
            "unused_vertices": len(source.points) - len(self.used),
            "components": int(components(len(source.faces), first // 3, second // 3).max()) + 1,
            "border_edges": len(edges.border),
            "border_loops": loops,
            "pinch_vertices": pinches,
            "nonmanifold_edges": len(edges.crowded),
            "nonmanifold_example": example,
            "inconsistent_edges": int((flat[first] == flat[second]).sum()),
        }

    def seen(self, upright: FloatArray, until: float, blur: float, *, is_plane: bool = False) -> SurfaceFacts:
        """Describe it as seen from above; see :func:`surface_facts` and :func:`_blur`.

        With ``is_plane`` it is known that no face lies below another.
        """
        faces = self.source.faces
        normals = area_vectors(upright, faces)
        areas = np.linalg.norm(normals, axis=1)
        net = float(normals[:, 2].sum())
        flipped = net < 0
        if flipped:
            faces = faces[:, ::-1]
            normals = -normals
        vertical = _vertical(upright, faces, normals, blur)
        folded = ~vertical & (normals[:, 2] < 0)
        folds = int(folded.sum())
        most = int(until * len(faces)) - folds  # hidden faces that do not matter
        hidden = np.zeros(len(faces), bool)
        if most >= 0 and not is_plane:
            facing = np.flatnonzero(~vertical & ~folded)
            edges = None if flipped or folds else self.edges
            below = hidden_faces(upright, faces[facing], tolerance=blur, most=most, edges=edges, name=self.source.name)
            hidden[facing[below]] = True
        n_hidden = int(hidden.sum())
        doubtful = np.flatnonzero(folded | hidden)
        example = tuple(self.source.rows[self.source.faces[doubtful[0]]].tolist()) if len(doubtful) else None
        return SurfaceFacts(
            **self.facts,
            folds=folds,
            hidden=n_hidden,
            complete=n_hidden <= most,
            fold_example=example,
            vertical_faces=int(vertical.sum()),
            flipped=flipped,
            net_share=abs(net) / max(float(areas.sum()), 1e-300),
            width_share=_width_share(upright[self.used, :2]),
        )


def _blur(source: SourceMesh, upright: FloatArray) -> float:
    """Return how far rounding may have moved vertices across the line of sight, and neighbours overlap [units]."""
    used = used_vertices(source.faces)
    return single_precision(source.points[used], upright[used, :2])


def _vertical(upright: FloatArray, faces: IntArray, normals: FloatArray, blur: float) -> BoolArray:
    """Tell which faces are seen edge-on: steep, and no wider than single precision tells."""
    vertical = edge_on(normals)
    steep = np.flatnonzero(vertical)
    corners = upright[faces[steep], :2]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    vertical[steep] = 2 * np.abs(normals[steep, 2]) <= blur * longest
    return vertical


# ------------------------------------------------------------ the front


def _largest_part(xy: FloatArray, faces: IntArray, chosen: IntArray, weight: FloatArray, blur: float) -> IntArray:
    """Return the connected part of the chosen faces with the largest weight, manifold and wound alike.

    Borders closer than `blur` in the plane connect faces beside each other, whatever the step between them.

    Where two of its faces lie on the same side of an edge (slivers that the overlap test let pass), the
    heavier stays.
    """
    while True:
        edges = Edges.of(faces[chosen])
        first, second = edges.pairs
        label = components(len(chosen), first // 3, second // 3)
        if label.any():
            one, other = seams(xy, edges, blur)
            start, end, there = (xy[edges.faces.ravel()[half]] for half in (one, next_corner(one), other))
            # faces beside each other run along their seam in opposite senses; those above each other alike
            beside = np.linalg.norm(start - there, axis=1) > np.linalg.norm(end - there, axis=1)
            first, second = label[one[beside] // 3], label[other[beside] // 3]
            label = components(int(label.max()) + 1, first, second)[label]
        best = int(np.argmax(np.bincount(label, weights=weight[chosen])))
        part = chosen[label == best]
        directed = faces[part].ravel() * (int(faces.max()) + 1) + np.roll(faces[part], -1, axis=1).ravel()
        order = np.lexsort([-np.repeat(weight[part], 3), directed])
        repeated = directed[order][1:] == directed[order][:-1]
        if not repeated.any():
            return part
        chosen = np.delete(part, np.unique(order[1:][repeated] // 3))


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
                    z = height_at(triangles, f, x, y)
                    if z > top[i, j]:
                        top[i, j] = z
                        seen[i, j] = 1 if is_front[f] else -1
    return (seen > 0).sum(), (seen < 0).sum()
