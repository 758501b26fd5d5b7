"""What people see of break lines of closed surfaces: in folders, in the shell, in experiments' stores."""

from __future__ import annotations

import csv
import itertools
import json

import numpy as np
import pytest
import trimesh
from closed_lining import BALL, meridian, parallel

from meshsimp_pymoo import Front, MeshProblem
from meshsimp_pymoo.cli import main, searching
from meshsimp_pymoo.cli.requests import Free, Output, Request, Search, Tiling, Wish
from meshsimp_pymoo.comparison.store import as_begun, read_model, write_model
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source.lines import SourceLines
from meshsimp_pymoo.formats.table import read_lines, write_lines
from meshsimp_pymoo.plane.faces import edge_table
from meshsimp_pymoo.storage import FRONT_COLUMNS, LINES
from meshsimp_pymoo.surface.measures import OF_LINES
from meshsimp_pymoo.surface.rules import Rules
from meshsimp_pymoo.surface.smallest import smallest_mesh, tolerance_for
from meshsimp_pymoo.warming import CLOSED_WISH

pytestmark = [
    pytest.mark.usefixtures("sketched"),
    pytest.mark.filterwarnings("ignore:.*is no height field but a closed surface"),
]

MODEL = "sphere:300"
GIVEN = (meridian(), parallel(0.995, 12))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("lines") / "lines.geojson"
    write_lines(path, SourceLines("lines", GIVEN, ("the meridian", "the parallel")))
    return path


@pytest.fixture(scope="module")
def problem(file):
    return MeshProblem(MODEL, break_lines=file, line_tolerance=0.02, n_threads=1)


@pytest.fixture(scope="module")
def front(problem):
    shares = np.array([[0.1], [0.3], [0.6]])
    return Front.from_subsets(problem, np.random.default_rng(4).random((3, problem.n_var)) < shares, ends=True)


def test_a_front_and_its_lines_read_back_and_all_its_files_have_them(front, tmp_path):
    stored = front.save(tmp_path / "out", chosen=1, mesh_format="obj", refit=True, pictures=False)
    with (stored / "front.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert tuple(rows[0])[: len(FRONT_COLUMNS + OF_LINES)] == FRONT_COLUMNS + OF_LINES
    assert all(0.0 < float(row["line_mean_error"]) <= float(row["line_max_error"]) <= 0.02 for row in rows)
    again = Front.load(stored)
    assert again.quality == front.quality
    assert again.model.hash == front.model.hash
    for given in (None, MODEL, front.model, front.surface):
        same = Front.load(stored, model=given)
        assert np.array_equal(same.model.xy, front.model.xy)
        assert [one.tolist() for one in same[1].lines] == [one.tolist() for one in front[1].lines]
    thinned = read_lines(stored / LINES)
    for line, chain in zip(thinned.lines, front.model.lines.chains, strict=True):
        np.testing.assert_array_equal(line, front.model.file_points[chain])
    assert again.run["model"]["lines"]["smallest"] == front[0].triangles == smallest_mesh(front.surface)
    for path in (*stored.glob("meshes/*.obj"), *stored.glob("refitted/*.obj"), stored / "chosen.obj"):
        vertices = trimesh.load(path, process=False).vertices
        for line in read_lines(path).lines:
            assert (np.abs(vertices[:, None] - line).max(axis=2).min(axis=0) == 0.0).all()


def test_every_solution_has_its_lines_as_chains_of_edges(front):
    for solution in front:
        edges = set(map(tuple, edge_table(solution.faces).ends.tolist()))
        assert len(solution.lines) == 2
        for chain in solution.lines:
            assert {(min(pair), max(pair)) for pair in itertools.pairwise(chain.tolist())} <= edges
        assert len(solution.mesh.metadata["break_lines"]) == 2


def test_a_stored_model_of_an_experiment_has_its_lines(problem, tmp_path):
    model = problem.model
    (tmp_path / "models").mkdir()
    place = write_model(tmp_path, model)
    read = read_model(tmp_path, place, model.hash)
    for name in ("points", "faces", "xy", "poles", "part", "source_index", "weights"):
        assert np.array_equal(getattr(read, name), getattr(model, name)), name
    assert read.lines.arrays().keys() == model.lines.arrays().keys()
    begun = as_begun(tmp_path, model)
    assert np.array_equal(begun.xy, model.xy)
    assert begun.hash == model.hash


def test_the_shell_says_what_lines_are_and_keeps_them(problem, file, tmp_path, capsys):
    given = ["--break-lines", str(file), "--line-tolerance", "0.02"]
    assert main(["info", MODEL, *given, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)["lines"]
    assert (facts["lines"], facts["forced_edges"]) == (2, len(problem.model.lines.segments))
    out, most = tmp_path / "out", facts["smallest"] + 20
    how = ["--moves", "1000", "--no-page", "--meshes", "1"]
    assert main(["simplify", MODEL, "-o", str(out), *given, "--triangles", str(most), *how]) == 0
    said = capsys.readouterr().out
    assert f"every mesh keeps their {facts['forced_edges']} edges, the smallest has {facts['smallest']} triang" in said
    assert ", line max " in said
    chosen = Front.load(out)
    assert main(["score", MODEL, str(out / "chosen.ply"), "--front", str(out), "--json"]) == 0
    best = chosen[chosen.run["chosen"]]
    assert json.loads(capsys.readouterr().out)["line_max_error"] == pytest.approx(best.line_max_error, abs=1e-9)
    wished = str(facts["smallest"] - 2)
    assert main(["simplify", MODEL, "-o", str(tmp_path / "small"), *given, "--triangles", wished, "-q"]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert f"the smallest mesh of {MODEL} has {facts['smallest']} triangles; --line-tolerance 0.0" in line


def test_the_tolerance_that_is_named_allows_the_wish(problem):
    wished = smallest_mesh(problem.surface) - 10
    tolerance = tolerance_for(problem.surface, wished)
    coarser = MeshProblem(problem.model, rules=Rules(break_lines=list(GIVEN), line_tolerance=tolerance))
    assert smallest_mesh(coarser.surface) <= wished
    assert tolerance_for(problem.surface, 4) is None


def test_what_lines_of_closed_surfaces_need_is_compiled():
    rules = Rules(break_lines="sharp:30")
    options = Options(surface="closed")
    request = Request("m.ply", options, rules, Search(), Wish({"triangles": 9}), Free(), Output(folder="."), Tiling())
    assert searching._parts(request) == [*CLOSED_WISH, "break lines"]


def test_sharp_edges_of_two_parts_go_through_a_search_and_its_folder(tmp_path, capsys):
    cube, ball = trimesh.creation.box().subdivide().subdivide(), trimesh.creation.icosphere(subdivisions=2)
    ball.apply_translation(BALL)
    mesh = trimesh.util.concatenate([cube, ball])
    mesh.export(tmp_path / "pair.ply")
    how = [
        "--surface",
        "closed",
        "--break-lines",
        "sharp:40",
        "--triangles",
        "120",
        "--moves",
        "1000",
        "--no-page",
        "-q",
    ]
    assert main(["simplify", str(tmp_path / "pair.ply"), "-o", str(tmp_path / "out"), *how]) == 0
    front = Front.load(tmp_path / "out")
    assert len(front.model.lines.chains) == 12
    assert max(solution.line_max_error for solution in front) < 1e-6
