"""How time and memory of a tiled front grow with the grid, and what the tiles cost.

``python tests/benchmarks/tiles.py --side 1000`` thins a fractal relief of 1000 x 1000 samples to a front of up to a
million triangles, in a process of its own, and prints its time and its peak memory (all processes together, the mapped
file included); then, from the files alone, the error of written meshes, worked out triangle by triangle, and the cracks
in them. ``--side 2000`` and ``--side 5000`` show the growth; ``--gaps`` takes a tenth of the samples out.

``python tests/benchmarks/tiles.py --against jacksboro`` compares tiled and untiled thinning of a model in memory.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from numba import njit
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))

from cracks import find_cracks

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.opening import open_grid
from meshsimp_pymoo.search.coarse import SEARCHED
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.tiles.front import TILE, tiled_front

CONSOLE = Console(width=110)
PAGE = os.sysconf("SC_PAGE_SIZE")


def fractal(side, seed=1, roughness=2.2):
    """Return a relief whose amplitudes fall with the power ``roughness`` / 2 + 1/2 of the frequency, of unit spread."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None, :]).astype(np.float32)
    frequency[0, 0] = 1.0
    noise = np.fft.rfft2(rng.standard_normal((side, side), np.float32))
    noise *= frequency ** -np.float32(0.5 * roughness + 0.5)
    noise[0, 0] = 0.0
    z = np.fft.irfft2(noise, s=(side, side)).astype(np.float32)
    return 500.0 * z / z.std()


class PeakMemory:
    """Watches what the processes below one hold, all together: resident bytes, shared pages counted for each."""

    def __init__(self, pid):
        self.pid, self.peak, self.ended = pid, 0, threading.Event()
        self.thread = threading.Thread(target=self.watch, daemon=True)
        self.thread.start()

    def watch(self):
        while not self.ended.wait(0.2):
            self.peak = max(self.peak, self.now())

    def now(self):
        parents, resident = {}, {}
        for path in Path("/proc").glob("[0-9]*"):
            try:
                parents[int(path.name)] = int((path / "stat").read_text().rpartition(")")[2].split()[1])
                resident[int(path.name)] = int((path / "statm").read_text().split()[1]) * PAGE
            except (OSError, ValueError, IndexError):
                continue
        total = 0
        for pid in parents:
            up = pid
            while up not in (self.pid, 0, 1) and up in parents:
                up = parents[up]
            total += resident[pid] if up == self.pid else 0
        return total


@njit(cache=True)
def add_triangles(vertices, faces, heights, dx, dy, deviation):
    """Enter the least deviation of any triangle at every sample that it covers: no search, no Delaunay."""
    n_rows, n_columns = heights.shape
    for f in range(len(faces)):
        ax, ay, az = vertices[faces[f, 0]]
        bx, by, bz = vertices[faces[f, 1]]
        cx, cy, cz = vertices[faces[f, 2]]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        for r in range(max(int(-max(ay, by, cy) / dy - 1e-6), 0), min(int(-min(ay, by, cy) / dy + 1.000001), n_rows)):
            y = -r * dy
            left, right = max(int(min(ax, bx, cx) / dx), 0), min(int(max(ax, bx, cx) / dx + 1.000001), n_columns)
            for c in range(left, right):
                x = c * dx
                wa = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
                wb = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
                wc = 1.0 - wa - wb
                if min(wa, wb, wc) >= -1e-9:
                    d = abs(wa * az + wb * bz + wc * cz - heights[r, c])
                    if not d >= deviation[r, c]:
                        deviation[r, c] = d


