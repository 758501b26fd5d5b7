"""NumPy archives: heights by name, their distances, damage."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pyramid import hostile_array, refusal, write

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source


def test_an_npz_carries_heights_and_spacing(tmp_path):
    elevation = np.arange(12.0).reshape(3, 4)
    np.savez(tmp_path / "a.npz", elevation=elevation, dx=3.0, dy=[4.0], other=np.zeros((2, 2)))
    np.savez_compressed(tmp_path / "b.npz", heights=elevation, note=np.arange(3))
    assert_array_equal(read_source(tmp_path / "a.npz").points[5], [3, -4, 5])
    assert_array_equal(read_source(tmp_path / "a.npz", Options(spacing=(2, 5))).points[5], [2, -5, 5])
    assert_array_equal(read_source(tmp_path / "b.npz").points[5], [1, -1, 5])
    assert len(read_source(tmp_path / "b.npz", Options(nodata=11)).points) == 11


def test_a_bad_archive_is_refused(tmp_path):
    np.savez(tmp_path / "two.npz", a=np.zeros((3, 3)), b=np.zeros((3, 3)))
    assert "elevation" in refusal(tmp_path / "two.npz")
    np.savez(tmp_path / "dx.npz", elevation=np.zeros((3, 3)), dx=np.zeros(2))
    assert "'dx'" in refusal(tmp_path / "dx.npz")
    np.savez(tmp_path / "whole.npz", elevation=np.zeros((30, 30)))
    data = (tmp_path / "whole.npz").read_bytes()
    for size in range(1, len(data) - 1, 211):
        refusal(write(tmp_path, "cut.npz", data[:size]))
    refusal(write(tmp_path, "text.npz", "no archive"))
    np.savez_compressed(tmp_path / "packed.npz", elevation=np.arange(900.0).reshape(30, 30))
    packed = (tmp_path / "packed.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "packed.npz") as archive:
        packed_size = archive.infolist()[0].compress_size
    for place in range(80, packed_size, 40):
        refusal(write(tmp_path, "changed.npz", packed[:place] + b"\xff\x00\xff" + packed[place + 3 :]))
    with zipfile.ZipFile(tmp_path / "none.npz", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    assert "no arrays" in refusal(tmp_path / "none.npz")


def test_an_archived_array_that_declares_more_than_its_file_holds_allocates_nothing(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("elevation.npy", hostile_array())
    with pytest.raises(ModelError, match=r"elevation.npy: truncated"):
        read_source(tmp_path / "a.npz")


def test_all_shared_grids_are_read(shared_data):
    for path in sorted(shared_data.glob("*.npz")):
        with np.load(path) as arrays:
            elevation, dx, dy = (arrays[key] for key in ("elevation", "dx", "dy"))
        source = read_source(path)
        row, col = np.divmod(source.rows, elevation.shape[1])
        assert len(source.points) == np.isfinite(elevation).sum()
        np.testing.assert_allclose(source.points, np.column_stack([col * dx, -row * dy, elevation[row, col]]))
