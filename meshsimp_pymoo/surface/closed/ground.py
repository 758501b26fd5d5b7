"""What does not change while a closed surface is searched, in the record that its compiled functions work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.plane.constraints import Constraints, make_constraints
from meshsimp_pymoo.plane.footprint import Footprint
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.closed.nearest import nearest_shares
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.rules import Rules


class ClosedGround(NamedTuple):
    """A model's arrays and the rules, as the compiled functions want them; N vertices.

    What a deviation costs is as for height surfaces (see `surface.costs`), whose names these are.
    """

    xy: np.ndarray  # (2 N,) images in the unit square
    xyz: np.ndarray  # (3 N,) the vertices [model units]
    poles: np.ndarray  # (3 P,) vertices of the faces that are the outside of each part
    part: np.ndarray  # (N,) which part each vertex belongs to, or (0,): all to one
    footprint: Footprint  # where in the plane the surface is; of side 0 if it has no holes
    far: np.ndarray  # (N,) how far each vertex is from the pole of its part, or (0,) where there are no holes
    exact_area: float  # up to where double precision is exact, see plane.predicates
    exact_lift: float
    lines: Constraints  # forced edges: of the poles, if there are several, and of break lines
    weight: np.ndarray  # (N,) what each cost is multiplied by, or (0,): 1
    weighed: bool  # whether the cost of a vertex in a sum is not d_p itself, but what weighed_cost makes of it
    power: int  # to which d_p counts in it: 1, 2 or 8
    scale: float  # what d_p is multiplied by before
    own: float  # what the cost by the measure is multiplied by
    bound: float  # what d_p exceeds this by is added
    by_peak: bool  # whether the books know the largest d_p, and the error is that


def make_ground(model: ClosedModel, rules: Rules) -> ClosedGround:
    """Return a model's arrays and the rules for the compiled functions; weights are those of the model."""
    area, lift = exact_ranges(model.xy)
    weight = np.empty(0) if model.weights is None else model.weights
    power = OBJECTIVES[rules.measure].power
    return ClosedGround(
        xy=np.ascontiguousarray(model.xy).ravel(),
        xyz=np.ascontiguousarray(model.points).ravel(),
        poles=np.ascontiguousarray(model.poles, np.int64).ravel(),
        part=np.ascontiguousarray(model.part, np.int32) if model.n_parts > 1 else np.empty(0, np.int32),
        footprint=model.footprint,
        far=to_poles(model.points, model.poles, model.part) if len(model.rim) else np.empty(0),
        exact_area=area,
        exact_lift=lift,
        lines=_forced_edges(model),
        weight=weight,
        weighed=power > 1 or len(weight) > 0,
        power=power,
        scale=1.0 / model.diagonal if power == 8 else 1.0,
        own=1.0,
        bound=np.inf,
        by_peak=not OBJECTIVES[rules.measure].is_sum,
    )


def to_poles(points: FloatArray, poles: IntArray, part: IntArray) -> FloatArray:
    """Return how far each point (N, 3) is from the pole of its part, which every mesh has."""
    a, b, c = (points[poles[part, k]] for k in range(3))
    _, s, t = nearest_shares(a, b - a, c - a, points).T
    return np.linalg.norm(points - a - s[:, None] * (b - a) - t[:, None] * (c - a), axis=1)


def _forced_edges(model: ClosedModel) -> Constraints:
    """Return the edges that keep parts apart, then those of break lines."""
    segments = [np.empty((0, 2), np.int64)] if model.lines is None else [model.lines.segments]
    n_between = 0
    if model.n_parts > 1:
        between = np.stack([model.poles, np.roll(model.poles, -1, axis=1)], axis=2).reshape(-1, 2)
        segments.insert(0, between)
        n_between = len(between)
    found = make_constraints(model.xy, np.concatenate(segments), model.footprint)
    # what holds an edge of a pole in the mesh is the pole, and it lies on the left of where no other triangle counts
    found.left[:n_between] = 1
    return found
