"""A warm process that runs command lines in forked children, which can be killed or held to a limit.

Starting Python and loading the compiled kernels takes seconds; a fork of a process that has done so takes none. As a
script it serves requests, one JSON object a line.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sketching import sketch, sketch_into

# What an experiment needs is loaded by one.
TINY = """
problems: ["roof:3"]
algorithms: [{preset: nsga2_v1, parameters: {pop_size: 8}}, {preset: moead, parameters: {pop_size: 8}}]
seeds: [1]
budgets: [{generations: 2}]
"""
# What draws pictures, by module: its name there and itself.
DRAWN: dict[Any, tuple[str, Any]] = {}
# Seconds after which a command is killed that should have ended.
LONGEST = 100.0


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Its exit code, or minus the signal that ended it; what it said; the seconds it took; how many of its processes
    outlived it.
    """

    code: int
    stderr: str
    seconds: float
    left: int


class Forker:
    """The client's side."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"},
        )

    def run(
        self,
        *args: Any,
        kill_after: float | None = None,
        signals: Sequence[tuple[float, int]] = (),
        memory: int | None = None,
        die_in: str | None = None,
        drawn: bool = False,
    ) -> Ended:
        """Run ``meshsimp ARGS``, with what is to happen to it.

        It is killed or gets other signals after some seconds, is allowed so much more memory, or dies in a call. Its
        pictures are sketches unless they are to be ``drawn``.
        """
        if kill_after is not None:
            signals = [(kill_after, signal.SIGKILL)]
        request = {"args": [str(arg) for arg in args], "signals": list(signals)}
        request |= {"memory": memory, "die_in": die_in, "drawn": drawn}
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        return Ended(**json.loads(self.process.stdout.readline()))

    def close(self) -> None:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def serve() -> None:
    import numpy as np

    from meshsimp_pymoo.cli import main
    from meshsimp_pymoo.comparison import report
    from meshsimp_pymoo.report import figures

    DRAWN.update({figures: ("front_figure", figures.front_figure), report: ("_save", report._save)})
    figures.front_figure, report._save = sketch, sketch_into

    replies = os.dup(1)
    os.dup2(2, 1)
    with tempfile.TemporaryDirectory() as folder:
        warm = ("simplify", "roof:5", "--threads", "1", "--population", "8", "--quiet", "--no-page", "--meshes", "none")
        for algorithm, budget in (("nsga2_v1", "40"), ("memetic", "20")):
            arguments = [*warm, "--algorithm", algorithm, "--evaluations", budget, "-o", f"{folder}/{algorithm}"]
            assert main(arguments) == 0
        np.save(f"{folder}/grid.npy", np.add.outer(np.arange(5.0), np.arange(70.0) ** 2 % 7))
        tiles = ("simplify", f"{folder}/grid.npy", "--tile", "64", "--jobs", "1", "--threads", "1", "--quiet")
        assert main([*tiles, "-o", f"{folder}/tiles"]) == 0
        Path(folder, "tiny.yaml").write_text(TINY, encoding="utf-8")
        assert main(["run", f"{folder}/tiny.yaml", "--jobs", "1", "--quiet", "-o", f"{folder}/run"]) == 0
        from meshsimp_pymoo.workers import _executors

        # threads must not be there when a process forks
        for pool in _executors.values():
            pool.shutdown()
        _executors.clear()
        for line in sys.stdin:
            request = json.loads(line)
            os.write(replies, (json.dumps(answer(request, Path(folder) / "said")) + "\n").encode())


def answer(request: dict[str, Any], said: Path) -> dict[str, Any]:
    start = time.perf_counter()
    # a signal that comes before the child is what it shall be waits, or it would end what is the parent's
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    child = os.fork()
    if child == 0:
        become(request, said, before)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    waiting = [*sorted(request["signals"]), (LONGEST, signal.SIGKILL)]
    done, status = 0, 0
    while not done:
        time.sleep(0.002)
        done, status = os.waitpid(child, os.WNOHANG)
        if not done and time.perf_counter() - start >= waiting[0][0]:
            os.kill(child, waiting.pop(0)[1])
    code = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - start
    text = said.read_text() if said.exists() else ""
    return {"code": code, "stderr": text, "seconds": seconds, "left": left_of(child)}


def left_of(group: int, patience: float = 20.0) -> int:
    """Return how many processes of a group there still are after some seconds at most."""
    until = time.perf_counter() + patience
    while True:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return 0
        if time.perf_counter() > until:
            found = subprocess.run(["ps", "-eo", "pgid="], capture_output=True, text=True, check=True).stdout
            return found.split().count(str(group))
        time.sleep(0.02)


def die(*_: Any, **__: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def become(request: dict[str, Any], said: Path, mask: set[Any]) -> None:
    import traceback

    os.setsid()
    with said.open("w") as file:
        os.dup2(file.fileno(), 2)
    sys.stderr = open(2, "w", buffering=1, closefd=False)
    code = 99
    try:
        if request["memory"] is not None:
            import resource

            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + request["memory"],) * 2)
        if request["drawn"]:
            for module, (name, draw) in DRAWN.items():
                setattr(module, name, draw)
        if request["die_in"] is not None:
            from unittest import mock

            mock.patch(request["die_in"], die).start()
        from meshsimp_pymoo.cli import main

        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        except KeyboardInterrupt:  # as if the command had just begun
            code = 130
        else:
            code = main(request["args"])
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    serve()
