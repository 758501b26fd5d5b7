"""
The order of the chromosome
===========================

Vertices are numbered along a Hilbert curve over the plane, so that neighbours on the vector are neighbours in space: a
segment of the vector is a patch of the model.
"""

import matplotlib.pyplot as plt
import numpy as np

from meshsimp_pymoo import MeshProblem

figure, panels = plt.subplots(1, 2, figsize=(8.6, 4.3), layout="constrained")
for name, ax in zip(("saddle:17", "face:1000"), panels, strict=True):
    x, y = MeshProblem(name).model.points[:, :2].T
    ax.plot(x, y, color="0.75", linewidth=0.8)
    ax.scatter(x, y, c=np.arange(len(x)), cmap="viridis", s=14, zorder=3)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_title(f"{name}: {len(x):,} vertices, first to last", fontsize=10)
