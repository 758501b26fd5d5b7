"""What a configuration may say, and the one line that answers everything else."""

from __future__ import annotations

import importlib
import os
import re
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from pymoo.optimize import minimize

from meshsimp_pymoo.comparison.baselines import BASELINES
from meshsimp_pymoo.comparison.config import BUDGET_KINDS, PROBLEM_OPTIONS, ConfigError, read_experiment_file, settings
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ExperimentWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.table import write_mesh
from meshsimp_pymoo.problem import MeshProblem
from meshsimp_pymoo.search.operators import OAX, OPERATORS, SubsetUniformCrossover
from meshsimp_pymoo.search.presets import PRESETS
from meshsimp_pymoo.search.weighted import WeightedSum
from meshsimp_pymoo.surface.rules import Rules

MESHLAB = ("quadric_collapse", "quadric_collapse_unit", "quadric_collapse_boundary", "vertex_clustering")
CONFIGS = Path(__file__).resolve().parents[2] / "configs"

GOOD = {
    "problem": "{footprint: hull, outside: ignore}",
    "problems": '[{name: A, model: "pyramid:9"}, {name: B, model: "roof:5", up: z}]',
    "algorithms": "[{name: N, preset: nsga2_v1, parameters: {pop_size: 10}}]",
    "seeds": "[1, 2]",
    "budgets": "[{generations: 2}]",
}


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def changed(tmp_path: Path, **parts: str | None) -> Path:
    """Write the good configuration with some keys replaced (None: left out)."""
    merged = {key: value for key, value in (GOOD | parts).items() if value is not None}
    return write(tmp_path, "\n".join(f"{key}: {value}" for key, value in merged.items()) + "\n")


def message(path: Path, *, names: Path | None = None, **kwargs: object) -> str:
    with pytest.raises(ConfigError) as caught:
        read_experiment_file(path, **kwargs)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(names or path))
    return line


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.name)
def test_every_configuration_that_comes_along_can_be_run(path, tmp_path):
    for name in ("m1_laurana", "m2_demosthenes", "m3_nefertiti", "m4_skull", "m5_celticskull", "m6_igea"):
        source = load("pyramid:9")
        write_mesh(tmp_path / f"{name}.ply", source.points, source.faces)
    experiment = read_experiment_file(path, folder=tmp_path)
    assert {algorithm.preset for algorithm in experiment.algorithms} >= {"nsga2_v1", "nsga2_v2", "moead"}
    assert {budget.kind for budget in experiment.budgets} >= {"generations", "evaluations"}
    assert len(experiment.problems) in (3, 6)
    assert experiment.baselines.methods[:4] == MESHLAB


@pytest.mark.parametrize(
    ("given", "methods", "steps"),
    [
        ("true", tuple(BASELINES), 10),
        ("{steps: 4}", tuple(BASELINES), 4),
        ("meshlab", MESHLAB, 10),
        ("[insertion, thinning]", ("thinning", "insertion_by_point", "insertion_by_triangle"), 10),
        ("{methods: [pydelatin, vertex_clustering], steps: 2}", ("vertex_clustering", "pydelatin"), 2),
    ],
)
def test_baselines_are_named_one_by_one_or_by_their_groups(tmp_path, given, methods, steps):
    found = read_experiment_file(changed(tmp_path, baselines=given)).baselines
    assert (found.methods, found.steps, found.down_to_fronts) == (methods, steps, True)


@pytest.mark.parametrize("none", [None, "false"])
def test_there_may_be_no_baselines(tmp_path, none):
    assert read_experiment_file(changed(tmp_path, baselines=none)).baselines is None


def test_the_papers_configuration_has_the_papers_numbers():
    experiment = read_experiment_file(CONFIGS / "paper.yaml")
    assert [p.model.n_vertices for p in experiment.problems] == [922, 2622, 1420, 1055, 5196, 1777]
    assert len(experiment.seeds) == 10
    merged = [a.merged_values for a in experiment.algorithms if a.merged_parameter]
    assert merged == [tuple(k / 10 for k in range(11))] * 2
    for problem in experiment.problems:
        assert problem.options == Options()
        assert problem.rules == Rules(footprint="hull", outside="ignore", pin="corners")
        assert problem.limits == {}


def test_the_quick_configuration_names_all_that_can_stand_there():
    words = set(re.findall(r"\w+", (CONFIGS / "quick.yaml").read_text(encoding="utf-8")))
    assert words >= {*PROBLEM_OPTIONS, *PRESETS, *OPERATORS, *(name for kind in OPERATORS.values() for name in kind)}
    assert words >= {*BUDGET_KINDS, "shared"}


def test_shared_options_hold_for_all_problems_and_a_problem_overrides_them(tmp_path):
    path = changed(tmp_path, problems='[{name: A, model: "pyramid:9", outside: nearest}, "roof:5"]')
    first, second = read_experiment_file(path).problems
    assert first.rules == Rules(footprint="hull", outside="nearest")
    assert second.rules == Rules(footprint="hull", outside="ignore")
    assert first.options == second.options == Options()
    assert first.limits == second.limits == {}
    assert second.name == "roof:5"


