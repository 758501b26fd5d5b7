"""How near simplified closed surfaces lie to their originals, beside the decimators of today at equal triangles.

``python tests/benchmarks/closed.py --referee FILE`` takes models, and at 2, 5, 10 and 20 % of their triangles:

* *refitted*: one mesh is wished for (``simplify_to``, ``--seconds`` or ``--moves`` of search), and its vertices are
  moved to where they fit best, on top of that time; *subset*: the same mesh before; ``--whole``: both are taken from
  one front of all sizes that was searched for as long as that, as ``meshsimp simplify --time`` does;
* MeshLab's quadric collapse in the file's unit, at unit size, and at unit size onto ends of edges, meshoptimizer,
  fast-simplification and pyfqmr, of models with holes with their borders kept, too: their largest mesh of at most so
  many triangles. What is not installed is left out, with a line, and what cannot get as small. ``pip install
  '.[baselines,meshlab]'``, ``pip install --pre meshoptimizer``.

A model is a file of a folder (``--shared``), a built-in name, or a front patch of that folder of which a whole scan is
made, ``whole:FILE`` (see ``closed_scans.py``); ``NAME+sharp:30`` or ``NAME+outline`` has such break lines, with
``@3e-4`` behind thinned to that share of the diagonal. ``--models`` takes the names of groups, too: closed surfaces of
one part, ones with holes, whole scans, several parts, CAD.

FILE has a function ``measure(original, simplified, samples)`` that takes two mesh files and returns ``vmean``, the mean
distance of the original's vertices, ``smean`` and ``srms``, the symmetric mean distance and its root mean square, and
``haus``, the largest; in diagonals of the original, and by no code of this package. Ratios are those of *refitted* to
the best of all tools for each number by itself, and of *subset* to the best of those that choose among the vertices.
Self-intersecting faces are MeshLab's; a face is reversed if its normal looks away from that of the original face that
is nearest to its centre. Rims are compared all along, the nearest point of any rim of the other mesh. ``-o FILE.csv``
writes all numbers, ``-o FILE.md`` the tables.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import importlib.util
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from closed_scans import rim_distance, whole_scan
from pymoo.optimize import minimize
from rich.console import Console
from rich.table import Table

from meshsimp_pymoo import Front, FrontSolution, MeshProblem, Moves, memetic, simplify_to
from meshsimp_pymoo.comparison.baselines import BASELINES, largest_at_most
from meshsimp_pymoo.comparison.meshlab import load_pymeshlab
from meshsimp_pymoo.errors import InputError, Missed, ToolUnavailable
from meshsimp_pymoo.surface.closed.model import topology
from meshsimp_pymoo.surface.closed.nearest import distances_to_mesh

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
# With sharp edges, which meshes of a Delaunay rule cut off.
CAD = ("c_fandisk", "bracket")
SHARP, TOLERANCES = "sharp:30", ("4e-3", "1e-3", "5e-4", "1e-4")
GROUPS = {
    "closed": (
        *("c_spot", "c_homer", "c_cheburashka", "c_fandisk"),
        *("blob:20000,seed=2", "blob:35000,seed=5,bumps=0.2,stretch=3"),
    ),
    "holes": ("c_bunny", "blob:5000,holes=5", "blob:20000,holes=1,seed=3"),
    "whole": tuple(
        f"whole:{name}"
        for name in (
            *("m1_laurana", "m2_demosthenes", "m3_nefertiti", "m4_skull", "m5_celticskull"),
            "l_laurana_front",
        )
    ),
    "parts": ("pebbles", "pebbles:12000,parts=5,seed=4"),
    # the finer the mesh, the finer its lines: their tolerance is as the error that it has
    "cad": tuple(name + lines for name in CAD for lines in ("", *(f"+{SHARP}@{share}" for share in TOLERANCES))),
}
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
# Only of models with holes.
BORDER_TOOLS = tuple(name for name, known in BASELINES.items() if known.at_borders)
LABELS = {BASELINES[name].label: BASELINES[name] for name in (*TOOLS, *BORDER_TOOLS)}
REFITTED, SUBSET = "refitted", "subset"
MEASURED = ("vmean", "smean", "srms", "haus")
RIM_HEAD = ("rims", "rim mean", "rim largest")
# What the ratios are to be at most, in the geometric mean over all models and sizes.
GOALS = {(REFITTED, "smean"): 0.80, (REFITTED, "srms"): 0.90, (SUBSET, "smean"): 0.70}
# What they are to be at most of each model, in the geometric mean over its sizes; of the largest deviation where the
# sharp edges are break lines.
GOALS_OF_EACH = {"smean": 0.85, "haus": 1.2}
CONSOLE = Console(width=140)

Mesh = tuple[np.ndarray, np.ndarray]
Measure = Callable[[str, str, int], dict[str, float]]


@dataclass(frozen=True)
class Row:
    """What was measured of one mesh: distances in diagonals; of a tool's there are no lines."""

    model: str
    lines: str
    vertices: int
    share: float
    method: str
    triangles: int
    vmean: float
    smean: float
    srms: float
    haus: float
    original_rims: int
    rims: int
    rim_mean: float
    rim_max: float
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


