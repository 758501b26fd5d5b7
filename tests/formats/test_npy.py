"""NumPy files of one array: heights, damage, and what is never unpickled."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pyramid import hostile_array, refusal, write

from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.opening import open_grid


@pytest.mark.parametrize("load", [read_source, open_grid])
def test_the_spelling_of_a_numpy_header_is_no_concern_of_the_user(tmp_path, load):
    """A header of Python 2, which NumPy reads and warns of."""
    np.save(tmp_path / "new.npy", np.arange(12.0).reshape(3, 4))
    content = (tmp_path / "new.npy").read_bytes()
    assert b"(3, 4), }  " in content
    (tmp_path / "old.npy").write_bytes(content.replace(b"(3, 4), }  ", b"(3L, 4L), }"))
    load(tmp_path / "old.npy")


def test_an_npy_carries_heights(tmp_path):
    elevation = np.arange(12.0).reshape(3, 4)
    np.save(tmp_path / "a.npy", elevation)
    assert_array_equal(read_source(tmp_path / "a.npy").points[5], [1, -1, 5])
    assert_array_equal(read_source(tmp_path / "a.npy", Options(spacing=10)).points[5], [10, -10, 5])


def test_a_bad_array_is_refused_and_never_unpickled(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[print, 1], [2, 3]], dtype=object))
    assert "unpickled" in refusal(tmp_path / "a.npy")
    np.save(tmp_path / "whole.npy", np.zeros((30, 30)))
    data = (tmp_path / "whole.npy").read_bytes()
    for size in range(1, len(data) - 1, 211):
        refusal(write(tmp_path, "cut.npy", data[:size]))
    refusal(write(tmp_path, "open.npy", (tmp_path / "whole.npy").read_bytes().replace(b"), }", b"(( {")))


def test_an_array_that_declares_more_than_its_file_holds_allocates_nothing(tmp_path):
    assert "(1000000, 1000000)" in refusal(write(tmp_path, "a.npy", hostile_array()))


def test_a_table_of_points_is_no_grid_and_is_told_its_own(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(9, [("x", "f4"), ("y", "f4"), ("z", "f4")]))
    assert "holds a table of x, y, z, not a grid; save its points as .ply or .xyz" in refusal(tmp_path / "a.npy")


def test_a_header_longer_than_its_file_allocates_nothing(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((5, 5)))
    content = (tmp_path / "a.npy").read_bytes()
    forged = content[:6] + b"\x02\0" + (4_000_000_000).to_bytes(4, "little") + content[10:]
    assert "declares a header of 4000000000 bytes" in refusal(write(tmp_path, "b.npy", forged))