def test_an_algorithm_by_import_path_gets_the_papers_operators_and_those_that_are_named(tmp_path):
    spelled = (
        "[{class: pymoo.algorithms.moo.spea2.SPEA2, parameters: {pop_size: 8}, "
        "operators: {crossover: {name: oax, arrays: L8}}}]"
    )
    (algorithm,) = read_experiment_file(changed(tmp_path, algorithms=spelled)).algorithms
    described = algorithm.description()["settings"]
    assert algorithm.name == "SPEA2"
    assert described["crossover"]["arrays"] == "L8"
    assert described["mutation"]["class"].endswith("NeighbourShift")
    assert described["duplicates"]["class"].endswith("PackedDuplicates")


@pytest.mark.parametrize(
    ("spelled", "size"), [("0.2", 0.2), ("9", 9), ("1.0", 1.0), ("[5, 9]", [5, 9]), ("[5, 0.5]", [5, 0.5])]
)
def test_the_size_of_the_first_subsets_is_a_setting(tmp_path, spelled, size):
    operators = f"operators: {{sampling: {{name: random_subset, size: {spelled}}}}}"
    lines = f"[{{preset: nsga2_v1, {operators}}}, {{class: pymoo.algorithms.moo.spea2.SPEA2, {operators}}}]"
    for algorithm in read_experiment_file(changed(tmp_path, algorithms=lines)).algorithms:
        described = algorithm.description()["settings"]["sampling"]
        assert described == {"class": "meshsimp_pymoo.RandomSubset", "size": size}
        assert type(described["size"]) is type(size)


def test_a_size_that_a_problem_has_not_is_refused_before_anything_runs(tmp_path):
    lines = "[{preset: moead, operators: {sampling: {name: random_subset, size: 400}}}]"
    said = message(changed(tmp_path, algorithms=lines))
    assert "algorithms[0]" in said
    assert "size=400 asks for 400 of" in said


def test_the_forerunners_make_a_front_of_several_sizes_and_the_text_of_oax_can_be_had(tmp_path):
    lines = (
        "[{preset: fujiwara_sawai, merged_over: {size: [0.3, 0.5]}}, "
        "{preset: huang_ho, merged_over: {size: [9, 0.5]}}, "
        "{preset: weighted_ga_v2, parameters: {effects: error}, merged_over: {w: [0.0, 1.0]}}, "
        "{preset: nsga2_v2, operators: {crossover: {name: oax, copies: true}}}]"
    )
    first, second, third, fourth = read_experiment_file(changed(tmp_path, algorithms=lines)).algorithms
    assert first.description(0.3)["settings"]["sampling"]["size"] == 0.3
    assert first.description(0.3)["settings"]["crossover"]["keep_size"] is True
    assert second.description(9)["settings"]["sampling"]["size"] == 9
    assert third.description(0.0)["parameters"] == {"effects": "error"}
    assert fourth.description()["settings"]["crossover"]["copies"] is True


def test_reference_directions_are_given_as_a_number(tmp_path):
    spelled = "[{name: N3, class: pymoo.algorithms.moo.nsga3.NSGA3, parameters: {ref_dirs: 5}}]"
    (algorithm,) = read_experiment_file(changed(tmp_path, algorithms=spelled)).algorithms
    np.testing.assert_allclose(algorithm.build().ref_dirs[:, 0], [0, 0.25, 0.5, 0.75, 1])


def test_an_evaluating_crossover_shares_the_evaluator_of_an_algorithm_that_does_not_name_itself(tmp_path):
    spelled = (
        "[{class: pymoo.algorithms.moo.moead.MOEAD, parameters: {ref_dirs: 7, n_neighbors: 4}, "
        "operators: {crossover: {name: oax, n_offsprings: 1, prob: 1.0}}}]"
    )
    (algorithm,) = read_experiment_file(changed(tmp_path, algorithms=spelled)).algorithms
    one, other = algorithm.build(), algorithm.build()
    assert one.mating.crossover.evaluator is one.evaluator
    assert other.evaluator is not one.evaluator
    problem = MeshProblem("face:90", memo=0, n_threads=1)
    seen = Counted(problem)
    minimize(seen, one, ("n_gen", 3), seed=1, copy_algorithm=False)
    assert one.evaluator.n_eval == seen.count > 3 * 7


class Counted(WeightedSum):
    """The two objectives as they are, counted."""

    def __init__(self, problem):
        super().__init__(problem, 0.5)
        self.n_obj, self.count = 2, 0

    def _evaluate(self, X, out, *args, **kwargs):
        self.count += len(X)
        out |= self.problem.evaluate(X, return_as_dictionary=True)


