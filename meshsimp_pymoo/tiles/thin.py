"""One tile: its own nested front while everything beyond it stays as it is.

A triangle of the tile's sites whose circle lies in the tile is a triangle of the whole triangulation, since no site
elsewhere can be in its circle. A site is *free* while all triangles around it are of that kind; it stays so while free
sites are removed, as what fills a star depends on the star alone [1]_. So thinning the free sites of a tile by the
exact change of its error is thinning of the whole, in another order; and as stars of free sites lie in their tile,
tiles can be thinned at the same time.

The change of the error is that over the samples of the tile, or over every second, fourth, ... row and column of them
(``stride``), each standing for the others: once a triangle covers hundreds of samples, they say the same.

References
----------
.. [1] O. Devillers, "On deletion in Delaunay triangulations", Int. J. Computational Geometry & Applications 12, 2002.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry, inner
from meshsimp_pymoo.plane.footprint import Footprint
from meshsimp_pymoo.plane.order import vector_order
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.greedy import thin
from meshsimp_pymoo.search.raster import raster_insertion
from meshsimp_pymoo.surface.books import END, Live
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import placed_model
from meshsimp_pymoo.surface.rules import Rules

# Thinning goes on beyond the wanted slope, by this factor, to see whether a cheaper way follows a dear step.
FORESIGHT = 3.0


class Elsewhere(NamedTuple):
    """In which blocks of rows and columns of a grid with gaps there are samples.

    Attributes
    ----------
    x, y : (B, 2) float arrays
        Least and largest coordinate of each column of blocks, ascending, and of each row, descending.
    before : (rows, columns + 1) int32 array
        How many blocks of a row that have samples there are before each.
    """

    x: np.ndarray
    y: np.ndarray
    before: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class Gaps:
    """What a tile of a grid with gaps needs to know beside.

    Attributes
    ----------
    there : (h, w) bool array
        Which of the samples that count there are.
    weight : float
        How many samples of the grid each stands for.
    footprint : Footprint
        The faces of the tile, of all its samples.
    elsewhere : Elsewhere
        Where there are samples in the whole grid.
    rules : Rules
        Which triangles are emitted, and what a sample costs that none covers.
    """

    there: BoolArray
    weight: float
    footprint: Footprint
    elsewhere: Elsewhere
    rules: Rules


@brief
@dataclass(frozen=True, eq=False)
class Tile:
    """What a tile's task needs to know: everything, so that it can be done on any machine.

    Attributes
    ----------
    name : str
        For messages.
    rows, columns : (h,), (w,) int arrays
        The samples that count, ascending, the tile's border included.
    heights : (h, w) float array
        Their heights [model units].
    x, y : (w,), (h,) float arrays
        Where the columns and rows are in the unit square.
    sites : (n,) int array, or None
        Numbers of the samples kept so far in the tile, ascending; None: all.
    site_xy, site_z : (n, 2), (n,) float arrays, or None
        Their coordinates and heights.
    n_columns : int
        Columns of the whole grid: sample ``row * n_columns + column``.
    corners : (C,) int array
        The whole grid's corner samples, which always stay.
    domain : (4,) float array
        The whole grid in the unit square: least and largest x, least and largest y.
    unit : float
        Side of the unit square [model units].
    stride : int
        Distance of the rows and columns that count.
    limit : float
        Error that a triangle may be worth, for it to go [model units]; infinite: all go.
    inserted : int
        How many samples there are to begin with, those of the tile's border included; where ``sites`` is None.
    gaps : Gaps, optional
        Of a grid with gaps, see :mod:`meshsimp_pymoo.tiles.gaps`.
    """

    name: str
    rows: IntArray
    columns: IntArray
    heights: FloatArray
    x: FloatArray
    y: FloatArray
    sites: IntArray | None
    site_xy: FloatArray | None
    site_z: FloatArray | None
    n_columns: int
    corners: IntArray
    domain: FloatArray
    unit: float
    stride: int
    limit: float
    inserted: int = 0
    gaps: Gaps | None = None


def start_tile(tile: Tile) -> tuple[IntArray, FloatArray]:
    """Thin a tile to the end: from all its samples, or from those that insertion finds and all of its border.

    Along a border that has all its samples no edge of the mesh crosses it, whatever is kept elsewhere: two samples
    beside one another have an empty circle. So the tile is a whole of its own.

    Parameters
    ----------
    tile : Tile
        The tile, without ``sites``.

    Returns
    -------
    samples : (m,) int array
        Numbers of the samples that are worth a look; the others were never inserted.
    level : (m,) float array
        The slope at which each goes, as :func:`thin_tile` says; infinite: never, along the border.
    """
    on_border = np.ones(tile.heights.shape, bool)
    on_border[1:-1, 1:-1] = False
    border = np.flatnonzero(on_border)
    number, xy, z = _window(tile)
    order = vector_order(xy, z)
    is_site = np.ones(len(z), bool)
    if tile.inserted < len(z):
        rank = np.argsort(order)
        first = order[np.sort(rank[border])]
        is_site[:] = False
        is_site[rank[raster_insertion(tile.x, tile.y, tile.heights, first, tile.inserted)]] = True
    surface = _surface(tile, number[order], xy[order], z[order], None)
    setting = Setting(surface, number[order], is_site, lambda live: (on_border.ravel()[order], np.empty(0, bool)))
    removed, level = thin_sites(setting, np.inf)
    return with_rest(setting, setting.number[removed], level)


def thin_tile(tile: Tile) -> tuple[IntArray, FloatArray]:
    """Thin the free sites of a tile.

    Parameters
    ----------
    tile : Tile
        The tile.

    Returns
    -------
    removed : (m,) int array
        Numbers of the samples that may go, in the order in which they go.
    level : (m,) float array
        The slope at which each goes: error for each triangle along the lower convex hull of the tile's own front,
        ascending, at most ``tile.limit`` [model units].
    """
    setting = setting_of(tile)
    removed, level = thin_sites(setting, tile.limit)
    return setting.number[removed], level


class Setting(NamedTuple):
    """A tile as thinning and moving see it.

    Attributes
    ----------
    surface : HeightSurface
        Its n samples that count and sites, in vector order.
    number : (n,) int array
        Their numbers.
    is_site : (n,) bool array
        Which are sites.
    judge : callable
        Given the books of the sites, returns which of them (n,) stay, and which triangles need not be triangles of the
        whole, a flag for each record.
    """

    surface: HeightSurface
    number: IntArray
    is_site: BoolArray
    judge: Callable[[Live], tuple[BoolArray, BoolArray]]


def setting_of(tile: Tile) -> Setting:
    """Return a tile as its sites can be changed: those at triangles that need not be triangles of the whole stay."""
    number, xy, z, weight, is_site, is_ours = _samples(tile).in_vector_order()
    surface = _surface(tile, number, xy, z, None if tile.stride == 1 else weight)
    # beyond the whole grid there is nothing that a circle could hold
    box = box_of(tile)
    open_sides = np.where(box == tile.domain, np.array([-np.inf, np.inf, -np.inf, np.inf]), box)

    def judge(live: Live) -> tuple[BoolArray, BoolArray]:
        stays, is_foreign = np.isin(number, tile.corners) | ~is_ours, np.zeros(len(live.kind), bool)
        xy, end = surface.ground().xy, int(live.tally[END])
        _find_foreign(xy, live.mesh, end, ~is_ours, open_sides, tile.domain, stays, is_foreign)
        return stays, is_foreign

    return Setting(surface, number, is_site, judge)


def thin_sites(setting: Setting, limit: float) -> tuple[IntArray, FloatArray]:
    """Thin the sites that may go to a slope; return which go, in their order, and their levels."""
    ground, is_site = setting.surface.ground(), setting.is_site
    with setting.surface.books(is_site) as live:
        fixed, _ = setting.judge(live)
        n = int((is_site & ~fixed).sum())
        removed, error, triangles = np.empty(n, np.int32), np.empty(n + 1), np.empty(n + 1, np.int32)
        stop = np.zeros(1, np.bool_)
        n_removed = thin(
            ground, live, len(is_site), fixed, 0, FORESIGHT * 2.0 * limit, np.inf, stop, removed, error, triangles
        )
    saved = (triangles[0] - triangles[: n_removed + 1]).astype(np.int64)
    level = hull_levels(saved, error[: n_removed + 1])
    n_wanted = int(np.searchsorted(level, limit, side="right"))
    return removed[:n_wanted], level[:n_wanted]


def with_rest(setting: Setting, removed: IntArray, level: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the numbers of a tile's sites, those that were not removed first, at an infinite level."""
    rest = np.setdiff1d(setting.number[setting.is_site], removed, assume_unique=True)
    return np.concatenate([rest, removed]), np.concatenate([np.full(len(rest), np.inf), level])


