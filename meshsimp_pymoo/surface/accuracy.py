"""How accurate one mesh of a model is, in the words of surveyors: the numbers of a statement of quality.

The check points are the original's vertices: the samples that the mesh was made from, not independent ground truth. A
*residual* is original minus mesh along the height, positive where the original lies above the mesh; where no triangle
covers a check point, and of closed surfaces everywhere, it has no sign: it is the deviation d_p that front.csv counts.

Mean, root mean square and maximum are those of :class:`~meshsimp_pymoo.surface.measures.Quality`, never taken again.

References
----------
.. [1] FGDC-STD-007.3-1998, "Geospatial Positioning Accuracy Standards, Part 3: National Standard for Spatial Data
   Accuracy" (NSSDA): vertical accuracy at 95 % = 1.9600 RMSE, and NMAS vertical accuracy (90 %) = 1.6449 RMSE, both
   where errors are normal and without bias.
.. [2] ASPRS, "Positional Accuracy Standards for Digital Geospatial Data", edition 1, 2014: NVA at 95 % = 1.96 RMSE;
   VVA = the 95th percentile of the absolute errors, whatever their distribution.
.. [3] J. Höhle and M. Höhle, "Accuracy assessment of digital elevation models by means of robust statistical methods",
   ISPRS Journal of Photogrammetry and Remote Sensing 64, 2009: median, NMAD and percentiles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.plane.faces import least_angles, used_rows
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.closed.nearest import MeshTree
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import Quality
from meshsimp_pymoo.surface.score import mesh_samples
from meshsimp_pymoo.surface.surface import Refitted, Simplified, Surface
from meshsimp_pymoo.surface.units import length_unit, reference_system

# Factors of the RMSE that bound 90 % and 95 % of normal errors without bias [1]_, and of the median absolute deviation
# that make it the standard deviation of normal errors [3]_.
NORMAL_90, NORMAL_95, NORMAL_MAD = 1.6449, 1.9600, 1.4826
# Percentiles of the absolute residuals that are stated, of the signed ones, and of the least angles.
PERCENTILES = (50, 68.3, 75, 90, 95, 99, 99.9)
SIGNED_PERCENTILES = (1, 5, 25, 75, 95, 99)
ANGLE_PERCENTILES = (1, 5, 10, 25, 50, 75, 90)
# Shares of triangles with a least angle below these are stated; bins of their histogram are so wide [degrees].
THIN_ANGLES, ANGLE_BIN = (10.0, 20.0), 2.0
# Bins of the histogram of the residuals between those of the outermost per cent, which have one on each side.
BINS, INNER_PERCENTILE = 41, 99.0
# Of more check points than these, read by windows, percentiles are those of a histogram of so many bins a sign.
EXACT_POINTS, FINE_BINS = 20_000_000, 1 << 20
# Points on each of the two surfaces from which distances in space are taken: so many to a face of the original, within
# these bounds; and the most faces of an original that are looked at for them.
FACE_SAMPLES, LEAST_SAMPLES, MOST_SAMPLES = 20, 10_000, 200_000
MOST_FACES = 4_000_000
# Of the points of a sequence that fills a triangle evenly: powers of the inverse of the plastic number.
_PLASTIC = 1.324717957244746


@dataclass(frozen=True)
class Histogram:
    """How many fall between edges.

    Attributes
    ----------
    edges : tuple of float, length B + 1
        Ascending; the last belongs to the last bin.
    counts : tuple of int, length B
        How many are in each bin.
    """

    edges: tuple[float, ...]
    counts: tuple[int, ...]


@dataclass(frozen=True)
class Distance:
    """Distances in space from points of one surface to another one.

    Attributes
    ----------
    mean, rms, maximum : float
        Of the points that are spread evenly over the surface; the vertices count in the maximum too [model units].
    points : int
        How many points there are, vertices included.
    """

    mean: float
    rms: float
    maximum: float
    points: int


@dataclass(frozen=True)
class SpaceDistance:
    """How far two surfaces are apart in space, from points on both.

    Attributes
    ----------
    to_mesh, to_original : Distance
        From points of the original to the mesh, and back.
    """

    to_mesh: Distance
    to_original: Distance

    @property
    def hausdorff(self) -> float:
        """Symmetric Hausdorff distance, from below: the largest distance of any point [model units]."""
        return max(self.to_mesh.maximum, self.to_original.maximum)

    @property
    def mean(self) -> float:
        """Mean of both mean distances [model units]."""
        return (self.to_mesh.mean + self.to_original.mean) / 2.0

    @property
    def rms(self) -> float:
        """Root of the mean of both mean squares [model units]."""
        return math.sqrt((self.to_mesh.rms**2 + self.to_original.rms**2) / 2.0)


@dataclass(frozen=True)
class Angles:
    """The least angles of triangles: in the plane, of a closed surface in space [degrees].

    Attributes
    ----------
    minimum : float
        The least of all.
    percentiles : dict of float to float
        By per cent of the triangles.
    below : dict of float to float
        Share of the triangles whose least angle is below so many degrees.
    histogram : Histogram
        Of the triangles.
    """

    minimum: float
    percentiles: dict[float, float]
    below: dict[float, float]
    histogram: Histogram


@dataclass(frozen=True)
class Accuracy:
    """What is said of the accuracy of one mesh of a model.

    Lengths are in ``unit``. Numbers that there are not, such as signed ones of a closed surface, are NaN or None.

    Attributes
    ----------
    unit : str
        Unit of all lengths; "model units" where nobody says.
    system : str
        The reference system of the coordinates, and how degrees are scaled; empty where nobody says.
    closed : bool
        Whether the original is a closed surface: residuals are then distances in space, without a sign.
    check_points : int
        Original vertices that count.
    weightless : int
        Original vertices that do not, as their weight is 0.
    weighted : bool
        Whether check points count by weights, in all numbers but counts.
    uncovered : int
        Check points that no triangle covers. They count as the rules say.
    outside : str
        What these count: "nearest" their distance to the mesh, "ignore" 0; empty for closed surfaces.
    coverage : float
        Share of the original's area in the plane that the mesh covers: that of the original faces whose centroids it
        does; NaN for closed surfaces.
    mean_error, rms_error, max_error : float
        Of the absolute residuals at all check points; those of front.csv. The mean absolute error, the RMSE.
    max_at : (float, float, float)
        The vertex where the maximum is, in the coordinates of the file [file units].
    bias, standard_deviation, median, nmad : float
        Mean of the signed residuals at covered check points; their standard deviation about it (divided by their
        number, so that bias^2 + standard_deviation^2 is their mean square); their median; 1.4826 times the median
        of their absolute deviation from it.
    signed_percentiles : dict of float to float
        Of the signed residuals at covered check points.
    percentiles : dict of float to float
        Of the absolute residuals at all check points, by linear interpolation between them. At 90 and 95 they are LE90
        and LE95 as counted.
    le90_normal, le95_normal : float
        1.6449 and 1.9600 times the RMSE: what bounds 90 % and 95 % of normal errors without bias.
    resolution : float
        0 where percentiles are exact, else the width of the bins that they are taken from.
    histogram : Histogram
        Of the signed residuals at covered check points; of a closed surface of the absolute ones at all.
    surface_error : float
        Mean deviation between the samples, at the centroids of the original faces, by their area.
    space : SpaceDistance, optional
        Distances in space; None where they were not taken.
    line_max_error, line_mean_error : float
        Of break lines; NaN without any.
    angles : Angles
        The least angles of the triangles.
    triangles, vertices : int
        Of the mesh.
    original_triangles, original_vertices : int
        Of the original.
    """

    unit: str
    system: str
    closed: bool
    check_points: int
    weightless: int
    weighted: bool
    uncovered: int
    outside: str
    coverage: float
    mean_error: float
    rms_error: float
    max_error: float
    max_at: tuple[float, float, float]
    bias: float
    standard_deviation: float
    median: float
    nmad: float
    signed_percentiles: dict[float, float]
    percentiles: dict[float, float]
    le90_normal: float
    le95_normal: float
    resolution: float
    histogram: Histogram
    surface_error: float
    space: SpaceDistance | None
    line_max_error: float
    line_mean_error: float
    angles: Angles
    triangles: int
    vertices: int
    original_triangles: int
    original_vertices: int

    @property
    def le90(self) -> float:
        """LE90 as counted: 90 % of the check points are no farther from the mesh."""
        return self.percentiles[90]

    @property
    def le95(self) -> float:
        """LE95 as counted: 95 % of the check points are no farther from the mesh."""
        return self.percentiles[95]

    @property
    def reduction(self) -> float:
        """Share of the original's triangles that the mesh does without."""
        return 1.0 - self.triangles / self.original_triangles

    @property
    def plain(self) -> dict[str, Any]:
        """All numbers as plain data, as JSON holds them: what there is not is null."""
        found = asdict(self) | {"le90": self.le90, "le95": self.le95, "reduction": self.reduction}
        if self.space is not None:
            also = {name: getattr(self.space, name) for name in ("hausdorff", "mean", "rms")}
            found["space"] = also | found["space"]
        return {name: _plain(value) for name, value in found.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key if isinstance(key, str) else f"{key:g}": _plain(one) for key, one in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and math.isnan(value) else value


class Residuals(NamedTuple):
    """Residuals at some of the check points.

    Attributes
    ----------
    vertices : (n,) int array
        The original vertices.
    values : (n,) float array
        Original minus mesh where a triangle covers the vertex, else d_p; without signs d_p [model units].
    covered : (n,) bool array
        Whether a triangle covers it.
    """

    vertices: IntArray
    values: FloatArray
    covered: BoolArray


@brief
@dataclass(frozen=True, eq=False)
class Compared:
    """One mesh beside its original: what numbers, maps and rasters of its quality are made of.

    Attributes
    ----------
    surface : Surface
        The original and the rules; N vertices.
    vertices : (V, 3) float array
        Those that the triangles use, in the frame of the surface's points [model units].
    faces : (M, 3) int array
        Triangles as rows of them.
    quality : Quality
        What is said of the mesh elsewhere.
    signed : bool
        Whether residuals have a sign.
    coverage : float
        See :class:`Accuracy`.
    parts : callable
        Yields the residuals at all original vertices (their rows ascend), part by part where the original is read by
        windows.
    """

    surface: Surface
    vertices: FloatArray
    faces: IntArray
    quality: Quality
    signed: bool
    coverage: float
    parts: Callable[[], Iterator[Residuals]]

    @property
    def weights(self) -> FloatArray | None:
        """How much each original vertex counts (N,); None: all alike."""
        found: FloatArray | None = getattr(self.surface.model, "weights", None)
        return found

    def at(self, rows: IntArray) -> Residuals:
        """Return the residuals at some original vertices, ascending."""
        found = []
        for part in self.parts():
            if len(part.vertices):
                low, high = np.searchsorted(rows, [part.vertices[0], part.vertices[-1] + 1])
                at = np.searchsorted(part.vertices, rows[low:high])
                found.append(Residuals(rows[low:high], part.values[at], part.covered[at]))
        return Residuals(*(np.concatenate(column) for column in zip(*found, strict=True)))


def compare(surface: Surface, mesh: Simplified | Refitted) -> Compared:
    """Lay one of a surface's own meshes beside it: as it is, or with its vertices moved.

    Raises
    ------
    ModelError, ValueError
        As the surface says of a mesh that it cannot measure.
    """
    rows, compact = used_rows(mesh.faces)
    if isinstance(mesh, Refitted):
        return compare_any(surface, mesh.vertices, compact)
    if isinstance(surface, GridSurface):
        return compare_any(surface, np.asarray(surface.model.file_points[rows]), compact)
    return _compared(surface, surface.points[rows], compact, mesh.quality, mesh.deviation, mesh.covered)


def compare_any(surface: Surface, points: FloatArray, faces: IntArray) -> Compared:
    """Lay any mesh beside a surface: vertices (V, 3) in the frame of the model's file and triangles (M, 3).

    Raises
    ------
    ValueError
        If it cannot be measured; see ``score`` of the surface.
    """
    found = surface.score(points, faces)
    rows, compact = used_rows(np.asarray(faces))
    used = np.asarray(points, float)[rows]
    if isinstance(surface, GridSurface):
        whole, row_of = surface.whole
        vertices = whole.model.to_local(used)
        values, coverage = _signed(whole, vertices, compact, found.deviation, found.covered, row_of)
        vertices += surface.points[np.zeros(1, np.int64)] - whole.points[row_of[:1]]  # the frame of this surface
        part = Residuals(np.arange(surface.n_vertices), values, found.covered)
        return Compared(surface, vertices, compact, found.quality, True, coverage, lambda: iter([part]))
    model: Any = surface.model
    return _compared(surface, model.to_local(used), compact, found.quality, found.deviation, found.covered)


def compare_subset(surface: GridSurface, kept: BoolArray) -> Compared:
    """Lay the mesh of a subset (N,) of a height grid that is read by windows beside it, in bounded memory."""
    found = surface.banded(kept)
    rows, compact = used_rows(found.faces)

    def parts() -> Iterator[Residuals]:
        for vertices, values, covered in found.bands():
            yield Residuals(vertices, values, covered)

    vertices = np.asarray(surface.points[rows])
    return Compared(surface, vertices, compact, found.quality, True, found.coverage, parts)


def _compared(
    surface: Surface,
    vertices: FloatArray,
    faces: IntArray,
    quality: Quality,
    deviation: FloatArray,
    covered: BoolArray,
) -> Compared:
    values, coverage, signed = np.asarray(deviation, float), math.nan, isinstance(surface, HeightSurface)
    if isinstance(surface, HeightSurface):
        values, coverage = _signed(surface, vertices, faces, values, covered, slice(None))
    found = Residuals(np.arange(surface.n_vertices), values, covered)
    return Compared(surface, vertices, faces, quality, signed, coverage, lambda: iter([found]))


def _signed(
    surface: HeightSurface,
    vertices: FloatArray,
    faces: IntArray,
    deviation: FloatArray,
    covered: BoolArray,
    rows: IntArray | slice,
) -> tuple[FloatArray, float]:
    """Return deviations with their signs where they are covered, and the share of the original's area that is."""
    ground, between = surface.ground(), surface.between
    n = len(ground.z)
    both = ground._replace(
        xy=np.concatenate([ground.xy, between.xy]), z=np.concatenate([ground.z, between.z]), nearest=False
    )
    samples = mesh_samples(both, vertices, faces)
    height = np.einsum("nk,nk->n", samples.shares[:n], vertices[samples.sites[:n], 2])
    below = (ground.z - height)[rows] < 0.0
    coverage = float(between.share[samples.covered[n:]].sum() / between.share.sum())
    return np.where(below & covered, -deviation, deviation), coverage


# ---------------------------------------------------------------------------------------------------------- the numbers


def accuracy_of(compared: Compared, *, space_samples: int | None = None) -> Accuracy:
    """Return all numbers of a statement of quality.

    Parameters
    ----------
    compared : Compared
        The mesh beside its original.
    space_samples : int, optional
        Points on each of both surfaces for distances in space; 0: these are not taken. They are left out of originals
        of more than MOST_FACES triangles too. By default FACE_SAMPLES to a triangle of the original, but at least
        LEAST_SAMPLES and at most MOST_SAMPLES.
    """
    surface, quality, model = compared.surface, compared.quality, compared.surface.model
    weights = compared.weights
    taken = _take(compared)
    largest = np.asarray(model.file_points[np.array([taken.max_row])])[0]
    absolute = taken.absolute
    counted = taken.signed if compared.signed else absolute
    spread = _moments(taken.signed) if compared.signed else {}
    is_closed = surface.view.is_closed
    return Accuracy(
        unit=length_unit(model.georeference),
        system=reference_system(model.georeference),
        closed=is_closed,
        check_points=taken.check_points,
        weightless=surface.n_vertices - taken.check_points,
        weighted=weights is not None and len(np.unique(weights[weights > 0])) > 1,
        uncovered=taken.uncovered,
        outside="" if is_closed else surface.rules.outside or "",
        coverage=compared.coverage,
        mean_error=quality.mean_error,
        rms_error=quality.rms_error,
        max_error=quality.max_error,
        max_at=(float(largest[0]), float(largest[1]), float(largest[2])),
        bias=spread.get("bias", math.nan),
        standard_deviation=spread.get("standard_deviation", math.nan),
        median=spread.get("median", math.nan),
        nmad=spread.get("nmad", math.nan),
        signed_percentiles=_by_share(counted, SIGNED_PERCENTILES) if compared.signed else {},
        percentiles=_by_share(absolute, PERCENTILES),
        le90_normal=NORMAL_90 * quality.rms_error,
        le95_normal=NORMAL_95 * quality.rms_error,
        resolution=taken.resolution,
        histogram=_histogram(counted, compared.signed),
        surface_error=quality.surface_error,
        space=_space(compared, space_samples),
        line_max_error=quality.line_max_error,
        line_mean_error=quality.line_mean_error,
        angles=_angles(compared.vertices if is_closed else compared.vertices[:, :2], compared.faces),
        triangles=quality.triangles,
        vertices=quality.vertices,
        original_triangles=len(model.faces),
        original_vertices=surface.n_vertices,
    )


class _Values(NamedTuple):
    """Values (n,), how much each counts, and how often it is there; None: 1. No more than one of both."""

    values: FloatArray
    weights: FloatArray | None
    counts: IntArray | None

    def at(self, shares: Sequence[float]) -> FloatArray:
        """Return the values below which these shares are."""
        return quantiles(self.values, shares, self.weights, self.counts)

    def where(self, chosen: BoolArray) -> _Values:
        """Return some of them."""
        return _Values(
            self.values[chosen],
            None if self.weights is None else self.weights[chosen],
            None if self.counts is None else self.counts[chosen],
        )

    def but(self, values: FloatArray) -> _Values:
        """Return them with other values."""
        return self._replace(values=values)


class _Taken(NamedTuple):
    """What one pass over all check points leaves."""

    signed: _Values
    absolute: _Values
    check_points: int
    uncovered: int
    max_row: int
    resolution: float


def _take(compared: Compared) -> _Taken:
    """Take all residuals together: one by one, or as a fine histogram where there are too many to hold."""
    all_weights, largest = compared.weights, compared.quality.max_error
    n_points = n_uncovered = 0
    max_row, found_max = 0, -1.0
    is_fine = compared.surface.n_vertices > EXACT_POINTS and isinstance(compared.surface, GridSurface)
    fine, bare = np.zeros((2, 2 * FINE_BINS), np.int64)
    columns: list[tuple[FloatArray, BoolArray, FloatArray | None]] = []
    for vertices, values, covered in compared.parts():
        weights = None
        if all_weights is not None:
            counting = all_weights[vertices] > 0.0
            vertices, values, covered = vertices[counting], values[counting], covered[counting]
            weights = all_weights[vertices]
        if not len(vertices):
            continue
        n_points += len(vertices)
        n_uncovered += int((~covered).sum())
        top = int(np.argmax(np.abs(values)))
        if abs(values[top]) > found_max:
            found_max, max_row = abs(float(values[top])), int(vertices[top])
        if is_fine:
            bins = np.clip(((values / (largest or 1.0) + 1.0) * FINE_BINS).astype(np.int64), 0, 2 * FINE_BINS - 1)
            fine += np.bincount(bins[covered], minlength=2 * FINE_BINS)
            bare += np.bincount(bins[~covered], minlength=2 * FINE_BINS)
        else:
            columns.append((values, covered, weights))
    if is_fine:
        width = largest / FINE_BINS
        centres = np.asarray((np.arange(2 * FINE_BINS) + 0.5 - FINE_BINS) * width, np.float64)
        signed = _Values(centres, None, fine).where(fine > 0)
        both = fine + bare
        absolute = _Values(np.abs(centres), None, both).where(both > 0)
        return _Taken(signed, absolute, n_points, n_uncovered, max_row, width)
    values, covered = (np.concatenate([column[k] for column in columns]) for k in (0, 1))
    weights = None if all_weights is None else np.concatenate([w for *_, w in columns if w is not None])
    every = _Values(values, weights, None)
    return _Taken(every.where(covered), every.but(np.abs(values)), n_points, n_uncovered, max_row, 0.0)


def quantiles(
    values: FloatArray,
    shares: Sequence[float],
    weights: FloatArray | None = None,
    counts: IntArray | None = None,
) -> FloatArray:
    """Return the values below which these shares of all are, by linear interpolation between neighbours.

    Parameters
    ----------
    values : (n,) float array
        In any order.
    shares : sequence of float
        Between 0 and 1.
    weights : (n,) array, optional
        How much each counts, above 0; equal ones give the same as none.
    counts : (n,) int array, optional
        Instead, how often each is there.

    Examples
    --------
    >>> quantiles(np.arange(11.0), [0.0, 0.5, 0.9]).tolist()
    [0.0, 5.0, 9.0]
    >>> quantiles(np.arange(11.0), [0.0, 0.5, 0.9], np.full(11, 7.0)).tolist()
    [0.0, 5.0, 9.0]
    >>> quantiles(np.array([4.0, 0.0]), [0.5, 1.0], counts=np.array([1, 3])).tolist()
    [0.0, 4.0]
    """
    if not len(values):
        return np.full(len(shares), np.nan)
    if weights is None and counts is None:
        return np.asarray(np.quantile(values, shares))
    order = np.argsort(values, kind="stable")
    if counts is not None:
        ordered, end = values[order], np.cumsum(counts[order])
        at = np.asarray(shares) * (end[-1] - 1)
        below, above = (ordered[np.searchsorted(end, rank(at), side="right")] for rank in (np.floor, np.ceil))
        return np.asarray(below + (above - below) * (at - np.floor(at)))
    ordered, w = values[order], np.asarray(weights, float)[order]
    at = np.concatenate([[0.0], np.cumsum((w[1:] + w[:-1]) / 2.0)])
    return np.asarray(np.interp(np.asarray(shares) * at[-1], at, ordered))


def _by_share(values: _Values, percentiles: Sequence[float]) -> dict[float, float]:
    found = values.at([percent / 100.0 for percent in percentiles])
    return dict(zip(percentiles, found.tolist(), strict=True))


def _moments(signed: _Values) -> dict[str, float]:
    """Return bias, standard deviation, median and NMAD of signed residuals."""
    r, w = signed.values, signed.weights if signed.counts is None else signed.counts
    if not len(r):
        return {}
    bias, median = float(np.average(r, weights=w)), float(signed.at([0.5])[0])
    return {
        "bias": bias,
        "standard_deviation": math.sqrt(float(np.average((r - bias) ** 2, weights=w))),
        "median": median,
        "nmad": NORMAL_MAD * float(signed.but(np.abs(r - median)).at([0.5])[0]),
    }


def _histogram(values: _Values, signed: bool) -> Histogram:
    """Count values: even bins up to a percentile of their size, and beyond it one bin on each side, if needed."""
    r = values.values
    if not len(r):
        return Histogram((0.0, 0.0), (0,))
    low, high = float(r.min()), float(r.max())
    inner = float(quantiles(np.abs(r), [INNER_PERCENTILE / 100.0], counts=values.counts)[0])
    if inner == 0.0:
        inner = max(-low, high) or 1.0
    # an odd number, the middle one about 0, where the vertices of the mesh lie
    edges = inner * (np.arange(-BINS, BINS + 1, 2) if signed else np.arange(BINS + 1)) / BINS
    before = [low] if low < edges[0] else []
    after = [high] if high > edges[-1] else []
    edges = np.concatenate([before, edges, after])
    counts, _ = np.histogram(r, edges, weights=values.counts)
    return Histogram(tuple(edges.tolist()), tuple(int(count) for count in counts))


def _angles(xy: FloatArray, faces: IntArray) -> Angles:
    angles = least_angles(xy, faces)
    edges = np.arange(0.0, 60.0 + ANGLE_BIN, ANGLE_BIN)
    counts, _ = np.histogram(np.minimum(angles, 60.0), edges)
    return Angles(
        float(angles.min()),
        _by_share(_Values(angles, None, None), ANGLE_PERCENTILES),
        {limit: float((angles < limit).mean()) for limit in THIN_ANGLES},
        Histogram(tuple(edges.tolist()), tuple(int(count) for count in counts)),
    )


# ----------------------------------------------------------------------------------------------------------- in space


def points_on(vertices: FloatArray, faces: IntArray, count: int) -> FloatArray:
    """Return points (count, 3) that are spread evenly over triangles, the same for the same triangles.

    The k-th lies in the triangle at which (k + 1/2) / count of the area is passed, there at the k-th place of a
    sequence that fills it evenly.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> points_on(square, np.array([[0, 1, 2], [0, 2, 3]]), 1000).mean(axis=0).round(2).tolist()
    [0.5, 0.5, 0.0]
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    passed = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    k = np.arange(count)
    at = np.minimum(np.searchsorted(passed, (k + 0.5) / count * passed[-1], side="right"), len(faces) - 1)
    s, t = (0.5 + k / _PLASTIC) % 1.0, (0.5 + k / _PLASTIC**2) % 1.0
    beyond = s + t > 1.0
    s, t = np.where(beyond, 1.0 - s, s)[:, None], np.where(beyond, 1.0 - t, t)[:, None]
    found: FloatArray = a[at] + s * (b - a)[at] + t * (c - a)[at]
    return found


def _space(compared: Compared, samples: int | None) -> SpaceDistance | None:
    surface = compared.surface
    n_faces = len(surface.faces)
    if samples is None:
        samples = min(max(FACE_SAMPLES * n_faces, LEAST_SAMPLES), MOST_SAMPLES)
    if samples <= 0 or n_faces > MOST_FACES:
        return None
    points, faces = np.asarray(surface.points), np.asarray(surface.faces)
    mesh = compared.vertices, compared.faces
    return SpaceDistance(_directed(points, faces, *mesh, samples), _directed(*mesh, points, faces, samples))


def _directed(
    points: FloatArray, faces: IntArray, other_points: FloatArray, other_faces: IntArray, samples: int
) -> Distance:
    tree = MeshTree(other_points, other_faces)
    evenly, _ = tree.distances(points_on(points, faces, samples))
    at_vertices, _ = tree.distances(points[used_rows(faces)[0]])
    largest = max(float(evenly.max()), float(at_vertices.max()))
    rms = math.sqrt(float((evenly**2).mean()))
    return Distance(float(evenly.mean()), rms, largest, len(evenly) + len(at_vertices))
