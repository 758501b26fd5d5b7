"""What a simplification leaves on disk: written whole or not at all, read back with every number checked.

::

    OUT/front.csv      one row per solution, sorted by triangles; the columns are FRONT_COLUMNS
    OUT/meshes/        007_412.ply is solution 7, of 412 triangles; see the column ``mesh``
    OUT/chosen.ply     the solution that was asked for, if one was
    OUT/refitted/      the meshes with their best heights (of a closed surface: their best vertices), if asked for, and
                       OUT/chosen_refitted.ply; front.csv then has the columns REFIT_COLUMNS too
    OUT/break_lines.geojson  the thinned break lines, which every mesh has as chains of edges, if the model has lines;
                       front.csv then has the columns OF_LINES too
    OUT/series.csv     other fronts to compare with, if there are some (what the search started from); SERIES_COLUMNS
    OUT/front.npz      F (S, 2), kept (S, ceil(N / 8)) as packed bits, source_index (N,); faces (M, 3), the triangles of
                       all free meshes, of which solution s has those from face_start[s] to face_start[s + 1],
                       face_start (S + 1,); none: it is the mesh that its surface makes of what it keeps. Of a closed
                       surface xy (N, 2) too, the images of its vertices. Of a nested front (one made
                       by tiles) F and rows (V,), which the largest solution keeps, level (V,), at which each goes,
                       slope (S,): solution s keeps the rows of higher level, unless moved_start (S + 1,) gives it a
                       part of moved. No pickles
    OUT/run.json       the model with its hash, how it was read (options), what counted (rules), what was minimised
                       (objectives), how it was searched and written (settings, seed), package versions, the machine
                       (environment), when the search was begun, evaluations, moves, seconds; of a front that was
                       freed afterwards how (freeing)
    OUT/front.png      the front beside some of its meshes; OUT/report.html: the page to look and choose
    OUT/quality.json   how accurate the chosen mesh is, if one was asked for; OUT/quality.html: the page to sign. Of any
                       mesh in OUT/quality, where `meshsimp quality` writes it
    OUT/checkpoint.npz alone, while a search goes on or after it was killed (see `meshsimp_pymoo.search.checkpoint`)
    OUT/tiles/         alone, likewise: finished tiles (see `meshsimp_pymoo.tiles.front`)

All but run.json (which holds the time taken) and report.html (which names the folder) are the same bytes again for
the same front. Floats are written with the fewest digits that read back to the same number. Everything is written to a
hidden folder beside OUT, flushed to the disk and then renamed, so that OUT is either complete or absent.
"""

from __future__ import annotations

import csv
import itertools
import json
import math
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray, IntArray, are_distinct, spread
from meshsimp_pymoo.errors import ModelError, ResultError, reason_of
from meshsimp_pymoo.files import (
    new_folder,
    partial_folder,
    path_from,
    read_npz,
    stays_inside,
    write_csv,
    write_npz,
)
from meshsimp_pymoo.formats.material import is_put_beside
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.source.lines import SourceLines
from meshsimp_pymoo.formats.table import (
    Format,
    Rounding,
    format_of_output,
    format_to_write,
    listed,
    shared_frame,
    warn_of_left_behind,
    write_lines,
    write_mesh,
    written_formats,
)
from meshsimp_pymoo.plane.faces import is_canonical, used_rows
from meshsimp_pymoo.surface.kinds import stored_arrays
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.measures import COUNTED, LENGTH, MEASURES, OF_LINES, OF_MESH, Quality, checked_objectives
from meshsimp_pymoo.surface.nested import Nested
from meshsimp_pymoo.surface.rules import is_file_of_lines
from meshsimp_pymoo.surface.smallest import facts_of_lines
from meshsimp_pymoo.surface.solid import as_solid, check_solid
from meshsimp_pymoo.surface.surface import Refitted, Surface, free_faces, mesh_arrays, mesh_lines, require_rules
from meshsimp_pymoo.surface.units import length_unit, metres_per_model_unit

# What only a mesh says is empty where nobody has measured it. ``free``: 1 where the edges of a mesh are chosen for the
# error, 0 where it is Delaunay.
FRONT_COLUMNS = (
    "solution", *(name for name, measure in MEASURES.items() if measure.of is not None), "mesh", *OF_MESH, "free",
)  # fmt: skip
# Behind them, only where the model has break lines: OF_LINES. Then
REFIT_COLUMNS = ("refitted_error", "refitted_mesh")  # only where meshes were refitted; empty where none was written
# The error of other fronts is what was minimised: the sum, or another measure if one was asked for.
SERIES_COLUMNS = ("series", "minimised", "triangles")
INT_COLUMNS = ("solution", *COUNTED, "free")
MAY_BE_EMPTY = (*OF_MESH, *OF_LINES, "refitted_error")
MOST_COUNTED = 2**53  # no mesh has so many triangles
# What writing a mesh takes at first thought, for each vertex of the model and triangle of the mesh [s].
SECONDS_A_CORNER = 5e-7
# How far compression may move a vertex, as a share of the mean error of its mesh.
COMPRESSION_SHARE = 0.05
MESHES_BY_DEFAULT = 100  # a front of the usual population in full; of a longer one an even selection of this many
PICTURES = ("front.png", "report.html")  # made once all else is in place
STATEMENT = ("quality.json", "quality.html")  # of the chosen mesh, made likewise, if there is one
QUALITY = "quality"  # where a statement of any mesh is written by default
CHECKPOINT = "checkpoint.npz"  # the state of a search that is not finished
TILES = "tiles"  # finished tiles of one
LINES = "break_lines.geojson"  # the thinned break lines
# A mesh: vertices (V, 3), faces (M, 3), attributes by name.
MeshArrays: TypeAlias = tuple[FloatArray, IntArray, dict[str, AnyArray]]
OWN_ENTRIES = (
    "front.csv", "front.npz", "run.json", "meshes", *PICTURES,
    "tables", "figures", "times.csv", "refitted",
    TILES, "series.csv", LINES, *STATEMENT, QUALITY,
)  # fmt: skip
CHOSEN = ("chosen", "chosen_refitted")  # stems of the files of the solution that was asked for
PACKAGES = ("meshsimp-pymoo", "pymoo", "moocore", "numpy", "scipy", "numba", "trimesh")


