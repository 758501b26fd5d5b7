"""Moves of a live closed mesh: what was tried is what is done, and what is done is what there is from scratch."""

from __future__ import annotations

from functools import cache

import numba
import numpy as np
import pytest
import trimesh
from closed_lining import CASES as LINED
from closed_lining import case as lined
from closed_lining import random_subset as some_of

from meshsimp_pymoo.compiling.functions import OPTIONS
from meshsimp_pymoo.compiling.linking import EntryCompiler, is_known
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.plane.borrow import borrowed
from meshsimp_pymoo.search.greedy import greedy_insertion, thinning
from meshsimp_pymoo.search.local_search import MoveShares, relocate
from meshsimp_pymoo.surface import moves
from meshsimp_pymoo.surface.closed.surface import ClosedSurface
from meshsimp_pymoo.surface.measures import ERROR, MAXIMUM, SQUARES, TRIANGLES
from meshsimp_pymoo.surface.rules import Rules

COLUMN = {"error": ERROR, "rms_error": SQUARES, "max_error": MAXIMUM}
MODELS = ("bumpy", "cube", "limbs")

# as quick to compile as the package's own
compiled = numba.njit(**OPTIONS, pipeline_class=EntryCompiler) if is_known() else numba.njit


def source(name):
    """Return a mesh: of no symmetry, of exact ties in space and in the plane, or with limbs whose images are tiny."""
    if name == "cube":
        mesh = trimesh.creation.box()
        for _ in range(3):
            mesh = mesh.subdivide()
        return mesh
    mesh = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = mesh.vertices.T
    if name == "bumpy":
        mesh.vertices *= (1.0 + 0.2 * np.sin(5.0 * x + 1.0) * np.cos(4.0 * y + z))[:, None]
    else:
        mesh.vertices *= (1.0 + 6.0 * (np.abs(x) > 0.9) * (np.abs(x) - 0.9) / 0.1)[:, None]
        mesh.vertices += 0.003 * np.sin(40.0 * mesh.vertices[:, [1, 2, 0]])
    return mesh


@cache
def surface_of(name, measure="error", weighted=False):
    return ClosedSurface(opened(name), Rules(measure=measure, weights="area" if weighted else None))


@cache
def opened(name):
    return open_model(source(name), Options(surface="closed"))


@compiled
def step(record, lent, v, w, limit, done):
    """Try to exchange v for w, or do it.

    Returns the change of the cost and of the triangles that is announced; cost and triangles before and after.
    """
    ground, books = borrowed(record), borrowed(lent)
    before, size = moves.total_cost(ground, books), moves.n_triangles(ground, books)
    change, triangles = moves.try_exchange(ground, books, v, w, limit)
    if done and not moves.exchange(ground, books, v, w):
        change = np.inf
    return change, triangles, before, size, moves.total_cost(ground, books), moves.n_triangles(ground, books)


def tried(ground, books, v, w, limit):
    return step(ground, books, v, w, limit, False)[:2]


def check_moves(surface, kept, steps, every):
    """Make random moves, also such that insert and remove, of one part or of two, and compare with what is there."""
    measure, part = surface.rules.measure, surface.model.part
    ground, rng, most = surface.ground(), np.random.default_rng(1), 3 * int(kept.sum())
    with surface.books(kept) as books:
        for number in range(1, steps + 1):
            v, w = rng.choice(np.flatnonzero(kept & ~surface.pinned)), rng.choice(np.flatnonzero(~kept))
            kind = rng.random()
            if kind < 0.25 and kept.sum() < most:
                v = -1
            elif kind < 0.5 and (kept & ~surface.pinned).sum() > 2:
                w = -1
            change, triangles, before, size, after, new_size = step(ground, books, int(v), int(w), np.inf, True)
            if v >= 0 and (part[kept] == part[v]).sum() == 4 and (w < 0 or part[w] != part[v]):
                assert change == np.inf  # or the part would be no mesh
                assert after == before
                continue
            assert new_size - size == triangles
            assert abs(after - before - change) <= 1e-9 * (1.0 + after)
            kept[[row for row in (v, w) if row >= 0]] ^= True
            if number % every:
                continue
            sites, cost, triangles = moves.snapshot(ground, books, surface.n_vertices)
            assert np.array_equal(sites, kept)
            row = surface.evaluate(kept)[0]
            assert triangles == row[TRIANGLES]
            if len(surface.model.rim) == 0:
                assert triangles == 2 * kept.sum() - 4 * surface.model.n_parts
            if measure == "max_error":
                assert books.peaks[1] == pytest.approx(row[MAXIMUM], rel=1e-12)
            else:
                assert cost == pytest.approx(row[COLUMN[measure]], rel=1e-9, abs=1e-9)


def sixty_of(surface):
    kept = surface.pinned.copy()
    kept[:: surface.n_vertices // 60] = True
    return kept


CASES = [*((name, "error", False) for name in MODELS), ("bumpy", "rms_error", True), ("limbs", "max_error", False)]


@pytest.mark.parametrize(("name", "measure", "weighted"), CASES)
def test_moves_change_what_they_were_tried_to_and_end_where_scratch_does(name, measure, weighted):
    surface = surface_of(name, measure, weighted)
    check_moves(surface, sixty_of(surface), 1_000, 50)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "measure", "weighted"), CASES)
