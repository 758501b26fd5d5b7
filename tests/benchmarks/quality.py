"""How every method's error compares with adaptive thinning's at equal numbers of triangles, all computed in one run.

``python tests/benchmarks/quality.py`` does all of it, in some two hours; ``--models jacksboro:11 face:1000`` or
``--classes small`` some, ``--budgets 2 5`` with less time for the search, ``-o FILE.csv -o FILE.md`` writes files too.
Tools that are not part of the package are compared where they are installed: ``pip install '.[baselines,meshlab]'``,
``pip install --pre meshoptimizer``.

* The sizes compared are the numbers of triangles of thinning at the given shares of the vertices.
* A front's value at a size is the least error among its meshes of at most so many triangles.
* A tool that makes one mesh gets the parameter that gives its largest mesh of at most so many triangles (its smallest
  one, where all are larger); its error is compared with thinning's at the number of triangles it really has. Meshes
  that are too large are left out of the means.
* Every mesh is scored by the package's own error: nearest point outside, footprint of the model. Beside the error at
  the vertices stand the surface error, which is measured between them and set beside thinning's likewise, and the
  least angles: they show who fits the vertices, and who pays with thin triangles.
* ``--refit`` adds to each front the same meshes with their best heights.
* The search gets its time for the whole front, thinning and all else included; only compilation is done before.

``--ablation`` compares variants of the memetic search instead, at equal time, and ``--enumerable`` looks for the true
front of 100 models so small that it is known.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import fnmatch
import importlib.metadata
import os
import platform
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.core.sampling import Sampling
from pymoo.optimize import minimize
from rich.console import Console
from rich.table import Table

from meshsimp_pymoo import (
    Front,
    HalfPlaneCrossover,
    MeshProblem,
    NeighbourShift,
    NestedSubsets,
    PackedDuplicates,
    PinnedCorners,
    RegionCrossover,
    Relocation,
    SizeStep,
    memetic,
    moead,
    nsga2_v1,
    nsga2_v2,
    thinning,
)
from meshsimp_pymoo.comparison.baselines import BASELINES, largest_at_most
from meshsimp_pymoo.errors import ModelError, ToolUnavailable
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.search.local_search import MoveShares
from meshsimp_pymoo.search.memetic import DownTheLadder, SizeLadder
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import Quality

BUILT_IN = ("jacksboro:11", "face:1000", "jacksboro:4", "topobathy", "jacksboro")
SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
SHARES = (2.0, 5.0, 10.0, 20.0)  # percent of the vertices

# Name, models of at most so many vertices, seconds of the search.
CLASSES = (
    ("small", 3_200, (10.0, 30.0, 60.0)),
    ("medium", 37_000, (30.0, 60.0, 180.0)),
    ("large", sys.maxsize, (10.0, 120.0, 600.0)),
)


class RandomOfAllSizes(Sampling):
    """Random subsets with sizes spread over the logarithm as those of the seeds are."""

    def _do(self, problem, n_samples, *args, random_state, **kwargs):
        free = np.flatnonzero(~problem.pinned)
        X = np.tile(problem.pinned, (n_samples, 1))
        for kept, size in zip(X, np.geomspace(1, len(free), n_samples).astype(int), strict=True):
            kept[random_state.choice(free, size, replace=False)] = True
        return X


def ladder_search(pop_size=100, sampling=None, **options):
    """Return the memetic search with another way of making children."""
    ladder = SizeLadder()
    mating = DownTheLadder(ladder, eliminate_duplicates=PackedDuplicates(), **options)
    return memetic(pop_size, survival=ladder, mating=mating, sampling=sampling or NestedSubsets())


def evolution(algorithm, *, sampling=None, crossover=None, mutation=None, **options):
    """Return another algorithm with the operators that know the problem: seeds, half-planes, relocation."""
    return algorithm(
        pop_size=100,
        sampling=sampling or NestedSubsets(),
        crossover=crossover or HalfPlaneCrossover(),
        mutation=mutation or Relocation(),
        repair=PinnedCorners(),
        eliminate_duplicates=PackedDuplicates(),
        **options,
    )


def decomposition():
    """Return MOEA/D with the same operators; it makes one child at a time."""
    return moead(
        normalised=True,
        pop_size=100,
        sampling=NestedSubsets(),
        crossover=HalfPlaneCrossover(n_offsprings=1),
        mutation=Relocation(),
    )


# Variants of the search to compare by --ablation; each is a function that makes the algorithm. The first line is what
# memetic() is, those with "no" are without one of its parts; the others are other algorithms, and they likewise.
VARIANTS = {
    "memetic": ladder_search,
    "no seeds": lambda: ladder_search(sampling=RandomOfAllSizes()),
    "no inheritance": lambda: ladder_search(inherit=False),
    "no annealing": lambda: ladder_search(heat=0.0),
    "no near moves": lambda: ladder_search(shares=MoveShares(near=0.0)),
    "no far moves": lambda: ladder_search(shares=MoveShares(near=1.0)),
    "no filling": lambda: ladder_search(shares=MoveShares(fill=0.0)),
    "no border moves": lambda: ladder_search(shares=MoveShares(border=0.0)),
    "no dropping": lambda: ladder_search(shares=MoveShares(drop=0.0)),
    "50 rungs": lambda: ladder_search(50),
    "200 rungs": lambda: ladder_search(200),
    "NSGA-II": lambda: evolution(NSGA2),
    "NSGA-II, no seeds": lambda: evolution(NSGA2, sampling=RandomOfAllSizes()),
    "NSGA-II, no crossover": lambda: evolution(NSGA2, crossover=HalfPlaneCrossover(prob=0.0)),
    "NSGA-II, regions": lambda: evolution(NSGA2, crossover=RegionCrossover()),
    "NSGA-II, no relocation": lambda: evolution(NSGA2, mutation=NeighbourShift()),
    "NSGA-II, size steps": lambda: evolution(NSGA2, mutation=SizeStep()),
    "SMS-EMOA": lambda: evolution(SMSEMOA),
    "MOEA/D": decomposition,
}
REGIONS = 256
ABLATION_MODELS = ("jacksboro:11", "face:1000", "jacksboro:4")
ABLATION_SECONDS = 10.0
ABLATION_SEEDS = (1, 2, 3)

# Models that --enumerable looks at.
ENUMERABLE = 100

CONSOLE = Console(width=140 if not sys.stdout.isatty() else None)


# ------------------------------------------------------------------------------------------------- what is compared


@dataclass(frozen=True)
class Score:
    """One mesh beside thinning; also a row of the CSV file."""

    model: str
    vertices: int
    size_class: str
    method: str
    seed: int | None  # of a method that draws random numbers
    seconds: float  # that the method took for the mesh, or for the front that it is from
    share: float  # percent
    wanted: int  # triangles of thinning at that share
    triangles: int
    error: float
    uncovered: int
    thinning: float  # its error at `wanted` triangles
    thinning_at_count: float  # its error at `triangles`
    is_front: bool
    surface_error: float
    surface_thinning: float  # thinning's, likewise
    surface_thinning_at_count: float
    min_angle_median: float  # degrees
    below_5_degrees: float  # share of the triangles

    @property
    def fits(self) -> bool:
        """Whether it has no more triangles than wanted."""
        return self.triangles <= self.wanted

    @property
    def ratio(self) -> float:
        """Error relative to thinning's at the size compared: a front's at the size wanted, a tool's at its own."""
        return _ratio(self.error, self.thinning if self.is_front else self.thinning_at_count)

    @property
    def ratio_at_count(self) -> float:
        """Error relative to thinning's at the number of triangles the mesh really has."""
        return _ratio(self.error, self.thinning_at_count)

    @property
    def surface_ratio(self) -> float:
        """Surface error relative to thinning's, at the same size as the error."""
        return _ratio(self.surface_error, self.surface_thinning if self.is_front else self.surface_thinning_at_count)


