"""ESRI's binary grids: two files, either order of bytes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pyramid import refusal, write

from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.opening import count_samples, open_grid

HEADER = "ncols 4\nnrows 3\nxllcorner 100\nyllcorner 200\ncellsize 10\nNODATA_value -9999\n"
HEIGHTS = np.arange(12, dtype=np.float32).reshape(3, 4) / 3


@pytest.mark.parametrize(
    ("order", "said", "suffix"),
    [("<", "byteorder LSBFIRST\n", ".hdr"), (">", "BYTEORDER M\n", ".HDR"), ("<", "", ".hdr")],
)
def test_both_orders_of_bytes_are_read(tmp_path, order, said, suffix):
    path = write(tmp_path, "a.flt", HEIGHTS.astype(f"{order}f4").tobytes())
    write(tmp_path, f"a{suffix}", HEADER + said)
    source = read_source(path)
    assert_array_equal(source.points[[0, 11]], [[105, 225, 0], [135, 205, np.float32(11) / np.float32(3)]])
    assert count_samples(path) == 12
    assert_array_equal(open_grid(path).file_points[np.arange(12)], source.points)
    assert_array_equal(read_source(path, Options(spacing=1)).points[11, :2], [103.5, 200.5])


def test_a_height_that_is_none_is_no_sample(tmp_path):
    heights = HEIGHTS.copy()
    heights[0, 0] = -9999
    write(tmp_path, "a.hdr", HEADER)
    assert_array_equal(read_source(write(tmp_path, "a.flt", heights.tobytes())).rows, np.arange(1, 12))


def test_files_that_do_not_fit_together_are_refused(tmp_path):
    path = write(tmp_path, "a.flt", HEIGHTS.tobytes())
    assert "there is no header a.hdr beside it" in refusal(path)
    write(tmp_path, "a.hdr", HEADER.replace("ncols 4", "ncols 5"))
    assert "declares 5 x 3 heights of 4 bytes, but it has 48 bytes" in refusal(path)
    write(tmp_path, "a.hdr", HEADER + "byteorder VAX\n")
    assert "the byteorder 'vax' is neither" in refusal(path)
    write(tmp_path, "a.hdr", "nonsense")
    with pytest.raises(ValueError, match=r"a\.hdr: its header lacks ncols, nrows, cellsize"):
        read_source(path)
