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
        parameters: {pop_size: 100}       # its arguments
        operators: {crossover: {name: oax, arrays: L4}}    # keys of operators.OPERATORS, or import paths
        merged_over: {w: [0, 0.5, 1]}     # one run for each value, merged to one front for each seed
    seeds: [1, 2, 3]
    budgets: [{generations: 50}, {evaluations: 5000}, {seconds: 10}]
    baselines: {meshlab: {methods: [...], down_to_fronts: true, steps: 10}}    # optional

`read_experiment_file` reads it, opens every model, builds every algorithm and lets it run for two generations
on a tiny model, so that whatever is wrong is known before the first run. Every mistake is a `ConfigError` of
one line: file, line, place, value, what was expected. The file is data: only plain YAML is understood.
"""

from __future__ import annotations

import copy
import difflib
import importlib
import inspect
import math
import os
import sys
import typing
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from meshsimp_pymoo import datasets
from meshsimp_pymoo.comparison.meshlab import MESHLAB_METHODS
from meshsimp_pymoo.errors import InputError, ModelError, reason_of
from meshsimp_pymoo.files import is_there
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.search.operators import OPERATORS
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.settings import Kind, Real, Whole, plain, settings_of
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import OBJECTIVES
from meshsimp_pymoo.surface.model import OpenModel
from meshsimp_pymoo.surface.rules import Rules

if TYPE_CHECKING:
    from pymoo.core.algorithm import Algorithm
    from yaml.nodes import Node

__all__ = [
    "AlgorithmConfig",
    "Budget",
    "ConfigError",
    "Experiment",
    "MeshLabConfig",
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
MOST = {"pop_size": 5_000, "n_offsprings": 5_000, "ref_dirs": 5_000, "n_neighbors": 5_000, "moves_per_vertex": 1_000}

# Keys of `problem`: how a model is read, what counts, and these arguments of MeshProblem.
LIMITS: dict[str, Kind] = {"max_triangles": Whole(1), "max_error": Real(0), "regions": Whole(1)}
PROBLEM_OPTIONS = (
    *settings_of(Options),
    *(name for name, known in settings_of(Rules).items() if not known.derived),
    "objectives",
    *LIMITS,
)
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
BUDGET_KINDS = ("generations", "evaluations", "seconds")
# Every algorithm is tried out on this model, and on problems that are even smaller.
TRIAL_MODEL = "pyramid:9"
TRIAL_VERTICES = 81
TRIAL_GENERATIONS = 2
# What a trial finds out does not depend on a large population; its time does.
TRIAL_POPULATION = 100
# Settings of an algorithm that do not change what it finds.
WITHOUT_EFFECT = {"output", "display", "callback", "verbose", "termination", "seed", "evaluator"}


class ConfigError(InputError):
    """The configuration cannot be used: one line with the file, the place, the value and what was expected."""


@dataclass(frozen=True, kw_only=True)
class OperatorConfig:
    """An operator: its name in `OPERATORS` or import path, and its arguments."""

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProblemConfig:
    """A model, and how it is simplified.

    Attributes
    ----------
    name : str
        What tables call it.
    source : str
        The file or built-in name, as the configuration has it.
    options : Options
        How it is read.
    rules : Rules
        What counts; their measure is what is minimised beside the triangles.
    limits : dict
        Other arguments of `MeshProblem`; see LIMITS.
    model : OpenModel
        The model, opened; it holds the weights.
    """

    name: str
    source: str
    options: Options
    rules: Rules
    limits: Mapping[str, Any]
    model: OpenModel

    def build(self) -> MeshProblem:
        """Return the problem, evaluated by one thread: an experiment's runs are what is done in parallel."""
        surface = HeightSurface(self.model, replace(self.rules, weights=None))
        return MeshProblem(surface, **self.limits, n_threads=1)

    def description(self) -> dict[str, Any]:
        """Return what decides the results: the model's content, what counts, and the limits."""
        return {"model": self.model.hash, "rules": plain(self.rules), "limits": dict(self.limits)}


