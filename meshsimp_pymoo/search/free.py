"""Free meshes of all sizes: some rungs of a ladder are annealed freely, and what lies between is filled by collapses.

A rung is a number of triangles. It begins as the Delaunay mesh of a subset, is annealed at its size (see
:mod:`~meshsimp_pymoo.surface.free`) and then thinned down to the next smaller rung, again and again by the collapse
that adds the least, with the loop that thins Delaunay meshes. Sizes that are wanted on the way down are measured where
they are met. Rungs know nothing of each other, so that all threads have one each, and one that is finished stays.

A free mesh is no function of a subset, so no objective is ever that of one: it is kept beside an individual, as
``individual.get("free")``, and only where it is better than the mesh of the individual's own subset.
"""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, spread
from meshsimp_pymoo.compiling.functions import entry
from meshsimp_pymoo.errors import SearchWarning
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.plane.faces import canonical_faces, used_rows
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.budgets import stopping
from meshsimp_pymoo.search.greedy import begin_thinning, go_on_thinning, make_queue
from meshsimp_pymoo.search.wishes import shortfall
from meshsimp_pymoo.surface.measures import MEASURES, REGIONS, TRIANGLES, UNCOVERED, as_quality
from meshsimp_pymoo.surface.moves import take_numbers
from meshsimp_pymoo.surface.rules import MOST_RATIO, USUAL_RATIO
from meshsimp_pymoo.surface.score import measured_angles
from meshsimp_pymoo.surface.surface import FreeMesh, Surface, freedom_of
from meshsimp_pymoo.workers import on_threads, threads_for

# Rungs of a ladder, and how many of them are annealed in one generation. They are geometric, but closer to arithmetic
# below this share of the largest: moves of the smallest meshes of large models take long, and few people want those.
RUNGS = 40
ABREAST = 16
SMALL_SHARE = 1e-3
# Models of more vertices are not searched before, only thinned, and are heated less: there is too little time for both.
LARGE = 50_000
# Temperature in the beginning, in units of the cost per vertex that may move, for others and for large ones; the share
# of it that is left in the end; and the share of the moves, or of the time, that accept improvements only, after that.
HOT, HOT_LARGE = 0.12, 0.05
# Where triangles may have any shape, meshes of more than this share of all triangles are heated more, by the root of
# how much more: 3 to 8 % less error at 20 % of the vertices.
SPARSE_SHARE = 0.03
COOLING = 0.05
TAIL = 0.1
# The share of a budget for subsets, before the rungs.
SUBSETS_SHARE = 0.3
# The share of the time for a front that is freed in which its meshes are measured.
MEASURED_SHARE = 0.05
# Moves where there is no budget: in all, and at least and at most for each triangle of a rung. The last holds anyway:
# nothing is gained beyond it, and small rungs leave their time to others.
TOTAL_MOVES = 3e7
LEAST_MOVES, MOST_MOVES = 40, 20_000
# Samples in a triangle from which on looking at them takes most of a move's time.
CROWD = 20.0
# With a deadline: the share of a rung's time after which it looks at the clock and cools, and the fewest moves that are
# made between; those of few triangles of a large model take half a millisecond each.
PAUSE = 1 / 64
FEW_MOVES = 64
# How late a rung may be with a deadline [s].
LATE = 0.05
# Sizes between the rungs that are measured differ by this share, or by one triangle.
STEP = 0.015
# The time of a rung grows with this power of its size, and ebbs away towards all triangles, where little can be gained.
TIME_POWER = 0.4
# Where one mesh is wished for: sizes as shares of the number of triangles, or of those of the mesh that holds the wish
# so far, which free ones of fewer may hold, with their shares of the time; and those of some others of the front.
AROUND_A_SIZE = ((0.85, 0.5), (1.0, 2.0), (1.0, 2.0), (1.18, 0.5))
AROUND_AN_ERROR = ((0.65, 1.0), (0.72, 1.0), (0.8, 1.0), (0.89, 1.0), (1.0, 1.0))
N_OTHERS, OTHERS_SHARE = 8, 0.15
# So many meshes are compared with the free ones for them by the surface error, however little time is left.
LEAST_COMPARED = 8
# What thinning a rung takes for each of its triangles and for each sample, and measuring it for each sample [s].
SECONDS_A_TRIANGLE, SECONDS_A_SAMPLE, MEASURING = 2.5e-6, 1.2e-7, 1.5e-8

