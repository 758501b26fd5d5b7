"""
Break lines
===========

As many triangles over an embankment twice: chosen for the error alone, and with its toes and crests as edges of every
mesh. Red: where a mesh is off these lines by more than their tolerance. That costs a part of the error elsewhere.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation

from meshsimp_pymoo import MeshProblem, simplify_to
from meshsimp_pymoo.datasets import load_lines

TRIANGLES, TOLERANCE = 160, 1.0  # metres
lined = MeshProblem("embankment", break_lines=list(load_lines("embankment").lines), line_tolerance=TOLERANCE)
given = np.concatenate(lined.model.lines.originals)

figure, axes = plt.subplots(2, 1, figsize=(7, 9), layout="constrained")
problems = {"without lines": MeshProblem("embankment"), "with break lines": lined}
for ax, (name, problem) in zip(axes, problems.items(), strict=True):
    mesh = simplify_to(problem, triangles=TRIANGLES, moves=500_000)
    mesh.plot(ax)
    heights = LinearTriInterpolator(Triangulation(*mesh.points[:, :2].T, mesh.faces), mesh.points[:, 2])
    off = np.abs(heights(*given[:, :2].T) - given[:, 2])
    ax.plot(*given[off > TOLERANCE, :2].T, ".", color="#c8452f", markersize=5)
    errors = f"mean error {mesh.mean_error:.2f} m, off the lines by up to {off.max():.1f} m"
    ax.set_title(f"{name}: {mesh.triangles} triangles,\n{errors}", fontsize=10)
