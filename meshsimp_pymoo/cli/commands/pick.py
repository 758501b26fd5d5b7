"""``meshsimp pick``: one mesh out of a stored front."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from meshsimp_pymoo.cli.requests import Wish
    from meshsimp_pymoo.front import Front, FrontSolution

# By which factor in triangles a mesh differs from what was searched that is said to be far from it.
FAR = 2
HELP = "take one mesh out of a front that is stored"
DESCRIPTION = """\
Take one mesh out of the front in OUT, which `meshsimp simplify` wrote. No search
is repeated: a mesh that is stored is copied, others are made from the model,
which must be the very same."""
EXAMPLES = """\
examples:
  meshsimp pick out --triangles 500 -o small.ply
      the most accurate of at most 500 triangles
  meshsimp pick out --max-error 0.1 -o small.obj
      the smallest that deviates nowhere by more than 0.1
  meshsimp pick out --triangles 2000 --solid 5 -o print.stl
      that mesh as a solid to print, its base 5 below the lowest point
  meshsimp pick out --knee
      only say what the best compromise is
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_shown, add_solid, add_wishes, whole
    from meshsimp_pymoo.formats.table import written_suffixes

    parser.add_argument("front", metavar="OUT", help="the folder of a front")
    wanted = parser.add_argument_group("which one (several limits: all of them hold)")
    add_wishes(wanted)
    wanted.add_argument("--knee", action="store_true", help="the best compromise: the knee of the front")
    wanted.add_argument("--solution", type=whole(0), metavar="K", help="the one of this number in front.csv")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help=f"mesh to write; its suffix is its format: {', '.join(written_suffixes())} (default: nothing is written)",
    )
    parser.add_argument(
        "--compress",
        action="store_true",
        help="compress a GLB (Draco): vertices move by at most a twentieth of the mean error",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace FILE if it exists")
    add_solid(parser, "the mesh")
    parser.add_argument("--model", metavar="MODEL", help="the original, if it is no longer where it was")
    add_shown(parser)


def run(args: argparse.Namespace) -> int:
    """Say which solution of the front in ``args.front`` is meant, and write its mesh if a file is named."""
    from meshsimp_pymoo.cli.arguments import wishes_of
    from meshsimp_pymoo.cli.preparing import said_when_compiling
    from meshsimp_pymoo.cli.requests import Wish
    from meshsimp_pymoo.errors import UsageError
    from meshsimp_pymoo.files import claim_file
    from meshsimp_pymoo.formats.table import written_suffixes

    wish, shown = Wish(wishes_of(args), args.knee), {"quiet": args.quiet, "as_json": args.json}
    if not wish.choices(args.solution):
        raise UsageError("which solution is wanted? say limits, such as --triangles 500, or --knee, or --solution K")
    if args.solid is not None and args.output is None:
        raise UsageError("--solid is of a file that is written; name it (-o FILE), or leave --solid out")
    path = None if args.output is None else claim_file(args.output, written_suffixes(), overwrite=args.overwrite)
    if args.compress and path is None:
        raise UsageError("--compress is of the mesh that is written; name its file (-o FILE.glb)")
    with said_when_compiling(args.quiet):
        how = {"overwrite": args.overwrite, "solid": args.solid}
        return _pick(args.front, args.model, wish, args.solution, path, how, compress=args.compress, **shown)


def _pick(
    folder: str,
    model: str | None,
    wish: Wish,
    number: int | None,
    path: Path | None,
    how: Mapping[str, Any],
    *,
    compress: bool,
    quiet: bool,
    as_json: bool,
) -> int:
    import json

    from meshsimp_pymoo.cli.arguments import numbered
    from meshsimp_pymoo.cli.results import triangles_of
    from meshsimp_pymoo.cli.terminal import OK, TARGET_MISSED, described, in_numbers, say, solid_in_words, tell
    from meshsimp_pymoo.front import Front

    front = Front.load(folder, model=model)
    wish = wish.among(lambda: triangles_of(front.run["model"]))
    solution: Any
    if number is not None:
        solution, missed = front[numbered(folder, len(front), number)], ""
    else:
        solution, missed = wish.of(front)
    if solution is None:
        say(f"{folder}: {missed}; nothing is written")
        return TARGET_MISSED
    moved: dict[str, float] = {}
    closed: dict[str, Any] = {}
    if path is not None:
        if compress:
            moved["moved_by_at_most_m"] = solution.save_compressed(path, **how)
        else:
            solution.save(path, **how)
        thickness = how["solid"]
        closed = {} if thickness is None else {"solid": {"thickness": thickness, **solution.solid(thickness).numbers}}
    if note := _how_far(front, folder, model, solution, wish):
        say(f"note: {note}")
    stored = solution.front is front  # else it was made between two that are
    if as_json:
        mesh, number = (None if path is None else str(path)), solution.solution if stored else None
        said = {"mesh": mesh, "solution": number, "free": solution.free, **moved}
        said |= in_numbers(solution.quality) | closed
        tell(json.dumps(said, indent=2))
    elif not quiet:
        which = f"solution {solution.solution}" if stored else "between two solutions"
        tell(f"{which} of {folder}{', free' * solution.free}: {described(solution.quality, front.unit)}")
        if closed:
            tell(f"solid: {solid_in_words(closed['solid'], front.unit)}")
        off = f" (compressed; vertices moved by at most {moved['moved_by_at_most_m']:.2g} m)" if moved else ""
        tell(f"written: {path}{off}" if path else "nothing is written; name a file with -o")
    return OK


def _how_far(front: Front, folder: str, model: str | None, solution: FrontSolution, wish: Wish) -> str:
    """Say, where a front was searched around a wish, that a solution is far from it, and how to search for this one."""
    from dataclasses import asdict

    from meshsimp_pymoo.cli.results import nearest
    from meshsimp_pymoo.files import as_argument
    from meshsimp_pymoo.search.wishes import in_words, shortfall

    limits = front.run.get("wish")
    if not limits:
        return ""
    own, answer = solution.triangles, nearest(front, limits)
    searched = {answer.triangles}
    if shortfall(asdict(answer.quality), limits) > 0.0:  # then each of them was searched for, too
        searched |= {nearest(front, {name: limit}).triangles for name, limit in limits.items()}
    is_whole = solution.quality.vertices == front.run["model"].get("vertices")
    if own in searched or (not is_whole and any(near <= FAR * own <= FAR**2 * near for near in searched)):
        return ""
    around = f"{folder} was searched around {in_words(limits, front.unit)}"
    said = f"this is the original itself; {around}" if is_whole else f"{around}; far from it the meshes are poor"
    if is_whole and not wish.spelled:
        return said
    wanted, what = (wish.spelled, "wish") if wish.spelled else (f"--triangles {own}", "size")
    way = f"meshsimp simplify {as_argument(model or front.name)} {wanted}"
    return f"{said}. For this {what}: {way}{_with_options(front)}"


def _with_options(front: Front) -> str:
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.settings import plain
    from meshsimp_pymoo.surface.rules import Rules

    usual = plain(Options()) | plain(Rules())
    made = (front.run.get("options") or {}) | (front.run.get("rules") or {})
    others = any(made.get(name, value) != value for name, value in usual.items() if name != "measure")
    return ", with the options of then" * others
