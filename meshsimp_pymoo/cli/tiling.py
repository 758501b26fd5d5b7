"""Tiles from the shell: height grids too big for one piece, thinned tile by tile."""

from __future__ import annotations

import json
import os
import shutil
import time
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from meshsimp_pymoo.cli.arguments import numbered
from meshsimp_pymoo.cli.preparing import compiling
from meshsimp_pymoo.cli.requests import TILED_FROM, Output, Request, Search, Tiling, Wish
from meshsimp_pymoo.cli.terminal import (
    DRAWING,
    INTERRUPTED,
    OK,
    TARGET_MISSED,
    WRITING,
    Stages,
    answering,
    described,
    in_unit,
    is_interrupted,
    place_for_matplotlib,
    say,
    stop_if_interrupted,
    tell,
    tell_drawn,
    tell_origin,
    there,
)
from meshsimp_pymoo.errors import ModelError, ResultError, UsageError, printable, reason_of
from meshsimp_pymoo.files import as_argument, draw_into
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import format_to_write
from meshsimp_pymoo.indicators import knee
from meshsimp_pymoo.search.checkpoint import difference
from meshsimp_pymoo.settings import plain
from meshsimp_pymoo.storage import PICTURES, claim_output
from meshsimp_pymoo.surface.measures import MEASURES
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.units import known_units, length_unit, reference_system
from meshsimp_pymoo.tiles.front import LEAST_TILE, TILE, Folder, TiledFront, settings, tiled_front, usual_most
from meshsimp_pymoo.tiles.grid import HeightGrid, count_samples, open_grid
from meshsimp_pymoo.tiles.memory import check_memory
from meshsimp_pymoo.tiles.output import (
    WORK,
    is_tiled,
    read_tiled_front,
    record_of,
    stored_model,
    write_tiled_front,
    write_welded,
)
from meshsimp_pymoo.warming import SEARCH
from meshsimp_pymoo.workers import EngineError, open_engine

# What tiles know, or what makes no difference to them; all else is refused where it is not what asks for nothing.
KNOWN: dict[type[Any], tuple[str, ...]] = {
    Search: ("seed", "threads", "checkpoint"),  # nothing is left to chance, and finished tiles are always saved
    Rules: ("footprint", "outside"),  # a grid without gaps fills its hull
    Options: ("up", "spacing", "nodata", "window", "band", "encoding", "scale"),
    Output: ("folder", "overwrite", "format", "meshes", "page", "quiet", "json"),
}


def wants_tiles(request: Request) -> bool:
    """Tell whether the model is to be thinned tile by tile: because it was asked for, or because it is big."""
    if request.tiling.tile is None:
        count = count_samples(request.model, window=request.options.window)
        return count is not None and count >= TILED_FROM
    return bool(request.tiling.tile)


def refuse_alone(tiling: Tiling) -> None:
    """Refuse what is said of tiles where a model is searched in one piece."""
    for item in fields(tiling):
        if item.name != "tile" and getattr(tiling, item.name) != item.default:
            raise UsageError(
                f"--{item.name} is for tiles, and this model is searched in one piece; leave it out, or ask for tiles "
                f"(--tile {TILE})"
            )


