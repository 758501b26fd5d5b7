"""What the mutations that search on the live triangulation refuse."""

from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.search.operators import Relocation, SizeStep


@pytest.mark.parametrize("mutation", [Relocation, SizeStep])
def test_what_lowers_sums_refuses_the_maximum_and_impossible_probabilities(mutation: type) -> None:
    with pytest.raises(ValueError, match=r"prob = 1\.2 is not a probability"):
        mutation(prob=1.2)
    problem = MeshProblem("peaks:6", objectives=("max_error", "triangles"))
    with pytest.raises(ValueError, match=r"the first objective is the maximum, 'max_error'; use objectives="):
        mutation()._do(problem, np.ones((2, problem.n_var), bool), random_state=np.random.default_rng(1))