def test_every_list_of_numbers_is_an_array_in_parameters_and_in_what_is_merged_over(tmp_path):
    rnsga2 = "class: pymoo.algorithms.moo.rnsga2.RNSGA2"
    spelled = (
        f"[{{name: A, {rnsga2}, parameters: {{ref_points: [[10, 20], [40.5, 4]], weights: [0.5, 0.5], pop_size: 8}}}}, "
        f"{{name: B, {rnsga2}, merged_over: {{ref_points: [[[1, 2]], [[3, 4]]]}}}}]"
    )
    one, merged = read_experiment_file(changed(tmp_path, algorithms=spelled)).algorithms
    built = one.build().survival
    assert built.ref_points.tolist() == [[10.0, 20.0], [40.5, 4.0]]
    assert built.weights.dtype == float
    assert [merged.build(value).survival.ref_points.tolist() for value in merged.merged_values] == [[[1, 2]], [[3, 4]]]


def test_an_algorithm_of_one_objective_searches_the_weighted_sum(tmp_path):
    weighted = "{class: pymoo.algorithms.soo.nonconvex.ga.GA, parameters: {pop_size: 8}, merged_over: {w: [0.2, 1]}}"
    spelled = f"[{weighted}, nsga2_v1]"
    ga, other = read_experiment_file(changed(tmp_path, algorithms=spelled)).algorithms
    problem = MeshProblem("roof:5", n_threads=1)
    assert [(ga.searched(problem, w).w, ga.searched(problem, w).n_obj) for w in ga.merged_values] == [
        (0.2, 1),
        (1.0, 1),
    ]
    assert other.searched(problem) is problem
    assert ga.description(0.2) != ga.description(1)


def test_the_first_population_of_ctaea_is_whole_or_it_would_never_return(tmp_path):
    spelled = "[{class: pymoo.algorithms.moo.ctaea.CTAEA, parameters: {ref_dirs: 40}, operators: {sampling: nested}}]"
    (algorithm,) = read_experiment_file(changed(tmp_path, algorithms=spelled)).algorithms
    built = algorithm.build().setup(MeshProblem("roof:5", n_threads=1), termination=("n_gen", 2), seed=1)
    first = built.ask()
    assert len({row.tobytes() for row in first.get("X")}) < len(first) == 40


def test_an_algorithm_is_made_anew_each_time_down_to_its_default_operators(tmp_path):
    spelled = "[{class: pymoo.algorithms.moo.spea2.SPEA2}]"
    (algorithm,) = read_experiment_file(changed(tmp_path, algorithms=spelled)).algorithms
    assert algorithm.build().survival is not algorithm.build().survival


def test_the_description_of_an_algorithm_tells_settings_apart():
    assert settings(OAX()) != settings(OAX("L8"))
    assert settings(SubsetUniformCrossover(0.8)) == settings(SubsetUniformCrossover())
    assert settings(SubsetUniformCrossover(0.7)) != settings(SubsetUniformCrossover())


def test_an_operator_of_the_readers_is_another_one_once_its_module_is_changed(tmp_path, monkeypatch):
    def described() -> dict[str, object]:
        (algorithm,) = read_experiment_file(config).algorithms
        found = algorithm.description()["settings"]
        assert "code" not in found  # the algorithm is pymoo's
        assert "code" not in found["crossover"]
        return found["mutation"]

    config = changed(tmp_path, algorithms="[{preset: nsga2_v1, operators: {mutation: readers_own.Same}}]")
    module = tmp_path / "readers_own.py"
    text = "from pymoo.core.mutation import Mutation\nclass Same(Mutation):\n    def _do(self, problem, X, **kwargs):\n"
    module.write_text(f"{text}        return X\n")
    monkeypatch.syspath_prepend(tmp_path)
    first = described()
    assert first == described()
    module.write_text(f"{text}        return X.copy()\n")
    monkeypatch.delitem(sys.modules, "readers_own")
    importlib.invalidate_caches()
    second = described()
    assert first.pop("code") != second.pop("code")
    assert first == second


def test_what_a_readers_operator_raises_is_said_with_its_line(tmp_path, monkeypatch):
    text = "from pymoo.core.mutation import Mutation\nclass Wrong(Mutation):\n    def _do(self, problem, X, **k):\n"
    text += "        X = X.copy()\n        return X[:, problem.vertices]\n"
    (tmp_path / "readers_wrong.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    config = changed(tmp_path, algorithms="[{preset: nsga2_v1, operators: {mutation: readers_wrong.Wrong}}]")
    with pytest.raises(ConfigError, match=r"no attribute 'vertices'.* \(readers_wrong\.py, line 5\)"):
        read_experiment_file(config)


OWN = """
import numpy as np
from pymoo.core.crossover import Crossover
from pymoo.core.duplicate import DuplicateElimination
from pymoo.core.mutation import Mutation
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling


class M(Mutation):
    def _do(self, problem, X, random_state=None, **kwargs):
        return {}


class C(Crossover):
    def __init__(self):
        super().__init__(2, 2)

    def _do(self, problem, X, random_state=None, **kwargs):
        return {}


class S(Sampling):
    def _do(self, problem, n_samples, random_state=None, **kwargs):
        return {}


class R(Repair):
    def _do(self, problem, X, random_state=None, **kwargs):
        return {}


class D(DuplicateElimination):
    def _do(self, pop, other, is_duplicate):
        return {}
"""


def with_own(tmp_path, monkeypatch, kind: str, returned: str) -> Path:
    """Write a configuration with an operator of a kind that returns what an expression gives."""
    (tmp_path / "readers_kinds.py").write_text(OWN.replace("{}", returned))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "readers_kinds", raising=False)
    importlib.invalidate_caches()
    name = f"readers_kinds.{kind[0].upper()}"
    return changed(tmp_path, algorithms=f"[{{preset: nsga2_v1, operators: {{{kind}: {name}}}}}]")


