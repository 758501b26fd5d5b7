"""Move kept vertices to better places at a fixed size: simulated annealing on the live triangulation.

One move drops a kept vertex and keeps another one instead: a vertex one or two edges of the original mesh away, or one
from a triangle with a large error. The change of the error is exact, so a move costs microseconds at any N.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from meshsimp_pymoo.geometry.error import thread_pool
from meshsimp_pymoo.geometry.live import (
    N_SITES,
    Ground,
    Live,
    _total,
    build,
    insert,
    make_ground,
    make_live,
    remove,
    try_insert,
    try_remove,
)
from meshsimp_pymoo.operators.requirements import summed_measure

if TYPE_CHECKING:
    from meshsimp_pymoo.geometry.model import OpenModel

# Share of the moves that go to a neighbour on the mesh; the others go to a triangle with a large error.
NEAR_SHARE = 0.7
# Triangles compared for a far move, and vertices compared for a change of size.
FAR_TRIES = 4
SIZE_TRIES = 30
# The annealing ends at this share of the temperature it begins with.
COOLING = 0.03

_local = threading.local()


@njit(cache=True, nogil=True, forceinline=True)
def _next(state: np.ndarray) -> int:
    """Advance a xorshift64* generator (Vigna 2016); 63 bits."""
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    return np.int64((x * np.uint64(2685821657736338717)) >> np.uint64(1))


@njit(cache=True, nogil=True, forceinline=True)
def _below(state: np.ndarray, n: int) -> int:
    return _next(state) % n


@njit(cache=True, nogil=True, forceinline=True)
def _unit(state: np.ndarray) -> float:
    return ((_next(state) >> 10) + 1) * 2.0**-53


@njit(cache=True, nogil=True)
def _taken(xy: np.ndarray, site: np.ndarray, w: int) -> bool:
    """Whether some site has the position of vertex w; those at one position follow each other."""
    if site[w]:
        return True
    for step in (-1, 1):
        i = w + step
        while 0 <= i < len(site) and xy[2 * i] == xy[2 * w] and xy[2 * i + 1] == xy[2 * w + 1]:
            if site[i]:
                return True
            i += step
    return False


@njit(cache=True, nogil=True)
def _urgent(g: Ground, live: Live, n: int, state: np.ndarray) -> int:
    """Draw a vertex that is no site, from the triangle with the largest error of a few; -1 if none was met."""
    best = -1
    most = -1.0
    for _ in range(FAR_TRIES):
        i = _below(state, n)
        if not live.site[i]:
            amount = live.subtotal[live.place[i] >> 3] if live.bare_at[i] < 0 else live.cost[i]
            if amount > most:
                most = amount
                best = i
    return best


@njit(cache=True, nogil=True)
def _anneal(
    g: Ground,
    live: Live,
    movable: np.ndarray,
    indptr: np.ndarray,
    indices: np.ndarray,
    moves: int,
    hot: float,
    state: np.ndarray,
    best_movable: np.ndarray,
) -> float:
    n = len(g.z)
    best = _total(live)
    best_movable[:] = movable
    site = live.site
    now = best
    for step in range(moves):
        temperature = hot * COOLING ** (step / moves)
        q = _below(state, len(movable))
        v = movable[q]
        w = np.int64(v)
        if _unit(state) < NEAR_SHARE:
            for _ in range(1 + _below(state, 2)):
                degree = indptr[w + 1] - indptr[w]
                w = np.int64(indices[indptr[w] + _below(state, degree)])
        else:
            w = _urgent(g, live, n, state)
        if w < 0 or _taken(g.xy, site, w):
            continue
        if not remove(g, live, v):
            continue
        without = _total(live)
        change, _ = try_insert(g, live, w)
        if without + change - now <= -temperature * np.log(_unit(state)):
            insert(g, live, w)
            movable[q] = w
        else:
            insert(g, live, v)
        now = _total(live)
        if now < best:
            best = now
            best_movable[:] = movable
    return best


@njit(cache=True, nogil=True)
def _resize(g: Ground, live: Live, fixed: np.ndarray, wanted: int, state: np.ndarray) -> None:
    """Remove or insert sites, each the best of a few drawn at random, until there are ``wanted``."""
    n = len(g.z)
    failures = 0
    while live.tally[N_SITES] != wanted and failures < 1000:
        shrink = live.tally[N_SITES] > wanted
        best = -1
        least = np.inf
        for _ in range(SIZE_TRIES):
            i = _below(state, n)
            if shrink:
                # The vertex drawn or the next site along the curve.
                for _step in range(n):
                    i = i + 1 if i + 1 < n else 0
                    if live.site[i] and not fixed[i]:
                        break
                if not live.site[i] or fixed[i]:
                    break
                change, _ = try_remove(g, live, i)
            else:
                i = _urgent(g, live, n, state)
                if i < 0 or _taken(g.xy, live.site, i):
                    continue
                change, _ = try_insert(g, live, i)
            if change < least:
                least = change
                best = i
        if best < 0:
            failures += 1
            continue
        if shrink:
            if not remove(g, live, best):
                failures += 1
        else:
            insert(g, live, best)


def relocate(
    model: OpenModel,
    kept: NDArray[np.bool_],
    pinned: NDArray[np.bool_],
    *,
    moves: int,
    seed: int,
    size: int | None = None,
    temperature: float = 0.2,
    footprint: str = "model",
    outside: str = "nearest",
    measure: str = "error",
) -> NDArray[np.bool_]:
    """Return a subset of the same size with less error, or ``kept`` itself: annealed moves, the best state seen.

    Parameters
    ----------
    model : OpenModel
        The original mesh of N vertices.
    kept : (N,) bool array
        Where to start; must span a triangle of the mesh.
    pinned : (N,) bool array
        Vertices that stay.
    moves : int
        Number of moves to try, some microseconds each.
    seed : int
        Of the random moves, 1 or more.
    size : int, optional
        Number of vertices to keep; vertices are added or dropped before the moves. By default as many as ``kept`` has.
    temperature : float
        Initial temperature, in units of the error per kept vertex. 0 accepts improvements only.
    footprint, outside : str
        As in :func:`~meshsimp_pymoo.geometry.error.evaluate_subsets`.
    measure : {"error", "rms_error"}
        What is lowered: the sum of w_p d_p, or of w_p times the square of d_p.

    Returns
    -------
    (N,) bool array
        Kept vertices at the position of another kept one are left out: they are in no mesh.
    """
    n = model.n_vertices
    held = getattr(_local, "live", None)
    if held is None or held[0] != n:
        held = (n, make_live(n))
        _local.live = held
    live = held[1]
    ground = make_ground(model, footprint=footprint, outside=outside, measure=measure)
    kept = kept | pinned
    sites = np.flatnonzero(kept)
    if model.kernel_arguments[3]:
        sites = sites[np.r_[True, (model.xy[sites[1:]] != model.xy[sites[:-1]]).any(axis=1)]]
    build(ground, live, model, sites)
    state = np.array([seed], np.uint64)
    if size is not None:
        _resize(ground, live, pinned, size, state)
    result = live.site[:n] == 1
    movable = np.flatnonzero(result & ~pinned)
    if len(movable) and moves > 0:
        best = np.empty_like(movable)
        hot = temperature * max(float(_total(live)), 0.0) / len(movable)
        if np.isfinite(hot):
            _anneal(ground, live, movable, *model.neighbours, moves, hot, state, best)
            result = result & pinned
            result[best] = True
    return result


def relocate_all(
    problem: Any,
    X: NDArray[np.bool_],
    moves: NDArray[np.integer],
    random_state: np.random.Generator,
    *,
    sizes: NDArray[np.integer] | None = None,
    temperature: float = 0.2,
) -> NDArray[np.bool_]:
    """Apply :func:`relocate` to each row of X (P, N) on all cores; the result does not depend on their number."""
    measure = summed_measure(problem)
    seeds = random_state.integers(1, 2**63 - 1, size=len(X))

    def one(k: int) -> NDArray[np.bool_]:
        return relocate(
            problem.model,
            X[k],
            problem.pinned,
            moves=int(moves[k]),
            seed=int(seeds[k]),
            size=None if sizes is None else int(sizes[k]),
            temperature=temperature,
            footprint=problem.footprint,
            outside=problem.outside,
            measure=measure,
        )

    rows = list(thread_pool().map(one, range(len(X))))
    return np.array(rows) if rows else X.copy()
