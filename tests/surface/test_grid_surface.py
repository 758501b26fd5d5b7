"""The surface of a grid read by windows is the height surface of the same grid, and its arrays are made by number."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshsimp_pymoo.errors import ModelError, ResultError
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.opening import open_grid, open_model
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.nested import Chromosomes, Nested
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.weld import measure, weld


@pytest.fixture(scope="module", params=["windows", "model"])
def pair(request, tmp_path_factory):
    """Return a grid's surface, the height surface of the same file, and the vector row of each sample there."""
    path = tmp_path_factory.mktemp("grid") / "z.npy"
    np.save(path, np.random.default_rng(1).normal(size=(9, 13)))
    model = open_model(path)
    grid = open_grid(path) if request.param == "windows" else open_grid(model)
    return GridSurface(grid), HeightSurface(model), np.argsort(model.source_index)


def test_all_that_is_known_of_a_vertex_is_that_of_the_whole_model(pair):
    surface, whole, row_of = pair
    assert np.asarray(surface.points) == pytest.approx(whole.points[row_of], abs=1e-12)
    np.testing.assert_array_equal(np.asarray(surface.places), whole.places[row_of])
    np.testing.assert_array_equal(np.asarray(surface.model.file_points), whole.model.file_points[row_of])
    np.testing.assert_array_equal(surface.model.file_box, whole.model.file_box)
    np.testing.assert_array_equal(np.asarray(surface.model.source_index), np.arange(surface.n_vertices))
    np.testing.assert_array_equal(surface.pinned, whole.pinned[row_of])
    assert surface.diagonal == pytest.approx(whole.diagonal)
    assert surface.view.extent == pytest.approx(whole.view.extent)
    np.testing.assert_array_equal(np.sort(row_of[surface.border]), whole.border)
    mine = {frozenset(row_of[face].tolist()) for face in np.asarray(surface.faces)}
    assert mine == {frozenset(face) for face in whole.faces.tolist()}
    indptr, indices = surface.neighbours
    ends, others = whole.neighbours
    for sample, row in enumerate(row_of):
        mine = row_of[indices[indptr[sample] : indptr[sample + 1]]]
        assert sorted(mine) == others[ends[row] : ends[row + 1]].tolist()


@given(seed=st.integers(0, 2**32), share=st.sampled_from([0.0, 0.2, 0.7]))
def test_a_subset_has_the_mesh_and_the_error_of_the_whole_model(pair, seed, share):
    surface, whole, row_of = pair
    kept = (np.random.default_rng(seed).random(surface.n_vertices) < share) | surface.pinned
    there = np.zeros_like(kept)
    there[row_of] = kept
    mine, known = surface.simplify(kept), whole.simplify(there)
    assert mine.deviation == pytest.approx(known.deviation[row_of], abs=1e-12)
    assert dataclasses.asdict(mine.quality) == pytest.approx(
        dataclasses.asdict(known.quality), rel=1e-9, abs=1e-12, nan_ok=True
    )
    assert {frozenset(row_of[face].tolist()) for face in mine.faces} == {frozenset(f) for f in known.faces.tolist()}
    np.testing.assert_array_equal(surface.triangles(kept), mine.faces)
    table = surface.evaluate(kept[None])
    assert table[0] == pytest.approx(whole.evaluate(there[None])[0], abs=1e-12)
    vertices = np.asarray(surface.model.file_points)
    scored = surface.score(vertices, mine.faces)
    assert scored.deviation == pytest.approx(mine.deviation, abs=1e-12)
    assert scored.quality.surface_error == pytest.approx(mine.quality.surface_error, rel=1e-9, abs=1e-12)


def test_between_the_samples_of_a_model_its_own_faces_count_however_they_are_cut():
    z = np.random.default_rng(3).normal(size=(6, 8))
    source = grid_source(z, 2.0, 3.0)
    faces = []
    for k, nw in enumerate(8 * row + column for row in range(5) for column in range(7)):
        sw, se, ne = nw + 8, nw + 9, nw + 1
        faces += [[nw, sw, ne], [sw, se, ne]] if k % 3 else [[nw, sw, se], [nw, se, ne]]
    model = build_model(dataclasses.replace(source, faces=np.array(faces), name="cut"), up="z")
    surface, whole, row_of = GridSurface(open_grid(model)), HeightSurface(model), np.argsort(model.source_index)
    usual = GridSurface(open_grid(z, spacing=(2.0, 3.0)))
    for share in (0.0, 0.3):
        kept = (np.random.default_rng(5).random(surface.n_vertices) < share) | surface.pinned
        there = np.zeros_like(kept)
        there[row_of] = kept
        mine, known = surface.simplify(kept).quality, whole.simplify(there).quality
        assert mine.surface_error == pytest.approx(known.surface_error, rel=1e-9)
        assert mine.error == pytest.approx(usual.simplify(kept).quality.error, rel=1e-9)
        assert mine.surface_error != pytest.approx(usual.simplify(kept).quality.surface_error, rel=1e-3)


