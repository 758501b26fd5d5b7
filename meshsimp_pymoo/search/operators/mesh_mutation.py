"""What the mutations that search on the live triangulation ask for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshsimp_pymoo.search.requirements import pinned_vertices, require_bool, surface_of


def require_mesh(problem: Any, X: NDArray[np.bool_], operator: object) -> NDArray[np.bool_]:
    """Return the pinned vertices (N,) of a mesh problem; refuse other problems, and chromosomes that are not bool."""
    pinned = pinned_vertices(problem, operator)
    surface_of(problem, operator)
    require_bool(X, operator)
    return pinned