def simplify_tiled(request: Request, shown: Stages) -> int:
    """Thin a height grid tile by tile and write its front to a new folder; return the exit code."""
    _refuse_unknown(request)
    wish, output, tiling = request.wish, request.output, request.tiling
    out = output.folder
    is_drawn_only = is_tiled(out) and not output.overwrite and not (out / PICTURES[0]).exists()
    if not is_drawn_only:
        _claim(output)
    with compiling((*SEARCH, "tiles"), shown) as compiled:
        with shown.stage("reading", f"reading {Path(request.model).name}"):
            grid = open_grid(request.model, request.options)
        read_seconds = shown.seconds["reading"] - compiled.seconds
        compiled.finish()
    start = time.perf_counter()
    if grid.model is not None:
        format_to_write(output.format).check(grid.model)
    tile = tiling.tile or TILE
    most = max(wish.triangles or 2, usual_most(grid))
    jobs = tiling.jobs or os.cpu_count() or 1
    check_memory(grid, tile=tile, most=most, jobs=jobs, remote=tiling.dask is not None)
    try:
        what = settings(grid, tile=tile, most=most)
    except ValueError as problem:
        if isinstance(problem, ModelError):
            raise
        raise UsageError(str(problem)) from None
    recorded = {"options": plain(request.options), "settings": request.wanted | {"tile": tile, "most": what["most"]}}
    if is_drawn_only:
        if difference({name: record_of(out).get(name) for name in recorded}, recorded):
            claim_output(out)  # of other settings: it is refused
        front, chosen = _stored(out, grid)
        if not output.quiet:
            say(f"{out} holds the results of this search; making the picture that is missing")
        return _hand_over(request, shown, front, chosen, "", time.perf_counter() - start)
    made_now = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        if output.overwrite:
            _forget_other(out / WORK, what)
        threads = request.search.threads or os.cpu_count() or 1
        store = Folder(out / WORK, what)
        with (
            answering("stopping: finished tiles are stored, the same command goes on"),
            open_engine(jobs, tiling.dask) as engine,
            shown.stage("searching", "thinning") as show,
        ):
            front = tiled_front(
                grid, tile=tile, most=what["most"], engine=engine, store=store, threads=threads, progress=show
            )
            front, chosen, missed = _choose(wish, front, threads)
            stop_if_interrupted()
        with answering(*WRITING), shown.stage("writing", "writing"):
            run = recorded | {
                "seconds": round(time.perf_counter() - start, 3),
                "read_seconds": round(read_seconds, 3),
                "compile_seconds": round(compiled.seconds, 3),
            }
            _claim(output)  # somebody may have put something else there meanwhile, which would be replaced
            write_tiled_front(
                out,
                front,
                meshes=output.meshes,
                mesh_format=output.format,
                chosen=chosen,
                piece_size=tile if tiling.pieces else None,
                run=run,
            )
            undrawn = is_interrupted()
    except EngineError as problem:
        goes_on = f"; finished tiles are in {out}, the same command goes on" if _has_pieces(out) else ""
        raise ResultError(f"{problem}{goes_on}") from None
    except MemoryError:
        raise ResultError(
            f"{grid.name}: the work does not fit into memory; use smaller tiles (--tile {max(LEAST_TILE, tile // 2)}), "
            "fewer processes (--jobs 1) or fewer triangles"
        ) from None
    except OSError as problem:
        raise ResultError(f"{out}: cannot be used ({reason_of(problem)}); name another folder") from None
    except KeyboardInterrupt:
        if made_now and not _has_pieces(out):
            raise
        say(f"interrupted; finished tiles are in {out}, the same command goes on")
        return INTERRUPTED
    finally:
        if made_now and _is_unfinished(out) and not _has_pieces(out):
            shutil.rmtree(out, ignore_errors=True)
    return _hand_over(request, shown, front, chosen, missed, time.perf_counter() - start, undrawn=undrawn)


def _hand_over(
    request: Request,
    shown: Stages,
    front: TiledFront,
    chosen: int | None,
    missed: str,
    seconds: float,
    *,
    undrawn: bool = False,
) -> int:
    """Draw what is in place, say what there is, and return the exit code."""
    out = request.output.folder
    with answering(*DRAWING):
        try:
            stop_if_interrupted()
            if not undrawn:
                with shown.stage("writing", "drawing"), place_for_matplotlib(out):
                    draw_into(out, {PICTURES[0]: lambda path: _draw(front, chosen, path)})
        except KeyboardInterrupt:
            undrawn = True
    shown.close()
    _summarise(request.output, request.tiling, front, chosen, seconds)
    if undrawn:
        say(f"interrupted while it was drawn; {out} holds the results: meshsimp report {as_argument(out)}")
        return INTERRUPTED
    if missed:
        say(f"{out} holds a front, but no chosen mesh: {missed}")
        return TARGET_MISSED
    return OK


def report_on_tiled(out: Path, model: str | None, *, quiet: bool, as_json: bool) -> int:
    """Make the picture of a tiled front anew; return the exit code."""
    stored, options = stored_model(out)
    front, chosen = _stored(out, open_grid(model or stored, options))
    with place_for_matplotlib(out):
        draw_into(out, {PICTURES[0]: lambda path: _draw(front, chosen, path)})
    return tell_drawn(out, PICTURES[:1], len(front), quiet=quiet, as_json=as_json)


def _stored(out: Path, grid: HeightGrid) -> tuple[TiledFront, int | None]:
    """Return a stored front, and its row of the chosen solution."""
    front, chosen = read_tiled_front(out, grid), record_of(out)["chosen"]
    return front, None if chosen is None else len(front) - 1 - chosen


def _draw(front: TiledFront, chosen: int | None, path: Path) -> None:
    from matplotlib.figure import Figure

    from meshsimp_pymoo.report.figures import plot_front

    grid = front.grid
    figure = Figure(figsize=(7.0, 5.0), dpi=110, layout="constrained")
    axes = figure.subplots()
    unit, system = length_unit(grid.georeference), printable(reference_system(grid.georeference))
    plot_front(front, axes, knee=int(knee(front.F)), chosen=chosen, n_points=grid.n_samples, unit=unit)
    rows, columns = grid.shape
    size = f"{rows:,} x {columns:,} samples"
    axes.set_title(f"{printable(Path(grid.name).name)}: {size}" + f"\n{system}" * bool(system), loc="left")
    figure.savefig(path)


def _has_pieces(out: Path) -> bool:
    return any((out / WORK).glob("*.npz"))


def _refuse_unknown(request: Request) -> None:
    for part in (request.search, request.rules, request.options, request.output):
        for item in fields(part):
            if item.name not in KNOWN[type(part)] and getattr(part, item.name) != item.default:
                raise UsageError(
                    f"--{item.name.replace('_', '-')} does not go with tiles, which are thinned and not searched; "
                    "leave it out, or do without tiles (--tile none)"
                )
    if request.wish.triangles == 1:
        raise UsageError("--triangles 1 is impossible: a mesh of a whole grid has at least 2 triangles")


