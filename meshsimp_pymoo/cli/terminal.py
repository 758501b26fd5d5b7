"""What a person at a terminal sees and does: one-line messages, progress, Ctrl-C."""

from __future__ import annotations

import _thread
import json
import logging
import math
import os
import re
import shutil
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ResultError, printable, reason_of
from meshsimp_pymoo.surface.measures import LENGTH, MEASURES, OF_LINES
from meshsimp_pymoo.surface.units import in_unit

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    import numpy.typing as npt

    from meshsimp_pymoo.surface.kinds import Model
    from meshsimp_pymoo.surface.measures import Quality

    FloatArray = npt.NDArray[np.float64]

__all__ = [
    "BAD_INPUT",
    "DRAWING",
    "ENDING",
    "INTERRUPTED",
    "OK",
    "TARGET_MISSED",
    "TERMINATED",
    "WRITING",
    "Stages",
    "answering",
    "await_interruption",
    "bar",
    "described",
    "front_in_words",
    "interrupted_code",
    "interruptible",
    "is_interrupted",
    "matplotlib_silent",
    "place_for_matplotlib",
    "say",
    "stop_if_interrupted",
    "tell",
    "tell_drawn",
    "tell_origin",
    "tell_unraisable",
    "there",
    "warnings_as_lines",
]

OK, TARGET_MISSED, BAD_INPUT, INTERRUPTED, TERMINATED = 0, 1, 2, 130, 143

# What is said to signals while results are written that may have taken hours, and while they are drawn.
WRITING = (
    "stopping as soon as the results are written, without pictures",
    "still writing the results; once more ends it at once, without them",
    "stopping without results",
)
DRAWING = ("stopping without all pictures; the results are in place",)

# Signals that ask a program to end.
ENDING = (signal.SIGINT, signal.SIGTERM)

# Where nobody sees a bar: seconds between two lines of progress, and at least this share of the time so far.
LINE_SECONDS, LINE_SHARE = 10.0, 0.05

# What is said where a stage of which only the clock tells takes so much longer than it was thought to [s].
LATE, LATE_SECONDS = "longer than estimated", 1.0

# Of the name before the progress bar; the front so far is to fit beside it into 80 columns.
LONGEST_NAME = 18


@dataclass
class _Part:
    """A part of the work, and the signals that came in it."""

    #: What is said to the first one, the second one ...; the last words are for all others.
    answers: tuple[str, ...] = ()
    #: How many came. Libraries may swallow the exception, while they are imported, say.
    came: int = 0
    #: How many of them have been answered.
    answered: int = 0


class _Signals:
    """What came of Ctrl-C and SIGTERM, and what is to be done about it."""

    #: The first that came, which decides the exit code.
    first: int | None = None
    #: The part of the work that is being done.
    part = _Part()
    #: The part that each signal stopped. Its answer may come when that is past.
    stopped: tuple[_Part, ...] = ()
    #: How many more are no new ones.
    repeated = 0


@contextmanager
def interruptible() -> Iterator[None]:
    """Answer Ctrl-C and SIGTERM at once, in a word, and raise KeyboardInterrupt; see :func:`answering`.

    Schedulers and containers end a program by SIGTERM: what is found so far is written then too. Python acts upon a
    signal when the main thread comes back to it, perhaps seconds later; so the word is that of another thread.
    """
    _Signals.first, _Signals.stopped = None, ()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    bell, hand = os.pipe()
    os.set_blocking(hand, False)
    woken = signal.set_wakeup_fd(hand, warn_on_full_buffer=False)
    before = {number: signal.signal(number, _note) for number in ENDING}
    unraisable, sys.unraisablehook = sys.unraisablehook, _raise_again
    answering_thread = threading.Thread(target=_answer, args=(bell,), name="meshsimp-answers", daemon=True)
    answering_thread.start()
    try:
        with answering("stopping"):
            yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = unraisable
        signal.set_wakeup_fd(woken)
        os.close(hand)
        answering_thread.join()
        os.close(bell)


@contextmanager
def answering(*answers: str) -> Iterator[None]:
    """Set what is said to the signals that come in a part of the work; what came before is past.

    With the last of the answers KeyboardInterrupt is raised. The signal after that is only answered, so that what ends
    now can end; if there are still more, it is raised again.
    """
    before = _Signals.part
    if before.answers and before.came >= len(before.answers):
        raise KeyboardInterrupt  # a library has swallowed it, while it was imported, say
    _Signals.part = _Part(answers)
    try:
        yield
    finally:
        _Signals.part = _Part(before.answers)


