"""Whatever is in a file, reading it ends in a result or in one line: no traceback, no hang, no more than 1 GiB.

The usual suite tries a hundred cases of each kind; ``pytest tests/fuzz --fuzz-cases 20000`` tries many, ``-m slow`` two
thousand, and ten thousand of the small files that expand.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from counts import SLOW

sys.path.insert(0, str(Path(__file__).parent))
import expanding
import mutations
import worker

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the limits of memory are those of Linux")

# Deaths of the worker after which nothing more is tried.
DEATHS = 5
# Cases of the files that expand that ``-m slow`` tries.
EXPANDING = 10_000


def run_worker(kind: str, seed: int, first: int, end: int, folder: Path) -> tuple[list[dict], dict | None, str]:
    """Return the wrong cases, the summary (None: the worker died), and what it said last."""
    command = [sys.executable, Path(worker.__file__), kind, str(seed), str(first), str(end), str(folder)]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300 + (end - first) * 1.0)
    lines = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
    summary = lines.pop() if lines and "counts" in lines[-1] else None
    return lines, summary, f"exit code {run.returncode}\n{run.stderr[-3000:]}"


@pytest.mark.parametrize("kind", mutations.KINDS)
def test_every_damaged_input_ends_in_a_result_or_in_one_line(kind, tmp_path, request):
    check_cases(kind, request.config.getoption("--fuzz-cases"), tmp_path, request)


@pytest.mark.slow
@pytest.mark.parametrize("kind", mutations.KINDS)
def test_many_damaged_inputs_end_in_a_result_or_in_one_line(kind, tmp_path, request):
    cases = EXPANDING if kind == "expanding" else SLOW * request.config.getoption("--fuzz-cases")
    check_cases(kind, cases, tmp_path, request)


def check_cases(kind: str, cases: int, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    seed = request.config.getoption("--fuzz-seed")
    first, wrong, counts, deaths = 0, [], {}, 0
    peak = 0
    while first < cases and deaths < DEATHS:
        lines, summary, said = run_worker(kind, seed, first, cases, tmp_path)
        wrong += [f"case {line['case']}: {line['ended']}\n{line['what']}" for line in lines]
        if summary is not None:
            counts, peak = summary["counts"], summary["largest"][0]
            if "panicked" in said or "Traceback" in said:
                wrong.append(f"something was printed: {said}")
            break
        deaths += 1
        case = tmp_path / "case"
        assert case.exists(), f"the undamaged input is not read: {said}"
        number = int(case.read_text())
        wrong.append(f"case {number}: the process died (more than {worker.SECONDS:g} s of the processor?), {said}")
        first = number + 1
    again = f"python {worker.__file__} {kind} {seed} NUMBER NUMBER+1 FOLDER"
    assert not wrong, f"{len(wrong)} of {cases} cases; again: {again}\n" + "\n\n".join(wrong[:10])
    assert counts.get("result", 0) > 0.01 * cases, f"hardly anything was read at all: {counts}"
    assert sum(counts.values()) - counts["result"] > 0.2 * cases, f"hardly anything was damaged: {counts}"
    assert peak < worker.MEMORY


def test_damage_is_the_same_for_the_same_seed():
    for make in (
        mutations.file_case,
        mutations.line_case,
        mutations.config_case,
        mutations.result_case,
        expanding.expanding_case,
    ):
        one, two, other = (make(np.random.default_rng([1, number])) for number in (5, 5, 6))
        assert one == two
        assert one != other


def test_the_worker_sees_what_is_wrong(tmp_path, monkeypatch):
    def broken(*_: object) -> None:
        raise KeyError("x")

    monkeypatch.setattr(worker, "attempt", broken)
    assert worker.outcome("files", np.random.default_rng(0), tmp_path)[0] == "traceback"

    def two_lines(*_: object) -> None:
        raise worker.ModelError("a\nb")

    monkeypatch.setattr(worker, "attempt", two_lines)
    assert worker.outcome("files", np.random.default_rng(0), tmp_path) == ("message", "a\nb")

    def no_memory(*_: object) -> None:
        try:
            raise MemoryError
        except MemoryError as error:
            raise worker.ModelError("does not fit") from error

    monkeypatch.setattr(worker, "attempt", no_memory)
    assert worker.outcome("files", np.random.default_rng(0), tmp_path) == ("memory", "does not fit")

    def warned(*_: object) -> None:
        np.float32(1e30) * np.float32(1e30)

    monkeypatch.setattr(worker, "attempt", warned)
    assert worker.outcome("files", np.random.default_rng(0), tmp_path)[0] == "warning"
