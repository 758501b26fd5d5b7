"""How every method's error compares with adaptive thinning's at equal numbers of triangles, all computed in one run.

``python tests/benchmarks/quality.py`` does all of it, in some four hours; ``--models jacksboro:11 face:1000`` or
``--classes small`` some, ``--budgets 2 5`` with less time for the search, ``-o FILE.csv -o FILE.md`` writes files too;
with ``--append`` what the .csv has of other runs stays and is summed up with what is new.
Tools that are not part of the package are compared where they are installed: ``pip install '.[baselines,meshlab]'``,
``pip install --pre meshoptimizer``.

* The sizes compared are the numbers of triangles of thinning at the given shares of the vertices.
* A front's value at a size is the least error among its meshes of at most so many triangles.
* A tool that makes one mesh gets the parameter that gives its largest mesh of at most so many triangles (its smallest
  one, where all are larger); its error is compared with thinning's at the number of triangles it really has. Meshes
  that are too large are left out of the means.
* Every mesh is scored by the package's own error: nearest point outside, footprint of the model. Beside the error at
  the vertices stand the surface error, which is measured between them, and the largest deviation, both set beside
  thinning's likewise, and the least angles: they show who fits the vertices, and who pays with thin triangles.
* ``memetic free`` searches the edges too; its meshes are compared with the Delaunay search's of equal time at the end.
* ``--refit`` adds to each front the same meshes with their best heights.
* The search gets its time for the whole front, thinning and all else included; only compilation is done before.

``--ablation`` compares variants of the memetic search instead, at equal time (``--ablation free``: of the free one),
``--best`` compares with the best values known (``quality/best.csv``), and ``--enumerable`` looks for the true front of
100 models so small that it is known. ``--referee FILE`` lets another program measure the meshes of all searches (see
`stored_fronts`).
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import fnmatch
import functools
import importlib.metadata
import os
import platform
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.core.sampling import Sampling
from pymoo.optimize import minimize
from rich.console import Console
from rich.table import Table

import meshsimp_pymoo.search.free as free_ladder
import meshsimp_pymoo.search.memetic as memetic_search
import meshsimp_pymoo.surface.free as free_meshes
from meshsimp_pymoo import (
    Front,
    HalfPlaneCrossover,
    MeshProblem,
    Moves,
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
from meshsimp_pymoo.surface.free import USUAL_SHARES, FreeShares, FreeTriangulation
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import Quality
from meshsimp_pymoo.surface.surface import Simplified

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


def free_search(**options):
    """Return the search of free meshes."""
    return memetic(triangulation="free", **options)


# The same of the free search; what has no option of its own is changed while a variant runs.
FREE_VARIANTS = {
    "memetic free": free_search,
    "free, no flips": free_search,
    "free, no shifts": free_search,
    "free, no swaps": free_search,
    "free, no outline moves": free_search,
    "free, no limit": functools.partial(free_search, min_height=0.0),
    "free, no centroids": functools.partial(free_search, centroids=False),
    "free, no subsets before": free_search,
    "free, no annealing": free_search,
    "free, no filling": free_search,
}


def constant(name, value):
    """Return the change of a constant, wherever it was imported to."""
    found = [(module, name, value) for module in (free_ladder, memetic_search) if hasattr(module, name)]
    if not found:
        raise LookupError(f"the free search has no constant {name}; change CHANGES in {Path(__file__).name}")
    return found


def without_move(name):
    """Return the change that leaves out one kind of moves; the others share its part."""
    shares = {**USUAL_SHARES._asdict(), "swap": 1.0 - sum(USUAL_SHARES), name: 0.0}
    left = FreeShares(*(shares[kind] / sum(shares.values()) for kind in FreeShares._fields))
    return [(FreeTriangulation, "anneal", functools.partialmethod(FreeTriangulation.anneal, shares=left))]


def within_outline(freedom, books, pinned):
    """Return a free mesh whose outline stays."""
    return FreeTriangulation(freedom._replace(moves_outline=False), books, pinned)


# What is changed while a variant runs: where, what, to what.
CHANGES = {
    "free, no flips": without_move("flip"),
    "free, no shifts": without_move("shift"),
    "free, no swaps": without_move("swap"),
    "free, no outline moves": [(free_meshes, "FreeTriangulation", within_outline)],
    "free, no subsets before": constant("SUBSETS_SHARE", 0.0),
    "free, no annealing": constant("HOT", 0.0) + constant("HOT_LARGE", 0.0),
    "free, no filling": constant("steps_between", lambda low, high: np.empty(0, np.int64)),
}


@contextmanager
def changed(variant):
    """Let the search be a variant until the context ends."""
    with ExitStack() as stack:
        for owner, name, value in CHANGES.get(variant, ()):
            stack.enter_context(mock.patch.object(owner, name, value))
        yield


REGIONS = 256
ABLATION_MODELS = ("jacksboro:11", "face:1000", "jacksboro:4")
ABLATION_SECONDS = 10.0
ABLATION_SEEDS = (1, 2, 3)

# The best values known, and the runs that are compared with them.
BEST = Path(__file__).parent / "quality" / "best.csv"
BEST_BUDGETS = (10.0, 60.0)
BEST_METHODS = ("memetic", "memetic free, plain")

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
    max_error: float
    max_thinning: float
    max_thinning_at_count: float
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

    @property
    def max_ratio(self) -> float:
        """Largest deviation relative to thinning's, at the same size as the error."""
        return _ratio(self.max_error, self.max_thinning if self.is_front else self.max_thinning_at_count)


