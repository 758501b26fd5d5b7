"""STL: corners become vertices again; what single precision costs; damage."""

from __future__ import annotations

import dataclasses
import struct
import warnings

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal
from pyramid import FACES, POINTS, refusal, write
from samples import write_solutions

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.storage import write_front, write_solution
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model


def test_merging_takes_equal_positions_alone_and_zero_has_no_sign(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0], [0, 1, 0], [-1, 0, 1e-30]])
    mesh = trimesh.Trimesh(points, [[0, 1, 2], [3, 4, 5]], process=False)
    source = read_source(write(tmp_path, "a.stl", mesh.export(file_type="stl")))
    assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3]])


def test_a_single_precision_format_says_how_far_it_moves_vertices(tmp_path, solutions):
    source = load("face:200")
    far = build_model(dataclasses.replace(source, points=source.points + np.array([5e6, 4e6, 0])))
    said = r"by up to 0\.[12]\d+ \[model units\]; obj, off and ply keep them exactly, glb states"
    with pytest.warns(ModelWarning, match=said):
        write_solutions(tmp_path / "out", far, solutions, mesh_format="stl")


NEEDLE = 1e-9  # of a side of the square


@pytest.mark.parametrize("mesh_format", ["stl", "glb", "ply"])
@pytest.mark.parametrize("turn", [[0, 1, 2], [2, 0, 1]])
def test_triangles_that_single_precision_turns_over_or_flattens_are_counted(tmp_path, mesh_format, turn):
    """Known answer: of a square cut by a diagonal, vertices just off it make two needles."""
    x = np.array([0.0, 1.0, 1.0, 0.0, 0.5, 0.25])
    y = np.array([0.0, 0.0, 1.0, 1.0, 0.5 + NEEDLE, 0.25 - NEEDLE])
    points = np.column_stack([x, y, x * y])[:, turn]
    faces = np.array([[0, 1, 5], [5, 1, 2], [0, 5, 2], [0, 2, 4], [4, 2, 3], [0, 4, 3]])
    surface = HeightSurface(build_model(SourceMesh(points, faces, {}, "square"), up="xyz"[turn.index(2)]))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        write_solution(tmp_path / f"one.{mesh_format}", surface, surface.faces)
        written = [str(warning.message) for warning in said]
        quality = surface.simplify(np.ones(6, bool)).quality
        kept, how = np.ones((1, 6), bool), {"faces": lambda _: surface.faces, "free": [surface.faces]}
        write_front(tmp_path / "out", surface, [quality], kept, chosen=0, mesh_format=mesh_format, **how)
    if mesh_format == "ply":
        assert not said
        return
    way_out = "obj, off and ply keep them exactly" + (", glb states a local origin" if mesh_format == "stl" else "")
    told = f"square: {mesh_format} holds single precision, which turns over or flattens 2 triangles; {way_out}"
    assert written == [told]
    assert [str(warning.message) for warning in said] == [told, told]  # as chosen and as one of the meshes: once


def test_far_from_the_origin_both_are_said(tmp_path, solutions):
    source = load("face:200")
    far = build_model(dataclasses.replace(source, points=source.points + np.array([5e8, 0, 0])))
    said = r"moves vertices by up to 16 \[model units\] and turns over or flattens [\d,]+ triangles; obj"
    with pytest.warns(ModelWarning, match=said):
        write_solutions(tmp_path / "out", far, solutions, mesh_format="stl")


def test_a_damaged_stl_is_refused(tmp_path):
    mesh = trimesh.Trimesh(POINTS, FACES, process=False)
    stl = mesh.export(file_type="stl")
    for size in range(1, len(stl), 7):
        refusal(write(tmp_path, "cut.stl", stl[:size]))
    hostile = stl[:80] + struct.pack("<I", 4_000_000_000) + stl[84:]
    assert "4000000000 triangles" in refusal(write(tmp_path, "hostile.stl", hostile))
    text = mesh.export(file_type="stl_ascii")
    for size in range(1, len(text) - 9, 97):
        refusal(write(tmp_path, "cut.stl", text[:size]))