# The column of a mesh's numbers behind those of evaluation.
BETWEEN = REGIONS


@brief
@dataclass(frozen=True, eq=False)
class FreeFront:
    """A free mesh, and those of it that were measured while it was thinned.

    Attributes
    ----------
    faces : (M, 3) int32 array
        Its triangles, as rows of the model's points.
    removed, onto : (K,) int32 array
        The vertices that collapsed, in their order, and which vertex each of them fell on.
    collapses : (J,) int array
        After how many collapses each mesh was measured, ascending; the first after none.
    table : (J, 7) float array
        The numbers of each, as evaluation fills them (see `surface.measures`), then its surface error; NaN where the
        centroids of the original faces were no samples.
    moves : int
        Moves that were made before.
    """

    faces: IntArray
    removed: IntArray
    onto: IntArray
    collapses: IntArray
    table: FloatArray
    moves: int

    def faces_of(self, wanted: Sequence[int], n_vertices: int) -> Iterator[IntArray]:
        """Yield the triangles of the measured meshes of these numbers, ascending; N vertices in all."""
        target = np.arange(n_vertices)
        faces, done = self.faces, 0
        for row in wanted:
            last = int(self.collapses[row])
            steps = slice(done, last)
            # from the last one on, as what a vertex falls on may collapse later
            for v, w in zip(self.removed[steps][::-1].tolist(), self.onto[steps][::-1].tolist(), strict=True):
                target[v] = target[w]
            if last > done:
                faces = target[faces]
                a, b, c = faces.T
                faces = canonical_faces(faces[(a != b) & (b != c) & (c != a)]).astype(np.int32)
                target[self.removed[steps]] = self.removed[steps]
            done = last
            yield faces


@entry
def _thin(
    freedom: Any,
    books: Any,
    n_all: int,
    fixed: np.ndarray,
    sizes: np.ndarray,
    share: np.ndarray,
    stop: np.ndarray,
    removed: np.ndarray,
    cost: np.ndarray,
    triangles: np.ndarray,
    collapses: np.ndarray,
    table: np.ndarray,
) -> tuple[int, int]:
    """Thin a free mesh down to each of some sizes, descending, and measure what it is there.

    ``share`` is that of each sample behind the vertices in the area. Returns how many vertices collapsed and how many
    meshes were measured.
    """
    free = borrowed(freedom)
    live = borrowed(books)
    queue = make_queue(n_all)
    n_removed = 0
    n_measured = 0
    n = 0
    if len(sizes) > 1:
        n = begin_thinning(free, live, n_all, fixed, stop, queue, cost, triangles)
    for k in range(len(sizes)):
        if k > 0:
            if triangles[n_removed] <= sizes[k]:  # a collapse takes two away
                continue
            n_removed, n = go_on_thinning(
                free, live, sizes[k], np.inf, np.inf, stop, queue, n, n_removed, removed, cost, triangles
            )
            if stop[0] or triangles[n_removed] > sizes[k]:
                break
        collapses[n_measured] = n_removed
        take_numbers(free, live, share, table[n_measured])
        n_measured += 1
    return n_removed, n_measured