def _ratio(error, reference):
    if reference > 0:
        return error / reference
    return 1.0 if error == 0 else np.inf


@dataclass
class Curve:
    """A front: errors and triangles of many meshes, the mesh of each, and the seconds it took."""

    problem: MeshProblem | None
    error: np.ndarray
    triangles: np.ndarray
    mesh: Callable[[int], Simplified] | None
    seconds: float
    note: str = ""
    front: Front | None = None  # of a search
    known: dict[int, Quality] = field(default_factory=dict)  # what was measured so far

    def best(self, size: int) -> int | None:
        """Return the mesh of least error among those of at most ``size`` triangles."""
        rows = np.flatnonzero((self.triangles <= size) & (self.triangles > 0))
        return int(rows[np.lexsort((self.triangles[rows], self.error[rows]))[0]]) if len(rows) else None

    def value(self, size: int, measure: str = "error") -> float:
        """Return its error, or another of its numbers."""
        row = self.best(size)
        if row is None:
            return np.inf
        return float(self.error[row]) if measure == "error" else getattr(self.scored(row), measure)

    def scored(self, row: int) -> Quality:
        """Return the quality of one mesh, computed anew; it must be what the front says."""
        if row not in self.known:
            self.known[row] = self.mesh(row).quality
        quality = self.known[row]
        if quality.triangles != self.triangles[row] or not np.isclose(quality.error, self.error[row], rtol=1e-6):
            raise RuntimeError(
                f"a front says {self.error[row]} at {self.triangles[row]} triangles, but its mesh has {quality}"
            )
        return quality

    def forget(self) -> None:
        """Keep only its numbers: the subsets of large models take gigabytes."""
        self.problem = self.mesh = self.front = None

    def refitted(self, row: int) -> tuple[Quality, float]:
        """Return the quality of one mesh with its best heights, and the seconds these took."""
        mesh, surface = self.mesh(row), self.problem.surface
        start = time.perf_counter()
        found = surface.refit(mesh)
        seconds = time.perf_counter() - start
        return surface.score(found.vertices, np.searchsorted(found.rows, found.faces)).quality, seconds


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
        wanted, reference = self.sizes[share], self.reference
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
                reference.value(wanted),
                reference.value(quality.triangles),
                is_front,
                quality.surface_error,
                reference.value(wanted, "surface_error"),
                reference.value(quality.triangles, "surface_error"),
                quality.max_error,
                reference.value(wanted, "max_error"),
                reference.value(quality.triangles, "max_error"),
                quality.min_angle_median,
                quality.below_5_degrees,
            )
        )


