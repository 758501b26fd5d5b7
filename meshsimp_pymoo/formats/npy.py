"""NumPy's .npy: the heights of a grid, mapped into memory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.files import NpyHeader
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import Grid, PlacedHeights


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    return _load(path, name, options).mesh(name, options.window)


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    return _load(path, name, options, by_windows=True).placed(name, options.window)


def _load(path: Path, name: str, options: Options, *, by_windows: bool = False) -> Grid:
    import numpy as np

    from meshsimp_pymoo.formats.source.heights import check_heights, check_room, even_grid

    header, start = _header(path, name)
    check_heights(header.shape, header.dtype, name)
    check_room(header.shape, 0, options, name, by_windows=by_windows)
    order = "F" if header.fortran else "C"
    heights = np.memmap(path, header.dtype, "r", start, header.shape, order)  # type: ignore[call-overload]
    return even_grid(heights, *(options.steps or ()), nodata=options.nodata, name=name)


def _header(path: Path, name: str) -> tuple[NpyHeader, int]:
    """Return what the array is and where its numbers begin."""
    from meshsimp_pymoo.files import read_npy_header

    with path.open("rb") as stream:
        return read_npy_header(stream, path.stat().st_size, name), stream.tell()


def _count_samples(path: Path, name: str) -> int:
    import math

    return math.prod(_header(path, name)[0].shape)


register(Format("npy", (".npy",), ".npy", "grid", read=_read, open_heights=_open_heights, count_samples=_count_samples))
