"""The table of formats: what every one of them keeps to, and that a new one is one file."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal
from pyramid import COLORS, FACES, POINTS, ascii_ply, binary_ply, refusal, write
from samples import coloured, write_solutions

from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning, way_to_install
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import (
    SORTS,
    WAYS_OUT,
    Format,
    all_formats,
    described,
    format_of_input,
    read_lines,
    read_source,
    read_suffixes,
    register,
    write_lines,
    write_mesh,
    written_formats,
)
from meshsimp_pymoo.settings import settings_of
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.surface import mesh_arrays

BOTH_WAYS = [kind.name for kind in all_formats() if kind.read and kind.write]


# ------------------------------------------------------------------------------------- what every format keeps to


@pytest.mark.parametrize("name", BOTH_WAYS)
def test_what_a_format_writes_it_reads_back(tmp_path, name):
    kind = written_formats()[name]
    for suffix in (kind.suffix, kind.suffix.upper()):
        write_mesh(tmp_path / f"a{suffix}", POINTS, FACES, {"color": COLORS})
        source = read_source(tmp_path / f"a{suffix}")
        corners = source.points[source.faces]
        if kind.single_precision:
            np.testing.assert_allclose(corners, POINTS[FACES], rtol=1e-7, atol=1e-7)
        else:
            assert_array_equal(source.points, POINTS)
            assert_array_equal(corners, POINTS[FACES])
        if "color" in source.attributes:
            assert_array_equal(source.attributes["color"], COLORS)
    assert (tmp_path / f"a{kind.suffix}").read_bytes() == (tmp_path / f"a{kind.suffix.upper()}").read_bytes()


def test_the_same_mesh_is_the_same_bytes_at_another_time_and_in_upper_case(tmp_path):
    facts, lines = {"epsg": 32633, "unit": "metre"}, (np.array([0, 4, 2]), np.array([4, 1]))
    written = [kind for kind in written_formats().values() if not kind.needs or find_spec(kind.needs)]

    def content(name: str, kind: Format, spell: Callable[[str], str]) -> bytes:
        path = tmp_path / f"{name}{spell(kind.suffix)}"
        write_mesh(path, POINTS, FACES, {"color": COLORS}, georeference=facts, lines=lines, line_names=("a", "b"))
        return path.read_bytes()

    first = [content("a", kind, str.lower) for kind in written]
    time.sleep(1.1)  # dates in files are in seconds
    assert [content("b", kind, str.upper) for kind in written] == first


def test_what_is_written_by_a_library_of_an_extra_says_by_which():
    without = {kind.name for kind in written_formats().values() if bool(kind.extra) != bool(kind.needs)}
    assert without == set()


@pytest.mark.parametrize("name", [kind.name for kind in all_formats() if kind.needs])
def test_a_library_that_is_missing_for_writing_is_named_before_any_search(tmp_path, monkeypatch, capsys, name):
    kind = written_formats()[name]
    monkeypatch.setitem(sys.modules, kind.needs, None)
    assert main(["simplify", "roof:5", "-o", str(tmp_path / "out"), "--format", name, "--quiet"]) == 2
    said = capsys.readouterr().err
    assert re.search(rf"{kind.title} is written by {kind.needs}; install it by pip install '.*{kind.needs}", said), said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", BOTH_WAYS)
def test_half_of_what_a_format_writes_is_refused_in_one_line(tmp_path, name):
    path = tmp_path / f"a{written_formats()[name].suffix}"
    write_mesh(path, POINTS, FACES)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    if name == "obj":  # which declares nothing: it may as well hold points alone
        with pytest.warns(ModelWarning, match="no faces, so it is read as a point cloud"):
            assert len(read_source(path).points) <= len(POINTS)
        return
    refusal(path)


@pytest.mark.parametrize("name", [kind.name for kind in all_formats() if kind.read])
def test_nonsense_is_refused_in_one_line_or_read_as_nothing(tmp_path, name):
    kind = next(kind for kind in all_formats() if kind.name == name)
    for suffix in kind.suffixes:
        refusal(write(tmp_path, f"a{suffix}", b"\x00\xff nonsense; " * 9))


def test_a_setting_describes_a_sort_of_model_that_there_is():
    of_one_sort = {name: known.describes for name, known in settings_of(Options).items() if known.describes}
    models = {*SORTS, *(kind.name for kind in all_formats())}
    assert {model for models in of_one_sort.values() for model in models} <= models
    assert described() == list(of_one_sort)
    assert {"spacing", "nodata", "window"} <= set(described("grid"))
    assert described("cloud") == ["nodata", "max_edge", "classes"]
    assert described("cloud", "xyz") == ["nodata", "max_edge", "classes", "columns"]


# ---------------------------------------------------------------------------------------------- a new one is one file

TOY = '''
"""Toy meshes: arrays in JSON."""

import json

from meshsimp_pymoo.formats.table import Format, register


def _read(path, name, options):
    from meshsimp_pymoo.formats.source import build_source

    return build_source(*json.loads(path.read_text()), {}, name)


def _write(path, mesh):
    path.write_text(json.dumps([mesh.vertices.tolist(), mesh.faces.tolist()]))


register(Format("toy", (".toy",), "toy meshes", read=_read, write=_write))
'''
TOY_IN_USE = """
import contextlib, io
from pathlib import Path
import meshsimp_pymoo.formats
meshsimp_pymoo.formats.__path__.append("more")
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.table import read_source, write_mesh

