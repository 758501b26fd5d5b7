"""GLB, a glTF 2.0 in one file: Y up, in metres, single precision from an origin that the file states, images inside.

One mesh is one node. Levels of detail are one node each, of which the finest names the others, as ``MSFT_lod`` has it
[1]_; whoever does not know that extension sees the finest. A mesh that was packed is one of
``KHR_draco_mesh_compression`` [2]_.

References
----------
.. [1] https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/MSFT_lod
.. [2] https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_draco_mesh_compression
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ResultError, warn_of, way_to_install
from meshsimp_pymoo.formats.gltf import (
    GLTF_FLOAT,
    GLTF_INDICES,
    GLTF_TRIANGLES,
    GLTF_UBYTE,
    GLTF_UINT,
    GLTF_VERTICES,
    STATED,
    UNKNOWN,
    UPRIGHT,
    read_gltf,
    turned,
)
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.outmesh import OutMesh, Packed, metres_of
from meshsimp_pymoo.formats.table import Format, Held, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray

# Single precision holds distances between these [m].
LEAST_EXTENT, MOST_EXTENT = 1e-30, 1e30
# Draco: the least and the most bits of a coordinate, of which single precision has no more; and how hard it works: from
# 7 on it predicts places from their neighbours, and 10 makes files no more than a few per cent smaller.
FEWEST_BITS, MOST_BITS = 8, 24
DRACO_LEVEL = 7
# The bits of a normal, which looks right with fewer, and what Draco calls the attributes. Colours and places on images
# are kept as they are.
NORMAL_BITS = 10
DRACO_KINDS = {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2, "TEXCOORD_0": 3}
LEVELS, DRACO = "MSFT_lod", "KHR_draco_mesh_compression"


# ------------------------------------------------------------------------------------------------------ in which frame


def _refuse(model: Held) -> None:
    """Refuse a model of a size that single precision cannot hold."""
    import numpy as np

    extent = float(np.ptp(model.file_points, axis=0).max())
    if not LEAST_EXTENT < extent < MOST_EXTENT:
        raise ResultError(
            f"{model.name}: GLB holds single precision, and this model is {extent:.3g} wide; write another format, "
            "such as ply"
        )


def metres_per_unit(georeference: Mapping[str, Any]) -> FloatArray:
    """Return what units of the file's x, y and z are in metres, 1 where that is not known.

    A ``scale`` makes units of height of those of the plane, such as degrees.

    >>> metres_per_unit({"unit": "degree", "scale": [55_600.0, 111_400.0], "height_unit": "metre"}).tolist()
    [55600.0, 111400.0, 1.0]
    >>> metres_per_unit({"unit": "metre", "height_unit": "foot"}).tolist()
    [1.0, 1.0, 0.3048]
    """
    import numpy as np

    plane = metres_of(georeference.get("unit")) or 1.0
    height = metres_of(georeference.get("height_unit")) or plane
    scale = georeference.get("scale")
    return np.array([plane, plane, height] if scale is None else [scale[0] * height, scale[1] * height, height])


def axes_of(mesh: OutMesh) -> tuple[str, ...]:
    """Return which axes of the file lie along X, Y and Z: those of a glTF as they are, else so that Y is up."""
    import numpy as np

    stated = tuple(mesh.georeference.get("axes", ()))
    if stated in UPRIGHT.values():
        return stated
    up = np.array([0.0, 0.0, 1.0]) if mesh.up is None else np.asarray(mesh.up, np.float64)
    k = int(np.argmax(np.abs(up)))
    return UPRIGHT["-" * bool(up[k] < 0) + "xyz"[k]]


def _origin(mesh: OutMesh) -> FloatArray:
    """Return what the coordinates count from."""
    import numpy as np

    from meshsimp_pymoo.formats.source.precision import local_origin

    return local_origin(np.asarray(mesh.vertices, dtype=np.float64)) if mesh.origin is None else mesh.origin


def _single(mesh: OutMesh) -> FloatArray:
    """Return the vertices from there, in metres."""
    import numpy as np

    return (np.asarray(mesh.vertices, dtype=np.float64) - _origin(mesh)) * metres_per_unit(mesh.georeference)


def upright(mesh: OutMesh) -> tuple[FloatArray, FloatArray]:
    """Return the vertices (V, 3) from the origin, X, Y and Z of glTF, and where that lies (3,) [m].

    Examples
    --------
    >>> import numpy as np
    >>> mesh = OutMesh(np.array([[7.0, 8.0, 9.0]]), np.empty((0, 3), int), {}, np.array([5.0, 5.0, 5.0]))
    >>> [part.tolist() for part in upright(mesh)]
    [[[2.0, 4.0, -3.0]], [5.0, 5.0, -5.0]]
    """
    turn = turned(axes_of(mesh))
    return _single(mesh) @ turn.T, turn @ (_origin(mesh) * metres_per_unit(mesh.georeference)) + 0.0


# -------------------------------------------------------------------------------------------------------------- packed


def _pack(mesh: OutMesh, most: float) -> OutMesh:
    """Return the mesh packed by Draco, with the fewest bits that move no vertex by more than so many metres."""
    import dataclasses

    import numpy as np

    try:
        import DracoPy
    except ImportError:
        raise ResultError(
            f"{mesh.name}: compressing GLB needs DracoPy; install it by {way_to_install('draco')}"
        ) from None

    points = _as_stored(mesh)
    extent = float(np.ptp(points, axis=0).max())
    # of a step between two numbers half is rounded, along each axis
    steps = math.sqrt(3) / 2 * extent / most if most > 0.0 else math.inf
    bits = min(max(math.ceil(math.log2(steps + 1)), FEWEST_BITS), MOST_BITS) if math.isfinite(steps) else MOST_BITS
    own = _columns(mesh)
    of_double = {key: values.astype(np.float64) for key, values in own.items()}
    content = DracoPy.encode(
        of_double["POSITION"],
        np.asarray(mesh.faces, np.uint32),
        quantization_bits=bits,
        compression_level=DRACO_LEVEL,
        colors=own.get("COLOR_0"),
        tex_coord=of_double.get("TEXCOORD_0"),
        normals=of_double.get("NORMAL"),
        normal_quantization_bits=NORMAL_BITS,
    )
    found = DracoPy.decode(content)
    said = {key: found.get_attribute_by_type(DRACO_KINDS[key]) for key in own}
    columns = {key: attribute["data"] for key, attribute in said.items()}
    ids = {key: int(attribute["unique_id"]) for key, attribute in said.items()}
    was, shift = _nearest(upright(mesh)[0], found.points)
    if lost := len(mesh.faces) - len(found.faces):
        warn_of(f"{mesh.name}: {lost:,} triangle(s) without area stay behind: Draco holds none")
    if folded := _turned_over(points[was], found.points, np.asarray(found.faces)):
        warn_of(f"{mesh.name}: Draco's {bits} bits turn over or flatten {folded:,} of {len(found.faces):,} triangles")
    packed = Packed(content, columns, np.asarray(found.faces, np.int64), ids, bits, shift)
    return dataclasses.replace(mesh, packed=packed)


def _nearest(points: FloatArray, moved: FloatArray) -> tuple[IntArray, float]:
    """Return which of the points each of the moved ones was, and the longest way from one to the next other [m]."""
    import numpy as np
    from scipy.spatial import cKDTree

    ways, was = cKDTree(points).query(moved)
    back, _ = cKDTree(moved).query(points)
    return np.asarray(was), float(max(ways.max(), back.max()))


def _turned_over(points: FloatArray, moved: FloatArray, faces: IntArray) -> int:
    """Return how many triangles have no area or look to the other side where their corners moved."""
    import numpy as np

    before, after = (
        np.cross(p[faces[:, 1]] - p[faces[:, 0]], p[faces[:, 2]] - p[faces[:, 0]])
        for p in (points.astype(np.float64), moved.astype(np.float64))
    )
    return int(((before * after).sum(axis=1) <= 0.0).sum() - (before == 0.0).all(axis=1).sum())


# ------------------------------------------------------------------------------------------------------------- written


class _Binary:
    """The binary part of a GLB as it grows, and what its tree says of it."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, content: bytes, **use: int) -> int:
        """Add a part; return the number of its view."""
        self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(content)} | use)
        self.parts.append(content + b"\0" * (-len(content) % 4))
        self.size += len(self.parts[-1])
        return len(self.views) - 1

    def count(self, count: int, form: Mapping[str, Any], view: int | None = None) -> int:
        """Add an accessor of so many values, in a view or packed elsewhere; return its number."""
        self.accessors.append(({} if view is None else {"bufferView": view}) | {"count": count} | dict(form))
        return len(self.accessors) - 1


