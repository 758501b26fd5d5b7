from __future__ import annotations

import copy
import itertools
import pickle
from multiprocessing.pool import ThreadPool

import numpy as np
import pytest
import trimesh
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.soo.nonconvex.ga import BGA, GA
from pymoo.algorithms.soo.nonconvex.ga_niching import NicheGA
from pymoo.algorithms.soo.nonconvex.random_search import RandomSearch
from pymoo.core.population import Population
from pymoo.core.problem import ElementwiseEvaluationFunction
from pymoo.indicators.hv import HV
from pymoo.operators.crossover.ux import UX
from pymoo.operators.mutation.bitflip import BitflipMutation
from pymoo.operators.sampling.rnd import BinaryRandomSampling
from pymoo.optimize import minimize
from pymoo.parallelization import DaskParallelization, JoblibParallelization, StarmapParallelization
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

from meshsimp_pymoo import (
    OAX,
    Front,
    LiveTriangulation,
    MeshProblem,
    NeighbourShift,
    Options,
    PinnedCorners,
    RandomSubset,
    Relocation,
    Rules,
    WeightedSum,
    memetic,
    moead,
    nsga2_v1,
    nsga2_v2,
    nsga3,
    thinning,
    weighted_ga_v1,
)
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.opening import open_model
from meshsimp_pymoo.problem import REPORTED, ThreadRunner
from meshsimp_pymoo.search.paper import paper_operators
from meshsimp_pymoo.surface.height import HeightSurface
from meshsimp_pymoo.surface.measures import ERROR, MEASURES, OBJECTIVES, OF_LINES, OF_MESH, TRIANGLES


@pytest.fixture(scope="module")
def problem():
    return MeshProblem("face:300")


def subsets(problem, n=20, seed=0):
    rng = np.random.default_rng(seed)
    return rng.random((n, problem.n_var)) < rng.random((n, 1))


def test_objectives_are_error_and_triangles_of_the_kept_and_pinned_vertices(problem):
    X = subsets(problem)
    F = problem.evaluate(X)
    table = HeightSurface(problem.model).evaluate(X | problem.pinned)
    np.testing.assert_array_equal(F, table[:, [ERROR, TRIANGLES]])
    np.testing.assert_array_equal(problem.evaluate(X[0]), F[0])


def test_the_other_quality_numbers_come_along(problem):
    out = problem.evaluate(subsets(problem, 3), return_as_dictionary=True)
    for i, kept in enumerate(subsets(problem, 3)):
        quality = problem.quality(kept)
        for key in ("vertices", "mean_error", "rms_error", "max_error", "uncovered"):
            assert out[key][i] == pytest.approx(getattr(quality, key))


@pytest.mark.parametrize("arguments", [{}, {"max_triangles": 30, "max_objective": 2.0}, {"regions": 5}, {"memo": 0}])
def test_one_chromosome_gets_what_it_gets_among_many_to_the_type(arguments):
    problem = MeshProblem("peaks:6", **arguments)
    X = np.vstack([subsets(problem, 4), np.zeros(36, bool)])
    values = {"return_as_dictionary": True, "return_values_of": ["F", "G", "H"]}
    together = problem.evaluate(X, **values)
    for i, kept in enumerate(X):
        alone = problem.evaluate(kept, **values)
        assert alone.keys() == together.keys()
        for name, column in together.items():
            np.testing.assert_array_equal(alone[name], column[i])
            assert type(alone[name]) is type(column[i])
            assert alone[name].dtype == column[i].dtype


@pytest.mark.parametrize("part", ["runner", "callback", "nan", "function"])
def test_whoever_takes_part_in_evaluating_is_asked_for_one_chromosome_too(part):
    asked = []

    class Runner(ThreadRunner):
        def __call__(self, f, X):
            asked.append(len(X))
            return super().__call__(f, X)

    class Function(ElementwiseEvaluationFunction):
        def __init__(self, *args):
            asked.append(1)
            super().__init__(*args)

    options = {
        "runner": {"elementwise_runner": Runner(1)},
        "callback": {"callback": lambda X, out: asked.append(len(X))},
        "nan": {"replace_nan_values_by": 7.0},
        "function": {"elementwise_func": Function},
    }
    problem = MeshProblem("peaks:6", **options[part])
    if part == "nan":
        problem.outcome = lambda row: {"F": [np.nan, 1.0]}
    out = problem.evaluate(problem.pinned, return_as_dictionary=True, return_values_of=["F"])
    assert out["F"].tolist() == [7.0, 1.0] if part == "nan" else asked == [1]
    with pytest.raises(AssertionError, match="Input dimension 5"):
        problem.evaluate(np.ones(5, bool), return_as_dictionary=True, return_values_of=["F"])


