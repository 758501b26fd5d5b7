"""``meshsimp simplify``: search the front of a model and write it."""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shlex
import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.termination.max_gen import MaximumGenerationTermination
from pymoo.termination.max_time import TimeBasedTermination

from meshsimp_pymoo.cli.arguments import DEFAULT_GENERATIONS
from meshsimp_pymoo.cli.terminal import (
    BAD_INPUT,
    INTERRUPTED,
    OK,
    TARGET_MISSED,
    described,
    progress,
    say,
    stop_if_interrupted,
)
from meshsimp_pymoo.cli.tiled import simplify_tiled, wants_tiles
from meshsimp_pymoo.errors import NoFullGrid, ResultError, UsageError
from meshsimp_pymoo.files import locked, put_back
from meshsimp_pymoo.formats.source.precision import shared_frame
from meshsimp_pymoo.formats.table import format_to_write
from meshsimp_pymoo.front import Front, FrontSolution, starting_front
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.search.checkpoint import (
    CheckpointError,
    Checkpoints,
    NotResumable,
    difference,
    read_checkpoint,
    restore,
)
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.storage import (
    CHECKPOINT,
    claim_output,
    is_unfinished,
    package_versions,
)

# What of the command line does not decide the results.
UNRECORDED = ("command", "output", "overwrite", "quiet", "json", "model", "seed", "page", "checkpoint")


@dataclass
class _Found:
    """What a search came back with."""

    front: Front
    generations: int
    evaluations: int
    seconds: float
    interrupted: bool


def simplify(args: argparse.Namespace) -> int:
    """Search the front of ``args.model`` and write it to a new folder."""
    if args.output is None:
        args.output = f"{re.sub(r'[^A-Za-z0-9._-]+', '_', Path(args.model).stem)}_front"
    if wants_tiles(args):
        try:
            return simplify_tiled(args)
        except NoFullGrid as reason:
            if args.tile is not None:
                raise
            # nobody asked for tiles
            if not args.quiet:
                why = re.split("; only|, and tiles", str(reason))[0]
                say(f"{why}; so it is not cut into tiles but searched in one piece")
    folder = _claim(args)
    problem = _mesh_problem(args)
    format_to_write(args.format).check(problem.model)
    _refuse_impossible(args, problem)
    with _Kept(args, folder, problem) as kept:
        return _search_and_write(args, folder, problem, kept)


def _claim(args: argparse.Namespace) -> Path:
    """Return the folder to make: a new one, one with a checkpoint, or with ``--overwrite`` one with old results."""
    folder = Path(args.output)
    put_back(folder)
    if is_unfinished(folder) and (args.checkpoint is not None or not (folder / CHECKPOINT).exists()):
        return folder
    return claim_output(folder, overwrite=args.overwrite)


def _search_and_write(args: argparse.Namespace, folder: Path, problem: MeshProblem, kept: _Kept) -> int:
    found = _search(args, problem, kept)
    if found is None:
        say("interrupted before the first generation was complete; nothing is written")
        return INTERRUPTED

    settings = {key: value for key, value in vars(args).items() if key not in UNRECORDED}
    if not (args.time or args.evaluations):
        settings["generations"] = _generations(args)
    run = {
        "settings": settings,
        "seed": args.seed,
        "generations": found.generations,
        "evaluations": found.evaluations,
        "seconds": round(found.seconds, 3),
        "interrupted": found.interrupted,
    }
    chosen, missed = _choose(args, found.front)
    try:
        found.front.save(
            folder,
            # the folder of our own checkpoint gives way to the results
            overwrite=args.overwrite or kept.is_held or (is_unfinished(folder) and not kept.path.exists()),
            meshes=args.meshes,
            mesh_format=args.format,
            chosen=chosen,
            refit=args.refit,
            page=args.page,
            run=run,
        )
    except (ResultError, KeyboardInterrupt) as stop:
        if not (kept.is_held and kept.path.exists()):
            raise
        reason = "interrupted while the results were written" if isinstance(stop, KeyboardInterrupt) else str(stop)
        say(f"{reason}; the same command goes on from the checkpoint in {folder}")
        return INTERRUPTED if isinstance(stop, KeyboardInterrupt) else BAD_INPUT
    _summarise(args, problem, found, chosen)
    if found.interrupted:
        say(f"interrupted after {found.generations} generations; {folder} holds the front so far")
        return INTERRUPTED
    if missed:
        say(f"{folder} holds a front, but no chosen mesh: {missed}; search longer (--generations, --time)")
        return TARGET_MISSED
    return OK


def _mesh_problem(args: argparse.Namespace) -> MeshProblem:
    if PRESETS[args.algorithm].sums_only and args.objectives[0] == "max_error":
        raise UsageError(
            "--measure max is not for the memetic search, which thins and moves vertices by sums over the vertices; "
            "use --algorithm nsga2_v1 with it, or --measure rms"
        )
    return MeshProblem(
        args.model,
        spacing=args.spacing,
        nodata=args.nodata,
        window=args.window,
        max_edge=args.max_edge,
        footprint=args.footprint,
        outside=args.outside,
        up=args.up,
        patch=args.patch,
        pin=args.pin,
        objectives=args.objectives,
        weights=args.weights,
        n_threads=args.threads,
    )


