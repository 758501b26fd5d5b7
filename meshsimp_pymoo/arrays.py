"""The types of arrays, as all rooms name them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

AnyArray: TypeAlias = npt.NDArray[Any]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.integer[Any]]

# Lists of vertices, one for each vertex: those of vertex i are ``indices[indptr[i]:indptr[i + 1]]``.
Csr: TypeAlias = tuple[IntArray, IntArray]


class Rows:
    """Rows of an array that are made when they are asked for, by number; ``numpy.asarray`` makes all of them.

    Parameters
    ----------
    make : callable
        Returns the rows (n, ...) of these numbers (n,).
    count : int
        How many there are.

    Examples
    --------
    >>> squares = Rows(lambda rows: rows**2, 5)
    >>> len(squares), squares[np.array([1, 3])].tolist(), np.asarray(squares).tolist()
    (5, [1, 9], [0, 1, 4, 9, 16])
    """

    def __init__(self, make: Callable[[IntArray], AnyArray], count: int) -> None:
        self._make = make
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, rows: IntArray) -> AnyArray:
        return self._make(rows)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> AnyArray:
        return np.asarray(self._make(np.arange(self._count)), dtype=dtype)
