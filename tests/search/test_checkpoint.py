"""A search that is saved, restored in a new algorithm and continued finds what it would have found undisturbed."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import math
import pickle
import time
import zipfile
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.algorithms.moo.nsga3 import HyperplaneNormalization
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.util.archive import MultiObjectiveArchive
from samples import freed

from meshsimp_pymoo import MeshProblem, Moves, nsga2_v1, nsga3
from meshsimp_pymoo.search import checkpoint as module
from meshsimp_pymoo.search.checkpoint import (
    CheckpointError,
    Checkpoints,
    NotResumable,
    difference,
    read_checkpoint,
    restore,
)
from meshsimp_pymoo.search.operators import OAX
from meshsimp_pymoo.search.operators.oax import first_objective
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.surface.surface import FreeMesh

WHAT = {"model": "roof"}
ALGORITHMS = {name: preset.function for name, preset in PRESETS.items()} | {"nsga3": nsga3}


@pytest.fixture(scope="module")
def problems():
    measures = ("error", "max_error", "triangles")
    return {
        "usual": MeshProblem("face:90", n_threads=1),
        "three": MeshProblem("face:90", objectives=measures, n_threads=1),
        "limited": MeshProblem("face:90", max_triangles=60, max_objective=400.0, n_threads=1),
    }


def set_up(name, problem, termination=("n_gen", 9), seed=3, **options):
    if name.startswith("weighted"):
        options["w"] = 0.3
    if name in ("fujiwara_sawai", "huang_ho"):
        options["size"] = 0.3
    if name == "memetic":
        options["moves_per_vertex"] = 1
    if name == "nsga3":
        options["n_partitions"] = 4
    return ALGORITHMS[name](pop_size=16, **options).setup(problem, termination=termination, seed=seed)


def steps(algorithm, count):
    for _ in range(count):
        algorithm.next()


def finish(algorithm):
    while algorithm.has_next():
        algorithm.next()


def saved(algorithm, path, **facts):
    Checkpoints(path, algorithm, WHAT, interval=0).save(**facts)
    return read_checkpoint(path)


def state(algorithm):
    """Return all that an outsider can compare."""
    people = [algorithm.pop, algorithm.opt]
    return (
        *(part.get(name).tolist() for part in people for name in ("X", "F", "G", "CV", "n_gen", "max_error")),
        algorithm.evaluator.n_eval,
        algorithm.n_iter,
        algorithm.random_state.bit_generator.state,
    )


CASES = [(name, "usual") for name in PRESETS] + [("nsga3", "three"), ("nsga2_v1", "limited"), ("memetic", "limited")]


@pytest.mark.parametrize(("name", "kind"), CASES)
@pytest.mark.parametrize("at", [1, 5])
def test_every_preset_goes_on_to_the_same_end(problems, tmp_path, name, kind, at):
    problem = problems[kind]
    whole = set_up(name, problem)
    finish(whole)
    first = set_up(name, problem)
    keeper = Checkpoints(tmp_path / "c.npz", first, WHAT)
    steps(first, at)
    if name == "moead":  # by hand one serves one sub-problem a step: in the middle of a generation
        for _ in range(at):
            one = first.ask()
            first.evaluator.eval(problem, one, algorithm=first)
            first.tell(infills=one)
    keeper.save()
    second = set_up(name, problem)
    restore(read_checkpoint(tmp_path / "c.npz"), second)
    assert state(second) == state(first)
    assert second.has_next()
    finish(second)
    assert state(second) == state(whole)


def test_a_search_with_a_budget_in_moves_goes_on_with_what_is_left_of_them(problems, tmp_path):
    whole, first, second = (set_up("memetic", problems["usual"], Moves(3_001)) for _ in range(3))
    finish(whole)
    steps(first, 2)
    assert 0 < first.moves < 3_001
    restore(saved(first, tmp_path / "c.npz"), second)
    finish(second)
    assert state(second) == state(whole)
    assert second.moves == whole.moves == 3_001


def test_a_search_that_is_at_its_end_is_restored_at_its_end(problems, tmp_path):
    whole = set_up("memetic", problems["usual"], ("n_gen", 2))
    finish(whole)
    again = set_up("memetic", problems["usual"], ("n_gen", 2))
    restore(saved(whole, tmp_path / "c.npz"), again)
    assert not again.has_next()
    assert state(again) == state(whole)


def test_the_same_individual_in_several_places_stays_the_same_one(problems, tmp_path):
    first = set_up("moead", problems["usual"])
    steps(first, 100)
    second = set_up("moead", problems["usual"])
    restore(saved(first, tmp_path / "c.npz"), second)

    def sharing(algorithm):
        places = {}
        return [places.setdefault(id(one), len(places)) for one in (*algorithm.pop, *algorithm.opt)]

    assert sharing(second) == sharing(first)
    assert len(set(sharing(first))) < len(sharing(first))


def test_a_checkpoint_can_be_taken_from_a_restored_search_again_and_again(problems, tmp_path):
    whole, now = (set_up("nsga2_v2", problems["usual"]) for _ in range(2))
    finish(whole)
    while now.has_next():
        now.next()
        if now.has_next():
            stored = saved(now, tmp_path / "c.npz")
            now = set_up("nsga2_v2", problems["usual"])
            restore(stored, now)
    assert state(now) == state(whole)


def test_a_budget_in_seconds_goes_on_with_what_is_left(problems, tmp_path, monkeypatch):
    first = set_up("nsga2_v1", problems["usual"], ("time", 100))
    first.next()
    first.start_time -= 40.0
    stored = saved(first, tmp_path / "c.npz")
    clock = time.time
    monkeypatch.setattr(time, "time", lambda: clock() + 5000.0)  # it was dead for more than an hour
    second = set_up("nsga2_v1", problems["usual"], ("time", 100))
    restore(stored, second)
    second.next()
    assert 0.4 <= second.termination.perc < 0.5
    assert second.has_next()


def test_the_limit_is_the_new_ones(problems, tmp_path):
    first = set_up("nsga2_v1", problems["usual"], ("n_gen", 4))
    steps(first, 3)
    second, whole = (set_up("nsga2_v1", problems["usual"], ("n_gen", 7)) for _ in range(2))
    restore(saved(first, tmp_path / "c.npz"), second)
    finish(second)
    finish(whole)
    assert state(second) == state(whole)


def test_notes_and_description_come_back(problems, tmp_path):
    first = set_up("nsga2_v1", problems["usual"])
    steps(first, 2)
    keeper = Checkpoints(tmp_path / "c.npz", first, WHAT, before=100.0)
    keeper.save(generations=2)
    stored = read_checkpoint(tmp_path / "c.npz")
    assert (stored.what, stored.facts) == (WHAT, {"generations": 2})
    assert 100.0 <= stored.seconds < 110.0
    assert difference(stored.what, WHAT) == ""
    assert difference(stored.what, {"model": "face"}) == "model roof, not face"
    assert difference({"a": (1, 2)}, {"a": [1, 2]}) != ""
    assert difference({"a": [1, 2]}, {"a": (1, 2)}) == ""


def test_checkpoints_are_not_due_too_often(problems, tmp_path, monkeypatch):
    now = [1000.0]
    monkeypatch.setattr(module.time, "perf_counter", lambda: now[0])
    first = set_up("nsga2_v1", problems["usual"])
    first.next()
    keeper = Checkpoints(tmp_path / "c.npz", first, WHAT, interval=10.0)
    seen = []
    for seconds in (0.0, 9.0, 2.0):
        now[0] += seconds
        seen.append(keeper.due())
    assert seen == [False, False, True]

    def slow(*_):
        now[0] += 3.0

    monkeypatch.setattr(module, "_write", slow)
    keeper.save()
    now[0] += module.PAUSE * 3.0 - 1.0  # three seconds of writing are worth a longer pause
    assert not keeper.due()
    now[0] += 2.0
    assert keeper.due()


def test_a_checkpoint_is_little_more_than_its_bits(tmp_path):
    problem = MeshProblem("jacksboro:4", n_threads=1)
    first = set_up("nsga2_v1", problem)
    first.next()
    saved(first, tmp_path / "c.npz")
    n = problem.n_var
    assert 16 * n / 8 < (tmp_path / "c.npz").stat().st_size < 16 * n / 8 + 30_000


class Pair(NamedTuple):
    one: object
    other: object


def test_values_of_every_kind_that_an_algorithm_may_hold_come_back(problems, tmp_path):
    held = {
        "plain": [None, True, 3, 0.1, "text", -math.inf, np.float32(0.1), np.int64(7)],
        "inside each other": (Pair({"b", "a"}, {1, 2.5}), {(1, 2): [{3}, ()]}),
        "arrays": [np.arange(6.0).reshape(2, 3), np.arange(11) % 3 == 0],
    }
    first, second = (set_up("nsga2_v1", problems["usual"]) for _ in range(2))
    first.next()
    first.data["held"] = held
    second.data["held"] = {"inside each other": (Pair(0, 0), {})}
    restore(saved(first, tmp_path / "c.npz"), second)
    found = second.data["held"]
    for here, there in zip(found.pop("arrays"), held.pop("arrays"), strict=True):
        assert here.dtype == there.dtype
        np.testing.assert_array_equal(here, there)
    assert found == held
    assert [type(value) for value in found["plain"]] == [type(value) for value in held["plain"]]


class Other:
    pass


def local_class():
    class Local:
        pass

    Local.__module__ = "meshsimp_pymoo.nowhere"
    return Local


UNKNOWN = {
    "a foreign object": lambda algorithm: setattr(algorithm, "extra", Other()),
    "a generator": lambda algorithm: setattr(algorithm.mating, "extra", iter([1])),
    "an array of objects": lambda algorithm: setattr(algorithm, "extra", np.array([Other()])),
    "a new part with a function": lambda algorithm: setattr(algorithm, "extra", OAX(score=first_objective)),
    "a new part inside a new part": lambda algorithm: setattr(algorithm, "extra", OAX(evaluator=iter([1]))),
    "a new generator": lambda algorithm: setattr(algorithm, "extra", np.random.default_rng(1)),
    "a new part of a local class": lambda algorithm: setattr(algorithm, "extra", local_class()()),
    "an archive": lambda algorithm: setattr(algorithm, "archive", MultiObjectiveArchive()),
    "a function in people": lambda algorithm: algorithm.pop[0].data.update(score=first_objective),
    "people in people": lambda algorithm: algorithm.pop[0].data.update(parent=Individual(X=np.ones(90, bool))),
}


@pytest.mark.parametrize("kind", UNKNOWN)
def test_state_that_cannot_be_carried_is_refused_and_nothing_is_written(problems, tmp_path, kind):
    first = set_up("nsga2_v1", problems["usual"])
    first.next()
    keeper = Checkpoints(tmp_path / "c.npz", first, WHAT)
    UNKNOWN[kind](first)
    for save in (keeper.check, keeper.save):
        with pytest.raises(NotResumable, match="checkpoint can"):
            save()
    assert list(tmp_path.iterdir()) == []


def test_parts_made_during_the_run_are_made_again_and_shared_generators_stay_shared(problems, tmp_path):
    first, second = (set_up("nsga2_v1", problems["usual"]) for _ in range(2))
    keeper = Checkpoints(tmp_path / "c.npz", first, WHAT)
    steps(first, 2)
    first.survival.norm = HyperplaneNormalization(2)  # as in SPEA2
    first.survival.norm.update(first.pop.get("F"))
    first.survival.again = first.survival.norm
    first.survival.random_state = first.random_state  # as in CTAEA
    keeper.save()
    restore(read_checkpoint(tmp_path / "c.npz"), second)
    assert type(second.survival.norm) is HyperplaneNormalization
    np.testing.assert_array_equal(second.survival.norm.nadir_point, first.survival.norm.nadir_point)
    assert second.survival.again is second.survival.norm
    assert second.survival.random_state is second.random_state
    assert state(second) == state(first)


def test_free_meshes_of_individuals_come_back_and_shared_ones_stay_shared(problems, tmp_path):
    problem = problems["usual"]
    whole, first, second, third = (set_up("nsga2_v1", problem) for _ in range(4))
    finish(whole)
    keeper = Checkpoints(tmp_path / "c.npz", first, WHAT)
    steps(first, 4)
    meshes = [freed(problem.surface, one.X, better=False) for one in first.opt[:3]]
    for one, mesh in zip(first.opt, [*meshes, meshes[0], None], strict=False):
        one.set("free", mesh)
    first.held = {"best": meshes[1]}  # what an algorithm holds beside
    keeper.save()
    restore(read_checkpoint(tmp_path / "c.npz"), second)
    assert state(second) == state(first)
    found = second.opt.get("free")
    assert len({id(mesh) for mesh in found[:3]}) == 3
    assert found[3] is found[0]
    assert second.held["best"] is found[1]
    assert all(one is None for one in found[4:])
    for mesh, other in zip(meshes, found, strict=False):
        assert type(other) is FreeMesh
        np.testing.assert_array_equal(other.kept, mesh.kept)
        np.testing.assert_array_equal(other.faces, mesh.faces)
        assert (other.kept.dtype, other.faces.dtype, other.quality) == (bool, np.int32, mesh.quality)
    restore(saved(second, tmp_path / "d.npz"), third)  # again and again
    assert [mesh is None or mesh.quality for mesh in third.opt.get("free")] == [
        mesh is None or mesh.quality for mesh in found
    ]
    finish(third)
    assert state(third) == state(whole)  # they change nothing of the search itself


def test_a_free_mesh_that_is_none_is_refused(problems, tmp_path):
    first = set_up("nsga2_v1", problems["usual"])
    first.next()
    first.opt[0].set("free", freed(problems["usual"].surface, first.opt[0].X))
    stored = saved(first, tmp_path / "c.npz")
    for old, new in (
        (f"{FreeMesh.__module__}.FreeMesh", "meshsimp_pymoo.nowhere.Other"),
        (f"{FreeMesh.__module__}.FreeMesh", "subprocess.Popen"),
        ('["bits"', '["no bits"'),
    ):
        text = json.dumps(stored.content)
        assert old in text
        changed = SimpleNamespace(path=stored.path, content=json.loads(text.replace(old, new)), arrays=stored.arrays)
        with pytest.raises(CheckpointError, match="does not fit this search"):
            restore(changed, set_up("nsga2_v1", problems["usual"]))


def test_an_algorithm_in_the_middle_of_a_python_generator_is_refused(problems, tmp_path):
    theirs = MOEAD(np.eye(2), sampling=np.ones((2, 90), bool), crossover=OAX(), mutation=OAX())
    theirs.setup(problems["usual"], termination=("n_gen", 5), seed=1)
    theirs.next()
    theirs.generator = itertools.count()
    with pytest.raises(NotResumable, match=r"algorithm\.generator"):
        Checkpoints(tmp_path / "c.npz", theirs, WHAT)


# ------------------------------------------------------------------------------------------------------------- damage


@pytest.fixture(scope="module")
def whole_file(problems, tmp_path_factory):
    first = set_up("nsga2_v1", problems["usual"])
    steps(first, 2)
    path = tmp_path_factory.mktemp("whole") / "c.npz"
    saved(first, path)
    return path.read_bytes()


def refused(path, content=None):
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CheckpointError) as caught:
        read_checkpoint(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: is no checkpoint, or a damaged one (")
    assert "\n" not in text
    return text


def test_every_cut_is_noticed(whole_file, tmp_path):
    for length in [0, 1, 100, *np.linspace(101, len(whole_file) - 1, 40).astype(int)]:
        refused(tmp_path / "c.npz", whole_file[:length])


def test_every_flipped_bit_of_the_arrays_is_noticed(whole_file, tmp_path, problems):
    """A bit of the archive's own frame may not matter; then the state is the same."""
    fine = set_up("nsga2_v1", problems["usual"])
    (tmp_path / "c.npz").write_bytes(whole_file)
    restore(read_checkpoint(tmp_path / "c.npz"), fine)
    rng = np.random.default_rng(5)
    noticed = 0
    for _ in range(150):
        content = bytearray(whole_file)
        content[rng.integers(len(content))] ^= 1 << rng.integers(8)
        (tmp_path / "c.npz").write_bytes(content)
        try:
            stored = read_checkpoint(tmp_path / "c.npz")
        except CheckpointError:
            noticed += 1
            continue
        other = set_up("nsga2_v1", problems["usual"])
        restore(stored, other)
        assert state(other) == state(fine)
    assert noticed > 75


