"""Pictures of fronts and meshes, drawn on the axes they are given.

``plot_front``, ``plot_mesh`` and ``plot_error`` each fill one matplotlib axes, so that they fit into
anybody's figure; without one they make a figure of their own. ``front_figure`` puts them together as the
``front.png`` of a simplification, ``error_figure`` is the picture of one mesh's error. Meshes are shaded from
their face normals and drawn back to front, which needs no graphics hardware and no display; bodies without a border
pixel by pixel, so that what is behind is hidden.

Both axes of a front are logarithmic, always, and say so: sizes and errors are compared by their ratio. The
lowest line is 0 where a solution is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import printable
from meshsimp_pymoo.plane.faces import edge_table, used_rows
from meshsimp_pymoo.report.depth import Seen, seen
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.measures import LENGTH, MEASURES, require_measure
from meshsimp_pymoo.surface.surface import Surface, mesh_lines, require_rules
from meshsimp_pymoo.surface.units import in_unit, length_unit, reference_system

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "error_figure",
    "front_axes",
    "front_figure",
    "hillshade",
    "panel_rows",
    "plain_numbers",
    "plot_error",
    "plot_front",
    "plot_mesh",
]

View = Literal["above", "side", "front", "back"] | tuple[float, float]

VIEWS = {
    "above": (90.0, 0.0),
    "side": (35.0, -35.0),
    "front": (18.0, -32.0),
    "back": (-18.0, 148.0),  # opposite to it: both together see all of a convex body
}  # elevation of the viewer above the plane, turn about the upright [degrees]
LIGHT = (-0.5, 0.6, 0.75)  # to the light, in the frame of the picture: from the upper left, in front of it
AMBIENT = 0.22  # brightness of what faces away from the light
CLAY = (0.90, 0.84, 0.77)  # colour of a mesh that has none of its own
# Of what has holes: the inside, and their rims, told from break lines whatever colours people see.
INSIDE = (0.55, 0.60, 0.68)
RIM = "#8a3b12"
LINE, MARK = "#2b5c8a", "#c8452f"
BESIDE, BESIDE_LINES = "#8b9099", ("-", "--", ":", "-.")  # other fronts, behind the one that counts
BREAK_LINE = "#00574b"  # dark on clay and on the pale end of the error, whatever colours people see
UNCOVERED = "#0072B2"  # vertices that no triangle covers, on the yellow to black of the error
PANELS = 3  # meshes beside a front
LONGEST_NAME = 40  # characters of a model's name in a title: a longer one would leave no room for the axes
# Their places on the logarithm of the size: meshes of a handful of triangles show little.
PANEL_SHARES = (0.5, 0.7, 0.9)
MOST_DRAWN = 500_000
BODY_PIXELS, SAMPLES = 600, 2  # of the picture of a body, its longer side; each is the mean of so many squared
LINE_SLACK = 0.01  # share of a body's extent that a line on it may lie below what is drawn, and is seen
OUTLINE = 1.1  # half the width of its edges, in samples
ERROR_SHADE = 0.62  # the darkest shade on a body whose colours are to be read
# The colours of errors, from none to the largest.
ERROR_COLOURS = "magma_r"
ROUNDING = 1e-6  # errors below this share of the largest are drawn near 0: rounding would stretch the axis
# Vertices of an original that are drawn; a picture shows no more of them, and a browser without a graphics card turns
# no more of them smoothly.
DRAWN_VERTICES = 50_000
# From this many triangles on, edges are not outlined: in a panel of some 400 pixels they would cover the
# shading.
OUTLINED_TRIANGLES = 2500


def plot_front(
    front: Any,
    ax: Axes | None = None,
    *,
    knee: int | None = None,
    chosen: int | None = None,
    marked: Sequence[int] = (),
    n_points: float | None = None,
    measure: str = "error",
    series: Mapping[str, npt.ArrayLike] | None = None,
    unit: str = LENGTH,
) -> Axes:
    """Draw a front: error against triangles.

    Parameters
    ----------
    front : (S, 2) float array, or anything whose ``F`` is one
        Error [model units] and triangles of each solution: a Front, a pymoo result, or the numbers.
    ax : matplotlib axes, optional
        Where to draw; by default in a new figure.
    knee, chosen : int, optional
        Rows to mark as the best compromise and as the solution that was asked for.
    marked : sequence of int
        Rows that stand as meshes beside the front; lettered a, b, c ...
    n_points : float, optional
        Vertices of the model (their weights in all, if it has some); if given, the mean error per vertex is
        drawn instead of the sum.
    measure : str
        What the first column of F is: one of `meshsimp_pymoo.surface.measures.OBJECTIVES`.
    series : mapping of str to (n, 2) array, optional
        Other fronts to draw faintly behind this one, by name, in the same measure.
    unit : str
        Unit of the errors.

    Returns
    -------
    matplotlib axes
        The axes, both logarithmic; see :func:`front_axes`.
    """
    F = np.asarray(getattr(front, "F", front), dtype=np.float64)
    if F.ndim != 2 or F.shape[1] != 2 or len(F) == 0:
        raise ValueError(f"a front has the shape (solutions, 2): error and triangles; this one has {F.shape}")
    require_measure(measure)
    ax = ax if ax is not None else _new_axes((6.4, 4.8))
    as_mean = measure == "error" and n_points is not None
    divisor = np.array([n_points if as_mean and n_points else 1.0, 1.0])
    error, triangles = (F / divisor).T
    drawn = [F / divisor]
    for k, (name, front_beside) in enumerate((series or {}).items()):
        beside = np.asarray(front_beside, dtype=np.float64) / divisor
        _steps(ax, beside, color=BESIDE, linewidth=1.2, linestyle=BESIDE_LINES[k % len(BESIDE_LINES)], label=name)
        drawn.append(beside)
    _steps(ax, F / divisor, color=LINE, linewidth=1, alpha=0.45)
    ax.plot(triangles, error, "o", color=LINE, markersize=4, label=f"{len(F)} solution{'s' * (len(F) != 1)}")
    letters = dict(zip(marked, "abcdefgh", strict=False))
    if knee is not None:
        size = 19 if knee in letters else 10  # around its letter
        ax.plot(triangles[knee], error[knee], "D", color=MARK, markersize=size, fillstyle="none", label="knee")
    if chosen is not None:
        ax.plot(triangles[chosen], error[chosen], "o", color=MARK, markersize=9, label="chosen", zorder=4)
    for row, letter in letters.items():
        full = row == chosen
        ax.annotate(
            letter,
            (triangles[row], error[row]),
            ha="center",
            va="center_baseline",
            weight="bold",
            fontsize=9,
            color="white" if full else MARK,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": MARK if full else "white", "edgecolor": MARK},
            zorder=5,
        )
    what = "mean error per vertex" if as_mean else MEASURES[measure].label
    front_axes(ax, np.vstack(drawn), label=f"{what} [{verbatim(unit)}]")
    if knee is not None or chosen is not None or series:
        for handle in ax.legend(frameon=False).get_lines():
            handle.set_markersize(min(handle.get_markersize(), 9))
    return ax


def front_axes(ax: Axes, F: npt.ArrayLike, *, label: str = f"error [{LENGTH}]") -> None:
    """Prepare the axes of a front: both logarithmic, readable numbers, and 0 where a solution is exact.

    Parameters
    ----------
    ax : matplotlib axes
        The axes.
    F : (S, 2) float array
        Everything that is drawn: errors and triangles.
    label : str
        What the errors are; "log scale" is added where it is one.
    """
    error, triangles = np.asarray(F, dtype=np.float64).T
    scale = ", log scale"
    if triangles.min() > 0:
        ax.set_xscale("log")
        # a margin on both sides, wide enough for a front of one size
        ax.set_xlim(triangles.min() / 1.25, triangles.max() * 1.25)
    top = float(error.max())
    if top == 0:  # nothing but exact solutions
        scale = ""
        ax.set_ylim(-0.05, 1.0)
    else:
        lowest = max(float(error[error > 0].min()), ROUNDING * top)
        if error.min() < lowest:
            decade = math.floor(math.log10(lowest))
            ax.set_yscale("symlog", linthresh=10.0**decade, linscale=0.5)
            ax.set_ylim(-0.25 * 10.0**decade, 1.5 * top)
            decades = range(decade, math.ceil(math.log10(1.5 * top)))
            steps = (1, 2, 5) if len(decades) < 3 else (1,)
            ax.set_yticks([0.0, *(step * 10.0**k for k in decades for step in steps)])
        else:
            ax.set_yscale("log")
            ax.set_ylim(lowest / 1.4, 1.5 * top)
    plain_numbers(ax)
    ax.set_xlabel("triangles, log scale")
    ax.set_ylabel(label + scale)
    ax.grid(which="both", color="0.92", linewidth=0.6)
    ax.set_axisbelow(True)


def plot_mesh(
    mesh: Any,
    ax: Axes | None = None,
    *,
    kept: npt.ArrayLike | None = None,
    view: View | None = None,
    colour: npt.ArrayLike | None = None,
    edges: bool | None = None,
    exaggeration: float = 1.0,
    lines: bool | Sequence[npt.ArrayLike] = True,
    is_body: bool | None = None,
) -> Axes:
    """Draw a mesh as a shaded relief, its break lines on it; or as a body, with the rims of its holes.

    Parameters
    ----------
    mesh : MeshProblem, Surface, OpenModel, solution of a front, trimesh.Trimesh, or (points, faces)
        Vertices (V, 3), height along z, and triangles (M, 3), counter-clockwise from above. A ``Trimesh`` is
        drawn in its own frame; a problem, a surface, a model and a solution stand upright. Of a body z is to the
        viewer and y up.
    ax : matplotlib axes, optional
        Where to draw, by default in a new figure; its frame and ticks are removed.
    kept : (N,) bool array, optional
        With a problem or a surface, which know the rules: draw the mesh of these vertices instead of the model.
    view : "above", "side", "front", "back" or (elevation, turn), optional
        Where it is seen from; as a pair, the elevation above the (x, y) plane and the turn about z, in
        degrees; of a body above the (x, z) plane and about y. By default "above", of a body "front".
    colour : (V, 3), (V, 4) uint8 array or (3,) float array, optional
        Colour per vertex, or one for all (0 to 1); by default the mesh's own, if it has some.
    edges : bool, optional
        Whether to outline the triangles; by default only in small meshes.
    exaggeration : float
        Factor on the heights.
    lines : bool or sequence of (n, 3) arrays
        Whether to draw the break lines that a problem, a surface, a model or a solution has; or the lines to draw, in
        the frame of the points. They are drawn in front of everything, on a body where it does not hide them.
    is_body : bool, optional
        Whether it is a body: by default what is of a closed surface, and any other mesh that has no border. A body
        with holes shows its inside in another tone.

    Returns
    -------
    matplotlib axes
        The axes.
    """
    drawn = _lines_of(mesh, kept) if lines is True else lines or ()
    points, faces, own, found = _shape(mesh, kept)
    is_body = found if is_body is None else is_body
    used, compact = np.unique(faces, return_inverse=True)
    points, faces = points[used], compact.reshape(-1, 3)
    colour = own if colour is None else np.asarray(colour)
    if colour is not None and colour.ndim > 1:
        colour = colour[used]
    ax = ax if ax is not None else _new_axes((6.4, 6.4))
    turned = partial(_turned, view=view or ("front" if is_body else "above"), is_body=is_body)
    placed = turned(points * [1.0, 1.0, exaggeration])
    triangles: Any = placed[faces]
    shade = hillshade(triangles)
    if colour is None:
        base = np.broadcast_to(CLAY, (len(faces), 3))
    else:
        base = (
            np.broadcast_to(colour[:3], (len(faces), 3))
            if colour.ndim == 1
            else colour[faces, :3].mean(axis=1) / (255.0 if colour.dtype.kind == "u" else 1.0)
        )
    outlined = len(faces) <= OUTLINED_TRIANGLES if edges is None else edges
    seen_lines = [turned(np.asarray(line) * [1.0, 1.0, exaggeration]) for line in drawn]
    if is_body:
        base = np.where(_shows_inside(placed, faces)[:, None], INSIDE, base)
        rgb = base * shade[:, None]
        depth = _draw_body(ax, placed, faces, lambda shown: rgb[shown.triangle], outlined=outlined)
        _draw_lines(ax, depth.in_sight(_rims(placed, faces)), colour=RIM)
        seen_lines = depth.in_sight(seen_lines)
    else:
        _draw_relief(ax, triangles, base * shade[:, None], outlined=outlined)
    _draw_lines(ax, seen_lines)
    _frame(ax, placed)
    return ax


def plot_error(
    surface: Surface,
    deviation: npt.ArrayLike,
    ax: Axes | None = None,
    *,
    covered: npt.ArrayLike | None = None,
    largest: float | None = None,
    bar: bool = True,
) -> Axes:
    """Draw the deviation of a simplified surface at every vertex of the model as a map, break lines on it.

    Closed models are seen from the front and, beside it, from the back.

    Parameters
    ----------
    surface : Surface
        What the mesh is one of: ``problem.surface``.
    deviation : (N,) float array
        Deviation at each vertex in vector order [model units]; its size is drawn, not its sign.
    ax : matplotlib axes, optional
        Where to draw; by default in a new figure.
    covered : (N,) bool array, optional
        Whether a triangle covers each vertex; those that none covers are marked blue.
    largest : float, optional
        End of the colour scale, to compare several maps; by default the largest deviation.
    bar : bool
        Whether to add a colour bar beside the map.

    Returns
    -------
    matplotlib axes
        The axes.
    """
    require_rules(surface, "plot_error")
    size = np.abs(np.asarray(deviation, dtype=np.float64))
    if size.shape != (surface.n_vertices,):
        raise ValueError(f"deviation has the shape {size.shape}; the model has {surface.n_vertices} vertices")
    ax = ax if ax is not None else _new_axes((7.0, 6.0))
    greatest = float(size.max())
    end = greatest if largest is None else largest
    drawn = (_error_of_body if surface.view.is_closed else _error_map)(ax, surface, size, end or 1.0, covered)
    if bar:
        shown = ax.figure.colorbar(drawn, ax=ax, shrink=0.8, pad=0.02, extend="max" if greatest > end else "neither")
        shown.set_label(f"error [{verbatim(length_unit(surface.model.georeference))}]")
        shown.outline.set_visible(False)
    return ax


def _error_map(ax: Axes, surface: Surface, size: FloatArray, end: float, covered: npt.ArrayLike | None) -> Any:
    """Draw errors (N,) in the plane, up to the end of the scale, and return what a colour bar is made of."""
    x, y = np.asarray(surface.points)[:, :2].T
    drawn = ax.tripcolor(
        x,
        y,
        np.asarray(surface.faces),
        size,
        shading="gouraud",
        cmap=ERROR_COLOURS,
        vmin=0.0,
        vmax=end,
        rasterized=True,
    )
    if covered is not None:
        bare = ~np.asarray(covered, dtype=bool)
        ax.plot(x[bare], y[bare], ".", color=UNCOVERED, markersize=2.5)
    _draw_lines(ax, _lines_of(surface), halo=True)
    _frame(ax, np.column_stack([x, y]))
    return drawn


def _error_of_body(ax: Axes, surface: Surface, size: FloatArray, end: float, covered: npt.ArrayLike | None) -> Any:
    """Draw errors (N,) on a body from both sides; see :func:`_error_map`. Its inside has none."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize, to_rgb

    colours, faces = ScalarMappable(Normalize(0.0, end), ERROR_COLOURS), np.asarray(surface.faces)
    bare = np.zeros(len(size)) if covered is None else 1.0 - np.asarray(covered, dtype=bool)
    beside, corners = np.zeros(2), []
    for side in ("front", "back"):
        points = _turned(surface.points, side, is_body=True)
        shift = np.append(beside - points[:, :2].min(axis=0), 0.0)
        points += shift
        shade = ERROR_SHADE + (1.0 - ERROR_SHADE) * hillshade(points[faces])
        inside = _shows_inside(points, faces)

        def coloured(shown: Seen, shade: FloatArray = shade, inside: BoolArray = inside) -> FloatArray:
            at, corners = shown.triangle, faces[shown.triangle]
            rgb = colours.to_rgba((shown.shares * size[corners]).sum(axis=2))[..., :3]
            rgb = np.where(((shown.shares * bare[corners]).sum(axis=2) > 0.5)[..., None], to_rgb(UNCOVERED), rgb)
            return np.where(inside[at][..., None], INSIDE, rgb) * shade[at][..., None]

        depth = _draw_body(ax, points, faces, coloured)
        _draw_lines(ax, depth.in_sight(_rims(points, faces)), colour=RIM)
        lines = [_turned(line, side, is_body=True) + shift for line in _lines_of(surface)]
        _draw_lines(ax, depth.in_sight(lines), halo=True)
        corners += [points[:, :2].min(axis=0), points[:, :2].max(axis=0)]
        beside[0] = 1.04 * corners[-1][0]
    _frame(ax, np.array(corners))
    return colours


