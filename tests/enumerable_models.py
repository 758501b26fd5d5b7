"""Open models so small that their whole front is known: every subset of their free vertices is evaluated."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.formats.source import SourceMesh

# 512 subsets at most.
MOST_FREE = 9
# Enough for a search to find the whole front of such a model.
GENERATIONS = 40


def random_source(seed):
    """Return a rectangle with 3 to 9 vertices at random places in it, all heights random; its corners are pinned."""
    rng = np.random.default_rng(seed)
    n_free = int(rng.integers(3, MOST_FREE, endpoint=True))
    width, depth = rng.uniform(0.5, 2.0, 2)
    corners = [(0.0, 0.0), (width, 0.0), (0.0, depth), (width, depth)]
    xy = np.concatenate([corners, rng.random((n_free, 2)) * (width, depth)])
    faces = Delaunay(xy).simplices.astype(np.int64)
    return SourceMesh(np.c_[xy, rng.random(len(xy))], faces, {}, name=f"random model {seed}", up="z")


def random_problem(seed):
    """Return the problem of simplifying it."""
    return MeshProblem(random_source(seed))


def true_front(problem):
    """Return the front (F, 2) of all subsets, by triangles; every one of them is evaluated."""
    free = np.flatnonzero(~problem.pinned)
    bits = np.arange(2 ** len(free))[:, None] >> np.arange(len(free)) & 1
    X = np.tile(problem.pinned, (len(bits), 1))
    X[:, free] = bits == 1
    return nondominated(problem.evaluate(X))


def nondominated(F):
    """Return the rows of F that no other row dominates, each once, by triangles."""
    F = np.unique(F, axis=0)
    F = F[np.lexsort((F[:, 0], F[:, 1]))]
    less = np.minimum.accumulate(F[:, 0])
    return F[np.r_[True, F[1:, 0] < less[:-1]]]


def same_front(F, G, tolerance=1e-12):
    """Return whether two fronts have the same points."""
    F, G = nondominated(F), nondominated(G)
    return F.shape == G.shape and np.allclose(F, G, rtol=tolerance, atol=0.0)