@dataclass(frozen=True, eq=False)
class StoredFront:
    """A front read back from its folder.

    Attributes
    ----------
    folder : Path
        Where it was read.
    quality : dict of str to (S,) array
        The numbers of front.csv by column, sorted by triangles.
    kept : (S, N) bool array, or Nested
        The chromosomes, in vector order; or rows of the file.
    source_index : (N,) int array
        Row of each vertex in the model's file; empty where ``kept`` says rows.
    meshes : tuple of str
        Path of each solution's mesh relative to the folder; empty where it was not written.
    run : dict
        The content of run.json.
    refitted_error : (S,) float array, optional
        The error of the refitted meshes, NaN where it was not computed; None if none was refitted.
    refitted_meshes : tuple of str
        Path of each refitted mesh, relative to the folder; empty where there is none.
    series : dict of str to (n, 2) float array
        Other fronts to compare with: the error that was minimised [model units] and triangles, by name.
    faces : tuple of (M, 3) int32 array or None
        The triangles of each solution that is a free mesh, as rows of the model's vertices; None of the others.
    images : (N, 2) float array, optional
        The images of the vertices of a closed surface in the plane, in vector order.
    """

    folder: Path
    quality: dict[str, npt.NDArray[Any]]
    kept: BoolArray | Nested
    source_index: IntArray
    meshes: tuple[str, ...]
    run: dict[str, Any] = field(default_factory=dict)
    refitted_error: FloatArray | None = None
    refitted_meshes: tuple[str, ...] = ()
    series: dict[str, FloatArray] = field(default_factory=dict)
    faces: tuple[IntArray | None, ...] = ()
    images: FloatArray | None = None

    def __repr__(self) -> str:
        T, error = self.quality["triangles"], self.quality["error"]
        return (
            f"<StoredFront {self.folder}: {len(T):,} solutions, {T[0]:,} to {T[-1]:,} triangles, error {error[0]:.6g} "
            f"to {error[-1]:.6g}>"
        )

    @property
    def F(self) -> FloatArray:
        """The objectives, (S, 2): error [model units] and triangles."""
        return np.column_stack([self.quality["error"], self.quality["triangles"]]).astype(np.float64)


def claim_output(
    folder: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    is_own: Callable[[str], bool] | None = None,
    what: str = "result of meshsimp",
) -> Path:
    """Check, before any work, that results can be written to this folder; nothing is left behind.

    Parameters
    ----------
    folder : path
        The folder to be made. Missing parents are made when the results are written.
    overwrite : bool
        Accept a folder that holds results of this package already; they are replaced when the new ones are
        complete.
    is_own : callable, optional
        Tells of the name of an entry whether it is one of these results; by default those of a search.
    what : str
        What such an entry is.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ResultError
        If it exists (or, with ``overwrite``, holds anything that is not ours), or cannot be made.
    """
    folder = Path(folder)
    target = folder.resolve()
    if target.exists() and not target.is_dir():
        raise ResultError(f"{folder}: is a file; name a new folder")
    if target.exists():
        if not overwrite:
            raise ResultError(f"{folder}: exists already; name another folder or allow overwriting (--overwrite)")
        known = is_own or _is_own
        foreign = sorted(e.name for e in target.iterdir() if not (known(e.name) or is_put_beside(e.name)))
        if foreign:
            raise ResultError(
                f"{folder}: holds {foreign[0]}, which is no {what}, and would be deleted with the rest; "
                "name another folder"
            )
    parent = target.parent
    while not parent.exists():
        parent = parent.parent
    try:
        partial_folder(parent / target.name).rmdir()
    except OSError as problem:
        raise ResultError(
            f"{folder}: cannot be written in {parent} ({reason_of(problem)}); name another folder"
        ) from None
    return folder


def _is_own(name: str) -> bool:
    return name in OWN_ENTRIES or Path(name).stem in CHOSEN or _of_unfinished(name)


def is_unfinished(folder: str | os.PathLike[str]) -> bool:
    """Tell whether a folder is there and holds nothing but what a search leaves that was killed."""
    return Path(folder).is_dir() and all(_of_unfinished(entry.name) for entry in Path(folder).iterdir())


