"""Polylines as a file or an array gives them, before a model takes them for break lines."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class SourceLines:
    """Polylines in the frame of the model's file.

    Attributes
    ----------
    name : str
        Where they came from, for messages.
    lines : tuple of (n, 2) or (n, 3) float array
        The vertices of each line, two or more, in order [file units]: with heights (a hard line, which brings its own)
        or without (a soft line, which takes the surface's). A closed line ends where it begins.
    names : tuple of str
        What messages call each of them, such as "line 3" or "feature 12 (Mill Creek)".
    georeference : dict
        The coordinate reference system, as far as the file says; see
        :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    """

    name: str
    lines: tuple[FloatArray, ...]
    names: tuple[str, ...]
    georeference: dict[str, Any] = field(default_factory=dict)
