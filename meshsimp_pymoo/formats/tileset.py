"""3D Tiles 1.1 [1]_: levels of detail as a chain of tiles, each of which gives way to the next finer one.

References
----------
.. [1] "3D Tiles Specification 1.1", Open Geospatial Consortium 22-025r4, 2023.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray

VERSION = "1.1"
TILESET = "tileset.json"


def write_tileset(
    path: Path,
    uris: Sequence[str],
    errors: Sequence[float],
    *,
    box: FloatArray,
    axes: FloatArray,
    at: FloatArray,
    whole: float,
    extras: Mapping[str, Any],
) -> None:
    """Write the tileset of a chain of levels.

    Parameters
    ----------
    path : Path
        The file.
    uris : sequence of str
        The GLB of each level, the finest first.
    errors : sequence of float
        The geometric error of each: what is seen wrong while no finer one is shown [m]; never less than that of a finer
        one.
    box : (2, 3) float array
        The lowest and the highest corner of all levels, in their frame with z up [m].
    axes, at : (3, 3), (3,) float arrays
        Its axes x, y and z, as rows, and its origin, in the frame of the tileset.
    whole : float
        What is wrong while nothing is shown [m].
    extras : mapping
        What else to say of it, as plain data.
    """
    import numpy as np

    low, high = box
    half = np.diag((high - low) / 2)
    volume = {"box": np.concatenate([(low + high) / 2, half.ravel()]).tolist()}
    tile: dict[str, Any] = {}
    for uri, error in zip(uris, errors, strict=True):
        finer = {"children": [tile]} if tile else {}
        tile = {"boundingVolume": volume, "geometricError": error, "content": {"uri": uri}} | finer
    transform = np.zeros((4, 4))
    transform[:3, :3], transform[3, :3], transform[3, 3] = axes, at, 1.0  # column after column
    root = {"transform": (transform.ravel() + 0.0).tolist(), "refine": "REPLACE"} | tile
    tileset = {"asset": {"version": VERSION}, "geometricError": whole, "root": root, "extras": dict(extras)}
    path.write_bytes((json.dumps(tileset, indent=1, allow_nan=False) + "\n").encode())
