"""Break lines of closed surfaces: every forced edge is in every mesh, and what is said of them is true."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
import trimesh
from closed_lining import CASES, case, lined, meridian, model_of, of_mesh, parallel, random_subset

from meshsimp_pymoo.arrays import FloatArray, IntArray
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import InputError, ModelError, ModelWarning
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.surface.closed.lining import _Lining
from meshsimp_pymoo.surface.closed.model import ClosedModel, closed_model
from meshsimp_pymoo.surface.closed.nearest import distances_to_line
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.closed.tracing import Tracer, near_in_space
from meshsimp_pymoo.surface.kinds import as_stored, stored_arrays
from meshsimp_pymoo.surface.line_thinning import Chords
from meshsimp_pymoo.surface.polylines import cut_into_runs
from meshsimp_pymoo.surface.rules import Rules

POLYHEDRA = [("tetrahedron:3", 6), ("tetrahedron:9", 6), ("cube:9", 12), ("icosahedron:6", 30)]


def edges(faces: IntArray) -> set[tuple[int, int]]:
    return set(map(tuple, edge_table(faces).ends.tolist()))


def steps(chain: IntArray) -> set[tuple[int, int]]:
    return {(min(pair), max(pair)) for pair in itertools.pairwise(chain.tolist())}


# -------------------------------------------------------------------------------------------------------- known answers


@pytest.mark.parametrize(("name", "n_edges"), POLYHEDRA)
def test_the_sharp_edges_of_a_polyhedron_are_its_edges(name, n_edges):
    surface = lined(name)
    lines = surface.model.lines
    assert len(lines.originals) == n_edges
    ends = np.array([line[[0, -1]] for line in lines.originals])
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert np.allclose(lengths, lengths[0])
    away = [
        np.linalg.norm(np.cross(line - a, b - a), axis=1).max()
        for line, (a, b) in zip(lines.originals, ends, strict=True)
    ]
    assert max(away) < 1e-12
    at_pole = set(map(tuple, surface.points[surface.model.poles.ravel()]))
    for line, chain in zip(lines.originals, lines.chains, strict=True):
        assert at_pole & set(map(tuple, line)) <= set(map(tuple, surface.points[chain]))
    mesh = surface.simplify(surface.pinned)
    assert mesh.quality.surface_error < 1e-15 * surface.diagonal
    assert mesh.quality.line_max_error < 1e-15 * surface.diagonal


def test_a_cylinder_has_two_round_edges_whose_thinned_vertices_are_on_the_circles():
    surface = lined("cylinder")
    lines = surface.model.lines
    assert len(lines.chains) == 2
    for chain in lines.chains:
        assert chain[0] == chain[-1]
        at = surface.points[chain]
        flat = int(np.argmin(np.ptp(at, axis=0)))
        assert np.ptp(at[:, flat]) < 1e-12
    # of four vertices between two corners none is left but where images ask for one
    assert 48 <= len(lines.vertices) < 2 * 96


@pytest.mark.parametrize("name", ["sphere:500", "blob:500"])
def test_what_has_no_edge_so_sharp_is_refused(name):
    with pytest.raises(ModelError, match=r"no two faces of .* meet at more than 120 degrees; give fewer"):
        lined(name, "sharp:120")
    with pytest.raises(ModelError, match=r"has no outline and no holes whose rims could be break lines"):
        lined(name, "outline")


# ----------------------------------------------------------------------------------------------------- in every mesh


@pytest.mark.parametrize("share", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("name", CASES)
def test_every_forced_edge_is_in_the_mesh_of_every_subset(name, share):
    surface = case(name)
    for seed in range(2):
        kept = random_subset(surface, share, seed)
        mesh = surface.simplify(kept)
        there = edges(mesh.faces)
        chains = surface.line_chains(kept)
        for chain, thinned, line in zip(chains, surface.model.lines.chains, surface.model.lines.originals, strict=True):
            assert steps(chain) <= there
            assert set(thinned) <= set(chain)
            away, _ = distances_to_line(line, surface.points[chain])
            assert away.max() <= surface.model.lines.tolerance * (1.0 + 1e-9) + 1e-9 * surface.diagonal
        assert mesh.quality.line_max_error <= surface.model.lines.tolerance + 1e-9 * surface.diagonal
        if len(surface.model.rim) == 0:
            assert mesh.quality.triangles == 2 * kept.sum() - 4 * surface.model.n_parts
            assert (edge_table(mesh.faces).n_triangles == 2).all()


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_with_the_rims_for_lines_they_are_the_border_of_every_mesh(share):
    surface = case("rims")
    rims = surface.model.lines
    for seed in range(3):
        kept = random_subset(surface, share, seed)
        table = edge_table(surface.simplify(kept).faces)
        border = set(map(tuple, table.ends[table.n_triangles == 1].tolist()))
        assert border == set.union(*(steps(chain) for chain in surface.line_chains(kept)))
        for line, chain in zip(rims.originals, rims.chains, strict=True):
            assert distances_to_line(line, surface.points[chain])[0].max() <= rims.tolerance


@pytest.mark.parametrize("name", CASES)
def test_no_vertex_of_the_original_is_on_the_wrong_side_of_a_thinned_line(name):
    """Seen from a vertex, a line that winds around it another time than its chords do has it on the other side."""
    surface = case(name)
    model, lines = surface.model, surface.model.lines
    row_at = {tuple(point): row for row, point in enumerate(model.points)}
    own = np.setdiff1d(np.arange(model.n_vertices), lines.added)
    for line, chain in zip(lines.originals, lines.chains, strict=True):
        rows = [row_at.get(tuple(point), -1) for point in line]
        if -1 in rows:  # points of lines between what is left of them are no vertices
            continue
        others = np.setdiff1d(own, rows)
        ring = np.concatenate([model.xy[rows], model.xy[chain[::-1]]])
        assert (np.abs(turns_around(model.xy[others], ring)) < 0.5).all()


def turns_around(points: FloatArray, ring: FloatArray) -> FloatArray:
    """Return how often a closed polygon winds around each point, by its angles."""
    total = np.zeros(len(points))
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        u, v = a - points, b - points
        total += np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))
    return total / (2.0 * np.pi)


# ------------------------------------------------------------------------------------------------------ lines of users


def test_a_line_on_a_sphere_follows_it_and_stays_within_the_tolerance():
    given = meridian()
    surface = case("a meridian")
    model, lines = surface.model, surface.model.lines
    (line,) = lines.originals
    radius = np.linalg.norm(model.to_file(line), axis=1)
    assert np.abs(radius - 1.0).max() < 0.03  # the sphere of 600 vertices lies so far inside
    assert np.isin(np.round(given, 9), np.round(model.to_file(line), 9)).all()
    assert distances_to_line(line, model.points[lines.chains[0]])[0].max() <= 0.01
    assert len(lines.added) == len(lines.vertices) == model.n_vertices - 600
    assert (model.weights[lines.added] == 0.0).all()
    assert np.delete(model.weights, lines.added).tolist() == [1.0] * 600
    assert sorted(model.source_index[lines.added]) == list(range(600, model.n_vertices))
    assert not np.isin(lines.added, model.faces).any()
    assert len(np.unique(model.xy, axis=0)) == model.n_vertices


@pytest.mark.parametrize("off", [0.0, 1e-10])
@pytest.mark.parametrize("way", [1, -1])
def test_lines_at_vertices_of_the_model_are_these(way, off):
    corners = [[-1.0, -1.0, -1.0], [1.0, -1.0, -1.0], [1.0, 1.0, -1.0]][::way]
    surface = lined("cube:9", [np.add(corners, [off, -off, off])], 0.01)
    lines = surface.model.lines
    assert len(lines.added) == 0
    assert len(lines.originals[0]) >= 17
    assert surface.model.to_file(lines.originals[0][[0, -1]]).tolist() == [corners[0], corners[2]]
    assert np.linalg.norm(np.diff(lines.originals[0], axis=0), axis=1).sum() == pytest.approx(4.0)
    assert surface.simplify(surface.pinned).quality.line_max_error == 0.0


def test_a_line_above_the_surface_stays_as_far_above_it_and_its_images_are_its_own():
    """Its vertices are above vertices of the cube, whose images theirs would be."""
    given = np.array([[-0.75, -0.5, 1.02], [0.5, -0.5, 1.02], [0.5, 0.25, 1.02]])
    surface = lined("cube:9", [given], 0.01)
    model, lines = surface.model, surface.model.lines
    assert np.abs(model.to_file(lines.originals[0])[:, 2] - 1.02).max() < 1e-12
    assert len(lines.added) == len(lines.vertices) >= 3
    assert len(np.unique(model.xy, axis=0)) == model.n_vertices
    kept = random_subset(surface, 0.3, 1)
    assert steps(surface.line_chains(kept)[0]) <= edges(surface.simplify(kept).faces)


@pytest.mark.parametrize("y", [0.25, 0.75])
def test_a_chord_that_an_image_lies_on_by_chance_gets_a_vertex_back(y):
    model = model_of("cube:9")
    lining = _Lining(model, 0.01)
    inner = np.setdiff1d(np.arange(model.n_vertices), model.poles)
    a, bend, b, other = inner[:4]
    lining.places = np.full_like(model.xy, 0.125)
    lining.places[[a, bend, b, other]] = [[0.25, 0.5], [0.5, y], [0.75, 0.5], [0.5, 0.5]]
    runs = cut_into_runs([np.array([a, bend, b])], np.array([], int))
    chord = Chords(np.array([0]), np.array([0]), np.array([2]), np.array([[a, b]]))
    assert lining._astray(runs, chord) == {(0, 1)}
    lining.places[other] = [0.5, 1.0 - y]
    assert lining._astray(runs, chord) == set()


def test_neither_the_way_nor_the_order_in_which_lines_are_listed_is_of_matter():
    one = lined("sphere:600", [meridian(0.5), parallel(-0.995), meridian(-0.5)[1:4]], 0.01)
    other = lined("sphere:600", [meridian(-0.5)[3:0:-1], meridian(0.5)[::-1], parallel(-0.995)], 0.01)
    assert np.array_equal(one.points, other.points)
    assert np.array_equal(one.model.xy, other.model.xy)
    for k, same, way in ((0, 1, -1), (1, 2, 1), (2, 0, -1)):
        assert np.array_equal(one.model.lines.chains[k], other.model.lines.chains[same][::way])
        assert np.array_equal(one.model.lines.originals[k], other.model.lines.originals[same][::way])


def test_a_lined_model_is_the_same_however_its_file_lists_it():
    source = load("sphere:600")
    listed = np.random.default_rng(3).permutation(600)
    faces = np.argsort(listed)[source.faces]
    moved = dataclasses.replace(source, points=source.points[listed], faces=faces)
    rules = Rules(break_lines=[meridian()], line_tolerance=0.01)
    one, other = (ClosedSurface(closed_model(mesh), rules) for mesh in (source, moved))
    assert np.array_equal(one.model.xy, other.model.xy)
    assert all(map(np.array_equal, one.model.lines.chains, other.model.lines.chains))
    again = ClosedSurface(closed_model(load("sphere:600")), rules)
    assert one.model.hash == again.model.hash
    assert one.model.hash != model_of("sphere:600").hash != case("a parallel").model.hash


def test_lines_that_meet_or_run_together_are_one_where_they_do():
    """One ends on another, and one runs along a part of it."""
    whole = [[-1.0, -0.52, 1.0], [1.0, 0.43, 1.0]]
    low, high = (np.array(whole[0]) + t * (np.array(whole[1]) - whole[0]) for t in (0.25, 0.75))
    surface = lined("cube:9", [whole, [low, high], [[-0.9, 0.9, 1.0], high]], 0.001)
    first, second, third = surface.line_chains(surface.pinned)
    assert steps(second) <= steps(first)
    assert third[-1] == second[-1]
    assert surface.simplify(surface.pinned).quality.line_max_error < 1e-12


def test_lines_that_cross_are_refused_by_their_names_and_where():
    crossed = [[[-1, -0.5, 1], [1, 0.6, 1]], [[0.9, 0.9, 1], [0.8, 0.9, 1]], [[-1, 0.55, 1], [1, -0.5, 1]]]
    with pytest.raises(ModelError, match=r"line 1 and line 3 cross at -0.0232558\d*, 0.0372093\d*, 1; give the cross"):
        lined("cube:9", crossed, 0.01)
    bow = [[[-0.9, -0.8, 1], [0.9, 0.8, 1], [0.9, -0.7, 1], [-0.9, 0.9, 1]]]
    with pytest.raises(ModelError, match="line 1 crosses itself at"):
        lined("cube:9", bow, 0.01)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ([[[0, 0], [1, 1]]], "1 line has x and y only, and cube:9 is a closed surface.*give x, y and z of each"),
        (
            [[[5, 0, 0], [6, 0, 9]]],
            "none of 1 line lies on cube:9: they span x 5 to 6, y 0 to 0, z 0 to 9, the model x -1 to 1, y -1",
        ),
        ([[[0, 0, 1], [1e-12, 0, 1]]], "holds no line of two places"),
    ],
)
def test_lines_that_are_not_on_the_surface_are_refused(lines, says):
    with pytest.raises(ModelError, match=says) as told:
        lined("cube:9", lines, 0.01)
    assert "\n" not in str(told.value)


def test_lines_of_users_need_a_tolerance():
    with pytest.raises(InputError, match="need line_tolerance"):
        lined("cube:9", [[[0, 0, 1], [0.5, 0, 1]]])


def test_a_line_that_turns_back_on_itself_is_gone_along_twice():
    a, b, c = [-0.75, -0.5, 1.0], [0.5, -0.4, 1.0], [0.6, 0.6, 1.0]
    surface = lined("cube:9", [[a, b, a, b, c]], 0.01)
    (chain,) = surface.model.lines.chains
    once = lined("cube:9", [[a, b, c]], 0.01).model.lines.chains[0]
    assert np.array_equal(chain[-len(once) :], once)
    assert steps(chain) == steps(once)


def random_lines(model: ClosedModel, seed: int) -> list[FloatArray]:
    """Return up to three lines: far over the body, through vertices, or from vertex to neighbour and a little aside."""
    rng = np.random.default_rng(seed)
    lines = []
    for _ in range(rng.integers(1, 4)):
        kind, n = rng.integers(3), int(rng.integers(2, 6))
        if kind == 0:
            corners = model.file_points[model.faces[rng.integers(len(model.faces), size=n)]]
            line = (corners * rng.dirichlet([1.0, 1.0, 1.0], n)[:, :, None]).sum(axis=1)
        elif kind == 1:
            line = model.file_points[rng.integers(model.n_vertices, size=n)]
        else:
            start, around = model.neighbours
            path = [int(rng.integers(model.n_vertices))]
            for _ in range(8):
                path.append(int(rng.choice(around[start[path[-1]] : start[path[-1] + 1]])))
            aside = rng.choice([0.0, 1e-10, 1e-3, 5e-3]) * model.diagonal
            line = model.file_points[path] + aside * rng.normal(size=(9, 3))
        lines.append(line)
    return lines


def check_random_lines(seeds: range) -> None:
    n_lined = 0
    for seed in seeds:
        model = model_of(("sphere:600", "blob:900", "holed", "pair", "cube:9", "cylinder")[seed % 6])
        tolerance = (0.0, 1e-3, 1e-2, 5e-2)[seed // 6 % 4] * model.diagonal
        try:
            surface = ClosedSurface(model, Rules(break_lines=random_lines(model, seed), line_tolerance=tolerance))
        except ModelError as trouble:
            if "cross" not in str(trouble):
                raise
            continue
        n_lined += 1
        lines = surface.model.lines
        assert len(np.unique(surface.model.xy, axis=0)) == surface.n_vertices
        for share in (0.0, 0.3):
            kept = random_subset(surface, share, seed)
            mesh = surface.simplify(kept)
            there = edges(mesh.faces)
            for chain, line in zip(surface.line_chains(kept), lines.originals, strict=True):
                assert steps(chain) <= there
                if "vertices_at_the_pole" not in lines.found:
                    away, _ = distances_to_line(line, surface.points[chain])
                    assert away.max() <= tolerance * (1.0 + 1e-9) + 2e-9 * surface.diagonal
            if len(surface.model.rim) == 0:
                assert mesh.quality.triangles == 2 * kept.sum() - 4 * surface.model.n_parts
    assert n_lined > len(seeds) / 4


@pytest.mark.filterwarnings("ignore:break_lines")
def test_random_lines_are_refused_or_in_every_mesh_within_the_tolerance():
    check_random_lines(range(24))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:break_lines")
def test_many_random_lines_are_refused_or_in_every_mesh_within_the_tolerance():
    check_random_lines(range(24, 1000))


def test_what_leads_away_from_the_surface_is_cut_off_with_its_count():
    with pytest.warns(ModelWarning, match=r"of 3 lines, parts of 1 and the whole of 1 are farther than .* 7\d.*% of"):
        surface = lined(
            "cube:9", [[[-0.9, 0, 1], [9, 0.1, 1]], [[3, 3, 3], [5, 5, 5]], [[0, 0.7, 1], [1, 0.7, 1]]], 0.01
        )
    assert surface.model.lines.names == ("line 1", "line 3")
    assert surface.model.lines.found["lines_cut"] == surface.model.lines.found["lines_left_out"] == 1
    ends = surface.model.to_file(surface.model.lines.originals[0][[0, -1]])
    assert np.allclose(ends, [[-0.9, 0.0, 1.0], [1.0, 0.019, 1.0]], atol=0.02)


def test_what_lies_over_a_hole_is_cut_off():
    height = np.linspace(-0.99, 0.99, 30)
    line = np.column_stack([np.sqrt(1 - height**2), 0.2 * height * np.sqrt(1 - height**2), height])
    with pytest.warns(ModelWarning, match="of 1 line, parts of 1 and the whole of 0 .* or over its holes"):
        surface = lined("holed", [line / np.linalg.norm(line, axis=1)[:, None]], 0.02)
    (found,) = surface.model.lines.originals
    z = surface.model.to_file(found)[:, 2]
    assert 0.7 < z.max() < 0.85
    assert -0.85 < z.min() < -0.7


def test_what_lies_over_a_small_hole_is_cut_off_though_its_rim_is_near():
    mesh = trimesh.creation.icosphere(subdivisions=3)
    a, b, c = mesh.vertices[mesh.faces[100]]
    elsewhere = mesh.vertices[mesh.faces[700, :2]]
    mesh.update_faces(np.arange(len(mesh.faces)) != 100)
    across = [0.5 * (a + b), 0.5 * (a + c)]
    model = closed_model(of_mesh(mesh, "pricked"))
    with pytest.warns(
        ModelWarning, match="of 2 lines, parts of 1 and the whole of 0 .* or over its holes, and are cut"
    ):
        surface = ClosedSurface(model, Rules(break_lines=[elsewhere, across], line_tolerance=0.001))
    lines = surface.model.lines
    left = [line for line, name in zip(lines.originals, lines.names, strict=True) if name == "line 2"]
    length = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in left)
    assert 0.0 < length < 0.2 * np.linalg.norm(across[1] - across[0])


def test_a_line_through_the_body_does_not_jump_from_side_to_side():
    with pytest.warns(ModelWarning, match="of 1 line, parts of 1 and the whole of 0 are farther than"):
        surface = lined("cube:9", [[[0.1, 0.2, 1.0], [0.3, 0.2, 1.0], [0.3, 0.2, -1.0], [0.1, 0.2, -1.0]]], 0.01)
    for line in surface.model.lines.originals:
        assert np.linalg.norm(np.diff(line, axis=0), axis=1).max() < 0.3


def test_a_line_over_the_gap_between_two_parts_is_cut_there():
    one, other = trimesh.creation.box().subdivide().subdivide(), trimesh.creation.box().subdivide().subdivide()
    other.apply_translation([1.005, 0.0, 0.0])
    mesh = trimesh.util.concatenate([one, other])
    model = closed_model(of_mesh(mesh, "gap"))
    with pytest.warns(ModelWarning, match="of 1 line, parts of 1 and the whole of 0"):
        surface = ClosedSurface(model, Rules(break_lines=[[[-0.3, 0.1, 0.5], [1.2, 0.2, 0.5]]], line_tolerance=0.01))
    parts = [set(surface.model.part[chain]) for chain in surface.model.lines.chains]
    assert sorted(map(len, parts)) == [1, 1]
    assert set.union(*parts) == {0, 1}


def test_a_line_over_the_pole_goes_through_its_corners():
    model = model_of("blob:500")
    a, b, c = model.file_points[model.poles[0]]
    middle = (a + b + c) / 3.0
    line = [a + 0.5 * (a - middle), middle, 0.7 * b + 0.3 * c + 0.5 * (0.7 * b + 0.3 * c - middle)]
    with pytest.warns(ModelWarning, match="that is the outside of the plane, and go through its corners there, up to"):
        surface = lined("blob:500", [line], 0.01 * model.diagonal / 10)
    assert np.isin(surface.model.poles, surface.model.lines.vertices).any()
    for share in (0.0, 0.3):
        kept = random_subset(surface, share, 1)
        mesh = surface.simplify(kept)
        assert steps(surface.line_chains(kept)[0]) <= edges(mesh.faces)
        assert mesh.quality.triangles == 2 * kept.sum() - 4


def test_what_is_added_is_of_the_part_that_it_lies_on():
    surface = case("lines on both parts")
    model = surface.model
    is_ball = model.to_file(model.points)[:, 0] > 1.5
    assert len(set(model.part[is_ball])) == len(set(model.part[~is_ball])) == 1
    assert set(model.part) == {0, 1}
    assert {bool(is_ball[chain].all()) for chain in model.lines.chains} == {True, False}


def test_lines_can_be_taken_away_again():
    surface = case("a meridian")
    bare = surface.model.without_lines()
    for name in ("points", "faces", "xy", "poles", "source_index", "file_points"):
        assert np.array_equal(getattr(bare, name), getattr(model_of("sphere:600"), name))
    assert bare.hash == model_of("sphere:600").hash
    assert ClosedSurface(surface.model, surface.rules).model.hash == surface.model.hash
    weighed = lined("sphere:600", [meridian()], 0.01, weights="area")
    assert weighed.total_weight == pytest.approx(600.0)
    assert ClosedSurface(weighed.model, weighed.rules).model.hash == weighed.model.hash


# ------------------------------------------------------------------------------------------------------------- tracing


def test_the_points_of_a_traced_line_lie_on_the_faces_that_are_said():
    """Between two of them the line lies in one face, but for a thousandth of its size."""
    model = model_of("sphere:600")
    tracer = Tracer(model, 0.01, 0.05)
    ends = model.to_local(parallel())
    pieces = np.column_stack([np.arange(30), np.arange(1, 31)])
    traced = tracer.traced(ends, pieces)
    away = model.points[tracer.faces[traced.face]]
    normal = np.cross(away[:, 1] - away[:, 0], away[:, 2] - away[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    off = np.abs(((traced.points - away[:, 0]) * normal).sum(axis=1))
    assert off.max() < 0.03
    size = np.sqrt(np.linalg.norm(np.cross(away[:, 1] - away[:, 0], away[:, 2] - away[:, 0]), axis=1))
    for (a, b), chain, joined in zip(pieces, traced.chains, traced.joined, strict=True):
        assert (chain[0], chain[-1]) == (a, b)
        assert joined.all()
        for p, q in itertools.pairwise(chain):
            step = np.linalg.norm(traced.points[p] - traced.points[q])
            assert traced.face[p] == traced.face[q] or step < 0.01 * size[p] or near_edge(model, tracer, traced, p, q)


def near_edge(model, tracer, traced, p, q) -> bool:
    """Tell whether one of two points lies on the border of the other's face."""
    for one, other in ((p, q), (q, p)):
        corners = model.points[tracer.faces[traced.face[one]]]
        foot = trimesh.triangles.closest_point(corners[None], traced.points[other][None])[0]
        if np.linalg.norm(foot - traced.points[other]) < 0.03:
            return True
    return False


