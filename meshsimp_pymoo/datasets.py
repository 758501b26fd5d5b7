"""Built-in models by name: nothing to download, known answers, any size.

A model is named as in ``load("roof")``; a colon adds parameters, in a form that needs no quoting in a shell
or in YAML::

    jacksboro             the model with its defaults
    jacksboro:11          its main parameter (here the stride, so every 11th post of the grid)
    face:5000,seed=3      the main parameter, then others by name
    face:vertices=5000    the main parameter by name

``describe()`` lists all of them with their parameters, and ``meshsimp info NAME`` shows one.

Two are real terrain from the sample data that matplotlib installs. The others are made here: surfaces whose
whole front is known (``plane``, ``roof``, ``pyramid``), smooth and rough test surfaces, a synthetic scan of a
face, outlines with a hole or a bay, an embankment with break lines (``load_lines``), and closed surfaces, with flat
faces (``tetrahedron``, ``cube``, ``icosahedron``), smooth (``sphere``, ``ellipsoid``, ``blob``), of several parts
(``pebbles``) or with sharp edges (``bracket``); a ``blob`` with holes is a scan of a body. Everything is a pure
function of the parameters, the scan noise included.
"""

from __future__ import annotations

import inspect
import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, meant, reason_of
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.source.lines import SourceLines

__all__ = ["describe", "load", "load_lines", "names"]


METRES_PER_DEGREE = 111_200.0  # of latitude, at the latitudes of both terrains (36 and 49 degrees north), to 0.05 %
SPACING_STEP = (
    1 / 1024
)  # metres; grid spacings are multiples of it, so that row and column positions are exact in binary
MAX_SIDE = 4097  # vertices per side of a square grid: 17 million vertices, beyond any use here
MAX_SCATTERED = 2_000_000  # vertices of a scattered model; their first triangulation takes half a minute
MAX_EDGE = 513  # vertices along an edge of a polyhedron: 2.6 million on an icosahedron

# Corners of a curved outline; far more than the vertices on it, so that no three of those lie on a line.
OUTLINE_SAMPLES = 24_000

# The R2 low-discrepancy sequence (M. Roberts, 2018): with the plastic number, the first n points of it cover
# a square evenly for every n, which gives a model of exactly the wanted number of vertices without clumps.
PLASTIC_NUMBER = 1.324717957244746


def load(name: str, /, **parameters: float) -> SourceMesh:
    """Make the built-in model of this name.

    Parameters
    ----------
    name : str
        A name out of :func:`names`, optionally followed by parameters: ``"jacksboro:11"``,
        ``"face:5000,seed=3"``.
    **parameters : int or float
        The same parameters by keyword; they win over those spelled in the name.

    Returns
    -------
    SourceMesh
        Its ``name`` is the spelled name with the parameters in effect where they differ from the defaults.

    Raises
    ------
    ModelError
        If there is no such model (the nearest name is suggested), or a parameter does not exist or is out of
        range.

    Examples
    --------
    Two roof planes that meet in a ridge, 17 vertices a side:

    >>> roof = load("roof:17")
    >>> roof.points.shape, float(roof.points[:, 2].max())
    ((289, 3), 1.0)
    """
    source, full_name = _made(name, parameters, _MODELS)
    return replace(source, name=full_name)


def load_lines(name: str, /, **parameters: float) -> SourceLines:
    """Make the break lines that a built-in model has; ``break_lines=`` takes their ``lines``.

    Parameters
    ----------
    name : str
        That of the model, spelled as in :func:`load`: its lines fit the same parameters.
    **parameters : int or float
        The same parameters by keyword.

    Returns
    -------
    SourceLines

    Raises
    ------
    ModelError
        If there is no such model, it has no lines, or a parameter does not exist or is out of range.

    Examples
    --------
    >>> lines = load_lines("embankment")
    >>> lines.names, lines.lines[0].shape
    (('toe 1', 'crest 1', 'crest 2', 'toe 2'), (201, 3))
    """
    lines, full_name = _made(name, parameters, _LINES)
    return replace(lines, name=full_name)


def _made(name: str, parameters: dict[str, float], table: dict[str, Callable[..., Any]]) -> tuple[Any, str]:
    """Make what a table has under a name, and spell the name with the parameters that are not the defaults."""
    base, _, spelled = name.partition(":")
    if base not in _MODELS:
        raise ModelError(_unknown(name, base))
    if base not in table:
        raise ModelError(f"{name}: has no lines of its own; those that have: {', '.join(table)}")
    known = inspect.signature(table[base]).parameters
    given = _spelled_parameters(name, base, spelled, known) | parameters
    for key, value in given.items():
        if key not in known:
            raise ModelError(f"{name}: no parameter {key!r}{meant(key, known)}; {base} takes {', '.join(known)}")
        given[key] = _number(name, key, value, known[key])
    try:
        made = table[base](**given)
    except ValueError as problem:
        raise ModelError(f"{name}: {problem}") from None
    changed = {key: given[key] for key in known if key in given and given[key] != known[key].default}
    if changed:
        main = next(iter(known))
        base += ":" + ",".join(f"{v}" if k == main else f"{k}={v}" for k, v in changed.items())
    return made, base


def names() -> list[str]:
    """Return the names of the built-in models.

    Examples
    --------
    >>> "jacksboro" in names()
    True
    """
    return list(_MODELS)


def describe() -> dict[str, str]:
    """Return one line about each built-in model: its name with all parameters and defaults, and what it is.

    Examples
    --------
    >>> describe()["plane"]
    'plane:side=9 - a tilted plane; 2 triangles are exact, so the front is that one point'
    """
    lines = {}
    for name, make in _MODELS.items():
        parameters = inspect.signature(make).parameters.values()
        spelled = ",".join(f"{p.name}={p.default}" for p in parameters)
        summary = (make.__doc__ or "").strip().splitlines()[0]
        lines[name] = f"{name}:{spelled} - {summary.removeprefix('Return ').rstrip('.')}"
    return lines


# -------------------------------------------------------------------------------------------------------- real terrain


def _jacksboro(stride: int = 1, vertices: int = 0, seed: int = 1) -> SourceMesh:
    """Return real terrain in metres (Jacksboro fault): every stride-th post, or that many scattered ones."""
    with np.load(_sample_data("jacksboro_fault_dem.npz"), allow_pickle=False) as file:
        elevation = file["elevation"].astype(np.float64)
        middle = math.radians(0.5 * float(file["ymin"] + file["ymax"]))
        dx = float(file["dx"]) * METRES_PER_DEGREE * math.cos(middle)
        dy = float(file["dy"]) * METRES_PER_DEGREE
    return _terrain(elevation, dx, dy, stride, vertices, seed)


