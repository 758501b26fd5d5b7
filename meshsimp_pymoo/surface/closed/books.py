"""The books of a live closed mesh: what changes while a closed surface is searched, in one record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# A tentative change of a vertex in more triangles than this is done and undone instead.
MOST_TOUCHED = 48

# What an operation makes of a record, as bits of ``mark``.
GONE, IN_CAVITY, CAME, BESIDE = 1, 2, 4, 8

# Entries of ``tally``.
END, N_FREE, N_SITES, N_GONE, N_CAME, N_BESIDE, N_LOG, N_LOOKED_AT, N_IN_MESH, N_SHORT = range(10)

# Of a site, as bits of ``idle``.
UNUSED, LOOKED_AT = 1, 2

# Where nobody asks for the maximum.
NO_PEAKS = np.empty(0, np.float64)


class ClosedLive(NamedTuple):
    """What changes; N vertices, at most 2 N triangles (records, see :mod:`~meshsimp_pymoo.plane.triangulation`).

    Every vertex that is no site is in the list of the triangle that holds its image.
    """

    mesh: np.ndarray  # (16 N,) records of triangles
    head: np.ndarray  # (2 N,) first vertex in each triangle's list, -1: none
    subtotal: np.ndarray  # (2 N,) sum of the costs in each triangle
    planes: np.ndarray  # (2 N, 4) unit normal and offset of each triangle in space
    following: np.ndarray  # (N,) next vertex in the same list
    place: np.ndarray  # (N,) the triangle that holds a vertex; some triangle of a site
    squares: np.ndarray  # (N, 4) squared distance to the own triangle and those across its sides (inf: not nearer)
    site: np.ndarray  # (N,) whether the vertex is in the triangulation
    uses: np.ndarray  # (N,) triangles of the mesh at each site, or (0,) where there are no holes
    idle: np.ndarray  # (N,) whether a site is in no triangle of the mesh, by the books, or (0,)
    of_part: np.ndarray  # (P,) sites of each part
    free: np.ndarray  # (2 N,) unused records
    mark: np.ndarray  # (2 N,) what an operation makes of each record
    gone: np.ndarray  # (2 N,) triangles that it takes away
    came: np.ndarray  # (2 N,) those that it makes
    beside: np.ndarray  # (2 N,) those that stay and have others across some sides
    sides: np.ndarray  # (2 N,) which sides: bits
    pool: np.ndarray  # (N,) vertices to be placed
    log_at: np.ndarray  # (48 MOST_TOUCHED,) where the records were written to
    log_value: np.ndarray  # (48 MOST_TOUCHED,) and what they held before
    saved: np.ndarray  # (4 MOST_TOUCHED, 4) planes of the triangles that go
    cavity: np.ndarray  # scratch of the size of the triangles
    rim: np.ndarray
    ring: np.ndarray
    stack: np.ndarray
    edge: np.ndarray
    ears: np.ndarray  # (2 N, 3)
    ear_edges: np.ndarray  # (2 N, 3)
    star_mesh: np.ndarray  # (16 N,) a large star's ring, triangulated alone, and what that needs
    star_order: np.ndarray  # (N,)
    star_side: np.ndarray  # (N,)
    star_inserted: np.ndarray  # (N,)
    tally: np.ndarray  # numbers of things, see the names above
    amount: np.ndarray  # running sums, as in `surface.books`
    peaks: np.ndarray  # tree of the largest deviations in each triangle, then of sites in none, or (0,)


def make_live(n_vertices: int, n_parts: int = 1, *, has_holes: bool = False) -> ClosedLive:
    """Return empty books for a model of that size; about 600 N bytes, of which only what is used becomes resident."""
    n = n_vertices + 4
    return ClosedLive(
        mesh=np.empty(16 * n, np.uint32),
        head=np.empty(2 * n, np.int32),
        subtotal=np.empty(2 * n, np.float64),
        planes=np.empty((2 * n, 4), np.float64),
        following=np.empty(n, np.int32),
        place=np.empty(n, np.uint32),
        squares=np.empty((n, 4), np.float64),
        site=np.empty(n, np.uint8),
        uses=np.empty(n if has_holes else 0, np.int32),
        idle=np.empty(n if has_holes else 0, np.uint8),
        of_part=np.empty(n_parts, np.int64),
        free=np.empty(2 * n, np.uint32),
        mark=np.zeros(2 * n, np.uint8),
        gone=np.empty(2 * n, np.uint32),
        came=np.empty(2 * n, np.uint32),
        beside=np.empty(2 * n, np.uint32),
        sides=np.zeros(2 * n, np.uint8),
        pool=np.empty(n, np.int32),
        log_at=np.empty(48 * MOST_TOUCHED, np.int64),
        log_value=np.empty(48 * MOST_TOUCHED, np.uint32),
        saved=np.empty((4 * MOST_TOUCHED, 4), np.float64),
        cavity=np.empty(2 * n, np.uint32),
        rim=np.empty(2 * n, np.uint32),
        ring=np.empty(2 * n, np.uint32),
        stack=np.empty(2 * n + 8, np.uint32),
        edge=np.empty(2 * n, np.int32),
        ears=np.empty((2 * n, 3), np.uint32),
        ear_edges=np.empty((2 * n, 3), np.int32),
        star_mesh=np.empty(16 * n, np.uint32),
        star_order=np.empty(n, np.int64),
        star_side=np.empty(n, np.int32),
        star_inserted=np.empty(n, np.uint8),
        tally=np.zeros(10, np.int64),
        amount=np.zeros(4, np.float64),
        peaks=NO_PEAKS,
    )


def with_peaks(live: ClosedLive) -> ClosedLive:
    """Return the books with room for the largest deviation of each triangle, and of each site that none uses."""
    return live._replace(peaks=np.zeros(2 * (len(live.head) + len(live.idle))))
