"""Every option of the shell is explained on one how-to page, as a term of a definition list."""

import argparse
import re
from pathlib import Path

import pytest

from meshsimp_pymoo.cli.parser import make_parser

COMMANDS = ("simplify", "pick", "levels", "quality", "score", "info", "run", "report", "warm", "completion")
PAGES = Path(__file__).parent.parent / "docs" / "how-to"


@pytest.fixture(scope="module")
def explained() -> dict[str, set[str]]:
    """The pages that explain each option."""
    found: dict[str, set[str]] = {}
    for page in PAGES.glob("*.md"):
        for term in re.findall(r"^(`-.*)\n: ", page.read_text(encoding="utf-8"), re.MULTILINE):
            for option in re.findall(r"`(--?[a-z][a-z-]*)", term):
                found.setdefault(option, set()).add(page.name)
    return found


def options_of(command: str) -> list[str]:
    (commands,) = (item for item in make_parser()._actions if isinstance(item, argparse._SubParsersAction))
    commands.choices[command].fill()
    return [name for item in commands.choices[command]._actions for name in item.option_strings]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_explained_on_one_page(command, explained):
    asked = [name for name in options_of(command) if name not in ("-h", "--help")]
    assert {name: len(explained.get(name, ())) for name in asked} == dict.fromkeys(asked, 1)


def test_no_option_is_explained_that_is_none(explained):
    known = {name for command in COMMANDS for name in options_of(command)}
    assert set(explained) <= known
