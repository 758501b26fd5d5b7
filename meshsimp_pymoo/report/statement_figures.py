"""The pictures of a statement of quality: a map of the residuals, and how they and the least angles are distributed."""

from __future__ import annotations

import base64
import io
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.report.colours import SCALE_QUANTILE
from meshsimp_pymoo.report.figures import BREAK_LINE, LINE, MARK, original_mesh, plot_error, verbatim
from meshsimp_pymoo.report.residuals import Raster, raster_of
from meshsimp_pymoo.surface.accuracy import THIN_ANGLES, Accuracy, Compared, Histogram
from meshsimp_pymoo.surface.units import ANGLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["address_of", "angles_figure", "map_figure", "pictures", "residuals_figure"]

# Signed residuals: blue where the mesh is above the original, red where it is below.
SIGNED_COLOURS = "RdBu_r"
NOTHING, BARE = "#c9ccd1", "#111111"
# Samples along the longer side of a map, and the share of its width that the scale bar takes about.
MOST_ACROSS, BAR_SHARE = 1200, 0.22
DPI = 150
# Of SVG, so that the same figure has the same bytes.
SALT = {"svg.hashsalt": "meshsimp", "svg.fonttype": "path"}


def pictures(compared: Compared, numbers: Accuracy) -> dict[str, str]:
    """Return the pictures of a statement as addresses of images that are inside the page, by name."""
    return {
        "map": address_of(map_figure(compared, numbers)),
        "spread": address_of(residuals_figure(numbers), vector=True),
        "angles": address_of(angles_figure(numbers), vector=True),
    }


def address_of(figure: Figure, *, vector: bool = False) -> str:
    """Return a figure as the address of an image that is inside the page, the same for the same figure."""
    from matplotlib import rc_context

    content = io.BytesIO()
    if vector:
        with rc_context(SALT):
            figure.savefig(content, format="svg", metadata={"Date": None, "Creator": None})
        return f"data:image/svg+xml;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"
    figure.savefig(content, format="png", dpi=DPI, metadata={"Software": None})
    return f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"


def residuals_figure(numbers: Accuracy) -> Figure:
    """Draw how often residuals have which size; what is beyond the even bins is said in words."""
    found, unit = numbers.histogram, verbatim(numbers.unit)
    figure, ax = _figure((6.4, 3.0))
    edges, counts = _bars(ax, found)
    if numbers.closed:
        ax.set_xlabel(f"distance from the mesh [{unit}]")
    else:
        ax.axvline(0.0, color="0.35", linewidth=0.8)
        ax.set_xlabel(f"original minus mesh [{unit}]")
        bound = numbers.le90
        for side in (-bound, bound):
            ax.axvline(side, color=MARK, linewidth=1.0, linestyle="--")
        ax.plot([], [], color=MARK, linewidth=1.0, linestyle="--", label=f"± LE90 = {bound:.4g}")
        ax.axvline(numbers.bias, color=BREAK_LINE, linewidth=1.2, label=f"bias = {numbers.bias:.3g}")
    if numbers.closed:
        ax.axvline(numbers.le90, color=MARK, linewidth=1.0, linestyle="--", label=f"LE90 = {numbers.le90:.4g}")
    ax.set_ylabel("check points")
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    outer = zip(("below", "above"), counts, (edges[0], edges[-1]), strict=True)
    said = [f"{count:,} {side} {edge:.3g}" for side, count, edge in outer if count]
    ax.set_title(", ".join(said) + " are not drawn" if said else "", fontsize=9, loc="left")
    ax.legend(frameon=False, fontsize=9)
    return figure


def _bars(ax: Axes, found: Histogram) -> tuple[FloatArray, tuple[int, int]]:
    """Draw the even bins; return their edges, and how many are below and above them."""
    edges, counts = np.array(found.edges), np.array(found.counts)
    width = np.median(np.diff(edges))
    first = int(abs(edges[1] - edges[0] - width) > 1e-6 * width) if len(counts) > 2 else 0
    last = len(counts) - (int(abs(edges[-1] - edges[-2] - width) > 1e-6 * width) if len(counts) > 2 else 0)
    inner = edges[first : last + 1]
    ax.bar(inner[:-1], counts[first:last], np.diff(inner), align="edge", color=LINE, edgecolor="white", linewidth=0.3)
    if inner[-1] > inner[0]:  # else nothing is covered
        ax.set_xlim(inner[0], inner[-1])
    return inner, (int(counts[:first].sum()), int(counts[last:].sum()))


