"""``python -m meshsimp_pymoo`` is the shell command ``meshsimp``."""

import os
import sys

from meshsimp_pymoo.cli import main

# What LLVM does for the kernels at its higher level takes a third longer and gains nothing; workers inherit it. It is
# for the whole process, so whoever imports the package decides for themselves.
COMPILER = {"NUMBA_OPT": "1", "NUMBA_LOOP_VECTORIZE": "0"}


def run() -> int:
    """Run the command line of this process."""
    for name, value in COMPILER.items():
        os.environ.setdefault(name, value)
    return main()


if __name__ == "__main__":
    sys.exit(run())