def _as_stored(mesh: OutMesh) -> FloatArray:
    """Return the vertices (V, 3) as they are stored, float32."""
    import numpy as np

    return upright(mesh)[0].astype("<f4") + np.float32(0)  # no -0.0


def _normals(mesh: OutMesh) -> FloatArray:
    """Return unit normals (V, 3) of the vertices: the mean of their triangles' by area; up where that is nothing."""
    import numpy as np

    points, faces = upright(mesh)[0], np.asarray(mesh.faces)
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, faces[:, k], np.cross(b - a, c - a))
    length = np.linalg.norm(normals, axis=1)
    normals[length == 0.0] = [0.0, 1.0, 0.0]
    return (normals / np.where(length == 0.0, 1.0, length)[:, None]).astype("<f4")


def _colors(mesh: OutMesh) -> AnyArray | None:
    """Return the colours (V, 4) as they are stored."""
    import numpy as np

    if (color := mesh.attributes.get("color")) is None:
        return None
    rgba = np.full((len(mesh.vertices), 4), 255, np.uint8)
    rgba[:, : color.shape[1]] = color
    return rgba


def _places(mesh: OutMesh) -> FloatArray | None:
    """Return where on the image vertices lie (V, 2), counted from its upper left corner, float32."""
    import numpy as np

    if (uv := mesh.uv) is None:
        return None
    return np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]).astype("<f4")


