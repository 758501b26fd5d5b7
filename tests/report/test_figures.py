"""Pictures show the numbers they are given."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from scans import bowl

from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.report import figures as figures_module
from meshsimp_pymoo.report.figures import (
    AMBIENT,
    ERROR_SHADE,
    LIGHT,
    _Depth,
    error_figure,
    front_figure,
    hillshade,
    panel_rows,
    plot_error,
    plot_front,
    plot_mesh,
    winding,
)
from meshsimp_pymoo.surface.height import HeightSurface


@pytest.fixture
def ax():
    return Figure().subplots()


def test_a_measure_that_is_none_is_refused_before_anything_is_drawn(ax, roof):
    for draw in (
        lambda: plot_front([[1.0, 2.0]], ax, measure="sum of squares"),
        lambda: front_figure(roof, [[1.0, 2.0]], [], measure="sum of squares"),
    ):
        with pytest.raises(ValueError, match="measure='sum of squares' is unknown; choose one of 'error'"):
            draw()
    assert not ax.lines


def test_a_model_in_place_of_a_surface_is_told_apart(roof):
    nothing = np.zeros(25)
    for draw in (
        lambda: plot_error(roof.model, nothing),
        lambda: error_figure(roof.model, nothing, nothing),
        lambda: front_figure(roof.model, [[1.0, 2.0]], []),
    ):
        with pytest.raises(TypeError, match=r"a OpenModel has no rules; give a surface, such as problem\.surface"):
            draw()


@pytest.fixture(scope="module")
def roof():
    return HeightSurface(open_model("roof:5"))


def polygons(ax):
    (collection,) = [c for c in ax.collections if isinstance(c, PolyCollection)]
    return collection


def points_drawn(ax):
    (line,) = [line for line in ax.get_lines() if "solutions" in str(line.get_label())]
    return np.column_stack(line.get_data())


def test_every_solution_of_a_front_is_drawn(ax):
    F = np.array([[3.0, 2], [1.0, 9], [2.0, 4]])
    assert plot_front(F, ax) is ax
    assert points_drawn(ax).tolist() == [[2, 3], [9, 1], [4, 2]]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("triangles, log scale", "error [model units], log scale")


def test_the_mean_error_is_drawn_when_the_number_of_vertices_is_known(ax):
    plot_front([[30.0, 2], [10.0, 9]], ax, n_points=10)
    assert points_drawn(ax)[:, 1].tolist() == [3, 1]
    assert ax.get_ylabel() == "mean error per vertex [model units], log scale"


def test_knee_and_chosen_are_marked_where_they_are(ax):
    plot_front([[9.0, 2], [2.0, 4], [1.0, 9]], ax, knee=1, chosen=2, marked=[0, 1])
    labelled = {line.get_label(): np.column_stack(line.get_data()).tolist() for line in ax.get_lines()}
    assert labelled["knee"] == [[4, 2]]
    assert labelled["chosen"] == [[9, 1]]
    assert {text.get_text(): text.xy for text in ax.texts} == {"a": (2, 9), "b": (4, 2)}  # on their points
    assert all(text.get_position() == text.xy for text in ax.texts)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["3 solutions", "knee", "chosen"]


@pytest.mark.parametrize(
    ("F", "scale"),
    [
        ([[3.0, 10], [2.0, 20], [1.0, 30]], "log"),
        ([[3.0, 10]], "log"),
        ([[300.0, 10], [2.0, 20], [1e-3, 300]], "log"),
        ([[300.0, 10], [2.0, 20], [0.0, 300]], "symlog"),
        ([[300.0, 10], [2.0, 20], [1e-9, 300]], "symlog"),
        ([[0.0, 2]], "linear"),
    ],
)
def test_both_axes_are_logarithmic_and_say_so(ax, F, scale):
    plot_front(F, ax)
    ax.figure.canvas.draw()
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", scale)
    assert ("log scale" in ax.get_ylabel()) == (scale != "linear")
    for at, (low, high) in enumerate((ax.get_ylim(), ax.get_xlim())):
        assert low < min(row[at] for row in F) <= max(row[at] for row in F) < high
    if scale == "symlog":
        ticks = ax.get_yticks()
        assert ticks[0] == 0
        exact, next_one = ax.transData.transform([[10, 0], [10, ticks[1]]])[:, 1]
        assert next_one - exact > 20  # pixels: the labels do not touch


def test_small_ranges_have_readable_ticks(ax):
    plot_front([[36.0, 2], [13.0, 3], [0.0, 4]], ax, n_points=81)
    ax.figure.canvas.draw()
    shown = [label.get_text() for label in ax.get_yticklabels() if label.get_text()]
    assert shown[:4] == ["0", "0.1", "0.2", "0.5"]


def test_whatever_has_objectives_is_a_front_and_nothing_else(ax):
    class Result:
        F = np.array([[3.0, 2], [1.0, 9]])

    plot_front(Result(), ax, measure="max_error")
    assert points_drawn(ax).tolist() == [[2, 3], [9, 1]]
    assert ax.get_ylabel() == "max error [model units], log scale"
    with pytest.raises(ValueError, match=r"a front has the shape \(solutions, 2\).*this one has \(3,\)"):
        plot_front([1.0, 2.0, 3.0], ax)


def test_without_axes_a_figure_is_made(roof):
    from matplotlib import pyplot

    drawn = [plot_front([[3.0, 2]]), plot_mesh(roof), plot_error(roof, np.ones(roof.n_vertices))]
    assert len({ax.figure for ax in drawn}) == 3
    assert {ax.figure.number for ax in drawn} <= set(pyplot.get_fignums())
    pyplot.close("all")


def test_a_problem_a_surface_a_model_a_trimesh_and_arrays_are_drawn_alike(roof):
    mesh = trimesh.Trimesh(roof.points, roof.faces, process=False)
    drawn = []
    for shape in (MeshProblem(roof), roof, roof.model, mesh, (roof.points, roof.faces)):
        ax = Figure().subplots()
        plot_mesh(shape, ax)
        drawn.append((polygons(ax).get_facecolors().tolist(), ax.get_xlim(), ax.get_ylim()))
    assert all(other == drawn[0] for other in drawn[1:])
    with pytest.raises(TypeError, match="a str is no mesh; give a MeshProblem, an OpenModel"):
        plot_mesh("roof", Figure().subplots())


def test_the_kept_vertices_of_a_surface_are_drawn_as_their_mesh(roof):
    kept = np.isin(np.arange(roof.n_vertices), roof.model.corners)
    for shape in (roof, MeshProblem(roof)):
        assert len(polygons(plot_mesh(shape, Figure().subplots(), kept=kept)).get_paths()) == 2
    for shape in (roof.model, (roof.points, roof.faces)):
        name = type(shape).__name__
        with pytest.raises(TypeError, match=f"by a problem's rules, which a {name} does not have; give the problem or"):
            plot_mesh(shape, Figure().subplots(), kept=kept)


def test_the_kept_vertices_are_drawn_by_the_rules():
    paths = []
    for footprint in ("model", "hull"):
        ring = MeshProblem("ring", footprint=footprint)
        paths.append(len(polygons(plot_mesh(ring, Figure().subplots(), kept=ring.pinned)).get_paths()))
    assert paths[0] < paths[1]


def test_the_mesh_of_a_subset_is_drawn_by_the_rules_of_its_problem(ax):
    """All vertices of a horseshoe and its convex hull: the bay is covered too, as the problem says."""
    problem = MeshProblem("horseshoe:150", footprint="hull")
    everything = np.ones(problem.n_var, bool)
    assert problem.quality(everything).triangles == 255
    assert len(polygons(plot_mesh(problem, ax, kept=everything)).get_paths()) == 255
    with pytest.raises(TypeError, match=r"which a OpenModel does not have; give the problem or problem\.surface"):
        plot_mesh(problem.model, ax, kept=everything)


def test_the_colours_of_a_trimesh_show(ax, roof):
    colours = np.tile(np.array([255, 0, 0, 255], dtype=np.uint8), (roof.n_vertices, 1))
    plot_mesh(trimesh.Trimesh(roof.points, roof.faces, vertex_colors=colours, process=False), ax)
    assert (polygons(ax).get_facecolors()[:, 1:3] == 0).all()


def test_a_mesh_is_drawn_with_all_its_triangles_at_their_place(ax, roof):
    plot_mesh(roof, ax)
    drawn = np.array([path.vertices[:3] for path in polygons(ax).get_paths()])
    assert len(drawn) == len(roof.faces)
    expected = roof.points[roof.faces][:, :, :2]
    assert sorted(np.round(drawn, 9).tolist()) == sorted(np.round(expected, 9).tolist())
    assert ax.get_aspect() == 1


def test_the_nearest_triangles_are_drawn_last(ax):
    points = np.array([[0, 0, 5], [1, 0, 5], [0, 1, 5], [0, 0, 1], [1, 0, 1], [0, 2, 1]], dtype=float)
    plot_mesh((points, [[0, 1, 2], [3, 4, 5]]), ax)
    heights = [np.ptp(path.vertices[:3, 1]) for path in polygons(ax).get_paths()]
    assert heights == [2, 1]


def test_from_the_side_a_roof_shows_its_height(ax, roof):
    plot_mesh(roof, ax, view=(0, 0))
    drawn = np.concatenate([path.vertices[:3] for path in polygons(ax).get_paths()])
    assert np.ptp(drawn[:, 0]) == pytest.approx(np.ptp(roof.points[:, 0]))
    assert np.ptp(drawn[:, 1]) == pytest.approx(1.0)
    middle = roof.points[:, 0].mean()
    assert drawn[np.argmax(drawn[:, 1]), 0] == pytest.approx(middle)  # the ridge is up


def test_a_flat_roof_is_exaggerated_only_when_asked(roof):
    low, high = Figure().subplots(1, 2)
    for ax, factor in ((low, 1.0), (high, 4.0)):
        plot_mesh(roof, ax, view=(0, 0), exaggeration=factor)
    assert np.ptp(high.get_ylim()) > 3 * np.ptp(low.get_ylim())


def test_a_slope_towards_the_light_is_brighter_than_one_away_from_it(ax, roof):
    plot_mesh(roof, ax)
    colours = polygons(ax).get_facecolors()
    middle = roof.points[:, 0].mean()
    left = np.array([path.vertices[:3, 0].mean() < middle for path in polygons(ax).get_paths()])
    assert colours[left, :3].mean() > colours[~left, :3].mean() + 0.2


def test_steep_slopes_in_the_shade_keep_their_shape():
    """Faces that turn away from the light are darker the more they do, but none is black."""
    axis = np.array([LIGHT[1], -LIGHT[0], 0.0])
    down = np.array([-LIGHT[0], -LIGHT[1], 0.0]) / np.hypot(*LIGHT[:2])
    steepness = np.radians([20, 40, 60, 80])
    slopes = [np.array([0 * axis, axis, np.cos(t) * down - [0, 0, np.sin(t)]])[[0, 2, 1]] for t in steepness]
    normals = [np.cross(s[1] - s[0], s[2] - s[0]) for s in slopes]
    assert all(normal[2] > 0 for normal in normals)
    shades = hillshade(np.array(slopes))
    assert (np.diff(shades) < -0.05).all()
    assert shades[-1] > 1.2 * AMBIENT


def test_a_face_seen_from_behind_is_lit_like_one_from_the_front():
    triangle = np.array([[0.0, 0, 0], [1, 0, 0.3], [0, 1, 0.2]])
    front, back = hillshade(np.array([triangle, triangle[::-1]]))
    assert front == pytest.approx(back)


def test_shading_follows_the_cosine_and_survives_a_triangle_without_area():
    u = np.cross(LIGHT, [0, 0, 1.0])
    v = np.cross(LIGHT, u)
    towards = np.array([0 * u, u, v])
    beside = np.array([[0.0, 0, 0], LIGHT, [LIGHT[1], -LIGHT[0], 0]])[[0, 2, 1]]  # the light grazes it
    shades = hillshade(np.array([towards, beside, np.zeros((3, 3))]))
    np.testing.assert_allclose(shades, [1.0, (1 + AMBIENT) / 2, AMBIENT], atol=1e-12)


def test_vertex_colours_show(ax, roof):
    colour = np.zeros((roof.n_vertices, 4), dtype=np.uint8)
    colour[:, 0] = 255
    plot_mesh(roof, ax, colour=colour)
    drawn = polygons(ax).get_facecolors()
    assert (drawn[:, 0] > 0.2).all()
    assert (drawn[:, 1:3] == 0).all()


def test_an_error_map_shows_the_size_of_each_deviation(ax, roof):
    deviation = np.linspace(-2, 1, roof.n_vertices)
    plot_error(roof, deviation, ax)
    (drawn,) = [c for c in ax.collections if c.get_array() is not None]
    assert drawn.get_array().tolist() == np.abs(deviation).tolist()
    assert drawn.get_clim() == (0, 2)
    assert [text for text in (axes.get_ylabel() for axes in ax.figure.axes) if text] == ["error [model units]"]
    with pytest.raises(ValueError, match=r"deviation has the shape \(3,\); the model has 25 vertices"):
        plot_error(roof, deviation[:3], ax)


def test_uncovered_vertices_are_marked_where_they_are(ax, roof):
    covered = np.ones(roof.n_vertices, dtype=bool)
    covered[[3, 7]] = False
    assert plot_error(roof, np.ones(roof.n_vertices), ax, covered=covered, largest=0.5, bar=False) is ax
    (marks,) = ax.get_lines()
    expected = roof.points[[3, 7], :2]
    np.testing.assert_allclose(np.column_stack(marks.get_data()), expected)
    assert ax.figure.axes == [ax]
    figure = error_figure(roof, np.ones(roof.n_vertices), covered, title="mine")
    assert figure.axes[0].get_title() == "mine\nblue: 2 uncovered vertices"


def test_an_exact_mesh_has_an_error_map_too(ax, roof):
    plot_error(roof, np.zeros(roof.n_vertices), ax)
    ax.figure.canvas.draw()


@pytest.mark.parametrize("name", ["face:300", "jacksboro:40", "plane"])
def test_the_front_stands_beside_the_original_and_its_meshes(tmp_path, name):
    surface = HeightSurface(open_model(name))
    model = surface.model
    rng = np.random.default_rng(3)
    kept = rng.random((3, model.n_vertices)) < np.array([[0.2], [0.5], [0.8]])
    kept[:, model.corners] = True
    simplified = [surface.simplify(row) for row in kept]
    F = [[s.quality.error, s.quality.triangles] for s in simplified]
    figure = front_figure(surface, F, [(row, s.faces) for row, s in enumerate(simplified)], knee=1)
    figure.savefig(tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 20_000
    front, *panels = figure.axes
    assert front.get_title(loc="left").startswith(f"{model.name}: {model.n_vertices} vertices")
    assert len(panels) == 4
    counts = [len(polygons(panel).get_paths()) for panel in panels]
    assert counts == [len(model.faces), *(s.quality.triangles for s in simplified)]
    assert len({(panel.get_xlim(), panel.get_ylim()) for panel in panels}) == 1
    assert [("knee" in panel.get_title()) for panel in panels] == [False, False, True, False]


def test_the_panels_show_sizes_that_differ_though_most_solutions_are_large():
    sizes = np.unique(np.round(2000 - np.geomspace(1, 1999, 300)).astype(int))  # crowded below 2000
    small, middle, large = sizes[panel_rows(sizes)]
    assert small < 100
    assert middle < large / 2


@pytest.mark.parametrize("count", [1, 2, 3, 4, 102])
def test_the_knee_and_the_chosen_mesh_are_always_among_the_panels(count):
    sizes = np.geomspace(2, 900, count)
    for knee in {0, count // 2, count - 1}:
        for chosen in {0, count // 3, count - 1}:
            rows = panel_rows(sizes, chosen, knee)
            assert {knee, chosen} <= set(rows)
            assert rows == sorted(set(rows))
            assert len(rows) == min(3, count)
            assert 0 <= rows[0] <= rows[-1] < count


def test_other_fronts_are_drawn_behind_in_the_same_units(ax):
    plot_front([[40.0, 2], [10.0, 9]], ax, n_points=10, series={"start": [[20.0, 9], [50.0, 2]]})
    behind, own = ax.get_lines()[:2]
    assert behind.get_label() == "start"
    assert behind.get_xydata().tolist() == [[2.0, 5.0], [9.0, 2.0]]
    assert own.get_xydata().tolist() == [[2.0, 4.0], [9.0, 1.0]]
    assert ax.get_ylim()[1] > 5
    assert "start" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_missing_meshes_leave_empty_panels(roof):
    figure = front_figure(roof, [[10.0, 2]], [])
    assert [panel.axison for panel in figure.axes[2:]] == [False, False, False]


def test_a_long_name_leaves_the_axes_their_room(roof, tmp_path):
    import dataclasses

    model = dataclasses.replace(roof.model, name="scans/" + "a_" * 60 + ".asc")
    figure = front_figure(HeightSurface(model), [[10.0, 2]], [])
    figure.savefig(tmp_path / "front.png")  # matplotlib's warning that it gives up would be an error
    front = figure.get_axes()[0]
    assert front.get_title(loc="left").startswith("a_a_")
    assert front.get_position().width * figure.subfigs[0].bbox.width > 0.7 * figure.subfigs[0].bbox.width


def test_a_mesh_of_more_triangles_than_a_panel_has_pixels_is_drawn_only_if_it_is_chosen():
    sizes = [10, 100, 1000, 10_000, 2_000_000]
    assert panel_rows(sizes, None, 4) == [0, 2, 3]
    assert panel_rows(sizes, 4, 3) == [0, 3, 4]
    assert panel_rows([600_000, 700_000, 800_000]) == [0, 1, 2]  # there are no others


# ------------------------------------------------------------------------------------------------------------ bodies


@pytest.fixture(scope="module")
def blob():
    return MeshProblem("blob:300").surface


@pytest.fixture
def coarse(monkeypatch):
    """Pictures of bodies of few pixels, to be quick."""
    monkeypatch.setattr(figures_module, "BODY_PIXELS", 120)


def image(ax):
    """Return what is drawn of a body: colours and opacity (height, width, 4), row 0 the lowest."""
    (drawn,) = ax.get_images()
    return np.asarray(drawn.get_array())


def box(low, high):
    """Return a closed box: points (8, 3) and triangles (12, 3)."""
    mesh = trimesh.creation.box(bounds=[low, high])
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


@pytest.mark.usefixtures("coarse")
def test_a_body_is_drawn_with_what_is_in_front_alone(ax):
    """A small cube hides part of a long board behind it, whose middle is nearer to the viewer than the cube's."""
    (near, first), (far, second) = box([0, 0, 1], [2, 2, 2]), box([-1, -1, -9], [9, 3, 0])
    far = far @ np.array([[1, 0, 1.0], [0, 1, 0], [0, 0, 1]])  # its right end comes to the viewer
    points, faces = np.concatenate([near, far]), np.concatenate([first, second + len(near)])
    colour = np.repeat(np.array([[255, 0, 0], [0, 0, 255]], np.uint8), 8, axis=0)
    plot_mesh((points, faces), ax, colour=colour, view=(0, 0), edges=False)
    drawn = image(ax)
    left, right, bottom, top = ax.get_images()[0].get_extent()
    height, width = drawn.shape[:2]
    x, y = int((1 - left) / (right - left) * width), int((1 - bottom) / (top - bottom) * height)
    assert drawn[y, x, 0] > 0.3
    assert drawn[y, x, 2] == 0
    assert drawn[y, int(0.9 * width), 2] > 0.3
    assert drawn[y, int(0.9 * width), 0] == 0


