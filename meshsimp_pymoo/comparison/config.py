"""What an experiment's YAML file may say, and what is answered where it says something else.

::

    title: free text                      # optional
    folder: models                        # optional: where model files are, relative to this file
    problem: {footprint: hull, ...}       # optional: what all problems share, arguments of MeshProblem
    problems:                             # at least one; a bare text is a model
      - {name: M1, model: face:922, up: z}
    algorithms:                           # at least one; a bare text is a preset
      - name: NSGA-II v1
        preset: nsga2_v1                  # a key of presets.PRESETS, or instead
        class: pymoo.algorithms.moo.spea2.SPEA2      # any pymoo algorithm by import path
        parameters: {pop_size: 100}       # its arguments; w where it has one objective: it searches the weighted sum
        operators: {crossover: {name: oax, arrays: L4}}    # keys of operators.OPERATORS, or import paths
        merged_over: {w: [0, 0.5, 1]}     # one run for each value, merged to one front for each seed
    seeds: [1, 2, 3]
    budgets: [{generations: 50}, {evaluations: 55000, shared: true}, {moves: 1000000}, {seconds: 10}]
    baselines: [thinning, meshlab]        # optional; names in baselines.BASELINES, groups of them, or true for all

`read_experiment_file` reads it, opens every model, builds every algorithm and lets it run for three generations
on a tiny model, so that whatever is wrong is known before the first run. Every mistake is a `ConfigError` of
one line: file, line, place, value, what was expected. The file is data: only plain YAML is understood.
"""

from __future__ import annotations

import ast
import contextlib
import copy
import hashlib
import importlib
import inspect
import math
import os
import re
import sys
import textwrap
import traceback
import typing
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial, wraps
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

import numpy as np
import yaml
from pydantic import AfterValidator, BaseModel, Field, PlainValidator, ValidationError, create_model, model_validator
from pymoo.core.duplicate import NoDuplicateElimination
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from meshsimp_pymoo import datasets
from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.errors import ExperimentWarning, InputError, meant, reason_of
from meshsimp_pymoo.files import is_there
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import listed
from meshsimp_pymoo.problem import MeshProblem, minimises_one_number
from meshsimp_pymoo.search.checkpoint import Checkpoints, NotResumable
from meshsimp_pymoo.search.operators import OPERATORS, RandomSubset
from meshsimp_pymoo.search.presets import PRESETS, Preset
from meshsimp_pymoo.search.requirements import require_probability
from meshsimp_pymoo.search.weighted import WeightedSum
from meshsimp_pymoo.settings import Choice, Kind, Real, Whole, plain, settings_of
from meshsimp_pymoo.surface.kinds import Model, surface_of
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.rules import Rules, is_file_of_lines, meant_word_for_lines

if TYPE_CHECKING:
    from pymoo.core.algorithm import Algorithm
    from pymoo.core.problem import Problem

__all__ = [
    "AlgorithmConfig",
    "BaselinesConfig",
    "Budget",
    "ConfigError",
    "Experiment",
    "OperatorConfig",
    "ProblemConfig",
    "read_experiment_file",
]

# A configuration is some hundred lines; anything longer is another file, or an attack on the reader.
MAX_BYTES = 1 << 18
# Values after all aliases are replaced by what they stand for: nested aliases grow exponentially.
MAX_VALUES = 20_000
# Lists and mappings inside each other; the reader's time grows with the square of them.
MAX_DEPTH = 40
MAX_NAME = 60
MAX_FILE_NAME = 255
# Parameters that decide how much memory and time a trial takes, and the most of them that can be meant.
MOST = {
    "pop_size": 5_000,
    "n_offsprings": 5_000,
    "pop_per_ref_point": 5_000,
    "n_points_per_iteration": 5_000,
    "ref_dirs": 5_000,
    "n_neighbors": 5_000,
    "moves_per_vertex": 1_000,
}
# Algorithms that never return when duplicates are taken out of the first population, which nobody refills: pymoo's
# CTAEA waits for as many individuals as there are directions.
WITH_A_FULL_START = ("pymoo.algorithms.moo.ctaea.CTAEA",)
# The weight of the error, for algorithms of one objective.
WEIGHT = "w"
# Parameters that are points or directions in the space of the two objectives.
IN_OBJECTIVES = ("ref_dirs", "ref_points")

# What a pymoo algorithm calls the operator of a kind.
ARGUMENT_OF_KIND = {kind: "eliminate_duplicates" if kind == "duplicates" else kind for kind in OPERATORS}
# The operators an algorithm gets by import path where the file names none: the paper's.
DEFAULT_OPERATORS = {
    "sampling": "random_subset",
    "crossover": "uniform",
    "mutation": "neighbour_shift",
    "repair": "pinned_corners",
    "duplicates": "packed",
}
# What pymoo's operators of a kind derive from.
BASES = {
    "sampling": "pymoo.core.sampling.Sampling",
    "crossover": "pymoo.core.crossover.Crossover",
    "mutation": "pymoo.core.mutation.Mutation",
    "repair": "pymoo.core.repair.Repair",
    "duplicates": "pymoo.core.duplicate.DuplicateElimination",
}
BUDGET_KINDS = ("generations", "evaluations", "moves", "seconds")
# Every algorithm is tried out on this model, and on problems that are even smaller.
TRIAL_MODEL = "pyramid:9"
TRIAL_VERTICES = 81
# Local searches sample in the first, and begin after the second.
TRIAL_GENERATIONS = 3
# What a trial finds out does not depend on a large population; its time does.
TRIAL_POPULATION = 100
# Packages whose lines tell a reader of their own operators nothing.
NOT_THEIRS = sys.stdlib_module_names | {"meshsimp_pymoo", "moocore", "numba", "numpy", "pymoo", "scipy"}
# How the paths of classes begin that come with pymoo or with this package.
KNOWN_HOMES = ("pymoo.", "meshsimp_pymoo.")
# Settings of an algorithm that do not change what it finds.
WITHOUT_EFFECT = {"output", "display", "callback", "verbose", "termination", "seed", "evaluator"}


