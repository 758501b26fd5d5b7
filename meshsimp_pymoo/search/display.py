"""What a search shows of itself while it goes on: how good its front is, and the error at a few sizes.

::

    minimize(problem, nsga2_v1(), ("n_gen", 50), seed=1, output=FrontOutput(), verbose=True)

     n_gen |  n_eval | n_nds  |    hv    |  error@20  |  error@50  | error@100  | error@200
    ========================================================================================
         1 |     100 |     18 |   0.3127 |          - |          - |      162.8 |      73.21
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import moocore
import numpy as np
import numpy.typing as npt
from pymoo.util.display.column import Column
from pymoo.util.display.multi import NumberOfNondominatedSolutions
from pymoo.util.display.output import Output

from meshsimp_pymoo.arrays import FloatArray
from meshsimp_pymoo.indicators import hypervolume_ratio
from meshsimp_pymoo.problem import MeshProblem

__all__ = ["FrontOutput", "errors_at", "usual_sizes"]


# Shares of the original's triangles at which the error is shown.
SHARES = (0.02, 0.05, 0.1, 0.2)


def errors_at(F: npt.ArrayLike, sizes: Sequence[float]) -> FloatArray:
    """Return the least error of a front among its solutions of at most so many triangles, for each size.

    Parameters
    ----------
    F : (S, m) float array
        The error first, the triangles last; any order, dominated rows do no harm.
    sizes : sequence of float
        Numbers of triangles.

    Returns
    -------
    (len(sizes),) float array
        NaN where no solution is that small.

    Examples
    --------
    >>> errors_at([[3, 2], [1, 10], [0, 20]], [1, 10, 15])
    array([nan,  1.,  1.])
    """
    rows = np.asarray(F, dtype=np.float64)
    least = [rows[rows[:, -1] <= size, 0].min(initial=np.inf) for size in sizes]
    return np.array([error if np.isfinite(error) else np.nan for error in least])


def usual_sizes(triangles: int) -> list[int]:
    """Return a few sizes worth a look, as round numbers of triangles.

    >>> usual_sizes(12345)
    [250, 620, 1200, 2500]
    """
    sizes = [max(2, triangles * share) for share in SHARES]
    return sorted({int(float(f"{size:.2g}")) for size in sizes})


class FrontOutput(Output):
    """Show the hypervolume of the front and its error at a few sizes, generation by generation.

    Pass it as ``output=`` with ``verbose=True`` to see them, or as ``callback=`` to record them silently; either
    way ``rows`` holds the numbers afterwards.

    Parameters
    ----------
    sizes : sequence of int, optional
        Numbers of triangles at which the least error is shown; by default 2, 5, 10 and 20 % of the original's.
    reference : (n, 2) array-like or anything whose ``F`` is one, optional
        A front to compare with. With it the column ``hvr`` is the ratio to its hypervolume (see
        :func:`meshsimp_pymoo.indicators.hypervolume_ratio`). Without, the column ``hv`` is the dominated share of
        the box between nothing and the two ends of every front: the error of the pinned vertices alone and the
        triangles of all vertices.

    Attributes
    ----------
    rows : list of dict
        For every generation ``n_gen``, ``n_eval``, ``n_nds``, ``hv`` or ``hvr``, and the error by size.
    """

    def __init__(self, sizes: Sequence[int] | None = None, *, reference: Any = None) -> None:
        super().__init__()
        self.sizes = None if sizes is None else [int(size) for size in sizes]
        self.reference = None if reference is None else np.asarray(getattr(reference, "F", reference), dtype=float)
        self.quality = Column("hv" if reference is None else "hvr", width=8)
        self.rows: list[dict[str, Any]] = []
        self._bounds: FloatArray = np.ones(2)
        self._errors: list[Column] = []

    def __repr__(self) -> str:
        sizes = "" if self.sizes is None else f" at {', '.join(f'{size:,}' for size in self.sizes)} triangles"
        return f"<FrontOutput{sizes}: {len(self.rows)} generation{'s' * (len(self.rows) != 1)}>"

    def initialize(self, algorithm: Any) -> None:
        """Make the columns; both ends of the front are evaluated once, beside the budget.

        Raises
        ------
        TypeError
            If the problem is not a MeshProblem.
        """
        problem = getattr(algorithm.problem, "problem", algorithm.problem)  # of a weighted sum: what it weighs
        if not isinstance(problem, MeshProblem) or algorithm.problem.n_obj < 2:
            raise TypeError(
                f"FrontOutput shows fronts of a MeshProblem, not of a {type(algorithm.problem).__name__} with "
                f"{algorithm.problem.n_obj} objective(s); leave output= to pymoo"
            )
        if self.sizes is None:
            self.sizes = usual_sizes(len(problem.model.faces))
        ends = problem.evaluate_subsets(np.array([np.ones(problem.n_var, dtype=bool), problem.pinned]))
        bounds = np.max([problem.outcome(row)["F"] for row in ends], axis=0)
        self._bounds = np.where(bounds > 0, bounds, 1.0)
        measure = problem.objectives[0].removesuffix("_error")
        self._errors = [Column(f"{measure}@{size}", width=11) for size in self.sizes]
        self.columns += [NumberOfNondominatedSolutions(), self.quality, *self._errors]

    def update(self, algorithm: Any) -> None:
        """Read the numbers of the generation."""
        super().update(algorithm)
        F, feasible = algorithm.opt.get("F", "feas")
        F = F[np.asarray(feasible, dtype=bool).ravel()]
        sizes = self.sizes or []
        errors = errors_at(F, sizes) if len(F) else np.full(len(sizes), np.nan)
        volume = self._volume(F) if len(F) else 0.0
        self.quality.set(f"{volume:.4f}")
        for column, error in zip(self._errors, errors, strict=True):
            column.set("-" if np.isnan(error) else f"{error:.4g}")
        self.rows.append(
            {"n_gen": algorithm.n_gen, "n_eval": algorithm.evaluator.n_eval, "n_nds": len(F)}
            | {self.quality.name: volume}
            | dict(zip((column.name for column in self._errors), errors.tolist(), strict=True))
        )

    def _volume(self, F: FloatArray) -> float:
        if self.reference is not None:
            return hypervolume_ratio(F, self.reference)
        return float(moocore.hypervolume(F / self._bounds, ref=1.0))
