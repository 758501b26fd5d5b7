"""GeoTIFF by tiles: read by windows, with the places, rows and record of the raster read whole."""

import json
import warnings

import numpy as np
import pytest
from cracks import find_cracks

from meshsimp_pymoo.cli import main
from meshsimp_pymoo.cli import tiling as tiled_command
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats import geotiff as raster_module
from meshsimp_pymoo.formats.geotiff import RasterHeights
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.opening import count_samples, open_grid, open_model
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.surface import grid as grid_module
from meshsimp_pymoo.surface.model import build_model

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import Affine  # noqa: E402

# rasterio multiplies transforms in a way that their own library will give up
pytestmark = [
    pytest.mark.filterwarnings("ignore::PendingDeprecationWarning"),
    pytest.mark.usefixtures("sketched", "few_moves"),
]

HEIGHTS = open_grid(build_model(load("jacksboro:3"))).heights.astype(np.float32)
PLACE = Affine(10, 0, 500_000.25, 0, -12.5, 5_400_000.125)
WINDOW = (5, 7, 110, 70)


def write(path, heights=HEIGHTS, after=None, **options):
    look = {"crs": "EPSG:25832", "transform": PLACE, "dtype": heights.dtype.name} | options
    look |= {"driver": "GTiff", "count": 1, "height": heights.shape[0], "width": heights.shape[1]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path, "w", **look) as raster:
            raster.write(heights, 1)
            for key, value in (after or {}).items():
                setattr(raster, key, value)
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("raster") / "dem.tif"
    return write(path, compress="deflate", tiled=True, blockxsize=32, blockysize=16)


BLOCKS = {"compress": "lzw", "tiled": True, "blockxsize": 32, "blockysize": 16}


@pytest.mark.parametrize("options", [{}, BLOCKS, {"transform": Affine.identity()}, {"transform": PLACE, "nodata": -1}])
@pytest.mark.parametrize("window", [None, WINDOW])
def test_a_raster_opened_for_tiles_has_its_samples_where_the_model_of_it_has_them(tmp_path, options, window):
    file = write(tmp_path / "dem.tif", **options)
    model = open_model(file, Options(window=window))
    grid = open_grid(file, window=window)
    samples = grid.samples_of_rows(model.source_index)
    assert np.array_equal(grid.source_index[samples], model.source_index)
    assert np.array_equal(np.sort(samples), np.arange(grid.n_vertices))
    assert np.array_equal(grid.xy_at(samples), model.xy)
    assert np.array_equal(grid.file_points[samples], model.file_points)
    assert grid.georeference == model.georeference
    assert count_samples(file, window=window) == grid.n_vertices == model.n_vertices


def test_scale_offset_and_spacing_are_those_of_the_raster_read_whole(tmp_path):
    whole_numbers = np.rint(10 * HEIGHTS).astype(np.int16)
    file = write(tmp_path / "dem.tif", whole_numbers, after={"scales": (0.1,), "offsets": (5.0,)})
    model = open_model(file, Options(spacing=(3.0, 4.0)))
    grid = open_grid(file, spacing=(3.0, 4.0))
    assert np.array_equal(grid.file_points[model.source_index], model.file_points)
    assert np.ptp(grid.file_x) == 3.0 * (HEIGHTS.shape[1] - 1)


def test_a_window_of_a_mapped_array_has_the_places_and_rows_of_the_whole(tmp_path):
    np.save(tmp_path / "z.npy", HEIGHTS)
    model = open_model(tmp_path / "z.npy", Options(spacing=(2.0, 3.0), window=WINDOW))
    grid = open_grid(tmp_path / "z.npy", spacing=(2.0, 3.0), window=WINDOW)
    samples = grid.samples_of_rows(model.source_index)
    assert isinstance(grid.heights, np.memmap)
    assert np.array_equal(grid.file_points[samples], model.file_points)
    assert np.array_equal(grid.source_index[samples], model.source_index)
    with pytest.raises(ModelError, match="does not lie within"):
        open_grid(tmp_path / "z.npy", window=(0, 0, 5, 5000))