def test_points_on_pieces_are_found_whatever_way_these_lead():
    rng = np.random.default_rng(5)
    points = rng.random((40, 3))
    ends = np.array([[0, 1], [2, 3], [4, 5]])
    points[1, :2] = points[0, :2]  # along z
    points[10], points[11] = 0.3 * points[0] + 0.7 * points[1], 0.5 * (points[2] + points[3])
    points[12] = points[11] + [0.0, 0.0, 1e-6]
    point, piece, t = near_in_space(points, ends, 1e-9)
    assert sorted(zip(point.tolist(), piece.tolist(), t.round(6).tolist(), strict=True)) == [(10, 0, 0.7), (11, 1, 0.5)]


# ------------------------------------------------------------------------------------------------------- refit, storage


@pytest.mark.parametrize("name", ["edges of a cylinder", "edges of an icosahedron", "a parallel", "rims"])
def test_refit_moves_lines_no_farther_than_they_may(name):
    surface = case(name)
    lines = surface.model.lines
    kept = random_subset(surface, 0.1, 2)
    mesh = surface.simplify(kept)
    fitted = surface.refit(mesh)
    at = surface.points.copy()
    at[fitted.rows] = surface.model.to_local(fitted.vertices)
    for line, chain in zip(lines.originals, surface.line_chains(kept), strict=True):
        away, _ = distances_to_line(line, at[chain])
        assert away.max() <= lines.tolerance * (1.0 + 1e-6) + 1e-9 * surface.diagonal
    if name == "a parallel":  # a line inside a body of less than all vertices goes out with the rest
        assert (at[lines.vertices] != surface.points[lines.vertices]).any()


