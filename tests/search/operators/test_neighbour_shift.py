"""Where kept vertices move, how often, and what stops them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from pymoo.core.population import Population
from stand_in_problem import GridProblem

from meshsimp_pymoo.search.operators import NeighbourShift
from meshsimp_pymoo.search.operators import neighbour_shift as module
from meshsimp_pymoo.search.operators.neighbour_shift import bernoulli_positions


def mutate(kept: str, *, pinned: str = "", along: str = "vector", seed: int = 0, rings: object = None) -> str:
    """Mutate one chromosome written as 0s and 1s, every vertex trying to move."""
    X = np.array([[gene == "1" for gene in kept]])
    pins = np.array([gene == "1" for gene in pinned]) if pinned else np.zeros(X.shape[1], dtype=bool)
    problem = SimpleNamespace(pinned=pins, n_var=X.shape[1], surface=SimpleNamespace(neighbours=rings))
    operator = NeighbourShift(1.0, along=along)
    mutated = operator._do(problem, X, random_state=np.random.default_rng(seed))
    return "".join(str(int(gene)) for gene in mutated[0])


def outcomes(kept: str, **kwargs: object) -> set[str]:
    return {mutate(kept, seed=seed, **kwargs) for seed in range(40)}  # type: ignore[arg-type]


@given(seed=st.integers(0, 2**32 - 1), rate=st.floats(0, 1), along=st.sampled_from(["vector", "mesh"]))
def test_the_number_of_kept_vertices_never_changes(seed: int, rate: float, along: str) -> None:
    problem, rng = GridProblem(5), np.random.default_rng(seed)
    X = (rng.random((6, 25)) < rng.random((6, 1))) | problem.pinned
    shifted = NeighbourShift(rate, along=along)._do(problem, X, random_state=rng)
    assert_array_equal(shifted.sum(axis=1), X.sum(axis=1))
    assert shifted[:, problem.pinned].all()


def test_a_vertex_moves_to_either_side() -> None:
    assert outcomes("00100") == {"01000", "00010"}


def test_at_the_ends_of_the_vector_there_is_one_way_to_go() -> None:
    assert outcomes("1000") == {"0100"}
    assert outcomes("0001") == {"0010"}


def test_a_taken_neighbour_stops_the_move() -> None:
    assert outcomes("1111") == {"1111"}
    assert outcomes("1100") == {"1100", "1010"}


def test_a_pinned_neighbour_counts_as_taken_even_where_the_chromosome_lacks_it() -> None:
    assert outcomes("10000", pinned="01000") == {"10000"}


def test_pinned_vertices_do_not_move() -> None:
    assert outcomes("00100", pinned="00100") == {"00100"}


def test_of_two_vertices_that_want_one_position_the_first_gets_it() -> None:
    assert outcomes("101") == {"011"}


def test_along_the_mesh_a_vertex_moves_within_its_one_ring() -> None:
    rings = (
        np.array([0, 1, 4, 5, 6, 6]),
        np.array([1, 0, 2, 3, 1, 1]),
    )  # 1 is joined to 0, 2 and 3; 4 to nothing
    assert outcomes("01000", along="mesh", rings=rings) == {"10000", "00100", "00010"}
    assert outcomes("00010", along="mesh", rings=rings) == {"01000"}
    assert outcomes("00001", along="mesh", rings=rings) == {"00001"}


@pytest.mark.parametrize("along", ["vector", "mesh"])
def test_each_vertex_moves_with_the_given_probability(along: str) -> None:
    problem = GridProblem(20)
    kept = np.zeros((20, 20), dtype=bool)
    kept[1:-1:3, 1:-1:3] = True  # inner vertices, all their neighbours free
    X = np.repeat(kept.reshape(1, -1), 2000, axis=0)
    shifted = NeighbourShift(0.1, along=along)._do(problem, X, random_state=np.random.default_rng(4))
    trials = X.sum()
    moved = (X & ~shifted).sum()
    assert abs(moved / trials - 0.1) < 4 * np.sqrt(0.09 / trials)
    for step in (-1, 1) if along == "vector" else (-20, -1, 1, 20):
        arrived = (shifted & np.roll(X, step, axis=1)).sum()
        share = 0.5 if along == "vector" else 0.25
        assert abs(arrived / moved - share) < 4 * np.sqrt(0.25 / moved)
    per_vertex = (X & ~shifted).sum(axis=0)[kept.ravel()] / 2000
    assert abs(per_vertex - 0.1).max() < 4.5 * np.sqrt(0.09 / 2000)


def test_by_default_one_vertex_in_n_moves() -> None:
    problem = GridProblem(20)
    kept = np.arange(400) % 3 == 1
    X = np.repeat(kept[None], 5000, axis=0)
    shifted = NeighbourShift()._do(problem, X, random_state=np.random.default_rng(5))
    expected = (kept & ~problem.pinned).sum() / 400 * 5000
    assert abs((X & ~shifted).sum() - expected) < 4 * np.sqrt(expected)


def test_blocks_of_rows_make_no_difference_to_the_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = GridProblem(6)
    X = (np.random.default_rng(6).random((50, 36)) < 0.4) | problem.pinned
    monkeypatch.setattr(module, "GENES_PER_BLOCK", 100)  # two rows at a time
    shifted = NeighbourShift(0.5)._do(problem, X, random_state=np.random.default_rng(7))
    assert_array_equal(shifted.sum(axis=1), X.sum(axis=1))
    assert (shifted != X).any(axis=1).mean() > 0.9
    alone = np.zeros((7, 36), dtype=bool)
    alone[:, 15] = True
    shifted = NeighbourShift(1.0)._do(problem, alone, random_state=np.random.default_rng(7))
    assert set(np.flatnonzero(shifted) % 36) == {14, 16}  # one step each, in whatever block


@pytest.mark.parametrize(
    ("n", "rate"), [(1000, 0.0), (1000, 1.0), (1000, 0.3), (50, 0.9), (10**9, 1e-8), (10**9, 1e-300)]
)
def test_successes_are_binomial_ascending_and_in_range(n: int, rate: float) -> None:
    rng = np.random.default_rng(8)
    draws = [bernoulli_positions(n, rate, rng) for _ in range(400)]
    counts = np.array([len(draw) for draw in draws])
    assert all(np.all(np.diff(draw) > 0) for draw in draws)
    assert all(draw[0] >= 0 and draw[-1] < n for draw in draws if len(draw))
    deviation = np.sqrt(n * rate * (1 - rate))
    assert abs(counts.mean() - n * rate) <= 4 * deviation / 20
    assert abs(counts.std() - deviation) <= 0.2 * deviation + 1e-9


def test_draws_that_do_not_reach_the_end_go_on_where_the_last_one_ended() -> None:
    class Steps:
        """Gaps of two, as few as a draw may have."""

        def geometric(self, rate: float, size: int) -> np.ndarray:
            return np.full(size, 2)

    assert_array_equal(bernoulli_positions(1000, 0.01, Steps()), np.arange(1, 1000, 2))  # type: ignore[arg-type]


def test_every_position_is_equally_likely_to_succeed() -> None:
    rng = np.random.default_rng(9)
    hits = np.zeros(10)
    for _ in range(20_000):
        hits[bernoulli_positions(10, 0.3, rng)] += 1
    assert abs(hits / 20_000 - 0.3).max() < 4 * np.sqrt(0.21 / 20_000)


def test_an_individual_may_be_spared() -> None:
    problem = GridProblem(6)
    X = np.repeat((np.arange(36) % 3 == 1)[None], 1000, axis=0)
    pop = Population.new("X", X)
    mutated = NeighbourShift(1.0, prob=0.3).do(problem, pop, random_state=np.random.default_rng(1))
    share = (mutated.get("X") != X).any(axis=1).mean()
    assert abs(share - 0.3) < 4 * np.sqrt(0.21 / 1000)


def test_impossible_arguments_are_refused_with_their_value() -> None:
    with pytest.raises(ValueError, match="along = 'edge' is unknown; choose 'vector'"):
        NeighbourShift(along="edge")
    with pytest.raises(ValueError, match=r"prob_var = 1\.5 is not a probability"):
        NeighbourShift(1.5)
    with pytest.raises(ValueError, match=r"prob = -1 is not a probability"):
        NeighbourShift(prob=-1)


def test_along_the_mesh_a_problem_without_one_rings_is_refused() -> None:
    problem = SimpleNamespace(pinned=np.zeros(4, dtype=bool), n_var=4)
    X = np.ones((1, 4), dtype=bool)
    with pytest.raises(TypeError, match=r"reads problem\.surface"):
        NeighbourShift(along="mesh")._do(problem, X, random_state=np.random.default_rng(0))
