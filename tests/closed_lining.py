"""Closed surfaces with break lines of all kinds, and what tests do with them."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh

from meshsimp_pymoo.arrays import BoolArray, FloatArray
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.surface.closed.model import ClosedModel, closed_model
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.rules import Rules

# Where the ball of the pair is.
BALL = np.array([3.0, 0.5, 0.25])


@cache
def model_of(name: str) -> ClosedModel:
    return closed_model(SOURCES[name]() if name in SOURCES else load(name))


def of_mesh(mesh: trimesh.Trimesh, name: str) -> SourceMesh:
    return build_source(mesh.vertices, mesh.faces, name=name)


def cylinder() -> SourceMesh:
    mesh = trimesh.creation.cylinder(1.0, 2.0, sections=24)
    return of_mesh(mesh.subdivide().subdivide(), "cylinder")


def holed() -> SourceMesh:
    """Return a sphere without its caps above and below."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.update_faces(np.abs(mesh.triangles_center[:, 2]) < 0.8)
    mesh.remove_unreferenced_vertices()
    return of_mesh(mesh, "holed")


def pair() -> SourceMesh:
    """Return a cube and a ball beside each other."""
    cube, ball = trimesh.creation.box().subdivide().subdivide(), trimesh.creation.icosphere(subdivisions=2)
    ball.apply_translation(BALL)
    return of_mesh(trimesh.util.concatenate([cube, ball]), "pair")


SOURCES = {"cylinder": cylinder, "holed": holed, "pair": pair}


def lined(name: str, lines="sharp:30", tolerance: float | None = None, **rules) -> ClosedSurface:
    return ClosedSurface(model_of(name), Rules(break_lines=lines, line_tolerance=tolerance, **rules))


def meridian(tilt: float = 0.3) -> FloatArray:
    angle = np.linspace(0.2, np.pi - 0.2, 12)
    return (
        np.column_stack([np.sin(angle), tilt * np.sin(2.0 * angle), np.cos(angle)])
        / np.sqrt(1.0 + (tilt * np.sin(2.0 * angle)) ** 2)[:, None]
    )


def parallel(z: float = 0.35, n: int = 30) -> FloatArray:
    angle = np.append(2.0 * np.pi * np.arange(n) / n, 0.0)
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(n + 1, z)])


CASES = {
    "edges of a tetrahedron": ("tetrahedron:9",),
    "edges of a cube": ("cube:9",),
    "edges of an icosahedron": ("icosahedron:6",),
    "edges of a cylinder": ("cylinder",),
    "edges of one of two parts": ("pair",),
    "rims": ("holed", "outline", 0.02),
    "a meridian": ("sphere:600", [meridian()], 0.01),
    "a parallel": ("sphere:600", [parallel()], 0.01),
    "lines on both parts": ("pair", [meridian() + BALL, [[-0.5, -0.5, 0.5], [0.1, 0.5, 0.5]]], 0.01),
}  # fmt: skip


@cache
def case(name: str) -> ClosedSurface:
    of, *said = CASES[name]
    return lined(of, *said)


def random_subset(surface: ClosedSurface, share: float, seed: int) -> BoolArray:
    kept = surface.pinned | (np.random.default_rng(seed).random(surface.n_vertices) < share)
    for part in range(surface.model.n_parts):  # the least mesh of each is its pole and one vertex more
        kept[np.flatnonzero((surface.model.part == part) & ~surface.pinned)[0]] |= surface.model.n_parts > 1
    return kept