def _note(signum: int, frame: Any) -> None:
    part = _Signals.part
    _Signals.first = _Signals.first or signum
    _Signals.stopped += (part,)
    part.came += 1
    if part.came >= len(part.answers) and part.came != len(part.answers) + 1:
        raise KeyboardInterrupt


def tell_unraisable(lost: Any) -> None:
    """Say what can raise nothing, as Python does, but not what a signal has stopped halfway in a library."""
    if _Signals.first is None:
        sys.__unraisablehook__(lost)


def _raise_again(lost: Any) -> None:
    """Raise KeyboardInterrupt a moment later where it met what can raise nothing, such as the end of an object."""
    if lost.exc_type is not KeyboardInterrupt or _Signals.first is None:
        tell_unraisable(lost)
        return
    _Signals.part.came -= 1
    _Signals.repeated += 1
    threading.Timer(0.05, _thread.interrupt_main, (int(_Signals.first),)).start()


def _answer(bell: int) -> None:
    """Say a word whenever a signal came, until the other end is closed."""
    rung = 0
    while number := os.read(bell, 1):
        if number[0] not in ENDING:
            continue
        # Python may have acted upon it already, and be at the next part
        stopped = _Signals.stopped
        part = stopped[rung] if rung < len(stopped) else _Signals.part
        rung += 1
        if _Signals.repeated:
            _Signals.repeated -= 1
        elif part.answers:
            word = part.answers[min(part.answered, len(part.answers) - 1)]
            part.answered += 1
            with suppress(OSError, ValueError):  # nobody is there to hear it
                say(word)


def interrupted_code() -> int:
    """Return the exit code of what was interrupted: as the shell has it for the signal that came."""
    return TERMINATED if _Signals.first == signal.SIGTERM else INTERRUPTED


def is_interrupted() -> bool:
    """Tell whether Ctrl-C or SIGTERM came in this part of the work."""
    return _Signals.part.came > 0


def await_interruption() -> None:
    """Wait for the KeyboardInterrupt that met what can raise nothing, if one did: it is raised in here."""
    while _Signals.repeated:
        time.sleep(0.01)


