"""Every algorithm class that pymoo ships, on our problems and with our operators: what runs, and why the others do not.

``python tests/test_pymoo_conformance.py`` prints the table of docs/reference/pymoo.md from what it measures.
A class that pymoo adds fails `test_every_class_of_pymoo_is_in_the_table` until it has a line here.
"""

from __future__ import annotations

import ast
import copy
import importlib
import inspect
import itertools
import pickle
import pkgutil
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pymoo
import pymoo.algorithms
import pymoo.core
import pytest
from counts import SLOW
from numpy.testing import assert_array_equal
from pymoo.core.algorithm import Algorithm
from pymoo.core.evaluator import Evaluator
from pymoo.optimize import minimize
from pymoo.parallelization import StarmapParallelization
from pymoo.util.ref_dirs import get_reference_directions

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.comparison.config import ConfigError, read_experiment_file
from meshsimp_pymoo.search.checkpoint import Checkpoints, NotResumable, read_checkpoint, restore
from meshsimp_pymoo.search.operators import OPERATORS
from meshsimp_pymoo.search.weighted import WeightedSum

# what pymoo divides by 0 within
pytestmark = pytest.mark.filterwarnings(r"ignore::RuntimeWarning:pymoo\..*")

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "pymoo.md"
MODEL, SIZE, GENERATIONS, WEIGHT = "pyramid:5", 12, 3, 0.02
POINTS = [[10.0, 20.0], [40.0, 4.0]]  # (error, triangles), as all points in the space of objectives

MOO, SOO = "pymoo.algorithms.moo", "pymoo.algorithms.soo"

# Classes that find fronts of a MeshProblem, with the arguments that they need, as in a YAML file.
FRONTS: dict[str, dict[str, Any]] = {
    f"{MOO}.age.AGEMOEA": {"pop_size": SIZE},
    f"{MOO}.age2.AGEMOEA2": {"pop_size": SIZE},
    f"{MOO}.ctaea.CTAEA": {"ref_dirs": SIZE},
    f"{MOO}.dnsga2.DNSGA2": {"pop_size": SIZE},
    f"{MOO}.moead.MOEAD": {"ref_dirs": SIZE, "n_neighbors": 5},
    f"{MOO}.moead.ParallelMOEAD": {"ref_dirs": SIZE, "n_neighbors": 5},
    f"{MOO}.nsga2.NSGA2": {"pop_size": SIZE},
    f"{MOO}.nsga3.NSGA3": {"ref_dirs": SIZE},
    f"{MOO}.omni.OmniOptimizer": {"pop_size": SIZE},
    f"{MOO}.pinsga2.PINSGA2": {"pop_size": SIZE},
    f"{MOO}.rnsga2.RNSGA2": {"ref_points": POINTS, "pop_size": SIZE},
    f"{MOO}.rnsga3.RNSGA3": {"ref_points": POINTS, "pop_per_ref_point": 6},
    f"{MOO}.rvea.RVEA": {"ref_dirs": SIZE},
    f"{MOO}.sms.SMSEMOA": {"pop_size": SIZE},
    f"{MOO}.spea2.SPEA2": {"pop_size": SIZE},
    f"{MOO}.unsga3.UNSGA3": {"ref_dirs": SIZE},
    f"{SOO}.nonconvex.random_search.RandomSearch": {"n_points_per_iteration": SIZE},
}
# Classes of one objective: on WeightedSum(problem, w).
SINGLES: dict[str, dict[str, Any]] = {
    f"{SOO}.nonconvex.ga.GA": {"pop_size": SIZE},
    f"{SOO}.nonconvex.ga.BGA": {"pop_size": SIZE},
    f"{SOO}.nonconvex.ga_niching.NicheGA": {"pop_size": SIZE},
}
ALL = FRONTS | SINGLES

REAL = "calculates with real variables"
LINE = "searches along one variable"
BASE = "a base class"
# Why the others cannot search subsets.
OTHERS: dict[str, str] = {
    **{f"{MOO}.{name}": REAL for name in ("cmopso.CMOPSO", "mopso_cd.MOPSO_CD", "nsde.NSDE", "nsder.NSDER")},
    **{f"{MOO}.gde3.{name}": REAL for name in ("GDE3", "GDE3MNN", "GDE32NN", "GDE3PCD")},
    **{f"{SOO}.nonconvex.cmaes.{name}": REAL for name in ("CMAES", "SimpleCMAES", "BIPOPCMAES")},
    **{
        f"{SOO}.nonconvex.{name}": REAL
        for name in (
            *("brkga.BRKGA", "de.DE", "direct.DIRECT", "es.ES", "g3pcx.G3PCX", "isres.ISRES", "nelder.NelderMead"),
            *("nrbo.NRBO", "pattern.PatternSearch", "pso.PSO", "pso_ep.EPPSO", "sres.SRES"),
        )
    },
    **{
        f"{SOO}.univariate.{name}": LINE
        for name in (
            *("exp.ExponentialSearch", "golden.GoldenSectionSearch", "quadr_interp.QuadraticInterpolationSearch"),
            "wolfe.WolfeSearch",
        )
    },
    **{
        f"pymoo.algorithms.base.{name}": BASE
        for name in (
            *("bracket.BracketSearch", "genetic.GeneticAlgorithm", "line.LineSearch", "local.LocalSearch"),
            "meta.MetaAlgorithm2",
        )
    },
    **{f"pymoo.core.algorithm.{name}": BASE for name in ("Algorithm", "LoopwiseAlgorithm")},
    "pymoo.core.mixed.MixedVariableGA": "wants a mapping of variables by name",
    f"{MOO}.kgb.KGB": "needs scikit-learn; not tried",
    f"{SOO}.nonconvex.optuna.Optuna": "needs optuna; not tried",
}


