"""Figures of an experiment, those of the paper's kinds and those that are usual today.

The paper's: fronts, box plots, selected solutions, meshes with their error. Beside them: convergence, critical
differences and performance profiles.

Every function returns a matplotlib figure that is bound to no window; methods keep their colour and mark in
all of them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.comparison.analysis import TRADE_OFFS, anytime, attainment_surfaces, selected_solutions
from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.comparison.statistics import ALPHA, performance_profile
from meshsimp_pymoo.comparison.store import StoredRun, classic_mesh
from meshsimp_pymoo.comparison.study import CLASSIC_NAMES, SCORINGS, Case, Study, on_all_models, ranked
from meshsimp_pymoo.indicators import non_dominated
from meshsimp_pymoo.report.figures import ERROR_COLOURS, front_axes, plain_numbers, plot_error, plot_mesh
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.kinds import OfModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


__all__ = [
    "box_figure",
    "convergence_figure",
    "critical_difference_figure",
    "fronts_figure",
    "meshes_figure",
    "method_look",
    "profile_figure",
    "profiled",
    "selected_figure",
]


# Okabe and Ito's colours, told apart by all eyes; methods beyond them have them again, with other marks.
COLOURS = ("#0072B2", "#56B4E9", "#D55E00", "#E69F00", "#009E73", "#CC79A7", "#6A3D9A", "#8C6D31")
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<")
# As many colours as marks have no divisor in common, so no two baselines look the same; whole fronts are lines.
CLASSIC_COLOURS = ("#222222", "#555555", "#888888", "#AAAAAA")
CLASSIC_MARKS = ("+", "x", "1", "2", "3", "4", "*")
CLASSIC_LINES = dict(zip([b.label for b in BASELINES.values() if b.front], ("-", "--", ":"), strict=True))
KINDS = {"fewest_triangles": "fewest triangles", "trade_off": "best trade-off", "least_error": "least error"}

# Letters of a method's name: longer ones would leave no room for what is drawn.
MOST_LETTERS = 37
# Seconds: the shortest time that a logarithmic axis shows.
SHORTEST = 1e-3
# At most so many meshes beside the original: more would be too small to see.
MOST_MESHES = 5
# Views of a relief: from the front, and from the side.
FRONT, SIDE = (90.0, 0.0), (20.0, -60.0)
# The error's colour ends at this share of the largest deviation of any mesh shown, so that a few spikes do not
# pale all the rest.
COLOUR_END = 0.98


@brief
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

    figure = Figure(figsize=(9.5, max(6.0, _legend_inches(len(case.runs) + 2))), dpi=110, layout="constrained")
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
            ax.step(front[:, 1], front[:, 0], where="post", label=_short(method), zorder=2, **line)
            continue
        if method in case.classic:
            ax.plot(front[:, 1], front[:, 0], markersize=7, label=_short(method), **style)
            continue
        ax.plot(front[:, 1], front[:, 0], markersize=3.5, fillstyle="none", label=_short(method), **style)
        if len(runs) > 1:
            half = attainment_surfaces(runs, [50])[50]
            ax.step(half[:, 1], half[:, 0], where="post", color=colour, linewidth=0.9, alpha=0.7, zorder=2)
    drawn = np.vstack([np.vstack(list(runs.values())) for runs in case.runs.values()])
    front_axes(ax, drawn, label=f"error [{case.problem.unit}]")
    _title(figure, f"{case.problem.name}: fronts merged over runs", [case])
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
        values = [case.unary(m, indicator) for m in methods]
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
        panel.set_xticks(range(1, len(methods) + 1), map(_short, methods), rotation=40, ha="right", fontsize=8)
        panel.set_title(case.problem.name, loc="left", fontsize=10)
        panel.grid(axis="y", color="0.92", linewidth=0.6)
        panel.set_axisbelow(True)
        panel.set_ylim(bottom=0 if indicator == "cardinality" else None)
    name = {"hvr": "hypervolume ratio (1 is the pseudo-optimal front)", "cardinality": "solutions of a run"}[indicator]
    _title(figure, name, cases)
    return figure


def selected_figure(study: Study, cases: Sequence[Case]) -> Figure:
    """Draw the three selected solutions of every method, one panel for each model.

    The best trade-off by the paper's rule has a ring around it, where there is one.
    """
    figure, panels = _grid(len(cases), 4.6, 3.8)
    seen: dict[str, Any] = {}
    literal = False
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
            for s in solutions:
                if s.kind == TRADE_OFFS["paper"]:
                    literal = True
                    points.append(np.array([[s.error, s.triangles]]))
                    panel.plot(s.triangles, s.error, color=colour, marker=mark, markersize=6, zorder=3)
                    panel.plot(s.triangles, s.error, color=colour, marker="o", markersize=11, fillstyle="none")
        front_axes(panel, np.vstack([optimal, *points]), label=f"error [{case.problem.unit}]")
        panel.set_title(case.problem.name, loc="left", fontsize=10)
    ringed = " (ringed: by the paper's Eq. 11)" if literal else ""
    _title(
        figure,
        f"fewest triangles, best trade-off{ringed} and least error of every method's merged front",
        cases,
    )
    _legend_below(figure, seen)
    return figure


def convergence_figure(study: Study, cases: Sequence[Case], over: str) -> Figure:
    """Draw how the hypervolume ratio grew over evaluations or time: median and quartiles over runs, for each model.

    The ratio is that of the front that an algorithm has at a moment, against the pseudo-optimal front of all runs; it
    falls where an algorithm loses what it had. A front of several merged runs counts what all of them spent. A
    curve goes from when three quarters of the runs have begun to when three quarters have ended. A method without
    chance is a mark at the time it took, and has no evaluations.

    Parameters
    ----------
    study : Study
        The experiment.
    cases : sequence of Case
        The models at one budget and scoring.
    over : {"evaluations", "seconds"}
        What is counted.
    """
    figure, panels = _grid(len(cases), 4.6, 3.6)
    seen: dict[str, Any] = {}
    untraced: set[str] = set()
    for panel, case in zip(panels, cases, strict=False):
        panel.set_xscale("log")
        for method in case.runs:
            colour, mark = method_look(study, case, method)
            curves = case.progress(method, over)
            if curves:
                first, last = np.quantile([(x[0], x[-1]) for x, _ in curves], 0.75, axis=0, method="higher")
                moments = np.geomspace(max(first, SHORTEST), max(last, SHORTEST), 300)
                low, middle, high = anytime(curves, moments)
                panel.fill_between(moments, low, high, color=colour, alpha=0.15, linewidth=0)
                marked: dict[str, Any] = {"marker": mark, "markevery": (15 * (len(seen) % 4), 60), "markersize": 4}
                (line,) = panel.plot(moments, middle, color=colour, linewidth=1.3, **marked)
            elif method in case.classic and over == "seconds":
                (line,) = panel.plot(
                    max(case.seconds(method)[0], SHORTEST), case.scores[method].hvr[0], color=colour, marker=mark,
                    markersize=7, linestyle="none",
                )  # fmt: skip
            else:
                untraced.update({method} - set(case.classic))
                continue
            seen.setdefault(method, line)
        plain_numbers(panel)
        panel.set_title(case.problem.name, loc="left", fontsize=10)
        panel.set_xlabel(f"{over}, log scale", fontsize=9)
        panel.grid(color="0.92", linewidth=0.6)
        panel.set_axisbelow(True)
    missing = f"; {len(untraced)} methods have no curve" if untraced else ""
    _title(figure, f"hypervolume ratio over {over}, median and quartiles of runs{missing}", cases)
    _legend_below(figure, seen)
    return figure


def critical_difference_figure(study: Study, cases: Sequence[Case]) -> Figure:
    """Draw the mean ranks of all methods over the models, and which of them do not differ: Demšar's diagram.

    Ranks are by the median hypervolume ratio, see `study.ranked`. A bar joins methods that do not differ by
    Nemenyi's test, or all of them where Friedman's test finds no difference. Methods that do not have runs on all
    models are left out, and the title has their number.

    References
    ----------
    .. [1] J. Demšar, "Statistical comparisons of classifiers over multiple data sets", Journal of Machine Learning
       Research 7, 2006.
    """
    from matplotlib.figure import Figure

    methods, found = ranked(cases)
    ranks, k = found.mean_ranks, len(methods)
    order = np.argsort(ranks, kind="stable").tolist()
    sides = (order[: (k + 1) // 2], order[(k + 1) // 2 :][::-1])
    # one unit is the height of a line of text
    labels = -1.0 - 0.45 * len(found.groups)
    bottom = labels - len(sides[0])
    figure = Figure(figsize=(9.5, 0.26 * (2.8 - bottom) + 0.7), dpi=110, layout="constrained")
    ax = figure.subplots()
    ax.axis("off")
    ax.set(xlim=(1, k), ylim=(bottom, 2.8))
    ax.plot([1, k], [0, 0], color="black", linewidth=1.2, clip_on=False)
    for rank in range(1, k + 1):
        ax.plot([rank, rank], [0, 0.25], color="black", linewidth=1.0, clip_on=False)
        if (rank - 1) % -(-k // 15) == 0:  # of many ranks not every one has room for its number
            ax.text(rank, 0.4, str(rank), ha="center", va="bottom", fontsize=9)
    length = min(found.critical_difference, k - 1)
    ax.plot([1, 1 + length], [1.9, 1.9], color="0.3", linewidth=1.2, marker="|", markersize=8, clip_on=False)
    more = " (more than all ranks)" if found.critical_difference > k - 1 else ""
    text = f"critical difference {found.critical_difference:.2f}{more}"
    ax.text(1, 2.15, text, ha="left", va="bottom", fontsize=9, color="0.3")
    for level, group in enumerate(found.groups):
        ends = [ranks[group[0]] - 0.012 * k, ranks[group[-1]] + 0.012 * k]
        ax.plot(ends, [-0.5 - 0.45 * level] * 2, color="0.25", linewidth=4, solid_capstyle="butt", clip_on=False)
    for side, (edge, align) in zip(sides, ((1 - 0.03 * k, "right"), (k + 0.03 * k, "left")), strict=True):
        for row, place in enumerate(side):
            colour, mark = method_look(study, cases[0], methods[place])
            y = labels - row
            ax.plot([ranks[place], ranks[place], edge], [0, y, y], color=colour, linewidth=1.0, clip_on=False)
            ax.plot([ranks[place]], [0], color=colour, marker=mark, markersize=6, clip_on=False, zorder=3)
            name = f" {_short(methods[place])}  {ranks[place]:.2f} "
            ax.text(edge, y, name, ha=align, va="center", fontsize=9)
    models = f"{len(cases)} model" + "s" * (len(cases) > 1)
    _title(figure, f"mean ranks by hypervolume ratio over {models}, 1 is best{_absent(cases, methods)}", cases)
    test = found.note or "Friedman's test"
    said = f"{test}: p = {found.p:.2g}"
    # where there is no difference, the one bar over all is no result of Nemenyi's test
    bars = f"methods joined by a bar are not told apart (Nemenyi's test at {ALPHA:g})" if found.p < ALPHA else ""
    ax.set_title(f"{said}; {bars}" if bars and found.groups else said, fontsize=9, color="0.4")
    return figure


def profile_figure(study: Study, cases: Sequence[Case]) -> Figure:
    """Draw in which share of all runs each method is within a factor of the best: performance profiles.

    Of the epsilon to the pseudo-optimal front, which is better when smaller; see `profiled` for what is compared.
    At a factor of 1 a curve begins with how often its method is the best of all; one that ends below 1 reached no
    finite epsilon in the rest.

    References
    ----------
    .. [1] E. D. Dolan and J. J. Moré, "Benchmarking optimization software with performance profiles", Mathematical
       Programming 91(2), 2002.
    """
    from matplotlib.figure import Figure

    methods, values = profiled(cases)
    factors, shares = performance_profile(values)
    figure = Figure(figsize=(9.5, max(5.0, _legend_inches(len(methods)))), dpi=110, layout="constrained")
    ax = figure.subplots()
    end = max(factors[-1] ** 1.05, 1.05)
    for place, method in enumerate(methods):
        colour, mark = method_look(study, cases[0], method)
        ax.step(
            np.append(factors, end), np.append(shares[:, place], shares[-1, place]), where="post", color=colour,
            linestyle="--" if method in cases[0].classic else "-", linewidth=1.4, label=_short(method), marker=mark,
            markevery=max(1, len(factors) // 8), markersize=4.5,
        )  # fmt: skip
    ax.set_xscale("log")
    ax.set(xlim=(1, end), ylim=(0, 1.03))
    plain_numbers(ax)
    ax.set_xlabel("at most so many times the best epsilon, log scale")
    ax.set_ylabel("share of the pairs of a model and a seed")
    ax.grid(color="0.92", linewidth=0.6)
    ax.set_axisbelow(True)
    what = f"epsilon to the pseudo-optimal front, over {len(values)} pairs of a model and a seed"
    _title(figure, f"performance profiles of the {what}{_absent(cases, methods)}", cases)
    ax.legend(frameon=False, fontsize=8.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def profiled(cases: Sequence[Case]) -> tuple[list[str], FloatArray]:
    """Return the epsilon to the pseudo-optimal front of every run: a row for each model and seed.

    Parameters
    ----------
    cases : sequence of Case
        The models at one budget and scoring.

    Returns
    -------
    methods : list of str
        Those that have runs on all models.
    values : (n, k) float array
        Smaller is better. The only run of a method without chance stands in every row of its model; a seed that
        some method has not done has no row.
    """
    methods = on_all_models(cases)
    rows: list[list[float]] = []
    for case in cases:
        found = {m: dict(zip(case.scores[m].seeds.tolist(), case.scores[m].epsilon, strict=True)) for m in methods}
        drawn = [set(found[m]) for m in methods if m not in case.classic]
        seeds = sorted(set.intersection(*drawn)) if drawn else [0]
        rows += [[found[m][0 if m in case.classic else seed] for m in methods] for seed in seeds]
    return methods, np.array(rows).reshape(-1, len(methods))


def meshes_figure(study: Study, case: Case) -> Figure:
    """Draw the original and the best trade-offs of some methods: from the front, from the side, and their error.

    First those that the paper shows (Figure 10), NSGA-II v2 and MOEA/D, then the best of the others by hypervolume.
    Of one baseline, MeshLab's if it is there, the mesh whose size is nearest to that of the best evolutionary trade-off
    is shown.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    surface = study.surface(case.problem, case.scoring)
    shown = _meshes(study, case, surface)
    points, exaggeration = surface.points, surface.view.exaggeration
    flat = points * [1.0, 1.0, exaggeration]
    n = 1 + len(shown)
    width, depth = np.ptp(flat[:, :2], axis=0)
    figure = Figure(figsize=(2.6 * n + 0.9, 2.6 * (2.0 * depth / width + 0.9)), dpi=110, layout="constrained")
    engine: Any = figure.get_layout_engine()
    engine.set(w_pad=0.02, h_pad=0.08, wspace=0.0, hspace=0.0)
    panels = figure.subplots(3, n, squeeze=False, height_ratios=(depth / width, 0.75, depth / width))
    end = max(float(np.quantile(mesh.deviation, COLOUR_END)) for mesh in shown) or 1.0
    nothing = np.zeros(surface.n_vertices)
    title = f"original\n{len(surface.faces):,} triangles"
    original = _Shown(title, points, surface.faces, nothing, nothing == 0)
    colours = ScalarMappable(Normalize(0.0, end), ERROR_COLOURS)
    for column, mesh in enumerate([original, *shown]):
        for row, view in enumerate((FRONT, SIDE)):
            panel = panels[row, column]
            shape = (mesh.points, mesh.faces)
            look: dict[str, Any] = {"view": view, "exaggeration": exaggeration, "is_body": surface.view.is_closed}
            plot_mesh(shape, panel, edges=column > 0, **look)
            panel.set(xlim=panels[row, 0].get_xlim(), ylim=panels[row, 0].get_ylim())
        panels[0, column].set_title(mesh.title, fontsize=8.5)
        below = panels[2, column]
        below.axis("off")
        below.set_aspect("equal")
        if column == 0:
            says = [
                "error at every\nvertex of the original",
                "seen from the front\nand from the back" * surface.view.is_closed,
                "blue: vertices that\nno triangle covers" * _can_uncover(surface),
            ]
            text = "\n\n".join(filter(None, says))
            below.text(0.5, 0.5, text, ha="center", va="center", fontsize=9, transform=below.transAxes)
            continue
        plot_error(surface, mesh.deviation, below, covered=mesh.covered, largest=end, bar=False)
        if not surface.view.is_closed:  # which is drawn from both sides
            below.set(xlim=panels[0, 0].get_xlim(), ylim=panels[0, 0].get_ylim())
    bar = figure.colorbar(colours, ax=panels[2, :].tolist(), shrink=0.8, pad=0.01, extend="max")
    bar.set_label(f"error [{case.problem.unit}]", fontsize=9)
    _title(figure, case.problem.name, [case])
    return figure


