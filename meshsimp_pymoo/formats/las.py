"""LAS and LAZ: the points of laser scans, by laspy."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from meshsimp_pymoo.errors import ModelError, reason_of, warn_of, way_to_install
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray
    from meshsimp_pymoo.formats.source import SourceMesh

# Points that are unpacked at once.
CHUNK_POINTS = 1_000_000
# The way of packing that has no chunks.
POINTWISE = b"\1\0"
# What a small .laz may unpack to, whatever its packing.
UNPACKED_FLOOR = 64 << 20

# Of the GeoTIFF specification: the keys of a system and their values.
MODEL_TYPE, PROJECTED_SYSTEM, GEOGRAPHIC_SYSTEM, LINEAR_UNIT, HEIGHT_UNIT = 1024, 3072, 2048, 3076, 4099
PROJECTED, GEOGRAPHIC = 1, 2
SYSTEMS = {PROJECTED: PROJECTED_SYSTEM, GEOGRAPHIC: GEOGRAPHIC_SYSTEM}
USER_DEFINED = 32767
LENGTHS = {9001: "metre", 9002: "foot", 9003: "US survey foot"}


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    """Read the points of a LAS or LAZ file that are not marked as withheld, their classes, intensities and colours.

    ``georeference`` holds ``classes``: how many points of each class there are in the file, whichever are taken.
    """
    from collections import Counter

    import laspy
    import numpy as np

    from meshsimp_pymoo.formats.source.classes import count_classes
    from meshsimp_pymoo.formats.source.points import read_cloud

    with path.open("rb") as stream:
        packed = _check(stream, path.stat().st_size, name)
    if packed and not laspy.LazBackend.Lazrs.is_available():
        raise ModelError(f"{name}: packed points need lazrs; install it by {way_to_install('las')}")
    parts: list[dict[str, Any]] = []
    counts: Counter[str] = Counter()
    withheld, row = 0, 0
    try:
        backend = laspy.LazBackend.Lazrs if packed else None
        with laspy.open(str(path), laz_backend=backend) as reader:
            facts = _facts(reader.header)
            for chunk in reader.chunk_iterator(CHUNK_POINTS):
                classes = np.asarray(chunk["classification"])
                kept = np.asarray(chunk.withheld) == 0
                withheld += len(kept) - int(kept.sum())
                counts.update(count_classes(classes[kept]))
                if options.classes is not None:
                    kept &= np.isin(classes, options.classes)
                names = set(chunk.point_format.dimension_names)
                part = {axis: np.asarray(chunk[axis], np.float64)[kept] for axis in "xyz"}
                part |= {"classification": classes[kept], "intensity": np.asarray(chunk["intensity"])[kept]}
                if {"red", "green", "blue"} <= names:
                    part["color"] = np.column_stack([np.asarray(chunk[key])[kept] for key in ("red", "green", "blue")])
                parts.append(part | {"row": row + np.flatnonzero(kept)})
                row += len(kept)
    except MemoryError:
        raise
    except BaseException as error:  # a damaged file may break the reader anywhere; lazrs panics outside of Exception
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        raise ModelError(
            f"{name}: cannot be read as {path.suffix.lower()} ({type(error).__name__}: {reason_of(error)}); export it "
            "again"
        ) from None
    if withheld:
        warn_of(f"{name}: {withheld} points are marked as withheld and were left out")
    if not parts:
        raise ModelError(f"{name}: has 0 vertices; at least 4 are needed")
    facts["classes"] = {number: counts[number] for number in sorted(counts, key=int)}
    joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    points = np.column_stack([joined.pop(axis) for axis in "xyz"])
    if "color" in joined:
        joined["color"] = _color(joined["color"])
    return read_cloud(points, options, rows=joined.pop("row"), attributes=joined, name=name, georeference=facts)


def _check(stream: IO[bytes], size: int, name: str) -> bool:
    """Compare what a LAS header declares with the file's size; return whether its points are packed."""
    from meshsimp_pymoo.files import DEFLATE_LIMIT, UNPACKED_LIMIT

    head = stream.read(375)
    if len(head) < 227 or head[:4] != b"LASF":
        raise ModelError(f"{name}: is not a LAS file (it does not begin with 'LASF'); check the suffix")
    header_size, start, n_records, kind, length, count = struct.unpack_from("<HIIBHI", head, 94)
    later, n_later = 0, 0
    if head[25] >= 4 and header_size >= 375 and len(head) == 375:
        later, n_later, long_count = struct.unpack_from("<QIQ", head, 235)
        count = long_count or count
    packed = bool(kind & 0xC0)
    needed = count * length
    if packed:
        most = min(max(UNPACKED_FLOOR, DEFLATE_LIMIT * size), UNPACKED_LIMIT)
    else:
        most = size - start
    if needed > most or start > size or header_size > start:
        raise ModelError(
            f"{name}: truncated: declares {count} points of {length} bytes from byte {start} on, but has {size} bytes; "
            "copy or export it again"
        )
    if n_records * 54 > size or n_later * 60 > max(size - later, 0):
        raise ModelError(
            f"{name}: declares {n_records} and {n_later} records beside its points, more than its {size} bytes can "
            "hold; export it again"
        )
    if packed:
        _check_items(stream, header_size, n_records, length, name)
        _check_chunks(stream, start, length, size, name)
    return packed