@pytest.mark.parametrize("name", ["edges of a cube", "a meridian", "lines on both parts", "rims"])
def test_images_that_were_stored_bring_the_lines_that_were_laid_on_them(name):
    surface = case(name)
    assert as_stored(surface, stored_arrays(surface)) is surface
    bare = surface.model.without_lines()
    xy = bare.xy.copy()
    inner = np.setdiff1d(np.arange(len(xy)), bare.poles)
    xy[inner] += 2.0**-52 * np.random.default_rng(1).integers(-3, 4, (len(inner), 2))
    other = ClosedSurface(bare.with_images(xy, bare.source_index), surface.rules)
    read = as_stored(surface, stored_arrays(other))
    assert read.model.hash == other.model.hash
    for name in ("points", "faces", "xy", "part", "source_index", "poles"):
        assert np.array_equal(getattr(read.model, name), getattr(other.model, name)), name
    assert all(map(np.array_equal, read.model.lines.chains, other.model.lines.chains))
    spoilt = stored_arrays(other)
    if len(surface.model.lines.added):
        spoilt["source_index"] = np.where(
            np.arange(len(spoilt["xy"])) == other.model.lines.added[0], 10**6, spoilt["source_index"]
        )
        with pytest.raises(ModelError, match="images of other break lines"):
            as_stored(surface, spoilt)


@pytest.mark.parametrize("size", [1e-50, 1e60])
def test_sharp_edges_are_found_in_whatever_unit(size):
    box = trimesh.creation.box().subdivide()
    box.vertices *= size
    lines = ClosedSurface(closed_model(of_mesh(box, "box")), Rules(break_lines="sharp:30")).model.lines
    assert len(lines.chains) == 12
