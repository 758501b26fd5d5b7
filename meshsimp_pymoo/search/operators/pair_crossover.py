"""What all crossovers share: pairs of parents, of which only those that do cross are worked on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.crossover import Crossover
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.variable import get
from pymoo.util import default_random_state

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.search.local_search import relocate_all
from meshsimp_pymoo.search.requirements import pinned_vertices, require_bool, require_probability, surface_of


class PairCrossover(Crossover):
    """Two parents, one or two children; only the pairs that do cross are worked on.

    Subclasses write ``_do(problem, X, mates=..., random_state=..., **kwargs)`` with X (2, n_crossing, N);
    ``mates`` are the crossing pairs as individuals. pymoo's own ``do`` calls ``_do`` on all pairs and throws
    away the rest.
    """

    def __init__(self, prob: float, n_offsprings: int) -> None:
        if n_offsprings not in (1, 2):
            raise ValueError(f"n_offsprings = {n_offsprings}: a pair of parents has 1 or 2 children here")
        super().__init__(2, n_offsprings, prob=require_probability("prob", prob))

    __repr__ = as_made

    @default_random_state
    def do(
        self,
        problem: Any,
        pop: Any,
        parents: NDArray[np.integer] | None = None,
        *args: Any,
        random_state: np.random.Generator,
        **kwargs: Any,
    ) -> Any:
        """Return the children of all pairs, all first children before all second ones.

        Parameters
        ----------
        problem : MeshProblem
            The problem being solved.
        pop : (n_matings, 2) Population
            The pairs; or, with ``parents``, the population that its indices refer to.
        parents : (n_matings, 2) int array, optional
            Indices of the pairs in ``pop``.
        random_state : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        (n_offsprings * n_matings,) Population
            New individuals, not evaluated. Pairs that do not cross have copies of the parents as children (of
            a random one where there is one child).
        """
        pairs: Sequence[Sequence[Individual]] = pop if parents is None else [pop[pair] for pair in parents]
        X = np.swapaxes(np.array([[parent.X for parent in pair] for pair in pairs]), 0, 1)
        require_bool(X, self)
        n_matings = X.shape[1]
        crosses = random_state.random(n_matings) < get(self.prob, size=n_matings)
        children = np.empty((self.n_offsprings, *X.shape[1:]), dtype=bool)
        if not crosses.all():
            stays = np.flatnonzero(~crosses)
            if self.n_offsprings == 2:
                children[:, stays] = X[:, stays]
            else:
                children[0, stays] = X[random_state.integers(2, size=len(stays)), stays]
        if crosses.any():
            mates = [pairs[k] for k in np.flatnonzero(crosses).tolist()]
            parental = X if crosses.all() else X[:, crosses]
            children[:, crosses] = self._do(problem, parental, *args, random_state=random_state, mates=mates, **kwargs)
        return Population.new("X", children.reshape(-1, X.shape[2]))


def of_the_parents_sizes(
    problem: Any, operator: object, children: NDArray[np.bool_], parents: NDArray[np.bool_], rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Add or drop vertices, good ones of a few drawn, until children keep as many as their parents.

    Parameters
    ----------
    problem : MeshProblem
        The problem being solved.
    operator : Crossover
        Whose children they are.
    children, parents : (n_offsprings, n, N) bool arrays
        First children beside first parents, second ones beside second ones; children may be changed in place.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (n_offsprings, n, N) bool array
        The children.
    """
    pinned = pinned_vertices(problem, operator)
    sizes = (parents[: len(children)] | pinned).sum(axis=2).ravel()
    flat = children.reshape(-1, children.shape[2])  # a copy where the vectors of parents lie apart
    unequal = np.flatnonzero((flat | pinned).sum(axis=1) != sizes)
    flat[unequal] = relocate_all(
        surface_of(problem, operator), flat[unequal], np.zeros(len(unequal), int), rng, sizes=sizes[unequal]
    )
    return flat.reshape(children.shape)
