"""The kinds of surfaces there are: which one a model and its rules make."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from meshsimp_pymoo.arrays import AnyArray
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.rules import DEFAULT, Rules
from meshsimp_pymoo.surface.surface import Surface

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


def stored_arrays(surface: Surface) -> dict[str, AnyArray]:
    """Return what has to be stored with chromosomes besides, so that they mean the same meshes wherever they are read.

    Of a closed surface the images of its vertices, in vector order, and their rows in the file: the last bits of images
    depend on the versions of libraries, and meshes, numbers and the order itself on these bits. Of others nothing.
    """
    model = surface.model
    if not isinstance(model, ClosedModel):
        return {}
    return {"source_index": np.asarray(model.source_index, np.int64), "xy": model.xy}


def as_stored(surface: Surface, arrays: Mapping[str, AnyArray]) -> Surface:
    """Return a surface as it was when :func:`stored_arrays` were taken: itself, if it is as it was.

    Raises
    ------
    ModelError
        If these are none of this model.
    """
    model, own = surface.model, stored_arrays(surface)
    if all(np.array_equal(arrays[name], values) for name, values in own.items()):
        return surface
    assert isinstance(model, ClosedModel)
    if surface.rules.break_lines is None:
        return ClosedSurface(model.with_images(arrays["xy"], arrays["source_index"]), surface.rules)
    # the lines are laid again on these images, as they were
    bare = model.without_lines()
    of_file = np.isin(arrays["source_index"], bare.source_index)
    found = ClosedSurface(
        bare.with_images(arrays["xy"][of_file], arrays["source_index"][of_file]),
        surface.rules,
    )
    if not all(np.array_equal(arrays[name], values) for name, values in stored_arrays(found).items()):
        raise ModelError(f"{model.name}: what was stored are images of other break lines")
    return found
