"""Arguments that several commands take, made of the package's tables, and the types of values.

Nothing heavy is imported here, so that ``--help`` is quick. A parsed command line becomes objects at once
(:func:`settings_from`), and those travel, not the namespace.
"""

from __future__ import annotations

import argparse
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

from meshsimp_pymoo.errors import UsageError
from meshsimp_pymoo.formats.table import line_suffixes, read_suffixes, written_formats
from meshsimp_pymoo.settings import Choice, Real, Whole, defaults_of, settings_of
from meshsimp_pymoo.surface.measures import MEASURES

SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}

Settings = TypeVar("Settings")


def models() -> str:
    """Return what a model may be, for the end of a help."""
    of_mesh, of_grid, of_cloud = (", ".join(read_suffixes(sort, further=False)) for sort in ("mesh", "grid", "cloud"))
    text = (
        f"MODEL is a mesh ({of_mesh}, ...), a height grid ({of_grid}), a point cloud ({of_cloud}) or a built-in model "
        "such as jacksboro:11, face:5000 or roof; `meshsimp info` lists the built-in ones. Break lines are read from "
        f"{', '.join(line_suffixes())}."
    )
    return textwrap.fill(text, 80) + "\n"


# ---------------------------------------------------------------------------------------------- from a table to options


def add_settings(parser: Any, kind: type[Any], *, only: Sequence[str] = (), **otherwise: str) -> None:
    """Add an option for each setting of a class (see `meshsimp_pymoo.settings`), or for some of them.

    Parameters
    ----------
    parser : argparse parser or group
        Where.
    kind : type
        The class.
    only : sequence of str
        Names of the settings; by default all that a user says himself.
    **otherwise
        What the help says of the default of a setting, where that is found out later: then the value is None.
    """
    own = defaults_of(kind)
    for name, known in settings_of(kind).items():
        if known.derived or (only and name not in only):
            continue
        values: dict[str, Any] = {"type": typed(known.kind.from_text), "metavar": known.metavar or None}
        if isinstance(known.kind, Choice):
            values = {"choices": known.kind.names}
        default = None if name in otherwise else own[name]
        said = otherwise.get(name, str(default) if isinstance(known.kind, Choice) and default is not None else "")
        help_text = known.help + (f" (default: {said})" if said else "")
        parser.add_argument(option(name), default=default, help=help_text, **values)


def settings_from(args: argparse.Namespace, kind: type[Settings], **derived: Any) -> Settings:
    """Return the settings of a class that the command line names, the others by default."""
    names = [name for name, known in settings_of(kind).items() if not known.derived and hasattr(args, name)]
    given = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    return kind(**given | derived)


def add_wishes(wanted: Any) -> None:
    """Add the ways to say which mesh of a front is wanted: one for each measure that has one."""
    for name, measure in MEASURES.items():
        if measure.wish:
            parse: Callable[[str], Any]
            if measure.unit:
                parse, metavar, further = Real(0).from_text, "E", ""
            else:
                parse, metavar, further = count_or_share, "N", ", or of that share of the original's (10%%)"
            wanted.add_argument(option(name), type=typed(parse), metavar=metavar, help=measure.wish + further)


def wishes_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return the limits that the command line names, by measure."""
    wished = {name: getattr(args, name) for name, measure in MEASURES.items() if measure.wish}
    return {name: limit for name, limit in wished.items() if limit is not None}


def in_numbers_of(limits: Mapping[str, Any], original: Callable[[], int]) -> dict[str, Any]:
    """Return limits with numbers of triangles for shares of the original's; these are asked for where it matters."""
    return {name: limit.of(original()) if isinstance(limit, Share) else limit for name, limit in limits.items()}


def option(name: str) -> str:
    """Return what the command line calls a setting or a measure."""
    return "--" + name.replace("_", "-")


# ------------------------------------------------------------------------------------------- what several commands take


