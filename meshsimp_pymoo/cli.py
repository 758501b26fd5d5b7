"""The shell interface: parse, call the library, translate its errors into one line and an exit code.

======  ==============================================================================================
code    meaning
======  ==============================================================================================
0       done
1       the front is written, but no solution in it meets the wanted target
2       bad input: one line on stderr says what, where and the way out; nothing is written
130     interrupted (Ctrl-C): the front found so far is written, if there was one; of an experiment, all runs
        that were finished
======  ==============================================================================================

Anything unexpected keeps its traceback. Everything heavy is imported when a command runs, so that ``--help``
is quick.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from meshsimp_pymoo.geometry.error import Quality
    from meshsimp_pymoo.problem import MeshProblem

    BoolArray = npt.NDArray[np.bool_]

__all__ = ["main"]

OK, TARGET_MISSED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

# Four times the paper's budget: its 50 generations take a second at its sizes and leave much to gain.
DEFAULT_GENERATIONS = 200
SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}
# Presets that return a front; the weighted-sum ones return one solution.
ALGORITHMS = ("nsga2_v1", "nsga2_v2", "moead", "memetic")
FORMATS = ("ply", "obj", "stl", "off", "glb")

EPILOG = """\
MODEL is a mesh (PLY, OBJ, STL, OFF, GLB, ...), a height grid (.npy, .npz, .asc) or a built-in model such as
jacksboro:11, face:5000 or roof; `meshsimp info` without a MODEL lists the built-in ones.
"""


class UsageError(ValueError):
    """The command line cannot be understood."""


class _Parser(argparse.ArgumentParser):
    """Raises instead of printing the usage and exiting."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see {self.prog} --help)")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments; by default those of the process.

    Returns
    -------
    int
        The exit code; see the module's table.
    """
    try:
        args = _parser().parse_args(argv)
        with _warnings_as_lines(), _interruptible():
            return int(args.command(args))
    except KeyboardInterrupt:
        _say("interrupted; nothing is written")
        return INTERRUPTED
    except Exception as problem:
        if not isinstance(problem, _input_errors()):
            raise
        _say(" ".join(str(problem).split()))
        return BAD_INPUT


class _Interrupt:
    """Remembers Ctrl-C: some libraries swallow the exception while they are imported."""

    seen = False


@contextmanager
def _interruptible() -> Iterator[None]:
    """Note each Ctrl-C besides raising KeyboardInterrupt; see :func:`_stop_if_interrupted`."""

    def note(signum: int, frame: Any) -> None:
        _Interrupt.seen = True
        raise KeyboardInterrupt

    _Interrupt.seen = False
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _stop_if_interrupted() -> None:
    if _Interrupt.seen:
        raise KeyboardInterrupt


def _input_errors() -> tuple[type[Exception], ...]:
    """Errors that mean bad input; their modules are loaded only once there is an error to compare."""
    from meshsimp_pymoo.geometry.load import ModelError
    from meshsimp_pymoo.results import ResultError

    errors: tuple[type[Exception], ...] = (UsageError, ModelError, ResultError)
    if "meshsimp_pymoo.experiment.config" in sys.modules:
        from meshsimp_pymoo.experiment.config import ConfigError

        errors += (ConfigError,)
    return errors


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="meshsimp",
        description="Simplify an open mesh: not to one mesh, but to the whole trade-off between accuracy and size.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, dest=argparse.SUPPRESS, help="show the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    simplify = commands.add_parser(
        "simplify",
        help="write the front of simplified meshes of a model",
        description="Find the front of simplified meshes of MODEL and write it to a new folder: front.csv (the\n"
        "numbers), meshes/ (one mesh per solution), front.png, front.npz, run.json, and the chosen mesh if one\n"
        "is asked for.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    simplify.set_defaults(command=_simplify)
    simplify.add_argument("model", metavar="MODEL")
    simplify.add_argument("-o", "--output", metavar="OUT", required=True, help="folder to make")
    simplify.add_argument("--overwrite", action="store_true", help="replace results that are in OUT already")

    wanted = simplify.add_argument_group(
        "the mesh you want, written to OUT/chosen.ply beside the front"
    ).add_mutually_exclusive_group()
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
    wanted.add_argument("--pick", choices=("knee",), help="the best compromise: the knee of the front")

    budget = simplify.add_argument_group(
        f"how long to search (default: {DEFAULT_GENERATIONS} generations)"
    ).add_mutually_exclusive_group()
    budget.add_argument(
        "--time", type=_duration, metavar="T", help="60s, 10min, 1h (results then depend on the machine)"
    )
    budget.add_argument("--evaluations", type=_whole(1), metavar="N", help="stop after the generation that reaches N")
    budget.add_argument("--generations", type=_whole(1), metavar="N")

    search = simplify.add_argument_group("how to search")
    search.add_argument("--algorithm", choices=ALGORITHMS, default="nsga2_v1", help="preset (default: %(default)s)")
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

    output = simplify.add_argument_group("what is written and shown")
    output.add_argument("--format", choices=FORMATS, default="ply", help="of the meshes (default: %(default)s)")
    output.add_argument(
        "--meshes",
        type=_mesh_count,
        default=100,
        metavar="all|N|none",
        help="write at most N meshes, an even selection of the front (default: %(default)s)",
    )
    output.add_argument("--quiet", action="store_true", help="no progress and no summary")
    output.add_argument("--json", action="store_true", help="the summary as JSON")

    info = commands.add_parser(
        "info",
        help="say what a model is and whether it can be simplified",
        description="Say what MODEL is, whether it is a height field, and what would be refused. Without a "
        "MODEL: list the built-in models.",
        allow_abbrev=False,
    )
    info.set_defaults(command=_info)
    info.add_argument("model", metavar="MODEL", nargs="?")
    info.add_argument("--json", action="store_true", help="as JSON")
    _add_model_options(info)

    run = commands.add_parser(
        "run",
        help="do a whole comparison from a YAML file",
        description="Do all runs that CONFIG.yaml asks for and report on them: tables, figures, findings. What is "
        "finished is never done again, so an interrupted call is continued by the same command. See the "
        "configs folder of the source for examples.",
        allow_abbrev=False,
    )
    run.set_defaults(command=_run)
    run.add_argument("config", metavar="CONFIG.yaml")
    run.add_argument("-o", "--output", metavar="OUT", help="folder to make or to continue (default: CONFIG_results)")
    run.add_argument("--jobs", type=_whole(1), metavar="N", help="processes (default: one for each core)")
    run.add_argument(
        "--models", metavar="FOLDER", help="where the model files are, in place of the configuration's folder"
    )
    run.add_argument("--quiet", action="store_true", help="no progress and no summary")

    report = commands.add_parser(
        "report",
        help="make the report of a comparison anew",
        description="Make the tables, figures and findings of an experiment anew, from its stored results alone.",
        allow_abbrev=False,
    )
    report.set_defaults(command=_report)
    report.add_argument("output", metavar="OUT", help="the folder of an experiment, from `meshsimp run`")
    report.add_argument("--quiet", action="store_true", help="no progress and no summary")
    return parser


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


def _spacing(text: str) -> tuple[float, float]:
    values = [_number(part) for part in text.split(",")]
    if len(values) not in (1, 2) or min(values) <= 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not one or two positive numbers")
    return values[0], values[-1]


def _pin(text: str) -> str | list[int]:
    return text if text == "hull" else [_whole(0)(part) for part in text.split(",")]


def _mesh_count(text: str) -> int | None:
    if text == "all":
        return None
    return 0 if text == "none" else _whole(0)(text)


# ------------------------------------------------------------------------------------------------------------ simplify


@dataclass
class _Found:
    """What a search came back with: unique solutions sorted by triangles, then error."""

    kept: BoolArray
    quality: list[Quality]
    generations: int
    evaluations: int
    seconds: float
    interrupted: bool


def _simplify(args: argparse.Namespace) -> int:
    from meshsimp_pymoo.results import claim_output, write_front

    folder = claim_output(args.output, overwrite=args.overwrite)
    problem = _mesh_problem(args)
    _refuse_impossible(args, problem)
    found = _search(args, problem)
    if found is None:
        _say("interrupted before the first generation was complete; nothing is written")
        return INTERRUPTED

    kept, quality = found.kept, found.quality
    knee = _knee(quality)
    chosen = _choose(args, quality, knee)

    def faces(row: int) -> Any:
        return problem.simplify(kept[row]).faces

    def draw(unfinished: Path) -> None:
        from meshsimp_pymoo.report.figures import front_figure

        F = [[q.error, q.triangles] for q in quality]
        shown = _shown([q.triangles for q in quality], chosen)
        figure = front_figure(problem.model, F, [(row, faces(row)) for row in shown], knee=knee, chosen=chosen)
        figure.savefig(unfinished / "front.png")

    settings = {
        key: value
        for key, value in vars(args).items()
        if key not in ("command", "output", "overwrite", "quiet", "json", "model", "seed")
    }
    if not (args.time or args.evaluations):
        settings["generations"] = args.generations or DEFAULT_GENERATIONS
    run = {
        "settings": settings,
        "seed": args.seed,
        "generations": found.generations,
        "evaluations": found.evaluations,
        "seconds": round(found.seconds, 3),
        "interrupted": found.interrupted,
    }
    write_front(
        folder,
        problem.model,
        quality,
        kept,
        faces=faces,
        meshes=args.meshes,
        mesh_format=args.format,
        chosen=chosen,
        run=run,
        extra=draw,
        overwrite=args.overwrite,
    )
    _summarise(args, problem, found, chosen)
    if found.interrupted:
        _say(f"interrupted after {found.generations} generations; {folder} holds the front so far")
        return INTERRUPTED
    if chosen is None and _target(args):
        _say(_missed(args, quality, folder))
        return TARGET_MISSED
    return OK


def _mesh_problem(args: argparse.Namespace) -> MeshProblem:
    from meshsimp_pymoo.problem import MeshProblem

    return MeshProblem(
        args.model,
        spacing=args.spacing,
        nodata=args.nodata,
        footprint=args.footprint,
        outside=args.outside,
        up=args.up,
        patch=args.patch,
        pin=args.pin,
        n_threads=args.threads,
    )


def _search(args: argparse.Namespace, problem: MeshProblem) -> _Found | None:
    """Run the algorithm to its budget or to Ctrl-C; None if there is no front yet."""
    import numpy as np
    from pymoo.termination.max_eval import MaximumFunctionCallTermination
    from pymoo.termination.max_gen import MaximumGenerationTermination
    from pymoo.termination.max_time import TimeBasedTermination

    from meshsimp_pymoo.algorithms import PRESETS
    from meshsimp_pymoo.geometry.error import ERROR, TRIANGLES, as_quality

    if args.time is not None:
        termination: Any = TimeBasedTermination(args.time)
    elif args.evaluations is not None:
        termination = MaximumFunctionCallTermination(args.evaluations)
    else:
        termination = MaximumGenerationTermination(args.generations or DEFAULT_GENERATIONS)
    algorithm = PRESETS[args.algorithm](pop_size=args.population)
    algorithm.setup(problem, termination=termination, seed=args.seed)
    start = time.perf_counter()
    front, generations, interrupted = None, 0, False
    with _progress(args, problem.model.name) as show:
        try:
            while algorithm.has_next():
                _stop_if_interrupted()
                algorithm.next()
                front, generations = algorithm.opt, algorithm.n_iter - 1
                show(algorithm.termination.perc, algorithm.evaluator.n_eval, front)
        except KeyboardInterrupt:
            interrupted = True
    if front is None:
        return None
    # Both ends of what is possible are known without a search: all vertices, and the pinned ones alone.
    ends = np.array([np.ones(problem.n_var, dtype=bool), problem.pinned])
    kept = np.vstack([np.asarray(front.get("X"), dtype=bool) | problem.pinned, ends])
    table = problem.evaluate_subsets(kept)
    is_mesh = table[:, TRIANGLES] > 0
    if not is_mesh.any():
        raise UsageError(
            f"{problem.model.name}: none of {algorithm.evaluator.n_eval} subsets of its vertices spans a triangle "
            "inside its outline; search longer, or pass --footprint hull"
        )
    kept, table = kept[is_mesh], table[is_mesh]
    F, first = np.unique(table[:, [TRIANGLES, ERROR]], axis=0, return_index=True)  # sorted by triangles, then error
    better = np.r_[True, F[1:, 1] < np.minimum.accumulate(F[:-1, 1])]
    first = first[better]
    return _Found(
        kept=kept[first],
        quality=[as_quality(row, problem.n_var) for row in table[first]],
        generations=generations,
        evaluations=algorithm.evaluator.n_eval,
        seconds=time.perf_counter() - start,
        interrupted=interrupted,
    )


def _refuse_impossible(args: argparse.Namespace, problem: MeshProblem) -> None:
    """Stop before the search if no subset of the vertices is a mesh, or none can meet the target."""
    import numpy as np

    from meshsimp_pymoo.geometry.error import as_quality

    table = problem.evaluate_subsets(np.array([np.ones(problem.n_var, dtype=bool), problem.pinned]))
    whole, bare = (as_quality(row, problem.n_var) for row in table)
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


def _target(args: argparse.Namespace) -> bool:
    return any(value is not None for value in (args.triangles, args.max_error, args.mean_error))


def _choose(args: argparse.Namespace, quality: Sequence[Quality], knee: int) -> int | None:
    """Return the row of the solution that was asked for; None if none was, or none meets the target."""
    if args.pick == "knee":
        return knee
    if args.triangles is not None:
        fitting = [row for row, q in enumerate(quality) if q.triangles <= args.triangles]
        return min(fitting, key=lambda row: (quality[row].error, row), default=None)
    for field in ("max_error", "mean_error"):
        limit = getattr(args, field)
        if limit is not None:
            return next((row for row, q in enumerate(quality) if getattr(q, field) <= limit), None)
    return None


def _knee(quality: Sequence[Quality]) -> int:
    """Return the knee: the solution farthest below the line between the ends of the front, scaled to [0, 1].

    The knee of I. Das, "On characterizing the knee of the Pareto curve", Structural Optimization 18, 1999.
    Unlike the outliers of :func:`meshsimp_pymoo.analysis.knees`, there is always exactly one.
    """
    import numpy as np

    F = np.array([[q.error, q.triangles] for q in quality], dtype=float)
    extent = np.ptp(F, axis=0)
    scaled = (F - F.min(axis=0)) / np.where(extent > 0, extent, 1.0)
    return int(np.argmin(scaled.sum(axis=1).round(12)))


def _missed(args: argparse.Namespace, quality: Sequence[Quality], folder: Path) -> str:
    if args.triangles is not None:
        reached, wanted = f"{quality[0].triangles} triangles", f"at most {args.triangles}"
    else:
        field = "max_error" if args.max_error is not None else "mean_error"
        reached = f"{field.replace('_', ' ')} {min(getattr(q, field) for q in quality):.4g}"
        wanted = f"at most {getattr(args, field):g}"
    return (
        f"{folder} holds a front, but no chosen mesh: its best is {reached}, and {wanted} was asked for; "
        "search longer (--generations, --time)"
    )


def _shown(triangles: Sequence[int], chosen: int | None) -> list[int]:
    """Return up to three rows to draw as meshes, spread over the sizes; the chosen one among them."""
    import numpy as np

    span = np.log(np.asarray(triangles, dtype=float))
    wanted = span[0] + (span[-1] - span[0]) * np.array([0.2, 0.5, 0.8])
    rows = [int(np.argmin(np.abs(span - level))) for level in wanted]
    if chosen is not None and chosen not in rows:
        rows[int(np.argmin(np.abs(wanted - span[chosen])))] = chosen
    return sorted(set(rows))


# ---------------------------------------------------------------------------------------------------------------- info


def _info(args: argparse.Namespace) -> int:
    from meshsimp_pymoo import datasets

    if args.model is None:
        lines = datasets.describe()
        print(json.dumps(lines, indent=2) if args.json else "\n".join(lines.values()))
        return OK
    from dataclasses import asdict

    import numpy as np

    from meshsimp_pymoo.geometry.load import ModelError
    from meshsimp_pymoo.geometry.orient import front_patch, surface_facts, up_direction, upright_rotation

    source = datasets.find_source(args.model, spacing=args.spacing, nodata=args.nodata)
    if args.patch == "front":
        source = front_patch(source, args.up)
    used = source.points[np.unique(source.faces)]
    low, extent = used.min(axis=0), np.ptp(used, axis=0)
    content: dict[str, Any] = {
        "name": source.name,
        "vertices": len(used),
        "triangles": len(source.faces),
        "unused_vertices": len(source.points) - len(used),
        "low": low.tolist(),
        "extent": extent.tolist(),
        "attributes": sorted(source.attributes),
    }
    rows = {
        "vertices": f"{len(used):,}",
        "triangles": f"{len(source.faces):,}",
        "extent": " x ".join(f"{value:.6g}" for value in extent) + " [file units]",
        "from": ", ".join(f"{value:.10g}" for value in low),
        "attributes": ", ".join(sorted(source.attributes)) or "none",
    }
    if len(used) < len(source.points):
        rows["vertices"] += f" ({len(source.points) - len(used):,} more belong to no face)"
    try:
        up = up_direction(source, args.up)
    except ModelError as problem:
        refusal: str | None = str(problem)
    else:
        facts = surface_facts(source, source.points @ upright_rotation(up).T)
        refusal = facts.refusal
        content |= {"up": up.tolist(), "fold_share": facts.fold_share} | asdict(facts)
        flipped = " (its faces are wound the other way)" if facts.flipped else ""
        rows |= {
            "up": ", ".join(f"{value:.6g}" for value in up) + flipped,
            "seen from there": f"{facts.net_share:.1%} of the area",
            "parts": f"{facts.components}",
            "border": f"{facts.border_edges:,} edges, {facts.border_loops} closed loop(s)",
            "vertical": f"{facts.vertical_faces:,} faces",
            "folded over": f"{facts.folds + facts.hidden:,} faces ({facts.fold_share:.2%})",
        }
    rows["verdict"] = "refused" if refusal else "usable: an open height field"
    if args.json:
        print(json.dumps(content | {"refusal": refusal}, indent=2))
    else:
        print(source.name)
        print("\n".join(f"  {label:<16}{text}" for label, text in rows.items()))
    if refusal:
        _say(refusal)
        return BAD_INPUT
    return OK


# ---------------------------------------------------------------------------------------------------------- experiments


def _run(args: argparse.Namespace) -> int:
    import os

    from meshsimp_pymoo.experiment.config import read_experiment_file
    from meshsimp_pymoo.experiment.runner import run_experiment

    experiment = read_experiment_file(args.config, folder=args.models)
    out = Path(args.output or f"{Path(args.config).stem}_results")
    jobs = args.jobs or os.cpu_count() or 1
    start = time.perf_counter()
    try:
        with _bar(args.quiet, "runs") as show:
            done = run_experiment(
                experiment, out, jobs=jobs, progress=lambda work, total, text: show(work / max(total, 1e-9), text)
            )
        seconds = time.perf_counter() - start
        if not args.quiet:
            print(f"{out}: {done.finished:,} runs done in {seconds:.0f} s, {done.reused:,} were there already")
        return _report(args, out)
    except KeyboardInterrupt:
        _say(f"interrupted; the finished runs are in {out}, the same command does the rest")
        return INTERRUPTED


def _report(args: argparse.Namespace, out: Path | None = None) -> int:
    from meshsimp_pymoo.report.experiment import write_report

    out = out or Path(args.output)
    with _bar(args.quiet, "report") as show:
        study = write_report(out, progress=lambda done, total, text: show(done / max(total, 1), text))
    if not args.quiet:
        left_out = f", {len(study.missing)} runs are missing" if study.missing else ""
        print(f"written: {out}: findings.md, tables, figures, times.csv ({len(study.all_runs):,} runs{left_out})")
    return OK


# ------------------------------------------------------------------------------------------------------- what is shown


def _summarise(args: argparse.Namespace, problem: MeshProblem, found: _Found, chosen: int | None) -> None:
    from dataclasses import asdict

    model, quality, folder = problem.model, found.quality, Path(args.output)
    chosen_path = None if chosen is None else folder / f"chosen.{args.format}"
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
            else {"mesh": str(chosen_path), "solution": chosen, **asdict(quality[chosen])},
            "evaluations": found.evaluations,
            "seconds": round(found.seconds, 3),
            "seed": args.seed,
        }
        print(json.dumps(summary, indent=2))
        return
    if args.quiet:
        return
    few, many = quality[0], quality[-1]
    print(f"{model.name}: {model.n_vertices:,} vertices, {len(model.faces):,} triangles")
    print(
        f"front: {len(quality)} solutions, {few.triangles:,} to {many.triangles:,} triangles, "
        f"mean error {few.mean_error:.4g} to {many.mean_error:.4g} "
        f"({found.evaluations:,} evaluations, {found.seconds:.1f} s, seed {args.seed})"
    )
    if chosen is not None:
        q = quality[chosen]
        print(
            f"chosen: {chosen_path} (solution {chosen}): {q.triangles:,} triangles, error {q.error:.6g}, "
            f"mean {q.mean_error:.4g}, RMS {q.rms_error:.4g}, max {q.max_error:.4g}, uncovered {q.uncovered}"
        )
    written = len(list(folder.glob("meshes/*")))
    print(f"written: {folder}: front.csv, front.png" + (f", {written} in meshes" if written else ""))


@contextmanager
def _progress(args: argparse.Namespace, name: str) -> Iterator[Callable[[float, int, Any], None]]:
    """Yield what shows (share done, evaluations, front): a bar on a terminal, elsewhere nothing."""
    if args.quiet or not sys.stderr.isatty():
        yield lambda share, evaluations, front: None
        return
    with _bar(args.quiet, name) as draw:

        def show(share: float, evaluations: int, front: Any) -> None:
            sizes = front.get("F")[:, 1]
            span = f"{sizes.min():.0f}-{sizes.max():.0f} triangles"
            draw(share, f"{evaluations:,} evaluations, {len(front)} solutions, {span}")

        yield show


@contextmanager
def _bar(quiet: bool, name: str) -> Iterator[Callable[[float, str], None]]:
    """Yield what shows (share done, what is being done): a bar on a terminal, elsewhere nothing."""
    if quiet or not sys.stderr.isatty():
        yield lambda share, state: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[state]}"),
    )
    # steps of an experiment can be a minute apart: the speed is that of the last ten minutes
    with Progress(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=600) as bar:
        task = bar.add_task(name, total=1.0, state="")

        def show(share: float, state: str) -> None:
            bar.update(task, completed=min(share, 1.0), state=state)

        yield show


@contextmanager
def _warnings_as_lines() -> Iterator[None]:
    """Print our own warnings as one line each; others as usual."""
    show_others = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *rest: Any, **kwargs: Any) -> None:
        if category.__module__.partition(".")[0] == "meshsimp_pymoo":
            _say("warning: " + " ".join(str(message).split()))
        else:
            show_others(message, category, *rest, **kwargs)

    with warnings.catch_warnings():
        warnings.showwarning = show
        warnings.filterwarnings("always", module=r"meshsimp_pymoo(\.|$)")
        yield


def _say(line: str) -> None:
    print(f"meshsimp: {line}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