def hull_levels(saved: IntArray, error: FloatArray) -> FloatArray:
    """Return the slope of the lower convex hull under each step of a front.

    Parameters
    ----------
    saved : (m + 1,) int array
        Triangles saved so far, from 0: strictly ascending, but where a grid has gaps, whose triangles come and go.
    error : (m + 1,) float array
        Error there.

    Returns
    -------
    (m,) float array
        Ascending. Cutting at any slope s, after the last step of at most s, is the point of the front with the least
        error + s * triangles. Infinite for steps that end with more triangles and more error than an earlier point;
        a point with more triangles and less error than an earlier one is passed by.

    Examples
    --------
    The second step is dear, but the third one makes up for it: both are done at once, or neither.

    >>> hull_levels(np.arange(4), np.array([0.0, 1.0, 4.0, 5.0]))
    array([1., 2., 2.])
    """
    return _hull_levels(np.ascontiguousarray(saved, np.int64), np.ascontiguousarray(error, np.float64))


@entry
def _hull_levels(saved: np.ndarray, error: np.ndarray) -> np.ndarray:
    m = len(saved)
    hull = np.empty(m, np.int64)
    n = 0
    first = 0
    for k in range(m):
        if n > 0 and saved[k] <= saved[hull[n - 1]]:
            # nothing is saved on the way here: worth it where it costs less, but not less than nothing
            if saved[k] < saved[hull[n - 1]] or error[k] > error[hull[n - 1]]:
                continue
            n -= 1
            if n == 0:
                first = k
        while n >= 2:
            a = hull[n - 2]
            b = hull[n - 1]
            if (error[b] - error[a]) * (saved[k] - saved[a]) < (error[k] - error[a]) * (saved[b] - saved[a]):
                break
            n -= 1
        hull[n] = k
        n += 1
    level = np.empty(max(m - 1, 0))
    for k in range(hull[n - 1], m - 1):
        level[k] = np.inf
    for q in range(n - 1):
        a = hull[q]
        b = hull[q + 1]
        slope = (error[b] - error[a]) / (saved[b] - saved[a])
        for k in range(a, b):
            level[k] = slope
    for k in range(first):
        level[k] = min(level[first], 0.0) if first < m - 1 else 0.0
    # rounding may turn two almost equal slopes around
    for k in range(1, m - 1):
        level[k] = max(level[k], level[k - 1])
    return level


