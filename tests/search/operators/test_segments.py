"""Where the vector is cut."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from meshsimp_pymoo.search.operators.segments import random_cuts


def test_cuts_leave_no_segment_empty_and_are_uniform() -> None:
    rng = np.random.default_rng(0)
    cuts = np.array([random_cuts(6, 3, rng) for _ in range(5000)])
    assert np.all(np.diff(cuts, axis=1) > 0)
    assert np.all((cuts[:, 0] == 0) & (cuts[:, -1] == 6))
    counts = np.unique(cuts, axis=0, return_counts=True)[1]
    assert len(counts) == 10  # 5 over 2
    assert abs(counts - 500).max() < 4.5 * np.sqrt(500)
    assert_array_equal(random_cuts(3, 3, rng), [0, 1, 2, 3])
