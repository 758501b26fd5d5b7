"""The paper's algorithms, and a better one, wired: functions that return pymoo algorithms.

=================== ============================================= ==================
preset              algorithm                                     crossover
=================== ============================================= ==================
`nsga2_v1`          NSGA-II                                       uniform
`nsga2_v2`          NSGA-II                                       OAX over L4
`moead`             MOEA/D, Tchebycheff (Eq. 7), neighbourhood 20 uniform
`weighted_ga_v1`    elitist GA on the weighted sum (Eq. 8)        uniform
`weighted_ga_v2`    elitist GA on the weighted sum (Eq. 8)        OAX over L4
`memetic`           not the paper's; annealing down a ladder       none
`nsga3`             not the paper's; NSGA-III, three objectives uniform
=================== ============================================= ==================

The paper's all start from random subsets of every size, cross with probability 0.8, mutate by `NeighbourShift` with
probability 1 / N, pin the corners and, except MOEA/D, eliminate duplicates. The paper gives each 50
generations of 100; that is a termination which the caller passes (``minimize(problem, nsga2_v1(), ("n_gen",
50), seed=1)``), and what the presets use when none is passed. Any other argument of the pymoo algorithm can
be given by keyword, an operator too: ``nsga2_v1(mutation=NeighbourShift(along="mesh"))``.

All of them give ``result.X`` (k, N) and ``result.F`` (k, 2): error and number of triangles, the error in the measure
of the problem (``MeshProblem(..., objectives=("rms_error", "triangles"))``). Only `nsga3` takes more than one measure.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.operators.selection.tournament import TournamentSelection
from pymoo.util.display.column import Column
from pymoo.util.display.output import Output
from pymoo.util.ref_dirs import get_reference_directions

from meshsimp_pymoo.search.memetic import memetic
from meshsimp_pymoo.search.operators import (
    OAX,
    NeighbourShift,
    PackedDuplicates,
    PinnedCorners,
    RandomSubset,
    SubsetUniformCrossover,
)
from meshsimp_pymoo.search.requirements import require_probability

# The paper's settings.
POP_SIZE = 100
CROSSOVER_PROBABILITY = 0.8
NEIGHBOURHOOD = 20
GENERATIONS = 50


# presets -----------------------------------------------------------------------------------------


def nsga2_v1(pop_size: int = POP_SIZE, **kwargs: Any) -> NSGA2:
    """NSGA-II with uniform crossover, the paper's first version.

    Parameters
    ----------
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of ``pymoo.algorithms.moo.nsga2.NSGA2``; they replace the preset's own.
    """
    return _nsga2(pop_size, {"crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY)} | kwargs)


def nsga2_v2(pop_size: int = POP_SIZE, **kwargs: Any) -> NSGA2:
    """NSGA-II with the orthogonal-array crossover over L4, the paper's second version.

    A generation costs about 2.2 times the evaluations of `nsga2_v1` (3 per crossing pair more, see `OAX`):
    compare the two at equal evaluations as well as at equal generations.

    Parameters
    ----------
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of ``pymoo.algorithms.moo.nsga2.NSGA2``; they replace the preset's own.
    """
    return _nsga2(pop_size, {"crossover": OAX("L4", prob=CROSSOVER_PROBABILITY)} | kwargs)


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
    defaults = _operators() | {"crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY, n_offsprings=1)}
    return TchebycheffMOEAD(
        pop_size,
        normalised=normalised,
        n_neighbors=n_neighbors,
        prob_neighbor_mating=prob_neighbor_mating,
        **(defaults | kwargs),
    )


def weighted_ga_v1(w: float, pop_size: int = POP_SIZE, **kwargs: Any) -> WeightedGA:
    """Elitist GA on the weighted sum with uniform crossover, the paper's single-objective method.

    Parameters
    ----------
    w : float
        Weight of the error, in [0, 1]; the triangles weigh 1 - w. The paper runs 0, 0.1, ..., 1.
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of `WeightedGA`; they replace the preset's own.
    """
    defaults = _operators() | {"crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY)}
    return WeightedGA(w, pop_size, **(defaults | kwargs))


def weighted_ga_v2(w: float, pop_size: int = POP_SIZE, **kwargs: Any) -> WeightedGA:
    """Elitist GA on the weighted sum with the orthogonal-array crossover over L4, second version.

    The main effects of the crossover are those on the weighted sum.

    Parameters
    ----------
    w : float
        Weight of the error, in [0, 1]; the triangles weigh 1 - w. The paper runs 0, 0.1, ..., 1.
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of `WeightedGA`; they replace the preset's own.
    """
    defaults = _operators() | {"crossover": OAX("L4", prob=CROSSOVER_PROBABILITY)}
    return WeightedGA(w, pop_size, **(defaults | kwargs))


def nsga3(n_objectives: int = 3, *, n_partitions: int = 12, pop_size: int | None = None, **kwargs: Any) -> NSGA3:
    """NSGA-III (Deb and Jain 2014) with uniform crossover, for more than one measure of the error at once.

    Parameters
    ----------
    n_objectives : int
        Number of objectives of the problem.
    n_partitions : int
        Gaps along each edge of the simplex of reference directions (Das and Dennis 1998): 12 make 91 directions for
        three objectives.
    pop_size : int, optional
        Individuals in the population; by default as many as there are directions.
    **kwargs
        Further arguments of ``pymoo.algorithms.moo.nsga3.NSGA3``; they replace the preset's own.

    Examples
    --------
    The sum of the deviations, their maximum and the number of triangles, all from one evaluation:

    >>> from pymoo.optimize import minimize
    >>> from meshsimp_pymoo import MeshProblem
    >>> problem = MeshProblem("roof:5", objectives=("error", "max_error", "triangles"))
    >>> result = minimize(problem, nsga3(), ("n_gen", 20), seed=1)
    >>> result.F[result.F[:, 2].argmin()].tolist()     # one end of the front: two triangles over the corners
    [10.0, 1.0, 2.0]
    """
    directions = get_reference_directions("das-dennis", n_objectives, n_partitions=n_partitions)
    defaults = _operators() | {
        "crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY),
        "eliminate_duplicates": PackedDuplicates(),
    }
    algorithm = NSGA3(directions, pop_size, **(defaults | kwargs))
    algorithm.termination = kwargs.get("termination", ("n_gen", GENERATIONS))
    return algorithm


# What makes a front of (error, triangles), by name.
PRESETS: dict[str, Callable[..., Any]] = {
    "nsga2_v1": nsga2_v1,
    "nsga2_v2": nsga2_v2,
    "moead": moead,
    "weighted_ga_v1": weighted_ga_v1,
    "weighted_ga_v2": weighted_ga_v2,
    "memetic": memetic,
}


def _operators() -> dict[str, Any]:
    return {"sampling": RandomSubset(), "mutation": NeighbourShift(), "repair": PinnedCorners()}


def _nsga2(pop_size: int, arguments: dict[str, Any]) -> NSGA2:
    defaults = _operators() | {
        "selection": TournamentSelection(func_comp=crowded_tournament),
        "eliminate_duplicates": PackedDuplicates(),
    }
    algorithm = NSGA2(pop_size, **(defaults | arguments))
    # pymoo's constructor puts its default here whatever is passed; that default cannot compare bool vectors.
    algorithm.termination = arguments.get("termination", ("n_gen", GENERATIONS))
    return algorithm


# choosing between solutions ----------------------------------------------------------------------


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
    F, violation = _objectives(pop), _violation(pop)
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


def score_tournament(
    pop: Any,
    P: NDArray[np.integer],
    *,
    algorithm: WeightedGA,
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
    violation, score = _violation(pop), algorithm.score(pop)
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


def _objectives(pop: Any) -> NDArray[np.float64]:
    """``pop.get("F")`` at a third of the time: tournaments are held several times in each generation."""
    return np.array([individual.F for individual in pop])


def _violation(pop: Any) -> NDArray[np.float64]:
    """``pop.get("CV")[:, 0]``, in the same way."""
    return np.array([individual.CV[0] for individual in pop])


# MOEA/D ------------------------------------------------------------------------------------------


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
                "MOEA/D takes no constraints; drop max_triangles= and max_error= from the problem, "
                "or use NSGA-II"
            )
        if problem.n_obj != 2:
            raise ValueError(f"MOEA/D here decomposes two objectives, the problem has {problem.n_obj}; use nsga3()")
        super()._setup(problem, **kwargs)
        # By index, not by distance between weight vectors, where rounding decides between the two sides.
        n = len(self.ref_dirs)
        index = np.arange(n)
        self.neighbors = np.argsort(np.abs(index[:, None] - index), axis=1, kind="stable")[
            :, : self.n_neighbors
        ]

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
        current = self.tchebycheff(_objectives(self.pop[neighbors]), neighbors)
        offered = self.tchebycheff(off.F[None, :], neighbors)
        self.pop[neighbors[offered <= current]] = off

    def _set_optimum(self) -> None:
        super()._set_optimum()
        self.opt: Any = PackedDuplicates().do(self.opt)


# weighted sum ------------------------------------------------------------------------------------


def weighted_sum(F: NDArray[np.float64], w: float) -> NDArray[np.float64]:
    """Weight the error by w and the number of triangles by 1 - w (Eq. 8 of the paper), unscaled.

    Parameters
    ----------
    F : (n, 2) or (n, 1) float array
        Error [file units] and number of triangles; or values that are weighted already, which are returned.
    w : float
        Weight of the error.

    Returns
    -------
    (n,) float array
        The sums, minimised.

    Examples
    --------
    >>> weighted_sum(np.array([[10.0, 2.0]]), 0.5).tolist()
    [6.0]
    """
    return F[:, 0] if F.shape[1] == 1 else w * F[:, 0] + (1 - w) * F[:, 1]


class WeightedSum(Problem):
    """The weighted sum of a mesh problem's two objectives (Eq. 8) as a problem of its own.

    For single-objective algorithms other than `WeightedGA` (which does not need it). F is w * error + (1 - w)
    * triangles, raw as in the paper: the error counts in file units, in the measure that the problem minimises.
    Constraints and all further numbers of the problem are passed on; the error (the sum) and the triangles are kept
    with each solution: ``result.opt.get("error", "triangles")``. Can be pickled, unlike pymoo's
    ``MultiToSingleObjective``.

    Parameters
    ----------
    problem : MeshProblem
        A problem with the two objectives error and triangles; stays reachable as ``.problem``.
    w : float
        Weight of the error, in [0, 1].

    Raises
    ------
    ValueError
        If ``w`` is not in [0, 1] or the problem has other than two objectives.
    """

    def __init__(self, problem: Problem, w: float) -> None:
        if problem.n_obj != 2:
            raise ValueError(f"WeightedSum weighs two objectives, the problem has {problem.n_obj}")
        self.w = require_probability("w", w)
        self.problem = problem
        super().__init__(
            n_var=problem.n_var,
            n_obj=1,
            n_ieq_constr=problem.n_ieq_constr,
            n_eq_constr=problem.n_eq_constr,
            xl=problem.xl,
            xu=problem.xu,
            vtype=problem.vtype,
        )

    @property
    def pinned(self) -> NDArray[np.bool_]:
        """The vertices that the inner problem pins, (N,) bool."""
        return self.problem.pinned

    @property
    def model(self) -> Any:
        """The inner problem's model."""
        return self.problem.model

    def _evaluate(self, X: NDArray[np.bool_], out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out |= self.problem.evaluate(X, return_as_dictionary=True)
        error, out["triangles"] = out["F"].T
        out.setdefault("error", error)
        out["F"] = weighted_sum(out["F"], self.w)


class WeightedOutput(Output):
    """What ``verbose=True`` prints for a `WeightedGA`: the best and the mean weighted sum."""

    def __init__(self) -> None:
        super().__init__()
        self.best = Column("best")
        self.mean = Column("mean")
        self.columns += [self.best, self.mean]

    def update(self, algorithm: WeightedGA) -> None:
        """Read the numbers of the generation."""
        super().update(algorithm)
        self.best.set(float(algorithm.score(algorithm.opt)[0]))
        self.mean.set(float(algorithm.score(algorithm.pop).mean()))


class WeightedGA(GA):
    """Generational, elitist genetic algorithm on the weighted sum of error and triangles (Eq. 8).

    Takes the two-objective problem itself and weighs inside: every individual keeps both objectives, and the
    result is the best solution found, ``result.X`` (1, N) and ``result.F`` (1, 2), as from the
    multi-objective algorithms. The weighted sum is raw as in the paper: with an error in the ten-thousands
    and triangles in the hundreds, most weights between 0 and 1 mean the error. A problem that is a
    `WeightedSum` already is accepted too; the result then is pymoo's for one objective, ``result.F`` (1,),
    and ``result.opt.get("error", "triangles")`` gives the two.

    Parents win a binary tournament; the children replace the population, except that the ``n_elite`` best of
    the old one compete with them (the worst are dropped): the best solution is never lost. Solutions that
    violate a constraint come after all that do not.

    Parameters
    ----------
    w : float
        Weight of the error, in [0, 1]; the triangles weigh 1 - w.
    pop_size : int
        Individuals in the population.
    n_elite : int
        How many of the old population compete with the children; ``pop_size`` makes it pymoo's
        plus-selection.
    **kwargs
        Further arguments of ``pymoo.algorithms.soo.nonconvex.ga.GA``.

    Raises
    ------
    ValueError
        If ``w`` is not in [0, 1] or ``n_elite`` not in 1 ... ``pop_size``, and when set up for a problem with
        other than two objectives that is not a `WeightedSum` with the same weight.
    """

    def __init__(self, w: float, pop_size: int = POP_SIZE, *, n_elite: int = 1, **kwargs: Any) -> None:
        self.w = require_probability("w", w)
        if not 1 <= n_elite <= pop_size:
            raise ValueError(f"n_elite = {n_elite} is not in 1 ... pop_size = {pop_size}; one must survive")
        self.n_elite = n_elite
        defaults = {
            "selection": TournamentSelection(func_comp=score_tournament),
            "eliminate_duplicates": PackedDuplicates(),
            "output": WeightedOutput(),
        }
        super().__init__(pop_size, **(defaults | kwargs))
        # pymoo's constructor puts its default here whatever is passed.
        self.termination = kwargs.get("termination", ("n_gen", GENERATIONS))

    def score(self, pop: Any) -> NDArray[np.float64]:
        """Return the weighted sum of each individual, (n,)."""
        return weighted_sum(_objectives(pop), self.w)

    def _setup(self, problem: Problem, **kwargs: Any) -> None:
        if isinstance(problem, WeightedSum):
            if problem.w != self.w:
                raise ValueError(f"the problem is weighted by w = {problem.w}, the algorithm by w = {self.w}")
        elif problem.n_obj != 2:
            raise ValueError(
                f"the weighted sum needs the two objectives error and triangles, {type(problem).__name__} "
                f"has {problem.n_obj}; pass a MeshProblem or WeightedSum(problem, {self.w})"
            )

    def _initialize_advance(self, infills: Any = None, **kwargs: Any) -> None:
        self.pop = self._best_first(infills)

    def _infill(self) -> Any:
        off = self.mating.do(
            self.problem,
            self.pop,
            self.n_offsprings,
            algorithm=self,
            random_state=self.random_state,
            score=partial(weighted_sum, w=self.w),
        )
        if len(off) == 0:  # every child is a duplicate, again and again: as in pymoo, the end
            self.termination.force_termination = True
            return None
        return off

    def _advance(self, infills: Any = None, **kwargs: Any) -> None:
        if infills is None:
            return
        n_elite = max(self.n_elite, self.pop_size - len(infills))
        competing = Population.merge(self.pop[:n_elite], infills)
        self.pop = self._best_first(competing)[: self.pop_size]

    def _best_first(self, pop: Any) -> Any:
        return pop[np.lexsort([self.score(pop), _violation(pop)])]

    def _set_optimum(self) -> None:
        self.opt = self.pop[:1]
