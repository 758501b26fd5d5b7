"""Open scans for benchmarks of closed surfaces, made of front patches, and how near rims of holes are to each other."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import linalg
from scipy.spatial import cKDTree

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.surface.edges import Edges, largest_sound_part

# How deep the back is that a front gets, over the front; how high the foot is that is cut off, of all, and what is
# tried where that leaves several rims; how ragged the cut is [edges].
DEPTH, FEET, RAGS = 0.6, (0.08, 0.05, 0.12, 0.16, 0.2, 0.25, 0.3, 0.35, 0.4), 0.5
# Points on all rims of a mesh by which rims are compared.
RIM_SAMPLES = 2000

Mesh = tuple[FloatArray, IntArray]


def rims(faces: IntArray) -> list[IntArray]:
    """Return the vertices of each closed row of edges that have one face, as its faces go, the longest rim first.

    Raises
    ------
    ValueError
        If several rims meet in a vertex.
    """
    edges = Edges.of(np.asarray(faces, np.int64))
    ends = edges.ends(edges.border)
    after = dict(ends.tolist())
    if len(after) < len(ends):
        raise ValueError(f"rims meet in {len(ends) - len(after)} vertices")
    found = []
    while after:
        rim = [next(iter(after))]
        while rim[-1] in after:
            rim.append(after.pop(rim[-1]))
        found.append(np.array(rim[:-1]))
    return sorted(found, key=len, reverse=True)


def whole_scan(points: FloatArray, faces: IntArray, seed: int = 1) -> Mesh:
    """Return a front patch as a whole scan: with a back, shut all around, but cut off at the foot.

    The back is the front mirrored at a membrane that spans its outline, the longest rim, less deep, and wound the other
    way; both outlines are joined by a strip of triangles. The cut leaves a ragged rim. Other holes are there twice.

    Parameters
    ----------
    points : (V, 3) float array
        Seen along z, y upwards.
    faces : (F, 3) int array
    seed : int
        Of the rags.

    Returns
    -------
    points : (V', 3) float array
    faces : (F', 3) int array
        One part without handles; one rim more than twice the front's inner ones.
    """
    faces = np.asarray(faces, np.int64)
    outline, *inner = rims(faces)
    length = np.linalg.norm(points[outline] - points[np.roll(outline, -1)], axis=1).mean()
    below = _membrane(points[:, 2], faces, outline) - points[:, 2]
    back = points + np.column_stack([np.zeros((len(points), 2)), (1.0 + DEPTH) * below - length])
    n = len(points)
    # the faces of the front go along their rim forwards, so these go backwards
    after = np.roll(outline, -1)
    strip = [np.column_stack([after, outline, outline + n]), np.column_stack([after, outline + n, after + n])]
    whole = np.concatenate([points, back])
    shut = np.concatenate([faces, faces[:, ::-1] + n, *strip])
    for foot in FEET:
        left = _cut_off(whole, shut, foot, RAGS * length, np.random.default_rng(seed))
        if len(rims(left)) == 2 * len(inner) + 1:
            used, corners = np.unique(left, return_inverse=True)
            return whole[used], corners.reshape(-1, 3)
    raise ValueError(f"cut off at {', '.join(f'{foot:.0%}' for foot in FEET)} of its height it has more than one rim")


def _membrane(height: FloatArray, faces: IntArray, outline: IntArray) -> FloatArray:
    """Return heights (V,) that are those given at an outline, and elsewhere the mean of their neighbours'."""
    n = len(height)
    ends = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    joined = sparse.coo_array((np.ones(len(ends)), ends.T), (n, n)).tocsr()
    joined = joined + joined.T
    inner = np.setdiff1d(np.arange(n), outline)
    laplacian = (sparse.diags_array(joined.sum(axis=1)) - joined).tocsr()[inner]
    found = height.copy()
    found[inner] = linalg.spsolve(laplacian[:, inner].tocsc(), -laplacian[:, outline] @ height[outline])
    return found


def _cut_off(points: FloatArray, faces: IntArray, foot: float, rags: float, rng: np.random.Generator) -> IntArray:
    """Return the faces above a height that wavers; one part, in which no rims meet in a vertex."""
    height = points[faces, 1].mean(axis=1) + rags * rng.uniform(-1.0, 1.0, len(faces))
    return largest_sound_part(faces[height > points[:, 1].min() + foot * np.ptp(points[:, 1])])


def rim_distance(original: Mesh, simplified: Mesh) -> tuple[float, float]:
    """Return how far the rims of two meshes are from each other at most and on average [units of the points].

    Points are taken all along the rims of each, and their distances to the nearest point of any rim of the other one.
    The largest of both directions, and the average of both means, over the length.

    Returns
    -------
    largest, mean : float
        0 where neither has a rim; infinite where one of them has none.

    Examples
    --------
    A square of two triangles, and one that is moved aside by 0.1:

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> faces = np.array([[0, 1, 2], [0, 2, 3]])
    >>> largest, mean = rim_distance((square, faces), (square + [0.1, 0, 0], faces))
    >>> round(largest, 6), 0.05 < mean < 0.06
    (0.1, True)
    """
    segments = []
    for points, faces in (original, simplified):
        edges = Edges.of(np.asarray(faces, np.int64))
        segments.append(np.asarray(points, float)[edges.ends(edges.border)])
    n_first, n_second = map(len, segments)
    if not n_first or not n_second:
        return (0.0, 0.0) if n_first == n_second else (np.inf, np.inf)
    there = [_distances(_along(segments[k]), segments[1 - k]) for k in (0, 1)]
    ends = [_distances(segments[k][:, 0], segments[1 - k]) for k in (0, 1)]
    return float(max(np.max(found) for found in (*there, *ends))), float(np.mean([found.mean() for found in there]))


def _along(segments: FloatArray) -> FloatArray:
    """Return points all along segments (S, 2, 3), evenly by length."""
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    end = np.cumsum(length)
    at = (np.arange(RIM_SAMPLES) + 0.5) / RIM_SAMPLES * end[-1]
    which = np.minimum(np.searchsorted(end, at, side="right"), len(end) - 1)
    share = ((at - (end - length)[which]) / np.where(length > 0, length, 1.0)[which])[:, None]
    return segments[which, 0] + share * (segments[which, 1] - segments[which, 0])


def _distances(points: FloatArray, segments: FloatArray) -> FloatArray:
    """Return the distances of points (n, 3) to the nearest of segments (S, 2, 3)."""
    start, step = segments[:, 0], segments[:, 1] - segments[:, 0]
    square = (step**2).sum(axis=1)
    # one at least is as near as the nearest middle, so that only those whose middles are near enough are looked at
    middles = cKDTree(0.5 * (segments[:, 0] + segments[:, 1]))
    near = middles.query(points)[0] + 0.5 * np.sqrt(square.max())
    rows = middles.query_ball_point(points, near * (1.0 + 1e-9))
    counts = np.array([len(found) for found in rows])
    segment = np.concatenate(rows).astype(np.int64)
    away = np.repeat(points, counts, axis=0) - start[segment]
    share = np.clip((away * step[segment]).sum(axis=1) / np.where(square > 0, square, 1.0)[segment], 0.0, 1.0)
    distance = np.linalg.norm(away - share[:, None] * step[segment], axis=1)
    return np.minimum.reduceat(distance, np.cumsum(counts) - counts)
