"""Height grids: cells, gaps, parts and what is no grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_array_equal
from pyramid import hill

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source.heights import Grid, grid_source
from meshsimp_pymoo.formats.table import read_source


def test_a_grid_runs_east_and_south_and_faces_up():
    elevation = np.arange(12.0).reshape(3, 4)
    source = grid_source(elevation, 2.0, 5.0)
    assert source.up == "z"
    assert len(source.faces) == 2 * 2 * 3
    assert_array_equal(source.points[1], [2, 0, 1])
    assert_array_equal(source.points[4], [0, -5, 4])
    a, b, c = (source.points[source.faces[:, k]] for k in range(3))
    assert_array_equal(np.cross(b - a, c - a)[:, 2], np.full(12, 10.0))


def test_a_grid_knows_its_size_and_how_far_its_samples_are_apart():
    elevation = np.arange(12.0).reshape(3, 4)
    elevation[1, 1] = np.nan
    assert grid_source(elevation, 2.0, 5.0).grid == (4, 3, 2.0, 5.0)
    uneven = Grid(elevation, np.array([0.0, 1.0, 2.0, 4.0]), np.array([9.0, 6.0, 3.0]))
    assert str(uneven.mesh("uneven").grid) == "(4, 3, nan, 3.0)"
    assert uneven.mesh("its west", (0, 0, 3, 3)).grid == (3, 3, 1.0, 3.0)


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_a_cell_without_one_corner_is_one_triangle_facing_up(corner):
    elevation = np.zeros((2, 2))
    elevation[corner] = np.nan
    with pytest.raises(ModelError, match="has 3 vertices"):
        grid_source(elevation)
    beside = np.zeros((2, 1))
    source = grid_source(np.hstack([beside, elevation] if corner[1] else [elevation, beside]))
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (area > 0).all()
    assert area.sum() / 2 == 1.5


@given(
    hidden=hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=7)),
    nodata=st.sampled_from([None, -9999.0, 0.0]),
)
def test_the_area_of_a_grid_is_that_of_its_cells_with_data(hidden, nodata):
    elevation = np.where(hidden, np.nan if nodata is None else nodata, 7.0)
    corners = sum((~hidden[i : i + hidden.shape[0] - 1, j : j + hidden.shape[1] - 1]).astype(int)
                  for i in (0, 1) for j in (0, 1))  # fmt: skip
    expected = (corners == 4).sum() + (corners == 3).sum() / 2
    if expected == 0 or (~hidden).sum() < 4:
        with pytest.raises(ModelError):
            grid_source(elevation, nodata=nodata)
        return
    source = grid_source(elevation, nodata=nodata)
    assert_array_equal(source.rows, np.flatnonzero(~hidden))
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert area.sum() / 2 == expected
    assert (area == 1).all()


def test_missing_samples_are_known_in_the_grids_own_precision_and_by_masks():
    lowest = float(np.float32(-3.4028234663852886e38))
    elevation = np.zeros((3, 3), np.float32)
    elevation[0, 0] = lowest
    assert len(grid_source(elevation, nodata=-3.4028235e38).points) == 8
    whole = np.arange(9, dtype=np.int16).reshape(3, 3)
    assert len(grid_source(whole, nodata=8).points) == 8
    assert len(grid_source(np.ma.masked_equal(whole, 4)).points) == 8


def test_grids_that_are_none_are_refused():
    good = np.zeros((3, 3))
    for elevation, dx, match in [
        (np.zeros(9), 1, "shape"),
        (np.zeros((1, 9)), 1, "shape"),
        (np.zeros((3, 3), complex), 1, "type complex"),
        (np.full((3, 3), "a"), 1, "type"),
        (good, 0, "dx is 0"),
        (good, float("nan"), "dx is nan"),
        (np.full((3, 3), np.inf), 1, r"9 of 9 heights are infinite \(first: row 0, column 0"),
        (np.full((3, 3), np.nan), 1, "no cell"),
    ]:
        with pytest.raises(ModelError, match=match):
            grid_source(elevation, dx)


@pytest.mark.parametrize(
    ("value", "dtype"),
    [(-9999, np.float64), (-32768, np.int16), (-3.4028234663852886e38, np.float32), (65535, np.int32), (1e31, float)],
)
def test_an_obvious_nodata_value_is_warned_of_and_the_advice_helps(tmp_path, value, dtype):
    heights = np.arange(1, 31).reshape(5, 6).astype(dtype)
    heights[0, :] = value
    np.save(tmp_path / "dem.npy", heights)
    with pytest.warns(ModelWarning, match=r"dem\.npy: 6 of 30 heights are \S+, far from .* \(7 to 30\)") as caught:
        source = read_source(tmp_path / "dem.npy")
    assert len(source.points) == 30  # a warning, no more
    advice = str(caught[0].message).partition("(--nodata=")[2].rstrip(")")
    assert len(read_source(tmp_path / "dem.npy", Options(nodata=float(advice))).points) == 24


@pytest.mark.parametrize(
    "heights",
    [
        [[0, 0], [-9999, -20000]],  # not far from the others
        [[0, 1], [2, -12345]],  # no value that means anything
        [[-9999, -9999], [-9999, -9999]],  # there are no others
        [[0, 1, 2], [2, float("nan"), 4]],
    ],
)
def test_heights_that_may_be_meant_are_not_warned_of(heights):
    grid_source(np.array(heights, float))


@pytest.mark.parametrize("suffix", ["npy", "npz", "asc"])
def test_other_grids_have_windows_too(tmp_path, suffix):
    heights = hill()
    path = tmp_path / f"a.{suffix}"
    if suffix == "asc":
        rows = "\n".join(" ".join(map(str, row)) for row in heights.tolist())
        path.write_text(f"ncols 12\nnrows 9\nxllcorner 5\nyllcorner 7\ncellsize 2\n{rows}\n")
    else:
        (np.save if suffix == "npy" else np.savez)(path, heights)
    whole, part = read_source(path), read_source(path, Options(window=(2, 3, 4, 5)))
    assert_array_equal(part.points, whole.points[part.rows])
    assert_array_equal(part.rows[:5], [38, 39, 40, 41, 50])
    assert len(part.faces) == 2 * 3 * 4
