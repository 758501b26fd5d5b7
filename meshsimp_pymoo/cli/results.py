"""What a search hands over once its results are in place: pictures, a summary and an exit code."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from meshsimp_pymoo.cli.arguments import in_numbers_of
from meshsimp_pymoo.cli.requests import Output, Request, Wish
from meshsimp_pymoo.cli.terminal import (
    DRAWING,
    INTERRUPTED,
    OK,
    TARGET_MISSED,
    Stages,
    answering,
    described,
    in_numbers,
    is_interrupted,
    place_for_matplotlib,
    say,
    solid_in_words,
    stop_if_interrupted,
    tell,
    tell_origin,
    there,
)
from meshsimp_pymoo.errors import Missed, ResultError
from meshsimp_pymoo.files import as_argument
from meshsimp_pymoo.formats.table import format_to_write
from meshsimp_pymoo.front import STATED_VERTICES, Front, FrontSolution
from meshsimp_pymoo.search.checkpoint import difference
from meshsimp_pymoo.search.wishes import in_words
from meshsimp_pymoo.storage import PICTURES, STATEMENT, claim_output, even_selection, read_front
from meshsimp_pymoo.surface.smallest import lines_in_words
from meshsimp_pymoo.surface.surface import Surface
from meshsimp_pymoo.surface.units import in_unit, known_units, reference_system

# How long results take at most once the search has come back after Ctrl-C, for which its start may take another 1.2 s;
# and what drawing takes for each vertex of the model [s]. Together with the rest of the folder that is within five.
WAIT_SECONDS = 3.0
DRAWING_SECONDS = 5e-5

# What of a record the summary says again.
SAID = ("evaluations", "moves", "seconds", "compile_seconds", "seed", "mesh_origin")


def lacks_pictures(output: Output, what: Mapping[str, Any]) -> bool:
    """Tell whether the folder holds the results of this very search, but not all pictures: they were not finished."""
    folder = output.folder
    wanted = PICTURES if output.page else PICTURES[:1]
    if output.overwrite or not (folder / "front.csv").is_file() or all((folder / name).exists() for name in wanted):
        return False
    try:
        run = read_front(folder).run
    except ResultError:
        return False
    settings = in_numbers_of(what["settings"], lambda: triangles_of(run["model"]))
    return not difference({name: run.get(name) for name in what}, {**what, "settings": settings})


def triangles_of(model: Mapping[str, Any]) -> int:
    """Return how many triangles an original has, by its record."""
    return int(model["triangles"])


def hand_over_stored(request: Request, surface: Surface, shown: Stages) -> int:
    """Hand over what a search came back with whose results are in place, if they are of this surface."""
    folder = request.output.folder
    try:
        Front.load(folder, model=surface)
    except ResultError:
        claim_output(folder)  # of another model, or by other rules: it is refused
        raise
    if not request.output.quiet:
        say(f"{folder} holds the results of this search; making the pictures that are missing")
    return hand_over(request, surface, shown)


def hand_over(request: Request, surface: Surface, shown: Stages) -> int:
    """Draw what is in place, as far as that is missing, say what there is, and return the exit code."""
    output, folder = request.output, request.output.folder
    front = Front.load(folder, model=surface)
    undrawn = is_interrupted()
    slow = bool(front.run.get("interrupted")) and DRAWING_SECONDS * surface.n_vertices > WAIT_SECONDS
    with answering(*DRAWING):
        try:
            stop_if_interrupted()
            if not (undrawn or slow):
                with shown.stage("writing", "drawing"), place_for_matplotlib(folder):
                    front.draw(page=output.page, missing=True)
        except KeyboardInterrupt:
            undrawn = True
    shown.close()
    _summarise(front, output, request.wish)
    if front.run.get("interrupted"):
        say(f"interrupted after {front.run['generations']} generations; {folder} holds the front so far")
    asked = even_selection(len(front), output.meshes)
    left_out = sum(front.stored_mesh(row) is None for row in asked)
    if left_out:
        say(
            f"{left_out} of {len(asked)} meshes are left out, so that you need not wait; make one by meshsimp pick "
            f"{as_argument(folder)} --triangles N -o FILE, with a number of front.csv"
        )
    unmeasured = sum(math.isnan(quality.surface_error) for quality in front.quality)
    if unmeasured:
        say(
            f"surface error and angles of {unmeasured} of {len(front)} solutions are left out, so that you need not "
            "wait; meshsimp score says those of a mesh"
        )
    if undrawn:
        say(f"interrupted while it was drawn; {folder} holds the results: meshsimp report {as_argument(folder)}")
    elif slow:
        say(f"pictures are left out, so that you need not wait; make them by meshsimp report {as_argument(folder)}")
    elif front.run["chosen"] is not None and surface.n_vertices > STATED_VERTICES:
        say(
            "the statement of quality is left out, so that you need not wait; make it by meshsimp quality "
            f"{as_argument(folder)}"
        )
    if front.run.get("interrupted") or undrawn:
        return INTERRUPTED
    missed = "" if front.run["chosen"] is not None else request.wish.of(front)[1]
    if missed:
        budgets = "--moves, --time" if front.run.get("wish") else "--generations, --time"
        longer = f"; search longer ({budgets})"
        if "generations" not in front.run:  # tiles, which keep only so many
            least, most = front.quality[0].triangles, front.quality[-1].triangles
            instead = "or do without tiles (--tile none)"
            if request.wish.triangles is not None and request.wish.triangles < least:
                longer = f"; ask for {least} or more (--triangles N), {instead}"
            else:
                said = f"this front has no mesh of more than {most:,} triangles"
                longer = f"; {said}: name more beside it (--triangles N), {instead}"
        say(f"{folder} holds a front, but no chosen mesh: {missed}{longer}")
        return TARGET_MISSED
    return OK


def _summarise(front: Front, output: Output, wish: Wish) -> None:
    if output.json:
        tell(json.dumps(_summary(front, output), indent=2))
    elif not output.quiet:
        _tell(front, output, wish)


def _chosen_path(output: Output) -> Path:
    """Return where the chosen mesh is: a file, or a folder of its pieces."""
    pieces = output.folder / "chosen"
    return pieces if pieces.is_dir() else pieces.with_suffix(format_to_write(output.format).suffix)


def _summary(front: Front, output: Output) -> dict[str, Any]:
    model, chosen = front.model, front.run["chosen"]
    return {
        "model": {
            "name": model.name,
            "vertices": model.n_vertices,
            "triangles": len(model.faces),
            "hash": model.hash,
            **known_units(model.georeference),
            **({"lines": front.run["model"]["lines"]} if front.has_lines else {}),
        },
        "front": str(output.folder / "front.csv"),
        "solutions": len(front),
        "smallest": in_numbers(front.quality[0]),
        "most_accurate": in_numbers(front.quality[-1]),
        "chosen": None
        if chosen is None
        else {
            "mesh": str(_chosen_path(output)),
            "solution": chosen,
            "free": front[chosen].free,
            **in_numbers(front.quality[chosen]),
            **{name: front.run[name] for name in ("solid",) if name in front.run},
        },
    } | {name: front.run[name] for name in SAID if name in front.run}


def _tell(front: Front, output: Output, wish: Wish) -> None:
    model, run, folder = front.model, front.run, output.folder
    few, many, chosen = front.quality[0], front.quality[-1], run["chosen"]
    unit, system = front.unit, reference_system(model.georeference)
    whole = f"{model.n_vertices:,} vertices, {len(model.faces):,} triangles"
    if "rows" in run["model"]:
        rows, columns = run["model"]["rows"], run["model"]["columns"]
        with_data = f", {model.n_vertices:,} of them with data" * (model.n_vertices < rows * columns)
        whole = f"{rows:,} x {columns:,} samples{with_data}, thinned tile by tile"
    tell(f"{Path(model.name).name}: {whole}" + f"; {system}" * bool(system))
    effort = [f"{run['seconds']:.1f} s"]
    if "evaluations" in run:
        moves = [f"{run['moves']:,} moves"] if "moves" in run else []
        effort = [f"{run['evaluations']:,} evaluations", *moves, *effort, f"seed {run['seed']}"]
    free = f", {front.n_free} of them free" if front.n_free else ""
    tell(
        f"front: {len(front)} solutions{free}, {few.triangles:,} to {many.triangles:,} triangles, "
        f"mean error {few.mean_error:.4g} to {many.mean_error:.4g}{in_unit(unit)} ({', '.join(effort)})"
    )
    if front.has_lines:
        tell(f"break lines: {lines_in_words(run['model']['lines'], unit)}")
    if run.get("wish"):
        tell(f"searched: around {in_words(run['wish'], unit)}; the rest of the front is what came along")
    if chosen is not None:
        path = _chosen_path(output)
        which = f"solution {chosen}{', free' * front[chosen].free}"
        tell(f"chosen: {path} ({which}): {described(front.quality[chosen], unit)}")
        if "solid" in run:
            tell(f"solid: {solid_in_words(run['solid'], unit)}")
    suffix = format_to_write(output.format).suffix
    written, refitted = (len(list(folder.glob(f"{place}/*{suffix}"))) for place in ("meshes", "refitted"))
    files = [there(folder, "front.csv", *PICTURES, *STATEMENT)]
    files += [f"{n} in {place}" for n, place in ((written, "meshes"), (refitted, "refitted")) if n]
    tell(f"written: {folder}: {', '.join(files)}")
    if (compiled := run["compile_seconds"]) >= 1.0:
        tell(f"compiled once for this machine: {compiled:.0f} s, not counted as search")
    if "mesh_origin" in run:
        tell_origin(run["mesh_origin"])
    if chosen is None:
        words = "take one of them"
        for said in _worth_picking(front, wish):
            name = "small" if said.startswith("--triangles") else "close"
            tell(f"{words}: meshsimp pick {as_argument(folder)} {said} -o {name}.ply")
            words = "or"


def _worth_picking(front: Front, wish: Wish) -> list[str]:
    """Return which solutions are worth an example where none is chosen: that keep a part of what was wished for."""
    if not wish.limits:
        return [f"--triangles {_round_size(front)}"]
    alone = [Wish({name: limit}) for name, limit in wish.limits.items()]
    kept = [one.spelled for one in alone if one.of(front)[0] is not None]
    return kept or [f"--solution {nearest(front, wish.limits).solution}"]


def nearest(front: Front, limits: Mapping[str, float]) -> FrontSolution:
    """Return the solution within limits, or the one that comes nearest to them."""
    try:
        return front.best(**limits)
    except Missed as missed:
        found: FrontSolution = missed.nearest
        return found


def _round_size(front: Front) -> int:
    """Return a size worth an example: that of the knee, rounded up."""
    triangles: int = front.knee().triangles
    step = 10 ** max(len(str(triangles)) - 2, 0)
    return -(-triangles // step) * step
