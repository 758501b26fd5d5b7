"""Whether stored fronts are what they say: their meshes measured by another program, and read by other libraries.

`quality.py --referee FILE` uses it on the front of every search. FILE has a function ``vertical_error(points, vertices,
faces)`` that returns the error, the number of uncovered points, and the cost of each point, and that shares no code
with the package.
"""

from __future__ import annotations

import csv
import importlib.util
import tempfile
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import numpy as np
import trimesh

from meshsimp_pymoo import Front

try:
    import pymeshlab
except ImportError:
    pymeshlab = None

# How far the two may differ: by this share, or where the error is nothing by this one of the extent for each point.
TOLERANCE = 1e-6
ROUNDING = 1e-13
# Twice the areas of triangles below this share of the squared extent are computed exactly.
DOUBTFUL = 1e-12


@dataclass
class Checked:
    """What was found of one front."""

    meshes: int
    free: int
    left_out: int
    wrong: list[str] = field(default_factory=list)
    notes: tuple[str, ...] = ()


class Referee:
    """Measures stored fronts by the function of a file, ``most`` meshes of each at most."""

    def __init__(self, path: Path, most: int | None = None) -> None:
        spec = importlib.util.spec_from_file_location("referee", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        self.vertical_error = module.vertical_error
        self.most = most

    def checked(self, front: Front) -> Checked:
        """Write a front, and look at each of its meshes."""
        model = front.model
        points = np.asarray(model.file_points, float)
        corners = points[model.faces]
        area = np.abs(_twice_area(corners))
        between = corners.mean(axis=1)[area > 0.0], area[area > 0.0] / area.sum()
        with tempfile.TemporaryDirectory() as place:
            folder = front.save(Path(place) / "front", meshes=self.most, pictures=False, page=False)
            with (folder / "front.csv").open(newline="", encoding="utf-8") as file:
                rows = [row for row in csv.DictReader(file) if row["mesh"]]
            found = Checked(len(rows), sum(row["free"] == "1" for row in rows), len(front) - len(rows))
            if pymeshlab is None:
                found.notes = ("pymeshlab is not installed: it opened none of the meshes",)
            for row in rows:
                faults = self._faults(points, between, row, folder / row["mesh"])
                found.wrong += [f"{row['mesh']}: {', '.join(faults)}"] if faults else []
        return found

    def _faults(self, points, between, row, path) -> list[str]:
        """Return what is wrong with a mesh that a row of front.csv describes."""
        mesh = trimesh.load(path, process=False, force="mesh")
        vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
        extent = float(np.ptp(points, axis=0).max())
        faults = []
        error = self.vertical_error(points, vertices, faces)[0]
        if not _agree(float(row["error"]), error, ROUNDING * len(points) * extent):
            faults.append(f"error {row['error']}, which is {error:.10g}")
        places, shares = between
        error = float(shares @ self.vertical_error(places, vertices, faces)[2])
        if not _agree(float(row["surface_error"]), error, ROUNDING * extent):
            faults.append(f"surface error {row['surface_error']}, which is {error:.10g}")
        if len(faces) != int(row["triangles"]):
            faults.append(f"{row['triangles']} triangles, which are {len(faces)}")
        return faults + shape_faults(vertices, faces) + opened_faults(path, len(faces))


def _agree(said: float, is_: float, rounding: float) -> bool:
    return abs(said - is_) <= max(TOLERANCE * abs(is_), rounding)


def shape_faults(vertices, faces) -> list[str]:
    """Return whether a mesh is no surface seen from above: edges of more than two faces, faces that are turned over."""
    faults = []
    halfedges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    for what, edges in (("edges have more than two faces", np.sort(halfedges)), ("edges twice in a turn", halfedges)):
        _, count = np.unique(edges, axis=0, return_counts=True)
        most = 2 if edges is not halfedges else 1
        if (count > most).any():
            faults.append(f"{(count > most).sum()} {what}")
    place = np.ascontiguousarray(vertices[faces])
    area = _twice_area(place)
    doubtful = np.abs(area) <= DOUBTFUL * np.ptp(vertices[:, :2], axis=0).max() ** 2
    area[doubtful] = [np.sign(_exact_area(corners)) for corners in place[doubtful]]
    if (area <= 0.0).any():
        faults.append(f"{(area <= 0.0).sum()} faces are not counter-clockwise seen from above")
    return faults


def opened_faults(path, n_faces) -> list[str]:
    """Return whether pymeshlab finds other faces in a file, or edges of more than two."""
    if pymeshlab is None:
        return []
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.load_new_mesh(str(path))
    opened = meshes.current_mesh().face_number()
    faults = [] if opened == n_faces else [f"pymeshlab opens {opened} of {n_faces} faces"]
    crowded = meshes.get_topological_measures()["non_two_manifold_edges"]
    return faults + [f"pymeshlab finds {crowded} edges of more than two faces"] * (crowded > 0)


def _twice_area(corners):
    """Return twice the signed areas in the plane of triangles (M, 3, 3)."""
    (ux, uy), (vx, vy) = (corners[:, 1, :2] - corners[:, 0, :2]).T, (corners[:, 2, :2] - corners[:, 0, :2]).T
    return ux * vy - uy * vx


def _exact_area(corners):
    (ax, ay), (bx, by), (cx, cy) = ((Fraction(x), Fraction(y)) for x, y in corners[:, :2].tolist())
    return float((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
