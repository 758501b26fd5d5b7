"""A second kind of surface, small enough that its whole front is known: a ring of heights round a hub.

Vertex 0 is the hub at height 0; vertices 1 to n stand on a circle round it. The mesh of a subset is the fan of the hub
and each two kept vertices of the circle that follow each other; what is left out between them deviates from the line
that joins their heights. Nothing of it is Delaunay, and nothing of it is planned for in the package.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from meshsimp_pymoo.surface import moves
from meshsimp_pymoo.surface.measures import as_quality
from meshsimp_pymoo.surface.moves import answers
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.surface import Refitted, Scored, Simplified, View


class Ring(NamedTuple):
    """What does not change: heights (n + 1,), that of the hub first."""

    height: np.ndarray


class Kept(NamedTuple):
    """What changes: which vertices are sites, those before and after each on the circle, and two sums."""

    site: np.ndarray  # (n + 1,) bool
    before: np.ndarray  # (n + 1,)
    after: np.ndarray  # (n + 1,)
    cost: np.ndarray  # (1,)
    count: np.ndarray  # (1,) sites on the circle


@njit
def deviation_at(ring: Ring, a: int, b: int, p: int) -> float:
    """Return how far vertex p, between a and b in the sense of the circle, is from the line that joins them."""
    n = len(ring.height) - 1
    share = ((p - a) % n) / ((b - a) % n) if a != b else 0.0
    return abs(ring.height[a] + share * (ring.height[b] - ring.height[a]) - ring.height[p])


@njit
def arc_cost(ring: Ring, a: int, b: int) -> float:
    """Return the sum of the deviations between two kept vertices."""
    n, cost = len(ring.height) - 1, 0.0
    p = a % n + 1
    while p != b:
        cost += deviation_at(ring, a, b, p)
        p = p % n + 1
    return cost


@answers(moves.exchange, Ring)
@njit
def exchange(ring: Ring, kept: Kept, v: int, w: int) -> bool:
    """Unlink v and link w; three vertices must stay."""
    if v >= 0:
        if v == 0 or kept.count[0] - 1 + (w >= 0) < 3:
            return False
        a, b = kept.before[v], kept.after[v]
        kept.cost[0] += arc_cost(ring, a, b) - arc_cost(ring, a, v) - arc_cost(ring, v, b)
        kept.after[a], kept.before[b], kept.site[v] = b, a, False
        kept.count[0] -= 1
    if w >= 0:
        n = len(ring.height) - 1
        a = (w - 2) % n + 1
        while not kept.site[a]:
            a = (a - 2) % n + 1
        b = kept.after[a]
        kept.cost[0] += arc_cost(ring, a, w) + arc_cost(ring, w, b) - arc_cost(ring, a, b)
        kept.after[a], kept.before[w], kept.after[w], kept.before[b], kept.site[w] = w, a, b, w, True
        kept.count[0] += 1
    return True


@answers(moves.try_exchange, Ring)
@njit
def try_exchange(ring: Ring, kept: Kept, v: int, w: int, limit: float) -> tuple[float, int]:
    """Do it, look, and undo it."""
    cost, count = kept.cost[0], kept.count[0]
    if not exchange(ring, kept, v, w):
        return np.inf, 0
    change, more = kept.cost[0] - cost, kept.count[0] - count
    exchange(ring, kept, w, v)
    kept.cost[0] = cost
    return change, more


@answers(moves.total_cost, Ring)
@njit
def total_cost(ring: Ring, kept: Kept) -> float:
    """Return the sum that is kept up to date."""
    return kept.cost[0]


@answers(moves.n_triangles, Ring)
@njit
def n_triangles(ring: Ring, kept: Kept) -> int:
    """Return one triangle for each kept vertex of the circle."""
    return kept.count[0]


@answers(moves.n_sites, Ring)
@njit
def n_sites(ring: Ring, kept: Kept) -> int:
    """Return the number of kept vertices, with the hub."""
    return kept.count[0] + 1


@answers(moves.is_site, Ring)
@njit
def is_site(ring: Ring, kept: Kept, v: int) -> bool:
    """Tell whether vertex v is kept."""
    return kept.site[v]


@answers(moves.is_taken, Ring)
@njit
def is_taken(ring: Ring, kept: Kept, w: int) -> bool:
    """Tell whether vertex w is kept: no two are at one place."""
    return kept.site[w]


@njit
def arc_of(ring: Ring, kept: Kept, v: int) -> int:
    """Return the kept vertex at the beginning of the arc in which v lies."""
    n = len(ring.height) - 1
    while not kept.site[v]:
        v = (v - 2) % n + 1
    return v


@answers(moves.urgency, Ring)
@njit
def urgency(ring: Ring, kept: Kept, v: int) -> float:
    """Return the cost of the arc."""
    a = arc_of(ring, kept, v)
    return arc_cost(ring, a, kept.after[a])


@answers(moves.sites_around, Ring)
@njit
def sites_around(ring: Ring, kept: Kept, v: int, found: np.ndarray) -> int:
    """Return the two neighbours on the circle."""
    found[0], found[1] = kept.before[v], kept.after[v]
    return 2


@answers(moves.n_cells, Ring)
@njit
def n_cells(ring: Ring, kept: Kept) -> int:
    """Return the number of numbers of arcs: an arc is called after the vertex where it begins."""
    return len(ring.height)


@answers(moves.worst_in, Ring)
@njit
def worst_in(ring: Ring, kept: Kept, cell: int) -> tuple[int, float, float]:
    """Return the worst vertex of an arc."""
    worst, most, whole = -1, 0.0, 0.0
    if cell == 0 or not kept.site[cell]:
        return worst, most, whole
    n, b = len(ring.height) - 1, kept.after[cell]
    p = cell % n + 1
    while p != b:
        d = deviation_at(ring, cell, b, p)
        whole += d
        if d > most:
            worst, most = p, d
        p = p % n + 1
    return worst, most, whole


@answers(moves.cells_around, Ring)
@njit
def cells_around(ring: Ring, kept: Kept, v: int, found: np.ndarray) -> int:
    """Return the arcs at both sides."""
    found[0], found[1] = kept.before[v], v
    return 2


class RingModel:
    """The original mesh, as files know it."""

    def __init__(self, height: np.ndarray) -> None:
        n = len(height)
        angle = 2 * np.pi * np.arange(n) / n
        rim = np.arange(1, n + 1)
        self.name = "ring of heights"
        self.n_vertices = n + 1
        self.file_points = np.vstack([np.zeros(3), np.column_stack([np.cos(angle), np.sin(angle), height])])
        self.faces = np.column_stack([np.zeros(n, int), rim, np.roll(rim, -1)]).astype(np.int32)
        self.source_index = np.arange(n + 1)
        self.attributes: dict[str, Any] = {}
        self.georeference: dict[str, Any] = {}
        self.hash = "ring"


class RingSurface:
    """A ring of heights with rules; the first, the middle and two more vertices are pinned beside the hub."""

    def __init__(self, height: np.ndarray, rules: Rules | None = None) -> None:
        self.model = RingModel(np.asarray(height, float))
        self.rules = rules or Rules()
        self.n_vertices = n = self.model.n_vertices
        self.points, self.faces = self.model.file_points, self.model.faces
        self.pinned = np.zeros(n, bool)
        self.pinned[[0, 1, 1 + (n - 1) // 3, 1 + 2 * (n - 1) // 3]] = True
        self.diagonal = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        self.total_weight = float(n)
        rim = np.arange(1, n)
        rings = [rim, *(np.array([0, (v - 2) % (n - 1) + 1, v % (n - 1) + 1]) for v in rim)]
        self.neighbours = (np.cumsum([0, *map(len, rings)]), np.concatenate(rings))
        self.border = rim
        self.places = self.points[:, :2]
        self.view = View(self.points, 1.0, np.eye(3), np.zeros(3))

    def simplify(self, kept: np.ndarray) -> Simplified:
        """Return the fan of the kept vertices."""
        rim = np.flatnonzero(kept[1:]) + 1
        if len(rim) < 3 or not kept[0]:
            raise ValueError(f"{int(kept.sum())} vertices make no fan")
        follow = np.roll(rim, -1)
        deviation = np.zeros(self.n_vertices)
        n = self.n_vertices - 1
        for a, b in zip(rim, follow, strict=True):
            for step in range(1, (b - a) % n):
                p = (a - 1 + step) % n + 1
                share = step / ((b - a) % n)
                deviation[p] = abs((1 - share) * self.points[a, 2] + share * self.points[b, 2] - self.points[p, 2])
        faces = np.column_stack([np.zeros(len(rim), int), rim, follow]).astype(np.int32)
        numbers = [deviation.sum(), len(rim), len(rim) + 1, (deviation**2).sum(), deviation.max(), 0]
        quality = as_quality(np.array(numbers), self.total_weight)
        return Simplified(faces, quality, deviation, np.ones(self.n_vertices, bool))

    def evaluate(self, kept: np.ndarray, *, threads: int = 1, regions: int = 0) -> np.ndarray:
        """Return the numbers of each subset; 0 triangles where it has no mesh."""
        table = np.zeros((len(kept), 6 + regions))
        ends = np.linspace(0, self.n_vertices, regions + 1).astype(int)
        for row, chromosome in zip(table, kept, strict=True):
            try:
                found = self.simplify(chromosome)
            except ValueError:
                row[6:] = np.inf
                continue
            d = found.deviation
            row[:6] = d.sum(), len(found.faces), found.quality.vertices, (d**2).sum(), d.max(), 0
            row[6:] = [d[a:b].sum() for a, b in pairwise(ends)]
        return table

    def score(self, points: np.ndarray, faces: np.ndarray) -> Scored:
        """Nothing here measures the meshes of others."""
        raise NotImplementedError

    def refit(self, kept: np.ndarray) -> Refitted:
        """Return the mesh as it is: no vertex moves."""
        found = self.simplify(kept)
        rows = np.unique(found.faces)
        error = found.quality.error
        return Refitted(found.faces, rows, self.points[rows], error, error, 0.0)

    def stored_arrays(self) -> dict[str, Any]:
        """Return nothing: rows are those of the file."""
        return {}

    def ground(self) -> Ring | None:
        """Return the heights."""
        return Ring(self.points[:, 2].copy())

    @contextmanager
    def books(self, kept: np.ndarray, *, fixed: np.ndarray | None = None) -> Iterator[Kept]:
        """Link the kept vertices."""
        n = self.n_vertices
        rim = np.flatnonzero(kept[1:]) + 1
        books = Kept(kept.copy(), np.zeros(n, int), np.zeros(n, int), np.zeros(1), np.full(1, len(rim)))
        books.after[rim], books.before[rim] = np.roll(rim, -1), np.roll(rim, 1)
        books.cost[0] = self.simplify(kept).quality.error
        yield books


class StillRing(RingSurface):
    """The same without compiled moves."""

    def ground(self) -> None:
        """Return nothing: no vertex of it can be moved."""
        return None


def least_errors(surface: RingSurface) -> np.ndarray:
    """Return the least error of a subset of each number of triangles, (n + 1,), by going once round the circle.

    The pinned vertex 1 begins and ends the way; no step goes past a pinned one.
    """
    z, pinned = np.append(surface.points[1:, 2], surface.points[1, 2]), surface.pinned[1:]
    n = len(z) - 1
    least = np.full((n + 1, n + 1), np.inf)  # [number of steps so far, where]
    least[0, 0] = 0.0
    for b in range(1, n + 1):
        for a in range(b - 1, -1, -1):
            line = np.interp(np.arange(a, b + 1), [a, b], [z[a], z[b]])
            cost = np.abs(line - z[a : b + 1]).sum()
            least[1:, b] = np.minimum(least[1:, b], least[:-1, a] + cost)
            if a < n and pinned[a]:
                break
    return least[:, n]
