"""Lines become break lines: cut, draped, met, thinned, added; and what is said of a mesh along them."""

from __future__ import annotations

import dataclasses
import warnings
from fractions import Fraction

import numpy as np
import pytest
from counts import tried
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from samples import holey_grid, stepped_model, surface
from test_places import skirted, walled

from meshsimp_pymoo.datasets import load, load_lines
from meshsimp_pymoo.errors import InputError, ModelError, ModelWarning
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.formats.source.lines import SourceLines
from meshsimp_pymoo.formats.table import write_lines
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.lining import lined_model
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.polylines import thinned

ROOF = build_model(load("roof"))
FLAT = build_model(grid_source(np.zeros((9, 9)), 1.0, 1.0, origin=(0.0, 8.0)))
ROUGH = build_model(grid_source(np.random.default_rng(1).random((9, 9)), 1.0, 1.0, origin=(0.0, 8.0)))


def chains(model):
    """The break lines of a model as positions in its file."""
    return [model.file_points[chain].tolist() for chain in model.lines.chains]


def height_of(model, places):
    """The height of the original surface at places (n, 2) of its file, which is not turned: face by face."""
    found = np.full(len(places), np.nan)
    for face in model.file_points[model.faces]:
        try:
            shares = np.linalg.solve(
                np.vstack([np.ones(3), face[:, :2].T]), np.vstack([np.ones(len(places)), places.T])
            )
        except np.linalg.LinAlgError:
            continue
        inside = (shares >= -1e-12).all(axis=0)
        found[inside] = (face[:, 2] @ shares)[inside]
    return found


# ------------------------------------------------------------------------------------------------------- known answers


def test_a_straight_ridge_is_thinned_to_its_ends_and_four_triangles_are_a_roof():
    ridge = np.column_stack([np.zeros(17), np.linspace(-1, 1, 17), np.ones(17)])
    roof = surface("roof", break_lines=[ridge.tolist()], line_tolerance=0.01)
    assert chains(roof.model) == [[[0, -1, 1], [0, 1, 1]]]
    quality = roof.simplify(roof.pinned).quality
    assert (quality.triangles, quality.error, quality.line_max_error, quality.line_mean_error) == (4, 0, 0, 0)


def test_without_lines_there_are_no_line_errors():
    assert np.isnan(surface(ROOF).simplify(surface(ROOF).pinned).quality.line_max_error)


def test_no_vertex_is_added_where_the_model_has_one():
    line = [[[1, 5], [3, 3], [3, 6], [7, 6]]]
    model = lined_model(ROUGH, line, 0)
    assert len(model.lines.added) == 0
    assert model.n_vertices == 81
    assert model.weights is None
    assert [place[:2] for place in chains(model)[0]] == [
        *([k, 6 - k] for k in range(1, 4)), *([3, k] for k in range(4, 7)), *([k, 6] for k in range(4, 8))
    ]  # fmt: skip


def test_a_line_without_heights_has_the_profile_of_the_surface():
    ends = np.array([[0.3, 0.2], [7.7, 6.1]])
    model = lined_model(ROUGH, [ends], 0)
    t = np.linspace(0, 1, 1001)
    places = ends[0] + t[:, None] * (ends[1] - ends[0])
    line = model.lines.originals[0]
    at = np.linalg.norm(line[:, :2] - ends[0], axis=1) / np.linalg.norm(ends[1] - ends[0])
    assert_allclose(np.interp(t, at, line[:, 2]) + ROUGH.file_points[:, 2].min(), height_of(ROUGH, places), atol=1e-12)
    # and a vertex at each crossing, none of which is on a straight line with its neighbours
    assert len(model.lines.added) == len(line)


def test_thinning_keeps_to_its_tolerance():
    ends = np.array([[0.3, 0.2], [7.7, 6.1]])
    model = lined_model(ROUGH, [ends], 0.2)
    line, left = model.lines.originals[0], model.points[model.lines.chains[0]]
    assert 2 < len(left) < len(line)
    a, u = left[:-1], np.diff(left, axis=0)
    t = np.clip(((line[:, None] - a) * u).sum(axis=2) / (u**2).sum(axis=1), 0, 1)
    away = np.linalg.norm(line[:, None] - a - t[..., None] * u, axis=2).min(axis=1)
    assert 0.1 < away.max() <= 0.2


