"""Which vertices of break lines stay: as few as the tolerance in space allows, so that none meet in the plane.

Lines are thinned where they are, in space, and forced where triangles are, in the plane: the ground of a height
surface, the images of a closed one. Where thinned lines come to cross there, or pass a vertex of another, vertices are
put back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.plane.segments import enclosed_points, meeting_segments
from meshsimp_pymoo.surface.polylines import Runs, farthest_between, thinned


class Chords(NamedTuple):
    """What is left of runs: S straight pieces.

    Attributes
    ----------
    run : (S,) int array
        Of which run each is.
    low, high : (S,) int array
        From where to where in the run.
    ends : (S, 2) int array
        The vertices there.
    """

    run: IntArray
    low: IntArray
    high: IntArray
    ends: IntArray

    def between(self, runs: Runs, s: int) -> IntArray:
        """Return the vertices of the run that chord s stands for, its ends included."""
        return runs.runs[self.run[s]][self.low[s] : self.high[s] + 1]


# Which vertices are put back for another reason: run and position of each.
PutBack = Callable[[Chords], set[tuple[int, int]]]


def thinned_runs(
    runs: Runs,
    places: FloatArray,
    points: FloatArray,
    tolerance: float,
    *,
    farthest_in: FloatArray,
    also: PutBack | None = None,
) -> tuple[list[IntArray], int]:
    """Return which vertices of each run stay, as positions in it, and how many of them were put back.

    Parameters
    ----------
    runs : Runs
        Of vertices, whose pieces do not cross in the plane.
    places : (P, 2) float array
        Where the vertices are in the plane: multiples of 2**-52 in the unit square.
    points : (P, 3) float array
        Where they are in space.
    tolerance : float
        How far a vertex may be from the chord that stands for it, in space.
    farthest_in : (P, 2) or (P, 3) float array
        Where the distances are taken by which it is decided what is put back first: the places or the points.
    also : function, optional
        What else is to be put back, of chords that neither cross nor pass a vertex of another; they are looked at
        again, until it is nothing.
    """
    kept: list[IntArray] = [np.flatnonzero(stays) for stays in thinned([points[run] for run in runs.runs], tolerance)]
    along = [farthest_in[run] for run in runs.runs]
    n_put_back = 0
    while True:
        chords = _chords(runs, kept)
        longer = np.flatnonzero(chords.high - chords.low > 1)
        back: set[tuple[int, int]] = set()
        pairs = meeting_segments(places, chords.ends)
        if len(pairs) == 0:
            passed = enclosed_points(places, np.unique(chords.ends), [chords.between(runs, s) for s in longer.tolist()])
            pairs = np.unique(longer[passed[:, 1]])[:, None]
        for segments in pairs:
            # one of them is longer, as pieces of the lines themselves do not cross
            far = [
                (*farthest_between(along[chords.run[s]], chords.low[s], chords.high[s]), chords.run[s])
                for s in segments[chords.high[segments] - chords.low[segments] > 1]
            ]
            most = max(away for _, away, _ in far)
            back |= {(k, at) for at, away, k in far if away == most}
        if len(pairs) == 0 and also is not None:
            back = also(chords)
        if not back:
            return kept, n_put_back
        for k, at in back:
            kept[k] = np.sort(np.append(kept[k], at))
        n_put_back += len(back)


def _chords(runs: Runs, kept: list[IntArray]) -> Chords:
    run = np.repeat(np.arange(len(kept)), [len(at) - 1 for at in kept])
    low = np.concatenate([at[:-1] for at in kept])
    high = np.concatenate([at[1:] for at in kept])
    ends = np.array([(runs.runs[k][a], runs.runs[k][b]) for k, a, b in zip(run, low, high, strict=True)])
    return Chords(run, low, high, ends)