def nested_curve(model, build):
    """Time a pass of a greedy method."""
    start = time.perf_counter()
    nested = build(HeightSurface(model))
    return curve_of_nested(model, nested, time.perf_counter() - start)


def curve_of_nested(model, nested, seconds):
    """Return the curve of a greedy method's meshes."""
    problem = MeshProblem(model, memo=0)
    return Curve(problem, nested.error, nested.triangles, lambda k: problem.simplify(nested.kept(k)), seconds)


def search_curve(model, algorithm, termination, seed, regions=0, whole=False):
    """Time a search, on a problem that knows nothing from earlier ones; its free meshes are taken where there are some.

    ``whole``: all meshes of its front are measured between the vertices, and not only those that are compared.
    """
    problem = MeshProblem(model, regions=regions)
    result = minimize(problem, algorithm, termination, seed=seed)
    seconds = result.exec_time  # without compiling what only such a model needs
    note = f"{result.algorithm.n_iter - 1} generations"
    front = Front.from_population(problem, result.opt, until=None if whole else time.perf_counter())
    ladder = getattr(result.algorithm, "free", None)
    if ladder is not None:
        note += f", {len(ladder.fronts)} of {len(ladder.sizes)} sizes annealed freely"
        note += f", {front.n_free} of {len(front)} meshes free"
    error, triangles = front.F.T
    return Curve(problem, error, triangles.astype(int), lambda k: front[k].simplified, seconds, note, front)


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
# The search with its time, of Delaunay meshes and of free ones.
FREE = {
    "memetic free": free_search,
    "memetic free, plain": functools.partial(free_search, min_height=0.0, centroids=False),
    "memetic free, limit": functools.partial(free_search, centroids=False),
}
BUDGETED = {"memetic": memetic, **FREE}
SEARCHES = (*PAPERS, *BUDGETED)
USUAL_METHODS = (*TOOLS, *PASSES, "NSGA-II v1", "memetic", "memetic free")
METHODS = (*TOOLS, *PASSES, *SEARCHES)


def budgeted_name(method, seconds):
    """Return the name of a search with this budget."""
    return f"{method} {seconds:g} s"


def delaunay_name(name):
    """Return the name of the Delaunay search of equal time, refitted if this is; None of what is no free search."""
    return next((f"memetic{name[len(free) :]}" for free in FREE if name.startswith(f"{free} ")), None)


def size_class(n_vertices):
    """Return the name of a class and its budgets."""
    return next((name, budgets) for name, most, budgets in CLASSES if n_vertices <= most)


def reference_of(model, shares):
    """Return thinning's curve, and its triangles at each share of the vertices."""
    start = time.perf_counter()
    nested = thinning(HeightSurface(model))
    curve = curve_of_nested(model, nested, time.perf_counter() - start)
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


def compare(model, methods, shares, budgets, seeds, say, refit=False, whole=False):
    """Run every method on one model; ``whole`` as in `search_curve`."""
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
            else:
                runs = [(method, PAPERS[method], ("n_gen", 50))] if method in PAPERS else []
                if method in BUDGETED:
                    runs = [(budgeted_name(method, b), BUDGETED[method], ("time", b)) for b in budgets]
                for named, make, termination in runs:
                    for seed in seeds:
                        say(f"{model.name}: {named}, seed {seed}")
                        add_curve(
                            comparison, named, seed, search_curve(model, make(), termination, seed, whole=whole), refit
                        )
        except (ToolUnavailable, ValueError) as reason:  # the latter where a tool leaves no triangle
            comparison.absent[method] = str(reason)
    return comparison


