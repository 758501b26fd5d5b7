"""OBJ: vertices with colours behind them, faces, and one material where each vertex has one place on its image."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.material import LIBRARY, Material, put_beside
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    import numpy.typing as npt

    from meshsimp_pymoo.arrays import FloatArray, IntArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.lines import SourceLines

# Elements that are no part of a surface of triangles, and what they are called.
LEFT_BEHIND = {"l": "lines", "p": "points", "curv": "curves", "curv2": "curves", "surf": "free-form surfaces"}
# One corner of a face: the vertex, and what stands behind its first slash.
CORNER = re.compile(r"[^\s/]+(?:/([^\s/]*))?\S*")


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    """Read vertices by the first index of each corner: the others would tear the surface along their seams."""
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
    uv = _uv(lines, face_at, corners - 1, counts, name)
    if uv is not None and len(uv) <= len(table):
        attributes["uv"] = np.pad(uv, ((0, len(table) - len(uv)), (0, 0)))
    others = [LEFT_BEHIND[key] for line in lines if (key := line.partition(" ")[0]) in LEFT_BEHIND]
    for what in sorted(set(others)):
        way = "; --break-lines takes them" * (what == "lines")
        warn_of(f"{name}: its {others.count(what)} {what} are no faces and stay behind{way}")
    material = _material(path, lines, face_at, name, placed="uv" in attributes)
    return build_source(table[:, :3], fans(corners - 1, counts), attributes, name, material=material)


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read the elements ``l``: polylines through vertices of the file, by the first index of each."""
    import numpy as np

    from meshsimp_pymoo.formats.source.lines import build_lines, spelled_name
    from meshsimp_pymoo.formats.source.numbers import even_table, parse_numbers, text_lines, whole

    lines = text_lines(path)
    is_vertex = np.array([line.startswith(("v ", "v\t")) for line in lines])
    table, _ = even_table([lines[i][2:] for i in np.flatnonzero(is_vertex)], name, "vertex", 3)
    before = np.cumsum(is_vertex)
    line_at = [i for i, line in enumerate(lines) if line.startswith(("l ", "l\t"))]
    if not line_at:
        raise ModelError(f"{name}: has no line 'l' of an OBJ, which lists the vertices of a polyline; export its lines")
    found = []
    for number, i in enumerate(line_at, start=1):
        index = whole(parse_numbers(re.sub(r"/\S*", "", lines[i][2:]), name), name, "the index of a line")
        row = np.where(index < 0, before[i] + index, index - 1)  # -1 is the last vertex before it; 0 is none
        wrong = (row < 0) | (row >= len(table))
        if wrong.any():
            raise ModelError(
                f"{name}: its line {number} names the vertex {index[np.argmax(wrong)]}, which does not exist (of "
                f"{len(table)}, from 1); the file is damaged, export it again"
            )
        found.append(table[row, :3])
    return build_lines(name, found, [spelled_name("line", number) for number in range(1, len(found) + 1)])


def _uv(lines: list[str], face_at: list[int], corners: IntArray, counts: IntArray, name: str) -> FloatArray | None:
    """Return where on the image each vertex lies, if each has one place there; ``corners`` are the faces' vertices."""
    import numpy as np

    from meshsimp_pymoo.formats.source.numbers import even_table, parse_numbers, whole
    from meshsimp_pymoo.formats.source.texture import uv_of_corners

    is_uv = np.array([line.startswith(("vt ", "vt\t")) for line in lines])
    if not is_uv.any():
        return None
    table = even_table([lines[i][3:] for i in np.flatnonzero(is_uv)], name, "texture coordinate", 1)[0]
    table = np.pad(table, ((0, 0), (0, 1)))[:, :2]  # one number is a place on a line: the second is 0
    named = CORNER.findall(" ".join(lines[i][2:] for i in face_at))
    has = np.array([bool(index) for index in named])
    if not has.any() or len(has) != len(corners):
        warn_of(f"{name}: its {len(table)} texture coordinates belong to no corner of a face and stay behind")
        return None
    index = whole(parse_numbers(" ".join(filter(None, named)), name), name, "the texture coordinate's index")
    before = np.repeat(np.cumsum(is_uv)[face_at], counts)[has]
    row = np.where(index < 0, before + index, index - 1)
    wrong = (row < 0) | (row >= len(table))
    if wrong.any():
        warn_of(
            f"{name}: {wrong.sum()} corners of faces name texture coordinates that do not exist (first: "
            f"{index[np.argmax(wrong)]}, of {len(table)}); its texture stays behind"
        )
        return None
    uv = np.full((len(corners), 2), np.nan)
    uv[has] = table[row]
    return uv_of_corners(corners, uv, name)


