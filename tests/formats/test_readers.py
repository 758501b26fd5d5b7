"""What is written, opened by the programs and libraries that people open it with: the same triangles, the same places.

How far coordinates are off is in the table of docs/reference/formats.md, which these tests hold to be true.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import qgis

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import write_mesh, written_formats

FORMATS = written_formats()
PAGE = Path(__file__).parents[2] / "docs" / "reference" / "formats.md"


# ------------------------------------------------------------------------------------------------- what is written


def _terrain(origin: tuple[float, float], step: tuple[float, float]) -> tuple[FloatArray, IntArray]:
    """Return hills of 9 x 11 vertices, each off the lattice: no coordinate is a round number."""
    rng = np.random.default_rng(7)
    grid = grid_source(rng.random((9, 11)), 1.0, 1.0, name="hills")
    points = grid.points + rng.uniform(-0.2, 0.2, grid.points.shape)
    return np.column_stack([points[:, :2] * step + origin, 200.0 + 400.0 * points[:, 2]]), grid.faces


@cache
def written(case: str) -> tuple[FloatArray, IntArray, dict[str, Any]]:
    """Return the vertices and triangles of a model, and what is known of its coordinates."""
    if case == "UTM":
        return *_terrain((412_015.0, 5_259_015.0), (30.0, 30.0)), {"epsg": 32633, "unit": "metre"}
    if case == "degrees":
        facts = {"epsg": 4326, "unit": "degree", "scale": [75_000.0, 111_000.0], "height_unit": "metre"}
        return *_terrain((8.0, 47.0), (1 / 3600, 1 / 3600)), facts
    blob = load("blob:400")
    return blob.points, blob.faces, {}


SYSTEMS = {"UTM": "EPSG:32633", "degrees": "EPSG:4326", "blob": ""}
CASES = tuple(SYSTEMS)


# ------------------------------------------------------------------------------------- readers: the corners (M, 3, 3)


def by_trimesh(path: Path) -> FloatArray:
    import trimesh

    return trimesh.load(path, process=False, force="mesh").triangles.view(np.ndarray)


def by_meshio(path: Path) -> FloatArray:
    meshio = pytest.importorskip("meshio")
    mesh = meshio.read(path)
    return mesh.points[mesh.cells_dict["triangle"]]


def by_meshlab(path: Path) -> FloatArray:
    pymeshlab = pytest.importorskip("pymeshlab", exc_type=ImportError)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix()[mesh.face_matrix()]


def by_vtk(path: Path) -> FloatArray:
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.read(path)
    assert set(grid.celltypes.tolist()) <= {3, 5}
    return np.asarray(grid.points)[grid.cells_dict[5]]


def by_gdal(path: Path) -> FloatArray:
    raw = pytest.importorskip("pyogrio.raw")
    with pytest.warns(RuntimeWarning, match="ring") if path.suffix == ".dxf" else contextlib.nullcontext():
        _, _, geometries, _ = raw.read(path)  # the first layer; GDAL closes the rings of 3DFACE itself
    return _rings(geometries)


def by_ezdxf(path: Path) -> FloatArray:
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.readfile(path)
    report = drawing.audit()
    assert (report.errors, report.fixes) == ([], [])
    faces = drawing.modelspace().query("3DFACE")
    assert all(face.dxf.vtx3 == face.dxf.vtx2 for face in faces)
    return np.array([[face.dxf.vtx0, face.dxf.vtx1, face.dxf.vtx2] for face in faces])


def by_qgis(path: Path) -> FloatArray:
    return _in_qgis(path.parent)[path.name]


READERS: dict[str, dict[str, Callable[[Path], FloatArray]]] = {
    "2dm": {"QGIS": by_qgis},
    "dxf": {"ezdxf": by_ezdxf, "GDAL": by_gdal, "QGIS": by_qgis},
    "geojson": {"GDAL": by_gdal, "QGIS": by_qgis},
    "glb": {"trimesh": by_trimesh},
    "gpkg": {"GDAL": by_gdal, "QGIS": by_qgis},
    "obj": {"trimesh": by_trimesh, "MeshLab": by_meshlab, "meshio": by_meshio},
    "off": {"trimesh": by_trimesh, "MeshLab": by_meshlab, "meshio": by_meshio},
    "ply": {"trimesh": by_trimesh, "MeshLab": by_meshlab, "meshio": by_meshio, "QGIS": by_qgis},
    "stl": {"trimesh": by_trimesh, "MeshLab": by_meshlab, "meshio": by_meshio},
    "vtk": {"VTK": by_vtk, "meshio": by_meshio},
    "vtu": {"VTK": by_vtk, "meshio": by_meshio},
}


def holds(name: str, case: str) -> bool:
    """Tell whether a format holds a model: not a closed one where each place has one height."""
    return not (FORMATS[name].one_height and case == "blob")


# LandXML has no reader but survey programs: test_landxml.py looks at its text.
OPENED = [(name, reader) for name, readers in READERS.items() for reader in readers]


def _rings(geometries: list[bytes]) -> FloatArray:
    """Return the corners of polygons of one ring of three corners with heights, in well-known binary."""
    assert {len(geometry) for geometry in geometries} == {13 + 4 * 3 * 8}
    assert {geometry[5:13] for geometry in geometries} == {b"\1\0\0\0\4\0\0\0"}
    rings = np.array([np.frombuffer(geometry, "<f8", 12, 13).reshape(4, 3) for geometry in geometries])
    np.testing.assert_array_equal(rings[:, 3], rings[:, 0])
    return rings[:, :3]


@cache
def _in_qgis(folder: Path) -> dict[str, FloatArray]:
    """Return what QGIS finds in the files of a folder that it reads, opened in one process."""
    ways = {".2dm": "mesh", ".ply": "mesh", ".dxf": "features", ".geojson": "features", ".gpkg": "features"}
    layers = {path.name: ways[path.suffix] for path in sorted(folder.iterdir()) if path.suffix in ways}
    found = qgis.opened(*((way, folder / name) for name, way in layers.items()))
    corners = {}
    for name, way in layers.items():
        layer = found[str(folder / name)]
        # neither a node nor a drawing says in which system it is
        case = name.partition(".")[0]
        assert layer["crs"] == ("" if name.endswith((".2dm", ".dxf")) else SYSTEMS[case]), name
        points = np.array(layer["points"])
        if way == "mesh":
            assert "Bed Elevation" in layer["groups"]
            corners[name] = points[np.array(layer["faces"])]
        else:
            assert {*layer["sorts"]} == {"PolygonZ"}
            np.testing.assert_array_equal(points[:, 3], points[:, 0])
            corners[name] = points[:, :3]
    return corners


# --------------------------------------------------------------------------------------------------------- the tests


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of all models in all formats that hold them."""
    folder = tmp_path_factory.mktemp("files")
    for case in CASES:
        vertices, faces, facts = written(case)
        for kind in FORMATS.values():
            if holds(kind.name, case):
                if kind.needs:
                    pytest.importorskip(kind.needs)
                write_mesh(folder / f"{case}{kind.suffix}", vertices, faces, georeference=facts)
    return folder


