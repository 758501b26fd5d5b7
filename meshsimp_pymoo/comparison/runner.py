"""From a configuration to finished runs: what is missing is done, what is there is left alone.

A *task* is one algorithm on one problem with one seed (and, for an algorithm whose runs are merged, one value
of the merged parameter). It makes one *run* for each budget. The runs of a preset are moments of one search:
the first 25 generations of a search of 50 are a search of 25. An algorithm given by import path may look at
its budget (some adapt to the share of it that is left), so there each budget is a search of its own; and so
is every budget in seconds or moves. A budget that does not measure an algorithm's work (evaluations, of `memetic`)
is left out for it, with a line.

Each run is written as soon as it is finished, by the process that made it (see `meshsimp_pymoo.comparison.store`), so
that nothing depends on this process living on. While a search goes on, its state is saved every minute or so (see
`meshsimp_pymoo.search.checkpoint`): one that was killed goes on from there, to the same bytes. Results depend on
neither the number of processes nor the order of the runs, except under a budget in seconds.

The baselines follow once the searches are done, for their smallest sizes are those of the searched fronts; they are
done and stored likewise, except that they stay on this machine.

Arrays of an evolutionary run: see `meshsimp_pymoo.comparison.store.StoredRun`. Arrays of a baseline on a model:
``asked`` (R,), the numbers of triangles asked for; ``F``, ``vertices``, ``mean_error``, ... of the meshes obtained (all
0 and the error infinite where there is none); ``paper`` (R,) bool, whether it belongs to the paper's series of
reductions; and the meshes, one after the other: ``mesh_vertices`` and ``mesh_faces``, with ``vertex_start`` and
``face_start`` (R + 1,). A whole front has ``kept`` (R, ceil(N / 8)) in their place, and below the rows of what was
asked for those of other sizes, for which ``asked`` is 0.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
import traceback
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.arrays import BoolArray
from meshsimp_pymoo.comparison.baselines import (
    BASELINES,
    baseline_front,
    baseline_meshes,
    chosen_rows,
    reductions,
    size_note,
)
from meshsimp_pymoo.comparison.config import (
    AlgorithmConfig,
    Budget,
    Experiment,
    ProblemConfig,
    line_of,
    read_experiment_file,
)
from meshsimp_pymoo.comparison.store import (
    FORMAT,
    RunStore,
    as_begun,
    claim_experiment,
    fingerprint,
    write_experiment,
    write_model,
    write_run,
)
from meshsimp_pymoo.comparison.trace import Trace
from meshsimp_pymoo.errors import ExperimentWarning, ResultError, ToolUnavailable, reason_of
from meshsimp_pymoo.files import locked
from meshsimp_pymoo.formats.table import listed
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.indicators import non_dominated
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.search.budgets import Moves, moves_of
from meshsimp_pymoo.search.checkpoint import (
    INTERVAL,
    CheckpointError,
    Checkpoints,
    NotResumable,
    Stored,
    difference,
    read_checkpoint,
    restore,
)
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.settings import plain
from meshsimp_pymoo.storage import machine, now, package_versions
from meshsimp_pymoo.surface.kinds import surface_of
from meshsimp_pymoo.surface.measures import COUNTED, MEASURES, OF_LINES, TRIANGLES, Quality, measured
from meshsimp_pymoo.surface.surface import measured_meshes
from meshsimp_pymoo.surface.units import length_unit, reference_system
from meshsimp_pymoo.workers import Engine, EngineError, Processes, Serial

__all__ = ["Done", "Task", "perform", "plan", "run_experiment"]

# Called with (work done, all work, what is being done); work is in evaluations of one vertex.
Progress = Callable[[float, float, str], None]

# An evaluation of a mesh with N vertices costs about as much as this many vertices beside its N.
OVERHEAD_VERTICES = 600
# What a second of budget counts as, in the same unit; roughly what a core does.
WORK_PER_SECOND = 1e7
# A move of the annealing takes 1.5 microseconds; and what is done besides, about so many evaluations an individual.
WORK_PER_MOVE = 15.0
BESIDE_MOVES = 7.0
# Work of a baseline on a model, in evaluations.
BASELINE_EVALUATIONS = 2000

# The folder, inside the experiment's, of the state of searches that are not finished.
CHECKPOINTS = ".checkpoints"
# The file, in the experiment's folder, of the tracebacks of runs that failed in the last call.
FAILED = "failed.txt"

# What is stored of each solution beside F. Break lines are the same in all meshes of a problem.
QUALITY_COLUMNS = tuple(name for name in MEASURES if name not in ("error", "triangles", *OF_LINES))


@dataclass(frozen=True)
class Task:
    """A search, and the runs that are to be taken from it.

    Attributes
    ----------
    problem : str
        Name of the problem.
    algorithm : AlgorithmConfig
        How it is searched.
    merged_value : object
        Value of the merged parameter; None if there is none.
    seed : int
        Seed of the search.
    budgets : tuple of Budget
        The moments at which runs are taken.
    descriptions : tuple of dict
        What each of these runs is.
    work : float
        How much there is to do.
    """

    problem: str
    algorithm: AlgorithmConfig
    merged_value: Any
    seed: int
    budgets: tuple[Budget, ...]
    descriptions: tuple[Mapping[str, Any], ...]
    work: float

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of its runs."""
        return tuple(fingerprint(description) for description in self.descriptions)

    @property
    def label(self) -> str:
        """What people call it."""
        return f"{self.problem} / {self.algorithm.name}{self._value(' / ')} / seed {self.seed}"

    @property
    def sentence(self) -> str:
        """The same in a sentence."""
        return f"the run {self.algorithm.name!r} on {self.problem}{self._value(', ')}, seed {self.seed}"

    def _value(self, separator: str) -> str:
        merged = self.algorithm.merged_parameter
        return f"{separator}{merged}={self.merged_value}" if merged else ""

    @property
    def search(self) -> dict[str, Any]:
        """What the search is; the same, whichever of its runs are finished."""
        description: dict[str, Any] = dict(self.descriptions[0])
        if _is_moment(self.algorithm, self.budgets[0]):
            del description["budget"]
        return description

    def without(self, finished: Collection[str]) -> Task:
        """Return the task without runs that are finished, and with each of the others once."""
        keys = self.keys
        left = [k for k, key in enumerate(keys) if key not in finished and key not in keys[:k]]
        return replace(
            self,
            budgets=tuple(self.budgets[k] for k in left),
            descriptions=tuple(self.descriptions[k] for k in left),
        )