@dataclass(frozen=True, kw_only=True, eq=False)
class AlgorithmConfig:
    """An algorithm with its settings.

    Attributes
    ----------
    name : str
        What tables call it.
    preset : str
        A key of `PRESETS`; empty if it is given by import path.
    path : str
        Import path of a pymoo algorithm; empty if it is a preset.
    parameters : dict
        Its arguments.
    operators : dict of str to OperatorConfig
        By kind.
    merged_parameter : str
        An argument that has several values, whose runs are merged to one front; empty if there is none.
    merged_values : tuple
        Its values; (None,) if there is none.
    """

    name: str
    preset: str = ""
    path: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    operators: Mapping[str, OperatorConfig] = field(default_factory=dict)
    merged_parameter: str = ""
    merged_values: tuple[Any, ...] = (None,)

    def build(self, merged_value: Any = None) -> Algorithm:
        """Return the algorithm, made anew.

        pymoo's default operators are objects that all instances share, some with a memory: hence the copy.
        """
        arguments: dict[str, Any] = {key: _argument(key, value) for key, value in self.parameters.items()}
        if self.merged_parameter:
            arguments[self.merged_parameter] = merged_value
        for kind, operator in self.operators.items():
            arguments[ARGUMENT_OF_KIND[kind]] = _class_of(kind, operator.name)(**operator.parameters)
        target = PRESETS[self.preset].function if self.preset else _imported(self.path)
        return copy.deepcopy(target(**arguments))

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


@dataclass(frozen=True, kw_only=True)
class Budget:
    """When a run ends: after the generation that reaches an amount of generations, evaluations or seconds."""

    name: str
    kind: str
    amount: float

    def description(self) -> dict[str, Any]:
        """Return what decides the results."""
        return {self.kind: self.amount}


@dataclass(frozen=True, kw_only=True)
class MeshLabConfig:
    """MeshLab's methods: which, and whether also down to the fewest triangles of the evolutionary fronts."""

    methods: tuple[str, ...]
    down_to_fronts: bool = True
    steps: int = 10


@dataclass(frozen=True, kw_only=True, eq=False)
class Experiment:
    """Everything to be done: problems x algorithms x seeds x budgets, and the classic methods."""

    path: Path
    title: str
    problems: tuple[ProblemConfig, ...]
    algorithms: tuple[AlgorithmConfig, ...]
    seeds: tuple[int, ...]
    budgets: tuple[Budget, ...]
    meshlab: MeshLabConfig | None


