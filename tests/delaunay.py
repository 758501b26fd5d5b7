"""Slow twins: exact rational predicates, and the triangulation of one subset with its laws checked by them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD, triangulate_once


def rational(xy):
    return [(Fraction(float(x)), Fraction(float(y))) for x, y in np.asarray(xy)]


def orient(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def in_circle(a, b, c, p):
    """Positive if p lies inside the circle through a, b, c (counter-clockwise)."""
    rows = [(q[0] - p[0], q[1] - p[1]) for q in (a, b, c)]
    lift = [x * x + y * y for x, y in rows]
    (ax, ay), (bx, by), (cx, cy) = rows
    return lift[0] * (bx * cy - cx * by) + lift[1] * (cx * ay - ax * cy) + lift[2] * (ax * by - bx * ay)


def faces_of(xy, *, first=(-1,), order=(), exact=True):
    """Triangles of distinct points in storage order, the least vertex first, sorted; by the compiled kernel."""
    xy = np.ascontiguousarray(xy, float)
    n = len(xy)
    mesh = np.empty(16 * max(n, 4), np.uint32)
    ranges = exact_ranges(xy) if exact else (0.0, 0.0)
    end = triangulate_once(
        xy.ravel(),
        n,
        np.asarray(first, np.int64),
        np.asarray(order, np.int64),
        np.empty(n, np.uint8),
        mesh,
        *ranges,
    )
    assert end in (0, RECORD * (2 * n - 2))
    records = mesh[:end].reshape(-1, RECORD)[:, :3]
    return canonical(records[(records <= LAST_INDEX).all(axis=1)].astype(np.int64))


def canonical(faces):
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    turn = faces.argmin(axis=1)
    rows = np.arange(len(faces))
    faces = np.stack([faces[rows, (turn + k) % 3] for k in range(3)], axis=1)
    return faces[np.lexsort(faces.T[::-1])]


def assert_delaunay(xy, faces):
    """Check the whole definition in rational arithmetic: positive areas, hull covered, empty circles, the tie rule."""
    points = rational(xy)
    edges = {}
    area = Fraction(0)
    for a, b, c in faces.tolist():
        double = orient(points[a], points[b], points[c])
        assert double > 0
        area += double
        for u, v, w in ((a, b, c), (b, c, a), (c, a, b)):
            assert (u, v) not in edges, "an edge is used twice in one direction"
            edges[u, v] = w
    assert area == hull_area(points)
    for (u, v), w in edges.items():
        p = edges.get((v, u))
        if p is None or u > v:
            continue
        sign = in_circle(points[u], points[v], points[w], points[p])
        assert sign <= 0, "a neighbour's vertex lies inside the circle"
        if sign == 0:
            assert max(w, p) > max(u, v), "of four cocircular points the one with the largest index is cut off"


def hull_area(points):
    """Twice the area of the convex hull (Andrew's monotone chain)."""
    ordered = sorted(set(points))

    def chain(items):
        out = []
        for p in items:
            while len(out) > 1 and orient(out[-2], out[-1], p) <= 0:
                out.pop()
            out.append(p)
        return out[:-1]

    hull = chain(ordered) + chain(ordered[::-1])
    return sum((orient(hull[0], hull[k], hull[k + 1]) for k in range(1, len(hull) - 1)), Fraction(0))
