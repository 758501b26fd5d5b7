"""Another kind of surface needs no line of the package changed: it is searched, thinned, annealed, shown and stored."""

from __future__ import annotations

import csv
import itertools
import json
import math
import pickle
import re

import numpy as np
import pytest
from circle import Circle, Curve, Round, UnmovableCircle, circle, fan, least_errors
from enumerable_models import nondominated, same_front, true_front
from numba import njit
from pymoo.algorithms.moo.age import AGEMOEA
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.spea2 import SPEA2
from pymoo.operators.crossover.pntx import TwoPointCrossover
from pymoo.operators.crossover.ux import UniformCrossover
from pymoo.operators.mutation.bitflip import BitflipMutation
from pymoo.operators.sampling.rnd import BinaryRandomSampling
from pymoo.optimize import minimize
from pymoo.util.ref_dirs import get_reference_directions

from meshsimp_pymoo import (
    Front,
    HalfPlaneCrossover,
    MeshProblem,
    NestedSubsets,
    PinnedCorners,
    Relocation,
    SizeStep,
    greedy_insertion,
    memetic,
    nsga2_v1,
    nsga2_v2,
    plot_mesh,
    thinning,
)
from meshsimp_pymoo.errors import ResultError
from meshsimp_pymoo.search.greedy import thin
from meshsimp_pymoo.search.local_search import relocate, relocate_all
from meshsimp_pymoo.search.operators import OPERATORS
from meshsimp_pymoo.surface.ground import Ground
from meshsimp_pymoo.surface.measures import ERROR, MEASURES, OF_LINES, OF_MESH, TRIANGLES
from meshsimp_pymoo.surface.moves import exchange, snapshot, total_cost, try_exchange
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.surface import Surface


@pytest.fixture(scope="module")
def problem():
    return MeshProblem(circle(40), regions=4)


def twin(surface, kept, power=1):
    """The sum of the costs of the dropped points, by the definition, in plain Python."""
    points, n, total = surface.points.tolist(), surface.n_vertices, 0.0
    for i in itertools.compress(range(n), ~kept):
        a = next(k % n for k in range(i + n, i, -1) if kept[k % n])
        b = next(k % n for k in range(i, i + n) if kept[k % n])
        (ax, ay, _), (bx, by, _), (px, py, _) = points[a], points[b], points[i]
        along = ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
        t = min(max(along, 0.0), 1.0)
        total += math.hypot(px - ax - t * (bx - ax), py - ay - t * (by - ay)) ** power
    return total


def random_subset(surface, share, seed):
    return (np.random.default_rng(seed).random(surface.n_vertices) < share) | surface.pinned


def assert_as_by_definition(problem, X, F):
    for kept, (error, triangles) in zip(X, F, strict=True):
        assert error == pytest.approx(twin(problem.surface, kept), rel=1e-9, abs=1e-12)
        assert triangles == kept.sum() - 2


# --------------------------------------------------------------------------------------------------- what it is


def test_it_has_all_that_a_surface_has_and_is_none_of_the_package_s():
    asked = {name for name in vars(Surface) if not name.startswith("_")}
    for kind in (Circle, UnmovableCircle):
        assert asked <= {*dir(kind), "model", "rules", "pinned"}
    assert not any(base.__module__.startswith("meshsimp_pymoo") for base in Circle.__mro__)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.7, 1.0])
def test_its_numbers_are_those_of_the_definition_and_of_any_mesh(share):
    surface = circle(30)
    kept = random_subset(surface, share, 3)
    row, mesh = surface.evaluate(kept, regions=3)[0], surface.simplify(kept)
    assert row[ERROR] == pytest.approx(twin(surface, kept))
    assert row[6:].sum() == pytest.approx(row[ERROR])
    assert row[TRIANGLES] == len(mesh.faces) == kept.sum() - 2
    scored = surface.score(surface.model.file_points, mesh.faces).quality
    assert scored.error == pytest.approx(mesh.quality.error)
    assert (scored.triangles, scored.vertices) == (mesh.quality.triangles, mesh.quality.vertices)
    assert surface.of_faces(mesh.faces).quality == scored
    other = np.roll(np.flatnonzero(kept), 1)  # a fan from another point covers the same
    assert surface.of_faces(fan(other)).quality.error == pytest.approx(mesh.quality.error)