def verbatim(text: object) -> str:
    r"""Return what a file says as pictures show it: printable, and its dollars are no formula.

    >>> print(verbatim("US$ per $m^2$"))
    US\$ per \$m^2\$
    """
    return printable(text).replace("$", r"\$")


def short_name(name: str) -> str:
    """Return what a title calls a model: the name of its file, the middle of a long one left out.

    >>> short_name("scans/face.ply"), short_name("x" * 30 + "y" * 30)
    ('face.ply', 'xxxxxxxxxxxxxxxxxxxx…yyyyyyyyyyyyyyyyyyy')
    """
    whole = PurePath(name).name
    half = LONGEST_NAME // 2
    return verbatim(whole if len(whole) <= LONGEST_NAME else f"{whole[:half]}…{whole[len(whole) - half + 1 :]}")


def front_figure(
    surface: Surface,
    F: npt.ArrayLike,
    meshes: Sequence[tuple[int, IntArray]],
    *,
    knee: int | None = None,
    chosen: int | None = None,
    measure: str = "error",
    series: Mapping[str, npt.ArrayLike] | None = None,
) -> Figure:
    """Draw the front of a simplification beside the original and a few of the simplified meshes.

    Parameters
    ----------
    surface : Surface
        What the solutions are meshes of.
    F : (S, 2) float array
        The front: error [model units] and triangles.
    meshes : sequence of (row of F, (M, 3) faces in vector order)
        At most PANELS solutions to show, in the order of the panels; see :func:`panel_rows`.
    knee, chosen : int, optional
        Rows of ``F`` to mark.
    measure, series
        What the first column of F is, and other fronts to draw behind it; see :func:`plot_front`.

    Returns
    -------
    matplotlib Figure
        Not bound to any window or backend; ``figure.savefig("front.png")`` writes it.
    """
    from matplotlib.figure import Figure

    require_rules(surface, "front_figure")
    F = np.asarray(F, dtype=np.float64)
    model = surface.model
    width, depth = _picture_size(surface)
    tall = depth > 1.15 * width  # a face: its panels stand side by side; a terrain: two by two
    figure = Figure(figsize=(15.0, 5.6) if tall else (14.0, 6.6), dpi=110, layout="constrained")
    halves = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.8 if tall else 1.35), wspace=0.02)
    left, right = halves[0]
    front = left.subplots()
    letters = [row for row, _ in meshes]
    marks: dict[str, Any] = {"knee": knee, "chosen": chosen, "marked": letters}
    unit, system = length_unit(model.georeference), verbatim(reference_system(model.georeference))
    plot_front(F, front, **marks, n_points=surface.total_weight, measure=measure, series=series, unit=unit)
    size = f"{model.n_vertices:,} vertices, {len(model.faces):,} triangles"
    front.set_title(f"{short_name(model.name)}: {size}" + f"\n{system}" * bool(system), loc="left")

    panels = right.subplots(*((1, 4) if tall else (2, 2))).ravel()
    lines = _lines_of(surface)
    _plot_rows(surface, original_mesh(surface)[1], panels[0], lines)
    named = "original with its break lines" if lines else "original"
    panels[0].set_title(f"{named}\n{len(model.faces):,} triangles", fontsize=10)
    for letter, panel, (row, faces) in zip("abc", panels[1:], meshes, strict=False):
        _plot_rows(surface, faces, panel, [surface.points[chain] for chain in mesh_lines(surface, faces)[0]])
        error = f"mean error {F[row, 0] / surface.total_weight:.3g}"
        if measure != "error":
            error = f"{MEASURES[measure].label} {F[row, 0]:.3g}"
        error += verbatim(in_unit(unit))
        names = [name for name, marked in (("knee", knee), ("chosen", chosen)) if marked == row]
        label = f" ({', '.join(names)})" if names else ""
        size = f"{int(F[row, 1]):,} triangle{'' if F[row, 1] == 1 else 's'}"
        panel.set_title(f"{letter}: {size}{label}\n{error}", fontsize=10)
        panel.set(xlim=panels[0].get_xlim(), ylim=panels[0].get_ylim())
    for panel in panels[1 + len(meshes) :]:
        panel.axis("off")
    return figure


