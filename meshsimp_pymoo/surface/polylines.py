"""Polylines as runs between the places where they meet or end, and how these are thinned.

The vertices of polylines are numbers, the same at the same place. What two lines share is one run, whatever else the
lines do, and a run is thinned the same way in whichever direction it is listed.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class Runs:
    """Polylines cut where they meet or end.

    Attributes
    ----------
    runs : list of (n,) int arrays
        Vertices of each, in order; no run twice, and none the reverse of another.
    parts : list of lists of (int, bool)
        Of which runs each polyline consists, and whether these are passed as they are listed.
    """

    runs: list[IntArray]
    parts: list[list[tuple[int, bool]]]

    def joined(self, kept: list[IntArray]) -> list[IntArray]:
        """Return the polylines with each run thinned to those of its vertices, as positions in it, that are kept."""
        thinned = [run[at] for run, at in zip(self.runs, kept, strict=True)]
        lines = []
        for parts in self.parts:
            passed = [thinned[k] if forward else thinned[k][::-1] for k, forward in parts]
            lines.append(np.concatenate([passed[0][:1], *(run[1:] for run in passed)]))
        return lines


def cut_into_runs(lines: list[IntArray], corners: IntArray) -> Runs:
    """Cut polylines where they end, meet or turn back, and at some of their vertices.

    Parameters
    ----------
    lines : list of (n,) int arrays
        Vertices in order, no two neighbours the same.
    corners : (K,) int array
        Vertices that stay whatever happens.

    Examples
    --------
    Two lines that run together from 1 to 3:

    >>> runs = cut_into_runs([np.array([0, 1, 2, 3, 4]), np.array([5, 3, 2, 1])], np.array([], int))
    >>> [run.tolist() for run in runs.runs], runs.parts
    ([[0, 1], [1, 2, 3], [3, 4], [3, 5]], [[(0, True), (1, True), (2, True)], [(3, False), (1, False)]])
    """
    pieces = np.concatenate([np.column_stack([line[:-1], line[1:]]) for line in lines])
    pieces = np.unique(np.sort(pieces, axis=1), axis=0)
    stays = np.bincount(pieces.ravel(), minlength=max(int(pieces.max()), int(corners.max(initial=0))) + 1) != 2
    stays[[end for line in lines for end in (line[0], line[-1])]] = True
    for line in lines:  # where one turns back it runs along with itself from there
        stays[line[1:-1][line[2:] == line[:-2]]] = True
    stays[corners] = True
    runs: list[IntArray] = []
    known: dict[bytes, int] = {}
    parts = []
    for line in lines:
        cuts = np.flatnonzero(stays[line])
        passed = []
        for a, b in itertools.pairwise(cuts):
            run = line[a : b + 1]
            # as it would be listed from its lesser end, or a closed one towards its lesser neighbour
            forward = bool((run[0], run[1]) <= (run[-1], run[-2]))
            run = run if forward else run[::-1]
            k = known.setdefault(run.tobytes(), len(runs))
            if k == len(runs):
                runs.append(run)
            passed.append((k, forward))
        parts.append(passed)
    return Runs(runs, parts)


@inner
def _farthest(points: np.ndarray, a: int, b: int) -> tuple[int, float]:
    """Return which point between a and b is farthest from the segment that they end, the first of several, how far."""
    ux = points[b, 0] - points[a, 0]
    uy = points[b, 1] - points[a, 1]
    uz = points[b, 2] - points[a, 2]
    length = ux * ux + uy * uy + uz * uz
    found = a
    most = -1.0
    for i in range(a + 1, b):
        dx = points[i, 0] - points[a, 0]
        dy = points[i, 1] - points[a, 1]
        dz = points[i, 2] - points[a, 2]
        t = min(max((dx * ux + dy * uy + dz * uz) / length, 0.0), 1.0) if length > 0.0 else 0.0
        dx -= t * ux
        dy -= t * uy
        dz -= t * uz
        away = dx * dx + dy * dy + dz * dz
        if away > most:
            found = i
            most = away
    return found, np.sqrt(max(most, 0.0))


@entry
def _thin(points: np.ndarray, starts: np.ndarray, tolerance: float, kept: np.ndarray) -> None:
    """Mark which points (n, 3) of polylines, joined, stay."""
    # the longer half waits: no more of them than the times that the number of points can be halved
    stack = np.empty((64, 2), np.int64)
    for k in range(len(starts) - 1):
        a, b = starts[k], starts[k + 1] - 1
        kept[a] = True
        kept[b] = True
        is_closed = points[a, 0] == points[b, 0] and points[a, 1] == points[b, 1] and points[a, 2] == points[b, 2]
        depth = 0
        while True:
            far = a
            if b - a > 1:
                far, away = _farthest(points, a, b)
                if not away > tolerance and not is_closed:
                    far = a
            is_closed = False
            if far == a:
                if depth == 0:
                    break
                depth -= 1
                a, b = stack[depth, 0], stack[depth, 1]
                continue
            kept[far] = True
            if far - a > b - far:
                stack[depth, 0], stack[depth, 1] = a, far
                a = far
            else:
                stack[depth, 0], stack[depth, 1] = far, b
                b = far
            depth += 1


def thinned(points: list[FloatArray], tolerance: float) -> list[BoolArray]:
    """Return which vertices of polylines stay: Douglas and Peucker's choice [1]_ in space.

    Both ends stay, and of closed polylines the vertex farthest from them; then those that are farther than
    ``tolerance`` from the segment between the two that stay before and after them, the farthest first.

    Parameters
    ----------
    points : list of (n, 3) float arrays
        The polylines.
    tolerance : float
        In the units of the points.

    Returns
    -------
    list of (n,) bool arrays

    References
    ----------
    .. [1] D. Douglas, T. Peucker, "Algorithms for the reduction of the number of points required to represent a
       digitized line or its caricature", Cartographica 10(2), 1973.

    Examples
    --------
    >>> zigzag = np.array([[0.0, 0, 0], [1, 0, 0.1], [2, 0, 0], [3, 0, 0.5], [4, 0, 0]])
    >>> [int(thinned([zigzag], tolerance)[0].sum()) for tolerance in (0.0, 0.4, 1.0)]
    [5, 3, 2]
    """
    starts = np.concatenate([[0], np.cumsum([len(line) for line in points])]).astype(np.int64)
    kept = np.zeros(starts[-1], np.bool_)
    _thin(np.ascontiguousarray(np.concatenate(points)), starts, float(tolerance), kept)
    return np.split(kept, starts[1:-1])


def farthest_between(points: FloatArray, a: int, b: int) -> tuple[int, float]:
    """Return which vertex between two of a polyline is farthest from the segment that they end, and how far.

    The polyline has vertices (n, 2) or (n, 3).

    Examples
    --------
    >>> farthest_between(np.array([[0.0, 0, 0], [1, 0, 2], [2, 0, 1], [3, 0, 0]]), 0, 3)
    (1, 2.0)
    """
    base, u = points[a], points[b] - points[a]
    between = points[a + 1 : b] - base
    length = float(u @ u)
    t = np.clip(between @ u / length, 0.0, 1.0) if length else np.zeros(len(between))
    away = np.linalg.norm(between - t[:, None] * u, axis=1)
    far = int(away.argmax())
    return a + 1 + far, float(away[far])
