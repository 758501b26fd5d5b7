"""
Break lines
===========

As many triangles over an embankment twice: without its toes and crests, and with them as edges of every mesh. Red: where
the first is off the lines by more than their tolerance.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation

from meshsimp_pymoo import MeshProblem, simplify_to
from meshsimp_pymoo.datasets import load_lines

TRIANGLES, TOLERANCE = 500, 0.3
lines = list(load_lines("embankment").lines)
lined = MeshProblem("embankment", break_lines=lines, line_tolerance=TOLERANCE)

figure, axes = plt.subplots(2, 1, figsize=(7, 8.4), layout="constrained")
for ax, problem, name in zip(axes, (MeshProblem("embankment"), lined), ("without lines", "with break lines"), strict=True):
    mesh = simplify_to(problem, triangles=TRIANGLES, moves=500_000)
    mesh.plot(ax, exaggeration=1.0)
    surface = LinearTriInterpolator(Triangulation(*mesh.points[:, :2].T, mesh.faces), mesh.points[:, 2])
    given = np.concatenate(lined.model.lines.originals)
    off = np.abs(surface(*given[:, :2].T) - given[:, 2])
    far = given[off > TOLERANCE]
    ax.plot(far[:, 0], far[:, 1], ".", color="#c8452f", markersize=5)
    ax.set_title(f"{name}: {mesh.triangles} triangles, mean error {mesh.mean_error:.3f} m, off the lines by {off.max():.2f} m")
    ax.set_xlim(0, 250)
    ax.set_ylim(60, 240)
