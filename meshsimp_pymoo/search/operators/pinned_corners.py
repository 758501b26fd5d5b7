"""The repair: pinned vertices are kept in every solution."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.repair import Repair

from meshsimp_pymoo.reprs import as_made
from meshsimp_pymoo.search.requirements import pinned_vertices, require_bool


class PinnedCorners(Repair):
    """Keep the pinned vertices in every chromosome: whatever the problem pins, the corners if nothing else is said.

    The objectives count pinned vertices as kept in any case; the repair makes the chromosome say so too, so
    that equal meshes have equal chromosomes. Draws nothing, so it may also be attached to a single operator.

    Raises
    ------
    TypeError
        For a problem without ``pinned``, or chromosomes that are not bool.
    """

    __repr__ = as_made

    def _do(self, problem: Any, X: NDArray[np.bool_], **kwargs: Any) -> NDArray[np.bool_]:
        require_bool(X, self)
        return X | pinned_vertices(problem, self)