def stop_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C or SIGTERM came in this part of the work, even if a library swallowed it."""
    if is_interrupted():
        raise KeyboardInterrupt


def front_in_words(model: Model, evaluations: int, F: FloatArray) -> str:
    """Return what a search has found so far, for the line of its progress."""
    from meshsimp_pymoo.search.display import errors_at, usual_sizes

    sizes = usual_sizes(len(model.faces))
    errors = zip(errors_at(F, sizes), sizes, strict=True)
    so_far = [f"{error:.3g}@{size}" for error, size in errors if not math.isnan(error)]
    return " ".join(["error", *so_far, f"after {evaluations:,} evaluations"])


def _is_seen(quiet: bool) -> bool:
    return not quiet and sys.stderr.isatty()


class Stages:
    """The progress of a command as a whole: one bar and one estimate of the time left, over stages that follow.

    Parameters
    ----------
    quiet : bool
        Whether nothing is shown.
    name : str
        What it is about.
    plan : mapping
        The stages in their order, and about how many seconds each takes.
    lines : bool
        Whether a line is said now and then where there is no terminal.
    """

    def __init__(self, quiet: bool, name: str, plan: Mapping[str, float], *, lines: bool = False) -> None:
        self.quiet = quiet
        #: What each stage has taken [s].
        self.seconds: dict[str, float] = {}
        self._plan = dict(plan)
        self._is_shown = _is_seen(quiet) or (lines and not quiet)
        self._shown = ExitStack()
        self._draw = self._shown.enter_context(bar(quiet, name, timed=False, lines=lines))
        self._begun = time.perf_counter()

    def expect(self, stage: str, seconds: float) -> None:
        """Say about how many seconds a stage will take."""
        self._plan[stage] = seconds

    @contextmanager
    def stage(self, stage: str, state: str) -> Iterator[Callable[[float, str], None]]:
        """Enter a stage; yields what shows the share of it that is done and a word. Until then the clock tells."""
        begun = time.perf_counter()
        told: tuple[float, str] = (0.0, state)
        later = sum(seconds for name, seconds in self._plan.items() if name not in self.seconds and name != stage)
        done = threading.Event()

        def draw() -> None:
            now = time.perf_counter()
            share, words = told
            left = (now - begun) * (1 - share) / share if share > 0 else max(self._plan[stage] - (now - begun), 0.0)
            spent = now - self._begun
            is_late = share == 0 and now - begun > self._plan[stage] + LATE_SECONDS
            known = LATE if is_late else f"{_in_words(left + later)} left"
            self._draw(spent / max(spent + left + later, 1e-9), f"{known}; {words}")

        def show(share: float, words: str) -> None:
            nonlocal told
            told = min(share, 1.0), words

        def tick() -> None:
            draw()
            while not done.wait(0.2):
                draw()

        ticking = threading.Thread(target=tick, name="meshsimp-progress", daemon=True)
        if self._is_shown:
            ticking.start()
        try:
            yield show
        finally:
            done.set()
            if self._is_shown:
                ticking.join()
                draw()
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begun

    def close(self) -> None:
        """Clear the line."""
        self._shown.close()

    def __enter__(self) -> Stages:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _in_words(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole} s" if whole < 100 else f"{whole // 60}:{whole % 60:02} min"


@contextmanager
def bar(quiet: bool, name: str, *, timed: bool = True, lines: bool = True) -> Iterator[Callable[[float, str], None]]:
    """Yield what shows (share done, what is being done): on a terminal a line of its width; elsewhere one now and then.

    With ``timed`` the time that is left is reckoned from the shares; without ``lines`` there is nothing elsewhere.
    """
    if not _is_seen(quiet):
        if quiet or not lines:
            yield lambda share, state: None
        else:
            with _lines(name) as show:
                yield show
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
    from rich.table import Column

    one_line = Column(no_wrap=True, overflow="ellipsis", ratio=1)
    columns = (
        TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True)),
        BarColumn(bar_width=8),
        TextColumn("{task.percentage:>2.0f} %", table_column=Column(no_wrap=True)),
        *([TimeRemainingColumn(compact=True, table_column=Column(no_wrap=True))] if timed else []),
        TextColumn(("left; " if timed else "") + "{task.fields[state]}", markup=False, table_column=one_line),
    )
    short = name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"
    # steps of an experiment can be a minute apart: the speed is that of the last ten minutes
    with Progress(
        *columns, console=Console(stderr=True), transient=True, speed_estimate_period=600, expand=True
    ) as shown:
        task = shown.add_task(short, total=1.0, state="")

        def show(share: float, state: str) -> None:
            shown.update(task, completed=min(share, 1.0), state=state)

        yield show


@contextmanager
def _lines(name: str) -> Iterator[Callable[[float, str], None]]:
    """Yield what takes the progress, and say it now and then, further and further apart."""
    begun, told, done = time.perf_counter(), (0.0, ""), threading.Event()

    def show(share: float, state: str) -> None:
        nonlocal told
        told = min(share, 0.99), state  # what is still said is not done

    def speak() -> None:
        pause = LINE_SECONDS
        while not done.wait(pause):
            spent, (share, state) = time.perf_counter() - begun, told
            known = "" if state.startswith(LATE) else f"{share:.0%} "
            say(f"{name}: {known}after {_in_words(spent)}{state and '; '}{state}")
            pause = max(LINE_SECONDS, LINE_SHARE * spent)

    speaking = threading.Thread(target=speak, name="meshsimp-lines", daemon=True)
    speaking.start()
    try:
        yield show
    finally:
        done.set()
        speaking.join()


@contextmanager
def warnings_as_lines() -> Iterator[None]:
    """Print our own warnings as one line each, once, though a model may be read again; others as usual."""
    show_others = warnings.showwarning
    said: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *rest: Any, **kwargs: Any) -> None:
        if category.__module__.partition(".")[0] == "meshsimp_pymoo":
            line = "warning: " + " ".join(str(message).split())
            if line not in said:
                say(line)
            said.add(line)
        else:
            show_others(message, category, *rest, **kwargs)

    with warnings.catch_warnings():
        warnings.showwarning = show
        warnings.filterwarnings("always", module=r"meshsimp_pymoo(\.|$)")
        yield


@contextmanager
def matplotlib_silent() -> Iterator[None]:
    """Keep to itself what matplotlib says of a home that cannot be written, and of its fonts."""
    log = logging.getLogger("matplotlib")
    before = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(before)


@contextmanager
def place_for_matplotlib(folder: Path) -> Iterator[None]:
    """Let matplotlib keep its cache in a folder while it draws, where there is no place for temporary files."""
    try:
        tempfile.gettempdir()
        is_needed = False
    except OSError:
        is_needed = "matplotlib" not in sys.modules and "MPLCONFIGDIR" not in os.environ
    if not is_needed:
        yield
        return
    own = folder / ".matplotlib"
    os.environ["MPLCONFIGDIR"] = str(own.resolve())
    try:
        yield
    finally:
        del os.environ["MPLCONFIGDIR"]
        shutil.rmtree(own, ignore_errors=True)


def described(quality: Quality, unit: str = LENGTH) -> str:
    """Return the size of a mesh, and each of its numbers that has a meaning of its own, in words."""
    said = [f"{quality.triangles:,} triangles"]
    for name, measure in MEASURES.items():
        value = getattr(quality, name)
        if measure.meaning and not math.isnan(value):
            number = f"{value:.{6 if name == 'error' else 4}g}" if isinstance(value, float) else f"{value}"
            behind = in_unit(unit) if measure.is_error else f" {measure.unit}" * bool(measure.unit)
            if measure.is_share and value:
                percent = 100 * value
                number, behind = f"{round(percent, 1) or float(f'{percent:.1g}'):g}", " %"
            said.append(f"{measure.label.removesuffix(' error')} {number}{behind}")
    return ", ".join(said)


def in_numbers(quality: Quality) -> dict[str, float | None]:
    """Return the numbers of a mesh by name, as JSON holds them: what is not known is null.

    Those of break lines are left out where there are none.
    """
    known = {name: None if math.isnan(value) else value for name, value in asdict(quality).items()}
    return {name: value for name, value in known.items() if value is not None or name not in OF_LINES}


def solid_in_words(numbers: Mapping[str, Any], unit: str) -> str:
    """Return what there is to say of a mesh that was closed for printing, whose other numbers are its surface's."""
    volume = f"{numbers['volume']:.6g}{' cubic' * (unit != LENGTH)}{in_unit(unit)}"
    parted = f", parted at {numbers['parted']:,} places where its outline touched itself" if "parted" in numbers else ""
    return (
        f"with walls and a base {numbers['thickness']:g}{in_unit(unit)} below the lowest point the file has "
        f"{numbers['triangles']:,} triangles, volume {volume}{parted}; the numbers above are those of the surface"
    )


