"""PLY: rows that users refer to, double precision, colours and any other per-vertex data; text or binary."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.lines import SourceLines
    from meshsimp_pymoo.formats.source.rows import PlyElement

# A header lists properties, one line each; a real one takes a few hundred bytes, scanners' comments a few thousand.
HEADER_LIMIT = 1 << 20

TYPES_READ = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "double": "f8", "float32": "f4", "float64": "f8",
}  # fmt: skip
BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
# Where a vertex lies on the image; the first pair is written.
UV_NAMES = (("s", "t"), ("texture_u", "texture_v"))
# PLY has no 64-bit integers, no half floats and no booleans: such attributes are written in the next type that holds
# them.
TYPES_WRITTEN = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort",
    "i4": "int", "u4": "uint", "f4": "float", "f8": "double",
}  # fmt: skip
CHANNELS = ("red", "green", "blue", "alpha")
# Lines are rows of this element, which join two vertices each.
EDGE, EDGE_ENDS = "edge", ("vertex1", "vertex2")
WIDER = {"b1": "u1", "f2": "f4", "i8": "f8", "u8": "f8"}


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    """Read vertices and what connects them: polygons, triangle strips, or the cells of a range scan.

    Of a range scan (``range_grid``) each cell of four neighbours becomes two triangles along its shorter diagonal, one
    of three one triangle, as usual for such scans; none is left out for its length, since seen from the scanner steps
    in depth are steep, but hide nothing.
    """
    import numpy as np

    from meshsimp_pymoo.formats.source import build_source
    from meshsimp_pymoo.formats.source.numbers import without_mark
    from meshsimp_pymoo.formats.source.points import bare_cloud

    data = without_mark(path.read_bytes())
    elements, order, start = _header(data, name)
    columns, points = _columns(data, elements, order, start, SURFACES, name)
    vertex = columns["vertex"]
    attributes = _attributes(vertex, name)
    _say_left_behind(elements, columns.get("face", {}), name)
    where = _georeference(data[:start])
    found = [make(columns[kind], points, data[:start], name) for kind, make in SURFACES.items() if kind in columns]
    faces = np.concatenate([np.empty((0, 3), np.int64), *found])
    if not len(faces):
        return bare_cloud(points, attributes, name, options, georeference=where)
    if (uv := _uv_of_faces(columns.get("face", {}), len(points), name)) is not None:
        attributes.setdefault("uv", uv)
    material = _material(path, data[:start], attributes, name)
    return build_source(points, faces, attributes, name, georeference=where, material=material)


def _read_lines(path: Path, name: str) -> SourceLines:
    """Read the element ``edge``, whose rows join ``vertex1`` and ``vertex2``, as chains."""
    import numpy as np

    from meshsimp_pymoo.formats.source.lines import build_lines, spelled_name
    from meshsimp_pymoo.formats.source.numbers import without_mark
    from meshsimp_pymoo.plane.chains import chains

    data = without_mark(path.read_bytes())
    elements, order, start = _header(data, name)
    columns, points = _columns(data, elements, order, start, (EDGE,), name)
    edge = columns.get(EDGE, {})
    ends = [edge[key] for key in EDGE_ENDS if isinstance(edge.get(key), np.ndarray) and edge[key].ndim == 1]
    if len(ends) < len(EDGE_ENDS):
        others = sorted(element.name for element in elements)
        raise ModelError(
            f"{name}: has no element {EDGE!r} with {' and '.join(EDGE_ENDS)} (but {others}); export its edges, or give "
            "the lines in another file"
        )
    edges = np.column_stack([_integers(values, name) for values in ends])
    wrong = ((edges < 0) | (edges >= len(points))).any(axis=1)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise ModelError(
            f"{name}: {wrong.sum()} of {len(edges)} edges name vertices that do not exist (first: edge {first}, "
            f"{tuple(edges[first].tolist())}, of {len(points)} vertices); the file is damaged, export it again"
        )
    lines = [points[chain] for chain in chains(edges)]
    names = [spelled_name("line", number) for number in range(1, len(lines) + 1)]
    return build_lines(name, lines, names, _georeference(data[:start]))


def _columns(
    data: bytes, elements: list[PlyElement], order: str, start: int, wanted: Container[str], name: str
) -> tuple[dict[str, dict[str, Any]], FloatArray]:
    """Return the columns of the elements up to the last one that is wanted, and the vertices (V, 3)."""
    import numpy as np

    from meshsimp_pymoo.formats.source.rows import binary_columns, text_columns

    named = [element.name for element in elements]
    if "vertex" not in named:
        raise ModelError(f"{name}: declares no element 'vertex' (but {sorted(named)}); export it as a triangle mesh")
    last = max(i for i, key in enumerate(named) if key == "vertex" or key in wanted)
    columns = (text_columns if order == "" else binary_columns)(data, start, elements[: last + 1], name)
    vertex = columns["vertex"]
    scalars = {key for key, value in vertex.items() if isinstance(value, np.ndarray) and value.ndim == 1}
    if missing := sorted(set("xyz") - scalars):
        raise ModelError(f"{name}: its vertices have no {', '.join(missing)} (but {sorted(vertex)}); export it again")
    return columns, np.column_stack([vertex[axis].astype(np.float64) for axis in "xyz"])


def _say_left_behind(elements: list[PlyElement], face: dict[str, Any], name: str) -> None:
    """Say what of a file is no part of a surface as it is read here."""
    others = [
        f"{element.count} of {element.name!r}"
        for element in elements
        if element.count and element.name not in ("vertex", *SURFACES)
    ]
    known = (_vertex_list(face), "texcoord", "texnumber")
    count = next((element.count for element in elements if element.name == "face"), 0)
    others += [f"{key!r} of {count} faces" for key in face if count and key not in known]
    if others:
        way = "; --break-lines takes edges" * any(element.name == EDGE and element.count for element in elements)
        warn_of(f"{name}: {', '.join(others)[:200]} are not read and stay behind{way}")


def _uv_of_faces(face: dict[str, Any], count: int, name: str) -> FloatArray | None:
    """Return where on the image each vertex lies, of a file that says it for the corners of its faces."""
    import numpy as np

    from meshsimp_pymoo.formats.source.rows import Ragged
    from meshsimp_pymoo.formats.source.texture import uv_of_corners

    def joined(key: str) -> tuple[AnyArray, IntArray]:
        column = face[key]
        if isinstance(column, Ragged):
            return column.values, column.counts
        return column.reshape(-1), np.full(len(column), column[:1].size)

    key = _vertex_list(face)
    if not key or "texcoord" not in face:
        return None
    (corners, counts), (uv, numbers) = joined(key), joined("texcoord")
    if len(uv) == 0:
        return None
    images = np.unique(face["texnumber"]) if isinstance(face.get("texnumber"), np.ndarray) else ()
    if (numbers != 2 * counts).any() or len(images) > 1:
        several = f"are of {len(images)} images" if len(images) > 1 else "are not two a corner"
        warn_of(f"{name}: the texture coordinates of its faces {several} and stay behind")
        return None
    vertex = _integers(corners, name)
    if vertex.min(initial=0) < 0 or vertex.max(initial=-1) >= count:
        return None  # whose faces are refused
    found = uv_of_corners(vertex, uv.reshape(-1, 2).astype(np.float64), name)
    return None if found is None else np.pad(found, ((0, count - len(found)), (0, 0)))


def _material(path: Path, header: bytes, attributes: Mapping[str, AnyArray], name: str) -> Material | None:
    """Return the image that a comment names, if there is one and vertices lie on it."""
    from meshsimp_pymoo.formats.source.texture import checked_image, file_beside

    named = [
        line.decode("utf-8", errors="replace").strip()
        for line in re.findall(rb"[\r\n]comment[ \t]+TextureFile[ \t]+([^\r\n]+)", header)
    ]
    if not named or "uv" not in attributes:
        return None
    if len(named) > 1:
        warn_of(f"{name}: names {len(named)} images, of which a mesh here has one; they stay behind")
        return None
    image = checked_image(file_beside(path, named[0], name, "image"), name, named[0])
    return Material(image=image) if image else None


def _header(data: bytes, name: str) -> tuple[list[PlyElement], str, int]:
    """Return the elements, the byte order ("" for ascii) and where the body starts."""
    import numpy as np

    from meshsimp_pymoo.formats.source.numbers import glimpse
    from meshsimp_pymoo.formats.source.rows import PlyElement, PlyProperty

    if re.match(rb"ply[ \t]*\r?\n|ply[ \t]*\r", data) is None:
        raise ModelError(
            f"{name}: is not a PLY file (it begins with {glimpse(data)}, not with 'ply'); check the suffix"
        )
    # a file with Unix lines has one byte after end_header, and the next may well look like a line feed
    newline = rb"\r\n" if b"\r\n" in data[:8] else rb"[\r\n]"
    end = re.compile(rb"(?<=[\r\n])end_header[ \t]*(?:" + newline + rb"|\Z)").search(data, 0, HEADER_LIMIT)
    if end is None:
        raise ModelError(f"{name}: its header has no line 'end_header'; the file is truncated, export it again")
    order: str | None = None
    elements: list[PlyElement] = []
    unknown: list[str] = []
    for line in data[: end.start()].decode("utf-8", errors="replace").splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                order = BYTE_ORDERS[words[1]]
            elif words[0] == "element":
                elements.append(PlyElement(words[1], int(words[2]), []))
                if elements[-1].count < 0:
                    raise ValueError
            elif words[0] == "property" and words[1] == "list":
                kinds = [np.dtype((order or "<") + TYPES_READ[word]) for word in words[2:4]]
                if kinds[0].kind == "f":
                    raise ValueError
                elements[-1].properties.append(PlyProperty(words[4], kinds[1], kinds[0]))
            elif words[0] == "property":
                kind = np.dtype((order or "<") + TYPES_READ[words[1]])
                elements[-1].properties.append(PlyProperty(words[2], kind, None))
            elif elements:
                raise ValueError
            else:  # of what follows it says nothing
                unknown.append(line)
        except (KeyError, IndexError, ValueError):
            raise ModelError(f"{name}: cannot read the header line {line[:80]!r}; export the file again") from None
    if order is None:
        raise ModelError(f"{name}: its header has no line 'format'; export the file again")
    if unknown:
        first = f"{unknown[0][:80]!r}"
        warn_of(f"{name}: lines of its header that mean nothing were left out: {len(unknown)} (first: {first})")
    if len({element.name for element in elements}) < len(elements):
        raise ModelError(f"{name}: declares an element twice; export the file again")
    for element in elements:
        names = [item.name for item in element.properties]
        if len(set(names)) < len(names):
            raise ModelError(f"{name}: declares a property of {element.name!r} twice; export the file again")
        if not names and element.count:
            raise ModelError(
                f"{name}: declares {element.count} of {element.name!r} without properties; export it again"
            )
    _check_size(elements, order, len(data) - end.end(), name)
    return elements, order, end.end()


def _check_size(elements: list[PlyElement], order: str, size: int, name: str) -> None:
    """Refuse a body smaller than what its header must at least take, before anything is allocated."""
    needed = 0
    for element in elements:
        if order == "":  # a digit and a separator per number; the last one may end the file
            row = 2 * len(element.properties)
        else:
            row = sum((item.count_dtype or item.dtype).itemsize for item in element.properties)
        needed += element.count * row
    if size < needed - (order == ""):
        counts = ", ".join(f"{element.count} of {element.name!r}" for element in elements)
        raise ModelError(
            f"{name}: truncated: its header declares {counts}, at least {needed} bytes, but {size} follow; "
            "copy or export the file again"
        )


def _corners(columns: dict[str, Any], name: str) -> tuple[IntArray, IntArray] | None:
    """Return the vertices that the rows of an element name, one row after the other, and their number in each."""
    import numpy as np

    from meshsimp_pymoo.formats.source.rows import Ragged

    lists = _lists(columns)
    key = _vertex_list(columns)
    if not key:
        if columns and len(next(iter(columns.values()), ())) and not lists:
            raise ModelError(f"{name}: its faces have no list of vertices (but {sorted(columns)}); export it again")
        if len(lists) > 1:
            raise ModelError(
                f"{name}: none of the face lists {sorted(lists)} is called vertex_indices; export it again"
            )
        return None
    column = columns[key]
    if isinstance(column, Ragged):
        return _integers(column.values, name), column.counts
    return _integers(column.ravel(), name), np.full(len(column), column.shape[1])


def _polygons(columns: dict[str, Any], points: FloatArray, header: bytes, name: str) -> IntArray:
    import numpy as np

    from meshsimp_pymoo.formats.source.numbers import fans

    corners = _corners(columns, name)
    return np.empty((0, 3), np.int64) if corners is None else fans(*corners)


def _strips(columns: dict[str, Any], points: FloatArray, header: bytes, name: str) -> IntArray:
    """Cut triangle strips, which -1 ends, into triangles of one winding; corners named twice only join strips."""
    import numpy as np

    corners = _corners(columns, name)
    if corners is None:
        return np.empty((0, 3), np.int64)
    values, counts = corners
    values = np.insert(values, np.cumsum(counts), -1)  # a row ends a strip, too
    at = np.arange(len(values))
    start = np.maximum.accumulate(np.where(values == -1, at + 1, 0))
    i = at[:-2]
    triangles = np.column_stack([values[:-2], values[1:-1], values[2:]])
    odd = (i - start[:-2]) % 2 == 1
    triangles[odd] = triangles[odd][:, [1, 0, 2]]
    joins = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    return triangles[~joins & ~(triangles == -1).any(axis=1)]


def _range_cells(columns: dict[str, Any], points: FloatArray, header: bytes, name: str) -> IntArray:
    """Triangulate a range scan: rows of cells that hold one vertex or none."""
    import numpy as np

    corners = _corners(columns, name)
    if corners is None:
        return np.empty((0, 3), np.int64)
    values, counts = corners
    width, height = (
        int(found[1]) if (found := re.search(rb"obj_info[ \t]+" + key + rb"[ \t]+(\d{1,9})\b", header)) else 0
        for key in (b"num_cols", b"num_rows")
    )
    if width * height != len(counts):
        raise ModelError(
            f"{name}: its range grid has {len(counts)} cells, but its header says num_cols {width} and num_rows "
            f"{height}; export it again"
        )
    if counts.max(initial=0) > 1 or (len(values) and not 0 <= values.min() <= values.max() < len(points)):
        raise ModelError(
            f"{name}: a cell of its range grid names more than one vertex, or one that does not exist (of "
            f"{len(points)}); the file is damaged, export it again"
        )
    cell = np.full(len(counts), -1, np.int64)
    cell[counts == 1] = values
    grid = cell.reshape(height, width)
    around = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    n_corners = (around >= 0).sum(axis=1)
    whole, three = around[n_corners == 4], around[n_corners == 3]
    a, b, c, d = points[whole].transpose(1, 0, 2)
    turned = ((b - d) ** 2).sum(axis=1) < ((a - c) ** 2).sum(axis=1)
    whole[turned] = np.roll(whole[turned], -1, axis=1)
    return np.concatenate([whole[:, [0, 1, 2]], whole[:, [0, 2, 3]], three[three >= 0].reshape(-1, 3)])


def _lists(columns: dict[str, Any]) -> list[str]:
    from meshsimp_pymoo.formats.source.rows import Ragged

    return [key for key, value in columns.items() if isinstance(value, Ragged) or value.ndim == 2]


def _vertex_list(columns: dict[str, Any]) -> str:
    """Return which of the faces' properties lists their vertices; empty: none, or nobody knows."""
    lists = _lists(columns)
    usual = [key for key in lists if key in ("vertex_indices", "vertex_index")]
    return (usual or (lists if len(lists) == 1 else [""]))[0]