@pytest.mark.usefixtures("coarse")
def test_whatever_has_no_border_is_a_body_and_all_are_drawn_alike(blob):
    mesh = trimesh.Trimesh(blob.points, blob.faces, process=False)
    shapes = (blob, MeshProblem(blob.model), blob.model, mesh, (blob.points, blob.faces))
    drawn = [image(plot_mesh(shape, Figure().subplots())) for shape in shapes]
    assert all(np.array_equal(other, drawn[0]) for other in drawn[1:])
    open_mesh = (blob.points, blob.faces[1:])
    assert len(polygons(plot_mesh(open_mesh, Figure().subplots())).get_paths()) == len(blob.faces) - 1


@pytest.mark.usefixtures("coarse")
def test_the_outline_of_a_body_is_that_of_its_points(blob, ax):
    plot_mesh(blob, ax, view=(0, 0))
    left, right, bottom, top = ax.get_images()[0].get_extent()
    step = (right - left) / image(ax).shape[1]
    expected = [side(blob.points[:, k]) for k in (0, 1) for side in (np.min, np.max)]
    np.testing.assert_allclose([left, right, bottom, top], expected, atol=2 * step)
    opaque = image(ax)[..., 3]
    assert 0.6 < opaque.mean() < 0.95  # of a box around something round
    assert opaque[0, 0] == 0