def warm_up(methods):
    """Compile what the methods need, on a small scan and a small grid."""
    for name in ("face:60", "peaks:7"):
        compare(open_model(name), [m for m in methods if m not in SEARCHES], (20.0,), None, (1,), lambda text: None)
        problem = MeshProblem(name)
        minimize(problem, nsga2_v1(pop_size=10), ("n_gen", 2), seed=1)
        for preset in (memetic, *(FREE[method] for method in methods if method in FREE)):
            minimize(problem, preset(pop_size=10), Moves(1000), seed=1)


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
    """Return the tables of one model: error, surface error, largest deviation, angles."""
    model = comparison.model
    sizes = [f"{share:g} %: {size} triangles" for share, size in comparison.sizes.items()]
    sheet = Sheet(f"{model.name}: N = {model.n_vertices}, error relative to thinning's", ["method", "seconds", *sizes])
    surface = Sheet(f"{model.name}: surface error relative to thinning's", ["method", *sizes])
    largest = Sheet(f"{model.name}: largest deviation relative to thinning's", ["method", *sizes])
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
    largest.rows.append(["thinning, its largest deviation", *(f"{at[s].max_error:.6g}" for s in comparison.sizes)])
    for method, scores in by_method.items():
        seconds = figure(np.mean([s.seconds for s in scores]), 2)
        sheet.rows.append([method, seconds, *_cells(scores, comparison.sizes, _cell)])
        surface.rows.append([method, *_cells(scores, comparison.sizes, _mean_of("surface_ratio"))])
        largest.rows.append([method, *_cells(scores, comparison.sizes, _mean_of("max_ratio"))])
        angles.rows.append([method, *_cells(scores, comparison.sizes, _angles)])
    sheet.notes += [f"no {method}: {reason}" for method, reason in comparison.absent.items()]
    searched = [f"{method}: {curve.note}" for (method, _), curve in comparison.curves.items() if curve.note]
    if searched:
        sheet.notes.append("; ".join(searched))
    return [sheet, surface, largest, angles]


def _cells(scores, sizes, cell):
    """Return a method's cells at all sizes."""
    found = [[score for score in scores if score.share == share] for share in sizes]
    return [cell(some) if some else "too large" for some in found]


def _mean_of(ratio):
    """Return what makes the cell of a ratio."""
    return lambda scores: figure(geometric_mean(getattr(s, ratio) for s in scores))


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


def summaries(scores, comparisons):
    """Return for every class of sizes: geometric means by method, free meshes beside Delaunay ones, search and rivals.

    ``scores`` may be of earlier runs, too.
    """
    sheets = []
    for name, _, _ in CLASSES:
        of_class = [s for s in scores if s.size_class == name]
        if of_class:
            sheets += [means_sheet(name, of_class, what, of) for what, of in MEANS.items()]
        if any(delaunay_name(s.method) for s in of_class):
            sheets += [free_sheet(name, of_class)]
        group = [c for c in comparisons if c.size_class == name]
        if any(budgeted(c) for c in group):
            sheets += [duels_sheet(name, group)]
    return sheets


# What means are taken of.
MEANS = {"error": "ratio", "surface error": "surface_ratio", "largest deviation": "max_ratio"}


def means_sheet(name, of_class, what, of):
    """Return the geometric means of a class."""
    shares = sorted({s.share for s in of_class})
    names = ", ".join(dict.fromkeys(s.model for s in of_class))
    sheet = Sheet(
        f"Geometric means of {what} / thinning's: {name} models ({names})",
        ["method", "meshes", *(f"{share:g} %" for share in shares), "all", "worst"],
    )
    with_count = of == "ratio"
    sheet.columns += ["worst at own count"] * with_count
    by_method = defaultdict(list)
    for score in of_class:
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


