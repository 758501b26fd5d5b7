"""ESRI ASCII grids: where they lie, and damage."""

from __future__ import annotations

import pytest
from numpy.testing import assert_array_equal
from pyramid import refusal, write

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source

ASC = "ncols 4\nnrows 3\nxllcorner 100.5\nyllcorner 200\ncellsize 10\nNODATA_value -1\n"
ASC += "0 1 2 3\n4 5 6 7\n8 9 10 {}\n"


def test_an_esri_grid_lies_where_its_header_says(tmp_path):
    source = read_source(write(tmp_path, "a.asc", ASC.format(-1)))
    assert len(source.points) == 11
    assert_array_equal(source.points[0], [105.5, 225, 0])
    assert_array_equal(source.points[-1], [125.5, 205, 10])
    centred = ASC.format(11).replace("corner", "center").replace("NODATA_value -1\n", "").upper()
    source = read_source(write(tmp_path, "b.asc", centred))
    assert_array_equal(source.points[-1], [130.5, 200, 11])
    assert len(read_source(tmp_path / "b.asc", Options(nodata=5)).points) == 11
    assert_array_equal(read_source(tmp_path / "b.asc", Options(spacing=(1, 2))).points[0], [100.5, 204, 0])
    assert len(read_source(write(tmp_path, "c.asc", ASC.format("nan"))).points) == 11


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ("ncols 4", "ncols 5", "5 x 3"),
        ("0 1 2 3", "0 1 2 3 4", "4 x 3 = 12 heights, but 13"),
        ("ncols 4", "ncols 4000000000", "truncated"),
        ("ncols 4\n", "", "lacks ncols"),
        ("ncols 4", "ncols four", "no number"),
        ("cellsize 10\n", "", "lacks cellsize"),
        ("cellsize 10", "cellsize -10", "positive"),
        ("nrows 3", "nrows 1", "at least 2"),
        ("4 5 6", "4 x 6", "'x'"),
        ("8 9 10 11\n", "", "truncated|but 8"),
    ],
)
def test_a_damaged_esri_grid_is_refused(tmp_path, old, new, cause):
    text = ASC.format(11)
    assert old in text
    path = write(tmp_path, "a.asc", text.replace(old, new))
    refusal(path)
    with pytest.raises(ModelError, match=cause):
        read_source(path)
