"""Whether a vertex lies inside the circle of a triangle, ghosts and ties included.

Four cocircular vertices are told apart by position, and what is beyond the hull has ghosts for triangles, as in
:mod:`~meshsimp_pymoo.plane.triangulation`.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.predicates import circle_sign, orient_sign
from meshsimp_pymoo.plane.triangulation import LAST_INDEX


@inner(inline=True)
def turn(xy: np.ndarray, a: int, b: int, c: int, exact_area: float) -> int:
    """Sign of the area of vertices (a, b, c)."""
    x = xy[2 * c]
    y = xy[2 * c + 1]
    return orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, exact_area)


@inner
def _ghost_conflict(xy: np.ndarray, a: int, b: int, q: int, exact_area: float) -> bool:
    """Whether q lies beyond the hull edge with exterior left of a -> b, or inside that edge."""
    sign = turn(xy, a, b, q, exact_area)
    if sign != 0:
        return sign > 0
    k = 0 if xy[2 * a] != xy[2 * b] else 1
    low = min(xy[2 * a + k], xy[2 * b + k])
    high = max(xy[2 * a + k], xy[2 * b + k])
    return low < xy[2 * q + k] < high


@inner
def _tied_conflict(xy: np.ndarray, a: int, b: int, c: int, q: int, exact_area: float) -> bool:
    """Whether q of four cocircular points counts as inside the circle of (a, b, c): the largest index is cut off."""
    last = max(max(a, b), max(c, q))
    if last == q:
        return False
    if last == a:
        return turn(xy, q, b, c, exact_area) > 0
    if last == b:
        return turn(xy, a, q, c, exact_area) > 0
    return turn(xy, a, b, q, exact_area) > 0


@inner(inline=True)
def conflict(xy: np.ndarray, a: int, b: int, c: int, q: int, exact_area: float, exact_lift: float) -> bool:
    """Whether vertex q lies inside the circle of triangle (a, b, c), any of which may be the one at infinity."""
    if q > LAST_INDEX:
        return False
    if (a | b | c) > LAST_INDEX:
        if c > LAST_INDEX:
            return _ghost_conflict(xy, a, b, q, exact_area)
        if a > LAST_INDEX:
            return _ghost_conflict(xy, b, c, q, exact_area)
        return _ghost_conflict(xy, c, a, q, exact_area)
    x = xy[2 * q]
    y = xy[2 * q + 1]
    sign = circle_sign(
        xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, xy[2 * c] - x, xy[2 * c + 1] - y, exact_lift
    )
    if sign != 0:
        return sign > 0
    return _tied_conflict(xy, a, b, c, q, exact_area)
