"""How much memory a tiled front takes, and how much there is: asked before anything is begun."""

from __future__ import annotations

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.memory import free_memory, spelled
from meshsimp_pymoo.surface.grid import HeightGrid

# Measured, rounded up: the libraries of a process, a sample of a tile, a sample of the whole while the first phase is
# read back, a triangle of the finest solution while it is measured or written.
PROCESS_BYTES = 250 << 20
TILE_SAMPLE_BYTES = 600
SAMPLE_BYTES = 1
TRIANGLE_BYTES = 250
# The largest tile, where tiles are shifted, is this much longer than the usual one.
LONGEST = 1.5
SMALLER_TILES = (1024, 512, 256, 128, 64)


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
        rows, columns = grid.shape
        own: float = PROCESS_BYTES + SAMPLE_BYTES * rows * columns + TRIANGLE_BYTES * most
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
        f"{grid.name}: tiles of {tile} samples a side need about {spelled(missing[0])}, {jobs} at a time, and "
        f"{spelled(missing[1])} are free; "
        + (f"use --tile {smaller[0]}" if smaller else "no --tile would do: use --jobs 1, fewer triangles or a --window")
    )