def _of_unfinished(name: str) -> bool:
    stem = Path(CHECKPOINT).stem
    return name == CHECKPOINT or (name.startswith(f".{stem}.") and ".partial" in name)


def write_front(
    folder: str | os.PathLike[str],
    surface: Surface,
    quality: Sequence[Quality],
    kept: BoolArray | Nested,
    *,
    faces: Callable[[int], IntArray] | None = None,
    free: Sequence[IntArray | None] = (),
    meshes: int | None = MESHES_BY_DEFAULT,
    mesh_format: str = "ply",
    chosen: int | None = None,
    cut: Callable[[IntArray], Iterable[tuple[str, IntArray]]] | None = None,
    refit: Callable[[int], Refitted | None] | None = None,
    solid: float | None = None,
    series: Mapping[str, npt.ArrayLike] | None = None,
    run: Mapping[str, Any] | None = None,
    overwrite: bool = False,
    until: float | None = None,
) -> Path:
    """Write a front, its meshes and the record of its run to a new folder, all or nothing, without pictures.

    Parameters
    ----------
    folder : path
        The folder to make; see :func:`claim_output`.
    surface : Surface
        The original mesh and its rules.
    quality : sequence of Quality, length S
        The numbers of each solution, in any order; written sorted by triangles, then error.
    kept : (S, N) bool array, or Nested
        The solutions in vector order; or by rows of the file.
    faces : callable, optional
        Triangles (M, 3) of the solution in this row of ``kept``, as indices in vector order. Needed for
        meshes.
    free : sequence of (M, 3) int32 array or None, length S, optional
        The triangles of each solution that is a free mesh, in their one spelling (see
        :func:`~meshsimp_pymoo.surface.surface.checked_faces`); None of the others, as it is of all by default.
    meshes : int or None
        The most meshes to write; a longer front writes an even selection, its ends included. None writes all,
        0 none.
    mesh_format : str
        A name out of :func:`~meshsimp_pymoo.formats.table.written_formats`. PLY (binary, double precision) keeps every
        attribute; OBJ, OFF and LandXML keep full precision; STL and GLB are single precision by definition, GLB from an
        origin that it states (see :func:`~meshsimp_pymoo.formats.table.write_mesh`).
    chosen : int, optional
        Row of ``kept`` to write as ``chosen.<mesh_format>`` too.
    cut : callable, optional
        Cuts the triangles (M, 3) of the chosen mesh into pieces, each with a name: they are written to a folder
        ``chosen`` instead.
    refit : callable, optional
        The refitted mesh of the solution in this row of ``kept`` (see ``refit`` of its surface). Each mesh that is
        written is then written refitted too, as a file of its own, and ``front.csv`` has two more columns,
        REFIT_COLUMNS. None where there is none.
    solid : float, optional
        The chosen mesh is closed by walls and a base so far below its lowest point [file units]; see
        :mod:`~meshsimp_pymoo.surface.solid`. What it encloses is recorded.
    series : mapping of str to (n, 2) array, optional
        Other fronts to compare with, by name: the error that was minimised [model units] and triangles. They are
        written to ``series.csv``.
    run : mapping, optional
        What to record in run.json beside the package versions and the model.
    overwrite : bool
        Replace results that exist.
    until : float, optional
        Meshes that would not be written by ``perf_counter() = until`` are left out, but for that of ``chosen``.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ResultError
        If the folder cannot be written.
    ValueError
        If the front is empty, holds a number that is not finite, or does not fit the model.
    """
    require_rules(surface, "write_front")
    model = surface.model
    if len(quality) == 0:
        raise ValueError("the front is empty; there is nothing to write")
    if not isinstance(kept, Nested):
        kept = np.asarray(kept, dtype=bool)
        if kept.shape != (len(quality), model.n_vertices):
            raise ValueError(
                f"kept has the shape {kept.shape}; {len(quality)} solutions of a model of {model.n_vertices} vertices "
                f"need {(len(quality), model.n_vertices)}"
            )
    kind = format_to_write(mesh_format)
    kind.check(model)
    if solid is not None:
        check_solid(surface, solid, kind)
        if cut is not None:
            raise ResultError(f"{model.name}: a solid is one piece; leave the pieces out, or the solid")
    look = _look(kind, surface)
    F = np.array([[q.error, q.triangles] for q in quality], dtype=np.float64)
    if not np.isfinite(F).all():
        raise ValueError(f"solution {int(np.argmin(np.isfinite(F).all(axis=1)))} has an error that is not finite")
    order = np.lexsort((F[:, 0], F[:, 1]))
    own = tuple(free) or (None,) * len(order)
    if len(own) != len(order):
        raise ValueError(f"free has {len(own)} entries for {len(order)} solutions; give None for Delaunay meshes")
    if isinstance(kept, Nested) and any(faces_of is not None for faces_of in own):
        raise ValueError("solutions by rows of the file, as of tiles, are Delaunay meshes; give none that is free")
    with_mesh = set(even_selection(len(order), meshes))
    if (with_mesh or chosen is not None) and faces is None:
        raise ValueError("meshes are asked for but no faces are given; pass faces= or meshes=0")

    folder = claim_output(folder, overwrite=overwrite)
    target = folder.resolve()
    with new_folder(folder, replace=overwrite) as partial:
        digits = max(3, len(str(len(order) - 1)))
        files: dict[int, tuple[str, list[str]]] = {}
        facts_of_solid: dict[str, Any] = {}
        rounding, pace = Rounding(kind), SECONDS_A_CORNER
        if with_mesh:
            (partial / "meshes").mkdir()
            if refit is not None:
                (partial / "refitted").mkdir()
        todo = sorted(with_mesh.union([] if chosen is None else np.flatnonzero(order == chosen).tolist()))
        if (
            until is not None
        ):  # as many as there is time for, spread over the front; the largest takes longest: it is last
            todo = [todo[k] for k in spread(len(todo) - 1)] + todo[-1:]
        for solution in todo:
            row, path, fitted = order[solution], "", ["", ""]
            begun, size = time.perf_counter(), model.n_vertices + quality[row].triangles
            if until is not None and row != chosen and begun + pace * size > until:
                continue
            assert faces is not None
            triangles = faces(int(row))
            arrays, shown = mesh_arrays(model, triangles), look | _lines_as_written(surface, triangles)
            rounding.add(OutMesh(*arrays, **shown), surface.view.scale)
            if solution in with_mesh:
                path = f"meshes/{solution:0{digits}}_{quality[row].triangles}{kind.suffix}"
                write_mesh(partial / path, *arrays, **shown)
            if row == chosen and cut is not None:
                (partial / "chosen").mkdir()
                for name, part in cut(triangles):
                    write_mesh(partial / "chosen" / f"{name}{kind.suffix}", *mesh_arrays(model, part), **look)
            elif row == chosen:
                closed, facts_of_solid = _closed(surface, triangles, arrays, solid)
                write_mesh(partial / f"chosen{kind.suffix}", *closed, **shown)
            better = None if refit is None else refit(int(row))
            if better is not None:
                raised = (better.vertices, *arrays[1:])
                rounding.add(OutMesh(*raised, **shown), surface.view.scale)
                fitted = [spelled_value("error", better.error), path.replace("meshes/", "refitted/")]
                if solution in with_mesh:
                    write_mesh(partial / fitted[1], *raised, **shown)
                if row == chosen:
                    closed, _ = _closed(surface, triangles, raised, solid)
                    write_mesh(partial / f"chosen_refitted{kind.suffix}", *closed, **shown)
            files[solution] = path, fitted
            pace = max(pace, (time.perf_counter() - begun) / size)
        lines = getattr(model, "lines", None)  # which a model of another kind need not have
        own_lines = () if lines is None else OF_LINES
        rows = []
        for solution, row in enumerate(order):
            path, fitted = files.get(solution, ("", ["", ""]))
            cells = {name: spelled_value(name, getattr(quality[row], name)) for name in MEASURES}
            cells |= {"solution": str(solution), "mesh": path, "free": str(int(own[row] is not None))}
            rows.append([cells[column] for column in FRONT_COLUMNS + own_lines] + fitted * (refit is not None))
        rounding.warn(model.name, surface.diagonal)
        if with_mesh or chosen is not None:
            warn_of_left_behind(kind, model.name, model.attributes)
        columns = FRONT_COLUMNS + own_lines + REFIT_COLUMNS * (refit is not None)
        write_csv(partial / "front.csv", columns, rows)
        if lines is not None:
            write_lines(partial / LINES, _thinned_lines(model, lines))
        if series:
            write_csv(partial / "series.csv", SERIES_COLUMNS, list(_series_rows(series)))
        if isinstance(kept, Nested):
            arrays_of: dict[str, AnyArray | list[AnyArray]] = {**kept.take(order.tolist()).arrays()}
        else:
            parts = [np.empty((0, 3), np.int32) if own[row] is None else own[row] for row in order]
            arrays_of = {
                "kept": np.packbits(kept[order], axis=1),
                "source_index": np.asarray(model.source_index, np.int64),
                "faces": parts,
                "face_start": np.cumsum([0, *map(len, parts)]),
            }
            arrays_of |= stored_arrays(surface)
        write_npz(partial / "front.npz", F=F[order], **arrays_of)
        shape = getattr(model, "shape", None)  # of a height grid
        unit = length_unit(model.georeference)
        record = dict(run or {}) | {
            "model": {
                "name": model.name,
                "file": path_from(target, model.name),
                "hash": model.hash,
                **({} if unit == LENGTH else {"unit": unit}),
                "vertices": model.n_vertices,
                "triangles": len(model.faces),
                "up": surface.view.rotation[2],
                **({"found": model.found} if model.found else {}),
                **({"georeference": model.georeference} if model.georeference else {}),
                **({"material": True} if model.material is not None else {}),
                **({"rows": shape[0], "columns": shape[1]} if shape is not None else {}),
                **({} if lines is None else {"lines": _facts_of_lines(surface, lines, target)}),
            },
            **({"mesh_origin": look["origin"]} if look["origin"].any() else {}),
            "solutions": len(order),
            "chosen": None if chosen is None else int(np.flatnonzero(order == chosen)[0]),
            **({"solid": facts_of_solid} if facts_of_solid else {}),
            "versions": package_versions(),
            "environment": machine(),
        }
        (partial / "run.json").write_text(
            json.dumps(record, indent=2, default=_plain, allow_nan=False) + "\n", encoding="utf-8"
        )
    return folder


