"""Move kept vertices to better places at a given number of triangles: simulated annealing on the live triangulation.

One move drops a kept vertex and keeps another one instead: a vertex one or two edges of the original mesh away, or one
from a triangle with a large error. Some moves only drop one, and where there is room for more triangles one is added.
The change of the error is exact and looks at the triangles touched only, so a move costs a microsecond or two at any N.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshsimp_pymoo.arrays import BoolArray, Csr, IntArray
from meshsimp_pymoo.compiling.draws import below, unit
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.search.budgets import stopping
from meshsimp_pymoo.search.greedy import stop_flag, thin
from meshsimp_pymoo.surface.moves import (
    exchange,
    is_site,
    is_taken,
    n_sites,
    n_triangles,
    snapshot,
    total_cost,
    try_exchange,
    urgency,
)
from meshsimp_pymoo.surface.surface import Surface, movable_ground
from meshsimp_pymoo.workers import on_threads


class MoveShares(NamedTuple):
    """How often each kind of move is tried.

    Attributes
    ----------
    near : float
        Of the moves of a vertex those to a neighbour on the mesh; the others go to a triangle with a large error.
    fill : float
        Of the steps with room for two triangles those that add a vertex.
    border : float
        Of the steps with room for one triangle those that add a vertex on the border.
    drop : float
        Of the steps those that drop a vertex.
    """

    near: float = 0.9
    fill: float = 0.2
    border: float = 0.02
    drop: float = 0.01


USUAL_MOVES = MoveShares()
# Triangles compared for a far move, and vertices compared for a change of size.
FAR_TRIES = 4
SIZE_TRIES = 12
# Rounds of changing the size that find no vertex before it is given up.
FIT_FAILURES = 20
# From so many vertices on the moves look at a window of so many, which the processor's cache holds, where that is no
# fewer sites than so many: all over the model each move waits for the memory and takes 1.2 to 1.9 times as long. It
# goes on by half of itself, so often over all of the vector, and more often where a visit is longer than so many moves,
# that every place is seen at every temperature: with 4 and with 10 passes meshes are as good as without a window.
# Meshes of fewer sites are worse by a window, and no faster.
WINDOWED_FROM = 50_000
WINDOW, LEAST_WINDOW = 4_000, 8
PASSES, VISIT = 8, 4_000


@inner
def _urgent(g: Any, live: Any, first: int, n: int, state: np.ndarray) -> int:
    """Draw a vertex that is no site, of n from ``first`` on, in the triangle with the largest error of a few; or -1."""
    best = -1
    most = -1.0
    for _ in range(FAR_TRIES):
        i = first + below(state, n)
        if not is_site(g, live, i):
            amount = urgency(g, live, i)
            if amount > most:
                most = amount
                best = i
    return best


@inner
def _listed(g: Any, live: Any, fixed: np.ndarray, movable: np.ndarray) -> int:
    """List the sites that may move in vector order; return their number."""
    n = 0
    for v in range(len(fixed)):
        if not fixed[v] and is_site(g, live, v):
            movable[n] = v
            n += 1
    return n


@inner
def _begin_again(differs: np.ndarray, changed: np.ndarray, n_changed: int) -> None:
    """Let no vertex differ; of those that did the first are listed."""
    if n_changed <= len(changed):
        for k in range(n_changed):
            differs[changed[k]] = False
    else:
        for v in range(len(differs)):
            differs[v] = False


@entry
def anneal(
    ground: Any,
    books: Any,
    n: int,
    fixed: np.ndarray,
    movable: np.ndarray,
    border: np.ndarray,
    indptr: np.ndarray,
    indices: np.ndarray,
    moves: int,
    hot: float,
    cooling: float,
    most: int,
    shares: tuple,  # type: ignore[type-arg]
    state: np.ndarray,
    stop: np.ndarray,
    made: np.ndarray,
    differs: np.ndarray,
    changed: np.ndarray,
) -> None:
    """Walk among the subsets of at most ``most`` triangles; let ``differs`` be True where the best one is not the last.

    ``made[0]`` is lowered to the moves that were made where ``stop`` ended them. ``movable`` and ``changed`` are room.
    """
    g = borrowed(ground)
    live = borrowed(books)
    fixed = borrowed(fixed)
    movable = borrowed(movable)
    border = borrowed(border)
    indptr = borrowed(indptr)
    indices = borrowed(indices)
    state = borrowed(state)
    differs = borrowed(differs)
    changed = borrowed(changed)
    near, fill, on_border, drop = shares
    if len(border) == 0:  # there is nowhere to make one triangle
        on_border = 0.0
    now = total_cost(g, live)
    best = now
    n_changed = 0  # vertices listed since the best state, those beyond the room counted only
    is_best = True  # whether `differs` is said of the best state already
    n_movable = _listed(g, live, fixed, movable)
    # A window is looked at, from a place of the list on, and goes on along the vector.
    is_windowed = n >= WINDOWED_FROM and n_movable * WINDOW >= LEAST_WINDOW * n
    width, visit, begins, first, span = n_movable, moves, n_movable, 0, n
    if is_windowed:
        width = n_movable * WINDOW // n
        visit = max(min(moves * width // (2 * PASSES * n_movable), VISIT), 1)
        span = WINDOW
    temperature = hot
    for step in range(moves):
        if step % 64 == 0:
            temperature = hot * cooling ** (step / moves)
            if stop[0]:
                made[0] = step
                break
        if is_windowed and step % visit == 0:
            begins += width // 2
            if begins >= n_movable:  # a new pass; moves and drops have disturbed the order
                n_movable = _listed(g, live, fixed, movable)
                begins = -below(state, width // 2)
        slack = most - n_triangles(g, live)
        kind = unit(state)
        q = below(state, width) if width > 0 else 0
        if is_windowed and n_movable > 0:
            q = (begins + q + n_movable) % n_movable
            first = min(max(movable[q] - span // 2, 0), n - span)
        v = np.int64(-1)
        w = np.int64(-1)
        if slack > 0 and kind < (fill if slack > 1 else on_border):
            # Room for a vertex more; where there is room for one triangle only, it must be on the border.
            w = _urgent(g, live, first, span, state) if slack > 1 else np.int64(border[below(state, len(border))])
        elif n_movable == 0:
            continue
        else:
            v = movable[q]
            if kind < 1.0 - drop:
                if unit(state) < near:
                    w = v
                    for _ in range(1 + below(state, 2)):
                        degree = indptr[w + 1] - indptr[w]
                        w = np.int64(indices[indptr[w] + below(state, degree)])
                else:
                    w = _urgent(g, live, first, span, state)
                if w < 0:
                    continue
        if w >= 0 and is_taken(g, live, w):
            continue
        if v < 0 and w < 0:
            continue
        limit = -temperature * np.log(unit(state))
        change, triangles = try_exchange(g, live, v, w, limit)
        if not change <= limit or triangles > slack:
            continue
        if change > 0.0 and not is_best and now <= best:
            _begin_again(differs, changed, n_changed)
            n_changed = 0
            is_best = True
        if not exchange(g, live, v, w):
            continue
        if v >= 0 and w >= 0:
            movable[q] = w
        elif w >= 0:
            movable[n_movable] = w
            n_movable += 1
        else:
            n_movable -= 1
            movable[q] = movable[n_movable]
        if not is_windowed:
            width = n_movable
        for i in (v, w):
            if i >= 0:
                differs[i] = not differs[i]
                if n_changed < len(changed):
                    changed[n_changed] = i
                n_changed += 1
        now = total_cost(g, live)
        if now < best:
            best = now
            is_best = False
    if not is_best and now <= best:
        _begin_again(differs, changed, n_changed)


@entry
def fit_size(
    ground: Any,
    books: Any,
    n: int,
    fixed: np.ndarray,
    by_triangles: bool,
    wanted: int,
    state: np.ndarray,
    stop: np.ndarray,
) -> None:
    """Drop or add vertices, each the best of a few drawn, to ``wanted`` triangles or sites, or just below."""
    g = borrowed(ground)
    live = borrowed(books)
    failures = 0
    while failures < FIT_FAILURES and not stop[0]:
        size = n_triangles(g, live) if by_triangles else n_sites(g, live)
        if size == wanted:
            break
        shrink = size > wanted
        best_v = np.int64(-1)
        best_w = np.int64(-1)
        least = np.inf
        for _ in range(SIZE_TRIES):
            i = np.int64(below(state, n))
            v = np.int64(-1)
            w = np.int64(-1)
            if shrink:
                # The vertex drawn or the next site along the curve.
                for _step in range(n):
                    i = i + 1 if i + 1 < n else 0
                    if is_site(g, live, i) and not fixed[i]:
                        v = i
                        break
                if v < 0:
                    break
            else:
                w = np.int64(_urgent(g, live, 0, n, state))
                if w < 0 or is_taken(g, live, w):
                    continue
            change, triangles = try_exchange(g, live, v, w, np.inf)
            if not shrink and by_triangles and size + triangles > wanted:
                continue
            if change < least:
                least = change
                best_v = v
                best_w = w
        if (best_v < 0 and best_w < 0) or not exchange(g, live, best_v, best_w):
            failures += 1


def _thin_to(ground: Any, books: Any, pinned: BoolArray, triangles: int, stop: BoolArray) -> None:
    """Remove the vertices that add the least error until there are at most so many triangles."""
    n = len(pinned) + 1
    removed, error, counts = np.empty(n, np.int32), np.empty(n), np.empty(n, np.int32)
    thin(ground, books, len(pinned), pinned, triangles, np.inf, np.inf, stop, removed, error, counts)


def relocate(
    surface: Surface,
    kept: BoolArray,
    *,
    moves: int,
    seed: int,
    size: int | None = None,
    triangles: int | None = None,
    temperature: float = 0.3,
    cooling: float = 0.03,
    shares: MoveShares = USUAL_MOVES,
    stop: BoolArray | None = None,
    made: IntArray | None = None,
) -> BoolArray:
    """Return a subset of no more triangles with less error, or ``kept`` itself: annealed moves, the best state seen.

    Parameters
    ----------
    surface : Surface
        The original mesh of N vertices and its rules, whose measure says what is lowered: the sum of w_p d_p, or of w_p
        times the square of d_p, or for the maximum its eighth power; of one that is ``bounded`` the sum of
        max(0, d_p - most) over the vertices whose w_p is not 0, with its own share of the measure's sum.
    kept : (N,) bool array
        Where to start; with what the surface pins it must span a triangle of the mesh.
    moves : int
        Number of moves to try, a microsecond or two each.
    seed : int
        Of the random moves, 1 or more.
    size : int, optional
        Number of vertices to bring the subset to before the moves.
    triangles : int, optional
        Number of triangles to bring it to before the moves, which is not exceeded by them; by default as many as the
        subset has.
    temperature : float
        Initial temperature, in units of the error per kept vertex. 0 accepts improvements only.
    cooling : float
        Share of the temperature that is left in the end; in between it falls geometrically.
    shares : MoveShares
        How often each kind of move is tried.
    stop : (1,) bool array, optional
        It ends soon after another thread has set it, wherever it is: before the subset was brought to its size, too.
    made : (1,) int64 array, optional
        Takes the number of moves that were made: fewer than ``moves`` where they were stopped.

    Returns
    -------
    (N,) bool array
        Kept vertices at the position of another kept one are left out: they are in no mesh.

    Raises
    ------
    TypeError
        If this is a model, not a surface.
    ValueError
        If the surface has no compiled moves.
    """
    ground = movable_ground(surface, "thinning and relocation")
    n, pinned = surface.n_vertices, surface.pinned
    state = np.array([seed], np.uint64)
    made = np.empty(1, np.int64) if made is None else made
    made[0] = moves
    flag = stop_flag(stop)

    def work(kept: BoolArray) -> BoolArray:
        if flag[0]:
            made[0] = 0
            return kept | pinned
        with surface.books(kept | pinned) as books:
            if size is not None:
                fit_size(ground, books, n, pinned, False, size, state, flag)
            if triangles is not None:
                if snapshot(ground, books, n)[2] > triangles:
                    _thin_to(ground, books, pinned, triangles, flag)
                fit_size(ground, books, n, pinned, True, triangles, state, flag)
            return annealed(
                ground,
                books,
                pinned,
                surface.border,
                surface.neighbours,
                moves=moves,
                temperature=temperature,
                cooling=cooling,
                triangles=triangles,
                shares=shares,
                state=state,
                stop=flag,
                made=made,
            )

    return on_threads(work, [kept], stop=flag)[0]


def annealed(
    ground: Any,
    books: Any,
    fixed: BoolArray,
    border: IntArray,
    neighbours: Csr,
    *,
    moves: int,
    temperature: float,
    cooling: float,
    state: NDArray[np.uint64],
    triangles: int | None = None,
    shares: MoveShares = USUAL_MOVES,
    stop: BoolArray | None = None,
    made: IntArray | None = None,
) -> BoolArray:
    """Anneal the subset that books hold; return the best one (N,) that was seen.

    Parameters
    ----------
    ground, books : records
        Of a surface of N vertices; the books end at the last mesh.
    fixed : (N,) bool array
        Sites that stay.
    border, neighbours : int arrays
        Where one triangle is to be had, and where each vertex may move.
    moves, temperature, cooling, triangles, shares, stop, made
        As :func:`relocate` has them.
    state : (1,) uint64 array
        Of the random moves.
    """
    n = len(fixed)
    result: BoolArray
    result, total, n_now = snapshot(ground, books, n)
    n_movable = int(np.count_nonzero(result & ~fixed))
    if moves <= 0 or not np.isfinite(total):
        return result
    differs = np.zeros(n, np.bool_)
    anneal(
        ground,
        books,
        n,
        fixed,
        np.empty(n, np.int64),
        border,
        *neighbours,
        moves,
        temperature * max(float(total), 0.0) / max(n_movable, 1),
        cooling,
        int(n_now) if triangles is None else triangles,
        tuple(map(float, shares)),
        state,
        stop_flag(stop),
        np.empty(1, np.int64) if made is None else made,
        differs,
        np.empty(n, np.int64),
    )
    best: BoolArray = snapshot(ground, books, n)[0] ^ differs
    return best


def relocate_all(
    surface: Surface,
    X: BoolArray,
    moves: NDArray[np.integer],
    random_state: np.random.Generator,
    *,
    sizes: NDArray[np.integer] | None = None,
    triangles: NDArray[np.integer] | None = None,
    seconds: float | None = None,
    made: IntArray | None = None,
    **how: Any,
) -> BoolArray:
    """Apply :func:`relocate` to each row of X (P, N) on all cores; the result does not depend on their number.

    Parameters
    ----------
    surface : Surface
        What they are subsets of.
    X : (P, N) bool array
        The subsets.
    moves, sizes, triangles : (P,) int arrays
        Those arguments of :func:`relocate` for each row.
    random_state : numpy.random.Generator
        Source of randomness.
    seconds : float, optional
        The moves end after this time, wherever they are; the result then depends on the machine.
    made : (P,) int64 array, optional
        Takes the number of moves that were made for each row.
    **how
        Its other arguments, the same for all rows.
    """
    movable_ground(surface, "thinning and relocation")
    stop = np.zeros(1, np.bool_)
    seeds = random_state.integers(1, 2**63 - 1, size=len(X))

    def one(k: int) -> BoolArray:
        return relocate(
            surface,
            X[k],
            moves=int(moves[k]),
            seed=int(seeds[k]),
            size=None if sizes is None else int(sizes[k]),
            triangles=None if triangles is None else int(triangles[k]),
            stop=stop,
            made=None if made is None else made[k : k + 1],
            **how,
        )

    with stopping(stop, seconds):
        rows = on_threads(one, range(len(X)), stop=stop)
    return np.array(rows) if rows else X.copy()
