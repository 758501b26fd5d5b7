"""Search that starts from the greedy pass and anneals down a ladder of sizes: the front to beat.

The population is a ladder: every rung is a number of triangles and holds the best mesh found of at most that many. In a
generation some rungs, far apart, get a child each, annealed at the rung's size: in the first generation their own
mesh, in the following ones, one rung lower each, the mesh of the rung above, so that good places are handed down the
ladder (Ho, Shu, Chen 2004 call the passing on of solutions between neighbouring sizes inheritance). When all rungs have
had their turn, a sweep, the next sweep begins, with twice as many moves, or with as many as a budget in moves or time
has left. One slow sweep gives better meshes than several quick ones.

The error on a rung never grows, so the front is never worse than the thinning it started from.

With free meshes a sweep or two are only the beginning: some rungs of the ladder are then annealed freely, as
:mod:`~meshsimp_pymoo.search.free` says, and what is best of them is kept beside the individuals, whose objectives are
those of their subsets all the same.
"""

from __future__ import annotations

import time
import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.mating import Mating
from pymoo.core.population import Population
from pymoo.core.survival import Survival
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.termination.max_gen import MaximumGenerationTermination
from pymoo.util.display.multi import MultiObjectiveOutput
from pymoo.util.optimum import filter_optimum

from meshsimp_pymoo.arrays import spread
from meshsimp_pymoo.errors import SearchWarning
from meshsimp_pymoo.reprs import of_algorithm
from meshsimp_pymoo.search.budgets import Moves, compiling_left_out, part_of, seconds_given, stopping
from meshsimp_pymoo.search.free import (
    ABREAST,
    LARGE,
    RUNGS,
    SUBSETS_SHARE,
    FreeLadder,
    guarding,
    in_turn,
    ladder_of,
    steps_between,
)
from meshsimp_pymoo.search.greedy import NestedFront, thinning
from meshsimp_pymoo.search.local_search import USUAL_MOVES, WINDOWED_FROM, MoveShares, relocate_all
from meshsimp_pymoo.search.operators import NestedSubsets, PackedDuplicates, PinnedCorners
from meshsimp_pymoo.search.requirements import surface_of
from meshsimp_pymoo.search.starting import Start, at_hand
from meshsimp_pymoo.surface.rules import USUAL_RATIO
from meshsimp_pymoo.surface.surface import Surface, freedom_of, movable_ground
from meshsimp_pymoo.workers import on_threads, threads_for

