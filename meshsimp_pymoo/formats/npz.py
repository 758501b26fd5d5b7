"""NumPy's .npz: heights by name, and where they lie: as axes, or as the distances ``dx`` and ``dy``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, listed, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, FloatArray
    from meshsimp_pymoo.files import NpyHeader
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import Grid, PlacedHeights

# What heights are called where an archive holds several arrays that might be them; all names in lower case.
HEIGHTS = (
    "elevation",
    "z",
    "height",
    "heights",
    "dem",
    "dtm",
    "dsm",
    "altitude",
    "topo",
    "topography",
    "data",
    "values",
)
# What the axes to the east and to the north are called, in pairs; those of the first two are degrees.
AXES = (("lon", "lat"), ("longitude", "latitude"), ("x", "y"), ("xs", "ys"), ("easting", "northing"))
DEGREES = AXES[:2]


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    return _load(path, name, options).mesh(name, options.window)


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    return _load(path, name, options, by_windows=True).placed(name, options.window)


def _load(path: Path, name: str, options: Options, *, by_windows: bool = False) -> Grid:
    """Read heights and where they lie: at axes if there are any, else ``dx`` and ``dy`` apart; a spacing goes first."""
    import numpy as np

    from meshsimp_pymoo.files import npz_headers, read_npz
    from meshsimp_pymoo.formats.source.heights import Grid, check_heights, check_room, even_grid, warn_of_degrees

    with path.open("rb") as stream:
        headers = npz_headers(stream, name)
        pair = _axes(headers, name)
        key = _heights(headers, pair, name)
        shape, _, kind = headers[key]
        check_heights(shape, kind, name)
        check_room(shape, kind.itemsize, options, name, by_windows=by_windows)
        stream.seek(0)
        arrays = read_npz(stream, name, wanted={key, *pair, "dx", "dy"})
    heights = arrays[key]
    if not pair:
        dx = _scalar(arrays, "dx", 1.0, name)
        steps = options.steps or (dx, _scalar(arrays, "dy", dx, name))
        return even_grid(heights, *steps, nodata=options.nodata, name=name)
    x, y = (_axis(arrays[axis], axis, heights, along, name) for along, axis in zip((1, 0), pair, strict=True))
    in_degrees = tuple(axis.lower() for axis in pair) in DEGREES
    if options.steps is not None:
        # metres, say, do not count from a place in degrees
        x, y = (
            (0.0 if in_degrees else axis[0]) + np.copysign(step, axis[1] - axis[0]) * np.arange(len(axis))
            for axis, step in zip((x, y), options.steps, strict=True)
        )
    elif in_degrees:
        warn_of_degrees(name)
    facts = {"unit": "degree"} if in_degrees and options.steps is None else {}
    return Grid(heights, x, y, options.nodata, facts)


def _axes(headers: dict[str, NpyHeader], name: str) -> tuple[str, ...]:
    """Return the names of the arrays that say where columns and rows lie, if there are any."""
    spelled = {key.lower(): key for key in headers}
    pairs = [tuple(spelled[axis] for axis in pair) for pair in AXES if all(axis in spelled for axis in pair)]
    if len(pairs) > 1:
        raise ModelError(
            f"{name}: holds more than one pair of axes, {listed(' and '.join(pair) for pair in pairs)}; save the one "
            "that is meant"
        )
    if not pairs and (single := sorted(spelled[axis] for pair in AXES for axis in pair if axis in spelled)):
        warn_of(f"{name}: holds {listed(single)}, but no pair of axes, and the samples were placed without")
    return pairs[0] if pairs else ()


def _heights(headers: dict[str, NpyHeader], pair: tuple[str, ...], name: str) -> str:
    """Return the name of the array that holds the heights."""
    if not headers:
        raise ModelError(f"{name}: holds no arrays; save the heights as 'elevation'")
    flat = [key for key, header in headers.items() if len(header.shape) == 2 and key not in pair]
    called = [key for key in flat if key.lower() in HEIGHTS]
    if "elevation" in headers:
        return "elevation"
    if len(flat) != 1 and len(called) != 1:
        raise ModelError(
            f"{name}: has no array 'elevation', and of its 2-D arrays {flat} it is not clear which holds the heights; "
            "save them as 'elevation'"
        )
    (key,) = called if len(called) == 1 else flat
    if others := [other for other in flat if other != key and headers[other].shape == headers[key].shape]:
        warn_of(f"{name}: its heights are taken to be {key!r}, not {listed(map(repr, others))} of the same shape")
    return key


def _axis(values: AnyArray, axis: str, heights: AnyArray, along: int, name: str) -> FloatArray:
    """Return where columns (``along`` 1) or rows (0) lie, from one number for each of them, or for each sample."""
    import numpy as np

    count = heights.shape[along]
    if values.shape == heights.shape and values.ndim == 2:
        line = values[0] if along else values[:, 0]
        if not (values == (line[None, :] if along else line[:, None])).all():
            raise ModelError(
                f"{name}: {axis!r} is not the same in all {'rows' if along else 'columns'}, so the samples are no grid "
                "along its axes; save its transpose, or x y z as text (.xyz)"
            )
        values = line
    if values.dtype.kind not in "iuf" or values.shape != (count,):
        raise ModelError(
            f"{name}: {axis!r} is {values.dtype} of the shape {values.shape} beside heights of the shape "
            f"{heights.shape}; give {count} numbers, one for each {'column' if along else 'row'}"
        )
    places: FloatArray = values.astype(np.float64)
    steps = np.diff(places)
    if not (np.isfinite(places).all() and ((steps > 0).all() or (steps < 0).all())):
        raise ModelError(f"{name}: {axis!r} neither rises nor falls all along; sort rows and columns by their axes")
    return places


def _scalar(arrays: dict[str, AnyArray], key: str, default: float, name: str) -> float:
    if key not in arrays:
        return default
    if arrays[key].size != 1 or arrays[key].dtype.kind not in "iuf":
        raise ModelError(f"{name}: {key!r} is {arrays[key].dtype} of the shape {arrays[key].shape}; give one number")
    return float(arrays[key].reshape(()))


register(Format("npz", (".npz",), ".npz", "grid", read=_read, open_heights=_open_heights))
