"""Machine code on disk: where it is kept, what it is made from, and who is told when it has to be made.

Numba keeps the code of a function beside its file or in the user's cache folder, and cannot be imported with where
neither can be written; and it knows what was compiled by the time stamp of that one file, although a function holds the
code of those that it calls, in other files. Here the folder is the first that can be written of several, at worst none,
and code is known by what it is made from.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from inspect import getclosurevars
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NamedTuple

import llvmlite
import platformdirs
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

from meshsimp_pymoo.compiling.linking import is_known
from meshsimp_pymoo.errors import CodeWarning, reason_of

PACKAGE = __name__.partition(".")[0]
HERE = Path(__file__).resolve().parent.parent
# Files that decide what any function is made into: their functions make code, which none of its callers shows.
HOW = ("compiling.functions", "compiling.linking", "plane.borrow", "plane.predicates")


# ------------------------------------------------------------------------------------------------------------ the place


class Place(NamedTuple):
    """Where machine code is kept."""

    #: None where no folder can be written: the code is made again by each process.
    folder: Path | None
    #: Where there may be some: that folder, and those before it that somebody else has filled.
    readable: tuple[Path, ...] = ()
    #: Folders that cannot be written, each with the reason.
    refused: tuple[str, ...] = ()


def _candidates() -> list[Path]:
    """Return the folders that may hold machine code, the best first; one that the user names is the only one."""
    if config.CACHE_DIR:
        return [Path(config.CACHE_DIR) / PACKAGE]
    # two installations have different code
    home = hashlib.sha256(os.fsencode(HERE)).hexdigest()[:12]
    found = [HERE / "__pycache__", Path(platformdirs.user_cache_dir(PACKAGE, appauthor=False)) / home]
    with suppress(OSError):  # there may be no folder for temporary files
        owner = os.getuid() if hasattr(os, "getuid") else "user"
        found.append(Path(tempfile.gettempdir()) / f"{PACKAGE}-{owner}" / home)
    # who has no home has a cache folder named ~, wherever they are
    return [folder for folder in found if folder.is_absolute()]


def _check_owner(folder: Path) -> None:
    """Refuse a folder for temporary files that somebody else has made: what is in it would be run."""
    parent = folder.parent
    if not hasattr(os, "getuid") or parent.parent != Path(tempfile.gettempdir()):
        return
    for part in (folder, parent):
        if part.lstat().st_uid != os.getuid():
            raise PermissionError(None, "belongs to somebody else")


def _prepare(folder: Path) -> None:
    """Make a folder, if need be, and see that it can be written."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    _check_owner(folder)
    tempfile.TemporaryFile(dir=folder).close()


@cache
def place() -> Place:
    """Return where machine code is kept: the first folder that can be written.

    ``NUMBA_CACHE_DIR`` if it is set; else the package's own folder, the user's cache folder, the folder for temporary
    files. What somebody who may write it has left in the package's folder, as in an image, is read there.
    """
    refused: list[str] = []
    readable: list[Path] = []
    for folder in _candidates():
        try:
            _prepare(folder)
        except OSError as problem:
            refused.append(f"{folder}: {reason_of(problem)}")
            if folder.parent == HERE and folder.is_dir():
                readable.append(folder)
        else:
            return Place(folder, (*readable, folder), tuple(refused))
    return Place(None, tuple(readable), tuple(refused))


# ----------------------------------------------------------------------------------------------- what code is made from


def parts_of(function: Any) -> Iterator[Any]:
    """Yield functions and values from which a function's code is made, of this package and its users, each once.

    A function that stands for others (a question to a surface) has them in ``parts``.
    """
    seen: set[int] = set()
    waiting = [function]
    while waiting:
        item = waiting.pop()
        item = getattr(item, "py_func", getattr(item, "_defn", item))
        if id(item) in seen:
            continue
        seen.add(id(item))
        yield item
        if not hasattr(item, "__code__"):
            continue
        waiting += getattr(item, "parts", [])
        found = getclosurevars(item)
        named = [*found.globals.values(), *found.nonlocals.values()]
        for module in [value for value in named if isinstance(value, ModuleType) and _is_ours(value.__name__)]:
            named += [vars(module)[name] for name in sorted(found.unbound) if name in vars(module)]
        waiting += [value for value in named if _is_ours(getattr(value, "__module__", None))]


def _is_ours(module: str | None) -> bool:
    """Tell whether what is in a module, or nobody knows where, may be another thing with the same version of NumPy."""
    return module is None or module.partition(".")[0] not in ("numpy", "numba", "builtins", "typing", "math")


def _code(code: CodeType) -> str:
    """Return what a piece of byte code does, without where it stands."""
    constants = [_code(item) if isinstance(item, CodeType) else repr(item) for item in code.co_consts]
    return repr((code.co_code, code.co_names, code.co_varnames, constants))


def made_from(function: Any) -> str:
    """Return a hash of all that a function's machine code is made from."""
    found = []
    for item in parts_of(function):
        if hasattr(item, "__code__"):
            found.append(f"{item.__module__}.{item.__qualname__} {item.__annotations__} {_code(item.__code__)}")
        elif isinstance(item, (bool, int, float, str, tuple)):
            found.append(repr(item))
    # the order in which they are found follows from the names in the code
    how = [llvmlite.__version__, *map(_text, HOW)]
    return hashlib.sha256("\n".join([*how, *found]).encode()).hexdigest()


@cache
def _text(module: str) -> str:
    """Return the source of a file of the package; nothing where there is none to read."""
    try:
        return Path(__file__).resolve().parents[1].joinpath(*module.split(".")).with_suffix(".py").read_text("utf-8")
    except OSError:
        return ""


