"""The header of ESRI's grids, a line per key, which stands before the heights or in a file of its own."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.options import Options

# Words for a number that is none: as a height, and as the height that means "no sample".
NO_NUMBERS = ("nan", "inf", "infinity", "null", "none", "na", "n/a")
# What programs write for one key; the second of a pair is the middle of the first sample, not the corner of its pixel.
NODATA = ("nodata_value", "nodata")
ORIGIN = {
    axis: (f"{axis}llcorner", (f"{axis}llcenter", f"{axis}llcentre", f"{axis}lower", f"{axis}ll")) for axis in "xy"
}
NUMBERS = {"ncols", "nrows", "cellsize", "dx", "dy", *NODATA}
NUMBERS |= {key for corner, centres in ORIGIN.values() for key in (corner, *centres)}
# A key and its value, one first or the other, with whatever else stands in the line.
LINE = re.compile(r"[ \t]*([A-Za-z_]\w*)[ \t]*(?:[ \t]|[:=])[ \t]*(\S[^\r\n]*?)[ \t]*(?:\r\n|\r|\n|$)")
TURNED = re.compile(r"[ \t]*([-+.\d][^\r\n]*?)[ \t]+([A-Za-z_]\w*)[ \t]*(?:\r\n|\r|\n|$)")
EMPTY = re.compile(r"[ \t]*(?:\r\n|\r|\n)")


@dataclass(frozen=True)
class EsriHeader:
    """What the header of a grid says.

    Attributes
    ----------
    rows, columns : int
        At least 2 of each.
    dx, dy : float
        Distances of columns and rows [file units].
    origin : (float, float)
        Where the north-western sample lies [file units].
    nodata : float or str
        Height that means "no sample"; a word where heights are text.
    byteorder : str
        As it stands there, in lower case; empty: it does not.
    """

    rows: int
    columns: int
    dx: float
    dy: float
    origin: tuple[float, float]
    nodata: float | str
    byteorder: str

    @property
    def nodata_value(self) -> float | None:
        """The height that means "no sample", if it is a number."""
        return None if isinstance(self.nodata, str) or math.isnan(self.nodata) else self.nodata


def header_lines(text: str) -> tuple[dict[str, str], int]:
    r"""Return the values by key, in lower case, and where the header ends.

    >>> header_lines("NCOLS 3\n2 nrows\nbyteorder LSBFIRST\n1 2 3\n")
    ({'ncols': '3', 'nrows': '2', 'byteorder': 'LSBFIRST'}, 35)
    """
    found: dict[str, str] = {}
    at = 0
    while match := EMPTY.match(text, at) or LINE.match(text, at) or TURNED.match(text, at):
        if match.re is not EMPTY:
            key, value = match.groups() if match.re is LINE else match.groups()[::-1]
            if key.lower() in NO_NUMBERS or (match.re is TURNED and key.lower() not in NUMBERS):
                break  # a row of heights
            found[key.lower()] = value
        at = match.end()
    return found, at


def esri_header(lines: dict[str, str], options: Options, name: str) -> EsriHeader:
    """Return what the lines of a header mean.

    Raises
    ------
    ModelError
        If one that is needed is missing, or is no number.

    Warns
    -----
    ModelWarning
        If there are keys that mean nothing here.
    """
    missing = [key for key in ("ncols", "nrows") if key not in lines]
    if options.steps is None and "cellsize" not in lines and not {"dx", "dy"} <= lines.keys():
        missing.append("cellsize")
    if missing:
        raise ModelError(
            f"{name}: its header lacks {', '.join(missing)}, so it is no ESRI grid; write it again, or check the suffix"
        )
    if unknown := sorted(lines.keys() - NUMBERS - {"byteorder"}):
        warn_of(f"{name}: the lines {', '.join(unknown)[:200]} of its header mean nothing here and were left out")
    word = next((lines[key] for key in NODATA if key in lines), "-9999")  # ESRI's default
    nodata = word if word.lower() in NO_NUMBERS[3:] else _number(word, NODATA[0], name)
    columns, rows = (_number(lines[key], key, name) for key in ("ncols", "nrows"))
    if not (2 <= columns < 2**53 and 2 <= rows < 2**53 and columns % 1 == 0 and rows % 1 == 0):
        raise ModelError(f"{name}: declares {columns:g} columns and {rows:g} rows; give at least 2 of each")
    dx, dy = options.steps or _steps(lines, name)
    for label, step in (("dx", dx), ("dy", dy)):
        if not (math.isfinite(step) and step > 0):
            raise ModelError(f"{name}: the spacing {label} is {step}; give a positive number")
    lines = _with_both_axes(lines, name)
    west, south = (_start(lines, axis, step, name) for axis, step in (("x", dx), ("y", dy)))
    return EsriHeader(
        int(rows),
        int(columns),
        dx,
        dy,
        (west, south + (rows - 1) * dy),
        nodata,
        lines.get("byteorder", "").lower(),
    )


def _number(text: str, key: str, name: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise ModelError(f"{name}: the header line {f'{key} {text}'[:60]!r} has no number; write it again") from None


def _steps(lines: dict[str, str], name: str) -> tuple[float, float]:
    both = [_number(word, "cellsize", name) for word in lines.get("cellsize", "1").split()]
    dx, dy = (
        _number(lines[key], key, name) if key in lines else step for key, step in (("dx", both[0]), ("dy", both[-1]))
    )
    return dx, dy


def _with_both_axes(lines: dict[str, str], name: str) -> dict[str, str]:
    """Return the lines with 0 where one axis says where it begins and the other one does not."""
    said = {
        axis: next((key for key in (corner, *centres) if key in lines), "")
        for axis, (corner, centres) in ORIGIN.items()
    }
    if all(said.values()) or not any(said.values()):
        return lines
    known, lacking = sorted(said, key=lambda axis: not said[axis])
    key = lacking + said[known][1:]
    warn_of(f"{name}: its header has {said[known]}, but no {key}, which is taken for 0")
    return lines | {key: "0"}


def _start(lines: dict[str, str], axis: str, step: float, name: str) -> float:
    """Return the middle of the first sample along an axis, from the west or the south."""
    corner, centres = ORIGIN[axis]
    for key in centres:
        if key in lines:
            return _number(lines[key], key, name)
    return _number(lines[corner], corner, name) + step / 2 if corner in lines else 0.0
