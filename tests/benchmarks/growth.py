"""How the cost of thinning grows with the size of models with long outlines, gaps and hubs; moves at an outline.

Run ``python tests/benchmarks/growth.py`` (some minutes); ``--sizes 5000,10000`` and ``--kinds islands,comb`` for less,
``--moves`` for the moves at the outline alone. Seconds are those of the CPU, the least of three where they are few.
Asked: exponents of at most 1.3; moves at the outline at least 0.6 times as many a second as on a grid without gaps.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))

from growing import KINDS

from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.search.local_search import USUAL_MOVES, anneal
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.moves import snapshot
from meshsimp_pymoo.surface.rules import Rules

SIZES = (5_000, 10_000, 20_000, 40_000, 80_000)
ASKED_EXPONENT, ASKED_MOVES = 1.3, 0.6
# What takes less is done three times [s].
SHORT = 3.0
SHARE_KEPT, MOVES, ROUNDS = 0.1, 100_000, 20
LAURANA = "m1_laurana.ply"
CONSOLE = Console(width=130)


def seconds(call: Callable[[], Any]) -> float:
    """Return the CPU seconds that a call takes, on all of its threads; the least of three where they are few."""
    least = np.inf
    for _ in range(3):
        start = time.process_time()
        call()
        least = min(least, time.process_time() - start)
        if least > SHORT:
            break
    return least


def fitted_exponent(sizes: list[int], took: list[float]) -> float:
    """Return the slope of log seconds over log size."""
    return float(np.polyfit(np.log(sizes), np.log(took), 1)[0])


def growth(kinds: list[str], sizes: list[int]) -> None:
    """Print the table of exponents."""
    table = Table("kind", *(f"{n} s" for n in sizes), "last N", "last step", "exponent", title="Thinning")
    for name in kinds:
        make, rules = KINDS[name]
        took, counts = [], []
        for n in sizes:
            surface = HeightSurface(open_model(make(n)), Rules(**rules))
            thinning(surface, least=surface.n_vertices)  # compiled, and the footprint made
            took.append(seconds(lambda surface=surface: thinning(surface)))
            counts.append(surface.n_vertices)
        exponent = fitted_exponent(counts, took)
        last = fitted_exponent(counts[-2:], took[-2:]) if len(sizes) > 1 else np.nan
        mark = "" if exponent <= ASKED_EXPONENT else f" > {ASKED_EXPONENT}"
        table.add_row(name, *(f"{t:.2f}" for t in took), f"{counts[-1]}", f"{last:.2f}", f"{exponent:.2f}{mark}")
        CONSOLE.print(name, *(f"{t:.2f}" for t in took), f"{last:.2f}", f"{exponent:.2f}")
    CONSOLE.print(table)


def moves_a_second(surface: HeightSurface, *, at_border: bool) -> float:
    """Return annealed moves a CPU second with a tenth of the vertices kept, of all of these or of those on the border.

    Each round begins anew, so that the vertices are where they were.
    """
    front = thinning(surface)
    kept = front.kept(max(int(SHARE_KEPT * surface.n_vertices) - len(front.base), 0))
    chosen = kept & ~surface.pinned
    if at_border:
        chosen &= np.isin(np.arange(surface.n_vertices), surface.border)
    rows, n = np.flatnonzero(chosen), surface.n_vertices
    moves = 4 * len(rows) if at_border else MOVES // ROUNDS
    took, state = [], np.array([1], np.uint64)
    for _ in range(ROUNDS + 1):  # the first one compiles
        with surface.books(kept) as books:
            _, total, most = snapshot(surface.ground(), books, n)
            movable, best, made = np.empty(n, np.int64), np.empty(n, np.int64), np.array([moves])
            movable[: len(rows)] = rows
            graph, shares = (surface.border, *surface.neighbours), tuple(map(float, USUAL_MOVES))
            heat = 0.3 * total / kept.sum()
            start = time.thread_time()
            anneal(
                *(surface.ground(), books, n, movable, len(rows), *graph, moves, heat, 0.3, int(most), shares),
                *(state, np.zeros(1, bool), made, best),
            )
            took.append(time.thread_time() - start)
    return moves / float(np.median(took[1:]))


def moves_at_outlines(folder: Path) -> None:
    """Print the table of moves; all models in turn, so that the machine is as busy for each."""
    models: dict[str, Any] = {"jacksboro:11": "jacksboro:11", "face:1000": "face:1000"}
    if (folder / LAURANA).is_file():
        models[LAURANA] = folder / LAURANA
    else:
        CONSOLE.print(f"{LAURANA} is left out: it is not in {folder}")
    surfaces = {name: HeightSurface(open_model(model)) for name, model in models.items()}
    table = Table("model", "which moves", "moves / s", "over jacksboro's", title=f"Annealing, {SHARE_KEPT:.0%} kept")
    for at_border in (False, True):
        found = {name: [] for name in models}
        for _ in range(5):
            base = moves_a_second(surfaces["jacksboro:11"], at_border=False)
            for name, surface in surfaces.items():
                found[name].append((moves_a_second(surface, at_border=at_border), base))
        for name, pairs in found.items():
            ratio = float(np.median([rate / base for rate, base in pairs]))
            mark = "" if ratio >= ASKED_MOVES else f" < {ASKED_MOVES}"
            which = "of vertices on the border" if at_border else "all"
            table.add_row(name, which, f"{np.median([rate for rate, _ in pairs]):.0f}", f"{ratio:.2f}{mark}")
    CONSOLE.print(table)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=lambda text: [int(n) for n in text.split(",")], default=list(SIZES))
    parser.add_argument("--kinds", type=lambda text: text.split(","), default=list(KINDS))
    parser.add_argument("--moves", action="store_true", help="the moves alone")
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[3] / "shared" / "data")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    moves_at_outlines(arguments.data)
    if arguments.moves:
        return
    growth(arguments.kinds, arguments.sizes)


if __name__ == "__main__":
    main()
