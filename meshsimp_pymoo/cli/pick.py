"""``meshsimp pick``: one mesh out of a stored front."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from meshsimp_pymoo.cli.terminal import OK, TARGET_MISSED, described, say
from meshsimp_pymoo.cli.tiled import pick_tiled
from meshsimp_pymoo.errors import UsageError
from meshsimp_pymoo.files import claim_file
from meshsimp_pymoo.formats.table import written_suffixes
from meshsimp_pymoo.front import Front, FrontSolution
from meshsimp_pymoo.tiles.output import is_tiled


def pick(args: argparse.Namespace) -> int:
    """Say which solution of the front in ``args.front`` is meant, and write its mesh if a file is named."""
    path = None if args.output is None else claim_file(args.output, written_suffixes(), overwrite=args.overwrite)
    if is_tiled(args.front):
        return pick_tiled(args, path)
    front = Front.load(args.front, model=args.model)
    try:
        solution = _wanted(args, front)
    except LookupError as problem:
        say(f"{args.front}: {problem}; nothing is written")
        return TARGET_MISSED
    if path is not None:
        solution.save(path, overwrite=args.overwrite)
    if args.json:
        mesh = None if path is None else str(path)
        print(json.dumps({"mesh": mesh, "solution": solution.solution, **asdict(solution.quality)}, indent=2))
    elif not args.quiet:
        print(f"solution {solution.solution} of {args.front}: {described(solution.quality)}")
        print(f"written: {path}" if path else "nothing is written; name a file with -o")
    return OK


def _wanted(args: argparse.Namespace, front: Front) -> FrontSolution:
    if args.knee:
        return front.knee()
    if args.solution is not None:
        if args.solution >= len(front):
            raise UsageError(
                f"{args.front}: has the solutions 0 to {len(front) - 1}; --solution {args.solution} is none of them"
            )
        return front[args.solution]
    return front.best(triangles=args.triangles, max_error=args.max_error, mean_error=args.mean_error)