def _material(path: Path, lines: list[str], face_at: list[int], name: str, *, placed: bool) -> Material | None:
    """Return the material of all faces, if they have but one; its image only if it is ``placed`` on the vertices."""
    import numpy as np

    use_at = [i for i, line in enumerate(lines) if line.startswith(("usemtl ", "usemtl\t"))]
    last = np.unique(np.searchsorted(use_at, face_at))  # how many such lines stand before each face
    used = {lines[use_at[k - 1]][7:].strip() if k else "" for k in last.tolist()}
    libraries = [line[7:].strip() for line in lines if line.startswith(("mtllib ", "mtllib\t"))]
    if not libraries or used == {""}:
        return None
    if len(used) > 1:
        warn_of(f"{name}: its faces are of {len(used)} materials, of which a mesh here has one; they stay behind")
        return None
    (wanted,) = used
    found: dict[str, str] = {}
    for library in libraries:
        found |= _statements(path, library, wanted, name)
    return _material_of(path, wanted, found, name, placed=placed) if found else None


def _statements(path: Path, library: str, wanted: str, name: str) -> dict[str, str]:
    """Return what a library says of a material, by the first word of each line."""
    from meshsimp_pymoo.formats.source.texture import file_beside

    content = file_beside(path, library, name, "material library")
    found: dict[str, str] = {}
    current = ""
    for line in (content or b"").decode("utf-8", errors="replace").splitlines():
        key, _, value = line.partition("#")[0].strip().replace("\t", " ").partition(" ")
        if key == "newmtl":
            current = value.strip()
        elif key and current == wanted:
            found[key.lower()] = value.strip()
    return found


def _material_of(path: Path, wanted: str, found: dict[str, str], name: str, *, placed: bool) -> Material:
    from meshsimp_pymoo.formats.source.texture import checked_image, file_beside

    def number(text: str, other: float) -> float:
        try:
            value = float(text)
        except ValueError:
            return other
        return min(max(value, 0.0), 1.0) if value == value else other

    red, green, blue, *_ = [number(text, 1.0) for text in found.get("kd", "").split()] + 3 * [1.0]
    opacity = number(found.get("d", ""), 1.0 - number(found.get("tr", ""), 0.0))
    further = [key for key in found if key.startswith(("map_", "bump", "disp", "decal", "refl")) and key != "map_kd"]
    if further and placed:
        warn_of(f"{name}: {len(further)} further images of its material stay behind ({', '.join(further)[:80]})")
    image, named = b"", found.get("map_kd", "")
    if not placed:
        pass
    elif named.startswith("-"):
        warn_of(f"{name}: its image {named[:80]!r} is placed by options and stays behind")
    elif named:
        image = checked_image(file_beside(path, named, name, "image"), name, named)
    return Material(wanted, (red, green, blue, opacity), image)


def _comments(georeference: Mapping[str, Any]) -> list[str]:
    """Return what is known of the coordinates as lines that programs pass over: the system, the unit."""
    from meshsimp_pymoo.formats.source.metric import spelled_system

    said = {"crs": spelled_system(georeference), "unit": georeference.get("unit")}
    return [f"# {name}: {' '.join(str(fact).split())}" for name, fact in said.items() if fact]


def _write(path: Path, mesh: OutMesh) -> None:
    """Write positions and texture coordinates so that they read back equal, colours as fractions of 1."""
    import numpy as np

    heading, rows = _comments(mesh.georeference), np.asarray(mesh.vertices, np.float64)
    if mesh.material is not None:
        library = _put_material(path.parent, mesh.material)
        heading += [f"mtllib {library}", f"usemtl {_word(mesh.material.name)}"]
    if (color := mesh.attributes.get("color")) is not None:
        rows = np.column_stack([rows, color[:, :3] / 255.0])
    columns = [("v", rows.tolist())] + ([] if mesh.uv is None else [("vt", mesh.uv.astype(np.float64).tolist())])
    lines = [f"{key} {' '.join(map(repr, row))}" for key, table in columns for row in table]
    corner = "{0}" if mesh.uv is None else "{0}/{0}"
    named = [corner.format(k) for k in range(1, len(rows) + 1)]
    lines += [f"f {named[a]} {named[b]} {named[c]}" for a, b, c in np.asarray(mesh.faces).tolist()]
    lines += ["l " + " ".join(str(k + 1) for k in line.tolist()) for line in mesh.lines]
    path.write_bytes(("\n".join(heading + lines) + "\n").encode("utf-8"))


def _put_material(folder: Path, material: Material) -> str:
    """Write a library of one material, and its image, into a folder; return its name."""
    *color, opacity = (f"{value:.6g}" for value in material.color)
    lines = [f"newmtl {_word(material.name)}", f"Kd {' '.join(color)}", f"d {opacity}"]
    lines += [f"map_Kd {material.put_image(folder)}"] if material.suffix else []
    return put_beside(folder, LIBRARY, ("\n".join(lines) + "\n").encode("utf-8"))


def _word(text: str) -> str:
    """Return a text as the one word that a line of an OBJ may name, which is no comment."""
    return "_".join(text.replace("#", "_").split()) or "material"


register(
    Format(
        "obj",
        (".obj",),
        "OBJ",
        bare_points=True,
        read=_read,
        write=_write,
        keeps=("color", "uv"),
        read_lines=_read_lines,
        holds_lines=True,
    )
)
