"""Which files a room has, so that a new one is found by being there."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def modules_in(folders: Iterable[str]) -> list[str]:
    """Return the names of the modules in a package's folders (its ``__path__``), sorted; packages are left out.

    `pkgutil` does the same, but imports `inspect` for it, which takes longer than all else that a help text needs.

    Raises
    ------
    ImportError
        If there are none, because the package does not lie in folders.
    """
    looked_in = list(folders)
    names = {file.stem for folder in looked_in for file in Path(folder).glob("*.py")} - {"__init__"}
    # what an editor leaves beside a file that it holds, such as .#asc.py, is no module
    modules = sorted(name for name in names if name.isidentifier())
    if not modules:
        raise ImportError(
            f"there are no modules in {', '.join(looked_in)}; meshsimp_pymoo finds its parts as files, so install it "
            "into a folder, not a zip archive or a frozen program"
        )
    return modules
