"""Engines: the same results wherever the work is done, and after deaths."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from meshsimp_pymoo.workers import DaskEngine, EngineError, Processes, Reserve, Serial, on_threads, open_engine


def square(task, shared):
    return task**2 + shared


def late_square(task, shared):
    """Finish in another order than begun."""
    time.sleep(0.05 * (task % 3))
    return task**2 + shared


def die_once(task, shared):
    marker, victim = shared
    if task == victim and not os.path.exists(marker):  # noqa: PTH110
        open(marker, "w").close()  # noqa: PTH123
        os._exit(9)
    return task


def die(task, shared):
    if task == 3:
        os._exit(9)
    return task


def refuse(task, shared):
    raise ValueError(f"no task {task}")


def test_what_is_in_reserve_is_used_by_one_at_a_time_and_kept_by_its_owner():
    reserve = Reserve(list)
    with reserve.one() as first, reserve.one() as second:
        assert first is not second
        first.append(1)
    with pytest.raises(KeyError), reserve.one() as again:  # noqa: PT012
        assert again is first
        raise KeyError
    with reserve.one() as again, reserve.one() as another:
        assert (again, another) == ([1], [])
        assert again is first
        assert another is second
        with pickle.loads(pickle.dumps(reserve)).one() as other:
            assert other == []


@pytest.fixture(scope="module")
def processes():
    with Processes(2) as engine:
        yield engine


@pytest.fixture(scope="module")
def cluster():
    """A Dask cluster of two worker processes."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address=":0",
        silence_logs=50,
        env={"PYTHONPATH": os.pathsep.join(sys.path)},
    ) as cluster:
        yield cluster


@pytest.fixture
def dask(cluster):
    with DaskEngine(cluster.scheduler_address) as engine:
        yield engine


@pytest.mark.parametrize("work", [square, late_square])
@pytest.mark.parametrize("name", ["processes", "dask"])
def test_every_task_has_its_result_whatever_the_engine_and_the_order(name, work, request):
    expected = dict(Serial().each(square, range(11), 5))
    assert expected == {k: k**2 + 5 for k in range(11)}
    assert dict(request.getfixturevalue(name).each(work, range(11), 5)) == expected


@pytest.mark.parametrize("name", ["processes", "dask"])
def test_the_tasks_of_a_worker_that_dies_are_done_again(name, request, tmp_path):
    marker = str(tmp_path / "died")
    assert dict(request.getfixturevalue(name).each(die_once, range(8), (marker, 2))) == {k: k for k in range(8)}
    assert (tmp_path / "died").exists()


@pytest.mark.parametrize("nth", [3, 5, 8])
def test_a_death_that_is_met_when_a_task_is_handed_over_loses_no_task(monkeypatch, nth):
    handed = []

    def submit(pool, work, *arguments):
        handed.append(work)
        if len(handed) == nth:
            raise BrokenProcessPool("a worker has died meanwhile")
        return whole(pool, work, *arguments)

    whole = ProcessPoolExecutor.submit
    monkeypatch.setattr(ProcessPoolExecutor, "submit", submit)
    with Processes(2) as engine:
        assert sorted(engine.each(square, range(9), 0)) == [(k, k**2) for k in range(9)]


def test_a_task_that_kills_every_worker_is_named(processes):
    found = []
    with pytest.raises(EngineError, match=r"ended unexpectedly 3 times while task 3 .*--jobs"):
        found += list(processes.each(die, range(5)))


def test_what_the_work_raises_is_raised(processes, dask):
    for engine in (Serial(), processes, dask):
        with pytest.raises(ValueError, match="no task 0"):
            list(engine.each(refuse, [0]))


@pytest.mark.parametrize("engine", [Serial(), Processes(2)])
def test_tasks_are_made_as_workers_become_free_and_never_all_at_once(engine):
    made = []

    def tasks():
        for k in range(40):
            made.append(k)
            yield k

    with engine:
        for n_done, _ in enumerate(engine.each(square, tasks(), 0)):
            assert len(made) <= n_done + 1 + 4


def test_giving_up_ends_the_processes():
    engine = Processes(2)
    results = engine.each(late_square, range(100), 0)
    next(results)
    pids = list(engine._pool._processes)
    results.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_no_scheduler_and_no_dask_are_answered_in_one_line(monkeypatch):
    monkeypatch.setattr("meshsimp_pymoo.workers.CONNECT_SECONDS", 0.3)
    with pytest.raises(EngineError, match=r"tcp://127.0.0.1:9: no Dask scheduler answers .*--jobs"):
        DaskEngine("tcp://127.0.0.1:9")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(EngineError, match=r"pip install 'dask\[distributed\]>=2024.8'"):
        DaskEngine("tcp://127.0.0.1:9")


def test_one_job_needs_no_process():
    assert isinstance(open_engine(1), Serial)
    assert open_engine(3).jobs == 3
    with pytest.raises(ValueError, match="jobs is 0"):
        Processes(0)


def test_a_script_without_the_main_guard_is_told_so(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from meshsimp_pymoo.workers import Processes\n"
        "def work(task, shared):\n    return task\n"
        "print(list(Processes(1).each(work, [1])))\n"
    )
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60)
    assert ended.returncode != 0
    assert 'if __name__ == "__main__":' in ended.stderr.splitlines()[-1]


def test_threads_do_items_in_order_and_within_one_of_them_nothing_waits():
    def name(_):
        return threading.current_thread().name

    assert on_threads(lambda k: k * k, range(20)) == [k * k for k in range(20)]
    assert on_threads(name, [0])[0].startswith("meshsimp")
    assert on_threads(lambda k: on_threads(lambda j: (k, j), range(2), n_threads=1), range(3), n_threads=1) == [
        [(k, 0), (k, 1)] for k in range(3)
    ]
    # of another's thread one item is done there
    found = []
    thread = threading.Thread(target=lambda: found.extend(on_threads(name, [0])), name="another")
    thread.start()
    thread.join()
    assert found == ["another"]


def test_what_fails_or_is_interrupted_sets_the_flag_and_waits_for_what_is_under_way():
    stop, ended = np.zeros(2, bool), []

    def work(k):
        if k == 0:
            raise LookupError("no")
        while not stop[0]:
            time.sleep(0.001)
        ended.append(k)

    with pytest.raises(LookupError):
        on_threads(work, range(40), n_threads=2, stop=stop)
    assert stop.all()
    assert len(ended) < 39  # what was not begun is left

    def interrupted(_):
        os.kill(os.getpid(), signal.SIGINT)
        while not again[0]:
            time.sleep(0.001)
        ended.append("interrupted")

    again = np.zeros(1, bool)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            on_threads(interrupted, [0], stop=again)
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended[-1] == "interrupted"
