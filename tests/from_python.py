"""Functions that only compiled code calls, for tests."""

from __future__ import annotations

from typing import Any

from numba import njit


def from_python(inner: Any) -> Any:
    """Return a function that Python can call for one that only compiled code can."""

    @njit
    def called(*arguments: Any) -> Any:
        return inner(*arguments)

    return called
