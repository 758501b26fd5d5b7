"""Pairs of parents for crossovers, crossovers called as algorithms call them, and what they are told."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population
from stand_in_problem import GridProblem

from meshsimp_pymoo.search.operators import OAX


def evaluated_pairs(problem: GridProblem, n_matings: int, seed: int, equal_genes: float = 0.0) -> Population:
    """Evaluated random pairs; a share of the genes is the same in both parents of a pair."""
    rng = np.random.default_rng(seed)
    parents = rng.random((n_matings, 2, problem.n_var)) < 0.5
    same = rng.random((n_matings, problem.n_var)) < equal_genes
    parents[:, 1][same] = parents[:, 0][same]
    parents |= problem.pinned
    pop = Population.new("X", parents.reshape(-1, problem.n_var))
    return Evaluator().eval(problem, pop).reshape(n_matings, 2)


def opposite_pairs(problem: GridProblem, n_matings: int, seed: int) -> Population:
    """Evaluated pairs that differ in every gene, nothing being pinned: no segment on which they agree."""
    problem.pinned = np.zeros(problem.n_var, dtype=bool)
    first = np.random.default_rng(seed).random((n_matings, problem.n_var)) < 0.5
    pop = Population.new("X", np.stack([first, ~first], axis=1).reshape(-1, problem.n_var))
    return Evaluator().eval(problem, pop).reshape(n_matings, 2)


def call(crossover: Any, problem: GridProblem, pairs: Any, seed: int, **algorithm: Any) -> tuple[np.ndarray, int]:
    """Children (n_offsprings, n_matings, N) and the number of evaluations that were counted."""
    caller = SimpleNamespace(**({"evaluator": Evaluator(), "data": {}, "n_iter": 2, "archive": None} | algorithm))
    before, calls = caller.evaluator.n_eval, problem.calls
    children = crossover(problem, pairs, random_state=np.random.default_rng(seed), algorithm=caller).get("X")
    assert caller.evaluator.n_eval - before == problem.calls - calls
    return children.reshape(crossover.n_offsprings, len(pairs), -1), problem.calls - calls


class CrossedWith(OAX):
    """Note the score that the algorithm passes."""

    score_seen: Callable[[np.ndarray], np.ndarray]

    def _do(self, problem: Any, X: np.ndarray, *args: Any, **kwargs: Any) -> np.ndarray:
        CrossedWith.score_seen = staticmethod(kwargs["score"])
        return super()._do(problem, X, *args, **kwargs)
