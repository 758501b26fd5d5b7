"""Point clouds as text, a point in every line: .xyz, .pts, .txt and .csv, with a header that names columns or without.

Numbers may stand between semicolons, tabs, commas or blanks, with decimal commas where commas do not separate; quotes,
comments behind ``#`` or ``//``, a byte order mark and a line with the number of points are understood. Which columns
are x, y and z says the user, else the header by the usual names, else they are the first three columns of numbers.
"""

from __future__ import annotations

import contextlib
import csv
import itertools
import math
import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray
    from meshsimp_pymoo.formats.source import SourceMesh

# Characters of text that are looked at together, and most of a line.
CHUNK_SIZE = 1 << 22
LONGEST_LINE = 1 << 16
BLANK = " "
SEPARATORS = (";", "\t", ",", BLANK)
COMMENT = re.compile(r"(?:#|//).*")
COMMENT_LINE = re.compile(r"^\s*(?:#|//).*", re.MULTILINE)
# A unit behind a name in a header: in brackets, or behind an underscore.
UNIT = re.compile(r"\s*[\[(][^\])]*[\])]")
UNIT_ENDING = re.compile(r"_(?:m|ft|deg|metres?|meters?|feet)$")
# What stands where a number is missing, with a sign or without.
MISSING = {"", "nan", "na", "n/a", "null", "none", "nan(ind)"}
# What the columns of x and y are called, in pairs, the likeliest first, and that of z.
EAST_NORTH = (
    (("x",), ("y",)),
    (("point_x", "x_coord", "xcoord", "coord_x"), ("point_y", "y_coord", "ycoord", "coord_y")),
    (("easting", "east", "e", "rechtswert", "ostwert"), ("northing", "north", "n", "hochwert", "nordwert")),
    (("longitude", "lon", "long", "lng"), ("latitude", "lat")),
)
DEGREES = EAST_NORTH[-1]
HEIGHT = (
    "z", "point_z", "z_coord", "zcoord", "coord_z",
    "height", "elevation", "elev", "altitude", "alt", "h", "höhe", "hoehe",
)  # fmt: skip
NORMALS = ("nx", "ny", "nz")
COLORED = ("x", "y", "z", "red", "green", "blue")
# What Leica writes as .pts.
REFLECTING = {4: ("x", "y", "z", "intensity"), 7: ("x", "y", "z", "intensity", "red", "green", "blue")}


# Lines, each time with the number of the first one.
Chunks = Iterable[tuple[int, list[str]]]


class Head(NamedTuple):
    """What stands before the first point, and how that one looks.

    Attributes
    ----------
    comments : list of str
        The last lines of comment.
    header : str
        The line of names; empty: there is none.
    declared : int or None
        The number of points.
    separator : str
        What stands between two columns.
    fields : list of str
        The first point.
    """

    comments: list[str]
    header: str
    declared: int | None
    separator: str
    fields: list[str]


class Layout(NamedTuple):
    """How lines are cut, and what their columns mean.

    Attributes
    ----------
    separator : str
        What stands between two columns.
    width : int
        Number of columns.
    axes : list of int
        Columns of x, y and z.
    names : dict of int to str
        Names of others, of which attributes are made if they are numbers.
    guessed : bool
        Whether nobody said the names: they may be wrong.
    loose : bool
        Whether there is text beside the numbers; then lines may differ in length, and hold what begins comments.
    unit : str
        Of x and y, if their names say it.
    """

    separator: str
    width: int
    axes: list[int]
    names: dict[int, str]
    guessed: bool
    loose: bool
    unit: str


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    from meshsimp_pymoo.formats.source.numbers import with_color
    from meshsimp_pymoo.formats.source.points import read_cloud

    with path.open("rb") as stream:
        begin = stream.read(4096)
    wide = begin.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in begin and not wide:
        raise ModelError(f"{name}: holds zero bytes, so it is no text of x y z; check the suffix")
    head, chunks = _head(_chunks(path, "utf-16" if wide else "utf-8-sig", name), name)
    layout = _layout(head, path.suffix.lower(), options.columns, name)
    points, columns = _table(chunks, layout, name)
    if head.declared is not None and head.declared != len(points):
        raise ModelError(f"{name}: declares {head.declared} points, but {len(points)} follow; copy or export it again")
    texts = {f"{key!r}" for key, values in columns.items() if values is None}
    attributes = with_color({key: values for key, values in columns.items() if values is not None})
    if layout.guessed:
        attributes = {key: values for key, values in attributes.items() if key in ("color", "intensity")}
        texts = {f"no. {k + 1}" for k, field in enumerate(head.fields) if not _is_number(field)}
        if options.columns is None:
            _warn_of_counting(points[:, 0], head, name)
    if texts:
        warn_of(f"{name}: columns without numbers stay behind: {', '.join(sorted(texts))}")
    facts = {"unit": layout.unit} if layout.unit else {}
    return read_cloud(points, options, attributes=attributes, name=name, georeference=facts)