class ConfigError(InputError):
    """The configuration cannot be used: one line with the file, the place, the value and what was expected."""


# ------------------------------------------------------------------------------------------ values and their mistakes


class _Mistake(ValueError):
    """What is wrong with a value, or with a part of it: ``at`` are its keys and numbers of items."""

    def __init__(self, text: str, *at: str | int) -> None:
        super().__init__(text)
        self.at = at


@contextlib.contextmanager
def _blaming(*at: str | int, what: str = "") -> Iterator[None]:
    """Say of whatever goes wrong which value is to blame, and what could not be done."""
    try:
        yield
    except _Mistake as mistake:
        mistake.at = (*at, *mistake.at)
        raise
    except MemoryError as problem:
        raise _Mistake(f"{what or 'this'} does not fit into memory; make it smaller", *at) from problem
    except Exception as problem:
        name = "" if isinstance(problem, ValueError) else f"{type(problem).__name__}: "
        reason = " ".join(str(problem).split()) or type(problem).__name__
        raise _Mistake(f"{what}{what and ': '}{name}{reason}{line_of(problem)}", *at) from problem


def line_of(problem: Exception) -> str:
    """Return the line of the reader's own code that an exception comes from; nothing where it is none of theirs."""
    for frame, line in reversed(list(traceback.walk_tb(problem.__traceback__))):
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] not in NOT_THEIRS:
            return f" ({Path(frame.f_code.co_filename).name}, line {line})"
    return ""


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("expected a text; put it in quotes if it is one")
    if not value.strip():
        raise ValueError("expected a text")
    return value


def _name(value: Any) -> str:
    name = _text(value).strip()
    if len(name) > MAX_NAME or not name.isprintable():
        raise ValueError(f"expected a name of at most {MAX_NAME} printable characters")
    return name


def _different(things: tuple[Any, ...]) -> tuple[Any, ...]:
    names = [getattr(thing, "name", thing) for thing in things]
    for place, name in enumerate(names):
        if name in names[:place]:
            way_out = f"the name {name!r} is there twice; give each a 'name' of its own"
            raise _Mistake(way_out if hasattr(things[place], "name") else "is there twice", place)
    return things


def _single(values: dict[str, Any]) -> dict[str, Any]:
    if len(values) != 1:
        raise ValueError(f"has {len(values)} keys; give one parameter and the list of its values")
    return values


def _algorithm_path(value: Any) -> str:
    from pymoo.core.algorithm import Algorithm

    path = _text(value)
    if "." not in path:
        raise ValueError("expected an import path such as pymoo.algorithms.moo.spea2.SPEA2")
    with _blaming():
        found = _imported(path)
    if not (inspect.isclass(found) and issubclass(found, Algorithm)):
        raise ValueError("this is no pymoo algorithm (a class derived from pymoo.core.algorithm.Algorithm)")
    return path


def _objectives(value: Any) -> list[str]:
    if not isinstance(value, list) or len(value) != 2 or value[0] not in OBJECTIVES or value[1] != "triangles":
        several = "; an experiment compares fronts of two objectives, more are for nsga3() in Python"
        is_longer = isinstance(value, list) and len(value) > 2
        raise ValueError(f"expected [one of {', '.join(OBJECTIVES)}, triangles]{several if is_longer else ''}")
    return value


def _of(read: Kind | Callable[[Any], Any]) -> Any:
    """Return what pydantic asks to read a value."""
    return PlainValidator(read if callable(read) else read.from_plain)


Thing = TypeVar("Thing")
Text = Annotated[str, _of(_text)]
Name = Annotated[str, _of(_name)]
Count = Annotated[int, _of(Whole(1))]
Different = Annotated[tuple[Thing, ...], Field(min_length=1), AfterValidator(_different)]

# ------------------------------------------------------------------------------------------ the parts of a file


# What a key was called before.
FORMER: dict[Any, str] = {"max_error": "max_objective"}


class Part(BaseModel):
    """A mapping with known keys, its fields. Where there is a ``word``, a bare text is the value of that key."""

    model_config = {"frozen": True, "extra": "forbid"}
    word: ClassVar[str] = ""
    # Of these keys exactly one is given; and what messages call them.
    one_of: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _known(cls, given: Any) -> Any:
        names = [known.alias or name for name, known in cls.model_fields.items()]
        if cls.word and isinstance(given, str):
            return {cls.word: given}
        if not isinstance(given, dict):
            raise ValueError(f"expected a mapping with the keys {', '.join(names)}")
        for name in given:
            if name not in names:
                raise _Mistake(
                    f"unknown key{meant(FORMER.get(name) or name, names)}; known here: {', '.join(names)}", name
                )
        found = [name for name in cls.one_of if name in given]
        if cls.one_of and len(found) != 1:
            raise ValueError(f"give one of {', '.join(cls.one_of.values())}, not {' and '.join(found) or 'none'}")
        return given

    def given(self) -> dict[str, Any]:
        """Return what the file says, by key."""
        return {name: value for name, value in self if name in self.model_fields_set}


def _with_keys(known: Mapping[str, Any]) -> Any:
    """Return a class of parts with keys that may be left out, each with what reads its value."""
    fields: dict[str, Any] = {name: (Annotated[Any, read], None) for name, read in known.items()}
    return create_model("Part", __base__=Part, **fields)


# Keys of `problem`: how a model is read, what counts, and these arguments of MeshProblem.
LIMITS: dict[str, Kind] = {"max_triangles": Whole(1), "max_objective": Real(0), "regions": Whole(1)}
PROBLEM_OPTIONS = {
    **{
        name: _of(known.kind)
        for name, known in (settings_of(Options) | settings_of(Rules)).items()
        if not known.derived
    },
    "objectives": _of(_objectives),
    **{name: _of(kind) for name, kind in LIMITS.items()},
}
_Options: Any = _with_keys(PROBLEM_OPTIONS)


