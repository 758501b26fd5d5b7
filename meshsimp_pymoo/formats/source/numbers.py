"""Numbers out of text, polygons and colours: what mesh formats have in common."""

from __future__ import annotations

import codecs
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.memory import check_free

# What a byte of a text takes at least, as bytes and as text.
TEXT_BYTES = 2


def parse_numbers(text: str, name: str) -> FloatArray:
    """Parse white-space separated numbers; NaN and infinity are numbers, anything else names its place."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # older NumPy only warns about text it cannot read
        try:
            return np.fromstring(text, sep=" ")
        except (ValueError, DeprecationWarning):
            pass
    for token in text.split():
        try:
            float(token)
        except ValueError:
            raise ModelError(f"{name}: {token[:40]!r} stands where a number should; the file is damaged") from None
    return np.array(text.split(), dtype=np.float64)  # spellings that only Python knows, such as 1_000


def whole(values: FloatArray, name: str, what: str) -> IntArray:
    """Check that numbers read from text are whole and small enough to be exact."""
    good = (np.abs(values) < 2.0**53) & (np.floor(values) == values)
    if not good.all():
        raise ModelError(f"{name}: {what} {values[np.argmin(good)]:g} is not a whole number; the file is damaged")
    return values.astype(np.int64)


def fans(corners: IntArray, counts: IntArray) -> IntArray:
    """Cut polygons, listed one after the other with `counts` corners each, into triangle fans."""
    starts = np.cumsum(counts) - counts
    fan = np.maximum(counts - 2, 0)
    first = np.repeat(starts, fan)
    step = np.arange(fan.sum()) - np.repeat(np.cumsum(fan) - fan, fan)
    return np.column_stack([corners[first], corners[first + step + 1], corners[first + step + 2]])


def rgba_of(channels: list[AnyArray]) -> npt.NDArray[np.uint8] | None:
    """Make (V, 4) uint8 of 3 or 4 columns: bytes, or fractions of 1; None for anything else."""
    if all(channel.dtype == np.uint8 for channel in channels):
        columns = [channel.astype(np.uint8) for channel in channels]
    else:
        values = np.column_stack(channels).astype(np.float64)
        if values.size == 0 or not np.isfinite(values).all() or values.min() < 0:
            return None
        whole = bool((np.floor(values) == values).all())
        if values.max() > (255 if whole else 1):
            return None
        # text formats write either 0..255 or 0..1; whole numbers up to 1 are ambiguous and read as fractions
        scaled = values if values.max() > 1 else values * 255
        columns = list(np.round(scaled).astype(np.uint8).T)
    if len(columns) == 3:
        columns.append(np.full(len(columns[0]), 255, np.uint8))
    return np.column_stack(columns)


def without_mark(data: bytes) -> bytes:
    r"""Return a file's bytes without the byte order mark that editors put before text, and UTF-16 as UTF-8.

    >>> without_mark(b"\xef\xbb\xbfOFF"), without_mark("OFF".encode("utf-16")), without_mark(b"OFF")
    (b'OFF', b'OFF', b'OFF')
    """
    for mark, encoding in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding, errors="replace").encode()
    return data.removeprefix(codecs.BOM_UTF8)


def read_text(path: Path, name: str) -> str:
    """Return all of a text file, whatever byte order mark it begins with.

    Raises
    ------
    ModelError
        If it does not fit into memory.
    """
    size = path.stat().st_size
    check_free(TEXT_BYTES * size, f"{name}: its {size} bytes of text", "take a part of it")
    return without_mark(path.read_bytes()).decode("utf-8", errors="replace")


def text_lines(path: Path) -> list[str]:
    """Return a text file's lines without comments and outer blanks; empty ones stay, so that they count."""
    text = read_text(path, str(path)).replace("\\\r\n", " ").replace("\\\n", " ")
    return [line.partition("#")[0].strip() for line in text.splitlines()]


def even_table(lines: list[str], name: str, what: str, least: int) -> tuple[FloatArray, int]:
    """Parse one row per line; return (rows, width) with the columns that all lines have."""
    widths = np.array([len(line.split()) for line in lines], dtype=np.int64)
    if len(widths) == 0:
        return np.empty((0, least)), least
    if widths.min() < least:
        short = lines[int(np.argmin(widths))]
        raise ModelError(
            f"{name}: the {what} line {short[:60]!r} has fewer than {least} numbers; export the file again"
        )
    values = parse_numbers(" ".join(lines), name)
    width = int(widths.min())
    first = np.cumsum(widths) - widths
    return values[first[:, None] + np.arange(width)], width


def glimpse(data: bytes) -> str:
    """Return how a file begins, for a message."""
    text = data[:24].decode("ascii", errors="replace").split("\n")[0]
    return repr(text.replace("\ufffd", "?"))
