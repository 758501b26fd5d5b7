"""A twin of the distance to a mesh in space: every pair is asked."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray


def distances(points: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return the distance of each point (P, 3) to the nearest of all triangles: to planes, edges and corners."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    best = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        share = ((points[:, None] - start) * along).sum(axis=2) / (along**2).sum(axis=1)
        foot = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
        best = np.minimum(best, np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    unit = normal / np.where(length > 0, length, 1.0)[:, None]
    height = ((points[:, None] - a) * unit).sum(axis=2)
    foot = points[:, None] - height[:, :, None] * unit
    sides = [(np.cross(e - s, foot - s) * unit).sum(axis=2) >= 0 for s, e in ((a, b), (b, c), (c, a))]
    above = sides[0] & sides[1] & sides[2] & (length > 0)
    return np.minimum(best, np.where(above, np.abs(height), np.inf).min(axis=1))
