"""How much memory is free, and what does not fit into it."""

from __future__ import annotations

import pytest

from meshsimp_pymoo import memory
from meshsimp_pymoo.errors import ModelError


def test_the_free_memory_is_what_the_system_and_the_limits_say(tmp_path, monkeypatch):
    for_all, _ = memory.free_memory()
    assert 1 << 20 < for_all
    (tmp_path / "memory.stat").write_text("anon 5\nfile 300\n")
    (tmp_path / "memory.current").write_text("1000\n")
    (tmp_path / "memory.max").write_text("5000\n")
    monkeypatch.setattr(memory, "CONTROL_GROUPS", ((str(tmp_path), "memory.max", "memory.current", "file"),))
    assert memory.free_memory()[0] == 5000 - (1000 - 300)
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.free_memory()[0] > 1 << 20


def test_what_does_not_fit_is_said_with_both_sizes(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: (5.0 * 2**30, 3.0 * 2**30))
    memory.check_free(3.0 * 2**30, "a.npy: its samples", "take a part")
    with pytest.raises(ModelError, match=r"^a.npy: its samples need about 4.5 GiB, and 3.0 GiB are free; take a part$"):
        memory.check_free(4.5 * 2**30, "a.npy: its samples", "take a part")


def test_for_what_is_always_there_nobody_is_asked(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: (0.0, 0.0))
    memory.check_free(memory.NEVER_ASKED, "a.npy: its samples", "take a part")
    with pytest.raises(ModelError, match=r"need about 1 MiB"):
        memory.check_free(memory.NEVER_ASKED + 1, "a.npy: its samples", "take a part")