def test_a_known_chromosome_is_not_triangulated_again(monkeypatch):
    problem = MeshProblem("roof:9")
    seen = []
    kernel = problem._kernel
    monkeypatch.setattr(problem, "_kernel", lambda X, n: seen.append(len(X)) or kernel(X, n))
    X = subsets(problem, 10)
    first = problem.evaluate(np.vstack([X, X[:3]]))
    again = problem.evaluate(X[::-1])
    assert seen == [10]
    np.testing.assert_array_equal(first[:10], again[::-1])
    np.testing.assert_array_equal(first[10:], first[:3])


def test_the_memo_is_bounded_and_forgets_the_oldest():
    problem = MeshProblem("roof:9", memo=5)
    X = subsets(problem, 12)
    F = problem.evaluate(X)
    assert len(problem._memo) == 5
    np.testing.assert_array_equal(problem.evaluate(X), F)
    np.testing.assert_array_equal(MeshProblem("roof:9", memo=0).evaluate(X), F)


@pytest.mark.parametrize("values", [np.full(300, 0.5), np.arange(300), np.ones(300, object)], ids=lambda X: X.dtype)
def test_genomes_that_are_not_bool_are_refused_with_the_operators_to_pass(problem, values):
    with pytest.raises(TypeError, match=r"RandomSubset.*PinnedCorners"):
        problem.evaluate(np.array([values, values]))
    with pytest.raises(TypeError, match="NeighbourShift"):
        problem.mesh(values)


ASKS_FOR_BOOL = {
    "evaluate": lambda problem, X: problem.evaluate(X),
    "evaluate_subsets": lambda problem, X: problem.evaluate_subsets(X),
    "simplify": lambda problem, X: problem.simplify(X[0]),
    "weighted": lambda problem, X: WeightedSum(problem, 0.5).evaluate(X),
    "Front": lambda problem, X: Front.from_subsets(problem, X),
    "surface": lambda problem, X: problem.surface.evaluate(X),
    "surface.simplify": lambda problem, X: problem.surface.simplify(X[0]),
    "live": lambda problem, X: LiveTriangulation(problem.surface, X[0]),
    "thinning": lambda problem, X: thinning(problem.surface, X[0]),
    "repair": lambda problem, X: PinnedCorners().do(problem, Population.new("X", X)),
    "mutation": lambda problem, X: NeighbourShift().do(problem, Population.new("X", X)),
    "crossover": lambda problem, X: OAX().do(problem, Population.new("X", X)[None]),
}


@pytest.mark.parametrize("dtype", [float, np.uint8, np.int64])
@pytest.mark.parametrize("name", ASKS_FOR_BOOL)
def test_0_and_1_as_numbers_are_refused_with_what_makes_them_bool(problem, name, dtype):
    with pytest.raises(TypeError, match=rf"not {np.dtype(dtype)}; these are 0 and 1: give X\.astype\(bool\)$"):
        ASKS_FOR_BOOL[name](problem, subsets(problem, 2).astype(dtype))


SINGLE = [GA, BGA, NicheGA]


@pytest.mark.parametrize("algorithm", SINGLE)
@pytest.mark.parametrize("own", [True, False])
def test_algorithms_of_one_objective_are_refused_before_pymoo_stumbles_whatever_the_operators(algorithm, own):
    problem = MeshProblem("roof:5")
    binary = {"sampling": BinaryRandomSampling(), "crossover": UX(), "mutation": BitflipMutation()}
    chosen = algorithm(pop_size=8, **(paper_operators() | {"crossover": OAX()} if own else binary))
    line = (
        rf"^{algorithm.__name__} minimises one number, .* 2 objectives.*WeightedSum\(problem, w\).*weighted_ga_v1\(w\)"
    )
    with pytest.raises(TypeError, match=line):
        minimize(problem, chosen, ("n_gen", 2), seed=1)
    found = minimize(WeightedSum(problem, 0.5), chosen, ("n_gen", 2), seed=1)
    assert found.opt.get("F").shape[1] == 1


