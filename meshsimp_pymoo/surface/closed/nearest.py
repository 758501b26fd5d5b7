"""How far points are from any mesh in space: true distances, through a tree of boxes over its triangles."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.surface.closed.distance import squared_distance

# Triangles in one leaf.
LEAF = 4
# Nodes that a search has still to visit are at most so many: one for each level of the tree, and one.
DEEPEST = 64
# Resolution of the curve along which triangles are listed, in bits along each axis.
MORTON_BITS = 20


def distances_to_mesh(
    points: FloatArray, vertices: FloatArray, faces: IntArray, guesses: IntArray | None = None
) -> tuple[FloatArray, IntArray]:
    """Return how far points (N, 3) are from a mesh, and the triangle that each is nearest to (N,).

    Parameters
    ----------
    points : (N, 3) float array
        Consecutive ones should be close to each other.
    vertices : (V, 3) float array
    faces : (M, 3) int array
    guesses : (N,) int array, optional
        A triangle for each point that may be near, so that it is found sooner; of several as near it is the one.

    Examples
    --------
    >>> triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> distances_to_mesh(np.array([[0.2, 0.2, 3.0], [2.0, 0.0, 0.0]]), triangle, np.array([[0, 1, 2]]))[0].tolist()
    [3.0, 1.0]
    """
    return MeshTree(vertices, faces).distances(points, guesses)


class MeshTree:
    """The triangles of a mesh, for distances to them that are asked for again and again.

    Parameters
    ----------
    vertices : (V, 3) float array
    faces : (M, 3) int array
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        corners = np.asarray(vertices, float)[np.asarray(faces)]
        low, high = corners.min(axis=1), corners.max(axis=1)
        self._order = np.argsort(_morton_keys(0.5 * (low + high)), kind="stable")
        self._xyz = np.array(
            vertices, float, order="C"
        ).ravel()  # a copy, as what is read-only is another type to compile for
        self._faces = np.ascontiguousarray(faces, np.int64)[self._order]
        self._boxes = _tree(low[self._order], high[self._order])

    def distances(self, points: FloatArray, guesses: IntArray | None = None) -> tuple[FloatArray, IntArray]:
        """Return how far points are from the mesh, and the nearest triangles; see :func:`distances_to_mesh`."""
        squares, nearest = np.empty(len(points)), np.full(len(points), -1, np.int64)
        if guesses is not None:
            place = np.empty(len(self._order), np.int64)
            place[self._order] = np.arange(len(self._order))
            nearest[:] = place[guesses]
        given = np.array(points, float, order="C")
        _nearest_triangles(given, self._xyz, self._faces, self._boxes, squares, nearest)
        return np.sqrt(squares), self._order[nearest]


