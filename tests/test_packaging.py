"""What a release says of itself in several places is the same in all of them."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import yaml

try:
    import tomllib
except ImportError:  # Python 3.10
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
PYPROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = PYPROJECT["project"]
README = (ROOT / "README.md").read_text("utf-8")
# What conda-forge calls otherwise than PyPI.
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


def yaml_of(name: str) -> dict[str, Any]:
    """Return a YAML file of the repository."""
    content: dict[str, Any] = yaml.safe_load((ROOT / name).read_text("utf-8"))
    return content


def test_the_version_is_the_same_everywhere():
    version = PROJECT["version"]
    assert yaml_of("CITATION.cff")["version"] == version
    assert yaml_of("conda/recipe.yaml")["context"]["version"] == version
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert newest is not None
    assert newest[1] == version
    assert metadata.version("meshsimp-pymoo") == version, "install the package again"


def test_the_conda_recipe_needs_what_pip_needs_and_makes_the_same_program():
    recipe = yaml_of("conda/recipe.yaml")
    python, *run = recipe["requirements"]["run"]
    wanted = [re.fullmatch(r"([\w.-]+)(>=[\d.]+)", line) for line in PROJECT["dependencies"]]
    assert run == [f"{CONDA_NAMES.get(line[1], line[1])} {line[2]}" for line in wanted if line]
    assert len(run) == len(wanted)
    assert python == "python >=${{ python_min }}"
    assert PROJECT["requires-python"] == f">={recipe['context']['python_min']}"
    assert recipe["build"]["python"]["entry_points"] == [f"{n} = {at}" for n, at in PROJECT["scripts"].items()]
    host = [line.replace(" >=", ">=") for line in recipe["requirements"]["host"][2:]]
    assert host == PYPROJECT["build-system"]["requires"]
    about = recipe["about"]
    assert (about["license"], about["repository"]) == (PROJECT["license"], PROJECT["urls"]["Source"])


def test_the_citation_names_the_contributors_and_where_things_are():
    citation = yaml_of("CITATION.cff")
    assert citation["authors"] == PROJECT["authors"] == [{"name": "the meshsimp_pymoo contributors"}]
    urls = PROJECT["urls"]
    assert (citation["repository-code"], citation["url"]) == (urls["Source"], urls["Documentation"])


def shown_on_pypi() -> str:
    """Return README.md as hatch-fancy-pypi-readme makes PyPI's page of it."""
    text = README
    for rule in PYPROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(rule["pattern"], rule["replacement"], text)
    return text.replace("$HFPR_VERSION", PROJECT["version"])


def test_pypi_shows_the_readme_with_links_that_work_there():
    shown, at = shown_on_pypi(), f"{PROJECT['urls']['Source']}/"
    linked = re.findall(r'\]\(([^)\s]+)\)|<img [^>]*?src="([^"]+)', shown)
    assert linked
    for target in map("".join, linked):
        assert target.startswith(("https://", "mailto:", "#")), target
        if target.startswith(at):
            how, tag, path = target.removeprefix(at).split("/", 2)
            assert tag == f"v{PROJECT['version']}"
            assert how == ("raw" if path.endswith((".png", ".svg", ".jpg")) else "blob")
            assert (ROOT / path.partition("#")[0]).exists(), path

    # nothing but targets changed, code least of all
    def blocks(text: str) -> list[str]:
        return re.findall(r"^```.*?^```$", text, re.M | re.S)

    assert blocks(shown) == blocks(README)
    assert re.sub(rf"{re.escape(at)}(raw|blob)/v[\d.]+/", "", shown) == README


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("![a](b.png)", "![a](URL/raw/v0/b.png)"),
        ("[![a](b.png)](docs/x.md#y)", "[![a](URL/raw/v0/b.png)](URL/blob/v0/docs/x.md#y)"),
        ('<img width=3 src="b.png">', '<img width=3 src="URL/raw/v0/b.png">'),
        ("[a](https://b.c) [a](#b) ![a](http://b.c/d.png)", None),
        ("see ([a](b.md), [c](d.md))", "see ([a](URL/blob/v0/b.md), [c](URL/blob/v0/d.md))"),
    ],
)
def test_which_links_are_made_absolute(text, expected, monkeypatch):
    monkeypatch.setitem(globals(), "README", text)
    url = PROJECT["urls"]["Source"]
    found = shown_on_pypi().replace(url, "URL").replace(f"/v{PROJECT['version']}/", "/v0/")
    assert found == (expected or text)


def test_constraints_name_every_direct_dependency():
    pinned = {re.split(r"[=; ]", line)[0] for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines()}
    extras = PROJECT["optional-dependencies"].values()
    for line in [*PROJECT["dependencies"], *(line for lines in extras for line in lines)]:
        name = re.split(r"[\[>= ]", line)[0].lower().replace("_", "-")
        assert name in pinned or name == "meshsimp-pymoo", name
