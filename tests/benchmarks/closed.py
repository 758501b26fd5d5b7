"""How near simplified closed surfaces lie to their originals, beside the decimators of today at equal triangles.

``python tests/benchmarks/closed.py --referee FILE`` takes four scans and models of others from a folder (``--shared``)
and two larger ones of our own, and at 2, 5, 10 and 20 % of their triangles:

* *refitted*: one mesh is wished for (``simplify_to``, ``--seconds`` of search), and its vertices are moved to where
  they fit best, on top of that time; *subset*: the same mesh before; ``--whole``: both are taken from one front of all
  sizes that was searched for as long as that, as ``meshsimp simplify --time`` does;
* MeshLab's quadric collapse in the file's unit, at unit size, and at unit size onto ends of edges, meshoptimizer,
  fast-simplification and pyfqmr: their largest mesh of at most so many triangles. What is not installed is left out,
  with a line. ``pip install '.[baselines,meshlab]'``, ``pip install --pre meshoptimizer``.

FILE has a function ``measure(original, simplified, samples)`` that takes two mesh files and returns ``vmean``, the mean
distance of the original's vertices, ``smean`` and ``srms``, the symmetric mean distance and its root mean square, and
``haus``, the largest; in diagonals of the original, and by no code of this package. Ratios are those of *refitted* to
the best of all tools for each number by itself, and of *subset* to the best of those that choose among the vertices.
Self-intersecting faces are MeshLab's; a face is reversed if its normal looks away from that of the original face that
is nearest to its centre. ``-o FILE.csv`` writes all numbers, ``-o FILE.md`` the tables.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import importlib.util
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pymoo.optimize import minimize
from rich.console import Console
from rich.table import Table

from meshsimp_pymoo import Front, MeshProblem, memetic, simplify_to
from meshsimp_pymoo.comparison.baselines import BASELINES, largest_at_most
from meshsimp_pymoo.comparison.meshlab import load_pymeshlab
from meshsimp_pymoo.errors import ModelError, ToolUnavailable
from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
SCANS = ("c_spot", "c_homer", "c_cheburashka", "c_fandisk")
OUR_OWN = ("blob:20000,seed=2", "blob:35000,seed=5,bumps=0.2,stretch=3")
# With sharp edges, which meshes of a Delaunay rule cut off.
CAD = ("c_fandisk",)
SHARES = (2.0, 5.0, 10.0, 20.0)
SECONDS = 60.0
SAMPLES = 200_000

TOOLS = (
    "quadric_collapse",
    "quadric_collapse_unit",
    "quadric_collapse_ends",
    "meshoptimizer_free",
    "fast_simplification_free",
    "pyfqmr_free",
)
REFITTED, SUBSET = "refitted", "subset"
MEASURED = ("vmean", "smean", "srms", "haus")
# What the ratios are to be at most, in the geometric mean over all models and sizes.
GOALS = {(REFITTED, "smean"): 0.80, (REFITTED, "srms"): 0.90, (SUBSET, "smean"): 0.70}
CONSOLE = Console(width=140)

Mesh = tuple[np.ndarray, np.ndarray]
Measure = Callable[[str, str, int], dict[str, float]]


@dataclass(frozen=True)
class Row:
    """What was measured of one mesh."""

    model: str
    vertices: int
    share: float
    method: str
    triangles: int
    vmean: float
    smean: float
    srms: float
    haus: float
    intersecting: int
    reversed: int
    seconds: float


def say(text: str) -> None:
    """Show what is going on, on a terminal's other stream."""
    sys.stderr.write(f"{time.strftime('%H:%M:%S')}  {text}\n")


def referee_of(path: Path) -> Measure:
    """Return the function that measures, from a file of its own."""
    spec = importlib.util.spec_from_file_location("surface_distance", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise SystemExit(f"{path}: is no Python file with a function measure(original, simplified, samples)")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.measure


def write_obj(path: Path, vertices: np.ndarray, faces: np.ndarray) -> str:
    """Write a mesh with every digit of its coordinates."""
    with path.open("w", encoding="ascii") as file:
        np.savetxt(file, vertices, fmt="v %.17g %.17g %.17g")
        np.savetxt(file, np.asarray(faces) + 1, fmt="f %d %d %d")
    return str(path)


def intersecting(vertices: np.ndarray, faces: np.ndarray) -> int:
    """Return how many faces of a mesh go through another one, by MeshLab."""
    pymeshlab = load_pymeshlab()
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=np.asarray(vertices, float), face_matrix=np.asarray(faces, np.int32)))
    meshes.compute_selection_by_self_intersections_per_face()
    return int(meshes.current_mesh().selected_face_number())


def normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def reversed_faces(problem: MeshProblem, vertices: np.ndarray, faces: np.ndarray) -> int:
    """Return how many faces of a mesh look the other way than the original does nearest to their centres."""
    original, own = problem.model.file_points, problem.model.faces
    _, nearest = distances_to_mesh(vertices[faces].mean(axis=1), original, own)
    return int(((normals(vertices, faces) * normals(original, own)[nearest]).sum(axis=1) < 0).sum())