def _picture_size(surface: Surface, sides: int = 1) -> tuple[float, float]:
    """Return width and height of the picture of a surface, of a body seen from one side or from both."""
    width, depth = surface.view.extent[:2]
    if surface.view.is_closed:
        width, depth = np.ptp(_turned(surface.points, "front", is_body=True), axis=0)[:2]
        width *= sides
    return float(width), float(depth)


def original_mesh(surface: Surface) -> tuple[BoolArray, IntArray]:
    """Return what pictures draw of the original: its vertices (N,) and triangles (M, 3), thinned if it is large."""
    if surface.n_vertices <= DRAWN_VERTICES:
        return np.ones(surface.n_vertices, dtype=bool), np.asarray(surface.faces)
    drawn = surface.selection(DRAWN_VERTICES)
    return drawn, surface.triangles(drawn)


def panel_rows(triangles: npt.ArrayLike, *wanted: int | None) -> list[int]:
    """Return the rows of a front to draw as meshes: PANELS of them, spread over the sizes, the wanted among them.

    Parameters
    ----------
    triangles : (S,) array
        Sizes of the solutions, ascending.
    *wanted : int or None
        Rows that must be shown, such as the chosen one and the knee, the most important first.

    Notes
    -----
    Meshes of more than MOST_DRAWN triangles are drawn only if the first of the wanted is one, or no others are there:
    a panel has fewer pixels, and takes minutes.

    Examples
    --------
    >>> sizes = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024]
    >>> panel_rows(sizes), panel_rows(sizes, 10, None, 4), panel_rows([2, 4])
    ([5, 7, 9], [4, 7, 10], [0, 1])
    """
    first = -1 if not wanted or wanted[0] is None else wanted[0]
    drawn = max(int(np.searchsorted(triangles, MOST_DRAWN, side="right")), PANELS, first + 1)
    size = np.log(np.maximum(np.asarray(triangles, dtype=np.float64)[:drawn], 1.0))
    even = (size[0] + (size[-1] - size[0]) * np.array(PANEL_SHARES)).tolist()
    rows = list(dict.fromkeys(row for row in wanted if row is not None and row < drawn))[:PANELS]
    for row in rows:  # each takes the place of the nearest
        even.remove(min(even, key=lambda other: abs(other - size[row])))
    found = {*rows, *(int(np.argmin(abs(size - other))) for other in even)}
    while len(found) < min(PANELS, len(size)):  # a short front
        found.add(max(range(len(size)), key=lambda row: min(abs(row - other) for other in found)))
    return sorted(found)