@pytest.mark.parametrize("up", [1, -1])
def test_a_line_with_heights_of_its_own_carries_the_surface_at_a_samples_place(up):
    model = lined_model(FLAT, [[[2, 2, 5 * up], [6, 2, 7 * up]]], 0)
    assert model.n_vertices == 86
    assert chains(model) == [[[2 + k, 2, (5 + k / 2) * up] for k in range(5)]]
    lined = HeightSurface(model)
    everything = lined.simplify(np.ones(86, bool))
    assert set(model.lines.vertices) <= set(everything.faces.ravel())
    assert everything.quality.line_max_error == 0
    # the samples below do not lie on the mesh, and are still what the error is of
    assert everything.quality.max_error == 7
    assert lined.total_weight == 81
    assert_array_equal(np.flatnonzero(model.weights == 0), model.lines.added)
    assert_array_equal(np.sort(model.source_index)[-5:], range(81, 86))


@pytest.mark.parametrize("turn", [0.0, 20.0])
def test_no_sample_below_a_line_with_heights_draws_it_down(turn):
    """A crest over a row of samples; in a turned grid they lie below it but for rounding."""
    sine, cosine = np.sin(np.radians(turn)), np.cos(np.radians(turn))
    turned = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    grid = grid_source(np.zeros((9, 9)), 1.0, 1.0, origin=(0.0, 8.0))
    crest = np.array([[0.5, 2, 3.0], [7.5, 2, 3.0]]) @ turned
    bare = build_model(dataclasses.replace(grid, points=grid.points @ turned))
    rng = np.random.default_rng(1)
    for tolerance, n_kept in ((0.0, 9), (2.9, 9), (3.1, 2)):
        model = lined_model(bare, [crest], tolerance)
        assert len(model.lines.vertices) == n_kept
        lined = HeightSurface(model)
        places = crest[0, :2] + np.linspace(0, 1, 57)[:, None] * (crest[1] - crest[0])[:2]
        for share in (0.0, 0.3, 1.0):
            mesh = lined.simplify(lined.pinned | (rng.random(model.n_vertices) < share))
            heights = height_of(dataclasses.replace(model, faces=mesh.faces), places)
            assert np.abs(heights - 3.0).max() <= tolerance + 1e-9


def test_a_line_above_a_corner_is_the_corner():
    model = lined_model(FLAT, [[[0, 0, 5], [4, 4, 5]]], 0)
    assert model.lines.chains[0][0] in model.corners
    lined = HeightSurface(model)
    assert lined.simplify(lined.pinned).covered.all()
    bare = model.without_lines()
    assert bare.hash == FLAT.hash
    assert_array_equal(bare.corners, FLAT.corners)


def test_of_several_heights_at_one_place_the_first_given_counts():
    lines = [[[1, 1, 3], [4, 4, 3], [7, 7, 3]], [[1, 7, 2], [4, 4, 2], [7, 1, 2]]]
    with pytest.warns(ModelWarning, match=r"several heights at 1 places \(first: 4, 4, where they differ by 1\)"):
        model = lined_model(FLAT, lines, 0)
    assert [4, 4, 3] in chains(model)[1]
    assert model.lines.found["places_of_several_heights"] == 1
    assert HeightSurface(model).simplify(np.ones(model.n_vertices, bool)).quality.line_max_error == 1


def test_a_vertex_on_another_line_is_a_vertex_of_both():
    model = lined_model(FLAT, [[[1, 1.5], [7, 4.5]], [[3, 2.5], [3, 6.3]]], 1)
    assert chains(model) == [[[1, 1.5, 0], [3, 2.5, 0], [7, 4.5, 0]], [[3, 2.5, 0], [3, 6.3, 0]]]


