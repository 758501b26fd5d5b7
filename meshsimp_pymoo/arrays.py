"""The types of arrays, as all rooms name them."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

AnyArray: TypeAlias = npt.NDArray[Any]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.integer[Any]]

# Lists of vertices, one for each vertex: those of vertex i are ``indices[indptr[i]:indptr[i + 1]]``.
Csr: TypeAlias = tuple[IntArray, IntArray]
