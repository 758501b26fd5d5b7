"""PNG heightmaps: grey levels as heights, or terrain-RGB, where three bytes of colour are a height in metres."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from meshsimp_pymoo.errors import ModelError, raise_if_memory, reason_of, warn_of
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, FloatArray
    from meshsimp_pymoo.formats.source import SourceMesh
    from meshsimp_pymoo.formats.source.heights import Grid, PlacedHeights

BEGIN = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR"
# Names and channels of the kinds of pictures, by their number in the header.
KINDS = {0: ("grey", 1), 2: ("colour", 3), 3: ("palette", 1), 4: ("grey with transparency", 2)}
KINDS |= {6: ("colour with transparency", 4)}
# What small pictures may unpack to, whatever their packing.
UNPACKED_FLOOR = 1 << 20
# Heights [m] by encoding, of the number whose three digits to the base 256 are red, green and blue.
ENCODINGS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "mapbox": lambda number: (number - 100_000) / 10,
    "terrarium": lambda number: number / 256 - 32_768,
}


class Look(NamedTuple):
    """What the header of a picture says of it."""

    columns: int
    rows: int
    bits: int
    kind: int


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    return _load(path, name, options).mesh(name, options.window)


def _open_heights(path: Path, name: str, options: Options) -> PlacedHeights:
    return _load(path, name, options, by_windows=True).placed(name, options.window)


def _load(path: Path, name: str, options: Options, *, by_windows: bool = False) -> Grid:
    """Read a picture, row by row from the north; where it is transparent there is no sample."""
    import numpy as np

    from meshsimp_pymoo.files import DEFLATE_LIMIT
    from meshsimp_pymoo.formats.source.heights import check_room, even_grid

    look, size = _look(path, name), path.stat().st_size
    title, channels = KINDS[look.kind]
    is_colour = channels >= 3
    if look.kind == 3 or look.bits < 8 or (look.bits == 16 and channels > 1):
        raise ModelError(
            f"{name}: is a {title} PNG of {look.bits} bits, which is not read as heights; save it as a 16-bit grey one "
            f"without transparency, or as a GeoTIFF (gdal_translate)"
        )
    if is_colour and options.encoding is None:
        raise ModelError(
            f"{name}: is a {title} PNG, whose colours are no heights by themselves; if it is terrain-RGB, say which "
            f"({' or '.join(f'--encoding {each}' for each in ENCODINGS)}), else save it as a 16-bit grey one"
        )
    if not is_colour and options.encoding is not None:
        raise ModelError(
            f"{name}: is a {title} PNG, whose levels are its heights; leave encoding={options.encoding!r} out"
        )
    if look.columns * look.rows * channels * look.bits // 8 > max(UNPACKED_FLOOR, DEFLATE_LIMIT * size):
        raise ModelError(
            f"{name}: declares {look.columns} x {look.rows} samples in a file of {size} bytes; export it again"
        )
    # as decoded, as an array, and the number and height of three bytes
    sample_bytes = 2 * channels * look.bits // 8 + (16 if is_colour else 0)
    check_room((look.rows, look.columns), sample_bytes, options, name, by_windows=by_windows)
    pixels, transparent = _pixels(path, name)
    hidden = np.zeros(pixels.shape[:2], bool)
    if channels in (2, 4):
        hidden = pixels[..., -1] == 0
    elif transparent is not None:
        hidden = (pixels == np.array(transparent)).reshape(*pixels.shape[:2], -1).all(axis=2)
    if options.encoding is not None:
        heights: AnyArray = ENCODINGS[options.encoding](pixels[..., :3].astype(np.float64) @ [65536.0, 256.0, 1.0])
    else:
        heights = pixels if pixels.ndim == 2 else pixels[..., 0]
        if look.bits == 8:
            warn_of(
                f"{name}: has 8 bits a sample, {len(np.unique(heights))} different heights in all, so that slopes are "
                "stairs; take a 16-bit one if there is one"
            )
    if hidden.any():
        heights = np.ma.masked_array(heights, hidden)
    return even_grid(heights, *(options.steps or ()), nodata=options.nodata, name=name)


def _look(path: Path, name: str) -> Look:
    with path.open("rb") as stream:
        head = stream.read(len(BEGIN) + 10)
    look = Look(*struct.unpack(">IIBB", head[len(BEGIN) :].ljust(10, b"\0")))
    if not head.startswith(BEGIN) or look.kind not in KINDS or min(look) < 0 or look.columns * look.rows == 0:
        raise ModelError(f"{name}: is not a PNG picture; check the suffix, or export it again")
    return look


def _pixels(path: Path, name: str) -> tuple[AnyArray, int | tuple[int, ...] | None]:
    """Return all samples of a picture, and the one that is transparent if it says so."""
    import numpy as np
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of sizes, which were looked at
            with Image.open(path, formats=("PNG",)) as picture:
                return np.asarray(picture), picture.info.get("transparency")
    except Image.DecompressionBombError:
        raise ModelError(
            f"{name}: has more samples than pictures are unpacked with; make it a GeoTIFF (gdal_translate), which is "
            "read by windows"
        ) from None
    except MemoryError:
        raise
    except Exception as error:  # a damaged file may break the reader anywhere
        raise_if_memory(error)
        raise ModelError(f"{name}: cannot be read as a PNG ({reason_of(error)}); export it again") from error


def _count_samples(path: Path, name: str) -> int:
    look = _look(path, name)
    return look.columns * look.rows


register(
    Format(
        "png", (".png",), "PNG heightmap", "grid", read=_read, open_heights=_open_heights, count_samples=_count_samples
    )
)
