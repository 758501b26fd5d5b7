"""How much memory a tiled front takes, and how much there is: asked before anything is begun."""

from __future__ import annotations

import os
from pathlib import Path

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.tiles.grid import HeightGrid

# Measured, rounded up: the libraries of a process, a sample of a tile, a sample of the whole while the first phase is
# read back, a triangle of the finest solution while it is measured or written.
PROCESS_BYTES = 250 << 20
TILE_SAMPLE_BYTES = 600
SAMPLE_BYTES = 1
TRIANGLE_BYTES = 250
# The largest tile, where tiles are shifted, is this much longer than the usual one.
LONGEST = 1.5
SMALLER_TILES = (1024, 512, 256, 128, 64)
# Where a control group says its limit, what is taken, and how much of that are files that can be read again.
CONTROL_GROUPS = (
    ("/sys/fs/cgroup", "memory.max", "memory.current", "file"),
    ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_cache"),
)


def check_memory(grid: HeightGrid, *, tile: int, most: int, jobs: int, remote: bool = False) -> None:
    """Refuse work that does not fit into the memory there is.

    Parameters
    ----------
    grid : HeightGrid
        The grid.
    tile : int
        Samples along one side of a tile.
    most : int
        Triangles of the finest solution.
    jobs : int
        Processes.
    remote : bool
        Whether the tiles are thinned on other machines.

    Raises
    ------
    ModelError
        With the tile that does fit, if there is one.
    """
    for_all, for_one = free_memory()

    def short_of(side: int) -> tuple[float, float] | None:
        """Return what is needed and what is free, if that is less."""
        own: float = PROCESS_BYTES + SAMPLE_BYTES * grid.n_samples + TRIANGLE_BYTES * most
        rows, columns = grid.shape
        tile_bytes = TILE_SAMPLE_BYTES * min(LONGEST * side, rows) * min(LONGEST * side, columns)
        workers = 0 if remote or jobs == 1 else jobs
        if jobs == 1 and not remote:
            own += tile_bytes
        largest = max(own, PROCESS_BYTES + tile_bytes if workers else 0)
        needed = own + workers * (PROCESS_BYTES + tile_bytes)
        return (needed, for_all) if needed > for_all else (largest, for_one) if largest > for_one else None

    missing = short_of(tile)
    if missing is None:
        return
    smaller = [side for side in SMALLER_TILES if side < tile and short_of(side) is None]
    raise ModelError(
        f"{grid.name}: tiles of {tile} samples a side need about {_spelled(missing[0])}, {jobs} at a time, and "
        f"{_spelled(missing[1])} are free; "
        + (f"use --tile {smaller[0]}" if smaller else "no --tile would do: use --jobs 1, fewer triangles or a --window")
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


def _spelled(size: float) -> str:
    return f"{size / 2**30:.1f} GiB" if size >= 2**30 else f"{size / 2**20:.0f} MiB"
