"""What single precision does to coordinates, and the origin from which it does them no harm."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import FloatArray

# Share of the model's diagonal; a larger shift of a vertex is worth a warning.
SINGLE_PRECISION_LOSS = 1e-6


def local_origin(vertices: FloatArray) -> FloatArray:
    """Return the origin (3,) from which single precision holds vertices (V, 3): 0 if that does, else whole units.

    >>> local_origin(np.array([[0.0, 0.5, 1.0], [1.0, 1.0, 2.0]])).tolist()
    [0.0, 0.0, 0.0]
    >>> local_origin(np.array([[500000.1, 5400000.1, 7.5], [500001.1, 5400001.1, 8.5]])).tolist()
    [500000.0, 5400000.0, 7.0]
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0))) if len(vertices) else 0.0
    if single_precision_shift(vertices) <= SINGLE_PRECISION_LOSS * diagonal:
        return np.zeros(3)
    return np.asarray(np.floor(vertices.min(axis=0)), dtype=np.float64)


def single_precision_shift(vertices: FloatArray, scale: FloatArray | float = 1.0) -> float:
    """Return by how much single precision moves the vertices at most, along an axis [their units times the scale]."""
    return float((np.abs(vertices - vertices.astype(np.float32)) * scale).max(initial=0.0))
