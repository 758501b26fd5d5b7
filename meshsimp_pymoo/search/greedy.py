"""Classic fronts in one pass: adaptive thinning, and greedy insertion by the worst point or the worst triangle.

Both give nested subsets, one of every size, so that a single pass is a whole front of (error, triangles):

* *thinning* removes, again and again, the vertex whose removal adds the least to the exact error [1]_;
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

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD
from meshsimp_pymoo.surface.live import (
    EMITTED,
    END,
    N_EMITTED,
    Ground,
    Live,
    build,
    deviation_in,
    insert,
    lent_live,
    make_ground,
    remove,
    summed_error,
    total_cost,
    triangles_around,
    try_remove,
    weighed_cost,
)

if TYPE_CHECKING:
    from meshsimp_pymoo.surface.model import OpenModel


@dataclass(frozen=True)
class NestedFront:
    """Subsets of every size, each contained in the next.

    Attributes
    ----------
    base : (B,) int array
        Vertices in every subset, ascending.
    order : (M,) int array
        The further vertices; subset k has the base and the first k of them.
    error : (M + 1,) float array
        Error of subset k, in the measure that was asked for [model units].
    triangles : (M + 1,) int array
        Triangles of subset k.
    n_vertices : int
        N of the model.
    """

    base: np.ndarray
    order: np.ndarray
    error: np.ndarray
    triangles: np.ndarray
    n_vertices: int

    def __len__(self) -> int:
        return len(self.error)

    @property
    def F(self) -> np.ndarray:
        """Error and triangles of every subset, (M + 1, 2), as pymoo writes objectives."""
        return np.column_stack([self.error, self.triangles])

    def kept(self, k: int) -> np.ndarray:
        """Return subset k as a bool array (N,)."""
        if not 0 <= k < len(self):
            raise ValueError(f"there is no subset {k}; the front has the subsets 0 to {len(self) - 1}")
        kept = np.zeros(self.n_vertices, bool)
        kept[self.base] = True
        kept[self.order[:k]] = True
        return kept


def thinning(
    model: OpenModel,
    pinned: np.ndarray | None = None,
    *,
    kept: np.ndarray | None = None,
    footprint: str = "model",
    outside: str = "nearest",
    measure: str = "error",
    least: int = 0,
) -> NestedFront:
    """Remove the vertex whose removal adds the least error, until only the pinned ones are left.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices.
    pinned : (N,) bool array, optional
        Vertices never removed; the corners by default.
    kept : (N,) bool array, optional
        The subset to start from; all vertices by default (of several at one position, the first).
    footprint, outside : str
        As in :func:`~meshsimp_pymoo.surface.evaluate.evaluate_subsets`.
    measure : {"error", "rms_error"}
        What counts: w_p d_p, or w_p times the square of d_p; also what the front's ``error`` is.
    least : int
        Stop once there are this many triangles or fewer.

    Returns
    -------
    NestedFront
    """
    fixed = _pinned(model, pinned)
    start = np.ones(model.n_vertices, bool) if kept is None else kept | fixed
    sites = _sites(model, start, fixed)
    ground = make_ground(model, footprint=footprint, outside=outside, measure=measure)
    live = lent_live(model.n_vertices)
    build(ground, live, model, sites)
    n = int((~fixed[sites]).sum())
    removed = np.empty(n, np.int64)
    error = np.empty(n + 1)
    triangles = np.empty(n + 1, np.int64)
    n_removed = thin_live(ground, live, sites, fixed, least, np.inf, removed, error, triangles)
    base = np.setdiff1d(sites, removed[:n_removed])
    return NestedFront(
        base,
        removed[:n_removed][::-1].copy(),
        summed_error(error[: n_removed + 1][::-1].copy(), ground, model),
        triangles[: n_removed + 1][::-1].copy(),
        model.n_vertices,
    )


def greedy_insertion(
    model: OpenModel,
    pinned: np.ndarray | None = None,
    *,
    choose: str = "point",
    most: int | None = None,
    footprint: str = "model",
    outside: str = "nearest",
    measure: str = "error",
) -> NestedFront:
    """Insert the worst vertex, starting from the pinned ones.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices.
    pinned : (N,) bool array, optional
        Vertices to start from; the corners by default. They must span a triangle of the mesh.
    choose : {"point", "triangle"}
        The vertex with the largest cost of all, or that of the triangle with the largest sum of costs.
    most : int, optional
        Number of vertices to insert; all by default.
    footprint, outside : str
        As in :func:`~meshsimp_pymoo.surface.evaluate.evaluate_subsets`.
    measure : {"error", "rms_error"}
        What counts: w_p d_p, or w_p times the square of d_p; also what the front's ``error`` is.

    Returns
    -------
    NestedFront
        Ends where no triangle has a vertex left that deviates.
    """
    if choose not in ("point", "triangle"):
        raise ValueError(f"choose={choose!r} is unknown; use 'point' or 'triangle'")
    if most is not None and most < 0:
        raise ValueError(f"most={most} is no number of vertices; give 0 or more")
    fixed = _pinned(model, pinned)
    sites = _sites(model, fixed, fixed)
    ground = make_ground(model, footprint=footprint, outside=outside, measure=measure)
    live = lent_live(model.n_vertices)
    build(ground, live, model, sites)
    n = model.n_vertices - len(sites) if most is None else min(most, model.n_vertices - len(sites))
    inserted = np.empty(n, np.int64)
    error = np.empty(n + 1)
    triangles = np.empty(n + 1, np.int64)
    n_inserted = _grow(ground, live, choose == "point", inserted, error, triangles)
    return NestedFront(
        sites,
        inserted[:n_inserted],
        summed_error(error[: n_inserted + 1], ground, model),
        triangles[: n_inserted + 1],
        model.n_vertices,
    )


def _pinned(model: OpenModel, pinned: np.ndarray | None) -> np.ndarray:
    if pinned is not None and (pinned.dtype != np.bool_ or pinned.shape != (model.n_vertices,)):
        raise ValueError(
            f"pinned is a bool array of shape ({model.n_vertices},), not {pinned.dtype} of shape {pinned.shape}"
        )
    fixed = np.zeros(model.n_vertices, bool)
    fixed[model.corners] = True
    return fixed if pinned is None else fixed | pinned


def _sites(model: OpenModel, kept: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Rows of the kept vertices, one for each position: a pinned one where there is one, else the first."""
    rows = np.flatnonzero(kept)
    if not model.kernel_arguments[3]:
        return rows
    group = np.cumsum(np.r_[True, (model.xy[1:] != model.xy[:-1]).any(axis=1)])[rows]
    order = np.lexsort((~fixed[rows], group))
    first = np.r_[True, group[order][1:] != group[order][:-1]]
    return np.sort(rows[order[first]])


