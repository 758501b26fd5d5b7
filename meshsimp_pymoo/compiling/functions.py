"""Two decorators: functions that Python calls, whose machine code is kept on disk, and functions inside those."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, overload

import numba
from numba.core import config

from meshsimp_pymoo.compiling import linking
from meshsimp_pymoo.compiling.store import Stored

Function = TypeVar("Function", bound=Callable[..., Any])

# Without Python's lock; a division by zero is what IEEE 754 says, and needs no code for an exception.
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

# For what Numba compiles where a question is asked: the call of its answer.
ANSWER_OPTIONS = OPTIONS | {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
if linking.is_known():
    ANSWER_OPTIONS["pipeline_class"] = linking.LinkedCompiler


def entry(function: Function) -> Function:
    """Compile a function that Python calls, when it is called, and keep its machine code on disk."""
    how = {"pipeline_class": linking.EntryCompiler} if linking.is_known() else {}
    compiled: Any = numba.njit(**OPTIONS, **how, no_cfunc_wrapper=True)(function)
    if not config.DISABLE_JIT:
        compiled._cache = Stored(function)
    found: Function = compiled
    return found


@overload
def inner(function: Function) -> Function: ...
@overload
def inner(*, inline: bool) -> Callable[[Function], Function]: ...
def inner(function: Any = None, *, inline: bool = False) -> Any:
    """Compile a function that only compiled functions call; Python cannot call it.

    Parameters
    ----------
    inline : bool
        Whether it is taken in wherever it is called; otherwise the compiler decides.

    Notes
    -----
    Parameters annotated as ``int``, ``float`` and ``bool`` are 64 bits, double precision and a byte, whatever is handed
    over, so there is one function for each combination of the others. With a Numba that is not known to
    :mod:`~meshsimp_pymoo.compiling.linking` it is a plain ``njit`` function.
    """
    if function is None:
        return lambda function: _inner(function, inline)
    return _inner(function, inline)


def _inner(function: Any, inline: bool) -> Any:
    if config.DISABLE_JIT or not linking.is_known():
        return numba.njit(**OPTIONS, forceinline=inline)(function)
    options = OPTIONS | {"nopython": True, "forceinline": inline}
    return linking.LinkedFunction(function, targetoptions=options)
