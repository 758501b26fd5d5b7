"""Clouds of points, and what is compared of their triangles."""

from __future__ import annotations

import numpy as np

UTM = np.array([412_345.125, 5_654_321.5, 120.0])


def scattered(n=400, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.random((n, 2)) * 50, rng.random(n) * 4]) + UTM


def as_sets(faces):
    return {frozenset(face) for face in np.asarray(faces).tolist()}


def areas(source):
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
