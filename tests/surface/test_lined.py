"""Whatever is inserted, removed and moved beside lines: tried as done, done as from scratch."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import replace

import numpy as np
import pytest
from counts import tried
from lining import random_segments, with_segments
from nasty import nasty_model
from pymoo.optimize import minimize
from samples import surface
from test_nasty import walk

from meshsimp_pymoo import MeshProblem, Moves, memetic
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.surface.lining import lined_model
from meshsimp_pymoo.surface.live_triangulation import LiveTriangulation
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES
from meshsimp_pymoo.surface.surface import mesh_lines

# Lattices, where vertices lie on lines, clouds, where none do; hubs, gaps, twins, slivers at the hull.
MODELS = [
    "checkerboard", "rings", "double comb", "straight fan", "wheel", "flat",
    "slivers", "twins", "spiral", "bow ties", "pins", "long and thin",
]  # fmt: skip
MEASURES = ["error", "max_error", "rms_error"]
LOOK = 10


@tried("moves", 210)
@pytest.mark.parametrize("name", MODELS)
def test_what_is_tried_beside_lines_is_what_is_done_and_as_from_scratch(name, moves):
    model = nasty_model(name)
    for k, (footprint, outside) in enumerate(itertools.product(FOOTPRINTS, OUTSIDES)):
        rounding = (1e-9 if name == "slivers" else 1e-11) * model.n_vertices * model.diagonal
        rng = np.random.default_rng(k)
        highest = np.flatnonzero(np.r_[True, (model.xy[1:] != model.xy[:-1]).any(axis=1)])
        segments, _ = random_segments(model.xy, rng, 3 + 6 * k, among=highest)
        lined = surface(
            with_segments(model, segments), footprint=footprint, outside=outside, measure=MEASURES[k % len(MEASURES)]
        )
        if lined.rules.measure == "rms_error":  # the root of a sum of squares is less exact near 0, by the root
            rounding = max(rounding, 1e-7 * model.diagonal)
        kept = lined.pinned | (rng.random(model.n_vertices) < rng.random())
        live = LiveTriangulation(lined, kept)
        for step, (error, triangles), expected in walk(live, moves, rng):
            if triangles and live.triangles:
                assert expected[1] == live.triangles - triangles
                assert expected[0] == pytest.approx(live.error - error, rel=1e-9, abs=rounding)
            if step % LOOK == LOOK - 1 and live.triangles:
                scratch = lined.simplify(live.kept)
                np.testing.assert_array_equal(live.faces, scratch.faces)
                wanted = getattr(scratch.quality, lined.rules.measure)
                assert live.error == pytest.approx(wanted, rel=1e-9, abs=rounding)


def near(lined, v, n):
    """The n vertices nearest to vertex v in the plane that are not at its place."""
    away = np.hypot(*(lined.model.xy - lined.model.xy[v]).T)
    order = np.argsort(away, kind="stable")
    return order[away[order] > 0.0][:n]


@tried("rounds", 2)
def test_vertices_that_leave_a_line_for_a_place_nearby_are_as_from_scratch(rounds):
    lined = lined_rows()
    rng = np.random.default_rng(4)
    on_line = np.flatnonzero((lined.ground().lines.at >= 0) & ~lined.pinned)
    for _ in range(rounds):
        live = LiveTriangulation(lined, lined.pinned | (rng.random(lined.n_vertices) < 0.4))
        for v in on_line:
            if not live.kept[v]:
                live.insert(int(v))
            for w in near(lined, v, 12):
                if live.kept[w]:
                    continue
                before = live.error, live.triangles
                change, triangles = live.try_move(int(v), int(w))
                live.move(int(v), int(w))
                assert triangles == live.triangles - before[1]
                assert change == pytest.approx(live.error - before[0], rel=1e-9, abs=1e-11 * lined.n_vertices)
                np.testing.assert_array_equal(live.faces, lined.triangles(live.kept))
                live.move(int(w), int(v))


def forced_edges_of(lined, faces):
    """Whether all edges of the lines are edges of a mesh, cut at its vertices."""
    used = np.zeros(lined.n_vertices, bool)
    used[faces] = True
    edges = {frozenset(pair) for face in faces.tolist() for pair in itertools.combinations(face, 2)}
    chains = lined.line_chains(used)
    return all(frozenset(pair) in edges for chain in chains for pair in itertools.pairwise(chain.tolist()))


def lined_terrain(n_lines=12, **rules):
    """A grid with lines between its vertices, some of which lie on others."""
    model = build_model(load("jacksboro:9"))
    segments, _ = random_segments(model.xy, np.random.default_rng(5), n_lines)
    return surface(with_segments(model, segments), **rules)


def lined_rows(**rules):
    """The same grid with lines along a side and two rows: all their vertices lie on them."""
    model = build_model(load("jacksboro:9"))
    y = np.unique(model.xy[:, 1])
    segments = []
    for level in y[[0, len(y) // 3, len(y) // 2]]:
        row = np.flatnonzero(model.xy[:, 1] == level)
        row = row[np.argsort(model.xy[row, 0])]
        segments += [(row[0], row[len(row) // 2]), (row[len(row) // 2], row[-1])]
    return surface(with_segments(model, segments), **rules)


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_chains_of_lines_are_edges_of_every_mesh(share):
    lined = lined_terrain()
    rng = np.random.default_rng(1)
    for _ in range(20):
        kept = lined.pinned | (rng.random(lined.n_vertices) < share)
        assert forced_edges_of(lined, lined.triangles(kept))
    assert max(len(chain) for chain in lined.line_chains(np.ones(lined.n_vertices, bool))) > 2


def steps_of(chains):
    return [frozenset(pair) for chain in chains for pair in itertools.pairwise(chain.tolist())]


@pytest.mark.parametrize("turn", [17.3, 30.0])
def test_lines_of_a_mesh_are_its_edges_where_slivers_along_the_hull_go(turn):
    """The sides of a turned grid are straight but for rounding, so vertices lie a little beside a line along them."""
    grid = load("plane:17")
    sine, cosine = np.sin(np.radians(turn)), np.cos(np.radians(turn))
    points = grid.points @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    lined = surface(build_model(replace(grid, points=points)), break_lines="outline", line_tolerance=0.1)
    rng = np.random.default_rng(4)
    for share in (0.0, 0.05, 0.2, 1.0):
        faces = lined.triangles(lined.pinned | (rng.random(lined.n_vertices) < share))
        ((chain,), _) = mesh_lines(lined, faces)
        assert chain[0] == chain[-1] == lined.model.lines.chains[0][0]
        assert set(lined.model.lines.chains[0]) <= set(chain)
        table = edge_table(faces)
        border = {frozenset(pair) for pair in table.ends[table.n_triangles == 1].tolist()}
        assert set(steps_of([chain])) == border


@pytest.mark.parametrize("name", ["horseshoe", "ring"])
def test_chains_of_a_thinned_outline_are_edges_of_every_mesh_though_its_triangles_reach_over_bays(name):
    model = build_model(load(name))
    rng = np.random.default_rng(1)
    for tolerance in (0.01, 0.1):
        lined = surface(lined_model(model, "outline", tolerance * model.diagonal))
        for share in (0.0, 0.05, 0.3, 1.0):
            kept = lined.pinned | (rng.random(lined.n_vertices) < share)
            assert forced_edges_of(lined, lined.triangles(kept))
            np.testing.assert_array_equal(LiveTriangulation(lined, kept).faces, lined.triangles(kept))


def test_a_line_between_two_bays_is_in_the_mesh_though_no_triangle_beside_it_is_inside():
    """The letter H: both triangles beside a line in its bar have a corner at the end of a leg."""
    inside = [(x, y) for x, y in itertools.product(range(9), range(18)) if x in (0, 1, 7, 8) or y in (8, 9)]
    places = {place: k for k, place in enumerate(inside)}
    faces = []
    for x, y in places:
        square = [places.get(place) for place in ((x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1))]
        if None not in square:
            faces += [square[:3], [square[0], *square[2:]]]
    model = build_model(build_source([(x, y, 0.0) for x, y in places], faces))
    lined = surface(lined_model(model, [[[2, 8.5, 0], [6, 8.5, 0]]], 0.0))
    faces = lined.triangles(lined.pinned)
    assert forced_edges_of(lined, faces)
    ends = np.isin(faces, lined.model.lines.vertices).sum(axis=1)
    assert (ends == 2).sum() == 1  # that on one side, not both
    np.testing.assert_array_equal(LiveTriangulation(lined, lined.pinned).faces, faces)


@pytest.mark.parametrize("centroids", [False, True])
@pytest.mark.parametrize("make", [lined_terrain, lined_rows])
def test_free_meshes_keep_the_lines_and_what_lies_on_them(make, centroids):
    lined = make()
    kept = lined.pinned | (np.random.default_rng(2).random(lined.n_vertices) < 0.3)
    start = lined.triangles(kept)
    before = [chain.tolist() for chain in lined.line_chains(kept)]
    with lined.free_ground(centroids=centroids).triangulation(kept) as mesh:
        mesh.anneal(20_000, np.array([7], np.uint64), hot=50.0, cold=0.1, triangles=len(start))
        faces = mesh.faces
        assert (mesh.accepted > 100).all()
    used = np.zeros(lined.n_vertices, bool)
    used[faces] = True
    assert [chain.tolist() for chain in lined.line_chains(used)] == before
    assert forced_edges_of(lined, faces)


@pytest.mark.parametrize("triangulation", ["delaunay", "free"])
@pytest.mark.parametrize("make", [lined_terrain, lined_rows])
def test_searched_fronts_keep_the_lines(make, triangulation):
    lined = make()
    result = minimize(MeshProblem(lined), memetic(12, triangulation=triangulation), Moves(20_000), seed=1)
    free = [mesh for mesh in result.opt.get("free", to_numpy=False) if mesh is not None]
    assert len(free) > 5 if triangulation == "free" else not free
    for faces in [*(lined.triangles(row) for row in result.X), *(mesh.faces for mesh in free)]:
        assert forced_edges_of(lined, faces)
    fewest = lined.simplify(lined.pinned).quality.triangles
    assert min(result.F[:, 1]) <= fewest


def test_refitting_holds_the_vertices_on_lines_and_is_no_worse():
    lined = lined_terrain()
    kept = lined.pinned | (np.random.default_rng(3).random(lined.n_vertices) < 0.2)
    mesh = lined.simplify(kept)
    fitted = lined.refit(mesh)
    moved = np.flatnonzero((fitted.vertices != lined.model.file_points[fitted.rows]).any(axis=1))
    on_lines = np.unique(np.concatenate(lined.line_chains(kept)))
    assert len(moved) > 5
    assert not np.isin(fitted.rows[moved], on_lines).any()
    assert fitted.bound <= fitted.error < mesh.quality.error
    assert fitted.bound >= 0.99 * fitted.error


@pytest.mark.parametrize("outside", OUTSIDES)
@pytest.mark.parametrize("make", [lined_terrain, lined_rows])
def test_meshes_with_lines_are_measured_as_their_faces_are(make, outside):
    lined = make(outside=outside)
    rng = np.random.default_rng(6)
    for share in (0.05, 0.2, 0.6):
        mesh = lined.simplify(lined.pinned | (rng.random(lined.n_vertices) < share))
        other = lined.of_faces(mesh.faces)
        np.testing.assert_allclose(mesh.deviation, other.deviation, atol=1e-9 * lined.diagonal)
        assert dataclasses.asdict(mesh.quality) == pytest.approx(dataclasses.asdict(other.quality), rel=1e-9)
