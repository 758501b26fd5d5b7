"""A front is a sequence of solutions that can be asked, written, read back and looked at."""

from __future__ import annotations

import builtins
import contextlib
import copy
import csv
import dataclasses
import inspect
import itertools
import json
import pickle
import pydoc
import re
import shutil
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.population import Population
from pymoo.optimize import minimize
from pymoo.problems import get_problem
from samples import freed

from meshsimp_pymoo import (
    Front,
    FrontOutput,
    FrontSolution,
    HalfPlaneCrossover,
    MeshProblem,
    Missed,
    NeighbourShift,
    NestedSubsets,
    Options,
    PinnedCorners,
    ResultError,
    Rules,
    greedy_insertion,
    memetic,
    moead,
    nsga2_v1,
    thinning,
    weighted_ga_v1,
)
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelWarning
from meshsimp_pymoo.formats.geotiff import write_raster
from meshsimp_pymoo.formats.table import write_mesh, written_suffixes
from meshsimp_pymoo.front import LIMITS, starting_front
from meshsimp_pymoo.indicators import hypervolume_ratio, knee
from meshsimp_pymoo.plane.faces import used_rows
from meshsimp_pymoo.report.figures import plot_mesh
from meshsimp_pymoo.search.display import errors_at, usual_sizes
from meshsimp_pymoo.settings import LARGEST
from meshsimp_pymoo.storage import FRONT_COLUMNS, read_front
from meshsimp_pymoo.surface.measures import MEASURES, OBJECTIVES, OF_LINES
from meshsimp_pymoo.surface.surface import FreeMesh


@pytest.fixture(scope="module")
def result():
    return minimize(MeshProblem("face:200"), nsga2_v1(pop_size=16), ("n_gen", 6), seed=1)


@pytest.fixture(scope="module")
def front(result):
    return Front.from_result(result)


@pytest.fixture(scope="module")
def stored(front, tmp_path_factory):
    return front.save(tmp_path_factory.mktemp("stored") / "out", meshes=5, chosen=front.knee())


@pytest.fixture
def roof_file(tmp_path):
    roof = load("roof:5")
    write_mesh(tmp_path / "roof.ply", roof.points, roof.faces)
    return tmp_path / "roof.ply"


def whole_front_of(problem):
    """Return the front of all subsets of a tiny model, by trying them all."""
    return Front.from_subsets(problem, np.array(list(itertools.product([False, True], repeat=problem.n_var))))


# -------------------------------------------------------------------------------------------------- where it comes from


def test_the_front_of_all_subsets_of_a_roof_is_known():
    front = whole_front_of(MeshProblem("roof:3"))
    assert front.F.tolist() == [[3.0, 2.0], [1.5, 3.0], [0.0, 4.0]]
    assert front.kept.sum(axis=1).tolist() == [4, 5, 6]


def test_of_a_result_no_solution_beats_another_and_none_is_lost(result, front):
    for (e0, t0), (e1, t1) in itertools.pairwise(front.F):
        assert t0 < t1
        assert e0 > e1
    for error, triangles in result.F:
        assert ((front.F[:, 0] <= error) & (front.F[:, 1] <= triangles)).any()


def test_both_ends_are_added_unless_they_are_not_wanted(result, front):
    problem = result.problem
    assert np.array_equal(front[0].kept, problem.pinned)
    assert front[-1].error == problem.quality(np.ones(problem.n_var, bool)).error
    without = Front.from_result(result, ends=False)
    assert {tuple(row) for row in without.F} <= {tuple(row) for row in result.F}


@pytest.mark.parametrize("algorithm", [moead(pop_size=12), weighted_ga_v1(0.5, pop_size=12)])
def test_any_algorithm_gives_a_front(algorithm):
    problem = MeshProblem("roof:5")
    front = Front.from_result(minimize(problem, algorithm, ("n_gen", 3), seed=1))
    assert [row.tolist() for row in front.F] == sorted(front.F.tolist(), key=lambda row: row[1])
    for solution in front:
        assert solution.quality == problem.quality(solution.kept)


def test_constraints_hold_for_the_ends_too():
    problem = MeshProblem("roof:5", max_triangles=20, max_objective=4.0)
    result = minimize(problem, nsga2_v1(pop_size=20), ("n_gen", 15), seed=1)
    front = Front.from_result(result)
    assert front.F[:, 1].max() <= 20
    assert front.F[:, 0].max() <= 4.0


def test_a_search_that_found_nothing_says_so():
    result = minimize(
        MeshProblem("roof:9", max_objective=0.0, max_triangles=2), nsga2_v1(pop_size=8), ("n_gen", 2), seed=1
    )
    with pytest.raises(LookupError, match="roof:9: the search found no solution that meets its constraints; sea"):
        Front.from_result(result)
    with pytest.raises(LookupError, match="roof:9: none of 1 subsets of its vertices is a mesh that meets"):
        Front.from_subsets(result.problem, np.ones(81, dtype=bool))