def read_experiment_file(path: str | os.PathLike[str], *, folder: str | os.PathLike[str] | None = None) -> Experiment:
    """Read a configuration and make sure that all of it can be done.

    Parameters
    ----------
    path : path
        A YAML file, at most 256 KiB. The models that it names lie in the folder of models or below, and that folder in
        the file's own or below: a file that came from elsewhere reads nothing else.
    folder : path, optional
        Where the model files are, in place of what the file says: any folder.

    Raises
    ------
    ConfigError
        If anything in it is wrong; nothing has been run then but two generations on a tiny model.
    """
    root = _read(Path(path)).mapping(
        ("title", "folder", "problem", "problems", "algorithms", "seeds", "budgets", "baselines"),
        required=("problems", "algorithms", "seeds", "budgets"),
    )
    title = root["title"].text() if "title" in root else Path(path).stem
    # everything that is cheap to check comes before the models, which may take a while
    algorithms = _distinct(root["algorithms"], _algorithm, "algorithm")
    seeds = _seeds(root["seeds"])
    budgets = _distinct(root["budgets"], _budget, "budget")
    meshlab = _baselines(root["baselines"]) if "baselines" in root else None
    shared = _options(root["problem"], PROBLEM_OPTIONS) if "problem" in root else {}
    models = _models_folder(root.get("folder"), Path(path), folder)
    problems = _distinct(root["problems"], lambda entry: _problem(entry, shared, models), "problem")
    for entry, algorithm in zip(root["algorithms"].items(), algorithms, strict=True):
        _try_out(entry, algorithm, problems)
    return Experiment(
        path=Path(path),
        title=title,
        problems=problems,
        algorithms=algorithms,
        seeds=seeds,
        budgets=budgets,
        meshlab=meshlab,
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


# ------------------------------------------------------------------------------------------ the parts of a file


def _algorithm(entry: Entry) -> AlgorithmConfig:
    if entry.is_text():
        entry.choice(PRESETS, "preset")
        config = AlgorithmConfig(name=entry.text(), preset=entry.text())
        _check_build(entry, config)
        return config
    keys = entry.mapping(("name", "preset", "class", "parameters", "operators", "merged_over"))
    if ("preset" in keys) == ("class" in keys):
        entry.fail("give either 'preset' (one of " + ", ".join(PRESETS) + ") or 'class' (an import path)")
    preset = keys["preset"].choice(PRESETS, "preset") if "preset" in keys else ""
    path = keys["class"].text() if "class" in keys else ""
    target = PRESETS[preset].function if preset else _algorithm_class(keys["class"])
    known = _parameters(target)
    name = keys["name"].name() if "name" in keys else preset or path.rpartition(".")[2]

    parameters: dict[str, Any] = {}
    if "parameters" in keys:
        parameters = _arguments(keys["parameters"], target, preset or path)
    operators: dict[str, OperatorConfig] = {}
    if path:
        operators = {
            kind: OperatorConfig(name=default)
            for kind, default in DEFAULT_OPERATORS.items()
            if known is None or ARGUMENT_OF_KIND[kind] in known
        }
    if "operators" in keys:
        for kind, operator in keys["operators"].mapping(OPERATORS).items():
            operators[kind] = _operator(operator, kind)
    merged = ""
    values: tuple[Any, ...] = (None,)
    if "merged_over" in keys:
        merged, values = _merged_over(keys["merged_over"], known, parameters, preset or path)
    config = AlgorithmConfig(
        name=name,
        preset=preset,
        path=path,
        parameters=parameters,
        operators=operators,
        merged_parameter=merged,
        merged_values=values,
    )
    _check_build(entry, config)
    return config


def _operator(entry: Entry, kind: str) -> OperatorConfig:
    if entry.is_text():
        name = entry
        rest: dict[str, Entry] = {}
    else:
        rest = entry.mapping(None)
        if "name" not in rest:
            entry.fail(f"give the operator's 'name', one of {', '.join(OPERATORS[kind])}, or an import path")
        name = rest.pop("name")
    spelled = name.text()
    if "." not in spelled:
        name.choice(OPERATORS[kind], f"{kind} operator")
    else:
        name.try_to(lambda: _imported(spelled))
    target = _class_of(kind, spelled)
    base = _pymoo_class(kind)
    if not (inspect.isclass(target) and issubclass(target, base)):
        name.fail(f"this is no pymoo {kind} operator (a class derived from {base.__module__}.{base.__name__})")
    _check_names(rest, target, spelled)
    parameters = {key: _limited(key, value) for key, value in rest.items()}
    entry.try_to(lambda: target(**parameters), f"the {kind} operator {spelled!r} cannot be made")
    return OperatorConfig(name=spelled, parameters=parameters)


def _merged_over(
    entry: Entry, known: set[str] | None, parameters: Mapping[str, Any], owner: str
) -> tuple[str, tuple[Any, ...]]:
    keys = entry.mapping(None)
    if len(keys) != 1:
        entry.fail(f"has {len(keys)} keys; give one parameter and the list of its values")
    ((name, values),) = keys.items()
    if known is not None and name not in known:
        values.fail(f"{owner} has no parameter {name!r}{_suggestion(name, known)}")
    if name in parameters:
        values.fail(f"{name!r} is in 'parameters' too; give it in one place")
    items = [_limited(name, item) for item in values.items()]
    if not items:
        values.fail("the list is empty; give at least one value")
    for place, item in enumerate(items):
        if item in items[:place]:
            values.items()[place].fail(f"the value {item!r} is there twice")
    return name, tuple(items)


def _arguments(entry: Entry, target: Any, owner: str) -> dict[str, Any]:
    keys = entry.mapping(None)
    operators = {argument: kind for kind, argument in ARGUMENT_OF_KIND.items()}
    for name, value in keys.items():
        if name in operators:
            value.fail(f"operators stand under 'operators', this one as {operators[name]!r}")
    _check_names(keys, target, owner)
    return {name: _limited(name, value) for name, value in keys.items()}


def _limited(name: str, entry: Entry) -> Any:
    """Return a parameter's value, unless it would let a trial take all memory or time."""
    value = entry.plain()
    if name in MOST and isinstance(value, (int, float)) and value > MOST[name]:
        entry.fail(f"expected at most {MOST[name]:,}")
    return value


def _is_many(name: str, value: Any) -> bool:
    return name in MOST and isinstance(value, int) and value > TRIAL_POPULATION


def _check_names(keys: Mapping[str, Entry], target: Any, owner: str) -> None:
    known = _parameters(target)
    for name, value in keys.items():
        if known is not None and name not in known:
            listed = ", ".join(sorted(known)) or "none"
            value.fail(f"{owner} has no such parameter{_suggestion(name, known)}; it takes: {listed}")


def _check_build(entry: Entry, config: AlgorithmConfig) -> None:
    for value in config.merged_values:
        at = f" with {config.merged_parameter} = {value!r}" if config.merged_parameter else ""
        entry.try_to(
            lambda value=value: config.build(value),  # type: ignore[misc]
            f"the algorithm {config.name!r} cannot be made{at}",
        )


def _try_out(entry: Entry, config: AlgorithmConfig, problems: Sequence[ProblemConfig]) -> None:
    """Let an algorithm run on a tiny model, and set it up for every problem, before anything is run."""
    for problem in problems:
        entry.try_to(
            lambda problem=problem: config.build(config.merged_values[0]).setup(  # type: ignore[misc]
                problem.build(), termination=("n_gen", 1), seed=1
            ),
            f"the algorithm {config.name!r} cannot be used on the problem {problem.name!r}",
        )
    few = {key: min(value, TRIAL_POPULATION) for key, value in config.parameters.items() if _is_many(key, value)}
    small = replace(config, parameters={**config.parameters, **few})
    built = [problem.build() for problem in problems]
    wanted = dict.fromkeys((problem.objectives, problem.regions) for problem in built)
    trials = [MeshProblem(TRIAL_MODEL, objectives=names, regions=n, n_threads=1) for names, n in wanted]
    trials += [problem.build() for problem in problems if problem.model.n_vertices < TRIAL_VERTICES]
    for trial in trials:

        def run(trial: MeshProblem = trial) -> None:
            from pymoo.optimize import minimize

            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # about numbers of the trial, not of the user's models
                result = minimize(
                    trial,
                    small.build(config.merged_values[0]),
                    ("n_gen", TRIAL_GENERATIONS),
                    seed=1,
                    copy_algorithm=False,
                )
            if result.opt is not None and result.opt.get("F").shape[1:] != (2,):  # None: nothing feasible yet
                raise ValueError("its result is no front of (error, triangles)")

        entry.try_to(run, f"the algorithm {config.name!r} fails on {trial.model.name!r}, a trial")


def _seeds(entry: Entry) -> tuple[int, ...]:
    items = entry.items()
    if not items:
        entry.fail("the list is empty; give at least one seed, as in [1, 2, 3]")
    seeds = [item.whole(0) for item in items]
    seen: set[int] = set()
    for item, seed in zip(items, seeds, strict=True):
        if seed in seen:
            item.fail(f"the seed {seed} is there twice; a run is not to be counted twice")
        seen.add(seed)
    return tuple(seeds)


def _budget(entry: Entry) -> Budget:
    keys = entry.mapping(("name", *BUDGET_KINDS))
    kinds = [kind for kind in BUDGET_KINDS if kind in keys]
    if len(kinds) != 1:
        entry.fail(f"give one of {', '.join(BUDGET_KINDS)}, not {' and '.join(kinds) or 'none'}")
    kind = kinds[0]
    amount: float = keys[kind].real(0, strict=True) if kind == "seconds" else keys[kind].whole(1)
    name = keys["name"].name() if "name" in keys else f"{amount:g} {kind}"
    return Budget(name=name, kind=kind, amount=amount)


def _baselines(entry: Entry) -> MeshLabConfig | None:
    keys = entry.mapping(("meshlab",))
    if "meshlab" not in keys:
        return None
    meshlab = keys["meshlab"]
    if meshlab.is_bool():
        return MeshLabConfig(methods=tuple(MESHLAB_METHODS)) if meshlab.yes_no() else None
    inner = meshlab.mapping(("methods", "down_to_fronts", "steps"))
    methods = tuple(MESHLAB_METHODS)
    if "methods" in inner:
        items = inner["methods"].items()
        if not items:
            inner["methods"].fail(f"the list is empty; give some of {', '.join(MESHLAB_METHODS)}")
        methods = tuple(item.choice(MESHLAB_METHODS, "MeshLab method") for item in items)
        for place, name in enumerate(methods):
            if name in methods[:place]:
                items[place].fail(f"the method {name!r} is there twice")
    return MeshLabConfig(
        methods=methods,
        down_to_fronts=inner["down_to_fronts"].yes_no() if "down_to_fronts" in inner else True,
        steps=inner["steps"].whole(1) if "steps" in inner else 10,
    )


def _models_folder(entry: Entry | None, path: Path, given: str | os.PathLike[str] | None) -> tuple[Path, Entry | None]:
    if given is not None:
        folder = Path(given)
        if not folder.is_dir():
            raise ConfigError(f"{folder}: no such folder of models; name the one that the files are in")
        return folder, entry
    if entry is None:
        return path.parent, None
    _check_inside(entry, "of the configuration")
    # whether it exists is asked when a model is looked for in it: built-in models need no folder
    return path.parent / entry.text(), entry


def _check_inside(entry: Entry, whose: str) -> None:
    """Refuse a path that leads out of a folder, by any system's rules."""
    text = entry.text()
    if "\0" in text or any(path.anchor or ".." in path.parts for path in (PurePosixPath(text), PureWindowsPath(text))):
        entry.fail(f"leads out of the folder {whose}; name the folder of the models by --models FOLDER instead")
    if max(map(len, PurePosixPath(text).parts), default=0) > MAX_FILE_NAME:
        entry.fail(f"is too long; names of files have at most {MAX_FILE_NAME} characters")


def _problem(entry: Entry, shared: Mapping[str, Any], models: tuple[Path, Entry | None]) -> ProblemConfig:
    if entry.is_text():
        model, name, given = entry, None, dict(shared)
    else:
        keys = entry.mapping(("name", "model", *PROBLEM_OPTIONS), required=("model",))
        model, name = keys["model"], keys.get("name")
        given = dict(shared) | {key: _option(key, value) for key, value in keys.items() if key in PROBLEM_OPTIONS}
    source = model.text()
    where = _model_path(model, source, models)
    problem = entry.try_to(lambda: MeshProblem(where, **given, n_threads=1), plain=True)
    return ProblemConfig(
        name=name.name() if name is not None else Path(source).stem,
        source=source,
        options=problem.options,
        rules=problem.surface.rules,
        limits={key: value for key, value in given.items() if key in LIMITS},
        model=problem.model,
    )


def _model_path(entry: Entry, source: str, models: tuple[Path, Entry | None]) -> str:
    """Return the model's file, relative to the folder of models, or the name of a built-in model."""
    folder, named = models
    path = folder / source
    base = source.partition(":")[0]
    if base in datasets.names() and not is_there(path):
        return source
    _check_inside(entry, "of models")
    if is_there(path):
        return str(path)
    if not Path(base).suffix and "/" not in source and os.sep not in source:
        near = _suggestion(base, datasets.names())
        entry.fail(f"there is neither a file {path} nor a built-in model of that name{near}")
    if not folder.is_dir():
        way_out = "name the folder by --models FOLDER" + (" or by 'folder'" if named is not None else "")
        entry.fail(f"the file is missing, for there is no folder {folder}; {way_out}")
    there = [item.name for item in folder.iterdir()]
    entry.fail(f"there is no file {path}{_suggestion(Path(source).name, there)}")


def _options(entry: Entry, known: Sequence[str]) -> dict[str, Any]:
    return {key: _option(key, value) for key, value in entry.mapping(known).items()}


def _option(key: str, entry: Entry) -> Any:
    """Return an argument of `MeshProblem`, as far as it can be checked without the model."""
    if key == "objectives":
        names = [item.text() for item in entry.items()]
        if len(names) != 2 or names[0] not in OBJECTIVES or names[1] != "triangles":
            several = "; an experiment compares fronts of two objectives, more are for nsga3() in Python"
            entry.fail(f"expected [one of {', '.join(OBJECTIVES)}, triangles]" + (several if len(names) > 2 else ""))
        return names
    known = settings_of(Options) | settings_of(Rules)
    return entry.of(known[key].kind if key in known else LIMITS[key])


def _distinct(entry: Entry, read: Callable[[Entry], Any], what: str) -> tuple[Any, ...]:
    """Read a list of things that must have different names."""
    items = entry.items()
    if not items:
        entry.fail(f"the list is empty; give at least one {what}")
    things: list[Any] = []
    for item in items:
        thing = read(item)
        if any(thing.name == other.name for other in things):
            item.fail(f"the name {thing.name!r} is there twice; give every {what} a 'name' of its own")
        things.append(thing)
    return tuple(things)


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
        raise ValueError(f"{path!r} cannot be imported ({problem})") from None
    except AttributeError:
        near = _suggestion(name, dir(importlib.import_module(module)))
        raise ValueError(f"the module {module} has no {name!r}{near}") from None


def _pymoo_class(kind: str) -> type:
    """Return the class that all of pymoo's operators of a kind derive from."""
    from pymoo.core.crossover import Crossover
    from pymoo.core.duplicate import DuplicateElimination
    from pymoo.core.mutation import Mutation
    from pymoo.core.repair import Repair
    from pymoo.core.sampling import Sampling

    classes = {
        "sampling": Sampling,
        "crossover": Crossover,
        "mutation": Mutation,
        "repair": Repair,
        "duplicates": DuplicateElimination,
    }
    return classes[kind]


def _algorithm_class(entry: Entry) -> Any:
    from pymoo.core.algorithm import Algorithm

    if "." not in entry.text():
        entry.fail("expected an import path such as pymoo.algorithms.moo.spea2.SPEA2")
    found = entry.try_to(lambda: _imported(entry.text()), plain=True)
    if not (inspect.isclass(found) and issubclass(found, Algorithm)):
        entry.fail("this is no pymoo algorithm (a class derived from pymoo.core.algorithm.Algorithm)")
    return found


def _parameters(target: Any) -> set[str] | None:
    """Return the arguments that a function or class takes, those it passes on included; None if unknown."""
    names: set[str] = set()
    if not inspect.isclass(target):
        for parameter in inspect.signature(target).parameters.values():
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD:
                names.add(parameter.name)
        made = typing.get_type_hints(target).get("return")
        return names | (_parameters(made) or set()) - {"ref_dirs"} if inspect.isclass(made) else None
    for parent in target.__mro__:
        if parent is object or "__init__" not in vars(parent):
            continue
        parameters = list(inspect.signature(vars(parent)["__init__"]).parameters.values())[1:]
        variadic = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
        names |= {parameter.name for parameter in parameters if parameter.kind not in variadic}
        if not any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in parameters):
            break
    return names


