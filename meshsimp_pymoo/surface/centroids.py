"""Samples between the vertices: the original surface at the centroids of its faces.

A mesh that is chosen for the error at the vertices can fit these and be wrong between them. The centroids say so: they
are no candidates for a mesh, and no search of subsets lowers the error there by name.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.plane.hilbert import hilbert_keys
from meshsimp_pymoo.plane.nearest import boxes_of_runs
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.surface.books import RUN
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.model import OpenModel

# Coordinates of the plane are multiples of this, see plane.predicates.
QUANTUM = 2.0**-52


def centroids_of(model: OpenModel) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Return the centroids of the original faces that have an area in the plane, along the curve of the vertices.

    Returns
    -------
    xy : (K, 2) float array
        Where they are in the unit square, rounded as the vertices are.
    z : (K,) float array
        Height of the original surface there [model units].
    area : (K,) float array
        Area of each face in the plane, as a share of all; adds up to 1.
    rows : (K,) int array
        The faces.
    """
    xy, faces = model.xy, model.faces
    a, b, c = (xy[faces[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    area = np.abs(ux * vy - uy * vx)
    solid = np.flatnonzero(area > 0.0)
    place = np.rint((a + b + c)[solid] / (3.0 * QUANTUM)) * QUANTUM
    order = np.argsort(hilbert_keys(place), kind="stable")
    solid = solid[order]
    return place[order], model.points[faces[solid], 2].mean(axis=1), area[solid] / area[solid].sum(), solid


class Between(NamedTuple):
    """The centroids as compiled functions want them; K samples."""

    xy: np.ndarray  # (2 K,) coordinates in the unit square
    z: np.ndarray  # (K,) heights of the original surface [model units]
    share: np.ndarray  # (K,) of each face in the area of all, in the plane
    exact_area: float  # up to where double precision is exact on these and the vertices, see plane.predicates


def between_vertices(model: OpenModel) -> Between:
    """Return where a mesh is measured between the vertices of a model."""
    place, z, area, _ = centroids_of(model)
    exact_area = min(exact_ranges(place)[0], exact_ranges(model.xy)[0])
    return Between(np.ascontiguousarray(place).ravel(), z, area, exact_area)


def with_centroids(ground: Ground, model: OpenModel) -> tuple[Ground, FloatArray, IntArray]:
    """Return the ground of a model with its K centroids behind the vertices, as samples, shares (K,) and faces (K,).

    Sites are vertices: what is exact of circles is so of these.
    """
    place, z, area, rows = centroids_of(model)
    xy = np.vstack([model.xy, place])
    both = ground._replace(
        xy=np.ascontiguousarray(xy).ravel(),
        z=np.concatenate([ground.z, z]),
        exact_area=exact_ranges(xy)[0],
        boxes=boxes_of_runs(xy, RUN),
    )
    return both, area, rows
