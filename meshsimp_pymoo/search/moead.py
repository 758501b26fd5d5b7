"""MOEA/D with the Tchebycheff decomposition, as Zhang and Li publish it and as the paper has it."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.mating import Mating
from pymoo.core.problem import Problem

from meshsimp_pymoo.reprs import of_algorithm
from meshsimp_pymoo.search.operators import NeighbourShift, PackedDuplicates, PinnedCorners, SubsetUniformCrossover
from meshsimp_pymoo.search.operators.neighbour_shift import shift_drawn
from meshsimp_pymoo.search.operators.subset_uniform_crossover import from_either
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
    """MOEA/D (Zhang and Li 2007) with the Tchebycheff decomposition (equation 7) and uniform crossover.

    Parameters
    ----------
    pop_size : int
        Number of sub-problems: weight vectors (i / (n - 1), 1 - i / (n - 1)), at least 2.
    normalised : bool
        False: the raw objectives, as in the paper. The error (in file units) and the number of triangles then
        have the influence that their units happen to give them. True: both are divided by their ranges, from the
        best value found so far to the worst in the population, anew in each generation (Zhang and Li 2007, Sec. V).
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
    objectives) or their ranges now. In each generation every sub-problem, in random order, makes one child of two
    different neighbours; the child replaces whatever it is not worse than in the whole neighbourhood.

    What of it is the paper's (Sec. 3.5, 3.8):

    * z begins as the best of the initial population, W = 20 neighbours, weights as in Zhang and Li, ``<=`` in the
      replacement of neighbours: as printed.
    * Eq. 7 prints the minimum over the weighted distances; it is the maximum, as in Zhang and Li, or the better
      objective alone would count.
    * "If z_j < f_j(y') then set z_j = f_j(y')" is the rule of Zhang and Li, who maximise; where both objectives are
      minimised z falls.
    * The paper's crossover makes two offspring and its update takes one y; here one is made. The paper serves the
      sub-problems in the order of their weights, here the order is random, as in pymoo. Its two indices from the
      neighbourhood may coincide, these do not.

    **Ranges.** ``normalised=True`` divides by s = (worst value in the population) - z, with the population and z at the
    beginning of each generation, as Zhang and Li do ("the largest value of f_i in the current population" for the
    nadir point). The range follows the front wherever the search began: random subsets of a single size vary in the
    number of triangles by ten or so, and a range that stays there lets the triangles decide everything.

    Differences from pymoo's ``MOEAD``, whose interface it keeps (``ask`` gives one individual at a time):

    * ``next`` does a generation, not one sub-problem; with the paper's operators, whose random numbers do not depend
      on the parents, it draws for a generation at once and makes the children without populations around them: the
      same children as one gets by ``ask``;
    * operators are told the ``algorithm``, its ``evaluator`` and the ``score`` that the sub-problem
      minimises, so that `OAX` works, and works on that;
    * it can be pickled at any time, in the middle of a generation too;
    * ``result.X`` and ``result.F`` list each solution once, however many sub-problems it solves.

    Parameters
    ----------
    pop_size : int
        Number of sub-problems, at least 2.
    normalised : bool
        Whether to divide the objectives by their ranges, those at the beginning of each generation.
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
        # What was drawn for it: which genes children take from the second parent (packed), where the moves of each
        # child begin, and the moves. Empty where operators are asked child by child.
        self.from_second: NDArray[np.uint8] = np.empty((0, 0), dtype=np.uint8)
        self.shifts: tuple[NDArray[np.int64], ...] = ()

    def __repr__(self) -> str:
        facts = [f"{len(self.ref_dirs):,} sub-problems", f"{self.n_neighbors} neighbours"]
        return of_algorithm(self, *facts, *["objectives by their ranges"] * self.normalised)

    def _setup(self, problem: Problem, **kwargs: Any) -> None:
        if problem.has_constraints():
            raise ValueError(
                "MOEA/D takes no constraints; drop max_triangles= and max_objective= from the problem, or use NSGA-II"
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

    def next(self) -> None:
        """Do the rest of a generation: all sub-problems that have not been served."""
        if self.is_initialized:
            if self.position == len(self.order):
                self._begin_generation()
            # whoever takes part in evaluating is shown every child as pymoo shows it
            alone = type(self.evaluator) is Evaluator and self.evaluator.callback is None and self.archive is None
            while self.position < len(self.order) - 1:
                if alone and self.shifts:
                    self._serve()
                else:
                    super().next()
        super().next()

    def _serve(self) -> None:
        """Do what ``super().next()`` does before the end of a generation, at a third of the time."""
        child, evaluator = self._infill(), self.evaluator
        out = self.problem.evaluate(
            child.X, return_values_of=evaluator.evaluate_values_of, return_as_dictionary=True, algorithm=self
        )
        child.set_by_dict(**out, n_gen=self.n_iter, n_iter=self.n_iter)
        child.evaluated.update(out)
        evaluator.n_eval += 1
        self._advance(child)

    def _infill(self) -> Individual:
        if self.position == len(self.order):
            self._begin_generation()
        pair = self.pop[self.parents[self.position]]
        if self.shifts:
            return Individual(X=self._child(*[parent.X for parent in pair]))
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
        child: Individual = children[0]
        return child

    def _child(self, first: NDArray[np.bool_], second: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the child, (N,), of two parents by the paper's operators, with what was drawn for it."""
        starts, vertex, target = self.shifts
        child = from_either(first, second, self.from_second[self.position])
        mine = slice(*starts[self.position : self.position + 2])
        shift_drawn(child, vertex[mine], target[mine])
        child |= self.problem.pinned
        return child

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
        if self.normalised:
            extent = objectives(self.pop).max(axis=0) - self.ideal
            self.scale = np.where(extent > 0, extent, 1.0)
        self.moves = ()
        if self._draws_ahead():
            self.from_second = self.mating.crossover.draw(n, self.problem.n_var, rng)
            self.shifts = self.mating.mutation.draw(self.problem, n, rng)

    def _draws_ahead(self) -> bool:
        """Whether children are made by the paper's operators and nothing else."""
        mating = self.mating
        operators = (mating.crossover, mating.mutation, mating.repair)
        return (
            type(mating) is Mating
            and tuple(map(type, operators)) == (SubsetUniformCrossover, NeighbourShift, PinnedCorners)
            and mating.crossover.n_offsprings == 1
            and all(operator.repair is None and operator.vtype is None for operator in operators)
        )

    def _advance(self, infills: Any = None, **kwargs: Any) -> bool:
        # the paper prints z_j < f_j, the rule for maximising
        self.ideal = np.minimum(self.ideal, infills.F)
        self._replace(self.order[self.position], infills)
        self.position += 1
        return self.position == len(self.order)

    def tchebycheff(self, F: NDArray[np.float64], subproblems: NDArray[np.integer]) -> NDArray[np.float64]:
        """Value of solutions for sub-problems (Eq. 7), with the best objectives known now.

        Parameters
        ----------
        F : (..., n, 2) float array
            Objectives.
        subproblems : (n,) int array or int
            One sub-problem for each row, or one for all.

        Returns
        -------
        (..., n) float array
            max_j w_j |f_j - z_j| / s_j.
        """
        # the paper prints min_j, which Zhang and Li, its source, have not
        weighted = np.abs(F - self.ideal) * (self.ref_dirs[subproblems] / self.scale)
        return np.maximum(weighted[..., 0], weighted[..., 1])

    def _replace(self, k: int, off: Any) -> None:
        neighbors = self.neighbors[k]
        F = np.empty((2, len(neighbors), 2))
        F[0], F[1] = objectives(self.pop[neighbors]), off.F
        current, offered = self.tchebycheff(F, neighbors)
        self.pop[neighbors[offered <= current]] = off

    def _set_optimum(self) -> None:
        super()._set_optimum()
        self.opt: Any = PackedDuplicates().do(self.opt)
