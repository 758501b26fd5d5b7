"""Meshes as VTK has them: points, cells of several kinds, and arrays that go with points, cells or the whole."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.formats.outmesh import OutMesh, metres_of
from meshsimp_pymoo.formats.source.metric import epsg_number

# What VTK calls the numbers of arrays, and what it has instead of others.
TYPES = {
    "i1": "Int8", "u1": "UInt8", "i2": "Int16", "u2": "UInt16", "i4": "Int32", "u4": "UInt32", "i8": "Int64",
    "u8": "UInt64", "f4": "Float32", "f8": "Float64",
}  # fmt: skip
WIDER = {"b1": "u1", "f2": "f4"}
# The numbers of cells of two corners and of three.
LINE, TRIANGLE = 3, 5
# The array of cells that tells triangles (0) from break lines (their number, from 1).
BREAK_LINE = "break_line"
# The arrays of points that have a meaning: what VTK calls it.
MEANINGS = {"color": "Scalars", "uv": "TCoords"}


class Cells(NamedTuple):
    """Cells: the points of all, where each one's end, what each is, and arrays (C,) of them, by name."""

    corners: IntArray
    ends: IntArray
    kinds: AnyArray
    columns: dict[str, AnyArray]


def cells_of(mesh: OutMesh) -> Cells:
    """Return the triangles, then the edges of break lines, if there are some."""
    edges = [np.column_stack([line[:-1], line[1:]]) for line in mesh.lines]
    sizes = np.repeat([3, 2], [len(mesh.faces), sum(map(len, edges))])
    corners = np.concatenate([np.ravel(part) for part in (mesh.faces, *edges)]).astype(np.int64)
    columns = {}
    if edges:
        columns[BREAK_LINE] = np.repeat(np.arange(len(edges) + 1, dtype=np.int32), [len(mesh.faces), *map(len, edges)])
    kinds = np.where(sizes == 3, TRIANGLE, LINE).astype(np.uint8)
    return Cells(corners, np.cumsum(sizes), kinds, columns)


def point_columns(mesh: OutMesh) -> dict[str, AnyArray]:
    """Return what is known of each vertex beside its place, as numbers that VTK has.

    Raises
    ------
    ValueError
        If something is no number, or has more than two dimensions.
    """
    found = {}
    for name, values in mesh.attributes.items():
        kind = WIDER.get(values.dtype.str[1:], values.dtype.str[1:])
        if kind not in TYPES or values.ndim > 2:
            raise ValueError(f"attribute {name!r} of type {values.dtype} and shape {values.shape} is nothing for VTK")
        found["_".join(name.split())] = values.astype(kind)
    return found


def facts_of(mesh: OutMesh) -> dict[str, FloatArray | IntArray]:
    """Return what is known of the coordinates: the number of the reference system, the metres of a unit of x and y."""
    found: dict[str, FloatArray | IntArray] = {}
    if number := epsg_number(mesh.georeference):
        found["epsg"] = np.array([number], np.int32)
    if metres := metres_of(mesh.georeference.get("unit")):
        found["metres_per_unit"] = np.array([metres])
    return found
