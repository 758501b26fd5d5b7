"""ESRI ASCII grids: where they lie, and damage."""

from __future__ import annotations

import pytest
from numpy.testing import assert_array_equal
from pyramid import refusal, write

from meshsimp_pymoo.errors import ModelError, ModelWarning
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


HEAD = "ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 2\n"
BODY = "1.5 2 3\n4 5 6.25\n"


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + HEAD + BODY,
        (HEAD + BODY).encode("utf-16"),
        (HEAD + BODY).replace("\n", "\r\n"),
        HEAD.replace(" ", ": ") + "\n" + BODY,
        HEAD.replace("2\n", "2,0\n").replace("nrows 2,0", "nrows 2") + BODY.replace(".", ","),
        HEAD + BODY.replace(" ", ","),
        HEAD + "byteorder LSBFIRST\n" + BODY,
        HEAD + "NODATA_value null\n" + BODY,
        HEAD + "NODATA_value NaN\n" + BODY,
        " 3  ncols\n 2  nrows\n 1.1e1  xlower\n 2.1e1  ylower\n 2.0  2.0  cellsize\n -9999  nodata_value\n" + BODY,
        HEAD.replace("cellsize 2", "dx 2\ndy 2") + BODY.replace(" ", "\n"),
    ],
)
def test_the_header_and_the_numbers_have_many_spellings(tmp_path, text):
    source = read_source(write(tmp_path, "a.asc", text))
    places = [[x, y] for y in (23, 21) for x in (11, 13, 15)]
    assert_array_equal(source.points[:, :2], places)
    assert_array_equal(source.points[:, 2], [1.5, 2, 3, 4, 5, 6.25])


@pytest.mark.parametrize("word", ["null", "NULL", "nan", "N/A"])
def test_a_word_may_stand_where_there_is_no_height(tmp_path, word):
    text = f"{HEAD}NODATA_value {word}\n{word} 2 3\n4 5 {word.lower()}\n"
    assert_array_equal(read_source(write(tmp_path, "a.asc", text)).rows, [1, 2, 3, 4])


def test_what_a_header_says_beside_is_left_out_with_a_word(tmp_path):
    path = write(tmp_path, "a.asc", HEAD + "projection UTM zone 33\nzunits metres\n" + BODY)
    with pytest.warns(ModelWarning, match="the lines projection, zunits of its header mean nothing here"):
        assert len(read_source(path).points) == 6


@pytest.mark.parametrize(
    "text", ["1 2 3\n4 5 6\n", "//X Y Z\n1 2 3\n", "X,Y,Z\n1,2,3\n", "412015.2 5259015.1 301.5 7 8 9\n"]
)
def test_a_cloud_with_the_suffix_of_a_grid_is_told_its_own(tmp_path, text):
    assert "if it holds a point cloud, x y z in every line, rename it to .xyz" in refusal(
        write(tmp_path, "a.asc", text)
    )


@pytest.mark.parametrize(("where", "first"), [("corner", (105.5, 25)), ("center", (100.5, 20))])
def test_an_axis_that_is_not_said_begins_at_0_in_the_sense_of_the_other(tmp_path, where, first):
    text = ASC.format(-1).replace("yllcorner 200\n", "").replace("corner", where)
    with pytest.warns(ModelWarning, match=f"its header has xll{where}, but no yll{where}, which is taken for 0"):
        source = read_source(write(tmp_path, "a.asc", text))
    assert_array_equal(source.points[0, :2], first)