@dataclass(frozen=True)
class Done:
    """What a call of `run_experiment` did.

    Attributes
    ----------
    out : Path
        The experiment's folder.
    finished : int
        Runs that were computed now.
    reused : int
        Runs that were there already.
    skipped : tuple of str
        What was left out, and why: budgets that do not fit an algorithm, and what this machine cannot do.
    """

    out: Path
    finished: int
    reused: int
    skipped: tuple[str, ...] = ()


def run_experiment(
    config: str | os.PathLike[str] | Experiment,
    out: str | os.PathLike[str],
    *,
    jobs: int = 1,
    engine: Engine | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    checkpoint: float | None = INTERVAL,
) -> Done:
    """Do all runs of an experiment that are not finished yet.

    Parameters
    ----------
    config : path or Experiment
        What to do.
    out : path
        A new folder, or that of an earlier, perhaps interrupted call. Runs that are found there and that are
        asked for now are not done again; others are named, left there, and not used.
    jobs : int
        Number of processes. With 1, everything is done in this one. They are started anew, so in a script
        the call has to stand under ``if __name__ == "__main__":``.
    engine : Engine, optional
        Where the searches are done, in place of ``jobs``: on a Dask cluster, say. The baselines and the writing are
        always done here.
    folder : path, optional
        Where the model files are, in place of what the configuration says.
    progress : callable, optional
        Told about the progress.
    checkpoint : float or None
        Seconds between two savings of the state of each search; None: it is not saved. A search that is done out of
        reach of this folder (on a cluster), or whose algorithm holds what cannot be saved, begins anew after a crash.

    Returns
    -------
    Done
        What was done.

    Raises
    ------
    ConfigError
        If anything in the configuration is wrong; nothing has been run or written then.
    ResultError
        If the folder cannot be used, or a process died; or if an algorithm or operator raised an exception, once all
        other runs are done.
    """
    if jobs < 1:
        raise ValueError(f"jobs is {jobs}; it must be 1 or more")
    experiment = config if isinstance(config, Experiment) else read_experiment_file(config, folder=folder)
    out = claim_experiment(out)
    with locked(out, inside=True):
        store = RunStore(out)
        store.clean()
        begun = [replace(problem, model=as_begun(out, problem.model)) for problem in experiment.problems]
        experiment = replace(experiment, problems=tuple(begun))
        tasks = plan(experiment)
        finished = _finished(tasks, store)
        content = _content(experiment, tasks, out)
        left_out = _left_out(experiment)
        write_experiment(out, content | {"classic": [], "skipped": left_out})
        missing = _missing(tasks, finished)
        n_baselines = len(experiment.problems) * len(experiment.baselines.methods if experiment.baselines else ())
        shown = _Shown(progress, sum(task.work for task in missing) + _baseline_work(experiment))
        at_once = min(jobs, max(len(missing), n_baselines))
        own = Serial() if at_once < 2 else Processes(at_once)
        problems = {problem.name: problem for problem in experiment.problems}
        shared = _Shared(problems, store.folder, checkpoint, experiment.not_resumable, (engine or own).jobs)
        with own:
            if failed := _perform_all(missing, store, engine or own, shown, shared):
                raise _failed(failed, len(missing), out)
            with contextlib.suppress(OSError):
                shutil.rmtree(out / CHECKPOINTS)
            rows, not_here, computed = _baselines(experiment, tasks, store, own, shown, shared)
        skipped = (*left_out, *not_here)
        write_experiment(out, content | {"classic": rows, "skipped": list(skipped)})
        asked = {key for task in tasks for key in task.keys} | {row["key"] for row in rows}
        _name_stale(store, asked)
        for line in skipped:
            warnings.warn(line, ExperimentWarning, stacklevel=2)
    n_runs = sum(len(task.budgets) for task in missing)
    return Done(out, n_runs + computed, len(finished) + len(rows) - computed, skipped)