def _claim(output: Output) -> None:
    """Check the folder to make: a new one, one with unfinished tiles, or with ``--overwrite`` an old one."""
    if not _is_unfinished(output.folder):
        claim_output(output.folder, overwrite=output.overwrite)


def _is_unfinished(out: Path) -> bool:
    return out.is_dir() and {entry.name for entry in out.iterdir()} <= {WORK}


def _forget_other(work: Path, what: dict[str, Any]) -> None:
    """Remove unfinished tiles of another grid or of other settings."""
    try:
        Folder(work, what)
    except ResultError:
        shutil.rmtree(work, ignore_errors=True)


def pick_tiled(
    folder: str, model: str | None, wish: Wish, number: int | None, path: Path | None, *, quiet: bool, as_json: bool
) -> int:
    """Say which solution of a tiled front is meant, and write its mesh if a file is named; return the exit code."""
    stored, options = stored_model(folder)
    front = read_tiled_front(folder, open_grid(model or stored, options))
    if number is not None:
        chosen: int | None = len(front) - 1 - numbered(folder, len(front), number)
    else:
        front, chosen, missed = _choose(wish, front, os.cpu_count() or 1)
        if chosen is None:
            say(f"{folder}: {missed}; nothing is written")
            return TARGET_MISSED
    assert chosen is not None
    if path is not None:
        write_welded(path, front, chosen)
    quality = front.quality[chosen]
    if as_json:
        # a size between two solutions is none of the stored ones
        known = None if wish.triangles is not None else len(front) - 1 - chosen
        mesh = None if path is None else str(path)
        tell(json.dumps({"mesh": mesh, "solution": known, **asdict(quality)}, indent=2))
    elif not quiet:
        tell(f"of {folder}: {described(quality, length_unit(front.grid.georeference))}")
        tell(f"written: {path}" if path else "nothing is written; name a file with -o")
    return OK


def _choose(wish: Wish, front: TiledFront, threads: int) -> tuple[TiledFront, int | None, str]:
    """Return the front, the solution that was asked for, if one was, and why there is none, if so."""
    quality = front.quality
    if wish.knee:
        return front, int(knee(front.F)), ""
    for name, limit in wish.limits.items():
        if name == "triangles":
            if limit < quality[-1].triangles:
                return front, None, f"its smallest mesh has {quality[-1].triangles} triangles"
            return *front.with_triangles(int(limit), threads=threads), ""
        fine = [k for k, q in enumerate(quality) if getattr(q, name) <= limit]
        if not fine:
            least = min(getattr(q, name) for q in quality)
            return front, None, f"its least {MEASURES[name].label} is {least:.4g}, and {limit:g} was asked for"
        return front, fine[-1], ""
    return front, None, ""


def _summarise(output: Output, tiling: Tiling, front: TiledFront, chosen: int | None, seconds: float) -> None:
    out = output.folder
    grid, quality = front.grid, front.quality
    solution = None if chosen is None else len(front) - 1 - chosen
    suffix = format_to_write(output.format).suffix
    path = str(out / "chosen") if tiling.pieces else str(out / f"chosen{suffix}")
    if output.json:
        summary = {
            "model": {
                "name": grid.name,
                "vertices": grid.n_samples,
                "triangles": grid.n_triangles,
                "hash": grid.hash,
                **known_units(grid.georeference),
            },
            "front": str(out / "front.csv"),
            "solutions": len(quality),
            "smallest": asdict(quality[-1]),
            "most_accurate": asdict(quality[0]),
            "chosen": None if chosen is None else {"mesh": path, "solution": solution, **asdict(quality[chosen])},
            "seconds": round(seconds, 3),
        }
        tell(json.dumps(summary, indent=2))
        return
    if output.quiet:
        return
    few, many = quality[-1], quality[0]
    unit, system = length_unit(grid.georeference), reference_system(grid.georeference)
    size = f"{grid.shape[0]:,} x {grid.shape[1]:,} samples, thinned tile by tile"
    tell(f"{grid.name}: {size}" + f"; {system}" * bool(system))
    tell(
        f"front: {len(quality)} solutions, {few.triangles:,} to {many.triangles:,} triangles, "
        f"mean error {few.mean_error:.4g} to {many.mean_error:.4g}{in_unit(unit)} ({seconds:.1f} s)"
    )
    if chosen is not None:
        tell(f"chosen: {path} (solution {solution}): {described(quality[chosen], unit)}")
    written = len(list(out.glob(f"meshes/*{suffix}")))
    files = there(out, "front.csv", "nested.npz", "front.png")
    tell(f"written: {out}: {files}" + (f", {written} in meshes" if written else ""))
    if origin := record_of(out).get("mesh_origin"):
        tell_origin(origin)