def free_sheet(name, of_class):
    """Return the free searches beside the Delaunay search of equal time, size by size, with the worst of each."""
    sheet = Sheet(
        f"Free / Delaunay meshes of equal time, at equal sizes: {name} models",
        ["method", "meshes", *(f"{what}: {how}" for what in MEANS for how in ("mean", "worst"))],
    )
    at = {(s.method, s.model, s.seed, s.share): s for s in of_class}
    for method in dict.fromkeys(s.method for s in of_class if delaunay_name(s.method)):
        own = [s for s in of_class if s.method == method]
        pairs = [(s, at.get((delaunay_name(method), s.model, s.seed, s.share))) for s in own]
        pairs = [(s, rival) for s, rival in pairs if rival is not None]
        if len(pairs) < len(own):
            sheet.notes.append(
                f"{method}: {len(own) - len(pairs)} of {len(own)} meshes have no {delaunay_name(method)} beside them"
            )
        cells = []
        for of in MEANS.values():
            ratios = [_ratio(getattr(s, of), getattr(rival, of)) for s, rival in pairs]
            if ratios:
                worst, (score, _) = max(zip(ratios, pairs, strict=True), key=lambda row: row[0])
                cells += [figure(geometric_mean(ratios)), f"{worst:.3f} {score.model} {score.share:g} %"]
        if cells:
            sheet.rows.append([method, f"{len(pairs)}", *cells])
    return sheet


def budgeted(comparison):
    """Return the memetic methods of a comparison that gave a front."""
    names = [budgeted_name(method, seconds) for method in BUDGETED for seconds in comparison.budgets]
    return [name for name in names if any(method == name for method, _ in comparison.curves)]


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
        ratios = ("ratio", "ratio_at_count", "surface_ratio", "max_ratio")
        writer.writerow([*names, *ratios])
        for score in scores:
            row = [getattr(score, name) for name in (*names, *ratios)]
            writer.writerow(["" if cell is None else cell for cell in row])


def read_csv(path):
    """Return the scores of an earlier run."""
    read = {"str": str, "int": int, "float": float, "bool": "True".__eq__}
    read["int | None"] = lambda text: int(text) if text else None
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    try:
        return [Score(**{f.name: read[f.type](row[f.name]) for f in dataclasses.fields(Score)}) for row in rows]
    except KeyError as missing:
        sys.exit(f"{path} has no column {missing}: another version wrote it; give another file")


def joined(old, new):
    """Return all scores; new ones take the place of old ones of the same mesh."""
    at = {(s.model, s.method, s.seed, s.share): s for s in (*old, *new)}
    return list(at.values())


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
    """Print all tables; return how many meshes are wrong.

    The files are written anew after every model, so that an interrupted run leaves some.
    """
    names, skipped = chosen_models(options)
    earlier = [path for path in options.output if path.suffix == ".csv" and path.is_file()] if options.append else []
    old = [score for path in earlier for score in read_csv(path)]
    check = referee_of(options)
    say("compiling")
    warm_up(options.methods)
    comparisons, sheets, scores, checked = [], [], old, []
    for model in opened(names, options.classes, skipped):
        how = {"refit": options.refit, "whole": check is not None}
        seeds = options.seeds or (1,)
        comparison = compare(model, options.methods, options.shares, options.budgets, seeds, say, **how)
        comparisons.append(comparison)
        scores = joined(scores, comparison.scores)
        of_model = model_sheets(comparison)
        sheets += of_model
        for sheet in of_model:
            sheet.show()
        if check is not None:
            for (method, seed), curve in comparison.curves.items():
                if curve.front is not None:
                    say(f"{model.name}: {method}, seed {seed}: its meshes are checked")
                    checked.append((model.name, method, seed, check(curve.front)))
        for curve in comparison.curves.values():
            curve.forget()
        last = [*summaries(scores, comparisons), *best_sheets(options, scores), *checked_sheets(checked)]
        write(options.output, scores, [*sheets, *last], skipped)
    if comparisons:
        for sheet in last:
            sheet.show()
    for text in (*NOTES, *(f"skipped: {reason}" for reason in skipped)):
        CONSOLE.print(text, highlight=False)
    if options.best == "write":
        write_best(scores)
    return sum(len(found.wrong) for *_, found in checked)


def write(paths, scores, sheets, skipped):
    """Write the files asked for."""
    for path in paths:
        if path.suffix == ".csv":
            write_csv(path, scores)
        else:
            write_markdown(path, sheets, skipped)


