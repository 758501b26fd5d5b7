"""What a user may set, declared once: a field of a frozen dataclass with its default, its meaning and its values.

`Options` (how a model is read) and `Rules` (what counts) are such classes. From their fields come the keyword arguments
of ``MeshProblem`` and their documentation, the options of the shell command, the keys of a YAML file, and what a folder
stores and reads back. A new setting is a new field, and nothing else. Nothing heavy is imported here: the shell
command's ``--help`` is made of it.

Whoever sets something - a word of a command line, YAML, Python, a record that is read back - goes through the same
:class:`Kind` when the object is made (:func:`settle`). So what an object holds is plain data that can be stored, and
what was stored can be read back.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import os
import re
import reprlib
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any, NamedTuple, Protocol, TypeVar

from meshsimp_pymoo.errors import InputError, meant

# A whole number beyond this is not exact as a float any more; a real one beyond MOST_REAL has infinite products.
MOST_WHOLE = 2**53
MOST_REAL = 1e300
# The largest number there is: what GDAL writes, negated, where a raster has no sample.
LARGEST = sys.float_info.max


class Kind(Protocol):
    """What values a setting takes; both ways to read one take the same, or raise a ValueError with what is expected."""

    def from_text(self, text: str) -> Any:
        """Return the value that a word of a command line means."""
        ...

    def from_plain(self, value: Any) -> Any:
        """Return the value that plain data (of YAML, of JSON, of Python with arrays as lists) means; plain data too."""
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
        near = meant(str(value), self.names)
        unknown = f"unknown{near}; " if near else ""
        raise ValueError(f"{unknown}expected {'one of ' * (len(self.names) > 1)}{', '.join(self.names)}")


class Whole(NamedTuple):
    """A whole number, at least and at most these."""

    least: int = 0
    most: int = MOST_WHOLE

    def from_text(self, text: str) -> int:
        """Return the number."""
        value = int(text) if re.fullmatch(r"[+-]?\d+", text) else None
        if value is None or not self.least <= value <= self.most:
            raise ValueError(f"{text!r} is not {self._expected(value)}")
        return value

    def from_plain(self, value: Any) -> int:
        """Return the number."""
        if isinstance(value, bool) or not isinstance(value, int) or not self.least <= value <= self.most:
            raise ValueError(f"expected {self._expected(value)}")
        return value

    def _expected(self, value: Any) -> str:
        limit = "2**53" if self.most == MOST_WHOLE else self.most
        most = f" and at most {limit}" if isinstance(value, int) and value > self.most else ""
        return f"a whole number of at least {self.least}{most}"


class Real(NamedTuple):
    """A finite number, at least (or, with ``strict``, above) the least, of a size of at most the most."""

    least: float | None = None
    strict: bool = False
    most: float = MOST_REAL

    def from_text(self, text: str) -> float:
        """Return the number."""
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{text!r} is not a finite number")
        if self._is_small(value):
            if not self.strict:
                raise ValueError(f"{text!r} is below {self.least:g}")
            raise ValueError(f"{text!r} is not {'positive' if self.least == 0 else f'above {self.least:g}'}")
        if abs(value) > self.most:
            raise ValueError(f"{text!r} is larger than {self.most:g}")
        return value

    def from_plain(self, value: Any) -> float:
        """Return the number."""
        is_number = not isinstance(value, bool) and isinstance(value, (int, float)) and value == value
        if not is_number or self._is_small(value) or abs(value) > self.most:
            limit = "" if self.least is None else f" {'of more than' if self.strict else 'of at least'} {self.least:g}"
            if is_number and abs(value) > self.most:
                limit += f"{limit and ' and'} no larger than {self.most:g}"
            raise ValueError(f"expected a number{limit}")
        return float(value)

    def _is_small(self, value: float) -> bool:
        return self.least is not None and (value < self.least or (self.strict and value == self.least))


class Column:
    """A column of a table: its name, or its number from 1."""

    def from_text(self, text: str) -> str | int:
        """Return the number, or the name."""
        return Whole(1).from_text(text) if re.fullmatch(r"[+-]?\d+", text) else self.from_plain(text)

    def from_plain(self, value: Any) -> str | int:
        """Return the number, or the name."""
        if isinstance(value, str) and value.strip():
            return value.strip()
        if isinstance(value, str) or isinstance(value, bool) or not isinstance(value, int):
            raise ValueError("expected names of columns, or their numbers from 1")
        return Whole(1).from_plain(value)


class Several(NamedTuple):
    """One or more values of a kind, none twice; with a number, so many."""

    part: Kind
    number: int = 0

    def from_text(self, text: str) -> tuple[Any, ...]:
        """Return the values in ``A,B,...``."""
        return self._checked([self.part.from_text(part.strip()) for part in text.split(",")])

    def from_plain(self, value: Any) -> tuple[Any, ...]:
        """Return the values of a list; one value is a list of one."""
        return self._checked([self.part.from_plain(part) for part in (value if isinstance(value, list) else [value])])

    def _checked(self, values: list[Any]) -> tuple[Any, ...]:
        if not values or (self.number and len(values) != self.number):
            raise ValueError(f"expected {self.number or 'one or more'} values, not {len(values)}")
        if len(set(values)) < len(values):
            raise ValueError(f"{reprlib.repr(values)} names one of them twice")
        return tuple(values)


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


class Scale:
    """What units of x and y measure: two positive numbers, "degrees" to find them out, or "none": 1 for both."""

    EXPECTED = "expected degrees, none, or two positive numbers SX,SY"

    def from_text(self, text: str) -> str | tuple[float, float]:
        """Return the word, or the pair."""
        return self.from_plain([Real().from_text(part) for part in text.split(",")] if "," in text else text)

    def from_plain(self, value: Any) -> str | tuple[float, float]:
        """Return the word, or the pair."""
        if value == "degrees":
            return str(value)
        if value == "none":
            return 1.0, 1.0
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(self.EXPECTED)
        x, y = (Real(0, strict=True).from_plain(part) for part in value)
        return x, y


class Part:
    """A part of a grid: column, row, columns, rows; of at least two columns and rows."""

    LEAST = (0, 0, 2, 2)

    def from_text(self, text: str) -> tuple[int, ...]:
        """Return the four numbers."""
        parts = text.split(",")
        if len(parts) != len(self.LEAST):
            raise ValueError(f"{text!r} is not COLUMN,ROW,COLUMNS,ROWS")
        return tuple(Whole(least).from_text(part) for part, least in zip(parts, self.LEAST, strict=True))

    def from_plain(self, value: Any) -> tuple[int, ...]:
        """Return the four numbers."""
        if not isinstance(value, list) or len(value) != len(self.LEAST):
            raise ValueError("expected [column, row, columns, rows]")
        return tuple(Whole(least).from_plain(part) for part, least in zip(value, self.LEAST, strict=True))


class Direction:
    """A direction in space: "auto", an axis with or without a sign, or three numbers."""

    def from_text(self, text: str) -> str | list[float]:
        """Return the text; what it means is found out beside the model."""
        return self.from_plain(text)

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
    """The name of numbers, or the numbers themselves; NaN, in plain data None, where there is nothing to weigh."""

    def from_text(self, text: str) -> str:
        """Return the name."""
        return str(self.from_plain(text))

    def from_plain(self, value: Any) -> Any:
        """Return the name or the list."""
        if isinstance(value, list) and value:
            return [self._number(part) for part in value]
        if isinstance(value, str) and value.strip():
            return value
        raise ValueError("expected the name of an attribute, or a list of numbers")

    def _number(self, value: Any) -> Any:
        if isinstance(value, list):
            return [self._number(part) for part in value]
        if value is None:
            return math.nan
        if not isinstance(value, (bool, int, float)):
            raise ValueError(f"expected a list of numbers, and {reprlib.repr(value)} is none")
        return value


class Lines:
    """Polylines: a file or a word that names them, or lists of positions."""

    def from_text(self, text: str) -> str:
        """Return the name."""
        return str(self.from_plain(text))

    def from_plain(self, value: Any) -> Any:
        """Return the name or the lists."""
        if isinstance(value, os.PathLike):
            value = os.fspath(value)
        if isinstance(value, str) and value.strip():
            return value
        if isinstance(value, list) and value and all(self._is_line(line) for line in value):
            return value
        raise ValueError(
            "expected a file, sharp:DEGREES, outline, or a list of lines, each a list of two or more positions "
            "[x, y] or [x, y, z]"
        )

    def _is_line(self, line: Any) -> bool:
        if not isinstance(line, list) or len(line) < 2:
            return False
        lengths = {len(place) if isinstance(place, list) else 0 for place in line}
        numbers = (number for place in line for number in place) if lengths <= {2, 3} and len(lengths) == 1 else [""]
        return all(isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x) for x in numbers)


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
    describes : tuple of str
        The sorts of models that it is for, of "mesh", "grid" and "cloud", or names of single formats; empty: any.
    derived : bool
        Whether it follows from something else that the user says, and is only stored and read back.
    """

    kind: Kind
    accepts: str
    doc: str
    help: str
    metavar: str = ""
    describes: tuple[str, ...] = ()
    derived: bool = False