def test_many_moves_change_what_they_were_tried_to_and_end_where_scratch_does(name, measure, weighted):
    surface = surface_of(name, measure, weighted)
    check_moves(surface, sixty_of(surface), 20_000, 100)


def test_a_change_above_the_limit_is_given_up_and_one_below_it_is_not():
    surface = surface_of("bumpy")
    kept = surface.pinned.copy()
    kept[::9] = True
    ground = surface.ground()
    with surface.books(kept) as books:
        sites = np.flatnonzero(kept & ~surface.pinned)
        v = max(sites, key=lambda v: tried(ground, books, v, -1, np.inf)[0])
        change, triangles = tried(ground, books, v, -1, np.inf)
        assert triangles == -2
        assert change > 0.0
        assert tried(ground, books, v, -1, 1.001 * change) == (change, -2)
        assert tried(ground, books, v, -1, 0.5 * change)[0] == np.inf
        assert tried(ground, books, v, -1, np.inf)[0] == change  # nothing is left of what was given up


@pytest.mark.parametrize("measure", COLUMN)
def test_thinning_and_insertion_know_the_error_of_what_they_leave(measure):
    surface = surface_of("bumpy", measure)
    for front in (thinning(surface), greedy_insertion(surface, most=40)):
        for k in (0, len(front) // 2, len(front) - 1):
            row = surface.evaluate(front.kept(k))[0]
            if row[TRIANGLES] == 0:
                assert front.error[k] == np.inf
                continue
            said = np.sqrt(row[SQUARES] / surface.total_weight) if measure == "rms_error" else row[COLUMN[measure]]
            assert front.error[k] == pytest.approx(said, rel=1e-9, abs=1e-12)
            assert front.triangles[k] == row[TRIANGLES]


def test_thinning_finds_hardly_more_of_a_cube_than_its_corners():
    front = thinning(surface_of("cube"))
    assert front.triangles[front.error <= 1e-9].min() <= 28


def test_relocation_lowers_the_error_at_the_same_size_and_seed_by_seed_alike():
    surface = surface_of("bumpy")
    front = thinning(surface)
    kept = front.kept(int(np.searchsorted(front.triangles, 60, side="right")) - 1)
    moved = relocate(surface, kept, moves=5_000, seed=3)
    assert moved.sum() == kept.sum()
    assert surface.evaluate(moved)[0, ERROR] < 0.95 * surface.evaluate(kept)[0, ERROR]
    assert np.array_equal(moved, relocate(surface, kept, moves=5_000, seed=3))


def test_a_vertex_with_more_triangles_than_are_tried_is_moved_all_the_same():
    """A cone: its tip is in a hundred triangles, which are done and undone."""
    surface = ClosedSurface(open_cone(100))
    tip = int(np.argmax(surface.points[:, 1] if np.ptp(surface.points[:, 1]) > 2.9 else surface.points[:, 2]))
    ground, everything = surface.ground(), np.ones(surface.n_vertices, bool)
    with surface.books(everything) as books:
        before = moves.snapshot(ground, books, surface.n_vertices)
        change, triangles = tried(ground, books, tip, -1, np.inf)
        after = moves.snapshot(ground, books, surface.n_vertices)
    assert before[1] == after[1] == 0.0
    assert np.array_equal(before[0], after[0])
    everything[tip] = False
    assert change == pytest.approx(surface.evaluate(everything)[0, ERROR], rel=1e-12)
    assert triangles == -2


def open_cone(n):
    angle = 2.0 * np.pi * np.arange(n) / n
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    points = np.concatenate([rim, 0.3 * rim - [0, 0, 0.2], [[0.0, 0.0, 3.0], [0.0, 0.0, -0.25]]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    tip, bottom = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    sides = [(k, after, tip), (after, k, n + k), (after, n + k, n + after), (n + after, n + k, bottom)]
    faces = np.concatenate([np.column_stack(side) for side in sides])
    return open_model(trimesh.Trimesh(points, faces, process=False), Options(surface="closed"))


def test_where_there_is_no_border_room_for_one_triangle_stays_empty():
    surface = surface_of("bumpy")
    kept = surface.pinned.copy()
    kept[::9] = True
    most = 2 * int(kept.sum()) - 3
    moved = relocate(surface, kept, moves=2_000, seed=1, triangles=most, shares=MoveShares(border=0.9))
    assert surface.evaluate(moved)[0, TRIANGLES] == most - 1


@pytest.mark.parametrize("name", LINED)
def test_moves_beside_lines_end_where_scratch_does(name):
    check_moves(lined(name), some_of(lined(name), 0.1, 4), 300, 20)


@pytest.mark.slow
@pytest.mark.parametrize("name", LINED)
def test_many_moves_beside_lines_end_where_scratch_does(name):
    check_moves(lined(name), some_of(lined(name), 0.1, 4), 20_000, 100)