class FreeLadder:
    """Free meshes on the rungs of a ladder, annealed some rungs at a time.

    Parameters
    ----------
    min_height : float
        Least height of the triangles that come, as a share of their longest edge; 0: any.
    centroids : bool
        Whether the centroids of the original faces are samples too, so that the meshes do not merely fit the vertices.

    Attributes
    ----------
    sizes : (R,) int array
        The most triangles of each rung, ascending.
    offered : (Q,) int array
        Sizes that are measured where they lie between two rungs, ascending.
    shares : (R,) float array
        How much of the time each rung is to have, in any unit; :func:`usual_shares` by default.
    planned : (R,) int array
        The most moves of each rung.
    fronts : dict of int to FreeFront
        What was found, by rung.
    """

    def __init__(self, *, min_height: float = USUAL_RATIO, centroids: bool = True) -> None:
        given: Any = min_height
        if not isinstance(given, (int, float, np.number)) or not 0.0 <= given <= MOST_RATIO:
            raise ValueError(
                f"min_height={min_height!r} is no share of a triangle's longest edge that all can have; give 0 to "
                f"{MOST_RATIO}, such as {USUAL_RATIO}"
            )
        self.min_height = float(min_height)
        self.centroids = bool(centroids)
        self.sizes: IntArray = np.empty(0, np.int64)
        self.offered: IntArray = np.empty(0, np.int64)
        self.shares: FloatArray = np.empty(0)
        self.planned: IntArray = np.empty(0, np.int64)
        self.seeds: IntArray = np.empty(0, np.int64)
        self.fronts: dict[int, FreeFront] = {}
        # what all but the annealing of rungs with a deadline was thought to take, and took [s]
        self.thought, self.took = 0.0, 0.0

    @property
    def moves(self) -> int:
        """Moves of the finished rungs."""
        return sum(front.moves for front in self.fronts.values())

    @property
    def todo(self) -> list[int]:
        """The rungs that are not finished, those first that are far apart."""
        return [rung for rung in spread(len(self.sizes)) if rung not in self.fronts]

    def begin(
        self,
        surface: Surface,
        sizes: IntArray,
        offered: IntArray,
        random_state: np.random.Generator,
        *,
        shares: FloatArray | None = None,
        moves: int | None = None,
        timed: bool = False,
    ) -> None:
        """Set the rungs and the most moves of each, by the time that these take about.

        Parameters
        ----------
        surface : Surface
            What they are meshes of.
        sizes, offered : int arrays
            See the attributes.
        random_state : numpy.random.Generator
            Source of randomness.
        shares : (R,) float array, optional
            See the attributes.
        moves : int, optional
            How many there are for all rungs; by default as many as are usual.
        timed : bool
            Whether time ends them, too: then by default as many as anything is gained by.
        """
        n_samples = surface.n_vertices + len(freedom_of(surface, "free meshes", centroids=self.centroids).share)
        self.sizes, self.offered, self.fronts = sizes, offered, {}
        self.shares = usual_shares(sizes, surface.n_vertices) if shares is None else shares
        self.seeds = random_state.integers(1, 2**63 - 1, size=len(sizes))
        most = MOST_MOVES * sizes
        # moves of each in the same time
        pace = self.shares / (1.0 + n_samples / (CROWD * sizes))
        if moves is not None:
            self.planned = _divided(moves, pace, most)
        elif timed:
            self.planned = most
        else:
            self.planned = np.maximum(_divided(int(TOTAL_MOVES), pace, most), LEAST_MOVES * sizes)

    def go_on(
        self,
        surface: Surface,
        subset_of: Callable[[int], BoolArray],
        *,
        seconds: float | None = None,
        most: int = ABREAST,
        n_threads: int | None = None,
        finished: Callable[[], None] | None = None,
    ) -> None:
        """Anneal and thin the next rungs, each on a thread.

        Parameters
        ----------
        surface : Surface
            What they are meshes of.
        subset_of : callable
            Returns the subset (N,) that a rung begins with.
        seconds : float, optional
            All that are left, for all rungs that are left; the result then depends on the machine.
        most : int
            How many at most.
        n_threads : int, optional
            Threads to share them among; as many as there are cores by default.
        finished : callable, optional
            Called when a rung is finished, by its thread.
        """
        ground = freedom_of(surface, "free meshes", centroids=self.centroids)
        todo = self.todo
        now = todo[:most]
        abreast = threads_for(len(now), n_threads)
        waiting = float(self.shares[todo].sum())
        books = threading.Lock()
        # the second entry is set by Ctrl-C alone
        stop = np.zeros(2, np.bool_)

        def work(rung: int) -> None:
            nonlocal waiting
            own, slower = None, 1.0
            with books:
                if limit is not None:
                    # threads work side by side, but no rung on more than one
                    own = (limit - time.perf_counter()) * min(abreast * self.shares[rung] / waiting, 1.0)
                    if self.thought > 0.0:  # more on a machine that is slow or busy
                        slower = max(self.took / self.thought, 1.0)
                waiting -= self.shares[rung]
            found = self._found(ground, surface, subset_of(rung), rung, own, slower, stop)
            if found is None:
                return
            front, thought, took = found
            with books:
                self.fronts[rung] = front
                if limit is not None:
                    self.thought += thought
                    self.took += took
            if finished is not None:
                finished()

        if not self.fronts and now:  # compiling is not their time
            on_threads(lambda rung: self.compile_for(surface, subset_of(rung)), now[:1], n_threads=n_threads)
        limit = None if seconds is None else time.perf_counter() + seconds
        # a rung that is a little late is not thrown away
        with stopping(stop[:1], None if seconds is None else seconds + LATE):
            on_threads(work, now, stop=stop, n_threads=n_threads)

    def compile_for(self, surface: Surface, kept: BoolArray) -> None:
        """Call what is compiled, so that it is, on a subset (N,) that stays as it is."""
        ground = freedom_of(surface, "free meshes", centroids=self.centroids)
        with ground.triangulation(kept, min_height=self.min_height) as mesh:
            mesh.anneal(0, np.ones(1, np.uint64), hot=0.0, cold=0.0, triangles=0)
            _thinned(mesh, surface, ground.share, np.zeros(2, np.int64), np.ones(1, np.bool_))

    def _found(
        self,
        ground: Any,
        surface: Surface,
        kept: BoolArray,
        rung: int,
        seconds: float | None,
        slower: float,
        stop: BoolArray,
    ) -> tuple[FreeFront, float, float] | None:
        """Return what is found on a rung, and what all but the annealing was thought to take, and took [s].

        It takes ``slower`` times as long as on a machine of its own. None: it was stopped before it was annealed.
        """
        begun = time.perf_counter()
        sizes = self._wanted(rung)
        n_samples = surface.n_vertices + len(ground.share)
        thought = SECONDS_A_TRIANGLE * int(sizes[0]) + (SECONDS_A_SAMPLE + MEASURING * len(sizes)) * n_samples
        if seconds is not None:
            seconds -= thought * slower
        if stop[0]:
            return None
        with ground.triangulation(kept, min_height=self.min_height) as mesh:
            until = None if seconds is None else begun + seconds
            heat = self._heat(int(sizes[0]), surface.n_vertices)
            ready = time.perf_counter()
            moves = _anneal(mesh, sizes[0], self.seeds[rung], self.planned[rung], until, heat, stop)
            if moves is None:
                return None
            annealed = time.perf_counter()
            faces = mesh.faces.astype(np.int32)
            removed, onto, collapses, table = _thinned(mesh, surface, ground.share, sizes, stop)
        took = time.perf_counter() - annealed + ready - begun
        return None if stop[1:].any() else (FreeFront(faces, removed, onto, collapses, table, moves), thought, took)

    def _heat(self, size: int, n_vertices: int) -> float:
        """Return the temperature in the beginning, in units of the cost per vertex that may move."""
        if n_vertices > LARGE:
            return HOT_LARGE
        return HOT if self.min_height > 0.0 else HOT * max(size / (2.0 * n_vertices * SPARSE_SHARE), 1.0) ** 0.5

    def _wanted(self, rung: int) -> IntArray:
        """Return the sizes that a rung is measured at, its own first, down to the next smaller one.

        Collapses inside the mesh take two triangles away. Where that matters it goes on to the one after that, so that
        of rungs that are odd and even in turn one or the other has nearly every size.
        """
        size = self.sizes[rung]
        below = self.sizes[max(rung - (1 + (size * STEP < 1.0)), 0)]
        between = self.offered[(self.offered < size) & (self.offered > below)]
        return np.concatenate([[size], between[::-1], [below] if below < size else []]).astype(np.int64)

    # ------------------------------------------------------------------------------------------- what comes out of it

    def best_of(
        self,
        surface: Surface,
        measures: Sequence[str],
        triangles: IntArray,
        errors: FloatArray,
        surface_error: FloatArray | None = None,
        *,
        n_threads: int | None = None,
    ) -> list[FreeMesh | None]:
        """Return for each of some meshes the best free one that is no larger, and better; None where there is none.

        Parameters
        ----------
        surface : Surface
            Of all these meshes.
        measures : sequence of str
            Which errors are meant: the first must be lower and decides, the others must not be higher.
        triangles, errors : (P,) and (P, k) arrays
            Of the meshes.
        surface_error : (P,) float array, optional
            Of the meshes, if it must not be higher; NaN where it is not known, and not compared.
        n_threads : int, optional
            Threads that make them; as many as there are cores by default.
        """
        table = self._table()
        chosen = self._chosen(surface, table, measures, triangles, errors, surface_error)
        found = self._meshes(surface, table, chosen[chosen >= 0], n_threads)
        return [found.get(int(place)) for place in chosen]

    def by_gain(self, surface: Surface, measures: Sequence[str], triangles: IntArray, errors: FloatArray) -> IntArray:
        """Return the places of the meshes for which :meth:`best_of` has one, those first whose error it lowers most.

        The surface error, which is not known of all of them yet, is not compared.
        """
        table = self._table()
        chosen = self._chosen(surface, table, measures, triangles, errors)
        places = np.flatnonzero(chosen >= 0)
        left = _values(table, measures[0], surface)[chosen[places]] / errors[places, 0]
        return places[np.argsort(left, kind="stable")]

    def _chosen(
        self,
        surface: Surface,
        table: FloatArray,
        measures: Sequence[str],
        triangles: IntArray,
        errors: FloatArray,
        surface_error: FloatArray | None = None,
    ) -> IntArray:
        """Return the row of the table that :meth:`best_of` takes for each mesh, -1 where it takes none."""
        chosen = np.full(len(triangles), -1)
        own = np.column_stack([_values(table, name, surface) for name in measures])
        order = np.lexsort((table[:, TRIANGLES], own[:, 0]))
        own, sizes, between = own[order], table[order, TRIANGLES], table[order, BETWEEN]
        for k in range(len(triangles)):
            fits = (sizes <= triangles[k]) & (own[:, 0] < errors[k, 0]) & (own <= errors[k]).all(axis=1)
            if surface_error is not None and not np.isnan(surface_error[k]):
                fits &= between <= surface_error[k]
            if fits.any():
                chosen[k] = order[np.argmax(fits)]
        return chosen

    def wished(
        self, surface: Surface, measure: str, limits: Mapping[str, float], *, uncovered: float = np.inf
    ) -> FreeMesh | None:
        """Return the free mesh that limits ask for, by measure; None where none holds them all.

        With a number of triangles that of the least error (``measure``), else the smallest. It leaves no more than
        ``uncovered`` vertices uncovered; its surface error may be any, as what is wished for need not say it.
        """
        table = self._table()
        if not len(table):
            return None
        values = {name: _values(table, name, surface) for name in {*limits, measure}}
        fitting = np.flatnonzero((shortfall(values, limits) == 0.0) & (table[:, UNCOVERED] <= uncovered))
        if not len(fitting):
            return None
        by_size, by_error = table[fitting, TRIANGLES], values[measure][fitting]
        order = np.lexsort((by_size, by_error) if "triangles" in limits else (by_error, by_size))
        place = int(fitting[order[0]])
        return self._meshes(surface, table, np.array([place]))[place]

    def _table(self) -> FloatArray:
        """Return the numbers of all meshes (J, 7), rung by rung."""
        tables = [self.fronts[rung].table for rung in sorted(self.fronts)]
        return np.concatenate(tables) if tables else np.empty((0, REGIONS + 1))

    def _meshes(
        self, surface: Surface, table: FloatArray, places: IntArray, n_threads: int | None = None
    ) -> dict[int, FreeMesh]:
        """Return the meshes of some rows of the table."""
        rungs = sorted(self.fronts)
        first = np.cumsum([0, *(len(self.fronts[rung].table) for rung in rungs)])
        found: dict[int, FreeMesh] = {}

        def add(k: int) -> None:
            own = [place for place in np.unique(places).tolist() if first[k] <= place < first[k + 1]]
            faces = self.fronts[rungs[k]].faces_of([place - int(first[k]) for place in own], surface.n_vertices)
            found.update({place: _mesh(surface, mesh, table[place]) for place, mesh in zip(own, faces, strict=True)})

        on_threads(add, range(len(rungs)), n_threads=n_threads)
        return found


