"""
Free meshes beside Delaunay meshes
==================================

As many triangles over vertices of the same scan: edges by the Delaunay rule; edges chosen for the error, as ``--free``
does; and the same without shape limit and without samples between the vertices, which fits the vertices alone.
"""

import matplotlib.pyplot as plt

from meshsimp_pymoo import MeshProblem, plot_mesh, simplify_to

TRIANGLES = 360
problem = MeshProblem("face:1000")
begun = simplify_to(problem, triangles=TRIANGLES, moves=300_000).front
shown = {
    "Delaunay": simplify_to(problem, triangles=TRIANGLES, moves=1_000_000),
    "free": begun.free(moves=1_200_000).best(triangles=TRIANGLES),
    "free, any shape": begun.free(moves=1_200_000, min_height=0.0, centroids=False).best(triangles=TRIANGLES),
}

figure, panels = plt.subplots(1, 4, figsize=(8.6, 3.8), layout="constrained")
plot_mesh(problem, panels[0], edges=False)
panels[0].set_title(f"original, {len(problem.model.faces):,} triangles\n\n", fontsize=8)
for (name, mesh), ax in zip(shown.items(), panels[1:], strict=True):
    plot_mesh(mesh, ax, edges=False)
    errors = f"mean error {mesh.mean_error:.3f} mm\nbetween the vertices {mesh.surface_error:.3f} mm"
    ax.set_title(f"{name}, {mesh.triangles} triangles\n{errors}", fontsize=8)
