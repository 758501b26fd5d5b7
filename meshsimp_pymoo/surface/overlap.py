"""What lies above what: the faces of a sheet that are hidden below others of it, as seen from above."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.surface.edges import Edges, components, used_vertices

# Two faces overlap when no line separates them within this share of the extent; so far may rounding push
# neighbours.
OVERLAP_TOLERANCE = 1e-9

# Cells are widened until the faces stand in so many of them each, on average: memory stays in proportion to them.
CELLS_PER_FACE = 6

# Faces that are compared, for each one, and at least: some seconds. Ordinary meshes need 20 for each.
MOST_TESTS, LEAST_LIMIT = 300, 100_000_000

# Loops of a border, and segments of it in one cell, up to which the border alone is asked.
MOST_LOOPS = MOST_IN_CELL = 64


def hidden_faces(
    points: FloatArray,
    faces: IntArray,
    *,
    tolerance: float | None = None,
    most: int | None = None,
    edges: Edges | None = None,
    name: str = "mesh",
) -> IntArray:
    """Return the faces below others, of faces that all show their front.

    The number of faces over a point is the winding number of their border around it. So where the border is a few
    loops that nowhere touch, one look at each tells whether any faces overlap. Otherwise faces are compared: each one
    with those higher, until one lies over it.

    Parameters
    ----------
    points : (V, 3) float array
        Vertices, the viewer at +z [units].
    faces : (F, 3) int array
        Counter-clockwise as seen from there.
    tolerance : float, optional
        Overlaps narrower than this are rounding [units]; default 1e-9 of the extent.
    most : int, optional
        Stop when more than so many are known; by default all are found.
    edges : Edges, optional
        Of `faces`, with or without others that are seen edge-on, where they are known.
    name : str
        For messages.

    Returns
    -------
    (H,) int array
        Rows of `faces`, ascending. Of two that coincide the later.

    Raises
    ------
    ModelError
        If so many faces meet in one place that comparing them would take minutes.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> sheet = np.array([[0, 1, 2], [0, 2, 3]])
    >>> hidden_faces(np.vstack([square, square + [0.5, 0.2, 1]]), np.vstack([sheet, sheet + 4])).tolist()
    [0, 1]
    """
    if len(faces) == 0:
        return np.empty(0, np.int64)
    if tolerance is None:
        tolerance = OVERLAP_TOLERANCE * float(np.ptp(points[used_vertices(faces), :2], axis=0).max())
    if _covers_once(points[:, :2], Edges.of(faces) if edges is None else edges, tolerance):
        return np.empty(0, np.int64)
    triangles = np.ascontiguousarray(points[faces])
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    origin = low[:, :2].min(axis=0)
    size = high[:, :2].max(axis=0) - origin
    cell = np.maximum(1.5 * (high - low)[:, :2].mean(axis=0), np.maximum(size, 1e-300) / (2 * np.sqrt(len(faces)) + 1))
    while True:
        shape = np.maximum(np.ceil(size / cell).astype(np.int64), 1)
        first, last = (np.clip(((at[:, :2] - origin) / cell).astype(np.int64), 0, shape - 1) for at in (low, high))
        if np.prod(last - first + 1.0, axis=1).sum() <= CELLS_PER_FACE * len(faces):
            break
        cell = 1.5 * cell
    hidden = np.zeros(len(faces), np.bool_)
    downwards = np.argsort(-high[:, 2], kind="stable")
    limit = max(MOST_TESTS * len(faces), LEAST_LIMIT)
    stop = len(faces) if most is None else most
    if not _mark_hidden(triangles, low, high, downwards, first, last, shape, tolerance, stop, limit, hidden):
        raise ModelError(
            f"{name}: so many of its {len(faces)} faces meet in one place that {limit} comparisons do not tell which "
            "lie below others; split long thin faces, such as large fans, in a mesh editor"
        )
    return np.flatnonzero(hidden)


def _covers_once(xy: FloatArray, edges: Edges, tolerance: float) -> bool:
    """Tell whether the border of faces proves that no two overlap; False if it does not tell."""
    if len(edges.crowded):
        return False
    flat = edges.faces.ravel()
    first, second = edges.pairs
    if (flat[first] == flat[second]).any():
        return False
    vertices, ends = np.unique(edges.ends(edges.border), return_inverse=True)
    ends = ends.reshape(-1, 2)
    n = len(ends)
    if len(vertices) != n or len(np.unique(ends[:, 0])) != n or len(np.unique(ends[:, 1])) != n:
        return False  # fans that touch in a vertex
    loop = components(n, ends[:, 0], ends[:, 1])[ends[:, 0]]
    n_loops = int(loop.max()) + 1 if n else 0
    place = xy[vertices]
    if n == 0 or n_loops > MOST_LOOPS or _touch(place, ends, tolerance):
        return False
    place = place - place.mean(axis=0)
    p, q = place[ends[:, 0]], place[ends[:, 1]]
    area = np.bincount(loop, weights=p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1])
    for k in range(n_loops):
        x, y = p[np.argmax(loop == k)]
        up, down = (p[:, 1] <= y) & (q[:, 1] > y), (q[:, 1] <= y) & (p[:, 1] > y)
        right = (q[:, 0] - p[:, 0]) * (y - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x - p[:, 0])
        others = loop != k
        winding = int((others & up & (right > 0)).sum()) - int((others & down & (right < 0)).sum())
        if winding + (area[k] > 0) != 1:
            return False
    return True


def _touch(place: FloatArray, ends: IntArray, tolerance: float) -> bool:
    """Tell whether segments of a border meet otherwise than one after the other; True where it would take long."""
    p, q = place[ends[:, 0]], place[ends[:, 1]]
    length = np.linalg.norm(q - p, axis=1)
    cell = max(2 * float(length.mean()), 8 * tolerance, 1e-300)
    # pieces no longer than a cell, so that long slanted segments do not fill their boxes
    pieces = np.maximum(np.ceil(length / cell), 1).astype(np.int64)
    segment = np.repeat(np.arange(len(p)), pieces)
    k = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    step = (q - p)[segment] / pieces[segment, None]
    a = p[segment] + step * k[:, None]
    low, high = np.minimum(a, a + step), np.maximum(a, a + step)
    origin = low.min(axis=0) - cell
    first = np.floor((low - tolerance - origin) / cell).astype(np.int64)
    last = np.floor((high + tolerance - origin) / cell).astype(np.int64)
    columns = int(last[:, 1].max()) + 1
    cells = []
    for i in range(3):
        for j in range(3):
            there = (first + np.array([i, j]) <= last).all(axis=1)
            cells.append(np.column_stack([(first[there, 0] + i) * columns + first[there, 1] + j, segment[there]]))
    by_cell = np.unique(np.concatenate(cells), axis=0)
    key, segment = by_cell.T
    for k in range(1, len(key)):
        same = key[k:] == key[:-k]
        if not same.any():
            return False
        if k > MOST_IN_CELL or _meet(p, q, ends, segment[:-k][same], segment[k:][same], tolerance).any():
            return True
    return False


def _meet(
    p: FloatArray, q: FloatArray, ends: IntArray, first: IntArray, second: IntArray, tolerance: float
) -> BoolArray:
    """Tell which pairs of segments come within the tolerance of each other, but for an end that they share."""
    near = np.zeros(len(first), bool)
    for a, b in ((first, second), (second, first)):
        d = q[b] - p[b]
        squared = np.maximum((d * d).sum(axis=1), 1e-300)
        for side, at in enumerate((p, q)):
            apart = ends[a, side][:, None] != ends[b]
            t = np.clip(((at[a] - p[b]) * d).sum(axis=1) / squared, 0, 1)
            distance = np.linalg.norm(at[a] - p[b] - t[:, None] * d, axis=1)
            near |= apart.all(axis=1) & (distance <= tolerance)
    crosses = np.ones(len(first), bool)
    for a, b in ((first, second), (second, first)):
        d = q[b] - p[b]
        sides = [d[:, 0] * (at[a] - p[b])[:, 1] - d[:, 1] * (at[a] - p[b])[:, 0] for at in (p, q)]
        crosses &= sides[0] * sides[1] < 0
    return near | crosses


@entry
def _mark_hidden(
    triangles: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    downwards: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    shape: np.ndarray,
    tolerance: float,
    most: int,
    limit: int,
    hidden: np.ndarray,
) -> bool:
    """Mark what lies below another; False if that took more comparisons than `limit`.

    In each cell the highest come first, so that what lies under many is compared with one, and what lies over all with
    few.
    """
    columns, rows = shape[0], shape[1]
    start = np.zeros(columns * rows + 1, np.int64)
    for f in range(len(triangles)):
        for i in range(first[f, 0], last[f, 0] + 1):
            for j in range(first[f, 1], last[f, 1] + 1):
                start[i * rows + j + 1] += 1
    # plain loops: NumPy's sums and slices take Numba two seconds to compile
    fill = np.empty(columns * rows, np.int64)
    for cell in range(columns * rows):
        fill[cell] = start[cell]
        start[cell + 1] += start[cell]
    content = np.empty(start[columns * rows], np.int32)
    for f in downwards:
        for i in range(first[f, 0], last[f, 0] + 1):
            for j in range(first[f, 1], last[f, 1] + 1):
                content[fill[i * rows + j]] = f
                fill[i * rows + j] += 1
    found = 0
    tests = 0
    polygon = np.empty((16, 2))
    clipped = np.empty((16, 2))
    for f in range(len(triangles)):
        i = first[f, 0]
        j = first[f, 1]
        while i <= last[f, 0] and not hidden[f]:
            for at in range(start[i * rows + j], start[i * rows + j + 1]):
                m = content[at]
                if high[m, 2] < low[f, 2]:
                    break
                tests += 1
                # each pair once: in the lowest cell that both reach
                if m == f or i != max(first[f, 0], first[m, 0]) or j != max(first[f, 1], first[m, 1]):
                    continue
                if low[m, 0] > high[f, 0] or low[f, 0] > high[m, 0] or low[m, 1] > high[f, 1] or low[f, 1] > high[m, 1]:
                    continue
                a, b = max(f, m), min(f, m)
                if _separated(triangles, a, b, tolerance) or _separated(triangles, b, a, tolerance):
                    continue
                if _lower_one(triangles, a, b, polygon, clipped) == f:
                    hidden[f] = True
                    break
            j += 1
            if j > last[f, 1]:
                j = first[f, 1]
                i += 1
        if hidden[f]:
            found += 1
            if found > most:
                return True
        if tests > limit:
            return False
    return True


@inner
def _separated(triangles: np.ndarray, f: int, g: int, tolerance: float) -> bool:
    """Tell whether an edge of the counter-clockwise triangle f has all of g on its outer side."""
    for i in range(3):
        px, py = triangles[f, i, 0], triangles[f, i, 1]
        dx, dy = triangles[f, (i + 1) % 3, 0] - px, triangles[f, (i + 1) % 3, 1] - py
        slack = tolerance * np.sqrt(dx * dx + dy * dy)
        outside = True
        for j in range(3):
            if dx * (triangles[g, j, 1] - py) - dy * (triangles[g, j, 0] - px) > slack:
                outside = False
                break
        if outside:
            return True
    return False


@inner
def _lower_one(triangles: np.ndarray, f: int, g: int, polygon: np.ndarray, clipped: np.ndarray) -> int:
    """Return which of two triangles is lower at the centre of their overlap (in a tie the later)."""
    n = 3
    for j in range(3):
        polygon[j, 0], polygon[j, 1] = triangles[g, j, 0], triangles[g, j, 1]
    for i in range(3):  # Sutherland and Hodgman: cut g by each edge of f
        px, py = triangles[f, i, 0], triangles[f, i, 1]
        dx, dy = triangles[f, (i + 1) % 3, 0] - px, triangles[f, (i + 1) % 3, 1] - py
        m = 0
        for j in range(n):
            qx, qy = polygon[j, 0], polygon[j, 1]
            rx, ry = polygon[(j + 1) % n, 0], polygon[(j + 1) % n, 1]
            side_q = dx * (qy - py) - dy * (qx - px)
            side_r = dx * (ry - py) - dy * (rx - px)
            if side_q >= 0:
                clipped[m, 0], clipped[m, 1] = qx, qy
                m += 1
            if (side_q > 0 and side_r < 0) or (side_q < 0 and side_r > 0):
                t = side_q / (side_q - side_r)
                clipped[m, 0], clipped[m, 1] = qx + t * (rx - qx), qy + t * (ry - qy)
                m += 1
        polygon, clipped = clipped, polygon
        n = m
        if n == 0:
            break
    x = y = 0.0
    if n > 0:
        for j in range(n):
            x += polygon[j, 0] / n
            y += polygon[j, 1] / n
    else:  # a rounding case: they hardly touch
        for j in range(3):
            x += (triangles[f, j, 0] + triangles[g, j, 0]) / 6
            y += (triangles[f, j, 1] + triangles[g, j, 1]) / 6
    above = height_at(triangles, f, x, y) - height_at(triangles, g, x, y)
    if above == 0:
        return max(f, g)
    return g if above > 0 else f


@inner
def height_at(triangles: np.ndarray, f: int, x: float, y: float) -> float:
    """Return the height of a triangle's plane over (x, y)."""
    ax, ay, az = triangles[f, 0, 0], triangles[f, 0, 1], triangles[f, 0, 2]
    bx, by, bz = triangles[f, 1, 0] - ax, triangles[f, 1, 1] - ay, triangles[f, 1, 2] - az
    cx, cy, cz = triangles[f, 2, 0] - ax, triangles[f, 2, 1] - ay, triangles[f, 2, 2] - az
    x, y = x - ax, y - ay
    area = bx * cy - by * cx
    return az + ((x * cy - y * cx) * bz + (bx * y - by * x) * cz) / area
