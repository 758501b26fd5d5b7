"""
The error of a face as colour
=============================

One scan with fewer and fewer triangles, and below by how much each of its vertices is off, on one scale.
"""

import matplotlib.pyplot as plt

from meshsimp_pymoo import MeshProblem, simplify_to

problem = MeshProblem("face:4000")
figure, axes = plt.subplots(2, 4, figsize=(9, 6.8), layout="constrained")
for (above, below), triangles in zip(axes.T, (1600, 400, 100, 40), strict=True):
    mesh = simplify_to(problem, triangles=triangles, moves=150_000)
    mesh.plot(above, edges=True)
    mesh.plot_error(below, largest=5, bar=False, covered=None)
    above.set_title(f"{triangles:,} triangles", fontsize=11)
    below.set_title(f"mean error {mesh.mean_error:.2f} mm", fontsize=10)
figure.colorbar(below.collections[0], ax=axes[1], label="error [mm]", extend="max", shrink=0.9)