def add_model(parser: argparse.ArgumentParser, kind: type[Any], **how: Any) -> None:
    """Add the model and how it is read, ``kind`` being `Options`."""
    parser.add_argument("model", metavar="MODEL", **how)
    add_settings(parser.add_argument_group("how to read the model"), kind)
    parser.epilog = models()


def add_shown(parser: Any, *, quiet: bool = True) -> None:
    """Add how much is said."""
    if quiet:
        parser.add_argument("-q", "--quiet", action="store_true", help="no progress and no summary")
    parser.add_argument("--json", action="store_true", help="the summary as JSON" if quiet else "as JSON")


def add_solid(parser: Any, what: str) -> None:
    """Add how a mesh is made solid."""
    parser.add_argument(
        "--solid",
        type=typed(Real(0, strict=True).from_text),
        metavar="T",
        help=f"close {what} for printing: by walls along its outline and holes, and a flat base T below its lowest "
        "point [units of height]",
    )


def add_workers(parser: Any) -> None:
    """Add where work is done."""
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument("--jobs", type=whole(1), metavar="N", help="processes (default: one for each core)")
    workers.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a Dask cluster that does the work, such as tcp://host:8786"
    )


def add_checkpoint(parser: Any, what: str, besides: str) -> None:
    """Add how often the state of a search is saved."""
    parser.add_argument(
        "--checkpoint",
        type=interval,
        default=60.0,
        metavar="T|none",
        help=f"how often {what}, so that the same command goes on after a crash{besides} (default: 60s)",
    )


# ------------------------------------------------------------------------------------------------------ types of values


def typed(parse: Callable[[str], Any]) -> Callable[[str], Any]:
    """Return a parser of words for argparse, which shows the text of an error of its own class only."""

    def convert(text: str) -> Any:
        try:
            return parse(text)
        except ValueError as problem:
            raise argparse.ArgumentTypeError(str(problem)) from None

    return convert


def whole(least: int) -> Callable[[str], Any]:
    """Return the type of whole numbers of at least this."""
    return typed(Whole(least).from_text)


class Share(NamedTuple):
    """A number of things as a share of the original's, whose number is known when that is open."""

    percent: float

    def of(self, count: int) -> int:
        """Return the number, rounded down, but at least 1.

        >>> Share(10.0).of(5813), Share(29.0).of(100), Share(0.01).of(100)
        (581, 29, 1)
        """
        return max(1, int(self.percent * count / 100))


def count_or_share(text: str) -> int | Share:
    """Return the whole number of "500", or the share of "10%"."""
    if not text.endswith("%"):
        return Whole(1).from_text(text)
    percent = Real(0, strict=True).from_text(text[:-1])
    if percent > 100:
        raise ValueError(f"{text!r} is more than all of the original's")
    return Share(percent)


def tile(text: str) -> int:
    """Return the side of a tile; 0: none."""
    return 0 if text == "none" else int(whole(64)(text))


def duration(text: str) -> float:
    """Return the seconds of "60s", "10min" or "1h"."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([a-z]*)", text.strip().lower())
    if not match or match[2] not in SECONDS or float(match[1]) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a duration; write 60s, 10min or 1h")
    return float(match[1]) * SECONDS[match[2]]


def interval(text: str) -> float | None:
    """Return the seconds of a duration, or None for "none"."""
    return None if text == "none" else duration(text)


def mesh_count(text: str) -> int | None:
    """Return how many meshes; None: all."""
    if text == "all":
        return None
    return 0 if text == "none" else int(whole(0)(text))


def format_name(text: str) -> str:
    """Return the name of a format that is written, of its name or its suffix; other words as they are.

    >>> format_name("xml"), format_name("PLY"), format_name("dxf")
    ('landxml', 'ply', 'dxf')
    """
    word = text.lower()
    return next((kind.name for kind in written_formats().values() if f".{word}" in kind.suffixes), word)


def numbered(front: Any, count: int, number: int) -> int:
    """Return the number of a solution of a front, if it has so many."""
    if number >= count:
        raise UsageError(f"{front}: has the solutions 0 to {count - 1}; --solution {number} is none of them")
    return number
