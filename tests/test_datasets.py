"""Built-in models: known answers, any size, helpful refusals."""

from __future__ import annotations

import itertools

import matplotlib.cbook
import numpy as np
import pytest
import trimesh
from samples import BODIES, CLOSED

from meshsimp_pymoo import datasets
from meshsimp_pymoo.datasets import describe, load, names
from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.surface.closed.model import ClosedModel, topology
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import Rules

SMALL = {"jacksboro": "jacksboro:40", "topobathy": "topobathy:9", "face": "face:300", "crater": "crater:13"}


def subset(model, *positions):
    """Return the chromosome that keeps the vertices at these (x, y) in the frame of the file."""
    xy = model.file_points[:, :2]
    kept = np.zeros(model.n_vertices, dtype=bool)
    for position in positions:
        found = np.flatnonzero((xy == position).all(axis=1))
        assert len(found) == 1, f"no single vertex at {position}"
        kept[found] = True
    return kept


CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


@pytest.mark.parametrize("name", [name for name in names() if name not in BODIES])
def test_every_other_built_in_is_an_open_height_field_that_can_be_simplified(name):
    model = build_model(load(SMALL.get(name, name)))
    assert model.up.tolist() == [0, 0, 1]
    everything = HeightSurface(model).simplify(np.ones(model.n_vertices, dtype=bool))
    assert everything.quality.error == pytest.approx(0, abs=1e-9 * model.diagonal * model.n_vertices)
    assert everything.quality.vertices == model.n_vertices


@pytest.mark.parametrize("name", CLOSED)
def test_a_closed_built_in_is_one_without_a_word_and_wound_outwards(name):
    source = load(name)
    assert topology(source.faces).is_sphere
    a, b, c = (source.points[source.faces[:, k]] for k in range(3))
    assert ((np.cross(a, b) * c).sum(axis=1) > 0).all()  # all of them are stars around the origin
    assert isinstance(open_model(name), ClosedModel)  # a warning would be an error
    assert len(source.points) == len(np.unique(source.points, axis=0)) == len(source.faces) // 2 + 2


def test_parts_are_taken_for_closed_surfaces_without_a_word_and_a_scan_with_one():
    assert isinstance(open_model("pebbles:100"), ClosedModel)
    assert isinstance(open_model("bracket:1000"), ClosedModel)
    with pytest.warns(ModelWarning, match="no height field but a closed surface with 2 holes"):
        assert isinstance(open_model("blob:200,holes=2"), ClosedModel)


@pytest.mark.parametrize(
    ("name", "vertices", "area"),
    [
        ("tetrahedron:3", 10, 8 * 3**0.5),
        ("tetrahedron:17", 514, 8 * 3**0.5),
        ("cube:3", 26, 24.0),
        ("cube:9", 386, 24.0),
        ("icosahedron:3", 42, 20 * 3**0.5),
        ("icosahedron:8", 492, 20 * 3**0.5),
    ],
)
def test_a_polyhedron_has_its_vertices_and_its_area(name, vertices, area):
    source = load(name)
    assert len(source.points) == vertices
    assert trimesh.Trimesh(source.points, source.faces, process=False).area == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize("name", ["sphere", "ellipsoid", "blob"])
@pytest.mark.parametrize("vertices", [12, 13, 2000])
def test_smooth_closed_models_have_exactly_the_wanted_number_of_vertices(name, vertices):
    source = load(name, vertices=vertices)
    assert len(source.points) == vertices
    assert topology(source.faces).is_sphere


def test_a_sphere_an_ellipsoid_and_a_blob_without_bumps_are_those():
    sphere = load("sphere:3000")
    np.testing.assert_allclose(np.linalg.norm(sphere.points, axis=1), 1.0, rtol=1e-14)
    volume = trimesh.Trimesh(sphere.points, sphere.faces, process=False).volume
    assert 0.995 * 4.0 / 3.0 * np.pi < volume < 4.0 / 3.0 * np.pi
    np.testing.assert_allclose(load("ellipsoid:3000").points / [3.0, 2.0, 1.0], sphere.points, rtol=1e-14)
    assert np.array_equal(load("blob:3000,bumps=0").points, sphere.points)
    assert np.array_equal(load("blob:3000,bumps=0,stretch=4").points[:, 0], 4.0 * sphere.points[:, 0])
    radius = np.log(np.linalg.norm(load("blob:3000").points, axis=1))
    assert 0.1 < radius.std() < 0.4


# How long the bracket's sharp edges are [mm]: from side to side, two of them crowned by 6 on 60, around both sides,
# around the boss and the hole.
CROWNED = 2.0 * np.hypot(1.0, 24.0 / 60.0 * np.linspace(0.0, 1.0, 10_001)).mean() * 30.0
SIDE = 80.0 + 10.0 + (45.0 + 12.5 * np.pi + 25.0) + 10.0 + 60.0
SHARP = 3 * 60.0 + 2 * CROWNED + 2 * SIDE + 2 * np.pi * (14.0 + 14.0 + 12.0 + 8.0 + 8.0)


