"""The founding paper's settings, and its table of clauses: whatever that names is there."""

from __future__ import annotations

import ast
import importlib
import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshsimp_pymoo import OAX, MeshProblem, NeighbourShift, PinnedCorners, RandomSubset, SubsetUniformCrossover
from meshsimp_pymoo.comparison.findings import CLAIMS, PAPER_CLASSIC
from meshsimp_pymoo.search.presets import PRESETS

ROOT = Path(__file__).parents[1]
HEAD = ["clause", "where", "verdict", "tests"]
ROWS = [
    [cell.strip() for cell in line.strip().strip("|").split("|")]
    for line in (ROOT / "docs" / "explanation" / "paper.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("| ")
]
CLAUSES = [row for row in ROWS if row != HEAD]


def quoted(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def names_of_tests(path: Path) -> set[str]:
    """The names of the tests of a file, as pytest gives them."""
    names: set[str] = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}::{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
        elif isinstance(node, ast.FunctionDef):
            names.add(node.name)
    return {name for name in names if name.rpartition("::")[2].startswith("test_")}


def object_at(dotted: str) -> Any:
    """What stands at a path below the package."""
    parts = dotted.split(".")
    for split in range(len(parts), 0, -1):
        try:
            found: Any = importlib.import_module(".".join(["meshsimp_pymoo", *parts[:split]]))
        except ModuleNotFoundError:
            continue
        for name in parts[split:]:
            found = getattr(found, name)
        return found
    raise AssertionError(f"no module of {dotted}")


def test_every_table_has_the_four_columns_and_the_paper_is_there_from_equation_1_to_11() -> None:
    assert [len(row) for row in ROWS] == [4] * len(ROWS)
    assert len(ROWS) - len(CLAUSES) == 6
    named: set[int] = set()
    for equations in re.findall(r"Eq\. ([\d, and]+)", " ".join(row[0] for row in CLAUSES)):
        named |= {int(number) for number in re.findall(r"\d+", equations)}
    assert named >= set(range(1, 12))
    sections = {section for row in CLAUSES for section in re.findall(r"\b[34]\.\d", row[0])}
    assert sections == {f"3.{k}" for k in range(1, 9)} | {f"4.{k}" for k in range(1, 8)}


@pytest.mark.parametrize("row", CLAUSES, ids=lambda row: row[0][:40])
def test_what_a_row_names_is_there(row: list[str]) -> None:
    _, where, verdict, tests = row
    assert verdict.split(":")[0].split(";")[0]
    assert quoted(where)
    for place in quoted(where):
        assert (ROOT / place).is_file() if "/" in place else object_at(place) is not None, place
    assert quoted(tests)
    for test in quoted(tests):
        path, _, name = test.partition("::")
        assert name in names_of_tests(ROOT / path), test


def test_the_presets_have_the_papers_settings() -> None:
    problem = MeshProblem("roof:9")
    papers = {name: preset for name, preset in PRESETS.items() if preset.is_the_papers}
    assert set(papers) == {"nsga2_v1", "nsga2_v2", "moead", "weighted_ga_v1", "weighted_ga_v2"}
    for name, preset in papers.items():
        algorithm = preset.function(*([] if preset.whole_front else [0.5]))
        mating = algorithm.mating
        assert (algorithm.pop_size, algorithm.termination) == (100, ("n_gen", 50))
        assert type(mating.crossover) is (OAX if name.endswith("v2") else SubsetUniformCrossover)
        assert mating.crossover.prob.value == 0.8
        assert type(mating.mutation) is NeighbourShift
        assert mating.mutation.along == "vector"
        assert float(mating.mutation.get_prob_var(problem)) == 1 / 81
        assert type(algorithm.repair) is PinnedCorners
        assert type(algorithm.initialization.sampling) is RandomSubset
        assert algorithm.initialization.sampling.size is None
        if name.endswith("v2"):
            assert mating.crossover.arrays == "L4"
    moead = PRESETS["moead"].function()
    assert (moead.n_neighbors, moead.prob_neighbor_mating, moead.normalised) == (20, 1.0, False)
    np.testing.assert_array_equal(moead.ref_dirs.sum(axis=1), 1.0)


def test_every_pair_that_the_paper_compares_is_in_a_claim() -> None:
    methods = {name for name, preset in PRESETS.items() if preset.is_the_papers} | set(PAPER_CLASSIC)
    for indicator in ("coverage", "epsilon"):
        compared: set[frozenset[str]] = set()
        for claim in CLAIMS:
            for first, second in claim.pairs if indicator in claim.indicators else ():
                compared |= {frozenset((first, one)) for one in (PAPER_CLASSIC if second == "classic" else (second,))}
        assert compared == {frozenset(pair) for pair in itertools.combinations(methods, 2)}
