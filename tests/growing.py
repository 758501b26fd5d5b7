"""Models of any size whose outline or gaps grow with it: what the cost of an operation must not grow with.

Each function makes one of about n vertices, the same for the same n. `KINDS` names them with the rules they are tried
under.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.source.points import cloud_source


def _relief(x: FloatArray, y: FloatArray, scale: float, rng: np.random.Generator) -> FloatArray:
    """Hills of about that width, and some noise."""
    u, v = x / scale, y / scale
    z = np.sin(2.1 * u + np.sin(1.3 * v)) + 0.5 * np.sin(4.7 * v - 1.9 * u) + 0.3 * np.sin(7.3 * u) * np.sin(6.1 * v)
    noise: FloatArray = z + 0.02 * rng.normal(size=x.shape)
    return noise


def _turned(x: FloatArray, y: FloatArray, degrees: float) -> tuple[FloatArray, FloatArray]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return c * x - s * y, s * x + c * y


def _cloud(x: FloatArray, y: FloatArray, rng: np.random.Generator, max_edge: float | None = None) -> SourceMesh:
    return cloud_source(np.column_stack([x, y, _relief(x, y, 8.0, rng)]), max_edge=max_edge)


def flight_strip(n: int) -> SourceMesh:
    """Points of a strip ten times as long as wide, turned by 30 degrees; long edges are left out."""
    rng = np.random.default_rng(n)
    width = np.sqrt(n / 10)
    return _cloud(*_turned(rng.random(n) * 10 * width, rng.random(n) * width, 30.0), rng, 3.0)


def corridor(n: int, max_edge: float | None = 3.0) -> SourceMesh:
    """Points along a road that winds: a band of constant width, its length grows."""
    rng = np.random.default_rng(n)
    along, across = rng.random(n) * n / 12, rng.random(n) * 12
    turn = 2 * np.pi * along / 150
    return _cloud(along / 2 + across * 0.5, 30 * np.sin(turn) + across, rng, max_edge)


def corridor_hull(n: int) -> SourceMesh:
    """The same without a longest edge."""
    return corridor(n, None)


def islands(n: int) -> SourceMesh:
    """A raster with data in discs only."""
    rng = np.random.default_rng(n)
    side = int(np.sqrt(n / 0.5))
    y, x = np.mgrid[:side, :side].astype(float)
    z = _relief(x, y, 20.0, rng)
    z[(x % 16 - 8) ** 2 + (y % 16 - 8) ** 2 > 6.4**2] = np.nan
    return grid_source(z)


def contour_points(n: int) -> SourceMesh:
    """Points along closed contours of a hill, ten times as dense as the contours."""
    rng = np.random.default_rng(n)
    rings = int(np.sqrt(n / 10 / np.pi))
    x, y = [], []
    for k in range(1, rings + 1):
        turn = np.linspace(0, 2 * np.pi, int(20 * np.pi * k), endpoint=False)
        radius = 10.0 * k * (1 + 0.1 * np.sin(3 * turn + k / 9) + 0.02 * np.sin(11 * turn))
        x.append(radius * np.cos(turn) / 10)
        y.append(radius * np.sin(turn) / 10)
    return _cloud(np.concatenate(x), np.concatenate(y), rng)


def collinear_contours(n: int) -> SourceMesh:
    """Points on straight parallel lines, twenty times as dense as these: collinear rows, slivers at two sides."""
    rng = np.random.default_rng(n)
    lines = max(int(np.sqrt(n / 20)), 2)
    y, x = np.mgrid[:lines, : n // lines].astype(float)
    return _cloud(*_turned(x.ravel() / 20, y.ravel(), 20.0), rng)


def rounded_points(n: int) -> SourceMesh:
    """Random points rounded to a lattice of a tenth of their distance, with noise in the heights."""
    rng = np.random.default_rng(n)
    xy = np.unique(np.round(rng.random((n, 2)) * np.sqrt(n), 1), axis=0)
    return cloud_source(np.column_stack([xy, rng.normal(size=len(xy))]))


def ragged_border(n: int) -> SourceMesh:
    """A raster whose sides are eaten away to random depths."""
    rng = np.random.default_rng(n)
    side = int(np.sqrt(n / 0.9))
    y, x = np.mgrid[:side, :side].astype(float)
    z = _relief(x, y, 20.0, rng)
    depth = rng.integers(0, side // 10, (4, side))
    z[(y < depth[0]) | (side - 1 - y < depth[1]) | (x < depth[2][:, None]) | (side - 1 - x < depth[3][:, None])] = (
        np.nan
    )
    return grid_source(z)


def turned_strip(n: int) -> SourceMesh:
    """The samples of a raster eight times as long as wide as a mesh, turned by 17 degrees: slivers along its sides."""
    rng = np.random.default_rng(n)
    width = int(np.sqrt(n / 8))
    y, x = np.mgrid[:width, : 8 * width].astype(float)
    grid = grid_source(_relief(x, y, 20.0, rng))
    points = grid.points.copy()
    points[:, 0], points[:, 1] = _turned(points[:, 0], points[:, 1], 17.0)
    return build_source(points, grid.faces, name="turned strip")


def diagonal_strip(n: int) -> SourceMesh:
    """A raster with data along its diagonal only: stairs on both sides."""
    rng = np.random.default_rng(n)
    side = int(np.sqrt(n / 0.19))
    y, x = np.mgrid[:side, :side].astype(float)
    z = _relief(x, y, 20.0, rng)
    z[abs(x - y) > 0.1 * side] = np.nan
    return grid_source(z)


def scattered_gaps(n: int, share: float = 0.2) -> SourceMesh:
    """A raster of which every fifth sample is missing, anywhere."""
    rng = np.random.default_rng(n)
    side = int(np.sqrt(n / (1 - share)))
    y, x = np.mgrid[:side, :side].astype(float)
    z = _relief(x, y, 20.0, rng)
    z[rng.random(z.shape) < share] = np.nan
    return grid_source(z)


def comb(n: int) -> SourceMesh:
    """A raster cut by slots from one side nearly to the other, as deep as it is."""
    rng = np.random.default_rng(n)
    side = int(np.sqrt(n / 0.76))
    y, x = np.mgrid[:side, :side].astype(float)
    z = _relief(x, y, 20.0, rng)
    z[(x % 8 > 5) & (y < side - 4)] = np.nan
    return grid_source(z)


def fan(n: int) -> SourceMesh:
    """Half an oval around one vertex that has a triangle with each of its sides: one site with all others around it."""
    rng = np.random.default_rng(n)
    turn = np.linspace(0, 0.5, n - 1)
    xy = np.r_[[(0.0, 0.0)], np.column_stack([np.cos(turn), 0.9 * np.sin(turn)])]
    k = np.arange(1, n - 1)
    z = np.r_[0.0, np.sin(40 * turn) + 0.02 * rng.normal(size=n - 1)]
    return build_source(np.column_stack([xy, z]), np.column_stack([0 * k, k, k + 1]), name="fan")


class Kind(NamedTuple):
    """How a model is made, and the rules it is tried under."""

    make: Callable[[int], SourceMesh]
    rules: dict[str, Any]


KINDS = {
    "flight strip, turned": Kind(flight_strip, {}),
    "winding corridor": Kind(corridor, {}),
    "winding corridor, hull": Kind(corridor_hull, {}),
    "islands": Kind(islands, {}),
    "contour points": Kind(contour_points, {}),
    "collinear contours": Kind(collinear_contours, {}),
    "rounded points": Kind(rounded_points, {}),
    "ragged border": Kind(ragged_border, {}),
    "turned strip 1:8": Kind(turned_strip, {}),
    "diagonal strip": Kind(diagonal_strip, {}),
    "scattered gaps": Kind(scattered_gaps, {}),
    "scattered gaps, ignore": Kind(scattered_gaps, {"outside": "ignore"}),
    "comb": Kind(comb, {}),
    "fan": Kind(fan, {}),
}