def test_algorithms_that_keep_fronts_are_not_taken_for_ones_of_one_objective():
    problem = MeshProblem("roof:5")
    found = minimize(problem, RandomSearch(20, sampling=RandomSubset()), ("n_gen", 2), seed=1)
    assert found.F.shape[1] == 2
    assert minimize(problem, weighted_ga_v1(0.5, 8), ("n_gen", 2), seed=1).F.shape == (1, 2)


def test_pymoo_s_default_operators_are_refused_at_the_first_generation(problem):
    with pytest.raises(TypeError, match="pymoo's defaults make real numbers"):
        minimize(problem, NSGA2(pop_size=8), ("n_gen", 1), seed=1)


def test_a_subset_without_a_triangle_gets_the_worst_objectives():
    elevation = np.zeros((9, 9))
    elevation[2:7, 2:7] = np.nan  # both triangles of the corners have their centroid in this hole
    ring = MeshProblem(grid_source(elevation, 1.0, 1.0), up="z")
    F = ring.evaluate(np.zeros(ring.n_var, bool))
    np.testing.assert_array_equal(F, ring.worst)
    everything = ring.evaluate(np.ones(ring.n_var, bool))
    assert (everything < F).all()
    with pytest.raises(ValueError, match="span no triangle"):
        ring.mesh(np.zeros(ring.n_var, bool))


def test_constraints_bound_triangles_and_error():
    problem = MeshProblem("face:300", max_triangles=120, max_objective=40.0)
    out = problem.evaluate(subsets(problem), return_as_dictionary=True)
    np.testing.assert_allclose(out["G"][:, 0], out["F"][:, 1] - 120)
    np.testing.assert_allclose(out["G"][:, 1], out["F"][:, 0] - 40.0)
    result = minimize(MeshProblem("face:300", max_triangles=120), nsga2_v1(pop_size=20), ("n_gen", 12), seed=1)
    assert (result.F[:, 1] <= 120).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"max_triangles": 0}, "leaves no mesh"),
        ({"max_objective": -1.0}, "is no error"),
        ({"max_objective": float("nan")}, "is no error"),
        ({"footprint": "box"}, "footprint is 'box': expected one of model, hull"),
        ({"outside": "zero"}, "outside is 'zero': expected one of nearest, ignore"),
        ({"n_threads": 0}, "no number of threads"),
    ],
)
def test_impossible_arguments_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        MeshProblem("roof:3", **arguments)


def test_a_misspelt_argument_is_refused_with_the_nearest_name():
    with pytest.raises(TypeError, match=r"no argument 'footprnt' \(did you mean 'footprint'\?\)"):
        MeshProblem("roof:3", footprnt="hull")


def test_options_and_rules_come_whole_or_by_name_and_those_by_name_win(tmp_path):
    np.save(tmp_path / "grid.npy", np.random.default_rng(2).random((5, 6)))
    options, rules = Options(spacing=(10, 20)), Rules(footprint="hull", outside="ignore", pin="hull")
    whole = MeshProblem(tmp_path / "grid.npy", options=options, rules=rules)
    by_name = {"spacing": (10, 20), "footprint": "hull", "outside": "ignore", "pin": "hull"}
    for arguments in (
        by_name,
        {"options": Options(spacing=(1, 1)), "rules": Rules(outside="ignore")} | by_name,
        {"options": options, "rules": Rules(footprint="hull", pin="hull"), "outside": "ignore"},
    ):
        problem = MeshProblem(tmp_path / "grid.npy", **arguments)
        assert (problem.options, problem.surface.rules) == (options, rules)
        assert problem.model.hash == whole.model.hash
        np.testing.assert_array_equal(problem.pinned, whole.pinned)
        np.testing.assert_array_equal(problem.evaluate(subsets(whole, 5)), whole.evaluate(subsets(whole, 5)))


def test_the_measure_of_the_rules_is_the_first_objective():
    problem = MeshProblem("roof:5", rules=Rules(measure="max_error"))
    assert problem.objectives == ("max_error", "triangles")
    problem = MeshProblem("roof:5", rules=Rules(measure="max_error"), objectives=("rms_error", "triangles"))
    assert problem.surface.rules == Rules(measure="rms_error").of_heights


