"""What one vertex costs in one triangle, and whether that triangle is part of the mesh.

What a deviation costs is the same on surfaces of all kinds: these functions take the records of any, whose members
have the names that height surfaces give them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from meshsimp_pymoo.compiling.functions import inner
from meshsimp_pymoo.plane.constraints import holds_line
from meshsimp_pymoo.plane.emission import is_in_faces, is_sliver
from meshsimp_pymoo.surface.books import LARGEST
from meshsimp_pymoo.surface.evaluate import COVER_TOLERANCE, REACH
from meshsimp_pymoo.surface.ground import Ground


@inner
def weighed_cost(g: Any, d: float, i: int) -> float:
    """Return what vertex i adds to the total where d_p = d, if that is not d itself (``g.weighed``)."""
    beyond = max(d - g.bound, 0.0)
    if g.power > 1:
        d *= g.scale
        d *= d
        if g.power == 8:
            d *= d
            d *= d
    if len(g.weight) > 0:
        d *= g.weight[i]
        beyond = beyond if g.weight[i] > 0.0 else 0.0
    return g.own * d + beyond


@inner(inline=True)
def counts(g: Any, i: int) -> bool:
    """Whether vertex i counts in the maximum: its weight is not 0."""
    return len(g.weight) == 0 or g.weight[i] > 0.0


@inner
def noted_cost(g: Any, live: Any, d: float, i: int) -> float:
    """Return what vertex i adds to the total where d_p = d, and note d if it is the largest so far (``LARGEST``)."""
    if not g.weighed:
        return d
    if d > live.amount[LARGEST] and counts(g, i):
        live.amount[LARGEST] = d
    return weighed_cost(g, d, i)


@inner
def enter_peak(live: Any, place: int, d: float) -> None:
    """Write the largest deviation of a place into the tree of ``peaks``, up to where nothing changes."""
    peaks = live.peaks
    node = len(peaks) // 2 + place
    peaks[node] = d
    while node > 1:
        node >>= 1
        most = max(peaks[2 * node], peaks[2 * node + 1])
        if peaks[node] == most:
            return
        peaks[node] = most


@inner(inline=True)
def deviation_in(xy: np.ndarray, z: np.ndarray, a: int, b: int, c: int, i: int) -> float:
    """d_p of vertex i on the plane of triangle (a, b, c)."""
    ax = xy[2 * a]
    ay = xy[2 * a + 1]
    ux = xy[2 * b] - ax
    uy = xy[2 * b + 1] - ay
    vx = xy[2 * c] - ax
    vy = xy[2 * c + 1] - ay
    dx = xy[2 * i] - ax
    dy = xy[2 * i + 1] - ay
    area = ux * vy - uy * vx
    wb = dx * vy - dy * vx
    wc = dy * ux - dx * uy
    return abs(((area - wb - wc) * z[a] + wb * z[b] + wc * z[c]) / area - z[i])


@inner(inline=True)
def _shares_in(xy: np.ndarray, a: int, b: int, c: int, i: int) -> tuple[float, float, float]:
    """Barycentric coordinates of vertex i in triangle (a, b, c)."""
    ux = xy[2 * b] - xy[2 * a]
    uy = xy[2 * b + 1] - xy[2 * a + 1]
    vx = xy[2 * c] - xy[2 * a]
    vy = xy[2 * c + 1] - xy[2 * a + 1]
    dx = xy[2 * i] - xy[2 * a]
    dy = xy[2 * i + 1] - xy[2 * a + 1]
    area = ux * vy - uy * vx
    wb = (dx * vy - dy * vx) / area
    wc = (dy * ux - dx * uy) / area
    return 1.0 - wb - wc, wb, wc


@inner(inline=True)
def is_hardly_bare(xy: np.ndarray, a: int, b: int, c: int, i: int, gap: float) -> bool:
    """Whether (a, b, c), to whose side a-b vertex i has the squared distance gap, covers it but for rounding."""
    wa, wb, wc = _shares_in(xy, a, b, c, i)
    return gap <= REACH * REACH and wa >= -COVER_TOLERANCE and wb >= -COVER_TOLERANCE and wc >= -COVER_TOLERANCE


@inner
def bare_deviation(g: Ground, a: int, b: int, c: int, i: int, gap: float) -> float:
    """d_p of a vertex i that no triangle covers; nearest is the side a-b of (a, b, c), at the squared distance gap."""
    xy = g.xy
    z = g.z
    d = 0.0
    if is_hardly_bare(xy, a, b, c, i, gap):
        wa, wb, wc = _shares_in(xy, a, b, c, i)
        d = abs(wa * z[a] + wb * z[b] + wc * z[c] - z[i])
    elif g.nearest:
        ux = xy[2 * b] - xy[2 * a]
        uy = xy[2 * b + 1] - xy[2 * a + 1]
        dx = xy[2 * i] - xy[2 * a]
        dy = xy[2 * i + 1] - xy[2 * a + 1]
        u = min(max((dx * ux + dy * uy) / (ux * ux + uy * uy), 0.0), 1.0)
        ex = u * ux - dx
        ey = u * uy - dy
        dz = (1.0 - u) * z[a] + u * z[b] - z[i]
        d = np.sqrt((ex * ex + ey * ey) * g.unit * g.unit + dz * dz)
    return d


@inner(inline=True)
def is_inside(g: Ground, a: int, b: int, c: int) -> bool:
    """Whether the footprint holds the centroid of (a, b, c), or the triangle a line."""
    if g.footprint.side == 0:
        return True
    return is_in_faces(g.xy, g.footprint, g.xy, a, b, c) or holds_line(g.xy, g.lines, a, b, c)


@inner(inline=True)
def is_thin(g: Ground, a: int, b: int, c: int) -> bool:
    """Whether (a, b, c) is a sliver, which is peeled where it reaches the outside."""
    xy = g.xy
    ux = xy[2 * b] - xy[2 * a]
    uy = xy[2 * b + 1] - xy[2 * a + 1]
    vx = xy[2 * c] - xy[2 * a]
    vy = xy[2 * c + 1] - xy[2 * a + 1]
    area = ux * vy - uy * vx
    # A generous first look; the exact rule, the same for all rotations, decides about those that are left.
    if area * area >= 16.0 * g.min_height * g.min_height * (ux * ux + uy * uy + vx * vx + vy * vy):
        return False
    return is_sliver(xy, a, b, c, g.min_height)
