"""Give damaged input to the readers, in a process of bounded memory, case by case.

    python tests/fuzz/worker.py KIND SEED FIRST END FOLDER

prints one JSON line for every case that ends otherwise than in a result or a one-line error. A case that takes longer
than SECONDS ends the process, after the traceback of where it was; FOLDER/case says which one it was.
"""

from __future__ import annotations

import collections
import faulthandler
import json
import resource
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import mutations

from meshsimp_pymoo.comparison.config import ConfigError, read_experiment_file
from meshsimp_pymoo.errors import ModelError, ModelWarning, ResultError
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.storage import read_front
from meshsimp_pymoo.surface.model import build_model

SECONDS = 5.0
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
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, resource.RLIM_INFINITY))
    counts: collections.Counter[str] = collections.Counter()
    slowest: tuple[float, int] = (0.0, -1)
    for number in range(first, end):
        (folder / "case").write_text(str(number))
        rng = np.random.default_rng([seed, number])
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        start = time.perf_counter()
        ended, wrong = outcome(kind, rng, folder)
        slowest = max(slowest, (time.perf_counter() - start, number))
        faulthandler.cancel_dump_traceback_later()
        counts[ended] += 1
        if wrong:
            print(json.dumps({"case": number, "ended": ended, "what": wrong}), flush=True)
    summary: dict[str, Any] = {"counts": dict(counts), "slowest": slowest}
    summary["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(json.dumps(summary), flush=True)


if __name__ == "__main__":
    main()
