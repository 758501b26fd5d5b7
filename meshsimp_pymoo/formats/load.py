"""What a file holds: vertices, triangles and per-vertex attributes, checked before anything trusts them.

PLY, OBJ and OFF are read here, because they carry rows that users refer to (landmarks by file index), double
precision and colours, and because texture seams must not tear the surface; every other mesh format is read by
trimesh. Height grids (.npy, .npz, ESRI ASCII .asc, GeoTIFF) become two triangles per cell, point clouds (XYZ, LAS, LAZ)
their Delaunay triangulation in the plane; GeoTIFF and clouds are read next door, in `raster` and `cloud`.

Each way in ends in :func:`build_source`, so a :class:`SourceMesh` always has finite vertices and faces that
exist.
"""

from __future__ import annotations

import json
import logging
import os
import re
import struct
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from numba import njit

from meshsimp_pymoo.errors import ModelError, reason_of, warn_of
from meshsimp_pymoo.files import read_npy, read_npz

if TYPE_CHECKING:
    import trimesh

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# trimesh logs what it cannot parse; without a handler Python would print that to stderr. Users' own handlers
# still get it.
logging.getLogger("trimesh").addHandler(logging.NullHandler())

# Grids are dispatched here; of the mesh formats, these three are read here and the rest by trimesh.
RASTER_SUFFIXES = (".tif", ".tiff")
GRID_SUFFIXES = (".asc", ".npy", ".npz", *RASTER_SUFFIXES)
OWN_SUFFIXES = (".obj", ".off", ".ply")
# Points without faces, which are triangulated in the plane.
TEXT_CLOUD_SUFFIXES = (".xyz", ".pts", ".txt", ".csv")
CLOUD_SUFFIXES = (*TEXT_CLOUD_SUFFIXES, ".las", ".laz")

# Mesh formats that are archives, and point clouds that trimesh would read with further libraries: neither is read.
ARCHIVE_SUFFIXES = (".3mf", ".3dxml", ".zae", ".cbor", ".pcd")

# Values that programs write where a grid has no sample; and from this size on a height is none.
NODATA_HABITS = (-9999.0, 9999.0, -99999.0, -999.0, -32768.0, -32767.0, 32767.0, 65535.0)
NODATA_SIZE = 1e30

# A PLY header lists properties, one line each; a real one takes a few hundred bytes, scanners' comments a few
# thousand.
HEADER_LIMIT = 1 << 20

# Areas and in-circle tests multiply up to four coordinates; beyond 1e75 those products overflow.
COORDINATE_LIMIT = 1e75

PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "double": "f8", "float32": "f4", "float64": "f8",
}  # fmt: skip
PLY_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
COLOR_NAMES = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
)


# The part of a grid to take: column, row, columns, rows.
Window = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class SourceMesh:
    """A triangle mesh as its file has it: nothing turned, shifted or reordered.

    Parameters
    ----------
    points : (V, 3) float64 array
        Vertices in the file's own frame and units.
    faces : (F, 3) int64 array
        Rows of `points`; three different ones each.
    attributes : dict of arrays, each with V rows
        Per-vertex data under the file's names; ``"color"`` is (V, 4) uint8, red green blue alpha.
    name : str
        What messages call it: the path, or a built-in's name.
    rows : (V,) int64 array, optional
        Row of each vertex in the file (of a grid: ``row * columns + column``); default 0, 1, 2, ...
    up : str or (float, float, float), optional
        What ``up="auto"`` stands for: ``"z"`` for grids, whose heights are known to be heights, and the
        viewing direction for a patch cut out along it. None: to be found out.
    georeference : dict
        Where on Earth it is and how it was read, as far as the file says: ``crs`` (WKT), ``epsg``, ``transform``,
        ``window`` ...; plain data for run.json.
    """

    points: FloatArray
    faces: IntArray
    attributes: dict[str, npt.NDArray[Any]]
    name: str
    rows: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    up: str | tuple[float, float, float] | None = None
    georeference: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.rows) != len(self.points):
            if len(self.rows):
                raise ValueError(f"rows has {len(self.rows)} entries for {len(self.points)} points")
            object.__setattr__(self, "rows", np.arange(len(self.points)))


def read_source(
    path: str | os.PathLike[str],
    *,
    spacing: float | tuple[float, float] | None = None,
    nodata: float | None = None,
    window: Window | None = None,
    max_edge: float | None = None,
) -> SourceMesh:
    """Read a mesh, a height grid or a point cloud; the suffix tells which.

    Parameters
    ----------
    path : str or path-like
        .ply .obj .off, any other mesh format trimesh reads (.stl .glb ...), a grid .npy .npz .asc .tif, or a cloud
        .xyz .pts .txt .csv .las .laz. A scene
        of several meshes is read as one. Polygons are cut into triangle fans. STL and glTF repeat a vertex
        for every face or texture seam: there, vertices at exactly one position are merged (the first one's
        row and attributes stay). A .npz holds its heights under ``elevation`` (or as its only 2-D array),
        optionally ``dx`` and ``dy``.
    spacing : float or (dx, dy), optional
        Distance between grid columns and rows; default: what the file says, else 1. Grids only.
    nodata : float, optional
        Height that marks missing samples, beside NaN; default: what an .asc or .tif says, else none. Grids only.
    window : (column, row, columns, rows), optional
        The part of a grid to take, from 0, as ``gdal_translate -srcwin`` has it. Grids only.
    max_edge : float, optional
        Longest edge in the plane of a triangle of a cloud [file units]; see
        :func:`~meshsimp_pymoo.formats.cloud.cloud_source`. Clouds only.

    Returns
    -------
    SourceMesh

    Raises
    ------
    ModelError
        One line with the file, the cause and the way out. Counts that a header declares are compared with the
        size of the file before anything is allocated.

    Warns
    -----
    ModelWarning
        If faces that name a vertex twice were dropped, per-vertex data could not be kept, a usual "no data"
        value stands among the heights of a grid, or points of a cloud share their place in the plane.
    """
    path = Path(path)
    name = str(path)
    suffix = path.suffix.lower()
    _check_file(path, name)
    is_grid, is_cloud = suffix in GRID_SUFFIXES, suffix in CLOUD_SUFFIXES
    if not is_grid and not is_cloud and suffix not in (known := _known_mesh_suffixes()):
        raise ModelError(
            f"{name}: unknown suffix {suffix!r}; known are {' '.join(known)} for meshes, "
            f"{' '.join(GRID_SUFFIXES)} for height grids and {' '.join(CLOUD_SUFFIXES)} for point clouds"
        )
    if not is_grid and not (spacing is None and nodata is None and window is None):
        raise ModelError(
            f"{name}: spacing, nodata and window describe height grids ({' '.join(GRID_SUFFIXES)}); leave them out"
        )
    if not is_cloud and max_edge is not None:
        raise ModelError(
            f"{name}: max_edge is for point clouds ({' '.join(CLOUD_SUFFIXES)}), which have no faces of their own; "
            "leave it out"
        )
    if is_grid:
        return _guarded(_read_grid, path, name, suffix, spacing, nodata, window)
    if is_cloud:
        from meshsimp_pymoo.formats.cloud import read_cloud

        return _guarded(read_cloud, path, name, suffix, max_edge)
    readers = {".ply": _read_ply, ".obj": _read_obj, ".off": _read_off}
    return _guarded(readers.get(suffix, _read_with_trimesh), path, name)