# ------------------------------------------------------------------------------------------------------- moves


@njit
def _walk(ground, books, old, new):
    """Make exchanges; return the change that was announced and the cost that there is, after each."""
    announced, there = np.empty(len(old)), np.empty(len(old))
    for k in range(len(old)):
        before = total_cost(ground, books)
        announced[k] = before + try_exchange(ground, books, old[k], new[k], np.inf)[0]
        exchange(ground, books, old[k], new[k])
        there[k] = total_cost(ground, books)
    return announced, there


@pytest.mark.parametrize("measure", ["error", "rms_error"])
def test_the_cost_is_exact_after_every_exchange_asked_for_by_the_package_s_names(measure):
    surface = circle(25, measure=measure)
    kept, rng = random_subset(surface, 0.4, 1), np.random.default_rng(2)
    states, old, new = [kept], [], []
    for _ in range(30):
        now = states[-1].copy()
        old.append(rng.choice(np.r_[-1, np.flatnonzero(now & ~surface.pinned)]))
        new.append(rng.choice(np.flatnonzero(~now)))
        now[new[-1]] = True
        if old[-1] >= 0:
            now[old[-1]] = False
        states.append(now)
    with surface.books(kept) as books:
        announced, there = _walk(surface.ground(), books, np.array(old), np.array(new))
    power = 1 if measure == "error" else 2
    np.testing.assert_allclose(there, [twin(surface, state, power) for state in states[1:]], rtol=1e-9)
    np.testing.assert_allclose(announced, there, rtol=1e-9)


@pytest.mark.parametrize("measure", ["error", "rms_error"])
def test_thinning_is_that_of_its_slow_twin(measure):
    surface = circle(30, measure=measure)
    power = 1 if measure == "error" else 2
    kept, order = np.ones(30, bool), []
    while (kept & ~surface.pinned).any():
        rows = np.flatnonzero(kept & ~surface.pinned)
        costs = [twin(surface, kept & (np.arange(30) != v), power) for v in rows]
        order.append(int(rows[np.argmin(costs)]))
        kept[order[-1]] = False
    front = thinning(surface)
    assert front.order[::-1].tolist() == order
    sums = [twin(surface, front.kept(k), power) for k in range(len(front))]
    expected = sums if power == 1 else np.sqrt(np.array(sums) / 30)
    np.testing.assert_allclose(front.error, expected, rtol=1e-9, atol=1e-12)
    assert front.triangles.tolist() == [front.kept(k).sum() - 2 for k in range(len(front))]


@pytest.mark.parametrize("choose", ["point", "triangle"])
def test_insertion_is_that_of_its_slow_twin(choose):
    surface = circle(30)
    kept, order = surface.pinned.copy(), []
    while not kept.all():
        deviation = surface.simplify(kept).deviation
        sites = np.flatnonzero(kept)
        cell = np.searchsorted(sites, np.arange(30), side="right") - 1  # all before the first site are in the last
        whole = np.array([deviation[cell % len(sites) == k].sum() for k in range(len(sites))])
        if choose == "triangle":
            deviation = np.where(cell % len(sites) == np.argmax(whole), deviation, -1.0)
        order.append(int(np.argmax(deviation)))
        kept[order[-1]] = True
    front = greedy_insertion(surface, choose=choose)
    assert front.order.tolist() == order
    np.testing.assert_allclose(front.error, [twin(surface, front.kept(k)) for k in range(len(front))], atol=1e-12)


def test_relocation_lowers_the_error_and_keeps_the_size_and_the_pins():
    surface = circle(40)
    start = random_subset(surface, 0.3, 5)
    for moves in (0, 1, 30, 1000):
        found = relocate(surface, start, moves=moves, seed=7)
        assert found[surface.pinned].all()
        assert found.sum() <= start.sum()
        assert twin(surface, found) <= twin(surface, start) * (1 + 1e-9)
    assert twin(surface, found) < 0.5 * twin(surface, start)
    for wanted in (5, 20):
        assert relocate(surface, start, moves=0, seed=7, triangles=wanted).sum() - 2 == wanted
        assert relocate(surface, start, moves=0, seed=7, size=wanted).sum() == wanted
    many = np.array([start, random_subset(surface, 0.8, 6)])
    found = relocate_all(surface, many, np.array([200, 200]), np.random.default_rng(1))
    assert all(twin(surface, new) < twin(surface, old) for new, old in zip(found, many, strict=True))
    found = relocate(surface, start, triangles=10, moves=20_000, seed=3)
    assert twin(surface, found) <= 1.02 * least_errors(surface)[10]


