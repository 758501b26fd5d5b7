"""Fixtures of the tests of tiles."""

from __future__ import annotations

import pytest

from meshsimp_pymoo.search import coarse

MOVES = coarse.MOVES


@pytest.fixture(scope="module")
def few_moves():
    """Let the smallest meshes of a module be moved little: how good they become is shown in test_tiles.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coarse, "MOVES", 4)
        yield


@pytest.fixture
def all_moves(few_moves, monkeypatch):
    """Let a test of such a module move them as other processes do."""
    monkeypatch.setattr(coarse, "MOVES", MOVES)
