"""The statement of quality of one mesh: its data, its page and the raster of its residuals."""

from __future__ import annotations

import base64
import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scans import holed

from meshsimp_pymoo import Front, MeshProblem
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.errors import ModelWarning, ResultError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.opening import open_grid, open_model
from meshsimp_pymoo.report import statement_figures
from meshsimp_pymoo.report.residuals import residual_rows, write_residuals
from meshsimp_pymoo.report.statement import NOT_INDEPENDENT, in_per_cent, stated
from meshsimp_pymoo.surface.accuracy import compare, compare_any, compare_subset
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.kinds import surface_of
from meshsimp_pymoo.surface.rules import Rules

pytestmark = [
    pytest.mark.filterwarnings("ignore::PendingDeprecationWarning"),
    pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning"),
    pytest.mark.usefixtures("sketched"),
]
PLACE = (10.0, 0.0, 500_000.25, 0.0, -5.0, 5_400_000.75)
TURNED = (8.0, 6.0, 500_000.0, -6.0, 8.0, 5_400_000.0)


def terrain(rows=14, columns=16):
    y, x = np.mgrid[:rows, :columns]
    return 40 * np.exp(-((x - 7) ** 2 + (y - 6) ** 2) / 20) + np.random.default_rng(1).normal(size=(rows, columns))


def write_tiff(path: Path, heights, transform=PLACE, crs="EPSG:25832") -> Path:
    rasterio = pytest.importorskip("rasterio")
    affine = pytest.importorskip("affine")
    look = {"height": heights.shape[0], "width": heights.shape[1], "count": 1, "dtype": "float32", "crs": crs}
    with rasterio.open(path, "w", driver="GTiff", nodata=-9999, transform=affine.Affine(*transform), **look) as raster:
        raster.write(np.where(np.isnan(heights), -9999, heights).astype(np.float32), 1)
    return path


def with_gap():
    heights = terrain()
    heights[7:9, 8:11] = np.nan
    heights[[0, -1]] = np.nan  # rows without any
    heights[:, -2:] = np.nan
    return heights


def some(surface, share=0.15):
    kept = np.random.default_rng(3).random(surface.n_vertices) < share
    return compare(surface, surface.simplify(kept | surface.pinned))


def opened(path):
    rasterio = pytest.importorskip("rasterio")
    with rasterio.open(path) as raster:
        return raster.read(1), raster.profile | {"tags": raster.tags(), "units": raster.units}


# ----------------------------------------------------------------------------------------------------------- the raster