def plan(experiment: Experiment) -> list[Task]:
    """Return all tasks of an experiment, in the order of the configuration; same results, whatever the order."""
    tasks = []
    described = {
        (algorithm.name, value): algorithm.description(value)
        for algorithm in experiment.algorithms
        for value in algorithm.merged_values
    }
    for problem in experiment.problems:
        what = problem.description()
        for seed in experiment.seeds:
            for algorithm in experiment.algorithms:
                for value in algorithm.merged_values:
                    for budgets in _moments(algorithm, experiment.budgets):
                        descriptions = tuple(
                            {
                                "problem": what,
                                "algorithm": described[algorithm.name, value],
                                "seed": seed,
                                "budget": {budget.kind: budget.amount},
                            }
                            for budget in budgets
                        )
                        work = _work(problem, algorithm, budgets)
                        tasks.append(Task(problem.name, algorithm, value, seed, budgets, descriptions, work))
    return tasks


def perform(
    task: Task,
    problem: MeshProblem,
    *,
    checkpoint: Path | None = None,
    interval: float = INTERVAL,
    jobs: int = 1,
) -> Iterator[tuple[int, dict[str, npt.NDArray[Any]], dict[str, Any]]]:
    """Search, and yield each run of a task when its budget is reached.

    Parameters
    ----------
    task : Task
        What to do.
    problem : MeshProblem
        What is searched.
    checkpoint : Path, optional
        File for the state of the search. If there is one, the search goes on from there; it is removed at the end.
    interval : float
        Seconds between two savings.
    jobs : int
        How many searches go on at once, for the record.

    Yields
    ------
    (int, dict, dict)
        Index of the budget, the run's arrays, and facts about it.
    """
    from pymoo.core.termination import NoTermination
    from pymoo.termination.max_eval import MaximumFunctionCallTermination
    from pymoo.termination.max_gen import MaximumGenerationTermination
    from pymoo.termination.max_time import TimeBasedTermination

    def set_up() -> Any:
        termination: Any = NoTermination()
        if len(task.budgets) == 1:
            budget = task.budgets[0]
            terminations = {
                "generations": MaximumGenerationTermination,
                "evaluations": MaximumFunctionCallTermination,
                "moves": Moves,
                "seconds": TimeBasedTermination,
            }
            termination = terminations[budget.kind](budget.amount)
        searched = task.algorithm.searched(problem, task.merged_value)
        return task.algorithm.build(task.merged_value).setup(searched, termination=termination, seed=task.seed)

    start, begun, cpu_seconds = time.perf_counter(), now(), 0.0
    algorithm, stored = set_up(), None if checkpoint is None else _usable_checkpoint(task, checkpoint)
    trace = Trace()
    if stored is not None:
        try:
            restore(stored, algorithm)
            start -= float(stored.facts["seconds"])
            trace = Trace.from_plain(stored.facts["trace"])
            begun, cpu_seconds = stored.facts["begun"], stored.facts["cpu_seconds"]
        except CheckpointError as damage:
            warnings.warn(f"{damage}; its search begins anew", ExperimentWarning, stacklevel=2)
            algorithm = set_up()
    keeper = None
    if checkpoint is not None:
        try:
            keeper = Checkpoints(checkpoint, algorithm, _search_and_versions(task), interval=interval)
        except NotResumable as trouble:
            warnings.warn(f"{trouble}; the search goes on without it", ExperimentWarning, stacklevel=2)
    left = list(range(len(task.budgets)))
    set_aside = 0.0  # seconds spent on runs already yielded, on the trace and on checkpoints
    while left:
        ended = not algorithm.has_next()
        if not ended:
            before, cpu_before = algorithm.n_iter, time.process_time()
            algorithm.next()
            cpu_seconds += time.process_time() - cpu_before
            if algorithm.n_iter == before:  # in the middle of a generation
                continue
            ended = not algorithm.has_next()
        seconds = time.perf_counter() - start - set_aside
        generations, evaluations = int(algorithm.n_iter) - 1, int(algorithm.evaluator.n_eval)
        moves = moves_of(algorithm)
        reached = {"generations": generations, "evaluations": evaluations, "moves": moves or 0, "seconds": seconds}
        trace.keep(algorithm, generations, seconds)
        for k in list(left):
            if ended or reached[task.budgets[k].kind] >= task.budgets[k].amount:
                until_now = trace.until(algorithm, generations, seconds)
                facts = {
                    "problem": task.problem,
                    "algorithm": task.algorithm.name,
                    "seed": task.seed,
                    "budget": task.budgets[k].name,
                    "generations": generations,
                    "evaluations": evaluations,
                    "moves": moves,
                    "seconds": round(seconds, 4),
                    "cpu_seconds": round(cpu_seconds, 4),
                    "trace_seconds": until_now.seconds,
                    "begun": begun,
                    "versions": package_versions(),
                    "environment": machine() | {"jobs": jobs},
                }
                arrays = _front_arrays(problem, algorithm.opt) | _free_arrays(problem, algorithm.opt)
                yield k, arrays | until_now.arrays, facts
                left.remove(k)
        if left and keeper is not None and keeper.due():
            try:
                keeper.save(**reached, begun=begun, cpu_seconds=cpu_seconds, trace=trace.plain)
            except (CheckpointError, NotResumable) as trouble:
                warnings.warn(f"{trouble}; the search goes on without it", ExperimentWarning, stacklevel=2)
                keeper = None
        so_far = time.perf_counter() - start - seconds
        algorithm.start_time += so_far - set_aside  # a budget in seconds looks at the algorithm's own clock
        set_aside = so_far
    if checkpoint is not None:
        with contextlib.suppress(OSError):
            checkpoint.unlink(missing_ok=True)


