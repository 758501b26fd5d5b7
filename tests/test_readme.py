"""What the README says is so: its Python runs, its commands parse, its files are there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import trimesh
import yaml

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


def test_the_page_is_short():
    assert len(README.splitlines()) <= 130


def test_the_python_of_the_page_runs_and_writes_its_mesh(session):
    folder, names, printed = session
    assert trimesh.load(folder / "small.ply").faces.shape[1] == 3
    assert names["best"].triangles <= 500
    assert printed == [f"{names['best'].triangles} {names['best'].error}"]


def test_the_table_of_the_page_is_what_the_benchmark_wrote():
    summary = (ROOT / "tests" / "benchmarks" / "quality" / "summary.md").read_text(encoding="utf-8")
    summary = re.sub(r" \(\d+ of \d+\)", "", summary).splitlines()
    rows = [line for line in README.splitlines() if line.startswith("|")]
    assert len(rows) > 6
    assert [row for row in rows if row not in summary] == []


def test_every_command_of_the_page_is_one_that_the_parser_takes():
    in_prose = re.findall(r"`(meshsimp \w+ [^`]*)`", README)  # `meshsimp run` alone is a name
    in_blocks = [line for block in blocks("sh") for line in block.splitlines() if line.startswith("meshsimp ")]
    assert len(in_blocks) > 4
    assert len(in_prose) > 2
    for command in in_blocks + in_prose:
        make_parser().parse_args(shlex.split(command, comments=True)[1:])


def test_every_file_that_the_page_points_to_is_there():
    pointed = set(re.findall(r"\]\((?!http)([^)#]+)\)", README)) | set(
        re.findall(r"(?<![\w/])((?:configs|tests|meshsimp_pymoo)/[\w./]+\w)", README)
    )
    assert len(pointed) > 6
    assert [name for name in sorted(pointed) if not (ROOT / name).exists()] == []


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


def test_each_recipe_names_places_that_are_there():
    page = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    named = set(re.findall(r"`((?:\w+/)+(?:\w+\.py)?|\w+\.py)`", page)) - {"docs/"}
    roots = (ROOT, ROOT / "meshsimp_pymoo")
    assert len(named) > 10
    assert [name for name in sorted(named) if not any((root / name).exists() for root in roots)] == []