def _ratio(error, reference):
    if reference > 0:
        return error / reference
    return 1.0 if error == 0 else np.inf


@dataclass
class Curve:
    """A front: errors and triangles of many meshes, which vertices each keeps, and the seconds it took."""

    problem: MeshProblem
    error: np.ndarray
    triangles: np.ndarray
    kept: Callable[[int], np.ndarray]
    seconds: float
    note: str = ""

    def best(self, size: int) -> int | None:
        """Return the mesh of least error among those of at most ``size`` triangles."""
        rows = np.flatnonzero((self.triangles <= size) & (self.triangles > 0))
        return int(rows[np.lexsort((self.triangles[rows], self.error[rows]))[0]]) if len(rows) else None

    def value(self, size: int) -> float:
        """Return its error."""
        row = self.best(size)
        return np.inf if row is None else float(self.error[row])

    def scored(self, row: int) -> Quality:
        """Return the quality of one mesh, computed anew; it must be what the front says."""
        quality = self.problem.quality(self.kept(row))
        if quality.triangles != self.triangles[row] or not np.isclose(quality.error, self.error[row], rtol=1e-6):
            raise RuntimeError(
                f"a front says {self.error[row]} at {self.triangles[row]} triangles, but its mesh has {quality}"
            )
        return quality

    def surface_value(self, size: int) -> float:
        """Return the surface error of the mesh of least error."""
        row = self.best(size)
        return np.inf if row is None else self.scored(row).surface_error

    def refitted(self, row: int) -> tuple[Quality, float]:
        """Return the quality of one mesh with its best heights, and the seconds these took."""
        (solution,) = Front.from_subsets(self.problem, self.kept(row)[None])
        start = time.perf_counter()
        found = solution.refit()
        seconds = time.perf_counter() - start
        faces = np.searchsorted(found.rows, found.faces)
        return self.problem.surface.score(found.vertices, faces).quality, seconds


