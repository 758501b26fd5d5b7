"""
Tiles that fit
==============

Four pieces, each simplified alone and to its own size. The vertices of their outlines are kept, so no gap opens.
"""

import matplotlib.pyplot as plt
import numpy as np
import trimesh

from meshsimp_pymoo import MeshProblem, plot_mesh, simplify_to

model = MeshProblem("jacksboro:6").model
whole = trimesh.Trimesh(model.points, model.faces)
x, y = (np.unique(whole.vertices[:, k]) for k in (0, 1))
side = whole.triangles_center[:, :2] > [x[len(x) // 2], y[len(y) // 2]]  # right and upper, of each triangle
low, size, gap = np.array([x[0], y[0]]), np.array([x[-1] - x[0], y[-1] - y[0]]), 0.06
green, sand, violet, red = (0.45, 0.68, 0.60), (0.90, 0.74, 0.42), (0.62, 0.58, 0.78), (0.86, 0.50, 0.42)

figure, (apart, together) = plt.subplots(1, 2, figsize=(9, 4.9), layout="constrained")
for where, triangles, colour in (
    ((0, 0), 1200, green),
    ((1, 0), 500, sand),
    ((0, 1), 800, violet),
    ((1, 1), 300, red),
):
    tile = whole.submesh([np.flatnonzero((side == where).all(axis=1))], append=True)
    mesh = simplify_to(MeshProblem(tile, pin="border", up="z"), triangles=triangles, moves=200_000).mesh
    plot_mesh(mesh, together, colour=np.array(colour), edges=True)
    moved = np.add(mesh.vertices, [*(gap * size * where), 0])
    plot_mesh((moved, mesh.faces), apart, colour=np.array(colour), edges=True)
for ax, most in ((apart, 1 + gap), (together, 1)):
    ax.set(xlim=(low[0], low[0] + most * size[0]), ylim=(low[1], low[1] + most * size[1]))
