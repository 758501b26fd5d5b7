"""
Several vertices at one place
=============================

Which of the vertices at one (x, y) carries the surface, in profile: at a step, at a skirt, and in a point cloud.
"""

import matplotlib.pyplot as plt
import numpy as np

BLUE, RED, GREY = "#2166ac", "#b2182b", "0.6"
figure, panels = plt.subplots(1, 3, figsize=(8.6, 2.6), layout="constrained", sharey=True)

step, skirt, cloud = panels
step.plot([0, 1, 1, 2], [0, 0, 1, 1], color=GREY)
step.plot([0, 1, 2], [0, 1, 1], color=BLUE, linewidth=2)
step.plot([0, 1, 2], [0, 1, 1], "o", color=BLUE, markersize=8, label="carries the surface")
step.plot([1], [0], "o", color=RED, markersize=8, label="counts in the error")
step.plot([1, 1], [0, 1], color=RED, linewidth=2)
step.set_title("a step in a mesh: the highest", fontsize=10)

x, top = np.linspace(0, 2, 5), np.array([0.8, 1.0, 0.9, 1.1, 0.95])
skirt.plot([0, *x, 2], [0, *top, 0], color=GREY)
skirt.plot(x, top, color=BLUE, linewidth=2)
skirt.plot(x, top, "o", color=BLUE, markersize=8)
skirt.plot([0, 2], [0, 0], "o", color="white", markeredgecolor=RED, markersize=8, label="does not count")
skirt.set_title("a skirt: its feet do not count", fontsize=10)

ground = np.array([0.1, 0.15, 0.05, 0.2, 0.12])
cloud.plot(x, ground, color=BLUE, linewidth=2)
cloud.plot(x, ground, "o", color=BLUE, markersize=8)
cloud.plot(x[[1, 1, 3]], [0.7, 1.0, 0.9], "x", color=RED, markersize=8, label="left out")
cloud.set_title("a point cloud: the lowest", fontsize=10)

for ax in panels:
    ax.set(xlim=(-0.15, 2.15), ylim=(-0.2, 1.6), xticks=[], yticks=[])
    ax.spines[["top", "right", "left", "bottom"]].set_visible(False)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, loc="upper left", ncols=2, fontsize=8)
