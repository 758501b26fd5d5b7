"""
A TIN within 100 metres, and its deviations
===========================================

The smallest mesh found that is nowhere off by more, beside one of as many triangles whose mean error is least.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation

from meshsimp_pymoo import MeshProblem, simplify_to

problem = MeshProblem("jacksboro:5")
x, y, height = problem.surface.points.T
within = simplify_to(problem, max_error=100, moves=1_000_000)
closest = simplify_to(problem, triangles=within.triangles, moves=1_000_000)

figure, axes = plt.subplots(2, 2, figsize=(9, 7), layout="constrained", height_ratios=(3, 1), sharey="row")
for (above, below), mesh, title in zip(axes.T, (within, closest), ("least maximum", "least mean"), strict=True):
    deviation = LinearTriInterpolator(Triangulation(x, y, mesh.faces), height)(x, y).filled(0) - height
    drawn = above.tripcolor(x, y, problem.surface.faces, deviation, cmap="RdBu", vmin=-120, vmax=120, shading="gouraud")
    above.triplot(x, y, mesh.faces, color="k", lw=0.3)
    above.set(aspect="equal", title=f"{title}: {mesh.triangles:,} triangles")
    above.axis("off")
    below.hist(deviation, np.arange(-202.5, 203, 5), color="#5b7ea3", log=True)
    below.axvspan(-100, 100, color="0.92", zorder=0)
    below.set(xlabel="deviation [m]", title=f"mean {mesh.mean_error:.1f} m, maximum {mesh.max_error:.0f} m")
axes[1, 0].set_ylabel("vertices")
figure.colorbar(drawn, ax=axes[0], label="deviation [m]", extend="both", shrink=0.8)
