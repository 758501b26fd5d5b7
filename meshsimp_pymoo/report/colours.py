"""What colours the meshes on a page: ramps for numbers, and the image of a model."""

from __future__ import annotations

import base64
import io
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from meshsimp_pymoo.errors import reason_of

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.material import Material

__all__ = ["SCALE_QUANTILE", "embedded_image", "hypsometric", "magma"]

# Colours of the error in all pictures: pale where it is small. The darkest ones would be lost on a dark page.
COLOUR_MAP, DARKEST, COLOURS = "magma_r", 0.9, 128
# They end where this share of the vertices are below: a few spikes do not pale all the rest.
SCALE_QUANTILE = 0.98
# Colours of heights, as maps have them from lowland to snow. Each is lighter than the one before, so that they are in
# order whatever colours people see.
HEIGHTS = ("#35626b", "#5d8a66", "#a3a163", "#d6bc8c", "#f7f1e6")
# An image is embedded as it is if its file takes at most so much and its sides are no longer: what graphics cards take.
IMAGE_BYTES, IMAGE_SIDE = 3_000_000, 4096
# Else it is made smaller, to sides of so many pixels, the first that fits.
SMALLER_SIDES = (2048, 1024, 512)
QUALITY = 85
# A file that unpacks to more pixels is not unpacked.
MOST_PIXELS = 200_000_000


@cache
def magma() -> list[list[int]]:
    """Return the colours of the error, from none to the end of the scale: (r, g, b) from 0 to 255."""
    from matplotlib import colormaps

    rgb = colormaps[COLOUR_MAP](np.linspace(0.0, DARKEST, COLOURS))[:, :3]
    return np.rint(255 * rgb).astype(int).tolist()


@cache
def hypsometric() -> list[list[int]]:
    """Return the colours of heights, from the lowest to the highest: (r, g, b) from 0 to 255."""
    known = np.array([[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for colour in HEIGHTS])
    at, places = np.linspace(0, len(known) - 1, COLOURS), np.arange(len(known))
    return np.rint([np.interp(at, places, channel) for channel in known.T]).T.astype(int).tolist()


def embedded_image(material: Material) -> tuple[dict[str, str] | None, str]:
    """Return the image of a model as the page embeds it, and a word on what was done to it.

    Parameters
    ----------
    material : Material
        One with an image.

    Returns
    -------
    embedded : dict, optional
        The ``image`` as an address that is its own content, and the ``colour`` that multiplies it, as CSS has it. None
        if it cannot be read.
    word : str
        What to tell; empty if it is all there.
    """
    try:
        kind, content, word = _small_enough(material)
    except (OSError, ValueError, SyntaxError) as error:  # whatever Pillow finds wrong
        return None, f"The texture of the model cannot be read ({reason_of(error)}); its meshes are shown without it."
    image = f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
    red, green, blue = (round(255 * min(max(share, 0.0), 1.0)) for share in material.color[:3])
    return {"image": image, "colour": f"rgb({red}, {green}, {blue})"}, word


def _small_enough(material: Material) -> tuple[str, bytes, str]:
    """Return the media type and the file of an image that a page can hold, and a word if it is a smaller one."""
    from PIL import Image

    with Image.open(io.BytesIO(material.image)) as image:
        width, height = image.size
        if width * height > MOST_PIXELS:
            raise ValueError(f"it has {width} x {height} pixels")
        if len(material.image) <= IMAGE_BYTES and max(width, height) <= IMAGE_SIDE:
            image.load()  # whole, or it is refused
            return material.media_type, material.image, ""
        for side in SMALLER_SIDES:
            smaller = image.convert("RGB")
            smaller.thumbnail((side, side), Image.Resampling.LANCZOS)
            stream = io.BytesIO()
            smaller.save(stream, "JPEG", quality=QUALITY)
            if stream.tell() <= IMAGE_BYTES:
                break
    word = (
        f"The texture of the model has {width:,} x {height:,} pixels; it is shown here with "
        f"{smaller.width:,} x {smaller.height:,} of them. Meshes that are written keep all."
    )
    return "image/jpeg", stream.getvalue(), word
