"""Places along a Hilbert curve over the plane: what is close on the curve is close in the plane.

D. Hilbert, "Ueber die stetige Abbildung einer Linie auf ein Flaechenstueck", Mathematische Annalen 38, 1891.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import entry

# Resolution in bits along one side: finer than any raster, and two of them fit an int64.
HILBERT_BITS = 26


@entry
def hilbert_keys(xy: np.ndarray) -> np.ndarray:
    """Return the place of each point on the curve through the unit square.

    Parameters
    ----------
    xy : (n, 2) float array
        Points; those outside the unit square are taken at its border.

    Returns
    -------
    (n,) int64 array
        Ascending along the curve.
    """
    keys = np.empty(len(xy), np.int64)
    limit = 2**HILBERT_BITS - 1
    for i in range(len(xy)):
        x = int(min(max(xy[i, 0], 0.0), 1.0) * 2.0**HILBERT_BITS)
        y = int(min(max(xy[i, 1], 0.0), 1.0) * 2.0**HILBERT_BITS)
        x = min(x, limit)
        y = min(y, limit)
        key = np.int64(0)
        s = np.int64(1) << (HILBERT_BITS - 1)
        while s > 0:
            rx = 1 if x & s else 0
            ry = 1 if y & s else 0
            key = (key << 2) | ((3 * rx) ^ ry)
            if ry == 0:
                if rx == 1:
                    x = limit - x
                    y = limit - y
                x, y = y, x
            s >>= 1
        keys[i] = key
    return keys
