"""``meshsimp warm``: everything compiled beforehand."""

from __future__ import annotations

import argparse

HELP = "compile everything beforehand, for containers and images"
DESCRIPTION = """\
Compile all functions for this machine, which the first commands would do otherwise. The machine
code is kept beside the package, or else in the user's cache folder or the one for temporary files;
NUMBA_CACHE_DIR names another. It is for this kind of processor, Python and Numba."""
EXAMPLES = """\
examples:
  meshsimp warm
      in a Dockerfile, after pip install
  NUMBA_CACHE_DIR=/var/cache/meshsimp meshsimp warm
      in a folder that later calls name too
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from meshsimp_pymoo.cli.arguments import add_shown

    add_shown(parser)


def run(args: argparse.Namespace) -> int:
    """Compile what is missing, and say where it is."""
    import json
    import time

    from meshsimp_pymoo.cli.preparing import compile_first
    from meshsimp_pymoo.cli.terminal import BAD_INPUT, OK, say, tell
    from meshsimp_pymoo.compiling.store import place
    from meshsimp_pymoo.warming import PARTS, missing

    found = place()
    if found.folder is None:
        say(
            f"compiled code can be kept nowhere ({'; '.join(found.refused)}); set NUMBA_CACHE_DIR to a folder that can "
            "be written"
        )
        return BAD_INPUT
    start = time.perf_counter()
    parts = len(missing())
    compile_first([part.name for part in PARTS], quiet=args.quiet)
    seconds = time.perf_counter() - start
    if args.json:
        summary = {"folder": str(found.folder), "compiled": parts, "parts": len(PARTS), "seconds": round(seconds, 3)}
        tell(json.dumps(summary, indent=2))
    elif not args.quiet:
        done = f"compiled in {seconds:.0f} s" if parts else "all compiled already"
        tell(f"{done}: {found.folder}")
    return OK
