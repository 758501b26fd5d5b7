"""From a raster or a point cloud to a mesh for another program, through the shell and back."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from meshsimp_pymoo import Front, MeshProblem
from meshsimp_pymoo.cli import main

# How pictures look is shown in tests/report.
pytestmark = pytest.mark.usefixtures("sketched")

QUICK = ("--algorithm", "nsga2_v1", "--population", "8", "--generations", "2", "--no-page")


def run(*argv: object) -> int:
    return main([str(word) for word in argv])


@pytest.fixture
def dem(tmp_path) -> Path:
    rasterio = pytest.importorskip("rasterio")
    affine = pytest.importorskip("affine")
    y, x = np.mgrid[:14, :16]
    heights = (40 * np.exp(-((x - 7) ** 2 + (y - 6) ** 2) / 20)).astype(np.float32)
    heights[7:9, 8:11] = -9999
    place = affine.Affine(10, 0, 500_000.25, 0, -10, 5_400_000.75)
    look = {"height": 14, "width": 16, "count": 1, "dtype": "float32", "crs": "EPSG:25832", "transform": place}
    with rasterio.open(tmp_path / "dem.tif", "w", driver="GTiff", nodata=-9999, **look) as raster:
        raster.write(heights, 1)
    return tmp_path / "dem.tif"


@pytest.fixture
def cloud(tmp_path) -> Path:
    """A horseshoe of points, whose bay is as wide as it is deep."""
    rng = np.random.default_rng(3)
    xy = rng.random((900, 2)) * 30
    xy = xy[(xy[:, 1] < 10) | (np.abs(xy[:, 0] - 15) > 6)]
    points = np.column_stack([xy + np.array([400_000, 5_600_000]), np.sin(xy[:, 0] / 5)])
    np.savetxt(tmp_path / "cloud.xyz", points, fmt="%.4f")
    return tmp_path / "cloud.xyz"


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_a_raster_becomes_meshes_in_its_own_coordinates_and_the_record_says_which(dem, tmp_path, capsys):
    out = tmp_path / "out"
    assert run("simplify", dem, "-o", out, "--window", "2,1,13,12", "--pick", "knee", "--json", *QUICK) == 0
    summary = json.loads(capsys.readouterr().out)
    assert "mesh_origin" not in summary
    record = json.loads((out / "run.json").read_text())
    assert record["options"]["window"] == [2, 1, 13, 12]
    assert "window" not in record["settings"]
    facts = record["model"]["georeference"]
    assert (facts["epsg"], facts["window"]) == (25832, [2, 1, 13, 12])
    assert facts["transform"] == [10, 0, 500_000.25, 0, -10, 5_400_000.75]
    assert facts["nodata"] == "-9999.0"
    mesh = trimesh.load(out / "chosen.ply", process=False)
    column, row = (mesh.vertices[:, 0] - 500_005.25) / 10, (5_399_995.75 - mesh.vertices[:, 1]) / 10
    assert np.array_equal(column, np.round(column))
    assert (column.min(), column.max(), row.min(), row.max()) == (2, 14, 1, 12)
    # what was stored finds its raster and window again
    assert run("pick", out, "--solution", 0, "-o", tmp_path / "small.obj", "--quiet") == 0
    front = Front.load(out)
    assert front.model.georeference == facts
    assert front[0].mesh.vertices.tolist() == trimesh.load(tmp_path / "small.obj", process=False).vertices.tolist()


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_the_summary_says_where_glb_meshes_have_their_origin(dem, tmp_path, capsys):
    assert run("simplify", dem, "-o", tmp_path / "out", "--format", "glb", *QUICK) == 0
    assert "origin of the glb meshes: (500005, 5399865, 0); each file states it" in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "run.json").read_text())["mesh_origin"] == [500005, 5399865, 0]
    arguments = ("--format", "glb", "--json", *QUICK)
    assert run("simplify", dem, "-o", tmp_path / "two", *arguments) == 0
    assert json.loads(capsys.readouterr().out)["mesh_origin"] == [500005, 5399865, 0]


def test_a_cloud_becomes_a_tin_with_its_bay_open(cloud, tmp_path, capsys):
    for options, least, most in (((), 780, 900), (("--max-edge", "4"), 570, 690)):
        out = tmp_path / f"out{len(options)}"
        assert run("simplify", cloud, "-o", out, "--format", "landxml", "--pick", "knee", *options, *QUICK) == 0
        front = Front.load(out)
        area = front[-1].mesh.area_faces @ np.abs(front[-1].mesh.face_normals[:, 2])
        assert least < area < most, area
        assert front[-1].error == pytest.approx(0, abs=1e-9)
    assert run("pick", out, "--knee", "-o", tmp_path / "knee.xml") == 0
    assert capsys.readouterr().out.endswith("knee.xml\n")
    assert (tmp_path / "knee.xml").read_bytes() == (out / "chosen.xml").read_bytes()
    assert run("pick", out, "--solution", 1, "-o", tmp_path / "one.xml", "--quiet") == 0
    faces = ElementTree.parse(tmp_path / "one.xml").getroot().iter("{http://www.landxml.org/schema/LandXML-1.2}F")
    assert len(list(faces)) == front[1].triangles


def test_the_options_of_reading_reach_a_problem_and_an_experiment(cloud, tmp_path):
    from meshsimp_pymoo.comparison.config import ConfigError, read_experiment_file

    text = (
        "problems: [{name: C, model: cloud.xyz, max_edge: 4}, {name: G, model: g.npy, window: [1, 0, 3, 4]}]\n"
        "algorithms: [{preset: nsga2_v1, parameters: {pop_size: 4}}]\nseeds: [1]\nbudgets: [{generations: 1}]\n"
    )
    np.save(tmp_path / "g.npy", np.random.default_rng(1).random((5, 6)))
    (tmp_path / "a.yaml").write_text(text)
    first, second = read_experiment_file(tmp_path / "a.yaml").problems
    assert first.model.hash == MeshProblem(cloud, max_edge=4).model.hash != MeshProblem(cloud).model.hash
    assert second.model.n_vertices == 12
    assert second.model.hash == MeshProblem(tmp_path / "g.npy", window=(1, 0, 3, 4)).model.hash
    for old, new, said in [
        ("max_edge: 4", "max_edge: 0", "a number of more than 0"),
        ("[1, 0, 3, 4]", "[1, 0, 3]", r"\[column, row, columns, rows\]"),
        ("[1, 0, 3, 4]", "[1, 0, 9, 4]", "does not lie within"),
    ]:
        (tmp_path / "b.yaml").write_text(text.replace(old, new))
        with pytest.raises(ConfigError, match=said):
            read_experiment_file(tmp_path / "b.yaml")


@pytest.mark.parametrize(
    "argv",
    [("--max-edge", "0"), ("--max-edge", "x"), ("--window", "1,2,3"), ("--window=-1,0,3,3"), ("--window", "0,0,1,3")],
)
def test_options_of_reading_that_cannot_be_are_refused(cloud, capsys, argv):
    assert run("info", cloud, *argv) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_what_does_not_fit_into_memory_is_one_line(monkeypatch, capsys):
    import meshsimp_pymoo.opening

    def refuse(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(meshsimp_pymoo.opening, "mended_source", refuse)
    assert run("info", "roof") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "does not fit into memory" in line