def error_figure(
    surface: Surface, deviation: npt.ArrayLike, covered: npt.ArrayLike, *, title: str | None = None
) -> Figure:
    """Draw the error of one mesh at every vertex of the model, with its largest values and uncovered vertices.

    Parameters
    ----------
    surface : Surface
        What the mesh was measured against.
    deviation, covered : (N,) arrays
        Of ``surface.score(points, faces)``.
    title : str, optional
        What stands above the map.

    Returns
    -------
    matplotlib Figure
        Not bound to any window or backend.
    """
    from matplotlib.figure import Figure

    require_rules(surface, "error_figure")
    width, depth = _picture_size(surface, sides=2)
    share = float(np.clip(depth / width, 0.4, 1.6)) if width > 0 else 1.0
    figure = Figure(figsize=(7.2, 6.0 * share + 0.9), dpi=110, layout="constrained")
    ax = figure.subplots()
    size = np.abs(np.asarray(deviation, dtype=np.float64))
    # a few spikes shall not pale all the rest
    plot_error(surface, size, ax, covered=covered, largest=float(np.quantile(size, 0.995)) or None)
    bare = int((~np.asarray(covered, dtype=bool)).sum())
    system = verbatim(reference_system(surface.model.georeference))
    said = [title, system, f"blue: {bare:,} uncovered vertices" if bare else ""]
    ax.set_title("\n".join(filter(None, said)), fontsize=10)
    return figure


