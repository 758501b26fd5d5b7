"""MOEA/D with the Tchebycheff decomposition, as Zhang and Li publish it and as the paper has it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.core.problem import Problem

from meshsimp_pymoo.search.operators import PackedDuplicates, SubsetUniformCrossover
from meshsimp_pymoo.search.paper import CROSSOVER_PROBABILITY, GENERATIONS, POP_SIZE, paper_operators
from meshsimp_pymoo.search.requirements import require_probability
from meshsimp_pymoo.search.selection import objectives

# The sub-problem itself included; the paper gives 20.
NEIGHBOURHOOD = 20


def moead(
    pop_size: int = POP_SIZE,
    *,
    normalised: bool = False,
    n_neighbors: int = NEIGHBOURHOOD,
    prob_neighbor_mating: float = 1.0,
    **kwargs: Any,
) -> TchebycheffMOEAD:
    """MOEA/D (Zhang and Li 2007) with the Tchebycheff decomposition of Eq. 7 and uniform crossover.

    Parameters
    ----------
    pop_size : int
        Number of sub-problems: weight vectors (i / (n - 1), 1 - i / (n - 1)), at least 2.
    normalised : bool
        False: the raw objectives, as in the paper. The error (in file units) and the number of triangles then
        have the influence that their units happen to give them. True: both are divided by their range in the
        initial population, which random subsets of all sizes spread over nearly the whole front.
    n_neighbors : int
        Size of the neighbourhood, the sub-problem itself included.
    prob_neighbor_mating : float
        Probability of choosing both parents in the neighbourhood; 1 in Zhang and Li.
    **kwargs
        Further arguments of ``pymoo.algorithms.moo.moead.MOEAD``; they replace the preset's own. A crossover
        makes one child per mating: give yours ``n_offsprings=1``.

    Raises
    ------
    ValueError
        If ``pop_size`` is below 2 or the probability is not in [0, 1].
    """
    defaults = paper_operators() | {"crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY, n_offsprings=1)}
    return TchebycheffMOEAD(
        pop_size,
        normalised=normalised,
        n_neighbors=n_neighbors,
        prob_neighbor_mating=prob_neighbor_mating,
        **(defaults | kwargs),
    )


class TchebycheffMOEAD(MOEAD):
    """MOEA/D with two-objective Tchebycheff sub-problems, as Zhang and Li publish it.

    Sub-problem i minimises max_j w_ij |f_j - z_j| / s_j: w the weight vectors (i / (n - 1), 1 - i / (n - 1)),
    z the best value of each objective found so far (at first, in the initial population), s = 1 (the raw
    objectives) or the ranges of the initial population. In each generation every sub-problem, in random
    order, makes one child of two different neighbours; the child replaces whatever it is not worse than in
    the whole neighbourhood.

    Differences from pymoo's ``MOEAD``, whose interface it keeps (``ask`` gives one individual at a time):

    * operators are told the ``algorithm``, its ``evaluator`` and the ``score`` that the sub-problem
      minimises, so that `OAX` works, and works on that;
    * it can be pickled at any time, in the middle of a generation too;
    * ``result.X`` and ``result.F`` list each solution once, however many sub-problems it solves.

    Parameters
    ----------
    pop_size : int
        Number of sub-problems, at least 2.
    normalised : bool
        Whether to divide the objectives by their ranges in the initial population.
    n_neighbors : int
        Size of the neighbourhood, the sub-problem itself included, at least 2.
    prob_neighbor_mating : float
        Probability of choosing both parents in the neighbourhood, else in the whole population.
    **kwargs
        Further arguments of ``MOEAD``.

    Raises
    ------
    ValueError
        If there are fewer than 2 sub-problems or neighbours, if ``prob_neighbor_mating`` is not in [0, 1],
        and when set up for a problem with constraints or with other than two objectives, or given an initial
        population of another size.
    """

    def __init__(
        self,
        pop_size: int = POP_SIZE,
        *,
        normalised: bool = False,
        n_neighbors: int = NEIGHBOURHOOD,
        prob_neighbor_mating: float = 1.0,
        **kwargs: Any,
    ) -> None:
        if pop_size < 2:
            raise ValueError(f"pop_size = {pop_size}: MOEA/D needs at least 2 weight vectors")
        if n_neighbors < 2:
            raise ValueError(f"n_neighbors = {n_neighbors}: the two parents come from at least 2 of them")
        weight = np.arange(pop_size) / (pop_size - 1)
        kwargs.setdefault("termination", ("n_gen", GENERATIONS))
        super().__init__(
            ref_dirs=np.column_stack([weight, 1 - weight]),
            n_neighbors=n_neighbors,
            prob_neighbor_mating=require_probability("prob_neighbor_mating", prob_neighbor_mating),
            **kwargs,
        )
        self.normalised = normalised
        self.prob_neighbor_mating = prob_neighbor_mating
        self.scale = np.ones(2)
        self.ideal = np.full(2, np.inf)
        # The running generation: sub-problems in order, the parents for each, the next one to serve.
        self.order: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self.parents: NDArray[np.int64] = np.empty((0, 2), dtype=np.int64)
        self.position = 0

    def _setup(self, problem: Problem, **kwargs: Any) -> None:
        if problem.has_constraints():
            raise ValueError(
                "MOEA/D takes no constraints; drop max_triangles= and max_error= from the problem, or use NSGA-II"
            )
        if problem.n_obj != 2:
            raise ValueError(f"MOEA/D here decomposes two objectives, the problem has {problem.n_obj}; use nsga3()")
        super()._setup(problem, **kwargs)
        # By index, not by distance between weight vectors, where rounding decides between the two sides.
        n = len(self.ref_dirs)
        index = np.arange(n)
        self.neighbors = np.argsort(np.abs(index[:, None] - index), axis=1, kind="stable")[:, : self.n_neighbors]

    def _initialize_advance(self, infills: Any = None, **kwargs: Any) -> None:
        if len(infills) != self.pop_size:
            raise ValueError(
                f"the initial population has {len(infills)} individuals for {self.pop_size} sub-problems; "
                "give as many as pop_size"
            )
        super()._initialize_advance(infills, **kwargs)
        if self.normalised:
            extent = np.ptp(self.pop.get("F"), axis=0)
            self.scale = np.where(extent > 0, extent, 1.0)

    def _infill(self) -> Any:
        if self.position == len(self.order):
            self._begin_generation()
        pair = self.pop[self.parents[self.position]]
        children = self.mating.do(
            self.problem,
            self.pop,
            1,
            parents=pair[None, :],
            n_max_iterations=1,
            random_state=self.random_state,
            algorithm=self,
            evaluator=self.evaluator,
            score=partial(self.tchebycheff, subproblems=self.order[self.position]),
        )
        return children[0]

    def _begin_generation(self) -> None:
        rng, n = self.random_state, len(self.pop)
        self.order, self.position = rng.permutation(n), 0
        # Two different places, in the neighbourhood of each sub-problem or among all.
        local = rng.random(n) < self.prob_neighbor_mating
        n_choices = np.where(local, self.neighbors.shape[1], n)
        one, other = rng.integers(n_choices), rng.integers(n_choices - 1)
        other += other >= one
        self.parents = np.column_stack([one, other])
        near = self.neighbors[self.order[local]]
        self.parents[local] = np.take_along_axis(near, self.parents[local], axis=1)

    def _advance(self, infills: Any = None, **kwargs: Any) -> bool:
        self.ideal = np.minimum(self.ideal, infills.F)
        self._replace(self.order[self.position], infills)
        self.position += 1
        return self.position == len(self.order)

    def tchebycheff(self, F: NDArray[np.float64], subproblems: NDArray[np.integer]) -> NDArray[np.float64]:
        """Value of solutions for sub-problems (Eq. 7), with the best objectives known now.

        Parameters
        ----------
        F : (n, 2) float array
            Objectives.
        subproblems : (n,) int array or int
            One sub-problem for each row, or one for all.

        Returns
        -------
        (n,) float array
            max_j w_j |f_j - z_j| / s_j.
        """
        return np.max(np.abs(F - self.ideal) * (self.ref_dirs[subproblems] / self.scale), axis=1)

    def _replace(self, k: int, off: Any) -> None:
        neighbors = self.neighbors[k]
        current = self.tchebycheff(objectives(self.pop[neighbors]), neighbors)
        offered = self.tchebycheff(off.F[None, :], neighbors)
        self.pop[neighbors[offered <= current]] = off

    def _set_optimum(self) -> None:
        super()._set_optimum()
        self.opt: Any = PackedDuplicates().do(self.opt)
