"""A model and some of its simplified meshes, for what is written of them."""

from __future__ import annotations

import pytest
from samples import random_solutions

from meshsimp_pymoo.opening import open_model


@pytest.fixture(scope="module")
def model():
    """Return a scan of 200 vertices."""
    return open_model("face:200")


@pytest.fixture(scope="module")
def solutions(model):
    """Return twelve of its simplified meshes."""
    return random_solutions(model)
