"""How often what is drawn at random is tried: plain runs take a twentieth of what ``-m slow`` takes."""

from __future__ import annotations

import pytest

SLOW = 20


def tried(name: str, times: int) -> pytest.MarkDecorator:
    """Give a test a number of times under a name; with ``-m slow`` twenty times as many."""
    return pytest.mark.parametrize(name, [times, pytest.param(SLOW * times, marks=pytest.mark.slow)])
