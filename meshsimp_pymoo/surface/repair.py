"""Small defects that scanners and exporters leave, mended with a count before a mesh is judged.

A face listed twice says nothing new; the winding of a face means nothing in a sheet that can be wound alike; and a few
faces that stand on edges of others, such as fins, are no part of the sheet. No face that is part of it is lost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.surface.edges import Edges, components, next_corner, seams, single_precision, used_vertices

# Faces at edges of more than two are dropped up to this share of all: as many as may be folded over.
DROPPED_SHARE = 0.01


@dataclass(frozen=True)
class Mended:
    """What was mended in a mesh.

    Parameters
    ----------
    repeated : int
        Faces dropped because another has the same three vertices, wound as it is or the other way.
    extra : int
        Faces dropped because they stand on an edge of two others, with what hangs on them alone.
    turned : int
        Faces wound against most of the sheet (by area), which were turned.
    """

    repeated: int = 0
    extra: int = 0
    turned: int = 0

    def __str__(self) -> str:
        told = (
            (self.repeated, "listed twice and dropped"),
            (self.extra, "that stand on edges of two others dropped"),
            (self.turned, "wound against the others turned"),
        )
        return ", ".join(f"{number} {'face' if number == 1 else 'faces'} {what}" for number, what in told if number)


def mend(source: SourceMesh) -> tuple[SourceMesh, Mended]:
    """Mend what can be mended without losing any of the surface.

    * Of faces with the same three vertices the first stays.
    * At an edge of more than two faces the two that continue each other best stay; the others are dropped, with the
      part of the mesh that hangs on them alone, up to 1 % of the faces. Of more, none: that is no small defect.
    * The faces of each part that is connected through edges of two faces, or through borders that touch within single
      precision, are wound alike, as most of its area is; a part with one side only stays as it is.

    Parameters
    ----------
    source : SourceMesh

    Returns
    -------
    mesh : SourceMesh
        `source` itself if there was nothing to mend. Vertices stay, although no face may use them any longer.
    mended : Mended
        With the numbers.

    Examples
    --------
    >>> from meshsimp_pymoo.formats.source import build_source
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> mesh, mended = mend(build_source(square, [[0, 1, 2], [2, 0, 1], [3, 2, 0]]))
    >>> mesh.faces.tolist(), str(mended)
    ([[0, 1, 2], [0, 2, 3]], '1 face listed twice and dropped, 1 face wound against the others turned')
    """
    if source.sort != "mesh":
        return source, Mended()  # a grid's or cloud's faces were made here
    faces = source.faces
    edges = Edges.of(faces)
    repeated = _repeated(edges)
    if repeated.any():
        faces = faces[~repeated]
        edges = Edges.of(faces)
    extra = _extra(source.points, edges)
    if extra.any():
        faces = faces[~extra]
        edges = Edges.of(faces)
    turned = _turned(source.points, edges)
    mended = Mended(int(repeated.sum()), int(extra.sum()), int(turned.sum()))
    if mended == Mended():
        return source, mended
    return replace(source, faces=np.where(turned[:, None], faces[:, ::-1], faces)), mended


def _repeated(edges: Edges) -> BoolArray:
    """Tell which faces have the vertices of an earlier one."""
    faces = edges.faces
    first, second = edges.pairs
    opposite = faces.ravel()[next_corner(next_corner(np.stack([first, second])))]
    alike = first[opposite[0] == opposite[1]] // 3, second[opposite[0] == opposite[1]] // 3
    doubtful = np.unique(np.concatenate([*alike, edges.of_edges(edges.crowded)[0] // 3]))
    repeated = np.zeros(len(faces), bool)
    repeated[doubtful] = True
    repeated[doubtful[np.unique(np.sort(faces[doubtful], axis=1), axis=0, return_index=True)[1]]] = False
    return repeated


def _extra(points: FloatArray, edges: Edges) -> BoolArray:
    """Tell which faces to drop so that no edge has more than two; none if they were too many."""
    faces, crowded = edges.faces, edges.crowded
    none = np.zeros(len(faces), bool)
    most = DROPPED_SHARE * len(faces)
    if len(crowded) == 0 or len(crowded) > 3 * most:
        return none
    half, which = edges.of_edges(crowded)
    keeps, drops = none.copy(), none.copy()
    for at in np.split(half, np.flatnonzero(np.diff(which)) + 1):
        pair = _flattest(points, faces, at)
        keeps[pair // 3] = True
        drops[np.setdiff1d(at, pair) // 3] = True
    first, second = edges.pairs
    part = components(len(faces), first // 3, second // 3)
    # a part of which no face stays where it meets others hangs on those that are dropped
    hanging = np.zeros(int(part.max()) + 1, bool)
    hanging[part[drops]] = True
    hanging[part[keeps]] = False
    drops |= hanging[part]
    return drops if drops.sum() <= most else none


def _flattest(points: FloatArray, faces: IntArray, half: IntArray) -> IntArray:
    """Return the two half-edges, of those at one edge, whose faces continue each other best."""
    flat = faces.ravel()
    start, end = points[flat[half[0]]], points[flat[next_corner(half[:1])[0]]]
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-300)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across /= max(float(np.linalg.norm(across)), 1e-300)
    away = points[flat[next_corner(next_corner(half))]] - start
    angle = np.arctan2(away @ np.cross(along, across), away @ across)
    by_angle = np.argsort(angle, kind="stable")
    turn = np.concatenate([angle[by_angle], angle[by_angle] + 2 * np.pi])
    # opposite each face: the one before and the one behind half a turn
    behind = np.searchsorted(turn, turn[: len(half)] + np.pi)
    pairs = [(abs(turn[k] - turn[i] - np.pi), i, k % len(half)) for i, n in enumerate(behind) for k in (n - 1, n)]
    _, first, second = min(pair for pair in pairs if pair[1] != pair[2])
    return half[by_angle[[first, second]]]


def _turned(points: FloatArray, edges: Edges) -> BoolArray:
    """Tell which faces are wound against most of the area of their part, of parts that have two sides."""
    faces = edges.faces
    flat, n = faces.ravel(), len(faces)
    first, second = edges.pairs
    if len(edges.border) and components(n, first // 3, second // 3).any():
        touching = seams(points, edges, single_precision(points[used_vertices(faces)]))
        start, end = points[flat[touching[0]]], points[flat[next_corner(touching[0])]]
        there = points[flat[touching[1]]]
        along = np.linalg.norm(start - there, axis=1) < np.linalg.norm(end - there, axis=1)
        same = np.concatenate([flat[first] == flat[second], along])
        first, second = (np.concatenate([a, b]) for a, b in zip((first, second), touching, strict=True))
    else:
        same = flat[first] == flat[second]
    if not same.any():
        return np.zeros(n, bool)
    # each face stands here twice, as it is (f) and turned (n + f): what has two sides falls apart into two
    f, g = first // 3, second // 3
    twins = components(2 * n, np.concatenate([f, f + n]), np.concatenate([g + n * same, g + n * ~same]))
    as_it_is, turned = twins[:n], twins[n:]
    a, b, c = (points[faces[:, k]] for k in range(3))
    area: npt.NDArray[np.float64] = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    weight = np.bincount(as_it_is, weights=area, minlength=2 * n)
    against = weight[as_it_is] < weight[turned]
    tie = (weight[as_it_is] == weight[turned]) & (as_it_is != turned)
    # in a tie the first face of the part is right: its number is the lower, for they are given in order
    return np.asarray(against | (tie & (as_it_is > turned)))
