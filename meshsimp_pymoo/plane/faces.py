"""Triangles as rows of vertices: their edges, their neighbours, their one spelling."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array

from meshsimp_pymoo.arrays import Csr, FloatArray, IntArray


def canonical_faces(faces: IntArray) -> IntArray:
    """Return triangles (M, 3) in their one spelling: the least row first, the turn kept, sorted.

    Examples
    --------
    >>> canonical_faces(np.array([[3, 1, 2], [2, 0, 1]])).tolist()
    [[0, 1, 2], [1, 2, 3]]
    """
    turn = faces.argmin(axis=1)
    rows = np.arange(len(faces))
    turned = np.stack([faces[rows, (turn + k) % 3] for k in range(3)], axis=1)
    return turned[np.lexsort((turned[:, 2], turned[:, 1], turned[:, 0]))]


def is_canonical(faces: IntArray) -> bool:
    """Tell whether triangles (M, 3) are in their one spelling, none of them twice and none with a corner twice.

    Examples
    --------
    >>> is_canonical(np.array([[0, 1, 2], [0, 3, 1]])), is_canonical(np.array([[0, 3, 1], [0, 1, 2]]))
    (True, False)
    """
    a, b, c = faces.T
    if not ((a < b) & (a < c) & (b != c)).all():
        return False
    first, second, third = (np.sign(np.diff(column.astype(np.int64))) for column in (a, b, c))
    return bool((9 * first + 3 * second + third > 0).all())


def used_rows(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertices (V,) that triangles (M, 3) use, ascending, and the triangles as rows of these.

    Examples
    --------
    >>> used, compact = used_rows(np.array([[3, 1, 2], [2, 5, 3]]))
    >>> used.tolist(), compact.tolist()
    ([1, 2, 3, 5], [[2, 0, 1], [1, 3, 2]])
    >>> used_rows(np.array([[9, 7, 8]]))[1].tolist()
    [[2, 0, 1]]
    """
    most = int(faces.max(initial=0))
    if most > faces.size:  # few of very many
        used, compact = np.unique(faces, return_inverse=True)
        return used, compact.reshape(-1, 3)
    is_used = np.zeros(most + 1, np.bool_)
    is_used[faces] = True
    return np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[faces]


def least_angles(xy: FloatArray, faces: IntArray) -> FloatArray:
    """Return the least angle of each triangle (M, 3); 0 where it has no area [degrees].

    The vertices are in the plane (V, 2) or in space (V, 3).

    Examples
    --------
    >>> least_angles(np.array([[0.0, 0], [1, 0], [0, 1], [-1, 0]]), np.array([[0, 1, 2], [0, 1, 3]])).tolist()
    [45.0, 0.0]
    """
    if xy.shape[1] == 2:
        x, y = (np.ascontiguousarray(xy[:, k])[faces.T] for k in (0, 1))
        dx, dy = x - x[[1, 2, 0]], y - y[[1, 2, 0]]
        squares = dx * dx + dy * dy
        area = np.abs(dx[0] * dy[1] - dy[0] * dx[1])
    else:
        corners = xy[faces.T]
        sides = corners - corners[[1, 2, 0]]
        squares = (sides**2).sum(axis=2)
        area = np.linalg.norm(np.cross(sides[0], sides[1]), axis=1)
    # The least one lies opposite the shortest side, between the two others: their cross and scalar product, doubled.
    cross = 2.0 * area
    angles: FloatArray = np.degrees(np.arctan2(cross, squares.sum(axis=0) - 2.0 * squares.min(axis=0)))
    return angles


class EdgeTable(NamedTuple):
    """The edges of triangles.

    Attributes
    ----------
    ends : (E, 2) int64 array
        The vertices of each edge, ascending; edges sorted.
    n_triangles : (E,) int array
        How many triangles have it.
    order : (3 M,) int array
        The sides of all triangles (first all first sides, then all second ones, then all third ones) edge by edge.
    first : (E,) int array
        Where each edge's sides begin in ``order``.
    """

    ends: IntArray
    n_triangles: IntArray
    order: IntArray
    first: IntArray


def edge_table(faces: IntArray) -> EdgeTable:
    """Return the edges of triangles (M, 3).

    Examples
    --------
    >>> table = edge_table(np.array([[0, 1, 2], [0, 2, 3]]))
    >>> table.ends[table.n_triangles == 2].tolist()
    [[0, 2]]
    """
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    sides.sort(axis=1)
    key = sides[:, 0] * (int(faces.max(initial=0)) + 1) + sides[:, 1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]][: len(key)])
    return EdgeTable(sides[order[first]], np.diff(np.r_[first, len(key)]), order, first)


def border_vertices(faces: IntArray) -> IntArray:
    """Return the vertices at edges of one triangle only, ascending."""
    table = edge_table(faces)
    return np.unique(table.ends[table.n_triangles == 1])


def one_rings(faces: IntArray, n: int) -> Csr:
    """Return the neighbours of each of n vertices on the edges of faces (T, 3), ascending, in CSR form."""
    ends, others = faces[:, [0, 1, 2, 1, 2, 0]].ravel(), faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    table = coo_array((np.ones(len(ends), np.int8), (ends, others)), shape=(n, n)).tocsr()
    table.sort_indices()
    return table.indptr.astype(np.int64), table.indices.astype(np.int32, copy=False)
