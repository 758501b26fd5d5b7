"""glTF 2.0, packed into one file (GLB) or not: what is read, and the words that reading and writing share.

A file of ours says in the ``extras`` of its nodes how its coordinates came about, and goes back into the frame of its
model; files of others are read as they lie, and written as they lay.
"""

from __future__ import annotations

import math
import re
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from meshsimp_pymoo.errors import ModelError, reason_of, warn_of
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray
    from meshsimp_pymoo.formats.source import SourceMesh

# The numbers of the types, of what a buffer is for, and of what primitives are made of.
GLTF_FLOAT, GLTF_UINT, GLTF_UBYTE = 5126, 5125, 5121
GLTF_VERTICES, GLTF_INDICES, GLTF_TRIANGLES, GLTF_STRIP = 34962, 34963, 4, 5
# What is read of a vertex beside its own attributes, whose names begin with a line below; normals follow from the rest.
CARRIED = ("POSITION", "COLOR_0", "TEXCOORD_0", "NORMAL", "TANGENT")
# Extensions without which a file looks otherwise but is no other mesh.
LOOKS = re.compile(r"KHR_(materials_|texture_|lights_|xmp)|EXT_texture_|KHR_mesh_quantization$")
# The axes of a model's file along X, Y and Z of glTF, by its direction of height: Y is up.
UPRIGHT = {
    "z": ("x", "z", "-y"), "y": ("x", "y", "z"), "x": ("-y", "x", "z"),
    "-z": ("x", "-z", "y"), "-y": ("x", "-y", "-z"), "-x": ("y", "-x", "z"),
}  # fmt: skip
# What extras repeat of a georeference, and what it is; and what they say of a unit that nobody knows.
STATED = {"epsg": int, "crs": str, "unit": str, "height_unit": str, "scale": list}
UNKNOWN = "unknown"
# What all nodes of one frame state alike.
FRAME = ("origin", "axes", "metres_per_unit", *STATED)


# ------------------------------------------------------------------------------------------------------------ reading


def read_gltf(path: Path, name: str, options: Options) -> SourceMesh:
    """Read all meshes of the scene as they lie there; a file of ours goes back into the frame that it states."""
    import dataclasses

    from meshsimp_pymoo.formats.source.scenes import read_scene

    tree, start = _check(path, name, packed=path.suffix.lower() == ".glb")
    source = read_scene(path, name, repeats="usual")  # wherever a texture or a normal has a seam
    attributes = dict(source.attributes)
    with _json_of(name):
        triangles = _triangles(tree, name)
        material = _material(path, tree, start, triangles, attributes, name)
        frame = _stated_frame(tree)
    if frame is None:  # in metres, by definition; whoever writes it again writes it as it lies
        points, facts = source.points, {"axes": list(UPRIGHT["y"]), "unit": "metre"}
    else:
        points, facts = (source.points @ frame.turn) / frame.scale + 0.0, frame.georeference
    return dataclasses.replace(source, points=points, attributes=attributes, georeference=facts, material=material)


@contextmanager
def _json_of(name: str) -> Iterator[None]:
    """Say in one line that the JSON part of a file is not what it should be."""
    try:
        yield
    except ModelError:
        raise
    except (ValueError, AttributeError, TypeError, LookupError, OverflowError, RecursionError) as error:
        raise ModelError(f"{name}: its JSON part cannot be read ({reason_of(error)}); export the file again") from error


def _check(path: Path, name: str, *, packed: bool) -> tuple[dict[str, Any], int]:
    """Refuse a glTF that declares more than its file can hold; return its tree, and where its binary part begins."""
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
            _check_chunks(stream, size, name)
            start = 20 + chunk + 8
        else:
            text = stream.read()
            start = size
    with _json_of(name):
        tree = json.loads(text)
        accessors = tree.get("accessors", [])
        # an accessor without a buffer view is all zeros: a few bytes that could ask for any amount of memory
        counts = [int(item.get("count", 0)) for item in accessors if "bufferView" not in item]
        outside = [uri for uri in _uris(tree) if not _is_beside(uri)]
        needed = [str(word) for word in tree.get("extensionsRequired", []) if not LOOKS.match(str(word))]
        needed += ["sparse accessors"] * any("sparse" in item for item in accessors)
        parts = [part for mesh in tree.get("meshes", []) for part in mesh["primitives"]]
        positions = {part["attributes"]["POSITION"] for part in parts}
        needed += ["normalized positions"] * any(accessors[k].get("normalized") for k in positions)
        vertices, triangles = _placed_sizes(tree)
        is_tree = _has_tree(tree)
    if outside:
        raise ModelError(f"{name}: names {outside[0][:80]!r}, which is outside its folder; export it as .glb")
    if not is_tree:
        raise ModelError(f"{name}: its nodes are no tree: some stand below two others or themselves; export it again")
    check_fits(vertices, triangles, name)
    if max(counts, default=0) > size:
        raise ModelError(f"{name}: declares {max(counts)} empty values in a file of {size} bytes; export it again")
    if needed:
        raise ModelError(f"{name}: needs {', '.join(needed)[:80]}, which is not read; export it without compression")
    return tree, start


def _check_chunks(stream: IO[bytes], size: int, name: str) -> None:
    """See that the chunks behind the first one lie in the file: room is made for them before they are read."""
    while len(head := stream.read(8)) == 8:
        (length,) = struct.unpack_from("<I", head)
        if length > size - stream.tell():
            raise ModelError(
                f"{name}: truncated: a chunk declares {length} bytes, but {size - stream.tell()} follow; copy it again"
            )
        stream.seek(length, 1)


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


