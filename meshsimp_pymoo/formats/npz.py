"""NumPy's .npz: heights as ``elevation`` (or the only 2-D array), optionally their distances ``dx`` and ``dy``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray
    from meshsimp_pymoo.formats.source import SourceMesh


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    from meshsimp_pymoo.files import read_npz
    from meshsimp_pymoo.formats.source.heights import grid_source

    steps = options.steps
    with path.open("rb") as stream:
        arrays = read_npz(stream, name)
    if not arrays:
        raise ModelError(f"{name}: holds no arrays; save the heights as 'elevation'")
    if "elevation" in arrays:
        height = arrays["elevation"]
    else:
        flat = [key for key, array in arrays.items() if array.ndim == 2]
        if len(flat) != 1:
            raise ModelError(f"{name}: has no array 'elevation' and {len(flat)} other 2-D arrays {flat}; name one so")
        height = arrays[flat[0]]
    if steps is None:
        dx = _scalar(arrays, "dx", 1.0, name)
        steps = (dx, _scalar(arrays, "dy", dx, name))
    return grid_source(height, *steps, nodata=options.nodata, name=name, window=options.window)


def _scalar(arrays: dict[str, AnyArray], key: str, default: float, name: str) -> float:
    if key not in arrays:
        return default
    if arrays[key].size != 1 or arrays[key].dtype.kind not in "iuf":
        raise ModelError(f"{name}: {key!r} is {arrays[key].dtype} of the shape {arrays[key].shape}; give one number")
    return float(arrays[key].reshape(()))


register(Format("npz", (".npz",), ".npz", "grid", read=_read))
