"""2DM: the mesh of SMS, BASEMENT, HEC-RAS and TUFLOW, with a height at each node, which QGIS opens too; written only.

Cards, one a line: ``ND`` a node and ``E3T`` a triangle, both numbered from 1, counter-clockwise as seen from above;
``NS`` a string of nodes, here a break line, whose last node has a minus sign [1]_.

References
----------
.. [1] Aquaveo, "2D Mesh Files *.2dm", XMS Wiki.
"""

from __future__ import annotations

from pathlib import Path

from meshsimp_pymoo.formats.outmesh import OutMesh
from meshsimp_pymoo.formats.table import Format, register

# Numbers in a line of ``NS``, as SMS writes them.
NODES_A_LINE = 10
# What all elements are of: the files hold numbers of materials, and say nothing of them.
MATERIAL = 1


def _write(path: Path, mesh: OutMesh) -> None:
    import numpy as np

    nodes = [f"ND {k} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(mesh.vertices.tolist(), start=1)]
    corners = (np.asarray(mesh.faces, np.int64) + 1).tolist()
    elements = [f"E3T {k} {a} {b} {c} {MATERIAL}" for k, (a, b, c) in enumerate(corners, start=1)]
    strings = []
    for line in mesh.lines:
        numbers = (np.asarray(line, np.int64) + 1).tolist()
        numbers[-1] *= -1
        strings += [
            f"NS {' '.join(map(str, numbers[start : start + NODES_A_LINE]))}"
            for start in range(0, len(numbers), NODES_A_LINE)
        ]
    lines = ["MESH2D", f'MESHNAME "{mesh.name.translate({34: 39, 10: 32, 13: 32})}"', *elements, *nodes, *strings]
    path.write_bytes(("\n".join(lines) + "\n").encode("utf-8"))


register(Format("2dm", (".2dm",), "2DM", write=_write, one_height=True, holds_lines=True))
