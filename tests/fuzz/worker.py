"""Give damaged input to the readers, in a process of bounded memory, case by case.

    python tests/fuzz/worker.py KIND SEED FIRST END FOLDER

prints one JSON line for every case that ends otherwise than in a result or a one-line error, or that ran into the
limit of memory before anybody asked how much there is. A case that takes longer than SECONDS of the processor ends the
process, after the traceback of where it was; FOLDER/case says which one it was.
"""

from __future__ import annotations

import collections
import faulthandler
import json
import re
import resource
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import expanding
import mutations

from meshsimp_pymoo.comparison.config import ConfigError, read_experiment_file
from meshsimp_pymoo.errors import ModelError, ModelWarning, ResultError
from meshsimp_pymoo.formats.table import read_lines, read_source
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.storage import read_front
from meshsimp_pymoo.surface.model import build_model

# The limits of every case: seconds of the processor (and of the clock, for what only waits), bytes beyond those that
# the idle process has, and characters in a line.
SECONDS = 5.0
LONGEST_WAIT = 100.0
MEMORY = 1 << 30
LONGEST_MESSAGE = 3000


def read_file(folder: Path, suffix: str, content: bytes) -> None:
    """Read a file as far as a first evaluation, which must give numbers."""
    path = folder / f"a.{suffix}"
    path.write_bytes(content)
    problem = MeshProblem(build_model(read_source(path)), n_threads=1)
    kept = np.random.default_rng(1).random((2, problem.n_var)) < 0.5
    kept[0] = True
    F = problem.evaluate(kept)
    if not np.isfinite(F).all() or (F < 0).any():
        raise AssertionError(f"the objectives are {F.tolist()}")


def read_polylines(folder: Path, suffix: str, content: bytes) -> None:
    """Read a file of lines, which must be finite."""
    path = folder / f"a.{suffix}"
    path.write_bytes(content)
    found = read_lines(path)
    if not found.lines or not all(len(line) > 1 and np.isfinite(line).all() for line in found.lines):
        raise AssertionError(f"the lines are {found.lines}")


def read_config(folder: Path, content: bytes) -> None:
    """Read a configuration."""
    path = folder / "a.yaml"
    path.write_bytes(content)
    read_experiment_file(path)


def read_result(folder: Path, files: dict[str, bytes]) -> None:
    """Read a stored front."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    read_front(folder)


def attempt(kind: str, rng: np.random.Generator | None, folder: Path) -> None:
    """Run one case; without a generator all the undamaged ones."""
    if kind == "files":
        cases = mutations.good_files() if rng is None else [mutations.file_case(rng)]
        for suffix, content in cases:
            read_file(folder, suffix, content)
    elif kind == "lines":
        for suffix, content in mutations.good_lines() if rng is None else [mutations.line_case(rng)]:
            read_polylines(folder, suffix, content)
    elif kind == "expanding":
        for suffix, content in mutations.good_files() if rng is None else [expanding.expanding_case(rng)]:
            read_file(folder, suffix, content)
    elif kind == "configs":
        (folder / "scans").mkdir(exist_ok=True)
        (folder / "scans" / "a.asc").write_bytes(dict(mutations.good_files())["asc"])
        whole = [text.encode() for text in mutations.CONFIGS]
        for content in whole if rng is None else [mutations.config_case(rng)]:
            read_config(folder, content)
    else:
        read_result(folder, dict(mutations.good_front()) if rng is None else mutations.result_case(rng))


def outcome(kind: str, rng: np.random.Generator, folder: Path) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that, if anything."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            attempt(kind, rng, folder)
            ended, said = "result", ""
        except (ModelError, ConfigError, ResultError) as problem:
            ended, said = type(problem).__name__, str(problem)
            if any(isinstance(error, MemoryError) for error in (problem.__cause__, problem.__context__)):
                return "memory", said
        except Exception:
            return "traceback", traceback.format_exc()
    foreign = [w for w in caught if not issubclass(w.category, ModelWarning)]
    if foreign:
        return "warning", f"{foreign[0].category.__name__}: {foreign[0].message} ({foreign[0].filename})"
    for line in [said, *(str(w.message) for w in caught)]:
        if "\n" in line or len(line) > LONGEST_MESSAGE:
            return "message", line[:500]
    return ended, ""


def main() -> None:
    """Run the cases that the command line names."""
    kind, seed, first, end = sys.argv[1], *map(int, sys.argv[2:5])
    folder = Path(sys.argv[5])
    warnings.simplefilter("ignore")
    attempt(kind, None, folder)  # compiles and imports everything
    idle = memory("VmRSS")
    resource.setrlimit(resource.RLIMIT_AS, (memory("VmSize") + MEMORY, resource.RLIM_INFINITY))
    # the signal of the processor's clock says where the process is, and then ends it as it does by default
    faulthandler.register(signal.SIGPROF, chain=True)
    counts: collections.Counter[str] = collections.Counter()
    slowest: tuple[float, int] = (0.0, -1)
    largest: tuple[int, int] = (0, -1)
    for number in range(first, end):
        (folder / "case").write_text(str(number))
        rng = np.random.default_rng([seed, number])
        Path("/proc/self/clear_refs").write_text("5")  # the peak of memory begins again
        faulthandler.dump_traceback_later(LONGEST_WAIT, exit=True)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        start = time.process_time()
        ended, wrong = outcome(kind, rng, folder)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        slowest = max(slowest, (time.process_time() - start, number))
        largest = max(largest, (memory("VmHWM") - idle, number))
        faulthandler.cancel_dump_traceback_later()
        counts[ended] += 1
        if wrong:
            print(json.dumps({"case": number, "ended": ended, "what": wrong}), flush=True)
    summary: dict[str, Any] = {"counts": dict(counts), "slowest": slowest, "largest": largest}
    print(json.dumps(summary), flush=True)


def memory(what: str) -> int:
    """Return a size of this process that the system keeps [bytes]."""
    found = re.search(rf"^{what}:\s+(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
    assert found is not None
    return int(found[1]) << 10


if __name__ == "__main__":
    main()
