"""
Why tiles leave no seam
=======================

A vertex may be removed in its tile while all triangles around it (blue) have their circles inside the tile (dashed):
then nothing outside of the tile can change them. The others (red) wait until the tiles are shifted.
"""

import matplotlib.pyplot as plt
import numpy as np

from meshsimp_pymoo import MeshProblem, thinning

problem = MeshProblem("jacksboro:11")
kept = thinning(problem.surface).kept(420)
faces = problem.surface.triangles(kept)
xy = problem.model.points[:, :2]
low, high = xy.min(axis=0), xy.max(axis=0)

corners = xy[faces]
(b, c) = (corners[:, k] - corners[:, 0] for k in (1, 2))
area = 2 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
offset = np.column_stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb]) / area[:, None]
centre, radius = corners[:, 0] + offset, np.linalg.norm(offset, axis=1)

figure, panels = plt.subplots(1, 2, figsize=(8.6, 4.6), layout="constrained")
for ax, shift, name in zip(panels, (0.0, 0.5), ("first phase", "then shifted"), strict=True):
    cuts = [low + (high - low) * (k + shift) / 3 for k in range(-1, 4)]
    cut_x, cut_y = np.array(cuts).T
    tile = [np.searchsorted(cut, value) for cut, value in ((cut_x, centre[:, 0]), (cut_y, centre[:, 1]))]
    left, right = (cut_x[np.clip(tile[0] + k, 0, 4)] for k in (-1, 0))
    bottom, top = (cut_y[np.clip(tile[1] + k, 0, 4)] for k in (-1, 0))
    # the model's own border is no cut: nothing lies beyond it
    room = [
        np.where(left <= low[0], np.inf, centre[:, 0] - left),
        np.where(right >= high[0], np.inf, right - centre[:, 0]),
        np.where(bottom <= low[1], np.inf, centre[:, 1] - bottom),
        np.where(top >= high[1], np.inf, top - centre[:, 1]),
    ]
    inside = radius < np.min(room, axis=0)
    bound = np.isin(np.arange(len(xy)), faces[~inside])
    ax.tripcolor(*xy.T, faces, inside.astype(float), cmap="RdBu", vmin=-0.6, vmax=1.6)
    ax.triplot(*xy.T, faces, color="0.5", linewidth=0.5)
    for x in cut_x[(cut_x > low[0]) & (cut_x < high[0])]:
        ax.axvline(x, color="black", linestyle="--", linewidth=1)
    for y in cut_y[(cut_y > low[1]) & (cut_y < high[1])]:
        ax.axhline(y, color="black", linestyle="--", linewidth=1)
    ax.plot(*xy[kept & ~bound].T, "o", color="#2166ac", markersize=3)
    ax.plot(*xy[kept & bound].T, "o", color="#b2182b", markersize=3)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_title(f"{name}: {(kept & ~bound).sum()} of {kept.sum()} vertices are free", fontsize=9)