def test_a_surface_brings_its_rules_and_takes_no_other_ones():
    surface = HeightSurface(open_model("roof:5"), Rules(footprint="hull", measure="rms_error"))
    problem = MeshProblem(surface)
    assert problem.surface is surface
    assert problem.model is surface.model
    assert problem.objectives == ("rms_error", "triangles")
    others = ({"footprint": "model"}, {"rules": Rules()}, {"spacing": 2.0}, {"options": Options(up="z")})
    for arguments in (*others, {"up": np.array([0, 0, 1])}):
        with pytest.raises(TypeError, match="a HeightSurface is a model that was read, with its rules; make an"):
            MeshProblem(surface, **arguments)
    with pytest.raises(ValueError, match=r"the surface's rules measure 'rms_error'; .* Rules\(measure='error'\)"):
        MeshProblem(surface, objectives=("error", "triangles"))


# ------------------------------------------------------------------------------- other objectives, and weights


@pytest.mark.parametrize(
    "objectives",
    [
        ("rms_error", "triangles"),
        ("max_error", "triangles"),
        ("error", "max_error", "triangles"),
        ["error", "triangles"],
    ],
)
def test_the_objectives_are_the_named_numbers_of_the_same_evaluation(problem, objectives):
    other = MeshProblem("face:300", objectives=objectives)
    assert other.n_obj == len(objectives)
    out = other.evaluate(subsets(problem, 5), return_as_dictionary=True)
    for kept, F in zip(subsets(problem, 5), out["F"], strict=True):
        np.testing.assert_array_equal(F, [getattr(problem.quality(kept), name) for name in objectives])
    np.testing.assert_array_equal(out["error"], problem.evaluate(subsets(problem, 5))[:, 0])
    assert (other.evaluate(subsets(problem, 5)) < other.worst).all()


def test_a_number_that_the_worst_mesh_is_not_given_is_none(problem, monkeypatch):
    assert np.isfinite(problem._worst_row()).all()
    monkeypatch.setattr("meshsimp_pymoo.problem.REGIONS", 5000)  # so many that memory held something there before
    row = problem._worst_row()
    assert np.isfinite(row[:6]).all()
    assert np.isnan(row[6:]).all()


def test_the_documentation_names_every_objective_and_every_number_beside_them():
    assert all(f'"{name}"' in MeshProblem.__doc__ for name in OBJECTIVES)
    assert ", ".join(f"``{name}``" for name in REPORTED) in MeshProblem.__doc__
    assert {*REPORTED, "triangles"} == {*MEASURES} - {*OF_MESH, *OF_LINES}
    assert not {"SETTINGS", "OBJECTIVES", "REPORTED"} & set(MeshProblem.__doc__.split())


def test_a_bound_on_the_error_is_one_on_the_first_objective():
    problem = MeshProblem("face:300", objectives=("rms_error", "triangles"), max_objective=2.0, max_triangles=90)
    F, G = problem.evaluate(subsets(problem))
    np.testing.assert_allclose(G, F[:, ::-1] - [90, 2.0])


@pytest.mark.parametrize(
    "objectives", ["error", (), ("error",), ("triangles",), ("triangles", "error"), ("l1", "triangles"), ("error",) * 2]
)
def test_objectives_that_make_no_problem_are_refused(objectives):
    with pytest.raises(ValueError, match="'triangles' last"):
        MeshProblem("roof:3", objectives=objectives)


def test_nsga3_spreads_over_three_objectives():
    problem = MeshProblem("face:300", objectives=("error", "max_error", "triangles"))
    result = minimize(problem, nsga3(n_partitions=6), ("n_gen", 15), seed=1)
    assert result.X.dtype == bool
    assert len(NonDominatedSorting().do(result.F, only_non_dominated_front=True)) == len(result.F)
    for kept, F in zip(result.X, result.F, strict=True):
        q = problem.quality(kept)
        assert F.tolist() == [q.error, q.max_error, q.triangles]
    # The population holds solutions that the sum and the triangles alone would not have kept.
    F = result.pop.get("F")
    fronts = [NonDominatedSorting().do(F[:, columns], only_non_dominated_front=True) for columns in ([0, 2], [0, 1, 2])]
    assert len(fronts[0]) < len(fronts[1])
    again = minimize(problem, nsga3(n_partitions=6), ("n_gen", 15), seed=1)
    assert again.X.tobytes() == result.X.tobytes()