def _columns(mesh: OutMesh) -> dict[str, AnyArray]:
    """Return what is stored of the vertices, by the name of the attribute."""
    columns = {"POSITION": _as_stored(mesh), "NORMAL": _normals(mesh) if mesh.shaded else None}
    columns |= {"COLOR_0": _colors(mesh), "TEXCOORD_0": _places(mesh)}
    return {key: values for key, values in columns.items() if values is not None}


def _form(key: str, values: AnyArray) -> dict[str, Any]:
    """Return what an accessor says of an attribute's values beside their number."""
    if key == "COLOR_0":
        return {"componentType": GLTF_UBYTE, "type": "VEC4", "normalized": True}
    if key == "TEXCOORD_0":
        return {"componentType": GLTF_FLOAT, "type": "VEC2"}
    if key == "NORMAL":
        return {"componentType": GLTF_FLOAT, "type": "VEC3"}
    ends = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
    return {"componentType": GLTF_FLOAT, "type": "VEC3"} | ends


def _primitive(mesh: OutMesh, binary: _Binary) -> dict[str, Any]:
    """Add a mesh to the binary part and return its primitive."""
    import numpy as np

    indices = {"componentType": GLTF_UINT, "type": "SCALAR"}
    if (packed := mesh.packed) is not None:
        view = binary.add(packed.content)
        said = {key: binary.count(len(values), _form(key, values)) for key, values in packed.columns.items()}
        return {
            "attributes": said,
            "indices": binary.count(3 * len(packed.faces), indices),
            "mode": GLTF_TRIANGLES,
            "extensions": {DRACO: {"bufferView": view, "attributes": dict(packed.ids)}},
        }
    columns = _columns(mesh)
    views = [binary.add(values.tobytes(), target=GLTF_VERTICES) for values in columns.values()]
    views.append(binary.add(np.asarray(mesh.faces).astype("<u4").tobytes(), target=GLTF_INDICES))
    said = {
        key: binary.count(len(values), _form(key, values), view)
        for (key, values), view in zip(columns.items(), views, strict=False)
    }
    return {
        "attributes": said,
        "indices": binary.count(3 * len(mesh.faces), indices, views[-1]),
        "mode": GLTF_TRIANGLES,
    }