def _integers(values: AnyArray, name: str) -> IntArray:
    from meshsimp_pymoo.formats.source.numbers import whole

    if values.dtype.kind == "f":
        return whole(values.astype("float64"), name, "the face index")
    return values.astype("int64")


def _attributes(vertex: dict[str, Any], name: str) -> dict[str, AnyArray]:
    """Everything a vertex has beside its position and normal, colours as one array."""
    import numpy as np

    from meshsimp_pymoo.formats.source.numbers import with_color
    from meshsimp_pymoo.formats.source.rows import Ragged

    attributes: dict[str, AnyArray] = {}
    for key, value in vertex.items():
        if isinstance(value, Ragged):
            warn_of(f"{name}: the per-vertex lists {key!r} differ in length and stay behind")
        elif key not in ("x", "y", "z", "nx", "ny", "nz"):
            attributes[key] = value
    for names in UV_NAMES:
        pair = [attributes[key] for key in names if key in attributes]
        if len(pair) == 2 and "uv" not in attributes and all(x.ndim == 1 and x.dtype.kind == "f" for x in pair):
            rest = {key: value for key, value in attributes.items() if key not in names}
            attributes = {"uv": np.column_stack(pair)} | rest
    return with_color(attributes)


def _write(path: Path, mesh: OutMesh) -> None:
    """Write a binary PLY with double coordinates; trimesh's own writer stores single precision."""
    import numpy as np

    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    columns: list[tuple[str, AnyArray]] = [(axis, vertices[:, k]) for k, axis in enumerate("xyz")]
    for name, values in mesh.attributes.items():
        kind = values.dtype.str[1:]
        kind = WIDER.get(kind, kind)
        if kind not in TYPES_WRITTEN or values.ndim > 2 or len(values) != len(vertices):
            raise ValueError(
                f"attribute {name!r} of type {values.dtype} and shape {values.shape} does not fit into a PLY"
            )
        table = values.astype(kind).reshape(len(values), -1)
        for k in range(table.shape[1]):
            spelled = CHANNELS[k] if name == "color" else name if values.ndim == 1 else f"{name}_{k}"
            if name == "uv" and mesh.uv is not None:
                spelled = UV_NAMES[0][k]
            columns.append((spelled, table[:, k]))
    names = ["_".join(name.split()) for name, _ in columns]
    record = np.empty(len(vertices), dtype=[(f"c{k}", f"<{c.dtype.str[1:]}") for k, (_, c) in enumerate(columns)])
    for k, (_, column) in enumerate(columns):
        record[f"c{k}"] = column
    triangles = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("index", "<i4", (3,))])
    triangles["count"], triangles["index"] = 3, mesh.faces
    properties = [
        f"property {TYPES_WRITTEN[c.dtype.str[1:]]} {name}" for name, (_, c) in zip(names, columns, strict=True)
    ]
    ends = [np.sort(np.column_stack([line[:-1], line[1:]]), axis=1) for line in mesh.lines]
    edges = np.unique(np.concatenate(ends), axis=0).astype("<i4") if ends else np.empty((0, 2), "<i4")
    edge_header = [f"element {EDGE} {len(edges)}", *(f"property int {end}" for end in EDGE_ENDS)] if len(edges) else []
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *_crs_comments(mesh.georeference),
        *_image_comments(path.parent, mesh),
        f"element vertex {len(vertices)}",
        *properties,
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        *edge_header,
        "end_header\n",
    ]
    path.write_bytes("\n".join(header).encode("utf-8") + record.tobytes() + triangles.tobytes() + edges.tobytes())


