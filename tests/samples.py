"""What tests are tried on."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.opening import Source, open_model
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.storage import write_front
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import OpenModel, build_model
from meshsimp_pymoo.surface.orient import FOLD_SHARE, SurfaceFacts, open_faces, surface_facts
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.surface import FreeMesh, Simplified, Surface


def surface(model: Source | OpenModel, *, up: Any = "auto", **rules: Any) -> HeightSurface:
    """Return the height surface of a built-in name, a mesh or a model, with these rules."""
    return HeightSurface(open_model(model, Options(up=up)), Rules(**rules))


def check_open_surface(source: SourceMesh, upright: FloatArray) -> tuple[IntArray, SurfaceFacts]:
    """Return the faces as seen from above and what is known of them, or refuse them."""
    facts = surface_facts(source, upright, until=FOLD_SHARE)
    return open_faces(source, facts), facts


def stepped_model(source: SourceMesh) -> OpenModel:
    """Return the model of a mesh with several vertices at one place, which is said."""
    with pytest.warns(ModelWarning, match=r"lie below another one at their \(x, y\)"):
        return build_model(source, up="z")


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


def freed(surface: Surface, kept: np.ndarray, *, better: bool = True) -> FreeMesh:
    """Return a free mesh: that of a subset, its edges flipped one after the other, where that lowers the error."""
    mesh, xy = surface.simplify(kept | surface.pinned), surface.points[:, :2]
    for a, b in edge_table(mesh.faces).ends.tolist():
        both = np.flatnonzero(np.isin(mesh.faces, [a, b]).sum(axis=1) == 2)
        if len(both) < 2:  # on the border
            continue
        c, d = (np.setdiff1d(mesh.faces[t], [a, b])[0] for t in both)
        side = [np.linalg.det([xy[d] - xy[c], xy[x] - xy[c]]) for x in (a, b)]
        if np.prod(side) >= -((1e-9 * surface.diagonal) ** 4):  # they have no convex outline
            continue
        faces = mesh.faces.copy()
        faces[both] = [(c, d, x) if s > 0 else (d, c, x) for x, s in zip((a, b), side, strict=True)]
        other = surface.of_faces(faces)
        if not better or other.quality.error < mesh.quality.error:
            mesh = other
    used = surface.pinned.copy()
    used[mesh.faces] = True
    return FreeMesh(used, mesh.faces, mesh.quality)


def random_solutions(model: OpenModel) -> tuple[np.ndarray, list[Simplified]]:
    """Return twelve random subsets of growing size, listed out of order, with their simplified meshes."""
    rng = np.random.default_rng(5)
    kept = rng.random((12, model.n_vertices)) < np.linspace(0.1, 0.9, 12)[rng.permutation(12), None]
    kept[:, model.corners] = True
    surface = HeightSurface(model)
    return kept, [surface.simplify(row) for row in kept]


def write_solutions(folder: Path, model: OpenModel, solutions: tuple[Any, Any], **options: Any) -> Path:
    """Write such solutions as a front of the model by the usual rules."""
    kept, simplified = solutions
    options = {"faces": lambda row: simplified[row].faces, "run": {"seed": 3}} | options
    return write_front(folder, HeightSurface(model), [s.quality for s in simplified], kept, **options)


def coloured(source: SourceMesh) -> SourceMesh:
    """Return a mesh with attributes of every type."""
    rng = np.random.default_rng(2)
    n = len(source.points)
    attributes = {
        "color": rng.integers(0, 256, (n, 4), dtype=np.uint8),
        "quality": rng.random(n).astype(np.float32),
        "label": rng.integers(-5, 5, n),
        "two words": rng.random(n),
        "pair": rng.random((n, 2)),
        "seen": rng.random(n) < 0.5,
    }
    return dataclasses.replace(source, attributes=attributes)


# Built-in models that are one closed surface around their origin, all of which is seen from there; with those that are
# not so simple, the bodies. All others are height fields.
CLOSED = ("tetrahedron", "cube", "icosahedron", "sphere", "ellipsoid", "blob")
BODIES = (*CLOSED, "pebbles", "bracket")

# Models so small that every triangle can look at every vertex: known ridges, holes, bays, and a scan's outline.
SMALL = {
    "roof": lambda: load("roof:5"),
    "holey": holey_grid,
    "face": lambda: load("face:150"),
    "ring": lambda: load("ring:120"),
    "horseshoe": lambda: load("horseshoe:120"),
}
