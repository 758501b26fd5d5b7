"""What every operator in the table promises, present and future ones."""

from __future__ import annotations

import copy
import pickle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal, assert_equal
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population

import meshsimp_pymoo
from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search import operators
from meshsimp_pymoo.search.operators import OPERATORS

PROBLEM = MeshProblem("peaks:6", regions=12)
CROSSOVERS = sorted(OPERATORS["crossover"])
MUTATIONS = sorted(OPERATORS["mutation"])
ALL = [(kind, name) for kind, table in OPERATORS.items() for name in table]
seeds = st.integers(0, 2**32 - 1)
# What makes a mutation stronger, from not at all (0) to as strong as can be (1).
STRENGTH = {
    "neighbour_shift": lambda rate: {"prob_var": rate},
    "relocation": lambda rate: {"moves_per_vertex": 20 * rate, "temperature": 1.0},
    "size_step": lambda rate: {"step": rate},
}


def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def genomes(seed: int, *shape: int) -> np.ndarray:
    """Draw pinned chromosomes of densities from nearly empty to nearly full."""
    r = rng(seed)
    return (r.random((*shape, PROBLEM.n_var)) < r.random((*shape, 1))) | PROBLEM.pinned


def pairs_of(parents: np.ndarray) -> Population:
    """Evaluate (n_matings, 2, N) parents into the shape in which algorithms hand them to a crossover."""
    n_matings, _, n_var = parents.shape
    pop = Population.new("X", parents.reshape(-1, n_var))
    return Evaluator().eval(PROBLEM, pop).reshape(n_matings, 2)


def cross(name: str, parents: np.ndarray, seed: int, **kwargs: Any) -> np.ndarray:
    """Children (n_offsprings, n_matings, N) of (n_matings, 2, N) parents."""
    crossover = OPERATORS["crossover"][name](**({"prob": 1.0} | kwargs))
    algorithm = SimpleNamespace(evaluator=Evaluator(), data={}, n_iter=2, archive=None)
    children = crossover(PROBLEM, pairs_of(parents), random_state=rng(seed), algorithm=algorithm)
    assert len(children) == crossover.n_offsprings * len(parents)
    assert all(not child.evaluated for child in children)
    return children.get("X").reshape(crossover.n_offsprings, len(parents), -1)


def test_every_operator_of_the_table_is_a_name_of_its_room_and_of_the_package() -> None:
    names = sorted(OPERATORS[kind][name].__name__ for kind, name in ALL)
    assert sorted(operators.__all__) == sorted(["OPERATORS", *names])
    assert set(names) <= set(meshsimp_pymoo.__all__)
    for kind, name in ALL:
        assert getattr(meshsimp_pymoo, OPERATORS[kind][name].__name__) is OPERATORS[kind][name]


def state_of(item: Any) -> Any:
    """Return all that an operator holds, as deep as pymoo's objects and ours go."""
    if type(item).__module__.split(".")[0] in ("pymoo", "meshsimp_pymoo"):
        return {name: state_of(value) for name, value in vars(item).items()}
    return item


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_every_operator_survives_pickling_and_deep_copies(kind: str, name: str) -> None:
    operator = OPERATORS[kind][name]()
    for copied in (pickle.loads(pickle.dumps(operator)), copy.deepcopy(operator)):
        assert type(copied) is type(operator)
        assert_equal(state_of(copied), state_of(operator))


@pytest.mark.parametrize(("kind", "name"), [(k, n) for k, n in ALL if k != "duplicates"])
def test_a_problem_without_a_mesh_is_refused_by_name(kind: str, name: str) -> None:
    stranger = SimpleNamespace(n_var=20, n_obj=2)
    operator = OPERATORS[kind][name]()
    X = rng(0).random((4, 20)) < 0.5
    pop = 4 if kind == "sampling" else Population.new("X", X)
    if kind == "crossover":
        pop = pop.reshape(2, 2)
    if name == "uniform":
        assert operator(stranger, pop, random_state=rng(1)).get("X").shape == (4, 20)  # asks nothing of it
        return
    missing = r"reads problem\.(pinned|surface), which SimpleNamespace does not have.*MeshProblem"
    with pytest.raises(TypeError, match=missing):
        operator(stranger, pop, random_state=rng(1))


