"""The point of a mesh's outline nearest in the plane: exact, through a tree of boxes over its segments.

The segments are listed along the surface, so consecutive ones are close to each other, and a complete binary tree over
runs of ``LEAF`` of them has small boxes. It takes no more than the order of the segments to build, whatever their
lengths.
"""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner

# Segments in one leaf.
LEAF = 4
# What rounding may add to a distance in the unit square, of a point to a segment inside a box.
ROUNDING = 1e-15
# Nodes that a search has still to visit are at most so many: one for each level of the tree, and one.
DEEPEST = 64


def boxes_of_runs(xy: np.ndarray, run: int) -> np.ndarray:
    """Return the boxes of a tree over runs of points that lie along a curve.

    Parameters
    ----------
    xy : (N, 2) float array
        The points.
    run : int
        Points in one leaf.

    Returns
    -------
    (2 L, 4) float array
        Lowest and highest x, then y, of each of L = ceil(N / run) leaves, the last L rows, and of what is above them:
        row 1 is the root, the children of k are 2 k and 2 k + 1.

    Examples
    --------
    >>> boxes_of_runs(np.array([[0.0, 0.5], [0.25, 0.5], [1.0, 0.0]]), 2)[1:].tolist()
    [[0.0, 1.0, 0.0, 0.5], [0.0, 0.25, 0.5, 0.5], [1.0, 1.0, 0.0, 0.0]]
    """
    starts = np.arange(0, len(xy), run)
    n_leaves = len(starts)
    boxes = np.zeros((2 * n_leaves, 4))
    for axis in (0, 1):
        for side, extreme in ((0, np.minimum), (1, np.maximum)):
            column = boxes[:, 2 * axis + side]
            column[n_leaves:] = extreme.reduceat(xy[:, axis], starts)
            end = n_leaves
            while end > 1:  # those whose children are known
                first = (end + 1) // 2
                children = column[2 * first : 2 * end].reshape(-1, 2)
                column[first:end] = extreme(children[:, 0], children[:, 1])
                end = first
    return boxes


@inner
def touches_box(boxes: np.ndarray, node: int, ax: float, ay: float, bx: float, by: float, reach: float) -> bool:
    """Whether the segment a-b comes as near as ``reach`` to a node's box; now and then also where it is farther."""
    low_x, high_x, low_y, high_y = boxes[node, 0], boxes[node, 1], boxes[node, 2], boxes[node, 3]
    if max(ax, bx) < low_x - reach or min(ax, bx) > high_x + reach:
        return False
    if max(ay, by) < low_y - reach or min(ay, by) > high_y + reach:
        return False
    ux = bx - ax
    uy = by - ay
    away = abs(ux * (0.5 * (low_y + high_y) - ay) - uy * (0.5 * (low_x + high_x) - ax))
    size = abs(ux) * (0.5 * (high_y - low_y) + reach) + abs(uy) * (0.5 * (high_x - low_x) + reach)
    return away <= size * (1.0 + 1e-9) + 1e-15


@inner
def next_leaf(
    boxes: np.ndarray, stack: np.ndarray, depth: int, ax: float, ay: float, bx: float, by: float, reach: float
) -> tuple[int, int]:
    """Return a leaf whose box the segment a-b comes near, as `touches_box` has it, and what is left to visit.

    Begin with the root, 1, as the one node in ``stack``, which has room for ``DEEPEST``; the leaf is -1 at the end.
    """
    n_leaves = len(boxes) // 2
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if not touches_box(boxes, node, ax, ay, bx, by, reach):
            continue
        if node >= n_leaves:
            return node - n_leaves, depth
        stack[depth] = 2 * node
        stack[depth + 1] = 2 * node + 1
        depth += 2
    return -1, 0


