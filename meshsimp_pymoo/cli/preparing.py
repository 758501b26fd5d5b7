"""What has to be compiled before a command can do its work, with a word about it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager

from meshsimp_pymoo.cli.terminal import Stages, await_interruption, say
from meshsimp_pymoo.compiling.store import place, told_of_compiling
from meshsimp_pymoo.formats.table import listed
from meshsimp_pymoo.warming import Warming

ONCE = "compiling once for this machine"


class Compiling:
    """The compiling of a command: :meth:`finish` ends it; ``seconds`` says how long it has taken so far."""

    def __init__(self, shown: Stages, stack: ExitStack) -> None:
        self._shown = shown
        self._stack = stack
        self._names: set[str] = set()
        self.seconds = 0.0

    def begin(self, names: Iterable[str]) -> None:
        """Begin to compile what is missing of these parts, and say so; what else was begun is left."""
        self._stack.close()
        self._names = set(names)
        warming = self._warming = Warming(self._names)
        self._shown.expect("compiling", warming.expected)
        if warming.parts and not self._shown.quiet:
            if not sys.stderr.isatty():
                say(f"{_once(warming)} (longer on a busy machine)")
            _say_where()
        self._stack.enter_context(warming)

    def finish(self, names: Iterable[str] | None = None) -> None:
        """Compile what is missing still; of these parts, where it turned out that others are needed than were begun."""
        if names is not None and set(names) != self._names:
            self.begin(names)
        if not self._warming.parts:
            return
        before = self.seconds
        with self._shown.stage("compiling", _once(self._warming)):
            try:
                self._warming.finish()
            except Exception:
                await_interruption()  # the compiler may swallow one, and fail of what that has left
                raise
        self.seconds = before + self._shown.seconds["compiling"]


@contextmanager
def compiling(names: Iterable[str], shown: Stages) -> Iterator[Compiling]:
    """Begin to compile what is missing of these parts, and say so; whatever is compiled in here is counted."""
    with ExitStack() as stack:
        found = Compiling(shown, stack)

        def told(_: object, seconds: float | None) -> None:
            found.seconds += seconds or 0.0

        found.begin(names)
        with told_of_compiling(told):
            yield found


def compile_first(names: Iterable[str], *, quiet: bool) -> None:
    """Compile what is missing of these parts, and say so."""
    with (
        Stages(quiet, "compiling", {"compiling": 0.0}, lines=True) as shown,
        compiling(names, shown) as under_way,
    ):
        under_way.finish()


@contextmanager
def said_when_compiling(quiet: bool) -> Iterator[None]:
    """Say once, if something has to be compiled in here, that it is; for what takes a few seconds at most."""
    said = quiet

    def told(_: object, seconds: float | None) -> None:
        nonlocal said
        if not said:
            said = True
            say(f"{ONCE}, a few seconds")
            _say_where()

    with told_of_compiling(told):
        yield


def _once(warming: Warming) -> str:
    """Say that parts are compiled, which where it is not all that a search needs, and about how long it takes."""
    names = [part.name for part in warming.parts]
    what = "" if "evaluation" in names else f": {listed(names, 'and')}"
    return f"{ONCE}{what}, about {warming.expected:.0f} s"


def _say_where() -> None:
    """Say where machine code is kept, if not in the usual place."""
    found = place()
    if found.folder is None:
        say(
            f"warning: compiled code can be kept nowhere ({'; '.join(found.refused)}), so every command compiles anew; "
            "set NUMBA_CACHE_DIR to a folder that can be written"
        )
    elif found.refused:
        say(f"compiled code is kept in {found.folder} ({'; '.join(found.refused)})")
