"""What is written: a mesh in the frame of the model's file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.reprs import brief

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray

# How reference systems spell their linear units, and what those are [m].
METRES = {
    "metre": 1.0, "meter": 1.0, "m": 1.0, "kilometre": 1000.0, "foot": 0.3048, "ft": 0.3048,
    "us survey foot": 1200 / 3937, "ftus": 1200 / 3937,
}  # fmt: skip


def metres_of(unit: Any) -> float | None:
    """Return what a linear unit is in metres, or None if it is no linear unit or not known.

    >>> metres_of("Metre"), metres_of("foot"), metres_of("degree"), metres_of(None)
    (1.0, 0.3048, None, None)
    """
    return METRES.get(str(unit or "").lower())


@dataclass(frozen=True, eq=False)
class Packed:
    """What compression made of a mesh, whose vertices may be in another order then.

    Attributes
    ----------
    content : bytes
        The compressed mesh.
    columns : dict of str to (V, k) array
        What it unpacks to: the attributes of the vertices as they are stored, by the format's names.
    faces : (M, 3) int array
        The triangles that it unpacks to.
    ids : dict of str to int
        What it calls each of the attributes.
    bits : int
        Bits of a coordinate.
    shift : float
        The longest way by which a vertex moved [m].
    """

    content: bytes
    columns: dict[str, AnyArray]
    faces: IntArray
    ids: dict[str, int]
    bits: int
    shift: float

    @property
    def said(self) -> dict[str, float]:
        """What is said of it beside the mesh, as plain data."""
        return {"bits": self.bits, "moved_by_at_most_m": self.shift}

    def __repr__(self) -> str:
        return f"<Packed: {len(self.faces):,} triangles in {len(self.content):,} bytes, {self.shift:.3g} m off>"


@brief
@dataclass(frozen=True, eq=False)
class OutMesh:
    """A mesh to be written; see :func:`write_mesh` for its parts."""

    vertices: FloatArray
    faces: IntArray
    attributes: dict[str, AnyArray]
    origin: FloatArray | None = None
    georeference: dict[str, Any] = field(default_factory=dict)
    name: str = "surface"
    up: FloatArray | None = None
    material: Material | None = None
    #: Chains of edges of the mesh that are break lines: rows of ``vertices``, in order; with their names.
    lines: tuple[IntArray, ...] = ()
    line_names: tuple[str, ...] = ()
    #: What a GLB says of the mesh in its ``extras``, as plain data.
    extras: Mapping[str, Any] = field(default_factory=dict)
    #: Whether a GLB says normals of its vertices and a material in any case: some viewers show no relief without.
    shaded: bool = False
    #: The same mesh compressed, where the format is to hold that instead; see ``Format.pack``.
    packed: Packed | None = None

    @property
    def uv(self) -> AnyArray | None:
        """Where on an image the vertices (V, 2) lie, if that is known."""
        found = self.attributes.get("uv")
        return found if found is not None and found.ndim == 2 and found.shape[1] == 2 else None

    @property
    def has_image(self) -> bool:
        """Whether it has a material with an image, and its vertices a place there."""
        return self.material is not None and bool(self.material.suffix) and self.uv is not None