@pytest.mark.parametrize("vertices", [1000, 1001, 3333, 12_000])
def test_a_bracket_is_one_closed_part_of_known_volume_and_known_sharp_edges(vertices):
    source = load("bracket", vertices=vertices)
    assert len(source.points) == len(np.unique(source.points, axis=0)) == vertices
    assert topology(source.faces).is_sphere
    part = trimesh.Trimesh(source.points, source.faces, process=False)
    boss = np.pi * (14.0**2 * 10.0 + (14.0**2 + 14.0 * 12.0 + 12.0**2) * 2.0 / 3.0 - 12.0**2 * 2.0 / 2.0)
    prism = 60.0 * (80.0 * 10.0 + 50.0 * 10.0 + (1.0 - np.pi / 4) * 25.0**2 + 6.0 * 2.0 / 3.0 * 60.0)
    assert part.volume == pytest.approx(prism + boss - np.pi * 8.0**2 * 5.0, rel=2e-3)
    ends = source.points[part.face_adjacency_edges[part.face_adjacency_angles > np.radians(30.0)]]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(SHARP, rel=2e-3)
    flat = part.face_adjacency_angles < 1e-6
    assert flat.mean() > 0.5  # so that there is something to take away
    assert part.face_adjacency_angles[part.face_adjacency_angles < np.radians(30.0)].max() < np.radians(20.0)


@pytest.mark.parametrize(("vertices", "parts"), [(36, 3), (4001, 2), (4000, 7)])
def test_pebbles_are_so_many_closed_parts_each_smaller_than_the_one_before_and_apart(vertices, parts):
    source = load("pebbles", vertices=vertices, parts=parts)
    what = topology(source.faces)
    assert (what.components, what.loops, what.genus, len(source.points)) == (parts, 0, 0, vertices)
    stones = trimesh.Trimesh(source.points, source.faces, process=False).split()
    assert all(stone.is_watertight and stone.volume > 0 for stone in stones)
    stones = sorted(stones, key=lambda stone: stone.bounds[0, 0])
    for one, two in itertools.pairwise(stones):
        assert two.bounds[0, 0] - one.bounds[1, 0] == pytest.approx(0.1)
        assert len(two.vertices) <= len(one.vertices)
    one, blob = load("pebbles:500,parts=1,bumps=0.25"), load("blob:500")
    assert np.array_equal(one.faces, blob.faces)
    np.testing.assert_allclose(np.ptp(one.points, axis=0), np.ptp(blob.points, axis=0), rtol=1e-14)


