"""Figures of an experiment in the paper's kinds: fronts, box plots, selected solutions, meshes with their error.

Every function returns a matplotlib figure that is bound to no window; methods keep their colour and mark in
all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.comparison.analysis import attainment_surfaces, selected_solutions
from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.comparison.store import StoredRun, classic_mesh
from meshsimp_pymoo.comparison.study import CLASSIC_NAMES, SCORINGS, Case, Study
from meshsimp_pymoo.indicators import non_dominated
from meshsimp_pymoo.report.figures import front_axes, plot_error, plot_mesh
from meshsimp_pymoo.surface.height import HeightSurface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


__all__ = ["box_figure", "fronts_figure", "meshes_figure", "method_look", "selected_figure"]


# Okabe and Ito's colours, told apart by all eyes; methods beyond them are grey.
COLOURS = ("#0072B2", "#56B4E9", "#D55E00", "#E69F00", "#009E73", "#CC79A7", "#6A3D9A", "#8C6D31")
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<")
# As many colours as marks have no divisor in common, so no two baselines look the same; whole fronts are lines.
CLASSIC_COLOURS = ("#222222", "#555555", "#888888", "#AAAAAA")
CLASSIC_MARKS = ("+", "x", "1", "2", "3", "4", "*")
CLASSIC_LINES = dict(zip([b.label for b in BASELINES.values() if b.front], ("-", "--", ":"), strict=True))
KINDS = {"fewest_triangles": "fewest triangles", "trade_off": "best trade-off", "least_error": "least error"}

# An entry of a legend below the panels; the longest names are those of baselines.
LEGEND_INCHES = 2.6

# At most so many meshes beside the original: more would be too small to see.
MOST_MESHES = 5
# Views of a relief: from the front, and from the side.
FRONT, SIDE = (90.0, 0.0), (20.0, -60.0)
# The error's colour ends at this share of the largest deviation of any mesh shown, so that a few spikes do not
# pale all the rest.
COLOUR_END = 0.98


@dataclass(frozen=True)
class _Shown:
    """A mesh to draw: upright points, faces, and deviation and cover of the original's vertices."""

    title: str
    points: FloatArray
    faces: npt.NDArray[Any]
    deviation: FloatArray
    covered: npt.NDArray[np.bool_]