# ------------------------------------------------------------------------------------------------------------ the cache


class _Locator(_CacheLocator):
    """Says to Numba where a function's code is, and what it is made from."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._function = function
        self._folder = folder
        self._py_file = function.__code__.co_filename

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return a hash of what the code is made from."""
        return made_from(self._function)

    def get_disambiguator(self) -> str:
        """Return what tells functions apart in one folder, and levels of optimisation where we do not choose them."""
        module = self._function.__module__.partition(".")[2] or self._function.__module__
        return module if is_known() else f"{module}-O{int(config.OPT)}{'v' if config.LOOP_VECTORIZE else ''}"

    @classmethod
    def from_function(cls, function: Any, py_file: str) -> Any:
        """Return nothing: a locator is for a folder, see below."""


class _Locators(NamedTuple):
    """In the place of Numba's classes of locators: one folder."""

    folder: Path

    def from_function(self, function: Any, _: str) -> _Locator:
        """Return the locator of a function in the folder."""
        return _Locator(function, self.folder)


class _Files(FunctionCache):
    """The files of a function in a folder."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._impl_class = type("_Impl", (CompileResultCacheImpl,), {"_locator_classes": (_Locators(folder),)})
        super().__init__(function)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Return what code is found by: types and machine, and which member of a record is which."""
        records = (getattr(kind, "instance_class", None) for kind in getattr(sig, "args", sig))
        return (*super()._index_key(sig, codegen), tuple(getattr(record, "_fields", ()) for record in records))

    def keys(self) -> Any:
        """Return for what types and machines there is code."""
        return self._cache_file._load_index()


def _is_own(sig: Any) -> bool:
    """Tell whether the records among the arguments are of this package."""
    records = (getattr(kind, "instance_class", None) for kind in getattr(sig, "args", sig))
    return all(record.__module__.partition(".")[0] == PACKAGE for record in records if record is not None)


class Stored:
    """The machine code of one function on disk, as Numba wants it; opened when it is first asked for.

    What is compiled for the records of others stays in memory: it holds their answers, which may change or be gone
    while this package stays the same, and Numba's index cannot be read where one record of it cannot be imported.
    """

    def __init__(self, function: Any) -> None:
        self._function = function
        self._begun: dict[int, float] = {}

    @cached_property
    def files(self) -> list[_Files]:
        """Where there may be code; the last is where it is kept, if :func:`place` has a folder."""
        return [_Files(self._function, folder) for folder in place().readable]

    @property
    def cache_path(self) -> str | None:
        """The folder."""
        folder = place().folder
        return None if folder is None else str(folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function, if it is there and can be read; what cannot is made again."""
        for files in self.files if _is_own(sig) else ():
            try:
                found = files.load_overload(sig, target_context)
            except Exception as problem:  # whatever unpickling half a file may raise
                with suppress(OSError):
                    files.flush()
                _warn_once(
                    f"compiled code in {files.cache_path} cannot be read ({reason_of(problem)}); it is made again"
                )
            else:
                if found is not None:
                    return found
        self._begun[threading.get_ident()] = time.perf_counter()
        for told in list(_listeners):
            told(self._function, None)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled function, if it is for records of this package and there is room."""
        seconds = time.perf_counter() - self._begun.pop(threading.get_ident(), time.perf_counter())
        for told in list(_listeners):
            told(self._function, seconds)
        if place().folder is None or not _is_own(sig):
            return
        try:
            self.files[-1].save_overload(sig, data)
        except OSError as problem:
            _warn_once(
                f"compiled code cannot be kept in {self.cache_path} ({reason_of(problem)}); it is made each time"
            )

    def is_stored(self, target_context: Any, record: type | None = None) -> bool:
        """Tell whether there is code on disk for this machine, whatever the types, or for a record of this class."""
        machine = target_context.codegen().magic_tuple()
        for files in self.files:
            with suppress(Exception):  # see load_overload, which says so
                if any(key[1] == machine and _is_for(key[0], record) for key in files.keys()):
                    return True
        return False

    def enable(self) -> None:
        """See Numba."""
        for files in self.files:
            files.enable()

    def disable(self) -> None:
        """See Numba."""
        for files in self.files:
            files.disable()

    def flush(self) -> None:
        """Forget what is on disk."""
        for files in self.files:
            files.flush()


def _is_for(sig: Any, record: type | None) -> bool:
    """Tell whether a record of this class is among the arguments; None is any."""
    kinds = getattr(sig, "args", sig)
    return record is None or any(getattr(kind, "instance_class", None) is record for kind in kinds)


def has_code(function: Any, record: type | None = None) -> bool:
    """Tell whether there is machine code of an entry, in this process or on disk for this machine.

    With a class of records: code for arguments of which one is such a record.
    """
    if config.DISABLE_JIT or any(_is_for(sig, record) for sig in function.overloads):
        return True
    return bool(function._cache.is_stored(function.targetctx, record))


_warned: set[str] = set()


def _warn_once(message: str) -> None:
    if message not in _warned:
        _warned.add(message)
        warnings.warn(message, CodeWarning, stacklevel=2)


# ---------------------------------------------------------------------------------------------------- who is told of it

# Called with a function whose code is being made, and the seconds it took, or None at the start.
Listener = Callable[[Any, "float | None"], None]
_listeners: list[Listener] = []


@contextmanager
def told_of_compiling(listener: Listener) -> Iterator[None]:
    """Call a listener whenever the code of an entry has to be made, at its start and at its end."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)
