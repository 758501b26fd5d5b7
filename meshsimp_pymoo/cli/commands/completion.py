"""``meshsimp completion``: scripts that make a shell complete the commands."""

from __future__ import annotations

import argparse

import shtab

from meshsimp_pymoo.cli.arguments import make_parser
from meshsimp_pymoo.cli.terminal import OK

# Arguments that are files or folders, by their place in ``args``.
PATHS = ("model", "output", "other", "front", "config", "models")


def completion(args: argparse.Namespace) -> int:
    """Print the script for ``args.shell``."""
    parser = make_parser()
    for action in _arguments(parser):
        if action.dest in PATHS and action.choices is None:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, shell=args.shell))
    return OK


def _arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the arguments of all commands."""
    found: list[argparse.Action] = []
    for action in parser._actions:
        found.append(action)
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                found += _arguments(command)
    return found
