"""Where work is done: on threads of this process, in processes of this machine, or on a Dask cluster.

An engine takes a function of a module and tasks for it, and yields each result with its task's place, in the order in
which they are finished. The function must depend on its arguments alone, so that results depend neither on the engine
nor on that order; and it may be called twice for the same task: where a worker dies, its tasks are done again, and only
a task that was being done at every one of ``TRIES`` deaths ends the work.

The processes are the standard library's: loky's stay for ever where the parent is killed, take twice as long to start,
and would need what is here beside a pool too: tasks tried again, processes that end with their parent.

A few tasks more than there are workers are made ahead, never all of them: memory is bounded by the tasks in flight.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, FIRST_EXCEPTION, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Generic, Protocol, TypeVar

from meshsimp_pymoo.arrays import BoolArray
from meshsimp_pymoo.errors import reason_of, way_to_install
from meshsimp_pymoo.reprs import as_made

__all__ = [
    "DaskEngine",
    "Engine",
    "EngineError",
    "Processes",
    "Reserve",
    "Serial",
    "on_threads",
    "open_engine",
    "thread_pool",
    "threads_for",
]

# How often a task is tried whose worker dies.
TRIES = 3
# Tasks in flight for each worker: one that is done, one that waits.
AHEAD = 2
CONNECT_SECONDS = 30
# Who waits for threads looks up as often as this.
HEARING_SECONDS = 0.2

# Libraries that would start threads of their own beside the processes.
THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

# What a process that is starting does not hear: a terminal sends Ctrl-C to all, and the parent decides.
HELD = (signal.SIGINT,)

# Called as work(task, shared).
Work = Callable[[Any, Any], Any]

Item = TypeVar("Item")
Result = TypeVar("Result")


class Reserve(Generic[Item]):
    """Objects that take long to make and serve one thread at a time: made when all that there are are in use, and kept.

    Parameters
    ----------
    make : callable
        Makes one; a function of a module, or a partial one, so that an owner can be pickled: without the objects.
    is_kept : bool
        Whether one that nobody uses stays. Where it is so large that making it is nothing beside using it, it goes, so
        that what is done next has its memory.
    """

    def __init__(self, make: Callable[[], Item], is_kept: bool = True) -> None:
        self._make = make
        self._is_kept = is_kept
        self._idle: list[Item] = []

    @contextlib.contextmanager
    def one(self) -> Iterator[Item]:
        """Give one, as whoever had it last left it; it is nobody else's until the context ends."""
        try:
            item = self._idle.pop()
        except IndexError:
            item = self._make()
        try:
            yield item
        finally:
            if self._is_kept:
                self._idle.append(item)

    def __reduce__(self) -> Any:
        return Reserve, (self._make, self._is_kept)


_executors: dict[int, ThreadPoolExecutor] = {}
# What a thread knows of itself: whether it is one of ours.
_own = threading.local()


def thread_pool(n_threads: int | None = None) -> ThreadPoolExecutor:
    """Return one pool of threads a process and size, so that the threads are started once."""
    n_threads = n_threads or os.cpu_count() or 1
    if n_threads not in _executors:
        pool = ThreadPoolExecutor(
            n_threads, thread_name_prefix="meshsimp", initializer=setattr, initargs=(_own, "is_worker", True)
        )
        # All threads start here: the one whose start Ctrl-C interrupts is unknown to its pool, and would be waited for
        # at the end of the process without being told to end, unless the pool goes first.
        ready = threading.Event()
        try:
            for _ in range(n_threads):
                pool.submit(ready.wait)
        finally:
            ready.set()
        _executors[n_threads] = pool
    return _executors[n_threads]


def on_threads(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    *,
    n_threads: int | None = None,
    stop: BoolArray | None = None,
) -> list[Result]:
    """Return what ``work`` gives for each item, done by threads while this one waits for them.

    Python acts upon Ctrl-C when the main thread comes back to it, and from a compiled loop that is when the loop has
    ended; so a loop that takes long is not for the main thread. On Ctrl-C, or if the work fails, ``stop`` is set, what
    is not begun is left, and the exception is raised when all that was begun has come back.

    Parameters
    ----------
    work : callable
        Called once for each item. Inside of it this function does its items in the thread that it is called in, one
        after the other: who waited there might wait for himself.
    items : iterable
        What there is to do.
    n_threads : int, optional
        Threads to share it among; as many as there are cores by default.
    stop : (1,) bool array, optional
        A flag that the work looks at; see `search.budgets.stopping`.
    """
    todo = list(items)
    alone = len(todo) == 1 or n_threads == 1
    if getattr(_own, "is_worker", False) or (alone and threading.current_thread() is not threading.main_thread()):
        return [work(item) for item in todo]
    futures: list[Future[Result]] = []
    try:
        pool = thread_pool(n_threads)
        futures.extend(pool.submit(work, item) for item in todo)
        # a signal that another thread was given, or any on Windows, does not end a wait
        while (state := wait(futures, HEARING_SECONDS, return_when=FIRST_EXCEPTION)).not_done:
            for future in state.done:
                future.result()
        return [future.result() for future in futures]
    except BaseException:
        if stop is not None:
            stop[:] = True
        for future in futures:
            future.cancel()
        wait(futures)
        raise