def _search_and_versions(task: Task) -> dict[str, Any]:
    """Return what a checkpoint of a task belongs to."""
    versions = package_versions()
    return {name: versions.get(name) for name in ("meshsimp-pymoo", "pymoo", "numpy")} | {
        "search": fingerprint(task.search),
        "format": FORMAT,
    }


def _checkpoint_of(task: Task, folder: Path) -> Path:
    return folder / CHECKPOINTS / f"{fingerprint(task.search)}.npz"


def _usable_checkpoint(task: Task, path: Path) -> Stored | None:
    """Return a task's checkpoint; None if there is none, or it is past a run that is missing; name a damaged one."""
    if not path.exists():
        return None
    try:
        stored = read_checkpoint(path)
        if other := difference(stored.what, _search_and_versions(task)):
            raise CheckpointError(f"{path}: belongs to another search ({other})")
        if any(stored.facts[budget.kind] >= budget.amount for budget in task.budgets):
            return None
    except (CheckpointError, KeyError, TypeError) as damage:
        warnings.warn(f"{damage}; its search begins anew", ExperimentWarning, stacklevel=3)
        with contextlib.suppress(OSError):
            path.unlink()
        return None
    return stored


def _front_arrays(problem: MeshProblem, optimum: Any) -> dict[str, npt.NDArray[Any]]:
    """Return the front of a population, sorted by triangles: subsets that are meshes and feasible."""
    kept = np.zeros((0, problem.n_var), dtype=bool)
    if optimum is not None and len(optimum):
        feasible = optimum.get("feas").ravel().astype(bool)
        kept = np.asarray(optimum.get("X"), dtype=bool).reshape(len(optimum), -1)[feasible] | problem.pinned
    arrays = _subset_arrays(problem, kept)
    F = arrays["F"]
    rows = np.flatnonzero(F[:, 1] > 0)  # is a mesh
    if len(rows):
        _, first = np.unique(F[rows, ::-1], axis=0, return_index=True)
        best = {tuple(row) for row in non_dominated(F[rows[first]]).tolist()}
        rows = np.array([row for row in rows[first] if tuple(F[row].tolist()) in best])
    return {name: values[rows] for name, values in arrays.items()}


