"""The books of a live triangulation: what changes while a height surface is searched, in one record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NONE = 0xFFFFFFFF

# What a triangle is, as bits of ``kind``; a plain one is inside the footprint, emitted, and not at the outline. The
# last three say which of its sides are segments of the outline: SEGMENT << side.
EMITTED, THIN, PEELED, INSIDE, VISITED, IN_REGION, SEGMENT = 1, 2, 4, 8, 16, 32, 64
PLAIN = EMITTED | INSIDE

# What a vertex is, by ``bare``: covered, or else with its nearest segment known, to be found, or, during a trial, done.
COVERED, HOUSED, HOMELESS, TRIED = range(4)

# Vertices in one leaf of the tree, see `bare`.
RUN = 8

# A tentative change that touches more triangles than this is done and undone instead.
MOST_TOUCHED = 48

# Entries of ``tally``.
(
    END,
    N_FREE,
    N_EMITTED,
    N_BARE,
    N_ADDED,
    N_HOMELESS,
    N_STIRRED,
    N_REGION,
    N_POOL,
    N_TOUCHED,
    N_SITES,
    N_THIN,
    N_LOOKED_AT,
) = range(13)
# Entries of ``amount``: running sums, and the largest both together have been since they were last added up anew.
# The last is the largest deviation that the operation tried or done last has met, where costs are weighed.
COVERED_ERROR, BARE_ERROR, PEAK, LARGEST = range(4)


# Where nobody asks for the maximum.
NO_PEAKS = np.empty(0, np.float64)


class Live(NamedTuple):
    """What changes; N vertices, at most 2 N triangles (records, see :mod:`~meshsimp_pymoo.plane.triangulation`).

    Vertices that no emitted triangle covers are *bare*, dropped ones and sites. *Segments* of the outline are
    halfedges of emitted triangles whose twin's is not; an array of 6 N entries has one for each halfedge.
    """

    mesh: np.ndarray  # (16 N,) records of triangles
    kind: np.ndarray  # (2 N,) bits of each triangle
    head: np.ndarray  # (2 N,) first vertex in each triangle's list, -1: none
    subtotal: np.ndarray  # (2 N,) sum of the costs in each emitted triangle, 0 in others
    following: np.ndarray  # (N,) next vertex in the same list
    place: np.ndarray  # (N,) the triangle a dropped vertex lies in; some triangle of a site
    used: np.ndarray  # (N,) number of emitted triangles at each site
    site: np.ndarray  # (N,) whether the vertex is in the triangulation
    free: np.ndarray  # (2 N,) unused records
    bare: np.ndarray  # (N,) COVERED, or what else a vertex is
    cost: np.ndarray  # (N,) cost of the bare vertices
    bare_segment: np.ndarray  # (N,) the halfedge nearest to each of them, NONE: none within reach
    bare_gap: np.ndarray  # (N,) squared distance to it in the unit square
    bare_before: np.ndarray  # (N,) those with one segment are a list
    bare_after: np.ndarray  # (N,)
    first_bare: np.ndarray  # (6 N,) where it begins, for each segment
    segment_before: np.ndarray  # (6 N,) the segments that start in one run of vertices are a list
    segment_after: np.ndarray  # (6 N,)
    first_segment: np.ndarray  # (N / RUN,) where it begins, for each leaf of the tree
    spans: np.ndarray  # (2 N / RUN, 4) box of the segments that start in each node, as in plane.nearest
    reach: np.ndarray  # (2 N / RUN,) largest gap of the housed vertices in it, -1: none
    is_stirred: np.ndarray  # (N / RUN,) whether spans and reach of a leaf are old
    stirred: np.ndarray  # (N / RUN,) those leaves
    added: np.ndarray  # (6 N,) segments that came
    homeless: np.ndarray  # (4 N,) bare vertices whose segment went, or which are new
    region: np.ndarray  # (2 N,) triangles that an operation made
    pool: np.ndarray  # (N,) vertices to be placed
    touched: np.ndarray  # (3 N,) sites that came to be used or unused
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
    nodes: np.ndarray  # (64,) of the tree, to be looked at
    distances: np.ndarray  # (64,) how far they are
    candidates: np.ndarray  # (24,) segments that can be nearest to vertices that lie together
    gone: np.ndarray  # (2 MOST_TOUCHED,) triangles that a tentative change takes away
    forms: np.ndarray  # (2 MOST_TOUCHED, 13) sides and planes of those that would come, see trial
    shown: np.ndarray  # (2 MOST_TOUCHED,) whether each of them would be emitted
    beside: np.ndarray  # (2 MOST_TOUCHED, 3) what would lie across its sides
    going: np.ndarray  # (8 MOST_TOUCHED,) segments that would go
    coming: np.ndarray  # (8 MOST_TOUCHED, 3) segments that would come, with the third corner of their triangle
    saved: np.ndarray  # (10 MOST_TOUCHED,) what the records held before
    tally: np.ndarray  # numbers of things, see the names above
    amount: np.ndarray  # errors, see the names above
    peaks: np.ndarray  # (6 N,) tree of the largest deviations in each triangle and of each bare vertex, or (0,)


def make_live(n_vertices: int) -> Live:
    """Return empty books for a model of that size; about 450 N bytes, of which only what is used becomes resident."""
    n = n_vertices + 4
    leaves = -(-n_vertices // RUN)
    return Live(
        mesh=np.empty(16 * n, np.uint32),
        kind=np.zeros(2 * n, np.uint16),
        head=np.empty(2 * n, np.int32),
        subtotal=np.empty(2 * n, np.float64),
        following=np.empty(n, np.int32),
        place=np.empty(n, np.uint32),
        used=np.empty(n, np.int32),
        site=np.empty(n, np.uint8),
        free=np.empty(2 * n, np.uint32),
        bare=np.empty(n, np.uint8),
        cost=np.empty(n, np.float64),
        bare_segment=np.empty(n, np.uint32),
        bare_gap=np.empty(n, np.float64),
        bare_before=np.empty(n, np.int32),
        bare_after=np.empty(n, np.int32),
        first_bare=np.empty(6 * n, np.int32),
        segment_before=np.empty(6 * n, np.uint32),
        segment_after=np.empty(6 * n, np.uint32),
        first_segment=np.empty(leaves, np.uint32),
        spans=np.empty((2 * leaves, 4), np.float64),
        reach=np.empty(2 * leaves, np.float64),
        is_stirred=np.zeros(leaves, np.uint8),
        stirred=np.empty(leaves, np.int32),
        added=np.empty(6 * n, np.uint32),
        homeless=np.empty(4 * n, np.int32),
        region=np.empty(2 * n, np.uint32),
        pool=np.empty(n, np.int32),
        touched=np.empty(3 * n, np.uint32),
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
        nodes=np.empty(64, np.int64),
        distances=np.empty(64, np.float64),
        candidates=np.empty(24, np.uint32),
        gone=np.empty(2 * MOST_TOUCHED, np.int64),
        forms=np.empty((2 * MOST_TOUCHED, 13), np.float64),
        shown=np.empty(2 * MOST_TOUCHED, np.uint8),
        beside=np.empty((2 * MOST_TOUCHED, 3), np.int64),
        going=np.empty(8 * MOST_TOUCHED, np.uint32),
        coming=np.empty((8 * MOST_TOUCHED, 3), np.int64),
        saved=np.empty(10 * MOST_TOUCHED, np.uint32),
        tally=np.zeros(13, np.int64),
        amount=np.zeros(4, np.float64),
        peaks=NO_PEAKS,
    )


def with_peaks(live: Live) -> Live:
    """Return the books with room for the largest deviation of each place: triangles, then bare vertices."""
    return live._replace(peaks=np.zeros(2 * (len(live.kind) + len(live.bare))))