Settings = TypeVar("Settings")
Function = TypeVar("Function", bound=Callable[..., Any])


def setting(default: Any, **facts: Any) -> Any:
    """Return a field of a class of settings; see `Setting` for the facts."""
    return field(default=default, metadata={"setting": Setting(**facts)})


def settings_of(kind: type[Any]) -> dict[str, Setting]:
    """Return the settings of a class by name, in the order in which they are declared."""
    return {item.name: item.metadata["setting"] for item in dataclasses.fields(kind)}


def defaults_of(kind: type[Any]) -> dict[str, Any]:
    """Return the default of each setting of a class."""
    return {item.name: item.default for item in dataclasses.fields(kind)}


def settle(settings: Any) -> None:
    """Bring the settings of an object that is being made to what their kinds make of them: its ``__post_init__``.

    Raises
    ------
    InputError
        If a value is none that the setting takes.
    """
    defaults = defaults_of(type(settings))
    for name, known in settings_of(type(settings)).items():
        value = getattr(settings, name)
        if value is None and defaults[name] is None:
            continue
        try:
            object.__setattr__(settings, name, known.kind.from_plain(_plain(value)))
        except ValueError as problem:
            raise InputError(f"{name} is {reprlib.repr(value)}: {problem}") from None


def taken(kind: type[Settings], base: Settings | None, arguments: dict[str, Any]) -> Settings:
    """Take a class's settings out of keyword arguments, which lose them, and return them, others as in ``base``."""
    names = [name for name in settings_of(kind) if name in arguments]
    return dataclasses.replace(base or kind(), **{name: arguments.pop(name) for name in names})  # type: ignore[type-var]


