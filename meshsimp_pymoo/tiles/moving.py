"""The vertices of a large solution moved for less error, tile by tile.

Each tile is a window on the whole: the sites at triangles that need not be triangles of the whole stay, as in
:mod:`meshsimp_pymoo.tiles.thin`, and none is moved into these. What a move beside them changes is only nearly what it
changes in the whole, and neighbouring tiles do not know of it: so what the tiles find together is measured, and taken
only where it is better.

Each tile looks at every second, fourth, ... row and column of samples as thinning does, and vertices move to these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshsimp_pymoo.arrays import Csr, IntArray
from meshsimp_pymoo.plane.order import find_corners
from meshsimp_pymoo.plane.triangulation import RECORD
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.local_search import annealed
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import placed_model
from meshsimp_pymoo.tiles.gaps import setting_with_gaps
from meshsimp_pymoo.tiles.thin import Setting, Tile, setting_of

# For each vertex and pass, of which there are as many as the tiles have places.
MOVES = 30
# In units of the error per vertex, and the share left in the end.
TEMPERATURE, COOLING = 0.1, 0.1
STEPS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


@brief
@dataclass(frozen=True, eq=False)
class Moving:
    """A tile whose sites are to be moved.

    Attributes
    ----------
    tile : Tile
        The tile.
    seed : int
        Of the random moves, 1 or more.
    """

    tile: Tile
    seed: int


def move_sites(task: Moving) -> tuple[IntArray, IntArray]:
    """Move the free sites of a tile while that lowers its error: annealing at no more triangles.

    Parameters
    ----------
    task : Moving
        The tile.

    Returns
    -------
    gone, come : int arrays
        Numbers of the samples that are sites no more, and of those that are now, ascending.
    """
    tile, nothing = task.tile, np.empty(0, np.int64)
    whole = setting_of(tile) if tile.gaps is None else setting_with_gaps(tile)
    if whole is None:
        return nothing, nothing
    try:
        setting = _to_move(whole)
    except ValueError:  # what the books say of sites that span no triangle, and of nothing else
        return nothing, nothing
    number, sites = setting.number, setting.is_site
    with setting.surface.books(sites) as books:
        fixed, _ = setting.judge(books)
        found = annealed(
            setting.surface.ground(),
            books,
            fixed,
            np.empty(0, np.int64),  # what has one triangle is at the outline, which stays
            _beside(tile, number),
            moves=MOVES * int(np.count_nonzero(sites & ~fixed)),
            temperature=TEMPERATURE,
            cooling=COOLING,
            state=np.array([task.seed], np.uint64),
        )
    return np.sort(number[sites & ~found]), np.sort(number[found & ~sites])


def _to_move(whole: Setting) -> Setting:
    """Leave out the samples in triangles that need not be triangles of the whole.

    What came there would change other tiles too; on a side that is another's it would be worth a triangle here and two
    in the whole.
    """
    with whole.surface.books(whole.is_site) as live:
        stays, is_foreign = whole.judge(live)
        here, others = whole.is_site.copy(), np.flatnonzero(~whole.is_site)
        here[others] = ~is_foreign[live.place[others] // RECORD]
    model, rules = whole.surface.model, whole.surface.rules
    part = placed_model(
        model.name,
        model.points[here],
        np.empty((0, 3), np.int32),
        find_corners(model.xy[here]),
        xy=model.xy[here],
        unit=model.unit,
        source_index=model.source_index[here],
        weights=None if model.weights is None else model.weights[here],
        footprint=model.footprint if rules.footprint == "model" else None,
    )
    return Setting(
        HeightSurface(part, rules), whole.number[here], whole.is_site[here], lambda live: (stays[here], is_foreign)
    )


def _beside(tile: Tile, number: IntArray) -> Csr:
    """Return the eight samples that count beside each; of one between rows that count, those around it, twice."""
    h, w = tile.heights.shape
    row, column = np.divmod(number, tile.n_columns)
    i, j = np.searchsorted(tile.rows, row), np.searchsorted(tile.columns, column)
    counts = (tile.rows[np.minimum(i, h - 1)] == row) & (tile.columns[np.minimum(j, w - 1)] == column)
    at = np.full((h, w), -1, np.int64)
    at[i[counts], j[counts]] = np.flatnonzero(counts)
    beside = np.empty((len(number), len(STEPS)), np.int32)  # as the neighbours of models are
    own = np.arange(len(number))
    for k, (down, right) in enumerate(STEPS):
        # one between rows is south of row i - 1 and north of row i
        to_row = np.where(counts, i + down, i - (k & 1))
        to_column = np.where(counts, j + right, j - (k >> 1 & 1))
        found = at[np.clip(to_row, 0, h - 1), np.clip(to_column, 0, w - 1)]
        beside[:, k] = np.where(found >= 0, found, own)
    return len(STEPS) * np.arange(len(number) + 1, dtype=np.int64), beside.ravel()