def _argument(name: str, value: Any) -> Any:
    """Return a parameter as pymoo wants it: ``ref_dirs: n`` means n even directions, lists are arrays."""
    if name != "ref_dirs":
        return value
    if isinstance(value, int):
        from pymoo.util.ref_dirs import get_reference_directions

        return get_reference_directions("uniform", 2, n_partitions=max(1, value - 1))
    return np.asarray(value, dtype=float)


def _suggestion(word: str, known: Iterable[str]) -> str:
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.6)
    return f" (did you mean {by_lower[near[0]]!r}?)" if near else ""


def _sorted(values: Mapping[str, Any]) -> dict[str, Any]:
    return dict(sorted(values.items()))


# ---------------------------------------------------------------------------------------- YAML with its places


class Entry:
    """A value in the file, which knows its place.

    Parameters
    ----------
    node : yaml.nodes.Node
        The value.
    file : Path
        The file, for messages.
    place : str
        Its path in the file, such as ``problems[2].model``.
    """

    def __init__(self, node: Node, file: Path, place: str = "") -> None:
        self.node = node
        self.file = file
        self.place = place

    def fail(self, expected: str) -> NoReturn:
        """Raise the one line that says where, what and what was expected."""
        place = f"{self.place}: " if self.place else ""
        value = f"{self._spelled()}: " if self._spelled() else ""
        raise ConfigError(f"{self._where()}: {place}{value}{expected}")

    def try_to(self, action: Callable[[], Any], what: str = "", *, plain: bool = False) -> Any:
        """Do something that this value is to blame for if it fails."""
        try:
            return action()
        except ConfigError:
            raise
        except MemoryError:
            place = f"{self.place}: " if self.place else ""
            prefix = f"{what}: " if what else ""
            raise ConfigError(f"{self._where()}: {place}{prefix}does not fit into memory; make it smaller") from None
        except Exception as problem:
            reason = " ".join(str(problem).split()) or type(problem).__name__
            if not plain and not isinstance(problem, (ModelError, ValueError)):
                reason = f"{type(problem).__name__}: {reason}"
            place = f"{self.place}: " if self.place else ""
            prefix = f"{what}: " if what else ""
            raise ConfigError(f"{self._where()}: {place}{prefix}{reason}") from problem

    def mapping(self, known: Iterable[str] | None, required: Sequence[str] = ()) -> dict[str, Entry]:
        """Return the entries of a mapping; None allows any key."""
        from yaml.nodes import MappingNode, ScalarNode

        names = None if known is None else list(known)
        if not isinstance(self.node, MappingNode):
            self.fail("expected a mapping" + (f" with the keys {', '.join(names)}" if names else ""))
        found: dict[str, Entry] = {}
        for key, value in self.node.value:
            if not isinstance(key, ScalarNode):
                Entry(key, self.file, self.place).fail("a key must be a word")
            place = f"{self.place}.{key.value}" if self.place else key.value
            if names is not None and key.value not in names:
                raise ConfigError(
                    f"{self.file}, line {key.start_mark.line + 1}: {place}: unknown key"
                    f"{_suggestion(key.value, names)}; known here: {', '.join(names)}"
                )
            if key.value in found:
                raise ConfigError(f"{self.file}, line {key.start_mark.line + 1}: {place}: is there twice")
            found[key.value] = Entry(value, self.file, place)
        for name in required:
            if name not in found:
                self.fail(f"the key {name!r} is missing")
        return found

    def items(self) -> list[Entry]:
        """Return the entries of a list."""
        if not self.is_list():
            self.fail("expected a list")
        return [Entry(node, self.file, f"{self.place}[{index}]") for index, node in enumerate(self.node.value)]

    def is_list(self) -> bool:
        """Return whether this is a list."""
        from yaml.nodes import SequenceNode

        return isinstance(self.node, SequenceNode)

    def is_text(self) -> bool:
        """Return whether this is a text."""
        return self.node.tag == "tag:yaml.org,2002:str"

    def is_bool(self) -> bool:
        """Return whether this is true or false."""
        return self.node.tag == "tag:yaml.org,2002:bool"

    def text(self) -> str:
        """Return a text."""
        if not self.is_text() or not self.node.value.strip():
            self.fail("expected a text" + ("" if self.is_text() else "; put it in quotes if it is one"))
        return str(self.node.value)

    def name(self) -> str:
        """Return a text that can stand in a table."""
        name = self.text().strip()
        if len(name) > MAX_NAME or not name.isprintable():
            self.fail(f"expected a name of at most {MAX_NAME} printable characters")
        return name

    def choice(self, known: Iterable[str], what: str) -> str:
        """Return one of the known texts."""
        names = list(known)
        word = self.text()
        if word not in names:
            self.fail(f"unknown {what}{_suggestion(word, names)}; expected one of {', '.join(names)}")
        return word

    def yes_no(self) -> bool:
        """Return true or false."""
        if not self.is_bool():
            self.fail("expected true or false")
        return bool(self.plain())

    def of(self, kind: Kind) -> Any:
        """Return a value of a kind that settings have."""
        value = self.plain()
        try:
            return kind.from_plain(value)
        except ValueError as problem:
            self.fail(str(problem))

    def whole(self, least: int) -> int:
        """Return a whole number."""
        return int(self.of(Whole(least)))

    def real(self, least: float | None, *, strict: bool = False) -> float:
        """Return a number, at least (or, strictly, more than) a limit."""
        return float(self.of(Real(least, strict)))

    def plain(self) -> Any:
        """Return the value as plain Python data."""
        from yaml.constructor import ConstructorError
        from yaml.nodes import MappingNode

        if self.is_list():
            return [item.plain() for item in self.items()]
        if isinstance(self.node, MappingNode):
            return {name: value.plain() for name, value in self.mapping(None).items()}
        try:
            value = _scalar(self.node)
        except (ConstructorError, ValueError, OverflowError):
            self.fail(f"the tag {self.node.tag!r} is not understood; expected plain data")
        if isinstance(value, float) and not math.isfinite(value):
            self.fail("expected a finite number")
        if value is not None and not isinstance(value, (bool, int, float, str)):
            self.fail(f"a {type(value).__name__} is not understood; put it in quotes if it is a text")
        return value

    def _where(self) -> str:
        return f"{self.file}, line {self.node.start_mark.line + 1}"

    def _spelled(self) -> str:
        from yaml.nodes import ScalarNode

        if not isinstance(self.node, ScalarNode):
            return ""
        value = self.node.value if len(self.node.value) <= 80 else self.node.value[:77] + "..."
        spelled = repr(value) if self.is_text() else value or "nothing"
        try:
            float(value)
        except ValueError:
            return spelled
        # YAML 1.1 reads 1e-3 as a text
        hint = " (a text; write numbers like 1.0e-3)" if self.is_text() and "e" in value.lower() else ""
        return spelled + hint


