"""The paper's single-objective method: an elitist genetic algorithm on the weighted sum of both objectives."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.operators.selection.tournament import TournamentSelection
from pymoo.util.display.column import Column
from pymoo.util.display.output import Output

from meshsimp_pymoo.reprs import in_short, of_algorithm
from meshsimp_pymoo.search.operators import (
    OAX,
    HalfPlaneCrossover,
    PackedDuplicates,
    RandomSubset,
    SubsetUniformCrossover,
)
from meshsimp_pymoo.search.operators.oax import Score
from meshsimp_pymoo.search.operators.random_subset import Size
from meshsimp_pymoo.search.paper import CROSSOVER_PROBABILITY, GENERATIONS, POP_SIZE, paper_operators
from meshsimp_pymoo.search.requirements import require_probability
from meshsimp_pymoo.search.selection import objectives, score_tournament, violations


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
    defaults = paper_operators() | {"crossover": SubsetUniformCrossover(CROSSOVER_PROBABILITY)}
    return WeightedGA(w, pop_size, **(defaults | kwargs))


def weighted_ga_v2(w: float, pop_size: int = POP_SIZE, *, effects: str = "weighted_sum", **kwargs: Any) -> WeightedGA:
    """Elitist GA on the weighted sum with the orthogonal-array crossover over L4, second version.

    Parameters
    ----------
    w : float
        Weight of the error, in [0, 1]; the triangles weigh 1 - w. The paper runs 0, 0.1, ..., 1.
    pop_size : int
        Individuals in the population.
    effects : {"weighted_sum", "error"}
        What the main effects of the crossover are computed on (Eq. 5). The paper's text says "the total approximation
        error determined by Eq. (4)" whatever the weight, and "In a minimization problem" of the fitness function,
        which is Eq. 8 here. By default it is what the algorithm minimises: with w = 0 effects on the error would look
        for what does not count. "error" is the text to the letter.
    **kwargs
        Further arguments of `WeightedGA`; they replace the preset's own.

    Raises
    ------
    ValueError
        If ``effects`` is unknown, or given beside a crossover; when run with "error" on a `WeightedSum`.
    """
    if effects not in EFFECTS:
        raise ValueError(f"effects = {effects!r} is unknown; choose one of {', '.join(EFFECTS)}")
    if effects != "weighted_sum" and "crossover" in kwargs:
        raise ValueError(f"effects = {effects!r} is for the preset's own crossover; leave one of the two out")
    crossover = OAX("L4", prob=CROSSOVER_PROBABILITY, score=EFFECTS[effects])
    return WeightedGA(w, pop_size, **(paper_operators() | {"crossover": crossover} | kwargs))


def fujiwara_sawai(size: Size, pop_size: int = POP_SIZE, **kwargs: Any) -> WeightedGA:
    """Elitist GA on the error alone at one number of points, with a crossover in the plane, after Fujiwara and Sawai.

    The forerunner of the paper's methods (Sec. 2.3): a number of points is given, and a genetic algorithm looks for
    those whose Delaunay triangulation has the least error. Here all individuals keep ``size`` vertices: the first
    population, its children (`HalfPlaneCrossover`) and mutants (`NeighbourShift`) alike. In the manner of [1]_, with
    the paper's probabilities and elitism, not a copy of it; vertices that children lack or have too many are chosen
    well, not at random, and what that takes is not counted as evaluations. A run gives one mesh: in an experiment
    ``merged_over: {size: [0.02, 0.05, 0.1, 0.2]}`` makes a front.

    Parameters
    ----------
    size : int or float
        Vertices to keep: a number or a share, see `RandomSubset`.
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of `WeightedGA`; they replace the preset's own.

    References
    ----------
    .. [1] Y. Fujiwara and H. Sawai, "Evolutionary computation applied to mesh optimization of a 3-D facial image",
       IEEE Transactions on Evolutionary Computation 3(2), 1999.
    """
    return _at_one_size(size, pop_size, HalfPlaneCrossover(CROSSOVER_PROBABILITY, keep_size=True), kwargs)


def huang_ho(size: Size, pop_size: int = POP_SIZE, **kwargs: Any) -> WeightedGA:
    """Elitist GA on the error alone at one number of points, with the orthogonal-array crossover, after Huang and Ho.

    What the paper extends to two objectives (Sec. 2.3, 3.6): as `fujiwara_sawai`, with `OAX` over L4 and its main
    effects on the error. In the manner of [1]_, without its coarse-to-fine stages.

    Parameters
    ----------
    size : int or float
        Vertices to keep: a number or a share, see `RandomSubset`.
    pop_size : int
        Individuals in the population.
    **kwargs
        Further arguments of `WeightedGA`; they replace the preset's own.

    References
    ----------
    .. [1] H.-L. Huang and S.-Y. Ho, "Mesh optimization for surface approximation using an efficient coarse-to-fine
       evolutionary algorithm", Pattern Recognition 36, 2003.
    """
    return _at_one_size(size, pop_size, OAX("L4", prob=CROSSOVER_PROBABILITY, keep_size=True), kwargs)


def _at_one_size(size: Any, pop_size: int, crossover: Any, kwargs: dict[str, Any]) -> WeightedGA:
    own = paper_operators() | {"sampling": RandomSubset(size), "crossover": crossover}
    return WeightedGA(1.0, pop_size, **(own | kwargs))


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


def error_alone(F: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the error (Eq. 4) of solutions, which a `WeightedSum` does not show."""
    if F.shape[1] == 1:
        raise ValueError("effects = 'error' needs both objectives; give the problem itself, not a WeightedSum of it")
    return F[:, 0]


