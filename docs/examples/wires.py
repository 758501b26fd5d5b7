"""
Small multiples of a front
==========================

Twelve meshes of one front, from coarse to fine, as lines seen from above.
"""

import matplotlib.pyplot as plt
import numpy as np
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, memetic

front = Front.from_result(minimize(MeshProblem("face:3000"), memetic(), Moves(500_000), seed=1))
sizes = np.geomspace(60, 3000, 12)

figure, axes = plt.subplots(2, 6, figsize=(9, 4.8), layout="constrained")
for ax, size in zip(axes.flat, sizes, strict=True):
    mesh = front.best(triangles=int(size))
    ax.triplot(*mesh.points[:, :2].T, mesh.faces, color="#2b5c8a", lw=0.45)
    ax.set_title(f"{mesh.triangles:,}", fontsize=9)
    ax.set_aspect("equal")
    ax.axis("off")