def _values(table: FloatArray, name: str, surface: Surface) -> FloatArray:
    """Return a measure of each mesh of a table (J, 7)."""
    of = MEASURES[name].of
    assert of is not None  # neither an objective nor a wish is of the whole mesh
    values: FloatArray = of(table, surface.total_weight)
    return values


def ladder_of(low: int, high: int, n: int = RUNGS) -> IntArray:
    """Return about n numbers of triangles from ``low`` to ``high``, odd and even in turn; see `SMALL_SHARE`.

    Examples
    --------
    >>> ladder_of(2, 60, 6).tolist(), ladder_of(2, 60_000, 6).tolist()
    ([2, 5, 8, 17, 32, 61], [2, 185, 910, 3779, 15124, 60001])
    """
    shift = SMALL_SHARE * high
    sizes = np.unique(np.round(np.geomspace(low + shift, high + shift, n) - shift).astype(np.int64))
    return np.unique(sizes + (sizes - sizes[0] + np.arange(len(sizes))) % 2)


def usual_shares(sizes: IntArray, n_vertices: int) -> FloatArray:
    """Return how much of the time rungs have; see `TIME_POWER`.

    Examples
    --------
    >>> usual_shares(np.array([20, 200, 2000]), 1000).round(2).tolist()
    [0.16, 0.38, 0.05]
    """
    of_all = np.minimum(sizes / (2.0 * n_vertices), 1.0)
    shares: FloatArray = of_all**TIME_POWER * (1.05 - of_all)
    return shares


