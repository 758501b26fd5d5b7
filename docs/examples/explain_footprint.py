"""
The footprint: bays and holes stay open
=======================================

A horseshoe and a ring, simplified by two readings of the Delaunay triangulation: without the triangles whose centroid
lies outside the original (the default), and with all of them.
"""

import matplotlib.pyplot as plt

from meshsimp_pymoo import MeshProblem, plot_mesh, thinning

figure, panels = plt.subplots(2, 3, figsize=(8.6, 6), layout="constrained")
for name, row in zip(("horseshoe:900", "ring:900"), panels, strict=True):
    original = MeshProblem(name)
    kept = thinning(original.surface).kept(60)
    plot_mesh(original, row[0], edges=True)
    row[0].set_title(f"original, {len(original.model.faces):,} triangles", fontsize=10)
    for footprint, ax in zip(("model", "hull"), row[1:], strict=True):
        problem = MeshProblem(name, footprint=footprint)
        plot_mesh(problem, ax, kept=kept)
        ax.set_title(f'footprint="{footprint}", {problem.quality(kept).triangles} triangles', fontsize=10)