def _free_arrays(problem: MeshProblem, optimum: Any) -> dict[str, npt.NDArray[Any]]:
    """Return the free meshes of the front of a population; nothing where it has none."""
    if optimum is None or not any(mesh is not None for mesh in optimum.get("free", to_numpy=False)):
        return {}
    try:
        found = Front.from_population(problem, optimum)
    except LookupError:  # nothing of it is feasible
        return {}
    faces, measure = [own for own in found.faces if own is not None], problem.objectives[0]
    if not faces:
        return {}
    quality = [solution.quality for solution in found if solution.free]
    return {
        "free_F": np.array([[getattr(q, measure), q.triangles] for q in quality], dtype=np.float64),
        "free_faces": np.concatenate(faces),
        "free_face_start": np.cumsum([0, *map(len, faces)]),
    }


def _subset_arrays(problem: MeshProblem, kept: BoolArray) -> dict[str, npt.NDArray[Any]]:
    """Return what is stored of subsets (S, N)."""
    surface = problem.surface
    measure, total = surface.rules.measure, surface.total_weight
    table = problem.evaluate_subsets(kept) if len(kept) else np.zeros((0, 6))
    F = np.column_stack([measured(table, measure, total), table[:, TRIANGLES]])
    quality = measured_meshes(surface, kept, [problem.as_quality(row) for row in table], n_threads=1)
    nearest = F[:, 0]
    if surface.rules.spares_uncovered and len(kept):
        charged = surface_of(problem.model, replace(surface.rules, outside="nearest"))
        nearest = measured(charged.evaluate(kept), measure, total)
    return {
        "F": F,
        "kept": np.packbits(kept, axis=1),
        "error_nearest": nearest,
        **_quality_arrays(quality),
    }


def _quality_arrays(quality: Sequence[Quality]) -> dict[str, npt.NDArray[Any]]:
    return {
        name: np.array([getattr(q, name) for q in quality], dtype=np.int64 if name in COUNTED else np.float64)
        for name in QUALITY_COLUMNS
    }


def _moments(algorithm: AlgorithmConfig, budgets: Sequence[Budget]) -> list[tuple[Budget, ...]]:
    """Return the budgets that fit, together where one search can serve them."""
    fitting = [b.of_each(len(algorithm.merged_values)) for b in budgets if b.kind in algorithm.measured_by]
    together = tuple(b for b in fitting if _is_moment(algorithm, b))
    alone = [(b,) for b in fitting if b not in together]
    return ([together] if together else []) + alone


def _is_moment(algorithm: AlgorithmConfig, budget: Budget) -> bool:
    """Tell whether a budget is a moment of one search for all of them: of one that does not look at its budget."""
    return bool(algorithm.preset) and budget.kind in ("generations", "evaluations")


def _left_out(experiment: Experiment) -> list[str]:
    """Return a line for each algorithm that some budgets do not fit."""
    lines = []
    for algorithm in experiment.algorithms:
        names = [budget.name for budget in experiment.budgets if budget.kind not in algorithm.measured_by]
        if names:
            kinds = listed(algorithm.measured_by, "or")
            lines.append(f"skipped: {algorithm.name} under {listed(names)}: its work is measured by {kinds}")
    return lines


def _missing(tasks: Sequence[Task], finished: Collection[str]) -> list[Task]:
    """Return what is left to do, each run once: two budgets may come to the same."""
    known, missing = set(finished), []
    for task in tasks:
        left = task.without(known)
        if left.budgets:
            missing.append(left)
            known.update(left.keys)
    return missing


def _work(problem: ProblemConfig, algorithm: AlgorithmConfig, budgets: Sequence[Budget]) -> float:
    """Return about how much work a task is, to tell the time left."""
    population = int(algorithm.parameters.get("pop_size", 100))
    evaluations = 0.0
    for budget in budgets:
        if budget.kind == "seconds":
            return WORK_PER_SECOND * budget.amount
        if budget.kind == "moves":
            beside = BESIDE_MOVES * population * (problem.model.n_vertices + OVERHEAD_VERTICES)
            return WORK_PER_MOVE * budget.amount + beside
        one = budget.amount * population if budget.kind == "generations" else budget.amount
        if budget.kind == "generations" and algorithm.preset:
            one *= PRESETS[algorithm.preset].evaluations
        evaluations = max(evaluations, one)
    return evaluations * (problem.model.n_vertices + OVERHEAD_VERTICES)


def _finished(tasks: Sequence[Task], store: RunStore) -> set[str]:
    """Return the keys of the runs that are there and whole; name those that are not."""
    stored = store.paths
    finished = {key for task in tasks for key in task.keys if key in stored and store.get(key) is not None}
    for line in store.damaged:
        warnings.warn(f"{line}; it is computed again", ExperimentWarning, stacklevel=3)
    store.damaged.clear()
    return finished


