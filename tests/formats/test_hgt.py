"""SRTM tiles: where their names put them, what is void, and what is no tile."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pyramid import refusal, write

from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.opening import count_samples, open_grid

# A tile of a quarter of a degree a step, where real ones have seconds.
HEIGHTS = np.arange(25).reshape(5, 5) * 100 - 30


def tile(folder, name="N47E011.hgt", heights=HEIGHTS):
    return write(folder, name, heights.astype(">i2").tobytes())


@pytest.mark.parametrize(
    ("name", "west", "south"),
    [("N47E011.hgt", 11, 47), ("s01w003.hgt", -3, -1), ("N00E000.SRTMGL1.hgt", 0, 0), ("S90W180.HGT", -180, -90)],
)
def test_a_tile_lies_where_its_name_says(tmp_path, name, west, south):
    path = tile(tmp_path, name)
    with pytest.warns(ModelWarning, match="its coordinates are degrees"):
        source = read_source(path)
    # rows from the north; the outermost samples lie on whole degrees
    assert_array_equal(
        source.points[[0, 6, 24]], [[west, south + 1, -30], [west + 0.25, south + 0.75, 570], [west + 1, south, 2370]]
    )
    assert source.georeference.items() >= {"epsg": 4326, "unit": "degree"}.items()
    assert source.georeference["scale"][1] == pytest.approx(111_200, rel=0.01)  # metres to a degree of latitude
    with pytest.warns(ModelWarning, match="degrees"):
        assert_array_equal(open_grid(path).file_points[np.arange(25)], source.points)
    assert count_samples(path) == 25


@pytest.mark.filterwarnings("ignore:.*its coordinates are degrees")
def test_voids_are_no_samples(tmp_path):
    heights = HEIGHTS.copy()
    heights[2, 3] = -32768
    assert_array_equal(read_source(tile(tmp_path, heights=heights)).rows, np.delete(np.arange(25), 13))
    assert len(read_source(tile(tmp_path), Options(nodata=70)).points) == 24


def test_with_a_spacing_a_tile_needs_no_place(tmp_path):
    for name in ("tile.hgt", "N91E011.hgt", "N47E181.hgt", "N47E0110.hgt"):
        message = refusal(tile(tmp_path, name))
        assert "name it after its corner in the south-west, such as N47E011.hgt, or give" in message
    for name in ("tile.hgt", "N47E011.hgt"):
        source = read_source(tile(tmp_path, name), Options(spacing=(20, 30)))
        assert_array_equal(source.points[24], [80, -120, 2370])
        assert source.georeference == {}


@pytest.mark.filterwarnings("ignore:.*its coordinates are degrees")
def test_a_tile_of_the_far_north_has_every_other_column(tmp_path):
    path = tile(tmp_path, "N60E010.hgt", np.zeros((3601, 1801), np.int16))
    points = read_source(path, Options(window=(1799, 3599, 2, 2))).points
    assert_allclose(
        points[:, :2], [[10 + 1799 / 1800, 60 + 1 / 3600], [11, 60 + 1 / 3600], [10 + 1799 / 1800, 60], [11, 60]]
    )


@pytest.mark.parametrize("size", [1, 2, 7, 49, 51, 2 * 8 * 8, 2 * 1201 * 1200])
def test_other_sizes_are_no_tile(tmp_path, size):
    assert f"its {size} bytes are no tile" in refusal(write(tmp_path, "N47E011.hgt", bytes(size)))