def _stated(mesh: OutMesh) -> dict[str, Any]:
    """Return what the extras of a node say of its coordinates: where they come from."""
    import numpy as np

    known = {key: mesh.georeference[key] for key in STATED if mesh.georeference.get(key)}
    return {
        "origin": (np.asarray(_origin(mesh), np.float64) + 0.0).tolist(),
        "axes": list(axes_of(mesh)),
        "metres_per_unit": metres_per_unit(mesh.georeference).tolist(),
        "unit": UNKNOWN,
    } | known


def write_glb(path: Path, meshes: Sequence[OutMesh], coverage: Sequence[float] = ()) -> None:
    """Write meshes as levels of detail, each a node with a mesh whose coordinates are those from the origin.

    Parameters
    ----------
    path : Path
        The file.
    meshes : sequence of OutMesh
        The levels, the finest first; or one mesh, which is a plain GLB. They share a material.
    coverage : sequence of float
        The share of the screen down to which each of several is shown, ``MSFT_screencoverage``.
    """
    import json

    binary = _Binary()
    described: list[dict[str, Any]] = []
    nodes: list[dict[str, Any]] = []
    for k, mesh in enumerate(meshes):
        extras = dict(mesh.extras) | ({} if mesh.packed is None else mesh.packed.said)
        described.append({"primitives": [_primitive(mesh, binary)]} | ({"extras": extras} if extras else {}))
        node = {"mesh": k, "translation": upright(mesh)[1].tolist(), "extras": _stated(mesh)}
        nodes.append(({"name": f"level-{k}"} if len(meshes) > 1 else {}) | node)
    used = [LEVELS] * (len(meshes) > 1) + [DRACO] * any(mesh.packed is not None for mesh in meshes)
    if len(meshes) > 1:
        nodes[0]["extensions"] = {LEVELS: {"ids": list(range(1, len(meshes)))}}
        nodes[0]["extras"] |= {"MSFT_screencoverage": list(coverage)}
    tree = {
        "asset": {"version": "2.0", "generator": "meshsimp_pymoo"},
        **({"extensionsUsed": used} if used else {}),
        **({"extensionsRequired": [DRACO]} if DRACO in used else {}),
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": described,
        **_looks(meshes[0], described, binary),
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{"byteLength": binary.size}],
    }
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + binary.size
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", binary.size, b"BIN\0")
    path.write_bytes(b"".join([struct.pack("<4sII", b"glTF", 2, length), chunks, *binary.parts]))


def _write(path: Path, mesh: OutMesh) -> None:
    write_glb(path, [mesh])


def _looks(mesh: OutMesh, described: Sequence[dict[str, Any]], binary: _Binary) -> dict[str, Any]:
    """Give all primitives the material of a mesh, if it has one, and return what the tree says of it."""
    material = mesh.material or (Material() if mesh.shaded or mesh.uv is not None else None)
    if material is None:
        return {}
    for each in described:
        for primitive in each["primitives"]:
            primitive["material"] = 0
    looks: dict[str, Any] = {"materials": [_described(material, has_image=mesh.has_image)]}
    if mesh.has_image:
        view = binary.add(material.image)
        looks |= {"textures": [{"source": 0}], "images": [{"bufferView": view, "mimeType": material.media_type}]}
    return looks


def _described(material: Material, *, has_image: bool) -> dict[str, Any]:
    surface: dict[str, Any] = {"baseColorFactor": list(material.color), "metallicFactor": 0.0}
    if has_image:
        surface["baseColorTexture"] = {"index": 0}
    blended = {"alphaMode": "BLEND"} if material.color[3] < 1 else {}
    return {"name": material.name, "pbrMetallicRoughness": surface} | blended


register(
    Format(
        "glb",
        (".glb",),
        "GLB",
        read=read_gltf,
        write=_write,
        single=_single,
        states_origin=True,
        keeps=("color", "uv"),
        refuse=_refuse,
        pack=_pack,
    )
)
