"""A small mesh, files made of it by hand, and how a file is refused."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source

# A pyramid without its base: five vertices, four faces, and coordinates that no float32 holds.
POINTS = np.array([[0.1, 0.2, 0.3], [1.1, 0, 0], [1, 1.7, 0], [0, 1, 0], [0.5, 0.5, 1 / 3]])

FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])

COLORS = np.array([[1, 2, 3], [9, 8, 7], [50, 60, 70], [255, 0, 255], [0, 9, 0]], np.uint8)
COLORS = np.column_stack([COLORS, np.full(5, 255, np.uint8)])

# A place on an image for each vertex, none of which single precision changes; and an image.
UV = np.array([[0.0, 0.125], [1.0, 0.25], [0.75, 1.0], [0.0, 0.5], [0.5, 0.5]])


def picture(kind: str = "PNG") -> bytes:
    """Return the file of a small image."""
    stream = io.BytesIO()
    Image.new("RGB", (2, 3), (200, 100, 50)).save(stream, format=kind)
    return stream.getvalue()


HEADER = """ply
format {} 1.0
comment made by hand
element vertex 5
property double x
property double y
property double z
property uchar red
property uchar green
property uchar blue
property float quality
property short label
element face 4
property list uchar int vertex_indices
end_header
"""

QUALITY = np.array([0.5, 1.5, -2.0, 3.25, 8.0], np.float32)

LABEL = np.array([-1, 2, -3, 4, 500], np.int16)


def ascii_ply() -> str:
    rows = [
        " ".join([*(repr(float(x)) for x in p), *map(str, c[:3]), str(q), str(label)])
        for p, c, q, label in zip(POINTS, COLORS, QUALITY, LABEL, strict=True)
    ]
    rows += ["3 " + " ".join(map(str, face)) for face in FACES]
    return HEADER.format("ascii") + "\n".join(rows) + "\n"


def binary_ply(order: str = "<") -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    body = b"".join(
        struct.pack(f"{order}3d3Bfh", *p, *map(int, c[:3]), q, label)
        for p, c, q, label in zip(POINTS, COLORS, QUALITY, LABEL, strict=True)
    )
    return HEADER.format(name).encode() + body + b"".join(struct.pack(f"{order}B3i", 3, *f) for f in FACES)


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refusal(path: Path, **kwargs: Any) -> str:
    """Return the message with which a file is refused: one line that names the file."""
    with pytest.raises(ModelError) as caught:
        read_source(path, Options(**kwargs))
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    assert ";" in message, "the message names no way out"
    return message


def hill(rows=9, columns=12):
    y, x = np.mgrid[:rows, :columns]
    return (50 * np.exp(-((x - 4.2) ** 2 + (y - 3.1) ** 2) / 9)).astype(np.float32)


def hostile_array() -> bytes:
    """Return an array file that declares far more than it holds."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    header += b" " * (118 - len(header) - 1) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + b"\0" * 50