def test_heights_are_read_in_any_order_as_from_an_array(path, monkeypatch):
    monkeypatch.setattr(raster_module, "BAND_SAMPLES", 700)
    heights = RasterHeights(path, "dem", Options(window=WINDOW))
    column, row, columns, rows = WINDOW
    part = HEIGHTS[row : row + rows, column : column + columns].astype(float)
    rng = np.random.default_rng(1)
    i, j = rng.integers(0, rows, 500), rng.integers(0, columns, 500)
    assert np.array_equal(heights[i, j], part[i, j])
    assert np.array_equal(heights[3:9], part[3:9])
    assert np.array_equal(heights[3:9, 4:50], part[3:9, 4:50])
    assert heights[i[:0], j[:0]].shape == (0,)


def test_no_read_is_larger_than_a_band_or_a_tile(path, tmp_path, monkeypatch):
    monkeypatch.setattr(raster_module, "BAND_SAMPLES", 1500)
    monkeypatch.setattr(grid_module, "BAND_SAMPLES", 1500)
    largest, read = [0], RasterHeights._read

    def watched(self, top, bottom, left, right):
        largest[0] = max(largest[0], (bottom - top) * (right - left))
        return read(self, top, bottom, left, right)

    monkeypatch.setattr(RasterHeights, "_read", watched)
    call = [
        "simplify",
        str(path),
        "-o",
        str(tmp_path / "out"),
        "--tile",
        "64",
        "--meshes",
        "2",
        "--jobs",
        "1",
        "--no-page",
    ]
    assert main([*call, "--quiet"]) == 0
    assert 1000 < largest[0] <= 1500


def test_a_raster_becomes_a_front_in_its_own_coordinates_and_any_mesh_is_picked(path, tmp_path, capsys):
    out = tmp_path / "out"
    window = ",".join(map(str, WINDOW))
    call = ["simplify", str(path), "-o", str(out), "--tile", "64", "--window", window, "--triangles", "300"]
    assert main([*call, "--meshes", "2", "--jobs", "1", "--quiet", "--no-page"]) == 0
    record = json.loads((out / "run.json").read_text())
    model = open_model(path, Options(window=WINDOW))
    assert record["model"]["georeference"] == json.loads(json.dumps(model.georeference))
    assert record["model"]["georeference"]["epsg"] == 25832
    assert record["options"]["window"] == list(WINDOW)
    chosen = read_source(out / "chosen.ply")
    assert b"comment crs: EPSG:25832" in (out / "chosen.ply").read_bytes()[:400]
    assert find_cracks(chosen.points, chosen.faces) == 0
    problem = MeshProblem(path, window=WINDOW)
    front, row = Front.load(out), record["chosen"]
    with np.load(out / "front.npz") as nested:
        first = nested["moved_start"][row]
        rows = nested["moved"][first : nested["moved_start"][row + 1]]
        if not len(rows):
            rows = nested["rows"][nested["level"] > nested["slope"][row]]
    kept = np.isin(problem.model.source_index, rows)
    simplified = problem.simplify(kept)
    order = np.argsort(problem.model.source_index)
    assert np.array_equal(chosen.points, problem.model.file_points[order][kept[order]])
    assert front.quality[row].error == pytest.approx(simplified.quality.error, rel=1e-9)
    assert front.quality[row].triangles == len(chosen.faces) == simplified.quality.triangles
    assert main(["pick", str(out), "--triangles", "300", "-o", str(tmp_path / "again.ply"), "--quiet"]) == 0
    assert (tmp_path / "again.ply").read_bytes() == (out / "chosen.ply").read_bytes()
    capsys.readouterr()


def test_meshes_far_from_the_origin_state_one_origin_or_lose_nothing(path, tmp_path, capsys):
    out = tmp_path / "glb"
    call = ["simplify", str(path), "-o", str(out), "--tile", "64", "--jobs", "1", "--meshes", "2", "--pick", "knee"]
    assert main([*call, "--quiet", "--no-page", "--format", "glb"]) == 0
    record = json.loads((out / "run.json").read_text())
    origin = record["mesh_origin"]
    assert origin[:2] == [500_005.0, 5_398_568.0]
    for file in [*(out / "meshes").iterdir(), out / "chosen.glb"]:
        assert json.dumps(origin).replace(" ", "").encode() in file.read_bytes()
    assert main(["pick", str(out), "--knee", "-o", str(tmp_path / "knee.xml")]) == 0
    assert b'epsgCode="25832"' in (tmp_path / "knee.xml").read_bytes()
    capsys.readouterr()
    assert main(["pick", str(out), "--knee", "-o", str(tmp_path / "knee.stl")]) == 0
    assert "stl holds single precision" in capsys.readouterr().err


