"""The benchmarks of closed surfaces run, and compare what they say they compare."""

from __future__ import annotations

import csv
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.comparison.meshlab import meshlab_available
from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.surface.closed.model import topology

needs_meshlab = pytest.mark.usefixtures("meshlab")

# It "measures" how many vertices the simplified mesh has, so that answers are known.
REFEREE = """
def measure(original, simplified, samples):
    with open(simplified) as file:
        n = sum(line.startswith("v ") for line in file)
    return {"vmean": n, "smean": n * samples, "srms": n, "haus": n}
"""


@pytest.fixture(scope="module")
def benchmarks():
    """Let modules of that folder be imported."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(Path(__file__).parent / "benchmarks")
        yield importlib.import_module
        for name in ("closed_or_height", "closed", "closed_scans"):
            sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def benchmark(benchmarks):
    return benchmarks("closed")


@pytest.fixture(scope="module")
def scans(benchmarks):
    return benchmarks("closed_scans")


@pytest.fixture
def meshlab():
    if not meshlab_available():
        pytest.skip("MeshLab's filters cannot be used here")


def row(benchmark, method, value, share=5.0, model="sphere", lines="", **other):
    numbers = {"vmean": value, "smean": value, "srms": value, "haus": value}
    counts = {"vertices": 100, "triangles": 20, "intersecting": 0, "reversed": 0, "seconds": 1.0}
    rims = {"original_rims": 0, "rims": 0, "rim_mean": 0.0, "rim_max": 0.0}
    return benchmark.Row(model=model, lines=lines, share=share, method=method, **(numbers | counts | rims | other))


def front_patch(folder, name="front", of="face:200"):
    """Write a height field as a front patch into a folder."""
    source = load(of)
    trimesh.Trimesh(source.points, source.faces, process=False).export(folder / f"{name}.ply")
    return source


@needs_meshlab
@pytest.mark.parametrize("whole", [[], ["--whole"]])
def test_it_measures_our_meshes_and_those_of_the_tools_at_equal_triangles(benchmark, tmp_path, whole, capsys):
    (tmp_path / "referee.py").write_text(REFEREE, encoding="utf-8")
    rows_file, tables = tmp_path / "closed.csv", tmp_path / "closed.md"
    options = ["--models", "blob:200", "roof:5", "--shares", "20", "40", "--seconds", "0.1", "--samples", "3"]
    files = ["--referee", str(tmp_path / "referee.py"), "-o", str(rows_file), "-o", str(tables)]
    assert benchmark.main([*options, *files, *whole]) == 0
    said = capsys.readouterr().err
    assert "left out: roof:5: is a grid" in said
    assert "border" not in said  # there is none
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
    assert "rims" not in text
    assert "0.1 s of search for " + ("one front of all sizes" if whole else "each mesh") in text


@needs_meshlab
def test_models_with_holes_are_compared_with_what_keeps_borders_too_and_their_rims_are_measured(
    benchmark, tmp_path, capsys, monkeypatch
):
    few = {"TOOLS": ("quadric_collapse_ends",), "BORDER_TOOLS": ("quadric_collapse_boundary",)}
    for name, tools in few.items():
        monkeypatch.setattr(benchmark, name, tools)
    (tmp_path / "referee.py").write_text(REFEREE, encoding="utf-8")
    front_patch(tmp_path)
    rows_file, tables = tmp_path / "closed.csv", tmp_path / "closed.md"
    options = ["--models", "whole:front", "whole:none", "--shares", "2", "40", "--moves", "3000", "--samples", "3"]
    files = ["--referee", str(tmp_path / "referee.py"), "-o", str(rows_file), "-o", str(tables)]
    assert benchmark.main([*options, *files, "--shared", str(tmp_path)]) == 0
    said = capsys.readouterr().err
    assert "none.ply: is no file" in said
    assert "MeshLab quadric, border kept at 2 % left out: has 20 triangles, not 14" in said
    with rows_file.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["original_rims"] for row in rows} == {"1"}
    at_40 = {row["method"]: row for row in rows if row["share"] == "40.0"}
    assert "MeshLab quadric, border kept" in at_40
    assert "MeshLab quadric, border kept" not in {row["method"] for row in rows if row["share"] == "2.0"}
    # who keeps the border has it, others not
    assert float(at_40["MeshLab quadric, border kept"]["rim_max"]) < 1e-9
    assert all(0.0 < float(at_40[name]["rim_mean"]) < float(at_40[name]["rim_max"]) for name in ("subset", "refitted"))
    text = tables.read_text(encoding="utf-8")
    assert "3,000 moves for each mesh" in text
    assert "| whole:front | 40 | 1 of 1 |" in text


@needs_meshlab
def test_a_patch_is_compared_as_a_height_field_and_as_a_closed_surface(benchmarks, tmp_path):
    (tmp_path / "referee.py").write_text(REFEREE, encoding="utf-8")
    front_patch(tmp_path)
    module, table = benchmarks("closed_or_height"), tmp_path / "table.md"
    options = ["--models", "front", "none", "--shares", "40", "--moves", "3000", "--shared", str(tmp_path)]
    assert module.main([*options, "--referee", str(tmp_path / "referee.py"), "-o", str(table)]) == 0
    lines = [line for line in table.read_text(encoding="utf-8").splitlines() if line.startswith("| 40 |")]
    assert [line.split(" | ")[1] for line in lines] == ["height", "height, refitted", "closed", "closed, refitted"]
    size = int(0.4 * len(load("face:200").faces))
    assert all(int(line.split(" | ")[2]) <= size for line in lines)


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
    above, mean, largest = benchmark.verdicts(rows)
    assert above.endswith(": sphere at 10 %")
    assert mean.endswith(": sphere 1.500 (0.750 at 5 %; 3.000 at 10 %)")
    assert largest.endswith(": none")  # which is asked of parts with sharp edges only
    assert all(line.endswith(": none") for line in benchmark.verdicts(rows[:4]))


def test_of_parts_with_sharp_edges_what_counts_is_the_mesh_with_lines_and_tools_are_the_same_for_both(benchmark):
    rows = [
        row(benchmark, "refitted", 9.0, model="c_fandisk"),
        row(benchmark, "subset", 9.0, model="c_fandisk"),
        row(benchmark, "refitted", 3.0, model="c_fandisk", lines="sharp:30", haus=5.0),
        row(benchmark, "subset", 4.0, model="c_fandisk", lines="sharp:30"),
        row(benchmark, "MeshLab quadric, onto ends", 4.0, model="c_fandisk"),
    ]
    head, without, with_lines, *_ = benchmark.ratio_table(rows)
    assert head[:3] == ["model", "%", "refitted vmean"]
    assert [without[0], without[3], without[6]] == ["c_fandisk", "2.250", "2.250"]
    assert [with_lines[0], with_lines[3], with_lines[6]] == ["c_fandisk, sharp:30", "0.750", "1.000"]
    above, mean, largest = benchmark.verdicts(rows)
    assert above.endswith(": none")
    assert mean.endswith(": none")
    assert largest.endswith(": c_fandisk 1.250 (1.250 at 5 %, sharp:30)")
    # of several tolerances each size takes the one that suits it
    finer = [
        row(benchmark, "refitted", 2.0, model="c_fandisk", lines="sharp:30@1e-4", haus=2.0),
        row(benchmark, "subset", 2.0, model="c_fandisk", lines="sharp:30@1e-4"),
    ]
    assert all(line.endswith(": none") for line in benchmark.verdicts(rows + finer))
    assert [r.lines for r in benchmark.best_of_lines(rows[:1] + rows[2:3] + finer[:1])] == ["sharp:30@1e-4"]


@pytest.mark.parametrize(("of", "inner"), [("face:300", 0), ("ring:300", 1)])
def test_of_a_front_patch_a_whole_scan_is_made_with_a_ragged_rim_at_the_foot_and_without_handles(scans, of, inner):
    front = load(of)
    points, faces = scans.whole_scan(front.points, front.faces)
    what = topology(faces)
    assert (what.components, what.loops, what.crowded, what.touching, what.mismatched) == (1, 1 + 2 * inner, 0, 0, 0)
    scan = trimesh.Trimesh(points, faces, process=False)
    assert scan.euler_number == 2 - what.loops
    assert len(np.unique(points, axis=0)) == len(points) == len(np.unique(faces))
    # nothing is moved in front, and something is cut off at the foot
    kept = {tuple(point) for point in front.points.tolist()} & {tuple(point) for point in points.tolist()}
    assert 0.7 * len(front.points) < len(kept) < len(front.points)
    assert points[:, 1].min() > front.points[:, 1].min()
    # wound as the front is: its faces look to the viewer
    whole_rows = {tuple(point): k for k, point in enumerate(points.tolist())}
    place = np.array([whole_rows.get(tuple(point), -1) for point in front.points.tolist()])
    own = place[front.faces][(place[front.faces] >= 0).all(axis=1)]
    assert {tuple(face) for face in np.sort(own).tolist()} & {tuple(face) for face in np.sort(faces).tolist()}
    rolled = {tuple(np.roll(face, k)) for face in faces for k in range(3)}
    assert sum(tuple(face) in rolled for face in own.tolist()) > 0.9 * len(own)
    (rim, *_) = scans.rims(faces)
    assert (points[rim, 1] < np.median(points[:, 1])).all() or inner
    again = scans.whole_scan(front.points, front.faces)
    assert np.array_equal(again[0], points)
    assert np.array_equal(again[1], faces)


def test_how_far_rims_are_off_is_the_same_by_every_pair_of_points_and_edges(scans):
    scan, other = load("blob:200,holes=2"), load("blob:200,holes=2,seed=3")
    largest, mean = scans.rim_distance((scan.points, scan.faces), (other.points, other.faces))
    edges = []
    for mesh in (scan, other):
        ends = [(rim, np.roll(rim, -1)) for rim in scans.rims(mesh.faces)]
        edges.append(np.concatenate([mesh.points[np.column_stack(pair)] for pair in ends]))
    found = []
    for here, there in ((edges[0], edges[1]), (edges[1], edges[0])):
        away = []
        for a, b in here:
            for share in (np.arange(20) + 0.5) / 20:
                point = a + share * (b - a)
                along = ((point - there[:, 0]) * (there[:, 1] - there[:, 0])).sum(axis=1)
                along /= ((there[:, 1] - there[:, 0]) ** 2).sum(axis=1)
                foot = there[:, 0] + np.clip(along, 0, 1)[:, None] * (there[:, 1] - there[:, 0])
                away.append((np.linalg.norm(point - foot, axis=1).min(), np.linalg.norm(b - a)))
        found.append(np.array(away))
    assert largest == pytest.approx(max(away[:, 0].max() for away in found), rel=0.01)
    assert mean == pytest.approx(np.mean([np.average(away[:, 0], weights=away[:, 1]) for away in found]), rel=0.01)


def test_rims_of_closed_surfaces_are_not_off_and_a_hole_that_closed_is_infinitely_far(scans):
    ball, scan, two = (load(name) for name in ("blob:200", "blob:200,holes=1", "blob:200,holes=2"))
    closed, one, both = ((mesh.points, mesh.faces) for mesh in (ball, scan, two))
    assert scans.rim_distance(closed, closed) == (0.0, 0.0)
    assert scans.rim_distance(one, closed) == (np.inf, np.inf)
    assert scans.rim_distance(one, one) == pytest.approx((0.0, 0.0), abs=1e-12)
    largest, mean = scans.rim_distance(both, one)  # the other hole is somewhere else
    assert largest > mean > 0.5


def test_lines_are_thinned_to_a_share_of_the_diagonal(benchmark):
    assert benchmark.lines_of("", 20.0) == {}
    assert benchmark.lines_of("outline", 20.0) == {"break_lines": "outline"}
    assert benchmark.lines_of("sharp:30@1e-3", 20.0) == {"break_lines": "sharp:30", "line_tolerance": 0.02}


def test_without_a_referee_or_with_another_sheet_it_stops_in_a_line(benchmark, tmp_path, capsys):
    with pytest.raises(SystemExit, match="is no Python file with a function measure"):
        benchmark.main(["--referee", str(tmp_path / "none.py")])
    with pytest.raises(SystemExit):
        benchmark.main(["--referee", str(tmp_path / "none.py"), "-o", "sheet.xls"])
    assert "sheet.xls: write .csv or .md" in capsys.readouterr().err
