"""What a user may set, declared once: a field of a frozen dataclass with its default, its meaning and its values.

`Options` (how a model is read) and `Rules` (what counts) are such classes. From their fields come the keyword arguments
of ``MeshProblem`` and their documentation, the options of the shell command, the keys of a YAML file, and what a folder
stores and reads back. A new setting is a new field, and nothing else. Nothing heavy is imported here: the shell
command's ``--help`` is made of it.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from typing import Any, NamedTuple, Protocol, TypeVar

# A whole number beyond this is not exact as a float any more; a real one beyond MOST_REAL overflows when squared twice.
MOST_WHOLE = 2**53
MOST_REAL = 1e300


class Kind(Protocol):
    """What values a setting takes; both ways to read one raise a ValueError that says what was expected."""

    def from_text(self, text: str) -> Any:
        """Return the value that a word of a command line means."""
        ...

    def from_plain(self, value: Any) -> Any:
        """Return the value that plain data (of YAML, of JSON) means."""
        ...


class Choice(NamedTuple):
    """One of a few words."""

    names: tuple[str, ...]

    def from_text(self, text: str) -> str:
        """Return the word."""
        return self.from_plain(text)

    def from_plain(self, value: Any) -> str:
        """Return the word."""
        if value in self.names:
            return str(value)
        near = difflib.get_close_matches(str(value).lower(), self.names, 1, 0.6)
        meant = f"unknown (did you mean {near[0]!r}?); " if near else ""
        raise ValueError(f"{meant}expected one of {', '.join(self.names)}")


class Text:
    """A name."""

    def from_text(self, text: str) -> str:
        """Return the name."""
        return text

    def from_plain(self, value: Any) -> str:
        """Return the name."""
        if not isinstance(value, str) or not value.strip():
            raise ValueError("expected a text")
        return value


class Whole(NamedTuple):
    """A whole number."""

    least: int = 0

    def from_text(self, text: str) -> int:
        """Return the number."""
        if not re.fullmatch(r"[+-]?\d+", text) or int(text) < self.least:
            raise ValueError(f"{text!r} is not a whole number of at least {self.least}")
        return int(text)

    def from_plain(self, value: Any) -> int:
        """Return the number."""
        if isinstance(value, bool) or not isinstance(value, int) or not self.least <= value <= MOST_WHOLE:
            most = " and at most 2**53" if isinstance(value, int) and value > MOST_WHOLE else ""
            raise ValueError(f"expected a whole number of at least {self.least}{most}")
        return value


class Real(NamedTuple):
    """A finite number, at least (or, with ``strict``, above) the least."""

    least: float | None = None
    strict: bool = False

    def from_text(self, text: str) -> float:
        """Return the number."""
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{text!r} is not a finite number")
        if self.least is not None and self.strict and value <= self.least:
            raise ValueError(f"{text!r} is not {'positive' if self.least == 0 else f'above {self.least:g}'}")
        if self.least is not None and value < self.least:
            raise ValueError(f"{text!r} is below {self.least:g}")
        return value

    def from_plain(self, value: Any) -> float:
        """Return the number."""
        is_number = not isinstance(value, bool) and isinstance(value, (int, float))
        if (
            not is_number
            or not abs(value) < MOST_REAL
            or (self.least is not None and (value < self.least or (self.strict and value == self.least)))
        ):
            limit = "" if self.least is None else f" {'of more than' if self.strict else 'of at least'} {self.least:g}"
            limit += f" and below {MOST_REAL:g}" if is_number and abs(value) >= MOST_REAL else ""
            raise ValueError(f"expected a number{limit}")
        return float(value)


class Steps:
    """One or two positive numbers, as a pair."""

    def from_text(self, text: str) -> tuple[float, float]:
        """Return the pair that ``D`` or ``DX,DY`` means."""
        values = [Real().from_text(part) for part in text.split(",")]
        if len(values) not in (1, 2) or min(values) <= 0:
            raise ValueError(f"{text!r} is not one or two positive numbers")
        return values[0], values[-1]

    def from_plain(self, value: Any) -> tuple[float, float]:
        """Return the pair that a number or a list of one or two means."""
        steps = [Real(0, strict=True).from_plain(step) for step in (value if isinstance(value, list) else [value])]
        if len(steps) not in (1, 2):
            raise ValueError("expected one number or two, [dx, dy]")
        return steps[0], steps[-1]


class Part:
    """A part of a grid: column, row, columns, rows."""

    def from_text(self, text: str) -> tuple[int, ...]:
        """Return the four numbers."""
        parts = text.split(",")
        if len(parts) != 4:
            raise ValueError(f"{text!r} is not COLUMN,ROW,COLUMNS,ROWS")
        return tuple(Whole(least).from_text(part) for part, least in zip(parts, (0, 0, 2, 2), strict=True))

    def from_plain(self, value: Any) -> tuple[int, ...]:
        """Return the four numbers."""
        if not isinstance(value, list) or len(value) != 4:
            raise ValueError("expected [column, row, columns, rows]")
        return tuple(Whole(0).from_plain(part) for part in value)


class Direction:
    """A direction in space: "auto", an axis with or without a sign, or three numbers."""

    def from_text(self, text: str) -> str:
        """Return the text; what it means is found out beside the model."""
        return text

    def from_plain(self, value: Any) -> str | list[float]:
        """Return a text or three numbers that are not all 0."""
        if isinstance(value, str) and value.strip():
            return value
        if isinstance(value, list) and len(value) == 3:
            vector = [Real().from_plain(part) for part in value]
            if any(vector):
                return vector
        raise ValueError("expected an axis such as z or -x, 'auto', or three numbers that are not all 0")


class Pins(NamedTuple):
    """Which vertices: names of sets of them, rows of the file, positions, or a list of these."""

    names: tuple[str, ...]

    def from_text(self, text: str) -> str | list[int]:
        """Return a name or the rows in ``I,J,...``."""
        return text if text in self.names else [Whole(0).from_text(part) for part in text.split(",")]

    def from_plain(self, value: Any) -> Any:
        """Return a name, a row or a list."""
        if not isinstance(value, (str, int, list)) or isinstance(value, bool):
            raise ValueError(f"expected {', '.join(self.names)}, or a list of file rows or positions")
        return value


class Weights:
    """The name of numbers, or the numbers themselves."""

    def from_text(self, text: str) -> str:
        """Return the name."""
        return text

    def from_plain(self, value: Any) -> Any:
        """Return the name or the list."""
        return value if isinstance(value, list) and value else Text().from_plain(value)


class Setting(NamedTuple):
    """What is known of a setting beside its name and default.

    Attributes
    ----------
    kind : Kind
        The values that it takes.
    accepts : str
        What Python callers may pass, as documentation says it.
    doc : str
        What it means, for Python; sentences.
    help : str
        What it means, for the shell.
    metavar : str
        What the shell's help calls its value; empty: the choices.
    describes : str
        The sort of model that it is for: "grid" or "cloud"; empty: any.
    derived : bool
        Whether it follows from something else that the user says, and is only stored and read back.
    """

    kind: Kind
    accepts: str
    doc: str
    help: str
    metavar: str = ""
    describes: str = ""
    derived: bool = False


Settings = TypeVar("Settings")


def setting(default: Any, **facts: Any) -> Any:
    """Return a field of a class of settings; see `Setting` for the facts."""
    return field(default=default, metadata={"setting": Setting(**facts)})


def settings_of(kind: type[Any]) -> dict[str, Setting]:
    """Return the settings of a class by name, in the order in which they are declared."""
    return {item.name: item.metadata["setting"] for item in dataclasses.fields(kind)}


def defaults_of(kind: type[Any]) -> dict[str, Any]:
    """Return the default of each setting of a class."""
    return {item.name: item.default for item in dataclasses.fields(kind)}


def taken(kind: type[Settings], base: Settings | None, arguments: dict[str, Any]) -> Settings:
    """Take a class's settings out of keyword arguments, which lose them, and return them, others as in ``base``."""
    names = [name for name in settings_of(kind) if name in arguments]
    return dataclasses.replace(base or kind(), **{name: arguments.pop(name) for name in names})  # type: ignore[type-var]


