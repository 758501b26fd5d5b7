"""What is written: a mesh in the frame of the model's file."""

from __future__ import annotations

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

    @property
    def uv(self) -> AnyArray | None:
        """Where on an image the vertices (V, 2) lie, if that is known."""
        found = self.attributes.get("uv")
        return found if found is not None and found.ndim == 2 and found.shape[1] == 2 else None

    @property
    def has_image(self) -> bool:
        """Whether it has a material with an image, and its vertices a place there."""
        return self.material is not None and bool(self.material.suffix) and self.uv is not None
