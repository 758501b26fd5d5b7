"""Models with lines drawn at random between their vertices, and the constrained triangulation from first principles."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from delaunay import canonical, hull_area, in_circle, orient

from meshsimp_pymoo.surface.lines import ModelLines


def with_segments(model, segments):
    """Return a model whose lines are these pairs of vertices."""
    chains = tuple(np.asarray(pair, np.int64) for pair in segments)
    lines = ModelLines(
        tuple(model.points[chain] for chain in chains), chains, ("",) * len(chains), 0.0, np.empty(0, int)
    )
    return dataclasses.replace(model, lines=lines)


def whole_numbers(xy):
    """The vertices (N, 2) of a model in units of 2**-52, for exact arithmetic."""
    return [(int(x), int(y)) for x, y in np.asarray(xy) * 2.0**52]


def cross(points, one, two):
    """Whether two segments share an inner point at which they do not lie on each other."""
    a, b = (points[i] for i in one)
    c, d = (points[i] for i in two)
    return orient(a, b, c) * orient(a, b, d) < 0 and orient(c, d, a) * orient(c, d, b) < 0


def random_segments(xy, rng, most, *, among=None):
    """Return up to so many segments between vertices (N, 2) at different places that do not cross.

    Where one goes through a vertex, others may end there or leave it on either side, but go through it only along it.
    """
    points = whole_numbers(xy)
    among = np.arange(len(xy)) if among is None else among
    found = []
    for _ in range(6 * most):
        a, b = (int(i) for i in rng.choice(among, 2, replace=False))
        if points[a] == points[b] or len(found) == most:
            continue
        if not any(cross(points, (a, b), other) for other in found):
            found.append((a, b))
    # two may cross at a vertex within both: all are cut at the vertices in which they meet
    ends = sorted({i for pair in found for i in pair})
    return [piece for a, b in found for piece in itertools.pairwise(_along(points, a, b, ends))], found


def _along(points, a, b, rows):
    """Return those of the vertices that lie on a segment, from one end to the other."""
    axis = 0 if points[a][0] != points[b][0] else 1
    on = [i for i in rows if on_segment(points, a, b, i)]
    return sorted(on, key=lambda i: abs(points[i][axis] - points[a][axis]))


def on_segment(points, a, b, i):
    return orient(points[a], points[b], points[i]) == 0 and all(
        min(points[a][k], points[b][k]) <= points[i][k] <= max(points[a][k], points[b][k]) for k in (0, 1)
    )


def forced_edges(xy, segments, sites):
    """Return the forced edges between sites: neighbours along each segment."""
    points = whole_numbers(xy)
    found = set()
    for a, b in segments:
        found |= {tuple(sorted(pair)) for pair in itertools.pairwise(_along(points, a, b, sites))}
    return found


def constrained_faces(xy, segments, sites):
    """Return the constrained Delaunay triangles of sites (rows of ``xy``), slowly, in exact arithmetic.

    All edges that cross no edge before, the forced ones first, make a triangulation; its edges flip until all but the
    forced ones are locally Delaunay.
    """
    points = whole_numbers(xy)
    forced = forced_edges(xy, segments, sites)
    edges = set(forced)
    for pair in itertools.combinations(sites, 2):
        if any(i not in pair and on_segment(points, *pair, i) for i in sites):
            continue
        if not any(cross(points, pair, other) for other in edges):
            edges.add(pair)
    around = {i: {j for pair in edges if i in pair for j in pair} - {i} for i in sites}
    faces = set()
    for a, b in edges:
        for c in around[a] & around[b]:
            corners = (a, b, c) if orient(points[a], points[b], points[c]) > 0 else (b, a, c)
            if orient(*(points[i] for i in corners)) != 0 and not any(
                i not in corners and _inside(points, corners, i) for i in sites
            ):
                k = corners.index(min(corners))
                faces.add(corners[k:] + corners[:k])
    faces = _flipped(points, faces, forced)
    assert sum(orient(*(points[i] for i in face)) for face in faces) == hull_area([points[i] for i in sites])
    return canonical(sorted(faces))


def _inside(points, corners, i):
    return all(orient(points[corners[k]], points[corners[(k + 1) % 3]], points[i]) >= 0 for k in range(3))


def _flipped(points, faces, forced):
    apex = {}
    for a, b, c in faces:
        apex |= {(a, b): c, (b, c): a, (c, a): b}
    stack = [pair for pair in apex if pair[::-1] in apex]
    while stack:
        u, v = stack.pop()
        if (u, v) not in apex or (v, u) not in apex or tuple(sorted((u, v))) in forced:
            continue
        w, p = apex[u, v], apex[v, u]
        if not _in_conflict(points, u, v, w, p):
            continue
        del apex[u, v], apex[v, u]
        apex |= {(w, p): v, (p, v): w, (v, w): p, (p, w): u, (w, u): p, (u, p): w}
        stack += [(p, v), (v, w), (w, u), (u, p)]
    return {min((a, b, c), (b, c, a), (c, a, b)) for (a, b), c in apex.items()}


def _in_conflict(points, u, v, w, p):
    sign = in_circle(points[u], points[v], points[w], points[p])
    return sign > 0 or (sign == 0 and max(u, v) > max(w, p))


def assert_constrained_delaunay(xy, faces, segments, sites):
    """Check the definition in exact arithmetic: hull covered, forced edges there, others locally Delaunay."""
    points = whole_numbers(xy)
    forced = forced_edges(xy, segments, sites)
    apex = {}
    for a, b, c in faces.tolist():
        assert orient(points[a], points[b], points[c]) > 0
        for u, v, w in ((a, b, c), (b, c, a), (c, a, b)):
            assert (u, v) not in apex, "an edge is used twice in one direction"
            apex[u, v] = w
    assert sum(orient(*(points[i] for i in face)) for face in faces.tolist()) == hull_area([points[i] for i in sites])
    assert forced <= {tuple(sorted(pair)) for pair in apex}
    for (u, v), w in apex.items():
        p = apex.get((v, u))
        if p is not None and tuple(sorted((u, v))) not in forced:
            assert not _in_conflict(points, u, v, w, p)
