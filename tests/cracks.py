"""Whether a mesh of a rectangle has cracks."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.plane.faces import edge_table


def find_cracks(vertices: np.ndarray, faces: np.ndarray) -> int:
    """Count the edges that break a mesh of a rectangle: not in two triangles, or in one and not on a side.

    Parameters
    ----------
    vertices : (V, 2) or (V, 3) float array
        Positions.
    faces : (M, 3) int array
        Triangles.

    Returns
    -------
    int
        0 where the mesh covers the rectangle without a crack.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    >>> find_cracks(square, np.array([[0, 1, 2], [0, 2, 3]]))
    0
    >>> find_cracks(square, np.array([[0, 1, 2], [0, 4, 3], [4, 2, 3]]))      # the diagonal has a vertex on one side
    3
    """
    table = edge_table(faces)
    ends = vertices[table.ends[table.n_triangles == 1]][:, :, :2]
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    on_side = ((ends == low).all(axis=1) | (ends == high).all(axis=1)).any(axis=1)
    return int((table.n_triangles > 2).sum() + (~on_side).sum())
