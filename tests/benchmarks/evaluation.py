"""How fast an evaluation and a run are, as ratios: both sides in one process, warm, in alternation.

Run ``python tests/benchmarks/evaluation.py`` (about two minutes), or with ``--memory`` for the peak memory of a
population of 100 at N = 1 000 000 alone.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import time
import warnings

import numpy as np
from pymoo.optimize import minimize
from rich.console import Console
from rich.table import Table
from scipy.spatial import Delaunay

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.algorithms import moead, nsga2_v1, nsga2_v2
from meshsimp_pymoo.geometry.error import evaluate_subsets

ROUNDS = 15
CONSOLE = Console(width=110)


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
            evaluate_subsets(model, subsets(model, share, 2, 0), footprint="hull", outside="ignore")
            ours, theirs, ratios = [], [], []
            for k in range(rounds):
                X = subsets(model, share, batch, k)
                rules = {"footprint": "hull", "outside": "ignore"}
                mine = seconds(lambda model=model, X=X, rules=rules: evaluate_subsets(model, X, **rules)) / batch
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
    CONSOLE.print(table)


def concave():
    """What the default rules cost beside the hull reading, on concave models."""
    table = Table("model", "N", "kept", "model, nearest / hull, ignore", title="Price of footprint and nearest point")
    for name in ("ring:2000", "horseshoe:2000", "face:5000"):
        model = MeshProblem(name).model
        for share in (0.05, 0.2, 0.5):
            X = subsets(model, share, 20, 1)
            evaluate_subsets(model, X)
            ratios = []
            for _ in range(ROUNDS):
                default = seconds(lambda model=model, X=X: evaluate_subsets(model, X))
                rules = {"footprint": "hull", "outside": "ignore"}
                hull = seconds(lambda model=model, X=X, rules=rules: evaluate_subsets(model, X, **rules))
                ratios.append(default / hull)
            table.add_row(name, f"{model.n_vertices}", f"{share:.0%}", f"{statistics.median(ratios):.2f}")
    CONSOLE.print(table)


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
    CONSOLE.print(table)


def memory():
    """Peak memory of a population of 100 over a million vertices, three generations; in this process."""
    from meshsimp_pymoo.geometry.load import grid_source

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
    if parser.parse_args().memory:
        memory()
        return
    warnings.simplefilter("ignore")
    evaluations()
    concave()
    runs()
    subprocess.run([sys.executable, __file__, "--memory"], check=True)


if __name__ == "__main__":
    main()