@pytest.mark.parametrize(("kind", "name"), [(k, n) for k, n in ALL if k not in ("duplicates", "sampling")])
def test_float_chromosomes_are_refused_with_the_way_out(kind: str, name: str) -> None:
    pop = Population.new("X", 0.5 * genomes(0, 4))
    with pytest.raises(TypeError, match=r"not float64; pass sampling=RandomSubset\(\)"):
        OPERATORS[kind][name]()(PROBLEM, pop.reshape(2, 2) if kind == "crossover" else pop, random_state=rng(1))


@pytest.mark.parametrize("name", CROSSOVERS)
@pytest.mark.parametrize("n_offsprings", [1, 2])
@given(seed=seeds)
def test_children_only_carry_parental_genes(name: str, n_offsprings: int, seed: int) -> None:
    parents = genomes(seed, 3, 2)
    children = cross(name, parents, seed, n_offsprings=n_offsprings)
    assert children.dtype == bool
    assert children.shape == (n_offsprings, 3, PROBLEM.n_var)
    assert np.all((children == parents[:, 0]) | (children == parents[:, 1]))
    assert children[..., PROBLEM.pinned].all()


@pytest.mark.parametrize("name", CROSSOVERS)
@given(seed=seeds)
def test_same_seed_same_children(name: str, seed: int) -> None:
    parents = genomes(seed, 4, 2)
    assert_array_equal(cross(name, parents, seed), cross(name, parents, seed))


@pytest.mark.parametrize("name", CROSSOVERS)
def test_another_seed_gives_other_children(name: str) -> None:
    parents = genomes(1, 10, 2)
    assert (cross(name, parents, 1) != cross(name, parents, 2)).any()


@pytest.mark.parametrize("name", CROSSOVERS)
@given(seed=seeds)
def test_twins_beget_twins(name: str, seed: int) -> None:
    twins = np.repeat(genomes(seed, 3, 1), 2, axis=1)
    assert np.all(cross(name, twins, seed) == twins[:, 0])


@pytest.mark.parametrize("name", CROSSOVERS)
def test_children_of_opposite_parents_mix_both(name: str) -> None:
    free = ~PROBLEM.pinned
    half = rng(3).random((20, PROBLEM.n_var)) < 0.5
    parents = np.stack([half | ~free, ~half | ~free], axis=1)
    for children in cross(name, parents, 4):
        from_first = (children == parents[:, 0])[:, free].mean(axis=1)
        assert np.all((from_first > 0) & (from_first < 1))
        assert 0.25 < from_first.mean() < 0.75


@pytest.mark.parametrize("name", CROSSOVERS)
def test_parents_are_left_as_they_are(name: str) -> None:
    parents = genomes(5, 4, 2)
    pop = pairs_of(parents)
    for individual in pop.ravel():
        individual.X.flags.writeable = False
    F = np.array([[parent.F for parent in pair] for pair in pop])
    algorithm = SimpleNamespace(evaluator=Evaluator(), data={}, n_iter=2, archive=None)
    OPERATORS["crossover"][name](prob=1.0)(PROBLEM, pop, random_state=rng(1), algorithm=algorithm)
    assert_array_equal([[parent.X for parent in pair] for pair in pop], parents)
    assert_array_equal([[parent.F for parent in pair] for pair in pop], F)