def threads_for(n_items: int, n_threads: int | None = None) -> int:
    """Return how many of so many items :func:`on_threads` does side by side, called here with ``n_threads``."""
    if getattr(_own, "is_worker", False):
        return 1
    return max(min(n_threads or os.cpu_count() or 1, n_items), 1)


def _forget_threads() -> None:
    """Forget the pools after a fork: the child has none of its parent's threads."""
    _executors.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_threads)


class EngineError(RuntimeError):
    """Tasks cannot be done: no cluster at the address, or workers that die again and again. One line, the way out."""


class Engine(Protocol):
    """What does tasks."""

    jobs: int
    #: Whether workers see the same files as this process.
    shares_files: bool

    def each(self, work: Work, tasks: Iterable[Any], shared: Any = None) -> Iterator[tuple[int, Any]]:
        """Do all tasks and yield (place of the task, result) as they are finished.

        Parameters
        ----------
        work : callable
            A function of a module, called as ``work(task, shared)``; it must depend on these alone.
        tasks : iterable
            Taken from it one by one, as workers become free.
        shared : object
            Given to each worker once.

        Yields
        ------
        (int, object)

        Raises
        ------
        EngineError
            If a task's worker died ``TRIES`` times. What the work itself raises is raised here.
        """
        ...

    def close(self) -> None:
        """Let the workers go."""
        ...

    def __enter__(self) -> Any: ...

    def __exit__(self, *_: object) -> None: ...


class Serial:
    """Do tasks in this process, one after the other."""

    jobs = 1
    shares_files = True

    __repr__ = as_made

    def close(self) -> None:
        """Nothing is open."""

    def __enter__(self) -> Serial:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def each(self, work: Work, tasks: Iterable[Any], shared: Any = None) -> Iterator[tuple[int, Any]]:
        """See :class:`Engine`."""
        for place, task in enumerate(tasks):
            yield place, work(task, shared)


class Processes:
    """Do tasks in processes of this machine, one thread each.

    They are started with the first task and stay for the next call; they end with :meth:`close`, and when this process
    ends, however it ends. In a script the call has to stand under ``if __name__ == "__main__":``.

    Parameters
    ----------
    jobs : int
        Number of processes.
    """

    shares_files = True

    def __init__(self, jobs: int) -> None:
        if jobs < 1:
            raise ValueError(f"jobs is {jobs}; it must be 1 or more")
        self.jobs = jobs
        self._pool: ProcessPoolExecutor | None = None
        self._shared: Any = None

    __repr__ = as_made

    def each(self, work: Work, tasks: Iterable[Any], shared: Any = None) -> Iterator[tuple[int, Any]]:
        """See :class:`Engine`."""
        source = enumerate(tasks)
        again: list[tuple[int, Any]] = []
        deaths: dict[int, int] = {}
        running: dict[Future[Any], tuple[int, Any]] = {}
        complete = False
        try:
            while True:
                try:
                    # after a death one at a time, so that the next one shows whose fault it is
                    while len(running) < (1 if again else AHEAD * self.jobs):
                        item = again.pop(0) if again else next(source, None)
                        if item is None:
                            break
                        try:
                            future = self._ready(shared).submit(_do, work, item[1])
                        except BrokenProcessPool:  # a death is met here too: the task is not lost with it
                            again.insert(0, item)
                            raise
                        running[future] = item
                    if not running:
                        complete = True
                        return
                    finished = wait(running, return_when=FIRST_COMPLETED).done
                    for future in sorted(finished, key=lambda future: running[future][0]):
                        result = future.result()
                        place, _ = running.pop(future)
                        yield place, result
                except BrokenProcessPool:
                    for place, _ in running.values():
                        deaths[place] = deaths.get(place, 0) + 1
                    again = sorted([*running.values(), *again], key=lambda item: item[0])
                    running.clear()
                    self.close()
                    worst = max(deaths, key=lambda place: deaths[place], default=-1)
                    if worst >= 0 and deaths[worst] >= TRIES:
                        raise EngineError(
                            f"a process ended unexpectedly {TRIES} times while task {worst} was being done (killed, "
                            "or out of memory); use fewer processes (--jobs) or smaller tasks"
                        ) from None
        finally:
            if not complete:
                # what they are doing is given up
                self.close(give_up=True)

    def close(self, *, give_up: bool = False) -> None:
        """End the processes; with ``give_up`` in the middle of what they do."""
        pool = self._pool
        if pool is None:
            return
        if give_up:
            for process in list((pool._processes or {}).values()):
                process.terminate()
        self._pool, self._shared = None, None
        pool.shutdown(wait=True, cancel_futures=True)

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *error: object) -> None:
        self.close(give_up=any(error))

    def _ready(self, shared: Any) -> ProcessPoolExecutor:
        """Return processes that know ``shared``."""
        if self._pool is not None and self._shared is shared:
            return self._pool
        self.close()
        with _one_thread_each():
            self._pool = ProcessPoolExecutor(
                self.jobs,
                mp_context=multiprocessing.get_context("spawn"),
                initializer=_begin,
                initargs=(shared,),
            )
            self._shared = shared
            # they are started by their first tasks, and inherit what is set now
            with _signals_held():
                started = [self._pool.submit(os.getpid) for _ in range(self.jobs)]
            try:
                wait(started)
                started[0].result()
            except BrokenProcessPool:
                self.close()
                raise EngineError(
                    'no process can be started; in a script, make the call under `if __name__ == "__main__":`'
                ) from None
        return self._pool


