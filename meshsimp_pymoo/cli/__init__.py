"""The shell interface: parse, call the library, translate its errors into one line and an exit code.

======  ==============================================================================================
code    meaning
======  ==============================================================================================
0       done
1       no solution of the front meets the wanted target; ``simplify`` has written the front, ``pick`` nothing
2       bad input: one line on stderr says what, where and the way out; nothing is written
130     interrupted (Ctrl-C): the front found so far is written, if there was one; of an experiment, all runs
        that were finished
======  ==============================================================================================

Anything unexpected keeps its traceback. Everything heavy is imported when a command runs, so that ``--help``
is quick.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from meshsimp_pymoo.cli.arguments import UsageError, make_parser
from meshsimp_pymoo.cli.terminal import BAD_INPUT, INTERRUPTED, interruptible, say, warnings_as_lines

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments; by default those of the process.

    Returns
    -------
    int
        The exit code; see the module's table.
    """
    try:
        args = make_parser().parse_args(argv)
        with warnings_as_lines(), interruptible():
            return int(args.command(args))
    except KeyboardInterrupt:
        say("interrupted; nothing is written")
        return INTERRUPTED
    except MemoryError:
        say("the work does not fit into memory; take a part of the model, a smaller population, or tiles (--tile)")
        return BAD_INPUT
    except Exception as problem:
        if not isinstance(problem, _input_errors()):
            raise
        say(" ".join(str(problem).split()))
        return BAD_INPUT


def _input_errors() -> tuple[type[Exception], ...]:
    """Errors that mean bad input; their modules are loaded only once there is an error to compare."""
    from meshsimp_pymoo.geometry.load import ModelError
    from meshsimp_pymoo.results import ResultError

    errors: tuple[type[Exception], ...] = (UsageError, ModelError, ResultError)
    if "meshsimp_pymoo.experiment.config" in sys.modules:
        from meshsimp_pymoo.experiment.config import ConfigError

        errors += (ConfigError,)
    return errors
