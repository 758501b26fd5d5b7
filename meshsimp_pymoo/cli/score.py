"""``meshsimp score``: the error of any tool's mesh."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from meshsimp_pymoo.cli.terminal import OK, described
from meshsimp_pymoo.errors import UsageError
from meshsimp_pymoo.files import claim_file, new_file
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.opening import open_model, open_source
from meshsimp_pymoo.settings import taken
from meshsimp_pymoo.surface.score import mesh_deviation, mesh_quality

PICTURES = (".png", ".svg", ".pdf")
# A mesh of the front itself, measured from its file, differs by less.
ROUNDING = 1e-9


def score(args: argparse.Namespace) -> int:
    """Measure ``args.other`` against ``args.model``, place it against a front, and draw its error."""
    path = None if args.output is None else claim_file(args.output, PICTURES, overwrite=args.overwrite)
    model = open_model(args.model, taken(Options, None, dict(vars(args))))
    if args.weights is not None:
        model = model.with_weights(args.weights)
    front = None if args.front is None else Front.load(args.front, model=model)
    outside = args.outside or (front.problem.outside if front is not None else "nearest")
    if front is not None and outside != front.problem.outside:
        raise UsageError(
            f"{args.front}: its errors are those of --outside {front.problem.outside}; leave --outside out to compare"
        )
    if front is not None:
        model = front.model  # with the weights of the front
    other = open_source(args.other)
    try:
        quality = mesh_quality(model, other.points, other.faces, outside=outside)
    except ValueError as problem:
        raise UsageError(f"{args.other}: cannot be measured against {model.name}: {problem}") from None
    summary: dict[str, Any] = {"model": model.name, "other": str(args.other), "outside": outside, **asdict(quality)}
    lines = [f"{args.other}: {described(quality)}"]
    if quality.uncovered > model.n_vertices // 2:
        share = quality.uncovered / model.n_vertices
        lines.append(f"{share:.0%} of the vertices of {model.name} are uncovered; are both in one frame and unit?")
    if front is not None:
        compared, line = _against(front, quality.triangles, quality.error)
        summary["front"] = {"folder": str(args.front), **compared}
        lines.append(f"{args.front}: {line}")
    if path is not None:
        from meshsimp_pymoo.report.figures import error_figure

        deviation, covered, _ = mesh_deviation(model, other.points, other.faces, outside=outside)
        title = f"{Path(args.other).name}: {quality.triangles:,} triangles, mean error {quality.mean_error:.3g}"
        with new_file(path) as unfinished:
            error_figure(model, deviation, covered, title=title).savefig(unfinished)
        summary["picture"] = str(path)
        lines.append(f"written: {path}")
    print(json.dumps(summary, indent=2) if args.json else "\n".join(lines))
    return OK


def _against(front: Front, triangles: int, error: float) -> tuple[dict[str, Any], str]:
    """Return where a mesh lies against a front: as numbers, and in words."""
    try:
        rival = front.best(triangles=triangles)
    except LookupError:
        smallest = f"its smallest has {front[0].triangles}"
        return {"solution": None}, f"holds no mesh of at most {triangles:,} triangles; {smallest}"
    ratio = error / rival.error if rival.error > 0 else None
    facts = {"solution": rival.solution, "triangles": rival.triangles, "error": rival.error, "error_ratio": ratio}
    smaller = next((s for s in front if s.error <= error * (1 + ROUNDING)), None)
    facts["triangles_for_this_error"] = None if smaller is None else smaller.triangles
    own = f"solution {rival.solution}, with {rival.triangles:,} triangles, has the error {rival.error:.6g}"
    if ratio is None:
        compared = "both are exact" if error == 0 else "that is exact"
    else:
        compared = f"the error of this mesh is {ratio:.3g} times that"
    needed = "" if smaller is None else f"; for this error the front needs {smaller.triangles:,} triangles"
    return facts, f"{own}; {compared}{needed}"
