"""Where a model stands on Earth: its vertices in metres east, north and up of a place, and that place [1]_.

Every vertex is converted by itself, so that the plane of a map is bent as the Earth is. What lies between three of them
is flat then, and was a plane of the map before: :func:`sagitta` says by how much that differs.

References
----------
.. [1] "World Geodetic System 1984", National Geospatial-Intelligence Agency, NGA.STND.0036, 2014, section 4.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from meshsimp_pymoo.errors import ResultError, reason_of, warn_of, way_to_install

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import FloatArray, IntArray

# WGS 84, longitude first: what needs no conversion.
GEOGRAPHIC = 4326
# The least radius of curvature of the Earth, that of a meridian at the equator [m].
LEAST_RADIUS = 6_335_439.0


class Place(NamedTuple):
    """A frame on Earth.

    Attributes
    ----------
    longitude, latitude : float
        Where its origin is [degrees], on WGS 84.
    height : float
        Of its origin above the ellipsoid [m].
    axes : (3, 3) float array
        East, north and up, as rows, in the Earth-centred frame (EPSG:4978).
    at : (3,) float array
        Its origin in that frame [m].
    """

    longitude: float
    latitude: float
    height: float
    axes: FloatArray
    at: FloatArray


def geodetic(georeference: Mapping[str, Any], points: FloatArray, metres: float, name: str) -> FloatArray | None:
    """Return longitude and latitude [degrees] and the height [m] of points of a model's file on WGS 84.

    Parameters
    ----------
    georeference : mapping
        What is known of the coordinates.
    points : (V, 3) float array
        In the frame of the file, z the height.
    metres : float
        What a unit of height is [m].
    name : str
        What messages call the model.

    Returns
    -------
    (V, 3) float array, or None
        Heights are taken for ellipsoidal ones. None where no reference system is known.

    Raises
    ------
    ResultError
        If the library that knows reference systems is missing.

    Warns
    -----
    ModelWarning
        If the reference system is none on Earth: then it is as if it were not known.
    """
    import numpy as np

    from meshsimp_pymoo.formats.source.metric import epsg_number

    number, text = epsg_number(georeference), georeference.get("crs")
    if not (number or text):
        return None
    heights = np.asarray(points, np.float64)[:, 2] * metres
    if number == GEOGRAPHIC:
        return np.column_stack([points[:, :2], heights])
    try:
        from rasterio.crs import CRS
        from rasterio.errors import CRSError
        from rasterio.warp import transform
    except ImportError:
        raise ResultError(
            f"{name}: its place on Earth needs rasterio, which knows reference systems; install it by "
            f"{way_to_install('geo')}"
        ) from None
    system = f"EPSG:{number}" if number else str(text)
    try:
        known = CRS.from_user_input(system)
        if not (known.is_geographic or known.is_projected):  # a site's own; those would come back as they are
            raise CRSError("it is neither geographic nor projected")
        x, y = transform(known, f"EPSG:{GEOGRAPHIC}", points[:, 0].tolist(), points[:, 1].tolist())
    except (CRSError, ValueError, RuntimeError) as problem:
        warn_of(f"{name}: its reference system leads to no place on Earth ({reason_of(problem)}); it stays local")
        return None
    found = np.column_stack([x, y, heights])
    if lost := int((~np.isfinite(found)).any(axis=1).sum()):
        warn_of(f"{name}: {lost:,} of {len(found):,} vertices have no place on Earth by its system; it stays local")
        return None
    return found


def earth_centred(geodetic: FloatArray) -> FloatArray:
    """Return points (V, 3) of longitude, latitude [degrees] and ellipsoidal height [m] in the Earth-centred frame [m].

    >>> import numpy as np
    >>> earth_centred(np.array([[0.0, 0.0, 0.0], [0.0, 90.0, 100.0]])).round(3).tolist()
    [[6378137.0, 0.0, 0.0], [0.0, 0.0, 6356852.314]]
    """
    import numpy as np

    from meshsimp_pymoo.formats.source.metric import DEGREE, WGS84

    axis, inverse = WGS84
    squared = (2.0 - 1.0 / inverse) / inverse
    longitude, latitude = geodetic[:, 0] * DEGREE, geodetic[:, 1] * DEGREE
    normal = axis / np.sqrt(1.0 - squared * np.sin(latitude) ** 2)
    across = (normal + geodetic[:, 2]) * np.cos(latitude)
    up = (normal * (1.0 - squared) + geodetic[:, 2]) * np.sin(latitude)
    return np.column_stack([across * np.cos(longitude), across * np.sin(longitude), up])


def place_at(longitude: float, latitude: float, height: float) -> Place:
    """Return the frame of east, north and up at a place [degrees, degrees, m].

    >>> place_at(0.0, 0.0, 0.0).axes.round(12).tolist()
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    """
    import numpy as np

    x, y = math.radians(longitude), math.radians(latitude)
    east = [-math.sin(x), math.cos(x), 0.0]
    north = [-math.sin(y) * math.cos(x), -math.sin(y) * math.sin(x), math.cos(y)]
    up = [math.cos(y) * math.cos(x), math.cos(y) * math.sin(x), math.sin(y)]
    at = earth_centred(np.array([[longitude, latitude, height]]))[0]
    return Place(longitude, latitude, height, np.array([east, north, up]) + 0.0, at)


def sagitta(points: FloatArray, faces: IntArray) -> float:
    """Return how far below the bent Earth a flat triangle lies at most [m].

    Parameters
    ----------
    points : (V, 3) float array
        In space [m].
    faces : (M, 3) int array
        Triangles of them. The sphere through the corners of one rises over it by r² / 2R at most, with the radius r of
        the smallest circle around it.

    Examples
    --------
    An edge of a kilometre:

    >>> import numpy as np
    >>> points = np.array([[0.0, 0, 0], [1000, 0, 0], [500, 100, 0]])
    >>> round(sagitta(points, np.array([[0, 1, 2]])), 4)
    0.0197
    """
    import numpy as np

    corners = points[faces]
    sides = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
    a, b, c = sides.T
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    is_acute = a * a + b * b > c * c
    radius = np.where(is_acute, a * b * c / np.where(is_acute, 4.0 * area, 1.0), c / 2)
    return float((radius**2).max(initial=0.0) / (2.0 * LEAST_RADIUS))