# AGE-MOEA compiles for seconds.
COMPILES = pytest.mark.slow


def shipped() -> Iterator[str]:
    """Yield the algorithm classes of pymoo; of a module that lacks a package those that its source shows."""
    for package in (pymoo.core, pymoo.algorithms):
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    module = importlib.import_module(info.name)
            except Exception:  # optuna's says so by a plain Exception
                source = Path(info.module_finder.path, f"{info.name.rpartition('.')[2]}.py").read_text("utf-8")
                bases = {"Algorithm", *(name.rpartition(".")[2] for name in ALL)}
                for node in ast.walk(ast.parse(source)):
                    if isinstance(node, ast.ClassDef) and bases & {getattr(base, "id", "") for base in node.bases}:
                        yield f"{info.name}.{node.name}"
                continue
            for name, found in vars(module).items():
                if inspect.isclass(found) and issubclass(found, Algorithm) and found.__module__ == info.name:
                    yield f"{info.name}.{name}"


# ------------------------------------------------------------------------------------------------------ one class


def class_of(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def problem_for(path: str) -> Any:
    problem = MeshProblem(MODEL, regions=4, n_threads=1)
    return WeightedSum(problem, WEIGHT) if path in SINGLES else problem


def made(
    path: str, crossover: str = "uniform", mutation: str = "neighbour_shift", sampling: str = "random_subset"
) -> Any:
    """Return an algorithm as Python code makes it, with operators of ours."""
    given = {name: np.array(value) if isinstance(value, list) else value for name, value in ALL[path].items()}
    if "ref_dirs" in given:
        given["ref_dirs"] = get_reference_directions("uniform", 2, n_partitions=given["ref_dirs"] - 1)
    if "random_search" in path:
        return class_of(path)(**given, sampling=OPERATORS["sampling"][sampling]())
    if path.endswith("CTAEA"):
        given["eliminate_duplicates"] = False  # else it waits for ever for as many individuals as there are directions
    evaluator, crossing = Evaluator(), OPERATORS["crossover"][crossover]()
    if crossover == "oax":
        crossing.evaluator = evaluator  # for pymoo's MOEAD, which does not say who is calling
    algorithm = class_of(path)(
        **given,
        sampling=OPERATORS["sampling"][sampling](),
        crossover=crossing,
        mutation=OPERATORS["mutation"][mutation](),
        repair=OPERATORS["repair"]["pinned_corners"](),
        evaluator=evaluator,
    )
    return copy.deepcopy(algorithm)  # as minimize does: pymoo's default operators are shared, SPEA2's with a memory


def state(algorithm: Any) -> tuple[Any, ...]:
    """Return what shows whether two searches are the same, to the bit."""
    people = [algorithm.opt] + ([algorithm.pop] if algorithm.pop is not None else [])
    return (
        *(pop.get(name).tolist() for pop in people for name in ("X", "F")),
        algorithm.evaluator.n_eval,
        algorithm.random_state.bit_generator.state,
    )


def run(path: str, algorithm: Any, **options: Any) -> Any:
    return minimize(problem_for(path), algorithm, ("n_gen", GENERATIONS), seed=1, **options)


def runs_in_python(path: str) -> str:
    result = run(path, made(path))
    assert result.X.dtype == bool
    problem = problem_for(path)
    rows = np.atleast_2d(result.X)
    assert_array_equal(problem.evaluate(rows), np.reshape(result.F, (len(rows), -1)))
    assert np.all(rows >= problem.pinned)
    return "yes"


def configured(path: str, parameters: dict[str, Any], weighted: bool, **operators: Any) -> Any:
    """Return the algorithm of a YAML file, after the file's trial."""
    weight = ", merged_over: {w: [0.1, 0.9]}" if weighted else ""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "study.yaml")
        file.write_text(
            f'problems: [{{model: "{MODEL}", regions: 4}}]\nseeds: [1]\nbudgets: [{{generations: 2}}]\n'
            f"algorithms: [{{class: {path}, parameters: {parameters}, operators: {operators}{weight}}}]\n",
            encoding="utf-8",
        )
        experiment = read_experiment_file(file)
    assert not experiment.not_resumable
    return experiment.algorithms[0]


