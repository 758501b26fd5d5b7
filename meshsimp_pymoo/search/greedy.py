"""Classic fronts in one pass: adaptive thinning, and greedy insertion by the worst point or the worst triangle.

Both give nested subsets, one of every size, so that a single pass is a whole front of (error, triangles):

* *thinning* removes, again and again, the vertex whose removal adds the least to the exact error [1]_, but that one in
  more than 48 triangles may wait (see :func:`thin`);
* *greedy insertion* starts from the pinned vertices and inserts the worst vertex of all [2]_, or the worst vertex of
  the triangle with the largest sum of errors [3]_.

References
----------
.. [1] N. Dyn, M. S. Floater, A. Iske, "Adaptive thinning for bivariate scattered data", J. Computational and Applied
   Mathematics 145, 2002; here with the exact L1 error of the Delaunay spline after removal.
.. [2] M. Garland, P. S. Heckbert, "Fast polygonal approximation of terrains and height fields", CMU-CS-95-181, 1995.
.. [3] J. J. Little, P. Shi, "Structural lines, TINs, and DEMs", Algorithmica 30, 2001.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, require_bool
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.search.heap import make_heap, sift_down, sift_up
from meshsimp_pymoo.surface.moves import (
    cells_around,
    effort,
    error_now,
    exchange,
    is_site,
    n_cells,
    n_triangles,
    ranked,
    sites_around,
    snapshot,
    try_exchange,
    worst_in,
)
from meshsimp_pymoo.surface.surface import Surface, cost_of, error_of, movable_ground
from meshsimp_pymoo.workers import on_threads


@dataclass(frozen=True)
class NestedFront:
    """Subsets of every size, each contained in the next.

    Attributes
    ----------
    base : (B,) int array
        Vertices in every subset, ascending.
    order : (M,) int array
        The further vertices; subset k has the base and the first k of them.
    error : (S,) float array
        Error of subset k, in the measure that was asked for [model units]; S is M + 1 where there are all sizes.
    triangles : (S,) int array
        Triangles of subset k.
    n_vertices : int
        N of the model.
    count : (S,) int array, optional
        Of a front that has not all sizes: subset k has the base and the first ``count[k]`` of ``order``, among which
        vertices of the base may be.
    """

    base: np.ndarray
    order: np.ndarray
    error: np.ndarray
    triangles: np.ndarray
    n_vertices: int
    count: np.ndarray | None = None

    def __repr__(self) -> str:
        return (
            f"<NestedFront: {len(self):,} subsets of {self.n_vertices:,} vertices, {self.triangles[0]:,} to "
            f"{self.triangles[-1]:,} triangles, error {self.error[0]:.6g} to {self.error[-1]:.6g}>"
        )

    def __len__(self) -> int:
        return len(self.error)

    @property
    def F(self) -> np.ndarray:
        """Error and triangles of every subset, (S, 2), as pymoo writes objectives."""
        return np.column_stack([self.error, self.triangles])

    def kept(self, k: int) -> np.ndarray:
        """Return subset k as a bool array (N,)."""
        if not 0 <= k < len(self):
            raise ValueError(f"there is no subset {k}; the front has the subsets 0 to {len(self) - 1}")
        kept = np.zeros(self.n_vertices, bool)
        kept[self.base] = True
        kept[self.order[: k if self.count is None else self.count[k]]] = True
        return kept

    def smallest(self, n: int) -> NestedFront:
        """Return the front of the n smallest subsets."""
        count = None if self.count is None else self.count[:n]
        order = self.order[: n - 1] if count is None else self.order
        return replace(self, order=order, error=self.error[:n], triangles=self.triangles[:n], count=count)


def thinning(
    surface: Surface,
    pinned: BoolArray | None = None,
    *,
    kept: BoolArray | None = None,
    least: int = 0,
    most_error: float = np.inf,
    stop: BoolArray | None = None,
) -> NestedFront:
    """Remove the vertex whose removal adds the least error, until only the pinned ones are left.

    Where the measure is the maximum, the vertex goes whose removal leaves the least maximum among the vertices around
    it, and of such vertices the one that adds the least to the sum of the eighth powers. A vertex in more than 48
    triangles may go later than it could: what its removal adds is found again only after so many removals beside it.

    Parameters
    ----------
    surface : Surface
        The original mesh of N vertices and its rules, whose measure counts; the front's ``error`` is in it.
    pinned : (N,) bool array, optional
        Vertices never removed, besides those that the surface pins.
    kept : (N,) bool array, optional
        The subset to start from; all vertices by default (of several at one position, the first).
    least : int
        Stop once there are this many triangles or fewer.
    most_error : float
        Stop before the error, in the surface's measure, would exceed this [model units].
    stop : (1,) bool array, optional
        Another thread that sets it ends the thinning soon after, with the front as far as it came.

    Returns
    -------
    NestedFront
        Where it was stopped, the larger subsets of the whole one: nothing else differs.

    Raises
    ------
    TypeError
        If this is a model, not a surface.
    ValueError
        If the surface has no compiled moves.
    """
    ground = movable_ground(surface, "thinning and insertion")
    fixed = _fixed(surface, pinned)
    n_all = surface.n_vertices
    flag = stop_flag(stop)
    most = cost_of(surface, _error(most_error, "most_error"))

    def work(kept: BoolArray | None) -> tuple[Any, ...]:
        with surface.books(np.ones(n_all, bool) if kept is None else kept | fixed, fixed=fixed) as books:
            sites, _, _ = snapshot(ground, books, n_all)
            n = int((sites & ~fixed).sum())
            removed, error, triangles = np.empty(n, np.int32), np.empty(n + 1), np.empty(n + 1, np.int32)
            n_removed = thin(ground, books, n_all, fixed, least, np.inf, most, flag, removed, error, triangles)
        return sites, removed, error, triangles, n_removed

    ((sites, removed, error, triangles, n_removed),) = on_threads(work, [kept], stop=flag)
    sites[removed[:n_removed]] = False
    return NestedFront(
        np.flatnonzero(sites),
        removed[:n_removed][::-1].copy(),
        error_of(surface, _not_below_0(error[: n_removed + 1])[::-1].copy()),
        triangles[: n_removed + 1][::-1].copy(),
        n_all,
    )


def greedy_insertion(
    surface: Surface,
    pinned: BoolArray | None = None,
    *,
    choose: str = "point",
    most: int | None = None,
    least_error: float = 0.0,
    stop: BoolArray | None = None,
) -> NestedFront:
    """Insert the worst vertex, starting from the pinned ones.

    Parameters
    ----------
    surface : Surface
        The original mesh of N vertices and its rules; see :func:`thinning`.
    pinned : (N,) bool array, optional
        Vertices to start from, besides those that the surface pins. They must span a triangle of the mesh; what each
        of several parts lacks for a mesh of its own is added.
    choose : {"point", "triangle"}
        The vertex with the largest cost of all, or that of the triangle with the largest sum of costs.
    most : int, optional
        Number of vertices to insert; all by default.
    least_error : float
        Stop once the error, in the surface's measure, is at most this [model units].
    stop : (1,) bool array, optional
        Another thread that sets it ends the insertion soon after, with the front as far as it came.

    Returns
    -------
    NestedFront
        Ends where no triangle has a vertex left that deviates.

    Raises
    ------
    TypeError
        If this is a model, not a surface.
    ValueError
        If an argument makes no sense, or the surface has no compiled moves.
    """
    ground = movable_ground(surface, "thinning and insertion")
    if choose not in ("point", "triangle"):
        raise ValueError(f"choose={choose!r} is unknown; use 'point' or 'triangle'")
    if most is not None and most < 0:
        raise ValueError(f"most={most} is no number of vertices; give 0 or more")
    fixed = surface.spanning(_fixed(surface, pinned))
    n_all = surface.n_vertices
    flag = stop_flag(stop)
    _error(least_error, "least_error")
    # 0 means to the end: where nothing deviates there is nothing to insert, and rounding may leave a little
    least = cost_of(surface, least_error) if least_error > 0.0 else -np.inf

    def work(by_point: bool) -> tuple[Any, ...]:
        with surface.books(fixed, fixed=fixed) as books:
            sites = np.flatnonzero(snapshot(ground, books, n_all)[0])
            n = n_all - len(sites) if most is None else min(most, n_all - len(sites))
            inserted, error, triangles = np.empty(n, np.int32), np.empty(n + 1), np.empty(n + 1, np.int32)
            n_inserted = _grow(ground, books, n_all, by_point, least, flag, inserted, error, triangles)
        return sites, inserted, error, triangles, n_inserted

    ((sites, inserted, error, triangles, n_inserted),) = on_threads(work, [choose == "point"], stop=flag)
    return NestedFront(
        sites,
        inserted[:n_inserted].copy(),
        error_of(surface, _not_below_0(error[: n_inserted + 1])),
        triangles[: n_inserted + 1].copy(),
        n_all,
    )


def can_insert(surface: Surface) -> bool:
    """Return whether the pinned vertices span a triangle: without one there is nothing to insert into."""
    movable_ground(surface, "thinning and insertion")
    try:
        with surface.books(surface.pinned, fixed=surface.pinned):
            return True
    except ValueError:  # what the books say of such vertices, and of nothing else
        return False


def _error(given: Any, name: str) -> float:
    """Return an error that is one, or raise a ValueError."""
    if not isinstance(given, (int, float, np.number)) or not given >= 0:
        raise ValueError(f"{name}={given!r} is no error; give 0 or more")
    return float(given)


def stop_flag(stop: BoolArray | None) -> BoolArray:
    """Return a flag that another thread can set: the one that is given, or one that nobody knows."""
    if stop is None:
        return np.zeros(1, np.bool_)
    flag = require_bool(stop, "stop is a flag that another thread sets", "give np.zeros(1, dtype=bool)")
    if flag.ndim != 1 or not len(flag):
        raise ValueError(f"stop has shape {flag.shape}; give np.zeros(1, dtype=bool)")
    return flag


def _not_below_0(error: np.ndarray) -> np.ndarray:
    """Return running sums of costs without what rounding leaves of them below 0, where nothing costs anything."""
    return np.maximum(error, 0.0)


def _fixed(surface: Surface, pinned: BoolArray | None) -> BoolArray:
    n = surface.n_vertices
    if pinned is not None and require_bool(pinned, "pinned is a bool array", "give True where one is").shape != (n,):
        raise ValueError(f"pinned has shape ({n},), not {pinned.shape}")
    return surface.pinned.copy() if pinned is None else surface.pinned | pinned


# A site of more cells than this is a hub; it is costed again after this share of them has seen a removal.
HUB = 48
PATIENCE = 0.125
# How often all sites are costed again where the one that adds the least adds too much.
MOST_PASSES = 4


@inner
def _cost_again(g: Any, live: Any, v: int, key: np.ndarray, patience: np.ndarray) -> None:
    change, _ = try_exchange(g, live, v, -1, np.inf)
    cells = effort(g, live)
    key[2 * v], key[2 * v + 1] = ranked(g, live, change)
    patience[v] = np.int64(PATIENCE * cells) if cells > HUB else 0


class Queue(NamedTuple):
    """The sites that may go, the one that adds the least first: room for N of them."""

    key: np.ndarray  # (2 N,) two of each, see moves.ranked
    heap: np.ndarray  # (N,)
    at: np.ndarray  # (N,) where each is in the heap, -1: nowhere
    # how many removals beside a hub are left before it is costed again; below 0 once there was one
    patience: np.ndarray  # (N,)
    around: np.ndarray  # (2 N + 8,) scratch


@inner
def make_queue(n_all: int) -> Queue:
    """Return room for a thinning of n_all vertices."""
    return Queue(
        np.empty(2 * n_all, np.float64),
        np.empty(n_all, np.int32),
        np.empty(n_all, np.int32),
        np.zeros(n_all, np.int32),
        np.empty(2 * n_all + 8, np.int64),
    )


@inner
def begin_thinning(
    g: Any,
    live: Any,
    n_all: int,
    fixed: np.ndarray,
    stop: np.ndarray,
    queue: Queue,
    error: np.ndarray,
    triangles: np.ndarray,
) -> int:
    """Cost all sites that are not fixed, note what there is before the first removal, return how many may go."""
    key, heap, at = queue.key, queue.heap, queue.at
    n = 0
    for v in range(n_all):
        if stop[0]:
            n = 0
            break
        at[v] = -1
        if is_site(g, live, v) and not fixed[v]:
            _cost_again(g, live, v, key, queue.patience)
            heap[n] = v
            at[v] = n
            n += 1
    make_heap(heap, at, key, n)
    error[0] = error_now(g, live)
    triangles[0] = n_triangles(g, live)
    return n


@inner
def go_on_thinning(
    g: Any,
    live: Any,
    least: int,
    limit: float,
    most: float,
    stop: np.ndarray,
    queue: Queue,
    n: int,
    n_removed: int,
    removed: np.ndarray,
    error: np.ndarray,
    triangles: np.ndarray,
) -> tuple[int, int]:
    """Go on with :func:`thin` where n may go and ``n_removed`` went; return how many went and may go then."""
    key, heap, at, patience, around = queue.key, queue.heap, queue.at, queue.patience, queue.around
    is_fresh = n_removed == 0  # whether all sites were costed since the last removal
    n_passes = 0
    while n > 0 and triangles[n_removed] > least and not stop[0]:
        v = heap[0]
        if patience[v] < 0:
            _cost_again(g, live, v, key, patience)
            sift_down(heap, at, key, 0, n)
            continue
        if not key[2 * v] < np.inf or key[2 * v] > limit:
            # A hub that waits may cost less by now.
            n_waiting = 0
            for k in range(n):
                if patience[heap[k]] < 0:
                    _cost_again(g, live, heap[k], key, patience)
                    n_waiting += 1
            if n_waiting == 0:
                break
            make_heap(heap, at, key, n)
            continue
        n -= 1
        heap[0] = heap[n]
        at[heap[0]] = 0
        at[v] = -1
        if n > 0:
            sift_down(heap, at, key, 0, n)
        m = sites_around(g, live, v, around)
        if not exchange(g, live, v, -1):
            continue
        removed[n_removed] = v
        n_removed += 1
        error[n_removed] = error_now(g, live)
        triangles[n_removed] = n_triangles(g, live)
        if error[n_removed] > most:
            # Too much; but at an outline a site may cost something else since it was costed, as others went.
            exchange(g, live, -1, v)
            n_removed -= 1
            before = key[2 * v]
            _cost_again(g, live, v, key, patience)
            heap[n] = v
            at[v] = n
            n += 1
            sift_up(heap, at, key, n - 1)
            if key[2 * v] > before:
                continue
            if is_fresh or n_passes == MOST_PASSES:
                break
            for k in range(n):
                _cost_again(g, live, heap[k], key, patience)
            make_heap(heap, at, key, n)
            is_fresh = True
            n_passes += 1
            continue
        is_fresh = False
        if triangles[n_removed] == 0:
            # The last mesh was the smallest one there is.
            n_removed -= 1
            break
        for k in range(m):
            w = around[k]
            if at[w] < 0:
                continue
            if patience[w] != 0:
                patience[w] = -(abs(patience[w]) - 1)
                if patience[w] != 0:
                    continue
            _cost_again(g, live, w, key, patience)
            sift_up(heap, at, key, at[w])
            sift_down(heap, at, key, at[w], n)
    return n_removed, n


@entry
def thin(
    ground: Any,
    books: Any,
    n_all: int,
    fixed: np.ndarray,
    least: int,
    limit: float,
    most: float,
    stop: np.ndarray,
    removed: np.ndarray,
    error: np.ndarray,
    triangles: np.ndarray,
) -> int:
    """Remove the vertex that adds the least while that is at most ``limit`` and triangles exceed ``least``.

    The sites around one that went are costed again, exactly. Two kinds may cost something else than is known: one of
    more than ``HUB`` cells, which is costed again when it comes to the top of the heap or ``PATIENCE`` of its cells
    have seen a removal, as doing so after each would take the square of its cells; and one beside an outline that has
    changed elsewhere, so that what no triangle covers is near to something else. The errors are exact in any case.

    Parameters
    ----------
    ground, books : records
        Of a surface of ``n_all`` vertices; the books end at the last mesh.
    fixed : (n_all,) bool array
        Sites that stay.
    most : float
        It ends before the error, as `moves.error_now` has it, exceeds this.
    stop : (1,) bool array
        Ends it where another thread sets it.
    removed : (n,) int array
        Filled with the vertices removed, in their order; n is the number of sites that are not fixed.
    error, triangles : (n + 1,) arrays
        Filled with the error and the number of triangles before the first removal and after each.

    Returns
    -------
    int
        How many were removed.
    """
    g = borrowed(ground)
    live = borrowed(books)
    queue = make_queue(n_all)
    n = begin_thinning(g, live, n_all, fixed, stop, queue, error, triangles)
    n_removed, _ = go_on_thinning(g, live, least, limit, most, stop, queue, n, 0, removed, error, triangles)
    return n_removed


@entry
def _grow(
    ground: Any,
    books: Any,
    n_all: int,
    by_point: bool,
    least: float,
    stop: np.ndarray,
    inserted: np.ndarray,
    error: np.ndarray,
    triangles: np.ndarray,
) -> int:
    """Insert the worst vertex of all, or of the worst cell, until the error is at most ``least``.

    Fills what :func:`thin` fills and returns their number.
    """
    g = borrowed(ground)
    live = borrowed(books)
    most_cells = 2 * n_all + 8
    key = np.zeros(2 * most_cells, np.float64)  # minus what makes a cell urgent, and 0
    best = np.empty(most_cells, np.int32)
    heap = np.empty(most_cells, np.int32)
    at = np.empty(most_cells, np.int32)
    for r in range(most_cells):
        best[r] = -1
        at[r] = -1
    n = 0
    changed = np.empty(most_cells, np.int64)
    n_changed = n_cells(g, live)
    for r in range(n_changed):
        changed[r] = r
    error[0] = error_now(g, live)
    triangles[0] = n_triangles(g, live)
    n_inserted = 0
    is_fresh = True  # whether all cells are costed anew: what no triangle covers changes with an outline far away
    while True:
        for k in range(n_changed):
            r = changed[k]
            best[r], most, whole = worst_in(g, live, r)
            key[2 * r] = -(most if by_point else whole) if best[r] >= 0 else np.inf
            if at[r] < 0:
                heap[n] = r
                at[r] = n
                n += 1
            sift_up(heap, at, key, at[r])
            sift_down(heap, at, key, at[r], n)
        if n_inserted == len(inserted) or n == 0 or stop[0] or error[n_inserted] <= least:
            return n_inserted
        if key[2 * heap[0]] == np.inf:
            if is_fresh:
                return n_inserted
            n_changed = n_cells(g, live)
            for r in range(n_changed):
                changed[r] = r
            is_fresh = True
            continue
        is_fresh = False
        v = best[heap[0]]
        exchange(g, live, -1, v)
        inserted[n_inserted] = v
        n_inserted += 1
        error[n_inserted] = error_now(g, live)
        triangles[n_inserted] = n_triangles(g, live)
        n_changed = cells_around(g, live, v, changed)
