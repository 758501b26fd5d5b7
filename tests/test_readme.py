"""What the README says is so: its Python and YAML run, its commands parse, its files are there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import yaml

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.cli.parser import make_parser
from meshsimp_pymoo.comparison.config import read_experiment_file
from meshsimp_pymoo.search.operators import OPERATORS
from meshsimp_pymoo.search.presets import PRESETS

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """Return the code blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Run all Python of the page in one session; return the folder, what is defined, and what was printed."""
    folder = tmp_path_factory.mktemp("readme")
    printed: list[str] = []
    names = {"print": lambda *values: printed.append(" ".join(map(str, values)))}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in blocks("python"):
            exec(compile(block, "README.md", "exec"), names)
    return folder, names, printed


def test_the_python_of_the_page_runs_and_prints_what_the_page_says(session):
    folder, _, printed = session
    assert (folder / "small.ply").stat().st_size > 0
    *roof, gained = printed
    assert len(roof) == 3
    for line in roof:
        assert f"# {line}" in README
    assert gained == "True"


def test_the_operator_of_the_page_keeps_the_promises_of_an_operator(session):
    _, names, _ = session
    problem = MeshProblem("peaks:12")
    X = np.ones((40, problem.n_var), dtype=bool)
    X.flags.writeable = False
    children = [names["ClearDisc"]()._do(problem, X, random_state=np.random.default_rng(5)) for _ in range(2)]
    assert (children[0] == children[1]).all()
    assert children[0].dtype == bool
    dropped = (~children[0]).sum(axis=1)
    assert 0 < dropped.mean() < problem.n_var / 4


def test_the_indicator_of_the_page_is_the_least_error_at_a_size(session):
    _, names, _ = session
    assert names["ErrorAt"](4)(np.array([[9.0, 2], [3.0, 4], [1.0, 5]])) == 3.0


def test_what_is_added_takes_ten_lines(session):
    operator, indicator = blocks("python")[-2:]
    for block in (operator, indicator):
        (written,) = re.findall(r"^class .*?(?=^\S)", block + "end", re.MULTILINE | re.DOTALL)
        assert len([line for line in written.splitlines() if line.strip()]) <= 10


def test_the_yaml_of_the_page_is_an_experiment(tmp_path):
    (block,) = blocks("yaml")
    path = tmp_path / "mine.yaml"
    path.write_text(block, encoding="utf-8")
    experiment = read_experiment_file(path)
    assert [problem.name for problem in experiment.problems] == ["face:300", "Terrain"]
    assert [algorithm.name for algorithm in experiment.algorithms] == ["nsga2_v1", "memetic", "Large"]


def test_every_command_of_the_page_is_one_that_the_parser_takes():
    in_prose = re.findall(r"`(meshsimp \w+ [^`]*)`", README)  # `meshsimp run` alone is a name
    in_blocks = [line for block in blocks("sh") for line in block.splitlines() if line.startswith("meshsimp ")]
    assert len(in_blocks) > 4
    assert len(in_prose) > 4
    for command in in_blocks + in_prose:
        make_parser().parse_args(shlex.split(command, comments=True)[1:])


def test_every_file_that_the_page_points_to_is_there():
    pointed = set(re.findall(r"\]\((?!http)([^)#]+)\)", README)) | set(
        re.findall(r"(?<![\w/])((?:configs|tests|meshsimp_pymoo)/[\w./]+\w)", README)
    )
    assert len(pointed) > 6
    assert [name for name in sorted(pointed) if not (ROOT / name).exists()] == []


@pytest.mark.parametrize("path", sorted((ROOT / "docs").glob("*.md")), ids=lambda path: path.stem)
def test_the_other_pages_name_commands_that_the_parser_takes_and_files_that_are_there(path):
    page = path.read_text(encoding="utf-8")
    for command in re.findall(r"^(meshsimp .*)$", page, re.MULTILINE):
        make_parser().parse_args(shlex.split(command, comments=True)[1:])
    for block in re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        compile(block, path.name, "exec")
    pointed = {path.parent / name for name in re.findall(r"\]\((?!http)([^)#]+)[^)]*\)", page)}
    pointed |= {
        ROOT / name for name in re.findall(r"(?<![\w/])((?:configs|docs|tests|meshsimp_pymoo)/[\w./]+\w)", page)
    }
    assert [str(name) for name in sorted(pointed) if not name.exists()] == []


def test_the_commented_configuration_names_every_preset_and_operator():
    text = (ROOT / "configs" / "quick.yaml").read_text(encoding="utf-8")
    names = {*PRESETS, *OPERATORS, *(name for table in OPERATORS.values() for name in table)}
    assert [name for name in sorted(names) if not re.search(rf"\b{name}\b", text)] == []


@pytest.mark.parametrize("path", sorted((ROOT / "configs").glob("*.yaml")), ids=lambda path: path.stem)
def test_the_configurations_that_come_with_it_can_be_read(path, tmp_path, request):
    folder = request.getfixturevalue("shared_data") if path.stem == "scans" else None
    experiment = read_experiment_file(path, folder=folder)
    assert len(experiment.problems) >= 3
    assert yaml.safe_load(path.read_text(encoding="utf-8"))["title"] == experiment.title


def test_the_constraint_of_the_contributors_page_is_one():
    (block,) = re.findall(r"^```python\n(.*?)^```$", (ROOT / "CONTRIBUTING.md").read_text("utf-8"), re.M | re.S)
    names = {"MeshProblem": MeshProblem}
    exec(compile(block, "CONTRIBUTING.md", "exec"), names)
    for limits, first in (({}, 0), ({"max_triangles": 3}, 1)):
        problem = names["Covering"]("horseshoe:60", **limits)
        got = problem.evaluate(np.stack([problem.pinned, np.ones(problem.n_var, bool)]), return_as_dictionary=True)
        assert got["G"].shape == (2, 1 + first)
        assert got["G"][:, -1].tolist() == got["uncovered"].tolist()
        if limits:
            assert got["G"][:, 0].tolist() == (got["F"][:, 1] - 3).tolist()


def test_each_recipe_names_places_that_are_there():
    page = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    named = set(re.findall(r"`((?:\w+/)+(?:\w+\.py)?|\w+\.py)`", page)) - {"docs/"}
    roots = (ROOT, ROOT / "meshsimp_pymoo")
    assert len(named) > 10
    assert [name for name in sorted(named) if not any((root / name).exists() for root in roots)] == []