@pytest.mark.parametrize("name", CROSSOVERS)
def test_only_as_many_pairs_cross_as_the_probability_says(name: str) -> None:
    # Half the genes differ, so that a crossing pair hardly ever has copies of itself as children.
    parents = (rng(6).random((2000, 2, PROBLEM.n_var)) < 0.5) | PROBLEM.pinned
    children = cross(name, parents, 7, prob=0.8)
    copied = np.all(children[0] == parents[:, 0], axis=1) & np.all(children[1] == parents[:, 1], axis=1)
    # Children that are copies of their parents although these cross are rare: 0.02.
    assert abs(copied.mean() - 0.2) < 4 * np.sqrt(0.16 / 2000) + 0.02


@pytest.mark.parametrize("name", CROSSOVERS)
def test_pairs_that_do_not_cross_have_copies_of_themselves(name: str) -> None:
    parents = genomes(8, 50, 2)
    assert_array_equal(cross(name, parents, 1, prob=0.0), parents.swapaxes(0, 1))
    one = cross(name, parents, 1, prob=0.0, n_offsprings=1)[0]
    first = np.all(one == parents[:, 0], axis=1)
    assert np.all(first | np.all(one == parents[:, 1], axis=1))
    assert 10 < first.sum() < 40


@pytest.mark.parametrize("name", CROSSOVERS)
@pytest.mark.parametrize(("argument", "value"), [("prob", 1.2), ("prob", -0.1), ("n_offsprings", 3)])
def test_impossible_crossover_arguments_are_refused_with_their_value(name: str, argument: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"{argument} = {value}"):
        OPERATORS["crossover"][name](**{argument: value})


@pytest.mark.parametrize("name", MUTATIONS)
@given(seed=seeds, rate=st.floats(0, 1))
def test_mutation_keeps_shape_dtype_pins_and_its_input(name: str, seed: int, rate: float) -> None:
    X = genomes(seed, 5)
    X.flags.writeable = False
    mutation = OPERATORS["mutation"][name](**STRENGTH[name](rate))
    mutated = mutation.do(PROBLEM, Population.new("X", X), random_state=rng(seed)).get("X")
    again = mutation._do(PROBLEM, X, random_state=rng(seed))
    assert mutated.shape == X.shape
    assert mutated.dtype == bool
    assert mutated[:, PROBLEM.pinned].all()
    assert_array_equal(mutated, again)


@pytest.mark.parametrize("name", MUTATIONS)
def test_mutation_changes_something_and_depends_on_the_seed(name: str) -> None:
    X = genomes(1, 20)
    mutation = OPERATORS["mutation"][name](**STRENGTH[name](0.3))
    one, other = (mutation._do(PROBLEM, X, random_state=rng(seed)) for seed in (1, 2))
    assert (one != X).any()
    assert (one != other).any()


@pytest.mark.parametrize("name", sorted(OPERATORS["sampling"]))
@given(seed=seeds)
def test_samples_are_bool_pinned_and_repeatable(name: str, seed: int) -> None:
    sampling = OPERATORS["sampling"][name]()
    one, again = (sampling(PROBLEM, 7, random_state=rng(seed)).get("X") for _ in range(2))
    assert one.shape == (7, PROBLEM.n_var)
    assert one.dtype == bool
    assert one[:, PROBLEM.pinned].all()
    assert_array_equal(one, again)


@pytest.mark.parametrize("name", sorted(OPERATORS["repair"]))
@given(seed=seeds)
def test_a_repair_pins_changes_nothing_else_and_repairs_once_and_for_all(name: str, seed: int) -> None:
    X = rng(seed).random((5, PROBLEM.n_var)) < 0.3
    X.flags.writeable = False
    repair = OPERATORS["repair"][name]()
    repaired = repair._do(PROBLEM, X)
    assert repaired.dtype == bool
    assert repaired[:, PROBLEM.pinned].all()
    assert_array_equal(repaired[:, ~PROBLEM.pinned], X[:, ~PROBLEM.pinned])
    assert_array_equal(repair._do(PROBLEM, repaired, random_state=rng(0), algorithm=None), repaired)
    assert_array_equal(repair.do(PROBLEM, Population.new("X", X)).get("X"), repaired)
