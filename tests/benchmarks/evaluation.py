"""How fast an evaluation and a run are, as ratios: both sides in one process, warm, in alternation.

Run ``python tests/benchmarks/evaluation.py`` (about three minutes), with ``--moves`` for the live triangulation and the
greedy passes alone, or with ``--memory`` for the peak memory of a population of 100 at N = 1 000 000 alone. ``-o FILE``
writes the tables as Markdown, too: ``-o tests/benchmarks/evaluation.md``.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import time
import warnings
from functools import partial
from pathlib import Path

import numpy as np
from numba import njit
from pymoo.optimize import minimize
from rich.console import Console
from rich.table import Table
from scipy.spatial import Delaunay

from meshsimp_pymoo import MeshProblem, greedy_insertion, moead, nsga2_v1, nsga2_v2, thinning
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.moves import try_exchange
from meshsimp_pymoo.surface.rules import Rules

ROUNDS = 15
AS_IN_THE_PAPER = Rules(footprint="hull", outside="ignore")
CONSOLE = Console(width=110)
SHOWN: list[Table] = []


def show(table):
    """Print a table, and remember it."""
    SHOWN.append(table)
    CONSOLE.print(table)


def markdown(table):
    """Return a table as Markdown, its title above."""
    rows = [[column.header for column in table.columns], ["---", *["---:"] * (len(table.columns) - 1)]]
    rows += zip(*(column.cells for column in table.columns), strict=True)
    return "\n".join([f"## {table.title}", "", *(f"| {' | '.join(row)} |" for row in rows), ""])


def write(path):
    """Write the tables that were shown."""
    made = "Made by `python tests/benchmarks/evaluation.py`, warm, medians.\n"
    path.write_text("\n".join(["# How fast evaluations are", "", made, *map(markdown, SHOWN)]), encoding="utf-8")


def by_scipy(model, kept):
    """The same error from SciPy's parts: Delaunay, find_simplex, interpolation; uncovered vertices cost 0."""
    xy, z = np.ascontiguousarray(model.points[:, :2]), model.points[:, 2]
    delaunay = Delaunay(xy[kept])
    simplex = delaunay.find_simplex(xy)
    covered = simplex >= 0
    transform = delaunay.transform[simplex[covered]]
    pair = np.einsum("ijk,ik->ij", transform[:, :2], xy[covered] - transform[:, 2])
    weights = np.c_[pair, 1 - pair.sum(axis=1)]
    height = (weights * z[kept][delaunay.simplices[simplex[covered]]]).sum(axis=1)
    return np.abs(height - z[covered]).sum()


