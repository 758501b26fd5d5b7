"""Functions that only compiled code calls, compiled once and optimised where they are taken in.

Numba wraps every function for Python and for C, compiles it anew for each combination of integer types and literals it
is called with, and links it, optimised and assembled, into each function that calls it, where it is optimised again.
The classes here do it once. They stand on classes of Numba that it does not promise to keep, so they are used with the
versions they are known to work with; see :func:`~meshsimp_pymoo.compiling.functions.inner`.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.core import config, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

# Versions (major, minor) of Numba with which the tests of this room have passed.
KNOWN = tuple((0, minor) for minor in range(61, 69))


def is_known() -> bool:
    """Tell whether Numba is of a version that these classes are known to work with."""
    return tuple(numba.version_info[:2]) in KNOWN


@contextmanager
def _one_level() -> Iterator[None]:
    """Have LLVM optimise at its first level: a third quicker to compile than the third, and no slower to run here.

    Numba's level is one for the process and belongs to whoever runs it. This is entered under Numba's lock, so nothing
    else is optimised meanwhile.
    """
    before = config.OPT, config.LOOP_VECTORIZE
    config.OPT, config.LOOP_VECTORIZE = type(config.OPT)(1), 0
    try:
        yield
    finally:
        config.OPT, config.LOOP_VECTORIZE = before


class _Optimised(JITCodeLibrary):
    """A function's code, optimised at one level whatever the process is set to."""

    def _optimize_functions(self, ll_module: Any) -> None:
        with _one_level():
            super()._optimize_functions(ll_module)

    def _optimize_final_module(self) -> None:
        with _one_level():
            super()._optimize_final_module()


class EntryCompiler(Compiler):
    """The usual steps of compiling, into a library that is optimised at one level."""

    def define_pipelines(self) -> Any:
        """Return the usual steps."""
        state = self.state
        state.library = _Optimised(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()


class _NoMachineCode:
    """In place of what assembles: there is nothing to tell where a function's environment is."""

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing."""


class _Linked(_Optimised):
    """A function's code before optimisation, to be linked into others; it cannot be run by itself."""

    @property
    def codegen(self) -> Any:
        """What is told where a function's environment is, once it is assembled."""
        return _NoMachineCode()

    def _optimize_final_module(self) -> None:
        """Leave that to whatever takes it in."""

    def _finalize_final_module(self) -> None:
        """Note what it holds; nothing is assembled."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        return 0


class LinkedCompiler(Compiler):
    """The usual steps of compiling, into a library that is only linked."""

    def define_pipelines(self) -> Any:
        """Return the usual steps."""
        state = self.state
        state.library = _Linked(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()


def _as_annotated(name: Any, kind: Any) -> Any:
    """Return the type of an argument for a parameter's annotation: all integers are one, and literals are none."""
    kind = types.misc.unliteral(kind)
    if name == "int" and isinstance(kind, (types.Integer, types.Boolean)):
        return types.int64
    if name == "float" and isinstance(kind, (types.Integer, types.Float)):
        return types.float64
    if name == "bool" and isinstance(kind, (types.Integer, types.Boolean)):
        return types.boolean
    return kind


class LinkedFunction(CPUDispatcher):
    """A function for compiled code alone: one specialisation for the types of its annotations, and no wrapper."""

    def __init__(self, py_func: Any, locals: Any = None, targetoptions: Any = None, pipeline_class: Any = None) -> None:
        options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True} | (targetoptions or {})
        super().__init__(py_func, locals or {}, options, pipeline_class or LinkedCompiler)
        self._annotated = [parameter.annotation for parameter in inspect.signature(py_func).parameters.values()]

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Refuse: there is nothing that Python could call."""
        raise TypeError(
            f"{self.py_func.__module__}.{self.py_func.__qualname__} is called by compiled code only; call it in a "
            "function compiled with numba.njit, or call its py_func"
        )

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return what a call with arguments of these types is; see Numba."""
        _, args = self._compiler.fold_argument_types(args, kws)
        return super().get_call_template(tuple(map(_as_annotated, self._annotated, args)), {})
