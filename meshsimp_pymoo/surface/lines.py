"""Break lines of a model: what they were, and what of them every mesh keeps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class ModelLines:
    """Polylines that are chains of edges of every mesh of a model.

    Attributes
    ----------
    originals : tuple of (n, 3) float array
        The lines as they were given, cut where the model ends, soft ones at the surface's heights, in the frame of the
        model's points [model units]. What line errors are measured at.
    chains : tuple of (m,) int array
        The vertices that thinning left of each of them, in order, as rows of the model.
    names : tuple of str
        What messages call each of them; the parts of a line that was cut share its name.
    tolerance : float
        Largest distance in space of a vertex of an original from its thinned line [model units].
    added : (A,) int array
        Rows of the vertices that are none of the model's file, ascending; they have no weight.
    found : dict of str to int
        How many lines and vertices were thinned, added, cut off or left out, as far as there are any; for run.json.
    """

    originals: tuple[FloatArray, ...]
    chains: tuple[IntArray, ...]
    names: tuple[str, ...]
    tolerance: float
    added: IntArray
    found: dict[str, int] = field(default_factory=dict)

    @property
    def segments(self) -> IntArray:
        """The forced edges (S, 2) as rows of the model, the lesser first, sorted, each once."""
        ends = np.concatenate([np.column_stack([chain[:-1], chain[1:]]) for chain in self.chains])
        return np.unique(np.sort(ends, axis=1), axis=0)

    @property
    def vertices(self) -> IntArray:
        """The rows of all vertices of the thinned lines, ascending; every mesh keeps them."""
        return np.unique(np.concatenate(self.chains))
