"""Meshes that trimesh reads or writes: scenes of several meshes as one, corners that a format repeats merged."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, reason_of, warn_of
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.numbers import rgba_of, without_mark

if TYPE_CHECKING:
    import trimesh

    from meshsimp_pymoo.formats.outmesh import OutMesh

# trimesh logs what it cannot parse; without a handler Python would print that to stderr. Users' own handlers still get
# it.
logging.getLogger("trimesh").addHandler(logging.NullHandler())

# How the pixels of a PNG may be stored, as Pillow calls it.
PNG_MODES = ("1", "L", "LA", "P", "RGB", "RGBA")


def from_trimesh(mesh: trimesh.Trimesh, name: str = "mesh") -> SourceMesh:
    """Take over a ``trimesh.Trimesh``: its vertices in their order, their colours, texture and other attributes.

    Raises
    ------
    ModelError
        As :func:`~meshsimp_pymoo.formats.source.build_source`.

    Warns
    -----
    ModelWarning
        If faces have colours, which stay behind as all that is said of faces.
    """
    points, faces, attributes = _trimesh_arrays(mesh, name)
    material = _material_of(mesh.visual) if "uv" in attributes else None
    return build_source(points, faces, attributes, name, material=material)


def read_scene(path: Path, name: str, *, repeats: str = "said") -> SourceMesh:
    """Read a file as trimesh does; ``repeats`` as in :func:`~meshsimp_pymoo.formats.source.build_source`.

    Materials stay behind; who knows them adds one.

    Raises
    ------
    ModelError
        If trimesh cannot, or it holds no mesh.

    Warns
    -----
    ModelWarning
        If attributes could not be kept, and as :func:`~meshsimp_pymoo.formats.source.build_source`.
    """
    suffix = path.suffix.lower()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # older NumPy only warns when a number cannot be read
        warnings.filterwarnings("error", message="string or file could not be read")
        try:
            loaded = _loaded(path, suffix)
        except (OSError, MemoryError):
            raise
        except Exception as error:  # a damaged file may break the reader anywhere
            raise ModelError(
                f"{name}: cannot be read as {suffix} ({type(error).__name__}: {reason_of(error)}); "
                "export the file again"
            ) from error
    pieces = _scene_pieces(loaded, name)
    if not pieces:
        raise ModelError(f"{name}: holds no triangle mesh; export it with faces")
    points, faces, attributes = _concatenated(pieces, name)
    return build_source(points, faces, attributes, name, repeats=repeats)


def _loaded(path: Path, suffix: str) -> Any:
    """Return what trimesh makes of a file; it would stumble over a byte order mark, which is left out."""
    import trimesh

    with path.open("rb") as stream:
        head = stream.read(4)
    if without_mark(head) == head:
        return trimesh.load(str(path), process=False)
    content = io.BytesIO(without_mark(path.read_bytes()))
    beside = trimesh.resolvers.FilePathResolver(str(path))
    return trimesh.load(content, file_type=suffix.lstrip("."), resolver=beside, process=False)


def _trimesh_arrays(mesh: Any, name: str) -> tuple[FloatArray, IntArray, dict[str, AnyArray]]:
    points = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.array(mesh.faces)
    attributes = {
        str(key): np.array(values)
        for key, values in mesh.vertex_attributes.items()
        if np.ndim(values) > 0 and len(values) == len(points)
    }
    visual = mesh.visual
    if visual.kind == "face":
        warn_of(f"{name}: the colours of {len(faces)} faces stay behind; give colours to vertices")
    uv = getattr(visual, "uv", None)
    if uv is not None and np.ndim(uv) == 2 and np.shape(uv)[1] >= 2 and len(uv) == len(points):
        attributes["uv"] = np.array(uv[:, :2], dtype=np.float64)
    if visual.kind == "vertex":
        colors = np.asarray(visual.vertex_colors)
    else:  # a glTF with a material keeps its vertex colours beside it
        colors = np.asarray(getattr(visual, "vertex_attributes", {}).get("color", ()))
    if colors.ndim == 2 and len(colors) == len(points) and colors.shape[1] in (3, 4):
        if (color := rgba_of(list(colors.T))) is not None:
            attributes["color"] = color
    return points, faces, attributes


def _material_of(visual: Any) -> Material | None:
    """Return the material of a mesh in memory, its image as a PNG file."""
    import io

    material = getattr(visual, "material", None)
    if not any(hasattr(material, name) for name in ("baseColorTexture", "image")):
        return None
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    stream = io.BytesIO()
    if image is not None:
        (image if image.mode in PNG_MODES else image.convert("RGB")).save(stream, format="PNG")
    factor = getattr(material, "baseColorFactor", None)  # that of a SimpleMaterial is grey unless it is said
    red, green, blue, opacity = (1.0,) * 4 if factor is None else (np.asarray(factor, np.float64) / 255).tolist()
    name = str(getattr(material, "name", None) or Material.name)
    return Material(name, (red, green, blue, opacity), stream.getvalue())


def textured(attributes: Mapping[str, AnyArray], material: Material, plain: Any) -> Any:
    """Return how trimesh draws a mesh of this material, whose image lies at its attribute uv, else ``plain``."""
    import io

    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    try:
        image = Image.open(io.BytesIO(material.image)) if material.image else None
    except OSError:  # damaged, which costs nothing until it is drawn
        return plain
    look = PBRMaterial(name=material.name, baseColorFactor=material.color, baseColorTexture=image)
    visual = TextureVisuals(uv=attributes["uv"], material=look)
    if "color" in attributes:  # as trimesh itself keeps them of a glTF that has both
        visual.vertex_attributes["color"] = attributes["color"]
    return visual


def _scene_pieces(loaded: Any, name: str) -> list[tuple[FloatArray, IntArray, dict[str, AnyArray]]]:
    """Return the arrays of every mesh in a scene, placed where the scene has it."""
    if hasattr(loaded, "faces"):
        return [_trimesh_arrays(loaded, name)]
    if not hasattr(loaded, "graph"):  # a point cloud: vertices without faces
        points = np.array(getattr(loaded, "vertices", np.empty((0, 3))), dtype=np.float64)
        return [(points, np.empty((0, 3), np.int64), {})]
    pieces = []
    placed = _transforms(loaded.graph)
    for node in filter(placed.__contains__, loaded.graph.nodes_geometry):
        transform, geometry = placed[node], loaded.graph.transforms.node_data[node]["geometry"]
        mesh = loaded.geometry[geometry]
        if not hasattr(mesh, "faces"):
            continue
        points, faces, attributes = _trimesh_arrays(mesh, name)
        if not np.array_equal(transform, np.eye(4)):
            points = points @ transform[:3, :3].T + transform[:3, 3]
            if np.linalg.det(transform[:3, :3]) < 0:
                faces = faces[:, ::-1]
        pieces.append((points, faces, attributes))
    return pieces


def _transforms(graph: Any) -> dict[str, FloatArray]:
    """Return where each node of a scene is; trimesh multiplies its way down to it anew for each, in cubic time."""
    found = {graph.base_frame: np.eye(4)}
    todo = [graph.base_frame]
    while todo:
        node = todo.pop()
        for child in graph.transforms.children.get(node, ()):
            edge = graph.transforms.edge_data[node, child]
            found[child] = found[node] @ edge.get("matrix", np.eye(4))
            todo.append(child)
    return found


def _concatenated(
    pieces: list[tuple[FloatArray, IntArray, dict[str, AnyArray]]], name: str
) -> tuple[FloatArray, IntArray, dict[str, AnyArray]]:
    if len(pieces) == 1:
        return pieces[0]
    counts = [len(points) for points, _, _ in pieces]
    offsets = np.cumsum(counts) - counts
    attributes = {}
    for key in sorted({key for _, _, attributes in pieces for key in attributes}):
        parts = [attributes.get(key) for _, _, attributes in pieces]
        shapes = {None if part is None else (part.dtype, part.shape[1:]) for part in parts}
        if len(shapes) == 1:
            attributes[key] = np.concatenate([part for part in parts if part is not None])
        else:
            warn_of(f"{name}: only some of its {len(pieces)} meshes have the attribute {key!r}, which stays behind")
    faces = np.concatenate([piece[1] + offset for piece, offset in zip(pieces, offsets, strict=True)])
    return np.concatenate([piece[0] for piece in pieces]), faces, attributes


def export(path: Path, mesh: OutMesh) -> None:
    """Write a mesh and its colours as trimesh does, in the format of the path's suffix."""
    import trimesh

    exported = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.attributes.get("color"), process=False)
    written = exported.export(file_type=path.suffix.lower().lstrip("."))
    path.write_bytes(written.encode("utf-8") if isinstance(written, str) else bytes(written))
