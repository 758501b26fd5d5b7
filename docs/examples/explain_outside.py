"""
Vertices that no triangle covers
================================

Left, what a coarse mesh of a ring costs at each vertex of the original; right, where the nearest points of the mesh
are for those that it does not cover.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

from meshsimp_pymoo import MeshProblem, plot_error, thinning

problem = MeshProblem("ring:900")
kept = thinning(problem.surface).kept(26)
mesh = problem.simplify(kept)
points, faces = problem.model.points, mesh.faces

figure, (left, right) = plt.subplots(1, 2, figsize=(8.6, 4.1), layout="constrained")
plot_error(problem.surface, mesh.deviation, left, covered=mesh.covered)
left.set_title(
    f"{mesh.quality.triangles} triangles, error {mesh.quality.error:.3g}, {mesh.quality.uncovered} uncovered"
)

edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
edges, times = np.unique(edges, axis=0, return_counts=True)
ends = points[edges[times == 1], :2]  # the outline: edges of one triangle
bare = points[~mesh.covered, :2]
along = ends[:, 1] - ends[:, 0]
share = ((bare[:, None] - ends[:, 0]) * along).sum(axis=2) / (along**2).sum(axis=1)
nearest = ends[:, 0] + np.clip(share, 0, 1)[..., None] * along
closest = np.linalg.norm(nearest - bare[:, None], axis=2).argmin(axis=1)
right.triplot(*points[:, :2].T, faces, color="0.7", linewidth=0.8)
right.add_collection(LineCollection(np.stack([bare, nearest[np.arange(len(bare)), closest]], axis=1), color="#e08214"))
right.plot(*bare.T, ".", color="#2166ac", markersize=4)
right.set_aspect("equal")
right.set_axis_off()
ignored = MeshProblem("ring:900", outside="ignore").quality(kept).error
right.set_title(f'nearest points; outside="ignore": error {ignored:.3g}', fontsize=9)