roof = load("roof:5")
write_mesh("roof.toy", roof.points, roof.faces)
assert (read_source("roof.toy").points == roof.points).all()
quick = ["--algorithm", "nsga2_v1", "--generations", "2", "--population", "8", "--quiet", "--no-page"]
assert main(["simplify", "roof.toy", "-o", "out", "--format", "toy", "--pick", "knee", *quick]) == 0
chosen = read_source("out/chosen.toy")
assert len(list(Path("out/meshes").glob("*.toy"))) > 0
assert main(["pick", "out", "--knee", "-o", "knee.toy", "--quiet"]) == 0
assert (read_source("knee.toy").points == chosen.points).all()
assert main(["pick", "out", "--solution", "0", "-o", "first.ply", "--quiet"]) == 0
assert main(["simplify", "grid.npy", "--tile", "64", "--jobs", "1", "-o", "tiled", "--format", "toy", *quick[-2:]]) == 0
assert len(list(Path("tiled/meshes").glob("*.toy"))) > 0
for argv, said in ((["simplify", "--help"], ".toy"), (["pick", "--help"], ".toy")):
    with contextlib.redirect_stdout(io.StringIO()) as shown, contextlib.suppress(SystemExit):
        main(argv)
    assert said in shown.getvalue(), argv
try:
    read_source("toy.py.none")
except ModelError as problem:
    assert ".toy" in str(problem), problem
else:
    raise AssertionError("read")
"""


def test_a_new_format_is_one_new_file(tmp_path):
    (tmp_path / "more").mkdir()
    write(tmp_path / "more", "toy.py", TOY)
    write(tmp_path, "toy.py.none", "1")
    np.save(tmp_path / "grid.npy", np.random.default_rng(1).random((8, 130)))
    command = [sys.executable, "-W", "error", "-c", TOY_IN_USE]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (ran.stderr, ran.returncode) == ("", 0)


def test_a_new_format_with_the_suffix_of_another_is_refused_at_once():
    with pytest.raises(ValueError, match=r"'ply2' and 'ply' share .*\.ply"):
        register(Format("ply2", (".ply",), "PLY", read=read_source))
    for way in ({"read_lines": read_lines}, {"write_lines": write_lines}):
        with pytest.raises(ValueError, match=r"'json' and 'geojson' share .*\.json"):
            register(Format("json", (".json",), "JSON", sort="lines", **way))
    with pytest.raises(ValueError, match="of the sort 'solid'"):
        register(Format("solids", (".solid",), "solids", "solid"))


LIGHT = """
import sys
from meshsimp_pymoo.formats.table import all_formats, read_suffixes, written_suffixes
assert len(all_formats()) > 10
for sort in ("mesh", "grid", "cloud"):
    assert read_suffixes(sort, further=False)
assert written_suffixes()
heavy = {"numpy", "numba", "trimesh", "scipy", "rasterio", "laspy"} & set(sys.modules)
assert not heavy, heavy
from contextlib import suppress
from meshsimp_pymoo.cli import main
with suppress(SystemExit):
    main(["simplify", "--help"])
