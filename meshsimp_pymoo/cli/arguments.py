"""What a command line may say: commands, options, their help and the types of their values.

Nothing heavy is imported here, so that ``--help`` is quick; a command's module is imported when it runs.
"""

from __future__ import annotations

import argparse
import difflib
import math
import re
import textwrap
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from meshsimp_pymoo.errors import UsageError
from meshsimp_pymoo.formats.table import read_suffixes, written_formats, written_suffixes
from meshsimp_pymoo.search.presets import DEFAULT, PRESETS

__all__ = ["DEFAULT_GENERATIONS", "SHELLS", "make_parser"]

# Four times the paper's budget: its 50 generations take a second at its sizes and leave much to gain.
DEFAULT_GENERATIONS = 200
# What --measure calls the errors that can be an objective.
MEASURES = {"l1": "error", "rms": "rms_error", "max": "max_error"}
SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}
SHELLS = ("bash", "zsh", "tcsh")

SIMPLIFY_EXAMPLES = """\
examples:
  meshsimp simplify face.ply
      the front, in the new folder face_front
  meshsimp simplify face.ply -o out --triangles 500
      and the most accurate mesh of at most 500 triangles
  meshsimp simplify dem.asc --time 60s --pick knee
      search for a minute, take the best compromise
  meshsimp simplify scan.obj --max-error 0.1 --format obj
      the smallest that deviates nowhere by more than 0.1
  meshsimp simplify grid.npy --spacing 30 --nodata=-9999
      a height grid
  meshsimp simplify scan.laz --max-edge 5 --format landxml
      a point cloud with bays and holes, as a TIN for GIS programs
  meshsimp simplify huge.npy --tile 512 --triangles 200000
      a height grid that is too big for one piece
"""
PICK_EXAMPLES = """\
examples:
  meshsimp pick out --triangles 500 -o small.ply
      the most accurate of at most 500 triangles
  meshsimp pick out --max-error 0.1 -o small.obj
      the smallest that deviates nowhere by more than 0.1
  meshsimp pick out --knee
      only say what the best compromise is
"""
SCORE_EXAMPLES = """\
examples:
  meshsimp score face.ply decimated.ply
      its error by the measure of this package
  meshsimp score face.ply decimated.ply --front face_front
      and where it lies against a stored front
  meshsimp score face.ply decimated.ply -o error.png
      and a picture of the error
"""
INFO_EXAMPLES = """\
examples:
  meshsimp info
      the built-in models
  meshsimp info face.ply
      is it a height field, and seen from where?
  meshsimp info head.ply --patch front --up y
      and its front alone?
"""
RUN_EXAMPLES = """\
examples:
  meshsimp run configs/quick.yaml -o results --jobs 2
      the same call again does what is missing
  meshsimp run configs/scans.yaml --models ~/scans
      with files of yours
"""
REPORT_EXAMPLES = """\
examples:
  meshsimp report results
      the report of `meshsimp run`
  meshsimp report face_front
      the page of `meshsimp simplify`
"""
COMPLETION_EXAMPLES = """\
examples:
  eval "$(meshsimp completion bash)"
      in this session; the same line in ~/.bashrc: always
  meshsimp completion zsh > "${fpath[1]}/_meshsimp"
      zsh, always
"""


def _models() -> str:
    """Return what a model may be, for the end of a help."""
    of_mesh, of_grid, of_cloud = (", ".join(read_suffixes(sort, further=False)) for sort in ("mesh", "grid", "cloud"))
    text = (
        f"MODEL is a mesh ({of_mesh}, ...), a height grid ({of_grid}), a point cloud ({of_cloud}) or a built-in model "
        "such as jacksboro:11, face:5000 or roof; `meshsimp info` lists the built-in ones."
    )
    return textwrap.fill(text, 80) + "\n"


