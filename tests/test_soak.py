"""Many simplifications in one process leave nothing behind: no memory, no file handle, no thread.

``pytest tests/test_soak.py --soak 200`` is the long version.
"""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

SETTLED = 7
# What may come and go: caches of matplotlib and of the allocator.
GROWTH = 4 << 20
PER_RUN = 64 << 10

SCRIPT = """
import contextlib, ctypes, gc, json, os, sys, threading
from pathlib import Path
from meshsimp_pymoo.cli import main

folder, count, settled = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
libc = ctypes.CDLL(None)

def state():
    gc.collect()
    if hasattr(libc, "malloc_trim"):
        libc.malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    handles = []
    for fd in os.listdir("/proc/self/fd"):
        with contextlib.suppress(FileNotFoundError):  # the one that listed them
            handles.append(os.readlink(f"/proc/self/fd/{fd}"))
    return {
        "memory": pages * os.sysconf("SC_PAGESIZE"),
        "handles": len(handles),
        "open": [name for name in handles if str(folder) in name],
        "tasks": len(os.listdir("/proc/self/task")),
        "threads": sorted(thread.name for thread in threading.enumerate()),
        "objects": len(gc.get_objects()),
    }

states = []
for number in range(count):
    out = folder / "out"
    argv = ["simplify", "pyramid:9", "-o", str(out), "--algorithm", "nsga2_v1", "--population", "12", "--generations",
            "3", "--seed", str(number), "--meshes", "3", "--format", ("ply", "glb", "landxml")[number % 3], "--pick",
            "knee", "--threads", "2", "--quiet", "--overwrite"]
    assert main(argv) == 0
    if number >= settled - 1:
        states.append(state())
print(json.dumps(states))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="memory and handles are counted where Linux says them")
def test_many_simplifications_in_one_process_leave_nothing_behind(tmp_path, request):
    count = request.config.getoption("--soak")
    assert count > SETTLED
    command = [sys.executable, "-c", SCRIPT, str(tmp_path), str(count), str(SETTLED)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-3000:]
    states = json.loads(run.stdout)
    first, last = states[0], states[-1]
    assert len(states) == count - SETTLED + 1
    assert last["open"] == []
    for what in ("handles", "tasks", "threads"):
        assert last[what] == first[what], f"{what}: {first[what]} after {SETTLED}, {last[what]} after {count}"
    growth = last["memory"] - first["memory"]
    print(f"memory: {first['memory'] / 2**20:.1f} MiB after {SETTLED}, {growth / 2**20:+.2f} MiB after {count}")  # noqa: T201
    assert growth < GROWTH + PER_RUN * (len(states) - 1) * (len(states) < 50)
    more = last["objects"] - first["objects"]
    assert more < 20 * (len(states) - 1) + 500, f"{more} more objects after {count} than after {SETTLED}"
