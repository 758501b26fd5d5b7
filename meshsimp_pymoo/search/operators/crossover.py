"""Crossovers: how two subsets of the vertices become new ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.crossover import Crossover
from pymoo.core.evaluator import Evaluator
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.variable import get
from pymoo.util import default_random_state

from meshsimp_pymoo.search.local_search import relocate_all
from meshsimp_pymoo.search.requirements import pinned_vertices, plane_coordinates, require_bool, require_probability

# Orthogonal arrays by name and the number of two-level factors (segments) they hold.
ORTHOGONAL_ARRAYS = {"L4": 3, "L8": 7, "L16": 15}

# From objectives (n, n_obj) to one value for each row (n,), minimised.
Score = Callable[[NDArray[np.float64]], NDArray[np.float64]]

# The key in `algorithm.data` under which OAX notes the generation it has already evaluated candidates for.
EVALUATED_GENERATION = "oax_generation"


class _PairCrossover(Crossover):
    """Two parents, one or two children; only the pairs that do cross are worked on.

    Subclasses write ``_do(problem, X, mates=..., random_state=..., **kwargs)`` with X (2, n_crossing, N);
    ``mates`` are the crossing pairs as individuals. pymoo's own ``do`` calls ``_do`` on all pairs and throws
    away the rest.
    """

    def __init__(self, prob: float, n_offsprings: int) -> None:
        if n_offsprings not in (1, 2):
            raise ValueError(f"n_offsprings = {n_offsprings}: a pair of parents has 1 or 2 children here")
        super().__init__(2, n_offsprings, prob=require_probability("prob", prob))

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
            children[:, crosses] = self._do(
                problem, parental, *args, random_state=random_state, mates=mates, **kwargs
            )
        return Population.new("X", children.reshape(-1, X.shape[2]))


class SubsetUniformCrossover(_PairCrossover):
    """Uniform crossover of bool vectors: every gene goes to the other child with probability 1/2.

    The distribution of pymoo's ``UniformCrossover``, made for long vectors: one random bit per gene instead
    of a 64-bit float, and the exchange is three bitwise operations.

    Parameters
    ----------
    prob : float
        The probability of a pair to cross (0.8 in the paper).
    n_offsprings : {2, 1}
        Children per pair. MOEA/D uses one.

    Raises
    ------
    ValueError
        If ``prob`` is not in [0, 1] or ``n_offsprings`` is neither 1 nor 2.
    TypeError
        When applied to chromosomes that are not bool.
    """

    def __init__(self, prob: float = 0.8, *, n_offsprings: int = 2) -> None:
        super().__init__(prob, n_offsprings)

    def _do(
        self, problem: Any, X: NDArray[np.bool_], *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        exchanged = random_bits(X.shape[1:], random_state)
        exchanged &= X[0] ^ X[1]
        return X[: self.n_offsprings] ^ exchanged


class OAX(_PairCrossover):
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

    **Duplicates.** A segment on which the parents agree cannot distinguish the second child, so it is never
    the one that differs. A child that would be a copy of a parent is replaced by the next best combination
    that the main effects predict; only parents that differ in fewer than two segments have themselves as
    children. When pymoo repeats the mating within a generation in order to refill eliminated duplicates,
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
        score: Score | None = None,
        evaluator: Evaluator | None = None,
    ) -> None:
        if arrays not in ORTHOGONAL_ARRAYS:
            raise ValueError(f"arrays = {arrays!r} is unknown; choose one of {', '.join(ORTHOGONAL_ARRAYS)}")
        super().__init__(prob, n_offsprings)
        self.arrays = arrays
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
                return self._children(first, second, cuts, np.stack([levels, ~levels], axis=1))
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
        differs = np.array(
            [np.logical_or.reduceat(a ^ b, c[:-1]) for a, b, c in zip(first, second, cuts, strict=True)]
        )
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
        levels = np.array([child_levels(y[k], array, differs[k]) for k in range(n_matings)])
        return self._children(first, second, cuts, levels)

    def _children(
        self,
        first: NDArray[np.bool_],
        second: NDArray[np.bool_],
        cuts: NDArray[np.integer],
        levels: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        children = np.empty((self.n_offsprings, *first.shape), dtype=bool)
        for c in range(self.n_offsprings):
            for k in range(len(first)):
                children[c, k] = combine(first[k], second[k], cuts[k], levels[k, c])
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


def random_bits(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return fair random bits as a bool array, eight from each random byte."""
    count = int(np.prod(shape))
    drawn = np.frombuffer(rng.bytes((count + 7) // 8), dtype=np.uint8)
    return np.unpackbits(drawn, count=count).view(np.bool_).reshape(shape)


def random_cuts(n_vertices: int, n_segments: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Cut 0 ... n_vertices into non-empty runs at places drawn uniformly without replacement.

    Returns
    -------
    (n_segments + 1,) int array
        Segment j is ``cuts[j]`` up to, not including, ``cuts[j + 1]``.
    """
    inner = 1 + rng.choice(n_vertices - 1, n_segments - 1, replace=False, shuffle=False)
    return np.concatenate([[0], np.sort(inner), [n_vertices]])


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
    y: NDArray[np.float64], array: NDArray[np.bool_], differs: NDArray[np.bool_]
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

    Returns
    -------
    (2, n_segments) bool array
        First row: the level with the smaller sum of scores, everywhere (the second parent's on a tie, as in
        Ho's code). Second row: the same with the segment of least main effect difference flipped (the first
        one on a tie). Combinations that are a parent are passed over for the next best ones: further single
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
    """
    sum_first = y @ ~array
    sum_second = y @ array
    best = ~(sum_first < sum_second)
    difference = np.abs(sum_first - sum_second)
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


def combine(
    first: NDArray[np.bool_], second: NDArray[np.bool_], cuts: NDArray[np.integer], levels: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Take the segments with level True from the second parent, the others from the first."""
    combined = first.copy()
    for j in np.flatnonzero(levels):
        combined[cuts[j] : cuts[j + 1]] = second[cuts[j] : cuts[j + 1]]
    return combined


class HalfPlaneCrossover(_PairCrossover):
    """Exchange the vertices on one side of a random line in the plane.

    Delaunay triangulations are local: away from the line each side keeps the triangles of the parent it comes
    from, so whole patches that have proved themselves travel together.

    Parameters
    ----------
    prob : float
        The probability of a pair to cross.
    n_offsprings : {2, 1}
        Children per pair.
    keep_size : bool
        Add or drop vertices, good ones of a few drawn, until each child has as many as its first parent (the
        second child: as the second). Otherwise children have whatever falls to them.

    Raises
    ------
    ValueError
        If ``prob`` is not in [0, 1] or ``n_offsprings`` is neither 1 nor 2.
    TypeError
        When applied to chromosomes that are not bool, or for a problem without a mesh model.
    """

    def __init__(self, prob: float = 0.9, *, n_offsprings: int = 2, keep_size: bool = False) -> None:
        super().__init__(prob, n_offsprings)
        self.keep_size = keep_size

    def _do(
        self, problem: Any, X: NDArray[np.bool_], *args: Any, random_state: np.random.Generator, **kwargs: Any
    ) -> NDArray[np.bool_]:
        xy = plane_coordinates(problem, self)
        exchanged = half_planes(xy, X.shape[1], random_state)
        exchanged &= X[0] ^ X[1]
        children = X[: self.n_offsprings] ^ exchanged
        if self.keep_size:
            pinned = pinned_vertices(problem, self)
            sizes = (X[: self.n_offsprings] | pinned).sum(axis=2).ravel()
            flat = children.reshape(-1, X.shape[2])
            unequal = np.flatnonzero((flat | pinned).sum(axis=1) != sizes)
            flat[unequal] = relocate_all(
                problem, flat[unequal], np.zeros(len(unequal), int), random_state, sizes=sizes[unequal]
            )
        return children


def half_planes(xy: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Draw ``n`` random lines; return which vertices lie on the left of each, as (n, N) bool.

    Each line has a uniform direction and leaves a uniform share of the vertices, 10 to 90 %, on its left.

    Parameters
    ----------
    xy : (N, 2) float array
        Positions of the vertices.
    n : int
        Number of lines.
    rng : numpy.random.Generator
        Source of randomness.
    """
    angle = rng.uniform(0.0, 2.0 * np.pi, size=n)
    n_left = np.clip((rng.uniform(0.1, 0.9, size=n) * len(xy)).astype(int), 1, len(xy) - 1)
    sides = np.empty((n, len(xy)), dtype=bool)
    for side, a, k in zip(sides, angle, n_left, strict=True):
        offset = xy @ np.array([-np.sin(a), np.cos(a)])
        np.less(offset, np.partition(offset, k)[k], out=side)
    return sides


# Free vertices kept by both parents together in a region that is judged as one: with fewer, chance decides.
KEPT_PER_REGION = 16
# The price of a triangle is drawn up to this factor above or below that of the parents.
PRICE_FACTOR = 2.0


class RegionCrossover(_PairCrossover):
    """Take each region from the parent that buys its accuracy there with fewer triangles, by errors already known.

    Both objectives add up over regions of the plane, nearly, since Delaunay triangulations are local. So the parents
    can be compared region by region: one has the error e_a there with t_a triangles, the other e_b with t_b, and the
    region comes from the one with the smaller e + price * t (marginal analysis). What a triangle is worth is the
    parents' error per triangle: where the error falls as c / t, one more triangle saves c / t^2, and between two such
    parents, c / (t_a t_b), their geometric mean. The first child's price is drawn from half to twice of that, the
    second one's is as far on the other side.

    The errors are those that the parents' evaluation has left with them: nothing is evaluated here. It needs
    ``MeshProblem(..., regions=256)``, say. Regions are runs of the vector, which are patches in space; they are joined
    to random larger ones where the parents have few vertices. Triangles are counted as two for each kept vertex.

    A child that would be a copy of a parent takes the region where that costs least from the other one.

    Parameters
    ----------
    prob : float
        The probability of a pair to cross.
    n_offsprings : {2, 1}
        Children per pair.

    Raises
    ------
    ValueError
        If ``prob`` is not in [0, 1] or ``n_offsprings`` is neither 1 nor 2, and when applied to a problem without
        regions or to parents without known errors.
    TypeError
        When applied to chromosomes that are not bool, or for a problem without a mesh model.
    """

    def __init__(self, prob: float = 0.9, *, n_offsprings: int = 2) -> None:
        super().__init__(prob, n_offsprings)

    def _do(
        self,
        problem: Any,
        X: NDArray[np.bool_],
        *args: Any,
        random_state: np.random.Generator,
        mates: Sequence[Sequence[Individual]],
        **kwargs: Any,
    ) -> NDArray[np.bool_]:
        pinned = pinned_vertices(problem, self)
        n_known = getattr(problem, "regions", 0)
        if not n_known:
            raise ValueError(
                f"{type(self).__name__} compares errors by region, and the problem keeps none; "
                "make it with MeshProblem(..., regions=256)"
            )
        starts = region_starts(n_known, X.shape[2])
        children = np.empty((self.n_offsprings, *X.shape[1:]), dtype=bool)
        for k, pair in enumerate(mates):
            error = np.array([_known_errors(parent, n_known, self) for parent in pair])
            kept = np.add.reduceat(X[:, k] & ~pinned, starts, axis=1, dtype=np.int64)
            n_runs = int(np.clip(kept.sum() // KEPT_PER_REGION, 2, n_known))
            runs = random_cuts(n_known, n_runs, random_state)[:-1] if n_known > 1 else np.zeros(1, int)
            more_error = np.add.reduceat(error[0] - error[1], runs)
            more_triangles = np.add.reduceat(2 * (kept[0] - kept[1]), runs)
            worth = price_of_a_triangle(error.sum(axis=1), 2 * kept.sum(axis=1))
            differs = np.logical_or.reduceat(X[0, k] ^ X[1, k], starts[runs])
            exponent = random_state.uniform(-1.0, 1.0)
            for child, sign in zip(children[:, k], (1.0, -1.0), strict=False):
                price = worth * PRICE_FACTOR ** (sign * exponent)
                second = cheaper_parent(more_error + price * more_triangles, differs)
                child[:] = combine(X[0, k], X[1, k], np.append(starts[runs], X.shape[2]), second)
        return children


def region_starts(n_regions: int, n_vertices: int) -> NDArray[np.int64]:
    """Return the first vertex of each region, (n_regions,): vertex i is in region i * n_regions // n_vertices.

    Examples
    --------
    >>> region_starts(3, 10).tolist()
    [0, 4, 7]
    """
    return -(-np.arange(n_regions) * n_vertices // n_regions)


def price_of_a_triangle(error: NDArray[np.float64], triangles: NDArray[np.integer]) -> float:
    """Return the error [model units] that a triangle is worth: the geometric mean of two parents' error per triangle.

    Parameters
    ----------
    error : (2,) float array
        Summed error of each parent [model units].
    triangles : (2,) int array
        Triangles of each; 0 counts as 1.

    Examples
    --------
    >>> price_of_a_triangle(np.array([12.0, 3.0]), np.array([10, 40]))
    0.3
    """
    return float(np.sqrt(np.prod(error / np.maximum(triangles, 1))))


def cheaper_parent(excess: NDArray[np.float64], differs: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return for each region whether to take it from the second parent; never the same parent for all that differ.

    Parameters
    ----------
    excess : (n,) float array
        What the first parent costs more [model units].
    differs : (n,) bool array
        Where the parents differ; with fewer than two such regions there are only copies.

    Returns
    -------
    (n,) bool array
        True where the second parent costs less. Where that would be one parent's copy, the region in which the choice
        matters least is the other one's.
    """
    second = excess > 0.0
    rows = np.flatnonzero(differs)
    if len(rows) > 1 and second[rows].all() == second[rows].any():
        row = rows[np.argmin(np.abs(excess[rows]))]
        second[row] = not second[row]
    return second


def _known_errors(parent: Individual, n_regions: int, operator: object) -> NDArray[np.float64]:
    known = parent.get("region_error")
    if known is None or len(known) != n_regions:
        raise ValueError(
            f"{type(operator).__name__} needs parents evaluated by the problem itself, with their errors in "
            f"{n_regions} regions; this one has {'none' if known is None else len(known)}"
        )
    return np.asarray(known, float)
