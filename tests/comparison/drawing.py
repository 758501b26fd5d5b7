"""What of a figure overlaps, as it is drawn."""

from __future__ import annotations

from matplotlib.backends.backend_agg import FigureCanvasAgg


def overlaps(figure):
    """Return what of a figure's title, panels and legends overlaps, and what sticks out of it [pixels]."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    title = figure._suptitle.get_window_extent(renderer)
    others = [ax.get_tightbbox(renderer) for ax in figure.axes] + [
        x.get_window_extent(renderer) for x in figure.legends
    ]
    touching = [box for box in others if box is not None and box.y1 > title.y0 - 2]
    outside = [box for box in [title, *others] if box.x0 < -1 or box.y0 < -1 or box.x1 > figure.bbox.x1 + 1]
    return touching, outside
