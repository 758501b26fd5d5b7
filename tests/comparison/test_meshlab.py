"""MeshLab's methods: counts reached, no memory between calls, far-away meshes, missing libraries."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from meshsimp_pymoo.comparison import meshlab
from meshsimp_pymoo.comparison.baselines import BASELINES, BaselineMesh, baseline_meshes, reductions
from meshsimp_pymoo.comparison.meshlab import (
    CLUSTERING,
    QUADRIC,
    meshlab_available,
    quadric_collapse,
    vertex_clustering,
)
from meshsimp_pymoo.errors import ToolUnavailable, way_to_install

MESHLAB_METHODS = {name: known.tool.args[0] for name, known in BASELINES.items() if known.group == "meshlab"}

SIDE = 21


def hills():
    """A square height field of 441 irregular vertices and 800 triangles, 20 units wide."""
    x, y = np.meshgrid(np.arange(SIDE, dtype=float), np.arange(SIDE, dtype=float))
    jitter = np.random.default_rng(0).uniform(-0.3, 0.3, (2, SIDE - 2, SIDE - 2))
    x[1:-1, 1:-1] += jitter[0]
    y[1:-1, 1:-1] += jitter[1]
    z = 2 * np.sin(x / 4) * np.cos(y / 5) + 0.03 * x * y / 4
    row, column = np.divmod(np.arange((SIDE - 1) ** 2), SIDE - 1)
    a = row * SIDE + column
    lower, upper = np.stack([a, a + 1, a + SIDE + 1], 1), np.stack([a, a + SIDE + 1, a + SIDE], 1)
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()]), np.vstack([lower, upper])


VERTICES, FACES = hills()


@pytest.fixture(scope="module")
def pymeshlab():
    """Import pymeshlab as the package does; the reason of a skip names the packages to install."""
    try:
        return meshlab.load_pymeshlab()
    except ToolUnavailable as reason:
        pytest.skip(str(reason))


@pytest.fixture
def shared_mesh(shared_data):
    """Read a mesh of the shared test data."""
    trimesh = pytest.importorskip("trimesh")

    def read(name):
        mesh = trimesh.load(shared_data / f"{name}.ply", process=False)
        return np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces)

    return read


@pytest.fixture(scope="session")
def vertical_error(oracle):
    """Load the independent referee's function."""
    spec = importlib.util.spec_from_file_location("vertical_error", oracle)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.vertical_error


def assert_is_a_mesh(vertices, faces):
    assert vertices.dtype == np.float64
    assert faces.dtype == np.int64
    assert_array_equal(np.unique(faces), np.arange(len(vertices)))  # all used, none out of range
    ordered = np.sort(faces, axis=1)
    assert (np.diff(ordered, axis=1) > 0).all()
    assert len(np.unique(ordered, axis=0)) == len(faces)


@pytest.mark.usefixtures("pymeshlab")
class TestEveryMethod:
    @pytest.mark.parametrize("name", MESHLAB_METHODS)
    def test_reaches_the_count_and_stays_near_the_surface(self, name):
        for asked in (760, 400, 200):
            vertices, faces = MESHLAB_METHODS[name](VERTICES, FACES, asked)
            assert_is_a_mesh(vertices, faces)
            # the grid of the clustering cannot give every count
            assert abs(len(faces) - asked) <= (0.03 if name == "vertex_clustering" else 0.02) * asked
            assert (vertices.min(axis=0) > VERTICES.min(axis=0) - 1).all()
            assert (vertices.max(axis=0) < VERTICES.max(axis=0) + 1).all()

    @pytest.mark.parametrize("name", MESHLAB_METHODS)
    def test_has_no_memory_of_the_calls_before(self, name):
        def all_of_it(names):
            return {key: MESHLAB_METHODS[key](VERTICES, FACES, 301) for key in names}

        forwards, backwards = all_of_it(MESHLAB_METHODS), all_of_it(reversed(MESHLAB_METHODS))
        for one, other in zip(forwards[name], backwards[name], strict=True):
            assert_array_equal(one, other)

    @pytest.mark.parametrize("name", MESHLAB_METHODS)
    def test_works_far_from_the_origin(self, name):
        offset = np.array([1e7, -2e7, 5e3])
        vertices, faces = MESHLAB_METHODS[name](VERTICES, FACES, 250)
        far, far_faces = MESHLAB_METHODS[name](VERTICES + offset, FACES, 250)
        assert_array_equal(far_faces, faces)
        assert_allclose(far - offset, vertices, rtol=0, atol=1e-7)

    @pytest.mark.parametrize("name", MESHLAB_METHODS)
    def test_leaves_its_arguments_alone(self, name):
        vertices, faces = VERTICES.copy(), FACES.astype(np.int32)
        vertices.setflags(write=False)
        faces.setflags(write=False)
        MESHLAB_METHODS[name](vertices, faces, 100)
        assert_array_equal(vertices, VERTICES)

    @pytest.mark.parametrize("name", MESHLAB_METHODS)
    def test_asked_for_all_triangles_loses_none(self, name):
        vertices, faces = MESHLAB_METHODS[name](VERTICES, FACES, len(FACES))
        assert len(faces) == len(FACES)
        assert_allclose(np.sort(vertices, axis=0), np.sort(VERTICES, axis=0), atol=1e-12)

    @pytest.mark.parametrize("name", MESHLAB_METHODS)
    @pytest.mark.parametrize("asked", [0, -5, len(FACES) + 1])
    def test_refuses_impossible_counts(self, name, asked):
        with pytest.raises(ValueError, match=f"{asked} triangles were asked for, but the mesh has 800"):
            MESHLAB_METHODS[name](VERTICES, FACES, asked)

    @pytest.mark.parametrize("name", MESHLAB_METHODS)
    def test_refuses_broken_meshes(self, name):
        with pytest.raises(ValueError, match="NaN or infinite"):
            MESHLAB_METHODS[name](np.where(VERTICES == 3, np.nan, VERTICES), FACES, 10)
        with pytest.raises(ValueError, match="use vertices 0 to 440, of 100"):
            MESHLAB_METHODS[name](VERTICES[:100], FACES, 10)
        with pytest.raises(ValueError, match="three columns"):
            MESHLAB_METHODS[name](VERTICES[:, :2], FACES, 10)
        with pytest.raises(ValueError, match="the same point"):
            MESHLAB_METHODS[name](np.ones_like(VERTICES), FACES, 10)


