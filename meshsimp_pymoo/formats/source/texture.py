"""Where on an image each vertex lies, and images that a file names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.errors import reason_of, warn_of
from meshsimp_pymoo.files import stays_inside
from meshsimp_pymoo.formats.material import IMAGES

# Of a file that another one names; photogrammetry's largest images take less.
BESIDE_LIMIT = 1 << 28


def uv_of_corners(vertex: IntArray, uv: FloatArray, name: str) -> FloatArray | None:
    """Return the texture coordinates of vertices from those of the corners of faces.

    Parameters
    ----------
    vertex : (K,) int array
        The vertex at each corner.
    uv : (K, 2) float array
        Its coordinates on the image there; NaN: none.
    name : str
        What messages call the mesh.

    Returns
    -------
    (V, 2) float array, optional
        One row for each vertex up to the largest; 0 at those of no corner. None where a vertex of a face has none or
        several.

    Warns
    -----
    ModelWarning
        If it is None, with the numbers of both.
    """
    found = np.zeros((int(vertex.max(initial=-1)) + 1, 2))
    has = np.isfinite(uv).all(axis=1)
    found[vertex[has]] = uv[has]
    used, known, several = (np.zeros(len(found), bool) for _ in range(3))
    used[vertex], known[vertex[has]] = True, True
    several[vertex[has][(found[vertex[has]] != uv[has]).any(axis=1)]] = True
    if several.any() or not known[used].all():
        warn_of(_left_behind(name, int(several.sum()), int((used & ~known).sum()), int(used.sum())))
        return None
    return found


def _left_behind(name: str, several: int, without: int, count: int) -> str:
    words = {"lie on seams of the texture, with several coordinates each": several, "have no place on it": without}
    parts = [f"{number} of {count} vertices {what}" for what, number in words.items() if number]
    way_out = ' (turn it into vertex colours first: docs, "A scan", With a texture)' if several else ""
    return f"{name}: {' and '.join(parts)}; its texture stays behind{way_out}"


def merged(attributes: Mapping[str, npt.ArrayLike], first: IntArray, place: IntArray, name: str) -> dict[str, AnyArray]:
    """Return the attributes of vertices that others were merged into.

    Parameters
    ----------
    attributes : mapping of str to arrays of V rows
        Those of all vertices.
    first : (M,) int array
        The vertices that stay, whose attributes stay too.
    place : (V,) int array
        Which of those each vertex was merged into.
    name : str
        What messages call the mesh.

    Warns
    -----
    ModelWarning
        If others had other ones, with the number of places. Texture coordinates then stay behind altogether: between
        the two sides of a seam the whole image would be drawn.
    """
    kept = {}
    for key, values in attributes.items():
        array = np.asarray(values)
        rows = array.reshape(len(array), -1)
        unlike = rows != rows[first][place]
        if rows.dtype.kind == "f":
            unlike &= ~(np.isnan(rows) & np.isnan(rows[first][place]))
        n = len(np.unique(place[unlike.any(axis=1)]))
        if n and key == "uv":
            warn_of(_left_behind(name, n, 0, len(first)))
            continue
        if n:
            warn_of(f"{name}: {n} of {len(first)} vertices have several values of {key!r}, of which the first stays")
        kept[key] = array[first]
    return kept


def file_beside(path: Path, named: str, name: str, what: str) -> bytes | None:
    """Return the content of a file that a mesh's file names, which must lie in its folder or below.

    Parameters
    ----------
    path : Path
        The mesh's file.
    named : str
        The name in it; either slash parts folders.
    name, what : str
        What messages call the mesh's file and the other one.

    Warns
    -----
    ModelWarning
        If it is outside, not there, cannot be read or is larger than 256 MiB; then it is None.
    """
    named = named.strip().strip('"').replace("\\", "/")
    if not stays_inside(path.parent, named):
        warn_of(f"{name}: names the {what} {named[:80]!r}, which is outside its folder and is not read")
        return None
    try:
        other = path.parent / named
        if not other.is_file():
            raise FileNotFoundError("no such file")
        if other.stat().st_size > BESIDE_LIMIT:
            raise OSError(f"larger than {BESIDE_LIMIT >> 20} MiB")
        return other.read_bytes()
    except (OSError, ValueError) as problem:
        warn_of(f"{name}: its {what} {named[:80]!r} cannot be read ({reason_of(problem)}) and stays behind")
        return None


def checked_image(content: bytes | None, name: str, what: str) -> bytes:
    """Return the file of an image if it is one of those that are carried, else nothing, with a warning."""
    if not content:
        return b""
    if not content.startswith(tuple(IMAGES.values())):
        warn_of(f"{name}: its image {what[:80]!r} is neither PNG nor JPEG and stays behind")
        return b""
    return content
