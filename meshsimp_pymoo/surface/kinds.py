"""The kinds of surfaces there are: which one a model and its rules make."""

from __future__ import annotations

from typing import TypeAlias

from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.rules import DEFAULT, Rules

# The original mesh of a surface of any kind.
Model: TypeAlias = OpenModel | ClosedModel
# What it is the original mesh of.
OfModel: TypeAlias = HeightSurface | ClosedSurface


def surface_of(model: Model, rules: Rules = DEFAULT) -> OfModel:
    """Return the surface that a model makes with rules.

    Raises
    ------
    ModelError
        If the rules do not fit the model.
    """
    return ClosedSurface(model, rules) if isinstance(model, ClosedModel) else HeightSurface(model, rules)
