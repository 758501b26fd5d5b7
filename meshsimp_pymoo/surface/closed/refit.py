"""Vertices moved off the original ones to where a closed mesh of the same triangles fits the original best.

The original is sampled at its vertices and at the centres of its faces. In each round every sample is taken to lie on
the triangle that is nearest to it, among those around the one before, and the vertices are moved to where the sum of
the squared distances to the planes of these triangles is least (point-to-plane, Chen and Medioni [1]_), with a small
pull towards where they are. Slipping along the surface costs nothing so, which is what makes a few rounds enough.
Where a triangle would turn over, as in thin parts, its vertices stay where they were at first.

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

# Rounds, and what holds vertices where they are: this share of what a sample weighs, times the samples a vertex.
ROUNDS = 10
PULL = 0.01
# Conjugate gradients end where so much of the residual is left, or after so many steps: rounds go on from there.
CLOSE = 1e-6
MOST_STEPS = 200
# So often the way of a vertex of a break line is halved until its edges are near enough to the line; then it is none.
TRIES = 4


class Round(NamedTuple):
    """Where the vertices are, and how far the samples of the original are from their mesh.

    Attributes
    ----------
    vertices : (V, 3) float array
    distances : (K,) float array
    """

    vertices: FloatArray
    distances: FloatArray


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
    vertices: FloatArray,
    faces: IntArray,
    samples: FloatArray,
    weights: FloatArray,
    *,
    held: Held | None = None,
    until: float | None = None,
) -> Iterator[Round]:
    """Yield where the vertices are: at the start, and after each round.

    Parameters
    ----------
    vertices : (V, 3) float array
        Of the mesh, all used.
    faces : (M, 3) int array
    samples : (K, 3) float array
        Of the original; consecutive ones should be close to each other.
    weights : (K,) float array
        What each counts.
    held : Held, optional
        Break lines: where an edge would leave them, its ends stay where they are at the start.
    until : float, optional
        ``perf_counter()`` after which no round begins.
    """
    pull = PULL * weights.sum() / len(vertices)
    start = vertices
    distances, nearest = distances_to_mesh(samples, vertices, faces)
    yield Round(vertices, distances)
    for _ in range(ROUNDS):
        if until is not None and time.perf_counter() >= until:
            return
        vertices = _unturned(_fitted(vertices, faces, samples, weights, nearest, pull), start, faces, held)
        distances, nearest = distances_to_mesh(samples, vertices, faces, nearest)
        yield Round(vertices, distances)


def _fitted(
    vertices: FloatArray, faces: IntArray, samples: FloatArray, weights: FloatArray, nearest: IntArray, pull: float
) -> FloatArray:
    """Return the vertices of least squares, where sample k lies on triangle ``nearest[k]``."""
    normal = _normals(vertices, faces)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    a, b, c = (vertices[faces[nearest, k]] for k in range(3))
    share = nearest_shares(a, b - a, c - a, samples)
    # one row a sample: sum over corners of share * normal . vertex = normal . sample
    n, across = len(vertices), normal[nearest]
    values = (share[:, :, None] * across[:, None, :]).reshape(-1)
    columns = (3 * faces[nearest][:, :, None] + np.arange(3)).reshape(-1)
    A = sparse.csr_matrix((values, columns, np.arange(0, 9 * len(samples) + 1, 9)), shape=(len(samples), 3 * n))
    root = np.sqrt(weights)
    A.data *= np.repeat(root, 9)
    start = vertices.ravel()
    # of what is left at the start, so that vertices which fit need not move
    right = A.T @ (root * (across * samples).sum(axis=1) - A @ start)
    normal_matrix = (A.T @ A + pull * sparse.identity(3 * n)).tocsr()
    scaled = linalg.LinearOperator((3 * n, 3 * n), matvec=(1.0 / normal_matrix.diagonal()).__mul__, dtype=float)
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
