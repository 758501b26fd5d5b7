"""DXF: the lines and polylines of a drawing, by ezdxf, and a surface with its break lines; models are not read.

A drawing has a height for everything, which is 0 where nobody thought of one: a line that has height 0 throughout is
read without heights.

A surface is written as the entities ``3DFACE`` of one layer: Civil 3D and other survey programs build a surface of
them with these very edges, and GDAL, QGIS and FreeCAD open them, too. Break lines are 3D polylines of another layer.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, printable, reason_of, warn_of
from meshsimp_pymoo.formats.outmesh import OutMesh, metres_of
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray
    from meshsimp_pymoo.formats.source.lines import SourceLines

# ezdxf logs what it repairs; without a handler Python would print that to stderr. Users' own handlers still get it.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())

# What a byte of a drawing takes at most, as the library's objects.
FILE_BYTES = 60
# How far the chords that stand for an arc may be off it, as a share of the extent of its polyline.
SAGITTA = 1e-4
# The entities that are lines.
ENTITIES = ("LINE", "LWPOLYLINE", "POLYLINE")

# What is written: AutoCAD 2000's edition, the first that says units.
EDITION = "R2000"
SURFACE_LAYER, LINE_LAYER = "TIN", "BREAKLINES"
# $INSUNITS of units of so many metres; of others, degrees among them, a drawing has no units.
INSUNITS = {1.0: 6, 1000.0: 7, 0.3048: 2, 1200 / 3937: 21}
NO_UNITS = 0


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read LINE, LWPOLYLINE and POLYLINE of the model space, arcs in them as chords; blocks are not placed."""
    import ezdxf

    from meshsimp_pymoo.formats.source.lines import build_lines, spelled_name
    from meshsimp_pymoo.memory import check_free

    size = path.stat().st_size
    check_free(FILE_BYTES * size, f"{name}: its {size} bytes of drawing", "take a part of it")
    lines: list[FloatArray] = []
    names: list[str] = []
    others: Counter[str] = Counter()
    try:
        for entity in ezdxf.readfile(path).modelspace():
            kind = entity.dxftype()
            if kind not in ENTITIES or (kind == "POLYLINE" and not (entity.is_2d_polyline or entity.is_3d_polyline)):
                others["placed blocks" if kind == "INSERT" else f"entities {printable(kind)}"[:40]] += 1
                continue
            layer = entity.dxf.layer
            names.append(spelled_name(kind, f"#{entity.dxf.handle}", None if layer == "0" else f"layer {layer}"))
            lines.append(_vertices(entity))
    except (OSError, MemoryError):
        raise
    except Exception as error:  # a damaged file may break the reader anywhere
        raise ModelError(
            f"{name}: cannot be read as DXF ({reason_of(error)}); export the drawing again, as R2000 or later"
        ) from error
    is_flat = [len(line) > 0 and not line[:, 2].any() for line in lines]
    found = build_lines(
        name,
        [line[:, :2] if flat else line for line, flat in zip(lines, is_flat, strict=True)],
        names,
        others=others,
    )
    if any(is_flat):
        warn_of(
            f"{name}: {sum(is_flat)} of {len(lines)} lines have height 0 throughout and are taken without heights: "
            "they take the surface's"
        )
    return found


def _vertices(entity: Any) -> FloatArray:
    """Return the vertices (n, 3) of a line or polyline, closed ones ending where they begin."""
    import numpy as np
    from ezdxf.path import make_path

    outline = make_path(entity)
    if outline.has_curves:
        corners = np.array([tuple(corner) for corner in outline.control_vertices()])
        found = list(outline.flattening(SAGITTA * float(np.ptp(corners, axis=0).max())))
    else:
        found = list(outline.control_vertices())
    return np.array([tuple(corner) for corner in found], np.float64).reshape(-1, 3)


def _write(path: Path, mesh: OutMesh) -> None:
    """Write a drawing of faces and polylines.

    The library makes all but the faces: as its objects 200 000 of them take half a minute.
    """
    import io

    import ezdxf
    import numpy as np

    with _same_bytes():
        drawing = ezdxf.new(EDITION, units=INSUNITS.get(metres_of(mesh.georeference.get("unit")) or 0.0, NO_UNITS))
        drawing.layers.add(SURFACE_LAYER, color=3)
        space = drawing.modelspace()
        if mesh.lines:
            drawing.layers.add(LINE_LAYER, color=1)
        for line in mesh.lines:
            space.add_polyline3d(mesh.vertices[line].tolist(), dxfattribs={"layer": LINE_LAYER})
        low, high = mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()
        # what is seen first: all of it, wherever it is on Earth
        height, center = max(np.subtract(high, low)[:2].tolist()), np.add(low, high)[:2] / 2
        drawing.set_modelspace_vport(height or 1.0, center.tolist())
        space.reset_extents(low, high)
        # the library does not take over an extent that ends at 0, 0, 0
        drawing.header["$EXTMIN"], drawing.header["$EXTMAX"] = low, high
        handles = drawing.entitydb.handles
        first = int(str(handles), 16)
        handles.reset(f"{first + len(mesh.faces):X}")
        text = io.StringIO()
        drawing.write(text)
    head, opening, rest = text.getvalue().partition(_tag(2, "ENTITIES"))
    path.write_bytes((head + opening + _faces(mesh, first, space.layout_key) + rest).encode("utf-8"))


@contextmanager
def _same_bytes() -> Iterator[None]:
    """Let the library write dates and identifiers that never change."""
    from ezdxf import options

    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        options.write_fixed_meta_data_for_testing = before


def _faces(mesh: OutMesh, first: int, owner: str) -> str:
    """Return the faces as entities of a space, with handles from the first on; the fourth corner is the third."""
    corners = [
        "".join(_tag(10 * (axis + 1) + corner, repr(value)) for axis, value in enumerate(point))
        for corner in range(4)
        for point in mesh.vertices.tolist()
    ]
    n = len(mesh.vertices)
    head = _tag(0, "3DFACE") + _tag(5, "{:X}")
    body = _tag(330, owner) + _tag(100, "AcDbEntity") + _tag(8, SURFACE_LAYER) + _tag(100, "AcDbFace")
    return "".join(
        head.format(handle) + body + corners[a] + corners[n + b] + corners[2 * n + c] + corners[3 * n + c]
        for handle, (a, b, c) in enumerate(mesh.faces.tolist(), start=first)
    )


def _tag(code: int, value: str) -> str:
    """Return a value with its group code, as text has them."""
    return f"{code:>3}\n{value}\n"


register(
    Format(
        "dxf",
        (".dxf",),
        "DXF",
        extra="lines",
        write=_write,
        needs="ezdxf",
        read_lines=_read_lines,
        holds_lines=True,
    )
)
