"""Lines and triangles of the files that GDAL reads and writes as features, by pyogrio (the extra ``lines``).

GDAL can open a great many things under one name, other files and addresses among them: whoever asks for one has seen
that the file begins as its suffix says.
"""

from __future__ import annotations

import shutil
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, FloatArray
from meshsimp_pymoo.errors import ModelError, printable, reason_of, warn_of
from meshsimp_pymoo.formats.source.lines import SourceLines, build_lines, part_names, spelled_name
from meshsimp_pymoo.formats.source.metric import spelled_system, stated_system
from meshsimp_pymoo.formats.source.numbers import glimpse
from meshsimp_pymoo.formats.source.triangles import TRIANGLE
from meshsimp_pymoo.memory import check_free

# What a byte of a file takes at most: as the library's objects, as bytes of geometry, as coordinates.
FILE_BYTES = 8
# The fields that may name a feature.
NAMES = ("name", "id")

# Of well-known binary: the kinds of geometries, and what three dimensions add to their numbers, by two spellings.
POINT, LINE, POLYGON, COLLECTIONS = 1, 2, 3, (4, 5, 6, 7)
THOUSANDS, HIGHEST_BIT = 1000, 1 << 31

# The date that GDAL is told, where a file must say one, so that equal meshes are equal files.
DATE_OPTION, DATE = "OGR_CURRENT_DATE", "1980-01-01T00:00:00Z"


def read_features(path: Path, name: str, magic: bytes, beside: str) -> SourceLines:
    """Read the lines and the rings of polygons of all layers.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What messages call it.
    magic : bytes
        How the file must begin.
    beside : str
        What is to be done where it cannot be read.

    Raises
    ------
    ModelError
        If GDAL cannot read it, or its layers are in different reference systems.

    Warns
    -----
    ModelWarning
        If lines of several layers were taken, and as :func:`~meshsimp_pymoo.formats.source.lines.build_lines`.
    """
    from pyogrio import list_layers, read_info

    with path.open("rb") as stream:
        begins = stream.read(max(len(magic), 24))
    if not begins.startswith(magic):
        suffix = path.suffix.lower()
        raise ModelError(f"{name}: is no {suffix} file (it begins with {glimpse(begins)}); check the suffix")
    size = path.stat().st_size
    check_free(FILE_BYTES * size, f"{name}: its {size} bytes of features", "take a part of it")
    lines: list[FloatArray] = []
    names: list[str] = []
    others: Counter[str] = Counter()
    counts: dict[str, int] = {}
    systems: dict[str, str] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of measures and encodings, which are no coordinates
        try:
            layers = [str(layer) for layer, kind in list_layers(path) if kind is not None]
            for layer in layers:
                facts = read_info(path, layer=layer)
                if TRIANGLE in facts["fields"]:  # a surface as this package writes it
                    others["triangles"] += facts["features"]
                    continue
                before = len(lines)
                system, features = _features(path, layer)
                for called, geometry in features:
                    parts = [] if geometry is None else list(_parts(geometry, others))
                    others["features without a geometry"] += geometry is None
                    of_layer = f"{printable(layer)} {called}" if len(layers) > 1 else called
                    names += part_names(of_layer, len(parts))
                    lines += parts
                if len(lines) > before:
                    counts[layer], systems[layer] = len(lines) - before, system
        except (OSError, MemoryError, ModelError):
            raise
        except Exception as error:  # a damaged file may break the reader anywhere
            raise ModelError(f"{name}: cannot be read ({reason_of(error)}); {beside}") from error
    if len({*systems.values()}) > 1:
        said = ", ".join(f"{printable(layer)}: {system or 'none'}"[:80] for layer, system in systems.items())[:300]
        raise ModelError(f"{name}: its layers are in different reference systems ({said}); save one of them alone")
    found = build_lines(name, lines, names, stated_system(next(iter(systems.values()), "")), others=others)
    if len(counts) > 1:
        said = ", ".join(f"{count} of {layer!r}" for layer, count in counts.items())[:200]
        warn_of(f"{name}: lines of {len(counts)} layers are taken together: {said}")
    return found


def _features(path: Path, layer: str) -> tuple[str, Iterator[tuple[str, bytes | None]]]:
    """Return the reference system of a layer, and for each feature what messages call it, and its geometry."""
    from pyogrio import read_info
    from pyogrio.raw import read

    fields = {str(field).lower(): str(field) for field in read_info(path, layer=layer)["fields"]}
    naming = [fields[key] for key in NAMES if key in fields][:1]
    facts, numbers, geometries, columns = read(path, layer=layer, columns=naming, return_fids=True)
    named = columns[0] if naming else [None] * len(numbers)
    called = (spelled_name("feature", number, _word(name)) for number, name in zip(numbers, named, strict=True))
    return str(facts["crs"] or ""), zip(called, geometries, strict=True)


