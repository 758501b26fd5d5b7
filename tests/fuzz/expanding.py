"""Small files that ask for much: repeats, declared sizes, packed zeros, huge polygons, deep nesting, long lines.

How large a case is, is drawn evenly over orders of magnitude. Up to HONEST faces, samples or bytes are there, in the
file or in what it repeats or packs, and reading them is due. Far beyond any machine is what is FORGED, which a header
says, and what is PACKED, which a few kilobytes would unpack to.
"""

from __future__ import annotations

import base64
import io
import json
import struct
import zipfile
import zlib
from functools import cache
from typing import Any

import mutations
import numpy as np

HONEST = 30_000
# No format has sides beyond this.
LARGEST_SIDE = 2**31 - 1
FORGED = (2**24, 2**31 - 1, 2**31, 2**32 - 1, 10**9, 10**10, 2**40, 2**53, 2**63 - 1, 10**30)
PACKED = (10**8, 4 * 10**8, 10**10)

Case = tuple[str, bytes]


def expanding_case(rng: np.random.Generator) -> Case:
    """Return the suffix and content of a small file that expands."""
    return FAMILIES[rng.integers(len(FAMILIES))](rng)


def _size(rng: np.random.Generator, most: int = HONEST) -> int:
    return int(most ** rng.random()) + 1


def _one_of(rng: np.random.Generator, values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


# --------------------------------------------------------------------------------------------------------------- meshes

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1.0]])
HALVES = [[0, 1, 2], [0, 2, 3]]


def _mesh(rng: np.random.Generator, points: np.ndarray, polygons: list[list[int]]) -> Case:
    """Return a mesh in one of the formats, text or binary."""
    kind = _one_of(rng, ("obj", "off", "ply", "stl"))
    rows = [" ".join(map(repr, row)) for row in np.asarray(points, float).tolist()]
    if kind == "stl":
        if all(len(face) == 3 for face in polygons):
            return kind, _stl(np.asarray(points)[np.array(polygons)])
        kind = "off"
    if kind == "obj":
        lines = [f"v {row}" for row in rows] + ["f " + " ".join(str(k + 1) for k in face) for face in polygons]
        return kind, "\n".join(lines).encode()
    if kind == "off":
        lines = ["OFF", f"{len(rows)} {len(polygons)} 0", *rows]
        lines += [f"{len(face)} " + " ".join(map(str, face)) for face in polygons]
        return kind, "\n".join(lines).encode()
    text = rng.random() < 0.3
    head = (
        f"ply\nformat {'ascii' if text else 'binary_little_endian'} 1.0\nelement vertex {len(rows)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(polygons)}\nproperty list int int vertex_indices\nend_header\n"
    ).encode()
    if text:
        return kind, head + "\n".join(rows + [" ".join(map(str, [len(face), *face])) for face in polygons]).encode()
    body = b"".join(struct.pack(f"<{len(face) + 1}i", len(face), *face) for face in polygons)
    return kind, head + np.asarray(points, "<f8").tobytes() + body


def _stl(triangles: np.ndarray, declared: int | None = None) -> bytes:
    table = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("bytes", "<u2")])
    table["corners"] = triangles
    return bytes(80) + struct.pack("<I", len(table) if declared is None else declared) + table.tobytes()


def repeated_faces(rng: np.random.Generator) -> Case:
    """Give one face again and again: as it is, turned, or begun at another corner."""
    again = [[0, 1, 2], [2, 1, 0], [1, 2, 0]][: int(rng.integers(1, 4))]
    return _mesh(rng, SQUARE, HALVES + again * _size(rng))