def _content(experiment: Experiment, tasks: Sequence[Task], out: Path) -> dict[str, Any]:
    """Return the resolved configuration, and store the models."""
    return {
        "title": experiment.title,
        "config": experiment.path.name,
        "problems": [
            {
                "name": problem.name,
                "source": problem.source,
                "options": plain(problem.options),
                "rules": plain(problem.rules),
                "limits": dict(problem.limits),
                "stored": write_model(out, problem.model),
                "hash": problem.model.hash,
                "vertices": problem.model.n_vertices,
                "triangles": len(problem.model.faces),
                "unit": length_unit(problem.model.georeference),
                "system": reference_system(problem.model.georeference),
            }
            for problem in experiment.problems
        ],
        "algorithms": [
            {
                "name": algorithm.name,
                "preset": algorithm.preset,
                "class": algorithm.path,
                "merged_parameter": algorithm.merged_parameter,
                "merged_values": list(algorithm.merged_values),
                "description": algorithm.description(algorithm.merged_values[0]),
            }
            for algorithm in experiment.algorithms
        ],
        "seeds": list(experiment.seeds),
        "budgets": [
            {"name": budget.name, budget.kind: budget.amount} | ({"shared": True} if budget.shared else {})
            for budget in experiment.budgets
        ],
        "baselines": experiment.baselines and dict(experiment.baselines),
        "runs": [
            {
                "key": key,
                "problem": task.problem,
                "algorithm": task.algorithm.name,
                "merged_value": task.merged_value,
                "seed": task.seed,
                "budget": budget.name,
            }
            for task in tasks
            for budget, key in zip(task.budgets, task.keys, strict=True)
        ],
    }


def _name_stale(store: RunStore, asked: set[str]) -> None:
    stale = [path for key, path in sorted(store.paths.items()) if key not in asked]
    if stale:
        others = f" and {len(stale) - 1} more" if len(stale) > 1 else ""
        warnings.warn(
            f"{stale[0]}{others}: not asked for by this configuration; left there and not used",
            ExperimentWarning,
            stacklevel=3,
        )


class _Shown:
    """How far the work is."""

    def __init__(self, progress: Progress | None, total: float) -> None:
        self.progress = progress
        self.total = total
        self.done = 0.0

    def add(self, work: float, text: str) -> None:
        self.done += work
        if self.progress is not None:
            self.progress(self.done, self.total, text)


# ----------------------------------------------------------------------------------------- doing it, in processes


@dataclass(frozen=True, eq=False)
class _Shared:
    """What every worker has to know: the problems, and where runs are written (None: not there)."""

    problems: Mapping[str, ProblemConfig]
    folder: Path | None
    checkpoint: float | None
    not_resumable: Mapping[str, str]  # algorithms whose state cannot be saved, and why
    jobs: int  # how many at once


@dataclass(frozen=True)
class _Failure:
    """What an algorithm or operator raised: texts, for an exception of a reader's may not survive the way here."""

    run: str
    reason: str
    traceback: str


def _perform_all(
    tasks: Sequence[Task], store: RunStore, engine: Engine, shown: _Shown, shared: _Shared
) -> list[_Failure]:
    """Do all tasks; return those that failed, by their places. They are said and stored at once: it may take hours."""
    log = store.folder.parent / FAILED
    log.unlink(missing_ok=True)
    failed: dict[int, _Failure] = {}
    if not engine.shares_files:
        shared = replace(shared, folder=None)
    if shared.folder is not None and shared.checkpoint is not None:
        to_do = {task.algorithm.name for task in tasks}
        reasons = {name: reason for name, reason in shared.not_resumable.items() if name in to_do}
        if reasons:
            one = len(reasons) == 1
            whose = "a search that is" if one else "searches that are"
            line = f"{listed(list(reasons))}: {whose} cut off {'begins' if one else 'begin'} anew, for "
            line += f"{'its' if one else 'their'} state cannot be saved: {'; '.join(dict.fromkeys(reasons.values()))}"
            warnings.warn(line, ExperimentWarning, stacklevel=3)
        for task in tasks:  # damage is named here, not by the processes
            _usable_checkpoint(task, _checkpoint_of(task, store.folder.parent))
    if shown.progress is not None:
        shown.progress(0.0, shown.total, "")
    # big ones first, so that all workers end together
    tasks = list(tasks) if engine.jobs == 1 else sorted(tasks, key=lambda task: -task.work)
    try:
        for place, finished in engine.each(_work_on, tasks, shared):
            if isinstance(finished[-1], _Failure):
                failure = failed[place] = finished.pop()
                with log.open("a", encoding="utf-8") as file:
                    file.write(f"{failure.run}\n\n{failure.traceback}\n")
                if len(failed) == 1 and len(tasks) > 1:
                    line = f"{failure.run}, failed: {failure.reason}; the other runs are done first"
                    warnings.warn(line, ExperimentWarning, stacklevel=3)
            for run in finished:
                store.add(run if isinstance(run, Path) else write_run(store.folder, *run))
            shown.add(tasks[place].work, tasks[place].label)
    except EngineError as problem:
        raise _interrupted(store, problem) from None
    return [failed[place] for place in sorted(failed)]