@pytest.mark.parametrize(
    ("kind", "returned", "said"),
    [
        ("mutation", "X[:, 1:].astype(float)", "float64 (100, 80); expected bool (100, 81)"),
        ("mutation", "X * 1", "int64 (100, 81); expected bool (100, 81)"),
        ("mutation", "None", "nothing; end _do with return an array like X"),
        ("mutation", "list(X)", "a list; expected bool (100, 81)"),
        ("crossover", "X[:1]", "bool (1, 50, 81); expected bool (2, 50, 81)"),
        ("sampling", "np.ones((n_samples, 80), bool)", "bool (100, 80); expected bool (100, 81)"),
        ("sampling", "None", "nothing; end _do with return X"),
        ("repair", "X[1:]", "bool (99, 81); expected bool (100, 81)"),
        ("duplicates", "None", "nothing; end _do with return is_duplicate"),
        ("duplicates", "1.0 * is_duplicate", "float64 (100,); expected bool (100,)"),
    ],
)
def test_what_a_readers_operator_returns_is_named_where_it_is_not_what_pymoo_takes(
    kind, returned, said, tmp_path, monkeypatch
):
    config = with_own(tmp_path, monkeypatch, kind, returned)
    name = f"readers_kinds.{kind[0].upper()}"
    assert f"on 'pyramid:9', a trial: {kind} {name} returned {said}" in message(config)
    operator = sys.modules["readers_kinds"]
    assert getattr(operator, kind[0].upper())._do.__module__ == "readers_kinds"
    assert not hasattr(getattr(operator, kind[0].upper())._do, "__wrapped__")  # as it was before the trial


def test_a_readers_sampling_may_return_rows_in_a_list(tmp_path, monkeypatch):
    row = "random_state.random(problem.n_var) < 0.5"
    read_experiment_file(with_own(tmp_path, monkeypatch, "sampling", f"[{row} for _ in range(n_samples)]"))


@pytest.mark.parametrize(
    ("chance", "repeats"),
    [("random_state.random", True), ("np.random.random", False), ("np.random.default_rng().random", False)],
)
def test_chance_that_does_not_come_from_the_seed_is_found_in_the_trial(chance, repeats, tmp_path, monkeypatch):
    config = with_own(tmp_path, monkeypatch, "mutation", f"X ^ ({chance}(X.shape) < 0.1)")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ExperimentWarning)
        read_experiment_file(config)
    said = [str(warning.message) for warning in caught]
    line = "nsga2_v1: the same seed gave two different results on the trial; take all chance from random_state, else "
    assert said == ([] if repeats else [f"{line}no run repeats"])


def test_the_name_of_a_model_file_does_not_change_what_the_problem_is(tmp_path):
    source = load("pyramid:9")
    for name in ("one.ply", "other.ply"):
        write_mesh(tmp_path / name, source.points, source.faces)
    one, other = read_experiment_file(changed(tmp_path, problems="[one.ply, other.ply]")).problems
    assert one.description() == other.description()
    assert one.name == "one"


def test_models_are_looked_for_beside_the_configuration_or_in_the_folder_it_names(tmp_path, monkeypatch):
    source = load("pyramid:9")
    (tmp_path / "scans").mkdir()
    write_mesh(tmp_path / "scans" / "a.ply", source.points, source.faces)
    monkeypatch.chdir(os.sep)
    path = changed(tmp_path, folder="scans", problems="[a.ply]")
    assert read_experiment_file(path).problems[0].model.n_vertices == 81
    beside = changed(tmp_path, problems="[scans/a.ply]")
    assert read_experiment_file(beside).problems[0].model.n_vertices == 81
    elsewhere = changed(tmp_path, folder="nowhere", problems="[a.ply]")
    assert read_experiment_file(elsewhere, folder=tmp_path / "scans").problems[0].model.n_vertices == 81


