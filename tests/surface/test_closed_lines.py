"""Break lines of closed surfaces: every forced edge is in every mesh, and what is said of them is true."""

from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo.arrays import BoolArray, IntArray
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.surface.closed.model import closed_model
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.rules import Rules


def lined(name: str, lines: str = "sharp:30", tolerance: float | None = None) -> ClosedSurface:
    return ClosedSurface(closed_model(load(name)), Rules(break_lines=lines, line_tolerance=tolerance))


def edges(faces: IntArray) -> set[tuple[int, int]]:
    return {(min(a, b), max(a, b)) for a, b in np.concatenate([faces, np.roll(faces, 1, axis=1)])[:, :2].tolist()} | {
        (min(a, b), max(a, b)) for a, b in faces[:, 1:].tolist()
    }


def random_subset(surface: ClosedSurface, share: float, seed: int) -> BoolArray:
    return surface.pinned | (np.random.default_rng(seed).random(surface.n_vertices) < share)


# -------------------------------------------------------------------------------------------------------- known answers


@pytest.mark.parametrize(("name", "n_edges"), [("tetrahedron:9", 6), ("cube:9", 12), ("icosahedron:6", 30)])
def test_the_sharp_edges_of_a_polyhedron_are_its_edges(name, n_edges):
    surface = lined(name)
    lines = surface.model.lines
    assert len(lines.originals) == n_edges
    # the pole has two vertices more, and may have one on each of two edges
    assert n_edges <= len(lines.segments) <= n_edges + 2
    mesh = surface.simplify(surface.pinned)
    assert mesh.quality.surface_error < 1e-15 * surface.diagonal
    assert mesh.quality.line_max_error < 1e-15 * surface.diagonal


@pytest.mark.parametrize("share", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("name", ["tetrahedron:9", "cube:9", "icosahedron:6"])
def test_every_forced_edge_is_in_the_mesh_of_every_subset(name, share):
    surface = lined(name)
    for seed in range(3):
        kept = random_subset(surface, share, seed)
        mesh = surface.simplify(kept)
        there = edges(mesh.faces)
        for chain in surface.line_chains(kept):
            assert {
                (min(a, b), max(a, b)) for a, b in zip(chain[:-1].tolist(), chain[1:].tolist(), strict=True)
            } <= there
        assert mesh.quality.line_max_error <= surface.model.lines.tolerance
        assert mesh.quality.triangles == 2 * kept.sum() - 4
