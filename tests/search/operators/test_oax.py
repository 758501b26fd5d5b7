"""The orthogonal-array crossover, step by step beside a slow twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mating import call, evaluated_pairs, opposite_pairs
from numpy.testing import assert_array_equal
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population
from stand_in_problem import GridProblem

from meshsimp_pymoo.search.operators import OAX
from meshsimp_pymoo.search.operators.oax import ORTHOGONAL_ARRAYS, child_levels, first_objective, orthogonal_array
from meshsimp_pymoo.search.operators.segments import random_cuts

# As printed in the public code of Ho's group.
L4 = ["000", "011", "101", "110"]

L8 = ["0000000", "0001111", "0110011", "0111100", "1010101", "1011010", "1100110", "1101001"]


@pytest.mark.parametrize(("name", "n_factors"), sorted(ORTHOGONAL_ARRAYS.items()))
def test_arrays_are_orthogonal(name: str, n_factors: int) -> None:
    array = orthogonal_array(n_factors).astype(int)
    n_rows = int(name[1:])
    assert array.shape == (n_rows, n_factors)
    assert not array[0].any()
    assert_array_equal(array.sum(axis=0), n_rows // 2)
    together = array.T @ array
    assert_array_equal(together[~np.eye(n_factors, dtype=bool)], n_rows // 4)


@pytest.mark.parametrize("rows", [L4, L8])
def test_arrays_are_those_of_the_public_code(rows: list[str]) -> None:
    assert ["".join(str(int(b)) for b in row) for row in orthogonal_array(len(rows[0]))] == rows


def slow_twin(
    problem: GridProblem, first: list[bool], second: list[bool], cuts: list[int], rows: list[str], copies: bool
) -> list:
    """Return both children, following the published procedure one step at a time, in plain Python."""
    n_segments = len(cuts) - 1

    def mix(levels: str) -> list[bool]:
        child = []
        for j, level in enumerate(levels):
            child += (second if level == "1" else first)[cuts[j] : cuts[j + 1]]
        return child

    def error(kept: list[bool]) -> float:
        out: dict[str, Any] = {}
        problem._evaluate(np.array(kept), out)
        return out["F"][0]

    y = [error(mix(row)) for row in rows]
    best, difference = "", []
    for j in range(n_segments):
        sums = {level: sum(y_t for y_t, row in zip(y, rows, strict=True) if row[j] == level) for level in "01"}
        best += "0" if sums["0"] < sums["1"] else "1"
        difference.append(abs(sums["0"] - sums["1"]))

    def flipped(positions: list[int]) -> list[bool]:
        return mix("".join(str(int(b) ^ (j in positions)) for j, b in enumerate(best)))

    if copies:
        return [flipped([]), flipped([min(range(n_segments), key=lambda j: difference[j])])]
    differing = [j for j in range(n_segments) if first[cuts[j] : cuts[j + 1]] != second[cuts[j] : cuts[j + 1]]]

    by_difference = sorted(differing, key=lambda j: difference[j])
    ranked = [flipped([]), *[flipped([j]) for j in by_difference], flipped(differing)]
    children = []
    for child in ranked:
        if child not in (first, second) and child not in children:
            children.append(child)
    return children[:2] if len(children) >= 2 else ranked[:2]


@pytest.mark.parametrize(("name", "rows"), [("L4", L4), ("L8", L8)])
@pytest.mark.parametrize("equal_genes", [0.0, 0.8, 0.95])
@pytest.mark.parametrize("copies", [False, True])
def test_children_are_those_of_a_slow_twin(name: str, rows: list[str], equal_genes: float, copies: bool) -> None:
    problem = GridProblem(5)
    pairs = evaluated_pairs(problem, 30, seed=1, equal_genes=equal_genes)
    children, _ = call(OAX(name, prob=1.0, copies=copies), problem, pairs, seed=2)
    rng = np.random.default_rng(2)
    rng.random(30)  # who crosses: all
    for k, (first, second) in enumerate(pairs):
        cuts = random_cuts(25, len(rows[0]), rng).tolist()
        expected = slow_twin(problem, first.X.tolist(), second.X.tolist(), cuts, rows, copies)
        assert children[:, k].tolist() == expected


@pytest.mark.parametrize("rows", [L4, L8])
def test_levels_are_those_of_equation_5(rows: list[str]) -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        fe = rng.integers(0, 9, size=len(rows)).tolist()  # few values: ties
        S = {
            (j, k): sum(f * (row[j] == k) for f, row in zip(fe, rows, strict=True))
            for j in range(len(rows[0]))
            for k in "01"
        }
        first = [int(S[j, "1"] <= S[j, "0"]) for j in range(len(rows[0]))]
        med = [abs(S[j, "0"] - S[j, "1"]) for j in range(len(rows[0]))]
        least = med.index(min(med))
        second = [level ^ (j == least) for j, level in enumerate(first)]
        array = orthogonal_array(len(rows[0]))
        assert child_levels(np.array(fe, float), array, np.ones(len(first), bool), copies=True).tolist() == [
            [bool(level) for level in child] for child in (first, second)
        ]


def test_only_when_asked_are_children_copies_of_a_parent() -> None:
    problem = GridProblem(5)
    pairs = opposite_pairs(problem, 300, seed=8)
    copied = {}
    for copies in (False, True):
        children, _ = call(OAX(prob=1.0, copies=copies), problem, pairs, seed=9)
        family = [{parent.X.tobytes() for parent in pair} for pair in pairs]
        copied[copies] = sum(
            any(child.tobytes() in parents for child in children[:, k]) for k, parents in enumerate(family)
        )
    assert copied[False] == 0
    assert copied[True] > 100


@pytest.mark.parametrize("name", ["L4", "L8", "L16"])
def test_on_an_additive_error_the_first_child_is_the_best_of_all_combinations(name: str) -> None:
    problem = GridProblem(5)
    pairs = opposite_pairs(problem, 40, seed=3)
    children, _ = call(OAX(name, prob=1.0), problem, pairs, seed=4)
    rng = np.random.default_rng(4)
    rng.random(40)
    n_best = 0
    for k, (first, second) in enumerate(pairs):
        cuts = random_cuts(25, ORTHOGONAL_ARRAYS[name], rng)
        lost = [np.add.reduceat(problem.weights * ~parent.X, cuts[:-1]) for parent in (first, second)]
        least = np.minimum(*lost).sum()
        if least < min(first.F[0], second.F[0]):  # otherwise a parent is the best, and children are no parents
            assert problem.evaluate(children[0, k])[0] == least
            gains = np.sort(np.abs(lost[0] - lost[1]))
            to_parents = [parent.F[0] - least for parent in (first, second)]
            expected = next(gain for gain in gains if gain not in to_parents)
            assert problem.evaluate(children[1, k])[0] - least == expected
            n_best += 1
    assert n_best >= 20


@pytest.mark.parametrize(("name", "n_rows"), [("L4", 4), ("L8", 8), ("L16", 16)])
def test_a_crossing_pair_costs_all_rows_but_the_known_parent(name: str, n_rows: int) -> None:
    problem = GridProblem(12)
    pairs = opposite_pairs(problem, 10, seed=5)
    assert call(OAX(name, prob=1.0), problem, pairs, seed=6)[1] == 10 * (n_rows - 1)


def test_pairs_that_do_not_cross_are_not_evaluated() -> None:
    problem = GridProblem(12)
    pairs = opposite_pairs(problem, 200, seed=5)
    crossing = (np.random.default_rng(6).random(200) < 0.3).sum()
    assert 0 < crossing < 200
    assert call(OAX(prob=0.3), problem, pairs, seed=6)[1] == 3 * crossing
    assert call(OAX(prob=0.0), problem, pairs, seed=6)[1] == 0


def test_parents_that_were_never_evaluated_cost_the_first_row_too() -> None:
    problem = GridProblem(12)
    pairs = evaluated_pairs(problem, 10, seed=5)
    fresh = Population.new("X", np.array([parent.X for parent in pairs.ravel()])).reshape(10, 2)
    known, _ = call(OAX(prob=1.0), problem, pairs, seed=6)
    unknown, n_eval = call(OAX(prob=1.0), problem, fresh, seed=6)
    assert n_eval == 40
    assert_array_equal(known, unknown)


def test_twins_cost_nothing_and_rows_that_agree_are_evaluated_once() -> None:
    problem = GridProblem(12)
    pairs = evaluated_pairs(problem, 10, seed=5)
    twins = np.stack([pairs[:, 0], pairs[:, 0]], axis=1).view(Population)
    assert call(OAX(prob=1.0), problem, twins, seed=6)[1] == 0
    near = evaluated_pairs(problem, 50, seed=7)
    for first, second in near:  # one gene apart, so that every row is one of the parents
        second.X = first.X.copy()
        second.X[70] ^= True
    Evaluator(skip_already_evaluated=False).eval(problem, near.ravel())
    children, n_eval = call(OAX(prob=1.0), problem, near, seed=6)
    assert n_eval == 0
    assert all((child ^ first.X).sum() <= 1 for child, (first, _) in zip(children[0], near, strict=True))


def test_children_are_never_copies_of_parents_that_differ_enough() -> None:
    problem = GridProblem(5)
    pairs = evaluated_pairs(problem, 300, seed=8)
    children, _ = call(OAX(prob=1.0), problem, pairs, seed=9)
    rng = np.random.default_rng(9)
    rng.random(300)
    for k, pair in enumerate(pairs):
        cuts = random_cuts(25, 3, rng)
        if np.logical_or.reduceat(pair[0].X ^ pair[1].X, cuts[:-1]).sum() < 2:
            continue
        family = {kept.tobytes() for kept in (pair[0].X, pair[1].X, *children[:, k])}
        assert len(family) == 4


def test_corners_are_pinned_in_the_candidates_already() -> None:
    class Watched(GridProblem):
        def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
            assert x[self.pinned].all()
            super()._evaluate(x, out)

    problem = Watched(8)
    X = np.random.default_rng(1).random((10, 2, 64)) < 0.5
    X[..., problem.pinned] = False
    pairs = Population.new("X", X.reshape(20, 64)).reshape(10, 2)
    children, n_eval = call(OAX(prob=1.0), problem, pairs, seed=1)
    assert n_eval == 40
    assert children[..., problem.pinned].all()


def test_all_candidates_of_all_pairs_are_evaluated_in_one_batch() -> None:
    problem = GridProblem(8)
    batches: list[int] = []
    evaluator = Evaluator(callback=lambda pop: batches.append(len(pop)))
    call(OAX(prob=1.0), problem, opposite_pairs(problem, 10, seed=5), seed=6, evaluator=evaluator)
    assert batches == [30]


def test_main_effects_are_on_the_score_that_is_asked_for() -> None:
    problem = GridProblem(8)
    pairs = evaluated_pairs(problem, 40, seed=5)
    least_error, _ = call(OAX(prob=1.0), problem, pairs, seed=6)
    fewest, _ = call(OAX(prob=1.0, score=lambda F: F[:, 1]), problem, pairs, seed=6)
    by_error = problem.evaluate(least_error[0])
    by_triangles = problem.evaluate(fewest[0])
    assert by_error[:, 0].mean() < by_triangles[:, 0].mean() - 1000
    assert by_triangles[:, 1].mean() < by_error[:, 1].mean() - 5


def test_the_score_of_the_algorithm_counts_unless_the_user_gives_another() -> None:
    problem = GridProblem(8)
    pairs = opposite_pairs(problem, 40, seed=5)

    def children(crossover: OAX, **passed: Any) -> np.ndarray:
        rng = np.random.default_rng(6)
        return crossover(problem, pairs, random_state=rng, evaluator=Evaluator(), **passed).get("X")

    by_error, by_triangles = OAX(prob=1.0), OAX(prob=1.0, score=last_objective)
    assert (children(by_error) != children(by_triangles)).any()
    assert_array_equal(children(by_error, score=last_objective), children(by_triangles))
    assert_array_equal(children(by_triangles, score=first_objective), children(by_triangles))


def last_objective(F: np.ndarray) -> np.ndarray:
    return F[:, -1]


def test_on_a_tie_the_second_parent_is_taken_and_the_first_segment_flipped() -> None:
    # All from the second parent would be that parent, so the first two single flips are the children.
    levels = child_levels(np.ones(4), orthogonal_array(3), np.ones(3, dtype=bool))
    assert levels.astype(int).tolist() == [[0, 1, 1], [1, 0, 1]]


def test_refilling_the_same_generation_evaluates_nothing_but_still_mixes() -> None:
    problem: GridProblem = GridProblem(8)
    data: dict[str, int] = {}
    pairs = opposite_pairs(problem, 40, seed=5)
    assert call(OAX(prob=1.0), problem, pairs, seed=6, data=data)[1] == 120
    children, n_eval = call(OAX(prob=1.0), problem, pairs, seed=7, data=data)
    assert n_eval == 0
    first, second = (np.array([pair[i].X for pair in pairs]) for i in (0, 1))
    assert_array_equal(children[0] ^ children[1], first ^ second)  # what one child takes, the other leaves
    assert (children[0] != first).any(axis=1).mean() > 0.7
    assert call(OAX(prob=1.0), problem, pairs, seed=6, data=data, n_iter=3)[1] == 120


def test_without_any_evaluator_the_error_tells_what_to_do() -> None:
    problem = GridProblem(8)
    with pytest.raises(RuntimeError, match=r"no evaluator .*moead\(crossover=OAX\(n_offsprings=1\)\).*Evaluator\(\)"):
        OAX(prob=1.0)(problem, evaluated_pairs(problem, 2, seed=1), random_state=np.random.default_rng(1))


def test_an_evaluator_of_its_own_serves_where_the_algorithm_gives_none() -> None:
    problem, evaluator = GridProblem(8), Evaluator()
    pairs = evaluated_pairs(problem, 2, seed=1)
    OAX(prob=1.0, evaluator=evaluator)(problem, pairs, random_state=np.random.default_rng(1))
    assert evaluator.n_eval == 6


def test_impossible_arguments_are_refused_with_their_value() -> None:
    with pytest.raises(ValueError, match="arrays = 'L12' is unknown; choose one of L4, L8, L16"):
        OAX("L12")
    problem = GridProblem(3)
    with pytest.raises(ValueError, match="15 segments, but the model has only 9 vertices"):
        call(OAX("L16", prob=1.0), problem, evaluated_pairs(problem, 2, seed=1), seed=1)
