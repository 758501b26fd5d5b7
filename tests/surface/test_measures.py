from __future__ import annotations

import numpy as np
import pytest

from meshsimp_pymoo.surface.measures import measured


def test_an_unknown_measure_is_refused():
    with pytest.raises(ValueError, match="measure='mean' is unknown; choose one of 'error'"):
        measured(np.zeros(6), "mean", 1.0)
