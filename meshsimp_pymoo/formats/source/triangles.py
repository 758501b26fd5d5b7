"""Triangles as features: what GIS is told of each of them beside its corners."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import AnyArray
from meshsimp_pymoo.formats.outmesh import OutMesh

# The property that makes a feature a triangle of a surface: its number. Readers of lines leave such features out.
TRIANGLE = "triangle"


def properties(mesh: OutMesh) -> dict[str, AnyArray]:
    """Return what is said of each triangle (M,), by name.

    Its number from 0, its mean height [file units of z], its slope [degrees]: 0 where it is level, 90 where it is
    upright, more where it looks down. Units of x and y are made those of z by the ``scale`` of the georeference.

    Examples
    --------
    Half of a roof of 45 degrees:

    >>> points = np.array([[0.0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0]])
    >>> found = properties(OutMesh(points, np.array([[0, 1, 2], [0, 2, 3]]), {}))
    >>> {name: values.round(3).tolist() for name, values in found.items()}
    {'triangle': [0, 1], 'height': [0.667, 0.333], 'slope': [45.0, 45.0]}
    """
    corners = mesh.vertices[mesh.faces]
    x, y = mesh.georeference.get("scale") or (1.0, 1.0)
    sides = (corners[:, 1:] - corners[:, :1]) * [x, y, 1.0]
    normal = np.cross(sides[:, 0], sides[:, 1])
    across = np.hypot(normal[:, 0], normal[:, 1])
    return {
        TRIANGLE: np.arange(len(corners)),
        "height": corners[:, :, 2].mean(axis=1),
        "slope": np.degrees(np.arctan2(across, normal[:, 2])),
    }
