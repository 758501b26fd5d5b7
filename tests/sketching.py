"""A sketch in place of the pictures, in tests that do not look at them: a tenth of the work."""

from __future__ import annotations

import hashlib
import pickle
from pathlib import Path
from typing import Any


def sketch(surface: Any, *told: Any, **marks: Any) -> Any:
    """Return a figure without axes, of pixels that tell what the picture of a front would be drawn from."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1, 1), dpi=32)
    drawn = hashlib.sha256(pickle.dumps((surface.model.hash, surface.rules, told, marks)))
    figure.figimage(list(map(list, 32 * [drawn.digest()])))
    return figure


def sketch_into(draw: Any, path: Path) -> None:
    """Write a picture that tells which one of an experiment's it stands for."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1, 1), dpi=32)
    figure.text(0.0, 0.5, path.name.lstrip(".").partition(".")[0])  # while it is made, the file has a mark of its own
    figure.savefig(path)


def sketch_pictures(compared: Any, numbers: Any) -> dict[str, str]:
    """Return addresses of nothing for the pictures of a statement of quality."""
    return dict.fromkeys(("map", "spread", "angles"), "data:,")
