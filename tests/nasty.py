"""Small models of the kinds that break things: gaps, islands, hubs, ties, slivers, spikes, weights of 0."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache, partial

import numpy as np
from growing import KINDS
from scipy.spatial import Delaunay

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.source.points import cloud_source
from meshsimp_pymoo.surface.model import OpenModel, build_model

# Vertices of those that can be had at any size.
SIZE = 150


def _raster(shape: tuple[int, int], missing: Callable[[FloatArray, FloatArray], FloatArray]) -> SourceMesh:
    """A raster without the samples of which (row, column) says so."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    z = np.random.default_rng(shape).normal(size=shape).cumsum(0).cumsum(1)
    z[missing(y, x)] = np.nan
    return grid_source(z)


def _checkerboard() -> SourceMesh:
    """Squares of 3 x 3 samples that touch at corners only, where four segments meet."""
    return _raster((13, 13), lambda y, x: ((y // 2 + x // 2) % 2 == 1) & (y % 2 == 1) & (x % 2 == 1))


def _rings() -> SourceMesh:
    """Two rings, one inside the other, and a disc."""
    return _raster((19, 19), lambda y, x: np.isin(np.hypot(y - 9, x - 9).astype(int), (3, 6)))


def _spiral() -> SourceMesh:
    """A band that winds inwards."""
    turn = np.repeat(np.linspace(0, 5 * np.pi, 60), 3)
    radius = 2 + turn / 2 + np.tile([0, 0.4, 0.8], 60)
    z = np.random.default_rng(1).normal(size=len(turn))
    return cloud_source(np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z]), max_edge=1.2)


def _double_comb() -> SourceMesh:
    """Slots from two sides in turn."""
    return _raster((13, 17), lambda y, x: ((x % 8 == 3) & (y > 2)) | ((x % 8 == 7) & (y < 10)))


def _straight_fan() -> SourceMesh:
    """One vertex over a row of others on a line."""
    n = 70
    xy = np.r_[[(0.3, 0.5)], np.column_stack([np.linspace(0, 1, n), np.zeros(n)])]
    k = np.arange(1, n)
    z = np.random.default_rng(2).normal(size=n + 1)
    return build_source(np.column_stack([xy, z]), np.column_stack([0 * k, k, k + 1]), name="straight fan")


def _wheel() -> SourceMesh:
    """One vertex within 64 others on a circle of a lattice, and a ring around them: cocircular points, a hub."""
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    xy = np.r_[[(0.0, 0.0)], ring, 1.5 * ring]
    z = np.random.default_rng(3).normal(size=len(xy))
    return build_source(np.column_stack([xy, z]), Delaunay(xy).simplices, name="wheel")


def _slivers() -> SourceMesh:
    """A turned square whose sides are nearly straight: slivers of many heights around the least that is drawn."""
    rng = np.random.default_rng(4)
    inner = rng.random((40, 2))
    along = np.sort(rng.random((4, 25)), axis=1)
    away = 10.0 ** rng.uniform(-12, -7, (4, 25)) * rng.choice([-1, 1], (4, 25))
    sides = [(along[0], away[0]), (along[1], 1 + away[1]), (away[2], along[2]), (1 + away[3], along[3])]
    xy = np.concatenate([inner, *(np.column_stack(side) for side in sides), [(0, 0), (1, 0), (0, 1), (1, 1)]])
    c, s = np.cos(0.3), np.sin(0.3)
    return cloud_source(np.column_stack([xy @ [[c, s], [-s, c]], rng.normal(size=len(xy))]))


def _spikes() -> SourceMesh:
    """A raster with gaps and, here and there, a height a million times as large."""
    rng = np.random.default_rng(5)
    z = rng.normal(size=(12, 12))
    z[rng.random(z.shape) < 0.2] = np.nan
    z[rng.random(z.shape) < 0.05] *= 1e6
    return grid_source(z)


def _flat() -> SourceMesh:
    """A raster with gaps and heights of 0: all costs of covered vertices are ties."""
    return grid_source(np.where(np.random.default_rng(6).random((12, 12)) < 0.2, np.nan, 0.0))


def _twins() -> SourceMesh:
    """A step: two vertices at each of some places."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(7.0))
    low = np.column_stack([x.ravel(), y.ravel(), np.sin(x + y).ravel()])
    high = np.column_stack([x.ravel() + 8, y.ravel(), 3 + np.cos(x - y).ravel()])
    k = (np.arange(6)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate([np.column_stack([k, k + 1, k + 10]), np.column_stack([k, k + 10, k + 9])])
    return build_source(np.r_[low, high], np.r_[faces, faces + len(low)], name="twins")


def _bow_ties() -> SourceMesh:
    """Triangles in a row that touch at single vertices."""
    k = np.arange(30)
    points = np.column_stack([k % 10, k // 10, np.sin(3.0 * k)]).astype(float)
    points[:, :2] *= [1.0, 0.8]
    a = np.array([0, 2, 4, 6, 11, 13, 15, 17])
    return build_source(points, np.column_stack([a, a + 1, a + 11]), name="bow ties")


def _long_and_thin() -> SourceMesh:
    return _raster((3, 50), lambda y, x: (y == 1) & (x % 5 == 2))


def _pins() -> SourceMesh:
    """A star of many thin rays."""
    turn = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    radius = np.where(np.arange(80) % 2, 1.0, 0.15)
    xy = np.r_[[(0.0, 0.0)], np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])]
    k = np.arange(80)
    z = np.random.default_rng(7).normal(size=81)
    return build_source(np.column_stack([xy, z]), np.column_stack([0 * k, k + 1, (k + 1) % 80 + 1]), name="pins")


SOURCES: dict[str, Callable[[], SourceMesh]] = {
    **{name: partial(kind.make, SIZE) for name, kind in KINDS.items() if not kind.rules},
    "checkerboard": _checkerboard,
    "rings": _rings,
    "spiral": _spiral,
    "double comb": _double_comb,
    "straight fan": _straight_fan,
    "wheel": _wheel,
    "slivers": _slivers,
    "spikes": _spikes,
    "flat": _flat,
    "twins": _twins,
    "bow ties": _bow_ties,
    "long and thin": _long_and_thin,
    "pins": _pins,
    "scan with bays": lambda: load("horseshoe:120"),
    "weights of many sizes": _checkerboard,
}


@cache
def nasty_model(name: str) -> OpenModel:
    """Return one of `SOURCES` as a model; some with weights."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        model = build_model(SOURCES[name](), up="z")
    rng = np.random.default_rng(8)
    n = int(model.source_index.max()) + 1
    if name == "weights of many sizes":
        return model.with_weights(10.0 ** rng.uniform(-8, 7, n))
    return model.with_weights(rng.integers(0, 3, n).astype(float)) if name in ("rings", "comb", "spiral") else model
