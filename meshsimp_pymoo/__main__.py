"""``python -m meshsimp_pymoo`` is the shell command ``meshsimp``."""

import sys

from meshsimp_pymoo.cli import main

if __name__ == "__main__":
    sys.exit(main())
