"""A height grid with gaps that is read by windows means what the same grid in one piece means."""

import dataclasses
import itertools

import numpy as np
import pytest

from meshsimp_pymoo.errors import ModelError, ModelWarning, NoHeightGrid, ResultError
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.opening import open_grid, open_model
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES, Rules
from meshsimp_pymoo.surface.weld import measure, pieces, weld

RULES = list(itertools.product(FOOTPRINTS, OUTSIDES))
Y, X = np.mgrid[:21, :26]
HILLS = 10 * np.sin(X / 7) * np.cos(Y / 5) + np.random.default_rng(1).normal(size=X.shape)

pytestmark = pytest.mark.filterwarnings("ignore:.*belong to no face")


def _without(*gone):
    return np.where(np.logical_or.reduce(gone), np.nan, HILLS)


KINDS = {
    "scattered": _without(np.random.default_rng(2).random(X.shape) < 0.2),
    "in shreds": _without(np.random.default_rng(3).random(X.shape) < 0.45),
    "a void": _without((abs(X - 12) < 7) & (abs(Y - 10) < 6)),
    "islands": _without(((X - 6) ** 2 + (Y - 5) ** 2 > 16) & ((X - 19) ** 2 + (Y - 14) ** 2 > 30)),
    "a bay, a corner": _without((X - 26) ** 2 + 2 * (Y - 10) ** 2 < 200, X + Y < 6),
    "sides without": _without(X < 4, Y > 17),
}


def pair(z, spacing, *, of_model=False):
    """Return a grid with gaps and the model of the same heights."""
    model = build_model(grid_source(z, *spacing), up="z")
    return open_grid(model) if of_model else open_grid(z, spacing=spacing), model


def faces_of(faces, row_of):
    return {frozenset(row_of[face].tolist()) for face in faces}