def test_a_problem_may_minimise_another_measure_and_weigh_the_vertices(tmp_path):
    source = load("pyramid:9")
    write_mesh(tmp_path / "a.ply", source.points, source.faces, {"importance": np.arange(81.0)})
    path = changed(tmp_path, problem="{objectives: [rms_error, triangles], weights: importance}", problems="[a.ply]")
    (problem,) = read_experiment_file(path).problems
    built = problem.build()
    assert built.objectives == ("rms_error", "triangles")
    assert built.model.total_weight == 81 * 40
    plain = read_experiment_file(changed(tmp_path, problem=None, problems="[a.ply]")).problems[0]
    assert problem.description() != plain.description()


# (keys changed, what the message must say, in this order)
MISTAKES = {
    "unknown key": ({"sedes": "[1]"}, ["line 6", "sedes", "unknown key", "'seeds'"]),
    "missing key": ({"seeds": None}, ["'seeds' is missing"]),
    "key twice": ({"title": "a\ntitle: b"}, ["line 7", "title", "twice"]),
    "not a mapping": ({"budgets": "[3]"}, ["line 5", "budgets[0]", "3", "mapping"]),
    "not a list": ({"seeds": "1"}, ["line 4", "seeds", "1", "list"]),
    "no seed": ({"seeds": "[]"}, ["seeds", "empty", "at least one seed"]),
    "seed twice": ({"seeds": "[3, 1, 3]"}, ["seeds[2]", "3", "twice"]),
    "seed negative": ({"seeds": "[-1]"}, ["seeds[0]", "-1", "at least 0"]),
    "seed is text": ({"seeds": "[one]"}, ["seeds[0]", "'one'", "whole number"]),
    "seed is no whole number": ({"seeds": "[1.5]"}, ["seeds[0]", "1.5", "whole number"]),
    "seed is true": ({"seeds": "[true]"}, ["seeds[0]", "true", "whole number"]),
    "seed is nothing": ({"seeds": "[null]"}, ["seeds[0]", "null", "whole number"]),
    "no problem": ({"problems": "[]"}, ["problems", "at least one problem"]),
    "problem name twice": (
        {"problems": '[{name: A, model: "roof:5"}, {name: A, model: "pyramid:9"}]'},
        ["problems[1]", "'A'", "twice"],
    ),
    "model missing": ({"problems": "[{name: A}]"}, ["problems[0]", "'model' is missing"]),
    "model file missing": ({"problems": "[gone.ply]"}, ["problems[0]", "gone.ply", "no file"]),
    "model folder missing": ({"folder": "gone", "problems": "[a.ply]"}, ["a.ply", "no folder", "--models"]),
    "model name unknown": ({"problems": "[pyramide]"}, ["problems[0]", "pyramide", "'pyramid'"]),
    "model parameter unknown": ({"problems": '["pyramid:sid=9"]'}, ["problems[0]", "'sid'", "'side'"]),
    "option unknown": (
        {"problems": "[{model: pyramid, fotprint: hull}]"},
        ["problems[0].fotprint", "unknown key", "'footprint'"],
    ),
    "unknown key with its line and value": (
        {"title": "a\nproblem:\n  footprint: hull\n  max_edges: 3", "problem": None},
        ["line 8", "problem.max_edges: 3: unknown key", "'max_edge'", "known here: surface, up, "],
    ),
    "baselines are nothing": ({"baselines": ""}, ["baselines: nothing: expected true, or a list of some of quadric_c"]),
    "no baseline": ({"baselines": "[]"}, ["baselines: expected true, or a list"]),
    "a number for true or false": (
        {"baselines": "{down_to_fronts: 1}"},
        ["baselines.down_to_fronts: 1: expected true or false"],
    ),
    "tag on a list": (
        {"algorithms": "[{preset: nsga2_v1, parameters: {pop_size: !!python/tuple [1]}}]"},
        ["algorithms[0].parameters.pop_size", "the tag", "python/tuple' is not understood"],
    ),
    "option value unknown": ({"problem": "{footprint: hul}"}, ["problem.footprint", "'hul'", "'hull'"]),
    "option of wrong type": ({"problem": "{max_objective: small}"}, ["problem.max_objective", "'small'", "number"]),
    "objective unknown": ({"problem": "{objectives: [errror, triangles]}"}, ["problem.objectives", "rms_error"]),
    "three objectives": (
        {"problem": "{objectives: [error, max_error, triangles]}"},
        ["problem.objectives", "two objectives", "nsga3()"],
    ),
    "weights not in the file": ({"problem": "{weights: sharpness}"}, ["problems[0]", "'sharpness'", "it has: none"]),
    "pin impossible": ({"problem": "{pin: [100000]}"}, ["problems[0]", "100000"]),
    "up impossible": ({"problem": "{up: [0, 0, 0]}"}, ["problem.up", "not all 0"]),
    "no algorithm": ({"algorithms": "[]"}, ["algorithms", "at least one algorithm"]),
    "algorithm name twice": ({"algorithms": "[nsga2_v1, nsga2_v1]"}, ["algorithms[1]", "'nsga2_v1'", "twice"]),
    "preset unknown": ({"algorithms": "[nsga2_v3]"}, ["algorithms[0]", "'nsga2_v3'", "did you mean 'nsga2_v"]),
    "preset and class": (
        {"algorithms": "[{preset: moead, class: pymoo.x}]"},
        ["algorithms[0]", "one of 'preset'", "'class' (an import path)", "not preset and class"],
    ),
    "parameter unknown": (
        {"algorithms": "[{preset: nsga2_v1, parameters: {pop_sise: 9}}]"},
        ["algorithms[0].parameters.pop_sise", "no such parameter", "'pop_size'"],
    ),
    "parameter impossible": (
        {"algorithms": "[{preset: moead, parameters: {pop_size: 1}}]"},
        ["algorithms[0]", "'moead' cannot be made", "pop_size = 1"],
    ),
    "parameter of wrong type": (
        {"algorithms": "[{preset: nsga2_v1, parameters: {pop_size: many}}]"},
        ["algorithms[0]", "'nsga2_v1'", "Error"],
    ),
    "parameter infinite": (
        {"algorithms": "[{preset: nsga2_v1, parameters: {pop_size: .inf}}]"},
        ["algorithms[0].parameters.pop_size", "finite"],
    ),
    "parameter is a date": (
        {"algorithms": "[{preset: nsga2_v1, parameters: {pop_size: 2020-01-01}}]"},
        ["algorithms[0].parameters.pop_size", "2020-01-01", "date is not understood"],
    ),
    "weight missing": ({"algorithms": "[weighted_ga_v1]"}, ["algorithms[0]", "'w'"]),
    "weight impossible": (
        {"algorithms": "[{preset: weighted_ga_v1, merged_over: {w: [0.5, 1.5]}}]"},
        ["algorithms[0]", "w = 1.5"],
    ),
    "weight twice": (
        {"algorithms": "[{preset: weighted_ga_v1, merged_over: {w: [0.5, 0.5]}}]"},
        ["merged_over.w", "twice"],
    ),
    "weight is a text": (
        {"algorithms": "[{preset: weighted_ga_v1, parameters: {w: 1e-3}}]"},
        ["algorithms[0]", "'weighted_ga_v1'"],
    ),
    "operator in the wrong place": (
        {"algorithms": "[{preset: nsga2_v1, parameters: {crossover: oax}}]"},
        ["parameters.crossover", "'oax'", "under 'operators'"],
    ),
    "operator kind unknown": (
        {"algorithms": "[{preset: nsga2_v1, operators: {crosover: oax}}]"},
        ["operators.crosover", "unknown key", "'crossover'"],
    ),
    "operator unknown": (
        {"algorithms": "[{preset: nsga2_v1, operators: {crossover: uniforn}}]"},
        ["operators.crossover", "'uniforn'", "'uniform'"],
    ),
    "operator parameter unknown": (
        {"algorithms": "[{preset: nsga2_v1, operators: {crossover: {name: oax, array: L4}}}]"},
        ["operators.crossover.array", "'arrays'"],
    ),
    "operator parameter impossible": (
        {"algorithms": "[{preset: nsga2_v1, operators: {crossover: {name: oax, arrays: L5}}}]"},
        ["operators.crossover", "'L5'", "L4, L8, L16"],
    ),
    "operator that makes real numbers": (
        {"algorithms": "[{preset: nsga2_v1, operators: {sampling: pymoo.operators.sampling.rnd.FloatRandomSampling}}]"},
        ["algorithms[0]", "fails on", "bool"],
    ),
    "import path wrong": (
        {"algorithms": "[{class: pymoo.algorithms.moo.spea2.SPEA3}]"},
        ["algorithms[0].class", "no 'SPEA3'", "'SPEA2'"],
    ),
    "import of nothing": ({"algorithms": "[{class: pymoo.nowhere.X}]"}, ["class", "cannot be imported"]),
    "import of what is not installed": (
        {"algorithms": "[{class: nowhere.X}]"},
        ["class", "cannot be imported", "install the package", "PYTHONPATH"],
    ),
    "import of no algorithm": (
        {"algorithms": "[{class: pathlib.Path}]"},
        ["algorithms[0].class", "'pathlib.Path'", "no pymoo algorithm"],
    ),
    "single-objective algorithm": (
        {"algorithms": "[{class: pymoo.algorithms.soo.nonconvex.ga.GA}]"},
        ["algorithms[0]", "'GA' fails on", "minimises one number", "merged_over: {w: [0, 0.5, 1]}"],
    ),
    "single-objective algorithm with a weight that is none": (
        {"algorithms": "[{class: pymoo.algorithms.soo.nonconvex.ga.GA, merged_over: {w: [0.5, 7]}}]"},
        ["algorithms[0]", "w = 7", "probability"],
    ),
    "algorithm that asks a person": (
        {"algorithms": "[{class: pymoo.algorithms.moo.pinsga2.PINSGA2}]"},
        ["algorithms[0].class", "PINSGA2 asks a person"],
    ),
    "what the algorithm sets itself": (
        {"algorithms": "[{class: pymoo.algorithms.moo.moead.MOEAD, parameters: {ref_dirs: 5, pop_size: 9}}]"},
        ["algorithms[0].parameters.pop_size", "no such parameter", "it takes:"],
    ),
    "directions missing": (
        {"algorithms": "[{class: pymoo.algorithms.moo.moead.MOEAD}]"},
        ["algorithms[0]", "'MOEAD' cannot be made without ref_dirs", "a number of directions"],
    ),
    "points that are no pairs": (
        {"algorithms": "[{class: pymoo.algorithms.moo.rnsga2.RNSGA2, parameters: {ref_points: [1.0, 2.0]}}]"},
        ["algorithms[0].parameters.ref_points", "expected a list of pairs, [error, triangles]"],
    ),
    "points of unequal length": (
        {"algorithms": "[{class: pymoo.algorithms.moo.rnsga2.RNSGA2, parameters: {ref_points: [[1.0, 2.0], [3.0]]}}]"},
        ["algorithms[0].parameters.ref_points", "expected rows of equal length"],
    ),
    "an algorithm of real numbers": (
        {"algorithms": "[{class: pymoo.algorithms.moo.nsde.NSDE}]"},
        ["algorithms[0]", "calculates with variables as real numbers"],
    ),
    "a base class": (
        {"algorithms": "[{class: pymoo.core.algorithm.Algorithm}]"},
        ["algorithms[0]", "'Algorithm' fails on", "no front"],
    ),
    "constraints for MOEA/D": (
        {"problem": "{max_triangles: 50}", "algorithms": "[moead]"},
        ["algorithms[0]", "problem 'A'", "no constraints"],
    ),
    "no budget": ({"budgets": "[]"}, ["budgets", "at least one budget"]),
    "two kinds of budget": ({"budgets": "[{generations: 2, seconds: 3}]"}, ["budgets[0]", "one of"]),
    "budget twice": ({"budgets": "[{generations: 2}, {generations: 2}]"}, ["budgets[1]", "'2 generations'"]),
    "budget of nothing": ({"budgets": "[{evaluations: 0}]"}, ["budgets[0].evaluations", "0", "at least 1"]),
    "budget of half a move": ({"budgets": "[{moves: 0.5}]"}, ["budgets[0].moves", "0.5", "whole number"]),
    "budget shared in part": ({"budgets": "[{moves: 5, shared: 2}]"}, ["budgets[0].shared", "2", "true or false"]),
    "no budget for memetic": (
        {"algorithms": "[nsga2_v1, memetic]", "budgets": "[{generations: 2}, {evaluations: 90}]"},
        [
            "line 3",
            "algorithms[1]",
            "fits memetic, whose work is measured by moves or seconds; add one under 'budgets'",
        ],
    ),
    "no budget but moves": (
        {"budgets": "[{moves: 100}]"},
        ["line 3", "algorithms[0]", "fits N, whose work is measured by generations, evaluations or seconds; add one"],
    ),
    "budget of no time": ({"budgets": "[{seconds: 0}]"}, ["budgets[0].seconds", "more than 0"]),
    "MeshLab method unknown": (
        {"baselines": "{methods: [quadric_colapse]}"},
        ["baselines.methods[0]", "'quadric_collapse'"],
    ),
    "baseline unknown": ({"baselines": "[thinning, meshlap]"}, ["baselines[1]: 'meshlap'", "did you mean 'meshlab'?"]),
    "baseline twice": (
        {"baselines": "[insertion, insertion_by_point]"},
        ["baselines[1]: 'insertion_by_point' is there twice"],
    ),
    "baselines' key unknown": ({"baselines": "{step: 3}"}, ["baselines.step", "'steps'"]),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_answered_with_place_value_and_what_was_expected(case, tmp_path):
    parts, expected = MISTAKES[case]
    line = message(changed(tmp_path, **parts))
    rest = line
    for word in expected:
        assert word in rest, f"{word!r} is missing, or out of order, in: {line}"
        rest = rest[rest.index(word) :]


def test_the_configuration_of_the_mistakes_is_good_without_them(tmp_path):
    assert len(read_experiment_file(changed(tmp_path)).problems) == 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is empty"),
        ("problems: [", "line 1"),
        ("a: 1\n b: 2\n", "is no YAML"),
        ("problems: !!python/object/apply:os.system [echo]\n", "unknown|missing|expected|understood"),
        ("[" * 100_000, "nested too deeply"),
        ("&a [*a]", "contains itself"),
        ("a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
            f"{chr(98 + k)}: &{chr(98 + k)} [{', '.join(['*' + chr(97 + k)] * 10)}]\n" for k in range(8)
        ), "once aliases are replaced"),
        ("".join(f"a{k}: &a{k} [{f'*a{k - 1}' if k else ''}]\n" for k in range(60)), "nested too deeply"),
        ("seeds: [" + "1, " * 400_000 + "]", "bytes"),
        ("title: \x00", "is no YAML"),
    ],
    ids=["empty", "open list", "indentation", "tag", "depth", "cycle", "aliases", "deep aliases", "size", "control"],
)  # fmt: skip
def test_what_is_no_configuration_is_refused_without_harm(text, expected, tmp_path):
    path = write(tmp_path, text)
    with pytest.raises(ConfigError, match=expected):
        read_experiment_file(path)


