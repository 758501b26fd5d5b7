"""Pictures of fronts and meshes, drawn on the axes they are given.

``plot_front``, ``plot_mesh`` and ``plot_error`` each fill one matplotlib axes, so that they fit into
anybody's figure; ``front_figure`` puts them together as the ``front.png`` of a simplification. Meshes are
shaded from their face normals and drawn back to front, which needs no graphics hardware and no display.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from meshsimp_pymoo.geometry.model import OpenModel

__all__ = ["front_figure", "hillshade", "plot_error", "plot_front", "plot_mesh"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.integer[Any]]
View = Literal["above", "side"] | tuple[float, float]

VIEWS = {
    "above": (90.0, 0.0),
    "side": (35.0, -35.0),
}  # elevation of the viewer above the plane, turn about z [degrees]
LIGHT = (-0.5, 0.6, 0.75)  # to the light, in the frame of the picture: from the upper left, in front of it
AMBIENT = 0.25  # share of the light that comes from everywhere
CLAY = (0.90, 0.84, 0.77)  # colour of a mesh that has none of its own
LINE, MARK = "#2b5c8a", "#c8452f"
LOG_FROM = 10  # ratio of values from which an axis is logarithmic
# From this many triangles on, edges are not outlined: in a panel of some 400 pixels they would cover the
# shading.
OUTLINED_TRIANGLES = 2500
# A relief flatter than this share of its extent is drawn higher: terrain is, by kilometres of width to
# hundreds of metres.
LEAST_RELIEF = 0.12


def plot_front(
    ax: Axes,
    F: npt.ArrayLike,
    *,
    knee: int | None = None,
    chosen: int | None = None,
    marked: Sequence[int] = (),
    n_points: int | None = None,
) -> Axes:
    """Draw a front: error against triangles.

    Parameters
    ----------
    ax : matplotlib axes
        Where to draw.
    F : (S, 2) float array
        Error [model units] and triangles of each solution.
    knee, chosen : int, optional
        Rows of ``F`` to mark as the best compromise and as the solution that was asked for.
    marked : sequence of int
        Rows that stand as meshes beside the front; lettered a, b, c ...
    n_points : int, optional
        Vertices of the model; if given, the mean error per vertex is drawn instead of the sum.

    Returns
    -------
    matplotlib axes
        ``ax``. The triangles are on a logarithmic axis if they span a factor of LOG_FROM, the errors if half
        of them are that much below the largest (linear near 0 where a solution is exact).
    """
    F = np.asarray(F, dtype=np.float64)
    error = F[:, 0] / (n_points or 1)
    triangles = F[:, 1]
    order = np.lexsort((error, triangles))
    # A solution holds until the next larger one: between two points the better of both is the left one.
    ax.step(triangles[order], error[order], where="post", color=LINE, linewidth=1, alpha=0.45)
    ax.plot(triangles, error, "o", color=LINE, markersize=4, label=f"{len(F)} solutions")
    if knee is not None:
        ax.plot(triangles[knee], error[knee], "D", color=MARK, markersize=9, fillstyle="none", label="knee")
    if chosen is not None:
        ax.plot(triangles[chosen], error[chosen], "*", color=MARK, markersize=13, label="chosen")
    for letter, row in zip("abcdefgh", marked, strict=False):
        ax.annotate(
            letter,
            (triangles[row], error[row]),
            xytext=(7, 6),
            textcoords="offset points",
            weight="bold",
            color=MARK,
        )
    if triangles.max() >= LOG_FROM * triangles.min() > 0:
        ax.set_xscale("log")
    positive = error[error > 0]
    if positive.size and np.median(error) < error.max() / LOG_FROM:
        if positive.size < error.size:
            ax.set_yscale("symlog", linthresh=positive.min(), linscale=0.3)
            ax.set_ylim(bottom=0)
        else:
            ax.set_yscale("log")
    else:
        ax.set_ylim(bottom=0)
    _plain_numbers(ax)
    ax.set_xlabel("triangles")
    ax.set_ylabel("error [model units]" if n_points is None else "mean error per vertex [model units]")
    ax.grid(which="both", color="0.92", linewidth=0.6)
    ax.set_axisbelow(True)
    if len(ax.get_lines()) > 2:
        ax.legend(frameon=False)
    return ax


def plot_mesh(
    ax: Axes,
    points: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    view: View = "above",
    colour: npt.ArrayLike | None = None,
    edges: bool | None = None,
    exaggeration: float = 1.0,
) -> Axes:
    """Draw a mesh as a shaded relief.

    Parameters
    ----------
    ax : matplotlib axes
        Where to draw; its frame and ticks are removed.
    points : (V, 3) float array
        Vertices, height along z.
    faces : (M, 3) int array
        Triangles, counter-clockwise from above.
    view : "above", "side" or (elevation, turn)
        Where it is seen from; as a pair, the elevation above the (x, y) plane and the turn about z, in
        degrees.
    colour : (V, 3), (V, 4) uint8 array or (3,) float array, optional
        Colour per vertex, or one for all (0 to 1).
    edges : bool, optional
        Whether to outline the triangles; by default only in small meshes.
    exaggeration : float
        Factor on the heights.

    Returns
    -------
    matplotlib axes
        ``ax``.
    """
    from matplotlib.collections import PolyCollection

    faces = np.asarray(faces)
    elevation, turn = VIEWS[view] if isinstance(view, str) else view
    seen = _turned(np.asarray(points, dtype=np.float64) * [1.0, 1.0, exaggeration], elevation, turn)
    triangles = seen[faces]
    shade = hillshade(triangles)
    if colour is None:
        base = np.broadcast_to(CLAY, (len(faces), 3))
    else:
        colour = np.asarray(colour)
        base = (
            np.broadcast_to(colour[:3], (len(faces), 3))
            if colour.ndim == 1
            else colour[faces, :3].mean(axis=1) / (255.0 if colour.dtype.kind == "u" else 1.0)
        )
    rgb = base * shade[:, None]
    order = np.argsort(triangles[:, :, 2].mean(axis=1), kind="stable")  # the nearest triangles last
    outlined = len(faces) <= OUTLINED_TRIANGLES if edges is None else edges
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
    _frame(ax, seen[np.unique(faces)])
    return ax


def plot_error(ax: Axes, model: OpenModel, deviation: npt.ArrayLike, *, largest: float | None = None) -> Axes:
    """Draw the deviation of a simplified surface at every vertex of the model as a map.

    Parameters
    ----------
    ax : matplotlib axes
        Where to draw; a colour bar is added beside it.
    model : OpenModel
        The original mesh.
    deviation : (N,) float array
        Deviation at each vertex in vector order [model units]; its size is drawn, not its sign.
    largest : float, optional
        End of the colour scale, to compare several maps; by default the largest deviation.

    Returns
    -------
    matplotlib axes
        ``ax``.
    """
    size = np.abs(np.asarray(deviation, dtype=np.float64))
    if size.shape != (model.n_vertices,):
        raise ValueError(f"deviation has the shape {size.shape}; the model has {model.n_vertices} vertices")
    end = float(size.max()) if largest is None else largest
    drawn = ax.tripcolor(
        model.points[:, 0],
        model.points[:, 1],
        model.faces,
        size,
        shading="gouraud",
        cmap="magma_r",
        vmin=0.0,
        vmax=end or 1.0,
        rasterized=True,
    )
    _frame(ax, model.points)
    bar = ax.figure.colorbar(drawn, ax=ax, shrink=0.8, pad=0.02)
    bar.set_label("error [model units]")
    bar.outline.set_visible(False)
    return ax


def front_figure(
    model: OpenModel,
    F: npt.ArrayLike,
    meshes: Sequence[tuple[int, IntArray]],
    *,
    knee: int | None = None,
    chosen: int | None = None,
    title: str | None = None,
) -> Figure:
    """Draw the front of a simplification beside the original and a few of the simplified meshes.

    Parameters
    ----------
    model : OpenModel
        The original mesh.
    F : (S, 2) float array
        The front: error [model units] and triangles.
    meshes : sequence of (row of F, (M, 3) faces in vector order)
        At most three solutions to show, in the order of the panels.
    knee, chosen : int, optional
        Rows of ``F`` to mark.
    title : str, optional
        By default the model's name and size.

    Returns
    -------
    matplotlib Figure
        Not bound to any window or backend; ``figure.savefig("front.png")`` writes it.
    """
    from matplotlib.figure import Figure

    F = np.asarray(F, dtype=np.float64)
    width, depth = np.ptp(model.points[:, :2], axis=0)
    tall = depth > 1.15 * width  # a face: its panels stand side by side; a terrain: two by two
    figure = Figure(figsize=(15.0, 5.6) if tall else (14.0, 6.6), dpi=110, layout="constrained")
    halves = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.8 if tall else 1.35), wspace=0.02)
    left, right = halves[0]
    front = left.subplots()
    plot_front(
        front, F, knee=knee, chosen=chosen, marked=[row for row, _ in meshes], n_points=model.n_vertices
    )
    size = f"{model.n_vertices:,} vertices, {len(model.faces):,} triangles"
    front.set_title(title or f"{PurePath(model.name).name}: {size}", loc="left")

    panels = right.subplots(*((1, 4) if tall else (2, 2))).ravel()
    height = float(np.ptp(model.points[:, 2]))
    exaggeration = max(1.0, LEAST_RELIEF * float(max(width, depth)) / height) if height > 0 else 1.0
    colour = model.attributes.get("color")
    look: dict[str, Any] = {"exaggeration": exaggeration, "colour": colour}
    plot_mesh(panels[0], model.points, model.faces, **look)
    panels[0].set_title(f"original\n{len(model.faces):,} triangles", fontsize=10)
    for letter, panel, (row, faces) in zip("abc", panels[1:], meshes, strict=False):
        plot_mesh(panel, model.points, faces, **look)
        mean = F[row, 0] / model.n_vertices
        panel.set_title(f"{letter}: {int(F[row, 1]):,} triangles\nmean error {mean:.3g}", fontsize=10)
        panel.set(xlim=panels[0].get_xlim(), ylim=panels[0].get_ylim())
    for panel in panels[1 + len(meshes) :]:
        panel.axis("off")
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
        Between AMBIENT and 1 (Lambert's cosine law above the ambient light); AMBIENT for a triangle without
        area.

    Examples
    --------
    A triangle that faces the light is fully lit:

    >>> u, v = np.cross(LIGHT, [0, 0, 1.0]), np.cross(LIGHT, np.cross(LIGHT, [0, 0, 1.0]))
    >>> float(hillshade(np.array([[0 * u, u, v]])).round(6)[0])
    1.0
    """
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1)
    cosine = normal @ (np.array(LIGHT) / np.linalg.norm(LIGHT))
    lit = np.divide(cosine, length, out=np.zeros_like(length), where=length > 0)
    return AMBIENT + (1 - AMBIENT) * np.clip(lit, 0.0, 1.0)


def _turned(points: FloatArray, elevation: float, turn: float) -> FloatArray:
    """Turn points (V, 3) into the frame of the picture: x to the right, y up, z to the viewer."""
    a, b = np.radians(turn), np.radians(90.0 - elevation)
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), np.sin(b)], [0, -np.sin(b), np.cos(b)]])
    return (points - points.mean(axis=0)) @ about_z.T @ about_x.T


def _frame(ax: Axes, points: FloatArray) -> None:
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    margin = 0.01 * float((high - low).max())
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    ax.set_aspect("equal")
    ax.axis("off")


def _plain_numbers(ax: Axes) -> None:
    """Write 2000, not 2 x 10^3, where the numbers are of readable size."""
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