def test_nothing_is_kept_on_disk_of_what_was_compiled_for_it():
    """Else a process that cannot import its classes could thin nothing any more, and old answers would be given."""
    for surface in (circle(9), MeshProblem("roof:3").surface):
        thinning(surface)
    for loop in (thin, snapshot):
        kept = loop._cache.files[-1].keys()
        records = {getattr(kind, "instance_class", None) for signature, *_ in kept for kind in signature}
        assert Ground in records
        assert Round not in records


# ---------------------------------------------------------------------------------------------------- searches


CROSSOVERS = [("random_subset", crossover, "neighbour_shift") for crossover in OPERATORS["crossover"]]
MUTATIONS = [("nested", "uniform", mutation) for mutation in OPERATORS["mutation"]]


@pytest.mark.parametrize(("sampling", "crossover", "mutation"), CROSSOVERS + MUTATIONS)
def test_every_operator_works_in_nsga2(problem, sampling, crossover, mutation):
    names = {"sampling": sampling, "crossover": crossover, "mutation": mutation, "repair": "pinned_corners"}
    operators = {kind: OPERATORS[kind][name]() for kind, name in names.items()}
    algorithm = NSGA2(12, eliminate_duplicates=OPERATORS["duplicates"]["packed"](), **operators)
    result = minimize(problem, algorithm, ("n_gen", 4), seed=1)
    assert_as_by_definition(problem, result.X, result.F)
    assert result.X[:, problem.pinned].all()


def test_pymoo_s_own_operators_work_too_and_threads_change_nothing(problem):
    results = []
    for threads in (1, 3):
        fresh = MeshProblem(problem.surface, n_threads=threads, memo=0)
        algorithm = NSGA2(
            20,
            sampling=BinaryRandomSampling(),
            crossover=TwoPointCrossover(),
            mutation=BitflipMutation(),
            repair=PinnedCorners(),
        )
        results.append(minimize(fresh, algorithm, ("n_gen", 6), seed=1))
        assert_as_by_definition(problem, results[-1].X, results[-1].F)
    assert results[0].X.tobytes() == results[1].X.tobytes()
    many = np.array([random_subset(problem.surface, share, 1) for share in np.linspace(0, 1, 31)])
    tables = [problem.surface.evaluate(many, threads=threads, regions=2) for threads in (1, 4)]
    np.testing.assert_array_equal(*tables)


def test_memetic_finds_the_whole_front_of_a_small_circle():
    problem = MeshProblem(circle(12))
    known = true_front(problem)
    np.testing.assert_allclose(known[:, 0], least_errors(problem.surface)[1:], atol=1e-12)
    result = minimize(MeshProblem(circle(12)), memetic(), ("n_gen", 30), seed=1)
    assert same_front(result.F, known, tolerance=1e-9)
    assert_as_by_definition(problem, result.X, result.F)
    # Thinning alone does not.
    assert not same_front(thinning(problem.surface).F, known, tolerance=1e-9)


def test_memetic_is_never_worse_than_thinning_and_begins_with_it(problem):
    nested = thinning(problem.surface)
    result = minimize(problem, memetic(10, moves_per_vertex=50), ("n_gen", 4), seed=1)
    for error, triangles in zip(nested.error, nested.triangles, strict=True):
        fitting = result.F[:, 1] <= triangles
        if fitting.any() and triangles in result.algorithm.survival.rungs:
            assert result.F[fitting, 0].min() <= error * (1 + 1e-9) + 1e-12
    least = least_errors(problem.surface)[result.F[:, 1].astype(int)]
    assert (result.F[:, 0] >= least * (1 - 1e-9) - 1e-12).all()
    assert result.F[:, 0].sum() <= 1.05 * least.sum()
    assert "adaptive thinning (start)" in Front.from_result(result).series


