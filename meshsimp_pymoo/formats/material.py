"""What a surface looks like beside its vertices' colours: one material, with a colour and an image."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

# How the files of the images begin that every format with materials can hold, by suffix.
IMAGES = {".png": b"\x89PNG\r\n\x1a\n", ".jpg": b"\xff\xd8\xff"}
MEDIA_TYPES = {".png": "image/png", ".jpg": "image/jpeg"}
# What is put beside meshes: images, and libraries of materials.
TEXTURE, LIBRARY = "texture", "material.mtl"
CHECKSUM_DIGITS = 16


@dataclass(frozen=True)
class Material:
    """The material of all faces of a mesh, as far as OBJ and glTF both know it.

    Parameters
    ----------
    name : str
        What its file calls it.
    color : (float, float, float, float)
        Red, green, blue and opacity in 0..1, which multiply those of the image.
    image : bytes
        The file of its image, PNG or JPEG, byte by byte; empty: none. Where on it a vertex lies is its attribute
        ``uv`` (V, 2), from the lower left corner (0, 0) to the upper right one (1, 1).
    """

    name: str = "material"
    color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    image: bytes = b""

    @property
    def suffix(self) -> str:
        """The suffix of its image's file; empty: none that is known."""
        return next((suffix for suffix, magic in IMAGES.items() if self.image.startswith(magic)), "")

    @property
    def media_type(self) -> str:
        """What its image is called in networks; of none that is known an error."""
        return MEDIA_TYPES[self.suffix]

    def put_image(self, folder: Path) -> str:
        """Write the image into a folder unless it is there, and return its file's name."""
        return put_beside(folder, f"{TEXTURE}{self.suffix}", self.image)


def put_beside(folder: Path, name: str, content: bytes) -> str:
    """Write what a mesh's file refers to beside it, and return the name that it has there.

    The name holds a checksum of the content: meshes of one folder share the file, and none of another content is ever
    in its way.
    """
    from meshsimp_pymoo.files import new_file

    stem, dot, suffix = name.partition(".")
    name = f"{stem}-{hashlib.sha256(content).hexdigest()[:CHECKSUM_DIGITS]}{dot}{suffix}"
    path = folder / name
    if not path.is_file() or path.stat().st_size != len(content):
        with new_file(path) as unfinished:
            unfinished.write_bytes(content)
    return name


def is_put_beside(name: str) -> bool:
    """Tell whether a file's name is one that :func:`put_beside` gave to an image or a library.

    >>> is_put_beside("texture-0123456789abcdef.png"), is_put_beside("texture.png")
    (True, False)
    """
    stems = {TEXTURE: "|".join(map(re.escape, IMAGES)), Path(LIBRARY).stem: re.escape(Path(LIBRARY).suffix)}
    return any(re.fullmatch(rf"{stem}-[0-9a-f]{{{CHECKSUM_DIGITS}}}(?:{ends})", name) for stem, ends in stems.items())
