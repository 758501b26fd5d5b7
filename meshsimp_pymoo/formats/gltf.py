"""glTF 2.0: single precision from an origin that the file states, as one file (GLB) or with files beside it."""

from __future__ import annotations

import re
import struct
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, reason_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray
    from meshsimp_pymoo.formats.source import SourceMesh

# The numbers of the types, of what a buffer is for, and of "triangles".
GLTF_FLOAT, GLTF_UINT, GLTF_UBYTE = 5126, 5125, 5121
GLTF_VERTICES, GLTF_INDICES, GLTF_TRIANGLES = 34962, 34963, 4


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    from meshsimp_pymoo.formats.source.scenes import read_scene

    _check(path, name, packed=path.suffix.lower() == ".glb")
    return read_scene(path, name)


def _check(path: Path, name: str, *, packed: bool) -> None:
    """Refuse a glTF whose declared sizes exceed what its file can hold."""
    import json

    from meshsimp_pymoo.formats.source import check_fits
    from meshsimp_pymoo.formats.source.numbers import glimpse

    size = path.stat().st_size
    with path.open("rb") as stream:
        if packed:
            head = stream.read(20)
            if len(head) < 20 or head[:4] != b"glTF":
                raise ModelError(f"{name}: is not a GLB file (it begins with {glimpse(head)}); check the suffix")
            length, chunk = struct.unpack("<8xII4x", head)
            if length > size or chunk > size - 20:
                raise ModelError(
                    f"{name}: truncated: its header declares {length} bytes, but the file has {size}; copy it again"
                )
            text = stream.read(chunk)
        else:
            text = stream.read()
    try:
        tree = json.loads(text)
        accessors = tree.get("accessors", [])
        # an accessor without a buffer view is all zeros: a few bytes that could ask for any amount of memory
        counts = [int(item.get("count", 0)) for item in accessors if "bufferView" not in item]
        outside = [uri for uri in _uris(tree) if not _is_beside(uri)]
        vertices, triangles = _placed_sizes(tree)
        is_tree = _has_tree(tree)
    except (ValueError, AttributeError, TypeError, LookupError, OverflowError, RecursionError) as error:
        raise ModelError(f"{name}: its JSON part cannot be read ({reason_of(error)}); export the file again") from error
    if outside:
        raise ModelError(f"{name}: names {outside[0][:80]!r}, which is outside its folder; export it as .glb")
    if not is_tree:
        raise ModelError(f"{name}: its nodes are no tree: some stand below two others or themselves; export it again")
    check_fits(vertices, triangles, name)
    if max(counts, default=0) > size:
        raise ModelError(f"{name}: declares {max(counts)} empty values in a file of {size} bytes; export it again")


def _placed_sizes(tree: Any) -> tuple[int, int]:
    """Return the vertices and triangles of all meshes, each as often as nodes place it, at least once."""
    accessors = tree.get("accessors", [])
    meshes = tree.get("meshes", [])
    placed = Counter(node["mesh"] for node in tree.get("nodes", []) if "mesh" in node)
    vertices, corners = 0, 0
    for k, mesh in enumerate(meshes):
        for part in mesh["primitives"]:
            count = int(accessors[part["attributes"]["POSITION"]]["count"])
            vertices += max(placed[k], 1) * count
            corners += max(placed[k], 1) * (int(accessors[part["indices"]]["count"]) if "indices" in part else count)
    return vertices, corners // 3


def _has_tree(tree: Any) -> bool:
    """Tell whether every node stands below one other node at most, and none below itself."""
    below = {k: node.get("children", []) for k, node in enumerate(tree.get("nodes", []))}
    children = [child for found in below.values() for child in found]
    if len(set(children)) < len(children):
        return False
    reached = set(below) - set(children)
    todo = list(reached)
    while todo:
        new = below[todo.pop()]
        todo += new
        reached.update(new)
    return len(reached) == len(below)


def _uris(tree: Any) -> list[str]:
    """Return the names of the files that a glTF would read beside itself."""
    uris = [item.get("uri") for key in ("buffers", "images") for item in tree.get(key, [])]
    return [str(uri) for uri in uris if uri is not None and not str(uri).startswith("data:")]


def _is_beside(uri: str) -> bool:
    """Tell whether a URI is the name of a file in the same folder or below."""
    return not re.search(r"[:\\%\0]|^/|(^|/)\.\.(/|$)", uri)


def _write(path: Path, mesh: OutMesh) -> None:
    """Write a GLB of one node with one mesh, whose coordinates are those from the origin."""
    import json

    import numpy as np

    from meshsimp_pymoo.formats.source.precision import local_origin

    origin = local_origin(mesh.vertices) if mesh.origin is None else mesh.origin
    color = mesh.attributes.get("color")
    points = (np.asarray(mesh.vertices, dtype=np.float64) - origin).astype("<f4")
    parts: list[tuple[AnyArray, int, dict[str, Any]]] = [
        (
            points,
            GLTF_VERTICES,
            {
                "componentType": GLTF_FLOAT,
                "type": "VEC3",
                "count": len(points),
                "min": points.min(axis=0).tolist(),
                "max": points.max(axis=0).tolist(),
            },
        ),
        (
            np.asarray(mesh.faces).astype("<u4").ravel(),
            GLTF_INDICES,
            {"componentType": GLTF_UINT, "type": "SCALAR", "count": 3 * len(mesh.faces)},
        ),
    ]
    attributes = {"POSITION": 0}
    if color is not None:
        rgba = np.full((len(points), 4), 255, np.uint8)
        rgba[:, : color.shape[1]] = color
        form = {"componentType": GLTF_UBYTE, "type": "VEC4", "count": len(points), "normalized": True}
        parts.append((rgba, GLTF_VERTICES, form))
        attributes["COLOR_0"] = 2
    binary, views = b"", []
    for values, target, _ in parts:
        content = values.tobytes()
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(content), "target": target})
        binary += content + b"\0" * (-len(content) % 4)
    node: dict[str, Any] = {"mesh": 0}
    if origin.any():
        node |= {"translation": origin.tolist(), "extras": {"origin": origin.tolist()}}
    crs = {key: mesh.georeference[key] for key in ("epsg", "crs") if mesh.georeference.get(key)}
    if crs:
        node["extras"] = node.get("extras", {}) | crs
    tree = {
        "asset": {"version": "2.0", "generator": "meshsimp_pymoo"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 1, "mode": GLTF_TRIANGLES}]}],
        "accessors": [{"bufferView": k} | form for k, (_, _, form) in enumerate(parts)],
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(binary)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, length) + chunks)


register(Format("glb", (".glb",), "GLB", read=_read, write=_write, single_precision=True, states_origin=True))
register(Format("gltf", (".gltf",), "glTF", read=_read))