def hillshade(triangles: FloatArray) -> FloatArray:
    """Return how bright each triangle is in the light from the upper left.

    Parameters
    ----------
    triangles : (M, 3, 3) float array
        Corners in the frame of the picture: x to the right, y up, z to the viewer.

    Returns
    -------
    (M,) float array
        Between AMBIENT (facing away from the light, or without area) and 1. Light wraps around: brightness is
        linear in the cosine down to the opposite direction, so that steep slopes in the shade keep their shape.
        Both sides are lit alike.

    Examples
    --------
    A triangle that faces the light is fully lit:

    >>> u, v = np.cross(LIGHT, [0, 0, 1.0]), np.cross(LIGHT, np.cross(LIGHT, [0, 0, 1.0]))
    >>> float(hillshade(np.array([[0 * u, u, v]])).round(6)[0])
    1.0
    """
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal *= np.where(normal[:, 2] < 0, -1.0, 1.0)[:, None]  # what is seen from behind
    cosine = normal @ (np.array(LIGHT) / np.linalg.norm(LIGHT))
    lit = np.divide(cosine, length, out=np.full_like(length, -1.0), where=length > 0)
    return AMBIENT + (1 - AMBIENT) * (0.5 + 0.5 * np.clip(lit, -1.0, 1.0))


