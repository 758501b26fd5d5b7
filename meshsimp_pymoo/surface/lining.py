"""How lines become break lines of a model: draped, cut, thinned once, their vertices added, their edges forced."""

from __future__ import annotations

from typing import Any

from meshsimp_pymoo.surface.model import OpenModel


def lined_model(model: OpenModel, break_lines: Any, tolerance: float | None) -> OpenModel:
    """Return the model with break lines; see `Rules` for what they may be."""
    raise NotImplementedError