class _Parser(argparse.ArgumentParser):
    """Raises instead of printing the usage and exiting, names its own help, and knows what was probably meant."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, **kwargs)

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see {self.prog} --help)")

    def parse_known_args(  # type: ignore[override]
        self, args: Any = None, namespace: Any = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Refuse what is left over here, where the options of this command are known."""
        found, rest = super().parse_known_args(args, namespace)
        if rest:
            self.error(f"unrecognized arguments: {' '.join(rest)}{self._meant(rest)}")
        return found, []

    def _meant(self, rest: Sequence[str]) -> str:
        known = [option for option in self._option_string_actions if option.startswith("--")]
        near = []
        for word in rest:
            if word.startswith("-"):
                name = "--" + word.lstrip("-").partition("=")[0].lower().replace("_", "-")
                near += [option for option in known if option.startswith(name)] or difflib.get_close_matches(
                    name, known, n=1
                )
        return f"; did you mean {', '.join(dict.fromkeys(near))}?" if near else ""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        choices = [str(choice) for choice in action.choices]
        near = difflib.get_close_matches(str(value).lower(), choices, n=1, cutoff=0.5)
        text = f"invalid choice: {str(value)!r} (choose from {', '.join(choices)})"
        if isinstance(action, argparse._SubParsersAction) and (Path(value).suffix or Path(value).exists()):
            text += f"; did you mean meshsimp simplify {value}?"
        elif near:
            text += f"; did you mean {near[0]}?"
        raise argparse.ArgumentError(action, text)


