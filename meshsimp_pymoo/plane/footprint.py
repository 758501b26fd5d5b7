"""Where the original mesh is: whether a point of the plane lies inside its projection.

``footprint="model"`` asks this for the centroid of every triangle, thousands of times an evaluation. So the plane is
cut once into square cells: those that no outline edge crosses are inside or outside as a whole; only in the others are
the few faces that touch the cell asked.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.compiling.functions import entry, inner

OUTSIDE, INSIDE, MIXED = 0, 1, 2
# Cells there are at most.
MOST_CELLS = 2**26


class Footprint(NamedTuple):
    """The projection of a mesh, ready for :func:`inside`; cells are square, row by row from the origin.

    Attributes
    ----------
    side : int
        Cells along one side of the unit square; 0 where the projection is convex, so that all of the hull is inside.
    columns : int
        Cells in a row: rows and columns end beyond the mesh.
    state : (rows * columns,) uint8 array
        OUTSIDE, INSIDE or MIXED.
    start : (rows * columns + 1,) int32 array
        Where the faces of a MIXED cell begin in ``items``.
    items : (M,) int32 array
        Faces that touch the MIXED cells.
    faces : (T, 3) int32 array
        Vertex rows of the faces.
    """

    side: int
    columns: int
    state: np.ndarray
    start: np.ndarray
    items: np.ndarray
    faces: np.ndarray


@inner
def _left_of(xy: np.ndarray, a: int, b: int, x3: float, y3: float) -> float:
    """Which side of the line from a to b a third of (x3, y3) lies on: positive on the left, 0 on the line.

    Swapping a and b only swaps the sign. Three times the point is asked for, since a centroid on a grid is exact only
    so.
    """
    if a < b:
        return (3.0 * xy[2 * a] - x3) * (3.0 * xy[2 * b + 1] - y3) - (3.0 * xy[2 * a + 1] - y3) * (3.0 * xy[2 * b] - x3)
    return -((3.0 * xy[2 * b] - x3) * (3.0 * xy[2 * a + 1] - y3) - (3.0 * xy[2 * b + 1] - y3) * (3.0 * xy[2 * a] - x3))


@inner
def _in_face(xy: np.ndarray, faces: np.ndarray, f: int, x3: float, y3: float) -> bool:
    u = _left_of(xy, faces[f, 0], faces[f, 1], x3, y3)
    v = _left_of(xy, faces[f, 1], faces[f, 2], x3, y3)
    w = _left_of(xy, faces[f, 2], faces[f, 0], x3, y3)
    if u == 0.0 and v == 0.0 and w == 0.0:
        return False
    return (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0)


@inner
def _in_some_face(
    xy: np.ndarray, start: np.ndarray, items: np.ndarray, faces: np.ndarray, cell: int, x3: float, y3: float
) -> bool:
    for k in range(start[cell], start[cell + 1]):
        if _in_face(xy, faces, items[k], x3, y3):
            return True
    return False


@inner(inline=True)
def inside(
    xy: np.ndarray,
    side: int,
    columns: int,
    state: np.ndarray,
    start: np.ndarray,
    items: np.ndarray,
    faces: np.ndarray,
    x3: float,
    y3: float,
) -> bool:
    """Whether a third of (x3, y3), in the unit square, lies in the closed projection; ``xy``: the model's."""
    scale = side / 3.0
    cell = int(y3 * scale) * columns + int(x3 * scale)
    kind = state[cell]
    if kind == MIXED:
        return _in_some_face(xy, start, items, faces, cell, x3, y3)
    return kind == INSIDE


@inner
def _cell_span(low: float, high: float, side: int, count: int) -> tuple[int, int]:
    """First and last cell of ``count`` that [low, high] touches, with a margin for rounding."""
    margin = 1e-12
    first = min(max(int((low - margin) * side), 0), count - 1)
    last = min(max(int((high + margin) * side), 0), count - 1)
    return first, last


@inner
def _row_span(
    ax: float, ay: float, bx: float, by: float, row: int, side: int, rows: int, columns: int
) -> tuple[int, int]:
    """Columns that the segment a-b touches in a row of cells; the outermost rows reach to infinity."""
    low = min(ax, bx)
    high = max(ax, bx)
    if ay != by:
        y0 = row / side if row > 0 else -np.inf
        y1 = (row + 1) / side if row < rows - 1 else np.inf
        t0 = (y0 - ay) / (by - ay)
        t1 = (y1 - ay) / (by - ay)
        if t0 > t1:
            t0, t1 = t1, t0
        t0 = min(max(t0 - 1e-9, 0.0), 1.0)
        t1 = min(max(t1 + 1e-9, 0.0), 1.0)
        x0 = ax + t0 * (bx - ax)
        x1 = ax + t1 * (bx - ax)
        low = min(x0, x1)
        high = max(x0, x1)
    return _cell_span(low, high, side, columns)