def model_of(name: str, shared: Path) -> trimesh.Trimesh | Path | str:
    """Return what a problem is made of by the name of a model."""
    kind, _, file = name.rpartition("whole:")
    path = shared / f"{file}.ply"
    if not kind and file == name:
        return path if path.is_file() else name
    if not path.is_file():
        raise InputError(f"{path}: is no file; name one of that folder without .ply")
    front = trimesh.load(path, process=False)
    points, faces = whole_scan(np.asarray(front.vertices, float), np.asarray(front.faces))
    return trimesh.Trimesh(points, faces, process=False)


def of_tool(problem: MeshProblem, name: str, size: int) -> tuple[Mesh, float]:
    """Return a tool's largest mesh of at most so many triangles, and its seconds."""
    tool = BASELINES[name].tool
    assert tool is not None
    return largest_at_most(tool(problem.model), size, len(problem.model.faces))


def ours(problem: MeshProblem, sizes: dict[float, int], options: argparse.Namespace) -> Iterator[tuple]:
    """Yield (share, method, mesh, seconds) of our meshes."""
    front, shared_time = None, 0.0
    budget = {"moves": options.moves} if options.moves else {"time": options.seconds}
    if options.whole:
        start = time.perf_counter()
        until = Moves(options.moves) if options.moves else ("time", options.seconds)
        front = Front.from_result(minimize(problem, memetic(), until, seed=options.seed))
        shared_time = time.perf_counter() - start
    for share, size in sizes.items():
        start = time.perf_counter()
        try:
            if front is None:
                found = simplify_to(problem, triangles=size, seed=options.seed, **budget)
            else:
                found = front.best(triangles=size)
        except (Missed, InputError) as reason:  # lines need more, say
            say(f"{share:g} %: {reason}")
            continue
        searched = shared_time or time.perf_counter() - start
        yield share, SUBSET, own_mesh(found), searched
        start = time.perf_counter()
        fitted = refitted_mesh(found)
        yield share, REFITTED, fitted, searched + time.perf_counter() - start


def own_mesh(found: FrontSolution) -> Mesh:
    """Return the mesh of a solution."""
    used, corners = np.unique(found.faces, return_inverse=True)
    return found.front.model.file_points[used], corners.reshape(-1, 3)


def refitted_mesh(found: FrontSolution) -> Mesh:
    """Return the mesh of a solution, its vertices moved to where they fit best."""
    fitted = found.refit()
    return fitted.vertices, np.searchsorted(fitted.rows, fitted.faces)


def lines_of(spelled: str, diagonal: float) -> dict[str, Any]:
    """Return what a problem is told of break lines."""
    what, _, share = spelled.partition("@")
    told: dict[str, Any] = {"break_lines": what} if what else {}
    return told | ({"line_tolerance": float(share) * diagonal} if share else {})