def beside(name):
    """Import what stands beside this file, or in the folder above."""
    here = Path(__file__).resolve().parent
    for folder in (here, here.parent):
        if str(folder) not in sys.path:
            sys.path.insert(0, str(folder))
    return importlib.import_module(name)


def referee_of(options):
    """Return the check of a front's meshes, if it is asked for."""
    if options.referee is None:
        return None
    return beside("stored_fronts").Referee(options.referee, options.referee_meshes).checked


def checked_sheets(checked):
    """Return what a referee says of the fronts of all searches."""
    if not checked:
        return []
    sheet = Sheet("Stored meshes, by a referee", ["model", "method", "seed", "meshes", "free", "not checked", "wrong"])
    for name, method, seed, found in checked:
        counts = (found.meshes, found.free, found.left_out, len(found.wrong))
        sheet.rows.append([name, method, f"{seed}", *map(str, counts)])
        sheet.notes += [f"{name}, {method}, seed {seed}: {what}" for what in found.wrong]
    sheet.notes += dict.fromkeys(note for *_, found in checked for note in found.notes)
    return [sheet]


# --------------------------------------------------------------------------------------------------- the best values


KINDS = ("delaunay", "free")


def kind_of(method):
    """Return what kind of meshes a search makes; None of what is compared with no best value."""
    if not method.startswith("memetic ") or method.endswith("refitted"):
        return None
    return "free" if delaunay_name(method) else "delaunay"


def read_best():
    """Return the best ratios to thinning's error known, {(model, triangles): {kind: ratio}}."""
    with BEST.open(newline="", encoding="utf-8") as file:
        return {
            (row["model"], int(row["triangles"])): {kind: float(row[kind]) for kind in KINDS}
            for row in csv.DictReader(file)
        }


def better_values(known, scores):
    """Return what is better than what is known by more than rounding, {((model, triangles), kind): score}."""
    found = {}
    for score in scores:
        key = (score.model, score.wanted), kind_of(score.method)
        if key[0] not in known or key[1] is None:
            continue
        least = found[key].ratio if key in found else known[key[0]][key[1]] - 5e-4
        if score.ratio < least:
            found[key] = score
    return found


def best_sheets(options, scores):
    """Return how far the searches are from the best values known, where this is asked for."""
    if options.best is None:
        return []
    known = read_best()
    of_kind = {kind: dict.fromkeys(s.method for s in scores if kind_of(s.method) == kind) for kind in KINDS}
    columns = [(kind, method) for kind in KINDS for method in ("best", *of_kind[kind])]
    sheet = Sheet(
        "Error / thinning's beside the best known",
        ["model", "triangles", *(f"best {kind}" if method == "best" else method for kind, method in columns)],
    )
    gaps = defaultdict(list)
    for (model, triangles), best in known.items():
        row = [model, f"{triangles}"]
        for kind, method in columns:
            if method == "best":
                row.append(figure(best[kind]))
                continue
            own = [s for s in scores if (s.model, s.wanted, s.method) == (model, triangles, method)]
            ratio = geometric_mean(s.ratio for s in own)
            row.append(f"{ratio:.3f} ({ratio / best[kind] - 1:+.1%})" if own else "")
            gaps[method] += [ratio / best[kind]] * bool(own)
        if any(row[2 + k] for k, (_, method) in enumerate(columns) if method != "best"):
            sheet.rows.append(row)
    means = [
        "" if method == "best" or not gaps[method] else f"{geometric_mean(gaps[method]) - 1:+.1%}"
        for _, method in columns
    ]
    sheet.rows.append(["mean gap", f"{len(sheet.rows)} sizes", *means])
    for ((model, triangles), kind), score in better_values(known, scores).items():
        sheet.notes.append(
            f"better: {model}, {triangles} triangles, {kind}: {score.ratio:.4f} by {score.method}, seed {score.seed}; "
            f"known was {known[model, triangles][kind]:.4g}"
        )
    unknown = {(s.model, s.wanted) for s in scores if kind_of(s.method)} - set(known)
    sheet.notes += [f"{BEST.name} has no {model} of {triangles} triangles" for model, triangles in sorted(unknown)]
    return [sheet]


