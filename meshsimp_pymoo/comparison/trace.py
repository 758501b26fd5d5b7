"""How a run converged: its front at a few generations, as the search saw it.

The generations are spaced geometrically, so that a run of any length keeps few of them, and a search has the same ones
up to any moment at which a run is taken from it. Nothing is evaluated for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.indicators import non_dominated

__all__ = ["GROWTH", "Moment", "Trace"]

GROWTH = 1.25
"""A generation is kept when its number is at least so many times that of the last one kept."""


class Moment(NamedTuple):
    """A moment of a search.

    Attributes
    ----------
    generation, evaluations : int
        How far it was.
    seconds : float
        How long that had taken.
    F : (S, 2) float array
        The front, sorted by triangles: error and triangles of its feasible meshes as the algorithm has them.
    """

    generation: int
    evaluations: int
    seconds: float
    F: FloatArray


class Trace:
    """The moments that are kept of a search.

    Parameters
    ----------
    moments : iterable of Moment
        Those so far.
    """

    def __init__(self, moments: Iterable[Moment] = ()) -> None:
        self.moments = list(moments)

    def keep(self, algorithm: Any, generation: int, seconds: float) -> None:
        """Keep the moment, if the last one kept is long enough ago."""
        if not self.moments or generation >= GROWTH * self.moments[-1].generation:
            self.moments.append(_moment(algorithm, generation, seconds))

    def until(self, algorithm: Any, generation: int, seconds: float) -> Trace:
        """Return the trace of a run that ends now."""
        before = [moment for moment in self.moments if moment.generation < generation]
        return Trace([*before, _moment(algorithm, generation, seconds)])

    @property
    def seconds(self) -> list[float]:
        """Seconds that the search had taken at each moment."""
        return [round(moment.seconds, 4) for moment in self.moments]

    @property
    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """What does not depend on the machine, see `meshsimp_pymoo.comparison.store.StoredRun`."""
        return {
            "trace_generations": np.array([moment.generation for moment in self.moments], np.int64),
            "trace_evaluations": np.array([moment.evaluations for moment in self.moments], np.int64),
            "trace_start": np.cumsum([0, *(len(moment.F) for moment in self.moments)], dtype=np.int64),
            "trace_F": np.concatenate([np.zeros((0, 2)), *(moment.F for moment in self.moments)]),
        }

    @property
    def plain(self) -> list[Any]:
        """It in JSON's types, for a checkpoint."""
        return [[*moment[:-1], moment.F.tolist()] for moment in self.moments]

    @classmethod
    def from_plain(cls, moments: Iterable[Any]) -> Trace:
        """Return the trace that `plain` was made of."""
        return cls(Moment(g, n, s, np.array(F, np.float64).reshape(-1, 2)) for g, n, s, F in moments)


def _moment(algorithm: Any, generation: int, seconds: float) -> Moment:
    F = np.zeros((0, 2))
    if algorithm.opt is not None and len(algorithm.opt):
        found = np.asarray(algorithm.opt.get("F"), np.float64)
        F = found[algorithm.opt.get("feas").ravel().astype(bool) & (found[:, 1] > 0)]
    return Moment(generation, int(algorithm.evaluator.n_eval), seconds, non_dominated(F) if len(F) else F)
