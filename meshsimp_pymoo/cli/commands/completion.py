"""``meshsimp completion``: scripts that make a shell complete the commands."""

from __future__ import annotations

import argparse

HELP = "print what makes a shell complete these commands"
DESCRIPTION = "Print a script that makes a shell complete the commands, options and files of meshsimp."
EXAMPLES = """\
examples:
  eval "$(meshsimp completion bash)"
      in this session; the same line in ~/.bashrc: always
  meshsimp completion zsh > "${fpath[1]}/_meshsimp"
      zsh, always
"""

SHELLS = ("bash", "zsh", "tcsh")
# Arguments that are files or folders, by their place in ``args``.
PATHS = ("model", "output", "other", "front", "config", "models", "break_lines")


def add(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=" or ".join(SHELLS))


def run(args: argparse.Namespace) -> int:
    """Print the script for ``args.shell``."""
    import shtab

    from meshsimp_pymoo.cli.terminal import OK

    for action in _arguments(args.parser):
        if action.dest in PATHS and action.choices is None:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(args.parser, shell=args.shell))
    return OK


def _arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the arguments of all commands."""
    found: list[argparse.Action] = []
    for action in parser._actions:
        found.append(action)
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                command.fill()
                found += _arguments(command)
    return found