def from_trimesh(mesh: trimesh.Trimesh, name: str = "mesh") -> SourceMesh:
    """Take over a ``trimesh.Trimesh``: its vertices in their order, its vertex colours and vertex attributes.

    Texture coordinates, face attributes and normals stay behind.

    Raises
    ------
    ModelError
        As :func:`build_source`.
    """
    points, faces, attributes = _trimesh_arrays(mesh)
    return build_source(points, faces, attributes, name)


def grid_source(
    elevation: npt.ArrayLike,
    dx: float = 1.0,
    dy: float = 1.0,
    *,
    nodata: float | None = None,
    name: str = "grid",
    origin: tuple[float, float] = (0.0, 0.0),
    window: Window | None = None,
) -> SourceMesh:
    """Turn a height grid into a triangle mesh, two counter-clockwise triangles per cell.

    Row 0 is the northernmost, as in ESRI grids and GeoTIFF: sample (row, col) lies at ``x = origin[0] + col *
    dx`` (east), ``y = origin[1] - row * dy`` (north is +y), ``z = elevation[row, col]``. A cell is cut from
    its north-west to its south-east corner; where just one of the four corners has no data, the other three
    make one triangle.

    Parameters
    ----------
    elevation : (rows, columns) array of a real type
        Heights; NaN (or masked) where there is no data.
    dx, dy : float
        Distance between columns and between rows, > 0.
    nodata : float, optional
        Height that also marks missing samples.
    name : str
        What messages call it.
    origin : (float, float)
        Position of sample (0, 0).
    window : (column, row, columns, rows), optional
        The part to take; positions and ``rows`` stay those of the whole grid.

    Returns
    -------
    SourceMesh
        Samples without data are no vertices; ``rows`` holds ``row * columns + col`` of the others.

    Raises
    ------
    ModelError
        For anything but a grid of at least 2 x 2 finite heights with a positive spacing.

    Examples
    --------
    A full cell is two triangles, one that lacks a corner is one:

    >>> grid_source([[0.0, 1.0, 4.0], [2.0, 3.0, float("nan")]]).faces.tolist()
    [[0, 3, 4], [0, 4, 1], [1, 4, 2]]
    """
    if isinstance(elevation, np.ma.MaskedArray):
        hidden = np.ma.getmaskarray(elevation)
        height = np.asarray(elevation.data)
    else:
        height = np.asarray(elevation)
        hidden = np.zeros(height.shape, bool)
    if height.dtype.kind not in "iuf":
        raise ModelError(f"{name}: heights have the type {height.dtype}; give real numbers")
    if height.ndim != 2 or min(height.shape) < 2:
        raise ModelError(f"{name}: heights have the shape {height.shape}; give a grid of at least 2 x 2")
    for label, step in (("dx", dx), ("dy", dy)):
        if not (np.isfinite(step) and step > 0):
            raise ModelError(f"{name}: the spacing {label} is {step}; give a positive number")
    column, row, columns, rows = check_window(window, height.shape, name)
    part = np.s_[row : row + rows, column : column + columns]
    return grid_mesh(
        height[part],
        hidden[part],
        lambda i, j: (origin[0] + j * dx, origin[1] - i * dy),
        nodata=nodata,
        name=name,
        corner=(row, column),
        file_columns=height.shape[1],
    )


def check_window(window: Window | None, shape: tuple[int, int], name: str) -> tuple[int, int, int, int]:
    """Return (column, row, columns, rows) of the part of a grid of this shape to take; None: all of it."""
    if window is None:
        return 0, 0, shape[1], shape[0]
    column, row, columns, rows = (int(value) for value in window)
    if min(column, row) < 0 or min(columns, rows) < 2 or column + columns > shape[1] or row + rows > shape[0]:
        raise ModelError(
            f"{name}: the window {column},{row},{columns},{rows} (column, row, columns, rows) does not lie within its "
            f"{shape[1]} columns and {shape[0]} rows, or is smaller than 2 x 2"
        )
    return column, row, columns, rows


def grid_mesh(
    height: npt.NDArray[Any],
    hidden: npt.NDArray[np.bool_],
    place: Callable[[Any, Any], tuple[Any, Any]],
    *,
    nodata: float | None,
    name: str,
    corner: tuple[int, int],
    file_columns: int,
    mirrored: bool = False,
    georeference: dict[str, Any] | None = None,
) -> SourceMesh:
    """Turn a checked part of a height grid into a triangle mesh; see :func:`grid_source`.

    Parameters
    ----------
    height : (rows, columns) real array
        The part's heights.
    hidden : (rows, columns) bool array
        Samples known to be missing, beside NaN and ``nodata``.
    place : callable
        Position (x, y) of the samples in these rows and columns of the whole grid.
    nodata, name
        As there.
    corner : (int, int)
        Row and column of the part in the whole grid.
    file_columns : int
        Columns of the whole grid.
    mirrored : bool
        Rows run north, or columns west: then triangles are listed the other way round.
    georeference : dict, optional
        See :class:`SourceMesh`.
    """
    if nodata is not None:
        # in the grid's own precision: -3.4028235e38 must match its float32 neighbour
        with np.errstate(over="ignore", invalid="ignore"):
            hidden = hidden | (height == (height.dtype.type(nodata) if height.dtype.kind == "f" else nodata))
    hidden = hidden | np.isnan(height)
    with np.errstate(invalid="ignore"):  # some kinds of NaN complain
        z = height.astype(np.float64)
    if (infinite := np.isinf(z) & ~hidden).any():
        row, col = np.argwhere(infinite)[0]
        raise ModelError(
            f"{name}: {infinite.sum()} of {z.size} heights are infinite (first: row {corner[0] + row}, column "
            f"{corner[1] + col}); set them to NaN or name the value with nodata"
        )
    _warn_of_nodata(z[~hidden], name)
    rows = np.flatnonzero(~hidden)
    vertex = np.full(z.shape, -1, np.int64)
    vertex.flat[rows] = np.arange(len(rows))
    nw, ne, sw, se = vertex[:-1, :-1], vertex[:-1, 1:], vertex[1:, :-1], vertex[1:, 1:]
    triangles = np.empty((*nw.shape, 2, 3), np.int64)
    triangles[:, :, 0] = np.stack([nw, sw, se], axis=-1)
    triangles[:, :, 1] = np.stack([nw, se, ne], axis=-1)
    triangles[:, :, 0][nw < 0] = np.stack([sw, se, ne], axis=-1)[nw < 0]
    triangles[:, :, 1][se < 0] = np.stack([nw, sw, ne], axis=-1)[se < 0]
    faces = triangles.reshape(-1, 3)
    faces = faces[(faces >= 0).all(axis=1)]
    if mirrored:
        faces = faces[:, ::-1]
    i, j = (start + at for start, at in zip(corner, np.divmod(rows, z.shape[1]), strict=True))
    east, north = place(i, j)
    points = np.column_stack([east, north, z.flat[rows]])
    if len(faces) == 0:
        raise ModelError(
            f"{name}: only {len(rows)} of {z.size} samples have data and no cell has three; check nodata ({nodata})"
        )
    return build_source(points, faces, {}, name, rows=i * file_columns + j, up="z", georeference=georeference)