def steps_between(low: int, high: int) -> IntArray:
    """Return numbers of triangles from ``low`` to ``high`` that differ by `STEP`, or by 1.

    Examples
    --------
    >>> steps_between(2, 6).tolist(), steps_between(1000, 1050).tolist()
    ([2, 3, 4, 5, 6], [1000, 1012, 1025, 1037, 1050])
    """
    n = int(np.ceil(np.log(high / low) / np.log1p(STEP))) + 1
    return np.unique(np.round(np.geomspace(low, high, n)).astype(np.int64))


def rungs_of(F: FloatArray, limits: Mapping[str, float], answer: int | None) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the rungs for a front (S, 2) of error and triangles, ascending, their shares, and the sizes offered.

    Where a mesh is wished for they are around it: row ``answer``, or what ``limits`` say of the triangles.
    """
    triangles = np.unique(F[F[:, 0] > 0.0, 1]).astype(np.int64)
    if not len(triangles):
        return triangles, np.empty(0), triangles
    if answer is None:
        return _some(triangles, RUNGS), np.ones(min(RUNGS, len(triangles))), triangles
    around = AROUND_A_SIZE if "triangles" in limits else AROUND_AN_ERROR
    size = limits.get("triangles", F[answer, 1])
    rungs = [(max(int(share * size), int(triangles[0])), weight) for share, weight in around]
    rungs += [(int(other), OTHERS_SHARE) for other in _some(triangles, N_OTHERS)]
    rungs.sort()
    sizes, shares = (np.array(column) for column in zip(*rungs, strict=True))
    steps = steps_between(int(min(around)[0] * size) or 1, int(max(around)[0] * size) or 1)
    return sizes, shares, np.union1d(triangles, steps)


def _some(numbers: IntArray, n: int) -> IntArray:
    """Return n of them at most, even in their order."""
    return numbers[np.unique(np.round(np.linspace(0, len(numbers) - 1, min(n, len(numbers)))).astype(int))]


def guarding(surface: Surface) -> tuple[str, ...]:
    """Return what else must not rise, whatever is minimised: uncovered vertices where they cost nothing."""
    return ("uncovered",) if surface.rules.outside == "ignore" else ()


def in_turn(order: IntArray, measure: Callable[[int], Any], until: float | None, n_threads: int | None = None) -> None:
    """Measure places in their order, the first `LEAST_COMPARED` always, others that begin by ``until``; warn of others.

    They are what free meshes are compared with: where nothing is known of one, the free mesh is taken all the same, as
    the error between the vertices was lowered, too.
    """
    left_out = []

    def do(turn: int) -> None:
        if turn < LEAST_COMPARED or until is None or time.perf_counter() < until:
            measure(int(order[turn]))
        else:
            left_out.append(turn)

    on_threads(do, range(len(order)), n_threads=n_threads)
    if left_out:
        warnings.warn(
            f"{len(left_out)} of {len(order)} free meshes are taken without a comparison of their surface error, for "
            "which there was no time; search longer to have all compared",
            SearchWarning,
            stacklevel=3,
        )


def _divided(moves: int, pace: FloatArray, most: IntArray) -> IntArray:
    """Divide moves among rungs by their pace, so that none makes more than its most.

    >>> _divided(100, np.array([1.0, 1.0, 2.0]), np.array([10, 1000, 1000])).tolist()
    [10, 30, 60]
    """
    found = np.zeros(len(pace), np.int64)
    left, of = moves, float(pace.sum())
    # those first that need least of their share: what they leave is for the others
    for rung in np.argsort(most / pace, kind="stable"):
        found[rung] = min(round(left * (pace[rung] / of)), int(most[rung]))
        left, of = left - int(found[rung]), of - pace[rung]
    return found


def _anneal(
    mesh: Any, size: int, seed: int, most: int, until: float | None, heat: float, stop: BoolArray
) -> int | None:
    """Anneal a mesh at a number of triangles; return the moves that were made, None where it was stopped on its way."""
    state = np.array([seed], np.uint64)
    size, most = int(size), int(most)
    hot = heat * mesh.cost / max(mesh.movable, 1)
    if until is None:
        last = round(TAIL * most)
        made = mesh.anneal(most - last, state, hot=hot, cold=COOLING * hot, triangles=size, stop=stop)
        made += mesh.anneal(last, state, hot=0.0, cold=0.0, triangles=size, stop=stop)
        return None if stop[0] else int(made)
    begun = time.perf_counter()
    span = max(until - begun, 1e-9)
    made, share = 0, 0.0
    while share < 1.0:
        now = 0.0 if share > 1.0 - TAIL else hot * COOLING ** (share / (1.0 - TAIL))
        n = min(FEW_MOVES if made == 0 else max(int(PAUSE * made / share), FEW_MOVES), most - made)
        made += mesh.anneal(n, state, hot=now, cold=now, triangles=size, stop=stop)
        if stop[0]:
            return None
        share = max((time.perf_counter() - begun) / span, made / max(most, 1))
    return made


def _thinned(
    mesh: Any, surface: Surface, share: FloatArray, sizes: IntArray, stop: BoolArray
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Thin a mesh to these sizes; return the vertices that collapsed and what they fell on, and what was measured."""
    n = surface.n_vertices
    removed, cost, triangles = np.empty(n, np.int32), np.empty(n + 1), np.empty(n + 1, np.int32)
    collapses, table = np.zeros(len(sizes), np.int64), np.full((len(sizes), REGIONS + 1), np.nan)
    n_removed, n_measured = _thin(
        mesh.freedom,
        mesh.books,
        surface.n_vertices,
        mesh.held,
        sizes,
        share,
        stop,
        removed,
        cost,
        triangles,
        collapses,
        table,
    )
    removed = removed[:n_removed].copy()
    return removed, mesh.freedom.onto[removed], collapses[:n_measured].copy(), table[:n_measured].copy()


def _mesh(surface: Surface, faces: IntArray, row: FloatArray) -> FreeMesh:
    """Return a free mesh with its numbers."""
    kept = surface.pinned.copy()
    kept[used_rows(faces)[0]] = True
    quality = as_quality(
        row[:REGIONS],
        surface.total_weight,
        surface_error=float(row[BETWEEN]),
        **measured_angles(surface.points[:, : surface.places.shape[1]], faces),  # of heights: in the plane
    )
    return FreeMesh(kept, faces, quality)