@pytest.mark.usefixtures("coarse")
def test_turned_half_round_a_body_is_seen_in_a_mirror(blob):
    front, back = (
        image(plot_mesh(blob, Figure().subplots(), view=view, edges=False))[..., 3] for view in ((0, 0), (0, 180))
    )
    assert np.abs(front - back[:, ::-1]).mean() < 0.01
    above = image(plot_mesh(blob, Figure().subplots(), view=(90, 0), edges=False))
    assert above.shape[0] / above.shape[1] == pytest.approx(np.ptp(blob.points[:, 2]) / np.ptp(blob.points[:, 0]), 0.02)


@pytest.mark.usefixtures("coarse")
def test_the_edges_of_a_small_body_are_outlined(blob):
    with_edges, without = (
        image(plot_mesh(blob, Figure().subplots(), edges=edges))[..., :3].mean() for edges in (True, False)
    )
    assert 0.75 * without < with_edges < 0.97 * without
    assert np.array_equal(
        image(plot_mesh(blob, Figure().subplots())), image(plot_mesh(blob, Figure().subplots(), edges=True))
    )


@pytest.mark.usefixtures("coarse")
def test_errors_on_a_body_are_seen_from_both_sides(blob):
    """Where the error is the height in the picture, colours change with it; and so on the other side."""
    from matplotlib import colormaps

    ax = Figure().subplots()
    size = blob.points[:, 1] - blob.points[:, 1].min()
    plot_error(blob, size, ax)
    front, back = ax.get_images()
    assert front.get_extent()[1] < back.get_extent()[0]
    near = Figure().subplots()
    plot_error(blob, blob.points[:, 2] - blob.points[:, 2].min(), near)  # what is in front is off, the back is not
    bright = [
        rgba[rgba[..., 3] == 1, :3].mean() for rgba in (np.asarray(part.get_array()) for part in near.get_images())
    ]
    assert bright[0] < 0.7 * bright[1]
    assert ax.get_xlim()[0] < front.get_extent()[0] < back.get_extent()[1] < ax.get_xlim()[1]
    for drawn in (front, back):
        rgba = np.asarray(drawn.get_array())
        column = rgba[:, rgba.shape[1] // 2]
        shown = column[column[:, 3] == 1, :3]
        hue = [part / part.max() for part in (shown[len(shown) // 10], shown[9 * len(shown) // 10])]
        low, high = (np.array(colormaps["magma_r"](value)[:3]) for value in (0.1, 0.9))
        np.testing.assert_allclose(hue, [low / low.max(), high / high.max()], atol=0.25)
        assert shown.max(axis=1).min() > 0
    assert [text for text in (axes.get_ylabel() for axes in ax.figure.axes) if text] == ["error [model units]"]


@pytest.mark.usefixtures("coarse")
def test_an_exact_mesh_of_a_body_is_pale_all_over(blob):
    ax = Figure().subplots()
    plot_error(blob, np.zeros(blob.n_vertices), ax, bar=False)
    rgba = np.concatenate([np.asarray(drawn.get_array()).reshape(-1, 4) for drawn in ax.get_images()])
    shown = rgba[rgba[:, 3] == 1, :3]
    assert (shown[:, 0] >= 0.98 * ERROR_SHADE).all()
    hue = shown / shown.max(axis=1, keepdims=True)
    assert np.ptp(hue, axis=0).max() < 0.01


@pytest.mark.usefixtures("coarse")
def test_the_front_of_a_body_stands_beside_its_meshes(tmp_path, blob):
    kept = np.random.default_rng(3).random((3, blob.n_vertices)) < np.array([[0.2], [0.5], [0.8]])
    simplified = [blob.simplify(row) for row in kept | blob.pinned]
    F = [[s.quality.error, s.quality.triangles] for s in simplified]
    figure = front_figure(blob, F, [(row, s.faces) for row, s in enumerate(simplified)], knee=1)
    figure.savefig(tmp_path / "front.png")
    front, *panels = figure.axes
    assert front.get_title(loc="left").startswith("blob:300: 300 vertices, 596 triangles")
    assert [len(panel.get_images()) for panel in panels] == [1, 1, 1, 1]
    assert len({(panel.get_xlim(), panel.get_ylim()) for panel in panels}) == 1
    figure = error_figure(blob, simplified[0].deviation, simplified[0].covered, title="mine")
    assert figure.axes[0].get_title() == "mine"


@pytest.mark.usefixtures("coarse")
def test_a_body_with_holes_shows_its_inside_in_another_tone_however_it_is_wound():
    shape = bowl()
    points, faces = np.array(shape.vertices), np.array(shape.faces)
    assert winding(points, faces) == 1
    assert winding(points, faces[:, ::-1]) == -1
    middle = []
    for view in ((0, 0), (0, 180)):  # z is to the viewer: into the bowl, and at its back
        for wound in (faces, faces[:, ::-1]):
            drawn = image(plot_mesh((points, wound), Figure().subplots(), view=view, edges=False, is_body=True))
            red, _, blue = drawn[drawn.shape[0] // 2, drawn.shape[1] // 2, :3]
            middle.append(bool(blue > red))
    assert middle == [True, True, False, False]


@pytest.mark.usefixtures("coarse")
def test_rims_are_drawn_where_the_body_does_not_hide_them():
    shape = bowl()
    mesh = (np.array(shape.vertices), np.array(shape.faces))
    drawn = {}
    for view in ((0, 0), (0, 180)):
        panel = plot_mesh(mesh, Figure().subplots(), view=view, is_body=True)
        segments = [part.get_segments() for part in panel.collections]
        drawn[view] = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for part in segments for line in part)
    table = edge_table(mesh[1])
    ends = mesh[0][table.ends[table.n_triangles == 1]][..., :2]
    whole = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()
    assert drawn[0, 0] == pytest.approx(whole, rel=0.02)  # all of them, from above the bowl
    assert drawn[0, 180] < 0.5 * whole


@pytest.mark.usefixtures("coarse")
def test_uncovered_vertices_of_a_body_are_marked():
    surface = MeshProblem(bowl(), surface="closed").surface
    blue = []
    for covered in (False, True):
        panel = Figure().subplots()
        plot_error(
            surface, np.zeros(surface.n_vertices), panel, covered=np.full(surface.n_vertices, covered), bar=False
        )
        drawn = [np.asarray(part.get_array()) for part in panel.get_images()]
        blue.append(sum((part[..., 2] > part[..., 0]).sum() for part in drawn))
    assert blue[0] > 1.5 * blue[1]  # but for the inside


def test_a_line_that_leads_away_from_the_viewer_is_not_drawn():
    depth = _Depth(np.zeros((4, 4)), np.zeros(2), 0.25, 0.01)
    away = np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 1.0]])
    across = np.array([[0.1, 0.5, 0.0], [0.9, 0.5, 0.0]])
    (seen,) = depth.in_sight([away, across])
    np.testing.assert_allclose(seen[[0, -1]], across[:, :2])