def write_best(scores):
    """Put better values into the table."""
    known = read_best()
    for (at, kind), score in better_values(known, scores).items():
        known[at][kind] = round(score.ratio, 4)
    with BEST.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["model", "triangles", *KINDS])
        writer.writerows([*at, *(best[kind] for kind in KINDS)] for at, best in known.items())


# ---------------------------------------------------------------------------------------------------------- variants


def chosen_variants(wanted):
    """Return the variants of these names, where "delaunay" and "free" are all of a kind, each once."""
    groups = {"delaunay": VARIANTS, "free": [*FREE_VARIANTS, "memetic"]}
    names = list(dict.fromkeys(name for word in wanted or ["delaunay"] for name in groups.get(word, [word])))
    known = VARIANTS | FREE_VARIANTS
    unknown = [name for name in names if name not in known]
    if unknown:
        sys.exit(f"no variant {unknown[0]!r}; there are {', '.join([*groups, *known])}")
    return {name: known[name] for name in names}


def ablation(options):
    """Print the geometric mean over models, sizes and seeds of each variant of the search, at equal time."""
    variants = chosen_variants(options.ablation)
    if not options.models:
        options.models = ABLATION_MODELS
    names, skipped = chosen_models(options)
    seconds = options.budgets[0] if options.budgets else ABLATION_SECONDS
    seeds = options.seeds or ABLATION_SEEDS
    say("compiling")
    warm_up([])
    for variant, make in variants.items():
        with changed(variant):
            minimize(MeshProblem("face:60", regions=REGIONS), make(), ("time", 0.5), seed=1)
    measures = {"error": "error", "surface error": "surface_error"}
    ratios = {what: defaultdict(dict) for what in measures}  # variant -> (model, seed, share) -> ratio
    notes = defaultdict(list)
    models = []
    for model in opened(names, options.classes, skipped):
        models.append(model.name)
        reference, sizes = reference_of(model, options.shares)
        for seed in seeds:
            # Variants in turn, so that what else the machine does meets all of them.
            for variant, make in variants.items():
                say(f"{model.name}: {variant}, seed {seed}")
                with changed(variant):
                    curve = search_curve(model, make(), ("time", seconds), seed, REGIONS)
                notes[variant].append(int(curve.note.split()[0]))
                for what, measure in measures.items():
                    for share, size in sizes.items():
                        ratio = _ratio(curve.value(size, measure), reference.value(size, measure))
                        ratios[what][variant][model.name, seed, share] = ratio
    shares = ", ".join(f"{share:g}" for share in options.shares)
    sheets = []
    for what, found in ratios.items():
        sheet = variants_sheet(what, found, models, seeds, seconds, notes)
        sheet.notes.append(f"at {shares} % of the vertices; generations: median of the runs")
        sheet.notes += [f"skipped: {reason}" for reason in skipped]
        sheet.show()
        sheets.append(sheet)
    for path in options.output:
        if path.suffix == ".csv":
            rows = [
                [variant, *key, ratio, ratios["surface error"][variant][key]]
                for variant, found in ratios["error"].items()
                for key, ratio in found.items()
            ]
            with path.open("w", newline="", encoding="utf-8") as file:
                heading = ["variant", "model", "seed", "share", "ratio", "surface_ratio"]
                csv.writer(file).writerows([heading, *rows])
        else:
            write_markdown(path, sheets, skipped)


def variants_sheet(what, ratios, models, seeds, seconds, generations):
    """Return a table of the variants: their ratios to thinning's, and to the first variant's."""
    first = next(iter(ratios))
    sheet = Sheet(
        f"Variants of the search after {seconds:g} s: geometric mean of {what} / thinning's",
        ["variant", *models, "all", f"all / {first}", *(f"seed {seed}" for seed in seeds), "worst", "generations"],
    )
    for variant, found in ratios.items():
        by_model = [geometric_mean(r for (of, _, _), r in found.items() if of == name) for name in models]
        by_seed = [geometric_mean(r for (_, s, _), r in found.items() if s == seed) for seed in seeds]
        both = [geometric_mean(values.values()) for values in (found, ratios[first])]
        row = [*by_model, both[0], both[0] / both[1], *by_seed, max(found.values())]
        sheet.rows.append([variant, *map(figure, row), f"{np.median(generations[variant]):.0f}"])
    return sheet


