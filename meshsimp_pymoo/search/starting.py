"""The front that a seeded search starts from: thinning, or as much of it as fits into the time.

Thinning from all vertices takes some ten microseconds for each. Where that is more than a share of the time there is,
greedy insertion finds as many vertices as fit, and these are thinned: from 15 to 30 % of the vertices that is within
some per cent of thinning from all. Where it is stopped on its way, by the clock or by Ctrl-C, it has the large meshes,
and a quick insertion finds small ones.

Grids of heights are inserted into by scanning (:mod:`~meshsimp_pymoo.search.raster`), to 30 % of the vertices within a
second for a million.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import SearchWarning
from meshsimp_pymoo.search.budgets import stopping
from meshsimp_pymoo.search.greedy import NestedFront, can_insert, greedy_insertion, thinning
from meshsimp_pymoo.search.raster import raster_insertion, raster_of
from meshsimp_pymoo.surface.measures import OBJECTIVES, TRIANGLES, measured
from meshsimp_pymoo.surface.surface import Surface
from meshsimp_pymoo.workers import on_threads, threads_for

Found = TypeVar("Found")

# What removing a vertex takes about where all are removed [s], and the share of the time that may be spent on it.
SECONDS_A_REMOVAL = 1.2e-5
START_SHARE = 0.5
# Of that, what inserting takes, the rest is for thinning what was inserted; and what is kept for both where the
# thinning from all vertices takes longer than was thought.
INSERT_SHARE = 0.5
KEPT_SHARE = 0.3
# What both may take together after Ctrl-C [s].
QUICK = 1.2
# Of a grid at most this share of the vertices is thinned, if not all, each of which takes so many times as long; and
# where thinning is stopped, so many of the meshes that insertion has found are measured.
RASTER_THINNED = 0.3
SPARSE = 2.5
MEASURED = 12


@dataclass(frozen=True)
class Start:
    """The meshes of one or more nested fronts, one front above the other.

    Attributes
    ----------
    parts : tuple of NestedFront
        That of the smallest meshes first; no mesh of one has as many triangles as the least of the next.
    seconds : float
        Searches of at most so long start from it: inf for the thinning from all vertices down to the pinned ones, and 0
        for what an interruption has left [s].
    """

    parts: tuple[NestedFront, ...]
    seconds: float = 0.0

    def __repr__(self) -> str:
        return f"<Start of {self.seconds:g} s: {', '.join(map(repr, self.parts))}>"

    @classmethod
    def of(cls, *fronts: NestedFront) -> Start:
        """Put fronts together that are not whole; of each, the meshes as large as those of a later one are left out."""
        parts: list[NestedFront] = []
        least = np.inf
        for front in reversed(fronts):
            too_large = np.flatnonzero(front.triangles >= least)
            n = int(too_large[0]) if len(too_large) else len(front)
            if n:
                parts.insert(0, front.smallest(n))
                least = float(front.triangles[:n].min())
        return cls(tuple(parts))

    @property
    def is_whole(self) -> bool:
        """Whether this is the thinning from all vertices down to the pinned ones."""
        return self.seconds == np.inf

    @cached_property
    def error(self) -> FloatArray:
        """Error of each mesh (K,) [model units]."""
        return np.concatenate([part.error for part in self.parts])

    @cached_property
    def triangles(self) -> IntArray:
        """Triangles of each mesh (K,)."""
        return np.concatenate([part.triangles for part in self.parts])

    def __len__(self) -> int:
        return len(self.error)

    def kept(self, k: int) -> BoolArray:
        """Return subset k as a bool array (N,)."""
        for part in self.parts:
            if k < len(part):
                return part.kept(k)
            k -= len(part)
        raise ValueError(f"there is no subset {len(self) + k}; there are {len(self)}")

    def __str__(self) -> str:
        sizes = [part.triangles[part.triangles > 0] for part in self.parts]  # what is pinned may be no mesh yet
        ends = [(int(own.min()), int(own.max())) for own in sizes if len(own)]
        ranges = [f"{low:,} to {high:,}" if low < high else f"{low:,}" for low, high in ends]
        return f"meshes of {', '.join(ranges)} triangles"


_STARTS: WeakKeyDictionary[Any, Start] = WeakKeyDictionary()


def begun(surface: Surface) -> Start | None:
    """Return what there is of the start of a surface: whole, or as far as the last search came; None: nothing."""
    return _STARTS.get(surface)


def thinned(surface: Surface, seconds: float | None = None) -> Start:
    """Return the thinning of a surface, or what fits into the time; computed once as long as the surface is there.

    Parameters
    ----------
    surface : Surface
        What is thinned.
    seconds : float, optional
        What the search has as a whole: then it is what fits into a share of that. What is there already is taken where
        it was made for a search of at least as long.

    Warns
    -----
    SearchWarning
        If it is not whole.
    """
    seconds = np.inf if seconds is None else seconds
    start = begun(surface)
    if start is not None and start.seconds >= seconds:
        return start
    start = _made(surface, seconds)
    if not start.is_whole:
        warnings.warn(
            f"{surface.model.name}: {seconds:g} s are too short to thin all {surface.n_vertices:,} vertices; the "
            f"search starts from {start}",
            SearchWarning,
            stacklevel=2,
        )
    return start


def at_hand(surface: Surface, seconds: float | None = None) -> Start:
    """Return the start of a surface for the end of a search, which did not begin with it where it is made now.

    Parameters
    ----------
    surface : Surface
        What is thinned.
    seconds : float, optional
        What the search has left: where there is nothing of a start, as in one that was resumed, what fits into a share
        of that. Without it the start is whole.
    """
    if seconds is None:
        return thinned(surface)
    start = begun(surface)
    return _made(surface, seconds) if start is None else start


def _made(surface: Surface, seconds: float) -> Start:
    """Make the start for a search of so many seconds, and keep it, although Ctrl-C is raised when it comes back."""
    # the second entry is set by Ctrl-C alone
    stop = np.zeros(2, np.bool_)

    def work(_: None) -> Start:
        start = _begin(surface, stop, seconds)
        start = _STARTS[surface] = start if start.is_whole or stop[1] else replace(start, seconds=seconds)
        return start

    return on_threads(work, [None], stop=stop)[0]


def _begin(surface: Surface, stop: BoolArray, seconds: float) -> Start:
    """Thin from all vertices, or from those that insertion finds, as far as the time goes."""
    limit = START_SHARE * seconds
    fronts: list[NestedFront] = []
    is_first = True

    def timed(share: float, work: Callable[[], Found]) -> Found:
        nonlocal is_first
        if not is_first:  # the one before was stopped; after Ctrl-C, which may come at any time, it is not waited for
            stop[0] = False
        seconds = share * (min(QUICK, limit) if stop[1] and not is_first else limit)
        is_first = False
        with stopping(stop, seconds if seconds < np.inf else None):
            return work()

    is_spanned = can_insert(surface)
    if not is_spanned or surface.n_vertices * SECONDS_A_REMOVAL <= limit:
        fronts.append(timed(1.0, lambda: thinning(surface, stop=stop)))
        if not stop[0]:
            return Start((fronts[0],), np.inf)
        if not is_spanned:
            return Start.of(*fronts)
        limit = min(QUICK, KEPT_SHARE * limit)
    fitting = (1.0 - INSERT_SHARE) * limit / (SPARSE * SECONDS_A_REMOVAL * surface.n_vertices)
    scanned = timed(1.0, lambda: _inserted_by_scanning(surface, min(fitting, RASTER_THINNED), stop))
    if scanned is not None:
        order, n_first = scanned
        kept = surface.pinned.copy()
        kept[order] = True
        back = timed(1.0, lambda: thinning(surface, kept=kept, stop=stop))
        # where it was stopped small meshes are those that insertion found
        small = [_some(surface, order, n_first, len(order))] if stop[0] else []
        return Start.of(*small, back, *fronts)
    inserted = timed(INSERT_SHARE, lambda: greedy_insertion(surface, choose="triangle", stop=stop))
    kept = inserted.kept(len(inserted) - 1)
    back = timed(1.0 - INSERT_SHARE, lambda: thinning(surface, kept=kept, stop=stop))
    # thinned meshes are better than those inserted, as far down as they go
    return Start.of(inserted, back, *fronts)


def _inserted_by_scanning(surface: Surface, share: float, stop: BoolArray) -> tuple[IntArray, int] | None:
    """Return a share of the vertices of a grid of heights as insertion finds them, and how many it begins with.

    None: it is no grid. Nor is it taken where the maximum counts, or weights: insertion looks at the sum over all
    vertices alike.
    """
    if not OBJECTIVES[surface.rules.measure].is_sum or surface.rules.weights is not None:
        return None
    raster = raster_of(surface)
    if raster is None:
        return None
    first = surface.pinned.copy()
    if surface.n_vertices < raster.heights.size:  # what lies along gaps is not covered otherwise
        first[surface.border] = True
    begin, most = raster.crossing[np.flatnonzero(first)], int(share * surface.n_vertices)
    found = raster_insertion(raster.x, raster.y, raster.heights, begin, most, stop=stop)
    return raster.vertex[found], len(begin)


def _some(surface: Surface, order: IntArray, low: int, high: int) -> NestedFront:
    """Return some of the meshes of vertices in an order: of the first ``low`` to ``high``, and the pinned ones."""
    n, base = surface.n_vertices, np.flatnonzero(surface.pinned)
    count = np.unique(np.geomspace(max(low, 1), max(high, 1), MEASURED).astype(int))
    rows = np.zeros((len(count), n), bool)
    rows[:, base] = True
    for row, size in zip(rows, count, strict=True):
        row[order[:size]] = True
    table = surface.evaluate(rows, threads=threads_for(len(rows)))
    error = measured(table, surface.rules.measure, surface.total_weight)
    return NestedFront(base, order, error, table[:, TRIANGLES].astype(int), n, count)
