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

from meshsimp_pymoo.cli.arguments import UsageError
from meshsimp_pymoo.cli.terminal import INTERRUPTED, OK, TARGET_MISSED, bar, described, say
from meshsimp_pymoo.engines import EngineError, open_engine
from meshsimp_pymoo.results import ResultError, claim_output
from meshsimp_pymoo.runs import locked
from meshsimp_pymoo.tiles.front import TILE, Folder, TiledFront, settings, tiled_front
from meshsimp_pymoo.tiles.grid import count_samples, open_grid
from meshsimp_pymoo.tiles.output import read_tiled_front, stored_model, write_tiled_front, write_welded

# From this many samples on, a grid is thinned tile by tile without being asked.
TILED_FROM = 2_000_000
# What tiles do not know, with the values that ask for nothing.
UNKNOWN: dict[str, Any] = {
    "time": None,
    "evaluations": None,
    "generations": None,
    "algorithm": "memetic",
    "pin": None,
    "window": None,
    "max_edge": None,
    "patch": None,
    "weights": None,
    "refit": False,
}
WORK = "tiles"


def wants_tiles(args: argparse.Namespace) -> bool:
    """Tell whether the model is to be thinned tile by tile: because it was asked for, or because it is big."""
    if args.tile is None:
        count = count_samples(args.model)
        return count is not None and count >= TILED_FROM
    return bool(args.tile)


def simplify_tiled(args: argparse.Namespace) -> int:
    """Thin the height grid ``args.model`` tile by tile and write its front to a new folder."""
    _refuse_unknown(args)
    out = _claim(args)
    start = time.perf_counter()
    grid = open_grid(args.model, spacing=args.spacing, nodata=args.nodata, up=args.up)
    tile = args.tile or TILE
    most = args.triangles if args.triangles and args.triangles > _usual_most(grid, tile) else None
    try:
        what = settings(grid, tile=tile, most=most)
    except ValueError as problem:
        raise UsageError(str(problem)) from None
    if args.overwrite:
        _forget_other(out / WORK, what)
    threads = args.threads or os.cpu_count() or 1
    made_now = not out.exists()
    try:
        store = Folder(out / WORK, what)
        with locked(out), open_engine(args.jobs, args.dask) as engine, bar(args.quiet, Path(grid.name).name) as show:
            front = tiled_front(
                grid, tile=tile, most=most, engine=engine, store=store, threads=threads, progress=show
            )
            front, chosen, missed = _choose(args, front, threads)
            run = {
                "settings": {key: getattr(args, key) for key in ("spacing", "nodata", "up", "triangles", "max_error",
                "mean_error", "pick", "format")} | {"tile": tile, "most": what["most"]},
                "seconds": round(time.perf_counter() - start, 3),
            }  # fmt: skip
            write_tiled_front(
                out,
                front,
                meshes=args.meshes,
                mesh_format=args.format,
                chosen=chosen,
                piece_size=tile if args.pieces else None,
                run=run,
            )
    except EngineError as problem:
        raise ResultError(f"{problem}; finished tiles are in {out}, the same command goes on") from None
    except KeyboardInterrupt:
        if made_now and not any((out / WORK).glob("*.npz")):
            shutil.rmtree(out, ignore_errors=True)
            raise
        say(f"interrupted; finished tiles are in {out}, the same command goes on")
        return INTERRUPTED
    _summarise(args, out, front, chosen, time.perf_counter() - start)
    if missed:
        say(f"{out} holds a front, but no chosen mesh: {missed}")
        return TARGET_MISSED
    return OK


def _refuse_unknown(args: argparse.Namespace) -> None:
    for name, nothing in UNKNOWN.items():
        if getattr(args, name, nothing) != nothing:
            raise UsageError(
                f"--{name.replace('_', '-')} does not go with tiles, which are thinned and not searched; leave it out, "
                "or do without tiles (--tile none)"
            )


    if args.triangles == 1:
        raise UsageError("--triangles 1 is impossible: a mesh of a whole grid has at least 2 triangles")


def _claim(args: argparse.Namespace) -> Path:
    """Return the folder to make: a new one, one with unfinished tiles, or with ``--overwrite`` an old one."""
    out = Path(args.output)
    unfinished = out.is_dir() and {entry.name for entry in out.iterdir()} <= {WORK, ".lock"}
    return out if unfinished else claim_output(out, overwrite=args.overwrite)


def _forget_other(work: Path, what: dict[str, Any]) -> None:
    """Remove unfinished tiles of another grid or of other settings."""
    try:
        Folder(work, what)
    except ResultError:
        shutil.rmtree(work)


def _usual_most(grid: Any, tile: int) -> int:
    return int(settings(grid, tile=max(tile, 64))["most"])


def pick_tiled(args: argparse.Namespace, path: Path | None) -> int:
    """Say which solution of a tiled front is meant, and write its mesh if a file is named."""
    stored, options = stored_model(args.front)
    grid = open_grid(args.model or stored, **options)
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
        slope = front.slope_of(args.triangles)
        front = front.with_slope(slope, threads=threads)
        return front, front.slope.tolist().index(slope), ""
    if args.pick == "knee":
        from meshsimp_pymoo.analysis import knee

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
    path = str(out / "chosen") if args.pieces else str(out / f"chosen.{args.format}")
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
    print(f"written: {out}: front.csv, nested.npz" + (f", {written} in meshes" if written else ""))
