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


def require_bool(X: Any, what: str, way_out: str = "give True where a vertex is kept") -> AnyArray:
    """Return subsets of the vertices as an array, if they are bool.

    Parameters
    ----------
    X : array
        The subsets.
    what : str
        What is asked for, the beginning of the message.
    way_out : str
        What to do, unless they are but the numbers 0 and 1.

    Raises
    ------
    TypeError
        If they are of any other type: 0 and 1 as numbers too, which arithmetic treats otherwise.

    Examples
    --------
    >>> require_bool([0, 1, 1], "a subset is a bool array")
    Traceback (most recent call last):
    TypeError: a subset is a bool array, not int64; these are 0 and 1: give X.astype(bool)
    """
    X = np.asarray(X)
    if X.dtype != np.bool_:
        is_01 = X.dtype.kind in "iuf" and X.size > 0 and bool(((X == 0) | (X == 1)).all())
        raise TypeError(f"{what}, not {X.dtype}; {'these are 0 and 1: give X.astype(bool)' if is_01 else way_out}")
    return X


def are_distinct(numbers: AnyArray) -> bool:
    """Tell whether no two numbers (n,) are equal; of millions ten times as fast as NumPy's ``unique``.

    >>> are_distinct(np.array([3, 1, 2])), are_distinct(np.array([3, 1, 3]))
    (True, False)
    """
    ordered = np.sort(numbers)
    return not bool((ordered[1:] == ordered[:-1]).any())


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


def spread(n: int) -> list[int]:
    """Return the numbers below n in an order in which the first so many are spread over all, as far as they go.

    >>> spread(6)
    [0, 4, 2, 1, 5, 3]
    """
    bits = max(n - 1, 1).bit_length()
    # van der Corput's sequence in base 2
    return [place for k in range(1 << bits) if (place := int(f"{k:0{bits}b}"[::-1], 2)) < n]
