"""Vertices moved off the original ones to where a closed mesh of the same triangles fits the original best.

The original is sampled at its vertices and at the centres of its faces. In each round every sample is taken to lie on
the triangle that is nearest to it, among those around the one before, and the vertices are moved to where the sum of
the squared distances to the planes of these triangles is least (point-to-plane, Chen and Medioni [1]_), with a small
pull towards where they are. Slipping along the surface costs nothing so, which is what makes a few rounds enough.
Where a triangle would turn over, as in thin parts, its vertices stay where they were at first.

Planes know no end, so that rims of holes would stay where their vertices happen to be. The rims of the original are
samples too: each is taken to lie on the edge of the mesh's rims that is nearest, if that is no farther than a share of
its length (the mesh may have no such hole), and what counts is how far it is beside that edge within the plane of its
triangle.

References
----------
.. [1] Y. Chen, G. Medioni, "Object modelling by registration of multiple range images", Image and Vision Computing 10,
   1992.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh, nearest_shares
from meshsimp_pymoo.surface.edges import Edges

# Rounds, and what holds vertices where they are: this share of what a sample weighs, times the samples a vertex.
ROUNDS = 10
PULL = 0.01
# Conjugate gradients end where so much of the residual is left, or after so many steps: rounds go on from there.
CLOSE = 1e-6
MOST_STEPS = 200
# How far a sample of a rim may be from an edge that it is taken to lie on, in lengths of that edge.
NEAR_RIM = 0.25
# So often the way of a vertex of a break line is halved until its edges are near enough to the line; then it is none.
TRIES = 4


class Samples(NamedTuple):
    """What the original is sampled at.

    Attributes
    ----------
    points : (K, 3) float array
        Consecutive ones should be close to each other.
    weights : (K,) float array
        What each counts.
    rim : (R, 3) float array
        On the rims of its holes.
    rim_weights : (R,) float array
    """

    points: FloatArray
    weights: FloatArray
    rim: FloatArray
    rim_weights: FloatArray


class Round(NamedTuple):
    """Where the vertices are, and how far the samples of the original are from their mesh.

    Attributes
    ----------
    vertices : (V, 3) float array
    distances : (K,) float array
    rim_distances : (R,) float array
        Of samples of rims from those of the mesh; 0 where it has none near.
    """

    vertices: FloatArray
    distances: FloatArray
    rim_distances: FloatArray


class _Rim(NamedTuple):
    """The rims of a mesh: edges (E, 2) of one face only, and that face (E,)."""

    ends: IntArray
    face: IntArray

    @classmethod
    def of(cls, faces: IntArray) -> _Rim:
        edges = Edges.of(np.asarray(faces, np.int64))
        return cls(edges.ends(edges.border), edges.border // 3)

    def nearest(self, vertices: FloatArray, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return how far points are from these edges, and the nearest of them; -1 where that is too far."""
        if not len(self.ends) or not len(points):
            return np.zeros(len(points)), np.full(len(points), -1)
        away, edge = distances_to_mesh(points, vertices, self.ends[:, [0, 1, 1]])
        length = np.linalg.norm(vertices[self.ends[:, 1]] - vertices[self.ends[:, 0]], axis=1)
        near = away <= NEAR_RIM * length[edge]
        return np.where(near, away, 0.0), np.where(near, edge, -1)


class Held(NamedTuple):
    """What moved vertices may not leave: break lines.

    Attributes
    ----------
    points : (L, 3) float array
        Points of the lines as they were given.
    ends : (L, 2) int array
        The vertices of the mesh whose edge stands for each of them.
    tolerance : float
        How far a point may be from its edge, if it was not farther at the start.
    """

    points: FloatArray
    ends: IntArray
    tolerance: float

    def left(self, vertices: FloatArray) -> IntArray:
        """Return the ends of edges that are too far from what they stand for."""
        a, b = vertices[self.ends[:, 0]], vertices[self.ends[:, 1]]
        u, p = b - a, self.points - a
        t = np.clip((p * u).sum(axis=1) / np.maximum((u * u).sum(axis=1), 1e-300), 0.0, 1.0)
        far = ((p - t[:, None] * u) ** 2).sum(axis=1) > self.tolerance**2
        return np.unique(self.ends[far])


def rounds_of_refit(
    vertices: FloatArray, faces: IntArray, samples: Samples, *, held: Held | None = None, until: float | None = None
) -> Iterator[Round]:
    """Yield where the vertices are: at the start, and after each round.

    Parameters
    ----------
    vertices : (V, 3) float array
        Of the mesh, all used.
    faces : (M, 3) int array
    samples : Samples
        Of the original.
    held : Held, optional
        Break lines: where an edge would leave them, its ends stay where they are at the start.
    until : float, optional
        ``perf_counter()`` after which no round begins.
    """
    pull = PULL * samples.weights.sum() / len(vertices)
    start = vertices
    rim = _Rim.of(faces)
    distances, nearest = distances_to_mesh(samples.points, vertices, faces)
    beside, edge = rim.nearest(vertices, samples.rim)
    yield Round(vertices, distances, beside)
    for _ in range(ROUNDS):
        if until is not None and time.perf_counter() >= until:
            return
        rows = [_on_planes(vertices, faces, samples, nearest), _on_rims(vertices, faces, rim, samples, edge)]
        vertices = _unturned(_fitted(vertices, rows, pull), start, faces, held)
        distances, nearest = distances_to_mesh(samples.points, vertices, faces, nearest)
        beside, edge = rim.nearest(vertices, samples.rim)
        yield Round(vertices, distances, beside)