# ------------------------------------------------------------------------------------------------- a heap of keys


@njit(cache=True, nogil=True, forceinline=True)
def _before(key: np.ndarray, a: int, b: int) -> bool:
    """Order of the heap: by key, then by index, so that ties do not depend on history."""
    return key[a] < key[b] or (key[a] == key[b] and a < b)


@njit(cache=True, nogil=True)
def _sift_up(heap: np.ndarray, at: np.ndarray, key: np.ndarray, k: int) -> None:
    v = heap[k]
    while k > 0:
        parent = (k - 1) >> 1
        if not _before(key, v, heap[parent]):
            break
        heap[k] = heap[parent]
        at[heap[k]] = k
        k = parent
    heap[k] = v
    at[v] = k


@njit(cache=True, nogil=True)
def _sift_down(heap: np.ndarray, at: np.ndarray, key: np.ndarray, k: int, n: int) -> None:
    v = heap[k]
    while True:
        child = 2 * k + 1
        if child >= n:
            break
        if child + 1 < n and _before(key, heap[child + 1], heap[child]):
            child += 1
        if not _before(key, heap[child], v):
            break
        heap[k] = heap[child]
        at[heap[k]] = k
        k = child
    heap[k] = v
    at[v] = k


@njit(cache=True, nogil=True)
def thin_live(
    g: Ground,
    live: Live,
    sites: np.ndarray,
    fixed: np.ndarray,
    least: int,
    limit: float,
    removed: np.ndarray,
    error: np.ndarray,
    triangles: np.ndarray,
) -> int:
    """Remove the vertex that adds the least error while that is at most ``limit`` and triangles exceed ``least``."""
    g = borrowed(g)
    live = borrowed(live)
    n_all = len(g.z)
    key = np.full(n_all, np.inf)
    heap = np.empty(len(sites), np.int32)
    at = np.full(n_all, -1, np.int32)
    n = 0
    for k in range(len(sites)):
        v = sites[k]
        if not fixed[v]:
            key[v], _ = try_remove(g, live, v)
            heap[n] = v
            at[v] = n
            n += 1
    for k in range(n // 2 - 1, -1, -1):
        _sift_down(heap, at, key, k, n)
    error[0] = total_cost(live)
    triangles[0] = live.tally[N_EMITTED]
    n_removed = 0
    around = np.empty(len(live.ring), np.int64)
    while n > 0 and key[heap[0]] < np.inf and key[heap[0]] <= limit and triangles[n_removed] > least:
        v = heap[0]
        n -= 1
        heap[0] = heap[n]
        at[heap[0]] = 0
        at[v] = -1
        if n > 0:
            _sift_down(heap, at, key, 0, n)
        m = triangles_around(live.mesh, live.place[v], v, live.cavity, live.rim, live.ring)
        for k in range(m):
            around[k] = np.int64(live.ring[k])
        if not remove(g, live, v):
            continue
        removed[n_removed] = v
        n_removed += 1
        error[n_removed] = total_cost(live)
        triangles[n_removed] = live.tally[N_EMITTED]
        if triangles[n_removed] == 0:
            # The last mesh was the smallest one there is.
            n_removed -= 1
            break
        for k in range(m):
            w = around[k]
            if w > LAST_INDEX or at[w] < 0:
                continue
            old = key[w]
            key[w], _ = try_remove(g, live, w)
            if key[w] < old:
                _sift_up(heap, at, key, at[w])
            else:
                _sift_down(heap, at, key, at[w], n)
    return n_removed


@njit(cache=True, nogil=True)
def _at_a_corner(xy: np.ndarray, mesh: np.ndarray, t: int, i: int) -> bool:
    """Whether vertex i has the position of a corner of triangle t, where there is no room for it."""
    for k in range(3):
        v = mesh[t + k]
        if v <= LAST_INDEX and xy[2 * v] == xy[2 * i] and xy[2 * v + 1] == xy[2 * i + 1]:
            return True
    return False


@njit(cache=True, nogil=True)
def _candidate(g: Ground, live: Live, t: int) -> tuple[int, float]:
    """Return the vertex of triangle t that deviates most, and by how much (-1: none deviates)."""
    mesh = live.mesh
    worst = -1
    most = 0.0
    i = live.head[t >> 3]
    emitted = (live.kind[t >> 3] & EMITTED) != 0
    while i >= 0:
        if _at_a_corner(g.xy, mesh, t, i):
            i = live.following[i]
            continue
        d = live.cost[i]
        if emitted:
            d = deviation_in(g.xy, g.z, mesh[t], mesh[t + 1], mesh[t + 2], i)
            if g.weighed:
                d = weighed_cost(g, d, i)
        elif live.bare_segment[i] < 0:
            d = 1.0  # there is no mesh yet; any vertex will do
        if d > most or (d == most and worst >= 0 and i < worst):
            most = d
            worst = i
        i = live.following[i]
    return worst, most


@njit(cache=True, nogil=True)
def _grow(
    g: Ground, live: Live, by_point: bool, inserted: np.ndarray, error: np.ndarray, triangles: np.ndarray
) -> int:
    g = borrowed(g)
    live = borrowed(live)
    n_records = len(live.kind)
    key = np.full(n_records, np.inf)  # minus what makes a triangle urgent
    best = np.full(n_records, -1, np.int32)
    heap = np.empty(n_records, np.int32)
    at = np.full(n_records, -1, np.int32)
    n = 0
    changed = np.empty(len(live.ring), np.int64)
    n_changed = live.tally[END] // RECORD
    for r in range(n_changed):
        changed[r] = r
    error[0] = total_cost(live)
    triangles[0] = live.tally[N_EMITTED]
    n_inserted = 0
    while True:
        for k in range(n_changed):
            r = changed[k]
            best[r], most = _candidate(g, live, r * RECORD)
            urgency = most
            if not by_point:
                urgency = live.subtotal[r]
                if (live.kind[r] & EMITTED) == 0:
                    urgency = 0.0
                    i = live.head[r]
                    while i >= 0:
                        urgency += live.cost[i] if live.bare_segment[i] >= 0 else 1.0
                        i = live.following[i]
            key[r] = -urgency if best[r] >= 0 else np.inf
            if at[r] < 0:
                heap[n] = r
                at[r] = n
                n += 1
            _sift_up(heap, at, key, at[r])
            _sift_down(heap, at, key, at[r], n)
        if n_inserted == len(inserted) or n == 0 or key[heap[0]] == np.inf:
            return n_inserted
        v = best[heap[0]]
        insert(g, live, v)
        inserted[n_inserted] = v
        n_inserted += 1
        error[n_inserted] = total_cost(live)
        triangles[n_inserted] = live.tally[N_EMITTED]
        n_changed = triangles_around(live.mesh, live.place[v], v, live.cavity, live.rim, live.ring)
        for k in range(n_changed):
            changed[k] = np.int64(live.cavity[k]) // RECORD
