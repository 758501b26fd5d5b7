"""GeoTIFF: heights at their own places, windows, missing samples, and rasters that are refused."""

from __future__ import annotations

import itertools
import struct
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.opening import open_grid

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import Affine  # noqa: E402

# rasterio multiplies transforms in a way that their own library will give up
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")

WEST, NORTH = 500_000.5, 5_400_000.25
PLACE = Affine(10, 0, WEST, 0, -5, NORTH)


def hill(rows=9, columns=12):
    y, x = np.mgrid[:rows, :columns]
    return (50 * np.exp(-((x - 4.2) ** 2 + (y - 3.1) ** 2) / 9)).astype(np.float32)


@pytest.fixture
def tiff(tmp_path):
    count = itertools.count()

    def write(heights, **options):
        heights = np.atleast_3d(heights.T).T if heights.ndim == 2 else heights
        bands, height, width = heights.shape
        mask, after = options.pop("mask", None), options.pop("after", {})
        look = {"crs": "EPSG:25832", "transform": PLACE, "dtype": heights.dtype.name} | options
        path = tmp_path / f"{next(count)}.tif"
        look |= {"driver": "GTiff", "count": bands, "height": height, "width": width}
        with warnings.catch_warnings(), rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True):
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            with rasterio.open(path, "w", **look) as raster:
                raster.write(heights)
                if mask is not None:
                    raster.write_mask(mask)
                for key, value in after.items():
                    setattr(raster, key, value)
        return path

    return write


def test_samples_lie_at_the_middle_of_their_pixels_in_the_rasters_own_coordinates(tiff):
    heights = hill()
    source = read_source(tiff(heights))
    assert source.up == "z"
    assert_array_equal(source.points[0], [WEST + 5, NORTH - 2.5, heights[0, 0]])
    assert_array_equal(source.points[12 + 3], [WEST + 35, NORTH - 7.5, heights[1, 3]])
    like = grid_source(heights, 10, 5)
    assert_array_equal(source.faces, like.faces)
    assert_array_equal(source.rows, like.rows)
    facts = source.georeference
    assert facts["epsg"] == 25832
    assert facts["crs"].startswith("PROJCS[")
    assert facts["transform"] == [10, 0, WEST, 0, -5, NORTH]
    assert (facts["size"], facts["window"], facts["unit"]) == ([12, 9], [0, 0, 12, 9], "metre")


@pytest.mark.parametrize(
    "options", [{"compress": "deflate"}, {"compress": "lzw", "tiled": True, "blockxsize": 16, "blockysize": 16}, {}]
)
def test_a_window_is_a_part_of_the_whole_with_the_same_places_and_rows(tiff, options):
    path = tiff(hill(40, 50), **options)
    whole, part = read_source(path), read_source(path, Options(window=(17, 5, 20, 30)))
    assert_array_equal(part.points, whole.points[part.rows])
    assert_array_equal(np.divmod(part.rows[[0, -1]], 50), [[5, 34], [17, 36]])
    assert len(part.points) == 600
    assert part.georeference["window"] == [17, 5, 20, 30]
    assert (whole.grid, part.grid) == ((50, 40, 10, 5), (20, 30, 10, 5))


@pytest.mark.parametrize("window", [(0, 0, 13, 9), (3, 8, 4, 2), (10**12, 0, 4, 4)])
def test_a_window_beyond_the_raster_is_refused(tiff, tmp_path, window):
    np.save(tmp_path / "a.npy", hill())
    for path in (tiff(hill()), tmp_path / "a.npy"):
        with pytest.raises(ModelError, match="does not lie within its 12 columns and 9 rows"):
            read_source(path, Options(window=window))


@pytest.mark.parametrize("dtype", ["float32", "float64", "int16", "uint16"])
def test_missing_samples_are_no_vertices_whichever_way_the_file_says_it(tiff, dtype):
    heights = hill().astype(dtype)
    gap = np.zeros(heights.shape, bool)
    gap[3:5, 4:7] = True
    lowest = np.finfo(dtype).min if heights.dtype.kind == "f" else np.iinfo(dtype).max
    marked = np.where(gap, np.array(lowest, dtype), heights)
    expected = np.flatnonzero(~gap)
    assert_array_equal(read_source(tiff(marked, nodata=lowest)).rows, expected)
    assert_array_equal(read_source(tiff(marked), Options(nodata=float(lowest))).rows, expected)
    assert_array_equal(read_source(tiff(heights, mask=~gap)).rows, expected)
    if heights.dtype.kind == "f":
        without = np.where(gap, np.nan, heights).astype(dtype)
        assert_array_equal(read_source(tiff(without, nodata=np.nan)).rows, expected)


