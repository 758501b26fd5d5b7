"""The benchmark of closed surfaces runs, and compares what it says it compares."""

from __future__ import annotations

import csv
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.comparison.meshlab import meshlab_available
from meshsimp_pymoo.datasets import load

needs_meshlab = pytest.mark.usefixtures("meshlab")

# It "measures" how many vertices the simplified mesh has, so that answers are known.
REFEREE = """
def measure(original, simplified, samples):
    with open(simplified) as file:
        n = sum(line.startswith("v ") for line in file)
    return {"vmean": n, "smean": n * samples, "srms": n, "haus": n}
"""


@pytest.fixture(scope="module")
def benchmark():
    path = Path(__file__).parent / "benchmarks" / "closed.py"
    spec = importlib.util.spec_from_file_location("closed_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


@pytest.fixture
def meshlab():
    if not meshlab_available():
        pytest.skip("MeshLab's filters cannot be used here")


def row(benchmark, method, value, share=5.0, model="sphere", **other):
    numbers = {"vmean": value, "smean": value, "srms": value, "haus": value}
    counts = {"vertices": 100, "triangles": 20, "intersecting": 0, "reversed": 0, "seconds": 1.0}
    return benchmark.Row(model=model, share=share, method=method, **(numbers | counts | other))


@needs_meshlab
@pytest.mark.parametrize("whole", [[], ["--whole"]])
def test_it_measures_our_meshes_and_those_of_the_tools_at_equal_triangles(benchmark, tmp_path, whole, capsys):
    (tmp_path / "referee.py").write_text(REFEREE, encoding="utf-8")
    rows_file, tables = tmp_path / "closed.csv", tmp_path / "closed.md"
    options = ["--models", "blob:200", "roof:5", "--shares", "20", "40", "--seconds", "0.1", "--samples", "3"]
    files = ["--referee", str(tmp_path / "referee.py"), "-o", str(rows_file), "-o", str(tables)]
    assert benchmark.main([*options, *files, *whole]) == 0
    assert "left out: roof:5: is a grid" in capsys.readouterr().err
    with rows_file.open(newline="") as file:
        rows = list(csv.DictReader(file))
    n_faces = len(load("blob:200").faces)
    for share in (20.0, 40.0):
        own = {row["method"]: row for row in rows if float(row["share"]) == share}
        assert {benchmark.REFITTED, benchmark.SUBSET, "MeshLab quadric", "MeshLab quadric, onto ends"} <= set(own)
        for one in own.values():
            assert int(one["triangles"]) <= share / 100 * n_faces
            assert float(one["vmean"]) == float(one["smean"]) / 3 == int(one["triangles"]) / 2 + 2
    text = tables.read_text(encoding="utf-8")
    assert "| geometric mean |" in text
    assert "0.1 s of search for " + ("one front of all sizes" if whole else "each mesh") in text


@needs_meshlab
def test_what_is_wrong_with_a_mesh_is_counted(benchmark):
    problem = MeshProblem("tetrahedron:3")
    points, faces = np.array(problem.model.file_points), problem.model.faces
    assert benchmark.reversed_faces(problem, points, faces) == benchmark.intersecting(points, faces) == 0
    turned = faces.copy()
    turned[[1, 5, 7]] = turned[[1, 5, 7]][:, ::-1]
    assert benchmark.reversed_faces(problem, points, turned) == 3
    assert benchmark.reversed_faces(problem, points, faces[:, ::-1]) == len(faces)
    two = np.concatenate([points, -points * 0.9 + 0.01]), np.concatenate([faces, faces[:, ::-1] + len(points)])
    assert benchmark.intersecting(*two) > 4


def test_ours_are_compared_with_the_best_tool_for_each_number_and_subsets_with_those_that_choose_vertices(benchmark):
    rows = [
        row(benchmark, "refitted", 6.0),
        row(benchmark, "subset", 9.0),
        row(benchmark, "pyfqmr", 8.0, haus=3.0),
        row(benchmark, "MeshLab quadric, onto ends", 12.0),
        row(benchmark, "refitted", 24.0, share=10.0),
        row(benchmark, "subset", 8.0, share=10.0),
        row(benchmark, "pyfqmr", 8.0, share=10.0),
        row(benchmark, "MeshLab quadric, onto ends", 8.0, share=10.0),
    ]
    assert benchmark.ratio(rows, rows[0], "smean") == 6.0 / 8.0
    assert benchmark.ratio(rows, rows[0], "haus") == 6.0 / 3.0
    assert benchmark.ratio(rows, rows[1], "smean") == 9.0 / 12.0
    *_, means, goals = benchmark.ratio_table(rows)
    assert float(means[3]) == pytest.approx(np.sqrt(0.75 * 3.0), abs=5e-4)
    assert float(means[7]) == pytest.approx(np.sqrt(0.75), abs=5e-4)
    assert goals[3:5] == ["0.80", "0.90"]
    assert benchmark.worse(rows).endswith(": sphere at 10 %")
    cad = [row(benchmark, r.method, r.smean, r.share, "c_fandisk") for r in rows]
    assert benchmark.worse(cad).endswith(": none")


def test_without_a_referee_or_with_another_sheet_it_stops_in_a_line(benchmark, tmp_path, capsys):
    with pytest.raises(SystemExit, match="is no Python file with a function measure"):
        benchmark.main(["--referee", str(tmp_path / "none.py")])
    with pytest.raises(SystemExit):
        benchmark.main(["--referee", str(tmp_path / "none.py"), "-o", "sheet.xls"])
    assert "sheet.xls: write .csv or .md" in capsys.readouterr().err