def read_front(folder: str | os.PathLike[str]) -> StoredFront:
    """Read a front back and check that its files are whole and agree.

    Parameters
    ----------
    folder : path
        What :func:`write_front` wrote.

    Raises
    ------
    ResultError
        If a file is missing, damaged or contradicts another; the message names the file and what is wrong in
        it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ResultError(f"{folder}: no such folder")
    if not (folder / "front.csv").exists():
        raise ResultError(f"{folder}: holds no front (front.csv is missing); name the folder that simplify -o made")
    quality, meshes, refitted_meshes = read_front_csv(folder / "front.csv")
    refitted_error = quality.pop("refitted_error", None)
    count = len(meshes)
    F, kept, source_index, parts, images = _read_npz(folder / "front.npz", count)
    if F.shape != (count, 2) or not (
        np.array_equal(F[:, 0], quality["error"]) and np.array_equal(F[:, 1], quality["triangles"])
    ):
        raise ResultError(f"{folder / 'front.npz'}: its F is not that of front.csv; write the front again")
    sizes = kept.sizes if isinstance(kept, Nested) else kept.sum(axis=1)
    too_few = np.flatnonzero(sizes < quality["vertices"])
    if too_few.size:
        raise ResultError(
            f"{folder / 'front.npz'}: solution {too_few[0]} keeps {sizes[too_few[0]]} vertices, but "
            f"front.csv says its mesh has {quality['vertices'][too_few[0]]}"
        )
    faces = tuple(_own_faces(folder / "front.npz", quality, kept, parts))
    run = read_record(folder / "run.json", count)
    series = _read_series(folder / "series.csv")
    return StoredFront(
        folder, quality, kept, source_index, meshes, run, refitted_error, refitted_meshes, series, faces, images
    )


def _own_faces(
    path: Path, quality: Mapping[str, AnyArray], kept: BoolArray | Nested, parts: Sequence[IntArray]
) -> Iterator[IntArray | None]:
    """Yield the triangles of free meshes, None of others, if they are what front.csv says and use what is kept."""
    for solution, (is_free, faces) in enumerate(zip(quality["free"].tolist(), parts, strict=True)):
        if is_free != (len(faces) > 0):
            raise ResultError(
                f"{path}: holds {len(faces)} faces of solution {solution}, whose free is {is_free} in front.csv; write "
                "the front again"
            )
        if not is_free:
            yield None
            continue
        assert not isinstance(kept, Nested)
        said = {name: int(quality[name][solution]) for name in ("triangles", "vertices")}
        try:
            found = free_faces(faces, kept[solution], **said)
            if not is_canonical(faces):
                raise ValueError("its faces are not sorted, the smallest row first")
        except ValueError as problem:
            raise ResultError(f"{path}: solution {solution}: {problem}; write the front again") from None
        yield found


def read_record(path: Path, count: int) -> dict[str, Any]:
    """Read the record of a front of so many solutions, whose parts are then of the kind that others rely on.

    Raises
    ------
    ResultError
        If it is missing, damaged, of another front or of an earlier version.
    """
    try:
        run = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as problem:
        raise ResultError(f"{path}: cannot be read ({reason_of(problem)})") from None
    if not isinstance(run, dict) or run.get("solutions") != count:
        raise ResultError(f"{path}: is not the record of this front of {count} solutions")
    model, chosen, objectives = run.get("model"), run.get("chosen"), run.get("objectives")
    wrong = [name for name in ("options", "rules", "settings", "versions") if not isinstance(run.get(name) or {}, dict)]
    if not isinstance(model, dict):
        wrong.append("model")
    else:
        wrong += [f"model.{key}" for key in ("name", "hash") if not isinstance(model.get(key), str)]
        wrong += ["model.file"] * (not isinstance(model.get("file") or "", str))
        wrong += [f"model.{key}" for key in ("georeference", "lines") if not isinstance(model.get(key) or {}, dict)]
    if chosen is not None and not (type(chosen) is int and 0 <= chosen < count):
        wrong.append("chosen")
    wrong += ["wish"] * (not _is_wish(run.get("wish") or {}))
    wrong += ["objectives"] * (objectives is not None and not _are_objectives(objectives))
    if wrong:
        raise ResultError(f"{path}: {', '.join(wrong)} is not what a front's record holds; write the front again")
    if "footprint" in (run.get("settings") or {}) and not {"options", "rules"} & set(run):
        raise ResultError(
            f"{path}: is of an earlier version, which stored how a model is read and what counts otherwise; simplify "
            "the model again"
        )
    return run


def _is_wish(limits: Any) -> bool:
    wished = [name for name, measure in MEASURES.items() if measure.wish]
    return isinstance(limits, dict) and all(
        name in wished and type(limit) in (int, float) and 0 <= limit < math.inf for name, limit in limits.items()
    )


def _are_objectives(names: Any) -> bool:
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return False
    try:
        checked_objectives(names)
    except ValueError:
        return False
    return True


class MeshWriter:
    """Writes meshes of a surface in one format and one frame, and says once what is lost by it.

    Parameters
    ----------
    kind : Format
        The format.
    surface : Surface
        The original mesh and its rules.
    compress : bool
        Whether they are compressed, so that no vertex moves by more than COMPRESSION_SHARE of the mean error.

    Raises
    ------
    ResultError
        If the format cannot hold this model, or is none that is compressed.
    """

    def __init__(self, kind: Format, surface: Surface, *, compress: bool = False) -> None:
        kind.check(surface.model)
        if compress and kind.pack is None:
            known = listed((other.name for other in written_formats().values() if other.pack is not None), "or")
            raise ResultError(f"{kind.name} is not compressed; write {known}, or do without compression")
        self.kind, self.surface, self.compress = kind, surface, compress
        self._look = _look(kind, surface)
        self._rounding = Rounding(kind)

    def mesh(self, faces: IntArray, vertices: FloatArray | None = None) -> OutMesh:
        """Return a mesh, its triangles (M, 3) in vector order, with its own or other vertices, as it is to be written.

        It is not packed.
        """
        own, triangles, attributes = mesh_arrays(self.surface.model, faces)
        shown = self._look | _lines_as_written(self.surface, faces)
        return OutMesh(own if vertices is None else vertices, triangles, attributes, **shown)

    def write(self, path: Path, mesh: OutMesh, error: float, solid: OutMesh | None = None) -> OutMesh:
        """Write a mesh of this mean error [model units], packed if it is to be, and return what was written."""
        written = self.packed(mesh, error, solid)
        assert self.kind.write is not None
        self.kind.write(path, written)
        return written

    def packed(self, mesh: OutMesh, error: float, solid: OutMesh | None = None) -> OutMesh:
        """Return a mesh of this mean error [model units] as it is written, and take note of what is lost by it.

        Or the solid that was made of it, whose walls and base say nothing of what is lost.
        """
        self._rounding.add(mesh, self.surface.view.scale)
        written = mesh if solid is None else solid
        if not self.compress or self.kind.pack is None:
            return written
        metres = metres_per_model_unit(self.surface.model.georeference)
        return self.kind.pack(written, COMPRESSION_SHARE * error * metres)

    def warn(self) -> None:
        """Say what is lost by single precision, and what the format does not hold."""
        model = self.surface.model
        self._rounding.warn(model.name, self.surface.diagonal)
        warn_of_left_behind(self.kind, model.name, model.attributes)


def write_solution(
    path: Path, surface: Surface, faces: IntArray, *, solid: float | None = None, compressed_by: float | None = None
) -> OutMesh:
    """Write a mesh of a surface, its triangles (M, 3) in vector order, in the format of the path's suffix.

    Parameters
    ----------
    path : Path
        The file.
    surface : Surface
        The original mesh and its rules.
    faces : (M, 3) int array
        The triangles.
    solid : float, optional
        Close the mesh by walls and a base so far below its lowest point [file units].
    compressed_by : float, optional
        The mean error of the mesh [model units]: it is compressed as far as that lets it.

    Returns
    -------
    OutMesh
        What was written.

    Raises
    ------
    ResultError
        If the format cannot hold this model, or is none that is compressed, or it cannot be made solid.

    Warns
    -----
    ModelWarning
        If single precision moves vertices by more than rounding or turns triangles over, or the format does not hold
        all that is known of the vertices.
    """
    writer = MeshWriter(format_of_output(path), surface, compress=compressed_by is not None)
    mesh, closed = writer.mesh(faces), None
    if solid is not None:
        check_solid(surface, solid, writer.kind)
        own = mesh.vertices, mesh.faces, mesh.attributes
        (vertices, triangles, attributes), _ = _closed(surface, faces, own, solid)
        closed = replace(mesh, vertices=vertices, faces=triangles, attributes=attributes)
    written = writer.write(path, mesh, compressed_by or 0.0, closed)
    writer.warn()
    return written


def _closed(
    surface: Surface, faces: IntArray, arrays: MeshArrays, thickness: float | None
) -> tuple[MeshArrays, dict[str, Any]]:
    """Return a mesh of these triangles (M, 3), in vector order, and nothing; with a thickness a solid, and its numbers.

    ``arrays`` is the mesh: its vertices may have moved.
    """
    if thickness is None:
        return arrays, {}
    vertices, _, attributes = arrays
    found = as_solid(surface, faces, thickness, vertices)
    below = {name: values[found.source] for name, values in attributes.items()}
    return (found.vertices, found.faces, below), {"thickness": thickness, **found.numbers}


def _look(kind: Format, surface: Surface) -> dict[str, Any]:
    """Return what writing a mesh of a surface takes beside the mesh."""
    model, up = surface.model, surface.view.rotation[2]
    return shared_frame(
        kind,
        model.file_box,
        name=model.name,
        georeference=model.georeference,
        up=up,
        material=model.material,
    )


def _lines_as_written(surface: Surface, faces: IntArray) -> dict[str, Any]:
    """Return the break lines of a mesh as `write_mesh` takes them, as rows of the vertices that it uses."""
    chains, names = mesh_lines(surface, faces)
    used, _ = used_rows(np.asarray(faces))
    return {"lines": tuple(np.searchsorted(used, chain) for chain in chains), "line_names": names} if chains else {}


def _thinned_lines(model: Any, lines: ModelLines) -> SourceLines:
    """Return what thinning left of break lines, in the frame of the model's file."""
    vertices = tuple(model.file_points[chain] for chain in lines.chains)
    return SourceLines(model.name, vertices, lines.names, model.georeference)