def _topobathy(stride: int = 1, vertices: int = 0, seed: int = 1) -> SourceMesh:
    """Return land and sea floor in metres (Juan de Fuca): every stride-th post, or that many scattered."""
    with np.load(_sample_data("topobathy.npz"), allow_pickle=False) as file:
        elevation = file["topo"][::-1].astype(np.float64)  # the file begins in the south
        longitude, latitude = file["longitude"].astype(np.float64), file["latitude"].astype(np.float64)
    # Its rows lie evenly in Mercator's projection, whose scale is the same in both directions; true at mid
    # latitude.
    side = METRES_PER_DEGREE * math.cos(math.radians(float(latitude.mean()))) * float(np.diff(longitude).mean())
    return _terrain(elevation, side, side, stride, vertices, seed)


def _sample_data(file: str) -> Path:
    try:
        from matplotlib.cbook import get_sample_data
    except OSError as problem:  # it has no place for its cache
        raise ModelError(f"{file}: is sample data of matplotlib, which cannot be used ({reason_of(problem)})") from None
    path = Path(get_sample_data(file, asfileobj=False))
    if not path.is_file():
        raise ModelError(
            f"{path} is missing; reinstall matplotlib with its sample data (some Linux packages leave them out)"
        )
    return path


def _terrain(elevation: FloatArray, dx: float, dy: float, stride: int, vertices: int, seed: int) -> SourceMesh:
    rows, cols = elevation.shape
    if not 1 <= stride < min(rows, cols):
        raise ValueError(
            f"stride is {stride}; a grid of {rows} x {cols} posts can be read at 1 to {min(rows, cols) - 1}"
        )
    dx, dy = (max(1, round(step / SPACING_STEP)) * SPACING_STEP * stride for step in (dx, dy))
    source = grid_source(elevation[::stride, ::stride], dx, dy)
    if not vertices:
        return source
    # Scattered vertices of the grid, its corners among them: a surveyed terrain of any N.
    points = source.points
    _check_range("vertices", vertices, 4, len(points))
    x, y = points[:, 0], points[:, 1]
    corner = np.flatnonzero(np.isin(x, (x.min(), x.max())) & np.isin(y, (y.min(), y.max())))
    others = np.setdiff1d(np.arange(len(points)), corner)
    chosen = np.random.default_rng(seed).choice(others, size=vertices - 4, replace=False)
    points = points[np.sort(np.concatenate([corner, chosen]))]
    return SourceMesh(points, _delaunay(points[:, :2]), {}, name="terrain", up="z")


# ----------------------------------------------------------------------------------------- square grids, known answers


def _plane(side: int = 9) -> SourceMesh:
    """Return a tilted plane; 2 triangles are exact, so the front is that one point."""
    return _square(side, lambda x, y: 0.25 * x + 0.5 * y, exact=True)


def _roof(side: int = 17) -> SourceMesh:
    """Return two planes that meet in a ridge; 4 triangles are exact, 2 have the error side (side - 1) / 2."""
    return _square(side, lambda x, y: 1.0 - np.abs(x), exact=True)


def _pyramid(side: int = 17) -> SourceMesh:
    """Return four planes meeting in an apex; 4 triangles are exact, 2 have the error side (side - 2) / 3."""
    return _square(side, lambda x, y: 1.0 - np.maximum(np.abs(x), np.abs(y)), exact=True)


def _saddle(side: int = 33) -> SourceMesh:
    """Return a hyperbolic paraboloid, x y: curved everywhere, straight along its grid lines."""
    return _square(side, lambda x, y: x * y, exact=True)


def _peaks(side: int = 33) -> SourceMesh:
    """Return three hills and three hollows on a plain, the usual smooth test surface."""

    def height(x: FloatArray, y: FloatArray) -> FloatArray:
        u, v = 3 * x, 3 * y
        return (
            3 * (1 - u) ** 2 * np.exp(-(u**2) - (v + 1) ** 2)
            - 10 * (u / 5 - u**3 - v**5) * np.exp(-(u**2) - v**2)
            - np.exp(-((u + 1) ** 2) - v**2) / 3
        ) / 8

    return _square(side, height)


def _ridge(side: int = 33) -> SourceMesh:
    """Return a sharp crest that winds across a valley: long thin triangles along it pay off."""
    return _square(side, lambda x, y: np.exp(-4 * np.abs(y - 0.35 * np.sin(3 * x) - 0.2 * x)))


def _crater(side: int = 49) -> SourceMesh:
    """Return a ring wall around a bowl with a central peak on a gentle slope."""

    def height(x: FloatArray, y: FloatArray) -> FloatArray:
        r = np.hypot(x - 0.1, y + 0.05)
        wall = 0.35 * np.exp(-np.abs(r - 0.55) * np.where(r < 0.55, 9.0, 5.0))
        bowl = -0.25 * np.clip(1 - (r / 0.5) ** 2, 0, None)
        peak = 0.22 * np.clip(1 - r / 0.14, 0, None)
        return wall + bowl + peak + 0.05 * x

    return _square(side, height)


def _square(side: int, height: Callable[[FloatArray, FloatArray], FloatArray], *, exact: bool = False) -> SourceMesh:
    """Sample a height function on a square grid over [-1, 1] x [-1, 1]."""
    _check_range("side", side, 3, MAX_SIDE)
    if exact:
        _check_exact(side)
    step = 2.0 / (side - 1)
    at = np.arange(side) * step
    x, y = np.meshgrid(at - 1.0, 1.0 - at)
    return grid_source(height(x, y), step, step, origin=(-1.0, 1.0))


# -------------------------------------------------------------------------------------------------- scattered vertices


def _face(vertices: int = 2500, seed: int = 1, noise: float = 0.08) -> SourceMesh:
    """Return a synthetic scan of a face in millimetres, any number of vertices, with scan noise."""
    outline = _closed_curve(_face_outline)
    return _scattered(vertices, seed, noise, [outline], _face_relief)


def _ring(vertices: int = 900, seed: int = 1, noise: float = 0.0) -> SourceMesh:
    """Return a ring with a ripple on it: an outline with a hole, which must not be bridged."""
    outer = _closed_curve(lambda t: (np.cos(t), np.sin(t)))
    inner = _closed_curve(lambda t: (0.15 + 0.4 * np.cos(-t), 0.45 * np.sin(-t)))
    return _scattered(vertices, seed, noise, [outer, inner], lambda x, y: 0.12 * np.sin(7 * x + 2 * y) + 0.1 * x * y)


def _horseshoe(vertices: int = 900, seed: int = 1, noise: float = 0.0) -> SourceMesh:
    """Return a horseshoe with bumps on it: a deeply concave outline, whose bay must not be bridged."""
    turn = np.linspace(-0.25 * math.pi, 1.25 * math.pi, OUTLINE_SAMPLES // 4)
    half = np.linspace(0, math.pi, OUTLINE_SAMPLES // 16)[1:-1]

    def arc(radius: float, angle: FloatArray, centre: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
        return np.column_stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)])

    first, last = (
        (0.75 * np.cos(turn[0]), 0.75 * np.sin(turn[0])),
        (0.75 * np.cos(turn[-1]), 0.75 * np.sin(turn[-1])),
    )
    outline = [
        arc(1, turn),
        arc(0.25, turn[-1] + half, last),
        arc(0.5, turn[::-1]),
        arc(0.25, turn[0] + math.pi + half, first),
    ]
    return _scattered(
        vertices, seed, noise, [np.concatenate(outline)], lambda x, y: 0.1 * np.cos(6 * x) * np.sin(5 * y + x)
    )


