"""What a tiled simplification leaves on disk, and how a mesh is taken from it.

::

    OUT/front.csv       as every front: one row per solution, sorted by triangles
    OUT/nested.npz      rows (V,): rows of the file that the finest solution keeps; level (V,): the slope at which
                        each goes; slope (S,): solution s keeps the rows of higher level, unless its vertices were
                        moved: moved_start (S + 1,): then it keeps moved[moved_start[s]:moved_start[s + 1]]; no pickles
    OUT/meshes/         007_412.ply is solution 7, of 412 triangles
    OUT/chosen.ply      the solution that was asked for, if one was; with pieces, a folder of that name
    OUT/front.png       the front
    OUT/run.json        the grid with its hash and where on Earth it is, how it was read (options), tiles and what was
                        wanted (settings), package versions, seconds
    OUT/tiles/          while the work is going on: finished tiles, which the same call finds again

The finished folder is put in place as a whole, and drawn then; see `meshsimp_pymoo.storage`. A process that is killed
at any moment leaves the tiles or the finished folder, and beside them what :func:`meshsimp_pymoo.files.put_back` knows.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import IntArray
from meshsimp_pymoo.errors import ResultError, reason_of
from meshsimp_pymoo.files import new_file, new_folder, path_from, write_csv, write_npz
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source.precision import single_precision_shift
from meshsimp_pymoo.formats.table import (
    Format,
    format_of_output,
    format_to_write,
    shared_frame,
    warn_of_left_behind,
    warn_of_shift,
    write_mesh,
)
from meshsimp_pymoo.settings import read_back
from meshsimp_pymoo.storage import (
    FRONT_COLUMNS,
    MESHES_BY_DEFAULT,
    even_selection,
    package_versions,
    read_front_csv,
    read_record,
    spelled_value,
)
from meshsimp_pymoo.tiles.front import TiledFront
from meshsimp_pymoo.tiles.grid import HeightGrid
from meshsimp_pymoo.tiles.weld import WeldedMesh, pieces, weld

NESTED_FILE = "nested.npz"
WORK = "tiles"
WAY_OUT = "what is finished stays there: mend that, and the same call goes on"


def write_tiled_front(
    folder: str | os.PathLike[str],
    front: TiledFront,
    *,
    meshes: int | None = MESHES_BY_DEFAULT,
    mesh_format: str = "ply",
    chosen: int | None = None,
    piece_size: int | None = None,
    run: Mapping[str, Any] | None = None,
) -> Path:
    """Write a tiled front in place of the folder's unfinished tiles, all or nothing, without pictures.

    Parameters
    ----------
    folder : path
        The folder to make; what is in it is replaced.
    front : TiledFront
        The front.
    meshes : int or None
        The most meshes to write, an even selection; None: all.
    mesh_format : str
        A name out of :func:`~meshsimp_pymoo.formats.table.written_formats`.
    chosen : int, optional
        Solution of ``front`` to write as ``chosen`` too.
    piece_size : int, optional
        Write the chosen mesh in pieces of about so many samples a side, as ``chosen/ROW_COLUMN`` and the suffix.
    run : mapping, optional
        What to record in run.json beside versions and grid.

    Raises
    ------
    ResultError
        If the folder cannot be written.
    """
    kind = format_to_write(mesh_format)
    grid, count = front.grid, len(front)
    if grid.model is not None:
        kind.check(grid.model)
    look = _frame(front, kind)
    target = Path(folder).resolve()
    with new_folder(folder, replace=True, way_out=WAY_OUT) as partial:
        with_mesh = set(even_selection(count, meshes))
        if with_mesh:
            (partial / "meshes").mkdir()
        digits = max(3, len(str(count - 1)))
        rows = []
        for solution in range(count):
            row = count - 1 - solution
            quality = front.quality[row]
            path = ""
            if solution in with_mesh or row == chosen:
                mesh = weld(grid, front.kept(row))
                if solution in with_mesh:
                    path = f"meshes/{solution:0{digits}}_{quality.triangles}{kind.suffix}"
                    _write(partial / path, grid, mesh.samples, mesh.faces, look)
                if row == chosen:
                    _write_chosen(partial, grid, mesh, kind.suffix, piece_size, look)
            numbers = [spelled_value(column, getattr(quality, column)) for column in FRONT_COLUMNS[1:-1]]
            rows.append([str(solution), *numbers, path])
        if with_mesh or chosen is not None:
            _warn(front, kind)
        write_csv(partial / "front.csv", FRONT_COLUMNS, rows)
        moved = [np.empty(0, np.int64) if new is None else grid.source_rows(new) for new in front.moved[::-1]]
        write_npz(
            partial / NESTED_FILE,
            rows=grid.source_rows(front.samples),
            level=front.level,
            slope=front.slope[::-1],
            moved=np.concatenate(moved),
            moved_start=np.cumsum([0, *map(len, moved)]),
        )
        record = dict(run or {}) | {
            "model": {
                "name": grid.name,
                "file": path_from(target, grid.name),
                "hash": grid.hash,
                "vertices": grid.n_samples,
                "triangles": grid.n_triangles,
                "rows": grid.shape[0],
                "columns": grid.shape[1],
                **({"georeference": grid.georeference} if grid.georeference else {}),
            },
            **({"mesh_origin": look["origin"].tolist()} if look["origin"].any() else {}),
            "solutions": count,
            "chosen": None if chosen is None else count - 1 - chosen,
            "versions": package_versions(),
        }
        text = json.dumps(record, indent=2, allow_nan=False)
        (partial / "run.json").write_text(text + "\n", encoding="utf-8")
    return Path(folder)


def _frame(front: TiledFront, kind: Format) -> dict[str, Any]:
    grid = front.grid
    points = grid.file_points(front.samples) if kind.states_origin else np.empty((0, 3))
    look = shared_frame(kind, points, name=grid.name, georeference=grid.georeference)
    return look if grid.model is None else look | {"up": grid.model.up, "material": grid.model.material}


def _warn(front: TiledFront, kind: Format) -> None:
    if front.grid.model is not None:
        warn_of_left_behind(kind, front.grid.name, front.grid.model.attributes)
    if not kind.single_precision:
        return
    points = front.grid.file_points(front.samples)
    scale = np.array([*front.grid.georeference.get("scale", (1.0, 1.0)), 1.0])
    diagonal = float(np.linalg.norm(np.ptp(points * scale, axis=0)))
    warn_of_shift(kind, front.grid.name, diagonal, single_precision_shift(points, scale))


def _write_chosen(
    folder: Path, grid: HeightGrid, mesh: WeldedMesh, suffix: str, piece_size: int | None, look: dict[str, Any]
) -> None:
    if piece_size is None:
        _write(folder / f"chosen{suffix}", grid, mesh.samples, mesh.faces, look)
        return
    (folder / "chosen").mkdir()
    for row, column, samples, faces in pieces(grid, mesh, piece_size):
        _write(folder / "chosen" / f"{row:03}_{column:03}{suffix}", grid, samples, faces, look)


def write_welded(path: Path, front: TiledFront, row: int) -> None:
    """Write the mesh of a solution in the format of the path's suffix, all or nothing."""
    kind = format_of_output(path)
    if front.grid.model is not None:
        kind.check(front.grid.model)
    mesh = weld(front.grid, front.kept(row))
    _warn(front, kind)
    with new_file(path) as unfinished:
        _write(unfinished, front.grid, mesh.samples, mesh.faces, _frame(front, kind))