# --------------------------------------------------------------------------------------------- what the columns mean


def _head(chunks: Chunks, name: str) -> tuple[Head, Chunks]:
    """Read up to the first point; return what stands there, and all lines from that point on."""
    comments: list[str] = []
    header, declared = "", None
    for number, lines in chunks:
        for i, line in enumerate(lines):
            text = COMMENT.sub("", line).strip()
            if not text:
                comments = [*comments[-9:], line.strip()] if line.strip() else comments
                continue
            if declared is None and text.isdecimal() and len(text) < 20:
                declared = int(text)
                continue
            # a comment mark may belong to a text
            separator, fields = next(filter(any, map(_cut, (text, line))), ("", []))
            if separator and not _find_axes(_plain(fields))[0]:
                chunks = itertools.chain([(number + i, lines[i:])], chunks)
                return Head(comments, header, declared, separator, fields), chunks
            said = f"{name}: its line {number + i}, {text[:60]!r},"
            if not _find_axes(_plain(_names(text)))[0] and any(map(_is_number, text.split())):
                raise ModelError(
                    f"{said} has fewer than 3 numbers between the same separators; write x y z in every line"
                )
            if header:
                raise ModelError(
                    f"{said} is the second one without numbers; write the names of the columns in one line"
                )
            header = text
    if header:
        raise ModelError(f"{name}: no line of 3 numbers follows on the line {header[:60]!r}; write x y z in every line")
    raise ModelError(f"{name}: has 0 vertices; at least 4 are needed")


def _cut(line: str) -> tuple[str, list[str]]:
    """Return what separates three numbers or more of a line, and its fields; nothing, if nothing does."""
    for separator in SEPARATORS:
        fields = _split(_points(line, separator), separator)
        if sum(map(_is_number, fields)) >= 3 and any(field.strip() for field in fields):
            return separator, fields
    return "", []


def _points(text: str, separator: str) -> str:
    """Return a text with decimal points in place of decimal commas, where commas do not separate."""
    return text if separator == "," else text.replace(",", ".")


def _split(line: str, separator: str) -> list[str]:
    if '"' in line:
        with contextlib.suppress(csv.Error):
            return next(csv.reader((line,), delimiter=separator, skipinitialspace=True), [])
    return line.split() if separator == BLANK else line.split(separator)


def _is_number(field: str) -> bool:
    return _is_real(field) or _is_missing(field)


def _is_missing(field: str) -> bool:
    return field.strip().lower().lstrip("+-") in MISSING