# Rungs that get a child in the same generation; and the generations that pass so many of the largest rungs each, which
# have most of the moves, before the others have their turn. They are much alike: where one of them had but smaller ones
# beside it eight cores waited for it. Two generations would share better, and hand down less.
CHAINS = 16
TOP_GENERATIONS = 3
# Above this share of the vertices a rung gets no more moves than there, however many it keeps.
FULL_SHARE = 0.25
# Of large models, for which there is little time, it gets the fewer the more it keeps; with a deadline
# none unless there is one for each of its vertices, as building its mesh takes longer. Smaller rungs get the fewer the
# more their moves take, by the root. The first of a chain, to which nothing was handed down, gets so much more.
BEGINNING = 2.0
# Vertices of the model for each kept one from which on looking at them takes most of a move's time; and what building a
# rung's mesh, thinning and measuring it take about, in moves, for each vertex and each kept one.
CROWD = 15.0
BUILDING = (0.35, 3.0)
# Temperatures, in units of the error per kept vertex, and the share left in the end: where a chain begins, and below.
FRESH = (0.3, 0.03)
AGAIN = (0.15, 0.1)
# Moves a kept vertex in the first sweep unless told: as many as make this total, within the bounds.
TOTAL_MOVES = 2e7
MOVES_PER_VERTEX = (20.0, 1000.0)
# With a budget in moves or time: the share of the first sweep, the most moves a kept vertex, and seconds a move before
# any is timed.
FIRST_SHARE = 0.12
SLOWEST = 4000.0
SECONDS_A_MOVE = 7.5e-7
# Large models have no quick sweep where there are fewer moves than these for each kept vertex: meshes of all rungs are
# built, thinned and measured in either sweep, which takes as long as some ten moves for each.
ONE_SWEEP = 150.0
# What measuring a subset takes for each vertex of the model, about [s]; and the share of the time that measuring the
# first population may take, which has so many individuals all the same, and the ladder as many rungs: in a sweep each
# takes some five times as long to be built, thinned and measured. The second share is where no sweep follows.
SECONDS_A_VERTEX = 8e-8
FIRST_MEASURED, ONLY_MEASURED = 0.04, 0.15
FEWEST = 16
# Share of the time, and at least so many seconds a million vertices, kept for filling the gaps between the rungs; but
# never more than the second share, or the third with free meshes.
LAST_SHARE = 0.03
FILL_SECONDS = 40.0
MOST_SHARE, MOST_FREE_SHARE = 0.25, 0.3
# With free meshes as much again of the time, and seconds a million vertices, for measuring what they are to be better
# than; large models have nothing to be filled then but what their thinning has.
FREE_SECONDS = 25.0
# The share of what is left in the end for that; the rest is for making the meshes that are chosen.
MEASURED_LAST = 0.7
# The search ends after so many generations, and two sweeps, that found nothing new; each of them begins hotter.
IDLE = 12
# In the final front neighbours differ by this share of the error, or by the smaller one where a rung is better than the
# thinned model by less than twice the first, so that no gap is worse than thinning; with at most so many meshes between
# two rungs and so many entries of their subsets in all.
STEP = 0.015
SMALL_STEP = 0.008
BETWEEN = 24
ENTRIES = 2e8
# What edges can be chosen by, and the generations of those that are chosen for the error.
TRIANGULATIONS = ("delaunay", "free")
FREE_GENERATIONS = -(-RUNGS // ABREAST)


class SizeLadder(Survival):
    """On every rung the individual of least error among those of at most so many triangles.

    Rungs are numbers of triangles, those of the first population unless they are set before.
    """

    def __init__(self) -> None:
        super().__init__(filter_infeasible=False)
        self.rungs: NDArray[Any] | None = None

    def best(self, problem: Any, pop: Population) -> NDArray[np.int64]:
        """Return for each rung the row of its best individual in the population, -1 where none is small enough."""
        if self.rungs is None:
            self.rungs = np.unique(pop.get("F")[:, 1])
        return _best_rows(problem, pop, self.rungs)

    def _do(self, problem: Any, pop: Population, *args: Any, n_survive: int | None = None, **kwargs: Any) -> Population:
        rows = self.best(problem, pop)
        return pop[np.unique(rows[rows >= 0])]


def _best_rows(problem: Any, pop: Population, rungs: NDArray[Any]) -> NDArray[np.int64]:
    """Return for each number of triangles the row of the best individual of at most that many, -1: there is none."""
    F = pop.get("F")
    violation = pop.get("CV").ravel() if problem.has_constraints() else np.zeros(len(pop))
    # By violation, then error, then triangles: the first of those small enough is a rung's best.
    order = np.lexsort((F[:, 1], F[:, 0], violation))
    triangles = F[order, 1]
    rows = np.full(len(rungs), -1)
    for k, rung in enumerate(rungs):
        fitting = np.flatnonzero(triangles <= rung)
        if len(fitting):
            rows[k] = order[fitting[0]]
    return rows


class Loads(NamedTuple):
    """What each rung of a ladder is to have, and what that takes.

    Attributes
    ----------
    n_kept : (R,) int array
        Vertices that it keeps and that may move.
    work : (R,) float array
        Its share of the moves: of a small one as many as it keeps vertices.
    effort : (R,) float array
        What one of them takes, in units of a move on a mesh that keeps most vertices.
    building : (R,) float array
        What all but the moves takes, in that unit.
    is_full : (R,) bool array
        Whether it keeps more than `FULL_SHARE`.
    """

    n_kept: NDArray[np.int64]
    work: NDArray[np.float64]
    effort: NDArray[np.float64]
    building: NDArray[np.float64]
    is_full: NDArray[np.bool_]


class DownTheLadder(Mating):
    """Children of the next larger rung, annealed at the rung's size; see the module's text.

    Parameters
    ----------
    ladder : SizeLadder
        The rungs.
    moves_per_vertex : float, optional
        Moves for each kept vertex in the first sweep; twice as many in each later one, up to 1000. By default as many
        as take some tens of seconds. With a budget in moves or time as many as fit.
    n_chains : int
        Children in a generation, on rungs far apart.
    inherit : bool
        Whether a rung is given the mesh of the rung above, or goes on from its own.
    heat : float
        Factor of all temperatures; 0 accepts improvements only.
    shares : MoveShares
        How often each kind of move is tried.
    """

    def __init__(
        self,
        ladder: SizeLadder,
        moves_per_vertex: float | None = None,
        *,
        n_chains: int = CHAINS,
        inherit: bool = True,
        heat: float = 1.0,
        shares: MoveShares = USUAL_MOVES,
        **kwargs: Any,
    ) -> None:
        super().__init__(None, None, None, **kwargs)
        self.ladder = ladder
        self.moves_per_vertex = moves_per_vertex
        self.n_chains = n_chains
        self.inherit = inherit
        self.heat = heat
        self.shares = shares
        self.sweep = 0
        self.step = 0
        self.first_share = FIRST_SHARE
        self.moves_done = 0
        self.effort = 0.0
        self.begun = 0.0

    def do(
        self,
        problem: Any,
        pop: Population,
        n_offsprings: int,
        *,
        random_state: np.random.Generator,
        algorithm: Any = None,
        **kwargs: Any,
    ) -> Population:
        """Return the children of the rungs whose turn it is, not evaluated."""
        rungs = self.ladder.rungs
        assert rungs is not None
        rows = self.ladder.best(problem, pop)
        sweep = turns(len(rungs), self.n_chains)
        turn, is_first = sweep[self.step]
        turn = turn[rows[turn] >= 0]
        # A chain begins with its own first rung, shaken thoroughly, and hands the result down.
        fresh = is_first or not self.inherit
        temperature, cooling = FRESH if fresh else AGAIN
        temperature *= self.heat * (1 + getattr(algorithm, "idle", 0))
        loads = self._loads(problem, pop, rows, np.concatenate([rungs for rungs, is_first in sweep if is_first]))
        moves = self._moves(problem, algorithm, loads, turn, np.concatenate([rungs for rungs, _ in sweep[self.step :]]))
        if problem.n_var >= WINDOWED_FROM and time_limit(algorithm) is not None:
            turn, moves = turn[moves > 0], moves[moves > 0]
        parents = rows[turn if fresh else turn + 1]
        limit = time_limit(algorithm, _subsets_share(algorithm))
        children = relocate_all(
            problem.surface,
            np.array([individual.X for individual in pop[parents]]),
            moves,
            random_state,
            triangles=rungs[turn].astype(int),
            seconds=None if limit is None else limit[1],
            made=moves,
            temperature=temperature,
            cooling=cooling,
            shares=self.shares,
        )
        self.moves_done += int(moves.sum())
        self.effort += float((moves * loads.effort[turn] + loads.building[turn]).sum())
        self.step += 1
        if self.step >= len(sweep):
            self.step = 0
            self.sweep += 1
        return self.eliminate_duplicates.do(Population.new(X=children), pop)

    def _loads(self, problem: Any, pop: Population, rows: NDArray[np.int64], first: NDArray[np.int64]) -> Loads:
        """Return what each rung is to have; chains begin with the ``first`` ones."""
        movable = ~problem.pinned
        n_kept = np.array([np.count_nonzero(individual.X & movable) for individual in pop])[np.maximum(rows, 0)]
        n_kept, full = np.maximum(n_kept, 1), FULL_SHARE * problem.n_var
        work, effort = np.minimum(n_kept, full), 1.0 + problem.n_var / (CROWD * n_kept)
        if problem.n_var >= WINDOWED_FROM:
            work *= full / np.maximum(n_kept, full) / np.sqrt(effort)
            work[first] *= BEGINNING if self.inherit else 1.0
        return Loads(n_kept, work, effort, BUILDING[0] * problem.n_var + BUILDING[1] * n_kept, n_kept > full)

    def _moves(
        self, problem: Any, algorithm: Any, loads: Loads, turn: NDArray[np.int64], still: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return the moves of the rungs whose turn it is; ``still`` are those that are left in a sweep."""
        within = part_of(getattr(algorithm, "termination", None), Moves)
        share = _subsets_share(algorithm)
        deadline = time_limit(algorithm, share)
        n_within = None if within is None else round(share * within.n_max_moves)
        is_large, work, effort = problem.n_var >= WINDOWED_FROM, loads.work, loads.work * loads.effort
        if deadline is not None and not self.effort:
            self.begun = time.time() - algorithm.start_time
        spent = 0.0 if deadline is None else time.time() - algorithm.start_time - self.begun
        a_unit = spent / self.effort if self.effort else SECONDS_A_MOVE / threads_for(len(turn))
        if is_large and self.sweep == self.step == 0:
            pace = np.inf if n_within is None else n_within / work.sum()
            if deadline is not None:
                pace = min(pace, (deadline[1] / a_unit - loads.building.sum()) / effort.sum())
            if pace < ONE_SWEEP:
                self.first_share = 1.0
        if deadline is not None or n_within is None:

            def paced(rungs: NDArray[np.int64]) -> float:
                one, rest = effort[rungs].sum() * a_unit, loads.building[rungs].sum() * a_unit
                return self._pace(deadline, one, rest, work.sum())

            def paying(pace: float) -> NDArray[np.bool_]:
                return ~loads.is_full | (pace * work >= loads.n_kept)

            pace = paced(still)
            if is_large and deadline is not None:
                left = still[paying(pace)[still]]
                if len(left):  # what is saved where it does not pay is for the others, if there are any
                    pace = paced(left)
                    work = np.where(paying(pace), work, 0.0)
            moves = np.ceil(pace * work[turn])
        if n_within is not None:
            planned = self._share_of(n_within, loads.work[turn], loads.work[still].sum())
            moves = planned if deadline is None else np.minimum(moves, planned)
        return moves.astype(np.int64)

    def _pace(self, deadline: tuple[float, float, float] | None, one: float, rest: float, whole: float) -> float:
        """Return the moves for each kept vertex.

        On what is left of a sweep one for each takes ``one`` seconds, and all but the moves ``rest``.
        """
        if deadline is None:
            lowest, highest = MOVES_PER_VERTEX
            given = self.moves_per_vertex
            first = min(max(TOTAL_MOVES / whole, lowest), highest) if given is None else given
            return min(first * 2.0**self.sweep, max(first, highest))
        span, remaining, _ = deadline
        if self.sweep == 0:
            remaining -= (1.0 - self.first_share) * span
        return min(max((remaining - rest) / one, 1.0), SLOWEST)

    def _share_of(self, n_moves: int, work: NDArray[np.float64], left: float) -> NDArray[np.float64]:
        """Return the moves of rungs of so much work out of a number for the whole search, which they never exceed."""
        of_sweep = round(self.first_share * n_moves) if self.sweep == 0 else n_moves
        whole = min(round((of_sweep - self.moves_done) * (work.sum() / left)), int(SLOWEST * work.sum()))
        return np.diff(np.round(np.cumsum(work) / work.sum() * whole), prepend=0.0)


def turns(n_rungs: int, n_chains: int = CHAINS) -> list[tuple[NDArray[np.int64], bool]]:
    """Return the rungs that have their turn in each generation of a sweep, and whether their chains begin with them.

    Rungs from the largest down are cut into chains, each of which does one rung a generation: the largest ones into
    short chains, then the others.

    Examples
    --------
    >>> [(rungs.tolist(), is_first) for rungs, is_first in turns(9, 2)]
    [([8, 5], True), ([7, 4], False), ([6, 3], False), ([2, 0], True), ([1], False)]
    """
    order = np.arange(n_rungs)[::-1]
    found = []
    for part in np.split(order, [min(TOP_GENERATIONS * n_chains, n_rungs)]):
        chains = [chain for chain in np.array_split(part, n_chains) if len(chain)]
        for step in range(max(map(len, chains), default=0)):
            found.append((np.array([chain[step] for chain in chains if step < len(chain)]), step == 0))
    return found


def time_limit(algorithm: Any, share: float = 1.0) -> tuple[float, float, float] | None:
    """Return the seconds a run has, or a share of them, those left of these, and those kept for its end.

    None: it has no limit.
    """
    whole = seconds_given(algorithm)
    if whole is None:
        return None
    n_var, is_free = algorithm.problem.n_var, getattr(algorithm, "free", None) is not None
    last = max(LAST_SHARE * whole, FILL_SECONDS * n_var / 1e6 if n_var <= LARGE or not is_free else 0.0)
    if is_free:
        last += LAST_SHARE * whole + FREE_SECONDS * n_var / 1e6
    last = min(last, (MOST_FREE_SHARE if is_free else MOST_SHARE) * whole)
    return share * whole, share * (whole - last) - (time.time() - algorithm.start_time), last


def _subsets_share(algorithm: Any) -> float:
    """Return the share of a budget that is for subsets; the rest is for free meshes."""
    if getattr(algorithm, "free", None) is None:
        return 1.0
    return 0.0 if algorithm.problem.n_var > LARGE else SUBSETS_SHARE


class MemeticSearch(GeneticAlgorithm):
    """The algorithm of :func:`memetic`; in the end it fills the gaps between the rungs.

    Attributes
    ----------
    free : FreeLadder or None
        The free meshes, if there are to be any.
    """

    pop: Any
    opt: Any

    def __init__(
        self, pop_size: int, triangles: tuple[int, int] | None, free: FreeLadder | None = None, **kwargs: Any
    ) -> None:
        super().__init__(pop_size, **kwargs)
        self.triangles = triangles
        self.free = free
        self.idle = 0

    def __repr__(self) -> str:
        sizes = "" if self.triangles is None else " of {:,} to {:,} triangles".format(*self.triangles)
        return of_algorithm(self, f"{self.pop_size:,} rungs{sizes}", *["free meshes"] * (self.free is not None))

    @property
    def moves(self) -> int:
        """Moves of the annealing that were made so far."""
        return int(self.mating.moves_done) + (0 if self.free is None else self.free.moves)

    def _setup(self, problem: Any, **kwargs: Any) -> None:
        if problem.n_obj != 2:
            raise ValueError(f"memetic() is for two objectives and the problem has {problem.n_obj}; use nsga3()")
        surface = surface_of(problem, self)
        movable_ground(surface, "the memetic search and its thinning")
        if self.free is not None:
            freedom_of(surface, "free meshes", centroids=self.free.centroids)
        super()._setup(problem, **kwargs)

    @property
    def _n_rungs(self) -> int:
        """How many rungs there are, and individuals in the beginning: with a deadline no more than fit."""
        seconds, n = seconds_given(self), self.pop_size
        share = FIRST_MEASURED if _subsets_share(self) > 0.0 else ONLY_MEASURED
        return n if seconds is None else min(n, max(measurable(self.problem, share * seconds), FEWEST))

    def _initialize_infill(self) -> Population:
        return self.initialization.do(self.problem, self._n_rungs, algorithm=self, random_state=self.random_state)

    def _initialize_advance(self, infills: Any = None, **kwargs: Any) -> None:
        ladder = self.survival
        if ladder.rungs is None:
            low, high = (int(f(infills.get("F")[:, 1])) for f in (np.min, np.max))
            if self.triangles is not None:
                low, high = max(low, self.triangles[0]), min(max(high, low), self.triangles[1])
            ladder.rungs = np.unique(np.round(np.geomspace(low, max(high, low), self._n_rungs)).astype(int))
        super()._initialize_advance(infills=infills, **kwargs)

    def _infill(self) -> Population:
        if self.free is not None and self._are_subsets_done():
            return self._anneal_freely(self.free)
        deadline = time_limit(self)
        if deadline is not None and deadline[1] <= 0.0:
            self.termination.force_termination = True
            return Population.create()
        children = self.mating.do(
            self.problem, self.pop, self.n_offsprings, algorithm=self, random_state=self.random_state
        )
        # All of them known: no child may be left to find, and a budget of evaluations would never be used up.
        self.idle = 0 if len(children) else self.idle + 1
        if self._is_idle() and self.free is None:
            self.termination.force_termination = True
        return children

    def _is_idle(self) -> bool:
        return self.idle >= max(IDLE, 2 * sweep_generations(self.pop_size))

    def _are_subsets_done(self) -> bool:
        """Whether free meshes have their turn: subsets have had their share, or one sweep where there is no budget."""
        share, end = _subsets_share(self), self.termination
        if share == 0.0 or self._is_idle():
            return True
        deadline, moves = time_limit(self, share), part_of(end, Moves)
        generations = part_of(end, MaximumGenerationTermination)
        if deadline is None and moves is None and generations is None:
            return self.mating.sweep > 0
        return (
            (deadline is not None and deadline[1] <= 0.0)
            or (moves is not None and self.mating.moves_done >= round(share * moves.n_max_moves))
            or (generations is not None and generations.n_max_gen - self.n_iter < FREE_GENERATIONS)
        )

    def _anneal_freely(self, free: FreeLadder) -> Population:
        """Anneal the next rungs freely; no subset comes of it."""
        limit, moves = time_limit(self), part_of(self.termination, Moves)
        F, surface = self.pop.get("F"), self.problem.surface
        deviates = F[F[:, 0] > 0.0, 1].astype(int)
        if not len(free.sizes) and len(deviates):
            low, high = int(deviates.min()), int(deviates.max())
            free.begin(
                surface,
                ladder_of(low, high),
                steps_between(low, high),
                self.random_state,
                moves=None if moves is None else moves.n_max_moves - self.mating.moves_done,
                timed=limit is not None,
            )
        n_left = len(free.todo)
        if n_left and (limit is None or limit[1] > 0.0):
            rows = _best_rows(self.problem, self.pop, free.sizes)
            free.go_on(
                surface,
                lambda rung: self.pop[rows[rung]].X | surface.pinned,
                seconds=None if limit is None else limit[1],
                n_threads=_threads(self.problem),
            )
        if not 0 < len(free.todo) < n_left:
            self.termination.force_termination = True
        return Population.create()

    def take_free(self, population: Population, *, until: float | None = None) -> None:
        """Keep beside each individual the best free mesh that is no larger and better; none, where there is none.

        It has a lower error, and no higher one between the vertices if it was searched by that too; nor does it leave
        more vertices uncovered where these cost nothing.

        Parameters
        ----------
        population : Population
            Such as ``algorithm.opt``.
        until : float, optional
            After ``perf_counter() = until`` no more of the individuals' meshes are measured between the vertices, but
            for a few; free meshes for the others are not compared by that, and a warning says how many they are.
        """
        free = self.free
        if free is None or not len(population):
            return
        surface, n_threads = self.problem.surface, _threads(self.problem)
        F, X = population.get("F"), population.get("X")
        others = guarding(surface)
        names = (self.problem.objectives[0], *others)
        triangles, errors = F[:, 1], np.column_stack([F[:, 0], *(population.get(name) for name in others)])
        between = np.full(len(X), np.nan)

        def measure(place: int) -> None:
            between[place] = surface.simplify(X[place] | surface.pinned).quality.surface_error

        if free.centroids:
            in_turn(free.by_gain(surface, names, triangles, errors), measure, until, n_threads)
        meshes = free.best_of(surface, names, triangles, errors, between, n_threads=n_threads)
        for one, mesh in zip(population, meshes, strict=True):
            one.set("free", mesh)

    def _advance(self, infills: Any = None, **kwargs: Any) -> None:
        if not len(infills):
            return
        self.pop = self.survival.do(
            self.problem,
            Population.merge(self.pop, infills),
            n_survive=self.pop_size,
            algorithm=self,
            random_state=self.random_state,
        )

    def next(self) -> None:
        """Do a generation; the time in which functions are compiled is not its own."""
        with compiling_left_out(self):
            super().next()

    def _finalize(self) -> None:
        self._add_between()
        if self.free is None:
            return
        limit = time_limit(self)
        left = None if limit is None else MEASURED_LAST * (limit[1] + limit[2])
        self.take_free(self.opt, until=None if left is None else time.perf_counter() + left)
        if (self.pop.get("F")[:, 0] > 0.0).any() and not self.free.fronts:
            said = "any size was annealed freely: all meshes are Delaunay"
        elif self.free.todo:
            said = (
                f"{len(self.free.todo)} of {len(self.free.sizes)} sizes were annealed freely: meshes there are those "
                "of other sizes, thinned, or Delaunay"
            )
        else:
            return
        warnings.warn(
            f"{self.problem.model.name}: the search ended before {said}; search longer", SearchWarning, stacklevel=2
        )

    def _add_between(self) -> None:
        """Add meshes between the rungs: the next larger rung's, thinned, or the thinned model, if that is better."""
        pop = self.pop
        surface = self.problem.surface
        evaluations = part_of(self.termination, MaximumFunctionCallTermination)
        asked = None if evaluations is None else evaluations.n_max_evals
        most = np.inf if asked is None else asked - self.evaluator.n_eval
        if most < 1:
            return
        limit = time_limit(self)
        seconds = None if limit is None else max(limit[1] + limit[2], 0.0)
        if seconds is not None and self.free is not None:
            seconds /= 2.0
        # where subsets were not searched there is nothing to thin
        share = 1.0 if _subsets_share(self) == 0.0 else 0.75
        X = between_the_rungs(
            surface,
            pop.get("X"),
            pop.get("F"),
            most=self.survival.rungs[-1],
            seconds=seconds,
            measured=None if seconds is None else measurable(self.problem, share * seconds),
        )
        if len(X):
            extra = self.eliminate_duplicates.do(Population.new(X=X), pop)
            if len(extra) > most:  # some of all over the ladder
                extra = extra[np.sort(spread(len(extra))[: int(most)])]
            self.evaluator.eval(self.problem, extra, algorithm=self)
            self.opt = filter_optimum(Population.merge(self.opt, extra), least_infeasible=True)


def measurable(problem: Any, seconds: float) -> int:
    """Return about how many subsets can be measured in this time."""
    return int((_threads(problem) or 1) * seconds / (SECONDS_A_VERTEX * problem.n_var))


def _threads(problem: Any) -> int | None:
    """Return the threads that the problem is evaluated on, if its runner has any."""
    return getattr(problem.elementwise_runner, "n_threads", None)


def between_the_rungs(
    surface: Surface,
    X: NDArray[np.bool_],
    F: NDArray[np.float64],
    *,
    most: float,
    seconds: float | None = None,
    measured: int | None = None,
) -> NDArray[np.bool_]:
    """Return subsets with numbers of triangles between those of X (P, N), by thinning each down to the next smaller.

    With ``seconds`` no more than can be found in half of that, spread over the ladder; and about ``measured`` at most.

    Beyond the most accurate of them, where keeping all vertices is not the best (a scan whose outline is not covered),
    those of the thinned model that are better, of at most ``most`` triangles.
    """
    order = np.argsort(F[:, 1], kind="stable")
    whole = at_hand(surface, seconds)
    most_rows = max(int(ENTRIES / (X.shape[1] * len(X))), 1)
    if measured is not None:
        most_rows = min(most_rows, max(measured // len(X), 1))
    stop = np.zeros(1, np.bool_)

    def fill(k: int) -> list[NDArray[np.uint8]]:
        low, high = F[order[k - 1], 1], F[order[k], 1]
        ratio = float(F[order[k - 1], 0]) / max(float(F[order[k], 0]), 1e-300)  # may be infinite
        by_thinning = _best_of(whole, high)[0]
        step = STEP if F[order[k], 0] < (1.0 - 2.0 * STEP) * by_thinning else SMALL_STEP
        n_rows = int(min(max(np.log(max(ratio, 1.0)) / step, 1.0), BETWEEN, most_rows))
        wanted = np.unique(np.round(np.linspace(low, high, n_rows + 2)[1:-1]))
        wanted = wanted[(wanted > low) & (wanted < high)]
        if stop[0] or not len(wanted):
            return []
        fronts: list[Start | NestedFront] = [whole]
        if F[order[k], 0] < by_thinning:
            # The rung is better than the thinned model: so may be what it is thinned to.
            fronts.append(thinning(surface, kept=X[order[k]], least=int(low), stop=stop))
        rows = []
        for size in wanted:
            best = min((_best_of(front, size) for front in fronts), key=lambda choice: choice[0])
            if best[0] < F[order[k - 1], 0]:
                rows.append(np.packbits(best[1].kept(best[2])))
        return rows

    gaps = np.arange(1, len(order))
    if seconds is not None:
        gaps = gaps[spread(len(gaps))]
    with stopping(stop, None if seconds is None else seconds / 2.0):
        found = [packed for rows in on_threads(fill, gaps.tolist(), stop=stop) for packed in rows]
    better = np.flatnonzero((whole.error < F[:, 0].min()) & (whole.triangles <= most))
    if len(better):
        best = better[np.argmin(whole.error[better])]
        better = better[better <= best]
        chosen = better[np.linspace(0, len(better) - 1, BETWEEN).astype(int)]
        found += [np.packbits(whole.kept(int(k))) for k in chosen]
    between = np.empty((len(found), X.shape[1]), np.bool_)
    for row, packed in zip(between, found, strict=True):
        row[:] = np.unpackbits(packed, count=len(row))
    return between


def _best_of(front: Start | NestedFront, most: float) -> tuple[float, Start | NestedFront, int]:
    """Return the least error of a front's meshes of at most so many triangles, the front and the mesh's row."""
    rows = np.flatnonzero((front.triangles > 0) & (front.triangles <= most))
    if not len(rows):
        return np.inf, front, 0
    k = int(rows[np.argmin(front.error[rows])])
    return float(front.error[k]), front, k


def memetic(
    pop_size: int = 100,
    *,
    triangles: tuple[int, int] | None = None,
    moves_per_vertex: float | None = None,
    triangulation: str = "delaunay",
    min_height: float = USUAL_RATIO,
    centroids: bool = True,
    **kwargs: Any,
) -> MemeticSearch:
    """Return the seeded memetic algorithm: thinning, then annealing down a ladder of sizes.

    It lowers the problem's measure of the error: a sum, or the maximum, which thinning goes by and annealing lowers
    through the sum of the eighth powers. By default it ends after one sweep of the ladder, some tens of seconds for
    thousands of vertices; with :class:`~meshsimp_pymoo.Moves` or a termination by time it takes as many moves as fit.
    Evaluations do not measure it: each child of a generation is one, however many moves it took.

    Parameters
    ----------
    pop_size : int
        Rungs of the ladder.
    triangles : (int, int), optional
        Smallest and largest number of triangles to look at; all by default.
    moves_per_vertex : float, optional
        Moves of the annealing for each kept vertex in the first sweep, twice as many in each later one, up to 1000. By
        default as many as make twenty million in all, within 20 and 1000; with a budget in moves or time as many as
        fit.
    triangulation : {"delaunay", "free"}
        With "free" some .3 of the budget are for subsets (nothing beyond thinning for models of more than 50 000
        vertices), the rest for free meshes: their edges are searched too. They are kept beside the individuals, as
        ``individual.get("free")``, where they are better: ``F`` of a result is that of ``X`` all the same, and
        :meth:`Front.from_result` takes them over. Where there is no budget thirty million free moves are made, more for
        large models.
    min_height : float
        Least height of the triangles that free meshes come to have, as a share of their longest edge; 0: any.
    centroids : bool
        Whether free meshes are searched by the error at the centroids of the original's faces, too, and taken only
        where the surface error is not higher, or was not compared for want of time, of which a warning says how often.
        Otherwise they fit the vertices and may be wrong between them.
    **kwargs
        Further arguments of pymoo's ``GeneticAlgorithm``; they replace those set here.

    Raises
    ------
    ValueError
        If ``moves_per_vertex`` is negative, or what is said of free meshes makes no sense; when the search begins, if
        the surface has none.
    TypeError
        If ``kwargs`` has a selection, crossover or mutation, which this algorithm does in one step.

    Returns
    -------
    MemeticSearch
        A pymoo algorithm. Its result holds some meshes between the rungs beside the population's.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from meshsimp_pymoo import MeshProblem
    >>> problem = MeshProblem("roof:9")
    >>> result = minimize(problem, memetic(20, triangles=(2, 20)), ("n_gen", 4), seed=1)
    >>> sorted({(float(e), int(t)) for e, t in result.F}, key=lambda row: row[1])[-1]
    (0.0, 4)
    """
    if moves_per_vertex is not None and not moves_per_vertex >= 0:
        raise ValueError(f"moves_per_vertex = {moves_per_vertex} is no number of at least 0")
    if triangulation not in TRIANGULATIONS:
        raise ValueError(
            f"triangulation={triangulation!r} is unknown; use one of {', '.join(map(repr, TRIANGULATIONS))}"
        )
    is_free = triangulation == "free"
    if not is_free and (min_height, centroids) != (USUAL_RATIO, True):
        raise ValueError(
            f"min_height={min_height!r} and centroids={centroids!r} are for free meshes; give triangulation='free' too"
        )
    for name in ("selection", "crossover", "mutation"):
        if name in kwargs:
            raise TypeError(f"memetic() makes its children in one step; give mating=... in place of {name}=...")
    ladder = SizeLadder()
    duplicates = PackedDuplicates()
    defaults: dict[str, Any] = {
        "sampling": NestedSubsets(triangles),
        "mating": DownTheLadder(ladder, moves_per_vertex, eliminate_duplicates=duplicates),
        "survival": ladder,
        "repair": PinnedCorners(),
        "eliminate_duplicates": duplicates,
        "output": MultiObjectiveOutput(),
        "advance_after_initial_infill": True,
        "n_offsprings": CHAINS,
    }
    free = FreeLadder(min_height=min_height, centroids=centroids) if is_free else None
    algorithm = MemeticSearch(pop_size, triangles, free, **(defaults | kwargs))
    # What pymoo's constructor would put here cannot compare bool vectors.
    algorithm.termination = kwargs.get("termination", ("n_gen", sweep_generations(pop_size, free=is_free)))
    return algorithm


def sweep_generations(pop_size: int, *, free: bool = False) -> int:
    """Return the generations that a sweep of so many rungs takes, the first population and free meshes included."""
    return 1 + -(-pop_size // CHAINS) + FREE_GENERATIONS * free