def _write(path: Path, grid: HeightGrid, samples: IntArray, faces: IntArray, look: dict[str, Any]) -> None:
    write_mesh(path, grid.file_points(samples), faces, grid.attributes_at(samples), **look)


def read_tiled_front(folder: str | os.PathLike[str], grid: HeightGrid) -> TiledFront:
    """Read a tiled front back.

    Parameters
    ----------
    folder : path
        What :func:`write_tiled_front` wrote.
    grid : HeightGrid
        The grid that it was made of.

    Raises
    ------
    ResultError
        If a file is missing or damaged, or the grid is another one.
    """
    from meshsimp_pymoo.surface.measures import MEASURES, quality_of

    folder = Path(folder)
    columns, record = read_front_csv(folder / "front.csv")[0], record_of(folder)
    if record["model"]["hash"] != grid.hash:
        raise ResultError(f"{folder}: is not a front of {grid.name}, whose heights or spacing are others")
    path = folder / NESTED_FILE
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            rows, level, slope = file["rows"], file["level"], file["slope"]
            moved, start = file["moved"], file["moved_start"]
    except Exception as problem:  # absent, cut off or with flipped bits
        raise ResultError(f"{path}: cannot be read ({reason_of(problem)}); simplify again") from None
    fits = rows.shape == level.shape and len(slope) == len(columns["error"]) == len(start) - 1
    if not fits or {rows.dtype.kind, moved.dtype.kind, start.dtype.kind} != {"i"} or start[-1] != len(moved):
        raise ResultError(f"{path}: does not belong to front.csv; simplify again")
    table = zip(*(columns[name].tolist() for name in MEASURES), strict=True)
    quality = tuple(quality_of(zip(MEASURES, row, strict=True)) for row in table)
    samples: IntArray = grid.samples_of_rows(rows)
    found = [grid.samples_of_rows(part) if len(part) else None for part in np.split(moved, start[1:-1])]
    return TiledFront(grid, samples, level, slope[::-1].copy(), quality[::-1], tuple(found[::-1]))


def is_tiled(folder: str | os.PathLike[str]) -> bool:
    """Tell whether a folder holds a tiled front."""
    return (Path(folder) / NESTED_FILE).is_file()


def record_of(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the record of a stored tiled front; see :func:`~meshsimp_pymoo.storage.read_record`."""
    return read_record(Path(folder) / "run.json", len(read_front_csv(Path(folder) / "front.csv")[1]))


def stored_model(folder: str | os.PathLike[str]) -> tuple[str, Options]:
    """Return where the grid of a stored tiled front was, and how it was read."""
    record = record_of(folder)
    file = record["model"].get("file")
    name = record["model"]["name"] if file is None else str((Path(folder) / file).resolve())
    try:
        return name, read_back(Options, record.get("options") or {})
    except ValueError as problem:
        raise ResultError(f"{Path(folder) / 'run.json'}: cannot be read ({problem}); simplify again") from None
