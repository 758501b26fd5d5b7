"""``meshsimp run`` and ``meshsimp report``: experiments from YAML files."""

from __future__ import annotations

import argparse
import json
import os
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.cli.terminal import INTERRUPTED, OK, bar, say
from meshsimp_pymoo.errors import UsageError

if TYPE_CHECKING:
    from meshsimp_pymoo.workers import DaskEngine
from meshsimp_pymoo.comparison.config import read_experiment_file
from meshsimp_pymoo.comparison.report import write_report
from meshsimp_pymoo.comparison.runner import run_experiment
from meshsimp_pymoo.storage import read_front


def run(args: argparse.Namespace) -> int:
    """Do the runs of ``args.config`` that are missing, and report on all of them."""
    experiment = read_experiment_file(args.config, folder=args.models)
    out = Path(args.output or f"{Path(args.config).stem}_results")
    jobs = args.jobs or os.cpu_count() or 1
    start = time.perf_counter()
    try:
        with bar(args.quiet, "runs") as show, ExitStack() as open_until_done:
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
            print(f"{out}: {done.finished:,} runs done in {seconds:.0f} s, {done.reused:,} were there already")
        return _write_report(
            args, out, {"finished": done.finished, "reused": done.reused, "seconds": round(seconds, 3)}
        )
    except KeyboardInterrupt:
        say(f"interrupted; the finished runs are in {out}, the same command does the rest")
        return INTERRUPTED


def _cluster(address: str) -> DaskEngine:
    from meshsimp_pymoo.workers import DaskEngine, EngineError

    try:
        return DaskEngine(address)
    except EngineError as problem:
        raise UsageError(str(problem)) from None


def report(args: argparse.Namespace) -> int:
    """Make the report of the experiment, or the page of the front, in ``args.output`` anew."""
    out = Path(args.output)
    if (out / "front.csv").is_file():
        return _write_front_page(args, out)
    if args.model is not None:
        raise UsageError(f"--model is for the page of a front; {out} holds none")
    return _write_report(args, out, {})


def _write_front_page(args: argparse.Namespace, out: Path) -> int:
    from meshsimp_pymoo.front import Front
    from meshsimp_pymoo.indicators import knee
    from meshsimp_pymoo.report.page import write_page

    front = Front.load(out, model=args.model)
    path = write_page(read_front(out), front.problem, folder=out, knee=knee(front.F))
    if args.json:
        print(json.dumps({"page": str(path), "solutions": len(front)}, indent=2))
    elif not args.quiet:
        print(f"written: {path} ({len(front)} solutions)")
    return OK


def _write_report(args: argparse.Namespace, out: Path, facts: dict[str, Any]) -> int:
    with bar(args.quiet, "report") as show:
        study = write_report(out, progress=lambda done, total, text: show(done / max(total, 1), text))
    if args.json:
        summary = {"folder": str(out), **facts, "runs": len(study.all_runs), "missing": len(study.missing)}
        print(json.dumps(summary, indent=2))
    elif not args.quiet:
        left_out = f", {len(study.missing)} runs are missing" if study.missing else ""
        files = "report.html, findings.md, tables, figures, times.csv"
        print(f"written: {out}: {files} ({len(study.all_runs):,} runs{left_out})")
    return OK