def angles_figure(numbers: Accuracy) -> Figure:
    """Draw how often least angles have which size."""
    found = numbers.angles.histogram
    figure, ax = _figure((6.4, 2.6))
    edges, counts = np.array(found.edges), np.array(found.counts)
    ax.bar(edges[:-1], 100.0 * counts / max(counts.sum(), 1), np.diff(edges), align="edge", color=LINE,
           edgecolor="white", linewidth=0.3)  # fmt: skip
    for limit in THIN_ANGLES:
        ax.axvline(limit, color=MARK, linewidth=1.0, linestyle="--")
    ax.set_xlim(0.0, 60.0)
    ax.set_xticks(range(0, 61, 10))
    ax.set_xlabel("least angle of a triangle [degrees]")
    ax.set_ylabel("triangles [%]")
    return figure


def map_figure(compared: Compared, numbers: Accuracy) -> Figure:
    """Draw where the residuals are: a map with their signs, or a closed surface from both sides with their size."""
    if not compared.signed:
        return _body(compared)
    try:
        raster = raster_of(compared.surface.model)
    except ModelError:  # it is no raster, or none that is even
        raster = None
    is_even = raster is not None and raster.transform[1] == raster.transform[3] == 0.0
    view = compared.surface.view
    figure, ax = _figure(_size_of_map(*view.extent[:2]))
    drawn = _raster(ax, compared, raster) if raster is not None and is_even else _triangles(ax, compared)
    _finish_map(ax, compared, numbers, drawn)
    return figure


def _size_of_map(width: float, depth: float) -> tuple[float, float]:
    share = float(np.clip(depth / width, 0.35, 1.35)) if width > 0.0 else 1.0
    return 7.4, 6.0 * share + 1.0