def _is_real(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _names(text: str, separator: str = "", width: int = 0) -> list[str]:
    """Return the names of columns in a header, which may be separated as its points are or otherwise."""
    text = UNIT.sub("", text.lstrip("#/"))
    fields = _split(text, separator) if separator else []
    if len(fields) <= 1 or (width and len(fields) != width):
        others = re.split(r"[\s,;]+", text.strip())
        fields = others if len(others) == width or len(fields) <= 1 else fields
    names = [field.strip(" \t\"'") for field in fields]
    while names and not names[-1]:
        names.pop()
    return names


def _plain(names: list[str]) -> list[str]:
    """Return names as the tables here spell them.

    >>> _plain(["Easting_m", "X coord", "Elevation (m)"])
    ['easting', 'x_coord', 'elevation']
    """
    spelled = [re.sub(r"[\s.\-]+", "_", UNIT.sub("", name).strip(" \t\"'").lower()) for name in names]
    return [UNIT_ENDING.sub("", name) for name in spelled]


def _find_axes(plain: list[str]) -> tuple[list[int], str, int]:
    """Return the columns of x, y and z by their names, the unit of x and y, and how many choices there were."""
    pairs = [
        (plain.index(x), plain.index(y), "degree" if (easts, norths) == DEGREES else "")
        for easts, norths in EAST_NORTH
        for x in easts
        for y in norths
        if x in plain and y in plain
    ]
    heights = [plain.index(z) for z in HEIGHT if z in plain]
    if not pairs or not heights:
        return [], "", 0
    x, y, unit = pairs[0]
    return [x, y, heights[0]], unit, len(pairs) * len(heights)


def _layout(head: Head, suffix: str, wanted: tuple[str | int, ...] | None, name: str) -> Layout:
    """Find out which columns are x, y and z, and which have names."""
    width = len(head.fields)
    names = _names(head.header, head.separator, width) if head.header else []
    for comment in reversed(head.comments):
        said = _names(comment, head.separator, width)
        if not names and len(said) == width and _find_axes(_plain(said))[0]:
            names = said
    guessed = not names
    axes, unit, choices = _find_axes(_plain(names))
    numeric = [k for k, field in enumerate(head.fields) if _is_number(field)]
    loose = len(numeric) < width or len(names) > width
    if guessed and not loose:
        colored = COLORED if width >= 6 else ()
        names = list(REFLECTING.get(width, colored) if suffix == ".pts" else colored)
    width = max(width, len(names))
    if wanted is not None:
        axes = [_column(column, [] if guessed else names, width, name) for column in wanted]
        unit = unit * (_find_axes(_plain(names))[0][:2] == axes[:2])
    elif guessed:
        axes = numeric[:3]
    elif not axes:
        raise ModelError(
            f"{name}: its header {head.header[:60]!r} neither holds numbers nor names columns x, y and z, or easting, "
            "northing and height; say which columns they are, by name or number (--columns)"
        )
    elif choices > 1:
        taken = ", ".join(names[k] for k in axes)
        warn_of(f"{name}: several of its columns may be x, y and z; {taken} are taken (--columns says others)")
    # a name that is that of a coordinate in other files would hide it there
    others = {
        k: f"{key}_in_file" if key.lower() in ("x", "y", "z") else key
        for k, key in enumerate(names)
        if key and k not in axes and key.lower() not in NORMALS
    }
    return Layout(head.separator, width, axes, others, guessed, loose, unit)


def _column(wanted: str | int, names: list[str], width: int, name: str) -> int:
    """Return the column of this name or number from 1."""
    if isinstance(wanted, int):
        if wanted > width:
            raise ModelError(f"{name}: has no column {wanted}, but {width} of them; give other --columns")
        return wanted - 1
    for spell in (list, _plain):
        if spell([wanted])[0] in spell(names):
            return spell(names).index(spell([wanted])[0])
    has = f"but {', '.join(names)}" if names else "since no line names its columns"
    raise ModelError(f"{name}: has no column {wanted!r}, {has}; give other --columns, by name or number from 1")


def _warn_of_counting(x: FloatArray, head: Head, name: str) -> None:
    """Warn if what is taken for x, since nobody says what it is, only numbers the points."""
    import numpy as np

    numeric = [k + 1 for k, field in enumerate(head.fields) if _is_number(field)]
    if len(numeric) >= 4 and (x == np.floor(x)).all() and (np.diff(x) > 0).all():
        others = ",".join(map(str, numeric[1:4]))
        warn_of(
            f"{name}: its first column of numbers only counts ({', '.join(f'{value:g}' for value in x[:3])}, ...), yet "
            f"is taken for x; if it numbers the points, say which columns are x, y and height (--columns {others})"
        )


# ------------------------------------------------------------------------------------------------------- their numbers


def _chunks(path: Path, encoding: str, name: str) -> Chunks:
    """Read a text by its lines, many at once, each time with the number of the first one."""
    number, rest = 1, ""
    with path.open(encoding=encoding, errors="replace") as stream:
        while text := stream.read(CHUNK_SIZE):
            *lines, rest = (rest + text).split("\n")
            if len(rest) > LONGEST_LINE:
                raise ModelError(
                    f"{name}: its line {number + len(lines)} has more than {LONGEST_LINE} characters; write x y z in "
                    "every line"
                )
            yield number, lines
            number += len(lines)
    yield number, [rest]


def _table(chunks: Chunks, layout: Layout, name: str) -> tuple[FloatArray, dict[str, FloatArray | None]]:
    """Return the points (P, 3) and the other named columns (P,), NaN where there is no number; None: one is text."""
    import numpy as np

    parts: list[list[FloatArray]] = []
    texts: set[str] = set()
    wanted = [*layout.axes, *layout.names]
    for number, lines in chunks:
        if (table := _even_numbers(lines, layout)) is not None:
            parts.append([table[:, k] for k in wanted])
            continue
        places, rows = _rows(number, lines, layout, name)
        if not rows:
            continue
        columns = list(zip(*rows, strict=True))
        parts.append([np.array([float(x) if _is_real(x) else math.nan for x in columns[k]]) for k in wanted])
        for k, values in zip(wanted, parts[-1], strict=True):
            wrong = (i for i in np.flatnonzero(~np.isfinite(values)) if not _is_missing(columns[k][i]))
            if (first := next(wrong, None)) is None:
                continue
            if k in layout.axes:
                raise ModelError(
                    f"{name}: {columns[k][first].strip()[:40]!r} stands where a finite number should, in line "
                    f"{places[first]}; correct that line or leave it out"
                )
            texts.add(layout.names[k])
    x, y, z, *others = (np.concatenate(column) for column in zip(*parts, strict=True))
    numbers = dict(zip(layout.names.values(), others, strict=True))
    texts |= {key for key, values in numbers.items() if np.isnan(values).all()}
    return np.column_stack([x, y, z]), {key: None if key in texts else values for key, values in numbers.items()}


def _even_numbers(lines: list[str], layout: Layout) -> FloatArray | None:
    """Return the numbers (L, width) of lines that hold nothing else and have one length, at once; None: others."""
    import numpy as np

    text = "\n".join(lines).strip("\n")
    n_lines, separator = text.count("\n") + 1, layout.separator
    if layout.loose or (separator != BLANK and text.count(separator) != n_lines * (layout.width - 1)):
        return None
    # each line ends in a number that is none of a point
    text = _points(text, separator).replace(separator, " ").replace("\n", " inf ") + " inf"
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # older NumPy only warns about text it cannot read
        try:
            numbers = np.fromstring(text, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    if len(numbers) != n_lines * (layout.width + 1):
        return None
    table = numbers.reshape(n_lines, layout.width + 1)
    even = np.isinf(table[:, -1]).all() and not np.isinf(table[:, :-1]).any()
    return table[:, :-1] if even else None


def _rows(number: int, lines: list[str], layout: Layout, name: str) -> tuple[list[int], list[list[str]]]:
    """Cut lines that are not blank into the fields of their columns; return their numbers in the file, too."""
    separator, width = layout.separator, layout.width
    text = "\n".join(lines)
    if "#" in text or "//" in text:
        mark = COMMENT_LINE if layout.loose else COMMENT
        text = mark.sub("", text)
    lines = _points(text, separator).split("\n")
    places = [number + i for i, line in enumerate(lines) if line and not line.isspace()]
    rows = [_split(line, separator) for line in lines if line and not line.isspace()]
    if not layout.loose and all(len(row) == width for row in rows):
        return places, rows
    for place, row in zip(places, rows, strict=True):
        if not max(layout.axes) < len(row) or (len(row) != width and not layout.loose):
            wanted = f"{max(layout.axes) + 1} are needed" if layout.loose else f"the first one has {width}"
            raise ModelError(f"{name}: its line {place} has {len(row)} columns, where {wanted}; export it again")
    return places, [(row + [""] * (width - len(row)))[:width] for row in rows]


register(Format("xyz", (".xyz", ".pts", ".txt", ".csv"), "text of x y z", "cloud", read=_read))