def enumerable(n_models):
    """Print on how many small models the search finds the whole true front; return whether on all."""
    models = beside("enumerable_models")
    warm_up([])
    missed, times = [], []
    for seed in range(n_models):
        problem = models.random_problem(seed)
        known = models.true_front(problem)
        fresh = MeshProblem(problem.model)
        start = time.perf_counter()
        result = minimize(fresh, memetic(), ("n_gen", models.GENERATIONS), seed=seed)
        times.append(time.perf_counter() - start)
        if not models.same_front(result.F, known):
            missed.append(f"model {seed} ({problem.n_var} vertices)")
    CONSOLE.print(
        f"The whole true front on {n_models - len(missed)} of {n_models} models, {models.GENERATIONS} generations each"
        f", median {np.median(times):.2f} s, longest {max(times):.2f} s, all {sum(times):.0f} s",
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
    parser.add_argument("--methods", nargs="+", choices=METHODS, metavar="METHOD", help=text)
    parser.add_argument("--refit", action="store_true", help="each front's meshes with their best heights, too")
    text = "seeds of the searches; default: 1, of an ablation 1 2 3"
    parser.add_argument("--seeds", "--seed", nargs="+", type=int, metavar="K", help=text)
    text = "write all results (.csv) or the tables (.md) too; may be given twice"
    parser.add_argument("-o", "--output", action="append", type=Path, default=[], metavar="FILE", help=text)
    text = "keep what the .csv has of other models, methods, seeds and sizes, and sum up all of it"
    parser.add_argument("--append", action="store_true", help=text)
    text = "a program with vertical_error(points, vertices, faces): measures the stored meshes of all searches"
    parser.add_argument("--referee", type=Path, metavar="FILE", help=text)
    text = "at most so many meshes of a front, spread over it; default: all"
    parser.add_argument("--referee-meshes", type=int, metavar="K", help=text)
    text = "the gap to the best values known, after 10 and 60 s; 'write': better ones become those known"
    parser.add_argument("--best", nargs="?", const="compare", choices=("compare", "write"), help=text)
    text = (
        f"variants of the search, {ABLATION_SECONDS:g} s each (--budgets S: S): "
        f"{'; '.join([*VARIANTS, *FREE_VARIANTS])}; 'delaunay' (default) and 'free': all of a kind"
    )
    parser.add_argument("--ablation", nargs="*", metavar="VARIANT", help=text)
    text = f"true fronts of this many small models; default: {ENUMERABLE}"
    parser.add_argument("--enumerable", nargs="?", type=int, const=ENUMERABLE, metavar="COUNT", help=text)
    options = parser.parse_args(argv)
    wrong = [path for path in options.output if path.suffix not in (".csv", ".md")]
    if wrong:
        parser.error(f"cannot write {wrong[0]}; the results are written as .csv, the tables as .md")
    if options.append and not any(path.suffix == ".csv" for path in options.output):
        parser.error("--append goes on with a file: give one by -o FILE.csv")
    if options.best is not None:
        options.models = options.models or list(dict.fromkeys(model for model, _ in read_best()))
        options.budgets = options.budgets or BEST_BUDGETS
        options.methods = options.methods or BEST_METHODS
    options.methods = options.methods or USUAL_METHODS
    if not all(0 < share <= 100 for share in options.shares):
        parser.error("--shares are percent, above 0 and up to 100")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if options.enumerable is not None:
            return 0 if enumerable(options.enumerable) else 1
        if options.ablation is not None:
            ablation(options)
            return 0
        return 1 if benchmark(options) else 0


if __name__ == "__main__":
    sys.exit(main())