def _steps(ax: Axes, F: FloatArray, **look: Any) -> None:
    """Draw a front as a line: a solution holds until the next larger one, which is better from there on."""
    error, triangles = F[np.lexsort((F[:, 0], F[:, 1]))].T
    ax.step(triangles, error, where="post", **look)


def _new_axes(size: tuple[float, float]) -> Axes:
    """Return axes in a figure that a notebook or a window shows."""
    from matplotlib import pyplot

    return pyplot.subplots(figsize=size, layout="constrained")[1]


def _shape(mesh: Any, kept: npt.ArrayLike | None) -> tuple[FloatArray, IntArray, npt.NDArray[Any] | None, bool]:
    """Return points, faces and vertex colours of whatever is a mesh, and whether it is a body."""
    surface = getattr(mesh, "surface", mesh)
    if hasattr(surface, "view"):  # a problem or its surface
        faces = original_mesh(surface)[1] if kept is None else surface.triangles(np.asarray(kept) | surface.pinned)
        return *_rows_of(surface, faces), surface.view.is_closed
    if kept is not None:
        raise TypeError(
            f"kept chooses vertices by a problem's rules, which a {type(mesh).__name__} does not have; give the "
            "problem or problem.surface"
        )
    if isinstance(mesh, tuple):
        return np.asarray(mesh[0], dtype=np.float64), np.asarray(mesh[1]), None, _has_no_border(np.asarray(mesh[1]))
    if hasattr(mesh, "front"):  # a solution of one
        return *_rows_of(mesh.front.surface, mesh.faces), mesh.front.surface.view.is_closed
    if hasattr(mesh, "points") and hasattr(mesh, "faces"):  # a model
        is_body = isinstance(mesh, ClosedModel) or _has_no_border(mesh.faces)
        return mesh.points, mesh.faces, mesh.attributes.get("color"), is_body
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        visual: Any = getattr(mesh, "visual", None)
        own = np.asarray(visual.vertex_colors) if getattr(visual, "kind", None) == "vertex" else None
        faces = np.asarray(mesh.faces)
        return np.asarray(mesh.vertices, dtype=np.float64), faces, own, _has_no_border(faces)
    raise TypeError(
        f"a {type(mesh).__name__} is no mesh; give a MeshProblem, an OpenModel, a trimesh.Trimesh or (points, faces)"
    )


