"""What lies above what: the same answer from the border as from the faces, in bounded time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from samples import check_open_surface

from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.surface import overlap
from meshsimp_pymoo.surface.orient import FOLD_SHARE, surface_facts
from meshsimp_pymoo.surface.overlap import hidden_faces


def by_faces(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return what is found when the border is not asked."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(overlap, "MOST_LOOPS", 0)
        return hidden_faces(points, faces)


def wall(n: int) -> SourceMesh:
    grid = grid_source(np.random.default_rng(0).random((n, n)) / 2, 1.0, 1.0)
    return build_source(grid.points[:, [0, 2, 1]], grid.faces, name="wall")


def sheets(n: int) -> SourceMesh:
    grid = grid_source(np.zeros((11, 11)), 1.0, 1.0)
    points = np.vstack([grid.points + np.array([0, 0, k]) for k in range(n)])
    return build_source(points, np.vstack([grid.faces + 121 * k for k in range(n)]), name="sheets")


def copies(n: int) -> SourceMesh:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(n)[:, None, None]
    # as it would be, were the repeats not merged on reading
    return SourceMesh(np.tile(square, (n, 1)), faces.reshape(-1, 3), {}, name="copies")


def fan(n: int) -> SourceMesh:
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    rim = 1 + np.arange(n)
    points = np.vstack([[0, 0, 0.5], np.c_[np.cos(angle), np.sin(angle), 0 * angle]])
    return build_source(points, np.c_[0 * rim, rim, np.roll(rim, -1)], name="fan")


@given(seed=st.integers(0, 10**6), holes=st.floats(0, 0.3), stretch=st.sampled_from([1.0, 0.6, 1e-4, 1e4]))
def test_the_border_and_the_faces_tell_the_same(seed, holes, stretch):
    rng = np.random.default_rng(seed)
    grid = grid_source(rng.random((7, 7)), 1.0, 1.0)
    faces = grid.faces[rng.random(len(grid.faces)) >= holes]
    if seed % 2:  # a second sheet, beside, touching or above the first
        points = np.vstack([grid.points, grid.points * [0.5, 0.5, 1] + [rng.integers(0, 8), rng.integers(0, 3), 3]])
        faces = np.vstack([faces, grid.faces + 49])
    else:
        points = grid.points
    points = points * [1, stretch, 1]
    edges = overlap.Edges.of(faces)
    expected = by_faces(points, faces)
    assert_array_equal(hidden_faces(points, faces), expected)
    told = overlap._covers_once(points[:, :2], edges, 1e-9 * float(np.ptp(points[:, :2], axis=0).max()))
    if told:
        assert len(expected) == 0
    if not seed % 2:  # one sheet, of which the border tells unless it meets itself in a vertex
        assert told == (len(np.unique(edges.ends(edges.border)[:, 0])) == len(edges.border))


def test_an_island_over_a_sheet_is_seen_although_no_borders_touch():
    sheet = grid_source(np.zeros((9, 9)), 1.0, 1.0)
    island = grid_source(np.zeros((3, 3)), 0.5, 0.5)
    points = np.vstack([sheet.points, island.points + np.array([3.3, -5.2, 1])])
    faces = np.vstack([sheet.faces, island.faces + 81])
    centre = points[faces[:128]].mean(axis=1)
    hidden = hidden_faces(points, faces)
    assert_array_equal(hidden, by_faces(points, faces))
    assert set(map(tuple, np.floor(centre[hidden, :2]).tolist())) == {(3, -6), (4, -6), (3, -7), (4, -7)}
    # within a hole of the sheet it is none
    hole = np.abs(centre[:, :2] - [4, -6]).max(axis=1) < 1
    assert len(hidden_faces(points, np.vstack([sheet.faces[~hole], island.faces + 81]))) == 0


def test_what_crosses_a_long_edge_in_its_middle_is_seen():
    """Far more cells from the edge's ends than an ordinary edge is long."""
    island = grid_source(np.zeros((16, 16)), 0.15, 0.15)
    points = np.vstack([[[0, 0, 0], [100, 0, 0], [0, 100, 0]], island.points + np.array([50, 51.2, 1])])
    faces = np.vstack([[[0, 1, 2]], island.faces + 3])
    assert_array_equal(hidden_faces(points, faces), [0])


@pytest.mark.parametrize(
    ("source", "folds", "hidden"),
    [(wall(100), 9750, 0), (sheets(80), 0, 161), (copies(8000), 0, 161), (fan(8000), 0, 0)],
    ids=["wall", "sheets", "copies", "fan"],
)
def test_a_verdict_takes_comparisons_in_proportion_to_the_faces(source, folds, hidden, monkeypatch):
    monkeypatch.setattr(overlap, "MOST_TESTS", 3)
    monkeypatch.setattr(overlap, "LEAST_LIMIT", 0)
    facts = surface_facts(source, source.points, until=FOLD_SHARE)
    assert (facts.folds, facts.hidden, facts.complete) == (folds, hidden, folds + hidden == 0)
    assert (facts.refusal is None) == (folds + hidden == 0)


def test_all_that_is_hidden_is_found_with_few_comparisons(monkeypatch):
    monkeypatch.setattr(overlap, "MOST_TESTS", 20)
    monkeypatch.setattr(overlap, "LEAST_LIMIT", 0)
    for source, seen in ((sheets(80), 200), (copies(8000), 2)):
        facts = surface_facts(source, source.points)
        assert (facts.hidden, facts.complete) == (len(source.faces) - seen, True)


def test_what_would_take_too_many_comparisons_is_refused_in_one_line(monkeypatch):
    monkeypatch.setattr(overlap, "LEAST_LIMIT", 0)
    round_ = fan(3000)
    flake = build_source(
        np.vstack([round_.points, [[0.5, 0, 2], [0.505, 0, 2], [0.505, 0.005, 2]]]),
        np.vstack([round_.faces, [[3001, 3002, 3003]]]),
        name="fan.ply",
    )
    with pytest.raises(ModelError, match=r"^fan.ply: so many of its 3001 faces meet in one place that 900300 compar"):
        check_open_surface(flake, flake.points)


@pytest.mark.parametrize(("shift", "hidden"), [(0.0, 0), (0.001, 9)])
def test_an_overlap_within_single_precision_of_far_coordinates_is_none_where_they_are_so_rounded(shift, hidden):
    sheet = grid_source(np.zeros((10, 10)), 10.0, 10.0)
    far = sheet.points + np.array([500_000, 5_000_000, 0])
    # of 0.5 units: what two roundings at five millions may come to
    points = np.vstack([far, far + np.array([89.5, 0, 1])]) + shift
    tiles = build_source(points, np.vstack([sheet.faces, sheet.faces + 100]))
    facts = surface_facts(tiles, points)
    assert (facts.folds, facts.refusal is None) == (0, hidden == 0)
    assert facts.hidden >= hidden
    assert (facts.hidden == 0) == (hidden == 0)
