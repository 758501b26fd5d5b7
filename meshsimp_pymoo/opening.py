"""The one way in: a path, a built-in name or arrays, and how to read them, become the original mesh."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray, IntArray, are_distinct
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import FacesAllWays, ModelError, ModelWarning, NoHeightGrid, warn_of
from meshsimp_pymoo.files import is_there
from meshsimp_pymoo.formats.options import DEFAULT, Options, Window
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import EVEN, PlacedHeights, placed_heights
from meshsimp_pymoo.formats.source.metric import in_metric_frame
from meshsimp_pymoo.formats.source.scenes import from_trimesh
from meshsimp_pymoo.formats.table import (
    are_given,
    described,
    format_of_input,
    guarded,
    listed,
    read_source,
    refuse_foreign,
)
from meshsimp_pymoo.plane.lattice import cells
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.settings import by_name, settings_of, taken
from meshsimp_pymoo.surface.closed.model import ClosedModel, Topology, closed_model, has_border, topology
from meshsimp_pymoo.surface.grid import HeightGrid
from meshsimp_pymoo.surface.kinds import Model
from meshsimp_pymoo.surface.model import Mesh, OpenModel, build_model
from meshsimp_pymoo.surface.orient import SurfaceFacts, Up, front_patch, seen_upright
from meshsimp_pymoo.surface.repair import Mended, mend

if TYPE_CHECKING:
    import trimesh

# A file, the name of a built-in model, or a mesh in memory.
Source: TypeAlias = "str | os.PathLike[str] | trimesh.Trimesh | SourceMesh"


def open_model(model: Source | Model, options: Options = DEFAULT) -> Model:
    """Read, check and orient a mesh.

    Parameters
    ----------
    model : path, built-in name, trimesh.Trimesh, SourceMesh, OpenModel or ClosedModel
        The mesh; a file wins over a built-in model of the same name, and a model is returned as it is.
    options : Options
        How it is read; what cannot apply (see :func:`applicable`) is refused.

    Returns
    -------
    OpenModel or ClosedModel
        What ``options.surface`` says; with ``"auto"`` a closed one where the mesh is no height field, but closed and of
        genus 0.

    Raises
    ------
    ModelError
        If it cannot be read, or is neither; the message names the cause and the way out.
    TypeError
        If it is nothing of that kind.

    Warns
    -----
    ModelWarning
        Of what was mended, of what a patch leaves out, of what is doubtful, with the numbers, and that a surface is
        taken as a closed one.

    Examples
    --------
    >>> open_model("roof:3").n_vertices, len(open_model("roof:3").faces)
    (9, 8)
    """
    if isinstance(model, (OpenModel, ClosedModel)):
        if options != DEFAULT:
            raise ModelError(
                f"{model.name}: is a model that was read already, so that nothing can be said of how to read it; leave "
                f"{_given(options)} out, or give the file"
            )
        return model
    source, mended = mended_source(model, options)
    judged = judge(source, options)
    if judged.refusal is not None:
        raise ModelError(judged.refusal)
    built: Model
    if judged.kind == "height":
        built = build_model(source, seen=judged.seen)
    else:
        try:
            built = closed_model(source)
        except ModelError as trouble:
            raise ModelError(f"{trouble}{judged.no_height_field}") from None
        if options.surface == "auto" and not source.is_closed:
            warn_of(
                f"{source.name}: is no height field but a closed surface{built.parts_and_holes}, and is taken as one"
                f"{judged.reason} (--surface closed (surface='closed') says so; --patch front (patch='front') takes one"
                " side of it)"
            )
    if mended != Mended():
        warn_of(f"{source.name}: {mended} (--repair none (repair='none') leaves them)")
        built = replace(built, found=built.found | {f"faces_{what}": n for what, n in vars(mended).items() if n})
    return built


@brief
@dataclass(frozen=True)
class Judged:
    """What a mesh is taken for.

    Attributes
    ----------
    kind : {"height", "closed"}
        What the options say, else the first that it passes for.
    seen : (direction, SurfaceFacts), optional
        From where it is seen, and what it is from there, if it was looked at as a height field.
    fault : str, optional
        Why it is no height field, in few words, if that was looked at: "has no border".
    refusal : str, optional
        Why it cannot be used, in one line with the ways out; None if it can, as far as is known without flattening it.
    """

    kind: str
    seen: tuple[FloatArray, SurfaceFacts] | None = None
    fault: str | None = None
    refusal: str | None = None

    @property
    def reason(self) -> str:
        """Why it is no height field, for behind that it is not; what has no border needs no reason."""
        return f", since it {self.fault}" if self.fault is not None and self.fault != NO_BORDER else ""

    @property
    def no_height_field(self) -> str:
        """Why it is no height field, for behind the reason why it is no closed surface."""
        return f"; nor is it a height field{self.reason}" if self.reason else ""


NO_BORDER = "has no border"


def judge(source: SourceMesh, options: Options = DEFAULT) -> Judged:
    """Find out what a mesh is taken for: what the options say, else what it passes for.

    What has no border is no height field from any side, and what passes for one is not looked at otherwise.
    """
    is_open_question = options.surface == "auto" and _can_be_closed(source, options)
    if options.surface == "closed" or (is_open_question and source.is_closed):
        return Judged("closed")
    if is_open_question and not has_border(source.faces):
        return Judged("closed", fault=NO_BORDER)
    seen, fault, refusal = None, "faces all ways alike", None
    try:
        seen = seen_upright(source.measured, options.up)
    except FacesAllWays as trouble:
        refusal = str(trouble)
    else:
        if (refusal := seen[1].refusal) is None:
            return Judged("height", seen)
        fault = str(seen[1].fault)
    what = topology(source.faces) if source.sort == "mesh" else None
    if is_open_question and what is not None and what.refusal is None:
        return Judged("closed", seen, fault)
    return Judged("height", seen, fault, refusal + _otherwise(what, options))


def _otherwise(what: Topology | None, options: Options) -> str:
    """Return what can be done with a mesh that is no height field as a closed surface, or why nothing can."""
    if what is None or what.crowded:  # which stands in the way of both
        return ""
    if what.refusal is not None:
        return f"; as a closed surface it is refused too: it {what.refusal}"
    given = [(name, getattr(options, name)) for name in ("surface", "patch", "up")]
    said = [f"--{name} {value} ({name}={value!r})" for name, value in given if value != getattr(DEFAULT, name)]
    return f"; or leave {listed(said)} out to have all of it, as a closed surface" if said else ""


def _can_be_closed(source: SourceMesh, options: Options) -> bool:
    """Tell whether nothing says that a mesh is a height field."""
    return _side(options) is None and source.sort == "mesh" and source.up is None


def _side(options: Options) -> str | None:
    """Return which option says from where a mesh is seen, as only height fields are, if one does."""
    return next((name for name in ("patch", "up") if getattr(options, name) != getattr(DEFAULT, name)), None)


def _refuse_side(name: str, options: Options) -> None:
    """Refuse a side to see a closed surface from."""
    side = _side(options)
    if options.surface == "closed" and side is not None:
        value = getattr(options, side)
        raise ModelError(
            f"{name}: --{side} {value} ({side}={value!r}) describes height surfaces, and --surface closed "
            f"(surface='closed') a closed one; leave one of them out"
        )


def open_source(model: Source, options: Options = DEFAULT) -> SourceMesh:
    """Read a mesh as it lies, small defects mended, but not judged; with ``patch``, only that patch of it.

    Parameters
    ----------
    model, options
        As in :func:`open_model`.

    Raises
    ------
    ModelError
        If there is neither a file nor a built-in model of this name, or it cannot be used; also if the options say that
        it is closed, and something else that only height fields have.

    Warns
    -----
    ModelWarning
        Of what a patch leaves out.
    """
    return mended_source(model, options)[0]


def mended_source(model: Source, options: Options = DEFAULT) -> tuple[SourceMesh, Mended]:
    """Read a mesh as :func:`open_source` does, and return what was mended in it, too."""
    source = _source_of(model, options)
    _refuse_side(source.name, options)
    mended = Mended()
    if options.repair == "mend":
        source, mended = mend(source)
    return (_patch(source, options.up) if options.patch == "front" else source), mended


def _patch(source: SourceMesh, up: Up) -> SourceMesh:
    """Cut out the front patch in the metric frame; what is left is as in the file, whose name it keeps."""
    patch = front_patch(replace(source.measured, rows=np.arange(len(source.points))), up)
    rows = patch.rows
    return replace(
        patch,
        name=source.name,  # by which a stored front finds its model again
        points=source.points[rows],
        rows=source.rows[rows],
        georeference=source.georeference,
        sort=source.sort,
    )


def applicable(model: Any, options: Options) -> Options:
    """Return how a model is read as far as that applies to what it is given as, the other settings by default.

    All of it applies to a file; what does not describe a sort of files (``surface``, ``up``, ``patch``, ...) to a
    mesh that is in memory or built in; nothing to a model, which was read already.
    """
    if isinstance(model, Mesh):
        return DEFAULT
    if isinstance(model, (str, os.PathLike)) and _is_file(model):
        return options
    return replace(options, **{name: getattr(DEFAULT, name) for name in described()})


def _source_of(model: Source, options: Options) -> SourceMesh:
    if isinstance(model, (str, os.PathLike)):
        if _is_file(model):
            return read_source(model, options)
        source, what = load(os.fspath(model)), "a built-in model"
    elif isinstance(model, SourceMesh):
        source, what = model, "a mesh in memory"
    elif hasattr(model, "vertices") and hasattr(model, "faces"):
        source, what = from_trimesh(model), "a mesh in memory"
    else:
        raise TypeError(
            "a model is a path, a built-in name, a trimesh.Trimesh, a SourceMesh, an OpenModel or a ClosedModel, "
            f"not {type(model).__name__}"
        )
    if given := [name for name in described() if are_given([name], options)]:
        are = "are" if len(given) > 1 else "is"
        raise ModelError(f"{source.name}: {listed(given)} {are} for files; {what} has its own samples")
    return source.in_frame(options.scale)


def _is_file(model: str | os.PathLike[str]) -> bool:
    """Tell whether a file is meant: there is one of this name, or it is spelled like a path."""
    text = os.fspath(model)
    looks_like_file = bool(Path(text.partition(":")[0]).suffix) or os.sep in text or "/" in text
    return is_there(Path(text)) or looks_like_file or not isinstance(model, str)


def _given(options: Options) -> str:
    return listed(f"{name}={value!r}" for name, value in vars(options).items() if value != getattr(DEFAULT, name))


# ---------------------------------------------------------------------------------------------------------- by windows


@by_name(Options)
def open_grid(
    model: str | os.PathLike[str] | npt.ArrayLike | OpenModel | HeightGrid,
    options: Options | None = None,
    **kwargs: Any,
) -> HeightGrid:
    """Open a height grid for work by tiles.

    Parameters
    ----------
    model : path, built-in name, (R, C) array, OpenModel or HeightGrid
        A ``.npy`` file is mapped into memory and a GeoTIFF opened, and both are read by windows only; any other file is
        read whole first. A model's vertices must be crossings of rows and columns, and its faces those of all cells
        between them of which at least three corners are there.
    options : Options, optional
        How it is read; what cannot apply is refused.
    **kwargs
        Settings of :class:`~meshsimp_pymoo.formats.options.Options` that differ from those, such as ``spacing``.

    Raises
    ------
    ModelError
        If it cannot be read or is no such grid.
    """
    options = taken(Options, options, kwargs)
    if kwargs:
        raise TypeError(f"open_grid has no argument {next(iter(kwargs))!r}; it takes {', '.join(settings_of(Options))}")
    if isinstance(model, HeightGrid):
        if options != DEFAULT:
            raise ModelError(f"{model.name}: is a grid that is open already; say how it is read where it is opened")
        return model
    if isinstance(model, Mesh):
        return _grid_of_model(open_model(model, options), options)
    if not isinstance(model, (str, os.PathLike)):
        _refuse_other_sides("grid", options)
        return _grid_of_heights("grid", placed_heights(np.asanyarray(model), "grid", options), options)
    path = Path(model)
    kind = format_of_input(path)
    if kind is None or kind.open_heights is None or not path.is_file():
        return _grid_of_model(open_model(model, options), options)
    name = str(path)
    _refuse_other_sides(name, options, kind.name)
    with guarded(kind, name):
        return _grid_of_heights(name, kind.open_heights(path, name, options), options)


def count_samples(model: str | os.PathLike[str], *, window: Window | None = None) -> int | None:
    """Return the number of samples of a grid file, or of a part of it, from its header alone; None for anything else.

    Parameters
    ----------
    model : path
        A file whose format knows how to count them, such as ``.npy`` or ``.tif``.
    window : (column, row, columns, rows), optional
        The part.
    """
    path = Path(model)
    kind = format_of_input(path)
    if kind is None or kind.count_samples is None or not path.is_file():
        return None
    if window is not None:
        return int(window[2]) * int(window[3])
    with guarded(kind, str(path)):
        return kind.count_samples(path, str(path))


def _refuse_other_sides(name: str, options: Options, *formats: str) -> None:
    """Refuse what says nothing of heights over rows and columns."""
    refuse_foreign(name, options, "grid", *formats)
    if options.up not in ("auto", "z", "+z"):
        raise ModelError(f"{name}: heights of a grid are along z; leave up={options.up!r} out")
    if options.patch is not None:
        raise ModelError(f"{name}: all of a grid faces up; leave patch={options.patch!r} out")


def _grid_of_heights(name: str, found: PlacedHeights, options: Options) -> HeightGrid:
    grid = HeightGrid(
        name,
        found.heights,
        found.x,
        found.y,
        nodata=found.nodata,
        corner=found.corner,
        file_columns=found.file_columns,
        options=options,
    )
    low, high = (np.array([end(found.x), end(found.y)]) for end in (np.min, np.max))
    framed = partial(in_metric_frame, found.georeference, scale=options.scale, name=name)
    with warnings.catch_warnings():  # said below, of what there is
        warnings.simplefilter("ignore", ModelWarning)
        # a degree measures what it does in the middle of the samples that there are, for which all are read once more
        if not isinstance(options.scale, tuple) and "scale" in framed(low, high) and grid.lattice is not None:
            low, high = grid.file_plan
    georeference = framed(low, high)
    x, y = georeference.get("scale", (1.0, 1.0))
    return replace(grid, georeference=georeference, scale=(x, y))


# Crossings of rows and columns to a vertex: of more nearly all would be gaps.
MOST_CROSSINGS = 1000


def _steps(places: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the different coordinates, ascending, and which of them each place (N,) has.

    Where they are evenly spaced but for gaps, those in the gaps too, so that nothing lies next to what is beyond.
    """
    steps, number = np.unique(places, return_inverse=True)
    gaps = np.diff(steps)
    if not len(gaps):
        return steps, number
    n_steps = np.rint(gaps / gaps.min())
    if n_steps.max() == 1 or n_steps.sum() > MOST_CROSSINGS * len(steps):
        return steps, number
    even = np.abs(gaps / n_steps / gaps.min() - 1.0).max() <= EVEN
    if not even:
        return steps, number
    at = np.concatenate([[0], np.cumsum(n_steps.astype(np.int64))])
    return np.interp(np.arange(at[-1] + 1), at, steps), at[number]