# On what main effects are computed, by name; None: what the algorithm passes.
EFFECTS: dict[str, Score | None] = {"weighted_sum": None, "error": error_alone}


class WeightedSum(Problem):
    """The weighted sum of a mesh problem's two objectives (equation 8) as a problem of its own.

    For single-objective algorithms other than `WeightedGA` (which does not need it). F is w * error + (1 - w)
    * triangles, raw as in the paper: the error counts in file units, in the measure that the problem minimises.
    Constraints, all further numbers and all attributes (``surface``, ``mesh``, ...) of the problem are passed on; the
    error (the sum) and the triangles are kept with each solution: ``result.opt.get("error", "triangles")``. Can be
    pickled, unlike pymoo's ``MultiToSingleObjective``.

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

    Examples
    --------
    All four corners of a roof: its ridge of three vertices falls by 1 each, and two triangles are left.

    >>> from meshsimp_pymoo import MeshProblem
    >>> problem = WeightedSum(MeshProblem("roof:3"), 0.5)
    >>> problem.evaluate(problem.pinned[None]).tolist()
    [[2.5]]
    """

    def __init__(self, problem: Problem, w: float) -> None:
        """Weigh the objectives of a problem."""
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

    def __repr__(self) -> str:
        return f"WeightedSum({in_short(self.problem)}, {self.w:g})"

    def __getattr__(self, name: str) -> Any:
        # All else – pinned, surface, regions, mesh(), whatever an operator reads – is the inner problem's. Not before
        # there is one (pickle asks an empty object), and nothing private or special, which speaks of one object alone.
        if name.startswith("_") or "problem" not in vars(self):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return getattr(self.problem, name)

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
    """Generational, elitist genetic algorithm on the weighted sum of error and triangles (equation 8).

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

    def __repr__(self) -> str:
        return of_algorithm(self, f"w = {self.w:g}", f"{self.pop_size:,} individuals")

    def score(self, pop: Any) -> NDArray[np.float64]:
        """Return the weighted sum of each individual, (n,)."""
        return weighted_sum(objectives(pop), self.w)

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
        return pop[np.lexsort([self.score(pop), violations(pop)])]

    def _set_optimum(self) -> None:
        self.opt = self.pop[:1]
