"""
What the error counts
=====================

A profile of nine vertices and a mesh of four of them: each original vertex costs its vertical distance to the mesh, and
one that no triangle covers its distance to the nearest point of it.
"""

import matplotlib.pyplot as plt
import numpy as np

x = np.arange(9.0)
height = np.array([0.0, 1.2, 1.9, 3.6, 3.1, 2.4, 2.9, 1.2, 0.6])
kept = np.array([0, 3, 5, 7])
covered = x <= x[kept[-1]]

figure, ax = plt.subplots(figsize=(8.6, 3.5), layout="constrained")
ax.plot(x, height, color="0.6", linewidth=1, label="original")
ax.plot(x[kept], height[kept], color="#2166ac", linewidth=2.2, label="simplified mesh")
mesh = np.interp(x, x[kept], height[kept])
for k in np.flatnonzero(covered & (height != mesh)):
    ax.plot([x[k]] * 2, [height[k], mesh[k]], color="#b2182b", linewidth=2.5, solid_capstyle="butt")
    ax.annotate(
        f"{abs(height[k] - mesh[k]):.2f}", (x[k] + 0.07, (height[k] + mesh[k]) / 2), color="#b2182b", va="center"
    )
last = kept[-1]
ax.plot(x[last:], height[last:], ":", color="#e08214", linewidth=2.5, label="not covered: to the nearest point")
ax.annotate(f"{np.hypot(x[8] - x[7], height[8] - height[7]):.2f}", (7.6, 1.02), color="#e08214")
ax.plot(x, height, "o", color="0.35", markersize=5)
ax.plot(x[kept], height[kept], "o", color="#2166ac", markersize=9, label="kept vertices")
ax.plot([], [], color="#b2182b", linewidth=2.5, label="cost of a covered vertex")
ax.legend(frameon=False, ncols=2, loc="upper right")
ax.set(xlim=(-0.3, 9.9), ylim=(-0.3, 4.9), xlabel="x", ylabel="height")
ax.spines[["top", "right"]].set_visible(False)
