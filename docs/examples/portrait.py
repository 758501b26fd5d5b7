"""
Portraits in triangles
======================

A scan of a face, each triangle in the colour of its brightness: for a poster, a cover, a first slide.
"""

import matplotlib.pyplot as plt
import numpy as np

from meshsimp_pymoo import simplify_to

dark = "#11131f"
figure, axes = plt.subplots(1, 3, figsize=(9, 5), layout="constrained", facecolor=dark)
for ax, triangles, colours in zip(axes, (250, 800, 2400), ("magma", "cividis", "YlGnBu_r"), strict=True):
    mesh = simplify_to("face:6000", triangles=triangles, moves=500_000)
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    bright = normal @ [-0.45, 0.45, 0.77] / np.linalg.norm(normal, axis=1)
    x, y, _ = mesh.points.T
    ax.tripcolor(x, y, mesh.faces, facecolors=bright, cmap=colours, vmin=-0.2, vmax=1.05, edgecolors=dark, lw=0.3)
    ax.set_aspect("equal")
    ax.axis("off")