def _facts_of_lines(surface: Surface, lines: ModelLines, folder: Path) -> dict[str, Any]:
    """Return what is recorded of break lines, their file relative to the folder."""
    given = surface.rules.break_lines
    file = {"file": path_from(folder, given)} if is_file_of_lines(given) else {}
    return file | {"hash": lines.hash} | facts_of_lines(surface, lines)


def package_versions(*others: str) -> dict[str, str]:
    """Return the versions of Python, of the packages that decide the results, and of others; absent ones left out."""
    return dict(_versions(*others))


@cache
def _versions(*others: str) -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for package in PACKAGES + others:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return versions


@cache
def machine() -> dict[str, Any]:
    """Return what the times of a run depend on besides: operating system, processor, number of cores."""
    processor = platform.processor() or platform.machine()
    with suppress(OSError), Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as lines:
        names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
        processor = next(names, processor)
    return {"platform": platform.platform(), "processor": processor, "cores": os.cpu_count()}


def now() -> str:
    """Return the date and time, in UTC, as ISO 8601 spells it."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())


def even_selection(count: int, most: int | None) -> list[int]:
    """Return at most ``most`` of the rows 0 .. count - 1, evenly spread, the ends included.

    >>> even_selection(5, None), even_selection(5, 3), even_selection(5, 0)
    ([0, 1, 2, 3, 4], [0, 2, 4], [])
    """
    if most is None or most >= count:
        return list(range(count))
    if most < 0:
        raise ValueError(f"meshes is {most}; it must be 0 or more")
    return [int(row) for row in np.unique(np.rint(np.linspace(0, count - 1, most)).astype(int))]


def spelled_value(column: str, value: float) -> str:
    """Return a number as it stands in a front's CSV file: whole numbers bare, others so that they read back equal.

    One that is not known, a NaN, is empty.
    """
    if column in INT_COLUMNS:
        return str(int(value))
    return "" if math.isnan(value) else repr(float(value))


def _csv_rows(path: Path, *headers: tuple[str, ...]) -> tuple[tuple[str, ...], list[list[str]]]:
    """Return the header, one of those expected, and all rows, the header's first."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file, strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise ResultError(f"{path}: cannot be read ({reason_of(problem)})") from None
    header = tuple(rows[0]) if rows else ()
    if header not in headers:
        raise ResultError(f"{path}: its first line must be {','.join(headers[0])}")
    if len(rows) == 1:
        raise ResultError(f"{path}: holds no solution")
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise ResultError(f"{path}, line {line}: {len(row)} values instead of {len(header)}; the file is cut off")
    return header, rows


