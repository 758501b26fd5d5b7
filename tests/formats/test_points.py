"""Points without faces: which triangles they get, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from clouds import UTM, areas, as_sets, scattered
from numpy.testing import assert_array_equal
from scipy.spatial import Delaunay

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.source.points import cloud_source


def test_the_triangles_are_delaunays_and_face_up():
    points = scattered()
    source = cloud_source(points)
    assert as_sets(source.faces) == as_sets(Delaunay(points[:, :2] - UTM[:2]).simplices)
    assert (areas(source) > 0).all()
    assert source.up == "z"
    assert_array_equal(source.points, points)


def test_keeping_all_points_gives_the_very_original():
    problem = MeshProblem(cloud_source(scattered()))
    error, triangles = problem.evaluate(np.ones(problem.n_var, dtype=bool))
    assert (error, triangles) == (0.0, len(problem.model.faces))


def test_a_grid_of_points_has_no_holes_and_no_slivers_whatever_its_place_and_angle():
    x, y = np.meshgrid(np.arange(12.0), np.arange(9.0))
    for angle in (0.0, 0.3):
        turned = np.column_stack([x.ravel() * np.cos(angle) - y.ravel() * np.sin(angle),
                                  x.ravel() * np.sin(angle) + y.ravel() * np.cos(angle)])  # fmt: skip
        source = cloud_source(np.column_stack([turned + UTM[:2], np.zeros(108)]))
        assert len(source.faces) == 2 * 11 * 8
        assert areas(source).sum() == pytest.approx(88)
        np.testing.assert_allclose(areas(source), 0.5, rtol=1e-6)


def test_of_points_at_one_place_the_lowest_stays_and_the_rest_is_counted():
    points = np.array([[0, 0, 5], [4, 0, 1], [4, 4, 1], [0, 4, 1], [0, 0, 2], [2, 2, 3], [0, 0, 9], [2, 2, 3.0]])
    with pytest.warns(ModelWarning, match=r"a: 3 of 8 points share their \(x, y\)") as caught:
        source = cloud_source(points, name="a", attributes={"tag": np.arange(8)})
    assert len(caught) == 1
    assert source.rows.tolist() in ([1, 2, 3, 4, 5], [1, 2, 3, 4, 7])
    assert_array_equal(source.points, points[source.rows])
    assert_array_equal(source.attributes["tag"], source.rows)
    assert len(source.faces) == 4
    assert source.georeference["same_place"] == 3


def test_points_without_a_height_or_of_other_classes_are_left_out_and_rows_stay_those_of_the_file():
    points = scattered(60)
    classes = np.arange(60) % 3 * 2.0
    rows = np.arange(60) * 10
    missing = np.arange(60) % 12 == 2
    named = {"scalar_Classification": classes, "tag": np.arange(60)}
    expected = np.flatnonzero((classes == 4) & ~missing)
    points[missing, 2] = np.nan
    with pytest.warns(ModelWarning, match="a: 5 of 60 points lack a coordinate") as caught:
        source = cloud_source(points, name="a", classes=(4,), attributes=named, rows=rows)
    assert len(caught) == 1
    assert_array_equal(source.points, points[expected])
    assert_array_equal(source.rows, rows[expected])
    assert_array_equal(source.attributes["tag"], expected)
    assert source.georeference["classes"] == {"0": 20, "2": 20, "4": 20}
    points[missing, 2] = 17.25
    with pytest.warns(ModelWarning, match="has no points of class 9, but of 0 never classified"):
        source = cloud_source(points, nodata=17.25, classes=(4, 9), attributes=named)
    assert_array_equal(source.rows, expected)


def test_without_a_choice_of_classes_ground_beside_others_is_warned_of():
    points, classes = scattered(50), np.repeat([2, 5, 200], [10, 38, 2])
    said = (
        r"a: 10 of its points are ground, others 5 high vegetation \(38\), 200 of the user \(2\); all of them become "
    )
    with pytest.warns(ModelWarning, match=f"{said}surface: .* classes=2 .--classes 2."):
        cloud_source(points, name="a", attributes={"classification": classes})
    for all_of_it in (classes[:10], classes[10:]):
        cloud_source(points[: len(all_of_it)], attributes={"classification": all_of_it})
    with pytest.raises(
        ModelError, match=r"a: has no points of class 3, 4, but of 2 ground \(10\), 5 high .*; take some"
    ):
        cloud_source(points, name="a", classes=(3, 4), attributes={"classification": classes})


def test_long_edges_bridge_bays_and_holes_only_without_a_limit():
    for name in ("horseshoe:900", "ring:900"):
        outline = load(name)
        bridged = cloud_source(outline.points)
        assert areas(bridged).sum() > 1.1 * areas(outline).sum()
        a, b, c = (outline.points[outline.faces[:, k], :2] for k in range(3))
        usual = np.median(np.linalg.norm(np.concatenate([a - b, b - c, c - a]), axis=1))
        open_one = cloud_source(outline.points, max_edge=3 * usual)
        assert areas(open_one).sum() == pytest.approx(areas(outline).sum(), rel=0.03)
        a, b, c = (open_one.points[open_one.faces[:, k], :2] for k in range(3))
        assert np.linalg.norm(np.concatenate([a - b, b - c, c - a]), axis=1).max() <= 3 * usual
        assert as_sets(open_one.faces) < as_sets(bridged.faces)


def test_clouds_that_span_no_surface_are_refused():
    line = np.column_stack([np.arange(6.0), 2 * np.arange(6.0), np.arange(6.0) ** 2])
    for points, options, match in [
        (line, {}, "6 different places lie on one line"),
        (np.tile([1.0, 2.0, 3.0], (5, 1)), {}, "share one"),
        (scattered(3), {}, "at least 4"),
        (
            scattered() * [1, 1, np.inf],
            {},
            r"400 of 400 points have infinite coordinates \(first: point 0, from 0, at ",
        ),
        (scattered(), {"classes": (2,)}, "does not say the classes of its points; leave classes out"),
        (scattered(), {"max_edge": 1e-3}, "longer than 0.001 .*--max-edge"),
        (scattered(), {"max_edge": 0.0}, "positive"),
        (scattered(), {"max_edge": float("nan")}, "positive"),
    ]:
        with pytest.raises(ModelError, match=match):
            cloud_source(points, **options)