def packed(**arrays):
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


class Bomb:
    def __reduce__(self):
        return (print, ("unpickled",))


def declared(shape):
    """Return a .npz whose one array says that it has this shape, and has nothing."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("checksum.npy", header.getvalue())
    return content.getvalue()


def deflated():
    content = io.BytesIO()
    np.savez_compressed(content, state=np.zeros(50_000_000, np.uint8))
    return content.getvalue()


FOREIGN = {
    "pickle": (lambda: pickle.dumps(Bomb()), "zip"),
    "pickles inside": (lambda: packed(checksum=np.array([Bomb()], dtype=object)), "Python objects"),
    "huge": (lambda: declared((10**12,)), "declares"),
    "packed": (deflated, "it is packed"),
    "another npz": (lambda: packed(F=np.zeros(3)), "holds no 'checksum'"),
    "wrong checksum": (
        lambda: packed(state=np.zeros(3, np.uint8), checksum=np.zeros(32, np.uint8)),
        "does not have its checksum",
    ),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_files_are_refused_before_anything_is_believed(tmp_path, capsys, kind):
    make, reason = FOREIGN[kind]
    assert reason in refused(tmp_path / "c.npz", make())
    assert capsys.readouterr().out == ""


def test_a_folder_and_a_later_format_are_refused(whole_file, tmp_path, problems, monkeypatch):
    (tmp_path / "c.npz").mkdir()
    refused(tmp_path / "c.npz")
    monkeypatch.setattr(module, "FORMAT", 2)
    (tmp_path / "d.npz").write_bytes(whole_file)
    assert "the format 1, this version reads 2" in refused(tmp_path / "d.npz")


def test_a_state_of_something_else_is_refused(whole_file, tmp_path, problems):
    path = tmp_path / "c.npz"
    path.write_bytes(whole_file)
    stored = read_checkpoint(path)
    others = [
        (
            set_up("moead", problems["usual"]),
            "algorithm is a meshsimp_pymoo.*NSGA2, not a meshsimp_pymoo.*TchebycheffMOEAD",
        ),
        (set_up("nsga2_v2", problems["usual"]), "OAX"),
        (set_up("nsga2_v1", MeshProblem("roof:5")), r"an individual has \(90,\) variables, the problem 25"),
    ]
    for algorithm, message in others:
        with pytest.raises(CheckpointError, match=f"does not fit this search .*{message}"):
            restore(stored, algorithm)


def test_whatever_a_well_made_file_says_is_a_result_or_one_error(whole_file, tmp_path, problems):
    """What has the right checksum may still be nonsense; nothing but CheckpointError may come of it."""
    (tmp_path / "c.npz").write_bytes(whole_file)
    stored = read_checkpoint(tmp_path / "c.npz")
    text = json.dumps(stored.content)
    rng = np.random.default_rng(2)
    names = sorted(stored.arrays)
    for _ in range(60):
        cut = text
        for a, b in [("population", "individual"), ("bits", "rows"), ("generator", "fixed"), ("plain", "each")]:
            if rng.random() < 0.3:
                cut = cut.replace(a, b, 1)
        cut = cut.replace(f'"{rng.choice(names)}"', f'"{rng.choice([*names, "none"])}"')
        nonsense = SimpleNamespace(path=stored.path, content=json.loads(cut), arrays=stored.arrays)
        with contextlib.suppress(CheckpointError):
            restore(nonsense, nsga2_v1(16).setup(problems["usual"], termination=("n_gen", 9), seed=3))


def test_an_empty_population_can_be_saved(problems, tmp_path):
    first = set_up("nsga2_v1", problems["usual"])
    first.next()
    first.opt = Population()
    second = set_up("nsga2_v1", problems["usual"])
    restore(saved(first, tmp_path / "c.npz"), second)
    assert len(second.opt) == 0
