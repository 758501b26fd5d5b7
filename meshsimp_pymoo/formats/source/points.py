"""Points without faces: their Delaunay triangulation in the plane is the original mesh.

The triangulation is the one of this package, so that keeping all points gives the original mesh again, to the last
triangle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh, build_source, check_points
from meshsimp_pymoo.formats.source.classes import check_classes, classes_of, count_classes
from meshsimp_pymoo.formats.source.metric import in_metric_frame
from meshsimp_pymoo.formats.source.missing import is_nodata, warn_of_nodata
from meshsimp_pymoo.plane.emission import SLIVER_HEIGHT
from meshsimp_pymoo.plane.order import find_corners, unit_square, vector_order
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import INFINITE, RECORD, triangulate_once


def cloud_source(
    points: npt.ArrayLike,
    *,
    max_edge: float | None = None,
    nodata: float | None = None,
    classes: tuple[int, ...] | None = None,
    attributes: Mapping[str, npt.ArrayLike] | None = None,
    name: str = "points",
    rows: IntArray | None = None,
    georeference: dict[str, Any] | None = None,
    scale: str | tuple[float, float] | None = None,
) -> SourceMesh:
    """Triangulate points in the plane of x and y: the Delaunay triangulation, ties broken as everywhere here.

    Parameters
    ----------
    points : (P, 3) array
        Points; z is the height [units]. One with a NaN is none.
    max_edge : float, optional
        A triangle with an edge longer than this in the plane is left out [units]. Without it the triangulation covers
        the convex hull of the points, and bridges every bay of their outline and every hole; about three times the
        usual distance of neighbours keeps both open. Of degrees: metres, as all lengths.
    nodata : float, optional
        Height of points that are none.
    classes : tuple of int, optional
        The classes that are taken, by the attribute "classification"; by default all.
    attributes : mapping of str to arrays of P rows, optional
        Per-point data.
    name : str
        What messages call it.
    rows : (P,) int array, optional
        Row of each point in the file; by default 0, 1, 2, ...
    georeference : dict, optional
        See :class:`~meshsimp_pymoo.formats.source.SourceMesh`.
    scale : "degrees", (float, float) or None
        What a unit of x and y measures; see :class:`~meshsimp_pymoo.formats.options.Options`.

    Returns
    -------
    SourceMesh
        Of points with one (x, y) the lowest stays; ``rows`` holds the file rows of the points that stay.

    Raises
    ------
    ModelError
        If there are fewer than 4 different places, all on one line, infinite coordinates, no points of these classes,
        or no triangle with short enough edges.

    Warns
    -----
    ModelWarning
        With their number: if points have no place or height, look like "no data", are of other classes than ground, or
        share their place in the plane.

    Examples
    --------
    A square with its middle, and the middle once more, higher:

    >>> import warnings
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     source = cloud_source([*corners, [0.5, 0.5, 2], [0.5, 0.5, 1]])
    >>> len(source.faces), source.points[-1].tolist()
    (4, [0.5, 0.5, 1.0])
    """
    facts = dict(georeference or {})
    values = {key: np.asarray(value) for key, value in (attributes or {}).items()}
    xyz = np.asarray(points, dtype=np.float64)
    numbers = np.arange(len(xyz)) if rows is None else rows
    if xyz.ndim == 2 and xyz.shape[1] == 3:
        taken = _samples(xyz, numbers, nodata, name)
        found = classes_of(values)
        if found is not None:
            facts.setdefault("classes", count_classes(found))
            check_classes(facts["classes"], classes, name)
            if classes is not None:
                taken &= np.isin(found, classes)
        elif classes is not None:
            raise ModelError(f"{name}: does not say the classes of its points; leave classes out")
        if not taken.all():
            xyz, numbers = xyz[taken], numbers[taken]
            values = {key: value[taken] for key, value in values.items()}
    xyz = check_points(xyz, name)
    if max_edge is not None and not (np.isfinite(max_edge) and max_edge > 0):
        raise ModelError(f"{name}: max_edge is {max_edge}; give a positive length")
    facts = in_metric_frame(facts, xyz.min(axis=0), xyz.max(axis=0), scale=scale, name=name)
    local = xyz * [*facts.get("scale", (1.0, 1.0)), 1.0]
    local -= local.min(axis=0)
    if not np.ptp(local[:, :2], axis=0).any():
        raise ModelError(f"{name}: all {len(xyz)} points share one (x, y); a surface needs different ones")
    _, xy = unit_square(local)
    order = vector_order(xy, xyz[:, 2])  # the lowest of a place first
    sorted_xy = xy[order]
    first = np.ones(len(order), bool)
    first[1:] = (sorted_xy[1:] != sorted_xy[:-1]).any(axis=1)
    n_twins = len(first) - int(first.sum())
    if n_twins:
        warn_of(
            f"{name}: {n_twins} of {len(first)} points share their (x, y) with another one and were dropped; the "
            "lowest of each place stays"
        )
    order = order[first]
    triangles = _delaunay(np.ascontiguousarray(sorted_xy[first]))
    if not len(triangles):
        raise ModelError(f"{name}: its {len(order)} different places lie on one line; a surface needs points beside it")
    faces = order[triangles]
    if max_edge is not None:
        corners = local[faces, :2]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        faces = faces[longest <= max_edge]
        if not len(faces):
            raise ModelError(
                f"{name}: all {len(longest)} triangles have an edge longer than {max_edge:g} (half of them one longer "
                f"than {np.median(longest):.4g}); give a larger --max-edge"
            )
    stay = np.sort(order)
    place = np.full(len(xyz), -1, np.int64)
    place[stay] = np.arange(len(stay))
    facts |= {"points": len(xyz), "same_place": n_twins, "max_edge": max_edge}
    return build_source(
        xyz[stay],
        place[faces],
        {key: value[stay] for key, value in values.items()},
        name,
        rows=numbers[stay],
        up="z",
        georeference=facts,
        sort="cloud",
        repeats="none",
    )


def read_cloud(points: npt.ArrayLike, options: Options, **facts: Any) -> SourceMesh:
    """Triangulate the points of a file; see :func:`cloud_source` for the facts beside what the user says."""
    said = {name: getattr(options, name) for name in ("max_edge", "nodata", "classes", "scale")}
    return cloud_source(points, **said, **facts)


def bare_cloud(
    points: npt.ArrayLike, attributes: Mapping[str, npt.ArrayLike], name: str, options: Options, **facts: Any
) -> SourceMesh:
    """Triangulate the points of a mesh's file that has no faces, and say so; see :func:`read_cloud` for the facts."""
    warn_of(
        f"{name}: has {len(np.asarray(points))} vertices and no faces, so it is read as a point cloud, whose Delaunay "
        "triangulation in the plane of x and y is the original"
    )
    return read_cloud(points, options, attributes=attributes, name=name, **facts)


