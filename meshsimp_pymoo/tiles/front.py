"""The front of a height grid that is cut into tiles.

In the first phase each tile is thinned to the end, with all beyond it fixed: its own nested front. It begins with the
samples that insertion finds where these are much fewer than all. As both objectives add up over the tiles, the best of
all is put together by marginal analysis [1]_: that step comes first, whose error for each triangle saved is least.
Along the lower convex hull of a tile's front these slopes ascend, so the state of the whole at a slope s is each tile's
hull cut at s. What is lost is what lies off the hulls: where a tile's front bulges, its steps are done together or not
at all. Then the front has one point fewer; those that it has are as good.

The vertices along the tiles' edges were fixed, too many of them. So the same is done again with the tiles shifted by a
third of their side, and by two thirds: whatever lay along an edge lies inside a tile in one of three phases. From then
on each phase thins to a somewhat larger slope, cut otherwise than the one before. What goes in a phase makes rows of
the front, each a subset of the row before. When few vertices are left, tiles grow: every second row and column of
samples then stands for the others, and so on, until one tile holds the whole; it is thinned to the end. Tiles grow as
well where many phases came to nothing: so there are only so many of them, whatever the vertices are held by. The
vertices of the smallest solutions are moved then, each solution's for itself (see `meshsimp_pymoo.search.coarse`), and
if there is time those of larger ones (see `meshsimp_pymoo.tiles.moving`): these alone are no subsets of the ones
before.

The errors of the front are measured afterwards, for each row over all samples. Where a grid has gaps the triangles are
counted that are emitted, and tiles without samples are left out; see `meshsimp_pymoo.tiles.gaps`.

References
----------
.. [1] B. Fox, "Discrete optimization via marginal analysis", Management Science 13, 1966.
"""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.errors import ResultError, SearchWarning, reason_of
from meshsimp_pymoo.files import new_file
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.search.coarse import (
    MOVES,
    SAMPLES,
    SEARCHED,
    Coarse,
    CoarseGaps,
    CoarseGrid,
    move,
    slope_of,
    strided,
)
from meshsimp_pymoo.search.wishes import shortfall
from meshsimp_pymoo.settings import plain
from meshsimp_pymoo.surface.grid import HeightGrid
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.measures import MEASURES, Quality, quality_of
from meshsimp_pymoo.surface.nested import Nested
from meshsimp_pymoo.surface.rules import DEFAULT, Rules
from meshsimp_pymoo.surface.weld import measure, weld
from meshsimp_pymoo.tiles.gaps import blocks_of, gaps_in, start_with_gaps, thin_with_gaps
from meshsimp_pymoo.tiles.moving import Moving, move_sites
from meshsimp_pymoo.tiles.thin import Tile, start_tile, thin_tile
from meshsimp_pymoo.workers import Engine, Serial

#: Samples along one side of a tile.
TILE = 256
LEAST_TILE = 64
# The finest solution has at most this share of the grid's triangles, and at most so many, unless more are asked for.
FINEST = 0.1
MOST_TRIANGLES = 1_200_000
# From row to row the slope grows by this factor, the number of triangles falls by about a ninth; and rows of a phase,
# whose levels tell them apart.
SLOPE_STEP = 1.2
ROWS = 2
# Phases that thin less than this share of the vertices make no row; the next step is twice as large.
LEAST_CHANGE = 0.01
# After so many phases without one tiles grow.
MOST_IDLE = 10
# Samples for each vertex, above which only every second row and column of them is looked at.
ENOUGH_SAMPLES = 32
# Where one tile holds everything, each solution has this share of vertices less than the one before.
LAST_STEP = 0.1
# How far above the wanted size the finest solution may be.
ABOUT = 1.1
SHIFTS = (0.0, 1 / 3, 2 / 3)
# How often at most the vertices of larger solutions are moved, and what a number of a solution is less than.
MOST_SWEEPS = 100
SEEDS = 1 << 20
# Samples that are inserted to begin with, for each vertex of the finest row, and the least share of all samples:
# thinned from there a row has at most some 3 % more error than thinned from all (six DEMs). Where it would be more than
# the last share there is little to be saved, and all are thinned.
INSERTED, LEAST_INSERTED, MOST_INSERTED = 3.0, 0.15, 0.3
LOST = "a finished tile was stored, but is gone or damaged; start the same call again"