def _meshes(study: Study, case: Case, surface: OfModel) -> list[_Shown]:
    """Return the meshes to show."""
    chosen = selected_solutions(case.runs, optimal=case.optimal)
    trade_offs = {method: next(s for s in solutions if s.kind == "trade_off") for method, solutions in chosen.items()}
    evolutionary = [m for m in case.runs if m not in case.classic]
    papers = [study.starts[0].roles.get(preset) for preset in ("nsga2_v2", "moead")] if study.starts else []
    best_first = sorted(evolutionary, key=lambda m: -case.scores[m].merged_hvr)
    order = [m for m in papers if m in evolutionary] + [m for m in best_first if m not in papers]
    picked = order[: MOST_MESHES - bool(case.classic)]  # and one baseline, if there is any
    size = trade_offs[best_first[0]].triangles
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


def _subset_shown(surface: OfModel, method: str, run: StoredRun, row: int) -> _Shown:
    """Return the mesh of a stored subset of the model's vertices."""
    kept = np.unpackbits(run.arrays["kept"][row])[: surface.n_vertices].astype(bool)
    mesh = surface.simplify(kept)
    deviation = np.abs(mesh.deviation)
    title = _mesh_title(surface, method, len(mesh.faces), deviation, mesh.covered)
    return _Shown(title, surface.points, mesh.faces, deviation, mesh.covered)


