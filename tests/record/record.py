"""The record of results: what this program finds, number by number, for some twenty combinations of its parts.

Restructuring must not move a byte of it, and an issue that changes results by intent re-records the rows it changes
and says why::

    python tests/record/record.py --against ../other      # this checkout and another one, row by row
    python tests/record/record.py                         # this checkout and record.json
    python tests/record/record.py --write                 # record.json anew (rows that changed are named)
    python tests/record/record.py --rows tiled presets    # some rows only

Each row is one SHA-256 of all that is to stay: ``front.csv``, ``front.npz``, ``series.csv`` and every mesh of a
simplification, the tables of an experiment, F and X of a search in Python. Budgets are in generations or evaluations,
so that a row depends on nothing but the code, the versions of NumPy, pymoo and Numba, and, in the last digit of
functions such as exp, on the processor: compare two checkouts where `record.json` was made elsewhere.

The rows use the shell commands and public names only, so that one script drives checkouts of any structure.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve()
ROOT = HERE.parents[2]
RECORD = HERE.with_name("record.json")
# What of a folder of results is no result: it holds the time taken, the name of the folder, a picture or a statement of
# the rest.
UNRECORDED = ("run.json", "report.html", "front.png", "quality.json", "quality.html", "times.csv", ".lock")

ROWS: dict[str, Callable[[], str]] = {}


def row(make: Callable[[], str]) -> Callable[[], str]:
    """Add a function to the rows, under its name."""
    ROWS[make.__name__] = make
    return make


def folder_hash(folder: str | Path, *, only: tuple[str, ...] = ()) -> str:
    """Return the hash of the files below a folder that are results, by name and content."""
    digest = hashlib.sha256()
    for path in sorted(Path(folder).rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and path.name not in UNRECORDED and (not only or name.startswith(only)):
            digest.update(f"{name}\n".encode())
            digest.update(_without_keys(path) if path.name == "runs.csv" else path.read_bytes())
    return digest.hexdigest()


def _without_keys(path: Path) -> bytes:
    """Return a table of runs without its keys: those are hashes of what a run is, class names included, no results."""
    with path.open(newline="", encoding="utf-8") as file:
        heading, *lines = list(csv.reader(file))
    at = [place for place, column in enumerate(heading) if column != "key"]
    return json.dumps([[line[k] for k in at] for line in [heading, *lines]]).encode()


def meshsimp(*words: Any) -> None:
    """Run a shell command in this process; it has to succeed."""
    from meshsimp_pymoo.cli import main

    code = main([str(word) for word in words])
    if code != 0:
        raise RuntimeError(f"meshsimp {' '.join(map(str, words))} ended with {code}")


def simplified(*words: Any) -> str:
    """Simplify into the folder ``out`` and return the hash of what it holds."""
    meshsimp("simplify", *words, "-o", "out", "-q")
    return folder_hash("out")


def front_hash(result: Any) -> str:
    """Return the hash of the optimum of a search in Python: objectives and subsets, in a fixed order."""
    import numpy as np

    F, X = np.atleast_2d(result.F), np.atleast_2d(result.X)
    order = np.lexsort([*np.packbits(X, axis=1).T, *F.T])
    return hashlib.sha256(F[order].astype(float).tobytes() + np.packbits(X[order], axis=1).tobytes()).hexdigest()


# ------------------------------------------------------------------------------------------------ simplify, by preset


@row
def memetic_terrain() -> str:
    return simplified("jacksboro:21", "--population", 30, "--generations", 3, "--pick", "knee")


@row
def memetic_hull_ignore() -> str:
    rules = ("--footprint", "hull", "--outside", "ignore", "--pin", "hull")
    return simplified("horseshoe:150", "--population", 20, "--generations", 3, *rules)


@row
def memetic_bays_and_holes() -> str:
    return simplified("ring:200", "--population", 20, "--generations", 3, "--format", "obj")


@row
def nsga2_v1_model_ignore() -> str:
    return simplified("horseshoe:150", "--algorithm", "nsga2_v1", "--evaluations", 2000, "--outside", "ignore")


@row
def nsga2_v2_hull_nearest() -> str:
    words = ("--algorithm", "nsga2_v2", "--generations", 15, "--footprint", "hull", "--pin", "3,17")
    return simplified("ring:200", *words, "--format", "off")


@row
def moead_face() -> str:
    return simplified("face:300", "--algorithm", "moead", "--generations", 15, "--format", "stl", "--meshes", "all")


# --------------------------------------------------------------------------------------------------------- break lines


@row
def soft_lines_free() -> str:
    winding = [[1200 * k, -900 * k + (-1) ** k * 400] for k in range(1, 24)]
    lines = {"type": "MultiLineString", "coordinates": [winding, [[2000, -30000], [15000, -29000], [29000, -27000]]]}
    Path("lines.json").write_text(json.dumps(lines), encoding="utf-8")
    words = ("--break-lines", "lines.json", "--line-tolerance", 20, "--free", "--format", "obj")
    return simplified("jacksboro:21", "--population", 20, "--generations", 3, *words)


@row
def outline_refitted() -> str:
    lines = ("--break-lines", "outline", "--line-tolerance", 0.02)
    return simplified("horseshoe:150", "--algorithm", "nsga2_v1", "--evaluations", 1000, *lines, "--refit")


# ------------------------------------------------------------------------------------------- measures, refit, weights


@row
def rms_refitted() -> str:
    words = ("--measure", "rms", "--refit", "--population", 12, "--generations", 2, "--triangles", 60)
    return simplified("peaks:17", *words, "--format", "landxml")


@row
def maximum() -> str:
    words = ("--measure", "max", "--algorithm", "nsga2_v1", "--evaluations", 1500, "--max-error", 0.2)
    return simplified("crater:17", *words, "--format", "glb")


@row
def weights_and_colours() -> str:
    import trimesh

    from meshsimp_pymoo import MeshProblem

    mesh = MeshProblem("face:250").mesh(MeshProblem("face:250").pinned | True)
    n = len(mesh.vertices)
    lines = ["ply", "format ascii 1.0", f"element vertex {n}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += ["property uchar red", "property uchar green", "property uchar blue", "property float importance"]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    for k, (x, y, z) in enumerate(mesh.vertices.tolist()):
        lines.append(f"{x!r} {y!r} {z!r} {k % 256} {(7 * k) % 256} {(13 * k) % 256} {(k % 5) / 2}")
    lines += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    Path("face.ply").write_text("\n".join(lines) + "\n", encoding="ascii")
    assert isinstance(mesh, trimesh.Trimesh)
    words = ("--population", 15, "--generations", 2, "--weights", "importance", "--max-error", 20)
    return simplified("face.ply", *words)


# -------------------------------------------------------------------------------------------------------------- files


@row
def grid_with_gaps() -> str:
    import numpy as np

    rows, columns = np.mgrid[0:24, 0:30]
    heights = np.round(40 * np.cos(rows / 5.0) * np.cos(columns / 4.0)).astype(np.int16)
    heights[8:12, 9:14] = -999
    np.save("grid.npy", heights)
    words = ("--nodata=-999", "--spacing", "2,3", "--window", "2,1,26,20", "--population", 12, "--generations", 2)
    return simplified("grid.npy", *words)


@row
def ascii_grid_upright_mesh() -> str:
    import numpy as np

    rows, columns = np.mgrid[0:17, 0:19]
    heights = (rows * columns % 7) + rows
    head = "ncols 19\nnrows 17\nxllcorner 500000\nyllcorner 4000000\ncellsize 10\n"
    Path("grid.asc").write_text(head + "\n".join(" ".join(map(str, line)) for line in heights) + "\n", encoding="ascii")
    return simplified("grid.asc", "--population", 10, "--generations", 2, "--format", "glb")


@row
def cloud_with_bays() -> str:
    k = [i * 0.6180339887498949 % 1.0 for i in range(400)]
    points = [(100 * i / 400, 60 * u, 10 * (u - 0.5) ** 2 + i / 100) for i, u in enumerate(k)]
    points = [p for p in points if not (30 < p[0] < 60 and p[1] > 25)]
    Path("cloud.xyz").write_text("\n".join(" ".join(map(repr, p)) for p in points) + "\n", encoding="ascii")
    return simplified("cloud.xyz", "--max-edge", 14, "--population", 12, "--generations", 2)


@row
def patch_of_a_closed_mesh() -> str:
    import trimesh

    trimesh.creation.icosphere(subdivisions=3).export("ball.ply")
    return simplified("ball.ply", "--patch", "front", "--up", "y", "--population", 12, "--generations", 2)


# -------------------------------------------------------------------------------------------------------------- tiles


@row
def tiled() -> str:
    words = ("--tile", 64, "--triangles", 900, "--meshes", 6, "--jobs", 1)
    meshsimp("simplify", "jacksboro:3", *words, "-o", "out", "-q")
    meshsimp("pick", "out", "--triangles", 350, "-o", "small.ply", "-q")
    return hashlib.sha256((folder_hash("out") + _file_hash("small.ply")).encode()).hexdigest()


@row
def tiled_pieces() -> str:
    import numpy as np

    rows, columns = np.mgrid[0:150, 0:170]
    np.save("grid.npy", np.sin(rows / 9.0) * np.cos(columns / 7.0) + (rows * columns % 5) * 1e-3)
    words = ("--tile", 64, "--pick", "knee", "--pieces", "--jobs", 1, "--format", "off", "--meshes", "none")
    return simplified("grid.npy", *words)


# -------------------------------------------------------------------------------------------------------- experiments

EXPERIMENT = """\
title: record
problems:
  - {name: Terrain, model: "jacksboro:41"}
  - {name: Hull, model: "horseshoe:150", footprint: hull, outside: ignore, pin: hull}
  - {name: Root, model: "ring:150", outside: ignore, objectives: [rms_error, triangles]}