def stacked_sheets(rng: np.random.Generator) -> Case:
    """Lay sheets over each other: from above every face hides every other."""
    n = _size(rng, HONEST // 4)
    apart = _one_of(rng, (0.0, 1e-9, 1.0))
    points = np.concatenate([SQUARE + np.array([0, 0, apart * k]) for k in range(n)])
    return _mesh(rng, points, [[4 * k + i for i in half] for k in range(n) for half in HALVES])


def walls(rng: np.random.Generator) -> Case:
    """Set a grid of faces upright, its depth in noise: nothing to be seen from above."""
    n = _size(rng, int((HONEST / 2) ** 0.5)) + 1
    i, j = (axis.ravel() for axis in np.mgrid[:n, :n])
    points = np.column_stack([i, rng.random(n * n) * _one_of(rng, (1e-9, 0.1, 3.0)), j])
    at = np.arange(n * n).reshape(n, n)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    return _mesh(rng, points, quads.tolist())


def common_edge(rng: np.random.Generator) -> Case:
    """Hang many faces on one edge, or on one vertex."""
    n = _size(rng)
    ends = [[0, 0, 0]] * 2 if (one := rng.random() < 0.5) else [[0, 0, 0], [0, 0, 1]]
    points = np.concatenate([np.array(ends, float), _circle(n + 2)])
    return _mesh(rng, points, [[0, k + 2, k + 3] if one else [0, 1, k + 2] for k in range(n)])


def huge_polygon(rng: np.random.Generator) -> Case:
    """Give one polygon of a great many corners: a disc, a tangle, or the same few corners over and over."""
    n = _size(rng) + 3
    way = rng.integers(3)
    points = _circle(n) if way < 2 else SQUARE
    corners = np.arange(n) if way == 0 else rng.permutation(n) if way == 1 else np.arange(n) % 4
    return _mesh(rng, points, [corners.tolist()])


def many_places(rng: np.random.Generator) -> Case:
    """Put many vertices where few are: all at one place, or on a line."""
    n = _size(rng)
    points = np.zeros((n + 4, 3))
    points[:4] = SQUARE
    points[4:] = _one_of(rng, (SQUARE[1], np.linspace(0, 1, n)[:, None] * [1, 1, 0]))
    faces = [[k, (k + 1) % n, (k + 2) % n] for k in range(0, n, 3)]
    return _mesh(rng, points, HALVES + (faces if rng.random() < 0.7 else []))


def _circle(n: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n
    return np.column_stack([np.cos(angle), np.sin(angle), np.round(np.sin(3 * angle), 3)])


# ----------------------------------------------------------------------------------------------------------------- glTF


def _gltf(rng: np.random.Generator, tree: dict[str, Any], data: bytes) -> Case:
    if rng.random() < 0.3:
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        return "gltf", json.dumps(tree | {"buffers": [{"byteLength": len(data), "uri": uri}]}).encode()
    return "glb", _glb(json.dumps(tree | {"buffers": [{"byteLength": len(data)}]}).encode(), data)


def _glb(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    return head + text + struct.pack("<II", len(data), 0x004E4942) + data


def _instances_of(points: np.ndarray, faces: list[list[int]]) -> tuple[dict[str, Any], bytes]:
    """Return the tree of one mesh on one node, and its buffer."""
    places = np.asarray(points, "<f4").tobytes()
    corners = np.asarray(faces, "<u4").tobytes()
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": len(places)},
        {"buffer": 0, "byteOffset": len(places), "byteLength": len(corners)},
    ]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": len(points)},
        {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3 * len(faces)},
    ]
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}
    tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
    tree |= {"meshes": [{"primitives": [primitive]}], "accessors": accessors, "bufferViews": views}
    return tree, places + corners


def _sheet(n: int) -> tuple[np.ndarray, list[list[int]]]:
    i, j = (axis.ravel() for axis in np.mgrid[:n, :n])
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    return np.column_stack([i, j, i * j % 3.0]), np.concatenate([np.c_[a, b, c], np.c_[a, c, d]]).tolist()


