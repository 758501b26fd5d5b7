"""What does not change while a height surface is searched, in the record that its compiled functions work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.plane.constraints import NO_CONSTRAINTS, Constraints, make_constraints
from meshsimp_pymoo.plane.emission import SLIVER_HEIGHT
from meshsimp_pymoo.plane.footprint import Footprint, make_footprint
from meshsimp_pymoo.plane.nearest import boxes_of_runs
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.surface.books import RUN
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.rules import Rules


class Ground(NamedTuple):
    """A model's arrays and the rules, as the compiled functions want them; N vertices."""

    xy: np.ndarray  # (2 N,) coordinates in the unit square
    z: np.ndarray  # (N,) heights [model units]
    corners: np.ndarray  # (C,) vertices that triangulating begins with
    has_twins: bool  # whether vertices share a place
    unit: float  # side of the unit square [model units]
    min_height: float  # of a triangle at the hull, in the unit square
    exact_area: float  # up to where double precision is exact, see plane.predicates
    exact_lift: float
    footprint: Footprint  # of side 0: all of the hull
    lines: Constraints  # forced edges
    boxes: np.ndarray  # (2 N / RUN, 4) of the vertices in each node of the tree over runs of them, see bare
    nearest: bool  # whether an uncovered vertex costs its distance
    weight: np.ndarray  # (N,) what each cost is multiplied by, or (0,): 1
    weighed: bool  # whether the cost of a vertex in a sum is not d_p itself, but what weighed_cost makes of it
    power: int  # to which d_p counts in it: 1, 2 or 8
    scale: float  # what d_p is multiplied by before
    own: float  # what the cost by the measure is multiplied by
    bound: float  # what d_p exceeds this by is added
    by_peak: bool  # whether the books know the largest d_p, and the error is that


def make_ground(model: OpenModel, rules: Rules) -> Ground:
    """Return a model's arrays and the rules for the compiled functions; weights are those of the model."""
    xy = np.ascontiguousarray(model.xy)
    extent = np.ptp(xy, axis=0)
    area, lift = exact_ranges(xy)
    by_footprint = rules.footprint == "model"
    footprint = model.footprint if by_footprint else make_footprint(xy, model.faces, np.empty((0, 2)), convex=True)
    weight = np.empty(0) if model.weights is None else model.weights
    power = OBJECTIVES[rules.measure].power
    return Ground(
        xy=xy.ravel(),
        z=np.ascontiguousarray(model.points[:, 2]),
        corners=np.ascontiguousarray(model.corners, np.int64),
        has_twins=bool((xy[1:] == xy[:-1]).all(axis=1).any()),
        unit=float(model.unit),
        min_height=SLIVER_HEIGHT * float(np.hypot(extent[0], extent[1])),
        exact_area=area,
        exact_lift=lift,
        footprint=footprint,
        lines=NO_CONSTRAINTS
        if model.lines is None
        else make_constraints(xy, model.lines.segments, footprint if by_footprint else None),
        boxes=boxes_of_runs(xy, RUN),
        nearest=rules.outside == "nearest",
        weight=weight,
        weighed=power > 1 or len(weight) > 0,
        power=power,
        scale=1.0 / model.diagonal if power == 8 else 1.0,
        own=1.0,
        bound=np.inf,
        by_peak=not OBJECTIVES[rules.measure].is_sum,
    )