class _Rows(NamedTuple):
    """Rows of a least-squares problem: that sum over k of shares * (normal . vertex) is value, weighted.

    Attributes
    ----------
    corners : (n, k) int array
        Which vertices.
    shares : (n, k) float array
    normal : (n, 3) float array
    values, weights : (n,) float arrays
    """

    corners: IntArray
    shares: FloatArray
    normal: FloatArray
    values: FloatArray
    weights: FloatArray

    def matrix(self, n_vertices: int) -> sparse.csr_matrix:
        """Return the matrix (n, 3 V), each row times the root of its weight."""
        n, k = self.corners.shape
        values = (self.shares[:, :, None] * self.normal[:, None, :]).reshape(-1)
        values *= np.repeat(np.sqrt(self.weights), 3 * k)
        columns = (3 * self.corners[:, :, None] + np.arange(3)).reshape(-1)
        return sparse.csr_matrix((values, columns, np.arange(0, 3 * k * n + 1, 3 * k)), shape=(n, 3 * n_vertices))


def _on_planes(vertices: FloatArray, faces: IntArray, samples: Samples, nearest: IntArray) -> _Rows:
    """Return that each sample lies on the plane of the triangle nearest to it."""
    normal = _unit(_normals(vertices, faces))
    a, b, c = (vertices[faces[nearest, k]] for k in range(3))
    across = normal[nearest]
    values = (across * samples.points).sum(axis=1)
    return _Rows(faces[nearest], nearest_shares(a, b - a, c - a, samples.points), across, values, samples.weights)


def _on_rims(vertices: FloatArray, faces: IntArray, rim: _Rim, samples: Samples, edge: IntArray) -> _Rows:
    """Return that each sample of a rim lies on the edge nearest to it, as seen from above its triangle."""
    near = edge >= 0
    edge, points = edge[near], samples.rim[near]
    ends = rim.ends[edge]
    a, along = vertices[ends[:, 0]], vertices[ends[:, 1]] - vertices[ends[:, 0]]
    beside = _unit(np.cross(along, _normals(vertices, faces)[rim.face[edge]]))
    square = (along**2).sum(axis=1)
    t = np.clip(((points - a) * along).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    values = (beside * points).sum(axis=1)
    return _Rows(ends, np.column_stack([1.0 - t, t]), beside, values, samples.rim_weights[near])


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (n, 3) of length 1, or 0."""
    length = np.linalg.norm(vectors, axis=1)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0)[:, None])


def _fitted(vertices: FloatArray, rows: list[_Rows], pull: float) -> FloatArray:
    """Return the vertices of least squares, with a pull to where they are."""
    start = vertices.ravel()
    matrices = [one.matrix(len(vertices)) for one in rows if len(one.values)]
    A = sparse.vstack(matrices).tocsr() if len(matrices) > 1 else matrices[0]
    wanted = np.concatenate([np.sqrt(one.weights) * one.values for one in rows])
    # of what is left at the start, so that vertices which fit need not move
    right = A.T @ (wanted - A @ start)
    normal_matrix = (A.T @ A + pull * sparse.identity(len(start))).tocsr()
    scaled = linalg.LinearOperator(
        (len(start), len(start)), matvec=(1.0 / normal_matrix.diagonal()).__mul__, dtype=float
    )
    rounding = np.finfo(float).eps * float(np.linalg.norm(normal_matrix @ start))
    step, _ = linalg.cg(normal_matrix, right, rtol=CLOSE, atol=rounding, maxiter=MOST_STEPS, M=scaled)
    return np.asarray(start + step).reshape(-1, 3)


def _unturned(vertices: FloatArray, start: FloatArray, faces: IntArray, held: Held | None) -> FloatArray:
    """Return the vertices, but some where they were at the start.

    These are those of triangles that have turned over since, and of edges that have left the lines they stand for.
    """
    before, wanted, vertices = _normals(start, faces), vertices, vertices.copy()
    tries = np.zeros(len(vertices), np.int64)
    while True:  # each time more of them are back
        back = np.unique(faces[(_normals(vertices, faces) * before).sum(axis=1) < 0.0])
        tries[back] = TRIES
        if held is not None:
            left = held.left(vertices)
            back = np.union1d(back, left)
            tries[left] += 1
        back = back[(vertices[back] != start[back]).any(axis=1)]
        if len(back) == 0:
            return vertices
        share = np.where(tries[back] < TRIES, 0.5 ** tries[back], 0.0)[:, None]
        vertices[back] = np.where(share > 0.0, start[back] + share * (wanted[back] - start[back]), start[back])


def _normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return the normals (M, 3) of triangles, twice as long as their areas."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)