def test_algorithms_of_two_objectives_refuse_a_third_and_name_the_way_out():
    problem = MeshProblem("roof:9", objectives=("error", "max_error", "triangles"))
    for algorithm in (memetic(8), moead(8)):
        with pytest.raises(ValueError, match=r"nsga3\(\)"):
            minimize(problem, algorithm, ("n_gen", 2), seed=1)


def test_the_memetic_search_lowers_the_measure_of_the_problem():
    problem = MeshProblem("face:300", objectives=("rms_error", "triangles"))
    seeds = minimize(problem, memetic(12, moves_per_vertex=50), ("n_gen", 1), seed=1)
    found = minimize(problem, memetic(12, moves_per_vertex=50), ("n_gen", 4), seed=1)
    ladder = seeds.pop.get("F")
    best = np.array([found.F[found.F[:, 1] <= size, 0].min() for size in ladder[:, 1]])
    assert (best <= ladder[:, 0]).all()
    assert best.sum() < 0.97 * ladder[:, 0].sum()
    assert problem.quality(found.X[0]).rms_error == found.F[0, 0]


@pytest.mark.parametrize("measure", ["rms_error", "max_error"])
def test_relocation_lowers_the_measure_of_the_problem(measure):
    problems = [MeshProblem("face:300", objectives=(objective, "triangles")) for objective in ("error", measure)]
    X = subsets(problems[0], 12) | problems[0].pinned
    by_sum, by_measure = (
        problems[1].evaluate(Relocation(100)._do(problem, X, random_state=np.random.default_rng(0)))[:, 0]
        for problem in problems
    )
    assert by_measure.sum() < 0.99 * by_sum.sum()


def test_weights_come_as_an_array_in_the_file_s_order_or_by_name():
    source = load("face:300")
    importance = np.random.default_rng(1).random(300)
    with_attribute = SourceMesh(source.points, source.faces, {"importance": importance}, "face")
    named = MeshProblem(with_attribute, weights="importance")
    given = MeshProblem(source, weights=importance)
    X = subsets(given, 5)
    np.testing.assert_array_equal(named.evaluate(X), given.evaluate(X))
    deviation = given.simplify(X[0]).deviation
    assert given.evaluate(X)[0, 0] == pytest.approx((importance[given.model.source_index] * deviation).sum())
    # A model that has weights keeps them; pickling does too.
    np.testing.assert_array_equal(MeshProblem(given.model).evaluate(X), given.evaluate(X))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(given)).evaluate(X), given.evaluate(X))
    np.testing.assert_array_equal(MeshProblem(source).evaluate(X)[:, 1], given.evaluate(X)[:, 1])
    assert (MeshProblem(source).evaluate(X)[:, 0] > given.evaluate(X)[:, 0]).all()


# --------------------------------------------------------------------------------------------------- pinning


def test_pinned_vertices_by_name_row_and_position():
    source = load("face:300")
    base = MeshProblem(source)
    assert base.pinned.sum() == len(base.model.corners)
    by_row = MeshProblem(source, pin=[7, 100])
    assert set(np.flatnonzero(by_row.pinned & ~base.pinned)) <= {
        int(np.flatnonzero(base.model.source_index == row)[0]) for row in (7, 100)
    }
    by_position = MeshProblem(source, pin=source.points[[7, 100]])
    np.testing.assert_array_equal(by_position.pinned, by_row.pinned)
    flat = MeshProblem(source, pin=source.points[[7, 100], :2], up="z")
    np.testing.assert_array_equal(flat.pinned, by_row.pinned)
    mixed = MeshProblem(source, pin=["hull", 7, list(source.points[100])])
    np.testing.assert_array_equal(
        np.flatnonzero(mixed.pinned & ~by_row.pinned), np.setdiff1d(base.model.hull, np.flatnonzero(by_row.pinned))
    )
    assert 7 in mixed.model.source_index[mixed.pinned]
    # Pinned vertices are in every mesh.
    mesh = by_row.mesh(np.zeros(by_row.n_var, bool))
    for row in (7, 100):
        assert (mesh.vertices == source.points[row]).all(axis=1).any()