def _can_uncover(surface: OfModel) -> bool:
    """Tell whether a mesh of a surface can leave vertices uncovered: it has a border."""
    return not surface.view.is_closed or len(surface.border) > 0


def _mesh_title(
    surface: OfModel, method: str, triangles: int, deviation: FloatArray, covered: npt.NDArray[np.bool_]
) -> str:
    """Say what a mesh is: its method, its size, its mean error, and how many vertices it abandons, if it can."""
    mean = np.average(deviation, weights=surface.model.weights)
    title = f"{_short(method)}\n{triangles:,} triangles, mean {mean:.3g}"
    if not _can_uncover(surface):
        return title
    return f"{title}\n{len(covered) - np.count_nonzero(covered):,} vertices uncovered"


def method_look(study: Study, case: Case, method: str) -> tuple[str, str]:
    """Return a method's colour and its mark in matplotlib's spelling, the same in all pictures."""
    if method in study.methods:
        again, place = divmod(study.methods.index(method), len(COLOURS))
        return COLOURS[place], MARKS[(place + again) % len(MARKS)]
    place = list(CLASSIC_NAMES.values()).index(method)
    return CLASSIC_COLOURS[place % len(CLASSIC_COLOURS)], CLASSIC_MARKS[place % len(CLASSIC_MARKS)]