@entry
def _mark_outline(xy: np.ndarray, edges: np.ndarray, side: int, columns: int, state: np.ndarray) -> None:
    rows = len(state) // columns
    for k in range(len(edges)):
        a = edges[k, 0]
        b = edges[k, 1]
        ax, ay, bx, by = xy[2 * a], xy[2 * a + 1], xy[2 * b], xy[2 * b + 1]
        first_row, last_row = _cell_span(min(ay, by), max(ay, by), side, rows)
        for row in range(first_row, last_row + 1):
            first, last = _row_span(ax, ay, bx, by, row, side, rows, columns)
            for column in range(first, last + 1):
                state[row * columns + column] = MIXED


@inner
def _apart(xy: np.ndarray, a: int, b: int, c: int, x: float, y: float, size: float) -> bool:
    """Whether a line along an edge of face (a, b, c) separates it from a cell; the cell is taken a little larger."""
    margin = 1e-3 * size
    x0, x1, y0, y1 = x - margin, x + size + margin, y - margin, y + size + margin
    turn = _left_of(xy, a, b, 3.0 * xy[2 * c], 3.0 * xy[2 * c + 1])
    for _ in range(3):
        corners = 0
        for px, py in ((x0, y0), (x1, y0), (x0, y1), (x1, y1)):
            corners += _left_of(xy, a, b, 3.0 * px, 3.0 * py) * turn < 0.0
        if corners == 4:
            return True
        a, b, c = b, c, a
    return False


@entry
def _face_cells(
    xy: np.ndarray,
    faces: np.ndarray,
    side: int,
    columns: int,
    state: np.ndarray,
    start: np.ndarray,
    items: np.ndarray,
    fill: bool,
) -> None:
    """Count (then list) the faces of each MIXED cell; set the cells whose centre a face holds INSIDE."""
    rows = len(state) // columns
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        low_y = min(xy[2 * a + 1], xy[2 * b + 1], xy[2 * c + 1])
        high_y = max(xy[2 * a + 1], xy[2 * b + 1], xy[2 * c + 1])
        first_row, last_row = _cell_span(low_y, high_y, side, rows)
        for row in range(first_row, last_row + 1):
            # The columns between the sides that pass through this row.
            first, last = columns, -1
            for u, v in ((a, b), (b, c), (c, a)):
                uy, vy = xy[2 * u + 1], xy[2 * v + 1]
                one, other = _cell_span(min(uy, vy), max(uy, vy), side, rows)
                if one <= row <= other:
                    one, other = _row_span(xy[2 * u], uy, xy[2 * v], vy, row, side, rows, columns)
                    first = min(first, one)
                    last = max(last, other)
            for column in range(first, last + 1):
                cell = row * columns + column
                if state[cell] == MIXED:
                    if _apart(xy, a, b, c, column / side, row / side, 1.0 / side):
                        continue
                    if fill:
                        items[start[cell]] = f
                    start[cell] += 1
                elif not fill and _in_face(xy, faces, f, 3.0 * (column + 0.5) / side, 3.0 * (row + 0.5) / side):
                    state[cell] = INSIDE


def make_footprint(xy: np.ndarray, faces: np.ndarray, outline: np.ndarray, *, convex: bool) -> Footprint:
    """Cut the plane into cells for :func:`inside`.

    Parameters
    ----------
    xy : (N, 2) float array
        Coordinates in the unit square.
    faces : (T, 3) int32 array
        The original mesh.
    outline : (E, 2) int array
        Edges that may bound the projection: border edges, and edges between faces of opposite orientation (folds).
    convex : bool
        Whether the projection is the convex hull of ``xy``; then nothing needs to be asked.

    Returns
    -------
    Footprint
    """
    none = np.zeros(0, np.int32)
    faces = np.ascontiguousarray(faces, np.int32)
    if convex:
        return Footprint(0, 0, np.zeros(0, np.uint8), none, none, faces)
    flat = np.ascontiguousarray(xy, float).ravel()
    # Two cells a face in the box of the mesh: fine enough that few cells are mixed and each of those has few faces, and
    # still small beside the model.
    width, height = np.maximum(xy.max(axis=0), 1.0 / MOST_CELLS)
    n_cells = min(2.0 * len(faces), MOST_CELLS)
    side = max(int(min(np.sqrt(n_cells / (width * height)), n_cells / max(width, height))), 8)
    columns, rows = (int(length * side) + 2 for length in (width, height))  # no rounding leads beyond the last one
    state = np.zeros(rows * columns, np.uint8)
    _mark_outline(flat, np.ascontiguousarray(outline, np.int64), side, columns, state)
    counts = np.zeros(len(state) + 1, np.int64)
    _face_cells(flat, faces, side, columns, state, counts, none, False)
    start = np.zeros(len(state) + 1, np.int64)
    np.cumsum(counts[:-1], out=start[1:])
    items = np.zeros(start[-1], np.int32)
    cursor = start.copy()
    _face_cells(flat, faces, side, columns, state, cursor, items, True)
    return Footprint(side, columns, state, start.astype(np.int32), items, faces)
