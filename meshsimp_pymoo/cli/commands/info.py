"""``meshsimp info``: what a model is, and whether it can be simplified."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.surface.rules import Rules

HELP = "say what a model is and whether it can be simplified"
DESCRIPTION = """\
Say what MODEL is, whether it is a height field, and what would be refused. Without a
MODEL: list the built-in models."""
EXAMPLES = """\
examples:
  meshsimp info
      the built-in models
  meshsimp info face.ply
      is it a height field, and seen from where?
  meshsimp info dem.asc --break-lines rivers.geojson --line-tolerance 0.5
      how many edges the lines force, and the smallest mesh they allow
  meshsimp info head.ply --patch front --up y
      and its front alone?
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_model, add_settings, add_shown
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.surface.rules import Rules

    add_model(parser, Options, nargs="?")
    add_settings(parser, Rules, only=("break_lines", "line_tolerance"))
    add_shown(parser, quiet=False)


def run(args: argparse.Namespace) -> int:
    """Describe ``args.model``; without one, list the built-in models."""
    import json

    from meshsimp_pymoo import datasets
    from meshsimp_pymoo.cli.arguments import settings_from
    from meshsimp_pymoo.cli.preparing import said_when_compiling
    from meshsimp_pymoo.cli.terminal import OK, tell
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.surface.rules import Rules

    if args.model is not None:
        with said_when_compiling(quiet=False):
            return _describe(args.model, settings_from(args, Options), settings_from(args, Rules), as_json=args.json)

    lines = datasets.describe()
    tell(json.dumps(lines, indent=2) if args.json else "\n".join(lines.values()))
    return OK


def _describe(model: str, options: Options, rules: Rules, *, as_json: bool) -> int:
    import json
    import math
    from dataclasses import asdict

    import numpy as np

    from meshsimp_pymoo.cli.terminal import BAD_INPUT, OK, say, tell
    from meshsimp_pymoo.errors import ModelError
    from meshsimp_pymoo.formats.source.classes import classes_in_words
    from meshsimp_pymoo.formats.source.missing import suspects
    from meshsimp_pymoo.opening import mended_source
    from meshsimp_pymoo.surface.height import HeightSurface
    from meshsimp_pymoo.surface.model import build_model
    from meshsimp_pymoo.surface.orient import seen_upright, upright_rotation
    from meshsimp_pymoo.surface.places import count_places
    from meshsimp_pymoo.surface.smallest import facts_of_lines, lines_in_words
    from meshsimp_pymoo.surface.units import known_units, length_unit, reference_system

    source, mended = mended_source(model, options)
    measured = source.measured
    used = source.points[np.unique(source.faces)]
    low, extent = used.min(axis=0), np.ptp(used, axis=0)
    content: dict[str, Any] = {
        "name": source.name,
        "vertices": len(used),
        "triangles": len(source.faces),
        "unused_vertices": len(source.points) - len(used),
        "merged_vertices": len(source.repeats),
        "low": low.tolist(),
        "extent": extent.tolist(),
        **known_units(source.georeference),
        "attributes": sorted(source.attributes),
        "mended": asdict(mended),
    }
    rows = {
        "vertices": f"{len(used):,}",
        "triangles": f"{len(source.faces):,}",
        "extent": f"{_sides(extent)} [{_file_unit(source.georeference)}]",
        "from": ", ".join(f"{value:.10g}" for value in low),
        "attributes": ", ".join(sorted(source.attributes)) or "none",
        "mended": str(mended) or "nothing",
    }
    if system := reference_system(source.georeference):
        rows["system"] = system
    if measured is not source:
        rows["measured"] = f"{_sides(extent * source.scale)} [{length_unit(source.georeference)}]"
    if len(source.repeats):
        rows["vertices"] += f" ({len(source.repeats):,} that repeated others are merged with them)"
    if len(used) < len(source.points):
        rows["vertices"] += f" ({len(source.points) - len(used):,} more belong to no face)"
    if source.grid is not None:
        columns, lines, *steps = source.grid
        missing = columns * lines - len(source.points)
        even = [None if math.isnan(step) else step for step in steps]
        content["grid"] = {"columns": columns, "rows": lines, "spacing": even, "without_data": missing}
        rows["grid"] = f"{columns} x {lines} samples, {_apart(steps, source.georeference)}; {missing:,} without data"
    odd = list(suspects(source.points[:, 2])) if source.sort != "mesh" else []
    content["suspected_nodata"] = [value for value, *_ in odd]
    if classes := source.georeference.get("classes"):
        content["classes"] = classes
        rows["classes"] = classes_in_words(classes)
    try:
        up, facts = seen_upright(measured, options.up)
    except ModelError as problem:
        refusal: str | None = str(problem)
    else:
        refusal = facts.refusal
        n_below = n_feet = 0
        if not refusal and source.sort == "mesh":  # grids and clouds have one vertex at a place
            n_below, n_feet = count_places(measured.points @ upright_rotation(up).T, measured.faces)
        if n_below:
            rows["vertices"] += f" ({n_below:,} lie below others, {n_feet:,} of them feet that do not count)"
        content |= {"below_others": n_below, "feet": n_feet}
        content |= {"up": up.tolist(), "fold_share": facts.fold_share} | asdict(facts)
        flipped = " (its faces are wound the other way)" if facts.flipped else ""
        rows |= {
            "up": ", ".join(f"{value:.6g}" for value in up) + flipped,
            "area in plan": f"{facts.net_share:.1%} of the surface's (100%: flat)",
            "parts": f"{facts.components}",
            "border": f"{facts.border_edges:,} edges, {facts.border_loops} closed loop(s)",
            "vertical": f"{facts.vertical_faces:,} faces",
            "folded over": f"{'' if facts.complete else 'at least '}{facts.n_folded:,} faces ({facts.fold_share:.2%})",
        }
    doubt = f"usable, but see the warning: {odd[0][1]:,} heights of {odd[0][0]:.9g}" if odd else ""
    if rules.break_lines is not None and not refusal:
        lined = HeightSurface(build_model(source, up=options.up), rules)
        assert lined.model.lines is not None
        content["lines"] = facts_of_lines(lined, lined.model.lines)
        rows["break lines"] = lines_in_words(content["lines"], length_unit(source.georeference))
    rows["verdict"] = "refused" if refusal else doubt or "usable: an open height field"
    if as_json:
        tell(json.dumps(content | {"refusal": refusal}, indent=2))
    else:
        tell(source.name)
        for label, text in rows.items():
            tell(f"  {label:<16}{text}")
    if refusal:
        say(refusal)
        return BAD_INPUT
    return OK


def _sides(extent: Any) -> str:
    return " x ".join(f"{value:.6g}" for value in extent)


def _apart(steps: Any, georeference: dict[str, Any]) -> str:
    from meshsimp_pymoo.surface.measures import LENGTH
    from meshsimp_pymoo.surface.units import length_unit

    unit = str(georeference.get("unit") or "")
    named = length_unit({"unit": unit or None})  # of the plane; heights may have another one
    across, down = ("?" if step != step else f"{step:.6g}" for step in steps)
    return f"{across} x {down} {unit if named == LENGTH else named}".rstrip() + " apart"


def _file_unit(georeference: dict[str, Any]) -> str:
    from meshsimp_pymoo.surface.units import length_unit

    unit = str(georeference.get("unit") or "file units")
    # degrees are of the plane alone
    return f"{unit}, {unit}, {length_unit(georeference)}" if "scale" in georeference or unit == "degree" else unit