def _series_rows(series: Mapping[str, npt.ArrayLike]) -> Iterator[list[str]]:
    for name, front in series.items():
        F = np.asarray(front, dtype=np.float64)
        if F.ndim != 2 or F.shape[1] != 2 or not len(F) or not np.isfinite(F).all():
            raise ValueError(f"the series {name!r} is no front: (n, 2) finite numbers, error and triangles")
        for error, triangles in F[np.lexsort((F[:, 0], F[:, 1]))]:
            yield [name, spelled_value("minimised", error), spelled_value("triangles", triangles)]


def _read_series(path: Path) -> dict[str, FloatArray]:
    """Read other fronts back; none where there is no such file."""
    if not path.exists():
        return {}
    series: dict[str, list[tuple[float, float]]] = {}
    for line, (name, *numbers) in enumerate(_csv_rows(path, SERIES_COLUMNS)[1][1:], start=2):
        try:
            error, triangles = float(numbers[0]), int(numbers[1])
        except ValueError:
            raise ResultError(f"{path}, line {line}: {','.join(numbers)} is no error and number of triangles") from None
        if not (0 <= error < np.inf and 0 <= triangles <= MOST_COUNTED):
            raise ResultError(f"{path}, line {line}: {','.join(numbers)} is no error and number of triangles")
        series.setdefault(name, []).append((error, triangles))
    return {name: np.array(front, dtype=np.float64) for name, front in series.items()}


