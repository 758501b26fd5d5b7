"""What refitted heights gain, how near to the best they are proved to be, and how long they take beside HiGHS.

Run ``python tests/benchmarks/refit.py`` (about a minute); ``--highs SIZE`` compares with SciPy's linear programming on
models of at most SIZE vertices (default 10000; at 138 632 one takes about 20 s).
"""

from __future__ import annotations

import argparse
import time
import warnings
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy import sparse
from scipy.optimize import linprog

from meshsimp_pymoo import MeshProblem, refit_heights, thinning
from meshsimp_pymoo.surface.score import mesh_samples

MODELS = ("jacksboro:11", "face:1000", "jacksboro:4", "face:10000", "jacksboro:1")
SHARES = (0.02, 0.05, 0.2, 0.5)
CONSOLE = Console(width=110)


def seconds(call):
    """Return the seconds of the process that a call takes, and its result."""
    start = time.process_time()
    result = call()
    return time.process_time() - start, result


def by_highs(surface, refitted):
    """Return the least error by linear programming; uncovered vertices are left out, as it can do no distances."""
    faces = np.searchsorted(refitted.rows, refitted.faces)
    samples = mesh_samples(surface.ground(), surface.points[refitted.rows], faces)
    counts = np.flatnonzero(samples.covered)
    n, m = len(counts), len(refitted.rows)
    A = sparse.coo_matrix(
        (samples.shares[counts].ravel(), (np.repeat(np.arange(n), 3), samples.sites[counts].ravel())), shape=(n, m)
    )
    found = linprog(
        np.r_[np.zeros(m), np.ones(2 * n)],
        A_eq=sparse.hstack([A, -sparse.identity(n), sparse.identity(n)]).tocsc(),
        b_eq=surface.points[counts, 2],
        bounds=[(None, None)] * m + [(0, None)] * (2 * n),
        method="highs-ipm",
    )
    if found.status != 0:
        raise RuntimeError(f"HiGHS: {found.message}")
    return found.fun


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--highs", type=int, default=10_000, metavar="SIZE")
    largest = parser.parse_args().highs
    warnings.simplefilter("ignore")
    columns = ("model", "N", "kept", "after / before", "proved gap", "true gap", "seconds", "HiGHS s")
    table = Table(*columns, title="Refitted heights of thinned meshes")
    for name in MODELS:
        surface = MeshProblem(name, outside="ignore").surface
        front = thinning(MeshProblem(name).surface)
        for share in SHARES:
            kept = front.kept(max(int(share * surface.n_vertices) - len(front.base), 3))
            took, refitted = seconds(partial(refit_heights, surface, kept))
            row = [name, f"{surface.n_vertices}", f"{share:.0%}", f"{refitted.error / refitted.before:.4f}"]
            row += [f"{1 - refitted.bound / refitted.error:.1e}"]
            if surface.n_vertices <= largest:
                theirs, least = seconds(partial(by_highs, surface, refitted))
                row += [f"{refitted.error / least - 1:.1e}", f"{took:.3f}", f"{theirs:.2f}"]
            else:
                row += ["", f"{took:.3f}", ""]
            table.add_row(*row)
    CONSOLE.print(table)


if __name__ == "__main__":
    main()
