"""Draw ``free.png``: original, Delaunay mesh and free mesh of equally many triangles, as a whole and near by.

``python docs/pictures/free.py`` makes it anew, in a minute; the same moves and seed give the same meshes.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from meshsimp_pymoo import MeshProblem, simplify_to
from meshsimp_pymoo.report.figures import plot_mesh

MODEL = "jacksboro:4"
TRIANGLES = 1000
# About ten seconds each: moves for a subset alone, and for a subset and then for a free mesh.
SUBSET_MOVES = 10_000_000
FREE_MOVES = 3_000_000, 12_000_000
NEAR = (0.30, 0.45), 0.40  # corner and side of what is shown near by, as shares of the whole
# Drawn twice as large, so that the edges of small triangles do not beat with the pixels, and with few colours: a small
# file.
DOTS, COLOURS = 75, 64
PICTURE = Path(__file__).with_name("free.png")


def main() -> None:
    """Search both meshes and draw them."""
    problem = MeshProblem(MODEL)
    delaunay = simplify_to(problem, triangles=TRIANGLES, moves=SUBSET_MOVES)
    begun = simplify_to(problem, triangles=TRIANGLES, moves=FREE_MOVES[0])
    free = begun.front.free(moves=FREE_MOVES[1]).best(triangles=TRIANGLES)
    shown = {"original": problem.model, "Delaunay": delaunay, "free": free}
    figure = Figure(figsize=(12.0, 8.6), layout="constrained")
    above, below = figure.subplots(2, 3)
    (left, bottom), side = NEAR
    low, extent = problem.surface.points.min(axis=0), np.ptp(problem.surface.points, axis=0)
    for (name, mesh), whole, near in zip(shown.items(), above, below, strict=True):
        plot_mesh(mesh, whole, exaggeration=problem.surface.view.exaggeration, edges=False)
        plot_mesh(mesh, near, exaggeration=problem.surface.view.exaggeration, edges=True)
        near.set_xlim(low[0] + extent[0] * np.array([left, left + side]))
        near.set_ylim(low[1] + extent[1] * np.array([bottom, bottom + side]))
        whole.set_title(f"{name}, {len(mesh.faces):,} triangles")
    for solution, near in ((delaunay, below[1]), (free, below[2])):
        near.set_title(
            f"mean error {solution.mean_error:.1f}, between the vertices {solution.surface_error:.1f}", fontsize=11
        )
    content = io.BytesIO()
    figure.savefig(content, dpi=2 * DOTS)
    large = Image.open(content).convert("RGB")
    large.resize((large.width // 2, large.height // 2), Image.Resampling.LANCZOS).quantize(COLOURS).save(
        PICTURE, optimize=True
    )


if __name__ == "__main__":
    main()