class ProblemOptions(_Options):
    """How a model is read and what counts."""


class _Problem(ProblemOptions):
    word = "model"
    own_name: Name = Field("", alias="name")
    model: Text

    @property
    def name(self) -> str:
        return self.own_name or Path(self.model).stem


@dataclass(frozen=True, kw_only=True, eq=False)
class ProblemConfig:
    """A model, and how it is simplified."""

    name: str  # what tables call it
    source: str  # the file or built-in name, as the configuration has it
    options: Options  # how it is read
    rules: Rules  # what counts; their measure is what is minimised beside the triangles
    limits: Mapping[str, Any]  # other arguments of `MeshProblem`; see LIMITS
    model: Model  # the model, opened; it holds the weights and the break lines

    def build(self) -> MeshProblem:
        """Return the problem, evaluated by one thread: an experiment's runs are what is done in parallel."""
        surface = surface_of(self.model, self.rules.of_the_model)
        return MeshProblem(surface, **self.limits, n_threads=1)

    def description(self) -> dict[str, Any]:
        """Return what decides the results: the model's content, what counts, and the limits."""
        return {"model": self.model.hash, "rules": plain(self.rules), "limits": dict(self.limits)}


@dataclass(frozen=True, kw_only=True)
class OperatorConfig:
    """An operator: its name in `OPERATORS` or import path, and its arguments."""

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def read(cls, kind: str, given: Any) -> OperatorConfig:
        """Return what a file says of the operator of a kind, once it has been made."""
        parameters = {"name": given} if isinstance(given, str) else dict(given) if isinstance(given, dict) else {}
        if "name" not in parameters:
            raise ValueError(f"give the operator's 'name', one of {', '.join(OPERATORS[kind])}, or an import path")
        with _blaming("name"):
            name = _text(parameters.pop("name"))
            target = _class_of(kind, name if "." in name else Choice(tuple(OPERATORS[kind])).from_plain(name))
            if not (inspect.isclass(target) and issubclass(target, _imported(BASES[kind]))):
                raise ValueError(f"this is no pymoo {kind} operator (a class derived from {BASES[kind]})")
        _check_arguments(parameters, target, name)
        with _blaming(what=f"the {kind} operator {name!r} cannot be made"):
            target(**parameters)
        return cls(name=name, parameters=parameters)


_Operators: Any = _with_keys({kind: _of(partial(OperatorConfig.read, kind)) for kind in OPERATORS})


class Operators(_Operators):
    """An algorithm's operators."""


class AlgorithmConfig(Part):
    """An algorithm with its settings: a preset or an import path of pymoo's, its arguments and its operators."""

    word = "preset"
    one_of = {"preset": f"'preset' (one of {', '.join(PRESETS)})", "class": "'class' (an import path)"}
    own_name: Name = Field("", alias="name")
    preset: Annotated[str, _of(Choice(tuple(PRESETS)))] = ""
    path: Annotated[str, _of(_algorithm_path)] = Field("", alias="class")
    parameters: dict[str, Any] = {}
    own_operators: Operators = Field(Operators(), alias="operators")
    # a parameter with several values, whose runs are merged to one front
    merged_over: Annotated[dict[str, Different[Any]], AfterValidator(_single)] = {}

    @property
    def name(self) -> str:
        """What tables call it."""
        return self.own_name or self.preset or self.path.rpartition(".")[2]

    @property
    def measured_by(self) -> tuple[str, ...]:
        """The kinds of budget that fit it: what measures its work, and seconds."""
        return (*(PRESETS[self.preset] if self.preset else Preset).measured_by, "seconds")

    @property
    def target(self) -> Any:
        """The function or class that makes it."""
        return PRESETS[self.preset].function if self.preset else _imported(self.path)

    @property
    def operators(self) -> dict[str, OperatorConfig]:
        """Its operators by kind: those that the file names, and the paper's for an algorithm by import path."""
        known = _parameters(self.target)
        default = {
            kind: OperatorConfig(name=name)
            for kind, name in DEFAULT_OPERATORS.items()
            if self.path and (known is None or ARGUMENT_OF_KIND[kind] in known)
        }
        return default | self.own_operators.given()

    @property
    def merged_parameter(self) -> str:
        """The argument that has several values; empty if there is none."""
        return next(iter(self.merged_over), "")

    @property
    def merged_values(self) -> tuple[Any, ...]:
        """Its values; (None,) if there is none."""
        return self.merged_over.get(self.merged_parameter, (None,))

    def build(self, merged_value: Any = None) -> Algorithm:
        """Return the algorithm, made anew.

        pymoo's default operators are objects that all instances share, some with a memory: hence the copy.
        """
        arguments: dict[str, Any] = {
            key: _argument(key, value)
            for key, value in self._all_parameters(merged_value).items()
            if not (key == WEIGHT and self.weighs_the_problem)
        }
        for kind, operator in self.operators.items():
            arguments[ARGUMENT_OF_KIND[kind]] = _class_of(kind, operator.name)(**operator.parameters)
        algorithm = self.target(**arguments)
        # pymoo's MOEAD does not tell its operators who is calling: those that evaluate get its evaluator here
        for kind in self.operators:
            operator = arguments[ARGUMENT_OF_KIND[kind]]
            if getattr(operator, "evaluator", algorithm) is None:
                operator.evaluator = algorithm.evaluator
        if any(f"{kind.__module__}.{kind.__qualname__}" in WITH_A_FULL_START for kind in type(algorithm).__mro__):
            algorithm.initialization.eliminate_duplicates = NoDuplicateElimination()
        return copy.deepcopy(algorithm)

    def searched(self, problem: MeshProblem, merged_value: Any = None) -> Problem:
        """Return what the algorithm is set up for: the problem, or its weighted sum."""
        return WeightedSum(problem, self._all_parameters(merged_value)[WEIGHT]) if self.weighs_the_problem else problem

    @property
    def weighs_the_problem(self) -> bool:
        """Whether ``w`` makes one objective of the problem's two, for an algorithm that takes no such argument."""
        known = _parameters(self.target)
        return WEIGHT in {*self.parameters, *self.merged_over} and known is not None and WEIGHT not in known

    def _all_parameters(self, merged_value: Any) -> dict[str, Any]:
        return self.parameters | ({self.merged_parameter: merged_value} if self.merged_over else {})

    def description(self, merged_value: Any = None) -> dict[str, Any]:
        """Return what decides the results: the algorithm, its parts and all their settings in effect."""
        described = {
            "algorithm": self.preset or self.path,
            "parameters": _sorted(self.parameters),
            "operators": {
                kind: {"name": operator.name} | _sorted(operator.parameters)
                for kind, operator in sorted(self.operators.items())
            },
            "settings": settings(self.build(merged_value)),
        }
        if self.merged_parameter:
            described["merged"] = {self.merged_parameter: merged_value}
        return described

    @model_validator(mode="after")
    def _can_be_made(self) -> AlgorithmConfig:
        for kind, argument in ARGUMENT_OF_KIND.items():
            if argument in self.parameters:
                raise _Mistake(f"operators stand under 'operators', this one as {kind!r}", "parameters", argument)
        for key, arguments in (("parameters", self.parameters), ("merged_over", self.merged_over)):
            with _blaming(key):
                _check_arguments(arguments, self.target, self.preset or self.path, {WEIGHT} if self.path else set())
                for name, value in arguments.items():
                    for one in value if arguments is self.merged_over else [value]:
                        _argument(name, one)
        if "automated_dm" in (_parameters(self.target) or ()):
            name = self.path.rpartition(".")[2]
            raise _Mistake(
                f"{name} asks a person between generations, and an experiment has none; use it in Python", "class"
            )
        if self.merged_parameter in self.parameters:
            way_out = f"{self.merged_parameter!r} is in 'parameters' too; give it in one place"
            raise _Mistake(way_out, "merged_over", self.merged_parameter)
        for value in self.merged_values:
            at = f" with {self.merged_parameter} = {value!r}" if self.merged_over else ""
            if "ref_dirs" in (_parameters(self.target) or ()) and "ref_dirs" not in self._all_parameters(value):
                at += " without ref_dirs (under 'parameters': a number of directions, or the list of pairs)"
            with _blaming(what=f"the algorithm {self.name!r} cannot be made{at}"):
                if self.weighs_the_problem:
                    require_probability(WEIGHT, self._all_parameters(value)[WEIGHT])
                self.build(value)
        return self