def plain(settings: Any) -> dict[str, Any]:
    """Return settings as plain data, for JSON: all of them, tuples as lists, no number (NaN) as None."""
    return {name: _stored(getattr(settings, name)) for name in settings_of(type(settings))}


def read_back(kind: type[Settings], stored: Any) -> Settings:
    """Make settings again from what :func:`plain` made of them.

    Raises
    ------
    InputError
        If that is no mapping, or a name in it is none of the class's, or a value is none that the setting takes.
    """
    if not isinstance(stored, Mapping):
        raise InputError(f"{reprlib.repr(stored)} holds no {kind.__name__.lower()}")
    known = settings_of(kind)
    for name in stored:
        if name not in known:
            raise InputError(f"{name!r} is none of the {kind.__name__.lower()}: {', '.join(known)}")
    return kind(**stored)


def documentation(*kinds: type[Any], derived: bool = False) -> str:
    """Return the settings of classes as the parameters of a docstring; those that are derived only if asked for."""
    lines = []
    for kind in kinds:
        for name, known in settings_of(kind).items():
            if known.derived and not derived:
                continue
            lines.append(f"{name} : {known.accepts}")
            lines += _wrapped(known.doc, "    ")
    return "\n".join(lines)


def documented(kind: type[Settings]) -> type[Settings]:
    """Name the settings in the docstring of their class, where that says SETTINGS."""
    kind.__doc__ = (inspect.getdoc(kind) or "").replace("SETTINGS", documentation(kind, derived=True))
    return kind


def by_name(*kinds: type[Any]) -> Callable[[Function], Function]:
    """Let the signature of a function that takes settings of classes as ``**kwargs`` name them, with their defaults.

    They come first of what is given by keyword; for ``help()``, editors and notebooks.
    """
    names = [
        inspect.Parameter(item.name, inspect.Parameter.KEYWORD_ONLY, default=item.default, annotation=item.type)
        for kind in kinds
        for item in dataclasses.fields(kind)
        if not item.metadata["setting"].derived
    ]

    def named(function: Function) -> Function:
        given = inspect.signature(function)
        own = list(given.parameters.values())
        of_keywords = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD)
        first = next(k for k, one in enumerate(own) if one.kind in of_keywords)
        function.__signature__ = given.replace(parameters=[*own[:first], *names, *own[first:]])  # type: ignore[attr-defined]
        return function

    return named


def _wrapped(text: str, indent: str) -> Iterable[str]:
    line = indent
    for word in text.split():
        if len(line) + len(word) >= 120 and line.strip():
            yield line.rstrip()
            line = indent
        line += word + " "
    yield line.rstrip()


def _plain(value: Any) -> Any:
    """Return a value of Python's as YAML or JSON would have it: arrays and whatever else has parts as lists."""
    if hasattr(value, "tolist"):  # an array, or a number of NumPy's
        return value.tolist()
    if isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping)):
        return [_plain(part) for part in value]
    return value


def _stored(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_stored(part) for part in value]
    return None if isinstance(value, float) and math.isnan(value) else value
