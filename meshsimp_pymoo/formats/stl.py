"""STL: loose triangles in single precision, whose equal corners are one vertex again; text or binary."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray
    from meshsimp_pymoo.formats.source import SourceMesh


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    from meshsimp_pymoo.formats.source.scenes import read_scene

    _check(path, name)
    return read_scene(path, name, repeats="usual")  # it lists the corners of each face


def _check(path: Path, name: str) -> None:
    """Compare a binary STL's declared count with its size, and see that a text one is complete."""
    from meshsimp_pymoo.formats.source.numbers import without_mark

    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(84)
        if len(head) == 84:
            declared = struct.unpack("<I", head[80:])[0]
            if 84 + 50 * declared == size:
                return
        if without_mark(head).lstrip()[:5].lower() != b"solid":
            if len(head) < 84:
                raise ModelError(f"{name}: is not an STL file ({size} bytes); check the suffix")
            raise ModelError(
                f"{name}: declares {declared} triangles, so {84 + 50 * declared} bytes, but has {size}; "
                "the file is truncated or no STL, export it again"
            )
        text = head + stream.read()
    lower = text.lower()
    if b"endsolid" not in lower[-256:]:
        raise ModelError(f"{name}: its text does not end with 'endsolid'; the file is truncated, export it again")
    if lower.count(b"endloop") * 3 != len(re.findall(rb"\bvertex\s", lower)):
        raise ModelError(f"{name}: not every facet has three vertices; the file is damaged, export it again")


def _write(path: Path, mesh: OutMesh) -> None:
    from meshsimp_pymoo.formats.source.scenes import export

    export(path, mesh)


def _single(mesh: OutMesh) -> FloatArray:
    return mesh.vertices


register(Format("stl", (".stl",), "STL", read=_read, write=_write, single=_single))