def test_what_does_not_fit_into_memory_is_named_with_its_place(tmp_path, monkeypatch):
    def too_large(*_, **__):
        raise MemoryError

    monkeypatch.setattr("meshsimp_pymoo.problem.MeshProblem.__init__", too_large)
    line = message(changed(tmp_path, problems="[{name: A, model: 'pyramid:9'}]"))
    assert re.search(r"line 2: problems\[0\]\S*: .*does not fit into memory; make it smaller", line)


def test_a_binary_file_and_a_missing_one_are_named(tmp_path):
    (tmp_path / "x.yaml").write_bytes(b"\xff\xfe\x00\x80")
    assert "UTF-8" in message(tmp_path / "x.yaml")
    assert "no such file" in message(tmp_path / "y.yaml")
    gone = tmp_path / "gone"
    assert "no such folder" in message(changed(tmp_path), names=gone, folder=gone)


def test_a_tag_cannot_make_python_objects(tmp_path):
    line = message(changed(tmp_path, title="!!python/object/apply:os.getcwd []"))
    assert "title" in line
    line = message(changed(tmp_path, seeds='[!!python/name:os.system ""]'))
    assert "seeds[0]" in line


@pytest.mark.parametrize(
    "model", ["../secret.ply", "/etc/secret.ply", "a/../../secret.ply", "C:\\\\a.ply", "a\\\\..\\\\..\\\\b.ply"]
)
def test_a_configuration_names_no_model_outside_the_folder_of_models(tmp_path, model):
    (tmp_path / "in").mkdir()
    line = message(changed(tmp_path / "in", problems=f'["{model}"]'))
    assert "leads out of the folder of models" in line
    line = message(changed(tmp_path / "in", folder=f'"{model}"', problems='["a.ply"]'))
    assert "leads out of the folder of the configuration; name the folder of the models by --models" in line


