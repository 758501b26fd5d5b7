"""Small closed surfaces as scans and assemblies have them: with holes, of several parts, folded."""

from __future__ import annotations

import numpy as np
import trimesh

from meshsimp_pymoo.formats.source import SourceMesh


def bumpy(subdivisions: int = 3) -> trimesh.Trimesh:
    """Return a ball with bumps, of no symmetry."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    x, y, z = mesh.vertices.T
    mesh.vertices *= (1.0 + 0.2 * np.sin(5.0 * x + 1.0) * np.cos(4.0 * y + z))[:, None]
    return mesh


def without(mesh: trimesh.Trimesh, balls: list[tuple[list[float], float]]) -> trimesh.Trimesh:
    """Return a mesh without the faces whose centres lie in balls: its holes have ragged rims."""
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    kept = np.ones(len(centres), bool)
    for centre, radius in balls:
        kept &= np.linalg.norm(centres - centre, axis=1) > radius
    found = trimesh.Trimesh(mesh.vertices, mesh.faces[kept], process=False)
    found.remove_unreferenced_vertices()
    return found


def holed() -> trimesh.Trimesh:
    """Return the ball with a large hole, a small one and one of a single face."""
    return without(bumpy(), [([0.9, 0.3, 0.1], 0.5), ([-0.5, 0.8, 0.2], 0.22), ([-0.2, -0.9, -0.4], 0.12)])


def bowl() -> trimesh.Trimesh:
    """Return half of the ball, folded over at its rim: most of the whole is a hole."""
    return without(bumpy(), [([0.0, 0.0, 1.0], 0.9)])


def parts() -> trimesh.Trimesh:
    """Return three parts: the ball with holes, a smaller one, and a box."""
    box = trimesh.creation.box()
    for _ in range(2):
        box = box.subdivide()
    small = bumpy(2)
    small.vertices = 0.4 * small.vertices + [3.0, 0.2, 0.1]
    box.vertices += [0.3, 4.0, -1.0]
    return trimesh.util.concatenate([holed(), small, box])


def as_source(mesh: trimesh.Trimesh, name: str) -> SourceMesh:
    return SourceMesh(np.array(mesh.vertices), np.array(mesh.faces, np.int64), {}, name)
