"""What `docs/how-to/extend.md` shows how to write keeps the promises of its kind, and is as short as the page says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from meshsimp_pymoo import MeshProblem

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "how-to" / "extend.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
CLASSES = ["ClearDisc", "Steady", "ErrorAt", "Covering"]


@pytest.fixture(scope="module")
def names():
    """Run what the page imports and defines, not its searches, which are run with the page."""
    found: dict[str, object] = {}
    for block in BLOCKS:
        imported = "\n".join(re.findall(r"^(?:from|import) .*$", block, re.MULTILINE))
        exec(compile(imported, "extend.md", "exec"), found)
        for definition in definitions(block):
            exec(compile(definition, "extend.md", "exec"), found)
    return found


def definitions(block: str) -> list[str]:
    """Return the classes of a block."""
    return re.findall(r"^class .*?(?=^\S)", block + "end", re.MULTILINE | re.DOTALL)


def test_each_takes_about_ten_lines():
    written = [definition for block in BLOCKS for definition in definitions(block)]
    assert re.findall(r"^class (\w+)", "".join(written), re.MULTILINE) == CLASSES
    for definition in written:
        assert len([line for line in definition.splitlines() if line.strip()]) <= 10


def test_the_operator_keeps_the_promises_of_an_operator(names):
    problem = MeshProblem("peaks:12")
    X = np.ones((40, problem.n_var), dtype=bool)
    X.flags.writeable = False
    children = [names["ClearDisc"]()._do(problem, X, random_state=np.random.default_rng(5)) for _ in range(2)]
    assert (children[0] == children[1]).all()
    assert children[0].dtype == bool
    dropped = (~children[0]).sum(axis=1)
    assert 0 < dropped.mean() < problem.n_var / 4


def test_the_algorithm_makes_a_tenth_at_a_time(names):
    algorithm = names["Steady"](pop_size=60)
    assert (algorithm.pop_size, algorithm.n_offsprings) == (60, 6)


def test_the_indicator_is_the_least_error_at_a_size(names):
    assert names["ErrorAt"](4)(np.array([[9.0, 2], [3.0, 4], [1.0, 5]])) == 3.0


def test_the_constraint_is_one(names):
    for limits, first in (({}, 0), ({"max_triangles": 3}, 1)):
        problem = names["Covering"]("horseshoe:60", **limits)
        got = problem.evaluate(np.stack([problem.pinned, np.ones(problem.n_var, bool)]), return_as_dictionary=True)
        assert got["G"].shape == (2, 1 + first)
        assert got["G"][:, -1].tolist() == got["uncovered"].tolist()
        if limits:
            assert got["G"][:, 0].tolist() == (got["F"][:, 1] - 3).tolist()
