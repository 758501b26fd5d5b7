"""Tiles from the shell: height grids too big for one piece, thinned tile by tile."""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from meshsimp_pymoo.cli.preparing import compiling
from meshsimp_pymoo.cli.requests import TILED_FROM, Free, Output, Request, Search, Tiling
from meshsimp_pymoo.cli.results import hand_over, hand_over_stored, lacks_pictures
from meshsimp_pymoo.cli.terminal import INTERRUPTED, WRITING, Stages, answering, say, stop_if_interrupted
from meshsimp_pymoo.errors import ModelError, ResultError, UsageError, reason_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import format_to_write
from meshsimp_pymoo.memory import fits_in_one_piece
from meshsimp_pymoo.opening import count_samples, open_grid
from meshsimp_pymoo.settings import plain
from meshsimp_pymoo.storage import TILES, claim_output, now
from meshsimp_pymoo.surface.grid_surface import FREE_RULES, GridSurface
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.tiles.front import LEAST_TILE, TILE, Folder, identity, tiled_front, usual_most
from meshsimp_pymoo.tiles.memory import check_memory
from meshsimp_pymoo.warming import SEARCH, STATED
from meshsimp_pymoo.workers import EngineError, open_engine

# What tiles know, or what makes no difference to them; all else is refused where it is not what asks for nothing.
KNOWN: dict[type[Any], tuple[str, ...]] = {
    # nothing is left to chance, and finished tiles are always saved
    Search: ("seed", "threads", "checkpoint", "time"),
    Rules: FREE_RULES,
    Options: ("up", "spacing", "nodata", "window", "band", "encoding", "scale"),
    Free: (),
    Output: ("folder", "overwrite", "format", "meshes", "page", "quiet", "json"),
}


