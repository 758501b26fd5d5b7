"""What is written: a mesh in the frame of the model's file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshsimp_pymoo.arrays import AnyArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class OutMesh:
    """A mesh to be written; see :func:`write_mesh` for its parts."""

    vertices: FloatArray
    faces: IntArray
    attributes: dict[str, AnyArray]
    origin: FloatArray | None = None
    georeference: dict[str, Any] = field(default_factory=dict)
    name: str = "surface"
