"""Pictures show the numbers they are given."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.geometry.error import simplify
from meshsimp_pymoo.geometry.model import load_model
from meshsimp_pymoo.report.figures import (
    AMBIENT,
    LIGHT,
    front_figure,
    hillshade,
    plot_error,
    plot_front,
    plot_mesh,
)


@pytest.fixture
def ax():
    return Figure().subplots()


@pytest.fixture(scope="module")
def roof():
    return load_model(load("roof:5"))


def polygons(ax):
    (collection,) = [c for c in ax.collections if isinstance(c, PolyCollection)]
    return collection


def points_drawn(ax):
    (line,) = [line for line in ax.get_lines() if "solutions" in str(line.get_label())]
    return np.column_stack(line.get_data())


def test_every_solution_of_a_front_is_drawn(ax):
    F = np.array([[3.0, 2], [1.0, 9], [2.0, 4]])
    assert plot_front(ax, F) is ax
    assert points_drawn(ax).tolist() == [[2, 3], [9, 1], [4, 2]]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("triangles", "error [model units]")


def test_the_mean_error_is_drawn_when_the_number_of_vertices_is_known(ax):
    plot_front(ax, [[30.0, 2], [10.0, 9]], n_points=10)
    assert points_drawn(ax)[:, 1].tolist() == [3, 1]
    assert ax.get_ylabel() == "mean error per vertex [model units]"


def test_knee_and_chosen_are_marked_where_they_are(ax):
    plot_front(ax, [[9.0, 2], [2.0, 4], [1.0, 9]], knee=1, chosen=2, marked=[0, 1])
    labelled = {line.get_label(): np.column_stack(line.get_data()).tolist() for line in ax.get_lines()}
    assert labelled["knee"] == [[4, 2]]
    assert labelled["chosen"] == [[9, 1]]
    assert [text.get_text() for text in ax.texts] == ["a", "b"]
    assert ax.get_legend() is not None


@pytest.mark.parametrize(
    ("F", "scales"),
    [
        ([[3.0, 10], [2.0, 20], [1.0, 30]], ("linear", "linear")),
        ([[3.0, 10], [2.0, 20], [1.0, 300]], ("log", "linear")),
        ([[300.0, 10], [2.0, 20], [1.0, 300]], ("log", "log")),
        ([[300.0, 10], [2.0, 20], [0.0, 300]], ("log", "symlog")),
        ([[0.0, 2]], ("linear", "linear")),
    ],
)
def test_axes_are_logarithmic_where_the_values_spread(ax, F, scales):
    plot_front(ax, F)
    assert (ax.get_xscale(), ax.get_yscale()) == scales
    low, high = ax.get_ylim()
    assert low <= min(error for error, _ in F)
    assert high >= max(error for error, _ in F)
    ax.figure.canvas.draw()


def test_a_mesh_is_drawn_with_all_its_triangles_at_their_place(ax, roof):
    plot_mesh(ax, roof.points, roof.faces)
    drawn = np.array([path.vertices[:3] for path in polygons(ax).get_paths()])
    assert len(drawn) == len(roof.faces)
    expected = roof.points[roof.faces][:, :, :2] - roof.points[:, :2].mean(axis=0)
    assert sorted(np.round(drawn, 9).tolist()) == sorted(np.round(expected, 9).tolist())
    assert ax.get_aspect() == 1


def test_the_nearest_triangles_are_drawn_last(ax):
    points = np.array([[0, 0, 5], [1, 0, 5], [0, 1, 5], [0, 0, 1], [1, 0, 1], [0, 2, 1]], dtype=float)
    plot_mesh(ax, points, [[0, 1, 2], [3, 4, 5]])
    heights = [np.ptp(path.vertices[:3, 1]) for path in polygons(ax).get_paths()]
    assert heights == [2, 1]


def test_from_the_side_a_roof_shows_its_height(ax, roof):
    plot_mesh(ax, roof.points, roof.faces, view=(0, 0))
    drawn = np.concatenate([path.vertices[:3] for path in polygons(ax).get_paths()])
    assert np.ptp(drawn[:, 0]) == pytest.approx(np.ptp(roof.points[:, 0]))
    assert np.ptp(drawn[:, 1]) == pytest.approx(1.0)
    assert drawn[np.argmax(drawn[:, 1]), 0] == pytest.approx(0, abs=1e-9)  # the ridge, in the middle, is up


def test_a_flat_roof_is_exaggerated_only_when_asked(roof):
    low, high = Figure().subplots(1, 2)
    for ax, factor in ((low, 1.0), (high, 4.0)):
        plot_mesh(ax, roof.points, roof.faces, view=(0, 0), exaggeration=factor)
    assert np.ptp(high.get_ylim()) > 3 * np.ptp(low.get_ylim())


def test_a_slope_towards_the_light_is_brighter_than_one_away_from_it(ax, roof):
    plot_mesh(ax, roof.points, roof.faces)
    colours = polygons(ax).get_facecolors()
    left = np.array([path.vertices[:3, 0].mean() < 0 for path in polygons(ax).get_paths()])
    assert colours[left, :3].mean() > colours[~left, :3].mean() + 0.2


def test_shading_follows_the_cosine_and_survives_a_triangle_without_area():
    u = np.cross(LIGHT, [0, 0, 1.0])
    v = np.cross(LIGHT, u)
    towards, away = np.array([0 * u, u, v]), np.array([0 * u, v, u])
    shades = hillshade(np.array([towards, away, np.zeros((3, 3))]))
    np.testing.assert_allclose(shades, [1.0, AMBIENT, AMBIENT], atol=1e-12)


def test_vertex_colours_show(ax, roof):
    colour = np.zeros((roof.n_vertices, 4), dtype=np.uint8)
    colour[:, 0] = 255
    plot_mesh(ax, roof.points, roof.faces, colour=colour)
    drawn = polygons(ax).get_facecolors()
    assert (drawn[:, 0] > 0.2).all()
    assert (drawn[:, 1:3] == 0).all()


def test_an_error_map_shows_the_size_of_each_deviation(ax, roof):
    deviation = np.linspace(-2, 1, roof.n_vertices)
    plot_error(ax, roof, deviation)
    (drawn,) = [c for c in ax.collections if c.get_array() is not None]
    assert drawn.get_array().tolist() == np.abs(deviation).tolist()
    assert drawn.get_clim() == (0, 2)
    with pytest.raises(ValueError, match=r"deviation has the shape \(3,\); the model has 25 vertices"):
        plot_error(ax, roof, deviation[:3])


def test_an_exact_mesh_has_an_error_map_too(ax, roof):
    plot_error(ax, roof, np.zeros(roof.n_vertices))
    ax.figure.canvas.draw()


@pytest.mark.parametrize("name", ["face:300", "jacksboro:40", "plane"])
def test_the_front_stands_beside_the_original_and_its_meshes(tmp_path, name):
    model = load_model(load(name))
    rng = np.random.default_rng(3)
    kept = rng.random((3, model.n_vertices)) < np.array([[0.2], [0.5], [0.8]])
    kept[:, model.corners] = True
    simplified = [simplify(model, row) for row in kept]
    F = [[s.quality.error, s.quality.triangles] for s in simplified]
    figure = front_figure(model, F, [(row, s.faces) for row, s in enumerate(simplified)], knee=1)
    figure.savefig(tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 20_000
    front, *panels = figure.axes
    assert front.get_title(loc="left").startswith(f"{model.name}: {model.n_vertices} vertices")
    assert len(panels) == 4
    counts = [len(polygons(panel).get_paths()) for panel in panels]
    assert counts == [len(model.faces), *(s.quality.triangles for s in simplified)]
    assert len({(panel.get_xlim(), panel.get_ylim()) for panel in panels}) == 1


def test_missing_meshes_leave_empty_panels(roof):
    figure = front_figure(roof, [[10.0, 2]], [])
    assert [panel.axison for panel in figure.axes[2:]] == [False, False, False]