def _samples(xyz: FloatArray, rows: IntArray, nodata: float | None, name: str) -> BoolArray:
    """Return which points (P, 3) have a place and a height, and say what is left out or looks like it."""
    missing = np.asarray(np.isnan(xyz).any(axis=1))
    if missing.any():
        warn_of(f"{name}: {missing.sum()} of {len(xyz)} points lack a coordinate (NaN or empty) and were left out")
    infinite = np.isinf(xyz).any(axis=1) & ~missing
    if infinite.any():
        first = int(np.argmax(infinite))
        where = ", ".join(f"{value:g}" for value in xyz[first])
        raise ModelError(
            f"{name}: {infinite.sum()} of {len(xyz)} points have infinite coordinates (first: point {rows[first]}, "
            f"from 0, at {where}); set them to NaN or leave them out"
        )
    if nodata is not None:
        missing |= is_nodata(xyz[:, 2], nodata)
    warn_of_nodata(xyz[~missing, 2], name)
    return ~missing


def _delaunay(xy: FloatArray) -> IntArray:
    """Return the triangles (T, 3) of points in the unit square, in vector order; slivers are peeled off the hull."""
    n = len(xy)
    if n < 3:
        return np.empty((0, 3), np.int64)
    area, lift = exact_ranges(xy)
    records = np.empty(16 * n, np.uint32)
    flat = np.ascontiguousarray(xy).ravel()
    end = triangulate_once(flat, n, find_corners(xy), np.empty(0, np.int64), np.empty(n, np.uint8), records, area, lift)
    table = records[:end].reshape(-1, RECORD)
    triangles = table[:, :3].astype(np.int64)
    beyond = (table[:, :3] == INFINITE).any(axis=1)
    neighbours = (table[:, 4:7] >> 3).astype(np.int64)
    real = np.flatnonzero(~beyond)
    corners = xy[triangles[real]]
    edges = np.roll(corners, -1, axis=1) - corners
    double = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    longest = np.hypot(edges[..., 0], edges[..., 1]).max(axis=1)
    flat_ones = np.zeros(len(table), bool)
    diagonal = float(np.hypot(*np.ptp(xy, axis=0)))
    flat_ones[real] = double < SLIVER_HEIGHT * diagonal * longest
    peel = np.flatnonzero(flat_ones)
    while len(peel):
        outer = beyond[neighbours[peel]].any(axis=1)
        if not outer.any():
            break
        beyond[peel[outer]] = True
        peel = peel[~outer]
    return triangles[~beyond]
