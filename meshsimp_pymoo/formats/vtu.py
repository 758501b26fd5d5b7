"""VTU: an unstructured grid of VTK in XML, for ParaView, PyVista and finite elements; written only.

All attributes of vertices go along, break lines as cells of two corners. Arrays are binary (base64) and little-endian;
what is known of the coordinates are arrays of the whole: ``epsg`` and ``metres_per_unit``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray

# What the size in front of each array is.
HEADER = "UInt64"


def _write(path: Path, mesh: OutMesh) -> None:
    from xml.sax.saxutils import quoteattr

    import numpy as np

    from meshsimp_pymoo.formats.source.grids import MEANINGS, cells_of, facts_of, point_columns

    cells, columns = cells_of(mesh), point_columns(mesh)
    active = "".join(f" {meaning}={quoteattr(name)}" for name, meaning in MEANINGS.items() if name in columns)
    places = {"connectivity": cells.corners, "offsets": cells.ends, "types": cells.kinds}
    parts = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="{HEADER}">',
        "<UnstructuredGrid>",
        "<FieldData>",
        *(_array(name, values, f' NumberOfTuples="{len(values)}"') for name, values in facts_of(mesh).items()),
        "</FieldData>",
        f'<Piece NumberOfPoints="{len(mesh.vertices)}" NumberOfCells="{len(cells.kinds)}">',
        "<Points>",
        _array("Points", np.asarray(mesh.vertices, np.float64)),
        "</Points>",
        "<Cells>",
        *(_array(name, values) for name, values in places.items()),
        "</Cells>",
        f"<PointData{active}>",
        *(_array(name, values) for name, values in columns.items()),
        "</PointData>",
        "<CellData>",
        *(_array(name, values) for name, values in cells.columns.items()),
        "</CellData>",
        "</Piece>",
        "</UnstructuredGrid>",
        "</VTKFile>",
    ]
    path.write_bytes(("\n".join(parts) + "\n").encode("utf-8"))


def _array(name: str, values: AnyArray, more: str = "") -> str:
    """Return an array (n,) or (n, k) as an element."""
    from base64 import b64encode
    from xml.sax.saxutils import quoteattr

    from meshsimp_pymoo.formats.source.grids import TYPES

    content = values.astype(values.dtype.newbyteorder("<")).tobytes()
    size = len(content).to_bytes(8, "little")
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    return (
        f'<DataArray type="{TYPES[values.dtype.str[1:]]}" Name={quoteattr(name)}{width}{more} format="binary">'
        f"{b64encode(size + content).decode()}</DataArray>"
    )


register(Format("vtu", (".vtu",), "VTU", write=_write, keeps=None, holds_lines=True))
