"""``meshsimp quality``: the statement of quality of one mesh, to read, to print and to sign."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from meshsimp_pymoo.cli.requests import Wish
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.report.statement import QualityStatement
    from meshsimp_pymoo.surface.rules import Rules

HELP = "state the accuracy of one mesh: LE90, bias, coverage, map of errors"
DESCRIPTION = """\
State how accurate one mesh is, in the words of surveyors: of the front in OUT,
which `meshsimp simplify` wrote, or with --mesh any tool's mesh of MODEL. Written
to a new folder: quality.json (all numbers), quality.html (a page to print and
sign) and, of a raster, residuals.tif (original minus mesh at every sample)."""
EXAMPLES = """\
examples:
  meshsimp quality dem_front
      the chosen mesh, else the knee: to dem_front/quality
  meshsimp quality dem_front --triangles 500 -o q500
      the most accurate of at most 500 triangles
  meshsimp quality dem.tif --mesh decimated.ply
      a mesh of another tool
"""
# Beside what a vertex outside costs, what of the rules decides the numbers of any mesh.
RULES = ("outside", "weights", "break_lines", "line_tolerance")


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_model, add_settings, add_shown, add_wishes, whole
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.surface.rules import Rules

    parser.add_argument("--mesh", metavar="OTHER", help="a simplified mesh of MODEL, in the same frame and units")
    wanted = parser.add_argument_group(
        "which mesh of OUT (several limits: all of them hold; default: chosen, else knee)"
    )
    add_wishes(wanted)
    wanted.add_argument("--knee", action="store_true", help="the best compromise: the knee of the front")
    wanted.add_argument("--solution", type=whole(0), metavar="K", help="the one of this number in front.csv")
    wanted.add_argument("--refitted", action="store_true", help="with its vertices where its error is least")
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", help="folder to make (default: OUT/quality, or OTHER_quality, here)"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace a statement that is in FOLDER already")
    parser.add_argument(
        "--no-residuals", dest="residuals", action="store_false", help="do not write the raster of the residuals"
    )
    parser.add_argument(
        "--model", dest="original", metavar="MODEL", help="the original of OUT, if it is no longer where it was"
    )
    add_model(parser, Options, help="the folder of a front; with --mesh the original")
    add_settings(parser.add_argument_group("what counts, with --mesh"), Rules, only=RULES, outside="nearest")
    add_shown(parser)


def run(args: argparse.Namespace) -> int:
    """Measure a mesh of the front in ``args.model``, or with ``args.mesh`` any mesh, and state its quality."""
    from pathlib import Path

    from meshsimp_pymoo.cli.arguments import settings_from, wishes_of
    from meshsimp_pymoo.cli.preparing import said_when_compiling
    from meshsimp_pymoo.cli.requests import Wish
    from meshsimp_pymoo.cli.terminal import OK, TARGET_MISSED, place_for_matplotlib, say
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.report.statement import claim_folder
    from meshsimp_pymoo.storage import QUALITY
    from meshsimp_pymoo.surface.rules import Rules

    wish, number = Wish(wishes_of(args), args.knee), args.solution
    said = wish.choices(number)
    options, rules = settings_from(args, Options), settings_from(args, Rules)
    of_front = args.mesh is None
    _refuse(args, options, rules, said)
    usual = Path(args.model) / QUALITY if of_front else Path(f"{Path(args.mesh).stem}_quality")
    folder = usual if args.output is None else Path(args.output)
    claim_folder(folder, overwrite=args.overwrite)
    with said_when_compiling(args.quiet):
        if of_front:
            statement, missed = _of_front(args.model, args.original, wish, number, refitted=args.refitted)
        else:
            statement, missed = _of_mesh(args.model, options, rules, args.mesh), ""
        if statement is None:
            say(f"{args.model}: {missed}; nothing is written")
            return TARGET_MISSED
        with place_for_matplotlib(folder):
            statement.save(folder, overwrite=args.overwrite, residuals=args.residuals)
    _tell(statement, folder, quiet=args.quiet, as_json=args.json)
    return OK


def _refuse(args: argparse.Namespace, options: Options, rules: Rules, said: list[str]) -> None:
    """Refuse what describes a model where a front is meant, and what chooses one of a front's where there is none."""
    from pathlib import Path

    from meshsimp_pymoo.errors import UsageError
    from meshsimp_pymoo.settings import plain

    if args.mesh is not None:
        others = [*said, *(["--refitted"] * args.refitted), *(["--model"] * (args.original is not None))]
        if others:
            raise UsageError(
                f"{others[0]} is for the meshes of a front, and --mesh names another; leave one of them out"
            )
        return
    if not (Path(args.model) / "front.csv").is_file():
        raise UsageError(
            f"{args.model}: holds no front (front.csv); name the folder that simplify -o made, or a mesh of this model "
            "(--mesh OTHER)"
        )
    usual = plain(type(options)()) | plain(type(rules)())
    given = [name for name, value in (plain(options) | plain(rules)).items() if value != usual[name]]
    if given:
        option = f"--{given[0].replace('_', '-')}"
        raise UsageError(f"{args.model}: is measured as it was made; leave {option} out")


def _of_front(
    out: str, model: str | None, wish: Wish, number: int | None, *, refitted: bool
) -> tuple[QualityStatement | None, str]:
    """Return the statement of a mesh of a front; None and why, if none is within the limits."""
    from dataclasses import replace
    from pathlib import Path

    from meshsimp_pymoo.cli.arguments import numbered
    from meshsimp_pymoo.cli.results import triangles_of
    from meshsimp_pymoo.front import Front

    front = Front.load(out, model=model)
    wish = wish.among(lambda: triangles_of(front.run["model"]))
    solution: Any
    missed = ""
    if wish.knee or wish.limits:
        solution, missed = wish.of(front)
    else:
        chosen = front.run.get("chosen") if number is None else numbered(out, len(front), number)
        solution = front.knee() if chosen is None else front[chosen]
    if solution is None:
        return None, missed
    statement = solution.accuracy(refitted=refitted)
    if solution.front is not front:  # which is none of the front's
        mesh = statement.mesh | {"name": f"{Path(front.name).name}, between two solutions", "solution": None}
        statement = replace(statement, mesh=mesh)
    return statement, missed


def _of_mesh(model: str, options: Options, rules: Rules, other: str) -> QualityStatement:
    """Return the statement of any mesh of a model."""
    from meshsimp_pymoo.errors import UsageError
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.opening import open_model, open_source
    from meshsimp_pymoo.report.statement import stated
    from meshsimp_pymoo.surface.accuracy import compare_any
    from meshsimp_pymoo.surface.kinds import surface_of

    surface = surface_of(open_model(model, options), rules)
    source = open_source(other, Options(repair="none", scale="none"))
    try:
        compared = compare_any(surface, source.points, source.faces)
    except ValueError as problem:
        raise UsageError(f"{other}: cannot be measured against {surface.model.name}: {problem}") from None
    return stated(compared, mesh={"name": other})


def _tell(statement: QualityStatement, folder: Path, *, quiet: bool, as_json: bool) -> None:
    import json

    from meshsimp_pymoo.cli.terminal import tell, there
    from meshsimp_pymoo.report.statement import DATA, PAGE, RESIDUALS

    if as_json:
        tell(json.dumps({"folder": str(folder), **statement.as_data()}, indent=2))
    elif not quiet:
        tell(statement.sentence)
        tell("\n".join([statement.in_words, *statement.left_out]))
        tell(f"written: {folder}: {there(folder, DATA, PAGE, RESIDUALS)}")
