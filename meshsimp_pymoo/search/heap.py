"""A heap of things that have two keys and a number each, the least first.

``heap`` (n,) has the numbers of the things in it, in the order of a heap; ``at[v]`` is the place of thing v in it, and
``key[2 * v]`` and ``key[2 * v + 1]`` are its keys. What is not in the heap has -1 in ``at``: that is the caller's.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner


@inner(inline=True)
def _before(key: np.ndarray, a: int, b: int) -> bool:
    """Order of the heap: by both keys, then by index, so that ties do not depend on history."""
    if key[2 * a] != key[2 * b]:
        return key[2 * a] < key[2 * b]
    if key[2 * a + 1] != key[2 * b + 1]:
        return key[2 * a + 1] < key[2 * b + 1]
    return a < b


@inner
def sift_up(heap: np.ndarray, at: np.ndarray, key: np.ndarray, k: int) -> None:
    """Move what is at place k up to where it belongs."""
    v = heap[k]
    while k > 0:
        parent = (k - 1) >> 1
        if not _before(key, v, heap[parent]):
            break
        heap[k] = heap[parent]
        at[heap[k]] = k
        k = parent
    heap[k] = v
    at[v] = k


@inner
def sift_down(heap: np.ndarray, at: np.ndarray, key: np.ndarray, k: int, n: int) -> None:
    """Move what is at place k of n down to where it belongs."""
    v = heap[k]
    while True:
        child = 2 * k + 1
        if child >= n:
            break
        if child + 1 < n and _before(key, heap[child + 1], heap[child]):
            child += 1
        if not _before(key, heap[child], v):
            break
        heap[k] = heap[child]
        at[heap[k]] = k
        k = child
    heap[k] = v
    at[v] = k


@inner
def make_heap(heap: np.ndarray, at: np.ndarray, key: np.ndarray, n: int) -> None:
    """Make a heap of n things in any order."""
    for k in range(n // 2 - 1, -1, -1):
        sift_down(heap, at, key, k, n)
