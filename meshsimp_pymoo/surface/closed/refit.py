"""Vertices moved off the original ones to where a closed mesh of the same triangles fits the original best.

The original is sampled at its vertices and at the centres of its faces. In each round every sample is taken to lie on
the triangle that is nearest to it, among those around the one before, and the vertices are moved to where the sum of
the squared distances to the planes of these triangles is least (point-to-plane, Chen and Medioni [1]_), with a small
pull towards where they are. Slipping along the surface costs nothing so, which is what makes a few rounds enough.

References
----------
.. [1] Y. Chen, G. Medioni, "Object modelling by registration of multiple range images", Image and Vision Computing 10,
   1992.
"""

from __future__ import annotations

import time

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh

# Rounds, and what holds vertices where they are: this share of what a sample weighs, times the samples a vertex.
ROUNDS = 6
PULL = 0.02


def moved_vertices(
    vertices: FloatArray,
    faces: IntArray,
    samples: FloatArray,
    weights: FloatArray,
    *,
    rounds: int = ROUNDS,
    until: float | None = None,
) -> list[FloatArray]:
    """Return where the vertices are after each round.

    Parameters
    ----------
    vertices : (V, 3) float array
        Of the mesh, all used.
    faces : (M, 3) int array
    samples : (K, 3) float array
        Of the original.
    weights : (K,) float array
        What each counts.
    rounds : int
    until : float, optional
        ``perf_counter()`` after which no round begins.
    """
    pull = PULL * weights.sum() / len(vertices)
    found = []
    for _ in range(rounds):
        if until is not None and time.perf_counter() >= until:
            break
        _, nearest = distances_to_mesh(samples, vertices, faces)
        vertices = _fitted(vertices, faces, samples, weights, nearest, pull)
        found.append(vertices)
    return found


def _fitted(
    vertices: FloatArray, faces: IntArray, samples: FloatArray, weights: FloatArray, nearest: IntArray, pull: float
) -> FloatArray:
    """Return the vertices of least squares, where sample k lies on triangle ``nearest[k]``."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    u, v = b - a, c - a
    normal = np.cross(u, v)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    share = _shares(a[nearest], u[nearest], v[nearest], samples)
    # one row a sample: sum over corners of share * normal . vertex = normal . sample
    n, across = len(vertices), normal[nearest]
    values = (share[:, :, None] * across[:, None, :]).reshape(-1)
    columns = (3 * faces[nearest][:, :, None] + np.arange(3)).reshape(-1)
    A = sparse.csr_matrix((values, columns, np.arange(0, 9 * len(samples) + 1, 9)), shape=(len(samples), 3 * n))
    At = (A.multiply(weights[:, None])).T.tocsr()
    normal_matrix = (At @ A + pull * sparse.identity(3 * n)).tocsc()
    right = At @ (across * samples).sum(axis=1) + pull * vertices.ravel()
    return np.asarray(linalg.spsolve(normal_matrix, right)).reshape(-1, 3)


def _shares(a: FloatArray, u: FloatArray, v: FloatArray, points: FloatArray) -> FloatArray:
    """Return the barycentric coordinates (K, 3) of the point of each triangle that is nearest to each point."""
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


def folded_edges(vertices: FloatArray, faces: IntArray, most: float) -> IntArray:
    """Return how many edges have two faces that turn against each other by more than ``most`` degrees."""
    table = edge_table(faces)
    two = table.first[table.n_triangles == 2]
    n_faces = len(faces)
    one, other = table.order[two] % n_faces, table.order[two + 1] % n_faces
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    return np.asarray(((normal[one] * normal[other]).sum(axis=1) < np.cos(np.radians(most))).sum())
