"""The one way in: path, built-in name or arrays and how to read them, to a model. (Replaced at the merge.)"""

from __future__ import annotations

from typing import Any

from meshsimp_pymoo.datasets import find_source
from meshsimp_pymoo.formats.options import DEFAULT, Options
from meshsimp_pymoo.surface.model import OpenModel, load_model


def open_model(model: Any, options: Options = DEFAULT) -> OpenModel:
    """Open a model."""
    if isinstance(model, str) or hasattr(model, "__fspath__"):
        model = find_source(
            model, spacing=options.spacing, nodata=options.nodata, window=options.window, max_edge=options.max_edge
        )
    return load_model(model, up=options.up, patch=options.patch)