def test_the_problem_pickles(problem):
    again = pickle.loads(pickle.dumps(problem))
    kept = random_subset(problem.surface, 0.4, 9)
    assert again.evaluate(kept).tolist() == problem.evaluate(kept).tolist()
    assert thinning(again.surface).order.tolist() == thinning(problem.surface).order.tolist()


# ------------------------------------------------------------------------------------------------------- results


@pytest.fixture(scope="module")
def front(problem):
    return Front.from_result(minimize(problem, memetic(12, moves_per_vertex=20), ("n_gen", 2), seed=1))


@pytest.fixture(scope="module")
def folder(front, tmp_path_factory):
    out = tmp_path_factory.mktemp("circle") / "out"
    return front.save(out, chosen=front.best(triangles=10), refit=True)


def test_a_solution_is_picked_and_is_a_mesh_of_the_file(front, problem, tmp_path):
    best = front.best(triangles=10)
    assert best.triangles == 10
    assert best.error == min(q.error for q in front.quality if q.triangles <= 10)
    assert front.best(max_error=0.05).triangles == min(q.triangles for q in front.quality if q.max_error <= 0.05)
    assert front.knee() in list(front)
    with pytest.raises(LookupError, match="the surface error of the solutions of a circle was not measured"):
        front.best(surface_error=0.05)
    assert best.mesh.faces.tolist() == fan(np.arange(12)).tolist()
    np.testing.assert_array_equal(best.mesh.vertices, problem.model.file_points[best.kept])
    assert best.refitted.error == best.error
    assert best.save(tmp_path / "best.ply").is_file()
    assert best.save(tmp_path / "best.stl").is_file()
    drawn = plot_mesh(problem, kept=best.kept).collections[0]
    assert len(drawn.get_paths()) == 10
    assert best.plot_error().collections


def test_its_folder_holds_the_numbers_of_the_definition(folder, front, problem):
    with (folder / "front.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["triangles"]) for row in rows] == [q.triangles for q in front.quality]
    for row, kept in zip(rows, front.kept, strict=True):
        assert float(row["error"]) == pytest.approx(twin(problem.surface, kept), rel=1e-9, abs=1e-12)
        assert int(row["uncovered"]) == (~kept).sum()
        assert [row[name] for name in OF_MESH] == ["", "", ""]  # a circle has nothing between its points
        assert row["refitted_error"] == row["error"]
    assert (folder / "front.png").read_bytes().startswith(b"\x89PNG")
    run = json.loads((folder / "run.json").read_text())
    assert (run["model"]["vertices"], run["model"]["triangles"]) == (40, 38)
    assert run["rules"]["measure"] == "error"


def test_its_page_says_the_same(folder, front, problem):
    page = (folder / "report.html").read_text()
    data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1])
    for name in set(MEASURES) - {*OF_LINES}:
        known = [None if name in OF_MESH else getattr(q, name) for q in front.quality]
        assert data["columns"][name] == known
    assert '<option value="surface_error">' not in page
    assert (data["model"]["vertices"], data["model"]["triangles"]) == (40, 38)
    assert data["model"]["diagonal"] == problem.surface.diagonal
    assert data["chosen"] == front.best(triangles=10).solution
    assert data["knee"] == front.knee().solution
    for solution, quality in zip(data["solutions"], front.quality, strict=True):
        assert solution["largest"] == pytest.approx(quality.max_error)


def test_a_stored_front_is_read_back_with_its_surface_and_no_other(folder, front, problem):
    stored = Front.load(folder)
    assert stored.quality == front.quality
    assert stored.best(triangles=10).triangles == 10
    with pytest.raises(ResultError, match=r"its model cannot be read .*pass the original \(Front\.load"):
        stored.problem  # noqa: B018 - made when asked for
    whole = Front.load(folder, model=problem.surface)
    assert whole.best(triangles=10).mesh.faces.tolist() == front.best(triangles=10).mesh.faces.tolist()
    with pytest.raises(ResultError, match="is the front of another model"):
        Front.load(folder, model=circle(40, seed=2))
    with pytest.raises(ResultError, match=r"has other rules than this Circle: measure='error'; "):
        Front.load(folder, model=circle(40, measure="rms_error"))