def distances_to_line(points: FloatArray, line: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return how far points (N, 3) are from a polyline (n, 3), and the piece that each is nearest to (N,).

    Examples
    --------
    >>> line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    >>> [found.tolist() for found in distances_to_line(np.array([[0.5, 0.0, 2.0], [3.0, 0.5, 0.0]]), line)]
    [[2.0, 2.0], [0, 1]]
    """
    k = np.arange(len(line) - 1)
    return distances_to_mesh(points, line, np.column_stack([k, k + 1, k + 1]))  # triangles without an area


def _morton_keys(points: FloatArray) -> IntArray:
    """Return the place of points (n, 3) along a curve that fills their box."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = ((points - low) / (extent or 1.0) * (2**MORTON_BITS - 1)).astype(np.uint64)
    keys = np.zeros(len(points), np.uint64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            keys |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return keys


def _tree(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the boxes (2 L, 6), lowest and highest corner, of a tree over runs of ``LEAF`` of those given.

    Row 1 is the root, the children of k are 2 k and 2 k + 1, the last L rows are the leaves.
    """
    starts = np.arange(0, len(low), LEAF)
    n_leaves = len(starts)
    boxes = np.empty((2 * n_leaves, 6))
    boxes[n_leaves:, :3] = np.minimum.reduceat(low, starts)
    boxes[n_leaves:, 3:] = np.maximum.reduceat(high, starts)
    end = n_leaves
    while end > 1:  # those whose children are known
        first = (end + 1) // 2
        children = boxes[2 * first : 2 * end].reshape(-1, 2, 6)
        boxes[first:end, :3] = children[:, :, :3].min(axis=1)
        boxes[first:end, 3:] = children[:, :, 3:].max(axis=1)
        end = first
    return boxes


@inner(inline=True)
def _to_box(boxes: np.ndarray, node: int, x: float, y: float, z: float) -> float:
    """Return the squared distance to the box of a node."""
    dx = max(max(boxes[node, 0] - x, x - boxes[node, 3]), 0.0)
    dy = max(max(boxes[node, 1] - y, y - boxes[node, 4]), 0.0)
    dz = max(max(boxes[node, 2] - z, z - boxes[node, 5]), 0.0)
    return dx * dx + dy * dy + dz * dz


@entry
def _nearest_triangles(
    points: np.ndarray,
    xyz: np.ndarray,
    faces: np.ndarray,
    boxes: np.ndarray,
    squares: np.ndarray,
    nearest: np.ndarray,
) -> None:
    """Fill in the squared distance of each point and the triangle, which may be guessed; -1: that of the one before."""
    n_leaves = len(boxes) // 2
    nodes = np.empty(DEEPEST, np.int64)
    far = np.empty(DEEPEST, np.float64)
    best = np.int64(0)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        best = nearest[i] if nearest[i] >= 0 else best
        least = squared_distance(xyz, faces[best, 0], faces[best, 1], faces[best, 2], x, y, z)
        nodes[0] = 1
        far[0] = 0.0
        depth = 1
        while depth > 0:
            depth -= 1
            if far[depth] >= least:
                continue
            node = nodes[depth]
            if node >= n_leaves:
                first = (node - n_leaves) * LEAF
                for k in range(first, min(first + LEAF, len(faces))):
                    d = squared_distance(xyz, faces[k, 0], faces[k, 1], faces[k, 2], x, y, z)
                    if d < least:
                        least = d
                        best = k
                continue
            a, b = 2 * node, 2 * node + 1
            to_a, to_b = _to_box(boxes, a, x, y, z), _to_box(boxes, b, x, y, z)
            if to_a < to_b:  # the nearer one is looked at first
                a, b = b, a
                to_a, to_b = to_b, to_a
            nodes[depth], far[depth] = a, to_a
            nodes[depth + 1], far[depth + 1] = b, to_b
            depth += 2
        squares[i] = least
        nearest[i] = best


def nearest_shares(a: FloatArray, u: FloatArray, v: FloatArray, points: FloatArray) -> FloatArray:
    """Return the barycentric coordinates (K, 3) of the point of each triangle that is nearest to each point.

    The triangles have their first corners at ``a`` (K, 3), and their sides ``u`` and ``v`` lead from there.
    """
    p = points - a
    uu, uv, vv = (u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)
    up, vp = (u * p).sum(axis=1), (v * p).sum(axis=1)
    area = uu * vv - uv * uv
    solid = area > 0.0
    s = np.where(solid, vv * up - uv * vp, -1.0) / np.where(solid, area, 1.0)
    t = np.where(solid, uu * vp - uv * up, -1.0) / np.where(solid, area, 1.0)
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)

    # else the nearest point of the three sides
    def along(top: FloatArray, bottom: FloatArray) -> FloatArray:
        return np.clip(top / np.where(bottom > 0.0, bottom, 1.0), 0.0, 1.0)

    ab, ac = along(up, uu), along(vp, vv)
    w, q = v - u, p - u
    bc = along((w * q).sum(axis=1), (w * w).sum(axis=1))
    zero = np.zeros(len(p))
    choices = np.stack([np.stack([ab, zero]), np.stack([zero, ac]), np.stack([1.0 - bc, bc])])  # (side, 2, K)
    away = [((p - st[0][:, None] * u - st[1][:, None] * v) ** 2).sum(axis=1) for st in choices]
    side = np.argmin(away, axis=0)
    on_side = choices[side, :, np.arange(len(p))]
    s = np.where(inside, s, on_side[:, 0])
    t = np.where(inside, t, on_side[:, 1])
    return np.column_stack([1.0 - s - t, s, t])