# Called with (share done, what is being done).
Progress = Callable[[float, str], None]


class InMemory:
    """Keeps finished pieces of work for this call only; see :class:`Folder`."""

    def __init__(self) -> None:
        self.pieces: dict[str, dict[str, npt.NDArray[Any]]] = {}

    def get(self, name: str) -> dict[str, npt.NDArray[Any]] | None:
        """Return a piece, or None."""
        return self.pieces.get(name)

    def put(self, name: str, **arrays: npt.NDArray[Any]) -> None:
        """Keep a piece."""
        self.pieces[name] = arrays

    def drop(self, start: str) -> None:
        """Forget the pieces whose names begin like this."""
        for name in [name for name in self.pieces if name.startswith(start)]:
            del self.pieces[name]


class Folder:
    """Keeps finished pieces of work in a folder, each whole or not at all, for a call that goes on.

    Parameters
    ----------
    path : Path
        The folder; made if need be.
    what : mapping
        What the pieces belong to: the grid and the settings.

    Raises
    ------
    ResultError
        If the folder holds pieces of something else.
    """

    def __init__(self, path: Path, what: dict[str, Any]) -> None:
        self.path = path
        record = path / "what.json"
        text = (json.dumps(what, indent=1, sort_keys=True) + "\n").encode("ascii")
        try:
            path.mkdir(parents=True, exist_ok=True)
            found = record.read_bytes() if record.exists() else None
        except OSError as problem:
            raise ResultError(f"{path}: cannot be made ({reason_of(problem)}); name another folder") from None
        if found not in (None, text):
            raise ResultError(
                f"{path}: holds unfinished tiles of another model or of other settings; name another folder, or allow "
                "overwriting (--overwrite) to begin anew"
            )
        if found is None:
            with new_file(record) as partial:
                partial.write_bytes(text)

    def get(self, name: str) -> dict[str, npt.NDArray[Any]] | None:
        """Return a piece; None if there is none, or it is damaged."""
        try:
            with (self.path / f"{name}.npz").open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                pieces = {key: file[key] for key in file.files}
            # an archive can lose an entry and look whole
            return pieces if sorted(pieces) == pieces.pop("names").tolist() else None
        except MemoryError:
            raise
        except Exception:  # absent, cut off or with flipped bits, which the archive's checksums tell: done again
            return None

    def put(self, name: str, **arrays: npt.NDArray[Any]) -> None:
        """Keep a piece."""
        way_out = "what is finished stays there: mend that, and the same call goes on"
        with new_file(self.path / f"{name}.npz", way_out=way_out) as partial:
            np.savez(partial, names=np.array(sorted([*arrays, "names"])), **arrays)  # type: ignore[arg-type]

    def drop(self, start: str) -> None:
        """Remove the pieces whose names begin like this."""
        for path in self.path.glob(f"{start}*.npz"):
            with suppress(OSError):  # it is in nobody's way
                path.unlink()


def usual_most(grid: HeightGrid) -> int:
    """Return the triangles of the finest solution where nothing else is asked for."""
    return max(2, min(int(FINEST * len(grid.faces)), MOST_TRIANGLES))


def identity(grid: HeightGrid, *, tile: int = TILE, most: int | None = None, rules: Rules = DEFAULT) -> dict[str, Any]:
    """Return what the pieces of a call of :func:`tiled_front` depend on, and check it.

    Raises
    ------
    ValueError
        If the tile or the finest solution is out of range.
    """
    if tile < LEAST_TILE:
        raise ValueError(f"tile is {tile}; a tile needs at least {LEAST_TILE} samples along its side")
    if most is not None and most < 2:
        raise ValueError(f"most is {most}; a mesh of the grid has at least 2 triangles")
    rules = rules.of_heights
    return {
        "model": grid.hash,
        # without gaps they make no difference
        **({} if grid.lattice is None else {"footprint": rules.footprint, "outside": rules.outside}),
        "tile": tile,
        "most": most or usual_most(grid),
        "slopes": [SLOPE_STEP, ROWS],
        "inserted": [INSERTED, LEAST_INSERTED, MOST_INSERTED],
        "enough_samples": ENOUGH_SAMPLES,
        "searched": [SEARCHED, SAMPLES, MOVES],
        "format": 4,
    }


