"""One front is a ladder of levels of detail: what viewers are to know of its meshes to show each in its place.

Which meshes these are :meth:`~meshsimp_pymoo.front.Front.levels` says. Here they are written: as files of any format,
as one GLB (``MSFT_lod``), or as 3D Tiles; always with the geometric error of each, and what follows from it.

A level's *geometric error* is the largest deviation of its mesh, or of a finer one of the ladder if that is larger: a
viewer takes no coarser level to be better. Of a height surface it is vertical, of a closed one a distance in space; it
is that at the vertices of the original. Tiles on Earth, where the plane of a map is bent, add how far the flat
triangles lie below it.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.errors import ResultError, meant
from meshsimp_pymoo.files import claim_file, new_file, new_folder
from meshsimp_pymoo.formats.earth import Place, earth_centred, geodetic, place_at, sagitta
from meshsimp_pymoo.formats.glb import axes_of, metres_per_unit, upright, write_glb
from meshsimp_pymoo.formats.gltf import UPRIGHT
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import format_of_output, format_to_write, written_formats, written_suffixes
from meshsimp_pymoo.formats.tileset import TILESET, write_tileset
from meshsimp_pymoo.front import Front, FrontSolution
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.storage import MeshWriter, claim_output
from meshsimp_pymoo.surface.measures import Quality
from meshsimp_pymoo.surface.surface import Surface
from meshsimp_pymoo.surface.units import known_units, length_unit, metres_per_model_unit

__all__ = ["forms", "save_levels"]

# What a folder of levels is in beside the formats of meshes, and the format of one file and of tiles.
TILES = "3d-tiles"
GLB = "glb"
RECORD = "levels.json"
# The viewing rule: a level is shown while its geometric error is at most so many pixels of such a screen.
WIDTH, HEIGHT, PIXELS = 1920, 1080, 1.0
# By what share of its width the box around tiles is larger than they are: for single precision, and for what is flat.
ROUNDING = 1e-6
# What of a level's numbers is said.
SAID = ("triangles", "vertices", "mean_error", "rms_error", "max_error", "uncovered")
LARGEST = {
    False: "the largest vertical deviation at any vertex of the original",
    True: "the largest distance of any vertex of the original from the mesh",
}


def forms() -> list[str]:
    """Return what a folder of levels may hold: meshes of a format, or 3D Tiles."""
    return [*written_formats(), TILES]


@brief
@dataclass(frozen=True, eq=False)
class _Level:
    """A mesh of the ladder: its solution, and its numbers and vertices, which differ from those if it is refitted."""

    solution: FrontSolution
    quality: Quality
    vertices: FloatArray | None
    #: Its geometric error [model units].
    error: float


@dataclass(frozen=True, eq=False)
class _Ladder:
    """All levels of a front, the finest first."""

    front: Front
    levels: tuple[_Level, ...]

    @property
    def surface(self) -> Surface:
        return self.front.surface

    def screen_height(self, k: int) -> float:
        """Return how large a level may be shown: the diameter of the model as a share of the screen's height."""
        error = self.levels[k].error
        return PIXELS * self.surface.diagonal / (error * HEIGHT) if error > 0.0 else math.inf

    @property
    def coverage(self) -> list[float]:
        """The share of the screen that the ball around the model covers where each level gives way to the next.

        At most 1; the coarsest level gives way to nothing, 0.
        """
        heights = [self.screen_height(k) for k in range(1, len(self.levels))]
        return [min(math.pi / 4 * height**2 * HEIGHT / WIDTH, 1.0) for height in heights] + [0.0]

    def said(self, k: int) -> dict[str, Any]:
        """Return what is said of a level, as plain data."""
        level, height = self.levels[k], self.screen_height(k)
        own = level.solution.front is self.front  # else it was made between two that are stored
        return {
            "level": k,
            "solution": level.solution.solution if own else None,
            "free": level.solution.free,
            "refitted": level.vertices is not None,
            **{name: getattr(level.quality, name) for name in SAID},
            "geometric_error": level.error,
            "screen_height": height if math.isfinite(height) else None,
        }

    @property
    def record(self) -> dict[str, Any]:
        """What is said of all of them."""
        model, largest = self.surface.model, LARGEST[self.surface.view.is_closed]
        crs = model.georeference.get("crs")
        return {
            "model": Path(model.name).name,
            "hash": model.hash,
            "unit": self.unit,
            **known_units(model.georeference),
            **({"crs": crs} if crs else {}),
            "geometric_error": f"{largest}, and not below that of a finer level",
            "diameter": self.surface.diagonal,
            "screen": {"width": WIDTH, "height": HEIGHT, "pixels": PIXELS},
            "screen_height": "the diameter as a share of the screen's height up to which the geometric error is at "
            f"most {PIXELS:g} pixel(s)",
        }

    @property
    def unit(self) -> str:
        return length_unit(self.surface.model.georeference)

    def shown(self, mesh: OutMesh, numbers: dict[str, Any], **frame: Any) -> OutMesh:
        """Return a mesh as it is written: it says its numbers, and looks smooth."""
        return replace(mesh, extras={"unit": self.unit} | numbers, shaded=True, **frame)

    def meshes(self, writer: MeshWriter) -> Iterator[tuple[_Level, OutMesh]]:
        """Yield each level with its mesh, made when it is asked for."""
        for level in self.levels:
            yield level, writer.mesh(level.solution.faces, level.vertices)


