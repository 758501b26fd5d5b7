"""On which side, inside which circle: the two questions a Delaunay triangulation asks, answered exactly.

All coordinates are those of :class:`~meshsimp_pymoo.surface.model.OpenModel.xy`: multiples of 2**-52 in [0, 1]. Their
differences are therefore exact in double precision, which leaves only products and sums to be guarded. Each predicate
goes through three stages [1]_: plain double precision with an error bound; a longer filter; expansions without error.

Most models are grids, whose cocircular quadruples would always fall through to the last stage. So the callers pass
``exact_area`` and ``exact_lift``: as all coordinates are multiples of a quantum q (a power of two), products below
2**53 q**2 and quartic sums below 2**53 q**4 are computed without any rounding, and the bound there is 0.

References
----------
.. [1] J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric predicates", Discrete &
   Computational Geometry 18, 1997.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from meshsimp_pymoo.compiling.functions import inner

# Shewchuk's bounds, section 4; the differences are exact here, so they hold with room to spare.
ORIENT_BOUND = 3.3306690738754716e-16
CIRCLE_BOUND = 1.1102230246251577e-15
# |det| is at most S**2 / 3 with S the sum of the three squared distances, so this multiple of S**2 bounds the error
# too.
COARSE_CIRCLE_BOUND = CIRCLE_BOUND / 3 * 1.01


@intrinsic
def _fma(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return ``a * b + c`` rounded once; it gives the rounding error of a product."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.fma(*args)

    return types.float64(types.float64, types.float64, types.float64), codegen


@inner
def _two_sum(a: float, b: float) -> tuple[float, float]:
    s = a + b
    bb = s - a
    return s, (a - (s - bb)) + (b - bb)


@inner
def _product_difference(a: float, b: float, c: float, d: float, out: np.ndarray) -> None:
    """Write ``a*b - c*d`` into ``out[:4]`` as an expansion: four doubles, increasing, whose sum is exact."""
    p = a * b
    p_low = _fma(a, b, -p)
    q = -(c * d)
    q_low = -_fma(c, d, q)
    # Two_Two_Sum of (p, p_low) and (q, q_low)
    i, x0 = _two_sum(p_low, q_low)
    j, r = _two_sum(p, i)
    i, x1 = _two_sum(r, q)
    x3, x2 = _two_sum(j, i)
    out[0] = x0
    out[1] = x1
    out[2] = x2
    out[3] = x3


@inner
def _add_double(expansion: np.ndarray, n: int, b: float) -> int:
    """Grow an expansion of ``n`` components by ``b`` in place, dropping zeros; return its new length."""
    q = b
    m = 0
    for k in range(n):
        q, low = _two_sum(q, expansion[k])
        if low != 0.0:
            expansion[m] = low
            m += 1
    if q != 0.0 or m == 0:
        expansion[m] = q
        m += 1
    return m


@inner
def circle_sign_exact(adx: float, ady: float, bdx: float, bdy: float, cdx: float, cdy: float) -> int:
    """Return the sign of the incircle determinant of exact differences, by expansions without error."""
    minor = np.empty(4)
    lift = np.empty(4)
    total = np.empty(200)
    n = 0
    for k in range(3):
        if k == 0:
            x, y, ux, uy, vx, vy = adx, ady, bdx, bdy, cdx, cdy
        elif k == 1:
            x, y, ux, uy, vx, vy = bdx, bdy, cdx, cdy, adx, ady
        else:
            x, y, ux, uy, vx, vy = cdx, cdy, adx, ady, bdx, bdy
        _product_difference(ux, vy, vx, uy, minor)
        _product_difference(x, x, -y, y, lift)
        for i in range(4):
            for j in range(4):
                high = minor[i] * lift[j]
                if high != 0.0:
                    low = _fma(minor[i], lift[j], -high)
                    if low != 0.0:
                        n = _add_double(total, n, low)
                    n = _add_double(total, n, high)
    # The component of largest magnitude is the last one; it carries the sign.
    if n == 0 or total[n - 1] == 0.0:
        return 0
    return 1 if total[n - 1] > 0.0 else -1


@inner
def orient_sign_exact(adx: float, ady: float, bdx: float, bdy: float) -> int:
    """Return the sign of ``adx*bdy - ady*bdx`` without error."""
    p = adx * bdy
    q = ady * bdx
    if p != q:
        return 1 if p > q else -1
    p_low = _fma(adx, bdy, -p)
    q_low = _fma(ady, bdx, -q)
    if p_low == q_low:
        return 0
    return 1 if p_low > q_low else -1


@inner(inline=True)
def orient_sign(adx: float, ady: float, bdx: float, bdy: float, exact_area: float) -> int:
    """Return +1 if p lies left of the line from a to b, -1 if right, 0 if on it; always the exact answer.

    Parameters
    ----------
    adx, ady, bdx, bdy : float
        The differences a - p and b - p of coordinates that are multiples of 2**-52 in [0, 1].
    exact_area : float
        Magnitude up to which double precision is exact for this model (see the module's text); 0 is always valid.
    """
    left = adx * bdy
    right = ady * bdx
    det = left - right
    size = abs(left) + abs(right)
    bound = ORIENT_BOUND * size
    if det > bound:
        return 1
    if det < -bound:
        return -1
    if size <= exact_area:
        return 1 if det > 0.0 else (-1 if det < 0.0 else 0)
    return orient_sign_exact(adx, ady, bdx, bdy)


@inner
def _circle_sign_slow(
    adx: float,
    ady: float,
    bdx: float,
    bdy: float,
    cdx: float,
    cdy: float,
    det: float,
) -> int:
    alift = adx * adx + ady * ady
    blift = bdx * bdx + bdy * bdy
    clift = cdx * cdx + cdy * cdy
    permanent = (
        alift * (abs(bdx * cdy) + abs(cdx * bdy))
        + blift * (abs(cdx * ady) + abs(adx * cdy))
        + clift * (abs(adx * bdy) + abs(bdx * ady))
    )
    bound = CIRCLE_BOUND * permanent
    if det > bound:
        return 1
    if det < -bound:
        return -1
    # The corners of an upright rectangle, the commonest tie of all: two differences vanish, the third point is their
    # sum.
    if (adx == 0.0 and bdy == 0.0 and cdx == bdx and cdy == ady) or (
        ady == 0.0 and bdx == 0.0 and cdx == adx and cdy == bdy
    ):
        return 0
    if (bdx == 0.0 and cdy == 0.0 and adx == cdx and ady == bdy) or (
        bdy == 0.0 and cdx == 0.0 and adx == bdx and ady == cdy
    ):
        return 0
    if (cdx == 0.0 and ady == 0.0 and bdx == adx and bdy == cdy) or (
        cdy == 0.0 and adx == 0.0 and bdx == cdx and bdy == ady
    ):
        return 0
    return circle_sign_exact(adx, ady, bdx, bdy, cdx, cdy)


@inner(inline=True)
def circle_sign(adx: float, ady: float, bdx: float, bdy: float, cdx: float, cdy: float, exact_lift: float) -> int:
    """Return +1 if p lies inside the circle through a, b, c (counter-clockwise), -1 outside, 0 on it; always exact.

    Parameters
    ----------
    adx, ady, bdx, bdy, cdx, cdy : float
        The differences a - p, b - p and c - p of coordinates that are multiples of 2**-52 in [0, 1].
    exact_lift : float
        Sum of squared distances up to which double precision is exact for this model; 0 is always valid.
    """
    alift = adx * adx + ady * ady
    blift = bdx * bdx + bdy * bdy
    clift = cdx * cdx + cdy * cdy
    det = alift * (bdx * cdy - cdx * bdy) + blift * (cdx * ady - adx * cdy) + clift * (adx * bdy - bdx * ady)
    size = alift + blift + clift
    bound = COARSE_CIRCLE_BOUND * size * size
    if det > bound:
        return 1
    if det < -bound:
        return -1
    if size <= exact_lift:
        return 1 if det > 0.0 else (-1 if det < 0.0 else 0)
    return _circle_sign_slow(adx, ady, bdx, bdy, cdx, cdy, det)


def exact_ranges(xy: np.ndarray) -> tuple[float, float]:
    """Return (exact_area, exact_lift): up to where double precision makes no rounding error on these coordinates.

    Parameters
    ----------
    xy : (N, 2) float array
        Coordinates, multiples of 2**-52 in [0, 1].

    Returns
    -------
    tuple of float
        2**52 q**2 and 2**25 q**2, with q the largest power of two of which every coordinate is a multiple: products
        then have at most 53 bits, and so have the quartic sums.
    """
    integers = np.ldexp(xy, 52).astype(np.int64)
    bits = int(np.bitwise_or.reduce(integers, axis=None)) if integers.size else 0
    quantum = float(bits & -bits) * 2.0**-52 if bits else 1.0
    return 2.0**52 * quantum**2, 2.0**25 * quantum**2