# ------------------------------------------------------------------------------------------- one without moves


@pytest.fixture(scope="module")
def unmovable():
    return MeshProblem(circle(16, kind=UnmovableCircle))


def any_operators():
    return {
        "sampling": BinaryRandomSampling(),
        "crossover": UniformCrossover(),
        "mutation": BitflipMutation(),
        "repair": PinnedCorners(),
    }


ALGORITHMS = {
    "NSGA2": lambda: NSGA2(16, **any_operators()),
    "AGEMOEA": lambda: AGEMOEA(pop_size=16, **any_operators()),
    "SPEA2": lambda: SPEA2(pop_size=16, **any_operators()),
    "MOEAD": lambda: MOEAD(get_reference_directions("uniform", 2, n_partitions=15), n_neighbors=5, **any_operators()),
    "nsga2_v1": lambda: nsga2_v1(16),
    "nsga2_v2": lambda: nsga2_v2(16),
}


@pytest.mark.parametrize(
    "name",
    # pymoo compiles for AGE-MOEA, each time
    [pytest.param(name, marks=pytest.mark.slow if name == "AGEMOEA" else ()) for name in ALGORITHMS],
)
def test_without_moves_every_algorithm_that_only_evaluates_runs(unmovable, name, tmp_path):
    result = minimize(unmovable, ALGORITHMS[name](), ("n_gen", 5), seed=1)
    X, F = np.atleast_2d(result.X), np.atleast_2d(result.F)
    assert_as_by_definition(unmovable, X | unmovable.pinned, F)
    front = Front.from_result(result)
    assert len(nondominated(front.F)) == len(front)
    if name == "nsga2_v1":
        assert (front.save(tmp_path / "out") / "report.html").is_file()


@pytest.mark.parametrize(
    "ask",
    [
        lambda problem: minimize(problem, memetic(8), ("n_gen", 2), seed=1),
        lambda problem: thinning(problem.surface),
        lambda problem: greedy_insertion(problem.surface),
        lambda problem: relocate(problem.surface, problem.pinned, moves=5, seed=1),
        lambda problem: minimize(problem, NSGA2(8, sampling=NestedSubsets(), **without_sampling()), ("n_gen", 2)),
        lambda problem: mutated(problem, Relocation()),
        lambda problem: mutated(problem, SizeStep()),
        lambda problem: crossed(problem, HalfPlaneCrossover(prob=1.0, keep_size=True)),
    ],
    ids=["memetic", "thinning", "insertion", "relocate", "NestedSubsets", "Relocation", "SizeStep", "HalfPlane"],
)
def test_without_moves_what_needs_them_refuses_in_one_line_with_the_way_out(unmovable, ask):
    with pytest.raises(ValueError, match="moves") as refused:
        ask(unmovable)
    said = str(refused.value)
    assert "\n" not in said
    assert "a UnmovableCircle does not have; use an algorithm that only evaluates, such as nsga2_v1()" in said


def without_sampling():
    return {kind: operator for kind, operator in any_operators().items() if kind != "sampling"}


def mutated(problem, mutation):
    X = np.array([random_subset(problem.surface, 0.5, seed) for seed in range(3)])
    return mutation._do(problem, X, random_state=np.random.default_rng(1))


def crossed(problem, crossover):
    X = np.array([[random_subset(problem.surface, 0.5, seed)] for seed in range(2)])
    return crossover._do(problem, X, random_state=np.random.default_rng(1))


def test_it_has_no_free_meshes_and_says_so(problem, front):
    message = "free meshes are made by moves of edges, which a Circle does not have"
    with pytest.raises(ValueError, match=message):
        minimize(problem, memetic(10, triangulation="free"), ("n_gen", 2), seed=1)
    with pytest.raises(ValueError, match=message):
        front.free(moves=10)


def test_a_curve_alone_has_no_rules():
    curve = Curve(np.zeros((3, 3)))
    with pytest.raises(TypeError, match=r"a Curve has no rules; give a surface, such as problem\.surface"):
        thinning(curve)
    with pytest.raises(TypeError, match="not Curve"):
        MeshProblem(curve)
    assert Circle(curve, Rules()).ground().__class__ is Round