algorithms:
  - nsga2_v1
  - {name: Two, preset: nsga2_v2, parameters: {pop_size: 40}}
  - moead
  - {name: GA 1, preset: weighted_ga_v1, parameters: {pop_size: 30}, merged_over: {w: [0, 0.5, 1]}}
  - {name: GA 2, preset: weighted_ga_v2, parameters: {pop_size: 30}, merged_over: {w: [0.2, 0.8]}}
  - {preset: memetic, parameters: {pop_size: 12}}
  - name: SPEA2
    class: pymoo.algorithms.moo.spea2.SPEA2
    parameters: {pop_size: 30}
    operators: {crossover: half_plane}
seeds: [1, 2]
budgets: [{generations: 4}, {evaluations: 300}, {moves: 20000}]
"""


@row
def presets() -> str:
    Path("record.yaml").write_text(EXPERIMENT, encoding="utf-8")
    meshsimp("run", "record.yaml", "-o", "out", "--jobs", 1, "-q")
    return folder_hash("out", only=("tables/",))


@row
def meshlab() -> str:
    text = EXPERIMENT.split("algorithms:")[0] + "algorithms: [nsga2_v1]\nseeds: [1]\nbudgets: [{generations: 3}]\n"
    Path("record.yaml").write_text(text + "baselines: {methods: meshlab, steps: 4}\n", encoding="utf-8")
    meshsimp("run", "record.yaml", "-o", "out", "--jobs", 1, "-q")
    return folder_hash("out", only=("tables/",))


# ---------------------------------------------------------------------------------------------------------- in Python


@row
def three_objectives() -> str:
    from pymoo.optimize import minimize

    from meshsimp_pymoo import MeshProblem, nsga3

    problem = MeshProblem("crater:17", objectives=("error", "max_error", "triangles"))
    return front_hash(minimize(problem, nsga3(), ("n_gen", 12), seed=3))


@row
def every_operator() -> str:
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.optimize import minimize

    from meshsimp_pymoo import (
        OAX,
        HalfPlaneCrossover,
        MeshProblem,
        NeighbourShift,
        NestedSubsets,
        PackedDuplicates,
        PinnedCorners,
        RandomSubset,
        RegionCrossover,
        Relocation,
        SizeStep,
        SubsetUniformCrossover,
    )

    problem = MeshProblem("face:200", regions=32, pin=[[0.0, 30.0]], max_triangles=300)
    mixes = [
        (NestedSubsets(random_share=0.3), RegionCrossover(), Relocation(max_moves=20_000)),
        (RandomSubset(), HalfPlaneCrossover(), SizeStep()),
        (RandomSubset(), OAX("L8"), NeighbourShift(along="mesh", prob_var=0.05)),
        (NestedSubsets((10, 200)), SubsetUniformCrossover(), NeighbourShift()),
    ]
    digest = hashlib.sha256()
    for sampling, crossover, mutation in mixes:
        algorithm = NSGA2(
            pop_size=24,
            sampling=sampling,
            crossover=crossover,
            mutation=mutation,
            repair=PinnedCorners(),
            eliminate_duplicates=PackedDuplicates(),
        )
        digest.update(front_hash(minimize(problem, algorithm, ("n_gen", 5), seed=7)).encode())
    return digest.hexdigest()


@row
def weighted_in_python() -> str:
    import numpy as np
    from pymoo.optimize import minimize

    from meshsimp_pymoo import MeshProblem, memetic

    weights = np.arange(289) % 3.0
    problem = MeshProblem("roof", weights=weights, pin=[5, 40], footprint="hull")
    return front_hash(minimize(problem, memetic(12), ("n_gen", 3), seed=2))


@row
def other_meshes() -> str:
    """Numbers of a mesh that is no subset, and of the same mesh beside a front."""
    import contextlib
    import io

    meshsimp("simplify", "horseshoe:150", "-o", "out", "-q", "--algorithm", "nsga2_v1", "--evaluations", 400)
    meshsimp("pick", "out", "--triangles", 80, "-o", "other.off", "-q")
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        for words in ((), ("--outside", "ignore"), ("--front", "out")):
            meshsimp("score", "horseshoe:150", "other.off", *words, "--json")
        meshsimp("info", "other.off", "--json")
    return hashlib.sha256(text.getvalue().encode()).hexdigest()


def _file_hash(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


# ------------------------------------------------------------------------------------------------------- running them


def produce(names: list[str]) -> None:
    """Print the hash of each row, made by the checkout that this process imports: one JSON line a row."""
    import warnings

    warnings.simplefilter("ignore")
    for name in names:
        with tempfile.TemporaryDirectory() as scratch:
            os.chdir(scratch)
            try:
                value = ROWS[name]()
            except Exception as problem:
                value = f"{type(problem).__name__}: {problem}"
            os.chdir(ROOT)
        print(json.dumps([name, value]), flush=True)


def rows_of(checkout: Path, names: list[str]) -> dict[str, str]:
    """Let a checkout make rows, in a process of its own."""
    code = f"import sys; sys.path.insert(0, {str(HERE.parent)!r}); import record; record.produce(sys.argv[1:])"
    environment = os.environ | {"PYTHONPATH": str(checkout), "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"}
    check = subprocess.run(
        [sys.executable, "-c", "import meshsimp_pymoo; print(meshsimp_pymoo.__file__)"],
        env=environment, cwd=checkout, capture_output=True, text=True, check=True,
    )  # fmt: skip
    if not Path(check.stdout.strip()).is_relative_to(checkout):
        sys.exit(f"{checkout}: Python imports {check.stdout.strip()} instead")
    found: dict[str, str] = {}
    with subprocess.Popen(
        [sys.executable, "-c", code, *names], env=environment, cwd=checkout, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("["):
                name, value = json.loads(line)
                found[name] = value
    return found


def main() -> int:
    """Compare, or record."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="another checkout, in place of record.json")
    parser.add_argument("--rows", nargs="+", choices=list(ROWS), default=list(ROWS), metavar="ROW")
    parser.add_argument("--write", action="store_true", help="write record.json")
    args = parser.parse_args()
    here = rows_of(ROOT, args.rows)
    recorded = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    there = recorded if args.against is None else rows_of(args.against.resolve(), args.rows)
    different = [name for name in args.rows if here.get(name) != there.get(name) or len(here.get(name, "")) != 64]
    for name in args.rows:
        print(f"{'DIFFERENT' if name in different else 'equal':<10} {name}  {here.get(name, 'nothing')[:100]}")
    print(f"{len(args.rows) - len(different)} of {len(args.rows)} rows are equal")
    if args.write:
        RECORD.write_text(json.dumps(recorded | here, indent=1) + "\n", encoding="utf-8")
        return 0
    return 1 if different else 0


if __name__ == "__main__":
    raise SystemExit(main())
