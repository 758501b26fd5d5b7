"""Edges in any order as chains: paths from one end or junction to the next, and loops."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import IntArray


def chains(edges: IntArray) -> list[IntArray]:
    """Join edges to chains that part where any other number than two of them meet.

    Parameters
    ----------
    edges : (E, 2) int array
        The vertices that each edge joins, in any order and direction. One that is there again, or joins a vertex with
        itself, adds nothing.

    Returns
    -------
    list of (m,) int array
        The vertices of each chain, in order: paths by the first of their ends, then loops, which end where they begin,
        by their least vertex.

    Examples
    --------
    Three edges that meet at vertex 1, one of which goes on, and a triangle:

    >>> [chain.tolist() for chain in chains(np.array([[1, 0], [2, 1], [1, 3], [4, 3], [5, 6], [7, 6], [5, 7]]))]
    [[0, 1], [1, 2], [1, 3, 4], [5, 6, 7, 5]]
    """
    ends = np.sort(np.asarray(edges, np.int64).reshape(-1, 2), axis=1)
    ends = np.unique(ends[ends[:, 0] != ends[:, 1]], axis=0)
    vertices, place = np.unique(ends, return_inverse=True)
    place = place.reshape(-1, 2)
    degree = np.bincount(place.ravel(), minlength=len(vertices))
    around: list[list[tuple[int, int]]] = [[] for _ in vertices]  # of each vertex: another one, and the edge to it
    for k, (a, b) in enumerate(place.tolist()):
        around[a].append((b, k))
        around[b].append((a, k))
    walked = np.zeros(len(place), bool)
    found: list[IntArray] = []

    def walk(start: int, to: int, edge: int) -> None:
        path = [start, to]
        walked[edge] = True
        while degree[path[-1]] == 2 and path[-1] != start:
            other, edge = next((other, edge) for other, edge in around[path[-1]] if not walked[edge])
            walked[edge] = True
            path.append(other)
        found.append(vertices[path])

    for begins in (np.flatnonzero(degree != 2), np.flatnonzero(degree == 2)):
        for start in begins.tolist():
            for other, edge in around[start]:
                if not walked[edge]:
                    walk(start, other, edge)
    return found
