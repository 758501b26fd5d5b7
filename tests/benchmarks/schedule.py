"""What further cores would help the memetic search: its own tasks, set out on 1 to 16 of them.

``python tests/benchmarks/schedule.py`` takes some two minutes. A sweep of the ladder is made on each model, and the
seconds of each task are noted: the annealing of one rung. They are processor seconds, so that it does not matter what
else the machine does. Then the tasks of each generation are set out on so many cores as the threads do it, each in turn
on the core that is free first; a generation begins when the one before it has ended. The table shows how many times as
fast that is as one core. "In long chains" is the ladder as it was cut before: each chain from the top to the bottom.

What is not a task of its own, such as choosing who survives, is left out, and so is what cores take from each other:
the memory, and the speed at which they run.
"""

from __future__ import annotations

import argparse
import heapq
import sys
import time
import warnings
from unittest import mock

from pymoo.optimize import minimize
from rich.console import Console
from rich.table import Table

import meshsimp_pymoo.search.memetic as memetic_search
from meshsimp_pymoo import MeshProblem, memetic
from meshsimp_pymoo.search import local_search
from meshsimp_pymoo.workers import thread_pool

MODELS = ("jacksboro:11", "jacksboro:4", "jacksboro")
CORES = (1, 2, 4, 8, 16)
# Generations that pass the largest rungs in chains of their own; as many as there are: all in the same chains.
WAYS = {"in long chains": sys.maxsize, "now": memetic_search.TOP_GENERATIONS}
MOVES_PER_VERTEX = 20.0


def finished(tasks, n_cores):
    """Return when the last of some tasks ends that are begun in turn, each on the core that is free first.

    >>> finished([3.0, 1.0, 1.0, 1.0, 2.0], 2), finished([3.0, 1.0], 4)
    (5.0, 3.0)
    """
    free = [0.0] * n_cores
    for task in tasks:
        heapq.heappush(free, heapq.heappop(free) + task)
    return max(free)


def helped(generations, n_cores):
    """Return how many times as fast so many cores do generations of tasks as one core.

    >>> helped([[1.0, 1.0], [2.0]], 2)
    1.3333333333333333
    """
    return sum(map(sum, generations)) / sum(finished(tasks, n_cores) for tasks in generations)


def tasks_of(problem, pop_size=100, moves_per_vertex=MOVES_PER_VERTEX):
    """Return the tasks of each generation of a sweep, in the order in which they are begun: (seconds, moves)."""
    generations, relocate, relocate_all = [], local_search.relocate, memetic_search.relocate_all

    def noted(surface, kept, *, made, **how):
        begun = time.thread_time()
        found = relocate(surface, kept, made=made, **how)
        place[made.ctypes.data] = time.thread_time() - begun, int(made[0])
        return found

    def generation(surface, X, moves, random_state, *, made, **how):
        place.clear()
        # as tasks of a pool, each is done by one thread from its beginning to its end
        found = relocate_all(surface, X, moves, random_state, made=made, **how)
        generations.append([place[made[k : k + 1].ctypes.data] for k in range(len(X))])
        return found

    place = {}
    end = ("n_gen", memetic_search.sweep_generations(pop_size))
    with (
        mock.patch.object(local_search, "relocate", noted),
        mock.patch.object(memetic_search, "relocate_all", generation),
    ):
        found = minimize(problem, memetic(pop_size, moves_per_vertex=moves_per_vertex), end, seed=1)
    # where rungs of small models coincide a second sweep has begun
    return generations[: len(memetic_search.turns(len(found.algorithm.survival.rungs)))]


def main(argv=None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", default=MODELS, metavar="MODEL", help="built-in names or files")
    text = f"moves of a rung for each kept vertex; default: {MOVES_PER_VERTEX:g}"
    parser.add_argument("--moves-per-vertex", type=float, default=MOVES_PER_VERTEX, metavar="M", help=text)
    options = parser.parse_args(argv)
    warnings.simplefilter("ignore")
    thread_pool()
    tasks_of(MeshProblem("jacksboro:30"), 20, 1.0)  # compiles
    sheet = Table(title="How many times as fast as on one core, by the tasks of one sweep")
    for heading in ("vertices", "chains", "tasks", *(f"{n} cores" for n in CORES), "any"):
        sheet.add_column(heading, justify="left" if heading == "chains" else "right")
    for name in options.models:
        problem = MeshProblem(name)
        for way, top in WAYS.items():
            with mock.patch.object(memetic_search, "TOP_GENERATIONS", top):
                generations = tasks_of(problem, moves_per_vertex=options.moves_per_vertex)
            seconds = [[task[0] for task in tasks] for tasks in generations]
            figures = [helped(seconds, n) for n in (*CORES, sum(map(len, seconds)))]
            row = [f"{problem.n_var:,}", way, f"{sum(map(len, seconds))}", *(f"{figure:.1f}" for figure in figures)]
            sheet.add_row(*row)
    Console(width=140 if not sys.stdout.isatty() else None).print(sheet)
    return 0


if __name__ == "__main__":
    sys.exit(main())
