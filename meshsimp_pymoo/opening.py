"""The one way in: a path, a built-in name or arrays, and how to read them, become the original mesh."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.files import is_there
from meshsimp_pymoo.formats.options import DEFAULT, Options
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.scenes import from_trimesh
from meshsimp_pymoo.formats.table import are_given, described, listed, read_source
from meshsimp_pymoo.surface.model import OpenModel, build_model
from meshsimp_pymoo.surface.orient import Up, front_patch
from meshsimp_pymoo.surface.repair import Mended, mend

if TYPE_CHECKING:
    import trimesh

# A file, the name of a built-in model, or a mesh in memory.
Source: TypeAlias = "str | os.PathLike[str] | trimesh.Trimesh | SourceMesh"


def open_model(model: Source | OpenModel, options: Options = DEFAULT) -> OpenModel:
    """Read, check and orient a mesh.

    Parameters
    ----------
    model : path, built-in name, trimesh.Trimesh, SourceMesh or OpenModel
        The mesh; a file wins over a built-in model of the same name, and an :class:`OpenModel` is returned as it is.
    options : Options
        How it is read; what cannot apply (see :func:`applicable`) is refused.

    Returns
    -------
    OpenModel

    Raises
    ------
    ModelError
        If it cannot be read or is no open height field; the message names the cause and the way out.
    TypeError
        If it is nothing of that kind.

    Warns
    -----
    ModelWarning
        Of what was mended, of what a patch leaves out and of what is doubtful, with the numbers.

    Examples
    --------
    >>> open_model("roof:3").n_vertices, len(open_model("roof:3").faces)
    (9, 8)
    """
    if isinstance(model, OpenModel):
        if options != DEFAULT:
            raise ModelError(
                f"{model.name}: is a model that was read already, so that nothing can be said of how to read it; leave "
                f"{_given(options)} out, or give the file"
            )
        return model
    source, mended = mended_source(model, options)
    built = build_model(source, up=options.up)
    if mended != Mended():
        warn_of(f"{source.name}: {mended} (--repair none (repair='none') leaves them)")
        built = replace(built, found=built.found | {f"faces_{what}": n for what, n in vars(mended).items() if n})
    return built


def open_source(model: Source, options: Options = DEFAULT) -> SourceMesh:
    """Read a mesh as it lies, small defects mended, but not judged; with ``patch``, only that patch of it.

    Parameters
    ----------
    model, options
        As in :func:`open_model`.

    Raises
    ------
    ModelError
        If there is neither a file nor a built-in model of this name, or it cannot be used.

    Warns
    -----
    ModelWarning
        Of what a patch leaves out.
    """
    return mended_source(model, options)[0]


def mended_source(model: Source, options: Options = DEFAULT) -> tuple[SourceMesh, Mended]:
    """Read a mesh as :func:`open_source` does, and return what was mended in it, too."""
    source = _source_of(model, options)
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

    All of it applies to a file; what does not describe a sort of files (``up``, ``patch``, ``repair``, ``scale``) to a
    mesh that is in memory or built in; nothing to an OpenModel, which was read already.
    """
    if isinstance(model, OpenModel):
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
            "a model is a path, a built-in name, a trimesh.Trimesh, a SourceMesh or an OpenModel, "
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