# Sizes of the embankment in metres: how far it and the land around it reach, half the width of its crest, how far its
# sides go out for each metre up.
BANK_LENGTH, BANK_WIDTH, HALF_CREST, BANK_SLOPE = 1000.0, 600.0, 4.0, 2.0


def _embankment(vertices: int = 5600, stations: int = 201, seed: int = 1, noise: float = 0.1) -> SourceMesh:
    """Return a road embankment in metres on gentle land; its toes and crests are lines, see load_lines."""
    lines = np.concatenate(_embankment_lines(vertices, stations, seed, noise).lines)
    outline = np.array([[0.0, 0.0], [BANK_LENGTH, 0.0], [BANK_LENGTH, BANK_WIDTH], [0.0, BANK_WIDTH]])
    # the outline is straight, so its corners and the ends of the lines are vertices, and others lie between
    gap = math.sqrt(BANK_LENGTH * BANK_WIDTH / vertices)
    rim = []
    on_sides = lines[np.isin(lines[:, 0], (0.0, BANK_LENGTH)), :2]
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along = (b - a) / np.hypot(*(b - a))
        n_steps = math.ceil(np.hypot(*(b - a)) / gap)
        steps = a + np.linspace(0.0, 1.0, n_steps, endpoint=False)[:, None] * (b - a)
        near = np.abs((steps[:, None] - on_sides) @ along).min(axis=1) < gap / 2
        away = np.abs((steps[:, None] - on_sides) @ [along[1], -along[0]]).min(axis=1) > gap / 2
        rim.append(steps[~near | away])
    rim_xy = np.concatenate(rim)
    rng = np.random.default_rng(seed)
    start = rng.random(2)
    n_inner = vertices - len(lines) - len(rim_xy)
    inner = np.empty((0, 2))
    tries = 1.2 * vertices
    while len(inner) < n_inner:
        k = np.arange(1, int(tries) + 1)[:, None]
        even = np.array([BANK_LENGTH, BANK_WIDTH]) * np.mod(start + k / PLASTIC_NUMBER ** np.array([1.0, 2.0]), 1.0)
        inner = even[~_near_points(even, np.concatenate([lines[:, :2], rim_xy]), 0.4 * gap)]
        tries *= 1.3
    xy = np.concatenate([rim_xy, inner[:n_inner]])
    z = _embankment_height(*xy.T) + rng.normal(0.0, 1.0, len(xy)) * noise
    points = np.concatenate([lines, np.column_stack([xy, z])])
    return SourceMesh(points, _delaunay(points[:, :2]), {}, name="embankment", up="z")