def _window(tile: Tile) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the samples of a tile that count, row by row: number, place, height."""
    number = (tile.rows[:, None] * tile.n_columns + tile.columns).ravel()
    xy = np.column_stack([np.tile(tile.x, len(tile.y)), np.repeat(tile.y, len(tile.x))])
    return number, xy, tile.heights.ravel()


class Samples(NamedTuple):
    """The samples of a tile that count, and the sites between them.

    Attributes
    ----------
    number : (n,) int array
        Their numbers.
    xy, z : (n, 2), (n,) float arrays
        Where they are in the unit square, and their heights [model units].
    weight : (n,) float array
        How many samples of the grid each stands for; a site between those that count for none.
    is_site : (n,) bool array
        Which are sites.
    is_ours : (n,) bool array
        All but the sites that are not kept: those are not ours to change, nor is anything at a triangle with them.
    """

    number: IntArray
    xy: FloatArray
    z: FloatArray
    weight: FloatArray
    is_site: BoolArray
    is_ours: BoolArray

    def in_vector_order(self) -> Samples:
        """Return them along the curve."""
        at = vector_order(self.xy, self.z)
        return Samples(
            self.number[at], self.xy[at], self.z[at], self.weight[at], self.is_site[at], self.is_ours[at]
        )  # fmt: skip


def with_sites(tile: Tile, number: IntArray, xy: FloatArray, z: FloatArray, weight: float) -> Samples:
    """Put the samples of a tile that count, each of this weight, and its sites together; without sites all are sites.

    What is returned are new arrays.
    """
    kept, n_extra = np.ones(len(z), bool), 0
    if tile.sites is not None and tile.site_xy is not None and tile.site_z is not None:
        kept = np.isin(number, tile.sites, assume_unique=True)
        extra = ~np.isin(tile.sites, number, assume_unique=True)
        n_extra = int(extra.sum())
        number = np.concatenate([number, tile.sites[extra]])
        xy = np.concatenate([xy, tile.site_xy[extra]])
        z = np.concatenate([z, tile.site_z[extra]])
    weights = np.concatenate([np.full(len(kept), weight), np.zeros(n_extra)])
    return Samples(number, xy, z, weights, np.concatenate([kept, np.ones(n_extra, bool)]), np.ones(len(z), bool))


def _samples(tile: Tile) -> Samples:
    """Return a tile's samples and sites; its corners are sites in any case, so that all samples are covered."""
    found = with_sites(tile, *_window(tile), float(tile.stride) ** 2)
    h, w = len(tile.rows), len(tile.columns)
    corner = np.array([0, w - 1, (h - 1) * w, h * w - 1])
    found.is_ours[corner] = found.is_site[corner]
    found.is_site[corner] = True
    return found


