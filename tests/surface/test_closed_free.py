"""Free meshes on closed surfaces: a slow twin, what stays whatever moves, thinning, and a search from end to end."""

from __future__ import annotations

from functools import cache

import closed_lining
import numpy as np
import pytest
import trimesh
from pymoo.optimize import minimize
from scans import holed, parts

from meshsimp_pymoo import Front, MeshProblem, Moves, memetic, thinning
from meshsimp_pymoo.cli import main
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.faces import canonical_faces, edge_table
from meshsimp_pymoo.plane.triangulation import LAST_INDEX, RECORD
from meshsimp_pymoo.search.free import FreeLadder, _thin
from meshsimp_pymoo.surface.closed.books import END
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.measures import ERROR, MAXIMUM, REGIONS, SQUARES, TRIANGLES, UNCOVERED, VERTICES
from meshsimp_pymoo.surface.rules import Rules

MAKE = {"whole": lambda: load("blob:400,seed=3"), "holed": holed, "parts": parts}
LINED = ("edges of a cylinder", "edges of one of two parts")
NAMES = (*MAKE, *LINED)


@cache
def surface_of(name, measure="error", weights=None):
    if name in LINED:
        return closed_lining.case(name).measuring(measure)
    return ClosedSurface(open_model(MAKE[name](), Options(surface="closed")), Rules(measure=measure, weights=weights))


def subset(surface, share, seed):
    return closed_lining.random_subset(surface, share, seed)


# --------------------------------------------------------------------------------------------------------------- a twin


def squared(points, a, b, c):
    """Return the squared distances of points to triangles, all (M, 3): the least to planes within and to sides."""
    u, v, w = b - a, c - a, points - a
    normal = np.cross(u, v)
    area = (normal**2).sum(axis=1)
    with np.errstate(all="ignore"):
        s = (np.cross(w, v) * normal).sum(axis=1) / area
        t = (np.cross(u, w) * normal).sum(axis=1) / area
        found = np.where((s >= 0) & (t >= 0) & (s + t <= 1), (w * normal).sum(axis=1) ** 2 / area, np.inf)
        for start, end in ((a, b), (b, c), (c, a)):
            side = end - start
            k = ((points - start) * side).sum(axis=1) / (side**2).sum(axis=1)
            found = np.fmin(found, ((points - start - np.clip(k, 0, 1)[:, None] * side) ** 2).sum(axis=1))
    return found


def records(free):
    """Return the corners (M, 3) of all triangles in the plane but ghosts."""
    end = int(free.books.tally[END])
    corners = free.books.mesh[:end].reshape(-1, RECORD)[:, :3].astype(np.int64)
    return corners[(corners <= LAST_INDEX).all(axis=1)]


