"""``meshsimp score``: the error of any tool's mesh."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.front import Front, FrontSolution
    from meshsimp_pymoo.surface.rules import Rules

HELP = "measure a mesh that another tool simplified"
DESCRIPTION = """\
Measure OTHER, any simplified mesh of MODEL, by the error of this package: the sum,
mean, RMS and maximum of the deviations at all vertices of MODEL, how many of them
no triangle covers, the mean between the vertices, and the least angles of OTHER."""
EXAMPLES = """\
examples:
  meshsimp score face.ply decimated.ply
      its error by the measure of this package
  meshsimp score face.ply decimated.ply --front face_front
      and where it lies against a stored front
  meshsimp score face.ply decimated.ply -o error.png
      and a picture of the error
"""

PICTURES = (".png", ".svg", ".pdf")
# Beside what a vertex outside costs, what of the rules decides the numbers of any mesh.
SAID = ("weights", "break_lines", "line_tolerance")
# A mesh of the front itself, measured from its file, differs by less.
ROUNDING = 1e-9


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_model, add_settings, add_shown
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.surface.rules import Rules

    add_model(parser, Options, help="the original")
    parser.add_argument("other", metavar="OTHER", help="the simplified mesh, in the same frame and units")
    parser.add_argument("--front", metavar="OUT", help="folder of a front of MODEL to compare with")
    parser.add_argument("-o", "--output", metavar="FILE", help="picture of the error to write: png, svg or pdf")
    parser.add_argument("--overwrite", action="store_true", help="replace FILE if it exists")
    add_settings(parser, Rules, only=("outside", *SAID), outside="nearest, or as in the front")
    add_shown(parser, quiet=False)


def run(args: argparse.Namespace) -> int:
    """Measure ``args.other`` against ``args.model``, place it against a front, and draw its error."""
    import json

    from meshsimp_pymoo.cli.arguments import settings_from
    from meshsimp_pymoo.cli.preparing import said_when_compiling
    from meshsimp_pymoo.cli.terminal import OK, tell
    from meshsimp_pymoo.files import claim_file
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.surface.rules import Rules

    path = None if args.output is None else claim_file(args.output, PICTURES, overwrite=args.overwrite)
    options, rules = settings_from(args, Options), settings_from(args, Rules)
    with said_when_compiling(quiet=False):
        summary, lines = _scored(args.model, options, rules, args.outside, args.other, args.front, path)
    tell(json.dumps(summary, indent=2) if args.json else "\n".join(lines))
    return OK


def _scored(
    model: str, options: Options, rules: Rules, outside: str | None, other: str, folder: str | None, path: Path | None
) -> tuple[dict[str, Any], list[str]]:
    """Return what is said of a mesh, as numbers and in words; draw its error if a file is named."""
    from pathlib import Path

    from meshsimp_pymoo.cli.terminal import described, in_numbers
    from meshsimp_pymoo.errors import UsageError
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.opening import open_model, open_source
    from meshsimp_pymoo.surface.kinds import surface_of
    from meshsimp_pymoo.surface.units import in_unit, known_units, length_unit

    front = None if folder is None else _front_of(folder, model, options, rules, outside)
    surface: Any = surface_of(open_model(model, options), rules) if front is None else front.surface
    # judged as it is, in the frame of the model's file, which is measured
    source = open_source(other, Options(repair="none", scale="none"))
    try:
        scored = surface.score(source.points, source.faces)
    except ValueError as problem:
        raise UsageError(f"{other}: cannot be measured against {surface.model.name}: {problem}") from None
    quality, name, unit = scored.quality, surface.model.name, length_unit(surface.model.georeference)
    summary: dict[str, Any] = {
        "model": name, "other": str(other), "outside": surface.rules.outside, **in_numbers(quality),
        **known_units(surface.model.georeference),
    }  # fmt: skip
    lines = [f"{other}: {described(quality, unit)}"]
    if quality.uncovered > surface.n_vertices // 2:
        share = quality.uncovered / surface.n_vertices
        lines.append(f"{share:.0%} of the vertices of {name} are uncovered; are both in one frame and unit?")
    if front is not None:
        compared, line = _against(front, quality.triangles, quality.error)
        summary["front"] = {"folder": str(folder), **compared}
        lines.append(f"{folder}: {line}")
    if path is not None:
        title = (
            f"{Path(other).name}: {quality.triangles:,} triangles, mean error {quality.mean_error:.3g}{in_unit(unit)}"
        )
        _draw(surface, scored, title, path)
        summary["picture"] = str(path)
        lines.append(f"written: {path}")
    return summary, lines


def _front_of(folder: str, model: str, options: Options, rules: Rules, outside: str | None) -> Front:
    """Return a stored front of a model, read and measured as when it was made; what is said otherwise is refused."""
    from meshsimp_pymoo.errors import UsageError
    from meshsimp_pymoo.front import Front
    from meshsimp_pymoo.settings import plain

    front = Front.load(folder)
    usual = plain(type(options)()) | plain(type(rules)())
    given = plain(options) | {name: getattr(rules, name) for name in SAID}
    said = {name: value for name, value in given.items() if value != usual[name]}
    if outside is not None:
        said["outside"] = outside
    made = usual | front.run.get("options", {}) | front.run.get("rules", {})
    for name, value in said.items():
        if value != made[name]:
            option = f"--{name.replace('_', '-')}"
            how = f"without {option}" if made[name] is None else f"with {option} {made[name]}"
            raise UsageError(f"{folder}: was made {how}, and is compared as it was made; leave {option} out")
    return Front.load(folder, model=model)


def _draw(surface: Any, scored: Any, title: str, path: Path) -> None:
    from meshsimp_pymoo.files import new_file
    from meshsimp_pymoo.report.figures import error_figure

    with new_file(path) as unfinished:
        error_figure(surface, scored.deviation, scored.covered, title=title).savefig(unfinished)


def _against(front: Front, triangles: int, error: float) -> tuple[dict[str, Any], str]:
    """Return where a mesh lies against a front: as numbers, and in words."""
    try:
        rival = front.best(triangles=triangles)
    except LookupError:
        smallest = f"its smallest has {front[0].triangles}"
        return {"solution": None}, f"holds no mesh of at most {triangles:,} triangles; {smallest}"
    stated = _error_of(rival)
    ratio = error / stated if stated > 0 else None
    stored = rival.front is front  # else it was made between two that are
    facts = {
        "solution": rival.solution if stored else None,
        "triangles": rival.triangles,
        "error": stated,
        "error_ratio": ratio,
    }
    smaller = _smallest_within(front, error * (1 + ROUNDING))
    facts["triangles_for_this_error"] = None if smaller is None else smaller.triangles
    which = f"solution {rival.solution}" if stored else "a mesh between two solutions"
    own = f"{which}, with {rival.triangles:,} triangles, has the error {stated:.6g}"
    if ratio is None:
        compared = "both are exact" if error == 0 else "that is exact"
    else:
        compared = f"the error of this mesh is {ratio:.3g} times that"
    needed = "" if smaller is None else f"; for this error the front needs {smaller.triangles:,} triangles"
    return facts, f"{own}; {compared}{needed}"


def _error_of(solution: FrontSolution) -> float:
    """Return the error of a solution as that of any mesh is measured.

    What is said of a mesh of a closed surface is measured by the images of its vertices, which no other tool's has, and
    is a little more than by the distance in space.
    """
    from meshsimp_pymoo.surface.closed.surface import ClosedSurface

    surface = solution.front.surface
    return surface.of_faces(solution.faces).quality.error if isinstance(surface, ClosedSurface) else solution.error


def _smallest_within(front: Front, most: float) -> FrontSolution | None:
    """Return the smallest solution of at most this error, if there is one."""
    at = next((number for number, solution in enumerate(front) if solution.error <= most), len(front))
    while at > 0 and _error_of(front[at - 1]) <= most:
        at -= 1
    return front[at] if at < len(front) else None
