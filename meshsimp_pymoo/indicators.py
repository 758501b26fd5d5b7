"""How good a front is: hypervolume ratio, multiplicative epsilon, coverage, cardinality, beside pymoo's own.

All objectives are minimised. One rule holds for every function and class here: its arguments are first
reduced to their *fronts* (distinct rows that no other row dominates, see `non_dominated`), so that duplicates
and dominated solutions change nothing. An empty front, NaN and infinity are refused: a missing result must
not score as a perfect one (pymoo's indicators give 0 to an empty set, which for epsilon is the best value
there is).

The pure functions carry the mathematics, the classes adapt them to `pymoo.core.indicator.Indicator`:

========================  ====================  ==============  ===============================
class                     function              better when     value for the reference itself
========================  ====================  ==============  ===============================
`HypervolumeRatio`        `hypervolume_ratio`   larger          1
`MultiplicativeEpsilon`   `epsilon`             smaller         1
`Coverage`                `coverage`            larger          1
`Cardinality`             `cardinality`         larger          its number of solutions
========================  ====================  ==============  ===============================
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import moocore
import numpy as np
from numpy.typing import ArrayLike
from pymoo.core.indicator import Indicator

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.reprs import as_made

__all__ = [
    "REFERENCE",
    "Cardinality",
    "Coverage",
    "HypervolumeRatio",
    "MultiplicativeEpsilon",
    "cardinality",
    "checked_objectives",
    "coverage",
    "epsilon",
    "hypervolume_ratio",
    "knee",
    "merged_front",
    "non_dominated",
]


# The reference point of the hypervolume after normalisation, the same in every objective. At 1 the two ends
# of the optimal front would not count at all; 1.1 is the usual choice that lets them count a little.
REFERENCE = 1.1


def non_dominated(F: ArrayLike, name: str = "F") -> FloatArray:
    """Return the front of a set of solutions: the distinct rows that no other row dominates.

    Parameters
    ----------
    F : (n, m) array-like
        Objectives, all minimised; n and m at least 1.
    name : str
        What to call ``F`` in an error message.

    Returns
    -------
    (k, m) float array
        The front, sorted by the last objective (the triangles) and then by the others.

    Raises
    ------
    ValueError
        If ``F`` is empty, not two-dimensional, or holds NaN or infinity.

    Examples
    --------
    Of two meshes with 4 triangles only the more accurate one stays, and it stays once:

    >>> non_dominated([[0.0, 4], [1.0, 2], [0.5, 4], [0.0, 4]])
    array([[1., 2.],
           [0., 4.]])
    """
    points = checked_objectives(F, name)
    if points.shape[1] == 1:
        return points.min(axis=0, keepdims=True)
    front = points[moocore.is_nondominated(points, keep_weakly=False)]
    return front[np.lexsort(front.T)]


def merged_front(fronts: Iterable[ArrayLike]) -> FloatArray:
    """Return what several runs found together: their solutions as one front.

    Parameters
    ----------
    fronts : iterable of (n, m) array-like
        Objectives, all minimised, such as ``result.F`` of each run.

    Returns
    -------
    (k, m) float array
        As from `non_dominated`.

    Raises
    ------
    ValueError
        If there is none, one of them is empty or not finite, or they differ in the number of objectives.

    Examples
    --------
    >>> merged_front([[[3.0, 2], [1.0, 6]], [[2.0, 4], [1.0, 8]]])
    array([[3., 2.],
           [2., 4.],
           [1., 6.]])
    """
    return non_dominated(np.vstack([checked_objectives(F, f"front {k}") for k, F in enumerate(fronts)]))


def hypervolume_ratio(
    front: ArrayLike,
    optimal: ArrayLike,
    *,
    ideal: ArrayLike | None = None,
    nadir: ArrayLike | None = None,
    reference: float = REFERENCE,
) -> float:
    """Return the hypervolume of a front as a share of the (pseudo-)optimal front's: HVR, 1 is best.

    Both fronts are normalised by the same fixed bounds, ``(F - ideal) / (nadir - ideal)``, and measured up to
    the point ``(reference, ..., reference)``. The bounds are those of the optimal front unless they are
    given; where a bound has no extent (an optimal front of one point), the objective is divided by
    ``abs(ideal)`` instead, or by 1 if that is 0. Solutions beyond the reference point count nothing. The
    ratio exceeds 1 only where ``front`` beats ``optimal``, that is, where ``optimal`` is not optimal.

    Parameters
    ----------
    front, optimal : (n, m), (p, m) array-like
        Objectives, all minimised. The pseudo-optimal front merges every method and run on the same model.
    ideal, nadir : (m,) array-like, optional
        Bounds of the normalisation, e.g. of all runs of a study.
    reference : float
        Reference point in normalised objectives, more than 1.

    Returns
    -------
    float
        0 if nothing in ``front`` dominates the reference point.

    Raises
    ------
    ValueError
        If a front is empty or not finite, the bounds are not, or ``optimal`` itself has no hypervolume.

    References
    ----------
    .. [1] D. A. Van Veldhuizen, "Multiobjective evolutionary algorithms: classifications, analyses, and new
       innovations", 1999.
    .. [2] E. Zitzler and L. Thiele, "Multiobjective evolutionary algorithms: a comparative case study and the
       strength Pareto approach", IEEE TEC 3(4), 1999.

    Examples
    --------
    With only the middle one of three optimal meshes, (1.1 - 0.5) ** 2 = 0.36 of 0.46 is left:

    >>> optimal = [[0, 20], [1, 15], [2, 10]]
    >>> round(hypervolume_ratio([[1, 15]], optimal), 6)
    0.782609
    >>> hypervolume_ratio(optimal, optimal)
    1.0
    """
    own, best = _comparable(front, optimal, "the front", "the optimal front")
    low, scale = _bounds(best, ideal, nadir)
    if not reference > 1 or not np.isfinite(reference):
        raise ValueError(
            f"the reference point is {reference}, in units of the optimal front: it must be finite and more "
            f"than 1, or the ends of the optimal front count nothing; {REFERENCE} is the usual choice"
        )
    whole = _volume(best, low, scale, reference)
    if not whole > 0:
        raise ValueError(
            f"no solution of the optimal front dominates the reference point {low + reference * scale}; "
            "give an ideal and a nadir that contain the optimal front"
        )
    return _volume(own, low, scale, reference) / whole


# Less than any quotient of objectives that are not 0.
TINY = 1e-300


def epsilon(A: ArrayLike, B: ArrayLike, *, shift: ArrayLike = 0.0) -> float:
    """Return the multiplicative epsilon indicator I(A, B): the factor by which A must improve to cover B.

    I(A, B) is the least factor such that for every solution b of B some a of A has ``a_i <= I * b_i`` in
    every objective [1]_: ``max over b, min over a, max over i of a_i / b_i``. At most 1 exactly if A weakly
    dominates B.

    **Zero objectives** are taken literally, as the inequality has them, nothing is added to them: where
    ``b_i`` is 0 (the full mesh has no error), only solutions with ``a_i`` = 0 reach b, whatever the factor,
    and for those the objective asks nothing. So the result is ``inf`` if B reaches an error of 0 and A does
    not. (A solution that is 0 in *every* objective counts 1 when it is matched, to keep I(A, A) = 1.) A
    ``shift`` more than 0 is added to all values of both fronts first, for those who need a finite number; it
    is part of the result's definition and has to be reported with it.

    Parameters
    ----------
    A, B : (n, m), (p, m) array-like
        Objectives, all minimised, none negative.
    shift : float or (m,) array-like
        Added to the objectives of both fronts [units of the objectives].

    Returns
    -------
    float
        0 < I <= inf, 1 for I(A, A).

    Raises
    ------
    ValueError
        If a front is empty, not finite or has negative values.

    References
    ----------
    .. [1] E. Zitzler, L. Thiele, M. Laumanns, C. M. Fonseca and V. Grunert da Fonseca, "Performance
       assessment of multiobjective optimizers: an analysis and review", IEEE TEC 7(2), 2003.

    Examples
    --------
    A mesh with 4 triangles has to lose a fifth of its error to be as good as one with an error of 2:

    >>> epsilon([[2.5, 4]], [[2.0, 4]])
    1.25
    >>> epsilon([[2.5, 4]], [[0.0, 9]])
    inf
    """
    front_a, front_b = _comparable(A, B, "A", "B")
    added = np.asarray(shift, dtype=float)
    if not np.all(np.isfinite(added)) or np.any(added < 0) or added.shape not in ((), front_a.shape[1:]):
        raise ValueError(
            f"the shift is {added}: it must be one finite number, or one for each of the "
            f"{front_a.shape[1]} objectives, and not negative"
        )
    for name, front in (("A", front_a), ("B", front_b)):
        if np.any(front < 0):
            raise ValueError(
                f"{name} has negative objectives (least: {front.min()}): a factor between values of unlike "
                "sign says nothing; use the additive epsilon, pymoo.indicators.epsilon.Epsilon"
            )
    a, b = front_a + added, front_b + added
    if a.all() and b.all():
        return float(moocore.epsilon_mult(a, ref=b))
    # moocore refuses zeros: one in A is as good as any tiny number, solutions of B with one are for the definition, and
    # so are all where A has a solution of nothing but zeros
    reachable = b.all(axis=1) & a.any(axis=1).all()
    factor = _epsilon_by_definition(a, b[~reachable])
    if reachable.any():
        factor = max(factor, float(moocore.epsilon_mult(np.where(a == 0, TINY, a), ref=b[reachable])))
    return factor


def _epsilon_by_definition(a: FloatArray, b: FloatArray) -> float:
    """Return the factor by which ``a`` must improve to cover ``b``, zeros taken literally; 0 if there is no b."""
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = a[:, None, :] / b[None, :, :]
    factor[np.isnan(factor)] = 0.0  # 0 <= I * 0 holds for every I
    factor = factor.max(axis=2)
    factor[np.ix_(~a.any(axis=1), ~b.any(axis=1))] = 1.0
    return float(factor.min(axis=0).max(initial=0.0))


def coverage(A: ArrayLike, B: ArrayLike) -> float:
    """Return the coverage C(A, B): the share of B's solutions that some solution of A weakly dominates.

    C(A, B) and C(B, A) do not add up to 1: solutions that both fronts hold count in both.

    Parameters
    ----------
    A, B : (n, m), (p, m) array-like
        Objectives, all minimised.

    Returns
    -------
    float
        Between 0 and 1; 1 for C(A, A).

    Raises
    ------
    ValueError
        If a front is empty or not finite.

    References
    ----------
    .. [1] E. Zitzler and L. Thiele, "Multiobjective evolutionary algorithms: a comparative case study and the
       strength Pareto approach", IEEE TEC 3(4), 1999.

    Examples
    --------
    >>> coverage([[1, 2]], [[1, 2], [0, 4]])
    0.5
    """
    a, b = _comparable(A, B, "A", "B")
    covered = np.ones((len(a), len(b)), dtype=bool)
    for i in range(a.shape[1]):
        covered &= a[:, None, i] <= b[None, :, i]
    return float(covered.any(axis=0).mean())


def cardinality(F: ArrayLike) -> int:
    """Return the number of distinct non-dominated solutions.

    Raises
    ------
    ValueError
        If ``F`` is empty or not finite.

    Examples
    --------
    >>> cardinality([[0, 4], [0, 4], [1, 2], [2, 2]])
    2
    """
    return len(non_dominated(F, "the front"))


def knee(front: ArrayLike) -> int:
    """Return the knee of a front: the solution farthest below the line between its ends, scaled to [0, 1].

    There is always exactly one [1]_; of equal ones, the first.

    Parameters
    ----------
    front : (n, 2) array-like
        (error, triangles), non-dominated, in any order.

    Returns
    -------
    int
        Row of ``front``.

    References
    ----------
    .. [1] I. Das, "On characterizing the 'knee' of the Pareto curve based on normal-boundary intersection",
       Structural Optimization 18, 1999.

    Examples
    --------
    >>> knee([[10, 2], [1, 4], [0, 20]])
    1
    """
    F = checked_objectives(front, "the front")
    extent = np.ptp(F, axis=0)
    scaled = (F - F.min(axis=0)) / np.where(extent > 0, extent, 1.0)
    return int(np.argmin(scaled.sum(axis=1).round(12)))


class _FrontIndicator(Indicator):
    """An indicator of fronts as they are: pymoo normalises nothing, an empty front is refused."""

    def do(self, F: ArrayLike, *args: Any, **kwargs: Any) -> float:
        """Return the indicator of the front ``F`` (n, m); a single solution may come as (m,)."""
        points = np.asarray(F)
        return self._do(points[None, :] if points.ndim == 1 and points.size else points, *args, **kwargs)

    __repr__ = as_made


class HypervolumeRatio(_FrontIndicator):
    """Hypervolume of a front over that of the (pseudo-)optimal front ``pf``: see `hypervolume_ratio`.

    Parameters
    ----------
    pf : (p, m) array-like
        The (pseudo-)optimal front.
    ideal, nadir, reference
        The fixed normalisation and reference point, as in `hypervolume_ratio`.

    Examples
    --------
    >>> hvr = HypervolumeRatio([[0, 20], [1, 15], [2, 10]])
    >>> round(hvr([[1, 15]]), 6)                   # or hvr(result.F)
    0.782609
    """

    def __init__(
        self,
        pf: ArrayLike,
        *,
        ideal: ArrayLike | None = None,
        nadir: ArrayLike | None = None,
        reference: float = REFERENCE,
    ) -> None:
        super().__init__()
        self.pf = non_dominated(pf, "the optimal front")
        self.bounds = {"ideal": ideal, "nadir": nadir}
        self.reference = reference
        self.do(self.pf)  # unusable bounds are reported here, not at the first use

    def _do(self, F: ArrayLike) -> float:
        return hypervolume_ratio(F, self.pf, reference=self.reference, **self.bounds)


class MultiplicativeEpsilon(_FrontIndicator):
    """Factor by which a front must improve to cover ``pf``, safe where an error is 0: see `epsilon`.

    Parameters
    ----------
    pf : (p, m) array-like
        The front to be covered.
    shift : float or (m,) array-like
        Added to all objectives first.

    Examples
    --------
    >>> MultiplicativeEpsilon([[2.0, 4]])([[2.5, 4]])
    1.25
    """

    def __init__(self, pf: ArrayLike, *, shift: ArrayLike = 0.0) -> None:
        super().__init__()
        self.pf = non_dominated(pf, "the reference front")
        self.shift = shift
        self.do(self.pf)

    def _do(self, F: ArrayLike) -> float:
        return epsilon(F, self.pf, shift=self.shift)


class Coverage(_FrontIndicator):
    """Share of the front ``pf`` that a front weakly dominates: see `coverage`.

    Parameters
    ----------
    pf : (p, m) array-like
        The front to be covered.

    Examples
    --------
    >>> Coverage([[1, 2], [0, 4]])([[1, 2]])
    0.5
    """

    def __init__(self, pf: ArrayLike) -> None:
        super().__init__()
        self.pf = non_dominated(pf, "the reference front")

    def _do(self, F: ArrayLike) -> float:
        return coverage(F, self.pf)


class Cardinality(_FrontIndicator):
    """Number of distinct non-dominated solutions: see `cardinality`.

    Examples
    --------
    >>> Cardinality()([[0, 4], [0, 4], [1, 2], [2, 2]])
    2.0
    """

    def _do(self, F: ArrayLike) -> float:
        return float(cardinality(F))


def checked_objectives(F: ArrayLike, name: str = "F") -> FloatArray:
    """Return ``F`` as a finite (n, m) float array with n >= 1, or raise a ValueError that says what is wrong.

    Examples
    --------
    >>> checked_objectives([])
    Traceback (most recent call last):
    ValueError: F is empty: it has no solution to score; was its run finished?
    """
    try:
        points = np.asarray(F, dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} is not an array of numbers ({error}); give rows of objectives") from None
    if points.size == 0:
        raise ValueError(f"{name} is empty: it has no solution to score; was its run finished?")
    if points.ndim != 2:
        raise ValueError(f"{name} has the shape {points.shape}: give one row per solution and one column per objective")
    wrong = ~np.isfinite(points).all(axis=1)
    if wrong.any():
        row = int(wrong.argmax())
        raise ValueError(
            f"{name} has {int(wrong.sum())} of {len(points)} solutions with NaN or infinite objectives "
            f"(first: row {row}, {points[row].tolist()}); remove them, they cannot be compared"
        )
    return points + 0.0  # a copy in which -0.0 is 0.0: equal rows have equal bytes


def _comparable(A: ArrayLike, B: ArrayLike, a: str, b: str) -> tuple[FloatArray, FloatArray]:
    """Return the fronts of A and B, which must have equally many objectives."""
    front_a, front_b = non_dominated(A, a), non_dominated(B, b)
    if front_a.shape[1] != front_b.shape[1]:
        raise ValueError(
            f"{a} has {front_a.shape[1]} objectives and {b} has {front_b.shape[1]}: they cannot be compared"
        )
    return front_a, front_b


def _bounds(optimal: FloatArray, ideal: ArrayLike | None, nadir: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
    """Return the ideal point and the scale of every objective (both (m,))."""
    low = optimal.min(axis=0) if ideal is None else np.asarray(ideal, dtype=float)
    high = optimal.max(axis=0) if nadir is None else np.asarray(nadir, dtype=float)
    for name, bound in (("ideal", low), ("nadir", high)):
        if bound.shape != optimal.shape[1:] or not np.isfinite(bound).all():
            raise ValueError(f"the {name} point is {bound}: give {optimal.shape[1]} finite numbers")
    scale = high - low
    if np.any(scale < 0):
        raise ValueError(f"the ideal point {low} exceeds the nadir point {high}: were they swapped?")
    flat = scale == 0
    scale[flat] = np.where(low[flat] == 0, 1.0, np.abs(low[flat]))
    return low, scale


def _volume(front: FloatArray, low: FloatArray, scale: FloatArray, reference: float) -> float:
    """Return the hypervolume of the front, normalised, up to (reference, ..., reference)."""
    with np.errstate(over="ignore"):
        normal = (front - low) / scale
    if normal.shape[1] == 1:
        return max(0.0, float(reference - normal.min()))
    return float(moocore.hypervolume(normal, ref=reference))