def _has_no_border(faces: IntArray) -> bool:
    """Tell whether every edge of triangles (M, 3) has two of them: what they enclose is a body."""
    return bool((edge_table(faces).n_triangles == 2).all())


def _plot_rows(surface: Surface, faces: IntArray, ax: Axes, lines: Sequence[npt.ArrayLike]) -> None:
    points, faces, colour = _rows_of(surface, faces)
    view = surface.view
    plot_mesh((points, faces), ax, colour=colour, exaggeration=view.exaggeration, lines=lines, is_body=view.is_closed)


def winding(points: FloatArray, faces: IntArray) -> int:
    """Return 1 where triangles (M, 3) are counter-clockwise as seen from outside, -1 where from inside.

    What outside is the vertices (V, 3) tell: away from the centroid of most of the surface.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    away = (a + b + c) / 3.0
    away -= (area[:, None] * away).sum(axis=0) / max(float(area.sum()), 1e-300)
    return 1 if (normal * away).sum() >= 0.0 else -1


def _shows_inside(points: FloatArray, faces: IntArray) -> BoolArray:
    """Tell which triangles (M, 3) of a body with holes show their inside, of vertices (V, 3) as they are seen."""
    if _has_no_border(faces):  # nobody can look in
        return np.zeros(len(faces), bool)
    a, b, c = (points[faces[:, k], :2] for k in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return np.asarray(winding(points, faces) * turned < 0.0)


def _rims(points: FloatArray, faces: IntArray) -> list[FloatArray]:
    """Return the edges (2, 3) at the rims of holes, of vertices (V, 3)."""
    table = edge_table(faces)
    return list(points[table.ends[table.n_triangles == 1]])


class _Depth(NamedTuple):
    """How near what is seen of a body is to the viewer.

    Attributes
    ----------
    z : (height, width) float array
        At each pixel; -inf where nothing is.
    low : (2,) float array
        The lower left corner [units of the body].
    size : float
        The side of a pixel.
    slack : float
        What lies no deeper below lies on it.
    """

    z: FloatArray
    low: FloatArray
    size: float
    slack: float

    def in_sight(self, lines: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the pieces (n, 2) of lines (n, 3) that the body does not hide."""
        found = []
        last = np.array(self.z.shape)[::-1] - 1
        for line in lines:
            steps = np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1) / (2.0 * self.size)
            if not steps.any():  # a line that leads away from the viewer is a point
                continue
            at = np.concatenate([k + np.arange(n) / n for k, n in enumerate(np.ceil(steps).astype(int)) if n])
            at = np.append(at, len(line) - 1)
            places = np.column_stack([np.interp(at, np.arange(len(line)), line[:, k]) for k in range(3)])
            x, y = np.clip((places[:, :2] - self.low) / self.size, 0, last).astype(int).T
            shows = self.z[y, x] <= places[:, 2] + self.slack
            both = np.flatnonzero(shows[:-1] & shows[1:])
            runs = np.split(both, np.flatnonzero(np.diff(both) > 1) + 1)
            found += [places[run[0] : run[-1] + 2, :2] for run in runs if len(run)]
        return found


def _draw_relief(ax: Axes, triangles: Any, rgb: FloatArray, *, outlined: bool) -> None:
    """Draw triangles (M, 3, 3) as seen, the nearest last."""
    from matplotlib.collections import PolyCollection

    order = np.argsort(triangles[:, :, 2].mean(axis=1), kind="stable")
    ax.add_collection(
        PolyCollection(
            triangles[order][:, :, :2],
            facecolors=rgb[order],
            edgecolors=rgb[order] * 0.72 if outlined else rgb[order],
            linewidths=0.35 if outlined else 0.15,
            joinstyle="round",
            rasterized=True,
        ),
        autolim=False,
    )