assert "numpy" not in sys.modules
"""


def test_the_formats_are_known_before_anything_heavy_is_imported():
    ran = subprocess.run([sys.executable, "-c", LIGHT], capture_output=True, text=True)
    assert (ran.stderr, ran.returncode) == ("", 0)


# --------------------------------------------------------------------------------------------- files that others write


@pytest.mark.parametrize("suffix", ["ply", "obj", "off", "stl", "stl_ascii", "glb"])
def test_every_format_that_trimesh_writes_is_read_back(tmp_path, suffix):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    if suffix in ("ply", "obj", "glb"):
        mesh.visual.vertex_colors = COLORS
    path = write(tmp_path, f"mesh.{suffix}", mesh.export(file_type=suffix))
    if suffix == "stl_ascii":
        path = path.rename(tmp_path / "mesh_ascii.stl")
    source = read_source(path)
    tolerance = 1e-7 if suffix in ("stl", "glb", "ply") else 1e-8  # of single precision, or of printed digits
    assert len(source.points) == 5
    assert_array_equal(np.sort(source.points[source.faces], axis=1).shape, (4, 3, 3))
    np.testing.assert_allclose(source.points[source.faces], POINTS[FACES], atol=tolerance)
    if suffix in ("ply", "obj", "off", "glb"):
        np.testing.assert_allclose(source.points, POINTS, atol=tolerance)
        assert_array_equal(source.faces, FACES)
    if suffix in ("ply", "obj", "glb"):
        assert_array_equal(source.attributes["color"], COLORS)
    # the vertices of an STL are numbered as they first appear
    if suffix == "stl":
        assert_array_equal(source.rows, [0, 1, 2, 4, 7])


def test_reading_is_silent(tmp_path):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    for suffix in ("ply", "obj", "off", "stl", "glb"):
        write(tmp_path, f"good.{suffix}", mesh.export(file_type=suffix))
        write(tmp_path, f"bad.{suffix}", b"\x00\xff nonsense; " * 9)
    # trimesh logs a normal that it cannot read, and reads on
    write(tmp_path, "odd.stl", mesh.export(file_type="stl_ascii").replace("normal", "normal x", 1))
    write(tmp_path, "seen.py", SILENT)
    # in a process of its own: pytest takes the logs away
    command = [sys.executable, "-W", "always", "seen.py"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (ran.stdout, ran.stderr, ran.returncode) == ("", "", 0)


SILENT = """
from pathlib import Path
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.table import read_source
for path in sorted(Path(".").glob("*.*")):
    try:
        read_source(path)
    except ModelError:
        continue