def plain(settings: Any) -> dict[str, Any]:
    """Return settings as plain data, for JSON: all of them, arrays as lists."""
    return {name: _plain(getattr(settings, name)) for name in settings_of(type(settings))}


def read_back(kind: type[Settings], stored: Any) -> Settings:
    """Make settings again from what :func:`plain` made of them.

    Raises
    ------
    ValueError
        If that is no mapping, or a name in it is none of the class's, or a value is none that the setting takes.
    """
    if not isinstance(stored, Mapping):
        raise ValueError(f"{stored!r} holds no {kind.__name__.lower()}")
    known, defaults = settings_of(kind), defaults_of(kind)
    values = {}
    for name, value in stored.items():
        if name not in known:
            raise ValueError(f"{name!r} is none of the {kind.__name__.lower()}: {', '.join(known)}")
        if value == defaults[name]:
            continue
        try:
            values[name] = known[name].kind.from_plain(value)
        except ValueError as problem:
            raise ValueError(f"{name} is {value!r}: {problem}") from None
    return kind(**values)


def documentation(*kinds: type[Any], indent: str = "    ") -> str:
    """Return the settings of classes as the parameters of a docstring."""
    lines = []
    for kind in kinds:
        for name, known in settings_of(kind).items():
            if known.derived:
                continue
            lines.append(f"{indent}{name} : {known.accepts}")
            lines += _wrapped(known.doc, indent + "    ")
    return "\n".join(lines)


def _wrapped(text: str, indent: str, width: int = 120) -> Iterable[str]:
    line = indent
    for word in text.split():
        if len(line) + len(word) >= width and line.strip():
            yield line.rstrip()
            line = indent
        line += word + " "
    yield line.rstrip()


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # an array, or a number of NumPy's
        return value.tolist()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(part) for part in value]
    return value