def _failed(failed: Sequence[_Failure], n_tasks: int, out: Path) -> ResultError:
    others = f", as did {len(failed) - 1} more of {n_tasks}" if len(failed) > 1 else ""
    return ResultError(
        f"{failed[0].run}, failed{others}: {failed[0].reason}; finished runs are kept in {out}: mend it and give the "
        f"same command (traceback: {out / FAILED})"
    )


def _interrupted(store: RunStore, problem: EngineError) -> ResultError:
    return ResultError(f"{store.folder}: {problem}; what is finished is stored, the same command does the rest")


def _work_on(task: Task, shared: _Shared) -> list[Any]:
    """Do a task; return the records of its runs, or, where the folder is out of reach, all that is to be written.

    Where its algorithm raises an exception, that is the last item.
    """
    done: list[Any] = []
    runs = _performed(task, shared)
    while True:
        try:
            k, arrays, facts = next(runs)
        except StopIteration:
            return done
        except MemoryError:
            raise
        except Exception as problem:
            reason = f"{type(problem).__name__}: {reason_of(problem)}{line_of(problem)}"
            return [*done, _Failure(task.sentence, reason, traceback.format_exc())]
        run = f"{task.label} / {task.budgets[k].name}", task.descriptions[k], arrays, facts
        done.append(run if shared.folder is None else write_run(shared.folder, *run))


def _performed(task: Task, shared: _Shared) -> Iterator[tuple[int, dict[str, npt.NDArray[Any]], dict[str, Any]]]:
    how: dict[str, Any] = {"jobs": shared.jobs}
    if shared.folder is not None and shared.checkpoint is not None and task.algorithm.name not in shared.not_resumable:
        how |= {"checkpoint": _checkpoint_of(task, shared.folder.parent), "interval": shared.checkpoint}
    yield from perform(task, shared.problems[task.problem].build(), **how)


# ------------------------------------------------------------------------------------------------------ baselines


@dataclass(frozen=True)
class _BaselineTask:
    """A baseline on a problem: its name, the numbers of triangles to ask for, and which are the paper's."""

    problem: str
    method: str
    asked: tuple[int, ...]
    paper: tuple[int, ...]
    description: Mapping[str, Any]

    @property
    def key(self) -> str:
        return fingerprint(self.description)

    @property
    def label(self) -> str:
        return f"{self.problem} / {self.method}"


def _baseline_work(experiment: Experiment) -> float:
    """Return the work of all baselines on all problems."""
    methods = experiment.baselines.methods if experiment.baselines else ()
    return sum(len(methods) * _work_of_one(problem) for problem in experiment.problems)


def _work_of_one(problem: ProblemConfig) -> float:
    return BASELINE_EVALUATIONS * float(problem.model.n_vertices)


def _baselines(
    experiment: Experiment, tasks: Sequence[Task], store: RunStore, engine: Engine, shown: _Shown, shared: _Shared
) -> tuple[list[dict[str, Any]], tuple[str, ...], int]:
    """Do what is missing of the baselines; return rows for the record, what was skipped, how many were done."""
    asked = [task for problem in experiment.problems for task in _baseline_tasks(problem, experiment, tasks, store)]
    missing = [task for task in asked if store.get(task.key) is None]
    for line in store.damaged:
        warnings.warn(f"{line}; it is computed again", ExperimentWarning, stacklevel=3)
    store.damaged.clear()
    for task in asked:
        if task not in missing:
            shown.add(_work_of_one(shared.problems[task.problem]), task.label)
    unavailable: dict[int, str] = {}
    try:
        for place, done in engine.each(_baseline_on, missing, shared):
            if isinstance(done, Path):
                store.add(done)
            else:
                unavailable[place] = done
            shown.add(_work_of_one(shared.problems[missing[place].problem]), missing[place].label)
    except EngineError as problem_of_engine:
        raise _interrupted(store, problem_of_engine) from None
    skipped: dict[str, list[str]] = {}
    for place, reason in sorted(unavailable.items()):
        skipped.setdefault(reason, []).append(missing[place].label)
    lines = tuple(f"skipped: {', '.join(labels)}: {reason}" for reason, labels in skipped.items())
    without = {missing[place].key for place in unavailable}
    rows = [
        {"key": task.key, "problem": task.problem, "method": task.method} for task in asked if task.key not in without
    ]
    return rows, lines, len(missing) - len(unavailable)