def _repeated(rng: np.random.Generator) -> tuple[dict[str, Any], bytes, int]:
    """Return a mesh and how often it is to be there: as often as is due, or for more than a gigabyte."""
    if rng.random() < 0.3:
        return *_instances_of(*_sheet(60)), 3000
    points, faces = (SQUARE, HALVES) if rng.random() < 0.5 else _sheet(int(rng.integers(3, 60)))
    return *_instances_of(points, faces), _size(rng, max(2, min(HONEST // 10, 2 * HONEST // len(faces))))


def instances(rng: np.random.Generator) -> Case:
    """Place one mesh at many nodes: side by side, nested, or where every node has the next one twice over."""
    tree, data, n = _repeated(rng)
    way = rng.integers(5)
    if way == 0:  # each moved on its own
        tree["nodes"] = [{"mesh": 0, "translation": [float(k % 100), float(k // 100), 0.0]} for k in range(n)]
        tree["scenes"] = [{"nodes": list(range(n))}]
    elif way == 1:  # all where they are
        tree["nodes"] = [{"mesh": 0}] * n
        tree["scenes"] = [{"nodes": list(range(n))}]
    elif way == 2:  # a chain, which moves on with every node
        n = min(n, 1000)
        tree["nodes"] = [{"mesh": 0, "translation": [1.0, 0.0, 0.0], "children": [k + 1]} for k in range(n)]
        tree["nodes"].append({"mesh": 0})
    elif way == 3:  # 2 ** n of the last one
        n = int(rng.integers(2, 60))
        tree["nodes"] = [{"children": [k + 1, k + 1], "scale": [1.0, 0.5, 1.0]} for k in range(n)] + [{"mesh": 0}]
    else:  # in a circle
        tree["nodes"] = [{"mesh": 0, "children": [(k + 1) % n]} for k in range(n)]
    return _gltf(rng, tree, data)


def shared_accessors(rng: np.random.Generator) -> Case:
    """Let many primitives or meshes take the same numbers."""
    tree, data, n = _repeated(rng)
    primitive = tree["meshes"][0]["primitives"][0]
    if rng.random() < 0.5:
        tree["meshes"] = [{"primitives": [primitive] * n}]
    else:
        tree["meshes"] = [{"primitives": [primitive]}] * n
        tree["nodes"] = [{"mesh": k} for k in range(n)]
        tree["scenes"] = [{"nodes": list(range(n))}]
    return _gltf(rng, tree, data)


def forged_accessors(rng: np.random.Generator) -> Case:
    """Let an accessor, a view or a buffer declare far more than there is."""
    tree, data = _instances_of(SQUARE, HALVES)
    many = int(_one_of(rng, FORGED))
    part, key = _one_of(
        rng,
        (
            ("accessors", "count"), ("accessors", "byteOffset"), ("bufferViews", "byteLength"),
            ("bufferViews", "byteOffset"), ("bufferViews", "byteStride"),
        ),
    )  # fmt: skip
    item = _one_of(rng, tree[part])
    item[key] = many
    if part == "accessors" and rng.random() < 0.5:  # zeros, of which some are replaced
        item.pop("bufferView", None)
        few = {"bufferView": 1, "componentType": 5125}
        item["sparse"] = {"count": int(_one_of(rng, (1, many))), "indices": few, "values": {"bufferView": 0}}
    return _gltf(rng, tree, data)


def deep_tree(rng: np.random.Generator) -> Case:
    """Nest the JSON part deeply, or give it names, numbers and strings without end."""
    tree, data = _instances_of(SQUARE, HALVES)
    text = json.dumps(tree | {"buffers": [{"byteLength": len(data)}], "extras": "HERE"})
    n = _size(rng, 10 * HONEST)
    instead = _one_of(
        rng,
        (
            "[" * n + "]" * n, '{"a":' * n + "1" + "}" * n, "[" * n, "9" * n, f"1e{n}", '"' + "\\u0041" * n + '"',
            "[" + "1," * n + "1]", "{" + ",".join(f'"{k}":0' for k in range(n // 8)) + "}",
        ),
    )  # fmt: skip
    return "glb", _glb(text.replace('"HERE"', instead).encode(), data)


# ------------------------------------------------------------------------------------------------------- declared sizes


def forged_header(rng: np.random.Generator) -> Case:
    """Let a header declare far more than follows."""
    many = int(_one_of(rng, FORGED))
    few = int(rng.integers(0, 10))
    more = int(_one_of(rng, FORGED))
    numbers = b" ".join(b"%d" % k for k in range(60))
    ply = (
        "ply\nformat {} 1.0\nelement vertex {}\nproperty {} x\nproperty float y\nproperty float z\n"
        "element face {}\nproperty list {} int vertex_indices\nend_header\n"
    )
    order = _one_of(rng, ("ascii", "binary_little_endian", "binary_big_endian"))
    counts = _one_of(rng, ("uchar", "int", "uint", "int64", "uint64"))
    body = _one_of(rng, (numbers, bytes(2000), b"\xff" * 2000, np.arange(600, dtype="<f4").tobytes()))
    shape = _one_of(rng, ((many,), (many, 2), (3, many), (many, many), (many, 0), (0, many), (2,) * 60, (1,) * 500))
    size = f"ncols {_one_of(rng, (many, few))}\nnrows {more}\nxllcorner 0\nyllcorner 0\ncellsize 1\n".encode()
    return _one_of(
        rng,
        (
            ("ply", ply.format(order, many, "float", few, counts).encode() + body),
            ("ply", ply.format(order, few, "float", many, counts).encode() + body),
            ("ply", ply.format(order, 8, "float", 4, f"uchar int a\nproperty list {counts}").encode() + body),
            ("off", b"OFF\n%d %d 0\n" % (many, few) + numbers),
            ("off", b"OFF\n%d %d %d\n" % (few, many, more) + numbers),
            ("off", b"OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n%d 0 1 2 3\n" % many),
            ("stl", _stl(SQUARE[np.array(HALVES)], declared=many % 2**32)),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 %d\nf 1 3 -%d\n" % (many, more)),
            ("pts", b"%d\n" % many + b"\n".join(b"%d %d %d" % (k, k * k, k % 3) for k in range(20))),
            ("asc", size + numbers),
            ("npy", _npy_of(shape, numbers)),
            ("npz", _zip({"elevation.npy": _npy_of(shape, numbers)})),
            ("npz", _zip({"elevation.npy": _npy_of(shape, numbers)}, declared=many % 2**32)),
            ("las", _forged_las("las", many)),
            ("laz", _forged_las("laz", many)),
            ("tif", _tiff(many % 2**32, more % 2**32, _one_of(rng, (1, 5, 8, 32773, 50000)), few)),
            ("png", _png(many % 2**31, max(more % 2**31, 1), zlib.compress(bytes(1000)))),
            ("hgt", bytes(2 * few)),
        ),
    )  # fmt: skip


def _npy_of(shape: tuple[int, ...], body: bytes) -> bytes:
    head = repr({"descr": "<f4", "fortran_order": False, "shape": shape}).encode() + b"\n"
    return b"\x93NUMPY\x02\x00" + struct.pack("<I", len(head)) + head + body


def _zip(members: dict[str, bytes], declared: int | None = None) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    found = bytearray(content.getvalue())
    if declared is not None:
        struct.pack_into("<I", found, found.rindex(b"PK\x01\x02") + 24, declared)
    return bytes(found)


def _forged_las(kind: str, many: int) -> bytes:
    """Return points whose number the header overstates."""
    content = bytearray(dict(mutations.good_files()).get(kind, bytes(400)))
    struct.pack_into("<I", content, 107, many % 2**32)
    return bytes(content)


def _tiff(columns: int, rows: int, packing: int, strips: int) -> bytes:
    """Return the directory of a raster with hardly anything behind it."""
    tags = [
        (256, 4, 1, columns), (257, 4, 1, rows), (258, 3, 1, 32), (259, 3, 1, packing), (262, 3, 1, 1), (277, 3, 1, 1),
        (273, 4, 1, 8), (278, 4, 1, rows), (279, 4, 1, 8 + strips), (339, 3, 1, 3),
    ]  # fmt: skip
    entries = b"".join(struct.pack("<HHII", *tag) for tag in sorted(tags))
    return b"II*\0" + struct.pack("<I", 8 + 16) + bytes(16) + struct.pack("<H", len(tags)) + entries + bytes(4)


def _png(columns: int, rows: int, packed: bytes) -> bytes:
    """Return a picture of 16 bits a pixel, one channel."""
    parts = [(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 16, 0, 0, 0, 0)), (b"IDAT", packed), (b"IEND", b"")]
    chunks = [struct.pack(">I", len(d)) + t + d + struct.pack(">I", zlib.crc32(t + d)) for t, d in parts]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


# --------------------------------------------------------------------------------------------------------- packed zeros


def packed_zeros(rng: np.random.Generator) -> Case:
    """Pack a grid or a cloud that is nearly all one number: what can be read, or what no machine should try to."""
    packers = [_packed_npz, _packed_png, *[_packed_tiff] * _has("rasterio")]
    if _has("laspy") and rng.random() < 0.2:
        return "laz", _packed_laz(int(10 ** rng.uniform(1, 4.5)))
    return _one_of(rng, packers)(int(_one_of(rng, PACKED)) if rng.random() < 0.4 else _size(rng, 4 * HONEST), rng)


@cache
def _has(library: str) -> bool:
    from importlib.util import find_spec

    return find_spec(library) is not None


def _sides(n: int, rng: np.random.Generator) -> tuple[int, int]:
    columns = max(2, int(n**0.5) if rng.random() < 0.7 else _one_of(rng, (2, 100)))
    return max(2, n // columns), columns


def _packed_npz(n: int, rng: np.random.Generator) -> Case:
    rows, columns = _sides(n, rng)
    if n <= 10 * HONEST:
        content = io.BytesIO()
        np.savez_compressed(content, **{_one_of(rng, ("elevation", "z")): np.zeros((rows, columns), "f4")})
        return "npz", content.getvalue()
    head = _npy_of((rows, columns), b"")
    size = len(head) + 4 * rows * columns
    packed = _deflated(head, 4 * rows * columns)
    # a whole member, sizes said in 64 bits; its checksum is wrong, which shows at its end only
    name, far = b"elevation.npy", struct.pack("<HHQQ", 1, 16, size, len(packed))
    told = struct.pack("<HHHHHIIIHH", 45, 0, 8, 0, 0, 0, 0xFFFFFFFF, 0xFFFFFFFF, len(name), len(far))
    entry = b"PK\x03\x04" + told + name + far
    table = b"PK\x01\x02" + struct.pack("<H", 45) + told + struct.pack("<HHHII", 0, 0, 0, 0, 0) + name + far
    end = b"PK\x05\x06" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(table), len(entry) + len(packed), 0)
    return "npz", entry + packed + table + end


def _deflated(head: bytes, zeros: int) -> bytes:
    """Return a raw deflate stream of some bytes and many zeros, cut off after a megabyte of packed ones."""
    block = _block_of_zeros()
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    first = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    return first + block * min(zeros >> 20, (1 << 20) // len(block)) + b"\x03\x00"


@cache
def _block_of_zeros() -> bytes:
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    return packer.compress(bytes(1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)


def _packed_png(n: int, rng: np.random.Generator) -> Case:
    rows, columns = _sides(n, rng)
    if n <= 10 * HONEST:
        return "png", _png(columns, rows, zlib.compress(bytes(rows * (1 + 2 * columns))))
    return "png", _png(columns, min(rows, LARGEST_SIDE), b"\x78\x9c" + _deflated(b"", 2 * n) + bytes(4))


def _packed_tiff(n: int, rng: np.random.Generator) -> Case:
    rows, columns = (min(side, LARGEST_SIDE) for side in _sides(n, rng))
    return "tif", _raster_of_zeros(rows, columns, str(_one_of(rng, ("deflate", "lzw", "packbits", "zstd"))))


def _raster_of_zeros(rows: int, columns: int, packing: str) -> bytes:
    import rasterio
    from affine import Affine
    from rasterio.io import MemoryFile

    look = {"height": rows, "width": columns, "count": 1, "dtype": "float32", "transform": Affine(*mutations.PLACE)}
    honest = rows * columns <= 10 * HONEST
    tiles = {} if honest else {"tiled": True, "blockxsize": 4096, "blockysize": 4096, "BIGTIFF": "YES"}
    with rasterio.Env(), MemoryFile() as memory:
        # what is not written of a sparse file takes no place but in the list of its tiles
        with memory.open(driver="GTiff", compress=packing, SPARSE_OK=True, **tiles, **look) as raster:
            if honest:
                raster.write(np.zeros((rows, columns), np.float32), 1)
        return bytes(memory.read())


@cache
def _packed_laz(n: int) -> bytes:
    import laspy

    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales = [0.01] * 3
    cloud = laspy.LasData(header)
    side = int(n**0.5) + 1
    cloud.x, cloud.y, cloud.z = np.arange(n) % side, np.arange(n) // side, np.zeros(n)
    content = io.BytesIO()
    cloud.write(content, do_compress=True, laz_backend=laspy.LazBackend.Lazrs)
    return content.getvalue()


# -------------------------------------------------------------------------------------------------------- lines, tokens


PIECES = (
    b"1 ", b"0 0 0\n", b"\n", b" ", b",", b"1,", b"9", b"-", b"1e", b"1 2\n", b"nan ", b"#\n", b"# x\n", b"v 0 0 0\n",
    b"f 1 2 3\n", b"f 1//1 2//2 3//3\n", b"f -1 -2 -3\n", b"\\\n", b"//\n", b"comment a\n", b"a 1\n", b"\xff", b"\x00",
    b"element a 1\nproperty int b\n", b"property float a\n", b"property list uchar int a\n", b'"', b"x y z ",
    b"1;2;3\n", b"(", b"x,", b"solid a\n",
    b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n",
    b"endloop\nendfacet\n",
)  # fmt: skip


def long_text(rng: np.random.Generator) -> Case:
    """Write lines, numbers, names and comments without end."""
    n = _size(rng, 8 * HONEST)
    piece = _one_of(rng, PIECES)
    n = min(n, (1 << 19) // len(piece))
    rest = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
    start = {
        "obj": b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
        "off": b"OFF\n4 2 0\n" + rest,
        "xyz": b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n",
        "csv": b"x,y,z\n0,0,0\n1,0,0\n1,1,0\n0,1,0\n",
        "asc": mutations._asc().encode(),
        "stl": b"solid a\n",
        "ply": b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n",
    }
    kind = str(_one_of(rng, list(start)))
    text = start[kind]
    if kind == "ply":
        return kind, text + piece * n + b"element face 2\nproperty list uchar int vertex_indices\nend_header\n" + rest
    at = _one_of(rng, [0, len(text), text.index(b"\n") + 1, text.rfind(b"\n", 0, -1) + 1])
    return kind, text[:at] + piece * n + text[at:]


FAMILIES = (
    repeated_faces, stacked_sheets, walls, common_edge, huge_polygon, many_places, instances, shared_accessors,
    forged_accessors, deep_tree, forged_header, forged_header, packed_zeros, long_text, long_text,
)  # fmt: skip