class Budget(Part):
    """When a run ends: after the generation that reaches a number of generations, evaluations, moves or seconds.

    A shared one is divided among the values of `AlgorithmConfig.merged_over`, whose runs make one front.
    """

    one_of = {kind: kind for kind in BUDGET_KINDS}
    own_name: Name = Field("", alias="name")
    generations: Count = 0
    evaluations: Count = 0
    moves: Count = 0
    seconds: Annotated[float, _of(Real(0, strict=True))] = 0
    shared: bool = Field(False, strict=True)

    @property
    def name(self) -> str:
        """What tables call it."""
        return self.own_name or f"{self.amount:.15g} {self.kind}{', shared' if self.shared else ''}"

    @property
    def kind(self) -> str:
        """The one of BUDGET_KINDS that is limited."""
        return next(kind for kind in BUDGET_KINDS if getattr(self, kind))

    @property
    def amount(self) -> float:
        """How many of them."""
        return getattr(self, self.kind)

    def of_each(self, n_values: int) -> Budget:
        """Return the budget of each of several runs that make one front: its share of a shared one, else all of it."""
        share = self.amount / n_values if self.kind == "seconds" else max(self.amount // n_values, 1)
        return self.model_copy(update={"own_name": self.name, self.kind: share}) if self.shared else self


def _baselines(given: Any) -> tuple[str, ...]:
    """Return the methods that a name, a list of names or true (all of them) stands for, in the order of the table."""
    named: dict[str, tuple[str, ...]] = {name: (name,) for name in BASELINES}
    for baseline in BASELINES.values():
        named[baseline.group] = tuple(name for name, other in BASELINES.items() if other.group == baseline.group)
    if given is True:
        return tuple(BASELINES)
    if not isinstance(given, (str, list)) or not given:
        raise ValueError(f"expected true, or a list of some of {', '.join(named)}")
    names = [given] if isinstance(given, str) else given
    chosen: set[str] = set()
    for place, name in enumerate(names):
        with _blaming(*[place] * isinstance(given, list)):
            members = named[Choice(tuple(named)).from_plain(name)]
            if twice := sorted(chosen.intersection(members)):
                raise ValueError(f"{twice[0]!r} is there twice")
            chosen.update(members)
    return tuple(name for name in BASELINES if name in chosen)


class BaselinesConfig(Part):
    """Methods without chance: which, and whether the tools go down to the fewest triangles of the searched fronts."""

    methods: Annotated[tuple[str, ...], _of(_baselines)] = tuple(BASELINES)
    down_to_fronts: bool = Field(True, strict=True)
    steps: Count = 10

    @classmethod
    def read(cls, given: Any) -> BaselinesConfig | None:
        """Return what a file says of them: false for none, true for all of them, names, or a mapping."""
        if given is False:
            return None
        return cls.model_validate(given if isinstance(given, dict) else {"methods": list(_baselines(given))})


class _File(Part):
    title: Text = ""
    folder: Text = ""
    problem: ProblemOptions = ProblemOptions()
    problems: Different[_Problem]
    algorithms: Different[AlgorithmConfig]
    seeds: Different[Annotated[int, _of(Whole(0))]]
    budgets: Different[Budget]
    baselines: Annotated[BaselinesConfig | None, _of(BaselinesConfig.read)] = None

    @model_validator(mode="after")
    def _every_algorithm_has_a_budget(self) -> _File:
        for place, algorithm in enumerate(self.algorithms):
            if not any(budget.kind in algorithm.measured_by for budget in self.budgets):
                way_out = "add one under 'budgets', such as {seconds: 10}"
                kinds = listed(algorithm.measured_by, "or")
                reason = f"no budget fits {algorithm.name}, whose work is measured by {kinds}"
                raise _Mistake(f"{reason}; {way_out}", "algorithms", place)
        return self


@dataclass(frozen=True, kw_only=True, eq=False)
class Experiment:
    """Everything to be done: problems x algorithms x seeds x budgets, and the baselines."""

    path: Path
    title: str
    problems: tuple[ProblemConfig, ...]
    algorithms: tuple[AlgorithmConfig, ...]
    seeds: tuple[int, ...]
    budgets: tuple[Budget, ...]
    baselines: BaselinesConfig | None
    # algorithms whose state cannot be saved, by name, and why: their searches begin anew after a crash
    not_resumable: Mapping[str, str]


def read_experiment_file(
    path: str | os.PathLike[str],
    *,
    folder: str | os.PathLike[str] | None = None,
    before_trials: Callable[[Sequence[ProblemConfig]], object] = lambda _: None,
) -> Experiment:
    """Read a configuration and make sure that all of it can be done.

    Parameters
    ----------
    path : path
        A YAML file, at most 256 KiB. The models that it names lie in the folder of models or below, and that folder in
        the file's own or below: a file that came from elsewhere reads nothing else.
    folder : path, optional
        Where the model files are, in place of what the file says: any folder.
    before_trials : callable, optional
        Called with the problems when all that is quick to check is right, before the algorithms are tried out, which
        compiles them.

    Raises
    ------
    ConfigError
        If anything in it is wrong; nothing has been run then but three generations on a tiny model.
    """
    path = Path(path)
    source = _Source(path)
    try:
        # everything that is cheap to check comes before the models, which may take a while
        file = _File.model_validate(source.value)
        models = _models_folder(file.folder, path, folder)
        problems = []
        for place, entry in enumerate(file.problems):
            with _blaming("problems", place):
                problems.append(_opened(entry, file, models))
        reasons = {}
        before_trials(problems)
        for place, algorithm in enumerate(file.algorithms):
            with _blaming("algorithms", place):
                reasons[algorithm.name] = _try_out(algorithm, problems)
    except (ValidationError, _Mistake) as error:
        raise source.answer(error) from error.__cause__
    return Experiment(
        path=path,
        title=file.title or path.stem,
        problems=tuple(problems),
        algorithms=file.algorithms,
        seeds=file.seeds,
        budgets=file.budgets,
        baselines=file.baselines,
        not_resumable={name: reason for name, reason in reasons.items() if reason},
    )


def settings(part: Any) -> dict[str, Any]:
    """Return the class of an algorithm or operator and its settings in effect, as plain data.

    Examples
    --------
    >>> from meshsimp_pymoo.search.operators import SubsetUniformCrossover
    >>> settings(SubsetUniformCrossover())["prob"]
    0.8
    """
    kind = type(part)
    # a class of this package is known by its name, wherever it lives
    home = "meshsimp_pymoo" if kind.__module__.startswith("meshsimp_pymoo.") else kind.__module__
    found: dict[str, Any] = {"class": f"{home}.{kind.__qualname__}"}
    if not f"{home}.".startswith(KNOWN_HOMES) and (code := _code_of(kind.__module__)):
        found["code"] = code  # whoever changes a class of theirs wants its runs done again
    for name in sorted((_parameters(kind) or set()) - WITHOUT_EFFECT):
        value: Any = getattr(part, name, None)
        if type(value).__module__ == "pymoo.core.variable":
            value = value.value
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if value is None or isinstance(value, (bool, int, float, str, list)):
            found[name] = value
    mating = getattr(part, "mating", None)
    parts = {
        "sampling": getattr(getattr(part, "initialization", None), "sampling", None),
        "crossover": getattr(mating, "crossover", None),
        "mutation": getattr(mating, "mutation", None),
        "selection": getattr(mating, "selection", None),
        "repair": getattr(part, "repair", None),
        "duplicates": getattr(part, "eliminate_duplicates", None),
        "survival": getattr(part, "survival", None),
    }
    for name, operator in parts.items():
        if operator is not None and not isinstance(operator, bool) and operator is not part:
            found[name] = settings(operator)
    comparison = getattr(part, "func_comp", None)
    if callable(comparison):
        found["func_comp"] = getattr(comparison, "__qualname__", str(comparison))
    return found


def _code_of(module: str) -> str:
    """Return a checksum of a module's source; empty if it has none."""
    try:
        return hashlib.sha256(inspect.getsource(sys.modules[module]).encode()).hexdigest()[:16]
    except (KeyError, OSError, TypeError):
        return ""


# ----------------------------------------------------------------------------------- whether what it says can be done


def _models_folder(folder: str, path: Path, given: str | os.PathLike[str] | None) -> Path:
    if given is None:
        _check_inside(folder, "of the configuration", "folder")
        # whether it exists is asked when a model is looked for in it: built-in models need no folder
        return path.parent / folder
    if not Path(given).is_dir():
        raise ConfigError(f"{given}: no such folder of models; name the one that the files are in")
    return Path(given)


def _check_inside(text: str, whose: str, at: str) -> None:
    """Refuse a path that leads out of a folder, by any system's rules."""
    if "\0" in text or any(path.anchor or ".." in path.parts for path in (PurePosixPath(text), PureWindowsPath(text))):
        raise _Mistake(f"leads out of the folder {whose}; name the folder of the models by --models FOLDER instead", at)
    if max(map(len, PurePosixPath(text).parts), default=0) > MAX_FILE_NAME:
        raise _Mistake(f"is too long; names of files have at most {MAX_FILE_NAME} characters", at)


def _opened(entry: _Problem, file: _File, models: Path) -> ProblemConfig:
    options = file.problem.given() | {key: value for key, value in entry.given().items() if key in PROBLEM_OPTIONS}
    where = _model_path(entry.model, models, file.folder)
    lines = options.get("break_lines")
    found = options
    if is_file_of_lines(lines):
        found = options | {"break_lines": _lines_path(lines, models)}
    with _blaming():
        problem = MeshProblem(where, **found, n_threads=1)
    return ProblemConfig(
        name=entry.name,
        source=entry.model,
        options=problem.options,
        rules=replace(problem.surface.rules, break_lines=lines),
        limits={key: value for key, value in options.items() if key in LIMITS},
        model=problem.model,
    )


def _model_path(source: str, models: Path, named: str) -> str:
    """Return the model's file, relative to the folder of models, or the name of a built-in model."""
    path = models / source
    base = source.partition(":")[0]
    if base in datasets.names() and not is_there(path):
        return source
    _check_inside(source, "of models", "model")
    if is_there(path):
        return str(path)
    if not Path(base).suffix and "/" not in source and os.sep not in source:
        near = meant(base, datasets.names())
        raise _Mistake(f"there is neither a file {path} nor a built-in model of that name{near}", "model")
    if not models.is_dir():
        way_out = "name the folder by --models FOLDER" + (" or by 'folder'" if named else "")
        raise _Mistake(f"the file is missing, for there is no folder {models}; {way_out}", "model")
    near = meant(Path(source).name, [item.name for item in models.iterdir()])
    raise _Mistake(f"there is no file {path}{near}", "model")


def _lines_path(source: str, models: Path) -> str:
    """Return the file of break lines, which lies in the folder of models."""
    _check_inside(source, "of models", "break_lines")
    path = models / source
    if not is_there(path):
        beside = [item.name for item in path.parent.iterdir()] if path.parent.is_dir() else []
        near = meant_word_for_lines(source) or meant(path.name, beside)
        raise _Mistake(f"there is no file {path}{near}", "break_lines")
    return str(path)


def _check_arguments(arguments: Mapping[str, Any], target: Any, owner: str, besides: Collection[str] = ()) -> None:
    """Refuse arguments that something does not take, or that would let a trial take all memory or time."""
    known = _parameters(target)
    for name, value in arguments.items():
        if known is not None and name not in known and name not in besides:
            listed = ", ".join(sorted(known)) or "none"
            raise _Mistake(f"{owner} has no such parameter{meant(name, known)}; it takes: {listed}", name)
        for place, number in enumerate(value if isinstance(value, (list, tuple)) else [value]):
            if name in MOST and isinstance(number, (int, float)) and number > MOST[name]:
                raise _Mistake(f"expected at most {MOST[name]:,}", name, place)


def _try_out(config: AlgorithmConfig, problems: Sequence[ProblemConfig]) -> str:
    """Let an algorithm run on a tiny model, and set it up for every problem, before anything is run.

    What is the reader's own runs twice, for it may take chance from elsewhere than its seed. Return why the state of
    the algorithm cannot be saved; nothing if it can.
    """
    value, built, reason = config.merged_values[0], [problem.build() for problem in problems], ""
    for entry, problem in zip(problems, built, strict=True):
        with _blaming(what=f"the algorithm {config.name!r} cannot be used on the problem {entry.name!r}"):
            for one in config.merged_values:
                searched = config.searched(problem, one)
                algorithm = config.build(one).setup(searched, termination=("n_gen", 1), seed=1)
                if sampling := _sized_sampling(algorithm):
                    sampling(searched, 1, random_state=algorithm.random_state)  # whether it has such subsets
    few = {
        key: min(number, TRIAL_POPULATION) if key in MOST and isinstance(number, int) else number
        for key, number in config.parameters.items()
    }
    small = config.model_copy(update={"parameters": few})
    wanted = dict.fromkeys((problem.objectives, problem.regions) for problem in built)
    trials = [MeshProblem(TRIAL_MODEL, objectives=names, regions=n, n_threads=1) for names, n in wanted]
    trials += [problem.build() for problem in problems if problem.model.n_vertices < TRIAL_VERTICES]
    is_own = not all(map(_is_known, [config.path, *(part.name for part in config.operators.values())]))

    def begun(trial: MeshProblem) -> tuple[Any, Any]:
        searched, algorithm = config.searched(trial, value), small.build(value)
        if sampling := _sized_sampling(algorithm):
            sampling.size = None  # meant for the problems, on which it was tried
        if searched.n_obj > 1 and minimises_one_number(algorithm):
            way_out = f"as in merged_over: {{{WEIGHT}: [0, 0.5, 1]}}, and it searches the weighted sum"
            raise ValueError(f"it minimises one number; give it weights of the error, {way_out}")
        algorithm.setup(searched, termination=("n_gen", TRIAL_GENERATIONS), seed=1)
        return searched, algorithm

    for trial in trials:
        with (
            _blaming(what=f"the algorithm {config.name!r} fails on {trial.model.name!r}, a trial"),
            warnings.catch_warnings(),
            _checked_operators(config),
        ):
            warnings.simplefilter("ignore", RuntimeWarning)  # about numbers of the trial, not of the user's models
            searched, algorithm = begun(trial)
            try:
                keeper: Checkpoints | None = Checkpoints(Path(), algorithm, {})
            except NotResumable as problem:
                keeper, reason = None, str(problem)
            try:
                while algorithm.has_next():
                    algorithm.next()
            except TypeError as problem:
                if "numpy boolean" not in str(problem):
                    raise
                raise ValueError(
                    f"it calculates with variables as real numbers, and subsets are bool ({problem})"
                ) from None
            try:
                if keeper is not None:
                    keeper.check()
            except NotResumable as problem:
                reason = str(problem)
            if algorithm.opt is None or algorithm.opt.get("F").shape[1:] != (searched.n_obj,):
                raise ValueError("its result is no front of (error, triangles)")
            if is_own and trial is trials[0] and algorithm.pop is not None:
                _, again = begun(trial)
                while again.has_next():
                    again.next()
                if not all(np.array_equal(again.pop.get(name), algorithm.pop.get(name)) for name in ("X", "F")):
                    text = (
                        f"{config.name}: the same seed gave two different results on the trial; take all chance from "
                        "random_state, else no run repeats"
                    )
                    warnings.warn(text, ExperimentWarning, stacklevel=3)
    return reason


@contextlib.contextmanager
def _checked_operators(config: AlgorithmConfig) -> Iterator[None]:
    """Have operators of the reader's own say what they return, where that is not what pymoo goes on with."""
    with contextlib.ExitStack() as until_done:
        for kind, operator in config.operators.items():
            if not _is_known(operator.name):
                until_done.enter_context(_checked(kind, operator.name))
        yield


@contextlib.contextmanager
def _checked(kind: str, name: str) -> Iterator[None]:
    target = _class_of(kind, name)
    inherited, work = "_do" not in vars(target), target._do

    @wraps(work)
    def checked(operator: Any, *args: Any, **kwargs: Any) -> Any:
        found = work(operator, *args, **kwargs)
        if found is None:
            end = {"sampling": "X", "duplicates": "is_duplicate"}.get(kind, "an array like X")
            raise ValueError(f"{kind} {name} returned nothing; end _do with return {end}")
        expected = _shape_of(kind, operator, args)
        X = np.asarray(found) if kind == "sampling" else found  # pymoo takes rows in a list there
        if expected is None or (isinstance(X, np.ndarray) and (X.dtype, X.shape) == (bool, expected)):
            return found
        array = f"{X.dtype} {X.shape}" if isinstance(X, np.ndarray) else f"a {type(X).__name__}"
        raise ValueError(f"{kind} {name} returned {array}; expected bool {expected}")

    target._do = checked
    try:
        yield
    finally:
        if inherited:
            del target._do
        else:
            target._do = work


def _shape_of(kind: str, operator: Any, args: Sequence[Any]) -> tuple[int, ...] | None:
    """Return the shape of what an operator has to return, called by pymoo with these; None if they are others."""
    if kind == "duplicates":
        return (len(args[0]),) if args else None
    if len(args) < 2:
        return None
    problem, given = args[:2]
    if kind == "sampling":
        return given, problem.n_var
    return (operator.n_offsprings, *given.shape[1:]) if kind == "crossover" else given.shape


def _is_known(path: str) -> bool:
    """Return whether what is named (a path, or a name of ours) comes with pymoo or with this package."""
    return "." not in path or path.startswith(KNOWN_HOMES)


def _sized_sampling(algorithm: Any) -> RandomSubset | None:
    """Return what makes an algorithm's first population, if it makes subsets of sizes that were asked for."""
    sampling = getattr(getattr(algorithm, "initialization", None), "sampling", None)
    return sampling if isinstance(sampling, RandomSubset) else None


# ------------------------------------------------------------------------------------------- classes by name


def _class_of(kind: str, name: str) -> Any:
    return OPERATORS[kind][name] if "." not in name else _imported(name)


def _imported(path: str) -> Any:
    module, _, name = path.rpartition(".")
    if module.partition(".")[0] in sys.stdlib_module_names:
        raise ValueError(f"{path!r} is no pymoo algorithm or operator; it is a part of Python, which is not imported")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, ValueError) as problem:
        way_out = ""
        if isinstance(problem, ModuleNotFoundError) and problem.name == module.partition(".")[0]:
            way_out = "; install the package that it is in, or name the folder of the module in PYTHONPATH"
        raise ValueError(f"{path!r} cannot be imported ({problem}){way_out}") from None
    except AttributeError:
        near = meant(name, dir(importlib.import_module(module)))
        raise ValueError(f"the module {module} has no {name!r}{near}") from None


