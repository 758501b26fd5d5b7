"""The one way in: what a name means, what may be passed in its place, and which settings do not fit."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import write_mesh
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.opening import open_model, open_source
from meshsimp_pymoo.problem import MeshProblem


def test_a_file_wins_over_a_built_in_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "roof").write_text("no mesh")
    with pytest.raises(ModelError, match="unknown suffix"):
        open_source("roof")
    assert open_source("plane").name == "plane"


def test_what_looks_like_a_file_is_looked_for_as_a_file(tmp_path):
    with pytest.raises(ModelError, match=r"face\.ply: no such file"):
        open_source("face.ply")
    with pytest.raises(ModelError, match="no such file"):
        open_source(str(tmp_path / "roof"))
    with pytest.raises(ModelError, match=r"did you mean 'face'"):
        open_source("fase:noise=0.5")


def test_spacing_is_for_grids_in_files():
    with pytest.raises(ModelError, match="roof: spacing is for files"):
        open_source("roof", Options(spacing=2.0))


def test_whatever_a_mesh_is_given_as_the_model_is_the_same(tmp_path):
    source = load("face:200")
    mesh = trimesh.Trimesh(source.points, source.faces, process=False)
    np.save(tmp_path / "z.npy", np.arange(12.0).reshape(3, 4) ** 2)
    expected = open_model("face:200")
    for given in (source, mesh):
        model = open_model(given, Options(up="z"))
        assert_array_equal(model.points, expected.points)
        assert_array_equal(model.faces, expected.faces)
    assert open_model(expected) is expected
    assert open_model(tmp_path / "z.npy").hash == open_model(str(tmp_path / "z.npy")).hash


@pytest.mark.parametrize(
    ("of_file", "value"),
    [
        ("spacing", 2.0),
        ("nodata", -1.0),
        ("window", (0, 0, 2, 2)),
        ("band", 1),
        ("max_edge", 3.0),
        ("classes", (2,)),
        ("columns", ("x", "y", "z")),
    ],
)
def test_what_describes_a_file_is_refused_for_a_mesh_in_memory(of_file, value):
    source = load("face:200")
    for given in (source, trimesh.Trimesh(source.points, source.faces, process=False)):
        with pytest.raises(ModelError, match=f": {of_file} is for files; a mesh in memory"):
            open_model(given, Options(**{of_file: value}))


@pytest.mark.parametrize("how", [{"up": "z"}, {"up": np.array([0, 0, 1.0]), "patch": "front"}, {"spacing": 2.0}])
def test_nothing_can_be_said_of_how_to_read_a_model_that_was_read(how):
    with pytest.raises(ModelError, match=f"face:200: is a model that was read already, .* leave {next(iter(how))}="):
        open_model(open_model("face:200"), Options(**how))
    with pytest.raises(ModelError, match="is a model that was read already"):
        MeshProblem(open_model("face:200"), **how)


def test_what_is_no_mesh_is_refused_by_type():
    with pytest.raises(TypeError, match="not int"):
        open_model(7)


@pytest.mark.filterwarnings("ignore:.* left out of the front patch")
def test_a_patch_is_cut_out_on_the_way():
    ball = trimesh.creation.icosphere(3)
    lid = open_source(ball, Options(up="z", patch="front"))
    assert 0 < len(lid.faces) < len(ball.faces)


def test_the_front_of_a_patch_finds_its_model_again(tmp_path):
    x, y = (values.ravel() for values in np.mgrid[:5, :4] * 1.0)
    sheet = [[4 * i + j, 4 * i + j + 4, 4 * i + j + 5] for i in range(4) for j in range(3)]
    sheet += [[a, c, a + 1] for a, _, c in sheet]
    write_mesh(tmp_path / "m.ply", np.column_stack([x, y, np.sin(x * y)]), sheet)
    problem = MeshProblem(tmp_path / "m.ply", patch="front", up="z")
    Front.from_subsets(problem, np.ones((1, problem.n_var), bool)).save(tmp_path / "out", page=False)
    assert Front.load(tmp_path / "out").problem.model.hash == problem.model.hash
