"""How the cost of thinning grows with the size of models with long outlines, gaps and hubs; moves at an outline.

Run ``python tests/benchmarks/growth.py`` (some minutes); ``--sizes 5000,10000`` and ``--kinds islands,comb`` for less,
``--moves`` for the moves at the outline alone. Seconds are those of the thread's CPU, the least of three where short.
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
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.rules import Rules

SIZES = (5_000, 10_000, 20_000, 40_000, 80_000)
ASKED_EXPONENT, ASKED_MOVES = 1.3, 0.6
# What takes less is done three times [s].
SHORT = 3.0
CONSOLE = Console(width=130)


def seconds(call: Callable[[], Any]) -> float:
    """Return the CPU seconds of this thread that a call takes; the least of three where they are few."""
    least = np.inf
    for _ in range(3):
        start = time.thread_time()
        call()
        least = min(least, time.thread_time() - start)
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


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=lambda text: [int(n) for n in text.split(",")], default=list(SIZES))
    parser.add_argument("--kinds", type=lambda text: text.split(","), default=list(KINDS))
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    growth(arguments.kinds, arguments.sizes)


if __name__ == "__main__":
    main()
