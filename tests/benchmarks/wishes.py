"""How good the meshes are that are wished for, against pydelatin, and how soon there is a first answer.

Run ``python tests/benchmarks/wishes.py`` (eight minutes, ``--seconds 5`` for two): the triangles for three maximum
errors on terrain, at the very maximum that pydelatin's mesh has; the mean error of 5,000 triangles of jacksboro in ten
seconds; and the seconds and the memory of a first answer. ``--data FOLDER`` says where dem_sthelens.npz and
dem_startinpy01.npz are, ``--referee FILE`` a program with a function ``vertical_error(points, vertices, faces)`` that
measures meshes in place of this package. What is absent is left out, with the reason.
"""

from __future__ import annotations

import argparse
import importlib.util
import resource
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from meshsimp_pymoo import Front, MeshProblem, simplify_to, targeted
from meshsimp_pymoo.comparison.baselines import grid_rows

LEVELS = {
    "jacksboro:4": (200, 100, 50),
    "topobathy": (400, 200, 100),
    "dem_sthelens": (80, 40, 20),
    "dem_startinpy01": (60, 30, 15),
    "fractal": (60, 30, 15),
}
CONSOLE = Console(width=110)


def largest_rectangle(known):
    """Return the slices of the largest rectangle of a bool array that is True all over."""
    best, heights = (0, None), np.zeros(known.shape[1], int)
    for bottom, row in enumerate(known):
        heights = np.where(row, heights + 1, 0)
        open_: list[tuple[int, int]] = []
        for right, height in enumerate([*heights.tolist(), 0]):
            left = right
            while open_ and open_[-1][1] >= height:
                left, tall = open_.pop()
                if tall * (right - left) > best[0]:
                    best = tall * (right - left), (slice(bottom - tall + 1, bottom + 1), slice(left, right))
            open_.append((left, height))
    return best[1]


def fractal(rows, columns, seed=1):
    """Return heights from 0 to 1000 with a spectrum like that of terrain."""
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(columns), np.fft.fftfreq(rows)))
    k[0, 0] = 1.0
    z = np.fft.ifft2(np.fft.fft2(np.random.default_rng(seed).normal(size=(rows, columns))) * k**-2.0).real
    return (z - z.min()) / np.ptp(z) * 1000.0


def with_gaps(seed=1):
    """Return a raster of 1200 x 1500 heights without data in its corners and at one in a hundred others."""
    z = fractal(1200, 1500)
    i, j = np.indices(z.shape)
    z[np.abs(i / 600 - 1) + np.abs(j / 750 - 1) > 1.75] = np.nan
    z[np.random.default_rng(seed).random(z.shape) < 0.01] = np.nan
    return z


def grid_file(folder, name, data):
    """Return what MeshProblem reads for a case; a reason to leave it out as an exception."""
    if name == "fractal":
        z, dx, dy = fractal(300, 300), 10.0, 10.0
    elif name.startswith("dem_"):
        if data is None or not (data / f"{name}.npz").is_file():
            raise FileNotFoundError(f"there is no {name}.npz; say where by --data")
        with np.load(data / f"{name}.npz") as stored:
            z, dx, dy = stored["elevation"].astype(float), float(stored["dx"]), float(stored["dy"])
        z = z[largest_rectangle(~np.isnan(z))]
    else:
        return name
    path = folder / f"{name}.npz"
    np.savez(path, elevation=z, dx=dx, dy=dy)
    return str(path)


def by_pydelatin(model, **how):
    """Return vertices and faces of pydelatin's mesh of a full grid."""
    from pydelatin import Delatin

    rows = grid_rows(model)
    mesh = Delatin(model.points[rows, 2].astype(np.float32), **how)
    column, up = np.round(mesh.vertices[:, :2]).astype(int).T
    places = rows[len(rows) - 1 - up, column]
    assert np.allclose(model.points[places, 2], mesh.vertices[:, 2], rtol=1e-4)
    return model.file_points[places], np.asarray(mesh.triangles, np.int64)


def measured(problem, referee, vertices, faces):
    """Return mean and maximum of the deviations."""
    if referee is None:
        quality = problem.surface.score(vertices, faces).quality
        return quality.mean_error, quality.max_error
    cost = referee.vertical_error(problem.model.file_points, vertices, faces)[2]
    return cost.mean(), cost.max()