def save_levels(
    front: Front,
    path: str | os.PathLike[str],
    levels: Sequence[FrontSolution] | None = None,
    *,
    form: str = "ply",
    compress: bool = False,
    refit: bool = False,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write some meshes of a front as levels of detail, whole or not at all.

    Parameters
    ----------
    front : Front
        The front.
    path : path
        A folder to make, with a file for each level, ``level-0`` the finest, and ``levels.json``, which says what is
        returned; or one file, ``.glb``, with all levels as ``MSFT_lod`` has them.
    levels : sequence of FrontSolution, optional
        Which; by default what :meth:`~meshsimp_pymoo.front.Front.levels` chooses.
    form : str
        Of a folder: a format of meshes, or ``"3d-tiles"``: a ``tileset.json`` with a GLB for each level.
    compress : bool
        Compress the meshes, which GLB can be (with the extra ``draco``): by that no vertex moves by more than a
        twentieth of the mean error of its mesh.
    refit : bool
        Move the vertices of each mesh to where its error is least.
    overwrite : bool
        Replace levels that exist.

    Returns
    -------
    dict
        What was written: the levels with their numbers, their geometric errors, and the rule to show them by.

    Raises
    ------
    ResultError
        If it cannot be written, or not in this form.
    ValueError
        If there are no levels, or no such form.

    Warns
    -----
    ModelWarning
        Of what a format loses of the meshes, once.
    """
    path = Path(path)
    chosen = sorted(front.levels() if levels is None else levels, key=lambda solution: -solution.triangles)
    if not chosen:
        raise ValueError("there are no levels; choose one or more solutions of the front")
    in_one = path.suffix.lower() in format_to_write(GLB).suffixes
    if not in_one and form not in forms():
        raise ValueError(f"form is {form!r}{meant(form, forms())}; it must be one of {', '.join(forms())}")
    if in_one:
        claim_file(path, format_to_write(GLB).suffixes, overwrite=overwrite)
    else:
        claim_levels(path, overwrite=overwrite)
    surface = front.surface
    writer = MeshWriter(format_to_write(GLB if in_one or form == TILES else form), surface, compress=compress)
    ladder = _Ladder(front, tuple(_with_errors(surface, chosen, refit=refit)))
    record = ladder.record | {"form": "MSFT_lod" if in_one else form}
    if in_one:
        with new_file(path) as unfinished:
            record["levels"] = _write_one(unfinished, ladder, writer)
    else:
        with new_folder(path, replace=overwrite) as partial:
            write = _write_tiles if form == TILES else _write_files
            record |= write(partial, ladder, writer)
            (partial / RECORD).write_bytes((json.dumps(record, indent=2, allow_nan=False) + "\n").encode())
    writer.warn()
    return record


def claim_levels(path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Check, before any work, that levels can be written to this folder.

    Raises
    ------
    ResultError
        If it cannot be made, exists, or, with ``overwrite``, holds anything but levels; or its name is that of a file.
    """
    if Path(path).suffix.lower() in written_suffixes():
        raise ResultError(
            f"{path}: one file holds levels as {GLB} alone; name a .glb, or a folder and its form "
            f"({format_of_output(path).name})"
        )
    claim_output(path, overwrite=overwrite, is_own=_is_own, what="part of levels of detail")


def _is_own(name: str) -> bool:
    return name in (RECORD, TILESET) or bool(re.fullmatch(r"level-\d+\.\w+", name))


def _with_errors(surface: Surface, chosen: Sequence[FrontSolution], *, refit: bool) -> Iterator[_Level]:
    """Yield levels, the finest first, each with its geometric error."""
    error = 0.0
    for solution in chosen:
        quality, vertices = solution.quality, None
        if refit:
            fitted = solution.refitted
            vertices = fitted.vertices
            compact = np.searchsorted(fitted.rows, fitted.faces)
            quality = surface.score(vertices, compact).quality
        error = max(error, quality.max_error)
        yield _Level(solution, quality, vertices, error)


def _packing(mesh: OutMesh) -> dict[str, float]:
    """Return what is said of a mesh that was compressed."""
    return {} if mesh.packed is None else mesh.packed.said


def _write_one(path: Path, ladder: _Ladder, writer: MeshWriter) -> list[dict[str, Any]]:
    """Write all levels as one GLB; return what is said of them."""
    meshes, said = [], []
    for k, (level, mesh) in enumerate(ladder.meshes(writer)):
        numbers = ladder.said(k) | {"coverage": ladder.coverage[k]}
        meshes.append(writer.packed(ladder.shown(mesh, numbers), level.quality.mean_error))
        said.append(numbers | _packing(meshes[-1]))
    write_glb(path, meshes, ladder.coverage)
    return said


def _write_files(folder: Path, ladder: _Ladder, writer: MeshWriter) -> dict[str, Any]:
    """Write a file for each level; return what is said of them."""
    said = []
    for k, (level, mesh) in enumerate(ladder.meshes(writer)):
        file = f"level-{k}{writer.kind.suffix}"
        numbers = ladder.said(k)
        written = writer.write(folder / file, ladder.shown(mesh, numbers), level.quality.mean_error)
        said.append({"file": file} | numbers | _packing(written))
    return {"levels": said}


def _write_tiles(folder: Path, ladder: _Ladder, writer: MeshWriter) -> dict[str, Any]:
    """Write a GLB for each level and the tileset; return what is said of them and of their frame."""
    model, metres = ladder.surface.model, metres_per_model_unit(ladder.surface.model.georeference)
    place, at = _place(ladder, writer), np.zeros(3)
    said: list[dict[str, Any]] = []
    errors: list[float] = []
    corners: list[FloatArray] = []
    for k, (level, mesh) in enumerate(ladder.meshes(writer)):
        points, at = _in_tile(mesh, place)
        below = 0.0 if place is None else sagitta(points, mesh.faces)
        errors.append(max([level.error * metres + below, *errors[-1:]]))
        file = f"level-{k}{writer.kind.suffix}"
        numbers = ladder.said(k) | {"below_the_bent_earth_m": below, "tile_error_m": errors[-1]}
        in_metres = {"origin": np.zeros(3), "georeference": {"unit": "metre"}, "up": None}
        tile = ladder.shown(mesh, numbers, vertices=points, **in_metres)
        written = writer.write(folder / file, tile, level.quality.mean_error)
        off = ROUNDING * float(np.ptp(points, axis=0).max()) + (0.0 if written.packed is None else written.packed.shift)
        corners += [points.min(axis=0) - off, points.max(axis=0) + off]
        said.append({"file": file} | numbers | _packing(written))
    where: dict[str, Any] = {"system": None}
    if place is not None:
        at = place.at
        where = {"system": "EPSG:4978", "longitude": place.longitude, "latitude": place.latitude}
        where |= {"height": place.height, "heights": "taken for ellipsoidal ones"}
    write_tileset(
        folder / TILESET,
        [level["file"] for level in said],
        errors,
        box=np.array([np.min(corners, axis=0), np.max(corners, axis=0)]),
        axes=np.eye(3) if place is None else place.axes,
        at=at,
        whole=ladder.surface.diagonal * metres,
        extras={"model": Path(model.name).name, "frame": where},
    )
    return {"frame": where, "levels": said}


def _place(ladder: _Ladder, writer: MeshWriter) -> Place | None:
    """Return the middle of the model on Earth, if it is known and z is its height."""
    model = ladder.surface.model
    mesh = writer.mesh(ladder.levels[-1].solution.faces)
    if axes_of(mesh) != UPRIGHT["z"]:
        return None
    middle = model.file_box.mean(axis=0)[None]
    height = float(metres_per_unit(model.georeference)[2])
    found = geodetic(model.georeference, middle, height, model.name)
    return None if found is None else place_at(*found[0].tolist())


def _in_tile(mesh: OutMesh, place: Place | None) -> tuple[FloatArray, FloatArray]:
    """Return the vertices (V, 3) in the frame of the tiles, z up, and where that is in the frame of the tileset [m]."""
    if place is None:
        points, at = upright(mesh)
        to_z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # as 3D Tiles turn a glTF
        return points @ to_z.T, to_z @ at
    height = float(metres_per_unit(mesh.georeference)[2])
    found = geodetic(mesh.georeference, mesh.vertices, height, mesh.name)
    if found is None:
        raise ResultError(f"{mesh.name}: its vertices have no place on Earth; write another form than {TILES}")
    return (earth_centred(found) - place.at) @ place.axes.T, place.at
