"""Heights that mean "no sample": what is said to be one, and what looks like one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray
from meshsimp_pymoo.errors import warn_of

# Values that programs write where there is no sample; and from this size on a height is none.
NODATA_HABITS = (-9999.0, 9999.0, -99999.0, -999.0, -10000.0, -32768.0, -32767.0, 32767.0, 65535.0)
NODATA_SIZE = 1e30
# Values of that size are written with any number of digits, in single or double precision; all of them are meant.
NODATA_DIGITS = 1e-5


def is_nodata(height: AnyArray, nodata: float) -> BoolArray:
    """Tell which heights mean "no sample", in their own precision.

    Parameters
    ----------
    height : array of a real type
        Heights.
    nodata : float
        The height that means it.

    Returns
    -------
    bool array of the same shape

    Examples
    --------
    The lowest number of single precision is written in many ways:

    >>> is_nodata(np.array([-3.4028234663852886e38, -3.40282e38, 7.0]), -3.4028235e38).tolist()
    [True, True, False]
    """
    with np.errstate(over="ignore", invalid="ignore"):
        found = height == (height.dtype.type(nodata) if height.dtype.kind == "f" else nodata)
        if abs(nodata) >= NODATA_SIZE and height.dtype.kind == "f":
            # as shares of it, since the difference of two of the largest numbers may be none
            found |= np.abs(height.astype(np.float64) / nodata - 1.0) <= NODATA_DIGITS
        return np.asarray(found)


def warn_of_nodata(z: FloatArray, name: str) -> None:
    """Warn of a usual "no data" value among the heights (S,) that is farther from all others than these are apart."""
    for value, count, low, high in suspects(z):
        warn_of(
            f"{name}: {count} of {len(z)} heights are {value:.9g}, far from all others ({low:g} to {high:g}); if that "
            f"means 'no sample', say nodata={value:.9g} (--nodata={value:.9g})"
        )


def suspects(z: FloatArray) -> Iterator[tuple[float, int, float, float]]:
    """Yield such values among heights (S,), how many have them, and between what all others lie."""
    for value in (float(z.min(initial=np.inf)), float(z.max(initial=-np.inf))):
        if value not in NODATA_HABITS and not NODATA_SIZE <= abs(value) < np.inf:
            continue
        others = z[~is_nodata(z, value)]
        if not len(others):
            continue
        low, high = float(others.min()), float(others.max())
        if max(low - value, value - high) > high - low:
            yield value, len(z) - len(others), low, high
