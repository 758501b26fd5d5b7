"""Which files a room has, so that a new one is found by being there."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def modules_in(folders: Iterable[str]) -> list[str]:
    """Return the names of the modules in a package's folders (its ``__path__``), sorted; packages are left out.

    `pkgutil` does the same, but imports `inspect` for it, which takes longer than all else that a help text needs.
    """
    return sorted({file.stem for folder in folders for file in Path(folder).glob("*.py")} - {"__init__"})
