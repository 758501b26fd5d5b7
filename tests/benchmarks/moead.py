"""MOEA/D's time beside NSGA-II v1's, and how much of each is the evaluation itself.

    python tests/benchmarks/moead.py                 # face:922, 100 individuals, 50 generations, as in the paper

Both run in alternation in one process on one thread, each on a problem of its own, after everything is compiled; CPU
seconds, the least of the rounds, since whatever else runs on the machine adds to them. MOEA/D makes one child after the
other, each from what the ones before it left, so it cannot hand its children to the kernel together; it may take three
tenths more than NSGA-II, and what its kernel takes longer, since its subsets are other ones.
`tests/search/test_moead.py` holds it to that with ``-m slow``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem, moead, nsga2_v1

# MOEA/D's time over NSGA-II v1's, without what its kernel takes longer.
MOST = 1.3


class Timed(MeshProblem):
    """A problem that adds up the time of its kernel."""

    seconds = 0.0

    def _kernel(self, X: Any, n_threads: int) -> Any:
        start = time.process_time()
        table = super()._kernel(X, n_threads)
        self.seconds += time.process_time() - start
        return table


def run(preset: Callable[..., Any], surface: Any, generations: int, seed: int) -> tuple[float, float]:
    """Return the CPU seconds of a run and of the kernel in it."""
    problem = Timed(surface, n_threads=1)
    start = time.process_time()
    minimize(problem, preset(), ("n_gen", generations), seed=seed)
    return time.process_time() - start, problem.seconds


def measured(model: str, generations: int = 50, rounds: int = 5) -> dict[str, float]:
    """Run both in alternation; return the least of their times, their kernels' then, and the ratio that is bounded."""
    surface = MeshProblem(model).surface
    presets = {"nsga2_v1": nsga2_v1, "moead": moead}
    for preset in presets.values():
        run(preset, surface, 2, 0)
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in presets}
    for seed in range(1, rounds + 1):
        for name, preset in presets.items():
            times[name].append(run(preset, surface, generations, seed))
    (nsga2, nsga2_kernel), (own, own_kernel) = (min(times[name]) for name in presets)
    return {
        "nsga2_v1": nsga2,
        "nsga2_v1 kernel": nsga2_kernel,
        "moead": own,
        "moead kernel": own_kernel,
        "ratio without the kernel's surplus": (own - (own_kernel - nsga2_kernel)) / nsga2,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="face:922")
    parser.add_argument("--generations", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    for name, value in measured(given.model, given.generations, given.rounds).items():
        print(f"{name:36} {value:7.3f}")