def maxima(arguments, referee, folder):
    """Print the triangles at equal maximum errors."""
    table = Table("model", "N", "max error", "pydelatin", "first", "triangles", "ratio", "referee's max", "seconds")
    ratios = []
    for name, levels in LEVELS.items():
        try:
            problem = MeshProblem(grid_file(folder, name, arguments.data), objectives=("max_error", "triangles"))
        except FileNotFoundError as reason:
            CONSOLE.print(f"{name}: left out: {reason}")
            continue
        for level in levels:
            vertices, faces = by_pydelatin(problem.model, max_error=level)
            limit = measured(problem, referee, vertices, faces)[1]
            first = simplify_to(problem, max_error=limit, moves=1).triangles
            start = time.perf_counter()
            found = simplify_to(problem, max_error=limit, time=arguments.seconds)
            seconds = time.perf_counter() - start
            largest = measured(problem, referee, found.mesh.vertices, found.mesh.faces)[1]
            assert largest <= limit * (1 + 1e-9), f"{name}: {largest} is more than {limit}"
            ratios.append(found.triangles / len(faces))
            numbers = [f"{n:,}" for n in (len(faces), first, found.triangles)]
            row = [name, f"{problem.n_var:,}", f"{limit:.5g}", *numbers, f"{ratios[-1]:.3f}", f"{largest:.5g}"]
            table.add_row(*row, f"{seconds:.1f}")
    CONSOLE.print(table)
    CONSOLE.print(f"triangles over pydelatin's: at most {max(ratios):.3f}, geometric mean {_mean(ratios):.3f}")


def _mean(ratios):
    return float(np.exp(np.log(ratios).mean()))


def sizes(referee):
    """Print the mean error of 5,000 triangles of jacksboro against pydelatin's."""
    problem = MeshProblem("jacksboro")
    start = time.perf_counter()
    found = simplify_to(problem, triangles=5000, time=10.0)
    seconds = time.perf_counter() - start
    vertices, faces = by_pydelatin(problem.model, max_error=0.0, max_triangles=found.triangles)
    theirs = measured(problem, referee, vertices, faces)[0]
    ours = measured(problem, referee, found.mesh.vertices, found.mesh.faces)[0]
    CONSOLE.print(
        f"jacksboro, {found.triangles:,} triangles in {seconds:.1f} s: mean error {ours:.4g}, pydelatin's of "
        f"{len(faces):,} {theirs:.4g}, ratio {ours / theirs:.3f}"
    )


def first_answers(folder):
    """Print how long the first answer takes for 5,000 triangles once all is compiled, and the memory of the process."""
    np.save(folder / "gaps.npy", with_gaps())
    for name in ("jacksboro", str(folder / "gaps.npy")):
        start = time.perf_counter()
        problem = MeshProblem(name)
        read = time.perf_counter() - start
        algorithm = targeted(triangles=5000).setup(problem, termination=("n_gen", 1), seed=1)
        algorithm.next()
        seconds = time.perf_counter() - start - read
        found = Front.from_subsets(problem, algorithm.answer.X)[0]
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        CONSOLE.print(
            f"{Path(name).stem}, N = {problem.n_var:,}: first answer after {seconds:.1f} s beside {read:.1f} s of "
            f"reading, {found.triangles:,} triangles, mean error {found.mean_error:.4g}; {used:.2f} GiB at most so far"
        )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, metavar="FOLDER")
    parser.add_argument("--referee", type=Path, metavar="FILE")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--only", choices=("maxima", "sizes", "first"))
    arguments = parser.parse_args()
    referee = None
    if arguments.referee is not None:
        spec = importlib.util.spec_from_file_location("referee", arguments.referee)
        referee = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(referee)
    with tempfile.TemporaryDirectory() as place:
        simplify_to("roof:9", triangles=4, moves=100)  # what is compiled is no matter here
        if arguments.only in (None, "first"):
            first_answers(Path(place))
        if arguments.only == "first":
            return
        try:
            import pydelatin  # noqa: F401
        except ImportError:
            CONSOLE.print(
                "left out: what is compared with pydelatin, which is not installed (pip install '.[baselines]')"
            )
            return
        if arguments.only in (None, "sizes"):
            sizes(referee)
        if arguments.only in (None, "maxima"):
            maxima(arguments, referee, Path(place))


if __name__ == "__main__":
    main()
