"""Seeded damage: good files and configurations, and ways in which they go bad."""

from __future__ import annotations

import io
import json
import re
import struct
from functools import cache
from typing import Any

import numpy as np

# A hill of 5 x 6 samples, not square, far enough from 0 that shifts matter.
ROWS, COLUMNS = 5, 6
PLACE = (10.0, 0.0, 500_000.0, 0.0, -10.0, 5_400_000.0)
KINDS = ("files", "lines", "configs", "results", "expanding")

# What readers get wrong: ends of ranges, signs, no numbers, numbers that overflow a product.
WORDS = (
    b"0", b"-0", b"1", b"-1", b"2", b"255", b"256", b"65535", b"65536", b"2147483647", b"-2147483648", b"4294967295",
    b"4000000000", b"9223372036854775807", b"18446744073709551616", b"1e30", b"1e74", b"-1e75", b"1e154", b"1e308",
    b"1e309", b"5e-324", b"1e-30", b"0.1", b"nan", b"inf", b"-inf", b"-9999", b"0x10", b"1_000", b"abc", b"", b"''",
    b"1,5", b"1;2", b"%s", b"\xff\xfe", b"\xc3\xa9", b"\x00", b"\n", b"\r", b"#", b'"', b"{}", b"[]", b"None",
    b"9" * 400,
)  # fmt: skip
INTEGERS = (0, 1, 2, 3, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
YAML_WORDS = (
    "title", "problems", "problem", "algorithms", "seeds", "budgets", "baselines", "folder", "name", "model", "preset",
    "class", "parameters", "operators", "merged_over", "generations", "evaluations", "seconds", "meshlab", "methods",
    "steps", "down_to_fronts", "crossover", "mutation", "sampling", "repair", "duplicates", "pop_size", "footprint",
    "outside", "nearest", "ignore", "hull", "up", "patch", "front", "spacing", "nodata", "window", "max_edge", "pin",
    "weights", "objectives", "max_triangles", "max_objective", "max_error", "rms_error", "triangles", "nsga2_v1",
    "nsga2_v2", "moead", "weighted_ga_v1", "w", "oax", "uniform", "neighbour_shift", "pinned_corners", "roof:5",
    "pyramid:9", "plane:3",
    "null", "true", "no", "~", "-1", "0", "0.5", "1e3", "1.0e+3", ".inf", ".nan", "0x1F", "0o17", "1:30", "2020-01-01",
    "99999999999999999999", "9007199254740993", "&a", "*a", "<<", "!!python/object/apply:os.system", "!!binary", "!x",
    "{}", "[]", "- ", "? ", ": ", "|", ">", "%", "@", "`", "'", '"', "#", "---", "...", "\t", "\n", "\n  ", "[[[[",
    "{{{{", "../x.ply", "/etc/passwd", "a.ply", "os.system", "subprocess.Popen", "builtins.eval", "numpy.ones",
    "pymoo.algorithms.moo.nsga2.NSGA2", "pymoo.operators.mutation.bitflip.BitflipMutation",
    "meshsimp_pymoo.datasets.load", "x" * 200, "é", "\u2028", "\\0",
)  # fmt: skip

CONFIGS = (
    """\
title: small
problems: [{name: A, model: "pyramid:9"}, {name: B, model: "roof:5", up: z, footprint: hull}]
algorithms:
  - {name: N1, preset: nsga2_v1, parameters: {pop_size: 6}}
seeds: [1, 2, 3]
budgets: [{generations: 2}]
""",
    """\
problem: {outside: ignore, objectives: [rms_error, triangles]}
problems:
  - name: roof
    model: "roof:5"
    pin: [0, 3]
    max_triangles: 20
algorithms:
  - preset: nsga2_v2
    parameters: {pop_size: 4}
    operators: {crossover: {name: oax, arrays: L4}, mutation: neighbour_shift}
seeds: &s [1]
budgets:
  - {name: short, evaluations: 8}
  - seconds: 0.01
baselines: {methods: [quadric_collapse, thinning], steps: 3, down_to_fronts: no}
""",
    """\
folder: scans
problems: ["plane:3", {name: grid, model: a.asc, spacing: [1.0, 2.0], window: [1, 1, 4, 4]}]
algorithms:
  - {name: MD, preset: moead, parameters: {pop_size: 4}}
  - {name: GA, preset: weighted_ga_v1, parameters: {pop_size: 4}, merged_over: {w: [0.0, 1.0]}}
  - name: S
    class: pymoo.algorithms.moo.spea2.SPEA2
    parameters: {pop_size: 4}
seeds: [7]
budgets: [{generations: 1}]
""",
)


def heights() -> np.ndarray:
    """Return the hill."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    return np.round(10 * np.exp(-((x - 2.3) ** 2 + (y - 1.8) ** 2) / 4), 3)


@cache
def good_files() -> tuple[tuple[str, bytes], ...]:
    """Return (suffix, content) of one good file or more of every kind that is read."""
    import trimesh

    from meshsimp_pymoo.formats.source.heights import grid_source

    source = grid_source(heights(), 2.0, 3.0)
    points, faces = source.points, source.faces
    mesh = trimesh.Trimesh(points, faces, process=False)
    kinds: list[tuple[str, Any]] = [
        ("ply", _ply(points, faces, "ascii")),
        ("ply", _ply(points, faces, "<")),
        ("ply", _ply(points, faces, ">")),
        ("ply", _ply(points, faces, "<", mixed=True)),
        ("obj", mesh.export(file_type="obj")),
        ("stl", mesh.export(file_type="stl")),
        ("stl", mesh.export(file_type="stl_ascii")),
        ("off", mesh.export(file_type="off")),
        ("glb", mesh.export(file_type="glb")),
        ("asc", _asc()),
        ("npy", _npy()),
        ("npz", _npz(np.savez)),
        ("npz", _npz(np.savez_compressed)),
        ("xyz", "\n".join(" ".join(map(str, row)) for row in points.tolist())),
        ("csv", "x,y,z\n" + "\n".join(",".join(map(str, row)) for row in points.tolist())),
        *[("tif", content) for content in _tiffs()],
        *_las(points),
    ]
    return tuple((suffix, text.encode() if isinstance(text, str) else bytes(text)) for suffix, text in kinds)


@cache
def good_lines() -> tuple[tuple[str, bytes], ...]:
    """Return (suffix, content) of one good file or more of every kind whose lines are read."""
    hard, soft = [[1.5, 2.5, 3.0], [4.0, 5.25, 6.0], [7.0, 8.0, 9.5]], [[0.0, 0.0], [1.0, 2.0]]
    found = [(suffix, text.encode()) for suffix, text in _line_texts(hard, soft)]
    edges = np.array([[0, 1], [1, 2]], "<i4").tobytes()
    head = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
        "property double z\nelement edge 2\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    )
    found.append(("ply", head.encode() + np.array(hard, "<f8").tobytes() + edges))
    return (*found, *_features(hard, soft), *_drawings(hard, soft))


def _line_texts(hard: list[list[float]], soft: list[list[float]]) -> list[tuple[str, str]]:
    geometries: list[dict[str, Any]] = [
        {"type": "LineString", "coordinates": soft},
        {"type": "MultiLineString", "coordinates": [hard, soft]},
        {"type": "Polygon", "coordinates": [[*hard, hard[0]]]},
    ]
    features: list[dict[str, Any]] = [
        {"type": "Feature", "id": k, "properties": {"name": f"n{k}"}, "geometry": geometry}
        for k, geometry in enumerate([*geometries, {"type": "GeometryCollection", "geometries": geometries}])
    ]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    rows = " ".join(f"{y!r} {x!r} {z!r}" for x, y, z in hard)
    xml = (
        '<?xml version="1.0" encoding="UTF-8"?><LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2"><Units>'
        '<Metric linearUnit="meter"/></Units><CoordinateSystem epsgCode="25832"/><Surfaces><Surface name="a">'
        f'<SourceData><Breaklines><Breakline name="b"><PntList3D>{rows}</PntList3D></Breakline><Breakline>'
        "<PntList2D>0 0 1 2</PntList2D></Breakline></Breaklines></SourceData></Surface></Surfaces></LandXML>"
    )
    obj = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in hard) + "f 1 2 3\nl 1 2 3\nl -1 -3\n"
    return [
        ("geojson", json.dumps({"type": "FeatureCollection", "crs": crs, "features": features})),
        ("obj", obj),
        ("xml", xml),
    ]


def _features(hard: list[list[float]], soft: list[list[float]]) -> list[tuple[str, bytes]]:
    try:
        from pyogrio.raw import write
    except ImportError:
        return []
    geometry = [
        struct.pack("<BII", 1, number, len(line)) + np.array(line, "<f8").tobytes()
        for number, line in ((1002, hard), (2, soft))
    ]
    content = io.BytesIO()
    write(
        content,
        np.array([*geometry, None], object)[:2],
        [np.array(["a", "b"], object)],
        ["name"],
        geometry_type="Unknown",
        crs="EPSG:25832",
        driver="GPKG",
        layer="a",
    )
    return [("gpkg", content.getvalue())]


def _drawings(hard: list[list[float]], soft: list[list[float]]) -> list[tuple[str, bytes]]:
    try:
        import ezdxf
    except ImportError:
        return []
    drawing = ezdxf.new("R12", units=0)  # which knows none
    space = drawing.modelspace()
    space.add_polyline3d(hard)
    space.add_line(*hard[:2])
    space.add_polyline2d([(*soft[0], 0.5), soft[1]], format="xyb")
    text = io.StringIO()
    drawing.write(text)
    # without the tables, of which there is far more than of lines
    entities = text.getvalue().partition("  2\nENTITIES\n")[2]
    return [("dxf", f"  0\nSECTION\n  2\nENTITIES\n{entities}".encode())]


def line_case(rng: np.random.Generator) -> tuple[str, bytes]:
    """Return the suffix and content of a damaged file of lines."""
    files = good_lines()
    suffix, content = files[rng.integers(len(files))]
    return suffix, mutated(rng, content, files[rng.integers(len(files))][1])


def _ply(points: np.ndarray, faces: np.ndarray, order: str, *, mixed: bool = False) -> bytes:
    name = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {name} 1.0\ncomment made here\nelement vertex {len(points)}\nproperty double x\n"
        "property double y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        f"element face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    if order == "ascii":
        rows = [f"{x!r} {y!r} {z!r} 1 2 3" for x, y, z in points.tolist()]
        rows += [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
        return (head + "\n".join(rows) + "\n").encode()
    body = b"".join(struct.pack(f"{order}2df3B", *row, 1, 2, 3) for row in points.tolist())
    for k, face in enumerate(faces.tolist()):
        corners = [*face, face[0]] if mixed and k == 3 else face
        body += struct.pack(f"{order}B{len(corners)}i", len(corners), *corners)
    return head.encode() + body


def _asc() -> str:
    rows = "\n".join(" ".join(map(str, row)) for row in heights().tolist())
    head = f"ncols {COLUMNS}\nnrows {ROWS}\nxllcorner 1000.5\nyllcorner 2000\ncellsize 10\nNODATA_value -9999\n"
    return head + rows + "\n"


def _npy() -> bytes:
    content = io.BytesIO()
    np.save(content, heights())
    return content.getvalue()


def _npz(save: Any) -> bytes:
    content = io.BytesIO()
    save(content, elevation=heights().astype(np.float32), dx=10.0, dy=5.0)
    return content.getvalue()


def _tiffs() -> list[bytes]:
    try:
        import rasterio
        from affine import Affine
        from rasterio.io import MemoryFile
    except ImportError:
        return []
    found = []
    whole = np.kron(heights(), np.ones((4, 4)))
    tiled = {"compress": "lzw", "tiled": True, "blockxsize": 16, "blockysize": 16}
    for options in ({}, {"compress": "deflate"}, tiled):
        with rasterio.Env(), MemoryFile() as memory:
            look = {"height": whole.shape[0], "width": whole.shape[1], "count": 1, "dtype": "float32"}
            look |= {"nodata": -9999.0, "crs": "EPSG:25832", "transform": Affine(*PLACE)}
            with memory.open(driver="GTiff", **look, **options) as raster:
                raster.write(whole.astype(np.float32), 1)
            found.append(memory.read())
    return found


def _las(points: np.ndarray) -> list[tuple[str, bytes]]:
    try:
        import laspy
    except ImportError:
        return []
    found = []
    for packed in (False, True):
        header = laspy.LasHeader(point_format=3, version="1.2")
        header.scales = [0.001] * 3
        cloud = laspy.LasData(header)
        cloud.x, cloud.y, cloud.z = points.T
        content = io.BytesIO()
        cloud.write(content, do_compress=packed, laz_backend=laspy.LazBackend.Lazrs if packed else None)
        found.append(("laz" if packed else "las", content.getvalue()))
    return found


@cache
def good_front() -> tuple[tuple[str, bytes], ...]:
    """Return the files of a stored front of three solutions."""
    import tempfile
    from pathlib import Path

    from meshsimp_pymoo.opening import open_model
    from meshsimp_pymoo.storage import write_front
    from meshsimp_pymoo.surface.height import HeightSurface

    surface = HeightSurface(open_model("roof:5"))
    kept = np.random.default_rng(1).random((3, surface.n_vertices)) < 0.5
    kept |= surface.pinned
    found = [surface.simplify(row) for row in kept]
    with tempfile.TemporaryDirectory() as scratch:
        folder = write_front(
            Path(scratch) / "out",
            surface,
            [s.quality for s in found],
            kept,
            faces=lambda row: found[row].faces,
            free=[None, found[1].faces, found[2].faces],
            series={"another": [[2.5, 2], [1.0, 7]]},
            run={"settings": {"up": "auto"}, "seed": 1},
        )
        names = ("front.csv", "front.npz", "run.json", "series.csv")
        return tuple((name, (folder / name).read_bytes()) for name in names)


def file_case(rng: np.random.Generator) -> tuple[str, bytes]:
    """Return the suffix and content of a damaged file."""
    files = good_files()
    suffix, content = files[rng.integers(len(files))]
    other = files[rng.integers(len(files))][1]
    return suffix, mutated(rng, content, other)


def config_case(rng: np.random.Generator) -> bytes:
    """Return a damaged configuration: damaged as a text of words, sometimes as bytes too."""
    text = CONFIGS[rng.integers(len(CONFIGS))]
    for _ in range(rng.geometric(0.6)):
        text = _misspelt(rng, text)
    content = text.encode()
    return mutated(rng, content, content) if rng.random() < 0.1 else content


def result_case(rng: np.random.Generator) -> dict[str, bytes]:
    """Return the files of a stored front, one of them damaged."""
    files = dict(good_front())
    name = list(files)[rng.integers(len(files))]
    files[name] = mutated(rng, files[name], json.dumps({"solutions": 3}).encode())
    return files


def _misspelt(rng: np.random.Generator, text: str) -> str:
    word = YAML_WORDS[rng.integers(len(YAML_WORDS))]
    if rng.random() < 0.7:  # a word or number for another one, which is often YAML still
        words = list(re.finditer(r"[\w.]+", text))
        if words:
            at = words[rng.integers(len(words))]
            instead = word if rng.random() < 0.7 else WORDS[rng.integers(len(WORDS))].decode("utf-8", errors="replace")
            return text[: at.start()] + instead + text[at.end() :]
    words = list(re.finditer(r"[\w.]+|[\[\]{}:,&*]|\n *", text))
    if not words:
        return word
    at = words[rng.integers(len(words))]
    to = words[rng.integers(len(words))]
    way = rng.integers(6)
    if way == 0:
        return text[: at.start()] + text[at.end() :]
    if way == 1:
        return text[: at.start()] + to[0] + text[at.end() :]
    if way == 2:
        return text[: at.end()] + " " + word + text[at.end() :]
    if way == 3:
        low, high = sorted((at.start(), to.end()))
        return text[:high] + text[low:]
    if way == 4:
        low, high = sorted((at.start(), to.end()))
        return text[:low] + text[high:]
    return text[: at.start()] + word + text[at.end() :]


def mutated(rng: np.random.Generator, content: bytes, other: bytes) -> bytes:
    """Return content damaged once or a few times."""
    for _ in range(min(rng.geometric(0.6), 6)):
        content = _damaged(rng, content, other)
    return content


def _damaged(rng: np.random.Generator, content: bytes, other: bytes) -> bytes:
    n = len(content)
    if n == 0:
        return other[:10]
    # half of the damage hits the beginning, where headers are
    reach = n if rng.random() < 0.5 else min(n, 400)
    at, size = int(rng.integers(reach)), int(rng.integers(1, 9))
    way = rng.integers(11)
    if way == 0:  # a bit
        return content[:at] + bytes([content[at] ^ (1 << int(rng.integers(8)))]) + content[at + 1 :]
    if way == 1:  # bytes
        return content[:at] + rng.bytes(size) + content[at + size :]
    if way in (2, 3):  # a number, in binary
        number = INTEGERS[rng.integers(len(INTEGERS))]
        width = int(rng.choice([1, 2, 4, 8]))
        spelled = (number % (1 << 8 * width)).to_bytes(width, "little" if rng.random() < 0.7 else "big")
        return content[:at] + spelled + content[at + width :]
    if way in (4, 5):  # a number, in text
        numbers = list(re.finditer(rb"[+-]?\d[\d.eE+-]*", content[at : at + 300]))
        word = WORDS[rng.integers(len(WORDS))]
        if not numbers:
            return content[:at] + word + content[at:]
        hit = numbers[rng.integers(len(numbers))]
        return content[: at + hit.start()] + word + content[at + hit.end() :]
    if way == 6:  # cut off
        return content[: int(rng.integers(n))]
    if way == 7:  # a piece is missing
        return content[:at] + content[at + int(rng.integers(1, 200)) :]
    if way == 8:  # a piece is there again
        return content[: at + size] + content[max(0, at - int(rng.integers(200))) :]
    if way == 9:  # a piece of something else
        start = int(rng.integers(len(other)))
        return content[:at] + other[start : start + int(rng.integers(1, 100))] + content[at:]
    swap = int(rng.integers(n))
    low, high = sorted((at, swap))
    return content[:low] + content[high : high + size] + content[low:high] + content[high + size :]
