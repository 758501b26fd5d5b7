"""Fronts of a model with break lines: what the lines cost, and what they are worth."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pymoo.optimize import minimize

from meshsimp_pymoo import MeshProblem, Moves, memetic
from meshsimp_pymoo.datasets import load_lines
from meshsimp_pymoo.plane.faces import edge_table

TOLERANCE = 0.3
TRIANGLES = 1124


def searched(problem):
    return minimize(problem, memetic(24), Moves(150_000), seed=1)


def best(result, triangles):
    fits = np.flatnonzero(result.F[:, 1] <= triangles)
    return result.X[fits[np.argmin(result.F[fits, 0])]]


@pytest.fixture(scope="module")
def lined():
    return MeshProblem("embankment", break_lines=load_lines("embankment").lines, line_tolerance=TOLERANCE)


@pytest.fixture(scope="module")
def front(lined):
    return searched(lined)


def test_every_mesh_of_a_front_has_all_forced_edges_and_keeps_to_the_tolerance(lined, front):
    forced = lined.model.lines.segments @ [lined.n_var, 1]
    assert len(front.X) > 15
    for row in front.X:
        mesh = lined.simplify(row)
        assert np.isin(forced, edge_table(mesh.faces).ends @ [lined.n_var, 1]).all()
        assert 0.0 <= mesh.quality.line_mean_error <= mesh.quality.line_max_error <= TOLERANCE


def test_lines_cost_little_and_less_than_the_same_vertices_without_them(lined, front):
    free = MeshProblem(dataclasses.replace(lined.model, lines=None))
    kept = best(front, TRIANGLES)
    error = lined.quality(kept).error
    assert error <= 1.16 * free.quality(best(searched(free), TRIANGLES)).error
    assert error <= free.quality(kept).error


def test_thinned_lines_allow_smaller_meshes_than_all_their_vertices(lined, front):
    whole = MeshProblem("embankment", break_lines=lined.surface.rules.break_lines, line_tolerance=0.0)
    assert front.F[:, 1].min() <= 0.7 * whole.quality(whole.pinned).triangles