def test_every_parameter_of_the_filters_is_passed(pymeshlab, monkeypatch):
    passed = {}

    def spy(vertices, faces, name, **parameters):
        passed[name] = set(parameters)
        return filtered(vertices, faces, name, **parameters)

    filtered = meshlab._filtered
    monkeypatch.setattr(meshlab, "_filtered", spy)
    quadric_collapse(VERTICES, FACES, 100, preserve_boundary=True)
    vertex_clustering(VERTICES, FACES, 400)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(VERTICES, FACES))
    assert passed == {name: set(meshes.filter_parameter_values(name)) for name in (QUADRIC, CLUSTERING)}


@pytest.mark.usefixtures("pymeshlab")
def test_the_border_stays_only_if_it_is_preserved():
    def extent(vertices):
        return np.ptp(vertices[:, :2], axis=0)

    kept, faces = quadric_collapse(VERTICES, FACES, 20, preserve_boundary=True)
    assert_allclose(extent(kept), SIDE - 1, atol=1e-9)
    assert len(faces) >= 4 * (SIDE - 1) - 2  # so many triangles the border alone needs
    shrunk, faces = quadric_collapse(VERTICES * 50, FACES, 20, preserve_boundary=False)
    assert len(faces) <= 20
    assert (extent(shrunk) < 50 * (SIDE - 1)).any()


@pytest.mark.usefixtures("pymeshlab")
def test_scaled_to_a_unit_diagonal_the_unit_of_the_file_does_not_matter():
    vertices, faces = quadric_collapse(VERTICES, FACES, 200, preserve_boundary=False, unit_diagonal=True)
    for unit in (2.0**-20, 2.0**10):
        scaled, same = quadric_collapse(VERTICES * unit, FACES, 200, preserve_boundary=False, unit_diagonal=True)
        assert_array_equal(same, faces)
        assert_allclose(scaled, vertices * unit, rtol=1e-12, atol=1e-12 * unit)


@pytest.mark.usefixtures("pymeshlab")
def test_clustering_that_leaves_nothing_is_an_error(monkeypatch):
    nothing = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    monkeypatch.setattr(meshlab, "_filtered", lambda *_, **__: nothing)
    with pytest.raises(ValueError, match="leaves none of 800 triangles"):
        vertex_clustering(VERTICES, FACES, 2)


def test_one_mesh_has_one_listing():
    rng = np.random.default_rng(1)
    vertices, faces = meshlab._canonical(VERTICES, FACES)
    assert_is_a_mesh(vertices, faces)
    assert len(faces) == len(FACES)
    for _ in range(5):
        order = rng.permutation(len(VERTICES))
        position = np.argsort(order)
        turned = np.array([np.roll(face, rng.integers(3)) for face in position[FACES]])
        padded = np.vstack([turned, turned[:9], [[4, 4, 5]]])  # a few twice, one degenerate
        same, same_faces = meshlab._canonical(np.vstack([VERTICES[order], [[9, 9, 9]]]), rng.permutation(padded))
        assert_array_equal(same, vertices)
        assert_array_equal(same_faces, faces)


def test_folded_back_triangles_count_once():
    flap = np.vstack([FACES, FACES[:10, ::-1]])
    assert len(meshlab._canonical(VERTICES, flap)[1]) == len(FACES)


