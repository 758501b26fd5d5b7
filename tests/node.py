"""Programs of the npm registry that open what this package writes, run by Node.js; tests skip where they lack."""

from __future__ import annotations

import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

HOME = Path(__file__).parent / "npm"
SECONDS = 120


@cache
def modules() -> Path | None:
    """Return the folder of what tests/npm/package.json names; None: nobody installed it."""
    folder = Path(os.environ.get("MESHSIMP_NODE_MODULES", HOME / "node_modules"))
    return folder if folder.is_dir() else None


def module(name: str) -> Path:
    """Return the folder of a module; skip the test where it is not installed."""
    found = modules()
    if found is None or not (found / name).is_dir():
        pytest.skip(f"no npm module {name}: npm ci --prefix {HOME.relative_to(HOME.parents[1])}")
    return found / name


def run_script(script: str, *arguments: str | Path, needs: tuple[str, ...]) -> str:
    """Run a script (an ES module, of tests/npm) by Node.js with modules that it needs; return what it printed."""
    folders = [module(name) for name in needs]
    node = shutil.which("node")
    if node is None:
        pytest.skip("no Node.js (Debian: apt install nodejs)")
    # an ES module is looked for beside the script that imports it, and nowhere else
    place = folders[0].parents[len(Path(needs[0]).parts) - 1].parent / script
    if place != HOME / script:
        place.write_bytes((HOME / script).read_bytes())
    done = subprocess.run(
        [node, str(place), *map(str, arguments)], capture_output=True, text=True, timeout=SECONDS, check=False
    )
    if done.returncode:
        pytest.fail(f"{script} failed:\n{done.stderr or done.stdout}")
    return done.stdout
