"""Reports from the shell: of an experiment, of a front."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from meshsimp_pymoo.cli.terminal import OK, bar, place_for_matplotlib, stop_if_interrupted, tell, tell_drawn, there
from meshsimp_pymoo.comparison.report import write_report
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.storage import PICTURES


def report_on_front(out: Path, model: str | None, *, quiet: bool, as_json: bool) -> int:
    """Make the picture and the page of a front anew; return the exit code."""
    front = Front.load(out, model=model)
    with place_for_matplotlib(out):
        front.draw()
        stop_if_interrupted()
    return tell_drawn(out, PICTURES, len(front), quiet=quiet, as_json=as_json)


def report_on_experiment(out: Path, facts: dict[str, Any], *, quiet: bool, as_json: bool) -> int:
    """Make the report of an experiment anew; return the exit code."""
    with bar(quiet, "report") as show, place_for_matplotlib(out):
        study = write_report(out, progress=lambda done, total, text: show(done / max(total, 1), text))
        stop_if_interrupted()
    if as_json:
        summary = {"folder": str(out), **facts, "runs": len(study.all_runs), "missing": len(study.missing)}
        tell(json.dumps(summary, indent=2))
    elif not quiet:
        left_out = f", {len(study.missing)} runs are missing" if study.missing else ""
        files = there(out, "report.html", "findings.md", "times.csv") + ", tables, figures"
        tell(f"written: {out}: {files} ({len(study.all_runs):,} runs{left_out})")
    return OK
