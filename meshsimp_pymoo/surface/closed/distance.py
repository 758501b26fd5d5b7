"""How far a point in space is from a triangle: exactly, degenerate triangles included."""

from __future__ import annotations

import numpy as np

from meshsimp_pymoo.compiling.functions import inner


@inner
def squared_distance(xyz: np.ndarray, a: int, b: int, c: int, x: float, y: float, z: float) -> float:
    """Return the squared distance of (x, y, z) to triangle (a, b, c) of points x0, y0, z0, x1, ... in ``xyz``.

    C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.5: by the region of the plane that the foot of the
    perpendicular lies in.
    """
    ux, uy, uz = xyz[3 * b] - xyz[3 * a], xyz[3 * b + 1] - xyz[3 * a + 1], xyz[3 * b + 2] - xyz[3 * a + 2]
    vx, vy, vz = xyz[3 * c] - xyz[3 * a], xyz[3 * c + 1] - xyz[3 * a + 1], xyz[3 * c + 2] - xyz[3 * a + 2]
    px, py, pz = x - xyz[3 * a], y - xyz[3 * a + 1], z - xyz[3 * a + 2]
    up = ux * px + uy * py + uz * pz
    vp = vx * px + vy * py + vz * pz
    s = 0.0
    t = 0.0
    if up > 0.0 or vp > 0.0:
        uu = ux * ux + uy * uy + uz * uz
        vv = vx * vx + vy * vy + vz * vz
        uv = ux * vx + uy * vy + uz * vz
        up_b, vp_b = up - uu, vp - uv  # the same of the point seen from b, and from c
        up_c, vp_c = up - uv, vp - vv
        of_c = up * vp_b - up_b * vp
        of_b = up_c * vp - up * vp_c
        of_a = up_b * vp_c - up_c * vp_b
        if up_b >= 0.0 and vp_b <= up_b:
            s = 1.0
        elif vp_c >= 0.0 and up_c <= vp_c:
            t = 1.0
        elif of_c <= 0.0 and up >= 0.0 and up_b <= 0.0 and uu > 0.0:
            s = up / uu
        elif of_b <= 0.0 and vp >= 0.0 and vp_c <= 0.0:
            t = vp / vv if vv > 0.0 else 0.0
        elif of_a <= 0.0 and vp_b >= up_b and up_c >= vp_c:
            whole = (vp_b - up_b) + (up_c - vp_c)
            t = (vp_b - up_b) / whole if whole > 0.0 else 0.0
            s = 1.0 - t
        else:
            whole = of_a + of_b + of_c
            if whole > 0.0:
                s = of_b / whole
                t = of_c / whole
    dx, dy, dz = px - s * ux - t * vx, py - s * uy - t * vy, pz - s * uz - t * vz
    return dx * dx + dy * dy + dz * dz


@inner
def enter_plane(xyz: np.ndarray, a: int, b: int, c: int, planes: np.ndarray, k: int) -> None:
    """Write the unit normal and the offset of triangle (a, b, c) into row k of ``planes``; zeros if it has no area."""
    ax, ay, az = xyz[3 * a], xyz[3 * a + 1], xyz[3 * a + 2]
    ux, uy, uz = xyz[3 * b] - ax, xyz[3 * b + 1] - ay, xyz[3 * b + 2] - az
    vx, vy, vz = xyz[3 * c] - ax, xyz[3 * c + 1] - ay, xyz[3 * c + 2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        nx, ny, nz = nx / length, ny / length, nz / length
    planes[k, 0], planes[k, 1], planes[k, 2] = nx, ny, nz
    planes[k, 3] = nx * ax + ny * ay + nz * az


@inner(inline=True)
def enter_no_plane(planes: np.ndarray, k: int) -> None:
    """Write row k of ``planes`` so that it says of no point that it is far."""
    planes[k, 0], planes[k, 1], planes[k, 2], planes[k, 3] = 0.0, 0.0, 0.0, 0.0


@inner(inline=True)
def enter_hole(planes: np.ndarray, k: int) -> None:
    """Write row k of ``planes`` so that every point is infinitely far from it: the triangle is not in the mesh."""
    planes[k, 0], planes[k, 1], planes[k, 2], planes[k, 3] = 0.0, 0.0, 0.0, np.inf


@inner(inline=True)
def is_in_mesh(planes: np.ndarray, k: int) -> bool:
    """Whether row k of ``planes`` is none of a triangle in a hole."""
    return planes[k, 3] < np.inf


@inner(inline=True)
def nearer(
    xyz: np.ndarray, planes: np.ndarray, k: int, a: int, b: int, c: int, x: float, y: float, z: float, known: float
) -> float:
    """Return the squared distance to triangle (a, b, c), or inf where its plane, row k, is as far as ``known``."""
    h = planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z - planes[k, 3]
    if h * h >= known:
        return np.inf
    d = squared_distance(xyz, a, b, c, x, y, z)
    return d if d < known else np.inf