def _absent(cases: Sequence[Case], methods: Sequence[str]) -> str:
    """Say how many methods are left out for want of runs on a model."""
    n = len({method for case in cases for method in case.runs} - set(methods))
    return f"; left out, without runs on some model: {n}" if n else ""


def _short(name: str) -> str:
    """Return a name as there is room for it: its beginning and its end.

    >>> _short("An algorithm of the reader's own, number 12")
    'An algorithm of the re…own, number 12'
    """
    return name if len(name) <= MOST_LETTERS else f"{name[: MOST_LETTERS - 15]}…{name[-14:]}"


def _title(figure: Figure, what: str, cases: Sequence[Case]) -> None:
    """Put a title over all panels: what is drawn, of which budget and scoring, in as many lines as that takes."""
    letters = int(11 * figure.get_figwidth())
    setting = f"{cases[0].budget}, error {SCORINGS[cases[0].scoring]}"
    whole = f"{what}; {setting}"
    text = whole if len(whole) <= letters else "\n".join(textwrap.fill(part, letters) for part in (what, setting))
    figure.suptitle(text, fontsize=11)


def _legend_inches(lines: int) -> float:
    """Return how high a figure must be to have a legend of so many lines beside its one panel, below the title."""
    return 0.19 * lines + 1.0


def _legend_below(figure: Figure, lines: dict[str, Any]) -> None:
    """Name the methods below all panels, in as many columns as there is room for, and make room for the lines."""
    names = [_short(method) for method in lines]
    width = 0.075 * max(map(len, names), default=1) + 0.7  # inches that the longest name takes
    columns = max(1, int(figure.get_figwidth() / width))
    figure.set_figheight(figure.get_figheight() + 0.2 * -(-len(lines) // columns))
    figure.legend(list(lines.values()), names, frameon=False, loc="outside lower center", ncols=columns, fontsize=8.5)


def _grid(n: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    columns = min(3, n)
    rows = -(-n // columns)
    size = (max(7.0, width * columns), height * rows + 0.6)  # a title and names have to find room over one panel too
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for panel in panels[n:]:
        panel.axis("off")
    return figure, panels