@dataclass
class Comparison:
    """All that was computed for one model."""

    model: object
    size_class: str
    budgets: tuple[float, ...]
    reference: Curve
    sizes: dict[float, int]  # triangles by share
    scores: list[Score] = field(default_factory=list)
    curves: dict[tuple[str, int | None], Curve] = field(default_factory=dict)  # by method and seed
    absent: dict[str, str] = field(default_factory=dict)  # method -> why

    def add(self, method, seed, seconds, share, quality, is_front):
        """Set one mesh beside thinning."""
        wanted = self.sizes[share]
        self.scores.append(
            Score(
                self.model.name,
                self.model.n_vertices,
                self.size_class,
                method,
                seed,
                seconds,
                share,
                wanted,
                quality.triangles,
                quality.error,
                quality.uncovered,
                self.reference.value(wanted),
                self.reference.value(quality.triangles),
                is_front,
                quality.surface_error,
                self.reference.surface_value(wanted),
                self.reference.surface_value(quality.triangles),
                quality.min_angle_median,
                quality.below_5_degrees,
            )
        )


def nested_curve(model, build):
    """Time a pass of a greedy method."""
    start = time.perf_counter()
    nested = build(HeightSurface(model))
    seconds = time.perf_counter() - start
    return Curve(MeshProblem(model, memo=0), nested.error, nested.triangles, nested.kept, seconds)


def search_curve(model, algorithm, termination, seed, regions=0):
    """Time a search, on a problem that knows nothing from earlier ones."""
    problem = MeshProblem(model, regions=regions)
    start = time.perf_counter()
    result = minimize(problem, algorithm, termination, seed=seed)
    seconds = time.perf_counter() - start
    generations = f"{result.algorithm.n_iter - 1} generations"
    return Curve(problem, result.F[:, 0], result.F[:, 1], lambda k: result.X[k], seconds, generations)


# ------------------------------------------------------------------------------------------------------ the methods

# The baselines of the package: of the variants of a tool the one that does best.
PASSES = {"worst point": "insertion_by_point", "worst triangle": "insertion_by_triangle"}
TOOLS = {
    "pydelatin": ("pydelatin",),
    "pyfqmr": ("pyfqmr_border", "pyfqmr_free"),
    "fast-simplification": ("fast_simplification_border", "fast_simplification_free"),
    "meshoptimizer": ("meshoptimizer_border", "meshoptimizer_free"),
    "MeshLab, border kept": ("quadric_collapse_boundary",),
}
# The founding paper's, each with its 50 generations; what it compares of them with, only where it is asked for.
PAPERS = {"NSGA-II v1": nsga2_v1, "NSGA-II v2": nsga2_v2, "MOEA/D": moead}
SEARCHES = (*PAPERS, "memetic")
USUAL_METHODS = (*TOOLS, *PASSES, "NSGA-II v1", "memetic")
METHODS = (*TOOLS, *PASSES, *SEARCHES)


def memetic_name(seconds):
    """Return the name of the search with this budget."""
    return f"memetic {seconds:g} s"


def size_class(n_vertices):
    """Return the name of a class and its budgets."""
    return next((name, budgets) for name, most, budgets in CLASSES if n_vertices <= most)