def _baseline_tasks(
    problem: ProblemConfig, experiment: Experiment, tasks: Sequence[Task], store: RunStore
) -> Iterator[_BaselineTask]:
    """Yield the baselines on a problem whose searches are done."""
    config = experiment.baselines
    if config is None:
        return
    triangles = len(problem.model.faces)
    down_to = _fewest_triangles(problem, tasks, store) if config.down_to_fronts else None
    asked = reductions(triangles, down_to=down_to, steps=config.steps)
    for method in config.methods:
        description = {
            "baseline": method,
            "model": problem.model.hash,
            "rules": plain(problem.rules),
            "asked": list(asked),
        }
        yield _BaselineTask(problem.name, method, asked, reductions(triangles), description)


def _fewest_triangles(problem: ProblemConfig, tasks: Sequence[Task], store: RunStore) -> int | None:
    """Return the fewest triangles of any run on a problem."""
    fewest = []
    for task in tasks:
        if task.problem == problem.name:
            for run in map(store.get, task.keys):
                if run is not None and len(run.arrays["F"]):
                    fewest.append(int(run.arrays["F"][:, 1].min()))
    return min(fewest, default=None)


def _baseline_on(task: _BaselineTask, shared: _Shared) -> Path | str:
    """Do a baseline; return the record of what it made, or why it cannot be used here."""
    assert shared.folder is not None
    problem, baseline, begun = shared.problems[task.problem].build(), BASELINES[task.method], now()
    try:
        arrays, facts = (_meshes_of if baseline.tool else _front_of)(task, problem)
    except ToolUnavailable as reason:
        return str(reason)
    arrays["paper"] = np.isin(arrays["asked"], task.paper)
    facts |= {
        "problem": task.problem,
        "algorithm": task.method,
        "begun": begun,
        "environment": machine() | {"jobs": shared.jobs},
        "versions": package_versions(*[baseline.package] * bool(baseline.package)),
    }
    return write_run(shared.folder, task.label, task.description, arrays, facts)


def _meshes_of(task: _BaselineTask, problem: MeshProblem) -> tuple[dict[str, npt.NDArray[Any]], dict[str, Any]]:
    """Let a tool simplify a model to all sizes; return arrays and facts."""
    surface = problem.surface
    measure = surface.rules.measure
    meshes = baseline_meshes(surface, task.method, task.asked)
    nearest = [mesh.quality for mesh in meshes]
    if surface.rules.spares_uncovered:
        charged = surface_of(problem.model, replace(surface.rules, outside="nearest"))
        nearest = [charged.score(m.vertices, m.faces).quality if m.triangles else m.quality for m in meshes]
    arrays = {
        "asked": np.array(task.asked, dtype=np.int64),
        "F": np.array([[getattr(m.quality, measure), m.triangles] for m in meshes], dtype=np.float64),
        "error_nearest": np.array([getattr(quality, measure) for quality in nearest]),
        **_quality_arrays([mesh.quality for mesh in meshes]),
        "mesh_vertices": np.concatenate([mesh.vertices for mesh in meshes]),
        "mesh_faces": np.concatenate([mesh.faces for mesh in meshes]).astype(np.int32),
        "vertex_start": np.cumsum([0] + [len(mesh.vertices) for mesh in meshes]),
        "face_start": np.cumsum([0] + [len(mesh.faces) for mesh in meshes]),
    }
    return arrays, {"seconds": round(sum(m.seconds for m in meshes), 4), "notes": [m.note for m in meshes]}


def _front_of(task: _BaselineTask, problem: MeshProblem) -> tuple[dict[str, npt.NDArray[Any]], dict[str, Any]]:
    """Return arrays and facts of a whole front."""
    start = time.perf_counter()
    front = baseline_front(problem.surface, task.method)
    seconds = time.perf_counter() - start
    answers, spread = chosen_rows(front, task.asked)
    arrays = _subset_arrays(problem, np.array([front.kept(row) for row in (*answers, *spread)]))
    arrays["asked"] = np.array([*task.asked, *[0] * len(spread)], dtype=np.int64)
    sizes = arrays["F"][: len(answers), 1].astype(int).tolist()
    notes = [size_note(task.method, number, obtained) for number, obtained in zip(task.asked, sizes, strict=True)]
    return arrays, {"seconds": round(seconds, 4), "notes": notes + [""] * len(spread)}