def _draw_body(
    ax: Axes,
    points: FloatArray,
    faces: IntArray,
    coloured: Callable[[Seen], FloatArray],
    *,
    outlined: bool = False,
) -> _Depth:
    """Draw what is seen of a body of vertices (V, 3) as they are seen, as an image, and return how near it is.

    ``coloured`` returns the colours (height, width, 3) of what is seen, whatever where nothing is.
    """
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    size = float((high - low).max()) / BODY_PIXELS or 1.0
    width, height = np.maximum(np.ceil((high - low) / size), 1.0).astype(int)
    pixels = np.column_stack([(points[:, :2] - low) / (size / SAMPLES), points[:, 2]])
    shown = seen(pixels[faces], SAMPLES * width, SAMPLES * height)
    hit = shown.triangle >= 0
    rgb = coloured(shown)
    if outlined:
        corners = pixels[faces][:, :, :2]
        side = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)
        (ux, uy), (vx, vy) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
        away = np.abs(ux * vy - uy * vx)[:, None] / np.maximum(side, 1e-300)  # from each corner to the side opposite
        on_edge = (shown.shares * away[shown.triangle]).min(axis=2) < OUTLINE
        rgb = np.where(on_edge[..., None], 0.72 * rgb, rgb)
    rgba = np.concatenate([rgb, np.ones((*hit.shape, 1))], axis=2) * hit[..., None]
    rgba = rgba.reshape(height, SAMPLES, width, SAMPLES, 4).mean(axis=(1, 3))
    rgba[..., :3] /= np.maximum(rgba[..., 3:], 1e-300)
    left, bottom = low
    extent = (left, left + size * width, bottom, bottom + size * height)
    ax.imshow(rgba, extent=extent, origin="lower", aspect="equal")
    z = (shown.shares * pixels[faces[shown.triangle], 2]).sum(axis=2)
    return _Depth(np.where(hit, z, -np.inf), low, size / SAMPLES, LINE_SLACK * float(np.ptp(points, axis=0).max()))


def _lines_of(mesh: Any, kept: npt.ArrayLike | None = None) -> list[FloatArray]:
    """Return the break lines of whatever is a mesh, (n, 3) each: as given of an original, as chains of edges else."""
    if hasattr(mesh, "front"):
        return [mesh.points[chain] for chain in mesh.lines]
    surface = getattr(mesh, "surface", mesh)
    if kept is not None and hasattr(surface, "view"):
        faces = surface.triangles(np.asarray(kept) | surface.pinned)
        return [surface.points[chain] for chain in mesh_lines(surface, faces)[0]]
    found = getattr(getattr(surface, "model", surface), "lines", None)
    return [] if found is None else list(found.originals)


def _draw_lines(ax: Axes, lines: Sequence[FloatArray], *, colour: str = BREAK_LINE, halo: bool = False) -> None:
    """Draw lines (n, 2) or more as seen; with a halo, where what is below may be as dark."""
    from matplotlib.collections import LineCollection
    from matplotlib.patheffects import Normal, Stroke

    if not lines:
        return
    around = [Stroke(linewidth=2.6, foreground="white"), Normal()] if halo else None
    seen = [line[:, :2] for line in lines]
    ax.add_collection(
        LineCollection(seen, colors=colour, linewidths=1.1, capstyle="round", path_effects=around), autolim=False
    )


def _rows_of(surface: Surface, faces: IntArray) -> tuple[FloatArray, IntArray, npt.NDArray[Any] | None]:
    """Return points, triangles and colours of those vertices of a surface alone that triangles (M, 3) use."""
    used, compact = used_rows(np.asarray(faces))
    colour = surface.model.attributes.get("color")
    return surface.points[used], compact, None if colour is None else colour[used]


def _turned(points: FloatArray, view: View, *, is_body: bool = False) -> FloatArray:
    """Turn points (V, 3) about the origin into the frame of the picture: x to the right, y up, z to the viewer."""
    elevation, turn = VIEWS[view] if isinstance(view, str) else view
    if is_body:  # it stands on the (x, z) plane
        points = points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    a, b = np.radians(turn), np.radians(90.0 - elevation)
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), np.sin(b)], [0, -np.sin(b), np.cos(b)]])
    return points @ about_z.T @ about_x.T


def _frame(ax: Axes, points: FloatArray) -> None:
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    margin = 0.01 * float((high - low).max())
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    ax.set_aspect("equal")
    ax.axis("off")


def plain_numbers(ax: Axes) -> None:
    """Write 2000, not 2 x 10^3, on logarithmic axes where the numbers are of readable size."""
    from matplotlib.ticker import FuncFormatter, LogFormatter, NullFormatter

    for axis, low, high in ((ax.xaxis, *ax.get_xlim()), (ax.yaxis, *ax.get_ylim())):
        if axis.get_scale() == "linear":
            continue
        readable = 1e-4 < max(abs(low), abs(high)) < 1e6
        if readable:
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        if high < 60 * abs(low) and axis.get_scale() == "log":
            axis.set_minor_formatter(LogFormatter(minor_thresholds=(3, 1)))
        else:
            axis.set_minor_formatter(NullFormatter())