def read_ply(path):
    """Return vertices and faces of a binary PLY of doubles and triangles."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + 11
    counts = [int(line.split()[2]) for line in data[:end].split(b"\n") if line.startswith(b"element")]
    vertices = np.frombuffer(data, "<f8", 3 * counts[0], end).reshape(-1, 3)
    rows = np.frombuffer(data, np.dtype([("n", "u1"), ("v", "<i4", 3)]), counts[1], end + vertices.nbytes)
    assert (rows["n"] == 3).all()
    return vertices, rows["v"].astype(np.int64)


def with_gaps(heights):
    """Take a tenth of the samples out: a corner, and lakes of all sizes, each with an island."""
    side = len(heights)
    rng = np.random.default_rng(1)
    row, column = np.ogrid[:side, :side]
    heights[np.hypot(row, column) < 0.15 * side] = np.nan
    while np.isnan(heights[:: max(side // 500, 1), :: max(side // 500, 1)]).mean() < 0.1:
        y, x, size = rng.uniform(0, side), rng.uniform(0, side), 0.1 * side * rng.random() ** 3
        away = np.hypot(row - y, column - x)
        heights[(away < size) & (away > 0.2 * size)] = np.nan
    return heights


def big(side, tile, jobs, folder, gaps):
    """Simplify a relief as a user would and check what is written."""
    path = folder / f"fractal_{side}{'_gaps' * gaps}.npy"
    if not path.exists():
        np.save(path, with_gaps(fractal(side)) if gaps else fractal(side))
    out = folder / f"front_{side}{'_gaps' * gaps}"
    command = [sys.executable, "-m", "meshsimp_pymoo", "simplify", str(path), "-o", str(out), "--tile", str(tile)]
    command += ["--jobs", str(jobs), "--overwrite", "--meshes", "12", "--json"]
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    memory = PeakMemory(process.pid)
    process.communicate()
    seconds = time.perf_counter() - start
    memory.ended.set()
    assert process.returncode == 0
    with (out / "front.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    sizes = [int(row["triangles"]) for row in rows]
    CONSOLE.print(
        f"{side} x {side} = {side**2:,} samples, tiles of {tile}, {jobs} processes: {seconds:.0f} s, "
        f"{1e6 * seconds / side**2:.1f} us a sample, peak {memory.peak / 2**30:.2f} GiB, {len(sizes)} solutions of "
        f"{sizes[0]:,} to {sizes[-1]:,} triangles"
    )
    heights = np.load(path, mmap_mode="r")
    # of what no triangle covers the error is not worked out again; at gaps edges end, which is no crack
    table = Table("triangles", "error", "recomputed", "relative difference", "cracks", "samples covered", "uncovered")
    for row in rows:
        if not row["mesh"]:
            continue
        vertices, faces = read_ply(out / row["mesh"])
        deviation = np.full(heights.shape, np.nan)
        add_triangles(vertices, faces, heights, 1.0, 1.0, deviation)
        error = np.nansum(deviation)
        difference = "-" if int(row["uncovered"]) else f"{error / float(row['error']) - 1:.1e}"
        cracks = "-" if gaps else str(find_cracks(vertices, faces))
        covered = f"{np.isfinite(deviation).mean():.2%}"
        table.add_row(f"{len(faces):,}", row["error"], f"{error:.10g}", difference, cracks, covered, row["uncovered"])
    CONSOLE.print(table)


def against(name, tiles):
    """Compare with thinning in one piece, at equal triangles."""
    model = build_model(load(name))
    whole = thinning(HeightSurface(model))
    table = Table("tile", "solutions", "triangles", "worst above 300", "worst up to 300", "mean", "seconds")
    for tile in tiles:
        start = time.perf_counter()
        front = tiled_front(open_grid(model), tile=tile)
        seconds = time.perf_counter() - start
        triangles = front.F[:, 1]
        few = (triangles > 2) & (triangles <= SEARCHED)  # with 2 there is nothing to choose
        excess = front.F[:, 0] / np.interp(triangles, whole.triangles, whole.error) - 1
        table.add_row(
            str(tile), str(len(front)), f"{triangles[0]:.0f} to {triangles[-1]:.0f}",
            f"{excess[triangles > SEARCHED].max():+.2%}", f"{excess[few].max():+.2%}", f"{excess.mean():+.2%}",
            f"{seconds:.1f}",
        )  # fmt: skip
    CONSOLE.print(f"{name}: N = {model.n_vertices:,}; error of tiled thinning above that of thinning in one piece")
    CONSOLE.print(table)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=1000)
    parser.add_argument("--tile", type=int, default=TILE)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--folder", type=Path, help="where the relief and the front are put (default: a temporary one)")
    parser.add_argument("--gaps", action="store_true", help="with a tenth of the samples missing")
    parser.add_argument("--against", metavar="MODEL")
    options = parser.parse_args()
    if options.against:
        against(options.against, (64, 100, 128, 200, 256))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            big(options.side, options.tile, options.jobs, options.folder or Path(temporary), options.gaps)
