"""A triangulation in a user's hands: insert, remove and move vertices, and know the exact change of the error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, IntArray, require_bool
from meshsimp_pymoo.plane.faces import canonical_faces
from meshsimp_pymoo.plane.triangulation import RECORD
from meshsimp_pymoo.surface.books import EMITTED, END, N_EMITTED, PEAK, make_live, with_peaks
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.live import build, exchange_once, try_exchange_once
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.surface import error_of, movable_ground


class LiveTriangulation:
    """The triangulation of a subset that can be changed vertex by vertex, with its error always at hand.

    Parameters
    ----------
    surface : HeightSurface
        A model of N vertices and its rules; the measure of the rules is what ``error`` and all changes of it are in.
    kept : (N,) bool array
        The subset to begin with; it must span a triangle.

    Raises
    ------
    ValueError
        If ``kept`` has the wrong shape or spans no triangle, or this is a surface of another kind.

    Examples
    --------
    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.model import build_model
    >>> roof = HeightSurface(build_model(load("roof:3")))
    >>> live = LiveTriangulation(roof, roof.pinned)
    >>> live.error, live.triangles
    (3.0, 2)
    >>> ridge = np.flatnonzero(roof.points[:, 2] == 1.0)
    >>> live.try_insert(ridge[1])          # one end of the ridge, and half of its middle, and one triangle more
    (-1.5, 1)
    """

    def __init__(self, surface: HeightSurface, kept: BoolArray) -> None:
        self.ground: Ground = movable_ground(surface, "live triangulations")
        if not isinstance(surface, HeightSurface):
            raise ValueError(
                f"live triangulations are of height surfaces, not of a {type(surface).__name__}, whose vertices are "
                "moved by thinning, greedy_insertion and Relocation"
            )
        self.surface = surface
        self.model = model = surface.model
        kept = require_bool(kept, f"a subset of {model.name} is a bool array")
        if kept.shape != (model.n_vertices,):
            raise ValueError(f"a subset of {model.name} has shape ({model.n_vertices},), not {kept.shape}")
        live = make_live(model.n_vertices)
        self.live = with_peaks(live) if self.ground.by_peak else live
        self._kept = kept.copy()
        # Of several vertices at one position the first kept one is the site; `_group` numbers the positions.
        self._has_twins = self.ground.has_twins
        xy = model.xy
        self._group = np.cumsum(np.r_[True, (xy[1:] != xy[:-1]).any(axis=1)]) - 1 if self._has_twins else None
        build(self.ground, self.live, surface.sites(self._kept), model.name)

    def __repr__(self) -> str:
        return (
            f"<LiveTriangulation of {self.model.name}: {int(self._kept.sum()):,} of {len(self._kept):,} vertices kept, "
            f"{self.triangles:,} triangles, {self.surface.rules.measure} {self.error:.6g}>"
        )

    @property
    def kept(self) -> BoolArray:
        """The subset, as a new bool array (N,)."""
        return self._kept.copy()

    @property
    def error(self) -> float:
        """The error in the chosen measure [model units]."""
        return float(error_of(self.surface, self._total()))

    @property
    def triangles(self) -> int:
        """The number of emitted triangles."""
        return int(self.live.tally[N_EMITTED])

    @property
    def faces(self) -> IntArray:
        """The emitted triangles (M, 3) as rows of ``model.points``, the least row first, sorted."""
        end = int(self.live.tally[END])
        records = self.live.mesh[:end].reshape(-1, RECORD)[:, :3].astype(np.int64)
        records = records[(self.live.kind[: end // RECORD] & EMITTED) != 0]
        return canonical_faces(records)

    def insert(self, vertex: int) -> float:
        """Keep a vertex that is not kept; return the change of the error."""
        v = self._index(vertex, kept=False)
        before = self.error
        held = self._site_at(v)
        self._kept[v] = True
        if held is None:
            exchange_once(self.ground, self.live, -1, v)
        elif v < held:
            self._replace(held, v)
        return self.error - before

    def remove(self, vertex: int) -> float:
        """Drop a kept vertex; return the change of the error."""
        v = self._index(vertex, kept=True)
        before = self.error
        if self.live.site[v]:
            self._kept[v] = False
            heir = self._site_at(v, kept=True)
            if heir is not None:
                self._replace(v, heir)
            elif not exchange_once(self.ground, self.live, v, -1):
                self._kept[v] = True
                raise ValueError(f"without vertex {v} the kept vertices of {self.model.name} span no triangle")
        self._kept[v] = False
        return self.error - before

    def move(self, vertex: int, to: int) -> float:
        """Drop one vertex and keep another instead; return the change of the error."""
        self._index(to, kept=False)
        change = self.remove(vertex)
        return change + self.insert(to)

    def try_insert(self, vertex: int) -> tuple[float, int]:
        """Return the change of the error and of the number of triangles if the vertex were kept."""
        v = self._index(vertex, kept=False)
        if self._site_at(v) is not None:
            return self._tried(lambda: self.insert(v), lambda: self.remove(v))
        return self._try_exchange(-1, v)

    def try_remove(self, vertex: int) -> tuple[float, int]:
        """Return the change of the error and of the number of triangles if the vertex were dropped (inf: it cannot)."""
        v = self._index(vertex, kept=True)
        if self._has_twins:
            return self._tried(lambda: self.remove(v), lambda: self.insert(v))
        return self._try_exchange(v, -1)

    def try_move(self, vertex: int, to: int) -> tuple[float, int]:
        """Return the change of the error and of the number of triangles if one vertex were dropped for another."""
        if self._has_twins:
            return self._tried(lambda: self.move(vertex, to), lambda: self.move(to, vertex))
        v, w = self._index(vertex, kept=True), self._index(to, kept=False)
        return self._try_exchange(v, w)

    def _total(self) -> float:
        """Return the sum of the costs, or the largest deviation."""
        if not self.triangles:
            return np.inf
        if self.ground.by_peak:
            return float(self.live.peaks[1])
        # what rounding may leave below 0 is nothing
        return max(float(self.live.amount[:PEAK].sum()), 0.0)

    def _try_exchange(self, v: int, w: int) -> tuple[float, int]:
        """Return the change of the error and of the number of triangles if v went and w came; -1: none."""
        if self.ground.by_peak or not self.triangles:  # the largest deviation of all is known once it is done
            before, n = self.error, self.triangles
            if not exchange_once(self.ground, self.live, v, w):
                return np.inf, 0
            found = self.error - before, self.triangles - n
            exchange_once(self.ground, self.live, w, v)
            return found
        change, triangles = try_exchange_once(self.ground, self.live, v, w)
        if OBJECTIVES[self.surface.rules.measure].power == 2:
            change = error_of(self.surface, self._total() + change) - self.error
        return float(change), int(triangles)

    def _tried(self, do: Callable[[], float], undo: Callable[[], float]) -> tuple[float, int]:
        before, triangles = self.error, self.triangles
        do()
        result = self.error - before, self.triangles - triangles
        undo()
        return result

    def _replace(self, old: int, new: int) -> None:
        if not exchange_once(self.ground, self.live, old, -1):
            # With three sites left the triangulation is built anew.
            build(self.ground, self.live, self.surface.sites(self._kept), self.model.name)
            return
        exchange_once(self.ground, self.live, -1, new)

    def _site_at(self, v: int, *, kept: bool = False) -> int | None:
        """Return the site (or with ``kept`` the first kept vertex) at the position of v, if there is one."""
        if self._group is None:
            return None
        low, high = np.searchsorted(self._group, [self._group[v], self._group[v] + 1])
        rows = np.arange(low, high)
        rows = rows[self._kept[rows] if kept else self.live.site[rows] == 1]
        return int(rows[0]) if len(rows) else None

    def _index(self, vertex: int, *, kept: bool) -> int:
        v = int(vertex)
        if not 0 <= v < self.model.n_vertices:
            raise ValueError(f"vertex {v} is none of the {self.model.n_vertices} of {self.model.name}")
        if self._kept[v] != kept:
            raise ValueError(f"vertex {v} of {self.model.name} is {'not kept' if kept else 'kept already'}")
        return v
