"""What an open scan is better taken for, a height field or a closed surface with holes: both, at equal triangles.

``python tests/benchmarks/closed_or_height.py --referee FILE`` takes front patches, which pass for both, and at 2, 5, 10
and 20 % of their triangles asks for one mesh of each surface, ``--seconds`` or ``--moves`` of search each, and moves
its vertices to where they fit best (*refitted*). Of all meshes:

* the mean vertical distance of the original's vertices, as heights are measured (the vertices that are uncovered by
  their distance in space), and how many are uncovered;
* the symmetric mean distance and the largest, by the referee, whose FILE is that of ``closed.py``;
* how far the rims are off. Lengths are in 1e-4 of the diagonal.

``-o FILE.md`` writes the tables too.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from closed import CONSOLE, SAMPLES, SHARED, SHARES, Measure, Mesh, own_mesh, referee_of, refitted_mesh, say, write_obj
from closed_scans import rim_distance
from rich.table import Table

from meshsimp_pymoo import MeshProblem, simplify_to
from meshsimp_pymoo.errors import InputError, Missed
from meshsimp_pymoo.surface.closed.model import topology

MODELS = ("m1_laurana", "m4_skull", "f_mask_holes")
SURFACES = ("height", "closed")
HEAD = [
    *("%", "mesh", "triangles", "vertical mean", "uncovered", "symmetric mean", "largest"),
    *("rims", "rim mean", "rim largest", "seconds"),
]


def searched(problem: MeshProblem, size: int, options: argparse.Namespace) -> Iterator[tuple[str, Mesh, float]]:
    """Yield what ours is called, the mesh, and the seconds, before and after refit."""
    start = time.perf_counter()
    budget = {"moves": options.moves} if options.moves else {"time": options.seconds}
    found = simplify_to(problem, triangles=size, seed=options.seed, **budget)
    yield "", own_mesh(found), time.perf_counter() - start
    fitted = refitted_mesh(found)
    yield ", refitted", fitted, time.perf_counter() - start


def compared(path: Path, options: argparse.Namespace, measure: Measure, folder: Path) -> list[list[str]]:
    """Return the table of one model."""
    problems = {kind: MeshProblem(path, surface=kind) for kind in SURFACES}
    model = problems["height"].model
    whole = model.file_points, model.faces
    diagonal = float(np.linalg.norm(np.ptp(model.file_points, axis=0)))
    original = write_obj(folder / "original.obj", *whole)
    table = [HEAD]
    for share in options.shares:
        size = int(share / 100 * len(model.faces))
        for kind, problem in problems.items():
            say(f"{path.stem}: {share:g} %, {kind}")
            try:
                for state, mesh, seconds in searched(problem, size, options):
                    quality = problems["height"].surface.score(*mesh).quality
                    found = measure(original, write_obj(folder / "simplified.obj", *mesh), options.samples)
                    largest, mean = rim_distance(whole, mesh)
                    lengths = quality.mean_error / diagonal, found["smean"], found["haus"], mean / diagonal
                    vertical, smean, haus, rim_mean, rim_max = (
                        f"{1e4 * x:.4g}" for x in (*lengths, largest / diagonal)
                    )
                    rims = f"{topology(mesh[1]).loops} of {topology(model.faces).loops}"
                    line = [
                        f"{share:g}",
                        kind + state,
                        str(len(mesh[1])),
                        vertical,
                        str(quality.uncovered),
                        smean,
                        haus,
                    ]
                    table.append([*line, rims, rim_mean, rim_max, f"{seconds:.1f}"])
            except Missed as reason:
                say(f"{path.stem}: left out: {reason}")
    return table


def main(argv: list[str] | None = None) -> int:
    """Do what the options say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--referee", type=Path, required=True, metavar="FILE", help="the program that measures")
    text = f"files of the folder without .ply; default: {' '.join(MODELS)}"
    parser.add_argument("--models", nargs="+", default=MODELS, metavar="MODEL", help=text)
    text = "folder with the models; default: ../shared/data beside the checkout"
    parser.add_argument("--shared", type=Path, default=SHARED, metavar="DIR", help=text)
    text = "percent of the triangles; default: 2 5 10 20"
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES, metavar="P", help=text)
    parser.add_argument("--seconds", type=float, default=20.0, metavar="S", help="of search for each mesh; default: 20")
    parser.add_argument("--moves", type=int, default=0, metavar="M", help="of search instead of seconds")
    parser.add_argument("--seed", type=int, default=1, metavar="K", help="of the searches; default: 1")
    text = f"of the referee on each of the two meshes; default: {SAMPLES:,}"
    parser.add_argument("--samples", type=int, default=SAMPLES, metavar="K", help=text)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.md", help="write the tables too")
    options = parser.parse_args(argv)
    measure = referee_of(options.referee)
    for surface in SURFACES:  # compiled before anything is timed
        simplify_to(MeshProblem("ring:100", surface=surface), triangles=60, moves=1000).refit()
    lines = ["# A height field or a closed surface with holes\n"]
    with tempfile.TemporaryDirectory() as place:
        for name in options.models:
            try:
                table = compared(options.shared / f"{name}.ply", options, measure, Path(place))
            except InputError as problem:
                say(f"left out: {problem}")
                continue
            shown = Table(*table[0], title=name, title_justify="left")
            for line in table[1:]:
                shown.add_row(*line)
            CONSOLE.print(shown)
            rows = ["| " + " | ".join(line) + " |" for line in table]
            lines += [f"\n## {name}\n", rows[0], "|" + "---|" * len(HEAD), *rows[1:]]
            if options.output is not None:
                options.output.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return 0 if len(lines) > 1 else 1


if __name__ == "__main__":
    sys.exit(main())
