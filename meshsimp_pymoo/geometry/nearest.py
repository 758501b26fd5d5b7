"""The point of a mesh's outline nearest in the plane: exact, through a grid of cells over its segments."""

from __future__ import annotations

import numpy as np
from numba import njit

from meshsimp_pymoo.geometry.footprint import _cell_span, _row_span


@njit(cache=True, nogil=True)
def _visit_cells(xy: np.ndarray, ends: np.ndarray, m: int, side: int, start: np.ndarray, items: np.ndarray) -> None:
    fill = len(items) > 0
    for k in range(m):
        a = ends[k, 0]
        b = ends[k, 1]
        ax, ay, bx, by = xy[2 * a], xy[2 * a + 1], xy[2 * b], xy[2 * b + 1]
        first_row, last_row = _cell_span(min(ay, by), max(ay, by), side)
        for row in range(first_row, last_row + 1):
            first, last = _row_span(ax, ay, bx, by, row, side)
            for column in range(first, last + 1):
                cell = row * side + column
                if fill:
                    items[start[cell]] = k
                start[cell] += 1


@njit(cache=True, nogil=True)
def build_grid(xy: np.ndarray, ends: np.ndarray, m: int, side: int, start: np.ndarray) -> np.ndarray:
    """List, for each cell of the unit square, the segments that pass through it.

    Parameters
    ----------
    xy : (2 n,) float array
        Coordinates x0, y0, x1, ...; what lies outside the unit square is listed in the outermost cells.
    ends : (m, 2) int array
        Segments, as rows of ``xy``.
    m : int
        Number of segments; at least 1.
    side : int
        Cells along one side.
    start : (side * side + 1,) int array
        Receives where each cell's segments begin.

    Returns
    -------
    (M,) int32 array
        The segments, cell by cell.
    """
    n_cells = side * side
    for k in range(n_cells + 1):
        start[k] = 0
    _visit_cells(xy, ends, m, side, start, np.empty(0, np.int32))
    total = 0
    for k in range(n_cells + 1):
        count = start[k]
        start[k] = total
        total += count
    items = np.empty(total, np.int32)
    _visit_cells(xy, ends, m, side, start, items)
    for k in range(n_cells, 0, -1):
        start[k] = start[k - 1]
    start[0] = 0
    return items


@njit(cache=True, nogil=True, forceinline=True)
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


@njit(cache=True, nogil=True, forceinline=True)
def nearest_segment(
    xy: np.ndarray,
    ends: np.ndarray,
    key: np.ndarray,
    side: int,
    start: np.ndarray,
    items: np.ndarray,
    x: float,
    y: float,
    guess: int,
) -> tuple[int, float, float]:
    """Return the segment nearest to (x, y), the parameter of its nearest point and the squared distance.

    Of segments at the same distance the one with the least ``key`` is returned, whatever the order of search. ``guess``
    is any segment (a near one spares work).
    """
    best = guess
    best_d, best_t = _to_segment(xy, ends[guess, 0], ends[guess, 1], x, y)
    column = min(max(int(x * side), 0), side - 1)
    row = min(max(int(y * side), 0), side - 1)
    for ring in range(side + 1):
        for i in range(max(row - ring, 0), min(row + ring, side - 1) + 1):
            step = 1 if abs(i - row) == ring else max(2 * ring, 1)
            for j in range(column - ring, column + ring + 1, step):
                if j < 0 or j >= side:
                    continue
                cell = i * side + j
                for q in range(start[cell], start[cell + 1]):
                    k = items[q]
                    if k == best:
                        continue
                    d, t = _to_segment(xy, ends[k, 0], ends[k, 1], x, y)
                    if d < best_d or (d == best_d and key[k] < key[best]):
                        best, best_d, best_t = k, d, t
        # Whatever has not been looked at lies beyond the block of cells seen so far.
        reach = np.inf
        if column - ring > 0:
            reach = min(reach, x - (column - ring) / side)
        if column + ring < side - 1:
            reach = min(reach, (column + ring + 1) / side - x)
        if row - ring > 0:
            reach = min(reach, y - (row - ring) / side)
        if row + ring < side - 1:
            reach = min(reach, (row + ring + 1) / side - y)
        if reach == np.inf or (reach > 0.0 and best_d < reach * reach * (1 - 1e-9)):
            break
    return best, best_t, best_d