@pytest.mark.usefixtures("pymeshlab")
def test_a_busts_baselines_reach_their_counts_or_say_so(shared_mesh):
    vertices, faces = shared_mesh("m1_laurana")
    for name, method in MESHLAB_METHODS.items():
        for asked in reductions(len(faces), down_to=200, steps=4):
            mesh = BaselineMesh(name, asked, *method(vertices, faces, asked), quality=None, seconds=0.0)
            assert_is_a_mesh(mesh.vertices, mesh.faces)
            off = abs(mesh.triangles - asked)
            assert (off <= max(1, 0.02 * asked)) == (mesh.note == "")
            if mesh.note:
                assert mesh.note == f"{name} was asked for {asked} triangles and gave {mesh.triangles}"
            assert off <= 0.1 * asked  # the series down to half is met by all, sizes below it nearly


@pytest.mark.usefixtures("pymeshlab")
def test_meshlabs_own_collapse_abandons_the_border_and_the_unit_matters(shared_mesh, vertical_error):
    vertices, faces = shared_mesh("m1_laurana")

    def score(name):
        error, uncovered, _ = vertical_error(vertices, *MESHLAB_METHODS[name](vertices, faces, 415))
        return error, uncovered

    error, uncovered = score("quadric_collapse")
    assert uncovered > 0.07 * len(vertices)
    unit_error, unit_uncovered = score("quadric_collapse_unit")
    assert unit_error < 0.7 * error
    assert unit_uncovered < 0.5 * uncovered
    assert score("quadric_collapse_boundary")[1] == 0


@pytest.mark.usefixtures("pymeshlab")
def test_every_mesh_is_scored_as_the_referee_does(shared_data, vertical_error):
    from meshsimp_pymoo.opening import open_model
    from meshsimp_pymoo.surface.height import HeightSurface

    bust = HeightSurface(open_model(shared_data / "m1_laurana.ply"))
    for name in MESHLAB_METHODS:
        for mesh in baseline_meshes(bust, name, [1000, 300]):
            error, uncovered, _ = vertical_error(bust.model.file_points, mesh.vertices, mesh.faces)
            assert_allclose(mesh.quality.error, error, rtol=1e-6)
            assert mesh.quality.uncovered == uncovered


class TestWhereMeshLabIsMissing:
    """A machine without the libraries, played by a pymeshlab that behaves as the real one does there."""

    NO_LIBGL = (
        'import os; os.write(1, b"noise"); os.write(2, b"noise")\n'
        'raise ImportError("libGL.so.1: cannot open shared object file: No such file or directory")'
    )
    NO_LIBOPENGL = (
        'import os; os.write(1, b"Unable to load the following plugins"); os.write(2, b"noise")\n'
        'def filter_list(): return ["meshing_decimation_clustering"]'
    )
    NOT_INSTALLED = "raise ModuleNotFoundError(\"No module named 'pymeshlab'\")"
    LIBRARIES = ("libgl1", "libopengl0", "libGL.so.1", "libOpenGL.so.0")
    SCRIPT = """
import warnings
warnings.simplefilter("error")
import meshsimp_pymoo.comparison.meshlab as meshlab
assert not meshlab.meshlab_available()
try:
    meshlab.quadric_collapse([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], 1, preserve_boundary=True)
except meshlab.ToolUnavailable as error:
    print(error)
"""

    @pytest.mark.parametrize(
        ("stand_in", "said"),
        [
            (NO_LIBGL, ("libGL.so.1: cannot open shared object file", *LIBRARIES)),
            (NO_LIBOPENGL, ("it lacks meshing_decimation_quadric_edge_collapse", *LIBRARIES)),
            (NOT_INSTALLED, ("MeshLab's methods need pymeshlab; install it by ", way_to_install("meshlab"))),
        ],
    )
    def test_one_line_names_the_packages_and_nothing_else_is_printed(self, tmp_path, stand_in, said):
        (tmp_path / "pymeshlab.py").write_text(stand_in)
        root = str(Path(meshlab.__file__).parents[2])
        done = subprocess.run(
            [sys.executable, "-c", self.SCRIPT],
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), root])},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.count("\n") == 1
        for words in said:
            assert words in done.stdout

    def test_importing_the_module_does_not_import_pymeshlab(self):
        code = "import sys, meshsimp_pymoo.comparison.meshlab; print('pymeshlab' in sys.modules)"
        root = str(Path(meshlab.__file__).parents[2])
        done = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONPATH": root},
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout == "False\n"

    def test_being_quiet_is_over_afterwards(self, capfd):
        with meshlab._quiet():
            os.write(1, b"lost")
            os.write(2, b"lost")
        os.write(1, b"heard")
        os.write(2, b"heard too")
        assert capfd.readouterr() == ("heard", "heard too")

    def test_available_tells_the_truth_here(self):
        try:
            import pymeshlab
        except ImportError:
            assert not meshlab_available()
        else:
            assert meshlab_available() == (QUADRIC in pymeshlab.filter_list())
