"""STL: corners become vertices again; what single precision costs; damage."""

from __future__ import annotations

import dataclasses
import struct

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_array_equal
from pyramid import FACES, POINTS, refusal, write
from samples import write_solutions

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.surface.model import build_model


def test_merging_takes_equal_positions_alone_and_zero_has_no_sign(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0], [0, 1, 0], [-1, 0, 1e-30]])
    mesh = trimesh.Trimesh(points, [[0, 1, 2], [3, 4, 5]], process=False)
    source = read_source(write(tmp_path, "a.stl", mesh.export(file_type="stl")))
    assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3]])


def test_a_single_precision_format_says_how_far_it_moves_vertices(tmp_path, solutions):
    source = load("face:200")
    far = build_model(dataclasses.replace(source, points=source.points + np.array([5e6, 4e6, 0])))
    said = r"by up to 0\.[12]\d+ \[model units\]; landxml, obj, off and ply keep them exactly, glb states"
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
