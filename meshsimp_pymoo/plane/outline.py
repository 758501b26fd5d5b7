"""The outline of a mesh in the plane: its hull, its border, and whether one is the other."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.plane.emission import SLIVER_HEIGHT
from meshsimp_pymoo.plane.faces import edge_table


def on_hull(xy: FloatArray) -> IntArray:
    """Return the vertices (N, 2) within the sliver height of the convex hull's edges, ascending.

    Raises
    ------
    ValueError
        If the hull has no area.
    """
    try:
        hull = ConvexHull(xy)
    except QhullError as error:
        raise ValueError(f"the convex hull of {len(xy)} vertices has no area") from error
    tolerance = SLIVER_HEIGHT * float(np.hypot(*np.ptp(xy, axis=0)))
    on = np.zeros(len(xy), bool)
    on[hull.vertices] = True
    normals = np.unique(hull.equations, axis=0)
    candidates = np.flatnonzero(~on)
    for normal in normals:
        distance = xy[candidates] @ normal[:2] + normal[2]
        on[candidates[np.abs(distance) <= tolerance]] = True
    return np.flatnonzero(on)


def outline_edges(xy: FloatArray, faces: IntArray) -> IntArray:
    """Return the edges (E, 2) that may bound the projection of faces (T, 3): borders and folds."""
    a, b, c = (xy[faces[:, k]] for k in range(3))
    up = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]) > 0
    table = edge_table(faces)
    facing = np.add.reduceat(np.tile(up, 3)[table.order].astype(np.int64), table.first)
    bounding = (table.n_triangles == 1) | ((facing > 0) & (facing < table.n_triangles)) | (facing == 0)
    return table.ends[bounding]


def is_convex(xy: FloatArray, outline: IntArray) -> bool:
    """Tell whether the outline (E, 2) is the convex hull of xy (N, 2) and nothing else: the footprint is all of it."""
    ends = xy[outline]
    points = np.concatenate([ends[:, 0], ends[:, 1], ends.mean(axis=1)])
    try:
        hull = ConvexHull(points)
    except QhullError:
        return False
    tolerance = SLIVER_HEIGHT * float(np.hypot(*np.ptp(xy, axis=0)))
    away = np.full(len(points), np.inf)
    for a, b, c in np.unique(hull.equations, axis=0):
        np.minimum(away, np.abs(points[:, 0] * a + points[:, 1] * b + c), out=away)
        if len(hull.equations) > 5000:  # an oval of so many sides: not worth the time, and never a mistake
            return False
    return bool((away <= tolerance).all())