@pytest.mark.parametrize("of_model", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_all_that_is_known_of_a_vertex_is_that_of_the_model_in_one_piece(kind, of_model):
    grid, model = pair(KINDS[kind], (30.0, 17.3), of_model=of_model)
    surface, whole, row_of = GridSurface(grid), HeightSurface(model), np.argsort(model.source_index)
    assert (surface.n_vertices, surface.total_weight) == (whole.n_vertices, whole.total_weight)
    np.testing.assert_array_equal(np.asarray(grid.source_index), model.source_index[row_of])
    np.testing.assert_array_equal(np.asarray(surface.places), model.xy[row_of])
    np.testing.assert_array_equal(np.asarray(grid.file_points), model.file_points[row_of])
    assert np.asarray(surface.points) == pytest.approx(model.points[row_of], abs=1e-9)
    np.testing.assert_array_equal(grid.file_box, model.file_box)
    np.testing.assert_array_equal(surface.pinned, whole.pinned[row_of])
    np.testing.assert_array_equal(np.sort(row_of[surface.border]), whole.border)
    assert len(surface.faces) == len(whole.faces)
    assert faces_of(np.asarray(surface.faces), row_of) == faces_of(whole.faces, np.arange(len(row_of)))
    some = np.array([len(surface.faces) - 1, 0, 5])
    if not of_model:
        np.testing.assert_array_equal(surface.faces[some], np.asarray(surface.faces)[some])
    rows = np.asarray(grid.source_index)[::3]
    np.testing.assert_array_equal(grid.vertices(grid.samples_of_rows(rows)), np.arange(len(row_of))[::3])
    missing = np.setdiff1d(np.arange(X.size), np.asarray(grid.source_index))
    with pytest.raises(ResultError, match=f"no vertex of row {missing[3]}, which"):
        grid.samples_of_rows(missing[3:4])
    drawn = surface.selection(60)
    assert drawn[surface.pinned].all()
    assert 20 < drawn.sum() <= 60
    assert len(surface.triangles(drawn)) > 10


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (0.1, 0.7), (30.0, 17.3)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_subset_has_the_mesh_and_the_numbers_that_it_has_in_one_piece(kind, spacing):
    grid, model = pair(KINDS[kind], spacing, of_model=spacing == (1.0, 1.0))
    row_of, rng = np.argsort(model.source_index), np.random.default_rng(5)
    for footprint, outside in RULES:
        rules = Rules(footprint=footprint, outside=outside)
        surface, whole = GridSurface(grid, rules), HeightSurface(model, rules)
        for share in (0.0, 0.03, 0.15, 0.5, 1.0):
            kept = (rng.random(surface.n_vertices) < share) | surface.pinned
            there = np.zeros_like(kept)
            there[row_of] = kept
            table = whole.evaluate(there[None])
            np.testing.assert_allclose(surface.evaluate(kept[None]), table, rtol=1e-12, atol=1e-10)
            if table[0, 1] == 0:
                with pytest.raises(ValueError, match="span no triangle of the mesh"):
                    surface.simplify(kept)
                continue
            mine, known = surface.simplify(kept), whole.simplify(there)
            assert faces_of(mine.faces, row_of) == faces_of(known.faces, np.arange(len(row_of)))
            assert dataclasses.asdict(mine.quality) == pytest.approx(
                dataclasses.asdict(known.quality), rel=1e-12, abs=1e-10, nan_ok=True
            )
            np.testing.assert_allclose(mine.deviation, known.deviation[row_of], rtol=1e-11, atol=1e-11)
            np.testing.assert_array_equal(mine.covered, known.covered[row_of])
            some = np.arange(0, len(kept), 7)
            np.testing.assert_array_equal(surface.simplify(kept, rows=some).deviation, mine.deviation[some])
        scored = surface.score(np.asarray(grid.file_points), mine.faces)
        assert scored.quality.error == pytest.approx(mine.quality.error, rel=1e-9, abs=1e-9)
        np.testing.assert_array_equal(scored.covered, mine.covered)


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_depend_neither_on_threads_nor_on_bands(kind, monkeypatch):
    grid, _ = pair(KINDS[kind], (0.1, 0.7))
    kept = np.random.default_rng(4).random(grid.n_vertices) < 0.15
    kept[grid.vertices(grid.corners)] = True
    mesh = weld(grid, grid.numbers(np.flatnonzero(kept)))
    found = [measure(grid, mesh, n_threads=n) for n in (1, 2, 5, 30)]
    monkeypatch.setattr("meshsimp_pymoo.surface.grid.BAND_SAMPLES", 80)
    found += [measure(grid, mesh, n_threads=n) for n in (1, 3)]
    assert found == found[:1] * 6
    assert found[0].uncovered > 0 or kind == "sides without"


def test_pieces_of_a_mesh_over_gaps_are_the_mesh():
    grid, _ = pair(KINDS["islands"], (1.0, 1.0))
    faces = GridSurface(grid).simplify(np.ones(grid.n_vertices, bool)).faces
    parts = list(pieces(grid, faces, 8))
    assert len(parts) > 3
    assert sorted(map(tuple, np.concatenate([part for _, part in parts]).tolist())) == sorted(
        map(tuple, faces.tolist())
    )


def test_samples_that_belong_to_no_face_are_said_and_left_out():
    z = KINDS["a void"].copy()
    z[10, 12] = 1e6
    grid = open_grid(z)
    with pytest.warns(ModelWarning, match=r"grid: 1 of \d+ vertices belong to no face and are left out"):
        assert len(grid.source_index) == grid.n_vertices
    assert grid.n_vertices == open_grid(KINDS["a void"]).n_vertices
    assert grid.heights_range[1] < 1e3
    assert grid.hash != open_grid(KINDS["a void"]).hash


def test_masked_samples_and_those_of_a_window_are_gaps_too():
    z = np.ma.masked_array(np.arange(30).reshape(5, 6), np.arange(30).reshape(5, 6) % 11 == 8)
    grid = open_grid(z, window=(1, 1, 5, 4))
    assert grid.n_vertices == 18
    assert np.asarray(grid.file_points)[:, 2].astype(int).tolist() == np.asarray(grid.source_index).tolist()
    assert 8 not in np.asarray(grid.source_index)


def test_islands_of_a_model_with_an_empty_row_between_them_do_not_grow_together():
    z = HILLS.copy()
    z[8], z[:, 12:14] = np.nan, np.nan
    grid, model = pair(z, (1.0, 2.0), of_model=True)
    assert grid.shape == z.shape
    assert len(grid.faces) == len(model.faces)
    assert grid.n_vertices == open_grid(z, spacing=(1.0, 2.0)).n_vertices


def test_a_model_that_lacks_a_face_of_its_cells_is_no_grid():
    source = grid_source(HILLS[:5, :6])
    model = build_model(source, up="z")
    row_of = np.argsort(model.source_index)
    assert open_grid(dataclasses.replace(model, faces=row_of[source.faces].astype(np.int32))).lattice is None
    twice = source.faces.copy()
    twice[1] = 0, 6, 1  # north-west, south-west, north-east, beside that without the north-east corner
    for faces in (np.delete(source.faces, 7, axis=0), np.r_[source.faces[:-1], source.faces[:1]], twice):
        with pytest.raises(NoHeightGrid, match=r"\d+ faces are not those of a height grid of 5 rows and 6"):
            open_grid(dataclasses.replace(model, faces=row_of[faces].astype(np.int32)))
    model = build_model(grid_source(KINDS["a void"]), up="z")
    with pytest.raises(ModelError, match="has weights"):
        open_grid(model.with_weights(np.full(X.size, 2.0)))


@pytest.mark.parametrize("kind", ["a void", None])
def test_heights_beyond_what_can_be_squared_are_refused_as_in_one_piece(kind):
    z = (HILLS if kind is None else KINDS[kind]) * 1e300
    with pytest.raises(ModelError, match=r"coordinates reach \S+; rescale"):
        build_model(grid_source(z), up="z")
    with pytest.raises(ModelError, match=r"heights reach \S+; rescale the grid to below 1e\+75"):
        _ = open_grid(z).lattice


@pytest.mark.filterwarnings("ignore:.*coordinates are degrees")
def test_a_degree_measures_what_it_does_where_the_samples_are(tmp_path):
    path = tmp_path / "degrees.asc"
    z = np.full((40, 30), -9999.0)
    z[25:, 5:] = 7.0
    z[25:, 5:] += np.random.default_rng(1).normal(size=z[25:, 5:].shape)
    z[3, 3] = 1.0  # belongs to no face
    head = "ncols 30\nnrows 40\nxllcorner 10\nyllcorner 46\ncellsize 0.1\nnodata_value -9999\n"
    path.write_text(head + "\n".join(" ".join(map(str, row)) for row in z))
    grid, model = open_grid(path, scale="degrees"), open_model(path, Options(scale="degrees"))
    assert grid.scale == tuple(model.georeference["scale"])
    kept = np.ones((1, grid.n_vertices), bool)
    kept[:, 60:200] = False
    placed = np.zeros((1, model.n_vertices), bool)
    placed[:, np.argsort(model.source_index)] = kept
    found, known = GridSurface(grid).evaluate(kept), HeightSurface(model).evaluate(placed)
    np.testing.assert_allclose(found, known, rtol=1e-9)
