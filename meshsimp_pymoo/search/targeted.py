"""Search for one mesh: of so many triangles, or as accurate as is wished for; the front around it comes along.

The first population is an answer already: vertices are inserted greedily by the measure that is wished for, somewhat
beyond the wish, and thinned back to it and further down [1]_. Then meshes are annealed around that answer:

* for a number of triangles at exactly that size, and a few at neighbouring ones;
* for an error at several smaller sizes; then vertices are inserted into each mesh until the wish holds, and it is
  thinned while it does. The smallest is where the next generation begins, with sizes around the share that was best.
  For a maximum what is annealed away is what exceeds it, the sum of max(0, d_p - E).

Every generation makes as many moves as all before it, and the last one what is left of the budget: one slow
annealing gives better meshes than several quick ones, and the quick ones find out at which size it pays.

References
----------
.. [1] M. Garland, P. S. Heckbert, "Fast polygonal approximation of terrains and height fields", CMU-CS-95-181, 1995.
"""

from __future__ import annotations

import inspect
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, TypeVar

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.util.display.multi import MultiObjectiveOutput

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray, spread
from meshsimp_pymoo.errors import SearchWarning, meant
from meshsimp_pymoo.indicators import non_dominated
from meshsimp_pymoo.reprs import of_algorithm
from meshsimp_pymoo.search.budgets import Moves, compiling_left_out, part_of, seconds_given, stopping
from meshsimp_pymoo.search.greedy import NestedFront, greedy_insertion, thinning
from meshsimp_pymoo.search.local_search import relocate_all
from meshsimp_pymoo.search.memetic import measurable
from meshsimp_pymoo.search.operators import PackedDuplicates
from meshsimp_pymoo.search.requirements import surface_of
from meshsimp_pymoo.search.starting import Start
from meshsimp_pymoo.search.wishes import (
    SEARCHED,
    USUAL_BUDGET,
    beside,
    checked_limits,
    in_words,
    measure_for,
    shortfall,
)
from meshsimp_pymoo.surface.surface import Surface, error_of, movable_ground
from meshsimp_pymoo.workers import on_threads

# How far beyond the wish vertices are inserted before they are thinned back: times the triangles, or the error.
MORE_TRIANGLES = 2.5
LESS_ERROR = 0.5
# Meshes of the first population: as many as are measured in a second or so, but never fewer.
MEASURED = 1.5e7
FEWEST = 8
# Attempts in a generation at sizes that differ by this share of the smallest that holds, and its bounds.
ATTEMPTS = 4
STEP = 0.08
STEPS = (0.002, 0.24)
# For a number of triangles: the sizes that are annealed, as shares of it, and their shares of the moves.
SIZES = (1.0, 1.0, 0.85, 1.18)
SIZE_MOVES = (1.0, 1.0, 0.25, 0.25)
# The first generation's share of the budget, which is enough to learn how long a move takes; where there is no budget
# its moves a kept vertex; and the most that a generation makes.
FIRST = 1 / 40
PILOT = 50.0
SLOWEST = 4000.0
# Seconds a move before any is timed: about so many, and so many for each of the model's vertices in a triangle. And
# what it takes to begin with a mesh, for each vertex of the model: a generation whose beginning takes more than this
# share of the time that is left is the last.
SECONDS_A_MOVE = (6e-7, 1.7e-7)
SECONDS_TO_BEGIN = 1e-6
LONG_BEGIN = 0.1
# With fewer moves than these for each kept vertex a thinned mesh is not heated as much.
FEW_MOVES = 40.0
# What is kept for the end, and the most meshes that are added then.
LAST_SHARE = 0.05
BETWEEN = 24
# Temperatures, in units of the error per kept vertex, and the share left in the end: from a thinned mesh, and from one
# that was annealed slowly at its size.
FRESH: dict[str, Any] = {"temperature": 0.3, "cooling": 0.03}
AGAIN: dict[str, Any] = {"temperature": 0.06, "cooling": 0.15}
# Where a maximum holds beside a sum: what the sum counts against what exceeds the maximum.
OWN = 0.01
# Where a maximum is missed at so many triangles: the share of the present one that it is brought down to next, and of
# the moves of such a generation, as finding the smallest mesh that holds it is what meets most wishes.
LOWERED = 0.9
AT_SIZE = 0.3
# By how much it is lowered where the sum decides among what holds it, as a share.
SLACK = 1e-3
# Generations without a better mesh, beyond the budget's, after which nothing more is expected.
IDLE = 12