def _parameters(target: Any) -> set[str] | None:
    """Return the arguments that a function or class takes, those it passes on included; None if unknown."""
    names: set[str] = set()
    if not inspect.isclass(target):
        for parameter in inspect.signature(target).parameters.values():
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD:
                names.add(parameter.name)
        made = typing.get_type_hints(target).get("return")
        return names | (_parameters(made) or set()) - {"ref_dirs"} if inspect.isclass(made) else None
    variadic = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    n_given, given = 0, set[str]()  # what the children of a class pass to it themselves
    for parent in target.__mro__:
        if parent is object or "__init__" not in vars(parent):
            continue
        constructor = vars(parent)["__init__"]
        parameters = list(inspect.signature(constructor).parameters.values())[1:]
        own = [parameter.name for parameter in parameters if parameter.kind not in variadic]
        names |= set(own[n_given:]) - given
        if not any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in parameters):
            break
        n_given, passed = _given_to_the_parent(constructor)
        given |= passed
    return names


@cache
def _given_to_the_parent(constructor: Any) -> tuple[int, set[str]]:
    """Return how many arguments and which keywords a constructor passes to its parent's, not counting what it is given.

    MOEAD says itself how it treats duplicates, so ``eliminate_duplicates`` is no argument of it.
    """
    try:
        source = textwrap.dedent(inspect.getsource(constructor))
    except (OSError, TypeError):  # no source, no knowledge: such a class answers for itself when it is made
        return 0, set()
    for call in ast.walk(ast.parse(source)):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "__init__":
            return len(call.args), {keyword.arg for keyword in call.keywords if keyword.arg}
    return 0, set()


