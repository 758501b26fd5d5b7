"""Wishes for one mesh of a front: limits of its measures, what they mean together, and which measure is searched.

With a number of triangles the most accurate mesh within the limits is wanted, without one the smallest. Nothing heavy
is imported here, because ``meshsimp --help`` reads it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from numbers import Real
from typing import Any

from meshsimp_pymoo.surface.measures import LENGTH, MEASURES, OBJECTIVES
from meshsimp_pymoo.surface.units import in_unit

# Moves where no budget is given, about ten seconds of two cores.
USUAL_BUDGET = 10_000_000
# What each wish for an error lowers.
SEARCHED = {name: measure.searched for name, measure in MEASURES.items() if measure.searched}


def checked_limits(limits: Mapping[str, float | None]) -> dict[str, float]:
    """Return the limits that are given, in the table's order.

    Raises
    ------
    TypeError
        If none is given, or one is no number.
    ValueError
        If one is no number of triangles or no error.
    """
    given = {name: limit for name in MEASURES if (limit := limits.get(name)) is not None}
    if not given:
        raise TypeError(f"nothing is wished for; give one or more of {', '.join(wished())}, such as triangles=500")
    require_numbers(given)
    found: dict[str, float] = {}
    for name, limit in given.items():
        if name == "triangles":
            if not (1 <= limit < math.inf and limit == int(limit)):
                raise ValueError(f"triangles={limit} is no number of triangles; give 1 or more")
            found[name] = int(limit)
        else:
            if not (limit >= 0 and math.isfinite(limit)):
                raise ValueError(f"{name}={limit} is no error; give 0 or more")
            found[name] = float(limit)
    return found


def require_numbers(limits: Mapping[str, Any]) -> None:
    """Raise a TypeError if a limit is no number."""
    for name, limit in limits.items():
        if not isinstance(limit, Real):
            raise TypeError(f"{name}={limit!r} is no number; give one, such as {name}=500")


def wished() -> list[str]:
    """Return the measures that a mesh can be wished for by."""
    return [name for name, measure in MEASURES.items() if measure.wish]


def measure_for(limits: Mapping[str, float], given: str | None = None) -> str:
    """Return the measure that is searched for these limits.

    It is that of the wish; of several wishes a sum, beside which the others hold. With a number of triangles it is the
    one that is given, if one is, and all limits of other measures hold beside it; a maximum does so anyway.

    Raises
    ------
    ValueError
        If another measure is given than one that is wished for.
    """
    searched = [SEARCHED[name] for name in limits if name in SEARCHED]
    sums = [name for name in searched if OBJECTIVES[name].is_sum]
    if "triangles" in limits or not searched:
        return given or (sums or ["error"])[-1]
    if given is None:
        return (sums or searched)[-1]
    if given not in searched:
        names = " and ".join(name for name in limits if name in SEARCHED)
        raise ValueError(
            f"a wish for {names} lowers that measure, and {given} was named as the one to lower; leave one of them out"
        )
    return given


def beside(limits: Mapping[str, float], measure: str) -> dict[str, float]:
    """Return the limits that hold beside the triangles and the measure that is searched."""
    return {name: limit for name, limit in limits.items() if name in SEARCHED and SEARCHED[name] != measure}


def in_words(limits: Mapping[str, float], unit: str = LENGTH) -> str:
    """Return limits as people say them, lengths with their unit where it is known.

    >>> in_words({"triangles": 5000, "max_error": 0.25}), in_words({"max_error": 0.25}, "m")
    ('at most 5,000 triangles and a max error of at most 0.25', 'a max error of at most 0.25 m')
    """
    behind = in_unit(unit)
    said = [
        f"at most {limit:,} triangles"
        if name == "triangles"
        else f"a {MEASURES[name].label} of at most {limit:g}{behind * MEASURES[name].is_error}"
        for name, limit in limits.items()
    ]
    return " and ".join(said)


def shortfall(values: Mapping[str, Any], limits: Mapping[str, float]) -> Any:
    """Return by how much limits are missed, added up, each as a share of it; 0: all hold.

    Parameters
    ----------
    values : mapping of str to float or array
        The measures of a mesh, or of many.
    limits : mapping of str to float
        The most there may be of each.

    Examples
    --------
    >>> shortfall({"max_error": 3.0, "triangles": 10}, {"max_error": 2.0, "triangles": 10})
    0.5
    """
    missed: Any = 0.0
    for name, limit in limits.items():
        over = values[name] - min(limit, sys.float_info.max)  # with one that is infinite it would be no number
        missed = missed + over * (over > 0) / max(limit, 1e-300)
    return missed
