"""One tile of a grid with gaps: a model of the samples that there are, with its own faces.

What a tile may do follows from circles, as in :mod:`~meshsimp_pymoo.tiles.thin`; but where there are gaps no circle is
asked for. A triangle outside the original faces lies in a gap, which counts as known to be empty, and so does what a
circle holds of blocks without samples, wherever they are: else the vertices along a gap that is longer than tiles would
stay to the end. So the *decisions* are not quite exact there: beside a gap another triangle may fill a star than the
tile believes, and the point of the mesh that is nearest to an uncovered sample may be in another tile. Where all of the
hull is covered, what a tile does not cover the whole does: there such a sample costs its distance, whatever the rule.
The numbers of the front are exact all the same, as they are measured afterwards over all samples.

The samples on a side that the tile shares with another are fixed, since both have them. Of each such side the first and
the last sample are sites in any case, so that the samples along it are covered; none are made up.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.emission import is_in_faces
from meshsimp_pymoo.plane.footprint import Footprint
from meshsimp_pymoo.plane.order import find_corners
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD
from meshsimp_pymoo.search.raster import raster_insertion
from meshsimp_pymoo.surface.books import END, Live
from meshsimp_pymoo.surface.grid import HeightGrid
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import placed_model
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.tiles.thin import (
    Elsewhere,
    Gaps,
    Samples,
    Setting,
    Tile,
    box_of,
    circle_of,
    is_within,
    thin_sites,
    with_rest,
    with_sites,
)

# Blocks along one side of a grid, at most, and samples along one side of a block, at least.
MOST_BLOCKS, LEAST_BLOCK = 256, 8
# Of the samples to begin with, the share that may lie along sides and gaps; else all are thinned.
BESIDE = 0.6


def blocks_of(grid: HeightGrid) -> Elsewhere | None:
    """Return in which blocks of a grid there are samples; None where there are no gaps."""
    lattice = grid.lattice
    if lattice is None:
        return None
    size = max(LEAST_BLOCK, -(-max(grid.shape) // MOST_BLOCKS))
    first = [np.arange(0, n, size) for n in grid.shape]
    some = np.zeros((len(first[0]), len(first[1])), bool)
    for top, end in lattice.bands():
        columns = np.logical_or.reduceat(lattice.rows(top, end), first[1], axis=1)
        np.logical_or.at(some, np.arange(top, end) // size, columns)
    before = np.zeros((some.shape[0], some.shape[1] + 1), np.int32)
    before[:, 1:] = some.cumsum(axis=1)
    y, x = (
        np.column_stack([places[at], places[np.minimum(at + size, len(places)) - 1]])
        for places, at in zip((grid.y, grid.x), first, strict=True)
    )
    return Elsewhere(x, y[:, ::-1], before)


def gaps_in(
    grid: HeightGrid,
    box: tuple[int, int, int, int],
    rows: IntArray,
    columns: IntArray,
    elsewhere: Elsewhere,
    rules: Rules,
) -> Gaps:
    """Return what a tile (first and last row, first and last column) needs to know of a grid's gaps.

    ``rows`` and ``columns`` are those of its samples that count.
    """
    lattice = grid.lattice
    assert lattice is not None
    there = lattice.at(rows[:, None], columns)
    footprint = lattice.footprint(grid.x, grid.y, box)
    return Gaps(there, lattice.count_in(*box) / max(int(there.sum()), 1), footprint, elsewhere, rules)


def start_with_gaps(tile: Tile) -> tuple[IntArray, FloatArray]:
    """Thin a tile to the end: from all its samples, or from those that insertion finds and all along sides and gaps.

    Returns
    -------
    samples : (m,) int array
        Numbers of the samples that are worth a look; the others were never inserted.
    level : (m,) float array
        The slope at which each goes, as :func:`thin_with_gaps` says; infinite: it does not.
    """
    setting = setting_with_gaps(tile)
    if setting is None:
        number = _samples(tile).number
        return number, np.full(len(number), np.inf)
    sparse = _inserted(tile, setting)
    setting = setting if sparse is None else sparse
    return with_rest(setting, *_thinned(setting, np.inf))


def _inserted(tile: Tile, setting: Setting) -> Setting | None:
    """Return a tile with the samples that insertion finds for sites; None: nearly all lie along sides and gaps.

    It begins with those, so that the same is covered; along a side that has all its samples no edge crosses it, as
    :func:`~meshsimp_pymoo.tiles.thin.start_tile` says, and what lies at a gap's end there is nearly so.
    """
    assert tile.gaps is not None
    there = tile.gaps.there
    padded = np.pad(there, 1)
    is_inside = there.copy()
    for down, right in np.ndindex(3, 3):
        is_inside &= padded[down : down + there.shape[0], right : right + there.shape[1]]
    row, column = np.divmod(setting.number, tile.n_columns)
    place = np.searchsorted(tile.rows, row) * there.shape[1] + np.searchsorted(tile.columns, column)
    first = place[~is_inside.ravel()[place]]  # in vector order
    most = int(tile.inserted / there.size * there.sum())
    if len(first) > BESIDE * most:
        return None
    try:
        found = raster_insertion(tile.x, tile.y, np.where(there, tile.heights, np.nan), first, most)
    except ValueError:  # samples on one line
        return None
    is_site = np.zeros(there.size, bool)
    is_site[found] = True
    stays = _staying(tile, setting.number, setting.surface.places)
    nothing = np.empty(0, bool)
    return setting._replace(is_site=is_site[place], judge=lambda live: (stays, nothing))


def thin_with_gaps(tile: Tile) -> tuple[IntArray, FloatArray]:
    """Do what :func:`~meshsimp_pymoo.tiles.thin.thin_tile` does, for a tile with ``gaps``."""
    setting = setting_with_gaps(tile)
    return (np.empty(0, np.int64), np.empty(0)) if setting is None else _thinned(setting, tile.limit)


def _thinned(setting: Setting, limit: float) -> tuple[IntArray, FloatArray]:
    """Thin a tile's sites to a slope; return the numbers of those that go, in their order, and their levels."""
    try:
        removed, level = thin_sites(setting, limit)
    except ValueError:  # what the books say of sites that span no triangle, and of nothing else
        return np.empty(0, np.int64), np.empty(0)
    n_wanted = int(np.searchsorted(level, np.inf))
    return setting.number[removed[:n_wanted]], level[:n_wanted]


