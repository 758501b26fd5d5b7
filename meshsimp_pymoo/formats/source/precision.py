"""What single precision does to coordinates, and the origin from which it does them no harm."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray

# Share of the model's diagonal; a larger shift of a vertex is worth a warning.
SINGLE_PRECISION_LOSS = 1e-6


def local_origin(vertices: FloatArray) -> FloatArray:
    """Return the origin (3,) near which single precision holds vertices (V, 3): their lower corner in round numbers.

    Round are whole units, or along an axis on which a model is less than a unit wide a fraction that is a power of two.

    >>> local_origin(np.array([[500000.1, 5400000.1, 7.5], [502001.1, 5400001.1, 8.5]])).tolist()
    [500000.0, 5400000.0, 7.0]
    >>> local_origin(np.array([[13.4, 60.2, 0.0], [13.7, 60.4, 0.2]])).tolist()
    [13.25, 60.125, 0.0]
    """
    if len(vertices) == 0:
        return np.zeros(3)
    extent = np.ptp(vertices, axis=0)
    if not extent.any():
        return np.zeros(3)
    step = 2.0 ** np.minimum(0.0, np.floor(np.log2(np.where(extent > 0, extent, extent.max()))))
    return np.asarray(np.floor(vertices.min(axis=0) / step) * step, dtype=np.float64)


def single_precision_shift(vertices: FloatArray, scale: FloatArray | float = 1.0) -> float:
    """Return by how much single precision moves the vertices at most, along an axis [their units times the scale]."""
    return float((np.abs(vertices - vertices.astype(np.float32)) * scale).max(initial=0.0))


def turned_over(points: FloatArray, faces: IntArray, up: FloatArray) -> int:
    """Return how many triangles that look up have no area or look down where single precision puts their corners.

    Parameters
    ----------
    points : (V, 3) float array
        The vertices, as they are before they lose their double precision.
    faces : (M, 3) int array
        The triangles.
    up : (3,) float array
        The direction to look from; without a length in particular.

    Examples
    --------
    A needle as wide as the numbers beside 1 are apart in double precision, and a triangle:

    >>> points = np.array([[0.0, 0, 0], [1, 1, 0], [0.5, 0.5 + 1e-15, 0], [0, 1, 0]])
    >>> turned_over(points, np.array([[0, 1, 2], [0, 1, 3]]), np.array([0.0, 0, 1]))
    1
    """
    # the products of differences of single numbers that lie close are exact in double precision
    exact, rounded = (_facing(corners, faces, up) for corners in (points, np.float64(np.float32(points))))
    return int(((exact > 0.0) & (rounded <= 0.0)).sum())


def _facing(points: FloatArray, faces: IntArray, up: FloatArray) -> FloatArray:
    """Return twice the area of each triangle as seen from above, negative where it looks down."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a) @ up)
