"""
Contours of a small mesh over those of the original
===================================================

Lines of equal height every 100 m: grey of the original, red of a mesh with a seventh of its triangles.
"""

import matplotlib.pyplot as plt
import numpy as np

from meshsimp_pymoo import MeshProblem, simplify_to

problem = MeshProblem("jacksboro:4")
mesh = simplify_to(problem, triangles=2500, moves=1_000_000)
x, y, height = problem.model.file_points.T
levels = np.arange(0, 1000, 100)

figure, ax = plt.subplots(figsize=(9, 6.4), layout="constrained")
ax.tripcolor(x, y, problem.surface.faces, height, shading="gouraud", cmap="YlGn_r", vmin=-900)
ax.tricontour(x, y, problem.surface.faces, height, levels=levels, colors="0.3", linewidths=0.8)
ax.tricontour(x, y, mesh.faces, height, levels=levels, colors="#c8452f", linewidths=1.4)
ax.set(aspect="equal", xlim=(0, 18_000), ylim=(-31_000, -18_200))
ax.axis("off")