@pytest.mark.parametrize(
    ("algorithms", "said"),
    [
        ("[{class: os.system}]", "is a part of Python, which is not imported"),
        ("[{class: antigravity.X}]", "is a part of Python"),
        ("[{preset: nsga2_v1, operators: {crossover: {name: subprocess.Popen, args: [touch, hurt]}}}]",
         "is a part of Python"),
        ("[{preset: nsga2_v1, operators: {crossover: {name: numpy.fromfile, file: hurt}}}]", "is no pymoo crossover"),
        ("[{preset: nsga2_v1, operators: {mutation: pymoo.operators.sampling.rnd.FloatRandomSampling}}]",
         "is no pymoo mutation operator"),
    ],
)  # fmt: skip
def test_nothing_but_pymoos_own_kinds_is_called(tmp_path, algorithms, said, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said in message(changed(tmp_path, algorithms=algorithms))
    assert not (tmp_path / "hurt").exists()


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"algorithms": "[{preset: nsga2_v1, parameters: {pop_size: 1000000000}}]"}, "expected at most 5,000"),
        ({"algorithms": "[{class: pymoo.algorithms.moo.nsga3.NSGA3, parameters: {ref_dirs: 100000000}}]"},
         "at most 5,000"),
        ({"seeds": f"[{'9' * 400}]"}, "at most 2\\*\\*53"),
        ({"budgets": f"[{{generations: {'9' * 400}}}]"}, "at most 2\\*\\*53"),
        ({"budgets": f"[{{seconds: {'9' * 400}}}]"}, "no larger than 1e\\+300"),
        ({"problems": f"['{'x' * 300}.ply']"}, "too long"),
    ],
)  # fmt: skip
def test_numbers_and_names_that_nobody_means_are_refused_at_once(tmp_path, parts, said):
    path = changed(tmp_path, **parts)
    with pytest.raises(ConfigError, match=said):
        read_experiment_file(path)


@pytest.mark.parametrize("text", ["[" * 200_000, "{" * 100_000, "- " * 100_000, "- a\n" * 60_000, "#\n" * 100_000,
                                  "a:" * 100_000, '"' + "\\n" * 100_000])  # fmt: skip
def test_the_reader_takes_no_longer_than_seconds_whatever_it_is_given(tmp_path, text):
    path = write(tmp_path, text)
    start = time.process_time()
    with pytest.raises(ConfigError):
        read_experiment_file(path)
    assert time.process_time() - start < 5
