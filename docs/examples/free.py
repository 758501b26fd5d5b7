"""
Edges chosen for the error
==========================

As many triangles twice: joined by the Delaunay rule, and freely. The red edges are none of Delaunay's.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

from meshsimp_pymoo import simplify_to

delaunay = simplify_to("ridge:65", triangles=90, moves=500_000)
free = delaunay.front.free(moves=1_000_000).best(triangles=90)


def edges(faces):
    """Return the edges of triangles, as pairs of vertices."""
    return set(map(tuple, np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).tolist()))


figure, axes = plt.subplots(1, 2, figsize=(9, 5), layout="constrained")
for ax, mesh, title in zip(axes, (delaunay, free), ("Delaunay", "free"), strict=True):
    mesh.plot(ax)
    own = edges(mesh.faces) - edges(mesh.front.surface.triangles(mesh.kept))
    ax.add_collection(LineCollection([mesh.points[list(edge), :2] for edge in own], colors="#c8452f"))
    ax.set_title(f"{title}: {mesh.triangles} triangles, mean error {mesh.surface_error:.4f}")
