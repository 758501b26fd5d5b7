"""``meshsimp levels``: a stored front as levels of detail."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from meshsimp_pymoo.front import Front

HELP = "write a front that is stored as levels of detail"
DESCRIPTION = """\
Write some meshes of the front in OUT, which `meshsimp simplify` wrote, as levels of
detail: the finest one and others, each of a quarter of its triangles, each with its
geometric error, so that a viewer shows the coarsest that looks the same. No search
is repeated, but meshes that are not stored are made from the model, which must be
the very same."""
EXAMPLES = """\
examples:
  meshsimp levels out -o levels
      level-0.ply, level-1.ply, ... and levels.json, which says the error of each
  meshsimp levels out -o model.glb
      all of them in one glTF (MSFT_lod)
  meshsimp levels out -o tiles --format 3d-tiles --triangles 20000 2000 200
      a tileset with three levels, for Cesium
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_shown, count_or_share, format_name, typed, whole
    from meshsimp_pymoo.formats.table import written_formats
    from meshsimp_pymoo.settings import Real

    parser.add_argument("front", metavar="OUT", help="the folder of a front")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FOLDER|FILE.glb",
        required=True,
        help="the folder to make, with a file for each level and levels.json; or one GLB with all of them (MSFT_lod)",
    )
    wanted = parser.add_argument_group(
        "which levels",
        "By default from the most accurate mesh of the front on, or from the one that it\n"
        "was searched for, each of at most a quarter of the triangles of the one before.",
    ).add_mutually_exclusive_group()
    wanted.add_argument("--levels", type=whole(1), metavar="N", help="at most so many, the finest first")
    wanted.add_argument(
        "--triangles",
        type=typed(count_or_share),
        nargs="+",
        metavar="N",
        help="for each N the most accurate of at most N triangles, or of that share of the original's (10%%)",
    )
    wanted.add_argument(
        "--max-error",
        type=typed(Real(0).from_text),
        nargs="+",
        metavar="E",
        help="for each E the smallest that deviates nowhere by more than E [model units]",
    )
    parser.add_argument(
        "--format",
        type=format_name,
        metavar="NAME",
        help=f"of a folder: {', '.join(written_formats())}, or 3d-tiles: a tileset.json with a GLB for each level "
        "(default: ply)",
    )
    parser.add_argument(
        "--compress",
        action="store_true",
        help="compress GLB (Draco): vertices move by at most a twentieth of the mean error of their mesh",
    )
    parser.add_argument("--refit", action="store_true", help="move the vertices of each to where its error is least")
    parser.add_argument("--overwrite", action="store_true", help="replace levels that exist")
    parser.add_argument("--model", metavar="MODEL", help="the original, if it is no longer where it was")
    add_shown(parser)


def run(args: argparse.Namespace) -> int:
    """Write the levels that ``args`` names."""
    from pathlib import Path

    from meshsimp_pymoo.cli.preparing import said_when_compiling
    from meshsimp_pymoo.errors import UsageError, meant
    from meshsimp_pymoo.files import claim_file
    from meshsimp_pymoo.formats.table import format_to_write
    from meshsimp_pymoo.levels import GLB, claim_levels, forms

    path, suffixes = Path(args.output), format_to_write(GLB).suffixes
    if args.format is not None and args.format not in forms():
        raise UsageError(
            f"--format {args.format} is unknown{meant(args.format, forms())}; choose one of {', '.join(forms())}"
        )
    if path.suffix.lower() in suffixes:
        if args.format not in (None, GLB):
            raise UsageError(f"--format {args.format} does not go with the file {path}; name a folder for it")
        claim_file(path, suffixes, overwrite=args.overwrite)
    else:
        claim_levels(path, overwrite=args.overwrite)
    with said_when_compiling(args.quiet):
        return _write(args, path)


def _write(args: argparse.Namespace, path: Path) -> int:
    import json

    from meshsimp_pymoo.cli.arguments import Share
    from meshsimp_pymoo.cli.results import triangles_of
    from meshsimp_pymoo.cli.terminal import OK, TARGET_MISSED, say, tell
    from meshsimp_pymoo.errors import Missed
    from meshsimp_pymoo.front import Front
    from meshsimp_pymoo.levels import save_levels
    from meshsimp_pymoo.search.wishes import in_words

    front = Front.load(args.front, model=args.model)
    sizes = args.triangles and [
        size.of(triangles_of(front.run["model"])) if isinstance(size, Share) else size for size in args.triangles
    ]
    try:
        levels = front.levels(args.levels, triangles=sizes, max_error=args.max_error)
    except Missed as missed:
        say(f"{args.front}: {missed}; nothing is written")
        return TARGET_MISSED
    if wish := front.run.get("wish"):
        say(
            f"note: {args.front} was searched around {in_words(wish, front.unit)}; far from it the meshes are poor; a "
            "search without a wish is for all sizes"
        )
    asked = len(sizes or args.max_error or ())
    if len(levels) < asked:
        say(f"note: {asked - len(levels)} of {asked} levels are the same meshes as others, and left out")
    elif args.levels is not None and len(levels) < args.levels:
        say(f"note: the front has {len(levels)} levels; {args.levels} were asked for")
    record = save_levels(
        front,
        path,
        levels,
        form=args.format or "ply",
        compress=args.compress,
        refit=args.refit,
        overwrite=args.overwrite,
    )
    if args.json:
        tell(json.dumps({"output": str(path)} | record, indent=2))
    elif not args.quiet:
        _tell(front, record, path)
    return OK


def _tell(front: Front, record: Mapping[str, Any], path: Path) -> None:
    """Say what was written."""
    from meshsimp_pymoo.cli.terminal import tell
    from meshsimp_pymoo.surface.measures import LENGTH
    from meshsimp_pymoo.surface.units import in_unit

    unit = in_unit(front.unit)
    for level in record["levels"]:
        kind = f"solution {level['solution']}" if level["solution"] is not None else "between two solutions"
        most = level["screen_height"]
        tell(
            f"level {level['level']}: {level['triangles']:,} triangles, {level['vertices']:,} vertices, mean error "
            f"{level['mean_error']:.4g}{unit}, geometric error {level['geometric_error']:.4g}{unit} "
            f"({kind}{', free' * level['free']}{', refitted' * level['refitted']}); "
            + ("exact" if most is None else f"within a pixel up to {most:.3g} screen heights")
            + (f"; compressed, off by at most {level['moved_by_at_most_m']:.2g} m" if "bits" in level else "")
        )
    if "frame" in record:
        frame = record["frame"]
        tell(
            "on Earth: "
            + f"{frame['latitude']:.6f}, {frame['longitude']:.6f}; heights are taken for those above the ellipsoid"
            if frame["system"]
            else "no reference system is known: the tiles stand in local coordinates"
            + ", units taken for metres" * (front.unit == LENGTH)
        )
    tell(f"written: {path}")
