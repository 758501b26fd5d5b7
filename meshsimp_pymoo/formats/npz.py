"""NumPy's .npz: heights by name, and where they lie: as axes, or as the distances ``dx`` and ``dy``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, listed, register, ways_to_read

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, FloatArray
    from meshsimp_pymoo.files import NpyHeader
    from meshsimp_pymoo.formats.source.heights import Grid

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


def _load(path: Path, name: str, options: Options, *, by_windows: bool = False) -> Grid:
    """Read heights and where they lie: at axes if there are any, else ``dx`` and ``dy`` apart; a spacing goes first."""
    import numpy as np

    from meshsimp_pymoo.files import npz_headers, read_npz
    from meshsimp_pymoo.formats.source.heights import Grid, check_heights, check_room, even_grid

    with path.open("rb") as stream:
        headers = npz_headers(stream, name)
        pair = _axes(headers, name)
        key = _heights(headers, pair, name)
        shape, _, kind = headers[key]
        check_heights(shape, kind, name)
        check_room(shape, kind.itemsize, options, name, by_windows=by_windows)
        for along, axis in zip((1, 0), pair, strict=False):
            _check_axis(headers[axis], axis, shape, along, name)
        for axis in {"dx", "dy"} & headers.keys():
            _check_scalar(headers[axis], axis, name)
        stream.seek(0)
        arrays = read_npz(stream, name, wanted={key, *pair, "dx", "dy"})
    heights = arrays[key]
    if not pair:
        dx = float(arrays["dx"].item()) if "dx" in arrays else 1.0
        dy = float(arrays["dy"].item()) if "dy" in arrays else dx
        return even_grid(heights, *(options.steps or (dx, dy)), nodata=options.nodata, name=name)
    x, y = (_axis(arrays[axis], axis, along, name) for along, axis in zip((1, 0), pair, strict=True))
    in_degrees = tuple(axis.lower() for axis in pair) in DEGREES
    if options.steps is not None:
        # metres, say, do not count from a place in degrees
        x, y = (
            (0.0 if in_degrees else axis[0]) + np.copysign(step, axis[1] - axis[0]) * np.arange(len(axis))
            for axis, step in zip((x, y), options.steps, strict=True)
        )
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


def _check_axis(header: NpyHeader, axis: str, shape: tuple[int, ...], along: int, name: str) -> None:
    """Refuse what cannot say where columns (``along`` 1) or rows (0) of heights of this shape lie."""
    if header.dtype.kind not in "iuf" or header.shape not in ((shape[along],), shape):
        raise ModelError(
            f"{name}: {axis!r} is {header.dtype} of the shape {header.shape} beside heights of the shape {shape}; give "
            f"{shape[along]} numbers, one for each {'column' if along else 'row'}"
        )


def _check_scalar(header: NpyHeader, key: str, name: str) -> None:
    if any(count != 1 for count in header.shape) or header.dtype.kind not in "iuf":
        raise ModelError(f"{name}: {key!r} is {header.dtype} of the shape {header.shape}; give one number")


def _axis(values: AnyArray, axis: str, along: int, name: str) -> FloatArray:
    """Return where columns or rows lie, from one number for each of them, or for each sample."""
    import numpy as np

    places: FloatArray = values.astype(np.float64)
    if places.ndim == 2:
        lines = places if along else places.T
        if not (lines == lines[0]).all():
            raise ModelError(
                f"{name}: {axis!r} is not the same in all {'rows' if along else 'columns'}, so the samples are no grid "
                "along its axes; save its transpose, or x y z as text (.xyz)"
            )
        places = lines[0]
    steps = np.diff(places)
    if not (np.isfinite(places).all() and ((steps > 0).all() or (steps < 0).all())):
        raise ModelError(f"{name}: {axis!r} neither rises nor falls all along; sort rows and columns by their axes")
    return places


register(Format("npz", (".npz",), ".npz", "grid", **ways_to_read(_load)))
