"""A second kind of surface, tiny and exactly known: points of a circle, whose mesh is a fan.

The mesh of a subset is the fan over the kept points from the first of them, T = n - 2 triangles. A dropped point costs
its distance to the chord between the kept points on either side of it, which is its distance to the mesh. Three points
are pinned. Nothing here is quick: every question looks at the whole circle.
"""

from __future__ import annotations

import copy
import hashlib
import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from meshsimp_pymoo.arrays import AnyArray, BoolArray, Csr, FloatArray, IntArray
from meshsimp_pymoo.surface import moves
from meshsimp_pymoo.surface.measures import OBJECTIVES, REGIONS, as_quality
from meshsimp_pymoo.surface.moves import answers
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.surface import Refitted, Scored, Simplified, Surface, View, checked_faces
from meshsimp_pymoo.workers import thread_pool


@dataclass(frozen=True, eq=False)
class Curve:
    """N points in convex position, counter-clockwise."""

    file_points: FloatArray
    name: str = "a circle"
    attributes: dict[str, AnyArray] = field(default_factory=dict)
    georeference: dict[str, Any] = field(default_factory=dict)
    found: dict[str, int] = field(default_factory=dict)
    material: None = None

    @property
    def n_vertices(self) -> int:
        """Number N of points."""
        return len(self.file_points)

    @property
    def faces(self) -> IntArray:
        """The fan over all of them."""
        return fan(np.arange(self.n_vertices))

    @property
    def file_box(self) -> FloatArray:
        """The box around the points."""
        return np.array([self.file_points.min(axis=0), self.file_points.max(axis=0)])

    @property
    def source_index(self) -> IntArray:
        """The points are in the order of the file."""
        return np.arange(self.n_vertices)

    @property
    def hash(self) -> str:
        """A checksum of the points."""
        return hashlib.sha256(np.ascontiguousarray(self.file_points).tobytes()).hexdigest()