@inner
def build_tree(xy: np.ndarray, ends: np.ndarray, m: int) -> np.ndarray:
    """Return the boxes of a tree over ``m`` segments, listed so that neighbours are close.

    Parameters
    ----------
    xy : (2 n,) float array
        Coordinates x0, y0, x1, ...
    ends : (m, 2) or wider int array
        Segments, as rows of ``xy``.
    m : int
        Number of segments; at least 1.

    Returns
    -------
    (2 L, 4) float array
        Lowest and highest x, then y, of each node; node 1 is the root, the children of k are 2 k and 2 k + 1, and the
        last L nodes are the leaves, each over ``LEAF`` segments.
    """
    n_leaves = 1
    while n_leaves * LEAF < m:
        n_leaves *= 2
    boxes = np.empty((2 * n_leaves, 4))
    for leaf in range(n_leaves):
        low_x = low_y = np.inf
        high_x = high_y = -np.inf
        for k in range(leaf * LEAF, min(leaf * LEAF + LEAF, m)):
            for e in range(2):
                x = xy[2 * ends[k, e]]
                y = xy[2 * ends[k, e] + 1]
                low_x = min(low_x, x)
                high_x = max(high_x, x)
                low_y = min(low_y, y)
                high_y = max(high_y, y)
        node = n_leaves + leaf
        boxes[node, 0] = low_x
        boxes[node, 1] = high_x
        boxes[node, 2] = low_y
        boxes[node, 3] = high_y
    for node in range(n_leaves - 1, 0, -1):
        for k in (0, 2):
            boxes[node, k] = min(boxes[2 * node, k], boxes[2 * node + 1, k])
            boxes[node, k + 1] = max(boxes[2 * node, k + 1], boxes[2 * node + 1, k + 1])
    return boxes


@inner(inline=True)
def _to_segment(xy: np.ndarray, a: int, b: int, x: float, y: float) -> tuple[float, float]:
    """Squared distance from (x, y) to the segment a-b and the parameter of its nearest point."""
    ax = xy[2 * a]
    ay = xy[2 * a + 1]
    ex = xy[2 * b] - ax
    ey = xy[2 * b + 1] - ay
    length = ex * ex + ey * ey
    t = ((x - ax) * ex + (y - ay) * ey) / length if length > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    dx = ax + t * ex - x
    dy = ay + t * ey - y
    return dx * dx + dy * dy, t


@inner(inline=True)
def to_box(boxes: np.ndarray, node: int, x: float, y: float) -> float:
    """Squared distance from (x, y) to a node's box; a little less, so that rounding hides no segment."""
    dx = max(boxes[node, 0] - x, 0.0, x - boxes[node, 1])
    dy = max(boxes[node, 2] - y, 0.0, y - boxes[node, 3])
    dx = max(dx - ROUNDING, 0.0)
    dy = max(dy - ROUNDING, 0.0)
    return (dx * dx + dy * dy) * (1.0 - 1e-9)


@inner(inline=True)
def between_boxes(boxes: np.ndarray, node: int, low_x: float, high_x: float, low_y: float, high_y: float) -> float:
    """Squared distance from a node's box to another box; a little less."""
    dx = max(max(boxes[node, 0] - high_x, low_x - boxes[node, 1]) - ROUNDING, 0.0)
    dy = max(max(boxes[node, 2] - high_y, low_y - boxes[node, 3]) - ROUNDING, 0.0)
    return (dx * dx + dy * dy) * (1.0 - 1e-9)


@inner(inline=True)
def nearest_segment(
    xy: np.ndarray,
    ends: np.ndarray,
    key: np.ndarray,
    m: int,
    boxes: np.ndarray,
    stack: np.ndarray,
    x: float,
    y: float,
    guess: int,
) -> tuple[int, float, float]:
    """Return the segment nearest to (x, y), the parameter of its nearest point and the squared distance.

    Of segments at the same distance the one with the least ``key`` is returned, whatever the order of search. ``guess``
    is any segment (a near one spares work); ``stack`` has room for 64 nodes.
    """
    best = guess
    best_d, best_t = _to_segment(xy, ends[guess, 0], ends[guess, 1], x, y)
    n_leaves = len(boxes) // 2
    stack[0] = 1
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if to_box(boxes, node, x, y) > best_d:
            continue
        if node >= n_leaves:
            first = (node - n_leaves) * LEAF
            for k in range(first, min(first + LEAF, m)):
                if k == best:
                    continue
                d, t = _to_segment(xy, ends[k, 0], ends[k, 1], x, y)
                if d < best_d or (d == best_d and key[k] < key[best]):
                    best, best_d, best_t = k, d, t
            continue
        # The nearer child on top.
        near = 2 * node
        far = near + 1
        if to_box(boxes, far, x, y) < to_box(boxes, near, x, y):
            near, far = far, near
        stack[depth] = far
        stack[depth + 1] = near
        depth += 2
    return best, best_t, best_d
