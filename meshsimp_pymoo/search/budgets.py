"""What ends a search: a number of moves, or time, which counts what is searched, not what is compiled meanwhile."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from pymoo.core.termination import Termination
from pymoo.termination.max_time import TimeBasedTermination

from meshsimp_pymoo.arrays import BoolArray
from meshsimp_pymoo.compiling.store import told_of_compiling
from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.settings import Whole

End = TypeVar("End", bound=Termination)


class Moves(Termination):
    """Ends :func:`~meshsimp_pymoo.memetic` or :func:`~meshsimp_pymoo.targeted` after so many moves of its annealing.

    They plan with them. Evaluations do not measure these algorithms and seconds are never the same twice; with a budget
    in moves the same seed gives the same bytes on any machine of the same architecture. A million take about a second
    of one core.

    Parameters
    ----------
    n_max_moves : int
        How many, at least 1. Exactly so many are made, unless the search ends before, when nothing new is left to find.

    Raises
    ------
    ValueError
        If this is no whole number of at least 1.
    TypeError
        During the search, if the algorithm makes no moves.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from meshsimp_pymoo import MeshProblem, Moves, memetic
    >>> minimize(MeshProblem("face:200"), memetic(20), Moves(5_000), seed=1).algorithm.moves
    5000
    """

    def __init__(self, n_max_moves: int | np.integer[Any]) -> None:
        """Say how many moves are made."""
        super().__init__()
        given = n_max_moves.item() if isinstance(n_max_moves, np.integer) else n_max_moves
        try:
            self.n_max_moves = Whole(1).from_plain(given)
        except ValueError as problem:
            raise ValueError(f"Moves({given!r}): {problem}") from None

    __repr__ = as_made

    def _update(self, algorithm: Any) -> float:
        moves = moves_of(algorithm)
        if moves is None:
            raise TypeError(
                f"Moves({self.n_max_moves}) is for memetic() and targeted(), and {type(algorithm).__name__} makes no "
                "moves; give it ('n_gen', ...), ('n_eval', ...) or ('time', ...)"
            )
        return moves / self.n_max_moves


def moves_of(algorithm: Any) -> int | None:
    """Return the moves that an algorithm has made so far; None if it is of a kind that makes none."""
    moves = getattr(algorithm, "moves", None)
    return moves if isinstance(moves, int) else None  # an algorithm of a reader's may call anything so


def part_of(termination: Any, kind: type[End]) -> End | None:
    """Return a termination of a kind, or the first part of that kind where several are put together; None if none is.

    >>> part_of(Moves(7), Moves).n_max_moves
    7
    """
    if isinstance(termination, kind):
        return termination
    parts = getattr(termination, "terminations", None) or getattr(termination, "criteria", None) or ()
    return next((found for part in parts if (found := part_of(part, kind)) is not None), None)


class WholeGenerations(TimeBasedTermination):
    """Ends where another generation, as long as the longest so far, would end too late.

    Parameters
    ----------
    max_time : float
        Seconds from the start of the search.
    """

    def __init__(self, max_time: float) -> None:
        super().__init__(max_time)
        self._last: float | None = None
        self._longest = 0.0

    def _update(self, algorithm: Any) -> float:
        elapsed = time.time() - algorithm.start_time
        # the first generation makes the first population, which the others need not do
        if self._last is not None:
            self._longest = max(self._longest, elapsed - self._last)
        self._last = elapsed
        return 1.0 if elapsed + self._longest > self.max_time else elapsed / self.max_time


def seconds_given(algorithm: Any) -> float | None:
    """Return the seconds that a run has as a whole; None: it has no limit."""
    limit = part_of(getattr(algorithm, "termination", None), TimeBasedTermination)
    return None if limit is None else float(limit.max_time)


@contextmanager
def compiling_left_out(algorithm: Any) -> Iterator[None]:
    """Set the clock of a pymoo algorithm back by the time in which functions are compiled in here."""

    def told(_: Any, seconds: float | None) -> None:
        if seconds is not None and algorithm.start_time is not None:
            algorithm.start_time += seconds

    with told_of_compiling(told):
        yield


@contextmanager
def stopping(stop: BoolArray, seconds: float | None) -> Iterator[None]:
    """Set ``stop[0]`` after so many seconds in here, those of compiling left out; None: never.

    >>> stop = np.zeros(1, bool)
    >>> with stopping(stop, 0.0):
    ...     while not stop[0]:
    ...         time.sleep(0.001)
    """
    if seconds is None:
        yield
        return
    limit = time.perf_counter() + seconds
    under_way = 0
    done = threading.Event()

    def told(_: Any, took: float | None) -> None:
        nonlocal limit, under_way
        under_way += 1 if took is None else -1
        limit += took or 0.0

    def watch() -> None:
        while not done.wait(max(limit - time.perf_counter(), 0.01)):
            if under_way == 0 and time.perf_counter() >= limit:
                stop[0] = True
                return

    with told_of_compiling(told):
        watcher = threading.Thread(target=watch, name="meshsimp-time", daemon=True)
        watcher.start()
        try:
            yield
        finally:
            done.set()
            watcher.join()
