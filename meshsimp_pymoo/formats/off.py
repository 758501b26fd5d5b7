"""OFF: counts, vertices with colours if the keyword says so, and faces, one a line."""

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

# The word that a file may begin with, and says what a vertex has beside its place; the counts may follow at once.
KEYWORD = re.compile(
    r"(?P<texture>ST)?(?P<colors>C)?(?P<normals>N)?(?P<other>4?n?)OFF(?=[\s\d]|$)\s*|(?=\d+\s+\d+(\s+\d+)?\s*$)"
)


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    import numpy as np

    from meshsimp_pymoo.formats.source import build_source
    from meshsimp_pymoo.formats.source.numbers import even_table, fans, parse_numbers, rgba_of, text_lines, whole
    from meshsimp_pymoo.formats.source.points import bare_cloud

    lines = [line for line in text_lines(path) if line]
    begin = lines[0] if lines else ""
    keyword = KEYWORD.match(begin)
    if keyword is None:
        raise ModelError(
            f"{name}: is not an OFF file (it begins with {begin[:24]!r}, not with 'OFF'); check the suffix"
        )
    if keyword["other"]:
        raise ModelError(
            f"{name}: its vertices have another number of coordinates than 3 (it begins with {keyword[0].strip()!r}); "
            "save it as plain OFF"
        )
    rest = begin[keyword.end() :]
    if "BINARY" in rest.upper():
        raise ModelError(f"{name}: is a binary OFF, which is not read; save it as text or as PLY")
    lines = ([rest] if rest else []) + lines[1:]
    if not lines:
        raise ModelError(f"{name}: ends before its counts; the file is truncated, export it again")
    header = whole(parse_numbers(lines[0], name), name, "the count")
    if len(header) < 2 or header.min() < 0:
        raise ModelError(f"{name}: cannot read the counts {lines[0][:60]!r}; export the file again")
    n_vertices, n_faces = int(header[0]), int(header[1])
    if len(lines) - 1 < n_vertices + n_faces:
        raise ModelError(
            f"{name}: truncated: declares {n_vertices} vertices and {n_faces} faces, but {len(lines) - 1} "
            "lines follow; copy or export the file again"
        )
    table, width = even_table(lines[1 : 1 + n_vertices], name, "vertex", 3)
    attributes: dict[str, npt.ArrayLike] = {}
    named = 3 + 3 * bool(keyword["normals"]) + 4 * bool(keyword["colors"]) + 2 * bool(keyword["texture"])
    if width > named:
        warn_of(f"{name}: its vertices have {width} numbers, its keyword names {named} of them; the others stay behind")
    if keyword["texture"]:
        warn_of(f"{name}: its texture coordinates stay behind")
    first_color = 6 if keyword["normals"] else 3
    last_color = min(first_color + 4, width - (2 if keyword["texture"] else 0))
    if keyword["colors"] and last_color - first_color >= 3:
        if (color := rgba_of(list(table[:, first_color:last_color].T))) is not None:
            attributes["color"] = color
        else:
            warn_of(f"{name}: its vertex colours are neither in 0..1 nor in 0..255 and stay behind")
    if n_faces == 0:
        return bare_cloud(table[:, :3], attributes, name, options)
    face_lines = lines[1 + n_vertices : 1 + n_vertices + n_faces]
    widths = np.array([len(line.split()) for line in face_lines], dtype=np.int64)
    values = parse_numbers(" ".join(face_lines), name)
    starts = np.cumsum(widths) - widths
    counts = whole(values[starts], name, "the number of corners")
    if (counts < 0).any() or (counts + 1 > widths).any():
        short = face_lines[int(np.argmax((counts < 0) | (counts + 1 > widths)))]
        raise ModelError(
            f"{name}: the face line {short[:60]!r} has too few indices; the file is damaged, export it again"
        )
    first = np.cumsum(counts) - counts
    corners = values[np.arange(counts.sum()) + np.repeat(starts + 1 - first, counts)]
    faces = fans(whole(corners, name, "the face index"), counts)
    return build_source(table[:, :3], faces, attributes, name)


def _write(path: Path, mesh: OutMesh) -> None:
    """Write positions so that they read back equal; trimesh's own writer rounds what is next to 0."""
    import numpy as np

    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(mesh.vertices, np.float64).tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in np.asarray(mesh.faces).tolist()]
    head = f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n"
    path.write_bytes((head + "\n".join(rows) + "\n").encode("ascii"))


register(Format("off", (".off",), "OFF", bare_points=True, read=_read, write=_write))
