"""Draw ``free.png``: originals, and Delaunay and free meshes of equally many triangles.

``python docs/pictures/free.py`` makes it anew, in a minute or two; the same moves and seed give the same meshes.
"""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from meshsimp_pymoo import MeshProblem, simplify_to
from meshsimp_pymoo.report.figures import plot_mesh

MODELS = {"jacksboro:4": 1000, "face:1000": 360}  # and triangles
# In about the same time: moves for a subset alone, and for a subset and then for a free mesh.
SUBSET_MOVES = 10_000_000
FREE_MOVES = 3_000_000, 12_000_000
FREE = {"free": {}, "free, any shape, no centroids": {"min_height": 0.0, "centroids": False}}
# Drawn twice as large, so that the edges of small triangles do not beat with the pixels, and in few colours: a small
# file.
DOTS, COLOURS = 70, 64
PICTURE = Path(__file__).with_name("free.png")


def meshes(problem, triangles):
    """Return a mesh of each kind."""
    begun = simplify_to(problem, triangles=triangles, moves=FREE_MOVES[0]).front
    found = {"Delaunay": simplify_to(problem, triangles=triangles, moves=SUBSET_MOVES)}
    return found | {
        name: begun.free(moves=FREE_MOVES[1], **how).best(triangles=triangles) for name, how in FREE.items()
    }


def main() -> None:
    """Search the meshes and draw them."""
    figure = Figure(figsize=(13.6, 8.2), layout="constrained")
    for (name, triangles), panels in zip(MODELS.items(), figure.subplots(len(MODELS), 4), strict=True):
        problem = MeshProblem(name)
        shown = {name: problem.model} | meshes(problem, triangles)
        for (title, mesh), panel in zip(shown.items(), panels, strict=True):
            plot_mesh(mesh, panel, exaggeration=problem.surface.view.exaggeration, edges=False)
            said = f"{title}, {len(mesh.faces):,} triangles\n"
            if mesh is not problem.model:
                said += f"mean error {mesh.mean_error:.3g}, between the vertices {mesh.surface_error:.3g}"
            panel.set_title(said, fontsize=10)
    content = io.BytesIO()
    figure.savefig(content, dpi=2 * DOTS)
    large = Image.open(content).convert("RGB")
    small = large.resize((large.width // 2, large.height // 2), Image.Resampling.LANCZOS)
    small.quantize(COLOURS).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