def _triangles(tree: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Return the primitives that are triangles, and say what of the others and of their vertices is not read."""
    primitives = [part for mesh in tree.get("meshes", []) for part in mesh["primitives"]]
    triangles = [part for part in primitives if part.get("mode", GLTF_TRIANGLES) in (GLTF_TRIANGLES, GLTF_STRIP)]
    others: dict[str, int] = {}
    for part in triangles:
        further = [key for key in part["attributes"] if not key.startswith("_") and key not in CARRIED]
        further += ["morph targets"] * bool(part.get("targets"))
        further += ["TEXCOORD_0 without a material"] * ("TEXCOORD_0" in part["attributes"] and "material" not in part)
        for key in further:
            others[key] = others.get(key, 0) + 1
    words = [f"{key} of {count} primitive(s)" for key, count in sorted(others.items())]
    levels = [node.get("extensions", {}).get("MSFT_lod", {}).get("ids", []) for node in tree.get("nodes", [])]
    if coarser := sum(map(len, levels)):
        words.append(f"{coarser} coarser level(s) of detail")
    if len(triangles) < len(primitives):
        words.append(f"{len(primitives) - len(triangles)} primitive(s) that are no triangles")
    if words:
        warn_of(f"{name}: {', '.join(words)[:200]} stay behind")
    return triangles


def _material(
    path: Path, tree: dict[str, Any], start: int, triangles: list[dict[str, Any]], attributes: dict[str, Any], name: str
) -> Material | None:
    """Return the material of all triangles, if they have but one; remove texture coordinates that mean something else.

    ``start`` is where the binary part of a GLB begins.
    """
    from meshsimp_pymoo.formats.source.texture import checked_image

    used = {part.get("material") for part in triangles}
    if len(used) > 1:
        warn_of(f"{name}: its triangles are of {len(used)} materials, of which a mesh here has one; they stay behind")
    if len(used) != 1 or used == {None}:
        return None
    item = tree["materials"][used.pop()]
    surface = item.get("pbrMetallicRoughness", {})
    texture = surface.get("baseColorTexture", {})
    places = [tree["accessors"][part["attributes"]["TEXCOORD_0"]] for part in triangles if "uv" in attributes]
    elsewhere = texture.get("texCoord", 0) or "KHR_texture_transform" in texture.get("extensions", {})
    if any(place["componentType"] != GLTF_FLOAT for place in places) or (places and elsewhere):
        warn_of(f"{name}: its texture coordinates are packed, or another set counts; its texture stays behind")
        del attributes["uv"]
    image = b""
    if texture and "uv" in attributes:
        source = tree["textures"][texture["index"]].get("source")
        content = None if source is None else _image(path, tree, start, tree["images"][source], name)
        image = checked_image(content, name, str(source)) if content is not None else b""
        further = [f"{key}" for key in (*surface, *item) if key.endswith("Texture") and key != "baseColorTexture"]
        further += ["an image of an unknown kind"] * (source is None)
        if further:
            warn_of(f"{name}: of its material {', '.join(further)[:80]} stay behind")
    red, green, blue, opacity = (float(value) for value in surface.get("baseColorFactor", 4 * [1.0]))
    return Material(str(item.get("name") or Material.name), (red, green, blue, opacity), image)


def _image(path: Path, tree: dict[str, Any], start: int, image: dict[str, Any], name: str) -> bytes | None:
    """Return the file of an image, wherever a glTF has it."""
    if "bufferView" not in image:
        return _content(path, str(image["uri"]), name)
    view = tree["bufferViews"][image["bufferView"]]
    first, size = int(view.get("byteOffset", 0)), int(view["byteLength"])
    buffer = tree["buffers"][view["buffer"]]
    if "uri" in buffer:
        return (_content(path, str(buffer["uri"]), name) or b"")[first : first + size]
    with path.open("rb") as stream:
        stream.seek(start + first)
        return stream.read(min(size, path.stat().st_size))


def _content(path: Path, uri: str, name: str) -> bytes | None:
    import base64

    from meshsimp_pymoo.formats.source.texture import file_beside

    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return file_beside(path, uri, name, "image")


class _Frame(NamedTuple):
    """How coordinates of a file of ours came about: as ``turn @ (scale * those of the model)``."""

    turn: FloatArray
    scale: FloatArray
    georeference: dict[str, Any]


def _stated_frame(tree: dict[str, Any]) -> _Frame | None:
    """Return the frame that the nodes with meshes state in their extras, if all of them state the same."""
    import numpy as np

    stated = [node.get("extras") for node in tree.get("nodes", []) if "mesh" in node]
    if not stated or not all(isinstance(extras, dict) for extras in stated):
        return None
    extras = {key: stated[0].get(key) for key in FRAME}
    if any({key: other.get(key) for key in FRAME} != extras for other in stated):
        return None
    axes, scale = extras.get("axes"), extras.get("metres_per_unit")
    if not isinstance(axes, list) or tuple(axes) not in UPRIGHT.values():
        return None
    if not isinstance(scale, list) or len(scale) != 3 or not _are_lengths(scale):
        return None
    facts = {key: extras[key] for key, kind in STATED.items() if isinstance(extras.get(key), kind)}
    if not (len(facts.get("scale", [])) == 2 and _are_lengths(facts["scale"])):
        facts.pop("scale", None)
    if facts.get("unit") == UNKNOWN:
        del facts["unit"]
    return _Frame(turned(axes), np.array(scale, np.float64), facts)


def _are_lengths(values: list[Any]) -> bool:
    return all(type(value) in (int, float) and 0 < value < math.inf for value in values)


def turned(axes: Sequence[str]) -> FloatArray:
    """Return the rotation whose rows are axes with signs.

    >>> turned(["x", "z", "-y"]).tolist()
    [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    """
    import numpy as np

    turn = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        turn[row, "xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return turn


register(Format("gltf", (".gltf",), "glTF", read=read_gltf))
