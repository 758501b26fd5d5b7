"""
Levels of detail in one picture
===============================

Five meshes of one front, each cut to its strip of one terrain.
"""

import matplotlib.pyplot as plt
import numpy as np
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, memetic

front = Front.from_result(minimize(MeshProblem("jacksboro:4"), memetic(60), Moves(600_000), seed=1))
x = front.surface.points[:, 0]
edges = np.linspace(x.min(), x.max(), 6)

figure, ax = plt.subplots(figsize=(9, 6.4), layout="constrained")
strip = ax.get_xaxis_transform()  # x as drawn, y as a share of the axes
for left, right, size in zip(edges, edges[1:], (120, 400, 1300, 4000, 12_000), strict=False):
    mesh = front.best(triangles=size)
    mesh.plot(ax, edges=True, view=(40, 0))
    ax.collections[-1].set_clip_path(plt.Rectangle((left, 0), right - left, 1, transform=strip))
    ax.plot([right, right], [0, 1], color="white", linewidth=2, transform=strip)
    ax.text((left + right) / 2, 0, f"{mesh.triangles:,}", ha="center", va="top", transform=strip)
