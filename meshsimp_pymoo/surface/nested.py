"""The solutions of a nested front: each a part of the next larger one, but for those whose vertices were moved.

What would be a bit for every vertex and solution is here one number for every vertex of the largest solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Nested:
    """S nested subsets, the smallest first.

    Attributes
    ----------
    rows : (V,) int array
        Rows of the file that the largest subset keeps.
    level : (V,) float array
        The slope at which each goes: error for each triangle [model units]; infinite: never.
    slope : (S,) float array
        The slope of each subset, descending: it keeps the rows of higher level.
    moved : tuple of (v,) int array or None
        The rows of each subset whose vertices were moved; None where they were not.
    """

    rows: IntArray
    level: FloatArray
    slope: FloatArray
    moved: tuple[IntArray | None, ...]

    def __repr__(self) -> str:
        return f"<Nested: {len(self):,} subsets of {len(self.rows):,} rows>"

    def __len__(self) -> int:
        return len(self.slope)

    def subset(self, number: int) -> IntArray:
        """Return the rows of the file that a subset keeps."""
        moved = self.moved[number]
        return self.rows[self.level > self.slope[number]] if moved is None else moved

    @property
    def sizes(self) -> IntArray:
        """How many vertices each keeps (S,)."""
        thinned = len(self.level) - np.searchsorted(np.sort(self.level), self.slope, side="right")
        return np.array([n if new is None else len(new) for n, new in zip(thinned, self.moved, strict=True)])

    def take(self, numbers: Sequence[int]) -> Nested:
        """Return some of the subsets."""
        return replace(self, slope=self.slope[list(numbers)], moved=tuple(self.moved[k] for k in numbers))

    def with_subset(self, number: int, slope: float, moved: IntArray | None) -> Nested:
        """Return the same with one more subset, which gets this number."""
        return replace(
            self,
            slope=np.insert(self.slope, number, slope),
            moved=(*self.moved[:number], moved, *self.moved[number:]),
        )

    def arrays(self) -> dict[str, AnyArray]:
        """Return what a file has to hold."""
        moved = [np.empty(0, np.int64) if new is None else new for new in self.moved]
        return {
            "rows": self.rows,
            "level": self.level,
            "slope": self.slope,
            "moved": np.concatenate(moved),
            "moved_start": np.cumsum([0, *map(len, moved)]),
        }

    @classmethod
    def of_arrays(cls, rows: AnyArray, level: AnyArray, slope: AnyArray, moved: AnyArray, start: AnyArray) -> Nested:
        """Return what :meth:`arrays` said.

        Raises
        ------
        ValueError
            If the arrays do not fit together.
        """
        kinds = "".join(array.dtype.kind for array in (rows, level, slope, moved, start))
        if kinds != "iffii" or any(array.ndim != 1 for array in (rows, level, slope, moved, start)):
            raise ValueError("its arrays have other types or dimensions")
        if rows.shape != level.shape or len(start) != len(slope) + 1 or start[0] != 0 or start[-1] != len(moved):
            raise ValueError("its arrays do not fit together")
        if (np.diff(start) < 0).any() or (np.diff(slope) > 0).any() or np.isnan(level).any():
            raise ValueError("its numbers are out of order")
        parts = np.split(moved, start[1:-1])
        return cls(rows, level, slope, tuple(part if len(part) else None for part in parts))


class Chromosomes:
    """Nested subsets as chromosomes (N,) of a model, each made when it is asked for."""

    def __init__(self, nested: Nested, model: Any) -> None:
        self._nested = nested
        self._model = model

    def __repr__(self) -> str:
        return "<Chromosomes: {:,} subsets of {:,} vertices>".format(*self.shape)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of subsets, and of vertices."""
        return len(self._nested), self._model.n_vertices

    def __len__(self) -> int:
        return len(self._nested)

    def __getitem__(self, number: Any) -> Any:
        kept = np.zeros(self._model.n_vertices, bool)
        model = self._model
        kept[model.vertices(model.samples_of_rows(self._nested.subset(number)))] = True
        return kept