def read_front_csv(path: Path) -> tuple[dict[str, npt.NDArray[Any]], tuple[str, ...], tuple[str, ...]]:
    """Return the columns of a front's CSV file as arrays, the names of its meshes and of the refitted ones."""
    header, rows = _csv_rows(
        path, *(FRONT_COLUMNS + lines + refit for lines in ((), OF_LINES) for refit in ((), REFIT_COLUMNS))
    )
    columns: dict[str, npt.NDArray[Any]] = {}
    for at, column in enumerate(header):
        if column in ("mesh", "refitted_mesh"):
            continue
        kind = int if column in INT_COLUMNS else float
        values = []
        for line, row in enumerate(rows[1:], start=2):
            if not row[at] and column in MAY_BE_EMPTY:
                values.append(float("nan"))
                continue
            try:
                value = kind(row[at])
                if not 0 <= value < (MOST_COUNTED if kind is int else float("inf")):
                    raise ValueError
            except ValueError:
                raise ResultError(f"{path}, line {line}: {column} is {row[at]!r}") from None
            values.append(value)
        columns[column] = np.array(values, dtype=np.int64 if kind is int else np.float64)
    if not np.array_equal(columns["solution"], np.arange(len(rows) - 1)):
        raise ResultError(f"{path}: solutions are not numbered 0 to {len(rows) - 2}; a line is missing or out of place")
    if (np.diff(columns["triangles"]) < 0).any():
        line = int(np.argmax(np.diff(columns["triangles"]) < 0)) + 3
        raise ResultError(f"{path}, line {line}: not sorted by triangles")
    at = header.index("mesh")
    meshes = tuple(row[at] for row in rows[1:])
    refitted = tuple(row[-1] for row in rows[1:]) if header[-1] == "refitted_mesh" else ()
    for line, paths in enumerate(zip(meshes, refitted or meshes, strict=True), start=2):
        for mesh in paths:
            if mesh and not stays_inside(path.parent, mesh):
                raise ResultError(f"{path}, line {line}: mesh {mesh!r} is not inside the folder")
    return columns, meshes, refitted


