"""
A coast, smaller and smaller
============================

Land and sea in the colours of a map, each vertex with its own: all triangles, a tenth, a fiftieth and one in 250.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap, TwoSlopeNorm

from meshsimp_pymoo import MeshProblem, plot_mesh, simplify_to

surface = MeshProblem("topobathy").surface
height = surface.model.file_points[:, 2]
sea, land = plt.get_cmap("YlGnBu_r"), plt.get_cmap("gist_earth")
colours = ListedColormap([*sea(np.linspace(0.1, 0.6, 128)), *land(np.linspace(0.45, 0.97, 128))])
colour = colours(TwoSlopeNorm(0, height.min(), height.max())(height))

figure, axes = plt.subplots(2, 2, figsize=(9, 6.6), layout="constrained")
for ax, share in zip(axes.flat, (1, 10, 50, 250), strict=True):
    mesh = surface if share == 1 else simplify_to(surface, triangles=len(surface.faces) // share, moves=300_000)
    plot_mesh((mesh.points, mesh.faces), ax, colour=colour, exaggeration=10, view=(60, 0), edges=share > 10)
    ax.set_title(f"{len(mesh.faces):,} triangles")