def test_the_pinned_border_is_the_outline_and_the_rims_of_holes():
    height = np.zeros((7, 8))
    height[3, 4] = np.nan
    problem = MeshProblem(grid_source(height, 1.0, 1.0), pin="border")
    place = problem.surface.points[:, :2]
    rim = (place == 0).any(axis=1) | (place == (7, 6)).any(axis=1)
    hole = np.abs(place - (4, 3)).sum(axis=1) == 1
    assert rim.sum() == 26
    assert hole.sum() == 4
    np.testing.assert_array_equal(problem.pinned, rim | hole)
    # Every mesh has the whole border, so that tiles fit together again.
    fewest = problem.mesh(np.zeros(problem.n_var, bool))
    assert len(fewest.vertices) == 30


@pytest.mark.parametrize(
    ("pin", "message"),
    [
        ("edge", "'edge' is unknown"),
        ([400], "row 400"),
        ([-1], "row -1"),
        ([2.5], "no row of the file"),
        ([[1e6, 0.0, 0.0]], "away, more than 1%"),
        ([[1.0, 2.0, 3.0, 4.0]], "shape"),
    ],
)
def test_pins_that_are_not_there_are_refused(pin, message):
    with pytest.raises(ModelError, match=message):
        MeshProblem("face:300", pin=pin)


# -------------------------------------------------------------------------------------------------- the mesh


def test_the_mesh_has_original_vertices_only_in_the_file_s_frame_and_its_attributes():
    source = load("face:300")
    turn = trimesh.geometry.align_vectors([0, 0, 1], [1, 2, 2])[:3, :3]
    points = source.points @ turn.T + [5e5, 4e6, 100]
    color = np.random.default_rng(0).integers(0, 255, (300, 4)).astype(np.uint8)
    problem = MeshProblem(
        SourceMesh(points, source.faces, {"color": color, "label": np.arange(300)}, "tilted"), up=(1, 2, 2)
    )
    kept = subsets(problem, 1)[0]
    mesh = problem.mesh(kept)
    rows = mesh.vertex_attributes["label"]
    np.testing.assert_array_equal(mesh.vertices, points[rows])
    np.testing.assert_array_equal(mesh.visual.vertex_colors, color[rows])
    assert len(mesh.faces) == problem.quality(kept).triangles
    assert (mesh.face_normals @ np.array([1, 2, 2]) > 0).all()
    assert np.unique(mesh.faces).size == len(mesh.vertices)
    assert np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1].max() == 2


def test_a_trimesh_and_a_model_serve_as_input():
    source = load("face:300")
    mesh = trimesh.Trimesh(source.points, source.faces, process=False)
    one, two = MeshProblem(source), MeshProblem(mesh)
    three = MeshProblem(one.model)
    X = subsets(one, 4)
    np.testing.assert_array_equal(one.evaluate(X), two.evaluate(X))
    np.testing.assert_array_equal(one.evaluate(X), three.evaluate(X))


# ------------------------------------------------------------------------------------- pymoo's machinery


@pytest.mark.parametrize("n_threads", [1, 2, 3])
def test_results_do_not_depend_on_the_number_of_threads(n_threads):
    run = minimize(MeshProblem("face:300", n_threads=n_threads), nsga2_v2(pop_size=20), ("n_gen", 6), seed=3)
    base = minimize(MeshProblem("face:300"), nsga2_v2(pop_size=20), ("n_gen", 6), seed=3)
    assert run.X.tobytes() == base.X.tobytes()
    assert run.F.tobytes() == base.F.tobytes()


def test_pymoo_s_runners_give_the_same_result():
    base = minimize(MeshProblem("roof:5"), nsga2_v1(pop_size=12), ("n_gen", 4), seed=1)
    with ThreadPool(2) as pool:
        starmap = MeshProblem("roof:5", elementwise_runner=StarmapParallelization(pool.starmap))
        result = minimize(starmap, nsga2_v1(pop_size=12), ("n_gen", 4), seed=1)
    np.testing.assert_array_equal(result.F, base.F)


def test_joblib_s_processes_give_the_same_result():
    pytest.importorskip("joblib", reason="pymoo's JoblibParallelization needs joblib, which is not installed")
    base = minimize(MeshProblem("roof:5"), nsga2_v1(pop_size=12), ("n_gen", 3), seed=1)
    runner = JoblibParallelization(n_jobs=2)
    result = minimize(MeshProblem("roof:5", elementwise_runner=runner), nsga2_v1(pop_size=12), ("n_gen", 3), seed=1)
    np.testing.assert_array_equal(result.F, base.F)


