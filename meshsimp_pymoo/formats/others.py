"""Whatever other meshes trimesh knows, which depends on the libraries beside it: read only."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import Format, register

if TYPE_CHECKING:
    from meshsimp_pymoo.formats.source import SourceMesh

# Mesh formats that are archives, and point clouds that trimesh would read with further libraries: neither is read.
ARCHIVES = (".3mf", ".3dxml", ".zae", ".cbor", ".pcd")


def _read(path: Path, name: str, options: Options) -> SourceMesh:
    from meshsimp_pymoo.formats.source.scenes import read_scene

    return read_scene(path, name)


def _known_to_trimesh() -> set[str]:
    from trimesh.exchange.load import mesh_formats

    return {f".{kind}" for kind in mesh_formats() if kind.isalnum()} - set(ARCHIVES)


register(Format("others", (), "other meshes", read=_read, further=_known_to_trimesh))
