"""``meshsimp info``: what a model is, and whether it can be simplified."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.opening import Judged
    from meshsimp_pymoo.surface.closed.model import Topology
    from meshsimp_pymoo.surface.kinds import OfModel
    from meshsimp_pymoo.surface.rules import Rules

# What is said of a model whatever it is taken for; None where it is not known, or there is none.
OF_SURFACES = (
    *("components", "genus", "loops", "rim_edges", "caps", "copied", "small_parts_left_out", "least_image_edge"),
    *("not_height", "not_closed"),
)
HELP = "say what a model is and whether it can be simplified"
DESCRIPTION = """\
Say what MODEL is, whether it is a height field or a closed surface, and what would be
refused. Without a MODEL: list the built-in models."""
EXAMPLES = """\
examples:
  meshsimp info
      the built-in models
  meshsimp info face.ply
      is it a height field, and seen from where, or a closed surface?
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
    from meshsimp_pymoo.formats.source.classes import classes_in_words
    from meshsimp_pymoo.formats.source.missing import suspects
    from meshsimp_pymoo.opening import judge, mended_source
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
        "coordinate_unit": source.georeference.get("unit"),
        "attributes": sorted(source.attributes),
        "mended": asdict(mended),
        "surface": None,
        **dict.fromkeys(OF_SURFACES),
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
    judged = judge(source, options)
    kind = rows["surface"] = judged.kind
    refusal = (_as_closed if kind == "closed" else _as_height)(source, judged, rules, content, rows)
    if refusal:
        rows["surface"] = "none"
    else:
        content["surface"] = kind
    usable = f"usable: {'a closed surface of genus 0' if kind == 'closed' else 'an open height field'}"
    doubt = f"usable, but see the warning: {odd[0][1]:,} heights of {odd[0][0]:.9g}" if odd else ""
    rows["verdict"] = "refused" if refusal else doubt or usable
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


def _as_height(
    source: SourceMesh, judged: Judged, rules: Rules, content: dict[str, Any], rows: dict[str, str]
) -> str | None:
    """Add what a model is as a height field, and why it is no closed surface; return why it is refused, if it is."""
    from dataclasses import asdict

    from meshsimp_pymoo.surface.closed.model import topology
    from meshsimp_pymoo.surface.height import HeightSurface
    from meshsimp_pymoo.surface.model import build_model
    from meshsimp_pymoo.surface.orient import upright_rotation
    from meshsimp_pymoo.surface.places import count_places

    measured, refusal = source.measured, judged.refusal
    if judged.seen is not None:
        up, facts = judged.seen
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
    if rules.break_lines is not None and not refusal:
        _add_lines(HeightSurface(build_model(source, seen=judged.seen), rules), content, rows)
    why_not: str | None = f"is a {source.sort}"
    if source.sort == "mesh":
        what = topology(source.faces)
        content |= _facts_of(what)
        why_not = what.refusal
        seen = judged.seen
        # of a plain sheet it would say nothing: its outline alone is the hole
        is_doubtful = seen is None or what.loops > 1 or seen[1].n_folded + seen[1].vertical_faces > 0
        if why_not is None:
            if refusal or is_doubtful:
                rows["closed too"] = "it could be taken as a closed surface (--surface closed)"
        elif refusal:
            rows["not closed"] = why_not
    content["not_closed"] = why_not
    return refusal


def _as_closed(
    source: SourceMesh, judged: Judged, rules: Rules, content: dict[str, Any], rows: dict[str, str]
) -> str | None:
    """Add what a model is as a closed surface, and why it is no height field; return why it is refused, if it is."""
    from meshsimp_pymoo.errors import ModelError
    from meshsimp_pymoo.opening import judge
    from meshsimp_pymoo.surface.closed.embedding import shortest_edge
    from meshsimp_pymoo.surface.closed.model import closed_model, topology
    from meshsimp_pymoo.surface.closed.surface import ClosedSurface

    what = topology(source.faces)
    content |= _facts_of(what)
    rows["parts"] = f"{what.components:,}"
    rows["genus"] = "not known" if what.genus is None else f"{what.genus}"
    rows["holes"] = f"{what.loops:,}" + f" ({what.rim_edges:,} edges at rims)" * (what.loops > 0)
    # where the options say what it is, nobody has looked at the other
    fault = content["not_height"] = judged.fault or judge(source).fault
    rows["no height field"] = f"it {fault}" if fault else "it could be taken as one (--surface height)"
    try:
        model = closed_model(source)
        surface = ClosedSurface(model, rules)
    except ModelError as problem:
        content["not_closed"] = rows["not closed"] = what.refusal or str(problem).removeprefix(f"{source.name}: ")
        return str(problem)
    left = {name: model.found.get(name, 0) for name in ("copied", "small_parts_left_out")}
    if n_small := left["small_parts_left_out"]:
        rows["parts"] += f" ({n_small:,} of fewer than 4 vertices left out)"
    if n_copied := left["copied"]:
        rows["vertices"] += f" (and {n_copied:,} copies of those in which several fans of faces meet)"
    least = shortest_edge(model.xy, model.faces)
    content |= {"caps": model.n_holes, "least_image_edge": least} | left
    rows["flattened"] = f"the shortest edge is {least:.3g} of the plane's side"
    _add_lines(surface, content, rows)
    return None


def _add_lines(surface: OfModel, content: dict[str, Any], rows: dict[str, str]) -> None:
    """Add what break lines are and ask of every mesh, if there are any."""
    from meshsimp_pymoo.surface.smallest import facts_of_lines, lines_in_words
    from meshsimp_pymoo.surface.units import length_unit

    if surface.model.lines is not None:
        content["lines"] = facts_of_lines(surface, surface.model.lines)
        rows["break lines"] = lines_in_words(content["lines"], length_unit(surface.model.georeference))


def _facts_of(what: Topology) -> dict[str, Any]:
    """Return what closed surfaces are judged by."""
    return {"components": what.components, "genus": what.genus, "loops": what.loops, "rim_edges": what.rim_edges}


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