def compared(
    name: str, lines: list[str], options: argparse.Namespace, measure: Measure, folder: Path
) -> Iterator[list[Row]]:
    """Yield the rows of one model: ours, without and with lines as asked for, and those of each tool."""
    source = model_of(name, options.shared)
    plain = MeshProblem(source, surface="closed", weights=options.weights)
    model = plain.model
    whole = model.file_points, model.faces
    diagonal = float(np.linalg.norm(np.ptp(model.file_points, axis=0)))
    n_rims = topology(model.faces).loops
    sizes = {share: int(share / 100 * len(model.faces)) // 2 * 2 for share in options.shares}
    original = write_obj(folder / "original.obj", *whole)

    def row(of: str, share: float, method: str, mesh: Mesh, seconds: float) -> Row:
        path = write_obj(folder / "simplified.obj", *mesh)
        found = measure(original, path, options.samples)
        counts = len(mesh[1]), *(found[what] for what in MEASURED)
        largest, mean = rim_distance(whole, mesh)
        rims = n_rims, topology(mesh[1]).loops, mean / diagonal, largest / diagonal
        faults = intersecting(*mesh), reversed_faces(plain, *mesh)
        return Row(name, of, model.n_vertices, share, method, *counts, *rims, *faults, round(seconds, 2))

    for of in lines:
        say(f"{name}: {model.n_vertices:,} vertices{', ' * bool(of)}{of}, searched")
        try:
            problem = MeshProblem(source, surface="closed", weights=options.weights, **lines_of(of, diagonal))
        except InputError as reason:
            say(f"left out: {reason}")
            continue
        yield [row(of, *found) for found in ours(problem, sizes, options)]
    for tool in (*TOOLS, *(BORDER_TOOLS if n_rims else ())):
        label = BASELINES[tool].label
        say(f"{name}: {label}")
        try:
            made = {share: of_tool(plain, tool, size) for share, size in sizes.items()}
        except ToolUnavailable as reason:
            say(f"{name}: left out: {reason}")
            continue
        for share, (mesh, _) in made.items():
            if len(mesh[1]) > sizes[share]:
                say(f"{name}: {label} at {share:g} % left out: has {len(mesh[1]):,} triangles, not {sizes[share]:,}")
        yield [
            row("", share, label, mesh, seconds)
            for share, (mesh, seconds) in made.items()
            if len(mesh[1]) <= sizes[share]
        ]


def rivals(rows: list[Row], row: Row) -> list[Row]:
    """Return the rows of the tools that a mesh of ours is measured by: at its model and size."""
    labels = {label for label, known in LABELS.items() if row.method == REFITTED or known.own_vertices}
    return [r for r in rows if (r.model, r.share) == (row.model, row.share) and r.method in labels]


def ratio(rows: list[Row], row: Row, what: str) -> float:
    """Return a number of ours over the best of the tools' at equal triangles; NaN without any tool."""
    others = [getattr(other, what) for other in rivals(rows, row)]
    return getattr(row, what) / min(others) if others else np.nan


def mesh_table(rows: list[Row], name: str) -> list[list[str]]:
    """Return the table of one model: what was measured of each mesh, in 1e-4 of the diagonal."""
    own = [row for row in rows if row.model == name]
    at_rims = RIM_HEAD if any(row.original_rims for row in own) else []
    table = [["%", "method", "triangles", *MEASURED, *at_rims, "intersecting", "reversed", "seconds"]]
    for row in sorted(own, key=lambda r: r.share):
        numbers = [f"{1e4 * getattr(row, what):.4g}" for what in MEASURED]
        if at_rims:
            away = [f"{1e4 * value:.4g}" for value in (row.rim_mean, row.rim_max)]
            numbers += [f"{row.rims} of {row.original_rims}", *away]
        faults = [str(row.intersecting), str(row.reversed), f"{row.seconds:.2f}"]
        table.append([f"{row.share:g}", named(row.method, row.lines), str(row.triangles), *numbers, *faults])
    return table


def named(what: str, lines: str) -> str:
    return f"{what}, {lines}" if lines else what


def own_rows(rows: list[Row], method: str) -> dict[tuple[str, str], list[Row]]:
    """Return our rows of a method, by model and lines."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.method == method:
            found.setdefault((row.model, row.lines), []).append(row)
    return found


def geometric_mean(values: Iterable[float]) -> float:
    return float(np.exp(np.mean(np.log(list(values)))))


def ratio_table(rows: list[Row]) -> list[list[str]]:
    """Return the ratios of ours to the best tools, and their geometric means."""
    table = [["model", "%", *(f"{method} {what}" for method in (REFITTED, SUBSET) for what in MEASURED)]]
    found: dict[tuple[str, str], list[float]] = {}
    subsets = own_rows(rows, SUBSET)
    for key, refitted in own_rows(rows, REFITTED).items():
        for one, two in zip(refitted, subsets[key], strict=True):
            ratios = {(own.method, what): ratio(rows, own, what) for own in (one, two) for what in MEASURED}
            for what, value in ratios.items():
                found.setdefault(what, []).append(value)
            table.append([named(*key), f"{one.share:g}", *(f"{value:.3f}" for value in ratios.values())])
    table.append(["geometric mean", "", *(f"{geometric_mean(values):.3f}" for values in found.values())])
    table.append(["at most", "", *(f"{GOALS[key]:.2f}" if key in GOALS else "" for key in found)])
    return table


def rim_table(rows: list[Row]) -> list[list[str]]:
    """Return how far rims are off in ours and in the meshes of the tool of the least symmetric mean distance."""
    table = [["model", "%", *(f"{REFITTED} {what}" for what in RIM_HEAD), "tool", *RIM_HEAD]]
    for key, refitted in own_rows(rows, REFITTED).items():
        for row in refitted:
            others = rivals(rows, row)
            if not row.original_rims or not others:
                continue
            best = min(others, key=lambda other: other.smean)
            numbers = (
                [f"{r.rims} of {r.original_rims}", f"{1e4 * r.rim_mean:.4g}", f"{1e4 * r.rim_max:.4g}"]
                for r in (row, best)
            )
            own, other = numbers
            table.append([named(*key), f"{row.share:g}", *own, best.method, *other])
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


def best_of_lines(own: list[Row]) -> list[Row]:
    """Return one row for each size: of several with lines the one of the least symmetric mean; of CAD only those."""
    found: dict[float, Row] = {}
    for row in own:
        if row.lines or row.model not in CAD:
            found[row.share] = min(row, found.get(row.share, row), key=lambda r: r.smean)
    return list(found.values())


def verdicts(rows: list[Row]) -> list[str]:
    """Say where a refitted mesh is worse than the best tool's, and which models miss what is wanted of each."""
    refitted = own_rows(rows, REFITTED)
    found = [(key, row) for key, own in refitted.items() for row in own if key[0] not in CAD or key[1]]
    above = [f"{named(*key)} at {row.share:g} %" for key, row in found if ratio(rows, row, "smean") > 1.0]
    said = [
        f"Refitted, symmetric mean distance above that of the best tool (but for {', '.join(CAD)} without lines): "
        f"{', '.join(above) or 'none'}"
    ]
    for what, most in GOALS_OF_EACH.items():
        missed = []
        for model in dict.fromkeys(model for model, _ in refitted):
            own = best_of_lines([row for (name, lines), own in refitted.items() if name == model for row in own])
            if not own or (what == "haus" and model not in CAD):
                continue
            ratios = [ratio(rows, row, what) for row in own]
            if (mean := geometric_mean(ratios)) > most:
                sizes = (
                    f"{r:.3f} at {named(f'{row.share:g} %', row.lines)}" for r, row in zip(ratios, own, strict=True)
                )
                missed.append(f"{model} {mean:.3f} ({'; '.join(sizes)})")
        of = f"of {', '.join(CAD)} with lines" if what == "haus" else "of each model"
        said.append(f"Refitted, {what} {of} over {most:g} of the best tool's: {'; '.join(missed) or 'none'}")
    return said


def sheets(rows: list[Row]) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield all tables with their titles."""
    for name in dict.fromkeys(row.model for row in rows):
        n = next(row.vertices for row in rows if row.model == name)
        yield f"{name}: {n:,} vertices; distances in 1e-4 of the diagonal", mesh_table(rows, name)
    yield "Ours over the best of the tools at equal triangles", ratio_table(rows)
    if any(row.original_rims for row in rows):
        title = (
            "How far the rims are off, beside the tool of the least symmetric mean distance; in 1e-4 of the diagonal"
        )
        yield title, rim_table(rows)
    yield "Faces that go through others, and that are reversed", fault_table(rows)


def show(rows: list[Row]) -> None:
    for title, table in sheets(rows):
        shown = Table(*table[0], title=title, title_justify="left")
        for line in table[1:]:
            shown.add_row(*line)
        CONSOLE.print(shown)
    for line in verdicts(rows):
        CONSOLE.print(line, highlight=False)


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
    path.write_text("\n".join([*lines, "", *(f"* {line}" for line in verdicts(rows)), ""]), encoding="utf-8")


def main(argv: list[str] | None = None) -> int:
    """Do what the options say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--referee", type=Path, required=True, metavar="FILE", help="the program that measures")
    text = f"names of models, see above, or of groups: {', '.join(GROUPS)}; default: closed"
    parser.add_argument("--models", nargs="+", default=("closed",), metavar="MODEL", help=text)
    text = "folder with the models of others; default: ../shared/data beside the checkout"
    parser.add_argument("--shared", type=Path, default=SHARED, metavar="DIR", help=text)
    text = "percent of the triangles; default: 2 5 10 20"
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES, metavar="P", help=text)
    text = f"of search for each mesh, or for the whole front (default: {SECONDS:g})"
    parser.add_argument("--seconds", type=float, default=SECONDS, metavar="S", help=text)
    parser.add_argument("--moves", type=int, default=0, metavar="M", help="of search instead of seconds")
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
    budget = f"{options.moves:,} moves" if options.moves else f"{options.seconds:g} s of search"
    said = f"{budget} for {how}{weighted}, seed {options.seed}; {options.samples:,} samples."
    simplify_to("sphere:100", triangles=40, moves=1000).refit()  # compiled before anything is timed
    asked: dict[str, list[str]] = {}
    for name in (part for model in options.models for part in GROUPS.get(model, (model,))):
        model, _, lines = name.partition("+")
        asked.setdefault(model, []).append(lines)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as place:
        for name, lines_of in asked.items():
            try:
                for found in compared(name, lines_of, options, measure, Path(place)):
                    rows += found
            except InputError as problem:
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