def _check_items(stream: IO[bytes], at: int, n_records: int, length: int, name: str) -> None:
    """See that the parts of which packed points consist add up to a point, which the unpacking takes for granted."""
    for _ in range(n_records):
        stream.seek(at)
        head = stream.read(54)
        if len(head) < 54:
            break
        user, number, size = head[2:18].rstrip(b"\0"), *struct.unpack_from("<HH", head, 18)
        at += 54 + size
        if (user, number) != (b"laszip encoded", 22204):
            continue
        content = stream.read(size)
        if content[:2] == POINTWISE:
            raise ModelError(
                f"{name}: is packed in LASzip's first way, without chunks, which is not read; pack it anew with LASzip "
                "or PDAL"
            )
        count = struct.unpack_from("<H", content, 32)[0] if len(content) >= 34 else 0
        items = [struct.unpack_from("<HH", content, 34 + 6 * k) for k in range(count) if len(content) >= 40 + 6 * k]
        if count == 0 or len(items) < count or sum(size for _, size in items) != length:
            raise ModelError(f"{name}: its packed points do not consist of parts of {length} bytes; export it again")
        return
    raise ModelError(f"{name}: does not say how its points are packed; export it again")


def _check_chunks(stream: IO[bytes], start: int, length: int, size: int, name: str) -> None:
    """Compare the declared number of chunks of packed points with the file: each begins with a whole point."""
    stream.seek(start)
    (at,) = struct.unpack("<q", stream.read(8).ljust(8, b"\0"))
    if at == -1 and size >= 8:  # a writer that could not go back wrote the place last
        stream.seek(size - 8)
        (at,) = struct.unpack("<q", stream.read(8))
    if not start <= at <= size - 8:
        raise ModelError(f"{name}: has the table of its chunks at byte {at} of {size}; copy or export it again")
    stream.seek(at + 4)
    (chunks,) = struct.unpack("<I", stream.read(4))
    if chunks * max(length, 1) > size:
        raise ModelError(f"{name}: declares {chunks} chunks of points, but has {size} bytes; export it again")


def _facts(header: Any) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "scales": [float(value) for value in header.scales],
        "offsets": [float(value) for value in header.offsets],
    }
    for record in [*header.vlrs, *(header.evlrs or [])]:
        wkt = getattr(record, "string", None)
        if type(record).__name__ == "WktCoordinateSystemVlr" and wkt:
            facts["crs"] = str(wkt).rstrip("\0")
        elif type(record).__name__ == "GeoKeyDirectoryVlr":
            keys = {key.id: key.value_offset for key in record.geo_keys if key.tiff_tag_location == 0}
            kind = keys.get(MODEL_TYPE, PROJECTED if PROJECTED_SYSTEM in keys else GEOGRAPHIC)
            epsg = keys.get(SYSTEMS.get(kind, 0), USER_DEFINED)
            if 0 < epsg < USER_DEFINED:
                facts["epsg"] = int(epsg)
            unit = "degree" if kind == GEOGRAPHIC else LENGTHS.get(keys.get(LINEAR_UNIT, 0))
            if unit is not None and MODEL_TYPE in keys:
                facts["unit"] = unit
            if (unit := LENGTHS.get(keys.get(HEIGHT_UNIT, 0))) is not None:
                facts["height_unit"] = unit
    return facts


def _color(values: AnyArray) -> AnyArray:
    """Return 16-bit colours (P, 3) as (P, 4) bytes; some programs write 8-bit values into the 16 bits."""
    import numpy as np

    scaled = values >> 8 if values.max(initial=0) > 255 else values
    return np.column_stack([scaled.astype(np.uint8), np.full(len(values), 255, np.uint8)])


register(Format("las", (".las", ".laz"), "LAS or LAZ", "cloud", read=_read, extra="las"))
