"""PLY: rows that users refer to, double precision, colours and any other per-vertex data; text or binary."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, IntArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.rows import PlyElement

# A header lists properties, one line each; a real one takes a few hundred bytes, scanners' comments a few thousand.
HEADER_LIMIT = 1 << 20

TYPES_READ = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "double": "f8", "float32": "f4", "float64": "f8",
}  # fmt: skip
BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
COLOR_NAMES = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
)
# PLY has no 64-bit integers, no half floats and no booleans: such attributes are written in the next type that holds
# them.
TYPES_WRITTEN = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort",
    "i4": "int", "u4": "uint", "f4": "float", "f8": "double",
}  # fmt: skip
WIDER = {"b1": "u1", "f2": "f4", "i8": "f8", "u8": "f8"}


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    import numpy as np

    from meshsimp_pymoo.formats.source import build_source
    from meshsimp_pymoo.formats.source.numbers import without_mark
    from meshsimp_pymoo.formats.source.rows import binary_columns, text_columns

    data = without_mark(path.read_bytes())
    elements, order, start = _header(data, name)
    named = {element.name: element for element in elements}
    if "vertex" not in named:
        raise ModelError(f"{name}: declares no element 'vertex' (but {sorted(named)}); export it as a triangle mesh")
    last = max(i for i, element in enumerate(elements) if element.name in ("vertex", "face"))
    columns = (text_columns if order == "" else binary_columns)(data, start, elements[: last + 1], name)
    vertex = columns["vertex"]
    scalars = {key for key, value in vertex.items() if isinstance(value, np.ndarray) and value.ndim == 1}
    if missing := sorted(set("xyz") - scalars):
        raise ModelError(f"{name}: its vertices have no {', '.join(missing)} (but {sorted(vertex)}); export it again")
    points = np.column_stack([vertex[axis].astype(np.float64) for axis in "xyz"])
    faces = _faces(columns.get("face", {}), name)
    return build_source(points, faces, _attributes(vertex, name), name)


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
            else:
                raise ValueError
        except (KeyError, IndexError, ValueError):
            raise ModelError(f"{name}: cannot read the header line {line[:80]!r}; export the file again") from None
    if order is None:
        raise ModelError(f"{name}: its header has no line 'format'; export the file again")
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


def _faces(columns: dict[str, Any], name: str) -> IntArray:
    import numpy as np

    from meshsimp_pymoo.formats.source.numbers import fans
    from meshsimp_pymoo.formats.source.rows import Ragged

    lists = [key for key, value in columns.items() if isinstance(value, Ragged) or value.ndim == 2]
    usual = [key for key in lists if key in ("vertex_indices", "vertex_index")]
    key = (usual or (lists if len(lists) == 1 else [""]))[0]
    if not key:
        if columns and len(next(iter(columns.values()), ())) and not lists:
            raise ModelError(f"{name}: its faces have no list of vertices (but {sorted(columns)}); export it again")
        if len(lists) > 1:
            raise ModelError(
                f"{name}: none of the face lists {sorted(lists)} is called vertex_indices; export it again"
            )
        return np.empty((0, 3), np.int64)
    column = columns[key]
    if isinstance(column, Ragged):
        return fans(_integers(column.values, name), column.counts)
    return fans(_integers(column.ravel(), name), np.full(len(column), column.shape[1]))


def _integers(values: AnyArray, name: str) -> IntArray:
    from meshsimp_pymoo.formats.source.numbers import whole

    if values.dtype.kind == "f":
        return whole(values.astype("float64"), name, "the face index")
    return values.astype("int64")


def _attributes(vertex: dict[str, Any], name: str) -> dict[str, AnyArray]:
    """Everything a vertex has beside its position and normal, colours as one array."""
    import numpy as np

    from meshsimp_pymoo.formats.source.numbers import rgba_of
    from meshsimp_pymoo.formats.source.rows import Ragged

    rest = {key: value for key, value in vertex.items() if key not in ("x", "y", "z", "nx", "ny", "nz")}
    attributes: dict[str, AnyArray] = {}
    for names in COLOR_NAMES:
        found = [rest[key] for key in names if key in rest]
        channels = [value for value in found if isinstance(value, np.ndarray) and value.ndim == 1]
        if len(channels) >= 3 and "color" not in rest and (color := rgba_of(channels)) is not None:
            attributes["color"] = color
            rest = {key: value for key, value in rest.items() if key not in names}
            break
    for key, value in rest.items():
        if isinstance(value, Ragged):
            warn_of(f"{name}: the per-vertex lists {key!r} differ in length and stay behind")
        else:
            attributes[key] = value
    return attributes


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
            spelled = COLOR_NAMES[0][k] if name == "color" else name if values.ndim == 1 else f"{name}_{k}"
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
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *_crs_comments(mesh.georeference),
        f"element vertex {len(vertices)}",
        *properties,
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    path.write_bytes("\n".join(header).encode("utf-8") + record.tobytes() + triangles.tobytes())


def _crs_comments(georeference: Mapping[str, Any]) -> list[str]:
    """Return the line of a PLY header that says the coordinate reference system, if it is known."""
    if georeference.get("epsg"):
        return [f"comment crs EPSG:{georeference['epsg']}"]
    wkt = " ".join(str(georeference.get("crs") or "").split())
    return [f"comment crs {wkt}"] if wkt else []


register(Format("ply", (".ply",), "PLY", read=_read, write=_write))
