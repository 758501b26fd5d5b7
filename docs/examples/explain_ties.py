"""
Ties: one mesh for each subset
==============================

On a grid every square can be cut in two ways. Red, the triangulations that Qhull makes of the same points listed in two
orders, their differences thick; blue, those of this package.
"""

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from matplotlib.collections import LineCollection
from scipy.spatial import Delaunay

from meshsimp_pymoo import MeshProblem

rng = np.random.default_rng(3)
y, x = np.mgrid[:7.0, :7.0]
points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
faces = Delaunay(points[:, :2] + rng.normal(scale=1e-3, size=(len(points), 2))).simplices


def edges_of(points, faces):
    """Return the edges, an end first that comes first in the plane."""
    ends = points[np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), :2]
    return {tuple(sorted(map(tuple, pair))) for pair in ends.tolist()}


by_qhull, by_us = [], []
for _ in range(2):
    order = rng.permutation(len(points))
    listed, triangles = points[order], np.argsort(order)[faces]
    by_qhull.append(edges_of(listed, Delaunay(listed[:, :2]).simplices))
    problem = MeshProblem(trimesh.Trimesh(listed, triangles, process=False))
    mesh = problem.mesh(np.ones(problem.n_var, dtype=bool))
    by_us.append(edges_of(mesh.vertices, mesh.faces))

figure, panels = plt.subplots(1, 4, figsize=(8.6, 2.5), layout="constrained")
for name, colour, pair, axes in (
    ("Qhull", "#b2182b", by_qhull, panels[:2]),
    ("meshsimp_pymoo", "#2166ac", by_us, panels[2:]),
):
    for k, ax in enumerate(axes):
        ax.add_collection(LineCollection(sorted(pair[k]), color=colour, linewidth=0.9))
        ax.add_collection(LineCollection(sorted(pair[k] - pair[1 - k]), color=colour, linewidth=3))
        ax.set_title(f"{name}, order {k + 1}", fontsize=9)
        ax.set(xlim=(-0.2, 6.2), ylim=(-0.2, 6.2))
        ax.set_aspect("equal")
        ax.set_axis_off()
