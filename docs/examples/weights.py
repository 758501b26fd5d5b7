"""
More triangles where one looks
==============================

The error of a vertex counts the less the farther it is from the dot. Both meshes have 800 triangles.
"""

import matplotlib.pyplot as plt
import numpy as np

from meshsimp_pymoo import MeshProblem, simplify_to

plain = MeshProblem("jacksboro:5")
x, y, _ = plain.surface.points.T
spot = np.quantile(x, 0.3), np.quantile(y, 0.35)
weights = np.empty(len(x))  # one for each row of the file
weights[plain.model.source_index] = np.exp(-(((x - spot[0]) ** 2 + (y - spot[1]) ** 2) / 6000**2)) + 0.01
weighted = MeshProblem("jacksboro:5", weights=weights)

figure, axes = plt.subplots(1, 2, figsize=(9, 5.2), layout="constrained")
for ax, problem, title in zip(axes, (plain, weighted), ("all vertices count alike", "near the dot"), strict=True):
    mesh = simplify_to(problem, triangles=800, moves=600_000)
    mesh.plot(ax)
    ax.plot(*spot, "o", color="#c8452f", markersize=9)
    ax.set_title(title)
