"""``python -m meshsimp_pymoo`` is the shell command ``meshsimp``."""

from meshsimp_pymoo.cli import program

if __name__ == "__main__":
    program()
