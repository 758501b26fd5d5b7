"""The shell interface: parse, call the library, translate its errors into one line and an exit code.

======  ==============================================================================================
code    meaning
======  ==============================================================================================
0       done
1       no solution of the front meets the wanted target; ``simplify`` has written the front, ``pick`` nothing
2       bad input: one line on stderr says what, where and the way out; nothing is written, but of an experiment
        that some runs failed of, all others
130     interrupted (Ctrl-C): the front found so far is written, if there was one; of an experiment, all runs
        that were finished
143     the same after SIGTERM, which schedulers and containers send
======  ==============================================================================================

Anything unexpected keeps its traceback. Everything heavy is imported when a command runs, so that ``--help``
is quick.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from meshsimp_pymoo.cli.parser import make_parser
from meshsimp_pymoo.cli.terminal import (
    BAD_INPUT,
    ENDING,
    INTERRUPTED,
    OK,
    interrupted_code,
    interruptible,
    matplotlib_silent,
    say,
    tell_unraisable,
    warnings_as_lines,
)
from meshsimp_pymoo.errors import InputError
from meshsimp_pymoo.memory import give_back_at_once

__all__ = ["main", "program"]

NO_MEMORY = "the work does not fit into memory; take a part of the model, a smaller population, or tiles (--tile)"
# What Python says where there is no room for the stack of another thread.
NO_THREAD = "can't start new thread"

# What a signal has broken off. A compiler that was stopped halfway crashes where it is cleared away, so it never is.
_broken_off: list[BaseException] = []


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
    _open_streams()
    try:
        args = make_parser().parse_args(argv)
        with warnings_as_lines(), matplotlib_silent(), interruptible():
            code = int(args.command(args))
            sys.stdout.flush()
            return interrupted_code() if code == INTERRUPTED else code
    except BrokenPipeError:  # whoever reads our output has seen enough of it: meshsimp info | head -3
        with suppress(OSError, ValueError):  # and Python shall not try again at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt as stopped:
        return _interrupted(stopped)
    except MemoryError:
        say(NO_MEMORY)
        return BAD_INPUT
    except Exception as problem:
        if str(problem) == NO_THREAD:
            say(NO_MEMORY)
            return BAD_INPUT
        if not isinstance(problem, InputError):
            raise
        say(" ".join(str(problem).split()))
        return BAD_INPUT


def program() -> NoReturn:
    """Be the shell command: once :func:`main` is done, no signal changes what came of it."""
    sys.unraisablehook = tell_unraisable
    atexit.register(_end)  # the first that is registered is the last that is called
    give_back_at_once()
    code = main()
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    sys.exit(code)


def _interrupted(stopped: BaseException) -> int:
    _broken_off.append(stopped)
    say("interrupted; nothing is written")
    return interrupted_code()


def _end() -> None:
    """End the process without clearing anything away, if a signal has broken something off."""
    if _broken_off:
        with suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(interrupted_code())


def _open_streams() -> None:
    """Have somewhere to print to, whatever the process was started with; what an encoding lacks is escaped."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # it was closed: >&-
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
