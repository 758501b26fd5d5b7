"""Which of two solutions is chosen: the tournaments, all pairs at once."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


def crowded_tournament(
    pop: Any, P: NDArray[np.integer], *, random_state: np.random.Generator, **kwargs: Any
) -> NDArray[np.integer]:
    """NSGA-II's binary tournament, all pairs at once.

    By constraint violation if either has one, then by dominance, then by crowding distance, then by chance:
    the rule of pymoo's ``binary_tournament`` with its default ``comp_by_dom_and_crowding``.

    Parameters
    ----------
    pop : (n,) Population
        Evaluated individuals with ``crowding``.
    P : (k, 2) int array
        Indices of the two sides.
    random_state : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (k, 1) int array
        Indices of the winners.
    """
    a, b = P[:, 0], P[:, 1]
    F, violation = objectives(pop), violations(pop)
    # Individuals that violate constraints have no crowding: None becomes NaN, which compares as neither.
    crowding = np.array([individual.data.get("crowding") for individual in pop], dtype=float)
    smaller = (F[a] < F[b]).any(axis=1)
    larger = (F[a] > F[b]).any(axis=1)
    return _winners(
        P,
        [
            violation[a] - violation[b],
            larger.astype(int) - smaller.astype(int),
            _sign(crowding[b], crowding[a]),
        ],
        random_state,
        only_first=(violation[a] > 0) | (violation[b] > 0),
    )


def violation_tournament(
    pop: Any, P: NDArray[np.integer], *, random_state: np.random.Generator, **kwargs: Any
) -> NDArray[np.integer]:
    """NSGA-III's binary tournament: by constraint violation if either has one, else by chance.

    The rule and the draws of pymoo's ``comp_by_cv_then_random``, so the same winners, except where both violate alike:
    pymoo then draws from a generator that no seed reaches. pymoo's own cannot be pickled, and so no result of it.

    Parameters
    ----------
    pop : (n,) Population
        Evaluated individuals.
    P : (k, 2) int array
        Indices of the two sides.
    random_state : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (k, 1) int array
        Indices of the winners.
    """
    violation = violations(pop)
    return _winners(P, [violation[P[:, 0]] - violation[P[:, 1]]], random_state)


class Scoring(Protocol):
    """An algorithm that minimises one number: `WeightedGA`."""

    def score(self, pop: Any) -> NDArray[np.float64]:
        """Return the number of each individual, (n,)."""


def score_tournament(
    pop: Any,
    P: NDArray[np.integer],
    *,
    algorithm: Scoring,
    random_state: np.random.Generator,
    **kwargs: Any,
) -> NDArray[np.integer]:
    """Binary tournament by constraint violation, then by the weighted sum, then by chance.

    Parameters
    ----------
    pop : (n,) Population
        Evaluated individuals.
    P : (k, 2) int array
        Indices of the two sides.
    algorithm : WeightedGA
        Says how objectives are weighted.
    random_state : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (k, 1) int array
        Indices of the winners.
    """
    a, b = P[:, 0], P[:, 1]
    violation, score = violations(pop), algorithm.score(pop)
    return _winners(P, [violation[a] - violation[b], _sign(score[a], score[b])], random_state)


def _winners(
    P: NDArray[np.integer],
    comparisons: list[NDArray[Any]],
    rng: np.random.Generator,
    only_first: NDArray[np.bool_] | None = None,
) -> NDArray[np.integer]:
    """Winner of each pair: negative comparisons favour the left side, the first one that is not 0 decides."""
    outcome = np.sign(comparisons[0])
    for comparison in comparisons[1:]:
        open_pairs = outcome == 0 if only_first is None else (outcome == 0) & ~only_first
        outcome = np.where(open_pairs, np.sign(comparison), outcome)
    tied = np.flatnonzero(outcome == 0)
    outcome[tied] = rng.integers(2, size=len(tied)) * 2 - 1
    return np.where(outcome < 0, P[:, 0], P[:, 1])[:, None]


def _sign(left: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.integer]:
    """-1 where left is smaller, 1 where larger, 0 otherwise; unlike a difference, right for infinities."""
    return (left > right).astype(int) - (left < right).astype(int)


def objectives(pop: Any) -> NDArray[np.float64]:
    """``pop.get("F")`` at a third of the time: tournaments are held several times in each generation."""
    return np.array([individual.F for individual in pop])


def violations(pop: Any) -> NDArray[np.float64]:
    """``pop.get("CV")[:, 0]``, in the same way."""
    return np.array([individual.CV[0] for individual in pop])