class Circle:
    """A curve and the rules, of which only the measure counts here."""

    def __init__(self, model: Curve, rules: Rules | None = None) -> None:
        self.model = model
        self.rules = rules or Rules()
        self._ground: Round | None = None
        self.pinned: BoolArray = np.zeros(model.n_vertices, bool)
        self.pinned[[0, model.n_vertices // 3, 2 * model.n_vertices // 3]] = True

    @property
    def n_vertices(self) -> int:
        """Number N of points."""
        return self.model.n_vertices

    @property
    def points(self) -> FloatArray:
        """The points, as in the file."""
        return self.model.file_points

    @property
    def faces(self) -> IntArray:
        """The fan over all of them."""
        return self.model.faces

    @property
    def diagonal(self) -> float:
        """Diagonal of their bounding box."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def total_weight(self) -> float:
        """All points count alike."""
        return float(self.n_vertices)

    @property
    def neighbours(self) -> Csr:
        """The points before and after each."""
        i = np.arange(self.n_vertices)
        return 2 * np.arange(self.n_vertices + 1), np.sort(np.c_[i - 1, i + 1] % self.n_vertices, axis=1).ravel()

    @property
    def border(self) -> IntArray:
        """Any point brings one triangle only."""
        return np.arange(self.n_vertices)

    @property
    def places(self) -> FloatArray:
        """The points in the plane."""
        return self.points[:, :2]

    @property
    def view(self) -> View:
        """From above."""
        return View(np.ptp(self.points, axis=0), np.eye(3), self.points.min(axis=0))

    def selection(self, most: int) -> BoolArray:
        """Return every k-th point."""
        selected = self.pinned.copy()
        selected[:: -(-self.n_vertices // most)] = True
        return selected

    def triangles(self, kept: BoolArray) -> IntArray:
        """Return the fan over the kept points."""
        return self.simplify(kept).faces

    def evaluate(self, kept: BoolArray, *, threads: int = 1, regions: int = 0) -> FloatArray:
        """Return the table of numbers of subsets (P, N)."""

        def row(subset: BoolArray) -> FloatArray:
            n, n_all = int(subset.sum()), self.n_vertices
            if n < 3:
                return np.r_[[np.inf, 0, 0, np.inf, np.inf, n_all], np.full(regions, np.inf)]
            d = _deviations(self.places.ravel(), subset)
            region = np.bincount(np.arange(n_all) * regions // n_all, d, minlength=regions)[:regions]
            return np.r_[[d.sum(), n - 2, n, (d * d).sum(), d.max(), n_all - n], region]

        rows = np.atleast_2d(kept)
        found = list(thread_pool(threads).map(row, rows) if threads > 1 else map(row, rows))
        return np.array(found).reshape(len(rows), REGIONS + regions)

    def simplify(self, kept: BoolArray, *, rows: IntArray | None = None) -> Simplified:
        """Return the fan over the kept points."""
        if kept.sum() < 3:
            raise ValueError(f"{int(kept.sum())} points of {self.model.name} span no triangle")
        quality = as_quality(self.evaluate(kept)[0], self.total_weight)
        at = slice(None) if rows is None else rows
        deviation = _deviations(self.places.ravel(), kept)
        return Simplified(fan(np.flatnonzero(kept)), quality, deviation[at], kept[at].copy())

    def score(self, points: FloatArray, faces: IntArray) -> Scored:
        """Measure any mesh in the plane: the distance of each point to its nearest triangle."""
        d = np.full(self.n_vertices, np.inf)
        for corners in np.asarray(points, float)[np.asarray(faces)][:, :, :2]:
            for i, p in enumerate(self.places):
                sides = [_cross(corners[k], corners[(k + 1) % 3], p) for k in range(3)]
                near = min(_to_segment(p, corners[k], corners[(k + 1) % 3]) for k in range(3))
                d[i] = min(d[i], 0.0 if min(sides) >= 0 or max(sides) <= 0 else near)
        covered = d == 0
        row = [d.sum(), len(faces), len(np.unique(faces)), (d * d).sum(), d.max(), (~covered).sum()]
        return Scored(as_quality(np.array(row, float), self.total_weight), d, covered)

    def of_faces(self, faces: IntArray, *, rows: IntArray | None = None) -> Simplified:
        """Measure triangles of the points, of which a fan is only one way."""
        faces = checked_faces(faces, self.n_vertices)
        found = self.score(self.points, faces)
        at = slice(None) if rows is None else rows
        return Simplified(faces, found.quality, found.deviation[at], found.covered[at])

    def refit(self, mesh: Simplified, *, until: float | None = None) -> Refitted:
        """Return the mesh as it is: nothing moves here."""
        rows = np.unique(mesh.faces)
        error = mesh.quality.error
        return Refitted(mesh.faces, rows, self.points[rows], error, error, 0.0)

    def ground(self) -> Any | None:
        """Return the points and the measure."""
        if self._ground is not None:
            return self._ground
        measure = OBJECTIVES[self.rules.measure]
        return Round(np.ascontiguousarray(self.places.ravel()), measure.power, measure.is_sum)

    def free_ground(self, *, centroids: bool) -> None:
        """Return that its meshes follow from their vertices."""

    def measuring(self, measure: str) -> Surface:
        """Return the circle with another measure."""
        other = copy.copy(self)
        other.rules = replace(self.rules, measure=measure)
        return other

    def bounded(self, most: float, *, own: float = 0.0) -> Surface:
        """Return the circle for moves that bring all distances down to the most."""
        other = copy.copy(self)
        other.rules = replace(self.rules, measure="error")
        other._ground = self.ground()._replace(bound=float(most), own=float(own), is_sum=True)
        return other

    def spanning(self, kept: BoolArray) -> BoolArray:
        """Return the subset: there are no parts."""
        return kept

    @contextmanager
    def books(self, kept: BoolArray, *, fixed: BoolArray | None = None) -> Iterator[Any]:
        """Lend a record of the kept points; all are at places of their own."""
        books = Kept(kept.copy(), np.zeros(2))
        books.total[0] = _cost_of(self.ground(), books.site)
        yield books


class UnmovableCircle(Circle):
    """The same without moves: its meshes can be evaluated, that is all."""

    def ground(self) -> None:
        """Return that there is none."""
        return


def circle(n: int, *, seed: int = 1, kind: type[Circle] = Circle, **rules: Any) -> Surface:
    """Return a circle of n points at random angles."""
    angle = np.sort(np.random.default_rng(seed).random(n)) * 2 * np.pi
    return kind(Curve(np.c_[np.cos(angle), np.sin(angle), np.zeros(n)]), Rules(**rules))


def fan(rows: IntArray) -> IntArray:
    """Return the triangles (n - 2, 3) from the first of n rows to each two that follow each other."""
    return np.array([[rows[0], a, b] for a, b in itertools.pairwise(rows[1:])], np.int32).reshape(-1, 3)


def least_errors(surface: Surface) -> FloatArray:
    """Return the least error of a subset of each number of triangles, (N - 1,), by going once round the circle.

    The pinned point 0 begins and ends the way; no step goes past a pinned one.
    """
    n, xy, pinned = surface.n_vertices, surface.places, surface.pinned
    least = np.full((n + 1, n + 1), np.inf)  # [number of steps so far, where]
    least[0, 0] = 0.0
    for b in range(1, n + 1):
        for a in range(b - 1, -1, -1):
            cost = sum(_to_segment(xy[i], xy[a], xy[b % n]) for i in range(a + 1, b))
            least[1:, b] = np.minimum(least[1:, b], least[:-1, a] + cost)
            if pinned[a]:
                break
    return least[2:, n]


# ------------------------------------------------------------------------------------------------ what loops ask


class Round(NamedTuple):
    """What does not change."""

    xy: np.ndarray  # (2 N,) the points
    power: int  # to which the distance counts in the cost
    is_sum: bool  # whether the measure is the sum of the costs, not the largest distance
    bound: float = np.inf  # what distances exceed this by is added
    own: float = 1.0  # what the cost by the measure is multiplied by


class Kept(NamedTuple):
    """What changes."""

    site: np.ndarray  # (N,) whether a point is kept
    total: np.ndarray  # (2,) the sum of the costs, and the largest distance that the last trial has found in the end


@njit
def _cross(a: Any, b: Any, p: Any) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


@njit(nogil=True)
def _to_segment(p: Any, a: Any, b: Any) -> float:
    ux, uy, px, py = b[0] - a[0], b[1] - a[1], p[0] - a[0], p[1] - a[1]
    t = min(max((px * ux + py * uy) / (ux * ux + uy * uy), 0.0), 1.0)
    return np.hypot(px - t * ux, py - t * uy)


@njit(nogil=True)
def _next(site: np.ndarray, v: int, step: int) -> int:
    """Return the kept point after v (step 1) or before it (-1)."""
    v = (v + step) % len(site)
    while not site[v]:
        v = (v + step) % len(site)
    return v


@njit(nogil=True)
def _deviation(xy: np.ndarray, site: np.ndarray, i: int) -> float:
    if site[i]:
        return 0.0
    a, b = _next(site, i, -1), _next(site, i, 1)
    return _to_segment(xy[2 * i : 2 * i + 2], xy[2 * a : 2 * a + 2], xy[2 * b : 2 * b + 2])


@njit(nogil=True)
def _deviations(xy: np.ndarray, site: np.ndarray) -> np.ndarray:
    return np.array([_deviation(xy, site, i) for i in range(len(site))])


@njit(nogil=True)
def _cost(ground: Round, site: np.ndarray, i: int) -> float:
    d = _deviation(ground.xy, site, i)
    return ground.own * d**ground.power + max(d - ground.bound, 0.0)


@njit(nogil=True)
def _cost_of(ground: Round, site: np.ndarray) -> float:
    if site.sum() < 3:
        return np.inf
    total = 0.0
    for i in range(len(site)):
        total += _cost(ground, site, i)
    return total


@njit(nogil=True)
def _swap(site: np.ndarray, gone: int, come: int) -> None:
    if gone >= 0:
        site[gone] = False
    if come >= 0:
        site[come] = True


@answers(moves.total_cost, Round)
@njit(nogil=True)
def _total_cost(ground: Round, books: Kept) -> float:
    return books.total[0]


@answers(moves.error_now, Round)
@njit(nogil=True)
def _error_now(ground: Round, books: Kept) -> float:
    if ground.is_sum or books.site.sum() < 3:
        return books.total[0]
    return max([_deviation(ground.xy, books.site, i) for i in range(len(books.site))])


@answers(moves.ranked, Round)
@njit(nogil=True)
def _ranked(ground: Round, books: Kept, change: float) -> tuple[float, float]:
    if ground.is_sum or change == np.inf:
        return change, 0.0
    return books.total[1], change


@answers(moves.n_triangles, Round)
@njit(nogil=True)
def _n_triangles(ground: Round, books: Kept) -> int:
    return max(books.site.sum() - 2, 0)


@answers(moves.n_sites, Round)
@njit(nogil=True)
def _n_sites(ground: Round, books: Kept) -> int:
    return books.site.sum()


@answers(moves.is_site, Round)
@njit(nogil=True)
def _is_site(ground: Round, books: Kept, v: int) -> bool:
    return books.site[v]


@answers(moves.effort, Round)
@njit(nogil=True)
def _effort(ground: Round, books: Kept) -> int:
    return 2


@answers(moves.is_taken, Round)
@njit(nogil=True)
def _is_taken(ground: Round, books: Kept, w: int) -> bool:
    return books.site[w]


@njit(nogil=True)
def _cell_cost(ground: Round, books: Kept, a: int) -> float:
    """Return the cost of the cell of site a: the arc from it to the next one."""
    total = 0.0
    i = (a + 1) % len(books.site)
    while not books.site[i]:
        total += _cost(ground, books.site, i)
        i = (i + 1) % len(books.site)
    return total


@answers(moves.urgency, Round)
@njit(nogil=True)
def _urgency(ground: Round, books: Kept, v: int) -> float:
    return _cell_cost(ground, books, _next(books.site, v, -1))


@answers(moves.try_exchange, Round)
@njit(nogil=True)
def _try_exchange(ground: Round, books: Kept, v: int, w: int, limit: float) -> tuple[float, int]:
    _swap(books.site, v, w)
    change = _cost_of(ground, books.site) - books.total[0]
    if books.site.sum() >= 3:
        books.total[1] = max([_deviation(ground.xy, books.site, i) for i in range(len(books.site))])
    _swap(books.site, w, v)
    return change, (1 if w >= 0 else 0) - (1 if v >= 0 else 0)


@answers(moves.exchange, Round)
@njit(nogil=True)
def _exchange(ground: Round, books: Kept, v: int, w: int) -> bool:
    _swap(books.site, v, w)
    if books.site.sum() < 3:
        _swap(books.site, w, v)
        return False
    books.total[0] = _cost_of(ground, books.site)
    return True


@answers(moves.sites_around, Round)
@njit(nogil=True)
def _sites_around(ground: Round, books: Kept, v: int, found: np.ndarray) -> int:
    found[0], found[1] = _next(books.site, v, -1), _next(books.site, v, 1)
    return 2


@answers(moves.n_cells, Round)
@njit(nogil=True)
def _n_cells(ground: Round, books: Kept) -> int:
    return len(books.site)


@answers(moves.worst_in, Round)
@njit(nogil=True)
def _worst_in(ground: Round, books: Kept, cell: int) -> tuple[int, float, float]:
    n, worst, most = len(books.site), -1, 0.0
    if not books.site[cell]:
        return worst, most, 0.0
    i = (cell + 1) % n
    while not books.site[i]:
        cost = _cost(ground, books.site, i)
        if cost > most:
            worst, most = i, cost
        i = (i + 1) % n
    return worst, most, _cell_cost(ground, books, cell)


@answers(moves.cells_around, Round)
@njit(nogil=True)
def _cells_around(ground: Round, books: Kept, v: int, found: np.ndarray) -> int:
    found[0], found[1] = v, _next(books.site, v, -1)
    return 2
