"""What a tiled simplification leaves on disk, and how a mesh is taken from it.

::

    OUT/front.csv       as every front: one row per solution, sorted by triangles
    OUT/nested.npz      rows (V,): rows of the file that the finest solution keeps; level (V,): the slope at which
                        each goes; slope (S,): solution s keeps the rows of higher level; no pickles
    OUT/meshes/         007_412.ply is solution 7, of 412 triangles
    OUT/chosen.ply      the solution that was asked for, if one was; with pieces, a folder of that name
    OUT/run.json        settings, package versions, seconds, hash of the grid
    OUT/tiles/          while the work is going on: finished tiles, which the same call finds again

The finished folder is put in place as a whole; see `meshsimp_pymoo.results`.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.results import (
    FRONT_COLUMNS,
    MESH_FORMATS,
    MESHES_BY_DEFAULT,
    ResultError,
    _partial_folder,
    _path_from,
    _put_in_place,
    _read_csv,
    _spelled,
    _write_csv,
    _write_npz,
    even_selection,
    new_file,
    package_versions,
    write_mesh,
)
from meshsimp_pymoo.tiles.front import TiledFront
from meshsimp_pymoo.tiles.grid import HeightGrid
from meshsimp_pymoo.tiles.weld import WeldedMesh, pieces, weld

NESTED_FILE = "nested.npz"


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
    """Write a tiled front in place of the folder's unfinished tiles, all or nothing.

    Parameters
    ----------
    folder : path
        The folder to make; what is in it is replaced.
    front : TiledFront
        The front.
    meshes : int or None
        The most meshes to write, an even selection; None: all.
    mesh_format : str
        One of `meshsimp_pymoo.results.MESH_FORMATS`.
    chosen : int, optional
        Solution of ``front`` to write as ``chosen.<mesh_format>`` too.
    piece_size : int, optional
        Write the chosen mesh in pieces of about so many samples a side, as ``chosen/ROW_COLUMN.<mesh_format>``.
    run : mapping, optional
        What to record in run.json beside versions and grid.

    Raises
    ------
    ResultError
        If the folder cannot be written.
    """
    if mesh_format not in MESH_FORMATS:
        raise ValueError(f"mesh_format is {mesh_format!r}; it must be one of {', '.join(MESH_FORMATS)}")
    grid, count = front.grid, len(front)
    target = Path(folder).resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = _partial_folder(target)
    try:
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
                    path = f"meshes/{solution:0{digits}}_{quality.triangles}.{mesh_format}"
                    _write(partial / path, grid, mesh.samples, mesh.faces)
                if row == chosen:
                    _write_chosen(partial, grid, mesh, mesh_format, piece_size)
            numbers = [_spelled(column, getattr(quality, column)) for column in FRONT_COLUMNS[1:-1]]
            rows.append([str(solution), *numbers, path])
        _write_csv(partial / "front.csv", FRONT_COLUMNS, rows)
        _write_npz(
            partial / NESTED_FILE, rows=grid.source_rows(front.samples), level=front.level, slope=front.slope[::-1]
        )
        record = dict(run or {}) | {
            "model": {
                "name": grid.name,
                "file": _path_from(target, grid.name),
                "hash": grid.hash,
                "vertices": grid.n_samples,
                "triangles": grid.n_triangles,
                "rows": grid.shape[0],
                "columns": grid.shape[1],
            },
            "solutions": count,
            "chosen": None if chosen is None else count - 1 - chosen,
            "versions": package_versions(),
        }
        text = json.dumps(record, indent=2, allow_nan=False)
        (partial / "run.json").write_text(text + "\n", encoding="utf-8")
        _put_in_place(partial, target, Path(folder), overwrite=True)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    return Path(folder)


def _write_chosen(
    folder: Path, grid: HeightGrid, mesh: WeldedMesh, mesh_format: str, piece_size: int | None
) -> None:
    if piece_size is None:
        _write(folder / f"chosen.{mesh_format}", grid, mesh.samples, mesh.faces)
        return
    (folder / "chosen").mkdir()
    for row, column, samples, faces in pieces(grid, mesh, piece_size):
        _write(folder / "chosen" / f"{row:03}_{column:03}.{mesh_format}", grid, samples, faces)


def write_welded(path: Path, front: TiledFront, row: int) -> None:
    """Write the mesh of a solution in the format of the path's suffix, all or nothing."""
    mesh = weld(front.grid, front.kept(row))
    with new_file(path) as unfinished:
        _write(unfinished, front.grid, mesh.samples, mesh.faces)


def _write(path: Path, grid: HeightGrid, samples: npt.NDArray[np.int64], faces: npt.NDArray[np.int64]) -> None:
    write_mesh(path, grid.file_points(samples), faces, grid.attributes_at(samples))


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
    from meshsimp_pymoo.geometry.error import Quality

    folder = Path(folder)
    columns = _read_csv(folder / "front.csv")[0]
    record = _read_record(folder)
    if record["model"]["hash"] != grid.hash:
        raise ResultError(f"{folder}: is not a front of {grid.name}, whose heights or spacing are others")
    path = folder / NESTED_FILE
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            rows, level, slope = file["rows"], file["level"], file["slope"]
    except Exception as problem:  # absent, cut off or with flipped bits
        reason = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
        raise ResultError(f"{path}: cannot be read ({reason}); simplify again") from None
    if rows.shape != level.shape or len(slope) != len(columns["error"]) or rows.dtype.kind != "i":
        raise ResultError(f"{path}: does not belong to front.csv; simplify again")
    names = list(asdict(Quality(0.0, 0, 0, 0.0, 0.0, 0.0, 0)))
    table = zip(*(columns[name].tolist() for name in names), strict=True)
    quality = tuple(Quality(**dict(zip(names, row, strict=True))) for row in table)
    samples: npt.NDArray[np.int64] = grid.samples_of_rows(rows)
    return TiledFront(grid, samples, level, slope[::-1].copy(), quality[::-1])


def is_tiled(folder: str | os.PathLike[str]) -> bool:
    """Tell whether a folder holds a tiled front."""
    return (Path(folder) / NESTED_FILE).is_file()


def stored_model(folder: str | os.PathLike[str]) -> tuple[str, dict[str, Any]]:
    """Return where the grid of a stored tiled front was, and the settings it was read with."""
    record = _read_record(Path(folder))
    file = record["model"].get("file")
    settings = record.get("settings", {})
    name = record["model"]["name"] if file is None else str((Path(folder) / file).resolve())
    return name, {"up": settings.get("up", "auto")} | {key: settings.get(key) for key in ("spacing", "nodata")}


def _read_record(folder: Path) -> dict[str, Any]:
    path = folder / "run.json"
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(record["model"]["hash"], str):
            raise TypeError("the hash of its model is no text")
    except (OSError, ValueError, KeyError, TypeError) as problem:
        raise ResultError(f"{path}: cannot be read ({problem}); simplify again") from None
    return record