def test_a_result_of_another_problem_is_refused():
    result = minimize(get_problem("zdt1", n_var=3), NSGA2(pop_size=8), ("n_gen", 1), seed=1)
    with pytest.raises(TypeError, match="the result is of a ZDT1; a Front holds solutions of a MeshProblem"):
        Front.from_result(result)


def test_other_objectives_make_another_front():
    problem = MeshProblem("face:60", objectives=("max_error", "triangles"))
    rng = np.random.default_rng(1)
    front = Front.from_subsets(problem, rng.random((60, 60)) < rng.random((60, 1)), ends=True)
    assert front.objectives == ("max_error", "triangles")
    assert (np.diff(front.F[:, 0]) < 0).all()
    assert front.F[:, 0].tolist() == [solution.max_error for solution in front]
    middle = front[len(front) // 2]
    assert front.best(triangles=middle.triangles) == middle


# --------------------------------------------------------------------------------------------------------- free meshes


@pytest.fixture(scope="module")
def mixed(result):
    """The result of a search with a free mesh beside every other solution, and the front of it."""
    result = copy.copy(result)
    result.opt = copy.deepcopy(result.opt)
    for one in result.opt[::2]:
        one.set("free", freed(result.problem.surface, one.X))
    return result, Front.from_result(result)


def test_a_free_mesh_is_taken_where_it_is_better_and_what_it_beats_goes(mixed, front):
    result, found = mixed
    np.testing.assert_array_equal(result.F, result.problem.evaluate(result.X))  # as it is without
    assert 2 <= found.n_free < len(found)
    free = {mesh.quality: mesh for mesh in result.opt.get("free") if mesh is not None}
    delaunay = {row.tobytes() for row in front.kept}
    for (e0, t0), (e1, t1) in itertools.pairwise(found.F):
        assert t0 < t1
        assert e0 > e1
    for solution in found:
        if solution.free:
            mesh = free[solution.quality]
            np.testing.assert_array_equal(solution.kept, mesh.kept)
            np.testing.assert_array_equal(solution.faces, mesh.faces)
        else:
            assert solution.kept.tobytes() in delaunay
    best = [(q.error, q.triangles) for q in [*free, *front.quality]]
    for error, triangles in best:  # nothing is lost
        assert ((found.F[:, 0] <= error) & (found.F[:, 1] <= triangles)).any()


def test_a_free_mesh_that_is_no_better_than_its_subset_is_left(result):
    problem, surface = result.problem, result.problem.surface
    one = copy.deepcopy(result.opt[[len(result.opt) // 2]])
    mesh, (own,) = freed(surface, one[0].X), Front.from_population(problem, one)
    for free in (
        FreeMesh(own.kept, own.faces, own.quality),  # the very same
        dataclasses.replace(mesh, quality=dataclasses.replace(mesh.quality, triangles=own.triangles + 1)),
        freed(surface, one[0].X, better=False),
    ):
        one[0].set("free", free)
        assert Front.from_population(problem, one).faces == (None,)
    one[0].set("free", mesh)
    assert Front.from_population(problem, one).F.tolist() == [[mesh.quality.error, own.triangles]]
    assert Front.from_subsets(problem, one.get("X")).quality == (own.quality,)  # Delaunay
    one[0].set("free", mesh.faces)
    with pytest.raises(TypeError, match=r"individual 0 has a ndarray as free; set a FreeMesh\(kept, faces, quality\)"):
        Front.from_population(problem, one)
    one[0].set("free", None)
    alone = SimpleNamespace(X=one[0].X, problem=problem)  # who has no more than that
    assert Front.from_result(alone, ends=False).quality == (own.quality,)


def test_of_three_objectives_the_first_decides_what_is_taken_and_all_decide_what_stays():
    problem = MeshProblem("face:200", objectives=("error", "max_error", "triangles"))
    one = Population.new(X=problem.pinned[None] | (np.arange(200) % 4 == 0))
    (own,) = Front.from_population(problem, one)
    mesh = freed(problem.surface, one[0].X)
    for error, largest, kinds in (
        (0.9, 0.9, [True]),
        (0.9, 1.1, [True, False]),
        (1.1, 0.9, [False]),
        (1, 0.9, [False]),
    ):
        said = dataclasses.replace(mesh.quality, error=error * own.error, max_error=largest * own.max_error)
        one[0].set("free", dataclasses.replace(mesh, quality=said))
        assert sorted((s.free for s in Front.from_population(problem, one)), reverse=True) == kinds


def test_limits_hold_for_the_numbers_of_the_free_mesh(result):
    """A wish and a constraint that the Delaunay mesh misses and the free one meets, and the other way round."""
    one = copy.deepcopy(result.opt[[len(result.opt) // 2]])
    mesh = freed(result.problem.surface, one[0].X)
    one[0].set("free", mesh)
    (own,) = Front.from_subsets(result.problem, one.get("X"))
    assert mesh.quality.error < own.error
    for measure in OBJECTIVES:
        low = dataclasses.replace(mesh.quality, **{measure: 0.9 * getattr(own, measure)})
        one[0].set("free", dataclasses.replace(mesh, quality=low))
        for bound, n_free in ((0.95, 1), (0.85, 0)):
            objectives = (measure, "triangles")
            bounded = MeshProblem("face:200", objectives=objectives, max_objective=bound * getattr(own, measure))
            with pytest.raises(LookupError, match="meets the constraints"):
                Front.from_subsets(bounded, one.get("X"))
            if n_free:
                assert Front.from_population(bounded, one).n_free == 1
                continue
            with pytest.raises(LookupError, match="meets the constraints"):
                Front.from_population(bounded, one)
    high = dataclasses.replace(mesh, quality=dataclasses.replace(mesh.quality, max_error=2 * own.max_error))
    one[0].set("free", high)
    wish = {"triangles": own.triangles, "max_error": own.max_error}
    assert [s.free for s in Front.from_population(result.problem, one)] == [True]
    assert [s.free for s in Front.from_population(result.problem, one, wish=wish)] == [False]


def test_a_free_solution_is_its_own_mesh_in_all_that_is_asked_of_it(mixed, tmp_path):
    _, front = mixed
    surface = front.surface
    row = next(k for k in range(len(front)) if front[k].free)
    solution, own = front[row], front.faces[row]
    delaunay = surface.simplify(solution.kept)
    assert own.tolist() != delaunay.faces.tolist()
    assert solution.simplified.faces.tolist() == solution.faces.tolist() == own.tolist()
    assert dataclasses.asdict(solution.simplified.quality) == pytest.approx(
        dataclasses.asdict(solution.quality), nan_ok=True
    )
    refitted = solution.refitted
    assert refitted.faces.tolist() == own.tolist()
    assert refitted.error < refitted.before == pytest.approx(solution.error)
    used, compact = used_rows(own)
    for mesh in (solution.mesh, trimesh.load(solution.save(tmp_path / "a.ply"), process=False)):
        assert mesh.faces.tolist() == compact.tolist()
        np.testing.assert_array_equal(mesh.vertices, front.model.file_points[used])
    assert len(solution.plot(Figure().subplots()).collections[0].get_paths()) == len(own)
    again = surface.score(solution.mesh.vertices, solution.mesh.faces).quality
    assert again.error == pytest.approx(solution.error, rel=1e-9)
    assert repr(front).startswith(
        f"<front of face:200: {len(front)} solutions, {front.n_free} of {len(front)} free, 2 "
    )
    assert repr(solution).startswith(f"<solution {row} of {len(front)}, free: {solution.triangles} triangles, ")
    assert front.to_frame()["free"].tolist() == [int(s.free) for s in front]


def test_slices_and_choices_keep_the_faces(mixed):
    _, front = mixed
    for part in (front[2:], front[::-2], front[1:4:2], pickle.loads(pickle.dumps(front))):
        for solution in part:
            whole = front.best(triangles=solution.triangles)
            assert (solution.free, solution.quality) == (whole.free, whole.quality)
            assert solution.faces.tolist() == whole.faces.tolist()
    assert front.knee().faces.tolist() == front[knee(front.F)].faces.tolist()


def test_a_free_mesh_goes_to_the_folder_and_back_to_the_same_bytes(mixed, tmp_path):
    _, front = mixed
    chosen = next(s for s in front if s.free)
    stored = front.save(tmp_path / "out", chosen=chosen, refit=True, meshes=None, pictures=False)
    again = Front.load(stored)
    assert again.quality == front.quality
    for one, other in zip(again, front, strict=True):
        np.testing.assert_array_equal(one.kept, other.kept)
        assert (one.free, one.faces.tolist()) == (other.free, other.faces.tolist())
        assert (one.faces.dtype, one.free) == (np.int32, again.faces[one.solution] is not None)
    with (stored / "front.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["free"]) for row in rows] == [int(s.free) for s in front]
    assert list(rows[0])[: len(FRONT_COLUMNS)] == list(FRONT_COLUMNS)
    for row, solution in zip(rows, front, strict=True):
        for path, mesh in ((row["mesh"], solution.mesh), (row["refitted_mesh"], None)):
            found = trimesh.load(stored / path, process=False)
            assert found.faces.tolist() == used_rows(solution.faces)[1].tolist()
            assert mesh is None or found.vertices.tolist() == mesh.vertices.tolist()
        assert float(row["refitted_error"]) <= solution.error * (1 + 1e-12)
    assert (stored / "chosen.ply").read_bytes() == (stored / rows[chosen.solution]["mesh"]).read_bytes()
    assert (stored / "chosen_refitted.ply").is_file()
    twice = again.save(tmp_path / "twice", chosen=chosen.solution, refit=True, meshes=None, pictures=False)
    for path in sorted(path for path in stored.rglob("*") if path.is_file() and path.name != "run.json"):
        assert (twice / path.relative_to(stored)).read_bytes() == path.read_bytes(), path
    part = again[: chosen.solution + 1].save(tmp_path / "part", meshes=0, pictures=False)
    assert Front.load(part)[chosen.solution].faces.tolist() == chosen.faces.tolist()


def test_faces_that_do_not_fit_are_refused(mixed):
    _, front = mixed
    row = next(k for k in range(len(front)) if front[k].free)
    one, faces = front[row : row + 1], front.faces[row]
    outside = np.flatnonzero(~one.kept[0])[0]
    for wrong, message in (
        ([], None),
        ([None], None),
        ([faces, faces], "1 solutions cannot have faces for 2; give None"),
        ([faces[:-1]], r"solution 0: its faces are \d+ triangles of \d+ vertices, and it is said to have"),
        (
            [np.where(faces == faces.max(), outside, faces)],
            f"solution 0: its faces use vertex {outside}, which it does",
        ),
        ([faces + 200], "solution 0: faces index rows 2"),
        ([faces.astype(float)], "solution 0: faces are float64"),
    ):
        with contextlib.nullcontext() if message is None else pytest.raises(ValueError, match=message):
            Front(one.quality, one.kept, faces=wrong)


# -------------------------------------------------------------------------------------------------------- as a sequence


def test_it_is_a_sequence(front):
    assert len(list(front)) == len(front) > 5
    assert front[-1] == front[len(front) - 1]
    assert front[np.int64(2)] == front[2] != front[3]
    assert front[1] in front
    assert front.index(front[3]) == 3
    assert [s.triangles for s in front] == front.F[:, 1].tolist()


def test_a_slice_is_a_front_sorted_the_same_way(front):
    assert front[1:4].F.tolist() == front.F[1:4].tolist()
    assert front[::-2].F.tolist() == front.F[::-2][::-1].tolist()
    assert front[2:][0].mesh.faces.tolist() == front[2].mesh.faces.tolist()
    with pytest.raises(IndexError, match=r"leaves nothing of a front of \d+ solutions"):
        front[100:]


def test_a_solution_that_is_not_there_is_an_error(front):
    with pytest.raises(IndexError, match=f"the front has the solutions 0 to {len(front) - 1}; there is no 99"):
        front[99]
    with pytest.raises(ValueError, match="a front has at least one solution"):
        Front([], np.empty((0, 5), dtype=bool))


def test_a_solution_has_its_numbers_and_its_mesh(front):
    solution = front[3]
    found = front.problem.surface.simplify(solution.kept)
    q = solution.quality
    assert found.quality == q
    assert (solution.error, solution.triangles, solution.vertices) == (q.error, q.triangles, q.vertices)
    assert (solution.mean_error, solution.rms_error, solution.max_error) == (q.mean_error, q.rms_error, q.max_error)
    assert solution.uncovered == q.uncovered
    assert {name: getattr(solution, name) for name in MEASURES} == dataclasses.asdict(q)
    assert isinstance(solution.mesh, trimesh.Trimesh)
    assert len(solution.mesh.faces) == solution.triangles == len(solution.faces)
    assert solution.simplified.deviation.sum() == pytest.approx(solution.error)


def test_help_and_editors_know_the_numbers_of_a_solution_and_the_limits_of_a_choice(front):
    said = pydoc.render_doc(FrontSolution, renderer=pydoc.plaintext)
    for name, measure in MEASURES.items():
        assert name in dir(front[0])
        assert isinstance(getattr(FrontSolution, name), property)
        assert measure.label in getattr(FrontSolution, name).__doc__.lower().replace("rms", "RMS")
        assert f"  {name}\n" in said
    limits = [name for name in MEASURES if name != "min_angle_median"]  # of which nobody wants little
    assert list(inspect.signature(front.best).parameters) == limits == list(LIMITS)
    assert ", ".join(name for name in limits if name != "triangles") + " : float" in Front.best.__doc__


def test_what_goes_wrong_in_a_property_is_reported_as_it_is(front):
    class Broken(FrontSolution):
        @property
        def area(self):
            return self.faces.are

    with pytest.raises(AttributeError, match=r"'numpy\.ndarray' object has no attribute 'are'"):
        _ = Broken(front, 0).area


# ------------------------------------------------------------------------------------------------------------- choosing


def test_best_of_a_size_is_the_most_accurate_that_is_small_enough(front):
    for limit in (*front.F[:, 1], 100.5, 1e9):
        fitting = [s for s in front if s.triangles <= limit]
        assert front.best(triangles=limit).error == min(s.error for s in fitting)


@pytest.mark.parametrize("name", [name for name in LIMITS if name not in ("triangles", *OF_LINES)])
def test_best_within_a_measure_is_the_smallest(front, name):
    values = np.array([getattr(s, name) for s in front])
    for limit in (np.median(values), values.min(), values.max()):
        fitting = [s for s in front if getattr(s, name) <= limit]
        assert front.best(**{name: limit}) == min(fitting, key=lambda s: s.triangles)


def test_of_several_limits_all_hold(front):
    middle = front[len(front) // 2]
    found = front.best(triangles=middle.triangles, max_error=middle.max_error, mean_error=middle.mean_error)
    assert found == middle
    limits = {"max_error": middle.max_error, "rms_error": front[-2].rms_error}
    fitting = [s for s in front if s.max_error <= limits["max_error"] and s.rms_error <= limits["rms_error"]]
    assert front.best(**limits) == fitting[0]


def test_a_limit_that_nothing_meets_says_how_near_the_front_comes(front):
    with pytest.raises(LookupError, match="no solution of face:200 has at most 1 triangles; the least is 2"):
        front.best(triangles=1)
    with pytest.raises(LookupError, match=r"no solution of face:200 has at most -1 uncovered; the least is 0"):
        front.best(uncovered=-1)
    with pytest.raises(LookupError, match=r"the least max error of a solution of face:200 is .*, and 1e-09 was asked"):
        front[:-1].best(max_error=1e-9)
    with pytest.raises(LookupError, match=r"the least RMS error of a solution of face:200 is .*, and 0 was asked for"):
        front[:-1].best(rms_error=0)
    two = r"no solution of face:200 holds all of .*: error 4165.98 at 2 triangles; with error 3 the smallest found has "
    with pytest.raises(Missed, match=two) as missed:
        front.best(triangles=2, error=3)
    assert missed.value.nearest == front[0]
    with pytest.raises(TypeError, match=r"takes limits, such as triangles=500 .*; none is given"):
        front.best()
    with pytest.raises(TypeError, match=r"best\(\) knows no limit 'size'; it takes error, triangles, vertices, "):
        front.best(size=5)
    assert front.best(triangles=50, error=None) == front.best(triangles=50)


def test_the_knee_lies_farthest_below_the_line_between_the_ends(front):
    (e, t), (x, y) = front.F[-1] - front.F[0], (front.F - front.F[0]).T
    assert front.knee().solution == np.argmax(np.abs(e * y - t * x))
    assert 0 < front.knee().solution < len(front) - 1
    assert knee([[7, 3]]) == 0
    assert knee([[3, 2], [1.5, 3], [0, 4]]) == 0  # a straight front: the first


# ----------------------------------------------------------------------------------------------------- writing, reading


def test_what_is_saved_is_read_back(front, stored):
    again = Front.load(stored)
    assert again.quality == front.quality
    assert np.array_equal(again.kept, front.kept)
    assert again.F.tolist() == read_front(stored).F.tolist()
    assert again.name == "face:200"
    assert [s.mesh.faces.tolist() for s in again] == [s.mesh.faces.tolist() for s in front]
    assert again.knee() == again[front.knee().solution]
    assert {"front.csv", "front.npz", "front.png", "run.json", "meshes", "chosen.ply"} <= {
        p.name for p in stored.iterdir()
    }
    record = json.loads((stored / "run.json").read_text())
    assert (record["seed"], record["algorithm"], record["generations"], record["evaluations"]) == (1, "NSGA2", 6, 96)
    assert record["rules"]["footprint"] == "model"


def test_a_front_that_was_read_can_be_saved_again_with_the_same_bytes(stored, tmp_path):
    Front.load(stored).save(tmp_path / "again", meshes=5, chosen=Front.load(stored).knee().solution)
    for name in ("front.csv", "front.npz", "front.png", "chosen.ply"):
        assert (tmp_path / "again" / name).read_bytes() == (stored / name).read_bytes()


def test_a_search_that_starts_from_thinning_shows_what_it_gained(tmp_path):
    problem = MeshProblem("peaks:12")
    algorithm = NSGA2(
        pop_size=20, sampling=NestedSubsets(), crossover=HalfPlaneCrossover(), mutation=NeighbourShift(),
        repair=PinnedCorners(),
    )  # fmt: skip
    front = Front.from_result(minimize(problem, algorithm, ("n_gen", 3), seed=1))
    ((name, start),) = front.series.items()
    assert name == "adaptive thinning (start)"
    thinned = thinning(problem.surface).F
    assert {tuple(row) for row in start} <= {tuple(row) for row in thinned}
    assert start[0, 1] == thinned[thinned[:, 1] > 0, 1].min()
    assert (np.diff(start[:, 1]) > 0).all()
    assert (np.diff(start[:, 0]) < 0).all()
    front.series["greedy"] = greedy_insertion(problem.surface, most=20).F[1:]
    folder = front.save(tmp_path / "out", meshes=0)
    again = Front.load(folder)
    assert list(again.series) == [name, "greedy"]
    assert np.array_equal(again.series[name], start)
    assert [line.get_label() for line in again[2:5].plot().get_lines()][:2] == [name, "greedy"]
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert '"series":[{"name":"adaptive thinning (start)","x":[2.0,' in text
    again.save(tmp_path / "again", meshes=0)
    assert (tmp_path / "again" / "series.csv").read_bytes() == (folder / "series.csv").read_bytes()


def test_a_search_from_random_subsets_has_no_other_front_beside_it(front, stored):
    assert front.series == {}
    assert not (stored / "series.csv").exists()


def test_of_a_large_model_the_start_is_drawn_from_points_spread_over_the_sizes():
    problem = MeshProblem("peaks:40")
    (start,) = starting_front(problem, memetic()).values()
    assert 100 < len(start) <= 200
    assert len(thinning(problem.surface).F) > 1500
    upper = start[start[:, 1] > 20, 1]
    assert (upper[1:] / upper[:-1]).max() < 1.2
    assert start[-1].tolist() == [0.0, 2 * 39**2]


def test_nothing_is_overwritten_unasked(front, tmp_path):
    front.save(tmp_path / "out", meshes=0)
    with pytest.raises(ResultError, match="exists already"):
        front.save(tmp_path / "out")
    front[:3].save(tmp_path / "out", overwrite=True, mesh_format="OFF")
    assert len(Front.load(tmp_path / "out")) == 3
    assert len(list(tmp_path.glob("out/meshes/*.off"))) == 3
    path = front[1].save(tmp_path / "one.ply")
    before = path.read_bytes()
    with pytest.raises(ResultError, match=r"one\.ply: exists already"):
        front[2].save(path)
    assert path.read_bytes() == before
    front[2].save(path, overwrite=True)
    assert path.read_bytes() != before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one.ply", "out"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "mesh.doc",
            r"the suffix '\.doc' says no format that can be written; use one of "
            + re.escape(", ".join(written_suffixes())),
        ),
        ("mesh", r"the suffix '' says no format"),
        ("nowhere/mesh.ply", r"there is no folder .*nowhere; make it first"),
        ("folder.ply", r"is a folder; name a file"),
    ],
)
def test_a_file_that_cannot_be_written_is_named_before_any_work(front, tmp_path, name, message):
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(ResultError, match=message):
        front[0].save(tmp_path / name)


def test_a_stored_mesh_is_copied_and_another_one_is_made(stored, tmp_path):
    front = Front.load(stored)
    with_mesh = [s for s in front if front.stored_mesh(s.solution)]
    assert len(with_mesh) == 5
    for solution in (with_mesh[1], next(s for s in front if not front.stored_mesh(s.solution))):
        path = solution.save(tmp_path / f"{solution.solution}.PLY")
        mesh = trimesh.load(path, process=False)
        assert len(mesh.faces) == solution.triangles
        assert np.array_equal(mesh.vertices, solution.mesh.vertices)
    assert (tmp_path / f"{with_mesh[1].solution}.PLY").read_bytes() == front.stored_mesh(
        with_mesh[1].solution
    ).read_bytes()


def test_the_model_is_found_again_when_both_were_moved_together(roof_file, tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    shutil.move(roof_file, tmp_path / "a" / "roof.ply")
    monkeypatch.chdir(tmp_path / "a")
    whole = Front.from_subsets(MeshProblem("roof.ply"), np.ones((1, 25), bool), ends=True)
    whole.save("out", meshes=0)
    shutil.move(tmp_path / "a", tmp_path / "b")
    monkeypatch.chdir(tmp_path)
    assert Front.load(tmp_path / "b" / "out").F.tolist() == whole.F.tolist()
    assert len(Front.load("b/out")[-1].mesh.faces) == whole[-1].triangles


def test_a_model_that_changed_is_refused_with_the_way_out(roof_file, tmp_path):
    Front.from_subsets(MeshProblem(roof_file), np.ones((1, 25), bool), ends=True).save(tmp_path / "out", meshes=0)
    roof = load("roof:5")
    write_mesh(roof_file, roof.points * [1, 1, 2], roof.faces)
    front = Front.load(tmp_path / "out")
    assert front.F[0].tolist() == [10, 2]  # the numbers are there
    with pytest.raises(ResultError, match=r"is the front of another model than .*roof\.ply is now \(the file has chan"):
        _ = front[0].mesh
    with pytest.raises(ResultError, match=r"out: is the front of another model than roof:9 .* not 81; pass the orig"):
        Front.load(tmp_path / "out", model="roof:9")
    write_mesh(tmp_path / "kept.ply", roof.points, roof.faces)
    assert len(Front.load(tmp_path / "out", model=tmp_path / "kept.ply")[0].mesh.faces) == 2
    roof_file.unlink()
    with pytest.raises(ResultError, match=r"its model cannot be read \(.*roof\.ply: no such file.*\); pass the orig"):
        _ = front[0].mesh


def test_the_same_heights_in_another_unit_are_said_to_be_so(tmp_path):
    pytest.importorskip("rasterio", reason="no rasterio: pip install '.[geo]'")
    for code in (25832, 2226):
        heights = iter([(0, np.arange(16.0).reshape(4, 4) ** 2)])
        write_raster(tmp_path / f"{code}.tif", heights, shape=(4, 4), transform=(1.0, 0.0, 0.0, 0.0, -1.0, 0.0),
                     crs=f"EPSG:{code}", unit="", title="", tags={}, name="heights")  # fmt: skip
    problem = MeshProblem(str(tmp_path / "25832.tif"))
    Front.from_subsets(problem, np.ones((1, 16), bool), ends=True).save(tmp_path / "out", meshes=0)
    with pytest.warns(
        ModelWarning, match=r"says US survey foot, EPSG:2226, and said m, EPSG:25832 when .*out was made"
    ):
        _ = Front.load(tmp_path / "out", model=tmp_path / "2226.tif").surface


def test_how_the_model_was_read_is_remembered(tmp_path):
    elevation = np.arange(30.0).reshape(5, 6) ** 1.5
    elevation[0, 0] = -9999
    np.save(tmp_path / "dem.npy", elevation)
    problem = MeshProblem(tmp_path / "dem.npy", spacing=(10, 20), nodata=-9999, footprint="hull", outside="ignore")
    Front.from_subsets(problem, np.ones((1, 29), bool), ends=True).save(tmp_path / "out", meshes=0)
    front = Front.load(tmp_path / "out")
    assert np.ptp(front[-1].mesh.vertices[:, :2], axis=0).tolist() == [50, 80]
    assert front.problem.surface.rules == Rules(footprint="hull", outside="ignore")
    assert front.problem.options == problem.options == Options(spacing=(10, 20), nodata=-9999)
    again = Front.load(tmp_path / "out", model=problem.model)  # a model in memory was read in that way, too
    assert Front.load(again.save(tmp_path / "again", meshes=0, page=False)).problem.options == problem.options
    surface = Front.load(tmp_path / "out", model=problem.surface)
    assert surface.problem.options == problem.options


def test_a_front_can_be_pickled(front):
    again = pickle.loads(pickle.dumps(front))
    assert again.F.tolist() == front.F.tolist()
    assert again[2].mesh.faces.tolist() == front[2].mesh.faces.tolist()


# -------------------------------------------------------------------------------------------------------------- looking


def test_it_says_what_it_is(front):
    few, many = front[0], front[-1]
    assert repr(front) == (
        f"<front of face:200: {len(front)} solutions, 2 to {many.triangles} triangles, error {few.error:.6g} to 0>"
    )
    assert repr(front[1]).startswith(f"<solution 1 of {len(front)}: {front[1].triangles} triangles, error ")


def test_a_notebook_shows_the_picture_and_a_table_with_the_knee(front):
    page = front._repr_html_()
    assert "data:image/png;base64," in page
    assert f"<td>{front.knee().solution} (knee)</td>" in page
    header = "".join(
        f"<th>{word}</th>"
        for word in (
            "solution",
            "triangles",
            "vertices",
            "error",
            "mean error",
            "RMS error",
            "max error",
            "surface error",
        )
    )
    assert f"<tr>{header}</tr>" in page
    first = front.quality[0]
    errors = (first.error, first.mean_error, first.rms_error, first.max_error, first.surface_error)
    numbers = (first.triangles, first.vertices, *errors)
    assert "".join(f"<td>{number:.6g}</td>" for number in numbers) in page
    rows = page.count("<tr>") - 1
    assert 3 <= rows <= 13
    assert (f"{len(front) - rows} more solutions are not listed" in page) == (rows < len(front))
    assert front._repr_png_().startswith(b"\x89PNG")
    assert front[3]._repr_png_().startswith(b"\x89PNG")


def test_drawing_uses_the_axes_it_is_given(front):
    a, b, c = Figure().subplots(1, 3)
    assert front.plot(a) is a
    knee_drawn = next(line for line in a.get_lines() if line.get_label() == "knee")
    assert np.column_stack(knee_drawn.get_data()).tolist() == [[front.knee().triangles, front.knee().error]]
    assert front[3].plot(b, exaggeration=1.0) is b
    assert len(b.collections[0].get_paths()) == front[3].triangles
    assert front[3].plot_error(c) is c
    drawn = next(item for item in c.collections if item.get_array() is not None)
    assert drawn.get_array().tolist() == front[3].simplified.deviation.tolist()
    plot_mesh(front[3], Figure().subplots())


def test_as_a_table_of_pandas(front):
    pandas = pytest.importorskip("pandas")
    frame = front.to_frame()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["error"].tolist() == front.F[:, 0].tolist()
    assert list(frame.columns) == [name for name in FRONT_COLUMNS if name not in ("solution", "mesh")]
    assert frame["free"].tolist() == [0] * len(front)
    assert frame.index.name == "solution"


def test_without_pandas_the_way_out_is_said(front, monkeypatch):
    real = builtins.__import__

    def refuse(name, *args, **kwargs):
        if name == "pandas":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.delitem(sys.modules, "pandas", raising=False)
    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(ImportError, match=r"to_frame\(\) needs pandas: pip install 'pandas>=2.0'"):
        front.to_frame()


# -------------------------------------------------------------------------------------------------- while a run goes on


def test_the_output_shows_hypervolume_and_errors_generation_by_generation(capsys):
    problem = MeshProblem("face:200")
    output = FrontOutput([20, 100])
    result = minimize(problem, nsga2_v1(pop_size=12), ("n_gen", 4), seed=1, output=output, verbose=True)
    lines = [line for line in capsys.readouterr().out.splitlines() if not line.startswith("=")]
    assert [cell.strip() for cell in lines[0].split("|")] == ["n_gen", "n_eval", "n_nds", "hv", "error@20", "error@100"]
    assert len(lines) == 5
    last = [cell.strip() for cell in lines[-1].split("|")]
    assert last[:3] == ["4", "48", str(len(result.F))]
    assert [row["n_gen"] for row in output.rows] == [1, 2, 3, 4]
    assert output.rows[-1]["error@100"] == min(result.F[result.F[:, 1] <= 100, 0])
    assert last[-1] == f"{output.rows[-1]['error@100']:.4g}"
    volumes = [row["hv"] for row in output.rows]
    assert volumes == sorted(volumes)
    assert 0 < volumes[0] < volumes[-1] < 1
    assert last[3] == f"{volumes[-1]:.4f}"


def test_the_hypervolume_is_the_share_of_the_box_between_the_ends():
    """Known answer: with the corners, error 3 at 2 triangles, and all, 0 at 8: the box is 3 by 8."""
    problem = MeshProblem("roof:3")
    X = np.array([problem.pinned | np.isin(np.arange(9), rows) for rows in ([], range(9))])
    output = FrontOutput([2])
    minimize(problem, NSGA2(pop_size=2, sampling=X), ("n_gen", 1), seed=1, callback=output)
    F = problem.evaluate(X)
    assert F.tolist() == [[3, 2], [0, 8]]
    assert output.rows[0]["hv"] == 0.0  # both ends touch the border of the box
    assert output.rows[0]["error@2"] == 3
    middle = np.vstack([X, whole_front_of(problem)[-1].kept])  # exact with 4 triangles
    output = FrontOutput([2])
    minimize(problem, NSGA2(pop_size=3, sampling=middle), ("n_gen", 1), seed=1, callback=output)
    assert output.rows[0]["hv"] == pytest.approx((8 - 4) / 8)


def test_against_a_reference_the_output_shows_the_ratio(front):
    output = FrontOutput(reference=front)
    result = minimize(front.problem, nsga2_v1(pop_size=12), ("n_gen", 2), seed=2, callback=output)
    assert output.rows[-1]["hvr"] == hypervolume_ratio(result.F, front.F)
    assert 0 < output.rows[-1]["hvr"] < 1
    assert output.sizes == usual_sizes(len(front.model.faces))


def test_the_output_refuses_another_problem():
    with pytest.raises(TypeError, match="FrontOutput shows fronts of a MeshProblem, not of a ZDT1"):
        minimize(get_problem("zdt1", n_var=3), NSGA2(pop_size=8), ("n_gen", 1), seed=1, callback=FrontOutput())


def test_errors_at_sizes_are_those_of_the_best_small_enough():
    F = [[5, 10], [9, 4], [7, 12]]
    assert errors_at(F, [4, 9, 10, 100]).tolist() == [9, 9, 5, 5]
    assert np.isnan(errors_at(F, [3])).all()
    assert usual_sizes(8) == [2]


@pytest.mark.parametrize(
    "pin", [[12, 7], 12, (1, 2), np.array([3, 4]), np.array([[0.0, 0.5]]), "hull", ["hull", 12], {7}], ids=str
)
def test_what_is_pinned_is_pinned_again_when_the_front_is_read(pin, tmp_path):
    problem = MeshProblem("roof:5", pin=pin)
    Front.from_subsets(problem, problem.pinned, ends=True).save(tmp_path / "out", page=False)
    again = Front.load(tmp_path / "out").problem
    np.testing.assert_array_equal(again.pinned, problem.pinned)
    if str(pin) == "[12, 7]":
        assert again.pinned.sum() == 6


@pytest.mark.parametrize("weights", [np.arange(25.0), list(range(25)), np.arange(25).reshape(5, 5)], ids=str)
def test_weights_by_number_count_again_when_the_front_is_read(weights, tmp_path):
    problem = MeshProblem("roof:5", weights=weights)
    front = Front.from_subsets(problem, problem.pinned, ends=True)
    front.save(tmp_path / "out")
    again = Front.load(tmp_path / "out")
    assert again.quality == front.quality
    assert again.problem.evaluate(problem.pinned).tolist() == problem.evaluate(problem.pinned).tolist()


def test_a_grid_with_gaps_and_weights_without_numbers_there_is_read_again(tmp_path):
    heights = np.random.default_rng(1).random((6, 7))
    heights[2:4, 3] = -LARGEST  # what GDAL writes where there is no sample
    np.save(tmp_path / "dem.npy", heights)
    weights = np.where(heights < 0, np.nan, 1.0 + heights)
    problem = MeshProblem(tmp_path / "dem.npy", nodata=-LARGEST, weights=weights)
    Front.from_subsets(problem, problem.pinned, ends=True).save(tmp_path / "out", page=False)
    again = Front.load(tmp_path / "out").problem
    assert again.options == problem.options == Options(nodata=-LARGEST)
    assert again.model.hash == problem.model.hash


def test_a_missed_wish_goes_from_process_to_process():
    missed = pickle.loads(pickle.dumps(Missed("none is so good", "the nearest")))
    assert (str(missed), missed.nearest) == ("none is so good", "the nearest")