def say(line: str) -> None:
    """Print one line on stderr."""
    print(f"meshsimp: {printable(with_options(line))}", file=sys.stderr)


def with_options(line: str) -> str:
    """Return what a message of the package says with the options, without what Python calls them.

    >>> with_options("cut it with --patch front (patch='front')"), with_options("say classes=2 (--classes 2)")
    ('cut it with --patch front', 'say --classes 2')
    """
    line = re.sub(r"(--[a-z-]+ \S+) \([a-z_]+='[^']*'\)", r"\1", line)
    return re.sub(r"\b[a-z_]+=\S+ \((--[^()]+)\)", r"\1", line)


def there(folder: Path, *names: str) -> str:
    """Return those names that are files of a folder, in a row: a picture may have failed."""
    return ", ".join(name for name in names if (folder / name).is_file())


def tell_origin(origin: Sequence[float]) -> None:
    """Say from which origin the coordinates of meshes count."""
    place = ", ".join(f"{value:.15g}" for value in origin)
    tell(f"origin of the glb meshes: ({place}); each file states it")


def tell_drawn(folder: Path, pictures: tuple[str, ...], solutions: int, *, quiet: bool, as_json: bool) -> int:
    """Say which pictures of a front there are now; return the exit code, which says whether these are all."""
    made = {key: name for key, name in zip(("picture", "page"), pictures, strict=False) if (folder / name).is_file()}
    if as_json:
        found = {key: str(folder / name) for key, name in made.items()}
        tell(json.dumps(found | {"solutions": solutions}, indent=2))
    elif made and not quiet:
        tell(f"written: {folder}: {', '.join(made.values())} ({solutions} solutions)")
    return OK if len(made) == len(pictures) else BAD_INPUT


def tell(lines: str) -> None:
    """Print results, without what a terminal would obey.

    Raises
    ------
    ResultError
        If there is no room for them, on a full disk, say; what the command has written is in place.
    """
    try:
        print(printable(lines, keep="\n"), flush=True)
    except BrokenPipeError:  # whoever reads them has seen enough
        raise
    except OSError as problem:
        with suppress(OSError, ValueError):  # and Python shall not try again at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise ResultError(f"the results are in place, but cannot be printed ({reason_of(problem)})") from None