def fronts_figure(study: Study, case: Case) -> Figure:
    """Draw the merged front of every method, the pseudo-optimal front, and how far half of the runs get."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 6.0), dpi=110, layout="constrained")
    ax = figure.subplots()
    optimal = case.optimal.front
    ax.step(optimal[:, 1], optimal[:, 0], where="post", color="0.75", linewidth=5, label="pseudo-optimal", zorder=1)
    for method, runs in case.runs.items():
        colour, mark = method_look(study, case, method)
        merged = np.vstack(list(runs.values()))
        front = non_dominated(merged)
        style: dict[str, Any] = {"color": colour, "marker": mark, "linestyle": "none", "zorder": 3}
        if method in CLASSIC_LINES:
            line = {"color": colour, "linestyle": CLASSIC_LINES[method], "linewidth": 1.3}
            ax.step(front[:, 1], front[:, 0], where="post", label=method, zorder=2, **line)
            continue
        if method in case.classic:
            ax.plot(front[:, 1], front[:, 0], markersize=7, label=method, **style)
            continue
        ax.plot(front[:, 1], front[:, 0], markersize=3.5, fillstyle="none", label=method, **style)
        if len(runs) > 1:
            half = attainment_surfaces(runs, [50])[50]
            ax.step(half[:, 1], half[:, 0], where="post", color=colour, linewidth=0.9, alpha=0.7, zorder=2)
    drawn = np.vstack([np.vstack(list(runs.values())) for runs in case.runs.values()])
    front_axes(ax, drawn, label="error [file units]")
    ax.set_title(f"{case.problem.name}: fronts merged over runs", loc="left")
    ax.set_title(f"{case.budget}, error {SCORINGS[case.scoring]}", loc="right", fontsize=9, color="0.4")
    ax.legend(
        frameon=False,
        fontsize=8.5,
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
        title="thin lines: half of the runs" if any(len(runs) > 1 for runs in case.runs.values()) else None,
    )
    return figure


def box_figure(study: Study, cases: Sequence[Case], indicator: str) -> Figure:
    """Draw an indicator of every run as box plots, one panel for each model.

    Parameters
    ----------
    study : Study
        The experiment.
    cases : sequence of Case
        The models at one budget and scoring.
    indicator : {"hvr", "cardinality"}
        What to draw.
    """
    figure, panels = _grid(len(cases), 4.6, 3.6)
    for panel, case in zip(panels, cases, strict=False):
        methods = list(case.runs)
        values = [np.asarray(getattr(case.scores[m], indicator), dtype=float) for m in methods]
        several = [k for k, runs in enumerate(values) if len(runs) > 1]
        if several:
            boxes = panel.boxplot(
                [values[k] for k in several],
                positions=[k + 1 for k in several],
                widths=0.65,
                patch_artist=True,
                medianprops={"color": "black"},
                flierprops={"markersize": 3},
            )
            for box, k in zip(boxes["boxes"], several, strict=True):
                colour, _ = method_look(study, case, methods[k])
                box.set(facecolor=colour, alpha=0.45, edgecolor=colour)
        for place, (method, runs) in enumerate(zip(methods, values, strict=True), start=1):
            colour, mark = method_look(study, case, method)
            if len(runs) == 1:
                panel.plot([place], runs, marker=mark, color=colour, markersize=8, linestyle="none")
        panel.set_xticks(range(1, len(methods) + 1), methods, rotation=40, ha="right", fontsize=8)
        panel.set_title(case.problem.name, loc="left", fontsize=10)
        panel.grid(axis="y", color="0.92", linewidth=0.6)
        panel.set_axisbelow(True)
        panel.set_ylim(bottom=0 if indicator == "cardinality" else None)
    name = {"hvr": "hypervolume ratio (1 is the pseudo-optimal front)", "cardinality": "solutions of a run"}[indicator]
    figure.suptitle(f"{name}; {cases[0].budget}, error {SCORINGS[cases[0].scoring]}", fontsize=11)
    return figure


def selected_figure(study: Study, cases: Sequence[Case]) -> Figure:
    """Draw the three selected solutions of every method, one panel for each model."""
    figure, panels = _grid(len(cases), 4.6, 3.8)
    seen: dict[str, Any] = {}
    for panel, case in zip(panels, cases, strict=False):
        optimal = case.optimal.front
        panel.step(optimal[:, 1], optimal[:, 0], where="post", color="0.85", linewidth=4, zorder=1)
        chosen = selected_solutions(case.runs, optimal=case.optimal)
        points = []
        for method, solutions in chosen.items():
            colour, mark = method_look(study, case, method)
            three = sorted([s for s in solutions if s.kind in KINDS], key=lambda s: s.triangles)
            xy = np.array([[s.triangles, s.error] for s in three])
            points.append(xy[:, ::-1])
            (line,) = panel.plot(
                xy[:, 0], xy[:, 1], color=colour, marker=mark, markersize=6, linestyle="none", zorder=3
            )
            seen.setdefault(method, line)
        front_axes(panel, np.vstack([optimal, *points]), label="error [file units]")
        panel.set_title(case.problem.name, loc="left", fontsize=10)
    figure.suptitle(
        f"fewest triangles, best trade-off and least error of every method's merged front; {cases[0].budget}, "
        f"error {SCORINGS[cases[0].scoring]}",
        fontsize=11,
    )
    figure.legend(
        list(seen.values()),
        list(seen),
        frameon=False,
        loc="outside lower center",
        ncols=max(1, int(figure.get_figwidth() / LEGEND_INCHES)),
        fontsize=8.5,
    )
    return figure


def meshes_figure(study: Study, case: Case) -> Figure:
    """Draw the original and the best trade-offs of some methods: from the front, from the side, and their error.

    Of one baseline, MeshLab's if it is there, the mesh whose size is nearest to that of the best evolutionary trade-off
    is shown.
    """
    from matplotlib.figure import Figure

    surface = study.surface(case.problem, case.scoring)
    shown = _meshes(study, case, surface)
    points, exaggeration = surface.points, surface.view.exaggeration
    flat = points * [1.0, 1.0, exaggeration]
    n = 1 + len(shown)
    width, depth = np.ptp(flat[:, :2], axis=0)
    figure = Figure(figsize=(2.6 * n + 0.9, 2.6 * (2.0 * depth / width + 0.9)), dpi=110, layout="constrained")
    engine: Any = figure.get_layout_engine()
    engine.set(w_pad=0.02, h_pad=0.02, wspace=0.0, hspace=0.0)
    panels = figure.subplots(3, n, squeeze=False, height_ratios=(depth / width, 0.75, depth / width))
    end = max(float(np.quantile(mesh.deviation, COLOUR_END)) for mesh in shown) or 1.0
    nothing = np.zeros(surface.n_vertices)
    title = f"original\n{len(surface.faces):,} triangles"
    original = _Shown(title, points, surface.faces, nothing, nothing == 0)
    drawn: Any = None
    for column, mesh in enumerate([original, *shown]):
        for row, view in enumerate((FRONT, SIDE)):
            panel = panels[row, column]
            shape = (mesh.points, mesh.faces)
            plot_mesh(shape, panel, view=view, exaggeration=exaggeration, edges=column > 0)
            panel.set(xlim=panels[row, 0].get_xlim(), ylim=panels[row, 0].get_ylim())
        panels[0, column].set_title(mesh.title, fontsize=8.5)
        below = panels[2, column]
        below.axis("off")
        below.set_aspect("equal")
        if column == 0:
            text = "error at every\nvertex of the original\n\nblue: vertices that\nno triangle covers"
            below.text(0.5, 0.5, text, ha="center", va="center", fontsize=9, transform=below.transAxes)
            continue
        plot_error(surface, mesh.deviation, below, covered=mesh.covered, largest=end, bar=False)
        drawn = below.collections[0]
        below.set(xlim=panels[0, 0].get_xlim(), ylim=panels[0, 0].get_ylim())
    bar = figure.colorbar(drawn, ax=panels[2, :].tolist(), shrink=0.8, pad=0.01, extend="max")
    bar.set_label("error [file units]", fontsize=9)
    figure.suptitle(f"{case.problem.name}; {case.budget}, error {SCORINGS[case.scoring]}", fontsize=11)
    return figure


def _meshes(study: Study, case: Case, surface: HeightSurface) -> list[_Shown]:
    """Return the meshes to show."""
    chosen = selected_solutions(case.runs, optimal=case.optimal)
    trade_offs = {method: next(s for s in solutions if s.kind == "trade_off") for method, solutions in chosen.items()}
    evolutionary = [m for m in case.runs if m not in case.classic]
    # the best by hypervolume, and one baseline if there is any
    ranked = sorted(evolutionary, key=lambda m: -case.scores[m].merged_hvr)
    picked = [m for m in evolutionary if m in ranked[: MOST_MESHES - bool(case.classic)]]
    size = trade_offs[ranked[0]].triangles
    shown = []
    for method in picked:
        solution = trade_offs[method]
        found = case.find(method, solution.error, solution.triangles)
        shown.append(_subset_shown(surface, method, found.run, found.row))
    baselines = [(method, run) for (name, method), run in study.classic_runs.items() if name == case.problem.name]
    for method, run in sorted(baselines, key=lambda pair: pair[0] != "quadric_collapse")[:1]:
        sizes = run.arrays["F"][:, 1]
        row = int(np.argmin(np.abs(np.log(np.maximum(sizes, 0.1) / size))))
        if BASELINES[method].front:
            shown.append(_subset_shown(surface, CLASSIC_NAMES[method], run, row))
            continue
        vertices, faces = classic_mesh(run, row)
        scored = surface.score(vertices, faces)
        deviation, covered = scored.deviation, scored.covered
        title = _mesh_title(surface, CLASSIC_NAMES[method], len(faces), deviation, covered)
        shown.append(_Shown(title, surface.model.to_local(vertices), faces, deviation, covered))
    return shown


def _subset_shown(surface: HeightSurface, method: str, run: StoredRun, row: int) -> _Shown:
    """Return the mesh of a stored subset of the model's vertices."""
    kept = np.unpackbits(run.arrays["kept"][row])[: surface.n_vertices].astype(bool)
    mesh = surface.simplify(kept)
    deviation = np.abs(mesh.deviation)
    title = _mesh_title(surface, method, len(mesh.faces), deviation, mesh.covered)
    return _Shown(title, surface.points, mesh.faces, deviation, mesh.covered)


def _mesh_title(
    surface: HeightSurface, method: str, triangles: int, deviation: FloatArray, covered: npt.NDArray[np.bool_]
) -> str:
    """Say what a mesh is: its method, its size, its mean error, and how many vertices it abandons."""
    mean = np.average(deviation, weights=surface.model.weights)
    bare = len(covered) - np.count_nonzero(covered)
    return f"{method}\n{triangles:,} triangles, mean {mean:.3g}\n{bare:,} vertices uncovered"


def method_look(study: Study, case: Case, method: str) -> tuple[str, str]:
    """Return a method's colour and its mark in matplotlib's spelling, the same in all pictures."""
    if method in study.methods:
        place = study.methods.index(method)
        return (COLOURS[place], MARKS[place]) if place < len(COLOURS) else ("0.5", ".")
    place = list(CLASSIC_NAMES.values()).index(method)
    return CLASSIC_COLOURS[place % len(CLASSIC_COLOURS)], CLASSIC_MARKS[place % len(CLASSIC_MARKS)]


def _grid(n: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    columns = min(3, n)
    rows = -(-n // columns)
    figure = Figure(figsize=(width * columns, height * rows + 0.6), dpi=110, layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for panel in panels[n:]:
        panel.axis("off")
    return figure, panels
