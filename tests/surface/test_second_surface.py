"""A surface of another kind enters without a change in the package: problem, operators, searches, folder and page."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from circle import RingSurface, StillRing, least_errors
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, greedy_insertion, memetic, nsga2_v1, nsga2_v2, plot_mesh, thinning
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.search.local_search import relocate
from meshsimp_pymoo.search.operators import OAX, NeighbourShift, PinnedCorners, RandomSubset
from meshsimp_pymoo.surface.rules import Rules


def heights(n: int, seed: int = 1) -> np.ndarray:
    """A rough walk round a circle, (n,)."""
    walk = np.random.default_rng(seed).normal(size=n).cumsum()
    return walk - np.linspace(0, walk[-1], n)


@pytest.fixture(scope="module")
def ring() -> RingSurface:
    return RingSurface(heights(40))


def test_evaluation_and_the_known_front_agree_on_small_rings() -> None:
    small = RingSurface(heights(9))
    least = np.full(10, np.inf)
    for bits in range(2**9):
        kept = np.r_[True, (bits >> np.arange(9)) & 1 == 1] | small.pinned
        error, triangles = small.evaluate(kept[None])[0, :2]
        least[int(triangles)] = min(least[int(triangles)], error)
    np.testing.assert_allclose(least, least_errors(small), atol=1e-12)


def test_thinning_and_insertion_follow_its_moves(ring: RingSurface) -> None:
    known = least_errors(ring)
    for front in (thinning(ring), greedy_insertion(ring), greedy_insertion(ring, choose="triangle")):
        table = ring.evaluate(np.array([front.kept(k) for k in range(len(front))]))
        np.testing.assert_allclose(front.F, table[:, :2], atol=1e-12)
        assert (front.error >= known[front.triangles] - 1e-12).all()
        assert front.error[-1] == pytest.approx(0, abs=1e-12)
    # Each step is the best one: no other removal from the same subset adds less.
    front = thinning(ring)
    for k in (5, 20, len(front) - 1):
        kept = front.kept(k)
        free = np.flatnonzero(kept & ~ring.pinned)
        others = np.repeat(kept[None], len(free), axis=0)
        others[np.arange(len(free)), free] = False
        assert front.error[k - 1] == pytest.approx(ring.evaluate(others)[:, 0].min(), abs=1e-12)


def test_annealing_keeps_its_books_and_comes_near_the_known_front(ring: RingSurface) -> None:
    known = least_errors(ring)
    start = ring.pinned.copy()
    start[np.flatnonzero(~start)[::3]] = True
    found = relocate(ring, start, triangles=15, moves=20_000, seed=3)
    error, triangles = ring.evaluate(found[None])[0, :2]
    assert triangles <= 15
    assert known[15] - 1e-12 <= error <= 1.05 * known[15]


@pytest.mark.parametrize("preset", [nsga2_v1, nsga2_v2, memetic])
def test_presets_run_on_it(ring: RingSurface, preset) -> None:
    problem = MeshProblem(ring)
    result = minimize(problem, preset(24), ("n_gen", 12), seed=1)
    known = least_errors(ring)
    assert (result.F[:, 0] >= known[result.F[:, 1].astype(int)] - 1e-12).all()
    if preset is memetic:
        assert result.F[:, 0].sum() <= 1.02 * known[result.F[:, 1].astype(int)].sum()


def test_the_operators_run_on_it_in_pymoo_s_own_nsga2(ring: RingSurface) -> None:
    algorithm = NSGA2(20, sampling=RandomSubset(), crossover=OAX(), mutation=NeighbourShift(), repair=PinnedCorners())
    result = minimize(MeshProblem(ring), algorithm, ("n_gen", 5), seed=1)
    assert result.X[:, ring.pinned].all()


@pytest.mark.parametrize("measure", ["error", "rms_error"])
def test_its_front_is_written_with_pictures_and_a_page_and_read_again(measure: str, tmp_path: Path) -> None:
    surface = (RingSurface if measure == "error" else StillRing)(heights(30), Rules(measure=measure))
    problem = MeshProblem(surface)
    front = Front.from_result(minimize(problem, nsga2_v1(16), ("n_gen", 4), seed=1))
    front.save(tmp_path / "out", page=True, meshes=None)
    for name in ("front.csv", "front.npz", "front.png", "report.html", "run.json"):
        assert (tmp_path / "out" / name).stat().st_size > 0
    again = Front.load(tmp_path / "out", model=surface)
    np.testing.assert_array_equal(again.F, front.F)
    np.testing.assert_array_equal(again[0].faces, front[0].faces)
    with pytest.raises(ResultError, match="measure"):
        Front.load(tmp_path / "out", model=RingSurface(heights(30), Rules(measure="max_error")))


def test_it_is_drawn(ring: RingSurface) -> None:
    axes = plot_mesh(ring, kept=ring.pinned)
    assert len(axes.collections) > 0


def test_without_moves_pymoo_s_algorithms_run_and_memetic_says_in_one_line_why_it_does_not() -> None:
    surface = StillRing(heights(20))
    assert len(minimize(MeshProblem(surface), nsga2_v2(12), ("n_gen", 2), seed=1).F)
    for refused in (
        lambda: minimize(MeshProblem(surface), memetic(12), ("n_gen", 2), seed=1),
        lambda: thinning(surface),
        lambda: greedy_insertion(surface),
    ):
        with pytest.raises(ValueError, match=r"a StillRing does not have; use an algorithm .* nsga2_v1") as refusal:
            refused()
        assert "\n" not in str(refusal.value)


def test_loops_compiled_for_it_are_not_left_on_disk_where_they_would_outlive_it() -> None:
    """A record that cannot be imported any more would make every later process fail to read the cache's index."""
    ask = "with surface.books(surface.pinned) as b: print(site_mask(surface.ground(), b, surface.n_vertices).sum())"
    imports = "from meshsimp_pymoo.surface.moves import site_mask; from meshsimp_pymoo import MeshProblem"
    for folder, surface in (
        ("", "__import__('circle').RingSurface([0, 1, 0, 2, 5])"),
        ("..", "MeshProblem('roof:3').surface"),
    ):
        code = f"{imports}\nsurface = {surface}\n{ask}"
        ran = subprocess.run(
            [sys.executable, "-c", code], cwd=Path(__file__).parent / folder, check=True, capture_output=True
        )
        assert int(ran.stdout) == 4
