"""Which vertices every mesh keeps: the corners, those of break lines, and what the user names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.surface.model import Mesh, OpenModel
from meshsimp_pymoo.surface.rules import PINS

# A landmark given by position is the nearest vertex, but not one farther away than this share of the diagonal.
LANDMARK_REACH = 0.01


def pinned_vertices(model: OpenModel, pin: str | Sequence[Any] | AnyArray | None = None) -> BoolArray:
    """Return which vertices every mesh keeps: the corners, break lines, and what ``pin`` names (see `Rules`).

    Raises
    ------
    ModelError
        If a file row does not exist or is not part of the model, or a position has no vertex near.
    """
    pinned = np.zeros(model.n_vertices, bool)
    pinned[model.corners] = True
    if model.lines is not None:
        pinned[model.lines.vertices] = True
    for part in _pin_parts(pin):
        if not isinstance(part, str):
            pinned[_named(model, part)] = True
        elif part not in PINS:
            names = ", ".join(map(repr, PINS))
            raise ModelError(f"pin={part!r} is unknown; use {names}, file rows or positions")
        elif part != "corners":
            pinned[getattr(model, part)] = True
    return pinned


def named_vertices(model: Mesh, pin: str | Sequence[Any] | AnyArray | None = None) -> BoolArray:
    """Return which vertices ``pin`` names by file rows or positions in space: all that it can on a closed surface.

    Raises
    ------
    ModelError
        As :func:`pinned_vertices` does, and of any other name.
    """
    pinned = np.zeros(model.n_vertices, bool)
    for part in _pin_parts(pin):
        if isinstance(part, str):
            raise ModelError(
                f"{model.name}: pin={part!r} describes height surfaces, and this is a closed one; name file rows or "
                "positions [x, y, z], or leave it out"
            )
        if part.ndim == 2 and part.shape[1] == 2:
            raise ModelError(f"{model.name}: pin holds positions [x, y] on a closed surface; give [x, y, z]")
        # copies of a vertex lie where it does
        pinned |= np.isin(model.file_rows, model.file_rows[_named(model, part)])
    return pinned


def _named(model: Any, part: AnyArray) -> IntArray:
    """Return the vertices at file rows (K,) or positions (K, 2) or (K, 3)."""
    return _rows_of_file(model, part) if part.ndim == 1 else _vertices_near(model, part)


def _pin_parts(pin: Any) -> list[Any]:
    """Sort what the user gave into names, an array of file rows and an array of positions."""
    if pin is None:
        return []
    if isinstance(pin, str):
        return [pin]
    if isinstance(pin, np.ndarray):
        pin = [pin] if pin.ndim == 2 else list(pin)
    elif not isinstance(pin, Iterable):
        pin = [pin]
    parts: list[Any] = []
    rows = []
    for item in pin:
        if isinstance(item, str):
            parts.append(item)
        elif np.ndim(item) == 0:
            rows.append(item)
        else:
            positions = np.atleast_2d(np.asarray(item))
            if positions.ndim != 2 or positions.shape[1] not in (2, 3):
                raise ModelError(
                    f"pin holds an array of shape {np.shape(item)}; positions have shape (K, 2) or (K, 3), "
                    "file rows are single whole numbers"
                )
            parts.append(positions.astype(float))
    if rows:
        parts.append(np.asarray(rows))
    return parts


def _rows_of_file(model: Mesh, rows: AnyArray) -> IntArray:
    if not np.issubdtype(rows.dtype, np.integer):
        raise ModelError(
            f"pin holds {rows[0]!r}, which is no row of the file; give whole numbers, or positions as [x, y, z]"
        )
    repeated, merged_into = model.repeats.T
    place, found = _looked_up(repeated, rows)
    rows = rows.copy()
    rows[found] = merged_into[place[found]]
    place, found = _looked_up(model.source_index, rows)
    if not found.all():
        raise ModelError(
            f"pin: row {int(rows[~found][0])} of {model.name} is not among the model's {model.n_vertices} vertices; "
            "rows count from 0, and vertices that no face uses are left out"
        )
    return place


def _looked_up(among: IntArray, rows: AnyArray) -> tuple[IntArray, BoolArray]:
    """Return where each row stands in an array, and whether it stands there at all."""
    order = np.argsort(among, kind="stable")
    at = np.searchsorted(among[order], rows)
    found = at < len(among)
    found[found] = among[order[at[found]]] == rows[found]
    place = np.full(len(rows), -1, np.int64)
    place[found] = order[at[found]]
    return place, found


def _vertices_near(model: Any, positions: FloatArray) -> IntArray:
    if positions.shape[1] == 3:
        wanted, vertices = positions * model.scale, model.file_points * model.scale
    else:
        wanted, vertices = positions * model.scale[:2] - model.origin[:2], model.points[:, :2]
    distance, nearest = cKDTree(vertices).query(wanted)
    far = np.flatnonzero(distance > LANDMARK_REACH * model.diagonal)
    if len(far):
        k = far[0]
        raise ModelError(
            f"pin: the vertex of {model.name} nearest to {positions[k].tolist()} is {distance[k]:.6g} away, more than "
            f"{LANDMARK_REACH:.0%} of the diagonal {model.diagonal:.6g}; give positions on the mesh"
        )
    return np.asarray(nearest, np.int64)
