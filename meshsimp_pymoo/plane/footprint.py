"""Where the original mesh is: whether a point of the plane lies inside its projection.

``footprint="model"`` asks this for the centroid of every triangle, thousands of times an evaluation. So the plane is
cut once into square cells: those that no outline edge crosses are inside or outside as a whole; only in the others are
the few faces that touch the cell asked.

The samples of a height grid with gaps are crossings of rows and columns, and its faces follow from which of them are
there: two to a cell with four samples, one to a cell with three. So a bit a sample is all that is asked for there.

The images of a closed surface fill the plane but for its holes, and are thousands of times denser here than there, so
that no cells fit all of it: whether a point lies in a hole is whether a ray from it crosses the rims an odd number of
times, and a tree of boxes over the edges of the rims says which ones to ask.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.nearest import boxes_of_runs

OUTSIDE, INSIDE, MIXED = 0, 1, 2
# How far from three times a point rounding may put the sum of three corners.
TOUCH = 4e-15
# Cells there are at most.
MOST_CELLS = 2**26
# Edges of rims in one leaf of the tree over them.
RIM_LEAF = 4


class Footprint(NamedTuple):
    """The projection of a mesh, ready for :func:`inside`; cells are square, row by row from the origin.

    Attributes
    ----------
    side : int
        Cells along one side of the unit square; 0 where the projection is convex, so that all of the hull is inside.
        Of a lattice, and of rims, 1.
    columns : int
        Cells in a row: rows and columns end beyond the mesh. Of a lattice the bytes in a row of bits.
    state : (rows * columns,) uint8 array
        OUTSIDE, INSIDE or MIXED. Of a lattice which samples there are: column k is bit k % 8 of byte k // 8 of its row.
    start : (rows * columns + 1,) int32 array
        Where the faces of a MIXED cell begin in ``items``.
    items : (M,) int32 array
        Faces that touch the MIXED cells.
    faces : (T, 3) int32 array
        Vertex rows of the faces.
    x, y : (C,), (R,) float arrays
        Where the columns of a lattice are, ascending, and its rows, descending; empty where faces are listed.
    rim : (E, 2) int32 array
        Edges of the rims of holes, in any direction, those near each other listed so; empty elsewhere.
    boxes : (2 L, 4) float array
        Of the tree over runs of ``RIM_LEAF`` of them, as of :func:`~meshsimp_pymoo.plane.nearest.boxes_of_runs`.
    """

    side: int
    columns: int
    state: np.ndarray
    start: np.ndarray
    items: np.ndarray
    faces: np.ndarray
    x: np.ndarray
    y: np.ndarray
    rim: np.ndarray
    boxes: np.ndarray


NO_CELLS = np.zeros(0, np.int32)
NO_RIM, NO_BOXES = np.empty((0, 2), np.int32), np.empty((0, 4))


def rim_footprint(xy: np.ndarray, rim: np.ndarray) -> Footprint:
    """Return all of the plane but what lies within closed rims.

    Parameters
    ----------
    xy : (N, 2) float array
        Coordinates in the unit square.
    rim : (E, 2) int array
        The edges of the rims, those near each other listed so. Every vertex ends an even number of them.
    """
    rim = np.ascontiguousarray(rim, np.int32)
    leaves = boxes_of_runs(xy[rim.ravel()], 2 * RIM_LEAF)
    # two columns and rows of cells: the unit square and what is beyond
    state = np.zeros(4, np.uint8)
    return Footprint(1, 2, state, NO_CELLS, NO_CELLS, NO_CELLS.reshape(0, 3), np.empty(0), np.empty(0), rim, leaves)


def lattice_footprint(bits: np.ndarray, x: np.ndarray, y: np.ndarray) -> Footprint:
    """Return the projection of a height grid with gaps.

    Parameters
    ----------
    bits : (R, B) uint8 array
        Which samples belong to its faces, packed from the lowest bit on; B >= C / 8.
    x, y : (C,), (R,) float arrays
        Where its columns are, ascending, and its rows, descending, in the unit square.
    """
    state = np.ascontiguousarray(bits).ravel()
    at = np.array(x, float), np.array(y, float)
    no_faces = NO_CELLS.reshape(0, 3)
    return Footprint(1, bits.shape[1], state, NO_CELLS, NO_CELLS, no_faces, *at, NO_RIM, NO_BOXES)


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
def inside(xy: np.ndarray, footprint: Footprint, x3: float, y3: float) -> bool:
    """Whether a third of (x3, y3), in the unit square, lies in the closed projection; ``xy``: the model's."""
    if len(footprint.x) > 0:
        return _in_lattice(footprint.state, footprint.columns, footprint.x, footprint.y, x3, y3)
    if len(footprint.rim) > 0:
        return not _within(xy, footprint.rim, footprint.boxes, x3, y3)
    scale = footprint.side / 3.0
    cell = int(y3 * scale) * footprint.columns + int(x3 * scale)
    kind = footprint.state[cell]
    if kind == MIXED:
        return _in_some_face(xy, footprint.start, footprint.items, footprint.faces, cell, x3, y3)
    return kind == INSIDE