def setting_with_gaps(tile: Tile) -> Setting | None:
    """Do what :func:`~meshsimp_pymoo.tiles.thin.setting_of` does; None: the tile has too few sites."""
    gaps = tile.gaps
    assert gaps is not None
    samples = _samples(tile)
    if samples.is_site.sum() < 3:
        return None
    number, xy, z, weight, is_site, is_ours = samples.in_vector_order()
    model = placed_model(
        tile.name,
        np.column_stack([xy * tile.unit, z]),
        np.empty((0, 3), np.int32),
        find_corners(xy),
        xy=xy,
        unit=tile.unit,
        source_index=number,
        weights=None if tile.stride == 1 else weight,
        footprint=gaps.footprint,
    )
    box, is_shared = _sides(tile)
    rules = gaps.rules
    if rules.footprint == "hull" and is_shared.any():
        rules = replace(rules, outside="nearest")
    surface = HeightSurface(model, rules)
    stay = _staying(tile, number, xy) | ~is_ours
    box = np.where(is_shared, box, np.array([-np.inf, np.inf, -np.inf, np.inf]))

    def judge(live: Live) -> tuple[BoolArray, BoolArray]:
        stays, is_foreign = stay.copy(), np.zeros(len(live.kind), bool)
        _find_beside_gaps(
            surface.ground().xy, live.mesh, int(live.tally[END]), ~is_ours, box, tile.domain, gaps.footprint,
            *gaps.elsewhere, stays, is_foreign,
        )  # fmt: skip
        return stays, is_foreign

    return Setting(surface, number, is_site, judge)