def _generations(args: argparse.Namespace) -> int:
    """Return the generations to run where neither time nor evaluations are given."""
    from meshsimp_pymoo.search.memetic import sweep_generations

    sweeps = PRESETS[args.algorithm].sweeps
    default = sweep_generations(args.population) if sweeps else DEFAULT_GENERATIONS
    return int(args.generations or default)


def _set_up(args: argparse.Namespace, problem: MeshProblem) -> Any:
    """Return the algorithm before its first generation."""
    if args.time is not None:
        termination: Any = TimeBasedTermination(args.time)
    elif args.evaluations is not None:
        termination = MaximumFunctionCallTermination(args.evaluations)
    else:
        termination = MaximumGenerationTermination(_generations(args))
    algorithm = PRESETS[args.algorithm].function(pop_size=args.population)
    return algorithm.setup(problem, termination=termination, seed=args.seed)


class _Kept:
    """The checkpoints of a search, in the folder of its results; it holds the folder as long as there is one.

    Parameters
    ----------
    args : Namespace
        The command line.
    folder : Path
        Where the results go.
    problem : MeshProblem
        What is searched.
    """

    def __init__(self, args: argparse.Namespace, folder: Path, problem: MeshProblem) -> None:
        self.args = args
        self.folder = folder
        self.problem = problem
        self.path = folder / CHECKPOINT
        self.is_held = False
        self._checkpoints: Checkpoints | None = None
        self._until_done = ExitStack()
        self._warned = False

    def __enter__(self) -> _Kept:
        return self

    def __exit__(self, *_: object) -> None:
        self._until_done.close()

    @property
    def what(self) -> dict[str, Any]:
        """What the search is: all that decides its results."""
        args, versions = self.args, package_versions()
        budget = {name: getattr(args, name) for name in ("time", "evaluations")}
        if not any(budget.values()):
            budget["generations"] = _generations(args)
        return {
            "model": self.problem.model.hash,
            "pinned vertices": hashlib.sha256(self.problem.pinned.tobytes()).hexdigest(),
            "measure": self.problem.objectives,
            **{name: getattr(args, name) for name in ("footprint", "outside", "algorithm", "population", "seed")},
            **budget,
            **{name: versions.get(name) for name in ("meshsimp-pymoo", "pymoo", "numpy")},
        }

    def begin(self) -> tuple[Any, float]:
        """Return the algorithm, where its checkpoint left it if there is one, and the seconds it took before."""
        args = self.args
        algorithm, before = _set_up(args, self.problem), 0.0
        if args.checkpoint is None:
            return algorithm, before
        if self.path.exists():
            self._hold()
            try:
                stored = read_checkpoint(self.path)
                if other := difference(stored.what, self.what):
                    raise CheckpointError(f"{self.path}: belongs to another search ({other})")
                restore(stored, algorithm)
                before = stored.seconds
                if not args.quiet:
                    say(
                        f"{self.folder} holds a search that was stopped after {algorithm.n_iter - 1} generations, "
                        f"{algorithm.evaluator.n_eval:,} evaluations, {before:.0f} s; going on from there"
                    )
            except CheckpointError as problem:
                if not args.overwrite:
                    raise ResultError(
                        f"{problem}; name another folder, or allow overwriting (--overwrite) to begin anew"
                    ) from None
                algorithm = _set_up(args, self.problem)
        try:
            self._checkpoints = Checkpoints(self.path, algorithm, self.what, interval=args.checkpoint, before=before)
        except NotResumable as problem:
            self._warn(problem)
        return algorithm, before

    def keep(self, *, last: bool = False) -> None:
        """Save the state if it is time; at the end of the search, if it was long enough to be worth it."""
        checkpoints = self._checkpoints
        if checkpoints is None or not (checkpoints.due() or (last and self.is_held)):
            return
        try:
            self._hold()
            checkpoints.save()
        except (CheckpointError, NotResumable, OSError) as problem:
            self._warn(problem)

    def _warn(self, problem: Exception) -> None:
        """Say once what is wrong with the checkpoints; the search is worth more."""
        if not self._warned:
            say(f"warning: {problem}; the search goes on without a checkpoint")
        self._warned = True

    def _hold(self) -> None:
        """Make the folder, if need be, and keep other processes away from it."""
        if not self.is_held:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._until_done.enter_context(locked(self.folder))
            self.is_held = True
            put_back(self.folder, tidy=True)


