"""What break lines are asked for: files and arrays in the frame of the model's file, or words that find them in it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.outmesh import metres_of
from meshsimp_pymoo.formats.source.lines import SourceLines, build_lines, spelled_name
from meshsimp_pymoo.formats.source.metric import systems_differ
from meshsimp_pymoo.formats.table import read_lines
from meshsimp_pymoo.plane.chains import chains
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.surface.model import Mesh
from meshsimp_pymoo.surface.orient import area_vectors
from meshsimp_pymoo.surface.places import highest
from meshsimp_pymoo.surface.rules import OUTLINE, SHARP, meant_word_for_lines
from meshsimp_pymoo.surface.units import reference_system


def lines_in_file_frame(model: Mesh, given: Any) -> SourceLines:
    """Return lines of a file or of arrays, once it is clear that they are in the frame of the model's file.

    Where only one of both says which reference system it has, the lines are taken to have the model's.

    Parameters
    ----------
    model : Mesh
    given : path, SourceLines, or list of (n, 2) or (n, 3) arrays

    Raises
    ------
    ModelError
        If the file cannot be read, the reference systems or units differ, or these are no lines.
    """
    if isinstance(given, (str, os.PathLike)):
        word = meant_word_for_lines(given)
        if word and not Path(given).exists():
            raise ModelError(f"{given}: no such file of break lines{word}; check the path")
        given = read_lines(given)
    elif isinstance(given, SourceLines):
        given = build_lines(given.name, given.lines, given.names, given.georeference)
    else:
        given = build_lines("break_lines", given, [spelled_name("line", k + 1) for k in range(len(given))])
    if systems_differ(given.georeference, model.georeference):
        raise ModelError(
            f"{given.name}: is in {reference_system(given.georeference)}, and {model.name} in "
            f"{reference_system(model.georeference)}; convert the lines, as by ogr2ogr -t_srs"
        )
    units = [str(georeference.get("unit")) for georeference in (given.georeference, model.georeference)]
    metres = [metres_of(unit) for unit in units]
    if all(metres) and metres[0] != metres[1]:
        raise ModelError(
            f"{given.name}: is in {units[0]}, and {model.name} in {units[1]}; export the lines in the unit of the model"
        )
    return given


def lines_of_word(model: Mesh, word: str) -> list[IntArray]:
    """Return lines of the model's own vertices, as rows, that a word names: its outline, or its sharp edges.

    The outline is the rims of holes, where there is nothing else. Where several vertices share a place, the highest
    stands for them.

    Raises
    ------
    ModelError
        If the word's angle is none, or the model has no such edges.
    """
    if word == OUTLINE:
        rows = chains(_border(model))
        if not rows:
            raise ModelError(
                f"{model.name}: has no outline and no holes whose rims could be break lines; leave "
                f"break_lines={word!r} (--break-lines {word}) out"
            )
        return rows
    try:
        degrees = float(word.removeprefix(SHARP))
    except ValueError:
        degrees = np.nan
    if not 0.0 < degrees < 180.0:
        raise ModelError(f"break_lines={word!r}: no angle; give degrees between 0 and 180, as in 'sharp:30'")
    rows = chains(sharp_edges(model, degrees))
    if not rows:
        raise ModelError(
            f"break_lines={word!r}: no two faces of {model.name} meet at more than {degrees:g} degrees; give fewer"
        )
    return rows


def _border(model: Mesh) -> IntArray:
    """Return the edges (E, 2) of one face only, as seen from above."""
    faces = highest(model.xy)[model.faces]
    table = edge_table(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])
    return table.ends[table.n_triangles == 1]


def sharp_edges(model: Mesh, degrees: float) -> IntArray:
    """Return the edges (E, 2) of two original faces whose normals differ by more than so many degrees.

    Those that are a place in the plane, as upright ones of height surfaces, are left out.
    """
    table = edge_table(model.faces)
    pairs = table.first[table.n_triangles == 2]
    faces = np.column_stack([table.order[pairs], table.order[pairs + 1]]) % len(model.faces)
    # scaled by a power of two, which rounds nothing, so that squares of areas stay in the range of doubles
    points = np.ldexp(model.points, -int(np.frexp(model.diagonal)[1]))
    angle = _angles(area_vectors(points, model.faces), faces)
    edges = highest(model.xy)[table.ends[table.n_triangles == 2][angle > degrees]]
    return edges[edges[:, 0] != edges[:, 1]]


def _angles(normals: FloatArray, pairs: IntArray) -> FloatArray:
    """Return the angles between the normals (T, 3) of pairs (E, 2) of faces [degrees]; 0 where one has no area."""
    one, other = normals[pairs[:, 0]], normals[pairs[:, 1]]
    sine, cosine = np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1)
    return np.degrees(np.arctan2(sine, cosine))
