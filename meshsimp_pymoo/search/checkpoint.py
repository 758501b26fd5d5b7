"""The state of a running search in one file, so that a killed search goes on where it was.

A checkpoint is taken between two ``algorithm.next()``. Restored into an algorithm that was made and set up in the same
way, it makes the search go on to the very bytes that it would have found undisturbed, if its budget is in generations,
evaluations or moves; a budget in seconds goes on with what is left of it::

    algorithm.setup(problem, termination=("n_gen", 1000), seed=1)
    if path.exists():
        restore(read_checkpoint(path), algorithm)
    checkpoints = Checkpoints(path, algorithm, what={"model": problem.model.hash}, interval=60.0)
    while algorithm.has_next():
        algorithm.next()
        if checkpoints.due():
            checkpoints.save()

The file is a .npz of plain arrays, packed bits for the subsets. One of them is JSON: what the search is, and the
attributes of the algorithm and its parts (operators, survival, evaluator, generator of random numbers) by name. Nothing
is pickled, and a file is only believed with the right checksum. An individual is stored once, however many places of
the population it has.

What is taken is found by walking through the algorithm, so that new state in an operator is not forgotten. State of a
kind that this cannot carry (a generator in the middle of its work, an object of another package, a part that was made
during the run and holds a function) is refused with :class:`NotResumable`, never left out.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import sys
import time
import types
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pymoo.core.algorithm import Algorithm
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.core.termination import NoTermination
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.termination.max_gen import MaximumGenerationTermination
from pymoo.termination.max_time import TimeBasedTermination

from meshsimp_pymoo.errors import ModelError, ResultError, reason_of
from meshsimp_pymoo.files import new_file, read_npz
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.search.budgets import Moves, WholeGenerations

__all__ = ["CheckpointError", "Checkpoints", "NotResumable", "Stored", "difference", "read_checkpoint", "restore"]

Arrays = dict[str, npt.NDArray[Any]]

FORMAT = 1
# Seconds between two checkpoints unless told; and in any case this many times as long as writing one took.
INTERVAL = 60.0
PAUSE = 50.0
# Packages whose objects are looked into.
OWN_PACKAGES = ("pymoo", "meshsimp_pymoo")
# Not part of an algorithm's state: what it is told anew, what it shows, and what the next generation replaces.
# AGEMOEA keeps a ``default_termination`` that it never asks.
LEFT_OUT = (
    "problem",
    "termination",
    "default_termination",
    "display",
    "output",
    "callback",
    "history",
    "off",
    "verbose",
)
# Terminations that remember nothing but how far they are; their limits are told anew.
TERMINATIONS = (
    NoTermination,
    MaximumGenerationTermination,
    MaximumFunctionCallTermination,
    Moves,
    TimeBasedTermination,
    WholeGenerations,
)
FIXED = (types.FunctionType, types.BuiltinFunctionType, types.MethodType, types.ModuleType, type, Problem)
# A class derived from one of these holds more than its attributes.
HOLDERS = (np.ndarray, dict, list, set, tuple, Individual)
# Of an individual: its settings are those that every new one has.
SAME_FOR_ALL = ("config", "data", "evaluated")
STATE, CHECKSUM = "state", "checksum"
# How an individual has an attribute; and what a column holds for one that lacks it.
ABSENT, NOTHING, PRESENT = 0, 1, 2
LACKING = object()


class CheckpointError(ResultError):
    """A checkpoint cannot be used or written: one line, which file and why."""


class NotResumable(TypeError):
    """An algorithm holds state that a checkpoint cannot carry."""


@brief
@dataclass(frozen=True, eq=False)
class Stored:
    """A checkpoint that was read back and is whole.

    Attributes
    ----------
    path : Path
        Its file.
    what : dict
        What the search is.
    facts : dict
        What the caller noted besides.
    seconds : float
        Seconds that the search had taken.
    content : dict
        The state in JSON's types.
    arrays : dict of str to array
        The arrays that it names, and those that the caller stored beside.
    """

    path: Path
    what: dict[str, Any]
    facts: dict[str, Any]
    seconds: float
    content: dict[str, Any]
    arrays: Arrays


class Checkpoints:
    """Writes the checkpoints of one search, each in place of the one before, not too often.

    Parameters
    ----------
    path : Path
        The file.
    algorithm : Algorithm
        A pymoo algorithm after ``setup`` (and, if there was one, after :func:`restore`).
    what : mapping
        What the search is, in JSON's types: a checkpoint is only for the same.
    interval : float
        Least seconds between two checkpoints. It is lengthened to ``PAUSE`` times the seconds that writing one takes,
        so that checkpoints cost at most 2 %.
    before : float
        Seconds that the search took before this process.
    arrays : mapping of str to array, optional
        What has to be stored besides, under names that are words: of a closed surface what
        :func:`~meshsimp_pymoo.surface.kinds.stored_arrays` says, with which the problem is made again before
        :func:`restore`.

    Raises
    ------
    NotResumable
        If the algorithm holds what a checkpoint cannot carry.
    """

    def __init__(
        self,
        path: Path,
        algorithm: Algorithm,
        what: Mapping[str, Any],
        *,
        interval: float = INTERVAL,
        before: float = 0.0,
        arrays: Mapping[str, npt.NDArray[Any]] | None = None,
    ) -> None:
        self.path = path
        self.algorithm = algorithm
        self.what = dict(what)
        self.interval = interval
        self.before = before
        self.arrays = dict(arrays or {})
        self.saved = 0
        self._parts = frozenset(_Writer().state(algorithm)[1])
        self._began = time.perf_counter()
        self._next = self._began + interval

    @property
    def seconds(self) -> float:
        """Seconds that the search has taken, those before this process included."""
        return self.before + time.perf_counter() - self._began

    def check(self) -> None:
        """Find out whether the algorithm's state can be saved as it is now; write nothing.

        Raises
        ------
        NotResumable
            If it holds what a checkpoint cannot carry.
        """
        _Writer(self._parts).state(self.algorithm)

    def due(self) -> bool:
        """Tell whether it is time for the next checkpoint."""
        return time.perf_counter() >= self._next

    def save(self, **facts: Any) -> None:
        """Write a checkpoint: whole, or the one before stays.

        Parameters
        ----------
        **facts
            What to note besides, in JSON's types.

        Raises
        ------
        CheckpointError
            If the file cannot be written.
        NotResumable
            If the algorithm now holds what a checkpoint cannot carry.
        """
        begun = time.perf_counter()
        try:
            writer = _Writer(self._parts)
            state, _ = writer.state(self.algorithm)
            head = {"format": FORMAT, "what": self.what, "facts": facts, "seconds": self.seconds, "clock": time.time()}
            _write(self.path, head | state, self.arrays | writer.arrays)
            self.saved += 1
        finally:
            now = time.perf_counter()
            self._next = now + max(self.interval, PAUSE * (now - begun))


def read_checkpoint(path: Path) -> Stored:
    """Read a checkpoint and check that it is whole.

    Raises
    ------
    CheckpointError
        If it cannot be read, is cut off, changed, or no checkpoint of this version. Nothing is unpickled, and no more
        is allocated than the file is long.
    """
    try:
        with path.open("rb") as stream:
            with zipfile.ZipFile(stream) as archive:
                if any(entry.compress_type != zipfile.ZIP_STORED for entry in archive.infolist()):
                    raise ModelError("it is packed, and checkpoints are not")
            stream.seek(0)
            arrays = read_npz(stream, path.name)
        checksum = arrays.pop(CHECKSUM)
        if checksum.dtype != np.uint8 or checksum.tobytes() != _checksum(arrays):
            raise ModelError("its content does not have its checksum")
        content = json.loads(arrays.pop(STATE).tobytes())
        if content["format"] != FORMAT:
            raise ModelError(f"it has the format {content['format']!r}, this version reads {FORMAT}")
        return Stored(path, content["what"], content["facts"], float(content["seconds"]), content, arrays)
    except Exception as problem:  # a damaged archive may break in any way
        reason = f"it holds no {problem}" if isinstance(problem, KeyError) else reason_of(problem)
        raise CheckpointError(f"{path}: is no checkpoint, or a damaged one ({reason})") from None


def difference(stored: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    """Return what is different between two descriptions of a search; empty if nothing is.

    >>> difference({"seed": 1, "algorithm": "moead"}, {"seed": 2, "algorithm": "moead"})
    'seed 1, not 2'
    """
    wanted = json.loads(json.dumps(wanted))
    for key in [*wanted, *(set(stored) - set(wanted))]:
        if stored.get(key) != wanted.get(key):
            return f"{key} {stored.get(key)}, not {wanted.get(key)}"
    return ""


def restore(stored: Stored, algorithm: Algorithm) -> None:
    """Bring an algorithm to the state of a checkpoint.

    Parameters
    ----------
    stored : Stored
        The checkpoint.
    algorithm : Algorithm
        Made and set up, for the same problem and with the same seed, as the one that was saved, and not run.

    Raises
    ------
    CheckpointError
        If it is the state of another kind of algorithm or problem; the algorithm is of no use then.
    """
    try:
        _Reader(stored, algorithm.problem.n_var).restore(algorithm)
    except Exception as problem:  # nonsense may break anything
        raise CheckpointError(f"{stored.path}: does not fit this search ({reason_of(problem)})") from None


# ------------------------------------------------------------------------------------------------------------- writing


def _write(path: Path, content: dict[str, Any], arrays: Arrays) -> None:
    text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
    whole: Arrays = arrays | {STATE: np.frombuffer(text, np.uint8)}
    whole[CHECKSUM] = np.frombuffer(_checksum(whole), np.uint8)
    packed = io.BytesIO()
    np.savez(packed, **whole)  # type: ignore[arg-type]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with new_file(path) as partial:
            partial.write_bytes(packed.getbuffer())
    except (OSError, ResultError) as problem:
        cause = problem if isinstance(problem, OSError) else problem.__context__ or problem
        raise CheckpointError(f"{path}: cannot be written ({reason_of(cause)})") from None


def _checksum(arrays: Arrays) -> bytes:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(np.ascontiguousarray(array).data if array.size else b"")
    return digest.digest()


class _Writer:
    """Turns the state of an algorithm into JSON's types and arrays.

    Plain values stand for themselves; all others are lists that begin with their kind.

    Parameters
    ----------
    parts : set of str, optional
        The paths of the parts that the algorithm had before the run. Others are made anew when they are restored.
    """

    def __init__(self, parts: frozenset[str] | None = None) -> None:
        self._parts = parts
        self._new = ""  # the part that was made during the run, while it is looked into
        self.arrays: Arrays = {}
        self._individuals: list[Individual] = []
        self._place: dict[int, int] = {}
        self._seen: dict[int, str] = {}
        self._named: dict[int, str] = {}
        self._alive: list[Any] = []  # so that no id is given twice

    def state(self, algorithm: Algorithm) -> tuple[dict[str, Any], set[str]]:
        """Return the state, and the paths of the parts."""
        code = self.value(algorithm, "algorithm")
        return {"algorithm": code, "individuals": self._columns()}, set(self._seen.values())

    def value(self, value: Any, path: str) -> Any:
        kind = type(value)
        if value is None or kind in (bool, int, str):
            return value
        if kind is float:
            return value if math.isfinite(value) else ["float", repr(value)]
        if isinstance(value, np.generic) and not value.dtype.hasobject:
            return ["scalar", self._array(np.asarray(value))]
        if kind is Population:
            return ["population", self._array(np.array([self._individual(one) for one in value], np.int64))]
        if kind is Individual:
            return ["individual", self._individual(value)]
        if kind is np.ndarray and not value.dtype.hasobject:
            return self._shared(value)
        if kind in (list, tuple):
            return [kind.__name__, [self.value(part, f"{path}[{k}]") for k, part in enumerate(value)]]
        if issubclass(kind, tuple) and hasattr(kind, "_fields"):
            return ["named", _name_of(value), [self.value(part, f"{path}[{k}]") for k, part in enumerate(value)]]
        if kind is set:
            return ["set", [self.value(part, path) for part in sorted(value, key=repr)]]
        if kind is dict:
            return ["dict", [[self.value(k, path), self.value(v, f"{path}[{k!r}]")] for k, v in value.items()]]
        if kind is np.random.Generator:
            if id(value) in self._seen:
                return ["seen", self._seen[id(value)]]
            self._seen[id(value)] = path
            if self._is_new(path):
                raise NotResumable(f"{path} was made during the run, so a checkpoint cannot restore it")
            bits = value.bit_generator
            return ["generator", path, type(bits).__name__, self.value(bits.state, path)]
        if isinstance(value, FIXED) or hasattr(value, "__code__"):  # functions, compiled ones too
            if self._new:
                raise NotResumable(
                    f"{self._new} was made during the run and holds a function, which no checkpoint can restore"
                )
            return ["fixed"]
        is_own = kind.__module__.partition(".")[0] in OWN_PACKAGES and kind.__dictoffset__
        if is_own and not isinstance(value, HOLDERS):
            return self._object(value, path)
        raise NotResumable(f"{path} is a {kind.__module__}.{kind.__qualname__}, which a checkpoint cannot carry")

    def _object(self, value: Any, path: str) -> list[Any]:
        if id(value) in self._seen:
            return ["seen", self._seen[id(value)]]
        self._seen[id(value)] = path
        outside, attributes = self._new, {}
        if not outside and self._is_new(path):
            self._new = path
        if self._new and _own_class(_name_of(value)) is not type(value):
            raise NotResumable(f"{path} was made during the run, of a class that no checkpoint can find again")
        for name, part in vars(value).items():
            if not (isinstance(value, Algorithm) and name in LEFT_OUT):
                attributes[name] = self.value(part, f"{path}.{name}")
        self._new = outside
        code = ["object", _name_of(value), path, attributes]
        if isinstance(value, Algorithm):
            end = value.termination
            if type(end) not in TERMINATIONS:
                raise NotResumable(f"{path}.termination is a {_name_of(end)}, which a checkpoint cannot carry")
            code.append([bool(end.force_termination), float(end.perc)])
        return code

    def _is_new(self, path: str) -> bool:
        return self._parts is not None and path not in self._parts

    def _array(self, array: npt.NDArray[Any]) -> str:
        name = f"a{len(self.arrays)}"
        self.arrays[name] = array
        return name

    def _shared(self, array: npt.NDArray[Any]) -> list[Any]:
        """Store an array once, wherever it is met again."""
        if id(array) not in self._named:
            self._alive.append(array)
            self._named[id(array)] = self._array(np.packbits(array) if array.dtype.kind == "b" else array)
        name = self._named[id(array)]
        return ["bits", name, list(array.shape)] if array.dtype.kind == "b" else ["array", name]

    def _individual(self, one: Individual) -> int:
        if type(one) is not Individual:
            raise NotResumable(f"a population holds a {_name_of(one)}, which a checkpoint cannot carry")
        if id(one) not in self._place:
            self._place[id(one)] = len(self._individuals)
            self._individuals.append(one)
        return self._place[id(one)]

    def _columns(self) -> dict[str, Any]:
        """Return all individuals met, a column for each of their attributes."""
        people = list(self._individuals)
        self._new = "an individual"  # all that it holds is made anew
        columns = {
            name: self._column(name, [vars(one).get(name) for one in people], [name in vars(one) for one in people])
            for name in _keys([vars(one) for one in people])
            if name not in SAME_FOR_ALL
        }
        data = {
            name: self._column(name, [one.data.get(name) for one in people], [name in one.data for one in people])
            for name in _keys([one.data for one in people])
        }
        evaluated = [tuple(sorted(one.evaluated)) for one in people]
        kinds = sorted(set(evaluated))
        which = self._array(np.array([kinds.index(names) for names in evaluated], np.int64))
        if len(self._individuals) > len(people):
            raise NotResumable("individuals hold other individuals, which a checkpoint cannot carry")
        return {
            "count": len(people),
            "columns": columns,
            "data": data,
            "evaluated": [which, [list(names) for names in kinds]],
        }

    def _column(self, name: str, values: list[Any], there: list[bool]) -> list[Any]:
        mark = np.full(len(values), ABSENT, np.uint8)
        mark[there] = PRESENT
        mark[[value is None and is_there for value, is_there in zip(values, there, strict=True)]] = NOTHING
        present = [value for value, m in zip(values, mark, strict=True) if m == PRESENT]
        marks = self._array(mark)
        kinds = {type(value) for value in present}
        if kinds == {np.ndarray} and len({(value.shape, value.dtype.str) for value in present}) == 1:
            shape, dtype = present[0].shape, present[0].dtype
            if dtype.kind == "b":
                return ["bits", marks, self._array(np.stack([np.packbits(value) for value in present])), list(shape)]
            if not dtype.hasobject:
                return ["rows", marks, self._array(np.stack(present))]
        if kinds in ({int}, {float}, {bool}):
            plain = np.array(present)
            if not plain.dtype.hasobject:
                return ["plain", marks, self._array(plain)]
        if len(kinds) == 1 and issubclass(next(iter(kinds)), np.generic):
            scalars = np.array(present)
            if scalars.dtype.type in kinds:
                return ["rows", marks, self._array(scalars)]
        return ["each", marks, [self.value(value, f"individuals.{name}[{k}]") for k, value in enumerate(present)]]


def _keys(mappings: list[dict[str, Any]]) -> list[str]:
    names: dict[str, None] = {}
    for mapping in mappings:
        names.update(dict.fromkeys(mapping))
    if not all(type(name) is str for name in names):
        raise NotResumable("an individual has a name that is no text, which a checkpoint cannot carry")
    return list(names)


def _name_of(value: Any) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}"


def _own_class(name: str) -> type[Any] | None:
    """Return a class of pymoo or of this package that is in memory, by its name; None if there is none."""
    module, _, word = name.rpartition(".")
    found = getattr(sys.modules.get(module), word, None) if module.partition(".")[0] in OWN_PACKAGES else None
    return found if isinstance(found, type) else None


# ------------------------------------------------------------------------------------------------------------- reading


class _Reader:
    """Puts a stored state into an algorithm; the counterpart of `_Writer`."""

    def __init__(self, stored: Stored, n_var: int) -> None:
        self.stored = stored
        self.arrays = stored.arrays
        self._objects: dict[str, Any] = {}
        self._decoded: dict[str, npt.NDArray[Any]] = {}
        self._n_var = n_var
        self._individuals = [Individual() for _ in range(stored.content["individuals"]["count"])]

    def restore(self, algorithm: Algorithm) -> None:
        self.value(self.stored.content["algorithm"], algorithm)
        self._fill(self._individuals, self.stored.content["individuals"])  # they may hold what the algorithm holds
        if algorithm.start_time is not None:
            algorithm.start_time += time.time() - float(self.stored.content["clock"])

    def value(self, code: Any, now: Any) -> Any:
        """Return the value that a code stands for; parts that exist are changed in place."""
        if not isinstance(code, list):
            return code
        kind, *rest = code
        if kind == "float":  # there is one NaN, so that records that hold it are equal
            return math.nan if rest[0] == "nan" else float(rest[0])
        if kind == "scalar":
            return self.arrays[rest[0]][()]
        if kind == "population":
            return Population.create(*[self._one(k) for k in self.arrays[rest[0]]])
        if kind == "individual":
            return self._one(rest[0])
        if kind in ("array", "bits"):
            name = rest[0]
            if name not in self._decoded:
                array = self.arrays[name]
                self._decoded[name] = array.copy() if kind == "array" else _unpacked(array, tuple(rest[1]))
            return self._decoded[name]
        if kind in ("list", "tuple"):
            old = list(now) if isinstance(now, (list, tuple)) and len(now) == len(rest[0]) else [None] * len(rest[0])
            parts = [self.value(part, one) for part, one in zip(rest[0], old, strict=True)]
            return parts if kind == "list" else tuple(parts)
        if kind == "named":
            if _name_of(now) != rest[0]:
                raise TypeError(f"a {rest[0]} is not a {_name_of(now)}")
            return type(now)(*[self.value(part, None) for part in rest[1]])
        if kind == "set":
            return {self.value(part, None) for part in rest[0]}
        if kind == "dict":
            before = now if isinstance(now, dict) else {}
            keys = [self.value(key, None) for key, _ in rest[0]]
            return {key: self.value(part, before.get(key)) for key, (_, part) in zip(keys, rest[0], strict=True)}
        if kind == "generator":
            path, name, bits = rest
            if not isinstance(now, np.random.Generator) or type(now.bit_generator).__name__ != name:
                raise TypeError(f"the random numbers come from {name}")
            self._objects[path] = now
            now.bit_generator.state = self.value(bits, None)
            return now
        if kind == "fixed":
            if now is None:
                raise TypeError("a function is missing")
            return now
        if kind == "seen":
            return self._objects[rest[0]]
        if kind == "object":
            return self._object(now, *rest)
        raise ValueError(f"{kind!r} is unknown")

    def _object(self, now: Any, name: str, path: str, attributes: dict[str, Any], *end: Any) -> Any:
        if now is None and (made := _own_class(name)) is not None:
            now = object.__new__(made)
        if _name_of(now) != name:
            raise TypeError(f"{path} is a {name}, not a {_name_of(now)}")
        self._objects[path] = now
        own = vars(now)
        for attribute, code in attributes.items():
            own[attribute] = self.value(code, own.get(attribute))
        if isinstance(now, Algorithm):
            ((now.termination.force_termination, now.termination.perc),) = end
        return now

    def _one(self, k: int) -> Individual:
        if k < 0:
            raise IndexError("no individual has a negative number")
        return self._individuals[k]

    def _fill(self, people: list[Individual], content: dict[str, Any]) -> None:
        for name, code in content["columns"].items():
            for one, value in zip(people, self._column(code, len(people)), strict=True):
                if value is not LACKING:
                    vars(one)[name] = value
        for name, code in content["data"].items():
            for one, value in zip(people, self._column(code, len(people)), strict=True):
                if value is not LACKING:
                    one.data[name] = value
        which, kinds = content["evaluated"]
        for one, k in zip(people, self.arrays[which], strict=True):
            one.evaluated = set(kinds[int(k)])
            if one.X.shape != (self._n_var,):
                raise ValueError(f"an individual has {one.X.shape} variables, the problem {self._n_var}")

    def _column(self, code: list[Any], count: int) -> list[Any]:
        """Return a value for each individual; LACKING where there is none."""
        kind, marks, stored, *shape = code
        mark = self.arrays[marks]
        if mark.shape != (count,):
            raise ValueError(f"{marks} is of {mark.shape}, not {count}")
        if kind == "each":
            values = [self.value(part, None) for part in stored]
        elif kind == "plain":
            values = self.arrays[stored].tolist()
        elif kind == "bits":
            values = [_unpacked(row, tuple(shape[0])) for row in self.arrays[stored]]
        else:
            # copies, so that none keeps the memory of all
            values = [row.copy() for row in self.arrays[stored]]
        if len(values) != np.count_nonzero(mark == PRESENT):
            raise ValueError(f"{marks} marks others than the {len(values)} values")
        left = iter(values)
        return [next(left) if m == PRESENT else None if m == NOTHING else LACKING for m in mark.tolist()]


def _unpacked(packed: npt.NDArray[Any], shape: tuple[int, ...]) -> npt.NDArray[np.bool_]:
    count = math.prod(shape)
    if packed.dtype != np.uint8 or packed.size != -(-count // 8):
        raise ValueError(f"{packed.size} packed bytes are no {count} bits")
    return np.unpackbits(packed, count=count).astype(bool).reshape(shape)
