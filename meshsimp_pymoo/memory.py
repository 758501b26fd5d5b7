"""How much memory is free: asked before anything large is begun."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

from meshsimp_pymoo.errors import ModelError

# Where a control group says its limit, what is taken, and how much of that are files that can be read again.
CONTROL_GROUPS = (
    ("/sys/fs/cgroup", "memory.max", "memory.current", "file"),
    ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_cache"),
)

# Bytes that are there if a program runs at all: asking takes longer than having them.
NEVER_ASKED = 1 << 20
# What a search in one piece takes for each vertex, rounded up, and any process.
VERTEX_BYTES = 1200
PROCESS_BYTES = 400 << 20


# Of glibc's mallopt: the parameters' numbers, and what they are set to [bytes].
ALLOCATION = {-3: 1 << 20, -1: 1 << 24}  # M_MMAP_THRESHOLD, M_TRIM_THRESHOLD


def give_back_at_once() -> None:
    """Have the C library give back the memory of a large array as soon as the array is gone.

    Otherwise glibc, once arrays have come and gone, keeps arrays of up to 32 MB in heaps that it cannot give back: half
    of what a search of a million vertices took. For a program's own process; where there is no glibc nothing is done.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    for parameter, size in ALLOCATION.items():
        mallopt(parameter, size)


def check_free(needed: float, what: str, way_out: str) -> None:
    """Refuse what does not fit into the memory that is free.

    Parameters
    ----------
    needed : float
        What it takes at least [bytes].
    what : str
        Begins the message: the file, and what in it needs the memory; plural.
    way_out : str
        Ends the message.

    Raises
    ------
    ModelError
        With both sizes.
    """
    if needed > NEVER_ASKED and needed > (free := min(free_memory())):
        raise ModelError(f"{what} need about {spelled(needed)}, and {spelled(free)} are free; {way_out}")


def fits_in_one_piece(n_vertices: int) -> bool:
    """Tell whether a model of so many vertices can be searched as a whole in the memory that is free."""
    return PROCESS_BYTES + VERTEX_BYTES * n_vertices <= min(free_memory())


def check_one_piece(n_vertices: int, name: str, way_out: str) -> None:
    """Refuse a search of so many vertices where it does not fit into the memory that is free.

    Parameters
    ----------
    n_vertices : int
        Number of vertices.
    name : str
        What messages call the model.
    way_out : str
        Ends the message.

    Raises
    ------
    ModelError
        With both sizes and the number of vertices that fit.
    """
    needed, free = VERTEX_BYTES * n_vertices, min(free_memory())
    if needed > free:
        most = float(f"{free / VERTEX_BYTES:.2g}")
        raise ModelError(
            f"{name}: a search of {n_vertices:,} vertices in one piece does not fit into memory: it takes about "
            f"{spelled(needed)}, and {spelled(free)} are free, enough for some {most:,.0f}; {way_out}"
        )


def free_memory() -> tuple[float, float]:
    """Return the bytes that are free for all processes together, and for each one; infinite where nobody says.

    Asked are the system, the limits of this process and those of its control group.
    """
    for_all = [_from_meminfo(), _of_control_group()]
    return min(for_all), _of_this_process()


def _of_this_process() -> float:
    try:
        import resource
    except ImportError:  # Windows
        return float("inf")
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return float("inf")
    try:
        used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        used = 0
    return float(max(limit - used, 0))


def _from_meminfo() -> float:
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, IndexError, StopIteration):
        return float("inf")


def _of_control_group() -> float:
    for folder, limit, used, cache in CONTROL_GROUPS:
        try:
            stat = dict(line.split() for line in Path(folder, "memory.stat").read_text().splitlines())
            taken = int(Path(folder, used).read_text()) - int(stat[cache])
            return float(max(int(Path(folder, limit).read_text()) - taken, 0))
        except (OSError, ValueError, KeyError):  # there is none, or it says "max"
            continue
    return float("inf")


def spelled(size: float) -> str:
    """Return a size as people say it.

    >>> spelled(5 << 20), spelled(3 << 29)
    ('5 MiB', '1.5 GiB')
    """
    return f"{size / 2**30:.1f} GiB" if size >= 2**30 else f"{size / 2**20:.0f} MiB"
