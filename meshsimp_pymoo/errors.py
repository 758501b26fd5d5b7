"""What can be wrong with what a user gives, each said in one line: what is wrong, where, its value, and the way out."""

from __future__ import annotations

import difflib
import errno
import re
import unicodedata
import warnings
from collections.abc import Iterable
from typing import Any

# Of a foreign exception's text, in a line of ours.
LONGEST_REASON = 200


class InputError(ValueError):
    """Bad input, said in one line; the shell command ends with code 2 and nothing is written."""


class ModelError(InputError):
    """The input cannot be used. One line: the file, the cause with its value, the way out."""


class NoHeightGrid(ModelError):
    """The model is no grid of heights along its axes, which can be cut into tiles."""


class FacesAllWays(ModelError):
    """No direction is preferred to see the surface from, as of a closed one."""


class ResultError(InputError):
    """An output folder cannot be used or does not hold what it should: one line with the way out."""


class ToolUnavailable(Exception):
    """A tool that is no part of this package cannot be used here, or not on this model: one line with the way out."""


class UsageError(InputError):
    """Options that do not go together, or a command line that cannot be understood."""


class CodeWarning(UserWarning):
    """Compiled code cannot be kept or read: nothing is wrong but the time it takes to make it again."""


class ExperimentWarning(UserWarning):
    """Results are usable, but the user should know: runs are missing, damaged, stale, failed or were skipped."""


class PictureWarning(UserWarning):
    """A picture or a page could not be made; the results are there."""


class ModelWarning(UserWarning):
    """The input is usable, but something in it was dropped or is doubtful."""


class SearchWarning(UserWarning):
    """A search could not do all that it does with more time; what it finds is right, but there is less of it."""


class Missed(LookupError):
    """No solution is as good as it is wished for; the message says how near they come.

    Attributes
    ----------
    nearest : FrontSolution
        The solution that comes nearest.
    """

    def __init__(self, message: str, nearest: object) -> None:
        super().__init__(message)
        self.nearest: Any = nearest

    def __reduce__(self) -> Any:
        return Missed, (*self.args, self.nearest)


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return which of the known words was meant, most likely; None if none is near.

    Of several that are as near, the first.

    >>> nearest("Widnow", ["spacing", "window"]), nearest("smooth", ["spacing", "window"])
    ('window', None)
    >>> nearest("nsga2", ["moead", "nsga2_v1", "nsga2_v2"])
    'nsga2_v1'
    """
    by_lower = {name.lower(): name for name in known}
    if not difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.5):
        return None
    matcher = difflib.SequenceMatcher(b=word.lower())

    def likeness(name: str) -> float:
        matcher.set_seq1(name)
        return matcher.ratio()

    return by_lower[max(by_lower, key=likeness)]


def meant(word: str, known: Iterable[str]) -> str:
    """Return a question for behind an unknown word; empty if no known one is near."""
    near = nearest(word, known)
    return "" if near is None else f" (did you mean {near!r}?)"


def reason_of(error: BaseException) -> str:
    """Return what an exception says, in one line of at most LONGEST_REASON characters.

    >>> reason_of(OSError(28, "No space left on device")), reason_of(KeyError())
    ('No space left on device', 'KeyError')
    """
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())[:LONGEST_REASON]


def printable(text: object, *, keep: str = "") -> str:
    r"""Return a text that can be shown anywhere: escapes in place of control characters and of what is no Unicode.

    Names of files and of what is in them may hold anything; a terminal would obey some of it. ``keep`` stays as it is.

    >>> print(printable("face.ply"), printable("a\x1b[31mb\udce4"))
    face.ply a\x1b[31mb\udce4
    """
    return "".join(
        ascii(c)[1:-1] if c not in keep and unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") else c
        for c in str(text)
    )


def way_to_install(extra: str, package: str = "") -> str:
    """Return the command that installs what an extra of this package brings, wherever it came from, or one package.

    >>> way_to_install("geo")
    "pip install 'rasterio>=1.4'"
    """
    from importlib.metadata import PackageNotFoundError, requires

    try:
        parts = [text.partition(";") for text in requires("meshsimp-pymoo") or ()]
    except PackageNotFoundError:
        parts = []
    needed = [name.strip() for name, _, marker in parts if re.search(rf"extra\s*==\s*['\"]{extra}['\"]", marker)]
    if package:
        needed = [name for name in needed if re.match(rf"{package}\b(?!-)", name)] or [package]
    if not needed:  # run from a clone that is not installed, or was before it had this extra
        return f"pip install '.[{extra}]' in the folder of its pyproject.toml"
    return f"pip install {' '.join(map(repr, needed))}"


def raise_if_memory(error: BaseException) -> None:
    """Raise MemoryError if that is what an exception says in its way: there is nothing wrong with a file then."""
    if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
        raise MemoryError from error


def warn_of(message: str) -> None:
    """Warn the caller's caller that something in the input was dropped or is doubtful."""
    warnings.warn(message, ModelWarning, stacklevel=3)