@inner
def _within(xy: np.ndarray, rim: np.ndarray, boxes: np.ndarray, x3: float, y3: float) -> bool:
    """Whether a ray from a third of (x3, y3) along x crosses closed rims an odd number of times."""
    n_leaves = len(boxes) // 2
    odd = False
    node = 1
    while node > 0:
        if 3.0 * boxes[node, 2] <= y3 and y3 <= 3.0 * boxes[node, 3] and x3 <= 3.0 * boxes[node, 1]:
            if node < n_leaves:
                node *= 2
                continue
            first = (node - n_leaves) * RIM_LEAF
            for k in range(first, min(first + RIM_LEAF, len(rim))):
                a, b = rim[k, 0], rim[k, 1]
                rises = 3.0 * xy[2 * a + 1] <= y3
                if rises != (3.0 * xy[2 * b + 1] <= y3):
                    side = _left_of(xy, a, b, x3, y3)
                    odd ^= side > 0.0 if rises else side < 0.0
        while node & 1:  # the right one of two: done with what is above it
            node >>= 1
        node += node > 0
    return odd


@inner
def _step_of(places: np.ndarray, sign: float, place3: float) -> int:
    """Return the last but one, at most, of the ascending ``sign * places`` that is not above a third of place3."""
    low = 0
    high = len(places) - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if 3.0 * sign * places[middle] <= place3:
            low = middle
        else:
            high = middle
    return low


@inner
def is_there(bits: np.ndarray, columns: int, i: int, j: int) -> bool:
    """Whether there is a sample in row i and column j."""
    return ((bits[i * columns + (j >> 3)] >> (j & 7)) & 1) != 0


@inner
def _holds(ax: float, ay: float, bx: float, by: float, cx: float, cy: float, x3: float, y3: float) -> bool:
    """Do what :func:`_in_face` does, of a triangle by its corners."""
    ax, ay = 3.0 * ax - x3, 3.0 * ay - y3
    bx, by = 3.0 * bx - x3, 3.0 * by - y3
    cx, cy = 3.0 * cx - x3, 3.0 * cy - y3
    u = ax * by - ay * bx
    v = bx * cy - by * cx
    w = cx * ay - cy * ax
    return (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0)


@inner
def _in_lattice(bits: np.ndarray, columns: int, x: np.ndarray, y: np.ndarray, x3: float, y3: float) -> bool:
    """Whether a third of (x3, y3) lies in a face of a lattice: the cell is looked up, and those that it may touch."""
    row = _step_of(y, -1.0, -y3)
    column = _step_of(x, 1.0, x3)
    for i in range(max(row - 1, 0), min(row + 2, len(y) - 1)):
        if y3 > 3.0 * y[i] + TOUCH or y3 < 3.0 * y[i + 1] - TOUCH:
            continue
        for j in range(max(column - 1, 0), min(column + 2, len(x) - 1)):
            if x3 < 3.0 * x[j] - TOUCH or x3 > 3.0 * x[j + 1] + TOUCH:
                continue
            nw = is_there(bits, columns, i, j)
            ne = is_there(bits, columns, i, j + 1)
            sw = is_there(bits, columns, i + 1, j)
            se = is_there(bits, columns, i + 1, j + 1)
            west, east, north, south = x[j], x[j + 1], y[i], y[i + 1]
            # as heights.grid_mesh cuts them
            if nw and se:
                if sw and _holds(west, north, west, south, east, south, x3, y3):
                    return True
                if ne and _holds(west, north, east, south, east, north, x3, y3):
                    return True
            elif sw and ne:
                if se and _holds(west, south, east, south, east, north, x3, y3):
                    return True
                if nw and _holds(west, north, west, south, east, north, x3, y3):
                    return True
    return False


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
        at = np.empty(0), np.empty(0)
        return Footprint(0, 0, np.zeros(0, np.uint8), none, none, faces, *at, NO_RIM, NO_BOXES)
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
    at = np.empty(0), np.empty(0)
    return Footprint(side, columns, state, start.astype(np.int32), items, faces, *at, NO_RIM, NO_BOXES)
