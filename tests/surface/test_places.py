"""Several vertices at one place: the highest carries, feet do not count, repeats are the vertex that they repeat."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from samples import random_solutions, stepped_model, surface, write_solutions

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.table import write_mesh
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.search.greedy import thinning
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.pins import pinned_vertices
from meshsimp_pymoo.surface.places import count_places

SIDE = 9
RNG = np.random.default_rng(5)
GRID = grid_source(10 + RNG.random((SIDE, SIDE)), 1.0, 1.0)
RIM = np.r_[
    np.arange(SIDE),
    np.arange(1, SIDE) * SIDE + SIDE - 1,
    SIDE * SIDE - 1 - np.arange(1, SIDE),
    np.arange(SIDE - 2, 0, -1) * SIDE,
]


def skirted(*, order=None):
    """A terrain tile whose rim hangs down to height 0; ``order`` lists its vertices otherwise."""
    n, m = len(GRID.points), len(RIM)
    points = np.vstack([GRID.points, GRID.points[RIM] * [1, 1, 0]])
    k = np.arange(m)
    after = (k + 1) % m
    walls = np.vstack([np.c_[RIM, n + after, n + k], np.c_[RIM, RIM[after], n + after]])
    faces = np.vstack([GRID.faces, walls])
    if order is not None:
        points, faces = points[order], np.argsort(order)[faces]
    return build_source(points, faces, name="skirted")


def walled():
    """A terrace in a plane: a wall stands on the ground, whose vertices at its foot are samples."""
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0))
    low = np.c_[x.ravel(), y.ravel(), np.zeros(16)]
    faces = [(4 * j + i, 4 * j + i + 1, 4 * j + i + 5) for j in range(3) for i in range(3)]
    faces += [(4 * j + i, 4 * j + i + 5, 4 * j + i + 4) for j in range(3) for i in range(3)]
    inner = [5, 6, 10, 9]
    faces = [face for face in faces if not set(face) <= set(inner)]
    points = np.vstack([low, low[inner] + [0, 0, 2]])
    faces += [(16, 17, 18), (16, 18, 19)]
    for k in range(4):
        a, b = inner[k], inner[(k + 1) % 4]
        faces += [(a, b, 16 + (k + 1) % 4), (a, 16 + (k + 1) % 4, 16 + k)]
    return build_source(points, faces, name="terrace")


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_a_skirt_changes_nothing_but_is_said(seed):
    order = None if seed is None else np.random.default_rng(seed).permutation(len(GRID.points) + len(RIM))
    with pytest.warns(ModelWarning, match=r"32 of 113 vertices lie below .* 32 of them, feet of vertical"):
        model = build_model(skirted(order=order), up="z")
    plain = build_model(GRID)
    assert model.found == {"below_others": 32, "feet": 32}
    assert model.total_weight == 81
    whole = surface(model).simplify(np.ones(model.n_vertices, bool)).quality
    assert (whole.error, whole.triangles) == (0.0, 128)
    tops = np.setdiff1d(np.arange(model.n_vertices), model.feet)
    lowest = plain.file_points[:, 2].min()  # heights count from the lowest vertex, there a foot at 0
    assert np.allclose(model.points[tops] - plain.points, [0, 0, lowest], rtol=1e-14)
    assert not np.isin(model.corners, model.feet).any()
    # any subset of the tops is the same mesh with the same error
    kept = np.random.default_rng(3).random(len(tops)) < 0.3
    kept[plain.corners] = True
    mask = np.zeros(model.n_vertices, bool)
    mask[tops[kept]] = True
    mine, theirs = surface(model).simplify(mask).quality, surface(plain).simplify(kept).quality
    assert (mine.triangles, mine.error) == (theirs.triangles, pytest.approx(theirs.error, rel=1e-12))
    assert mine.mean_error == pytest.approx(theirs.mean_error, rel=1e-12)


def test_the_border_of_a_skirted_tile_is_its_rim():
    model = stepped_model(skirted())
    assert_array_equal(np.sort(model.source_index[model.border]), np.sort(RIM))
    assert len(build_model(GRID).border) == len(RIM)
    with pytest.warns(ModelWarning, match="lie below"):
        terrace = build_model(walled(), up="z")
    assert len(terrace.border) == 12, "walls inside bound nothing"


def test_no_mesh_of_thinning_hangs_on_a_foot():
    model = stepped_model(skirted())
    front = thinning(surface(model))
    assert front.error.min() == 0
    plain = thinning(surface(build_model(GRID)))
    best = {t: e for t, e in zip(plain.triangles, plain.error, strict=True)}
    sizes = [t for t in best if t >= 10]
    mine = {t: e for t, e in zip(front.triangles, front.error, strict=True)}
    assert all(mine[t] <= 1.2 * best[t] + 1e-9 for t in sizes if t in mine)


@pytest.mark.parametrize("make", [skirted, walled])
def test_places_are_counted_without_a_model(make):
    found = stepped_model(make()).found
    shifted = make().points + np.array([1e5, -1e6, 3.0])
    assert count_places(shifted, make().faces) == (found["below_others"], found.get("feet", 0))
    assert count_places(GRID.points, GRID.faces) == (0, 0)


def test_the_foot_of_a_wall_that_stands_on_ground_counts():
    with pytest.warns(ModelWarning, match=r"4 of 20 vertices lie below") as said:
        model = build_model(walled(), up="z")
    assert "do not count" not in str(said[0].message)
    assert model.found == {"below_others": 4}
    assert model.total_weight == 20
    # The tops carry, so that the feet below them are 2 off.
    assert surface(model).simplify(np.ones(20, bool)).quality.error == 8.0


def test_feet_have_no_weight_whatever_weights_are_given():
    model = stepped_model(skirted())
    weighted = model.with_weights(np.full(113, 3.0))
    assert weighted.total_weight == 3 * 81
    assert not weighted.weights[model.feet].any()
    only_feet = np.zeros(113)
    only_feet[81:] = 1
    with pytest.raises(ModelError, match="nothing would count"):
        model.with_weights(only_feet)


def soup():
    """The grid with its corners listed face by face."""
    corners = GRID.faces.ravel()
    with pytest.warns(ModelWarning, match="repeat the position"):
        return build_source(GRID.points[corners], np.arange(len(corners)).reshape(-1, 3), name="soup"), corners


def test_a_soup_of_triangles_is_the_mesh_that_it_is_made_of():
    source, _ = soup()
    mine, plain = build_model(source, up="z"), build_model(GRID)
    assert_array_equal(mine.points, plain.points)
    assert mine.found == {"merged": len(source.repeats)}
    a, b = thinning(surface(mine)), thinning(surface(plain))
    assert_array_equal(a.error, b.error)


def test_rows_that_repeat_a_vertex_mean_it():
    source, corners = soup()
    model = build_model(source, up="z")
    repeated, leader = source.repeats[7]
    assert_array_equal(pinned_vertices(model, [int(repeated)]), pinned_vertices(model, [int(leader)]))
    assert model.source_index[pinned_vertices(model, [int(repeated)])].tolist().count(leader) == 1
    values = 1.0 + corners  # the same for each row of a vertex
    assert_array_equal(model.with_weights(values).weights, values[model.source_index])
    values[repeated] += 1
    with pytest.warns(ModelWarning, match="1 weights of rows that repeat another vertex differ"):
        assert_array_equal(model.with_weights(values).weights, values[model.source_index])
    with pytest.raises(ModelError, match="there are 3 weights for 384 rows"):
        model.with_weights([1, 1, 1])


def test_single_precision_far_from_the_origin_is_named_where_it_puts_vertices_together():
    x, y = np.meshgrid(np.arange(20) * 0.3, np.arange(20) * 0.3)
    z = np.random.default_rng(1).random(400)
    points = np.c_[x.ravel() + 500_000.1, y.ravel() + 5_400_000.1, z]
    faces = grid_source(z.reshape(20, 20), 1.0, 1.0).faces
    assert len(np.unique(points.astype(np.float32)[:, :2], axis=0)) == 260
    with pytest.warns(ModelWarning, match=r"140 of 400 .* single precision, here in steps of 0\.5, may have put"):
        model = build_model(build_source(points.astype(np.float32), faces, name="utm.ply"), up="z")
    assert model.found["below_others"] == 140
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        build_model(build_source(points, faces), up="z")


def test_what_was_found_is_stored_and_the_referee_leaves_the_same_out(tmp_path, oracle):
    source = skirted()
    write_mesh(tmp_path / "skirted.ply", source.points, source.faces)
    with pytest.warns(ModelWarning, match="lie below"):
        model = open_model(tmp_path / "skirted.ply")
    folder = write_solutions(tmp_path / "out", model, random_solutions(model))
    assert json.loads((folder / "run.json").read_text())["model"]["found"] == {"below_others": 32, "feet": 32}
    command = [sys.executable, oracle, tmp_path / "skirted.ply", "--front", folder / "front.csv"]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout
    assert "0 wrong" in found.stdout