@pytest.mark.parametrize("transform", [PLACE, TURNED], ids=["upright", "turned"])
@pytest.mark.parametrize("window", [None, (2, 1, 11, 12)], ids=["whole", "window"])
def test_the_residuals_lie_where_the_samples_do(tmp_path, transform, window):
    heights = with_gap()
    surface = surface_of(open_model(write_tiff(tmp_path / "dem.tif", heights, transform), Options(window=window)))
    compared = some(surface)
    write_residuals(tmp_path / "residuals.tif", compared)
    found, look = opened(tmp_path / "residuals.tif")
    left, top, columns, rows = window or (0, 0, 16, 14)
    assert found.shape == (rows, columns)
    assert look["crs"].to_epsg() == 25832
    a, b, c, d, e, f = transform
    assert tuple(look["transform"])[:6] == (a, b, c + a * left + b * top, d, e, f + d * left + e * top)
    assert (look["dtype"], np.isnan(look["nodata"]), look["units"]) == ("float32", True, ("m",))
    assert "original minus mesh" in look["tags"]["TIFFTAG_IMAGEDESCRIPTION"]
    assert look["tags"]["ORIGINAL_SHA256"] == surface.model.hash
    (part,) = compared.parts()
    row, column = np.divmod(surface.model.source_index, 16)
    assert_array_equal(np.isnan(found[row - top, column - left]), ~part.covered)
    assert np.isfinite(found).sum() == part.covered.sum()
    there = found[row - top, column - left]
    assert_allclose(there[part.covered], part.values[part.covered], rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("read", ["npy", "asc", "npz"])
def test_rasters_without_a_transform_have_the_place_that_their_samples_have(tmp_path, read):
    heights = with_gap()
    if read == "npy":
        np.save(tmp_path / "dem.npy", heights)
        options, place = Options(spacing=(3.0, 2.0)), (3.0, 0.0, -1.5, 0.0, -2.0, 1.0)
    elif read == "npz":
        np.savez(tmp_path / "dem.npz", elevation=heights, dx=3.0, dy=2.0)
        options, place = Options(), (3.0, 0.0, -1.5, 0.0, -2.0, 1.0)
    else:
        head = "ncols 16\nnrows 14\nxllcorner 100\nyllcorner 200\ncellsize 5\nNODATA_value -9999\n"
        lines = [" ".join(f"{z:.3f}" for z in row) for row in np.where(np.isnan(heights), -9999, heights)]
        (tmp_path / "dem.asc").write_text(head + "\n".join(lines) + "\n")
        options, place = Options(), (5.0, 0.0, 100.0, 0.0, -5.0, 270.0)
    compared = some(surface_of(open_model(tmp_path / f"dem.{read}", options)))
    write_residuals(tmp_path / "r.tif", compared)
    found, look = opened(tmp_path / "r.tif")
    assert_allclose(tuple(look["transform"])[:6], place)
    assert (found.shape, look["crs"], look["units"]) == ((14, 16), None, (None,))
    assert np.isfinite(found).sum() == sum(part.covered.sum() for part in compared.parts())


def test_another_reader_sees_the_same_numbers_and_the_same_place(tmp_path):
    image = pytest.importorskip("PIL.Image")
    compared = some(surface_of(open_model(write_tiff(tmp_path / "dem.tif", with_gap()))))
    write_residuals(tmp_path / "r.tif", compared)
    with image.open(tmp_path / "r.tif") as shown:
        assert_array_equal(np.asarray(shown), opened(tmp_path / "r.tif")[0])
        scale, tie = shown.tag_v2[33550], shown.tag_v2[33922]
        assert (*scale[:2], *tie[3:5]) == (10.0, 5.0, 500_000.25, 5_400_000.75)
        assert shown.tag_v2[42113].strip("\0 ") == "nan"


@pytest.mark.parametrize("gaps", [False, True])
def test_a_raster_read_by_windows_has_the_raster_of_the_whole(tmp_path, monkeypatch, gaps):
    path = write_tiff(tmp_path / "dem.tif", with_gap() if gaps else terrain())
    monkeypatch.setattr("meshsimp_pymoo.surface.grid.BAND_SAMPLES", 40)
    surface, model = GridSurface(open_grid(path)), open_model(path)
    kept = (np.random.default_rng(1).random(surface.n_vertices) < 0.2) | surface.pinned
    whole = surface_of(model)
    there = np.zeros_like(kept)
    there[np.argsort(model.source_index)] = kept
    compared = compare_subset(surface, kept)
    for name, one in (("a", compared), ("b", compare(whole, whole.simplify(there)))):
        write_residuals(tmp_path / f"{name}.tif", one)
    (mine, my_look), (known, look) = opened(tmp_path / "a.tif"), opened(tmp_path / "b.tif")
    assert_allclose(mine, known, atol=1e-6)
    assert my_look["transform"] == look["transform"]
    assert my_look["crs"] == look["crs"]
    bands = list(residual_rows(compared, statement_figures.raster_of(surface.model)))
    assert len(bands) > 4
    assert_array_equal(np.concatenate([values for _, values in bands]).astype(np.float32), mine)
    assert [first for first, _ in bands] == np.cumsum([0, *(len(values) for _, values in bands[:-1])]).tolist()


def test_break_lines_bring_no_samples(tmp_path):
    path = write_tiff(tmp_path / "dem.tif", with_gap())
    x, y = np.array([500_020.0, 500_090.0]), np.array([5_399_990.0, 5_399_940.0])
    rules = Rules(break_lines=[np.column_stack([x, y])], line_tolerance=0.1)
    lined, plain = surface_of(open_model(path), rules), surface_of(open_model(path))
    compared = some(lined)
    write_residuals(tmp_path / "r.tif", compared)
    write_residuals(tmp_path / "plain.tif", some(plain))
    assert lined.n_vertices > plain.n_vertices
    found, known = opened(tmp_path / "r.tif")[0], opened(tmp_path / "plain.tif")[0]
    assert found.shape == known.shape
    samples = {*plain.model.source_index.tolist()}
    assert {*np.flatnonzero(np.isfinite(found)).tolist()} <= samples
    (part,) = compared.parts()
    own = ~np.isin(part.vertices, lined.model.lines.added)
    assert np.isfinite(found).sum() == part.covered[own].sum() > 0.9 * len(samples)
    numbers = stated(compared)
    assert (numbers.check_points, numbers.weightless) == (plain.n_vertices, lined.n_vertices - plain.n_vertices)
    assert numbers.line_max_error >= 0.0
    assert not numbers.weighted


def test_what_is_no_raster_has_none_and_an_uneven_one_says_so(tmp_path):
    heights = terrain(6, 5)
    np.savez(tmp_path / "dem.npz", z=heights, x=np.array([0.0, 1, 2, 5, 6]), y=np.arange(6.0)[::-1])
    statement = stated(some(surface_of(open_model(tmp_path / "dem.npz"))))
    with pytest.warns(ModelWarning, match=r"residuals\.tif is left out: .*not evenly spaced"):
        statement.save(tmp_path / "q")
    assert sorted(path.name for path in (tmp_path / "q").iterdir()) == ["quality.html", "quality.json"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stated(some(surface_of(open_model("face:100")))).save(tmp_path / "mesh")
    assert not (tmp_path / "mesh" / "residuals.tif").exists()


def test_without_rasterio_the_rest_is_written_and_the_way_out_is_said(tmp_path, monkeypatch):
    np.save(tmp_path / "dem.npy", terrain())
    statement = stated(some(surface_of(open_model(tmp_path / "dem.npy"))))
    monkeypatch.setitem(__import__("sys").modules, "rasterio", None)
    with pytest.warns(ModelWarning, match=r"residuals\.tif is left out: GeoTIFF needs rasterio; .*pip install"):
        statement.save(tmp_path / "q")
    assert (tmp_path / "q" / "quality.json").is_file()


# --------------------------------------------------------------------------------------------------- the data, the page


def test_a_statement_says_what_was_measured_against_what_in_which_unit(tmp_path):
    surface = surface_of(open_model(write_tiff(tmp_path / "dem.tif", with_gap())))
    statement = stated(some(surface), mesh={"name": "mine.ply"})
    statement.save(tmp_path / "q")
    data = json.loads((tmp_path / "q" / "quality.json").read_text(encoding="utf-8"))
    assert data["schema"] == 1
    assert data["original"] | {"crs": 0, "box": 0} == {
        "name": "dem.tif", "sha256": surface.model.hash, "vertices": surface.n_vertices,
        "triangles": len(surface.faces), "unit": "m", "metres_per_unit": 1.0, "system": "EPSG:25832", "epsg": 25832,
        "scale": None, "crs": 0, "box": 0,
    }  # fmt: skip
    assert data["mesh"] == {"name": "mine.ply"}
    assert data["accuracy"] == json.loads(json.dumps(statement.numbers.plain))
    assert (
        data["remark"] == NOT_INDEPENDENT == "check points are the samples the mesh was made from, not independent "
        "ground truth"
    )
    said = f"Tested {statement.le90:.4g} m vertical accuracy at 90 % (LE90, as counted) against {surface.n_vertices} "
    assert data["statement"].startswith(f"{said}samples of dem.tif")
    assert set(data["sources"]) == {"le90", "le95", "le90_normal", "le95_normal", "nmad"}


@pytest.mark.parametrize(
    ("outside", "said"), [("nearest", "count with their distance to the mesh"), ("ignore", "count as 0")]
)
def test_the_sentence_and_the_table_say_what_is_not_covered_and_how_it_counts(tmp_path, outside, said):
    np.save(tmp_path / "dem.npy", np.zeros((11, 11)))
    surface = surface_of(open_model(tmp_path / "dem.npy"), Rules(outside=outside))
    half = np.array([[0, -10, 0], [5, -10, 0], [5, 0, 0], [0, 0, 0.0]])
    statement = stated(compare_any(surface, half, np.array([[0, 1, 2], [0, 2, 3]])))
    assert statement.sentence.endswith(f"dem.npy; 55 of them, which no triangle covers, {said}.")
    statement.write_page(tmp_path / "a.html")
    assert f"<td>55</td><td>they {said}</td>" in (tmp_path / "a.html").read_text(encoding="utf-8")


def test_distances_that_are_not_taken_are_said_unless_nobody_wants_them(monkeypatch):
    monkeypatch.setattr("meshsimp_pymoo.surface.accuracy.MOST_FACES", 10)
    compared = some(surface_of(open_model("face:100")))
    (word,) = stated(compared).as_data()["left_out"]
    assert word.startswith(f"Distances in space are left out: the original has {len(compared.surface.faces)} triangles")
    assert stated(compared, space_samples=0).left_out == ()


@pytest.mark.usefixtures("drawn")
def test_the_page_holds_the_numbers_and_asks_for_nothing(tmp_path, browser):
    surface = surface_of(open_model(write_tiff(tmp_path / "<b>dem.tif", with_gap())))
    statement = stated(some(surface), mesh={"name": "<i>mine.ply"}, left_out=("left out & said",))
    statement.write_page(tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    figure = statement_figures.residuals_figure(statement.numbers)
    assert statement_figures.address_of(figure, vector=True) in page  # the same again
    assert "The check points are the samples the mesh was made from, not independent ground truth." in page
    for words in (f"{statement.rms_error:.4g} m", "EPSG:25832", surface.model.hash, "Signature", "left out &amp; said"):
        assert words in page
    assert "<b>" not in page
    assert "<i>" not in page
    assert "<noscript" not in page
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    images = re.findall(r'<img src="data:image/([a-z+]+);base64,([^"]+)" alt="[^"]{20,}"', page)
    assert [kind for kind, _ in images] == ["png", "svg+xml", "svg+xml"]
    assert base64.b64decode(images[0][1]).startswith(b"\x89PNG")
    context = browser.new_context(viewport={"width": 390, "height": 844})
    shown = context.new_page()
    said: list[str] = []
    shown.on("console", lambda message: said.append(message.text))
    shown.goto((tmp_path / "a.html").as_uri())
    assert shown.evaluate("document.documentElement.scrollWidth") <= 390
    assert shown.evaluate("[...document.images].every(image => image.naturalWidth > 50)")
    assert said == []
    context.close()


def test_a_closed_surface_has_distances_and_no_coverage(tmp_path):
    statement = stated(some(surface_of(open_model(holed(), Options(surface="closed")))))
    statement.save(tmp_path / "q")
    page = (tmp_path / "q" / "quality.html").read_text(encoding="utf-8")
    assert "distance from the original surface at 90 %" in page
    assert "Coverage" not in page
    assert "Bias" not in page
    assert not (tmp_path / "q" / "residuals.tif").exists()


@pytest.mark.parametrize("turned", [False, True])
def test_maps_are_drawn_of_rasters_and_of_meshes_in_the_coordinates_of_their_file(tmp_path, turned):
    path = write_tiff(tmp_path / "dem.tif", with_gap(), TURNED if turned else PLACE)
    compared = some(surface_of(open_model(path)))
    ax = statement_figures.map_figure(compared, stated(compared).numbers).axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("easting [metre]", "northing [metre]")
    low, high = compared.surface.model.file_box[:, :2]
    assert ax.get_xlim()[0] <= low[0] < high[0] <= ax.get_xlim()[1]
    assert ax.get_ylim()[0] <= low[1] < high[1] <= ax.get_ylim()[1]
    assert len(ax.images) == (not turned)
    assert any(text.get_text() == "20 m" or text.get_text() == "50 m" for text in ax.texts)  # the scale bar
    if not turned:
        (image,) = ax.images
        (part,) = compared.parts()
        row, column = np.divmod(compared.surface.model.source_index, 16)
        shown = np.asarray(image.get_array().filled(np.nan))
        assert_allclose(shown[row, column][part.covered], part.values[part.covered], rtol=1e-5, atol=1e-5)


def test_shares_are_never_rounded_to_all_or_nothing():
    assert [in_per_cent(share) for share in (0.0, 1e-9, 0.3, 1 - 1e-6, 1.0)] == [
        "0 %", "1e-07 %", "30 %", "99.9999 %", "100 %"
    ]  # fmt: skip


# ---------------------------------------------------------------------------------------------------------- the ways in


@pytest.fixture(scope="module")
def front(tmp_path_factory):
    """Return the folder of a front of a raster, its smallest three solutions, one of them chosen."""
    folder = tmp_path_factory.mktemp("front")
    np.save(folder / "dem.npy", terrain())
    problem = MeshProblem(str(folder / "dem.npy"))
    kept = np.random.default_rng(1).random((3, problem.n_var)) < np.array([[0.05], [0.2], [0.5]])
    Front.from_subsets(problem, kept).save(folder / "out", chosen=1, page=True)
    return folder / "out"


def run(*argv: object) -> int:
    return main([str(word) for word in argv])


def read(folder: Path) -> dict:
    return json.loads((folder / "quality.json").read_text(encoding="utf-8"))


def test_a_front_with_a_chosen_mesh_has_its_statement_and_the_page_leads_there(front):
    loaded = Front.load(front)
    found = read(front)
    assert found["mesh"]["solution"] == 1
    for name in ("mean_error", "rms_error", "max_error", "surface_error"):
        assert found["accuracy"][name] == pytest.approx(getattr(loaded[1], name), rel=1e-9)
    assert 'href="quality.html"' in (front / "report.html").read_text(encoding="utf-8")


def test_the_command_states_the_mesh_that_is_wanted(front, tmp_path, capsys):
    loaded = Front.load(front)
    assert run("quality", front, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["folder"] == str(front / "quality")
    assert said["mesh"]["solution"] == 1
    assert (front / "quality" / "residuals.tif").is_file()
    assert run("quality", front) == 2  # it is there
    assert run("quality", front, "--overwrite", "--solution", "0", "--no-residuals") == 0
    assert read(front / "quality")["mesh"]["solution"] == 0
    assert not (front / "quality" / "residuals.tif").exists()
    assert run("quality", front, "--knee", "-o", tmp_path / "knee") == 0
    assert read(tmp_path / "knee")["mesh"]["solution"] == loaded.knee().solution
    assert run("quality", front, "--triangles", loaded[2].triangles, "-o", tmp_path / "large", "-q") == 0
    assert read(tmp_path / "large")["accuracy"]["triangles"] == loaded[2].triangles
    capsys.readouterr()
    assert run("quality", front, "--max-error", "1e-9", "--triangles", "4", "-o", tmp_path / "none") == 1
    assert not (tmp_path / "none").exists()
    assert "nothing is written" in capsys.readouterr().err
    assert run("quality", front, "--refitted", "-o", tmp_path / "refitted") == 0
    fitted = read(tmp_path / "refitted")
    assert fitted["mesh"]["refitted"]
    assert fitted["accuracy"]["mean_error"] < loaded[1].mean_error


def test_the_command_states_any_tools_mesh_with_the_same_numbers(front, tmp_path, capsys):
    mesh = tmp_path / "mine.ply"
    Front.load(front)[1].save(mesh)
    assert run("quality", front.parent / "dem.npy", "--mesh", mesh, "-o", tmp_path / "q") == 0
    out = capsys.readouterr().out
    assert "Tested" in out
    assert "quality.json, quality.html, residuals.tif" in out
    mine, own = read(tmp_path / "q"), read(front)
    assert mine["mesh"]["name"] == str(mesh)
    for name in ("mean_error", "rms_error", "max_error", "bias", "le90", "coverage", "surface_error"):
        assert mine["accuracy"][name] == pytest.approx(own["accuracy"][name], rel=1e-9), name


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--knee", "--solution", "1"], "--knee does not go with --solution"),
        (["--solution", "99"], "solutions 0 to"),
        (["--spacing", "3"], "is measured as it was made; leave --spacing out"),
        (["--outside", "ignore"], "leave --outside out"),
        (["--mesh", "a.ply", "--knee"], "--knee is for the meshes of a front"),
        (["--mesh", "a.ply", "--model", "b.ply"], "--model is for the meshes of a front"),
    ],
)
def test_what_does_not_go_together_is_refused_in_one_line(front, tmp_path, capsys, more, said):
    assert run("quality", front, "-o", tmp_path / "q", *more) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "q").exists()


def test_a_folder_of_other_things_is_not_replaced(front, tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert run("quality", front, "-o", tmp_path, "--overwrite") == 2
    assert "holds mine.txt" in capsys.readouterr().err
    assert run("quality", tmp_path) == 2
    assert "holds no front" in capsys.readouterr().err
    with pytest.raises(ResultError, match="exists already"):
        Front.load(front)[0].accuracy().save(tmp_path)


def test_unit_and_system_stand_in_the_summary_the_record_the_information_and_in_obj(tmp_path, capsys):
    dem = write_tiff(tmp_path / "dem.tif", terrain())
    how = ("--mean-error", "2.5", "--moves", "2000", "--format", "obj", "--meshes", "none", "--no-page")
    assert run("simplify", dem, "-o", tmp_path / "out", *how) == 0
    assert "EPSG:25832" in (said := capsys.readouterr().out)
    assert "searched: around a mean error of at most 2.5 m;" in said
    assert json.loads((tmp_path / "out" / "run.json").read_text())["model"]["unit"] == "m"
    assert (tmp_path / "out" / "chosen.obj").read_text().startswith("# crs: EPSG:25832\n# unit: metre\nv ")
    assert run("info", dem, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["epsg"], facts["unit"], facts["coordinate_unit"]) == (25832, "m", "metre")
    front = Front.load(tmp_path / "out")
    assert "<th>mean error [m]</th>" in front._repr_html_()
    assert not (tmp_path / "out" / "quality.html").exists()
    assert read(tmp_path / "out")["original"]["system"] == "EPSG:25832"


def test_of_the_largest_models_the_statement_is_left_out_and_the_way_to_it_is_said(tmp_path, monkeypatch, capsys):
    np.save(tmp_path / "dem.npy", terrain())
    for module in ("front", "cli.results"):
        monkeypatch.setattr(f"meshsimp_pymoo.{module}.STATED_VERTICES", 100)
    how = ("--pick", "knee", "--moves", "2000", "--meshes", "none", "--no-page")
    assert run("simplify", tmp_path / "dem.npy", "-o", tmp_path / "out", *how) == 0
    assert f"make it by meshsimp quality {tmp_path / 'out'}" in capsys.readouterr().err
    assert not (tmp_path / "out" / "quality.json").exists()
    monkeypatch.setattr("meshsimp_pymoo.front.STATED_VERTICES", 1000)
    monkeypatch.setattr("meshsimp_pymoo.front.SPACE_VERTICES", 100)
    Front.load(tmp_path / "out").draw(page=False)
    found = read(tmp_path / "out")
    assert found["accuracy"]["space"] is None
    assert "Distances in space are left out" in found["left_out"][0]


def test_a_mesh_beside_the_original_and_one_of_more_triangles_have_their_statements(tmp_path):
    surface = surface_of(open_model("roof:5"))
    points, faces = surface.model.file_points, surface.model.faces
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # matplotlib has nothing to say either
        beside = stated(compare_any(surface, points + np.array([1e3, 0.0, 0.0]), faces))
        beside.save(tmp_path / "beside")
    assert (beside.uncovered, beside.coverage) == (len(points), 0.0)
    twice = stated(compare_any(surface, points, np.concatenate([faces, faces])))
    assert twice.in_words.endswith(f"{2 * len(faces)} triangles (100 % more)")


def test_units_and_names_with_dollars_are_no_formulas(tmp_path, capsys):
    text = (
        'PROJCS["$x^^$",GEOGCS["g",DATUM["d",SPHEROID["s",6378137,298.25]],PRIMEM["Greenwich",0],'
        'UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],'
        'PARAMETER["central_meridian",3],PARAMETER["scale_factor",1],PARAMETER["false_easting",0],'
        r'PARAMETER["false_northing",0],UNIT["$\frac{m^^$",0.4572]]'
    )
    path = write_tiff(tmp_path / "$a^^$.tif", terrain(), crs=text)
    assert run("simplify", path, "-o", tmp_path / "out", "--moves", 1000, "--pick", "knee") == 0
    said = capsys.readouterr()
    assert r"$\frac{m^^$" in said.out
    assert "could not be made" not in said.err
    assert {"front.png", "quality.html"} <= {path.name for path in (tmp_path / "out").iterdir()}