def test_a_vertex_on_a_line_with_heights_has_the_lines_height():
    model = lined_model(FLAT, [[[3.5, 2.5], [3.5, 6.3]], [[1.5, 2.5, 0], [5.5, 2.5, 4]]], 0.1)
    assert chains(model)[0][0] == [3.5, 2.5, 2]
    assert chains(model)[1] == [[1.5, 2.5, 0], [3.5, 2.5, 2], [5.5, 2.5, 4]]


def test_what_two_lines_share_is_one_set_of_edges():
    model = lined_model(FLAT, [[[1, 2.5], [5, 2.5]], [[7, 2.5], [3, 2.5]]], 0)
    assert [[place[0] for place in chain] for chain in chains(model)] == [[1, 3, 5], [7, 5, 3]]
    assert len(model.lines.segments) == 3


def test_where_a_line_without_heights_runs_along_one_with_heights_it_has_these():
    soft, hard = [[1, 2.5], [7, 2.5]], [[5.25, 2.5, 3], [3.25, 2.5, 3]]
    model = lined_model(ROUGH, [soft, hard], 0)
    of_soft, of_hard = chains(model)
    low = of_soft.index([3.25, 2.5, 3])
    assert of_hard == of_soft[low : low + len(of_hard)][::-1]
    assert len(of_soft) > len(of_hard) == 2


def test_feet_of_walls_stay_what_they_are():
    walls = stepped_model(skirted())
    model = lined_model(walls, [[[1.3, -1.4, 30], [5.6, -7.2, 30]]], 0)
    assert_array_equal(np.sort(model.source_index[model.feet]), np.sort(walls.source_index[walls.feet]))
    assert (model.weights[model.feet] == 0).all()
    assert model.total_weight == walls.total_weight


def test_lines_that_cross_are_refused_by_name_and_place():
    lines = SourceLines("kerbs.obj", tuple(np.array(x) for x in CROSSING), ("line 1", "line 7"))
    with pytest.raises(
        ModelError, match=r"^kerbs.obj: line 1 and line 7 cross at 4\.25, 4\.25; give the crossing as a"
    ):
        lined_model(FLAT, lines, 1)
    meeting = [[*line[:1], [4.25, 4.25], *line[1:]] for line in CROSSING]
    assert len(lined_model(FLAT, meeting, 1).lines.segments) == 4


CROSSING = [[[1.25, 1.25], [7.25, 7.25]], [[1.25, 7.25], [7.25, 1.25]]]


def test_a_line_that_crosses_itself_is_refused():
    with pytest.raises(ModelError, match=r"line 1 crosses itself at 4, 3\.5; give"):
        lined_model(FLAT, [[[1, 3.5], [6, 3.5], [6, 6], [4, 6], [4, 1.5]]], 1)


def test_lines_that_cross_outside_the_model_do_not_matter():
    with pytest.warns(ModelWarning, match=r"of 2 lines, parts of 2 and the whole of 0 lie outside"):
        model = lined_model(FLAT, [[[4, 2], [12, 4]], [[4, 4], [12, 2]]], 0.1)
    assert_allclose([chain[-1] for chain in chains(model)], [[8, 3, 0], [8, 3, 0]], atol=1e-9)


def test_what_lies_outside_is_cut_off_at_the_outline():
    holey = build_model(holey_grid())
    low, high = holey.file_box[:, :2]
    across = [[low[0] - 5, -13.0, 3.0], [high[0] + 5, -13.0, 8.0]]
    away = [[high[0] + 1, 0.0], [high[0] + 2, 1.0]]
    with pytest.warns(
        ModelWarning, match=r"of 2 lines, parts of 1 and the whole of 1 lie outside holey .*: [\d.]+% of the le"
    ):
        model = lined_model(holey, [across, away], 0)
    lengths = [np.ptp(line[:, 0]) for line in model.lines.originals]
    assert len(lengths) == 2  # beside the hole, which is 8 wide
    assert_allclose(sum(lengths), np.ptp(holey.points[:, 0]) - 8)
    assert model.lines.names == ("line 1", "line 1")
    assert model.lines.found["lines_cut"] == model.lines.found["lines_left_out"] == 1
    with pytest.warns(ModelWarning):
        back = lined_model(holey, [across[::-1], away], 0)
    assert chains(back) == [chain[::-1] for chain in chains(model)[::-1]]
    # heights are those of the line where it was cut
    for chain in chains(model):
        for x, _, z in chain:
            assert z == pytest.approx(3 + 5 * (x - across[0][0]) / (across[1][0] - across[0][0]))


