"""The formats of files, in one table: what reads a suffix, what writes it, and what is to be known of both.

A format is one file of this folder. It says all of itself in a :class:`Format`, which its last line registers::

    register(Format("toy", (".toy",), "toy meshes", read=_read, write=_write))

Nothing else has to change: the table finds the files of the folder by itself, and the commands, their help and every
message that lists suffixes ask the table. Help is made of it, so that a format's file imports nothing heavy before it
is to read or write.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from meshsimp_pymoo import formats
from meshsimp_pymoo.discovery import modules_in
from meshsimp_pymoo.errors import ModelError, ModelWarning, ResultError, raise_if_memory, reason_of, way_to_install
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.options import DEFAULT, Options
from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.settings import defaults_of, settings_of

if TYPE_CHECKING:
    import numpy.typing as npt

    from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import Grid, PlacedHeights
    from meshsimp_pymoo.formats.source.lines import SourceLines

# The sorts of models, as messages call them; a setting may describe some of them alone, or a format.
SORTS = {"mesh": "meshes", "grid": "height grids", "cloud": "point clouds"}
# The sort of a format that holds no models, but lines for them.
LINES = "lines"

# What to do with files of formats that are not read.
WAYS_OUT = (
    (
        ".vrt .grd .img .dem .adf .bil .bip .bsq .nc .h5 .hdf .grib .grb2 .jp2 .ecw .sid .dt0 .dt1 .dt2 .ter .rst "
        ".sdat .kea .mbtiles .webp .jpg .jpeg .bmp .pgm .raw",
        "if it is a raster of heights, make it a GeoTIFF (gdal_translate {file} out.tif)",
    ),
    (".hdr .prj .tfw .aux", "it says something of a file beside it: name that one"),
    (
        ".e57 .pcd .ptx .pcg .fls .fws .rcp .rcs .zfs .rdb .rdbx .bpf .bin .zlas",
        "if it is a point cloud, save it as .las or .xyz, or with its faces as .ply (by CloudCompare, say, or PDAL: "
        "pdal translate {file} out.las)",
    ),
    (
        ".fbx .blend .3ds .dae .zae .3mf .3dxml .stp .step .igs .iges .brep .dxf .dwg .skp .wrl .x3d .usd .usda .usdc "
        ".usdz .ctm .max .ma .mb .c4d .lwo .abc .vtk .vtp .vtu .msh .mesh .amf .u3d .drc .ifc .3dm .ts .2dm .cbor",
        "if it is a mesh, export it as .ply, .obj or .glb from the program that made it",
    ),
    (".zip .gz .tgz .tar .7z .bz2 .xz .zst .rar .kmz", "no archive is unpacked: unpack it, and name the file in it"),
    (
        ".shp .gpkg .geojson .json .kml .gml .gpx .gdb",
        "it holds features: make a raster of them (gdal_grid), or save their points as x y z (.xyz)",
    ),
    (
        ".xml .landxml",
        "export it as .ply or .obj, or its points as x y z (.xyz)",
    ),
    (".xls .xlsx .ods", "save the table as .csv, x y z in every line"),
)


class Held(Protocol):
    """What a format may want to know of a model before it writes meshes of it."""

    @property
    def name(self) -> str:
        """What messages call it."""

    @property
    def file_points(self) -> FloatArray:
        """Vertices (N, 3), as in the file."""

    @property
    def faces(self) -> IntArray:
        """Triangles (T, 3)."""

    @property
    def georeference(self) -> Mapping[str, Any]:
        """Where on Earth it is, as far as its file says."""


class Format(NamedTuple):
    """All that is known of a format of files.

    Attributes
    ----------
    name : str
        What options call it.
    suffixes : tuple of str
        Suffixes of its files, with the dot, in lower case; the first is the one that is written.
    title : str
        What people call it.
    sort : str
        What it holds: "mesh", "grid" or "cloud", or "lines" alone.
    bare_points : bool
        Whether its files may hold points without faces, which are read as a point cloud.
    read : callable, optional
        ``read(path, name, options)`` returns the model that a file holds; ``name`` is what messages call it, and the
        file is there and not empty. None: it is not read.
    write : callable, optional
        ``write(path, mesh)``; the same bytes for the same mesh. None: it is not written.
    extra : str
        The extra of this package that brings the library it needs; empty: none.
    further : callable, optional
        Returns further suffixes, which are those of no other format: ones that a library knows, asked only if needed.
    single : callable, optional
        Of a format that cannot hold double precision: ``single(mesh)`` returns the coordinates (V, 3), along the axes
        of the model's file, that are written in single precision.
    states_origin : bool
        Whether it says from which origin its coordinates count; then single precision loses nothing that matters.
    keeps : tuple of str, optional
        The attributes of vertices that it holds when written, among them "uv", with which the material goes; None: all.
    pack : callable, optional
        ``pack(mesh, most)`` returns the mesh compressed so that no vertex moves by more than so many metres, as far as
        the library can; ``write`` then writes that. A ResultError if the library is missing.
    refuse : callable, optional
        ``refuse(model)`` raises a ResultError if it cannot hold meshes of this model.
    one_height : bool
        Whether what it holds has one height at each place, along z of the file: it then holds meshes of no other model.
    needs : str
        The module of its extra without which nothing is written; empty: none.
    open_heights : callable, optional
        ``open_heights(path, name, options)`` opens a height grid that is read by windows.
    count_samples : callable, optional
        ``count_samples(path, name)`` returns the number of samples of a height grid from its header alone, or None.
    read_lines : callable, optional
        ``read_lines(path, name)`` returns the polylines that a file holds, beside a model or alone.
    write_lines : callable, optional
        ``write_lines(path, lines)`` writes polylines alone.
    holds_lines : bool
        Whether ``write`` writes the break lines of a mesh, too.
    """

    name: str
    suffixes: tuple[str, ...]
    title: str
    sort: str = "mesh"
    bare_points: bool = False
    read: Callable[[Path, str, Options], SourceMesh] | None = None
    write: Callable[[Path, OutMesh], None] | None = None
    extra: str = ""
    further: Callable[[], Iterable[str]] | None = None
    single: Callable[[OutMesh], FloatArray] | None = None
    states_origin: bool = False
    keeps: tuple[str, ...] | None = ()
    pack: Callable[[OutMesh, float], OutMesh] | None = None
    refuse: Callable[[Held], None] | None = None
    one_height: bool = False
    needs: str = ""
    open_heights: Callable[[Path, str, Options], PlacedHeights] | None = None
    count_samples: Callable[[Path, str], int | None] | None = None
    read_lines: Callable[[Path, str], SourceLines] | None = None
    write_lines: Callable[[Path, SourceLines], None] | None = None
    holds_lines: bool = False

    @property
    def suffix(self) -> str:
        """The suffix of the files that are written, with the dot."""
        return self.suffixes[0]

    @property
    def single_precision(self) -> bool:
        """Whether it cannot hold double precision."""
        return self.single is not None

    def check(self, model: Held) -> None:
        """Raise a ResultError if meshes of this model cannot be written in it, or what writes them is not installed."""
        if self.needs and find_spec(self.needs) is None:
            way = way_to_install(self.extra)
            raise ResultError(f"{model.name}: {self.title} is written by {self.needs}; install it by {way}")
        if self.refuse is not None:
            self.refuse(model)
        if self.one_height:
            _refuse_folds(self, model)


def _refuse_folds(kind: Format, model: Held) -> None:
    """Refuse a mesh with faces that do not look up along the z of its file."""
    from meshsimp_pymoo.arrays import Rows

    if isinstance(model.faces, Rows):  # of a grid that is read by windows, where all look up
        return
    a, b, c = (model.file_points[model.faces[:, k], :2] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    if (area < 0).any() or not (area > 0).any():
        wrong = int((area < 0).sum()) or len(area)
        raise ResultError(
            f"{model.name}: a {kind.title} surface has its heights along z, and {wrong:,} of {len(area):,} faces of "
            "this one do not look up along it; write another format, such as ply"
        )


# --------------------------------------------------------------------------------------------------------- the table

_TABLE: dict[str, Format] = {}


def register(kind: Format) -> None:
    """Add a format to the table.

    Raises
    ------
    ValueError
        If another format has its name, or reads or writes models or lines of one of its suffixes, too.
    """
    for other in _TABLE.values():
        both = set(kind.suffixes) & set(other.suffixes)
        ways = zip(_ways(kind), _ways(other), strict=True)
        if kind.name == other.name or (both and any(one and another for one, another in ways)):
            raise ValueError(f"the formats {kind.name!r} and {other.name!r} share a name or {sorted(both)}")
    if kind.sort not in (*SORTS, LINES):
        known = ", ".join((*SORTS, LINES))
        raise ValueError(f"the format {kind.name!r} is of the sort {kind.sort!r}; it must be one of {known}")
    _TABLE[kind.name] = kind


def _ways(kind: Format) -> tuple[object, ...]:
    """Return what a suffix means to a format; each of it can be of one format only."""
    return kind.read, kind.write, kind.read_lines, kind.write_lines


def ways_to_read(load: Callable[..., Grid]) -> dict[str, Any]:
    """Return how a format of grids reads a mesh, and heights for tiles.

    Parameters
    ----------
    load : callable
        ``load(path, name, options, by_windows=False)`` returns the whole grid, in memory or mapped into it, once it has
        been seen that there is room for it and, without ``by_windows``, for its mesh.
    """

    def read(path: Path, name: str, options: Options) -> SourceMesh:
        return load(path, name, options).mesh(name, options.window)

    def open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
        return load(path, name, options, by_windows=True).placed(name, options.window)

    return {"read": read, "open_heights": open_heights}


def all_formats() -> tuple[Format, ...]:
    """Return all formats, by name."""
    _import_all(tuple(formats.__path__))
    return tuple(_TABLE[name] for name in sorted(_TABLE))


@cache
def _import_all(folders: tuple[str, ...]) -> None:
    for name in modules_in(folders):
        import_module(f"{formats.__name__}.{name}")


def written_formats() -> dict[str, Format]:
    """Return the formats that are written, by name."""
    return {kind.name: kind for kind in all_formats() if kind.write is not None}


def written_suffixes() -> list[str]:
    """Return the suffixes of files that can be written, with the dot."""
    return [suffix for kind in written_formats().values() for suffix in kind.suffixes]


def format_to_write(name: str) -> Format:
    """Return the format of this name.

    Raises
    ------
    ValueError
        If there is none, or it is not written.
    """
    known = written_formats()
    if name not in known:
        raise ValueError(f"mesh_format is {name!r}; it must be one of {', '.join(known)}")
    return known[name]


def format_of_output(path: str | os.PathLike[str]) -> Format:
    """Return the format in which a file of this name is written, by its suffix.

    Raises
    ------
    ValueError
        If there is none.
    """
    suffix, known = Path(path).suffix.lower(), written_formats()
    for kind in known.values():
        if suffix in kind.suffixes:
            return kind
    raise ValueError(f"{path}: no such mesh format; write one of {', '.join(known)}")


def format_of_input(path: str | os.PathLike[str]) -> Format | None:
    """Return the format in which a file of this name is read, by its suffix; None: it is not read."""
    suffix, known = Path(path).suffix.lower(), [kind for kind in all_formats() if kind.read is not None]
    for kind in known:
        if suffix in kind.suffixes:
            return kind
    is_of_another = any(suffix in kind.suffixes for kind in all_formats())  # which writes it, or reads lines alone
    for kind in known:
        if suffix and not is_of_another and kind.further is not None and suffix in kind.further():
            return kind
    return None


def read_suffixes(sort: str, *, further: bool = True) -> list[str]:
    """Return the suffixes of files that are read as this sort of model; ``further``: those that libraries know too."""
    known = [kind for kind in all_formats() if kind.read is not None]
    stated = {suffix: kind.sort for kind in known for suffix in kind.suffixes}
    found = {suffix for suffix, its_sort in stated.items() if its_sort == sort}
    for kind in known:
        if further and kind.sort == sort and kind.further is not None:
            found |= set(kind.further()) - {suffix for other in all_formats() for suffix in other.suffixes}
    return sorted(found)


def line_suffixes() -> list[str]:
    """Return the suffixes of files whose lines are read, with the dot."""
    return sorted({suffix for kind in all_formats() if kind.read_lines is not None for suffix in kind.suffixes})


# ------------------------------------------------------------------------------------------------------------ reading


def read_source(path: str | os.PathLike[str], options: Options = DEFAULT) -> SourceMesh:
    """Read a mesh, a height grid or a point cloud; the suffix tells which.

    Parameters
    ----------
    path : str or path-like
        A file in one of the formats of this folder. A scene of several meshes is read as one. Polygons are cut into
        triangle fans.
    options : Options
        How it is read; what describes another sort of model, or another format, than this one is refused.

    Returns
    -------
    SourceMesh

    Raises
    ------
    ModelError
        One line with the file, the cause and the way out. Counts that a header declares are compared with the size of
        the file before anything is allocated.

    Warns
    -----
    ModelWarning
        If faces that name a vertex twice were dropped, per-vertex data could not be kept, a usual "no data" value
        stands among the heights of a grid or a cloud, points of a cloud share their place in the plane or have no
        height, points without faces are read as a cloud, or coordinates are degrees.
    """
    path = Path(path)
    name = str(path)
    _check_file(path, name)
    kind = format_of_input(path)
    if kind is None or kind.read is None:
        raise ModelError(f"{name}: unknown suffix {path.suffix.lower()!r}; {_way_out(path)}")
    refuse_foreign(name, options, kind.name, kind.sort, *(["cloud"] if kind.bare_points else []))
    with guarded(kind, name):
        source = kind.read(path, name, options)
    refuse_foreign(name, options, kind.name, source.sort)
    # clouds had to know before they were triangulated; a GLB may state a scale, and the user another one
    return source if source.sort == "cloud" else source.in_frame(options.scale)


def read_lines(path: str | os.PathLike[str]) -> SourceLines:
    """Read polylines; the suffix tells in which format they are.

    Parameters
    ----------
    path : str or path-like
        A file in one of the formats of this folder that hold lines, alone or beside a model; its suffix is one of
        :func:`line_suffixes`.

    Returns
    -------
    SourceLines

    Raises
    ------
    ModelError
        One line with the file, the cause and the way out.

    Warns
    -----
    ModelWarning
        Of what the file holds beside lines and is left out, with its count.
    """
    path = Path(path)
    name = str(path)
    _check_file(path, name)
    suffix = path.suffix.lower()
    for kind in all_formats():
        if kind.read_lines is not None and suffix in kind.suffixes:
            with guarded(kind, name):
                return kind.read_lines(path, name)
    known = ", ".join(line_suffixes())
    raise ModelError(f"{name}: no lines are read from {suffix!r}; known are {known}: convert it (by ogr2ogr, say)")


def _way_out(path: Path) -> str:
    """Return what to do with a file whose suffix is that of no format."""
    from meshsimp_pymoo.files import as_argument

    suffix, file = path.suffix.lower(), as_argument(path)
    lines = f"; its lines can be break lines of a model: --break-lines {file}" if suffix in line_suffixes() else ""
    written = [f"{kind.title} is written, not read: " for kind in written_formats().values() if suffix in kind.suffixes]
    for suffixes, advice in WAYS_OUT:
        if suffix in suffixes.split():
            return "".join(written) + advice.format(file=file) + lines
    known = [f"{' '.join(read_suffixes(sort))} for {title}" for sort, title in SORTS.items()]
    return f"known are {listed(known)}{lines}"


def listed(words: Iterable[str], link: str = "and") -> str:
    """Return words as a text lists them.

    >>> listed(["spacing", "nodata", "window"]), listed(["max_edge"], "or")
    ('spacing, nodata and window', 'max_edge')
    """
    *others, last = words
    return f"{', '.join(others)} {link} {last}" if others else last


def described(*models: str) -> list[str]:
    """Return the settings of `Options` that describe one of these sorts or formats of models; none: all such ones."""
    known = settings_of(Options).items()
    return [name for name, setting in known if setting.describes and (not models or {*models} & {*setting.describes})]


def are_given(names: Iterable[str], options: Options) -> bool:
    """Tell whether one of these settings differs from its default."""
    defaults = defaults_of(Options)
    return any(getattr(options, name) != defaults[name] for name in names)


def refuse_foreign(name: str, options: Options, *models: str) -> None:
    """Refuse settings that describe other models than those of these sorts and formats.

    Raises
    ------
    ModelError
        With the settings of another sort or format, and the suffixes of its files.
    """
    known = {sort: (title, read_suffixes(sort, further=False)) for sort, title in SORTS.items()}
    known |= {kind.name: (kind.title, list(kind.suffixes)) for kind in all_formats()}
    own = described(*models)
    for other, (title, suffixes) in known.items():
        names = [setting for setting in described(other) if setting not in own]
        if not are_given(names, options):
            continue
        describe, leave = ("describe", "them") if len(names) > 1 else ("describes", "it")
        raise ModelError(f"{name}: {listed(names)} {describe} {title} ({' '.join(suffixes)}); leave {leave} out")


def _check_file(path: Path, name: str) -> None:
    try:
        if path.is_dir():
            raise ModelError(f"{name}: is a folder; name the file in it")
        if not path.exists():
            raise ModelError(f"{name}: no such file; check the path")
        if not path.is_file():
            raise ModelError(f"{name}: is not a regular file; save it to one")
        if path.stat().st_size == 0:
            raise ModelError(f"{name}: is empty (0 bytes); export it again")
    except ModelError:
        raise
    except (OSError, ValueError) as error:
        raise ModelError(f"{name}: cannot be read ({reason_of(error)}); check the path and its permissions") from error


@contextmanager
def guarded(kind: Format, name: str) -> Iterator[None]:
    """Say in one line what a reader of this format meets in the file, or that it lacks its library."""
    import numpy as np

    try:
        # numbers that overflow become infinite, and are refused with their row
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    except ModelError:
        raise
    except ImportError as error:
        if not kind.extra:
            raise
        library = (error.name or kind.extra).partition(".")[0]
        raise ModelError(f"{name}: {kind.title} needs {library}; install it by {way_to_install(kind.extra)}") from None
    except OSError as error:
        raise_if_memory(error)
        raise ModelError(f"{name}: cannot be read ({reason_of(error)}); check the path and its permissions") from error
    except MemoryError as error:
        raise ModelError(f"{name}: does not fit into memory; take a part of it, or tiles (--tile)") from error


# ------------------------------------------------------------------------------------------------------------ writing


def write_mesh(
    path: str | os.PathLike[str],
    vertices: FloatArray,
    faces: IntArray,
    attributes: Mapping[str, AnyArray] | None = None,
    *,
    origin: npt.ArrayLike | None = None,
    georeference: Mapping[str, Any] | None = None,
    name: str = "surface",
    up: npt.ArrayLike | None = None,
    material: Material | None = None,
    lines: Sequence[IntArray] = (),
    line_names: Sequence[str] = (),
) -> None:
    """Write a mesh in the format of the path's suffix, the same bytes for the same mesh.

    Parameters
    ----------
    path : path
        Ends in one of :func:`written_suffixes`; ``.xml`` is LandXML, a surface for survey and GIS programs.
    vertices : (V, 3) float array
        Coordinates; written in double precision (STL and GLB, by definition: single). LandXML takes z for the height,
        y for the northing and x for the easting.
    faces : (M, 3) int array
        Triangles.
    attributes : mapping of str to (V,) or (V, k) array, optional
        What goes to which format its ``keeps`` says. ``color`` has 3 or 4 columns of uint8, ``uv`` (V, 2) is where on
        the image of the material each vertex lies.
    origin : (3,) floats, optional
        Of GLB: what is subtracted from the coordinates before they lose their double precision. By default the mesh's
        lower corner in round numbers. GLB is Y up and in metres; its one node puts the mesh, by its translation, where
        its coordinates are so, and says in its ``extras`` how they came about: ``origin`` and ``unit`` as in the file,
        ``metres_per_unit`` along the file's x, y and z, and ``axes``, those of the file along X, Y and Z of glTF. Read
        by this package, it has the coordinates of the file again.
    georeference : mapping, optional
        What is known of the coordinates (see :class:`~meshsimp_pymoo.formats.source.SourceMesh`): PLY says the CRS in a
        comment, GLB in ``extras``, LandXML as its coordinate system and unit, GeoPackage and GeoJSON as the system of
        their layers, DXF the unit alone. What its ``unit``, ``height_unit`` and ``scale`` make metres is scaled in GLB;
        where nothing is known, units are taken for metres, and it says so.
    name : str
        What LandXML, 2DM and VTK call the surface.
    up : (3,) floats, optional
        Of GLB: the direction of the height; the axis next to it becomes glTF's Y. By default z. What was read from a
        glTF is written as it lay.
    material : Material, optional
        Of PLY, OBJ and GLB: what all faces look like. OBJ and PLY name an image, and OBJ a library, in files that are
        put beside, with a checksum of their content in their names.
    lines : sequence of (m,) int arrays, optional
        Break lines: chains of edges of the mesh, as rows of `vertices`. OBJ has them as its lines ``l``, PLY as its
        element ``edge`` (``vertex1``, ``vertex2``), LandXML as the ``Breaklines`` of the surface, and others as
        their files say; those that leave them have no ``holds_lines``.
    line_names : sequence of str, optional
        Of LandXML, GeoPackage and GeoJSON: what each line is called.

    Raises
    ------
    ValueError
        If the suffix is not known.
    ImportError
        If the library that writes it is missing: :meth:`Format.check` says so before.
    """
    import numpy as np

    kind = format_of_output(path)
    start = None if origin is None else np.asarray(origin, dtype=np.float64)
    assert kind.write is not None
    mesh = OutMesh(
        vertices,
        faces,
        dict(attributes or {}),
        start,
        dict(georeference or {}),
        name,
        None if up is None else np.asarray(up, dtype=np.float64),
        material,
        tuple(lines),
        tuple(line_names),
    )
    kind.write(Path(path), mesh)


def write_lines(path: str | os.PathLike[str], lines: SourceLines) -> None:
    """Write polylines alone in the format of the path's suffix, the same bytes for the same lines.

    Raises
    ------
    ValueError
        If no lines are written in a file of this suffix.
    """
    suffix = Path(path).suffix.lower()
    known = {its: kind for kind in all_formats() if kind.write_lines is not None for its in kind.suffixes}
    if suffix not in known:
        raise ValueError(f"{path}: no lines are written in such a file; write one of {', '.join(known)}")
    write = known[suffix].write_lines
    assert write is not None
    write(Path(path), lines)


def shared_frame(
    kind: Format,
    points: FloatArray,
    *,
    name: str,
    georeference: Mapping[str, Any],
    up: npt.ArrayLike | None = None,
    material: Material | None = None,
) -> dict[str, Any]:
    """Return what `write_mesh` is to know of a model beside a mesh, so that all its meshes have one frame.

    Parameters
    ----------
    kind : Format
        The format of the meshes.
    points : (N, 3) float array
        All vertices of the model, as in the file.
    name : str
        The model's name.
    georeference : mapping
        What is known of the coordinates.
    up, material
        As :func:`write_mesh` takes them.
    """
    import numpy as np

    from meshsimp_pymoo.formats.source.precision import local_origin

    origin = local_origin(points) if kind.states_origin else np.zeros(3)
    stem = Path(name).stem
    return {"origin": origin, "georeference": georeference, "name": stem, "up": up, "material": material}


class Rounding:
    """What a format's single precision does to meshes, to be said once.

    Parameters
    ----------
    kind : Format
        The format.
    """

    def __init__(self, kind: Format) -> None:
        self.kind = kind
        self.shift = 0.0
        self.turned = 0

    def add(self, mesh: OutMesh, scale: FloatArray) -> None:
        """Take note of a mesh that is written; ``scale`` (3,) is what units of its coordinates are [model units]."""
        import numpy as np

        from meshsimp_pymoo.formats.source.precision import single_precision_shift, turned_over

        if self.kind.single is None:
            return
        if not self.kind.states_origin:
            self.shift = max(self.shift, single_precision_shift(mesh.vertices, scale))
        up = np.array([0.0, 0.0, 1.0]) if mesh.up is None else mesh.up
        self.turned += turned_over(self.kind.single(mesh), mesh.faces, up)

    def warn(self, name: str, diagonal: float) -> None:
        """Warn if it moves vertices by more than a person would see in the numbers, or turns triangles over."""
        from meshsimp_pymoo.formats.source.precision import SINGLE_PRECISION_LOSS

        does = []
        if self.shift > SINGLE_PRECISION_LOSS * diagonal:
            does.append(f"moves vertices by up to {self.shift:.3g} [model units]")
        if self.turned:
            does.append(f"turns over or flattens {self.turned:,} triangle{'s' * (self.turned > 1)}")
        if not does:
            return
        exact = listed(other.name for other in _kept_formats() if not other.single_precision)
        stating = listed(other.name for other in _kept_formats() if other.states_origin)
        warnings.warn(
            f"{name}: {self.kind.name} holds single precision, which {listed(does)}; {exact} keep them exactly"
            + ("" if self.kind.states_origin else f", {stating} states a local origin"),
            ModelWarning,
            stacklevel=3,
        )


def _kept_formats() -> list[Format]:
    """Return the formats that a mesh can be read from again, which are named in place of one that loses something."""
    return [kind for kind in written_formats().values() if kind.read is not None]


def warn_of_left_behind(kind: Format, name: str, attributes: Iterable[str]) -> None:
    """Warn if the format holds not all of what is known of the vertices."""
    lost = [] if kind.keeps is None else sorted(set(attributes) - set(kind.keeps))
    if lost:
        exact = listed(other.name for other in _kept_formats() if other.keeps is None)
        warnings.warn(
            f"{name}: {kind.name} does not hold {listed(lost)[:200]} of the vertices; {exact} does",
            ModelWarning,
            stacklevel=3,
        )
