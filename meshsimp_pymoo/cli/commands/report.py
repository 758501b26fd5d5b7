"""``meshsimp report``: the report of an experiment or the page of a front, made anew."""

from __future__ import annotations

import argparse

HELP = "make the report of a comparison or the page of a front anew"
DESCRIPTION = """\
Make the tables, figures, findings and the page (report.html) of an experiment anew, from its
stored results alone; or the picture and the page of a front that `meshsimp simplify` wrote, from the front
and its model."""
EXAMPLES = """\
examples:
  meshsimp report results
      the report of `meshsimp run`
  meshsimp report face_front
      the page of `meshsimp simplify`
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_shown

    parser.add_argument("output", metavar="OUT", help="the folder of an experiment or of a front")
    parser.add_argument("--model", metavar="MODEL", help="the original of the front, if it is no longer where it was")
    add_shown(parser)


def run(args: argparse.Namespace) -> int:
    """Make the report of the experiment, or the picture and page of the front, in ``args.output`` anew."""
    from pathlib import Path

    from meshsimp_pymoo.cli.preparing import said_when_compiling
    from meshsimp_pymoo.cli.reporting import report_on_experiment, report_on_front
    from meshsimp_pymoo.errors import UsageError

    out, shown = Path(args.output), {"quiet": args.quiet, "as_json": args.json}
    if (out / "front.csv").is_file():
        with said_when_compiling(args.quiet):
            return report_on_front(out, args.model, **shown)
    if args.model is not None:
        raise UsageError(f"--model is for the page of a front; {out} holds none")
    from meshsimp_pymoo.comparison.store import EXPERIMENT_FILE

    if not (out / EXPERIMENT_FILE).exists():
        raise UsageError(
            f"{out}: holds neither a front (front.csv) nor an experiment ({EXPERIMENT_FILE}); name the folder that "
            "simplify -o or run made"
        )
    return report_on_experiment(out, {}, **shown)