def of_tool(problem: MeshProblem, name: str, size: int) -> tuple[Mesh, float]:
    """Return a tool's largest mesh of at most so many triangles, and its seconds."""
    tool = BASELINES[name].tool
    assert tool is not None
    return largest_at_most(tool(problem.model), size, len(problem.model.faces))


def ours(problem: MeshProblem, sizes: dict[float, int], seconds: float, whole: bool, seed: int) -> Iterator[tuple]:
    """Yield (share, method, mesh, seconds) of our meshes."""
    front = None
    if whole:
        front = Front.from_result(minimize(problem, memetic(), ("time", seconds), seed=seed))
    for share, size in sizes.items():
        start = time.perf_counter()
        if front is None:
            found = simplify_to(problem, triangles=size, time=seconds, seed=seed)
        else:
            found = front.best(triangles=size)
        searched = seconds if whole else time.perf_counter() - start
        used, corners = np.unique(found.faces, return_inverse=True)
        yield share, SUBSET, (problem.model.file_points[used], corners.reshape(-1, 3)), searched
        start = time.perf_counter()
        fitted = found.refit()
        place = np.searchsorted(fitted.rows, fitted.faces)
        yield share, REFITTED, (fitted.vertices, place), searched + time.perf_counter() - start


def compared(name: str, options: argparse.Namespace, measure: Measure, folder: Path) -> list[Row]:
    """Return the rows of one model."""
    source = options.shared / f"{name}.ply"
    problem = MeshProblem(source if source.is_file() else name, surface="closed", weights=options.weights)
    model = problem.model
    sizes = {share: int(share / 100 * len(model.faces)) // 2 * 2 for share in options.shares}
    original = write_obj(folder / "original.obj", model.file_points, model.faces)
    rows = []

    def add(share: float, method: str, mesh: Mesh, seconds: float) -> None:
        path = write_obj(folder / "simplified.obj", *mesh)
        found = measure(original, path, options.samples)
        counts = len(mesh[1]), *(found[what] for what in MEASURED)
        faults = intersecting(*mesh), reversed_faces(problem, *mesh)
        rows.append(Row(name, model.n_vertices, share, method, *counts, *faults, round(seconds, 2)))

    say(f"{name}: {model.n_vertices:,} vertices, searched")
    for found in ours(problem, sizes, options.seconds, options.whole, options.seed):
        add(*found)
    for tool in TOOLS:
        say(f"{name}: {BASELINES[tool].label}")
        try:
            for share, size in sizes.items():
                add(share, BASELINES[tool].label, *of_tool(problem, tool, size))
        except ToolUnavailable as reason:
            say(f"{name}: left out: {reason}")
    return rows


def rivals(rows: list[Row], row: Row) -> list[Row]:
    """Return the rows of the tools that a mesh of ours is measured by: at its model and size."""
    labels = {BASELINES[tool].label for tool in TOOLS if row.method == REFITTED or BASELINES[tool].own_vertices}
    return [r for r in rows if (r.model, r.share) == (row.model, row.share) and r.method in labels]


def ratio(rows: list[Row], row: Row, what: str) -> float:
    """Return a number of ours over the best of the tools' at equal triangles; NaN without any tool."""
    others = [getattr(other, what) for other in rivals(rows, row)]
    return getattr(row, what) / min(others) if others else np.nan


def mesh_table(rows: list[Row], name: str) -> list[list[str]]:
    """Return the table of one model: what was measured of each mesh, in 1e-4 of the diagonal."""
    table = [["%", "method", "triangles", *MEASURED, "intersecting", "reversed", "seconds"]]
    for row in sorted((r for r in rows if r.model == name), key=lambda r: r.share):
        numbers = [f"{1e4 * getattr(row, what):.4g}" for what in MEASURED]
        faults = [str(row.intersecting), str(row.reversed), f"{row.seconds:.2f}"]
        table.append([f"{row.share:g}", row.method, str(row.triangles), *numbers, *faults])
    return table


def ratio_table(rows: list[Row]) -> list[list[str]]:
    """Return the ratios of ours to the best tools, and their geometric means."""
    table = [["model", "%", *(f"{method} {what}" for method in (REFITTED, SUBSET) for what in MEASURED)]]
    found: dict[tuple[str, str], list[float]] = {}
    for model, share in dict.fromkeys((row.model, row.share) for row in rows):
        line = [model, f"{share:g}"]
        for method in (REFITTED, SUBSET):
            (own,) = (r for r in rows if (r.model, r.share, r.method) == (model, share, method))
            for what in MEASURED:
                value = ratio(rows, own, what)
                found.setdefault((method, what), []).append(value)
                line.append(f"{value:.3f}")
        table.append(line)
    means = {key: float(np.exp(np.mean(np.log(values)))) for key, values in found.items()}
    table.append(["geometric mean", "", *(f"{value:.3f}" for value in means.values())])
    table.append(["at most", "", *(f"{GOALS[key]:.2f}" if key in GOALS else "" for key in means)])
    return table


def fault_table(rows: list[Row]) -> list[list[str]]:
    """Return how many faces of all meshes of a method go through others or are reversed."""
    table = [["method", "meshes", "faces", "intersecting", "reversed", "meshes without either"]]
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        sound = sum(not row.intersecting and not row.reversed for row in own)
        numbers = (
            len(own),
            sum(row.triangles for row in own),
            sum(row.intersecting for row in own),
            sum(row.reversed for row in own),
            sound,
        )
        table.append([method, *map(str, numbers)])
    return table


def worse(rows: list[Row]) -> str:
    """Say where a refitted mesh is no better than the best tool's, by the symmetric mean distance."""
    found = [row for row in rows if row.method == REFITTED and row.model not in CAD and ratio(rows, row, "smean") > 1.0]
    where = ", ".join(f"{row.model} at {row.share:g} %" for row in found)
    return (
        f"Refitted, symmetric mean distance above that of the best tool (but for {', '.join(CAD)}): {where or 'none'}"
    )


def sheets(rows: list[Row]) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield all tables with their titles."""
    for name in dict.fromkeys(row.model for row in rows):
        n = next(row.vertices for row in rows if row.model == name)
        yield f"{name}: {n:,} vertices; distances in 1e-4 of the diagonal", mesh_table(rows, name)
    yield "Ours over the best of the tools at equal triangles", ratio_table(rows)
    yield "Faces that go through others, and that are reversed", fault_table(rows)


def show(rows: list[Row]) -> None:
    for title, table in sheets(rows):
        shown = Table(*table[0], title=title, title_justify="left")
        for line in table[1:]:
            shown.add_row(*line)
        CONSOLE.print(shown)
    CONSOLE.print(worse(rows), highlight=False)


def write(path: Path, rows: list[Row], said: str) -> None:
    if path.suffix == ".csv":
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([part.name for part in dataclasses.fields(Row)])
            writer.writerows(dataclasses.astuple(row) for row in rows)
        return
    lines = [f"# Closed surfaces beside the tools of today\n\n{said}\n"]
    for title, table in sheets(rows):
        head, *body = ("| " + " | ".join(line) + " |" for line in table)
        lines += [f"\n## {title}\n", head, "|" + "---|" * len(table[0]), *body]
    path.write_text("\n".join([*lines, "", worse(rows), ""]), encoding="utf-8")


def main(argv: list[str] | None = None) -> int:
    """Do what the options say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--referee", type=Path, required=True, metavar="FILE", help="the program that measures")
    text = f"files of the folder without .ply, or built-in names; default: {' '.join((*SCANS, *OUR_OWN))}"
    parser.add_argument("--models", nargs="+", default=(*SCANS, *OUR_OWN), metavar="MODEL", help=text)
    text = "folder with the models of others; default: ../shared/data beside the checkout"
    parser.add_argument("--shared", type=Path, default=SHARED, metavar="DIR", help=text)
    text = "percent of the triangles; default: 2 5 10 20"
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES, metavar="P", help=text)
    text = f"of search for each mesh, or for the whole front (default: {SECONDS:g})"
    parser.add_argument("--seconds", type=float, default=SECONDS, metavar="S", help=text)
    parser.add_argument("--whole", action="store_true", help="one front for all sizes instead of a search for each")
    parser.add_argument("--weights", choices=("area",), help="what each vertex counts in the search (default: all 1)")
    parser.add_argument("--seed", type=int, default=1, metavar="K", help="of the searches (default: 1)")
    text = f"on each of the two meshes (default: {SAMPLES:,})"
    parser.add_argument("--samples", type=int, default=SAMPLES, metavar="K", help=text)
    text = "write all numbers (.csv) or the tables (.md) too; may be given twice"
    parser.add_argument("-o", "--output", action="append", type=Path, default=[], metavar="FILE", help=text)
    options = parser.parse_args(argv)
    wrong = [path for path in options.output if path.suffix not in (".csv", ".md")]
    if wrong:
        parser.error(f"{wrong[0]}: write .csv or .md")
    measure = referee_of(options.referee)
    how = "one front of all sizes" if options.whole else "each mesh"
    weighted = f", vertices weighted by {options.weights}" if options.weights else ""
    said = f"{options.seconds:g} s of search for {how}{weighted}, seed {options.seed}; {options.samples:,} samples."
    simplify_to("sphere:100", triangles=40, moves=1000).refit()  # compiled before anything is timed
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as place:
        for name in options.models:
            try:
                rows += compared(name, options, measure, Path(place))
            except ModelError as problem:
                say(f"left out: {problem}")
            for path in options.output:  # anew after every model, so that an interrupted run leaves some
                if rows:
                    write(path, rows, said)
    if not rows:
        return 1
    show(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