def _read(path: Path) -> Entry:
    """Parse the file to the tree of its values, or say why it is none."""
    import yaml

    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise ConfigError(f"{path}: has {size:,} bytes; a configuration has at most {MAX_BYTES:,}")
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except OSError as problem:
        raise ConfigError(f"{path}: cannot be read ({reason_of(problem)})") from None
    except UnicodeDecodeError as problem:
        raise ConfigError(f"{path}: is no text in UTF-8 (byte {problem.start})") from None
    try:
        _check_events(yaml.parse(text, Loader=yaml.SafeLoader), path)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as problem:
        mark = problem.problem_mark or problem.context_mark
        line = f", line {mark.line + 1}" if mark is not None else ""
        said = " ".join(str(problem.problem or problem.context).split())
        raise ConfigError(f"{path}{line}: is no YAML: {said}") from None
    except yaml.YAMLError as problem:
        raise ConfigError(f"{path}: is no YAML: {reason_of(problem)}") from None
    except RecursionError:
        raise ConfigError(f"{path}: is nested too deeply for a configuration") from None
    if node is None:
        raise ConfigError(f"{path}: is empty; see the configs folder for examples")
    count = _expanded(node, {}, set(), path)
    if count > MAX_VALUES:
        raise ConfigError(
            f"{path}: stands for {count:,} values once aliases are replaced; a configuration has at most {MAX_VALUES:,}"
        )
    return Entry(node, path)


