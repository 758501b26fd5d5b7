"""The paper's orthogonal-array crossover: a few evaluations tell which parent has the better segment where."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.population import Population

from meshsimp_pymoo.search.operators.pair_crossover import PairCrossover, of_the_parents_sizes
from meshsimp_pymoo.search.operators.random_bits import random_bits
from meshsimp_pymoo.search.operators.segments import combine, random_cuts
from meshsimp_pymoo.search.requirements import pinned_vertices

# Orthogonal arrays by name and the number of two-level factors (segments) they hold.
ORTHOGONAL_ARRAYS = {"L4": 3, "L8": 7, "L16": 15}

# From objectives (n, n_obj) to one value for each row (n,), minimised.
Score = Callable[[NDArray[np.float64]], NDArray[np.float64]]

# The key in `algorithm.data` under which OAX notes the generation it has already evaluated candidates for.
EVALUATED_GENERATION = "oax_generation"


class OAX(PairCrossover):
    """Orthogonal-array crossover: find out by few evaluations which parent has the better segment where.

    Both parents are cut at the same random places into 3, 7 or 15 contiguous runs of the vector (L4, L8,
    L16), which are patches in space. The rows of the orthogonal array say which parent each segment is taken
    from; the main effect of a segment is the sum of the score over the rows that take it from one parent,
    minus the same for the other (Eq. 5 of the paper; Ho, Shu, Chen 2004). The first child takes every segment
    from the parent with the better sum, the second child is the same except for the segment whose two sums
    differ least.

    **Score.** Main effects are computed on what is being minimised: on the scalar that an algorithm of this
    package passes (the weighted sum in `WeightedGA`, the sub-problem's Tchebycheff value in `moead`), else on
    the first objective, which is the error of a `MeshProblem` (so in NSGA-II, as in the paper) or *the*
    objective of a single-objective problem. ``score=`` replaces all of these. Constraints do not enter.

    **Evaluations.** Row 1 of the array is the first parent, whose objectives are known; the other 3, 7 or 15
    rows of all pairs are evaluated in one batch through the algorithm's own evaluator, hence counted in
    ``n_eval``, with the pinned vertices set. The children are new individuals that the algorithm evaluates as
    always, after mutation and repair. So a crossing pair costs 3 + 2 evaluations with L4, 7 + 2 with L8, 15 +
    2 with L16. Not evaluated: pairs that do not cross; rows that equal a parent or an earlier row because the
    parents agree on some segments. What `MeshProblem` still remembers costs no triangulation but is counted.
    A budget of evaluations is checked by pymoo once per generation, so it can be exceeded by at most one
    generation's candidates and children.

    **Copies.** A segment on which the parents agree cannot distinguish the second child, so it is never
    the one that differs. A child that would be a copy of a parent is replaced by the next best combination
    that the main effects predict; only parents that differ in fewer than two segments have themselves as
    children. The published rule has none of this: with ``copies=True`` the second child is the first one with the
    segment flipped that has the least main effect difference of all, and whatever comes of it is a child. Of random
    subsets of a face a copy of a parent comes of it for about 95 % of the pairs of any sizes (one segment from the
    smaller parent hardly ever helps the error), for 40 % of those of equal size.

    **Refilling.** When pymoo repeats the mating within a generation in order to refill eliminated duplicates,
    those pairs are recombined at random along the same kind of cuts, without evaluations: otherwise a
    converged population could spend a hundred generations' evaluations in one.

    An ``archive`` given to the algorithm receives the evaluated rows too.

    Parameters
    ----------
    arrays : {"L4", "L8", "L16"}
        The orthogonal array: 3, 7 or 15 segments.
    prob : float
        The probability of a pair to cross (0.8 in the paper).
    n_offsprings : {2, 1}
        Children per pair; with 1, the first one alone. MOEA/D uses one.
    copies : bool
        Whether children may be copies of a parent, or of each other, as in the published rule.
    keep_size : bool
        Add or drop vertices, good ones of a few drawn, until each child has as many as its first parent (the second
        child: as the second). The rows that are evaluated have whatever falls to them.
    score : callable, optional
        Maps F, (n, n_obj), to what the main effects are computed on, (n,), minimised.
    evaluator : pymoo.core.evaluator.Evaluator, optional
        Needed only inside algorithms that do not tell their operators who is calling (pymoo's own MOEAD; not
        our `moead`): the one that is also given to the algorithm, so that all evaluations are counted in one
        place.

    Raises
    ------
    ValueError
        If ``arrays`` is unknown, ``prob`` is not in [0, 1], ``n_offsprings`` is neither 1 nor 2, or the model
        has fewer vertices than there are segments.
    RuntimeError
        When called without any evaluator.
    TypeError
        When applied to a problem without ``pinned`` or to chromosomes that are not bool.

    References
    ----------
    .. [1] H.-L. Huang and S.-Y. Ho, "Mesh optimization for surface approximation using an efficient
       coarse-to-fine evolutionary algorithm", Pattern Recognition 36, 2003.
    .. [2] S.-Y. Ho, L.-S. Shu and J.-H. Chen, "Intelligent evolutionary algorithms for large parameter
       optimization problems", IEEE Transactions on Evolutionary Computation 8(6), 2004.
    """

    def __init__(
        self,
        arrays: str = "L4",
        *,
        prob: float = 0.8,
        n_offsprings: int = 2,
        copies: bool = False,
        keep_size: bool = False,
        score: Score | None = None,
        evaluator: Evaluator | None = None,
    ) -> None:
        if arrays not in ORTHOGONAL_ARRAYS:
            raise ValueError(f"arrays = {arrays!r} is unknown; choose one of {', '.join(ORTHOGONAL_ARRAYS)}")
        super().__init__(prob, n_offsprings)
        self.arrays = arrays
        self.copies = copies
        self.keep_size = keep_size
        self.score = score
        self.evaluator = evaluator

    def _do(
        self,
        problem: Any,
        X: NDArray[np.bool_],
        *args: Any,
        random_state: np.random.Generator,
        mates: Sequence[Sequence[Individual]] | None = None,
        algorithm: Any = None,
        evaluator: Evaluator | None = None,
        score: Score | None = None,
        **kwargs: Any,
    ) -> NDArray[np.bool_]:
        score = self.score or score or first_objective
        pinned = pinned_vertices(problem, self)
        _, n_matings, n_vertices = X.shape
        array = orthogonal_array(ORTHOGONAL_ARRAYS[self.arrays])
        n_segments = array.shape[1]
        if n_vertices < n_segments:
            raise ValueError(
                f"OAX(arrays={self.arrays!r}) cuts the vector into {n_segments} segments, but the model has "
                f"only {n_vertices} vertices; use a smaller array or SubsetUniformCrossover()"
            )
        first, second = X[0] | pinned, X[1] | pinned
        cuts = np.array([random_cuts(n_vertices, n_segments, random_state) for _ in range(n_matings)])

        if evaluator is None and algorithm is not None:
            evaluator = algorithm.evaluator
            # pymoo repeats the mating of one generation only to refill eliminated duplicates.
            if algorithm.data.get(EVALUATED_GENERATION) == algorithm.n_iter:
                levels = random_bits((n_matings, n_segments), random_state)
                return self._children(problem, first, second, cuts, np.stack([levels, ~levels], axis=1), random_state)
            algorithm.data[EVALUATED_GENERATION] = algorithm.n_iter
        evaluator = evaluator if evaluator is not None else self.evaluator
        if evaluator is None:
            raise RuntimeError(
                "OAX evaluates candidate meshes, but this algorithm hands its operators no evaluator "
                "(pymoo's own MOEAD does not); use moead(crossover=OAX(n_offsprings=1)) of this package, or "
                "share one: evaluator = Evaluator(); "
                "MOEAD(..., crossover=OAX(n_offsprings=1, evaluator=evaluator), "
                "evaluator=evaluator)"
            )

        # Rows that are the same mesh, because the parents agree on some segments, are evaluated once.
        differs = np.array([np.logical_or.reduceat(a ^ b, c[:-1]) for a, b, c in zip(first, second, cuts, strict=True)])
        y = np.empty((n_matings, len(array)))
        slots = np.full(y.shape, -1)
        candidates: list[NDArray[np.bool_]] = []
        for k in range(n_matings):
            known = known_scores(mates[k], differs[k], score) if mates is not None else {}
            planned: dict[bytes, int] = {}
            for t, row in enumerate(array):
                key = row[differs[k]].tobytes()
                if key in known:
                    y[k, t] = known[key]
                    continue
                if key not in planned:
                    planned[key] = len(candidates)
                    candidates.append(combine(first[k], second[k], cuts[k], row))
                slots[k, t] = planned[key]
        to_fill = slots >= 0
        if candidates:
            F = evaluated_objectives(problem, candidates, evaluator, algorithm)
            y[to_fill] = score(F)[slots[to_fill]]
        levels = np.array([child_levels(y[k], array, differs[k], copies=self.copies) for k in range(n_matings)])
        return self._children(problem, first, second, cuts, levels, random_state)

    def _children(
        self,
        problem: Any,
        first: NDArray[np.bool_],
        second: NDArray[np.bool_],
        cuts: NDArray[np.integer],
        levels: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> NDArray[np.bool_]:
        children = np.empty((self.n_offsprings, *first.shape), dtype=bool)
        for c in range(self.n_offsprings):
            for k in range(len(first)):
                children[c, k] = combine(first[k], second[k], cuts[k], levels[k, c])
        if self.keep_size:
            return of_the_parents_sizes(problem, self, children, np.stack([first, second]), rng)
        return children


def first_objective(F: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the first column: the error of a `MeshProblem`."""
    return F[:, 0]


def known_scores(pair: Sequence[Individual], differs: NDArray[np.bool_], score: Score) -> dict[bytes, float]:
    """Return the scores of the evaluated parents, by the levels (where segments differ) that make them."""
    return {
        np.full(differs.sum(), level).tobytes(): float(score(parent.F[None, :])[0])
        for level, parent in zip([False, True], pair, strict=True)
        if "F" in parent.evaluated
    }


def evaluated_objectives(
    problem: Any, candidates: list[NDArray[np.bool_]], evaluator: Evaluator, algorithm: Any
) -> NDArray[np.float64]:
    """Evaluate chromosomes on the algorithm's account and show them to its archive; return F (n, n_obj)."""
    pop = Population.create(*[Individual(X=kept) for kept in candidates])
    evaluator.eval(problem, pop, algorithm=algorithm)
    if algorithm is not None and algorithm.archive is not None:
        algorithm.archive = algorithm.archive.add(pop)
    return pop.get("F")


def orthogonal_array(n_factors: int) -> NDArray[np.bool_]:
    """Two-level orthogonal array: every pair of columns holds each pair of levels equally often.

    Built as in Ho's public code: the columns 1, 2, 4, ... alternate in blocks, every other one is the
    exclusive or of the largest of them before it and the column at the remainder.

    Parameters
    ----------
    n_factors : int
        Number of columns, at least 1.

    Returns
    -------
    (2^ceil(log2(n_factors + 1)), n_factors) bool array
        False is level 1 (the first parent), True is level 2. The first row is all False.

    Examples
    --------
    >>> orthogonal_array(3).astype(int).tolist()
    [[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]]
    """
    n_rows = 1 << n_factors.bit_length()
    rows = np.arange(n_rows)
    columns: list[NDArray[np.bool_]] = []
    for c in range(1, n_factors + 1):
        power = 1 << (c.bit_length() - 1)
        if c == power:
            columns.append((rows // (n_rows // (2 * power))) % 2 == 1)
        else:
            columns.append(columns[power - 1] ^ columns[c - power - 1])
    return np.column_stack(columns)


def child_levels(
    y: NDArray[np.float64], array: NDArray[np.bool_], differs: NDArray[np.bool_], *, copies: bool = False
) -> NDArray[np.bool_]:
    """Choose from which parent the two children take each segment.

    Parameters
    ----------
    y : (n_rows,) float array
        Score of each row, minimised.
    array : (n_rows, n_segments) bool array
        Orthogonal array; True where the row takes the segment from the second parent.
    differs : (n_segments,) bool array
        Whether the parents differ on the segment.
    copies : bool
        Whether children may be copies of a parent or of each other.

    Returns
    -------
    (2, n_segments) bool array
        First row: the level with the smaller sum of scores, everywhere (the second parent's on a tie, as in
        Ho's code). Second row: the same with the segment of least main effect difference flipped (the first
        one on a tie). With ``copies`` that is all, as published. Otherwise segments on which the parents agree are
        never flipped, and combinations that are a parent are passed over for the next best ones: further single
        flips by ascending difference, then all segments flipped. Where fewer than two segments differ there
        is nothing but the parents.

    Examples
    --------
    The first and third segment are better in the second parent, the second one by little in the first. To
    flip the second one gives the second parent itself, so it is the third one that is flipped:

    >>> array = orthogonal_array(3)
    >>> y = 10 - array @ np.array([3.0, -1.0, 2.0])
    >>> child_levels(y, array, np.array([True, True, True])).astype(int).tolist()
    [[1, 0, 1], [1, 0, 0]]
    >>> child_levels(y, array, np.array([True, True, True]), copies=True).astype(int).tolist()
    [[1, 0, 1], [1, 1, 1]]
    """
    sum_first = y @ ~array
    sum_second = y @ array
    best = ~(sum_first < sum_second)
    difference = np.abs(sum_first - sum_second)
    if copies:
        return np.stack([best, best ^ (np.arange(len(best)) == np.argmin(difference))])
    order = [j for j in np.argsort(difference, kind="stable") if differs[j]]
    if not order:
        return np.stack([best, best])

    flips = [np.zeros(len(best), dtype=bool) for _ in range(len(order) + 2)]
    for flip, j in zip(flips[1:], order, strict=False):
        flip[j] = True
    flips[-1] = differs
    combinations = [best ^ flip for flip in flips]
    new = [levels for levels in combinations if levels[differs].any() and not levels[differs].all()]
    return np.stack(new[:2] if len(new) >= 2 else combinations[:2])
