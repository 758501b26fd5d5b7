"""Every option of the shell is explained, on one how-to page: as a term of a definition list, or of a command's own."""

import argparse
import re
from pathlib import Path

import pytest

from meshsimp_pymoo.cli.parser import make_parser

PAGES = Path(__file__).parent.parent / "docs" / "how-to"


@pytest.fixture(scope="module")
def explained() -> dict[str, set[str]]:
    """The pages that explain each option: whose lines begin with it, and go on behind a colon on the next."""
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


@pytest.mark.parametrize("command", ["simplify", "run", "pick", "score", "info", "report", "warm", "completion"])
def test_every_option_is_explained_on_one_page(command, explained):
    asked = [name for name in options_of(command) if name not in ("-h", "--help")]
    assert {name: len(explained.get(name, ())) for name in asked} == dict.fromkeys(asked, 1)


def test_no_option_is_explained_that_is_none(explained):
    known = {name for command in ("simplify", "run", "pick", "score", "info", "report", "warm") for name in options_of(command)}
    assert set(explained) <= known