def test_lines_that_lie_elsewhere_are_refused_with_both_boxes():
    with pytest.raises(
        ModelError, match=r"none of the 1 lines lies in .*: they span x 500000 to 500010, y .* 0 to 8; ch"
    ):
        lined_model(FLAT, [[[500000, 4e6], [500010, 4.1e6]]], 1)


def test_a_line_along_the_outline_is_whole():
    rim = [[0, 0], [8, 0], [8, 8], [0, 8], [0, 0]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = lined_model(FLAT, [rim], 0)
    assert [place[:2] for place in chains(model)[0]] == rim


def test_a_line_keeps_to_the_models_corners():
    model = lined_model(FLAT, [[[2, 0], [8, 0], [8, 3]]], 100)
    assert [place[:2] for place in chains(model)[0]] == [[2, 0], [8, 0], [8, 3]]


def test_repeated_vertices_and_lines_of_one_place_are_left_out_and_said():
    with pytest.warns(ModelWarning, match=r"2 vertices repeat the place of the one before, and 1 lines are one place"):
        model = lined_model(FLAT, [[[1, 1], [1, 1], [2, 5]], [[3, 3], [3, 3 + 1e-12]]], 1)
    assert len(model.lines.chains) == 1
    with pytest.warns(ModelWarning), pytest.raises(ModelError, match="holds no line of two places"):
        lined_model(FLAT, [[[3, 3], [3, 3 + 1e-12]]], 1)


@pytest.mark.parametrize("short", [1.2e-9, 1.9e-9, 3e-9])
@pytest.mark.parametrize("width", [2, 3])
def test_a_line_goes_on_over_the_shortest_of_pieces(short, width):
    line = np.array([[1.3, 1.2, 1], [3.3, 2.2, 1], [3.3 + short * np.hypot(8, 8), 2.2, 1], [5.1, 6.2, 1]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = lined_model(ROUGH, [line[:, :width]], 0)
    assert len(model.lines.chains) == 1
    assert np.isfinite(model.points).all()


def wiggly(y):
    x = np.linspace(0.5, 7.5, 141)
    return np.column_stack([x, y + 0.1 * np.sin(4 * x)])


def test_thinned_lines_that_come_to_cross_get_vertices_back_until_they_do_not():
    lines = [wiggly(4.0), wiggly(4.01)[13:], wiggly(4.02)[:-9]]
    alone = [len(lined_model(FLAT, [line], 0.15).lines.chains[0]) for line in lines]
    model = lined_model(FLAT, lines, 0.15)
    assert model.lines.found["put_back_line_vertices"] > 0
    assert len(model.lines.vertices) > sum(alone)
    assert_no_crossing(model)


def test_of_two_that_cross_the_one_that_was_thinned_more_gets_its_vertex_back():
    around, upright = [[1, 2.5], [4, 3.5], [7, 2.5]], [[4, 3.3], [4.05, 2], [4, 1]]
    model = lined_model(FLAT, [around, upright], 2)
    assert [len(chain) for chain in model.lines.chains] == [3, 2]


def test_a_line_is_not_thinned_across_another():
    """A bump of the first line goes around the second one, which is short."""
    bump = [[1, 1.5], [3.9, 1.5], [4.1, 1.9], [4.3, 1.5], [7, 1.5]]
    assert len(lined_model(FLAT, [bump], 0.5).lines.chains[0]) == 2
    model = lined_model(FLAT, [bump, [[4.1, 1.6], [4.1, 1.65]]], 0.5)
    assert [4.1, 1.9, 0] in chains(model)[0]


def test_a_closed_line_is_a_ring_however_large_the_tolerance():
    angle = np.linspace(0, 2 * np.pi, 61)
    ring = 4 + 2 * np.column_stack([np.cos(angle), np.sin(angle)])
    ring[-1] = ring[0]
    model = lined_model(FLAT, [ring], 10)
    chain = model.lines.chains[0]
    assert chain[0] == chain[-1]
    assert 3 <= len(model.lines.segments) == len(chain) - 1 <= 4


# ------------------------------------------------------------------------------------------------------------- by word


def test_sharp_edges_of_a_roof_are_its_ridge():
    model = lined_model(ROOF, "sharp:30", None)
    assert sorted(chains(model)[0]) == [[0, -1, 1], [0, 1, 1]]
    assert len(model.lines.originals[0]) == 17
    assert len(model.lines.added) == 0
    assert model.lines.tolerance == pytest.approx(1e-3 * ROOF.diagonal)


def test_sharp_edges_of_a_terrace_are_the_rim_of_its_top():
    model = lined_model(stepped_model(walled()), "sharp:60", None)
    assert len(model.lines.chains) == 1
    rim = [tuple(place) for place in chains(model)[0]]
    assert rim[0] == rim[-1]
    assert set(rim) == {(1, 1, 2), (2, 1, 2), (2, 2, 2), (1, 2, 2)}


@pytest.mark.parametrize("word", ["sharp:x", "sharp:200", "sharp:0", "sharp:nan", "sharp:"])
def test_words_without_an_angle_are_refused(word):
    with pytest.raises(ModelError, match=f"^break_lines='{word}': no angle; give degrees between 0 and 180"):
        lined_model(ROOF, word, None)


def test_an_angle_that_no_edge_has_is_refused():
    with pytest.raises(ModelError, match=r"no two faces of roof meet at more than 120 degrees; give fewer"):
        lined_model(ROOF, "sharp:120", None)


def test_the_outline_is_closed_lines_around_the_model_and_its_holes():
    holey = build_model(holey_grid())
    model = lined_model(holey, "outline", 0)
    assert len(model.lines.chains) == 2
    assert all(chain[0] == chain[-1] for chain in model.lines.chains)
    n_edges = int((edge_table(holey.faces).n_triangles == 1).sum())
    assert sum(len(line) - 1 for line in model.lines.originals) == n_edges
    assert_array_equal(model.lines.vertices, np.intersect1d(model.lines.vertices, holey.border))


# ------------------------------------------------------------------------------------------------------------ refusals


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([[[0, 1], [np.nan, 2]]], r"line 1 has 1 of 2 vertices that are NaN"),
        ([[[0, 1, 2, 3], [1, 2, 3, 4]]], r"line 1 has the shape \(2, 4\)"),
        ([[[0, 1]]], r"break_lines: holds no lines \(but 1 lines that are one place\)"),
        ([], "holds no lines"),
    ],
)
def test_what_is_no_line_is_refused(lines, message):
    with pytest.raises(ModelError, match=message):
        lined_model(FLAT, lines, 1)


@pytest.mark.parametrize("tolerance", [None, -1.0, np.nan, np.inf])
def test_a_tolerance_that_is_none_is_refused(tolerance):
    with pytest.raises(InputError, match=r"line_tolerance is .*; give how far break lines may move"):
        lined_model(FLAT, [[[1, 1], [2, 2]]], tolerance)


def test_lines_without_heights_need_heights_along_z():
    grid = holey_grid()
    lying = build_model(build_source(grid.points[:, [2, 0, 1]], grid.faces, name="lying"), up="x")
    with pytest.raises(
        ModelError, match=r"1 of 1 lines have no heights, and the heights of lying are along \[1\.0, 0\.0"
    ):
        lined_model(lying, [[[5, 5], [6, 6]]], 1)
    upright = lined_model(build_model(grid), [[[1.5, -20.0, 30.0], [5.0, -19.0, 20.0]]], 1)
    turned = lined_model(lying, [[[30.0, 1.5, -20.0], [20.0, 5.0, -19.0]]], 1)
    assert_allclose(np.array(chains(turned))[..., [1, 2, 0]], chains(upright), atol=1e-12)


def test_lines_in_another_unit_are_refused_where_both_are_known():
    here = dataclasses.replace(FLAT, georeference={"unit": "metre"})
    line = (np.array([[1.0, 1], [2, 2]]),)
    with pytest.raises(ModelError, match=r"^kerbs.xml: is in US survey foot, and grid in metre; export the lines in t"):
        lined_model(here, SourceLines("kerbs.xml", line, ("line 1",), {"unit": "US survey foot"}), 1)
    for unit in ({}, {"unit": "meter"}, {"unit": "degree"}):
        assert lined_model(here, SourceLines("kerbs.xml", line, ("line 1",), unit), 1).lines is not None


def test_lines_of_another_reference_system_are_refused():
    here = dataclasses.replace(FLAT, georeference={"epsg": 25832})
    lines = SourceLines("streams.shp", (np.array([[1.0, 1], [2, 2]]),), ("line 1",), {"epsg": 4326})
    with pytest.raises(ModelError, match=r"^streams.shp: is in EPSG:4326, and .* in EPSG:25832; convert .* -t_srs"):
        lined_model(here, lines, 1)
    for known in ({}, {"epsg": 25832}):
        assert lined_model(here, dataclasses.replace(lines, georeference=known), 1).lines is not None


def test_degrees_are_scaled_as_the_model_is():
    source = grid_source(np.random.default_rng(1).random((9, 9)), 0.01, 0.01, origin=(10.0, 50.0))
    degrees = dataclasses.replace(source, georeference={"unit": "degree", "scale": [70000.0, 111000.0]})
    line = [[10.013, 49.985], [10.055, 49.963]]
    model = lined_model(build_model(degrees), [line], 0)
    assert_allclose([chains(model)[0][0][:2], chains(model)[0][-1][:2]], line, rtol=1e-13)
    assert model.lines.originals[0][-1, 0] == pytest.approx(0.055 * 70000)


# ---------------------------------------------------------------------------------------------------------------- laws


def assert_no_crossing(model):
    """In exact arithmetic: forced edges have at most an end in common, and no line's vertex lies in another's edge."""
    points = [(Fraction(x), Fraction(y)) for x, y in model.xy.tolist()]

    def turn(a, b, c):
        (ax, ay), (bx, by), (cx, cy) = points[a], points[b], points[c]
        value = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        return (value > 0) - (value < 0)

    segments = model.lines.segments.tolist()
    for k, (a, b) in enumerate(segments):
        assert points[a] != points[b]
        for c in model.lines.vertices:
            if c not in (a, b) and turn(a, b, c) == 0:
                assert not min(points[a], points[b]) < points[c] < max(points[a], points[b])
        for c, d in segments[:k]:
            assert not (turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0)


def random_lines(rng, n):
    """Lines that do not cross: graphs one above the other, some of which touch or end on the one below."""
    x = np.sort(rng.integers(2, 62, 12)) / 8 + np.arange(12) / 1024
    lines, low = [], np.full(12, 0.5)
    for _ in range(n):
        low = low + rng.integers(0, 3, 12) / 8
        first, last = sorted(rng.choice(13, 2, replace=False))
        if last - first > 1:
            line = np.column_stack([x, low])[first:last]
            lines.append(np.column_stack([line, rng.random(len(line))]) if rng.random() < 0.3 else line)
    return lines


@given(seed=st.integers(0, 10**6), tolerance=st.sampled_from([0.0, 0.1, 0.4, 2.0]))
def test_lines_never_cross_and_their_order_and_direction_change_nothing(seed, tolerance):
    rng = np.random.default_rng(seed)
    lines = random_lines(rng, 5)
    if not lines:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)  # heights at places of several: the first given counts
        model = lined_model(ROUGH, lines, tolerance)
    assert_no_crossing(model)
    # each line is a chain, from its one end to its other
    assert len(model.lines.chains) == len(lines)
    for line, chain in zip(lines, model.lines.chains, strict=True):
        assert_allclose(model.file_points[chain[[0, -1]], :2], line[[0, -1], :2])
    if "places_of_several_heights" in model.lines.found:
        return
    order = rng.permutation(len(lines))
    other = lined_model(ROUGH, [lines[k][:: rng.choice([-1, 1])] for k in order], tolerance)
    assert_array_equal(other.points, model.points)
    assert_array_equal(other.lines.segments, model.lines.segments)
    assert_array_equal(other.source_index, model.source_index)