def _word(value: Any) -> object:
    """Return what a field says, or None where it says nothing: missing numbers are NaN."""
    return None if value is None or value != value else value


def _parts(geometry: bytes, others: Counter[str]) -> Iterator[FloatArray]:
    """Yield the vertices of each line and ring of a geometry in well-known binary; count what is neither."""
    at = 0
    waiting = 1

    def take(form: str) -> int:
        nonlocal at
        layout = Struct(form)
        (value,) = layout.unpack_from(geometry, at)
        at += layout.size
        return int(value)

    def coordinates(order: str, count: int, width: int) -> FloatArray:
        nonlocal at
        if count * width * 8 > len(geometry) - at:
            raise ValueError("a geometry ends early")
        found = np.frombuffer(geometry, f"{order}f8", count * width, at).reshape(count, width)
        at += found.nbytes
        return found.astype(np.float64)

    while waiting:
        waiting -= 1
        order = "<" if take("B") else ">"
        number = take(f"{order}I")
        has_height = number >= HIGHEST_BIT or number // THOUSANDS == 1
        kind, width = number % HIGHEST_BIT % THOUSANDS, 2 + has_height
        if kind in COLLECTIONS:
            waiting += take(f"{order}I")
        elif kind == POINT:
            coordinates(order, 1, width)
            others["points"] += 1
        elif kind == LINE:
            if count := take(f"{order}I"):
                yield coordinates(order, count, width)
        elif kind == POLYGON:
            for _ in range(take(f"{order}I")):
                if count := take(f"{order}I"):
                    yield coordinates(order, count, width)
        else:  # surfaces, whose parts are polygons or triangles of surfaces
            others["surfaces"] += 1
            return


# ------------------------------------------------------------------------------------------------------------ writing


class Layer(NamedTuple):
    """Features to be written: their sort, as GDAL calls it, their geometries in well-known binary, their properties."""

    name: str
    sort: str
    geometries: list[bytes]
    columns: dict[str, AnyArray]


def polygons(corners: FloatArray) -> list[bytes]:
    """Return triangles (M, 3, 3) as polygons with heights in well-known binary."""
    form = [("order", "u1"), ("sort", "<u4"), ("rings", "<u4"), ("count", "<u4"), ("ring", "<f8", (4, 3))]
    rows = np.empty(len(corners), np.dtype(form))
    rows["order"], rows["sort"], rows["rings"], rows["count"] = 1, THOUSANDS + POLYGON, 1, 4
    rows["ring"] = corners[:, [0, 1, 2, 0]]
    return [row.tobytes() for row in rows]


def line_strings(lines: Sequence[FloatArray]) -> list[bytes]:
    """Return polylines (n, 3) in well-known binary."""
    head = Struct("<BII")
    return [head.pack(1, THOUSANDS + LINE, len(line)) + line.astype("<f8").tobytes() for line in lines]


def write_layers(
    path: Path, driver: str, layers: Sequence[Layer], georeference: Mapping[str, Any], **options: str
) -> None:
    """Write layers of features by a driver of GDAL with its options, the same bytes for the same features.

    Warns
    -----
    ModelWarning
        If GDAL does not know their reference system: none is written then.
    """
    import pyogrio
    from pyogrio.errors import CRSError

    system = spelled_system(georeference)
    before = pyogrio.get_gdal_config_option(DATE_OPTION)
    pyogrio.set_gdal_config_options({DATE_OPTION: DATE})
    try:
        with tempfile.TemporaryDirectory() as folder:  # a file that is there and empty is no good one to GDAL
            made = Path(folder, f"made{path.suffix}")
            try:
                _put_layers(made, driver, layers, system, options)
            except CRSError as problem:
                warn_of(f"{path.name}: holds no reference system, as GDAL does not know it ({reason_of(problem)})")
                made.unlink(missing_ok=True)
                _put_layers(made, driver, layers, "", options)
            shutil.copyfile(made, path)
    finally:
        pyogrio.set_gdal_config_options({DATE_OPTION: before})


def _put_layers(path: Path, driver: str, layers: Sequence[Layer], system: str, options: Mapping[str, str]) -> None:
    from pyogrio.raw import write

    with warnings.catch_warnings():
        if not system:
            warnings.simplefilter("ignore")  # that there is no reference system
        for place, layer in enumerate(layers):
            write(
                path,
                np.array(layer.geometries, object),
                list(layer.columns.values()),
                list(layer.columns),
                layer=layer.name,
                driver=driver,
                geometry_type=layer.sort,
                crs=system or None,
                dataset_options=None if place else dict(options),
            )
