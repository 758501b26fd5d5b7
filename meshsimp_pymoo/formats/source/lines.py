"""Polylines as a file or an array gives them, before a model takes them for break lines.

Each way in ends in :func:`build_lines`, so that lines always have two vertices or more, and finite ones.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.errors import ModelError, printable, warn_of
from meshsimp_pymoo.formats.source import COORDINATE_LIMIT
from meshsimp_pymoo.reprs import brief

# Of what a file calls a line, in a message.
LONGEST_NAME = 60
_SPELLED = re.compile(r"[^(]* \((.+)\)((?:, part \d+)?)")


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


def build_lines(
    name: str,
    lines: Sequence[npt.ArrayLike],
    names: Sequence[str],
    georeference: Mapping[str, Any] | None = None,
    *,
    others: Mapping[str, int] | None = None,
) -> SourceLines:
    """Check lines and make :class:`SourceLines` of them, whose fields the parameters are.

    Parameters
    ----------
    others : mapping of str to int, optional
        What else the source holds, in the plural, and how much of it.

    Raises
    ------
    ModelError
        If there is no line, or one has coordinates that are NaN, infinite or beyond 1e75.

    Warns
    -----
    ModelWarning
        Of what else the source holds, and of lines all of whose vertices are at one place: they are left out.
    """
    left_out = Counter({what: count for what, count in (others or {}).items() if count})
    kept: list[tuple[str, FloatArray]] = []
    for called, line in zip(names, lines, strict=True):
        points = np.array(line, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] not in (2, 3):
            raise ModelError(f"{name}: {called} has the shape {points.shape}; give (n, 2) or (n, 3)")
        wrong = ~(np.abs(points) <= COORDINATE_LIMIT).all(axis=1)  # NaN is in no range
        if wrong.any():
            first = int(np.argmax(wrong))
            where = ", ".join(f"{value:g}" for value in points[first])
            raise ModelError(
                f"{name}: {called} has {wrong.sum()} of {len(points)} vertices that are NaN, infinite or beyond "
                f"{COORDINATE_LIMIT:g} (first: vertex {first} at {where}); correct or delete them"
            )
        if len(points) < 2 or (points == points[0]).all():
            left_out["lines that are one place"] += 1
        else:
            kept.append((called, points))
    said = ", ".join(f"{count} {what}" for what, count in sorted(left_out.items()))[:200]
    if not kept:
        but = f" (but {said})" if said else ""
        raise ModelError(f"{name}: holds no lines{but}; give a file of polylines")
    if said:
        warn_of(f"{name}: {said} {'is' if sum(left_out.values()) == 1 else 'are'} left out")
    return SourceLines(name, tuple(x for _, x in kept), tuple(x for x, _ in kept), dict(georeference or {}))


def spelled_name(kind: str, number: object, name: object = None) -> str:
    """Return what messages call a line.

    >>> spelled_name("feature", 12, "Mill Creek"), spelled_name("line", 3)
    ('feature 12 (Mill Creek)', 'line 3')
    """
    text = "" if name is None else " ".join(printable(name).split())[:LONGEST_NAME]
    return f"{kind} {number} ({text})" if text else f"{kind} {number}"


def given_name(called: str) -> str:
    """Return the name that a line has in its file, by what messages call it; that, where it has none.

    What is written has this name, or names would grow from file to file.

    >>> given_name("feature 12 (Mill Creek)"), given_name("feature 2 (dam (old)), part 3"), given_name("line 3")
    ('Mill Creek', 'dam (old), part 3', 'line 3')
    """
    spelled = _SPELLED.fullmatch(called)
    return spelled[1] + spelled[2] if spelled else called


def part_names(called: str, count: int) -> list[str]:
    """Return what messages call the parts of a line of so many.

    >>> part_names("feature 1", 1), part_names("feature 2", 2)
    (['feature 1'], ['feature 2, part 1', 'feature 2, part 2'])
    """
    return [called] if count == 1 else [f"{called}, part {number}" for number in range(1, count + 1)]