@pytest.mark.filterwarnings("ignore")  # of distributed's own making, while its cluster comes and goes
def test_dask_s_workers_give_the_same_result():
    distributed = pytest.importorskip(
        "distributed", reason="pymoo's DaskParallelization needs dask[distributed], not installed"
    )
    base = minimize(MeshProblem("roof:5"), nsga2_v1(pop_size=12), ("n_gen", 3), seed=1)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=False, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        problem = MeshProblem("roof:5", elementwise_runner=DaskParallelization(client))
        result = minimize(problem, nsga2_v1(pop_size=12), ("n_gen", 3), seed=1)
    np.testing.assert_array_equal(result.F, base.F)


def test_problems_pickle_without_memory_of_the_run_and_copies_are_shared():
    problem = MeshProblem("face:300", max_triangles=200, pin=[5])
    empty = len(pickle.dumps(problem))
    F, G = problem.evaluate(subsets(problem, 50))
    assert len(pickle.dumps(problem)) == empty
    again = pickle.loads(pickle.dumps(problem))
    np.testing.assert_array_equal(again.evaluate(subsets(problem, 50))[0], F)
    np.testing.assert_array_equal(again.evaluate(subsets(problem, 50))[1], G)
    assert copy.deepcopy(problem) is problem
    assert copy.deepcopy(problem.surface) is problem.surface
    runner = pickle.loads(pickle.dumps(ThreadRunner(2)))
    assert runner.n_threads == 2


def test_history_and_ask_and_tell_work():
    result = minimize(MeshProblem("roof:5"), nsga2_v1(pop_size=10), ("n_gen", 3), seed=1, save_history=True)
    assert len(result.history) == 3
    algorithm = nsga2_v1(pop_size=10)
    algorithm.setup(MeshProblem("roof:5"), termination=("n_gen", 3), seed=1)
    while algorithm.has_next():
        offspring = algorithm.ask()
        algorithm.evaluator.eval(algorithm.problem, offspring)
        algorithm.tell(infills=offspring)
    np.testing.assert_array_equal(algorithm.result().F, result.F)


def test_the_five_lines_of_the_readme():
    problem = MeshProblem("roof:9")
    result = minimize(
        problem,
        NSGA2(
            pop_size=30,
            sampling=RandomSubset(),
            crossover=OAX(prob=0.8),
            mutation=NeighbourShift(),
            repair=PinnedCorners(),
        ),
        ("n_gen", 10),
        seed=1,
    )
    assert result.X.dtype == bool
    assert (result.X[:, problem.pinned]).all()
    assert problem.mesh(result.X[0]).faces.shape[1] == 3
    assert result.opt.get("max_error").shape == (len(result.F),)


# ------------------------------------------------------------------------------- the true front, by enumeration


def bumpy(side, seed):
    """A small grid of random heights: all subsets can be listed."""
    return grid_source(np.random.default_rng(seed).integers(0, 100, (side, side)).astype(float), 1.0, 1.0)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nsga2_finds_the_true_front_that_enumeration_gives(seed):
    """12 free vertices, 4096 subsets; 4000 evaluations of NSGA-II with mutation find all of the front."""
    problem = MeshProblem(bumpy(4, seed), up="z")
    free = np.flatnonzero(~problem.pinned)
    assert len(free) == 12
    X = np.tile(problem.pinned, (2 ** len(free), 1))
    X[:, free] = list(itertools.product([False, True], repeat=len(free)))
    F = problem.evaluate(X)
    least = {t: F[F[:, 1] == t, 0].min() for t in np.unique(F[:, 1])}
    true = {(e, t) for t, e in least.items() if all(e < least[u] for u in least if u < t)}
    result = minimize(
        MeshProblem(bumpy(4, seed), up="z"),
        NSGA2(
            pop_size=100,
            sampling=RandomSubset(),
            crossover=OAX(prob=0.8),
            mutation=BitflipMutation(prob_var=1 / 16),
            repair=PinnedCorners(),
        ),
        ("n_gen", 60),
        seed=seed,
    )
    found = {(e, t) for e, t in np.unique(result.F, axis=0)}
    assert found == true
    hv = HV(ref_point=F.max(axis=0) * 1.1)
    assert hv(result.F) == pytest.approx(hv(np.array(sorted(true))))
