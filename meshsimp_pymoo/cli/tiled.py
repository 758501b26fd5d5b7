"""``meshsimp simplify --tile``: height grids too big for one piece, thinned tile by tile."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from meshsimp_pymoo.cli.terminal import INTERRUPTED, OK, TARGET_MISSED, bar, described, say
from meshsimp_pymoo.errors import ModelError, ResultError, UsageError
from meshsimp_pymoo.files import locked
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import format_to_write
from meshsimp_pymoo.search.presets import DEFAULT
from meshsimp_pymoo.settings import taken
from meshsimp_pymoo.storage import claim_output
from meshsimp_pymoo.tiles.front import LEAST_TILE, TILE, Folder, TiledFront, settings, tiled_front, usual_most
from meshsimp_pymoo.tiles.grid import HeightGrid, count_samples, open_grid
from meshsimp_pymoo.tiles.memory import check_memory
from meshsimp_pymoo.tiles.output import (
    WORK,
    clear_up,
    read_tiled_front,
    restore,
    stored_model,
    write_tiled_front,
    write_welded,
)
from meshsimp_pymoo.workers import Engine, EngineError, open_engine

# From this many samples on, a grid is thinned tile by tile without being asked.
TILED_FROM = 2_000_000
# What tiles do not know, with the values that ask for nothing.
UNKNOWN: dict[str, Any] = {
    "time": None,
    "evaluations": None,
    "generations": None,
    "algorithm": DEFAULT,
    "pin": None,
    "max_edge": None,
    "patch": None,
    "weights": None,
    "refit": False,
    "objectives": ("error", "triangles"),
}


def wants_tiles(args: argparse.Namespace) -> bool:
    """Tell whether the model is to be thinned tile by tile: because it was asked for, or because it is big."""
    if args.tile is None:
        count = count_samples(args.model, window=args.window)
        return count is not None and count >= TILED_FROM
    return bool(args.tile)


def simplify_tiled(args: argparse.Namespace) -> int:
    """Thin the height grid ``args.model`` tile by tile and write its front to a new folder."""
    _refuse_unknown(args)
    restore(Path(args.output))
    out = _claim(args)
    start = time.perf_counter()
    grid = open_grid(args.model, taken(Options, None, dict(vars(args))))
    if grid.model is not None:
        format_to_write(args.format).check(grid.model)
    tile = args.tile or TILE
    most = max(args.triangles or 2, usual_most(grid))
    jobs = args.jobs or os.cpu_count() or 1
    check_memory(grid, tile=tile, most=most, jobs=jobs, remote=args.dask is not None)
    try:
        what = settings(grid, tile=tile, most=most)
    except ValueError as problem:
        if isinstance(problem, ModelError):
            raise
        raise UsageError(str(problem)) from None
    made_now = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        with locked(out), open_engine(jobs, args.dask) as engine, bar(args.quiet, Path(grid.name).name) as show:
            clear_up(out)
            if args.overwrite:
                _forget_other(out / WORK, what)
            front, chosen, missed = _thin(args, out, grid, what, engine, show, start)
    except EngineError as problem:
        goes_on = f"; finished tiles are in {out}, the same command goes on" if _has_pieces(out) else ""
        raise ResultError(f"{problem}{goes_on}") from None
    except MemoryError:
        raise ResultError(
            f"{grid.name}: the work does not fit into memory; use smaller tiles (--tile {max(LEAST_TILE, tile // 2)}), "
            "fewer processes (--jobs 1) or fewer triangles"
        ) from None
    except OSError as problem:
        raise ResultError(f"{out}: cannot be used ({problem.strerror or problem}); name another folder") from None
    except KeyboardInterrupt:
        if made_now and not _has_pieces(out):
            raise
        say(f"interrupted; finished tiles are in {out}, the same command goes on")
        return INTERRUPTED
    finally:
        if made_now and _is_unfinished(out) and not _has_pieces(out):
            shutil.rmtree(out, ignore_errors=True)
    _summarise(args, out, front, chosen, time.perf_counter() - start)
    if missed:
        say(f"{out} holds a front, but no chosen mesh: {missed}")
        return TARGET_MISSED
    return OK


def _thin(
    args: argparse.Namespace,
    out: Path,
    grid: HeightGrid,
    what: dict[str, Any],
    engine: Engine,
    show: Any,
    start: float,
) -> tuple[TiledFront, int | None, str]:
    """Thin the grid, choose and write; return the front, the solution chosen, and why there is none."""
    tile, threads = what["tile"], args.threads or os.cpu_count() or 1
    front = tiled_front(
        grid,
        tile=tile,
        most=what["most"],
        engine=engine,
        store=Folder(out / WORK, what),
        threads=threads,
        progress=show,
    )
    front, chosen, missed = _choose(args, front, threads)
    recorded = ("spacing", "nodata", "window", "up", "triangles", "max_error", "mean_error", "pick", "format")
    run = {
        "settings": {key: getattr(args, key) for key in recorded} | {"tile": tile, "most": what["most"]},
        "seconds": round(time.perf_counter() - start, 3),
    }

    def draw(unfinished: Path) -> None:
        from matplotlib.figure import Figure

        from meshsimp_pymoo.indicators import knee
        from meshsimp_pymoo.report.figures import plot_front

        figure = Figure(figsize=(7.0, 5.0), dpi=110, layout="constrained")
        axes = figure.subplots()
        plot_front(front, axes, knee=int(knee(front.F)), chosen=chosen, n_points=grid.n_samples)
        rows, columns = grid.shape
        axes.set_title(f"{Path(grid.name).name}: {rows:,} x {columns:,} samples", loc="left")
        figure.savefig(unfinished / "front.png")

    _claim(args)  # somebody may have put something else there meanwhile, which would be replaced
    write_tiled_front(
        out,
        front,
        meshes=args.meshes,
        mesh_format=args.format,
        chosen=chosen,
        piece_size=tile if args.pieces else None,
        run=run,
        extra=draw,
    )
    return front, chosen, missed


def _has_pieces(out: Path) -> bool:
    return any((out / WORK).glob("*.npz"))


def _refuse_unknown(args: argparse.Namespace) -> None:
    for name, nothing in UNKNOWN.items():
        if getattr(args, name, nothing) != nothing:
            option = {"objectives": "measure"}.get(name, name.replace("_", "-"))
            raise UsageError(
                f"--{option} does not go with tiles, which are thinned and not searched; leave it out, "
                "or do without tiles (--tile none)"
            )
    if args.triangles == 1:
        raise UsageError("--triangles 1 is impossible: a mesh of a whole grid has at least 2 triangles")


def _claim(args: argparse.Namespace) -> Path:
    """Return the folder to make: a new one, one with unfinished tiles, or with ``--overwrite`` an old one."""
    out = Path(args.output)
    return out if _is_unfinished(out) else claim_output(out, overwrite=args.overwrite)


def _is_unfinished(out: Path) -> bool:
    return out.is_dir() and {entry.name for entry in out.iterdir()} <= {WORK, ".lock"}


def _forget_other(work: Path, what: dict[str, Any]) -> None:
    """Remove unfinished tiles of another grid or of other settings."""
    try:
        Folder(work, what)
    except ResultError:
        shutil.rmtree(work, ignore_errors=True)


def pick_tiled(args: argparse.Namespace, path: Path | None) -> int:
    """Say which solution of a tiled front is meant, and write its mesh if a file is named."""
    stored, options = stored_model(args.front)
    grid = open_grid(args.model or stored, options)
    front = read_tiled_front(args.front, grid)
    wish = argparse.Namespace(**vars(args) | {"pick": "knee" if args.knee else None})
    if args.solution is not None:
        if args.solution >= len(front):
            raise UsageError(
                f"{args.front}: has the solutions 0 to {len(front) - 1}; --solution {args.solution} is none of them"
            )
        chosen: int | None = len(front) - 1 - args.solution
    else:
        front, chosen, missed = _choose(wish, front, os.cpu_count() or 1)
        if chosen is None:
            say(f"{args.front}: {missed}; nothing is written")
            return TARGET_MISSED
    assert chosen is not None
    if path is not None:
        write_welded(path, front, chosen)
    quality = front.quality[chosen]
    if args.json:
        # a size between two solutions is none of the stored ones
        number = None if args.triangles is not None else len(front) - 1 - chosen
        mesh = None if path is None else str(path)
        print(json.dumps({"mesh": mesh, "solution": number, **asdict(quality)}, indent=2))
    elif not args.quiet:
        print(f"of {args.front}: {described(quality)}")
        print(f"written: {path}" if path else "nothing is written; name a file with -o")
    return OK


def _choose(args: argparse.Namespace, front: TiledFront, threads: int) -> tuple[TiledFront, int | None, str]:
    """Return the front, the solution that was asked for, if one was, and why there is none, if so."""
    quality = front.quality
    if args.triangles is not None:
        if args.triangles < quality[-1].triangles:
            return front, None, f"its smallest mesh has {quality[-1].triangles} triangles"
        front, row = front.with_triangles(args.triangles, threads=threads)
        return front, row, ""
    if args.pick == "knee":
        from meshsimp_pymoo.indicators import knee

        return front, int(knee(front.F)), ""
    for name in ("max_error", "mean_error"):
        limit = getattr(args, name)
        if limit is not None:
            fine = [k for k, q in enumerate(quality) if getattr(q, name) <= limit]
            if not fine:
                least = min(getattr(q, name) for q in quality)
                return front, None, f"its least {name.replace('_', ' ')} is {least:.4g}, and {limit:g} was asked for"
            return front, fine[-1], ""
    return front, None, ""


def _summarise(args: argparse.Namespace, out: Path, front: TiledFront, chosen: int | None, seconds: float) -> None:
    grid, quality = front.grid, front.quality
    solution = None if chosen is None else len(front) - 1 - chosen
    path = str(out / "chosen") if args.pieces else str(out / f"chosen{format_to_write(args.format).suffix}")
    if args.json:
        summary = {
            "model": {
                "name": grid.name,
                "vertices": grid.n_samples,
                "triangles": grid.n_triangles,
                "hash": grid.hash,
            },
            "front": str(out / "front.csv"),
            "solutions": len(quality),
            "smallest": asdict(quality[-1]),
            "most_accurate": asdict(quality[0]),
            "chosen": None if chosen is None else {"mesh": path, "solution": solution, **asdict(quality[chosen])},
            "seconds": round(seconds, 3),
        }
        print(json.dumps(summary, indent=2))
        return
    if args.quiet:
        return
    few, many = quality[-1], quality[0]
    print(f"{grid.name}: {grid.shape[0]:,} x {grid.shape[1]:,} samples, thinned tile by tile")
    print(
        f"front: {len(quality)} solutions, {few.triangles:,} to {many.triangles:,} triangles, "
        f"mean error {few.mean_error:.4g} to {many.mean_error:.4g} ({seconds:.1f} s)"
    )
    if chosen is not None:
        print(f"chosen: {path} (solution {solution}): {described(quality[chosen])}")
    written = len(list(out.glob("meshes/*")))
    print(f"written: {out}: front.csv, nested.npz, front.png" + (f", {written} in meshes" if written else ""))