def tiled_front(
    grid: HeightGrid,
    *,
    rules: Rules = DEFAULT,
    tile: int = TILE,
    most: int | None = None,
    engine: Engine | None = None,
    store: Folder | InMemory | None = None,
    threads: int = 1,
    progress: Progress | None = None,
    until: float | None = None,
    wish: Mapping[str, float] | None = None,
) -> Front:
    """Thin a height grid tile by tile to a whole front, nested but for solutions whose vertices are moved.

    Parameters
    ----------
    grid : HeightGrid
        The grid of N samples.
    rules : Rules
        What counts, as far as tiles know it; see :class:`~meshsimp_pymoo.surface.grid_surface.GridSurface`.
    tile : int
        Samples along one side of a tile. Memory: about 600 bytes for each sample of a tile and worker, and 40 bytes
        for each vertex of the finest solution.
    most : int, optional
        Triangles of the finest solution, about; by default a tenth of the grid's, but not above 1 200 000.
    engine : Engine, optional
        Where the tiles are thinned; in this process by default. The front does not depend on it.
    store : Folder or InMemory, optional
        Where finished tiles are kept; with a folder an interrupted call is continued.
    threads : int
        Threads that measure the solutions.
    progress : callable, optional
        Told about the progress.
    until : float, optional
        Vertices are moved as far as ``time.perf_counter() = until``: those of the smallest solutions first, then tile
        by tile those of the others, again and again. Thinning takes what it takes. Without it only those of the
        smallest are moved, once.
    wish : mapping of str to float, optional
        Limits, as :meth:`~meshsimp_pymoo.front.Front.best` takes them: with a number of triangles there is a solution
        of that size, and those near to what is wished for are moved first.

    Returns
    -------
    Front
        Of which :meth:`~meshsimp_pymoo.front.Front.best` makes a mesh of nearly any number of triangles.

    Warns
    -----
    SearchWarning
        If there was not the time to move the vertices of all small solutions, or of all larger ones.
    """
    what = identity(grid, tile=tile, most=most, rules=rules)
    surface = GridSurface(grid, rules)
    work = _Phases(grid, tile, engine or Serial(), store or InMemory(), progress or (lambda share, text: None), rules)
    n_wanted = work.vertices_of(what["most"])
    # A tile with few vertices could thin hardly any: all lie near its edge. So tiles this small begin finer.
    samples, slope = work.start(max(n_wanted, grid.n_vertices // ENOUGH_SAMPLES))
    level = np.full(len(samples), np.inf)
    slopes = [slope]
    n_kept, n_row = len(samples), len(samples)
    phase, stride, step, n_idle = len(SHIFTS), 1, SLOPE_STEP**ROWS, 0
    while True:
        if n_idle == MOST_IDLE:
            stride, step, n_idle = 2 * stride, SLOPE_STEP**ROWS, 0
        while ENOUGH_SAMPLES * stride**2 * n_kept < grid.n_vertices:
            stride *= 2
        if work.is_one_tile(stride):
            break
        before, slope = slope, slope * step
        removed, at = work.phase(phase, stride, slope, samples[np.isinf(level)])
        level[np.searchsorted(samples, removed)] = np.minimum(_above(before, at), slope)
        phase += 1
        n_kept -= len(removed)
        if n_kept <= (1.0 - LEAST_CHANGE) * n_row:
            slopes += np.geomspace(before, slope, ROWS + 1)[1:].tolist()
            n_row, step, n_idle = n_kept, SLOPE_STEP**ROWS, 0
        else:
            step *= 2.0
            n_idle += 1
    removed, at = work.finish(stride, samples[np.isinf(level)])
    cuts = _last_cuts(at, n_kept - len(removed))
    at = _above(slope, _ascending(at))
    level[np.searchsorted(samples, removed)] = at
    slopes += at[cuts - 1].tolist()
    # what is finer than asked for was needed on the way only
    slopes = work.of_about(what["most"], samples, level, slopes)
    samples, level = samples[level > slopes[0]], level[level > slopes[0]]
    if wish and "triangles" in wish:
        nested = Nested(grid.rows_of_samples(samples), level, np.array(slopes), (None,) * len(slopes))
        with suppress(ValueError):  # there is none that small
            slopes = sorted({*slopes, slope_of(surface, nested, min(int(wish["triangles"]), what["most"]))})
    moved = work.move(slopes, [samples[level > at] for at in slopes], until)
    solutions = [samples[level > at] if new is None else new for at, new in zip(slopes, moved, strict=True)]
    quality = work.measure(slopes, solutions, threads)
    if until is not None:
        work.move_large(slopes, solutions, moved, quality, _nearest_first(quality, wish or {}), until, threads)
    # a solution that is not better than a smaller one is none
    rows: list[int] = []
    for row in reversed(range(len(slopes))):
        if not rows or (
            quality[row].triangles > quality[rows[-1]].triangles and quality[row].error < quality[rows[-1]].error
        ):
            rows.append(row)
    new = [None if kept is None else grid.rows_of_samples(kept) for kept in moved]
    nested = Nested(grid.rows_of_samples(samples), level, np.array(slopes), tuple(new)).take(rows)
    return Front([quality[row] for row in rows], nested, surface=surface, run={"options": plain(grid.options)})


def _above(slope: float, level: FloatArray) -> FloatArray:
    """Raise levels that are not above a slope to just above it, in their order."""
    low = np.flatnonzero(level <= slope)
    rank = np.empty(len(low))
    rank[np.argsort(level[low], kind="stable")] = np.arange(1, len(low) + 1)
    raised = level.copy()
    raised[low] = slope * (1.0 + rank * 1e-12)
    return raised


def _ascending(level: FloatArray) -> FloatArray:
    """Lower levels that do not descend by next to nothing, so that each is above the one before.

    Then a front can be cut between any two vertices, off the hulls too: all of them are meshes.
    """
    n_after = np.arange(len(level))[::-1]
    return level - np.abs(level) * n_after * 1e-12


def _last_cuts(level: FloatArray, n_last: int) -> IntArray:
    """Return how many samples are gone in each of the last solutions: along the hull, but with steps that are not long.

    Parameters
    ----------
    level : (n,) float array
        Ascending; samples of one level belong to one side of the hull.
    n_last : int
        Samples that never go.
    """
    on_hull = np.flatnonzero(np.r_[level[1:] > level[:-1], True]) + 1
    cuts = []
    n_gone = 0
    while n_gone < len(level):
        step = max(1, int(LAST_STEP * (len(level) - n_gone + n_last)))
        near = on_hull[(on_hull > n_gone) & (on_hull <= n_gone + 2 * step)]
        n_gone = int(near[np.argmin(np.abs(near - n_gone - step))]) if len(near) else n_gone + step
        cuts.append(n_gone)
    return np.array(cuts, np.int64)


def cut_axis(n: int, tile: int, shift: float, stride: int = 1) -> IntArray:
    """Return the samples along one axis at which tiles begin and end.

    Parameters
    ----------
    n : int
        Samples along the axis.
    tile : int
        Wanted number of samples that count along a tile's side; the true one is 2/3 to 3/2 of it.
    shift : float
        Share of a tile's side by which all inner cuts are shifted.
    stride : int
        Every how many samples one counts; cuts are at those.

    Returns
    -------
    (k,) int array
        Ascending, from 0 to n - 1.

    Examples
    --------
    >>> cut_axis(301, 100, 0.0).tolist(), cut_axis(301, 100, 1 / 3).tolist()
    ([0, 100, 200, 300], [0, 133, 233, 300])
    """
    number = max(1, round((n - 1) / (tile * stride)))
    size = (n - 1) / number
    inner = np.round((np.arange(number) + shift) * size / stride).astype(np.int64) * stride
    away = (inner >= 0.5 * size) & (inner <= n - 1 - 0.5 * size)
    return np.array([0, *inner[away & (number > 1)], n - 1], np.int64)


class _Phases:
    """One call's work on a grid."""

    def __init__(
        self,
        grid: HeightGrid,
        tile: int,
        engine: Engine,
        store: Folder | InMemory,
        progress: Progress,
        rules: Rules = DEFAULT,
    ) -> None:
        self.grid, self.rules = grid, rules.of_heights
        self.tile = tile
        self.engine = engine
        self.store = store
        self.progress = progress
        self.elsewhere = blocks_of(grid)

    def vertices_of(self, triangles: int) -> int:
        """Return about how many vertices a mesh of so many triangles has."""
        if self.grid.lattice is None:
            return triangles // 2
        return -(-triangles * self.grid.n_vertices // len(self.grid.faces))

    def triangles_of(self, kept: IntArray) -> int:
        """Return how many triangles the mesh of these samples has."""
        if self.grid.lattice is None:
            return int(self.grid.triangles_of(kept).sum()) - 2
        return weld(self.grid, kept, self.rules).n_triangles

    def of_about(self, most: int, samples: IntArray, level: FloatArray, slopes: list[float]) -> list[float]:
        """Return the slopes of the solutions of about so many triangles and less: the others were on the way only."""
        if self.grid.lattice is None:
            n_left = len(level) - np.searchsorted(np.sort(level), slopes, side="right")
            n_most = max(ABOUT * (most // 2), len(self.grid.corners))
            return slopes[int(np.argmax(n_left <= n_most)) :]
        counts = np.array([self.triangles_of(samples[level > at]) for at in slopes])
        # where they lie in gaps altogether it is no mesh
        first = int(np.argmax((counts > 0) & (counts <= max(ABOUT * most, counts[counts > 0].min()))))
        return [at for at, count in zip(slopes[first:], counts[first:], strict=True) if count > 0]

    def is_one_tile(self, stride: int) -> bool:
        """Whether at this stride one tile holds the whole."""
        return all(len(cut_axis(n, self.tile, 0.0, stride)) == 2 for n in self.grid.shape)

    def boxes(self, shift: float, stride: int) -> list[tuple[int, int, int, int]]:
        """Return first and last row, first and last column of each tile that has samples."""
        rows, columns = (cut_axis(n, self.tile, shift, stride).tolist() for n in self.grid.shape)
        boxes = [(top, bottom, left, right) for top, bottom in pairwise(rows) for left, right in pairwise(columns)]
        lattice = self.grid.lattice
        return boxes if lattice is None else [box for box in boxes if lattice.has_any(*box)]

    def n_samples(self, box: tuple[int, int, int, int]) -> int:
        """Return how many samples a tile has."""
        top, bottom, left, right = box
        lattice = self.grid.lattice
        return (bottom - top + 1) * (right - left + 1) if lattice is None else lattice.count_in(*box)

    def task(
        self, box: tuple[int, int, int, int], stride: int, limit: float, kept: IntArray | None, inserted: float = 1.0
    ) -> Tile:
        """Return what a tile's task needs to know."""
        grid, n_columns = self.grid, self.grid.shape[1]
        top, bottom, left, right = box
        rows, columns = strided(top, bottom, stride), strided(left, right, stride)
        sites = site_xy = site_z = None
        if kept is not None:
            low, high = np.searchsorted(kept, [top * n_columns, (bottom + 1) * n_columns])
            column = kept[low:high] % n_columns
            sites = kept[low:high][(column >= left) & (column <= right)]
            site_xy, site_z = grid.xy_at(sites), grid.height_at(sites)
        return Tile(
            name=f"{grid.name}, rows {top} to {bottom}, columns {left} to {right}",
            rows=rows,
            columns=columns,
            heights=grid.window(rows, columns),
            x=grid.x[columns],
            y=grid.y[rows],
            sites=sites,
            site_xy=site_xy,
            site_z=site_z,
            n_columns=n_columns,
            corners=grid.corners,
            domain=grid.domain,
            unit=grid.unit,
            stride=stride,
            limit=limit,
            inserted=int(inserted * len(rows) * len(columns)),
            gaps=None
            if self.elsewhere is None
            else gaps_in(grid, box, rows, columns, elsewhere=self.elsewhere, rules=self.rules),
        )

    def thin(
        self, name: str, shift: float, stride: int, limit: float, kept: IntArray | None, inserted: float = 1.0
    ) -> Iterator[tuple[int, IntArray, FloatArray]]:
        """Thin all tiles that are not in the store; yield (tile, samples, level) of all, in their order."""
        boxes = self.boxes(shift, stride)
        missing = [k for k in range(len(boxes)) if self.store.get(f"{name}_{k}") is None]
        n_done = len(boxes) - len(missing)
        tasks = (self.task(boxes[k], stride, limit, kept, inserted) for k in missing)
        for place, (samples, level) in self.engine.each(_start if kept is None else _thin, tasks):
            self.store.put(f"{name}_{missing[place]}", samples=samples, level=level)
            n_done += 1
            n_left = 1.0 if kept is None else len(kept) / self.grid.n_vertices
            share = 0.6 * n_done / len(boxes) if kept is None else 0.6 + 0.2 * (1.0 - n_left) ** 8
            self.progress(share, f"tile {n_done} of {len(boxes)}")
        for k in range(len(boxes)):
            piece = self.store.get(f"{name}_{k}")
            if piece is None:
                raise ResultError(f"{self.grid.name}: {LOST}")
            yield k, piece["samples"], piece["level"]

    def start(self, n_vertices: int) -> tuple[IntArray, float]:
        """Return the finest row: thin all tiles to the end, find the slope, and go over the tiles' edges."""
        stored = self.store.get("start")
        if stored is not None:
            return stored["kept"], float(stored["slope"])
        n = self.grid.n_vertices
        boxes = self.boxes(SHIFTS[0], 1)
        inserted = max(INSERTED * n_vertices / n, LEAST_INSERTED)
        if inserted > MOST_INSERTED:
            inserted = 1.0
        histogram = np.zeros(1 << 16, np.int64)
        greatest, n_free = 0.0, 0
        for k, _, level in self.thin("start", SHIFTS[0], 1, np.inf, None, inserted):
            free = level[np.isfinite(level)]
            n_free += self.n_samples(boxes[k]) - (len(level) - len(free))
            histogram += np.bincount(_bins(free), minlength=len(histogram))
            greatest = max(greatest, float(free.max(initial=0.0)))
        # What the finest row is to keep, of the vertices that were free; those that were not will be in their turn.
        most = n_free * n_vertices / n
        above = histogram[::-1].cumsum()[::-1]
        # the least bin such that no more than wanted are above it
        bin_ = int(np.argmax(np.r_[above[1:], 0] <= most))
        slope = max(_bin_end(bin_), 1e-9 * greatest) or 1.0
        keep = np.zeros(self.grid.shape[0] * self.grid.shape[1], bool)
        for _, samples, level in self.thin("start", SHIFTS[0], 1, np.inf, None, inserted):
            keep[samples[level > slope]] = True
        kept = np.flatnonzero(keep)
        del keep
        for phase in range(1, len(SHIFTS)):
            removed, _ = self.phase(phase, 1, slope, kept)
            kept = np.setdiff1d(kept, removed, assume_unique=True)
        self.store.put("start", kept=kept, slope=np.array(slope))
        self.store.drop("start_")
        return kept, slope

    def phase(self, phase: int, stride: int, slope: float, kept: IntArray) -> tuple[IntArray, FloatArray]:
        """Thin the tiles of a phase to a slope; return the samples in the order in which they go, and their levels."""
        name = f"phase_{phase:04d}"
        stored = self.store.get(name)
        if stored is None:
            found = [piece[1:] for piece in self.thin(name, SHIFTS[phase % len(SHIFTS)], stride, slope, kept)]
            removed, level = (np.concatenate(column) for column in zip(*found, strict=True))
            order = np.argsort(level, kind="stable")
            stored = {"removed": removed[order], "level": _ascending(level[order])}
            self.store.put(name, **stored)
            self.store.drop(f"{name}_")
        return stored["removed"], stored["level"]

    def finish(self, stride: int, kept: IntArray) -> tuple[IntArray, FloatArray]:
        """Thin what is left to the end, as one tile; return the samples in the order in which they go, and levels."""
        stored = self.store.get("finish")
        if stored is None:
            (box,) = self.boxes(0.0, stride)
            ((_, (removed, level)),) = self.engine.each(_thin, [self.task(box, stride, np.inf, kept)])
            stored = {"removed": removed, "level": level}
            self.store.put("finish", **stored)
        return stored["removed"], stored["level"]

    def move(self, slopes: list[float], solutions: list[IntArray], until: float | None) -> list[IntArray | None]:
        """Move the vertices of the solutions that are small, but for the smallest there is, as far as the time goes."""
        small = [
            k
            for k, kept in enumerate(solutions)
            if len(kept) > len(self.grid.corners) and self.triangles_of(kept) <= SEARCHED
        ]
        moved: list[IntArray | None] = [None] * len(solutions)
        if not small:
            return moved
        coarse = CoarseGrid(self.grid, self.rules)
        missing = [k for k in small if self.store.get(_name("moved", slopes[k])) is None]
        in_time = (k for k in missing if until is None or time.perf_counter() < until)
        tasks = (coarse.task(solutions[k], self.triangles_of(solutions[k])) for k in in_time)
        for place, rows in self.engine.each(_move, tasks, coarse.gaps):
            self.store.put(_name("moved", slopes[missing[place]]), samples=np.sort(coarse.samples[rows]))
            self.progress(0.8, f"small solution {place + 1} of {len(missing)}")
        n_left = 0
        for k in small:
            piece = self.store.get(_name("moved", slopes[k]))
            if piece is not None:
                moved[k] = piece["samples"]
            elif until is None:
                raise ResultError(f"{self.grid.name}: {LOST}")
            else:
                n_left += 1
        if n_left:
            warnings.warn(
                f"{self.grid.name}: the time was up before the vertices of {n_left} of {len(small)} small solutions "
                "were moved, which makes them better; give more time",
                SearchWarning,
                stacklevel=2,
            )
        return moved

    def move_large(
        self,
        slopes: list[float],
        solutions: list[IntArray],
        moved: list[IntArray | None],
        quality: list[Quality],
        order: list[int],
        until: float,
        threads: int,
    ) -> None:
        """Move the vertices of the solutions not small nor exact, in this order, again and again while there is time.

        What is better replaces the entries of ``solutions``, ``moved`` and ``quality``, and is stored for a call that
        goes on.
        """
        order = [k for k in order if quality[k].triangles > SEARCHED and quality[k].error > 0.0]
        seconds = {k: 0.0 for k in order}

        def take(k: int, found: IntArray, better: Quality) -> None:
            if better.error < quality[k].error and better.triangles <= quality[k].triangles:
                solutions[k], moved[k], quality[k] = found, found, better

        for k in order:
            stored = self.store.get(_name("larger", slopes[k]))
            if stored is not None:
                take(k, stored["samples"], quality_of(zip(MEASURES, stored["numbers"].tolist(), strict=True)))
        for sweep in range(MOST_SWEEPS):
            for k in order:
                begun = time.perf_counter()
                if begun + seconds[k] > until:
                    continue
                found = self.moved_by_tiles(solutions[k], SEEDS * sweep + k, until)
                if found is None:
                    continue
                take(k, found, measure(self.grid, weld(self.grid, found, self.rules), n_threads=threads))
                if solutions[k] is found:
                    self.store.put(_name("larger", slopes[k]), samples=found, numbers=_numbers(quality[k]))
                seconds[k] = time.perf_counter() - begun
                self.progress(1.0, f"solution of {quality[k].triangles:,} triangles moved")
            if all(time.perf_counter() + took > until for took in seconds.values()):
                break
        n_moved = sum(took > 0.0 for took in seconds.values())
        if n_moved < len(order):
            warnings.warn(
                f"{self.grid.name}: in the time given the vertices of {n_moved} of {len(order)} solutions of more than "
                f"{SEARCHED} triangles were moved, which makes them better; give more time",
                SearchWarning,
                stacklevel=2,
            )

    def moved_by_tiles(self, kept: IntArray, seed: int, until: float) -> IntArray | None:
        """Move the vertices of a solution, in tiles at all their places; None: there was not the time."""
        stride = 1
        while ENOUGH_SAMPLES * (2 * stride) ** 2 * len(kept) < self.grid.n_vertices:
            stride *= 2
        for pass_, shift in enumerate(SHIFTS):
            boxes = self.boxes(shift, stride)
            tasks = (
                Moving(self.task(box, stride, np.inf, kept), 1 + (seed * len(SHIFTS) + pass_) * len(boxes) + k)
                for k, box in enumerate(boxes)
                if time.perf_counter() < until
            )
            found = [result for _, result in self.engine.each(_move_sites, tasks)]
            if len(found) < len(boxes):
                return None
            gone, come = (np.concatenate(column) for column in zip(*found, strict=True))
            kept = np.union1d(np.setdiff1d(kept, gone, assume_unique=True), come)
        return kept

    def measure(self, slopes: list[float], solutions: list[IntArray], threads: int) -> list[Quality]:
        """Measure solutions over all samples."""
        quality = []
        for k, (slope, kept) in enumerate(zip(slopes, solutions, strict=True)):
            name = _name("quality", slope)
            stored = self.store.get(name)
            if stored is None:
                q = measure(self.grid, weld(self.grid, kept, self.rules), n_threads=threads)
                self.store.put(name, numbers=_numbers(q))
            else:
                q = quality_of(zip(MEASURES, stored["numbers"].tolist(), strict=True))
            quality.append(q)
            self.progress(0.8 + 0.2 * (k + 1) / len(solutions), f"solution {k + 1} of {len(solutions)} measured")
        return quality


def _numbers(quality: Quality) -> FloatArray:
    return np.array(list(asdict(quality).values()), np.float64)


def _name(what: str, slope: float) -> str:
    """Return the name of a piece that belongs to the solution at a slope."""
    return f"{what}_{float(slope).hex()}"


def _start(task: Tile, shared: None) -> tuple[IntArray, FloatArray]:
    return start_tile(task) if task.gaps is None or task.gaps.there.all() else start_with_gaps(task)


def _thin(task: Tile, shared: None) -> tuple[IntArray, FloatArray]:
    return thin_tile(task) if task.gaps is None else thin_with_gaps(task)


def _move_sites(task: Moving, shared: None) -> tuple[IntArray, IntArray]:
    return move_sites(task)


def _move(task: Coarse, shared: CoarseGaps | None) -> IntArray:
    return move(task, shared)


def _nearest_first(quality: list[Quality], wish: Mapping[str, float]) -> list[int]:
    """Return the rows of solutions, those near to the one that is wished for first; without a wish the smallest."""
    by_size = sorted(range(len(quality)), key=lambda k: quality[k].triangles)
    if not wish:
        return by_size
    within = [place for place, k in enumerate(by_size) if shortfall(asdict(quality[k]), wish) == 0.0]
    wanted = (within[-1] if "triangles" in wish else within[0]) if within else len(by_size) - 1
    return [by_size[place] for place in sorted(range(len(by_size)), key=lambda place: (abs(place - wanted), place))]


def _bins(level: FloatArray) -> IntArray:
    """Return the number of the bin of each level: equal ratios of 2**-8 or less, 0 for what is not positive."""
    return (np.maximum(level, 0.0).astype(np.float32).view(np.int32) >> 15).astype(np.int64)


def _bin_end(bin_: int) -> float:
    """Return the greatest number of a bin."""
    return float(np.array([((bin_ + 1) << 15) - 1], np.int32).view(np.float32)[0])