def _georeference(header: bytes) -> dict[str, Any]:
    """Return the coordinate reference system that a comment of a header names: an EPSG number, or WKT."""
    from meshsimp_pymoo.formats.source.metric import stated_system

    found = re.search(rb"^comment crs:?[ \t]+(.+?)\s*$", header, re.MULTILINE | re.IGNORECASE)
    return stated_system(found[1].decode("utf-8", errors="replace")) if found else {}


def _image_comments(folder: Path, mesh: OutMesh) -> list[str]:
    """Put a mesh's image into a folder and return the line of a PLY header that names it, if there is one."""
    if mesh.material is None or not mesh.has_image:
        return []
    return [f"comment TextureFile {mesh.material.put_image(folder)}"]


def _crs_comments(georeference: Mapping[str, Any]) -> list[str]:
    """Return the line of a PLY header that says the coordinate reference system, as QGIS reads it, if it is known."""
    from meshsimp_pymoo.formats.source.metric import spelled_system

    system = spelled_system(georeference)
    return [f"comment crs: {system}"] if system else []


# What connects vertices, and the triangles that it means.
SURFACES = {"face": _polygons, "tristrips": _strips, "range_grid": _range_cells}

register(
    Format(
        "ply",
        (".ply",),
        "PLY",
        bare_points=True,
        read=_read,
        write=_write,
        keeps=None,
        read_lines=_read_lines,
        holds_lines=True,
    )
)