def _warn_of_nodata(z: FloatArray, name: str) -> None:
    """Warn of a usual "no data" value among the heights (S,) that is farther from all others than these are apart."""
    for value in (float(z.min(initial=np.inf)), float(z.max(initial=-np.inf))):
        if value not in NODATA_HABITS and not NODATA_SIZE <= abs(value) < np.inf:
            continue
        others = z[z != value]
        if not len(others):
            continue
        low, high = float(others.min()), float(others.max())
        if max(low - value, value - high) > high - low:
            warn_of(
                f"{name}: {len(z) - len(others)} of {len(z)} heights are {value:.9g}, far from all others ({low:g} to "
                f"{high:g}); if that means 'no sample', say nodata={value:.9g} (--nodata={value:.9g})"
            )


def build_source(
    points: npt.ArrayLike,
    faces: npt.ArrayLike,
    attributes: Mapping[str, npt.ArrayLike] | None = None,
    name: str = "mesh",
    *,
    rows: IntArray | None = None,
    up: str | tuple[float, float, float] | None = None,
    georeference: dict[str, Any] | None = None,
) -> SourceMesh:
    """Check arrays and make a :class:`SourceMesh` of them, whose fields the parameters are.

    Raises
    ------
    ModelError
        For fewer than 4 vertices, coordinates that are NaN, infinite or beyond 1e75, no faces, faces that
        index past the end, and arrays of another shape.

    Warns
    -----
    ModelWarning
        If faces that name a vertex twice were dropped; they have no area.
    """
    xyz = check_points(points, name, rows)
    count = len(xyz)
    rows = np.arange(count) if rows is None else np.asarray(rows, dtype=np.int64)
    triangles = np.asarray(faces)
    if triangles.size == 0:
        raise ModelError(
            f"{name}: has {count} vertices but no faces; triangulate the points first, or save them as .xyz"
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise ModelError(f"{name}: faces are {triangles.dtype} of the shape {triangles.shape}; give integers (F, 3)")
    wrong = ((triangles < 0) | (triangles >= count)).any(axis=1)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise ModelError(
            f"{name}: {wrong.sum()} of {len(triangles)} faces name vertices that do not exist (first: face "
            f"{first}, "
            f"{tuple(triangles[first].tolist())}, of {count} vertices); the file is damaged, export it again"
        )
    triangles = triangles.astype(np.int64)
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    if flat.all():
        raise ModelError(
            f"{name}: all {len(triangles)} faces name a vertex twice; the file is damaged, export it again"
        )
    if flat.any():
        warn_of(f"{name}: {flat.sum()} of {len(triangles)} faces name a vertex twice and were dropped")
        triangles = triangles[~flat]
    kept_attributes = {}
    for key, values in (attributes or {}).items():
        array = np.array(values)
        if array.ndim == 0 or len(array) != count:
            raise ModelError(f"{name}: the attribute {key!r} has the shape {array.shape}; give {count} rows")
        kept_attributes[key] = array
    return SourceMesh(xyz, triangles, kept_attributes, name, rows, up, dict(georeference or {}))


def check_points(points: npt.ArrayLike, name: str, rows: IntArray | None = None) -> FloatArray:
    """Return vertices (V, 3) as an array of their own, or raise what :func:`build_source` says of them."""
    xyz = np.array(points, dtype=np.float64)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise ModelError(f"{name}: vertices have the shape {xyz.shape}; give (V, 3)")
    count = len(xyz)
    if count < 4:
        raise ModelError(f"{name}: has {count} vertices; at least 4 are needed")
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        where = ", ".join(f"{value:g}" for value in xyz[first])
        raise ModelError(
            f"{name}: {count - finite.sum()} of {count} vertices have NaN or infinite coordinates (first: "
            f"vertex {first if rows is None else rows[first]} at {where}); delete them in a mesh editor"
        )
    if np.abs(xyz).max() > COORDINATE_LIMIT:
        raise ModelError(
            f"{name}: coordinates reach {np.abs(xyz).max():g}; rescale the model to below {COORDINATE_LIMIT:g}"
        )
    return xyz


# ------------------------------------------------------------ files and messages


def _check_file(path: Path, name: str) -> None:
    try:
        if path.is_dir():
            raise ModelError(f"{name}: is a folder; name the mesh file in it")
        if not path.exists():
            raise ModelError(f"{name}: no such file; check the path")
        if not path.is_file():
            raise ModelError(f"{name}: is not a regular file; save the model to one")
        if path.stat().st_size == 0:
            raise ModelError(f"{name}: is empty (0 bytes); export it again")
    except ModelError:
        raise
    except (OSError, ValueError) as error:
        raise ModelError(f"{name}: cannot be read ({reason_of(error)}); check the path and its permissions") from error


def _guarded(reader: Any, path: Path, name: str, *args: Any) -> SourceMesh:
    """Call a reader; whatever it meets in the file comes out as one line."""
    try:
        # numbers that overflow become infinite, and are refused with their row
        with np.errstate(over="ignore", invalid="ignore"):
            return reader(path, name, *args)
    except ModelError:
        raise
    except OSError as error:
        raise ModelError(f"{name}: cannot be read ({reason_of(error)}); check the path and its permissions") from error
    except MemoryError as error:
        raise ModelError(f"{name}: does not fit into memory; cut it into tiles first") from error


def _known_mesh_suffixes() -> list[str]:
    from trimesh.exchange.load import mesh_formats

    found = {f".{kind}" for kind in mesh_formats() if kind.isalnum()}
    return sorted((found - set(CLOUD_SUFFIXES) - set(ARCHIVE_SUFFIXES)) | set(OWN_SUFFIXES))


def parse_numbers(text: str, name: str) -> FloatArray:
    """Parse white-space separated numbers; NaN and infinity are numbers, anything else names its place."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # older NumPy only warns about text it cannot read
        try:
            return np.fromstring(text, sep=" ")
        except (ValueError, DeprecationWarning):
            pass
    for token in text.split():
        try:
            float(token)
        except ValueError:
            raise ModelError(f"{name}: {token[:40]!r} stands where a number should; the file is damaged") from None
    return np.array(text.split(), dtype=np.float64)  # spellings that only Python knows, such as 1_000


def _whole(values: FloatArray, name: str, what: str) -> IntArray:
    """Check that numbers read from text are whole and small enough to be exact."""
    good = (np.abs(values) < 2.0**53) & (np.floor(values) == values)
    if not good.all():
        raise ModelError(f"{name}: {what} {values[np.argmin(good)]:g} is not a whole number; the file is damaged")
    return values.astype(np.int64)


def _fans(corners: IntArray, counts: IntArray) -> IntArray:
    """Cut polygons, listed one after the other with `counts` corners each, into triangle fans."""
    starts = np.cumsum(counts) - counts
    fan = np.maximum(counts - 2, 0)
    first = np.repeat(starts, fan)
    step = np.arange(fan.sum()) - np.repeat(np.cumsum(fan) - fan, fan)
    return np.column_stack([corners[first], corners[first + step + 1], corners[first + step + 2]])


def rgba_of(channels: list[npt.NDArray[Any]]) -> npt.NDArray[np.uint8] | None:
    """Make (V, 4) uint8 of 3 or 4 columns: bytes, or fractions of 1; None for anything else."""
    if all(channel.dtype == np.uint8 for channel in channels):
        columns = [channel.astype(np.uint8) for channel in channels]
    else:
        values = np.column_stack(channels).astype(np.float64)
        if values.size == 0 or not np.isfinite(values).all() or values.min() < 0:
            return None
        whole = bool((np.floor(values) == values).all())
        if values.max() > (255 if whole else 1):
            return None
        # text formats write either 0..255 or 0..1; whole numbers up to 1 are ambiguous and read as fractions
        scaled = values if values.max() > 1 else values * 255
        columns = list(np.round(scaled).astype(np.uint8).T)
    if len(columns) == 3:
        columns.append(np.full(len(columns[0]), 255, np.uint8))
    return np.column_stack(columns)


# ---------------------------------------------------------------------------------------------- PLY


@dataclass(frozen=True)
class _PlyProperty:
    name: str
    dtype: np.dtype[Any]
    count_dtype: np.dtype[Any] | None  # of the number that starts a list; None for a single value


@dataclass(frozen=True)
class _PlyElement:
    name: str
    count: int
    properties: list[_PlyProperty]


@dataclass(frozen=True)
class _Ragged:
    """A list property whose lists differ in length: all values in a row, and the length of each list."""

    values: npt.NDArray[Any]
    counts: IntArray


def _read_ply(path: Path, name: str) -> SourceMesh:
    data = path.read_bytes()
    elements, order, start = _ply_header(data, name)
    named = {element.name: element for element in elements}
    if "vertex" not in named:
        raise ModelError(f"{name}: declares no element 'vertex' (but {sorted(named)}); export it as a triangle mesh")
    last = max(i for i, element in enumerate(elements) if element.name in ("vertex", "face"))
    columns = (_ply_ascii if order == "" else _ply_binary)(data, start, elements[: last + 1], name)
    vertex = columns["vertex"]
    scalars = {key for key, value in vertex.items() if isinstance(value, np.ndarray) and value.ndim == 1}
    if missing := sorted(set("xyz") - scalars):
        raise ModelError(f"{name}: its vertices have no {', '.join(missing)} (but {sorted(vertex)}); export it again")
    points = np.column_stack([vertex[axis].astype(np.float64) for axis in "xyz"])
    faces = _ply_faces(columns.get("face", {}), name)
    return build_source(points, faces, _ply_attributes(vertex, name), name)


def _ply_header(data: bytes, name: str) -> tuple[list[_PlyElement], str, int]:
    """Return the elements, the byte order ("" for ascii) and where the body starts."""
    if re.match(rb"ply[ \t]*\r?\n|ply[ \t]*\r", data) is None:
        raise ModelError(
            f"{name}: is not a PLY file (it begins with {_glimpse(data)}, not with 'ply'); check the suffix"
        )
    # a file with Unix lines has one byte after end_header, and the next may well look like a line feed
    newline = rb"\r\n" if b"\r\n" in data[:8] else rb"[\r\n]"
    end = re.compile(rb"(?<=[\r\n])end_header[ \t]*(?:" + newline + rb"|\Z)").search(data, 0, HEADER_LIMIT)
    if end is None:
        raise ModelError(f"{name}: its header has no line 'end_header'; the file is truncated, export it again")
    order: str | None = None
    elements: list[_PlyElement] = []
    for line in data[: end.start()].decode("utf-8", errors="replace").splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                order = PLY_FORMATS[words[1]]
            elif words[0] == "element":
                elements.append(_PlyElement(words[1], int(words[2]), []))
                if elements[-1].count < 0:
                    raise ValueError
            elif words[0] == "property" and words[1] == "list":
                kinds = [np.dtype((order or "<") + PLY_TYPES[word]) for word in words[2:4]]
                if kinds[0].kind == "f":
                    raise ValueError
                elements[-1].properties.append(_PlyProperty(words[4], kinds[1], kinds[0]))
            elif words[0] == "property":
                kind = np.dtype((order or "<") + PLY_TYPES[words[1]])
                elements[-1].properties.append(_PlyProperty(words[2], kind, None))
            else:
                raise ValueError
        except (KeyError, IndexError, ValueError):
            raise ModelError(f"{name}: cannot read the header line {line[:80]!r}; export the file again") from None
    if order is None:
        raise ModelError(f"{name}: its header has no line 'format'; export the file again")
    if len({element.name for element in elements}) < len(elements):
        raise ModelError(f"{name}: declares an element twice; export the file again")
    for element in elements:
        names = [item.name for item in element.properties]
        if len(set(names)) < len(names):
            raise ModelError(f"{name}: declares a property of {element.name!r} twice; export the file again")
        if not names and element.count:
            raise ModelError(
                f"{name}: declares {element.count} of {element.name!r} without properties; export it again"
            )
    _check_ply_size(elements, order, len(data) - end.end(), name)
    return elements, order, end.end()


def _check_ply_size(elements: list[_PlyElement], order: str, size: int, name: str) -> None:
    """Refuse a body smaller than what its header must at least take, before anything is allocated."""
    needed = 0
    for element in elements:
        if order == "":  # a digit and a separator per number; the last one may end the file
            row = 2 * len(element.properties)
        else:
            row = sum((item.count_dtype or item.dtype).itemsize for item in element.properties)
        needed += element.count * row
    if size < needed - (order == ""):
        counts = ", ".join(f"{element.count} of {element.name!r}" for element in elements)
        raise ModelError(
            f"{name}: truncated: its header declares {counts}, at least {needed} bytes, but {size} follow; "
            f"copy or export the file again"
        )


def _glimpse(data: bytes) -> str:
    text = data[:24].decode("ascii", errors="replace").split("\n")[0]
    return repr(text.replace("\ufffd", "?"))


def _truncated(name: str, element: _PlyElement, size: int, unit: str) -> ModelError:
    return ModelError(
        f"{name}: truncated: the {element.count} rows of {element.name!r} end after the file's last {unit} "
        f"({size} "
        f"after the header); copy or export the file again"
    )


def _ply_binary(data: bytes, start: int, elements: list[_PlyElement], name: str) -> dict[str, dict[str, Any]]:
    body = np.frombuffer(data, np.uint8, offset=start)
    at = 0
    result = {}
    for element in elements:
        lengths = _first_lengths(body, at, element)
        row = np.dtype(_row_fields(element, lengths))
        columns: dict[str, Any] = {}
        if at + element.count * row.itemsize <= len(body):
            table = np.frombuffer(body, row, count=element.count, offset=at)
            if all((table[f"#{key}"] == length).all() for key, length in lengths.items()):
                for item in element.properties:
                    columns[item.name] = table[item.name].astype(item.dtype.newbyteorder("="))
                result[element.name] = columns
                at += element.count * row.itemsize
                continue
        if not lengths:
            raise _truncated(name, element, len(body), "bytes")
        columns, at = _scan_binary_element(body, at, element, name)
        result[element.name] = columns
    return result


def _first_lengths(body: npt.NDArray[np.uint8], at: int, element: _PlyElement) -> dict[str, int]:
    """Return the length of each list in the element's first row (0 where the file has ended)."""
    lengths = {}
    for item in element.properties:
        if item.count_dtype is None:
            at += item.dtype.itemsize
            continue
        raw = body[at : at + item.count_dtype.itemsize].tobytes()
        enough = element.count > 0 and len(raw) == item.count_dtype.itemsize
        length = int(np.frombuffer(raw, item.count_dtype)[0]) if enough else 0
        lengths[item.name] = length if 0 <= length < 1 << 16 else 0  # else scanned row by row
        at += item.count_dtype.itemsize + lengths[item.name] * item.dtype.itemsize
    return lengths


def _row_fields(element: _PlyElement, lengths: dict[str, int]) -> list[Any]:
    fields: list[Any] = []
    for item in element.properties:
        if item.count_dtype is None:
            fields.append((item.name, item.dtype))
        else:
            fields.append((f"#{item.name}", item.count_dtype))
            fields.append((item.name, item.dtype, (lengths[item.name],)))
    return fields


def _scan_binary_element(
    body: npt.NDArray[np.uint8], at: int, element: _PlyElement, name: str
) -> tuple[dict[str, Any], int]:
    """Read an element whose lists differ in length from row to row."""
    items = element.properties
    count_sizes = np.array([0 if item.count_dtype is None else item.count_dtype.itemsize for item in items])
    item_sizes = np.array([item.dtype.itemsize for item in items])
    big = any((item.count_dtype or item.dtype).str[0] == ">" for item in items)
    starts, counts, end = _scan_bytes(body, at, element.count, count_sizes, item_sizes, big)
    if end < 0:
        raise _truncated(name, element, len(body), "bytes")
    columns: dict[str, Any] = {}
    for k, item in enumerate(element.properties):
        sizes = counts[:, k] * item.dtype.itemsize
        first = np.cumsum(sizes) - sizes
        index = np.arange(sizes.sum()) + np.repeat(starts[:, k] - first, sizes)
        values = body[index].view(item.dtype).astype(item.dtype.newbyteorder("="))
        columns[item.name] = values if item.count_dtype is None else _even(values, counts[:, k])
    return columns, int(end)


@njit(cache=True)
def _scan_bytes(
    body: np.ndarray, at: int, n_rows: int, count_sizes: np.ndarray, item_sizes: np.ndarray, big: bool
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return where each property of each row starts, its number of values, and the end (-1: too short)."""
    n = len(count_sizes)
    starts = np.zeros((n_rows, n), np.int64)
    counts = np.zeros((n_rows, n), np.int64)
    for row in range(n_rows):
        for k in range(n):
            count = 1
            if count_sizes[k] > 0:
                if at + count_sizes[k] > len(body):
                    return starts, counts, -1
                count = 0
                for b in range(count_sizes[k]):
                    place = b if big else count_sizes[k] - 1 - b
                    count = (count << 8) | np.int64(body[at + place])
                at += count_sizes[k]
            if count < 0 or count > len(body) or at + count * item_sizes[k] > len(body):
                return starts, counts, -1
            starts[row, k] = at
            counts[row, k] = count
            at += count * item_sizes[k]
    return starts, counts, at


def _even(values: npt.NDArray[Any], counts: IntArray) -> npt.NDArray[Any] | _Ragged:
    if len(counts) and (counts == counts[0]).all():
        return values.reshape(len(counts), int(counts[0]))
    return _Ragged(values, counts)


def _ply_ascii(data: bytes, start: int, elements: list[_PlyElement], name: str) -> dict[str, dict[str, Any]]:
    numbers = parse_numbers(data[start:].decode("ascii", errors="replace"), name)
    at = 0
    result = {}
    for element in elements:
        is_list = np.array([item.count_dtype is not None for item in element.properties], dtype=np.bool_)
        starts, counts, end = _scan_numbers(numbers, at, element.count, is_list)
        if end < 0:
            raise _truncated(name, element, len(numbers), "numbers")
        at = int(end)
        columns: dict[str, Any] = {}
        for k, item in enumerate(element.properties):
            first = np.cumsum(counts[:, k]) - counts[:, k]
            index = np.arange(counts[:, k].sum()) + np.repeat(starts[:, k] - first, counts[:, k])
            values = _as_declared(numbers[index], item, name)
            columns[item.name] = _even(values, counts[:, k]) if is_list[k] else values
        result[element.name] = columns
    return result


def _as_declared(values: FloatArray, item: _PlyProperty, name: str) -> npt.NDArray[Any]:
    dtype = item.dtype.newbyteorder("=")
    if dtype.kind != "f":
        whole = _whole(values, name, f"the property {item.name!r} with the value")
        limits = np.iinfo(dtype)
        if len(whole) and (whole.min() < limits.min or whole.max() > limits.max):
            raise ModelError(
                f"{name}: the property {item.name!r} leaves the range of its type {dtype}; export it again"
            )
        return whole.astype(dtype)
    with np.errstate(over="ignore"):  # becomes infinite, which build_source reports with its row
        return values.astype(dtype)


@njit(cache=True)
def _scan_numbers(numbers: np.ndarray, at: int, n_rows: int, is_list: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return where each property of each row starts, its number of values, and the end (-1: too short)."""
    n = len(is_list)
    starts = np.zeros((n_rows, n), np.int64)
    counts = np.ones((n_rows, n), np.int64)
    for row in range(n_rows):
        for k in range(n):
            if is_list[k]:
                if at >= len(numbers) or not 0 <= numbers[at] <= len(numbers):
                    return starts, counts, -1
                counts[row, k] = np.int64(numbers[at])
                at += 1
            starts[row, k] = at
            at += counts[row, k]
            if at > len(numbers):
                return starts, counts, -1
    return starts, counts, at


def _ply_faces(columns: dict[str, Any], name: str) -> IntArray:
    lists = [key for key, value in columns.items() if isinstance(value, _Ragged) or value.ndim == 2]
    usual = [key for key in lists if key in ("vertex_indices", "vertex_index")]
    key = (usual or (lists if len(lists) == 1 else [""]))[0]
    if not key:
        if columns and len(next(iter(columns.values()), ())) and not lists:
            raise ModelError(f"{name}: its faces have no list of vertices (but {sorted(columns)}); export it again")
        if len(lists) > 1:
            raise ModelError(
                f"{name}: none of the face lists {sorted(lists)} is called vertex_indices; export it again"
            )
        return np.empty((0, 3), np.int64)
    column = columns[key]
    if isinstance(column, _Ragged):
        return _fans(_integers(column.values, name), column.counts)
    return _fans(_integers(column.ravel(), name), np.full(len(column), column.shape[1]))


def _integers(values: npt.NDArray[Any], name: str) -> IntArray:
    if values.dtype.kind == "f":
        return _whole(values.astype(np.float64), name, "the face index")
    return values.astype(np.int64)


def _ply_attributes(vertex: dict[str, Any], name: str) -> dict[str, npt.NDArray[Any]]:
    """Everything a vertex has beside its position and normal, colours as one array."""
    rest = {key: value for key, value in vertex.items() if key not in ("x", "y", "z", "nx", "ny", "nz")}
    attributes: dict[str, npt.NDArray[Any]] = {}
    for names in COLOR_NAMES:
        found = [rest[key] for key in names if key in rest]
        channels = [value for value in found if isinstance(value, np.ndarray) and value.ndim == 1]
        if len(channels) >= 3 and "color" not in rest and (color := rgba_of(channels)) is not None:
            attributes["color"] = color
            rest = {key: value for key, value in rest.items() if key not in names}
            break
    for key, value in rest.items():
        if isinstance(value, _Ragged):
            warn_of(f"{name}: the per-vertex lists {key!r} differ in length and stay behind")
        else:
            attributes[key] = value
    return attributes


# ---------------------------------------------------------------------------------------------- OBJ and OFF


def _text_lines(path: Path) -> list[str]:
    """Return a text file's lines without comments and outer blanks; empty ones stay, so that they count."""
    text = path.read_bytes().decode("utf-8", errors="replace").replace("\\\r\n", " ").replace("\\\n", " ")
    return [line.partition("#")[0].strip() for line in text.splitlines()]


def _even_table(lines: list[str], name: str, what: str, least: int) -> tuple[FloatArray, int]:
    """Parse one row per line; return (rows, width) with the columns that all lines have."""
    widths = np.array([len(line.split()) for line in lines], dtype=np.int64)
    if len(widths) == 0:
        return np.empty((0, least)), least
    if widths.min() < least:
        short = lines[int(np.argmin(widths))]
        raise ModelError(
            f"{name}: the {what} line {short[:60]!r} has fewer than {least} numbers; export the file again"
        )
    values = parse_numbers(" ".join(lines), name)
    width = int(widths.min())
    first = np.cumsum(widths) - widths
    return values[first[:, None] + np.arange(width)], width


def _read_obj(path: Path, name: str) -> SourceMesh:
    """Read v and f lines alone: texture and normal indices would tear the surface along their seams."""
    lines = _text_lines(path)
    is_vertex = np.array([line.startswith(("v ", "v\t")) for line in lines])
    face_at = [i for i, line in enumerate(lines) if line.startswith(("f ", "f\t"))]
    if not is_vertex.any() and not face_at:
        raise ModelError(f"{name}: has no line 'v x y z', so it is not an OBJ mesh; check the suffix")
    table, width = _even_table([lines[i][2:] for i in np.flatnonzero(is_vertex)], name, "vertex", 3)
    attributes: dict[str, npt.ArrayLike] = {}
    if width >= 6:  # x y z r g b [a]
        if (color := rgba_of(list(table[:, 3:7].T))) is not None:
            attributes["color"] = color
        else:
            warn_of(f"{name}: the numbers behind its vertices are no colours in 0..1 or 0..255 and stay behind")
    if not face_at:
        return build_source(table[:, :3], np.empty((0, 3), np.int64), attributes, name)
    corner_lines = [re.sub(r"/\S*", "", lines[i][2:]) for i in face_at]
    counts = np.array([len(line.split()) for line in corner_lines], dtype=np.int64)
    corners = _whole(parse_numbers(" ".join(corner_lines), name), name, "the face index")
    if (corners == 0).any():
        raise ModelError(f"{name}: a face names vertex 0, but OBJ counts from 1; export the file again")
    if (corners < 0).any():  # -1 is the last vertex before the face's own line
        before = np.repeat(np.cumsum(is_vertex)[face_at], counts)
        corners = np.where(corners < 0, before + corners + 1, corners)
    return build_source(table[:, :3], _fans(corners - 1, counts), attributes, name)


def _read_off(path: Path, name: str) -> SourceMesh:
    lines = [line for line in _text_lines(path) if line]
    keyword = re.match(r"(ST)?(C)?(N)?OFF\b\s*", lines[0]) if lines else None
    if keyword is None:
        begin = lines[0][:24] if lines else ""
        raise ModelError(f"{name}: is not an OFF file (it begins with {begin!r}, not with 'OFF'); check the suffix")
    rest = lines[0][keyword.end() :]
    if "BINARY" in rest.upper():
        raise ModelError(f"{name}: is a binary OFF, which is not read; save it as text or as PLY")
    lines = ([rest] if rest else []) + lines[1:]
    if not lines:
        raise ModelError(f"{name}: ends before its counts; the file is truncated, export it again")
    header = _whole(parse_numbers(lines[0], name), name, "the count")
    if len(header) < 2 or header.min() < 0:
        raise ModelError(f"{name}: cannot read the counts {lines[0][:60]!r}; export the file again")
    n_vertices, n_faces = int(header[0]), int(header[1])
    if len(lines) - 1 < n_vertices + n_faces:
        raise ModelError(
            f"{name}: truncated: declares {n_vertices} vertices and {n_faces} faces, but {len(lines) - 1} "
            "lines follow; "
            f"copy or export the file again"
        )
    table, width = _even_table(lines[1 : 1 + n_vertices], name, "vertex", 3)
    attributes: dict[str, npt.ArrayLike] = {}
    first_color = 6 if keyword[3] else 3
    last_color = min(first_color + 4, width - (2 if keyword[1] else 0))
    if keyword[2] and last_color - first_color >= 3:
        if (color := rgba_of(list(table[:, first_color:last_color].T))) is not None:
            attributes["color"] = color
        else:
            warn_of(f"{name}: its vertex colours are neither in 0..1 nor in 0..255 and stay behind")
    if n_faces == 0:
        return build_source(table[:, :3], np.empty((0, 3), np.int64), attributes, name)
    face_lines = lines[1 + n_vertices : 1 + n_vertices + n_faces]
    widths = np.array([len(line.split()) for line in face_lines], dtype=np.int64)
    values = parse_numbers(" ".join(face_lines), name)
    starts = np.cumsum(widths) - widths
    counts = _whole(values[starts], name, "the number of corners")
    if (counts < 0).any() or (counts + 1 > widths).any():
        short = face_lines[int(np.argmax((counts < 0) | (counts + 1 > widths)))]
        raise ModelError(
            f"{name}: the face line {short[:60]!r} has too few indices; the file is damaged, export it again"
        )
    first = np.cumsum(counts) - counts
    corners = values[np.arange(counts.sum()) + np.repeat(starts + 1 - first, counts)]
    faces = _fans(_whole(corners, name, "the face index"), counts)
    return build_source(table[:, :3], faces, attributes, name)


# ------------------------------------------------------------ through trimesh


def _read_with_trimesh(path: Path, name: str) -> SourceMesh:
    suffix = path.suffix.lower()
    if suffix == ".stl":
        _check_stl(path, name)
    elif suffix in (".glb", ".gltf"):
        _check_gltf(path, name, suffix)
    import trimesh

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # older NumPy only warns when a number cannot be read
        warnings.filterwarnings("error", message="string or file could not be read")
        try:
            loaded = trimesh.load(str(path), process=False)
        except (OSError, MemoryError):
            raise
        except Exception as error:  # a damaged file may break the reader anywhere
            raise ModelError(
                f"{name}: cannot be read as {suffix} ({type(error).__name__}: {reason_of(error)}); "
                "export the file again"
            ) from error
        pieces = _scene_pieces(loaded)
    if not pieces:
        raise ModelError(f"{name}: holds no triangle mesh; export it with faces")
    points, faces, attributes = _concatenated(pieces, name)
    if len(faces) == 0:
        return build_source(points, faces, attributes, name)
    first, inverse = _equal_points(points)
    inside = (faces >= 0) & (faces < len(points))
    if inside.all():
        points, faces = points[first], inverse[faces]
        attributes = {key: values[first] for key, values in attributes.items()}
        return build_source(points, faces, attributes, name, rows=first)
    return build_source(points, faces, attributes, name)


def _trimesh_arrays(mesh: Any) -> tuple[FloatArray, IntArray, dict[str, npt.NDArray[Any]]]:
    points = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.array(mesh.faces)
    attributes = {
        str(key): np.array(values)
        for key, values in mesh.vertex_attributes.items()
        if np.ndim(values) > 0 and len(values) == len(points)
    }
    visual = mesh.visual
    if visual.kind == "vertex":
        colors = np.asarray(visual.vertex_colors)
    else:  # a glTF with a material keeps its vertex colours beside it
        colors = np.asarray(getattr(visual, "vertex_attributes", {}).get("color", ()))
    if colors.ndim == 2 and len(colors) == len(points) and colors.shape[1] in (3, 4):
        if (color := rgba_of(list(colors.T))) is not None:
            attributes["color"] = color
    return points, faces, attributes


def _scene_pieces(loaded: Any) -> list[tuple[FloatArray, IntArray, dict[str, npt.NDArray[Any]]]]:
    """Return the arrays of every mesh in a scene, placed where the scene has it."""
    if hasattr(loaded, "faces"):
        return [_trimesh_arrays(loaded)]
    if not hasattr(loaded, "graph"):  # a point cloud: vertices without faces
        points = np.array(getattr(loaded, "vertices", np.empty((0, 3))), dtype=np.float64)
        return [(points, np.empty((0, 3), np.int64), {})]
    pieces = []
    for node in loaded.graph.nodes_geometry:
        transform, geometry = loaded.graph[node]
        mesh = loaded.geometry[geometry]
        if not hasattr(mesh, "faces"):
            continue
        points, faces, attributes = _trimesh_arrays(mesh)
        if not np.array_equal(transform, np.eye(4)):
            points = points @ transform[:3, :3].T + transform[:3, 3]
            if np.linalg.det(transform[:3, :3]) < 0:
                faces = faces[:, ::-1]
        pieces.append((points, faces, attributes))
    return pieces


def _concatenated(
    pieces: list[tuple[FloatArray, IntArray, dict[str, npt.NDArray[Any]]]], name: str
) -> tuple[FloatArray, IntArray, dict[str, npt.NDArray[Any]]]:
    if len(pieces) == 1:
        return pieces[0]
    counts = [len(points) for points, _, _ in pieces]
    offsets = np.cumsum(counts) - counts
    attributes = {}
    for key in sorted({key for _, _, attributes in pieces for key in attributes}):
        parts = [attributes.get(key) for _, _, attributes in pieces]
        shapes = {None if part is None else (part.dtype, part.shape[1:]) for part in parts}
        if len(shapes) == 1:
            attributes[key] = np.concatenate([part for part in parts if part is not None])
        else:
            warn_of(f"{name}: only some of its {len(pieces)} meshes have the attribute {key!r}, which stays behind")
    faces = np.concatenate([piece[1] + offset for piece, offset in zip(pieces, offsets, strict=True)])
    return np.concatenate([piece[0] for piece in pieces]), faces, attributes


def _equal_points(points: FloatArray) -> tuple[IntArray, IntArray]:
    """Group points at exactly one position: the first of each group, in order, and every point's group."""
    tidy = points + 0.0  # -0.0 and 0.0 are one position
    order = np.lexsort(tidy.T)  # stable: within a group the rows ascend
    ordered = tidy[order]
    starts = np.ones(len(points), bool)
    starts[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    leader = np.empty(len(points), np.int64)
    leader[order] = order[starts][np.cumsum(starts) - 1]
    first = np.flatnonzero(leader == np.arange(len(points)))
    position = np.empty(len(points), np.int64)
    position[first] = np.arange(len(first))
    return first, position[leader]


def _check_stl(path: Path, name: str) -> None:
    """Compare a binary STL's declared count with its size, and see that a text one is complete."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(84)
        if len(head) == 84:
            declared = struct.unpack("<I", head[80:])[0]
            if 84 + 50 * declared == size:
                return
        if head.lstrip()[:5].lower() != b"solid":
            if len(head) < 84:
                raise ModelError(f"{name}: is not an STL file ({size} bytes); check the suffix")
            raise ModelError(
                f"{name}: declares {declared} triangles, so {84 + 50 * declared} bytes, but has {size}; "
                f"the file is truncated or no STL, export it again"
            )
        text = head + stream.read()
    lower = text.lower()
    if b"endsolid" not in lower[-256:]:
        raise ModelError(f"{name}: its text does not end with 'endsolid'; the file is truncated, export it again")
    if lower.count(b"endloop") * 3 != len(re.findall(rb"\bvertex\s", lower)):
        raise ModelError(f"{name}: not every facet has three vertices; the file is damaged, export it again")


def _check_gltf(path: Path, name: str, suffix: str) -> None:
    """Refuse a glTF whose declared sizes exceed what its file can hold."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        if suffix == ".glb":
            head = stream.read(20)
            if len(head) < 20 or head[:4] != b"glTF":
                raise ModelError(f"{name}: is not a GLB file (it begins with {_glimpse(head)}); check the suffix")
            length, chunk = struct.unpack("<8xII4x", head)
            if length > size or chunk > size - 20:
                raise ModelError(
                    f"{name}: truncated: its header declares {length} bytes, but the file has {size}; copy it again"
                )
            text = stream.read(chunk)
        else:
            text = stream.read()
    try:
        tree = json.loads(text)
        accessors = tree.get("accessors", [])
        # an accessor without a buffer view is all zeros: a few bytes that could ask for any amount of memory
        counts = [int(item.get("count", 0)) for item in accessors if "bufferView" not in item]
        outside = [uri for uri in _gltf_uris(tree) if not _is_beside(uri)]
    except (ValueError, AttributeError, TypeError, OverflowError, RecursionError) as error:
        raise ModelError(f"{name}: its JSON part cannot be read ({reason_of(error)}); export the file again") from error
    if outside:
        raise ModelError(f"{name}: names {outside[0][:80]!r}, which is outside its folder; export it as .glb")
    if max(counts, default=0) > size:
        raise ModelError(f"{name}: declares {max(counts)} empty values in a file of {size} bytes; export it again")


def _gltf_uris(tree: Any) -> list[str]:
    """Return the names of the files that a glTF would read beside itself."""
    uris = [item.get("uri") for key in ("buffers", "images") for item in tree.get(key, [])]
    return [str(uri) for uri in uris if uri is not None and not str(uri).startswith("data:")]


def _is_beside(uri: str) -> bool:
    """Tell whether a URI is the name of a file in the same folder or below."""
    return not re.search(r"[:\\%\0]|^/|(^|/)\.\.(/|$)", uri)


# ---------------------------------------------------------------------------------------------- grids


def _read_grid(
    path: Path,
    name: str,
    suffix: str,
    spacing: float | tuple[float, float] | None,
    nodata: float | None,
    window: Window | None,
) -> SourceMesh:
    steps: tuple[float, float] | None = None
    if spacing is not None:
        try:
            values = np.broadcast_to(np.asarray(spacing, dtype=np.float64), 2)
        except ValueError:
            raise ModelError(f"{name}: the spacing is {spacing!r}; give one number or (dx, dy)") from None
        steps = (float(values[0]), float(values[1]))
    if suffix in RASTER_SUFFIXES:
        from meshsimp_pymoo.formats.geotiff import read_raster

        return read_raster(path, name, steps, nodata, window)
    if suffix == ".asc":
        return _read_asc(path, name, steps, nodata, window)
    if suffix == ".npy":
        with path.open("rb") as stream:
            height = read_npy(stream, path.stat().st_size, name)
        return grid_source(height, *(steps or (1.0, 1.0)), nodata=nodata, name=name, window=window)
    with path.open("rb") as stream:
        arrays = read_npz(stream, name)
    if not arrays:
        raise ModelError(f"{name}: holds no arrays; save the heights as 'elevation'")
    if "elevation" in arrays:
        height = arrays["elevation"]
    else:
        flat = [key for key, array in arrays.items() if array.ndim == 2]
        if len(flat) != 1:
            raise ModelError(f"{name}: has no array 'elevation' and {len(flat)} other 2-D arrays {flat}; name one so")
        height = arrays[flat[0]]
    if steps is None:
        dx = _scalar(arrays, "dx", 1.0, name)
        steps = (dx, _scalar(arrays, "dy", dx, name))
    return grid_source(height, *steps, nodata=nodata, name=name, window=window)


def _scalar(arrays: dict[str, npt.NDArray[Any]], key: str, default: float, name: str) -> float:
    if key not in arrays:
        return default
    if arrays[key].size != 1 or arrays[key].dtype.kind not in "iuf":
        raise ModelError(f"{name}: {key!r} is {arrays[key].dtype} of the shape {arrays[key].shape}; give one number")
    return float(arrays[key].reshape(()))


def _read_asc(
    path: Path, name: str, steps: tuple[float, float] | None, nodata: float | None, window: Window | None
) -> SourceMesh:
    """Read an ESRI ASCII grid: a line per key, then the rows of heights from north to south."""
    text = path.read_bytes().decode("utf-8", errors="replace")
    header: dict[str, float] = {}
    at = 0
    for match in re.finditer(r"[ \t]*([A-Za-z_]+)[ \t]+(\S+)[ \t]*(?:\r\n|\r|\n|$)", text):
        if match.start() != at or match[1].lower() in ("nan", "inf"):
            break
        try:
            header[match[1].lower()] = float(match[2])
        except ValueError:
            raise ModelError(
                f"{name}: the header line {match[0].strip()[:60]!r} has no number; write it again"
            ) from None
        at = match.end()
    missing = [key for key in ("ncols", "nrows") if key not in header]
    if steps is None and "cellsize" not in header and not {"dx", "dy"} <= header.keys():
        missing.append("cellsize")
    if missing:
        raise ModelError(
            f"{name}: its header lacks {', '.join(missing)}, so it is no ESRI ASCII grid; check the suffix"
        )
    columns, rows = header["ncols"], header["nrows"]
    if not (columns >= 2 and rows >= 2 and columns % 1 == 0 and rows % 1 == 0):
        raise ModelError(f"{name}: declares {columns:g} columns and {rows:g} rows; give at least 2 of each")
    if columns * rows * 2 - 1 > len(text) - at:
        raise ModelError(
            f"{name}: truncated: declares {columns:g} x {rows:g} heights, but {len(text) - at} bytes follow; "
            "copy it again"
        )
    heights = parse_numbers(text[at:], name)
    if len(heights) != columns * rows:
        raise ModelError(
            f"{name}: declares {columns:g} x {rows:g} = {columns * rows:g} heights, but {len(heights)} "
            "follow; "
            f"copy or write it again"
        )
    cell = header.get("cellsize", 1.0)
    dx, dy = steps or (header.get("dx", cell), header.get("dy", cell))
    west = header.get("xllcenter", header.get("xllcorner", 0.0) + (dx / 2 if "xllcorner" in header else 0.0))
    south = header.get("yllcenter", header.get("yllcorner", 0.0) + (dy / 2 if "yllcorner" in header else 0.0))
    return grid_source(
        heights.reshape(int(rows), int(columns)),
        dx,
        dy,
        nodata=header.get("nodata_value", -9999.0) if nodata is None else nodata,  # ESRI's default
        name=name,
        origin=(west, south + (rows - 1) * dy),
        window=window,
    )
