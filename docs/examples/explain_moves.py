"""
The moves of the search
=======================

What one move changes on a terrain of 156 samples, above before, below after: only the samples in the coloured
triangles have to be looked at to know the exact change of the error.
"""

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np

from meshsimp_pymoo import LiveTriangulation, MeshProblem, thinning

problem = MeshProblem("jacksboro:31")
surface, points = problem.surface, problem.model.points
kept = thinning(surface).kept(24)
live = LiveTriangulation(surface, kept)
before, error = live.faces, live.error
inner = np.flatnonzero(kept & ~np.isin(np.arange(len(kept)), surface.border))
other = np.flatnonzero(~kept)


def without(vertex):
    """Return the faces once a vertex has gone."""
    return surface.triangles(kept & (np.arange(len(kept)) != vertex))


def flipped():
    """Return the faces with that edge flipped which lowers the error the most."""
    best = before
    for one, two in combinations(before.tolist(), 2):
        ends = sorted({*one} & {*two})
        if len(ends) == 2:
            (a,), (b,) = {*one} - {*ends}, {*two} - {*ends}
            (dx, dy), (ux, uy), (vx, vy) = (points[v, :2] - points[a, :2] for v in (b, *ends))
            left, right = dx * uy - dy * ux, dx * vy - dy * vx
            if left * right < 0:  # the four corners are convex
                p, q = ends if left > 0 else ends[::-1]
                rest = [face for face in before.tolist() if face not in (one, two)]
                tried = np.array([*rest, [a, b, p], [b, a, q]], dtype=np.int32)
                best = min(best, tried, key=lambda faces: surface.of_faces(faces).quality.error)
    return best


cheapest = min(inner, key=lambda v: live.try_remove(v)[0])
urgent = min(other, key=lambda v: live.try_insert(v)[0])
start, neighbours = surface.neighbours
near = [(v, w) for v in inner for w in neighbours[start[v] : start[v + 1]]]
old, new = min((pair for pair in near if not kept[pair[1]]), key=lambda pair: live.try_move(*pair)[0])
with_new = kept.copy()
with_new[urgent] = True
moved = kept.copy()
moved[[old, new]] = False, True
moves = {
    "a vertex is removed": without(cheapest),
    "a vertex is inserted": surface.triangles(with_new),
    "a vertex moves nearby": surface.triangles(moved),
    "an edge flips (free meshes)": flipped(),
}

figure, rows = plt.subplots(2, 4, figsize=(8.6, 5.2), layout="constrained")
for (name, after), above, below in zip(moves.items(), *rows, strict=True):
    triangles = [set(map(tuple, np.sort(faces, axis=1).tolist())) for faces in (before, after)]
    for k, (ax, faces) in enumerate(((above, before), (below, after))):
        changed = [tuple(sorted(face)) not in triangles[1 - k] for face in faces.tolist()]
        ax.tripcolor(*points[:, :2].T, faces, np.array(changed, float), cmap="Blues", vmin=0, vmax=2.2)
        ax.triplot(*points[:, :2].T, faces, color="0.45", linewidth=0.8)
        ax.plot(*points[:, :2].T, ".", color="0.55", markersize=2)
        ax.plot(*points[np.unique(faces), :2].T, "o", color="#2166ac", markersize=4)
        ax.set_aspect("equal")
        ax.set_axis_off()
    above.set_title(name, fontsize=9)
    change = surface.of_faces(after).quality.error / error - 1
    more = len(after) - len(before)
    count = f"{more:+d} triangle{'s' * (abs(more) > 1)}" if more else "as many triangles"
    below.set_title(f"{count}, error {change:+.1%}", fontsize=9)