def box_of(tile: Tile) -> FloatArray:
    """Return the least and largest x, least and largest y of a tile."""
    return np.array([tile.x[0], tile.x[-1], tile.y[-1], tile.y[0]])


def _surface(tile: Tile, number: IntArray, xy: FloatArray, z: FloatArray, weight: FloatArray | None) -> HeightSurface:
    """Return the surface of a tile as a model: the arrays that triangulating needs, and two faces for its extent."""
    box = box_of(tile)
    corners = np.flatnonzero(np.isin(xy[:, 0], box[:2]) & np.isin(xy[:, 1], box[2:]))
    points = np.column_stack([xy * tile.unit, z])
    a, b, c, d = corners[np.lexsort((xy[corners, 0], xy[corners, 1]))]
    faces = np.array([[a, b, d], [a, d, c]])
    model = placed_model(tile.name, points, faces, corners, xy=xy, unit=tile.unit, source_index=number, weights=weight)
    return HeightSurface(model, Rules(footprint="hull", outside="ignore"))


@inner(inline=True)
def circle_of(xy: np.ndarray, a: int, b: int, c: int) -> tuple[float, float, float]:
    """Return the centre of the circle through three sites, and its radius squared."""
    ux = xy[2 * b] - xy[2 * a]
    uy = xy[2 * b + 1] - xy[2 * a + 1]
    vx = xy[2 * c] - xy[2 * a]
    vy = xy[2 * c + 1] - xy[2 * a + 1]
    area = 2.0 * (ux * vy - uy * vx)
    uu = ux * ux + uy * uy
    vv = vx * vx + vy * vy
    sx = (vy * uu - uy * vv) / area
    sy = (ux * vv - vx * uu) / area
    rr = sx * sx + sy * sy
    return sx + xy[2 * a], sy + xy[2 * a + 1], rr


@inner(inline=True)
def is_within(sx: float, sy: float, rr: float, box: np.ndarray, domain: np.ndarray) -> bool:
    """Whether a circle, as far as it lies within the whole grid, lies in a box: beyond its sides there is nothing."""
    over_x = max(max(sx - domain[1], domain[0] - sx), 0.0)
    over_y = max(max(sy - domain[3], domain[2] - sy), 0.0)
    reach_x = np.sqrt(max(rr - over_y * over_y, 0.0))
    reach_y = np.sqrt(max(rr - over_x * over_x, 0.0))
    known: bool = (
        sx - reach_x >= box[0] and sx + reach_x <= box[1] and sy - reach_y >= box[2] and sy + reach_y <= box[3]
    )
    return known


@entry
def _find_foreign(
    xy: np.ndarray,
    mesh: np.ndarray,
    end: int,
    foreign: np.ndarray,
    box: np.ndarray,
    domain: np.ndarray,
    stays: np.ndarray,
    is_foreign: np.ndarray,
) -> None:
    """Mark all triangles that need not be triangles of the whole, and their corners: these stay.

    ``box`` is what the tile knows of: least and largest x, least and largest y, infinite where the whole ends.
    """
    for t in range(0, end, RECORD):
        a, b, c = mesh[t], mesh[t + 1], mesh[t + 2]
        if (a | b | c) > LAST_INDEX:
            # A circle through both ends of an edge on the tile's side reaches beyond it: the triangle inside tells.
            continue
        known = not (foreign[a] or foreign[b] or foreign[c])
        if known:
            sx, sy, rr = circle_of(xy, a, b, c)
            known = is_within(sx, sy, rr, box, domain)
        if not known:
            is_foreign[t // RECORD] = True
            stays[a] = True
            stays[b] = True
            stays[c] = True