def _read_npz(
    path: Path, count: int
) -> tuple[FloatArray, BoolArray | Nested, IntArray, list[IntArray], FloatArray | None]:
    """Return F, the subsets of ``count`` solutions, the faces of each that is free, and the images of the vertices.

    The subsets are chromosomes with their rows in the file, or nested; images are those of a closed surface.
    """
    try:
        with path.open("rb") as stream:
            arrays = read_npz(stream, path.name)
        F = _of_type(path, "F", arrays, "f", 2)
        if "level" in arrays:
            return F, _nested(path, arrays, count), np.empty(0, np.int64), [np.empty((0, 3), np.int32)] * count, None
        packed, source_index = _of_type(path, "kept", arrays, "u", 2), _of_type(path, "source_index", arrays, "i", 1)
        faces, start = _of_type(path, "faces", arrays, "i", 2), _of_type(path, "face_start", arrays, "i", 1)
        images = _of_type(path, "xy", arrays, "f", 2) if "xy" in arrays else None
    except KeyError as problem:
        raise ResultError(
            f"{path}: holds no array {problem}; the file is of an earlier version or not ours: simplify again"
        ) from None
    except (OSError, ModelError, MemoryError) as problem:
        raise ResultError(f"{path}: cannot be read ({reason_of(problem)})") from None
    if packed.dtype != np.uint8:
        raise ResultError(f"{path}: kept has the type {packed.dtype} instead of packed bits (uint8)")
    if not are_distinct(source_index) or source_index.min(initial=0) < 0:
        raise ResultError(f"{path}: source_index is not a list of different rows")
    n = len(source_index)
    if packed.shape != (count, -(-n // 8)):
        raise ResultError(
            f"{path}: kept has the shape {packed.shape}; {count} solutions of {n} vertices need {(count, -(-n // 8))}"
        )
    bits = np.unpackbits(packed, axis=1).astype(bool)
    if bits[:, n:].any():
        raise ResultError(f"{path}: kept has bits set beyond the {n} vertices of the model")
    if faces.dtype != np.int32 or faces.shape[1] != 3:
        raise ResultError(
            f"{path}: faces has the type {faces.dtype} and the shape {faces.shape} instead of int32, (M, 3)"
        )
    if len(start) != count + 1 or start[0] != 0 or start[-1] != len(faces) or (np.diff(start) < 0).any():
        raise ResultError(
            f"{path}: face_start does not cut its {len(faces)} faces into those of {count} solutions, one after the "
            "other; write the front again"
        )
    if images is not None and images.shape != (n, 2):
        raise ResultError(f"{path}: xy has the shape {images.shape}; {n} vertices have images of the shape {(n, 2)}")
    return F, bits[:, :n], source_index, [faces[a:b] for a, b in itertools.pairwise(start)], images


def _nested(path: Path, arrays: Mapping[str, AnyArray], count: int) -> Nested:
    parts = [arrays[name] for name in ("rows", "level", "slope", "moved", "moved_start")]
    try:
        nested = Nested.of_arrays(*parts)
    except ValueError as problem:
        raise ResultError(f"{path}: {problem}; the file is not ours") from None
    if len(nested) != count:
        raise ResultError(f"{path}: holds {len(nested)} subsets for {count} solutions; write the front again")
    return nested


def _of_type(path: Path, name: str, arrays: Mapping[str, AnyArray], kind: str, ndim: int) -> AnyArray:
    array = arrays[name]
    if array.dtype.kind != kind or array.ndim != ndim:
        raise ResultError(
            f"{path}: {name} has the type {array.dtype} and {array.ndim} dimensions; the file is not ours"
        )
    return array


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"a {type(value).__name__} cannot be recorded in run.json; pass numbers, texts, lists and mappings")
