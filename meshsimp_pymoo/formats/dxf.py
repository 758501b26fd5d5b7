"""DXF: the lines and polylines of a drawing, by ezdxf; no models.

A drawing has a height for everything, which is 0 where nobody thought of one: a line that has height 0 throughout is
read without heights.
"""

from __future__ import annotations

import logging
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, printable, reason_of, warn_of
from meshsimp_pymoo.formats.table import LINES, Format, register

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


register(Format("dxf", (".dxf",), "DXF", sort=LINES, extra="lines", read_lines=_read_lines))