class DaskEngine:
    """Do tasks on a Dask cluster that is running already.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``; or an object that ``distributed.Client`` takes, such as a
        ``LocalCluster``.

    Raises
    ------
    EngineError
        If ``distributed`` is not installed, or there is no scheduler at the address.
    """

    shares_files = False

    def __init__(self, address: Any) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise EngineError(
                f"Dask clusters need the package distributed; install it by {way_to_install('dask')}"
            ) from None
        try:
            self.client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise EngineError(
                f"{address}: no Dask scheduler answers ({reason_of(problem)}); start one, or use processes (--jobs)"
            ) from None
        self.jobs = max(1, sum(self.client.nthreads().values()))

    def __repr__(self) -> str:
        return f"<DaskEngine: {self.jobs} threads at {self.client.scheduler.address}>"

    def close(self) -> None:
        """Leave the cluster; it goes on running."""
        self.client.close()

    def __enter__(self) -> DaskEngine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def each(self, work: Work, tasks: Iterable[Any], shared: Any = None) -> Iterator[tuple[int, Any]]:
        """See :class:`Engine`."""
        from distributed import wait as wait_for
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        source = enumerate(tasks)
        spread: Any = None
        running: dict[Any, int] = {}
        try:
            while True:
                while len(running) < AHEAD * self.jobs and (item := next(source, None)) is not None:
                    with warnings.catch_warnings():
                        # a task carries its data, so that it can be done again where another worker died
                        warnings.filterwarnings("ignore", message="Sending large graph")
                        if spread is None:  # a task too, not data that one worker may take with it
                            spread = self.client.submit(_itself, shared, pure=False)
                        running[self.client.submit(work, item[1], spread, pure=False)] = item[0]
                if not running:
                    return
                with self.client.as_current():
                    finished = wait_for(list(running), return_when="FIRST_COMPLETED").done
                for future in sorted(finished, key=lambda future: running[future]):
                    place = running[future]
                    try:
                        result = future.result()
                    except KilledWorker:
                        raise EngineError(
                            f"workers of the cluster died again and again while task {place} was being done (out of "
                            "memory?); give them more memory or make smaller tasks"
                        ) from None
                    except FutureCancelledError:
                        raise EngineError(
                            "the connection to the Dask cluster was lost; start the same call again"
                        ) from None
                    del running[future]
                    yield place, result
        finally:
            if running:
                self.client.cancel(list(running))


def _itself(shared: Any) -> Any:
    return shared


def open_engine(jobs: int | None = None, dask: str | None = None) -> Engine:
    """Return the engine for what a user asked for.

    Parameters
    ----------
    jobs : int, optional
        Processes on this machine; one for each core by default. With 1 everything is done in this process.
    dask : str, optional
        Address of a Dask scheduler.
    """
    if dask is not None:
        return DaskEngine(dask)
    jobs = jobs or os.cpu_count() or 1
    return Serial() if jobs == 1 else Processes(jobs)


# ----------------------------------------------------------------------------------------------- inside a process

_shared: Any = None


def _begin(shared: Any) -> None:
    """Prepare a process of the pool: what is the same for all tasks, and an end when the parent ends."""
    global _shared
    _shared = shared
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, HELD)
    parent = multiprocessing.parent_process()
    if parent is not None:
        # a killed parent says nothing, and the pool's processes would wait for work for ever
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    from multiprocessing.connection import wait as wait_for

    wait_for([sentinel])
    os._exit(1)


def _do(work: Work, task: Any) -> Any:
    return work(task, _shared)


@contextlib.contextmanager
def _signals_held() -> Iterator[None]:
    """Have processes that are started in here begin with signals held back; this one gets them a moment later."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, HELD)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Have processes that are started in here use one thread each."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
