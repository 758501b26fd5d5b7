"""How far sizes go, and by which vertices."""

from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.operators import SizeStep


@pytest.mark.parametrize("step", [0.02, 0.3])
def test_a_size_step_stays_within_its_bounds_and_goes_both_ways(step: float) -> None:
    problem = MeshProblem("peaks:21")
    X = (np.random.default_rng(1).random((60, problem.n_var)) < 0.3) | problem.pinned
    changed = SizeStep(step)._do(problem, X, random_state=np.random.default_rng(2))
    before, after = ((rows & ~problem.pinned).sum(axis=1) for rows in (X, changed))
    assert (after <= np.round(before * (1 + step)) + 1).all()
    assert (after >= np.round(before / (1 + step)) - 1).all()
    assert (after != before).all()
    assert 15 < (after > before).sum() < 45


def test_a_size_step_takes_better_vertices_than_chance() -> None:
    problem = MeshProblem("peaks:21")
    rng = np.random.default_rng(3)
    X = (rng.random((40, problem.n_var)) < 0.2) | problem.pinned
    changed = SizeStep(0.3)._do(problem, X, random_state=rng)
    more = changed.sum(axis=1) > X.sum(axis=1)
    drawn = X.copy()
    for row, size in zip(drawn, changed.sum(axis=1), strict=True):
        missing = size - row.sum()
        rows = np.flatnonzero(~row) if missing > 0 else np.flatnonzero(row & ~problem.pinned)
        row[rng.choice(rows, abs(missing), replace=False)] = missing > 0
    ours, chance = (problem.evaluate(rows)[:, 0] for rows in (changed, drawn))
    assert (ours[more] < chance[more]).mean() > 0.9
    assert (ours[~more] < chance[~more]).mean() > 0.9


def test_a_size_step_at_either_end_stays_there_or_comes_back() -> None:
    problem = MeshProblem("peaks:6")
    ends = np.array([problem.pinned, np.ones(problem.n_var, bool)] * 5)
    sizes = SizeStep(0.1)._do(problem, ends, random_state=np.random.default_rng(4)).sum(axis=1)
    assert set(sizes[::2]) <= {4, 5}
    assert set(sizes[1::2]) <= {32, 33, 34, 35, 36}


def test_an_impossible_step_is_refused_with_its_value() -> None:
    with pytest.raises(ValueError, match=r"step = -0\.1 is no number"):
        SizeStep(-0.1)