def _rims(faces):
    """Return the vertices of each closed row of edges that have one face, one after the other."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()
    both = {tuple(pair) for pair in ends}
    after = {a: b for a, b in ends if (b, a) not in both}
    rims = []
    while after:
        rims.append([next(iter(after))])
        while rims[-1][-1] in after:
            rims[-1].append(after.pop(rims[-1][-1]))
        assert rims[-1].pop() == rims[-1][0]
    return rims


@pytest.mark.parametrize(
    ("name", "holes"),
    [
        ("blob:500,holes=1", 1),
        ("blob:3000,holes=5", 5),
        ("blob:3000,holes=12", 12),
        ("blob:1000,seed=10,holes=1", 1),  # a face apart from the disc would be cut out too
        ("blob:200,seed=23,holes=1", 1),  # a face would hang in one vertex
    ],
)
def test_a_scan_of_a_blob_has_its_holes_of_different_sizes_with_ragged_rims_and_no_other_fault(name, holes):
    source, whole = load(name), load(name, holes=0)
    what = topology(source.faces)
    assert (what.components, what.loops, what.crowded, what.touching, what.mismatched) == (1, holes, 0, 0, 0)
    scan = trimesh.Trimesh(source.points, source.faces, process=False)
    assert scan.euler_number == 2 - holes  # no handle
    assert {tuple(point) for point in source.points.tolist()} < {tuple(point) for point in whole.points.tolist()}
    assert not source.is_closed
    rims = _rims(source.faces)
    assert [len(rims), len({vertex for rim in rims for vertex in rim})] == [holes, sum(map(len, rims))]
    if holes > 1:
        lengths = [np.linalg.norm(np.diff(source.points[[*rim, rim[0]]], axis=0), axis=1).sum() for rim in rims]
        assert max(lengths) > 1.5 * min(lengths)


@pytest.mark.parametrize("name", names())
def test_a_built_in_is_the_same_again_and_its_name_spells_it(name):
    one, two = load(SMALL.get(name, name)), load(SMALL.get(name, name))
    assert np.array_equal(one.points, two.points)
    assert np.array_equal(one.faces, two.faces)
    assert np.array_equal(load(one.name).points, one.points)


def test_jacksboro_is_the_whole_dem_in_metres_on_an_exact_grid():
    whole = load("jacksboro")
    assert whole.points.shape == (344 * 403, 3) == (138_632, 3)
    assert whole.points[:, 2].min() == 236
    assert whole.points[:, 2].max() == 1076
    dx, dy = whole.points[1, 0] - whole.points[0, 0], whole.points[0, 1] - whole.points[403, 1]
    assert dx == pytest.approx(74.4, abs=0.1)  # 3 seconds of arc at 36.6 degrees north
    assert dy == pytest.approx(92.7, abs=0.1)
    assert (dx * 1024).is_integer()
    assert (dy * 1024).is_integer()


def test_a_stride_takes_every_nth_post():
    whole, part = load("jacksboro"), load("jacksboro:11")
    every_11th = whole.points.reshape(344, 403, 3)[::11, ::11].reshape(-1, 3)
    assert len(part.points) == 32 * 37
    assert np.array_equal(part.points, every_11th)


def test_topobathy_has_its_north_up_and_sea_below_zero():
    source = load("topobathy")
    assert len(source.points) == 91 * 120
    with np.load(matplotlib.cbook.get_sample_data("topobathy.npz", asfileobj=False)) as file:
        north_row = file["topo"][np.argmax(file["latitude"])]
    northernmost = source.points[source.points[:, 1] == source.points[:, 1].max()]
    assert np.array_equal(northernmost[np.argsort(northernmost[:, 0]), 2], north_row)
    assert source.points[:, 2].min() < -1000


@pytest.mark.parametrize("side", [3, 17, 33])
def test_a_roof_is_exact_with_4_triangles_and_costs_its_known_error_without_its_ridge(side):
    roof = HeightSurface(build_model(load("roof", side=side)))
    ridge = roof.simplify(subset(roof.model, *CORNERS, (0, -1), (0, 1)))
    assert (ridge.quality.error, ridge.quality.triangles) == (0.0, 4)
    flat = roof.simplify(subset(roof.model, *CORNERS))
    assert (flat.quality.error, flat.quality.triangles) == (side * (side - 1) / 2, 2)


@pytest.mark.parametrize("side", [5, 17])
def test_a_pyramid_is_exact_with_4_triangles_and_costs_its_known_error_without_its_apex(side):
    pyramid = HeightSurface(build_model(load("pyramid", side=side)))
    apex = pyramid.simplify(subset(pyramid.model, *CORNERS, (0, 0)))
    assert (apex.quality.error, apex.quality.triangles) == (0.0, 4)
    flat = pyramid.simplify(subset(pyramid.model, *CORNERS))
    assert flat.quality.error == pytest.approx(side * (side - 2) / 3, rel=1e-12)


def test_a_plane_is_exact_with_2_triangles():
    plane = HeightSurface(open_model("plane"))
    flat = plane.simplify(subset(plane.model, *CORNERS))
    assert (flat.quality.error, flat.quality.triangles) == (0.0, 2)


@pytest.mark.parametrize("name", ["face", "ring", "horseshoe"])
@pytest.mark.parametrize("vertices", [60, 61, 922, 2622])
def test_scattered_models_have_exactly_the_wanted_number_of_vertices_on_one_surface(name, vertices):
    model = build_model(load(name, vertices=vertices))
    assert model.n_vertices == vertices
    assert model.facts.components == 1
    assert model.facts.border_loops == (2 if name == "ring" else 1)
    assert model.facts.pinch_vertices == 0


def test_the_seed_moves_the_vertices_of_a_face_and_the_noise_its_heights():
    face, other = load("face:300"), load("face:300,seed=2")
    assert not np.array_equal(face.points[:, :2], other.points[:, :2])
    smooth = load("face:300,noise=0")
    assert np.array_equal(face.points[:, :2], smooth.points[:, :2])
    deviation = face.points[:, 2] - smooth.points[:, 2]
    assert deviation.std() == pytest.approx(0.08, rel=0.2)


def test_a_face_has_a_nose_above_its_cheeks_and_eyes_in_sockets():
    face = load("face:20000,noise=0")

    def height(x, y):
        return face.points[np.argmin(np.hypot(face.points[:, 0] - x, face.points[:, 1] - y)), 2]

    assert height(0, -22) > height(35, -22) + 20
    assert height(0, 20) > height(22, 20) + 5
    assert height(40, -5) > height(60, -5)
    assert height(0, -53) < height(0, -48)  # the line between the lips


@pytest.mark.parametrize(("name", "least"), [("ring", 0.1), ("horseshoe", 0.2)])
def test_hull_triangles_outside_the_outline_are_left_out_by_the_footprint(name, least):
    model = open_model(name)
    kept = np.ones(model.n_vertices, dtype=bool)

    def area(footprint):
        corners = model.points[HeightSurface(model, Rules(footprint=footprint)).simplify(kept).faces][:, :, :2]
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        return 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()

    assert area("model") < (1 - least) * area("hull")


def test_a_terrain_can_be_scattered_to_any_number_of_its_posts():
    whole, part = load("jacksboro:5"), load("jacksboro:5,vertices=922")
    assert len(part.points) == 922
    posts = {tuple(point) for point in whole.points.tolist()}
    assert all(tuple(point) in posts for point in part.points.tolist())
    for axis in (0, 1):  # the corners stay, so the terrain keeps its extent
        assert part.points[:, axis].min() == whole.points[:, axis].min()
        assert part.points[:, axis].max() == whole.points[:, axis].max()
    assert build_model(part).facts.border_loops == 1


def test_parameters_by_keyword_win_over_spelled_ones():
    assert load("roof:17", side=9).name == "roof:9"
    assert load("roof").name == load("roof:17").name == "roof"
    assert load("face:300,noise=0").name == "face:300,noise=0.0"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("jaksboro", r"jaksboro: no such file, .*did you mean 'jacksboro'\?\); built-in models: jacksboro, "),
        ("Roof:17", r"did you mean 'roof'\?"),
        ("qqqq", r"no built-in model of that name; built-in models: jacksboro, topobathy, face"),
        ("roof:18", r"roof:18: side is 18; it must be a power of two plus one \(say 17 or 33\)"),
        ("roof:1", r"side is 1; it must be 3 to 4097"),
        ("roof:1.5", r"side must be a whole number, not '1.5'"),
        ("roof:", r"side must be a whole number, not ''"),
        ("roof:big", r"side must be a whole number, not 'big'"),
        ("face:59", r"vertices is 59; it must be 60 to 2000000"),
        ("face:300,2", r"'2' needs a name, as in face:300,seed=2"),
        ("face:300,sed=2", r"no parameter 'sed' \(did you mean 'seed'\?\); face takes vertices, seed, noise"),
        ("face:300,vertices=300", r"vertices is given twice"),
        ("face:300,seed=-1", r"seed must be 0 or more, not -1"),
        ("face:300,noise=-1", r"noise is -1; it must be 0 or more"),
        ("face:300,noise=nan", r"noise must be a number, not 'nan'"),
        ("jacksboro:0", r"stride is 0; a grid of 344 x 403 posts can be read at 1 to 343"),
        ("jacksboro:344", r"stride is 344; "),
        ("tetrahedron:8", r"side is 8; it must be a power of two plus one \(say 5 or 9\)"),
        ("icosahedron:2", r"side is 2; it must be 3 to 513"),
        ("sphere:11", r"vertices is 11; it must be 12 to 2000000"),
        ("ellipsoid:99,b=0", r"b is 0; a semi-axis must be more than 0"),
        ("blob:99,bumps=1", r"bumps is 1; it must be 0 to 0.5"),
        ("blob:99,stretch=-1", r"stretch is -1; it must be more than 0"),
        ("blob:99,holes=13", r"holes is 13; it must be 0 to 12"),
        ("blob:99,holes=-1", r"holes is -1; it must be 0 to 12"),
        ("blob:99,holes=9", r"holes is 9; so many do not fit among 99 vertices"),
        ("pebbles:23", r"vertices is 23; it must be 24 to 2000000"),
        ("pebbles:99,parts=0", r"parts is 0; it must be 1 to 12"),
        ("pebbles:99,bumps=-1", r"bumps is -1; it must be 0 to 0.5"),
        ("bracket:999", r"vertices is 999; it must be 1000 to 2000000"),
        ("jacksboro:11,vertices=5000", r"vertices is 5000; it must be 4 to 1184"),
    ],
)
def test_wrong_names_and_parameters_are_refused_with_the_way_out(name, message):
    with pytest.raises(ModelError, match=message) as caught:
        load(name)
    assert "\n" not in str(caught.value)


def test_true_is_no_number():
    with pytest.raises(ModelError, match="side must be a whole number, not True"):
        load("roof", side=True)


def test_describe_lists_every_model_with_its_parameters():
    lines = describe()
    assert list(lines) == names()
    assert lines["face"].startswith("face:vertices=2500,seed=1,noise=0.08 - a synthetic scan of a face")
    assert all("\n" not in line and not line.endswith(".") for line in lines.values())


def test_missing_sample_data_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(matplotlib.cbook, "get_sample_data", lambda file, asfileobj: str(tmp_path / file))
    with pytest.raises(ModelError, match=r"jacksboro_fault_dem.npz is missing; reinstall matplotlib"):
        datasets.load("jacksboro")
