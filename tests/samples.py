"""What tests of the geometry are tried on."""

from __future__ import annotations

from typing import Any

import numpy as np

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.opening import Source, open_model
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.rules import Rules


def surface(model: Source | OpenModel, *, up: Any = "auto", **rules: Any) -> HeightSurface:
    """Return the height surface of a built-in name, a mesh or a model, with these rules."""
    return HeightSurface(open_model(model, Options(up=up)), Rules(**rules))


def holey_grid() -> SourceMesh:
    """Return a height grid with a bay and a hole: lattice ties, borders on every side."""
    rng = np.random.default_rng(4)
    elevation = rng.integers(0, 50, (9, 11)).astype(float)
    elevation[3:6, 4:7] = np.nan
    elevation[:4, 8:] = np.nan
    return grid_source(elevation, 2.0, 3.0, name="holey")


def subset(model: OpenModel, share: float, seed: int = 0) -> np.ndarray:
    """Return a random subset that holds the corners, (N,) bool."""
    kept = np.random.default_rng(seed).random(model.n_vertices) < share
    kept[model.corners] = True
    return kept


# Models so small that every triangle can look at every vertex: known ridges, holes, bays, and a scan's outline.
SMALL = {
    "roof": lambda: load("roof:5"),
    "holey": holey_grid,
    "face": lambda: load("face:150"),
    "ring": lambda: load("ring:120"),
    "horseshoe": lambda: load("horseshoe:120"),
}