@pytest.mark.parametrize(
    ("name", "reader", "case"), [(*opened, case) for opened in OPENED for case in CASES if holds(opened[0], case)]
)
def test_every_reader_finds_the_same_triangles(files, record_property, name, reader, case):
    vertices, faces, facts = written(case)
    found = READERS[name][reader](files / f"{case}{FORMATS[name].suffix}")
    if name == "glb":
        found = _in_the_file(found, facts)
    expected = vertices[faces]
    assert found.shape == expected.shape
    off = float(np.abs((found - expected) * [*facts.get("scale", (1.0, 1.0)), 1.0]).max())
    record_property("off", off)
    said = stated()[name, reader][CASES.index(case)]
    assert off <= said
    assert said == 0.0 or off > said / 2  # and the table does not say more than there is


def _in_the_file(found: FloatArray, facts: dict[str, Any]) -> FloatArray:
    """Return corners of a GLB, which is Y up and in metres, along the axes of the model's file and in its units."""
    return found[..., [0, 2, 1]] * [1.0, -1.0, 1.0] / [*facts.get("scale", (1.0, 1.0)), 1.0]


@cache
def stated() -> dict[tuple[str, str], tuple[float, ...]]:
    """Return how far coordinates are off, as the page says, by format and reader; infinite where there is a dash."""
    rows = re.findall(r"^\| `(\w+)` \| (\w+) [^|]*\|(.*)\|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return {
        (name, reader): tuple(float(cell) if cell.strip() != "–" else np.inf for cell in cells.split("|"))
        for name, reader, cells in rows
    }


def test_the_page_names_all_readers_and_every_format_has_one():
    assert [*stated()] == OPENED
    assert {*READERS} == {*FORMATS} - {"landxml"}
    for (name, _), cells in stated().items():
        assert [cell == np.inf for cell in cells] == [not holds(name, case) for case in CASES]