"""


# ------------------------------------------------------------------------------------------------- what is refused


def test_what_is_not_a_readable_file_is_refused(tmp_path, monkeypatch):
    assert "no such file" in refusal(tmp_path / "missing.ply")
    folder = tmp_path / "folder.ply"
    folder.mkdir()
    assert "is a folder" in refusal(folder)
    assert "empty (0 bytes)" in refusal(write(tmp_path, "empty.ply", b""))
    message = refusal(write(tmp_path, "a.xyzzy", "1"))
    assert "'.xyzzy'" in message
    for suffix in (".ply", ".obj", ".stl", ".off", ".glb", ".npy", ".npz", ".asc", ".png"):
        assert suffix in message

    def denied(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    path = write(tmp_path, "locked.ply", binary_ply())
    monkeypatch.setattr(Path, "read_bytes", denied)
    assert "Permission denied" in refusal(path)


def test_spacing_and_nodata_of_a_mesh_are_refused(tmp_path):
    path = write(tmp_path, "a.ply", binary_ply())
    assert "grids" in refusal(path, spacing=2.0)
    assert "grids" in refusal(path, nodata=0.0)


@pytest.mark.parametrize("suffix", [".zip", ".3mf", ".zae", ".pcd"])
def test_archives_are_not_unpacked(tmp_path, suffix):
    assert f"unknown suffix '{suffix}'" in refusal(write(tmp_path, f"a{suffix}", binary_ply()))


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("a b.vrt", "gdal_translate 'FOLDER/a b.vrt' out.tif"),
        ("surfer.GRD", "gdal_translate FOLDER/surfer.GRD out.tif"),
        ("scan.e57", "save it as .las or .xyz, or with its faces as .ply"),
        ("house.blend", "export it as .ply, .obj or .glb"),
        ("part.step", "export it as .ply, .obj or .glb"),
        ("N47E011.hgt.zip", "unpack it, and name the file in it"),
        ("a.hdr", "name that one"),
        ("points.xlsx", "save the table as .csv"),
        ("contours.shp", "gdal_grid"),
        ("contours.shp", "can be break lines of a model: --break-lines FOLDER/contours.shp"),
        ("plan.dxf", "--break-lines FOLDER/plan.dxf"),
        ("tin.xml", "--break-lines FOLDER/tin.xml"),
        ("tin.xml", "LandXML is written, not read: export it as .ply or .obj"),
        ("tin.dxf", "DXF is written, not read: if it is a mesh, export it as .ply, .obj or .glb"),
        ("tin.2dm", "2DM is written, not read: if it is a mesh, export it"),
        ("tin.vtu", "VTU is written, not read: if it is a mesh, export it"),
        ("tin.gpkg", "GeoPackage is written, not read: it holds features"),
    ],
)
def test_what_is_not_read_is_told_the_way_out(tmp_path, name, advice):
    message = refusal(write(tmp_path, name, "1"))
    assert f"unknown suffix {Path(name).suffix.lower()!r}; " in message
    assert advice.replace("FOLDER", str(tmp_path)) in message


def test_no_suffix_is_said_to_be_known_and_refused():
    known = [suffix for sort in SORTS for suffix in read_suffixes(sort)]
    assert [suffix for suffix in known if format_of_input(f"a{suffix}") is None] == []


def test_no_suffix_is_both_read_and_sent_elsewhere():
    elsewhere = [suffix for suffixes, _ in WAYS_OUT for suffix in suffixes.split()]
    assert len(set(elsewhere)) == len(elsewhere)
    assert not set(elsewhere) & {suffix for kind in all_formats() if kind.read for suffix in kind.suffixes}


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.ply", ascii_ply()),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 4 3\n"),
        ("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 1 1\n3 0 1 2\n3 1 3 2\n"),
        ("a.stl", trimesh.Trimesh(POINTS, FACES, process=False).export(file_type="stl_ascii")),
        ("a.asc", "ncols 2\nnrows 2\ncellsize 1\n1 2\n3 4\n"),
        ("a.csv", "x,y,z\n0,0,0\n1,0,0\n0,1,0\n1,1,1\n"),
    ],
)
def test_a_byte_order_mark_before_text_makes_no_difference(tmp_path, name, content):
    plain = read_source(write(tmp_path, name, content))
    marked = read_source(write(tmp_path, name, "\ufeff" + content))
    assert_array_equal(marked.points, plain.points)
    assert_array_equal(marked.faces, plain.faces)


def test_a_gltf_with_a_byte_order_mark_finds_its_buffers(tmp_path):
    for file, content in trimesh.Trimesh(POINTS, FACES, process=False).export(file_type="gltf").items():
        write(tmp_path, file, b"\xef\xbb\xbf" * file.endswith(".gltf") + content)
    assert len(read_source(tmp_path / "model.gltf").points) == 5


GRIDS = {"a.npy": np.save, "a.npz": np.savez_compressed}


@pytest.mark.parametrize("name", GRIDS)
def test_a_grid_is_compared_with_the_memory_before_it_is_unpacked(tmp_path, name):
    """Some kilobytes that declare 16 million heights end in one line, and take no memory."""
    path = tmp_path / name
    GRIDS[name](path, np.zeros((4000, 4000), np.uint8))
    code = f"""if True:
        import resource, sys, meshsimp_pymoo.formats.source.heights, meshsimp_pymoo.files
        from meshsimp_pymoo import memory
        from meshsimp_pymoo.errors import ModelError
        from meshsimp_pymoo.formats.table import read_source
        memory.free_memory = lambda: (2.0**30, 2.0**30)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        try:
            read_source({str(path)!r})
        except ModelError as problem:
            print(problem)
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < before + 8000, "allocated"
    """
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.stderr == ""
    assert re.search(
        r"4000 x 4000 samples need about 4\.5 GiB, and 1\.0 GiB are free; take a part .*--tile", ran.stdout
    )


def test_from_a_clone_that_is_not_installed_the_extra_is_named(monkeypatch):
    def unknown(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.requires", unknown)
    assert way_to_install("las") == "pip install '.[las]' in the folder of its pyproject.toml"


@pytest.mark.parametrize(
    ("suffix", "module", "needed"), [("las", "laspy", r"laspy\[lazrs\]>=2.5"), ("tif", "rasterio", "rasterio>=1.4")]
)
def test_a_missing_library_is_named_with_the_way_to_install_it(tmp_path, monkeypatch, suffix, module, needed):
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / f"a.{suffix}").write_bytes(b"LASF" + bytes(400))
    with pytest.raises(ModelError, match=rf"needs {module}; install it by pip install '{needed}'$"):
        read_source(tmp_path / f"a.{suffix}")


def test_settings_are_for_the_models_that_they_describe_alone(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((3, 3)))
    with pytest.raises(ModelError, match="max_edge and classes describe point clouds"):
        read_source(tmp_path / "a.npy", Options(max_edge=2.0))
    (tmp_path / "a.xyz").write_text("0 0 0\n1 0 0\n0 1 0\n1 1 1\n")
    with pytest.raises(ModelError, match=r"spacing.* describe height grids"):
        read_source(tmp_path / "a.xyz", Options(window=(0, 0, 2, 2)))
    write(tmp_path, "a.ply", ascii_ply())
    for options, said in [
        ({"max_edge": 2.0}, r"nodata, max_edge and classes describe point clouds \(.*\.las"),
        ({"nodata": 2.0}, r"spacing, nodata.* describe height grids"),
        ({"columns": ("x", "y", "z")}, r"columns describes text of x y z \(\.xyz \.pts \.txt \.csv\); leave it out"),
    ]:
        assert re.search(said, refusal(tmp_path / "a.ply", **options))


@pytest.mark.parametrize("suffix", BOTH_WAYS)
def test_every_format_opens_in_pymeshlab(tmp_path, model, solutions, suffix):
    pymeshlab = pytest.importorskip("pymeshlab", exc_type=ImportError)
    vertices, faces, attributes = mesh_arrays(model, solutions[1][0].faces)
    write_mesh(tmp_path / f"a.{suffix}", vertices, faces, attributes)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(tmp_path / f"a.{suffix}"))
    assert meshes.current_mesh().face_number() == len(faces)
    if suffix == "ply":
        assert np.array_equal(meshes.current_mesh().vertex_matrix(), vertices)


@pytest.mark.parametrize("suffix", BOTH_WAYS)
def test_every_format_opens_in_trimesh_with_the_same_shape(tmp_path, model, solutions, suffix):
    folder = write_solutions(tmp_path / "out", model, solutions, mesh_format=suffix, chosen=0, meshes=1)
    vertices, faces, _ = mesh_arrays(model, solutions[1][0].faces)
    mesh = trimesh.load(folder / f"chosen.{suffix}", process=False, force="mesh")
    single = suffix in ("stl", "glb")
    assert len(mesh.faces) == len(faces)
    corners = mesh.triangles.reshape(-1, 9)
    expected = vertices[faces].reshape(-1, 9)
    if suffix == "glb":  # Y is up there
        expected = (vertices[faces] @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]]).reshape(-1, 9)
    if single:
        np.testing.assert_allclose(corners, expected, rtol=1e-6, atol=1e-5)
    else:
        assert np.array_equal(corners, expected)


@pytest.mark.parametrize("suffix", ["obj", "glb"])
def test_colours_travel_in_the_other_formats_that_hold_them(tmp_path, solutions, suffix):
    source = coloured(load("face:200"))
    lost = f"{suffix} does not hold label, pair, quality, seen and two words of the vertices; ply does"
    with pytest.warns(ModelWarning, match=lost):
        folder = write_solutions(tmp_path / "out", build_model(source), solutions, chosen=1, mesh_format=suffix)
    mesh = trimesh.load(folder / f"chosen.{suffix}", process=False, force="mesh")
    points = read_source(folder / f"chosen.{suffix}").points
    came_from = np.linalg.norm(points[:, None] - source.points, axis=2).argmin(axis=1)
    expected = source.attributes["color"][came_from, :3]
    np.testing.assert_allclose(mesh.visual.vertex_colors[:, :3].astype(int), expected.astype(int), atol=1)
