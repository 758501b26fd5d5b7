"""What things call themselves in one line, at a prompt and in a debugger: never a whole array, never an address."""

from __future__ import annotations

import dataclasses
import inspect
import reprlib
from typing import Any, TypeVar

Class = TypeVar("Class", bound=type[Any])
# Arrays of at most so many numbers are said whole: a point, a direction.
FEW = 4


class _Short(reprlib.Repr):
    """Long lists and texts are cut, arrays are their shape and type, and what has no repr is its class."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = 160

    def repr1(self, x: Any, level: int) -> str:
        if hasattr(x, "dtype") and hasattr(x, "shape"):
            is_small = x.size <= FEW and x.dtype.kind in "biuf"
            return repr(x.tolist()) if is_small else f"<{x.shape} {x.dtype}>"
        if getattr(type(x), "__repr__", None) is object.__repr__:
            return f"{type(x).__name__}()"
        if callable(x) and hasattr(x, "__name__"):
            return str(x.__name__)
        return super().repr1(x, level)


_SHORT = _Short()


def in_short(value: Any) -> str:
    """Return a value in one line.

    >>> import numpy as np
    >>> in_short({"kept": np.zeros((3, 2))}), in_short([1] * 99), in_short(object()), in_short(np.float64(0.5))
    ("{'kept': <(3, 2) float64>}", '[1, 1, 1, 1, 1, 1, ...]', 'object()', '0.5')
    """
    return _SHORT.repr(value).replace("\n", " ")


def as_made(thing: Any) -> str:
    """Return the call that makes a thing of this kind, with the arguments that are not the defaults.

    A ``__repr__``. Arguments are what the attributes of their names say, pymoo's variables their values.
    """
    said = []
    for name, parameter in inspect.signature(type(thing).__init__).parameters.items():
        value = getattr(thing, name, parameter.default)
        if type(value).__module__ == "pymoo.core.variable":
            value = value.value
        is_usual = value is parameter.default or _is_equal(value, parameter.default)
        if name == "self" or is_usual or (name == "name" and value == type(thing).__name__):  # what pymoo calls it
            continue
        is_first = parameter.default is parameter.empty and parameter.kind is parameter.POSITIONAL_OR_KEYWORD
        said.append(in_short(value) if is_first else f"{name}={in_short(value)}")
    return f"{type(thing).__name__}({', '.join(said)})"


def _is_equal(value: Any, default: Any) -> bool:
    return type(value) is type(default) and bool(value == default)


def brief(kind: Class) -> Class:
    """Give a dataclass a ``__repr__`` of one line, its arrays as shape and type; fields without ``repr`` stay out."""

    def __repr__(self: Any) -> str:
        shown = [f"{item.name}={in_short(getattr(self, item.name))}" for item in dataclasses.fields(self) if item.repr]
        return f"{type(self).__name__}({', '.join(shown)})"

    kind.__repr__ = __repr__  # type: ignore[assignment]
    return kind


def of_algorithm(algorithm: Any, *facts: str) -> str:
    """Return what a pymoo algorithm is: its name, facts, operators, and how far it has come; for a ``__repr__``."""
    mating = getattr(algorithm, "mating", None)
    parts = [
        getattr(getattr(algorithm, "initialization", None), "sampling", None),
        *(getattr(mating, name, None) for name in ("crossover", "mutation")),
        getattr(algorithm, "repair", None),
    ]
    said = [*facts, *(in_short(part) for part in parts if part is not None and type(part).__name__ != "NoRepair")]
    if getattr(algorithm, "n_iter", None):
        said[-1] += f"; generation {algorithm.n_iter - 1}, {algorithm.evaluator.n_eval:,} evaluations"
    return f"<{type(algorithm).__name__}: {', '.join(said)}>"
