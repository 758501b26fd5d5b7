"""The pages of docs: what they name is there, and the reference leaves nothing out. Their code blocks run elsewhere."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

import meshsimp_pymoo
from meshsimp_pymoo.cli.parser import make_parser
from meshsimp_pymoo.comparison import config
from meshsimp_pymoo.search.operators import OPERATORS
from meshsimp_pymoo.settings import settings_of

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
OWN = ("tutorials", "how-to", "explanation", "reference")
PAGES = sorted([*DOCS.glob("*.md"), *(page for section in OWN for page in DOCS.glob(f"{section}/*.md"))])


def read(page: str) -> str:
    """Return the text of a page of the reference."""
    return (DOCS / "reference" / f"{page}.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def tables():
    """Return the extension that makes tables."""
    pytest.importorskip("sphinx")
    spec = importlib.util.spec_from_file_location("docs_tables", DOCS / "_ext" / "tables.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_every_file_of_the_repository_that_a_page_names_exists():
    named = {
        (page.name, path)
        for page in PAGES
        for path in re.findall(r"\{repo\}`(?:[^`<]*<)?([^`<>#]+)[^`]*`", page.read_text(encoding="utf-8"))
    }
    assert {("yaml.md", f"configs/{name}.yaml") for name in ("quick", "paper", "scans")} <= named
    assert not [place for place in named if not (ROOT / place[1]).exists()]


def test_every_public_name_has_a_page():
    listed = re.findall(r"^   ([\w.]+)$", read("api"), re.MULTILINE)
    assert len(listed) == len(set(listed))
    assert {name for name in listed if "." not in name} == set(meshsimp_pymoo.__all__)


def test_every_command_has_its_section(tables):
    known = tables.commands_of(make_parser())
    sections = re.findall(r"^## meshsimp (\w+)\n\n```\{options-of\} (\w+)\n```$", read("commands"), re.MULTILINE)
    assert sections == [(name, name) for name in known]


def test_the_options_of_a_command_are_all_there(tables):
    parser = tables.command_parser("simplify")
    text = "\n".join(tables.described(parser))
    for action in parser._actions:
        if action.dest != "help":
            spelled = rf"^````{{option}} .*{re.escape([*action.option_strings, action.metavar][0])}"
            assert re.search(spelled, text, re.MULTILINE), action
    assert "At most one of `--time`, `--evaluations`, `--generations`, `--moves`." in text
    assert "(default: memetic)" in text
    assert "%(default)s" not in text


def test_a_table_has_a_cell_for_each_column_in_each_row(tables):
    for name, (header, rows) in tables.TABLES.items():
        made = list(rows())
        assert made, name
        assert {len(row) for row in made} == {len(header)}, name
        assert not [cell for row in made for cell in row if "\n" in cell], name


def test_the_columns_of_a_front_are_explained(tables):
    found = {row[0]: row[1:] for row in tables.front_columns()}
    assert found["`triangles`"][:2] == ("int", "")
    assert found["`max_error`"][:2] == ("float", "model units")
    assert found["`max_error`"][2].startswith("Maximum of d_p over the original vertices")
    assert found["`surface_error`"][2].endswith("Empty where it was not measured.")
    assert found["`refitted_mesh`"][0] == "text"


def test_what_a_shell_would_read_as_markup_is_escaped(tables):
    assert tables.from_help("a_b `c_d` <e>  $f") == r"a\_b `c_d` \<e\> \$f"
    assert tables.from_docstring("See :meth:`~a.b` or\n    ``c``.") == "See {py:meth}`~a.b` or `c`."


def keys(section: str) -> list[str]:
    """Return the keys in the first table of a section of the page on YAML."""
    text = read("yaml").partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    return re.findall(r"^\| `(\w+)`", text, re.MULTILINE)


@pytest.mark.parametrize(
    ("section", "part"),
    [
        ("The file", config._File),
        ("An algorithm", config.AlgorithmConfig),
        ("A budget", config.Budget),
        ("Baselines", config.BaselinesConfig),
    ],
)
def test_every_key_of_an_experiment_is_explained(section, part):
    assert sorted(keys(section)) == sorted(field.alias or name for name, field in part.model_fields.items())


def test_every_key_of_a_problem_is_explained():
    settings = {
        name
        for kind in (meshsimp_pymoo.Options, meshsimp_pymoo.Rules)
        for name, known in settings_of(kind).items()
        if not known.derived
    }
    assert {*keys("A problem")} | settings == {"name", "model", *config.PROBLEM_OPTIONS}


def test_every_kind_of_operator_is_explained():
    assert f"The kinds of operators are {', '.join(f'`{kind}`' for kind in [*OPERATORS][:-1])} and" in read("yaml")
