"""
The front of a terrain
======================

Every mesh for which no other one found is both smaller and more accurate, and three of them.
"""

import matplotlib.pyplot as plt
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, memetic

result = minimize(MeshProblem("jacksboro:6"), memetic(), Moves(500_000), seed=1)
front = Front.from_result(result)
shown = [front.best(triangles=size) for size in (80, 400, 2000)]

figure, axes = plt.subplot_mosaic("FFFaa;FFFbb;FFFcc", figsize=(9, 6.6), layout="constrained")
front.plot(axes["F"], marked=[mesh.solution for mesh in shown], n_points=front.model.n_vertices, unit="m")
for letter, mesh in zip("abc", shown, strict=True):
    mesh.plot(axes[letter], view=(60, 0))
    axes[letter].set_title(f"{letter}: {mesh.triangles:,} triangles, mean error {mesh.mean_error:.0f} m", fontsize=10)
