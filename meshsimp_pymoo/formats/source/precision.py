"""What single precision does to coordinates, and the origin from which it does them no harm."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.table import Format, listed, written_formats

# Share of the model's diagonal; a larger shift of a vertex is worth a warning.
SINGLE_PRECISION_LOSS = 1e-6


def local_origin(vertices: FloatArray) -> FloatArray:
    """Return the origin (3,) from which single precision holds vertices (V, 3): 0 if that does, else whole units.

    >>> local_origin(np.array([[0.0, 0.5, 1.0], [1.0, 1.0, 2.0]])).tolist()
    [0.0, 0.0, 0.0]
    >>> local_origin(np.array([[500000.1, 5400000.1, 7.5], [500001.1, 5400001.1, 8.5]])).tolist()
    [500000.0, 5400000.0, 7.0]
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0))) if len(vertices) else 0.0
    if single_precision_shift(vertices) <= SINGLE_PRECISION_LOSS * diagonal:
        return np.zeros(3)
    return np.asarray(np.floor(vertices.min(axis=0)), dtype=np.float64)


def single_precision_shift(vertices: FloatArray) -> float:
    """Return by how much single precision moves the vertices at most, along an axis [their units]."""
    return float(np.abs(vertices - vertices.astype(np.float32)).max(initial=0.0))


def shared_frame(kind: Format, points: FloatArray, *, name: str, georeference: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `write_mesh` is to know of a model's frame, so that all its meshes have one origin.

    Parameters
    ----------
    kind : Format
        The format of the meshes.
    points : (N, 3) float array
        All vertices of the model, as in the file.
    name : str
        The model's name.
    georeference : mapping
        What is known of the coordinates.
    """
    origin = local_origin(points) if kind.states_origin else np.zeros(3)
    return {"origin": origin, "georeference": georeference, "name": Path(name).stem}


def warn_of_shift(kind: Format, name: str, diagonal: float, shift: float) -> None:
    """Warn if the format's single precision moves vertices by more than a person would see in the numbers."""
    if not kind.single_precision or kind.states_origin or shift <= SINGLE_PRECISION_LOSS * diagonal:
        return
    known = written_formats().values()
    exact = listed(other.name for other in known if not other.single_precision)
    stating = listed(other.name for other in known if other.states_origin)
    warnings.warn(
        f"{name}: {kind.name} holds single precision, which moves vertices by up to {shift:.3g} [file units]; {exact} "
        f"keep them exactly, {stating} states a local origin",
        ModelWarning,
        stacklevel=3,
    )
