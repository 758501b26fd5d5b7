"""The parser of the command line: one sub-parser for each file in `cli.commands`, filled when it is needed."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from meshsimp_pymoo.cli import commands
from meshsimp_pymoo.discovery import modules_in
from meshsimp_pymoo.errors import UsageError, nearest

# The order in which the commands are listed; one that is not named here comes last.
ORDER = ("simplify", "pick", "levels", "quality", "score", "info", "run", "report", "warm", "completion")
MODELS = """\
MODEL is a file - a mesh, a height grid or a point cloud; `meshsimp info --help` lists
the formats - or a built-in model such as jacksboro:11, face:5000 or roof;
`meshsimp info` lists these.
"""


class Parser(argparse.ArgumentParser):
    """Raises instead of printing the usage and exiting, names its own help, and knows what was probably meant.

    Parameters
    ----------
    fill : callable, optional
        Adds the arguments, once they are needed.
    **kwargs
        Of ``argparse.ArgumentParser``.
    """

    def __init__(self, *, fill: Callable[[Parser], None] | None = None, **kwargs: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, **kwargs)
        self._fill = fill

    def fill(self) -> None:
        """Add the arguments, if that has not been done."""
        fill, self._fill = self._fill, None
        if fill is not None:
            fill(self)

    def format_help(self) -> str:
        """Return the help, with all arguments."""
        self.fill()
        return super().format_help()

    def error(self, message: str) -> NoReturn:
        """Raise a UsageError that names the help of this command."""
        raise UsageError(f"{message} (see {self.prog} --help)")

    def parse_known_args(  # type: ignore[override]
        self, args: Any = None, namespace: Any = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Refuse what is left over here, where the options of this command are known."""
        self.fill()
        found, rest = super().parse_known_args(args, namespace)
        if rest:
            self.error(f"unrecognized arguments: {' '.join(rest)}{self._meant(rest)}")
        return found, []

    def _meant(self, rest: Sequence[str]) -> str:
        known = [option for option in self._option_string_actions if option.startswith("--")]
        near = []
        for word in rest:
            if word.startswith("-"):
                name = "--" + word.lstrip("-").partition("=")[0].lower().replace("_", "-")
                near += [option for option in known if option.startswith(name)] or difflib.get_close_matches(
                    name, known, n=1
                )
        return f"; did you mean {', '.join(dict.fromkeys(near))}?" if near else ""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        choices = [str(choice) for choice in action.choices]
        near = nearest(str(value), choices)
        text = f"invalid choice: {str(value)!r} (choose from {', '.join(choices)})"
        if isinstance(action, argparse._SubParsersAction) and (Path(value).suffix or Path(value).exists()):
            text += f"; did you mean meshsimp simplify {value}?"
        elif near:
            text += f"; did you mean {near}?"
        raise argparse.ArgumentError(action, text)


def make_parser() -> Parser:
    """Return the parser of the whole command line; ``args.command(args)`` then runs the command."""
    parser = Parser(
        prog="meshsimp",
        description="Simplify a mesh: not to one mesh, but to the whole trade-off between accuracy and size.",
        epilog=MODELS + "\n`meshsimp COMMAND --help` has examples of each command.\n",
    )
    parser.add_argument("--version", action=_Version, nargs=0, dest=argparse.SUPPRESS, help="show the version and exit")
    listed = parser.add_subparsers(title="commands", metavar="COMMAND")
    parser.set_defaults(command=lambda _: parser.error(f"a command is missing: {', '.join(listed.choices)}"))
    for name, command in _commands():
        added = listed.add_parser(name, help=command.HELP, description=command.DESCRIPTION, fill=_filling(command))
        added.set_defaults(command=command.run, parser=parser)
    return parser


def _commands() -> Iterator[tuple[str, ModuleType]]:
    names = modules_in(commands.__path__)
    for name in sorted(names, key=lambda name: (ORDER.index(name) if name in ORDER else len(ORDER), name)):
        yield name, import_module(f"{commands.__name__}.{name}")


def _filling(command: ModuleType) -> Callable[[Parser], None]:
    def fill(parser: Parser) -> None:
        command.add(parser)
        parser.epilog = command.EXAMPLES + (f"\n{parser.epilog}" if parser.epilog else "")

    return fill


class _Version(argparse.Action):
    def __call__(self, *_: Any, **__: Any) -> NoReturn:
        from importlib.metadata import version

        print(f"meshsimp {version('meshsimp-pymoo')}")
        raise SystemExit(0)
