"""The best heights for a mesh whose triangles are fixed: what is left to gain once the vertices are chosen.

With the triangulation fixed in the plane, the surface at each original vertex is a fixed mean of the heights of two or
three kept vertices. The error is then a convex function of those heights h,

    E(h) = sum of w_p sqrt(g_p^2 + r_p^2),    r = A h - z,

with g_p = 0 where a triangle covers p and the distance in the plane to the mesh where none does. For g = 0 this is a
linear programme (least absolute deviations). It is solved by Newton's method on the primal and the dual together, as
Chan, Golub and Mulet do for total variation [1]_: with s = sqrt(r^2 + g^2 + epsilon^2),

    A' y = 0,    s y = w r,

linearised in both h and y, which costs one factorisation of the sparse matrix A' D A a step (D diagonal); epsilon goes
to 0 with the gap. The dual variables y stay balanced (A' y = 0) and within their bounds (|y| <= w) on the way, so that
each step also proves how far the heights can be from the best at most:

    E(h) >= -z . y + sum of g_p sqrt(w_p^2 - y_p^2)    for all h.

References
----------
.. [1] T. F. Chan, G. H. Golub, P. Mulet, "A nonlinear primal-dual method for total variation-based image restoration",
   SIAM J. Scientific Computing 20(6), 1999.
"""

from __future__ import annotations

import time

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

# The search ends where the error is proved to be within this share of the least possible; the true excess, measured
# against linear programming, is then below 1e-4 (see tests/benchmarks/refit.py).
TOLERANCE = 1e-3
# Newton steps; 10 to 30 are usual.
MAX_STEPS = 60
# How close the dual variables come to their bounds in one step.
TO_THE_BOUND = 0.99
# Epsilon in relation to the gap that is left, both per vertex.
SMOOTHING = 0.1


def least_error(
    A: sparse.csr_matrix,
    z: np.ndarray,
    w: np.ndarray,
    gap: np.ndarray,
    start: np.ndarray,
    *,
    tolerance: float = TOLERANCE,
    until: float | None = None,
    held: np.ndarray | None = None,
) -> tuple[np.ndarray, float]:
    """Minimise the sum of w sqrt(gap^2 + (A h - z)^2) over h; see the module's docstring.

    Parameters
    ----------
    A : (n, V) sparse matrix of full column rank
        Shares of the heights at each sample; its rows add up to 1.
    z, w, gap : (n,) float arrays
        Height of each sample, its positive weight and its distance in the plane.
    start : (V,) float array
        Where to begin.
    tolerance : float
        The search ends where the sum is at most this share above the proved bound.
    until : float, optional
        Or where ``time.perf_counter()`` is beyond this, with what is found by then.
    held : (V,) bool array, optional
        Heights that stay as they are; none by default.

    Returns
    -------
    heights : (V,) float array
        The best that was found, no worse than ``start``.
    bound : float
        A proved lower bound of the sum.
    """
    # Heights count from their middle, in units of the deviation at the start, so that numbers are of the order of 1.
    level = float(np.median(z))
    r = A @ start - z
    unit = float((w * np.hypot(gap, r)).sum() / w.sum())
    if unit == 0.0:
        return start, 0.0
    r, g, z = r / unit, gap / unit, (z - level) / unit
    moved = np.ones(len(start), bool) if held is None else ~held
    if not moved.any():
        return start, float((w * np.hypot(g, r)).sum()) * unit
    h = (start - level) / unit
    if held is not None:  # their shares of the heights are known
        z = z - A[:, held] @ h[held]
        A, h = A[:, moved], h[moved]
    At = A.T.tocsr()
    y = np.zeros(len(z))
    least, best = float(w.sum()), h
    bound = 0.0
    epsilon = 1.0
    for _ in range(MAX_STEPS):
        s = np.sqrt(r * r + g * g + epsilon * epsilon)
        slope = w * r / s
        D = (w - y * r / s) / s
        try:
            factors = splu(
                (At @ sparse.diags(D) @ A).tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:  # singular in double precision: as good as it gets
            break
        step = -factors.solve(At @ slope)
        change = A @ step
        if not np.isfinite(change).all():
            break
        # The dual step, balanced by construction, up to the first bound.
        turn = slope - y + D * change
        room = np.where(turn > 0, w - y, w + y)
        limits = room[turn != 0] / np.abs(turn[turn != 0])
        y = y + min(1.0, TO_THE_BOUND * limits.min(initial=np.inf)) * turn
        # The primal step, halved until the smoothed sum falls (Armijo).
        now, descent, length = float((w * s).sum()), float(slope @ change), 1.0
        while length > 1e-4 and smoothed(r + length * change, g, w, epsilon) > now + 1e-4 * length * descent:
            length /= 2.0
        h, r = h + length * step, r + length * change
        value = smoothed(r, g, w, 0.0)
        if value < least:
            least, best = value, h
        proved = float(g @ np.sqrt(np.maximum(w * w - y * y, 0.0)) - y @ z)
        bound = max(bound, proved)
        if least - bound <= tolerance * least or (until is not None and time.perf_counter() > until):
            break
        epsilon = min(epsilon, max(SMOOTHING * (value - proved) / float(w.sum()), 1e-12))
    heights = start.copy()
    heights[moved] = best * unit + level
    return heights, bound * unit


def smoothed(r: np.ndarray, g: np.ndarray, w: np.ndarray, epsilon: float) -> float:
    """Return the sum of w sqrt(r^2 + g^2 + epsilon^2)."""
    return float((w * np.sqrt(r * r + g * g + epsilon * epsilon)).sum())