@given(seed=st.integers(0, 10**6))
def test_the_original_stays_what_it_was(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.1, 7.9), rng.uniform(7.999, 8.0)
    model = lined_model(ROUGH, [rng.uniform(0.2, 7.8, (2, 3)), [[x, y], [x + 0.05, y]]], 0)
    own = np.setdiff1d(np.arange(model.n_vertices), model.lines.added)
    order = np.argsort(model.source_index[own])
    before = np.argsort(ROUGH.source_index)
    assert_array_equal(model.points[own][order], ROUGH.points[before])
    assert_array_equal(model.file_points[own][order], ROUGH.file_points[before])
    for lined, plain in ((model.border, ROUGH.border), (model.corners, ROUGH.corners)):
        assert_array_equal(np.sort(model.source_index[lined]), np.sort(ROUGH.source_index[plain]))
    assert len(model.faces) == len(ROUGH.faces)
    assert_array_equal(
        np.sort(model.source_index[model.faces].ravel()), np.sort(ROUGH.source_index[ROUGH.faces].ravel())
    )
    indptr, _ = model.neighbours
    assert (np.diff(indptr)[model.lines.added] == 0).all()
    everything = HeightSurface(model).simplify(np.ones(model.n_vertices, bool)).quality
    assert everything.line_max_error == pytest.approx(0, abs=1e-9)


