"""
A closed surface on a sphere
============================

A blob, its vertices on a sphere that touches the plane of their images, the convex hull there of some of them, and the
mesh which that hull is of the blob.
"""

import matplotlib.pyplot as plt
import numpy as np

from meshsimp_pymoo import MeshProblem, plot_mesh, thinning

problem = MeshProblem("blob:800")
kept = thinning(problem.surface).kept(80)
every, some = problem.surface.faces, problem.surface.triangles(kept)

# from the plane to the sphere: seen from its top, each image lies behind its place
plane = problem.model.xy - np.median(problem.model.xy, axis=0)
plane /= np.median(np.hypot(*plane.T))
square = (plane**2).sum(axis=1)
sphere = np.column_stack([2 * plane, square - 1]) / (square + 1)[:, None]

figure, axes = plt.subplots(1, 4, figsize=(11, 3), layout="constrained")
parts = [(problem.surface.points, every), (sphere, every), (sphere, some), (problem.surface.points, some)]
titles = ["original", "its vertices on a sphere", "the hull of those kept", f"their mesh: {len(some)} triangles"]
for ax, part, title in zip(axes, parts, titles, strict=True):
    plot_mesh(part, ax, edges=True)
    ax.set_title(title, fontsize=10)