def _command(module: str, function: str) -> Callable[[argparse.Namespace], int]:
    """Return what imports the command's module and runs it."""

    def run(args: argparse.Namespace) -> int:
        return int(getattr(import_module(f"meshsimp_pymoo.cli.{module}"), function)(args))

    return run


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line; ``args.command(args)`` then runs the command."""
    parser = _Parser(
        prog="meshsimp",
        description="Simplify an open mesh: not to one mesh, but to the whole trade-off between accuracy and size.",
        epilog=_models() + "\n`meshsimp COMMAND --help` has examples of each command.\n",
    )
    parser.add_argument("--version", action=_Version, nargs=0, dest=argparse.SUPPRESS, help="show the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for add in (_add_simplify, _add_pick, _add_score, _add_info, _add_run, _add_report, _add_completion):
        add(commands)
    return parser


def _add_simplify(commands: Any) -> None:
    simplify = commands.add_parser(
        "simplify",
        help="write the front of simplified meshes of a model",
        description="Find the front of simplified meshes of MODEL and write it to a new folder:\n"
        "report.html (the page to look and choose), front.csv (the numbers), meshes/ (one mesh\n"
        "per solution), front.png, front.npz, run.json, and the chosen mesh if one is asked for.",
        epilog=SIMPLIFY_EXAMPLES + "\n" + _models(),
    )
    simplify.set_defaults(command=_command("simplify", "simplify"))
    simplify.add_argument("model", metavar="MODEL")
    simplify.add_argument("-o", "--output", metavar="OUT", help="folder to make (default: MODEL_front, here)")
    simplify.add_argument("--overwrite", action="store_true", help="replace results that are in OUT already")

    wanted = simplify.add_argument_group(
        "the mesh you want, written to OUT/chosen.ply beside the front"
    ).add_mutually_exclusive_group()
    _add_wishes(wanted)
    wanted.add_argument("--pick", choices=("knee",), help="the best compromise: the knee of the front")

    budget = simplify.add_argument_group(
        f"how long to search (default: one sweep over all sizes; other algorithms: {DEFAULT_GENERATIONS} generations)"
    ).add_mutually_exclusive_group()
    budget.add_argument(
        "--time", type=_duration, metavar="T", help="60s, 10min, 1h (results then depend on the machine)"
    )
    budget.add_argument("--evaluations", type=_whole(1), metavar="N", help="stop after the generation that reaches N")
    budget.add_argument("--generations", type=_whole(1), metavar="N")

    search = simplify.add_argument_group("how to search")
    offered = tuple(name for name, preset in PRESETS.items() if preset.whole_front)
    search.add_argument("--algorithm", choices=offered, default=DEFAULT, help="preset (default: %(default)s)")
    search.add_argument("--population", type=_whole(2), default=100, metavar="N", help="(default: %(default)s)")
    search.add_argument(
        "--seed",
        type=_whole(0),
        default=1,
        metavar="N",
        help="same seed, same results (default: %(default)s)",
    )
    search.add_argument(
        "--threads", type=_whole(1), metavar="N", help="(default: all cores; the results do not depend on it)"
    )
    _add_checkpoint(search, "the state of the search is saved in OUT", " (tiles are always saved)")

    tiles = simplify.add_argument_group("big height grids, thinned tile by tile in bounded memory")
    tiles.add_argument(
        "--tile",
        type=_tile,
        metavar="N|none",
        help="samples along one side of a tile (default: 512, for .npy, .asc and .tif from 2 million samples on)",
    )
    tiles.add_argument("--pieces", action="store_true", help="write the chosen mesh in pieces, one for each tile")
    _add_worker_options(tiles)

    _add_model_options(simplify)
    rules = simplify.add_argument_group("what counts")
    rules.add_argument(
        "--footprint",
        choices=("model", "hull"),
        default="model",
        help="model: bays and holes stay open; hull: all of the convex hull is covered (default: %(default)s)",
    )
    rules.add_argument(
        "--outside",
        choices=("nearest", "ignore"),
        default="nearest",
        help="what a vertex that no triangle covers costs: its distance to the mesh, or nothing (default: %(default)s)",
    )
    rules.add_argument(
        "--pin",
        type=_pin,
        metavar="hull|I,J,...",
        help="vertices that every mesh keeps beside the corners: the convex hull, or rows of the file, from 0",
    )
    rules.add_argument(
        "--measure",
        dest="objectives",
        type=_objectives,
        default=("error", "triangles"),
        metavar="|".join(MEASURES),
        help="error that is made small beside the triangles: the sum of the deviations, their root mean square or "
        "their maximum (default: l1)",
    )
    _add_weights(rules)

    output = simplify.add_argument_group("what is written and shown")
    output.add_argument(
        "--format",
        type=str.lower,
        choices=list(written_formats()),
        default="ply",
        help="of the meshes (default: %(default)s)",
    )
    output.add_argument(
        "--meshes",
        type=_mesh_count,
        default=100,
        metavar="all|N|none",
        help="write at most N meshes, an even selection of the front (default: %(default)s)",
    )
    output.add_argument(
        "--refit",
        action="store_true",
        help="write each mesh once more in OUT/refitted, its vertices raised or lowered to where the sum of the "
        "deviations is least; front.csv says refitted_error",
    )
    output.add_argument(
        "--no-page", dest="page", action="store_false", help="do not write OUT/report.html, the page to look and choose"
    )
    _add_output_options(output)


def _add_pick(commands: Any) -> None:
    pick = commands.add_parser(
        "pick",
        help="take one mesh out of a front that is stored",
        description="Take one mesh out of the front in OUT, which `meshsimp simplify` wrote. No search\n"
        "is repeated: a mesh that is stored is copied, others are made from the model,\n"
        "which must be the very same.",
        epilog=PICK_EXAMPLES,
    )
    pick.set_defaults(command=_command("pick", "pick"))
    pick.add_argument("front", metavar="OUT", help="the folder of a front")
    wanted = pick.add_argument_group("which one").add_mutually_exclusive_group(required=True)
    _add_wishes(wanted)
    wanted.add_argument("--knee", action="store_true", help="the best compromise: the knee of the front")
    wanted.add_argument("--solution", type=_whole(0), metavar="K", help="the one of this number in front.csv")
    pick.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help=f"mesh to write; its suffix is its format: {', '.join(written_suffixes())} (default: nothing is written)",
    )
    pick.add_argument("--overwrite", action="store_true", help="replace FILE if it exists")
    pick.add_argument("--model", metavar="MODEL", help="the original, if it is no longer where it was")
    _add_output_options(pick)


def _add_score(commands: Any) -> None:
    score = commands.add_parser(
        "score",
        help="measure a mesh that another tool simplified",
        description="Measure OTHER, any simplified mesh of MODEL, by the error of this package: the sum,\n"
        "mean, RMS and maximum of the deviations at all vertices of MODEL, and how many of\n"
        "them no triangle covers.",
        epilog=SCORE_EXAMPLES + "\n" + _models(),
    )
    score.set_defaults(command=_command("score", "score"))
    score.add_argument("model", metavar="MODEL", help="the original")
    score.add_argument("other", metavar="OTHER", help="the simplified mesh, in the same frame and units")
    score.add_argument("--front", metavar="OUT", help="folder of a front of MODEL to compare with")
    score.add_argument("-o", "--output", metavar="FILE", help="picture of the error to write: png, svg or pdf")
    score.add_argument("--overwrite", action="store_true", help="replace FILE if it exists")
    score.add_argument(
        "--outside",
        choices=("nearest", "ignore"),
        help="what a vertex that no triangle covers costs: its distance to the mesh, or nothing (default: nearest, or "
        "as in the front)",
    )
    _add_weights(score)
    score.add_argument("--json", action="store_true", help="as JSON")
    _add_model_options(score)


def _add_info(commands: Any) -> None:
    info = commands.add_parser(
        "info",
        help="say what a model is and whether it can be simplified",
        description="Say what MODEL is, whether it is a height field, and what would be refused. Without a\n"
        "MODEL: list the built-in models.",
        epilog=INFO_EXAMPLES + "\n" + _models(),
    )
    info.set_defaults(command=_command("info", "info"))
    info.add_argument("model", metavar="MODEL", nargs="?")
    info.add_argument("--json", action="store_true", help="as JSON")
    _add_model_options(info)


def _add_run(commands: Any) -> None:
    run = commands.add_parser(
        "run",
        help="do a whole comparison from a YAML file",
        description="Do all runs that CONFIG.yaml asks for and report on them: tables, figures, findings. What is\n"
        "finished is never done again, so an interrupted call is continued by the same command. See the\n"
        "configs folder of the source for examples.",
        epilog=RUN_EXAMPLES,
    )
    run.set_defaults(command=_command("experiments", "run"))
    run.add_argument("config", metavar="CONFIG.yaml")
    run.add_argument("-o", "--output", metavar="OUT", help="folder to make or to continue (default: CONFIG_results)")
    _add_worker_options(run)
    _add_checkpoint(run, "the state of every run is saved", "; algorithms given by import path may begin anew")
    run.add_argument(
        "--models", metavar="FOLDER", help="where the model files are, in place of the configuration's folder"
    )
    _add_output_options(run)


def _add_report(commands: Any) -> None:
    report = commands.add_parser(
        "report",
        help="make the report of a comparison or the page of a front anew",
        description="Make the tables, figures, findings and the page (report.html) of an experiment anew, from its\n"
        "stored results alone; or the page of a front that `meshsimp simplify` wrote, from the front and its model.",
        epilog=REPORT_EXAMPLES,
    )
    report.set_defaults(command=_command("experiments", "report"))
    report.add_argument("output", metavar="OUT", help="the folder of an experiment or of a front")
    report.add_argument("--model", metavar="MODEL", help="the original of the front, if it is no longer where it was")
    _add_output_options(report)


def _add_completion(commands: Any) -> None:
    completion = commands.add_parser(
        "completion",
        help="print what makes a shell complete these commands",
        description="Print a script that makes a shell complete the commands, options and files of meshsimp.",
        epilog=COMPLETION_EXAMPLES,
    )
    completion.set_defaults(command=_command("completion", "completion"))
    completion.add_argument("shell", metavar="SHELL", choices=SHELLS, help=" or ".join(SHELLS))


def _add_wishes(wanted: Any) -> None:
    """Add the ways to say which mesh of a front is wanted."""
    wanted.add_argument("--triangles", type=_whole(1), metavar="N", help="the most accurate of at most N triangles")
    wanted.add_argument(
        "--max-error",
        type=_real(0),
        metavar="E",
        help="the smallest that deviates nowhere by more than E [model units]",
    )
    wanted.add_argument(
        "--mean-error",
        type=_real(0),
        metavar="E",
        help="the smallest with a mean deviation of at most E [model units]",
    )


def _add_weights(parser: Any) -> None:
    parser.add_argument(
        "--weights",
        metavar="NAME",
        help="per-vertex attribute of the file that says how much each vertex counts in the error (default: all alike)",
    )


def _add_output_options(parser: Any) -> None:
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress and no summary")
    parser.add_argument("--json", action="store_true", help="the summary as JSON")


def _add_worker_options(parser: Any) -> None:
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument("--jobs", type=_whole(1), metavar="N", help="processes (default: one for each core)")
    workers.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a Dask cluster that does the work, such as tcp://host:8786"
    )


def _add_checkpoint(parser: Any, what: str, besides: str) -> None:
    parser.add_argument(
        "--checkpoint",
        type=_interval,
        default=60.0,
        metavar="T|none",
        help=f"how often {what}, so that the same command goes on after a crash{besides} (default: 60s)",
    )


def _add_model_options(parser: argparse.ArgumentParser) -> None:
    model = parser.add_argument_group("how to read the model")
    model.add_argument(
        "--up",
        default="auto",
        metavar="auto|x|y|z|X,Y,Z",
        help="direction of the height (default: auto); --up=-z",
    )
    model.add_argument(
        "--patch",
        choices=("front",),
        help="take only the largest connected patch that faces up and does not overlap itself",
    )
    model.add_argument("--spacing", type=_spacing, metavar="D|DX,DY", help="of the samples of a height grid")
    model.add_argument("--nodata", type=_real(None), metavar="Z", help="height that means no sample in a height grid")
    model.add_argument(
        "--window", type=_window, metavar="COLUMN,ROW,COLUMNS,ROWS", help="the part of a height grid to take, from 0"
    )
    model.add_argument(
        "--max-edge",
        type=_positive,
        metavar="L",
        help="longest edge of a triangle of a point cloud, in the plane: keeps bays of its outline and holes open "
        "(default: its convex hull is covered)",
    )


class _Version(argparse.Action):
    def __call__(self, *_: Any, **__: Any) -> NoReturn:
        from importlib.metadata import version

        print(f"meshsimp {version('meshsimp-pymoo')}")
        raise SystemExit(0)


# ------------------------------------------------------------------------------------------------------ argument types


def _whole(least: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not re.fullmatch(r"[+-]?\d+", text) or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least {least}")
        return int(text)

    return parse


def _tile(text: str) -> int:
    return 0 if text == "none" else _whole(64)(text)


def _real(least: float | None) -> Callable[[str], float]:
    def parse(text: str) -> float:
        value = _number(text)
        if least is not None and value < least:
            raise argparse.ArgumentTypeError(f"{text!r} is below {least:g}")
        return value

    return parse


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return value


def _duration(text: str) -> float:
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([a-z]*)", text.strip().lower())
    if not match or match[2] not in SECONDS or float(match[1]) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a duration; write 60s, 10min or 1h")
    return float(match[1]) * SECONDS[match[2]]


def _interval(text: str) -> float | None:
    return None if text == "none" else _duration(text)


def _spacing(text: str) -> tuple[float, float]:
    values = [_number(part) for part in text.split(",")]
    if len(values) not in (1, 2) or min(values) <= 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not one or two positive numbers")
    return values[0], values[-1]


def _window(text: str) -> tuple[int, int, int, int]:
    parts = text.split(",")
    if len(parts) != 4:
        raise argparse.ArgumentTypeError(f"{text!r} is not COLUMN,ROW,COLUMNS,ROWS")
    column, row = (_whole(0)(part) for part in parts[:2])
    columns, rows = (_whole(2)(part) for part in parts[2:])
    return column, row, columns, rows


def _positive(text: str) -> float:
    if (value := _number(text)) <= 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not positive")
    return value


def _objectives(text: str) -> tuple[str, str]:
    if text.lower() not in MEASURES:
        raise argparse.ArgumentTypeError(f"{text!r} is no measure of the error; choose from {', '.join(MEASURES)}")
    return MEASURES[text.lower()], "triangles"


def _pin(text: str) -> str | list[int]:
    return text if text == "hull" else [_whole(0)(part) for part in text.split(",")]


def _mesh_count(text: str) -> int | None:
    if text == "all":
        return None
    return 0 if text == "none" else _whole(0)(text)
