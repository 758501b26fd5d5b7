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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Seconds after which a command is killed that should have ended.
LONGEST = 100.0


@dataclass(frozen=True)
class Ended:
    """How a command ended: its exit code, or minus the signal that ended it; what it said; the seconds it took."""

    code: int
    stderr: str
    seconds: float


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
        self, *args: Any, kill_after: float | None = None, memory: int | None = None, die_in: str | None = None
    ) -> Ended:
        """Run ``meshsimp ARGS``; kill it after some seconds, allow it so much more memory, or let it die in a call."""
        request = {"args": [str(arg) for arg in args], "kill_after": kill_after, "memory": memory, "die_in": die_in}
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
    from meshsimp_pymoo.cli import main

    replies = os.dup(1)
    os.dup2(2, 1)
    with tempfile.TemporaryDirectory() as folder:
        warm = ("simplify", "roof:5", "--threads", "1", "--population", "8", "--quiet", "--no-page", "--meshes", "none")
        for algorithm, budget in (("nsga2_v1", "40"), ("memetic", "20")):
            arguments = [*warm, "--algorithm", algorithm, "--evaluations", budget, "-o", f"{folder}/{algorithm}"]
            assert main(arguments) == 0
        import meshsimp_pymoo.cli.reporting
        import meshsimp_pymoo.comparison.runner  # noqa: F401
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
    child = os.fork()
    if child == 0:
        become(request, said)
    limit = LONGEST if request["kill_after"] is None else request["kill_after"]
    done, status = 0, 0
    while not done and time.perf_counter() - start < limit:
        time.sleep(0.002)
        done, status = os.waitpid(child, os.WNOHANG)
    if not done:
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - start
    return {"code": code, "stderr": said.read_text() if said.exists() else "", "seconds": seconds}


def die(*_: Any, **__: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def become(request: dict[str, Any], said: Path) -> None:
    import traceback

    with said.open("w") as file:
        os.dup2(file.fileno(), 2)
    sys.stderr = open(2, "w", buffering=1, closefd=False)
    code = 99
    try:
        if request["memory"] is not None:
            import resource

            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + request["memory"],) * 2)
        if request["die_in"] is not None:
            from unittest import mock

            mock.patch(request["die_in"], die).start()
        from meshsimp_pymoo.cli import main

        code = main(request["args"])
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    serve()