def reference_of(model, shares):
    """Return thinning's curve, and its triangles at each share of the vertices."""
    start = time.perf_counter()
    nested = thinning(HeightSurface(model))
    seconds = time.perf_counter() - start
    curve = Curve(MeshProblem(model, memo=0), nested.error, nested.triangles, nested.kept, seconds)
    sizes = {}
    for share in shares:
        k = round(share / 100 * model.n_vertices) - len(nested.base)
        sizes[share] = int(nested.triangles[np.clip(k, 0, len(nested) - 1)])
    return curve, sizes


def add_tool(comparison, method):
    """Score a tool's mesh at every size: of its variants the one that does best beside thinning."""
    model = comparison.model
    surface = HeightSurface(model)
    variants = [BASELINES[name].tool(model) for name in TOOLS[method]]
    for share, size in comparison.sizes.items():
        found = []
        for simplify in variants:
            (vertices, faces), seconds = largest_at_most(simplify, size, len(model.faces))
            quality = surface.score(vertices, faces).quality
            ratio = _ratio(quality.error, comparison.reference.value(quality.triangles))
            found.append((quality.triangles > size, ratio, seconds, quality))
        _, _, seconds, quality = min(found, key=lambda row: row[:2])
        comparison.add(method, None, seconds, share, quality, False)


def add_curve(comparison, method, seed, curve, refit=False):
    """Score a front at every size, with its best heights too where these are wanted."""
    comparison.curves[method, seed] = curve
    for share, size in comparison.sizes.items():
        row = curve.best(size)
        if row is not None:
            comparison.add(method, seed, curve.seconds, share, curve.scored(row), True)
            if refit:
                quality, seconds = curve.refitted(row)
                comparison.add(f"{method}, refitted", seed, curve.seconds + seconds, share, quality, True)


def compare(model, methods, shares, budgets, seeds, say, refit=False):
    """Run every method on one model."""
    name, usual = size_class(model.n_vertices)
    budgets = tuple(budgets or usual)
    say(f"{model.name}: thinning")
    comparison = Comparison(model, name, budgets, *reference_of(model, shares))
    add_curve(comparison, "thinning", None, comparison.reference, refit)
    for method in methods:
        say(f"{model.name}: {method}")
        try:
            if method in TOOLS:
                add_tool(comparison, method)
            elif method in PASSES:
                add_curve(comparison, method, None, nested_curve(model, BASELINES[PASSES[method]].front), refit)
            elif method in PAPERS:
                for seed in seeds:
                    add_curve(
                        comparison, method, seed, search_curve(model, PAPERS[method](), ("n_gen", 50), seed), refit
                    )
            else:
                for seconds in budgets:
                    for seed in seeds:
                        say(f"{model.name}: {memetic_name(seconds)}, seed {seed}")
                        curve = search_curve(model, memetic(), ("time", seconds), seed)
                        add_curve(comparison, memetic_name(seconds), seed, curve, refit)
        except (ToolUnavailable, ValueError) as reason:  # the latter where a tool leaves no triangle
            comparison.absent[method] = str(reason)
    return comparison


def warm_up(methods):
    """Compile what the methods need, on a small scan and a small grid."""
    for name in ("face:60", "peaks:7"):
        compare(open_model(name), [m for m in methods if m not in SEARCHES], (20.0,), None, (1,), lambda text: None)
        problem = MeshProblem(name)
        for preset in (nsga2_v1, memetic):
            minimize(problem, preset(pop_size=10), ("n_gen", 2), seed=1)


# ------------------------------------------------------------------------------------------------------- the tables


def geometric_mean(ratios):
    """Return the geometric mean; NaN of nothing."""
    ratios = np.asarray(list(ratios), float)
    with np.errstate(divide="ignore"):
        return float(np.exp(np.log(ratios).mean())) if len(ratios) else np.nan


def figure(value, digits=3):
    """Return a number as text; empty for NaN."""
    return "" if np.isnan(value) else f"{value:.{digits}f}"