def test_the_numbers_of_a_grid_s_mesh_do_not_depend_on_the_threads_nor_on_the_bands(pair, monkeypatch):
    surface, _, _ = pair
    kept = (np.random.default_rng(2).random(surface.n_vertices) < 0.2) | surface.pinned
    mesh = weld(surface.model, np.flatnonzero(kept))
    found = [measure(surface.model, mesh, n_threads=n) for n in (1, 2, 5, 30)]
    monkeypatch.setattr("meshsimp_pymoo.surface.grid.BAND_SAMPLES", 40)
    found += [measure(surface.model, mesh, n_threads=n) for n in (1, 2, 5)]
    assert found == found[:1] * 7


def test_what_a_grid_read_by_windows_does_not_know_is_refused(pair):
    surface, _, _ = pair
    for name, value in (("measure", "rms_error"), ("weights", [1.0]), ("pin", "hull")):
        with pytest.raises(ModelError, match=f"{name}=.* is not for a grid read by windows"):
            GridSurface(surface.model, Rules(**{name: value}))
    assert GridSurface(surface.model, Rules(footprint="hull", outside="ignore")).rules.footprint == "hull"
    assert surface.ground() is None
    with pytest.raises(ModelError, match="has no moves"), surface.books(surface.pinned):
        pass
    with pytest.raises(ValueError, match="leave regions out"):
        surface.evaluate(surface.pinned[None], regions=3)
    with pytest.raises(ValueError, match=r"has shape \(117,\), one entry a sample, not \(5,\)"):
        surface.triangles(np.ones(5, bool))


NESTED = Nested(
    np.array([7, 3, 5, 1]),
    np.array([np.inf, 2.0, 1.0, np.inf]),
    np.array([2.0, 1.0, 0.5]),
    (None, np.array([1, 2, 7]), None),
)


def test_nested_subsets_keep_what_goes_later_or_was_moved():
    assert [NESTED.subset(k).tolist() for k in range(3)] == [[7, 1], [1, 2, 7], [7, 3, 5, 1]]
    assert NESTED.sizes.tolist() == [2, 3, 4]
    assert [NESTED.take([2, 1]).subset(k).tolist() for k in range(2)] == [[7, 3, 5, 1], [1, 2, 7]]
    more = NESTED.with_subset(1, 1.5, None)
    assert [more.subset(k).tolist() for k in range(4)] == [[7, 1], [7, 3, 1], [1, 2, 7], [7, 3, 5, 1]]
    again = Nested.of_arrays(**{"start" if k == "moved_start" else k: v for k, v in NESTED.arrays().items()})
    assert [again.subset(k).tolist() for k in range(3)] == [NESTED.subset(k).tolist() for k in range(3)]


def test_chromosomes_are_made_one_at_a_time():
    grid = open_grid(np.arange(12.0).reshape(3, 4), window=(1, 0, 3, 3))
    chromosomes = Chromosomes(NESTED, grid)
    assert chromosomes.shape == (3, 9)
    assert np.flatnonzero(chromosomes[2]).tolist() == [0, 2, 3, 5]  # 7, 3, 5, 1 of 4 columns, of which 3 are here


@pytest.mark.parametrize("row", [-1, 4, 10**9])
def test_rows_that_a_grid_does_not_have_are_named(row, pair):
    grid = open_grid(np.arange(12.0).reshape(3, 4), window=(1, 0, 3, 3))
    with pytest.raises(ResultError, match=f"has no vertex of row {row}, which the front keeps"):
        grid.samples_of_rows(np.array([1, row]))
    with pytest.raises(ResultError, match="has no vertex of row 1000000"):
        pair[0].model.samples_of_rows(np.array([1, 10**6]))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"level": np.zeros(3)}, "do not fit together"),
        ({"start": np.array([0, 0, 3])}, "do not fit together"),
        ({"start": np.array([0, 5, 3, 3])}, "out of order"),
        ({"slope": np.array([0.5, 1.0, 2.0])}, "out of order"),
        ({"rows": np.array([1.0, 2, 3, 4])}, "other types"),
    ],
)
def test_arrays_that_are_no_nested_front_are_refused(changed, message):
    arrays = {"start" if k == "moved_start" else k: v for k, v in NESTED.arrays().items()}
    with pytest.raises(ValueError, match=message):
        Nested.of_arrays(**arrays | changed)
