"""Several vertices at one place of the plane: steps of walls and skirts, and what coarse coordinates put together."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import warn_of
from meshsimp_pymoo.plane.order import unit_square
from meshsimp_pymoo.surface.orient import area_vectors, edge_on

# Coordinates in steps of more than this share of the usual distance of neighbours may have put vertices together.
COARSE_STEP = 0.01


def below_others(xy: FloatArray) -> BoolArray:
    """Tell which vertices (N, 2), in vector order, the highest of a place first, share it with an earlier one: (N,)."""
    below = np.zeros(len(xy), bool)
    below[1:] = (xy[1:] == xy[:-1]).all(axis=1)
    return below


def highest(xy: FloatArray) -> IntArray:
    """Return, for each vertex (N, 2) in that order, the highest one at its place: (N,) rows."""
    return np.maximum.accumulate(np.where(below_others(xy), 0, np.arange(len(xy))))


def feet(points: FloatArray, faces: IntArray, below: BoolArray) -> IntArray:
    """Return the vertices below another one at their place that vertical faces alone hold.

    They are the feet of skirts and of walls around the model, and no samples of the surface that is seen from above.

    Parameters
    ----------
    points : (N, 3) float array
        Vertices in vector order [model units].
    faces : (T, 3) int array
        Triangles.
    below : (N,) bool array
        See :func:`below_others`.

    Returns
    -------
    (K,) int array
        Ascending rows.
    """
    if not below.any():
        return np.empty(0, np.int64)
    holds = np.zeros(len(points), bool)
    holds[faces[~edge_on(area_vectors(points, faces))]] = True
    return np.flatnonzero(below & ~holds)


def count_places(points: FloatArray, faces: IntArray) -> tuple[int, int]:
    """Return how many of the upright vertices (V, 3) of faces lie below another at their place; how many are feet."""
    used, renumbered = np.unique(faces, return_inverse=True)
    upright = points[used] - points[used].min(axis=0)
    _, xy = unit_square(upright)
    order = np.lexsort((-upright[:, 2], xy[:, 1], xy[:, 0]))  # any order will do that keeps places together
    number = np.argsort(order)
    below = below_others(xy[order])
    return int(below.sum()), len(feet(upright[order], number[renumbered.reshape(-1, 3)], below))


def warn_of_places(name: str, file_points: FloatArray, xy: FloatArray, unit: float, n_below: int, n_feet: int) -> None:
    """Warn that vertices lie below others, with their number and, where they do not count or may be rounded, with that.

    Parameters
    ----------
    name : str
        What messages call the model.
    file_points : (N, 3) float array
        Vertices as in the file [file units].
    xy : (N, 2) float array
        Vertices in the unit square.
    unit : float
        Its side [model units].
    n_below, n_feet : int
        How many lie below another one, and how many of these are feet.
    """
    ignored = f"; {n_feet} of them, feet of vertical faces, do not count in the error" if n_feet else ""
    step = float(np.spacing(np.abs(file_points).max().astype(np.float32)))
    usual = unit * float(np.sqrt(np.ptp(xy, axis=0).prod() / len(xy)))
    coarse = ""
    if step > COARSE_STEP * usual and (file_points == file_points.astype(np.float32)).all():
        coarse = (
            f"; coordinates in single precision, here in steps of {step:g}, may have put them together: export the "
            "model in double precision, or from a local origin"
        )
    warn_of(
        f"{name}: {n_below} of {len(xy)} vertices lie below another one at their (x, y); of those that are kept the "
        f"highest carries the surface{ignored}{coarse}"
    )
