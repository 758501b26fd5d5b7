"""Point clouds as text, x y z in every line: .xyz, .pts, .txt and .csv."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray
    from meshsimp_pymoo.formats.source import SourceMesh

# What stands between numbers beside line ends, once commas and semicolons are blanks.
SPACES = b" \t\r\v\f"
# Bytes of text that are looked at together.
CHUNK_BYTES = 1 << 23


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    from meshsimp_pymoo.formats.source.points import cloud_source

    points, attributes = _read_table(path, name)
    return cloud_source(points, max_edge=options.max_edge, scale=options.scale, attributes=attributes, name=name)


def _read_table(path: Path, name: str) -> tuple[FloatArray, dict[str, Any]]:
    """Read lines of numbers, between blanks, commas or semicolons: x y z, and red green blue as the fourth to sixth."""
    import numpy as np

    from meshsimp_pymoo.formats.source.numbers import parse_numbers, rgba_of

    text = path.read_bytes()
    if b"\0" in text[:4096]:
        raise ModelError(f"{name}: holds zero bytes, so it is no text of x y z; check the suffix")
    text = re.sub(rb"(?:#|//)[^\n\r]*", b"", text).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = text.removeprefix(b"\xef\xbb\xbf").lstrip()
    head, columns, declared = _head(text, name, path.suffix.lower())
    body = _plain_numbers(text[head:], name)
    width, count = _table_shape(body, name, columns)
    table = parse_numbers(body.decode("ascii", errors="replace"), name)
    if len(table) != width * count:
        raise ModelError(f"{name}: holds {len(table)} numbers in {count} lines of {width}; the file is damaged")
    if declared is not None and declared != count:
        raise ModelError(f"{name}: declares {declared} points, but {count} follow; copy or export it again")
    table = table.reshape(count, width)
    attributes: dict[str, Any] = {}
    if columns is None and width >= 6 and (color := rgba_of(list(table[:, 3:6].T))) is not None:
        attributes["color"] = color
    order = list(columns) if columns is not None else [0, 1, 2]
    return np.ascontiguousarray(table[:, order]), attributes


def _head(text: bytes, name: str, suffix: str) -> tuple[int, tuple[int, int, int] | None, int | None]:
    """Return where the numbers begin, the columns of x, y and z and the number of points, if the first line says so."""
    line, _, _ = text.partition(b"\n")
    words = [word.strip(" \t\"'").lower() for word in re.split(r"[\s,;]+", line.decode("utf-8", errors="replace"))]
    words = [word for word in words if word]
    if suffix == ".pts" and len(words) == 1 and words[0].isdigit() and len(words[0]) < 20:
        return len(line), None, int(words[0])
    if not words or _is_number(words[0]):
        return 0, None, None
    if not set("xyz") <= set(words):
        raise ModelError(
            f"{name}: its first line {line[:60].decode('utf-8', errors='replace')!r} neither holds numbers nor names "
            "the columns x, y and z; write x y z in every line"
        )
    x, y, z = (words.index(axis) for axis in "xyz")
    return len(line), (x, y, z), None


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _plain_numbers(body: bytes, name: str) -> bytes:
    """Return the text with blanks between numbers and points in them, whatever stood there."""
    line = body.lstrip().partition(b"\n")[0]
    if b";" in line:
        return body.replace(b",", b".").replace(b";", b" ")
    words = line.split()
    if b"," in line and len(words) >= 3 and all(re.fullmatch(rb"[^,]*(,[^,]+)?", word) for word in words):
        return body.replace(b",", b".")  # 1,5 2,5 3,0
    return body.replace(b",", b" ")


def _table_shape(body: bytes, name: str, columns: tuple[int, int, int] | None) -> tuple[int, int]:
    """Return (numbers in a line, lines), after comparing every line with the first one."""
    import numpy as np

    least = 3 if columns is None else max(columns) + 1
    width, count, start = 0, 0, 0
    while start < len(body):
        end = body.rfind(b"\n", start, start + CHUNK_BYTES) + 1
        end = end if end > start and start + CHUNK_BYTES < len(body) else len(body)
        part = np.frombuffer(body, np.uint8, count=end - start, offset=start)
        newline = part == ord("\n")
        blank = newline | np.isin(part, np.frombuffer(SPACES, np.uint8))
        starts = ~blank
        starts[1:] &= blank[:-1]
        ends = np.append(np.flatnonzero(newline), len(part))
        words = np.diff(np.searchsorted(np.flatnonzero(starts), ends), prepend=0)
        words = words[words > 0]
        if len(words):
            width = width or int(words[0])
            wrong = np.flatnonzero((words != width) | (words < least))
            if len(wrong):
                k = int(wrong[0])
                wanted = f"the first has {width}" if width >= least else f"{least} are needed"
                raise ModelError(
                    f"{name}: the {count + k + 1}. line of numbers has {words[k]}, where {wanted}; export it again"
                )
            count += len(words)
        start = end
    if count < 4:
        raise ModelError(f"{name}: has {count} vertices; at least 4 are needed")
    return width, count


register(Format("xyz", (".xyz", ".pts", ".txt", ".csv"), "text of x y z", "cloud", read=_read))
