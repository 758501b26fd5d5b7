"""The order of the gallery, and its second part: what explains comes after what is to be copied."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sphinx.errors import ExtensionError
from sphinx_gallery.backreferences import THUMBNAIL_PARENT_DIV, THUMBNAIL_PARENT_DIV_CLOSE

FIRST = (
    "front",
    "levels",
    "portrait",
    "relief",
    "error",
    "weights",
    "tin",
    "density",
    "contours",
    "tiles",
    "free",
    "wires",
    "attainment",
    "convergence",
)
SECOND = "explain_"  # how the names of the others begin
THUMBNAIL = '.. raw:: html\n\n    <div class="sphx-glr-thumbcontainer"'
TITLE = "How it works\n------------\n\nThe pictures of the :doc:`explanations </explanation/index>`.\n"


def place(name: str) -> tuple[int, str]:
    """Return by what a script is sorted."""
    stem = Path(name).stem
    return (FIRST.index(stem) if stem in FIRST else len(FIRST), stem)


def divide(app: Any, docname: str, source: list[str]) -> None:
    """Begin a new section of the index before the first script that explains."""
    if docname != "gallery/index" or f"sphx_glr_{SECOND}" not in source[0]:
        return
    at = source[0].rindex(THUMBNAIL, 0, source[0].index(f"sphx_glr_{SECOND}"))
    between = THUMBNAIL_PARENT_DIV_CLOSE + TITLE + THUMBNAIL_PARENT_DIV
    source[0] = f"{source[0][:at]}{between}\n{source[0][at:]}"


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx, if all that are named are there."""
    if lost := [name for name in FIRST if not Path(app.srcdir, "examples", f"{name}.py").is_file()]:
        raise ExtensionError(f"docs/_ext/pictures.py names a script that docs/examples lacks: {lost[0]}.py")
    app.connect("source-read", divide)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