def _argument(name: str, value: Any) -> Any:
    """Return a parameter as pymoo wants it: ``ref_dirs: n`` means n even directions, lists of numbers are arrays."""
    if name == "ref_dirs" and isinstance(value, int):
        from pymoo.util.ref_dirs import get_reference_directions

        return get_reference_directions("uniform", 2, n_partitions=max(1, value - 1))
    if not isinstance(value, list):
        return value
    try:
        array = np.array(value)
    except ValueError:
        raise _Mistake("expected rows of equal length", name) from None
    if name in IN_OBJECTIVES and (array.ndim != 2 or array.shape[1] != 2):
        raise _Mistake("expected a list of pairs, [error, triangles] each", name)
    return array.astype(float) if array.dtype.kind in "iuf" else value


def _sorted(values: Mapping[str, Any]) -> dict[str, Any]:
    return dict(sorted(values.items()))


# ---------------------------------------------------------------------------------------- YAML with its places

# What is said of values that pydantic refuses by itself; all else is said by functions of this file.
EXPECTED = {
    "missing": "the key {key!r} is missing",
    "bool_type": "expected true or false",
    "dict_type": "expected a mapping",
    "tuple_type": "expected a list",
    "too_short": "the list is empty; give at least one {one}",
}


class _Source(yaml.SafeLoader):
    """A YAML file: its value as plain data, and where every part of it stands.

    Raises
    ------
    ConfigError
        If it is none, or too large, or holds anything but plain data.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.depth = self.count = 0
        self.parts: dict[tuple[str | int, ...], tuple[Node, int]] = {}
        try:
            if (size := path.stat().st_size) > MAX_BYTES:
                raise ConfigError(f"{path}: has {size:,} bytes; a configuration has at most {MAX_BYTES:,}")
            super().__init__(path.read_text(encoding="utf-8"))
            root = self.get_single_node()
        except FileNotFoundError:
            raise ConfigError(f"{path}: no such file") from None
        except OSError as problem:
            raise ConfigError(f"{path}: cannot be read ({reason_of(problem)})") from None
        except UnicodeDecodeError as problem:
            raise ConfigError(f"{path}: is no text in UTF-8 (byte {problem.start})") from None
        except yaml.YAMLError as problem:
            mark = getattr(problem, "problem_mark", None)
            said = getattr(problem, "problem", None) or reason_of(problem)
            raise ConfigError(f"{path}{f', line {mark.line + 1}' if mark else ''}: is no YAML: {said}") from None
        if root is None:
            raise ConfigError(f"{path}: is empty; see the configs folder for examples")
        try:
            self.value = self._plain(root, root.start_mark.line)
        except _Mistake as mistake:
            raise self.answer(mistake) from None

    def answer(self, error: ValidationError | _Mistake) -> ConfigError:
        """Return the one line that says where, what and what was expected."""
        said: Any = error
        at = getattr(error, "at", ())
        if isinstance(error, ValidationError):
            first = error.errors(include_url=False, include_input=False)[0]
            said = first.get("ctx", {}).get("error") or EXPECTED.get(first["type"], first["msg"]).format(
                key=first["loc"][-1], one=str(first["loc"][-1]).rstrip("s")
            )
            at = (*first["loc"], *getattr(said, "at", ()))
        while at not in self.parts:
            at = at[:-1]
        node, line = self.parts[at]
        place = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in at).lstrip(".")
        value = _spelled(node, str(said))
        return ConfigError(": ".join(filter(None, (f"{self.path}, line {line + 1}", place, value, str(said)))))

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:
        """Return the next value, unless the file is too large or too deep to be a configuration."""
        self.count += 1
        self.depth += 1
        self._limit(self.depth, self.count, self.peek_event().start_mark.line)  # type: ignore[no-untyped-call]
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def _limit(self, depth: int, count: int, line: int) -> None:
        where = f"{self.path}, line {line + 1}"
        if depth > MAX_DEPTH:
            raise ConfigError(f"{where}: is nested too deeply for a configuration, or contains itself by an alias")
        if count > MAX_VALUES:
            most = f"a configuration has at most {MAX_VALUES:,}"
            raise ConfigError(f"{where}: stands for too many values once aliases are replaced; {most}")

    def _plain(self, node: Node, line: int, *at: str | int) -> Any:
        """Return a value as plain Python data, and remember where its parts stand."""
        self.parts[at] = node, line
        self._limit(len(at), len(self.parts), line)
        if isinstance(node, SequenceNode) and node.tag == "tag:yaml.org,2002:seq":
            return [self._plain(part, part.start_mark.line, *at, place) for place, part in enumerate(node.value)]
        if isinstance(node, MappingNode) and node.tag == "tag:yaml.org,2002:map":
            found: dict[str, Any] = {}
            for key, part in node.value:
                if not isinstance(key, ScalarNode):
                    raise _Mistake("a key must be a word", *at)
                value = self._plain(part, key.start_mark.line, *at, key.value)
                if key.value in found:
                    raise _Mistake("the key is there twice", *at, key.value)
                found[key.value] = value
            return found
        try:
            value = self.construct_object(node)
        except (yaml.YAMLError, ValueError, OverflowError):
            raise _Mistake(f"the tag {node.tag!r} is not understood; expected plain data", *at) from None
        if isinstance(value, float) and not math.isfinite(value):
            raise _Mistake("expected a finite number", *at)
        if value is not None and not isinstance(value, (bool, int, float, str)):
            raise _Mistake(f"a {type(value).__name__} is not understood; put it in quotes if it is a text", *at)
        return value


def _spelled(node: Node, said: str) -> str:
    """Return a single value as the file has it, texts in quotes, unless what is said of it names it already."""
    if not isinstance(node, ScalarNode):
        return ""
    value = node.value if len(node.value) <= 80 else node.value[:77] + "..."
    if node.tag != "tag:yaml.org,2002:str":
        return value or "nothing"
    if repr(value) in said or said.startswith(f"{value}:"):
        return ""
    # YAML 1.1 reads 1e-3 as a text
    is_number = re.fullmatch(r"[-+.\d]+e[-+]?\d+", value, re.IGNORECASE)
    return repr(value) + (" (a text; write numbers like 1.0e-3)" if is_number else "")
