"""The files that a page makes of its meshes: what the package writes of one triangle, in which the page puts others.

So the page knows of a format only where the numbers stand; reference system, unit, local origin, axes and names are
said in the package's own words.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from typing import TYPE_CHECKING, Any

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, shared_frame, written_formats
from meshsimp_pymoo.reprs import brief

if TYPE_CHECKING:
    from meshsimp_pymoo.surface.surface import Surface

__all__ = ["Downloads", "downloads"]

# The formats that pages write, by the names that the table of formats has for them; their scripts are in meshfile.js.
WRITTEN = ("ply", "obj", "stl", "glb", "landxml")
# Those whose one file holds an image.
WITH_IMAGE = ("glb",)
TRIANGLE = np.array([[0, 1, 2]])


@dataclass(frozen=True)
class Downloads:
    """What the page offers.

    Attributes
    ----------
    titles : dict of str to str
        What people call each format that can hold the model, by the suffix of its files without the dot.
    templates : dict of str to (str, dict or list)
        What those scripts begin with that need more than the numbers.
    refused : list of str
        Why other formats are not offered, in a line each.
    """

    titles: dict[str, str]
    templates: dict[str, Any]
    refused: list[str]


@brief
@dataclass(frozen=True)
class _Held:
    """A model as the formats ask for it, of what is drawn of the original."""

    name: str
    file_points: FloatArray
    faces: IntArray
    georeference: Mapping[str, Any]


def downloads(
    surface: Surface, points: FloatArray, faces: IntArray, line_names: Sequence[str], folder: Path, *, is_textured: bool
) -> Downloads:
    """Return what a page offers of the meshes of a surface.

    Parameters
    ----------
    surface : Surface
        The original mesh and its rules.
    points : (V, 3) float array
        The vertices of the page [file units].
    faces : (M, 3) int array
        What is drawn of the original, as rows of these.
    line_names : sequence of str
        What messages call the break lines.
    folder : Path
        That of the front, which holds what is written on the way where there is no place for temporary files.
    is_textured : bool
        Whether the page has the image of the model and where on it vertices lie, for files that hold it.
    """
    model = surface.model
    held = _Held(model.name, points, faces, model.georeference)
    corners, attributes = points[faces[0]], {}
    if "color" in model.attributes:
        attributes["color"] = np.zeros((3, model.attributes["color"].shape[1]), np.uint8)
    found = Downloads({}, {}, [])
    for name in WRITTEN:
        kind = written_formats()[name]
        suffix = kind.suffixes[0].removeprefix(".")
        try:
            kind.check(held)
        except ResultError as refusal:
            reason = str(refusal).removeprefix(f"{model.name}: ").partition("; ")[0]
            found.refused.append(f"No {kind.title}: {reason}.")
            continue
        found.titles[suffix] = kind.title
        if name in TEMPLATES:
            holds_image = is_textured and name in WITH_IMAGE
            frame = shared_frame(
                kind,
                model.file_box,
                name=model.name,
                georeference=model.georeference,
                up=surface.view.rotation[2],
                material=model.material if holds_image else None,
            )
            held_there = attributes | ({"uv": np.zeros((3, 2))} if holds_image else {})
            lines = tuple(TRIANGLE[0, :2] for _ in line_names)
            mesh = OutMesh(corners, TRIANGLE, held_there, **frame, lines=lines, line_names=tuple(line_names))
            found.templates[suffix] = TEMPLATES[name](_written(kind, mesh, folder))
    return found


def _written(kind: Format, mesh: OutMesh, folder: Path) -> bytes:
    try:
        place = gettempdir()
    except OSError:
        place = str(folder)
    with TemporaryDirectory(dir=place) as made:
        path = Path(made, f"triangle{kind.suffixes[0]}")
        assert kind.write is not None
        kind.write(path, mesh)
        return path.read_bytes()


def _ply_template(content: bytes) -> list[str]:
    """Return the lines of a header, with 0 for the numbers of vertices, faces and edges."""
    header = content.partition(b"end_header\n")[0].decode("utf-8")
    return re.sub(r"^(element \w+) \d+$", r"\1 0", header, flags=re.MULTILINE).splitlines()


def _obj_template(content: bytes) -> list[str]:
    """Return the comments."""
    return [line for line in content.decode("utf-8").splitlines() if line.startswith("#")]


def _glb_template(content: bytes) -> dict[str, Any]:
    """Return the tree, of one node with one mesh."""
    (size,) = struct.unpack_from("<I", content, 12)
    tree: dict[str, Any] = json.loads(content[20 : 20 + size])
    return tree


def _landxml_template(content: bytes) -> dict[str, Any]:
    """Return what stands before the lines and the triangles and behind them, and how each break line begins."""
    text = content.decode("utf-8")
    before, _, definition = text.partition("<Definition")
    before, _, lines = before.partition("<SourceData>")
    return {
        "before": before,
        "definition": "<Definition" + definition.partition(" elevMin")[0],
        "after": "</Definition>" + definition.partition("</Definition>")[2],
        "lines": re.findall(r"<Breakline\b[^>]*>", lines),
    }


TEMPLATES = {"ply": _ply_template, "obj": _obj_template, "glb": _glb_template, "landxml": _landxml_template}
