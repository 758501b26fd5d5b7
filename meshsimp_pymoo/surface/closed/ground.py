"""What does not change while a closed surface is searched, in the record that its compiled functions work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.plane.constraints import NO_CONSTRAINTS, Constraints
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.rules import Rules


class ClosedGround(NamedTuple):
    """A model's arrays and the rules, as the compiled functions want them; N vertices.

    What a deviation costs is as for height surfaces (see `surface.costs`), whose names these are.
    """

    xy: np.ndarray  # (2 N,) images in the unit square
    xyz: np.ndarray  # (3 N,) the vertices [model units]
    pole: np.ndarray  # (3,) vertices of the face that is the outside
    exact_area: float  # up to where double precision is exact, see plane.predicates
    exact_lift: float
    lines: Constraints  # forced edges: none
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
        pole=np.ascontiguousarray(model.pole, np.int64),
        exact_area=area,
        exact_lift=lift,
        lines=NO_CONSTRAINTS,
        weight=weight,
        weighed=power > 1 or len(weight) > 0,
        power=power,
        scale=1.0 / model.diagonal if power == 8 else 1.0,
        own=1.0,
        bound=np.inf,
        by_peak=not OBJECTIVES[rules.measure].is_sum,
    )