def test_a_gap_stays_open_in_the_simplified_mesh(tiff):
    heights = hill(20, 20)
    heights[6:13, 7:15] = -9999
    problem = MeshProblem(tiff(heights, nodata=-9999))
    kept = np.random.default_rng(1).random(problem.n_var) < 0.7
    mesh = problem.mesh(kept)
    centre = mesh.triangles.mean(axis=1)[:, :2]
    column, row = (centre[:, 0] - WEST) / 10 - 0.5, (NORTH - centre[:, 1]) / 5 - 0.5
    assert not ((column > 6.99) & (column < 14.01) & (row > 5.99) & (row < 12.01)).any()
    assert {tuple(p) for p in mesh.vertices.tolist()} <= {tuple(p) for p in problem.model.file_points.tolist()}


def test_scale_and_offset_of_the_band_are_applied_after_nodata(tiff):
    heights = np.arange(1, 13, dtype=np.int16).reshape(3, 4)
    source = read_source(tiff(heights, nodata=5, after={"scales": [0.1], "offsets": [100.0]}))
    assert len(source.points) == 11
    assert_allclose(source.points[:4, 2], [100.1, 100.2, 100.3, 100.4])


@pytest.mark.parametrize(
    "transform",
    [
        Affine(10, 0, WEST, 0, 5, NORTH),  # south at the top
        Affine(-10, 0, WEST, 0, -5, NORTH),  # east at the left
        Affine.translation(WEST, NORTH) @ Affine.rotation(30) @ Affine.scale(10, -5),
        Affine(10, 3, WEST, 1, -5, NORTH),
    ],
)
def test_mirrored_and_turned_rasters_lie_as_they_say_and_face_up(tiff, transform):
    heights = hill()
    source = read_source(tiff(heights, transform=transform))
    row, column = np.divmod(source.rows, 12)
    expected = np.array([transform @ (j + 0.5, i + 0.5) for i, j in zip(row, column, strict=True)])
    assert_allclose(source.points[:, :2], expected, rtol=0, atol=1e-8)
    assert_allclose(source.grid, (12, 9, np.hypot(*transform[0:4:3]), np.hypot(*transform[1:5:3])), rtol=1e-6)
    a, b, c = (source.points[source.faces[:, k], :2] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert_allclose(area, abs(transform.determinant), rtol=1e-6)
    assert MeshProblem(source).model.facts.flipped is False


def test_a_raster_without_a_place_is_a_grid_like_any_other(tiff):
    heights = hill()
    path = tiff(heights, crs=None, transform=None)
    assert_array_equal(read_source(path).points, grid_source(heights).points)
    wider = read_source(path, Options(spacing=(3, 4)))
    assert_array_equal(wider.points[:, 0], 3 * grid_source(heights).points[:, 0] + 1)


def test_a_spacing_replaces_the_one_of_the_file(tiff):
    source = read_source(tiff(hill()), Options(spacing=(2.0, 4.0)))
    assert_array_equal(source.points[13, :2], [WEST + 3, NORTH - 6])
    with pytest.raises(ModelError, match="turns or mirrors"):
        read_source(tiff(hill(), transform=Affine(10, 3, 0, 1, -5, 0)), Options(spacing=2.0))


def test_degrees_are_warned_of(tiff):
    with pytest.warns(ModelWarning, match="coordinates are degrees"):
        source = read_source(tiff(hill(), crs="EPSG:4326", transform=Affine(0.001, 0, 7, 0, -0.001, 50)))
    assert source.georeference["unit"] == "degree"
    assert source.georeference["scale"] == pytest.approx([71_702, 111_229], abs=1)  # at 49.9955 degrees north


def test_rasters_that_are_no_heights_are_refused(tiff):
    with pytest.raises(ModelError, match=r"has 3 bands, .*; say which, such as --band 1$"):
        read_source(tiff(np.zeros((3, 5, 5), np.uint8)))
    with pytest.raises(ModelError, match="type complex64"):
        read_source(tiff(np.zeros((5, 5), np.complex64)))
    with pytest.raises(ModelError, match="no cell has three"):
        read_source(tiff(np.full((5, 5), -1.0, np.float32), nodata=-1))


def dimensions_changed(content, width, height):
    """Return the TIFF with other dimensions in its directory."""
    changed = bytearray(content)
    (at,) = struct.unpack_from("<I", changed, 4)
    (entries,) = struct.unpack_from("<H", changed, at)
    for k in range(entries):
        place = at + 2 + 12 * k
        tag = struct.unpack_from("<H", changed, place)[0]
        if tag in (256, 257):
            struct.pack_into("<HHII", changed, place, tag, 4, 1, width if tag == 256 else height)
    return bytes(changed)


@pytest.mark.parametrize("compress", [None, "deflate"])
def test_a_tiff_that_declares_what_it_cannot_hold_is_refused_at_once(tiff, tmp_path, compress):
    import tracemalloc

    content = tiff(hill(), compress=compress).read_bytes()
    (tmp_path / "big.tif").write_bytes(dimensions_changed(content, 2_000_000, 1_000_000))
    tracemalloc.start()
    with pytest.raises(ModelError) as caught:
        read_source(tmp_path / "big.tif")
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()
    assert "\n" not in str(caught.value)
    (tmp_path / "some.tif").write_bytes(dimensions_changed(content, 50_000, 9))
    with pytest.raises(ModelError):
        read_source(tmp_path / "some.tif")


def test_a_sparse_raster_of_a_few_bytes_is_refused_by_its_size(tmp_path):
    options = {"count": 1, "dtype": "float64", "crs": "EPSG:25832", "transform": PLACE, "SPARSE_OK": True}
    tiles = {"tiled": True, "blockxsize": 1024, "blockysize": 1024, "compress": "deflate"}
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", height=20_000, width=20_000, **options, **tiles):
        pass
    assert (tmp_path / "a.tif").stat().st_size < 10_000
    with pytest.raises(ModelError, match=r"declares 20000 x 20000 samples.*--window"):
        read_source(tmp_path / "a.tif")


def test_only_a_tiff_is_opened_whatever_the_file_holds(tmp_path, tiff):
    secret = tiff(hill())
    vrt = (
        '<VRTDataset rasterXSize="12" rasterYSize="9"><GeoTransform>1,2,0,3,0,4</GeoTransform>'
        '<VRTRasterBand dataType="Float32" band="1"><SimpleSource>'
        f"<SourceFilename>{secret}</SourceFilename><SourceBand>1</SourceBand>"
        "</SimpleSource></VRTRasterBand></VRTDataset>"
    )
    (tmp_path / "a.tif").write_text(vrt)
    with rasterio.open(tmp_path / "a.tif") as raster:  # GDAL itself would follow it
        assert raster.driver == "VRT"
    with pytest.raises(ModelError, match="cannot be read as a GeoTIFF"):
        read_source(tmp_path / "a.tif")


def test_cut_files_are_refused(tiff, tmp_path):
    content = tiff(hill(30, 30), compress="deflate").read_bytes()
    for size in range(1, len(content) - 8, 97):
        (tmp_path / "cut.tif").write_bytes(content[:size])
        with pytest.raises(ModelError, match=r"cannot be read as a GeoTIFF|declares"):
            read_source(tmp_path / "cut.tif")


def test_one_band_of_several_is_named_and_read_as_if_it_were_alone(tiff, tmp_path):
    first, second = hill(), (hill() * 10).astype(np.float32)
    second[2, 3] = -7
    path = tiff(np.stack([first, second, first]), nodata=-7, after={"descriptions": ("ground", "canopy", None)})
    with pytest.raises(
        ModelError, match=r"has 3 bands, .*; say which, such as --band 1 \(1 is 'ground', 2 is 'canopy'\)$"
    ):
        read_source(path)
    with pytest.raises(ModelError, match="has 3 bands, and no band 4"):
        read_source(path, Options(band=4))
    alone = read_source(tiff(second, nodata=-7))
    source = read_source(path, Options(band=2))
    assert_array_equal(source.points, alone.points)
    assert_array_equal(source.rows, alone.rows)
    assert_array_equal(read_source(path, Options(band=1)).points, read_source(tiff(first)).points)
    assert_array_equal(open_grid(path, band=3).height_at(np.arange(108)), first.ravel())
    np.save(tmp_path / "a.npy", first)
    with pytest.raises(ModelError, match=r"band describes GeoTIFF \(.tif .tiff\)"):
        read_source(tmp_path / "a.npy", Options(band=1))
    assert MeshProblem(path, band=1).model.n_vertices == 108


@pytest.mark.parametrize("interleave", ["pixel", "band"])
def test_each_band_has_its_own_scale_offset_and_mask(tiff, interleave):
    heights = np.stack([np.arange(108).reshape(9, 12), np.arange(108, 216).reshape(9, 12)]).astype(np.int16)
    mask = np.full((9, 12), 255, np.uint8)
    mask[4, 5] = 0
    path = tiff(heights, mask=mask, interleave=interleave, after={"scales": (1.0, 0.1), "offsets": (0.0, 100.0)})
    for band, scale, offset in ((1, 1.0, 0.0), (2, 0.1, 100.0)):
        source = read_source(path, Options(band=band))
        assert_array_equal(source.rows, np.delete(np.arange(108), 4 * 12 + 5))
        assert_allclose(source.points[:, 2], heights[band - 1].ravel()[source.rows] * scale + offset)


def test_a_band_of_transparency_is_no_band_of_heights(tiff):
    heights = np.stack([hill(), np.full((9, 12), 255)]).astype(np.float32)
    heights[1, 0, 2] = 0
    source = read_source(tiff(heights, alpha="YES"))
    assert_array_equal(source.rows, np.delete(np.arange(108), 2))
    assert_array_equal(source.points[:, 2], hill().ravel()[source.rows])
