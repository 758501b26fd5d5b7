"""What of a gain at the samples holds on data that no method has seen.

``python tests/benchmarks/unseen.py`` searches ``jacksboro:11``, every eleventh row and column of a terrain, and
measures the meshes on the whole of it; ``--data SCAN.ply`` does the same with a scan thinned to a tenth of its
vertices, whose mesh is the model that is searched, measured on the scan. The tables are Markdown. Each search has ten
seconds, or a number of moves, which give the same table whatever else the machine does: a second of one core makes some
1.1 million of subsets on the terrain, 0.6 on scans, and 1.7 of free meshes.

* Ratios are to adaptive thinning at its triangles at these shares of the model's vertices: of the best mesh of at most
  so many, chosen by the error at the model's vertices, as a user would.
* The unseen samples are those that the model itself covers; one that a mesh does not cover costs the distance to it.
* The model itself deviates from them. What it does, as a share of what thinning's mesh does, stands in the first row:
  no search can know better than it.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, memetic, thinning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.problem import mesh_of
from meshsimp_pymoo.surface.height import HeightSurface

SHARES = (0.02, 0.05, 0.1, 0.2)  # of the model's vertices
TENTH = 0.1  # of a scan's vertices are its model
SEARCHES = {
    "memetic": {},
    "free": {"triangulation": "free"},
    "free, no centroids, any shape": {"triangulation": "free", "centroids": False, "min_height": 0.0},
}
MEASURED = ("at its vertices", "at its centroids", "on unseen samples")


@dataclass
class Case:
    """A model to search, and the samples that it was made from; ``counts`` is their weight (N,)."""

    name: str
    model: object
    unseen: HeightSurface
    counts: np.ndarray

    @classmethod
    def of(cls, name, model, unseen):
        """Let those samples count that the model covers, as much as they do."""
        weights = 1.0 if unseen.model.weights is None else unseen.model.weights
        covered = unseen.score(model.file_points, model.faces).covered
        return cls(name, model, unseen, covered * weights)

    def error(self, vertices, faces):
        """Return the mean deviation of a mesh, in the frame of the file, from the unseen samples."""
        return float(self.counts @ self.unseen.score(vertices, faces).deviation / self.counts.sum())


def terrain():
    """Return the built-in terrain, every eleventh row and column of it."""
    return Case.of("jacksboro:11", open_model("jacksboro:11"), HeightSurface(open_model("jacksboro")))


def thinned(path):
    """Return a scan thinned to a tenth of its vertices."""
    scan = HeightSurface(open_model(path))
    nested = thinning(scan)
    kept = nested.kept(max(round(TENTH * scan.n_vertices) - len(nested.base), 0))
    mesh = mesh_of(scan, scan.triangles(kept))
    model = open_model(mesh, Options(up=tuple(float(part) for part in scan.model.up)))
    return Case.of(f"{Path(path).stem}, a tenth of its vertices", model, scan)


def numbers(case, solution, refit=False):
    """Return the mean error of a mesh at the vertices of its model, at the centroids of its faces, and unseen."""
    if not refit:
        mesh, quality = solution.mesh, solution.quality
        return np.array([quality.mean_error, quality.surface_error, case.error(mesh.vertices, mesh.faces)])
    found = solution.refit()
    faces = np.searchsorted(found.rows, found.faces)
    quality = solution.front.surface.score(found.vertices, faces).quality
    return np.array([quality.mean_error, quality.surface_error, case.error(found.vertices, faces)])


def table(case, budgets, seeds, refit):
    """Return the table of one model as lines of Markdown: geometric means over the seeds."""
    problem = MeshProblem(case.model)
    nested = thinning(problem.surface)
    rows = [max(round(share * problem.n_var) - len(nested.base), 0) for share in SHARES]
    reference = Front.from_subsets(problem, np.array([nested.kept(row) for row in rows]))
    sizes = [solution.triangles for solution in reference]
    base = np.array([numbers(case, solution) for solution in reference])
    found = {}
    if refit:
        found["thinning, refitted"] = np.array([numbers(case, solution, refit=True) for solution in reference])
    for name, how in SEARCHES.items():
        runs = []
        for seed in seeds:
            # a problem that knows nothing from earlier searches
            result = minimize(MeshProblem(case.model), memetic(**how), budgets[bool(how)], seed=seed)
            front = Front.from_result(result)
            runs.append([front.best(triangles=size) for size in sizes])
        for what in (False, True)[: 1 + refit]:
            errors = [[numbers(case, solution, refit=what) for solution in run] for run in runs]
            found[name + ", refitted" * what] = np.exp(np.log(errors).mean(axis=0))
    floor = case.error(case.model.file_points, case.model.faces) / base[:, 2]
    lines = [
        f"### {case.name}: N = {problem.n_var}, measured on {np.count_nonzero(case.counts)} samples, "
        f"{len(seeds)} seed{'s' * (len(seeds) > 1)}",
        "",
        "At " + ", ".join(map(str, sizes)) + " triangles, relative to thinning's.",
        "",
        "| | " + " | ".join(MEASURED) + " | mean of these |",
        "|---|---|---|---|---|",
        f"| the model itself | | | {spelled(floor)} | |",
    ]
    for name, errors in found.items():
        ratio = errors / base
        means = np.exp(np.log(ratio).mean(axis=0))
        cells = [*(spelled(ratio[:, k]) for k in range(len(MEASURED))), spelled(means)]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def spelled(ratios):
    """Return ratios as text."""
    return " ".join(f"{ratio:.3f}".removeprefix("0") for ratio in ratios)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="*", default=[], metavar="SCAN", help="scans to thin to a tenth")
    parser.add_argument("--only", action="store_true", help="the scans alone, without the terrain")
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="of each search; default: 10")
    text = "millions of moves instead: of the search for subsets, and of those for free meshes"
    parser.add_argument("--moves", type=float, nargs=2, metavar=("SUBSETS", "FREE"), help=text)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3], metavar="K", help="default: 1 2 3")
    parser.add_argument("--refit", action="store_true", help="with their best heights, too")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    for how in SEARCHES.values():  # compiling is nobody's time
        minimize(MeshProblem("face:60"), memetic(10, **how), ("n_gen", 3), seed=1)
    budgets = [("time", options.seconds)] * 2
    if options.moves is not None:
        budgets = [Moves(int(1e6 * millions)) for millions in options.moves]
    cases = [] if options.only else [terrain()]
    for case in [*cases, *map(thinned, options.data)]:
        print("\n".join(table(case, budgets, options.seeds, options.refit)), flush=True)


if __name__ == "__main__":
    main()