def _staying(tile: Tile, number: IntArray, xy: FloatArray) -> BoolArray:
    """Return which samples stay whatever the mesh is: the corners of the whole, and those on sides shared by tiles."""
    stays = np.isin(number, tile.corners)
    for k, (side, is_shared) in enumerate(zip(*_sides(tile), strict=True)):
        if is_shared:
            stays |= xy[:, k // 2] == side
    return stays


def _sides(tile: Tile) -> tuple[FloatArray, BoolArray]:
    """Return least and largest x, least and largest y of a tile, and which of these sides are another's too."""
    box, inward = box_of(tile), np.array([1.0, -1.0, 1.0, -1.0])
    return box, (box - tile.domain) * inward > 0.0


def _samples(tile: Tile) -> Samples:
    """Return a tile's samples and sites; the first and the last on a shared side are sites in any case."""
    gaps = tile.gaps
    assert gaps is not None
    row, column = np.nonzero(gaps.there)
    number = tile.rows[row] * tile.n_columns + tile.columns[column]
    xy, z = np.column_stack([tile.x[column], tile.y[row]]), tile.heights[row, column]
    found = with_sites(tile, number, xy, z, gaps.weight)
    kept = found.is_site.copy()
    for k, (side, is_shared) in enumerate(zip(*_sides(tile), strict=True)):
        on_side = np.flatnonzero(xy[:, k // 2] == side)
        if is_shared and len(on_side):
            ends = on_side[[0, -1]]
            found.is_ours[ends] = kept[ends]
            found.is_site[ends] = True
    return found


@inner
def _first_not_below(places: np.ndarray, sign: float, place: float) -> int:
    """Return the first of the ascending ``sign * places`` that is not below ``place``."""
    low = 0
    high = len(places)
    while low < high:
        middle = (low + high) >> 1
        if sign * places[middle] < place:
            low = middle + 1
        else:
            high = middle
    return low


@inner
def _holds_samples(
    sx: float, sy: float, rr: float, box: np.ndarray, x: np.ndarray, y: np.ndarray, before: np.ndarray
) -> bool:
    """Whether a circle touches blocks with samples that are not all in the box."""
    radius = np.sqrt(rr)
    # columns of blocks that lie in the box
    first_in = _first_not_below(x[:, 0], 1.0, box[0])
    end_in = _first_not_below(x[:, 1], 1.0, np.nextafter(box[1], np.inf))
    for row in range(_first_not_below(y[:, 0], -1.0, -(sy + radius)), len(y)):
        low, high = y[row, 0], y[row, 1]
        if high < sy - radius:
            break
        away = max(low - sy, sy - high, 0.0)
        reach = np.sqrt(max(rr - away * away, 0.0))
        first = _first_not_below(x[:, 1], 1.0, sx - reach)
        end = _first_not_below(x[:, 0], 1.0, np.nextafter(sx + reach, np.inf))
        if end <= first:
            continue
        n_some = before[row, end] - before[row, first]
        if low >= box[2] and high <= box[3]:
            first = max(first, first_in)
            end = min(end, end_in)
            if end > first:
                n_some -= before[row, end] - before[row, first]
        if n_some > 0:
            return True
    return False


@entry
def _find_beside_gaps(
    xy: np.ndarray,
    mesh: np.ndarray,
    end: int,
    foreign: np.ndarray,
    box: np.ndarray,
    domain: np.ndarray,
    footprint: Footprint,
    block_x: np.ndarray,
    block_y: np.ndarray,
    before: np.ndarray,
    stays: np.ndarray,
    is_foreign: np.ndarray,
) -> None:
    """Mark triangles on the original faces that need not be in the whole; see `thin._find_foreign`."""
    for t in range(0, end, RECORD):
        a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
        if (a | b | c) > LAST_INDEX or not is_in_faces(xy, footprint, xy, a, b, c):
            continue
        known = not (foreign[a] or foreign[b] or foreign[c])
        if known:
            sx, sy, rr = circle_of(xy, a, b, c)
            known = is_within(sx, sy, rr, box, domain) or not _holds_samples(sx, sy, rr, box, block_x, block_y, before)
        if not known:
            is_foreign[t // RECORD] = True
            stays[a] = True
            stays[b] = True
            stays[c] = True