def _check_events(events: Iterable[Any], path: Path) -> None:
    """Stop reading where a file has more values, or lists and mappings inside each other, than a configuration has."""
    count = depth = 0
    for event in events:
        kind = type(event).__name__
        depth += kind.endswith("StartEvent") - kind.endswith("EndEvent")
        count += not kind.endswith("EndEvent")
        if depth > MAX_DEPTH:
            raise ConfigError(f"{path}, line {event.start_mark.line + 1}: is nested too deeply for a configuration")
        if count > MAX_VALUES:
            raise ConfigError(f"{path}: holds more than {MAX_VALUES:,} values; a configuration has fewer")


def _expanded(node: Node, counts: dict[int, int], open_nodes: set[int], path: Path) -> int:
    """Return how many values a node stands for once aliases are replaced."""
    if id(node) in counts:
        return counts[id(node)]
    if id(node) in open_nodes:
        raise ConfigError(f"{path}, line {node.start_mark.line + 1}: contains itself by an alias")
    open_nodes.add(id(node))
    children: list[Node] = []
    if isinstance(node.value, list):
        for child in node.value:
            children += child if isinstance(child, tuple) else (child,)
    counts[id(node)] = 1 + sum(_expanded(child, counts, open_nodes, path) for child in children)
    open_nodes.discard(id(node))
    return counts[id(node)]


def _scalar(node: Node) -> Any:
    import yaml

    return yaml.SafeLoader("").construct_object(node)