def seconds(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def subsets(model, share, n, seed):
    X = np.random.default_rng(seed).random((n, model.n_vertices)) < share
    X[:, model.corners] = True
    return X


def evaluations():
    """One evaluation against SciPy, on different subsets each time; medians over the rounds."""
    table = Table("model", "N", "kept", "ours ms", "ns a vertex", "SciPy ms", "SciPy / ours", title="One evaluation")
    for name in ("jacksboro:12", "face:1000", "jacksboro:4", "jacksboro:1"):
        model = MeshProblem(name).model
        rounds = ROUNDS if model.n_vertices < 50_000 else 3
        batch = max(1, 20_000 // model.n_vertices)
        for share in (0.05, 0.2, 0.5):
            surface = HeightSurface(model, AS_IN_THE_PAPER)
            surface.evaluate(subsets(model, share, 2, 0))
            ours, theirs, ratios = [], [], []
            for k in range(rounds):
                X = subsets(model, share, batch, k)
                mine = seconds(partial(surface.evaluate, X)) / batch
                reference = seconds(lambda model=model, X=X: by_scipy(model, X[0]))
                ours.append(mine)
                theirs.append(reference)
                ratios.append(reference / mine)
            row = statistics.median(ours), statistics.median(theirs), statistics.median(ratios)
            table.add_row(
                name,
                f"{model.n_vertices}",
                f"{share:.0%}",
                f"{row[0] * 1e3:.3f}",
                f"{row[0] / model.n_vertices * 1e9:.0f}",
                f"{row[1] * 1e3:.2f}",
                f"{row[2]:.0f}",
            )
    show(table)


def concave():
    """What the default rules cost beside the hull reading, on concave models."""
    table = Table("model", "N", "kept", "model, nearest / hull, ignore", title="Price of footprint and nearest point")
    for name in ("ring:2000", "horseshoe:2000", "face:5000"):
        model = MeshProblem(name).model
        for share in (0.05, 0.2, 0.5):
            X = subsets(model, share, 20, 1)
            usual, paper = HeightSurface(model), HeightSurface(model, AS_IN_THE_PAPER)
            for surface in (usual, paper):
                surface.evaluate(X)
            ratios = []
            for _ in range(ROUNDS):
                ratios.append(seconds(partial(usual.evaluate, X)) / seconds(partial(paper.evaluate, X)))
            table.add_row(name, f"{model.n_vertices}", f"{share:.0%}", f"{statistics.median(ratios):.2f}")
    show(table)


class TimedProblem(MeshProblem):
    """Counts the seconds inside the kernel."""

    kernel_seconds = 0.0

    def _kernel(self, X, n_threads):
        start = time.perf_counter()
        table = super()._kernel(X, n_threads)
        self.kernel_seconds += time.perf_counter() - start
        return table


def runs():
    """The paper's runs, population 100, 50 generations, at N = 922 with the paper's rules."""
    table = Table("preset", "seconds", "kernel", "pymoo and operators", "evaluations", title="100 x 50 at N = 922")
    for preset in (nsga2_v1, moead, nsga2_v2):
        times, kernels, count = [], [], 0
        for seed in (0, 1, 2, 3):
            problem = TimedProblem("jacksboro:vertices=922", footprint="hull", outside="ignore")
            start = time.perf_counter()
            result = minimize(problem, preset(), ("n_gen", 50), seed=seed)
            times.append(time.perf_counter() - start)
            kernels.append(problem.kernel_seconds)
            count = result.algorithm.evaluator.n_eval
        # The first run warms up.
        total, kernel = statistics.median(times[1:]), statistics.median(kernels[1:])
        table.add_row(preset.__name__, f"{total:.2f}", f"{kernel:.2f}", f"{total - kernel:.2f}", f"{count}")
    show(table)


@njit
def _try_all(ground, books, old, new):
    """Evaluate moves without making them; return how many can be made."""
    ground = borrowed(ground)
    books = borrowed(books)
    possible = 0
    for k in range(len(old)):
        change, _ = try_exchange(ground, books, old[k], new[k], np.inf)
        possible += change < np.inf
    return possible


def moves():
    """Exact evaluations of tentative operations on one core, with 5 % of the vertices kept by thinning."""
    columns = ("insert", "remove", "move anywhere", "move to a neighbour")
    table = Table("model", "N", "kept", *columns, title="Tentative operations a second, exact, one core")
    count, nothing = 20_000, -1
    for name in ("jacksboro:12", "jacksboro:4", "jacksboro:1"):
        surface = MeshProblem(name).surface
        rng = np.random.default_rng(1)
        nested = thinning(surface)
        kept = nested.kept(round(0.05 * surface.n_vertices))
        ground = surface.ground()
        pinned = nested.kept(0)
        old = rng.choice(np.flatnonzero(kept & ~pinned), count)
        new = rng.choice(np.flatnonzero(~kept), count)
        indptr, indices = surface.neighbours
        near = indices[indptr[old] + rng.integers(0, indptr[old + 1] - indptr[old])].astype(np.int64)
        free = ~kept[near]
        none = np.full(count, nothing)
        cells = []
        with surface.books(kept) as books:
            for gone, come in ((none, new), (old, none), (old, new), (old[free], near[free])):
                _try_all(ground, books, gone[:10], come[:10])
                call = partial(_try_all, ground, books, gone, come)
                rounds = [seconds(call) / len(gone) for _ in range(5)]
                cells.append(f"{1 / statistics.median(rounds):,.0f}")
        table.add_row(name, f"{surface.n_vertices}", "5%", *cells)
    show(table)


def passes():
    """One pass of thinning and of greedy insertion, all sizes, one core."""
    for run in (thinning, greedy_insertion):
        run(MeshProblem("jacksboro:12").surface)
    table = Table("model", "N", "thinning s", "greedy insertion s", title="Greedy passes")
    for surface in (MeshProblem("jacksboro:1").surface, HeightSurface(million())):
        surface.ground()  # made once a surface
        table.add_row(
            surface.model.name,
            f"{surface.n_vertices}",
            f"{seconds(partial(thinning, surface)):.2f}",
            f"{seconds(partial(greedy_insertion, surface)):.2f}",
        )
    show(table)


def million():
    """Return a rough terrain of a million samples: noise whose amplitude falls with the square of the frequency."""
    n = 1000
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n)))
    frequency[0, 0] = np.inf
    noise = np.random.default_rng(1).normal(size=(n, n))
    heights = np.fft.ifft2(np.fft.fft2(noise) * frequency**-2.0).real
    heights = (heights - heights.min()) / np.ptp(heights) * 500
    return build_model(grid_source(heights, 10.0, 10.0, name="noise 1000 x 1000"), up="z")


def memory():
    """Peak memory of a population of 100 over a million vertices, three generations; in this process."""
    x, y = np.meshgrid(np.linspace(0, 9, 1000), np.linspace(0, 9, 1000))
    problem = MeshProblem(grid_source(np.sin(x) * np.cos(y * 1.3) * 50, 10.0, 10.0), up="z")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    start = time.perf_counter()
    minimize(problem, nsga2_v1(), ("n_gen", 3), seed=1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    CONSOLE.print(
        f"N = {problem.n_var}, population 100, 3 generations: {time.perf_counter() - start:.0f} s, "
        f"peak {peak:.2f} GiB (of which reading the model {before:.2f} GiB)"
    )


def main() -> None:
    """Print all tables, or the memory line alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--memory", action="store_true", help="only the peak memory")
    parser.add_argument("--moves", action="store_true", help="only the live triangulation and the greedy passes")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the tables as Markdown")
    options = parser.parse_args()
    if options.memory:
        memory()
        return
    warnings.simplefilter("ignore")
    for part in (moves, passes) if options.moves else (evaluations, concave, runs, moves, passes):
        part()
    if options.output is not None:
        write(options.output)
    if options.moves:
        return
    subprocess.run([sys.executable, __file__, "--memory"], check=True)


if __name__ == "__main__":
    main()
