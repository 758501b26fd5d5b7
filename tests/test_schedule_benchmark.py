"""The benchmark of the schedule runs, and sets tasks out as threads do."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def schedule():
    path = Path(__file__).parent / "benchmarks" / "schedule.py"
    spec = importlib.util.spec_from_file_location("schedule_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_cores_take_tasks_in_turn_and_wait_for_the_generation(schedule):
    assert schedule.finished([3.0, 1.0, 1.0, 1.0, 2.0], 1) == 8.0
    assert schedule.finished([3.0, 1.0, 1.0, 1.0, 2.0], 2) == 5.0
    assert schedule.helped([[1.0, 1.0], [2.0]], 2) == pytest.approx(4 / 3)
    generations = [[5.0, 4.0, 1.0, 1.0], [2.0, 2.0]]
    figures = [schedule.helped(generations, n) for n in (1, 2, 4, 100)]
    assert figures[0] == 1.0
    assert figures == sorted(figures)
    assert figures[-1] == pytest.approx(15.0 / 7.0)  # no core does more than the longest task of each


def test_it_prints_what_cores_help_before_and_now(schedule, capsys):
    assert schedule.main(["--models", "peaks:9", "--moves-per-vertex", "1"]) == 0
    out = capsys.readouterr().out
    assert "in long chains" in out
    assert "now" in out
    assert "81" in out