def test_lines_of_a_file_are_those_of_its_arrays(tmp_path):
    lines = [np.array([[1.3, 1.2, 4.0], [6.1, 5.5, 7.0]]), np.array([[2, 6, 3.5], [4, 6.5, 2.0], [6, 7, 3.5]])]
    source = SourceLines("x", tuple(lines), ("line 1", "line 2"))
    write_lines(tmp_path / "lines.geojson", source)
    model = lined_model(ROUGH, tmp_path / "lines.geojson", 0.1)
    assert model.hash == lined_model(ROUGH, lines, 0.1).hash
    assert model.lines.names[0].startswith("feature 1")


def test_attributes_of_added_vertices_are_those_of_the_nearest():
    source = dataclasses.replace(load("peaks:9"), attributes={"height": load("peaks:9").points[:, 2]})
    model = lined_model(build_model(source), [[[-0.26, -0.26, 0], [0.4, 0.52, 0]]], 1)
    near = [np.argmin(np.linalg.norm(source.points[:, :2] - place[:2], axis=1)) for place in chains(model)[0]]
    assert_array_equal(model.attributes["height"][model.lines.chains[0]], source.points[near, 2])


def test_lining_twice_is_lining_once():
    lines = [[[1.3, 1.2], [6.1, 5.5]], [[2, 6, 3.5], [6, 7, 3.5]]]
    once = lined_model(ROUGH, lines, 0.1)
    twice = lined_model(once, lines, 0.1)
    assert twice.hash == once.hash
    assert_array_equal(twice.lines.added, once.lines.added)


