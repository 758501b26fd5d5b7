"""``meshsimp run``: a whole comparison from a YAML file."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshsimp_pymoo.comparison.config import ProblemConfig
    from meshsimp_pymoo.workers import DaskEngine

HELP = "do a whole comparison from a YAML file"
DESCRIPTION = """\
Do all runs that CONFIG.yaml asks for and report on them: tables, figures, findings. What is
finished is never done again, so an interrupted call is continued by the same command. See the
configs folder of the source for examples."""
EXAMPLES = """\
examples:
  meshsimp run configs/quick.yaml -o results --jobs 2
      the same call again does what is missing
  meshsimp run configs/scans.yaml --models ~/scans
      with files of yours
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_checkpoint, add_shown, add_workers

    parser.add_argument("config", metavar="CONFIG.yaml")
    parser.add_argument("-o", "--output", metavar="OUT", help="folder to make or to continue (default: CONFIG_results)")
    add_workers(parser)
    add_checkpoint(
        parser,
        "the state of every run is saved",
        "; an algorithm whose state cannot be saved is named, and begins anew",
    )
    parser.add_argument(
        "--models", metavar="FOLDER", help="where the model files are, in place of the configuration's folder"
    )
    add_shown(parser)


def run(args: argparse.Namespace) -> int:
    """Do the runs of ``args.config`` that are missing, and report on all of them."""
    import os
    import time
    from contextlib import ExitStack
    from pathlib import Path

    from meshsimp_pymoo.cli.preparing import compiling
    from meshsimp_pymoo.cli.reporting import report_on_experiment
    from meshsimp_pymoo.cli.terminal import INTERRUPTED, Stages, answering, bar, say, tell
    from meshsimp_pymoo.comparison.config import read_experiment_file
    from meshsimp_pymoo.comparison.runner import run_experiment
    from meshsimp_pymoo.surface.closed.model import ClosedModel
    from meshsimp_pymoo.warming import CLOSED_WISH, WISH

    with (
        Stages(args.quiet, "compiling", {"compiling": 0.0}, lines=True) as shown,
        compiling(WISH, shown) as compiled,
    ):

        def finish(problems: Sequence[ProblemConfig]) -> None:
            # algorithms are tried out on a height field, whatever the models are
            any_closed = any(isinstance(problem.model, ClosedModel) for problem in problems)
            compiled.finish((*WISH, *CLOSED_WISH) if any_closed else WISH)

        experiment = read_experiment_file(args.config, folder=args.models, before_trials=finish)
    out = Path(args.output or f"{Path(args.config).stem}_results")
    jobs = args.jobs or os.cpu_count() or 1
    start = time.perf_counter()
    try:
        with (
            answering("stopping: finished runs are stored, the same command does the rest"),
            bar(args.quiet, "runs") as show,
            ExitStack() as open_until_done,
        ):
            done = run_experiment(
                experiment,
                out,
                jobs=jobs,
                engine=open_until_done.enter_context(_cluster(args.dask)) if args.dask else None,
                progress=lambda work, total, text: show(work / max(total, 1e-9), text),
                checkpoint=args.checkpoint,
            )
        seconds = time.perf_counter() - start
        if not (args.quiet or args.json):
            tell(f"{out}: {done.finished:,} runs done in {seconds:.0f} s, {done.reused:,} were there already")
        facts = {"finished": done.finished, "reused": done.reused, "seconds": round(seconds, 3)}
        return report_on_experiment(out, facts, quiet=args.quiet, as_json=args.json)
    except KeyboardInterrupt:
        say(f"interrupted; the finished runs are in {out}, the same command does the rest")
        return INTERRUPTED


def _cluster(address: str) -> DaskEngine:
    from meshsimp_pymoo.errors import UsageError
    from meshsimp_pymoo.workers import DaskEngine, EngineError

    try:
        return DaskEngine(address)
    except EngineError as problem:
        raise UsageError(str(problem)) from None
