"""What the points of a laser scan hit: the classes of LAS, their names, and which of them are taken."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, IntArray
from meshsimp_pymoo.errors import ModelError, warn_of

GROUND = 2
# Of the LAS specification 1.4, R15; up to 63 others are reserved, beyond they are the user's.
CLASS_NAMES = {
    0: "never classified",
    1: "unclassified",
    GROUND: "ground",
    3: "low vegetation",
    4: "medium vegetation",
    5: "high vegetation",
    6: "building",
    7: "low noise",
    8: "model key-point",
    9: "water",
    10: "rail",
    11: "road surface",
    12: "overlap",
    13: "wire guard",
    14: "wire conductor",
    15: "transmission tower",
    16: "wire connector",
    17: "bridge deck",
    18: "high noise",
    19: "overhead structure",
    20: "ignored ground",
    21: "snow",
    22: "temporal exclusion",
}
# What the column of classes is called, beside a prefix of some programs.
COLUMN_NAMES = ("classification", "class")
COLUMN_PREFIX = "scalar_"


def classes_of(attributes: Mapping[str, npt.ArrayLike]) -> IntArray | None:
    """Return the classes (P,) among the data of points, if there are any: whole numbers from 0 to 255."""
    for key, column in attributes.items():
        values = np.asarray(column)
        if (
            key.lower().removeprefix(COLUMN_PREFIX) not in COLUMN_NAMES
            or values.ndim != 1
            or values.dtype.kind not in "iuf"
        ):
            continue
        if ((values >= 0) & (values <= 255) & (values == np.floor(values))).all():
            return values.astype(np.int64)
    return None


def count_classes(classes: AnyArray) -> dict[str, int]:
    """Return the number of points of each class that occurs, as run.json has it.

    >>> count_classes(np.array([2, 5, 2]))
    {'2': 2, '5': 1}
    """
    numbers, counts = np.unique(classes, return_counts=True)
    return {str(number): int(count) for number, count in zip(numbers, counts, strict=True)}


def classes_in_words(counts: Mapping[str, int]) -> str:
    """Return classes with their names and numbers of points.

    >>> classes_in_words({"2": 1200, "64": 7})
    '2 ground (1,200), 64 of the user (7)'
    """
    names = {
        number: CLASS_NAMES.get(int(number), "of the user" if int(number) > 63 else "reserved") for number in counts
    }
    return ", ".join(f"{number} {names[number]} ({count:,})" for number, count in counts.items())


def check_classes(counts: Mapping[str, int], wanted: tuple[int, ...] | None, name: str) -> None:
    """Refuse classes of which there is no point, and say what is taken where that may not be what is meant.

    Parameters
    ----------
    counts : mapping of str to int
        See :func:`count_classes`.
    wanted : tuple of int, optional
        The classes that are taken; None: all.
    name : str
        What messages call the cloud.

    Raises
    ------
    ModelError
        If there is no point of any of these classes.

    Warns
    -----
    ModelWarning
        If there are none of some of them; or if all are taken, ground and others.
    """
    if wanted is None:
        others = {number: count for number, count in counts.items() if number != str(GROUND)}
        if others and str(GROUND) in counts:
            warn_of(
                f"{name}: {counts[str(GROUND)]:,} of its points are ground, others {classes_in_words(others)}; all of "
                f"them become surface: for the terrain alone say classes={GROUND} (--classes {GROUND})"
            )
        return
    absent = [number for number in wanted if str(number) not in counts]
    if not absent:
        return
    said = f"{name}: has no points of class {', '.join(map(str, absent))}, but of {classes_in_words(counts)}"
    if len(absent) == len(wanted):
        raise ModelError(f"{said}; take some of these classes")
    warn_of(said)