def runs_in_yaml(path: str) -> str:
    if path.endswith("PINSGA2"):
        with pytest.raises(ConfigError, match="PINSGA2 asks a person between generations"):
            configured(path, ALL[path], weighted=False)
        return "no: asks a person"
    config = configured(path, ALL[path], weighted=path in SINGLES)
    weight = config.merged_values[0]
    algorithm, problem = config.build(weight), config.searched(MeshProblem(MODEL, n_threads=1), weight)
    result = minimize(problem, algorithm, ("n_gen", GENERATIONS), seed=1, copy_algorithm=False)
    assert result.X.dtype == bool
    return "with `w`" if path in SINGLES else "yes"


LOCAL = r"(\w+)[.]\S*<locals>"


def result_pickles(path: str) -> str:
    result = run(path, made(path))
    try:
        again = pickle.loads(pickle.dumps(result))
    except (pickle.PicklingError, AttributeError) as refusal:
        return f"no: a function in pymoo's `{re.findall(LOCAL, str(refusal))[0]}`"
    assert state(again.algorithm) == state(result.algorithm)
    return "yes"


def checkpoint_resumes(path: str) -> str:
    def set_up() -> Any:
        return made(path).setup(problem_for(path), termination=("n_gen", GENERATIONS + 1), seed=1)

    whole, first, second = set_up(), set_up(), set_up()
    finish(whole)
    with tempfile.TemporaryDirectory() as folder:
        keeper = Checkpoints(Path(folder, "c.npz"), first, {})
        while first.n_iter is None or first.n_iter < GENERATIONS:
            first.next()
        try:
            keeper.save()
        except NotResumable as refusal:
            return f"no: {refusal}"
        restore(read_checkpoint(keeper.path), second)
    finish(second)
    assert state(second) == state(whole)
    return "same bytes"


def finish(algorithm: Any) -> None:
    while algorithm.has_next():
        algorithm.next()


MEASURED: dict[str, Callable[[str], str]] = {
    "in Python": runs_in_python,
    "in YAML": runs_in_yaml,
    "result pickles": result_pickles,
    "checkpoint goes on to": checkpoint_resumes,
}


@cache
def row(path: str) -> str:
    """Return the line of the table for a class, as measured."""
    name = path.rpartition(".")[2]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cells = [measure(path) for measure in MEASURED.values()]
    return f"| `{name}` | {'`WeightedSum`' if path in SINGLES else '`MeshProblem`'} | {' | '.join(cells)} |"


def table() -> str:
    """Return what the documentation holds, in Markdown."""
    left_out: dict[str, list[str]] = {}
    for path, reason in sorted(OTHERS.items()):
        left_out.setdefault(reason, []).append(f"`{path.rpartition('.')[2]}`")
    return "\n".join(
        [
            f"| class | on | {' | '.join(MEASURED)} |",
            f"|{'---|' * (2 + len(MEASURED))}",
            *(row(path) for path in ALL),
            "",
            "Not for subsets of vertices:",
            "",
            *(f"* {reason}: {', '.join(names)}." for reason, names in left_out.items()),
        ]
    )


# ---------------------------------------------------------------------------------------------------------- the tests


def test_every_class_of_pymoo_is_in_the_table() -> None:
    known = {*ALL, *OTHERS}
    found = set(shipped())
    new = sorted(found - known)
    assert not new, (
        f"pymoo {pymoo.__version__} has {', '.join(new)}: try it and give it a line in {Path(__file__).name}"
    )
    gone = sorted(known - found)
    assert not gone, f"pymoo {pymoo.__version__} no longer has {', '.join(gone)}: take it out of {Path(__file__).name}"


@pytest.mark.parametrize("path", [pytest.param(path, marks=COMPILES if ".age" in path else []) for path in ALL])
def test_the_page_says_what_is_so(path: str) -> None:
    line = row(path)
    assert line in PAGE.read_text("utf-8").splitlines(), (
        f"{PAGE.name} does not have {line!r}; if that is right, take what this prints: python {Path(__file__).name}"
    )


@pytest.mark.slow
def test_the_page_holds_the_whole_table() -> None:
    assert table() in PAGE.read_text("utf-8")


def test_the_page_names_all_that_is_left_out_with_its_reason() -> None:
    page = PAGE.read_text("utf-8")
    for path, reason in OTHERS.items():
        (line,) = [line for line in page.splitlines() if line.startswith(f"* {reason}: ")]
        assert f"`{path.rpartition('.')[2]}`" in line


