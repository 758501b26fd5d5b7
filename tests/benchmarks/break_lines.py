"""What break lines cost and what they are worth.

``python tests/benchmarks/break_lines.py`` compares searches of equal moves on the built-in ``embankment``, at a few
numbers of triangles:

* its four lines of 201 vertices thinned to a tolerance and forced; no lines; all vertices of the lines pinned, as who
  has no better way does; the same subsets as those with lines, with no edge forced,
* the error over that of the search without lines, the largest and the mean error along the lines, how many of the
  lines' edges the mesh has, and the smallest mesh there can be.

``--dem FILE.npz`` does the same with the streams of a terrain: each sample drains to the lowest of its eight
neighbours once pits are filled (priority flood [1]_), and streams are what at least ``CELLS`` samples drain through.
They are soft: their heights are the terrain's.

References
----------
.. [1] R. Barnes, C. Lehman, D. Mulla, "Priority-flood: An optimal depression-filling and watershed-labeling algorithm
   for digital elevation models", Computers & Geosciences 62, 2014.
"""

from __future__ import annotations

import argparse
import dataclasses
import heapq
import itertools
from pathlib import Path

import numpy as np
from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem, Moves, memetic
from meshsimp_pymoo.datasets import load_lines
from meshsimp_pymoo.surface.height import HeightSurface

#: Samples that drain through a stream, at least.
CELLS = 500


def drained(heights):
    """Return which sample each of (R, C) drains to, -1 for out, and their order from the outlets on."""
    rows, columns = heights.shape
    n = rows * columns
    flat = heights.ravel()
    to, order, seen = np.full(n, -1), [], ~np.isfinite(flat)
    padded = np.pad(seen.reshape(rows, columns), 1, constant_values=True)
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    at_rim = np.zeros((rows, columns), bool)
    for i, j in steps:
        at_rim |= padded[1 + i : rows + 1 + i, 1 + j : columns + 1 + j]
    heap = [(float(flat[k]), int(k)) for k in np.flatnonzero(at_rim.ravel() & ~seen)]
    seen[[k for _, k in heap]] = True
    heapq.heapify(heap)
    while heap:
        level, k = heapq.heappop(heap)
        order.append(k)
        row, column = divmod(k, columns)
        for i, j in steps:
            if 0 <= row + i < rows and 0 <= column + j < columns:
                other = k + i * columns + j
                if not seen[other]:
                    seen[other] = True
                    to[other] = k
                    heapq.heappush(heap, (max(level, float(flat[other])), other))
    return to, np.array(order)


def streams_of(heights, cells=CELLS):
    """Return the streams of a terrain (R, C) as lists of samples, each from its spring or a confluence downstream."""
    to, order = drained(heights)
    through = np.ones(heights.size, np.int64)
    for k in order[::-1]:
        if to[k] >= 0:
            through[to[k]] += through[k]
    is_stream = through >= cells
    ups = np.bincount(to[is_stream & (to >= 0)], minlength=heights.size)
    found = []
    for start in np.flatnonzero(is_stream & (ups != 1)):
        line = [start]
        while to[line[-1]] >= 0:
            line.append(to[line[-1]])
            if ups[line[-1]] != 1:
                break
        if len(line) > 1:
            found.append(np.array(line))
    return found


def streams_in(path, cells):
    """Return the streams of a grid file in its frame, as lines without heights."""
    stored = np.load(path)
    heights, dx, dy = stored["elevation"], float(stored["dx"]), float(stored["dy"])
    columns = heights.shape[1]
    return [np.column_stack([line % columns * dx, -(line // columns) * dy]) for line in streams_of(heights, cells)]


def edges_there(surface, kept, faces):
    """Return how many of the lines' edges a mesh has, and how many there are."""
    edges = {frozenset(pair) for face in faces.tolist() for pair in itertools.combinations(face, 2)}
    wanted = [pair for chain in surface.line_chains(kept) for pair in itertools.pairwise(chain.tolist())]
    return sum(frozenset(pair) in edges for pair in wanted), len(wanted)


def searched(problem, moves, seed=1):
    return minimize(problem, memetic(), Moves(moves), seed=seed)


def best(result, triangles):
    """Return the most accurate subset of at most so many triangles, or None."""
    fits = np.flatnonzero(result.F[:, 1] <= triangles)
    return None if not len(fits) else result.X[fits[np.argmin(result.F[fits, 0])]]


def row_of(name, surface, kept, base, lined, faces=None):
    """Return a row of the table: a mesh measured, its lines as those of the surface ``lined``."""
    mesh = surface.simplify(kept)
    of_lines = lined.of_faces(mesh.faces).quality
    have, there = edges_there(lined, kept, mesh.faces)
    ratio = f"{mesh.quality.error / base:.3f}" if base else ""
    return (
        f"| {name} | {mesh.quality.triangles} | {mesh.quality.error:.5g} | {ratio} | "
        f"{of_lines.line_max_error:.3g} | {of_lines.line_mean_error:.3g} | {have}/{there} |"
    )


def compare(model, lines, tolerance, sizes, moves):
    """Print the table of one model."""
    problem = MeshProblem(model, break_lines=lines, line_tolerance=tolerance)
    every = MeshProblem(model, break_lines=lines, line_tolerance=0.0)
    lined = problem.surface
    free = MeshProblem(dataclasses.replace(problem.model, lines=None))  # the same vertices, no line
    unforced = HeightSurface(free.model)
    found = problem.model.lines
    least, all_pinned = (p.simplify(p.pinned).quality for p in (problem, every))
    print(
        f"\n## {model}: {len(lines)} lines, {found.found['line_vertices']:,} vertices, "
        f"{found.found['kept_line_vertices']:,} after thinning to {tolerance:g}, {len(found.segments):,} edges\n"
    )
    print(
        f"Smallest mesh: {least.triangles:,} triangles (largest line error {least.line_max_error:.3g}); with all "
        f"vertices of the lines {all_pinned.triangles:,}: {1 - least.triangles / all_pinned.triangles:.0%} less.\n"
    )
    print("| mesh | triangles | error | over no lines | largest line error | mean | edges of lines |")
    print("|---|---|---|---|---|---|---|")
    with_lines, without = searched(problem, moves), searched(free, moves)
    for triangles in sizes or [int(least.triangles * k) for k in (1.2, 2, 4)]:
        plain, kept = best(without, triangles), best(with_lines, triangles)
        base = unforced.simplify(plain).quality.error
        print(row_of("no lines", unforced, plain, 0.0, lined))
        if kept is not None:
            print(row_of("lines", lined, kept, base, lined))
            print(row_of("the same vertices, nothing forced", unforced, kept | problem.pinned, base, lined))


def main() -> None:
    parser = argparse.ArgumentParser(description="What break lines cost and what they are worth.")
    parser.add_argument("--dem", type=Path, help="a grid (.npz: elevation, dx, dy) whose streams are lines, too")
    parser.add_argument("--tolerance", type=float, default=1.0, help="of its lines [m] (default: 1)")
    parser.add_argument("--cells", type=int, default=CELLS, help=f"that drain through a stream (default: {CELLS})")
    parser.add_argument("--moves", type=int, default=4_000_000, help="of each search (default: 4 million)")
    args = parser.parse_args()
    compare("embankment", list(load_lines("embankment").lines), 0.3, (600, 1124, 2250), args.moves)
    if args.dem is not None:
        compare(str(args.dem), streams_in(args.dem, args.cells), args.tolerance, (), args.moves)


if __name__ == "__main__":
    main()