def wants_tiles(request: Request) -> bool:
    """Tell whether the model is to be thinned tile by tile: because it was asked for, or is too big for one piece."""
    if request.tiling.tile is None:
        count = count_samples(request.model, window=request.options.window)
        return count is not None and count >= TILED_FROM and not fits_in_one_piece(count)
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
    output, tiling = request.output, request.tiling
    out, tile = output.folder, tiling.tile or TILE
    timed = {} if request.search.time is None else {"time": request.search.time}
    what: dict[str, Any] = {"settings": request.wanted | timed | {"tile": tile, "pieces": tiling.pieces}}
    is_drawn_only = lacks_pictures(output, what | {"options": plain(request.options)})
    if not is_drawn_only:
        _claim(output)
    parts = (*SEARCH, "tiles", *(STATED if request.wish.chooses else ()))
    with compiling(parts, shown) as compiled:
        with shown.stage("reading", f"reading {Path(request.model).name}"):
            grid = open_grid(request.model, request.options)
            has_gaps = grid.lattice is not None  # all samples are read once
        read_seconds = shown.seconds["reading"] - compiled.seconds
        compiled.finish((*parts, "gaps in grids") if has_gaps else parts)
    if request.wish.triangles == 1 and not has_gaps:
        raise UsageError("--triangles 1 is impossible: a mesh of a whole grid has at least 2 triangles")
    wish = request.wish.among(lambda: len(grid.faces))
    request = replace(request, wish=wish)
    what["settings"] |= wish.limits
    rules = replace(request.rules, measure=request.measure or Rules().measure)
    surface = GridSurface(grid, rules)
    if is_drawn_only:
        return hand_over_stored(request, surface, shown)
    start, begun = time.perf_counter(), now()
    format_to_write(output.format).check(grid)
    jobs = tiling.jobs or os.cpu_count() or 1
    most = max(wish.triangles or 2, usual_most(grid))
    check_memory(grid, tile=tile, most=most, jobs=jobs, remote=tiling.dask is not None)
    try:
        identity_of_tiles = identity(grid, tile=tile, most=most, rules=rules)
    except ValueError as problem:
        if isinstance(problem, ModelError):
            raise
        raise UsageError(str(problem)) from None
    made_now = not out.exists()
    with answering(*WRITING):
        try:
            out.mkdir(parents=True, exist_ok=True)
            if output.overwrite:
                _forget_other(out / TILES, identity_of_tiles)
            threads = request.search.threads or os.cpu_count() or 1
            with (
                answering("stopping: finished tiles are stored, the same command goes on"),
                open_engine(jobs, tiling.dask) as engine,
                shown.stage("searching", "thinning") as show,
            ):
                front = tiled_front(
                    grid,
                    rules=rules,
                    tile=tile,
                    most=most,
                    engine=engine,
                    store=Folder(out / TILES, identity_of_tiles),
                    threads=threads,
                    progress=show,
                    until=None if request.search.time is None else start + request.search.time,
                    wish=wish.limits,
                )
                chosen, _ = wish.of(front)
                stop_if_interrupted()
            with shown.stage("writing", "writing"):
                run = what | {
                    "begun": begun,
                    "seconds": round(time.perf_counter() - start, 3),
                    "read_seconds": round(read_seconds, 3),
                    "compile_seconds": round(compiled.seconds, 3),
                }
                _claim(output)  # somebody may have put something else there meanwhile, which would be replaced
                try:
                    (front if chosen is None else chosen.front).save(
                        out,
                        overwrite=True,
                        meshes=output.meshes,
                        mesh_format=output.format,
                        chosen=chosen,
                        piece=tile if tiling.pieces else None,
                        pictures=False,
                        run=run,
                    )
                except ResultError as problem:
                    raise _and_goes_on(problem, out) from None
        except EngineError as problem:
            raise _and_goes_on(problem, out) from None
        except MemoryError:
            raise ResultError(
                f"{grid.name}: the work does not fit into memory; use smaller tiles (--tile "
                f"{max(LEAST_TILE, tile // 2)}), fewer processes (--jobs 1) or fewer triangles"
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
        return hand_over(request, surface, shown)


def _and_goes_on(problem: Exception, out: Path) -> ResultError:
    return ResultError(f"{problem}" + f"; finished tiles are in {out}, the same command goes on" * _has_pieces(out))


def _has_pieces(out: Path) -> bool:
    return any((out / TILES).glob("*.npz"))


def _refuse_unknown(request: Request) -> None:
    if request.rules.break_lines is not None:
        if request.tiling.tile is None:  # nobody asked for tiles
            raise UsageError(
                f"--break-lines does not go with tiles, and {request.model} does not fit into the memory in one piece; "
                "take a part of it (--window COLUMN,ROW,COLUMNS,ROWS)"
            )
        raise UsageError(
            "--break-lines does not go with tiles, which do not know them; simplify in one piece (--tile none), or a "
            "part of it (--window COLUMN,ROW,COLUMNS,ROWS)"
        )
    rules = replace(request.rules, measure=request.measure or Rules().measure)
    for part in (request.search, rules, request.options, request.free, request.output):
        for item in fields(part):
            if item.name not in KNOWN[type(part)] and getattr(part, item.name) != item.default:
                raise UsageError(
                    f"--{item.name.replace('_', '-')} does not go with tiles, which do not know it; "
                    "leave it out, or do without tiles (--tile none)"
                )


def _claim(output: Output) -> None:
    """Check the folder to make: a new one, one with unfinished tiles, or with ``--overwrite`` an old one."""
    if not _is_unfinished(output.folder):
        claim_output(output.folder, overwrite=output.overwrite)


def _is_unfinished(out: Path) -> bool:
    return out.is_dir() and {entry.name for entry in out.iterdir()} <= {TILES}


def _forget_other(work: Path, what: dict[str, Any]) -> None:
    """Remove unfinished tiles of another grid or of other settings."""
    try:
        Folder(work, what)
    except ResultError:
        shutil.rmtree(work, ignore_errors=True)
