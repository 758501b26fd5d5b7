"""NumPy archives: heights by name, their distances, damage."""

from __future__ import annotations

import re
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from pyramid import hostile_array, refusal, write

from meshsimp_pymoo.errors import ModelError, ModelWarning, NoHeightGrid
from meshsimp_pymoo.formats.npz import AXES
from meshsimp_pymoo.formats.npz import DEGREES as DEGREES_AXES
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.opening import open_grid


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


LON, LAT = np.array([11.0, 11.5, 12.5]), np.array([47.0, 47.25])
HEIGHTS = np.array([[1.0, 2, 3], [4, 5, 6]])
DEGREES = pytest.mark.filterwarnings("ignore:.*its coordinates are degrees")


def by_place(source):
    return {(x, y): z for x, y, z in source.points.tolist()}


@DEGREES
@given(
    names=st.sampled_from(AXES),
    flips=st.tuples(st.booleans(), st.booleans()),
    meshed=st.booleans(),
    turned=st.sampled_from([str.lower, str.upper, str.title]),
)
def test_samples_lie_where_the_axes_say_in_any_order(tmp_path_factory, names, flips, meshed, turned):
    path = tmp_path_factory.mktemp("axes") / "a.npz"
    x, y = LON[:: -1 if flips[0] else 1], LAT[:: -1 if flips[1] else 1]
    heights = HEIGHTS[:: -1 if flips[1] else 1, :: -1 if flips[0] else 1]
    axes = np.meshgrid(x, y) if meshed else (x, y)
    np.savez(path, z=heights, **{turned(name): axis for name, axis in zip(names, axes, strict=True)})
    source = read_source(path)
    assert by_place(source) == {(x, y): HEIGHTS[i, j] for i, y in enumerate(LAT) for j, x in enumerate(LON)}
    assert_array_equal(source.points[:, 2], heights.ravel())
    assert_array_equal(source.rows, np.arange(6))
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    assert (np.linalg.det(np.stack([b - a, c - a], axis=1)) > 0).all()
    assert source.georeference.get("unit") == ("degree" if names in DEGREES_AXES else None)
    if not any((flips[0], not flips[1])):
        grid = open_grid(path)
        assert_array_equal(grid.file_points[np.arange(6)], source.points)
    else:
        with pytest.raises(NoHeightGrid, match="as tiles want them"):
            open_grid(path)


def test_degrees_are_said_and_a_spacing_is_in_their_place(tmp_path):
    np.savez(tmp_path / "a.npz", z=HEIGHTS, lon=LON, lat=LAT)
    with pytest.warns(ModelWarning, match="its coordinates are degrees; lengths are measured in metres"):
        assert_array_equal(read_source(tmp_path / "a.npz").points[0], [11, 47, 1])
    source = read_source(tmp_path / "a.npz", Options(spacing=(30, 20)))
    assert_array_equal(source.points[[0, 5]], [[0, 0, 1], [60, 20, 6]])  # to the north, as the axis runs
    assert source.georeference == {}
    np.savez(tmp_path / "b.npz", z=HEIGHTS, x=LON, y=LAT)
    assert_array_equal(read_source(tmp_path / "b.npz", Options(spacing=30)).points[5], [71, 77, 6])


@pytest.mark.parametrize(
    ("arrays", "cause"),
    [
        ({"x": LON[:2], "y": LAT}, r"'x' is float64 of the shape \(2,\) .* give 3 numbers, one for each column"),
        ({"x": LAT, "y": LON}, "give 3 numbers, one for each column"),
        ({"x": LON, "y": [1, 1]}, "'y' neither rises nor falls all along"),
        ({"x": [1, np.nan, 3], "y": LAT}, "'x' neither rises"),
        ({"x": HEIGHTS, "y": HEIGHTS}, "'x' is not the same in all rows"),
        ({"x": LON, "y": ["a", "b"]}, "'y' is <U1"),
        ({"x": LON, "y": LAT, "lon": LON, "lat": LAT}, "more than one pair of axes, lon and lat and x and y"),
    ],
)
def test_axes_that_are_none_are_refused(tmp_path, arrays, cause):
    np.savez(tmp_path / "a.npz", z=HEIGHTS, **arrays)
    assert re.search(cause, refusal(tmp_path / "a.npz"))


def test_which_array_holds_the_heights_is_known_by_its_name_or_asked(tmp_path):
    np.savez(tmp_path / "a.npz", slope=HEIGHTS, DEM=HEIGHTS + 10)
    with pytest.warns(ModelWarning, match="heights are taken to be 'DEM', not 'slope' of the same shape"):
        assert read_source(tmp_path / "a.npz").points[0, 2] == 11
    np.savez(tmp_path / "b.npz", slope=np.zeros((5, 5)), z=HEIGHTS)
    assert len(read_source(tmp_path / "b.npz").points) == 6
    np.savez(tmp_path / "c.npz", dem=HEIGHTS, dsm=HEIGHTS)
    assert "['dem', 'dsm']" in refusal(tmp_path / "c.npz")
    np.savez(tmp_path / "d.npz", z=HEIGHTS, x=LON)
    with pytest.warns(ModelWarning, match="holds x, but no pair of axes, and the samples were placed without"):
        assert_array_equal(read_source(tmp_path / "d.npz").points[5], [2, -1, 6])