def _fills_cells(row: IntArray, column: IntArray, faces: IntArray, n_columns: int) -> bool:
    """Tell whether vertices (N,) are different crossings, and faces (T, 3) all of cells with three or four of them."""
    number = row * n_columns + column
    if not are_distinct(number):
        return False
    there = np.zeros((int(row.max()) + 1, n_columns), bool)
    there[row, column] = True
    i, j = row[faces], column[faces]
    top, left = i.min(axis=1), j.min(axis=1)
    if (np.ptp(i, axis=1) != 1).any() or (np.ptp(j, axis=1) != 1).any():
        return False
    wanted = cells(there)
    missing = 6 - (2 * (i - top[:, None]) + j - left[:, None]).sum(axis=1)  # 0 to 3: which corner of its cell
    cell = top * (n_columns - 1) + left
    count = np.bincount(cell, minlength=wanted.size)
    opposite = np.bincount(cell, missing, minlength=wanted.size)
    is_full = wanted.ravel() == 2
    return bool((count == wanted.ravel()).all() and (opposite[is_full] == 3).all())


def _grid_of_model(model: Model, options: Options) -> HeightGrid:
    """Find the rows and columns of a model's vertices."""
    if not isinstance(model, OpenModel):
        raise NoHeightGrid(
            f"{model.name}: is a closed surface; only a height grid can be cut into tiles: leave the tiles out"
        )
    x, column = _steps(model.xy[:, 0])
    y, row = _steps(model.xy[:, 1])
    row = len(y) - 1 - row
    if len(x) * len(y) > MOST_CROSSINGS * model.n_vertices or not _fills_cells(row, column, model.faces, len(x)):
        raise NoHeightGrid(
            f"{model.name}: its {model.n_vertices} vertices and {len(model.faces)} faces are not those of a height "
            f"grid of {len(y)} rows and {len(x)} columns; only a height grid can be cut into tiles: leave the tiles out"
        )
    if model.weights is not None:
        raise ModelError(f"{model.name}: has weights, which tiles do not know; leave the weights or the tiles out")
    row_of = np.argsort(row * len(x) + column)
    heights = np.full((len(y), len(x)), np.nan)
    heights[row, column] = model.points[:, 2]
    return HeightGrid(
        model.name,
        heights,
        x * model.unit,
        y[::-1] * model.unit,
        model=model,
        row_of=row_of,
        georeference=model.georeference,
        options=options,
    )
