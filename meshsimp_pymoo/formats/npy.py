"""NumPy's .npy: the heights of a grid, read whole or mapped into memory."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError, raise_if_memory, reason_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import PlacedHeights


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    from meshsimp_pymoo.files import read_npy
    from meshsimp_pymoo.formats.source.heights import grid_source

    dx, dy = options.steps or (1.0, 1.0)
    with path.open("rb") as stream:
        height = read_npy(stream, path.stat().st_size, name)
    return grid_source(height, dx, dy, nodata=options.nodata, name=name, window=options.window)


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    from meshsimp_pymoo.formats.source.heights import placed_heights

    return placed_heights(_mapped(path, name), name, options)


def _count_samples(path: Path, name: str) -> int:
    return int(_mapped(path, name).size)


def _mapped(path: Path, name: str) -> AnyArray:
    import numpy as np

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about the header's spelling
            heights = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as problem:  # its header is Python text: anything may break
        raise_if_memory(problem)
        raise ModelError(
            f"{name}: is not a whole NumPy array file ({reason_of(problem)}); save or copy it again"
        ) from None
    if not isinstance(heights, np.ndarray):
        raise ModelError(f"{name}: holds several arrays; save the heights alone with numpy.save")
    return heights


register(Format("npy", (".npy",), ".npy", "grid", read=_read, open_heights=_open_heights, count_samples=_count_samples))
