"""Points without faces: their Delaunay triangulation in the plane is the original mesh.

Text (x y z in every line) is read here, LAS and LAZ by laspy (the extra ``las``). The triangulation is the one of this
package, so that keeping all points gives the original mesh again, to the last triangle.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from meshsimp_pymoo.errors import ModelError, reason_of, warn_of
from meshsimp_pymoo.files import DEFLATE_LIMIT, UNPACKED_LIMIT
from meshsimp_pymoo.formats.load import (
    TEXT_CLOUD_SUFFIXES,
    SourceMesh,
    build_source,
    check_points,
    parse_numbers,
    rgba_of,
)
from meshsimp_pymoo.plane.predicates import exact_ranges
from meshsimp_pymoo.plane.triangulation import INFINITE, RECORD, triangulate
from meshsimp_pymoo.surface.evaluate import SLIVER_HEIGHT
from meshsimp_pymoo.surface.model import find_corners, unit_square, vector_order

__all__ = ["cloud_source", "read_cloud"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Points that are unpacked at once.
CHUNK_POINTS = 1_000_000
# What a small .laz may unpack to, whatever its packing.
UNPACKED_FLOOR = 64 << 20
# A header of columns, comments and a count stand in the first lines of a text, if anywhere.
SPACES = b" \t\r\v\f"
# Bytes of text that are looked at together.
CHUNK_BYTES = 1 << 23


def cloud_source(
    points: npt.ArrayLike,
    *,
    max_edge: float | None = None,
    attributes: Mapping[str, npt.ArrayLike] | None = None,
    name: str = "points",
    georeference: dict[str, Any] | None = None,
) -> SourceMesh:
    """Triangulate points in the plane of x and y: the Delaunay triangulation, ties broken as everywhere here.

    Parameters
    ----------
    points : (P, 3) array
        Points; z is the height [units].
    max_edge : float, optional
        A triangle with an edge longer than this in the plane is left out [units]. Without it the triangulation covers
        the convex hull of the points, and bridges every bay of their outline and every hole; about three times the
        usual distance of neighbours keeps both open.
    attributes : mapping of str to arrays of P rows, optional
        Per-point data.
    name : str
        What messages call it.
    georeference : dict, optional
        See :class:`~meshsimp_pymoo.formats.load.SourceMesh`.

    Returns
    -------
    SourceMesh
        Of points with one (x, y) the lowest stays; ``rows`` holds the rows of ``points`` that stay.

    Raises
    ------
    ModelError
        If there are fewer than 4 different places, all on one line, or no triangle has short enough edges.

    Warns
    -----
    ModelWarning
        If points share their place in the plane, with their number.

    Examples
    --------
    A square with its middle, and the middle once more, higher:

    >>> import warnings
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     source = cloud_source([*corners, [0.5, 0.5, 2], [0.5, 0.5, 1]])
    >>> len(source.faces), source.points[-1].tolist()
    (4, [0.5, 0.5, 1.0])
    """
    xyz = check_points(points, name)
    if max_edge is not None and not (np.isfinite(max_edge) and max_edge > 0):
        raise ModelError(f"{name}: max_edge is {max_edge}; give a positive length")
    local = xyz - xyz.min(axis=0)
    if not np.ptp(local[:, :2], axis=0).any():
        raise ModelError(f"{name}: all {len(xyz)} points share one (x, y); a surface needs different ones")
    _, xy = unit_square(local)
    order = vector_order(xy, xyz[:, 2])  # the lowest of a place first
    sorted_xy = xy[order]
    first = np.ones(len(order), bool)
    first[1:] = (sorted_xy[1:] != sorted_xy[:-1]).any(axis=1)
    n_twins = len(first) - int(first.sum())
    if n_twins:
        warn_of(
            f"{name}: {n_twins} of {len(first)} points share their (x, y) with another one and were dropped; the "
            "lowest of each place stays"
        )
    order = order[first]
    triangles = _delaunay(np.ascontiguousarray(sorted_xy[first]))
    if not len(triangles):
        raise ModelError(
            f"{name}: its {len(order)} different places lie on one line; a surface needs points beside it"
        )
    faces = order[triangles]
    if max_edge is not None:
        corners = local[faces, :2]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        faces = faces[longest <= max_edge]
        if not len(faces):
            raise ModelError(
                f"{name}: all {len(longest)} triangles have an edge longer than {max_edge:g} (half of them one longer "
                f"than {np.median(longest):.4g}); give a larger --max-edge"
            )
    rows = np.sort(order)
    place = np.full(len(xyz), -1, np.int64)
    place[rows] = np.arange(len(rows))
    values = {key: np.asarray(value)[rows] for key, value in (attributes or {}).items()}
    facts = dict(georeference or {}) | {"points": len(xyz), "same_place": n_twins, "max_edge": max_edge}
    return build_source(xyz[rows], place[faces], values, name, rows=rows, up="z", georeference=facts)


def _delaunay(xy: FloatArray) -> IntArray:
    """Return the triangles (T, 3) of points in the unit square, in vector order; slivers are peeled off the hull."""
    n = len(xy)
    if n < 3:
        return np.empty((0, 3), np.int64)
    area, lift = exact_ranges(xy)
    records = np.empty(16 * n, np.uint32)
    flat = np.ascontiguousarray(xy).ravel()
    end = triangulate(
        flat, n, find_corners(xy), np.empty(0, np.int64), np.empty(n, np.uint8), records, area, lift
    )
    table = records[:end].reshape(-1, RECORD)
    triangles = table[:, :3].astype(np.int64)
    beyond = (table[:, :3] == INFINITE).any(axis=1)
    neighbours = (table[:, 4:7] >> 3).astype(np.int64)
    real = np.flatnonzero(~beyond)
    corners = xy[triangles[real]]
    edges = np.roll(corners, -1, axis=1) - corners
    double = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    longest = np.hypot(edges[..., 0], edges[..., 1]).max(axis=1)
    flat_ones = np.zeros(len(table), bool)
    diagonal = float(np.hypot(*np.ptp(xy, axis=0)))
    flat_ones[real] = double < SLIVER_HEIGHT * diagonal * longest
    peel = np.flatnonzero(flat_ones)
    while len(peel):
        outer = beyond[neighbours[peel]].any(axis=1)
        if not outer.any():
            break
        beyond[peel[outer]] = True
        peel = peel[~outer]
    return triangles[~beyond]


def read_cloud(path: Path, name: str, suffix: str, max_edge: float | None) -> SourceMesh:
    """Read and triangulate a file of points; see :func:`cloud_source`.

    Raises
    ------
    ModelError
        If it cannot be read as what its suffix says.
    """
    if suffix in TEXT_CLOUD_SUFFIXES:
        points, attributes, facts = _read_text(path, name, suffix)
    else:
        points, attributes, facts = _read_las(path, name, suffix)
    return cloud_source(points, max_edge=max_edge, attributes=attributes, name=name, georeference=facts)


# ---------------------------------------------------------------------------------------------- text


def _read_text(path: Path, name: str, suffix: str) -> tuple[FloatArray, dict[str, Any], dict[str, Any]]:
    """Read lines of numbers, between blanks, commas or semicolons: x y z, and red green blue as the fourth to sixth."""
    text = path.read_bytes()
    if b"\0" in text[:4096]:
        raise ModelError(f"{name}: holds zero bytes, so it is no text of x y z; check the suffix")
    text = re.sub(rb"(?:#|//)[^\n\r]*", b"", text).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = text.removeprefix(b"\xef\xbb\xbf").lstrip()
    head, columns, declared = _text_head(text, name, suffix)
    body = _plain_numbers(text[head:], name)
    width, count = _table_shape(body, name, columns)
    table = parse_numbers(body.decode("ascii", errors="replace"), name)
    if len(table) != width * count:
        raise ModelError(f"{name}: holds {len(table)} numbers in {count} lines of {width}; the file is damaged")
    if declared is not None and declared != count:
        raise ModelError(f"{name}: declares {declared} points, but {count} follow; copy or export it again")
    table = table.reshape(count, width)
    attributes: dict[str, Any] = {}
    if columns is None and width >= 6 and (color := rgba_of(list(table[:, 3:6].T))) is not None:
        attributes["color"] = color
    order = list(columns) if columns is not None else [0, 1, 2]
    return np.ascontiguousarray(table[:, order]), attributes, {}


def _text_head(text: bytes, name: str, suffix: str) -> tuple[int, tuple[int, int, int] | None, int | None]:
    """Return where the numbers begin, the columns of x, y and z and the number of points, if the first line says so."""
    line, _, _ = text.partition(b"\n")
    words = [word.strip(" \t\"'").lower() for word in re.split(r"[\s,;]+", line.decode("utf-8", errors="replace"))]
    words = [word for word in words if word]
    if suffix == ".pts" and len(words) == 1 and words[0].isdigit() and len(words[0]) < 20:
        return len(line), None, int(words[0])
    if not words or _is_number(words[0]):
        return 0, None, None
    if not set("xyz") <= set(words):
        raise ModelError(
            f"{name}: its first line {line[:60].decode('utf-8', errors='replace')!r} neither holds numbers nor names "
            "the columns x, y and z; write x y z in every line"
        )
    x, y, z = (words.index(axis) for axis in "xyz")
    return len(line), (x, y, z), None


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _plain_numbers(body: bytes, name: str) -> bytes:
    """Return the text with blanks between numbers and points in them, whatever stood there."""
    line = body.lstrip().partition(b"\n")[0]
    if b";" in line:
        return body.replace(b",", b".").replace(b";", b" ")
    words = line.split()
    if b"," in line and len(words) >= 3 and all(re.fullmatch(rb"[^,]*(,[^,]+)?", word) for word in words):
        return body.replace(b",", b".")  # 1,5 2,5 3,0
    return body.replace(b",", b" ")


def _table_shape(body: bytes, name: str, columns: tuple[int, int, int] | None) -> tuple[int, int]:
    """Return (numbers in a line, lines), after comparing every line with the first one."""
    least = 3 if columns is None else max(columns) + 1
    width, count, start = 0, 0, 0
    while start < len(body):
        end = body.rfind(b"\n", start, start + CHUNK_BYTES) + 1
        end = end if end > start and start + CHUNK_BYTES < len(body) else len(body)
        part = np.frombuffer(body, np.uint8, count=end - start, offset=start)
        newline = part == ord("\n")
        blank = newline | np.isin(part, np.frombuffer(SPACES, np.uint8))
        starts = ~blank
        starts[1:] &= blank[:-1]
        ends = np.append(np.flatnonzero(newline), len(part))
        words = np.diff(np.searchsorted(np.flatnonzero(starts), ends), prepend=0)
        words = words[words > 0]
        if len(words):
            width = width or int(words[0])
            wrong = np.flatnonzero((words != width) | (words < least))
            if len(wrong):
                k = int(wrong[0])
                wanted = f"the first has {width}" if width >= least else f"{least} are needed"
                raise ModelError(
                    f"{name}: the {count + k + 1}. line of numbers has {words[k]}, where {wanted}; export it again"
                )
            count += len(words)
        start = end
    if count < 4:
        raise ModelError(f"{name}: has {count} vertices; at least 4 are needed")
    return width, count


# ---------------------------------------------------------------------------------------------- LAS and LAZ


def _read_las(path: Path, name: str, suffix: str) -> tuple[FloatArray, dict[str, Any], dict[str, Any]]:
    """Read the points of a LAS or LAZ file that are not marked as withheld, their classes, intensities and colours."""
    try:
        import laspy
    except ImportError:
        raise ModelError(
            f"{name}: {suffix} needs laspy; install it by pip install 'meshsimp-pymoo[las]'"
        ) from None
    with path.open("rb") as stream:
        packed = _check_las(stream, path.stat().st_size, name)
    if packed and not laspy.LazBackend.Lazrs.is_available():
        raise ModelError(f"{name}: packed points need lazrs; install it by pip install 'meshsimp-pymoo[las]'")
    parts: list[dict[str, Any]] = []
    withheld = 0
    try:
        backend = laspy.LazBackend.Lazrs if packed else None
        with laspy.open(str(path), laz_backend=backend) as reader:
            facts = _las_facts(reader.header)
            for chunk in reader.chunk_iterator(CHUNK_POINTS):
                kept = np.asarray(chunk.withheld) == 0
                withheld += len(kept) - int(kept.sum())
                names = set(chunk.point_format.dimension_names)
                part = {axis: np.asarray(chunk[axis], np.float64)[kept] for axis in "xyz"}
                part |= {key: np.asarray(chunk[key])[kept] for key in ("classification", "intensity")}
                if {"red", "green", "blue"} <= names:
                    part["color"] = np.column_stack([np.asarray(chunk[key])[kept] for key in ("red", "green", "blue")])
                parts.append(part)
    except MemoryError:
        raise
    except BaseException as error:  # a damaged file may break the reader anywhere; lazrs panics outside of Exception
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        raise ModelError(
            f"{name}: cannot be read as {suffix} ({type(error).__name__}: {reason_of(error)}); export it again"
        ) from None
    if withheld:
        warn_of(f"{name}: {withheld} points are marked as withheld and were left out")
    if not parts:
        raise ModelError(f"{name}: has 0 vertices; at least 4 are needed")
    joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    points = np.column_stack([joined.pop(axis) for axis in "xyz"])
    if "color" in joined:
        joined["color"] = _las_color(joined["color"])
    return points, joined, facts


def _check_las(stream: IO[bytes], size: int, name: str) -> bool:
    """Compare what a LAS header declares with the file's size; return whether its points are packed."""
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


def _las_facts(header: Any) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "scales": [float(value) for value in header.scales],
        "offsets": [float(value) for value in header.offsets],
    }
    for record in header.vlrs:
        wkt = getattr(record, "string", None)
        if type(record).__name__ == "WktCoordinateSystemVlr" and wkt:
            facts["crs"] = str(wkt).rstrip("\0")
        elif type(record).__name__ == "GeoKeyDirectoryVlr":
            # 3072 and 2048: the projected and the geographic system, by EPSG number
            keys = {key.id: key.value_offset for key in record.geo_keys if key.tiff_tag_location == 0}
            epsg = keys.get(3072) or keys.get(2048)
            if epsg and epsg < 32767:
                facts["epsg"] = int(epsg)
    return facts


def _las_color(values: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Return 16-bit colours (P, 3) as (P, 4) bytes; some programs write 8-bit values into the 16 bits."""
    scaled = values >> 8 if values.max(initial=0) > 255 else values
    return np.column_stack([scaled.astype(np.uint8), np.full(len(values), 255, np.uint8)])