def _raster(ax: Axes, compared: Compared, raster: Raster) -> Any:
    """Draw every so many rows and columns of the raster in the coordinates of its file; return what has the colours."""
    rows, columns = raster.shape
    stride = max(1, -(-max(rows, columns) // MOST_ACROSS))
    shown = np.full((-(-rows // stride), -(-columns // stride)), np.nan, np.float32)
    bare: list[FloatArray] = []
    a, _, c, _, e, f = raster.transform
    for part in compared.parts():
        number = raster.number(part.vertices)
        row, column = np.divmod(number, columns)
        drawn = (number >= 0) & (row % stride == 0) & (column % stride == 0) & part.covered
        shown[row[drawn] // stride, column[drawn] // stride] = part.values[drawn]
        outside = ~part.covered & (number >= 0)
        bare.append(np.column_stack([a * (column[outside] + 0.5) + c, e * (row[outside] + 0.5) + f]))
    # a picture element stands for the samples from its own on
    extent = (c, c + a * stride * shown.shape[1], f + e * stride * shown.shape[0], f)
    ax.set_facecolor(NOTHING)
    end = _end_of_scale(shown[~np.isnan(shown)].astype(np.float64))
    image = ax.imshow(shown, extent=extent, origin="upper", cmap=SIGNED_COLOURS, vmin=-end, vmax=end,
                      interpolation="nearest")  # fmt: skip
    ax.set_xlim(min(c, c + a * columns), max(c, c + a * columns))
    ax.set_ylim(min(f, f + e * rows), max(f, f + e * rows))
    _mark_bare(ax, np.concatenate(bare))
    return image


def _triangles(ax: Axes, compared: Compared) -> Any:
    """Draw the residuals at the vertices of the drawn original, between which the colours are mixed."""
    from matplotlib.tri import Triangulation

    surface = compared.surface
    faces = original_mesh(surface)[1]
    rows = np.unique(faces)
    found = compared.at(rows)
    places = _places(compared, rows)
    end = _end_of_scale(found.values[found.covered])
    values = np.where(found.covered, found.values, 0.0)
    drawn = ax.tripcolor(
        Triangulation(*places.T, np.searchsorted(rows, faces)), values, shading="gouraud", cmap=SIGNED_COLOURS,
        vmin=-end, vmax=end, rasterized=True,
    )  # fmt: skip
    ax.set_facecolor(NOTHING)
    _mark_bare(ax, places[~found.covered])
    return drawn


def _is_upright(compared: Compared) -> bool:
    return bool(np.array_equal(compared.surface.view.rotation, np.eye(3)))


def _places(compared: Compared, rows: IntArray) -> FloatArray:
    """Return where vertices are drawn: in the coordinates of their file, or if it lies otherwise as seen from above."""
    surface = compared.surface
    if _is_upright(compared):
        return np.asarray(surface.model.file_points[rows])[:, :2]
    return np.asarray(surface.points[rows])[:, :2]


def _end_of_scale(values: FloatArray) -> float:
    size = np.abs(values)
    if not len(size):
        return 1.0
    return float(np.quantile(size, SCALE_QUANTILE)) or float(size.max()) or 1.0


def _mark_bare(ax: Axes, places: FloatArray) -> None:
    if len(places):
        ax.plot(*places.T, ".", color=BARE, markersize=2.0, label=f"{len(places):,} not covered")


def _finish_map(ax: Axes, compared: Compared, numbers: Accuracy, drawn: Any) -> None:
    """Add what a map needs: axes in coordinates, a scale bar, the colours in units, where the largest residual is."""
    facts, scale = compared.surface.model.georeference, compared.surface.view.scale
    upright = _is_upright(compared)
    unit = str(facts.get("unit") or "")
    names = ("x", "y") if upright else ("x from above", "y from above")
    if unit in ANGLES:
        names = ("longitude", "latitude")
    elif upright and (facts.get("epsg") or facts.get("crs")):
        names = ("easting", "northing")
    of_axes = verbatim(unit if upright and unit else numbers.unit)
    ax.set_xlabel(f"{names[0]} [{of_axes}]")
    ax.set_ylabel(f"{names[1]} [{of_axes}]")
    ax.ticklabel_format(useOffset=False, style="plain")
    ax.tick_params(labelsize=8)
    for label in ax.get_yticklabels():
        label.set_rotation(90)
        label.set_verticalalignment("center")
    across = float(scale[0]) if upright else 1.0
    ax.set_aspect(float(scale[1] / scale[0]) if upright else 1.0)
    ax.locator_params(axis="both", nbins=5)
    if upright:
        x, y, _ = numbers.max_at
        ax.plot([x], [y], "o", markersize=11, fillstyle="none", color=BARE, markeredgewidth=1.3,
                label=f"maximum {numbers.max_error:.4g}")  # fmt: skip
    _scale_bar(ax, across, verbatim(numbers.unit))
    size = np.abs(drawn.get_array().compressed() if hasattr(drawn.get_array(), "compressed") else drawn.get_array())
    beyond = "both" if len(size) and size.max() > drawn.get_clim()[1] else "neither"
    colours = ax.figure.colorbar(drawn, ax=ax, shrink=0.85, pad=0.02, extend=beyond)
    colours.set_label(f"original minus mesh [{verbatim(numbers.unit)}]")
    colours.outline.set_visible(False)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize=9, borderaxespad=0.2)


def _scale_bar(ax: Axes, across: float, unit: str) -> None:
    """Draw a bar of a round length, in the unit of lengths, of which a unit of the x axis has ``across``."""
    from matplotlib.patheffects import withStroke

    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    length = round_length(BAR_SHARE * (right - left) * across)
    begin = left + 0.04 * (right - left)
    y = low + 0.05 * (high - low)
    halo = [withStroke(linewidth=4.5, foreground="white")]
    end = begin + length / across
    ax.plot([begin, end], [y, y], color="black", linewidth=2.2, solid_capstyle="butt", path_effects=halo)
    ax.text(
        (begin + end) / 2.0, y + 0.015 * (high - low), f"{length:,.12g} {unit}", ha="center", va="bottom", fontsize=9,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )  # fmt: skip


def round_length(most: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is no longer.

    >>> round_length(7.3), round_length(0.49), round_length(1000.0)
    (5.0, 0.2, 1000.0)
    """
    power = 10.0 ** math.floor(math.log10(most)) if most > 0.0 else 1.0
    step = next((step for step in (5.0, 2.0) if step * power <= most), 1.0)
    return float(f"{step * power:.1g}")


def _body(compared: Compared) -> Figure:
    """Draw the size of the residuals on a body from both sides."""
    surface = compared.surface
    found = compared.at(np.arange(surface.n_vertices))
    figure, ax = _figure((7.4, 4.2))
    size = np.abs(found.values)
    plot_error(surface, size, ax, covered=found.covered, largest=_end_of_scale(size))
    ax.set_title("from the front, and from the back", fontsize=10, loc="left")
    return figure


def _figure(size: tuple[float, float]) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=110, layout="constrained")
    ax = figure.subplots()
    ax.set_axisbelow(True)
    return figure, ax
