"""``meshsimp simplify``: search the front of a model and write it."""

from __future__ import annotations

import argparse

HELP = "write the front of simplified meshes of a model"
DESCRIPTION = """\
Find the front of simplified meshes of MODEL and write it to a new folder:
report.html (the page to look and choose), front.csv (the numbers), meshes/ (one mesh
per solution), front.png, front.npz, run.json, and the chosen mesh if one is asked for."""
EXAMPLES = """\
examples:
  meshsimp simplify face.ply
      the front, in the new folder face_front
  meshsimp simplify face.ply -o out --triangles 500
      and the most accurate mesh of at most 500 triangles
  meshsimp simplify dem.asc --time 60s --pick knee
      search for a minute, take the best compromise
  meshsimp simplify scan.obj --max-error 0.1 --time 20s --format obj
      the smallest that deviates nowhere by more than 0.1
  meshsimp simplify dem.asc --triangles 5000 --free --refit --time 60s
      the least error at so many triangles: edges chosen for it, then heights
  meshsimp simplify statue.ply --triangles 5000 --refit --time 60s
      a closed surface, its vertices moved to where the mesh fits it best
  meshsimp simplify grid.npy --spacing 30 --nodata=-9999
      a height grid
  meshsimp simplify scan.laz --classes 2 --max-edge 5 --format landxml
      the ground of a point cloud with bays and holes, as a TIN for GIS programs
  meshsimp simplify dem.asc --break-lines rivers.geojson --line-tolerance 0.5
      polylines that every mesh keeps as edges, to half a unit
  meshsimp simplify huge.npy --tile 512 --triangles 200000
      a height grid that is too big for one piece
"""

