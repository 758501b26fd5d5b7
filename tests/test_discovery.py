"""Which files of a room are its parts."""

from __future__ import annotations

import pytest

from meshsimp_pymoo.discovery import modules_in


def test_modules_are_found_by_being_there_and_what_an_editor_leaves_is_none(tmp_path):
    for name in ("asc.py", "ply.py", "__init__.py", "ply.py~", "ply (copy).py", "2.py", "notes.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / ".#asc.py").symlink_to("someone@somewhere.1234:5678")  # Emacs, while somebody edits asc.py
    (tmp_path / "source").mkdir()
    assert modules_in([str(tmp_path)]) == ["asc", "ply"]


def test_a_package_that_lies_in_no_folder_says_so(tmp_path):
    with pytest.raises(ImportError, match=r"no modules in .*all\.zip; .* install it into a folder"):
        modules_in([str(tmp_path / "all.zip")])