Found = TypeVar("Found")


class TargetedSearch(Algorithm):
    """The algorithm of :func:`targeted`.

    Attributes
    ----------
    limits : dict of str to float
        What is wished for, by measure.
    within : dict of str to float
        Those of them that hold beside the problem's objectives.
    """

    pop: Any
    opt: Any
    problem: Any

    def __init__(self, limits: dict[str, float], pop_size: int, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.limits = limits
        self.pop_size = pop_size
        self.within: dict[str, float] = {}
        self.eliminate_duplicates = PackedDuplicates()
        self.step = STEP
        self.idle = 0
        self.is_annealed = False
        self.moves_done = 0
        self.seconds = 0.0
        #: What there is of the first answer until it is measured.
        self.begun: list[Start] = []

    def __repr__(self) -> str:
        return of_algorithm(self, in_words(self.limits))

    @property
    def moves(self) -> int:
        """Moves of the annealing that were made so far."""
        return self.moves_done

    @property
    def answer(self) -> Any:
        """The individual that comes nearest to the wish so far; it holds where its shortfall is 0."""
        return self.pop[_order(self.pop, self.limits)[0]]

    @property
    def missed(self) -> float:
        """By how much the answer misses the wish, as a share of it; 0: it holds."""
        return float(_missed(self.pop, self.limits)[_order(self.pop, self.limits)[0]])

    # ------------------------------------------------------------------------------------------------ for pymoo's loop

    def _setup(self, problem: Any, **kwargs: Any) -> None:
        require_for_a_wish(problem)
        surface = surface_of(problem, self)
        measure = problem.objectives[0]
        measure_for(self.limits, measure)
        movable_ground(surface, "a search for one mesh and its thinning")
        self.within = beside(self.limits, measure)
        super()._setup(problem, **kwargs)

    def _initialize_infill(self) -> Population:
        self._direct()
        starts = self.begun
        n = int(min(self.pop_size, max(MEASURED / self.problem.n_var, FEWEST)))
        evaluations = part_of(self.termination, MaximumFunctionCallTermination)
        if evaluations is not None:  # half of them for what is found later
            n = min(n, -(-evaluations.n_max_evals // 2))
        X = [start.kept(k) for start in starts for k in rungs(start, -(-n // len(starts)), self._wanted(start))]
        return self.eliminate_duplicates.do(Population.new(X=np.array(X)))

    def _initialize_advance(self, infills: Any = None, **kwargs: Any) -> None:
        self.begun = []
        self.pop = _survivors(infills, self.limits, self.within, self.pop_size)

    def _infill(self) -> Population:
        left = self._seconds_left()
        plan = self._plan(left) if left is None or left > 0.0 else None
        if plan is None:
            self.termination.force_termination = True
            return Population.create()
        parents, sizes, moves = plan
        begun, goal = self._clock(), self._goal
        made = moves.copy()
        few = moves.max() < FEW_MOVES * np.maximum(parents.sum(axis=1).min(), 1)
        again = "triangles" in goal and bool(self.is_annealed or few)
        children = relocate_all(
            self._cost(),
            parents,
            moves,
            self.random_state,
            triangles=sizes,
            seconds=None if left is None else max(left - self._settling(len(sizes)), 0.0),
            made=made,
            **(AGAIN if again else FRESH),
        )
        self.is_annealed = "triangles" in goal and self.moves_done > 0
        if "triangles" not in goal:
            children = self._all_settled(children)
        self.seconds += self._clock() - begun
        self.moves_done += int(made.sum())
        offspring = self.eliminate_duplicates.do(Population.new(X=children), self.pop)
        self.idle = 0 if len(offspring) else self.idle + 1
        if self.idle >= IDLE:
            self.termination.force_termination = True
        return offspring

    def _advance(self, infills: Any = None, **kwargs: Any) -> None:
        if not len(infills):
            return
        self.pop = _survivors(Population.merge(self.pop, infills), self.limits, self.within, self.pop_size)

    def _set_optimum(self) -> None:
        self.opt = _survivors(self.pop, self.limits, self.within, len(self.pop))

    def next(self) -> None:
        """Do a generation; the time in which functions are compiled is not its own."""
        with compiling_left_out(self):
            super().next()

    def _finalize(self) -> None:
        """Add the answer, thinned: the front just below it."""
        evaluations = part_of(self.termination, MaximumFunctionCallTermination)
        most = BETWEEN if evaluations is None else min(BETWEEN, evaluations.n_max_evals - self.evaluator.n_eval)
        left = self._seconds_left(whole=True)
        if left is not None:
            most = min(most, measurable(self.problem, left / 2.0))
        if most < 1 or self.pop is None or not len(self.pop):
            return
        answer = self.answer
        stop = np.zeros(1, np.bool_)
        with stopping(stop, None if left is None else max(left, 0.0) / 2.0):
            front = thinning(self.problem.surface, kept=answer.X, least=int(answer.F[-1] / 2), stop=stop)
        rows = rungs(front, most)
        extra = self.eliminate_duplicates.do(Population.new(X=np.array([front.kept(k) for k in rows])), self.pop)
        extra = extra[np.sort(spread(len(extra))[:most])] if len(extra) > most else extra
        if len(extra):
            self.evaluator.eval(self.problem, extra, algorithm=self)
            merged = Population.merge(self.opt, extra)
            self.opt = _survivors(merged, self.limits, self.within, len(merged))

    # ------------------------------------------------------------------------------------------------- the first answer

    def _direct(self) -> None:
        """Find nested meshes that reach beyond the wish, if anything does, and down to the smallest one.

        Warns
        -----
        SearchWarning
            If the time was up meanwhile.
        """
        # the second entry is set by Ctrl-C alone
        stop = np.zeros(2, np.bool_)
        (is_cut,) = on_threads(lambda _: self._begin(stop), [None], stop=stop)
        if is_cut:
            warnings.warn(
                f"{self.problem.model.name}: {seconds_given(self):g} s are too short for the whole of the first "
                f"answer; the search starts from {' and '.join(map(str, self.begun))}",
                SearchWarning,
                stacklevel=2,
            )

    def _begin(self, stop: BoolArray) -> bool:
        """Look for the first answer and store what there is as it grows; tell whether the time cut it short.

        Each pass may take an even share of the time that is left for it and those after it.
        """
        surface: Surface = self.problem.surface
        ways = self._ways()
        is_settled = "triangles" not in self.limits
        passes = 2 * len(ways) + (1 + is_settled) * sum(holding is not None for *_, holding in ways)
        is_cut = False

        def timed(work: Callable[[], Found]) -> Found:
            nonlocal passes, is_cut
            left = self._seconds_left()
            stop[0] = False
            if stop[1]:  # looked at after the other was cleared, so that no Ctrl-C is lost
                stop[0] = True
            with stopping(stop, None if left is None else max(left, 0.0) / max(passes, 1)):
                found = work()
            passes -= 1
            is_cut = is_cut or bool(stop[0] and not stop[1])
            return found

        def thinned(by: Surface, kept: BoolArray | None = None, **back: Any) -> NestedFront:
            return timed(lambda: thinning(by, kept=kept, stop=stop, **back))

        def around(by: Surface, insert: dict[str, Any], back: dict[str, Any]) -> Start:
            """Insert vertices, and thin them around the wish only: each removal looks at much where few are left."""
            try:
                inserted = timed(lambda: greedy_insertion(by, stop=stop, **insert))
            except ValueError:  # the pinned vertices span no triangle: it has nothing to begin with
                return Start.of(thinned(by))
            if not inserted.triangles.any():  # stopped before the first triangle
                return Start.of(thinned(by))
            start = Start.of(inserted)
            self.begun = [*starts, start]
            return start if stop[1] else Start.of(inserted, thinned(by, inserted.kept(len(inserted) - 1), **back))

        starts: list[Start] = []
        for by, insert, back, holding in ways:
            start = around(by, insert, back)
            self.begun = [*starts, start]
            if stop[1]:
                break
            if holding is not None:
                k = int(np.argmax(start.error <= holding)) if (start.error <= holding).any() else len(start) - 1
                kept, back_to = start.kept(k), int(start.triangles[k] / MORE_TRIANGLES)
                if is_settled:  # so that the other limits hold too
                    settled = timed(lambda kept=kept: self._settled(kept, stop)[0])  # type: ignore[misc]
                    kept = kept if settled is None else settled
                # in the measure that is searched, and somewhat below, where this limit does not hold
                start = Start.of(thinned(surface, kept, least=back_to))
            starts.append(start)
            self.begun = starts
        return is_cut

    def _ways(self) -> list[tuple[Any, dict[str, Any], dict[str, Any], float | None]]:
        """Return how the first answer is looked for: what counts, how vertices are inserted and thinned back.

        Where it counts another measure than the one that is searched, the error up to which its limit holds too.
        """
        surface, limit = self.problem.surface, self._limit()
        found: list[tuple[Any, dict[str, Any], dict[str, Any], float | None]] = []
        if "triangles" in self.limits:
            size = self.limits["triangles"]
            most = int(MORE_TRIANGLES * size / 2) + 8  # about two triangles for each vertex
            back = {"least": int(size / MORE_TRIANGLES)}
            found.append((surface, {"choose": self._choice, "most": most}, back, None))
            if "max_error" in self.within:  # of so many triangles what comes nearest to it
                found.append((surface.measuring("max_error"), {"choose": "point", "most": most}, back, None))
        elif limit is not None:
            # by the worst point what is inserted beyond the wish is not what would be left by thinning
            less = 1.0 if self._choice == "point" else LESS_ERROR
            insert = {"choose": self._choice, "least_error": less * limit}
            found.append((surface, insert, {"most_error": limit / LESS_ERROR}, None))
        for by, choose, most_error in self._beside():
            is_sum = choose == "triangle"
            insert = {"choose": choose, "least_error": (LESS_ERROR if is_sum else 1.0) * most_error}
            found.append((by, insert, {"most_error": most_error}, most_error))
        return found

    def _beside(self) -> list[tuple[Any, str, float]]:
        """Return what counts each limit beside the objectives, which vertex is inserted, and the error that holds it.

        The maximum is the first.
        """
        surface = self.problem.surface
        found: list[tuple[Any, str, float]] = []
        for name, limit in sorted(self.within.items(), key=lambda item: item[0] != "max_error"):
            if name == "max_error":
                by, most = self._tight()
                found.append((by, "point", most))
            else:
                by = surface.measuring(SEARCHED[name])
                found.append((by, "triangle", limit * (surface.total_weight if SEARCHED[name] == "error" else 1.0)))
        return found

    def _limit(self) -> float | None:
        """Return the limit of the measure that is searched, as nested fronts count it; None if there is none."""
        measure = self.problem.objectives[0]
        for name, limit in self.limits.items():
            if name not in ("triangles", *self.within):
                return limit * self.problem.surface.total_weight if measure == "error" else limit
        return None

    def _wanted(self, front: NestedFront | Start) -> int | None:
        """Return the subset of a nested front that the wish is for, as far as the front knows."""
        if "triangles" in self.limits:
            fitting = np.flatnonzero((front.triangles > 0) & (front.triangles <= self.limits["triangles"]))
            return int(fitting[np.argmin(front.error[fitting])]) if len(fitting) else None
        limit = self._limit()
        if limit is None:
            return None
        fitting = np.flatnonzero((front.triangles > 0) & (front.error <= limit))
        return int(fitting[np.argmin(front.triangles[fitting])]) if len(fitting) else None

    # ------------------------------------------------------------------------------------------------- its improvement

    @property
    def _goal(self) -> dict[str, float]:
        """What the next generation is for: the wish; or every second time, until a mesh holds it, a part of it.

        Where a maximum holds beside so many triangles that is the smallest mesh that holds it.
        """
        is_second = (self.n_iter or 0) % 2 == 0
        if not ("triangles" in self.limits and "max_error" in self.within and is_second and self.missed > 0.0):
            return self.limits
        return {name: limit for name, limit in self.limits.items() if name != "triangles"}

    def _cost(self) -> Any:
        """Return the surface whose cost is annealed."""
        surface, measure, bound = self.problem.surface, self.problem.objectives[0], self.within.get("max_error")
        if measure == "max_error" and "triangles" not in self.limits:
            return surface.bounded(self.limits["max_error"])
        now = _values(self.pop[_order(self.pop, self.limits)[:1]], self.within)
        if "triangles" in self.limits:  # a sum that is too large is lowered until it is not
            missed = [name for name in self.within if name != "max_error" and now[name][0] > self.limits[name]]
            surface = surface.measuring(SEARCHED[missed[0]] if missed else measure)
        if bound is None:
            return surface
        if "triangles" not in self._goal and self._limit() is None:
            return surface.bounded(bound)
        if "triangles" in self._goal:  # a maximum that is too large is lowered step by step
            bound = max(bound, LOWERED * float(now["max_error"][0]))
        return surface.bounded(bound, own=OWN / self._scale(bound, surface.rules.measure))

    @staticmethod
    def _scale(bound: float, measure: str) -> float:
        """Return what makes the cost of a vertex by the measure a deviation again, where it is at most ``bound``."""
        return 1.0 if measure == "error" else max(bound, 1e-300)

    def _tight(self) -> tuple[Any, float]:
        """Return a surface by which first what exceeds the maximum counts, then the sum; and the error that holds.

        All sums together count no more than the maximum is lowered by.
        """
        surface, bound = self.problem.surface, self.within["max_error"]
        scale = self._scale(bound, self.problem.objectives[0])
        tight = surface.bounded(bound * (1.0 - SLACK), own=SLACK / (surface.total_weight * scale))
        return tight, float(error_of(tight, SLACK * bound))

    def _adapt(self, triangles: FloatArray) -> None:
        """Take steps by which the attempt that was best would be the second; smaller ones where none was better.

        ``triangles`` are those of the meshes that came of the attempts, from the largest size down.
        """
        best = int(np.argmin(triangles))
        now = self.pop.get("F")[_order(self.pop, self._goal)[0], -1]
        factor = (best + 1) / 2.0 if triangles[best] < now else 0.5
        self.step = min(max(factor * self.step, STEPS[0]), STEPS[1])

    def _all_settled(self, children: BoolArray) -> BoolArray:
        """Return the subsets that hold the wish, one of each child for which there is time."""
        left, stop = self._seconds_left(), np.zeros(1, np.bool_)
        with stopping(stop, None if left is None else max(left, 0.0)):
            settled = on_threads(lambda kept: self._settled(kept, stop), children, stop=stop)
        if not stop[0]:
            self._adapt(np.array([triangles for _, triangles in settled]))
        done = [kept for kept, _ in settled if kept is not None]
        return np.array(done, np.bool_).reshape(len(done), children.shape[1])

    def _settled(self, kept: BoolArray, stop: BoolArray) -> tuple[BoolArray | None, float]:
        """Return a subset with vertices inserted until it holds, and thinned while it does, and its triangles.

        Where it was stopped before anything held there is none.
        """
        limit, surface = self._limit(), self.problem.surface
        ways = self._beside() + ([] if limit is None else [(surface, self._choice, limit)])
        n_holding = turn = 0
        while n_holding < len(ways):  # in turn, as what is inserted for one limit may raise the error of another
            by, choose, most = ways[turn % len(ways)]
            grown = greedy_insertion(by, kept, choose=choose, least_error=most, stop=stop)
            kept = grown.kept(len(grown) - 1)
            if stop[0]:
                return None, np.inf
            n_holding = n_holding + 1 if len(grown) == 1 else 1
            turn += 1
        by, _, most = ways[0] if "max_error" in self.within else ways[-1]
        front = thinning(by, kept=kept, most_error=most, stop=stop)
        wanted = self._smallest(front, stop) if self.within else self._wanted(front)
        if wanted is not None:
            return front.kept(wanted), float(front.triangles[wanted])
        return None if stop[0] else kept, np.inf

    def _smallest(self, front: NestedFront, stop: BoolArray) -> int | None:
        """Return the smallest subset that holds all limits but the triangles, by measuring some until it is stopped."""

        def holds(k: int) -> bool:
            quality = self.problem.as_quality(self.problem.surface.evaluate(front.kept(k)[None])[0])
            return bool(shortfall(asdict(quality), errors) == 0.0)

        errors = {name: limit for name, limit in self.limits.items() if name != "triangles"}
        low, high = 0, len(front) - 1
        if holds(low):
            return low
        if stop[0] or not holds(high):
            return None
        while low < high and not stop[0]:
            middle = (low + high) // 2
            low, high = (low, middle) if holds(middle) else (middle + 1, high)
        return high

    @property
    def _choice(self) -> str:
        """Which vertex is inserted for the measure that is searched."""
        return "point" if self.problem.objectives[0] == "max_error" else "triangle"

    def _plan(self, seconds: float | None) -> tuple[BoolArray, IntArray, IntArray] | None:
        """Return where the next generation begins, its numbers of triangles, and its moves; None: nothing is left."""
        T, goal = self.pop.get("F")[:, -1], self._goal
        if "triangles" in goal:
            wanted = np.unique(np.maximum(np.array(SIZES) * self.limits["triangles"], T.min()).astype(int))
            sizes = np.array([max(int(share * self.limits["triangles"]), int(T.min())) for share in SIZES])
            shares = np.array(SIZE_MOVES)
            if len(wanted) == 1:
                sizes, shares = sizes[:2], shares[:2]
        else:
            order = _order(self.pop, goal)
            k = np.arange(1, ATTEMPTS + 1)
            if _missed(self.pop, goal)[order[0]] == 0.0:
                sizes = np.minimum(T[order[0]] * (1.0 - self.step * k), T[order[0]] - k)
                sizes = np.unique(sizes[sizes >= T.min()].astype(int))[::-1]
                if not len(sizes):
                    return None
            else:  # nothing holds yet: at the size of what comes nearest, and at larger ones
                sizes = np.unique((T[order[0]] * (1.0 + self.step * (k - 1))).astype(int))
            shares = np.ones(len(sizes))
        # each from the most accurate mesh that is not smaller, or is nearest to it
        parents = [self._parent(size) for size in sizes]
        kept = self.pop.get("X")[parents]
        work = np.maximum((kept & ~self.problem.pinned).sum(axis=1), 1)
        moves = self._moves(seconds, sizes, shares * np.minimum(work, 2.0 * sizes), shares.sum() * float(work.max()))
        return (kept, sizes, moves) if moves.any() else None

    def _parent(self, size: int) -> int:
        """Return the individual from which a mesh of so many triangles is annealed."""
        T, order = self.pop.get("F")[:, -1], _order(self.pop, self._goal)
        if "triangles" not in self._goal or "max_error" in self.within:
            return int(order[0])
        larger = np.flatnonzero(size <= T)
        return int(larger[np.argmin(T[larger])]) if len(larger) else int(np.argmax(T))

    def _moves(self, seconds: float | None, sizes: IntArray, weights: FloatArray, work: float) -> IntArray:
        """Return the moves of each row of a generation."""
        budget = part_of(self.termination, Moves)
        at_once = "triangles" in self.limits and "max_error" not in self.within
        most = [SLOWEST * work]
        if budget is not None:
            most.append(_next_share(self.moves_done, budget.n_max_moves - self.moves_done, at_once))
        if seconds is not None:
            in_a_triangle = self.problem.n_var / max(float(sizes.mean()), 1.0)
            guess = SECONDS_A_MOVE[0] + SECONDS_A_MOVE[1] * in_a_triangle
            a_move = self.seconds / self.moves_done if self.moves_done and self.seconds > 0.0 else guess
            begin = SECONDS_TO_BEGIN * self.problem.n_var * len(sizes) / 2.0
            if begin > LONG_BEGIN * seconds:
                most.append(max(seconds - begin - self._settling(len(sizes)), 0.0) / a_move)
            else:
                most.append(_next_share(self.moves_done, seconds / a_move, at_once))
        if len(most) == 1:
            most.append(max(PILOT * work, self.moves_done))
        whole = int(min(most))
        if "max_error" in self.within and "triangles" in self._goal and self.missed > 0.0:
            whole = int(np.ceil(AT_SIZE * whole))
        moves = np.diff(np.round(np.cumsum(weights) / weights.sum() * whole), prepend=0.0)
        return moves.astype(np.int64)

    def _settling(self, n: int) -> float:
        """Return about how long it takes until so many annealed meshes hold the wish [s]."""
        if "triangles" in self._goal:
            return 0.0
        return SECONDS_TO_BEGIN * self.problem.n_var * n / 2.0 * (2 + len(self.within))

    def _seconds_left(self, *, whole: bool = False) -> float | None:
        """Return the seconds left for the search, or for its end too; None: there is no limit."""
        given = seconds_given(self)
        if given is None:
            return None
        return given * (1.0 if whole else 1.0 - LAST_SHARE) - self._clock()

    def _clock(self) -> float:
        """Return the seconds since the search began, without those of compiling."""
        return float(time.time() - self.start_time)


def require_for_a_wish(problem: Any) -> None:
    """Raise a ValueError if one mesh cannot be searched for in a problem."""
    if problem.n_obj != 2:
        raise ValueError(f"a wish is for two objectives and the problem has {problem.n_obj}; use nsga3()")
    if problem.has_constraints():
        raise ValueError("a wish takes no constraints; drop max_triangles= and max_objective= from the problem")


def _next_share(done: float, left: float, at_once: bool) -> float:
    """Return the part of a budget for the next generation: as much as was done, or all that is left."""
    planned = max(FIRST * left, done)
    return left if left < 1.5 * planned or (at_once and done) else planned


def _values(pop: Any, names: Any) -> dict[str, FloatArray]:
    F = pop.get("F")
    return {name: F[:, -1] if name == "triangles" else pop.get(name).astype(float) for name in names}


def _missed(pop: Any, limits: dict[str, float]) -> FloatArray:
    """Return by how much each individual misses the limits."""
    return np.broadcast_to(shortfall(_values(pop, limits), limits), len(pop)).astype(float)


def _order(pop: Any, limits: dict[str, float]) -> IntArray:
    """Return the individuals, nearest to the wish first: of those that hold it the most accurate, or the smallest.

    One that has too many triangles comes after all that have not.
    """
    F = pop.get("F")
    if "triangles" not in limits:
        return np.lexsort((F[:, 0], F[:, -1], _missed(pop, limits)))
    errors = {name: limit for name, limit in limits.items() if name != "triangles"}
    return np.lexsort((F[:, -1], F[:, 0], _missed(pop, errors), F[:, -1] > limits["triangles"]))


def _survivors(pop: Any, limits: dict[str, float], within: dict[str, float], most: int) -> Any:
    """Return those that no other one beats, at most about so many, and the one nearest to the wish.

    Limits beside the objectives count as one more: by how much they are missed.
    """
    F = np.column_stack([pop.get("F"), _missed(pop, within)]) + 0.0
    best = {row.tobytes() for row in non_dominated(F)}
    first: dict[bytes, int] = {}
    for row in np.lexsort((F[:, 0], F[:, 1])):
        if F[row].tobytes() in best:
            first.setdefault(F[row].tobytes(), int(row))
    rows = list(first.values())
    if len(rows) > most:
        rows = [rows[k] for k in np.unique(np.linspace(0, len(rows) - 1, most).astype(int))]
    answer = int(_order(pop, limits)[0])
    return pop[np.unique([*rows, answer])]


def rungs(front: NestedFront | Start, n: int, wanted: int | None = None) -> list[int]:
    """Return n subsets of a nested front, the one that is wanted and others spread over the logarithm of the size."""
    rows = np.flatnonzero(front.triangles > 0)
    spaced = np.geomspace(rows[0] + 1, rows[-1] + 1, n - (wanted is not None)) - 1
    chosen = set(np.clip(np.round(spaced).astype(int), rows[0], rows[-1]).tolist())
    return sorted(chosen | ({wanted} if wanted is not None else set()))


def targeted(
    *,
    triangles: int | None = None,
    max_error: float | None = None,
    mean_error: float | None = None,
    rms_error: float | None = None,
    pop_size: int = 100,
    **kwargs: Any,
) -> TargetedSearch:
    """Return the search for one mesh: answered at once, then improved around its size.

    With ``triangles`` the most accurate mesh of at most so many, without it the smallest mesh within the limits; where
    several are given all of them hold. The problem's measure must be the one that is wished for
    (``objectives=("max_error", "triangles")`` for a maximum); with ``triangles`` it is what is lowered.
    After :class:`~meshsimp_pymoo.Moves` or a termination by time it ends then, else after ten million moves.

    Parameters
    ----------
    triangles : int, optional
        The most triangles.
    max_error, mean_error, rms_error : float, optional
        The most that any original vertex deviates by, the mean of these, and their root mean square [model units].
    pop_size : int
        The most meshes of the front that are kept beside the one that is wished for.
    **kwargs
        Further arguments of pymoo's ``Algorithm``.

    Raises
    ------
    TypeError
        If nothing is wished for.
    ValueError
        If a limit makes no sense; when the search begins, if the problem's measure is another one.

    Returns
    -------
    TargetedSearch
        A pymoo algorithm. Its result is a front around the wish, with what is best of the rest.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from meshsimp_pymoo import MeshProblem, Moves
    >>> result = minimize(MeshProblem("roof:9"), targeted(triangles=4), Moves(2_000), seed=1)
    >>> result.algorithm.answer.F
    array([0., 4.])
    """
    limits = checked_limits(
        {"triangles": triangles, "max_error": max_error, "mean_error": mean_error, "rms_error": rms_error}
    )
    if pop_size < 2:
        raise ValueError(f"pop_size = {pop_size} keeps no front; give 2 or more")
    known = [*inspect.signature(Algorithm).parameters, *inspect.signature(targeted).parameters]
    for name in kwargs:
        if name not in known:
            raise TypeError(f"targeted() has no argument {name!r}{meant(name, known)}")
    defaults: dict[str, Any] = {"output": MultiObjectiveOutput(), "termination": Moves(USUAL_BUDGET)}
    return TargetedSearch(limits, pop_size, **(defaults | kwargs))
