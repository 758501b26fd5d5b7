"""OBJ: vertices with colours behind them, and faces; texture and material stay behind."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    import numpy.typing as npt

    from meshsimp_pymoo.formats.source import SourceMesh


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    """Read v and f lines alone: texture and normal indices would tear the surface along their seams."""
    import numpy as np

    from meshsimp_pymoo.formats.source import build_source
    from meshsimp_pymoo.formats.source.numbers import even_table, fans, parse_numbers, rgba_of, text_lines, whole
    from meshsimp_pymoo.formats.source.points import bare_cloud

    lines = text_lines(path)
    is_vertex = np.array([line.startswith(("v ", "v\t")) for line in lines])
    face_at = [i for i, line in enumerate(lines) if line.startswith(("f ", "f\t"))]
    if not is_vertex.any() and not face_at:
        raise ModelError(f"{name}: has no line 'v x y z', so it is not an OBJ mesh; check the suffix")
    table, width = even_table([lines[i][2:] for i in np.flatnonzero(is_vertex)], name, "vertex", 3)
    attributes: dict[str, npt.ArrayLike] = {}
    if width >= 6:  # x y z r g b [a]
        if (color := rgba_of(list(table[:, 3:7].T))) is not None:
            attributes["color"] = color
        else:
            warn_of(f"{name}: the numbers behind its vertices are no colours in 0..1 or 0..255 and stay behind")
    if not face_at:
        return bare_cloud(table[:, :3], attributes, name, options)
    corner_lines = [re.sub(r"/\S*", "", lines[i][2:]) for i in face_at]
    counts = np.array([len(line.split()) for line in corner_lines], dtype=np.int64)
    corners = whole(parse_numbers(" ".join(corner_lines), name), name, "the face index")
    if (corners == 0).any():
        raise ModelError(f"{name}: a face names vertex 0, but OBJ counts from 1; export the file again")
    if (corners < 0).any():  # -1 is the last vertex before the face's own line
        before = np.repeat(np.cumsum(is_vertex)[face_at], counts)
        corners = np.where(corners < 0, before + corners + 1, corners)
    return build_source(table[:, :3], fans(corners - 1, counts), attributes, name)


def _write(path: Path, mesh: OutMesh) -> None:
    from meshsimp_pymoo.formats.source.scenes import EXACT_DIGITS, export

    export(path, mesh, digits=EXACT_DIGITS, include_normals=False, header=None)


register(Format("obj", (".obj",), "OBJ", bare_points=True, read=_read, write=_write))
