"""Which faces of a mesh meet along which edges, and what that makes: parts, borders, loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.reprs import brief


@brief
@dataclass(frozen=True)
class Edges:
    """Half-edges ``3 * face + i`` (corner i to i + 1), sorted so that those of one edge stand together.

    Parameters
    ----------
    faces : (F, 3) int array
    order : (3 F,) int array
        The half-edges, by edge.
    starts, counts : (E,) int arrays
        Where each edge begins in `order`, and how many faces it has.
    """

    faces: IntArray
    order: IntArray
    starts: IntArray
    counts: IntArray

    @classmethod
    def of(cls, faces: IntArray) -> Edges:
        """Sort the half-edges of faces (F, 3)."""
        a = faces.ravel()
        b = np.roll(faces, -1, axis=1).ravel()
        key = np.minimum(a, b) * (int(faces.max()) + 1) + np.maximum(a, b)
        order = np.argsort(key, kind="stable")
        ordered = key[order]
        starts = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
        return cls(faces, order, starts, np.diff(np.append(starts, len(key))))

    @cached_property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """The two half-edges of every edge that has exactly two."""
        starts = self.starts[self.counts == 2]
        return self.order[starts], self.order[starts + 1]

    @cached_property
    def border(self) -> IntArray:
        """The half-edges of the edges that have one face."""
        return self.order[self.starts[self.counts == 1]]

    @cached_property
    def crowded(self) -> npt.NDArray[np.intp]:
        """The edges of more than two faces."""
        return np.flatnonzero(self.counts > 2)

    def ends(self, half: IntArray) -> IntArray:
        """Return the vertices (H, 2) from and to which half-edges lead."""
        flat = self.faces.ravel()
        return np.column_stack([flat[half], flat[next_corner(half)]])

    def of_edges(self, edges: npt.NDArray[np.intp]) -> tuple[IntArray, IntArray]:
        """Return the half-edges of some edges, joined, and which of the edges each belongs to (0, 1, ...)."""
        counts = self.counts[edges]
        which = np.repeat(np.arange(len(edges)), counts)
        within = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
        return self.order[self.starts[edges][which] + within], which


def used_vertices(faces: IntArray) -> IntArray:
    """Return the vertices that faces use, ascending."""
    used = np.zeros(int(faces.max()) + 1, bool)
    used[faces.ravel()] = True
    return np.flatnonzero(used)


def next_corner(half: IntArray) -> IntArray:
    """Return the following half-edge, or corner, within the same face."""
    return half - half % 3 + (half + 1) % 3


def components(n: int, first: IntArray, second: IntArray) -> IntArray:
    """Return to which part each of n things belongs, of those that are linked in pairs."""
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def border_loops(edges: Edges) -> tuple[int, int]:
    """Count the border's closed loops, and its vertices in which several fans of faces meet."""
    border, faces = edges.border, edges.faces
    if len(border) == 0:
        return 0, 0
    flat = faces.ravel()
    at_border = np.zeros(int(faces.max()) + 1, bool)
    at_border[flat[border]] = True
    at_border[flat[next_corner(border)]] = True
    corners = np.flatnonzero(at_border[flat])
    number = np.full(faces.size, -1, np.int64)
    number[corners] = np.arange(len(corners))
    # two faces on one edge share the fans at both its ends
    first, second = edges.pairs
    same = flat[first] == flat[second]
    links = [
        (first, np.where(same, second, next_corner(second))),
        (next_corner(first), np.where(same, next_corner(second), second)),
    ]
    left = np.concatenate([number[a] for a, _ in links])
    right = np.concatenate([number[b] for _, b in links])
    fan = components(len(corners), left[left >= 0], right[left >= 0])
    n_fans = int(fan.max()) + 1
    fans_per_vertex = np.bincount(np.unique(flat[corners] * n_fans + fan) // n_fans)
    start, end = fan[number[border]], fan[number[next_corner(border)]]
    loop = components(n_fans, start, end)
    return len(np.unique(loop[start])), int((fans_per_vertex > 1).sum())


def largest_sound_part(faces: IntArray) -> IntArray:
    """Return the faces of the largest part of a mesh, less those at vertices in which rims meet."""
    while True:
        edges = Edges.of(faces)
        first, second = edges.pairs
        part = components(len(faces), first // 3, second // 3)
        starts = np.bincount(edges.ends(edges.border)[:, 0], minlength=int(faces.max()) + 1)
        sound = (part == np.argmax(np.bincount(part))) & (starts[faces] < 2).all(axis=1)
        if sound.all():
            return faces
        faces = faces[sound]


def single_precision(points: FloatArray, seen: FloatArray | None = None) -> float:
    """Return how far apart two vertices may lie that single precision does not tell apart [units of the points].

    Coordinates that a single-precision file rounded are unsure by their own size; others, whose digits go further, are
    taken as if they were single precision from a local origin.

    Parameters
    ----------
    points : (V, 3) float array
        As in the file.
    seen : (V, D) float array, optional
        Their coordinates in which it is asked for, such as those across the line of sight; default all.
    """
    seen = points if seen is None else seen
    with np.errstate(over="ignore"):
        rounded = bool((points == points.astype(np.float32)).all())
    scale = np.abs(seen).max() if rounded else np.ptp(seen, axis=0).max()
    return 2 * float(np.finfo(np.float32).eps * scale)


def seams(points: FloatArray, edges: Edges, tolerance: float) -> tuple[IntArray, IntArray]:
    """Return pairs of half-edges at the border that run along each other: faces that touch without sharing vertices.

    Parameters
    ----------
    points : (V, 3) float array
    edges : Edges
    tolerance : float
        Vertices so close are at one place [units of the points].

    Returns
    -------
    first, second : (P,) int arrays
        Each half-edge stands in one pair at most; where more than two run along each other, in none.
    """
    ends = edges.ends(edges.border)
    vertices, number = np.unique(ends, return_inverse=True)
    # first what shares a cell, then what cells near each other hold: the pairs stay few however dense they lie
    low = points[vertices].min(axis=0) if len(vertices) else 0.0
    width = max(tolerance, 1e-300)
    _, cell = np.unique(np.floor((points[vertices] - low) / width), axis=0, return_inverse=True)
    cell = cell.ravel()
    one_of = np.zeros(int(cell.max(initial=-1)) + 1, np.int64)
    one_of[cell] = vertices
    near = (
        cKDTree(points[one_of]).query_pairs(2 * width, output_type="ndarray") if len(one_of) else np.empty((0, 2), int)
    )
    place = components(len(one_of), near[:, 0], near[:, 1])[cell][number.reshape(-1, 2)]
    place.sort(axis=1)
    _, edge, count = np.unique(place, axis=0, return_inverse=True, return_counts=True)
    edge = edge.ravel()
    twice = np.flatnonzero((count[edge] == 2) & (place[:, 0] != place[:, 1]))
    half = edges.border[twice[np.argsort(edge[twice], kind="stable")]]
    return half[::2], half[1::2]