# About how long each stage takes [s], until more is known.
STAGES = {
    "starting": 0.7,
    "reading": 0.5,
    "compiling": 0.0,
    "searching": 20.0,
    "freeing": 0.0,
    "refitting": 0.0,
    "writing": 2.0,
}


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import (
        add_checkpoint,
        add_model,
        add_settings,
        add_shown,
        add_solid,
        add_wishes,
        add_workers,
        duration,
        format_name,
        mesh_count,
        tile,
        typed,
        whole,
    )
    from meshsimp_pymoo.cli.requests import TILED_FROM, Free, Output, Search
    from meshsimp_pymoo.formats.options import Options
    from meshsimp_pymoo.formats.table import all_formats, listed, written_formats
    from meshsimp_pymoo.search.presets import DEFAULT_GENERATIONS, PRESETS
    from meshsimp_pymoo.search.wishes import USUAL_BUDGET
    from meshsimp_pymoo.settings import Real
    from meshsimp_pymoo.surface.measures import OBJECTIVES
    from meshsimp_pymoo.surface.rules import MOST_RATIO, Rules

    parser.add_argument("-o", "--output", metavar="OUT", help="folder to make (default: MODEL_front, here)")
    parser.add_argument("--overwrite", action="store_true", help="replace results that are in OUT already")

    wanted = parser.add_argument_group(
        "the mesh you want, written to OUT/chosen.ply beside the front (several limits: all of them hold)",
        "It is answered within seconds, then improved for as long as there is time; the front around it comes along.",
    )
    add_wishes(wanted)
    wanted.add_argument("--pick", choices=("knee",), help="the best compromise: the knee of the front")

    budget = parser.add_argument_group(
        f"how long to search (default: one sweep over all sizes, or {USUAL_BUDGET:,} moves around the mesh you want; "
        f"other algorithms: {DEFAULT_GENERATIONS} generations)"
    ).add_mutually_exclusive_group()
    budget.add_argument(
        "--time", type=duration, metavar="T", help="60s, 10min, 1h (results then depend on the machine)"
    )
    budget.add_argument("--evaluations", type=whole(1), metavar="N", help="stop after the generation that reaches N")
    budget.add_argument("--generations", type=whole(1), metavar="N")
    sweeping = " or ".join(name for name, preset in PRESETS.items() if "moves" in preset.measured_by)
    budget.add_argument(
        "--moves",
        type=whole(1),
        metavar="N",
        help=f"of the annealing of {sweeping}: a million take about a second of one core, and unlike with a time the "
        "results are the same every time",
    )

    search = parser.add_argument_group("how to search")
    offered = {name: preset.about for name, preset in PRESETS.items() if preset.whole_front}
    search.add_argument(
        "--algorithm",
        choices=list(offered),
        default=Search.algorithm,
        help="; ".join(f"{name}: {about}" for name, about in offered.items()) + " (default: %(default)s)",
    )
    search.add_argument(
        "--population", type=whole(2), default=Search.population, metavar="N", help="(default: %(default)s)"
    )
    search.add_argument(
        "--seed", type=whole(0), default=Search.seed, metavar="N", help="same seed, same results (default: %(default)s)"
    )
    search.add_argument(
        "--threads", type=whole(1), metavar="N", help="(default: all cores; the results do not depend on it)"
    )
    search.add_argument(
        "--free",
        action="store_true",
        help="choose the edges of the meshes for the error too, instead of by the Delaunay rule: less error at equal "
        "triangles. memetic does so in the search; of another algorithm, or where a mesh is wanted, the front is freed "
        "in the last part of the time. For pictures, printing, games; keep Delaunay meshes for hydrology and finite "
        "elements",
    )
    search.add_argument(
        "--free-height",
        type=typed(Real(0, most=MOST_RATIO).from_text),
        default=Free.free_height,
        metavar="R",
        help="least height of the triangles that come, as a share of their longest edge; 0: any (default: %(default)s)",
    )
    search.add_argument(
        "--no-centroids",
        action="store_true",
        help="free meshes for the error at the vertices alone: less there, but more between them",
    )
    add_checkpoint(search, "the state of the search is saved in OUT", " (tiles are always saved)")

    counted = [suffix for kind in all_formats() if kind.count_samples is not None for suffix in kind.suffixes]
    tiles = parser.add_argument_group("big height grids, thinned tile by tile in bounded memory")
    tiles.add_argument(
        "--tile",
        type=tile,
        metavar="N|none",
        help=f"samples along one side of a tile (default: 256, for {listed(counted)} from {TILED_FROM / 1e6:g} million "
        "samples on, where one piece does not fit into the memory)",
    )
    tiles.add_argument("--pieces", action="store_true", help="write the chosen mesh in pieces, one for each tile")
    add_workers(tiles)

    add_model(parser, Options)
    rules = parser.add_argument_group("what counts")
    add_settings(rules, Rules)
    spelled = {measure.minimised: name for name, measure in OBJECTIVES.items()}
    meanings = ", ".join(f"{measure.minimised} ({measure.meaning})" for measure in OBJECTIVES.values())
    rules.add_argument(
        "--measure",
        type=str.lower,
        choices=list(spelled),
        help=f"error that is made small beside the triangles: {meanings} (default: {next(iter(spelled))}, or what is "
        "wished for)",
    )

    output = parser.add_argument_group("what is written and shown")
    output.add_argument(
        "--format",
        type=format_name,
        choices=list(written_formats()),
        default=Output.format,
        help="of the meshes (default: %(default)s)",
    )
    output.add_argument(
        "--meshes",
        type=mesh_count,
        default=Output.meshes,
        metavar="all|N|none",
        help="write at most N meshes, an even selection of the front (default: %(default)s)",
    )
    output.add_argument(
        "--refit",
        action="store_true",
        help="write each mesh once more in OUT/refitted, its vertices raised or lowered (of a closed surface: moved) "
        "to where the sum of the deviations is least; front.csv says refitted_error",
    )
    add_solid(output, "the chosen mesh")
    output.add_argument(
        "--no-page", dest="page", action="store_false", help="do not write OUT/report.html, the page to look and choose"
    )
    add_shown(output)


def run(args: argparse.Namespace) -> int:
    """Search the front of ``args.model`` and write it to a new folder."""
    from pathlib import Path

    from meshsimp_pymoo.cli.requests import request_of
    from meshsimp_pymoo.cli.terminal import Stages, stop_if_interrupted

    request = request_of(args)
    plan = STAGES if request.search.time is None else STAGES | {"searching": request.search.time}
    with Stages(request.output.quiet, Path(request.model).name, plan) as shown:
        with shown.stage("starting", "starting"):  # what is imported takes longer than a person waits without a sign
            from meshsimp_pymoo.cli.searching import simplify
        stop_if_interrupted()
        return simplify(request, shown)