REFUSALS = {
    REAL: "with variables as real numbers|not float64|minimises one number|cannot be made|not a valid option",
    LINE: "one variable|line search",
    BASE: "fails on|cannot be made|cannot be used|minimises one number",
}
# Stumbles only when a step along an axis makes an improvement, which the trial of a file need not see.
LATE = f"{SOO}.nonconvex.pattern.PatternSearch"


@pytest.mark.parametrize("path", [path for path, why in OTHERS.items() if why in REFUSALS and path != LATE])
def test_what_is_left_out_is_refused_in_one_line(path: str) -> None:
    parameters = {"ref_dirs": SIZE} if path.endswith("NSDER") else {}
    with pytest.raises(ConfigError, match=REFUSALS[OTHERS[path]]) as refusal:
        configured(path, parameters, weighted=f"{SOO}." in path)
    assert "\n" not in str(refusal.value)


def test_pattern_search_stumbles_over_bool_variables_late() -> None:
    algorithm = class_of(LATE)(sampling=OPERATORS["sampling"]["random_subset"]())
    with pytest.raises(TypeError, match="numpy boolean subtract"):
        minimize(WeightedSum(MeshProblem(MODEL), 0.5), algorithm, ("n_gen", 9), seed=1)


# Combinations of what is ours with all that finds fronts; plain runs try every twentieth.
COMBINATIONS = [
    pytest.param(*parts, marks=[] if place % SLOW == 0 and ".age" not in parts[0] else [pytest.mark.slow])
    for place, parts in enumerate(
        itertools.product(ALL, OPERATORS["crossover"], OPERATORS["mutation"], OPERATORS["sampling"])
    )
    if "random_search" not in parts[0]
]


@pytest.mark.parametrize(("path", "crossover", "mutation", "sampling"), COMBINATIONS)
def test_all_operators_go_together_in_every_class(path: str, crossover: str, mutation: str, sampling: str) -> None:
    result = run(path, made(path, crossover, mutation, sampling))
    problem = problem_for(path)
    rows = np.atleast_2d(result.X)
    assert rows.dtype == bool
    assert_array_equal(problem.evaluate(rows), np.reshape(result.F, (len(rows), -1)))


def starmap(path: str) -> Any:
    with ThreadPoolExecutor(2) as pool:
        runner = StarmapParallelization(lambda function, rows: list(pool.map(lambda row: function(*row), rows)))
        problem = MeshProblem(MODEL, regions=4, elementwise_runner=runner)
        searched = WeightedSum(problem, WEIGHT) if path in SINGLES else problem
        return minimize(searched, made(path), ("n_gen", GENERATIONS), seed=1).algorithm


def threads(path: str) -> Any:
    problem = MeshProblem(MODEL, regions=4, n_threads=2)
    searched = WeightedSum(problem, WEIGHT) if path in SINGLES else problem
    return minimize(searched, made(path), ("n_gen", GENERATIONS), seed=1).algorithm


def ask_and_tell(path: str) -> Any:
    algorithm = made(path).setup(problem_for(path), termination=("n_gen", GENERATIONS), seed=1)
    while algorithm.has_next():
        asked = algorithm.ask()
        algorithm.evaluator.eval(algorithm.problem, asked, algorithm=algorithm)
        algorithm.tell(infills=asked)
    return algorithm


def copied_halfway(path: str) -> Any:
    algorithm = made(path).setup(problem_for(path), termination=("n_gen", GENERATIONS), seed=1)
    while algorithm.n_iter is None or algorithm.n_iter < 2:
        algorithm.next()
    algorithm = copy.deepcopy(algorithm)
    finish(algorithm)
    return algorithm


def with_history(path: str) -> Any:
    result = run(path, made(path), save_history=True)
    assert len(result.history) == GENERATIONS
    return result.algorithm


def in_place(path: str) -> Any:
    return run(path, made(path), copy_algorithm=False).algorithm


# DNSGA2 asks for nothing: it evaluates by itself where others would be told.
UNASKED = (ask_and_tell.__name__, f"{MOO}.dnsga2.DNSGA2")
WAYS = {way.__name__: way for way in (threads, starmap, ask_and_tell, copied_halfway, with_history, in_place)}


@pytest.mark.parametrize(
    ("way", "path"),
    [
        pytest.param(way, path, marks=[] if place % 5 == 0 and ".age" not in path else [pytest.mark.slow])
        for place, (way, path) in enumerate(itertools.product(WAYS, ALL))
        if (way, path) != UNASKED
    ],
)
def test_however_it_is_run_it_finds_the_same(way: str, path: str) -> None:
    assert state(WAYS[way](path)) == state(run(path, made(path)).algorithm)


if __name__ == "__main__":
    print(table())  # noqa: T201
