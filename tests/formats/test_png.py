"""PNG heightmaps: grey levels, terrain-RGB, transparency, and pictures that are no heights."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from PIL import Image
from pyramid import refusal, write

from meshsimp_pymoo import memory
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.opening import count_samples, open_grid

LEVELS = (np.arange(12, dtype=np.uint16) * 5000).reshape(3, 4)


def png(pixels, **kwargs) -> bytes:
    content = io.BytesIO()
    Image.fromarray(pixels).save(content, "PNG", **kwargs)
    return content.getvalue()


def coloured(number, alpha=None):
    """Return the picture whose colours are the digits of these numbers to the base 256."""
    digits = [number >> 16, number >> 8 & 255, number & 255, *([] if alpha is None else [alpha])]
    return np.stack(digits, axis=-1).astype(np.uint8)


def test_sixteen_bits_of_grey_are_heights_from_north_to_south(tmp_path):
    path = write(tmp_path, "a.png", png(LEVELS))
    source = read_source(path, Options(spacing=(2, 3)))
    assert_array_equal(source.points[[0, 3, 11]], [[0, 0, 0], [6, 0, 15000], [6, -6, 55000]])
    assert len(read_source(path, Options(nodata=55000)).points) == 11
    assert len(read_source(path, Options(window=(1, 1, 2, 2))).points) == 4
    assert count_samples(path) == 12
    assert_array_equal(open_grid(path, spacing=(2, 3)).file_points[np.arange(12)], source.points)


def test_eight_bits_are_read_with_a_word_of_their_steps(tmp_path):
    path = write(tmp_path, "a.png", png((LEVELS // 5000 % 5).astype(np.uint8)))
    with pytest.warns(ModelWarning, match="has 8 bits a sample, 5 different heights in all"):
        assert read_source(path).points[:, 2].max() == 4


@pytest.mark.filterwarnings("ignore:.*far from all others")
@given(heights=st.lists(st.integers(-100_000, 15_000_000), min_size=12, max_size=12))
def test_terrain_rgb_is_decoded_to_the_nearest_number(tmp_path_factory, heights):
    """What a tile stores in decimetres, or in 256ths of a metre, comes back as those very numbers."""
    folder = tmp_path_factory.mktemp("rgb")
    number = np.array(heights).reshape(3, 4)
    path = write(folder, "a.png", png(coloured(number + 100_000)))
    source = read_source(path, Options(encoding="mapbox"))
    assert source.points[:, 2].tolist() == [float(f"{n // 10}.{n % 10}") if n >= 0 else n / 10 for n in heights]
    path = write(folder, "b.png", png(coloured(number % 2**24)))
    source = read_source(path, Options(encoding="terrarium"))
    assert_array_equal(source.points[:, 2], (number % 2**24).ravel() / 256 - 32768)


@pytest.mark.filterwarnings("ignore:.*8 bits a sample")
def test_what_is_transparent_is_no_sample(tmp_path):
    alpha = np.full((3, 4), 255)
    alpha[1, 2], alpha[0, 0] = 0, 1
    number = np.arange(100_000, 100_012).reshape(3, 4)
    colour = write(tmp_path, "a.png", png(coloured(number, alpha)))
    assert_array_equal(read_source(colour, Options(encoding="mapbox")).rows, np.delete(np.arange(12), 6))
    grey = write(tmp_path, "b.png", png(np.stack([number % 7, alpha], axis=-1).astype(np.uint8)))
    assert_array_equal(read_source(grey).rows, np.delete(np.arange(12), 6))
    level = write(tmp_path, "c.png", png(LEVELS, transparency=15000))
    assert_array_equal(read_source(level).rows, np.delete(np.arange(12), 3))
    digits = write(tmp_path, "d.png", png(coloured(number), transparency=(1, 134, 163)))
    assert_array_equal(read_source(digits, Options(encoding="mapbox")).rows, np.delete(np.arange(12), 3))
    assert open_grid(grey).n_vertices == 11


def test_the_lowest_colour_of_a_tile_is_warned_of(tmp_path):
    number = np.arange(100_000, 100_012).reshape(3, 4)
    number[0, 0] = 0
    path = write(tmp_path, "a.png", png(coloured(number)))
    with pytest.warns(ModelWarning, match="1 of 12 heights are -10000, far from all others"):
        read_source(path, Options(encoding="mapbox"))


def test_pictures_that_are_no_heights_are_refused(tmp_path):
    grey = write(tmp_path, "grey.png", png(LEVELS))
    colour = write(tmp_path, "colour.png", png(coloured(LEVELS.astype(int))))
    assert "--encoding mapbox or --encoding terrarium" in refusal(colour)
    assert "leave encoding='mapbox' out" in refusal(grey, encoding="mapbox")
    np.save(tmp_path / "a.npy", LEVELS)
    assert "encoding describes PNG heightmap (.png)" in refusal(tmp_path / "a.npy", encoding="mapbox")
    assert "band describes GeoTIFF" in refusal(grey, band=1)
    palette = Image.fromarray(LEVELS.astype(np.uint8)).convert("P")
    palette.save(tmp_path / "palette.png")
    assert "is a palette PNG" in refusal(tmp_path / "palette.png")
    deep = png(LEVELS).replace(b"\x10\x00", b"\x10\x04", 1)
    assert "grey with transparency PNG of 16 bits" in refusal(write(tmp_path, "deep.png", deep))


def test_damaged_pictures_are_refused(tmp_path):
    content = png(np.random.default_rng(1).integers(0, 65536, (30, 40), np.uint16))
    for size in (*range(1, len(content) - 60, 97), 20):
        refusal(write(tmp_path, "cut.png", content[:size]))
    huge = content[:16] + struct.pack(">II", 40_000, 40_000) + content[24:29]
    huge += struct.pack(">I", zlib.crc32(huge[12:])) + content[33:]
    assert "declares 40000 x 40000 samples in a file of" in refusal(write(tmp_path, "huge.png", huge))


def test_a_picture_is_compared_with_the_memory_before_it_is_unpacked(tmp_path, monkeypatch):
    path = write(tmp_path, "a.png", png(np.zeros((1000, 1000), np.uint16)))
    monkeypatch.setattr(memory, "free_memory", lambda: (10 << 20, float("inf")))
    monkeypatch.setattr("meshsimp_pymoo.formats.png._pixels", None)
    assert "1000 x 1000 samples need about 290 MiB, and 10 MiB are free" in refusal(path)
