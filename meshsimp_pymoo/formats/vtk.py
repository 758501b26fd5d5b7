"""VTK: an unstructured grid in the older, plain format of VTK, which more programs read; written only.

All attributes of vertices go along, break lines as cells of two corners. Arrays are binary and big-endian.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray

# What this format calls the numbers of its arrays.
TYPES = {
    "i1": "char", "u1": "unsigned_char", "i2": "short", "u2": "unsigned_short", "i4": "int", "u4": "unsigned_int",
    "f4": "float", "f8": "double",
}  # fmt: skip
# What it has instead of others: its integers of 64 bits are spelled in several ways, which not all readers know.
WIDER = {"i8": "f8", "u8": "f8"}


def _write(path: Path, mesh: OutMesh) -> None:
    import numpy as np

    from meshsimp_pymoo.formats.source.grids import cells_of, facts_of, point_columns

    cells = cells_of(mesh)
    starts = np.concatenate([[0], cells.ends[:-1]])
    lists = np.insert(cells.corners, starts, np.diff(cells.ends, prepend=0)).astype(np.int32)
    n, m, title = len(mesh.vertices), len(cells.kinds), " ".join(mesh.name.split())[:250]
    parts = [
        b"# vtk DataFile Version 3.0\n",
        title.encode("ascii", "replace") + b"\nBINARY\nDATASET UNSTRUCTURED_GRID\n",
        _fields(facts_of(mesh)),
        f"POINTS {n} double\n".encode() + _binary(np.asarray(mesh.vertices, np.float64)),
        f"CELLS {m} {len(lists)}\n".encode() + _binary(lists),
        f"CELL_TYPES {m}\n".encode() + _binary(cells.kinds.astype(np.int32)),
    ]
    for title, count, columns in (("POINT", n, point_columns(mesh)), ("CELL", m, cells.columns)):
        if columns:
            parts.append(f"{title}_DATA {count}\n".encode() + _fields(columns))
    path.write_bytes(b"".join(parts))


def _fields(columns: dict[str, AnyArray]) -> bytes:
    """Return arrays (n,) or (n, k) by name."""
    if not columns:
        return b""
    parts = [f"FIELD FieldData {len(columns)}\n".encode()]
    for name, given in columns.items():
        kind = given.dtype.str[1:]
        values = given.astype(WIDER.get(kind, kind))
        width = values.shape[1] if values.ndim == 2 else 1
        word = "".join(c if c.isascii() and c.isprintable() else "_" for c in name)
        parts.append(f"{word} {width} {len(values)} {TYPES[values.dtype.str[1:]]}\n".encode() + _binary(values))
    return b"".join(parts)


def _binary(values: AnyArray) -> bytes:
    return values.astype(values.dtype.newbyteorder(">")).tobytes() + b"\n"


register(Format("vtk", (".vtk",), "VTK", write=_write, keeps=None, holds_lines=True))