def test_a_big_raster_is_cut_into_tiles_without_being_asked_and_a_window_of_it_counts(
    path, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(tiled_command, "TILED_FROM", 10_000)
    monkeypatch.setattr(tiled_command, "fits_in_one_piece", lambda count: False)
    assert (
        main(["simplify", str(path), "-o", str(tmp_path / "out"), "--meshes", "none", "--jobs", "1", "--no-page"]) == 0
    )
    assert "thinned tile by tile" in capsys.readouterr().out
    call = ["simplify", str(path), "-o", str(tmp_path / "part"), "--window", "0,0,12,10", "--no-page"]
    assert main([*call, "--algorithm", "nsga2_v1", "--population", "4", "--generations", "1", "--meshes", "none"]) == 0
    assert (tmp_path / "part" / "front.npz").exists()


def with_hole(heights):
    heights = heights.copy()
    heights[20, 30] = -9999
    return heights


def cut_off(path):
    path.write_bytes(path.read_bytes()[:2000])
    return path


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: write(p, HEIGHTS * 0 - 9999, nodata=-9999), "only 0 of .* samples have data"),
        (lambda p: write(p, transform=Affine(10, 1, 0, 1, -10, 0)), "turns or mirrors it, .*--tile none"),
        (lambda p: write(p, transform=Affine(10, 0, 0, 0, 10, 0)), "turns or mirrors it"),
        (lambda p: write(p, transform=Affine(-10, 0, 0, 0, 10, 0)), "turns or mirrors it"),
        (lambda p: write(p, HEIGHTS.astype(np.complex64)), "type complex64"),
        (lambda p: cut_off(write(p, compress="deflate")), "cannot be read as a GeoTIFF"),
    ],
)
def test_what_cannot_be_cut_into_tiles_is_refused_in_one_line(tmp_path, capsys, make, message):
    file, out = make(tmp_path / "dem.tif"), tmp_path / "out"
    assert main(["simplify", str(file), "-o", str(out), "--tile", "64", "--jobs", "1", "--no-page"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    with pytest.raises(ModelError, match=message):
        raise ModelError(said)
    assert not out.exists()


def test_a_raster_with_a_hole_is_the_grid_that_it_is_in_one_piece(tmp_path):
    file = write(tmp_path / "dem.tif", with_hole(HEIGHTS), nodata=-9999)
    for window in (None, WINDOW):
        grid, model = open_grid(file, window=window), open_model(file, Options(window=window))
        row_of = np.argsort(model.source_index)
        assert grid.n_vertices == grid.shape[0] * grid.shape[1] - 1
        np.testing.assert_array_equal(np.asarray(grid.file_points), model.file_points[row_of])
        np.testing.assert_array_equal(np.asarray(grid.source_index), model.source_index[row_of])


def test_a_part_of_a_raster_without_the_hole_is_thinned(tmp_path, capsys):
    file = write(tmp_path / "dem.tif", with_hole(HEIGHTS), nodata=-9999)
    call = [
        "simplify",
        str(file),
        "-o",
        str(tmp_path / "out"),
        "--tile",
        "64",
        "--meshes",
        "none",
        "--jobs",
        "1",
        "--no-page",
    ]
    assert main([*call, "--window", "0,21,135,90", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["model"]["vertices"] == 135 * 90


def test_a_raster_that_declares_more_than_its_file_can_hold_is_refused_at_once(tmp_path):
    file = write(tmp_path / "dem.tif", HEIGHTS[:16, :16])
    data = bytearray(file.read_bytes())
    for tag in (256, 257):  # width and height, in the first directory
        at = data.index(tag.to_bytes(2, "little") + b"\x03\x00\x01\x00\x00\x00", 8)
        data[at : at + 12] = tag.to_bytes(2, "little") + b"\x04\x00\x01\x00\x00\x00" + (200_000).to_bytes(4, "little")
    file.write_bytes(data)
    with pytest.raises(ModelError, match=r"declares 200000 x 200000 samples|cannot be read as a GeoTIFF"):
        open_grid(file)
