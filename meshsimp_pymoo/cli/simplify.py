"""``meshsimp simplify``: search the front of a model and write it."""

from __future__ import annotations

import argparse
import json
import re
import shlex
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.termination.max_gen import MaximumGenerationTermination
from pymoo.termination.max_time import TimeBasedTermination

from meshsimp_pymoo.algorithms import PRESETS
from meshsimp_pymoo.cli.arguments import DEFAULT_GENERATIONS, UsageError
from meshsimp_pymoo.cli.terminal import INTERRUPTED, OK, TARGET_MISSED, described, progress, say, stop_if_interrupted
from meshsimp_pymoo.cli.tiled import simplify_tiled, wants_tiles
from meshsimp_pymoo.front import Front, FrontSolution
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.results import claim_output, local_origin, mesh_suffix, refuse_format

# What of the command line does not decide the results.
UNRECORDED = ("command", "output", "overwrite", "quiet", "json", "model", "seed", "page")


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
        return simplify_tiled(args)
    folder = claim_output(args.output, overwrite=args.overwrite)
    problem = _mesh_problem(args)
    refuse_format(problem.model, args.format)
    _refuse_impossible(args, problem)
    found = _search(args, problem)
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
    found.front.save(
        folder,
        overwrite=args.overwrite,
        meshes=args.meshes,
        mesh_format=args.format,
        chosen=chosen,
        refit=args.refit,
        page=args.page,
        run=run,
    )
    _summarise(args, problem, found, chosen)
    if found.interrupted:
        say(f"interrupted after {found.generations} generations; {folder} holds the front so far")
        return INTERRUPTED
    if missed:
        say(f"{folder} holds a front, but no chosen mesh: {missed}; search longer (--generations, --time)")
        return TARGET_MISSED
    return OK


def _mesh_problem(args: argparse.Namespace) -> MeshProblem:
    if args.algorithm == "memetic" and args.objectives[0] == "max_error":
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
    from meshsimp_pymoo.memetic_search import sweep_generations

    default = sweep_generations(args.population) if args.algorithm == "memetic" else DEFAULT_GENERATIONS
    return int(args.generations or default)


def _search(args: argparse.Namespace, problem: MeshProblem) -> _Found | None:
    """Run the algorithm to its budget or to Ctrl-C; None if there is no front yet."""
    if args.time is not None:
        termination: Any = TimeBasedTermination(args.time)
    elif args.evaluations is not None:
        termination = MaximumFunctionCallTermination(args.evaluations)
    else:
        termination = MaximumGenerationTermination(_generations(args))
    algorithm = PRESETS[args.algorithm](pop_size=args.population)
    algorithm.setup(problem, termination=termination, seed=args.seed)
    start = time.perf_counter()
    found, generations, interrupted = None, 0, False
    with progress(args.quiet, problem.model) as show:
        try:
            while algorithm.has_next():
                stop_if_interrupted()
                algorithm.next()
                found, generations = algorithm.opt, algorithm.n_iter - 1
                show(algorithm.termination.perc, algorithm.evaluator.n_eval, found.get("F"))
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
    return _Found(front, generations, algorithm.evaluator.n_eval, time.perf_counter() - start, interrupted)


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
    chosen_path = None if chosen is None else str(folder / f"chosen.{mesh_suffix(args.format)}")
    origin = local_origin(model.file_points).tolist() if args.format == "glb" else [0.0, 0.0, 0.0]
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