@dataclass
class Sheet:
    """A table with a title, for the terminal and for Markdown."""

    title: str
    columns: list[str]
    rows: list[list[str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def show(self):
        """Print it."""
        table = Table(title=self.title, title_justify="left", caption_justify="left")
        for k, column in enumerate(self.columns):
            table.add_column(column, justify="left" if k == 0 else "right")
        for row in self.rows:
            table.add_row(*row)
        CONSOLE.print(table)
        for note in self.notes:
            CONSOLE.print(f"  {note}", highlight=False)
        CONSOLE.print()

    def markdown(self):
        """Return it as Markdown."""
        lines = [f"### {self.title}", "", "| " + " | ".join(self.columns) + " |"]
        lines.append("|" + "|".join(["---"] + ["---:"] * (len(self.columns) - 1)) + "|")
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        lines += ["", *(f"* {note}" for note in self.notes)]
        return "\n".join(lines) + "\n"


def model_sheets(comparison):
    """Return the tables of one model: error, surface error, angles."""
    model = comparison.model
    sizes = [f"{share:g} %: {size} triangles" for share, size in comparison.sizes.items()]
    sheet = Sheet(f"{model.name}: N = {model.n_vertices}, error relative to thinning's", ["method", "seconds", *sizes])
    surface = Sheet(f"{model.name}: surface error relative to thinning's", ["method", *sizes])
    angles = Sheet(
        f"{model.name}: median of the least angles in degrees, and the share of triangles below 5 degrees",
        ["method", *sizes],
    )
    by_method = defaultdict(list)
    for score in comparison.scores:
        by_method[score.method].append(score)
    angles.rows.append(["thinning", *_cells(by_method["thinning"], comparison.sizes, _angles)])
    at = {score.share: score for score in by_method.pop("thinning")}
    errors = [f"{at[share].error:.6g}{_bare(at[share].uncovered)}" for share in comparison.sizes]
    sheet.rows.append(["thinning, its error", f"{comparison.reference.seconds:.2f}", *errors])
    surface.rows.append(["thinning, its surface error", *(f"{at[s].surface_error:.6g}" for s in comparison.sizes)])
    for method, scores in by_method.items():
        seconds = figure(np.mean([s.seconds for s in scores]), 2)
        sheet.rows.append([method, seconds, *_cells(scores, comparison.sizes, _cell)])
        surface.rows.append([method, *_cells(scores, comparison.sizes, _surface)])
        angles.rows.append([method, *_cells(scores, comparison.sizes, _angles)])
    sheet.notes += [f"no {method}: {reason}" for method, reason in comparison.absent.items()]
    searched = [f"{method}: {curve.note}" for (method, _), curve in comparison.curves.items() if curve.note]
    if searched:
        sheet.notes.append("; ".join(searched))
    return [sheet, surface, angles]


def _cells(scores, sizes, cell):
    """Return a method's cells at all sizes."""
    found = [[score for score in scores if score.share == share] for share in sizes]
    return [cell(some) if some else "too large" for some in found]


def _surface(scores):
    """Return the ratio between the vertices."""
    return figure(geometric_mean(s.surface_ratio for s in scores))


def _angles(scores):
    """Return the least angles: the median, and how many are small."""
    degrees, share = (np.mean([getattr(s, name) for s in scores]) for name in ("min_angle_median", "below_5_degrees"))
    return f"{degrees:.1f}, {100 * share:.1f} %"


def _cell(scores):
    """Return the ratio, the triangles where they are not those of the heading, and the uncovered vertices."""
    text = figure(geometric_mean(s.ratio for s in scores))
    if not scores[0].is_front and scores[0].triangles != scores[0].wanted:
        text += f" {'at' if scores[0].fits else 'only at'} {scores[0].triangles}"
    return text + _bare(max(s.uncovered for s in scores))


def _bare(uncovered):
    return f", {uncovered} bare" if uncovered else ""


NOTES = (
    "'at 123': compared at 123 triangles, the count that the tool's mesh really has; 'only at': its smallest mesh",
    "'too large': all meshes of the front have more triangles",
    "'45 bare': its triangles cover 45 vertices of the model not at all; they cost the distance to its nearest point",
)


def summaries(comparisons):
    """Return for every class of sizes: geometric means by method, and the search beside each rival."""
    sheets = []
    for name, _, _ in CLASSES:
        group = [c for c in comparisons if c.size_class == name]
        if group:
            sheets += [means_sheet(name, group, what, of) for what, of in MEANS.items()]
            if any(budgeted(c) for c in group):
                sheets += [duels_sheet(name, group)]
    return sheets


# What means are taken of.
MEANS = {"error": "ratio", "surface error": "surface_ratio"}


def means_sheet(name, group, what, of):
    """Return the geometric means of a class."""
    shares = list(group[0].sizes)
    names = ", ".join(c.model.name for c in group)
    sheet = Sheet(
        f"Geometric means of {what} / thinning's: {name} models ({names})",
        ["method", "meshes", *(f"{share:g} %" for share in shares), "all", "worst"],
    )
    with_count = of == "ratio"
    sheet.columns += ["worst at own count"] * with_count
    by_method = defaultdict(list)
    for comparison in group:
        for score in comparison.scores:
            if score.method != "thinning" and score.fits:
                by_method[score.method].append(score)
    for method, scores in by_method.items():
        ratios = [(s.share, getattr(s, of)) for s in scores]
        by_share = [figure(geometric_mean(ratio for at, ratio in ratios if at == share)) for share in shares]
        total = [geometric_mean(ratio for _, ratio in ratios), max(ratio for _, ratio in ratios)]
        total += [max(s.ratio_at_count for s in scores)] * with_count
        sheet.rows.append([method, f"{len(scores)}", *by_share, *map(figure, total)])
    if with_count:
        sheet.notes.append(
            "'worst at own count': beside thinning at the triangles that the mesh has, fewer where a front has a gap "
            "there"
        )
    return sheet


def budgeted(comparison):
    """Return the memetic methods of a comparison that gave a front."""
    return [m for m in map(memetic_name, comparison.budgets) if any(method == m for method, _ in comparison.curves)]


def duels(comparison, method, rival):
    """Return error of the search / error of the rival at the rival's number of triangles, each mesh of it once."""
    curves = [curve for (name, _), curve in comparison.curves.items() if name == method]
    ratios = {}
    for score in comparison.scores:
        if score.method == rival:
            size = score.wanted if score.is_front else score.triangles
            for k, curve in enumerate(curves):
                value = curve.value(size)
                if np.isfinite(value):
                    ratios[k, score.seed, size] = _ratio(value, score.error)
    return list(ratios.values())


def duels_sheet(name, group):
    """Return the search beside each rival."""
    methods = list(dict.fromkeys(m for c in group for m in budgeted(c)))
    columns = [f"{method}: {what}" for method in methods for what in ("mean", "worst")]
    title = f"Search / rival, at the rival's triangles: {name} models"
    sheet = Sheet(title, ["rival", "meshes", *columns])
    rivals = dict.fromkeys(s.method for c in group for s in c.scores if not s.method.startswith("memetic"))
    for rival in rivals:
        found = [[r for c in group for r in duels(c, method, rival)] for method in methods]
        if any(found):
            cells = [figure(f(r)) if r else "" for r in found for f in (geometric_mean, max)]
            sheet.rows.append([rival, f"{max(map(len, found))}", *cells])
    sheet.notes.append("means are geometric; a mesh counts once, also one that is too large for several sizes")
    return sheet


# ----------------------------------------------------------------------------------------------------------- output


def write_csv(path, scores):
    """Write one row a mesh."""
    names = [f.name for f in dataclasses.fields(Score)]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        ratios = ("ratio", "ratio_at_count", "surface_ratio")
        writer.writerow([*names, *ratios])
        for score in scores:
            row = [getattr(score, name) for name in (*names, *ratios)]
            writer.writerow(["" if cell is None else cell for cell in row])


def write_markdown(path, sheets, skipped):
    """Write the tables, and what made them."""
    head = ["# Error of every method relative to adaptive thinning", "", f"Made by `{' '.join(command())}`", ""]
    head += [f"on {os.cpu_count()} cores, Python {platform.python_version()}, {', '.join(versions())}.", ""]
    head += [f"* {note}" for note in NOTES] + [f"* skipped: {reason}" for reason in skipped] + [""]
    path.write_text("\n".join(head) + "\n" + "\n".join(sheet.markdown() for sheet in sheets), encoding="utf-8")


def command():
    """Return the command line as one would type it in the checkout."""
    return ["python", "tests/benchmarks/quality.py", *sys.argv[1:]]


def versions():
    """Return the packages whose versions matter, as far as they are installed."""
    found = []
    for name in ("numba", "pymoo", *sorted({baseline.package for baseline in BASELINES.values()} - {""})):
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"no {name}")
    return found


def chosen_models(options):
    """Return (names or paths, reasons for those left out)."""
    wanted = list(options.models or BUILT_IN)
    skipped = []
    folder = options.shared
    files = sorted(p for p in folder.glob("*") if p.suffix in (".ply", ".npz")) if folder.is_dir() else []
    if not options.models:
        wanted += files
        if not files:
            skipped.append(f"real meshes: {folder} has none (--shared names another folder)")
        return wanted, skipped
    chosen = []
    for name in wanted:
        matching = [p for p in files if fnmatch.fnmatch(p.stem, name)]
        chosen += matching or [name]
    return chosen, skipped


def opened(names, classes, skipped):
    """Yield the models, one at a time; note what is left out, and why."""
    for name in names:
        try:
            model = open_model(name)
        except ModelError as problem:
            skipped.append(str(problem))
            continue
        if size_class(model.n_vertices)[0] in classes:
            yield dataclasses.replace(model, name=Path(model.name).stem if Path(model.name).suffix else model.name)


def say(text):
    """Show what is going on, on a terminal's other stream."""
    sys.stderr.write(f"{time.strftime('%H:%M:%S')}  {text}\n")


def benchmark(options):
    """Print all tables; the files are written anew after every model, so that an interrupted run leaves some."""
    names, skipped = chosen_models(options)
    say("compiling")
    warm_up(options.methods)
    comparisons, sheets = [], []
    for model in opened(names, options.classes, skipped):
        seeds, how = options.seeds or (1,), {"refit": options.refit}
        comparison = compare(model, options.methods, options.shares, options.budgets, seeds, say, **how)
        comparisons.append(comparison)
        of_model = model_sheets(comparison)
        sheets += of_model
        for sheet in of_model:
            sheet.show()
        write(options.output, comparisons, sheets, skipped)
    for sheet in summaries(comparisons):
        sheet.show()
    for text in (*NOTES, *(f"skipped: {reason}" for reason in skipped)):
        CONSOLE.print(text, highlight=False)
    return comparisons


def write(paths, comparisons, sheets, skipped):
    """Write the files asked for."""
    for path in paths:
        if path.suffix == ".csv":
            write_csv(path, [score for c in comparisons for score in c.scores])
        else:
            write_markdown(path, [*sheets, *summaries(comparisons)], skipped)


def ablation(options):
    """Print the geometric mean over models, sizes and seeds of each variant of the search, at equal time."""
    variants = options.ablation or list(VARIANTS)
    unknown = sorted(set(variants) - set(VARIANTS))
    if unknown:
        sys.exit(f"no variant {unknown[0]!r}; there are {', '.join(VARIANTS)}")
    if not options.models:
        options.models = ABLATION_MODELS
    names, skipped = chosen_models(options)
    seconds = options.budgets[0] if options.budgets else ABLATION_SECONDS
    seeds = options.seeds or ABLATION_SEEDS
    say("compiling")
    warm_up([])
    for variant in variants:
        minimize(MeshProblem("face:60", regions=REGIONS), VARIANTS[variant](), ("time", 0.5), seed=1)
    ratios = defaultdict(dict)  # variant -> (model, seed, share) -> ratio
    notes = defaultdict(list)
    models = []
    for model in opened(names, options.classes, skipped):
        models.append(model.name)
        reference, sizes = reference_of(model, options.shares)
        for seed in seeds:
            # Variants in turn, so that what else the machine does meets all of them.
            for variant in variants:
                say(f"{model.name}: {variant}, seed {seed}")
                curve = search_curve(model, VARIANTS[variant](), ("time", seconds), seed, REGIONS)
                notes[variant].append(int(curve.note.split()[0]))
                for share, size in sizes.items():
                    ratios[variant][model.name, seed, share] = _ratio(curve.value(size), reference.value(size))
    first = variants[0]
    sheet = Sheet(
        f"Variants of the search after {seconds:g} s: geometric mean of error / thinning's",
        ["variant", *models, "all", f"all / {first}", *(f"seed {seed}" for seed in seeds), "worst", "generations"],
    )
    for variant in variants:
        found = ratios[variant]
        by_model = [geometric_mean(r for (of, _, _), r in found.items() if of == name) for name in models]
        by_seed = [geometric_mean(r for (_, s, _), r in found.items() if s == seed) for seed in seeds]
        beside = geometric_mean(r / ratios[first][key] for key, r in found.items())
        row = [*by_model, geometric_mean(found.values()), beside, *by_seed, max(found.values())]
        sheet.rows.append([variant, *map(figure, row), f"{np.median(notes[variant]):.0f}"])
    shares = ", ".join(f"{share:g}" for share in options.shares)
    sheet.notes.append(f"at {shares} % of the vertices; generations: median of the runs")
    sheet.notes += [f"skipped: {reason}" for reason in skipped]
    sheet.show()
    for path in options.output:
        if path.suffix == ".csv":
            rows = [[v, *key, ratio] for v, found in ratios.items() for key, ratio in found.items()]
            with path.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([["variant", "model", "seed", "share", "ratio"], *rows])
        else:
            write_markdown(path, [sheet], skipped)


def enumerable(n_models):
    """Print on how many small models the search finds the whole true front; return whether on all."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from enumerable_models import GENERATIONS, random_problem, same_front, true_front

    warm_up([])
    missed, times = [], []
    for seed in range(n_models):
        problem = random_problem(seed)
        known = true_front(problem)
        fresh = MeshProblem(problem.model)
        start = time.perf_counter()
        result = minimize(fresh, memetic(), ("n_gen", GENERATIONS), seed=seed)
        times.append(time.perf_counter() - start)
        if not same_front(result.F, known):
            missed.append(f"model {seed} ({problem.n_var} vertices)")
    CONSOLE.print(
        f"The whole true front on {n_models - len(missed)} of {n_models} models, {GENERATIONS} generations each, "
        f"median {np.median(times):.2f} s, longest {max(times):.2f} s, all {sum(times):.0f} s",
        highlight=False,
    )
    if missed:
        CONSOLE.print(f"missed on {', '.join(missed)}", highlight=False)
    return not missed


def main(argv=None) -> int:
    """Do what the options say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    text = "built-in names, files, or patterns of names in the shared folder, such as 'm*'; default: all"
    parser.add_argument("--models", nargs="+", metavar="MODEL", help=text)
    names = [name for name, _, _ in CLASSES]
    parser.add_argument("--classes", nargs="+", choices=names, default=names, help="only models of these sizes")
    text = "folder with further models; default: ../shared/data beside the checkout"
    parser.add_argument("--shared", type=Path, default=SHARED, metavar="DIR", help=text)
    text = "percent of the vertices at which thinning's triangles are taken; default: 2 5 10 20"
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES, metavar="P", help=text)
    usual = "; ".join(f"{name} models {' '.join(f'{b:g}' for b in budgets)}" for name, _, budgets in CLASSES)
    text = f"seconds of the search; default: {usual}"
    parser.add_argument("--budgets", nargs="+", type=float, metavar="S", help=text)
    others = "; ".join(method for method in METHODS if method not in USUAL_METHODS)
    text = f"methods beside thinning; default: {'; '.join(USUAL_METHODS)}; there are also {others}"
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=USUAL_METHODS, metavar="METHOD", help=text)
    parser.add_argument("--refit", action="store_true", help="each front's meshes with their best heights, too")
    text = "seeds of the searches; default: 1, of an ablation 1 2 3"
    parser.add_argument("--seeds", "--seed", nargs="+", type=int, metavar="K", help=text)
    text = "write all results (.csv) or the tables (.md) too; may be given twice"
    parser.add_argument("-o", "--output", action="append", type=Path, default=[], metavar="FILE", help=text)
    text = f"variants of the search, {ABLATION_SECONDS:g} s each (--budgets S: S): {', '.join(VARIANTS)}; default: all"
    parser.add_argument("--ablation", nargs="*", metavar="VARIANT", help=text)
    text = f"true fronts of this many small models; default: {ENUMERABLE}"
    parser.add_argument("--enumerable", nargs="?", type=int, const=ENUMERABLE, metavar="COUNT", help=text)
    options = parser.parse_args(argv)
    wrong = [path for path in options.output if path.suffix not in (".csv", ".md")]
    if wrong:
        parser.error(f"cannot write {wrong[0]}; the results are written as .csv, the tables as .md")
    if not all(0 < share <= 100 for share in options.shares):
        parser.error("--shares are percent, above 0 and up to 100")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if options.enumerable is not None:
            return 0 if enumerable(options.enumerable) else 1
        if options.ablation is not None:
            ablation(options)
        else:
            benchmark(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