def _search(args: argparse.Namespace, problem: MeshProblem, kept: _Kept) -> _Found | None:
    """Run the algorithm to its budget or to Ctrl-C; None if there is no front yet."""
    algorithm, before = kept.begin()
    start = time.perf_counter()
    found, generations, interrupted = algorithm.opt, (algorithm.n_iter or 1) - 1, False
    with progress(args.quiet, problem.model) as show:
        try:
            while algorithm.has_next():
                stop_if_interrupted()
                algorithm.next()
                found, generations = algorithm.opt, algorithm.n_iter - 1
                show(algorithm.termination.perc, algorithm.evaluator.n_eval, found.get("F"))
                kept.keep()
            kept.keep(last=True)
        except KeyboardInterrupt:
            interrupted = True
    if found is None:
        return None
    try:
        # Both ends of what is possible are known without a search: all vertices, and the pinned ones alone.
        front = Front.from_subsets(problem, np.asarray(found.get("X"), dtype=bool), ends=True)
    except LookupError:
        raise UsageError(
            f"{problem.model.name}: none of {algorithm.evaluator.n_eval} subsets of its vertices spans a triangle "
            "inside its outline; search longer, or pass --footprint hull"
        ) from None
    front.series |= starting_front(problem, algorithm)
    return _Found(front, generations, algorithm.evaluator.n_eval, before + time.perf_counter() - start, interrupted)


def _refuse_impossible(args: argparse.Namespace, problem: MeshProblem) -> None:
    """Stop before the search if no subset of the vertices is a mesh, or none can meet the target."""
    table = problem.evaluate_subsets(np.array([np.ones(problem.n_var, dtype=bool), problem.pinned]))
    whole, bare = (problem.as_quality(row) for row in table)
    if whole.triangles == 0:
        raise UsageError(
            f"{problem.model.name}: has no triangle with an area as seen from {problem.model.up.tolist()}; "
            "choose another viewing side with --up"
        )
    # With open bays, more vertices can mean fewer triangles, but never none.
    least = bare.triangles if args.footprint == "hull" else max(1, min(bare.triangles, 2))
    if args.triangles is not None and args.triangles < least:
        raise UsageError(
            f"--triangles {args.triangles} is impossible: {problem.model.name} has {least} to "
            f"{whole.triangles} triangles with its pinned vertices"
        )


def _choose(args: argparse.Namespace, front: Front) -> tuple[FrontSolution | None, str]:
    """Return the solution that was asked for, if one was, and why there is none, if so."""
    if args.pick == "knee":
        return front.knee(), ""
    limits = {name: getattr(args, name) for name in ("triangles", "max_error", "mean_error")}
    limits = {name: limit for name, limit in limits.items() if limit is not None}
    if not limits:
        return None, ""
    try:
        return front.best(**limits), ""
    except LookupError as problem:
        return None, str(problem)


def _summarise(args: argparse.Namespace, problem: MeshProblem, found: _Found, chosen: FrontSolution | None) -> None:
    model, quality, folder = problem.model, found.front.quality, Path(args.output)
    kind = format_to_write(args.format)
    chosen_path = None if chosen is None else str(folder / f"chosen{kind.suffix}")
    origin = shared_frame(kind, model.file_points, name=model.name, georeference={})["origin"].tolist()
    if args.json:
        summary = {
            "model": {
                "name": model.name,
                "vertices": model.n_vertices,
                "triangles": len(model.faces),
                "hash": model.hash,
            },
            "front": str(folder / "front.csv"),
            "solutions": len(quality),
            "smallest": asdict(quality[0]),
            "most_accurate": asdict(quality[-1]),
            "chosen": None
            if chosen is None
            else {"mesh": chosen_path, "solution": chosen.solution, **asdict(chosen.quality)},
            "evaluations": found.evaluations,
            "seconds": round(found.seconds, 3),
            "seed": args.seed,
        }
        if any(origin):
            summary["mesh_origin"] = origin
        print(json.dumps(summary, indent=2))
        return
    if args.quiet:
        return
    few, many = quality[0], quality[-1]
    print(f"{Path(model.name).name}: {model.n_vertices:,} vertices, {len(model.faces):,} triangles")
    print(
        f"front: {len(quality)} solutions, {few.triangles:,} to {many.triangles:,} triangles, "
        f"mean error {few.mean_error:.4g} to {many.mean_error:.4g} "
        f"({found.evaluations:,} evaluations, {found.seconds:.1f} s, seed {args.seed})"
    )
    if chosen is not None:
        print(f"chosen: {chosen_path} (solution {chosen.solution}): {described(chosen.quality)}")
    written = len(list(folder.glob("meshes/*")))
    fitted = f", {written} in refitted" if args.refit and written else ""
    page = ", report.html" if args.page else ""
    print(f"written: {folder}: front.csv, front.png{page}" + (f", {written} in meshes" if written else "") + fitted)
    if any(origin):
        place = ", ".join(f"{value:.15g}" for value in origin)
        print(f"origin of the glb meshes: ({place}); each file puts itself back there")
    if chosen is None:
        size = _round_size(found.front)
        print(f"take one of them: meshsimp pick {shlex.quote(str(folder))} --triangles {size} -o small.ply")


def _round_size(front: Front) -> int:
    """Return a size worth an example: that of the knee, rounded up."""
    triangles = front.knee().triangles
    step = 10 ** max(len(str(triangles)) - 2, 0)
    return -(-triangles // step) * step