def _embankment_lines(vertices: int = 5600, stations: int = 201, seed: int = 1, noise: float = 0.1) -> SourceLines:
    """Return the two toes and the two crests, of so many vertices each, surveyed without noise."""
    _check_range("vertices", vertices, 1000, MAX_SCATTERED)
    _check_range("stations", stations, 51, vertices // 6)
    if not 0 <= noise < math.inf:
        raise ValueError(f"noise is {noise:g}; it must be 0 or more [metres]")
    x = np.linspace(0.0, BANK_LENGTH, stations)
    middle, crest = _embankment_axis(x)
    lines = []
    for side in (-1.0, 1.0):
        # where the side, which falls evenly, meets the land
        out = np.full(stations, HALF_CREST)
        for _ in range(60):
            out = HALF_CREST + BANK_SLOPE * (crest - _land(x, middle + side * out))
        toe = middle + side * out
        both = [np.column_stack([x, toe, _land(x, toe)]), np.column_stack([x, middle + side * HALF_CREST, crest])]
        lines += both if side < 0 else both[::-1]
    return SourceLines("embankment", tuple(lines), ("toe 1", "crest 1", "crest 2", "toe 2"))


def _embankment_axis(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the middle of the crest is, and how high, at stations along it [m]."""
    turn = 2.0 * math.pi * x / BANK_LENGTH
    return 0.5 * BANK_WIDTH + 60.0 * np.sin(turn + 0.4), 60.0 + 3.0 * np.sin(1.5 * turn) + 0.004 * x


def _land(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the height of the land without the embankment [m]."""
    return 46.0 + 3.0 * np.sin(x / 130.0) * np.cos(y / 170.0) + 1.5 * np.cos(x / 60.0 - y / 80.0) + 0.01 * x - 0.008 * y


def _embankment_height(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the height of land and embankment [m]: the higher of the land and of the bank's sides and crest."""
    middle, crest = _embankment_axis(x)
    return np.maximum(_land(x, y), crest - np.clip(np.abs(y - middle) - HALF_CREST, 0.0, None) / BANK_SLOPE)


def _near_points(points: FloatArray, others: FloatArray, distance: float) -> npt.NDArray[np.bool_]:
    """Tell which points (n, 2) lie within a distance of others (m, 2)."""
    from scipy.spatial import cKDTree

    found, _ = cKDTree(others).query(points, distance_upper_bound=distance)
    return np.isfinite(found)


def _face_outline(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Outline of a face seen from the front [mm]: wide at the temples, narrow at the chin."""
    x, y = np.cos(t), np.sin(t)
    width = 72.0 * (1 + 0.05 * y - 0.10 * np.clip(-y, 0, None) ** 2)
    return width * x, 104.0 * y - 2.0


def _face_relief(x: FloatArray, y: FloatArray) -> FloatArray:
    """Height of the face above the picture plane [mm]; x to the right, y up, from between nose and eyes."""

    def bump(cx: float, cy: float, sx: float, sy: float, power: float = 1.0) -> FloatArray:
        return np.exp(-((((x - cx) / sx) ** 2 + ((y - cy) / sy) ** 2) ** power))

    ax = np.abs(x)
    head = 78.0 * np.sqrt(np.clip(1 - (x / 88.0) ** 2 - ((y - 4) / 128.0) ** 2, 0.02, None))
    # The nose: a wedge that widens and rises from the root down to the tip, with wings and an underside.
    down = np.clip((32.0 - y) / 56.0, 0, 1)  # 0 at the root, 1 at the tip
    half_width = 6.0 + 7.5 * down
    underside = 1 / (1 + np.exp(-(y + 29.5 - 0.15 * ax) / 2.6))
    nose = (3.0 + 19.0 * down**1.3) * np.exp(-((ax / half_width) ** 2.4)) * underside * np.clip((40 - y) / 12, 0, 1)
    nose += 5.5 * bump(0, -21, 8.5, 8.0)
    nose += 6.0 * (bump(-13, -23, 5.5, 6.5) + bump(13, -23, 5.5, 6.5))
    nose -= 4.0 * (bump(-6, -30.5, 3.6, 2.2) + bump(6, -30.5, 3.6, 2.2))
    # Eyes: a socket, the lids over the ball, and the slit between them.
    eyes = np.zeros_like(x)
    for side in (-32.0, 32.0):
        eyes -= 9.5 * bump(side * 0.97, 23, 17, 11)
        eyes += 6.8 * bump(side, 21.5, 11.5, 7.5, 1.6)
        u = (x - side) / 12.5
        lid = np.clip(1 - u**2, 0, None)
        for level, depth in ((21.5 + 4.6 * lid, 1.9), (21.5 - 3.6 * lid, 1.3)):
            eyes -= depth * np.exp(-(((y - level) / 1.5) ** 2)) * (np.abs(u) < 1.0) * np.sqrt(lid)
    # The brows follow a curve, lower at the root of the nose and at the temples.
    arch = 38.0 + 4.5 * np.sin(np.clip(ax, 0, 62) / 62.0 * math.pi)
    brow = 4.5 * np.exp(-(((y - arch) / 6.5) ** 2)) * np.exp(-(((ax - 30) / 24) ** 4))
    # Mouth: two lips full in the middle, the line between them, the groove above and the hollow below.
    u = x / 24.0
    inside = np.clip(1 - u**2, 0, None)
    line = -53.5 + 1.8 * u**2 - 0.8 * np.exp(-((x / 5.0) ** 2))
    mouth = 5.5 * bump(0, -52, 34, 19)
    mouth += 3.4 * np.exp(-(((y - line - 3.4 * inside) / 3.6) ** 2)) * inside**0.7
    mouth += 4.4 * np.exp(-(((y - line + 4.6 * inside) / 4.4) ** 2)) * inside**0.7
    mouth -= 3.2 * np.exp(-(((y - line) / 1.8) ** 2)) * inside**0.4
    mouth -= 1.6 * np.exp(-((x / 3.4) ** 2)) * np.exp(-(((y + 40) / 6.5) ** 2))
    mouth -= 3.0 * bump(0, -68, 18, 5.0)
    cheeks = 5.0 * (bump(-43, -8, 19, 19) + bump(43, -8, 19, 19))
    fold = -1.7 * np.exp(-(((ax - 20 - 0.45 * (-24 - y)) / 5.0) ** 2)) * np.exp(-(((y + 34) / 12) ** 2))
    chin = 11.0 * bump(0, -84, 21, 13)
    temples = -4.0 * (bump(-66, 40, 16, 26) + bump(66, 40, 16, 26))
    return head + nose + eyes + brow + mouth + cheeks + fold + chin + temples


def _closed_curve(curve: Callable[[FloatArray], tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Return a closed polygon (OUTLINE_SAMPLES, 2) along a curve of the angle 0 .. 2 pi."""
    return np.column_stack(curve(np.linspace(0, 2 * math.pi, OUTLINE_SAMPLES, endpoint=False)))


def _scattered(
    vertices: int,
    seed: int,
    noise: float,
    outlines: list[FloatArray],
    height: Callable[[FloatArray, FloatArray], FloatArray],
) -> SourceMesh:
    """Scatter exactly that many vertices evenly but irregularly over a region and triangulate them inside it.

    Parameters
    ----------
    vertices : int
        Vertices in all, those on the outlines included.
    seed : int
        Of the sampling and of the noise.
    noise : float
        Standard deviation of the noise added to the heights [model units].
    outlines : list of (k, 2) float arrays
        The outer outline first, then the holes; dense closed polygons that do not cross.
    height : callable
        Height of the surface at (x, y) [model units].
    """
    _check_range("vertices", vertices, 60, MAX_SCATTERED)
    if not 0 <= noise < math.inf:
        raise ValueError(f"noise is {noise:g}; it must be 0 or more [model units]")
    rng = np.random.default_rng(seed)
    area = sum(_signed_area(polygon) * (1 if i == 0 else -1) for i, polygon in enumerate(map(_turned_left, outlines)))
    gap = math.sqrt(area * 2 / math.sqrt(3) / vertices)  # edge of the equilateral triangles that would fill the region
    border = [_evenly_along(polygon, gap, rng) for polygon in outlines]
    rim = np.concatenate(border)
    if len(rim) > vertices:
        raise ValueError(f"vertices is {vertices}; the outline alone takes {len(rim)}")

    box = outlines[0].min(axis=0), np.ptp(outlines[0], axis=0)
    tries = 1.05 * vertices * float(box[1].prod()) / area
    inner = _evenly_within(border, vertices - len(rim), gap, box, rng.random(2), tries)
    inner = inner + rng.uniform(-0.12 * gap, 0.12 * gap, inner.shape)
    xy = np.concatenate([rim, inner])
    faces = _delaunay_within(xy, border)
    z = height(xy[:, 0], xy[:, 1]) + rng.normal(0.0, 1.0, len(xy)) * noise
    return SourceMesh(np.column_stack([xy, z]), faces, {}, name="scattered", up="z")


def _evenly_within(
    border: list[FloatArray],
    n: int,
    gap: float,
    box: tuple[FloatArray, FloatArray],
    start: FloatArray,
    tries: float,
) -> FloatArray:
    """Return n points inside closed polygons that keep away from them: the first ones of the R2 sequence that do.

    Parameters
    ----------
    border : list of (k, 2) float arrays
        The outline and the holes, of vertices about ``gap`` apart.
    n : int
    gap : float
        How far the points are apart, about.
    box : (2,) and (2,) float array
        Lowest corner and extent of the outline.
    start : (2,) float array
        Where the sequence begins, in the unit square.
    tries : float
        Of how many terms of the sequence enough are taken, by estimate.
    """
    inner = np.empty((0, 2))
    while len(inner) < n:
        k = np.arange(1, int(tries) + 1)[:, None]
        even = box[0] + box[1] * np.mod(start + k / PLASTIC_NUMBER ** np.array([1.0, 2.0]), 1.0)
        inner = even[_inside(even, border) & ~_near(even, border, 0.45 * gap)]
        tries *= 1.3
    # The first points of the sequence are as even as all of them, so that the count can be cut to the wanted
    # one.
    return inner[:n]


def _delaunay_within(xy: FloatArray, border: list[FloatArray]) -> IntArray:
    """Return the Delaunay triangles (T, 3) inside closed polygons, whose vertices the points (n, 2) begin with."""
    faces = _delaunay(xy)
    on_rim = (faces < sum(len(line) for line in border)).all(axis=1)
    outside = np.zeros(len(faces), dtype=bool)
    outside[on_rim] = ~_inside(xy[faces[on_rim]].mean(axis=1), border)
    return faces[~outside]


def _evenly_along(polygon: FloatArray, gap: float, rng: np.random.Generator) -> FloatArray:
    """Return points about ``gap`` apart on a closed polygon, irregular by a quarter of it."""
    closed = np.concatenate([polygon, polygon[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    count = max(8, round(length[-1] / gap))
    at = (np.arange(count) + rng.uniform(-0.25, 0.25, count)) * (length[-1] / count) % length[-1]
    at.sort()
    return np.column_stack([np.interp(at, length, closed[:, axis]) for axis in (0, 1)])


def _delaunay(xy: FloatArray) -> IntArray:
    """Return the Delaunay triangles (T, 3) of points (n, 2), counter-clockwise."""
    from scipy.spatial import Delaunay

    faces = Delaunay(xy).simplices.astype(np.int64)
    a, b, c = (xy[faces[:, k]] for k in range(3))
    twice_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[twice_area < 0] = faces[twice_area < 0][:, [0, 2, 1]]
    return faces[twice_area != 0]


def _signed_area(polygon: FloatArray) -> float:
    x, y = polygon.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _turned_left(polygon: FloatArray) -> FloatArray:
    return polygon if _signed_area(polygon) > 0 else polygon[::-1]


def _inside(points: FloatArray, polygons: list[FloatArray]) -> npt.NDArray[np.bool_]:
    """Tell from which points (n, 2) a ray to the right crosses an odd number of polygon edges."""
    order = np.argsort(points[:, 1], kind="stable")
    x, y = points[order].T
    odd = np.zeros(len(points), dtype=bool)
    for polygon in polygons:
        start, end = polygon, np.roll(polygon, -1, axis=0)
        ends = np.sort(np.searchsorted(y, [start[:, 1], end[:, 1]], side="left"), axis=0)
        for (x0, y0), (x1, y1), first, last in zip(start, end, *ends, strict=True):
            level = y[first:last]
            odd[first:last] ^= x[first:last] < x0 + (level - y0) * (x1 - x0) / (y1 - y0)
    inside = np.empty_like(odd)
    inside[order] = odd
    return inside


def _near(points: FloatArray, polygons: list[FloatArray], distance: float) -> npt.NDArray[np.bool_]:
    """Tell which points (n, 2) lie within a distance of the polygons' edges, each sampled at its thirds."""
    samples = [p + (np.roll(p, -1, axis=0) - p) * t for p in polygons for t in (0.0, 1 / 3, 2 / 3)]
    return _near_points(points, np.concatenate(samples), distance)


# ------------------------------------------------------------------------------------------ closed, with flat faces


def _tetrahedron(side: int = 17) -> SourceMesh:
    """Return a closed tetrahedron of flat faces, each edge of so many vertices; the mesh of its 4 corners is exact."""
    _check_range("side", side, 3, MAX_EDGE)
    _check_exact(side)
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    return _polyhedron(corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]), side - 1)


def _cube(side: int = 17) -> SourceMesh:
    """Return a closed cube of flat faces, each edge of so many vertices; the mesh of its 8 corners is exact."""
    _check_range("side", side, 3, MAX_EDGE)
    _check_exact(side)
    n = side - 1
    u, v = (grid.ravel() for grid in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    cell = (u < n) & (v < n)
    at = np.flatnonzero(cell)
    squares = np.concatenate([[at, at + side, at + side + 1], [at, at + side + 1, at + 1]], axis=1).T
    places = np.empty((6, side * side, 3), np.int64)
    faces = np.empty((6, len(squares), 3), np.int64)
    for k in range(6):
        axis, end = divmod(k, 2)
        places[k, :, axis], places[k, :, (axis + 1) % 3], places[k, :, (axis + 2) % 3] = end * n, u, v
        faces[k] = (squares if end else squares[:, ::-1]) + side * side * k
    place, joined = _joined(places.reshape(-1, 3), faces.reshape(-1, 3))
    return _closed(2.0 * place / n - 1.0, joined)


def _icosahedron(side: int = 9) -> SourceMesh:
    """Return a closed icosahedron of flat faces, each edge of so many vertices; that of its 12 corners is exact."""
    from scipy.spatial import ConvexHull

    _check_range("side", side, 3, MAX_EDGE)
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    plane = np.array([[0.0, y, z] for y in (-1.0, 1.0) for z in (-golden, golden)])
    corners = np.concatenate([np.roll(plane, k, axis=1) for k in range(3)])
    return _polyhedron(corners, _outwards(corners, ConvexHull(corners).simplices), side - 1)


def _polyhedron(corners: FloatArray, faces: IntArray, n: int) -> SourceMesh:
    """Divide triangular faces (F, 3) of corners (C, 3) into n * n triangles each; common edges get common vertices."""
    first, second = (grid.ravel() for grid in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    inside = first + second <= n
    first, second = first[inside], second[inside]
    row = np.full((n + 2, n + 2), -1)
    row[first, second] = np.arange(len(first))
    upright = np.flatnonzero(first + second < n)
    tilted = np.flatnonzero(first + second < n - 1)
    small = np.concatenate(
        [
            np.column_stack([upright, row[first + 1, second][upright], row[first, second + 1][upright]]),
            np.column_stack(
                [row[first + 1, second][tilted], row[first + 1, second + 1][tilted], row[first, second + 1][tilted]]
            ),
        ]
    )
    # how many n-ths of each corner a vertex is: whole numbers, so that those of a common edge are the same
    shares = np.zeros((len(faces), len(first), len(corners)), np.int64)
    for face, (a, b, c) in enumerate(faces):
        shares[face, :, a], shares[face, :, b], shares[face, :, c] = n - first - second, first, second
    all_small = (small + len(first) * np.arange(len(faces))[:, None, None]).reshape(-1, 3)
    share, joined = _joined(shares.reshape(-1, len(corners)), all_small)
    return _closed(share @ corners / n, joined)


def _joined(places: IntArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Make vertices (n, k) in the same place one, in the order of the places."""
    places, row = np.unique(places, axis=0, return_inverse=True)
    return places, row.ravel()[faces]


# ---------------------------------------------------------------------------------------------------- closed and smooth


def _sphere(vertices: int = 1000, seed: int = 1) -> SourceMesh:
    """Return a closed sphere of radius 1, any number of vertices, scattered evenly."""
    return _closed(*_on_sphere(vertices, seed))


def _ellipsoid(vertices: int = 1000, a: float = 3.0, b: float = 2.0, c: float = 1.0, seed: int = 1) -> SourceMesh:
    """Return a closed ellipsoid of semi-axes a, b and c, any number of vertices."""
    for name, axis in {"a": a, "b": b, "c": c}.items():
        if not 0.0 < axis < math.inf:
            raise ValueError(f"{name} is {axis:g}; a semi-axis must be more than 0 [model units]")
    directions, faces = _on_sphere(vertices, seed)
    return _closed(directions * [a, b, c], faces)


def _blob(vertices: int = 2000, seed: int = 1, bumps: float = 0.25, stretch: float = 1.0, holes: int = 0) -> SourceMesh:
    """Return a smooth closed blob, its bumps of that deviation, stretched along x; with holes, a scan of it."""
    if not 0.0 < stretch < math.inf:
        raise ValueError(f"stretch is {stretch:g}; it must be more than 0")
    directions, faces = _on_sphere(vertices, seed)
    points = _bumpy(directions, seed, bumps) * [stretch, 1.0, 1.0]
    if not holes:
        return _closed(points, faces)
    faces = _with_holes(directions, faces, holes, seed)
    used, corners = np.unique(faces, return_inverse=True)
    return SourceMesh(points[used], corners.reshape(-1, 3), {}, name="scan")


def _bumpy(directions: FloatArray, seed: int, bumps: float) -> FloatArray:
    """Return the points (n, 3) of a blob of mean radius 1 in these directions."""
    if not 0.0 <= bumps <= 0.5:
        raise ValueError(f"bumps is {bumps:g}; it must be 0 to 0.5 [mean radii]")
    # plane waves in all directions, the shorter the lower
    rng = np.random.default_rng(seed + 1)
    height, square = np.zeros(len(directions)), 0.0
    for length in np.geomspace(*BLOB_WAVES, 32):
        wave = rng.normal(size=3)
        wave *= 2.0 * math.pi / (length * np.linalg.norm(wave))
        height += length * np.cos(directions @ wave + rng.uniform(0.0, 2.0 * math.pi))
        square += 0.5 * length**2
    radius = np.exp(bumps * height / math.sqrt(square))
    return directions * radius[:, None]


# The longest and the shortest wave on a blob [mean radii].
BLOB_WAVES = 4.0, 0.4


def _on_sphere(vertices: int, seed: int) -> tuple[FloatArray, IntArray]:
    """Scatter exactly that many vertices evenly but irregularly over the unit sphere and triangulate them."""
    from scipy.spatial import ConvexHull

    _check_range("vertices", vertices, LEAST_ON_SPHERE, MAX_SCATTERED)
    rng = np.random.default_rng(seed)
    k = np.arange(vertices) + 0.5
    z = 1.0 - 2.0 * k / vertices
    turn = math.pi * (math.sqrt(5.0) - 1.0) * k + rng.uniform(0.0, 2.0 * math.pi)
    out = np.sqrt(1.0 - z**2)
    points = np.column_stack([out * np.cos(turn), out * np.sin(turn), z])
    gap = _gap_on_sphere(vertices)
    points += rng.uniform(-0.12 * gap, 0.12 * gap, points.shape)
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points, _outwards(points, ConvexHull(points).simplices)


def _gap_on_sphere(vertices: int) -> float:
    """Return the edge of the equilateral triangles that would fill the unit sphere."""
    return math.sqrt(8.0 * math.pi / math.sqrt(3.0) / vertices)


# Vertices on a sphere: so many that its centre is within.
LEAST_ON_SPHERE = 12

# Radii of the first and of the last of several holes, the others between them in equal ratios [radians]; how far a rim
# is off its circle, as a share of its radius, and from one face to the next [edges of faces]. A hole is so many edges
# wide at least, and so many stay between two.
HOLE_RADII, HOLE_WAVE, HOLE_RAGS = (0.4, 0.15), 0.15, 0.5
LEAST_HOLE, MOST_HOLES, BETWEEN_HOLES = 3.0, 12, 2.0


def _with_holes(directions: FloatArray, faces: IntArray, holes: int, seed: int) -> IntArray:
    """Cut discs of different sizes out of the faces (F, 3) of a sphere; their rims are ragged, as scans have them."""
    from meshsimp_pymoo.surface.edges import Edges, components, largest_sound_part

    _check_range("holes", holes, 0, MOST_HOLES)
    gap = _gap_on_sphere(len(directions))
    radii = np.geomspace(HOLE_RADII[0], max(HOLE_RADII[1], 0.5 * LEAST_HOLE * gap), holes)
    rng = np.random.default_rng(seed + 2)
    centre = directions[faces].mean(axis=1)
    centre /= np.linalg.norm(centre, axis=1)[:, None]
    # each is put where it is farthest from those before it, from rim to rim
    tries = rng.normal(size=(1000, 3))
    tries /= np.linalg.norm(tries, axis=1)[:, None]
    apart = np.full(len(tries), np.pi)
    cut = np.zeros(len(faces), bool)
    for radius in radii:
        outer = (1.0 + HOLE_WAVE) * radius
        middle = tries[np.argmax(apart)]
        if apart.max() < outer + BETWEEN_HOLES * gap:
            raise ValueError(f"holes is {holes}; so many do not fit among {len(directions)} vertices")
        apart = np.minimum(apart, np.arccos(np.clip(tries @ middle, -1.0, 1.0)) - outer)
        right = np.cross(middle, np.eye(3)[np.argmin(np.abs(middle))])
        turn = np.arctan2(centre @ np.cross(middle, right), centre @ right)
        phase = rng.uniform(0.0, 2.0 * math.pi, 2)
        wave = 0.5 * HOLE_WAVE * (np.sin(3.0 * turn + phase[0]) + np.sin(5.0 * turn + phase[1]))
        rags = HOLE_RAGS * gap * rng.uniform(-1.0, 1.0, len(faces))
        cut |= np.arccos(np.clip(centre @ middle, -1.0, 1.0)) < radius * (1.0 + wave) + rags
    # faces by themselves are no holes, and the model is one part that hangs together in edges
    first, second = Edges.of(faces[cut]).pairs
    part = components(int(cut.sum()), first // 3, second // 3)
    cut[cut] = np.isin(part, np.argsort(-np.bincount(part), kind="stable")[:holes])
    return largest_sound_part(faces[~cut])


def _outwards(points: FloatArray, faces: npt.NDArray[Any]) -> IntArray:
    """Wind the faces (F, 3) of a convex hull around the origin anticlockwise seen from outside."""
    faces = faces.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inwards = (np.cross(a, b) * c).sum(axis=1) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return faces


def _closed(points: FloatArray, faces: IntArray) -> SourceMesh:
    return SourceMesh(points, faces, {}, name="closed", is_closed=True)


# ------------------------------------------------------------------------------------------- several parts, sharp edges

# Radius of a pebble over that of the one before it, and the space between them [radii of the first].
PEBBLE_SHRINKS, PEBBLE_SPACE, MOST_PARTS = 0.75, 0.1, 12


def _pebbles(vertices: int = 4000, parts: int = 2, seed: int = 1, bumps: float = 0.15) -> SourceMesh:
    """Return closed pebbles in a row, each smaller than the one before: a model of several parts."""
    _check_range("parts", parts, 1, MOST_PARTS)
    _check_range("vertices", vertices, parts * LEAST_ON_SPHERE, MAX_SCATTERED)
    radii = PEBBLE_SHRINKS ** np.arange(parts)
    counts = LEAST_ON_SPHERE + _shared_out(vertices - parts * LEAST_ON_SPHERE, radii**2)
    points = np.empty((0, 3))
    faces = np.empty((0, 3), np.int64)
    for k, (radius, n) in enumerate(zip(radii, counts.tolist(), strict=True)):
        directions, own = _on_sphere(n, seed + k)
        stone = radius * _bumpy(directions, seed + k, bumps)
        stone[:, 0] -= stone[:, 0].min()
        if k:
            stone[:, 0] += points[:, 0].max() + PEBBLE_SPACE
        faces = np.concatenate([faces, own + len(points)])
        points = np.concatenate([points, stone])
    return _closed(points, faces)


def _shared_out(n: int, shares: npt.ArrayLike) -> IntArray:
    """Divide n things in proportion to shares (k,), the largest remainders rounded up."""
    exact = n * np.asarray(shares, float) / np.sum(shares)
    counts = np.floor(exact).astype(np.int64)
    counts[np.argsort(counts - exact, kind="stable")[: n - counts.sum()]] += 1
    return counts


# Sizes of the bracket [mm]: length of its foot, height of its back, how thick and how wide both are, the radius of the
# fillet between them, by how much the back is crowned; of the boss on the foot and of the pocket, a blind hole, in the
# back how far their middles are from the edge, radius, and height or depth; the chamfer and the dish of the boss.
FOOT, BACK, THICK, WIDE, FILLET, CROWN = 80.0, 60.0, 10.0, 60.0, 25.0, 6.0
BOSS_AT, BOSS_RADIUS, BOSS_HEIGHT, CHAMFER, DISH = 28.0, 14.0, 12.0, 2.0, 2.0
POCKET_AT, POCKET_RADIUS, POCKET_DEPTH = 14.0, 8.0, 5.0
# So many vertices at least, that no round side turns by 30 degrees from one face to the next; so many around a circle.
LEAST_ON_BRACKET, LEAST_AROUND = 1000, 24
# The bracket's inner side, flattened, goes along the foot, around the fillet and up the back.
BEND, TURN = FOOT - THICK - FILLET, 0.5 * math.pi * FILLET
INNER = BEND + TURN + BACK - THICK - FILLET

# A flat piece of a surface, as its outline and holes, each (k, 2), and how it lies in space.
Panel = tuple[list[FloatArray], Callable[[FloatArray], FloatArray]]


def _bracket(vertices: int = 5000) -> SourceMesh:
    """Return a closed bracket in millimetres, as from CAD: flat and round sides, a boss, a blind hole, sharp edges."""
    _check_range("vertices", vertices, LEAST_ON_BRACKET, MAX_SCATTERED)
    profile = FOOT * THICK + (BACK - THICK) * THICK + (1.0 - 0.25 * math.pi) * FILLET**2
    area = 2.0 * profile + WIDE * (FOOT + BACK + 2.0 * THICK + INNER)
    area += 2.0 * math.pi * (BOSS_RADIUS * BOSS_HEIGHT + POCKET_RADIUS * POCKET_DEPTH)
    gap = math.sqrt(area * 2.0 / math.sqrt(3.0) / vertices)  # edge of the equilateral triangles that would cover it

    boss, boss_top, boss_points, boss_faces = _turned(
        (BOSS_AT, BOSS_RADIUS),
        [(BOSS_RADIUS, 0.0), (BOSS_RADIUS, BOSS_HEIGHT - CHAMFER), (BOSS_RADIUS - CHAMFER, BOSS_HEIGHT)],
        (0.0, 0.0, 1.0),
        DISH,
        gap,
    )
    pocket, pocket_end, pocket_points, pocket_faces = _turned(
        (INNER - POCKET_AT, POCKET_RADIUS),
        [(POCKET_RADIUS, 0.0), (POCKET_RADIUS, POCKET_DEPTH)],
        (-1.0, 0.0, 0.0),
        0.0,
        gap,
    )
    side = _side_of_bracket(gap)
    bottom, top = _rectangle(WIDE, FOOT, gap)[:, ::-1], _rectangle(THICK, WIDE, gap)
    for edge in (bottom, top):  # of the back, which is crowned
        edge[edge[:, 0] == 0.0, 0] = _crown(edge[edge[:, 0] == 0.0, 1])
    panels: list[Panel] = [
        ([bottom[:, ::-1]], lambda flat: np.insert(flat[:, ::-1], 2, 0.0, axis=1)),
        ([_rectangle(BACK, WIDE, gap)], lambda flat: np.column_stack([_crown(flat[:, 1]), flat[:, ::-1]])),
        ([top], lambda flat: np.insert(flat, 2, BACK, axis=1)),
        ([_rectangle(WIDE, THICK, gap)], lambda flat: np.insert(flat, 0, FOOT, axis=1)),
        ([_rectangle(WIDE, INNER, gap), boss, pocket], _inner_side),
        ([side], lambda flat: np.insert(flat, 1, 0.0, axis=1)),
        ([side[:, ::-1]], lambda flat: np.insert(flat[:, ::-1], 1, WIDE, axis=1)),
        boss_top,
        pocket_end,
    ]
    return _closed(*_sewn(panels, [(boss_points, boss_faces), (pocket_points, pocket_faces)], vertices, gap))


def _crown(across: FloatArray) -> FloatArray:
    """Return where the bracket's back is along its foot."""
    return CROWN * ((2.0 * across / WIDE - 1.0) ** 2 - 1.0)


def _inner_side(flat: FloatArray) -> FloatArray:
    """Return where points of the bracket's inner side are in space, given across and along it."""
    across, along = flat.T
    angle = np.clip((along - BEND) / FILLET, 0.0, 0.5 * math.pi)
    up = along >= BEND + TURN
    x = np.where(up, THICK, FOOT - np.minimum(along, BEND) - FILLET * np.sin(angle))
    z = np.where(up, BACK - (INNER - along), THICK + FILLET * (1.0 - np.cos(angle)))
    return np.column_stack([x, across, z])


def _side_of_bracket(gap: float) -> FloatArray:
    """Return the outline (k, 2) of the bracket seen from its side, anticlockwise from the heel, in x and z."""
    foot, end, back = (_steps(size, gap) for size in (FOOT, THICK, BACK))
    inner = _inner_side(np.insert(_steps(INNER, gap)[:, None], 0, 0.0, axis=1))[:, ::2]
    lines = [
        np.insert(foot[:, None], 1, 0.0, axis=1),
        np.insert(end[:, None], 0, FOOT, axis=1),
        inner,
        np.insert(end[::-1, None], 1, BACK, axis=1),
        np.insert(back[::-1, None], 0, 0.0, axis=1),
    ]
    return np.concatenate([line[:-1] for line in lines])


def _steps(length: float, gap: float) -> FloatArray:
    """Return places along an edge, both its ends among them, about a gap apart."""
    return np.linspace(0.0, length, max(1, round(length / gap)) + 1)


def _rectangle(width: float, height: float, gap: float) -> FloatArray:
    """Return the outline (k, 2) of a rectangle, anticlockwise."""
    across, up = _steps(width, gap), _steps(height, gap)
    lines = [(across, 0.0, 1), (up, width, 0), (across[::-1], height, 1), (up[::-1], 0.0, 0)]
    return np.concatenate([np.insert(at[:-1, None], axis, level, axis=1) for at, level, axis in lines])


def _turned(
    place: tuple[float, float],
    profile: list[tuple[float, float]],
    axis: tuple[float, float, float],
    dish: float,
    gap: float,
) -> tuple[FloatArray, Panel, FloatArray, IntArray]:
    """Make a round thing on the inner side of the bracket of rings of vertices, each turned by half a step.

    Parameters
    ----------
    place : (float, float)
        How far along the side its middle is, and its radius there.
    profile : list of (float, float)
        Radius and height of the circles that are its edges, from the side on.
    axis : (float, float, float)
        Which way its height goes.
    dish : float
        How deep the middle of its end is below the last circle.
    gap : float
        How far vertices are apart, about.

    Returns
    -------
    rim : (k, 2) float array
        The outline that it has on the side.
    end : Panel
        The disc that it ends with.
    points : (n, 3) float array
    faces : (F, 3) int array
        All but the disc, seen from outside.
    """
    along, radius = place
    around = max(LEAST_AROUND, round(2.0 * math.pi * radius / gap))
    stations = np.array(profile[:1])
    for start, stop in itertools.pairwise(profile):
        n_strips = max(1, round(math.dist(start, stop) / gap))
        stations = np.concatenate([stations, np.linspace(start, stop, n_strips + 1)[1:]])
    flat = []
    for k, (width, _) in enumerate(stations):
        angle = 2.0 * math.pi * (np.arange(around) + 0.5 * k) / around
        flat.append([0.5 * WIDE, along] + width * np.column_stack([np.cos(angle), np.sin(angle)]))
    points = [_inner_side(ring) + height * np.array(axis) for ring, (_, height) in zip(flat, stations, strict=True)]
    here = np.arange(around)
    there = np.roll(here, -1)
    strip = np.concatenate([[here, there, here + around], [there, there + around, here + around]], axis=1).T
    faces = np.concatenate([strip + k * around for k in range(len(stations) - 1)])

    def end(disc: FloatArray) -> FloatArray:
        out = np.minimum(np.hypot(*(disc - [0.5 * WIDE, along]).T) / profile[-1][0], 1.0)
        out[:around] = 1.0  # the rim
        return _inner_side(disc) + (profile[-1][1] - dish * (1.0 - out**2))[:, None] * np.array(axis)

    return flat[0], ([flat[-1]], end), np.concatenate(points), faces


def _sewn(
    panels: list[Panel], pieces: list[tuple[FloatArray, IntArray]], vertices: int, gap: float
) -> tuple[FloatArray, IntArray]:
    """Fill panels with vertices, exactly so many in all, and join them and what is made already along common edges.

    Parameters
    ----------
    panels : list of Panel
    pieces : list of (n, 3) float and (F, 3) int arrays
        Points and faces.
    vertices : int
        In all, each counted once where several panels and pieces have it.
    gap : float
        How far they are apart, about.
    """
    rims = [lift(np.concatenate(outlines)) for outlines, lift in panels]
    n_given = len(np.unique(np.concatenate([*rims, *(points for points, _ in pieces)]), axis=0))
    sizes = []
    for outlines, _ in panels:
        length = sum(np.hypot(*(line - np.roll(line, 1, axis=0)).T).sum() for line in outlines)
        sizes.append(_signed_area(outlines[0]) - sum(map(_signed_area, outlines[1:])) - 0.5 * gap * length)
    places, faces = [points for points, _ in pieces], [corners for _, corners in pieces]
    for (outlines, lift), n in zip(panels, _shared_out(vertices - n_given, np.abs(sizes)).tolist(), strict=True):
        box = outlines[0].min(axis=0), np.ptp(outlines[0], axis=0)
        tries = 1.5 * n * float(box[1].prod()) / abs(_signed_area(outlines[0]))
        flat = np.concatenate([*outlines, _evenly_within(outlines, n, gap, box, np.full(2, 0.5), tries)])
        places.append(lift(flat))
        faces.append(_delaunay_within(flat, outlines))
    before = np.cumsum([0, *map(len, places[:-1])])
    joined = np.concatenate([corners + n for corners, n in zip(faces, before, strict=True)])
    place, row = np.unique(np.concatenate(places), axis=0, return_inverse=True)
    return place, row.ravel()[joined]


# ------------------------------------------------------------------------------------------------ names and parameters

_MODELS: dict[str, Callable[..., SourceMesh]] = {
    "jacksboro": _jacksboro,
    "topobathy": _topobathy,
    "face": _face,
    "plane": _plane,
    "roof": _roof,
    "pyramid": _pyramid,
    "saddle": _saddle,
    "peaks": _peaks,
    "ridge": _ridge,
    "crater": _crater,
    "ring": _ring,
    "horseshoe": _horseshoe,
    "embankment": _embankment,
    "tetrahedron": _tetrahedron,
    "cube": _cube,
    "icosahedron": _icosahedron,
    "sphere": _sphere,
    "ellipsoid": _ellipsoid,
    "blob": _blob,
    "pebbles": _pebbles,
    "bracket": _bracket,
}
# The break lines of those that have any; their parameters are the models'.
_LINES: dict[str, Callable[..., SourceLines]] = {"embankment": _embankment_lines}


def _spelled_parameters(name: str, base: str, spelled: str, known: Any) -> dict[str, Any]:
    given: dict[str, Any] = {}
    if not spelled and not name.endswith(":"):
        return given
    for place, item in enumerate(spelled.split(",")):
        key, equals, value = item.partition("=")
        if not equals:
            if place:
                raise ModelError(f"{name}: {item!r} needs a name, as in {base}:{spelled.split(',')[0]},seed=2")
            key, value = next(iter(known)), item
        if key in given:
            raise ModelError(f"{name}: {key} is given twice")
        given[key] = value.strip()
    return given


def _number(name: str, key: str, value: Any, parameter: inspect.Parameter) -> float:
    kind = type(parameter.default)
    try:
        number = kind(value)
        if isinstance(value, bool) or float(value) != number:
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        wanted = "a whole number" if kind is int else "a number"
        raise ModelError(f"{name}: {key} must be {wanted}, not {value!r}") from None
    if key == "seed" and number < 0:
        raise ModelError(f"{name}: seed must be 0 or more, not {number}")
    return number


def _check_range(key: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise ValueError(f"{key} is {value}; it must be {low} to {high}")


def _check_exact(side: int) -> None:
    """Refuse vertices along a side that halving does not give."""
    if (side - 1) & (side - 2):
        below = 2 ** ((side - 2).bit_length() - 1) + 1
        raise ValueError(
            f"side is {side}; it must be a power of two plus one (say {below} or {2 * below - 1}), so that "
            "every coordinate is exact"
        )


def _unknown(name: str, base: str) -> str:
    return (
        f"{name}: no such file, and no built-in model of that name{meant(base, _MODELS)}; "
        f"built-in models: {', '.join(_MODELS)}"
    )