def areas(xy, corners):
    a, b, c = (xy[corners[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return ux * vy - uy * vx


def twin(surface, free):
    """Return the deviations of the samples and whether each is covered, from the triangles alone.

    The own triangle is looked for among all; those beside it are found by their edges.
    """
    model, corners, faces = surface.model, records(free), {tuple(sorted(face)) for face in free.faces.tolist()}
    samples_xy, samples = model.xy, model.points
    part = model.part
    if free.freedom.ground.xy.size > 2 * model.n_vertices:
        # as the books have them, in whatever order, the pole's left out
        centres = free.freedom.ground.xy.reshape(-1, 2)[model.n_vertices :]
        poles = {tuple(sorted(pole)) for pole in model.poles.tolist()}
        rows = [row for row, face in enumerate(model.faces.tolist()) if tuple(sorted(face)) not in poles]
        means = model.xy[model.faces[rows]].mean(axis=1)
        order = [rows[int(np.argmin(((means - centre) ** 2).sum(axis=1)))] for centre in centres]
        assert sorted(order) == rows
        samples_xy = np.concatenate([samples_xy, centres])
        samples = np.concatenate([samples, model.points[model.faces[order]].mean(axis=1)])
        part = np.concatenate([part, part[model.faces[order, 0]]])
    assert (areas(model.xy, corners) > 0).all()
    other = {
        (b, a): row for row, face in enumerate(corners.tolist()) for a, b in zip(face, np.roll(face, -1), strict=True)
    }
    assert len(other) == 3 * len(corners)
    own_part = model.part[corners]
    between = (own_part != own_part[:, :1]).any(axis=1)
    shown = np.array([tuple(sorted(face)) in faces for face in corners.tolist()]) & ~between
    inside = np.full((len(samples_xy), len(corners)), np.inf)
    for k in range(3):
        a, b = model.xy[corners[:, k]], model.xy[corners[:, (k + 1) % 3]]
        side = b - a
        reach = samples_xy[:, None] - a
        inside = np.minimum(inside, side[:, 0] * reach[..., 1] - side[:, 1] * reach[..., 0])
    own = inside.argmax(axis=1)
    poles = model.points[model.poles[part]]
    far = np.sqrt(squared(samples, *poles.transpose(1, 0, 2)))
    least = np.full(len(samples), np.inf)
    for k in range(-1, 3):
        beside = own if k < 0 else np.array(
            [other.get((int(corners[t, k]), int(corners[t, (k + 1) % 3])), -1) for t in own]
        )  # fmt: skip
        is_outside = (beside < 0) | between[beside]
        triangles = np.where(is_outside[:, None, None], poles, model.points[corners[beside]])
        found = squared(samples, *triangles.transpose(1, 0, 2))
        least = np.fmin(least, np.where(is_outside | shown[beside], found, np.inf))
    deviation = np.where(np.isfinite(least), np.sqrt(least), far)
    covered = shown[own] | between[own]
    sites = np.unique(corners)
    is_used = np.isin(sites, free.faces)
    deviation[sites] = np.where(is_used, 0.0, far[sites])
    covered[sites] = is_used
    return deviation, covered


def costs(surface, free):
    """Return the sum of the costs of all samples by the twin."""
    deviation, _ = twin(surface, free)
    power = {"error": 1, "rms_error": 2, "max_error": 8}[surface.rules.measure]
    scale = 1.0 / surface.diagonal if power == 8 else 1.0
    return float((free.freedom.ground.weight * (scale * deviation) ** power).sum())


# ------------------------------------------------------------------------------------------------------ what stays


def border_of(faces):
    ends = {(a, b) for face in faces.tolist() for a, b in zip(face, np.roll(face, -1), strict=True)}
    assert len(ends) == 3 * len(faces)
    return {edge for edge in ends if edge[::-1] not in ends}


def check(surface, free, first, *, ratio):
    """Check what any free mesh is that began as ``first``."""
    model, faces = surface.model, free.faces
    assert free.triangles == len(faces)
    np.testing.assert_array_equal(faces, canonical_faces(faces))
    assert border_of(faces) == border_of(first)
    assert len(edge_table(faces).ends) == len(np.unique(np.sort(edge_table(faces).ends, axis=1), axis=0))
    known = {tuple(face) for face in first.tolist()}
    came = np.array([face for face in faces.tolist() if tuple(face) not in known], int).reshape(-1, 3)
    a, b, c = (model.points[came[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    longest = np.max([((b - a) ** 2).sum(axis=1), ((c - b) ** 2).sum(axis=1), ((a - c) ** 2).sum(axis=1)], axis=0)
    assert (np.linalg.norm(normal, axis=1) >= ratio * longest * (1 - 1e-9)).all()
    facing = trimesh.Trimesh(model.points, model.faces, process=False)
    of_vertices = np.zeros((model.n_vertices, 3))
    np.add.at(of_vertices, model.faces.ravel(), np.repeat(facing.face_normals * facing.area_faces[:, None], 3, axis=0))
    of_vertices /= np.maximum(np.linalg.norm(of_vertices, axis=1, keepdims=True), 1e-300)
    assert ((normal * of_vertices[came].sum(axis=1)).sum(axis=1) > 0).all()
    used = np.zeros(model.n_vertices, bool)
    used[faces] = True
    before = np.zeros(model.n_vertices, bool)
    before[first] = True
    assert used[surface.pinned & before].all()
    if model.lines is not None:
        edges = {tuple(sorted(edge)) for edge in edge_table(faces).ends.tolist()}
        kept = before | surface.pinned
        for chain in surface.line_chains(kept):
            assert {tuple(sorted(step)) for step in zip(chain.tolist(), chain[1:].tolist(), strict=False)} <= edges


@pytest.mark.parametrize("name", NAMES)
def test_whatever_moves_a_free_mesh_is_valid_and_its_cost_as_of_a_slow_twin(name):
    k = NAMES.index(name)
    surface = surface_of(name, ("error", "rms_error", "max_error")[k % 3], "area" if name == "holed" else None)
    ratio = (0.1, 0.0, 0.02)[k % 3]
    kept = subset(surface, 0.25 if name != "parts" else 0.12, k)
    with surface.free_ground(centroids=k % 2 == 0).triangulation(kept, min_height=ratio) as free:
        first, cost, triangles = free.faces, free.cost, free.triangles
        np.testing.assert_array_equal(first, canonical_faces(surface.triangles(kept)))
        assert cost == pytest.approx(costs(surface, free), rel=1e-9)
        state = np.array([k + 1], np.uint64)
        for hot in (1e3, 0.3, 0.02, 0.0):  # at first whatever may be is made
            hot *= cost / free.movable
            free.anneal(3000, state, hot=hot, cold=0.1 * hot, triangles=triangles)
            check(surface, free, first, ratio=ratio)
            if 0.0 < hot < 1.0 and name == "parts":  # the twin looks at all of all
                continue
            assert free.triangles == triangles
            assert free.cost == pytest.approx(costs(surface, free), rel=1e-7)
        assert (free.accepted > 0).all()
        assert free.cost < 0.8 * cost


@pytest.mark.parametrize("name", NAMES)
def test_thinning_collapses_two_triangles_at_a_time_and_says_what_is_left(name):
    surface = surface_of(name)
    n = surface.n_vertices
    ground = surface.free_ground(centroids=True)
    with ground.triangulation(subset(surface, 0.15, 5)) as free:
        hot = 0.02 * free.cost / free.movable
        free.anneal(3000, np.array([7], np.uint64), hot=hot, cold=0.1 * hot, triangles=free.triangles)
        first = free.faces
        least = free.triangles - 2 * min(free.movable // 2, 40)
        sizes = np.array([free.triangles, free.triangles - 12, least])
        removed, error, triangles = np.empty(n, np.int32), np.empty(n + 1), np.empty(n + 1, np.int32)
        collapses, table = np.zeros(3, np.int64), np.full((3, REGIONS + 1), np.nan)
        stop = np.zeros(1, np.bool_)
        look = sizes, ground.share, stop, removed, error, triangles, collapses, table
        made, measured = _thin(free.freedom, free.books, n, free.held, *look)
        assert (made, measured) == ((sizes[0] - least) // 2, 3)
        np.testing.assert_array_equal(triangles[: made + 1], sizes[0] - 2 * np.arange(made + 1))
        check(surface, free, first, ratio=0.1)
        assert free.cost == pytest.approx(costs(surface, free), rel=1e-8)
        assert error[made] == pytest.approx(free.cost, rel=1e-8)
        deviation, covered = twin(surface, free)
        row, own = table[2], slice(0, n)
        weight = free.freedom.ground.weight[:n]
        assert row[ERROR] == pytest.approx((weight * deviation[own]).sum(), rel=1e-9)
        assert row[SQUARES] == pytest.approx((weight * deviation[own] ** 2).sum(), rel=1e-9)
        assert row[MAXIMUM] == pytest.approx(deviation[own].max())
        assert row[TRIANGLES] == len(free.faces)
        assert row[UNCOVERED] == (~covered[own]).sum()
        assert row[VERTICES] == len(np.unique(free.faces))
        assert row[REGIONS] == pytest.approx((ground.share * deviation[n:]).sum(), rel=1e-9)
        assert border_of(free.faces) == border_of(first)


@pytest.mark.parametrize("name", ["whole", "parts"])
def test_what_is_said_of_a_mesh_before_any_move_is_what_evaluation_says(name):
    surface = surface_of(name)
    kept = subset(surface, 0.3, 2)
    said = surface.evaluate(kept[None])[0]
    ladder = FreeLadder(centroids=False)
    size = int(said[TRIANGLES])
    ladder.begin(surface, np.array([size]), np.array([size]), np.random.default_rng(1), moves=0)
    ladder.go_on(surface, lambda rung: kept)
    row = ladder.fronts[0].table[0]
    np.testing.assert_allclose(row[:REGIONS], said[:REGIONS], rtol=1e-9)


def test_an_edge_that_cuts_a_corner_of_a_box_flips():
    """Of a box eight corners and the pole are the box itself, with the right edges."""
    box = trimesh.creation.box((1.0, 1.3, 0.7)).subdivide().subdivide().subdivide()
    surface = ClosedSurface(open_model(box, Options(surface="closed")), Rules())
    points = surface.points
    corners = (np.isclose(points, points.min(axis=0)) | np.isclose(points, points.max(axis=0))).all(axis=1)
    assert corners.sum() == 8
    kept = corners | surface.pinned
    with surface.free_ground(centroids=False).triangulation(kept, min_height=0.0) as free:
        before = free.cost
        for hot in (0.1, 0.0):
            free.anneal(2000, np.array([3], np.uint64), hot=hot, cold=0.1 * hot, triangles=free.triangles)
        assert before > 0.1
        assert free.cost == pytest.approx(0.0, abs=1e-12)


# ------------------------------------------------------------------------------------------------------------ a search


def front_of(problem, moves=40_000):
    return Front.from_result(minimize(problem, memetic(12, triangulation="free"), Moves(moves), seed=3))


@cache
def searched(threads):
    return front_of(MeshProblem(load("blob:400,seed=3"), surface="closed", n_threads=threads))


def test_a_search_finds_free_meshes_that_are_better_and_can_be_measured_and_moved():
    front = searched(2)
    surface = front.surface
    assert front.n_free > 10
    subsets = [solution for solution in front if solution.free and solution.triangles > 100]
    assert all(solution.error < 0.97 * surface.simplify(solution.kept).quality.error for solution in subsets[::4])
    for solution in [solution for solution in front if solution.free][::8]:
        exact = surface.of_faces(solution.faces).quality
        assert exact.triangles == solution.triangles == len(solution.faces)
        assert exact.error <= solution.error * (1 + 1e-9)
        assert not border_of(solution.faces)
        assert solution.refit().error <= exact.error * (1 + 1e-9)


def test_the_same_seed_finds_the_same_on_any_number_of_threads():
    one, two = searched(1), searched(2)
    assert one.F.tobytes() == two.F.tobytes()
    for a, b in zip(one, two, strict=True):
        assert a.faces.tobytes() == b.faces.tobytes()


def test_a_front_is_freed():
    problem = MeshProblem(load("blob:400,seed=3"), surface="closed")
    thinned = thinning(problem.surface)
    rows = [thinned.kept(int(np.flatnonzero(thinned.triangles == size)[0])) for size in (100, 200)]
    front = Front.from_subsets(problem, np.array(rows))
    freed = front.free(moves=40_000)
    assert freed.n_free == 2
    assert (freed.F[:, 0] < front.F[:, 0]).all()


@pytest.mark.usefixtures("sketched")
def test_the_shell_frees_meshes_and_reads_them_back(tmp_path, capsys):
    path = tmp_path / "parts.ply"
    parts().export(path)
    out = tmp_path / "out"
    said = ["--free", "--surface", "closed", "--moves", "20000", "--population", "8", "--no-page", "-q"]
    said += ["--refit", "--meshes", "4"]
    assert main(["simplify", str(path), "-o", str(out), *said]) == 0
    front = Front.load(out)
    assert front.n_free > 0
    solution = next(solution for solution in front if solution.free)
    assert main(["pick", str(out), "--solution", str(solution.solution), "-o", str(tmp_path / "one.ply")]) == 0
    assert len(trimesh.load(tmp_path / "one.ply", process=False).faces) == solution.triangles