def slowly_thinned(points, tolerance, a, b):
    """Douglas and Peucker by recursion."""
    u = points[b] - points[a]
    t = np.clip((points[a + 1 : b] - points[a]) @ u / (u @ u), 0, 1)
    away = np.linalg.norm(points[a + 1 : b] - points[a] - t[:, None] * u, axis=1)
    if len(away) == 0 or away.max() <= tolerance:
        return [a]
    far = a + 1 + int(away.argmax())
    return slowly_thinned(points, tolerance, a, far) + slowly_thinned(points, tolerance, far, b)


@tried("lines", 20)
def test_thinning_is_that_of_the_textbook(lines):
    rng = np.random.default_rng(2)
    given = [np.cumsum(rng.normal(size=(rng.integers(2, 200), 3)), axis=0) for _ in range(lines)]
    for line, kept in zip(given, thinned(given, 2.0), strict=True):
        assert np.flatnonzero(kept).tolist() == [*slowly_thinned(line, 2.0, 0, len(line) - 1), len(line) - 1]


# ------------------------------------------------------------------------------------------------------ the embankment


def test_an_embankments_lines_thin_to_a_fifth_and_every_mesh_keeps_them():
    model, lines = build_model(load("embankment")), load_lines("embankment")
    assert model.n_vertices == 5600
    assert sum(map(len, lines.lines)) == 804
    lined = HeightSurface(lined_model(model, lines, 0.3))
    assert len(lined.model.lines.added) == 0
    assert len(lined.model.lines.vertices) < 804 / 5
    kept = lined.pinned | (np.random.default_rng(1).random(lined.n_vertices) < 0.08)
    mesh = lined.simplify(kept)
    edges = {tuple(edge) for edge in edge_table(mesh.faces).ends.tolist()}
    assert edges >= {tuple(edge) for edge in lined.model.lines.segments.tolist()}
    quality = mesh.quality
    assert 0 < quality.line_mean_error < quality.line_max_error < 0.3
    for other in (lined.of_faces(mesh.faces).quality, lined.score(lined.model.file_points, mesh.faces).quality):
        assert other.line_max_error == pytest.approx(quality.line_max_error)
        assert other.line_mean_error == pytest.approx(quality.line_mean_error)
    # what the error is, from first principles
    sampled = np.concatenate(lined.model.lines.originals)
    own = np.concatenate([np.full(len(line), np.inf) for line in lined.model.lines.originals])
    for face in lined.points[mesh.faces]:
        (ax, ay), u, v = face[0, :2], face[1, :2] - face[0, :2], face[2, :2] - face[0, :2]
        p = sampled[:, :2] - [ax, ay]
        area = u[0] * v[1] - u[1] * v[0]
        s, t = (p[:, 0] * v[1] - p[:, 1] * v[0]) / area, (u[0] * p[:, 1] - u[1] * p[:, 0]) / area
        inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
        z = face[0, 2] + s * (face[1, 2] - face[0, 2]) + t * (face[2, 2] - face[0, 2])
        own[inside] = np.minimum(own, np.abs(z - sampled[:, 2]))[inside]
    assert own.max() == pytest.approx(quality.line_max_error)
    length = [np.linalg.norm(np.diff(line, axis=0), axis=1) for line in lined.model.lines.originals]
    means = [
        (own[k : k + len(x)] + own[k + 1 : k + 1 + len(x)]) / 2 @ x
        for k, x in zip(range(0, 804, 201), length, strict=True)
    ]
    assert sum(means) / sum(x.sum() for x in length) == pytest.approx(quality.line_mean_error)


def test_a_model_without_lines_of_its_own_is_said():
    with pytest.raises(ModelError, match=r"^roof: has no lines of its own; those that have: embankment"):
        load_lines("roof")


def test_lines_far_off_the_surface_are_taken_with_a_warning():
    model = build_model(load("roof:9"))
    with pytest.warns(ModelWarning, match=r"lie 99\.3 off the surface of roof:9 on average"):
        lined_model(model, [[[-0.5, 0.0, 100.0], [0.5, 0.0, 100.0]]], 0.1)


def test_a_line_that_turns_back_on_itself_is_gone_along_twice():
    a, b, c = [-0.75, -0.5], [0.5, -0.4], [0.6, 0.6]
    (there_and_back,) = surface("plane:9", break_lines=[[a, b, a, b, c]], line_tolerance=0.01).model.lines.chains
    (once,) = surface("plane:9", break_lines=[[a, b, c]], line_tolerance=0.01).model.lines.chains
    assert there_and_back.tolist() == [*once[:2], *once[:2], once[2]]
